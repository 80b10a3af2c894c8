// SPDX-License-Identifier: Apache-2.0
// What is behind the objects of a street straight from its definition, a pixel at a time, in double precision: what the
// street completion is tested against. Where candidates tie within rounding, each of them is an answer.
#ifndef NPSIM_TESTS_REFERENCE_STREET_BACKGROUND_HPP
#define NPSIM_TESTS_REFERENCE_STREET_BACKGROUND_HPP

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/complete.hpp"

namespace npsim {
namespace reference {

// d(1/z)/dx of the plane through the kept vertices around (x, y).
[[nodiscard]] inline double anchor_slope(int radius, double tolerance, ImageView<const Vec3f> vertices,
                                         ImageView<const std::uint8_t> state, int x, int y) {
  const double anchor = 1.0 / static_cast<double>(vertices(x, y).z);
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0, sw = 0, sxw = 0, syw = 0;
  for (int j = std::max(0, y - radius); j <= std::min(vertices.height() - 1, y + radius); ++j) {
    for (int i = std::max(0, x - radius); i <= std::min(vertices.width() - 1, x + radius); ++i) {
      if (state(i, j) != row_state::known) continue;
      const double w = 1.0 / static_cast<double>(vertices(i, j).z) - anchor;
      if (std::fabs(w) > tolerance * anchor) continue;
      const double dx = i - x;
      const double dy = j - y;
      n += 1, sx += dx, sy += dy, sxx += dx * dx, sxy += dx * dy, syy += dy * dy;
      sw += w, sxw += dx * w, syw += dy * w;
    }
  }
  const double xx = sxx - sx * sx / n;
  const double xy = sxy - sx * sy / n;
  const double yy = syy - sy * sy / n;
  return (yy * (sxw - sx * sw / n) - xy * (syw - sy * sw / n)) / (xx * yy - xy * xy);
}

struct Street {
  BackgroundParams params;
  StreetFloor floor;
  ImageView<const Label> labels;
  ImageView<const std::uint8_t> state;
  ImageView<const Vec3f> kept;
  float focal_px;

  [[nodiscard]] bool in(int x, int y) const { return x >= 0 && y >= 0 && x < state.width() && y < state.height(); }
  [[nodiscard]] bool is(int x, int y, std::uint8_t s) const { return in(x, y) && state(x, y) == s; }
  [[nodiscard]] bool known(int x, int y) const { return is(x, y, row_state::known); }
  [[nodiscard]] double w(int x, int y) const { return 1.0 / static_cast<double>(kept(x, y).z); }
  [[nodiscard]] bool is_floor(int x, int y) const {
    return known(x, y) && floor.valid && params.floor.is_floor(labels(x, y)) && floor.carriageway(x, y) > 0;
  }
  [[nodiscard]] bool upright(int x, int y) const { return known(x, y) && !is_floor(x, y); }
  [[nodiscard]] double factor(int x, int y) const {
    if (!is_floor(x, y)) return 0;
    const double f = w(x, y) / (floor.carriageway(x, y) * floor.profile(x, y));
    const auto tolerance = static_cast<double>(params.street.floor_tolerance);
    return f <= tolerance && f * tolerance >= 1 ? f : 0;
  }
  // Whether the leaves at (x, y) are so few side by side that they are a trunk.
  [[nodiscard]] bool trunk(int x, int y) const {
    int l = x, r = x;
    while (in(l - 1, y) && labels(l - 1, y) == label::vegetation) --l;
    while (in(r + 1, y) && labels(r + 1, y) == label::vegetation) ++r;
    return static_cast<float>(r - l + 1) <= params.street.trunk_width_m * focal_px * (1.0F / kept(x, y).z);
  }
  // What stands above the missing pixel (x, y), `top` being the row of the anchor; 0: nothing.
  [[nodiscard]] double above(int x, int top) const {
    if (!upright(x, top)) return 0;
    if (labels(x, top) != label::vegetation || trunk(x, top)) return w(x, top);
    for (int j = top - 1; j >= std::max(0, top + 1 - state.height() / 8); --j) {
      if (is(x, j, row_state::blocked)) break;
      if (!known(x, j) || labels(x, j) == label::vegetation) continue;
      return is_floor(x, j) ? w(x, top) : std::min(w(x, top), w(x, j));
    }
    return w(x, top);
  }

  // Inverse depths that may be at the missing pixel (x, y); 0: none. slope(x, y): of an anchor.
  template <class Slope>
  [[nodiscard]] std::vector<double> answers(int x, int y, const Slope& slope) const {
    constexpr double kTie = 1e-5;
    int l = x, r = x, bottom = y;  // of the anchors
    while (is(l, y, row_state::missing)) --l;
    while (is(r, y, row_state::missing)) ++r;
    while (is(x, bottom, row_state::missing)) ++bottom;
    const bool anchored = known(l, y) || known(r, y);
    if (!anchored && (is(l, y, row_state::blocked) || is(r, y, row_state::blocked))) return {0.0};
    const double dl = x - l;
    const double dr = r - x;
    const bool joined =
        upright(l, y) && upright(r, y) &&
        std::max(w(l, y), w(r, y)) <= static_cast<double>(params.street.join_ratio) * std::min(w(l, y), w(r, y));
    const auto pavement = [&](int at) { return params.floor.pavement.contains(labels(at, y)); };
    const bool one_side = (l < floor.vanishing_x) == (r < floor.vanishing_x);
    const bool one_floor = is_floor(l, y) && is_floor(r, y) && pavement(l) == pavement(r) && (one_side || !pavement(l));
    const auto up = static_cast<double>(params.street.above_weight);
    const double sure = joined && std::max(w(l, y), w(r, y)) <=
                                      static_cast<double>(params.street.same_ratio) * std::min(w(l, y), w(r, y))
                            ? up
                            : 1.0;
    struct Candidate {
      double score, w;
    };
    std::vector<Candidate> candidates;
    const auto beside = [&](int at, double distance, double direction) {
      if (!upright(at, y)) return;
      const double anchor = w(at, y);
      const auto limit = static_cast<double>(params.max_extension_ratio);
      const double change = joined ? 0.0 : direction * slope(at, y) * distance;
      const double of = std::clamp(anchor + change, anchor / limit, anchor * limit);
      candidates.push_back({of * distance / sure, joined ? (w(l, y) * dr + w(r, y) * dl) / (dl + dr) : of});
    };
    beside(l, dl, 1);
    beside(r, dr, -1);
    // Above the columns of the run near by, as far as they are in the same strip.
    const int reach = std::min(32, state.width() / 80);
    for (int i = std::max(l + 1, x - reach); i <= std::min(r - 1, x + reach) && !one_floor; ++i) {
      if (i / mesh_detail::kStripColumns != x / mesh_detail::kStripColumns) continue;
      int crest_row = y;
      while (is(i, crest_row, row_state::missing)) --crest_row;
      const double crest = above(i, crest_row);
      if (crest > 0) candidates.push_back({crest * ((y - crest_row) / up + std::abs(i - x) * up), crest});
    }
    double least = std::numeric_limits<double>::infinity();
    for (const Candidate& c : candidates) least = std::min(least, c.score);
    std::vector<double> standing;
    for (const Candidate& c : candidates) {
      const bool new_one = std::find(standing.begin(), standing.end(), c.w) == standing.end();
      if (c.score <= least * (1 + kTie) && new_one) standing.push_back(c.w);
    }
    if (standing.empty()) standing.push_back(0);

    const double plane = floor.valid ? floor.carriageway(x, y) : 0;
    const double horizon = 1 / (static_cast<double>(params.street.farthest_floor) * floor.camera_height_m);
    const bool floor_below = factor(x, bottom) > 0;
    std::vector<double> answers;
    for (const double stands : standing) {
      const double nearest = !known(r, y) || (known(l, y) && dl <= dr) ? (known(l, y) ? w(l, y) : 0) : w(r, y);
      const double without = stands > 0 || !anchored ? stands : nearest;
      if (!(floor.valid && plane > horizon * (1 - kTie)) || !(stands > 0 || anchored || floor_below)) {
        answers.push_back(without);
        continue;
      }
      if (plane < horizon * (1 + kTie)) answers.push_back(without);
      double f;
      if (one_floor) {
        const auto raised = [&](int at) { return w(at, y) / floor.carriageway(at, y); };
        f = (raised(l) * dr + raised(r) * dl) / (dl + dr);
      } else {
        double sum = 0;
        double weights = 0;
        const auto mix = [&](double of, double distance) {
          if (!(of > 0)) return;
          sum += of / (distance * distance);
          weights += 1 / (distance * distance);
        };
        mix(factor(l, y), dl);
        mix(factor(r, y), dr);
        mix(factor(x, bottom), bottom - y);
        f = floor.profile(x, y) * (weights > 0 ? sum / weights : 1.0);
      }
      answers.push_back(std::max(stands, plane * f));
    }
    return answers;
  }
};

}  // namespace reference
}  // namespace npsim

#endif  // NPSIM_TESTS_REFERENCE_STREET_BACKGROUND_HPP
