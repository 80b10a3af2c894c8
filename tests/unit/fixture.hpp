// SPDX-License-Identifier: Apache-2.0
// What a test hands to a kernel: an image of its own, memory to work in, and an executor that works in another order.
#ifndef NPSIM_TESTS_UNIT_FIXTURE_HPP
#define NPSIM_TESTS_UNIT_FIXTURE_HPP

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim_test {

// An owning image. With `padding` columns behind each row, so that strides are exercised, filled with `pad`.
template <class T>
class Image {
 public:
  Image() = default;
  explicit Image(npsim::Shape shape, const T& fill = T{}, int padding = 0, const T& pad = T{})
      : pixels_(static_cast<std::size_t>(shape.width + padding) * static_cast<std::size_t>(shape.height) + 1, pad),
        shape_(shape),
        stride_(shape.width + padding) {
    for (int y = 0; y < shape.height; ++y) std::fill_n(view().row(y), shape.width, fill);
  }
  Image(npsim::Shape shape, std::initializer_list<T> row_major) : Image(shape) {
    REQUIRE(row_major.size() == shape.pixels());
    std::copy(row_major.begin(), row_major.end(), pixels_.begin());
  }

  [[nodiscard]] npsim::Shape shape() const { return shape_; }
  [[nodiscard]] npsim::ImageView<T> view() { return {pixels_.data(), shape_, stride_}; }
  [[nodiscard]] npsim::ImageView<const T> view() const { return {pixels_.data(), shape_, stride_}; }
  [[nodiscard]] npsim::ImageView<const T> cview() const { return view(); }
  [[nodiscard]] T& operator()(int x, int y) { return view()(x, y); }
  [[nodiscard]] const T& operator()(int x, int y) const { return view()(x, y); }
  // Columns from x0 and rows from y0, those of x1 and y1 left out.
  void fill_rectangle(int x0, int y0, int x1, int y1, const T& value) {
    for (int y = y0; y < y1; ++y) std::fill_n(view().row(y) + x0, x1 - x0, value);
  }
  // As lies in memory, padding included: equal when every byte that a kernel could have written is.
  friend bool operator==(const Image& a, const Image& b) { return a.shape_ == b.shape_ && a.pixels_ == b.pixels_; }

 private:
  std::vector<T> pixels_;
  npsim::Shape shape_{};
  int stride_ = 0;
};

// A workspace over as many bytes as were asked for, from the address that costs the most to align: a kernel that does
// not ask for that fails here each time, not now and then. One that writes beyond them is found at the end of the scope.
class Scratch {
 public:
  explicit Scratch(std::size_t bytes)
      : memory_(bytes + npsim::kWorkspaceAlignment + kGuard, kMark),
        first_(to_misaligned(memory_.data())),
        end_(first_ + bytes),
        workspace_(memory_.data() + first_, bytes) {}
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;
  ~Scratch() {
    const auto begin = memory_.begin();
    const auto marked = [](unsigned char byte) { return byte == kMark; };
    CHECK(std::all_of(begin, begin + static_cast<std::ptrdiff_t>(first_), marked));
    CHECK(std::all_of(begin + static_cast<std::ptrdiff_t>(end_), memory_.end(), marked));
  }
  [[nodiscard]] npsim::Workspace& workspace() { return workspace_; }

 private:
  static constexpr std::size_t kGuard = 64;
  static constexpr unsigned char kMark = 0xA5;
  static std::size_t to_misaligned(const unsigned char* data) {
    const auto past = reinterpret_cast<std::uintptr_t>(data) % npsim::kWorkspaceAlignment;
    return (npsim::kWorkspaceAlignment + 1 - past) % npsim::kWorkspaceAlignment;
  }
  std::vector<unsigned char> memory_;
  std::size_t first_;
  std::size_t end_;
  npsim::Workspace workspace_;
};

// Chunks from the last to the first: what depends on their order gives other bits than the serial executor.
struct BackwardExecutor {
  template <class F>
  void for_chunks(std::size_t count, std::size_t chunk, F&& f) const {
    const std::size_t step = chunk == 0 ? 1 : chunk;
    for (std::size_t i = npsim::chunk_count(count, step); i-- > 0;) f(i * step, std::min(count, (i + 1) * step));
  }
};

}  // namespace npsim_test

#endif  // NPSIM_TESTS_UNIT_FIXTURE_HPP
