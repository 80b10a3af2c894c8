// SPDX-License-Identifier: Apache-2.0
// Names the instruction set of this translation unit. Kernels stand in
//   namespace npsim { inline namespace v1 { inline namespace NPSIM_ISA_NAMESPACE {
// so that objects compiled for two instruction sets link into one program without breaking the one-definition rule.
// Define NPSIM_SIMD_SCALAR to force the one-lane fallback.
#ifndef NPSIM_SIMD_ISA_HPP
#define NPSIM_SIMD_ISA_HPP

#include "npsim/core/config.hpp"

#if defined(NPSIM_SIMD_SCALAR)
#define NPSIM_ISA_NAMESPACE isa_scalar
#elif defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512DQ__) && defined(__FMA__)
#define NPSIM_ISA_NAMESPACE isa_avx512
#elif defined(__AVX2__) && defined(__FMA__)
#define NPSIM_ISA_NAMESPACE isa_avx2
#elif defined(__SSE2__)
#define NPSIM_ISA_NAMESPACE isa_sse2
#elif defined(__aarch64__) && defined(__ARM_NEON)
#define NPSIM_ISA_NAMESPACE isa_neon64
#else
#define NPSIM_ISA_NAMESPACE isa_scalar
#define NPSIM_SIMD_SCALAR 1
#endif

#endif  // NPSIM_SIMD_ISA_HPP
