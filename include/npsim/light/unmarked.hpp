// SPDX-License-Identifier: Apache-2.0
// Lamps that nobody marked: the own headlamps, those of a car that follows, and street lamps outside the picture.
#ifndef NPSIM_LIGHT_UNMARKED_HPP
#define NPSIM_LIGHT_UNMARKED_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/light/placement.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// The headlamps of the vehicle that carries the camera, as two emitters with mark 0: low beams, or both beams.
//
// Placed by the ground plane: 0.65 m above it (UN R48 allows 0.5 to 1.2 m), 0.6 m to either side of the camera, 1.7 m
// ahead of a windscreen camera (where Cityscapes mounts it), axes 1 % down. The vehicle is taken to point where the
// camera looks. activate_lights() draws their technology and strength once for both.

inline constexpr std::size_t kEgoHeadlampCount = 2;

struct EgoHeadlampParams {
  float height_m = 0.65F;      // above the ground
  float lateral_m = 0.6F;      // from the camera to either side
  float ahead_m = 1.7F;        // of the camera
  float half_width_m = 0.08F;  // of the luminous area
  float half_height_m = 0.05F;
  float aim = kLowBeamAim;         // slope by which the cut-off falls, UN R48: 0.01 to 0.015 at this height
  bool high_beam = false;          // on top of the low beam
  bool left_hand_traffic = false;  // the low beam rises to the left
};

[[nodiscard]] inline Status validate(const EgoHeadlampParams& p) noexcept {
  const bool good = std::isfinite(p.height_m) && std::isfinite(p.lateral_m) && std::isfinite(p.ahead_m) &&
                    p.half_width_m > 0.0F && p.half_height_m > 0.0F && p.aim >= 0.0F && p.aim <= 0.1F;
  return good ? Status()
              : Status(StatusCode::invalid_argument, "headlamps: a finite place and a luminous area are needed");
}

// Writes the left and the right lamp and returns their number, or 0 where `out` has less room, a parameter is not
// valid or the place is not finite.
[[nodiscard]] inline std::size_t place_ego_headlamps(const EgoHeadlampParams& p, const GroundPlane& ground,
                                                     Span<Emitter> out) noexcept {
  const Vec3f forward = forward_on_ground(ground);
  const Vec3f right = cross(forward, ground.up);  // z forward x (-y) up = x right
  const Vec3f middle = forward * p.ahead_m + ground.up * (p.height_m - ground.camera_height_m);
  if (out.size() < kEgoHeadlampCount || !validate(p).ok() || !is_finite(middle) || !is_finite(right * p.lateral_m)) {
    return 0;
  }
  for (std::size_t i = 0; i < kEgoHeadlampCount; ++i) {
    Emitter e;
    e.centre_m = middle + right * (i == 0 ? -p.lateral_m : p.lateral_m);
    e.half_u_m = right * p.half_width_m;
    e.half_v_m = ground.up * p.half_height_m;
    e.axis = normalized(forward - ground.up * p.aim);
    e.up = normalized(ground.up + forward * p.aim);
    e.area_m2 = 4.0F * p.half_width_m * p.half_height_m;
    e.profile = p.high_beam           ? EmissionProfile::high_beam
                : p.left_hand_traffic ? EmissionProfile::low_beam_left
                                      : EmissionProfile::low_beam;
    e.cls = LightClass::moving_front;
    out[i] = e;
  }
  return kEgoHeadlampCount;
}

// The low beams of a car that follows `behind_m` behind the camera in the same lane, placed as the own ones are. What
// the own car hides from them stays dark: a box 1.8 m wide and 1.5 m high, from 3 m behind the camera to its headlamps.
// They have the number kFollowingCarNumber, and shine in every night.

inline constexpr float kNearestFollower_m = 6.0F;
inline constexpr float kFarthestFollower_m = 200.0F;

// As place_ego_headlamps(); 0 too where behind_m is 0 or out of range.
[[nodiscard]] inline std::size_t place_following_car(const EgoHeadlampParams& own, float behind_m,
                                                     const GroundPlane& ground, Span<Emitter> out) noexcept {
  constexpr float kHalfWidth_m = 0.9F;
  constexpr float kHeight_m = 1.5F;
  constexpr float kRear_m = 3.0F;  // behind the camera
  EgoHeadlampParams p = own;
  p.ahead_m = -behind_m;
  p.high_beam = false;
  const bool there = behind_m >= kNearestFollower_m && behind_m <= kFarthestFollower_m && own.ahead_m > -kRear_m;
  if (!there || place_ego_headlamps(p, ground, out) == 0) return 0;
  const float to_rear_m = behind_m - kRear_m;
  const float to_front_m = behind_m + own.ahead_m;
  // The wider of the angles at which the box's rear and its front are seen.
  const auto steepest = [&](float across_m) { return max_of(across_m / to_rear_m, across_m / to_front_m); };
  for (std::size_t i = 0; i < kEgoHeadlampCount; ++i) {
    const float side_m = i == 0 ? -p.lateral_m : p.lateral_m;
    out[i].shade_from = -steepest(kHalfWidth_m + side_m);
    out[i].shade_to = steepest(kHalfWidth_m - side_m);
    out[i].shade_below = steepest(kHeight_m - p.height_m) + p.aim - kLowBeamAim;
    out[i].unseen = kFollowingCarNumber;
  }
  return kEgoHeadlampCount;
}

// Street lamps that the photograph does not show: rows of lamps go on behind, above and beside the camera.
//
// Lamps of one class and kind on one side of the road are a row. From its nearest lamp it is walked towards the camera
// and past it, parallel to the viewing direction, at the median of the row's gaps; where one lamp alone is known, or
// its gaps are none of a row (min_gap_m to max_gap_m), at 3.5 times its height, which is what the luminance classes of
// EN 13201-2 take with common luminaires. Each station outside the picture gets a lamp like the nearest one, as
// high above the ground. The first station that the picture would show and does not ends the row, as it stops there for
// all that one sees; and so does one inside a house. One that something else hides, such as leaves, is passed over: a
// lamp that nobody sees would light just what hides it. So is one beyond the picture's border within kBesideTree_m of
// what the picture shows of a tree: trunk and crown go on there.
// Where no street lamp is marked, assumed_width_m > 0 supposes a road of that width with a row of masts on its right
// kerb: one-sided rows are about as high as the road is wide (5 to 10 m). Its first lamp hangs as far ahead as one can
// whose place the picture does not show, at most one gap, and nearer where something stands in its way or beside it.
// The moon is one more lamp of that kind, where its direction is given.
// Such an emitter has mark 0 and the number `unseen`; strength and colour are those of its class in the same night.
// Error: the row itself is a guess; gaps come from placed lamps, so from depth. Cost: one pass over the lamps per row,
// one over a quarter of the picture for each station ahead of the camera and outside the picture, up to 9 for an
// assumed row.

struct ContinuedRowParams {
  float behind_m = 60.0F;        // rows go on so far behind the camera; 0: no row is continued
  float min_gap_m = 10.0F;       // between lamps of a row; nearer ones share a station [default]
  float max_gap_m = 60.0F;       // what is farther apart misses one in between [default]
  float assumed_width_m = 0.0F;  // of a road without a marked street lamp, which gets a row; 0: none is assumed
  Vec3f moon;                    // towards it, level with the ground and up it: right, up, ahead; (0, 0, 0): no moon
};

inline constexpr std::size_t kMaxUnseenLamps = 24;

[[nodiscard]] inline Status validate(const ContinuedRowParams& p) noexcept {
  const bool good = p.behind_m >= 0.0F && p.behind_m <= 500.0F && p.min_gap_m >= 1.0F && p.max_gap_m > p.min_gap_m &&
                    std::isfinite(p.max_gap_m) && p.assumed_width_m >= 0.0F && p.assumed_width_m <= 50.0F &&
                    is_finite(p.moon);
  return good ? Status() : Status(StatusCode::invalid_argument, "continued rows: a parameter lies outside its range");
}

// Lamps that continue_rows() adds at most.
[[nodiscard]] constexpr std::size_t most_unseen_lamps(const ContinuedRowParams& p, std::size_t marks) noexcept {
  const std::size_t moon = p.moon == Vec3f{} ? 0 : 1;
  return moon + (p.behind_m > 0.0F && (marks > 0 || p.assumed_width_m > 0.0F) ? kMaxUnseenLamps : 0);
}

namespace light_detail {

// By class, kind and side of the road.
[[nodiscard]] inline int row_of(const Emitter& e, const Vec3f& forward) noexcept {
  if (!is_street_lamp(e.cls) || !is_street_profile(e.profile)) return -1;
  const int kind = e.profile == EmissionProfile::hung_luminaire ? 0 : (e.profile == EmissionProfile::lantern ? 1 : 2);
  const int side = kind == 0 ? 0 : (dot(e.up, forward) > 0.0F ? 1 : 0);  // hung ones have none
  return (e.cls == LightClass::street_light_ht ? 0 : 6) + 2 * kind + side;
}
inline constexpr int kRows = 12;

inline constexpr LabelSet kHouses = LabelSet::of(label::building, label::wall, label::bridge, label::tunnel);
inline constexpr float kGapPerHeight = 3.5F;
inline constexpr float kBeforeCamera_m = 0.3F;   // nearer, or behind, nothing is in the picture
inline constexpr float kBesideTree_m = 1.5F;     // nearer a lamp would hang in the tree [default]
inline constexpr float kBesideAssumed_m = 6.0F;  // nearer an assumed lamp glares on what it hangs beside [default]
inline constexpr std::size_t kMaxOfRow = 16;     // lamps whose gaps are looked at

// The distances of a row's nearest lamps along the road, sorted.
struct RowDistances {
  float z[kMaxOfRow];
  std::size_t count = 0;

  void add(float distance) noexcept {
    if (count == kMaxOfRow && distance >= z[count - 1]) return;
    std::size_t at = count < kMaxOfRow ? count++ : kMaxOfRow - 1;
    for (; at > 0 && z[at - 1] > distance; --at) z[at] = z[at - 1];
    z[at] = distance;
  }
};

[[nodiscard]] inline float row_gap(const ContinuedRowParams& p, const RowDistances& row, float height_m) noexcept {
  float gaps[kMaxOfRow];
  std::size_t count = 0;
  float last = row.count > 0 ? row.z[0] : 0.0F;
  for (std::size_t i = 1; i < row.count; ++i) {
    const float gap = row.z[i] - last;
    if (gap < p.min_gap_m) continue;
    last = row.z[i];
    if (gap > p.max_gap_m) continue;
    std::size_t at = count++;
    for (; at > 0 && gaps[at - 1] > gap; --at) gaps[at] = gaps[at - 1];
    gaps[at] = gap;
  }
  if (count > 0) return gaps[count / 2];
  return clamp_to(kGapPerHeight * height_m, p.min_gap_m, p.max_gap_m);
}

// Whether the picture shows something that counts nearer to the point; every other pixel is asked.
template <class Counts>
[[nodiscard]] bool beside(const PlacementScene& s, const Counts& counts, float distance_m,
                          const Vec3f& point) noexcept {
  for (int y = 0; y < s.depth.height(); y += 2) {
    for (int x = 0; x < s.depth.width(); x += 2) {
      if (!is_valid_depth(s.depth(x, y)) || !counts(x, y)) continue;
      if (length(unproject_pixel(s.camera, x, y, s.depth(x, y)) - point) < distance_m) return true;
    }
  }
  return false;
}

// What the picture says of a lamp at a station.
enum class Station : std::uint8_t { outside, hidden, missing };

[[nodiscard]] inline bool is_in_picture(const PlacementScene& s, const Vec3f& point) noexcept {
  if (!(point.z > kBeforeCamera_m)) return false;
  const Vec2f at = project(s.camera, point);
  const Shape shape = s.depth.shape();
  return at.x >= 0.0F && at.y >= 0.0F && at.x < static_cast<float>(shape.width) &&
         at.y < static_cast<float>(shape.height);
}

[[nodiscard]] inline Station look_at_station(const PlacementScene& s, const Vec3f& point) noexcept {
  if (!(point.z > kBeforeCamera_m)) return Station::outside;
  if (!is_in_picture(s, point)) {
    const auto tree = [&](int x, int y) { return !s.labels.empty() && s.labels(x, y) == label::vegetation; };
    return beside(s, tree, kBesideTree_m, point) ? Station::hidden : Station::outside;
  }
  const Vec2f at = project(s.camera, point);
  const auto x = static_cast<int>(at.x);
  const auto y = static_cast<int>(at.y);
  if (!s.labels.empty() && (kHouses.contains(s.labels(x, y)) || s.labels(x, y) == label::sky)) return Station::missing;
  return is_valid_depth(s.depth(x, y)) && s.depth(x, y) < 0.9F * point.z ? Station::hidden : Station::missing;
}

// Adds the row's stations before `nearest`, which lies `first_m` along the road.
inline void continue_row(const ContinuedRowParams& p, const PlacementScene& scene, const Emitter& nearest,
                         float first_m, float gap_m, Span<Emitter> lamps, std::size_t& count,
                         std::uint16_t& unseen) noexcept {
  const Vec3f forward = forward_on_ground(scene.ground);
  for (float z = first_m - gap_m; z >= -p.behind_m; z -= gap_m) {
    Emitter e = nearest;
    e.centre_m = nearest.centre_m + forward * (z - first_m);
    const Station station = look_at_station(scene, e.centre_m);
    if (station == Station::missing || count == lamps.size() || unseen == kMaxUnseenLamps) return;
    if (station == Station::hidden) continue;
    e.mark = 0;
    e.group = 0;
    e.group_cls = LightClass::none;
    e.unseen = ++unseen;
    lamps[count++] = e;
  }
}

// A mast on the right kerb of a road of that width, beside the camera, which drives in the middle of its right half.
[[nodiscard]] inline Emitter assumed_lamp(float width_m, const GroundPlane& ground) noexcept {
  const Vec3f forward = forward_on_ground(ground);
  const Vec3f right = cross(forward, ground.up);
  Emitter e;
  e.cls = LightClass::street_light_ht;
  e.profile = EmissionProfile::street_luminaire;
  e.mounting_height_m = clamp_to(width_m, 5.0F, 10.0F);
  e.centre_m = right * (0.25F * width_m) + ground.up * (e.mounting_height_m - ground.camera_height_m);
  e.half_u_m = right * 0.15F;
  e.half_v_m = forward * 0.3F;
  e.axis = -ground.up;
  e.up = forward;
  e.area_m2 = 0.18F;
  return e;
}

// How far ahead of `lamp` the first one of an assumed row hangs: outside the picture, where its nearest pixel shows
// nothing that is nearer, and beside nothing. Found nowhere, beside the camera, or behind it where the picture shows
// that place.
[[nodiscard]] inline float first_ahead_m(const PlacementScene& s, const Vec3f& lamp, float gap_m) noexcept {
  constexpr int kSteps = 8;
  const Shape shape = s.depth.shape();
  const auto anything = [](int, int) { return true; };
  for (int step = shape.pixels() > 0 ? kSteps : 0; step > 0; --step) {
    const float ahead_m = gap_m * static_cast<float>(step) / static_cast<float>(kSteps);
    const Vec3f point = lamp + forward_on_ground(s.ground) * ahead_m;
    if (!(point.z > 0.0F) || is_in_picture(s, point)) continue;
    const Vec2f at = project(s.camera, point);
    const int x = static_cast<int>(clamp_to(at.x, 0.0F, static_cast<float>(shape.width - 1)));
    const int y = static_cast<int>(clamp_to(at.y, 0.0F, static_cast<float>(shape.height - 1)));
    if (is_valid_depth(s.depth(x, y)) && s.depth(x, y) < point.z) continue;
    if (!beside(s, anything, kBesideAssumed_m, point)) return ahead_m;
  }
  return look_at_station(s, lamp) == Station::outside ? 0.0F : -gap_m;
}

[[nodiscard]] inline Emitter moon_over(const Vec3f& direction, const GroundPlane& ground) noexcept {
  const Vec3f forward = forward_on_ground(ground);
  const Vec3f right = cross(forward, ground.up);
  const Vec3f towards = normalized(right * direction.x + ground.up * direction.y + forward * direction.z);
  const float radius_m = kMoonRadius * kMoonDistance_m;
  Emitter e;
  e.centre_m = towards * kMoonDistance_m;
  e.half_u_m = right * radius_m;
  e.axis = -towards;
  e.up = ground.up;
  e.area_m2 = 3.14159265F * radius_m * radius_m;
  e.shape = EmitterShape::sphere;
  e.unseen = kMoonNumber;
  return e;
}

}  // namespace light_detail

// lamps[0, count): those that place_lights() placed; new ones are added behind them, as far as there is room.
[[nodiscard]] inline Status continue_rows(const ContinuedRowParams& p, const PlacementScene& scene, Span<Emitter> lamps,
                                          std::size_t& count) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(p));
  if (!(p.moon == Vec3f{}) && count < lamps.size()) lamps[count++] = light_detail::moon_over(p.moon, scene.ground);
  if (p.behind_m <= 0.0F) return {};
  const Vec3f forward = forward_on_ground(scene.ground);
  const std::size_t placed = count;
  std::uint16_t unseen = 0;
  bool any = false;
  for (int row = 0; row < light_detail::kRows; ++row) {
    light_detail::RowDistances distances;
    std::size_t nearest = placed;
    float nearest_m = 0.0F;
    for (std::size_t e = 0; e < placed; ++e) {
      if (light_detail::row_of(lamps[e], forward) != row) continue;
      const float z = dot(forward, lamps[e].centre_m);
      if (nearest == placed || z < nearest_m) {
        nearest = e;
        nearest_m = z;
      }
      distances.add(z);
    }
    if (nearest == placed) continue;
    any = true;
    const float gap = light_detail::row_gap(p, distances, lamps[nearest].mounting_height_m);
    light_detail::continue_row(p, scene, lamps[nearest], nearest_m, gap, lamps, count, unseen);
  }
  if (!any && p.assumed_width_m > 0.0F) {
    Emitter lamp = light_detail::assumed_lamp(p.assumed_width_m, scene.ground);
    const float gap = light_detail::row_gap(p, {}, lamp.mounting_height_m);
    const float first = light_detail::first_ahead_m(scene, lamp.centre_m, gap) + gap;
    lamp.centre_m += forward * first;
    light_detail::continue_row(p, scene, lamp, first, gap, lamps, count, unseen);
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_UNMARKED_HPP
