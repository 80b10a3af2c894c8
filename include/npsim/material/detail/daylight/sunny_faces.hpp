// SPDX-License-Identifier: Apache-2.0
// How much of the sun the faces of things receive, where it shines on the ground around them.
//
// Against the sun, what a photograph shows of a sign, a person or a car is its shaded side, and is as dark there as
// black paint in the sun. One thing alone does not tell which; all that stand in the sun share its direction. Their
// albedos are those of paint, cloth and sheet metal or, fewer of them, of tyres, panes and black paint. So each
// direction of sun.hpp's grid says how likely their luminance is, as it does for walls. The sun's light on a face is
// the mean of what the directions give it, as likely as they are: more than level ground has where a low sun shines on
// it, none where it faces away. Where walls have told the sun, directions near theirs are the likelier ones from the
// start.
// Roofs and bonnets see the sun from everywhere.
// Error: things of .06 to .6 come out within .65 of an octave where they face a sun that walls have told, within one
// where they look away from a sun that they do not tell.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_SUNNY_FACES_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_SUNNY_FACES_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"
#include "npsim/material/detail/daylight/sun.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

inline constexpr int kFaceTurns = 32;  // directions of upright faces that are told apart

struct SunnyFaces {
  Sun sun;
  // Light of the sun over that on level ground, by the turn of the normal from `ahead` to the right.
  std::array<float, kFaceTurns> upright{};

  // Light of the sun on a face, over that on level ground.
  [[nodiscard]] float direct(const Vec3f& normal) const noexcept {
    constexpr float kPerTurn = static_cast<float>(kFaceTurns) / 6.2831853F;
    const float upward = clamp_to(dot(normal, sun.up), 0.0F, 1.0F);
    const float turn = std::atan2(dot(normal, sun.right()), dot(normal, sun.ahead)) * kPerTurn;
    const int k = (static_cast<int>(std::floor(turn + 0.5F)) + kFaceTurns) % kFaceTurns;
    return upward + (1.0F - upward) * upright[static_cast<std::size_t>(k)];
  }
};

// The face that a thing whose normal is not known shows: what is seen faces the camera.
[[nodiscard]] inline Vec3f seen_face(const Vec3f& normal) noexcept {
  return normal == Vec3f{} ? Vec3f{0, 0, -1} : normal;
}

[[nodiscard]] inline AlbedoPrior prior_of_things() noexcept {
  constexpr AlbedoKind kThing{-2.2F, 1.2F, 0.8F};  // paint, cloth, sheet metal: of .22
  constexpr AlbedoKind kBlack{-4.6F, 1.0F, 0.2F};  // tyres, panes, black paint: of .04
  return {kThing, kBlack};
}

// in_sun(x, y): a thing that stands in the sun. `sun`: its light, and its direction if that is known.
template <class InSun, class Normal, class Executor>
Status find_sunny_faces(const Picture& picture, const InSun& in_sun, const Normal& normal, float scale, const Sun& sun,
                        Workspace& workspace, SunnyFaces& out, Executor& executor) {
  constexpr float kBlock_px = 64.0F;    // at 960 px width: things are alike within, as walls are
  constexpr float kMost = 1.5F;         // what low suns give would outweigh all others
  constexpr float kWallsError = 0.17F;  // rad: sun.hpp's
  const WorkspaceScope scope(workspace);
  out.sun = sun;
  const SunGrid grid(sun);
  Span<FaceSample> room;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kFaceSamples, room));
  float independent = 0.0F;
  const auto face = [&](int x, int y) { return seen_face(normal(x, y)); };
  const Span<FaceSample> things =
      room.sub(0, face_samples(picture, in_sun, face, sun.up, scale, kBlock_px, room, independent));
  constexpr float kAsSeen = 0.0F;
  std::array<float, kMostSunDirections> weight{};
  bits_of_directions(sun, grid, prior_of_things(), things, {&kAsSeen, 1}, {weight.data(), weight.size()}, executor);
  float best = -1e30F;
  for (std::size_t i = 0; i < grid.count; ++i) {
    weight[i] *= independent;
    const Vec3f off = sun.direction - grid.direction[i];
    if (sun.found) weight[i] -= 0.5F * kLog2E * dot(off, off) / (kWallsError * kWallsError);
    best = std::max(best, weight[i]);
  }
  float total = 0.0F;
  for (std::size_t i = 0; i < grid.count; ++i) total += weight[i] = exp2_of(std::max(weight[i] - best, -100.0F));
  for (int k = 0; k < kFaceTurns; ++k) {
    const float turn = 6.2831853F * static_cast<float>(k) / static_cast<float>(kFaceTurns);
    const Vec3f turned = sun.ahead * std::cos(turn) + sun.right() * std::sin(turn);
    float mean = 0.0F;
    for (std::size_t i = 0; i < grid.count; ++i) {
      const float sine = dot(sun.up, grid.direction[i]);
      mean += weight[i] / total * std::min(std::max(dot(turned, grid.direction[i]), 0.0F) / sine, kMost);
    }
    out.upright[static_cast<std::size_t>(k)] = mean;
  }
  return {};
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_SUNNY_FACES_HPP
