// SPDX-License-Identifier: Apache-2.0
// Status and Result: how every kernel reports failure, with exceptions on or off.
//
// A Status is one enum and one pointer to a string of static storage: trivially copyable, no heap.
// Invariant: ok() holds exactly when code() == StatusCode::ok; a message is never null.
#ifndef NPSIM_CORE_STATUS_HPP
#define NPSIM_CORE_STATUS_HPP

#include <cstdint>
#include <type_traits>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

enum class StatusCode : std::uint8_t {
  ok,
  invalid_argument,     // a parameter lies outside its stated range
  shape_mismatch,       // two views that must agree in size do not
  workspace_exhausted,  // the caller's workspace is smaller than workspace_bytes() said
  no_valid_input,       // nothing to compute from: no valid depth, no vertex, no pixel
  not_finite,           // a NaN or an infinity where the contract excludes them, or a divergent step
  capacity_exceeded,    // an output or index does not fit its type or its buffer
  cancelled,            // the observer asked to stop
};

[[nodiscard]] constexpr const char* status_code_name(StatusCode code) noexcept {
  switch (code) {
    case StatusCode::ok: return "ok";
    case StatusCode::invalid_argument: return "invalid argument";
    case StatusCode::shape_mismatch: return "shape mismatch";
    case StatusCode::workspace_exhausted: return "workspace exhausted";
    case StatusCode::no_valid_input: return "no valid input";
    case StatusCode::not_finite: return "not finite";
    case StatusCode::capacity_exceeded: return "capacity exceeded";
    case StatusCode::cancelled: return "cancelled";
  }
  return "unknown";
}

class [[nodiscard]] Status {
 public:
  constexpr Status() noexcept = default;
  // `message` must have static storage duration (a string literal).
  constexpr Status(StatusCode code, const char* message) noexcept
      : message_(message == nullptr ? "" : message), code_(code) {}

  [[nodiscard]] constexpr bool ok() const noexcept { return code_ == StatusCode::ok; }
  [[nodiscard]] constexpr StatusCode code() const noexcept { return code_; }
  [[nodiscard]] constexpr const char* message() const noexcept { return message_; }
  constexpr explicit operator bool() const noexcept { return ok(); }

 private:
  const char* message_ = "";
  StatusCode code_ = StatusCode::ok;
};

// A value or the Status that explains its absence. T is trivially copyable and default constructible, so that the
// type works without exceptions and inside caller-owned memory.
template <class T>
class [[nodiscard]] Result {
  static_assert(std::is_trivially_copyable_v<T>, "Result holds trivially copyable values");

 public:
  constexpr Result(const T& value) noexcept : value_(value) {}       // NOLINT(google-explicit-constructor)
  constexpr Result(const Status& status) noexcept : status_(status) {}  // NOLINT(google-explicit-constructor)

  [[nodiscard]] constexpr bool ok() const noexcept { return status_.ok(); }
  [[nodiscard]] constexpr const Status& status() const noexcept { return status_; }
  // Meaningful only when ok(); a value-initialised T otherwise.
  [[nodiscard]] constexpr const T& value() const noexcept { return value_; }
  [[nodiscard]] constexpr T value_or(const T& other) const noexcept { return ok() ? value_ : other; }
  constexpr explicit operator bool() const noexcept { return ok(); }

 private:
  T value_{};
  Status status_{};
};

}  // namespace NPSIM_ABI
}  // namespace npsim

// Returns early from a function that itself returns Status (or Result).
#define NPSIM_RETURN_IF_ERROR(expression)                         \
  do {                                                            \
    const ::npsim::Status npsim_status_ = (expression);           \
    if (!npsim_status_.ok()) return npsim_status_;                \
  } while (false)

#endif  // NPSIM_CORE_STATUS_HPP
