// SPDX-License-Identifier: Apache-2.0
#include "evaluate_command.hpp"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "evaluation.hpp"
#include "flatness.hpp"
#include "hold_out.hpp"
#include "loss_report.hpp"
#include "mesh_report.hpp"
#include "night_stages.hpp"
#include "npsim/core/config.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/pipeline/night.hpp"
#include "scene_truth.hpp"
#include "tool/console.hpp"
#include "tool/figures.hpp"
#include "tool/loading.hpp"
#include "tool/options.hpp"
#include "tool/outputs.hpp"

namespace npsim::tool {
namespace {

[[nodiscard]] OrderedJson to_json(const std::optional<DepthErrors>& e) {
  if (!e) return nullptr;
  return {{"pixels", e->pixels},
          {"abs_rel", e->abs_rel},
          {"median_abs_rel", e->median_abs_rel},
          {"rmse_m", e->rmse_m},
          {"rmse_log", e->rmse_log},
          {"si_log", e->si_log},
          {"scale", std::exp(e->mean_log)},
          {"delta_1", e->delta[0]},
          {"delta_2", e->delta[1]},
          {"delta_3", e->delta[2]}};
}

[[nodiscard]] OrderedJson to_json(const std::optional<NormalErrors>& e) {
  if (!e) return nullptr;
  return {{"pixels", e->pixels},
          {"rms_deg", e->rms_deg},
          {"mean_deg", e->mean_deg},
          {"median_deg", e->median_deg},
          {"below_5", e->share_below[0]},
          {"below_11.5", e->share_below[1]},
          {"below_22.5", e->share_below[2]},
          {"below_30", e->share_below[3]}};
}

[[nodiscard]] OrderedJson to_json(const NormalRow& row) {
  return {{"all", to_json(row.all)}, {"smooth", to_json(row.smooth)}};
}

[[nodiscard]] OrderedJson to_json(const std::optional<EdgeErrors>& e) {
  if (!e) return nullptr;
  return {{"true_pixels", e->truth_pixels},
          {"pixels", e->pixels},
          {"accuracy_px", e->accuracy_px},
          {"completeness_px", e->completeness_px}};
}

[[nodiscard]] OrderedJson hits_json(const MaskOverlap& o) {
  return {{"true_pixels", o.first}, {"marked", o.both}, {"hit_rate", share(o.both, o.first)}};
}

[[nodiscard]] OrderedJson ratios_json(const StepErrors& step, const StepErrors& input) {
  OrderedJson json;
  const auto add = [&](const char* key, const auto& of, const auto& from, const auto& member) {
    json[key] = of && from ? ratio((*of).*member, (*from).*member) : kNone;
  };
  add("abs_rel", step.depth, input.depth, &DepthErrors::abs_rel);
  add("median_abs_rel", step.depth, input.depth, &DepthErrors::median_abs_rel);
  add("rmse_m", step.depth, input.depth, &DepthErrors::rmse_m);
  add("si_log", step.depth, input.depth, &DepthErrors::si_log);
  add("abs_rel_near_edges", step.near_edges, input.near_edges, &DepthErrors::abs_rel);
  add("edge_accuracy_px", step.edges, input.edges, &EdgeErrors::accuracy_px);
  add("edge_completeness_px", step.edges, input.edges, &EdgeErrors::completeness_px);
  add("normal_rms_deg", step.normals.all, input.normals.all, &NormalErrors::rms_deg);
  add("normal_mean_deg", step.normals.all, input.normals.all, &NormalErrors::mean_deg);
  add("normal_median_deg", step.normals.all, input.normals.all, &NormalErrors::median_deg);
  add("normal_rms_deg_smooth", step.normals.smooth, input.normals.smooth, &NormalErrors::rms_deg);
  return json;
}

[[nodiscard]] OrderedJson to_json(const Evaluation& e, const io::Scene& scene, const EvaluateOptions& options) {
  OrderedJson steps = OrderedJson::array();
  for (const StepErrors& s : e.steps) {
    steps.push_back({{"step", s.key},
                     {"depth", to_json(s.depth)},
                     {"depth_near_edges", to_json(s.near_edges)},
                     {"edges", to_json(s.edges)},
                     {"normals_of_depth", to_json(s.normals)},
                     {"ratio_to_given", ratios_json(s, e.steps.front())}});
  }
  OrderedJson labels = OrderedJson::object();
  for (const LabelErrors& l : e.labels) {
    OrderedJson& entry = labels[kLabels[l.label].name];
    for (std::size_t i = 0; i < l.depth.size(); ++i) {
      entry[e.steps[i].key] = {{"depth", to_json(l.depth[i])}, {"normals_of_depth", to_json(l.normals[i])}};
    }
  }
  OrderedJson meshes = OrderedJson::array();
  OrderedJson costs = OrderedJson::object();
  for (const MeshErrors& m : e.meshes) {
    meshes.push_back(to_json(m));
    costs[m.key] = costs_json(m);
  }
  OrderedJson lamps = OrderedJson::array();
  for (const LampErrors& l : e.lamps) lamps.push_back(to_json(l));
  return {{"npsim", NPSIM_VERSION_STRING},
          {"scene", scene.name},
          {"settings", {{"preset", options.preset}, {"width", scene.image.width()}, {"height", scene.image.height()}}},
          {"pixels", {{"surface", e.surface_pixels}, {"judged", e.pixels}}},
          {"edges",
           {{"min_step", e.edge_params.min_step},
            {"reach_px", e.edge_params.reach_px},
            {"max_distance_px", e.distance_params.max_distance_px},
            {"near_px", e.near_edges_px}}},
          {"steps", std::move(steps)},
          {"normals",
           {{"given", to_json(e.given_normals)},
            {"guiding", to_json(e.guiding_normals)},
            {"of_true_depth", to_json(e.true_depth_normals)}}},
          {"coverage", to_json(e.coverage)},
          {"uncertain",
           {{"share_of_judged", share(e.uncertain_on_edges.second, e.pixels)},
            {"edges", hits_json(e.uncertain_on_edges)},
            {"foreground_edges", hits_json(e.uncertain_on_foreground_edges)},
            {"share_near_edges", share(e.uncertain_near_edges.both, e.uncertain_near_edges.second)}}},
          {"labels", std::move(labels)},
          {"mesh", std::move(meshes)},
          {"lamps", std::move(lamps)},
          {"albedo", e.albedo ? to_json(*e.albedo) : OrderedJson()},
          {"nights", to_json(e.stages)},
          {"night_of_simplified_mesh", e.night ? to_json(*e.night) : OrderedJson()},
          {"costs", std::move(costs)},
          {"notes", scene.notes}};
}

// One figure of a table, or a dash where there is none.
void print_cell(int width, int digits, double value) {
  if (std::isfinite(value)) {
    std::printf(" %*.*f", width, digits, value);
  } else {
    std::printf(" %*s", width, "-");
  }
}

template <class Errors>
void print_with_ratio(int width, int digits, const std::optional<Errors>& of, const std::optional<Errors>& input,
                      double Errors::*member) {
  print_cell(width, digits, of ? (*of).*member : kNone);
  print_cell(6, 3, of && input ? ratio((*of).*member, (*input).*member) : kNone);
}

void print_normals(const char* name, const NormalRow& row, const NormalRow& input_row) {
  const std::optional<NormalErrors>& e = row.all;
  const std::optional<NormalErrors>& input = input_row.all;
  std::printf("%-30s", name);
  print_with_ratio(7, 2, e, input, &NormalErrors::rms_deg);
  print_with_ratio(7, 2, e, input, &NormalErrors::mean_deg);
  print_with_ratio(7, 2, e, input, &NormalErrors::median_deg);
  print_with_ratio(7, 2, row.smooth, input_row.smooth, &NormalErrors::rms_deg);
  for (std::size_t k = 0; k < 4; ++k) print_cell(6, 3, e ? e->share_below[k] : kNone);
  std::printf("\n");
}

void print_table(const Evaluation& e, const io::Scene& scene, const EvaluateOptions& options) {
  std::printf("%s, %d x %d, preset %s: judged on %zu pixels, %.1f %% of the surface with a true depth\n\n",
              scene.name.c_str(), scene.image.width(), scene.image.height(), options.preset.c_str(), e.pixels,
              100 * share(e.pixels, e.surface_pixels));
  std::printf("%-30s %7s %6s %7s %6s %7s %6s %7s %7s %6s %6s %6s\n", "depth", "AbsRel", "ratio", "RMSE m", "ratio",
              "SI-log", "ratio", "d<1.25", "at edge", "ratio", "off px", "miss px");
  const StepErrors& input = e.steps.front();
  for (const StepErrors& s : e.steps) {
    std::printf("%-30s", s.name.c_str());
    print_with_ratio(7, 4, s.depth, input.depth, &DepthErrors::abs_rel);
    print_with_ratio(7, 3, s.depth, input.depth, &DepthErrors::rmse_m);
    print_with_ratio(7, 4, s.depth, input.depth, &DepthErrors::si_log);
    print_cell(7, 4, s.depth ? s.depth->delta[0] : kNone);
    print_with_ratio(7, 4, s.near_edges, input.near_edges, &DepthErrors::abs_rel);
    print_cell(6, 2, s.edges ? s.edges->accuracy_px : kNone);
    print_cell(7, 2, s.edges ? s.edges->completeness_px : kNone);
    std::printf("\n");
  }
  std::printf("\n%-30s %7s %6s %7s %6s %7s %6s %7s %6s %6s %6s %6s %6s\n", "normals of depth, degrees", "RMS", "ratio",
              "mean", "ratio", "median", "ratio", "smooth", "ratio", "<5", "<11.5", "<22.5", "<30");
  for (const StepErrors& s : e.steps) print_normals(s.name.c_str(), s.normals, input.normals);
  print_normals("true depth", e.true_depth_normals, input.normals);
  print_normals("normals as given", e.given_normals, input.normals);
  print_normals("normals that guided", e.guiding_normals, input.normals);
  const auto percent = [](std::size_t part, std::size_t whole) { return whole > 0 ? 100 * share(part, whole) : 0.0; };
  const MaskOverlap& all = e.uncertain_on_edges;
  const MaskOverlap& front = e.uncertain_on_foreground_edges;
  const MaskOverlap& near = e.uncertain_near_edges;
  std::printf(
      "\nuncertain map: marks %.1f %% of the pixels, of those %.1f %% within a window of a true edge; hits %.1f %% of "
      "%zu\n"
      "true edge pixels, %.1f %% of the %zu on vehicles, persons, poles, lights and signs\n",
      percent(all.second, e.pixels), percent(near.both, near.second), percent(all.both, all.first), all.first,
      percent(front.both, front.first), front.first);
  print_table(e.coverage);
  for (const MeshErrors& m : e.meshes) {
    print_table(m, m.key == "refined" ? "mesh of the refined depth" : "mesh of the true depth");
  }
  for (const LampErrors& l : e.lamps) print_table(l);
  if (e.albedo) print_table(*e.albedo);
  if (e.night) print_table(*e.night);
  if (!e.stages.empty()) print_table(e.stages);
}

int run_hold_out(const EvaluateOptions& options) {
  Console console(options.quiet);
  io::Expected<HoldOut> params = parse_hold_out(options.hold_out);
  if (!params) return fail(params.error());
  params.value().seed = options.hold_out_seed;
  if (!options.true_night.empty() || options.simplified) {
    return fail(io::Error{"", "--hold-out", "judges the depth alone, expected neither --night nor --simplified"});
  }
  const io::Expected<io::Scene> scene =
      console.timed("read scene", [&] { return load_scene(options.scene, options.size); });
  if (!scene) return fail(scene.error());
  if (!options.output.empty()) {
    if (const io::Outcome apart = InputFiles(scene.value()).expect_none_of({options.output}); !apart) {
      return fail(apart.error());
    }
  }
  if (const io::Outcome made = make_folder_of(options.output); !made) return fail(made.error());
  ThreadPool pool(thread_count(options.threads));
  const NightParams night = options.preset == "thesis" ? thesis_night_params() : default_night_params();
  HoldOutResult result;
  const Status status = hold_out(params.value(), scene.value().view(), night.depth, pool, console, result);
  if (!status.ok()) return fail(options.scene, status);
  print_table(result);
  if (options.output.empty()) return kExitDone;
  OrderedJson json = {{"npsim", NPSIM_VERSION_STRING}, {"scene", scene.value().name}, {"hold_out", options.hold_out}};
  json.update(to_json(result));
  const io::Outcome written = io::write_file(options.output, json.dump(2) + "\n");
  return written ? kExitDone : fail(written.error());
}

}  // namespace

int run_evaluate(const EvaluateOptions& options) {
  if (options.scene.empty())
    return fail(io::Error{"", "scene", "is missing, expected one, or --prediction and --labels"});
  if (!options.hold_out.empty()) return run_hold_out(options);
  if (options.flatness) return run_flatness(options);
  if (!options.losses.empty()) return run_losses(options);
  if (!options.weights.empty()) {
    return fail(io::Error{"", "--weights", "belongs to --losses, expected a folder for both"});
  }
  Console console(options.quiet);
  const io::Expected<std::pair<io::Scene, Truth>> loaded = console.timed(
      "read scene and truth", [&] { return load_with_truth(options.scene, options.size, options.output); });
  if (!loaded) return fail(loaded.error());
  const auto& [scene, truth] = loaded.value();
  for (const std::string& note : scene.notes) {
    if (!options.quiet) std::fprintf(stderr, "  note: %s\n", note.c_str());
  }
  std::optional<TrueNight> night;
  if (!options.true_night.empty()) {
    if (!options.output.empty()) {
      InputFiles inputs;  // the scene's were asked when it was read
      inputs.add(options.true_night, "--night");
      if (const io::Outcome apart = inputs.expect_none_of({options.output}); !apart) return fail(apart.error());
    }
    io::Expected<TrueNight> read = read_true_night(scene, options.true_night);
    if (!read) return fail(read.error());
    night = std::move(read.value());
  }
  if (const io::Outcome made = make_folder_of(options.output); !made) return fail(made.error());
  ThreadPool pool(thread_count(options.threads));
  const NightParams params = options.preset == "thesis" ? thesis_night_params() : default_night_params();
  Evaluation evaluation;
  const Status status = evaluate(scene.view(), truth, params.depth, options.depth_only ? nullptr : &params.mesh, pool,
                                 console, evaluation);
  if (status.code() == StatusCode::no_valid_input) {
    return fail(io::Error{scene.file, "depth",
                          "has no usable sample on any surface: expected depth of 1e-3 m to 1e5 m "
                          "on pixels that are not labelled as sky"});
  }
  if (!status.ok()) return fail(options.scene, status);
  if (evaluation.pixels == 0) {
    return fail(
        io::Error{scene.file, "truth.depth", "is known on no pixel of a surface that has depth, expected some"});
  }
  if (night) {
    NightParams own = params;
    own.seed = options.night_seed;
    own.photograph = scene.photograph;
    NightPictures pictures;
    std::vector<std::uint8_t> shop_fronts;
    const Status judged =
        night_stages(own, scene.view(), truth, *night, static_cast<std::uint64_t>(options.transport_samples), pool,
                     console, evaluation.stages, pictures, shop_fronts);
    if (!judged.ok()) return fail(options.scene, judged);
  }
  if (options.simplified) {
    NightChange change;
    const Status rendered = night_change(params, scene.view(), pool, console, change);
    if (!rendered.ok()) return fail(options.scene, rendered);
    evaluation.night = change;
  }
  print_table(evaluation, scene, options);
  if (options.output.empty()) return kExitDone;
  const io::Outcome written = io::write_file(options.output, to_json(evaluation, scene, options).dump(2) + "\n");
  return written ? kExitDone : fail(written.error());
}

}  // namespace npsim::tool
