// SPDX-License-Identifier: Apache-2.0
// What of the sheet is background, and how its surface goes on where it ends. Part of mesh/complete.hpp.
//
// A pixel is removed where it shows a foreground object that goes: all of the foreground, or only the segments that
// touch an uncertain pixel. Known: a vertex of the sheet that is neither removed nor uncertain. Blocked: no surface,
// and not removed. Missing: the rest. Exact. Cost: one pass over labels, masks and sheet; one over states and vertices,
// which in place writes only around what is missing. Memory: none.
//
// At a known pixel, an anchor, the surface goes on along its row with d(1/z)/dx of the plane, in inverse depth, through
// the kept vertices around it: least squares of 1/z - 1/z_anchor = s + p dx + q dy over a window, without those that
// are farther off the anchor than fit_tolerance, relatively. 0 where they do not span a plane; where all are in one
// row, its slope. Lanes are columns: sums run down them, then across in double precision, in the order of the columns.
// Cost: about two instructions a sample. Memory: 8 KiB of stack. Error: with a whole window of radius 4 5e-8 of the
// anchor's inverse depth per pixel, less with wider ones.
#ifndef NPSIM_MESH_DETAIL_BACKGROUND_ANCHORS_HPP
#define NPSIM_MESH_DETAIL_BACKGROUND_ANCHORS_HPP

#include <algorithm>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/layer.hpp"
#include "npsim/mesh/detail/rows.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr int kMaxFitRadius = 64;

namespace mesh_detail {

// Marks with 1 the foreground pixels of segments that touch an uncertain pixel; leaves the others at 0. Marks spread
// along rows and columns, down and up in turn, until no more come: twice for most pictures, at worst once for each turn
// of a spiral, without any memory.
inline void mark_touching_segments(LabelSet foreground, ImageView<const Label> labels,
                                   ImageView<const std::uint8_t> uncertain, ImageView<std::uint8_t> marked) noexcept {
  constexpr std::uint8_t kMarked = 1;
  constexpr std::uint8_t kOther = 2;  // of the foreground, not marked so far
  const int width = labels.width();
  const int height = labels.height();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool touches = mask_at(uncertain, x, y, false) || (x > 0 && mask_at(uncertain, x - 1, y, false)) ||
                           (x + 1 < width && mask_at(uncertain, x + 1, y, false)) ||
                           (y > 0 && mask_at(uncertain, x, y - 1, false)) ||
                           (y + 1 < height && mask_at(uncertain, x, y + 1, false));
      marked(x, y) = foreground.contains(labels(x, y)) ? (touches ? kMarked : kOther) : std::uint8_t{0};
    }
  }
  bool spreads = true;
  const auto take = [&](int x, int y, int from_x, int from_y) {
    if (marked(x, y) != kOther || marked(from_x, from_y) != kMarked || labels(x, y) != labels(from_x, from_y)) return;
    marked(x, y) = kMarked;
    spreads = true;
  };
  const auto spread = [&](int y, int from_y) {
    for (int x = 0; x < width && from_y >= 0 && from_y < height; ++x) take(x, y, x, from_y);
    for (int x = 1; x < width; ++x) take(x, y, x - 1, y);
    for (int x = width - 2; x >= 0; --x) take(x, y, x + 1, y);
  };
  while (spreads) {
    spreads = false;
    for (int y = 0; y < height; ++y) spread(y, y - 1);
    for (int y = height - 1; y >= 0; --y) spread(y, y + 1);
  }
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) marked(x, y) = marked(x, y) == kMarked ? 1 : 0;
  }
}

// A row of states; true where a blocked pixel has a vertex in the sheet. removed: labels that go, or nullptr where
// `state` has marks. uncertain, surface: may be nullptr.
template <class F>
bool find_states(const LabelSet* removed, const Label* labels, const std::uint8_t* uncertain,
                 const std::uint8_t* surface, const Vec3f* sheet, int width, std::uint8_t* state) noexcept {
  using U = simd::BytesOf<F>;
  bool blocked_vertex = false;
  const LabelTest<U> goes(removed != nullptr ? *removed : LabelSet());
  for (int x = 0; x < width; x += kWordBits) {
    const int n = std::min(kWordBits, width - x);
    const std::uint64_t gone = removed != nullptr ? test_bytes<U>(labels + x, n, goes) : nonzero_bits<U>(state + x, n);
    const std::uint64_t shows = surface != nullptr ? nonzero_bits<U>(surface + x, n) : low_bits(n);
    const std::uint64_t doubt = uncertain != nullptr ? nonzero_bits<U>(uncertain + x, n) : 0;
    std::uint64_t there = 0;
    std::uint64_t empty = 0;
    for (int i = 0; i < n; i += F::lanes) {
      const F z = simd::load3<F>(&sheet[x + i].x, std::min(F::lanes, n - i)).z;
      there |= std::uint64_t{bits(z > F(0.0F))} << static_cast<unsigned>(i);
      empty |= std::uint64_t{bits(z == F(0.0F))} << static_cast<unsigned>(i);
    }
    const std::uint64_t known = shows & ~gone & ~doubt & there;
    const std::uint64_t blocked = low_bits(n) & ~shows & ~gone;
    blocked_vertex = blocked_vertex || (blocked & ~empty) != 0;
    for (int i = 0; i < n; i += U::lanes) {
      const auto shift = static_cast<unsigned>(i);
      const U states =
          U::from_bits(known >> shift, row_state::known) | U::from_bits(blocked >> shift, row_state::blocked);
      if (n - i >= U::lanes) {
        states.store(state + x + i);
      } else {
        states.store(state + x + i, n - i);
      }
    }
  }
  return blocked_vertex;
}

// A row of the sheet where the state is known, {0, 0, 0} elsewhere. kept may be the sheet itself.
template <class F>
void keep_known(const std::uint8_t* state, const Vec3f* sheet, int width, Vec3f* kept) noexcept {
  using U = simd::BytesOf<F>;
  for (int x = 0; x < width; x += kWordBits) {
    const int n = std::min(kWordBits, width - x);
    const std::uint64_t known = test_bytes<U>(state + x, n, [](U s) { return equal_bits(s, U(row_state::known)); });
    if (known == low_bits(n)) {
      if (kept != sheet) std::copy(sheet + x, sheet + x + n, kept + x);
      continue;
    }
    for (int i = 0; i < n; i += F::lanes) {
      const int lanes = std::min(F::lanes, n - i);
      const simd::F32x3<F> v = simd::load3<F>(&sheet[x + i].x, lanes);
      const auto here = F::MaskType::from_bits(static_cast<std::uint32_t>(known >> static_cast<unsigned>(i)));
      const F zero(0.0F);
      simd::store3(&kept[x + i].x,
                   simd::F32x3<F>{select(here, v.x, zero), select(here, v.y, zero), select(here, v.z, zero)}, lanes);
    }
  }
}

// Sums over samples (x, y, w), for the least-squares plane w = a + b x + c y.
struct PlaneSums {
  double n = 0, x = 0, y = 0, w = 0, xx = 0, xy = 0, yy = 0, xw = 0, yw = 0;
};

// The same about the mean of the samples.
struct CentredSums {
  double xx, xy, yy, xw, yw;
  [[nodiscard]] double determinant() const noexcept { return xx * yy - xy * xy; }
  // False where all are in one row, one column or on one line: no tilt can be told across it.
  [[nodiscard]] bool span_plane() const noexcept { return determinant() > 1e-6 * xx * yy; }
  [[nodiscard]] double slope_x() const noexcept { return (yy * xw - xy * yw) / determinant(); }
  [[nodiscard]] double slope_y() const noexcept { return (xx * yw - xy * xw) / determinant(); }
};

[[nodiscard]] inline CentredSums centred(const PlaneSums& s) noexcept {
  return {s.xx - s.x * s.x / s.n, s.xy - s.x * s.y / s.n, s.yy - s.y * s.y / s.n, s.xw - s.x * s.w / s.n,
          s.yw - s.y * s.w / s.n};
}

// At the kept pixel (x, y), 1 <= radius <= kMaxFitRadius.
template <class F>
[[nodiscard]] double inverse_depth_slope(int radius, float fit_tolerance, ImageView<const Vec3f> vertices,
                                         ImageView<const std::uint8_t> state, int x, int y) noexcept {
  const int top = std::max(0, y - radius);
  const int bottom = std::min(vertices.height() - 1, y + radius);
  const int last = std::min(vertices.width() - 1, x + radius);
  const F anchor(1.0F / vertices(x, y).z);
  const F tolerance = F(fit_tolerance) * anchor;
  const F zero(0.0F);
  PlaneSums s;
  for (int begin = std::max(0, x - radius); begin <= last; begin += F::lanes) {
    const int lanes = std::min(F::lanes, last - begin + 1);
    float z[2 * kMaxFitRadius + 1][F::lanes];  // 0 where not kept
    for (int j = top; j <= bottom; ++j) {
      const std::uint8_t* kept = state.row(j) + begin;
      const Vec3f* v = vertices.row(j) + begin;
      float* to = z[j - top];
      for (int i = 0; i < F::lanes; ++i) to[i] = i < lanes && kept[i] == row_state::known ? v[i].z : 0.0F;
    }
    F count = zero, by = zero, byy = zero, bw = zero, byw = zero;
    for (int j = top; j <= bottom; ++j) {
      const F depth = F::load(z[j - top]);
      const auto here = depth > zero;
      const F off = F(1.0F) / select(here, depth, F(1.0F)) - anchor;
      const auto fits = here & (abs(off) <= tolerance);
      const F one = select(fits, F(1.0F), zero);
      const F w = select(fits, off, zero);
      const F dy(static_cast<float>(j - y));
      count = count + one;
      by = fma(dy, one, by);
      byy = fma(dy * dy, one, byy);
      bw = bw + w;
      byw = fma(dy, w, byw);
    }
    float column[5][F::lanes];
    count.store(column[0]);
    by.store(column[1]);
    byy.store(column[2]);
    bw.store(column[3]);
    byw.store(column[4]);
    for (int i = 0; i < lanes; ++i) {
      const double dx = begin + i - x;
      const auto of = [&column, i](int which) { return static_cast<double>(column[which][i]); };
      s.n += of(0), s.x += dx * of(0), s.xx += dx * dx * of(0);
      s.y += of(1), s.xy += dx * of(1), s.yy += of(2);
      s.w += of(3), s.xw += dx * of(3), s.yw += of(4);
    }
  }
  if (s.n < 4) return 0.0;
  const CentredSums c = centred(s);
  if (!c.span_plane()) return c.xx > 0 && c.yy == 0 ? c.xw / c.xx : 0.0;
  return c.slope_x();
}

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_BACKGROUND_ANCHORS_HPP
