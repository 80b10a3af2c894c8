// SPDX-License-Identifier: Apache-2.0
// A whole file as bytes, and the fence that keeps exceptions inside io/.
//
// Memory: the size of the file, refused above the byte limit before anything is allocated.
#ifndef NPSIM_IO_DETAIL_FILE_BYTES_HPP
#define NPSIM_IO_DETAIL_FILE_BYTES_HPP

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <memory>
#include <new>
#include <string>
#include <system_error>
#include <vector>

#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

using Bytes = std::vector<unsigned char>;

// The lowest `bytes` of a number, the lowest first.
inline void append_little(Bytes& out, std::uint64_t value, std::size_t bytes) {
  for (std::size_t i = 0; i < bytes; ++i) out.push_back(static_cast<unsigned char>(value >> (8 * i)));
}

// Runs f, which returns an Expected, and turns what it throws (no memory, a fault in a file system) into an Error.
template <class F>
auto guarded(const std::string& path, F&& f) -> decltype(f()) {
  try {
    return f();
  } catch (const std::bad_alloc&) {
    return Error{path, "", "does not fit into memory: expected more free memory or a smaller file"};
  } catch (const std::exception& caught) {
    return Error{path, "", std::string("cannot be processed: ") + caught.what()};
  }
}

inline Expected<Bytes> read_file_bytes(const std::string& path, const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<Bytes> {
    std::error_code code;
    const std::filesystem::file_status status = std::filesystem::status(path, code);
    if (!std::filesystem::exists(status)) return Error{path, "", "does not exist: expected a file"};
    if (std::filesystem::is_directory(status)) return Error{path, "", "is a folder: expected a file"};
    if (!std::filesystem::is_regular_file(status)) return Error{path, "", "is not a regular file: expected a file"};
    const std::uintmax_t size = std::filesystem::file_size(path, code);
    if (code) return Error{path, "", "has no readable size: expected a readable file"};
    if (size == 0) return Error{path, "", "is empty: expected a file with content"};
    if (size > limits.max_bytes) {
      return Error{path, "file size",
                   std::to_string(size) + " bytes, expected at most " + std::to_string(limits.max_bytes)};
    }
    struct Close {
      void operator()(std::FILE* f) const { std::fclose(f); }
    };
    const std::unique_ptr<std::FILE, Close> file(std::fopen(path.c_str(), "rb"));
    if (file == nullptr) return Error{path, "", "cannot be opened: expected a readable file"};
    Bytes bytes(static_cast<std::size_t>(size));
    if (std::fread(bytes.data(), 1, bytes.size(), file.get()) != bytes.size()) {
      return Error{path, "", "could not be read to its end: expected " + std::to_string(size) + " bytes"};
    }
    return bytes;
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_FILE_BYTES_HPP
