// SPDX-License-Identifier: Apache-2.0
// Keeps a copy of the depth after each step of the depth refinement, and passes everything on to the console.
#ifndef NPSIM_SAMPLES_LAB_DEPTH_RECORDER_HPP
#define NPSIM_SAMPLES_LAB_DEPTH_RECORDER_HPP

#include <algorithm>
#include <cstddef>
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

class DepthRecorder {
 public:
  explicit DepthRecorder(Console& console) : console_(console) {}
  void begin(Stage stage) { console_.begin(stage); }
  void progress(std::size_t done, std::size_t total) { console_.progress(done, total); }
  void end(Stage stage) { console_.end(stage); }
  void depth(Stage stage, const ImageView<const float>& depth) {
    io::Image<float> copy(depth.shape());
    copy_pixels(depth, copy.view());
    kept_.emplace_back(stage, std::move(copy));
  }
  [[nodiscard]] bool cancelled() const { return console_.cancelled(); }
  [[nodiscard]] const std::vector<std::pair<Stage, io::Image<float>>>& kept() const { return kept_; }

 private:
  Console& console_;
  std::vector<std::pair<Stage, io::Image<float>>> kept_;
};

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_DEPTH_RECORDER_HPP
