// SPDX-License-Identifier: Apache-2.0
// Direct light of one lamp at points of a scene of rays, as tests ask for it.
#ifndef NPSIM_TESTS_UNIT_LIT_POINTS_HPP
#define NPSIM_TESTS_UNIT_LIT_POINTS_HPP

#include <doctest/doctest.h>

#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/render/direct.hpp"
#include "npsim/render/visibility.hpp"

namespace npsim_test {

// In a picture: `visible_point`; else all points, in their order.
struct LampQuestion {
  npsim::VisibilityParams params;
  std::uint32_t number = 0;
  float peak_cd = 1;
  float certain_lx = 0;
  std::vector<std::uint16_t> face_mark;
  npsim::Veils veils;
  npsim::Bodies bodies;
  npsim::ImageView<const std::uint32_t> visible_point;
};

struct LitPoints {
  std::vector<float> lx;
  std::vector<npsim::Vec3f> to_light;
  float untraced_lx = 0;  // sum
};

template <class Scene>
LitPoints lit_points(const Scene& scene, const npsim::SurfacePoints& points, const npsim::Emitter& lamp,
                     const LampQuestion& question) {
  using namespace npsim;
  const std::size_t n = points.size();
  Scratch scratch(point_blocks_bytes(question.visible_point.shape(), n) + kWorkspaceAlignment);
  const std::vector<std::uint8_t> hidden(n, question.visible_point.empty() ? 1 : 0);
  PointBlocks blocks;
  SerialExecutor serial;
  REQUIRE(
      make_point_blocks(points, question.visible_point, {hidden.data(), n}, scratch.workspace(), serial, blocks).ok());
  LitPoints out;
  out.lx.resize(n);
  out.to_light.resize(n);
  const std::vector<float> certain_lx(n, question.certain_lx);
  std::vector<float> untraced_lx(blocks.count(), 0.0F);
  NullObserver observer;
  const auto keep = [&](std::size_t b, const BlockLight& light) {
    for (std::size_t i = 0; light.any && i < kBlockPoints; ++i) {
      const std::uint32_t p = blocks.of_block(b)[i];
      if (!(light.illuminance_lx[i] > 0.0F)) continue;
      out.lx[p] = light.illuminance_lx[i];
      out.to_light[p] = light.to_light[i];
    }
  };
  const Occluders occluders{{question.face_mark.data(), question.face_mark.size()}, question.veils, question.bodies};
  REQUIRE(light_blocks(question.params, 1, scene, points, blocks, {certain_lx.data(), n}, lamp, question.number,
                       question.peak_cd, occluders, {untraced_lx.data(), untraced_lx.size()}, serial, observer, keep)
              .ok());
  for (const float lx : untraced_lx) out.untraced_lx += lx;
  return out;
}

// What the camera sees of a point in the light of a lamp of 1 cd that nothing hides.
inline npsim::Vec3f free_light(const npsim::SurfacePoints& points, std::size_t p, const npsim::Emitter& lamp,
                               float f0) {
  npsim::Vec3f to_light;
  const float lx = npsim::illuminance_per_cd(lamp, points.position[p], points.normal[p], to_light);
  return lx > 0.0F ? npsim::direct_light(points, p, lx, to_light, f0) : npsim::Vec3f{};
}

}  // namespace npsim_test

#endif  // NPSIM_TESTS_UNIT_LIT_POINTS_HPP
