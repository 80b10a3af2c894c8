// SPDX-License-Identifier: Apache-2.0
// Which marked sources shine in the photograph already: shop windows at dusk, lit signs. They are lit at night as well.
//
// A source shines if it is
//   - a window that is brighter than nine tenths of the surfaces that the photograph shows, lamps aside, and four times
//     as bright as the road, but redder by kRedder than what is around it and than the road. A pane that mirrors the
//     day has its colours, or shows less of a sunny wall than the picture does; blinds are darker than white walls; or
//   - a window or sign ten times as bright as the road and four times as bright as what is around it, as no paper is
//     that hangs in the light that falls on the wall beside it.
// What is around are surfaces that no lamp's mark covers within half of the source's size. Means of linear light. Where
// no road is labelled nothing shines. Limits are [default]: of 233 windows in nine photographs by day the
// rule takes none, of those of one at dusk the clearer half of the lit ones and no other.
// Cost: the pixels of the photograph, and those of each source's box, grown. Memory: the caller's, and 4 KiB of
// the stack. Serial.
#ifndef NPSIM_PIPELINE_DETAIL_SHINING_SOURCES_HPP
#define NPSIM_PIPELINE_DETAIL_SHINING_SOURCES_HPP

#include <algorithm>
#include <cmath>
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
  double red = 0, blue = 0, luminance = 0, count = 0;

  void add(const Vec3f& light) noexcept {
    red += static_cast<double>(light.x);
    blue += static_cast<double>(light.z);
    luminance += static_cast<double>(npsim::luminance(light));
    count += 1.0;
  }
  [[nodiscard]] double brightness() const noexcept { return count > 0.0 ? luminance / count : 0.0; }
  [[nodiscard]] double redness() const noexcept {
    constexpr double kFloor = 1e-4;
    return (red + kFloor * count) / (blue + kFloor * count);
  }
};

// Where a source's pixels lie, inclusive, and what they show.
struct DaySource {
  int x0 = 0, y0 = 0, x1 = -1, y1 = -1;
  MeanLight light;

  void add(int x, int y, const Vec3f& seen) noexcept {
    const bool first = x1 < 0;
    x0 = first ? x : std::min(x0, x);
    y0 = first ? y : std::min(y0, y);
    x1 = std::max(x1, x);
    y1 = std::max(y1, y);
    light.add(seen);
  }
};

// Of the surfaces that the photograph shows, lamps aside.
struct DaySurfaces {
  MeanLight road;
  double bright = 0;  // luminance that nine tenths of the pixels stay below
};

[[nodiscard]] inline bool shines(LightClass cls, const MeanLight& source, const MeanLight& around,
                                 const DaySurfaces& all) noexcept {
  constexpr double kRedder = 1.7;  // red over blue
  if (!(source.count > 0.0) || !(around.count > 0.0) || !(all.road.count > 0.0)) return false;
  const double here = source.brightness();
  const double road = all.road.brightness();
  const bool is_window = cls == LightClass::window_building || cls == LightClass::window_transport;
  if (is_window && source.redness() > kRedder * std::max(around.redness(), all.road.redness())) {
    return here > all.bright && here > 4.0 * road;
  }
  return here > 4.0 * around.brightness() && here > 10.0 * road;
}

// Sets Emitter::shines_by_day of those that do; sources: scratch, one for each emitter.
inline void find_shining(const SceneView& scene, Span<const std::uint32_t> emitter_of_mark, Span<DaySource> sources,
                         Span<Emitter> emitters) noexcept {
  constexpr LightClass kGlow[] = {LightClass::window_building, LightClass::window_transport, LightClass::advertisement,
                                  LightClass::clock};
  constexpr std::size_t kBins = 1024;  // of the root of luminance
  for (DaySource& s : sources) s = DaySource{};
  if (scene.light_index.empty() || scene.labels.empty()) return;
  const Shape shape = scene.shape();
  const auto emitter_at = [&](int x, int y) {
    const std::uint16_t mark = scene.light_index(x, y);
    return mark == 0 ? kNoPoint : emitter_of_mark[mark - 1U];
  };
  // The wall between the windows of a group is marked as the group's.
  const auto is_surface = [&](int x, int y) {
    const std::uint16_t mark = scene.light_index(x, y);
    return (mark == 0 || is_group(scene.lights[mark - 1U].cls)) && !kNoSurfaceLabels.contains(scene.labels(x, y));
  };
  DaySurfaces all;
  std::uint32_t bins[kBins] = {};
  std::uint64_t surfaces = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const Vec3f seen = srgb_decode8(scene.image(x, y));
      const std::uint32_t e = emitter_at(x, y);
      if (e != kNoPoint) sources[e].add(x, y, seen);
      if (!is_surface(x, y)) continue;
      if (scene.labels(x, y) == label::road) all.road.add(seen);
      const float root = std::sqrt(luminance(seen));
      ++bins[std::min(static_cast<std::size_t>(root * static_cast<float>(kBins)), kBins - 1)];
      ++surfaces;
    }
  }
  std::uint64_t below = 0;
  for (std::size_t i = 0; i < kBins && 10 * below < 9 * surfaces; ++i) {
    below += bins[i];
    const double root = (static_cast<double>(i) + 0.5) / static_cast<double>(kBins);
    all.bright = root * root;
  }
  for (std::size_t e = 0; e < sources.size(); ++e) {
    const DaySource& s = sources[e];
    if (s.x1 < 0 || std::find(std::begin(kGlow), std::end(kGlow), emitters[e].cls) == std::end(kGlow)) continue;
    const int reach = std::max(4, (std::max(s.x1 - s.x0, s.y1 - s.y0) + 1) / 2);
    MeanLight around;
    for (int y = std::max(s.y0 - reach, 0); y <= std::min(s.y1 + reach, shape.height - 1); ++y) {
      for (int x = std::max(s.x0 - reach, 0); x <= std::min(s.x1 + reach, shape.width - 1); ++x) {
        if (is_surface(x, y)) around.add(srgb_decode8(scene.image(x, y)));
      }
    }
    if (shines(emitters[e].cls, s.light, around, all)) emitters[e].shines_by_day = true;
  }
}

}  // namespace relight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_SHINING_SOURCES_HPP
