// SPDX-License-Identifier: Apache-2.0
// HostMemory: memory for a workspace that grows in place as the library asks for more (Workspace::ensure()).
//
// A range of addresses is reserved for the most that could be needed; only what is asked for can be touched, and only
// that counts against the system's memory. Where the system has no such call (POSIX mmap), the most is allocated. Where
// it has large pages they are used, and what is touched counts in these.
#ifndef NPSIM_IO_MEMORY_HPP
#define NPSIM_IO_MEMORY_HPP

#include <cstddef>
#include <cstdlib>

#include "npsim/core/workspace.hpp"

#if defined(__unix__) || defined(__APPLE__)
#include <sys/mman.h>
#define NPSIM_IO_HAS_MMAP 1
#endif

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

class HostMemory {
 public:
  // most: what a workspace_bytes() function returns. ok() is false where so much cannot be had.
  explicit HostMemory(std::size_t most) : most_(most) {
#if defined(NPSIM_IO_HAS_MMAP)
    // Where even addresses are limited, fewer: most scenes need far less than the most.
    for (;;) {
      void* const start = mmap(nullptr, most_ == 0 ? 1 : most_, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
      start_ = start == MAP_FAILED ? nullptr : start;
      if (start_ != nullptr || most_ < (std::size_t{1} << 20U)) break;
      most_ -= most_ / 4;
    }
#if defined(MADV_HUGEPAGE)
    // Small pages cost a tenth of a night, in faults and in addresses to look up. A refusal costs nothing.
    if (start_ != nullptr) static_cast<void>(madvise(start_, most_, MADV_HUGEPAGE));
#endif
#else
    start_ = std::malloc(most_);
    usable_ = start_ == nullptr ? 0 : most_;
#endif
  }
  HostMemory(const HostMemory&) = delete;
  HostMemory& operator=(const HostMemory&) = delete;
  ~HostMemory() {
#if defined(NPSIM_IO_HAS_MMAP)
    if (start_ != nullptr) munmap(start_, most_ == 0 ? 1 : most_);
#else
    std::free(start_);
#endif
  }

  [[nodiscard]] bool ok() const noexcept { return start_ != nullptr; }
  [[nodiscard]] std::size_t usable() const noexcept { return usable_; }
  // One at a time; it may not outlive the memory. at_once: for kernels that do not ask, of the most.
  [[nodiscard]] Workspace workspace(std::size_t at_once = 0) noexcept {
    if (at_once > usable_) grow(this, at_once);
    return Workspace(start_, usable_, {this, &HostMemory::grow});
  }

 private:
  static std::size_t grow(void* owner, std::size_t bytes) noexcept {
    auto& memory = *static_cast<HostMemory*>(owner);
#if defined(NPSIM_IO_HAS_MMAP)
    constexpr std::size_t kPage = std::size_t{1} << 21U;  // the large ones of most systems
    if (bytes > memory.most_) return memory.usable_;
    std::size_t wanted = (bytes + kPage - 1) / kPage * kPage;
    if (wanted > memory.most_) wanted = memory.most_;
    if (wanted > memory.usable_ && mprotect(memory.start_, wanted, PROT_READ | PROT_WRITE) == 0) {
      memory.usable_ = wanted;
    }
#endif
    return memory.usable_;
  }

  std::size_t most_;
  void* start_ = nullptr;
  std::size_t usable_ = 0;
};

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_MEMORY_HPP
