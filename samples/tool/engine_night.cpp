// SPDX-License-Identifier: Apache-2.0
#include "npsim/pipeline/night.hpp"

#include "npsim/io/large_night.hpp"
#include "npsim/pipeline/photograph.hpp"
#include "tool/engine.hpp"

template npsim::Status npsim::estimate_albedo(const npsim::AlbedoParams&, const npsim::AlbedoScene&, npsim::Workspace&,
                                              const npsim::AlbedoEstimate&, npsim::DaylightReport&,
                                              npsim::AnyExecutor&);

namespace npsim::engine {

Status make_nights(const NightParams& params, const SceneView& scene, Workspace& workspace, AnyExecutor executor,
                   AnyObserver observer, AnySink sink) {
  return npsim::make_nights(params, scene, workspace, executor, observer, sink);
}

Status make_large_nights(const NightParams& params, const SceneView& photograph, const SceneView& work,
                         Workspace& workspace, AnyExecutor executor, AnyObserver observer, AnySink sink) {
  return io::make_large_nights(params, photograph, work, workspace, executor, observer, sink);
}

Status make_nights_of_depth(const NightParams& params, const SceneView& scene, const RefinedDepth& refined,
                            Workspace& workspace, AnyExecutor executor, AnyObserver observer, AnySink sink) {
  return npsim::make_nights_of_depth(params, scene, refined, workspace, executor, observer, sink);
}

Status estimate_albedo(const AlbedoParams& params, const AlbedoScene& scene, Workspace& workspace,
                       const AlbedoEstimate& out, DaylightReport& report, AnyExecutor executor) {
  return npsim::estimate_albedo(params, scene, workspace, out, report, executor);
}

Status picture_masks(const SignalMaskParams& params, const PhotographParams& camera, const Intrinsics& intrinsics,
                     const Night& night, const SignalMasks& out, Workspace& workspace, AnyExecutor executor) {
  return npsim::picture_masks(params, camera, intrinsics, night.key, static_cast<std::uint32_t>(night.variant),
                              night.exposure, night.luminance, out, workspace, executor, night.street);
}

}  // namespace npsim::engine
