// SPDX-License-Identifier: Apache-2.0
// npsim: one daytime street photograph in, photographs of the same street at night out.
//
// The commands that measure are those of npsim-lab, a second program beside this one, so that nobody's first night waits
// for their compilation; npsim hands them on.
#include "command_line.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <string>
#include <system_error>

#include "inspect_command.hpp"
#include "lab/commands.hpp"
#include "night_command.hpp"
#include "npsim/light/unmarked.hpp"
#include "street_command.hpp"
#include "view_command.hpp"

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

// Whether the command, behind options of the program itself, is one of npsim-lab.
[[nodiscard]] bool is_for_lab(int argc, char** argv) {
  char** const command = std::find_if(argv + 1, argv + argc, [](const char* word) { return word[0] != '-'; });
  if (command == argv + argc) return false;
  return std::any_of(std::begin(npsim::tool::kLabCommands), std::end(npsim::tool::kLabCommands),
                     [&](const npsim::tool::LabCommand& lab) { return std::string(*command) == lab.name; });
}

// Does not come back where npsim-lab stands beside this program.
[[nodiscard]] int run_lab(char** argv) {
  namespace fs = std::filesystem;
  std::error_code unknown;
  fs::path self = fs::read_symlink("/proc/self/exe", unknown);
  if (unknown) self = argv[0];
  const std::string lab = self.replace_filename("npsim-lab").string();
  execvp(lab.c_str(), argv);
  std::fprintf(stderr, "npsim: %s: %s; it is built by the target npsim_lab\n", lab.c_str(), std::strerror(errno));
  return npsim::tool::kExitFailed;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace npsim::tool;
  if (is_for_lab(argc, argv)) return run_lab(argv);
  tune_memory();
  CLI::App app{kAbout, "npsim"};
  prepare(app);

  NightOptions night;
  CLI::App* night_app = app.add_subcommand("night", "Render nights of a scene");
  night_app->add_option("scene", night.scene, "Folder with a scene.json, or the scene.json itself")->required();
  night_app->add_option("-o,--output", night.output, "Folder for the results; made if missing")->required();
  night_app->add_option("--variants", night.variants, "Number of nights, each with other lamps lit")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  add_seed(night_app, "--seed", night.seed, "Same seed, same bytes, on any number of threads");
  add_preset(night_app, night.preset,
             "default: what measured better; thesis: the thesis' settings as literally as they can be read");
  add_threads(night_app, night.threads);
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
          "Error: relative noise of the light that is allowed, for instance 0.02; as many rays as it takes, from "
          "2 to 256. What was reached stands in the report")
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
  night_app
      ->add_option("--following-car", night.following_car_m,
                   "Metres behind the camera at which a car follows with its low beams on; default: none does")
      ->check(within(static_cast<double>(npsim::kNearestFollower_m), static_cast<double>(npsim::kFarthestFollower_m)));
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
  add_seed(street_app, "--seed", street.seed, "Another seed, another street");
  street_app->add_option("--size", street.size, "WIDTHxHEIGHT")->capture_default_str();
  street_app
      ->add_option("--depth", street.depth, "How the depth is measured; with stereo and lidar the scene has no normals")
      ->check(CLI::IsMember({"network", "stereo", "lidar", "exact"}))
      ->capture_default_str();
  street_app->add_option("--albedo", street.albedo, "Whether the scene gives albedo and roughness")
      ->check(CLI::IsMember({"given", "none"}))
      ->capture_default_str();
  add_threads(street_app, street.threads);
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
  add_preset(view_app, view.preset);
  add_threads(view_app, view.threads);
  view_app->add_flag("--quiet", view.quiet, "No progress");

  for (const LabCommand& command : kLabCommands) app.add_subcommand(command.name, command.about);  // for --help

  if (const auto status = parse(app, argc, argv)) return *status;
  return interruptible([&] {
    if (*night_app) return run_night(night);
    if (*street_app) return run_street(street);
    if (*view_app) return run_view(view);
    return run_inspect(inspect);
  });
}
