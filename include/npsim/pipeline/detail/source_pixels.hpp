// SPDX-License-Identifier: Apache-2.0
// What the photograph says about its marked sources, and what to show where it says nothing.
//
// The daytime colour of each emitter (a signal's meaning), the brightness pattern across a lit source, and the frame
// that rectification leaves around a picture. Each is one pass over the image, without memory of its own.
#ifndef NPSIM_PIPELINE_DETAIL_SOURCE_PIXELS_HPP
#define NPSIM_PIPELINE_DETAIL_SOURCE_PIXELS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/color/srgb.hpp"
#include "npsim/core/algorithm.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"
#include "npsim/light/emitter.hpp"
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

// How a lit source looks across its area, of which the photograph shows the pattern by day.
//   sign, clock, screen   its colours: print on what glows from behind passes what it reflects by day, so it can be read
//   window                its panes glow, and what differs from them by day, to either side, is frame, bar or curtain
//                         before the light: 1 / (1 + 2 (q - 1)^2 / q), q = here / panes, so a half at twice or half
//                         the brightness [default]
//   lit interior          of a window that shines by day: what the photograph shows in it, its hues by kMostHue and
//                         relative to their mean, so that the cast of its light is gone; what is nearly white, or cut
//                         off and no ink, is without hue
//   lamp                  half the contrast of the day: its glass scatters, and what reflected light is now the source
// The mean over a source's pixels is 1 where the pattern allows, so that it shows the luminance that it lights with.
enum class SourcePattern : std::uint8_t { lamp, sign, window, lit_interior };

[[nodiscard]] constexpr SourcePattern source_pattern(const Emitter& e) noexcept {
  switch (e.cls) {
    case LightClass::window_building:
    case LightClass::window_parked:
    case LightClass::window_transport: return e.shines_by_day ? SourcePattern::lit_interior : SourcePattern::window;
    case LightClass::advertisement:
    case LightClass::clock: return SourcePattern::sign;
    case LightClass::inferred_object:
      return e.profile == EmissionProfile::lambert ? SourcePattern::sign : SourcePattern::lamp;
    default: break;
  }
  return SourcePattern::lamp;
}

// Of the pixels of one mark by day.
struct SourceBrightness {
  float mean = 0;   // linear luminance; of a window: the squared mean of roots, which its frame moves less
  float scale = 1;  // brings the pattern's mean to 1
  Vec3f colour;     // linear mean
};

inline constexpr float kMostBright = 4.0F;     // a highlight of the sun is no part of a sign
inline constexpr float kDarkestPart = 0.05F;   // of a window: what is before it is lit from the other side
inline constexpr float kPatternFloor = 1e-3F;  // linear; of what is black

[[nodiscard]] inline Vec3f source_pattern_at(const SceneView& scene, SourcePattern pattern, const SourceBrightness& of,
                                             int x, int y) {
  if (!(of.mean > 0.0F)) return {1.0F, 1.0F, 1.0F};
  const Vec3f here = srgb_decode8(scene.image(x, y));
  const auto bounded = [](float v) { return v < kMostBright ? v : kMostBright; };
  if (pattern == SourcePattern::lit_interior) {
    // Of what is nearly white, or cut off and no ink, the hue is not known; and the pane mirrors some of the day.
    constexpr float kMostHue = 0.6F, kInk = 0.2F, kPale = 0.8F, kCutOffPale = 0.5F;
    constexpr int kCutOff = 250;
    const Rgb8 seen = scene.image(x, y);
    const bool cut_off = std::max(seen.r, std::max(seen.g, seen.b)) >= kCutOff;
    const float least = static_cast<float>(std::min(seen.r, std::min(seen.g, seen.b))) / 255.0F;
    const float hue = kMostHue * clamp_to(((cut_off ? kCutOffPale : kPale) - least) / (kCutOffPale - kInk), 0.0F, 1.0F);
    const auto over = [](float v, float mean) { return (v + kPatternFloor) / (mean + kPatternFloor); };
    const Vec3f plain = {over(here.x, of.colour.x), over(here.y, of.colour.y), over(here.z, of.colour.z)};
    const float bright = bounded(over(luminance(here), luminance(of.colour)));
    return (plain * (hue / luminance(plain)) + Vec3f{1.0F, 1.0F, 1.0F} * (1.0F - hue)) * (bright * of.scale);
  }
  if (pattern == SourcePattern::sign) {
    return Vec3f{bounded(here.x / of.mean), bounded(here.y / of.mean), bounded(here.z / of.mean)} * of.scale;
  }
  const float brightness = luminance(here);
  float value = 0.0F;
  if (pattern == SourcePattern::window) {
    const float q = (brightness + kPatternFloor) / of.mean;
    value = 1.0F / (1.0F + 2.0F * (q - 1.0F) * (q - 1.0F) / q);
    if (value < kDarkestPart) value = kDarkestPart;
  } else {
    value = 0.5F + 0.5F * brightness / of.mean;
    if (value > 2.0F) value = 2.0F;
  }
  value *= of.scale;
  return {value, value, value};
}

// Brightness of each mark's pixels; count: scratch of as many elements.
inline void source_brightness(const SceneView& scene, Span<const Emitter> emitters,
                              Span<const std::uint32_t> emitter_of_mark, Span<SourceBrightness> out,
                              Span<float> count) {
  const auto for_marks = [&](auto&& f) {
    for (int y = 0; y < (scene.light_index.empty() ? 0 : scene.shape().height); ++y) {
      for (int x = 0; x < scene.shape().width; ++x) {
        const std::uint16_t mark = scene.light_index(x, y);
        if (mark == 0 || emitter_of_mark[mark - 1U] == kNoPoint) continue;
        const Emitter& e = emitters[emitter_of_mark[mark - 1U]];
        f(static_cast<std::size_t>(mark - 1U), source_pattern(e), x, y);
      }
    }
  };
  for (SourceBrightness& b : out) b = {0.0F, 0.0F, {}};
  for (float& c : count) c = 0.0F;
  for_marks([&](std::size_t m, SourcePattern pattern, int x, int y) {
    const Vec3f here = srgb_decode8(scene.image(x, y));
    const float brightness = luminance(here);
    out[m].colour += here;
    out[m].mean += pattern == SourcePattern::window ? std::sqrt(brightness + kPatternFloor) : brightness;
    count[m] += 1.0F;
  });
  for (std::size_t m = 0; m < out.size(); ++m) {
    if (!(count[m] > 0.0F)) continue;
    const float mean = out[m].mean / count[m];
    out[m].colour = out[m].colour / count[m];
    const std::uint32_t e = emitter_of_mark[m];
    const bool window = e != kNoPoint && source_pattern(emitters[e]) == SourcePattern::window;
    out[m].mean = window ? mean * mean : mean;
  }
  for_marks([&](std::size_t m, SourcePattern pattern, int x, int y) {
    const SourceBrightness plain{out[m].mean, 1.0F, out[m].colour};
    out[m].scale += luminance(source_pattern_at(scene, pattern, plain, x, y));
  });
  for (std::size_t m = 0; m < out.size(); ++m) {
    out[m].scale = count[m] > 0.0F && out[m].scale > 0.0F ? count[m] / out[m].scale : 1.0F;
  }
}

// The frame that rectification leaves around some data sets' pictures shows nothing; it mirrors what is next to it,
// towards the middle of the image, within 3 % of the image's size. Where that is another thing than the pixel next to
// the frame, that pixel is repeated.
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
      if (kFrame.contains(labels(qx, qy))) continue;
      const int mx = 2 * qx - x;
      const int my = 2 * qy - y;
      const bool mirrored = labels.contains(mx, my) && labels(mx, my) == labels(qx, qy);
      image(x, y) = mirrored ? image(mx, my) : image(qx, qy);
    }
  }
}

}  // namespace relight_detail

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_SOURCE_PIXELS_HPP
