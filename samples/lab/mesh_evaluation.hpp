// SPDX-License-Identifier: Apache-2.0
// The scene mesh against the truth: is it whole, is what it hides right, and does it cast the right shadows?
//
// Done twice: for the mesh that the pipeline makes of the refined depth, and for the one it would make of the true
// depth, which shows what the mesh steps alone do wrong. Five stages of each: the connected sheet, the sheet after
// pruning, the completed layers, the layers with the backs of objects, and those simplified. Shadows are judged of these
// and of what rays meet: the layers with backs, without the open steps of the background. Beside that the steps are
// run one at a time (mesh_steps.hpp).
#ifndef NPSIM_SAMPLES_LAB_MESH_EVALUATION_HPP
#define NPSIM_SAMPLES_LAB_MESH_EVALUATION_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "mesh_steps.hpp"
#include "mesh_truth.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/image.hpp"
#include "npsim/light/placement.hpp"
#include "npsim/mesh/check.hpp"
#include "npsim/pipeline/night.hpp"
#include "shadow_errors.hpp"
#include "tool/console.hpp"

namespace npsim::tool {

inline constexpr std::size_t kMeshStages = 5;
inline constexpr std::array<const char*, kMeshStages> kMeshStageNames = {
    "connected sheet", "pruned sheet", "completed layers", "with backs of objects", "simplified"};
inline constexpr std::array<const char*, kMeshStages> kMeshStageKeys = {"sheet", "pruned", "completed", "solid",
                                                                        "simplified"};
// Besides: what the rays of a night meet, which is no mesh to be whole.
inline constexpr const char* kTracedName = "as rays meet it";

// Depth of the completed background on foreground pixels.
struct BackgroundErrors {
  std::size_t pixels = 0;   // foreground with a true background that is not the sky
  std::size_t missing = 0;  // of those, without a vertex
  std::size_t within_3_percent = 0;
  double abs_rel = 0;  // mean over those that have a vertex
};

struct MeshErrors {
  std::string key;  // what it was made of
  std::array<MeshReport, kMeshStages> report;
  MeshReport simplified_background;  // of the last stage's parts
  MeshReport simplified_objects;
  MeshSteps steps;
  std::optional<BackgroundErrors> background;
  std::vector<ShadowErrors> shadows;  // one per stage and of what rays meet, or none without a true mesh
};

// What the mesh is judged by; planes may be empty, and then so is what they are needed for.
struct MeshJudges {
  PlacementParams placement;  // of lamps, as the renderer has them
  ImageView<const float> true_depth;
  ImageView<const Vec3f> true_normals;
  ImageView<const float> background_depth;
  const MeshTruth* mesh = nullptr;
  ShadowErrorParams shadows;
};

// `refined` needs its depth, labels, normals, surface and uncertain planes only.
[[nodiscard]] Status evaluate_mesh(const ReconstructParams& params, const SceneView& scene, const RefinedDepth& refined,
                                   const MeshJudges& judges, ThreadPool& pool, Console& console, MeshErrors& out);

// What the depth steps would leave if they made no error at all.
struct TrueDepthAsRefined {
  io::Image<float> depth;
  io::Image<std::uint8_t> surface;
  io::Image<std::uint8_t> uncertain;
  RefinedDepth refined;

  [[nodiscard]] Status take(const SceneView& scene, const RefinedDepth& like, ImageView<const float> truth,
                            const UncertaintyParams& params, ThreadPool& pool);
};

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_MESH_EVALUATION_HPP
