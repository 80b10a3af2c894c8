// SPDX-License-Identifier: Apache-2.0
// The orientation that a camera wrote into its picture (EXIF 2.3, tag 0x0112), and pictures turned by it.
//
// Value 1..8 says which side of the scene row 0 and column 0 are. Anything that is not a proper entry counts as 1:
// orientation is a hint beside the pixels, and a picture must not be lost for it.
#ifndef NPSIM_IO_DETAIL_EXIF_HPP
#define NPSIM_IO_DETAIL_EXIF_HPP

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>

#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/image.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

// Of a TIFF header and its first directory, `bytes` long.
[[nodiscard]] inline int tiff_orientation(const unsigned char* tiff, std::size_t bytes) noexcept {
  if (bytes < 14) return 1;
  const bool little = tiff[0] == 'I' && tiff[1] == 'I';
  if (!little && !(tiff[0] == 'M' && tiff[1] == 'M')) return 1;
  const auto two = [&](std::size_t at) -> std::size_t {
    return little ? tiff[at] | (std::size_t{tiff[at + 1]} << 8U) : (std::size_t{tiff[at]} << 8U) | tiff[at + 1];
  };
  const auto four = [&](std::size_t at) {
    return little ? two(at) | two(at + 2) << 16U : two(at) << 16U | two(at + 2);
  };
  const std::size_t directory = four(4);
  if (two(2) != 42 || directory > bytes - 2) return 1;
  const std::size_t entries = two(directory);
  for (std::size_t i = 0; i < entries; ++i) {
    const std::size_t at = directory + 2 + 12 * i;
    if (at + 12 > bytes) return 1;
    if (two(at) != 0x0112) continue;
    const std::size_t value = two(at + 8);
    return two(at + 2) == 3 && four(at + 4) == 1 && value >= 1 && value <= 8 ? static_cast<int>(value) : 1;
  }
  return 1;
}

// Of a JPEG whose segments lie inside the file (check_jpeg_segments).
[[nodiscard]] inline int jpeg_orientation(const Bytes& b) noexcept {
  std::size_t at = 2;
  while (at + 4 <= b.size() && b[at] == 0xFF && b[at + 1] != 0xDA) {
    const std::size_t length = std::size_t{b[at + 2]} * 256 + b[at + 3];
    if (length < 2 || length > b.size() - at - 2) return 1;
    if (b[at + 1] == 0xE1 && length >= 8 && std::memcmp(b.data() + at + 4, "Exif\0\0", 6) == 0) {
      return tiff_orientation(b.data() + at + 10, length - 8);
    }
    at += 2 + length;
  }
  return 1;
}

// Of a PNG whose chunks are whole (check_png_chunks): its eXIf chunk.
[[nodiscard]] inline int png_orientation(const Bytes& b) noexcept {
  std::size_t at = 8;
  while (at + 12 <= b.size()) {
    const std::size_t length =
        (std::size_t{b[at]} << 24U) | (std::size_t{b[at + 1]} << 16U) | (std::size_t{b[at + 2]} << 8U) | b[at + 3];
    if (length > b.size() - at - 12) return 1;
    if (std::memcmp(b.data() + at + 4, "eXIf", 4) == 0) return tiff_orientation(b.data() + at + 8, length);
    at += length + 12;
  }
  return 1;
}

// The picture as it is to be looked at. From 5 on rows and columns change places.
template <class T>
[[nodiscard]] Image<T> oriented(Image<T> in, int orientation) {
  if (orientation <= 1) return in;
  const bool turned = orientation >= 5;
  const Shape shape = turned ? Shape{in.height(), in.width()} : in.shape();
  const bool from_right = orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
  const bool from_below = orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
  Image<T> out(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const int i = turned ? y : x;
      const int j = turned ? x : y;
      out(x, y) = std::as_const(in)(from_right ? in.width() - 1 - i : i, from_below ? in.height() - 1 - j : j);
    }
  }
  return out;
}

}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_EXIF_HPP
