// SPDX-License-Identifier: Apache-2.0
// What a reader refuses before it decodes: images too large to be meant, and files too large for the memory granted.
#ifndef NPSIM_IO_DETAIL_LIMITS_HPP
#define NPSIM_IO_DETAIL_LIMITS_HPP

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include "npsim/core/image_view.hpp"
#include "npsim/io/error.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

struct ReadLimits {
  int max_side = 16384;                          // px
  std::size_t max_bytes = std::size_t{1} << 30;  // one decoded plane, and one file before decoding
};

// A double as a float, infinite where it does not fit (the plain conversion is undefined there).
[[nodiscard]] inline float narrowed(double v) noexcept {
  constexpr double kMost = static_cast<double>(std::numeric_limits<float>::max());
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  return v > kMost ? kInfinity : v < -kMost ? -kInfinity : static_cast<float>(v);
}

[[nodiscard]] inline std::string size_text(std::int64_t width, std::int64_t height) {
  return std::to_string(width) + "x" + std::to_string(height);
}
[[nodiscard]] inline std::string size_text(Shape shape) { return size_text(shape.width, shape.height); }

// Whether width x height pixels of bytes_per_pixel may be decoded. The shape has passed through no narrower type yet.
inline Expected<Shape> checked_shape(const std::string& path, std::int64_t width, std::int64_t height,
                                     std::size_t bytes_per_pixel, const ReadLimits& limits) {
  if (width <= 0 || height <= 0) {
    return Error{path, "size", size_text(width, height) + " pixels, expected at least 1x1"};
  }
  if (width > limits.max_side || height > limits.max_side) {
    return Error{path, "size",
                 size_text(width, height) + " pixels, expected at most " + std::to_string(limits.max_side) + " a side"};
  }
  const Shape shape{static_cast<int>(width), static_cast<int>(height)};
  if (shape.pixels() > limits.max_bytes / bytes_per_pixel) {
    return Error{path, "size",
                 size_text(shape) + " pixels of " + std::to_string(bytes_per_pixel) + " bytes, expected at most " +
                     std::to_string(limits.max_bytes) + " bytes decoded"};
  }
  return shape;
}

// One line where a plane differs in size from the image it belongs to.
inline Outcome expect_shape(const std::string& path, Shape found, Shape expected, const std::string& of_what) {
  if (found == expected) return Done{};
  return Error{path, "size",
               size_text(found) + " pixels, expected " + size_text(expected) + ", the size of " + of_what};
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_LIMITS_HPP
