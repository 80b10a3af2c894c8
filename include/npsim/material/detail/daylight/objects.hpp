// SPDX-License-Identifier: Apache-2.0
// Things that move, told apart by their instance ids: where they stand, how high they are, how bright.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_OBJECTS_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_OBJECTS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/material/detail/daylight/ground_light.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

// Things that move, told apart by their instance ids: the sun where each stands, and its median luminance.
inline constexpr std::size_t kObjects = 256;    // told apart; what is more shares the first slot, which has no median
inline constexpr std::size_t kObjectBins = 96;  // of log2 luminance, 8 in an octave, from 2^-11
inline constexpr std::size_t kInstanceIds = 65536;
inline constexpr LabelSet kMovableLabels =
    kVehicleLabels | LabelSet::of(label::person, label::rider, label::dynamic_object);

struct Objects {
  Span<std::uint8_t> slot;  // by instance id
  Span<std::uint32_t> histogram;
  Span<float> sun;
  Span<float> count;
  Span<float> median;           // log2; kNoMedian: none
  Span<float> bright;           // log2; a third is brighter
  Span<int> top, bottom;        // rows of working pixels
  Span<float> top_m, bottom_m;  // heights above the ground; equal: not known

  static constexpr float kNoMedian = 1e30F;
  [[nodiscard]] std::size_t of(const AlbedoScene& s, int x, int y) const noexcept {
    if (s.labels.empty() || s.instances.empty() || !kMovableLabels.contains(s.labels(x, y))) return 0;
    return slot[s.instances(x, y)];
  }
  // How far down an object a working pixel lies, 0 at its top and 1 at its bottom: by its height where that is known.
  [[nodiscard]] float down(std::size_t object, float row, float above_m) const noexcept {
    if (top_m[object] > bottom_m[object]) return (top_m[object] - above_m) / (top_m[object] - bottom_m[object]);
    const auto rows = static_cast<float>(std::max(bottom[object] - top[object] + 1, 1));
    return (row + 0.5F - static_cast<float>(top[object])) / rows;
  }
};
// Of a vehicle's height, from its top: panes, then paint, then tyres and what is dark under the sills.
inline constexpr float kPanesFrom = 0.08F, kPanesTo = 0.38F, kTyresFrom = 0.78F;

inline constexpr std::size_t kObjectsBytes =
    allocation_bytes<std::uint8_t>(kInstanceIds) + allocation_bytes<std::uint32_t>(kObjects * kObjectBins) +
    6 * allocation_bytes<float>(kObjects) + 2 * allocation_bytes<int>(kObjects);

// Numbers the objects in the order in which rows meet them, and takes the mean of `sun` over each.
inline Status list_objects(const AlbedoScene& s, const Picture& picture, Plane sun, Workspace& workspace,
                           Objects& out) {
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kInstanceIds, out.slot));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kObjects * kObjectBins, out.histogram));
  for (Span<float>* v : {&out.sun, &out.count, &out.median, &out.bright, &out.top_m, &out.bottom_m}) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate(kObjects, *v));
  }
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kObjects, out.top));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kObjects, out.bottom));
  for (std::uint8_t& v : out.slot) v = 0;
  for (std::size_t k = 0; k < kObjects; ++k) {
    out.sun[k] = out.count[k] = 0.0F;
    out.median[k] = Objects::kNoMedian;
    out.top[k] = picture.shape().height;
    out.bottom[k] = 0;
    out.top_m[k] = out.bottom_m[k] = 0.0F;
  }
  if (s.labels.empty() || s.instances.empty()) return {};
  std::size_t next = 1;
  for (int y = 0; y < picture.shape().height; ++y) {
    for (int x = 0; x < picture.shape().width; ++x) {
      const int u = picture.middle_x(x, s.image.width());
      const int v = picture.middle_y(y, s.image.height());
      // Id 0 stands for what is not told apart, such as a row of parked cars.
      if (!kMovableLabels.contains(s.labels(u, v)) || s.instances(u, v) == 0) continue;
      std::uint8_t& slot = out.slot[s.instances(u, v)];
      if (slot == 0 && next < kObjects) slot = static_cast<std::uint8_t>(next++);
      out.sun[slot] += sun(x, y);
      out.count[slot] += 1.0F;
      out.top[slot] = std::min(out.top[slot], y);
      out.bottom[slot] = std::max(out.bottom[slot], y);
    }
  }
  for (std::size_t k = 0; k < kObjects; ++k) out.sun[k] /= std::max(out.count[k], 1.0F);
  return {};
}

// A histogram of bin(x, y) for each object's working pixels where counts(object, x, y).
template <class Counts, class Bin>
void count_objects(const AlbedoScene& s, const Picture& picture, const Counts& counts, const Bin& bin, Objects& out) {
  for (std::uint32_t& v : out.histogram) v = 0;
  for (int y = 0; y < picture.shape().height; ++y) {
    for (int x = 0; x < picture.shape().width; ++x) {
      const std::size_t object = out.of(s, picture.middle_x(x, s.image.width()), picture.middle_y(y, s.image.height()));
      if (object == 0 || !counts(object, x, y)) continue;
      ++out.histogram[object * kObjectBins +
                      static_cast<std::size_t>(clamp_to(bin(x, y), 0.0F, static_cast<float>(kObjectBins - 1)))];
    }
  }
}

// Where `share` of what was counted of an object lies below, in bins; negative: nothing was counted.
[[nodiscard]] inline float object_quantile(const Objects& objects, std::size_t object, float share) noexcept {
  const Span<const std::uint32_t> bins = objects.histogram.sub(object * kObjectBins, kObjectBins);
  std::uint32_t all = 0;
  for (const std::uint32_t n : bins) all += n;
  std::uint32_t below = 0;
  for (std::size_t b = 0; b < kObjectBins && all > 0; ++b) {
    below += bins[b];
    if (static_cast<float>(below) >= share * static_cast<float>(all)) return static_cast<float>(b) + 0.5F;
  }
  return -1.0F;
}

// Heights of the objects' tops and bottoms. What is hidden or cut at its foot begins at the ground plane, if that makes
// it as high as a car; on a slope the plane is off, and the lowest pixels count.
inline void heights_of_objects(const AlbedoScene& s, const Picture& picture, Objects& out) {
  constexpr float kLowest_m = -1.0F;
  constexpr float kPerMetre = 16.0F;
  constexpr float kLeast_m = 1.1F, kMost_m = 2.4F;
  constexpr float kTop = 0.98F, kBottom = 0.02F;  // quantiles
  if (s.depth.empty() || !(s.ground.inlier_share > 0.0F)) return;
  const auto measured = [&](std::size_t, int x, int y) {
    return is_valid_depth(s.depth(picture.middle_x(x, s.image.width()), picture.middle_y(y, s.image.height())));
  };
  const auto bin = [&](int x, int y) { return (working_height_m(s, picture, x, y) - kLowest_m) * kPerMetre; };
  count_objects(s, picture, measured, bin, out);
  for (std::size_t k = 1; k < kObjects; ++k) {
    const float top = object_quantile(out, k, kTop);
    if (top < 0.0F) continue;
    out.top_m[k] = kLowest_m + top / kPerMetre;
    const bool stands = out.top_m[k] > kLeast_m && out.top_m[k] < kMost_m;
    out.bottom_m[k] = stands ? 0.0F : kLowest_m + object_quantile(out, k, kBottom) / kPerMetre;
  }
}

// Of log_y - light of the objects, of vehicles between panes and tyres.
inline void paint_of_objects(const AlbedoScene& s, const Picture& picture, Plane light, Objects& out) {
  constexpr float kFirst = -11.0F;
  constexpr float kPerOctave = 8.0F;
  constexpr float kBright = 0.65F;  // highlights are brighter
  const auto bin = [&](int x, int y) { return (picture.log_y(x, y) - light(x, y) - kFirst) * kPerOctave; };
  const auto counts = [&](std::size_t object, int x, int y) {
    const float down = out.down(object, static_cast<float>(y), working_height_m(s, picture, x, y));
    return picture.region(x, y) != kVehicle || (down >= kPanesTo && down <= kTyresFrom);
  };
  count_objects(s, picture, counts, bin, out);
  for (std::size_t k = 1; k < kObjects; ++k) {
    const float middle = object_quantile(out, k, 0.5F);
    if (middle < 0.0F) continue;
    out.median[k] = kFirst + middle / kPerOctave;
    out.bright[k] = kFirst + object_quantile(out, k, kBright) / kPerOctave;
  }
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_OBJECTS_HPP
