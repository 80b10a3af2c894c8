// SPDX-License-Identifier: Apache-2.0
#include "loss_report.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <utility>

#include "charts.hpp"
#include "depth_recorder.hpp"
#include "mesh_evaluation.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/depth/normals.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/metrics/geometry_errors.hpp"
#include "npsim/pipeline/night.hpp"
#include "tool/engine.hpp"
#include "tool/loading.hpp"
#include "tool/options.hpp"
#include "tool/outputs.hpp"

namespace npsim::tool {
namespace {

constexpr std::array<const char*, 7> kGrid = {"0.001", "0.01", "0.1", "1", "10", "100", "1000"};
constexpr std::array<float, 7> kGridWeights = {1e-3F, 1e-2F, 1e-1F, 1.0F, 1e1F, 1e2F, 1e3F};

using Mask = io::Image<std::uint8_t>;

// An edge whose surroundings of 3 x 3 pixels have one label.
[[nodiscard]] bool within_label(const SceneView& scene, int x, int y) {
  if (scene.labels.empty()) return true;
  for (int j = y - 1; j <= y + 1; ++j) {
    for (int i = x - 1; i <= x + 1; ++i) {
      if (scene.labels.contains(i, j) && scene.labels(i, j) != scene.labels(x, y)) return false;
    }
  }
  return true;
}

[[nodiscard]] double mean_angle(ImageView<const Vec3f> normals, ImageView<const Vec3f> reference, const Mask& mask,
                                ThreadPool& pool) {
  std::vector<unsigned char> memory(normal_errors_workspace_bytes(mask.shape()));
  Workspace workspace(memory.data(), memory.size());
  NormalErrors errors;
  if (reference.empty() || !normal_errors(normals, reference, mask.view(), errors, workspace, pool).ok()) return kNone;
  return errors.mean_deg;
}

// What the refined depth is like, on the surface pixels.
[[nodiscard]] Status judge(const RefineDepthParams& params, const SceneView& scene, const Truth& truth,
                           const RefinedDepth& refined, ImageView<const float> before, ThreadPool& pool, LossRun& out) {
  const Shape shape = scene.shape();
  Mask surface(shape);
  copy_pixels(refined.surface, surface.view());
  io::Image<Vec3f> normals(shape);
  Workspace none;
  NPSIM_RETURN_IF_ERROR(normals_from_depth(NormalsParams{}, ImageView<const float>(refined.depth), scene.camera,
                                           normals.view(), none, pool));
  DepthEdgeParams steps;
  steps.reach_px = std::clamp(shape.width / 240, 2, 64);
  Mask edges(shape);
  NPSIM_RETURN_IF_ERROR(depth_edges(steps, refined.depth, std::as_const(surface).view(), edges.view(), pool));
  TrueDepthAsRefined again;  // for the uncertain map of what came out
  NPSIM_RETURN_IF_ERROR(again.take(scene, refined, refined.depth, params.uncertainty, pool));
  std::size_t pixels = 0, gaps = 0, uncertain = 0;
  double moved = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (surface(x, y) == 0) continue;
      ++pixels;
      gaps += edges(x, y) != 0 && within_label(scene, x, y) ? 1U : 0U;
      uncertain += again.uncertain(x, y) != 0 ? 1U : 0U;
      moved += std::fabs(static_cast<double>(refined.depth(x, y)) / static_cast<double>(before(x, y)) - 1);
    }
  }
  out.moved = ratio(moved, static_cast<double>(pixels));
  out.gaps = share(gaps, pixels);
  out.uncertain = share(uncertain, pixels);
  out.angle_deg = mean_angle(normals.view(), refined.normals, surface, pool);
  if (truth.depth.empty()) return {};
  std::vector<unsigned char> memory(depth_errors_workspace_bytes(shape));
  Workspace workspace(memory.data(), memory.size());
  DepthErrors errors;
  if (depth_errors(refined.depth, truth.depth.view(), std::as_const(surface).view(), errors, workspace, pool).ok()) {
    out.abs_rel = errors.abs_rel;
  }
  out.normal_deg = mean_angle(normals.view(), truth.normals.view(), surface, pool);
  return {};
}

void append(std::string& csv, const char* format, double value) {
  char text[40];
  std::snprintf(text, sizeof text, format, value);
  if (std::isfinite(value)) csv += text;  // else an empty field
}

[[nodiscard]] std::string csv_of_curve(const LossRun& run) {
  std::string csv = "step,normal,continuity,depth,sum\n";
  for (std::size_t i = 0; i < run.curve.size(); ++i) {
    csv += std::to_string(i);
    for (const double v : {run.curve[i].normal, run.curve[i].continuity, run.curve[i].depth, run.curve[i].total}) {
      append(csv, ",%.9g", v);
    }
    csv += '\n';
  }
  return csv;
}

[[nodiscard]] std::string svg_of_curve(const std::string& scene, const LossRun& run) {
  std::vector<Curve> curves = {{"sum", {}}, {"", {}}, {"", {}}, {"", {}}};
  const std::array<float, 3> lambda = {run.lambda.normal, run.lambda.continuity, run.lambda.depth};
  const std::array<const char*, 3> names = {"normal", "continuity", "depth"};
  for (std::size_t k = 0; k < names.size(); ++k) {
    append(curves[k + 1].name, "%g", static_cast<double>(lambda[k]));
    curves[k + 1].name += std::string(" x ") + names[k];
  }
  for (const LossValues& l : run.curve) {
    curves[0].values.push_back(l.total);
    curves[1].values.push_back(static_cast<double>(lambda[0]) * l.normal);
    curves[2].values.push_back(static_cast<double>(lambda[1]) * l.continuity);
    curves[3].values.push_back(static_cast<double>(lambda[2]) * l.depth);
  }
  return svg_of_curves("Losses of the refinement, " + scene, "steps", curves);
}

struct Measure {
  const char* name;
  const char* in_picture;
  double LossRun::*value;
  double factor;
  int digits;
};
constexpr std::array<Measure, 6> kMeasures = {{
    {"moved", "depth moved, %", &LossRun::moved, 100, 2},
    {"angle_deg", "angle to the guiding normals, degrees", &LossRun::angle_deg, 1, 1},
    {"gaps", "jumps within a label, % of pixels", &LossRun::gaps, 100, 2},
    {"uncertain", "uncertain, % of pixels", &LossRun::uncertain, 100, 1},
    {"abs_rel", "relative error of depth, %", &LossRun::abs_rel, 100, 2},
    {"normal_deg", "error of normals, degrees", &LossRun::normal_deg, 1, 1},
}};

[[nodiscard]] std::string csv_of_grid(const std::vector<LossRun>& runs) {
  std::string csv = "lambda_1,lambda_2,lambda_3,steps,normal,continuity,depth,sum";
  for (const Measure& m : kMeasures) csv += std::string(",") + m.name;
  csv += '\n';
  for (const LossRun& run : runs) {
    append(csv, "%g", static_cast<double>(run.lambda.normal));
    append(csv, ",%g", static_cast<double>(run.lambda.continuity));
    append(csv, ",%g", static_cast<double>(run.lambda.depth));
    csv += "," + std::to_string(run.result.steps);
    const LossValues& l = run.result.last;
    for (const double v : {l.normal, l.continuity, l.depth, l.total}) append(csv, ",%.9g", v);
    for (const Measure& m : kMeasures) {
      csv += ',';
      append(csv, "%.6g", run.*m.value);
    }
    csv += '\n';
  }
  return csv;
}

[[nodiscard]] std::string svg_of_grid(const std::string& scene, const std::vector<LossRun>& runs) {
  std::vector<HeatMap> maps;
  for (const Measure& m : kMeasures) {
    HeatMap map{m.in_picture, {}, m.digits};
    for (const LossRun& run : runs) map.values.push_back(m.factor * (run.*m.value));
    const auto known = [](double v) { return std::isfinite(v); };
    if (std::any_of(map.values.begin(), map.values.end(), known)) maps.push_back(std::move(map));
  }
  const std::vector<std::string> weights(kGrid.begin(), kGrid.end());
  return svg_of_maps("Weights of the refinement, " + scene, "lambda 3, depth", weights, "lambda 2", weights, maps);
}

// What the refinement of this scene minimises.
[[nodiscard]] LossParams& losses(RefineDepthParams& params, const SceneView& scene) {
  return scene.normals.empty() ? params.own_normals_loss : params.refine.loss;
}

// lambda_2 from row to row, lambda_3 along a row.
[[nodiscard]] Status run_grid(RefineDepthParams params, const SceneView& scene, const Truth& truth, ThreadPool& pool,
                              Console& console, std::vector<LossRun>& out) {
  for (const float continuity : kGridWeights) {
    for (const float depth : kGridWeights) {
      LossWeights& lambda = losses(params, scene).lambda;
      lambda.continuity = continuity;
      lambda.depth = depth;
      out.emplace_back();
      NPSIM_RETURN_IF_ERROR(run_losses_once(params, scene, truth, pool, console, out.back()));
    }
  }
  return {};
}

void print_table(const std::vector<LossRun>& runs) {
  std::printf("\n%-10s %-10s %6s", "lambda 2", "lambda 3", "steps");
  for (const Measure& m : kMeasures) std::printf(" %10s", m.name);
  std::printf("\n");
  for (const LossRun& run : runs) {
    std::printf("%-10g %-10g %6d", static_cast<double>(run.lambda.continuity), static_cast<double>(run.lambda.depth),
                run.result.steps);
    for (const Measure& m : kMeasures) {
      if (std::isfinite(run.*m.value)) {
        std::printf(" %10.5f", run.*m.value);
      } else {
        std::printf(" %10s", "-");
      }
    }
    std::printf("\n");
  }
}

}  // namespace

Status run_losses_once(const RefineDepthParams& params, const SceneView& scene, const Truth& truth, ThreadPool& pool,
                       Console& console, LossRun& out) {
  out = LossRun{};
  RefineDepthParams kept = params;
  out.lambda = losses(kept, scene).lambda;
  out.curve.resize(static_cast<std::size_t>(refine_max_steps(params.refine)) + 1);
  kept.loss_curve = Span<LossValues>(out.curve.data(), out.curve.size());
  DepthRecorder recorder(console);
  std::vector<unsigned char> memory(refine_depth_workspace_bytes(kept, scene.shape()));
  Workspace workspace(memory.data(), memory.size());
  RefinedDepth refined;
  NPSIM_RETURN_IF_ERROR(engine::refine_depth(kept, scene, workspace, pool, recorder, refined));
  out.result = refined.refinement;
  out.curve.resize(out.result.evaluations > 0 ? static_cast<std::size_t>(out.result.steps) + 1 : 0);
  if (out.curve.empty()) return {};
  const auto& steps = recorder.kept();  // the last is the refinement's
  return judge(params, scene, truth, refined, steps[steps.size() - 2].second.view(), pool, out);
}

int run_losses(const EvaluateOptions& options) {
  Console console(options.quiet);
  io::Expected<io::Scene> scene = load_scene(options.scene, options.size);
  if (!scene) return fail(scene.error());
  Truth truth;
  if (!scene.value().truth.depth.empty()) {
    io::Expected<std::pair<io::Scene, Truth>> both = load_with_truth(options.scene, options.size, "");
    if (!both) return fail(both.error());
    truth = std::move(both.value().second);
  }
  const bool grid = !options.weights.empty();
  std::vector<std::string> files = {options.losses + "/losses.csv", options.losses + "/losses.svg"};
  if (grid) files.insert(files.end(), {options.losses + "/weights.csv", options.losses + "/weights.svg"});
  if (const io::Outcome apart = InputFiles(scene.value()).expect_none_of(files); !apart) return fail(apart.error());
  if (const io::Outcome made = make_folder(options.losses); !made) return fail(made.error());
  ThreadPool pool(thread_count(options.threads));
  const RefineDepthParams params = (options.preset == "thesis" ? thesis_night_params() : default_night_params()).depth;
  const SceneView view = scene.value().view();
  LossRun run;
  if (const Status s = run_losses_once(params, view, truth, pool, console, run); !s.ok()) return fail(options.scene, s);
  if (run.curve.empty()) {
    return fail(io::Error{scene.value().file, "--losses",
                          "measured depth is not refined by its own normals: expected normals, or estimated depth"});
  }
  const LossValues& first = run.result.first;
  const LossValues& last = run.result.last;
  std::printf("%-12s %12s %12s %12s %12s\n", "losses", "normal", "continuity", "depth", "sum");
  std::printf("%-12s %12.6g %12.6g %12.6g %12.6g\n", "at first", first.normal, first.continuity, first.depth,
              first.total);
  std::printf("%-12s %12.6g %12.6g %12.6g %12.6g\n", ("step " + std::to_string(run.result.steps)).c_str(), last.normal,
              last.continuity, last.depth, last.total);
  std::vector<std::string> contents = {csv_of_curve(run), svg_of_curve(scene.value().name, run)};
  if (grid) {
    std::vector<LossRun> runs;
    if (const Status s = run_grid(params, view, truth, pool, console, runs); !s.ok()) return fail(options.scene, s);
    print_table(runs);
    contents.insert(contents.end(), {csv_of_grid(runs), svg_of_grid(scene.value().name, runs)});
  }
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (const io::Outcome written = io::write_file(files[i], contents[i]); !written) return fail(written.error());
  }
  return kExitDone;
}

}  // namespace npsim::tool
