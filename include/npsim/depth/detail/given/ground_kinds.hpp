// SPDX-License-Identifier: Apache-2.0
// Of what kind the ground is, by its look, for scenes without labels: smooth (road), rough (ballast), or green (soil).
//
// Asphalt is smooth, but for edges: ground counts as rough where every window near it is. Green is what is much greener
// than the ground usually is, and what is greener and hangs together with it, without small holes and specks: cameras
// have casts, which differ over the picture. Far away a pixel covers more of the ground than a stone, and what is rough
// there may be flecks of sun as well: there rough ground is what other ground before it is, as if the street went
// straight on.
// Pixels are those of a picture some 960 px wide; windows scale with the width.
// Cost: six means over windows of that picture, and two passes over 41 pixels at each. Memory: 8 planes of it.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_GROUND_KINDS_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_GROUND_KINDS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/given/reduced_picture.hpp"
#include "npsim/depth/detail/given/small_pieces.hpp"
#include "npsim/depth/detail/grow.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

[[nodiscard]] constexpr int ground_kinds_factor(Shape shape) noexcept { return std::max(1, (shape.width + 480) / 960); }

[[nodiscard]] constexpr std::size_t ground_kinds_workspace_bytes(Shape shape) noexcept {
  const Shape reduced = reduced_shape(shape, ground_kinds_factor(shape));
  const std::size_t pixels = reduced.pixels();
  return 5 * allocation_bytes<float>(pixels) + allocation_bytes<Label>(pixels) +
         allocation_bytes<std::uint32_t>(kQuantileBins) +
         max_of(kWindowMeanPlanes * allocation_bytes<float>(pixels), close_pieces_bytes(reduced)) + kWorkspaceAlignment;
}

// Where rough ground is too far to tell, what lies before it. kinds: reduced by `factor`.
template <class Executor>
void continue_kinds(const Intrinsics& camera, const GroundPlane& ground, int factor, ImageView<Label> kinds,
                    Executor& executor) {
  constexpr float kStonesSeen_m = 0.2F;  // of the ground in one pixel, away from the camera
  constexpr float kHorizon = -1e-3F;
  constexpr float kJustNearer = 0.95F;
  const float height_m = ground.camera_height_m;
  const Vec3f ahead = forward_on_ground(ground);
  if (!(ground.inlier_share > 0.0F && ahead.z > 0.5F && height_m > 0.0F)) return;
  // A row of pixels at depth z covers z * z * factor / (fy * height).
  const auto pixels = static_cast<float>(factor);
  const float far_m = std::sqrt(kStonesSeen_m * camera.fy / pixels * height_m);
  const auto ground_at = [&](int x, int y) {
    const Vec3f ray = unproject_pixel(camera, x * factor + factor / 2, y * factor + factor / 2, 1.0F);
    const float down = dot(ground.up, ray);
    return down < kHorizon ? ray * (height_m / -down) : Vec3f{};
  };
  for_pixels(kinds.shape(), executor, [&](int x, int y) {
    if (kinds(x, y) != label::rail_track) return;
    const Vec3f point = ground_at(x, y);
    if (!(point.z > far_m)) return;
    for (const float share : {kJustNearer, 0.8F, 0.65F, 0.5F}) {
      const Vec3f before = point - ahead * ((point.z - share * far_m) / ahead.z);
      const Vec2f at = project(camera, before);
      const float u = at.x / pixels;
      const float v = at.y / pixels;
      const auto last = static_cast<float>(kinds.width() - 1);
      if (!(std::isfinite(u) && v >= 0.0F && v < static_cast<float>(kinds.height()))) continue;
      // What never was in the picture is like its border, as far away as can be told.
      if (!(u >= 0.0F && u < last + 1.0F) && share < kJustNearer) continue;
      const int i = static_cast<int>(clamp_to(u, 0.0F, last));
      const int j = static_cast<int>(v);
      if (ground_at(i, j).z > far_m) continue;  // what is written is not read
      const Label kind = kinds(i, j);
      if (kind != label::road && kind != label::terrain) continue;
      kinds(x, y) = kind;
      return;
    }
  });
}

// labels: what is road becomes road, rail_track or terrain.
template <class Executor>
[[nodiscard]] Status tell_ground_kinds(ImageView<const Rgb8> image, const Intrinsics& camera, const GroundPlane& ground,
                                       ImageView<Label> labels, Workspace& workspace, Executor& executor) {
  constexpr Label kPerhaps = 255;
  constexpr float kRough = 0.2F;            // mean |log2| about the local mean; asphalt at .1, ballast at .6
  constexpr float kGreen = 0.45F;           // log2 of green over the mean of red and blue, above the camera's cast
  constexpr float kGreenish = 0.15F;        // beside what is green
  constexpr float kUsual = 0.25F;           // the share of the ground that tells the cast, which is not uniform
  constexpr float kGrey = 0.05F;            // where lawns are most of it: the least green is none
  constexpr float kCast = 0.55F;            // at most; raw-like pictures show asphalt at .5, and grass at 1
  constexpr float kDark = 1.5e-4F;          // half a step of 8 bits near black, added since there is no logarithm of 0
  constexpr float kWindow = 4.0F / 960.0F;  // of the width
  constexpr float kNear = 20.0F / 960.0F;
  constexpr std::size_t kSmall = 1000;  // that many pieces fill the picture
  const WorkspaceScope scope(workspace);
  const int factor = ground_kinds_factor(image.shape());
  const Shape shape = reduced_shape(image.shape(), factor);
  ImageView<float> log_y, greenness, mean, rough, green;
  ImageView<Label> kinds;
  Span<std::uint32_t> histogram;
  for (ImageView<float>* p : {&log_y, &greenness, &mean, &rough, &green}) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, *p));
  }
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, kinds));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kQuantileBins, histogram));
  for_pixels(shape, executor, [&](int x, int y) {
    const Vec3f c = mean_light(image, factor, x, y) + Vec3f{kDark, kDark, kDark};
    log_y(x, y) = log2_of(luminance(c));
    const float over_red = log2_of(c.y) - log2_of(c.x);  // paint that is yellow has less
    greenness(x, y) = std::min(0.5F * (over_red + log2_of(c.y) - log2_of(c.z)), 2.0F * over_red);
    kinds(x, y) = labels(middle_of(x, factor, labels.width()), middle_of(y, factor, labels.height()));
  });
  const auto scaled = [&](float share) {
    return std::max(1, static_cast<int>(share * static_cast<float>(shape.width) + 0.5F));
  };
  const int radius = scaled(kWindow);
  const int reach = scaled(kNear);
  const auto one = [](int, int) { return 1.0F; };
  NPSIM_RETURN_IF_ERROR(window_mean(one, log_y, radius, 0.0F, 0.0F, workspace, mean, executor));
  const auto off = [&](int x, int y) { return std::fabs(log_y(x, y) - mean(x, y)); };
  NPSIM_RETURN_IF_ERROR(window_mean(one, off, radius, 0.0F, 0.0F, workspace, rough, executor));
  NPSIM_RETURN_IF_ERROR(window_mean(one, greenness, radius, 0.0F, 0.0F, workspace, green, executor));
  const ImageView<float> least = mean;  // of roughness in the row nearby
  for_pixels(shape, executor, [&](int x, int y) {
    float low = rough(x, y);
    for (int u = std::max(x - reach, 0); u <= std::min(x + reach, shape.width - 1); ++u) {
      low = std::min(low, rough(u, y));
    }
    least(x, y) = low;
  });
  const auto on_ground = [&](int x, int y) { return kinds(x, y) == label::road; };
  const float least_green = plane_quantile(shape, on_ground, green, kGrey, histogram);
  const float usual_green = plane_quantile(shape, on_ground, green, kUsual, histogram);
  const float cast = clamp_to(std::min(usual_green, least_green + kGreenish), 0.0F, kCast);
  for_pixels(shape, executor, [&](int x, int y) {
    if (on_ground(x, y) && green(x, y) > cast + kGreenish) {
      kinds(x, y) = green(x, y) > cast + kGreen ? label::terrain : kPerhaps;
    }
  });
  depth_detail::grow(kinds, label::terrain, [](Label l) { return l == kPerhaps; });
  for_pixels(shape, executor, [&](int x, int y) {
    if (kinds(x, y) == kPerhaps) kinds(x, y) = label::road;
  });
  // Lawns have no holes of asphalt, nor it tufts of grass.
  const auto is_road = [](Label l) { return l == label::road; };
  const auto is_terrain = [](Label l) { return l == label::terrain; };
  const auto all = [](Label) { return true; };
  const std::size_t small = shape.pixels() / kSmall;
  NPSIM_RETURN_IF_ERROR(close_pieces(kinds, is_road, all, label::terrain, small, workspace));
  NPSIM_RETURN_IF_ERROR(close_pieces(kinds, is_terrain, all, label::road, small, workspace));
  for_pixels(shape, executor, [&](int x, int y) {
    if (!on_ground(x, y)) return;
    float low = least(x, y);
    for (int v = std::max(y - reach, 0); v <= std::min(y + reach, shape.height - 1); ++v) {
      low = std::min(low, least(x, v));
    }
    if (low > kRough) kinds(x, y) = label::rail_track;
  });
  continue_kinds(camera, ground, factor, kinds, executor);
  for_pixels(labels.shape(), executor, [&](int x, int y) {
    const Label kind = reduced_at(kinds, factor, x, y);
    if (labels(x, y) == label::road && (kind == label::terrain || kind == label::rail_track)) labels(x, y) = kind;
  });
  return {};
}

}  // namespace refine_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_GROUND_KINDS_HPP
