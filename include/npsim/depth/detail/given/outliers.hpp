// SPDX-License-Identifier: Apache-2.0
// Drops measurements that cannot be: stereo mismatches on the ground and at the left border, specks in an otherwise
// dense depth map.
//
// Off the ground: a pixel with a ground label whose point lies further from the ground plane than `ground_tolerance` of
// the camera's height, or than `ground_slope` of its depth where that is more (streets rise and fall). Reflections on
// the bonnet and on wet roads make such depths.
// Off the carriageway, for stereo: matching finds mirror images on the bonnet, and mixes bonnet and road at its border.
// What lies within eight times the nearest distance z0 of the ground seen, and further than near_tolerance of the
// camera's height + near_slope (z - z0) from the height of the carriageway in its rows (detail/road_profile.hpp).
// Below the ground, for stereo without labels: in rows that see the ground nearer than 2 z0, where bonnets are, what
// lies near_depth times as far below the camera as the ground: a quay is not so high.
// Speck: a sample with fewer than `speck_share` of the samples of its (2 r + 1)^2 window within `speck_tolerance` of
// its inverse depth; what is missing there is no sample, so that a lamp's head before the sky stays. With `by_object`
// only samples of the same object count: matching smears the depth of objects over their borders, and leaves slivers of
// other depth where an object is hidden from the other camera. Looked for only where at least half of the image is
// measured: a sparse range sensor has specks only. Ground is exempt: seen at a grazing angle its depth does change
// within a window. Without labels nothing of this is dropped.
// Left border, for stereo: the left image shows a strip that the right one does not, as wide as the disparity of what
// is seen there, and matching finds something farther off in it. In each row, from right to left, the median dr of the
// last nine disparities that were kept says what goes on there; dropped is what lies at x < strip_width dr +
// strip_margin_px and is smaller than dr by more than strip_step_px and strip_step. With or without labels.
// Dropped samples become 0 (missing), to be filled like any other hole. Nothing is moved, nothing is added.
// Cost: (2 r + 1)^2 comparisons per sample. Memory: none.
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_OUTLIERS_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_OUTLIERS_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/depth/detail/road_profile.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct OutlierParams {
  LabelSet ground = LabelSet::of(label::road, label::sidewalk, label::parking, label::ground);
  float ground_tolerance = 0.3F;  // 0 switches the test off
  float ground_slope = 0.05F;
  LabelSet carriageway = LabelSet::of(label::road, label::parking);
  float near_tolerance = 0.025F;  // 3 cm, of ruts and patches; 0 switches the test off
  float near_slope = 0.03F;
  float near_depth = 4.0F;  // at least 1; infinite switches the test off
  int speck_radius_px = 5;  // 0 switches the test off; at most 32
  float speck_share = 0.25F;
  float speck_tolerance = 0.1F;  // relative
  bool by_object = false;
  float strip_width = 1.6F;  // 0 switches the test off
  float strip_margin_px = 12.0F;
  float strip_step_px = 2.0F;  // of disparity
  float strip_step = 0.15F;    // of dr
};

[[nodiscard]] inline Status validate(const OutlierParams& params) noexcept {
  if (!(params.ground_tolerance >= 0.0F) || !(params.ground_slope >= 0.0F) || !(params.near_tolerance >= 0.0F) ||
      !(params.near_slope >= 0.0F) || !(params.near_depth >= 1.0F) || params.speck_radius_px < 0 ||
      params.speck_radius_px > 32 || !(params.speck_share >= 0.0F && params.speck_share <= 1.0F) ||
      !(params.speck_tolerance > 0.0F) || !(params.strip_width >= 0.0F) || !(params.strip_margin_px >= 0.0F) ||
      !(params.strip_step_px >= 0.0F) || !(params.strip_step >= 0.0F)) {
    return {StatusCode::invalid_argument,
            "drop_outliers: tolerances positive, near_depth at least 1, radius in 0..32, share in 0..1"};
  }
  return {};
}

namespace depth_detail {

[[nodiscard]] inline bool is_speck(const OutlierParams& p, ImageView<const float> depth, const ObjectMap& objects,
                                   int x, int y) noexcept {
  const float z = depth(x, y);
  const float low = z / (1.0F + p.speck_tolerance);
  const float high = z * (1.0F + p.speck_tolerance);
  int like = 0;
  int all = 0;
  for (int j = y - p.speck_radius_px; j <= y + p.speck_radius_px; ++j) {
    for (int i = x - p.speck_radius_px; i <= x + p.speck_radius_px; ++i) {
      if (!depth.contains(i, j)) continue;
      const float q = depth(i, j);
      if (!is_valid_depth(q) || (p.by_object && !objects.same(x, y, i, j))) continue;
      ++all;
      like += q > low && q < high ? 1 : 0;
    }
  }
  return static_cast<float>(like) < p.speck_share * static_cast<float>(all);
}

// Whether a measured pixel of carriageway is off it.
class CarriagewayTest {
 public:
  // height(x, y, z): above the ground plane.
  template <class Height>
  CarriagewayTest(const OutlierParams& p, ImageView<const float> depth, ImageView<const Label> labels, float nearest_m,
                  float camera_height_m, const Height& height) noexcept
      : nearest_m_(nearest_m),
        tolerance_m_(p.near_tolerance * camera_height_m),
        slope_(p.near_slope),
        profile_(depth.width(), depth.height(), 0.25F * tolerance_m_, [&](int x, int y, float& h) {
          if (!p.carriageway.contains(labels(x, y)) || !judges(depth(x, y))) return false;
          h = height(x, y, depth(x, y));
          return true;
        }) {}
  [[nodiscard]] bool off(int y, float z, float height_m) const noexcept {
    return judges(z) && std::fabs(height_m - profile_.at(y)) > tolerance_m_ + slope_ * max_of(z - nearest_m_, 0.0F);
  }

 private:
  [[nodiscard]] bool judges(float z) const noexcept { return is_valid_depth(z) && z < 8.0F * nearest_m_; }

  float nearest_m_;
  float tolerance_m_;
  float slope_;
  RoadProfile profile_;
};

// Row of depth, in place. focal_baseline: disparity times depth, px m.
inline void drop_left_strip(const OutlierParams& p, float focal_baseline, float* row, int width) noexcept {
  constexpr int kLast = 9;
  float last[kLast];
  int count = 0;
  for (int x = width - 1; x >= 0; --x) {
    if (!is_valid_depth(row[x])) continue;
    const float disparity = focal_baseline / row[x];
    if (count >= kLast) {
      float sorted[kLast];
      for (int i = 0; i < kLast; ++i) {
        int at = i;
        for (; at > 0 && sorted[at - 1] > last[i]; --at) sorted[at] = sorted[at - 1];
        sorted[at] = last[i];
      }
      const float dr = sorted[kLast / 2];
      const float step = p.strip_step_px > p.strip_step * dr ? p.strip_step_px : p.strip_step * dr;
      if (static_cast<float>(x) < p.strip_width * dr + p.strip_margin_px && disparity < dr - step) {
        row[x] = 0.0F;
        continue;
      }
    }
    last[count % kLast] = disparity;
    ++count;
  }
}

}  // namespace depth_detail

// up (unit) and height_m describe the ground plane dot(up, X) = -height_m; height_m <= 0: not known, test skipped.
// focal_baseline_px_m: of the stereo pair, disparity times depth; 0: no stereo. output may not be the same memory as
// depth.
template <class Executor>
[[nodiscard]] Status drop_outliers(const OutlierParams& params, ImageView<const float> depth, const ObjectMap& objects,
                                   const Vec3f& up, float height_m, const Intrinsics& camera, float focal_baseline_px_m,
                                   ImageView<float> output, Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = depth.shape();
  const ImageView<const Label> labels = objects.labels;
  if (output.shape() != shape || !objects.fits(shape)) {
    return {StatusCode::shape_mismatch, "drop_outliers: depth, labels and output must have one shape"};
  }
  std::size_t measured = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) measured += is_valid_depth(depth(x, y)) ? 1U : 0U;
  }
  const bool labelled = !labels.empty();
  const bool specks = labelled && params.speck_radius_px > 0 && 2 * measured >= shape.pixels();
  const bool ground = params.ground_tolerance > 0.0F && height_m > 0.0F;
  const auto fall = [&](int x, int y, float z) { return -dot(up, unproject_pixel(camera, x, y, z)); };
  const auto height = [&](int x, int y, float z) { return height_m - fall(x, y, z); };
  // Of the ground plane, in the middle of the lowest row.
  const float down = fall(shape.width / 2, shape.height - 1, 1.0F);
  const bool near = labelled && ground && focal_baseline_px_m > 0.0F && params.near_tolerance > 0.0F && down > 0.0F;
  const bool below = !labelled && ground && focal_baseline_px_m > 0.0F && down > 0.0F;
  const depth_detail::CarriagewayTest carriageway(params, near ? depth : ImageView<const float>(), labels,
                                                  near ? height_m / down : 0.0F, height_m, height);
  executor.for_chunks(static_cast<std::size_t>(shape.height), 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const float z = depth(x, y);
        output(x, y) = z;
        if (!is_valid_depth(z)) continue;
        if (labelled && params.ground.contains(labels(x, y))) {
          if (!ground) continue;
          const float above = height(x, y, z);
          const float off = std::fabs(above);
          if (!(off <= params.ground_tolerance * height_m || off <= params.ground_slope * z) ||
              (params.carriageway.contains(labels(x, y)) && carriageway.off(y, z, above))) {
            output(x, y) = 0.0F;
          }
        } else if (below && fall(x, y, 1.0F) > 0.5F * down && fall(x, y, z) > params.near_depth * height_m) {
          output(x, y) = 0.0F;
        } else if (specks && depth_detail::is_speck(params, depth, objects, x, y)) {
          output(x, y) = 0.0F;
        }
      }
      if (focal_baseline_px_m > 0.0F && params.strip_width > 0.0F) {
        depth_detail::drop_left_strip(params, focal_baseline_px_m, output.row(y), shape.width);
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_OUTLIERS_HPP
