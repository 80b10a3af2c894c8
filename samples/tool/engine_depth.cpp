// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/refine_depth.hpp"

#include "tool/engine.hpp"

template npsim::Status npsim::refine_depth(const npsim::RefineDepthParams&, const npsim::SceneView&, npsim::Workspace&,
                                           npsim::AnyExecutor&, npsim::AnyObserver&, npsim::RefinedDepth&);

namespace npsim::engine {

Status refine_depth(const RefineDepthParams& params, const SceneView& scene, Workspace& workspace, AnyExecutor executor,
                    AnyObserver observer, RefinedDepth& out) {
  return npsim::refine_depth(params, scene, workspace, executor, observer, out);
}

}  // namespace npsim::engine
