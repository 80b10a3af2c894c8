// SPDX-License-Identifier: Apache-2.0
// Connected components of an image (4-neighbourhood), in place in the plane that they are written to.
//
// Which pixels are members and which of them are joined to the pixel on their left and above is given as bits, 64
// pixels a word. A run of joined pixels is a node of a union-find whose parents stand in the plane itself, at the run's
// first pixel; runs of neighbouring rows are united once per stretch of joined pixels. Then, in raster order, each
// run takes a new number if it is a root, else that of its parent, which stands before it and has its number already.
//
// Invariant: components are numbered 1, 2, ... in raster order of their first pixel, 0 is outside, whatever the order
// of the unions; the root of a set is its first pixel in raster order. Exact.
// Cost: two passes over the bits and a write of the plane; O(runs log runs) at worst; serial. Memory: none besides the
// bits. See Wu, Otoo, Suzuki, "Optimizing two-pass connected-component labeling algorithms", 2009.
#ifndef NPSIM_MESH_DETAIL_COMPONENTS_HPP
#define NPSIM_MESH_DETAIL_COMPONENTS_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Bits of an image: bit_words(width) words a row.
struct PixelLinks {
  int width = 0;                    // px
  ImageView<std::uint64_t> member;  // belongs to some component
  ImageView<std::uint64_t> left;    // is joined to the member on its left
  ImageView<std::uint64_t> above;   // is joined to the member above it

  [[nodiscard]] constexpr int height() const noexcept { return member.height(); }
  [[nodiscard]] constexpr bool joined_left(int x, int y) const noexcept { return at(left, x, y); }
  [[nodiscard]] constexpr bool joined_right(int x, int y) const noexcept { return x + 1 < width && at(left, x + 1, y); }
  [[nodiscard]] constexpr bool joined_above(int x, int y) const noexcept { return at(above, x, y); }
  [[nodiscard]] constexpr bool joined_below(int x, int y) const noexcept {
    return y + 1 < height() && at(above, x, y + 1);
  }
  [[nodiscard]] static constexpr bool at(const ImageView<std::uint64_t>& plane, int x, int y) noexcept {
    return bit_at(plane(x / kWordBits, y), x % kWordBits);
  }
};

[[nodiscard]] constexpr std::size_t pixel_bits_bytes(Shape shape) noexcept {
  return shape.empty() ? 0
                       : allocation_bytes<std::uint64_t>(static_cast<std::size_t>(bit_words(shape.width)) *
                                                         static_cast<std::size_t>(shape.height));
}

namespace mesh_detail {

[[nodiscard]] inline Status allocate_bits(Shape shape, Workspace& workspace, ImageView<std::uint64_t>& bits) noexcept {
  return workspace.allocate_image({bit_words(shape.width), shape.height}, bits);
}
[[nodiscard]] inline Status allocate_links(Shape shape, Workspace& workspace, PixelLinks& links) noexcept {
  links.width = shape.width;
  NPSIM_RETURN_IF_ERROR(allocate_bits(shape, workspace, links.member));
  NPSIM_RETURN_IF_ERROR(allocate_bits(shape, workspace, links.left));
  return allocate_bits(shape, workspace, links.above);
}

// Follows the first pixel of the run that a pixel lies in, along one row.
class RunStarts {
 public:
  // The starts in the word whose first pixel has the index `base`.
  void enter(std::uint64_t starts, std::uint32_t base) noexcept {
    if (starts_ != 0) before_ = base_ + static_cast<std::uint32_t>(highest_set_bit(starts_));
    starts_ = starts;
    base_ = base;
  }
  [[nodiscard]] std::uint32_t of(int i) const noexcept {
    const std::uint64_t here = starts_ & low_bits(i + 1);
    return here != 0 ? base_ + static_cast<std::uint32_t>(highest_set_bit(here)) : before_;
  }

 private:
  std::uint64_t starts_ = 0;
  std::uint32_t base_ = 0;
  std::uint32_t before_ = 0;
};

// Unites the runs of row y with those above it. Indices are offsets into the plane.
inline void unite_row(const PixelLinks& links, ImageView<std::uint32_t> component, int y) noexcept {
  const auto row = static_cast<std::uint32_t>(y * component.stride());
  const std::uint32_t row_above = y > 0 ? static_cast<std::uint32_t>((y - 1) * component.stride()) : 0;
  const Span<std::uint32_t> parent(component.data(), static_cast<std::size_t>(component.stride() * component.height()));
  RunStarts own;
  RunStarts upper;
  std::uint64_t previous = 0;  // word of links.above
  for (int w = 0; w < links.member.width(); ++w) {
    const auto base = static_cast<std::uint32_t>(kWordBits * w);
    const std::uint64_t left = links.left(w, y);
    const std::uint64_t starts = links.member(w, y) & ~left;
    own.enter(starts, row + base);
    for_set_bits(starts, [&](int i) {
      const std::uint32_t start = row + base + static_cast<std::uint32_t>(i);
      parent[start] = start;
    });
    if (y == 0) continue;
    upper.enter(links.member(w, y - 1) & ~links.left(w, y - 1), row_above + base);
    const std::uint64_t above = links.above(w, y);
    // Where the left neighbour is joined upwards too, and this pixel to it, its union has joined these two as well.
    for_set_bits(above & ~(left_bits(previous, above) & left), [&](int i) { unite(parent, upper.of(i), own.of(i)); });
    previous = above;
  }
}

// Numbers the runs of row y and fills them in.
inline void number_row(const PixelLinks& links, ImageView<std::uint32_t> component, int y,
                       std::uint32_t& count) noexcept {
  std::uint32_t* row = component.row(y);
  const auto offset = static_cast<std::uint32_t>(y * component.stride());
  std::uint32_t number = 0;  // of the run that goes on
  for (int w = 0; w < links.member.width(); ++w) {
    const int base = kWordBits * w;
    const int end = std::min(kWordBits, links.width - base);
    const std::uint64_t member = links.member(w, y);
    const std::uint64_t left = links.left(w, y);
    for (int i = 0; i < end;) {
      if (!bit_at(member, i)) {
        const std::uint64_t rest = member & ~low_bits(i);
        const int next = rest != 0 ? lowest_set_bit(rest) : end;
        std::fill(row + base + i, row + base + next, 0U);
        i = next;
        continue;
      }
      if (!bit_at(left, i)) {
        const std::uint32_t start = offset + static_cast<std::uint32_t>(base + i);
        const std::uint32_t parent = component.data()[start];
        number = parent == start ? ++count : component.data()[parent];
      }
      const std::uint64_t rest = ~left & ~low_bits(i + 1);
      const int next = std::min(end, rest != 0 ? lowest_set_bit(rest) : end);
      std::fill(row + base + i, row + base + next, number);
      i = next;
    }
  }
}

}  // namespace mesh_detail

// Numbers the components of `links` in `component`.
[[nodiscard]] inline Status label_components(const PixelLinks& links, ImageView<std::uint32_t> component,
                                             std::uint32_t& count) noexcept {
  count = 0;
  if (component.empty()) return {StatusCode::invalid_argument, "components need at least one pixel"};
  if (component.width() != links.width || component.height() != links.height()) {
    return {StatusCode::shape_mismatch, "links and components must have one shape"};
  }
  if (static_cast<std::uint64_t>(component.stride()) * static_cast<std::uint64_t>(component.height()) > 0xFFFFFFFFU) {
    return {StatusCode::capacity_exceeded, "the plane of components has 2^32 elements or more, padding included"};
  }
  for (int y = 0; y < links.height(); ++y) mesh_detail::unite_row(links, component, y);
  for (int y = 0; y < links.height(); ++y) mesh_detail::number_row(links, component, y, count);
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_COMPONENTS_HPP
