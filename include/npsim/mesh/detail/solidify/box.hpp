// SPDX-License-Identifier: Apache-2.0
// The upright box that a vehicle fills, from those of its sides that one camera sees.
//
// Heading: a vehicle's sides stand at right angles, so their horizontal normals agree when the angle is taken four
// times: the mean of w exp(4 i angle) over the faces, w = area as the camera sees it times depth squared, times the
// squared horizontal share of the normal. Area on the surface would let a ramp of wrong depth, which is all but
// parallel to the view, outvote the side. A vote of share street_weight for the camera's direction on the ground
// decides where the faces have nothing to say.
// Which of the two axes is the length: the one along which more is seen than any width explains; else the one nearer
// to the camera's direction on the ground, as traffic and parking mostly run along the street.
// Extent: the visible vertices span [low, high] along each axis, outlier_share at either end left out. A side seen over
// full_side of its nominal size is taken as it is. Else the box has its nominal size and extends away from the camera
// from the side that faces it; along an axis on which the camera stands abreast of the vehicle, to both sides alike.
//
// Invariant: a function of the vertices in their order, no trigonometry, so the same bits everywhere. Cost: linear in
// the vertices (two selections). Memory: 4 bytes a vertex of the largest object. Error: on exact depth of a box of
// nominal size seen on two sides its outline lies within 0.65 m (test); the headings of cars and buses are within 3
// degrees on the exact depth of four generated streets and within 3.5 on the refined depth of two, most within 1.5. A
// bicycle shows too few faces for a heading: it stands along the street.
#ifndef NPSIM_MESH_DETAIL_SOLIDIFY_BOX_HPP
#define NPSIM_MESH_DETAIL_SOLIDIFY_BOX_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/mesh/detail/solidify/params.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Two horizontal directions, and the interval that the box takes up along each. The camera is at 0 on both.
struct UprightBox {
  Vec3f along[2];
  float low_m[2] = {0.0F, 0.0F};
  float high_m[2] = {0.0F, 0.0F};
  int length_axis = 1;  // of the two
};

// Sum of w exp(4 i angle) over the faces of an object, angle from `right` towards `forward`.
struct HeadingVotes {
  double cosine = 0;
  double sine = 0;
  double weight = 0;
};

namespace solidify_detail {

// The horizontal frame: right and forward are unit and normal to up and to each other.
struct Horizon {
  Vec3f up, right, forward;
};

[[nodiscard]] inline Horizon horizon_of(const Vec3f& up) noexcept {
  const Vec3f z{0.0F, 0.0F, 1.0F};
  const Vec3f y{0.0F, -1.0F, 0.0F};
  Vec3f flat = z - up * dot(z, up);
  if (!(dot(flat, flat) > 1e-6F)) flat = y - up * dot(y, up);  // the camera looks straight up or down
  const Vec3f forward = normalized(flat);
  return {up, cross(forward, up), forward};
}

inline void vote(const Horizon& horizon, const Vec3f& a, const Vec3f& b, const Vec3f& c, HeadingVotes& votes) noexcept {
  const Vec3d pa = vec_cast<double>(a);
  const Vec3d n = cross(vec_cast<double>(b) - pa, vec_cast<double>(c) - pa);
  const double area2 = dot(n, n);
  const double view2 = dot(pa, pa);
  if (!(area2 > 0.0) || !(view2 > 0.0)) return;
  const double x = dot(n, vec_cast<double>(horizon.right));
  const double y = dot(n, vec_cast<double>(horizon.forward));
  const double level2 = x * x + y * y;
  if (!(level2 > 0.0)) return;
  const double seen = std::fabs(dot(n, pa)) / std::sqrt(view2);  // twice the area that the camera sees
  const double w = seen * (level2 / area2);
  const double c2 = (x * x - y * y) / level2;
  const double s2 = 2.0 * x * y / level2;
  votes.cosine += w * (c2 * c2 - s2 * s2);
  votes.sine += w * (2.0 * c2 * s2);
  votes.weight += w;
}

// From exp(i a) to exp(i a / 2), -90 < a / 2 <= 90 degrees.
inline void halve_angle(double& cosine, double& sine) noexcept {
  const double x = 1.0 + cosine;
  const double l = std::sqrt(x * x + sine * sine);
  if (!(l > 1e-9)) {
    cosine = 0.0;
    sine = 1.0;
    return;
  }
  cosine = x / l;
  sine = sine / l;
}

// Directions of the sides: along[0] within 45 degrees of right, along[1] within 45 degrees of forward.
inline void set_heading(const Horizon& horizon, const HeadingVotes& votes, float street_weight,
                        UprightBox& box) noexcept {
  const double prior = static_cast<double>(street_weight);
  double c = votes.cosine * (1.0 - prior) + votes.weight * prior;
  double s = votes.sine * (1.0 - prior);
  const double l = std::sqrt(c * c + s * s);
  if (l > 0.0 && std::isfinite(l)) {
    c /= l;
    s /= l;
    halve_angle(c, s);
    halve_angle(c, s);
  } else {
    c = 1.0;
    s = 0.0;
  }
  const auto x = static_cast<float>(c);
  const auto y = static_cast<float>(s);
  box.along[0] = horizon.right * x + horizon.forward * y;
  box.along[1] = horizon.forward * x - horizon.right * y;
}

// Sets the box's intervals. projected: room for as many floats as there are vertices in `members`.
inline void set_extent(const SolidifyParams& params, const BackRule& rule, Span<const Vec3f> vertices,
                       Span<const std::uint32_t> members, Span<float> projected, UprightBox& box) noexcept {
  const std::size_t n = members.size();
  const auto outliers = static_cast<std::size_t>(params.outlier_share * static_cast<float>(n - 1));
  float seen[2];
  for (int k = 0; k < 2; ++k) {
    for (std::size_t i = 0; i < n; ++i) projected[i] = dot(vertices[members[i]], box.along[k]);
    float* first = projected.data();
    std::nth_element(first, first + outliers, first + n);
    box.low_m[k] = first[outliers];
    std::nth_element(first + outliers, first + (n - 1 - outliers), first + n);
    box.high_m[k] = first[n - 1 - outliers];
    seen[k] = box.high_m[k] - box.low_m[k];
  }
  const bool right_is_length = seen[0] > seen[1] && seen[0] > 1.4F * rule.width_m;
  box.length_axis = right_is_length ? 0 : 1;
  for (int k = 0; k < 2; ++k) {
    const float nominal = k == box.length_axis ? rule.length_m : rule.width_m;
    if (seen[k] >= params.full_side * nominal) continue;
    if (box.low_m[k] > 0.0F) {
      box.high_m[k] = box.low_m[k] + nominal;
    } else if (box.high_m[k] < 0.0F) {
      box.low_m[k] = box.high_m[k] - nominal;
    } else {
      const float middle = 0.5F * (box.low_m[k] + box.high_m[k]);
      box.low_m[k] = middle - 0.5F * nominal;
      box.high_m[k] = middle + 0.5F * nominal;
    }
  }
}

// The ray from the camera through p leaves the box at this multiple of p: below 1 for a point behind the box. end_m and
// side_m are taken off its far end and side.
[[nodiscard]] inline float exit_ratio(const UprightBox& box, const Vec3f& p, float end_m, float side_m) noexcept {
  float ratio = std::numeric_limits<float>::infinity();
  for (int k = 0; k < 2; ++k) {
    const float x = dot(p, box.along[k]);
    const float inset = k == box.length_axis ? end_m : side_m;
    const float limit = x > 0.0F ? box.high_m[k] - inset : box.low_m[k] + inset;
    if (x != 0.0F) ratio = std::fmin(ratio, limit / x);
  }
  return ratio;
}

// The same of box and cabin. camera_height_m: 0 where it is not known, and then there is no cabin.
[[nodiscard]] inline float exit_ratio(const UprightBox& box, const BackRule& rule, const Vec3f& up,
                                      float camera_height_m, const Vec3f& p) noexcept {
  if (rule.belt_m > 0.0F && camera_height_m > 0.0F) {
    const float ratio = std::fmax(exit_ratio(box, p, rule.cabin_end_m, rule.cabin_side_m), 1.0F);
    if (camera_height_m + ratio * dot(up, p) > rule.belt_m) return ratio;
  }
  return exit_ratio(box, p, 0.0F, 0.0F);
}

}  // namespace solidify_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_SOLIDIFY_BOX_HPP
