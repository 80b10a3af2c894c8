// SPDX-License-Identifier: Apache-2.0
// What every kernel over a layer shares (geometry/triangle_mesh.hpp has the type): chunks of rows, masks that may be
// left out, tests of 64 bytes at a time, and which faces the vertices of a layer allow.
//
// Chunks of rows do not depend on the executor. Tests of bytes give one bit per pixel, 64 pixels a word.
// A quad with four vertices is cut along the diagonal with the smaller depth jump; a tie takes the one from upper left
// to lower right. With three it gets the one triangle they allow, with fewer none. The corners of 64 quads are four
// words of bits, and so are their faces: with corners A B C D,
//   upper = A B (C | D),  lower = C D (A | B),  cut along B-C = B C ((A ^ D) | A D jump(B-C) < jump(A-D)).
// Exact: decided by comparisons and one subtraction, the same for every number of lanes.
// Cost: about an instruction a quad, and the pass over the vertices. Memory: 8 KiB of stack.
#ifndef NPSIM_MESH_DETAIL_LAYER_HPP
#define NPSIM_MESH_DETAIL_LAYER_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace mesh_detail {

inline constexpr std::size_t kRowsPerChunk = 16;

// f(begin, end) for chunks of rows.
template <class Executor, class F>
void for_row_chunks(Executor& executor, int rows, F&& f) {
  executor.for_chunks(rows > 0 ? static_cast<std::size_t>(rows) : 0, kRowsPerChunk,
                      [&f](std::size_t begin, std::size_t end) { f(static_cast<int>(begin), static_cast<int>(end)); });
}

// A mask that may be left out.
template <class T>
[[nodiscard]] inline bool mask_fits(const ImageView<T>& mask, Shape shape) noexcept {
  return mask.data() == nullptr || mask.shape() == shape;
}
[[nodiscard]] inline bool mask_at(const ImageView<const std::uint8_t>& mask, int x, int y, bool missing) noexcept {
  return mask.data() == nullptr ? missing : mask(x, y) != 0;
}

// Bits of the first n <= 64 bytes for which test(batch) gives bits.
template <class U, class Test>
[[nodiscard]] std::uint64_t test_bytes(const std::uint8_t* p, int n, const Test& test) noexcept {
  std::uint64_t all = 0;
  for (int i = 0; i < n; i += U::lanes) {
    const U bytes = n - i >= U::lanes ? U::load(p + i) : U::load(p + i, n - i);
    all |= test(bytes) << static_cast<unsigned>(i);
  }
  return all & low_bits(n);
}
template <class U>
[[nodiscard]] std::uint64_t nonzero_bits(const std::uint8_t* p, int n) noexcept {
  return test_bytes<U>(p, n, [](U bytes) { return less_bits(U(0), bytes); });
}

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

// 64 quads: a bit each for A, B, C, D being there.
struct QuadCorners {
  std::uint64_t a, b, c, d;
};

// 64 quads: a bit each for kQuadAntiDiagonal, kQuadUpperFace, kQuadLowerFace.
struct QuadBits {
  std::uint64_t anti, upper, lower;
};

// smaller_bc: the depth jump of B-C is less than that of A-D.
[[nodiscard]] constexpr QuadBits connect_bits(const QuadCorners& q, std::uint64_t smaller_bc) noexcept {
  return {q.b & q.c & ((q.a ^ q.d) | (q.a & q.d & smaller_bc)), q.a & q.b & (q.c | q.d), q.c & q.d & (q.a | q.b)};
}

// The bytes of the first n <= 64 quads.
template <class F>
void store_quads(const QuadBits& bits, std::uint8_t* out, int n) noexcept {
  using U = simd::BytesOf<F>;
  for (int i = 0; i < n; i += U::lanes) {
    const auto shift = static_cast<unsigned>(i);
    const U quads = U::from_bits(bits.anti >> shift, kQuadAntiDiagonal) |
                    U::from_bits(bits.upper >> shift, kQuadUpperFace) |
                    U::from_bits(bits.lower >> shift, kQuadLowerFace);
    if (n - i >= U::lanes) {
      quads.store(out + i);
    } else {
      quads.store(out + i, n - i);
    }
  }
}

// The same the other way; the bits after the n-th are 0.
template <class F>
[[nodiscard]] QuadBits load_quads(const std::uint8_t* p, int n) noexcept {
  using U = simd::BytesOf<F>;
  QuadBits bits = {0, 0, 0};
  for (int i = 0; i < n; i += U::lanes) {
    const U quads = n - i >= U::lanes ? U::load(p + i) : U::load(p + i, n - i);
    const auto put = [i, quads](std::uint8_t bit) {
      return less_bits(U(0), quads & U(bit)) << static_cast<unsigned>(i);
    };
    bits.anti |= put(kQuadAntiDiagonal);
    bits.upper |= put(kQuadUpperFace);
    bits.lower |= put(kQuadLowerFace);
  }
  return bits;
}

// Columns that are worked on together. A depth buffer holds one more, and what the last batch may read beyond it.
inline constexpr int kStripColumns = 1024;
inline constexpr int kStripBuffer = kStripColumns + 2 * kWordBits;

// Quads of one row, from the depths of the n + 1 pixels above and below them: 0 (or less) where there is no vertex.
// Whole words are read from both buffers.
template <class F>
void connect_row(const float* upper, const float* lower, std::uint8_t* out, int n) noexcept {
  for (int x = 0; x < n; x += kWordBits) {
    QuadCorners corners = {0, 0, 0, 0};
    std::uint64_t smaller_bc = 0;
    for (int i = 0; i < kWordBits; i += F::lanes) {
      const F a = F::load(upper + x + i);
      const F b = F::load(upper + x + i + 1);
      const F c = F::load(lower + x + i);
      const F d = F::load(lower + x + i + 1);
      const auto put = [i](auto mask) { return std::uint64_t{bits(mask)} << static_cast<unsigned>(i); };
      corners.a |= put(a > F(0.0F));
      corners.b |= put(b > F(0.0F));
      corners.c |= put(c > F(0.0F));
      corners.d |= put(d > F(0.0F));
      smaller_bc |= put(abs(b - c) < abs(a - d));
    }
    store_quads<F>(connect_bits(corners, smaller_bc), out + x, n - x < kWordBits ? n - x : kWordBits);
  }
}

// Walks one strip of columns down the rows [begin, end) and connects the quads that begin there. read(y, x, n, z, own)
// puts the depths of the n pixels from (x, y) on into z; own: y < end, and the first `own` of them belong to this strip
// (a caller that makes the vertices writes those).
template <class F, class Read>
void connect_strip(Shape shape, ImageView<std::uint8_t> quads, int x, int begin, int end, const Read& read) noexcept {
  alignas(64) float z[2][kStripBuffer] = {};
  const int own = shape.width - x < kStripColumns ? shape.width - x : kStripColumns;
  const int read_columns = x + own < shape.width ? own + 1 : own;
  for (int y = begin; y <= end && y < shape.height; ++y) {
    read(y, x, read_columns, z[y & 1], y < end ? own : 0);
    if (y == begin || quads.empty()) continue;
    connect_row<F>(z[(y - 1) & 1], z[y & 1], quads.row(y - 1) + x, read_columns - 1);
  }
}

template <class F>
void read_depths(const Vec3f* vertices, int n, float* z) noexcept {
  int i = 0;
  for (; i + F::lanes <= n; i += F::lanes) simd::load3<F>(&vertices[i].x).z.store(z + i);
  for (; i < n; ++i) z[i] = vertices[i].z;
}

// Every face that the vertices of a layer allow.
template <class F = simd::F32, class Executor>
void connect_layer(const SheetLayer& layer, Executor& executor) {
  const Shape shape = layer.vertices.shape();
  if (quad_shape(shape).empty()) return;
  for_row_chunks(executor, shape.height, [&](int begin, int end) {
    for (int x = 0; x < shape.width; x += kStripColumns) {
      connect_strip<F>(shape, layer.quads, x, begin, end, [&layer](int y, int x0, int n, float* z, int) {
        read_depths<F>(layer.vertices.row(y) + x0, n, z);
      });
    }
  });
}

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_LAYER_HPP
