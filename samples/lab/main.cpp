// SPDX-License-Identifier: Apache-2.0
// npsim-lab: the commands of npsim that measure: how good its nights are, and cameras and lamps for it.
#include <map>
#include <string>

#include "calibrate_command.hpp"
#include "commands.hpp"
#include "evaluate_command.hpp"
#include "greycard_command.hpp"
#include "judge_command.hpp"
#include "segmentation_evaluation.hpp"
#include "stats_command.hpp"
#include "tool/command_line.hpp"
#include "truth_command.hpp"

int main(int argc, char** argv) {
  using namespace npsim::tool;
  tune_memory();
  CLI::App app{"The commands of npsim that measure.", "npsim"};
  prepare(app);
  std::map<std::string, CLI::App*> commands;
  for (const LabCommand& command : kLabCommands) {
    commands[command.name] = app.add_subcommand(command.name, command.about);
  }

  EvaluateOptions evaluate;
  CLI::App* evaluate_app = commands["evaluate"];
  CLI::Option* const evaluated_scene = evaluate_app->add_option(
      "scene", evaluate.scene, "Folder with a scene.json that names the truth, or the scene.json");
  evaluate_app->add_option("-o,--output", evaluate.output, "JSON file for all figures, also by label");
  add_preset(evaluate_app, evaluate.preset);
  add_threads(evaluate_app, evaluate.threads);
  evaluate_app->add_option("--size", evaluate.size, "Work at WIDTHxHEIGHT; default: the image's size");
  evaluate_app->add_option("--night", evaluate.true_night,
                           "True night, as `npsim truth` wrote it: compare nights with it, stage by stage");
  add_seed(evaluate_app, "--seed", evaluate.night_seed, "Seed of the night that was drawn for the true night");
  evaluate_app
      ->add_option("--transport", evaluate.transport_samples,
                   "With --night: paths a pixel of the reference on our own mesh, to judge transport alone")
      ->check(CLI::Range(0, 1 << 24))
      ->capture_default_str();
  evaluate_app->add_option(
      "--hold-out", evaluate.hold_out,
      "SHARE or SHARE,blocks: leave out that share of the measured pixels, at random or in squares "
      "of 16, and judge the depth there; needs no truth");
  add_seed(evaluate_app, "--hold-out-seed", evaluate.hold_out_seed, "Of the pixels that are left out");
  evaluate_app->add_flag(
      "--simplified", evaluate.simplified,
      "Render one night with all faces of the mesh and one with the simplified ones, and compare them");
  evaluate_app->add_option("--losses", evaluate.losses,
                           "Folder for what the refinement by normals minimises, step by step, as CSV and SVG; needs "
                           "no truth");
  evaluate_app
      ->add_option("--weights", evaluate.weights,
                   "With --losses: grid, also the outcome for 7 x 7 weights of continuity and depth")
      ->check(CLI::IsMember({"grid"}));
  evaluate_app->add_flag("--depth-only", evaluate.depth_only,
                         "Judge neither mesh, lamps nor albedo, which takes longer");
  evaluate_app->add_flag("--flatness", evaluate.flatness,
                         "Only how flat facades came out and on which planes; needs no truth");
  evaluate_app->add_flag("--quiet", evaluate.quiet, "No progress and no notes");
  SegmentationOptions segmentation;
  CLI::Option* const prediction =
      evaluate_app
          ->add_option("--prediction", segmentation.prediction,
                       "In place of a scene: folder with predicted labels as PNGs, judged by --labels")
          ->excludes(evaluated_scene);
  evaluate_app
      ->add_option("--labels", segmentation.labels,
                   "Folder with the true ones: files that end in labelIds.png, else labelTrainIds.png")
      ->needs(prediction);
  evaluate_app
      ->add_option("--invalid", segmentation.invalid,
                   "Folder with masks of indiscernible pixels, invIds.png, for the uncertainty-aware IoU; default: "
                   "those among the labels")
      ->needs(prediction);
  evaluate_app
      ->add_option("--confidence", segmentation.confidence,
                   "Folder with the predictions' confidence as grey PNGs, white for 1: invalid below a threshold")
      ->needs(prediction);
  evaluate_app->add_option("--ids", segmentation.prediction_ids, "Of the predictions; default: those of the labels")
      ->check(CLI::IsMember({"label", "train"}))
      ->needs(prediction);

  TruthOptions truth;
  CLI::App* truth_app = commands["truth"];
  truth_app->add_option("scene", truth.scene, "Folder with a scene.json that names the truth, or the scene.json")
      ->required();
  truth_app->add_option("night", truth.night, "night_NNN.json, as npsim night wrote it for this scene")->required();
  truth_app
      ->add_option("-o,--output", truth.output,
                   "PFM file, cd/m2; beside it NAME_error.pfm (standard error of the luminance), NAME_direct.pfm "
                   "(lamps, reflected once) and NAME_emitted.pfm (the lamps themselves)")
      ->required();
  truth_app->add_option("--samples", truth.samples, "Paths a pixel; rounded up to a multiple of 16")
      ->check(CLI::Range(1, 1 << 24))
      ->capture_default_str();
  truth_app->add_option("--bounces", truth.bounces, "Reflections after the first; 0: direct light alone")
      ->check(CLI::Range(0, 64))
      ->capture_default_str();
  add_seed(truth_app, "--seed", truth.seed, "Of the paths: another seed, other noise");
  truth_app->add_option("--size", truth.size, "Work at WIDTHxHEIGHT; default: the image's size");
  add_threads(truth_app, truth.threads);
  truth_app->add_flag("--keep", truth.keep,
                      "Leave OUTPUT.partial, from which the same command with more samples goes on");
  truth_app->add_flag("--quiet", truth.quiet, "No progress");

  GreycardOptions greycard;
  CLI::App* greycard_app = commands["greycard"];
  greycard_app->add_option("image", greycard.image, "Photograph with the card: PNG, JPEG, or linear PFM")->required();
  greycard_app->add_option("--card", greycard.card, "x0,y0,x1,y1: the card's pixels, the last ones outside")
      ->required();
  greycard_app->add_flag("--linear", greycard.linear, "The picture's values are linear, not sRGB");
  greycard_app->add_option("--iso", greycard.iso, "Of the exposure")->check(within(1.0, 1e7));
  greycard_app->add_option("--f-number", greycard.f_number, "Of the exposure")->check(within(0.5, 128.0));
  greycard_app->add_option("--time", greycard.time_s, "Of the exposure, seconds")->check(within(1e-6, 3600.0));
  greycard_app->add_option("--reflectance", greycard.reflectance, "Of the card")
      ->check(within(0.01, 1.0))
      ->capture_default_str();
  greycard_app->add_option("--distance", greycard.distance_m, "Metres to the one lamp that the card faces")
      ->check(within(0.01, 1000.0));

  StatsOptions stats;
  CLI::App* stats_app = commands["stats"];
  stats_app->add_option("pictures", stats.pictures, "PNG or JPEG files")->required();
  stats_app->add_option("--json", stats.json, "JSON file for the figures");
  stats_app->add_option("--svg", stats.svg, "Chart of the figures beside the ranges of real nights");

  CalibrateOptions calibrate;
  CLI::App* calibrate_app = commands["calibrate-noise"];
  calibrate_app
      ->add_option("pictures", calibrate.pictures,
                   "One raw picture or two of the same scene: .raw with its sidecar, or PNG of one channel")
      ->required()
      ->expected(1, 2);
  calibrate_app
      ->add_option("--patch", calibrate.patches, "x0,y0,x1,y1 of a flat patch, the last ones outside; several times")
      ->allow_extra_args(false);
  calibrate_app
      ->add_option("--square", calibrate.square, "Side of the squares in which two frames are compared, pixels")
      ->check(CLI::Range(8, 1024))
      ->capture_default_str();
  calibrate_app->add_option("--black", calibrate.black, "Level of black; default: as the sidecar has it")
      ->check(within(0.0, 65535.0));
  calibrate_app->add_option("--white", calibrate.white, "Level of full scale")->check(within(1.0, 65535.0));
  calibrate_app->add_option("--iso", calibrate.iso, "At which the pictures were taken, for the row of the table")
      ->check(within(1.0, 1e7));
  calibrate_app
      ->add_option("--headroom", calibrate.headroom,
                   "How many times white of the picture full scale is, for the row of the table; default: as the "
                   "sidecar has it, else 1")
      ->check(within(1.0, 1000.0));

  JudgeOptions judge;
  CLI::App* judge_app = commands["judge"];
  judge_app->add_option("output", judge.output, "Folder for streets, true nights, pictures and judge.json")->required();
  judge_app->add_option("--first", judge.first, "Seed of the first street")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str();
  judge_app->add_option("--last", judge.last, "Seed of the last street")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str();
  judge_app->add_option("--size", judge.size, "WIDTHxHEIGHT of the streets")->capture_default_str();
  judge_app->add_option("--samples", judge.samples, "Paths a pixel of the true nights")
      ->check(CLI::Range(2, 1 << 24))
      ->capture_default_str();
  judge_app
      ->add_option("--transport", judge.transport_samples,
                   "Paths a pixel of the reference on our own mesh, to judge transport alone; 0: not judged")
      ->check(CLI::Range(0, 1 << 24))
      ->capture_default_str();
  judge_app
      ->add_option("--depth", judge.sources,
                   "Also nights with depth from these, comma separated, beside those with a network's")
      ->delimiter(',')
      ->check(CLI::IsMember({"stereo", "lidar", "exact"}));
  add_threads(judge_app, judge.threads);
  judge_app->add_flag("--quiet", judge.quiet, "No progress, only the mean of the streets");

  if (const auto status = parse(app, argc, argv)) return *status;
  return interruptible([&] {
    if (*prediction) {
      segmentation.output = evaluate.output;
      return run_segmentation(segmentation);
    }
    if (*evaluate_app) return run_evaluate(evaluate);
    if (*judge_app) return run_judge(judge);
    if (*calibrate_app) return run_calibrate(calibrate);
    if (*greycard_app) return run_greycard(greycard);
    if (*stats_app) return run_stats(stats);
    return run_truth(truth);
  });
}
