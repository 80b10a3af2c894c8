// SPDX-License-Identifier: Apache-2.0
// The planes of a scene, each from its entry in scene.json into a Scene that already has image and camera.
#ifndef NPSIM_IO_DETAIL_SCENE_PLANES_HPP
#define NPSIM_IO_DETAIL_SCENE_PLANES_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <utility>

#include "npsim/depth/normal_convention.hpp"
#include "npsim/io/detail/depth.hpp"
#include "npsim/io/detail/json_fields.hpp"
#include "npsim/io/detail/labels.hpp"
#include "npsim/io/detail/normals.hpp"
#include "npsim/io/detail/scene_data.hpp"
#include "npsim/io/light_annotation.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

[[nodiscard]] inline std::string number_text(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

// The path of the file that an entry names, kept among the scene's files.
inline Expected<std::string> named_file(const JsonObject& entry, const char* key, Scene& scene) {
  const Expected<std::string> name = entry.text(key);
  if (!name) return name;
  scene.files.push_back({entry.field(key), resolved_path(entry.file(), name.value())});
  return scene.files.back().path;
}

inline Outcome read_scene_depth(const JsonObject& entry, const ReadLimits& limits, Scene& scene) {
  const Outcome known = entry.allow_only({"file", "encoding", "scale"});
  if (!known) return known;
  const Expected<std::string> path = named_file(entry, "file", scene);
  if (!path) return path.error();
  const Expected<std::string> encoding = entry.text("encoding");
  if (!encoding) return encoding.error();
  DepthFormat format;
  format.baseline_m = scene.baseline_m;
  format.fx_px = static_cast<double>(scene.intrinsics.fx);
  if (encoding.value() == "uint16") {
    format.encoding = DepthEncoding::uint16;
    const Expected<double> scale = entry.number("scale");
    if (!scale) return scale.error();
    if (!(scale.value() > 0))
      return Error{entry.file(), entry.field("scale"), "is not positive, expected metres per unit"};
    format.scale = scale.value();
  } else if (encoding.value() == "cityscapes_disparity") {
    format.encoding = DepthEncoding::cityscapes_disparity;
    if (!(format.baseline_m > 0)) {
      return Error{entry.file(), "camera.baseline", "is missing, expected the stereo baseline in metres for disparity"};
    }
  } else if (encoding.value() != "metres") {
    return Error{entry.file(), entry.field("encoding"),
                 "is '" + encoding.value() + "', expected metres, uint16 or cityscapes_disparity"};
  }
  if (format.encoding != DepthEncoding::uint16 && entry.has("scale")) {
    return Error{entry.file(), entry.field("scale"),
                 "stands beside encoding " + encoding.value() + ", expected it with uint16 only"};
  }
  DepthCounts counts;
  Expected<Image<float>> depth = read_depth(path.value(), format, limits, &counts);
  if (!depth) return depth.error();
  const Outcome same = expect_shape(path.value(), depth.value().shape(), scene.shape(), "the image");
  if (!same) return same;
  scene.depth = std::move(depth.value());
  float nearest = INFINITY;
  float farthest = 0;
  for (const float z : scene.depth.view().pixels()) {
    if (z <= 0) continue;
    nearest = std::min(nearest, z);
    farthest = std::max(farthest, z);
  }
  const double percent = 100.0 / static_cast<double>(scene.shape().pixels());
  scene.notes.push_back("depth: " + encoding.value() + ", " +
                        number_text("%.1f", static_cast<double>(counts.valid) * percent) + " % valid, " +
                        number_text("%.2f", static_cast<double>(nearest)) + " to " +
                        number_text("%.2f", static_cast<double>(farthest)) + " m");
  if (counts.refused > 0) {
    scene.notes.push_back("depth: " + std::to_string(counts.refused) +
                          " more values taken as missing (NaN, negative or infinitely far)");
  }
  return Done{};
}

inline Outcome read_scene_labels(const JsonObject& entry, const ReadLimits& limits, Scene& scene,
                                 LabelEncoding& encoding) {
  const Outcome known = entry.allow_only({"file", "encoding"});
  if (!known) return known;
  const Expected<std::string> path = named_file(entry, "file", scene);
  if (!path) return path.error();
  const Expected<std::string> name = entry.text("encoding");
  if (!name) return name.error();
  const Expected<LabelEncoding> parsed = label_encoding(entry.file(), entry.field("encoding"), name.value());
  if (!parsed) return parsed.error();
  encoding = parsed.value();
  std::size_t unknown = 0;
  Expected<Image<Label>> labels = read_labels(path.value(), encoding, limits, &unknown);
  if (!labels) return labels.error();
  const Outcome same = expect_shape(path.value(), labels.value().shape(), scene.shape(), "the image");
  if (!same) return same;
  if (unknown > 0) {
    return Error{path.value(), entry.field("encoding"),
                 std::to_string(unknown) + " pixels hold ids without an entry in " + name.value() +
                     ", expected ids of the Cityscapes definition, or 255 for none"};
  }
  scene.labels = std::move(labels.value());
  scene.notes.push_back("labels: " + name.value());
  return Done{};
}

inline Outcome read_scene_instances(const JsonObject& entry, const ReadLimits& limits, Scene& scene) {
  const Outcome known = entry.allow_only({"file", "encoding"});
  if (!known) return known;
  const Expected<std::string> path = named_file(entry, "file", scene);
  if (!path) return path.error();
  const Expected<std::string> name = entry.text("encoding");
  if (!name) return name.error();
  const Expected<LabelEncoding> encoding = label_encoding(entry.file(), entry.field("encoding"), name.value());
  if (!encoding) return encoding.error();
  Expected<Image<std::uint16_t>> instances = read_instances(path.value(), encoding.value(), limits);
  if (!instances) return instances.error();
  const Outcome same = expect_shape(path.value(), instances.value().shape(), scene.shape(), "the image");
  if (!same) return same;
  scene.instances = std::move(instances.value());
  scene.notes.push_back("instances: " + name.value());
  return Done{};
}

[[nodiscard]] inline std::string convention_text(const NormalConvention& c) {
  std::string text;
  const char* const names = "xyz";
  for (int i = 0; i < 3; ++i) {
    text += std::string(i > 0 ? ", " : "") + names[i] + " = " + (c.sign[i] < 0 ? "-" : "+") + names[c.axis[i]];
  }
  return text + " of the file";
}

// Unit length, or zero where the vector is too short to have a direction. Returns how many are zero.
inline std::size_t normalize_all(Image<Vec3f>& normals) {
  constexpr float kShortest = 0.1F;  // as in detect_normal_convention
  std::size_t none = 0;
  for (Vec3f& n : normals.view().pixels()) {
    const float l = length(n);
    if (std::isfinite(l) && l > kShortest) {
      n = n / l;
    } else {
      n = Vec3f{};
      ++none;
    }
  }
  return none;
}

inline Outcome read_scene_normals(const JsonObject& entry, const ReadLimits& limits, Scene& scene) {
  const Outcome known = entry.allow_only({"file", "convention"});
  if (!known) return known;
  const Expected<std::string> path = named_file(entry, "file", scene);
  if (!path) return path.error();
  std::string convention = "auto";
  if (entry.has("convention")) {
    const Expected<std::string> given = entry.text("convention");
    if (!given) return given.error();
    convention = given.value();
  }
  if (convention != "auto" && convention != "canonical" && convention != "opengl") {
    return Error{entry.file(), entry.field("convention"),
                 "is '" + convention +
                     "', expected auto, canonical (x right, y down, z forward) or opengl (x right, y up, z back)"};
  }
  Expected<Image<Vec3f>> raw = read_raw_normals(path.value(), limits);
  if (!raw) return raw.error();
  const Outcome same = expect_shape(path.value(), raw.value().shape(), scene.shape(), "the image");
  if (!same) return same;
  scene.normals = std::move(raw.value());
  float agreement = 0;
  const NormalConvention detected = detect_normal_convention(
      std::as_const(scene.normals).view(), std::as_const(scene.depth).view(), scene.intrinsics, agreement);
  NormalConvention taken = detected;
  if (convention == "canonical") taken = NormalConvention{};
  if (convention == "opengl") taken = NormalConvention{{0, 1, 2}, {1, -1, -1}};
  apply_normal_convention(taken, scene.normals.view());
  const std::size_t none = normalize_all(scene.normals);
  if (none == scene.shape().pixels()) {
    return Error{path.value(), "normals", "none of them has a length, expected unit vectors"};
  }
  std::string note = "normals: " + convention_text(taken);
  note += convention == "auto" ? ", found from depth, agreement " + number_text("%.2f", static_cast<double>(agreement))
                               : ", as the scene says";
  if (convention == "auto" && agreement < 0.5F) note += " (low: doubt the file, or name the convention)";
  if (convention != "auto" && taken != detected) note += " (depth suggests " + convention_text(detected) + ")";
  scene.notes.push_back(note);
  if (none > 0) scene.notes.push_back("normals: " + std::to_string(none) + " pixels without one");
  return Done{};
}

// Values of a material plane: finite, clamped to 0..1. Returns the number that were clamped.
inline Outcome check_unit_range(const std::string& path, float* values, std::size_t count, const char* what,
                                Scene& scene) {
  std::size_t clamped = 0;
  for (std::size_t i = 0; i < count; ++i) {
    if (!std::isfinite(values[i]))
      return Error{path, what, "value " + std::to_string(i) + " is not finite, expected 0 to 1"};
    const float held = std::min(1.0F, std::max(0.0F, values[i]));
    clamped += held != values[i] ? 1U : 0U;
    values[i] = held;
  }
  scene.notes.push_back(std::string(what) + ": given" +
                        (clamped > 0 ? ", " + std::to_string(clamped) + " values clamped to 0..1" : ""));
  return Done{};
}

inline Outcome read_scene_albedo(const JsonObject& entry, const ReadLimits& limits, Scene& scene) {
  const Outcome known = entry.allow_only({"file"});
  if (!known) return known;
  const Expected<std::string> path = named_file(entry, "file", scene);
  if (!path) return path.error();
  Expected<Image<Vec3f>> plane = read_vec3_plane(path.value(), limits);
  if (!plane) return plane.error();
  const Outcome same = expect_shape(path.value(), plane.value().shape(), scene.shape(), "the image");
  if (!same) return same;
  scene.albedo = std::move(plane.value());
  return check_unit_range(path.value(), &scene.albedo.data()->x, scene.shape().pixels() * 3, "albedo", scene);
}

inline Outcome read_scene_roughness(const JsonObject& entry, const ReadLimits& limits, Scene& scene) {
  const Outcome known = entry.allow_only({"file"});
  if (!known) return known;
  const Expected<std::string> path = named_file(entry, "file", scene);
  if (!path) return path.error();
  Expected<Image<float>> plane = read_float_plane(path.value(), limits);
  if (!plane) return plane.error();
  const Outcome same = expect_shape(path.value(), plane.value().shape(), scene.shape(), "the image");
  if (!same) return same;
  scene.roughness = std::move(plane.value());
  return check_unit_range(path.value(), scene.roughness.data(), scene.shape().pixels(), "roughness", scene);
}

inline Outcome read_scene_lights(const JsonObject& entry, const ReadLimits& limits, Scene& scene) {
  const Outcome known = entry.allow_only({"format", "json", "bitmap"});
  if (!known) return known;
  const Expected<std::string> format = entry.text("format");
  if (!format) return format.error();
  if (format.value() != "segments_ai" && format.value() != "coco_panoptic") {
    return Error{entry.file(), entry.field("format"),
                 "is '" + format.value() + "', expected segments_ai or coco_panoptic"};
  }
  const Expected<std::string> json = named_file(entry, "json", scene);
  if (!json) return json.error();
  const Expected<std::string> bitmap = named_file(entry, "bitmap", scene);
  if (!bitmap) return bitmap.error();
  Expected<LightAnnotation> lights = read_light_annotation(
      format.value() == "segments_ai" ? LightAnnotationFormat::segments_ai : LightAnnotationFormat::coco_panoptic,
      json.value(), bitmap.value(), scene.shape(), limits);
  if (!lights) return lights.error();
  scene.lights = std::move(lights.value().marks);
  scene.light_index = std::move(lights.value().index);
  for (std::string& note : lights.value().notes) scene.notes.push_back(std::move(note));
  return Done{};
}

}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_SCENE_PLANES_HPP
