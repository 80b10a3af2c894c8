// SPDX-License-Identifier: Apache-2.0
// Counter-based random numbers: Philox4x32-10 (Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC 2011).
//
// Every number is a pure function of (seed, purpose, image, light, pixel, sample, draw), so the order of work and the
// number of threads never change a result, and no two images, lights or pixels share a stream: the fields occupy
// disjoint bits of Philox's 128-bit counter, which the cipher maps one to one.
// Limits: 2^24 lights and 2^24 samples; 1024 draws per stream (256 blocks of four).
#ifndef NPSIM_CORE_RANDOM_HPP
#define NPSIM_CORE_RANDOM_HPP

#include <array>
#include <cstdint>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// What a stream is for; keeps the streams of different stages apart.
enum class RandomPurpose : std::uint32_t { generic, activation, direct, bounce, noise, street, sensor, test, leaves };

[[nodiscard]] constexpr std::array<std::uint32_t, 4> philox4x32(std::array<std::uint32_t, 4> counter,
                                                                std::array<std::uint32_t, 2> key) noexcept {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t p0 = std::uint64_t{0xD2511F53U} * counter[0];
    const std::uint64_t p1 = std::uint64_t{0xCD9E8D57U} * counter[2];
    counter = {static_cast<std::uint32_t>(p1 >> 32U) ^ counter[1] ^ key[0], static_cast<std::uint32_t>(p1),
               static_cast<std::uint32_t>(p0 >> 32U) ^ counter[3] ^ key[1], static_cast<std::uint32_t>(p0)};
    key[0] += 0x9E3779B9U;
    key[1] += 0xBB67AE85U;
  }
  return counter;
}

class RandomStream {
 public:
  constexpr RandomStream(std::uint64_t seed, RandomPurpose purpose, std::uint32_t image, std::uint32_t light,
                         std::uint32_t pixel, std::uint32_t sample) noexcept
      : key_{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32U)},
        counter_{image, (static_cast<std::uint32_t>(purpose) << 24U) | (light & 0xFFFFFFU), pixel,
                 sample & 0xFFFFFFU} {}

  [[nodiscard]] constexpr std::uint32_t next_u32() noexcept {
    if (cursor_ == 4) {
      block_ = philox4x32(counter_, key_);
      counter_[3] += 1U << 24U;
      cursor_ = 0;
    }
    return block_[cursor_++];
  }

  // Uniform on the 2^24 multiples of 2^-24 in [0, 1).
  [[nodiscard]] constexpr float uniform() noexcept { return static_cast<float>(next_u32() >> 8U) * 0x1p-24F; }
  [[nodiscard]] constexpr float uniform(float low, float high) noexcept { return low + (high - low) * uniform(); }

 private:
  std::array<std::uint32_t, 2> key_{};
  std::array<std::uint32_t, 4> counter_{};
  std::array<std::uint32_t, 4> block_{};
  std::uint32_t cursor_ = 4;
};

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_RANDOM_HPP
