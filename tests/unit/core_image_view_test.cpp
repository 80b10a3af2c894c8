// SPDX-License-Identifier: Apache-2.0
#include "npsim/core/image_view.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <numeric>
#include <type_traits>
#include <vector>

using npsim::ImageView;
using npsim::Shape;
using npsim::Span;

static_assert(std::is_trivially_copyable_v<ImageView<float>>);
static_assert(std::is_convertible_v<ImageView<float>, ImageView<const float>>);
static_assert(!std::is_convertible_v<ImageView<const float>, ImageView<float>>);

TEST_CASE("shapes: pixels do not overflow 32 bits, nothing and negative are empty") {
  CHECK(Shape{70000, 70000}.pixels() == std::size_t{4900000000U});
  CHECK(Shape{}.empty());
  CHECK(Shape{0, 5}.empty());
  CHECK(Shape{5, 0}.empty());
  CHECK(Shape{-3, 5}.empty());
  CHECK_FALSE(Shape{1, 1}.empty());
  CHECK(Shape{3, 4} == Shape{3, 4});
  CHECK(Shape{3, 4} != Shape{4, 3});
}

TEST_CASE("a default view is empty; so is a view of no pixels or of no memory") {
  CHECK(ImageView<float>().empty());
  float one = 0;
  CHECK(ImageView<float>(&one, {0, 1}).empty());
  CHECK(ImageView<float>(nullptr, {1, 1}).empty());
  CHECK_FALSE(ImageView<float>(&one, {1, 1}).empty());
}

TEST_CASE("a stride wider than the image: rows start where they should, padding is never touched") {
  std::array<int, 4 * 7> memory{};
  memory.fill(-1);
  const ImageView<int> view(memory.data(), {5, 4}, 7);
  CHECK_FALSE(view.contiguous());
  for (int y = 0; y < view.height(); ++y) {
    for (int x = 0; x < view.width(); ++x) view(x, y) = 10 * y + x;
  }
  for (std::size_t i = 0; i < memory.size(); ++i) {
    const int x = static_cast<int>(i % 7);
    const int y = static_cast<int>(i / 7);
    CHECK(memory[i] == (x < 5 ? 10 * y + x : -1));
  }
  CHECK(view.row(2) == memory.data() + 14);
}

TEST_CASE("a sub-view of a sub-view addresses the same pixels") {
  std::array<int, 6 * 8> memory{};
  std::iota(memory.begin(), memory.end(), 0);
  const ImageView<const int> all(memory.data(), {8, 6});
  const ImageView<const int> outer = all.sub(1, 2, {6, 4});
  const ImageView<const int> inner = outer.sub(2, 1, {3, 2});
  CHECK(inner.shape() == Shape{3, 2});
  CHECK(inner.stride() == 8);
  CHECK_FALSE(inner.contiguous());
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 3; ++x) CHECK(&inner(x, y) == &all(x + 3, y + 3));
  }
  CHECK(all.sub(0, 1, {8, 5}).contiguous());
}

TEST_CASE("one column and one row") {
  std::array<int, 5> memory{1, 2, 3, 4, 5};
  const ImageView<int> column(memory.data(), {1, 5});
  CHECK(column(0, 4) == 5);
  CHECK(column.pixels().size() == 5);
  const ImageView<int> row(memory.data(), {5, 1});
  CHECK(row(4, 0) == 5);
}

TEST_CASE("contains: the border belongs to it, one beyond does not") {
  int memory[6] = {};
  const ImageView<int> view(memory, {3, 2});
  CHECK(view.contains(0, 0));
  CHECK(view.contains(2, 1));
  CHECK_FALSE(view.contains(3, 1));
  CHECK_FALSE(view.contains(2, 2));
  CHECK_FALSE(view.contains(-1, 0));
  CHECK_FALSE(view.contains(0, -1));
}

TEST_CASE("pieces: corners join none, values part neighbours, and each is listed once in the order of rows") {
  constexpr Shape kShape{4, 3};
  std::array<std::uint8_t, 12> open = {1, 0, 2, 2,  //
                                       0, 1, 1, 2,  //
                                       3, 0, 1, 0};
  std::array<std::uint32_t, 12> list{};
  std::vector<std::vector<std::uint32_t>> pieces;
  npsim::for_pieces(ImageView<std::uint8_t>(open.data(), kShape), Span<std::uint32_t>(list.data(), list.size()),
                    [&](Span<const std::uint32_t> piece) {
                      pieces.emplace_back(piece.begin(), piece.end());
                      std::sort(pieces.back().begin(), pieces.back().end());
                    });
  CHECK(pieces == std::vector<std::vector<std::uint32_t>>{{0}, {2, 3, 7}, {5, 6, 10}, {8}});
  CHECK(std::all_of(open.begin(), open.end(), [](std::uint8_t v) { return v == 0; }));
}
