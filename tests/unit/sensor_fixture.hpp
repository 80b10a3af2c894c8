// SPDX-License-Identifier: Apache-2.0
// Pictures of linear light, and their pixels one after the other.
#ifndef NPSIM_TESTS_UNIT_SENSOR_FIXTURE_HPP
#define NPSIM_TESTS_UNIT_SENSOR_FIXTURE_HPP

#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "unit/fixture.hpp"

namespace sensor_test {

using Image = npsim_test::Image<npsim::Vec3f>;

inline npsim::Span<npsim::Vec3f> pixels(Image& image) { return {image.view().data(), image.shape().pixels()}; }
inline npsim::Span<const npsim::Vec3f> pixels(const Image& image) {
  return {image.view().data(), image.shape().pixels()};
}

}  // namespace sensor_test

#endif  // NPSIM_TESTS_UNIT_SENSOR_FIXTURE_HPP
