// SPDX-License-Identifier: Apache-2.0
#include "outputs.hpp"

#include <sys/stat.h>

#include <filesystem>
#include <system_error>

#include "npsim/io/obj.hpp"

namespace npsim::tool {
namespace {

// The file's place, whether or not there is a file yet. Links in the name of its folder are followed.
[[nodiscard]] std::string name_of(const std::string& path) {
  std::error_code code;
  const std::filesystem::path place = std::filesystem::absolute(path, code);
  const std::filesystem::path folder = std::filesystem::weakly_canonical(place.parent_path(), code);
  return code ? path : (folder / place.filename()).string();
}

}  // namespace

InputFiles::InputFiles(const io::Scene& scene) {
  for (const io::SceneFile& file : scene.files) {
    add(file.path, file.field.empty() ? "the scene" : "\"" + file.field + "\" of " + scene.file);
  }
  if (!scene.truth.mesh.empty()) add_files_of_obj(scene.truth.mesh);
}

void InputFiles::add(const std::string& path, const std::string& read_as) {
  by_name_.emplace(name_of(path), read_as);
  struct stat entry {};
  if (::stat(path.c_str(), &entry) == 0) by_id_.emplace(std::pair(entry.st_dev, entry.st_ino), read_as);
}

void InputFiles::add_files_of_obj(const std::string& path) {
  for (const std::string& file : io::files_beside_obj(path)) add(file, "a material or texture of " + path);
}

std::string InputFiles::read_as(const std::string& path) const {
  if (const auto named = by_name_.find(name_of(path)); named != by_name_.end()) return named->second;
  struct stat entry {};
  if (::stat(path.c_str(), &entry) != 0) return {};
  const auto same = by_id_.find(std::pair(entry.st_dev, entry.st_ino));
  return same == by_id_.end() ? std::string() : same->second;
}

io::Outcome InputFiles::expect_none_of(const std::vector<std::string>& outputs) const {
  for (const std::string& path : outputs) {
    if (const std::string what = read_as(path); !what.empty()) {
      return io::Error{path, "", "would be written over, but is read as " + what + ": expected another output"};
    }
  }
  return io::Done{};
}

}  // namespace npsim::tool
