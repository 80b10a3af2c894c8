// SPDX-License-Identifier: Apache-2.0
#include "npsim/core/span.hpp"

#include <doctest/doctest.h>

#include <type_traits>

using npsim::Span;

static_assert(std::is_trivially_copyable_v<Span<float>>);
static_assert(std::is_convertible_v<Span<float>, Span<const float>>);
static_assert(!std::is_convertible_v<Span<const float>, Span<float>>, "constness is not lost");
static_assert(!std::is_convertible_v<Span<int>, Span<const float>>, "elements are not reinterpreted");
static_assert(std::is_same_v<Span<const float>::value_type, float>);

TEST_CASE("an empty span can be iterated and cut") {
  const Span<int> none;
  CHECK(none.empty());
  CHECK(none.size() == 0);
  CHECK(none.begin() == none.end());
  CHECK(none.sub(0, 0).empty());
}

TEST_CASE("a span writes through, and a part of it shares the elements") {
  int values[] = {1, 2, 3, 4, 5};
  const Span<int> all = values;
  REQUIRE(all.size() == 5);
  const Span<int> middle = all.sub(1, 3);
  REQUIRE(middle.size() == 3);
  middle[2] = 40;
  CHECK(values[3] == 40);
  const Span<const int> view = all;
  CHECK(view.data() == values);
  int sum = 0;
  for (const int v : view) sum += v;
  CHECK(sum == 1 + 2 + 3 + 40 + 5);
  CHECK(all.sub(5, 0).empty());
}
