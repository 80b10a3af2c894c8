// SPDX-License-Identifier: Apache-2.0
// Image: an owning, contiguous image for hosts. Kernels see it through view().
//
// Pixels begin at a multiple of 64 bytes: vectors of rows that are a multiple of it too never lie across two lines of
// the cache.
#ifndef NPSIM_IO_IMAGE_HPP
#define NPSIM_IO_IMAGE_HPP

#include <cstddef>
#include <new>
#include <utility>
#include <vector>

#include "npsim/core/image_view.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

template <class T>
struct CacheLineAllocator {
  using value_type = T;
  static constexpr std::align_val_t kAlignment{kWorkspaceAlignment};
  static_assert(alignof(T) <= kWorkspaceAlignment);

  CacheLineAllocator() = default;
  template <class U>
  CacheLineAllocator(const CacheLineAllocator<U>&) noexcept {}

  [[nodiscard]] T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), kAlignment)); }
  void deallocate(T* p, std::size_t) noexcept { ::operator delete(p, kAlignment); }

  template <class U>
  friend bool operator==(const CacheLineAllocator&, const CacheLineAllocator<U>&) noexcept {
    return true;
  }
  template <class U>
  friend bool operator!=(const CacheLineAllocator&, const CacheLineAllocator<U>&) noexcept {
    return false;
  }
};

template <class T>
class Image {
 public:
  Image() = default;
  explicit Image(Shape shape, const T& fill = T{}) : pixels_(shape.empty() ? 0 : shape.pixels(), fill), shape_(shape) {}

  [[nodiscard]] bool empty() const { return pixels_.empty(); }
  [[nodiscard]] Shape shape() const { return shape_; }
  [[nodiscard]] int width() const { return shape_.width; }
  [[nodiscard]] int height() const { return shape_.height; }
  [[nodiscard]] T* data() { return pixels_.data(); }
  [[nodiscard]] const T* data() const { return pixels_.data(); }
  [[nodiscard]] ImageView<T> view() { return ImageView<T>(pixels_.data(), shape_); }
  [[nodiscard]] ImageView<const T> view() const { return ImageView<const T>(pixels_.data(), shape_); }
  [[nodiscard]] T& operator()(int x, int y) { return view()(x, y); }
  [[nodiscard]] const T& operator()(int x, int y) const { return view()(x, y); }

 private:
  std::vector<T, CacheLineAllocator<T>> pixels_;
  Shape shape_{};
};

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_IMAGE_HPP
