// SPDX-License-Identifier: Apache-2.0
#include "night_command.hpp"

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "console.hpp"
#include "daylight.hpp"
#include "engine.hpp"
#include "file_tasks.hpp"
#include "lamp_names.hpp"
#include "loading.hpp"
#include "mesh_export.hpp"
#include "mesh_views.hpp"
#include "night_labels.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/camera_file.hpp"
#include "npsim/io/dng.hpp"
#include "npsim/io/large_night.hpp"
#include "npsim/io/light_set.hpp"
#include "npsim/io/memory.hpp"
#include "npsim/io/pfm.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/io/raw_picture.hpp"
#include "npsim/io/scene_doubts.hpp"
#include "npsim/io/scene_resize.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/pipeline/night.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "pictures.hpp"
#include "shop_fronts.hpp"

namespace npsim::tool {
namespace {

// Vertices that some face has; the others are only points of light.
[[nodiscard]] std::size_t vertices_of_faces(const TriangleMeshView& mesh) {
  std::vector<bool> used(mesh.vertices.size());
  for (const Face& f : mesh.faces) used[f.a] = used[f.b] = used[f.c] = true;
  return static_cast<std::size_t>(std::count(used.begin(), used.end(), true));
}

// A night's files without their endings.
[[nodiscard]] std::string night_stem(const std::string& folder, int variant) {
  std::array<char, 32> stem{};
  std::snprintf(stem.data(), stem.size(), "/night_%03d", variant);
  return folder + stem.data();
}

// The files that one night may have besides its labels, and whether this run writes them.
[[nodiscard]] std::vector<std::pair<std::string, bool>> night_files(const NightOptions& options, int variant) {
  const std::string stem = night_stem(options.output, variant);
  const bool jpeg = options.jpeg > 0;
  return {{stem + ".png", true},       {stem + ".pfm", true},        {stem + ".json", true},
          {stem + ".jpg", jpeg},       {stem + ".raw", options.raw}, {stem + "_raw.json", options.raw},
          {stem + ".dng", options.raw}};
}

// The effort, or where the search for an error begins: two rays often give .05, and then nothing more is paid.
[[nodiscard]] int first_rays(const NightOptions& options) { return options.error > 0.0F ? 2 : options.rays; }

// All 64 bits: JSON's numbers keep 53 of them in most readers.
[[nodiscard]] std::string key_text(std::uint64_t key) {
  std::array<char, 20> text{};
  std::snprintf(text.data(), text.size(), "%016llx", static_cast<unsigned long long>(key));
  return text.data();
}

[[nodiscard]] std::array<float, 3> components(const Vec3f& v) { return {v.x, v.y, v.z}; }

// Everything that a run may write.
[[nodiscard]] std::vector<std::string> night_outputs(const NightOptions& options) {
  std::vector<std::string> files;
  for (const char* name : {"depth.png", "depth.pfm", "uncertain.png", "normals.png", "overview.png", "report.json"}) {
    files.push_back(options.output + "/" + name);
  }
  for (const char* name : kMeshFiles) files.push_back(options.output + "/" + name);
  for (const char* name : kDaylightFiles) files.push_back(options.output + "/" + name);
  for (int v = 0; v < options.variants; ++v) {
    for (const auto& file : night_files(options, v)) files.push_back(file.first);
    if (!options.labels) continue;
    for (const std::string& file : label_files(night_stem(options.output, v))) files.push_back(file);
  }
  if (options.labels) files.push_back(options.output + "/" + kCocoFile);
  return files;
}

// Receives what the pipeline makes and writes it; remembers the first file that could not be written.
class NightWriter {
 public:
  // scene: that nights are made of; photograph: of the size of the pictures.
  NightWriter(const NightOptions& options, const io::Scene& photograph, const io::Scene& scene,
              const std::vector<std::string>& doubts, const NightParams& params, const DaylightRecorder& estimate,
              Console& console, ThreadPool& pool)
      : options_(options),
        photograph_(photograph.shape()),
        scene_(scene),
        doubts_(doubts),
        params_(params),
        light_set_(params.relight.activation.light_set),
        daylight_(estimate),
        console_(console),
        pool_(pool) {
    if (options.labels) labels_.emplace(photograph, params, SignalMaskParams{options.least_snr});
  }

  Status reconstructed(const RefinedDepth& refined, const SceneMesh& mesh, const Relighting& light) {
    return written(console_.timed("write depth and mesh", [&]() -> io::Outcome {
      panels_.push_back({"day", scene_.image});
      panels_.push_back({"depth, as given", measured_picture(scene_.depth.view())});
      panels_.push_back({"depth, refined", depth_picture(refined.depth)});
      panels_.push_back({"uncertain", mask_picture(scene_.image.view(), refined.uncertain)});
      panels_.push_back({"normals", normal_picture(refined.normals)});
      const Status drawn = mesh_panels(scene_.image, mesh, refined.depth, scene_.intrinsics, pool_, panels_);
      if (!drawn.ok()) return io::Error{options_.scene, "views of the mesh", drawn.message()};
      counts_ = {vertices_of_faces(mesh.mesh), mesh.mesh.vertices.size(), mesh.mesh.faces.size(), mesh.background_faces,
                 light.emitters.size()};
      if (labels_) labels_->keep(refined);
      ground_ = refined.ground;
      light_ = {{"groups", light.groups.count},
                {"images", light.images.count},
                {"images_bytes", light.images.bytes()},
                {"left_out_cd_m2", light.images.left_out_cd_m2},
                {"mean_untraced_lx", light.mean_untraced_lx},
                {"rays", light.rays},
                {"error", light.error}};
      std::vector<FileTask> files;
      const auto add_png = [&](const char* name, const auto& picture) {
        files.push_back({path(name), [this, name, picture] { return io::write_png(path(name), picture); }});
      };
      add_png("normals.png", std::as_const(panels_[4].picture).view());
      add_png("depth.png", std::as_const(panels_[2].picture).view());
      add_png("uncertain.png", ImageView<const std::uint8_t>(refined.uncertain));
      if (!daylight_.albedo().empty()) {
        add_png(kDaylightFiles[0], daylight_.albedo());
        add_png(kDaylightFiles[1], daylight_.shadow());
      }
      files.push_back({path("depth.pfm"), [&] { return io::write_pfm(path("depth.pfm"), refined.depth); }});
      if (auto o = write_files(files, pool_); !o) return o;
      return export_mesh(options_.output, scene_, mesh, light, pool_, {options_.texture == "albedo"});
    }));
  }

  Status night(const Night& night) {
    return written(console_.timed("write night", [&]() -> io::Outcome {
      const std::string stem = night_stem(options_.output, night.variant);
      if (auto o = io::write_pfm(stem + ".pfm", night.luminance); !o) return o;
      if (options_.raw) {
        const SensorParams& sensor = params_.camera.sensor;
        if (auto o = io::write_raw(stem + ".raw", night.raw, sensor, night.exposure); !o) return o;
        if (auto o = io::write_dng(stem + ".dng", night.raw, sensor, night.exposure); !o) return o;
      }
      if (labels_) {
        const std::string name = std::filesystem::path(stem).filename().string();
        if (auto o = labels_->write(stem, name + ".png", night, pool_); !o) return o;
      }
      // The contact sheet shows at most six nights; the files hold all.
      if (night.variant < 6) {
        panels_.push_back(
            {"night " + std::to_string(night.variant), io::resized_nearest(night.picture, scene_.shape())});
      }
      const auto picture = std::make_shared<io::Image<Rgb8>>(night.picture.shape());
      copy_pixels(night.picture, picture->view());
      // Last what says how the night was made: where that is, so is all of it.
      const auto code = [stem, picture, quality = options_.jpeg,
                         text = describe(night).dump(2) + "\n"]() -> io::Outcome {
        const ImageView<const Rgb8> view = std::as_const(*picture).view();
        if (auto o = io::write_png(stem + ".png", view); !o) return o;
        if (quality > 0) {
          if (auto o = io::write_jpeg(stem + ".jpg", view, quality); !o) return o;
        }
        return io::write_file(stem + ".json", text);
      };
      waiting_.push_back({stem + ".png", code});
      if (waiting_.size() < std::min(pool_.thread_count(), kMostWaiting)) return io::Done{};
      return write_waiting();
    }));
  }

  // The pictures of the last nights.
  Status finish_nights() {
    if (waiting_.empty()) return {};
    return written(console_.timed("last pictures", [&] { return write_waiting(); }));
  }

  [[nodiscard]] io::Outcome finish(const NightParams& params, const io::HostMemory& memory, const Workspace& workspace,
                                   unsigned threads) {
    if (auto o = console_.timed("contact sheet",
                                [&] { return io::write_png(path("overview.png"), contact_sheet(panels_).view()); });
        !o) {
      return o;
    }
    if (labels_) {
      if (auto o = labels_->write_coco(path(kCocoFile)); !o) return o;
    }
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    nlohmann::ordered_json stages = nlohmann::ordered_json::array();
    double total = 0;
    for (const StageTime& t : console_.times()) {
      stages.push_back({{"stage", t.name}, {"seconds", t.seconds}, {"calls", t.calls}});
      total += t.seconds;
    }
    const nlohmann::ordered_json report = {
        {"npsim", NPSIM_VERSION_STRING},
        {"scene", scene_.name},
        {"settings",
         {{"scene", options_.scene},
          {"lights", options_.light_set},
          {"preset", options_.preset},
          {"seed", options_.seed},
          {"variants", options_.variants},
          {"threads", threads},
          {"width", photograph_.width},
          {"height", photograph_.height},
          {"work_width", scene_.image.width()},
          {"work_height", scene_.image.height()},
          {"rays", first_rays(options_)},
          {"max_error", options_.error},
          {"bounces", params.relight.bounces}}},
        {"seconds", total},
        {"stages", std::move(stages)},
        {"peak_memory_bytes", static_cast<std::uint64_t>(usage.ru_maxrss) * 1024},
        {"workspace_bytes", memory.usable()},
        {"workspace_peak_bytes", workspace.peak()},
        {"mesh",
         {{"vertices", counts_.vertices},
          {"points_of_light", counts_.points},
          {"triangles", counts_.faces},
          {"background_triangles", counts_.background_faces},
          {"foreground_triangles", counts_.faces - counts_.background_faces}}},
        {"ground", {{"camera_height_m", ground_.camera_height_m}, {"up", {ground_.up.x, ground_.up.y, ground_.up.z}}}},
        {"emitters", counts_.emitters},
        {"light", light_},
        {"seconds_per_night", per_night()},
        {"daylight", daylight_.report()},
        {"doubts", doubts_},
        {"notes", scene_.notes}};
    return io::write_file(path("report.json"), report.dump(2) + "\n");
  }

  [[nodiscard]] const io::Error* error() const { return error_.problem.empty() ? nullptr : &error_; }

 private:
  struct Counts {
    std::size_t vertices = 0, points = 0, faces = 0, background_faces = 0, emitters = 0;
  };

  // Of what is done again for every night; writing it left out.
  [[nodiscard]] double per_night() const {
    double seconds = 0;
    for (const StageTime& t : console_.times()) {
      if (t.name == stage_name(Stage::add_lights) || t.name == stage_name(Stage::camera)) {
        seconds += t.seconds / std::max(1, options_.variants);
      }
    }
    return seconds;
  }

  [[nodiscard]] std::string path(const std::string& name) const { return options_.output + "/" + name; }

  Status written(const io::Outcome& outcome) {
    if (outcome.ok()) return {};
    if (error() == nullptr) error_ = outcome.error();
    return Status(StatusCode::cancelled, "an output could not be written");
  }

  [[nodiscard]] nlohmann::ordered_json describe(const Night& night) const {
    nlohmann::ordered_json sources = nlohmann::ordered_json::array();
    for (std::size_t e = 0; e < night.emitters.size(); ++e) {
      const Emitter& emitter = night.emitters[e];
      const Activation& a = night.activations[e];
      nlohmann::ordered_json entry;
      if (is_own_headlamp(emitter)) {
        entry["source"] = "own headlamp";
        entry["side"] = emitter.centre_m.x < 0 ? "left" : "right";
        entry["class"] = info(emitter.cls).name;
      } else if (is_following_car(emitter)) {
        entry["source"] = "following car";
        entry["side"] = emitter.centre_m.x < 0 ? "left" : "right";
        entry["class"] = info(emitter.cls).name;
      } else if (is_moon(emitter)) {
        entry["source"] = "moon";
      } else if (emitter.mark == 0) {
        entry["source"] = "continued";  // a row of street lamps goes on where the photograph does not show it
        entry["number"] = emitter.unseen;
        entry["class"] = info(emitter.cls).name;
      } else {
        const LightMark& mark = scene_.lights[emitter.mark - 1U];
        entry["id"] = mark.id;
        entry["class"] = info(mark.cls).name;
        if (mark.group != 0) entry["group"] = scene_.lights[mark.group - 1U].id;
      }
      entry["lit"] = a.lit;
      entry["probability"] = a.probability;
      entry["profile"] = profile_name(emitter.profile);
      // What it would be is said of what is off as well.
      entry["strength"] = a.strength;
      entry["unit"] = unit_name(strength_unit(emitter.profile));
      if (is_street_profile(emitter.profile)) {
        entry["mounting_height_m"] = emitter.mounting_height_m;
        // Drawn for a mast of 8 m and changed by height, unless a light set names the class.
        entry["strength_follows_height"] = !in_light_set(emitter.cls);
      }
      entry["xy"] = {a.xy.x, a.xy.y};
      const Activation on = make_activation(emitter, true, a.probability, a.strength, a.xy);
      entry["peak_intensity_cd"] = luminance(on.intensity_cd);
      entry["luminance_cd_m2"] = luminance(on.luminance_cd_m2);
      entry["position_m"] = components(emitter.centre_m);
      entry["axis"] = components(emitter.axis);
      entry["half_sides_m"] = {components(emitter.half_u_m), components(emitter.half_v_m)};
      sources.push_back(std::move(entry));
    }
    return {{"npsim", NPSIM_VERSION_STRING},
            {"scene", scene_.name},
            {"photograph", key_text(params_.photograph)},
            {"preset", options_.preset},
            {"light_set", options_.light_set},
            {"size", {night.picture.width(), night.picture.height()}},
            {"work_size", {scene_.image.width(), scene_.image.height()}},
            {"seed", options_.seed},
            {"variant", night.variant},
            {"unseen_street_lamps", params_.relight.rows.behind_m > 0.0F},
            {"assumed_road_width_m", params_.relight.rows.assumed_width_m},
            {"unseen_street_share", params_.relight.unseen.share},
            {"light", light_},
            {"moon", options_.moon},
            {"wetness", params_.relight.material.film.wetness},
            {"headlamps", !params_.relight.ego_headlamps ? "off" : (params_.relight.ego.high_beam ? "high" : "low")},
            {"following_car_m", params_.relight.following_car_m},
            {"traffic", options_.traffic},
            {"camera", options_.camera.empty() ? options_.preset : options_.camera},
            {"motion",
             {{"velocity_m_s", components(params_.camera.motion.velocity_m_s)},
              {"rotation_rad_s", components(params_.camera.motion.rotation_rad_s)},
              {"readout_s", params_.camera.motion.readout_s},
              {"flicker", params_.camera.flicker.on}}},
            {"exposure",
             {{"iso", night.exposure.iso}, {"f_number", night.exposure.f_number}, {"time_s", night.exposure.time_s}}},
            {"sources", std::move(sources)}};
  }

  [[nodiscard]] bool in_light_set(LightClass cls) const {
    return std::any_of(light_set_.begin(), light_set_.end(), [&](const LightSetEntry& e) { return e.cls == cls; });
  }

  [[nodiscard]] io::Outcome write_waiting() {
    const io::Outcome done = write_files(waiting_, pool_);
    waiting_.clear();
    return done;
  }

  // Coding a picture takes a processor ten times as long as all else of a further night, so those of several are coded
  // side by side.
  static constexpr std::size_t kMostWaiting = 8;

  const NightOptions& options_;
  Shape photograph_;
  const io::Scene& scene_;
  const std::vector<std::string>& doubts_;
  const NightParams& params_;
  Span<const LightSetEntry> light_set_;
  const DaylightRecorder& daylight_;
  Console& console_;
  ThreadPool& pool_;
  std::optional<NightLabels> labels_;
  std::vector<FileTask> waiting_;  // a night's picture each
  std::vector<Panel> panels_;
  Counts counts_;
  GroundPlane ground_;
  OrderedJson light_;
  io::Error error_;
};

// "azimuth,elevation" in degrees to a direction right, up, ahead.
[[nodiscard]] io::Expected<Vec3f> parse_moon(const std::string& text) {
  double azimuth = 0;
  double elevation = 0;
  int used = 0;
  const int read = std::sscanf(text.c_str(), "%lf,%lf%n", &azimuth, &elevation, &used);
  if (read != 2 || text.size() != static_cast<std::size_t>(used) || !(std::fabs(azimuth) <= 360) ||
      !(elevation > 0 && elevation <= 90)) {
    return io::Error{"", "--moon", "is '" + text + "', expected azimuth,elevation: degrees to the right, 0 to 90 up"};
  }
  constexpr double kRadian = 3.14159265358979324 / 180.0;
  const double level = std::cos(elevation * kRadian);
  return Vec3f{static_cast<float>(std::sin(azimuth * kRadian) * level),
               static_cast<float>(std::sin(elevation * kRadian)),
               static_cast<float>(std::cos(azimuth * kRadian) * level)};
}

// Files that an earlier run with more variants, or with other files of a night, left behind: they do not belong to the
// report beside them.
void remove_older_nights(const NightOptions& options, const InputFiles& inputs) {
  const auto remove_if_there = [&](const std::string& file) {
    std::error_code ignored;
    if (!std::filesystem::exists(file, ignored)) return false;
    if (inputs.read_as(file).empty()) std::filesystem::remove(file, ignored);
    return true;
  };
  if (!options.labels) remove_if_there(options.output + "/" + kCocoFile);
  for (int v = 0;; ++v) {
    const bool made = v < options.variants;
    bool any = made;
    if (!made || !options.labels) {
      for (const std::string& file : label_files(night_stem(options.output, v))) any = remove_if_there(file) || any;
    }
    for (const auto& [file, written] : night_files(options, v)) {
      if (!made || !written) any = remove_if_there(file) || any;
    }
    if (!any) return;
  }
}

// io::take_work_scene() at --work-size; empty: the usual one.
[[nodiscard]] io::Expected<io::Scene> at_work_size(io::Scene& photograph, const std::string& size) {
  Shape shape = io::work_shape(photograph.shape());
  if (!size.empty()) {
    const io::Expected<Shape> parsed = parse_size(size, "--work-size");
    if (!parsed) return parsed.error();
    shape = parsed.value();
    if (shape.width > photograph.shape().width || shape.height > photograph.shape().height) {
      return io::Error{
          "", "--work-size",
          "is '" + size + "', expected at most " + io::size_text(photograph.shape()) + ", the pictures' size"};
    }
  }
  return io::take_work_scene(photograph, shape);
}

[[nodiscard]] io::Expected<io::CameraModel> chosen_camera(const NightOptions& options) {
  const std::string usual = options.preset == "thesis" ? "thesis" : "action-camera";
  io::Expected<io::CameraModel> read = io::read_camera(options.camera.empty() ? usual : options.camera);
  if (!read) return io::Error{read.error().file, "--camera " + read.error().field, read.error().problem};
  AutoExposureParams& exposure = read.value().edit().exposure;
  if (!options.meter.empty()) {
    exposure.metering = options.meter == "mean"     ? Metering::mean
                        : options.meter == "centre" ? Metering::centre
                                                    : Metering::highlight;
  }
  if (options.iso > 0.0F) {
    exposure.metering = Metering::fixed;
    exposure.camera.iso = options.iso;
  }
  if (options.exposure_s > 0.0F) exposure.camera.time_s = options.exposure_s;
  if (options.f_number > 0.0F) exposure.camera.f_number = options.f_number;
  if (options.ev != 0.0F) exposure.ev = options.ev;
  PhotographParams& params = read.value().edit();
  if (options.speed_m_s != 0.0F) params.motion.velocity_m_s = {0.0F, 0.0F, options.speed_m_s};
  if (options.yaw_rate != 0.0F) params.motion.rotation_rad_s = {0.0F, options.yaw_rate, 0.0F};
  if (options.flicker) params.flicker.on = true;
  return read;
}

// What the options ask for. `light_set` becomes the lamps that the parameters point to; files that are read join
// `inputs`.
[[nodiscard]] io::Expected<NightParams> params_of(const NightOptions& options, io::LightSet& light_set,
                                                  InputFiles& inputs) {
  NightParams params = options.preset == "thesis" ? thesis_night_params() : default_night_params();
  params.seed = options.seed;
  params.variants = options.variants;
  params.relight.gather.rays = first_rays(options);
  params.relight.max_rays = std::max(params.relight.max_rays, options.rays);
  params.relight.max_error = options.error;
  params.relight.material.film.wetness = options.wet;
  if (options.unseen_lamps == "dark") params.relight.rows.behind_m = 0.0F;
  if (options.unseen_lamps == "continued") params.relight.rows.behind_m = ContinuedRowParams{}.behind_m;
  params.relight.rows.assumed_width_m = options.assume_lamps_m;
  if (options.unseen_street >= 0.0F) params.relight.unseen.share = options.unseen_street;
  params.relight.ego.high_beam = options.headlamps == "high";
  params.relight.ego.left_hand_traffic = options.traffic == "left";
  params.relight.placement.left_hand_traffic = options.traffic == "left";
  if (!options.headlamps.empty()) params.relight.ego_headlamps = options.headlamps != "off";
  params.relight.following_car_m = options.following_car_m;
  if (!options.moon.empty()) {
    const io::Expected<Vec3f> moon = parse_moon(options.moon);
    if (!moon) return moon.error();
    params.relight.rows.moon = moon.value();
  }
  if (options.mesh_error >= 0.0F) {
    params.mesh.simplify_faces = options.mesh_error > 0.0F;
    params.mesh.simplify.max_relative_depth_error = options.mesh_error;
  }
  const io::Expected<io::CameraModel> camera = chosen_camera(options);
  if (!camera) return camera.error();
  params.camera = camera.value().params();
  if (camera.value().from_file()) inputs.add(options.camera, "--camera");
  params.raw = options.raw;
  if (options.raw && (params.camera.ideal_sensor || params.camera.sensor.exposures != 1)) {
    return io::Error{
        "", "--raw",
        "camera '" + camera.value().name + "' has no single raw picture, expected one with filters and one exposure"};
  }
  if (!options.light_set.empty()) {
    io::Expected<io::LightSet> read = io::read_light_set(options.light_set);
    if (!read) return read.error();
    light_set = std::move(read.value());
    params.relight.activation.light_set = light_set.view();
    inputs.add(options.light_set, "--lights");
    for (const std::string& file : light_set.luminaire_files) inputs.add(file, "a luminaire of --lights");
  }
  return params;
}

// What is odd about the scene, and what follows from it.
void print_notes(const NightOptions& options, const io::Scene& scene, const std::vector<std::string>& doubts) {
  for (const std::string& note : scene.notes) std::fprintf(stderr, "  note: %s\n", note.c_str());
  for (const std::string& doubt : doubts) std::fprintf(stderr, "  doubt: %s\n", doubt.c_str());
  const bool dark =
      options.assume_lamps_m <= 0 && std::none_of(scene.lights.begin(), scene.lights.end(),
                                                  [](const LightMark& mark) { return is_street_lamp(mark.cls); });
  if (dark) {
    std::fprintf(stderr,
                 "  note: no street lamp is marked, so what headlamps do not reach stays dark; mark them, or "
                 "--assume-lamps 8 lights a road of 8 m\n");
  }
}

}  // namespace

int run_night(const NightOptions& options) {
  Console console(options.quiet);
  if (!options.size.empty()) {
    if (const io::Expected<Shape> parsed = parse_size(options.size); !parsed) return fail(parsed.error());
  }
  io::Expected<io::Scene> loaded = console.timed("read scene", [&] { return load_scene(options.scene, ""); });
  if (!loaded) return fail(loaded.error());
  io::Scene& photograph = loaded.value();
  InputFiles inputs(photograph);
  io::LightSet light_set;
  io::Expected<NightParams> asked = params_of(options, light_set, inputs);
  if (!asked) return fail(asked.error());
  NightParams& params = asked.value();
  params.photograph = photograph.photograph;
  if (const io::Outcome apart = inputs.expect_none_of(night_outputs(options)); !apart) return fail(apart.error());

  const io::Expected<std::vector<std::uint8_t>> shops =
      console.timed("shop fronts", [&] { return shop_fronts(params, photograph, options.threads); });
  if (!shops) return fail(shops.error());
  params.relight.shop_fronts = {shops.value().data(), shops.value().size()};
  if (const io::Outcome resized = resize_to(photograph, options.size); !resized) return fail(resized.error());
  const std::vector<std::string> doubts = io::scene_doubts(photograph);
  const io::Expected<io::Scene> reduced =
      console.timed("scene at work size", [&] { return at_work_size(photograph, options.work_size); });
  if (!reduced) return fail(reduced.error());
  const io::Scene& scene = reduced.value();
  if (!options.quiet) print_notes(options, scene, doubts);
  if (const io::Outcome made = make_folder(options.output); !made) return fail(made.error());

  const SceneView view = scene.view();
  io::HostMemory memory(night_workspace_bytes(params, view.shape(), view.lights.size()));
  Workspace workspace = memory.workspace();
  const unsigned threads = thread_count(options.threads);
  ThreadPool pool(threads);
  DaylightRecorder recorder(console);
  NightWriter writer(options, photograph, scene, doubts, params, recorder, console, pool);
  const Status status = engine::make_large_nights(params, photograph.view(), view, workspace, pool, recorder, writer);
  // Of an interrupted run too; what could not be written is the writer's error.
  static_cast<void>(writer.finish_nights());
  if (writer.error() != nullptr) return fail(*writer.error());
  if (status.code() == StatusCode::no_valid_input) {
    return fail(io::Error{scene.file, "depth",
                          "has no usable sample on any surface: expected depth of 1e-3 m to 1e5 m "
                          "on pixels that are not labelled as sky"});
  }
  if (status.code() == StatusCode::workspace_exhausted) {
    std::fprintf(stderr,
                 "npsim: %s: more memory is needed at this size than the system gives; try --size or --work-size\n",
                 options.scene.c_str());
    return kExitFailed;
  }
  if (!status.ok()) return fail(options.scene, status);
  if (const io::Outcome finished = writer.finish(params, memory, workspace, threads); !finished) {
    return fail(finished.error());
  }
  remove_older_nights(options, inputs);
  std::printf("%s\n", (options.output + "/overview.png").c_str());
  return kExitDone;
}

}  // namespace npsim::tool
