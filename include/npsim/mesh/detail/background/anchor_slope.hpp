// SPDX-License-Identifier: Apache-2.0
// How the surface at a kept pixel goes on along its row: d(1/z)/dx of the plane, in inverse depth, through the kept
// vertices around it. Part of complete_background.hpp.
//
// Least squares of 1/z - 1/z_anchor = s + p dx + q dy over the window, without those that are farther off the anchor
// than fit_tolerance, relatively. 0 where they do not span a plane; where all are in one row, its slope.
// Lanes are columns: sums run down them, then across in double precision, in the order of the columns.
// Cost: about two instructions a sample. Memory: 8 KiB of stack. Error: with a whole window of radius 4 5e-8 of the
// anchor's inverse depth per pixel, less with wider ones.
#ifndef NPSIM_MESH_DETAIL_BACKGROUND_ANCHOR_SLOPE_HPP
#define NPSIM_MESH_DETAIL_BACKGROUND_ANCHOR_SLOPE_HPP

#include <algorithm>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/mesh/interpolate_rows.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr int kMaxFitRadius = 64;

namespace mesh_detail {

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
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0, syy = 0, sw = 0, sxw = 0, syw = 0;
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
      n += of(0), sx += dx * of(0), sxx += dx * dx * of(0);
      sy += of(1), sxy += dx * of(1), syy += of(2);
      sw += of(3), sxw += dx * of(3), syw += of(4);
    }
  }
  if (n < 4) return 0.0;
  const double cxx = sxx - sx * sx / n;
  const double cxy = sxy - sx * sy / n;
  const double cyy = syy - sy * sy / n;
  const double cxw = sxw - sx * sw / n;
  const double cyw = syw - sy * sw / n;
  const double determinant = cxx * cyy - cxy * cxy;
  if (!(determinant > 1e-6 * cxx * cyy)) {  // one row, one column or one diagonal: no tilt can be told across it
    return cxx > 0 && cyy == 0 ? cxw / cxx : 0.0;
  }
  return (cyy * cxw - cxy * cyw) / determinant;
}

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_BACKGROUND_ANCHOR_SLOPE_HPP
