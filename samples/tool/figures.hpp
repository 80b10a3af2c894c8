// SPDX-License-Identifier: Apache-2.0
// Ratios and shares as `evaluate` prints and writes them.
#ifndef NPSIM_SAMPLES_TOOL_FIGURES_HPP
#define NPSIM_SAMPLES_TOOL_FIGURES_HPP

#include <cstddef>
#include <limits>

#include <nlohmann/json.hpp>

namespace npsim::tool {

using OrderedJson = nlohmann::ordered_json;

inline constexpr double kNone = std::numeric_limits<double>::quiet_NaN();  // a dash in a table, null in JSON

[[nodiscard]] inline double ratio(double value, double input) { return input > 0 ? value / input : kNone; }

[[nodiscard]] inline double share(std::size_t part, std::size_t whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : kNone;
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_FIGURES_HPP
