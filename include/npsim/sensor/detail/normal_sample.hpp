// SPDX-License-Identifier: Apache-2.0
// A standard normal number from 32 random bits, by inverting the cumulative distribution (Wichura, "Algorithm AS 241:
// the percentage points of the normal distribution", Applied Statistics 37, 1988; its 7-digit version).
//
// Monotonic in the bits. The argument is (bits + 1/2) 2^-32, so results lie within +-6.4 and +x and -x come from
// mirrored bits. Error: below 2e-7 max(1, |x|) (measured). Only +, *, /, sqrt and frexp, which IEEE 754 rounds alike
// everywhere: noise has the same bits on every machine, which std::log would not promise.
#ifndef NPSIM_SENSOR_DETAIL_NORMAL_SAMPLE_HPP
#define NPSIM_SENSOR_DETAIL_NORMAL_SAMPLE_HPP

#include <cmath>
#include <cstdint>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace normal_detail {

// Natural logarithm of a positive normal number, within 1e-11 relative.
[[nodiscard]] inline double log_of(double x) noexcept {
  int exponent = 0;
  double mantissa = std::frexp(x, &exponent);  // in [1/2, 1)
  if (mantissa < 0.70710678118654752) {
    mantissa *= 2.0;
    --exponent;
  }
  // log m = 2 artanh s with |s| < .1716
  const double s = (mantissa - 1.0) / (mantissa + 1.0);
  const double q = s * s;
  const double series =
      1.0 + q * (1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * (1.0 / 9.0 + q * (1.0 / 11.0 + q / 13.0)))));
  return 2.0 * s * series + static_cast<double>(exponent) * 0.69314718055994531;
}

}  // namespace normal_detail

[[nodiscard]] inline float standard_normal(std::uint32_t bits) noexcept {
  const double p = (static_cast<double>(bits) + 0.5) * 0x1p-32;
  const double q = p - 0.5;
  if (std::fabs(q) <= 0.425) {
    const double r = 0.180625 - q * q;
    const double above = ((5.9109374720e1 * r + 1.5929113202e2) * r + 5.0434271938e1) * r + 3.3871327179;
    const double below = ((6.7187563600e1 * r + 7.8757757664e1) * r + 1.7895169469e1) * r + 1.0;
    return static_cast<float>(q * above / below);
  }
  // The smaller tail is at least 2^-33, whose r is 4.8: the method's third range, r > 5, is never reached.
  const double r = std::sqrt(-normal_detail::log_of(q < 0.0 ? p : 1.0 - p)) - 1.6;
  const double above = ((1.7023821103e-1 * r + 1.3067284816) * r + 2.7568153900) * r + 1.4234372777;
  const double below = (1.2021132975e-1 * r + 7.3700164250e-1) * r + 1.0;
  const double x = above / below;
  return static_cast<float>(q < 0.0 ? -x : x);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_DETAIL_NORMAL_SAMPLE_HPP
