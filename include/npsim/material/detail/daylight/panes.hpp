// SPDX-License-Identifier: Apache-2.0
// How much of what a car shows is panes.
//
// Panes lie in a band below the roof, by height over the ground where that is known: bonnet, boot and doors lie lower.
// In the band they differ from the paint. What is darker than most of it is glass. What is brighter may be glass that
// mirrors the sky, a tenth of it or two, but only on dark paint: light paint outshines that, and what is brighter than
// its doors is a roof or a shoulder that faces the sky. So the brighter third of the paint is what counts there. Both
// make log odds, which neighbours share that no edge of the picture parts (mean_field()); place alone makes no pane.
// Between bumper and mirror a real car is all edges: pieces that edges bound, taken one by one, part nothing.
// Cost: some 100 loops over the picture where it shows cars. The same bits for any thread count.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_PANES_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_PANES_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/material/detail/albedo_scene.hpp"
#include "npsim/material/detail/daylight/mean_field.hpp"
#include "npsim/material/detail/daylight/objects.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

struct PaneParams {
  MeanFieldParams field;
  float place = 2.5F;     // log odds in the middle of the band of panes
  float kind = 3.5F;      // of what differs from the paint; as much less for what does not
  float mirrors = -1.2F;  // log2 of the albedo of paint; half of that and darker: panes may outshine it

  PaneParams() noexcept { field.epsilon = 0.05F; }
};

// How sure it is that what is so much darker or brighter than paint, in log2, is none: 0 for what its shading explains.
[[nodiscard]] inline float is_no_paint(float by) noexcept {
  constexpr float kAlike = 0.4F, kUnlike = 0.8F;
  return clamp_to((by - kAlike) / (kUnlike - kAlike), 0.0F, 1.0F);
}

inline constexpr std::size_t kPanePlanes = 1 + kMeanFieldPlanes;  // and one of bytes

// pane(x, y): share of panes in what is seen, 0..1; 0 but for cars that are told apart. light: log2 of luminance over
// albedo.
template <class Executor>
Status find_panes(const PaneParams& p, const AlbedoScene& s, const Picture& picture, const Objects& objects,
                  Plane light, Workspace& workspace, Plane pane, Executor& executor) {
  constexpr float kLeast = -5.0F;
  constexpr float kMiddle = 0.5F * (kPanesFrom + kPanesTo), kHalf = 0.5F * (kPanesTo - kPanesFrom);
  const WorkspaceScope scope(workspace);
  Plane odds;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(picture.shape(), odds));
  ImageView<std::uint8_t> car_at;  // its object; 0: no car, or none of those that are told apart
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(picture.shape(), car_at));
  for_pixels(picture.shape(), executor, [&](int x, int y) {
    pane(x, y) = 0.0F;
    const int u = picture.middle_x(x, s.image.width());
    const int v = picture.middle_y(y, s.image.height());
    const bool is_car = !s.labels.empty() && s.labels(u, v) == label::car;
    const std::size_t car = is_car ? objects.of(s, u, v) : 0;
    car_at(x, y) = objects.median[car] < Objects::kNoMedian ? static_cast<std::uint8_t>(car) : std::uint8_t{0};
    if (car_at(x, y) == 0) return;
    const float down = objects.down(s, car, u, v, static_cast<float>(y));
    const float off = (down - kMiddle) / kHalf;
    const float seen = picture.log_y(x, y) - light(x, y);
    const float brighter =
        is_no_paint(seen - objects.bright[car]) * clamp_to(p.mirrors - objects.bright[car], 0.0F, 1.0F);
    const float differs = std::max(is_no_paint(objects.median[car] - seen), brighter);
    odds(x, y) = std::max(kLeast, p.place * (1.0F - off * off)) + p.kind * (2.0F * differs - 1.0F);
    pane(x, y) = logistic(odds(x, y));
  });
  const auto inside = [&](int x, int y) { return car_at(x, y) != 0; };
  bool any = false;
  for (int y = 0; y < picture.shape().height && !any; ++y) {
    for (int x = 0; x < picture.shape().width && !any; ++x) any = inside(x, y);
  }
  if (!any) return {};
  return mean_field(p.field, inside, picture.log_y, odds, picture, workspace, pane, executor);
}

// log2 albedo of a car's pixel: panes are dark whatever they mirror, and so is what is darker than paint towards the
// bottom, tyres and the gap under the sills.
[[nodiscard]] inline float paint_or_glass(float log_albedo, float paint, float down, float pane) noexcept {
  constexpr float kDarkParts = -4.6F;  // log2 of .04
  const float tyres = is_no_paint(paint - log_albedo) * clamp_to((down - kTyresFrom) / (1.0F - kTyresFrom), 0.0F, 1.0F);
  const float dark = std::min(kDarkParts, paint);
  return log_albedo + std::max(pane, tyres) * (dark - log_albedo);
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_PANES_HPP
