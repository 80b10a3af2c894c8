// SPDX-License-Identifier: Apache-2.0
// The planes that the cases work on: the generated street, made once per program and kept in memory.
#ifndef NPSIM_BENCH_FRONTIER_SCENE_HPP
#define NPSIM_BENCH_FRONTIER_SCENE_HPP

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/io/image.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim::bench {

struct Scene {
  Intrinsics intrinsics;
  io::Image<Rgb8> image;
  io::Image<Vec3f> lab;
  io::Image<float> depth;  // as a monocular network would give it, the sky at finite depth
  io::Image<Vec3f> normals;
  io::Image<Label> labels;
  io::Image<std::uint8_t> uncertain;
};

// The street of seed 1; made at the first call and when the shape changes.
[[nodiscard]] const Scene& street_scene(Shape shape);

// A benchmark that cannot run its kernel has nothing to say.
inline void must(const Status& status) {
  if (status.ok()) return;
  std::fprintf(stderr, "benchmark: %s: %s\n", status_code_name(status.code()), status.message());
  std::exit(1);
}

// A workspace with its memory.
class Arena {
 public:
  explicit Arena(std::size_t bytes)
      : memory_(bytes + kWorkspaceAlignment), workspace_(memory_.data(), memory_.size()) {}
  [[nodiscard]] Workspace& workspace() { return workspace_; }

 private:
  std::vector<unsigned char> memory_;
  Workspace workspace_;
};

[[nodiscard]] inline std::shared_ptr<Arena> make_arena(std::size_t bytes) { return std::make_shared<Arena>(bytes); }

}  // namespace npsim::bench

#endif  // NPSIM_BENCH_FRONTIER_SCENE_HPP
