// SPDX-License-Identifier: Apache-2.0
#include "depth_shift.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "npsim/core/camera.hpp"

namespace npsim::tool {

DepthShift depth_shift(ImageView<const float> depth, ImageView<const float> reference,
                       ImageView<const std::uint8_t> mask) {
  DepthShift out;
  std::vector<float> all;
  double sum = 0;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      if (mask(x, y) == 0) continue;
      if (!is_valid_depth(depth(x, y))) {
        ++out.lost;
        continue;
      }
      const double e = std::fabs(static_cast<double>(depth(x, y)) / static_cast<double>(reference(x, y)) - 1);
      sum += e;
      all.push_back(static_cast<float>(e));
    }
  }
  out.pixels = all.size();
  if (all.empty()) return out;
  const auto quantile = [&](double q) {
    const auto nth = all.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(all.size() - 1));
    std::nth_element(all.begin(), nth, all.end());
    return static_cast<double>(*nth);
  };
  out.mean = sum / static_cast<double>(all.size());
  out.median = quantile(0.5);
  out.most = quantile(0.95);
  return out;
}

OrderedJson to_json(const DepthShift& s) {
  return {{"pixels", s.pixels}, {"lost", s.lost}, {"mean", s.mean}, {"median", s.median}, {"p95", s.most}};
}

}  // namespace npsim::tool
