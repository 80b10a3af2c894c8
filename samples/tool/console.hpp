// SPDX-License-Identifier: Apache-2.0
// Progress and cancellation for a person: a bar on a terminal, one plain line per stage elsewhere.
//
// Satisfies the observer concept of core/observe.hpp and keeps the wall time of each stage for the report.
#ifndef NPSIM_SAMPLES_TOOL_CONSOLE_HPP
#define NPSIM_SAMPLES_TOOL_CONSOLE_HPP

#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstddef>
#include <cstdio>
#include <mutex>
#include <string>
#include <vector>

#include "any.hpp"
#include "npsim/core/observe.hpp"

namespace npsim::tool {

// Set by SIGINT, SIGTERM and SIGHUP; polled by the stages, which then return StatusCode::cancelled.
inline std::atomic<bool> interrupted{false};

inline void watch_for_interrupt() {
  const auto handler = [](int) { interrupted.store(true, std::memory_order_relaxed); };
  std::signal(SIGINT, handler);
  std::signal(SIGTERM, handler);
  std::signal(SIGHUP, handler);
  // Too large a file and a closed pipe are for the write that meets them to report.
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
}

// Begins nothing any more once the user has interrupted; what is left is undone.
struct InterruptibleExecutor {
  AnyExecutor executor;

  template <class F>
  void for_chunks(std::size_t count, std::size_t chunk, F&& f) const {
    executor.for_chunks(count, chunk, [&](std::size_t begin, std::size_t end) {
      if (!interrupted.load(std::memory_order_relaxed)) f(begin, end);
    });
  }
};

struct StageTime {
  std::string name;
  double seconds = 0;
  int calls = 0;
};

class Console {
 public:
  explicit Console(bool quiet) : quiet_(quiet), terminal_(isatty(STDERR_FILENO) != 0) {}

  void begin(Stage stage) { begin(std::string(stage_name(stage))); }
  void begin(const std::string& name) {
    const std::lock_guard<std::mutex> lock(mutex_);
    name_ = name;
    started_ = drawn_ = Clock::now();
    if (!quiet_ && terminal_) draw(0, 1);
  }
  void progress(std::size_t done, std::size_t total) {
    if (quiet_ || !terminal_) return;
    const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock() || Clock::now() - drawn_ < std::chrono::milliseconds(100)) return;
    drawn_ = Clock::now();
    draw(done, total);
  }
  void end(Stage stage) { end(std::string(stage_name(stage))); }
  void end(const std::string& name) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const double seconds = std::chrono::duration<double>(Clock::now() - started_).count();
    StageTime* entry = nullptr;
    for (StageTime& s : times_) {
      if (s.name == name) entry = &s;
    }
    if (entry == nullptr) {
      times_.push_back({name, 0, 0});
      entry = &times_.back();
    }
    entry->seconds += seconds;
    ++entry->calls;
    if (quiet_) return;
    std::fprintf(stderr, terminal_ ? "\r\033[K  %-26s %8.2f s\n" : "  %-26s %8.2f s\n", name.c_str(), seconds);
  }
  void depth(Stage, const ImageView<const float>&) const {}
  void daylight(const ImageView<const Vec3f>&, const ImageView<const float>&, const DaylightReport&) const {}
  [[nodiscard]] bool cancelled() const { return interrupted.load(std::memory_order_relaxed); }
  [[nodiscard]] const std::vector<StageTime>& times() const { return times_; }

  // Runs f between begin and end; for steps of the tool itself, such as reading and writing.
  template <class F>
  auto timed(const char* name, F&& f) {
    begin(std::string(name));
    auto result = f();
    end(std::string(name));
    return result;
  }

 private:
  using Clock = std::chrono::steady_clock;

  void draw(std::size_t done, std::size_t total) {
    constexpr int kWidth = 30;
    const double share = total == 0 ? 0.0 : static_cast<double>(done) / static_cast<double>(total);
    const int filled = static_cast<int>(share * kWidth);
    std::string bar(static_cast<std::size_t>(kWidth), '.');
    for (int i = 0; i < filled && i < kWidth; ++i) bar[static_cast<std::size_t>(i)] = '#';
    std::fprintf(stderr, "\r\033[K  %-26s [%s] %3d %%", name_.c_str(), bar.c_str(), static_cast<int>(share * 100));
    std::fflush(stderr);
  }

  std::mutex mutex_;
  std::string name_;
  Clock::time_point started_;
  Clock::time_point drawn_;
  std::vector<StageTime> times_;
  bool quiet_;
  bool terminal_;
};

// Passes on what the console shows; for observers that keep something of what a run shows them.
class ConsoleObserver : public NullObserver {
 public:
  explicit ConsoleObserver(Console& console) : console_(console) {}
  void begin(Stage stage) { console_.begin(stage); }
  void progress(std::size_t done, std::size_t total) { console_.progress(done, total); }
  void end(Stage stage) { console_.end(stage); }
  [[nodiscard]] bool cancelled() const { return console_.cancelled(); }

 private:
  Console& console_;
};

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_CONSOLE_HPP
