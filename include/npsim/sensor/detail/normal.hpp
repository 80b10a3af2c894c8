// SPDX-License-Identifier: Apache-2.0
// Standard normal numbers by the row: Philox4x32-10 (core/random.hpp), then Box and Muller's pairs.
//
// A word of 32 bits makes a pair: 21 bits the radius sqrt(-2 ln u), 11 bits one of 2048 directions (Box and Muller, "A
// note on the generation of random normal deviates", 1958). With equally spaced directions the sum over them is the
// trapezoidal rule for a smooth periodic function, which is all but exact: the distribution of a number differs from
// the normal one by less than 1e-6 (Kolmogorov and Smirnov's distance, by counting), and ends at 5.5 sigma.
// Sample x of a row lies in segment x / 128, whose 16 blocks of four words make four runs of 16 + 16 samples: a number
// is a pure function of (seed, image, stage, segment, x), whatever the lanes.
// Error against the same formula in double: 1e-6 max(1, |x|). Cost: about 2 ns a number on AVX2.
#ifndef NPSIM_SENSOR_DETAIL_NORMAL_HPP
#define NPSIM_SENSOR_DETAIL_NORMAL_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/random.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace noise_detail {

inline constexpr int kSegmentBlocks = 16;
inline constexpr int kSegment = 8 * kSegmentBlocks;

[[nodiscard]] constexpr std::uint32_t segments(int samples) noexcept {
  return (static_cast<std::uint32_t>(samples) + kSegment - 1) / kSegment;
}

template <class F>
struct NormalPair {
  F x;
  F y;
};

// Of 32 random bits as an int.
template <class F>
[[nodiscard]] NormalPair<F> normal_pair(typename F::Int bits) noexcept {
  using I = typename F::Int;
  static constexpr float kSin[] = {1.0F, -1.0F / 6.0F, 1.0F / 120.0F, -1.0F / 5040.0F};
  static constexpr float kCos[] = {1.0F, -1.0F / 2.0F, 1.0F / 24.0F, -1.0F / 720.0F, 1.0F / 40320.0F};
  const F u = (to_float((bits >> 11) & I(0x1FFFFF)) + F(0.5F)) * F(0x1p-21F);
  const F radius = sqrt(-simd::log(u));  // over sqrt(2), which the next lines leave out
  // The direction within its quadrant, from the diagonal; two more bits say which quadrant.
  const F angle = (to_float(bits & I(0x1FF)) - F(255.5F)) * F(0x1.921FB6p-1F / 256.0F);
  const F a2 = angle * angle;
  const F sine = angle * simd::math_detail::polynomial(a2, kSin);
  const F cosine = simd::math_detail::polynomial(a2, kCos);
  const I sign(static_cast<std::int32_t>(0x80000000U));
  return {bitcast_float(bitcast_int(radius * (cosine - sine)) ^ ((bits << 22) & sign)),
          bitcast_float(bitcast_int(radius * (cosine + sine)) ^ ((bits << 21) & sign))};
}

// Whose numbers these are. stage: what tells two uses for one image apart.
struct NormalStream {
  std::uint64_t seed = 0;
  std::uint32_t image = 0;
  std::uint32_t stage = 0;
};

// The 128 numbers of a segment.
inline void normal_segment(const NormalStream& stream, std::uint32_t segment, float* out) noexcept {
  alignas(64) std::uint32_t c[4][kSegmentBlocks];
  const std::uint32_t purpose = (static_cast<std::uint32_t>(RandomPurpose::noise) << 24U) | (stream.stage & 0xFFFFFFU);
  for (std::uint32_t i = 0; i < kSegmentBlocks; ++i) {
    c[0][i] = stream.image;
    c[1][i] = purpose;
    c[2][i] = segment * kSegmentBlocks + i;
    c[3][i] = 0;
  }
  std::uint32_t key[2] = {static_cast<std::uint32_t>(stream.seed), static_cast<std::uint32_t>(stream.seed >> 32U)};
  // philox4x32() on 16 counters at once, in a form that compilers vectorise.
  for (int round = 0; round < 10; ++round) {
    for (int i = 0; i < kSegmentBlocks; ++i) {
      const std::uint64_t p0 = std::uint64_t{0xD2511F53U} * c[0][i];
      const std::uint64_t p1 = std::uint64_t{0xCD9E8D57U} * c[2][i];
      c[0][i] = static_cast<std::uint32_t>(p1 >> 32U) ^ c[1][i] ^ key[0];
      c[1][i] = static_cast<std::uint32_t>(p1);
      c[2][i] = static_cast<std::uint32_t>(p0 >> 32U) ^ c[3][i] ^ key[1];
      c[3][i] = static_cast<std::uint32_t>(p0);
    }
    key[0] += 0x9E3779B9U;
    key[1] += 0xBB67AE85U;
  }
  using F = simd::F32;
  for (int word = 0; word < 4; ++word) {
    alignas(64) std::int32_t bits[kSegmentBlocks];
    for (int i = 0; i < kSegmentBlocks; ++i) bits[i] = static_cast<std::int32_t>(c[word][i]);
    float* run = out + 2 * kSegmentBlocks * word;
    for (int i = 0; i < kSegmentBlocks; i += F::lanes) {
      const NormalPair<F> pair = normal_pair<F>(simd::I32::load(bits + i));
      pair.x.store(run + i);
      pair.y.store(run + kSegmentBlocks + i);
    }
  }
}

}  // namespace noise_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_DETAIL_NORMAL_HPP
