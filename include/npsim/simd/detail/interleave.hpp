// SPDX-License-Identifier: Apache-2.0
// Interleaved triples (Vec3f pixels) to three batches and back, in registers. Part of batch.hpp: load3 and store3.
//
// With L lanes the triples fill three registers. No multiple of 3 divides L, so the elements of one component that lie
// in the three registers lie in different lanes: two selections gather them in one register, one permutation sorts
// them. Moves only: exact. Cost: nine instructions a batch each way (NEON64 has loads and stores of its own).
#ifndef NPSIM_SIMD_DETAIL_INTERLEAVE_HPP
#define NPSIM_SIMD_DETAIL_INTERLEAVE_HPP

#include "npsim/core/config.hpp"
#if !defined(NPSIM_SIMD_SCALAR)
#include "npsim/simd/detail/native.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace simd {
namespace native {

#if defined(NPSIM_SIMD_NEON64)

inline void load_triples(const float* p, F32& x, F32& y, F32& z) noexcept {
  const float32x4x3_t v = vld3q_f32(p);
  x = F32(FloatBatch(v.val[0]));
  y = F32(FloatBatch(v.val[1]));
  z = F32(FloatBatch(v.val[2]));
}
inline void store_triples(float* p, F32 x, F32 y, F32 z) noexcept {
  vst3q_f32(p, float32x4x3_t{{x.value, y.value, z.value}});
}

#else

struct TripleTables {
  std::int32_t load[3][kLanes] = {};   // lane of the gathered register that holds element i of a component
  std::int32_t store[3][kLanes] = {};  // element of a component that lane i of the gathered register takes
};

[[nodiscard]] constexpr TripleTables make_triple_tables() noexcept {
  TripleTables t;
  for (int component = 0; component < 3; ++component) {
    for (int i = 0; i < kLanes; ++i) {
      const int lane = (3 * i + component) % kLanes;
      t.load[component][i] = lane;
      t.store[component][lane] = i;
    }
  }
  return t;
}

inline constexpr TripleTables kTripleTables = make_triple_tables();

// The lanes of register `part` (0, 1, 2) that hold `component`.
template <int kPart, int kComponent>
[[nodiscard]] inline Mask lanes_of() noexcept {
  constexpr std::uint32_t kBits = [] {
    std::uint32_t b = 0;
    for (int i = 0; i < kLanes; ++i)
      b |= ((kPart * kLanes + i) % 3 == kComponent ? 1U : 0U) << static_cast<unsigned>(i);
    return b;
  }();
#if defined(NPSIM_SIMD_AVX512)
  return Mask(FloatBool(static_cast<__mmask16>(kBits)));
#else
  alignas(64) static constexpr auto kLanesOf = [] {
    struct {
      std::int32_t set[kLanes];
    } m{};
    for (int i = 0; i < kLanes; ++i) m.set[i] = (kBits >> static_cast<unsigned>(i) & 1U) != 0 ? -1 : 0;
    return m;
  }();
  return Mask(FloatBool(as_float(IntBatch::load_aligned(kLanesOf.set)).data));
#endif
}

// Lane i of the result is lane table[component][i] of a.
template <int kComponent, bool kStore>
[[nodiscard]] inline F32 permuted(F32 a) noexcept {
#if defined(NPSIM_SIMD_SSE2)
  constexpr const auto& table = kStore ? kTripleTables.store[kComponent] : kTripleTables.load[kComponent];
  constexpr int kOrder = table[0] | table[1] << 2 | table[2] << 4 | table[3] << 6;
  return F32(FloatBatch(_mm_shuffle_ps(a.value, a.value, kOrder)));
#else
  const auto& table = kStore ? kTripleTables.store[kComponent] : kTripleTables.load[kComponent];
  const IntBatch order = IntBatch::load_unaligned(table);
#if defined(NPSIM_SIMD_AVX512)
  return F32(FloatBatch(_mm512_maskz_permutexvar_ps(kAllLanes, order, a.value)));
#else
  return F32(FloatBatch(_mm256_permutevar8x32_ps(a.value, order)));
#endif
#endif
}

template <int kComponent>
[[nodiscard]] inline F32 component_of(F32 a, F32 b, F32 c) noexcept {
  return permuted<kComponent, false>(select(lanes_of<1, kComponent>(), b, select(lanes_of<2, kComponent>(), c, a)));
}

template <int kPart>
[[nodiscard]] inline F32 part_of(F32 x, F32 y, F32 z) noexcept {
  return select(lanes_of<kPart, 1>(), y, select(lanes_of<kPart, 2>(), z, x));
}

inline void load_triples(const float* p, F32& x, F32& y, F32& z) noexcept {
  const F32 a = F32::load(p);
  const F32 b = F32::load(p + kLanes);
  const F32 c = F32::load(p + 2 * kLanes);
  x = component_of<0>(a, b, c);
  y = component_of<1>(a, b, c);
  z = component_of<2>(a, b, c);
}

inline void store_triples(float* p, F32 x, F32 y, F32 z) noexcept {
  const F32 u = permuted<0, true>(x);
  const F32 v = permuted<1, true>(y);
  const F32 w = permuted<2, true>(z);
  part_of<0>(u, v, w).store(p);
  part_of<1>(u, v, w).store(p + kLanes);
  part_of<2>(u, v, w).store(p + 2 * kLanes);
}

#endif

}  // namespace native
}  // namespace simd
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SIMD_SCALAR
#endif  // NPSIM_SIMD_DETAIL_INTERLEAVE_HPP
