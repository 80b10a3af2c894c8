// SPDX-License-Identifier: Apache-2.0
// The label term of the dual-reference cross-bilateral filter (3.2): for every pixel p the sums
//   sum_q Gs(|q - p|) z(q)  and  sum_q Gs(|q - p|)   over the pixels q of the window that have p's label.
//
// By tiles of 384x128, for each class that has pixels in one: label_class.hpp. A tile with more than kMaxTileClasses
// classes, or where that would cost more, takes the direct form, tap by tap.
// Error: label_sum_roundings() 2^-24 of either sum, label_roundings() 2^-24 of both together, 15 at R = 30. The bits
// depend on neither lanes nor threads.
// Cost: per pixel and class 3 (R + 2) products, as many again for the sum of weights where the class does not fill the
// window; two thirds in double. Direct: (2R + 1)^2, less where no pixel of a batch has a sample's label. Memory: see
// grids.hpp.
#ifndef NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_HPP
#define NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/cross_bilateral/grids.hpp"
#include "npsim/depth/detail/cross_bilateral/label_class.hpp"
#include "npsim/depth/detail/valid_depths.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/fixed.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace cross_bilateral_detail {

inline constexpr int kMaxTileClasses = 256;
inline constexpr int kDirectRun = 4;  // taps of the direct form that are added up in floats

struct TileClasses {
  TileClass classes[kMaxTileClasses];
  int count = 0;

  // nullptr when there are too many.
  [[nodiscard]] TileClass* find(std::int32_t label) noexcept {
    for (int i = 0; i < count; ++i) {
      if (classes[i].label == label) return &classes[i];
    }
    if (count == kMaxTileClasses) return nullptr;
    classes[count] = TileClass{};
    classes[count].label = label;
    return &classes[count++];
  }
};

// Which chunks of a row hold one label alone, and no hole. A chunk that leaves the image does not count as such.
template <class F, class LabelPixel>
void find_uniform_chunks(const LabelTerm<LabelPixel>& t, int y) noexcept {
  using I = typename F::Int;
  std::int32_t* out = t.uniform.row(y);
  const LabelPixel* labels = t.labels.row(y);
  for (int k = 0; k < t.grid.chunks; ++k) {
    const int begin = k * kLabelChunkPx;
    const I first(std::int32_t{labels[begin]});
    bool same = begin + kLabelChunkPx <= t.grid.shape.width;
    for (int i = 0; same && i < kLabelChunkPx; i += F::lanes) {
      same = all((load_labels<F>(t.labels, begin + i, y) == first) &
                 are_valid_depths(load_depths<F>(t.depth, begin + i, y)));
    }
    out[k] = same ? std::int32_t{labels[begin]} : -1;
  }
}

// False when there are too many classes.
template <class F, class LabelPixel>
[[nodiscard]] bool tile_classes(const LabelTerm<LabelPixel>& t, const LabelTile& tile, TileClasses& out) noexcept {
  using I = typename F::Int;
  const int width = t.grid.shape.width;
  out.count = 0;
  TileClass* last = nullptr;
  const auto add = [&](std::int32_t label, int group, int k) {
    if (last == nullptr || last->label != label) last = out.find(label);
    if (last != nullptr) last->centres[group] |= 1U << static_cast<unsigned>(k - tile.k0);
    return last != nullptr;
  };
  // Of a chunk whose row above, in the same group, has the same labels, all is known.
  const auto add_mixed = [&](int y, int group, int k) {
    const LabelPixel* row = t.labels.row(y);
    for (int x = k * kLabelChunkPx; x < (k + 1) * kLabelChunkPx && x < width; x += F::lanes) {
      const auto labels = load_labels<F>(t.labels, x, y);
      std::uint32_t rest = bits(F::MaskType::first(width - x < F::lanes ? width - x : F::lanes));
      if (y % kLabelGroupRows != 0) rest &= ~bits(labels == load_labels<F>(t.labels, x, y - 1));
      while (rest != 0) {
        const std::int32_t label{row[x + lowest_set_bit(rest)]};
        if (!add(label, group, k)) return false;
        rest &= ~bits(labels == I(label));
      }
    }
    return true;
  };
  for (int y = tile.y0; y < tile.y1; ++y) {
    const int group = (y - tile.y0) / kLabelGroupRows;
    const std::int32_t* uniform = t.uniform.row(y);
    for (int k = tile.k0; k < tile.k1; k += I::lanes) {
      const int n = tile.k1 - k < I::lanes ? tile.k1 - k : I::lanes;
      const I here = I::load(uniform + k, n);
      auto open = F::MaskType::first(n);
      if (y % kLabelGroupRows != 0) open = open & ((here < I(0)) | (here != I::load(t.uniform.row(y - 1) + k, n)));
      for (std::uint32_t rest = bits(open); rest != 0; rest &= rest - 1) {
        const int at = k + lowest_set_bit(rest);
        if (!(uniform[at] >= 0 ? add(uniform[at], group, at) : add_mixed(y, group, at))) return false;
      }
    }
  }
  return true;
}

// A row of samples as the direct form reads it: from R pixels before the tile to a batch and R pixels behind it.
struct DirectRow {
  float* depth = nullptr;  // 0 where a pixel does not count; at the tile's first column, as the labels
  std::int32_t* labels = nullptr;
};

// What one row of samples adds to the sums of a batch of pixels. sums: numerators and denominators.
template <class F>
void add_row_directly(const LabelGrid& g, const LabelWeights& w, const DirectRow& row, int x, typename F::Int centre,
                      double of_row, double* numerators, double* denominators) noexcept {
  using I = typename F::Int;
  using D = simd::Double<F>;
  const F zero(0.0F);
  for (int run = -g.rx; run <= g.rx; run += kDirectRun) {
    const int end = run + kDirectRun <= g.rx + 1 ? run + kDirectRun : g.rx + 1;
    F n = zero;
    F d = zero;
    bool found = false;
    for (int dx = run; dx < end; ++dx) {
      const auto same = I::load(row.labels + (x + dx)) == centre;
      if (none(same)) continue;
      const F z = F::load(row.depth + (x + dx));
      const auto distance = static_cast<std::size_t>(dx < 0 ? -dx : dx);
      const F weight = select(same & (z > zero), F(dx == 0 ? 1.0F : w.halved_f[distance]), zero);
      n = fma(weight, z, n);
      d = d + weight;
      found = true;
    }
    if (!found) continue;
    alignas(64) float n_lanes[static_cast<std::size_t>(F::lanes)];
    alignas(64) float d_lanes[static_cast<std::size_t>(F::lanes)];
    n.store(n_lanes);
    d.store(d_lanes);
    for (int p = 0; p < F::lanes; p += D::lanes) {
      fma(D(of_row), D::load(n_lanes + p), D::load(numerators + p)).store(numerators + p);
      fma(D(of_row), D::load(d_lanes + p), D::load(denominators + p)).store(denominators + p);
    }
  }
}

// The direct form for the rows y0..y1 of a tile, at most a group of them, row of samples by row of samples.
template <class F, class LabelPixel>
void filter_directly(const LabelTerm<LabelPixel>& t, const LabelTile& tile, int y0, int y1) noexcept {
  using D = simd::Double<F>;
  const LabelGrid& g = t.grid;
  const auto slot = static_cast<std::size_t>(tile.slot);
  const int x0 = tile.k0 * kLabelChunkPx;
  const int width = (tile.k1 - tile.k0) * kLabelChunkPx;
  double* sums = t.doubles.data() + slot * g.slot_doubles();
  const auto sums_of = [&](int plane, int y, int x) { return sums + ((plane * kLabelGroupRows + y - y0) * width + x); };
  const std::ptrdiff_t margin = g.halo * kLabelChunkPx;
  const DirectRow row{t.floats.data() + (slot * g.slot_floats() + static_cast<std::size_t>(margin)),
                      t.masks.data() + (slot * g.slot_masks() + static_cast<std::size_t>(margin))};
  for (int i = 0; i < 2 * kLabelGroupRows * width; i += D::lanes) D(0.0).store(sums + i);
  for (int q = y0 - g.ry > 0 ? y0 - g.ry : 0; q < g.shape.height && q < y1 + g.ry; ++q) {
    for (int x = -g.halo * kLabelChunkPx; x < width + g.halo * kLabelChunkPx; ++x) {
      const bool inside = x0 + x >= 0 && x0 + x < g.shape.width;
      row.labels[x] = inside ? std::int32_t{t.labels(x0 + x, q)} : -1;
      row.depth[x] = inside && is_valid_depth(t.depth(x0 + x, q)) ? t.depth(x0 + x, q) : 0.0F;
    }
    for (int y = y0; y < y1; ++y) {
      const int dy = q < y ? y - q : q - y;
      if (dy > g.ry) continue;
      const double of_row = dy == 0 ? 1.0 : t.weights.halved[static_cast<std::size_t>(dy)];
      for (int x = 0; x < width; x += F::lanes) {
        add_row_directly<F>(g, t.weights, row, x, load_labels<F>(t.labels, x0 + x, y), of_row, sums_of(0, y, x),
                            sums_of(1, y, x));
      }
    }
  }
  for (int y = y0; y < y1; ++y) {
    for (int x = 0; x < width; x += D::lanes) {
      D::load(sums_of(0, y, x)).store(sum_at(t, t.numerator, tile, x0 + x, y));
      D::load(sums_of(1, y, x)).store(sum_at(t, t.denominator, tile, x0 + x, y));
    }
  }
}

// Whether the direct form would cost less, in products of floats.
[[nodiscard]] inline bool direct_is_cheaper(const LabelGrid& g, const LabelTile& tile,
                                            const TileClasses& classes) noexcept {
  std::int64_t blocks = 0;
  for (int i = 0; i < classes.count; ++i) {
    for (const std::uint32_t centres : classes.classes[i].centres) {
      for (std::uint32_t rest = centres; rest != 0; rest &= rest - 1) ++blocks;
    }
  }
  const std::int64_t separable = kLabelRun * (4 * g.runs_y + 2 * g.runs_x + 8) * blocks;
  const std::int64_t groups = (tile.y1 - tile.y0 + kLabelGroupRows - 1) / kLabelGroupRows;
  const std::int64_t direct = std::int64_t{5} * (2 * g.rx + 1) * (2 * g.ry + 1) * groups * (tile.k1 - tile.k0);
  return direct < separable;
}

// Everything but depth and labels. by_slot: the sums of a tile are done with before the slot is given back.
template <class LabelPixel>
[[nodiscard]] Status allocate_label_term(const LabelGrid& g, int radius, double sigma, bool by_slot,
                                         Workspace& workspace, LabelTerm<LabelPixel>& t) noexcept {
  const auto slots = static_cast<std::size_t>(g.slots());
  t.grid = g;
  t.by_slot = by_slot;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image({g.chunks, g.shape.height}, t.uniform));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(g.plane(by_slot), t.numerator));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(g.plane(by_slot), t.denominator));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(slots * g.slot_doubles(), t.doubles));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(slots * g.slot_floats(), t.floats));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(slots * g.slot_masks(), t.masks));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(label_distances(g), t.weights.halved_f));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(label_distances(g), t.weights.halved));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(label_edges(g), t.weights.edges));
  fill_label_weights(g, radius, sigma, t.weights);
  return {};
}

[[nodiscard]] inline LabelTile label_tile(const LabelGrid& g, int index, int slot) noexcept {
  LabelTile tile;
  tile.slot = slot;
  tile.k0 = index % g.tiles_across() * kLabelTileChunks;
  tile.k1 = tile.k0 + kLabelTileChunks < g.chunks ? tile.k0 + kLabelTileChunks : g.chunks;
  tile.y0 = index / g.tiles_across() * kLabelTileRows;
  tile.y1 = tile.y0 + kLabelTileRows < g.shape.height ? tile.y0 + kLabelTileRows : g.shape.height;
  return tile;
}

template <class F, class LabelPixel>
void filter_label_tile(const LabelTerm<LabelPixel>& t, const LabelTile& tile) noexcept {
  TileClasses classes;
  if (tile_classes<F>(t, tile, classes) && !direct_is_cheaper(t.grid, tile, classes)) {
    ClassFilter<F, LabelPixel> filter(t, tile);
    for (int i = 0; i < classes.count; ++i) filter.filter(classes.classes[i]);
    return;
  }
  for (int y = tile.y0; y < tile.y1; y += kLabelGroupRows) {
    filter_directly<F>(t, tile, y, y + kLabelGroupRows < tile.y1 ? y + kLabelGroupRows : tile.y1);
  }
}

}  // namespace cross_bilateral_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_HPP
