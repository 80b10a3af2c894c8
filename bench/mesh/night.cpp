// SPDX-License-Identifier: Apache-2.0
// npsim_bench_night_faces: what the night loses and how much sooner it is done when its mesh has fewer triangles, as
// CSV.
//
// One line for the layers as they are (faces: those of their mesh), one for their mesh, then one for each bound on
// depth, with the pipeline's other settings; changes are against the first.
// mean_change: of the mean of the linear night, the colour channel that changes most; rms_change: root mean square of
// the change of a displayed pixel, in codes of 255, over the picture.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <thread>

#include "../host.hpp"
#include "../named_scene.hpp"
#include "../options.hpp"
#include "lab/kept_night.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/pipeline/night.hpp"
#include "tool/engine.hpp"

namespace {

using namespace npsim;
using tool::KeptNight;

// Wall time of each stage, all calls together.
struct Clock : NullObserver {
  std::array<double, static_cast<std::size_t>(Stage::count_)> seconds{};
  std::chrono::steady_clock::time_point started;
  void begin(Stage) { started = std::chrono::steady_clock::now(); }
  void end(Stage stage) {
    seconds[static_cast<std::size_t>(stage)] +=
        std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
  }
  [[nodiscard]] double of(Stage stage) const { return seconds[static_cast<std::size_t>(stage)]; }
};

void run(const NightParams& params, const SceneView& scene, ThreadPool& pool, Clock& clock, KeptNight& night) {
  const std::size_t bytes = night_workspace_bytes(params, scene.shape(), scene.lights.size());
  const std::unique_ptr<unsigned char[]> memory(new unsigned char[bytes]);  // most of it is never touched
  Workspace workspace(memory.get(), bytes);
  bench::must(engine::make_nights(params, scene, workspace, pool, clock, night));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("What the night loses and how much sooner it is done when its mesh has fewer triangles, as CSV");
  std::string name = "street1_960x540";
  unsigned threads = std::max(1U, std::thread::hardware_concurrency());
  app.add_option("scene", name, "a scene.json, its folder, or streetSEED_WIDTHxHEIGHT")->capture_default_str();
  app.add_option("--threads", threads, "of the whole")->capture_default_str()->check(CLI::Range(1, 1024));
  if (const auto status = bench::parse(app, argc, argv)) return *status;
  ThreadPool pool(threads);
  bench::NamedScene scene;
  if (!scene.load(name, pool)) return 1;
  std::printf("scene,traced,bound,faces,share,complete_s,build_s,transport_s,mean_change,rms_change\n");
  KeptNight full;
  for (const float bound : {-1.0F, 0.0F, 0.001F, 0.002F, 0.005F, 0.01F, 0.02F, 0.05F, 0.1F}) {
    NightParams params = default_night_params();
    params.mesh.traced = bound < 0.0F ? TracedFaces::layers : TracedFaces::mesh;
    params.mesh.simplify_faces = bound > 0.0F;
    params.mesh.simplify.max_relative_depth_error = std::max(bound, 0.0F);
    if (bound > 0.02F) params.mesh.simplify.max_texture_shift = 0.0F;
    Clock clock;
    KeptNight night;
    run(params, scene.view(), pool, clock, night);
    if (full.picture.empty()) full = night;
    std::printf("%s,%s,%g,%zu,%.4f,%.2f,%.2f,%.1f,%.5f,%.2f\n", name.c_str(), bound < 0.0F ? "layers" : "mesh",
                static_cast<double>(std::max(bound, 0.0F)), night.faces,
                static_cast<double>(night.faces) / static_cast<double>(full.faces),
                clock.of(Stage::complete) + clock.of(Stage::mesh), clock.of(Stage::build_trace),
                clock.of(Stage::render), mean_colour_change(full, night), rms_change_codes(full, night));
    std::fflush(stdout);
  }
  return 0;
}
