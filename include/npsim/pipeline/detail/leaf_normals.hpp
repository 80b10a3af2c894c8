// SPDX-License-Identifier: Apache-2.0
// Normals of leaves, as lamps find them, where those of plants are guessed: of measured and of estimated depth.
//
// Leaves lie in all directions, whatever the crown is like around them; and not even that is known of a guessed crown:
// planes fitted to it turn to and fro over metres, and a lamp lights what happens to turn to it, like smoke. So each
// pixel of a plant shows a leaf of its own. Of leaves in all directions those that a camera sees have normals n with
// the density (n . v)_+ / pi about the direction v to it, and under light from l, at the angle a from v, they get
//   mean of (n . l)_+ = 2 / (3 pi) (sin a + (pi - a) cos a)
// of the light that comes: Lambert's sphere. The light that may be expected (render/unsure_light.hpp) is that mean.
// Bounces, what meets a plant, and the denoiser go by the fitted normals.
// Invariant: unit length, facing the camera; the same for every night, every lamp and any order of work.
// Cost: two random numbers per pixel of a plant, and its ray_lift(); and since no leaf's shadow can be taken from its
// neighbours', light takes up to a third longer where crowns fill much of a picture. Memory: none.
#ifndef NPSIM_PIPELINE_DETAIL_LEAF_NORMALS_HPP
#define NPSIM_PIPELINE_DETAIL_LEAF_NORMALS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/material/bsdf.hpp"
#include "npsim/pipeline/detail/ray_starts.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/render/unsure_light.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace relight_detail {

// Given normals and exact depth know more.
[[nodiscard]] inline bool has_leaf_normals(const UnsureLightParams& params, const SceneView& scene,
                                           DepthSource source) noexcept {
  if (!(params.reach > 0.0F) || !scene.normals.empty() || source == DepthSource::exact) return false;
  for (int y = 0; y < scene.labels.height(); ++y) {
    for (int x = 0; x < scene.labels.width(); ++x) {
      if (scene.labels(x, y) == label::vegetation) return true;
    }
  }
  return false;
}

// normal and lift_m, of all points: those that pixels of plants show are replaced.
template <class Executor>
void turn_leaves(std::uint64_t key, const RefinedDepth& refined, const SceneMesh& mesh, Span<Vec3f> normal,
                 Span<float> lift_m, Executor& executor) noexcept {
  const Shape shape = mesh.visible_vertex.shape();
  const auto width = static_cast<std::uint32_t>(shape.width);
  const DepthNoise noise = noise_of_mesh(refined);
  for_rows(executor, shape.height, [&](int y) {
    for (int x = 0; x < shape.width; ++x) {
      const std::uint32_t v = mesh.visible_vertex(x, y);
      if (v == kNoVertex || refined.labels(x, y) != label::vegetation) continue;
      const std::uint32_t pixel = static_cast<std::uint32_t>(y) * width + static_cast<std::uint32_t>(x);
      if (mesh.vertex_pixel[v] != pixel) continue;  // borrowed from its neighbour
      RandomStream random(key, RandomPurpose::leaves, 0, 0, pixel, 0);
      const float a = random.uniform();
      const float b = random.uniform();
      normal[v] = sample_cosine(-normalized(mesh.mesh.vertices[v]), a, b);
      lift_m[v] = ray_lift(mesh, noise, refined.ground.up, v, normal[v]);
    }
  });
}

}  // namespace relight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_LEAF_NORMALS_HPP
