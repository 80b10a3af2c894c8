// SPDX-License-Identifier: Apache-2.0
// Small charts as SVG: curves over a count with a logarithmic axis, tables of values as coloured squares, and figures
// beside the ranges in which they should lie.
//
// Colours follow the viewer's light or dark scheme. Values that are not finite, and on a logarithmic axis those that
// are not above 0, are left out.
#ifndef NPSIM_SAMPLES_LAB_CHARTS_HPP
#define NPSIM_SAMPLES_LAB_CHARTS_HPP

#include <string>
#include <vector>

namespace npsim::tool {

struct Curve {
  std::string name;
  std::vector<double> values;  // at 0, 1, 2, ...
};

// Six curves at most are told apart by colour. "" where there is nothing to draw.
[[nodiscard]] std::string svg_of_curves(const std::string& title, const std::string& along,
                                        const std::vector<Curve>& curves);

struct HeatMap {
  std::string name;
  std::vector<double> values;  // rows one after the other, the first on top
  int digits = 3;
};

// All maps have these columns and rows. The colour goes from a map's least to its greatest value, as their logarithms
// do where all are above 0.
[[nodiscard]] std::string svg_of_maps(const std::string& title, const std::string& across,
                                      const std::vector<std::string>& columns, const std::string& down,
                                      const std::vector<std::string>& rows, const std::vector<HeatMap>& maps);

struct RangeRow {
  std::string name;
  double least = 0;  // least and most: 0 for no range
  double mean = 0;   // above 0
  double most = 0;
  std::vector<double> values;
  double mean_value = 0;  // of the values; not finite: a dash
};

// A row for each figure: the range and the values as multiples of its mean, from 1/8 to 8 on a logarithmic axis; what
// is beyond stands at the end. Beside it the mean of the values.
[[nodiscard]] std::string svg_of_ranges(const std::string& title, const std::string& along,
                                        const std::vector<RangeRow>& rows);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_CHARTS_HPP
