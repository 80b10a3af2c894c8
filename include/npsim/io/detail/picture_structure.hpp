// SPDX-License-Identifier: Apache-2.0
// The structure of PNG and JPEG files, checked before decoding: what they claim to hold, and whether they are whole.
//
// stb ignores PNG checksums and fills what a truncated JPEG lacks with grey, so a damaged file would pass as a picture.
// Sources: PNG specification (ISO/IEC 15948) sections 5 and 11.2; JPEG (ITU-T T.81) annex B. Cost: one pass.
#ifndef NPSIM_IO_DETAIL_PICTURE_STRUCTURE_HPP
#define NPSIM_IO_DETAIL_PICTURE_STRUCTURE_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/error.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

[[nodiscard]] constexpr std::uint32_t big_endian_32(const unsigned char* b) noexcept {
  return (static_cast<std::uint32_t>(b[0]) << 24) | (static_cast<std::uint32_t>(b[1]) << 16) |
         (static_cast<std::uint32_t>(b[2]) << 8) | static_cast<std::uint32_t>(b[3]);
}

[[nodiscard]] constexpr std::array<std::uint32_t, 256> make_crc_table() noexcept {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t n = 0; n < 256; ++n) {
    std::uint32_t c = n;
    for (int bit = 0; bit < 8; ++bit) c = (c & 1U) != 0 ? 0xEDB88320U ^ (c >> 1) : c >> 1;
    table[n] = c;
  }
  return table;
}
inline constexpr std::array<std::uint32_t, 256> kCrcTable = make_crc_table();

// CRC-32 of PNG annex D.
[[nodiscard]] inline std::uint32_t crc32(const unsigned char* data, std::size_t bytes) noexcept {
  std::uint32_t c = 0xFFFFFFFFU;
  for (std::size_t i = 0; i < bytes; ++i) c = kCrcTable[(c ^ data[i]) & 0xFFU] ^ (c >> 8);
  return c ^ 0xFFFFFFFFU;
}

inline constexpr std::array<unsigned char, 8> kPngSignature = {0x89, 'P', 'N', 'G', 0x0D, 0x0A, 0x1A, 0x0A};

// Starts like a PNG (so that a file truncated inside the signature is still called a truncated PNG).
[[nodiscard]] inline bool looks_like_png(const Bytes& b) noexcept {
  for (std::size_t i = 0; i < kPngSignature.size() && i < b.size(); ++i) {
    if (b[i] != kPngSignature[i]) return false;
  }
  return !b.empty();
}
[[nodiscard]] inline bool looks_like_jpeg(const Bytes& b) noexcept {
  return b.size() >= 2 && b[0] == 0xFF && b[1] == 0xD8;
}

struct PngHeader {
  std::int64_t width = 0;   // px
  std::int64_t height = 0;  // px
  int bit_depth = 0;        // per sample: 1, 2, 4, 8, 16
  int color_type = 0;       // 0 grey, 2 RGB, 3 palette, 4 grey + alpha, 6 RGBA
};

[[nodiscard]] inline std::string describe(const PngHeader& h) {
  const char* kind = "unknown";
  switch (h.color_type) {
    case 0: kind = "grey"; break;
    case 2: kind = "3-channel RGB"; break;
    case 3: kind = "palette"; break;
    case 4: kind = "grey with alpha"; break;
    case 6: kind = "4-channel RGBA"; break;
    default: break;
  }
  return std::to_string(h.bit_depth) + "-bit " + kind + " PNG";
}

// IHDR alone: enough to refuse a size before the rest is looked at.
inline Expected<PngHeader> png_header(const std::string& path, const Bytes& b) {
  if (b.size() < 33) return Error{path, "IHDR", "is cut off: expected a PNG header of 33 bytes"};
  if (!looks_like_png(b)) return Error{path, "signature", "is not that of a PNG file"};
  const unsigned char* p = b.data() + 8;
  if (big_endian_32(p) != 13 || p[4] != 'I' || p[5] != 'H' || p[6] != 'D' || p[7] != 'R') {
    return Error{path, "IHDR", "is missing: expected it as the first chunk of 13 bytes"};
  }
  if (crc32(p + 4, 17) != big_endian_32(p + 21))
    return Error{path, "IHDR", "has a wrong checksum: expected an intact file"};
  PngHeader h;
  h.width = big_endian_32(p + 8);
  h.height = big_endian_32(p + 12);
  h.bit_depth = p[16];
  h.color_type = p[17];
  return h;
}

// Every chunk lies inside the file with the right checksum, and the last one is IEND.
inline Outcome check_png_chunks(const std::string& path, const Bytes& b) {
  std::size_t at = kPngSignature.size();
  while (b.size() - at >= 12) {
    const std::size_t length = big_endian_32(b.data() + at);
    const std::string name(reinterpret_cast<const char*>(b.data() + at + 4), 4);
    bool letters = true;
    for (const char c : name) letters = letters && ((c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z'));
    if (!letters)
      return Error{path, "chunk at byte " + std::to_string(at), "has no valid name: expected an intact PNG"};
    if (length > b.size() - at - 12) return Error{path, name, "is cut off: expected a complete PNG"};
    if (crc32(b.data() + at + 4, length + 4) != big_endian_32(b.data() + at + 8 + length)) {
      return Error{path, name, "has a wrong checksum: expected an intact file"};
    }
    if (name == "IEND") return Done{};
    at += length + 12;
  }
  return Error{path, "IEND", "is missing: the file is cut off, expected a complete PNG"};
}

// Huffman tables of a DHT segment, `length` bytes at `at`: at most 256 symbols each, all inside the segment.
[[nodiscard]] inline bool huffman_tables_fit(const Bytes& b, std::size_t at, std::size_t length) noexcept {
  while (length > 0) {
    if (length < 17) return false;
    std::size_t symbols = 0;
    for (std::size_t i = 1; i <= 16; ++i) symbols += b[at + i];
    if (symbols > 256 || symbols > length - 17) return false;
    at += 17 + symbols;
    length -= 17 + symbols;
  }
  return true;
}

// Marker segments lie inside the file, Huffman tables fit (the decoder does not check), and after the scans comes the
// end-of-image marker. Segments are skipped by their lengths as the decoder does, so that it meets no others.
inline Outcome check_jpeg_segments(const std::string& path, const Bytes& b) {
  const Error cut{path, "JPEG data", "is cut off: expected a complete JPEG with an end-of-image marker"};
  std::size_t at = 2;
  while (at + 1 < b.size()) {
    const unsigned char marker = b[at + 1];
    if (b[at] != 0xFF || marker == 0xFF) {  // entropy-coded data, or a fill byte
      ++at;
      continue;
    }
    if (marker == 0xD9) return Done{};
    if (marker <= 0x01 || (marker >= 0xD0 && marker <= 0xD8)) {  // stands alone, without a length
      at += 2;
      continue;
    }
    if (at + 3 >= b.size()) return cut;
    const std::size_t length = static_cast<std::size_t>(b[at + 2]) * 256 + b[at + 3];
    if (length < 2) {
      return Error{path, "JPEG segment at byte " + std::to_string(at), "has a length below 2: expected an intact file"};
    }
    if (length > b.size() - at - 2) return cut;
    if (marker == 0xC4 && !huffman_tables_fit(b, at + 4, length - 2)) {
      return Error{path, "JPEG Huffman table at byte " + std::to_string(at),
                   "does not fit its segment: expected an intact file"};
    }
    at += 2 + length;
  }
  return cut;
}

}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_PICTURE_STRUCTURE_HPP
