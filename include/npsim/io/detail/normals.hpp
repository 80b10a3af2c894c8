// SPDX-License-Identifier: Apache-2.0
// Normals in, as the vectors the file holds: no axis convention is applied, nothing is normalised.
//
// PNG (8 or 16 bits, 3 channels): n = 2 v / vmax - 1, and black (0, 0, 0) means "none". PFM and NPY: three floats.
// Invariant: every vector of the result is finite; one that was not is the zero vector, which means "none".
#ifndef NPSIM_IO_DETAIL_NORMALS_HPP
#define NPSIM_IO_DETAIL_NORMALS_HPP

#include <cstddef>
#include <string>

#include "npsim/core/vec.hpp"
#include "npsim/io/detail/depth.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/detail/npy.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/pfm.hpp"
#include "npsim/io/png_jpeg.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

// Three floats a pixel from a PFM or an NPY.
inline Expected<Image<Vec3f>> read_vec3_plane(const std::string& path, const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<Image<Vec3f>> {
    const Expected<detail::FileKind> kind = detail::file_kind(path, limits);
    if (!kind) return kind.error();
    switch (kind.value()) {
      case detail::FileKind::pfm: return read_pfm_rgb(path, limits);
      case detail::FileKind::npy: return read_npy_rgb(path, limits);
      case detail::FileKind::other: break;
    }
    return Error{path, "type", "is neither PFM nor NPY, expected three floats a pixel"};
  });
}

inline Expected<Image<Vec3f>> read_raw_normals(const std::string& path, const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<Image<Vec3f>> {
    const Expected<detail::FileKind> kind = detail::file_kind(path, limits);
    if (!kind) return kind.error();
    Image<Vec3f> normals;
    if (kind.value() == detail::FileKind::other) {
      const Expected<Image<Rgb16>> png = read_rgb16(path, limits);
      if (!png) return png.error();
      normals = Image<Vec3f>(png.value().shape());
      const auto decode = [](std::uint16_t v) { return static_cast<float>(v) * (2.0F / 65535.0F) - 1.0F; };
      for (std::size_t i = 0; i < normals.shape().pixels(); ++i) {
        const Rgb16& v = png.value().data()[i];
        if (v[0] != 0 || v[1] != 0 || v[2] != 0) normals.data()[i] = {decode(v[0]), decode(v[1]), decode(v[2])};
      }
      return normals;
    }
    Expected<Image<Vec3f>> plane = read_vec3_plane(path, limits);
    if (!plane) return plane.error();
    normals = std::move(plane.value());
    for (std::size_t i = 0; i < normals.shape().pixels(); ++i) {
      if (!is_finite(normals.data()[i])) normals.data()[i] = Vec3f{};
    }
    return normals;
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_NORMALS_HPP
