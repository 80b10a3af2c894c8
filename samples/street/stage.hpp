// SPDX-License-Identifier: Apache-2.0
// The finished scene in the camera frame, with its tree: what rays are cast against, and what a hit means.
//
// Invariant: face i of the stage is face i of the scene with b and c exchanged, because the camera frame has the other
// handedness; cross(b - a, c - a) points out of solids in both.
#ifndef NPSIM_SAMPLES_STREET_STAGE_HPP
#define NPSIM_SAMPLES_STREET_STAGE_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "layout.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/trace/bvh.hpp"
#include "scene.hpp"

namespace npsim {
namespace street {

// Camera frame axes (right, down, forward) in the world.
inline Pose camera_pose(const Layout& l) {
  const float cy = std::cos(l.camera_yaw);
  const float sy = std::sin(l.camera_yaw);
  const float cp = std::cos(l.camera_pitch);
  const float sp = std::sin(l.camera_pitch);
  return {l.at(0, l.camera_d, l.camera_height), {cy, 0, -sy}, {-sy * sp, -cp, -cy * sp}, {sy * cp, -sp, cy * cp}};
}

// The scene in the camera frame with its tree; what rays are cast against.
struct Stage {
  const Scene* scene = nullptr;
  const Layout* layout = nullptr;
  Pose camera;
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<Vec3f> vertex_normals;  // world; zero where no smooth face meets
  std::vector<unsigned char> memory;
  Bvh bvh;

  [[nodiscard]] TriangleMeshView mesh() const {
    return {Span<const Vec3f>(vertices.data(), vertices.size()), Span<const Face>(faces.data(), faces.size())};
  }
  [[nodiscard]] Vec3f to_camera(const Vec3f& d) const { return {dot(d, camera.x), dot(d, camera.y), dot(d, camera.z)}; }
};

inline Status make_stage(const Scene& scene, const Layout& layout, Stage& stage) {
  stage.scene = &scene;
  stage.layout = &layout;
  stage.camera = camera_pose(layout);
  stage.vertices.reserve(scene.vertices.size());
  for (const Vec3f& v : scene.vertices) stage.vertices.push_back(stage.camera.to_local(v));
  stage.faces.reserve(scene.faces.size());
  for (const Face& f : scene.faces) stage.faces.push_back({f.a, f.c, f.b});  // the frame changes handedness
  stage.vertex_normals.assign(scene.vertices.size(), Vec3f{});
  for (std::size_t i = 0; i < scene.faces.size(); ++i) {
    if (!scene.info[i].smooth) continue;
    const Face& f = scene.faces[i];
    const Vec3f n = cross(scene.vertices[f.b] - scene.vertices[f.a], scene.vertices[f.c] - scene.vertices[f.a]);
    stage.vertex_normals[f.a] += n;
    stage.vertex_normals[f.b] += n;
    stage.vertex_normals[f.c] += n;
  }
  stage.memory.resize(bvh_workspace_bytes(stage.faces.size()));
  Workspace workspace(stage.memory.data(), stage.memory.size());
  return build_bvh(stage.mesh(), workspace, stage.bvh);
}

// A hit, made ready for shading. Points and directions in the world.
struct ShadePoint {
  std::uint32_t face = 0;
  float t = 0;
  Vec3f position{};
  Vec3f geometric{};  // unit, against the ray
  Vec3f normal{};     // interpolated where smooth
};

inline ShadePoint shade_point(const Stage& stage, const Vec3f& origin, const Vec3f& direction, const Hit& hit) {
  const Scene& scene = *stage.scene;
  const Face& f = scene.faces[hit.face];
  ShadePoint p;
  p.face = hit.face;
  p.t = hit.t;
  p.position = origin + direction * hit.t;
  p.geometric = normalized(cross(scene.vertices[f.b] - scene.vertices[f.a], scene.vertices[f.c] - scene.vertices[f.a]));
  if (dot(p.geometric, direction) > 0) p.geometric = -p.geometric;
  p.normal = p.geometric;
  if (scene.info[hit.face].smooth) {
    // Barycentric coordinates of the stage's face, whose b and c are exchanged.
    Vec3f n = normalized(stage.vertex_normals[f.a]) * (1 - hit.u - hit.v) +
              normalized(stage.vertex_normals[f.c]) * hit.u + normalized(stage.vertex_normals[f.b]) * hit.v;
    n = normalized(n);
    if (dot(n, p.geometric) < 0) n = -n;
    if (dot(n, direction) < -0.02F) p.normal = n;
  }
  return p;
}

inline bool trace_world(const Stage& stage, const Vec3f& origin, const Vec3f& direction, float t_max, Hit& hit) {
  Ray ray;
  ray.origin = stage.camera.to_local(origin);
  ray.direction = stage.to_camera(direction);
  ray.t_min = 1e-3F;
  ray.t_max = t_max;
  return closest_hit(stage.bvh, ray, hit);
}

inline bool in_shadow(const Stage& stage, const Vec3f& origin, const Vec3f& direction) {
  Ray ray;
  ray.origin = stage.camera.to_local(origin);
  ray.direction = stage.to_camera(direction);
  ray.t_min = 1e-3F;
  ray.t_max = 400;
  return occluded(stage.bvh, ray);
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_STAGE_HPP
