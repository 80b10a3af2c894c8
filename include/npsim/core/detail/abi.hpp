// SPDX-License-Identifier: Apache-2.0
// The inline namespace that everything in the library stands in, named after its version and after the instructions
// that the compiler may use in this translation unit: npsim::v0_1_avx2_fma_bmi_bmi2_lzcnt_popcnt_movbe::ImageView.
//
//   namespace npsim { inline namespace NPSIM_ABI {
// Of the equal bodies that objects hold of an inline function, a linker keeps one: AVX-512 code would reach processors
// that lack it. Objects that may not use the same instructions share no symbol of the library and can be linked into
// one program. Users never write the name; what passes between such objects are plain C types (samples/dispatch).
//
// Named is every set that g++ 12 or clang 14 uses of itself. Not named are those that only intrinsics or types reach
// that the library does not use: AES, PCLMUL, SHA, CRC32, ADX, F16C, BF16, IFMA, write prefetches and the like.
#ifndef NPSIM_CORE_DETAIL_ABI_HPP
#define NPSIM_CORE_DETAIL_ABI_HPP

// One lane, asked for by the user or set here where there are no registers that simd/ knows.
#if !defined(NPSIM_SIMD_SCALAR) && !defined(__SSE2__) && !(defined(__aarch64__) && defined(__ARM_NEON))
#define NPSIM_SIMD_SCALAR 1
#endif
#if defined(NPSIM_SIMD_SCALAR)
#define NPSIM_ABI_LANES _scalar
#else
#define NPSIM_ABI_LANES
#endif

// Each of these contains those below it.
#if defined(__AVX512F__)
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
#elif defined(__aarch64__) && defined(__ARM_NEON)
#define NPSIM_ABI_LEVEL _neon64
#else
#define NPSIM_ABI_LEVEL _generic
#endif

// NPSIM_ABI_IF(macro, word) is the word where the macro is 1, and nothing where it is not defined.
#define NPSIM_ABI_1 ,
#define NPSIM_ABI_SECOND(first, second, ...) second
#define NPSIM_ABI_PICK(...) NPSIM_ABI_SECOND(__VA_ARGS__)
#define NPSIM_ABI_TEST(value, word) NPSIM_ABI_PICK(NPSIM_ABI_##value word, , )
#define NPSIM_ABI_IF(macro, word) NPSIM_ABI_TEST(macro, word)

#define NPSIM_ABI_PASTE(a, b, c, d, e, f, g, h, i, j) a##b##c##d##e##f##g##h##i##j
#define NPSIM_ABI_JOIN(a, b, c, d, e, f, g, h, i, j) NPSIM_ABI_PASTE(a, b, c, d, e, f, g, h, i, j)

#define NPSIM_ABI_SCALAR_X86                                                                                          \
  NPSIM_ABI_JOIN(NPSIM_ABI_IF(__FMA__, _fma), NPSIM_ABI_IF(__BMI__, _bmi), NPSIM_ABI_IF(__BMI2__, _bmi2),             \
                 NPSIM_ABI_IF(__LZCNT__, _lzcnt), NPSIM_ABI_IF(__POPCNT__, _popcnt), NPSIM_ABI_IF(__MOVBE__, _movbe), \
                 NPSIM_ABI_IF(__SSE4A__, _sse4a), NPSIM_ABI_IF(__FMA4__, _fma4), NPSIM_ABI_IF(__XOP__, _xop),         \
                 NPSIM_ABI_IF(__TBM__, _tbm))
#define NPSIM_ABI_VECTOR_X86                                                                                        \
  NPSIM_ABI_JOIN(NPSIM_ABI_IF(__AVX512CD__, _cd), NPSIM_ABI_IF(__AVX512BW__, _bw), NPSIM_ABI_IF(__AVX512DQ__, _dq), \
                 NPSIM_ABI_IF(__AVX512VL__, _vl), NPSIM_ABI_IF(__AVX512VBMI__, _vbmi),                              \
                 NPSIM_ABI_IF(__AVX512VBMI2__, _vbmi2), NPSIM_ABI_IF(__AVX512VNNI__, _vnni),                        \
                 NPSIM_ABI_IF(__AVX512BITALG__, _bitalg), NPSIM_ABI_IF(__AVX512VPOPCNTDQ__, _vpopcntdq),            \
                 NPSIM_ABI_IF(__AVX512FP16__, _fp16))
#define NPSIM_ABI_OTHERS                                                                                        \
  NPSIM_ABI_JOIN(NPSIM_ABI_IF(__AVXVNNI__, _avxvnni), NPSIM_ABI_IF(__GFNI__, _gfni),                            \
                 NPSIM_ABI_IF(__ARM_FEATURE_ATOMICS, _lse), NPSIM_ABI_IF(__ARM_FEATURE_DOTPROD, _dotprod),      \
                 NPSIM_ABI_IF(__ARM_FEATURE_FP16_VECTOR_ARITHMETIC, _fp16),                                     \
                 NPSIM_ABI_IF(__ARM_FEATURE_MATMUL_INT8, _i8mm), NPSIM_ABI_IF(__ARM_FEATURE_COMPLEX, _complex), \
                 NPSIM_ABI_IF(__ARM_FEATURE_SVE, _sve), NPSIM_ABI_IF(__ARM_FEATURE_SVE2, _sve2),                \
                 NPSIM_ABI_IF(__ARM_FEATURE_MOPS, _mops))

#define NPSIM_ABI                                                                                  \
  NPSIM_ABI_JOIN(v, NPSIM_VERSION_MAJOR, _, NPSIM_VERSION_MINOR, NPSIM_ABI_LEVEL, NPSIM_ABI_LANES, \
                 NPSIM_ABI_VECTOR_X86, NPSIM_ABI_SCALAR_X86, NPSIM_ABI_OTHERS, )

#endif  // NPSIM_CORE_DETAIL_ABI_HPP
