// SPDX-License-Identifier: Apache-2.0
// White balance of a raw picture: which light the camera takes for white.
//
//   automatic  the mean of the 2x2 quads of which no sample is saturated (grey world) is taken for a grey under a
//              glowing body, the nearest of the Planckian locus within the limits; the camera adapts to a share of it,
//              in reciprocal temperature from daylight at 6500 K
//   fixed      to a stated temperature
// Cameras limit the range: makers' manuals give 3500 to 8000 K or 3000 to 7000 K for automatic white balance. So LED of
// 4000 K comes out nearly white and sodium, 2000 K, stays orange.
// Gains are such that the least is 1: what saturates every filter is white.
// Cost: a pass over the plane. Error of the search: 2 per mega-kelvin (mired).
#ifndef NPSIM_SENSOR_WHITE_BALANCE_HPP
#define NPSIM_SENSOR_WHITE_BALANCE_HPP

#include <cmath>
#include <cstddef>

#include "npsim/color/chromaticity.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/sensor/detail/signal.hpp"
#include "npsim/sensor/raw.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct WhiteBalanceParams {
  float coolest_k = 8000.0F;
  float warmest_k = 3500.0F;
  float adaptation = 0.9F;  // 0: to daylight; 1: the found light becomes white
  float fixed_k = 0.0F;     // 0: automatic
};

[[nodiscard]] inline Status validate(const WhiteBalanceParams& p) noexcept {
  const auto temperature = [](float k) noexcept { return k >= 1700.0F && k <= 25000.0F; };
  const bool good = temperature(p.coolest_k) && temperature(p.warmest_k) && p.warmest_k <= p.coolest_k &&
                    p.adaptation >= 0.0F && p.adaptation <= 1.0F && (p.fixed_k == 0.0F || temperature(p.fixed_k));
  return good ? Status()
              : Status(
                    StatusCode::invalid_argument,
                    "white balance: temperatures in [1700, 25000] K, the warmest not above the coolest, adaptation in "
                    "[0, 1]");
}

namespace white_balance_detail {

// Raw signal of a glowing body, with green 1. mired: 1e6 / K.
[[nodiscard]] inline Vec3d raw_of_body(const SensorParams& sensor, double mired) noexcept {
  const Chromaticity xy = cct_to_xy(static_cast<float>(1e6 / mired), Locus::planckian).value();
  const auto x = static_cast<double>(xy.x);
  const auto y = static_cast<double>(xy.y);
  const Vec3d rgb = xyz_to_linear_srgb({x / y, 1.0, (1.0 - x - y) / y});
  const auto channel = [&](int c) {
    const double v = dot(vec_cast<double>(sensor.response[c]), rgb);
    return v > 1e-3 ? v : 1e-3;
  };
  const double green = channel(1);
  return {channel(0) / green, 1.0, channel(2) / green};
}

[[nodiscard]] inline Vec3f gains_for(const Vec3d& raw) noexcept {
  const double most = raw.x > raw.y ? (raw.x > raw.z ? raw.x : raw.z) : (raw.y > raw.z ? raw.y : raw.z);
  return vec_cast<float>(Vec3d{most / raw.x, most / raw.y, most / raw.z});
}

}  // namespace white_balance_detail

[[nodiscard]] constexpr std::size_t white_balance_workspace_bytes(Shape shape) noexcept {
  const std::size_t rows = shape.empty() ? 0 : static_cast<std::size_t>(shape.height);
  return allocation_bytes<Vec3d>(chunk_count(rows, kSensorRowChunk)) + kWorkspaceAlignment;
}

// plane: as capture() makes it. Gains of a black picture are those of daylight.
template <class Executor>
[[nodiscard]] Status white_balance(const WhiteBalanceParams& params, const SensorParams& sensor,
                                   ImageView<const float> plane, Vec3f& gains, Workspace& workspace,
                                   Executor& executor) {
  using namespace white_balance_detail;
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(sensor));
  constexpr double kDaylight = 1e6 / 6500.0;
  if (params.fixed_k != 0.0F) {
    gains = gains_for(raw_of_body(sensor, 1e6 / static_cast<double>(params.fixed_k)));
    return {};
  }
  if (plane.empty() || plane.width() <= 2 * kMosaicMargin) {
    return {StatusCode::no_valid_input, "white balance: needs a raw picture with its margins"};
  }
  const WorkspaceScope scope(workspace);
  const auto rows = static_cast<std::size_t>(plane.height());
  Span<Vec3d> partial;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(chunk_count(rows, kSensorRowChunk), partial));
  const int width = plane.width() - 2 * kMosaicMargin;
  const float clip = 0.95F * raw_range(sensor);
  executor.for_chunks(rows, kSensorRowChunk, [&](std::size_t begin, std::size_t end) {
    // By place in the quad; which filter stands there is the same for all.
    double sum[4] = {};
    for (std::size_t y = begin; y + 1 < end; y += 2) {  // chunks begin at even rows
      const float* row = plane.row(static_cast<int>(y)) + kMosaicMargin;
      const float* next = plane.row(static_cast<int>(y) + 1) + kMosaicMargin;
      for (int x = 0; x + 1 < width; x += 2) {
        const float quad[4] = {row[x], row[x + 1], next[x], next[x + 1]};
        if (quad[0] < clip && quad[1] < clip && quad[2] < clip && quad[3] < clip) {
          for (int i = 0; i < 4; ++i) sum[i] += static_cast<double>(quad[i]);
        }
      }
    }
    double channel[3] = {};
    for (int i = 0; i < 4; ++i) channel[filter_at(sensor.mosaic, i % 2, i / 2)] += sum[i];
    partial[begin / kSensorRowChunk] = {channel[0], 0.5 * channel[1], channel[2]};
  });
  Vec3d mean{};
  for (const Vec3d& part : partial) mean += part;
  double best_mired = kDaylight;
  if (mean.x > 0.0 && mean.y > 0.0 && mean.z > 0.0) {
    const double coolest = 1e6 / static_cast<double>(params.coolest_k);
    const double warmest = 1e6 / static_cast<double>(params.warmest_k);
    const int steps = 1 + static_cast<int>((warmest - coolest) / 2.0);
    double least = 1e300;
    for (int i = 0; i <= steps; ++i) {
      const double mired = coolest + (warmest - coolest) * i / steps;
      const Vec3d body = raw_of_body(sensor, mired);
      const double dr = std::log(mean.x / mean.y / body.x);
      const double db = std::log(mean.z / mean.y / body.z);
      if (dr * dr + db * db < least) {
        least = dr * dr + db * db;
        best_mired = mired;
      }
    }
  }
  const double mired = kDaylight + static_cast<double>(params.adaptation) * (best_mired - kDaylight);
  gains = gains_for(raw_of_body(sensor, mired));
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_WHITE_BALANCE_HPP
