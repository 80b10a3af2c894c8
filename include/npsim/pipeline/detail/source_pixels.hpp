// SPDX-License-Identifier: Apache-2.0
// What the photograph says about its marked sources, and what to show where it says nothing.
//
// The daytime colour of each emitter (a signal's meaning), the brightness pattern across a lit source, and the frame that
// rectification leaves around a picture. Each is one pass over the image, without memory of its own.
#ifndef NPSIM_PIPELINE_DETAIL_SOURCE_PIXELS_HPP
#define NPSIM_PIPELINE_DETAIL_SOURCE_PIXELS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/render/surface_points.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace relight_detail {

// Mean colour of each emitter's pixels, weighted by the fourth power of their brightness: what a signal shows by day.
inline void daytime_colours(const SceneView& scene, Span<const std::uint32_t> emitter_of_mark, Span<Vec3f> colour,
                            Span<float> brightest) {
  for (std::size_t e = 0; e < colour.size(); ++e) {
    colour[e] = {};
    brightest[e] = 0;
  }
  if (scene.light_index.empty()) return;
  const auto linear = [](std::uint8_t v) {
    const float s = static_cast<float>(v) / 255.0F;
    return s * s;  // close enough to rank colours
  };
  for (int y = 0; y < scene.shape().height; ++y) {
    for (int x = 0; x < scene.shape().width; ++x) {
      const std::uint16_t mark = scene.light_index(x, y);
      if (mark == 0 || emitter_of_mark[mark - 1U] == kNoPoint) continue;
      const std::uint32_t e = emitter_of_mark[mark - 1U];
      const Rgb8 c = scene.image(x, y);
      const Vec3f rgb{linear(c.r), linear(c.g), linear(c.b)};
      const float peak = rgb.x > rgb.y ? (rgb.x > rgb.z ? rgb.x : rgb.z) : (rgb.y > rgb.z ? rgb.y : rgb.z);
      // Brighter pixels count far more: the lit disc, not its housing.
      const float weight = peak * peak * peak * peak;
      colour[e] += rgb * weight;
      brightest[e] += weight;
    }
  }
  for (std::size_t e = 0; e < colour.size(); ++e) {
    if (brightest[e] > 0) colour[e] = colour[e] / brightest[e];
  }
}

// Brightness of a lit source across its area, about 1 on average, at most 2: a window shows curtains and bars, a sign its letters. By day they
// show in the photograph; half of that contrast is taken, as the light now comes from behind.
[[nodiscard]] inline float texture(const SceneView& scene, float mean, int x, int y) {
  if (!(mean > 0.0F)) return 1.0F;
  const Rgb8 c = scene.image(x, y);
  const float here = luminance({static_cast<float>(c.r), static_cast<float>(c.g), static_cast<float>(c.b)});
  const float ratio = 0.5F + 0.5F * here / mean;
  return ratio < 2.0F ? ratio : 2.0F;
}

// Mean displayed brightness of each mark's pixels.
inline void mean_brightness(const SceneView& scene, Span<float> mean, Span<float> count) {
  for (float& m : mean) m = 0.0F;
  for (float& c : count) c = 0.0F;
  for (int y = 0; y < (scene.light_index.empty() ? 0 : scene.shape().height); ++y) {
    for (int x = 0; x < scene.shape().width; ++x) {
      const std::uint16_t mark = scene.light_index(x, y);
      if (mark == 0) continue;
      const Rgb8 c = scene.image(x, y);
      mean[mark - 1U] += luminance({static_cast<float>(c.r), static_cast<float>(c.g), static_cast<float>(c.b)});
      count[mark - 1U] += 1.0F;
    }
  }
  for (std::size_t m = 0; m < mean.size(); ++m) mean[m] = count[m] > 0.0F ? mean[m] / count[m] : 0.0F;
}

// The frame that rectification leaves around some data sets' pictures shows nothing; it repeats what is next to it,
// towards the middle of the image, within 3 % of the image's size.
inline void continue_over_frame(ImageView<const Label> labels, ImageView<Vec3f> image) {
  if (labels.empty()) return;
  constexpr LabelSet kFrame = LabelSet::of(label::rectification_border, label::out_of_roi);
  const Shape shape = image.shape();
  const int reach = (shape.width > shape.height ? shape.width : shape.height) / 32 + 1;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (!kFrame.contains(labels(x, y))) continue;
      int qx = x;
      int qy = y;
      for (int step = 0; step < reach && kFrame.contains(labels(qx, qy)); ++step) {
        // Inwards from the nearest border first, so that corners go diagonally.
        const bool border_x = shape.width > 2 * reach && (qx < reach || qx >= shape.width - reach);
        const bool border_y = shape.height > 2 * reach && (qy < reach || qy >= shape.height - reach);
        if (border_x) qx += qx < shape.width / 2 ? 1 : -1;
        if (border_y) qy += qy < shape.height / 2 ? 1 : -1;
      }
      if (!kFrame.contains(labels(qx, qy))) image(x, y) = image(qx, qy);
    }
  }
}

}  // namespace relight_detail

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_SOURCE_PIXELS_HPP
