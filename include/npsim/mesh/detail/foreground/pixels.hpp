// SPDX-License-Identifier: Apache-2.0
// Which pixels belong to objects, 64 at a time: members, their links and those that keep the sheet's depth, and the
// pixels beside thin objects that take over a depth. Part of complete_foreground.hpp.
//
// Exact. Cost: a few instructions for 64 pixels without an object, one or two a pixel elsewhere. Memory: none.
#ifndef NPSIM_MESH_DETAIL_FOREGROUND_PIXELS_HPP
#define NPSIM_MESH_DETAIL_FOREGROUND_PIXELS_HPP

#include <algorithm>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/components.hpp"
#include "npsim/mesh/detail/foreground/growth.hpp"
#include "npsim/mesh/interpolate_rows.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace mesh_detail {

// What objects are found in.
struct ForegroundSource {
  SheetSource sheet;
  LabelSet foreground;
  ImageView<const Label> labels;
  ImageView<const std::uint16_t> instances;  // may be empty, as may the next two
  ImageView<const std::uint8_t> uncertain;
  ImageView<const std::uint8_t> background_state;
};

// Labels of a set, 64 at a time.
template <class U>
class LabelTest {
 public:
  explicit LabelTest(LabelSet set) noexcept : table_(Bytes(set).in) {}
  [[nodiscard]] std::uint64_t operator()(U labels) const noexcept {
    return less_bits(U(0), lookup(table_, labels)) & less_bits(labels, U(64));
  }

 private:
  struct Bytes {
    explicit Bytes(LabelSet set) noexcept {
      for (int i = 0; i < 64; ++i) in[i] = set.contains(static_cast<Label>(i)) ? 1 : 0;
    }
    std::uint8_t in[64];
  };
  typename U::Table table_;
};

// Bits of the first n <= 64 pixels of two rows that are equal.
template <class U>
[[nodiscard]] std::uint64_t equal_bytes(const std::uint8_t* p, const std::uint8_t* q, int n) noexcept {
  std::uint64_t all = 0;
  for (int i = 0; i < n; i += U::lanes) {
    const int left = n - i;
    const bool whole = left >= U::lanes;
    all |= equal_bits(whole ? U::load(p + i) : U::load(p + i, left), whole ? U::load(q + i) : U::load(q + i, left))
           << static_cast<unsigned>(i);
  }
  return all & low_bits(n);
}
template <class I>
[[nodiscard]] std::uint64_t equal_halves(const std::uint16_t* p, const std::uint16_t* q, int n) noexcept {
  std::uint64_t all = 0;
  for (int i = 0; i < n; i += I::lanes) {
    const int left = n - i;
    const bool whole = left >= I::lanes;
    const auto equal = (whole ? I::load_u16(p + i) : I::load_u16(p + i, left)) ==
                       (whole ? I::load_u16(q + i) : I::load_u16(q + i, left));
    all |= std::uint64_t{bits(equal)} << static_cast<unsigned>(i);
  }
  return all & low_bits(n);
}

// Row y of the bits, and of the scratch that growth expects. links.above still has to be masked with the members above.
template <class F>
void find_objects(const ForegroundSource& source, const ObjectPixels& planes, int y) noexcept {
  using U = simd::BytesOf<F>;
  using I = typename F::Int;
  const int width = planes.links.width;
  const LabelTest<U> in_foreground(source.foreground);
  const Label* labels = source.labels.row(y);
  const std::uint16_t* instances = source.instances.data() != nullptr ? source.instances.row(y) : nullptr;
  std::uint64_t last_member = 0;
  std::uint64_t last_alike = 0;  // with the pixel on their right
  for (int w = 0; w < planes.known.width(); ++w) {
    const int x = kWordBits * w;
    const int n = std::min(kWordBits, width - x);
    std::uint64_t member = test_bytes<U>(labels + x, n, in_foreground);
    if (member != 0 && source.background_state.data() != nullptr) {
      member &=
          ~test_bytes<U>(source.background_state.row(y) + x, n, [](U s) { return equal_bits(s, U(row_state::known)); });
    }
    planes.links.member(w, y) = member;
    planes.links.left(w, y) = planes.links.above(w, y) = planes.known(w, y) = 0;
    float* scratch = &planes.pixels(x, y).x;
    if (member == 0) {
      for (int i = 0; i < 3 * n; i += F::lanes) F(0.0F).store(scratch + i, std::min(F::lanes, 3 * n - i));
      last_member = 0;
      continue;
    }
    const int pairs = std::min(n, width - 1 - x);
    std::uint64_t alike = equal_bytes<U>(labels + x, labels + x + 1, pairs);
    if (instances != nullptr) alike &= equal_halves<I>(instances + x, instances + x + 1, pairs);
    planes.links.left(w, y) = member & left_bits(last_member, member) & left_bits(last_alike, alike);
    if (y > 0) {
      std::uint64_t above = member & equal_bytes<U>(labels + x, source.labels.row(y - 1) + x, n);
      if (instances != nullptr) above &= equal_halves<I>(instances + x, source.instances.row(y - 1) + x, n);
      planes.links.above(w, y) = above;
    }
    std::uint64_t valid = 0;
    for (int i = 0; i < n; i += F::lanes) {
      const int lanes = std::min(F::lanes, n - i);
      const F z = source.sheet.vertices<F>(x + i, y, lanes).z;
      valid |= std::uint64_t{bits(z > F(0.0F))} << static_cast<unsigned>(i);
      simd::store3(scratch + 3 * i, simd::F32x3<F>{F(0.0F), F(0.0F), z}, lanes);
    }
    const std::uint64_t doubt =
        source.uncertain.data() != nullptr ? nonzero_bits<U>(source.uncertain.row(y) + x, n) : 0;
    planes.known(w, y) = member & valid & ~doubt;
    last_member = member;
    last_alike = alike;
  }
}

// Members that have none of their object on either side, or neither above nor below.
[[nodiscard]] inline std::uint64_t thin_across(const PixelLinks& links, int w, int y) noexcept {
  if (w < 0 || w >= links.member.width()) return 0;
  const std::uint64_t next = w + 1 < links.member.width() ? links.left(w + 1, y) : 0;
  return links.member(w, y) & ~links.left(w, y) & ~right_bits(links.left(w, y), next);
}
[[nodiscard]] inline std::uint64_t thin_upright(const PixelLinks& links, int w, int y) noexcept {
  if (y < 0 || y >= links.height()) return 0;
  return links.member(w, y) & ~links.above(w, y) & ~(y + 1 < links.height() ? links.above(w, y + 1) : 0);
}

// Row y of `present` becomes the members and the other pixels that take over the depth and the object of a thin member
// beside them. Pulled, from members only, so that pixels are independent.
inline void widen_thin(const PixelLinks& links, ImageView<std::uint64_t> present, ImageView<Vec3f> vertices,
                       ImageView<std::uint32_t> object, int y) noexcept {
  const auto taken = [&links](int x, int row) {
    return x >= links.width || row >= links.height() || PixelLinks::at(links.member, x, row);
  };
  for (int w = 0; w < present.width(); ++w) {
    const std::uint64_t member = links.member(w, y);
    std::uint64_t added = 0;
    const std::uint64_t vacant = ~member & low_bits(std::min(kWordBits, links.width - kWordBits * w));
    if (vacant != 0) {
      const std::uint64_t own = thin_across(links, w, y);
      const std::uint64_t from_left = left_bits(thin_across(links, w - 1, y), own);
      const std::uint64_t from_right = right_bits(own, thin_across(links, w + 1, y));
      const std::uint64_t from_above = thin_upright(links, w, y - 1);
      const std::uint64_t from_below = thin_upright(links, w, y + 1);
      for_set_bits(vacant & (from_left | from_right | from_above | from_below), [&](int i) {
        const int x = kWordBits * w + i;
        const auto take = [&](int from_x, int from_y) {
          const float z = vertices(from_x, from_y).z;
          if (!(z > 0.0F)) return false;
          vertices(x, y).z = z;
          object(x, y) = object(from_x, from_y);
          added |= std::uint64_t{1} << static_cast<unsigned>(i);
          return true;
        };
        if (bit_at(from_left, i) && take(x - 1, y)) return;
        if (bit_at(from_right, i) && taken(x + 2, y) && take(x + 1, y)) return;
        if (bit_at(from_above, i) && take(x, y - 1)) return;
        if (bit_at(from_below, i) && taken(x, y + 2)) static_cast<void>(take(x, y + 1));
      });
    }
    present(w, y) = member | added;
  }
}

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_FOREGROUND_PIXELS_HPP
