// SPDX-License-Identifier: Apache-2.0
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
#ifndef NPSIM_DEPTH_NORMAL_CONVENTION_HPP
#define NPSIM_DEPTH_NORMAL_CONVENTION_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/normals.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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

#endif  // NPSIM_DEPTH_NORMAL_CONVENTION_HPP
