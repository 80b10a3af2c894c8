// SPDX-License-Identifier: Apache-2.0
// How far away the lamps of a light-index plane are: regions, a robust distance for each, and street lamps.
//
// region_depth() is the median of z over the region without outliers (3 sigma by the quartiles, at least 2 %), from the
// first of these sets that has samples: certain surface pixels, all surface pixels, then the same in growing
// surroundings. Pixels labelled sky or ego vehicle, and depths outside 0.05 m to 100 km, never count. The median of at
// most kMaxRegionSamples pixels, taken evenly in raster order, stands for that of larger regions. 0 where nothing was
// found. Breakdown point: one half; fewer than half wrong pixels move the result by less than the spread of the right
// ones.
//
// A street lamp's head hangs before the sky, where neither stereo nor networks know the depth. Candidates in order; the
// first that puts the lamp at a credible height above the ground (2 to 16 m) wins:
//   1. the head's own pixels that are labelled as an object (pole, sign, static), certain ones first;
//   2. the pole below: the nearest run of pole pixels under the head, in a band that leaves room for the arm;
//   3. the foot of that pole: where its lowest pixel's ray meets the ground plane;
//   4. any surface pixel of the head (a facade behind it, or no labels), the nearer quarter of them;
//   5. none: the distance at which the head hangs default_height_m above the ground (lamps on wires), if it lies above
//      the horizon.
// The sky's depth is never used. 0 where even the last fails.
#ifndef NPSIM_LIGHT_DETAIL_LAMP_DEPTH_HPP
#define NPSIM_LIGHT_DETAIL_LAMP_DEPTH_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr std::size_t kMaxRegionSamples = 4096;
inline constexpr float kMinLightDepth = 0.05F;  // m; depths outside are taken for errors, and keep squares finite
inline constexpr float kMaxLightDepth = 1e5F;

// Pixels that carry one value of the index plane.
struct LightRegion {
  int x0 = 0, y0 = 0, x1 = -1, y1 = -1;  // bounding box, inclusive
  std::uint32_t pixels = 0;
  double sum_x = 0, sum_y = 0;  // of pixel centres

  [[nodiscard]] constexpr double mean_x() const noexcept { return sum_x / pixels; }
  [[nodiscard]] constexpr double mean_y() const noexcept { return sum_y / pixels; }
  // Share of the bounding box that belongs to the region.
  [[nodiscard]] constexpr float fill() const noexcept {
    const double box = static_cast<double>(x1 - x0 + 1) * static_cast<double>(y1 - y0 + 1);
    return static_cast<float>(static_cast<double>(pixels) / box);
  }
};

struct RegionInput {
  ImageView<const std::uint16_t> light_index;
  ImageView<const float> depth;
  ImageView<const Label> labels;            // may be empty
  ImageView<const std::uint8_t> uncertain;  // may be empty
};

struct StreetLampParams {
  float min_height_m = 2.0F;  // credible mounting heights above the ground
  float max_height_m = 16.0F;
  float default_height_m = 8.0F;
  float max_distance_m = 300.0F;
  float arm_m = 3.0F;  // reach of an arm, which bounds the search for the pole to either side
};

namespace light_detail {

[[nodiscard]] inline Status measure_regions(ImageView<const std::uint16_t> index, Span<LightRegion> regions) noexcept {
  for (LightRegion& r : regions) r = LightRegion{};
  for (int y = 0; y < index.height(); ++y) {
    for (int x = 0; x < index.width(); ++x) {
      const std::uint16_t value = index(x, y);
      if (value == 0) continue;
      if (value >= regions.size()) {
        return Status(StatusCode::invalid_argument, "the light index refers to a mark that does not exist");
      }
      LightRegion& r = regions[value];
      if (r.pixels == 0) r = {x, y, x, y, 0, 0.0, 0.0};
      r.x0 = std::min(r.x0, x);
      r.x1 = std::max(r.x1, x);
      r.y1 = y;
      ++r.pixels;
      r.sum_x += static_cast<double>(x) + 0.5;
      r.sum_y += static_cast<double>(y) + 0.5;
    }
  }
  return {};
}

[[nodiscard]] inline bool is_surface(const RegionInput& in, int x, int y) noexcept {
  const float z = in.depth(x, y);
  const bool credible = z >= kMinLightDepth && z <= kMaxLightDepth;  // false for NaN
  return credible && (in.labels.empty() || !kNoSurfaceLabels.contains(in.labels(x, y)));
}
[[nodiscard]] inline bool is_certain(const RegionInput& in, int x, int y) noexcept {
  return in.uncertain.empty() || in.uncertain(x, y) == 0;
}

// Lower median; reorders the values.
[[nodiscard]] inline float median(Span<float> values) noexcept {
  float* middle = values.data() + (values.size() - 1) / 2;
  select_nth(values.data(), middle, values.data() + values.size());
  return *middle;
}

// Median without outliers; 0 for no values. `values` is reordered.
[[nodiscard]] inline float robust_median(Span<float> values) noexcept {
  if (values.empty()) return 0.0F;
  const float first = median(values);
  // Half the interquartile range estimates the median absolute deviation without memory for the deviations.
  const std::size_t n = values.size();
  float* low = values.data() + n / 4;
  select_nth(values.data(), low, values.data() + n);
  const float q1 = *low;
  float* high = values.data() + (3 * n) / 4;
  select_nth(values.data(), high, values.data() + n);
  const float limit = std::max(0.02F * first, 3.0F * 1.4826F * 0.5F * (*high - q1));
  float* end = std::partition(values.begin(), values.end(), [&](float z) { return std::fabs(z - first) <= limit; });
  const auto kept = static_cast<std::size_t>(end - values.begin());
  return kept == 0 ? first : median(values.sub(0, kept));
}

// Collects the depths of at most scratch.size() accepted pixels of a rectangle, evenly in raster order.
template <class Accept>
[[nodiscard]] inline Span<float> collect_depth(const RegionInput& in, int x0, int y0, int x1, int y1, Accept&& accept,
                                               Span<float> scratch) noexcept {
  x0 = std::max(x0, 0);
  y0 = std::max(y0, 0);
  x1 = std::min(x1, in.depth.width() - 1);
  y1 = std::min(y1, in.depth.height() - 1);
  std::size_t total = 0;
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) total += accept(x, y) ? 1U : 0U;
  }
  const std::size_t step = total / scratch.size() + 1;
  std::size_t seen = 0;
  std::size_t count = 0;
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      if (accept(x, y) && seen++ % step == 0 && count < scratch.size()) scratch[count++] = in.depth(x, y);
    }
  }
  return scratch.sub(0, count);
}

[[nodiscard]] inline float region_depth(const RegionInput& in, const LightRegion& r, std::uint16_t value,
                                        Span<float> scratch) noexcept {
  for (const bool certain : {true, false}) {
    // A handful of certain pixels must not outvote a large region, nor three valid ones be ignored.
    const std::size_t enough =
        std::min<std::size_t>(r.pixels, certain ? std::max<std::size_t>(3, r.pixels / 20) : std::size_t{3});
    const Span<float> z = collect_depth(
        in, r.x0, r.y0, r.x1, r.y1,
        [&](int x, int y) {
          return in.light_index(x, y) == value && is_surface(in, x, y) && (!certain || is_certain(in, x, y));
        },
        scratch);
    if (z.size() >= enough) return robust_median(z);
  }
  const int side = std::max(r.x1 - r.x0, r.y1 - r.y0) + 1;
  for (int margin = std::max(side, 2), round = 0; round < 3; margin *= 2, ++round) {
    margin = std::min(margin, 4096);
    const Span<float> z = collect_depth(
        in, r.x0 - margin, r.y0 - margin, r.x1 + margin, r.y1 + margin,
        [&](int x, int y) { return is_surface(in, x, y) && is_certain(in, x, y); }, scratch);
    if (!z.empty()) return robust_median(z);
  }
  return 0.0F;
}

inline constexpr LabelSet kPoleLabels = LabelSet::of(label::pole, label::polegroup);
inline constexpr LabelSet kLampHeadLabels =
    LabelSet::of(label::pole, label::polegroup, label::traffic_light, label::traffic_sign, label::static_object,
                 label::dynamic_object, label::unlabeled);

[[nodiscard]] inline bool credible_lamp(const StreetLampParams& p, const Intrinsics& k, const GroundPlane& ground,
                                        float u, float v, float z) noexcept {
  if (!is_valid_depth(z) || z > p.max_distance_m) return false;
  const float height = height_above_ground(ground, unproject(k, u, v, z));
  return height >= p.min_height_m && height <= p.max_height_m;
}

// The first row under the head that shows a pole within reach, and the pole's column there; false where there is none.
[[nodiscard]] inline bool find_pole(const RegionInput& in, const LightRegion& r, int reach, int& pole_x,
                                    int& pole_y) noexcept {
  const int middle = (r.x0 + r.x1) / 2;
  for (int y = r.y1; y < in.labels.height(); ++y) {
    // The arm bends down, so the pole may stand further off the lower one looks, at least the head's own width.
    const int band = std::max(r.x1 - r.x0 + 1, std::min(reach, (r.x1 - r.x0 + 1) + (y - r.y1)));
    for (int d = 0; d <= band; ++d) {
      for (const int x : {middle - d, middle + d}) {
        if (x < 0 || x >= in.labels.width() || !kPoleLabels.contains(in.labels(x, y))) continue;
        pole_x = x;
        pole_y = y;
        return true;
      }
    }
  }
  return false;
}

[[nodiscard]] inline float street_lamp_depth(const StreetLampParams& p, const RegionInput& in, const LightRegion& r,
                                             std::uint16_t value, const Intrinsics& k, const GroundPlane& ground,
                                             Span<float> scratch) noexcept {
  const float u = static_cast<float>(r.mean_x());
  const float v = static_cast<float>(r.mean_y());
  const auto credible = [&](float z) { return credible_lamp(p, k, ground, u, v, z); };
  if (!in.labels.empty()) {
    const std::size_t enough = std::max<std::size_t>(2, r.pixels / 10);
    for (const bool certain : {true, false}) {
      const Span<float> own = collect_depth(
          in, r.x0, r.y0, r.x1, r.y1,
          [&](int x, int y) {
            return in.light_index(x, y) == value && kLampHeadLabels.contains(in.labels(x, y)) && is_surface(in, x, y) &&
                   (!certain || is_certain(in, x, y));
          },
          scratch);
      if (own.size() < enough) continue;
      const float z = robust_median(own);
      if (credible(z)) return z;
    }
    // An arm of arm_m spans this many pixels if the head is at the height of a default lamp.
    const Vec3f ray = unproject(k, u, v, 1.0F);
    const float rise = dot(ground.up, ray);
    const float guess_m = rise > 1e-3F ? (p.default_height_m - ground.camera_height_m) / rise : p.max_distance_m;
    const float reach_px = p.arm_m * k.fx / std::min(std::max(guess_m, 2.0F), p.max_distance_m);
    const int reach = static_cast<int>(std::min(reach_px, 0.25F * static_cast<float>(in.labels.width())));
    int pole_x = 0;
    int pole_y = 0;
    if (find_pole(in, r, reach, pole_x, pole_y)) {
      // Follow the pole down, allowing it to lean by a pixel per row and to be interrupted for two.
      int foot_x = pole_x;
      int foot_y = pole_y;
      for (int y = pole_y + 1; y < in.labels.height() && y <= foot_y + 3; ++y) {
        for (const int dx : {0, -1, 1, -2, 2}) {
          const int x = foot_x + dx;
          if (x < 0 || x >= in.labels.width() || !kPoleLabels.contains(in.labels(x, y))) continue;
          foot_x = x;
          foot_y = y;
          break;
        }
      }
      const int half = std::max(3, r.x1 - r.x0 + 1);
      for (const bool certain : {true, false}) {
        const Span<float> pole = collect_depth(
            in, std::min(pole_x, foot_x) - half, pole_y, std::max(pole_x, foot_x) + half, foot_y,
            [&](int x, int y) {
              return kPoleLabels.contains(in.labels(x, y)) && is_surface(in, x, y) &&
                     (!certain || is_certain(in, x, y));
            },
            scratch);
        if (pole.size() < 3) continue;
        const float z = robust_median(pole);
        if (credible(z)) return z;
      }
      const Vec3f foot = unproject(k, static_cast<float>(foot_x) + 0.5F, static_cast<float>(foot_y + 1), 1.0F);
      const float fall = -dot(ground.up, foot);
      if (fall > 1e-3F && foot_y + 1 < in.labels.height()) {
        const float z = ground.camera_height_m / fall;
        if (credible(z)) return z;
      }
    }
  }
  Span<float> any = collect_depth(
      in, r.x0, r.y0, r.x1, r.y1, [&](int x, int y) { return in.light_index(x, y) == value && is_surface(in, x, y); },
      scratch);
  if (!any.empty()) {
    float* quarter = any.data() + (any.size() - 1) / 4;
    select_nth(any.data(), quarter, any.data() + any.size());
    if (credible(*quarter)) return *quarter;
  }
  const float rise = dot(ground.up, unproject(k, u, v, 1.0F));
  if (!(rise > 1e-3F)) return 0.0F;
  const float z = (p.default_height_m - ground.camera_height_m) / rise;
  return is_valid_depth(z) ? std::min(z, p.max_distance_m) : 0.0F;
}

}  // namespace light_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_DETAIL_LAMP_DEPTH_HPP
