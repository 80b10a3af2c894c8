// SPDX-License-Identifier: Apache-2.0
// Workspace: a bump arena over bytes that the caller owns. The only memory a kernel may take.
//
// Invariant: every allocation is aligned to kWorkspaceAlignment and lies inside the caller's bytes; used() never
// exceeds peak(), peak() never exceeds capacity(). Running out is a Status, and the arena stays usable.
// Cost: one addition per allocation. Elements are not initialised.
//
// Some sizes are known only half-way, such as those of a mesh. There the library calls ensure() with what the next step
// needs, before that step starts. A caller who can make more of his memory usable in place, such as pages of an address
// range that he has reserved, passes MoreMemory; for all others ensure() is an early check.
#ifndef NPSIM_CORE_WORKSPACE_HPP
#define NPSIM_CORE_WORKSPACE_HPP

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr std::size_t kWorkspaceAlignment = 64;

// Bytes that one allocation of `count` elements takes from a workspace, padding included. Sums of these, plus
// kWorkspaceAlignment once for the alignment of the caller's pointer, are what workspace_bytes() functions return.
template <class T>
[[nodiscard]] constexpr std::size_t allocation_bytes(std::size_t count) noexcept {
  return (count * sizeof(T) + kWorkspaceAlignment - 1) / kWorkspaceAlignment * kWorkspaceAlignment;
}

// grow(owner, bytes) makes at least the first `bytes` bytes from the workspace's start usable, where they are, and
// returns how many are; fewer mean that there is no more.
struct MoreMemory {
  void* owner = nullptr;
  std::size_t (*grow)(void* owner, std::size_t bytes) = nullptr;
};

class Workspace {
 public:
  constexpr Workspace() noexcept = default;
  Workspace(void* data, std::size_t bytes, MoreMemory more = {}) noexcept : more_(more) {
    const auto address = reinterpret_cast<std::uintptr_t>(data);
    const std::size_t skip = (kWorkspaceAlignment - address % kWorkspaceAlignment) % kWorkspaceAlignment;
    if (data != nullptr && skip <= bytes) {
      data_ = static_cast<unsigned char*>(data) + skip;
      capacity_ = bytes - skip;
      skipped_ = skip;
    }
  }
  Workspace(const Workspace&) = delete;
  Workspace& operator=(const Workspace&) = delete;

  // `count` uninitialised elements of a trivially copyable type.
  template <class T>
  Status allocate(std::size_t count, Span<T>& out) noexcept {
    static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);
    static_assert(alignof(T) <= kWorkspaceAlignment);
    constexpr std::size_t kMaxCount = (~std::size_t{0} - kWorkspaceAlignment) / sizeof(T);
    if (count > kMaxCount || allocation_bytes<T>(count) > capacity_ - used_) {
      return Status(StatusCode::workspace_exhausted, "workspace is smaller than workspace_bytes() requires");
    }
    out = Span<T>(reinterpret_cast<T*>(data_ + used_), count);
    used_ += allocation_bytes<T>(count);
    if (used_ > peak_) peak_ = used_;
    return {};
  }

  template <class T>
  Status allocate_image(Shape shape, ImageView<T>& out) noexcept {
    Span<T> pixels;
    NPSIM_RETURN_IF_ERROR(allocate(shape.empty() ? 0 : shape.pixels(), pixels));
    out = ImageView<T>(pixels.data(), shape);
    return {};
  }

  // Shortens the latest allocation to its first `count` elements.
  template <class T>
  void shorten(Span<T>& latest, std::size_t count) noexcept {
    const std::size_t end = static_cast<std::size_t>(reinterpret_cast<unsigned char*>(latest.data()) - data_) +
                            allocation_bytes<T>(latest.size());
    if (end != used_ || count > latest.size()) return;
    used_ -= allocation_bytes<T>(latest.size()) - allocation_bytes<T>(count);
    latest = latest.sub(0, count);
  }

  // Room for a kernel whose workspace_bytes() function says so. Its share for the alignment of the first byte is not
  // asked for again.
  Status ensure(std::size_t workspace_bytes) noexcept {
    const std::size_t bytes = workspace_bytes > kWorkspaceAlignment ? workspace_bytes - kWorkspaceAlignment : 0;
    if (bytes <= capacity_ - used_) return {};
    if (more_.grow != nullptr && data_ != nullptr && bytes <= ~std::size_t{0} - used_ - skipped_) {
      const std::size_t usable = more_.grow(more_.owner, skipped_ + used_ + bytes);
      if (usable >= skipped_ && usable - skipped_ > capacity_) capacity_ = usable - skipped_;
      if (bytes <= capacity_ - used_) return {};
    }
    return Status(StatusCode::workspace_exhausted, "workspace is smaller than workspace_bytes() requires");
  }

  [[nodiscard]] constexpr std::size_t capacity() const noexcept { return capacity_; }
  [[nodiscard]] constexpr std::size_t used() const noexcept { return used_; }
  [[nodiscard]] constexpr std::size_t peak() const noexcept { return peak_; }

 private:
  friend class WorkspaceScope;
  unsigned char* data_ = nullptr;
  std::size_t capacity_ = 0;
  std::size_t used_ = 0;
  std::size_t peak_ = 0;
  std::size_t skipped_ = 0;  // of the caller's bytes, so that data_ is aligned
  MoreMemory more_;
};

// Gives back, at the end of a block or when told, everything allocated since its start.
class WorkspaceScope {
 public:
  explicit WorkspaceScope(Workspace& workspace) noexcept : workspace_(workspace), mark_(workspace.used_) {}
  ~WorkspaceScope() { release(); }
  WorkspaceScope(const WorkspaceScope&) = delete;
  WorkspaceScope& operator=(const WorkspaceScope&) = delete;
  void release() noexcept { workspace_.used_ = mark_; }

 private:
  Workspace& workspace_;
  std::size_t mark_;
};

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_WORKSPACE_HPP
