// SPDX-License-Identifier: Apache-2.0
#include "npsim/core/observe.hpp"

#include <doctest/doctest.h>

#include <set>
#include <string>

TEST_CASE("every stage has a name of its own") {
  std::set<std::string> names;
  const int count = static_cast<int>(npsim::Stage::count_);
  for (int i = 0; i < count; ++i) names.insert(npsim::stage_name(static_cast<npsim::Stage>(i)));
  CHECK(names.size() == static_cast<std::size_t>(count));
  CHECK(names.count("unknown") == 0);
}

TEST_CASE("the observer that watches nothing never cancels") {
  constexpr npsim::NullObserver kObserver;
  kObserver.begin(npsim::Stage::fill);
  kObserver.progress(1, 0);
  kObserver.end(npsim::Stage::fill);
  kObserver.depth(npsim::Stage::fill, {});
  CHECK_FALSE(kObserver.cancelled());
}
