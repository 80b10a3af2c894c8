// SPDX-License-Identifier: Apache-2.0
// The label term of the dual-reference cross-bilateral filter (3.2): for every pixel p the sums
//   sum_q Gs(|q - p|) z(q)  and  sum_q Gs(|q - p|)   over the pixels q of the window that have p's label.
//
// By tiles of 128x64: for each class with pixels in the tile a masked Gaussian, first along columns, then along rows,
// within the box of the class. A class that fills its box needs no sum of weights: it is a product of two. A tile with
// more classes than kMaxTileClasses, or where their boxes together cost more, takes the direct form, tap by tap.
// Sums have at most 16 terms before they join the next level, so an error is at most label_chain() 2^-24 relative; the
// bits depend on neither lanes nor threads.
// Cost: about 2 (4R + 18) multiplications per pixel and class; direct (2R + 1)^2. Memory: 12 bytes per pixel, and
// 64 (144 + 2R) bytes per strip of 64 rows.
#ifndef NPSIM_DEPTH_CROSS_BILATERAL_LABEL_HPP
#define NPSIM_DEPTH_CROSS_BILATERAL_LABEL_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace v1 {
namespace cross_bilateral_detail {

inline constexpr int kLabelTileWidth = 128;
inline constexpr int kLabelTileHeight = 64;
inline constexpr int kMaxTileClasses = 64;
inline constexpr int kTermRun = 16;        // terms that are added up before their sum joins the next level
inline constexpr int kLabelRows = 8;       // rows of p that share the loads of q
inline constexpr int kKernelPadding = 32;  // zeros on either side of a Gaussian

// The window, cut to what the image can hold.
struct LabelGrid {
  Shape shape;
  int rx = 0, ry = 0;
  int sum_stride = 0;  // of the scratch that holds the sums along columns

  [[nodiscard]] std::size_t scratch_elements() const noexcept {
    return 2 * static_cast<std::size_t>(kLabelRows) * static_cast<std::size_t>(sum_stride);
  }
  [[nodiscard]] int strips() const noexcept { return (shape.height + kLabelTileHeight - 1) / kLabelTileHeight; }
};

[[nodiscard]] inline LabelGrid label_grid(Shape shape, int radius) noexcept {
  LabelGrid g;
  g.shape = shape;
  g.rx = radius < shape.width ? radius : shape.width - 1;
  g.ry = radius < shape.height ? radius : shape.height - 1;
  g.sum_stride = (kLabelTileWidth + 2 * g.rx + kTermRun - 1) / kTermRun * kTermRun + kTermRun;
  return g;
}

// The longest chain of roundings that leads to a sum, weights included.
[[nodiscard]] constexpr int label_chain(const LabelGrid& g) noexcept {
  return 2 * (kTermRun + 2) + (2 * g.rx + 1) / kTermRun + (2 * g.ry + 1) / kTermRun + 6;
}

}  // namespace cross_bilateral_detail

inline namespace NPSIM_ISA_NAMESPACE {
namespace depth_detail {

using namespace cross_bilateral_detail;

template <class LabelPixel>
struct LabelTerm {
  LabelGrid grid;
  ImageView<const LabelPixel> labels;    // of p
  ImageView<const float> depth;          // 0 where a pixel does not count; readable a batch beyond the last column
  ImageView<const std::int32_t> source;  // labels of q, -1 where a pixel does not count; readable likewise
  const float* gaussian = nullptr;       // Gs along an axis by distance, at 0; both signs, zeros beyond the radius
  const double* cumulated = nullptr;     // sum of Gs over distances below i, at 0; -radius..radius + 1
  ImageView<float> numerator;            // rows padded to whole batches
  ImageView<float> denominator;
  Span<float> scratch;  // by strip
};

struct Box {
  int x0 = 0, x1 = 0, y0 = 0, y1 = 0;  // ends excluded

  void add(int begin, int end, int y) noexcept {
    if (x0 == x1) {
      *this = {begin, end, y, y + 1};
    } else {
      x0 = begin < x0 ? begin : x0;
      x1 = end > x1 ? end : x1;
      y1 = y + 1;  // rows come in order
    }
  }
  [[nodiscard]] bool empty() const noexcept { return x0 == x1; }
};

struct TileClass {
  std::int32_t label = -1;
  Box centres;
  Box sources;
  std::int64_t pixels = 0;  // of sources
};

struct TileClasses {
  TileClass classes[kMaxTileClasses];
  int count = 0;

  // nullptr when there are too many.
  [[nodiscard]] TileClass* find(std::int32_t label, bool add) noexcept {
    for (int i = 0; i < count; ++i) {
      if (classes[i].label == label) return &classes[i];
    }
    if (!add || count == kMaxTileClasses) return nullptr;
    classes[count] = TileClass{};
    classes[count].label = label;
    return &classes[count++];
  }
};

// False when there are too many classes.
template <class LabelPixel>
[[nodiscard]] bool tile_classes(const LabelTerm<LabelPixel>& t, const Box& tile, TileClasses& out) noexcept {
  out.count = 0;
  for (int y = tile.y0; y < tile.y1; ++y) {
    const LabelPixel* row = t.labels.row(y);
    for (int begin = tile.x0; begin < tile.x1;) {
      int end = begin + 1;
      while (end < tile.x1 && row[end] == row[begin]) ++end;
      TileClass* c = out.find(row[begin], true);
      if (c == nullptr) return false;
      c->centres.add(begin, end, y);
      begin = end;
    }
  }
  const LabelGrid& g = t.grid;
  const int x0 = tile.x0 > g.rx ? tile.x0 - g.rx : 0;
  const int x1 = tile.x1 + g.rx < g.shape.width ? tile.x1 + g.rx : g.shape.width;
  const int y0 = tile.y0 > g.ry ? tile.y0 - g.ry : 0;
  const int y1 = tile.y1 + g.ry < g.shape.height ? tile.y1 + g.ry : g.shape.height;
  for (int y = y0; y < y1; ++y) {
    const std::int32_t* row = t.source.row(y);
    for (int begin = x0; begin < x1;) {
      int end = begin + 1;
      while (end < x1 && row[end] == row[begin]) ++end;
      TileClass* c = row[begin] < 0 ? nullptr : out.find(row[begin], false);
      if (c != nullptr) {
        c->sources.add(begin, end, y);
        c->pixels += end - begin;
      }
      begin = end;
    }
  }
  return true;
}

// Sums along columns for kLabelRows rows from y on and one batch of columns at x; out at that column.
template <class F, bool kWeights, class LabelPixel>
void sum_columns(const LabelTerm<LabelPixel>& t, const TileClass& c, int x, int y, float* num, float* den) noexcept {
  using I = typename F::Int;
  const F zero(0.0F);
  const F one(1.0F);
  const I label(c.label);
  const int begin = y - t.grid.ry > c.sources.y0 ? y - t.grid.ry : c.sources.y0;
  const int end = y + kLabelRows + t.grid.ry < c.sources.y1 ? y + kLabelRows + t.grid.ry : c.sources.y1;
  F n[kLabelRows];
  F d[kLabelRows];
  for (int i = 0; i < kLabelRows; ++i) n[i] = d[i] = zero;
  for (int run = begin; run < end; run += kTermRun) {
    const int run_end = run + kTermRun < end ? run + kTermRun : end;
    F run_n[kLabelRows];
    F run_d[kLabelRows];
    for (int i = 0; i < kLabelRows; ++i) run_n[i] = run_d[i] = zero;
    for (int q = run; q < run_end; ++q) {
      const auto mine = I::load(t.source.row(q) + x) == label;
      const F z = select(mine, F::load(t.depth.row(q) + x), zero);
      const F w = select(mine, one, zero);
      for (int i = 0; i < kLabelRows; ++i) {
        const F g(t.gaussian[q - y - i]);
        run_n[i] = fma(g, z, run_n[i]);
        if constexpr (kWeights) run_d[i] = fma(g, w, run_d[i]);
      }
    }
    for (int i = 0; i < kLabelRows; ++i) {
      n[i] = n[i] + run_n[i];
      if constexpr (kWeights) d[i] = d[i] + run_d[i];
    }
  }
  for (int i = 0; i < kLabelRows; ++i) {
    n[i].store(num + i * t.grid.sum_stride);
    if constexpr (kWeights) d[i].store(den + i * t.grid.sum_stride);
  }
}

// Sums of those along rows: kLabelRows rows of one batch of pixels at x. num and den point at column 0 of the image.
// Without kWeights, den holds the weights along rows and row_weights those along columns.
template <class F, bool kWeights, class LabelPixel>
void sum_rows(const LabelTerm<LabelPixel>& t, const TileClass& c, int x, int y, int rows, const float* num,
              const float* den, const float* row_weights) noexcept {
  using I = typename F::Int;
  const F zero(0.0F);
  const int lowest = x - t.grid.rx;
  const int highest = x + F::lanes - 1 + t.grid.rx;
  const int begin = lowest > c.sources.x0 ? lowest : c.sources.x0;
  const int end = highest + 1 < c.sources.x1 ? highest + 1 : c.sources.x1;
  F n[kLabelRows];
  F d[kLabelRows];
  for (int i = 0; i < kLabelRows; ++i) n[i] = d[i] = zero;
  for (int q = begin; q < end;) {
    const int run_end = (q / kTermRun + 1) * kTermRun < end ? (q / kTermRun + 1) * kTermRun : end;
    F run_n[kLabelRows];
    F run_d[kLabelRows];
    for (int i = 0; i < kLabelRows; ++i) run_n[i] = run_d[i] = zero;
    for (; q < run_end; ++q) {
      const F g = F::load(t.gaussian + (x - q));
      for (int i = 0; i < kLabelRows; ++i) {
        run_n[i] = fma(g, F(num[i * t.grid.sum_stride + q]), run_n[i]);
        if constexpr (kWeights) run_d[i] = fma(g, F(den[i * t.grid.sum_stride + q]), run_d[i]);
      }
    }
    for (int i = 0; i < kLabelRows; ++i) {
      n[i] = n[i] + run_n[i];
      if constexpr (kWeights) d[i] = d[i] + run_d[i];
    }
  }
  for (int i = 0; i < rows; ++i) {
    if constexpr (!kWeights) d[i] = F::load(den + x) * F(row_weights[i]);
    const int count = t.grid.shape.width - x < F::lanes ? t.grid.shape.width - x : F::lanes;
    I centre(0);
    const LabelPixel* at = t.labels.row(y + i) + x;
    if constexpr (sizeof(LabelPixel) == 1) centre = count < F::lanes ? I::load_u8(at, count) : I::load_u8(at);
    if constexpr (sizeof(LabelPixel) == 2) centre = count < F::lanes ? I::load_u16(at, count) : I::load_u16(at);
    const auto mine = centre == I(c.label);
    float* to_n = t.numerator.row(y + i) + x;
    float* to_d = t.denominator.row(y + i) + x;
    select(mine, n[i], F::load(to_n)).store(to_n);
    select(mine, d[i], F::load(to_d)).store(to_d);
  }
}

// One class of a tile. Sums along columns lie in the scratch by column from the box's first one on.
template <class F, class LabelPixel>
void filter_class(const LabelTerm<LabelPixel>& t, const TileClass& c, float* scratch) noexcept {
  const LabelGrid& g = t.grid;
  const bool full = c.pixels == std::int64_t{c.sources.x1 - c.sources.x0} * (c.sources.y1 - c.sources.y0);
  const int from = c.sources.x0 / kTermRun * kTermRun;
  float* num = scratch;
  float* den = scratch + static_cast<std::ptrdiff_t>(kLabelRows) * g.sum_stride;
  // Of the terms of a full box, those along one axis add up to the difference of two sums. A span beyond the centre is
  // mirrored: far out on that side both sums are nearly the total and would cancel, on the other side both are small.
  const auto span_weight = [&](int at, int begin, int end, int radius) {
    int low = begin - at > -radius ? begin - at : -radius;
    int high = end - at < radius + 1 ? end - at : radius + 1;
    if (low >= high) return 0.0F;
    if (low > 0) {
      const int first = low;
      low = 1 - high;
      high = 1 - first;
    }
    return static_cast<float>(t.cumulated[high] - t.cumulated[low]);
  };
  const int first_x = c.centres.x0 / kTermRun * kTermRun;
  if (full) {
    const int end_x = (c.centres.x1 + kTermRun - 1) / kTermRun * kTermRun;
    for (int x = first_x; x < end_x; ++x) den[x - first_x] = span_weight(x, c.sources.x0, c.sources.x1, g.rx);
  }
  float row_weights[kLabelRows] = {};
  for (int y = c.centres.y0; y < c.centres.y1; y += kLabelRows) {
    const int rows = c.centres.y1 - y < kLabelRows ? c.centres.y1 - y : kLabelRows;
    for (int x = from; x < c.sources.x1; x += F::lanes) {
      if (full) {
        sum_columns<F, false>(t, c, x, y, num + (x - from), den);
      } else {
        sum_columns<F, true>(t, c, x, y, num + (x - from), den + (x - from));
      }
    }
    if (full) {
      for (int i = 0; i < kLabelRows; ++i) {
        row_weights[i] = span_weight(y + i, c.sources.y0, c.sources.y1, g.ry);
      }
    }
    for (int x = first_x; x < c.centres.x1; x += F::lanes) {
      if (full) {
        sum_rows<F, false>(t, c, x, y, rows, num - from, den - first_x, row_weights);
      } else {
        sum_rows<F, true>(t, c, x, y, rows, num - from, den - from, row_weights);
      }
    }
  }
}

// The direct form, for a tile of many classes.
template <class F, class LabelPixel>
void filter_tile_directly(const LabelTerm<LabelPixel>& t, const Box& tile) noexcept {
  using I = typename F::Int;
  const LabelGrid& g = t.grid;
  const F zero(0.0F);
  for (int y = tile.y0; y < tile.y1; ++y) {
    const int y0 = y > g.ry ? y - g.ry : 0;
    const int y1 = y + g.ry + 1 < g.shape.height ? y + g.ry + 1 : g.shape.height;
    for (int x = tile.x0; x < tile.x1; x += F::lanes) {
      const int count = g.shape.width - x < F::lanes ? g.shape.width - x : F::lanes;
      I centre(0);
      if constexpr (sizeof(LabelPixel) == 1) centre = I::load_u8(t.labels.row(y) + x, count);
      if constexpr (sizeof(LabelPixel) == 2) centre = I::load_u16(t.labels.row(y) + x, count);
      F n = zero;
      F d = zero;
      for (int rows = y0; rows < y1; rows += kTermRun) {
        F rows_n = zero;
        F rows_d = zero;
        for (int q = rows; q < rows + kTermRun && q < y1; ++q) {
          F row_n = zero;
          F row_d = zero;
          for (int run = -g.rx; run <= g.rx; run += kTermRun) {
            F run_n = zero;
            F run_d = zero;
            for (int dx = run; dx < run + kTermRun && dx <= g.rx; ++dx) {
              const F w = select(I::load(t.source.row(q) + x + dx) == centre, F(t.gaussian[dx]), zero);
              run_n = fma(w, F::load(t.depth.row(q) + x + dx), run_n);
              run_d = run_d + w;
            }
            row_n = row_n + run_n;
            row_d = row_d + run_d;
          }
          const F w(t.gaussian[q - y]);
          rows_n = fma(w, row_n, rows_n);
          rows_d = fma(w, row_d, rows_d);
        }
        n = n + rows_n;
        d = d + rows_d;
      }
      n.store(t.numerator.row(y) + x);
      d.store(t.denominator.row(y) + x);
    }
  }
}

template <class F, class LabelPixel>
void filter_label_strip(const LabelTerm<LabelPixel>& t, int strip) noexcept {
  const LabelGrid& g = t.grid;
  float* scratch = t.scratch.data() + static_cast<std::size_t>(strip) * g.scratch_elements();
  TileClasses classes;
  Box tile;
  tile.y0 = strip * kLabelTileHeight;
  tile.y1 = tile.y0 + kLabelTileHeight < g.shape.height ? tile.y0 + kLabelTileHeight : g.shape.height;
  const std::int64_t window = std::int64_t{2 * g.rx + 1} * (2 * g.ry + 1);
  for (tile.x0 = 0; tile.x0 < g.shape.width; tile.x0 += kLabelTileWidth) {
    tile.x1 = tile.x0 + kLabelTileWidth < g.shape.width ? tile.x0 + kLabelTileWidth : g.shape.width;
    bool separable = tile_classes(t, tile, classes);
    std::int64_t cost = 0;  // in taps, of both sums
    for (int i = 0; i < classes.count; ++i) {
      const TileClass& c = classes.classes[i];
      const std::int64_t rows = c.centres.y1 - c.centres.y0 + kLabelRows;
      cost += rows * (c.sources.x1 - c.sources.x0 + kTermRun) * (2 * g.ry + 1) +
              rows * (c.centres.x1 - c.centres.x0 + kTermRun) * (2 * g.rx + 1 + kTermRun);
    }
    separable = separable && cost < window * (tile.x1 - tile.x0) * (tile.y1 - tile.y0);
    if (!separable) {
      filter_tile_directly<F>(t, tile);
      continue;
    }
    for (int y = tile.y0; y < tile.y1; ++y) {
      for (int x = tile.x0; x < tile.x1; x += F::lanes) {
        F(0.0F).store(t.numerator.row(y) + x);
        F(0.0F).store(t.denominator.row(y) + x);
      }
    }
    for (int i = 0; i < classes.count; ++i) {
      if (!classes.classes[i].sources.empty()) filter_class<F>(t, classes.classes[i], scratch);
    }
  }
}

}  // namespace depth_detail
}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_DEPTH_CROSS_BILATERAL_LABEL_HPP
