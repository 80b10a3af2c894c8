// SPDX-License-Identifier: Apache-2.0
// The label term of one class in one tile: a masked Gaussian along columns, then along rows, where the class is wanted.
//
// Numerators: per chunk of columns the class' depths (0 elsewhere) are summed along columns in floats, and those sums,
// transposed and in double, along rows. Denominators: along rows from the ends of the class' runs, along columns in
// double; where the class fills the window, the product of two sums of weights.
// Cost, R = 30, for a chunk and 16 rows: 32 products a row in floats, 64 for the rows, 64 for denominators.
#ifndef NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_CLASS_HPP
#define NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_CLASS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "npsim/depth/detail/cross_bilateral/label_grid.hpp"
#include "npsim/depth/detail/cross_bilateral/label_members.hpp"
#include "npsim/depth/detail/cross_bilateral/label_sums.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/double.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

template <class F, class LabelPixel>
class ClassFilter {
 public:
  ClassFilter(const LabelTerm<LabelPixel>& term, const LabelTile& tile) noexcept
      : t_(term), g_(term.grid), tile_(tile), m_(term, tile) {
    const auto slot = static_cast<std::size_t>(tile.slot);
    across_ = t_.doubles.data() + slot * g_.slot_doubles();
    weights_ = across_ + block(kLabelGroups, 0);
    samples_ = t_.floats.data() + slot * g_.slot_floats();
    block_ = samples_ + g_.window_rows() * kLabelChunkPx;
  }

  void filter(const TileClass& c) noexcept {
    m_.find(c);
    sum_numerator_columns();
    for (int k = m_.begin(); k < m_.end(); ++k) sum_denominators(k);
    for (int group = m_.first_group(); group < m_.end_group(); ++group) {
      for (int k = m_.begin(); k < m_.end(); ++k) {
        if (m_.wanted(group, k)) sum_numerator_rows(group, k);
      }
    }
  }

 private:
  using I = typename F::Int;
  using D = simd::Double<F>;

  [[nodiscard]] std::ptrdiff_t block(int group, int column) const noexcept {
    return (static_cast<std::ptrdiff_t>(group) * g_.tile_chunks + column) * kLabelBlock;
  }

  // Sums along columns of the chunks that some row sum reads, by columns and in double.
  void sum_numerator_columns() noexcept {
    for (int k = m_.begin() - g_.halo; k < m_.end() + g_.halo; ++k) {
      int from = kLabelGroups;  // groups with samples
      int to = -1;
      for (int group = m_.first_group(); group < m_.end_group(); ++group) {
        if (!m_.reached(group, k)) continue;
        if (m_.empty(group, k)) {
          double* zero = across_ + block(group, m_.column(k));
          for (int i = 0; i < kLabelBlock; i += D::lanes) D(0.0).store(zero + i);
          continue;
        }
        if (from == kLabelGroups) from = group;
        to = group;
      }
      if (to < 0) continue;
      load_samples(k, from, to);
      for (int group = from; group <= to; ++group) {
        if (!m_.reached(group, k) || m_.empty(group, k)) continue;
        const float* first = samples_ + (g_.padding_rows() + group * kLabelGroupRows) * kLabelChunkPx;
        sum_block<F>(first, t_.weights.halved_f.data(), g_.runs_y, block_);
        transpose_block<F>(block_, block_ + kLabelBlock);
        double* out = across_ + block(group, m_.column(k));
        for (int i = 0; i < kLabelBlock; i += D::lanes) D::load(block_ + kLabelBlock + i).store(out + i);
      }
    }
  }

  // The class' depths in chunk k for groups from..to, 0 elsewhere.
  void load_samples(int k, int from, int to) noexcept {
    const int begin = from * kLabelGroupRows;
    const int end = (to + 1) * kLabelGroupRows + 2 * g_.padding_rows();
    const int first = m_.rows_begin(from);
    const int last = m_.rows_end(to);
    const F zero(0.0F);
    const auto clear = [&](int row) {
      for (int i = 0; i < kLabelChunkPx; i += F::lanes) zero.store(samples_ + row * kLabelChunkPx + i);
    };
    for (int row = begin; row < first; ++row) clear(row);
    const bool whole = m_.inside(k) == 0xFFFF;
    const std::int32_t* words = m_.members(first, k);
    const float* depth = t_.depth.row(m_.top() + first) + k * kLabelChunkPx;
    for (int row = first; row < last; ++row) {
      const auto word = static_cast<std::uint32_t>(*words);
      for (int i = 0; i < kLabelChunkPx; i += F::lanes) {
        const auto mine = F::MaskType::from_bits(word >> static_cast<unsigned>(i));
        const F z = whole ? F::load(depth + i) : load_depths<F>(t_.depth, k * kLabelChunkPx + i, m_.top() + row);
        select(mine, z, zero).store(samples_ + row * kLabelChunkPx + i);
      }
      words += g_.mask_stride;
      if (row + 1 < last) depth += t_.depth.stride();
    }
    for (int row = last; row < end; ++row) clear(row);
  }

  void sum_denominators(int k) noexcept {
    bool full[kLabelGroups] = {};
    int from = kLabelGroups;  // groups whose windows the class does not fill
    int to = -1;
    for (int group = m_.first_group(); group < m_.end_group(); ++group) {
      if (!m_.wanted(group, k)) continue;
      full[group] = m_.fills_window(group, k);
      if (full[group]) {
        multiply_weights(group, k);
        store_block(group, k, t_.denominator);
      } else {
        if (from == kLabelGroups) from = group;
        to = group;
      }
    }
    if (to < 0) return;
    sum_weight_rows(k, from, to);
    for (int group = from; group <= to; ++group) {
      if (!m_.wanted(group, k) || full[group]) continue;
      const double* first = weights_ + (g_.padding_rows() + group * kLabelGroupRows) * kLabelChunkPx;
      sum_block<D>(first, t_.weights.halved.data(), g_.runs_y, block_);
      store_block(group, k, t_.denominator);
    }
  }

  void sum_weight_rows(int k, int from, int to) noexcept {
    const int begin = from * kLabelGroupRows;
    const int end = (to + 1) * kLabelGroupRows + 2 * g_.padding_rows();
    const int first = m_.rows_begin(from);
    const int last = m_.rows_end(to);
    const auto clear = [&](int row) {
      for (int i = 0; i < kLabelChunkPx; i += D::lanes) D(0.0).store(weights_ + row * kLabelChunkPx + i);
    };
    for (int row = begin; row < first; ++row) clear(row);
    const std::int32_t* words = m_.members(first, k);
    const std::int32_t* changed = m_.changed(first, k);
    double* out = weights_ + first * kLabelChunkPx;
    for (int row = first; row < last; ++row) {
      if (row > first && *changed == 0) {
        for (int i = 0; i < kLabelChunkPx; i += D::lanes) D::load(out + i - kLabelChunkPx).store(out + i);
      } else {
        sum_members<F>(t_.weights, g_.halo, words, out);
      }
      words += g_.mask_stride;
      changed += g_.mask_stride;
      out += kLabelChunkPx;
    }
    for (int row = last; row < end; ++row) clear(row);
  }

  // Of a window that the class fills, as far as it lies in the image.
  void multiply_weights(int group, int k) noexcept {
    const auto weight = [&](int at, int size) {
      return t_.weights.total - t_.weights.tail(at + 1) - (at < size ? t_.weights.tail(size - at) : 0.0);
    };
    // Where all 16 windows end inside the image, no tail is cut off.
    const auto inside = [&](int first, int radius, int size) {
      return first >= radius && first + kLabelChunkPx + radius <= size;
    };
    const int x0 = k * kLabelChunkPx;
    const int y0 = tile_.y0 + group * kLabelGroupRows;
    double columns[kRowLength];
    const bool all_columns = inside(x0, g_.rx, g_.shape.width);
    const bool all_rows = inside(y0, g_.ry, g_.shape.height);
    for (int i = 0; i < kLabelChunkPx; ++i) {
      columns[i] = all_columns ? t_.weights.total : weight(x0 + i, g_.shape.width);
    }
    for (int row = 0; row < kLabelGroupRows; ++row) {
      const D of_row(all_rows ? t_.weights.total : weight(y0 + row, g_.shape.height));
      for (int i = 0; i < kLabelChunkPx; i += D::lanes) {
        (of_row * D::load(columns + i)).store(block_ + row * kLabelChunkPx + i);
      }
    }
  }

  void sum_numerator_rows(int group, int k) noexcept {
    sum_block<D>(across_ + block(group, m_.column(k)), t_.weights.halved.data(), g_.runs_x, block_ + kLabelBlock);
    transpose_block<F>(block_ + kLabelBlock, block_);
    store_block(group, k, t_.numerator);
  }

  // The class' own pixels of a block.
  void store_block(int group, int k, const ImageView<float>& out) noexcept {
    const I label(m_.label());
    const int y0 = tile_.y0 + group * kLabelGroupRows;
    const int rows = tile_.y1 - y0 < kLabelGroupRows ? tile_.y1 - y0 : kLabelGroupRows;
    float* to = sum_at(t_, out, tile_, k * kLabelChunkPx, y0);
    for (int row = 0; row < rows; ++row) {
      const bool whole = t_.uniform.row(y0 + row)[k] == m_.label();
      for (int i = 0; i < kLabelChunkPx; i += F::lanes) {
        F sum = F::load(block_ + row * kLabelChunkPx + i);
        if (!whole) {
          const auto mine = load_labels<F>(t_.labels, k * kLabelChunkPx + i, y0 + row) == label;
          sum = select(mine, sum, F::load(to + i));
        }
        sum.store(to + i);
      }
      to += out.stride();
    }
  }

  const LabelTerm<LabelPixel>& t_;
  const LabelGrid& g_;
  LabelTile tile_;
  ClassMembers<F, LabelPixel> m_;
  double* across_ = nullptr;   // sums along columns, blocks by columns
  double* weights_ = nullptr;  // sums of weights along rows
  float* samples_ = nullptr;   // by window row
  float* block_ = nullptr;     // two blocks
};

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_CLASS_HPP
