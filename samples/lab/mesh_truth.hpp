// SPDX-License-Identifier: Apache-2.0
// The true scene as geometry: its mesh behind a ray tracer, and where its lamps are.
//
// Only a generated scene has it: scene.json names truth.mesh (OBJ) and truth.emitters (JSON). Camera frame, metres.
#ifndef NPSIM_SAMPLES_LAB_MESH_TRUTH_HPP
#define NPSIM_SAMPLES_LAB_MESH_TRUTH_HPP

#include <cstddef>
#include <cstdint>
#include <vector>

#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/io/mesh.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/trace/bvh.hpp"

namespace npsim::tool {

// A lamp as a shadow ray sees it. Only marked ones count: no reconstruction knows of those that the picture hides.
struct TrueLamp {
  Vec3f centre_m;
  Vec3f normal;            // unit; light leaves on this side
  float extent_m = 0;      // the larger half side
  std::uint32_t mark = 0;  // id of its annotation
  Emitter light;           // the same as the renderer takes it,
  float peak_cd = 0;       // with the most that its class may be lit with; 0 where the scene does not tell
};

// A mesh with its tree. Moving keeps the tree valid: its bytes stay where they are.
struct TracedMesh {
  std::vector<unsigned char> memory;
  Bvh tree;

  [[nodiscard]] Status build(const TriangleMeshView& mesh) {
    memory.resize(bvh_workspace_bytes(mesh.faces.size()));
    Workspace workspace(memory.data(), memory.size());
    return build_bvh(mesh, workspace, tree);
  }
};

struct MeshTruth {
  io::Mesh mesh;
  TracedMesh traced;
  std::vector<TrueLamp> lamps;

  [[nodiscard]] bool known() const { return !traced.tree.nodes.empty(); }
};

// emitters: the scene's. A scene that names no true mesh or no emitters gives an empty truth, which is not an error.
[[nodiscard]] io::Expected<MeshTruth> read_mesh_truth(const io::Scene& scene,
                                                      const std::vector<io::TrueEmitter>& emitters);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_MESH_TRUTH_HPP
