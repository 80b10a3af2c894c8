// SPDX-License-Identifier: Apache-2.0
// A comparison as an SVG: time against the largest error, both logarithmic, one labelled mark per contender.
//
// Contenders whose first error is in another unit than the first contender's, or have none, are dashed lines at their
// time; an error of 0 stands on the left edge. Colours follow the viewer's light or dark scheme.
#ifndef NPSIM_BENCH_FRONTIER_PICTURE_HPP
#define NPSIM_BENCH_FRONTIER_PICTURE_HPP

#include <string>

#include "comparison.hpp"

namespace npsim::bench {

[[nodiscard]] std::string svg_of(const Comparison& comparison);

}  // namespace npsim::bench

#endif  // NPSIM_BENCH_FRONTIER_PICTURE_HPP
