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
// Cost: 2 x 81 samples a pixel that is asked for. Memory: none.
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

inline constexpr int kTaps = 9;

// Gaussian of the taps -1 .. 1, of half that width.
[[nodiscard]] constexpr float tap_weight(int i) noexcept {
  constexpr float kWeights[kTaps] = {0.135F, 0.325F, 0.607F, 0.882F, 1.0F, 0.882F, 0.607F, 0.325F, 0.135F};
  return kWeights[i];
}

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

template <class Weight>
[[nodiscard]] FittedPlane fit_local(ImageView<const float> depth, const ObjectMap& objects, int x, int y, float spacing,
                                    Weight&& weight) noexcept {
  float s = 0, su = 0, sv = 0, suu = 0, suv = 0, svv = 0, sw = 0, suw = 0, svw = 0;
  const float w0 = 1.0F / depth(x, y);
  for (int j = 0; j < kTaps; ++j) {
    const int dy = static_cast<int>(std::floor(spacing * static_cast<float>(j - kTaps / 2) + 0.5F));
    for (int i = 0; i < kTaps; ++i) {
      const int dx = static_cast<int>(std::floor(spacing * static_cast<float>(i - kTaps / 2) + 0.5F));
      if (!depth.contains(x + dx, y + dy)) continue;
      const float z = depth(x + dx, y + dy);
      if (!is_valid_depth(z) || !objects.same(x, y, x + dx, y + dy)) continue;
      const float u = static_cast<float>(dx);
      const float v = static_cast<float>(dy);
      const float w = 1.0F / z;
      const float k = tap_weight(i) * tap_weight(j) * weight(u, v, w);
      const float off = (w - w0) * k;  // about the centre, so that nothing cancels
      s += k;
      su += k * u;
      sv += k * v;
      suu += k * u * u;
      suv += k * u * v;
      svv += k * v * v;
      sw += off;
      suw += off * u;
      svw += off * v;
    }
  }
  FittedPlane plane;
  if (!(s > 0.0F)) return plane;
  const float mu = su / s;
  const float mv = sv / s;
  const float mw = sw / s;
  const float cuu = suu / s - mu * mu;
  const float cuv = suv / s - mu * mv;
  const float cvv = svv / s - mv * mv;
  const float cuw = suw / s - mu * mw;
  const float cvw = svw / s - mv * mw;
  const float det = cuu * cvv - cuv * cuv;
  if (!(det > 1e-3F * cuu * cvv) || !(cuu > 0.1F) || !(cvv > 0.1F)) return plane;
  plane.a = (cuw * cvv - cvw * cuv) / det;
  plane.b = (cvw * cuu - cuw * cuv) / det;
  plane.c = w0 + mw - plane.a * mu - plane.b * mv;
  plane.found = plane.c > 0.0F;
  return plane;
}

// What most of the surroundings show: the centre's w, or their median where the centre is not among them.
[[nodiscard]] inline float typical_w(ImageView<const float> depth, const ObjectMap& objects, int x, int y,
                                     float spacing, float tolerance) noexcept {
  std::array<float, 25> some;
  int count = 0;
  for (int j = -2; j <= 2; ++j) {
    for (int i = -2; i <= 2; ++i) {
      const int u = x + static_cast<int>(std::floor(spacing * static_cast<float>(2 * i) + 0.5F));
      const int v = y + static_cast<int>(std::floor(spacing * static_cast<float>(2 * j) + 0.5F));
      if (!depth.contains(u, v) || !is_valid_depth(depth(u, v)) || !objects.same(x, y, u, v)) continue;
      some[static_cast<std::size_t>(count++)] = 1.0F / depth(u, v);
    }
  }
  const float w = 1.0F / depth(x, y);
  if (count < 3) return w;
  select_nth(some.data(), some.data() + count / 2, some.data() + count);
  const float median = some[static_cast<std::size_t>(count / 2)];
  return std::fabs(w - median) > tolerance ? median : w;
}

[[nodiscard]] inline FittedPlane fitted_plane(const FittedNormalsParams& p, ImageView<const float> depth,
                                              const ObjectMap& objects, const DepthNoise& noise,
                                              const Intrinsics& camera, int x, int y) noexcept {
  const float w0 = 1.0F / depth(x, y);
  const float sigma = noise.deviation(w0);
  const bool broad = !objects.labels.empty() && p.broad.contains(objects.labels(x, y));
  const float size_m = broad ? p.broad_size_m : p.max_size_m;
  const float spacing = footprint_px(p, noise, camera, depth.width(), size_m, w0) / static_cast<float>(kTaps - 1);
  const float near = 1.0F / (p.step * w0 + 3.0F * sigma);
  const float about = typical_w(depth, objects, x, y, spacing, p.step * w0 + 3.0F * sigma);
  FittedPlane plane = fit_local(depth, objects, x, y, spacing, [&](float, float, float w) {
    const float t = (w - about) * near;
    return 1.0F / (1.0F + t * t);
  });
  if (!plane.found) return plane;
  const float close = 1.0F / (0.25F * p.step * w0 + 3.0F * sigma);
  const FittedPlane again = fit_local(depth, objects, x, y, spacing, [&](float u, float v, float w) {
    const float t = (w - (plane.c + plane.a * u + plane.b * v)) * close;
    return 1.0F / (1.0F + t * t);
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
