// SPDX-License-Identifier: Apache-2.0
// Takes back what depth estimators mix across the borders of objects.
//
// Networks and stereo windows blend the depths of both sides over some pixels (0.5 % of the image width is usual). The
// labels know the border better than the depth does. So within radius_px of a border between objects of different depth
// a pixel is computed anew from its own object: the plane in inverse depth (exact on planes) that fits the object's
// pixels around it by weighted least squares, slopes held back by a ridge. A pixel's weight falls off with distance,
// and with nearness to a border: trust = (border distance / radius)^8. The inner pixels of a house thus decide for the
// slivers of it that show between leaves, while of an object that is nowhere wider than the band (a pole) its middle
// does. The sky and the own car have no depth here, but were mixed in as well: the one draws pixels away, the other
// near. Beside the sky alone a pixel may only come nearer, beside the own car only go farther, by at least
// unseen_change; what is off by more than a factor most_unseen is another thing of the label, and has no say.
// Invariant: a pixel whose depth lies within min_change of that plane, beside those two within unseen_change, keeps it,
// so depth that is sharp already stays as it was measured; pixels without depth, beyond the radius, or beside objects
// of about the same depth never change; the new inverse depth lies within a factor 1.25 of the weighted mean around it.
// Without labels nothing happens.
//
// Cost: about 360 taps per pixel of the bands at any radius (the lattice of taps widens with it). Memory: two floats
// per pixel. Rounding: sums in double, so float's 1e-7 of the plane's value.
#ifndef NPSIM_DEPTH_DETAIL_ESTIMATED_SHARPEN_EDGES_HPP
#define NPSIM_DEPTH_DETAIL_ESTIMATED_SHARPEN_EDGES_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct SharpenEdgesParams {
  float radius_px = 6.0F;       // how far mixing reaches, 0..64; below 1 switches the step off
  float min_contrast = 0.04F;   // of depth, across the border; wheels stand on roads without an edge
  float min_change = 0.02F;     // relative; what lies closer to its object's surface is no mixture
  float unseen_change = 0.06F;  // the same beside the sky and the own car
  float most_unseen = 2.5F;     // the factor there, at least 1; a house at 12 m half mixed with a sky at 75 m
  // Labels that join each other without a gap: depth changes across their borders, but steadily.
  LabelSet joined = kGroundLabels;
};

[[nodiscard]] inline Status validate(const SharpenEdgesParams& params) noexcept {
  if (!(params.radius_px >= 0.0F && params.radius_px <= 64.0F) || !(params.min_contrast >= 0.0F) ||
      !(params.min_change >= 0.0F) || !(params.unseen_change >= 0.0F) || !(params.most_unseen >= 1.0F)) {
    return {StatusCode::invalid_argument,
            "sharpen_edges: radius_px in 0..64, contrast and changes not negative, most_unseen at least 1"};
  }
  return {};
}

[[nodiscard]] constexpr std::size_t sharpen_edges_workspace_bytes(const SharpenEdgesParams&, Shape shape) noexcept {
  return kWorkspaceAlignment + 2 * allocation_bytes<float>(shape.pixels());
}

namespace depth_detail {

// Sums of a weighted fit of w = mean + slope . (u - mean u, v - mean v).
struct LocalPlane {
  double n = 0, u = 0, v = 0, uu = 0, uv = 0, vv = 0, w = 0, uw = 0, vw = 0;

  void add(double weight, double du, double dv, double inverse_depth) noexcept {
    const double gu = weight * du;
    const double gv = weight * dv;
    const double gw = weight * inverse_depth;
    n += weight;
    u += gu;
    v += gv;
    w += gw;
    uu += gu * du;
    uv += gu * dv;
    vv += gv * dv;
    uw += gw * du;
    vw += gw * dv;
  }
  // At the origin; ridge: px^2 added to the spread along both axes.
  [[nodiscard]] double at_origin(double ridge) const noexcept {
    const double mean_u = u / n;
    const double mean_v = v / n;
    const double mean_w = w / n;
    const double a = uu / n - mean_u * mean_u + ridge;
    const double b = uv / n - mean_u * mean_v;
    const double c = vv / n - mean_v * mean_v + ridge;
    const double p = uw / n - mean_u * mean_w;
    const double q = vw / n - mean_v * mean_w;
    const double determinant = a * c - b * b;
    if (!(determinant > 0.0)) return mean_w;
    const double value = mean_w - ((c * p - b * q) * mean_u + (a * q - b * p) * mean_v) / determinant;
    return value < 0.8 * mean_w ? 0.8 * mean_w : (value > 1.25 * mean_w ? 1.25 * mean_w : value);
  }
};

struct EdgeBand {
  ObjectMap objects;
  ImageView<const float> depth;
  ImageView<float> distance_px;
  ImageView<float> trust;
  float radius_px = 0;
  float min_contrast = 0;
  LabelSet joined;
  // Taps lie at 0, +-1, and from there every few pixels: a thin object's middle is never stepped over.
  int taps = 0;  // on each side
  int offset[32] = {};
  double spatial[32] = {};  // Gaussian of the offset
};

// What a pixel may have been mixed with: within the radius, another object of another depth, else what has none.
enum class Beside : std::uint8_t { nothing, object, sky, own_car };

[[nodiscard]] inline Beside beside_depth_edge(const EdgeBand& band, int x, int y) noexcept {
  const int reach = static_cast<int>(std::ceil(band.radius_px));
  const float z = band.depth(x, y);
  const bool joined = band.joined.contains(band.objects.labels(x, y));
  const float low = z / (1.0F + band.min_contrast);
  const float high = z * (1.0F + band.min_contrast);
  Beside beside = Beside::nothing;
  for (int j = y - reach; j <= y + reach; ++j) {
    for (int i = x - reach; i <= x + reach; ++i) {
      if (!band.depth.contains(i, j)) continue;
      const Label other = band.objects.labels(i, j);
      if (!(band.depth(i, j) > 0.0F)) {
        if (other == label::sky) beside = Beside::sky;
        if (other == label::ego_vehicle) beside = Beside::own_car;
        continue;
      }
      if (band.depth(i, j) >= low && band.depth(i, j) <= high) continue;
      if (joined && band.joined.contains(other)) continue;
      if (!band.objects.same(x, y, i, j)) return Beside::object;
    }
  }
  return beside;
}

// Of the object's pixels between the two depths.
[[nodiscard]] inline float depth_of_object(const EdgeBand& band, int x, int y, float nearest, float farthest) noexcept {
  LocalPlane plane;
  for (int j = -band.taps; j <= band.taps; ++j) {
    const int v = j < 0 ? -band.offset[-j] : band.offset[j];
    for (int i = -band.taps; i <= band.taps; ++i) {
      const int u = i < 0 ? -band.offset[-i] : band.offset[i];
      if (!band.depth.contains(x + u, y + v) || !(band.trust(x + u, y + v) > 0.0F)) continue;
      if (!band.objects.same(x, y, x + u, y + v)) continue;
      if (band.depth(x + u, y + v) < nearest || band.depth(x + u, y + v) > farthest) continue;
      const double weight = band.spatial[i < 0 ? -i : i] * band.spatial[j < 0 ? -j : j];
      plane.add(weight * static_cast<double>(band.trust(x + u, y + v)), u, v,
                1.0 / static_cast<double>(band.depth(x + u, y + v)));
    }
  }
  const double radius = static_cast<double>(band.radius_px);
  return static_cast<float>(1.0 / plane.at_origin(0.125 * radius * radius));
}

}  // namespace depth_detail

// output may not be the same memory as depth.
template <class Executor>
[[nodiscard]] Status sharpen_edges(const SharpenEdgesParams& params, ImageView<const float> depth,
                                   const ObjectMap& objects, ImageView<float> output, Workspace& workspace,
                                   Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = depth.shape();
  if (output.shape() != shape || !objects.fits(shape)) {
    return {StatusCode::shape_mismatch, "sharpen_edges: depth, labels, instances and output must have one shape"};
  }
  const WorkspaceScope scope(workspace);
  depth_detail::EdgeBand band;
  band.objects = objects;
  band.depth = depth;
  band.radius_px = params.radius_px;
  band.min_contrast = params.min_contrast;
  band.joined = params.joined;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, band.distance_px));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, band.trust));
  copy_pixels(depth, output);
  if (objects.labels.empty() || params.radius_px < 1.0F) return {};

  const int step =
      params.radius_px < 6.0F ? (params.radius_px < 3.0F ? 1 : 2) : static_cast<int>(params.radius_px / 3.0F);
  const double sigma = static_cast<double>(params.radius_px);
  band.spatial[0] = 1.0;
  for (int at = 1; static_cast<float>(at) <= 3.0F * params.radius_px; at += step) {
    const double r = at / sigma;
    ++band.taps;
    band.offset[band.taps] = at;
    band.spatial[band.taps] = std::exp(-0.5 * r * r);
  }
  border_distance(objects, params.radius_px, band.distance_px);
  const auto rows = static_cast<std::size_t>(shape.height);
  executor.for_chunks(rows, 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const float near = band.distance_px(x, y) / params.radius_px;
        const float squared = near * near;
        const float fourth = squared * squared;
        band.trust(x, y) = is_valid_depth(depth(x, y)) ? fourth * fourth + 1e-6F : 0.0F;
      }
    }
  });
  executor.for_chunks(rows, 4, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const float z = depth(x, y);
        if (!(band.trust(x, y) > 0.0F) || !(band.distance_px(x, y) < params.radius_px)) continue;
        const depth_detail::Beside beside = depth_detail::beside_depth_edge(band, x, y);
        if (beside == depth_detail::Beside::nothing) continue;
        const bool by_sky = beside == depth_detail::Beside::sky;
        const bool by_car = beside == depth_detail::Beside::own_car;
        const float own = depth_detail::depth_of_object(band, x, y, by_sky ? z / params.most_unseen : 0.0F,
                                                        by_car ? z * params.most_unseen : INFINITY);
        const bool mixed = by_sky   ? own < z - params.unseen_change * z
                           : by_car ? own > z + params.unseen_change * z
                                    : std::fabs(own - z) > params.min_change * z;
        if (is_valid_depth(own) && mixed) output(x, y) = own;
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_ESTIMATED_SHARPEN_EDGES_HPP
