// SPDX-License-Identifier: Apache-2.0
// Daylight on what stands on the ground: facades, plants, vehicles, people.
//
// Facades and plants: the class's faces of one direction share their light over the whole picture, and neighbours that
// face alike share it more. Of both means, over the class's median, the larger part is divided out; the rest is the
// albedo of whole houses.
// Vehicles, people and other objects vary too much in albedo to tell it from light. Their light is that of the place
// where they stand: of the ground below them, as faces of their direction receive it (sunny_faces.hpp). So a black car
// stays black, and one in the shadow is as bright as one in the sun.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_STANDING_LIGHT_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_STANDING_LIGHT_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/material/detail/daylight/ground_light.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

struct StandingLightParams {
  float smooth_px = 128.0F;  // at 960 px width
  float share = 0.4F;        // of the smooth part that is light
  float wide_px = 512.0F;
  float wide_share = 0.7F;   // of the mean of a direction
  float sunny_share = 0.5F;  // of both shares, where the sun on walls is known already
  float place_px = 24.0F;
  // What stands in the shadow may rise out of it: between these heights its light becomes that of the sun.
  float low_m = 1.5F;
  float high_m = 4.5F;
  // log2 of the light of upright faces over that of level ground, where no shadow shows the sun. Under clouds, which it
  // then counts as, .40 of the sky's (CIE overcast) and what the ground throws back; where light is left alone, as on a
  // sunny day.
  float upright = -0.5F;
  float upright_cloudy = -1.15F;
};

// Directions by which facades are told apart: left, right, towards the camera, up and the corners between.
inline constexpr int kFacings = 5;
[[nodiscard]] inline float facing_weight(const Vec3f& normal, int facing) noexcept {
  constexpr float kHalf = 0.70710678F;
  constexpr Vec3f kAxes[kFacings] = {{-1, 0, 0}, {-kHalf, 0, -kHalf}, {0, 0, -1}, {kHalf, 0, -kHalf}, {1, 0, 0}};
  const float c = dot(normal, kAxes[facing]);
  if (!(c > 0.0F)) return 0.0F;
  const float c2 = c * c;
  return c2 * c2 * c2;
}

// level(x, y) of one region = the smooth part of `seen` among neighbours that face alike, about `median`.
template <class Seen, class Normal, class Executor>
Status smooth_by_facing(const Picture& picture, std::uint8_t region, float length_px, const Seen& seen, float median,
                        const Normal& normal, Workspace& workspace, Plane level, Executor& executor) {
  const WorkspaceScope scope(workspace);
  const Shape shape = picture.shape();
  Plane weight, mean, total;
  for (Plane* plane : {&weight, &mean, &total}) NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, *plane));
  for_pixels(shape, executor, [&](int x, int y) {
    if (picture.region(x, y) != region) return;
    level(x, y) = 0.0F;
    total(x, y) = 0.0F;
  });
  const int radius = picture.radius(0.5F * length_px);
  const float prior = 0.01F * static_cast<float>((2 * radius + 1) * (2 * radius + 1));
  const auto value = [&](int x, int y) { return clamp_to(seen(x, y) - median, -4.0F, 3.0F); };
  for (int facing = 0; facing < kFacings; ++facing) {
    const auto own = [&](int x, int y) {
      return picture.region(x, y) == region ? 0.05F + facing_weight(normal(x, y), facing) : 0.0F;
    };
    NPSIM_RETURN_IF_ERROR(window_mean(own, value, radius, prior, 0.0F, workspace, mean, executor));
    for_pixels(shape, executor, [&](int x, int y) {
      const float w = own(x, y);
      if (!(w > 0.0F)) return;
      level(x, y) += w * mean(x, y);
      total(x, y) += w;
    });
  }
  for_pixels(shape, executor, [&](int x, int y) {
    if (picture.region(x, y) == region) level(x, y) /= total(x, y);
  });
  return {};
}

// Share of the sun at the place where each pixel's object stands: of the ground around the next ground below.
template <class Executor>
Status place_sun(const StandingLightParams& p, const Picture& picture, const GroundLight& ground, Workspace& workspace,
                 Plane out, Executor& executor) {
  const WorkspaceScope scope(workspace);
  const Shape shape = picture.shape();
  Plane around;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, around));
  const auto is_ground = [&](int x, int y) { return picture.is_ground(x, y) ? 1.0F : 0.0F; };
  const auto sun = [&](int x, int y) { return ground.sun(x, y); };
  const float rest = sunlit_share(picture, ground);
  NPSIM_RETURN_IF_ERROR(
      window_mean(is_ground, sun, picture.radius(p.place_px), 1.0F, rest, workspace, around, executor));
  executor.for_chunks(static_cast<std::size_t>(shape.width), kWindowColumns, [&](std::size_t begin, std::size_t end) {
    for (std::size_t column = begin; column < end; ++column) {
      const int x = static_cast<int>(column);
      float carried = around(x, shape.height - 1);
      for (int y = shape.height - 1; y >= 0; --y) {
        if (picture.is_ground(x, y)) carried = around(x, y);
        out(x, y) = carried;
      }
    }
  });
  return {};
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_STANDING_LIGHT_HPP
