// SPDX-License-Identifier: Apache-2.0
// PNG encoder for 8 and 16 bits a sample: rows filtered by the smallest sum of absolute differences, one IDAT.
//
// Source: PNG specification (ISO/IEC 15948) sections 9 and 11. The same pixels always give the same bytes.
// Memory: the raw image twice. Limit: 2^31 - 1 raw bytes, that of the compressor's interface.
#ifndef NPSIM_IO_DETAIL_PNG_ENCODE_HPP
#define NPSIM_IO_DETAIL_PNG_ENCODE_HPP

#include <algorithm>
#include <climits>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <string>

#include "npsim/core/image_view.hpp"
#include "npsim/io/detail/picture_structure.hpp"
#include "npsim/io/detail/stb.hpp"
#include "npsim/io/error.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

inline void append_big_endian_32(Bytes& out, std::uint32_t v) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<unsigned char>((v >> shift) & 0xFFU));
}

inline void append_chunk(Bytes& out, const char* name, const unsigned char* data, std::size_t bytes) {
  append_big_endian_32(out, static_cast<std::uint32_t>(bytes));
  const std::size_t start = out.size();
  for (int i = 0; i < 4; ++i) out.push_back(static_cast<unsigned char>(name[i]));
  out.insert(out.end(), data, data + bytes);
  append_big_endian_32(out, crc32(out.data() + start, bytes + 4));
}

[[nodiscard]] constexpr int paeth(int left, int above, int above_left) noexcept {
  const int p = left + above - above_left;
  const int a = p > left ? p - left : left - p;
  const int b = p > above ? p - above : above - p;
  const int c = p > above_left ? p - above_left : above_left - p;
  if (a <= b && a <= c) return left;
  return b <= c ? above : above_left;
}

// One filtered row. `above` is that of zeros for the first row; both have pixel_bytes zeros before them. Returns the
// sum of absolute (signed) differences.
template <class Predict>
std::size_t filter_row(const unsigned char* row, const unsigned char* above, std::size_t bytes, std::size_t pixel_bytes,
                       unsigned char* out, const Predict& predict) {
  const unsigned char* const left = row - pixel_bytes;
  const unsigned char* const above_left = above - pixel_bytes;
  std::size_t sum = 0;
  for (std::size_t i = 0; i < bytes; ++i) {
    const int predicted = predict(left[i], above[i], above_left[i]);
    const auto difference = static_cast<unsigned char>((row[i] - predicted) & 0xFF);
    out[i] = difference;
    sum += difference < 128 ? difference : 256U - difference;
  }
  return sum;
}

// By number: none, left, up, their mean, Paeth's.
inline std::size_t filter_row(int filter, const unsigned char* row, const unsigned char* above, std::size_t bytes,
                              std::size_t pixel_bytes, unsigned char* out) {
  const auto by = [&](const auto& predict) { return filter_row(row, above, bytes, pixel_bytes, out, predict); };
  switch (filter) {
    case 1: return by([](int left, int, int) { return left; });
    case 2: return by([](int, int up, int) { return up; });
    case 3: return by([](int left, int up, int) { return (left + up) / 2; });
    case 4: return by([](int left, int up, int up_left) { return paeth(left, up, up_left); });
    default: return by([](int, int, int) { return 0; });
  }
}

// fill_row(y, bytes) writes row y as PNG samples (16-bit ones big-endian).
template <class FillRow>
Expected<Bytes> encode_png(const std::string& path, Shape shape, int bit_depth, int color_type, int channels,
                           FillRow&& fill_row) {
  if (shape.empty()) return Error{path, "size", "the image is empty: expected at least 1x1 pixels"};
  const std::size_t pixel_bytes = static_cast<std::size_t>(channels) * static_cast<std::size_t>(bit_depth / 8);
  const std::size_t row_bytes = pixel_bytes * static_cast<std::size_t>(shape.width);
  if (row_bytes + 1 > static_cast<std::size_t>(INT_MAX) / static_cast<std::size_t>(shape.height)) {
    return Error{path, "size", "the image is too large: expected less than 2 GiB of raw PNG data"};
  }
  Bytes filtered((row_bytes + 1) * static_cast<std::size_t>(shape.height));
  Bytes current(pixel_bytes + row_bytes);
  Bytes previous(pixel_bytes + row_bytes);
  Bytes candidate(row_bytes);
  for (int y = 0; y < shape.height; ++y) {
    fill_row(y, current.data() + pixel_bytes);
    unsigned char* out = filtered.data() + static_cast<std::size_t>(y) * (row_bytes + 1);
    std::size_t best = ~std::size_t{0};
    for (int filter = 0; filter < 5; ++filter) {
      const std::size_t sum = filter_row(filter, current.data() + pixel_bytes, previous.data() + pixel_bytes, row_bytes,
                                         pixel_bytes, candidate.data());
      if (sum >= best) continue;
      best = sum;
      out[0] = static_cast<unsigned char>(filter);
      std::copy(candidate.begin(), candidate.end(), out + 1);
    }
    current.swap(previous);
  }
  constexpr int kCompression = 8;  // stb's default effort
  int compressed_bytes = 0;
  const std::unique_ptr<unsigned char, decltype(&std::free)> compressed(
      stb::stbi_zlib_compress(filtered.data(), static_cast<int>(filtered.size()), &compressed_bytes, kCompression),
      &std::free);
  if (compressed == nullptr) return Error{path, "", "could not be compressed: expected more free memory"};

  Bytes out(kPngSignature.begin(), kPngSignature.end());
  out.reserve(out.size() + static_cast<std::size_t>(compressed_bytes) + 64);
  Bytes header;
  append_big_endian_32(header, static_cast<std::uint32_t>(shape.width));
  append_big_endian_32(header, static_cast<std::uint32_t>(shape.height));
  header.push_back(static_cast<unsigned char>(bit_depth));
  header.push_back(static_cast<unsigned char>(color_type));
  header.insert(header.end(), 3, 0);  // deflate, adaptive filters, not interlaced
  append_chunk(out, "IHDR", header.data(), header.size());
  append_chunk(out, "IDAT", compressed.get(), static_cast<std::size_t>(compressed_bytes));
  append_chunk(out, "IEND", nullptr, 0);
  return out;
}

}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_PNG_ENCODE_HPP
