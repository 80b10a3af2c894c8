// SPDX-License-Identifier: Apache-2.0
// npsim evaluate --prediction: predicted labels of a folder of pictures against the true ones.
//
// Files are paired by the part of their names that names the picture: without .png and without what Cityscapes and ACDC
// write behind it (kNameEndings), in whatever subfolders they are. The truth is what ends in labelIds.png, else in
// labelTrainIds.png; masks of invalid pixels end in invIds.png. Every prediction must have its truth and every truth
// its prediction: nothing is left out in silence.
#ifndef NPSIM_SAMPLES_LAB_SEGMENTATION_EVALUATION_HPP
#define NPSIM_SAMPLES_LAB_SEGMENTATION_EVALUATION_HPP

#include <array>
#include <string>
#include <vector>

#include "npsim/io/error.hpp"
#include "npsim/metrics/segmentation_errors.hpp"

namespace npsim::tool {

inline constexpr std::size_t kTrainIds = 19;
inline constexpr int kConfidenceThresholds = 19;  // 1/19, 2/19 ... 1: from what a guess has to certainty

inline constexpr std::array<const char*, 12> kNameEndings = {
    "_labelTrainIds", "_labelIds",   "_invIds", "_gtFine",   "_gtCoarse",     "_gt",
    "_pred",          "_prediction", "_conf",   "_rgb_anon", "_rgb_ref_anon", "_leftImg8bit"};

struct SegmentationOptions {
  std::string prediction;  // folders
  std::string labels;
  std::string invalid;         // empty: the labels'
  std::string confidence;      // empty: none
  std::string prediction_ids;  // label or train; empty: as the labels
  std::string output;          // empty: none
};

// One picture; empty: has none.
struct SegmentationFiles {
  std::string name;
  std::string labels;
  std::string prediction;
  std::string invalid;
  std::string confidence;
};

struct SegmentationPairs {
  std::vector<SegmentationFiles> files;  // by name
  bool labels_are_train_ids = false;
};

[[nodiscard]] io::Expected<SegmentationPairs> pair_segmentations(const SegmentationOptions& options);

struct SegmentationEvaluation {
  std::size_t images = 0;
  bool has_invalid = false;
  bool has_confidence = false;
  SegmentationCounts counts{kTrainIds};          // without confidence
  std::vector<SegmentationCounts> by_threshold;  // kConfidenceThresholds, where there is confidence
};

[[nodiscard]] io::Expected<SegmentationEvaluation> evaluate_segmentation(const SegmentationOptions& options);

[[nodiscard]] int run_segmentation(const SegmentationOptions& options);  // an exit status

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_SEGMENTATION_EVALUATION_HPP
