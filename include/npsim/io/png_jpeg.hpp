// SPDX-License-Identifier: Apache-2.0
// PNG and JPEG in and out.
//
// Pictures (read_rgb8) take any PNG or JPEG: grey is spread over the channels, alpha is dropped, 16 bits are cut to 8.
// Planes of numbers (read_u8, read_u16) take a single-channel PNG of 8 or 16 bits and nothing else: values are never
// rescaled, and a file whose values would be changed by conversion is an error that says what it is.
// Every file is checked for size, wholeness and (PNG) checksums before decoding. A picture lies as its EXIF orientation
// says, planes of numbers as they are stored.
// Memory while reading: the file, the decoder's buffers (about twice the image) and the image.
#ifndef NPSIM_IO_PNG_JPEG_HPP
#define NPSIM_IO_PNG_JPEG_HPP

#include <array>
#include <climits>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <type_traits>
#include <utility>

#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/detail/exif.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/detail/picture_structure.hpp"
#include "npsim/io/detail/png_encode.hpp"
#include "npsim/io/detail/stb.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

using Rgba8 = std::array<std::uint8_t, 4>;
using Rgb16 = std::array<std::uint16_t, 3>;

namespace detail {

static_assert(sizeof(Rgb8) == 3 && sizeof(Rgba8) == 4 && sizeof(Rgb16) == 6, "pixels are packed");

// What the decoder needs besides pixels (its tables).
inline constexpr std::size_t kDecoderState = std::size_t{1} << 20;  // bytes

// Pixels of T as `channels` samples each, decoded by stb (8 or 16 bits a sample, as T has them).
template <class T>
Expected<Image<T>> decode(const std::string& path, const Bytes& bytes, Shape shape, int channels) {
  if (bytes.size() > static_cast<std::size_t>(INT_MAX)) {
    return Error{path, "file size", "more than 2 GiB, expected less"};
  }
  constexpr bool kWide = sizeof(T) == 6 || std::is_same_v<T, std::uint16_t>;
  // The largest buffer of an honest file: 8 bytes a pixel and one filter byte a row, doubled by the growing inflater.
  stb_allocation_limit() =
      kDecoderState + 2 * bytes.size() +
      (static_cast<std::size_t>(shape.width) * 8 + 64) * (static_cast<std::size_t>(shape.height) + 64) * 2;
  int width = 0;
  int height = 0;
  int found = 0;
  const auto* data = bytes.data();
  const int size = static_cast<int>(bytes.size());
  void* decoded = nullptr;
  if constexpr (kWide) {
    decoded = stb::stbi_load_16_from_memory(data, size, &width, &height, &found, channels);
  } else {
    decoded = stb::stbi_load_from_memory(data, size, &width, &height, &found, channels);
  }
  const std::unique_ptr<void, decltype(&std::free)> pixels(decoded, &std::free);
  if (pixels == nullptr) {
    const char* reason = stb::stbi_failure_reason();
    return Error{path, "image data",
                 std::string("cannot be decoded (") + (reason == nullptr ? "unknown" : reason) +
                     "): expected an intact PNG or JPEG"};
  }
  if (width != shape.width || height != shape.height) {
    return Error{path, "size",
                 size_text(width, height) + " decoded, expected " + size_text(shape) + " as in the header"};
  }
  Image<T> image(shape);
  std::memcpy(static_cast<void*>(image.data()), pixels.get(), shape.pixels() * sizeof(T));
  return image;
}

// A whole, intact PNG of an allowed size: its header. accept(header) says which kinds will do.
template <class Accept>
Expected<PngHeader> admitted_png(const std::string& path, const Bytes& bytes, std::size_t pixel_bytes,
                                 const ReadLimits& limits, const char* expected, Accept&& accept) {
  if (looks_like_jpeg(bytes)) return Error{path, "type", std::string("found a JPEG, expected ") + expected};
  if (!looks_like_png(bytes)) return Error{path, "type", std::string("found no PNG, expected ") + expected};
  const Expected<PngHeader> header = png_header(path, bytes);
  if (!header) return header.error();
  const PngHeader& h = header.value();
  if (!accept(h)) return Error{path, "type", "found " + describe(h) + ", expected " + expected};
  const Expected<Shape> shape = checked_shape(path, h.width, h.height, pixel_bytes, limits);
  if (!shape) return shape.error();
  const Outcome whole = check_png_chunks(path, bytes);
  if (!whole) return whole.error();
  return h;
}

[[nodiscard]] inline Shape shape_of(const PngHeader& h) {
  return {static_cast<int>(h.width), static_cast<int>(h.height)};
}

}  // namespace detail

inline Expected<Image<Rgb8>> read_rgb8(const std::string& path, const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<Image<Rgb8>> {
    const Expected<Bytes> file = read_file_bytes(path, limits);
    if (!file) return file.error();
    const Bytes& bytes = file.value();
    const auto turned = [](Expected<Image<Rgb8>> image, int orientation) -> Expected<Image<Rgb8>> {
      if (!image) return image;
      return detail::oriented(std::move(image.value()), orientation);
    };
    if (detail::looks_like_jpeg(bytes)) {
      const Outcome whole = detail::check_jpeg_segments(path, bytes);  // before stb sees any of it
      if (!whole) return whole.error();
      int width = 0;
      int height = 0;
      int channels = 0;
      detail::stb_allocation_limit() = detail::kDecoderState;
      if (bytes.size() > static_cast<std::size_t>(INT_MAX) ||
          detail::stb::stbi_info_from_memory(bytes.data(), static_cast<int>(bytes.size()), &width, &height,
                                             &channels) == 0) {
        return Error{path, "JPEG header", "cannot be read: expected an intact baseline or progressive JPEG"};
      }
      const Expected<Shape> shape = checked_shape(path, width, height, sizeof(Rgb8), limits);
      if (!shape) return shape.error();
      return turned(detail::decode<Rgb8>(path, bytes, shape.value(), 3), detail::jpeg_orientation(bytes));
    }
    const auto header = detail::admitted_png(path, bytes, sizeof(Rgb8), limits, "a PNG or JPEG picture",
                                             [](const detail::PngHeader&) { return true; });
    if (!header) return header.error();
    return turned(detail::decode<Rgb8>(path, bytes, detail::shape_of(header.value()), 3),
                  detail::png_orientation(bytes));
  });
}

inline Expected<Image<std::uint8_t>> read_u8(const std::string& path, const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<Image<std::uint8_t>> {
    const Expected<Bytes> file = read_file_bytes(path, limits);
    if (!file) return file.error();
    const auto header =
        detail::admitted_png(path, file.value(), 1, limits, "a single-channel 8-bit PNG",
                             [](const detail::PngHeader& h) { return h.color_type == 0 && h.bit_depth == 8; });
    if (!header) return header.error();
    return detail::decode<std::uint8_t>(path, file.value(), detail::shape_of(header.value()), 1);
  });
}

// 8-bit files are widened: 200 stays 200.
inline Expected<Image<std::uint16_t>> read_u16(const std::string& path, const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<Image<std::uint16_t>> {
    const Expected<Bytes> file = read_file_bytes(path, limits);
    if (!file) return file.error();
    const auto header = detail::admitted_png(
        path, file.value(), 2, limits, "a single-channel PNG of 8 or 16 bits",
        [](const detail::PngHeader& h) { return h.color_type == 0 && (h.bit_depth == 8 || h.bit_depth == 16); });
    if (!header) return header.error();
    const Shape shape = detail::shape_of(header.value());
    if (header.value().bit_depth == 16) return detail::decode<std::uint16_t>(path, file.value(), shape, 1);
    const Expected<Image<std::uint8_t>> narrow = detail::decode<std::uint8_t>(path, file.value(), shape, 1);
    if (!narrow) return narrow.error();
    Image<std::uint16_t> wide(shape);
    for (std::size_t i = 0; i < shape.pixels(); ++i) wide.data()[i] = narrow.value().data()[i];
    return wide;
  });
}

// 8-bit RGBA; RGB gets alpha 255. For bitmaps whose channels spell a number, so nothing else is converted.
inline Expected<Image<Rgba8>> read_rgba8(const std::string& path, const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<Image<Rgba8>> {
    const Expected<Bytes> file = read_file_bytes(path, limits);
    if (!file) return file.error();
    const auto header = detail::admitted_png(
        path, file.value(), 4, limits, "a 3- or 4-channel 8-bit PNG",
        [](const detail::PngHeader& h) { return (h.color_type == 2 || h.color_type == 6) && h.bit_depth == 8; });
    if (!header) return header.error();
    return detail::decode<Rgba8>(path, file.value(), detail::shape_of(header.value()), 4);
  });
}

// Three channels of 8 or 16 bits as they are in the file, spread to 16 bits (8-bit 255 becomes 65535); alpha dropped.
inline Expected<Image<Rgb16>> read_rgb16(const std::string& path, const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<Image<Rgb16>> {
    const Expected<Bytes> file = read_file_bytes(path, limits);
    if (!file) return file.error();
    const auto header = detail::admitted_png(
        path, file.value(), 6, limits, "a 3-channel PNG of 8 or 16 bits", [](const detail::PngHeader& h) {
          return (h.color_type == 2 || h.color_type == 6) && (h.bit_depth == 8 || h.bit_depth == 16);
        });
    if (!header) return header.error();
    return detail::decode<Rgb16>(path, file.value(), detail::shape_of(header.value()), 3);
  });
}

// What write_png() writes. An error names `path`.
inline Expected<Bytes> encode_png(const std::string& path, ImageView<const Rgb8> image) {
  return guarded(path, [&]() -> Expected<Bytes> {
    return detail::encode_png(path, image.shape(), 8, 2, 3, [&](int y, unsigned char* row) {
      std::memcpy(row, image.row(y), static_cast<std::size_t>(image.width()) * 3);
    });
  });
}

inline Outcome write_png(const std::string& path, ImageView<const Rgb8> image) {
  const Expected<Bytes> png = encode_png(path, image);
  return png ? write_file(path, png.value().data(), png.value().size()) : Outcome(png.error());
}

// Baseline JPEG. quality: 1 to 100; colour at half resolution up to 90.
inline Outcome write_jpeg(const std::string& path, ImageView<const Rgb8> image, int quality) {
  return guarded(path, [&]() -> Outcome {
    if (image.empty()) return Error{path, "size", "the image is empty: expected at least 1x1 pixels"};
    if (quality < 1 || quality > 100) return Error{path, "quality", "expected 1 to 100"};
    Image<Rgb8> whole(image.shape());  // without a stride
    copy_pixels(image, whole.view());
    Bytes out;
    const auto append = [](void* context, void* data, int size) {
      auto& bytes = *static_cast<Bytes*>(context);
      const auto* from = static_cast<const unsigned char*>(data);
      bytes.insert(bytes.end(), from, from + size);
    };
    if (detail::stb::stbi_write_jpg_to_func(append, &out, image.width(), image.height(), 3, whole.data(), quality) ==
        0) {
      return Error{path, "", "could not be encoded: expected a picture of at most 65535 pixels a side"};
    }
    return write_file(path, out.data(), out.size());
  });
}

inline Outcome write_png(const std::string& path, ImageView<const std::uint8_t> image) {
  return guarded(path, [&]() -> Outcome {
    const auto png = detail::encode_png(path, image.shape(), 8, 0, 1, [&](int y, unsigned char* row) {
      std::memcpy(row, image.row(y), static_cast<std::size_t>(image.width()));
    });
    return png ? write_file(path, png.value().data(), png.value().size()) : Outcome(png.error());
  });
}

inline Outcome write_png16(const std::string& path, ImageView<const std::uint16_t> image) {
  return guarded(path, [&]() -> Outcome {
    const auto png = detail::encode_png(path, image.shape(), 16, 0, 1, [&](int y, unsigned char* row) {
      for (int x = 0; x < image.width(); ++x) {
        const std::uint16_t v = image(x, y);
        row[2 * x] = static_cast<unsigned char>(v >> 8);
        row[2 * x + 1] = static_cast<unsigned char>(v & 0xFFU);
      }
    });
    return png ? write_file(path, png.value().data(), png.value().size()) : Outcome(png.error());
  });
}

inline Outcome write_png_rgba(const std::string& path, ImageView<const Rgba8> image) {
  return guarded(path, [&]() -> Outcome {
    const auto png = detail::encode_png(path, image.shape(), 8, 6, 4, [&](int y, unsigned char* row) {
      std::memcpy(row, image.row(y), static_cast<std::size_t>(image.width()) * 4);
    });
    return png ? write_file(path, png.value().data(), png.value().size()) : Outcome(png.error());
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_PNG_JPEG_HPP
