// SPDX-License-Identifier: Apache-2.0
#include "npsim/pipeline/reconstruct.hpp"

#include "tool/engine.hpp"

template npsim::Status npsim::build_layers(const npsim::ReconstructParams&, const npsim::SceneView&,
                                           const npsim::RefinedDepth&, npsim::Workspace&, npsim::AnyExecutor&,
                                           npsim::AnyObserver&, npsim::SceneLayers&);
template npsim::Status npsim::build_mesh(const npsim::ReconstructParams&, const npsim::SceneView&,
                                         const npsim::RefinedDepth&, const npsim::SceneLayers&, npsim::Workspace&,
                                         npsim::AnyExecutor&, npsim::AnyObserver&, npsim::SceneMesh&);

namespace npsim::engine {

Status reconstruct(const ReconstructParams& params, const SceneView& scene, const RefinedDepth& refined,
                   Workspace& workspace, AnyExecutor executor, AnyObserver observer, SceneMesh& out) {
  return npsim::reconstruct(params, scene, refined, workspace, executor, observer, out);
}

}  // namespace npsim::engine
