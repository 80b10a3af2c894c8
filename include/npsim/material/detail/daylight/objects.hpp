// SPDX-License-Identifier: Apache-2.0
// Things that move, told apart by their instance ids: the sun where each stands, how high it is, how bright.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_OBJECTS_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_OBJECTS_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/material/detail/albedo_scene.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

inline constexpr std::size_t kObjects = 256;    // told apart; what is more shares the first slot, which has no median
inline constexpr std::size_t kObjectBins = 96;  // of luminance or height
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
  [[nodiscard]] bool has_height(std::size_t object) const noexcept { return top_m[object] > bottom_m[object]; }
  // How far down an object a pixel of the photograph lies, 0 at its top and 1 at its bottom: by its height where that
  // is known, else by its working row.
  [[nodiscard]] float down(const AlbedoScene& s, std::size_t object, int x, int y, float row) const noexcept {
    if (has_height(object) && is_valid_depth(s.depth(x, y))) {
      return (top_m[object] - height_m(s, x, y)) / (top_m[object] - bottom_m[object]);
    }
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
    out.median[k] = out.bright[k] = Objects::kNoMedian;
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

// A histogram of bin(x, y, u, v) for each object's working pixels where counts(object, x, y, u, v); (u, v): in the
// photograph.
template <class Counts, class Bin>
void count_objects(const AlbedoScene& s, const Picture& picture, const Counts& counts, const Bin& bin, Objects& out) {
  for (std::uint32_t& v : out.histogram) v = 0;
  for (int y = 0; y < picture.shape().height; ++y) {
    for (int x = 0; x < picture.shape().width; ++x) {
      const int u = picture.middle_x(x, s.image.width());
      const int v = picture.middle_y(y, s.image.height());
      const std::size_t object = out.of(s, u, v);
      if (object == 0 || !counts(object, x, y, u, v)) continue;
      ++out.histogram[object * kObjectBins +
                      static_cast<std::size_t>(clamp_to(bin(x, y, u, v), 0.0F, static_cast<float>(kObjectBins - 1)))];
    }
  }
}

[[nodiscard]] inline std::uint32_t counted(const Objects& objects, std::size_t object) noexcept {
  std::uint32_t all = 0;
  for (std::size_t b = 0; b < kObjectBins; ++b) all += objects.histogram[object * kObjectBins + b];
  return all;
}

// Where `share` of what was counted of an object lies below, in bins; negative: nothing was counted.
[[nodiscard]] inline float object_quantile(const Objects& objects, std::size_t object, float share) noexcept {
  const auto wanted = share * static_cast<float>(counted(objects, object));
  std::uint32_t below = 0;
  for (std::size_t b = 0; b < kObjectBins && wanted > 0.0F; ++b) {
    below += objects.histogram[object * kObjectBins + b];
    if (static_cast<float>(below) >= wanted) return static_cast<float>(b) + 0.5F;
  }
  return -1.0F;
}

// Heights of the tops and bottoms of objects of which most was measured. What is as high over the ground plane as a car
// stands on it, though its foot be hidden or cut off; of all else, as on a slope, the lowest pixels are the bottom.
inline void heights_of_objects(const AlbedoScene& s, const Picture& picture, Objects& out) {
  constexpr float kLowest_m = -1.0F;
  constexpr float kPerMetre = 12.0F;
  constexpr float kLeast_m = 1.1F, kMost_m = 2.4F;
  constexpr float kTop = 0.98F, kBottom = 0.02F;  // quantiles
  if (s.depth.empty() || !(s.ground.inlier_share > 0.0F)) return;
  const auto measured = [&](std::size_t, int, int, int u, int v) { return is_valid_depth(s.depth(u, v)); };
  const auto bin = [&](int, int, int u, int v) { return (height_m(s, u, v) - kLowest_m) * kPerMetre; };
  count_objects(s, picture, measured, bin, out);
  for (std::size_t k = 1; k < kObjects; ++k) {
    if (!(static_cast<float>(counted(out, k)) > 0.5F * out.count[k])) continue;
    out.top_m[k] = kLowest_m + object_quantile(out, k, kTop) / kPerMetre;
    const bool stands = out.top_m[k] > kLeast_m && out.top_m[k] < kMost_m;
    out.bottom_m[k] = stands ? 0.0F : kLowest_m + object_quantile(out, k, kBottom) / kPerMetre;
  }
}

// Of log_y - light of the objects, of vehicles between panes and tyres, where heights tell these if they do anywhere.
inline void paint_of_objects(const AlbedoScene& s, const Picture& picture, Plane light, Objects& out) {
  constexpr float kFirst = -11.0F;
  constexpr float kPerOctave = 8.0F;
  constexpr float kBright = 0.65F;  // highlights are brighter
  const auto bin = [&](int x, int y, int, int) { return (picture.log_y(x, y) - light(x, y) - kFirst) * kPerOctave; };
  const auto counts = [&](std::size_t object, int x, int y, int u, int v) {
    if (out.has_height(object) && !is_valid_depth(s.depth(u, v))) return false;
    const float down = out.down(s, object, u, v, static_cast<float>(y));
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
