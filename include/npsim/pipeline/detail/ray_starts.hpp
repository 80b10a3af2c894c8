// SPDX-License-Identifier: Apache-2.0
// How far above its point a ray starts, so that a surface does not shade itself.
//
// A reconstructed surface is rough where the true one is smooth: its vertices stand before and behind the plane that
// the point's normal tells. A ray starts above what the neighbours of its point stick out, and no higher: a kerb, a
// frame or a wall next to it keeps its shadow. With p the point, n its normal and q the vertices of its object within
// kReach pixels: lift = max over q of dot(n, q - p), of those that rise by less than kSteepest; steeper is another
// surface, or noise of the sensor: what rises by less than kNoise deviations of the depth counts however steep. At
// least what rounding needs: 2^-20 of the largest coordinate covers the error of the sum and of a ray's own translation
// (trace/ray.hpp).
// What stands on the ground may not start its rays under it: where the ground hides the start from the camera, as below
// a bumper whose normal points down, the lift is halved until it does not, and after six times is the least.
// Cost: (2 kReach + 1)^2 dot products a vertex of the sheets, with noise (2 kNoisyReach + 1)^2; of the foreground up to
// six looks into the background. Memory: none. Error: none; a rule.
#ifndef NPSIM_PIPELINE_DETAIL_RAY_STARTS_HPP
#define NPSIM_PIPELINE_DETAIL_RAY_STARTS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace ray_start_detail {

inline constexpr int kReach = 4;          // px
inline constexpr float kSteepest = 0.5F;  // rise over distance along the surface: 27 degrees
inline constexpr int kNoisyReach = 10;    // px, where depth is noisy: patches of wrong matches are as large
inline constexpr float kNoise = 10.0F;    // deviations; half of a wrong match's patch is within
inline constexpr float kFootM = 0.2F;     // so deep in the ground may depth put the foot of what stands on it

[[nodiscard]] inline float rounding_lift(const Vec3f& p) noexcept {
  return 0x1p-20F * std::fmax(std::fabs(p.x), std::fmax(std::fabs(p.y), std::fabs(p.z)));
}

// object: numbers of the layer's objects, or empty: of one. Lanes are neighbours in a row.
template <class F>
[[nodiscard]] float lift_over_neighbours(ImageView<const Vec3f> layer, ImageView<const std::uint32_t> object, int x,
                                         int y, const Vec3f& p, const Vec3f& n, float noise_m) noexcept {
  using I = typename F::Int;
  const int reach = noise_m > 0.0F ? kNoisyReach : kReach;
  const int first = std::max(0, x - reach);
  const int end = std::min(layer.width(), x + reach + 1);
  const F least(rounding_lift(p));
  const F noise(kNoise * noise_m);
  const F steepest(kSteepest * kSteepest);
  const I own(object.empty() ? 0 : static_cast<std::int32_t>(object(x, y)));
  F lift = least;
  for (int v = std::max(0, y - reach); v <= std::min(layer.height() - 1, y + reach); ++v) {
    for (int u = first; u < end; u += F::lanes) {
      // The last whole batch goes back over what the one before it had: a vertex may count twice.
      const int at = std::max(first, std::min(u, end - F::lanes));
      const int count = std::min(F::lanes, end - at);
      const simd::F32x3<F> q = simd::load3<F>(&layer(at, v).x, count);
      const F away_x = q.x - F(p.x);
      const F away_y = q.y - F(p.y);
      const F away_z = q.z - F(p.z);
      const F rise = F(n.x) * away_x + F(n.y) * away_y + F(n.z) * away_z;
      const F square = rise * rise;
      const F along2 = (away_x * away_x + away_y * away_y + away_z * away_z) - square;
      auto counts = (q.z > F(0.0F)) & ((rise < noise) | (square < steepest * along2));  // lanes past `count` have 0
      if (!object.empty()) {
        counts = counts & (I::load(reinterpret_cast<const std::int32_t*>(&object(at, v)), count) == own);
      }
      lift = max(lift, select(counts, rise, least));
    }
  }
  return simd::greatest_lane(lift);
}

// Whether `start` lies under the ground of the background layer, in the camera's direction or next to that beyond the
// picture's sides and below it. Two rows of the layer are ground where it is flat between them and no higher than p and
// kFootM: not a wall before the start. Between rows 1/z is linear, as on a plane.
[[nodiscard]] inline bool is_under_ground(const Intrinsics& camera, ImageView<const Vec3f> layer, const Vec3f& up,
                                          const Vec3f& p, const Vec3f& start) noexcept {
  if (!(start.z > 0.0F) || layer.height() < 2) return false;
  const Vec2f at = project(camera, start);
  const float row = at.y - 0.5F;
  if (!(row >= 0.0F)) return false;
  const auto x = static_cast<int>(std::fmin(std::fmax(at.x, 0.0F), static_cast<float>(layer.width() - 1)));
  const auto y = static_cast<int>(std::fmin(row, static_cast<float>(layer.height() - 2)));
  const Vec3f& above = layer(x, y);
  const Vec3f& below = layer(x, y + 1);
  if (!has_vertex(above) || !has_vertex(below)) return false;
  if (!(dot(above - p, up) < kFootM && dot(below - p, up) < kFootM)) return false;
  const Vec3f away = above - below;
  const float rise = dot(away, up);
  if (!(rise * rise < kSteepest * kSteepest * dot(away, away))) return false;
  const float t = row - static_cast<float>(y);
  return start.z * (1.0F / above.z + t * std::fmax(1.0F / below.z - 1.0F / above.z, 0.0F)) > 1.0F;
}

[[nodiscard]] inline float lift_above_ground(const Intrinsics& camera, ImageView<const Vec3f> layer, const Vec3f& up,
                                             const Vec3f& p, const Vec3f& n, float lift) noexcept {
  constexpr int kHalvings = 6;
  const float least = rounding_lift(p);
  for (int i = 0; i < kHalvings && lift > least; ++i, lift *= 0.5F) {
    if (!is_under_ground(camera, layer, up, p, p + n * lift)) return lift;
  }
  return least;
}

}  // namespace ray_start_detail

// Of the depth that the mesh was made of.
[[nodiscard]] inline DepthNoise noise_of_mesh(const RefinedDepth& refined) noexcept {
  return refined.trust.bounded ? refined.noise : DepthNoise{};
}

// Of vertex v of the mesh, in metres. noise: of the depth that the mesh was made of. up: of the ground.
[[nodiscard]] inline float ray_lift(const SceneMesh& mesh, const DepthNoise& noise, const Vec3f& up, std::size_t v,
                                    const Vec3f& normal) noexcept {
  using namespace ray_start_detail;  // NOLINT(google-build-using-namespace)
  const Vec3f& p = mesh.mesh.vertices[v];
  if (v >= mesh.sheet_vertices) return rounding_lift(p);  // an object's back is ours, and smooth
  const auto width = static_cast<std::uint32_t>(mesh.visible_vertex.width());
  const bool standing = v >= mesh.background_vertices;
  const SheetLayer& layer = standing ? mesh.foreground : mesh.background;
  const ImageView<const std::uint32_t> object = standing ? mesh.object : ImageView<const std::uint32_t>();
  const float noise_m = p.z > 0.0F ? noise.deviation(1.0F / p.z) * p.z * p.z : 0.0F;
  const float lift =
      lift_over_neighbours<simd::F32>(layer.vertices, object, static_cast<int>(mesh.vertex_pixel[v] % width),
                                      static_cast<int>(mesh.vertex_pixel[v] / width), p, normal, noise_m);
  return standing ? lift_above_ground(mesh.camera, mesh.background.vertices, up, p, normal, lift) : lift;
}

// The same of every vertex.
template <class Executor>
void ray_lifts(const SceneMesh& mesh, const DepthNoise& noise, const Vec3f& up, Span<const Vec3f> normal,
               Span<float> lift_m, Executor& executor) noexcept {
  executor.for_chunks(lift_m.size(), 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t v = begin; v < end; ++v) lift_m[v] = ray_lift(mesh, noise, up, v, normal[v]);
  });
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_RAY_STARTS_HPP
