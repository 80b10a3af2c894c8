// SPDX-License-Identifier: Apache-2.0
// Depth judged apart where the input has none and where it has some, and normals by group of labels.
//
// Missing pixels show a surface by truth and label, and the input has no depth there: nearest neighbour and linear
// interpolation of 1/z of the input's samples (simple_fill.hpp) are the yardsticks. Given pixels have depth in the
// input, which is the yardstick itself. Both count only where every step has depth; how many that leaves out is said.
// Normals are judged wherever a surface has a true one, given or missing alike; and apart where it is smooth at the
// picture's resolution, that is where the normals of the true depth are within kSmooth_deg of the true ones.
#ifndef NPSIM_SAMPLES_LAB_COVERAGE_ERRORS_HPP
#define NPSIM_SAMPLES_LAB_COVERAGE_ERRORS_HPP

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "depth_shift.hpp"
#include "label_groups.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/image.hpp"
#include "npsim/metrics/geometry_errors.hpp"
#include "scene_truth.hpp"
#include "tool/figures.hpp"

namespace npsim::tool {

inline constexpr float kSmooth_deg = 5.0F;

struct CoverageRow {
  std::string name;  // in the table
  std::string key;   // in JSON
  std::array<DepthShift, kLabelGroups.size()> missing;
  std::array<DepthShift, kLabelGroups.size()> given;
};

struct GroupNormals {
  std::string name;
  std::string key;
  std::array<std::optional<NormalErrors>, kLabelGroups.size()> all;
  std::array<std::optional<NormalErrors>, kLabelGroups.size()> smooth;
};

struct CoverageErrors {
  DepthSource source = DepthSource::unknown;
  std::size_t missing_pixels = 0;  // all of them, judged or not
  std::size_t given_pixels = 0;
  std::vector<CoverageRow> rows;      // as given, nearest, linear, then each step
  std::vector<GroupNormals> normals;  // as given, those that light falls on, of the refined and of the true depth
};

// steps: what each step of the refinement left, in order.
[[nodiscard]] CoverageErrors coverage_errors(const SceneView& scene, const Truth& truth, const RefinedDepth& refined,
                                             const std::vector<std::pair<Stage, io::Image<float>>>& steps,
                                             ThreadPool& pool);

// What the rows are measured by: of missing pixels the linear interpolation, of given ones the input.
[[nodiscard]] double missing_over_linear(const CoverageErrors& errors, const CoverageRow& row, std::size_t group);
[[nodiscard]] double given_over_input(const CoverageErrors& errors, const CoverageRow& row, std::size_t group);

[[nodiscard]] OrderedJson to_json(const CoverageErrors& errors);
void print_table(const CoverageErrors& errors);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_COVERAGE_ERRORS_HPP
