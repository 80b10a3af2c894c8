// SPDX-License-Identifier: Apache-2.0
// NPY in (little-endian f4, f8, u1, u2, i4; C order; H x W, H x W x 1 or H x W x 3) and out (f4).
//
// Source: the NPY format description, versions 1 to 3. The header is parsed as the dictionary of three keys that it is,
// not searched for substrings. f8 and i4 are rounded to float where floats are asked for; numbers that stand for ids
// are read as integers only. The file has to be exactly as long as its header says.
#ifndef NPSIM_IO_DETAIL_NPY_HPP
#define NPSIM_IO_DETAIL_NPY_HPP

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/detail/npy_header.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

[[nodiscard]] inline bool looks_like_npy(const Bytes& b) noexcept {
  return b.size() >= 6 && std::memcmp(b.data(), kNpyMagic, 6) == 0;
}

// Element i of the data as T. The machine is assumed little-endian, as every one with an NPSim SIMD path is.
template <class T>
[[nodiscard]] inline T npy_element(const unsigned char* data, NpyType type, std::size_t i) noexcept {
  const auto load = [&](auto example) {
    auto value = example;
    std::memcpy(&value, data + i * sizeof(value), sizeof(value));
    if constexpr (std::is_same_v<decltype(value), double> && std::is_same_v<T, float>)
      return narrowed(value);
    else
      return static_cast<T>(value);
  };
  switch (type) {
    case NpyType::f4: return load(float{});
    case NpyType::f8: return load(double{});
    case NpyType::u1: return load(std::uint8_t{});
    case NpyType::u2: return load(std::uint16_t{});
    case NpyType::i4: return load(std::int32_t{});
  }
  return T{};
}

// Pixels of T, which is `channels` elements of E.
template <class E, class T>
Expected<Image<T>> read_npy_pixels(const std::string& path, int channels, bool integers_only,
                                   const ReadLimits& limits) {
  return guarded(path, [&]() -> Expected<Image<T>> {
    const Expected<Bytes> file = read_file_bytes(path, limits);
    if (!file) return file.error();
    const Expected<NpyHeader> found = npy_header(path, file.value(), limits);
    if (!found) return found.error();
    const NpyHeader& header = found.value();
    if (header.channels != channels) {
      return Error{path, "shape",
                   header.shape_text + ", expected " + (channels == 3 ? "(height, width, 3)" : "(height, width)")};
    }
    if (integers_only && (header.type == NpyType::f4 || header.type == NpyType::f8)) {
      return Error{path, "descr", "floating-point numbers, expected whole ones: |u1, <u2 or <i4"};
    }
    Image<T> image(header.shape);
    const unsigned char* data = file.value().data() + header.data_at;
    auto* out = reinterpret_cast<unsigned char*>(image.data());
    const std::size_t count = header.shape.pixels() * static_cast<std::size_t>(channels);
    for (std::size_t i = 0; i < count; ++i) {
      const E value = npy_element<E>(data, header.type, i);
      std::memcpy(out + i * sizeof(E), &value, sizeof(E));
    }
    return image;
  });
}

template <class T>
Outcome write_npy_pixels(const std::string& path, ImageView<const T> image, int channels) {
  return guarded(path, [&]() -> Outcome {
    if (image.empty()) return Error{path, "size", "the image is empty: expected at least 1x1 pixels"};
    std::string text = "{'descr': '<f4', 'fortran_order': False, 'shape': (" + std::to_string(image.height()) + ", " +
                       std::to_string(image.width()) + (channels == 3 ? ", 3" : "") + "), }";
    while ((10 + text.size() + 1) % 64 != 0) text += ' ';  // the data is aligned to 64 bytes
    text += '\n';
    Bytes out(kNpyMagic, kNpyMagic + 6);
    out.push_back(1);
    out.push_back(0);
    out.push_back(static_cast<unsigned char>(text.size() % 256));
    out.push_back(static_cast<unsigned char>(text.size() / 256));
    out.insert(out.end(), text.begin(), text.end());
    for (int y = 0; y < image.height(); ++y) {
      const auto* row = reinterpret_cast<const unsigned char*>(image.row(y));
      out.insert(out.end(), row, row + static_cast<std::size_t>(image.width()) * sizeof(T));
    }
    return write_file(path, out.data(), out.size());
  });
}

}  // namespace detail

inline Expected<Image<float>> read_npy(const std::string& path, const ReadLimits& limits = {}) {
  return detail::read_npy_pixels<float, float>(path, 1, false, limits);
}
inline Expected<Image<Vec3f>> read_npy_rgb(const std::string& path, const ReadLimits& limits = {}) {
  return detail::read_npy_pixels<float, Vec3f>(path, 3, false, limits);
}
// For ids: whole-number types only.
inline Expected<Image<std::int32_t>> read_npy_i32(const std::string& path, const ReadLimits& limits = {}) {
  return detail::read_npy_pixels<std::int32_t, std::int32_t>(path, 1, true, limits);
}
inline Outcome write_npy(const std::string& path, ImageView<const float> image) {
  return detail::write_npy_pixels(path, image, 1);
}
inline Outcome write_npy(const std::string& path, ImageView<const Vec3f> image) {
  return detail::write_npy_pixels(path, image, 3);
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_NPY_HPP
