// SPDX-License-Identifier: Apache-2.0
// The cross-bilateral filter with a given batch: samples loaded, both terms summed, their quotient.
//
// Labels alone are divided tile by tile; with colour both sums are kept as images, because blocks of colours are left
// out by what the label term has summed. The same bits for every number of lanes and threads.
#ifndef NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_FILTER_HPP
#define NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_FILTER_HPP

#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/cross_bilateral/colour.hpp"
#include "npsim/depth/detail/cross_bilateral/label.hpp"
#include "npsim/depth/detail/cross_bilateral/plan.hpp"
#include "npsim/depth/detail/valid_depths.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace cross_bilateral_detail {

using depth_detail::are_valid_depths;

inline constexpr float kNoWeight = 1e-12F;

template <class LabelPixel>
struct FilterState {
  ColourGrid grid;
  ColourSamples samples;
  ColourTerm colour;
  LabelTerm<LabelPixel> label;
};

template <class T>
[[nodiscard]] Status allocate_padded(const ColourGrid& g, Workspace& workspace, ImageView<T>& plane) noexcept {
  Span<T> elements;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(g.samples(), elements));
  plane = ImageView<T>(elements.data() + g.padding, g.shape, g.sample_stride);
  return {};
}

// The least and the largest of some depths.
struct DepthRange {
  float low = std::numeric_limits<float>::max();
  float high = 0.0F;
};

// Samples of one row as the colour term reads them, padding included.
template <class F>
[[nodiscard]] DepthRange load_row(const FilterTerms& terms, const ColourGrid& g, ImageView<const float> depth,
                                  ImageView<const Vec3f> lab, const ColourSamples& s, int y) noexcept {
  const F zero(0.0F);
  const F most(kMaxColour);
  const float no_colour_b = kNoColour * static_cast<float>(y + 1);
  const auto no_colour_a = [&](auto x) { return decltype(x)(kNoColour) * (x + decltype(x)(1.0F)); };
  const int width = g.shape.width;
  DepthRange range;
  F low(range.low);
  F high(range.high);
  for (int x = 0; x < width; x += F::lanes) {
    const int n = width - x < F::lanes ? width - x : F::lanes;
    const F z = F::load(depth.row(y) + x, n);
    const simd::F32x3<F> c = simd::load3<F>(&lab.row(y)[x].x, n);
    const auto valid = are_valid_depths(z);
    auto coloured = (abs(c.x) <= most) & (abs(c.y) <= most) & (abs(c.z) <= most);
    if (terms.keep_invalid) coloured = coloured & valid;
    low = select(valid, min(low, z), low);
    high = select(valid, max(high, z), high);
    select(valid, z, zero).store(s.depth.row(y) + x);
    select(coloured, c.x, zero).store(s.l.row(y) + x);
    select(coloured, c.y, no_colour_a(F(static_cast<float>(x + g.padding)) + F::iota())).store(s.a.row(y) + x);
    select(coloured, c.z, F(no_colour_b)).store(s.b.row(y) + x);
  }
  const auto none = [&](int x) {
    s.depth.row(y)[x] = 0.0F;
    s.l.row(y)[x] = 0.0F;
    s.a.row(y)[x] = no_colour_a(static_cast<float>(x + g.padding));
    s.b.row(y)[x] = no_colour_b;
  };
  for (int x = -g.padding; x < 0; ++x) none(x);
  for (int x = width; x < g.sample_stride - g.padding; ++x) none(x);
  return {simd::least_lane(low), -simd::least_lane(-high)};
}

// The depth of a batch of pixels from both sums; z is what they had.
template <class F>
[[nodiscard]] F divide_sums(const FilterTerms& terms, F numerator, F denominator, F z) noexcept {
  const F d = numerator / denominator;
  auto valid = (denominator > F(kNoWeight)) & simd::is_finite(d);
  if (terms.keep_invalid) valid = valid & are_valid_depths(z);
  return select(valid, d, F(0.0F));
}

// Both terms together, or colour alone, one row.
template <class F, class LabelPixel>
void combine_row(const FilterTerms& terms, const FilterState<LabelPixel>& s, int y, ImageView<float> output) noexcept {
  const ColourGrid& g = s.grid;
  const F zero(0.0F);
  const int strip = y / g.strip_rows;
  const bool tail = strip > 0 && y - strip * g.strip_rows < g.ry;
  for (int x = 0; x < g.shape.width; x += F::lanes) {
    const int n = g.shape.width - x < F::lanes ? g.shape.width - x : F::lanes;
    const F z = F::load(s.samples.depth.row(y) + x);
    const auto total = [&](int plane) {
      const float* hi = s.colour.sums_row(strip, y) + 2 * plane * g.width + x;
      F sum = F::load(hi) + F::load(hi + g.width);
      if (tail) {
        const float* above = s.colour.sums_row(strip - 1, y) + 2 * plane * g.width + x;
        sum = sum + (F::load(above) + F::load(above + g.width));
      }
      return sum;
    };
    const F self = select((F::load(s.samples.a.row(y) + x) < F(kMaxColour * 2.0F)) & (z > zero), F(1.0F), zero);
    F numerator = F(terms.mu) * fma(self, z, total(0));
    F denominator = F(terms.mu) * (self + total(1));
    if (terms.labels) {
      numerator = numerator + F::load(s.label.numerator.row(y) + x);
      denominator = denominator + F::load(s.label.denominator.row(y) + x);
    }
    divide_sums(terms, numerator, denominator, z).store(output.row(y) + x, n);
  }
}

// Labels alone, one tile.
template <class F, class LabelPixel>
void combine_tile(const FilterTerms& terms, const LabelTerm<LabelPixel>& t, const LabelTile& tile,
                  ImageView<float> output) noexcept {
  const int width = output.width();
  const int end = tile.k1 * kLabelChunkPx < width ? tile.k1 * kLabelChunkPx : width;
  for (int y = tile.y0; y < tile.y1; ++y) {
    for (int x = tile.k0 * kLabelChunkPx; x < end; x += F::lanes) {
      const F numerator = F::load(sum_at(t, t.numerator, tile, x, y));
      const F denominator = F::load(sum_at(t, t.denominator, tile, x, y));
      const F z = terms.keep_invalid ? load_depths<F>(t.depth, x, y) : F(0.0F);
      const int n = width - x < F::lanes ? width - x : F::lanes;
      divide_sums(terms, numerator, denominator, z).store(output.row(y) + x, n);
    }
  }
}

// Whether two images lie in the same memory, or in turns.
[[nodiscard]] inline bool overlap(const ImageView<const float>& a, const ImageView<const float>& b) noexcept {
  const auto begin = [](const ImageView<const float>& v) { return reinterpret_cast<std::uintptr_t>(v.row(0)); };
  const auto end = [](const ImageView<const float>& v) {
    return reinterpret_cast<std::uintptr_t>(v.row(v.height() - 1) + v.width());
  };
  return begin(a) < end(b) && begin(b) < end(a);
}

template <class LabelPixel>
[[nodiscard]] Status allocate_colour_term(const FilterTerms& terms, const FilterPlan& plan, FilterState<LabelPixel>& s,
                                          Workspace& workspace) noexcept {
  const ColourGrid& g = s.grid;
  ColourTerm& t = s.colour;
  NPSIM_RETURN_IF_ERROR(allocate_padded(g, workspace, s.samples.l));
  NPSIM_RETURN_IF_ERROR(allocate_padded(g, workspace, s.samples.a));
  NPSIM_RETURN_IF_ERROR(allocate_padded(g, workspace, s.samples.b));
  Span<float> blocks;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(block_elements(g), blocks));
  t.blocks.data = blocks.data();
  t.blocks.stride = block_stride(g);
  t.blocks.plane_stride = t.blocks.stride * g.block_rows();
  t.blocks.padding = g.padding / kChunkPx;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(spatial_elements(g), t.spatial));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(colour_sums_elements(g), t.sums));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(colour_scratch_elements(g), t.scratch));
  t.grid = g;
  t.samples = s.samples;
  const double sigma_s = static_cast<double>(terms.sigma_s_px);
  const double sigma_c = static_cast<double>(terms.sigma_c);
  constexpr double kLog2E = 1.4426950408889634;
  std::size_t at = 0;
  for (int dy = 0; dy <= g.ry; ++dy) {
    for (int dx = -g.rx; dx <= g.rx; ++dx) {
      const double exponent = -0.5 * kLog2E / (sigma_s * sigma_s) * (double(dx) * dx + double(dy) * dy);
      const bool other_way = dy == 0 && dx <= 0;
      t.spatial[at++] = other_way || exponent < -1e30 ? -1e30F : static_cast<float>(exponent);
    }
  }
  t.spatial[at] = t.spatial[at + 1] = -1e30F;
  t.scale = static_cast<float>(0.5 * kLog2E / (sigma_c * sigma_c));
  t.root_scale = static_cast<float>(root_scale(terms));
  // Rounded up, by more than what the logarithms of the blocks and the exponents of the pairs can be off.
  t.prune.on = plan.prune_error > 0;
  t.prune.scale = t.scale;
  t.prune.spatial_scale = static_cast<float>(0.5 * kLog2E / (sigma_s * sigma_s));
  if (t.prune.on) {
    t.prune.log_threshold =
        log2_of(static_cast<float>(static_cast<double>(terms.mu) * g.taps() / plan.prune_error)) + 0.01F;
  }
  return {};
}

// F: the batch; the result is the same for all.
template <class F, class LabelPixel, class Executor>
[[nodiscard]] Status filter_with(const FilterTerms& terms, const FilterPlan& plan, ImageView<const float> depth,
                                 ImageView<const LabelPixel> labels, ImageView<const Vec3f> lab,
                                 ImageView<float> output, Workspace& workspace, Executor& executor) noexcept {
  static_assert(F::lanes <= kChunkPx);
  const Shape shape = depth.shape();
  const int radius = terms.radius_px;
  const bool colour = terms.colour;
  const WorkspaceScope scope(workspace);
  FilterState<LabelPixel> s;
  s.grid = colour_grid(shape, radius);
  NPSIM_RETURN_IF_ERROR(allocate_padded(s.grid, workspace, s.samples.depth));
  if (terms.labels) {
    s.label.depth = depth;
    s.label.labels = labels;
    NPSIM_RETURN_IF_ERROR(allocate_label_term(label_grid(shape, radius), radius, static_cast<double>(terms.sigma_s_px),
                                              !colour, workspace, s.label));
  }
  Span<DepthRange> ranges;  // by row
  if (colour) {
    NPSIM_RETURN_IF_ERROR(allocate_colour_term(terms, plan, s, workspace));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(shape.height), ranges));
  }

  const auto rows = static_cast<std::size_t>(shape.height);
  const auto for_each = [&](std::size_t count, std::size_t chunk, auto&& f) {
    executor.for_chunks(count, chunk, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) f(static_cast<int>(i));
    });
  };
  // Labels alone write a tile's result while others still read depths.
  const bool in_place = !colour && overlap(depth, output);
  if (in_place) s.label.depth = s.samples.depth;
  for_each(rows, 16, [&](int y) {
    if (colour) ranges[static_cast<std::size_t>(y)] = load_row<F>(terms, s.grid, depth, lab, s.samples, y);
    for (int x = 0; in_place && x < shape.width; ++x) s.samples.depth(x, y) = depth(x, y);
    if (terms.labels) find_uniform_chunks<F>(s.label, y);
  });
  if (terms.labels) {
    SlotPool slots(s.label.grid.slots());
    for_each(static_cast<std::size_t>(s.label.grid.tiles()), 1, [&](int index) {
      const LabelTile tile = label_tile(s.label.grid, index, slots.take());
      filter_label_tile<F>(s.label, tile);
      if (!colour) combine_tile<F>(terms, s.label, tile, output);
      slots.give(tile.slot);
    });
  }
  if (colour) {
    DepthRange whole;
    for (const DepthRange& r : ranges) {
      whole.low = r.low < whole.low ? r.low : whole.low;
      whole.high = r.high > whole.high ? r.high : whole.high;
    }
    const double ratio = whole.high > 0 ? static_cast<double>(whole.high) / static_cast<double>(whole.low) : 1.0;
    s.colour.near = simd::kFusedFma ? scaled_near(terms, s.grid, plan, ratio) : -1.0F;
    for_each(static_cast<std::size_t>(s.grid.block_rows()), 8, [&](int row) {
      measure_block_row<F>(s.grid, s.samples, terms.mu, terms.labels ? s.label.numerator : ImageView<float>(),
                           terms.labels ? s.label.denominator : ImageView<float>(), row, s.colour.blocks);
    });
    for_each(static_cast<std::size_t>(s.grid.strips), 1, [&](int i) {
      if (plan.degree == 2) weigh_strip<F, 2>(s.colour, i);
      if (plan.degree == 3) weigh_strip<F, 3>(s.colour, i);
      if (plan.degree == 4) weigh_strip<F, 4>(s.colour, i);
      if (plan.degree == 5) weigh_strip<F, 5>(s.colour, i);
    });
  }
  if (colour) for_each(rows, 16, [&](int y) { combine_row<F>(terms, s, y, output); });
  return {};
}

}  // namespace cross_bilateral_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_FILTER_HPP
