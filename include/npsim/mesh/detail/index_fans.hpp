// SPDX-License-Identifier: Apache-2.0
// The fans of faces around the vertices of a layer. Part of index.hpp.
//
// Around a vertex lie four quads, each with two of its edges at the vertex. Going round, these are 8 edge slots; a slot
// is set when the face at that edge of that quad is present. Slots that follow one another belong to faces that share
// an edge, or to one face, so a fan is a cyclic run of set slots. The slots of 64 vertices are eight words of bits.
//
// Exact. Cost: a few instructions a vertex where fans are counted 64 at a time, tens where one is asked for. Memory:
// none.
#ifndef NPSIM_MESH_DETAIL_INDEX_FANS_HPP
#define NPSIM_MESH_DETAIL_INDEX_FANS_HPP

#include <algorithm>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/mesh/detail/connect.hpp"
#include "npsim/mesh/detail/layer.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace mesh_detail {

enum class QuadEdge { top, bottom, left, right };

// Whether the face at an edge of a quad is its upper one.
[[nodiscard]] constexpr bool edge_is_upper(std::uint8_t quad, QuadEdge edge) noexcept {
  const bool anti = (quad & kQuadAntiDiagonal) != 0;
  return edge == QuadEdge::top || (edge == QuadEdge::left && anti) || (edge == QuadEdge::right && !anti);
}
[[nodiscard]] constexpr bool edge_has_face(std::uint8_t quad, QuadEdge edge) noexcept {
  return (quad & (edge_is_upper(quad, edge) ? kQuadUpperFace : kQuadLowerFace)) != 0;
}

// Slot k of a vertex is that of an edge of one of the quads around it, clockwise on the image from the edge above. Each
// quad has two of them at its corner: A sees the quad from upper left, and has slots 2 and 3, and so on.
inline constexpr QuadEdge kSlotEdge[8] = {QuadEdge::left,  QuadEdge::bottom, QuadEdge::top,    QuadEdge::left,
                                          QuadEdge::right, QuadEdge::top,    QuadEdge::bottom, QuadEdge::right};
inline constexpr unsigned kFirstSlot[4] = {2, 4, 0, 6};  // of corners A, B, C, D
inline constexpr unsigned kAllSlots = 0xFF;

[[nodiscard]] constexpr unsigned corner_slots(std::uint8_t quad, unsigned corner) noexcept {
  const unsigned first = kFirstSlot[corner];
  return (edge_has_face(quad, kSlotEdge[first]) ? 1U << first : 0U) |
         (edge_has_face(quad, kSlotEdge[first + 1]) ? 2U << first : 0U);
}

[[nodiscard]] inline unsigned fan_slots(const ImageView<std::uint8_t>& quads, int x, int y) noexcept {
  const bool left = x > 0;
  const bool right = x < quads.width();
  const std::uint8_t* above = y > 0 ? quads.row(y - 1) + x : nullptr;
  const std::uint8_t* below = y < quads.height() ? quads.row(y) + x : nullptr;
  const std::uint8_t a = below != nullptr && right ? below[0] : std::uint8_t{0};  // the quad whose corner A this is
  const std::uint8_t b = below != nullptr && left ? below[-1] : std::uint8_t{0};
  const std::uint8_t c = above != nullptr && right ? above[0] : std::uint8_t{0};
  const std::uint8_t d = above != nullptr && left ? above[-1] : std::uint8_t{0};
  constexpr unsigned kBoth = kQuadUpperFace | kQuadLowerFace;
  if ((static_cast<unsigned>(a & b) & static_cast<unsigned>(c & d) & kBoth) == kBoth) return kAllSlots;
  if ((static_cast<unsigned>(a | b) | static_cast<unsigned>(c | d)) == 0) return 0;
  return corner_slots(a, 0) | corner_slots(b, 1) | corner_slots(c, 2) | corner_slots(d, 3);
}

// Slots that begin a run.
[[nodiscard]] constexpr unsigned fan_starts(unsigned slots) noexcept {
  if (slots == kAllSlots) return 1U;
  return slots & ~(((slots << 1U) | (slots >> 7U)) & kAllSlots);
}
[[nodiscard]] constexpr std::uint32_t bit_count(unsigned bits) noexcept {
  return static_cast<std::uint32_t>(count_bits(bits));
}
// Number, among the fans of a vertex, of the one that holds a slot.
[[nodiscard]] constexpr std::uint32_t fan_of_slot(unsigned slots, unsigned slot) noexcept {
  const unsigned starts = fan_starts(slots);
  for (int step = 0; step < 8 && ((starts >> slot) & 1U) == 0; ++step) slot = (slot + 7U) % 8U;
  return bit_count(starts & ((1U << slot) - 1U));
}

// The slot of a corner of a quad that lies in the quad's upper or lower face.
[[nodiscard]] constexpr unsigned corner_slot(std::uint8_t quad, unsigned corner, bool upper) noexcept {
  const unsigned first = kFirstSlot[corner];
  return edge_is_upper(quad, kSlotEdge[first]) == upper ? first : first + 1;
}

// Per quad, whether the face at each of its edges is present: 64 quads.
struct EdgeBits {
  std::uint64_t top = 0;
  std::uint64_t bottom = 0;
  std::uint64_t left = 0;
  std::uint64_t right = 0;
};

// Per vertex, whether it has at least one fan, two, three, four: 64 vertices.
struct FanBits {
  std::uint64_t at_least[4] = {0, 0, 0, 0};

  [[nodiscard]] std::uint32_t count() const noexcept {
    int n = 0;
    for (const std::uint64_t fans : at_least) n += count_bits(fans);
    return static_cast<std::uint32_t>(n);
  }
  [[nodiscard]] std::uint32_t of(int i) const noexcept {
    std::uint32_t n = 0;
    for (const std::uint64_t fans : at_least) n += bit_at(fans, i) ? 1U : 0U;
    return n;
  }
};

// The fans at the vertices of one row, word by word from the left.
class FanRow {
 public:
  FanRow(const ImageView<std::uint8_t>& quads, int y) noexcept
      : above_(row_or_none(quads, y - 1)), below_(row_or_none(quads, y)), width_(quads.width()) {}

  // Of the vertices of word w, which comes after word w - 1.
  template <class F>
  [[nodiscard]] FanBits next(int w) noexcept {
    const EdgeBits c = edges<F>(above_, w);  // the quads whose corner C these vertices are, and so on
    const EdgeBits a = edges<F>(below_, w);
    const EdgeBits d = shifted(last_above_, c);
    const EdgeBits b = shifted(last_below_, a);
    last_above_ = c;
    last_below_ = a;
    const std::uint64_t slot[8] = {c.left, c.bottom, a.top, a.left, b.right, b.top, d.bottom, d.right};
    FanBits fans;
    std::uint64_t all = ~std::uint64_t{0};
    for (int k = 0; k < 8; ++k) {
      all &= slot[k];
      const std::uint64_t start = slot[k] & ~slot[(k + 7) % 8];
      for (int i = 3; i > 0; --i) fans.at_least[i] |= fans.at_least[i - 1] & start;
      fans.at_least[0] |= start;
    }
    fans.at_least[0] |= all;
    return fans;
  }

 private:
  static const std::uint8_t* row_or_none(const ImageView<std::uint8_t>& quads, int y) noexcept {
    return y >= 0 && y < quads.height() && quads.data() != nullptr ? quads.row(y) : nullptr;
  }
  template <class F>
  [[nodiscard]] EdgeBits edges(const std::uint8_t* row, int w) const noexcept {
    const int n = std::min(kWordBits, width_ - kWordBits * w);
    if (row == nullptr || n <= 0) return {};
    const QuadBits q = load_quads<F>(row + kWordBits * w, n);
    return {q.upper, q.lower, (q.anti & q.upper) | (~q.anti & q.lower), (q.anti & q.lower) | (~q.anti & q.upper)};
  }
  [[nodiscard]] static EdgeBits shifted(const EdgeBits& last, const EdgeBits& e) noexcept {
    return {left_bits(last.top, e.top), left_bits(last.bottom, e.bottom), left_bits(last.left, e.left),
            left_bits(last.right, e.right)};
  }
  const std::uint8_t* above_;
  const std::uint8_t* below_;
  int width_;
  EdgeBits last_above_;
  EdgeBits last_below_;
};

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_INDEX_FANS_HPP
