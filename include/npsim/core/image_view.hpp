// SPDX-License-Identifier: Apache-2.0
// ImageView: a two-dimensional, row-major view with a row stride, over memory that somebody else owns.
//
// Shapes are in pixels, the stride in elements. Invariant: 0 <= width <= stride; pixel (x, y) is
// data[y * stride + x]. A sub-view shares the memory. Colour and normal images hold one Vec3f per pixel.
#ifndef NPSIM_CORE_IMAGE_VIEW_HPP
#define NPSIM_CORE_IMAGE_VIEW_HPP

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct Shape {
  int width = 0;   // px
  int height = 0;  // px

  [[nodiscard]] constexpr std::size_t pixels() const noexcept {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  [[nodiscard]] constexpr bool empty() const noexcept { return width <= 0 || height <= 0; }
};

[[nodiscard]] constexpr bool operator==(const Shape& a, const Shape& b) noexcept {
  return a.width == b.width && a.height == b.height;
}
[[nodiscard]] constexpr bool operator!=(const Shape& a, const Shape& b) noexcept { return !(a == b); }

// Where pixel y * width + x lies.
struct PixelPlace {
  int x = 0;
  int y = 0;
};
[[nodiscard]] constexpr PixelPlace place_of(std::uint32_t pixel, int width) noexcept {
  const auto columns = static_cast<std::uint32_t>(width);
  return {static_cast<int>(pixel % columns), static_cast<int>(pixel / columns)};
}

template <class T>
class ImageView {
 public:
  using value_type = std::remove_cv_t<T>;

  constexpr ImageView() noexcept = default;
  constexpr ImageView(T* data, Shape shape, std::ptrdiff_t stride) noexcept
      : data_(data), stride_(stride), shape_(shape) {}
  constexpr ImageView(T* data, Shape shape) noexcept : ImageView(data, shape, shape.width) {}
  // ImageView<float> converts to ImageView<const float>.
  template <class U, std::enable_if_t<std::is_same_v<const U, T> && !std::is_same_v<U, T>, int> = 0>
  constexpr ImageView(const ImageView<U>& other) noexcept  // NOLINT(google-explicit-constructor)
      : data_(other.data()), stride_(other.stride()), shape_(other.shape()) {}

  [[nodiscard]] constexpr T* data() const noexcept { return data_; }
  [[nodiscard]] constexpr Shape shape() const noexcept { return shape_; }
  [[nodiscard]] constexpr int width() const noexcept { return shape_.width; }
  [[nodiscard]] constexpr int height() const noexcept { return shape_.height; }
  [[nodiscard]] constexpr std::ptrdiff_t stride() const noexcept { return stride_; }
  [[nodiscard]] constexpr bool empty() const noexcept { return data_ == nullptr || shape_.empty(); }
  [[nodiscard]] constexpr bool contiguous() const noexcept { return stride_ == shape_.width; }

  [[nodiscard]] constexpr T* row(int y) const noexcept { return data_ + static_cast<std::ptrdiff_t>(y) * stride_; }
  [[nodiscard]] constexpr T& operator()(int x, int y) const noexcept { return row(y)[x]; }
  [[nodiscard]] constexpr T& operator()(const PixelPlace& at) const noexcept { return row(at.y)[at.x]; }
  [[nodiscard]] constexpr bool contains(int x, int y) const noexcept {
    return x >= 0 && y >= 0 && x < shape_.width && y < shape_.height;
  }
  // The rectangle with upper-left pixel (x, y); the caller keeps it inside the view.
  [[nodiscard]] constexpr ImageView sub(int x, int y, Shape shape) const noexcept {
    return ImageView(row(y) + x, shape, stride_);
  }
  // All pixels as one span; only meaningful when contiguous().
  [[nodiscard]] constexpr Span<T> pixels() const noexcept { return Span<T>(data_, shape_.pixels()); }

 private:
  T* data_ = nullptr;
  std::ptrdiff_t stride_ = 0;
  Shape shape_{};
};

// Copies every pixel; both views have one shape and do not overlap.
template <class From, class To>
constexpr void copy_pixels(const ImageView<From>& from, const ImageView<To>& to) noexcept {
  for (int y = 0; y < to.height(); ++y) {
    for (int x = 0; x < to.width(); ++x) to(x, y) = from(x, y);
  }
}

// Goes over an image row by row and back. Calls f(x, y, i, j) for every pixel (x, y) and each of its neighbours (i, j)
// in the image that was passed just before: left and above on the way there, right and below on the way back. What
// spreads from neighbour to neighbour so comes as far as paths go that do not wind.
template <class F>
constexpr void sweep_to_and_fro(Shape shape, F&& f) {
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (x > 0) f(x, y, x - 1, y);
      if (y > 0) f(x, y, x, y - 1);
    }
  }
  for (int y = shape.height - 1; y >= 0; --y) {
    for (int x = shape.width - 1; x >= 0; --x) {
      if (x + 1 < shape.width) f(x, y, x + 1, y);
      if (y + 1 < shape.height) f(x, y, x, y + 1);
    }
  }
}

// f(u, v) for the pixels to the left and right of (x, y), above and below it, be they in an image or not.
template <class F>
constexpr void for_neighbours(int x, int y, F&& f) {
  f(x - 1, y);
  f(x + 1, y);
  f(x, y - 1);
  f(x, y + 1);
}

// Takes the pixels that hang together with (x, y), along rows and columns, and have its value in `open`, which is not
// 0, as far as joined(u, v, i, j) is true for neighbours: in `open` they become 0, and y * width + x of each goes to
// `list`, which has room for all. Returns how many there are.
template <class Joined>
[[nodiscard]] std::size_t take_piece(ImageView<std::uint8_t> open, int x, int y, Span<std::uint32_t> list,
                                     const Joined& joined) noexcept {
  const auto width = static_cast<std::uint32_t>(open.width());
  const std::uint8_t value = open(x, y);
  std::size_t count = 0;
  const auto add = [&](int u, int v) {
    open(u, v) = 0;
    list[count++] = static_cast<std::uint32_t>(v) * width + static_cast<std::uint32_t>(u);
  };
  add(x, y);
  for (std::size_t next = 0; next < count; ++next) {
    const PixelPlace from = place_of(list[next], open.width());
    for_neighbours(from.x, from.y, [&](int u, int v) {
      if (open.contains(u, v) && open(u, v) != 0 && open(u, v) == value && joined(from.x, from.y, u, v)) add(u, v);
    });
  }
  return count;
}

[[nodiscard]] inline std::size_t take_piece(ImageView<std::uint8_t> open, int x, int y,
                                            Span<std::uint32_t> list) noexcept {
  return take_piece(open, x, y, list, [](int, int, int, int) { return true; });
}

// f(piece) of all pieces, each as take_piece() lists it, in the order of their first pixels; all of `open` becomes 0.
template <class F>
void for_pieces(ImageView<std::uint8_t> open, Span<std::uint32_t> list, const F& f) {
  for (int y = 0; y < open.height(); ++y) {
    for (int x = 0; x < open.width(); ++x) {
      if (open(x, y) != 0) f(Span<const std::uint32_t>(list.data(), take_piece(open, x, y, list)));
    }
  }
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_IMAGE_VIEW_HPP
