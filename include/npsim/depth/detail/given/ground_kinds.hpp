// SPDX-License-Identifier: Apache-2.0
// Of what kind the ground is, by its look, for scenes without labels: smooth (road), rough (ballast), or green (soil).
//
// Asphalt is smooth, but for edges: ground counts as rough where every window near it is, and what lies within those
// windows belongs to it. Flecks of sun under trees are rough as well; but they lie flat, and are long along the rows of
// the picture and smooth inside, where stones are rough along the row too. So rough ground is ballast where it hangs
// together with such stones. Stones of little contrast, as under clouds, are not told. Green is what is much greener
// than the ground usually is, and what is greener and hangs together with it, without small holes and specks: cameras
// have casts, which differ over the picture.
// Pixels are those of a picture some 960 px wide; windows scale with the width.
// Cost: nine sums over windows of that picture, and two passes over 41 pixels at each for each of two planes. Memory:
// 9 planes of it.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_GROUND_KINDS_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_GROUND_KINDS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/given/reduced_picture.hpp"
#include "npsim/depth/detail/given/small_pieces.hpp"
#include "npsim/depth/detail/grow.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

[[nodiscard]] constexpr int ground_kinds_factor(Shape shape) noexcept { return std::max(1, (shape.width + 480) / 960); }

[[nodiscard]] constexpr std::size_t ground_kinds_workspace_bytes(Shape shape) noexcept {
  const Shape reduced = reduced_shape(shape, ground_kinds_factor(shape));
  const std::size_t pixels = reduced.pixels();
  return 6 * allocation_bytes<float>(pixels) + allocation_bytes<Label>(pixels) +
         allocation_bytes<std::uint32_t>(kQuantileBins) +
         max_of(kWindowMeanPlanes * allocation_bytes<float>(pixels), close_pieces_bytes(reduced)) + kWorkspaceAlignment;
}

// value becomes its least within `reach`, both ways. `rows` is scratch.
template <class Executor>
void least_within(int reach, ImageView<float> value, ImageView<float> rows, Executor& executor) {
  const Shape shape = value.shape();
  for_pixels(shape, executor, [&](int x, int y) {
    float low = value(x, y);
    for (int u = std::max(x - reach, 0); u <= std::min(x + reach, shape.width - 1); ++u) {
      low = std::min(low, value(u, y));
    }
    rows(x, y) = low;
  });
  for_pixels(shape, executor, [&](int x, int y) {
    float low = rows(x, y);
    for (int v = std::max(y - reach, 0); v <= std::min(y + reach, shape.height - 1); ++v) {
      low = std::min(low, rows(x, v));
    }
    value(x, y) = low;
  });
}

// labels: what is road becomes road, rail_track or terrain.
template <class Executor>
[[nodiscard]] Status tell_ground_kinds(ImageView<const Rgb8> image, ImageView<Label> labels, Workspace& workspace,
                                       Executor& executor) {
  constexpr Label kPerhaps = 255;
  // Means of |log2| about the local mean, and their least within kNear: asphalt has .1, ballast .2 to .6.
  constexpr float kRough = 0.2F;
  // The same about the mean of the window's row: asphalt has up to .22, ballast .4 to .5 where it is roughest; and what
  // hangs together with that: flecks of sun have .04 to .12.
  constexpr float kStones = 0.25F;
  constexpr float kSomeStones = 0.12F;
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
  ImageView<float> log_y, greenness, mean, rough, stones, green;
  ImageView<Label> kinds;
  Span<std::uint32_t> histogram;
  for (ImageView<float>* p : {&log_y, &greenness, &mean, &rough, &stones, &green}) {
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
  const ImageView<float> scratch = mean;
  for_pixels(shape, executor, [&](int x, int y) {
    const int first = std::max(x - radius, 0);
    const int last = std::min(x + radius, shape.width - 1);
    float sum = 0.0F;
    for (int u = first; u <= last; ++u) sum += log_y(u, y);
    scratch(x, y) = std::fabs(log_y(x, y) - sum / static_cast<float>(last - first + 1));
  });
  NPSIM_RETURN_IF_ERROR(window_mean(one, scratch, radius, 0.0F, 0.0F, workspace, stones, executor));
  NPSIM_RETURN_IF_ERROR(window_mean(one, greenness, radius, 0.0F, 0.0F, workspace, green, executor));
  least_within(reach, rough, scratch, executor);
  least_within(reach, stones, scratch, executor);
  const auto on_ground = [&](int x, int y) { return kinds(x, y) == label::road; };
  // What may be of a kind is of it where it hangs together with what is, else road.
  const auto decide = [&](Label kind) {
    depth_detail::grow(kinds, kind, [](Label l) { return l == kPerhaps; });
    for_pixels(shape, executor, [&](int x, int y) {
      if (kinds(x, y) == kPerhaps) kinds(x, y) = label::road;
    });
  };
  const float least_green = plane_quantile(shape, on_ground, green, kGrey, histogram);
  const float usual_green = plane_quantile(shape, on_ground, green, kUsual, histogram);
  const float cast = clamp_to(std::min(usual_green, least_green + kGreenish), 0.0F, kCast);
  for_pixels(shape, executor, [&](int x, int y) {
    if (on_ground(x, y) && green(x, y) > cast + kGreenish) {
      kinds(x, y) = green(x, y) > cast + kGreen ? label::terrain : kPerhaps;
    }
  });
  decide(label::terrain);
  // Lawns have no holes of asphalt, nor it tufts of grass.
  const auto is_road = [](Label l) { return l == label::road; };
  const auto is_terrain = [](Label l) { return l == label::terrain; };
  const auto all = [](Label) { return true; };
  const std::size_t small = shape.pixels() / kSmall;
  NPSIM_RETURN_IF_ERROR(close_pieces(kinds, is_road, all, label::terrain, small, workspace));
  NPSIM_RETURN_IF_ERROR(close_pieces(kinds, is_terrain, all, label::road, small, workspace));
  for_pixels(shape, executor, [&](int x, int y) {
    if (!on_ground(x, y) || !(rough(x, y) > kRough) || !(stones(x, y) > kSomeStones)) return;
    kinds(x, y) = stones(x, y) > kStones ? label::rail_track : kPerhaps;
  });
  decide(label::rail_track);
  // All within reach of a core is rough, as its least within that is.
  const auto is_core = [&](int x, int y) { return kinds(x, y) == label::rail_track ? 1.0F : 0.0F; };
  const ImageView<float> cores = rough;
  window_sum(is_core, reach, scratch, cores, executor);
  for_pixels(shape, executor, [&](int x, int y) {
    if (on_ground(x, y) && cores(x, y) > 0.5F) kinds(x, y) = label::rail_track;
  });
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
