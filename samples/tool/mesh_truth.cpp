// SPDX-License-Identifier: Apache-2.0
#include "mesh_truth.hpp"

#include <algorithm>
#include <utility>

#include "npsim/io/obj.hpp"

namespace npsim::tool {

io::Expected<MeshTruth> read_mesh_truth(const io::Scene& scene) {
  MeshTruth truth;
  if (scene.truth.mesh.empty() || scene.truth.emitters.empty()) return truth;
  io::Expected<io::Mesh> mesh = io::read_obj(scene.truth.mesh);
  if (!mesh) return mesh.error();
  truth.mesh = std::move(mesh.value());
  const io::Expected<std::vector<io::TrueEmitter>> emitters = io::read_truth_emitters(scene);
  if (!emitters) return emitters.error();
  if (const Status built = truth.traced.build(truth.mesh.view()); !built.ok()) {
    return io::Error{scene.truth.mesh, "", std::string(built.message()) + ", expected a mesh that can be traced"};
  }
  for (const io::TrueEmitter& e : emitters.value()) {
    if (e.mark == 0) continue;
    truth.lamps.push_back({e.centre_m, e.normal, std::max(e.half_extents_m.x, e.half_extents_m.y), e.mark});
  }
  return truth;
}

}  // namespace npsim::tool
