// SPDX-License-Identifier: Apache-2.0
// Light transport of the generated street, error by rays, denoiser, bounces and threshold.
//
// A side of the picture is a quarter of --size. Each contender's time is that of its light stages alone: rays, images of
// all lights, and their sum for one night. Error: of the night's luminance against the same mesh and lamps with many
// more rays, four bounces, no denoiser and no threshold, where that is above .005 cd/m2: the root of the trimmed relative
// squared error, and of |log2| the 95th percentile.
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "../host.hpp"
#include "../named_scene.hpp"
#include "cases.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/memory.hpp"
#include "npsim/metrics/luminance_errors.hpp"
#include "npsim/pipeline/night.hpp"
#include "tool/engine.hpp"

namespace npsim::bench {
namespace {

// Time of the stages that light takes.
class LightClock : public NullObserver {
 public:
  void begin(Stage) { started_ = Clock::now(); }
  void end(Stage stage) {
    if (stage == Stage::build_trace || stage == Stage::render || stage == Stage::add_lights) {
      ms_ += std::chrono::duration<double, std::milli>(Clock::now() - started_).count();
    }
  }
  [[nodiscard]] double ms() const { return ms_; }

 private:
  using Clock = std::chrono::steady_clock;
  Clock::time_point started_;
  double ms_ = 0;
};

struct KeptLight : NullSink {
  io::Image<Vec3f> light;
  Status night(const Night& night) {
    light = io::Image<Vec3f>(night.luminance.shape());
    copy_pixels(night.luminance, light.view());
    return {};
  }
};

struct Setting {
  std::string method, name;
  RelightParams light;
};

[[nodiscard]] std::vector<Setting> settings(const RelightParams& usual) {
  std::vector<Setting> out;
  for (const int rays : {1, 2, 4, 8, 16, 32, 64}) {
    out.push_back({"denoised", std::to_string(rays) + " rays", usual});
    out.back().light.gather.rays = rays;
  }
  for (const int rays : {8, 32, 128}) {
    out.push_back({"not denoised", std::to_string(rays) + " rays", usual});
    out.back().light.gather.rays = rays;
    out.back().light.denoise.iterations = 0;
  }
  for (const int bounces : {1, 3, 4}) {
    out.push_back({"bounces", std::to_string(bounces), usual});
    out.back().light.bounces = bounces;
  }
  for (const float times : {0.0F, 0.1F, 4.0F, 16.0F}) {
    const std::string name = std::to_string(times).substr(0, times < 1 ? 3 : times < 10 ? 1 : 2);
    out.push_back({"threshold", name + " times the usual", usual});
    out.back().light.visibility.cutoff_lx *= times;
    out.back().light.visibility.cutoff_share *= times;
    out.back().light.least_cd_m2 *= times;
  }
  for (const int lattice : {1, 4, 8}) {
    out.push_back({"lattice of shadow rays", std::to_string(lattice) + " points", usual});
    out.back().light.visibility.lattice = lattice;
  }
  return out;
}

}  // namespace

Comparison light_case(const Options& options) {
  const Shape shape{std::max(64, options.shape.width / 4), std::max(64, options.shape.height / 4)};
  Comparison comparison{"light", "Light transport, one thread", shape, {}};
  ThreadPool pool(1);
  NamedScene scene;
  if (!scene.load("street1_" + std::to_string(shape.width) + "x" + std::to_string(shape.height), pool))
    return comparison;
  const SceneView& view = scene.view();
  NightParams params = default_night_params();
  params.seed = 1;
  params.variants = 2;
  Arena arena(refine_depth_workspace_bytes(params.depth, shape));
  NullObserver unwatched;
  RefinedDepth refined;
  must(engine::refine_depth(params.depth, view, arena.workspace(), pool, unwatched, refined));
  io::Image<Vec3f> normals(shape);  // make_nights_of_depth() uses them up
  copy_pixels(refined.normals, normals.view());

  const auto night = [&](const RelightParams& light, double& ms) {
    params.relight = light;
    io::HostMemory memory(night_workspace_bytes(params, shape, view.lights.size()));
    Workspace workspace = memory.workspace();
    copy_pixels(normals.view(), refined.normals);
    LightClock clock;
    KeptLight kept;
    must(engine::make_nights_of_depth(params, view, refined, workspace, pool, clock, kept));
    ms = clock.ms();
    return std::move(kept.light);
  };
  const RelightParams usual = params.relight;
  RelightParams many = usual;
  many.gather.rays = many.max_rays = options.quick ? 64 : 1024;
  many.denoise.iterations = 0;
  many.bounces = 4;
  many.visibility.cutoff_lx = many.visibility.cutoff_share = many.least_cd_m2 = 0;
  many.visibility.samples_per_side = 8;
  many.visibility.lattice = 1;
  double ms = 0;
  const io::Image<Vec3f> truth = night(many, ms);

  const std::vector<Setting> all = settings(usual);
  std::vector<std::vector<double>> times(all.size());
  Arena judge(luminance_errors_workspace_bytes(shape));
  for (int round = 0; round < options.repeats; ++round) {
    for (std::size_t i = 0; i < all.size(); ++i) {
      const io::Image<Vec3f> light = night(all[i].light, ms);
      times[i].push_back(ms);
      if (round > 0) continue;
      LuminanceErrors errors;
      must(luminance_errors({}, light.view(), truth.view(), {}, errors, judge.workspace()));
      Contender& c = comparison.add(all[i].method, all[i].name, {});
      c.errors = {{std::sqrt(errors.trimmed_relative_squared), kNone, "root of trimmed relative squared error"},
                  {errors.p95, kNone, "95 % of |log2|"}};
    }
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    std::sort(times[i].begin(), times[i].end());
    comparison.contenders[i].time_ms = times[i][times[i].size() / 2];
  }
  return comparison;
}

}  // namespace npsim::bench
