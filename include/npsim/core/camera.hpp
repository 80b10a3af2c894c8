// SPDX-License-Identifier: Apache-2.0
// Pinhole intrinsics. Camera frame: x right, y down, z forward, metres. Depth is z-depth, not ray length.
//
// Image coordinates (u, v) are in pixels with pixel (x, y) covering [x, x + 1) x [y, y + 1), so its centre is at
// (x + 0.5, y + 0.5). Files that put centres at whole numbers are converted on reading (cx + 0.5, cy + 0.5).
#ifndef NPSIM_CORE_CAMERA_HPP
#define NPSIM_CORE_CAMERA_HPP

#include <cmath>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct Intrinsics {
  float fx = 0;  // px
  float fy = 0;  // px
  float cx = 0;  // px
  float cy = 0;  // px
};

// Square pixels, principal point in the middle. The field of view is the full horizontal angle, in (0, pi).
[[nodiscard]] inline Intrinsics intrinsics_from_fov(Shape shape, float horizontal_fov_rad) noexcept {
  const float f = 0.5F * static_cast<float>(shape.width) / std::tan(0.5F * horizontal_fov_rad);
  return {f, f, 0.5F * static_cast<float>(shape.width), 0.5F * static_cast<float>(shape.height)};
}

// The same camera after its image was resampled from one shape to another.
[[nodiscard]] constexpr Intrinsics scaled(const Intrinsics& k, Shape from, Shape to) noexcept {
  const float sx = static_cast<float>(to.width) / static_cast<float>(from.width);
  const float sy = static_cast<float>(to.height) / static_cast<float>(from.height);
  return {k.fx * sx, k.fy * sy, k.cx * sx, k.cy * sy};
}

[[nodiscard]] inline Status validate(const Intrinsics& k) noexcept {
  const bool good = std::isfinite(k.fx) && std::isfinite(k.fy) && std::isfinite(k.cx) && std::isfinite(k.cy) &&
                    k.fx > 0 && k.fy > 0;
  return good ? Status() : Status(StatusCode::invalid_argument, "intrinsics must be finite with positive fx and fy");
}

// Image coordinates of a camera-frame point in front of the camera (z > 0).
[[nodiscard]] constexpr Vec2f project(const Intrinsics& k, const Vec3f& p) noexcept {
  return {k.fx * p.x / p.z + k.cx, k.fy * p.y / p.z + k.cy};
}

// Camera-frame point at z-depth z_m that projects to (u, v): equation (3.1) for general intrinsics.
[[nodiscard]] constexpr Vec3f unproject(const Intrinsics& k, float u, float v, float z_m) noexcept {
  return {(u - k.cx) * z_m / k.fx, (v - k.cy) * z_m / k.fy, z_m};
}

// The same at the centre of pixel (x, y).
[[nodiscard]] constexpr Vec3f unproject_pixel(const Intrinsics& k, int x, int y, float z_m) noexcept {
  return unproject(k, static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F, z_m);
}

// A depth sample that may be used: finite and in front of the camera. NaN, infinity, zero and negative are "missing".
[[nodiscard]] inline bool is_valid_depth(float z_m) noexcept { return std::isfinite(z_m) && z_m > 0.0F; }

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_CAMERA_HPP
