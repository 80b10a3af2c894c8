// SPDX-License-Identifier: Apache-2.0
// How flat facades came out, which needs no truth: walls are flat, so normals a little apart should agree.
#ifndef NPSIM_SAMPLES_LAB_FLATNESS_HPP
#define NPSIM_SAMPLES_LAB_FLATNESS_HPP

#include <cstddef>

#include "npsim/core/image_view.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim::tool {

struct EvaluateOptions;

struct FlatnessParams {
  Label label = label::building;
  int distance_px = 16;  // of an image 2048 wide
  float angle_deg = 2.0F;
};

struct Flatness {
  std::size_t pairs = 0;     // along rows and columns, both of the label and with a normal
  std::size_t agreeing = 0;  // of those, within the angle

  [[nodiscard]] double share() const {
    return pairs > 0 ? static_cast<double>(agreeing) / static_cast<double>(pairs) : 0.0;
  }
};

// normals: unit, zero where there is none. labels may be empty: all is one class.
[[nodiscard]] Flatness flatness(const FlatnessParams& params, ImageView<const Vec3f> normals,
                                ImageView<const Label> labels);

// `npsim evaluate --flatness`: refines the depth and prints the flatness of facades and the planes that were found.
[[nodiscard]] int run_flatness(const EvaluateOptions& options);  // an exit status

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_FLATNESS_HPP
