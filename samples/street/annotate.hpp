// SPDX-License-Identifier: Apache-2.0
// The light annotation of the photograph, and the emitters of the true scene.
//
// As in hand-made annotations, a source is marked where it is seen over enough pixels, sources that belong together
// name a group, and the rest of a vehicle's body or of a signal's housing carries the mark of its group.
// Invariant: every mark of a source has at least `min_px` pixels in the index plane; every group has a marked member.
#ifndef NPSIM_SAMPLES_STREET_ANNOTATE_HPP
#define NPSIM_SAMPLES_STREET_ANNOTATE_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "params.hpp"
#include "render.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

// Flat patch that stands for all faces of each light, in the camera frame.
inline void collect_emitters(const Stage& stage, Street& street) {
  const Scene& scene = *stage.scene;
  const std::size_t count = scene.lights.size();
  street.emitters.assign(count, Emitter{});
  std::vector<Vec3f> weighted(count);
  std::vector<Vec3f> normals(count);
  std::vector<float> areas(count, 0.0F);
  const auto corners = [&](std::size_t f) {
    const Face& face = stage.faces[f];
    return std::array<Vec3f, 3>{stage.vertices[face.a], stage.vertices[face.b], stage.vertices[face.c]};
  };
  for (std::size_t f = 0; f < stage.faces.size(); ++f) {
    const std::uint16_t light = scene.info[f].light;
    if (light == 0) continue;
    const auto p = corners(f);
    const Vec3f n = cross(p[1] - p[0], p[2] - p[0]) * 0.5F;
    const float area = length(n);
    const Vec3f middle = (p[0] + p[1] + p[2]) / 3.0F;
    if (middle.z > 0) street.emitters[light - 1U].seen_area_m2 += std::fmax(0.0F, -dot(n, middle)) / middle.z;
    weighted[light - 1U] += (p[0] + p[1] + p[2]) * (area / 3);
    normals[light - 1U] += n;
    areas[light - 1U] += area;
  }
  std::vector<Vec3f> u(count);
  std::vector<Vec3f> v(count);
  const Vec3f down = stage.to_camera({0, -1, 0});
  for (std::size_t i = 0; i < count; ++i) {
    const SceneLight& light = scene.lights[i];
    Emitter& e = street.emitters[i];
    e.cls = light.cls;
    e.state = light.state;
    e.group = light.group;
    e.group_cls = light.group != 0 ? scene.groups[light.group - 1U].cls : LightClass::none;
    e.lit_by_day = light.lit_by_day;
    if (areas[i] > 0) e.centre = weighted[i] / areas[i];
    // A closed shape (lantern, all windows of a car) has no direction of its own: it counts as facing the camera.
    e.closed = length(normals[i]) < 0.5F * areas[i];
    e.normal = e.closed ? normalized(-e.centre) : normalized(normals[i]);
    if (e.closed && light.cls == LightClass::street_light_ht) e.normal = down;
    e.area_m2 = areas[i];
    e.axis = light.axis == Vec3f{} ? e.normal : stage.to_camera(light.axis);
    const bool street_lamp = light.cls == LightClass::street_light_ht || light.cls == LightClass::street_light_lt;
    // Origin and height zero of the world are on the road.
    if (street_lamp) e.mounting_height_m = stage.camera.point(e.centre).y;
    const Vec3f across = cross(down, e.normal);
    u[i] = length(across) > 0.05F ? normalized(across) : normalized(cross(Vec3f{0, 0, 1}, e.normal));
    v[i] = cross(e.normal, u[i]);
    e.up = light.axis == Vec3f{} ? v[i] : stage.to_camera(light.up);
  }
  for (std::size_t f = 0; f < stage.faces.size(); ++f) {
    const std::uint16_t light = scene.info[f].light;
    if (light == 0) continue;
    Emitter& e = street.emitters[light - 1U];
    for (const Vec3f& p : corners(f)) {
      const Vec3f d = p - e.centre;
      e.half_extents.x = std::fmax(e.half_extents.x, std::fabs(dot(d, u[light - 1U])));
      e.half_extents.y = std::fmax(e.half_extents.y, std::fabs(dot(d, v[light - 1U])));
    }
  }
}

// Writes marks, light_index, reflectors and Emitter::mark from the face seen in each pixel.
inline void annotate(const Stage& stage, const std::vector<std::uint32_t>& seen, Street& street) {
  const Scene& scene = *stage.scene;
  std::vector<int> pixels(scene.lights.size(), 0);
  for (const std::uint32_t face : seen) {
    if (face != kNoFace && scene.info[face].light != 0) ++pixels[scene.info[face].light - 1U];
  }
  std::vector<std::uint16_t> light_mark(scene.lights.size(), 0);
  std::vector<std::uint16_t> group_mark(scene.groups.size(), 0);
  street.marks.clear();
  const auto add = [&](LightClass cls, SignalState state, std::uint16_t group) {
    LightMark m;
    m.id = static_cast<std::uint32_t>(street.marks.size()) + 1U;
    m.cls = cls;
    m.state = state;
    m.group = group;
    street.marks.push_back(m);
    return static_cast<std::uint16_t>(street.marks.size());
  };
  for (std::size_t i = 0; i < scene.lights.size(); ++i) {
    if (pixels[i] < street.params.light_min_px || pixels[i] == 0) continue;
    const SceneLight& light = scene.lights[i];
    std::uint16_t group = 0;
    if (light.group != 0) {
      std::uint16_t& mark = group_mark[light.group - 1U];
      if (mark == 0) mark = add(scene.groups[light.group - 1U].cls, SignalState::unknown, 0);
      group = mark;
    }
    light_mark[i] = add(light.cls, light.state, group);
    street.emitters[i].mark = light_mark[i];
  }
  for (int y = 0; y < street.params.shape.height; ++y) {
    for (int x = 0; x < street.params.shape.width; ++x) {
      const std::uint32_t face =
          seen[static_cast<std::size_t>(y) * static_cast<std::size_t>(street.params.shape.width) +
               static_cast<std::size_t>(x)];
      std::uint16_t mark = 0;
      if (face != kNoFace) {
        if (scene.info[face].light != 0) mark = light_mark[scene.info[face].light - 1U];
        if (mark == 0 && scene.panel[face] != 0) mark = group_mark[scene.panel[face] - 1U];
      }
      street.light_index(x, y) = mark;
      const bool plate = face != kNoFace && scene.materials[scene.info[face].material].kind == Kind::plate;
      street.reflectors(x, y) = plate ? ReflectorClass::number_plate : ReflectorClass::none;
    }
  }
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_ANNOTATE_HPP
