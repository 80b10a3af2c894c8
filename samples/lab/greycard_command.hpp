// SPDX-License-Identifier: Apache-2.0
// npsim greycard: what a photographed grey card tells of the light on it, {s, r/g, b/g} as section 3.2 defines them.
//
// s is the luminance of the card as a share of full scale, the ratios are of the means of its linear channels, so noise
// averages out. With the camera's exposure s becomes the illuminance of the card in lx (sensor/exposure.hpp), and with
// the distance of a lamp that alone lights it, and that it faces, the lamp's luminous intensity in cd.
#ifndef NPSIM_SAMPLES_LAB_GREYCARD_COMMAND_HPP
#define NPSIM_SAMPLES_LAB_GREYCARD_COMMAND_HPP

#include <array>
#include <cstddef>
#include <string>

#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/io/error.hpp"

namespace npsim::tool {

struct GreycardOptions {
  std::string image;
  std::string card;     // x0,y0,x1,y1 in pixels, the last ones outside
  bool linear = false;  // the picture's values are linear; a PFM's always are
  float iso = 0;        // with f_number and time_s: of the exposure; 0: unknown
  float f_number = 0;
  float time_s = 0;
  float reflectance = 0.18F;
  float distance_m = 0;  // of the lamp; 0: unknown
};

struct CardMeasure {
  double s = 0;
  double r_g = 0;
  double b_g = 0;
  std::size_t pixels = 0;
};

[[nodiscard]] io::Expected<std::array<int, 4>> parse_card(const std::string& text, Shape image);

// `linear`: 1 is full scale. Refused are cards of fewer than 64 pixels, with clipped ones, or without a colour.
[[nodiscard]] io::Expected<CardMeasure> measure_card(const std::string& file, ImageView<const Vec3f> linear,
                                                     const std::array<int, 4>& card);

[[nodiscard]] int run_greycard(const GreycardOptions& options);  // an exit status

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_GREYCARD_COMMAND_HPP
