// SPDX-License-Identifier: Apache-2.0
// What the label term reads and writes, and where a tile's window holds samples of one class.
//
// A member is a pixel with the class' label and a valid depth: a bit in a word of 16 columns. Exact. Cost: a comparison
// per 16 pixels of the window of a tile and class, one per pixel where chunks mix labels or have holes.
#ifndef NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_MEMBERS_HPP
#define NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_MEMBERS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/depth/detail/cross_bilateral/label_grid.hpp"
#include "npsim/depth/detail/valid_depths.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/fixed.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

using namespace cross_bilateral_detail;

template <class LabelPixel>
struct LabelTerm {
  LabelGrid grid;
  LabelWeights weights;
  ImageView<const float> depth;
  ImageView<const LabelPixel> labels;
  ImageView<std::int32_t> uniform;  // by chunk: the label if all its pixels have it and a valid depth, else -1
  ImageView<float> numerator;       // of the image, or of a tile by slot; rows in whole chunks
  ImageView<float> denominator;
  bool by_slot = false;
  Span<double> doubles;  // scratch, by slot
  Span<float> floats;
  Span<std::int32_t> masks;
};

// Chunks k0..k1 and rows y0..y1 of the image, ends excluded, and whose scratch they use.
struct LabelTile {
  int k0 = 0, k1 = 0, y0 = 0, y1 = 0;
  int slot = 0;
};

// Where the sums of a tile's pixel go.
template <class LabelPixel>
[[nodiscard]] float* sum_at(const LabelTerm<LabelPixel>& t, const ImageView<float>& plane, const LabelTile& tile, int x,
                            int y) noexcept {
  if (!t.by_slot) return plane.row(y) + x;
  return plane.row(tile.slot * kLabelTileRows + y - tile.y0) + (x - tile.k0 * kLabelChunkPx);
}

// A batch of a row from x on, 0 beyond the image.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE F load_depths(const ImageView<const float>& depth, int x, int y) noexcept {
  const int n = depth.width() - x;
  return n >= F::lanes ? F::load(depth.row(y) + x) : n > 0 ? F::load(depth.row(y) + x, n) : F(0.0F);
}
template <class F, class LabelPixel>
[[nodiscard]] NPSIM_ALWAYS_INLINE typename F::Int load_labels(const ImageView<const LabelPixel>& labels, int x,
                                                              int y) noexcept {
  using I = typename F::Int;
  const int n = labels.width() - x;
  if (n <= 0) return I(0);
  const LabelPixel* p = labels.row(y) + x;
  if constexpr (sizeof(LabelPixel) == 1) {
    return n >= F::lanes ? I::load_u8(p) : I::load_u8(p, n);
  } else {
    return n >= F::lanes ? I::load_u16(p) : I::load_u16(p, n);
  }
}

struct TileClass {
  std::int32_t label = -1;
  std::uint32_t centres[kLabelGroups] = {};  // a bit for each chunk that holds some
};

template <class F, class LabelPixel>
class ClassMembers {
 public:
  ClassMembers(const LabelTerm<LabelPixel>& term, const LabelTile& tile) noexcept
      : t_(term), g_(term.grid), tile_(tile), first_(tile.k0 - term.grid.halo) {
    members_ = t_.masks.data() + static_cast<std::size_t>(tile.slot) * g_.slot_masks();
    changed_ = members_ + g_.window_rows() * g_.mask_stride;
    all_ = changed_ + g_.window_rows() * g_.mask_stride;
    any_ = all_ + kLabelGroups * g_.mask_stride;
    reach_ = any_ + kLabelGroups * g_.mask_stride;
  }

  void find(const TileClass& c) noexcept {
    c_ = &c;
    find_extent();
    find_members();
    fetched_ = true;
    for (int group = first_group_; group <= last_group_; ++group) sum_up(group);
    find_changes();
  }

  [[nodiscard]] std::int32_t label() const noexcept { return c_->label; }
  // Groups and chunks that hold pixels of the class; ends excluded.
  [[nodiscard]] int first_group() const noexcept { return first_group_; }
  [[nodiscard]] int end_group() const noexcept { return last_group_ + 1; }
  [[nodiscard]] int begin() const noexcept { return begin_; }
  [[nodiscard]] int end() const noexcept { return end_; }
  // Of chunk k in the planes that hold the tile and its halos.
  [[nodiscard]] int column(int k) const noexcept { return k - first_; }
  [[nodiscard]] bool wanted(int group, int k) const noexcept {
    return (c_->centres[group] >> static_cast<unsigned>(k - tile_.k0) & 1U) != 0;
  }
  // A sum along rows in the group reads the chunk; no sample of the class is in its window rows.
  [[nodiscard]] bool reached(int group, int k) const noexcept { return reach_[mask_at(group, k)] != 0; }
  [[nodiscard]] bool empty(int group, int k) const noexcept { return any_[mask_at(group, k)] == 0; }
  [[nodiscard]] const std::int32_t* members(int row, int k) const noexcept { return members_ + mask_at(row, k); }
  // By rows as members(): not 0 where the window of the chunk's pixels differs from that in the row above.
  [[nodiscard]] const std::int32_t* changed(int row, int k) const noexcept { return changed_ + mask_at(row, k); }
  [[nodiscard]] int top() const noexcept { return tile_.y0 - g_.padding_rows(); }  // the image's row of window row 0
  // Window rows that group needs, ends excluded: those in the image.
  [[nodiscard]] int rows_begin(int group) const noexcept {
    const int y = tile_.y0 + group * kLabelGroupRows - g_.ry;
    return (y > 0 ? y : 0) - top();
  }
  [[nodiscard]] int rows_end(int group) const noexcept {
    const int y = tile_.y0 + (group + 1) * kLabelGroupRows + g_.ry;
    return (y < g_.shape.height ? y : g_.shape.height) - top();
  }
  [[nodiscard]] std::int32_t inside(int k) const noexcept {  // pixels of a chunk that lie in the image
    const int n = g_.shape.width - k * kLabelChunkPx;
    return n >= kLabelChunkPx ? 0xFFFF : static_cast<std::int32_t>((1U << static_cast<unsigned>(n)) - 1U);
  }

  // Whether all of the window that lies in the image is the class'.
  [[nodiscard]] bool fills_window(int group, int k) const noexcept {
    const int begin = k - g_.halo > 0 ? k - g_.halo : 0;
    const int end = k + g_.halo + 1 < g_.chunks ? k + g_.halo + 1 : g_.chunks;
    for (int at = begin; at < end; ++at) {
      if (all_[mask_at(group, at)] != inside(at)) return false;
    }
    return true;
  }

 private:
  using I = typename F::Int;

  [[nodiscard]] int mask_at(int row, int k) const noexcept { return row * g_.mask_stride + column(k); }

  void find_extent() noexcept {
    std::uint32_t chunks = 0;
    first_group_ = -1;
    for (int group = 0; group < kLabelGroups; ++group) {
      if (c_->centres[group] == 0) continue;
      chunks |= c_->centres[group];
      if (first_group_ < 0) first_group_ = group;
      last_group_ = group;
    }
    begin_ = tile_.k0 + lowest_set_bit(chunks);
    end_ = tile_.k0 + highest_set_bit(chunks) + 1;
  }

  void find_members() noexcept {
    const int from = begin_ - g_.halo;
    const int to = end_ + g_.halo;
    const int source_begin = from > 0 ? from : 0;
    const int source_end = to < g_.chunks ? to : g_.chunks;
    const int first = rows_begin(first_group_);
    const I label(c_->label);
    const I zero(0);
    for (int row = first; row < rows_end(last_group_); ++row) {
      const int y = top() + row;
      std::int32_t* out = members_ + mask_at(row, from);
      const std::int32_t* uniform = t_.uniform.row(y);
      for (int k = from; k < source_begin; ++k) out[k - from] = 0;
      for (int k = source_begin; k < source_end; k += I::lanes) {
        const int n = source_end - k < I::lanes ? source_end - k : I::lanes;
        const I of_chunk = n == I::lanes ? I::load(uniform + k) : I::load(uniform + k, n);
        select(of_chunk == label, I(0xFFFF), zero).store(out + (k - from));
        for (std::uint32_t mixed = bits(of_chunk < zero); mixed != 0; mixed &= mixed - 1) {
          const int at = k + lowest_set_bit(mixed);
          out[at - from] = members_of(at, y, label);
        }
      }
      for (int k = source_end; k < to; ++k) out[k - from] = 0;
      for (int k = fetched_ ? source_end : source_begin; k < source_end; ++k) {
        simd::prefetch(t_.depth.row(y) + k * kLabelChunkPx);
      }
    }
  }

  // By group: which chunks hold members, which nothing else, and which are read.
  void sum_up(int group) noexcept {
    for (int k = begin_ - g_.halo; k < end_ + g_.halo; k += I::lanes) {
      I all(0xFFFF);
      I any(0);
      for (int row = rows_begin(group); row < rows_end(group); ++row) {
        const I word = I::load(members_ + mask_at(row, k));
        all = all & word;
        any = any | word;
      }
      all.store(all_ + mask_at(group, k));
      any.store(any_ + mask_at(group, k));
      I(0).store(reach_ + mask_at(group, k));
    }
    for (int k = begin_; k < end_; ++k) {
      if (!wanted(group, k)) continue;
      for (int at = k - g_.halo; at <= k + g_.halo; ++at) reach_[mask_at(group, at)] = 1;
    }
  }

  [[nodiscard]] std::int32_t members_of(int k, int y, I label) const noexcept {
    std::uint32_t word = 0;
    for (int i = 0; i < kLabelChunkPx; i += F::lanes) {
      const int x = k * kLabelChunkPx + i;
      const auto mine = (load_labels<F>(t_.labels, x, y) == label) & are_valid_depths(load_depths<F>(t_.depth, x, y));
      word |= bits(mine) << static_cast<unsigned>(i);
    }
    return static_cast<std::int32_t>(word);
  }

  // As far as the window reaches.
  void find_changes() noexcept {
    for (int k = begin_; k < end_; k += I::lanes) {
      for (int row = rows_begin(first_group_) + 1; row < rows_end(last_group_); ++row) {
        I changed(0);
        for (int at = k - g_.halo; at <= k + g_.halo; ++at) {
          changed = changed | (I::load(members_ + mask_at(row, at)) ^ I::load(members_ + mask_at(row - 1, at)));
        }
        changed.store(changed_ + mask_at(row, k));
      }
    }
  }

  const LabelTerm<LabelPixel>& t_;
  const LabelGrid& g_;
  const TileClass* c_ = nullptr;
  LabelTile tile_;
  int first_;                             // chunk of column 0
  int first_group_ = 0, last_group_ = 0;  // with centres
  int begin_ = 0, end_ = 0;               // chunks with centres
  bool fetched_ = false;                  // the tile's depths
  std::int32_t* members_ = nullptr;       // by window row
  std::int32_t* changed_ = nullptr;       // likewise
  std::int32_t* all_ = nullptr;           // by group, over its window rows
  std::int32_t* any_ = nullptr;
  std::int32_t* reach_ = nullptr;
};

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_MEMBERS_HPP
