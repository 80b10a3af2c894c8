// SPDX-License-Identifier: Apache-2.0
// The nights of one scene against its true night: the whole chain, and what each stage is worth by replacing it with the
// truth, one at a time and cumulatively.
//
// Judged are the pixels of surfaces that are no lamp: luminance where the truth is above .005 cd/m2, over all of them
// and label by label; and the displayed pictures, all pixels, without sensor noise and at the exposure that the camera
// would have chosen for the true night, so that a night which is too dark looks too dark.
#ifndef NPSIM_SAMPLES_LAB_NIGHT_STAGES_HPP
#define NPSIM_SAMPLES_LAB_NIGHT_STAGES_HPP

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/image.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/metrics/luminance_errors.hpp"
#include "npsim/metrics/picture_errors.hpp"
#include "npsim/pipeline/night.hpp"
#include "scene_truth.hpp"
#include "tool/console.hpp"
#include "tool/figures.hpp"

namespace npsim::tool {

inline constexpr std::array<Label, 5> kJudgedLabels = {label::road, label::sidewalk, label::building, label::vegetation,
                                                       label::car};

struct NightErrors {
  std::string name;
  std::optional<LuminanceErrors> all;  // empty where nothing is bright enough
  std::array<std::optional<LuminanceErrors>, kJudgedLabels.size()> by_label;
  PictureErrors picture;
  double flip = 0;
};

// Pictures to look at, of the true night and of one of ours.
struct NightPictures {
  io::Image<Rgb8> truth, own;
  io::Image<Rgb8> signed_error;  // blue: too dark, red: too bright, full colour at 3 stops; grey: not judged
};

// params.seed: that of the draw of lamps that the true night shows. transport_samples: paths a pixel of the reference on
// the renderer's own mesh, by which transport is judged alone; 0: it is not. shop_fronts: by mark, in that
// draw.
[[nodiscard]] Status night_stages(const NightParams& params, const SceneView& scene, const Truth& truth,
                                  const TrueNight& night, std::uint64_t transport_samples, ThreadPool& pool,
                                  Console& console, std::vector<NightErrors>& out, NightPictures& pictures,
                                  std::vector<std::uint8_t>& shop_fronts);

// Names of the rows that are the whole chain, with given and with estimated materials.
inline constexpr const char* kWholeChain = "+ refined depth";
inline constexpr const char* kWholeChainEstimated = "+ estimated materials";

// The same street with another depth: three rows behind those that are there. The whole chain, the whole chain with
// estimated materials, and its depth with the true lamps, which tells depth and lamps apart. shop_fronts: as drawn.
[[nodiscard]] std::array<std::string, 3> source_rows(const std::string& name);
[[nodiscard]] Status night_of_source(const NightParams& params, const SceneView& scene, const Truth& truth,
                                     const TrueNight& night, const std::vector<std::uint8_t>& shop_fronts,
                                     const std::string& name, ThreadPool& pool, Console& console,
                                     std::vector<NightErrors>& out);

// Median error of the nights of each source over that with a network's depth, with given and with estimated materials,
// and of estimated over given materials. The rows hold all of them. The first ratios are the network's own.
struct SourceRatios {
  std::string name;
  double given = kNone;
  double estimated = kNone;
  double estimated_over_given = kNone;
};
[[nodiscard]] std::vector<SourceRatios> source_ratios(const std::vector<NightErrors>& rows,
                                                      const std::vector<std::string>& sources);
[[nodiscard]] OrderedJson to_json(const std::vector<SourceRatios>& ratios);
void print_table(const std::vector<SourceRatios>& ratios);

// Means over scenes, row by row. Errors of luminance are weighted by the pixels that they are of: the median of a label
// that a scene shows in a few pixels says little.
[[nodiscard]] std::vector<NightErrors> mean_of(const std::vector<std::vector<NightErrors>>& scenes);

[[nodiscard]] OrderedJson to_json(const std::vector<NightErrors>& rows);
void print_table(const std::vector<NightErrors>& rows);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_NIGHT_STAGES_HPP
