// SPDX-License-Identifier: Apache-2.0
// Which faces a tile of 4x4 quads has (sheet_layout.hpp), all of them at once, one bit each.
//
// A face is there where its quad says so and its three vertices are there. Numbers of 16 bits stand for quads, in
// raster order, numbers of 25 for vertices: bit 5 j + i. Same bits for any byte order. Cost: a tile with all its faces
// 10 instructions, any other about 100, without branches. Memory: none.
#ifndef NPSIM_TRACE_DETAIL_SHEET_FACES_HPP
#define NPSIM_TRACE_DETAIL_SHEET_FACES_HPP

#include <algorithm>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "npsim/geometry/sheet_layer.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace sheet_layout {

inline constexpr std::uint32_t kAllVertices = (1U << 25U) - 1U;
inline constexpr std::uint32_t kAllFaces = ~0U;

struct TileFaces {
  std::uint32_t faces;  // as in SheetRelief
  std::uint32_t used;   // the vertices that they have
};

// Bit `bit` of four bytes, the lowest byte's first.
[[nodiscard]] constexpr std::uint32_t bit_of_bytes(std::uint32_t bytes, unsigned bit) noexcept {
  return ((bytes >> bit & 0x01010101U) * 0x01020408U) >> 24U & 0xFU;
}

// The quads whose upper left corner is among the vertices, and the other way round.
[[nodiscard]] constexpr std::uint32_t quads_at(std::uint32_t vertices) noexcept {
  return (vertices & 0xFU) | (vertices >> 1U & 0xF0U) | (vertices >> 2U & 0xF00U) | (vertices >> 3U & 0xF000U);
}
[[nodiscard]] constexpr std::uint32_t vertices_at(std::uint32_t quads) noexcept {
  return (quads & 0xFU) | (quads & 0xF0U) << 1U | (quads & 0xF00U) << 2U | (quads & 0xF000U) << 3U;
}

// The tile at quad (x, y), of whose vertices `there` are there.
[[nodiscard]] inline TileFaces tile_faces(const ImageView<const std::uint8_t>& quads, int x, int y,
                                          std::uint32_t there) noexcept {
  constexpr std::uint32_t kBoth = kQuadUpperFace | kQuadLowerFace;
  const int rows = std::min(4, quads.height() - y);
  std::uint32_t row[4] = {};
  if (x + 4 <= quads.width()) {
    for (int j = 0; j < rows; ++j) {
      const std::uint8_t* q = quads.row(y + j) + x;
      row[j] = q[0] | static_cast<std::uint32_t>(q[1]) << 8U | static_cast<std::uint32_t>(q[2]) << 16U |
               static_cast<std::uint32_t>(q[3]) << 24U;
    }
  } else {
    for (int j = 0; j < rows; ++j) {
      for (int i = 0; x + i < quads.width(); ++i) {
        row[j] |= static_cast<std::uint32_t>(quads(x + i, y + j)) << static_cast<unsigned>(8 * i);
      }
    }
  }
  if ((~(row[0] & row[1] & row[2] & row[3]) & 0x01010101U * kBoth) == 0 && there == kAllVertices) {
    return {kAllFaces, kAllVertices};
  }
  std::uint32_t anti = 0;
  std::uint32_t upper = 0;
  std::uint32_t lower = 0;
  for (unsigned j = 0; j < 4; ++j) {
    anti |= bit_of_bytes(row[j], 0) << 4 * j;
    upper |= bit_of_bytes(row[j], 1) << 4 * j;
    lower |= bit_of_bytes(row[j], 2) << 4 * j;
  }
  // Corners A, B above C, D. The diagonal is A-D or, where `anti`, B-C.
  const std::uint32_t a = quads_at(there);
  const std::uint32_t b = quads_at(there >> 1U);
  const std::uint32_t c = quads_at(there >> 5U);
  const std::uint32_t d = quads_at(there >> 6U);
  upper &= a & b & ((anti & c) | (~anti & d));
  lower &= c & d & ((anti & b) | (~anti & a));
  return {upper | lower << 16U, vertices_at(upper | (lower & ~anti)) | vertices_at(upper | (lower & anti)) << 1U |
                                    vertices_at(lower | (upper & anti)) << 5U |
                                    vertices_at(lower | (upper & ~anti)) << 6U};
}

}  // namespace sheet_layout
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_FACES_HPP
