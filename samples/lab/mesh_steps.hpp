// SPDX-License-Identifier: Apache-2.0
// The mesh steps one at a time: what each takes in time and memory, whether the layers are whole, and how far the
// simplified ones are from them.
//
// Memory of a step: the bytes that it writes to, and the most that it borrows meanwhile. Time: of one run; the pages of
// its output are touched before.
#ifndef NPSIM_SAMPLES_LAB_MESH_STEPS_HPP
#define NPSIM_SAMPLES_LAB_MESH_STEPS_HPP

#include <cstddef>
#include <vector>

#include "npsim/core/scene_view.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/mesh/check.hpp"
#include "npsim/pipeline/night.hpp"

namespace npsim::tool {

struct StepCost {
  const char* step = "";
  double seconds = 0;
  std::size_t output_bytes = 0;
  std::size_t workspace_bytes = 0;
};

// Of one layer, or of both together.
struct SimplificationErrors {
  std::size_t faces_before = 0;
  std::size_t faces_after = 0;
  double max_relative_depth = 0;  // anywhere on the surface
  double rms_relative_depth = 0;  // at pixel centres
  double max_px = 0;              // of a vertex that stays, from the centre of its pixel
  double rms_px = 0;
};

struct MeshSteps {
  std::vector<StepCost> costs;
  LayerReport background;
  LayerReport foreground;
  SimplificationErrors simplified_background;
  SimplificationErrors simplified_objects;
};

// As reconstruct() does them, whether or not it is to simplify.
[[nodiscard]] Status measure_mesh_steps(const ReconstructParams& params, const SceneView& scene,
                                        const RefinedDepth& refined, ThreadPool& pool, MeshSteps& out);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_MESH_STEPS_HPP
