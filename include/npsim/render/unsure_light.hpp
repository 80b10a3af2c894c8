// SPDX-License-Identifier: Apache-2.0
// Light on surfaces whose shape is measured with noise, at samples far apart or drawn: what may be expected of it.
//
// Dents, steps and outlines that noise makes, or that are made up between samples, turn light away or shade it: a night
// shows them as black and as glaring scraps. What the shape may be with equal right differs over some widths of the
// noise, so the light that is expected is the mean over as far. It is taken among pixels of one label and of like
// albedo, because the photograph, unlike the depth, knows where surfaces end:
//   L(p) = A(p) sum_q w(p, q) L(q) / A(q) / sum_q w(p, q)
//   w = tent(q - p) (1 - |ln A(p) - ln A(q)|^2 / ratio^2)_+^2 of one label, 0 of another
// by the a-trous filter of detail/atrous.hpp, where w is that of the taps of each iteration. Radiance over albedo is
// filtered, so texture stays sharp. The weights know no light: the filter is linear, and may take one light at a time.
// Pixels that take no part keep what they have and give nothing. Error against double precision: 1e-5 of the greatest
// light within reach. Cost: 9 taps per pixel and iteration, and as many multiplications for each plane; on a street of
// 45 lamps a sixth of all the time that light takes.
#ifndef NPSIM_RENDER_UNSURE_LIGHT_HPP
#define NPSIM_RENDER_UNSURE_LIGHT_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/render/detail/atrous.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct UnsureLightParams {
  // Standard deviation of the tent at least, in widths of the noise (DepthNoise), at most 52 px; 0: off. Between the
  // samples of a laser it is their distance.
  float reach = 2.5F;
  float ratio = 0.7F;  // |ln A(p) - ln A(q)| of colours that have nothing in common
};

[[nodiscard]] inline Status validate(const UnsureLightParams& p) noexcept {
  return p.reach >= 0.0F && p.ratio > 0.0F  // false for NaN
             ? Status()
             : Status(StatusCode::invalid_argument, "unsure light: reach is not negative, ratio positive");
}

// The fewest iterations whose tent, of variance (4^n - 1) / 6, is as wide as that; at most 7.
[[nodiscard]] constexpr int unsure_light_iterations(float sigma_px) noexcept {
  int n = 0;
  for (float variance = 0.0F; n < 7 && variance < sigma_px * sigma_px; ++n) {
    variance += 0.5F * static_cast<float>(1 << (2 * n));
  }
  return n;
}

// How far light is taken from, px.
[[nodiscard]] constexpr int unsure_light_reach_px(int iterations) noexcept { return (1 << iterations) - 1; }

// What the weights go by, per pixel, in planes: logarithms of the albedo's channels, and the label; -1 takes no part.
struct UnsureLightGuides {
  Shape shape;
  Span<float> planes;  // floats(shape); empty: nothing is unsure
  int iterations = 0;

  [[nodiscard]] static constexpr std::size_t floats(Shape shape) noexcept { return 4 * shape.pixels(); }
  // What light is divided by: black has no logarithm.
  [[nodiscard]] static constexpr Vec3f divisor(const Vec3f& albedo) noexcept {
    constexpr float kDarkest = 1e-3F;
    return {max_of(albedo.x, kDarkest), max_of(albedo.y, kDarkest), max_of(albedo.z, kDarkest)};
  }
  void set(std::size_t pixel, const Vec3f& albedo, Label label) const noexcept {
    const Vec3f a = divisor(albedo);
    const float values[4] = {std::log(a.x), std::log(a.y), std::log(a.z), static_cast<float>(label)};
    for (std::size_t i = 0; i < 4; ++i) planes[i * shape.pixels() + pixel] = values[i];
  }
  void leave_out(std::size_t pixel) const noexcept {
    for (std::size_t i = 0; i < 4; ++i) planes[i * shape.pixels() + pixel] = i < 3 ? 0.0F : -1.0F;
  }
};

namespace unsure_light_detail {

struct Weights {
  float per_ratio2;
  const UnsureLightGuides& guides;

  template <class F>
  struct Guide {
    F r, g, b, label;
  };
  template <class F>
  [[nodiscard]] NPSIM_ALWAYS_INLINE Guide<F> at(std::ptrdiff_t pixel) const noexcept {
    const std::size_t plane = guides.shape.pixels();
    const float* const p = guides.planes.data() + pixel;
    return {F::load(p), F::load(p + plane), F::load(p + 2 * plane), F::load(p + 3 * plane)};
  }
  template <class F>
  [[nodiscard]] NPSIM_ALWAYS_INLINE F weight(const Guide<F>& p, const Guide<F>& q, float spline) const noexcept {
    const F r = q.r - p.r, g = q.g - p.g, b = q.b - p.b;
    const F alike = F(1.0F) - fma(r, r, fma(g, g, b * b)) * per_ratio2;
    const auto counts = (alike > F(0.0F)) & (p.label >= F(0.0F)) & (p.label == q.label);
    return select(counts, alike * alike * spline, F(0.0F));
  }
};

}  // namespace unsure_light_detail

// Filters rows [first, last) of `count` planes of the guides' shape that lie one behind the other, radiance over
// albedo. `other` has room for as many, and either may hold the result: `planes` is where it is. Where the rows end
// inside the picture, what lies beyond them must be 0 in both, and in `planes` the outermost unsure_light_reach_px() of
// them too: then this is the filter of the whole picture.
template <class F = simd::F32, class Executor>
Status spread_unsure_light_in_rows(const UnsureLightParams& params, const UnsureLightGuides& guides, int first,
                                   int last, std::size_t count, Span<float>& planes, Span<float>& other,
                                   Executor& executor) {
  const Shape shape = guides.shape;
  if (guides.planes.size() != UnsureLightGuides::floats(shape) || planes.size() < count * shape.pixels() ||
      other.size() < count * shape.pixels() || first < 0 || last < first || last > shape.height) {
    return Status(StatusCode::shape_mismatch, "unsure light: guides and planes must have one size");
  }
  NPSIM_RETURN_IF_ERROR(validate(params));
  const unsure_light_detail::Weights weights{1.0F / (params.ratio * params.ratio), guides};
  atrous_detail::filter<F>(weights, shape, first, last, guides.iterations, count, planes, other, executor);
  return {};
}

// The same for whole planes, whatever light is in them.
template <class F = simd::F32, class Executor>
Status spread_unsure_light(const UnsureLightParams& params, const UnsureLightGuides& guides, std::size_t count,
                           Span<float>& planes, Span<float>& other, Executor& executor) {
  return spread_unsure_light_in_rows<F>(params, guides, 0, guides.shape.height, count, planes, other, executor);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_UNSURE_LIGHT_HPP
