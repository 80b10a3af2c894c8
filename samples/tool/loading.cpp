// SPDX-License-Identifier: Apache-2.0
#include "loading.hpp"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <string>
#include <system_error>

#include "npsim/io/scene_resize.hpp"
#include "options.hpp"

namespace npsim::tool {

io::Outcome expect_scene(const std::string& path, const char* or_else) {
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

io::Outcome resize_to(io::Scene& scene, const std::string& size) {
  if (size.empty()) return io::Done{};
  const io::Expected<Shape> shape = parse_size(size);
  if (!shape) return shape.error();
  return io::resize_scene(scene, shape.value());
}

io::Expected<io::Scene> load_scene(const std::string& path, const std::string& size) {
  if (!size.empty()) {
    const io::Expected<Shape> parsed = parse_size(size);
    if (!parsed) return parsed.error();
  }
  if (const io::Outcome good = expect_scene(path); !good) return good.error();
  io::Expected<io::Scene> scene = io::read_scene(path);
  if (scene) {
    if (const io::Outcome resized = resize_to(scene.value(), size); !resized) return resized.error();
  }
  return scene;
}

}  // namespace npsim::tool
