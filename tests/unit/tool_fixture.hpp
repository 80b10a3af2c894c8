// SPDX-License-Identifier: Apache-2.0
// What the tests of the npsim program share: running it, a small street, and the look of a refusal.
#ifndef NPSIM_TESTS_UNIT_TOOL_FIXTURE_HPP
#define NPSIM_TESTS_UNIT_TOOL_FIXTURE_HPP

#include <doctest/doctest.h>

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "npsim/core/image_view.hpp"
#include "npsim/io/error.hpp"

namespace tool_test {

namespace fs = std::filesystem;

struct Run {
  int status = -1;
  std::string output;  // both streams
};

inline Run run_program(const std::string& program, const std::string& arguments) {
  Run run;
  const std::string command = "'" + program + "' " + arguments + " 2>&1";
  std::FILE* pipe = popen(command.c_str(), "r");
  REQUIRE(pipe != nullptr);
  std::array<char, 4096> buffer{};
  for (std::size_t n = 0; (n = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0;)
    run.output.append(buffer.data(), n);
  const int status = pclose(pipe);
  run.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return run;
}

inline Run run_tool(const std::string& arguments) { return run_program(NPSIM_TOOL, arguments); }

inline std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

inline nlohmann::json json_of(const fs::path& path) { return nlohmann::json::parse(bytes_of(path)); }
inline void write_json(const fs::path& path, const nlohmann::json& json) { std::ofstream(path) << json; }

// What was read, of a file that must be there.
template <class T>
T value_of(npsim::io::Expected<T> read) {
  REQUIRE(read.ok());
  return std::move(read.value());
}

inline std::string size_of(npsim::Shape shape) {
  return std::to_string(shape.width) + "x" + std::to_string(shape.height);
}

// The size of the small street that all cases share.
constexpr npsim::Shape kStreet{160, 90};

// That street, and a folder for what the cases write; both go at the end.
struct Fixture {
  fs::path root = fs::temp_directory_path() / ("npsim_tool_test_" + std::to_string(getpid()));
  std::string street = (root / "street").string();

  Fixture() {
    const Run made = run_tool("street '" + street + "' --seed 1 --size " + size_of(kStreet) + " --quiet");
    REQUIRE_MESSAGE(made.status == 0, made.output);
  }
  ~Fixture() { fs::remove_all(root); }
  [[nodiscard]] std::string out(const std::string& name) const { return (root / name).string(); }
  // A copy of the street's folder in which one file is then spoilt.
  [[nodiscard]] std::string copy(const std::string& name) const {
    fs::copy(street, root / name, fs::copy_options::recursive);
    return out(name);
  }
};

inline Fixture& fixture() {
  static Fixture shared;
  return shared;
}

inline std::size_t line_count(const std::string& text) {
  std::size_t lines = 0;
  for (const char c : text) lines += c == '\n' ? 1U : 0U;
  return lines;
}

inline bool has_files(const fs::path& folder) {
  if (!fs::exists(folder)) return false;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) return true;
  }
  return false;
}

// Refused as input: status 2, one line that names what it is about, and no file written.
inline void check_refused(const Run& run, const std::string& mentions, const std::string& output = "") {
  CHECK_MESSAGE(run.status == 2, run.output);
  CHECK_MESSAGE(line_count(run.output) == 1, run.output);
  CHECK_MESSAGE(run.output.find(mentions) != std::string::npos, run.output);
  if (!output.empty()) CHECK(!has_files(output));
}

}  // namespace tool_test

#endif  // NPSIM_TESTS_UNIT_TOOL_FIXTURE_HPP
