// SPDX-License-Identifier: Apache-2.0
// What is behind the objects of a street, guessed per pixel: its floor, or something that stands on it, whichever is
// nearer to the camera. The inverse depth is the greater of
//   - the floor's (street_floor.hpp), times what nearby kept floor (left, right, below) differs from it, and
//   - that of the best anchor that is not floor: left or right in the row, or above in the column. What stands is
//     upright: it goes on down its column at its depth. Between a left and a right anchor of one surface inverse depth
//     is linear. The best anchor is the one with the least distance in pixels over depth: where two disagree, what was
//     behind an object is rather the farther of the two. Below leaves goes on what is above them in the column, where
//     that is farther: crowns seldom reach the ground. A run's anchors of two surfaces go on along their planes.
// Invariant: reads kept vertices only, so rows (and strips of columns) may be done in any order. Memory: none; the
// guesses of the columns are kept in the vertices that are still missing.
#ifndef NPSIM_MESH_STREET_BACKGROUND_HPP
#define NPSIM_MESH_STREET_BACKGROUND_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/interpolate_rows.hpp"
#include "npsim/mesh/layer.hpp"
#include "npsim/mesh/street_floor.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {

struct StreetBackgroundParams {
  float join_ratio = 1.3F;        // >= 1: anchors left and right whose depths differ by no more are one surface
  float above_weight = 4.0F;      // > 0: how much nearer an anchor above counts than one beside
  float floor_tolerance = 1.3F;   // >= 1: kept floor farther off the fitted one does not correct it
  float farthest_floor = 100.0F;  // > 0, in heights of the camera: beyond, floor and horizon cannot be told apart
};

inline namespace NPSIM_ISA_NAMESPACE {
namespace mesh_detail {

// What the column of a missing pixel tells. Fits the vertex that is missing.
struct ColumnGuess {
  float upright = 0;        // inverse depth of the anchor above; 0: none
  float floor = 0;          // kept floor below over the fitted one; 0: none
  std::uint16_t above = 0;  // px to the anchor above, at most 65535; with the leaf bit in `upright_is_leaf`
  std::uint16_t below = 0;  // px to the floor below
};
static_assert(sizeof(ColumnGuess) == sizeof(Vec3f));

[[nodiscard]] inline ColumnGuess load_guess(const Vec3f& v) noexcept {
  ColumnGuess g;
  std::memcpy(static_cast<void*>(&g), &v, sizeof g);
  return g;
}
inline void store_guess(const ColumnGuess& g, Vec3f& v) noexcept { std::memcpy(static_cast<void*>(&v), &g, sizeof g); }

struct StreetBackground {
  StreetBackgroundParams params;
  StreetFloorParams floor_params;
  double max_extension_ratio = 2;
  StreetFloor floor;
  ImageView<const Label> labels;
  ImageView<const std::uint8_t> state;
  ImageView<Vec3f> vertices;

  [[nodiscard]] bool known(int x, int y) const noexcept { return state(x, y) == row_state::known; }
  [[nodiscard]] double inverse(int x, int y) const noexcept { return 1.0 / static_cast<double>(vertices(x, y).z); }
  [[nodiscard]] bool is_floor(int x, int y) const noexcept {
    return floor.valid && floor_params.is_floor(labels(x, y)) && floor.carriageway(x, y) > 0;
  }
  // Of a kept pixel of floor: its inverse depth over the fitted one; 0 where too far off.
  [[nodiscard]] double floor_factor(int x, int y, double profile) const noexcept {
    const double factor = inverse(x, y) / (floor.carriageway(x, y) * profile);
    const auto tolerance = static_cast<double>(params.floor_tolerance);
    return factor <= tolerance && factor * tolerance >= 1.0 ? factor : 0.0;
  }

  // From the pixel above a missing one.
  void guess_from_above(int x, int y) const noexcept {
    ColumnGuess g;
    if (y > 0 && state(x, y - 1) == row_state::missing) {
      g = load_guess(vertices(x, y - 1));
      if (g.above < 65535) ++g.above;
    } else if (y > 0 && known(x, y - 1) && !is_floor(x, y - 1)) {
      g.above = 1;
      double w = inverse(x, y - 1);
      if (labels(x, y - 1) == label::vegetation) {
        // A crown is not looked through for more than this: each pixel is another line of memory.
        const int lowest = std::max(0, y - state.height() / 8);
        for (int j = y - 2; j >= lowest && state(x, j) != row_state::blocked; --j) {
          if (!known(x, j) || labels(x, j) == label::vegetation) continue;
          if (!is_floor(x, j)) w = std::min(w, inverse(x, j));
          break;
        }
      }
      g.upright = static_cast<float>(w);
    }
    g.floor = 0;
    g.below = 0;
    store_guess(g, vertices(x, y));
  }
  void guess_from_below(int x, int y) const noexcept {
    ColumnGuess g = load_guess(vertices(x, y));
    if (y + 1 >= state.height()) return;
    if (state(x, y + 1) == row_state::missing) {
      const ColumnGuess b = load_guess(vertices(x, y + 1));
      g.floor = b.floor;
      g.below = b.below < 65535 ? static_cast<std::uint16_t>(b.below + 1) : b.below;
    } else if (known(x, y + 1) && is_floor(x, y + 1)) {
      g.floor = static_cast<float>(floor_factor(x, y + 1, floor.profile(x, y + 1)));
      g.below = 1;
    }
    store_guess(g, vertices(x, y));
  }

  template <class F>
  static void for_missing(const std::uint8_t* row, int begin, int end, F&& f) {
    for (const std::uint8_t* p = row + begin; p < row + end; ++p) {
      p = static_cast<const std::uint8_t*>(std::memchr(p, row_state::missing, static_cast<std::size_t>(row + end - p)));
      if (p == nullptr) return;
      f(static_cast<int>(p - row));
    }
  }
  void guess_columns(int begin, int end) const noexcept {
    for (int y = 0; y < state.height(); ++y) {
      const std::uint8_t* row = state.row(y);
      for_missing(row, begin, end, [&](int x) { guess_from_above(x, y); });
    }
    if (!floor.valid) return;
    for (int y = state.height() - 1; y >= 0; --y) {
      const std::uint8_t* row = state.row(y);
      for_missing(row, begin, end, [&](int x) { guess_from_below(x, y); });
    }
  }

  // An end of a run.
  struct Anchor {
    bool kept = false;
    bool floor = false;
    bool pavement = false;
    double w = 0;       // inverse depth
    double factor = 0;  // floor: over the fitted one
    double raised = 0;  // floor: over the carriageway
  };
  [[nodiscard]] Anchor anchor(int x, int y) const noexcept {
    Anchor a;
    if (x < 0 || x >= state.width() || !known(x, y)) return a;
    a.kept = true;
    a.w = inverse(x, y);
    a.floor = is_floor(x, y);
    if (a.floor) {
      a.pavement = floor_params.pavement.contains(labels(x, y));
      a.factor = floor_factor(x, y, floor.profile(x, y));
      a.raised = a.w / floor.carriageway(x, y);
    }
    return a;
  }

  // Calls put(x, w) with the inverse depth of each pixel l .. r of a run in row y, where there is anything to tell it.
  // A run with the sky at an end and no anchor at the other has none. left_slope, right_slope: d w / dx of what stands
  // at the only anchor of a run, else 0.
  template <class Slope, class Put>
  void fill(int y, int l, int r, Slope&& slope_at, Put&& put) const noexcept {
    const Anchor left = anchor(l - 1, y);
    const Anchor right = anchor(r + 1, y);
    const auto blocked = [&](int x) { return x >= 0 && x < state.width() && !known(x, y); };
    if (!left.kept && !right.kept && (blocked(l - 1) || blocked(r + 1))) {
      for (int x = l; x <= r; ++x) put(x, 0.0);
      return;
    }
    const auto extend = [this](double w, double change) {
      const double limit = max_extension_ratio;
      return std::clamp(w + change, w / limit, w * limit);
    };
    // Pavements on either side of the street are not one.
    const bool one_side = (l - 1 < floor.vanishing_x) == (r + 1 < floor.vanishing_x);
    const bool one_floor = left.floor && right.floor && left.pavement == right.pavement && (one_side || !left.pavement);
    const double ratio = static_cast<double>(params.join_ratio);
    const bool joined = left.kept && right.kept && !left.floor && !right.floor &&
                        std::max(left.w, right.w) <= ratio * std::min(left.w, right.w);
    const double left_slope = left.kept && !left.floor && !joined ? slope_at(l - 1) : 0.0;
    const double right_slope = right.kept && !right.floor && !joined ? slope_at(r + 1) : 0.0;
    const double horizon = floor.valid ? 1.0 / (static_cast<double>(params.farthest_floor) * floor.camera_height_m) : 0;
    for (int x = l; x <= r; ++x) {
      const ColumnGuess column = load_guess(vertices(x, y));
      const double dl = x - l + 1;
      const double dr = r - x + 1;
      double w = 0;
      double least = 1e300;
      bool beside = false;
      const auto offer = [&](bool upright, double distance, double of, bool is_beside) {
        if (!upright || !(distance * of < least)) return;
        least = distance * of;
        w = of;
        beside = is_beside;
      };
      offer(left.kept && !left.floor, dl, extend(left.w, left_slope * dl), true);
      offer(right.kept && !right.floor, dr, extend(right.w, -right_slope * dr), true);
      offer(column.upright > 0, column.above / static_cast<double>(params.above_weight),
            static_cast<double>(column.upright), false);
      if (joined && beside) w = (left.w * dr + right.w * dl) / (dl + dr);
      const double plane = floor.valid ? floor.carriageway(x, y) : 0.0;
      if (plane > horizon) {
        double f;
        if (one_floor) {
          f = (left.raised * dr + right.raised * dl) / (dl + dr);
        } else {
          double sum = 0;
          double weights = 0;
          const auto mix = [&](double factor, double distance) {
            if (!(factor > 0)) return;
            const double weight = 1.0 / (distance * distance);
            sum += factor * weight;
            weights += weight;
          };
          mix(left.factor, dl);
          mix(right.factor, dr);
          mix(static_cast<double>(column.floor), column.below);
          f = floor.profile(x, y) * (weights > 0 ? sum / weights : 1.0);
        }
        if (w > 0 || left.kept || right.kept || column.floor > 0) w = std::max(w, plane * f);
      }
      if (!(w > 0) && (left.kept || right.kept)) w = !right.kept || (left.kept && dl <= dr) ? left.w : right.w;
      put(x, w);
    }
  }
};

}  // namespace mesh_detail
}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_MESH_STREET_BACKGROUND_HPP
