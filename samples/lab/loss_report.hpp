// SPDX-License-Identifier: Apache-2.0
// npsim evaluate --losses: what the normal-guided refinement minimises, step by step (figure 4.4 of the thesis), and
// with --weights grid what its weights do (appendix B).
//
// losses.csv has the three terms before their lambdas and the sum with them, before each step and at the end;
// losses.svg draws the weighted terms. The grid is appendix B's: lambda_1 = 1, lambda_2 and lambda_3 from 1e-3 to 1e3
// by decades, in the forms of the preset. The appendix shows pictures; weights.csv has what it describes as figures:
//   moved       mean |z / z before - 1| of the refinement: how far depth deviates from what it was
//   angle_deg   mean angle between the normals of the refined depth and those that guided it
//   gaps        share of the surface pixels at which depth jumps within one label (metrics/geometry_errors.hpp)
//   uncertain   share of the surface pixels that (3.3) marks on the refined depth
// and with a truth AbsRel of depth and mean angle to the true normals, over all surface pixels. weights.svg draws them.
#ifndef NPSIM_SAMPLES_LAB_LOSS_REPORT_HPP
#define NPSIM_SAMPLES_LAB_LOSS_REPORT_HPP

#include <string>
#include <vector>

#include "evaluate_command.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/depth/losses.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "scene_truth.hpp"
#include "tool/console.hpp"
#include "tool/figures.hpp"

namespace npsim::tool {

// One refinement with its losses. The curve is empty where depth is not refined by normals: measured, and none given.
struct LossRun {
  RefineResult result;
  std::vector<LossValues> curve;
  LossWeights lambda;
  double moved = kNone;
  double angle_deg = kNone;
  double gaps = kNone;
  double uncertain = kNone;
  double abs_rel = kNone;
  double normal_deg = kNone;
};

// truth: its depth may be empty.
[[nodiscard]] Status run_losses_once(const RefineDepthParams& params, const SceneView& scene, const Truth& truth,
                                     ThreadPool& pool, Console& console, LossRun& out);

[[nodiscard]] int run_losses(const EvaluateOptions& options);  // an exit status

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_LOSS_REPORT_HPP
