// SPDX-License-Identifier: Apache-2.0
// Rows of bits, 64 columns a word: how the dual-reference variance filter keeps which windows fire. Part of
// uncertainty.hpp.
//
// Exact. Memory: none of its own.
#ifndef NPSIM_DEPTH_DETAIL_UNCERTAINTY_BITS_HPP
#define NPSIM_DEPTH_DETAIL_UNCERTAINTY_BITS_HPP

#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

// Of 128 bits that are not all 0.
[[nodiscard]] inline int lowest_set_bit(const std::uint64_t (&bits)[2]) noexcept {
  return bits[0] != 0 ? npsim::lowest_set_bit(bits[0]) : 64 + npsim::lowest_set_bit(bits[1]);
}
[[nodiscard]] inline int highest_set_bit(const std::uint64_t (&bits)[2]) noexcept {
  return bits[1] != 0 ? 64 + npsim::highest_set_bit(bits[1]) : npsim::highest_set_bit(bits[0]);
}
using npsim::highest_set_bit;
using npsim::lowest_set_bit;

// A row of bits as bytes 0 and 1.
template <class F>
void write_bits(const std::uint64_t* bits, std::uint8_t* out, int count) noexcept {
  using U = simd::BytesOf<F>;
  for (int x = 0; x < count; x += U::lanes) {
    const U bytes = U::from_bits(bits[x / 64] >> static_cast<unsigned>(x % 64));
    if (count - x >= U::lanes) {
      bytes.store(out + x);
    } else {
      bytes.store(out + x, count - x);
    }
  }
}

// Sets the l - 1 bits that follow each set bit. In place, in log2(l) steps; the highest words first, because a word
// depends on those below it.
inline void widen_bits(std::uint64_t* bits, int words, int l) noexcept {
  const int within = l < 64 ? l : 64;
  for (int i = words - 1; i >= 0; --i) {
    std::uint64_t own = bits[i];
    std::uint64_t below = i > 0 ? bits[i - 1] : 0;
    if ((own | below) == 0) continue;
    const auto drag = [&](int by) {
      own |= own << static_cast<unsigned>(by) | below >> static_cast<unsigned>(64 - by);
      below |= below << static_cast<unsigned>(by);
    };
    int held = 1;
    for (; 2 * held <= within; held *= 2) drag(held);
    if (held < within) drag(within - held);
    bits[i] = own;
  }
  for (int held = within; held < l;) {
    const int by = 2 * held <= l ? held : l - held;
    const int word = by / 64;
    const auto shift = static_cast<unsigned>(by % 64);
    for (int i = words - 1; i >= word; --i) {
      const std::uint64_t below = shift != 0 && i > word ? bits[i - word - 1] >> (64 - shift) : 0;
      bits[i] |= bits[i - word] << shift | below;
    }
    held += by;
  }
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_UNCERTAINTY_BITS_HPP
