// SPDX-License-Identifier: Apache-2.0
// Radiance HDR (RGBE) out: linear RGB with one shared exponent a pixel, scan lines run-length encoded.
//
// Source: G. Ward, "Real Pixels", Graphics Gems II (1991), and the Radiance file format description. Error: the largest
// channel of a pixel is off by at most 1/256 of itself, the others by the same absolute amount. Negative values and NaN
// become 0, values beyond 1.69e38 are held there. The picture keeps its unit; the header says that it is linear RGB.
#ifndef NPSIM_IO_HDR_HPP
#define NPSIM_IO_HDR_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/error.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

// Mantissas are m / 256 * 2^(e - 128); rounded to nearest, with a carry into the exponent.
[[nodiscard]] inline std::array<std::uint8_t, 4> rgbe(const Vec3f& rgb) noexcept {
  // Below 255/256 of 2^127, so that rounding never carries into an exponent byte that does not exist.
  const auto held = [](float v) { return v > 0.0F ? std::min(v, 1.69e38F) : 0.0F; };  // NaN fails the comparison
  const float c[3] = {held(rgb.x), held(rgb.y), held(rgb.z)};
  const float largest = std::max(c[0], std::max(c[1], c[2]));
  if (largest < 1e-38F) return {0, 0, 0, 0};
  int exponent = 0;
  std::frexp(largest, &exponent);
  if (std::lround(std::ldexp(largest, 8 - exponent)) > 255) ++exponent;
  std::array<std::uint8_t, 4> out{};
  for (std::size_t i = 0; i < 3; ++i) out[i] = static_cast<std::uint8_t>(std::lround(std::ldexp(c[i], 8 - exponent)));
  out[3] = static_cast<std::uint8_t>(exponent + 128);
  return out;
}

// One channel of one scan line: runs of 4..127 equal bytes as (128 + n, byte), other bytes as (n <= 128, bytes...).
inline void append_run_lengths(Bytes& out, const Bytes& line) {
  constexpr std::size_t kShortestRun = 4;
  std::size_t at = 0;
  const auto run_at = [&](std::size_t i) {
    std::size_t n = 1;
    while (i + n < line.size() && n < 127 && line[i + n] == line[i]) ++n;
    return n;
  };
  while (at < line.size()) {
    std::size_t literal = 0;
    while (at + literal < line.size() && literal < 128 && run_at(at + literal) < kShortestRun) ++literal;
    if (literal > 0) {
      out.push_back(static_cast<unsigned char>(literal));
      out.insert(out.end(), line.begin() + static_cast<std::ptrdiff_t>(at),
                 line.begin() + static_cast<std::ptrdiff_t>(at + literal));
      at += literal;
      continue;
    }
    const std::size_t run = run_at(at);
    out.push_back(static_cast<unsigned char>(128 + run));
    out.push_back(line[at]);
    at += run;
  }
}

}  // namespace detail

inline Outcome write_hdr(const std::string& path, ImageView<const Vec3f> image) {
  return guarded(path, [&]() -> Outcome {
    if (image.empty()) return Error{path, "size", "the image is empty: expected at least 1x1 pixels"};
    const std::string header = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " + std::to_string(image.height()) + " +X " +
                               std::to_string(image.width()) + "\n";
    Bytes out(header.begin(), header.end());
    const bool encoded = image.width() >= 8 && image.width() < 32768;  // what the run-length form can express
    const auto width = static_cast<std::size_t>(image.width());
    std::array<Bytes, 4> lines;
    for (auto& line : lines) line.resize(width);
    for (int y = 0; y < image.height(); ++y) {
      for (std::size_t x = 0; x < width; ++x) {
        const auto pixel = detail::rgbe(image(static_cast<int>(x), y));
        for (std::size_t c = 0; c < 4; ++c) lines[c][x] = pixel[c];
        if (!encoded) out.insert(out.end(), pixel.begin(), pixel.end());
      }
      if (!encoded) continue;
      out.push_back(2);
      out.push_back(2);
      out.push_back(static_cast<unsigned char>(width / 256));
      out.push_back(static_cast<unsigned char>(width % 256));
      for (const auto& line : lines) detail::append_run_lengths(out, line);
    }
    return write_file(path, out.data(), out.size());
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_HDR_HPP
