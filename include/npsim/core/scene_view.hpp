// SPDX-License-Identifier: Apache-2.0
// What the method starts from: one daytime photograph and everything known about it, as views over caller's memory.
//
// Only image, depth and camera are required. Empty labels: ground and all else; empty instances: connected components of a
// label stand for objects; empty normals, albedo, roughness: computed; empty lights: nothing is marked. An unknown depth
// source is found from the depth.
#ifndef NPSIM_CORE_SCENE_VIEW_HPP
#define NPSIM_CORE_SCENE_VIEW_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "npsim/core/annotation.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// How the depth came about, which tells what may be changed about it.
enum class DepthSource : std::uint8_t {
  unknown,
  network,  // dense and smooth, wrong by slowly varying factors, edges smeared
  stereo,  // noise of some tenths of a pixel of disparity, so it grows with z squared; mismatches, shadows of occlusion
  lidar,   // sparse, right to centimetres
  exact    // rendered
};
inline constexpr std::array<const char*, 5> kDepthSourceNames = {"unknown", "network", "stereo", "lidar", "exact"};

// The source of that name; unknown where it names none.
[[nodiscard]] constexpr DepthSource depth_source_named(std::string_view name) noexcept {
  for (std::size_t i = 0; i < kDepthSourceNames.size(); ++i) {
    if (name == kDepthSourceNames[i]) return static_cast<DepthSource>(i);
  }
  return DepthSource::unknown;
}

struct SceneView {
  Intrinsics camera;
  float camera_height_m = 0.0F;  // above the road, where the depth is an estimate; 0: not known
  ImageView<const Rgb8> image;   // sRGB
  ImageView<const float> depth;  // z-depth, m; invalid where not finite or not positive
  DepthSource depth_source = DepthSource::unknown;
  float stereo_baseline_m = 0.0F;              // of the pair that the depth comes from; 0: not known
  ImageView<const Label> labels;               // Cityscapes label ids
  ImageView<const std::uint16_t> instances;    // any ids; equal id and label = same object
  ImageView<const Vec3f> normals;              // unit, camera frame, facing the camera; zero = none
  ImageView<const Vec3f> albedo;               // linear RGB
  ImageView<const float> roughness;            // perceptual; GGX alpha is its square (Burley 2012)
  ImageView<const std::uint16_t> light_index;  // position + 1 in lights, 0 = none
  Span<const LightMark> lights;

  [[nodiscard]] constexpr Shape shape() const noexcept { return image.shape(); }
};

// A photograph's content as a number (FNV-1a), by which the random draws of its nights differ from those of others. A
// photograph that is made smaller keeps the number of the whole one, so that the same lamps burn.
[[nodiscard]] constexpr std::uint64_t photograph_key(ImageView<const Rgb8> image) noexcept {
  std::uint64_t hash = 0xCBF29CE484222325U;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) {
      const Rgb8 c = image(x, y);
      for (const std::uint8_t byte : {c.r, c.g, c.b}) hash = (hash ^ byte) * 0x100000001B3U;
    }
  }
  return hash;
}

[[nodiscard]] inline Status validate(const SceneView& s) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(s.camera));
  if (s.image.empty() || s.depth.empty()) {
    return Status(StatusCode::invalid_argument, "a scene needs an image and a depth plane");
  }
  if (!(s.camera_height_m >= 0.0F) || !(s.camera_height_m <= 1e6F)) {
    return Status(StatusCode::invalid_argument, "the camera's height must be finite and not negative, 0 if not known");
  }
  if (!(s.stereo_baseline_m >= 0.0F) || !(s.stereo_baseline_m <= 1e3F)) {
    return Status(StatusCode::invalid_argument, "the stereo baseline must be finite and not negative, 0 if not known");
  }
  const Shape shape = s.shape();
  const bool agree =
      s.depth.shape() == shape && (s.labels.empty() || s.labels.shape() == shape) &&
      (s.instances.empty() || s.instances.shape() == shape) && (s.normals.empty() || s.normals.shape() == shape) &&
      (s.albedo.empty() || s.albedo.shape() == shape) && (s.roughness.empty() || s.roughness.shape() == shape) &&
      (s.light_index.empty() || s.light_index.shape() == shape);
  if (!agree) return Status(StatusCode::shape_mismatch, "every plane of a scene must have the size of its image");
  for (int y = 0; y < (s.light_index.empty() ? 0 : shape.height); ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (s.light_index(x, y) > s.lights.size()) {
        return Status(StatusCode::invalid_argument, "light_index refers to a mark that does not exist");
      }
    }
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_SCENE_VIEW_HPP
