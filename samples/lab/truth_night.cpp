// SPDX-License-Identifier: Apache-2.0
#include "truth_night.hpp"

#include <cmath>
#include <cstddef>
#include <cstring>
#include <map>
#include <utility>

#include "npsim/core/camera.hpp"
#include "npsim/io/truth_mesh.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/light/light_set.hpp"
#include "npsim/material/roughness.hpp"
#include "tool/lamp_names.hpp"
#include "true_lamps.hpp"

namespace npsim::tool {
namespace {

using io::Error;
using io::Expected;

// A source of the night's JSON.
struct DrawnLamp {
  std::size_t emitter = 0;  // position in TrueLamps::emitters
  float strength = 0;       // true, in the unit of the profile
  Vec2f xy;
};

[[nodiscard]] Expected<float> positive(const io::JsonObject& entry, const char* key) {
  const Expected<double> value = entry.number(key);
  if (!value) return value.error();
  if (value.value() > 0 && value.value() < 1e9) return static_cast<float>(value.value());
  return Error{entry.file(), entry.field(key), "is not positive, expected what npsim night writes"};
}

[[nodiscard]] Expected<bool> yes_or_no(const io::JsonObject& entry, const char* key) {
  const Expected<const io::Json*> value = entry.required(key);
  if (!value) return value.error();
  if (value.value()->is_boolean()) return value.value()->get<bool>();
  return Error{entry.file(), entry.field(key),
               std::string("is ") + io::JsonObject::kind(*value.value()) + ", expected true or false"};
}

[[nodiscard]] Expected<DrawnLamp> drawn_lamp(const io::JsonObject& entry, const TrueLamps& lamps,
                                             std::size_t position) {
  const Emitter& lamp = lamps.emitters[position];
  DrawnLamp drawn;
  drawn.emitter = position;
  const Expected<std::string> profile = entry.text("profile");
  if (!profile) return profile.error();
  // Of which kind a street lamp is, is the truth's to say; whether it is one, the night has to agree on.
  const bool street = is_street_profile(lamp.profile);
  const bool kind = profile.value() == profile_name(lamp.profile);
  const auto is = [&](EmissionProfile p) { return profile.value() == profile_name(p); };
  const bool any_street =
      is(EmissionProfile::street_luminaire) || is(EmissionProfile::hung_luminaire) || is(EmissionProfile::lantern);
  if (!kind && !(street && any_street)) {
    return Error{entry.file(), entry.field("profile"),
                 "is '" + profile.value() + "', expected " + profile_name(lamp.profile) + " as that of the true lamp"};
  }
  const Expected<float> strength = positive(entry, "strength");
  if (!strength) return strength.error();
  drawn.strength = strength.value();
  const Expected<const io::Json*> xy = entry.list("xy");
  if (!xy) return xy.error();
  if (xy.value()->size() != 2 || !(*xy.value())[0].is_number() || !(*xy.value())[1].is_number()) {
    return Error{entry.file(), entry.field("xy"), "expected two numbers"};
  }
  drawn.xy = {(*xy.value())[0].get<float>(), (*xy.value())[1].get<float>()};
  if (!street) return drawn;
  const Expected<bool> follows = yes_or_no(entry, "strength_follows_height");
  if (!follows) return follows.error();
  if (follows.value()) {
    const Expected<float> placed = positive(entry, "mounting_height_m");
    if (!placed) return placed.error();
    drawn.strength *= light_detail::height_factor(lamp.mounting_height_m) / light_detail::height_factor(placed.value());
  }
  return drawn;
}

// Street lamps that the photograph does not show, as strong as those of their class that it does, at their own height.
void add_unseen_lamps(const TrueLamps& lamps, std::vector<DrawnLamp>& drawn) {
  const std::size_t seen = drawn.size();
  for (std::size_t e = 0; e < lamps.emitters.size(); ++e) {
    const Emitter& lamp = lamps.emitters[e];
    if (lamp.unseen == 0) continue;
    float strength = 0;
    Vec2f xy;
    float count = 0;
    for (std::size_t d = 0; d < seen; ++d) {
      const Emitter& other = lamps.emitters[drawn[d].emitter];
      if (other.cls != lamp.cls) continue;
      strength += drawn[d].strength / light_detail::height_factor(other.mounting_height_m);
      xy = {xy.x + drawn[d].xy.x, xy.y + drawn[d].xy.y};
      ++count;
    }
    if (!(count > 0)) continue;
    drawn.push_back(
        {e, strength / count * light_detail::height_factor(lamp.mounting_height_m), {xy.x / count, xy.y / count}});
  }
}

// The lamps that the night lit.
[[nodiscard]] Expected<std::vector<DrawnLamp>> drawn_lamps(const std::string& path, const io::Scene& scene,
                                                           const TrueLamps& lamps) {
  const Expected<io::Json> json = io::read_json(path);
  if (!json) return json.error();
  const Expected<io::JsonObject> root = io::JsonObject::of(path, "", json.value());
  if (!root) return root.error();
  const Expected<const io::Json*> list = root.value().list("sources");
  if (!list) return list.error();
  std::map<std::uint32_t, std::size_t> by_id;  // of the annotation
  std::size_t own = 0;                         // the next headlamp of the camera's own car
  for (std::size_t e = 0; e < lamps.emitters.size(); ++e) {
    const std::uint16_t mark = lamps.emitters[e].mark;
    if (mark == 0) break;
    by_id[scene.lights[mark - 1U].id] = e;
    own = e + 1;
  }
  std::vector<DrawnLamp> drawn;
  for (std::size_t i = 0; i < list.value()->size(); ++i) {
    const Expected<io::JsonObject> entry =
        io::JsonObject::of(path, "sources[" + std::to_string(i) + "]", (*list.value())[i]);
    if (!entry) return entry.error();
    const Expected<bool> lit = yes_or_no(entry.value(), "lit");
    if (!lit) return lit.error();
    std::size_t position = 0;
    if (entry.value().has("id")) {
      const Expected<std::int64_t> id = entry.value().whole("id");
      if (!id) return id.error();
      const auto found = by_id.find(static_cast<std::uint32_t>(id.value()));
      if (found == by_id.end()) {
        return Error{path, entry.value().field("id"),
                     "no true lamp has this annotation, expected a night of the scene " + scene.file};
      }
      position = found->second;
    } else {
      const Expected<std::string> source = entry.value().text("source");
      if (!source) return source.error();
      if (source.value() == "continued") continue;  // the true ones take their place
      if (source.value() == "moon" || source.value() == "following car") {
        return Error{path, entry.value().field("source"),
                     "is a " + source.value() + ", which true nights lack, expected no --moon and no --following-car"};
      }
      if (own == lamps.emitters.size() || lamps.emitters[own].unseen != 0) {
        return Error{path, entry.value().field("source"), "expected at most two headlamps of the car itself"};
      }
      position = own++;
    }
    if (!lit.value()) continue;
    const Expected<DrawnLamp> lamp = drawn_lamp(entry.value(), lamps, position);
    if (!lamp) return lamp.error();
    drawn.push_back(lamp.value());
  }
  if (!root.value().has("unseen_street_lamps")) return drawn;
  const Expected<bool> unseen = yes_or_no(root.value(), "unseen_street_lamps");
  if (!unseen) return unseen.error();
  if (unseen.value()) add_unseen_lamps(lamps, drawn);
  return drawn;
}

// The lamp in the reference's terms, without its shape where that is a set of faces.
[[nodiscard]] reference::Lamp reference_lamp(const Emitter& e, std::uint32_t faces, const DrawnLamp& drawn) {
  const Activation a = make_activation(e, true, 1.0F, drawn.strength, drawn.xy);
  reference::Lamp lamp = reference::lamp_of(e, a.intensity_cd);
  lamp.faces = faces;
  if (e.profile == EmissionProfile::lambert) lamp.luminance_cd_m2 = static_cast<double>(drawn.strength);
  if (faces != 0) {
    lamp.triangles.clear();
    lamp.area_m2 = 0;
  }
  return lamp;
}

// Puts the lamps into the scene; luminance of each as the camera sees it, by the number of its faces.
[[nodiscard]] io::Outcome add_lamps(const io::Scene& scene, const TrueLamps& lamps, const std::vector<DrawnLamp>& drawn,
                                    reference::NightScene& out, std::map<std::uint32_t, Vec3f>& luminance) {
  std::map<std::uint32_t, std::size_t> lamp_of_faces;
  for (const DrawnLamp& d : drawn) {
    const Emitter& e = lamps.emitters[d.emitter];
    const std::uint32_t faces = lamps.faces_of[d.emitter];
    if (faces != 0) {
      lamp_of_faces[faces] = out.lamps.size();
      luminance[faces] = make_activation(e, true, 1.0F, d.strength, d.xy).luminance_cd_m2;
    }
    out.lamps.push_back(reference_lamp(e, faces, d));
  }
  for (std::size_t f = 0; f < out.faces.size(); ++f) {
    const auto found = lamp_of_faces.find(out.face_lamp[f]);
    if (found == lamp_of_faces.end()) continue;
    const Face& face = out.faces[f];
    const auto corner = [&](std::uint32_t v) { return vec_cast<double>(out.vertices[v]); };
    out.lamps[found->second].add_triangle(corner(face.a), corner(face.b), corner(face.c));
  }
  for (const auto& [faces, lamp] : lamp_of_faces) {
    if (!(out.lamps[lamp].area_m2 > 0)) {
      return Error{scene.truth.mesh, "e" + std::to_string(faces), "has no face, expected those of the emitter"};
    }
  }
  return io::Done{};
}

// What the pixels retroreflect, by their labels, what is marked and their true albedo.
[[nodiscard]] io::Image<Retroreflector> retroreflectors(const io::Scene& scene) {
  io::Image<Retroreflector> out(scene.shape());
  if (scene.albedo.empty()) return out;
  std::vector<unsigned char> memory(find_retroreflectors_workspace_bytes(scene.shape()));
  Workspace workspace(memory.data(), memory.size());
  SerialExecutor serial;
  ReflectorScene reflecting{scene.labels.view(), scene.reflectors.view(), scene.albedo.view(), scene.depth.view(),
                            scene.intrinsics};
  if (scene.camera_height_m > 0) reflecting.camera_height_m = static_cast<float>(scene.camera_height_m);
  const Status found = find_retroreflectors({}, 0.0F, reflecting, out.view(), workspace, serial);
  return found.ok() ? out : io::Image<Retroreflector>(scene.shape());
}

// What each pixel's centre shows.
void look(const io::Scene& scene, const SkyParams& sky, const std::map<std::uint32_t, Vec3f>& luminance,
          TruthNight& night) {
  const Shape shape = scene.shape();
  const io::Image<Retroreflector> retro = retroreflectors(scene);
  night.shape = shape;
  night.seen = reference::viewed_points(night.scene, night.tree, scene.intrinsics, shape);
  night.emitted.assign(shape.pixels(), {});
  night.sky.assign(shape.pixels(), {});
  std::size_t p = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x, ++p) {
      reference::ViewedPoint& seen = night.seen[p];
      if (seen.face == reference::kNothing) {
        const Vec3f direction = raised_to_horizon(sky, vec_cast<float>(-seen.to_eye));
        night.sky[p] = vec_cast<double>(sky_luminance(sky, direction));
        continue;
      }
      if (!scene.albedo.empty()) seen.at.albedo = vec_cast<double>(scene.albedo(x, y));
      if (!scene.roughness.empty()) seen.at.alpha = static_cast<double>(alpha_of_roughness(scene.roughness(x, y)));
      seen.at.retro = retro(x, y);
      const auto lit = luminance.find(night.scene.lamp_of_face(seen.face));
      if (lit != luminance.end()) night.emitted[p] = vec_cast<double>(lit->second);
    }
  }
}

// FNV-1a over numbers, one after the other.
class Fingerprint {
 public:
  template <class T>
  void add(const T& number) {
    static_assert(std::is_arithmetic_v<T> || std::is_enum_v<T>, "a structure may hold padding");
    unsigned char bytes[sizeof number];
    std::memcpy(bytes, &number, sizeof number);
    for (const unsigned char byte : bytes) hash_ = (hash_ ^ byte) * 0x100000001B3U;
  }
  template <class T>
  void add(const Vec3<T>& v) {
    add(v.x);
    add(v.y);
    add(v.z);
  }
  [[nodiscard]] std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xCBF29CE484222325U;
};

}  // namespace

Expected<TruthNight> make_truth_night(const io::Scene& scene, const std::string& night_json) {
  const Expected<TrueLamps> lamps = read_true_lamps(scene);
  if (!lamps) return lamps.error();
  const Expected<std::vector<DrawnLamp>> drawn = drawn_lamps(night_json, scene, lamps.value());
  if (!drawn) return drawn.error();
  Expected<io::TrueMesh> mesh = io::read_truth_mesh(scene);
  if (!mesh) return mesh.error();
  TruthNight night;
  reference::NightScene& out = night.scene;
  out.vertices = std::move(mesh.value().mesh.vertices);
  out.faces = std::move(mesh.value().mesh.faces);
  out.face_material = std::move(mesh.value().face_material);
  out.face_lamp = std::move(mesh.value().face_emitter);
  for (const io::TrueMaterial& m : mesh.value().materials)
    out.materials.push_back({m.albedo, alpha_of_roughness(m.roughness)});
  SkyParams sky;
  sky.up = lamps.value().ground.up;
  out.sky = reference::Sky(sky);
  std::map<std::uint32_t, Vec3f> luminance;
  if (const io::Outcome added = add_lamps(scene, lamps.value(), drawn.value(), out, luminance); !added) {
    return added.error();
  }
  night.tree = reference::TriangleTree(out.mesh());
  look(scene, sky, luminance, night);
  return night;
}

std::uint64_t fingerprint(const TruthNight& night, const reference::PathParams& params) {
  Fingerprint hash;
  const reference::NightScene& s = night.scene;
  hash.add(params.seed);
  hash.add(params.bounces);
  hash.add(params.roulette_from);
  hash.add(night.shape.width);
  for (const Vec3f& v : s.vertices) hash.add(v);
  for (std::size_t f = 0; f < s.faces.size(); ++f) {
    for (const std::uint32_t number : {s.faces[f].a, s.faces[f].b, s.faces[f].c, s.face_material[f], s.face_lamp[f]}) {
      hash.add(number);
    }
  }
  for (const reference::SurfaceMaterial& m : s.materials) {
    hash.add(m.albedo);
    hash.add(m.alpha);
  }
  for (const reference::Lamp& lamp : s.lamps) {
    hash.add(lamp.profile);
    for (const Vec3d& v : {lamp.axis, lamp.up, lamp.colour, lamp.centre}) hash.add(v);
    for (const double v : {lamp.peak_cd, lamp.luminance_cd_m2, lamp.area_m2, lamp.radius}) hash.add(v);
  }
  for (const Vec3d& v : {s.sky.zenith_cd_m2, s.sky.horizon_cd_m2, s.sky.below_cd_m2, s.sky.up}) hash.add(v);
  for (const reference::ViewedPoint& seen : night.seen) {
    hash.add(seen.surface);
    hash.add(seen.at.position);
    hash.add(seen.at.albedo);
    hash.add(seen.at.alpha);
    hash.add(seen.at.retro.kind);
    hash.add(seen.at.retro.strength);
  }
  return hash.value();
}

}  // namespace npsim::tool
