// SPDX-License-Identifier: Apache-2.0
#include "true_lamps.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <string>

#include "npsim/core/span.hpp"
#include "npsim/light/placement.hpp"
#include "npsim/light/unmarked.hpp"

namespace npsim::tool {
namespace {

// A street lamp outside the picture. One inside that is too small to be marked, or hidden, is no unseen one: a night
// does not know of it.
[[nodiscard]] bool is_unseen_lamp(const io::Scene& scene, const io::TrueEmitter& lamp) {
  if (lamp.mark != 0) return false;
  if (lamp.cls != LightClass::street_light_ht && lamp.cls != LightClass::street_light_lt) return false;
  const Vec3f& p = lamp.centre_m;
  if (!(p.z > 0.3F)) return true;
  const float u = scene.intrinsics.fx * p.x / p.z + scene.intrinsics.cx;
  const float v = scene.intrinsics.fy * p.y / p.z + scene.intrinsics.cy;
  return u < 0 || v < 0 || u >= static_cast<float>(scene.shape().width) ||
         v >= static_cast<float>(scene.shape().height);
}

[[nodiscard]] Emitter emitter_of(const io::TrueEmitter& lamp, const LightMark& mark, const GroundPlane& ground) {
  Emitter e;
  e.cls = mark.cls;
  e.state = mark.state;
  e.group = mark.group;
  e.group_cls = lamp.group_cls;
  e.profile = light_detail::profile_of(mark, lamp.group_cls);
  e.mounting_height_m = lamp.mounting_height_m;
  const bool street = is_street_profile(e.profile);
  if (street) e.profile = light_detail::street_profile(lamp.mounting_height_m);
  e.axis = lamp.axis;
  // A headlamp's axis leads to the elbow of its cut-off; headings are level.
  if (e.profile == EmissionProfile::low_beam) e.axis = normalized(e.axis - ground.up * kLowBeamAim);
  e.up = light_detail::perpendicular(e.axis, street ? lamp.up : ground.up);
  const bool surface = e.profile == EmissionProfile::lambert;
  const float share = lamp.closed ? 0.25F : 1.0F;
  e.area_m2 = surface ? lamp.area_m2 * share : lamp.seen_area_m2;

  // The half extents are along a level and an upright direction of the plane (annotate.hpp of the street).
  const Vec3f across = cross(-ground.up, lamp.normal);
  const Vec3f u = normalized(length(across) > 0.05F ? across : cross(Vec3f{0, 0, 1}, lamp.normal));
  const Vec3f v = cross(lamp.normal, u);
  const float rectangle = 4.0F * lamp.half_extents_m.x * lamp.half_extents_m.y;
  const float scale = rectangle > 0.0F ? std::sqrt(lamp.area_m2 * share / rectangle) : 0.0F;
  e.half_u_m = u * (lamp.half_extents_m.x * scale);
  e.half_v_m = v * (lamp.half_extents_m.y * scale);
  e.centre_m = lamp.centre_m + e.axis * kLampOffset;
  return e;
}

}  // namespace

io::Expected<TrueLamps> read_true_lamps(const io::Scene& scene) {
  if (!scene.truth.ground) {
    return io::Error{scene.file, "truth.ground", "is missing, expected the true camera height and up direction"};
  }
  const io::Expected<std::vector<io::TrueEmitter>> lamps = io::read_truth_emitters(scene);
  if (!lamps) return lamps.error();
  std::map<std::uint32_t, std::size_t> position;  // of the mark with an id
  for (std::size_t m = 0; m < scene.lights.size(); ++m) position[scene.lights[m].id] = m;
  TrueLamps out;
  out.ground = *scene.truth.ground;
  std::map<std::size_t, const io::TrueEmitter*> by_position;
  for (const io::TrueEmitter& lamp : lamps.value()) {
    if (lamp.mark == 0) continue;
    const auto at = position.find(lamp.mark);
    if (at == position.end() || scene.lights[at->second].cls != lamp.cls) {
      return io::Error{scene.truth.emitters, "mark " + std::to_string(lamp.mark),
                       "is not annotated as this class, expected the emitters of the same street as its lights"};
    }
    by_position[at->second] = &lamp;
  }
  for (const auto& [m, lamp] : by_position) {
    Emitter e = emitter_of(*lamp, scene.lights[m], out.ground);
    e.mark = static_cast<std::uint16_t>(m + 1);
    e.shop_front = is_shop_front(out.ground, e);
    out.emitters.push_back(e);
    out.faces_of.push_back(lamp->id);
  }
  Emitter own[kEgoHeadlampCount];
  const std::size_t count = place_ego_headlamps(EgoHeadlampParams{}, out.ground, {own, kEgoHeadlampCount});
  out.emitters.insert(out.emitters.end(), own, own + count);
  out.faces_of.resize(out.emitters.size(), 0);
  for (const io::TrueEmitter& lamp : lamps.value()) {
    if (!is_unseen_lamp(scene, lamp)) continue;
    // A night lights it as it does those of its class that are marked.
    const auto of_class = [&](const Emitter& e) { return e.mark != 0 && e.cls == lamp.cls; };
    if (std::none_of(out.emitters.begin(), out.emitters.end(), of_class)) continue;
    LightMark unmarked;
    unmarked.cls = lamp.cls;
    Emitter e = emitter_of(lamp, unmarked, out.ground);
    e.unseen = ++out.unseen;
    out.emitters.push_back(e);
    out.faces_of.push_back(lamp.id);
  }
  return out;
}

}  // namespace npsim::tool
