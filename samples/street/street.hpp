// SPDX-License-Identifier: Apache-2.0
// make_street: a seeded street, built, photographed, annotated and misjudged. For hosts: heap and exceptions (only
// bad_alloc) allowed. Compiled once, in street.cpp.
//
// The same parameters give the same bytes for any executor that keeps the contract of core/executor.hpp.
// Cost: about 450,000 triangles; at 960x540 with the default samples about ten seconds on two cores. Memory: about
// 200 MB and 100 bytes a pixel.
#ifndef NPSIM_SAMPLES_STREET_STREET_HPP
#define NPSIM_SAMPLES_STREET_STREET_HPP

#include "any.hpp"
#include "npsim/core/status.hpp"
#include "params.hpp"

namespace npsim {
namespace street {

// Fills `street`; on failure its content is unspecified.
[[nodiscard]] Status make_street(const StreetParams& params, AnyExecutor executor, Street& street);

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_STREET_HPP
