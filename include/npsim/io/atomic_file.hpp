// SPDX-License-Identifier: Apache-2.0
// Whole-file output: written to a temporary name in the same folder, flushed, then renamed over the target.
//
// The temporary is created under a name that did not exist, <target>.<number>.partial, so that two programs that write
// one file never share it: the last to finish wins, with a complete file.
// Invariant: under its final name a file is either absent, an old one, or complete. On failure the temporary is
// removed.
#ifndef NPSIM_IO_ATOMIC_FILE_HPP
#define NPSIM_IO_ATOMIC_FILE_HPP

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>

#include "npsim/io/error.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

inline Outcome write_file(const std::string& path, const void* data, std::size_t bytes) {
  std::error_code unknown;
  const std::filesystem::file_status target = std::filesystem::status(path, unknown);
  if (std::filesystem::exists(target) && !std::filesystem::is_regular_file(target)) {
    return Error{path, "", "is a folder, a device or a pipe: expected a file, or a name that is not taken"};
  }
  std::string temporary;
  std::FILE* file = nullptr;
  for (int number = 0; number < 1000 && file == nullptr; ++number) {
    temporary = path + "." + std::to_string(number) + ".partial";
    errno = 0;
    file = std::fopen(temporary.c_str(), "wbx");
    if (file == nullptr && errno != EEXIST) break;
  }
  if (file == nullptr) return Error{path, "", "cannot be opened for writing: expected a writable folder"};
  const bool written = bytes == 0 || std::fwrite(data, 1, bytes, file) == bytes;
  const bool closed = std::fclose(file) == 0;
  std::error_code code;
  if (written && closed) {
    std::filesystem::rename(temporary, path, code);
    if (!code) return Done{};
  }
  std::error_code ignored;
  std::filesystem::remove(temporary, ignored);
  return Error{path, "", "could not be written completely: expected free disk space and a writable folder"};
}

inline Outcome write_file(const std::string& path, const std::string& text) {
  return write_file(path, text.data(), text.size());
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_ATOMIC_FILE_HPP
