// SPDX-License-Identifier: Apache-2.0
#include "npsim/core/status.hpp"

#include <doctest/doctest.h>

#include <set>
#include <string>
#include <type_traits>

using npsim::Result;
using npsim::Status;
using npsim::StatusCode;

namespace {

Status fail_if_negative(int x) { return x < 0 ? Status(StatusCode::invalid_argument, "negative") : Status(); }

Status count_steps(int first, int second, int& steps) {
  NPSIM_RETURN_IF_ERROR(fail_if_negative(first));
  ++steps;
  NPSIM_RETURN_IF_ERROR(fail_if_negative(second));
  ++steps;
  return {};
}

Result<int> half(int x) {
  NPSIM_RETURN_IF_ERROR(fail_if_negative(x));
  return x / 2;
}

}  // namespace

static_assert(std::is_trivially_copyable_v<Status>);
static_assert(std::is_trivially_copyable_v<Result<double>>);
static_assert(Status().ok() && Status(), "a default status is success, at compile time too");

TEST_CASE("a status is ok exactly when its code is, and its message is never null") {
  CHECK(Status().ok());
  CHECK(std::string(Status().message()).empty());
  const Status status(StatusCode::not_finite, nullptr);
  CHECK_FALSE(status.ok());
  CHECK_FALSE(static_cast<bool>(status));
  CHECK(status.code() == StatusCode::not_finite);
  CHECK(std::string(status.message()).empty());
}

TEST_CASE("every status code has a name of its own, a foreign one does not crash") {
  std::set<std::string> names;
  for (int code = 0; code <= static_cast<int>(StatusCode::cancelled); ++code) {
    names.insert(npsim::status_code_name(static_cast<StatusCode>(code)));
  }
  CHECK(names.size() == static_cast<std::size_t>(StatusCode::cancelled) + 1);
  CHECK(names.count("unknown") == 0);
  CHECK(std::string(npsim::status_code_name(static_cast<StatusCode>(200))) == "unknown");
}

TEST_CASE("the early return stops at the first failure and evaluates once") {
  int steps = 0;
  CHECK(count_steps(1, 1, steps).ok());
  CHECK(steps == 2);
  steps = 0;
  CHECK(count_steps(1, -1, steps).code() == StatusCode::invalid_argument);
  CHECK(steps == 1);
  steps = 0;
  CHECK_FALSE(count_steps(-1, 1, steps).ok());
  CHECK(steps == 0);
}

TEST_CASE("a result holds a value or the reason for its absence") {
  REQUIRE(half(9).ok());
  CHECK(half(9).value() == 4);
  CHECK(half(9).value_or(-7) == 4);
  const Result<int> none = half(-9);
  CHECK_FALSE(none.ok());
  CHECK_FALSE(static_cast<bool>(none));
  CHECK(none.status().code() == StatusCode::invalid_argument);
  CHECK(none.value_or(-7) == -7);
  CHECK(none.value() == 0);
}
