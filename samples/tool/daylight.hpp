// SPDX-License-Identifier: Apache-2.0
// Files of what was estimated of materials and of the day's light, where the scene gives no albedo.
//
// albedo.png: sRGB, 255 is albedo 1. shadow.png: share of the direct sun, 255 in full sun. Where the mesh wears its
// albedo, albedo.png is that texture.
#ifndef NPSIM_SAMPLES_TOOL_DAYLIGHT_HPP
#define NPSIM_SAMPLES_TOOL_DAYLIGHT_HPP

#include <cstdint>

#include "console.hpp"
#include "figures.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/io/image.hpp"
#include "npsim/material/albedo.hpp"

namespace npsim::tool {

inline constexpr const char* kDaylightFiles[] = {"albedo.png", "shadow.png"};

// Keeps the pictures of the estimate that a run shows.
class DaylightRecorder : public ConsoleObserver {
 public:
  using ConsoleObserver::ConsoleObserver;
  void daylight(const ImageView<const Vec3f>& albedo, const ImageView<const float>& sun, const DaylightReport& report);

  // Null where the scene gives albedo, as the pictures are empty then.
  [[nodiscard]] const OrderedJson& report() const { return report_; }
  [[nodiscard]] ImageView<const Rgb8> albedo() const { return albedo_.view(); }
  [[nodiscard]] ImageView<const std::uint8_t> shadow() const { return shadow_.view(); }

 private:
  OrderedJson report_;
  io::Image<Rgb8> albedo_;
  io::Image<std::uint8_t> shadow_;
};

[[nodiscard]] OrderedJson to_json(const DaylightReport& report);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_DAYLIGHT_HPP
