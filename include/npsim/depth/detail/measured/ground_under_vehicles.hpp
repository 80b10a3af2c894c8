// SPDX-License-Identifier: Apache-2.0
// The ground that is seen beneath vehicles, where stereo measured the vehicle.
//
// The strip between wheels and sill is dark and as low as a few windows of the matching, all of which hold the sill
// as well: it comes out as a ramp that rises from the road to the bumper. As a surface that ramp is lit like the car,
// throws shadows onto it and hides the gap that one sees under parked cars.
// In each column, below the lowest pixel of a vehicle, ground of the same label is taken for level: parallel to the
// ground plane, as far below the camera as the largest of three medians says, over the reach_px rows that begin
// reach_px below the vehicle, over twice as many that follow and over four times as many after these. From the vehicle
// down, what was measured nearer than that by more than `off` deviations, and more than rise_m above it, takes its
// depth, until the first row that was not. Lawns, which are no planes, stay.
// Invariant: no depth becomes less; only ground below a vehicle is touched, eight reaches of rows at most. The same
// bits for any thread count. Cost: one pass over the image. Memory: 2 KiB of stack.
#ifndef NPSIM_DEPTH_DETAIL_MEASURED_GROUND_UNDER_VEHICLES_HPP
#define NPSIM_DEPTH_DETAIL_MEASURED_GROUND_UNDER_VEHICLES_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/source_noise.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct GroundUnderVehiclesParams {
  int reach_px = 11;  // of rows that may be wrong, at least; 0 switches the step off; at most 128
  float rise_m = 0.05F;
  float off = 5.0F;  // deviations of 1/z
  LabelSet paved = LabelSet::of(label::road, label::sidewalk, label::parking, label::ground);
};

[[nodiscard]] inline Status validate(const GroundUnderVehiclesParams& p) noexcept {
  if (p.reach_px >= 0 && p.reach_px <= 128 && p.rise_m >= 0.0F && p.off >= 0.0F) return {};
  return {StatusCode::invalid_argument, "ground under vehicles: reach in 0..128, height and deviations not negative"};
}

namespace depth_detail {

// Depths of a column's ground as heights of the camera above it; 0: not known.
struct GroundColumn {
  const Intrinsics& camera;
  const GroundPlane& plane;
  ImageView<const Label> labels;
  ImageView<const float> depth;
  int x;

  [[nodiscard]] float fall(int y) const noexcept { return -dot(plane.up, unproject_pixel(camera, x, y, 1.0F)); }
  [[nodiscard]] float under_m(int y) const noexcept {
    const float z = depth(x, y);
    return is_valid_depth(z) ? z * fall(y) : 0.0F;
  }
  // Median over rows [from, from + rows) of one label, all of them inside; 0: the ground ends before.
  [[nodiscard]] float median_m(int from, int rows, Label label) const noexcept {
    float some[512];
    int count = 0;
    if (from + rows > labels.height()) return 0.0F;
    for (int y = from; y < from + rows; ++y) {
      if (labels(x, y) != label) return 0.0F;
      const float under = under_m(y);
      if (under > 0.0F) some[count++] = under;
    }
    if (2 * count < rows) return 0.0F;
    select_nth(some, some + count / 2, some + count);
    return some[count / 2];
  }
};

}  // namespace depth_detail

// depth: z-depth, m, in place. filled: the same as it was measured and filled. Without a ground plane or labels nothing
// changes.
template <class Executor>
[[nodiscard]] Status lower_ground_under_vehicles(const GroundUnderVehiclesParams& params, ImageView<const Label> labels,
                                                 const DepthNoise& noise, const Intrinsics& camera,
                                                 const GroundPlane& ground, ImageView<float> filled,
                                                 ImageView<float> depth, Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = depth.shape();
  if (filled.shape() != shape || !(labels.empty() || labels.shape() == shape)) {
    return {StatusCode::shape_mismatch, "ground under vehicles: all planes must have one shape"};
  }
  const int reach = params.reach_px;
  if (reach == 0 || labels.empty() || !(ground.inlier_share > 0.0F)) return {};
  executor.for_chunks(static_cast<std::size_t>(shape.width), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t at = begin; at < end; ++at) {
      const auto x = static_cast<int>(at);
      const depth_detail::GroundColumn column{camera, ground, labels, depth, x};
      for (int y = 1; y < shape.height; ++y) {
        const Label label = labels(x, y);
        if (!params.paved.contains(label) || !kVehicleLabels.contains(labels(x, y - 1))) continue;
        float level = 0.0F;
        int from = y + reach;
        for (const int rows : {reach, 2 * reach, 4 * reach}) {
          const float median = column.median_m(from, rows, label);
          if (!(median > 0.0F)) break;
          level = max_of(level, median);
          from += rows;
        }
        for (int v = y; v < from && level > 0.0F; ++v) {
          const float under = column.under_m(v);
          if (!(under > 0.0F)) continue;
          const float z = level / column.fall(v);
          if (under > level - params.rise_m ||
              1.0F / depth(x, v) - 1.0F / z <= params.off * noise.deviation(1.0F / z)) {
            break;
          }
          depth(x, v) = z;
          filled(x, v) = z;
        }
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_MEASURED_GROUND_UNDER_VEHICLES_HPP
