// SPDX-License-Identifier: Apache-2.0
// A night at the size of its photograph, from one that was computed at a smaller size.
//
// Light is smooth where surfaces are; what a large photograph has more of than a small one is texture and outlines, and
// it shows both itself. So each pixel p takes the light of the 3 x 3 small pixels q about it that look like it, times
// what it is brighter than they are by day (joint bilateral upsampling, Kopf et al. 2007, with that ratio added):
//   L(p) = sum_q w_q r_q L(q) / sum_q w_q
//   w_q = B(x_p - x_q) B(y_p - y_q) / (1 + |c_p - c_q|^2 / likeness^2)^2
//   r_q = clamp((Y_p + dark) / (Y_q + dark), 1 / most_detail, most_detail)
// B: the quadratic B-spline, c: sRGB-encoded colour and Y: linear luminance of the photograph, 0 to 1. Where one of the
// nine is of the same lamp as p, or of p's class and of no lamp as p is, only those that are count; a pixel of a lamp
// that none of them is of takes the light of the nearest that is, within 64 small pixels. Lamps shine by themselves,
// sky does, and the camera's own car mirrors the night: they have no detail of the day, r = 1.
// Invariants: light that is the same everywhere, under a photograph that is, stays within 1e-6 of itself; a pixel never
// exceeds most_detail times the brightest of the nine; the bits depend on no executor. A night of the same size is
// copied.
// Cost: about 120 operations a pixel. Memory: none.
#ifndef NPSIM_PIPELINE_ENLARGE_NIGHT_HPP
#define NPSIM_PIPELINE_ENLARGE_NIGHT_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/color/srgb.hpp"
#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct EnlargeNightParams {
  float likeness = 0.08F;    // of encoded colours
  float most_detail = 2.0F;  // brighter, or darker
  float dark = 0.004F;       // below it a photograph's noise is no texture
};

[[nodiscard]] inline Status validate(const EnlargeNightParams& p) noexcept {
  const bool good = p.likeness > 0.0F && p.most_detail >= 1.0F && p.most_detail <= 1e3F && p.dark > 0.0F;
  return good ? Status() : Status(StatusCode::invalid_argument, "enlarge night: a parameter lies outside its range");
}

// What a night's pixels show, by day. Labels of both sizes or of the small one alone; lamps of both or of none.
struct DayView {
  ImageView<const Rgb8> image;  // sRGB
  ImageView<const Label> labels;
  ImageView<const std::uint16_t> light_index;
};

namespace enlarge_detail {

inline constexpr int kReach = 64;  // small pixels; of the search for a lamp

struct Neighbours {
  int at[3];
  float weight[3];
};

// Of pixel i of `to` among the pixels of `from`, both along one axis; beyond the border stands its last pixel.
[[nodiscard]] inline Neighbours neighbours(int i, int from, int to) noexcept {
  const double position = (i + 0.5) * from / to - 0.5;
  const int nearest = static_cast<int>(std::floor(position + 0.5));
  const auto t = static_cast<float>(position - nearest);  // -.5 to .5
  Neighbours n{{}, {0.5F * (0.5F - t) * (0.5F - t), 0.75F - t * t, 0.5F * (0.5F + t) * (0.5F + t)}};
  for (int k = 0; k < 3; ++k) n.at[k] = clamp_to(nearest + k - 1, 0, from - 1);
  return n;
}

[[nodiscard]] inline float square_of_difference(const Rgb8& a, const Rgb8& b) noexcept {
  const int r = a.r - b.r;
  const int g = a.g - b.g;
  const int bl = a.b - b.b;
  return static_cast<float>(r * r + g * g + bl * bl) * (1.0F / (255.0F * 255.0F));
}

struct Enlarger {
  EnlargeNightParams params;
  DayView small;
  ImageView<const Vec3f> night;
  DayView full;

  // A lamp that would have lost its last small pixel holds one of another class.
  [[nodiscard]] bool same_thing(int x, int y, int qx, int qy) const noexcept {
    const std::uint16_t lamp = full.light_index.empty() ? std::uint16_t{0} : full.light_index(x, y);
    if (!full.light_index.empty() && lamp != small.light_index(qx, qy)) return false;
    return lamp != 0 || full.labels.empty() || full.labels(x, y) == small.labels(qx, qy);
  }
  [[nodiscard]] bool without_detail(int qx, int qy) const noexcept {
    if (small.labels.empty()) return false;
    const Label l = small.labels(qx, qy);
    return l == label::sky || l == label::ego_vehicle;
  }

  // The nearest small pixel of a lamp within kReach of one; that one itself where there is none.
  [[nodiscard]] Vec3f of_lamp(std::uint16_t lamp, int qx, int qy) const noexcept {
    const Shape shape = small.light_index.shape();
    for (int r = 1; r <= kReach; ++r) {
      for (int dy = -r; dy <= r; ++dy) {
        const int y = qy + dy;
        if (y < 0 || y >= shape.height) continue;
        const int step = dy == -r || dy == r ? 1 : 2 * r;
        for (int dx = -r; dx <= r; dx += step) {
          const int x = qx + dx;
          if (x >= 0 && x < shape.width && small.light_index(x, y) == lamp) return night(x, y);
        }
      }
    }
    return night(qx, qy);
  }

  [[nodiscard]] Vec3f at(int x, int y, const Neighbours& across, const Neighbours& down) const noexcept {
    const std::uint16_t lamp = full.light_index.empty() ? std::uint16_t{0} : full.light_index(x, y);
    bool any = false;
    for (int j = 0; j < 3; ++j) {
      for (int i = 0; i < 3; ++i) {
        any = any || (across.weight[i] * down.weight[j] > 0.0F && same_thing(x, y, across.at[i], down.at[j]));
      }
    }
    if (lamp != 0 && !any) return of_lamp(lamp, across.at[1], down.at[1]);
    const Rgb8 colour = full.image(x, y);
    const float bright = luminance(srgb_decode8(colour)) + params.dark;
    const float sharp = 1.0F / (params.likeness * params.likeness);
    Vec3f sum{};
    float weights = 0.0F;
    for (int j = 0; j < 3; ++j) {
      for (int i = 0; i < 3; ++i) {
        const int qx = across.at[i];
        const int qy = down.at[j];
        if (any && !same_thing(x, y, qx, qy)) continue;
        const Rgb8 other = small.image(qx, qy);
        const float unlike = 1.0F + sharp * square_of_difference(colour, other);
        const float weight = across.weight[i] * down.weight[j] / (unlike * unlike);
        float ratio = 1.0F;
        if (lamp == 0 && !without_detail(qx, qy)) {
          ratio = clamp_to(bright / (luminance(srgb_decode8(other)) + params.dark), 1.0F / params.most_detail,
                           params.most_detail);
        }
        sum += night(qx, qy) * (weight * ratio);
        weights += weight;
      }
    }
    return weights > 0.0F ? sum * (1.0F / weights) : night(across.at[1], down.at[1]);
  }
};

}  // namespace enlarge_detail

// night: of the size of `small`; out: of that of `full`. Errors: shape_mismatch.
template <class Executor>
Status enlarge_night(const EnlargeNightParams& params, const DayView& small, ImageView<const Vec3f> night,
                     const DayView& full, ImageView<Vec3f> out, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const auto agree = [](const DayView& day, Shape shape) noexcept {
    return day.image.shape() == shape && (day.labels.empty() || day.labels.shape() == shape) &&
           (day.light_index.empty() || day.light_index.shape() == shape);
  };
  const bool both =
      (full.labels.empty() || !small.labels.empty()) && full.light_index.empty() == small.light_index.empty();
  if (night.empty() || out.empty() || !agree(small, night.shape()) || !agree(full, out.shape()) || !both) {
    return {StatusCode::shape_mismatch, "enlarge night: every plane of the day must have the size of its night"};
  }
  if (night.shape() == out.shape()) {
    copy_pixels(night, out);
    return {};
  }
  const enlarge_detail::Enlarger enlarger{params, small, night, full};
  executor.for_chunks(static_cast<std::size_t>(out.height()), 8, [&](std::size_t begin, std::size_t end) {
    for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      const enlarge_detail::Neighbours down = enlarge_detail::neighbours(y, night.height(), out.height());
      for (int x = 0; x < out.width(); ++x) {
        out(x, y) = enlarger.at(x, y, enlarge_detail::neighbours(x, night.width(), out.width()), down);
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_ENLARGE_NIGHT_HPP
