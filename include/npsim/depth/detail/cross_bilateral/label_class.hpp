// SPDX-License-Identifier: Apache-2.0
// The label term of one class in one tile: a masked Gaussian along columns, then along rows, where the class is wanted.
//
// Members. A member is a pixel with the class' label and a valid depth: a bit in a word of 16 columns. Exact.
// Sums over one axis. Samples lie in rows of 16; a sum goes across rows, lanes are columns: of mirrored samples, one
// addition and one product per two samples and a load per four, from a window that slides through registers; of runs of
// members, from their ends.
// Numerators: per chunk of columns the class' depths (0 elsewhere) are summed along columns in floats, and those sums,
// transposed and in double, along rows. Denominators: along rows from the ends of the class' runs, along columns in
// double; where the class fills the window, the product of two sums of weights.
//
// Error: see label_sum_roundings(). The bits do not depend on lanes.
// Cost, R = 30, for a chunk and 16 rows: 32 products a row in floats, 64 for the rows, 64 for denominators; for members
// a comparison per 16 pixels of the window, one per pixel where chunks mix labels or have holes.
#ifndef NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_CLASS_HPP
#define NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_CLASS_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/depth/detail/cross_bilateral/grids.hpp"
#include "npsim/depth/detail/valid_depths.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/fixed.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace cross_bilateral_detail {

using depth_detail::are_valid_depths;

// The Gaussian along an axis by distance; 0 beyond the radius. `halved` is half of it at 0, where a sample is its own
// mirror image.
struct LabelWeights {
  Span<float> halved_f;
  Span<double> halved;
  Span<double> edges;   // see edge()
  int edge_offset = 0;  // of edge(0)
  double total = 0;     // over all distances of both signs

  // The weights of a run of samples [begin, end) seen from x add up to edge(x - end) - edge(x - begin), and the total
  // where x lies in it: minus what lies at -d and beyond for d < 0, what lies beyond d otherwise. So the difference is
  // one of sums of tails, and keeps its digits far out.
  [[nodiscard]] const double* edge(int d) const noexcept { return edges.data() + (edge_offset + d); }
  // What lies at distance d and beyond, on one side; d >= 1.
  [[nodiscard]] double tail(int d) const noexcept { return d <= edge_offset ? -*edge(-d) : 0.0; }
};

// w's spans have the sizes above.
inline void fill_label_weights(const LabelGrid& g, int radius, double sigma, LabelWeights& w) noexcept {
  const auto value = [&](int d) { return d <= radius ? std::exp(-0.5 * (d / sigma) * (d / sigma)) : 0.0; };
  for (std::size_t i = 0; i < w.halved.size(); ++i) {
    w.halved[i] = i == 0 ? 0.5 : value(static_cast<int>(i));
    w.halved_f[i] = static_cast<float>(w.halved[i]);
  }
  w.edge_offset = label_edge_offset(g);
  double tail = 0;  // from far to near, so that small sums come first
  for (int d = radius; d > 0; --d) {
    tail += value(d);
    // -d and d - 1 see the same tail.
    if (d <= w.edge_offset) w.edges[static_cast<std::size_t>(w.edge_offset - d)] = -tail;
    if (w.edge_offset + d - 1 < static_cast<int>(w.edges.size())) {
      w.edges[static_cast<std::size_t>(w.edge_offset + d - 1)] = tail;
    }
  }
  for (int d = radius + 1; d <= w.edge_offset; ++d) w.edges[static_cast<std::size_t>(w.edge_offset - d)] = 0.0;
  for (int d = radius; w.edge_offset + d < static_cast<int>(w.edges.size()); ++d) {
    w.edges[static_cast<std::size_t>(w.edge_offset + d)] = 0.0;
  }
  w.total = 1 + 2 * tail;
}

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

inline constexpr std::size_t kRunLength = kLabelRun;
inline constexpr std::size_t kRowLength = kLabelChunkPx;

// Rows that are summed at a time: what registers hold.
template <class V>
inline constexpr std::size_t kSumRows = simd::F32::lanes == 16 ? 8 : 4;

// Distance kStep of a run for rows 0..N-1. Row i has its lower mirror image in lower[(i - kStep) % N], its upper one in
// upper[(i + kStep) % N]; the two that are done make room for those of the next distance.
template <std::size_t kStep, class V, std::size_t N, class T, std::size_t... kRow>
NPSIM_ALWAYS_INLINE void add_distance(const T* above, const T* below, V weight, V (&lower)[N], V (&upper)[N],
                                      V (&sum)[N], std::index_sequence<kRow...>) noexcept {
  static_assert(kRunLength % N == 0);
  ((sum[kRow] = fma(weight, lower[(kRow + kRunLength - kStep) % N] + upper[(kRow + kStep) % N], sum[kRow])), ...);
  upper[kStep % N] = V::load(above + kStep * kRowLength);
  lower[(kRunLength - 1 - kStep) % N] = V::load(below - kStep * kRowLength);
}

template <class V, std::size_t N, class T, class W, std::size_t... kStep>
NPSIM_ALWAYS_INLINE void add_run(const T* above, const T* below, const W* weights, V (&lower)[N], V (&upper)[N],
                                 V (&sum)[N], std::index_sequence<kStep...>) noexcept {
  (add_distance<kStep>(above, below, V(weights[kStep]), lower, upper, sum, std::make_index_sequence<N>()), ...);
}

// N rows from `first` on. Rows first - 8 runs .. first + N - 1 + 8 runs are read. Floats are added up run by run.
// kLast: distances of the last run.
template <std::size_t kLast, class V, std::size_t N, class T, class W>
NPSIM_ALWAYS_INLINE void mirrored_sums(const T* first, const W* halved, int runs, V (&sum)[N]) noexcept {
  V lower[N];
  V upper[N];
  for (std::size_t i = 0; i < N; ++i) {
    lower[i] = upper[i] = V::load(first + i * kRowLength);
    sum[i] = V(W(0));
  }
  const auto add = [&](int run, auto steps) {
    const T* above = first + static_cast<int>(N) * kLabelChunkPx + run * (kLabelRun * kLabelChunkPx);
    const T* below = first - kLabelChunkPx - run * (kLabelRun * kLabelChunkPx);
    const W* weights = halved + kLabelRun * run;
    if constexpr (sizeof(W) == sizeof(double)) {
      add_run(above, below, weights, lower, upper, sum, steps);
    } else {
      V part[N];
      for (std::size_t i = 0; i < N; ++i) part[i] = V(W(0));
      add_run(above, below, weights, lower, upper, part, steps);
      for (std::size_t i = 0; i < N; ++i) sum[i] = sum[i] + part[i];
    }
  };
  for (int run = 0; run + 1 < runs; ++run) add(run, std::make_index_sequence<kRunLength>());
  add(runs - 1, std::make_index_sequence<kLast>());
}

// Sixteen rows from `first` on to a block, 16x16. Where the last distance has no weight it is left out.
template <class V, class T, class W, class Out>
void sum_block(const T* first, const W* halved, int runs, Out* out) noexcept {
  const bool whole = halved[kLabelRun * runs - 1] > W(0);
  constexpr std::size_t kRows = kSumRows<V>;
  for (std::size_t row = 0; row < kLabelGroupRows; row += kRows) {
    for (int x = 0; x < kLabelChunkPx; x += V::lanes) {
      V sum[kRows];
      const T* at = first + row * kRowLength + x;
      if (whole) {
        mirrored_sums<kRunLength>(at, halved, runs, sum);
      } else {
        mirrored_sums<kRunLength - 1>(at, halved, runs, sum);
      }
      for (std::size_t i = 0; i < kRows; ++i) sum[i].store(out + (row + i) * kRowLength + x);
    }
  }
}

// A block by columns. As many registers as lanes, interleaved log2 of that number times, are transposed: each time the
// bits of row and column together turn by one.
template <class F>
void transpose_block(const float* in, float* out) noexcept {
  constexpr int kLanes = F::lanes;
  constexpr auto kRegisters = static_cast<std::size_t>(kLanes);
  for (int y = 0; y < kLabelChunkPx; y += kLanes) {
    for (int x = 0; x < kLabelChunkPx; x += kLanes) {
      F v[kRegisters];
      for (int i = 0; i < kLanes; ++i) v[i] = F::load(in + (y + i) * kLabelChunkPx + x);
      for (int done = 1; done < kLanes; done *= 2) {
        F w[kRegisters];
        for (int i = 0; i < kLanes / 2; ++i) {
          w[2 * i] = interleave_low(v[i], v[i + kLanes / 2]);
          w[2 * i + 1] = interleave_high(v[i], v[i + kLanes / 2]);
        }
        for (int i = 0; i < kLanes; ++i) v[i] = w[i];
      }
      for (int i = 0; i < kLanes; ++i) v[i].store(out + (x + i) * kLabelChunkPx + y);
    }
  }
}

// Weights along a row, seen from the 16 pixels of a chunk. members: one word per chunk, a bit for each member; read
// from `halo` chunks before to `halo` after.
template <class F>
void sum_members(const LabelWeights& w, int halo, const std::int32_t* members, double* out) noexcept {
  using D = simd::Double<F>;
  constexpr int kParts = kLabelChunkPx / D::lanes;
  D sum[static_cast<std::size_t>(kParts)];
  for (D& part : sum) part = D(0.0);
  std::uint64_t open = 0;  // 1: a run goes on; then the sum has the other sign
  for (int first = -halo; first <= halo; first += 4) {
    std::uint64_t word = 0;
    for (int i = 0; i < 4 && first + i <= halo; ++i) {
      word |= static_cast<std::uint64_t>(static_cast<std::uint32_t>(members[first + i]))
              << static_cast<unsigned>(16 * i);
    }
    for (std::uint64_t ends = word ^ (word << 1U | open); ends != 0; ends &= ends - 1) {
      const double* edge = w.edge(-first * kLabelChunkPx - lowest_set_bit(ends));
      for (int p = 0; p < kParts; ++p) {
        D& part = sum[static_cast<std::size_t>(p)];
        part = D::load(edge + p * D::lanes) - part;
      }
      open ^= 1U;
    }
  }
  const D sign(open != 0 ? -1.0 : 1.0);
  const auto own = static_cast<std::uint32_t>(members[0]);
  alignas(64) float centre[kRowLength];
  for (int i = 0; i < kLabelChunkPx; i += F::lanes) {
    select(F::MaskType::from_bits(own >> static_cast<unsigned>(i)), F(1.0F), F(0.0F)).store(centre + i);
  }
  for (int p = 0; p < kParts; ++p) {
    const D total = D(w.total) * D::load(centre + p * D::lanes);
    fma(sign, sum[static_cast<std::size_t>(p)], total).store(out + p * D::lanes);
  }
}

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

}  // namespace cross_bilateral_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_LABEL_CLASS_HPP
