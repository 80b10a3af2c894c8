// SPDX-License-Identifier: Apache-2.0
// Keeps a copy of the depth after each step of the depth refinement, and passes everything on to the console.
#ifndef NPSIM_SAMPLES_LAB_DEPTH_RECORDER_HPP
#define NPSIM_SAMPLES_LAB_DEPTH_RECORDER_HPP

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "npsim/core/observe.hpp"
#include "npsim/io/image.hpp"
#include "tool/console.hpp"

namespace npsim::tool {

// "normal-guided refinement" is the key normal_guided_refinement.
[[nodiscard]] inline std::string stage_key(Stage stage) {
  std::string key = stage_name(stage);
  std::replace_if(
      key.begin(), key.end(), [](char c) { return c == ' ' || c == '-'; }, '_');
  return key;
}

class DepthRecorder : public ConsoleObserver {
 public:
  using ConsoleObserver::ConsoleObserver;
  void depth(Stage stage, const ImageView<const float>& depth) {
    io::Image<float> copy(depth.shape());
    copy_pixels(depth, copy.view());
    kept_.emplace_back(stage, std::move(copy));
  }
  [[nodiscard]] const std::vector<std::pair<Stage, io::Image<float>>>& kept() const { return kept_; }

 private:
  std::vector<std::pair<Stage, io::Image<float>>> kept_;
};

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_DEPTH_RECORDER_HPP
