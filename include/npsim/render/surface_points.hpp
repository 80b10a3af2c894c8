// SPDX-License-Identifier: Apache-2.0
// The surface points of a scene: one per mesh vertex, with everything that light transport needs to know there.
//
// Structure of arrays, all of one length; index i is vertex i of the traced mesh. Visible and hidden points (background
// completed behind objects) are alike: both receive light, block it and hand it on. Nothing is owned.
#ifndef NPSIM_RENDER_SURFACE_POINTS_HPP
#define NPSIM_RENDER_SURFACE_POINTS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/material/retroreflection.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr std::uint32_t kNoPoint = 0xFFFFFFFFU;

struct SurfacePoints {
  Span<const Vec3f> position;             // m, camera frame
  Span<const Vec3f> normal;               // unit, facing the camera
  Span<const Vec3f> albedo;               // diffuse reflectance, linear RGB in [0, 1]
  Span<const float> alpha;                // GGX width in (0, 1]
  Span<const float> lift_m;               // how far along the normal a ray starts that leaves the point, >= 0
  Span<const Retroreflector> retro = {};  // what returns light to its lamp; empty: nothing does
  Span<const std::uint8_t> film = {};  // share of a film of water in 255ths (material/wet_film.hpp); empty: all is dry

  [[nodiscard]] constexpr std::size_t size() const noexcept { return position.size(); }
};

[[nodiscard]] inline Status validate(const SurfacePoints& p) noexcept {
  const bool same = p.normal.size() == p.size() && p.albedo.size() == p.size() && p.alpha.size() == p.size() &&
                    p.lift_m.size() == p.size() && (p.retro.empty() || p.retro.size() == p.size()) &&
                    (p.film.empty() || p.film.size() == p.size());
  if (!same) return Status(StatusCode::shape_mismatch, "surface point arrays must have one length");
  if (p.size() >= kNoPoint) return Status(StatusCode::capacity_exceeded, "more than 2^32 - 2 surface points");
  return {};
}

// Where a ray starts that leaves point p.
[[nodiscard]] inline Vec3f ray_start(const SurfacePoints& points, std::size_t p) noexcept {
  return points.position[p] + points.normal[p] * points.lift_m[p];
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_SURFACE_POINTS_HPP
