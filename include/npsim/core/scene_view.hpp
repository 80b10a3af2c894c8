// SPDX-License-Identifier: Apache-2.0
// One daytime photograph, how it is annotated, and everything else known about it.
#ifndef NPSIM_CORE_SCENE_VIEW_HPP
#define NPSIM_CORE_SCENE_VIEW_HPP

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// How a photograph is annotated: the label of a pixel, and the marks of the lamps in it.
//
// What the numbers mean stands in labels/: cityscapes.hpp for labels, light_classes.hpp for lamps.

using Label = std::uint8_t;  // a Cityscapes label id

// The classes of table 3.1 by their numbers there: twelve kinds of source, nine kinds of group.
enum class LightClass : std::uint8_t {
  none = 0,
  window_building,
  window_parked,
  parked_front,
  parked_rear,
  moving_front,
  moving_rear,
  window_transport,
  street_light_ht,
  street_light_lt,
  advertisement,
  clock,
  inferred_object,
  windows_group,
  car_group,
  truck_group,
  bus_group,
  bicycle_group,
  motorcycle_group,
  train_group,
  traffic_light_group,
  traffic_sign_group
};

// What a signal shows by day, where the annotator wrote it down; otherwise it is inferred from the daytime colour.
enum class SignalState : std::uint8_t { unknown, red, amber, green };

// One annotated object. A light-index plane (std::uint16_t) refers to marks by position + 1; 0 is "no light".
struct LightMark {
  std::uint32_t id = 0;  // as in the file
  LightClass cls = LightClass::none;
  SignalState state = SignalState::unknown;
  std::uint16_t group = 0;  // position + 1 of the group's mark; 0 where the source stands alone
};

// What is marked as sending a headlamp's light back to where it came from. Traffic signs and what is painted on roads
// need no mark: labels tell them.
enum class ReflectorClass : std::uint8_t {
  none,
  number_plate,
  vest,     // the strips of high-visibility clothing
  sheeting  // of posts, beacons, barriers, the contours of trucks, unlabelled signs
};
inline constexpr std::array<const char*, 4> kReflectorNames = {"none", "number_plate", "vest", "sheeting"};

// What the method starts from: one daytime photograph and everything known about it, as views over caller's memory.
//
// Only image, depth and camera are required. Empty labels: ground and all else; empty instances: connected components
// of a label stand for objects; empty normals, albedo, roughness: computed; empty lights: nothing is marked, as with
// empty reflectors. An unknown depth source is found from the depth.

// How the depth came about, which tells what may be changed about it.
enum class DepthSource : std::uint8_t {
  unknown,
  network,  // dense and smooth, wrong by slowly varying factors, edges smeared
  stereo,  // noise of some tenths of a pixel of disparity, so it grows with z squared; mismatches, shadows of occlusion
  lidar,   // sparse, right to centimetres
  exact    // rendered
};
inline constexpr std::array<const char*, 5> kDepthSourceNames = {"unknown", "network", "stereo", "lidar", "exact"};

// What a sensor with noise measured: the shapes and normals of things are unsure.
[[nodiscard]] constexpr bool is_noisy(DepthSource source) noexcept {
  return source == DepthSource::stereo || source == DepthSource::lidar;
}

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
  ImageView<const ReflectorClass> reflectors;

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
      (s.light_index.empty() || s.light_index.shape() == shape) &&
      (s.reflectors.empty() || s.reflectors.shape() == shape);
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
