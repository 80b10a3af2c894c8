// SPDX-License-Identifier: Apache-2.0
// Normals of a noisy depth: of the plane in inverse depth that fits each pixel's surroundings best.
//
// Differences between neighbours carry noise many times over, and the mean of such normals leans towards the camera: a
// normal is not linear in depth. Inverse depth of a plane is linear in the image, so a least-squares plane averages
// what can be averaged. How far it looks follows from the noise: over L x L px the slope of w is known to
// sqrt(12) sigma c / L^2 where noise is correlated over c px, and the normal turns by fx / w times that, so
//     L^2 = sqrt(12) c fx (sigma / w) / angle,
// but no farther than max_size_m on the surface, for what is curved must stay so, nor beyond its object.
// A first fit weighs samples by how near their depth is to the centre's, a second by how well the first plane explains
// them, so a step to another surface is not bridged.
// Invariant: unit length, facing the camera, or zero where there is no depth.
// Cost: 81 samples a pixel that is asked for, read one by one, and two fits to them, eight samples at a time. Memory:
// none. Error: 1e-4 rad from the same formulas in double precision (7e-5 seen, 100 m away at 1000 px of focal length).
#ifndef NPSIM_DEPTH_DETAIL_NORMALS_FITTED_NORMALS_HPP
#define NPSIM_DEPTH_DETAIL_NORMALS_FITTED_NORMALS_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/simd/fixed.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct FittedNormalsParams {
  float angle_rad = 0.015F;  // wanted deviation of a normal
  float max_size_m = 1.5F;   // of the surroundings
  LabelSet broad = LabelSet::of(label::vegetation, label::terrain, label::road, label::sidewalk, label::parking,
                                label::ground, label::rail_track);
  float broad_size_m = 5.0F;  // of theirs: ground, and plants, whose leaves have no normal that depth could know
  float min_px = 9.0F;        // of an image 960 wide
  float max_share = 0.08F;    // of the image's width
  float step = 0.02F;  // relative difference of depth, above the noise, at which a sample of the first fit counts half
};

[[nodiscard]] inline Status validate(const FittedNormalsParams& p) noexcept {
  const bool good = p.angle_rad > 0.0F && p.max_size_m > 0.0F && p.broad_size_m > 0.0F && p.min_px >= 0.0F &&
                    p.max_share > 0.0F && p.max_share <= 1.0F && p.step > 0.0F;
  return good ? Status() : Status(StatusCode::invalid_argument, "fitted normals: a parameter lies outside its range");
}

namespace depth_detail {

inline constexpr int kTaps = 9;  // along each side of the surroundings

// w = c + a u + b v about the pixel, u and v in pixels.
struct FittedPlane {
  float a = 0.0F, b = 0.0F, c = 0.0F;
  bool found = false;
};

[[nodiscard]] inline float footprint_px(const FittedNormalsParams& p, const DepthNoise& noise, const Intrinsics& camera,
                                        int width, float size_m, float w) noexcept {
  const float wanted = std::sqrt(3.4641016F * noise.width_px * camera.fx * noise.deviation(w) / (w * p.angle_rad));
  const float most = std::min(size_m * camera.fx * w, p.max_share * static_cast<float>(width));
  const float least = p.min_px * static_cast<float>(width) / 960.0F;
  return std::max(std::min(wanted, most), std::max(least, 2.0F));
}

// What is seen around a pixel, in whole batches. A tap that shows no depth of the pixel's object has no weight.
struct TapSamples {
  using Batch = simd::Fixed<8>;
  static constexpr int kSlots = (kTaps * kTaps + Batch::lanes - 1) / Batch::lanes * Batch::lanes;

  // `spacing`: px between taps.
  TapSamples(ImageView<const float> depth, const ObjectMap& objects, int x, int y, float spacing) noexcept {
    std::array<int, kTaps> offset;
    std::array<bool, kTaps> in_row;
    for (int i = 0; i < kTaps; ++i) {
      const auto at = static_cast<std::size_t>(i);
      offset[at] = static_cast<int>(std::floor(spacing * static_cast<float>(i - kTaps / 2) + 0.5F));
      in_row[at] = x + offset[at] >= 0 && x + offset[at] < depth.width();
    }
    std::size_t k = 0;
    for (std::size_t j = 0; j < kTaps; ++j) {
      const int dy = offset[j];
      const bool inside = y + dy >= 0 && y + dy < depth.height();
      for (std::size_t i = 0; i < kTaps; ++i, ++k) {
        const int dx = offset[i];
        const bool shown =
            inside && in_row[i] && is_valid_depth(depth(x + dx, y + dy)) && objects.same(x, y, x + dx, y + dy);
        u[k] = static_cast<float>(dx);
        v[k] = static_cast<float>(dy);
        w[k] = shown ? depth(x + dx, y + dy) : 1.0F;
        weight[k] = shown ? kGaussian[i] * kGaussian[j] : 0.0F;
      }
    }
    for (; k < kSlots; ++k) {
      u[k] = v[k] = weight[k] = 0.0F;
      w[k] = 1.0F;
    }
    for (std::size_t n = 0; n < kSlots; n += Batch::lanes) (Batch(1.0F) / Batch::load(&w[n])).store(&w[n]);
  }

  // Of half the taps' width.
  static constexpr float kGaussian[kTaps] = {0.135F, 0.325F, 0.607F, 0.882F, 1.0F, 0.882F, 0.607F, 0.325F, 0.135F};

  std::array<float, kSlots> u, v, w, weight;  // px, px, 1/m, 1
};

// The plane about w0 that fits the samples, each weighed by weight(u, v, w) as well.
template <class Weight>
[[nodiscard]] FittedPlane fit_plane(const TapSamples& samples, float w0, const Weight& weight) noexcept {
  using Batch = TapSamples::Batch;
  enum { k1, ku, kv, kuu, kuv, kvv, kw, kuw, kvw, kSums };
  std::array<Batch, kSums> sums;
  sums.fill(Batch(0.0F));
  for (std::size_t n = 0; n < TapSamples::kSlots; n += Batch::lanes) {
    const Batch u = Batch::load(&samples.u[n]);
    const Batch v = Batch::load(&samples.v[n]);
    const Batch w = Batch::load(&samples.w[n]);
    const Batch k = Batch::load(&samples.weight[n]) * weight(u, v, w);
    const Batch uk = u * k;
    const Batch vk = v * k;
    const Batch off = w - Batch(w0);  // about the centre, so that nothing cancels
    sums[k1] = sums[k1] + k;
    sums[ku] = sums[ku] + uk;
    sums[kv] = sums[kv] + vk;
    sums[kuu] = fma(u, uk, sums[kuu]);
    sums[kuv] = fma(u, vk, sums[kuv]);
    sums[kvv] = fma(v, vk, sums[kvv]);
    sums[kw] = fma(off, k, sums[kw]);
    sums[kuw] = fma(off, uk, sums[kuw]);
    sums[kvw] = fma(off, vk, sums[kvw]);
  }
  std::array<float, kSums> mean;
  for (std::size_t i = 0; i < kSums; ++i) {
    std::array<float, Batch::lanes> lane;
    sums[i].store(lane.data());
    mean[i] = ((lane[0] + lane[4]) + (lane[1] + lane[5])) + ((lane[2] + lane[6]) + (lane[3] + lane[7]));
  }
  FittedPlane plane;
  if (!(mean[k1] > 0.0F)) return plane;
  for (std::size_t i = ku; i < kSums; ++i) mean[i] /= mean[k1];
  const float cuu = mean[kuu] - mean[ku] * mean[ku];
  const float cuv = mean[kuv] - mean[ku] * mean[kv];
  const float cvv = mean[kvv] - mean[kv] * mean[kv];
  const float cuw = mean[kuw] - mean[ku] * mean[kw];
  const float cvw = mean[kvw] - mean[kv] * mean[kw];
  const float det = cuu * cvv - cuv * cuv;
  if (!(det > 1e-3F * cuu * cvv) || !(cuu > 0.1F) || !(cvv > 0.1F)) return plane;
  plane.a = (cuw * cvv - cvw * cuv) / det;
  plane.b = (cvw * cuu - cuw * cuv) / det;
  plane.c = w0 + mean[kw] - plane.a * mean[ku] - plane.b * mean[kv];
  plane.found = plane.c > 0.0F;
  return plane;
}

// What most of the surroundings show: w0, or the median of every second tap where w0 is not near it.
[[nodiscard]] inline float typical_w(const TapSamples& samples, float w0, float tolerance) noexcept {
  std::array<float, (kTaps / 2 + 1) * (kTaps / 2 + 1)> some;
  std::size_t count = 0;
  for (std::size_t j = 0; j < kTaps; j += 2) {
    for (std::size_t i = 0; i < kTaps; i += 2) {
      if (samples.weight[j * kTaps + i] > 0.0F) some[count++] = samples.w[j * kTaps + i];
    }
  }
  if (count < 3) return w0;
  select_nth(some.data(), some.data() + count / 2, some.data() + count);
  const float median = some[count / 2];
  return std::fabs(w0 - median) > tolerance ? median : w0;
}

[[nodiscard]] inline FittedPlane fitted_plane(const FittedNormalsParams& p, ImageView<const float> depth,
                                              const ObjectMap& objects, const DepthNoise& noise,
                                              const Intrinsics& camera, int x, int y) noexcept {
  using Batch = TapSamples::Batch;
  const float w0 = 1.0F / depth(x, y);
  const float sigma = noise.deviation(w0);
  const bool broad = !objects.labels.empty() && p.broad.contains(objects.labels(x, y));
  const float size_m = broad ? p.broad_size_m : p.max_size_m;
  const float spacing = footprint_px(p, noise, camera, depth.width(), size_m, w0) / static_cast<float>(kTaps - 1);
  const TapSamples samples(depth, objects, x, y, spacing);
  // Half at `tolerance` off, less beyond.
  const auto share = [](const Batch& off, float tolerance) {
    const Batch t = off * Batch(1.0F / tolerance);
    return Batch(1.0F) / fma(t, t, Batch(1.0F));
  };
  const float near = p.step * w0 + 3.0F * sigma;
  const float about = typical_w(samples, w0, near);
  const FittedPlane plane =
      fit_plane(samples, w0, [&](const Batch&, const Batch&, const Batch& w) { return share(w - Batch(about), near); });
  if (!plane.found) return plane;
  const float close = 0.25F * p.step * w0 + 3.0F * sigma;
  const FittedPlane again = fit_plane(samples, w0, [&](const Batch& u, const Batch& v, const Batch& w) {
    return share(w - fma(Batch(plane.b), v, fma(Batch(plane.a), u, Batch(plane.c))), close);
  });
  return again.found ? again : plane;
}

[[nodiscard]] inline Vec3f fitted_normal(const FittedPlane& plane, const Intrinsics& camera, int x, int y) noexcept {
  const float a = static_cast<float>(x) + 0.5F - camera.cx;
  const float b = static_cast<float>(y) + 0.5F - camera.cy;
  return normalized(Vec3f{-camera.fx * plane.a, -camera.fy * plane.b, a * plane.a + b * plane.b - plane.c});
}

// Hands every plane that is found to found(x, y, plane). other: of the plane that it fills.
template <class Wanted, class Found, class Executor>
[[nodiscard]] Status for_fitted_planes(const FittedNormalsParams& params, ImageView<const float> depth,
                                       const ObjectMap& objects, const DepthNoise& noise, const Intrinsics& camera,
                                       Shape other, const Wanted& wanted, const Found& found,
                                       Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = depth.shape();
  if (other != shape || !objects.fits(shape)) {
    return {StatusCode::shape_mismatch, "fitted planes: depth, objects and output must have one shape"};
  }
  executor.for_chunks(static_cast<std::size_t>(shape.height), 8, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (!is_valid_depth(depth(x, y)) || !wanted(x, y)) continue;
        const FittedPlane plane = fitted_plane(params, depth, objects, noise, camera, x, y);
        if (plane.found) found(x, y, plane);
      }
    }
  });
  return {};
}

}  // namespace depth_detail

// normals: those for which wanted(x, y) holds are replaced where a plane was found.
template <class Wanted, class Executor>
[[nodiscard]] Status fitted_normals(const FittedNormalsParams& params, ImageView<const float> depth,
                                    const ObjectMap& objects, const DepthNoise& noise, const Intrinsics& camera,
                                    const Wanted& wanted, ImageView<Vec3f> normals, Executor& executor) noexcept {
  return depth_detail::for_fitted_planes(
      params, depth, objects, noise, camera, normals.shape(), wanted,
      [&](int x, int y, const depth_detail::FittedPlane& plane) {
        const Vec3f n = depth_detail::fitted_normal(plane, camera, x, y);
        if (n != Vec3f{}) normals(x, y) = n;
      },
      executor);
}

// The same planes' depth at their middle, which is the depth without most of its noise, into `out`, which is
// not the same memory; a pixel that no plane was found for keeps its own.
template <class Wanted, class Executor>
[[nodiscard]] Status fitted_depth(const FittedNormalsParams& params, ImageView<const float> depth,
                                  const ObjectMap& objects, const DepthNoise& noise, const Intrinsics& camera,
                                  const Wanted& wanted, ImageView<float> out, Executor& executor) noexcept {
  if (out.shape() == depth.shape()) copy_pixels(depth, out);
  return depth_detail::for_fitted_planes(
      params, depth, objects, noise, camera, out.shape(), wanted,
      [&](int x, int y, const depth_detail::FittedPlane& plane) { out(x, y) = 1.0F / plane.c; }, executor);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_NORMALS_FITTED_NORMALS_HPP
