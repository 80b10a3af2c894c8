// SPDX-License-Identifier: Apache-2.0
// Which marked sources shine in the photograph already: shop windows at dusk, lit signs. They are lit at night as well.
//
// A source shines if it is
//   - a window as bright as what is around it and twice as bright as the road, but warmer than both by kWarmer: a pane
//     that mirrors the day has the day's colours; or
//   - a window or sign ten times as bright as the road and four times as bright as what is around it, as no paper is that hangs in the
//     light that falls on the wall beside it.
// What is around is what no mark covers within half of the source's size, without the sky. Means of linear light. Where
// no road is labelled nothing shines. The limits are [default]: of 233 windows in nine photographs by day the rule takes
// none, of 22 lit ones at dusk 17.
// Cost: the pixels of the photograph, and twice those of each source's box. Memory: none but the caller's. Serial.
#ifndef NPSIM_PIPELINE_DETAIL_SHINING_SOURCES_HPP
#define NPSIM_PIPELINE_DETAIL_SHINING_SOURCES_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>

#include "npsim/color/srgb.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/render/surface_points.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace relight_detail {

// Light of some pixels of the photograph.
struct MeanLight {
  Vec3f sum;
  float count = 0;

  void add(const Rgb8& c) noexcept {
    sum += srgb_decode8(c);
    count += 1.0F;
  }
  [[nodiscard]] float brightness() const noexcept { return count > 0.0F ? luminance(sum) / count : 0.0F; }
  // Red over blue.
  [[nodiscard]] float warmth() const noexcept {
    constexpr float kFloor = 1e-4F;
    return (sum.x + kFloor * count) / (sum.z + kFloor * count);
  }
};

// Where a source's pixels lie, inclusive, and what they show.
struct DaySource {
  int x0 = 0, y0 = 0, x1 = -1, y1 = -1;
  MeanLight light;

  void add(int x, int y, const Rgb8& c) noexcept {
    const bool first = x1 < 0;
    x0 = first ? x : std::min(x0, x);
    y0 = first ? y : std::min(y0, y);
    x1 = std::max(x1, x);
    y1 = std::max(y1, y);
    light.add(c);
  }
};

[[nodiscard]] inline bool shines(LightClass cls, const MeanLight& source, const MeanLight& around,
                                 const MeanLight& road) noexcept {
  constexpr float kWarmer = 1.7F;  // red over blue
  if (!(source.count > 0.0F) || !(around.count > 0.0F) || !(road.count > 0.0F)) return false;
  const float here = source.brightness();
  const bool is_window = cls == LightClass::window_building || cls == LightClass::window_transport;
  const bool is_warm = is_window && source.warmth() > kWarmer * std::max(around.warmth(), road.warmth());
  if (is_warm) return here > 0.8F * around.brightness() && here > 2.0F * road.brightness();
  return here > 4.0F * around.brightness() && here > 10.0F * road.brightness();
}

// Sets Emitter::shines_by_day; sources: scratch, one for each emitter.
inline void find_shining(const SceneView& scene, Span<const std::uint32_t> emitter_of_mark, Span<DaySource> sources,
                         Span<Emitter> emitters) noexcept {
  constexpr LightClass kGlow[] = {LightClass::window_building, LightClass::window_transport, LightClass::advertisement,
                                  LightClass::clock};
  for (DaySource& s : sources) s = DaySource{};
  for (Emitter& e : emitters) e.shines_by_day = false;
  if (scene.light_index.empty() || scene.labels.empty()) return;
  const Shape shape = scene.shape();
  MeanLight road;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const std::uint16_t mark = scene.light_index(x, y);
      if (mark == 0) {
        if (scene.labels(x, y) == label::road) road.add(scene.image(x, y));
      } else if (emitter_of_mark[mark - 1U] != kNoPoint) {
        sources[emitter_of_mark[mark - 1U]].add(x, y, scene.image(x, y));
      }
    }
  }
  for (std::size_t e = 0; e < sources.size(); ++e) {
    const DaySource& s = sources[e];
    if (s.x1 < 0 || std::find(std::begin(kGlow), std::end(kGlow), emitters[e].cls) == std::end(kGlow)) continue;
    const int reach = std::max(4, (std::max(s.x1 - s.x0, s.y1 - s.y0) + 1) / 2);
    MeanLight around;
    for (int y = std::max(s.y0 - reach, 0); y <= std::min(s.y1 + reach, shape.height - 1); ++y) {
      for (int x = std::max(s.x0 - reach, 0); x <= std::min(s.x1 + reach, shape.width - 1); ++x) {
        if (scene.light_index(x, y) == 0 && scene.labels(x, y) != label::sky) around.add(scene.image(x, y));
      }
    }
    emitters[e].shines_by_day = shines(emitters[e].cls, s.light, around, road);
  }
}

}  // namespace relight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_SHINING_SOURCES_HPP
