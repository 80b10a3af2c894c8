// SPDX-License-Identifier: Apache-2.0
// Dual-reference variance filter, equation (3.3): which pixels lie at an occlusion edge, where a one-layer sheet joins
// surfaces that do not touch.
//
// A window is l x l pixels, named by its upper-left pixel, and lies inside the image. It fires when the population
// variance of its depth is greater than mu (strictly) and it holds two different labels of which at least one belongs
// to the foreground set. The mask marks all pixels of every window that fires. Labels are compared for equality only:
// the printed "variance of h" would depend on how classes are numbered. Invalid depths do not count, neither for
// variance nor for labels; a window with fewer than two valid pixels does not fire.
//
// How: labels first, as bytes, in strips of 512 columns and bands of 16 rows; where no window of a band can hold a
// foreground edge, depth is not read at all. Elsewhere variance is merged in single precision, with or without holes,
// and a window whose variance lies too close to mu for that is decided in double (uncertainty_variance.hpp has the
// bounds). With a window other than 8 or the variance asked for, it is double from the start.
// Error: every decision is that of the variance in double, which is within 1e-12 relative at any depth with the default
// window (uncertainty_variance.hpp has wider ones: 2e-9 at 256); variance_m2 is within 5e-7 relative, and never
// negative. Same bytes for every instruction set and every number of threads.
// Cost: with the default window, one to two copies of the depth, with holes or without; four to five where every pixel
// is a class of its own, nine with holes as well. Memory: one bit per pixel, and 50 KiB of stack (150 KiB for windows
// above 16).
#ifndef NPSIM_DEPTH_UNCERTAINTY_HPP
#define NPSIM_DEPTH_UNCERTAINTY_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/uncertainty_bits.hpp"
#include "npsim/depth/uncertainty_counted.hpp"
#include "npsim/depth/uncertainty_labels.hpp"
#include "npsim/depth/uncertainty_moments.hpp"
#include "npsim/depth/uncertainty_variance.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace v1 {

struct UncertaintyParams {
  int window_px = 8;                        // l of section 3.4.2, 1..256
  double variance_m2 = 0.001;               // mu of section 3.4.2, not the mu of the cross-bilateral filter
  LabelSet foreground = kForegroundLabels;  // section 3.4.2
};

// Views that are left empty are not written. Each has the shape of the depth.
struct UncertaintyOutput {
  ImageView<std::uint8_t> mask;     // U: 1 where the pixel belongs to a window that fires, else 0
  ImageView<std::uint8_t> windows;  // 1 at the upper-left pixel of every window that fires, else 0
  ImageView<float> variance_m2;     // population variance of the window at its upper-left pixel; 0 without a window
};

[[nodiscard]] constexpr std::size_t uncertainty_workspace_bytes(const UncertaintyParams&, Shape shape) noexcept {
  const auto words = shape.empty() ? std::size_t{0} : (static_cast<std::size_t>(shape.width) + 63) / 64;
  return kWorkspaceAlignment + allocation_bytes<std::uint64_t>(words * static_cast<std::size_t>(shape.height));
}

inline namespace NPSIM_ISA_NAMESPACE {
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

  // Decides the windows with upper-left pixels in the rows y .. end - 1. `fires` is zero there, and `variance` too.
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
          tile_of_eights({x + t, y, width, end - y}, columns + t / 64, kept, t);
        } else {
          tile_in_double({x + t, y, width, end - y});
        }
      }
    }
  }

 private:
  static constexpr std::size_t kRows = kBandRows<kMaxWindow>;

  // Windows of 8 x 8. Depth is read for the smallest block that holds all windows with edges.
  void tile_of_eights(const WindowBlock& block, const std::uint64_t* columns, const StripCodes& kept,
                      int x_in_strip) const noexcept {
    std::uint64_t edges[kTileWords][kRows] = {};
    std::uint64_t any[kTileWords] = {};
    int first = block.height;
    int last = -1;
    for (int w = 0; w < kTileWords; ++w) {
      if (columns[w] == 0) continue;
      const int count = block.width - 64 * w < 64 ? block.width - 64 * w : 64;
      const auto codes_of = [&](int y) { return kept.row[y] + x_in_strip + 64 * w; };
      edge_windows_8<F>(codes_of, codes_of, count, block.height, edges[w]);
      for (int y = 0; y < block.height; ++y) {
        if (edges[w][y] == 0) continue;
        any[w] |= edges[w][y];
        first = first < y ? first : y;
        last = last > y ? last : y;
      }
    }
    if (last < 0) return;
    const WindowBlock trimmed{block.x, block.y + first, highest_bit(any) + 1, last - first + 1};
    if (block_without_holes(trimmed, any, &edges[0][first], &edges[1][first])) return;
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
                           const std::uint64_t* right) const noexcept {
    MergedMoments<F> moments;
    if (!moments.read(depth, block, any)) return false;
    if (moments.all_below(threshold)) return true;
    moments.set_threshold(threshold);
    for (int y = 0; y < block.height; ++y) {
      const std::uint64_t row[kTileWords] = {left[y], right[y]};
      if ((row[0] | row[1]) == 0) continue;
      VarianceBits bits;
      moments.decide(y, lowest_bit(row), highest_bit(row), bits);
      for (int w = 0; w < kTileWords; ++w) {
        const std::uint64_t edge = row[w];
        if (edge == 0) continue;
        fires(block.x / 64 + w, block.y + y) =
            (edge & bits.above[w]) | decide_exactly(block.x + 64 * w, block.y + y, edge & bits.doubtful[w]);
      }
    }
    return true;
  }

  // The same where depths are missing, for 64 columns of windows. Those in `any` hold an edge among all their pixels in
  // some row; codes_of(y) are the codes of a row. False, and nothing is done, if a depth is out of range.
  template <class Codes>
  bool word_with_holes(const WindowBlock& block, std::uint64_t any, const Codes& codes_of) const noexcept {
    CountedMoments<F> moments;
    if (!moments.read(depth, block, lowest_bit(any), highest_bit(any))) return false;
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
      moments.decide(y, lowest_bit(edge), highest_bit(edge), above, doubtful);
      fires(block.x / 64, block.y + y) = (edge & above) | decide_exactly(block.x, block.y + y, edge & doubtful);
    }
    return true;
  }

  // Those of the windows from (x, y) on, one per bit, that fire.
  [[nodiscard]] std::uint64_t decide_exactly(int x, int y, std::uint64_t doubtful) const noexcept {
    std::uint64_t above = 0;
    for (; doubtful != 0; doubtful &= doubtful - 1) {
      const double exact = window_variance(depth.sub(x + lowest_bit(doubtful), y, {l, l}));
      if (exact > threshold) above |= doubtful & (~doubtful + 1);
    }
    return above;
  }

  void tile_in_double(const WindowBlock& block) const noexcept {
    WindowSums<kMaxWindow> sums(depth, block, l);
    std::uint64_t edges[kRows][kTileWords];
    const ImageView<const float>* holes = sums.has_holes() ? &depth : nullptr;
    edge_windows<F, kMaxWindow>(codes, labels, holes, block, l, edges);
    for (int y = 0; y < block.height; ++y) {
      double count[kTileWindows];
      double spread[kTileWindows];
      sums.row(y, count, spread);
      for (int i = 0; i < block.width; ++i) {
        const bool edge = (edges[y][i / 64] >> static_cast<unsigned>(i % 64) & 1U) != 0;
        if (!edge && variance.empty()) continue;
        if (count[i] < 2) continue;
        double value = spread[i] / count[i];
        const bool known = variance.empty() ? std::abs(spread[i] - count[i] * threshold) > sums.error()
                                            : sums.error() <= 4e-7 * spread[i];
        if (!known) value = window_variance(depth.sub(block.x + i, block.y + y, {l, l}));
        if (!variance.empty()) variance(block.x + i, block.y + y) = static_cast<float>(value);
        if (edge && value > threshold) {
          fires((block.x + i) / 64, block.y + y) |= std::uint64_t{1} << static_cast<unsigned>((block.x + i) % 64);
        }
      }
    }
  }
};

template <class F, int kMaxWindow, class Executor>
void find_windows(const UncertaintyParams& params, ImageView<const float> depth, ImageView<const Label> labels,
                  ImageView<std::uint64_t> fires, const UncertaintyOutput& output, Executor& executor) noexcept {
  const int l = params.window_px;
  const WindowSearch<F, kMaxWindow> search{
      depth, labels, LabelCodes(params.foreground), l, params.variance_m2, fires, output.variance_m2};
  executor.for_chunks(static_cast<std::size_t>(depth.height()), kBandRows<kMaxWindow>,
                      [&](std::size_t begin, std::size_t end) {
                        const int first = static_cast<int>(begin);
                        const int last = static_cast<int>(end);
                        for (int y = first; y < last; ++y) {
                          for (int w = 0; w < fires.width(); ++w) fires(w, y) = 0;
                          if (output.variance_m2.empty()) continue;
                          for (int x = 0; x < depth.width(); ++x) output.variance_m2(x, y) = 0;
                        }
                        const int bottom = depth.height() - l + 1;
                        if (first < bottom) search.band(first, last < bottom ? last : bottom);
                        for (int y = first; y < last; ++y) {
                          if (!output.windows.empty())
                            write_bits<F>(fires.row(y), output.windows.row(y), depth.width());
                          widen_bits(fires.row(y), fires.width(), l);
                        }
                      });
}

}  // namespace depth_detail

// F: the float batch, simd::scalar::F32 for the one-lane twin.
template <class F = simd::F32, class Executor>
[[nodiscard]] Status uncertainty(const UncertaintyParams& params, ImageView<const float> depth,
                                 ImageView<const Label> labels, const UncertaintyOutput& output, Workspace& workspace,
                                 Executor& executor) noexcept {
  const int l = params.window_px;
  if (l < 1 || l > 256) return {StatusCode::invalid_argument, "uncertainty: window_px must lie in 1..256"};
  if (!(params.variance_m2 >= 0) || !std::isfinite(params.variance_m2)) {
    return {StatusCode::invalid_argument, "uncertainty: variance_m2 must be finite and not negative"};
  }
  if (depth.empty()) return {StatusCode::no_valid_input, "uncertainty: the depth image is empty"};
  const Shape shape = depth.shape();
  const auto fits = [shape](const auto& view) { return view.empty() || view.shape() == shape; };
  if (labels.empty() || labels.shape() != shape || !fits(output.mask) || !fits(output.windows) ||
      !fits(output.variance_m2)) {
    return {StatusCode::shape_mismatch, "uncertainty: labels and outputs must have the shape of the depth"};
  }

  const WorkspaceScope scope(workspace);
  ImageView<std::uint64_t> fires;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(Shape{(shape.width - 1) / 64 + 1, shape.height}, fires));
  if (l <= 16) {
    depth_detail::find_windows<F, 16>(params, depth, labels, fires, output, executor);
  } else {
    depth_detail::find_windows<F, 256>(params, depth, labels, fires, output, executor);
  }
  if (output.mask.empty()) return {};

  // The bits are already as wide as their windows; here the rows of a window are joined.
  executor.for_chunks(static_cast<std::size_t>(shape.height), 16, [&](std::size_t begin, std::size_t end) {
    constexpr int kWords = 32;
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int w = 0; w < fires.width(); w += kWords) {
        const int n = fires.width() - w < kWords ? fires.width() - w : kWords;
        std::uint64_t joined[kWords] = {};
        for (int row = y - l + 1 > 0 ? y - l + 1 : 0; row <= y; ++row) {
          const std::uint64_t* bits = fires.row(row) + w;
          for (int i = 0; i < n; ++i) joined[i] |= bits[i];
        }
        const int left = shape.width - 64 * w;
        depth_detail::write_bits<F>(joined, output.mask.row(y) + 64 * w, left < 64 * kWords ? left : 64 * kWords);
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_DEPTH_UNCERTAINTY_HPP
