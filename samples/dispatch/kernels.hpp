// SPDX-License-Identifier: Apache-2.0
// What this program's instruction sets share: a function with C linkage for each, of plain C types. kernels.cpp is
// compiled once for each set; nothing of the library crosses between them.
#ifndef NPSIM_SAMPLES_DISPATCH_KERNELS_HPP
#define NPSIM_SAMPLES_DISPATCH_KERNELS_HPP

#include <cstddef>

#define DISPATCH_JOIN_(name, set) name##set
#define DISPATCH_JOIN(name, set) DISPATCH_JOIN_(name, set)

// photograph_SET: takes a photograph of width x height luminances in cd/m2 (linear RGB, row by row), 8-bit sRGB out.
// Works in the caller's memory, of the size that photograph_bytes_SET states. Returns a message, empty where all is
// well. The calling processor must have the set.
#define DISPATCH_DECLARE(set)                                                                                 \
  extern "C" std::size_t DISPATCH_JOIN(photograph_bytes_, set)(int width, int height);                        \
  extern "C" const char* DISPATCH_JOIN(photograph_, set)(const float* luminance_cd_m2, int width, int height, \
                                                         unsigned char* picture, void* memory, std::size_t bytes);

#if defined(__x86_64__)
DISPATCH_DECLARE(sse2)
DISPATCH_DECLARE(avx2)
DISPATCH_DECLARE(avx512)
#else
DISPATCH_DECLARE(only)
#endif

#endif  // NPSIM_SAMPLES_DISPATCH_KERNELS_HPP
