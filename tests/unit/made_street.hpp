// SPDX-License-Identifier: Apache-2.0
// Generated streets for tests; two threads make them, and any number makes the same.
#ifndef NPSIM_TESTS_UNIT_MADE_STREET_HPP
#define NPSIM_TESTS_UNIT_MADE_STREET_HPP

#include <doctest/doctest.h>

#include <cstdint>

#include "npsim/exec/thread_pool.hpp"
#include "street/street.hpp"

namespace npsim::testing {

inline street::Street made_street(const street::StreetParams& params) {
  ThreadPool pool(2);
  street::Street made;
  REQUIRE(street::make_street(params, pool, made).ok());
  return made;
}

inline street::Street made_street(std::uint64_t seed, Shape shape) {
  street::StreetParams params;
  params.seed = seed;
  params.shape = shape;
  return made_street(params);
}

// In the light of the sun alone, with one sample a pixel: where its photograph hardly counts.
inline street::Street plain_street(std::uint64_t seed, Shape shape, int sky_rays = 0) {
  street::StreetParams params;
  params.seed = seed;
  params.shape = shape;
  params.samples = 1;
  params.sky_rays = sky_rays;
  return made_street(params);
}

}  // namespace npsim::testing

#endif  // NPSIM_TESTS_UNIT_MADE_STREET_HPP
