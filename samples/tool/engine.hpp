// SPDX-License-Identifier: Apache-2.0
// The pipeline compiled once: its steps as plain functions, for the tool, the tests and the benchmarks.
//
// They do what the templates of the same names in npsim/pipeline/ do. In namespace npsim::engine, and to be called by
// that name: a call without it may find the template and compile the whole pipeline once more.
#ifndef NPSIM_SAMPLES_TOOL_ENGINE_HPP
#define NPSIM_SAMPLES_TOOL_ENGINE_HPP

#include <memory>
#include <type_traits>

#include "any.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/material/albedo.hpp"
#include "npsim/pipeline/night.hpp"
#include "npsim/pipeline/photograph.hpp"

namespace npsim::engine {

// Any sink of make_nights().
class AnySink {
 public:
  template <class Sink, class = std::enable_if_t<!std::is_same_v<std::remove_const_t<Sink>, AnySink>>>
  AnySink(Sink& sink)  // NOLINT(google-explicit-constructor)
      : sink_(const_cast<void*>(static_cast<const void*>(std::addressof(sink)))),
        reconstructed_(
            [](void* s, const RefinedDepth& refined, const SceneMesh& mesh, const Relighting& light) -> Status {
              return static_cast<Sink*>(s)->reconstructed(refined, mesh, light);
            }),
        night_([](void* s, const Night& night) -> Status { return static_cast<Sink*>(s)->night(night); }) {}

  Status reconstructed(const RefinedDepth& refined, const SceneMesh& mesh, const Relighting& light) const {
    return reconstructed_(sink_, refined, mesh, light);
  }
  Status night(const Night& night) const { return night_(sink_, night); }

 private:
  void* sink_;
  Status (*reconstructed_)(void* sink, const RefinedDepth& refined, const SceneMesh& mesh, const Relighting& light);
  Status (*night_)(void* sink, const Night& night);
};

[[nodiscard]] Status refine_depth(const RefineDepthParams& params, const SceneView& scene, Workspace& workspace,
                                  AnyExecutor executor, AnyObserver observer, RefinedDepth& out);

[[nodiscard]] Status reconstruct(const ReconstructParams& params, const SceneView& scene, const RefinedDepth& refined,
                                 Workspace& workspace, AnyExecutor executor, AnyObserver observer, SceneMesh& out);

[[nodiscard]] Status make_nights(const NightParams& params, const SceneView& scene, Workspace& workspace,
                                 AnyExecutor executor, AnyObserver observer, AnySink sink);

// io::make_large_nights().
[[nodiscard]] Status make_large_nights(const NightParams& params, const SceneView& photograph, const SceneView& work,
                                       Workspace& workspace, AnyExecutor executor, AnyObserver observer, AnySink sink);

[[nodiscard]] Status make_nights_of_depth(const NightParams& params, const SceneView& scene,
                                          const RefinedDepth& refined, Workspace& workspace, AnyExecutor executor,
                                          AnyObserver observer, AnySink sink);

[[nodiscard]] Status estimate_albedo(const AlbedoParams& params, const AlbedoScene& scene, Workspace& workspace,
                                     const AlbedoEstimate& out, DaylightReport& report, AnyExecutor executor);

// Of what make_nights() hands out.
[[nodiscard]] Status picture_masks(const SignalMaskParams& params, const PhotographParams& camera,
                                   const Intrinsics& intrinsics, const Night& night, const SignalMasks& out,
                                   Workspace& workspace, AnyExecutor executor);

}  // namespace npsim::engine

// What make_nights() is made of: only the unit that defines it compiles its code.
extern template npsim::Status npsim::refine_depth(const npsim::RefineDepthParams&, const npsim::SceneView&,
                                                  npsim::Workspace&, npsim::AnyExecutor&, npsim::AnyObserver&,
                                                  npsim::RefinedDepth&);
extern template npsim::Status npsim::build_layers(const npsim::ReconstructParams&, const npsim::SceneView&,
                                                  const npsim::RefinedDepth&, npsim::Workspace&, npsim::AnyExecutor&,
                                                  npsim::AnyObserver&, npsim::SceneLayers&);
extern template npsim::Status npsim::build_mesh(const npsim::ReconstructParams&, const npsim::SceneView&,
                                                const npsim::RefinedDepth&, const npsim::SceneLayers&,
                                                npsim::Workspace&, npsim::AnyExecutor&, npsim::AnyObserver&,
                                                npsim::SceneMesh&);
extern template npsim::Status npsim::estimate_albedo(const npsim::AlbedoParams&, const npsim::AlbedoScene&,
                                                     npsim::Workspace&, const npsim::AlbedoEstimate&,
                                                     npsim::DaylightReport&, npsim::AnyExecutor&);

#endif  // NPSIM_SAMPLES_TOOL_ENGINE_HPP
