// SPDX-License-Identifier: Apache-2.0
#include "mesh_truth.hpp"

#include <algorithm>
#include <map>
#include <utility>

#include "npsim/io/obj.hpp"
#include "npsim/light/activation.hpp"
#include "true_lamps.hpp"

namespace npsim::tool {

io::Expected<MeshTruth> read_mesh_truth(const io::Scene& scene, const std::vector<io::TrueEmitter>& emitters) {
  MeshTruth truth;
  if (scene.truth.mesh.empty() || scene.truth.emitters.empty()) return truth;
  io::Expected<io::Mesh> mesh = io::read_obj(scene.truth.mesh);
  if (!mesh) return mesh.error();
  truth.mesh = std::move(mesh.value());
  if (const Status built = truth.traced.build(truth.mesh.view()); !built.ok()) {
    return io::Error{scene.truth.mesh, "", std::string(built.message()) + ", expected a mesh that can be traced"};
  }
  std::map<std::uint32_t, Emitter> lights;
  if (scene.truth.ground) {
    const io::Expected<TrueLamps> known = read_true_lamps(scene);
    if (!known) return known.error();
    for (const Emitter& e : known.value().emitters) {
      if (e.mark != 0) lights[scene.lights[e.mark - 1U].id] = e;
    }
  }
  for (const io::TrueEmitter& e : emitters) {
    if (e.mark == 0) continue;
    TrueLamp lamp;
    lamp.centre_m = e.centre_m;
    lamp.normal = e.normal;
    lamp.extent_m = std::max(e.half_extents_m.x, e.half_extents_m.y);
    lamp.mark = e.mark;
    if (const auto light = lights.find(e.mark); light != lights.end()) {
      lamp.light = light->second;
      lamp.peak_cd = strongest_intensity_cd(ActivationParams{}, lamp.light);
    }
    truth.lamps.push_back(lamp);
  }
  return truth;
}

}  // namespace npsim::tool
