// SPDX-License-Identifier: Apache-2.0
// The header of an NPY file: a Python dictionary with the keys descr, fortran_order and shape, each exactly once.
//
// A small parser over a bounded text (at most 64 KiB): quoted keys, then a quoted string, True or False, or a tuple of
// whole numbers. Anything else is an error with the key it stood at.
#ifndef NPSIM_IO_DETAIL_NPY_HEADER_HPP
#define NPSIM_IO_DETAIL_NPY_HEADER_HPP

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "npsim/core/image_view.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

inline constexpr unsigned char kNpyMagic[6] = {0x93, 'N', 'U', 'M', 'P', 'Y'};

enum class NpyType : std::uint8_t { f4, f8, u1, u2, i4 };

struct NpyHeader {
  NpyType type = NpyType::f4;
  Shape shape;
  int channels = 1;
  std::string shape_text;   // as in the file
  std::size_t data_at = 0;  // byte
};

class NpyText {
 public:
  explicit NpyText(const std::string& text) : text_(text) {}

  // True and consumed when the next character that is no white space is c.
  bool take(char c) {
    skip();
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  bool take_word(const char* word) {
    skip();
    const std::size_t n = std::strlen(word);
    if (text_.compare(at_, n, word) != 0) return false;
    at_ += n;
    return true;
  }
  // A string in single or double quotes, without escapes.
  bool take_string(std::string& out) {
    skip();
    if (at_ >= text_.size() || (text_[at_] != '\'' && text_[at_] != '"')) return false;
    const std::size_t end = text_.find(text_[at_], at_ + 1);
    if (end == std::string::npos) return false;
    out = text_.substr(at_ + 1, end - at_ - 1);
    at_ = end + 1;
    return true;
  }
  bool take_number(std::int64_t& out) {
    skip();
    std::size_t digits = 0;
    out = 0;
    while (at_ < text_.size() && text_[at_] >= '0' && text_[at_] <= '9' && digits < 18) {
      out = out * 10 + (text_[at_++] - '0');
      ++digits;
    }
    if (at_ < text_.size() && text_[at_] == 'L') ++at_;  // written by Python 2
    return digits > 0 && digits < 18;
  }
  bool take_tuple(std::vector<std::int64_t>& out) {
    if (!take('(')) return false;
    while (!take(')')) {
      std::int64_t number = 0;
      if (out.size() >= 32 || !take_number(number)) return false;
      out.push_back(number);
      if (!take(',')) return take(')');
    }
    return true;
  }
  bool at_end() {
    skip();
    return at_ == text_.size();
  }

 private:
  void skip() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n' || text_[at_] == '\t')) ++at_;
  }
  const std::string& text_;
  std::size_t at_ = 0;
};

inline Expected<NpyHeader> npy_header(const std::string& path, const Bytes& b, const ReadLimits& limits) {
  if (b.size() < 10 || std::memcmp(b.data(), kNpyMagic, 6) != 0) {
    return Error{path, "magic", "is not that of an NPY file, expected \\x93NUMPY and a header"};
  }
  const int version = b[6];
  if (version < 1 || version > 3) {
    return Error{path, "version", "is " + std::to_string(version) + ", expected 1, 2 or 3"};
  }
  const std::size_t text_at = version == 1 ? 10 : 12;
  if (b.size() < text_at) return Error{path, "header", "is cut off, expected its length"};
  std::size_t length = b[8] + std::size_t{256} * b[9];
  if (version > 1) length += std::size_t{65536} * b[10] + std::size_t{16777216} * b[11];
  if (length > 65536 || length > b.size() - text_at) {
    return Error{path, "header",
                 "claims " + std::to_string(length) + " bytes, expected at most 65536 and inside the file"};
  }
  const std::string text(reinterpret_cast<const char*>(b.data() + text_at), length);

  NpyText in(text);
  std::string descr;
  std::vector<std::int64_t> sides;
  int fortran = -1;
  int shapes = 0;
  if (!in.take('{')) return Error{path, "header", "is no dictionary, expected {'descr': ..., ...}"};
  bool closed = in.take('}');
  while (!closed) {
    std::string key;
    if (!in.take_string(key) || !in.take(':')) return Error{path, "header", "is malformed, expected 'key': value"};
    bool good = false;
    if (key == "descr") {
      good = descr.empty() && in.take_string(descr) && !descr.empty();
    } else if (key == "fortran_order") {
      const bool yes = in.take_word("True");
      good = fortran < 0 && (yes || in.take_word("False"));
      fortran = yes ? 1 : 0;
    } else if (key == "shape") {
      good = ++shapes == 1 && in.take_tuple(sides);
    } else {
      return Error{path, "'" + key + "'", "is no key of NPY, expected descr, fortran_order and shape"};
    }
    if (!good) return Error{path, key, "has a value of another kind, expected a plain array's description"};
    const bool comma = in.take(',');
    closed = in.take('}');
    if (!comma && !closed) return Error{path, key, "is followed by something else, expected , or }"};
  }
  if (!in.at_end()) return Error{path, "header", "goes on after its dictionary, expected spaces"};
  if (descr.empty() || fortran < 0 || shapes == 0) {
    return Error{path, "header", "lacks a key, expected descr, fortran_order and shape"};
  }
  if (fortran == 1)
    return Error{path, "fortran_order", "is True, expected False (numpy.ascontiguousarray before saving)"};

  NpyHeader header;
  std::size_t element_bytes = 0;
  if (descr == "<f4") {
    header.type = NpyType::f4;
    element_bytes = 4;
  } else if (descr == "<f8") {
    header.type = NpyType::f8;
    element_bytes = 8;
  } else if (descr == "|u1" || descr == "<u1") {
    header.type = NpyType::u1;
    element_bytes = 1;
  } else if (descr == "<u2") {
    header.type = NpyType::u2;
    element_bytes = 2;
  } else if (descr == "<i4") {
    header.type = NpyType::i4;
    element_bytes = 4;
  } else
    return Error{path, "descr", "is '" + descr + "', expected <f4, <f8, |u1, <u2 or <i4"};

  header.shape_text = "(";
  for (std::size_t i = 0; i < sides.size(); ++i) header.shape_text += (i > 0 ? ", " : "") + std::to_string(sides[i]);
  header.shape_text += ")";
  const bool plane = sides.size() == 2 || (sides.size() == 3 && (sides[2] == 1 || sides[2] == 3));
  if (!plane) return Error{path, "shape", header.shape_text + ", expected (height, width) or (height, width, 3)"};
  header.channels = sides.size() == 3 ? static_cast<int>(sides[2]) : 1;
  header.data_at = text_at + length;
  const std::size_t pixel_bytes = static_cast<std::size_t>(header.channels) * (element_bytes > 4 ? 8U : 4U);
  const Expected<Shape> shape = checked_shape(path, sides[1], sides[0], pixel_bytes, limits);
  if (!shape) return shape.error();
  header.shape = shape.value();
  const std::size_t expected = header.shape.pixels() * static_cast<std::size_t>(header.channels) * element_bytes;
  const std::size_t found = b.size() - header.data_at;
  if (found != expected) {
    return Error{path, "data",
                 std::to_string(found) + " bytes, expected " + std::to_string(expected) + " for shape " +
                     header.shape_text + " of " + descr};
  }
  return header;
}

}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_NPY_HEADER_HPP
