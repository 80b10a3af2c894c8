// SPDX-License-Identifier: Apache-2.0
// Selection, clamping, extremes and disjoint sets.
#ifndef NPSIM_CORE_ALGORITHM_HPP
#define NPSIM_CORE_ALGORITHM_HPP

#include <algorithm>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Selection, clamping and extremes under names of the library's own.
//
// std::nth_element of floats or std::clamp<float> is one body for all objects of a program, made with the instructions
// of whichever the linker met first. What stands here, and what is instantiated with Less, is in the namespace of its
// instruction set (core/detail/abi.hpp). The results are those of the standard library.

// The order of the standard algorithms, as a type of our own: std::sort(first, last, Less{}).
struct Less {
  template <class T>
  [[nodiscard]] constexpr bool operator()(const T& a, const T& b) const noexcept {
    return a < b;
  }
};

// Puts at `nth` what would stand there if all were sorted, nothing larger before it and nothing smaller behind it.
// Cost: O(n) on average.
template <class T>
void select_nth(T* first, T* nth, T* last) noexcept {
  std::nth_element(first, nth, last, Less{});
}

// x where it is a NaN; low <= high.
template <class T>
[[nodiscard]] constexpr T clamp_to(T x, T low, T high) noexcept {
  return x < low ? low : (high < x ? high : x);
}

// The first of equals; a NaN after the first value is passed over.
template <class T, class... More>
[[nodiscard]] constexpr T max_of(T most, More... more) noexcept {
  ((most = most < more ? more : most), ...);
  return most;
}

// Disjoint sets of numbers, each named by its least (union-find with path halving; Tarjan and van Leeuwen 1984).
// Caller owns the parents; each number starts as its own. Exact, serial.

// The least number of the set that i belongs to; halves the path on the way. Parents never exceed their children, so
// this ends after at most i steps.
[[nodiscard]] inline std::uint32_t find_root(Span<std::uint32_t> parent, std::uint32_t i) noexcept {
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

inline void unite(Span<std::uint32_t> parent, std::uint32_t i, std::uint32_t j) noexcept {
  const std::uint32_t a = find_root(parent, i);
  const std::uint32_t b = find_root(parent, j);
  if (a < b) {
    parent[b] = a;
  } else {
    parent[a] = b;
  }
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_ALGORITHM_HPP
