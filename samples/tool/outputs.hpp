// SPDX-License-Identifier: Apache-2.0
// Keeps what a run reads from being replaced by what it writes.
//
// A command names the files it reads and every file it may write before it computes anything. One and the same file is
// found under any name: through another spelling, a link to it or to its folder, a hard link.
#ifndef NPSIM_SAMPLES_TOOL_OUTPUTS_HPP
#define NPSIM_SAMPLES_TOOL_OUTPUTS_HPP

#include <sys/types.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "npsim/io/error.hpp"
#include "npsim/io/scene.hpp"

namespace npsim::tool {

class InputFiles {
 public:
  InputFiles() = default;
  // Everything that the scene names, and what its true mesh names in turn.
  explicit InputFiles(const io::Scene& scene);

  void add(const std::string& path, const std::string& read_as);
  void add_files_of_obj(const std::string& path);  // its materials and their textures, without the OBJ itself

  // What the file is read as; empty: it is not among those that are read.
  [[nodiscard]] std::string read_as(const std::string& path) const;

  [[nodiscard]] io::Outcome expect_none_of(const std::vector<std::string>& outputs) const;

 private:
  std::map<std::string, std::string> by_name_;  // what each is read as
  std::map<std::pair<dev_t, ino_t>, std::string> by_id_;
};

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_OUTPUTS_HPP
