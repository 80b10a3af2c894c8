// SPDX-License-Identifier: Apache-2.0
// How scene.json is read: the planes, each from its entry into a Scene that already has image and camera, then the
// whole. What io/scene.hpp declares is defined here.
// Included by scene.hpp, whose Scene it fills, and by nobody else.
#ifndef NPSIM_IO_DETAIL_READ_SCENE_HPP
#define NPSIM_IO_DETAIL_READ_SCENE_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include "npsim/core/span.hpp"
#include "npsim/depth/normals.hpp"
#include "npsim/io/detail/camera.hpp"
#include "npsim/io/detail/depth.hpp"
#include "npsim/io/detail/json_fields.hpp"
#include "npsim/io/detail/labels.hpp"
#include "npsim/io/detail/light_annotation.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/detail/normals.hpp"
#include "npsim/io/detail/reflectors.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/png_jpeg.hpp"

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

// A disparity is a stereo camera's unless the scene says otherwise.
inline Outcome read_depth_source(const JsonObject& entry, DepthEncoding encoding, DepthSource& source) {
  source = encoding == DepthEncoding::cityscapes_disparity ? DepthSource::stereo : DepthSource::unknown;
  if (!entry.has("source")) return Done{};
  const Expected<std::string> name = entry.text("source");
  if (!name) return name.error();
  source = depth_source_named(name.value());
  if (source != DepthSource::unknown) return Done{};
  return Error{entry.file(), entry.field("source"),
               "is '" + name.value() + "', expected network, stereo, lidar or exact"};
}

inline Outcome read_scene_depth(const JsonObject& entry, const ReadLimits& limits, Scene& scene) {
  const Outcome known = entry.allow_only({"file", "encoding", "scale", "source"});
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
  if (const Outcome source = read_depth_source(entry, format.encoding, scene.depth_source); !source) return source;
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

// The file of a plane of labels or instances, and what its ids are.
struct EncodedFile {
  std::string path;
  std::string name;  // of the encoding
  LabelEncoding encoding = LabelEncoding::cityscapes_label_ids;
};

inline Expected<EncodedFile> encoded_file(const JsonObject& entry, Scene& scene) {
  const Outcome known = entry.allow_only({"file", "encoding"});
  if (!known) return known.error();
  const Expected<std::string> path = named_file(entry, "file", scene);
  if (!path) return path.error();
  const Expected<std::string> name = entry.text("encoding");
  if (!name) return name.error();
  const Expected<LabelEncoding> encoding = label_encoding(entry.file(), entry.field("encoding"), name.value());
  if (!encoding) return encoding.error();
  return EncodedFile{path.value(), name.value(), encoding.value()};
}

inline Outcome read_scene_labels(const JsonObject& entry, const ReadLimits& limits, Scene& scene,
                                 LabelEncoding& encoding) {
  const Expected<EncodedFile> file = encoded_file(entry, scene);
  if (!file) return file.error();
  const auto& [path, name, ids] = file.value();
  encoding = ids;
  std::size_t unknown = 0;
  Expected<Image<Label>> labels = read_labels(path, encoding, limits, &unknown);
  if (!labels) return labels.error();
  const Outcome same = expect_shape(path, labels.value().shape(), scene.shape(), "the image");
  if (!same) return same;
  if (unknown > 0) {
    return Error{path, entry.field("encoding"),
                 std::to_string(unknown) + " pixels hold ids without an entry in " + name +
                     ", expected ids of the Cityscapes definition, or 255 for none"};
  }
  scene.labels = std::move(labels.value());
  scene.notes.push_back("labels: " + name);
  return Done{};
}

inline Outcome read_scene_instances(const JsonObject& entry, const ReadLimits& limits, Scene& scene) {
  const Expected<EncodedFile> file = encoded_file(entry, scene);
  if (!file) return file.error();
  const auto& [path, name, ids] = file.value();
  Expected<Image<std::uint16_t>> instances = read_instances(path, ids, limits);
  if (!instances) return instances.error();
  const Outcome same = expect_shape(path, instances.value().shape(), scene.shape(), "the image");
  if (!same) return same;
  scene.instances = std::move(instances.value());
  scene.notes.push_back("instances: " + name);
  return Done{};
}

// Networks know no class for it.
inline Outcome read_scene_own_car(const JsonObject& entry, const ReadLimits& limits, Scene& scene) {
  const Outcome known = entry.allow_only({"file"});
  if (!known) return known.error();
  const Expected<std::string> path = named_file(entry, "file", scene);
  if (!path) return path.error();
  const Expected<Image<std::uint16_t>> mask = read_u16(path.value(), limits);
  if (!mask) return mask.error();
  const Outcome same = expect_shape(path.value(), mask.value().shape(), scene.shape(), "the image");
  if (!same) return same;
  if (scene.labels.empty()) return Error{entry.file(), entry.field("file"), "is given without labels, expected both"};
  std::size_t count = 0;
  for (std::size_t i = 0; i < scene.shape().pixels(); ++i) {
    if (mask.value().data()[i] == 0) continue;
    scene.labels.data()[i] = label::ego_vehicle;
    if (!scene.instances.empty()) scene.instances.data()[i] = 0;
    ++count;
  }
  scene.notes.push_back("own car: " + std::to_string(count) + " pixels");
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

inline float* components(float* pixels) { return pixels; }
inline float* components(Vec3f* pixels) { return &pixels->x; }

// A plane of T, `channels` floats each, that only its file says anything about.
template <class T, class Read>
Outcome read_material_plane(const JsonObject& entry, const ReadLimits& limits, Read&& read, std::size_t channels,
                            const char* what, Image<T>& out, Scene& scene) {
  const Outcome known = entry.allow_only({"file"});
  if (!known) return known;
  const Expected<std::string> path = named_file(entry, "file", scene);
  if (!path) return path.error();
  Expected<Image<T>> plane = read(path.value(), limits);
  if (!plane) return plane.error();
  const Outcome same = expect_shape(path.value(), plane.value().shape(), scene.shape(), "the image");
  if (!same) return same;
  out = std::move(plane.value());
  return check_unit_range(path.value(), components(out.data()), scene.shape().pixels() * channels, what, scene);
}

inline Outcome read_scene_albedo(const JsonObject& entry, const ReadLimits& limits, Scene& scene) {
  return read_material_plane(
      entry, limits, [](const std::string& path, const ReadLimits& l) { return read_vec3_plane(path, l); }, 3, "albedo",
      scene.albedo, scene);
}

inline Outcome read_scene_roughness(const JsonObject& entry, const ReadLimits& limits, Scene& scene) {
  return read_material_plane(
      entry, limits, [](const std::string& path, const ReadLimits& l) { return read_float_plane(path, l); }, 1,
      "roughness", scene.roughness, scene);
}

inline Outcome read_scene_lights(const JsonObject& entry, const ReadLimits& limits, Scene& scene) {
  const Outcome known = entry.allow_only({"format", "json", "bitmap"});
  if (!known) return known;
  const Expected<std::string> format = entry.text("format");
  if (!format) return format.error();
  const bool shapes = format.value() == "shapes";
  if (!shapes && format.value() != "segments_ai" && format.value() != "coco_panoptic") {
    return Error{entry.file(), entry.field("format"),
                 "is '" + format.value() + "', expected segments_ai, coco_panoptic or shapes"};
  }
  const Expected<std::string> json = named_file(entry, "json", scene);
  if (!json) return json.error();
  if (shapes && entry.has("bitmap")) {
    return Error{entry.file(), entry.field("bitmap"), "stands beside format shapes, expected it with the others only"};
  }
  const Expected<std::string> bitmap = shapes ? std::string() : named_file(entry, "bitmap", scene);
  if (!bitmap) return bitmap.error();
  Expected<LightAnnotation> lights =
      shapes ? read_light_shapes(json.value(), scene.shape(), limits)
             : read_light_annotation(format.value() == "segments_ai" ? LightAnnotationFormat::segments_ai
                                                                     : LightAnnotationFormat::coco_panoptic,
                                     json.value(), bitmap.value(), scene.shape(), limits);
  if (!lights) return lights.error();
  scene.lights = std::move(lights.value().marks);
  scene.light_index = std::move(lights.value().index);
  for (std::string& note : lights.value().notes) scene.notes.push_back(std::move(note));
  return Done{};
}

inline Outcome read_scene_reflectors(const JsonObject& entry, const ReadLimits& limits, Scene& scene) {
  const Outcome known = entry.allow_only({"format", "file"});
  if (!known) return known;
  const Expected<std::string> format = entry.text("format");
  if (!format) return format.error();
  const Expected<std::string> file = named_file(entry, "file", scene);
  if (!file) return file.error();
  auto* const read = format.value() == "shapes"                ? read_reflector_shapes
                     : format.value() == "cityscapes_polygons" ? read_cityscapes_plates
                     : format.value() == "ids"                 ? read_reflector_ids
                                                               : nullptr;
  if (read == nullptr) {
    return Error{entry.file(), entry.field("format"),
                 "is '" + format.value() + "', expected shapes, cityscapes_polygons or ids"};
  }
  Expected<Image<ReflectorClass>> marked = read(file.value(), scene.shape(), limits);
  if (!marked) return marked.error();
  scene.reflectors = std::move(marked.value());
  const auto pixels = scene.reflectors.view().pixels();
  const auto none = std::count(pixels.begin(), pixels.end(), ReflectorClass::none);
  scene.notes.push_back("reflectors: " + std::to_string(static_cast<std::ptrdiff_t>(pixels.size()) - none) +
                        " pixels are marked");
  return Done{};
}

// Runs read(entry) where the scene has the key.
template <class Read>
Outcome with_entry(const JsonObject& root, const char* key, Read&& read) {
  if (!root.has(key)) return Done{};
  const Expected<JsonObject> entry = root.object(key);
  if (!entry) return entry.error();
  return read(entry.value());
}

// `out` holds as many numbers as the list has to have.
inline Outcome read_floats(const JsonObject& object, const char* key, Span<float> out) {
  const Expected<const Json*> list = object.list(key);
  if (!list) return list.error();
  const Json& values = *list.value();
  if (values.size() != out.size()) {
    return Error{
        object.file(), object.field(key),
        "has " + std::to_string(values.size()) + " entries, expected " + std::to_string(out.size()) + " numbers"};
  }
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (!values[i].is_number()) {
      return Error{object.file(), object.field(key), "holds something else than numbers, expected numbers"};
    }
    out[i] = values[i].get<float>();
  }
  return Done{};
}

inline Expected<Vec3f> read_vector(const JsonObject& object, const char* key) {
  float values[3];
  if (const Outcome read = read_floats(object, key, {values, 3}); !read) return read.error();
  return Vec3f{values[0], values[1], values[2]};
}

inline Expected<Vec3f> read_direction(const JsonObject& object, const char* key) {
  const Expected<Vec3f> vector = read_vector(object, key);
  if (!vector) return vector;
  const Vec3f unit = normalized(vector.value());
  if (std::fabs(length(unit) - 1.0F) < 1e-3F) return unit;
  return Error{object.file(), object.field(key), "has no direction, expected a vector of length 1"};
}

inline Expected<GroundPlane> read_truth_ground(const JsonObject& entry) {
  const Outcome known = entry.allow_only({"camera_height_m", "up"});
  if (!known) return known.error();
  const Expected<double> height = entry.number("camera_height_m");
  if (!height) return height.error();
  const Expected<Vec3f> up = read_direction(entry, "up");
  if (!up) return up.error();
  return GroundPlane{up.value(), static_cast<float>(height.value()), 1.0F};
}

inline Outcome read_truth_names(const JsonObject& entry, Scene& scene) {
  const Outcome known =
      entry.allow_only({"depth", "background_depth", "normals", "albedo", "mesh", "emitters", "ground"});
  if (!known) return known;
  if (entry.has("ground")) {
    const Expected<JsonObject> object = entry.object("ground");
    if (!object) return object.error();
    const Expected<GroundPlane> ground = read_truth_ground(object.value());
    if (!ground) return ground.error();
    scene.truth.ground = ground.value();
  }
  const std::pair<const char*, std::string*> names[] = {
      {"depth", &scene.truth.depth},     {"background_depth", &scene.truth.background_depth},
      {"normals", &scene.truth.normals}, {"albedo", &scene.truth.albedo},
      {"mesh", &scene.truth.mesh},       {"emitters", &scene.truth.emitters}};
  for (const auto& [key, path] : names) {
    if (!entry.has(key)) continue;
    const Expected<std::string> file = named_file(entry, key, scene);
    if (!file) return file.error();
    *path = file.value();
    std::error_code code;
    if (!std::filesystem::exists(*path, code)) scene.notes.push_back("truth: " + *path + " does not exist");
  }
  return Done{};
}

inline Expected<Scene> scene_from_json(const JsonObject& root, const ReadLimits& limits) {
  Outcome known =
      root.allow_only({"npsim_scene", "name", "generator", "image", "depth", "camera", "labels", "instances", "own_car",
                       "normals", "albedo", "roughness", "lights", "reflectors", "truth"});
  if (!known) return known.error();
  Scene scene;
  scene.file = root.file();
  scene.files.push_back({"", root.file()});
  if (root.has("npsim_scene")) {
    const Expected<std::int64_t> version = root.whole("npsim_scene");
    if (!version) return version.error();
    if (version.value() != 1)
      return Error{root.file(), "npsim_scene", "is " + std::to_string(version.value()) + ", expected 1"};
  }
  if (root.has("name")) {
    const Expected<std::string> name = root.text("name");
    if (!name) return name.error();
    scene.name = name.value();
  } else {
    std::error_code code;
    scene.name = std::filesystem::absolute(root.file(), code).parent_path().filename().string();
  }
  if (root.has("generator")) {
    const Expected<std::string> generator = root.text("generator");
    if (!generator) return generator.error();
    scene.generator = generator.value();
  }

  // All required keys first: a missing one is reported before a large image is decoded.
  const Expected<std::string> image_file = named_file(root, "image", scene);
  if (!image_file) return image_file.error();
  const Expected<JsonObject> depth_entry = root.object("depth");
  if (!depth_entry) return depth_entry.error();
  const Expected<JsonObject> camera_entry = root.object("camera");
  if (!camera_entry) return camera_entry.error();

  Expected<Image<Rgb8>> image = read_rgb8(image_file.value(), limits);
  if (!image) return image.error();
  scene.image = std::move(image.value());
  scene.photograph = photograph_key(scene.image.view());
  scene.notes.push_back("image: " + size_text(scene.shape()));
  if (camera_entry.value().has("cityscapes")) {
    const Expected<std::string> camera_file = named_file(camera_entry.value(), "cityscapes", scene);
    if (!camera_file) return camera_file.error();
  }
  const Expected<Camera> camera = camera_from_json(camera_entry.value(), scene.shape(), limits);
  if (!camera) return camera.error();
  scene.intrinsics = camera.value().intrinsics;
  scene.baseline_m = camera.value().baseline_m;
  scene.camera_height_m = camera.value().height_m;
  if (!camera.value().note.empty()) scene.notes.push_back(camera.value().note);
  const Outcome depth = read_scene_depth(depth_entry.value(), limits, scene);
  if (!depth) return depth.error();
  // What was measured is to scale, and better than a height that changes with load and tyres.
  if (scene.depth_source != DepthSource::unknown && scene.depth_source != DepthSource::network) {
    scene.camera_height_m = 0;
  } else if (scene.camera_height_m > 0) {
    scene.notes.push_back("camera: " + number_text("%.2f m", scene.camera_height_m) +
                          " above the road, by which the depth is put to scale where it agrees with the ground");
  }

  LabelEncoding encoding = LabelEncoding::cityscapes_label_ids;
  Outcome read =
      with_entry(root, "labels", [&](const JsonObject& e) { return read_scene_labels(e, limits, scene, encoding); });
  if (!read) return read.error();
  read = with_entry(root, "instances", [&](const JsonObject& e) { return read_scene_instances(e, limits, scene); });
  if (!read) return read.error();
  if (!root.has("instances") && encoding == LabelEncoding::cityscapes_instance_ids) {
    read = with_entry(root, "labels", [&](const JsonObject& e) { return read_scene_instances(e, limits, scene); });
    if (!read) return read.error();
  }
  read = with_entry(root, "own_car", [&](const JsonObject& e) { return read_scene_own_car(e, limits, scene); });
  if (!read) return read.error();
  read = with_entry(root, "normals", [&](const JsonObject& e) { return read_scene_normals(e, limits, scene); });
  if (!read) return read.error();
  read = with_entry(root, "albedo", [&](const JsonObject& e) { return read_scene_albedo(e, limits, scene); });
  if (!read) return read.error();
  read = with_entry(root, "roughness", [&](const JsonObject& e) { return read_scene_roughness(e, limits, scene); });
  if (!read) return read.error();
  read = with_entry(root, "lights", [&](const JsonObject& e) { return read_scene_lights(e, limits, scene); });
  if (!read) return read.error();
  read = with_entry(root, "reflectors", [&](const JsonObject& e) { return read_scene_reflectors(e, limits, scene); });
  if (!read) return read.error();
  read = with_entry(root, "truth", [&](const JsonObject& e) { return read_truth_names(e, scene); });
  if (!read) return read.error();

  if (!root.has("labels")) scene.notes.push_back("labels: none, ground and sky are found by depth and picture");
  if (!root.has("normals")) scene.notes.push_back("normals: none, to be computed from depth");
  if (!root.has("lights")) scene.notes.push_back("lights: none are marked");
  return scene;
}

// The class that has the name; none where the field names no class.
inline Expected<LightClass> read_class(const JsonObject& entry, const char* key) {
  const Expected<std::string> name = entry.text(key);
  if (!name) return name.error();
  for (int i = 0; i < kLightClassCount; ++i) {
    if (name.value() == info(static_cast<LightClass>(i)).name) return static_cast<LightClass>(i);
  }
  return Error{entry.file(), entry.field(key), "is '" + name.value() + "', expected a class of table 3.1 or none"};
}

inline Expected<SignalState> read_signal_state(const JsonObject& entry) {
  if (!entry.has("state")) return SignalState::unknown;
  const Expected<std::string> name = entry.text("state");
  if (!name) return name.error();
  if (name.value() == "red") return SignalState::red;
  if (name.value() == "amber") return SignalState::amber;
  if (name.value() == "green") return SignalState::green;
  return Error{entry.file(), entry.field("state"), "is '" + name.value() + "', expected red, amber or green"};
}

// Where the lamp is and where it shines.
inline Outcome read_emitter_geometry(const JsonObject& entry, TrueEmitter& emitter) {
  const Expected<Vec3f> centre = read_vector(entry, "centre");
  if (!centre) return centre.error();
  emitter.centre_m = centre.value();
  for (const auto& [key, out] :
       {std::pair<const char*, Vec3f*>{"normal", &emitter.normal}, {"axis", &emitter.axis}, {"up", &emitter.up}}) {
    const Expected<Vec3f> direction = read_direction(entry, key);
    if (!direction) return direction.error();
    *out = direction.value();
  }
  float half[2];
  if (const Outcome read = read_floats(entry, "half_extents", {half, 2}); !read) return read;
  emitter.half_extents_m = {half[0], half[1]};
  const Expected<const Json*> closed = entry.required("closed");
  if (!closed) return closed.error();
  if (!closed.value()->is_boolean()) {
    return Error{entry.file(), entry.field("closed"),
                 std::string("is ") + JsonObject::kind(*closed.value()) + ", expected true or false"};
  }
  emitter.closed = closed.value()->get<bool>();
  for (const auto& [key, out, needed] :
       {std::tuple<const char*, float*, bool>{"area_m2", &emitter.area_m2, true},
        {"mounting_height_m", &emitter.mounting_height_m,
         emitter.cls == LightClass::street_light_ht || emitter.cls == LightClass::street_light_lt}}) {
    if (!needed) continue;
    const Expected<double> value = entry.number(key);
    if (!value) return value.error();
    if (!(value.value() > 0))
      return Error{entry.file(), entry.field(key), "is not positive, expected a size in metres"};
    *out = static_cast<float>(value.value());
  }
  // A pane may be seen from behind, past the edge of what it stands before.
  const Expected<double> seen = entry.number("seen_area_m2");
  if (!seen) return seen.error();
  if (!(seen.value() >= 0)) return Error{entry.file(), entry.field("seen_area_m2"), "is negative, expected an area"};
  emitter.seen_area_m2 = static_cast<float>(seen.value());
  return Done{};
}

inline Expected<TrueEmitter> true_emitter(const JsonObject& entry) {
  const Expected<std::int64_t> mark = entry.whole("mark");
  if (!mark) return mark.error();
  TrueEmitter emitter;
  emitter.mark = static_cast<std::uint32_t>(mark.value());
  if (emitter.mark == 0) {
    // Of what the photograph does not show, street lamps alone are of use.
    if (!entry.has("class")) return emitter;
    const Expected<LightClass> cls = read_class(entry, "class");
    if (!cls) return cls.error();
    if (cls.value() != LightClass::street_light_ht && cls.value() != LightClass::street_light_lt) return emitter;
  }
  const Expected<std::int64_t> id = entry.whole("id");
  if (!id) return id.error();
  emitter.id = static_cast<std::uint32_t>(id.value());
  for (const auto& [key, out] :
       {std::pair<const char*, LightClass*>{"class", &emitter.cls}, {"group_class", &emitter.group_cls}}) {
    const Expected<LightClass> cls = read_class(entry, key);
    if (!cls) return cls.error();
    *out = cls.value();
  }
  const Expected<SignalState> state = read_signal_state(entry);
  if (!state) return state.error();
  emitter.state = state.value();
  if (const Outcome read = read_emitter_geometry(entry, emitter); !read) return read.error();
  return emitter;
}

}  // namespace detail

inline Expected<Scene> read_scene(const std::string& dir_or_json, const ReadLimits& limits) {
  return guarded(dir_or_json, [&]() -> Expected<Scene> {
    std::error_code code;
    const bool folder = std::filesystem::is_directory(dir_or_json, code);
    const std::string path = folder ? (std::filesystem::path(dir_or_json) / "scene.json").string() : dir_or_json;
    const Expected<Json> json = read_json(path, limits);
    if (!json) return json.error();
    const Expected<JsonObject> root = JsonObject::of(path, "", json.value());
    if (!root) return root.error();
    return detail::scene_from_json(root.value(), limits);
  });
}

inline Expected<Image<float>> read_truth_depth(const Scene& scene, const ReadLimits& limits) {
  if (scene.truth.depth.empty()) return Error{scene.file, "truth.depth", "is missing, expected the name of a file"};
  return read_depth(scene.truth.depth, DepthFormat{}, limits);
}

inline Expected<Image<float>> read_truth_background_depth(const Scene& scene, const ReadLimits& limits) {
  if (scene.truth.background_depth.empty()) {
    return Error{scene.file, "truth.background_depth", "is missing, expected the name of a file"};
  }
  return read_depth(scene.truth.background_depth, DepthFormat{}, limits);
}

inline Expected<Image<Vec3f>> read_truth_normals(const Scene& scene, const ReadLimits& limits) {
  if (scene.truth.normals.empty()) return Error{scene.file, "truth.normals", "is missing, expected the name of a file"};
  return read_raw_normals(scene.truth.normals, limits);
}

inline Expected<Image<Vec3f>> read_truth_albedo(const Scene& scene, const ReadLimits& limits) {
  if (scene.truth.albedo.empty()) return Error{scene.file, "truth.albedo", "is missing, expected the name of a file"};
  return read_vec3_plane(scene.truth.albedo, limits);
}

inline Expected<std::vector<TrueEmitter>> read_truth_emitters(const Scene& scene, const ReadLimits& limits) {
  const std::string& path = scene.truth.emitters;
  if (path.empty()) return Error{scene.file, "truth.emitters", "is missing, expected the name of a file"};
  return guarded(path, [&]() -> Expected<std::vector<TrueEmitter>> {
    const Expected<Json> json = read_json(path, limits);
    if (!json) return json.error();
    const Expected<JsonObject> root = JsonObject::of(path, "", json.value());
    if (!root) return root.error();
    const Expected<const Json*> list = root.value().list("emitters");
    if (!list) return list.error();
    std::vector<TrueEmitter> emitters;
    for (std::size_t i = 0; i < list.value()->size(); ++i) {
      const Expected<JsonObject> entry =
          JsonObject::of(path, "emitters[" + std::to_string(i) + "]", (*list.value())[i]);
      if (!entry) return entry.error();
      const Expected<TrueEmitter> emitter = detail::true_emitter(entry.value());
      if (!emitter) return emitter.error();
      emitters.push_back(emitter.value());
    }
    return emitters;
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_READ_SCENE_HPP
