// SPDX-License-Identifier: Apache-2.0
// Depth in, from any of the encodings in use, as z-depth in metres.
//
// Invariant: every value of the result is finite; 0 stands for "missing" and everything else is positive. What the
// file marks as missing (0) and what cannot be a depth (NaN, infinity, negative, zero or negative disparity) both
// become 0 and are counted apart. A plane without one valid depth is an error.
#ifndef NPSIM_IO_DETAIL_DEPTH_HPP
#define NPSIM_IO_DETAIL_DEPTH_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "npsim/core/camera.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/detail/npy.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/pfm.hpp"
#include "npsim/io/png_jpeg.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

enum class DepthEncoding : std::uint8_t {
  metres,                // PFM or NPY
  uint16,                // whole numbers times `scale`: PNG or NPY; 0 = missing
  cityscapes_disparity,  // 0 = missing, else disparity d = (v - 1) / 256 px and z = baseline fx / d
};

struct DepthFormat {
  DepthEncoding encoding = DepthEncoding::metres;
  double scale = 0;       // m per unit, for uint16: 1/256 (KITTI), 0.001 (mm)
  double baseline_m = 0;  // for cityscapes_disparity
  double fx_px = 0;       // for cityscapes_disparity
};

struct DepthCounts {
  std::size_t valid = 0;    // pixels
  std::size_t missing = 0;  // marked so by the file
  std::size_t refused = 0;  // NaN, infinite, negative or beyond the range of float
};

namespace detail {

enum class FileKind : std::uint8_t { pfm, npy, other };

// By content, not by name; the readers say what is wrong with anything else.
inline Expected<FileKind> file_kind(const std::string& path, const ReadLimits& limits) {
  const Expected<Bytes> file = read_file_bytes(path, limits);
  if (!file) return file.error();
  if (looks_like_pfm(file.value())) return FileKind::pfm;
  if (looks_like_npy(file.value())) return FileKind::npy;
  return FileKind::other;
}

// Whole numbers from a PNG or an NPY.
inline Expected<Image<std::int32_t>> read_whole_numbers(const std::string& path, const ReadLimits& limits) {
  return guarded(path, [&]() -> Expected<Image<std::int32_t>> {
    const Expected<FileKind> kind = file_kind(path, limits);
    if (!kind) return kind.error();
    if (kind.value() == FileKind::pfm) {
      return Error{path, "type", "found a PFM of floats, expected whole numbers in a single-channel PNG or an NPY"};
    }
    if (kind.value() == FileKind::npy) return read_npy_i32(path, limits);
    const Expected<Image<std::uint16_t>> plane = read_u16(path, limits);
    if (!plane) return plane.error();
    Image<std::int32_t> out(plane.value().shape());
    for (std::size_t i = 0; i < out.shape().pixels(); ++i) out.data()[i] = plane.value().data()[i];
    return out;
  });
}

inline Expected<Image<float>> read_float_plane(const std::string& path, const ReadLimits& limits) {
  const Expected<FileKind> kind = file_kind(path, limits);
  if (!kind) return kind.error();
  switch (kind.value()) {
    case FileKind::pfm: return read_pfm(path, limits);
    case FileKind::npy: return read_npy(path, limits);
    case FileKind::other: break;
  }
  return Error{path, "type", "is neither PFM nor NPY, expected a plane of floats"};
}

}  // namespace detail

inline Expected<Image<float>> read_depth(const std::string& path, const DepthFormat& format,
                                         const ReadLimits& limits = {}, DepthCounts* counts = nullptr) {
  return guarded(path, [&]() -> Expected<Image<float>> {
    const auto positive = [](double v) { return std::isfinite(v) && v > 0; };
    if (format.encoding == DepthEncoding::uint16 && !positive(format.scale)) {
      return Error{path, "scale", "is not a positive number, expected metres per unit, such as 0.00390625 or 0.001"};
    }
    if (format.encoding == DepthEncoding::cityscapes_disparity &&
        !(positive(format.baseline_m) && positive(format.fx_px))) {
      return Error{path, "baseline",
                   "is missing or not positive, expected a camera with a baseline (m) and fx (px) for disparity"};
    }
    Image<float> depth;
    DepthCounts found;
    const auto keep = [&](float& out, double z_m) {
      const float z = narrowed(z_m);
      const bool good = is_valid_depth(z);
      out = good ? z : 0.0F;
      ++(good ? found.valid : z_m == 0 ? found.missing : found.refused);
    };
    if (format.encoding == DepthEncoding::metres) {
      Expected<Image<float>> plane = detail::read_float_plane(path, limits);
      if (!plane) {
        Error error = plane.error();
        if (error.field == "type") error.problem += " (a PNG of whole numbers needs the encoding uint16 and its scale)";
        return error;
      }
      depth = std::move(plane.value());
      for (std::size_t i = 0; i < depth.shape().pixels(); ++i)
        keep(depth.data()[i], static_cast<double>(depth.data()[i]));
    } else {
      const Expected<Image<std::int32_t>> plane = detail::read_whole_numbers(path, limits);
      if (!plane) return plane.error();
      depth = Image<float>(plane.value().shape());
      for (std::size_t i = 0; i < depth.shape().pixels(); ++i) {
        const std::int32_t v = plane.value().data()[i];
        if (v == 0) {
          keep(depth.data()[i], 0.0);
        } else if (format.encoding == DepthEncoding::uint16) {
          keep(depth.data()[i], v * format.scale);
        } else {
          const double disparity_px = (v - 1) / 256.0;
          keep(depth.data()[i], disparity_px > 0 ? format.baseline_m * format.fx_px / disparity_px : -1.0);
        }
      }
    }
    if (counts != nullptr) *counts = found;
    if (found.valid == 0) {
      return Error{
          path, "depth",
          "none of " + std::to_string(depth.shape().pixels()) + " pixels is valid, expected finite positive values"};
    }
    return depth;
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_DEPTH_HPP
