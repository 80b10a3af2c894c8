// SPDX-License-Identifier: Apache-2.0
// The batch that the losses are evaluated in: simd::F32 for float; for double, where gradients are checked, one value
// with the part of the batch interface that they use.
#ifndef NPSIM_DEPTH_DETAIL_REFINE_LOSS_BATCH_HPP
#define NPSIM_DEPTH_DETAIL_REFINE_LOSS_BATCH_HPP

#include <cmath>
#include <type_traits>

#include "npsim/core/config.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

// clang-format off
struct F64 {
  static constexpr int lanes = 1;
  using Int = simd::scalar::I32;
  using MaskType = simd::scalar::Mask;

  F64() = default;
  F64(double x) noexcept : value(x) {}  // NOLINT(google-explicit-constructor)
  [[nodiscard]] static F64 load(const double* p) noexcept { return *p; }
  [[nodiscard]] static F64 load(const double* p, int n) noexcept { return n > 0 ? *p : 0.0; }
  [[nodiscard]] static F64 gather(const double* base, Int index) noexcept { return base[index.value]; }
  [[nodiscard]] static F64 iota() noexcept { return 0.0; }
  void store(double* p) const noexcept { *p = value; }
  [[nodiscard]] double lane(int) const noexcept { return value; }
  friend F64 operator+(F64 a, F64 b) noexcept { return a.value + b.value; }
  friend F64 operator-(F64 a, F64 b) noexcept { return a.value - b.value; }
  friend F64 operator*(F64 a, F64 b) noexcept { return a.value * b.value; }
  friend F64 operator/(F64 a, F64 b) noexcept { return a.value / b.value; }
  friend F64 operator-(F64 a) noexcept { return -a.value; }
  friend MaskType operator>(F64 a, F64 b) noexcept { return a.value > b.value; }
  friend MaskType operator>=(F64 a, F64 b) noexcept { return a.value >= b.value; }
  friend MaskType operator<=(F64 a, F64 b) noexcept { return a.value <= b.value; }
  [[nodiscard]] friend F64 fma(F64 a, F64 b, F64 c) noexcept { return a.value * b.value + c.value; }
  [[nodiscard]] friend F64 abs(F64 a) noexcept { return std::fabs(a.value); }
  [[nodiscard]] friend F64 min(F64 a, F64 b) noexcept { return a.value < b.value ? a : b; }
  [[nodiscard]] friend F64 max(F64 a, F64 b) noexcept { return a.value > b.value ? a : b; }
  [[nodiscard]] friend F64 sqrt(F64 a) noexcept { return std::sqrt(a.value); }
  [[nodiscard]] friend F64 select(MaskType m, F64 a, F64 b) noexcept { return m.value ? a : b; }
  [[nodiscard]] friend F64 slide_up(F64 previous, F64) noexcept { return previous; }

  double value;
};
// clang-format on

template <class T>
using LossBatch = std::conditional_t<std::is_same_v<T, double>, F64, simd::F32>;

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_REFINE_LOSS_BATCH_HPP
