// SPDX-License-Identifier: Apache-2.0
// What one kernel's case hands over: contenders to run, with the errors they make; and the lines of the table.
//
// Every contender does the same work or the nearest to it that it can; what it leaves out stands in its setting.
#ifndef NPSIM_BENCH_FRONTIER_COMPARISON_HPP
#define NPSIM_BENCH_FRONTIER_COMPARISON_HPP

#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "npsim/core/image_view.hpp"

namespace npsim::bench {

inline constexpr double kNone = std::numeric_limits<double>::quiet_NaN();  // not measured, or does not apply

struct Options {
  Shape shape{1920, 1080};
  int repeats = 5;
  bool quick = false;              // smaller samples for the errors, one repeat
  std::vector<std::string> peers;  // run only peers whose name contains one of these; empty: all
};

struct Error {
  double max = kNone;
  double rms = kNone;
  std::string unit;
};

struct Contender {
  std::string method;
  std::string setting;
  bool peer = false;
  std::string group;                          // set against the peers of the same group and against those of none
  bool from_memory = false;                   // caches are emptied before each run, and each sample is one run
  std::function<void()> run;                  // empty: not built, or time_ms is known already
  std::function<std::vector<Error>()> judge;  // what run() left, against double precision; may be empty
  std::vector<Error> errors;                  // the first is the one in the picture
  std::string label;                          // in the picture; empty: method and setting
  double time_ms = kNone;
  std::string absent;  // why a peer is not there: "peer not built: opencv ximgproc"
};

// Contenders in the order in which they run; the first peer is the one that all are set against.
struct Comparison {
  std::string kernel;
  std::string title;  // of the picture
  Shape shape;
  std::vector<Contender> contenders;

  Contender& add(std::string method, std::string setting, std::function<void()> run) {
    Contender c;
    c.method = std::move(method);
    c.setting = std::move(setting);
    c.run = std::move(run);
    contenders.push_back(std::move(c));
    return contenders.back();
  }
  Contender& add_peer(std::string method, std::string setting, std::function<void()> run) {
    Contender& c = add(std::move(method), std::move(setting), std::move(run));
    c.peer = true;
    return c;
  }
  // Named once, however many of its settings are missing.
  void add_absent(const std::string& what) {
    Contender c;
    c.peer = true;
    c.absent = "peer not built: " + what;
    for (const Contender& other : contenders) {
      if (other.absent == c.absent) return;
    }
    contenders.push_back(std::move(c));
  }
};

// One line of the CSV. NaN is an empty field. ratio = peer_time_ms / time_ms: above 1, the method is faster.
struct Line {
  std::string kernel, method, setting;
  Shape shape;
  double time_ms = kNone;
  std::string peer;
  double peer_time_ms = kNone;
  double ratio = kNone;
  Error error;
};

// Fills in time_ms and errors of every contender that can run. Interleaved: all run once, then all again, `repeats`
// times, and the median counts. Below 100 ms each sample follows an untimed run of the same contender, so that all find
// what they touch in the same caches, and is the mean of as many runs as take 10 ms. Above 3 s a peer runs once.
void measure(const Options& options, Comparison& comparison);

[[nodiscard]] std::vector<Line> lines_of(const Comparison& comparison);

// True if the peer is wanted by --peer.
[[nodiscard]] bool wanted(const Options& options, const std::string& peer);

// Running maximum and root mean square of what differs.
class ErrorSum {
 public:
  void add(double difference) {
    const double d = std::fabs(difference);
    if (!(d <= max_)) max_ = d;  // a NaN stays
    sum_ += d * d;
    ++count_;
  }
  [[nodiscard]] Error error(std::string unit) const {
    return {max_, count_ == 0 ? kNone : std::sqrt(sum_ / static_cast<double>(count_)), std::move(unit)};
  }

 private:
  double max_ = 0;
  double sum_ = 0;
  long long count_ = 0;
};

}  // namespace npsim::bench

#endif  // NPSIM_BENCH_FRONTIER_COMPARISON_HPP
