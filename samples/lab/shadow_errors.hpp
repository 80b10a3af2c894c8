// SPDX-License-Identifier: Apache-2.0
// Shadows cast by a reconstructed mesh against those of the true scene.
//
// Pairs of a visible point (on a regular grid of pixels) and a lamp that faces each other in the true scene. The ray
// starts at the pixel's point of the mesh in question, pulled out along the true normal by a share of its depth, and ends
// `lamp_clearance_m` and the lamp's own extent before the lamp: whether lamps are placed right is another question.
// Faces that are part of the lamp (pipeline/relight.hpp) do not block it.
// A leak is a pair that is dark in the true scene because of a surface which the camera sees, and lit by the mesh:
// light came through an edge, or a surface, that is closed.
// Every pair counts alike, and once more by the light at stake: a lamp far away matters less than one overhead.
#ifndef NPSIM_SAMPLES_LAB_SHADOW_ERRORS_HPP
#define NPSIM_SAMPLES_LAB_SHADOW_ERRORS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "mesh_truth.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/render/direct.hpp"

namespace npsim::tool {

struct ShadowErrorParams {
  int points_across = 80;  // judged points in a row of the image
  float max_distance_m = 60.0F;
  float lamp_clearance_m = 1.0F;  // frames and reliefs around a lamp are finer than pixels
  float relative_bias = 3e-3F;    // where rays start, as a share of the depth: a mesh is not blamed for its roughness
  // A blocker this close to the true depth of its pixel, with like normal, is what the camera sees there.
  float seen_tolerance = 0.005F;
  float seen_cosine = 0.9F;
};

struct ShadowErrors {
  std::size_t pairs = 0;
  std::size_t dark = 0;          // in the true scene
  std::size_t dark_by_seen = 0;  // of those, because of a surface that the camera sees
  std::size_t wrongly_lit = 0;
  std::size_t wrongly_dark = 0;
  std::size_t leaks = 0;  // of dark_by_seen, lit by the mesh
  // Pairs by the illuminance that the point would have without shadows, lx; 0 where the lamps' strength is not known.
  double all_lx = 0;
  double wrongly_lit_lx = 0;
  double wrongly_dark_lx = 0;

  void add(const ShadowErrors& o) {
    pairs += o.pairs;
    dark += o.dark;
    dark_by_seen += o.dark_by_seen;
    wrongly_lit += o.wrongly_lit;
    wrongly_dark += o.wrongly_dark;
    leaks += o.leaks;
    all_lx += o.all_lx;
    wrongly_lit_lx += o.wrongly_lit_lx;
    wrongly_dark_lx += o.wrongly_dark_lx;
  }
};

// A mesh to judge.
struct ShadowCaster {
  TracedMesh traced;
  std::vector<std::uint32_t> lamp_of_face;  // id of the lamp's annotation, 0 for none
  ImageView<const float> depth;             // of the point that each pixel shows, 0 for none
};

namespace shadow_detail {

[[nodiscard]] inline Vec3f pulled_out(const Vec3f& position, const Vec3f& normal, float relative_bias) {
  return position + normal * (relative_bias * std::max(position.z, 10.0F));
}

// From a point towards a lamp; false when there is nothing between the point and what is left out before the lamp.
[[nodiscard]] inline bool ray_to_lamp(const ShadowErrorParams& params, const Vec3f& from, const TrueLamp& lamp,
                                      Ray& ray) {
  ray.origin = from;
  ray.direction = lamp.centre_m - from;
  ray.t_max = 1.0F - (params.lamp_clearance_m + lamp.extent_m) / length(ray.direction);
  return ray.t_max > 0.0F;
}

// Whether the camera sees the true surface that a ray has hit.
[[nodiscard]] inline bool seen(const ShadowErrorParams& params, const Intrinsics& camera, const io::Mesh& mesh,
                               ImageView<const float> depth, ImageView<const Vec3f> normals, const Ray& ray,
                               const Hit& hit) {
  const Vec3f p = ray.origin + ray.direction * hit.t;
  if (!(p.z > 0.0F)) return false;
  const Vec2f at = project(camera, p);
  const auto x = static_cast<int>(std::floor(at.x));
  const auto y = static_cast<int>(std::floor(at.y));
  if (!depth.contains(x, y) || !(std::fabs(depth(x, y) - p.z) <= params.seen_tolerance * p.z)) return false;
  const Face& f = mesh.faces[hit.face];
  const Vec3f a = mesh.vertices[f.a];
  const Vec3f normal = normalized(cross(mesh.vertices[f.b] - a, mesh.vertices[f.c] - a));
  return dot(normal, normals(x, y)) >= params.seen_cosine;
}

}  // namespace shadow_detail

// A pixel counts when all meshes and the truth have a point there.
[[nodiscard]] inline std::vector<ShadowErrors> shadow_errors(const ShadowErrorParams& params, const MeshTruth& truth,
                                                             ImageView<const float> true_depth,
                                                             ImageView<const Vec3f> true_normals,
                                                             const Intrinsics& camera,
                                                             const std::vector<ShadowCaster>& meshes,
                                                             ThreadPool& pool) {
  const int stride = std::max(1, true_depth.width() / std::max(1, params.points_across));
  const auto rows = static_cast<std::size_t>(true_depth.height() / stride);
  std::vector<std::vector<ShadowErrors>> of_row(rows, std::vector<ShadowErrors>(meshes.size()));
  const auto judge_pixel = [&](int x, int y, std::vector<ShadowErrors>& sums) {
    const Vec3f normal = true_normals(x, y);
    bool usable = is_valid_depth(true_depth(x, y)) && normal != Vec3f{};
    for (const ShadowCaster& mesh : meshes) usable = usable && is_valid_depth(mesh.depth(x, y));
    if (!usable) return;
    const Vec3f point = unproject_pixel(camera, x, y, true_depth(x, y));
    const Vec3f origin = shadow_detail::pulled_out(point, normal, params.relative_bias);
    for (const TrueLamp& lamp : truth.lamps) {
      const Vec3f towards = lamp.centre_m - origin;
      if (dot(towards, normal) <= 0.0F || dot(towards, lamp.normal) >= 0.0F) continue;
      if (length(towards) > params.max_distance_m) continue;
      Ray ray;
      if (!shadow_detail::ray_to_lamp(params, origin, lamp, ray)) continue;
      Hit hit;
      const bool dark = closest_hit(truth.traced.tree, ray, hit);
      const bool dark_by_seen =
          dark && shadow_detail::seen(params, camera, truth.mesh, true_depth, true_normals, ray, hit);
      Vec3f to_light;
      const auto lx = static_cast<double>(lamp.peak_cd * illuminance_per_cd(lamp.light, point, normal, to_light));
      for (std::size_t m = 0; m < meshes.size(); ++m) {
        const ShadowCaster& mesh = meshes[m];
        const Vec3f own =
            shadow_detail::pulled_out(unproject_pixel(camera, x, y, mesh.depth(x, y)), normal, params.relative_bias);
        if (!shadow_detail::ray_to_lamp(params, own, lamp, ray)) continue;
        const bool lit =
            !occluded(mesh.traced.tree, ray, [&](std::uint32_t face) { return mesh.lamp_of_face[face] != lamp.mark; });
        ShadowErrors& sum = sums[m];
        ++sum.pairs;
        sum.dark += dark ? 1U : 0U;
        sum.dark_by_seen += dark_by_seen ? 1U : 0U;
        sum.wrongly_lit += dark && lit ? 1U : 0U;
        sum.wrongly_dark += !dark && !lit ? 1U : 0U;
        sum.leaks += dark_by_seen && lit ? 1U : 0U;
        sum.all_lx += lx;
        sum.wrongly_lit_lx += dark && lit ? lx : 0.0;
        sum.wrongly_dark_lx += !dark && !lit ? lx : 0.0;
      }
    }
  };
  pool.for_chunks(rows, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const int y = static_cast<int>(row) * stride + stride / 2;
      for (int x = stride / 2; x < true_depth.width(); x += stride) judge_pixel(x, y, of_row[row]);
    }
  });
  std::vector<ShadowErrors> out(meshes.size());
  for (const std::vector<ShadowErrors>& row : of_row) {
    for (std::size_t m = 0; m < out.size(); ++m) out[m].add(row[m]);
  }
  return out;
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_SHADOW_ERRORS_HPP
