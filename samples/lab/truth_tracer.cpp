// SPDX-License-Identifier: Apache-2.0
// The tracing itself, apart from what reads files: it takes the time, so it is optimised.
#include <atomic>
#include <utility>
#include <vector>

#include "truth_night.hpp"

namespace npsim::tool {

bool TruthTracer::add(std::uint64_t last, TruthSums& sums, AnyExecutor executor, AnyObserver observer) const {
  std::vector<reference::PixelSums> next = sums.pixels;
  next.resize(night_.seen.size());
  std::atomic<bool> stopped{false};
  reference::add_samples(tracer_, night_.seen, sums.samples, last, next, executor, [&] {
    if (observer.cancelled()) stopped.store(true, std::memory_order_relaxed);
    return stopped.load(std::memory_order_relaxed);
  });
  if (stopped.load(std::memory_order_relaxed)) return false;
  sums.pixels = std::move(next);
  sums.samples = last;
  return true;
}

}  // namespace npsim::tool
