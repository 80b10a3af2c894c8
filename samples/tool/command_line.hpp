// SPDX-License-Identifier: Apache-2.0
// The command line of npsim and npsim-lab: what their options have in common, and how a command is run.
#ifndef NPSIM_SAMPLES_TOOL_COMMAND_LINE_HPP
#define NPSIM_SAMPLES_TOOL_COMMAND_LINE_HPP

#include <CLI/CLI.hpp>

#include <charconv>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <optional>
#include <sstream>
#include <string>
#include <system_error>

#ifdef __GLIBC__
#include <malloc.h>
#endif

#include "console.hpp"
#include "npsim/core/config.hpp"
#include "options.hpp"

namespace npsim::tool {

inline constexpr const char* kStatuses =
    "Exit status: 0 done; 1 the run failed; 2 the input, an option or a place to write to is wrong (one line says "
    "which);\n"
    "130 interrupted. Files appear under their final names only when complete.";

// CLI11 itself takes -1 and numbers that do not fit for the largest seed.
[[nodiscard]] inline CLI::Validator whole_number() {
  return CLI::Validator(
      [](const std::string& text) {
        std::uint64_t value = 0;
        const char* end = text.data() + text.size();
        const auto [last, error] = std::from_chars(text.data(), end, value);
        return error == std::errc() && last == end ? std::string()
                                                   : "expected a whole number from 0 to 2^64 - 1, got " + text;
      },
      "UINT64");
}

// CLI::Range lets NaN pass.
[[nodiscard]] inline CLI::Validator within(double least, double most) {
  return CLI::Validator(
      [least, most](const std::string& text) {
        const char* begin = text.c_str();
        char* end = nullptr;
        const double value = std::strtod(begin, &end);
        if (end != begin && *end == '\0' && value >= least && value <= most) return std::string();
        std::ostringstream expected;
        expected << "expected a number from " << least << " to " << most << ", got " << text;
        return expected.str();
      },
      "FLOAT");
}

inline void add_seed(CLI::App* command, const char* name, std::uint64_t& seed, const char* about) {
  command->add_option(name, seed, about)->check(whole_number())->capture_default_str();
}

inline void add_threads(CLI::App* command, int& threads) {
  command->add_option("--threads", threads, "0 = one per processor")->check(CLI::Range(0, 1024))->capture_default_str();
}

inline void add_preset(CLI::App* command, std::string& preset, const char* about = "default or thesis, as for night") {
  command->add_option("--preset", preset, about)->check(CLI::IsMember({"default", "thesis"}))->capture_default_str();
}

// Before the first allocation that counts.
inline void tune_memory() {
#ifdef __GLIBC__
  // Else it grows with what is freed, images come from the heap, and what files were read into stays there as holes.
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
#endif
}

inline void prepare(CLI::App& app) {
  app.set_version_flag("--version", std::string("npsim ") + NPSIM_VERSION_STRING);
  app.require_subcommand(1);
  app.footer(kStatuses);
}

// An exit status where nothing is left to do: after help, and after a line about what is wrong.
[[nodiscard]] inline std::optional<int> parse(CLI::App& app, int argc, const char* const* argv) {
  try {
    app.parse(argc, argv);
    return std::nullopt;
  } catch (const CLI::CallForHelp& e) {
    return app.exit(e);
  } catch (const CLI::CallForAllHelp& e) {
    return app.exit(e);
  } catch (const CLI::CallForVersion& e) {
    return app.exit(e);
  } catch (const CLI::ParseError& e) {
    std::fprintf(stderr, "npsim: %s; see npsim --help\n", e.what());
    return kExitBadInput;
  }
}

// run() returns an exit status.
template <class Run>
[[nodiscard]] int interruptible(const Run& run) {
  watch_for_interrupt();
  try {
    return run();
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "npsim: out of memory; a smaller --size needs less\n");
    return kExitFailed;
  }
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_COMMAND_LINE_HPP
