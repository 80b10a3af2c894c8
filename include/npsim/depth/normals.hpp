// SPDX-License-Identifier: Apache-2.0
// Normals of a depth map, and by them the axes and signs that a file of normals uses.
#ifndef NPSIM_DEPTH_NORMALS_HPP
#define NPSIM_DEPTH_NORMALS_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/valid_depths.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Surface normals from z-depth, equation (3.4), with the full perspective tangents or with the thesis' own.
//
// perspective: with w = 1/z and (a, b) = (u - cx, v - cy) the normal that faces the camera is
//     n = -(fx w_u, fy w_v, w - a w_u - b w_v) / |.|,
//   which is (-fx z_u, -fy z_v, z + a z_u + b z_v) up to scale and sign. Inverse depth of a plane is linear in the
//   image, so taking the differences in w makes the discrete normal exact on planes: it is the normal of the triangle
//   through the pixel and its two neighbours. Invariant: n . ray < 0 for every depth, to rounding: where neighbouring
//   depths differ by a factor above 1e4 the normal is all but across the ray, and n . ray <= 1e-7.
// thesis: n = (fx z_u / z, fy z_v / z, -1) / |.|, equations (3.4) and (3.5) with the printed sign turned towards the
//   camera. It takes du/dx = fx/d, which holds d constant, and is biased away from the image centre. n.z < 0 always,
//   n . ray < 0 only on surfaces that are not steep.
// Differences are forward; backward in the last column and row and where the forward neighbour is missing. A pixel
// whose depth is missing, or that has no neighbour along a row or along a column, gets the zero vector ("no normal").
//
// With p = z w_u = (z - z_u) / z_u and q = z w_v the perspective normal is (-fx p, -fy q, a p + b q - 1): differences
// of depth and not of inverse depth, so nothing cancels that is not known to the last bit. A depth ratio above 1e12
// between neighbours counts as 1e12. Error against double: angle below 5e-7 (1 + |a| / fx + |b| / fy) rad
// (perspective), 5e-7 rad (thesis), at any depth and slope; the same bits for every number of lanes. Rounding of the
// depth itself weighs more: fx 2^-24 rad and up. Cost: one pass, O(pixels), three divisions and a root per pixel.
// Memory: none.

// How the tangents of the depth map are formed; shared by normals_from_depth and by the losses.
enum class TangentForm : std::uint8_t {
  perspective,  // the pinhole camera's, exact on planes: the default
  thesis,       // (1, 0, dz/dx) and (0, 1, dz/dy) as printed in (3.4)
};

struct NormalsParams {
  TangentForm tangents = TangentForm::perspective;
};

[[nodiscard]] constexpr std::size_t normals_workspace_bytes(const NormalsParams&, Shape) noexcept { return 0; }

namespace depth_detail {

// Normal that faces the camera, from inverse depth and its derivatives per pixel at image coordinates (u, v).
[[nodiscard]] inline Vec3d perspective_normal(const Intrinsics& k, double u, double v, double w, double w_u,
                                              double w_v) noexcept {
  const double a = u - static_cast<double>(k.cx);
  const double b = v - static_cast<double>(k.cy);
  return normalized(Vec3d{-static_cast<double>(k.fx) * w_u, -static_cast<double>(k.fy) * w_v, a * w_u + b * w_v - w});
}

template <class F>
struct Neighbour {
  F depth;  // any positive number where there is none
  F step;   // 1: the next pixel, -1: the previous one
  typename F::MaskType found;
};

// The next pixel along an axis, the previous one where that is missing.
template <class F>
[[nodiscard]] Neighbour<F> one_sided_neighbour(F next, F previous) noexcept {
  const auto forward = are_valid_depths(next);
  const auto found = forward | are_valid_depths(previous);
  return {select(found, select(forward, next, previous), F(1.0F)), select(forward, F(1.0F), F(-1.0F)), found};
}

// Pixels x .. x + lanes - 1 of a row of `width`, missing (0) where they lie outside or where there is no row.
template <class F>
[[nodiscard]] F row_or_missing(const float* row, int x, int width) noexcept {
  if (row == nullptr) return F(0.0F);
  if (x >= 0 && x + F::lanes <= width) return F::load(row + x);
  float some[F::lanes];
  for (int i = 0; i < F::lanes; ++i) some[i] = x + i >= 0 && x + i < width ? row[x + i] : 0.0F;
  return F::load(some);
}

// Normals of the pixels x .. x + lanes - 1; `above` and `below` are null outside the image.
template <class F>
[[nodiscard]] simd::F32x3<F> row_normals(TangentForm form, const Intrinsics& k, const float* above, const float* row,
                                         const float* below, int x, int y, int width) noexcept {
  const F here = row_or_missing<F>(row, x, width);
  const Neighbour<F> u =
      one_sided_neighbour(row_or_missing<F>(row, x + 1, width), row_or_missing<F>(row, x - 1, width));
  const Neighbour<F> v = one_sided_neighbour(row_or_missing<F>(below, x, width), row_or_missing<F>(above, x, width));
  const auto usable = are_valid_depths(here) & u.found & v.found;
  const F z = select(usable, here, F(1.0F));
  const auto limited = [](F ratio) { return simd::clamp(ratio, -1e12F, 1e12F); };
  F nx;
  F ny;
  F nz(-1.0F);
  if (form == TangentForm::perspective) {
    const F p = limited((z - u.depth) / u.depth) * u.step;
    const F q = limited((z - v.depth) / v.depth) * v.step;
    const F a = (F::iota() + F(static_cast<float>(x) + 0.5F)) - F(k.cx);
    const F b((static_cast<float>(y) + 0.5F) - k.cy);
    nx = p * F(-k.fx);
    ny = q * F(-k.fy);
    nz = fma(a, p, fma(b, q, nz));
  } else {
    nx = limited((u.depth - z) / z) * u.step * F(k.fx);
    ny = limited((v.depth - z) / z) * v.step * F(k.fy);
  }
  const F scale = F(1.0F) / sqrt(fma(nx, nx, fma(ny, ny, nz * nz)));
  const F none(0.0F);
  return {select(usable, nx * scale, none), select(usable, ny * scale, none), select(usable, nz * scale, none)};
}

}  // namespace depth_detail

// depth: z-depth in metres. normals: same shape, camera frame. They may not share memory. F: the float batch.
template <class F = simd::F32, class Executor>
[[nodiscard]] Status normals_from_depth(const NormalsParams& params, ImageView<const float> depth,
                                        const Intrinsics& intrinsics, ImageView<Vec3f> normals, Workspace&,
                                        Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(intrinsics));
  if (depth.empty()) return {StatusCode::no_valid_input, "normals_from_depth: the depth image is empty"};
  if (normals.empty() || normals.shape() != depth.shape()) {
    return {StatusCode::shape_mismatch, "normals_from_depth: normals and depth differ in shape"};
  }
  if (params.tangents != TangentForm::perspective && params.tangents != TangentForm::thesis) {
    return {StatusCode::invalid_argument, "normals_from_depth: unknown form of tangents"};
  }
  const int width = depth.width();
  const int height = depth.height();
  executor.for_chunks(static_cast<std::size_t>(height), 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      const float* row = depth.row(y);
      const float* below = y + 1 < height ? depth.row(y + 1) : nullptr;
      const float* above = y > 0 ? depth.row(y - 1) : nullptr;
      for (int x = 0; x < width; x += F::lanes) {
        simd::store3(&normals(x, y).x,
                     depth_detail::row_normals<F>(params.tangents, intrinsics, above, row, below, x, y, width),
                     width - x < F::lanes ? width - x : F::lanes);
      }
    }
  });
  return {};
}

// Finds out which axes and signs a file of normals uses, by comparing it with the normals of the depth map.
//
// Normal maps come as (x right, y down, z forward), as (x right, y up, z towards the viewer), with axes permuted or
// mirrored, and rarely say so. All 48 signed axis permutations are scored by the mean dot product with the normals
// from depth, over pixels where the depth is smooth; the best one wins. Scores of all 48 follow from the nine sums of
// products between components, so the image is read once.
//
// Derivatives are differences over 4 pixels each way (1 in images under 16 px), in inverse depth: wide enough that
// quantised depth still shows its slope. Where a sample is missing the next one inwards serves, so that depth of which
// only a fifth is there will do. A pixel is smooth where inverse depth bends by less than 2 % of itself.
// Normals that are wrong on part of the image are outvoted, as long as the rest shows all three axes.
// Invariant: deterministic; near-ties (1e-6) go to the convention nearest to identity in the order of enumeration, so
// a fronto-parallel scene, which says nothing about x and y, keeps them.
// Cost: one pass, serial, double. Memory: none. `agreement` lies in [-1, 1]; below about 0.5, doubt the file. It is a
// mean over the picture and says nothing about an axis for which the picture holds no evidence: such an axis keeps the
// file's own sign, however high the agreement.

// Canonical component i (camera frame, facing the camera) is sign[i] times raw component axis[i].
struct NormalConvention {
  std::int8_t axis[3] = {0, 1, 2};
  std::int8_t sign[3] = {1, 1, 1};
};

[[nodiscard]] constexpr bool operator==(const NormalConvention& a, const NormalConvention& b) noexcept {
  for (int i = 0; i < 3; ++i) {
    if (a.axis[i] != b.axis[i] || a.sign[i] != b.sign[i]) return false;
  }
  return true;
}
[[nodiscard]] constexpr bool operator!=(const NormalConvention& a, const NormalConvention& b) noexcept {
  return !(a == b);
}

[[nodiscard]] constexpr Vec3f apply_normal_convention(const NormalConvention& c, const Vec3f& raw) noexcept {
  const float component[3] = {raw.x, raw.y, raw.z};
  return {static_cast<float>(c.sign[0]) * component[c.axis[0]], static_cast<float>(c.sign[1]) * component[c.axis[1]],
          static_cast<float>(c.sign[2]) * component[c.axis[2]]};
}

inline void apply_normal_convention(const NormalConvention& convention, ImageView<Vec3f> normals) noexcept {
  if (normals.empty()) return;
  for (int y = 0; y < normals.height(); ++y) {
    for (int x = 0; x < normals.width(); ++x) {
      normals(x, y) = apply_normal_convention(convention, normals(x, y));
    }
  }
}

namespace depth_detail {

// Smooth second difference of inverse depth, relative to inverse depth itself.
inline constexpr double kSmoothBend = 0.02;

// Inverse depth at the valid pixel farthest from (x, y) along (step_x, step_y), but no farther than `reach`.
[[nodiscard]] inline bool far_neighbour(ImageView<const float> depth, int x, int y, int step_x, int step_y, int reach,
                                        double& inverse, int& distance) noexcept {
  for (distance = reach; distance > 0; --distance) {
    const float z = depth(x + distance * step_x, y + distance * step_y);
    if (!is_valid_depth(z)) continue;
    inverse = 1.0 / static_cast<double>(z);
    return true;
  }
  return false;
}

// Reference normal at (x, y) by differences over at most `reach` pixels each way; false where depth is missing or
// bends.
[[nodiscard]] inline bool smooth_normal(ImageView<const float> depth, const Intrinsics& k, int x, int y, int reach,
                                        Vec3d& normal) noexcept {
  if (!is_valid_depth(depth(x, y))) return false;
  const double here = 1.0 / static_cast<double>(depth(x, y));
  double slope[2] = {};
  for (int axis = 0; axis < 2; ++axis) {
    const int dx = axis == 0 ? 1 : 0;
    const int dy = 1 - dx;
    double before = 0;
    double after = 0;
    int to_before = 0;
    int to_after = 0;
    if (!far_neighbour(depth, x, y, -dx, -dy, reach, before, to_before) ||
        !far_neighbour(depth, x, y, dx, dy, reach, after, to_after)) {
      return false;
    }
    const double between = (before * to_after + after * to_before) / (to_before + to_after);
    if (!(std::abs(between - here) < 0.5 * kSmoothBend * here)) return false;
    slope[axis] = (after - before) / (to_before + to_after);
  }
  normal = perspective_normal(k, x + 0.5, y + 0.5, here, slope[0], slope[1]);
  return true;
}

}  // namespace depth_detail

// raw: normals as read, scaled to [-1, 1] but with unknown axes, the shape of depth. Vectors shorter than 0.1 or not
// finite are ignored. With nothing to compare the result is the identity and `agreement` is 0. An axis without evidence
// (x and y of a picture of one wall seen head-on) keeps the file's own sign, and `agreement` does not tell.
[[nodiscard]] inline NormalConvention detect_normal_convention(ImageView<const Vec3f> raw, ImageView<const float> depth,
                                                               const Intrinsics& intrinsics,
                                                               float& agreement) noexcept {
  agreement = 0;
  NormalConvention best;
  if (raw.empty() || depth.empty() || raw.shape() != depth.shape() || !validate(intrinsics).ok()) return best;

  const int reach = raw.width() >= 16 && raw.height() >= 16 ? 4 : 1;
  double product[3][3] = {};  // sum over pixels of depth normal component i times raw component j
  std::size_t count = 0;
  for (int y = reach; y < raw.height() - reach; ++y) {
    for (int x = reach; x < raw.width() - reach; ++x) {
      const Vec3d r = vec_cast<double>(raw(x, y));
      const double r_length = length(r);
      Vec3d n;
      if (!(r_length > 0.1 && std::isfinite(r_length)) ||
          !depth_detail::smooth_normal(depth, intrinsics, x, y, reach, n)) {
        continue;
      }
      const double ni[3] = {n.x, n.y, n.z};
      const double rj[3] = {r.x / r_length, r.y / r_length, r.z / r_length};
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) product[i][j] += ni[i] * rj[j];
      }
      ++count;
    }
  }
  if (count == 0) return best;

  constexpr std::int8_t kPermutations[6][3] = {{0, 1, 2}, {1, 0, 2}, {0, 2, 1}, {2, 1, 0}, {1, 2, 0}, {2, 0, 1}};
  double best_score = -2;
  for (const auto& axis : kPermutations) {
    for (unsigned negative = 0; negative < 8; ++negative) {
      NormalConvention candidate;
      double score = 0;
      for (unsigned i = 0; i < 3; ++i) {
        candidate.axis[i] = axis[i];
        candidate.sign[i] = (negative >> i & 1U) != 0 ? std::int8_t{-1} : std::int8_t{1};
        score += product[i][axis[i]] * static_cast<double>(candidate.sign[i]);
      }
      score /= static_cast<double>(count);
      if (score > best_score + 1e-6) {
        best_score = score;
        best = candidate;
      }
    }
  }
  agreement = static_cast<float>(best_score < 1.0 ? best_score : 1.0);
  return best;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_NORMALS_HPP
