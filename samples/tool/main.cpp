// SPDX-License-Identifier: Apache-2.0
// npsim: one daytime street photograph in, photographs of the same street at night out.
#include <CLI/CLI.hpp>

#include <charconv>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <sstream>
#include <string>
#include <system_error>

#include "calibrate_command.hpp"
#include "console.hpp"
#include "evaluate_command.hpp"
#include "greycard_command.hpp"
#include "inspect_command.hpp"
#include "judge_command.hpp"
#include "night_command.hpp"
#include "npsim/core/config.hpp"
#include "options.hpp"
#include "segmentation_evaluation.hpp"
#include "stats_command.hpp"
#include "street_command.hpp"
#include "truth_command.hpp"
#include "view_command.hpp"

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace {

constexpr const char* kAbout =
    "npsim turns a daytime street photograph with depth into physically grounded photographs of it at night.\n"
    "\n"
    "A scene is a folder with a scene.json that names the image, the depth and the camera, and, where there are any,\n"
    "labels, instances, normals, albedo, roughness and marked light sources. To see one, make one:\n"
    "  npsim street my_street          a generated street with everything a scene can have\n"
    "  npsim inspect my_street         what is in it, what is missing, ranges\n"
    "  npsim night my_street -o night  its nights, mesh and refined depth; open night/overview.png first\n"
    "  npsim view my_street -o view.png --turn 45   its mesh from the side\n"
    "  npsim evaluate my_street        errors of depth and normals, as given and after each step, where the truth is "
    "known";

constexpr const char* kStatuses =
    "Exit status: 0 done; 1 the run failed; 2 the input, an option or a place to write to is wrong (one line says "
    "which);\n"
    "130 interrupted. Files appear under their final names only when complete.";

}  // namespace

int main(int argc, char** argv) {
  using namespace npsim::tool;
#ifdef __GLIBC__
  // Else it grows with what is freed, images come from the heap, and what files were read into stays there as holes.
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
#endif
  CLI::App app{kAbout, "npsim"};
  app.set_version_flag("--version", std::string("npsim ") + NPSIM_VERSION_STRING);
  app.require_subcommand(1);
  app.footer(kStatuses);

  // CLI11 itself takes -1 and numbers that do not fit for the largest seed.
  const CLI::Validator whole_number(
      [](const std::string& text) {
        std::uint64_t value = 0;
        const char* end = text.data() + text.size();
        const auto [last, error] = std::from_chars(text.data(), end, value);
        return error == std::errc() && last == end ? std::string()
                                                   : "expected a whole number from 0 to 2^64 - 1, got " + text;
      },
      "UINT64");

  // CLI::Range lets NaN pass.
  const auto within = [](double least, double most) {
    return CLI::Validator(
        [least, most](const std::string& text) {
          const char* begin = text.c_str();
          char* end = nullptr;
          const double value = std::strtod(begin, &end);
          if (end != begin && *end == '\0' && value >= least && value <= most) return std::string();
          std::ostringstream expected;
          expected << "expected a number from " << least << " to " << most << ", got " << text;
          return expected.str();
        },
        "FLOAT");
  };

  NightOptions night;
  CLI::App* night_app = app.add_subcommand("night", "Render nights of a scene");
  night_app->add_option("scene", night.scene, "Folder with a scene.json, or the scene.json itself")->required();
  night_app->add_option("-o,--output", night.output, "Folder for the results; made if missing")->required();
  night_app->add_option("--variants", night.variants, "Number of nights, each with other lamps lit")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  night_app->add_option("--seed", night.seed, "Same seed, same bytes, on any number of threads")
      ->check(whole_number)
      ->capture_default_str();
  night_app
      ->add_option("--preset", night.preset,
                   "default: what measured better; thesis: the thesis' settings as literally as they can be read")
      ->check(CLI::IsMember({"default", "thesis"}))
      ->capture_default_str();
  night_app->add_option("--threads", night.threads, "0 = one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  night_app->add_option("--size", night.size,
                        "Pictures of WIDTHxHEIGHT, for instance 960x540; default: the image's size");
  night_app->add_option("--work-size", night.work_size,
                        "Compute depth and light at WIDTHxHEIGHT; default: the pictures' size, at most 2 megapixels");
  night_app->add_option(
      "--lights", night.light_set,
      "Measured light sources that replace the built-in strengths and colours of the classes they name: a JSON list "
      "[{class, strength, xy | rg_bg, luminaire}], or a CSV of class,s,r/g,b/g");
  CLI::Option* const rays =
      night_app->add_option("--rays", night.rays, "Effort: rays by which each pixel looks for indirect light")
          ->check(CLI::Range(1, 4096))
          ->capture_default_str();
  night_app
      ->add_option(
          "--error", night.error,
          "Error: relative noise of the light that is allowed, for instance 0.02; as many rays as it takes, at "
          "most 256. What was reached stands in the report")
      ->check(within(1e-4, 1.0))
      ->excludes(rays);
  night_app->add_option("--wet", night.wet, "How wet road and pavement are: 0 dry, 1 under a closed film of water")
      ->check(within(0.0, 1.0))
      ->capture_default_str();
  night_app
      ->add_option(
          "--unseen-lamps", night.unseen_lamps,
          "Whether rows of street lamps go on where the photograph does not show them: continued, of the thesis "
          "dark")
      ->check(CLI::IsMember({"continued", "dark"}));
  night_app
      ->add_option(
          "--assume-lamps", night.assume_lamps_m,
          "Metres of road width: where no street lamp is marked, a row for such a road stands beside and behind "
          "the camera; 0: none")
      ->check(within(0.0, 50.0))
      ->capture_default_str();
  night_app
      ->add_option(
          "--unseen-street", night.unseen_street,
          "How much of the mean light of the street in the picture the street around it has; default: 0.35, of "
          "the thesis 0")
      ->check(within(0.0, 1.0));
  night_app->add_option("--moon", night.moon,
                        "azimuth,elevation of a full moon in degrees, the first to the camera's right; default: none");
  night_app
      ->add_option("--headlamps", night.headlamps,
                   "Of the car that carries the camera: low, high (both beams) or off; default: low, of the thesis off")
      ->check(CLI::IsMember({"low", "high", "off"}));
  night_app->add_option("--camera", night.camera,
                        "action-camera, dashcam, automotive-hdr, automotive-raw, thesis, or a JSON file; default: "
                        "action-camera, of the thesis thesis");
  night_app->add_option("--iso", night.iso, "Fixed ISO speed; default: metered")->check(within(1.0, 1e6));
  night_app->add_option("--exposure", night.exposure_s, "Exposure time in seconds")->check(within(1e-6, 3600.0));
  night_app->add_option("--f-number", night.f_number, "Of the lens")->check(within(0.5, 128.0));
  night_app->add_option("--ev", night.ev, "Stops brighter than metered")
      ->check(within(-16.0, 16.0))
      ->capture_default_str();
  night_app->add_option("--meter", night.meter, "What the automatic exposure looks at: mean, centre or highlight")
      ->check(CLI::IsMember({"mean", "centre", "highlight"}));
  night_app->add_option("--speed", night.speed_m_s, "Of the own car, m/s ahead: motion blur, rolling shutter")
      ->check(within(-100.0, 100.0));
  night_app->add_option("--yaw-rate", night.yaw_rate, "At which the own car turns to the right, rad/s")
      ->check(within(-10.0, 10.0));
  night_app->add_flag("--raw", night.raw, "Also write what the sensor read: NAME.raw with NAME_raw.json, and NAME.dng");
  night_app->add_option("--jpeg", night.jpeg, "Also write NAME.jpg of this quality, 1 to 100")
      ->check(CLI::Range(1, 100));
  night_app->add_flag("--flicker", night.flicker,
                      "LED lamps of vehicles and signals are switched, as a camera sees it");
  night_app
      ->add_option("--traffic", night.traffic, "Side of the road on which the own car drives, and its low beam rises")
      ->check(CLI::IsMember({"right", "left"}))
      ->capture_default_str();
  night_app
      ->add_option("--mesh-error", night.mesh_error,
                   "Relative error of depth that the exported mesh is simplified to; 0: faces between "
                   "all pixels; default: 0.005, of the thesis 0")
      ->check(within(0.0, 1.0));
  night_app->add_option("--texture", night.texture, "What the exported mesh wears: the photograph, or its albedo")
      ->check(CLI::IsMember({"photograph", "albedo"}))
      ->capture_default_str();
  CLI::Option* const labels = night_app->add_flag(
      "--labels", night.labels, "Also write labels of each night: classes, objects, lamps, masks, depth, boxes");
  night_app
      ->add_option("--least-snr", night.least_snr,
                   "Signal-to-noise ratio up to which a pixel of the labels is indiscernible")
      ->check(within(1e-3, 1000.0))
      ->capture_default_str()
      ->needs(labels);
  night_app->add_flag("--quiet", night.quiet, "No progress");

  StreetOptions street;
  CLI::App* street_app = app.add_subcommand("street", "Generate a street scene with full ground truth");
  street_app->add_option("output", street.output, "Folder for the scene; made if missing")->required();
  street_app->add_option("--seed", street.seed, "Another seed, another street")
      ->check(whole_number)
      ->capture_default_str();
  street_app->add_option("--size", street.size, "WIDTHxHEIGHT")->capture_default_str();
  street_app
      ->add_option("--depth", street.depth, "How the depth is measured; with stereo and lidar the scene has no normals")
      ->check(CLI::IsMember({"network", "stereo", "lidar", "exact"}))
      ->capture_default_str();
  street_app->add_option("--albedo", street.albedo, "Whether the scene gives albedo and roughness")
      ->check(CLI::IsMember({"given", "none"}))
      ->capture_default_str();
  street_app->add_option("--threads", street.threads, "0 = one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  street_app->add_flag("--quiet", street.quiet, "No progress");

  InspectOptions inspect;
  CLI::App* inspect_app = app.add_subcommand("inspect", "Say what a scene holds, what is missing, ranges and shares");
  inspect_app->add_option("scene", inspect.scene, "Folder with a scene.json, or the scene.json itself")->required();
  inspect_app->add_option("-o,--output", inspect.output,
                          "PNG: the photograph with labels, horizon, ground and the marked lamps");

  ViewOptions view;
  CLI::App* view_app = app.add_subcommand("view", "Draw the mesh of a scene, or of an OBJ file, from any side");
  view_app->add_option("scene", view.scene, "Folder with a scene.json, the scene.json itself, or an .obj")->required();
  view_app->add_option("-o,--output", view.output, "PNG file")->required();
  view_app
      ->add_option("--mesh", view.mesh, "raw: one sheet; pruned: without spurious faces; complete; background; objects")
      ->check(CLI::IsMember({"raw", "pruned", "complete", "background", "objects"}))
      ->capture_default_str();
  view_app->add_option("--closer", view.from.closer_m, "Metres towards what is looked at")
      ->check(within(-1000.0, 1000.0))
      ->capture_default_str();
  view_app->add_option("--turn", view.from.turn_deg, "Degrees clockwise round the pivot, seen from above")
      ->check(within(-360.0, 360.0))
      ->capture_default_str();
  view_app->add_option("--climb", view.from.climb_deg, "Degrees above the pivot, looking down on it")
      ->check(within(-90.0, 90.0))
      ->capture_default_str();
  view_app
      ->add_option("--pivot", view.from.pivot_m,
                   "Metres ahead of the photograph's camera; 0: so that the view shows most of the scene")
      ->check(within(0.0, 1000.0))
      ->capture_default_str();
  view_app->add_option("--wire", view.wire_px, "Width in pixels at which edges are drawn; 0: not")
      ->check(within(0.0, 100.0))
      ->capture_default_str();
  view_app->add_option("--shading", view.shading, "How much a face darkens by its direction, 0 to 1")
      ->check(within(0.0, 1.0))
      ->capture_default_str();
  view_app->add_flag("--y-down", view.y_down, "An OBJ has y down and z ahead, as truth/street.obj; else y is up");
  view_app->add_flag("--plain", view.plain, "Without the photograph");
  view_app->add_option("--picture", view.picture, "Size of the picture, WIDTHxHEIGHT; default: the scene's");
  view_app->add_option("--size", view.size, "Work at WIDTHxHEIGHT; default: the image's size");
  view_app->add_option("--preset", view.preset, "default or thesis, as for night")
      ->check(CLI::IsMember({"default", "thesis"}))
      ->capture_default_str();
  view_app->add_option("--threads", view.threads, "0 = one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  view_app->add_flag("--quiet", view.quiet, "No progress");

  EvaluateOptions evaluate;
  CLI::App* evaluate_app = app.add_subcommand(
      "evaluate", "Judge the depth, as given and after each step, and the mesh by the scene's ground truth");
  CLI::Option* const evaluated_scene = evaluate_app->add_option(
      "scene", evaluate.scene, "Folder with a scene.json that names the truth, or the scene.json");
  evaluate_app->add_option("-o,--output", evaluate.output, "JSON file for all figures, also by label");
  evaluate_app->add_option("--preset", evaluate.preset, "default or thesis, as for night")
      ->check(CLI::IsMember({"default", "thesis"}))
      ->capture_default_str();
  evaluate_app->add_option("--threads", evaluate.threads, "0 = one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  evaluate_app->add_option("--size", evaluate.size, "Work at WIDTHxHEIGHT; default: the image's size");
  evaluate_app->add_option("--night", evaluate.true_night,
                           "True night, as `npsim truth` wrote it: compare nights with it, stage by stage");
  evaluate_app->add_option("--seed", evaluate.night_seed, "Seed of the night that was drawn for the true night")
      ->check(whole_number)
      ->capture_default_str();
  evaluate_app
      ->add_option("--transport", evaluate.transport_samples,
                   "With --night: paths a pixel of the reference on our own mesh, to judge transport alone")
      ->check(CLI::Range(0, 1 << 24))
      ->capture_default_str();
  evaluate_app->add_option(
      "--hold-out", evaluate.hold_out,
      "SHARE or SHARE,blocks: leave out that share of the measured pixels, at random or in squares "
      "of 16, and judge the depth there; needs no truth");
  evaluate_app->add_option("--hold-out-seed", evaluate.hold_out_seed, "Of the pixels that are left out")
      ->check(whole_number)
      ->capture_default_str();
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
  CLI::App* truth_app =
      app.add_subcommand("truth", "Compute the true night of a generated street, with the lamps that a night lit");
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
  truth_app->add_option("--seed", truth.seed, "Of the paths: another seed, other noise")
      ->check(whole_number)
      ->capture_default_str();
  truth_app->add_option("--size", truth.size, "Work at WIDTHxHEIGHT; default: the image's size");
  truth_app->add_option("--threads", truth.threads, "0 = one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  truth_app->add_flag("--keep", truth.keep,
                      "Leave OUTPUT.partial, from which the same command with more samples goes on");
  truth_app->add_flag("--quiet", truth.quiet, "No progress");

  GreycardOptions greycard;
  CLI::App* greycard_app = app.add_subcommand(
      "greycard", "Measure {s, r/g, b/g} of the light on a grey card, for the light set of night --lights");
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
  CLI::App* stats_app = app.add_subcommand(
      "stats", "Say how bright, how dark, of which colour and how noisy night pictures are, beside real nights");
  stats_app->add_option("pictures", stats.pictures, "PNG or JPEG files")->required();
  stats_app->add_option("--json", stats.json, "JSON file for the figures");
  stats_app->add_option("--svg", stats.svg, "Chart of the figures beside the ranges of real nights");

  CalibrateOptions calibrate;
  CLI::App* calibrate_app = app.add_subcommand(
      "calibrate-noise", "Measure beta1 and beta2 of a camera's noise, of two frames or of flat patches of one");
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

  JudgeOptions judge;
  CLI::App* judge_app = app.add_subcommand(
      "judge", "Judge every stage by the true night of generated streets; what the folder has already is kept");
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
  judge_app->add_option("--threads", judge.threads, "0 = one per processor")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  judge_app->add_flag("--quiet", judge.quiet, "No progress, only the mean of the streets");

  try {
    app.parse(argc, argv);
  } catch (const CLI::CallForHelp& e) {
    return app.exit(e);
  } catch (const CLI::CallForAllHelp& e) {
    return app.exit(e);
  } catch (const CLI::CallForVersion& e) {
    return app.exit(e);
  } catch (const CLI::ParseError& e) {
    std::fprintf(stderr, "npsim: %s; see npsim --help\n", e.what());
    return kExitBadInput;
  }

  watch_for_interrupt();
  try {
    if (*night_app) return run_night(night);
    if (*street_app) return run_street(street);
    if (*view_app) return run_view(view);
    if (*prediction) {
      segmentation.output = evaluate.output;
      return run_segmentation(segmentation);
    }
    if (*evaluate_app) return run_evaluate(evaluate);
    if (*judge_app) return run_judge(judge);
    if (*calibrate_app) return run_calibrate(calibrate);
    if (*greycard_app) return run_greycard(greycard);
    if (*stats_app) return run_stats(stats);
    if (*truth_app) return run_truth(truth);
    return run_inspect(inspect);
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "npsim: out of memory; a smaller --size needs less\n");
    return kExitFailed;
  }
}
