// SPDX-License-Identifier: Apache-2.0
// Where the lamps of vehicles point, and how high they are.
//
// A vehicle is a box. The horizontal directions of its normals, folded by a right angle (the mean of e^(4 i phi),
// weighted by how horizontal they are), give the direction of its sides; the street's has a weight among them, so that
// it is taken where they are few or scatter.
// Along which of the two it heads: the street's, unless it is seen to be longer across than any vehicle is wide.
// Without instances several may be seen as one, and the lamp's own normal tells whether it points across. At which of
// its ends a lamp sits is told by where it lies from the middle of what is seen of the vehicle; there its axis points
// outwards. One that is seen from ahead or behind shows one end alone, which faces the camera.
// The vehicle: pixels around the lamp of its instance, or without instances of its label at about its depth.
// Height: lamps are between kLampLow_m and kLampHigh_m above the ground under the vehicle (UN R48: low beams .5 to 1.2
// m, stop lamps .35 to 2.1 m). Where depth has them elsewhere, and the ground under them is seen, they move along their
// ray.
#ifndef NPSIM_LIGHT_DETAIL_VEHICLE_LAMPS_HPP
#define NPSIM_LIGHT_DETAIL_VEHICLE_LAMPS_HPP

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/light/detail/lamp_depth.hpp"
#include "npsim/light/detail/street_lamps.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace light_detail {

inline constexpr float kVehicleLength_m = 5.0F;  // around a lamp, in which its vehicle is looked for
inline constexpr float kVehicleWidth_m = 3.0F;   // what is seen to be longer across the street stands across it
inline constexpr float kAcrossCosine = 0.3F;     // of a lamp's normal to the street; below it the lamp points across
inline constexpr float kFarEnd_m = 0.8F;         // behind the middle of what is seen: at the far end
inline constexpr float kStreetPixels = 60.0F;    // weight of the street's direction among the normals of pixels
inline constexpr float kStreetShare = 0.5F;      // and as a share of them
inline constexpr LabelSet kTwoWheelers = LabelSet::of(label::motorcycle, label::bicycle);  // they are no boxes
inline constexpr float kLampLow_m[2] = {0.4F, 0.35F};                                      // of front and rear lamps
inline constexpr float kLampHigh_m[2] = {1.3F, 2.1F};

// What is seen of a vehicle, in the horizontal plane: along the street and to the right of it.
struct VehicleShape {
  double weight = 0, along = 0, across = 0;            // sum of surface, first moments
  double along2 = 0, across2 = 0;                      // second moments
  double turned_cos = 0, turned_sin = 0, normals = 0;  // of 4 phi

  void add(double a, double c, double area) noexcept {
    weight += area;
    along += area * a;
    across += area * c;
    along2 += area * a * a;
    across2 += area * c * c;
  }
};

// The direction whose fourfold angle is that of (c, s), within 45 degrees of the first axis: (cos phi, sin phi).
[[nodiscard]] inline Vec2f quarter_angle(double c, double s) noexcept {
  for (int i = 0; i < 2; ++i) {
    const double size = std::sqrt(c * c + s * s);
    if (!(size > 0.0)) return {1.0F, 0.0F};
    const double half_c = std::sqrt(std::max(0.0, 0.5 * (1.0 + c / size)));
    const double half_s = std::sqrt(std::max(0.0, 0.5 * (1.0 - c / size)));
    c = half_c;
    s = s < 0.0 ? -half_s : half_s;
  }
  return {static_cast<float>(c), static_cast<float>(s)};
}

struct VehicleView {
  const RegionInput& in;
  ImageView<const std::uint16_t> instances;  // may be empty
  ImageView<const Vec3f> normals;            // may be empty
  const Intrinsics& camera;
  const GroundPlane& ground;
};

// Outwards from the end of the vehicle where a lamp at `at` sits, level; along the street towards the camera where no
// vehicle is seen. `normal`: the lamp's own mean normal, or zero.
[[nodiscard]] inline Vec3f vehicle_lamp_axis(const VehicleView& view, const LightRegion& r, const Vec3f& at,
                                             const Vec3f& normal) noexcept {
  const RegionInput& in = view.in;
  const Vec3f& up = view.ground.up;
  const Vec3f street = forward_on_ground(view.ground);
  const Vec3f right = cross(street, up);
  const int x = (r.x0 + r.x1) / 2;
  const int y = (r.y0 + r.y1) / 2;
  if (in.labels.empty() || !kVehicleLabels.contains(in.labels(x, y))) return -street;
  const float reach_x = std::min(kVehicleLength_m * view.camera.fx / at.z, static_cast<float>(in.depth.width()));
  const float reach_y =
      std::min(0.5F * kVehicleLength_m * view.camera.fy / at.z, static_cast<float>(in.depth.height()));
  VehicleShape shape;
  for (int py = std::max(y - static_cast<int>(reach_y), 0);
       py <= std::min(y + static_cast<int>(reach_y), in.depth.height() - 1); ++py) {
    for (int px = std::max(x - static_cast<int>(reach_x), 0);
         px <= std::min(x + static_cast<int>(reach_x), in.depth.width() - 1); ++px) {
      if (in.labels(px, py) != in.labels(x, y) || !is_surface(in, px, py)) continue;
      if (!view.instances.empty() && view.instances(px, py) != view.instances(x, y)) continue;
      const float z = in.depth(px, py);
      if (std::fabs(z - at.z) > kVehicleLength_m) continue;
      const Vec3f p = unproject_pixel(view.camera, px, py, z) - at;
      shape.add(static_cast<double>(dot(p, street)), static_cast<double>(dot(p, right)), static_cast<double>(z * z));
      if (view.normals.empty() || !is_finite(view.normals(px, py))) continue;
      const auto a = static_cast<double>(dot(view.normals(px, py), street));
      const auto c = static_cast<double>(dot(view.normals(px, py), right));
      // r^4 (cos 4 phi, sin 4 phi) of a vector of length r <= 1: normals that point up count little.
      shape.turned_cos += a * a * a * a - 6.0 * a * a * c * c + c * c * c * c;
      shape.turned_sin += 4.0 * a * c * (a * a - c * c);
      shape.normals += 1.0;
    }
  }
  if (!(shape.weight > 0.0)) return -street;
  Vec2f turn{1.0F, 0.0F};
  if (!kTwoWheelers.contains(in.labels(x, y)) && shape.normals > 0.0) {
    const double street_weight = static_cast<double>(kStreetShare) * shape.normals + static_cast<double>(kStreetPixels);
    turn = quarter_angle(shape.turned_cos + street_weight, shape.turned_sin);
  }
  const double mean_along = shape.along / shape.weight;
  const double mean_across = shape.across / shape.weight;
  // A length that is covered evenly has a variance of a twelfth of its square.
  const double length_along = std::sqrt(12.0 * std::max(0.0, shape.along2 / shape.weight - mean_along * mean_along));
  const double length_across =
      std::sqrt(12.0 * std::max(0.0, shape.across2 / shape.weight - mean_across * mean_across));
  const Vec3f heading = street * turn.x + right * turn.y;
  if (view.instances.empty()) {
    // What is seen may be several vehicles: only the lamp's own normal tells that one stands across.
    const Vec3f facing = normalized(normal - up * dot(normal, up));
    if (dot(facing, facing) > 0.5F && -dot(heading, facing) < kAcrossCosine) return facing;
  } else if (length_across > static_cast<double>(kVehicleWidth_m) && length_across > 1.5 * length_along) {
    const Vec3f across = right * turn.x - street * turn.y;
    return mean_across < 0.0 ? across : -across;
  }
  const float far_end = std::max(kFarEnd_m, kDepthError * at.z);
  return mean_along < -static_cast<double>(far_end) ? heading : -heading;
}

// z of a lamp of a vehicle, so that it is as high above the ground under it as such lamps are.
[[nodiscard]] inline float vehicle_lamp_depth(const VehicleView& view, const LightRegion& r, bool front,
                                              float z) noexcept {
  const RegionInput& in = view.in;
  if (in.labels.empty()) return z;
  const int x = (r.x0 + r.x1) / 2;
  int y = r.y1;
  while (y < in.labels.height() && kVehicleLabels.contains(in.labels(x, y))) ++y;
  if (y >= in.labels.height() || !kGroundLabels.contains(in.labels(x, y)) || !is_surface(in, x, y)) return z;
  const float floor_z = in.depth(x, y);
  if (std::fabs(floor_z - z) > 0.25F * z) return z;
  const float floor = height_above_ground(view.ground, unproject_pixel(view.camera, x, y, floor_z));
  const auto u = static_cast<float>(r.mean_x());
  const auto v = static_cast<float>(r.mean_y());
  const float height = height_above_ground(view.ground, unproject(view.camera, u, v, z)) - floor;
  const float wanted = clamp_to(height, kLampLow_m[front ? 0 : 1], kLampHigh_m[front ? 0 : 1]);
  if (!(std::fabs(wanted - height) > 0.0F)) return z;
  const float moved =
      (wanted + floor - view.ground.camera_height_m) / dot(view.ground.up, unproject(view.camera, u, v, 1.0F));
  return moved > 0.75F * z && moved < 1.25F * z ? moved : z;  // else the ground is not known there
}

}  // namespace light_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_DETAIL_VEHICLE_LAMPS_HPP
