// SPDX-License-Identifier: Apache-2.0
// Small pieces of a map, which are what is around them.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_SMALL_PIECES_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_SMALL_PIECES_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

[[nodiscard]] constexpr std::size_t close_pieces_bytes(Shape shape) noexcept {
  return allocation_bytes<std::uint8_t>(shape.pixels()) + allocation_bytes<std::uint32_t>(shape.pixels());
}

// Pieces of what is(v) that have fewer pixels than `small` take `value` where most of what counts(v) around them has
// it.
template <class T, class Is, class Counts>
[[nodiscard]] Status close_pieces(ImageView<T> map, const Is& is, const Counts& counts, T value, std::size_t small,
                                  Workspace& workspace) {
  const WorkspaceScope scope(workspace);
  ImageView<std::uint8_t> open;
  Span<std::uint32_t> list;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(map.shape(), open));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(map.shape().pixels(), list));
  for (int y = 0; y < map.height(); ++y) {
    for (int x = 0; x < map.width(); ++x) open(x, y) = is(map(x, y)) ? 1 : 0;
  }
  for_pieces(open, list, [&](Span<const std::uint32_t> piece) {
    if (piece.size() >= small) return;
    int around = 0;
    int alike = 0;
    const auto look = [&](int u, int v) {
      if (!map.contains(u, v) || is(map(u, v)) || !counts(map(u, v))) return;
      ++around;
      alike += map(u, v) == value ? 1 : 0;
    };
    for (const std::uint32_t i : piece) {
      const auto [u, v] = place_of(i, map.width());
      for_neighbours(u, v, look);
    }
    if (2 * alike <= around) return;
    for (const std::uint32_t i : piece) map(place_of(i, map.width())) = value;
  });
  return {};
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_SMALL_PIECES_HPP
