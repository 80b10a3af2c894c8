// SPDX-License-Identifier: Apache-2.0
// How readers and writers fail: with one line that names the file, the field and what was expected.
#ifndef NPSIM_IO_ERROR_HPP
#define NPSIM_IO_ERROR_HPP

#include <optional>
#include <string>
#include <utility>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

struct Error {
  std::string file;     // path as the caller gave it
  std::string field;    // key, header field, pixel or element; may be empty
  std::string problem;  // what was found and what was expected

  [[nodiscard]] std::string line() const {
    std::string text = file.empty() ? std::string() : file + ": ";
    if (!field.empty()) text += field + ": ";
    text += problem;
    for (char& c : text) {  // names come from files: whatever they hold, this stays one line
      if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = ' ';
    }
    return text;
  }
};

// A value or an Error.
template <class T>
class [[nodiscard]] Expected {
 public:
  Expected(T value) : value_(std::move(value)) {}      // NOLINT(google-explicit-constructor)
  Expected(Error error) : error_(std::move(error)) {}  // NOLINT(google-explicit-constructor)

  [[nodiscard]] bool ok() const { return value_.has_value(); }
  explicit operator bool() const { return ok(); }
  [[nodiscard]] T& value() { return *value_; }
  [[nodiscard]] const T& value() const { return *value_; }
  [[nodiscard]] const Error& error() const { return error_; }

 private:
  std::optional<T> value_;
  Error error_;
};

// Success of an action that yields nothing.
struct Done {};
using Outcome = Expected<Done>;

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_ERROR_HPP
