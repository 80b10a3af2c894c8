// SPDX-License-Identifier: Apache-2.0
// Whether a layer of the scene mesh is whole: covers every pixel that it is to cover, without a hole inside.
//
// To be covered are, in the background, all pixels but the blocked ones (sky); in the foreground, all pixels of every
// object. A pixel without a vertex is unanchored where nothing is known that could be continued to it (a row of the
// background without any kept vertex between two blocked pixels or borders; an object without any valid depth), and
// uncovered otherwise. In a quad of four neighbouring pixels every three vertices of one object allow a face: four give
// two faces, three one. A face that is allowed and absent is missing; one that stands on a pixel without a vertex, or
// joins two objects or an object and nothing, is stray. So a layer that is whole has no opening but where the sky or
// something else is seen through it, and there its rim runs from pixel to neighbouring pixel.
//
// Written without the code that builds the layers. Cost: one pass over the pixels. Memory: 1 byte a pixel, for objects.
// Error: none, counts only.
#ifndef NPSIM_MESH_CHECK_LAYER_HPP
#define NPSIM_MESH_CHECK_LAYER_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/mesh/interpolate_rows.hpp"
#include "npsim/mesh/sheet.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct LayerReport {
  std::size_t covered_pixels = 0;
  std::size_t uncovered_pixels = 0;
  std::size_t unanchored_pixels = 0;
  std::size_t faces = 0;
  std::size_t missing_faces = 0;
  std::size_t stray_faces = 0;

  [[nodiscard]] constexpr bool whole() const noexcept {
    return uncovered_pixels == 0 && missing_faces == 0 && stray_faces == 0;
  }
};

[[nodiscard]] constexpr std::size_t check_foreground_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<std::uint8_t>(shape.empty() ? 0 : shape.pixels() + 1) + kWorkspaceAlignment;
}

namespace mesh_detail {

// owner(x, y) is the number of the object that a pixel's vertex belongs to; 0 without a vertex or object.
template <class Owner>
void check_quads(const SheetLayer& layer, const Owner& owner, LayerReport& report) {
  const Shape quads = quad_shape(layer.vertices.shape());
  for (int y = 0; y < quads.height; ++y) {
    for (int x = 0; x < quads.width; ++x) {
      const std::uint32_t own[4] = {owner(x, y), owner(x + 1, y), owner(x, y + 1), owner(x + 1, y + 1)};
      const auto face = [&own](int i, int j, int k) { return own[i] != 0 && own[i] == own[j] && own[i] == own[k]; };
      const bool without[4] = {face(1, 2, 3), face(0, 2, 3), face(0, 1, 3), face(0, 1, 2)};  // without corner k
      const auto triples = std::count(without, without + 4, true);
      const std::size_t allowed = triples == 4 ? 2 : (triples != 0 ? 1 : 0);
      const unsigned quad = layer.quads(x, y);
      const bool anti = (quad & kQuadAntiDiagonal) != 0;
      std::size_t sound = 0;
      const auto count = [&](bool present, bool fits) {
        report.faces += present ? 1U : 0U;
        report.stray_faces += present && !fits ? 1U : 0U;
        sound += present && fits ? 1U : 0U;
      };
      count((quad & kQuadUpperFace) != 0, without[anti ? 3 : 2]);
      count((quad & kQuadLowerFace) != 0, without[anti ? 0 : 1]);
      report.missing_faces += allowed - std::min(allowed, sound);
    }
  }
}

}  // namespace mesh_detail

// state: what complete_background() wrote.
[[nodiscard]] inline Status check_background(const SheetLayer& background, ImageView<const std::uint8_t> state,
                                             LayerReport& report) {
  report = {};
  NPSIM_RETURN_IF_ERROR(validate(background));
  const Shape shape = background.vertices.shape();
  if (state.data() == nullptr || state.shape() != shape) {
    return {StatusCode::shape_mismatch, "states and background must have one shape"};
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width;) {
      if (state(x, y) == row_state::blocked) {
        ++x;
        continue;
      }
      bool anchored = false;
      std::size_t empty = 0;
      for (; x < shape.width && state(x, y) != row_state::blocked; ++x) {
        anchored = anchored || state(x, y) == row_state::known;
        has_vertex(background.vertices(x, y)) ? ++report.covered_pixels : ++empty;
      }
      (anchored ? report.uncovered_pixels : report.unanchored_pixels) += empty;
    }
  }
  const auto owner = [&](int x, int y) { return has_vertex(background.vertices(x, y)) ? 1U : 0U; };
  mesh_detail::check_quads(background, owner, report);
  return {};
}

// object: what complete_foreground() wrote.
[[nodiscard]] inline Status check_foreground(const SheetLayer& foreground, ImageView<const std::uint32_t> object,
                                             Workspace& workspace, LayerReport& report) {
  report = {};
  NPSIM_RETURN_IF_ERROR(validate(foreground));
  const Shape shape = foreground.vertices.shape();
  if (object.data() == nullptr || object.shape() != shape) {
    return {StatusCode::shape_mismatch, "objects and foreground must have one shape"};
  }
  const WorkspaceScope scope(workspace);
  Span<std::uint8_t> anchored;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels() + 1, anchored));
  std::fill(anchored.begin(), anchored.end(), std::uint8_t{0});
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (object(x, y) > shape.pixels()) {
        return {StatusCode::invalid_argument, "there are more objects than pixels"};
      }
      if (has_vertex(foreground.vertices(x, y))) anchored[object(x, y)] = 1;
    }
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const std::uint32_t own = object(x, y);
      if (own == 0) continue;
      if (has_vertex(foreground.vertices(x, y))) {
        ++report.covered_pixels;
      } else {
        ++(anchored[own] != 0 ? report.uncovered_pixels : report.unanchored_pixels);
      }
    }
  }
  const auto owner = [&](int x, int y) { return has_vertex(foreground.vertices(x, y)) ? object(x, y) : 0U; };
  mesh_detail::check_quads(foreground, owner, report);
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_CHECK_LAYER_HPP
