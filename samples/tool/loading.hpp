// SPDX-License-Identifier: Apache-2.0
// From a scene on disk to the view that the pipeline takes.
#ifndef NPSIM_SAMPLES_TOOL_LOADING_HPP
#define NPSIM_SAMPLES_TOOL_LOADING_HPP

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <string>
#include <system_error>

#include "npsim/io/scene.hpp"
#include "npsim/io/scene_resize.hpp"
#include "npsim/core/scene_view.hpp"
#include "options.hpp"

namespace npsim::tool {

[[nodiscard]] inline SceneView view_of(const io::Scene& scene) {
  SceneView view;
  view.camera = scene.intrinsics;
  view.camera_height_m = static_cast<float>(scene.camera_height_m);
  view.image = scene.image.view();
  view.depth = scene.depth.view();
  view.labels = scene.labels.view();
  view.instances = scene.instances.view();
  view.normals = scene.normals.view();
  view.albedo = scene.albedo.view();
  view.roughness = scene.roughness.view();
  view.light_index = scene.light_index.view();
  view.lights = Span<const LightMark>(scene.lights.data(), scene.lights.size());
  return view;
}

// A file that by its name is something else than a scene.json, and would be called broken JSON.
[[nodiscard]] inline io::Outcome expect_scene(const std::string& path, const char* or_else = "") {
  constexpr const char* kOthers[] = {".obj", ".mtl",  ".glb", ".gltf", ".ply", ".stl", ".png",
                                     ".jpg", ".jpeg", ".pfm", ".npy",  ".hdr", ".exr"};
  std::error_code ignored;
  const std::filesystem::path file(path);
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  if (std::none_of(std::begin(kOthers), std::end(kOthers), [&](const char* e) { return extension == e; })) {
    return io::Done{};
  }
  if (!std::filesystem::is_regular_file(file, ignored)) return io::Done{};  // what is missing is called missing
  return io::Error{path, "",
                   std::string("is no scene, expected a folder with a scene.json or the scene.json itself") + or_else};
}

// Reads the scene and, where `size` is not empty, resamples it.
[[nodiscard]] inline io::Expected<io::Scene> load_scene(const std::string& path, const std::string& size) {
  Shape shape;
  if (!size.empty()) {
    const io::Expected<Shape> parsed = parse_size(size);
    if (!parsed) return parsed.error();
    shape = parsed.value();
  }
  if (const io::Outcome good = expect_scene(path); !good) return good.error();
  io::Expected<io::Scene> scene = io::read_scene(path);
  if (scene && !size.empty()) {
    if (const io::Outcome resized = io::resize_scene(scene.value(), shape); !resized) return resized.error();
  }
  return scene;
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_LOADING_HPP
