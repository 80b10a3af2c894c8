// SPDX-License-Identifier: Apache-2.0
// Whether this processor and its operating system run code that was compiled with -march=x86-64-v3 or -v4. Every
// instruction that those flags allow is asked for, for a compiler uses them all; and the system must keep the wide
// registers when it switches between programs, which it says in XCR0.
#ifndef NPSIM_SAMPLES_DISPATCH_PROCESSOR_HPP
#define NPSIM_SAMPLES_DISPATCH_PROCESSOR_HPP

#if defined(__x86_64__)
#include <cpuid.h>

namespace dispatch {

struct Processor {
  bool v3 = false;  // AVX2, FMA and what came with them
  bool v4 = false;  // AVX-512 F, CD, BW, DQ, VL besides
};

// Bits as in Intel's manual, volume 2, CPUID, and AMD's, volume 3, appendix E.
inline Processor this_processor() {
  constexpr unsigned kOsxsave = 1U << 27U;                                        // leaf 1, ecx: XGETBV may be used
  constexpr unsigned kLeaf1Ecx = 1U << 0U | 1U << 9U | 1U << 12U | 1U << 13U |    // SSE3, SSSE3, FMA, CMPXCHG16B
                                 1U << 19U | 1U << 20U | 1U << 22U | 1U << 23U |  // SSE4.1, SSE4.2, MOVBE, POPCNT
                                 kOsxsave | 1U << 28U | 1U << 29U;                // AVX, F16C
  constexpr unsigned kLeaf7Ebx = 1U << 3U | 1U << 5U | 1U << 8U;                  // BMI1, AVX2, BMI2
  constexpr unsigned kExtendedEcx = 1U << 0U | 1U << 5U;                          // LAHF and SAHF, LZCNT
  constexpr unsigned kLeaf7EbxV4 = 1U << 16U | 1U << 17U | 1U << 28U | 1U << 30U | 1U << 31U;  // F, DQ, CD, BW, VL
  constexpr unsigned kYmmState = 1U << 1U | 1U << 2U;                                          // xmm, upper ymm
  constexpr unsigned kZmmState = kYmmState | 1U << 5U | 1U << 6U | 1U << 7U;  // masks, upper zmm 0-15, zmm 16-31

  unsigned a = 0;
  unsigned b = 0;
  unsigned leaf1 = 0;
  unsigned d = 0;
  if (__get_cpuid(1, &a, &b, &leaf1, &d) == 0 || (leaf1 & kLeaf1Ecx) != kLeaf1Ecx) return {};
  unsigned extended = 0;
  if (__get_cpuid(0x80000001U, &a, &b, &extended, &d) == 0 || (extended & kExtendedEcx) != kExtendedEcx) return {};
  unsigned leaf7 = 0;
  unsigned c = 0;
  if (__get_cpuid_count(7, 0, &a, &leaf7, &c, &d) == 0) return {};
  unsigned xcr0 = 0;
  __asm__ volatile("xgetbv" : "=a"(xcr0), "=d"(d) : "c"(0));

  Processor processor;
  processor.v3 = (leaf7 & kLeaf7Ebx) == kLeaf7Ebx && (xcr0 & kYmmState) == kYmmState;
  processor.v4 = processor.v3 && (leaf7 & kLeaf7EbxV4) == kLeaf7EbxV4 && (xcr0 & kZmmState) == kZmmState;
  return processor;
}

}  // namespace dispatch
#endif

#endif  // NPSIM_SAMPLES_DISPATCH_PROCESSOR_HPP
