// SPDX-License-Identifier: Apache-2.0
// Stripes on the road: what is narrow and long on the ground, and brighter than it on both sides, or darker.
//
// Markings, rails and the joints beside them are .1 to .5 m wide and metres long. Light and shadow hardly ever are:
// flecks of the sun are short as well. Stripes say nothing of the lights that the ground lies in: white paint in one
// light is as far above asphalt as the sun is above its shadow. The shadow of a pole is taken for a joint where it is
// as narrow as one.
// A pixel is a stripe where the span until the ground differs by `step` is at most width_m, across the picture or away
// from the camera, and at least length_m in some direction on the ground. Beyond the picture nothing is known to
// differ.
// Heads of arrows and crossings seen askew are wider: a bright piece of the road that is stripes more than plain is
// one as a whole (grow_stripes).
// Cost: at most 64 samples a pixel of the road, and 600 where it is narrow. The same bits for any thread count.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_STRIPES_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_STRIPES_HPP

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/material/detail/albedo_scene.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

struct StripeParams {
  float width_m = 0.6F;        // of paint, at most
  float joint_width_m = 0.2F;  // of what is darker than the ground, at most
  float length_m = 1.6F;       // at least
  float border_px = 2.0F;      // at 960 px width: a stripe's blurred border is between it and the ground
  float step = 0.6F;           // log2 of stripe over ground or of ground over stripe, at least
};

// Ground around one pixel of the road, as if it were level from there on.
class GroundAround {
 public:
  GroundAround(const AlbedoScene& s, const Picture& picture, Vec2f vanishing, Plane smooth_y, int x, int y,
               float z) noexcept
      : picture_(picture),
        smooth_y_(smooth_y),
        vanishing_(vanishing),
        aside_(static_cast<float>(x) + 0.5F - vanishing.x),
        below_(static_cast<float>(y) + 0.5F - vanishing.y),
        z_(z),
        px_m_(s.camera.fx / static_cast<float>(picture.factor)),
        own_(smooth_y(x, y)) {}

  // How far in a direction (across, away) the ground differs: sign 1, is darker; -1, is brighter. Above most_m: nowhere
  // nearer, or it ends before.
  [[nodiscard]] float differs_at(Vec2f direction, float most_m, float step_m, float sign, float step) const noexcept {
    for (float t = step_m; t <= most_m; t += step_m) {
      const float z = z_ + t * direction.y;
      if (!(z > 0.1F * z_)) break;
      const float u = vanishing_.x + (aside_ * z_ + px_m_ * t * direction.x) / z;
      const float v = vanishing_.y + below_ * z_ / z;
      if (!(u >= 0.0F && v >= 0.0F && u < static_cast<float>(smooth_y_.width()) &&
            v < static_cast<float>(smooth_y_.height()))) {
        break;
      }
      const auto i = static_cast<int>(u);
      const auto j = static_cast<int>(v);
      if (!picture_.is_ground(i, j)) break;
      if (sign * (own_ - smooth_y_(i, j)) > step) return t;
    }
    return kNowhere;
  }
  [[nodiscard]] bool narrower(Vec2f direction, float width_m, float sign, float step) const noexcept {
    const float step_m = width_m / 16.0F;
    const float ahead = differs_at(direction, width_m, step_m, sign, step);
    return ahead < width_m && differs_at({-direction.x, -direction.y}, width_m - ahead, step_m, sign, step) < kNowhere;
  }
  [[nodiscard]] bool longer(Vec2f direction, float length_m, float sign, float step) const noexcept {
    const float step_m = length_m / 16.0F;
    const float ahead = differs_at(direction, length_m, step_m, sign, step);
    if (ahead > length_m) return true;
    return differs_at({-direction.x, -direction.y}, length_m - ahead, step_m, sign, step) > length_m;
  }

 private:
  static constexpr float kNowhere = 1e30F;
  const Picture& picture_;
  Plane smooth_y_;
  Vec2f vanishing_;  // where level ground ends straight ahead, working pixels
  float aside_, below_;
  float z_;
  float px_m_;
  float own_;
};

// Of a pixel: brighter than the ground beside it, darker, or beside one of these; 0: no stripe.
inline constexpr std::uint8_t kBrightStripe = 1, kDarkStripe = 2, kStripeBorder = 3;

// What is beside a stripe.
template <class Executor>
Status mark_stripe_borders(const StripeParams& p, const Picture& picture, Workspace& workspace,
                           ImageView<std::uint8_t> stripe, Executor& executor) {
  const WorkspaceScope scope(workspace);
  Plane rows, near;
  for (Plane* plane : {&rows, &near}) NPSIM_RETURN_IF_ERROR(workspace.allocate_image(picture.shape(), *plane));
  const auto is_stripe = [&](int x, int y) { return stripe(x, y) != 0 && stripe(x, y) != kStripeBorder ? 1.0F : 0.0F; };
  window_sum(is_stripe, picture.radius(p.border_px), rows, near, executor);
  for_pixels(picture.shape(), executor, [&](int x, int y) {
    if (stripe(x, y) == 0 && near(x, y) > 0.5F) stripe(x, y) = kStripeBorder;
  });
  return {};
}

// Makes stripes of the pieces of bright road that have more pixels on bright stripes than on plain ground, borders of
// stripes aside; `grown` becomes true where one changes. Serial. bright(x, y): of road.
template <class Bright, class Executor>
Status grow_stripes(const StripeParams& p, const Picture& picture, const Bright& bright, Workspace& workspace,
                    ImageView<std::uint8_t> stripe, bool& grown, Executor& executor) {
  const WorkspaceScope scope(workspace);
  const Shape shape = picture.shape();
  ImageView<std::uint8_t> open;
  Span<std::uint32_t> list;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, open));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), list));
  for_pixels(shape, executor, [&](int x, int y) { open(x, y) = bright(x, y) ? 1 : 0; });
  grown = false;
  for_pieces(open, list, [&](Span<const std::uint32_t> piece) {
    std::size_t painted = 0, plain = 0;
    for (const std::uint32_t i : piece) {
      const std::uint8_t kind = stripe(place_of(i, shape.width));
      painted += kind == kBrightStripe ? 1U : 0U;
      plain += kind == 0 ? 1U : 0U;
    }
    if (painted <= plain || plain == 0) return;
    for (const std::uint32_t i : piece) stripe(place_of(i, shape.width)) = kBrightStripe;
    grown = true;
  });
  return grown ? mark_stripe_borders(p, picture, workspace, stripe, executor) : Status();
}

// stripe(x, y): of the road; 0 elsewhere and where depth is not known. smooth_y: log2 of luminance without
// its noise.
template <class Executor>
Status find_stripes(const StripeParams& p, const AlbedoScene& s, const Picture& picture, Plane smooth_y,
                    Workspace& workspace, ImageView<std::uint8_t> stripe, Executor& executor) {
  // Every 10 degrees: a line .15 m wide stays within itself for 1.7 m at half of that.
  constexpr float kCos = 0.98480775F, kSin = 0.17364818F;
  std::array<Vec2f, 18> directions;
  directions[0] = {1.0F, 0.0F};
  for (std::size_t i = 1; i < directions.size(); ++i) {
    const Vec2f before = directions[i - 1];
    directions[i] = {kCos * before.x - kSin * before.y, kSin * before.x + kCos * before.y};
  }
  const Shape from = s.image.shape();
  const Vec3f ahead = forward_on_ground(s.ground);
  const bool level = !s.depth.empty() && ahead.z > 0.5F;
  const Vec2f far = level ? project(s.camera, ahead) : Vec2f{};
  const auto factor = static_cast<float>(picture.factor);
  const Vec2f vanishing{far.x / factor, far.y / factor};
  for_pixels(picture.shape(), executor, [&](int x, int y) {
    stripe(x, y) = 0;
    if (!level || picture.region(x, y) != kRoad) return;
    const float z = s.depth(picture.middle_x(x, from.width), picture.middle_y(y, from.height));
    if (!is_valid_depth(z)) return;
    const GroundAround ground(s, picture, vanishing, smooth_y, x, y, z);
    for (const float sign : {1.0F, -1.0F}) {
      const float width_m = sign > 0.0F ? p.width_m : p.joint_width_m;
      const bool narrow =
          ground.narrower({1, 0}, width_m, sign, p.step) || ground.narrower({0, 1}, width_m, sign, p.step);
      if (!narrow) continue;
      for (const Vec2f& direction : directions) {
        if (!ground.longer(direction, p.length_m, sign, p.step)) continue;
        stripe(x, y) = sign > 0.0F ? kBrightStripe : kDarkStripe;
        return;
      }
    }
  });
  return mark_stripe_borders(p, picture, workspace, stripe, executor);
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_STRIPES_HPP
