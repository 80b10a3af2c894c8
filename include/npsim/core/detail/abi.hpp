// SPDX-License-Identifier: Apache-2.0
// The inline namespace that everything in the library stands in, named after its version and after the instructions
// that the compiler may use in this translation unit: npsim::v0_1_avx2_fma_bmi2_lzcnt_movbe_popcnt::ImageView.
//
//   namespace npsim { inline namespace NPSIM_ABI {
// Two objects that may not use the same instructions then share no symbol of the library, so that they can be linked
// into one program: a linker keeps one body of an inline function for all objects, and would give that of AVX-512 to
// code for older processors. Users never write the name. What passes between objects of different sets are plain C
// types, as a function with C linkage and one name for each set takes them (samples/dispatch).
// Every instruction set that g++ 12 or clang 14 puts into ordinary code by itself is in the name. NPSIM_SIMD_SCALAR,
// given by the user or set here where there are no registers that simd/ knows, stands for one lane; it too is named.
#ifndef NPSIM_CORE_DETAIL_ABI_HPP
#define NPSIM_CORE_DETAIL_ABI_HPP

// The registers and the operations on floats.
#if defined(__AVX512F__) && defined(__AVX512CD__) && defined(__AVX512BW__) && defined(__AVX512DQ__) && \
    defined(__AVX512VL__)
#define NPSIM_ABI_LEVEL _avx512
#elif defined(__AVX512F__) && defined(__AVX512BW__) && defined(__AVX512DQ__)
#define NPSIM_ABI_LEVEL _avx512bwdq
#elif defined(__AVX512F__)
#define NPSIM_ABI_LEVEL _avx512f
#elif defined(__AVX2__)
#define NPSIM_ABI_LEVEL _avx2
#elif defined(__AVX__)
#define NPSIM_ABI_LEVEL _avx
#elif defined(__SSE4_2__)
#define NPSIM_ABI_LEVEL _sse42
#elif defined(__SSE4_1__)
#define NPSIM_ABI_LEVEL _sse41
#elif defined(__SSSE3__)
#define NPSIM_ABI_LEVEL _ssse3
#elif defined(__SSE3__)
#define NPSIM_ABI_LEVEL _sse3
#elif defined(__SSE2__)
#define NPSIM_ABI_LEVEL _sse2
#elif defined(__ARM_FEATURE_SVE)
#define NPSIM_ABI_LEVEL _sve
#elif defined(__aarch64__) && defined(__ARM_NEON)
#define NPSIM_ABI_LEVEL _neon64
#else
#define NPSIM_ABI_LEVEL _generic
#endif

#if !defined(NPSIM_SIMD_SCALAR) && !defined(__SSE2__) && !(defined(__aarch64__) && defined(__ARM_NEON))
#define NPSIM_SIMD_SCALAR 1
#endif
#if defined(NPSIM_SIMD_SCALAR)
#define NPSIM_ABI_LANES _scalar
#else
#define NPSIM_ABI_LANES
#endif

// What comes with some processors of a level and not with others.
#if defined(__FMA__)
#define NPSIM_ABI_FMA _fma
#else
#define NPSIM_ABI_FMA
#endif
#if defined(__BMI2__)
#define NPSIM_ABI_BMI _bmi2
#elif defined(__BMI__)
#define NPSIM_ABI_BMI _bmi
#else
#define NPSIM_ABI_BMI
#endif
#if defined(__LZCNT__)
#define NPSIM_ABI_LZCNT _lzcnt
#else
#define NPSIM_ABI_LZCNT
#endif
#if defined(__MOVBE__)
#define NPSIM_ABI_MOVBE _movbe
#else
#define NPSIM_ABI_MOVBE
#endif
#if defined(__POPCNT__)
#define NPSIM_ABI_POPCNT _popcnt
#else
#define NPSIM_ABI_POPCNT
#endif
#if defined(__FMA4__) || defined(__XOP__) || defined(__TBM__)
#define NPSIM_ABI_AMD _xop
#else
#define NPSIM_ABI_AMD
#endif
#if defined(__AVX512VBMI__) && defined(__AVX512VBMI2__)
#define NPSIM_ABI_VBMI _vbmi2
#elif defined(__AVX512VBMI__)
#define NPSIM_ABI_VBMI _vbmi
#else
#define NPSIM_ABI_VBMI
#endif
#if defined(__AVX512VPOPCNTDQ__) || defined(__AVX512BITALG__)
#define NPSIM_ABI_VPOPCNT _vpopcnt
#else
#define NPSIM_ABI_VPOPCNT
#endif
#if defined(__AVX512VNNI__) || defined(__AVXVNNI__)
#define NPSIM_ABI_VNNI _vnni
#else
#define NPSIM_ABI_VNNI
#endif
#if defined(__GFNI__)
#define NPSIM_ABI_GFNI _gfni
#else
#define NPSIM_ABI_GFNI
#endif
#if defined(__AVX512FP16__) || defined(__ARM_FEATURE_FP16_VECTOR_ARITHMETIC)
#define NPSIM_ABI_FP16 _fp16
#else
#define NPSIM_ABI_FP16
#endif
#if defined(__ARM_FEATURE_ATOMICS)
#define NPSIM_ABI_LSE _lse
#else
#define NPSIM_ABI_LSE
#endif
#if defined(__ARM_FEATURE_DOTPROD)
#define NPSIM_ABI_DOTPROD _dotprod
#else
#define NPSIM_ABI_DOTPROD
#endif

#define NPSIM_ABI_PASTE_(version, level, lanes, a, b, c, d, e, f, g, h, i, j, k, l, m) \
  version##level##lanes##a##b##c##d##e##f##g##h##i##j##k##l##m
#define NPSIM_ABI_PASTE(version, level, lanes, a, b, c, d, e, f, g, h, i, j, k, l, m) \
  NPSIM_ABI_PASTE_(version, level, lanes, a, b, c, d, e, f, g, h, i, j, k, l, m)
#define NPSIM_ABI                                                                                                  \
  NPSIM_ABI_PASTE(v0_1, NPSIM_ABI_LEVEL, NPSIM_ABI_LANES, NPSIM_ABI_FMA, NPSIM_ABI_BMI, NPSIM_ABI_LZCNT,           \
                  NPSIM_ABI_MOVBE, NPSIM_ABI_POPCNT, NPSIM_ABI_AMD, NPSIM_ABI_VBMI, NPSIM_ABI_VPOPCNT,             \
                  NPSIM_ABI_VNNI, NPSIM_ABI_GFNI, NPSIM_ABI_FP16, NPSIM_ABI_LSE, NPSIM_ABI_DOTPROD)

#endif  // NPSIM_CORE_DETAIL_ABI_HPP
