// SPDX-License-Identifier: Apache-2.0
// Edge-avoiding a-trous filter (Dammertz et al., HPG 2010) for noisy indirect irradiance on the pixel grid.
//
// Irradiance, not radiance, is filtered, so that texture stays sharp. Iteration i takes 3 x 3 taps 2^i pixels apart with
// the weights (1 2 1) / 4 along rows and columns, which makes a tent in the end; a tap counts by how well its normal
// agrees (cosine to a power) and how near it lies to the centre's tangent plane, relative to depth. Weights know geometry
// alone: the filter is linear, so filtering each light and adding up is filtering their sum, and what it leaves of noise
// can be known by filtering noise.
// Many planes, all channels of several lights, are filtered at once and share the weights, which cost most.
// Pixels without a point keep what they have and give nothing. Cost: 9 taps per pixel, iteration and plane. Memory: as
// many planes again. Error: bias only where irradiance changes within one smooth surface over less than the footprint
// (2 * 2^iterations pixels).
#ifndef NPSIM_RENDER_DENOISE_HPP
#define NPSIM_RENDER_DENOISE_HPP

#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/render/detail/atrous.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct DenoiseParams {
  int iterations = 4;              // footprint 31 px; 0 switches the filter off; at most 8
  int normal_power_doublings = 5;  // the cosine between normals counts to the power 2^5 = 32
  float plane_sigma = 0.01F;       // distance from the tangent plane, as a share of depth
};

[[nodiscard]] inline Status validate(const DenoiseParams& p) noexcept {
  const bool good = p.iterations >= 0 && p.iterations <= 8 && p.normal_power_doublings >= 0 &&
                    p.normal_power_doublings <= 8 && p.plane_sigma > 0.0F;
  return good ? Status()
              : Status(StatusCode::invalid_argument, "denoise: iterations and power in 0..8, plane_sigma positive");
}

inline constexpr std::size_t kMostDenoisedPlanes = 12;

// What the weights go by, per pixel, in planes: the point that it shows (z <= 0: none) and its unit normal.
struct DenoiseGuides {
  Shape shape;
  Span<float> planes;  // 6 * shape.pixels(): position x, y, z, normal x, y, z

  [[nodiscard]] static constexpr std::size_t floats(Shape shape) noexcept { return 6 * shape.pixels(); }
  void set(int x, int y, const Vec3f& position, const Vec3f& normal) const noexcept {
    const std::size_t pixel =
        static_cast<std::size_t>(y) * static_cast<std::size_t>(shape.width) + static_cast<std::size_t>(x);
    const float values[6] = {position.x, position.y, position.z, normal.x, normal.y, normal.z};
    for (std::size_t i = 0; i < 6; ++i) planes[i * shape.pixels() + pixel] = values[i];
  }
};

namespace denoise_detail {

// What taps count by.
struct Weights {
  const DenoiseParams& params;
  const DenoiseGuides& guides;

  template <class F>
  struct Guide {
    F px, py, pz, nx, ny, nz;
  };
  template <class F>
  [[nodiscard]] NPSIM_ALWAYS_INLINE Guide<F> at(std::ptrdiff_t pixel) const noexcept {
    const std::size_t plane = guides.shape.pixels();
    const float* const p = guides.planes.data() + pixel;
    return {F::load(p),
            F::load(p + plane),
            F::load(p + 2 * plane),
            F::load(p + 3 * plane),
            F::load(p + 4 * plane),
            F::load(p + 5 * plane)};
  }
  // A rational kernel of the distance from the tangent plane instead of exp: cheap, and as wide in its core.
  template <class F>
  [[nodiscard]] NPSIM_ALWAYS_INLINE F weight(const Guide<F>& p, const Guide<F>& q, float spline) const noexcept {
    const F off = fma(p.nz, q.pz - p.pz, fma(p.ny, q.py - p.py, p.nx * (q.px - p.px))) / (p.pz * params.plane_sigma);
    F cosine = fma(p.nz, q.nz, fma(p.ny, q.ny, p.nx * q.nx));
    const auto counts = (cosine > F(0.0F)) & (q.pz > F(0.0F)) & (p.pz > F(0.0F));
    for (int d = 0; d < params.normal_power_doublings; ++d) cosine = cosine * cosine;
    return select(counts, cosine * spline / fma(off, off, F(1.0F)), F(0.0F));
  }
};

}  // namespace denoise_detail

// Filters `count` <= kMostDenoisedPlanes planes of the guides' shape that lie one behind the other; `other` has room for
// as many. Either may hold the result: `planes` is where it is.
template <class F = simd::F32, class Executor>
Status denoise_planes(const DenoiseParams& params, const DenoiseGuides& guides, std::size_t count, Span<float>& planes,
                      Span<float>& other, Executor& executor) {
  const Shape shape = guides.shape;
  if (guides.planes.size() != DenoiseGuides::floats(shape) || count > kMostDenoisedPlanes ||
      planes.size() < count * shape.pixels() || other.size() < count * shape.pixels()) {
    return Status(StatusCode::shape_mismatch, "denoise: guides and planes must have one size, at most 12 planes");
  }
  NPSIM_RETURN_IF_ERROR(validate(params));
  const denoise_detail::Weights weights{params, guides};
  atrous_detail::filter<F>(weights, shape, 0, shape.height, params.iterations, count, planes, other, executor);
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_DENOISE_HPP
