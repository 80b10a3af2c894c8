// SPDX-License-Identifier: Apache-2.0
// Writes a raw picture as DNG: uncompressed levels behind colour filters, which raw converters open.
//
// A little-endian TIFF with one image and an EXIF directory (Adobe, "Digital Negative Specification" 1.4): mosaic,
// black and white level, ColorMatrix1 (XYZ to raw, for D65), AsShotNeutral from the gains of white balance,
// NoiseProfile, which is (beta1, beta2) of equation (3.10), BaselineExposure, which is log2 of the headroom, and the
// exposure. Levels take 16 bits, whatever the converter has.
// Error: none in the levels; matrix and baseline are fractions of 10^4, the neutral of 10^6.
#ifndef NPSIM_IO_DNG_HPP
#define NPSIM_IO_DNG_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "npsim/io/atomic_file.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/error.hpp"
#include "npsim/pipeline/photograph.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

namespace detail {

enum class TiffType : std::uint16_t {
  byte = 1,
  ascii = 2,
  u16 = 3,
  u32 = 4,
  rational = 5,
  signed_rational = 10,
  f64 = 12
};

// A directory of tags. Values follow it, at even offsets.
class TiffDirectory {
 public:
  void add(std::uint16_t tag, TiffType type, std::uint32_t count, Bytes value) {
    entries_.push_back({tag, type, count, std::move(value)});
  }
  void add_u16(std::uint16_t tag, const std::vector<std::uint16_t>& values) { add_all(tag, TiffType::u16, values, 2); }
  void add_u32(std::uint16_t tag, std::uint32_t value) {
    add_all(tag, TiffType::u32, std::vector<std::uint32_t>{value}, 4);
  }
  void set_u32(std::uint16_t tag, std::uint32_t value) {
    for (Entry& e : entries_) {
      if (e.tag != tag) continue;
      e.value.clear();
      append_little(e.value, value, 4);
    }
  }
  void add_bytes(std::uint16_t tag, const std::vector<std::uint8_t>& values) {
    add_all(tag, TiffType::byte, values, 1);
  }
  void add_text(std::uint16_t tag, const std::string& text) {
    Bytes value(text.begin(), text.end());
    value.push_back(0);
    const auto count = static_cast<std::uint32_t>(value.size());
    add(tag, TiffType::ascii, count, std::move(value));
  }
  void add_fractions(std::uint16_t tag, TiffType type, const std::vector<double>& values, double denominator) {
    Bytes out;
    for (const double v : values) {
      append_little(out, static_cast<std::uint32_t>(static_cast<std::int32_t>(std::lround(v * denominator))), 4);
      append_little(out, static_cast<std::uint32_t>(denominator), 4);
    }
    add(tag, type, static_cast<std::uint32_t>(values.size()), std::move(out));
  }
  void add_doubles(std::uint16_t tag, const std::vector<double>& values) {
    Bytes out;
    for (const double v : values) {
      std::uint64_t bits = 0;
      std::memcpy(&bits, &v, sizeof bits);
      append_little(out, bits, 8);
    }
    add(tag, TiffType::f64, static_cast<std::uint32_t>(values.size()), std::move(out));
  }

  // The directory and what does not fit into it, as they lie from byte `offset` of the file on.
  [[nodiscard]] Bytes at(std::size_t offset) const {
    std::vector<Entry> sorted = entries_;
    std::sort(sorted.begin(), sorted.end(), [](const Entry& a, const Entry& b) { return a.tag < b.tag; });
    const std::size_t size = 2 + 12 * sorted.size() + 4;
    Bytes directory;
    Bytes values;
    append_little(directory, sorted.size(), 2);
    for (const Entry& e : sorted) {
      append_little(directory, e.tag, 2);
      append_little(directory, static_cast<std::uint16_t>(e.type), 2);
      append_little(directory, e.count, 4);
      if (e.value.size() <= 4) {
        Bytes padded = e.value;
        padded.resize(4);
        directory.insert(directory.end(), padded.begin(), padded.end());
      } else {
        append_little(directory, offset + size + values.size(), 4);
        values.insert(values.end(), e.value.begin(), e.value.end());
        if (values.size() % 2 != 0) values.push_back(0);
      }
    }
    append_little(directory, 0, 4);
    directory.insert(directory.end(), values.begin(), values.end());
    return directory;
  }

 private:
  struct Entry {
    std::uint16_t tag;
    TiffType type;
    std::uint32_t count;
    Bytes value;
  };
  template <class T>
  void add_all(std::uint16_t tag, TiffType type, const std::vector<T>& values, std::size_t bytes) {
    Bytes out;
    for (const T v : values) append_little(out, v, bytes);
    add(tag, type, static_cast<std::uint32_t>(values.size()), std::move(out));
  }

  std::vector<Entry> entries_;
};

// Rows: raw red, green and blue of XYZ.
[[nodiscard]] inline std::vector<double> raw_of_xyz(const SensorParams& sensor) {
  std::vector<double> matrix;
  const Vec3d columns[3] = {xyz_to_linear_srgb({1, 0, 0}), xyz_to_linear_srgb({0, 1, 0}),
                            xyz_to_linear_srgb({0, 0, 1})};
  for (const Vec3f& row : sensor.response) {
    for (const Vec3d& column : columns) matrix.push_back(dot(vec_cast<double>(row), column));
  }
  return matrix;
}

}  // namespace detail

inline Outcome write_dng(const std::string& path, const RawPicture& raw, const SensorParams& sensor,
                         const CameraExposure& exposure) {
  return guarded(path, [&]() -> Outcome {
    using detail::TiffType;
    const ImageView<const std::uint16_t> levels = raw.levels;
    if (levels.empty()) return Error{path, "size", "the picture is empty: expected at least 1x1 pixels"};
    const auto width = static_cast<std::uint32_t>(levels.width());
    const auto height = static_cast<std::uint32_t>(levels.height());
    std::vector<std::uint8_t> filters;
    for (int i = 0; i < 4; ++i) filters.push_back(static_cast<std::uint8_t>(filter_at(sensor.mosaic, i % 2, i / 2)));
    const double most = static_cast<double>(std::max({raw.gains.x, raw.gains.y, raw.gains.z}));
    const auto neutral = [&](float gain) { return gain > 0.0F ? 1.0 / static_cast<double>(gain) : 1.0 / most; };

    detail::TiffDirectory exif;
    exif.add_fractions(33434, TiffType::rational, {static_cast<double>(exposure.time_s)}, 1e6);
    exif.add_fractions(33437, TiffType::rational, {static_cast<double>(exposure.f_number)}, 100);
    exif.add_u16(34855, {static_cast<std::uint16_t>(std::min(exposure.iso + 0.5F, 65535.0F))});

    detail::TiffDirectory image;
    image.add_u32(254, 0);
    image.add_u32(256, width);
    image.add_u32(257, height);
    image.add_u16(258, {16});
    image.add_u16(259, {1});      // not compressed
    image.add_u16(262, {32803});  // behind filters
    image.add_text(271, "NPSim");
    image.add_text(272, "simulated camera");
    image.add_u32(273, 0);  // where the levels begin, below
    image.add_u16(274, {1});
    image.add_u16(277, {1});
    image.add_u32(278, height);
    image.add_u32(279, 2 * width * height);
    image.add_u16(284, {1});
    image.add_text(305, std::string("npsim ") + NPSIM_VERSION_STRING);
    image.add_u16(33421, {2, 2});
    image.add_bytes(33422, filters);
    image.add_u32(34665, 0);  // the EXIF directory, below
    image.add_bytes(50706, {1, 4, 0, 0});
    image.add_bytes(50707, {1, 1, 0, 0});
    image.add_text(50708, "NPSim simulated camera");
    image.add_bytes(50710, {0, 1, 2});
    image.add_u16(50711, {1});
    image.add_fractions(50714, TiffType::rational, {static_cast<double>(sensor.black)}, 100);
    image.add_u32(50717, static_cast<std::uint32_t>(white_level(sensor)));
    image.add_fractions(50721, TiffType::signed_rational, detail::raw_of_xyz(sensor), 1e4);
    image.add_fractions(50728, TiffType::rational, {neutral(raw.gains.x), neutral(raw.gains.y), neutral(raw.gains.z)},
                        1e6);
    image.add_fractions(50730, TiffType::signed_rational, {std::log2(static_cast<double>(raw.headroom))}, 1e4);
    image.add_u16(50778, {21});  // D65
    image.add_doubles(51041, {static_cast<double>(raw.noise.beta1), static_cast<double>(raw.noise.beta2)});

    constexpr std::size_t kHeader = 8;
    const std::size_t exif_at = kHeader + image.at(kHeader).size();
    const Bytes exif_bytes = exif.at(exif_at);
    image.set_u32(34665, static_cast<std::uint32_t>(exif_at));
    image.set_u32(273, static_cast<std::uint32_t>(exif_at + exif_bytes.size()));
    Bytes out = {'I', 'I', 42, 0, kHeader, 0, 0, 0};
    const Bytes image_bytes = image.at(kHeader);
    out.insert(out.end(), image_bytes.begin(), image_bytes.end());
    out.insert(out.end(), exif_bytes.begin(), exif_bytes.end());
    for (int y = 0; y < levels.height(); ++y) {
      for (int x = 0; x < levels.width(); ++x) append_little(out, levels(x, y), 2);
    }
    return write_file(path, out.data(), out.size());
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DNG_HPP
