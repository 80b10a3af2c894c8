// SPDX-License-Identifier: Apache-2.0
// Connected components of an image (4-neighbourhood), by union-find in two passes.
//
// Invariant: components are numbered 1, 2, ... in raster order of their first pixel, 0 is outside, whatever the order
// of the unions; the root of a set is its first pixel in raster order.
// Cost: O(pixels log pixels) at worst, in practice linear; serial. Memory: 4 bytes a pixel.
// See Wu, Otoo, Suzuki, "Optimizing two-pass connected-component labeling algorithms", 2009.
#ifndef NPSIM_MESH_COMPONENTS_HPP
#define NPSIM_MESH_COMPONENTS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {

[[nodiscard]] constexpr std::size_t connected_components_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<std::uint32_t>(shape.empty() ? 0 : shape.pixels()) + kWorkspaceAlignment;
}

inline namespace NPSIM_ISA_NAMESPACE {
namespace mesh_detail {

// Root of i; halves the path on the way. Parents never exceed their children, so this ends after at most i steps.
[[nodiscard]] inline std::uint32_t find_root(Span<std::uint32_t> parent, std::uint32_t i) noexcept {
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

inline void unite(Span<std::uint32_t> parent, std::uint32_t i, std::uint32_t j) noexcept {
  const std::uint32_t a = find_root(parent, i);
  const std::uint32_t b = find_root(parent, j);
  if (a < b) {
    parent[b] = a;
  } else {
    parent[a] = b;
  }
}

}  // namespace mesh_detail

// member(x, y) says whether a pixel belongs to any component, same(x0, y0, x1, y1) whether two neighbouring members
// belong to one.
template <class Member, class Same>
[[nodiscard]] Status connected_components(const Member& member, const Same& same, ImageView<std::uint32_t> component,
                                          Workspace& workspace, std::uint32_t& count) {
  count = 0;
  if (component.empty()) return {StatusCode::invalid_argument, "components need at least one pixel"};
  const Shape shape = component.shape();
  if (shape.pixels() >= 0xFFFFFFFFU) return {StatusCode::capacity_exceeded, "the image has 2^32 pixels or more"};
  const WorkspaceScope scope(workspace);
  Span<std::uint32_t> parent;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), parent));
  const auto width = static_cast<std::uint32_t>(shape.width);
  std::uint32_t i = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x, ++i) {
      parent[i] = i;
      component(x, y) = member(x, y) ? 1 : 0;
      if (component(x, y) == 0) continue;
      if (x > 0 && component(x - 1, y) != 0 && same(x - 1, y, x, y)) mesh_detail::unite(parent, i - 1, i);
      if (y > 0 && component(x, y - 1) != 0 && same(x, y - 1, x, y)) mesh_detail::unite(parent, i - width, i);
    }
  }
  i = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x, ++i) {
      if (component(x, y) == 0) continue;
      const std::uint32_t root = mesh_detail::find_root(parent, i);
      component(x, y) = root == i ? ++count : component(static_cast<int>(root % width), static_cast<int>(root / width));
    }
  }
  return {};
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_MESH_COMPONENTS_HPP
