// SPDX-License-Identifier: Apache-2.0
// Pictures of linear light, and their pixels one after the other.
#ifndef NPSIM_TESTS_UNIT_SENSOR_FIXTURE_HPP
#define NPSIM_TESTS_UNIT_SENSOR_FIXTURE_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/random.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "unit/fixture.hpp"

namespace sensor_test {

using Image = npsim_test::Image<npsim::Vec3f>;

inline npsim::Span<npsim::Vec3f> pixels(Image& image) { return {image.view().data(), image.shape().pixels()}; }
inline npsim::Span<const npsim::Vec3f> pixels(const Image& image) {
  return {image.view().data(), image.shape().pixels()};
}

inline double total(const Image& image) {
  double sum = 0;
  for (const npsim::Vec3f& p : pixels(image)) {
    sum += static_cast<double>(p.x) + static_cast<double>(p.y) + static_cast<double>(p.z);
  }
  return sum;
}

// Light below 1, and a lamp in a hundred pixels.
inline Image lamps_in_the_dark(npsim::Shape shape) {
  Image image(shape);
  for (std::size_t i = 0; i < pixels(image).size(); ++i) {
    npsim::RandomStream random(2, npsim::RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
    pixels(image)[i] = {random.uniform(), random.uniform(), random.uniform()};
    if (random.uniform() < 0.01F) pixels(image)[i] *= 2e4F;
  }
  return image;
}

}  // namespace sensor_test

#endif  // NPSIM_TESTS_UNIT_SENSOR_FIXTURE_HPP
