// SPDX-License-Identifier: Apache-2.0
// The executor concept, and slots of scratch memory for what runs at the same time.
#ifndef NPSIM_CORE_EXECUTOR_HPP
#define NPSIM_CORE_EXECUTOR_HPP

#include <atomic>
#include <cstddef>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// The executor concept, the serial executor, and the common way to go over the rows of an image.
//
// An executor E offers  e.for_chunks(count, chunk, f)  which calls f(begin, end) for [0, chunk), [chunk, 2 chunk), ...
// up to count, each exactly once, in any order and on any thread, and returns when all calls have returned.
// Contract: the chunk size never depends on the number of threads, f does not throw, and a reduction writes one
// partial result per chunk (index begin / chunk) and combines them in chunk order. Hence the same bits for any
// thread count. A thread pool stands in exec/; the core has none.

struct SerialExecutor {
  template <class F>
  void for_chunks(std::size_t count, std::size_t chunk, F&& f) const {
    const std::size_t step = chunk == 0 ? 1 : chunk;
    for (std::size_t begin = 0; begin < count;) {
      const std::size_t end = count - begin < step ? count : begin + step;  // begin + step could wrap past the last
      f(begin, end);
      begin = end;
    }
  }
};

// Calls f(y) for each of so many rows, 16 to a chunk.
template <class Executor, class F>
void for_rows(Executor& executor, int rows, F&& f) {
  executor.for_chunks(rows > 0 ? static_cast<std::size_t>(rows) : 0, 16, [&f](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) f(static_cast<int>(y));
  });
}

// Number of chunks that for_chunks(count, chunk, ...) makes.
[[nodiscard]] constexpr std::size_t chunk_count(std::size_t count, std::size_t chunk) noexcept {
  return chunk == 0 ? count : count / chunk + (count % chunk != 0 ? 1 : 0);
}

// Slots of scratch memory for chunks that run at the same time: as few of them are touched as there are threads, so
// that the memory stays in the caches.
//
// take() gives a slot that nobody holds and waits while there is none, give() returns it. Whoever holds a slot must not
// wait for another. Which slot a chunk gets is open, so nothing may outlive the chunk in it.

inline constexpr int kMaxSlots = 32;  // one word of bits that machines of 32 bits swap without a lock

class SlotPool {
 public:
  // slots: 1..kMaxSlots.
  explicit SlotPool(int slots) noexcept
      : open_(slots >= kMaxSlots ? ~std::uint32_t{0} : (std::uint32_t{1} << static_cast<unsigned>(slots)) - 1U) {}
  SlotPool(const SlotPool&) = delete;
  SlotPool& operator=(const SlotPool&) = delete;

  [[nodiscard]] int take() noexcept {
    std::uint32_t open = open_.load(std::memory_order_relaxed);
    for (;;) {
      if (open == 0) {
        open = open_.load(std::memory_order_relaxed);
      } else if (open_.compare_exchange_weak(open, open & (open - 1), std::memory_order_acquire,
                                             std::memory_order_relaxed)) {
        return lowest_set_bit(open);
      }
    }
  }
  void give(int slot) noexcept {
    open_.fetch_or(std::uint32_t{1} << static_cast<unsigned>(slot), std::memory_order_release);
  }

 private:
  std::atomic<std::uint32_t> open_;
};

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_EXECUTOR_HPP
