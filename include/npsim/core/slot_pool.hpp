// SPDX-License-Identifier: Apache-2.0
// Slots of scratch memory for chunks that run at the same time: as few of them are touched as there are threads, so
// that the memory stays in the caches.
//
// take() gives a slot that nobody holds and waits while there is none, give() returns it. Whoever holds a slot must not
// wait for another. Which slot a chunk gets is open, so nothing may outlive the chunk in it.
#ifndef NPSIM_CORE_SLOT_POOL_HPP
#define NPSIM_CORE_SLOT_POOL_HPP

#include <atomic>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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

#endif  // NPSIM_CORE_SLOT_POOL_HPP
