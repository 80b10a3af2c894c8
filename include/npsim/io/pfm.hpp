// SPDX-License-Identifier: Apache-2.0
// PFM, the portable float map: 1 ("Pf") or 3 ("PF") channels of 32-bit floats, rows from the bottom up.
//
// Header: magic, width, height, scale, separated by white space, one white space before the data. A negative scale
// means little-endian; its magnitude is ignored, as all readers in use do. Values are read as they are, NaN included;
// the file has to be exactly as long as its header says. Written files are little-endian with scale -1.
#ifndef NPSIM_IO_PFM_HPP
#define NPSIM_IO_PFM_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>

#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

static_assert(sizeof(Vec3f) == 12 && sizeof(float) == 4, "three packed floats a pixel");

struct PfmHeader {
  Shape shape;
  int channels = 1;
  bool little_endian = true;
  std::size_t data_at = 0;  // byte
};

[[nodiscard]] inline bool looks_like_pfm(const Bytes& b) noexcept {
  return b.size() >= 2 && b[0] == 'P' && (b[1] == 'F' || b[1] == 'f');
}

inline Expected<PfmHeader> pfm_header(const std::string& path, const Bytes& b, const ReadLimits& limits) {
  if (!looks_like_pfm(b)) return Error{path, "magic", "is not PF or Pf, expected a PFM file"};
  PfmHeader header;
  header.channels = b[1] == 'F' ? 3 : 1;
  const auto space = [](unsigned char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; };
  const char* const names[3] = {"width", "height", "scale"};
  double values[3] = {0, 0, 0};
  std::size_t at = 2;
  for (int i = 0; i < 3; ++i) {
    if (at >= b.size() || !space(b[at])) return Error{path, names[i], "is missing, expected white space and a number"};
    while (at < b.size() && space(b[at])) ++at;
    std::string token;
    while (at < b.size() && !space(b[at]) && token.size() < 32) token += static_cast<char>(b[at++]);
    char* end = nullptr;
    values[i] = std::strtod(token.c_str(), &end);
    const bool whole = i == 2 || values[i] == std::floor(values[i]);
    if (token.empty() || end != token.c_str() + token.size() || !std::isfinite(values[i]) || !whole) {
      return Error{path, names[i], "is '" + token + "', expected a " + (i == 2 ? "finite" : "whole") + " number"};
    }
    if (i < 2 && std::fabs(values[i]) > 1e9) return Error{path, names[i], "is " + token + ", expected a sane size"};
  }
  if (values[2] == 0) return Error{path, "scale", "is 0, expected a negative (little-endian) or positive number"};
  if (at >= b.size() || !space(b[at])) return Error{path, "data", "is missing, expected it after one white space"};
  header.little_endian = values[2] < 0;
  header.data_at = at + 1;
  const auto shape = checked_shape(path, static_cast<std::int64_t>(values[0]), static_cast<std::int64_t>(values[1]),
                                   4U * static_cast<std::size_t>(header.channels), limits);
  if (!shape) return shape.error();
  header.shape = shape.value();
  const std::size_t expected = header.shape.pixels() * 4 * static_cast<std::size_t>(header.channels);
  const std::size_t found = b.size() - header.data_at;
  if (found != expected) {
    return Error{path, "data",
                 std::to_string(found) + " bytes, expected " + std::to_string(expected) + " for " +
                     size_text(header.shape) + " pixels of " + std::to_string(header.channels) + " floats"};
  }
  return header;
}

[[nodiscard]] inline float float_from_bytes(const unsigned char* b, bool little_endian) noexcept {
  std::uint32_t bits = 0;
  for (int i = 0; i < 4; ++i) bits |= static_cast<std::uint32_t>(b[little_endian ? i : 3 - i]) << (8 * i);
  float value = 0;
  std::memcpy(&value, &bits, 4);
  return value;
}

inline void append_little_endian(Bytes& out, float value) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, 4);
  append_little(out, bits, 4);
}

// Pixels of T, which is `channels` floats.
template <class T>
Expected<Image<T>> read_pfm_pixels(const std::string& path, int channels, const ReadLimits& limits) {
  return guarded(path, [&]() -> Expected<Image<T>> {
    const Expected<Bytes> file = read_file_bytes(path, limits);
    if (!file) return file.error();
    const Expected<PfmHeader> found = pfm_header(path, file.value(), limits);
    if (!found) return found.error();
    const PfmHeader& header = found.value();
    if (header.channels != channels) {
      return Error{path, "magic",
                   "says " + std::to_string(header.channels) + " channels, expected " + std::to_string(channels)};
    }
    Image<T> image(header.shape);
    const auto row_floats = static_cast<std::size_t>(header.shape.width) * static_cast<std::size_t>(channels);
    const unsigned char* at = file.value().data() + header.data_at;
    for (int y = header.shape.height - 1; y >= 0; --y) {
      auto* row = reinterpret_cast<unsigned char*>(image.view().row(y));
      for (std::size_t i = 0; i < row_floats; ++i, at += 4) {
        const float value = float_from_bytes(at, header.little_endian);
        std::memcpy(row + 4 * i, &value, 4);
      }
    }
    return image;
  });
}

template <class T>
Outcome write_pfm_pixels(const std::string& path, ImageView<const T> image, int channels) {
  return guarded(path, [&]() -> Outcome {
    if (image.empty()) return Error{path, "size", "the image is empty: expected at least 1x1 pixels"};
    const std::string text = std::string(channels == 3 ? "PF\n" : "Pf\n") + std::to_string(image.width()) + " " +
                             std::to_string(image.height()) + "\n-1.0\n";
    Bytes out(text.begin(), text.end());
    out.reserve(out.size() + image.shape().pixels() * sizeof(T));
    for (int y = image.height() - 1; y >= 0; --y) {
      for (int x = 0; x < image.width(); ++x) {
        if constexpr (sizeof(T) == 12) {
          append_little_endian(out, image(x, y).x);
          append_little_endian(out, image(x, y).y);
          append_little_endian(out, image(x, y).z);
        } else {
          append_little_endian(out, image(x, y));
        }
      }
    }
    return write_file(path, out.data(), out.size());
  });
}

}  // namespace detail

inline Expected<Image<float>> read_pfm(const std::string& path, const ReadLimits& limits = {}) {
  return detail::read_pfm_pixels<float>(path, 1, limits);
}
inline Expected<Image<Vec3f>> read_pfm_rgb(const std::string& path, const ReadLimits& limits = {}) {
  return detail::read_pfm_pixels<Vec3f>(path, 3, limits);
}
inline Outcome write_pfm(const std::string& path, ImageView<const float> image) {
  return detail::write_pfm_pixels(path, image, 1);
}
inline Outcome write_pfm(const std::string& path, ImageView<const Vec3f> image) {
  return detail::write_pfm_pixels(path, image, 3);
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_PFM_HPP
