// SPDX-License-Identifier: Apache-2.0
// Stripes on the road: what differs from the ground on both of its sides within some decimetres, across the street
// or along it, where most of what is narrow is long.
//
// Markings, rails and the joints beside them are narrow and long. Light and shadow hardly ever are: flecks of the sun
// are as short as they are narrow. Stripes say nothing of the lights that the ground lies in: white paint in one light
// is as far above asphalt as the sun is above its shadow.
// Cost: at most 128 samples a pixel and a window. The same bits for any thread count.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_STRIPES_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_STRIPES_HPP

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/material/albedo_scene.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

struct StripeParams {
  float reach_m = 0.6F;          // from paint to what is darker, on either side: markings are .1 to .5 m wide
  float joint_reach_m = 0.2F;    // from what is dark to what is brighter
  float surroundings_px = 8.0F;  // at 960 px width, over which flecks are told from stripes
  float border_px = 2.0F;        // at 960 px width
  float step = 0.6F;             // log2 of stripe over ground or of ground over stripe, at least
};

enum Narrow : std::uint8_t { kWide, kLong, kShort };

// stripe(x, y): 1 on stripes of the road, 0 elsewhere and where depth is not known. smooth_y: log2 of luminance without its noise.
template <class Executor>
Status find_stripes(const StripeParams& p, const AlbedoScene& s, const Picture& picture, Plane smooth_y,
                    Workspace& workspace, ImageView<std::uint8_t> stripe, Executor& executor) {
  constexpr int kSamples = 16;  // a side
  const Shape from = s.image.shape();
  const auto factor = static_cast<float>(picture.factor);
  // Where the street vanishes: its lines run towards this point.
  const Vec3f ahead = forward_on_ground(s.ground);
  const bool straight = !s.depth.empty() && ahead.z > 0.5F;
  const Vec2f vanishing = straight ? project(s.camera, ahead) : Vec2f{};
  for_pixels(picture.shape(), executor, [&](int x, int y) {
    stripe(x, y) = kWide;
    if (!straight || picture.region(x, y) != kRoad) return;
    const float z = s.depth(picture.middle_x(x, from.width), picture.middle_y(y, from.height));
    const float below = static_cast<float>(y) + 0.5F - vanishing.y / factor;
    if (!is_valid_depth(z) || !(below > 1.0F)) return;
    const float own = smooth_y(x, y);
    // Whether within reach, in steps of (du, dv), lies ground that the pixel is brighter than (sign 1) or darker (-1).
    const auto differs = [&](float du, float dv, int reach, float sign) {
      const int stride = 1 + reach / kSamples;
      for (int k = stride; k <= reach; k += stride) {
        const int u = x + static_cast<int>(std::lround(static_cast<float>(k) * du));
        const int v = y + static_cast<int>(std::lround(static_cast<float>(k) * dv));
        if (!stripe.contains(u, v)) return sign > 0.0F;  // a marking at the border goes on
        if (!picture.is_ground(u, v)) return false;
        if (sign * (own - smooth_y(u, v)) > p.step) return true;
      }
      return false;
    };
    const float aside = (static_cast<float>(x) + 0.5F - vanishing.x / factor) / below;  // columns for each row
    for (const float sign : {1.0F, -1.0F}) {
      const float reach_m = sign > 0.0F ? p.reach_m : p.joint_reach_m;
      // Working pixels that the reach covers on level ground, across the picture and along the street.
      const float px = std::min(reach_m * s.camera.fx / (z * factor), static_cast<float>(from.width));
      const float rows = std::min(reach_m * s.camera.fy * s.ground.camera_height_m / (z * z * factor), below);
      const int across = 1 + static_cast<int>(px);
      const int along = 1 + static_cast<int>(rows);
      const bool narrow = differs(-1, 0, across, sign) && differs(1, 0, across, sign);
      const bool shallow = differs(-aside, -1, along, sign) && differs(aside, 1, along, sign);
      if (narrow || shallow) stripe(x, y) = narrow && shallow ? kShort : kLong;
    }
  });
  const WorkspaceScope scope(workspace);
  Plane mean;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(picture.shape(), mean));
  const auto narrow = [&](int x, int y) { return stripe(x, y) != kWide ? 1.0F : 0.0F; };
  const auto is_long = [&](int x, int y) { return stripe(x, y) == kLong ? 1.0F : 0.0F; };
  NPSIM_RETURN_IF_ERROR(
      window_mean(narrow, is_long, picture.radius(p.surroundings_px), 0.0F, 0.0F, workspace, mean, executor));
  for_pixels(picture.shape(), executor,
             [&](int x, int y) { stripe(x, y) = stripe(x, y) != kWide && mean(x, y) > 0.5F ? kLong : kWide; });
  // Its blurred border is between paint and ground.
  const auto one = [](int, int) { return 1.0F; };
  NPSIM_RETURN_IF_ERROR(window_mean(one, is_long, picture.radius(p.border_px), 0.0F, 0.0F, workspace, mean, executor));
  for_pixels(picture.shape(), executor, [&](int x, int y) { stripe(x, y) = mean(x, y) > 1e-3F ? 1 : 0; });
  return {};
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_STRIPES_HPP
