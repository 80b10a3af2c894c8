// SPDX-License-Identifier: Apache-2.0
// Lays the ground flat, and puts the whole depth map to scale by it where the camera's height is known.
//
// An estimate of the ground has four kinds of error: scale, slow drifts over the image, noise, and the shape that the
// ground really has. The plane that fits it robustly (geometry/ground.hpp) has none of the last three. So
//   scale: everything is multiplied by (camera height / fitted height)^height_trust. The fitted height is that of the
//     plane under the camera, where nothing was seen: a drift of depth along the road tilts the plane and moves it as
//     much as a false scale would. With both about as likely the square root is the best guess. A height that differs
//     from the fitted one by more than max_scale_error is taken for a mistake and ignored.
//   flat: a pixel of the carriageway takes the plane's depth, but where its surroundings are off by more than twice the
//     tolerance, which is shape, they stay so; between one and two tolerances it goes over. Surroundings: mean over a
//     square within the label, twice; a pixel's own deviation is noise. The tolerance is `spread` times the median
//     deviation of the label, within min_tolerance to max_tolerance: what most of a label has is error, what little of
//     it has is not. Other ground (pavements lie higher, and not all alike) keeps the deviation of its surroundings;
//     its steep pixels by the given normals, the faces of kerbs, have none in common with it and go with the drift.
//   drift: what stands on the ground has the error of the ground beneath it. The correction of the ground goes on
//     smoothly to all other surfaces (depth/detail/extend_field.hpp), so that cars stay on the road and houses on the
//     pavement.
// Invariant: without ground (fit failed, no ground labels) nothing changes. Pixels without depth stay without.
// Cost: O(pixels). Memory: 20 bytes per pixel.
#ifndef NPSIM_DEPTH_DETAIL_ESTIMATED_ANCHOR_GROUND_HPP
#define NPSIM_DEPTH_DETAIL_ESTIMATED_ANCHOR_GROUND_HPP

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/extend_field.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct AnchorGroundParams {
  bool enabled = true;
  bool use_camera_height = true;  // where the scene has one
  float height_trust = 0.5F;      // 0..1; 1 where depth has no drifts
  float max_scale_error = 0.2F;   // three times what loads, tyres and a road's crown do to a mounted camera's height
  LabelSet flat = LabelSet::of(label::road, label::parking);
  LabelSet smooth = LabelSet::of(label::sidewalk, label::ground);
  float steep_rad = 0.9F;  // of a normal from the plane's
  float spread = 2.0F;     // median deviations
  float min_tolerance = 0.01F;
  float max_tolerance = 0.04F;  // times the camera's height: 5 cm of a passenger car's 1.3 m, half a kerb
  int surroundings_px = 8;      // half the square's side
  float max_depth_m = 150.0F;   // of the plane; beyond it the horizon is near and the plane says nothing
};

inline constexpr std::size_t kAnchorSamples = 1024;

[[nodiscard]] constexpr std::size_t anchor_ground_workspace_bytes(Shape shape) noexcept {
  return kWorkspaceAlignment + 3 * allocation_bytes<float>(shape.pixels()) +
         allocation_bytes<std::uint8_t>(shape.pixels()) + allocation_bytes<float>(kAnchorSamples) +
         extend_field_workspace_bytes(shape);
}

namespace refine_detail {

// The ground plane as a depth map: 0 where it lies too far away or above the horizon.
struct PlaneDepth {
  Vec3f up;
  float height_m;
  float max_depth_m;
  [[nodiscard]] float plane_m(const Intrinsics& k, int x, int y) const noexcept {
    const float down = -dot(up, unproject_pixel(k, x, y, 1.0F));
    return down * max_depth_m > height_m ? height_m / down : 0.0F;
  }
};

[[nodiscard]] inline float median_of(Span<float> values) noexcept {
  float* const middle = values.data() + values.size() / 2;
  select_nth(values.data(), middle, values.data() + values.size());
  return *middle;
}

// How far a label may be off and still be taken for flat; 0 where too little of it is seen.
[[nodiscard]] inline float flat_tolerance(const AnchorGroundParams& params, const PlaneDepth& plane, Label l,
                                          ImageView<const float> depth, ImageView<const Label> labels,
                                          const Intrinsics& k, Span<float> samples) noexcept {
  std::size_t total = 0;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) total += labels(x, y) == l && is_valid_depth(depth(x, y)) ? 1U : 0U;
  }
  const std::size_t step = total / samples.size() + 1;
  std::size_t seen = 0;
  std::size_t count = 0;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      if (labels(x, y) != l || !is_valid_depth(depth(x, y)) || seen++ % step != 0 || count == samples.size()) continue;
      const float there = plane.plane_m(k, x, y);
      if (there > 0.0F) samples[count++] = std::log(depth(x, y) / there);
    }
  }
  if (count < 16) return 0.0F;
  const Span<float> taken(samples.data(), count);
  const float median = median_of(taken);
  for (float& v : taken) v = std::fabs(v - median);
  return clamp_to(params.spread * median_of(taken), params.min_tolerance, params.max_tolerance);
}

// Mean of `count` values `stride` apart over windows of 2 radius + 1, cut at the ends of each run of equal class; class
// 0 has none. Sums in double, so that what a run's far end held leaves no trace.
inline void average_runs(const float* in, float* out, const std::uint8_t* classes, int count, std::ptrdiff_t stride,
                         int radius) noexcept {
  for (int first = 0; first < count;) {
    int last = first;
    while (last < count && classes[last * stride] == classes[first * stride]) ++last;
    double sum = 0.0;
    int entered = first;
    int left = first;
    for (int i = first; i < last && classes[first * stride] != 0; ++i) {
      for (; entered < last && entered <= i + radius; ++entered) sum += static_cast<double>(in[entered * stride]);
      for (; left < i - radius; ++left) sum -= static_cast<double>(in[left * stride]);
      out[i * stride] = static_cast<float>(sum / (entered - left));
    }
    first = last;
  }
}

// Two means over squares, in place; `other` is for use meanwhile. All planes are without gaps between rows.
template <class Executor>
void average_surroundings(ImageView<const std::uint8_t> classes, int radius, ImageView<float> field,
                          ImageView<float> other, Executor& executor) noexcept {
  const auto width = static_cast<std::size_t>(field.width());
  const auto height = static_cast<std::size_t>(field.height());
  for (int pass = 0; pass < 2; ++pass) {
    executor.for_chunks(height, 16, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
        average_runs(field.row(y), other.row(y), classes.row(y), field.width(), 1, radius);
      }
    });
    executor.for_chunks(width, 64, [&](std::size_t begin, std::size_t end) {
      for (std::size_t x = begin; x < end; ++x) {
        average_runs(other.data() + x, field.data() + x, classes.data() + x, field.height(), field.stride(), radius);
      }
    });
  }
}

}  // namespace refine_detail

[[nodiscard]] inline Status validate(const AnchorGroundParams& p) noexcept {
  const bool good = p.max_scale_error >= 0.0F && p.max_scale_error < 1.0F && p.height_trust >= 0.0F &&
                    p.height_trust <= 1.0F && p.spread >= 0.0F && p.min_tolerance >= 1e-4F &&
                    p.max_tolerance >= p.min_tolerance && p.max_tolerance < 1.0F && p.max_depth_m > 0.0F &&
                    p.surroundings_px >= 0 && p.surroundings_px <= 4096 && p.steep_rad > 0.0F;  // false for NaN
  return good ? Status() : Status(StatusCode::invalid_argument, "anchor_ground: a parameter lies outside its range");
}

// depth: in place, 0 where there is no surface. camera_height_m: of the camera above the road, 0 if not known. normals:
// given ones, towards the camera; may be empty.
// ground: the plane fitted to the depth as it is, inlier_share 0 if there is none; then that of the result.
template <class Executor>
[[nodiscard]] Status anchor_ground(const AnchorGroundParams& params, float camera_height_m, const Intrinsics& k,
                                   ImageView<const Label> labels, ImageView<const Vec3f> normals,
                                   ImageView<float> depth, GroundPlane& ground, Workspace& workspace,
                                   Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  if (!(camera_height_m >= 0.0F) || !std::isfinite(camera_height_m)) {
    return {StatusCode::invalid_argument, "anchor_ground: the camera's height must be finite and not negative"};
  }
  if (!params.enabled || labels.empty() || !(ground.inlier_share > 0.0F)) return {};
  if (!normals.empty() && normals.shape() != depth.shape()) {
    return {StatusCode::shape_mismatch, "anchor_ground: normals and depth must have one shape"};
  }

  const Shape shape = depth.shape();
  const WorkspaceScope scope(workspace);
  ImageView<float> correction;
  ImageView<float> around;  // deviation from the plane, averaged
  ImageView<float> other;
  ImageView<std::uint8_t> known;  // label + 1 of ground, later of flat ground alone
  Span<float> samples;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, correction));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, around));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, other));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, known));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kAnchorSamples, samples));

  const float scale = camera_height_m / ground.camera_height_m;
  const bool rescale = params.use_camera_height && std::fabs(scale - 1.0F) <= params.max_scale_error;
  const float log_scale = rescale ? params.height_trust * std::log(scale) : 0.0F;
  const refine_detail::PlaneDepth plane{ground.up, ground.camera_height_m, params.max_depth_m};
  std::array<float, kLabelCount> tolerance{};
  for (std::size_t l = 0; l < tolerance.size(); ++l) {
    const auto id = static_cast<Label>(l);
    if (!params.flat.contains(id)) continue;
    tolerance[l] = refine_detail::flat_tolerance(params, plane, id, ImageView<const float>(depth), labels, k, samples);
  }
  const auto rows = static_cast<std::size_t>(shape.height);
  const float steep = std::cos(params.steep_rad);
  executor.for_chunks(rows, 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        correction(x, y) = 0.0F;
        around(x, y) = 0.0F;
        known(x, y) = 0;
        const Label l = labels(x, y);
        if (l >= tolerance.size() || !is_valid_depth(depth(x, y))) continue;
        if (!(tolerance[l] > 0.0F)) {
          if (!params.smooth.contains(l)) continue;
          if (!normals.empty() && dot(normals(x, y), ground.up) < steep * length(normals(x, y))) continue;
        }
        const float there = plane.plane_m(k, x, y);
        if (!(there > 0.0F)) continue;
        const float off = std::log(depth(x, y) / there);
        correction(x, y) = -off;
        around(x, y) = off;
        known(x, y) = static_cast<std::uint8_t>(l + 1);
      }
    }
  });
  refine_detail::average_surroundings(ImageView<const std::uint8_t>(known), params.surroundings_px, around, other,
                                      executor);
  executor.for_chunks(rows, 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (known(x, y) == 0) continue;
        const float off = around(x, y);
        const float limit = tolerance[known(x, y) - 1U];
        if (limit > 0.0F) {
          correction(x, y) += clamp_to(std::fabs(off) / limit - 1.0F, 0.0F, 1.0F) * off;
        } else {
          depth(x, y) *= std::exp(correction(x, y) + off);
          known(x, y) = 0;
        }
      }
    }
  });
  NPSIM_RETURN_IF_ERROR(extend_field(ImageView<const std::uint8_t>(known), correction, workspace, executor));
  executor.for_chunks(rows, 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (is_valid_depth(depth(x, y))) depth(x, y) *= std::exp(correction(x, y) + log_scale);
      }
    }
  });
  ground.camera_height_m *= std::exp(log_scale);
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_ESTIMATED_ANCHOR_GROUND_HPP
