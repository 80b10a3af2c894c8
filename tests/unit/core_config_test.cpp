// SPDX-License-Identifier: Apache-2.0
#include "npsim/core/config.hpp"

#include <doctest/doctest.h>

#include <string>

TEST_CASE("the version of the headers is the version of the build") {
  CHECK(std::string(NPSIM_VERSION_STRING) == NPSIM_PROJECT_VERSION);
  CHECK(std::string(NPSIM_VERSION_STRING) == std::to_string(NPSIM_VERSION_MAJOR) + "." +
                                                 std::to_string(NPSIM_VERSION_MINOR) + "." +
                                                 std::to_string(NPSIM_VERSION_PATCH));
}

TEST_CASE("products and sums are not contracted into one rounding") {
  // (1 + e)^2 - (1 + 2 e) with e = 2^-12 is e^2 exactly, which a fused multiply-add keeps and separate rounding loses.
  volatile float a = 1.0F + 0x1p-12F;
  volatile float b = -(1.0F + 0x1p-11F);
  const float x = a;
  const float y = b;
  CHECK(x * x + y == 0.0F);
}
