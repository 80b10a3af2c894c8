// SPDX-License-Identifier: Apache-2.0
// The dual-reference variance filter, band by band: labels find the windows with a foreground edge, and the cheapest
// way that is sure of it says which of them have a variance above the threshold. Part of uncertainty.hpp.
//
// Every decision, and every variance within 4e-7 relative before it is rounded to float, is that of window_variance():
// the ways differ in cost alone. Memory: 50 KiB of stack, 150 KiB for windows above 16.
#ifndef NPSIM_DEPTH_DETAIL_UNCERTAINTY_SEARCH_HPP
#define NPSIM_DEPTH_DETAIL_UNCERTAINTY_SEARCH_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/depth/detail/uncertainty/labels.hpp"
#include "npsim/depth/detail/uncertainty/variance.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

// The windows of one image: everything that a band needs.
template <class F, int kMaxWindow>
struct WindowSearch {
  ImageView<const float> depth;
  ImageView<const Label> labels;
  LabelCodes codes;
  int l;
  double threshold;
  ImageView<std::uint64_t> fires;  // 64 windows a word
  ImageView<float> variance;       // may be empty

  // Decides the windows with upper-left pixels in the rows y .. end - 1. `fires` is zero there.
  void band(int y, int end) const noexcept {
    const int right = depth.width() - l + 1;
    for (int x = 0; x < right; x += kStripWindows) {
      const WindowBlock strip{x, y, right - x < kStripWindows ? right - x : kStripWindows, end - y};
      std::uint64_t columns[kStripWords];
      StripCodes kept;
      edge_columns<F, kMaxWindow>(codes, labels, strip, l, columns, kept);
      for (int t = 0; t < strip.width; t += kTileWindows) {
        const int width = strip.width - t < kTileWindows ? strip.width - t : kTileWindows;
        if (!variance.empty()) {
          tile_in_double({x + t, y, width, end - y});
        } else if ((columns[t / 64] | columns[t / 64 + 1]) == 0) {
          continue;
        } else if (l == MergedMoments<F>::kWindow) {
          tile_of_eights({x + t, y, width, end - y}, columns + t / 64, kept, t,
                         t + kTileWindows < strip.width && (columns[t / 64 + 2] | columns[t / 64 + 3]) != 0);
        } else {
          tile_in_double({x + t, y, width, end - y});
        }
      }
    }
  }

 private:
  static constexpr std::size_t kRows = kBandRows<kMaxWindow>;

  // Windows of 8 x 8. Depth is read for the smallest block that holds all windows with edges.
  void tile_of_eights(const WindowBlock& block, const std::uint64_t* columns, const StripCodes& kept, int x_in_strip,
                      bool next_is_wanted) const noexcept {
    std::uint64_t edges[kTileWords][EdgeWindows<F>::kHeight] = {};
    std::uint64_t any[kTileWords] = {};
    int first = block.height;
    int last = -1;
    const EdgeWindows<F> windows(kept, x_in_strip, block.height, columns);
    for (int w = 0; w < kTileWords; ++w) {
      if (columns[w] == 0) continue;
      const int count = block.width - 64 * w < 64 ? block.width - 64 * w : 64;
      windows.word(w, count, edges[w]);
      for (int y = 0; y < block.height; ++y) {
        if (edges[w][y] == 0) continue;
        any[w] |= edges[w][y];
        first = first < y ? first : y;
        last = last > y ? last : y;
      }
    }
    if (last < 0) return;
    const WindowBlock trimmed{block.x, block.y + first, highest_set_bit(any) + 1, last - first + 1};
    if (block_without_holes(trimmed, any, &edges[0][first], &edges[1][first], next_is_wanted)) return;
    for (int w = 0; w < kTileWords; ++w) {
      if (any[w] == 0) continue;
      const int count = block.width - 64 * w < 64 ? block.width - 64 * w : 64;
      const WindowBlock word{trimmed.x + 64 * w, trimmed.y, count, trimmed.height};
      const auto codes_of = [&](int y) { return kept.row[first + y] + x_in_strip + 64 * w; };
      if (!word_with_holes(word, any[w], codes_of)) tile_in_double(word);
    }
  }

  // Decides the windows of the block that have a bit in their row's left or right word; `any` is all rows' together.
  // False, and nothing is done, if a depth is missing or out of range.
  bool block_without_holes(const WindowBlock& block, const std::uint64_t (&any)[kTileWords], const std::uint64_t* left,
                           const std::uint64_t* right, bool next_is_wanted) const noexcept {
    MergedMoments<F> moments;
    if (!moments.read(depth, block, any, next_is_wanted)) return false;
    if (moments.all_below(threshold)) return true;
    moments.set_threshold(threshold);
    for (int y = 0; y < block.height; ++y) {
      const std::uint64_t row[kTileWords] = {left[y], right[y]};
      if ((row[0] | row[1]) == 0) continue;
      VarianceBits bits;
      moments.decide(y, lowest_set_bit(row), highest_set_bit(row), bits);
      for (int w = 0; w < kTileWords; ++w) {
        const std::uint64_t edge = row[w];
        if (edge == 0) continue;
        fires(block.x / 64 + w, block.y + y) =
            (edge & bits.above[w]) |
            decide_exactly(block.x + 64 * w, block.y + y, edge & ~(bits.above[w] | bits.below[w]));
      }
    }
    return true;
  }

  // The same where depths are missing, for 64 columns of windows. Those in `any` hold an edge among all their pixels in
  // some row; codes_of(y) are the codes of a row. False, and nothing is done, if a depth is out of range.
  template <class Codes>
  bool word_with_holes(const WindowBlock& block, std::uint64_t any, const Codes& codes_of) const noexcept {
    CountedMoments<F> moments;
    if (!moments.read(depth, block, lowest_set_bit(any), highest_set_bit(any))) return false;
    if (moments.all_below(threshold)) return true;
    alignas(64) std::uint8_t least[StripCodes::kRows][2 * 64];
    alignas(64) std::uint8_t greatest[StripCodes::kRows][2 * 64];
    constexpr int kBytes = simd::BytesOf<F>::lanes;
    const int read = (block.width + kBytes - 1) / kBytes * kBytes + l - 1;
    for (int y = 0; y < block.height + l - 1; ++y)
      mask_codes<F>(codes_of(y), moments.valid(y), read, least[y], greatest[y]);
    std::uint64_t edges[kRows];
    edge_windows_8<F>([&](int y) { return least[y]; }, [&](int y) { return greatest[y]; }, block.width, block.height,
                      edges);
    moments.set_threshold(threshold);
    for (int y = 0; y < block.height; ++y) {
      const std::uint64_t edge = edges[y] & any;
      if (edge == 0) continue;
      std::uint64_t above = 0;
      std::uint64_t doubtful = 0;
      moments.decide(y, lowest_set_bit(edge), highest_set_bit(edge), above, doubtful);
      fires(block.x / 64, block.y + y) = (edge & above) | decide_exactly(block.x, block.y + y, edge & doubtful);
    }
    return true;
  }

  // Those of the windows from (x, y) on, one per bit, that fire.
  [[nodiscard]] std::uint64_t decide_exactly(int x, int y, std::uint64_t doubtful) const noexcept {
    std::uint64_t above = 0;
    for (; doubtful != 0; doubtful &= doubtful - 1) {
      const double exact = window_variance(depth.sub(x + lowest_set_bit(doubtful), y, {l, l}));
      if (exact > threshold) above |= doubtful & (~doubtful + 1);
    }
    return above;
  }

  // Any window, and the variances if they are asked for.
  void tile_in_double(const WindowBlock& block) const noexcept {
    using Sums = WindowSums<F, kMaxWindow>;
    Sums sums(depth, block, l);
    std::uint64_t edges[kRows][kTileWords];
    const ImageView<const float>* holes = sums.has_holes() ? &depth : nullptr;
    edge_windows<F, kMaxWindow>(codes, labels, holes, block, l, edges);
    const F off(static_cast<float>(sums.error() * (1 + 1e-6)));
    for (int y = 0; y < block.height; ++y) {
      const std::uint64_t(&row)[kTileWords] = edges[y];
      typename Sums::Row known;
      sums.row(y, known);
      if (!variance.empty()) write_variance(block, y, known, sums.error());
      if ((row[0] | row[1]) == 0) continue;
      alignas(64) float margin[kTileWindows];
      for (int i = 0; i < block.width; ++i) {
        margin[i] = static_cast<float>(known.spread[i] - known.count[i] * threshold);
      }
      for (int w = 0; w < kTileWords; ++w) {
        if (row[w] == 0) continue;
        std::uint64_t above = 0;
        std::uint64_t doubtful = 0;
        for (int i = 0; i < 64; i += F::lanes) {
          const F own = F::load(margin + 64 * w + i);
          const auto is_above = own > off;
          above |= std::uint64_t{bits(is_above)} << static_cast<unsigned>(i);
          doubtful |= std::uint64_t{bits(~(is_above | (own < -off)))} << static_cast<unsigned>(i);
        }
        fires(block.x / 64 + w, block.y + y) =
            (row[w] & above) | decide_exactly(block.x + 64 * w, block.y + y, row[w] & doubtful);
      }
    }
  }

  // Within 4e-7 and the rounding to float; where the sums are not sure of that, exactly.
  void write_variance(const WindowBlock& block, int y, const typename WindowSums<F, kMaxWindow>::Row& known,
                      double error) const noexcept {
    float* out = variance.row(block.y + y) + block.x;
    int unsure = 0;
    for (int i = 0; i < block.width; ++i) {
      const double n = known.count[i] > 1 ? known.count[i] : 1;
      out[i] = static_cast<float>(known.spread[i] / n);
      unsure += error > 4e-7 * known.spread[i] ? 1 : 0;
    }
    if (unsure == 0) return;
    for (int i = 0; i < block.width; ++i) {
      if (known.count[i] < 2) {
        out[i] = 0;
      } else if (error > 4e-7 * known.spread[i]) {
        out[i] = static_cast<float>(window_variance(depth.sub(block.x + i, block.y + y, {l, l})));
      }
    }
  }
};

// Searches all windows of the image. search.fires: becomes the bits of the windows that fire, each with the l - 1
// columns that follow it. windows: empty, or gets 1 at the upper-left pixel of each, else 0.
template <class F, int kMaxWindow, class Executor>
void find_windows(const WindowSearch<F, kMaxWindow>& search, ImageView<std::uint8_t> windows,
                  Executor& executor) noexcept {
  const int width = search.depth.width();
  const int height = search.depth.height();
  const int right = width - search.l + 1;
  const int bottom = height - search.l + 1;
  const ImageView<std::uint64_t>& fires = search.fires;
  executor.for_chunks(static_cast<std::size_t>(height), kBandRows<kMaxWindow>, [&](std::size_t begin, std::size_t end) {
    const int first = static_cast<int>(begin);
    const int last = static_cast<int>(end);
    for (int y = first; y < last; ++y) {
      for (int w = 0; w < fires.width(); ++w) fires(w, y) = 0;
      if (search.variance.empty()) continue;
      const int inside = y < bottom && right > 0 ? right : 0;
      for (int x = inside; x < width; ++x) search.variance(x, y) = 0;
    }
    if (first < bottom) search.band(first, last < bottom ? last : bottom);
    for (int y = first; y < last; ++y) {
      if (!windows.empty()) write_bits<F>(fires.row(y), windows.row(y), width);
      widen_bits(fires.row(y), fires.width(), search.l);
    }
  });
}

// 1 at the pixels of every window that fires. fires: as find_windows() leaves it; here the rows of a window are joined.
template <class F, class Executor>
void mark_windows(ImageView<const std::uint64_t> fires, int l, ImageView<std::uint8_t> mask,
                  Executor& executor) noexcept {
  const int width = mask.width();
  executor.for_chunks(static_cast<std::size_t>(mask.height()), 16, [&](std::size_t begin, std::size_t end) {
    constexpr int kWords = 32;
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int w = 0; w < fires.width(); w += kWords) {
        const int n = fires.width() - w < kWords ? fires.width() - w : kWords;
        std::uint64_t joined[kWords] = {};
        for (int row = y - l + 1 > 0 ? y - l + 1 : 0; row <= y; ++row) {
          const std::uint64_t* bits = fires.row(row) + w;
          for (int i = 0; i < n; ++i) joined[i] |= bits[i];
        }
        const int left = width - 64 * w;
        write_bits<F>(joined, mask.row(y) + 64 * w, left < 64 * kWords ? left : 64 * kWords);
      }
    }
  });
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_UNCERTAINTY_SEARCH_HPP
