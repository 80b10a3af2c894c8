// SPDX-License-Identifier: Apache-2.0
// A night kept to be compared with another: its picture, and the mean of its light.
#ifndef NPSIM_SAMPLES_LAB_KEPT_NIGHT_HPP
#define NPSIM_SAMPLES_LAB_KEPT_NIGHT_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "npsim/io/image.hpp"
#include "npsim/pipeline/night.hpp"

namespace npsim::tool {

// Sums of the channels over a linear picture.
[[nodiscard]] inline std::array<double, 3> colour_sums(ImageView<const Vec3f> picture) {
  std::array<double, 3> sums{};
  for (int y = 0; y < picture.height(); ++y) {
    for (int x = 0; x < picture.width(); ++x) {
      const Vec3f c = picture(x, y);
      sums[0] += static_cast<double>(c.x);
      sums[1] += static_cast<double>(c.y);
      sums[2] += static_cast<double>(c.z);
    }
  }
  return sums;
}

// A sink of make_nights(), for one variant.
struct KeptNight {
  std::size_t faces = 0;  // of the scene mesh
  std::array<double, 3> colour{};
  io::Image<Rgb8> picture;

  Status reconstructed(const RefinedDepth&, const SceneMesh& mesh, const Relighting&) {
    faces = mesh.mesh.faces.size();
    return {};
  }
  Status night(const Night& night) {
    picture = io::Image<Rgb8>(night.picture.shape());
    copy_pixels(night.picture, picture.view());
    colour = colour_sums(night.luminance);
    return {};
  }
};

// Relative change of the mean linear colour, in the channel that changes most; a channel without light does not count.
[[nodiscard]] inline double mean_colour_change(const KeptNight& from, const KeptNight& to) {
  double change = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    if (from.colour[c] > 0) change = std::max(change, std::fabs(to.colour[c] / from.colour[c] - 1.0));
  }
  return change;
}

// Root mean square over the pictures as shown, in codes of 255; both of one size.
[[nodiscard]] inline double rms_change_codes(const KeptNight& from, const KeptNight& to) {
  double sum = 0;
  const Shape shape = from.picture.shape();
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const Rgb8 a = from.picture(x, y);
      const Rgb8 b = to.picture(x, y);
      for (const int off : {a.r - b.r, a.g - b.g, a.b - b.b}) sum += static_cast<double>(off) * off;
    }
  }
  return std::sqrt(sum / (3.0 * static_cast<double>(shape.pixels())));
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_KEPT_NIGHT_HPP
