// SPDX-License-Identifier: Apache-2.0
// Refinement, perspective tangents, (1, 5, 1) in d / 80: how long until the loss that Adam reaches at step 1000.
//
// Each contender's time is that of a whole call, preparation included. Error: how far the loss stands above the least
// that any contender reached, as a share of it. Adam's earlier marks are shares of its time. PyTorch runs the same
// losses and Adam for a few steps in a process of its own; its time per step is scaled to 1000, and the loss is that of
// our Adam, whose first steps it has to match.
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cases.hpp"
#include "npsim/depth/refine.hpp"
#include "scene.hpp"

namespace npsim::bench {
namespace {

struct Torch {
  std::string version;
  double ms_per_step = 0;
  double first = 0;
  double last = 0;
};
constexpr int kTorchSteps = 7;

// What a command prints; empty if it fails.
[[nodiscard]] std::string output_of(const std::string& command) {
  std::FILE* pipe = popen((command + " 2>/dev/null").c_str(), "r");
  if (pipe == nullptr) return "";
  std::string text;
  std::array<char, 256> buffer{};
  while (std::fgets(buffer.data(), static_cast<int>(buffer.size()), pipe) != nullptr) text += buffer.data();
  return pclose(pipe) == 0 ? text : "";
}

[[nodiscard]] bool write_plane(const std::filesystem::path& path, const void* data, std::size_t bytes) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) return false;
  const bool written = std::fwrite(data, 1, bytes, file) == bytes;
  return (std::fclose(file) == 0) && written;
}

// Runs pytorch_refine.py with the first Python that has torch. False where there is none.
[[nodiscard]] bool run_torch(const Scene& scene, Torch& torch) {
  std::string python;
  for (const char* candidate : {"python3", "/usr/bin/python3"}) {
    if (!output_of(std::string(candidate) + " -c 'import numpy, torch; print(1)'").empty()) {
      python = candidate;
      break;
    }
  }
  if (python.empty()) return false;
  namespace fs = std::filesystem;
  std::error_code ignored;
  const fs::path folder = fs::temp_directory_path(ignored) / ("npsim_frontier_" + std::to_string(getpid()));
  fs::create_directories(folder, ignored);
  const std::size_t pixels = scene.depth.shape().pixels();
  const bool written = write_plane(folder / "depth.f32", scene.depth.data(), pixels * sizeof(float)) &&
                       write_plane(folder / "normals.f32", scene.normals.data(), pixels * sizeof(Vec3f)) &&
                       write_plane(folder / "uncertain.u8", scene.uncertain.data(), pixels);
  std::string text;
  if (written) {
    char arguments[256];
    const Intrinsics& k = scene.intrinsics;
    std::snprintf(arguments, sizeof(arguments), " %d %d %.9g %.9g %.9g %.9g %d", scene.depth.width(),
                  scene.depth.height(), static_cast<double>(k.fx), static_cast<double>(k.fy), static_cast<double>(k.cx),
                  static_cast<double>(k.cy), kTorchSteps);
    text =
        output_of(python + " '" NPSIM_BENCH_FRONTIER_DIR "/pytorch_refine.py' '" + folder.string() + "'" + arguments);
  }
  fs::remove_all(folder, ignored);
  char version[64] = {};
  if (std::sscanf(text.c_str(), "%63s %lf %lf %lf", version, &torch.ms_per_step, &torch.first, &torch.last) != 4) {
    return false;
  }
  torch.version = version;
  return true;
}

[[nodiscard]] RefineParams shared_params() {
  RefineParams params;
  params.loss = LossParams{};  // perspective tangents, printed continuity, metric, (1, 5, 1)
  params.loss.depth_unit_m = 80;
  params.stop_relative_decrease = 0;
  return params;
}

}  // namespace

Comparison refine_case(const Options& options) {
  const Scene& scene = street_scene(options.shape);
  const Shape shape = options.shape;
  Comparison comparison{"refine", "Refinement, to the loss of Adam's step 1000", shape, {}};
  LossInput<float> input;
  input.depth_est = scene.depth.view();
  input.normals = scene.normals.view();
  input.uncertain = scene.uncertain.view();
  input.intrinsics = scene.intrinsics;

  const int steps = options.quick ? 100 : 1000;
  std::vector<LossValues> adam_curve(static_cast<std::size_t>(steps) + 1);
  std::vector<std::shared_ptr<RefineResult>> results;  // of the contenders, in their order
  // change: applied to the parameters at every run, as the target is known only after Adam has run.
  const auto add = [&](const std::string& method, const std::string& setting, const RefineParams& params,
                       std::vector<LossValues>* curve, const std::function<void(RefineParams&)>& change) {
    const auto out = std::make_shared<io::Image<float>>(shape);
    const auto arena = make_arena(refine_workspace_bytes(params, shape));
    const auto result = std::make_shared<RefineResult>();
    results.push_back(result);
    comparison.add(method, setting, [=, &input] {
      RefineParams p = params;
      if (change) change(p);
      SerialExecutor executor;
      const Span<LossValues> losses =
          curve == nullptr ? Span<LossValues>() : Span<LossValues>(curve->data(), curve->size());
      must(refine_with_normals(p, input, out->view(), losses, *result, arena->workspace(), executor));
    });
  };
  RefineParams adam = shared_params();
  adam.solver = RefineSolver::adam;
  adam.adam.steps = steps;
  add("npsim adam", std::to_string(steps) + " steps", adam, &adam_curve, {});
  comparison.contenders.front().peer = true;
  RefineParams newton = shared_params();
  newton.solver = RefineSolver::gauss_newton;
  newton.gauss_newton.relative_decrease = 0;
  add("npsim gauss-newton", "to adam's loss", newton, nullptr,
      [&](RefineParams& p) { p.gauss_newton.target_loss = static_cast<float>(adam_curve.back().total); });
  for (const int outer : {1, 2, 3, 5}) {
    newton.gauss_newton.steps = outer;
    add("npsim gauss-newton", std::to_string(outer) + (outer == 1 ? " step" : " steps"), newton, nullptr, {});
  }
  newton.gauss_newton.steps = 20;
  newton.gauss_newton.inner_steps = 2;
  add("npsim gauss-newton", "to adam's loss by 2 inner steps at a time", newton, nullptr,
      [&](RefineParams& p) { p.gauss_newton.target_loss = static_cast<float>(adam_curve.back().total); });
  newton = shared_params();
  newton.solver = RefineSolver::gauss_newton;
  add("npsim gauss-newton", "until its own stop", newton, nullptr, {});
  measure(options, comparison);

  const double target = adam_curve.back().total;
  double least = target;
  for (const auto& result : results) least = std::min(least, result->last.total);
  const auto above = [&least](double loss) {
    return std::vector<Error>{{(loss - least) / least, kNone, "loss / least loss - 1"}};
  };
  const double adam_ms = comparison.contenders.front().time_ms;
  for (std::size_t i = 0; i < results.size(); ++i) {
    comparison.contenders[i].errors = above(results[i]->last.total);
    std::fprintf(stderr, "  %-24s %-24s %4d steps, %4d inner, loss %.7g\n", comparison.contenders[i].method.c_str(),
                 comparison.contenders[i].setting.c_str(), results[i]->steps, results[i]->inner_steps,
                 results[i]->last.total);
  }
  if (wanted(options, "pytorch adam")) {
    Torch torch;
    if (run_torch(scene, torch)) {
      const double matching = adam_curve[kTorchSteps].total;
      std::fprintf(stderr, "  pytorch %s: %.4g ms per step; loss %.7g then %.7g, ours %.7g then %.7g\n",
                   torch.version.c_str(), torch.ms_per_step, torch.first, torch.last, adam_curve.front().total,
                   matching);
      if (!(std::fabs(torch.last - matching) < 1e-3 * matching)) {
        std::fprintf(stderr, "benchmark: PyTorch does not minimise the same loss\n");
        std::exit(1);
      }
      Contender& c = comparison.add_peer(
          "pytorch adam", std::to_string(steps) + " steps, " + std::to_string(kTorchSteps) + " of them run", {});
      c.time_ms = steps * torch.ms_per_step;
      c.errors = above(target);
    } else {
      comparison.add_absent("python3 torch");
    }
  }
  for (const int part : {10, 30, 100, 300}) {
    if (part >= steps) continue;
    Contender& c = comparison.add_peer("npsim adam", std::to_string(part) + " steps", {});
    c.group = "parts";  // marks in the picture, not peers to be set against
    c.time_ms = adam_ms * part / steps;
    c.errors = above(adam_curve[static_cast<std::size_t>(part)].total);
  }
  return comparison;
}

}  // namespace npsim::bench
