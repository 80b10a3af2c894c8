// SPDX-License-Identifier: Apache-2.0
// A scene folder in: scene.json names the files, their encodings and the camera.
//
// Only "image", "depth" and "camera" are required. Relative names are relative to scene.json. Every key is checked: an
// unknown one is an error that names it. Planes have to be of the image's size. What was found, assumed and converted
// is written to Scene::notes. Cost: every named file is read once, except "truth", which is read on demand.
#ifndef NPSIM_IO_SCENE_HPP
#define NPSIM_IO_SCENE_HPP

#include <filesystem>
#include <string>
#include <system_error>
#include <utility>

#include "npsim/io/detail/camera.hpp"
#include "npsim/io/detail/json_fields.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/detail/scene_data.hpp"
#include "npsim/io/detail/scene_planes.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/png_jpeg.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

// Runs read(entry) where the scene has the key.
template <class Read>
Outcome with_entry(const JsonObject& root, const char* key, Read&& read) {
  if (!root.has(key)) return Done{};
  const Expected<JsonObject> entry = root.object(key);
  if (!entry) return entry.error();
  return read(entry.value());
}

inline Outcome read_truth_names(const JsonObject& entry, Scene& scene) {
  const Outcome known = entry.allow_only({"depth", "background_depth", "normals", "mesh", "emitters"});
  if (!known) return known;
  const std::pair<const char*, std::string*> names[] = {{"depth", &scene.truth.depth},
                                                        {"background_depth", &scene.truth.background_depth},
                                                        {"normals", &scene.truth.normals},
                                                        {"mesh", &scene.truth.mesh},
                                                        {"emitters", &scene.truth.emitters}};
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
  Outcome known = root.allow_only({"npsim_scene", "name", "generator", "image", "depth", "camera", "labels",
                                   "instances", "normals", "albedo", "roughness", "lights", "truth"});
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
  // Stereo is to scale, and better than a height that changes with load and tyres.
  if (const Expected<std::string> how = depth_entry.value().text("encoding"); how.value() == "cityscapes_disparity") {
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
  read = with_entry(root, "normals", [&](const JsonObject& e) { return read_scene_normals(e, limits, scene); });
  if (!read) return read.error();
  read = with_entry(root, "albedo", [&](const JsonObject& e) { return read_scene_albedo(e, limits, scene); });
  if (!read) return read.error();
  read = with_entry(root, "roughness", [&](const JsonObject& e) { return read_scene_roughness(e, limits, scene); });
  if (!read) return read.error();
  read = with_entry(root, "lights", [&](const JsonObject& e) { return read_scene_lights(e, limits, scene); });
  if (!read) return read.error();
  read = with_entry(root, "truth", [&](const JsonObject& e) { return read_truth_names(e, scene); });
  if (!read) return read.error();

  if (!root.has("labels")) scene.notes.push_back("labels: none, all is one class");
  if (!root.has("normals")) scene.notes.push_back("normals: none, to be computed from depth");
  if (!root.has("lights")) scene.notes.push_back("lights: none are marked");
  return scene;
}

}  // namespace detail

// A folder with a scene.json, or the scene.json itself.
inline Expected<Scene> read_scene(const std::string& dir_or_json, const ReadLimits& limits = {}) {
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

// True depth of a generated scene, at the size it was generated with.
inline Expected<Image<float>> read_truth_depth(const Scene& scene, const ReadLimits& limits = {}) {
  if (scene.truth.depth.empty()) return Error{scene.file, "truth.depth", "is missing, expected the name of a file"};
  return read_depth(scene.truth.depth, DepthFormat{}, limits);
}

// True depth of a generated scene behind its foreground; 0 where nothing but sky is.
inline Expected<Image<float>> read_truth_background_depth(const Scene& scene, const ReadLimits& limits = {}) {
  if (scene.truth.background_depth.empty()) {
    return Error{scene.file, "truth.background_depth", "is missing, expected the name of a file"};
  }
  return read_depth(scene.truth.background_depth, DepthFormat{}, limits);
}

// True normals of a generated scene: canonical convention, zero where there is no surface.
inline Expected<Image<Vec3f>> read_truth_normals(const Scene& scene, const ReadLimits& limits = {}) {
  if (scene.truth.normals.empty()) return Error{scene.file, "truth.normals", "is missing, expected the name of a file"};
  return read_raw_normals(scene.truth.normals, limits);
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_SCENE_HPP
