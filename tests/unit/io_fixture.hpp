// SPDX-License-Identifier: Apache-2.0
// What the tests of io/ share: a folder that vanishes with the test, files in it, and the look of a proper error.
#ifndef NPSIM_TESTS_UNIT_IO_FIXTURE_HPP
#define NPSIM_TESTS_UNIT_IO_FIXTURE_HPP

#include <doctest/doctest.h>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <system_error>
#include <vector>

#include "npsim/io/error.hpp"

namespace io_test {

class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::random_device device;
    path_ = std::filesystem::temp_directory_path() /
            ("npsim_io_" + std::to_string(device()) + "_" + std::to_string(device()));
    std::filesystem::create_directories(path_);
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] std::string operator/(const std::string& name) const { return (path_ / name).string(); }
  [[nodiscard]] std::string path() const { return path_.string(); }
  [[nodiscard]] std::size_t files() const {
    std::size_t count = 0;
    for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(path_)) ++count;
    return count;
  }

 private:
  std::filesystem::path path_;
};

inline std::string contents(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), {});
}

inline void put(const std::string& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

// The first of what stands there, which must, in place of another.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  REQUIRE(at != std::string::npos);
  return text.replace(at, from.size(), to);
}

// An Error in one line that names the file and says what was expected, with the given words in it.
template <class T>
void check_error(const npsim::io::Expected<T>& result, const std::string& file, const std::string& words = "") {
  REQUIRE_FALSE(result.ok());
  const std::string line = result.error().line();
  INFO(line);
  CHECK(line.find(file) != std::string::npos);
  CHECK(line.find('\n') == std::string::npos);
  CHECK(line.find("expected") != std::string::npos);
  CHECK(line.find(words) != std::string::npos);
}

template <class T>
void require_ok(const npsim::io::Expected<T>& result) {
  INFO((result.ok() ? std::string() : result.error().line()));
  REQUIRE(result.ok());
}

}  // namespace io_test

#endif  // NPSIM_TESTS_UNIT_IO_FIXTURE_HPP
