// SPDX-License-Identifier: Apache-2.0
// The planes that the cases work on: the generated street, made once per program and kept in memory.
#ifndef NPSIM_BENCH_FRONTIER_SCENE_HPP
#define NPSIM_BENCH_FRONTIER_SCENE_HPP

#include <cstddef>
#include <cstdint>
#include <memory>

#include "../host.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/vec.hpp"
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

[[nodiscard]] inline std::shared_ptr<Arena> make_arena(std::size_t bytes) { return std::make_shared<Arena>(bytes); }

}  // namespace npsim::bench

#endif  // NPSIM_BENCH_FRONTIER_SCENE_HPP
