// SPDX-License-Identifier: Apache-2.0
// night_SET: two nights of a small street, made by the object of one instruction set; a hash of all their bits, 0 where
// the pipeline failed.
#ifndef NPSIM_TESTS_DISPATCH_NIGHT_HPP
#define NPSIM_TESTS_DISPATCH_NIGHT_HPP

#include <cstddef>
#include <cstdint>

#include "dispatch/kernels.hpp"

#define DISPATCH_DECLARE_NIGHT(set) \
  extern "C" std::uint64_t DISPATCH_JOIN(night_, set)(unsigned char* memory, std::size_t bytes);

DISPATCH_DECLARE_NIGHT(sse2)
DISPATCH_DECLARE_NIGHT(avx2)
DISPATCH_DECLARE_NIGHT(avx512)

#endif  // NPSIM_TESTS_DISPATCH_NIGHT_HPP
