// SPDX-License-Identifier: Apache-2.0
// Keeps what a run reads from being replaced by what it writes.
//
// A command names the files it reads and every file it may write before it computes anything. One and the same file is
// found under any name: through another spelling, a link to it or to its folder, a hard link.
#ifndef NPSIM_SAMPLES_TOOL_OUTPUTS_HPP
#define NPSIM_SAMPLES_TOOL_OUTPUTS_HPP

#include <sys/stat.h>

#include <filesystem>
#include <map>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "npsim/io/error.hpp"
#include "npsim/io/obj.hpp"
#include "npsim/io/scene.hpp"

namespace npsim::tool {

class InputFiles {
 public:
  InputFiles() = default;
  // Everything that the scene names, and what its true mesh names in turn.
  explicit InputFiles(const io::Scene& scene) {
    for (const io::SceneFile& file : scene.files) {
      add(file.path, file.field.empty() ? "the scene" : "\"" + file.field + "\" of " + scene.file);
    }
    if (!scene.truth.mesh.empty()) add_files_of_obj(scene.truth.mesh);
  }

  void add(const std::string& path, const std::string& read_as) {
    by_name_.emplace(name_of(path), read_as);
    struct stat entry {};
    if (::stat(path.c_str(), &entry) == 0) by_id_.emplace(std::pair(entry.st_dev, entry.st_ino), read_as);
  }
  void add_files_of_obj(const std::string& path) {
    for (const std::string& file : io::files_beside_obj(path)) add(file, "a material or texture of " + path);
  }

  // What the file is read as; empty: it is not among those that are read.
  [[nodiscard]] std::string read_as(const std::string& path) const {
    if (const auto named = by_name_.find(name_of(path)); named != by_name_.end()) return named->second;
    struct stat entry {};
    if (::stat(path.c_str(), &entry) != 0) return {};
    const auto same = by_id_.find(std::pair(entry.st_dev, entry.st_ino));
    return same == by_id_.end() ? std::string() : same->second;
  }

  [[nodiscard]] io::Outcome expect_none_of(const std::vector<std::string>& outputs) const {
    for (const std::string& path : outputs) {
      if (const std::string what = read_as(path); !what.empty()) {
        return io::Error{path, "", "would be written over, but is read as " + what + ": expected another output"};
      }
    }
    return io::Done{};
  }

 private:
  // The file's place, whether or not there is a file yet. Links in the name of its folder are followed.
  [[nodiscard]] static std::string name_of(const std::string& path) {
    std::error_code code;
    const std::filesystem::path place = std::filesystem::absolute(path, code);
    const std::filesystem::path folder = std::filesystem::weakly_canonical(place.parent_path(), code);
    return code ? path : (folder / place.filename()).string();
  }

  std::map<std::string, std::string> by_name_;  // what each is read as
  std::map<std::pair<dev_t, ino_t>, std::string> by_id_;
};

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_OUTPUTS_HPP
