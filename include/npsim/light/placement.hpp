// SPDX-License-Identifier: Apache-2.0
// From annotated regions to emitters in space: one per marked source that has pixels and whose distance can be known.
//
// Depth: the median over the region's surface pixels, certain ones first, without outliers (detail/lamp_depth.hpp);
// that of its surroundings where the region has none. Street lamps hang before the sky, where depth is worst: same
// header. Patch: the region's rectangle with the region's area. Windows and signs lie in their facade's plane and face
// along its normal; lamps are parallel to the image; a street lamp's is level, at the lower edge of its head. All are
// pulled off their surface by offset_m along the axis, so that the surface does not shade them. Axes: vehicle lamps
// along the street (against the viewing direction on the ground), or along the local normal where that is far off it,
// low beams 1 % down; signals towards the camera's lane; street lamps down. Regions of which no depth can be found, and
// marks that are groups, give no emitter. Order is that of the marks. Cost: two passes over the image and one over each
// region's rectangle. Memory: about 3 MB, see the bytes function.
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
  float max_lamp_yaw_cosine = 0.3F;  // vehicle lamps: below this to the street's direction the normal decides
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
  ImageView<const std::uint16_t> instances;    // equal id and label = same object
  ImageView<const std::uint8_t> uncertain;     // not 0: the depth is not to be trusted
  ImageView<const Vec3f> normals;
};

inline constexpr std::size_t kMaxLightMarks = 65535;  // an index plane can name no more

[[nodiscard]] constexpr std::size_t placement_workspace_bytes(const PlacementParams&, Shape) noexcept {
  return allocation_bytes<LightRegion>(kMaxLightMarks + 1) + allocation_bytes<float>(kMaxRegionSamples) +
         allocation_bytes<light_detail::StreetLamp>(kMaxLightMarks) +
         allocation_bytes<light_detail::Outline>(kMaxLightMarks) +
         allocation_bytes<light_detail::PlaneSample>(light_detail::kPlaneSamples) +
         kWorkspaceAlignment;
}

[[nodiscard]] inline Status validate(const PlacementParams& p) noexcept {
  const bool good = p.offset_m >= 0.0F && std::isfinite(p.offset_m) && p.min_area_m2 > 0.0F &&
                    p.min_street_area_m2 > 0.0F && p.max_side_m > 0.0F && std::isfinite(p.max_side_m) &&
                    p.min_facing_cosine > 0.0F && p.min_facing_cosine < 1.0F && p.street.min_height_m > 0.0F &&
                    p.street.max_height_m > p.street.min_height_m && p.street.default_height_m > 0.0F &&
                    std::isfinite(p.street.default_height_m) && std::isfinite(p.street.max_height_m) &&
                    p.street.max_distance_m > 0.0F && std::isfinite(p.street.max_distance_m) &&
                    p.street.arm_m >= 0.0F && std::isfinite(p.street.arm_m) &&
                    std::isfinite(p.min_area_m2) && std::isfinite(p.min_street_area_m2) &&
                    std::isfinite(p.max_lamp_yaw_cosine);
  return good ? Status() : Status(StatusCode::invalid_argument, "placement: a parameter lies outside its range");
}

[[nodiscard]] inline Status validate(const PlacementScene& s) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(s.camera));
  const Shape shape = s.light_index.shape();
  const auto agrees = [&](const auto& plane) { return plane.empty() || plane.shape() == shape; };
  if (s.light_index.empty() || s.depth.shape() != shape || !agrees(s.labels) || !agrees(s.instances) ||
      !agrees(s.uncertain) || !agrees(s.normals)) {
    return Status(StatusCode::shape_mismatch, "placement: every plane must have the shape of the light index");
  }
  if (s.marks.size() > kMaxLightMarks) return Status(StatusCode::capacity_exceeded, "placement: more than 65535 marks");
  const GroundPlane& ground = s.ground;
  if (!is_finite(ground.up) || std::fabs(length(ground.up) - 1.0F) > 1e-3F || !std::isfinite(ground.camera_height_m)) {
    return Status(StatusCode::invalid_argument, "placement: the ground plane needs a unit normal");
  }
  return {};
}

namespace light_detail {

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

[[nodiscard]] constexpr bool is_street_lamp(LightClass c) noexcept {
  return c == LightClass::street_light_ht || c == LightClass::street_light_lt;
}

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
  if (e.profile == EmissionProfile::low_beam) axis = normalized(axis - ground.up * kLowBeamAim);
  set_patch(e, {0.5F * static_cast<float>(r.x1 - r.x0 + 1) * z / k.fx, 0.0F, 0.0F},
            {0.0F, 0.5F * static_cast<float>(r.y1 - r.y0 + 1) * z / k.fy, 0.0F}, r.fill(), p.min_area_m2, p.max_side_m);
  e.axis = axis;
  e.up = perpendicular(axis, ground.up);
  e.centre_m = centre + axis * p.offset_m;
}

inline void place_street_lamp(const PlacementParams& p, const Intrinsics& k, const LightRegion& r, float u, float z,
                              const GroundPlane& ground, Emitter& e) noexcept {
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
  e.mounting_height_m = std::max(height_above_ground(ground, unproject(k, u, static_cast<float>(r.y1 + 1), z)), 0.0F);
  e.centre_m = unproject(k, u, static_cast<float>(r.y1 + 1), z) + down * p.offset_m;
}

}  // namespace light_detail

// `out` holds at least as many elements as there are marks that are not groups; `count` is how many were written.
[[nodiscard]] inline Status place_lights(const PlacementParams& p, const PlacementScene& scene, Workspace& workspace,
                                         Span<Emitter> out, std::size_t& count) noexcept {
  count = 0;
  NPSIM_RETURN_IF_ERROR(validate(p));
  NPSIM_RETURN_IF_ERROR(validate(scene));
  const Span<const LightMark> marks = scene.marks;
  const Intrinsics& k = scene.camera;
  const GroundPlane& ground = scene.ground;
  const WorkspaceScope scope(workspace);
  Span<LightRegion> regions;
  Span<float> scratch;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(marks.size() + 1, regions));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kMaxRegionSamples, scratch));
  NPSIM_RETURN_IF_ERROR(light_detail::measure_regions(scene.light_index, regions));
  const RegionInput in{scene.light_index, scene.depth, scene.labels, scene.uncertain};
  const light_detail::LampView lamp{p.street, in, k, ground};
  Span<light_detail::PlaneSample> samples;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(light_detail::kPlaneSamples, samples));
  const light_detail::VehicleView vehicles{in, scene.instances, scene.normals, k, ground};
  const light_detail::PlaneSearch search{in, scene.instances, k, ground, samples};
  Span<light_detail::Outline> outlines;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(marks.size(), outlines));
  for (std::size_t m = 0; m < marks.size(); ++m) {
    outlines[m] = light_detail::Outline{};
    const LightRegion& region = regions[m + 1];
    const LightClass group_cls = marks[m].group != 0 && marks[m].group <= marks.size() ? marks[marks[m].group - 1U].cls : LightClass::none;
    if (region.pixels == 0 || is_group(marks[m].cls) || marks[m].cls == LightClass::window_parked ||
        light_detail::profile_of(marks[m], group_cls) != EmissionProfile::lambert) continue;
    const auto value = static_cast<std::uint16_t>(m + 1);
    const float z = light_detail::region_depth(in, region, value, scratch);
    light_detail::UprightPlane plane = light_detail::region_plane(search, region, value, z);
    if (plane.known() && (marks[m].cls == LightClass::advertisement || marks[m].cls == LightClass::inferred_object)) {
      const Vec3f centre = unproject(k, static_cast<float>(region.mean_x()), static_cast<float>(region.mean_y()), z);
      plane = light_detail::across_wall(plane, light_detail::region_normal(in, region, value, scene.normals, centre), centre, ground);
    }
    if (plane.known()) outlines[m] = light_detail::region_outline(in, region, value, plane, k, ground);
    if (outlines[m].known()) {
      const Vec3f centre = unproject(k, static_cast<float>(region.mean_x()), static_cast<float>(region.mean_y()), z);
      const Vec3f nn=light_detail::region_normal(in, region, value, scene.normals, centre);
      if (dot(nn,nn)>.5F && dot(nn, plane.normal) < .5F && outlines[m].u1-outlines[m].u0 > 2.5F*(outlines[m].v1-outlines[m].v0)) outlines[m]=light_detail::Outline{};
    }
    if (marks[m].cls == LightClass::window_building && outlines[m].known()) light_detail::add_reveal(outlines[m], p.reveal_m);
  }
  Span<light_detail::StreetLamp> lamps;  // by mark; those that are no street lamps know nothing
  NPSIM_RETURN_IF_ERROR(workspace.allocate(marks.size(), lamps));
  for (std::size_t m = 0; m < marks.size(); ++m) {
    const bool street = regions[m + 1].pixels > 0 && light_detail::is_street_lamp(marks[m].cls);
    lamps[m] = street ? light_detail::look_at_lamp(lamp, regions[m + 1], static_cast<std::uint16_t>(m + 1), scratch)
                      : light_detail::StreetLamp{};
  }

  for (std::size_t m = 0; m < marks.size(); ++m) {
    const LightMark& mark = marks[m];
    const LightRegion& region = regions[m + 1];
    if (region.pixels == 0 || is_group(mark.cls) || mark.cls == LightClass::none) continue;
    const auto value = static_cast<std::uint16_t>(m + 1);
    Emitter e;
    e.cls = mark.cls;
    e.state = mark.state;
    e.mark = value;
    e.group = mark.group <= marks.size() ? mark.group : std::uint16_t{0};
    e.group_cls = e.group != 0 ? marks[e.group - 1U].cls : LightClass::none;
    e.profile = light_detail::profile_of(mark, e.group_cls);
    const float u = static_cast<float>(region.mean_x());
    const float v = static_cast<float>(region.mean_y());
    const bool street = e.profile == EmissionProfile::street_luminaire;
    const float z = street ? light_detail::street_lamp_depth(
                                    lamp, lamps, m, [&](std::size_t i) { return marks[i].cls == mark.cls; })
                           : light_detail::region_depth(in, region, value, scratch);
    if (!is_valid_depth(z)) continue;
    const Vec3f normal = light_detail::region_normal(in, region, value, scene.normals, unproject(k, u, v, 1.0F));
    if (street) {
      light_detail::place_street_lamp(p, k, region, u, z, ground, e);
    } else if (e.profile == EmissionProfile::lambert) {
      light_detail::Outline outline = outlines[m];
      if (outline.known()) {
        if (mark.cls == LightClass::window_building) {
          const auto same = [&](std::size_t i) { return marks[i].cls == mark.cls && e.group != 0 && marks[i].group == e.group; };
          light_detail::add_hidden(light_detail::usual_size(outlines, false, same, scratch), outline.cut[0], outline.cut[1], outline.u0, outline.u1);
          light_detail::add_hidden(light_detail::usual_size(outlines, true, same, scratch), outline.cut[2], outline.cut[3], outline.v0, outline.v1);
        }
        outline.fill = mark.cls == LightClass::clock ? 0.785F : 1.0F;
        light_detail::place_outline(p, outline, e);
      } else {
        light_detail::place_by_normal(p, k, region, u, v, z, normal, ground, e);
      }
    } else {
      const bool vehicle = e.cls != LightClass::inferred_object;
      const bool front = e.cls == LightClass::moving_front || e.cls == LightClass::parked_front;
      const float at_m = vehicle ? light_detail::vehicle_lamp_depth(vehicles, region, front, z) : z;
      const Vec3f axis = vehicle ? light_detail::vehicle_lamp_axis(vehicles, region, unproject(k, u, v, at_m)) : Vec3f{};
      light_detail::place_lamp(p, k, region, u, v, at_m, axis, ground, e);
    }
    if (!is_finite(e.centre_m) || !is_finite(e.half_u_m) || !is_finite(e.half_v_m)) continue;
    if (count == out.size())
      return Status(StatusCode::capacity_exceeded, "placement: more emitters than room for them");
    out[count++] = e;
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_PLACEMENT_HPP
