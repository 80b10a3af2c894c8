// SPDX-License-Identifier: Apache-2.0
#include "comparison.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>

namespace npsim::bench {
namespace {

[[nodiscard]] double milliseconds(const std::function<void()>& run, int times) {
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < times; ++i) run();
  const std::chrono::duration<double, std::milli> spent = std::chrono::steady_clock::now() - start;
  return spent.count() / times;
}

[[nodiscard]] double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

// Reads and writes more than the caches of any machine at hand hold.
void empty_caches() {
  static std::vector<unsigned> other(std::size_t{64} << 20U);
  for (std::size_t i = 0; i < other.size(); i += 16) other[i] += 1;
}

}  // namespace

void measure(const Options& options, Comparison& comparison) {
  std::vector<Contender*> running;
  for (Contender& c : comparison.contenders) {
    if (c.run) running.push_back(&c);
  }
  std::vector<std::vector<double>> samples(running.size());
  for (int round = 0; round < options.repeats; ++round) {
    for (std::size_t i = 0; i < running.size(); ++i) {
      const Contender& c = *running[i];
      if (c.from_memory) {
        if (round == 0) c.run();
        empty_caches();
        samples[i].push_back(milliseconds(c.run, 1));
        continue;
      }
      const double last = samples[i].empty() ? milliseconds(c.run, 1) : samples[i].back();
      if (last > 3000 && c.peer) {
        if (samples[i].empty()) samples[i].push_back(last);
        continue;
      }
      int times = 1;
      if (last < 100) {
        times = static_cast<int>(std::clamp(10.0 / std::max(last, 1e-3), 1.0, 1000.0));
        if (!samples[i].empty()) c.run();  // the first round has just run it
      }
      samples[i].push_back(milliseconds(c.run, times));
    }
  }
  for (std::size_t i = 0; i < running.size(); ++i) {
    running[i]->time_ms = median(samples[i]);
    std::fprintf(stderr, "  %-44s %-40s %10.3f ms\n", running[i]->method.c_str(), running[i]->setting.c_str(),
                 running[i]->time_ms);
  }
  for (Contender* c : running) {
    if (c->judge) c->errors = c->judge();
  }
}

std::vector<Line> lines_of(const Comparison& comparison) {
  std::vector<Line> lines;
  const auto line = [&](const Contender& c, const Error& error, const Contender* peer) {
    Line l{comparison.kernel, c.method, c.setting, comparison.shape, c.time_ms, "", kNone, kNone, error};
    if (peer != nullptr) {
      l.peer = peer->absent.empty() ? peer->method + (peer->setting.empty() ? "" : ", " + peer->setting) : peer->absent;
      l.peer_time_ms = peer->time_ms;
      l.ratio = peer->time_ms / c.time_ms;
    }
    lines.push_back(l);
  };
  for (const Contender& c : comparison.contenders) {
    if (!c.absent.empty()) continue;
    std::vector<const Contender*> present;
    std::vector<const Contender*> absent;
    for (const Contender& p : comparison.contenders) {
      if (!p.peer || c.peer || !(p.group.empty() || p.group == c.group)) continue;
      if (p.absent.empty()) {
        present.push_back(&p);
      } else {
        absent.push_back(&p);
      }
    }
    std::vector<const Contender*> peers = present;
    peers.insert(peers.end(), absent.begin(), absent.end());
    const std::vector<Error> errors = c.errors.empty() ? std::vector<Error>(1) : c.errors;
    for (std::size_t e = 0; e < errors.size(); ++e) {
      if (peers.empty()) {
        line(c, errors[e], nullptr);
        continue;
      }
      // Further errors need not be set against every peer again.
      for (std::size_t p = 0; p < (e == 0 ? peers.size() : 1); ++p) line(c, errors[e], peers[p]);
    }
  }
  return lines;
}

bool wanted(const Options& options, const std::string& peer) {
  return options.peers.empty() || std::any_of(options.peers.begin(), options.peers.end(), [&](const std::string& part) {
           return peer.find(part) != std::string::npos;
         });
}

}  // namespace npsim::bench
