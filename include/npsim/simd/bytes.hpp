// SPDX-License-Identifier: Apache-2.0
// Batches of bytes: simd::U8, four times the lanes of simd::F32, for label maps and masks; and slide() for floats.
//
// Like the float batch it comes as a native and a one-lane type with the same results; BytesOf<F> is the one that
// belongs to the float batch F. Invariants: load(p, n) and store(p, n), 0 <= n <= lanes, touch n elements, the other
// lanes are 0; comparisons are unsigned and come as bits (lane i in bit i), because masks of bytes end up in bit maps.
//   U(x), U::load(p), U::load(p, n), U::from_bits(bits) (1 where the bit is set), U::from_bits(bits, x) (x there),
//   u.store(p), u.store(p, n), & |, min, max, less_bits(a, b) (a < b), equal_bits(a, b), lookup(U::Table(p), index):
//   p[min(index, 63)] from 64 bytes p, which the table keeps.
// slide<K>(a, b), 0 < K <= lanes: lanes K, K + 1, ... of a followed by b; neighbours without going through memory.
// Cost: about one instruction each, lookup about ten (two with AVX-512 VBMI; plain SSE2, which has no byte shuffle: a
// loop). No error.
#ifndef NPSIM_SIMD_BYTES_HPP
#define NPSIM_SIMD_BYTES_HPP

#include <cstdint>
#include <cstring>

#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace simd {

// clang-format off
namespace scalar {

struct U8 {
  static constexpr int lanes = 1;

  U8() = default;
  U8(std::uint8_t x) noexcept : value(x) {}  // NOLINT(google-explicit-constructor)
  [[nodiscard]] static U8 load(const std::uint8_t* p) noexcept { return *p; }
  [[nodiscard]] static U8 load(const std::uint8_t* p, int n) noexcept { return n > 0 ? *p : std::uint8_t{0}; }
  [[nodiscard]] static U8 from_bits(std::uint64_t bits, std::uint8_t x = 1) noexcept { return (bits & 1U) != 0 ? x : std::uint8_t{0}; }
  void store(std::uint8_t* p) const noexcept { *p = value; }
  void store(std::uint8_t* p, int n) const noexcept { if (n > 0) *p = value; }

  friend U8 operator&(U8 a, U8 b) noexcept { return static_cast<std::uint8_t>(a.value & b.value); }
  friend U8 operator|(U8 a, U8 b) noexcept { return static_cast<std::uint8_t>(a.value | b.value); }
  [[nodiscard]] friend U8 min(U8 a, U8 b) noexcept { return a.value < b.value ? a : b; }
  [[nodiscard]] friend U8 max(U8 a, U8 b) noexcept { return a.value > b.value ? a : b; }
  [[nodiscard]] friend std::uint64_t less_bits(U8 a, U8 b) noexcept { return a.value < b.value ? 1U : 0U; }
  [[nodiscard]] friend std::uint64_t equal_bits(U8 a, U8 b) noexcept { return a.value == b.value ? 1U : 0U; }

  struct Table {
    explicit Table(const std::uint8_t* p) noexcept { std::memcpy(bytes, p, sizeof(bytes)); }
    std::uint8_t bytes[64];
  };
  [[nodiscard]] friend U8 lookup(const Table& t, U8 index) noexcept { return t.bytes[index.value < 63 ? index.value : 63]; }

  std::uint8_t value;
};

}  // namespace scalar

template <int K>
[[nodiscard]] scalar::F32 slide(scalar::F32, scalar::F32 b) noexcept {
  static_assert(K == 1);
  return b;
}

#if !defined(NPSIM_SIMD_SCALAR)

namespace native {

#if defined(NPSIM_SIMD_AVX512)
using ByteRegister = __m512i;
#elif defined(NPSIM_SIMD_AVX2)
using ByteRegister = __m256i;
#elif defined(NPSIM_SIMD_SSE2)
using ByteRegister = __m128i;
#else
using ByteRegister = uint8x16_t;
#endif

struct U8 {
  static constexpr int lanes = 4 * kLanes;

  U8() = default;
  U8(std::uint8_t x) noexcept;  // NOLINT(google-explicit-constructor)
  explicit U8(const ByteRegister& r) noexcept : value(r) {}
  [[nodiscard]] static U8 load(const std::uint8_t* p) noexcept;
  [[nodiscard]] static U8 load(const std::uint8_t* p, int n) noexcept {
    std::uint8_t all[lanes] = {};
    std::memcpy(all, p, static_cast<std::size_t>(n));
    return load(all);
  }
  [[nodiscard]] static U8 from_bits(std::uint64_t bits, std::uint8_t x = 1) noexcept;
  void store(std::uint8_t* p) const noexcept;
  void store(std::uint8_t* p, int n) const noexcept {
    std::uint8_t all[lanes];
    store(all);
    std::memcpy(p, all, static_cast<std::size_t>(n));
  }

  friend U8 operator&(U8 a, U8 b) noexcept;
  friend U8 operator|(U8 a, U8 b) noexcept;
  friend U8 min(U8 a, U8 b) noexcept;
  friend U8 max(U8 a, U8 b) noexcept;
  friend std::uint64_t less_bits(U8 a, U8 b) noexcept;
  friend std::uint64_t equal_bits(U8 a, U8 b) noexcept;

  struct Table {
    explicit Table(const std::uint8_t* p) noexcept;
#if defined(NPSIM_SIMD_AVX512) && defined(__AVX512VBMI__)
    ByteRegister all;
#elif defined(NPSIM_SIMD_SSE2)
    std::uint8_t bytes[64];
#else
    ByteRegister part[4];  // 16 bytes each, in every quarter of the register
#endif
  };
  friend U8 lookup(const Table& table, U8 index) noexcept;

  ByteRegister value;
};
// clang-format on

#if defined(NPSIM_SIMD_AVX512)

inline U8::U8(std::uint8_t x) noexcept : value(_mm512_set1_epi8(static_cast<char>(x))) {}
inline U8 U8::load(const std::uint8_t* p) noexcept { return U8(_mm512_loadu_si512(p)); }
inline U8 U8::from_bits(std::uint64_t bits, std::uint8_t x) noexcept {
  return U8(_mm512_maskz_set1_epi8(bits, static_cast<char>(x)));
}
inline void U8::store(std::uint8_t* p) const noexcept { _mm512_storeu_si512(p, value); }
inline U8 operator&(U8 a, U8 b) noexcept { return U8(_mm512_and_si512(a.value, b.value)); }
inline U8 operator|(U8 a, U8 b) noexcept { return U8(_mm512_or_si512(a.value, b.value)); }
inline U8 min(U8 a, U8 b) noexcept { return U8(_mm512_min_epu8(a.value, b.value)); }
inline U8 max(U8 a, U8 b) noexcept { return U8(_mm512_max_epu8(a.value, b.value)); }
inline std::uint64_t less_bits(U8 a, U8 b) noexcept { return _mm512_cmplt_epu8_mask(a.value, b.value); }
inline std::uint64_t equal_bits(U8 a, U8 b) noexcept { return _mm512_cmpeq_epi8_mask(a.value, b.value); }
#if defined(__AVX512VBMI__)
inline U8::Table::Table(const std::uint8_t* p) noexcept : all(_mm512_loadu_si512(p)) {}
inline U8 lookup(const U8::Table& table, U8 index) noexcept {
  const __m512i at = _mm512_min_epu8(index.value, _mm512_set1_epi8(63));
  return U8(_mm512_maskz_permutexvar_epi8(~__mmask64{0}, at, table.all));
}
#else
inline U8::Table::Table(const std::uint8_t* p) noexcept {
  for (__m512i& r : part) {
    r = _mm512_maskz_broadcast_i32x4(kAllLanes, _mm_loadu_si128(reinterpret_cast<const __m128i*>(p)));
    p += 16;
  }
}
inline U8 lookup(const U8::Table& table, U8 index) noexcept {
  const __m512i at = _mm512_min_epu8(index.value, _mm512_set1_epi8(63));
  const __mmask64 odd = _mm512_test_epi8_mask(at, _mm512_set1_epi8(16));
  const __mmask64 upper = _mm512_test_epi8_mask(at, _mm512_set1_epi8(32));
  const __m512i low = _mm512_mask_shuffle_epi8(_mm512_shuffle_epi8(table.part[0], at), odd, table.part[1], at);
  const __m512i high = _mm512_mask_shuffle_epi8(_mm512_shuffle_epi8(table.part[2], at), odd, table.part[3], at);
  return U8(_mm512_mask_blend_epi8(upper, low, high));
}
#endif

#elif defined(NPSIM_SIMD_AVX2)

inline U8::U8(std::uint8_t x) noexcept : value(_mm256_set1_epi8(static_cast<char>(x))) {}
inline U8 U8::load(const std::uint8_t* p) noexcept {
  return U8(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)));
}
inline U8 U8::from_bits(std::uint64_t bits, std::uint8_t x) noexcept {
  const __m256i eight_lanes = _mm256_setr_epi64x(0, 0x0101010101010101, 0x0202020202020202, 0x0303030303030303);
  const __m256i copied = _mm256_shuffle_epi8(_mm256_set1_epi32(static_cast<int>(bits)), eight_lanes);
  const __m256i each = _mm256_set1_epi64x(static_cast<std::int64_t>(0x8040201008040201U));
  const __m256i set = _mm256_cmpeq_epi8(_mm256_and_si256(copied, each), each);
  return U8(_mm256_and_si256(set, _mm256_set1_epi8(static_cast<char>(x))));
}
inline void U8::store(std::uint8_t* p) const noexcept { _mm256_storeu_si256(reinterpret_cast<__m256i*>(p), value); }
inline U8 operator&(U8 a, U8 b) noexcept { return U8(_mm256_and_si256(a.value, b.value)); }
inline U8 operator|(U8 a, U8 b) noexcept { return U8(_mm256_or_si256(a.value, b.value)); }
inline U8 min(U8 a, U8 b) noexcept { return U8(_mm256_min_epu8(a.value, b.value)); }
inline U8 max(U8 a, U8 b) noexcept { return U8(_mm256_max_epu8(a.value, b.value)); }
inline std::uint64_t less_bits(U8 a, U8 b) noexcept {
  const __m256i not_less = _mm256_cmpeq_epi8(_mm256_max_epu8(a.value, b.value), a.value);
  return static_cast<std::uint32_t>(~_mm256_movemask_epi8(not_less));
}
inline std::uint64_t equal_bits(U8 a, U8 b) noexcept {
  return static_cast<std::uint32_t>(_mm256_movemask_epi8(_mm256_cmpeq_epi8(a.value, b.value)));
}
inline U8::Table::Table(const std::uint8_t* p) noexcept {
  for (__m256i& r : part) {
    r = _mm256_broadcastsi128_si256(_mm_loadu_si128(reinterpret_cast<const __m128i*>(p)));
    p += 16;
  }
}
inline U8 lookup(const U8::Table& table, U8 index) noexcept {
  const __m256i at = _mm256_min_epu8(index.value, _mm256_set1_epi8(63));
  const auto part = [&table, at](int i) { return _mm256_shuffle_epi8(table.part[i], at); };
  // blendv looks at the top bit of each byte: bits 4 and 5 of the index are moved there.
  const __m256i odd = _mm256_slli_epi16(at, 3);
  const __m256i upper = _mm256_slli_epi16(at, 2);
  return U8(
      _mm256_blendv_epi8(_mm256_blendv_epi8(part(0), part(1), odd), _mm256_blendv_epi8(part(2), part(3), odd), upper));
}

#elif defined(NPSIM_SIMD_SSE2)

inline U8::U8(std::uint8_t x) noexcept : value(_mm_set1_epi8(static_cast<char>(x))) {}
inline U8 U8::load(const std::uint8_t* p) noexcept { return U8(_mm_loadu_si128(reinterpret_cast<const __m128i*>(p))); }
inline U8 U8::from_bits(std::uint64_t bits, std::uint8_t x) noexcept {
  constexpr std::uint64_t kEach = 0x0101010101010101U;
  const __m128i copied = _mm_set_epi64x(static_cast<std::int64_t>((bits >> 8 & 0xFFU) * kEach),
                                        static_cast<std::int64_t>((bits & 0xFFU) * kEach));
  const __m128i each = _mm_set1_epi64x(static_cast<std::int64_t>(0x8040201008040201U));
  const __m128i set = _mm_cmpeq_epi8(_mm_and_si128(copied, each), each);
  return U8(_mm_and_si128(set, _mm_set1_epi8(static_cast<char>(x))));
}
inline void U8::store(std::uint8_t* p) const noexcept { _mm_storeu_si128(reinterpret_cast<__m128i*>(p), value); }
inline U8 operator&(U8 a, U8 b) noexcept { return U8(_mm_and_si128(a.value, b.value)); }
inline U8 operator|(U8 a, U8 b) noexcept { return U8(_mm_or_si128(a.value, b.value)); }
inline U8 min(U8 a, U8 b) noexcept { return U8(_mm_min_epu8(a.value, b.value)); }
inline U8 max(U8 a, U8 b) noexcept { return U8(_mm_max_epu8(a.value, b.value)); }
inline std::uint64_t less_bits(U8 a, U8 b) noexcept {
  const __m128i not_less = _mm_cmpeq_epi8(_mm_max_epu8(a.value, b.value), a.value);
  return static_cast<std::uint32_t>(_mm_movemask_epi8(not_less)) ^ 0xFFFFU;
}
inline std::uint64_t equal_bits(U8 a, U8 b) noexcept {
  return static_cast<std::uint32_t>(_mm_movemask_epi8(_mm_cmpeq_epi8(a.value, b.value)));
}
inline U8::Table::Table(const std::uint8_t* p) noexcept { std::memcpy(bytes, p, sizeof(bytes)); }
inline U8 lookup(const U8::Table& table, U8 index) noexcept {
  std::uint8_t at[U8::lanes];
  index.store(at);
  for (std::uint8_t& b : at) b = table.bytes[b < 63 ? b : 63];
  return U8::load(at);
}

#else  // NEON64

inline U8::U8(std::uint8_t x) noexcept : value(vdupq_n_u8(x)) {}
inline U8 U8::load(const std::uint8_t* p) noexcept { return U8(vld1q_u8(p)); }
inline U8 U8::from_bits(std::uint64_t bits, std::uint8_t x) noexcept {
  const uint8x16_t weight = vreinterpretq_u8_u64(vdupq_n_u64(0x8040201008040201U));
  const uint8x16_t copied = vcombine_u8(vdup_n_u8(static_cast<std::uint8_t>(bits & 0xFFU)),
                                        vdup_n_u8(static_cast<std::uint8_t>(bits >> 8 & 0xFFU)));
  return U8(vandq_u8(vtstq_u8(copied, weight), vdupq_n_u8(x)));
}
inline void U8::store(std::uint8_t* p) const noexcept { vst1q_u8(p, value); }
inline U8 operator&(U8 a, U8 b) noexcept { return U8(vandq_u8(a.value, b.value)); }
inline U8 operator|(U8 a, U8 b) noexcept { return U8(vorrq_u8(a.value, b.value)); }
inline U8 min(U8 a, U8 b) noexcept { return U8(vminq_u8(a.value, b.value)); }
inline U8 max(U8 a, U8 b) noexcept { return U8(vmaxq_u8(a.value, b.value)); }
inline std::uint64_t lane_bits(uint8x16_t all_or_none) noexcept {
  const uint8x16_t own = vandq_u8(all_or_none, vreinterpretq_u8_u64(vdupq_n_u64(0x8040201008040201U)));
  return std::uint64_t{vaddv_u8(vget_low_u8(own))} | std::uint64_t{vaddv_u8(vget_high_u8(own))} << 8;
}
inline std::uint64_t less_bits(U8 a, U8 b) noexcept { return lane_bits(vcltq_u8(a.value, b.value)); }
inline std::uint64_t equal_bits(U8 a, U8 b) noexcept { return lane_bits(vceqq_u8(a.value, b.value)); }
inline U8::Table::Table(const std::uint8_t* p) noexcept {
  for (uint8x16_t& r : part) {
    r = vld1q_u8(p);
    p += 16;
  }
}
inline U8 lookup(const U8::Table& table, U8 index) noexcept {
  const uint8x16x4_t parts = {{table.part[0], table.part[1], table.part[2], table.part[3]}};
  return U8(vqtbl4q_u8(parts, vminq_u8(index.value, vdupq_n_u8(63))));
}

#endif

}  // namespace native

template <int K>
[[nodiscard]] native::F32 slide(native::F32 a, native::F32 b) noexcept {
  static_assert(0 < K && K <= native::kLanes);
  if constexpr (K == native::kLanes) {
    return b;
  } else {
#if defined(NPSIM_SIMD_AVX512)
    return native::F32(native::as_float(native::IntBatch(
        _mm512_maskz_alignr_epi32(native::kAllLanes, native::as_int(b.value), native::as_int(a.value), K))));
#elif defined(NPSIM_SIMD_AVX2)
    const __m256i low = native::as_int(a.value);
    const __m256i high = native::as_int(b.value);
    const __m256i middle = _mm256_permute2x128_si256(low, high, 0x21);
    if constexpr (K < 4) {
      return native::F32(native::as_float(native::IntBatch(_mm256_alignr_epi8(middle, low, 4 * K))));
    } else if constexpr (K == 4) {
      return native::F32(native::as_float(native::IntBatch(middle)));
    } else {
      return native::F32(native::as_float(native::IntBatch(_mm256_alignr_epi8(high, middle, 4 * K - 16))));
    }
#elif defined(NPSIM_SIMD_SSE2)
    return native::F32(native::as_float(native::IntBatch(_mm_or_si128(
        _mm_srli_si128(native::as_int(a.value), 4 * K), _mm_slli_si128(native::as_int(b.value), 16 - 4 * K)))));
#else
    return native::F32(native::FloatBatch(vextq_f32(a.value, b.value, K)));
#endif
  }
}

#endif  // NPSIM_SIMD_SCALAR

namespace bytes_detail {
template <class F>
struct Of;
template <>
struct Of<scalar::F32> {
  using Type = scalar::U8;
};
#if !defined(NPSIM_SIMD_SCALAR)
template <>
struct Of<native::F32> {
  using Type = native::U8;
};
#endif
}  // namespace bytes_detail

template <class F>
using BytesOf = typename bytes_detail::Of<F>::Type;
using U8 = BytesOf<F32>;

}  // namespace simd
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SIMD_BYTES_HPP
