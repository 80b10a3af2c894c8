// SPDX-License-Identifier: Apache-2.0
// Lit surfaces that hang upright: windows, signs, posters, clocks. Their plane, and their outline on it.
//
// Plane: a region is small and seen obliquely, so its own depth and normals say little of how it faces; the wall around
// it says much. With r = (x, y, 1) and X = z r, an upright plane is 1/z = a (e1 . r) + b (e2 . r), where e1, e2 span
// the horizontal. a and b are those with the smallest truncated relative error over pairs of samples (RANSAC), then
// least squares on their inliers, weighted by z^2 as the errors of depth are. Samples have the region's label, lie in
// it or around it, and are certain where enough are. A plane that misses the region's own depth by more than kOffPlane
// is not the one it hangs on.
// Outline: the region's pixels on that plane, as a rectangle along its horizontal and vertical. What is hidden is
// added:
//   reveal  a window stands reveal_m behind its wall, whose edge hides  reveal_m tan(angle)  of it on the side towards
//           the camera, at most as much as is seen.
//   group   where something stands before a side of it, a window is as wide (high) as those of its group, or else of its
//           wall, are in the median that are seen whole.
// Cost: for each region two passes over its surroundings, kPlanePairs evaluations of at most kPlaneSamples errors.
#ifndef NPSIM_LIGHT_DETAIL_LAMP_PLANE_HPP
#define NPSIM_LIGHT_DETAIL_LAMP_PLANE_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/light/detail/lamp_depth.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace light_detail {

inline constexpr std::size_t kPlaneSamples = 256;
inline constexpr std::size_t kPlanePairs = 48;  // half of the samples wrong: no good pair with probability 1e-6
inline constexpr std::size_t kFewestSamples = 12;
inline constexpr float kPlaneTolerance = 0.04F;  // relative depth error of an inlier
inline constexpr float kOffPlane = 0.15F;
inline constexpr float kGrazing = 0.02F;        // cosine to the ray below which a plane gives no depth
inline constexpr float kSticksOut = 0.7F;       // cosine between a sign's normal and its wall's below which it does
inline constexpr float kBeforeSurface = 0.03F;  // of the depth, by which a patch moves off its wall at most
inline constexpr float kEdgeOn = 2.5F;          // width over height of what may be seen on the wrong wall
inline constexpr float kCutShare = 0.25F;       // of a side that something stands before

// What may stand before a window without being part of its wall.
inline constexpr LabelSet kBeforeWall =
    kForegroundLabels | LabelSet::of(label::vegetation, label::static_object, label::dynamic_object);

// Upright plane: dot(normal, X) = offset, the normal facing the camera, so offset < 0.
struct UprightPlane {
  Vec3f normal;
  float offset = 0;  // 0: not known

  [[nodiscard]] bool known() const noexcept { return offset < 0.0F; }
  // Along a ray with z = 1; 0 where it runs along the plane or away from it.
  [[nodiscard]] float depth(const Vec3f& ray) const noexcept {
    const float s = dot(normal, ray);
    return s < -kGrazing * length(ray) ? offset / s : 0.0F;
  }
};

struct PlaneSample {
  float e1, e2;  // the ray along the horizontal directions
  float w;       // 1 / z
};

// The label of most of a region's pixels.
[[nodiscard]] inline Label region_label(const RegionInput& in, const LightRegion& r, std::uint16_t value) noexcept {
  Label best = label::unlabeled;
  int votes = 0;  // majority vote (Boyer and Moore 1991)
  for (int y = r.y0; y <= r.y1; ++y) {
    for (int x = r.x0; x <= r.x1; ++x) {
      if (in.light_index(x, y) != value) continue;
      if (votes == 0) best = in.labels(x, y);
      votes += in.labels(x, y) == best ? 1 : -1;
    }
  }
  return best;
}

[[nodiscard]] inline UprightPlane fit_upright(Span<const PlaneSample> samples, const Vec3f& e1,
                                              const Vec3f& e2) noexcept {
  const std::size_t n = samples.size();
  const auto error = [&](const PlaneSample& s, double a, double b) {
    const double w = static_cast<double>(s.w);
    return std::fabs(a * static_cast<double>(s.e1) + b * static_cast<double>(s.e2) - w) / w;
  };
  const double tolerance = static_cast<double>(kPlaneTolerance);
  double a = 0.0;
  double b = 0.0;
  double best = tolerance * static_cast<double>(n);
  for (std::size_t i = 0; i < kPlanePairs; ++i) {
    const PlaneSample& p = samples[(i * 37U) % n];
    const PlaneSample& q = samples[(i * 61U + n / 2U) % n];
    const double det =
        static_cast<double>(p.e1) * static_cast<double>(q.e2) - static_cast<double>(q.e1) * static_cast<double>(p.e2);
    if (!(std::fabs(det) > 1e-6)) continue;
    const double pa =
        (static_cast<double>(p.w) * static_cast<double>(q.e2) - static_cast<double>(q.w) * static_cast<double>(p.e2)) /
        det;
    const double pb =
        (static_cast<double>(p.e1) * static_cast<double>(q.w) - static_cast<double>(q.e1) * static_cast<double>(p.w)) /
        det;
    double cost = 0.0;
    for (std::size_t s = 0; s < n && cost < best; ++s) cost += std::min(error(samples[s], pa, pb), tolerance);
    if (cost < best) {
      best = cost;
      a = pa;
      b = pb;
    }
  }
  if (a == 0.0 && b == 0.0) return {};
  for (int round = 0; round < 3; ++round) {
    double m11 = 0.0, m12 = 0.0, m22 = 0.0, v1 = 0.0, v2 = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      const PlaneSample& s = samples[i];
      if (!(error(s, a, b) < tolerance)) continue;
      const double w = static_cast<double>(s.w);
      const double x = static_cast<double>(s.e1) / w;
      const double y = static_cast<double>(s.e2) / w;
      m11 += x * x;
      m12 += x * y;
      m22 += y * y;
      v1 += x;  // right side w / w = 1
      v2 += y;
    }
    const double det = m11 * m22 - m12 * m12;
    if (!(det > 1e-9 * m11 * m22)) break;
    a = (v1 * m22 - v2 * m12) / det;
    b = (m11 * v2 - m12 * v1) / det;
  }
  const double size = std::sqrt(a * a + b * b);
  if (!(size > 1e-6) || !(size < 1e3)) return {};
  const Vec3f away = e1 * static_cast<float>(a / size) + e2 * static_cast<float>(b / size);
  return {-away, static_cast<float>(-1.0 / size)};
}

struct PlaneSearch {
  const RegionInput& in;
  ImageView<const std::uint16_t> instances;  // may be empty
  const Intrinsics& camera;
  const GroundPlane& ground;
  Span<PlaneSample> samples;
  Span<float> scratch;
};

[[nodiscard]] constexpr bool is_wall(Label l) noexcept { return l == label::building || l == label::wall; }

// Appends samples of a rectangle, evenly in raster order, until there are `limit`.
template <class Wanted>
inline void sample_plane(const PlaneSearch& at, int x0, int y0, int x1, int y1, Wanted&& wanted, std::size_t limit,
                         std::size_t& count) noexcept {
  x0 = std::max(x0, 0);
  y0 = std::max(y0, 0);
  x1 = std::min(x1, at.in.depth.width() - 1);
  y1 = std::min(y1, at.in.depth.height() - 1);
  std::size_t total = 0;
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) total += wanted(x, y) ? 1U : 0U;
  }
  const std::size_t step = total / (limit - count) + 1;
  const Vec3f e1 = forward_on_ground(at.ground);
  const Vec3f e2 = cross(e1, at.ground.up);
  std::size_t seen = 0;
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      if (!wanted(x, y) || seen++ % step != 0 || count == limit) continue;
      const Vec3f ray = unproject_pixel(at.camera, x, y, 1.0F);
      at.samples[count++] = {dot(ray, e1), dot(ray, e2), 1.0F / at.in.depth(x, y)};
    }
  }
}

// The plane that a region at depth z hangs on; not known where its surroundings show none. Half of the samples are from
// close by, so that the wall beside it counts for more than the next one.
[[nodiscard]] inline UprightPlane region_plane(const PlaneSearch& at, const LightRegion& r, std::uint16_t value,
                                               float z) noexcept {
  const RegionInput& in = at.in;
  const Label own = in.labels.empty() ? label::unlabeled : region_label(in, r, value);
  const std::uint16_t instance =
      at.instances.empty() ? std::uint16_t{0} : at.instances((r.x0 + r.x1) / 2, (r.y0 + r.y1) / 2);
  const int side = std::max(r.x1 - r.x0, r.y1 - r.y0) + 1;
  // A wall goes on around a window; what else carries a lamp may turn a corner beside it.
  const int close = in.labels.empty() ? 0 : std::max(side / 4, 1);
  const int wide = is_wall(own) ? std::max(side, in.depth.width() / 20) : close;
  for (const bool certain : {true, false}) {
    const auto wanted = [&](int x, int y) {
      if (!is_surface(in, x, y) || (certain && !is_certain(in, x, y))) return false;
      if (in.labels.empty()) return in.light_index(x, y) == value;
      return in.labels(x, y) == own && (at.instances.empty() || is_wall(own) || at.instances(x, y) == instance);
    };
    std::size_t count = 0;
    sample_plane(at, r.x0 - close, r.y0 - close, r.x1 + close, r.y1 + close, wanted, kPlaneSamples / 2, count);
    sample_plane(at, r.x0 - wide, r.y0 - wide, r.x1 + wide, r.y1 + wide, wanted, kPlaneSamples, count);
    if (count < kFewestSamples) continue;
    const Vec3f e1 = forward_on_ground(at.ground);
    const UprightPlane plane =
        fit_upright(Span<const PlaneSample>(at.samples.data(), count), e1, cross(e1, at.ground.up));
    const Vec3f ray = unproject(at.camera, static_cast<float>(r.mean_x()), static_cast<float>(r.mean_y()), 1.0F);
    const float there = plane.known() ? plane.depth(ray) : 0.0F;
    if (there > 0.0F && std::fabs(there - z) <= kOffPlane * z) return plane;
  }
  return {};
}

// By how much the plane must move towards its front so that three quarters of the surface that depth shows in the
// region lie behind it, at most `limit`: a patch within the wall would be shaded by it.
[[nodiscard]] inline float before_surface(const PlaneSearch& at, const LightRegion& r, std::uint16_t value,
                                          const UprightPlane& plane, float limit) noexcept {
  std::size_t count = 0;
  for (int y = r.y0; y <= r.y1; ++y) {
    for (int x = r.x0; x <= r.x1 && count < at.scratch.size(); ++x) {
      if (at.in.light_index(x, y) != value || !is_surface(at.in, x, y)) continue;
      at.scratch[count++] = dot(plane.normal, unproject_pixel(at.camera, x, y, at.in.depth(x, y))) - plane.offset;
    }
  }
  if (count == 0) return 0.0F;
  float* quarter = at.scratch.data() + 3 * (count - 1) / 4;
  select_nth(at.scratch.data(), quarter, at.scratch.data() + count);
  return clamp_to(*quarter, -limit, limit);
}

// Mean normal of the region, facing the camera; zero where there is none to trust.
[[nodiscard]] inline Vec3f region_normal(const RegionInput& in, const LightRegion& r, std::uint16_t value,
                                         ImageView<const Vec3f> normals, const Vec3f& ray) noexcept {
  Vec3d sum;
  if (!normals.empty()) {
    for (int y = r.y0; y <= r.y1; ++y) {
      for (int x = r.x0; x <= r.x1; ++x) {
        if (in.light_index(x, y) == value && is_finite(normals(x, y))) sum += vec_cast<double>(normals(x, y));
      }
    }
  }
  const Vec3f n = vec_cast<float>(normalized(sum));
  return dot(n, ray) > 0.0F ? -n : n;
}

// A sign whose own normals turn away from its wall sticks out of it, at its own depth.
[[nodiscard]] inline UprightPlane across_wall(const UprightPlane& wall, const Vec3f& normal, const Vec3f& centre,
                                              const GroundPlane& ground) noexcept {
  if (!(dot(normal, normal) > 0.5F) || dot(normal, wall.normal) > kSticksOut) return wall;
  Vec3f across = normalized(cross(ground.up, wall.normal));
  if (dot(across, centre) > 0.0F) across = -across;
  const UprightPlane plane{across, dot(across, centre)};
  return plane.depth(centre / centre.z) > 0.0F ? plane : wall;
}

// A rectangle on an upright plane: centre + s u + t v with s in [u0, u1], t in [v0, v1].
struct Outline {
  UprightPlane plane;
  Vec3f origin, u, v;  // a point of the plane; horizontal; upwards
  float u0 = 0, u1 = 0, v0 = 0, v1 = 0;
  float fill = 1.0F;  // share of the rectangle that the region covers
  bool cut[4] = {};   // something stands before the side at u0, u1, v0, v1

  [[nodiscard]] bool known() const noexcept { return plane.known(); }
  [[nodiscard]] Vec3f centre() const noexcept { return origin + u * (0.5F * (u0 + u1)) + v * (0.5F * (v0 + v1)); }
};

[[nodiscard]] inline Outline region_outline(const RegionInput& in, const LightRegion& r, std::uint16_t value,
                                            const UprightPlane& plane, const Intrinsics& k,
                                            const GroundPlane& ground) noexcept {
  Outline o;
  const Vec3f ray = unproject(k, static_cast<float>(r.mean_x()), static_cast<float>(r.mean_y()), 1.0F);
  const float z = plane.depth(ray);
  if (!(z > 0.0F)) return o;
  o.origin = ray * z;
  o.u = normalized(cross(ground.up, plane.normal));
  o.v = cross(plane.normal, o.u);
  float area = 0.0F;
  int sides[4] = {};  // pixels on each side
  int cut[4] = {};    // of those, before which something stands
  bool any = false;
  const auto blocks = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < in.labels.width() && y < in.labels.height() && kBeforeWall.contains(in.labels(x, y));
  };
  const auto in_region = [&](int x, int y) {
    return x >= 0 && y >= 0 && x < in.light_index.width() && y < in.light_index.height() &&
           in.light_index(x, y) == value;
  };
  for (int y = r.y0; y <= r.y1; ++y) {
    for (int x = r.x0; x <= r.x1; ++x) {
      if (in.light_index(x, y) != value) continue;
      const Vec3f pixel = unproject_pixel(k, x, y, 1.0F);
      const float at = plane.depth(pixel);
      if (!(at > 0.0F)) continue;
      const Vec3f p = pixel * at - o.origin;
      const float pu = dot(p, o.u);
      const float pv = dot(p, o.v);
      o.u0 = any ? std::min(o.u0, pu) : pu;
      o.u1 = any ? std::max(o.u1, pu) : pu;
      o.v0 = any ? std::min(o.v0, pv) : pv;
      o.v1 = any ? std::max(o.v1, pv) : pv;
      any = true;
      area += at * at * at / (k.fx * k.fy * -plane.offset);  // of the pixel on the plane
      if (in.labels.empty()) continue;
      constexpr int kBeside[4][2] = {{-1, 0}, {1, 0}, {0, 1}, {0, -1}};  // the plane's u is to the right, v upwards
      for (int i = 0; i < 4; ++i) {
        if (in_region(x + kBeside[i][0], y + kBeside[i][1])) continue;
        ++sides[i];
        cut[i] += blocks(x + kBeside[i][0], y + kBeside[i][1]) ? 1 : 0;
      }
    }
  }
  if (!any) return o;
  // The outermost pixels reach half of themselves further: a step of a column along the horizontal of the plane, and
  // of a row upwards.
  const Vec3f column = unproject(k, static_cast<float>(r.mean_x()) + 0.5F, static_cast<float>(r.mean_y()), 1.0F);
  const float further = plane.depth(column);
  const float half_u = further > 0.0F ? std::fabs(dot(column * further - o.origin, o.u)) : 0.0F;
  const float half_v = 0.5F * z / k.fy;
  o.u0 -= half_u;
  o.u1 += half_u;
  o.v0 -= half_v;
  o.v1 += half_v;
  o.fill = std::min(area / ((o.u1 - o.u0) * (o.v1 - o.v0)), 1.0F);
  for (int i = 0; i < 4; ++i) o.cut[i] = static_cast<float>(cut[i]) > kCutShare * static_cast<float>(sides[i]);
  o.plane = plane;
  return o;
}

// Adds what the edge of the wall hides of a pane that stands reveal_m behind it.
inline void add_reveal(Outline& o, float reveal_m) noexcept {
  const Vec3f c = o.centre();
  const float away = -dot(c, o.plane.normal);
  const auto hidden = [&](const Vec3f& axis, float& low, float& high) {
    const float slope = dot(c, axis) / away;  // of the ray along the axis, per metre into the wall
    const float extra = std::min(std::fabs(slope) * reveal_m, high - low);
    (slope > 0.0F ? low : high) += slope > 0.0F ? -extra : extra;
  };
  hidden(o.u, o.u0, o.u1);
  hidden(o.v, o.v0, o.v1);
}

// The outline of a region at depth z; not known where it shows no plane. `normal`: its own mean normal, or zero.
// `on_wall`: it cannot stick out. At a corner the wall seen edge-on may win; it shows by an outline much wider than
// high that the region's own normals contradict.
[[nodiscard]] inline Outline surface_outline(const PlaneSearch& at, const LightRegion& r, std::uint16_t value, float z,
                                             const Vec3f& normal, bool on_wall) noexcept {
  const Vec3f centre = unproject(at.camera, static_cast<float>(r.mean_x()), static_cast<float>(r.mean_y()), z);
  UprightPlane plane = region_plane(at, r, value, z);
  if (!plane.known()) return {};
  plane.offset += before_surface(at, r, value, plane, kBeforeSurface * z);
  if (!on_wall) plane = across_wall(plane, normal, centre, at.ground);
  const Outline o = region_outline(at.in, r, value, plane, at.camera, at.ground);
  const bool edge_on = o.u1 - o.u0 > kEdgeOn * (o.v1 - o.v0);
  const bool contradicted = dot(normal, normal) > 0.5F && dot(normal, plane.normal) < 0.5F;
  return o.known() && !(edge_on && contradicted) ? o : Outline{};
}

// One wall, as well as a fit knows it.
[[nodiscard]] inline bool same_wall(const UprightPlane& a, const UprightPlane& b) noexcept {
  return dot(a.normal, b.normal) > 0.97F && std::fabs(a.offset - b.offset) < 1.0F;
}

// Size of those outlines that are seen whole along one direction, in the median; 0 where there is none. `same` says
// which outlines belong together.
template <class Same>
[[nodiscard]] inline float usual_size(Span<const Outline> outlines, bool upwards, Same&& same,
                                      Span<float> scratch) noexcept {
  std::size_t count = 0;
  for (std::size_t i = 0; i < outlines.size() && count < scratch.size(); ++i) {
    const Outline& o = outlines[i];
    if (!o.known() || !same(i) || o.cut[upwards ? 2 : 0] || o.cut[upwards ? 3 : 1]) continue;
    scratch[count++] = upwards ? o.v1 - o.v0 : o.u1 - o.u0;
  }
  return count > 0 ? median(scratch.sub(0, count)) : 0.0F;
}

// Lets a hidden side reach as far as the usual size says.
inline void add_hidden(float size, bool cut_low, bool cut_high, float& low, float& high) noexcept {
  const float missing = size - (high - low);
  if (!(missing > 0.0F) || !(cut_low || cut_high)) return;
  const float share = cut_low && cut_high ? 0.5F : 1.0F;
  if (cut_low) low -= share * missing;
  if (cut_high) high += share * missing;
}

}  // namespace light_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_DETAIL_LAMP_PLANE_HPP
