// SPDX-License-Identifier: Apache-2.0
// The command line of a benchmark, alike in all of them: --help shows what there is; what is not understood is named on
// stderr and ends the program with exit status 2.
#ifndef NPSIM_BENCH_OPTIONS_HPP
#define NPSIM_BENCH_OPTIONS_HPP

#include <CLI/CLI.hpp>

#include <cstdio>
#include <optional>
#include <string>

#include "npsim/core/image_view.hpp"

namespace npsim::bench {

// The exit status where the program is to end: after --help, and after what is not understood.
[[nodiscard]] inline std::optional<int> parse(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : 2;
  }
  return std::nullopt;
}

// WIDTHxHEIGHT and nothing else.
[[nodiscard]] inline bool parse_size(const std::string& text, Shape& shape) {
  char rest = 0;
  return std::sscanf(text.c_str(), "%dx%d%c", &shape.width, &shape.height, &rest) == 2 && !shape.empty();
}

// For options that take one.
inline const CLI::Validator is_size(
    [](std::string& text) {
      Shape shape;
      return parse_size(text, shape) ? std::string() : "expected WIDTHxHEIGHT, got '" + text + "'";
    },
    "WIDTHxHEIGHT");

}  // namespace npsim::bench

#endif  // NPSIM_BENCH_OPTIONS_HPP
