// SPDX-License-Identifier: Apache-2.0
// The heightfield of a sheet's ray structure: inverse depths of vertices, strip by strip, and where the vertices are.
//
// A vertex that is missing, not finite, beyond kTraceMaxCoordinate or nearer than kSheetMinDepth has inverse depth 0:
// its faces are left out. Vertices may lie off their pixels' rays: the largest distance is found, and every test of a
// ray is that much more generous, which costs speed and nothing else. Nothing is kept but what tiles are made of.
// Cost: one pass, about 1 ns a pixel. Memory: a strip, 10 KiB of stack.
// Error: an inverse depth is 1 / depth rounded once.
#ifndef NPSIM_TRACE_DETAIL_SHEET_INVERSE_DEPTH_HPP
#define NPSIM_TRACE_DETAIL_SHEET_INVERSE_DEPTH_HPP

#include <algorithm>
#include <cmath>
#include <limits>

#include "npsim/core/camera.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/fixed.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/triangle/triangle.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr float kSheetMinDepth = 0x1p-40F;  // metres

namespace sheet_detail {

using sheet_layout::RowBounds;

inline constexpr int kStripGroups = 8;
inline constexpr int kStripQuads = kStripGroups * kSheetGroupQuads;

// What vertices add to the bounds of a row of groups.
template <class F>
struct FoundBounds {
  F low[3];
  F high[3];
  F greatest = F(0.0F);
  F off = F(0.0F);

  FoundBounds() noexcept {
    for (int i = 0; i < 3; ++i) {
      low[i] = F(std::numeric_limits<float>::infinity());
      high[i] = F(-std::numeric_limits<float>::infinity());
    }
  }
  [[nodiscard]] RowBounds bounds() const noexcept {
    const float inf = std::numeric_limits<float>::infinity();
    RowBounds out{{inf, inf, inf}, {-inf, -inf, -inf}, 0.0F, 0.0F};
    for (int i = 0; i < F::lanes; ++i) {
      for (int c = 0; c < 3; ++c) {
        // + 0: of zeros of both signs the least would depend on the number of lanes.
        out.low[c] = std::min(out.low[c], low[c].lane(i) + 0.0F);
        out.high[c] = std::max(out.high[c], high[c].lane(i) + 0.0F);
      }
      out.max_inverse_depth = std::max(out.max_inverse_depth, greatest.lane(i));
      out.off_grid_px = std::max(out.off_grid_px, off.lane(i));
    }
    return out;
  }
};

// Inverse depths of pixels [x0, x1) of row y.
template <class F>
void invert_row(const SheetTrace& sheet, int y, int x0, int x1, float* out, FoundBounds<F>& found) noexcept {
  using M = typename F::MaskType;
  const Intrinsics& k = sheet.intrinsics;
  const F inf(std::numeric_limits<float>::infinity());
  const Vec3f* p = sheet.vertices.row(y);
  const float v = static_cast<float>(y) + 0.5F - k.cy;
  FoundBounds<F> all = found;
  for (int x = x0; x < x1; x += F::lanes) {
    const int n = std::min(F::lanes, x1 - x);
    // The next strip's pixels: rows of strips are too short for the machine to see them coming.
    for (int i = 0; i < F::lanes; i += 5) simd::prefetch(p + std::min(x + kStripQuads + i, sheet.vertices.width() - 1));
    const simd::F32x3<F> at = simd::load3<F>(&p[x].x, n);
    const M good = (at.z >= F(kSheetMinDepth)) & (at.z <= F(kTraceMaxCoordinate)) &
                   (abs(at.x) <= F(kTraceMaxCoordinate)) & (abs(at.y) <= F(kTraceMaxCoordinate));
    const F w = select(good, F(1.0F) / select(good, at.z, F(1.0F)), F(0.0F));
    if (n == F::lanes) {
      w.store(out + (x - x0));
    } else {
      w.store(out + (x - x0), n);
    }
    const F xyz[3] = {at.x, at.y, at.z};
    for (int i = 0; i < 3; ++i) {
      all.low[i] = min(select(good, xyz[i], inf), all.low[i]);
      all.high[i] = max(select(good, xyz[i], -inf), all.high[i]);
    }
    all.greatest = max(w, all.greatest);
    const F u = to_float(typename F::Int(x) + F::Int::iota()) + F(0.5F - k.cx);
    const F du = abs(at.x * w * F(k.fx) - u);
    const F dv = abs(at.y * w * F(k.fy) - F(v));
    all.off = max(select(good, max(du, dv), F(0.0F)), all.off);
  }
  found = all;
}

// Inverse depths of kStripGroups groups side by side, and of the pixels that close them on the right and below.
struct InverseDepths {
  static constexpr int kRows = kSheetGroupQuads + 1;
  static constexpr int kStride = kStripQuads + 16;
  alignas(64) float w[kRows][kStride];
};

// Those of the groups from `first` on in row `row` of groups, 0 beside the layer. For first > 0 `strip` has to hold
// those before.
template <class F>
void invert_strip(const SheetTrace& sheet, int row, int first, InverseDepths& strip, FoundBounds<F>& found) noexcept {
  const Shape pixels = sheet.vertices.shape();
  const int left = kSheetGroupQuads * first;
  for (int j = 0; j < InverseDepths::kRows; ++j) {
    float* const w = strip.w[j];
    const int y = kSheetGroupQuads * row + j;
    if (first > 0) w[0] = w[kStripQuads];
    const int begin = first > 0 ? 1 : 0;
    const int end = y < pixels.height ? std::min(kStripQuads + 1, pixels.width - left) : begin;
    invert_row<F>(sheet, y, left + begin, left + end, w + begin, found);
    if (y < sheet.quads.height()) {
      for (int i = 0; i < kStripQuads; i += 64) {
        simd::prefetch(sheet.quads.row(y) + std::min(left + kStripQuads + i, sheet.quads.width() - 1));
      }
    }
    std::fill(w + end, w + kStripQuads + 1, 0.0F);
  }
}

[[nodiscard]] inline RowBounds no_bounds() noexcept {
  const float inf = std::numeric_limits<float>::infinity();
  return {{inf, inf, inf}, {-inf, -inf, -inf}, 0.0F, 0.0F};
}

[[nodiscard]] inline RowBounds union_of(Span<const RowBounds> all) noexcept {
  RowBounds out = no_bounds();
  for (const RowBounds& b : all) {
    for (int k = 0; k < 3; ++k) {
      out.low[k] = std::min(out.low[k], b.low[k]);
      out.high[k] = std::max(out.high[k], b.high[k]);
    }
    out.max_inverse_depth = std::max(out.max_inverse_depth, b.max_inverse_depth);
    out.off_grid_px = std::max(out.off_grid_px, b.off_grid_px);
  }
  return out;
}

// The bounds from what was found: the frustum of the vertices' pixels, half a pixel and their errors wider, and their
// range of depth.
[[nodiscard]] inline SheetBounds bounds_of(const RowBounds& b, Shape shape, const Intrinsics& k) noexcept {
  SheetBounds out;
  out.camera = k;
  out.image = shape;
  const auto width = static_cast<float>(shape.width);
  const auto height = static_cast<float>(shape.height);
  const float reach_x = std::max(std::fabs(k.cx), std::fabs(width - k.cx));
  const float reach_y = std::max(std::fabs(k.cy), std::fabs(height - k.cy));
  out.max_inverse_depth = b.max_inverse_depth;
  out.pad_px = b.off_grid_px + 0x1p-19F * (std::max(width, height) + std::max(reach_x, reach_y));
  out.focal_reach = std::max(k.fx + reach_x, k.fy + reach_y) + 2.0F * (1.0F + out.pad_px);
  for (int i = 0; i < 3; ++i) {
    out.low[i] = b.low[i];
    out.high[i] = b.high[i];
  }
  const double margin = static_cast<double>(out.pad_px) + 0.5;
  const double sides[4] = {
      static_cast<double>(k.cx) - 0.5 + margin, shape.width - 0.5 + margin - static_cast<double>(k.cx),
      static_cast<double>(k.cy) - 0.5 + margin, shape.height - 0.5 + margin - static_cast<double>(k.cy)};
  for (int i = 0; i < 8; ++i) {
    const double sign = i % 2 == 0 ? 1.0 : -1.0;
    out.x[i] = i < 2 ? sign * static_cast<double>(k.fx) : 0.0;
    out.y[i] = i == 2 || i == 3 ? sign * static_cast<double>(k.fy) : 0.0;
    out.z[i] = i < 4 ? sides[i] : sign;
    out.d[i] = i < 4 ? 0.0
                     : (i % 2 == 0 ? -(1 - 0x1p-20) * static_cast<double>(b.low[2])
                                   : (1 + 0x1p-20) * static_cast<double>(b.high[2]));
    out.size[i] = std::fabs(out.x[i]) + std::fabs(out.y[i]) + std::fabs(out.z[i]);
  }
  return out;
}

// The bounds of the whole layer; refused where vertices are too far from their pixels' rays.
[[nodiscard]] inline Status put_bounds_of(Span<const RowBounds> rows, SheetTrace& sheet) noexcept {
  const RowBounds all = union_of(rows);
  sheet.bounds =
      all.max_inverse_depth > 0.0F ? bounds_of(all, sheet.vertices.shape(), sheet.intrinsics) : SheetBounds{};
  if (sheet.bounds.focal_reach < 0x1p30F) return {};
  sheet.bounds = SheetBounds{};
  return {StatusCode::invalid_argument, "the vertices of a traced sheet must lie near their pixels' rays"};
}

}  // namespace sheet_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_INVERSE_DEPTH_HPP
