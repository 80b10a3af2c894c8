// SPDX-License-Identifier: Apache-2.0
// What the commands have in common: exit statuses, sizes, threads, output folders, error lines.
#ifndef NPSIM_SAMPLES_TOOL_OPTIONS_HPP
#define NPSIM_SAMPLES_TOOL_OPTIONS_HPP

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>
#include <thread>

#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/io/error.hpp"

namespace npsim::tool {

inline constexpr int kExitDone = 0;
inline constexpr int kExitFailed = 1;
inline constexpr int kExitBadInput = 2;
inline constexpr int kExitInterrupted = 130;

// "960x540" to a shape with both sides in 1..16384.
[[nodiscard]] inline io::Expected<Shape> parse_size(const std::string& text, const char* option = "--size") {
  Shape shape;
  const char* end = text.data() + text.size();
  const auto [after_width, width_error] = std::from_chars(text.data(), end, shape.width);
  const bool separated =
      width_error == std::errc() && after_width != end && (*after_width == 'x' || *after_width == 'X');
  if (separated) {
    const auto [after_height, height_error] = std::from_chars(after_width + 1, end, shape.height);
    const bool in_range = shape.width >= 1 && shape.height >= 1 && shape.width <= 16384 && shape.height <= 16384;
    if (height_error == std::errc() && after_height == end && in_range) return shape;
  }
  return io::Error{"", option, "expected WIDTHxHEIGHT with sides of 1 to 16384 pixels, got '" + text + "'"};
}

[[nodiscard]] inline unsigned thread_count(int requested) {
  return requested > 0 ? static_cast<unsigned>(requested) : std::max(1U, std::thread::hardware_concurrency());
}

[[nodiscard]] inline io::Outcome make_folder(const std::string& path) {
  std::error_code code;
  std::filesystem::create_directories(path, code);
  if (std::filesystem::is_directory(path, code)) return io::Done{};
  return io::Error{path, "", "expected a folder or a place where one can be made"};
}

// Before anything is computed, so that a folder that cannot be made is told at once.
[[nodiscard]] inline io::Outcome make_folder_of(const std::string& file) {
  const std::filesystem::path folder = std::filesystem::path(file).parent_path();
  return folder.empty() ? io::Done{} : make_folder(folder.string());
}

inline int fail(const io::Error& error) {
  std::fprintf(stderr, "npsim: %s\n", error.line().c_str());
  return kExitBadInput;
}

inline int fail(const std::string& what, const Status& status) {
  if (status.code() == StatusCode::cancelled) {
    std::fprintf(stderr, "npsim: interrupted; files written so far are complete\n");
    return kExitInterrupted;
  }
  std::fprintf(stderr, "npsim: %s: %s: %s\n", what.c_str(), status_code_name(status.code()), status.message());
  const bool input = status.code() == StatusCode::no_valid_input || status.code() == StatusCode::shape_mismatch ||
                     status.code() == StatusCode::invalid_argument;
  return input ? kExitBadInput : kExitFailed;
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_OPTIONS_HPP
