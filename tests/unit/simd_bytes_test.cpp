// SPDX-License-Identifier: Apache-2.0
// Batches of bytes and slide(): the native batch against the definition, byte by byte.
#include <doctest/doctest.h>
#include <algorithm>
#include <cstdint>
#include <vector>

#include "npsim/core/random.hpp"
#include "npsim/simd/bytes.hpp"

namespace {

namespace simd = npsim::simd;

template <class U>
void check_bytes() {
  npsim::RandomStream random(3, npsim::RandomPurpose::test, 0, 0, 0, 0);
  std::uint8_t table[64];
  for (std::uint8_t& t : table) t = static_cast<std::uint8_t>(random.next_u32());
  std::vector<std::uint8_t> a(512 + 64);
  std::vector<std::uint8_t> b(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    a[i] = static_cast<std::uint8_t>(i < 256 ? i : random.next_u32());
    b[i] = static_cast<std::uint8_t>(i % 3 == 0 ? a[i] : random.next_u32());
  }
  const typename U::Table look(table);
  for (std::size_t i = 0; i < 512; i += static_cast<std::size_t>(U::lanes)) {
    std::uint8_t low[U::lanes], high[U::lanes], looked[U::lanes], whole[U::lanes], both[U::lanes], either[U::lanes];
    const U x = U::load(&a[i]);
    const U y = U::load(&b[i]);
    min(x, y).store(low);
    max(x, y).store(high);
    lookup(look, x).store(looked);
    U(b[i]).store(whole);
    (x & y).store(both);
    (x | y).store(either);
    const std::uint64_t less = less_bits(x, y);
    const std::uint64_t equal = equal_bits(x, y);
    if (U::lanes < 64) CHECK(((less | equal) >> (U::lanes % 64)) == 0);
    for (int k = 0; k < U::lanes; ++k) {
      const std::size_t at = i + static_cast<std::size_t>(k);
      CHECK(low[k] == std::min(a[at], b[at]));
      CHECK(high[k] == std::max(a[at], b[at]));
      CHECK(looked[k] == table[std::min<std::uint8_t>(a[at], 63)]);
      CHECK(whole[k] == b[i]);
      CHECK((less >> k & 1U) == (a[at] < b[at] ? 1U : 0U));
      CHECK((equal >> k & 1U) == (a[at] == b[at] ? 1U : 0U));
      CHECK(both[k] == (a[at] & b[at]));
      CHECK(either[k] == (a[at] | b[at]));
    }
    const std::uint64_t bits = random.next_u32() | std::uint64_t{random.next_u32()} << 32;
    U::from_bits(bits).store(whole);
    for (int k = 0; k < U::lanes; ++k) CHECK(whole[k] == (bits >> k & 1U));
    U::from_bits(bits, b[i]).store(whole);
    for (int k = 0; k < U::lanes; ++k) CHECK(whole[k] == ((bits >> k & 1U) != 0 ? b[i] : 0));
  }
  for (int n = 0; n <= U::lanes; ++n) {
    std::uint8_t out[U::lanes + 1];
    U::load(a.data() + 7, n).store(out);
    for (int k = 0; k < U::lanes; ++k) CHECK(out[k] == (k < n ? a[static_cast<std::size_t>(k + 7)] : 0));
    std::fill(out, out + U::lanes + 1, std::uint8_t{9});
    U::load(a.data()).store(out, n);
    for (int k = 0; k <= U::lanes; ++k) CHECK(out[k] == (k < n ? a[static_cast<std::size_t>(k)] : 9));
  }
}

template <class F, int K>
void check_slide() {
  float in[2 * F::lanes];
  float out[F::lanes];
  for (int i = 0; i < 2 * F::lanes; ++i) in[i] = static_cast<float>(i);
  simd::slide<K>(F::load(in), F::load(in + F::lanes)).store(out);
  for (int i = 0; i < F::lanes; ++i) CHECK(out[i] == static_cast<float>(i + K));
  if constexpr (K < F::lanes) check_slide<F, K + 1>();
}

}  // namespace

TEST_CASE("batches of bytes compute what loops do") {
  check_bytes<simd::U8>();
  check_bytes<simd::scalar::U8>();
}

TEST_CASE("slide takes neighbours from the next batch, at every distance") {
  check_slide<simd::F32, 1>();
  check_slide<simd::scalar::F32, 1>();
}
