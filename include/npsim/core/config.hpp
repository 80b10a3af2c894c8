// SPDX-License-Identifier: Apache-2.0
// Version, floating-point contract and the namespace of the instruction set; included by every other header.
//
// Invariant: results depend on the source alone. Value-changing optimisation breaks the error bounds that the
// headers state (NaN tests vanish, sums are reordered), so compiling under fast-math is refused rather than
// tolerated. Build with -ffp-contract=off to get the same bits from every compiler; the CMake target sets it.
#ifndef NPSIM_CORE_CONFIG_HPP
#define NPSIM_CORE_CONFIG_HPP

#define NPSIM_VERSION_MAJOR 0
#define NPSIM_VERSION_MINOR 1
#define NPSIM_VERSION_PATCH 0
#define NPSIM_VERSION_STRING "0.1.0"

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ != 0)
#error "NPSim needs strict floating point: compile without -ffast-math and -ffinite-math-only"
#endif

#if !((defined(_MSVC_LANG) && _MSVC_LANG >= 201703L) || __cplusplus >= 201703L)
#error "NPSim needs C++17 or newer"
#endif

// For the innermost functions of a traversal or a tap loop, which compilers refuse to inline for their size although a
// call costs more than they do. Nowhere else.
#if defined(__GNUC__) || defined(__clang__)
#define NPSIM_ALWAYS_INLINE inline __attribute__((always_inline))
#else
#define NPSIM_ALWAYS_INLINE inline
#endif

#include "npsim/core/detail/abi.hpp"

#endif  // NPSIM_CORE_CONFIG_HPP
