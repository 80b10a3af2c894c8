// SPDX-License-Identifier: Apache-2.0
// The photograph as its light is looked for: logarithms of luminance and colour at a working size of about 960 px
// width, and what kind of surface each pixel shows.
//
// Light changes slowly but for the edges of shadows, so that an image of more than 1440 px is reduced by a whole
// factor; a working pixel is the mean of those pixels of its block that show what its middle shows.
// Without labels what lies within kGroundHeight_m of the ground plane and faces up is road.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_PICTURE_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_PICTURE_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/color/srgb.hpp"
#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/material/detail/albedo_scene.hpp"
#include "npsim/material/detail/daylight/planes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

namespace daylight_detail {

// Surfaces whose light is found in one way. The ground comes first: its kinds share one light.
enum Region : std::uint8_t { kRoad, kPavement, kSoil, kRails, kFacade, kVehicle, kPlant, kOther, kNone };
inline constexpr int kGroundRegions = 4;

inline constexpr float kGroundHeight_m = 0.15F;

[[nodiscard]] constexpr Region region_of(Label l) noexcept {
  if (kNoSurfaceLabels.contains(l)) return kNone;
  if (kVehicleLabels.contains(l)) return kVehicle;
  switch (l) {
    case label::road:
    case label::parking: return kRoad;
    case label::sidewalk:
    case label::ground: return kPavement;
    case label::terrain: return kSoil;
    case label::rail_track: return kRails;
    case label::building:
    case label::wall:
    case label::bridge: return kFacade;
    case label::vegetation: return kPlant;
    default: return kOther;
  }
}

[[nodiscard]] constexpr int working_factor(Shape shape) noexcept { return std::max(1, (shape.width + 480) / 960); }
[[nodiscard]] constexpr Shape working_shape(Shape shape) noexcept {
  const int f = working_factor(shape);
  return {(shape.width + f - 1) / f, (shape.height + f - 1) / f};
}

struct Picture {
  int factor = 1;      // pixels of the photograph per working pixel, each way
  float scale = 1.0F;  // width over 960: of lengths in pixels
  ImageView<std::uint8_t> region;
  Plane log_rgb[3];  // log2 of linear light
  Plane log_y;
  Plane colour;                    // log2(blue / red)
  float contrast = 1.0F;           // power of the codes, 0..1, that are decoded as sRGB
  std::array<float, 256> light{};  // of a code
  float floor = 0.0F;              // added to the light, since there is no logarithm of 0

  // Light of a code, 0..1. At a power of 1 / 2.2 a sensor's own, linear codes come out within 5 % from .06 up, and
  // within a quarter from .02 up; a power of the decoded light, which keeps sRGB's straight toe, doubles dark ones.
  [[nodiscard]] static float decoded(float code, float power) noexcept {
    return srgb_decode(power == 1.0F ? code : exp2_of(power * log2_of(code)));
  }
  void set_contrast(float power) noexcept {
    constexpr float kFloor = 0.5F / 255.0F;  // half a step of 8 bits
    contrast = power;
    floor = decoded(kFloor, power);
    for (std::size_t i = 0; i < light.size(); ++i) {
      light[i] = power == 1.0F || i == 0 ? srgb_decode8(static_cast<std::uint8_t>(i))
                                         : decoded(static_cast<float>(i) / 255.0F, power);
    }
  }
  [[nodiscard]] Vec3f light_of(const Rgb8& seen) const noexcept {
    return {light[seen.r], light[seen.g], light[seen.b]};
  }

  [[nodiscard]] Shape shape() const noexcept { return log_y.shape(); }
  [[nodiscard]] bool is_ground(int x, int y) const noexcept { return region(x, y) < kGroundRegions; }
  // The pixel of the photograph in the middle of a working pixel.
  [[nodiscard]] int middle_x(int x, int width) const noexcept { return std::min(x * factor + factor / 2, width - 1); }
  [[nodiscard]] int middle_y(int y, int height) const noexcept { return std::min(y * factor + factor / 2, height - 1); }
  // A length that is `px` at 960 px width, in working pixels.
  [[nodiscard]] int radius(float px) const noexcept { return std::max(1, static_cast<int>(px * scale + 0.5F)); }
};
inline constexpr std::size_t kPicturePlanes = 5;

// Above the ground plane; 0 where depth or plane is not known.
[[nodiscard]] inline float height_m(const AlbedoScene& s, int x, int y) noexcept {
  if (s.depth.empty() || !(s.ground.inlier_share > 0.0F)) return 0.0F;
  const float z = s.depth(x, y);
  return is_valid_depth(z) ? height_above_ground(s.ground, unproject_pixel(s.camera, x, y, 1.0F) * z) : 0.0F;
}

[[nodiscard]] inline Region seen_region(const AlbedoScene& s, int x, int y) noexcept {
  if (!s.labels.empty()) return region_of(s.labels(x, y));
  if (s.depth.empty()) return kOther;
  const float z = s.depth(x, y);
  if (!is_valid_depth(z)) return kNone;
  if (!(s.ground.inlier_share > 0.0F)) return kOther;
  // Depth is good to some percent of itself, and the plane cuts it at a low angle far away.
  const float tolerance = kGroundHeight_m + 0.01F * z;
  if (!(std::fabs(height_m(s, x, y)) < tolerance)) return kOther;
  if (s.normals.empty() || s.normals(x, y) == Vec3f{}) return kRoad;
  return dot(s.normals(x, y), s.ground.up) > 0.85F ? kRoad : kOther;
}

template <class Executor>
Status read_picture(const AlbedoScene& s, Workspace& workspace, Picture& out, Executor& executor) {
  const Shape from = s.image.shape();
  const Shape shape = working_shape(from);
  out.factor = working_factor(from);
  out.scale = static_cast<float>(shape.width) / 960.0F;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.region));
  for (Plane* p : {&out.log_rgb[0], &out.log_rgb[1], &out.log_rgb[2], &out.log_y, &out.colour}) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, *p));
  }
  for_pixels(shape, executor, [&](int x, int y) {
    const int f = out.factor;
    const int x1 = std::min((x + 1) * f, from.width);
    const int y1 = std::min((y + 1) * f, from.height);
    const Region region = seen_region(s, out.middle_x(x, from.width), out.middle_y(y, from.height));
    Vec3f sum;
    float n = 0.0F;
    for (int v = y * f; v < y1; ++v) {
      for (int u = x * f; u < x1; ++u) {
        if (f > 1 && seen_region(s, u, v) != region) continue;
        sum += out.light_of(s.image(u, v));
        n += 1.0F;
      }
    }
    const Vec3f mean = sum * (1.0F / std::max(n, 1.0F)) + Vec3f{out.floor, out.floor, out.floor};
    out.region(x, y) = region;
    out.log_rgb[0](x, y) = log2_of(mean.x);
    out.log_rgb[1](x, y) = log2_of(mean.y);
    out.log_rgb[2](x, y) = log2_of(mean.z);
    out.log_y(x, y) = log2_of(luminance(mean));
    out.colour(x, y) = log2_of(mean.z + 1e-3F) - log2_of(mean.x + 1e-3F);
  });
  return {};
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_PICTURE_HPP
