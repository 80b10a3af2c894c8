// SPDX-License-Identifier: Apache-2.0
// Depth that a simplified layer shows at every pixel, and how far it is from the layer's.
//
// A face of simplify_layer() has its corners at pixel centres, so the pixels that it covers and its depth there follow
// from their places alone: 1 / z is linear over the image.
// Cost: one division a face, a few operations for each pixel centre and each crossing of edges. No memory. Serial.
// Error: of double, rounded to float once.
#ifndef NPSIM_MESH_DETAIL_SIMPLIFY_DEPTH_HPP
#define NPSIM_MESH_DETAIL_SIMPLIFY_DEPTH_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/mesh/detail/simplify/bound.hpp"
#include "npsim/mesh/detail/simplify/mesh.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct DepthDifference {
  float max_relative = 0;  // |z' / z - 1| anywhere: at pixel centres and where edges cross
  float rms_relative = 0;  // at pixel centres
  std::size_t pixels = 0;  // centres that were compared; one on an edge counts for each of its faces
};

namespace mesh_detail {

// Follows every face that is left, and every edge once.
[[nodiscard]] inline DepthDifference compare_depth(const ThinMesh& mesh, const SheetPlanes& sheet) noexcept {
  DepthDifference difference;
  double sum = 0;
  double largest = 0;
  const auto centre = [&](double w, double thin) {
    const double relative = std::fabs(w / thin - 1.0);
    largest = relative > largest ? relative : largest;
    sum += relative * relative;
    ++difference.pixels;
    return true;
  };
  const auto crossing = [&](double w, double thin) {
    const double relative = std::fabs(w / thin - 1.0);
    largest = relative > largest ? relative : largest;
    return true;
  };
  for (std::size_t h = 0; h < mesh.corner.size(); h += 3) {
    if (mesh.corner[h] == kGone) continue;
    Corner corner[3];
    for (std::size_t k = 0; k < 3; ++k) {
      corner[k] = sheet.corner(packed_x(mesh.corner[h + k]), packed_y(mesh.corner[h + k]));
    }
    static_cast<void>(at_centres(sheet, corner[0], corner[1], corner[2], centre));
    for (std::size_t k = 0; k < 3; ++k) {
      if (mesh.opposite[h + k] < h + k) continue;  // a rim is the largest number of all
      static_cast<void>(at_crossings(sheet, corner[k], corner[(k + 1) % 3], crossing));
    }
  }
  difference.max_relative = static_cast<float>(largest);
  if (difference.pixels > 0) {
    difference.rms_relative = static_cast<float>(std::sqrt(sum / static_cast<double>(difference.pixels)));
  }
  return difference;
}

}  // namespace mesh_detail

// Writes the depth of the faces of one layer, in m, to the pixels that they cover; all others get 0. pixels says the
// pixel (y * width + x) of every vertex.
[[nodiscard]] inline Status simplified_depth(const TriangleMeshView& layer, Span<const std::uint32_t> pixels,
                                             ImageView<float> depth) noexcept {
  if (depth.empty()) return {StatusCode::invalid_argument, "depth of a layer needs at least one pixel"};
  const Shape shape = depth.shape();
  if (shape.width > mesh_detail::kMaxSimplifySide || shape.height > mesh_detail::kMaxSimplifySide) {
    return {StatusCode::capacity_exceeded, "depth of a layer: at most 32768 pixels a side"};
  }
  for (const Face& f : layer.faces) {
    for (const std::uint32_t v : {f.a, f.b, f.c}) {
      if (v >= layer.vertices.size() || v >= pixels.size() || pixels[v] >= shape.pixels()) {
        return {StatusCode::invalid_argument, "a face refers to a vertex or a pixel that does not exist"};
      }
    }
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) depth(x, y) = 0.0F;
  }
  const auto width = static_cast<std::uint32_t>(shape.width);
  const auto corner_of = [&](std::uint32_t v) {
    return mesh_detail::Corner{static_cast<int>(pixels[v] % width), static_cast<int>(pixels[v] / width),
                               1.0 / static_cast<double>(layer.vertices[v].z), 0};
  };
  for (const Face& f : layer.faces) {
    const mesh_detail::Corner a = corner_of(f.a);
    const mesh_detail::Corner b = corner_of(f.b);
    const mesh_detail::Corner c = corner_of(f.c);
    if (mesh_detail::turn(a, b, c) == 0) continue;
    const mesh_detail::InversePlane plane(a, b, c);
    static_cast<void>(mesh_detail::for_triangle_rows(a, b, c, [&](int y, int first, int last) {
      for (int x = first; x <= last; ++x) depth(x, y) = static_cast<float>(1.0 / plane.at(x, y));
      return true;
    }));
    // Corners keep their depth to the last bit.
    for (const std::uint32_t v : {f.a, f.b, f.c}) {
      depth(static_cast<int>(pixels[v] % width), static_cast<int>(pixels[v] / width)) = layer.vertices[v].z;
    }
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_SIMPLIFY_DEPTH_HPP
