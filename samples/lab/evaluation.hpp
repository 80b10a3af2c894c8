// SPDX-License-Identifier: Apache-2.0
// Depth, its edges and its normals against the truth, as given and after each step of the depth refinement.
//
// All steps are judged on the same pixels: those with a true depth that are not labelled as sky (or as the own car) and
// on which every step has a depth. Elsewhere depth counts as missing before edges are looked for and normals are taken,
// so that no step is judged by another one's neighbours. Normals of depth are the perspective ones.
#ifndef NPSIM_SAMPLES_LAB_EVALUATION_HPP
#define NPSIM_SAMPLES_LAB_EVALUATION_HPP

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "albedo_evaluation.hpp"
#include "coverage_errors.hpp"
#include "lamp_evaluation.hpp"
#include "mesh_evaluation.hpp"
#include "night_change.hpp"
#include "night_stages.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/image.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/metrics/geometry_errors.hpp"
#include "npsim/pipeline/night.hpp"
#include "scene_truth.hpp"
#include "tool/console.hpp"

namespace npsim::tool {

// Errors that could not be taken, for want of a pixel, an edge or a true normal, are left empty.
struct NormalRow {
  std::optional<NormalErrors> all;
  std::optional<NormalErrors> smooth;  // where the normals of the true depth are within kSmooth_deg of the true ones
};

struct StepErrors {
  std::string name;  // in the table
  std::string key;   // in JSON
  std::optional<DepthErrors> depth;
  std::optional<DepthErrors> near_edges;
  std::optional<EdgeErrors> edges;
  NormalRow normals;
};

struct LabelErrors {
  Label label = 0;
  std::vector<std::optional<DepthErrors>> depth;  // in the order of Evaluation::steps
  std::vector<std::optional<NormalErrors>> normals;
};

struct Evaluation {
  DepthEdgeParams edge_params;
  EdgeErrorParams distance_params;
  int near_edges_px = 3;
  std::size_t surface_pixels = 0;  // with a true depth, not sky
  std::size_t pixels = 0;          // of those, the ones with a depth after every step
  std::vector<StepErrors> steps;   // as given, then after each step
  std::vector<LabelErrors> labels;
  // Other normals on the same pixels: of the scene, those that guided the refinement, and those of the true depth,
  // which no depth map can better.
  NormalRow given_normals;
  NormalRow guiding_normals;
  NormalRow true_depth_normals;
  CoverageErrors coverage;                    // missing and given pixels apart
  MaskOverlap uncertain_on_edges;             // first: true edges, second: the uncertain map
  MaskOverlap uncertain_on_foreground_edges;  // the same for edges of vehicles, persons, poles and signs
  MaskOverlap uncertain_near_edges;           // first: within a window of a true edge
  std::vector<MeshErrors> meshes;             // of the refined depth, of the true depth
  std::vector<LampErrors> lamps;              // the same, where the truth has any
  std::optional<AlbedoErrors> albedo;         // where the scene or its truth has one to judge by
  std::vector<NightErrors> stages;            // of nights against the true one, when asked for
  std::optional<NightChange> night;           // when asked for
};

// Runs the depth steps on the scene and judges what each of them leaves. mesh_params: null: the depth alone is judged.
[[nodiscard]] Status evaluate(const SceneView& scene, const Truth& truth, const RefineDepthParams& params,
                              const ReconstructParams* mesh_params, ThreadPool& pool, Console& console,
                              Evaluation& out);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_EVALUATION_HPP
