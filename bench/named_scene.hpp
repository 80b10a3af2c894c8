// SPDX-License-Identifier: Apache-2.0
// A scene by name: streetSEED_WIDTHxHEIGHT is generated, anything else is the path of a scene.json or its folder.
#ifndef NPSIM_BENCH_NAMED_SCENE_HPP
#define NPSIM_BENCH_NAMED_SCENE_HPP

#include <cstdio>
#include <string>
#include <utility>

#include "host.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "tool/loading.hpp"
#include "street/scene_view.hpp"
#include "street/street.hpp"

namespace npsim::bench {

class NamedScene {
 public:
  NamedScene() = default;
  NamedScene(const NamedScene&) = delete;
  NamedScene& operator=(const NamedScene&) = delete;

  // False, and a line on stderr, where it cannot be read.
  [[nodiscard]] bool load(const std::string& name, ThreadPool& pool) {
    unsigned seed = 0;
    Shape shape;
    if (std::sscanf(name.c_str(), "street%u_%dx%d", &seed, &shape.width, &shape.height) == 3) {
      street::StreetParams params;
      params.seed = seed;
      params.shape = shape;
      params.samples = 1;
      params.sky_rays = 1;
      must(street::make_street(params, pool, street_));
      view_ = street::view_of(street_);
      view_.camera_height_m = street_.camera_height_m;
      return true;
    }
    io::Expected<io::Scene> read = tool::load_scene(name, "");
    if (!read) {
      std::fprintf(stderr, "benchmark: %s\n", read.error().line().c_str());
      return false;
    }
    scene_ = std::move(read.value());
    view_ = scene_.view();
    return true;
  }
  [[nodiscard]] const SceneView& view() const { return view_; }

 private:
  street::Street street_;
  io::Scene scene_;
  SceneView view_;
};

}  // namespace npsim::bench

#endif  // NPSIM_BENCH_NAMED_SCENE_HPP
