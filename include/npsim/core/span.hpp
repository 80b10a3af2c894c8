// SPDX-License-Identifier: Apache-2.0
// Span: a pointer and a length over memory that somebody else owns (std::span is C++20).
//
// Invariant: data() is valid for size() elements; indexing is unchecked, as in the kernels that use it.
#ifndef NPSIM_CORE_SPAN_HPP
#define NPSIM_CORE_SPAN_HPP

#include <cstddef>
#include <type_traits>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

template <class T>
class Span {
 public:
  using value_type = std::remove_cv_t<T>;

  constexpr Span() noexcept = default;
  constexpr Span(T* data, std::size_t size) noexcept : data_(data), size_(size) {}
  template <std::size_t N>
  constexpr Span(T (&array)[N]) noexcept : data_(array), size_(N) {}  // NOLINT(google-explicit-constructor)
  // Span<float> converts to Span<const float>.
  template <class U, std::enable_if_t<std::is_same_v<const U, T> && !std::is_same_v<U, T>, int> = 0>
  constexpr Span(const Span<U>& other) noexcept  // NOLINT(google-explicit-constructor)
      : data_(other.data()), size_(other.size()) {}

  [[nodiscard]] constexpr T* data() const noexcept { return data_; }
  [[nodiscard]] constexpr std::size_t size() const noexcept { return size_; }
  [[nodiscard]] constexpr bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] constexpr T& operator[](std::size_t i) const noexcept { return data_[i]; }
  [[nodiscard]] constexpr T* begin() const noexcept { return data_; }
  [[nodiscard]] constexpr T* end() const noexcept { return data_ + size_; }
  // The elements [first, first + count); the caller keeps the range inside the span.
  [[nodiscard]] constexpr Span sub(std::size_t first, std::size_t count) const noexcept {
    return Span(data_ + first, count);
  }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_SPAN_HPP
