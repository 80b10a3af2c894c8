// SPDX-License-Identifier: Apache-2.0
// Depth and all that comes with it, written down by a test in place of refine_depth().
#ifndef NPSIM_TESTS_UNIT_KNOWN_DEPTH_HPP
#define NPSIM_TESTS_UNIT_KNOWN_DEPTH_HPP

#include <cstdint>

#include "fixture.hpp"
#include "npsim/depth/refine_depth.hpp"

namespace npsim_test {

// At first a wall that faces the camera everywhere, without doubt.
struct KnownDepth {
  Image<float> depth;
  Image<npsim::Label> labels;
  Image<std::uint8_t> surface;
  Image<std::uint8_t> uncertain;
  Image<npsim::Vec3f> normals;

  KnownDepth(npsim::Shape shape, float depth_m)
      : depth(shape, depth_m),
        labels(shape, npsim::label::building),
        surface(shape, std::uint8_t{1}),
        uncertain(shape, std::uint8_t{0}),
        normals(shape, npsim::Vec3f{0, 0, -1}) {}

  [[nodiscard]] npsim::RefinedDepth refined() {
    npsim::RefinedDepth out;
    out.depth = depth.view();
    out.labels = labels.cview();
    out.surface = surface.view();
    out.uncertain = uncertain.view();
    out.normals = normals.view();
    return out;
  }
};

}  // namespace npsim_test

#endif  // NPSIM_TESTS_UNIT_KNOWN_DEPTH_HPP
