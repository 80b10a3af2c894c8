// SPDX-License-Identifier: Apache-2.0
// The tiles of a sheet's ray structure: which faces of 4x4 quads there are, and the slab that holds them.
//
// The plane of a tile has the mean slope of its neighbouring vertices (the least-squares plane where no face is
// missing), its slab is the narrowest about it; roads and facades are planes in inverse depth as well, so their slabs
// are thin. Cost: about 1 ns a pixel. Memory: none.
// Error: a sample lies in its slab to within 2^-20 (w + 4 |gx| + 4 |gy|), w the greatest of the tile.
#ifndef NPSIM_TRACE_SHEET_SLAB_HPP
#define NPSIM_TRACE_SHEET_SLAB_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include "npsim/core/sheet_layer.hpp"
#include "npsim/simd/isa.hpp"
#include "npsim/trace/sheet_layout.hpp"

namespace npsim {
inline namespace v1 {

inline namespace NPSIM_ISA_NAMESPACE {
namespace sheet_detail {

// The faces of the tile at quad (x, y) whose vertices are all there, as in SheetTiles; used: the vertices that
// they have, bit 5 j + i.
[[nodiscard]] inline std::uint32_t tile_faces(const SheetTrace& sheet, int x, int y, std::uint32_t& used) noexcept {
  std::uint32_t faces = 0;
  used = 0;
  const int columns = std::min(4, sheet.quads.width() - x);
  const int rows = std::min(4, sheet.quads.height() - y);
  for (int j = 0; j < rows; ++j) {
    const std::uint8_t* quads = sheet.quads.row(y + j) + x;
    const float* upper = sheet.inverse_depth.row(y + j) + x;
    const float* lower = upper + sheet.inverse_depth.stride();
    for (int i = 0; i < columns; ++i) {
      const unsigned quad = quads[i];
      const bool corner[4] = {upper[i] > 0.0F, upper[i + 1] > 0.0F, lower[i] > 0.0F, lower[i + 1] > 0.0F};
      const auto at = static_cast<unsigned>(5 * j + i);
      for (const bool is_upper : {true, false}) {
        if ((quad & (is_upper ? kQuadUpperFace : kQuadLowerFace)) == 0) continue;
        const Face f = quad_face((quad & kQuadAntiDiagonal) != 0, is_upper, 0, 1, 2, 3);
        if (!corner[f.a] || !corner[f.b] || !corner[f.c]) continue;
        faces |= 1U << static_cast<unsigned>(4 * j + i + (is_upper ? 0 : 16));
        for (const std::uint32_t c : {f.a, f.b, f.c}) used |= 1U << (at + (c & 1U) + 5U * (c >> 1U));
      }
    }
  }
  return faces;
}

struct Slab {
  float base, gx, gy, half;
  float low, high;  // of w itself
};

// The slab of a tile from its 5x5 samples, all of them used.
[[nodiscard]] inline Slab whole_slab(const float* w, std::ptrdiff_t stride) noexcept {
  float columns[5] = {};
  float rows[5] = {};
  for (int j = 0; j < 5; ++j) {
    for (int i = 0; i < 5; ++i) {
      columns[i] += w[j * stride + i];
      rows[j] += w[j * stride + i];
    }
  }
  Slab s{};
  s.gx = (2.0F * (columns[4] - columns[0]) + (columns[3] - columns[1])) * 0.02F;
  s.gy = (2.0F * (rows[4] - rows[0]) + (rows[3] - rows[1])) * 0.02F;
  float least = std::numeric_limits<float>::infinity();
  float greatest = -least;
  s.low = least;
  s.high = greatest;
  for (int j = 0; j < 5; ++j) {
    for (int i = 0; i < 5; ++i) {
      const float value = w[j * stride + i];
      const float rest = value - s.gx * static_cast<float>(i) - s.gy * static_cast<float>(j);
      least = rest < least ? rest : least;
      greatest = rest > greatest ? rest : greatest;
      s.low = value < s.low ? value : s.low;
      s.high = value > s.high ? value : s.high;
    }
  }
  s.base = 0.5F * (least + greatest);
  s.half = 0.5F * (greatest - least);
  return s;
}

// The same from some of the samples.
[[nodiscard]] inline Slab partial_slab(const float* w, std::ptrdiff_t stride, std::uint32_t used) noexcept {
  const float inf = std::numeric_limits<float>::infinity();
  Slab s{0, 0, 0, -inf, inf, -inf};
  if (used == 0) return s;
  float sums[2] = {};
  int pairs[2] = {};
  const auto has = [used](int i, int j) {
    return i < 5 && j < 5 && (used >> static_cast<unsigned>(5 * j + i) & 1U) != 0;
  };
  for (int j = 0; j < 5; ++j) {
    for (int i = 0; i < 5; ++i) {
      if (!has(i, j)) continue;
      const float value = w[j * stride + i];
      s.low = std::min(s.low, value);
      s.high = std::max(s.high, value);
      if (has(i + 1, j)) {
        sums[0] += w[j * stride + i + 1] - value;
        ++pairs[0];
      }
      if (has(i, j + 1)) {
        sums[1] += w[(j + 1) * stride + i] - value;
        ++pairs[1];
      }
    }
  }
  s.gx = pairs[0] > 0 ? sums[0] / static_cast<float>(pairs[0]) : 0.0F;
  s.gy = pairs[1] > 0 ? sums[1] / static_cast<float>(pairs[1]) : 0.0F;
  float least = inf;
  float greatest = -inf;
  for (int j = 0; j < 5; ++j) {
    for (int i = 0; i < 5; ++i) {
      if (!has(i, j)) continue;
      const float rest = w[j * stride + i] - s.gx * static_cast<float>(i) - s.gy * static_cast<float>(j);
      least = std::min(least, rest);
      greatest = std::max(greatest, rest);
    }
  }
  s.base = 0.5F * (least + greatest);
  s.half = 0.5F * (greatest - least);
  return s;
}

// Whether the tile at quad (x, y) has all its faces, as far as the quads say.
[[nodiscard]] inline bool is_full(const SheetTrace& sheet, int x, int y) noexcept {
  constexpr std::uint32_t kAll = 0x01010101U * (kQuadUpperFace | kQuadLowerFace);
  if (x + 4 > sheet.quads.width() || y + 4 > sheet.quads.height()) return false;
  std::uint32_t all = kAll;
  for (int j = 0; j < 4; ++j) {
    std::uint32_t row = 0;
    std::memcpy(&row, sheet.quads.row(y + j) + x, sizeof row);
    all &= row;
  }
  return all == kAll;
}

// The 16 tiles at quad (x, y), and the bounds of w in them.
inline void build_tiles(const SheetTrace& sheet, int x, int y, SheetTiles& out, float& low, float& high) noexcept {
  low = std::numeric_limits<float>::infinity();
  high = -low;
  for (int k = 0; k < 16; ++k) {
    const int tx = x + 4 * (k % 4);
    const int ty = y + 4 * (k / 4);
    const float* w = sheet.inverse_depth.row(ty) + tx;
    const std::ptrdiff_t stride = sheet.inverse_depth.stride();
    Slab s{};
    bool whole = is_full(sheet, tx, ty);
    if (whole) {
      s = whole_slab(w, stride);
      whole = s.low > 0.0F;
      out.faces[k] = ~0U;
    }
    if (!whole) {
      std::uint32_t used = 0;
      out.faces[k] = tile_faces(sheet, tx, ty, used);
      s = partial_slab(w, stride, used);
    }
    out.base[k] = s.base;
    out.gx[k] = s.gx;
    out.gy[k] = s.gy;
    out.half[k] = s.half;
    low = std::min(low, s.low);
    high = std::max(high, s.high);
  }
}

}  // namespace sheet_detail
}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_TRACE_SHEET_SLAB_HPP
