// SPDX-License-Identifier: Apache-2.0
// Positions and number of the bits of a 64-bit word, and rows of bits, 64 pixels a word (pixel x is bit x % 64 of word
// x / 64; bits past the last pixel are 0).
//
// Exact. Cost: one instruction each where the compiler has one.
#ifndef NPSIM_CORE_BITS_HPP
#define NPSIM_CORE_BITS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr int kWordBits = 64;

// Words of a row of n pixels.
[[nodiscard]] constexpr int bit_words(int n) noexcept { return n > 0 ? (n - 1) / kWordBits + 1 : 0; }

// The lowest n bits, 0 <= n <= 64.
[[nodiscard]] constexpr std::uint64_t low_bits(int n) noexcept {
  return n >= kWordBits ? ~std::uint64_t{0} : (std::uint64_t{1} << static_cast<unsigned>(n)) - 1U;
}

[[nodiscard]] constexpr bool bit_at(std::uint64_t word, int i) noexcept {
  return ((word >> static_cast<unsigned>(i)) & 1U) != 0;
}

// Each pixel's left or right neighbour, from a word and the one before or after it.
[[nodiscard]] constexpr std::uint64_t left_bits(std::uint64_t previous, std::uint64_t word) noexcept {
  return word << 1U | previous >> 63U;
}
[[nodiscard]] constexpr std::uint64_t right_bits(std::uint64_t word, std::uint64_t next) noexcept {
  return word >> 1U | next << 63U;
}

// Of words that are not 0.
[[nodiscard]] inline int lowest_set_bit(std::uint64_t word) noexcept {
#if defined(__GNUC__) || defined(__clang__)
  return __builtin_ctzll(word);
#else
  int i = 0;
  while (!bit_at(word, i)) ++i;
  return i;
#endif
}
[[nodiscard]] inline int highest_set_bit(std::uint64_t word) noexcept {
#if defined(__GNUC__) || defined(__clang__)
  return 63 - __builtin_clzll(word);
#else
  int i = 63;
  while (!bit_at(word, i)) --i;
  return i;
#endif
}

[[nodiscard]] constexpr int count_bits(std::uint64_t word) noexcept {
#if defined(__GNUC__) || defined(__clang__)
  return __builtin_popcountll(word);
#else
  int n = 0;
  for (; word != 0; word &= word - 1) ++n;
  return n;
#endif
}

// f(i) for each set bit, the lowest first.
template <class F>
void for_set_bits(std::uint64_t word, F&& f) {
  for (; word != 0; word &= word - 1) f(lowest_set_bit(word));
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_BITS_HPP
