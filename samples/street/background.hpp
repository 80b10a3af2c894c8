// SPDX-License-Identifier: Apache-2.0
// What stands behind the foreground of a built street: its depth with every foreground face taken away.
//
// Exact: where no foreground is seen it is the depth of the picture itself; elsewhere rays through the pixel centres
// are cast against a tree of the other faces. Cost: one tree and one ray per foreground pixel.
#ifndef NPSIM_SAMPLES_STREET_BACKGROUND_HPP
#define NPSIM_SAMPLES_STREET_BACKGROUND_HPP

#include <cstddef>
#include <cstdint>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/trace/bvh.hpp"
#include "params.hpp"
#include "render.hpp"
#include "stage.hpp"

namespace npsim {
namespace street {

// Fills background_depth; depth and labels have to be there.
template <class Executor>
[[nodiscard]] Status render_background(const Stage& stage, Street& street, Executor& executor) {
  std::vector<Face> faces;
  faces.reserve(stage.faces.size());
  for (std::size_t i = 0; i < stage.faces.size(); ++i) {
    if (!kForegroundLabels.contains(stage.scene->info[i].label)) faces.push_back(stage.faces[i]);
  }
  std::vector<unsigned char> memory(bvh_workspace_bytes(faces.size()));
  Workspace workspace(memory.data(), memory.size());
  Bvh bvh;
  const TriangleMeshView mesh{stage.mesh().vertices, Span<const Face>(faces.data(), faces.size())};
  NPSIM_RETURN_IF_ERROR(build_bvh(mesh, workspace, bvh));
  const Shape shape = street.params.shape;
  executor.for_chunks(static_cast<std::size_t>(shape.height), kRowsPerChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < shape.width; ++x) {
        street.background_depth(x, y) = street.depth(x, y);
        if (!kForegroundLabels.contains(street.labels(x, y))) continue;
        Ray ray;
        ray.direction = unproject_pixel(street.intrinsics, x, y, 1.0F);
        Hit hit;
        street.background_depth(x, y) = closest_hit(bvh, ray, hit) ? hit.t : 0.0F;
      }
    }
  });
  return {};
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_BACKGROUND_HPP
