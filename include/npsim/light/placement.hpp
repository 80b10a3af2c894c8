// SPDX-License-Identifier: Apache-2.0
// From annotated regions to emitters in space: one per marked source that has pixels and whose distance can be known.
//
// Street lamps: detail/street_lamps.hpp weighs the pole's foot and depth, the head, and what the row says. The patch is
// level; axis down. One whose head's middle is below 5 m is a lantern, which shines from there; all others do from the
// head's lower edge. Over the road without a pole it hangs on a wire, any other is a road luminaire on a mast, whose
// road lies where its arm leads.
// Clocks and the lenses of traffic lights are discs, all else is a patch.
// Lit surfaces (windows, signs, posters, clocks): on the upright plane of the wall around them, with the rectangle that
// their outline spans there, what is hidden included; axis along its normal (detail/lamp_plane.hpp). Where no plane is
// found: at the region's depth, along its mean normal.
// Lamps of vehicles: at the median depth of the region (detail/lamp_depth.hpp), as high as such lamps are, pointing
// along their vehicle (detail/vehicle_lamps.hpp), low beams 1 % down. Signals: towards the camera. Their patch is
// parallel to the image and has the region's area. All are pulled off their surface by offset_m along the axis, so that
// the surface does not shade them. Regions of which no depth can be found, and marks that are groups, give no emitter.
// Order is that of the marks. Cost: two passes over the image, and for each mark some over its surroundings. Memory:
// about 9 MB, see the bytes function. Error: that of depth; `npsim evaluate` compares with the lamps of a generated
// street.
#ifndef NPSIM_LIGHT_PLACEMENT_HPP
#define NPSIM_LIGHT_PLACEMENT_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"
#include "npsim/light/detail/lamp_depth.hpp"
#include "npsim/light/detail/lamp_plane.hpp"
#include "npsim/light/detail/street_lamps.hpp"
#include "npsim/light/detail/vehicle_lamps.hpp"
#include "npsim/light/emitter.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct PlacementParams {
  float offset_m = 0.02F;            // patches stand off their surface by this, >= 0
  float min_area_m2 = 1e-3F;         // of any patch: a lamp of 3 cm
  float min_street_area_m2 = 0.02F;  // of a street lamp's luminous opening
  float max_side_m = 20.0F;          // bounds a patch where depth or normal is absurd
  float min_facing_cosine = 0.15F;   // a normal closer to grazing than this is not trusted for a facade
  bool left_hand_traffic = false;    // low beams of others rise to the left
  float reveal_m = 0.15F;            // a window's pane stands behind its wall by this [default]
  StreetLampParams street;
};

// What lamps are placed by: planes of one shape, of which those after depth may be empty.
struct PlacementScene {
  Intrinsics camera;
  GroundPlane ground;
  Span<const LightMark> marks;
  ImageView<const std::uint16_t> light_index;  // position + 1 in marks, 0 = none
  ImageView<const float> depth;                // m
  ImageView<const Label> labels;
  ImageView<const std::uint16_t> instances;  // equal id and label = same object
  ImageView<const std::uint8_t> uncertain;   // not 0: the depth is not to be trusted
  ImageView<const Vec3f> normals;
  ImageView<const float> confidence;  // of measured depth: 1 where it was measured; of other depth empty
};

inline constexpr std::size_t kMaxLightMarks = 65535;  // an index plane can name no more

[[nodiscard]] constexpr std::size_t placement_workspace_bytes(const PlacementParams&, Shape) noexcept {
  return allocation_bytes<LightRegion>(kMaxLightMarks + 1) + allocation_bytes<float>(kMaxRegionSamples) +
         allocation_bytes<light_detail::StreetLamp>(kMaxLightMarks) +
         allocation_bytes<light_detail::Outline>(kMaxLightMarks) +
         allocation_bytes<light_detail::PlaneSample>(light_detail::kPlaneSamples) + kWorkspaceAlignment;
}

[[nodiscard]] inline Status validate(const PlacementParams& p) noexcept {
  const bool good = p.offset_m >= 0.0F && std::isfinite(p.offset_m) && p.min_area_m2 > 0.0F &&
                    p.min_street_area_m2 > 0.0F && p.max_side_m > 0.0F && std::isfinite(p.max_side_m) &&
                    p.min_facing_cosine > 0.0F && p.min_facing_cosine < 1.0F && p.street.min_height_m > 0.0F &&
                    p.street.max_height_m > p.street.min_height_m && p.street.default_height_m > 0.0F &&
                    std::isfinite(p.street.default_height_m) && std::isfinite(p.street.max_height_m) &&
                    p.street.max_distance_m > 0.0F && std::isfinite(p.street.max_distance_m) &&
                    p.street.arm_m >= 0.0F && std::isfinite(p.street.arm_m) && std::isfinite(p.min_area_m2) &&
                    std::isfinite(p.min_street_area_m2) && p.reveal_m >= 0.0F && std::isfinite(p.reveal_m);
  return good ? Status() : Status(StatusCode::invalid_argument, "placement: a parameter lies outside its range");
}

[[nodiscard]] inline Status validate(const PlacementScene& s) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(s.camera));
  const Shape shape = s.light_index.shape();
  const auto agrees = [&](const auto& plane) { return plane.empty() || plane.shape() == shape; };
  if (s.light_index.empty() || s.depth.shape() != shape || !agrees(s.labels) || !agrees(s.instances) ||
      !agrees(s.uncertain) || !agrees(s.normals) || !agrees(s.confidence)) {
    return Status(StatusCode::shape_mismatch, "placement: every plane must have the shape of the light index");
  }
  if (s.marks.size() > kMaxLightMarks) return Status(StatusCode::capacity_exceeded, "placement: more than 65535 marks");
  const GroundPlane& ground = s.ground;
  if (!is_finite(ground.up) || std::fabs(length(ground.up) - 1.0F) > 1e-3F || !std::isfinite(ground.camera_height_m)) {
    return Status(StatusCode::invalid_argument, "placement: the ground plane needs a unit normal");
  }
  return {};
}

// Shops show what they sell to those who pass: their windows begin below the eyes of a child, and are larger than
// doors and than most of a flat's [default].
[[nodiscard]] inline bool is_shop_front(const GroundPlane& ground, const Emitter& e) noexcept {
  constexpr float kSill_m = 1.2F;
  constexpr float kArea_m2 = 4.0F;
  if (e.cls != LightClass::window_building || !(e.area_m2 > kArea_m2)) return false;
  const float half_height = std::fabs(dot(ground.up, e.half_u_m)) + std::fabs(dot(ground.up, e.half_v_m));
  return height_above_ground(ground, e.centre_m) - half_height < kSill_m;
}

namespace light_detail {

[[nodiscard]] inline EmissionProfile profile_of(const LightMark& mark, LightClass group) noexcept {
  switch (mark.cls) {
    case LightClass::street_light_ht:
    case LightClass::street_light_lt: return EmissionProfile::street_luminaire;
    case LightClass::moving_front:
      return group == LightClass::bicycle_group ? EmissionProfile::signal : EmissionProfile::low_beam;
    case LightClass::moving_rear:
    case LightClass::parked_front:
    case LightClass::parked_rear: return EmissionProfile::signal;
    case LightClass::inferred_object:
      return mark.state != SignalState::unknown || group == LightClass::traffic_light_group ? EmissionProfile::signal
                                                                                            : EmissionProfile::lambert;
    default: break;
  }
  return EmissionProfile::lambert;
}

// A unit vector normal to `axis`, as close to `wish` as possible.
[[nodiscard]] inline Vec3f perpendicular(const Vec3f& axis, const Vec3f& wish) noexcept {
  const Vec3f a = wish - axis * dot(wish, axis);
  if (dot(a, a) > 1e-6F) return normalized(a);
  const Vec3f other = std::fabs(axis.x) < 0.7F ? Vec3f{1.0F, 0.0F, 0.0F} : Vec3f{0.0F, 1.0F, 0.0F};
  return normalized(other - axis * dot(other, axis));
}

// Scales the half sides so that 4 |u x v| = area, after bounding each side.
inline void set_patch(Emitter& e, Vec3f u, Vec3f v, float fill, float min_area, float max_side) noexcept {
  const auto bounded = [&](const Vec3f& a) {
    const float l = length(a);
    return l > 0.5F * max_side ? a * (0.5F * max_side / l) : a;
  };
  u = bounded(u);
  v = bounded(v);
  const float rectangle = 4.0F * length(cross(u, v));
  e.area_m2 = std::max(rectangle * fill, min_area);
  const float scale = rectangle > 0.0F ? std::sqrt(e.area_m2 / rectangle) : 1.0F;
  e.half_u_m = u * scale;
  e.half_v_m = v * scale;
}

// A surface whose plane is not known: through the region's depth, along its mean normal where that faces the camera.
inline void place_by_normal(const PlacementParams& p, const Intrinsics& k, const LightRegion& r, float u, float v,
                            float z, Vec3f normal, const GroundPlane& ground, Emitter& e) noexcept {
  const Vec3f centre = unproject(k, u, v, z);
  const Vec3f ray = normalized(centre);
  if (!(-dot(normal, ray) >= p.min_facing_cosine)) normal = -ray;
  // Edge points of the region's rectangle, on the plane through the centre.
  const float half_width = 0.5F * static_cast<float>(r.x1 - r.x0 + 1);
  const float half_height = 0.5F * static_cast<float>(r.y1 - r.y0 + 1);
  const float plane = dot(normal, centre);
  const auto on_plane = [&](float pu, float pv) {
    const Vec3f d = unproject(k, pu, pv, 1.0F);
    const float s = dot(normal, d);
    return std::fabs(s) > 1e-4F ? d * (plane / s) : d * z;
  };
  set_patch(e, (on_plane(u + half_width, v) - on_plane(u - half_width, v)) * 0.5F,
            (on_plane(u, v + half_height) - on_plane(u, v - half_height)) * 0.5F, r.fill(), p.min_area_m2,
            p.max_side_m);
  e.axis = normal;
  e.up = perpendicular(normal, ground.up);
  e.centre_m = centre + normal * p.offset_m;
}

inline void place_outline(const PlacementParams& p, const Outline& o, Emitter& e) noexcept {
  set_patch(e, o.u * (0.5F * (o.u1 - o.u0)), o.v * (0.5F * (o.v1 - o.v0)), o.fill, p.min_area_m2, p.max_side_m);
  e.axis = o.plane.normal;
  e.up = o.v;
  e.centre_m = o.centre() + e.axis * p.offset_m;
}

// `axis` is level or zero, which means towards the camera.
inline void place_lamp(const PlacementParams& p, const Intrinsics& k, const LightRegion& r, float u, float v, float z,
                       Vec3f axis, const GroundPlane& ground, Emitter& e) noexcept {
  const Vec3f centre = unproject(k, u, v, z);
  if (!(dot(axis, axis) > 0.5F)) axis = normalized(-centre + ground.up * dot(centre, ground.up));
  if (!(dot(axis, axis) > 0.5F)) axis = normalized(-centre);
  if (is_headlamp_profile(e.profile)) axis = normalized(axis - ground.up * kLowBeamAim);
  set_patch(e, {0.5F * static_cast<float>(r.x1 - r.x0 + 1) * z / k.fx, 0.0F, 0.0F},
            {0.0F, 0.5F * static_cast<float>(r.y1 - r.y0 + 1) * z / k.fy, 0.0F}, r.fill(), p.min_area_m2, p.max_side_m);
  e.axis = axis;
  e.up = perpendicular(axis, ground.up);
  e.centre_m = centre + axis * p.offset_m;
}

// Road luminaires hang at 5 m and more, lanterns lower. [default]
inline constexpr float kLanternHeight_m = 5.0F;
[[nodiscard]] constexpr EmissionProfile street_profile(float mounting_height_m) noexcept {
  return mounting_height_m < kLanternHeight_m ? EmissionProfile::lantern : EmissionProfile::street_luminaire;
}
inline constexpr float kOverRoad_m = 5.0F;  // to either side of the camera: half of a road of three lanes [default]

inline void place_street_lamp(const PlacementParams& p, const Intrinsics& k, const LightRegion& r, float u, float v,
                              float z, const GroundPlane& ground, Emitter& e) noexcept {
  const Vec3f down = -ground.up;
  const Vec3f along = forward_on_ground(ground);
  const Vec3f across = cross(along, ground.up);
  const float half_width = 0.5F * static_cast<float>(r.x1 - r.x0 + 1) * z / k.fx;
  const float seen_area = static_cast<float>(r.pixels) * z * z / (k.fx * k.fy);
  // How deep the head is along the road cannot be seen; a square opening is assumed.
  set_patch(e, across * half_width, along * half_width, 1.0F, p.min_street_area_m2, p.max_side_m);
  e.area_m2 = std::max(seen_area, p.min_street_area_m2);
  e.axis = down;
  e.up = along;
  const Vec3f middle = unproject(k, u, v, z);
  e.profile = street_profile(height_above_ground(ground, middle));
  const bool lantern = e.profile == EmissionProfile::lantern;
  const Vec3f centre = lantern ? middle : unproject(k, u, static_cast<float>(r.y1 + 1), z);
  e.mounting_height_m = std::max(height_above_ground(ground, centre), 0.0F);
  e.centre_m = centre + down * p.offset_m;
}

// What kind of luminaire a tall street lamp is, and on which side of it the road is: one over the road without a pole
// hangs on a wire; the road of any other is where its arm leads, else where the camera is.
inline void set_street_profile(const StreetLamp& l, bool poles_known, const GroundPlane& ground, Emitter& e) noexcept {
  const Vec3f along = forward_on_ground(ground);
  const float right_m = dot(cross(along, ground.up), e.centre_m);
  if (e.profile != EmissionProfile::street_luminaire) return;
  if (poles_known && l.pole_rows == 0 && std::fabs(right_m) < kOverRoad_m) {
    e.profile = EmissionProfile::hung_luminaire;
  }
  const bool road_left = l.pole_rows > 0 && std::fabs(l.u - l.pole_u) > l.half_width ? l.u < l.pole_u : right_m > 0.0F;
  e.up = road_left ? along : -along;  // cross(forward, down) points left
}

// The poles of far lamps are too thin to be seen or labelled: a lamp that seems to hang on a wire stands on a mast if
// the nearest one of its row does, which is of its class, about as high and as far to the side.
inline constexpr float kRowAside_m = 3.0F;
inline constexpr float kRowHeights = 1.25F;
inline void agree_on_masts(const GroundPlane& ground, Span<Emitter> lamps) noexcept {
  const Vec3f forward = forward_on_ground(ground);
  const Vec3f right = cross(forward, ground.up);
  for (Emitter& e : lamps) {
    if (e.profile != EmissionProfile::hung_luminaire) continue;
    const Emitter* nearest = &e;
    for (const Emitter& other : lamps) {
      const bool of_row = other.cls == e.cls && is_street_profile(other.profile) &&
                          std::fabs(dot(right, other.centre_m - e.centre_m)) < kRowAside_m &&
                          other.mounting_height_m < kRowHeights * e.mounting_height_m &&
                          e.mounting_height_m < kRowHeights * other.mounting_height_m;
      if (of_row && dot(forward, other.centre_m - nearest->centre_m) < 0.0F) nearest = &other;
    }
    if (nearest->profile != EmissionProfile::street_luminaire) continue;
    e.profile = nearest->profile;
    e.up = nearest->up;
  }
}

inline constexpr float kDiscShare = 0.785F;  // pi / 4, of the square around a disc

// The faces of clocks and the lenses of traffic lights are round; a disc of the patch's area is wider by 2 / sqrt(pi).
inline void set_shape(Emitter& e) noexcept {
  const bool lens = e.cls == LightClass::inferred_object && e.profile == EmissionProfile::signal;
  if (!lens && e.cls != LightClass::clock) return;
  e.shape = EmitterShape::disc;
  e.half_u_m = e.half_u_m * 1.12837917F;
  e.half_v_m = e.half_v_m * 1.12837917F;
}

// What placing one mark needs to know of all of them.
struct Placing {
  const PlacementParams& params;
  const PlacementScene& scene;
  RegionInput in;
  Span<LightRegion> regions;               // by mark, the first of none
  Span<StreetLamp> lamps;                  // by mark; what is no street lamp knows nothing
  Span<Outline> outlines;                  // by mark; unknown of what is no lit surface, or shows no plane
  LampHeight witnesses[2][kMaxWitnesses];  // of both classes of street lamps
  std::size_t witness_count[2] = {0, 0};
  Span<float> scratch;

  [[nodiscard]] LampView lamp_view() const noexcept { return {params.street, in, scene.camera, scene.ground}; }
  [[nodiscard]] const LightRegion& region(std::size_t m) const noexcept { return regions[m + 1]; }
  [[nodiscard]] LightClass group_class(const LightMark& mark) const noexcept {
    return mark.group != 0 && mark.group <= scene.marks.size() ? scene.marks[mark.group - 1U].cls : LightClass::none;
  }
};

// Cabin windows of cars lean, and go around them.
[[nodiscard]] constexpr bool is_upright(LightClass c) noexcept { return c != LightClass::window_parked; }

inline void look_at_street_lamps(Placing& all) noexcept {
  const Span<const LightMark> marks = all.scene.marks;
  const LampView view = all.lamp_view();
  for (std::size_t m = 0; m < marks.size(); ++m) {
    const bool street = all.region(m).pixels > 0 && is_street_lamp(marks[m].cls);
    all.lamps[m] =
        street ? look_at_lamp(view, all.region(m), static_cast<std::uint16_t>(m + 1), all.scratch) : StreetLamp{};
  }
  for (std::size_t c = 0; c < 2; ++c) {
    const LightClass cls = c == 0 ? LightClass::street_light_ht : LightClass::street_light_lt;
    all.witness_count[c] = collect_witnesses(
        view, all.lamps, [&](std::size_t m) { return marks[m].cls == cls; }, Span<LampHeight>(all.witnesses[c]));
  }
}

inline void outline_surfaces(Placing& all, Span<PlaneSample> samples) noexcept {
  const PlacementScene& scene = all.scene;
  const PlaneSearch search{all.in, scene.instances, scene.camera, scene.ground, samples, all.scratch};
  for (std::size_t m = 0; m < scene.marks.size(); ++m) {
    all.outlines[m] = Outline{};
    const LightMark& mark = scene.marks[m];
    const LightRegion& r = all.region(m);
    const auto value = static_cast<std::uint16_t>(m + 1);
    const bool surface = r.pixels > 0 && !is_group(mark.cls) && is_upright(mark.cls) &&
                         profile_of(mark, all.group_class(mark)) == EmissionProfile::lambert;
    const float z = surface ? region_depth(all.in, r, value, all.scratch) : 0.0F;
    if (!is_valid_depth(z)) continue;
    const Vec3f ray = unproject(scene.camera, static_cast<float>(r.mean_x()), static_cast<float>(r.mean_y()), 1.0F);
    const Vec3f normal = region_normal(all.in, r, value, scene.normals, ray);
    const bool window = mark.cls == LightClass::window_building;
    all.outlines[m] = surface_outline(search, r, value, z, normal, window || mark.cls == LightClass::clock);
    if (window && all.outlines[m].known()) add_reveal(all.outlines[m], all.params.reveal_m);
  }
}

// The outline of a mark with what its group tells of the parts that are hidden.
[[nodiscard]] inline Outline whole_outline(const Placing& all, std::size_t m) noexcept {
  const Span<const LightMark> marks = all.scene.marks;
  Outline o = all.outlines[m];
  if (marks[m].cls == LightClass::window_building || marks[m].cls == LightClass::window_transport) {
    const auto of_group = [&](std::size_t i) {
      return marks[i].cls == marks[m].cls && marks[i].group != 0 && marks[i].group == marks[m].group;
    };
    const auto of_wall = [&](std::size_t i) {
      return marks[i].cls == marks[m].cls && same_wall(all.outlines[i].plane, all.outlines[m].plane);
    };
    for (const bool upwards : {false, true}) {
      const bool* cut = o.cut + (upwards ? 2 : 0);
      if (!cut[0] && !cut[1]) continue;
      float size = usual_size(all.outlines, upwards, of_group, all.scratch);
      if (!(size > 0.0F)) size = usual_size(all.outlines, upwards, of_wall, all.scratch);
      add_hidden(size, cut[0], cut[1], upwards ? o.v0 : o.u0, upwards ? o.v1 : o.u1);
    }
  }
  // What is seen whole has the area that is seen; of what is cut only the rectangle is known.
  if (o.cut[0] || o.cut[1] || o.cut[2] || o.cut[3]) o.fill = marks[m].cls == LightClass::clock ? kDiscShare : 1.0F;
  return o;
}

// False where no depth can be found.
[[nodiscard]] inline bool place_mark(const Placing& all, std::size_t m, Emitter& e) noexcept {
  const PlacementParams& p = all.params;
  const PlacementScene& scene = all.scene;
  const LightRegion& r = all.region(m);
  const auto value = static_cast<std::uint16_t>(m + 1);
  const auto u = static_cast<float>(r.mean_x());
  const auto v = static_cast<float>(r.mean_y());
  if (is_street_profile(e.profile)) {
    const std::size_t c = e.cls == LightClass::street_light_ht ? 0 : 1;
    const float z = street_lamp_depth(all.lamp_view(), all.lamps[m], m,
                                      Span<const LampHeight>(all.witnesses[c], all.witness_count[c]));
    if (!is_valid_depth(z)) return false;
    place_street_lamp(p, scene.camera, r, u, v, z, scene.ground, e);
    set_street_profile(all.lamps[m], !scene.labels.empty(), scene.ground, e);
    return true;
  }
  if (all.outlines[m].known()) {
    place_outline(p, whole_outline(all, m), e);
    return true;
  }
  float z = region_depth(all.in, r, value, all.scratch);
  if (!is_valid_depth(z)) return false;
  const Vec3f normal = region_normal(all.in, r, value, scene.normals, unproject(scene.camera, u, v, 1.0F));
  if (e.profile == EmissionProfile::lambert) {
    place_by_normal(p, scene.camera, r, u, v, z, normal, scene.ground, e);
    return true;
  }
  Vec3f axis;  // of signals: towards the camera
  if (e.cls != LightClass::inferred_object) {
    const VehicleView view{all.in, scene.instances, scene.normals, scene.camera, scene.ground};
    const bool front = e.cls == LightClass::moving_front || e.cls == LightClass::parked_front;
    z = vehicle_lamp_depth(view, r, front, z);
    axis = vehicle_lamp_axis(view, r, unproject(scene.camera, u, v, z), normal);
  }
  place_lamp(p, scene.camera, r, u, v, z, axis, scene.ground, e);
  return true;
}

}  // namespace light_detail

// `out` holds at least as many elements as there are marks that are not groups; `count` is how many were written.
[[nodiscard]] inline Status place_lights(const PlacementParams& p, const PlacementScene& scene, Workspace& workspace,
                                         Span<Emitter> out, std::size_t& count) noexcept {
  count = 0;
  NPSIM_RETURN_IF_ERROR(validate(p));
  NPSIM_RETURN_IF_ERROR(validate(scene));
  const Span<const LightMark> marks = scene.marks;
  const WorkspaceScope scope(workspace);
  const RegionInput in{scene.light_index, scene.depth, scene.labels, scene.uncertain, scene.confidence};
  light_detail::Placing all{p, scene, in, {}, {}, {}, {}, {}, {}};
  Span<light_detail::PlaneSample> samples;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(marks.size() + 1, all.regions));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(marks.size(), all.lamps));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(marks.size(), all.outlines));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kMaxRegionSamples, all.scratch));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(light_detail::kPlaneSamples, samples));
  NPSIM_RETURN_IF_ERROR(light_detail::measure_regions(scene.light_index, all.regions));
  light_detail::look_at_street_lamps(all);
  light_detail::outline_surfaces(all, samples);

  for (std::size_t m = 0; m < marks.size(); ++m) {
    const LightMark& mark = marks[m];
    if (all.region(m).pixels == 0 || is_group(mark.cls) || mark.cls == LightClass::none) continue;
    Emitter e;
    e.cls = mark.cls;
    e.state = mark.state;
    e.mark = static_cast<std::uint16_t>(m + 1);
    e.group = mark.group <= marks.size() ? mark.group : std::uint16_t{0};
    e.group_cls = all.group_class(mark);
    e.profile = light_detail::profile_of(mark, e.group_cls);
    if (p.left_hand_traffic && e.profile == EmissionProfile::low_beam) e.profile = EmissionProfile::low_beam_left;
    if (!light_detail::place_mark(all, m, e)) continue;
    light_detail::set_shape(e);
    if (!is_finite(e.centre_m) || !is_finite(e.half_u_m) || !is_finite(e.half_v_m)) continue;
    if (count == out.size())
      return Status(StatusCode::capacity_exceeded, "placement: more emitters than room for them");
    out[count++] = e;
  }
  light_detail::agree_on_masts(scene.ground, out.sub(0, count));
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_PLACEMENT_HPP
