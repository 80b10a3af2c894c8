// SPDX-License-Identifier: Apache-2.0
// Albedo estimated from the photograph against the true one: that of the scene, or of its truth where it gives none.
//
// Errors are |log2(estimate / truth)| of luminance after one common factor for the picture, their median, because no
// photograph knows it; what is darker than kDarkest counts as kDarkest in both.
// Whether the day's shadow is left on the road: the median ratio of estimate to truth on sunlit asphalt over that on
// shadowed asphalt. Sun and shadow are told apart by the light, photograph over true albedo, which has two modes
// there: the threshold stands in their middle. Where the modes are not kTwoModes apart, or one side holds less than
// kFewest of the asphalt, there is none.
#ifndef NPSIM_SAMPLES_LAB_ALBEDO_EVALUATION_HPP
#define NPSIM_SAMPLES_LAB_ALBEDO_EVALUATION_HPP

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "npsim/core/scene_view.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/material/albedo.hpp"
#include "npsim/pipeline/relight.hpp"
#include "tool/figures.hpp"

namespace npsim::tool {

struct AlbedoGroupErrors {
  std::string name;
  std::size_t pixels = 0;
  double mean_log2 = kNone;
  double bias_log2 = kNone;  // mean of log2(estimate / truth): brighter than the truth
};

struct CarAlbedo {
  std::uint16_t instance = 0;
  double truth = 0.0;
  double estimate = 0.0;
};

struct AlbedoErrors {
  double common_log2 = kNone;  // the factor, estimate over truth
  std::vector<AlbedoGroupErrors> groups;
  double sunlit_over_shadowed = kNone;
  double light_ratio = kNone;   // of the photograph's two modes
  double sunlit_share = kNone;  // of the asphalt
  DaylightReport report;
  std::vector<CarAlbedo> cars;  // those of more than 1/1300 of the picture
};

// true_albedo: linear, of the scene's shape.
[[nodiscard]] Status albedo_errors(const AlbedoParams& params, const SceneView& scene,
                                   ImageView<const Vec3f> true_albedo, const RefinedDepth& refined, ThreadPool& pool,
                                   AlbedoErrors& out);

[[nodiscard]] OrderedJson to_json(const AlbedoErrors& errors);
void print_table(const AlbedoErrors& errors);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_ALBEDO_EVALUATION_HPP
