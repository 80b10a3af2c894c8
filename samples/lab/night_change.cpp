// SPDX-License-Identifier: Apache-2.0
#include "night_change.hpp"

#include "kept_night.hpp"
#include "npsim/io/memory.hpp"
#include "tool/engine.hpp"

namespace npsim::tool {

Status night_change(NightParams params, const SceneView& scene, AnyExecutor executor, AnyObserver observer,
                    NightChange& out) {
  params.variants = 1;
  params.mesh.traced = TracedFaces::mesh;
  std::array<KeptNight, 2> nights;
  for (std::size_t i = 0; i < nights.size(); ++i) {
    params.mesh.simplify_faces = i == 1;
    io::HostMemory memory(night_workspace_bytes(params, scene.shape(), scene.lights.size()));
    Workspace workspace = memory.workspace();
    NPSIM_RETURN_IF_ERROR(engine::make_nights(params, scene, workspace, executor, observer, nights[i]));
    out.faces[i] = nights[i].faces;
  }
  out.mean_colour = mean_colour_change(nights[0], nights[1]);
  out.rms_codes = rms_change_codes(nights[0], nights[1]);
  return {};
}

}  // namespace npsim::tool
