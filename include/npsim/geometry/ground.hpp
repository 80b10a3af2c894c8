// SPDX-License-Identifier: Apache-2.0
// The ground plane, dot(up, X) = -camera_height_m, from the depth of road-like pixels.
//
// A plane is linear in inverse depth: with r = ((u - cx)/fx, (v - cy)/fy, 1) and X = z r, 1/z = q . r where up = -q/|q|
// and the camera height is 1/|q|. A seeded search over triples of samples (RANSAC; Fischler and Bolles 1981) finds the
// plane with the smallest truncated relative error, then weighted least squares (weight z^2, so errors count relative
// to the depth, as those of stereo and of networks do) refines it on its inliers. A car close ahead may have more samples
// than the road beside it: without labels, where no plane of a street comes out, those alone are looked for, with eight
// times as many triples, and a smaller share of the samples is enough where hardly any lie under the plane, since
// nothing lies under the ground.
// Fallback, marked by inlier_share = 0: a level plane 1.5 m below the camera, where too few samples exist or the result
// is implausible. So the function succeeds for every valid input.
// Samples: road and parking; pavement and other ground only where those are too few; without labels the lower 40 % of
// the image.
// Cost: iterations x samples. Memory: 12 bytes per sample.
// Error on exact depth of a plane: tilt below 1e-4 rad, height below 1e-4 relative (float rays); on noisy depth see the
// test.
#ifndef NPSIM_GEOMETRY_GROUND_HPP
#define NPSIM_GEOMETRY_GROUND_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct GroundPlane {
  Vec3f up{0.0F, -1.0F, 0.0F};  // unit, camera frame
  float camera_height_m = 1.5F;
  float inlier_share = 0.0F;  // of the samples, 0 for the fallback
};

struct GroundParams {
  std::uint64_t seed = 0;
  int iterations = 128;           // 1..4096; 128 triples miss 50 % inliers with probability 4e-8
  int max_samples = 4096;         // 16..65536
  int min_samples = 64;           // >= 3; below this the next set of labels joins, then the fallback
  float tolerance = 0.05F;        // relative depth error of an inlier, in (0, 0.5]
  float min_inlier_share = 0.3F;  // below: fallback
  float min_up_cosine = 0.82F;    // to the image's up direction; 35 degrees of pitch and roll
  float min_height_m = 0.3F;
  float max_height_m = 10.0F;
  float fallback_height_m = 1.5F;
  float min_lowest_share = 0.15F;  // of inliers, without labels, where not a fourth as many lie under the plane
};

struct GroundSample {
  float x, y;  // ray (x, y, 1)
  float w;     // 1 / depth
};

[[nodiscard]] constexpr std::size_t ground_workspace_bytes(const GroundParams& p, Shape) noexcept {
  return allocation_bytes<GroundSample>(p.max_samples > 0 ? static_cast<std::size_t>(p.max_samples) : 0) +
         kWorkspaceAlignment;
}

[[nodiscard]] inline Status validate(const GroundParams& p) noexcept {
  const bool good = p.iterations >= 1 && p.iterations <= 4096 && p.max_samples >= 16 && p.max_samples <= 65536 &&
                    p.min_samples >= 3 && p.tolerance > 0.0F && p.tolerance <= 0.5F && p.min_inlier_share >= 0.0F &&
                    p.min_lowest_share >= 0.0F && p.min_height_m > 0.0F && p.max_height_m >= p.min_height_m &&
                    p.fallback_height_m > 0.0F && std::isfinite(p.min_up_cosine) && std::isfinite(p.fallback_height_m);
  return good ? Status() : Status(StatusCode::invalid_argument, "ground: a parameter lies outside its range");
}

namespace geometry_detail {

// Solves the symmetric 3 x 3 system m q = b by Cramer's rule; false where it is singular to double precision.
[[nodiscard]] inline bool solve3(const Vec3d& m0, const Vec3d& m1, const Vec3d& m2, const Vec3d& b, Vec3d& q) noexcept {
  const Vec3d c12 = cross(m1, m2);
  const double det = dot(m0, c12);
  const double scale = length(m0) * length(m1) * length(m2);
  if (!(std::fabs(det) > 1e-13 * scale)) return false;
  q = (c12 * b.x + cross(m2, m0) * b.y + cross(m0, m1) * b.z) / det;
  return is_finite(q);
}

// Relative to the sample's 1/z; positive: it lies under the plane.
[[nodiscard]] inline double signed_ground_error(const GroundSample& s, const Vec3d& q) noexcept {
  const double w = static_cast<double>(s.w);
  return (q.x * static_cast<double>(s.x) + q.y * static_cast<double>(s.y) + q.z - w) / w;
}
[[nodiscard]] inline double ground_error(const GroundSample& s, const Vec3d& q) noexcept {
  return std::fabs(signed_ground_error(s, q));
}

// Share of the samples that lie under the plane by more than its tolerance.
[[nodiscard]] inline float share_under(const GroundParams& p, Span<const GroundSample> samples,
                                       const Vec3d& q) noexcept {
  std::size_t under = 0;
  for (const GroundSample& s : samples) {
    under += signed_ground_error(s, q) > static_cast<double>(p.tolerance) ? 1U : 0U;
  }
  return static_cast<float>(static_cast<double>(under) / static_cast<double>(samples.size()));
}

// Whether a camera of a street may have it under itself.
[[nodiscard]] inline bool is_plausible_ground(const GroundParams& p, const Vec3d& q) noexcept {
  const double size = length(q);
  if (!(size > 0.0) || !std::isfinite(size)) return false;
  const Vec3f up = vec_cast<float>(-q / size);
  const float height = static_cast<float>(1.0 / size);
  return is_finite(up) && -up.y >= p.min_up_cosine && height >= p.min_height_m && height <= p.max_height_m;
}

template <class Wanted>
[[nodiscard]] inline std::size_t collect_ground(ImageView<const float> depth, const Intrinsics& k, Wanted&& wanted,
                                                Span<GroundSample> out) noexcept {
  std::size_t total = 0;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) total += wanted(x, y) ? 1U : 0U;
  }
  const std::size_t step = total / out.size() + 1;
  std::size_t seen = 0;
  std::size_t count = 0;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      if (!wanted(x, y)) continue;
      if (seen++ % step != 0 || count == out.size()) continue;
      out[count++] = {(static_cast<float>(x) + 0.5F - k.cx) / k.fx, (static_cast<float>(y) + 0.5F - k.cy) / k.fy,
                      1.0F / depth(x, y)};
    }
  }
  return count;
}

// Least squares on the inliers of `plane`, in four rounds. inlier_share: of the plane before the last.
inline void fit_to_inliers(const GroundParams& p, Span<const GroundSample> samples, Vec3d& plane,
                           float& inlier_share) noexcept {
  const double tolerance = static_cast<double>(p.tolerance);
  for (int round = 0; round < 4; ++round) {
    Vec3d m0, m1, m2, b;
    std::size_t inliers = 0;
    for (const GroundSample& s : samples) {
      if (!(ground_error(s, plane) < tolerance)) continue;
      ++inliers;
      const double w = static_cast<double>(s.w);
      const Vec3d row = Vec3d{static_cast<double>(s.x), static_cast<double>(s.y), 1.0} / w;
      m0 += row * row.x;
      m1 += row * row.y;
      m2 += row * row.z;
      b += row;  // right side w / w = 1
    }
    inlier_share = static_cast<float>(static_cast<double>(inliers) / static_cast<double>(samples.size()));
    Vec3d q;
    if (inliers < 3 || !solve3(m0, m1, m2, b, q)) break;
    plane = q;
  }
}

// Best plane through three samples each, fitted to its inliers. False where nothing fits. plausible: among those that a
// street may have.
[[nodiscard]] inline bool fit_ground(const GroundParams& p, int iterations, bool plausible,
                                     Span<const GroundSample> samples, Vec3d& best, float& inlier_share) noexcept {
  const std::size_t n = samples.size();
  const double tolerance = static_cast<double>(p.tolerance);
  double best_cost = tolerance * static_cast<double>(n);
  bool found = false;
  RandomStream random(p.seed, RandomPurpose::generic, 0, 0, 0, 0);
  for (int i = 0; i < iterations; ++i) {
    // A stream holds 1024 draws; the sample field opens a new one for each 256 triples.
    if (i % 256 == 0) random = RandomStream(p.seed, RandomPurpose::generic, 0, 0, 0, static_cast<std::uint32_t>(i));
    const GroundSample& a = samples[random.next_u32() % n];
    const GroundSample& b = samples[random.next_u32() % n];
    const GroundSample& c = samples[random.next_u32() % n];
    // Rows of the transposed system: columns are the rays, so solve with the matrix of ray components.
    const Vec3d column_x{static_cast<double>(a.x), static_cast<double>(b.x), static_cast<double>(c.x)};
    const Vec3d column_y{static_cast<double>(a.y), static_cast<double>(b.y), static_cast<double>(c.y)};
    const Vec3d column_1{1.0, 1.0, 1.0};
    const Vec3d w{static_cast<double>(a.w), static_cast<double>(b.w), static_cast<double>(c.w)};
    const double det = dot(column_x, cross(column_y, column_1));
    if (!(std::fabs(det) > 1e-9)) continue;
    const Vec3d q{dot(w, cross(column_y, column_1)) / det, dot(column_x, cross(w, column_1)) / det,
                  dot(column_x, cross(column_y, w)) / det};
    if (plausible && !is_plausible_ground(p, q)) continue;
    double cost = 0.0;
    for (std::size_t s = 0; s < n && cost < best_cost; ++s) {
      const double e = ground_error(samples[s], q);
      cost += e < tolerance ? e : tolerance;
    }
    if (cost < best_cost) {
      best_cost = cost;
      best = q;
      found = true;
    }
  }
  if (found) fit_to_inliers(p, samples, best, inlier_share);
  return found;
}

// Without labels, where the search among all planes finds none of a street.
[[nodiscard]] inline bool fit_lowest_ground(const GroundParams& p, Span<const GroundSample> samples, Vec3d& q,
                                            float& inlier_share) noexcept {
  constexpr int kMoreTriples = 8;
  if (!fit_ground(p, kMoreTriples * p.iterations, true, samples, q, inlier_share)) return false;
  if (!is_plausible_ground(p, q)) return false;
  return inlier_share >= p.min_inlier_share ||
         (inlier_share >= p.min_lowest_share && 4.0F * share_under(p, samples, q) < inlier_share);
}

}  // namespace geometry_detail

// By how many columns the picture of a vertical moves for a row further down, at (u, v); 0 where it lies flat there.
[[nodiscard]] inline float vertical_slope(const GroundPlane& ground, const Intrinsics& k, float u, float v) noexcept {
  const Vec3f ray = unproject(k, u, v, 1.0F);
  const Vec3f& up = ground.up;
  const float fall = up.y - ray.y * up.z;
  return std::fabs(fall) > 0.1F ? (up.x - ray.x * up.z) * k.fx / (fall * k.fy) : 0.0F;
}

// `labels` may be empty; otherwise they have the shape of `depth`.
[[nodiscard]] inline Status estimate_ground(const GroundParams& p, ImageView<const float> depth,
                                            ImageView<const Label> labels, const Intrinsics& k, Workspace& workspace,
                                            GroundPlane& out) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(p));
  NPSIM_RETURN_IF_ERROR(validate(k));
  if (depth.empty()) return Status(StatusCode::invalid_argument, "ground: the depth plane is empty");
  if (!labels.empty() && labels.shape() != depth.shape()) {
    return Status(StatusCode::shape_mismatch, "ground: labels must have the shape of the depth");
  }
  out = GroundPlane{};
  out.camera_height_m = p.fallback_height_m;

  const WorkspaceScope scope(workspace);
  Span<GroundSample> samples;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(p.max_samples), samples));
  constexpr LabelSet kCarriageway = LabelSet::of(label::road, label::parking);
  const int first_row = depth.height() * 3 / 5;
  std::size_t count = 0;
  for (int pass = 0; pass < 2 && count < static_cast<std::size_t>(p.min_samples); ++pass) {
    const LabelSet wanted_labels = pass == 0 ? kCarriageway : kGroundLabels;
    count = geometry_detail::collect_ground(
        depth, k,
        [&](int x, int y) {
          const float z = depth(x, y);
          if (!is_valid_depth(z) || !std::isfinite(1.0F / z)) return false;
          return labels.empty() ? y >= first_row : wanted_labels.contains(labels(x, y));
        },
        samples);
  }
  if (count < static_cast<std::size_t>(p.min_samples)) return {};

  const Span<const GroundSample> chosen(samples.data(), count);
  Vec3d q;
  float share = 0.0F;
  bool found = geometry_detail::fit_ground(p, p.iterations, false, chosen, q, share) &&
               geometry_detail::is_plausible_ground(p, q) && share >= p.min_inlier_share;
  if (!found && labels.empty()) found = geometry_detail::fit_lowest_ground(p, chosen, q, share);
  if (!found) return {};
  const double size = length(q);
  out.up = vec_cast<float>(-q / size);
  out.camera_height_m = static_cast<float>(1.0 / size);
  out.inlier_share = share;
  return {};
}

// Height of a camera-frame point above the ground, m.
[[nodiscard]] constexpr float height_above_ground(const GroundPlane& g, const Vec3f& p) noexcept {
  return dot(g.up, p) + g.camera_height_m;
}

// The camera's viewing direction laid into the ground plane; where the camera looks straight up or down, its image-up.
[[nodiscard]] inline Vec3f forward_on_ground(const GroundPlane& g) noexcept {
  const Vec3f z{0.0F, 0.0F, 1.0F};
  const Vec3f flat = z - g.up * dot(z, g.up);
  if (dot(flat, flat) > 1e-6F) return normalized(flat);
  const Vec3f y{0.0F, -1.0F, 0.0F};
  return normalized(y - g.up * dot(y, g.up));
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_GEOMETRY_GROUND_HPP
