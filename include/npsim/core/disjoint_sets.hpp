// SPDX-License-Identifier: Apache-2.0
// Disjoint sets of numbers, each named by its least (union-find with path halving; Tarjan and van Leeuwen 1984).
// Caller owns the parents; each number starts as its own. Exact, serial.
#ifndef NPSIM_CORE_DISJOINT_SETS_HPP
#define NPSIM_CORE_DISJOINT_SETS_HPP

#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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

#endif  // NPSIM_CORE_DISJOINT_SETS_HPP
