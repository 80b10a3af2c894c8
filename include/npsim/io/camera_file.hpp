// SPDX-License-Identifier: Apache-2.0
// A camera by the name of a preset or from a JSON file:
//
//   {"preset": "dashcam",                                  what the file does not name is the preset's; action-camera
//    "exposure": {"iso_max": 3200, "f_number": 1.8, "meter": "centre"},
//    "glare": {"halo": 1.2, "veil": 0.1},
//    "sensor": {"mosaic": "grbg", "bits": 12, "black": 64, "response": [[...], [...], [...]]},
//    "noise": {"residual": 1, "table": [[100, 1.46e-4, 2.6e-7], ...]},     rows of ISO, beta1, beta2
//    "motion": {"velocity_m_s": [0, 0, 14], "objects": [[26001, 0, 0, 10]]}, "flicker": {},
//    "white_balance": {"fixed_k": 4000}, "denoise": {"strength": 0}, "isp": {"demosaic": "bilinear", "tone": "clip"}}
// docs/camera.md lists the fields with their units. A noise table that was fitted to digital numbers, black level
// included (its beta2 is negative), says so by "black" and "white" beside it and is converted. Its unit is white of the
// picture: sensors that take h times white have beta1 h and beta2 h^2 of what is measured in full scales.
#ifndef NPSIM_IO_CAMERA_FILE_HPP
#define NPSIM_IO_CAMERA_FILE_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <utility>
#include <vector>

#include "npsim/io/detail/json_fields.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"
#include "npsim/pipeline/photograph.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

class CameraModel {
 public:
  std::string name = "action-camera";
  std::vector<NoiseAtIso> noise;  // empty: the built-in table
  std::vector<ObjectMotion> objects;

  explicit CameraModel(const PhotographParams& params = {}) : params_(params) {}
  // Refers to `noise` and `objects`.
  [[nodiscard]] PhotographParams params() const {
    PhotographParams out = params_;
    if (!noise.empty()) out.noise_table = Span<const NoiseAtIso>(noise.data(), noise.size());
    out.motion.objects = Span<const ObjectMotion>(objects.data(), objects.size());
    return out;
  }
  [[nodiscard]] PhotographParams& edit() { return params_; }
  [[nodiscard]] bool from_file() const { return name.find_first_of("./") != std::string::npos; }

 private:
  PhotographParams params_;
};

inline constexpr const char* kCameraPresets = "action-camera, dashcam, automotive-hdr, automotive-raw, thesis";

[[nodiscard]] inline Expected<CameraModel> camera_preset(const std::string& name) {
  const std::pair<const char*, PhotographParams (*)()> presets[] = {
      {"action-camera", [] { return PhotographParams::action_camera(); }},
      {"dashcam", [] { return PhotographParams::dashcam(); }},
      {"automotive-hdr", [] { return PhotographParams::automotive_hdr(); }},
      {"automotive-raw", [] { return PhotographParams::automotive_raw(); }},
      {"thesis", [] { return PhotographParams::thesis(); }}};
  for (const auto& [known, make] : presets) {
    if (name != known) continue;
    CameraModel camera(make());
    camera.name = name;
    return camera;
  }
  return Error{"", name, std::string("is no preset, expected one of: ") + kCameraPresets};
}

namespace detail {

struct NumberField {
  const char* key;
  float* value;
};
inline Outcome read_numbers(const JsonObject& object, std::initializer_list<NumberField> fields) {
  for (const NumberField& field : fields) {
    if (!object.has(field.key)) continue;
    const Expected<double> number = object.number(field.key);
    if (!number) return number.error();
    *field.value = static_cast<float>(number.value());
  }
  return Done{};
}

// The place of a word in the list is the value of the enumerator that it names.
template <class Enum>
Outcome read_word(const JsonObject& object, const char* key, std::initializer_list<const char*> words, Enum& out) {
  if (!object.has(key)) return Done{};
  const Expected<std::string> text = object.text(key);
  if (!text) return text.error();
  std::string list;
  int place = 0;
  for (const char* word : words) {
    if (text.value() == word) {
      out = static_cast<Enum>(place);
      return Done{};
    }
    list += (place++ == 0 ? "" : ", ") + std::string(word);
  }
  return Error{object.file(), object.field(key), "is '" + text.value() + "', expected one of: " + list};
}

inline Outcome read_whole(const JsonObject& object, const char* key, int& out) {
  if (!object.has(key)) return Done{};
  const Expected<std::int64_t> whole = object.whole(key);
  if (!whole) return whole.error();
  if (whole.value() < 0 || whole.value() > 1000) return Error{object.file(), object.field(key), "expected 0 to 1000"};
  out = static_cast<int>(whole.value());
  return Done{};
}

// A list of `count` numbers.
inline Expected<std::vector<double>> number_row(const std::string& file, const std::string& field, const Json& v,
                                                std::size_t count) {
  std::vector<double> row;
  if (v.is_array() && v.size() == count) {
    for (const Json& number : v) {
      if (number.is_number()) row.push_back(number.get<double>());
    }
  }
  if (row.size() != count) return Error{file, field, "expected a list of " + std::to_string(count) + " numbers"};
  return row;
}

inline Outcome read_exposure(const JsonObject& o, AutoExposureParams& p) {
  if (auto k = o.allow_only({"iso", "f_number", "time_s", "transmittance", "meter", "iso_min", "iso_max", "target_mean",
                             "highlight_share", "usual_iso", "compensation", "ev"});
      !k) {
    return k;
  }
  if (o.has("iso")) p.metering = Metering::fixed;
  if (auto r = read_numbers(o, {{"iso", &p.camera.iso},
                                {"f_number", &p.camera.f_number},
                                {"time_s", &p.camera.time_s},
                                {"transmittance", &p.camera.transmittance},
                                {"iso_min", &p.iso_min},
                                {"iso_max", &p.iso_max},
                                {"target_mean", &p.target_mean},
                                {"highlight_share", &p.highlight_share},
                                {"usual_iso", &p.usual_iso},
                                {"compensation", &p.compensation},
                                {"ev", &p.ev}});
      !r) {
    return r;
  }
  return read_word(o, "meter", {"mean", "centre", "highlight", "fixed"}, p.metering);
}

inline Outcome read_glare(const JsonObject& o, GlareParams& glare, StarburstParams& starburst) {
  if (auto k =
          o.allow_only({"halo", "veil", "core_deg", "cap", "blades", "turn_deg", "apothem_mm", "streak", "streak_deg"});
      !k) {
    return k;
  }
  if (auto r = read_whole(o, "blades", starburst.blades); !r) return r;
  if (auto r = read_numbers(o, {{"halo", &glare.halo},
                                {"veil", &glare.veil},
                                {"core_deg", &glare.core_deg},
                                {"cap", &glare.cap},
                                {"turn_deg", &starburst.turn_deg},
                                {"apothem_mm", &starburst.apothem_mm},
                                {"streak", &starburst.streak},
                                {"streak_deg", &starburst.streak_deg}});
      !r) {
    return r;
  }
  starburst.cap = glare.cap;
  return Done{};
}

inline Outcome read_sensor(const JsonObject& o, SensorParams& p) {
  if (auto k = o.allow_only({"mosaic", "response", "bits", "black", "vignetting", "blur_px", "exposures", "ratio",
                             "row_noise", "hot_pixels", "hot_rate", "serial"});
      !k) {
    return k;
  }
  if (o.has("response")) {
    const Expected<const Json*> rows = o.list("response");
    if (!rows) return rows.error();
    if (rows.value()->size() != 3) return Error{o.file(), o.field("response"), "expected three rows of three numbers"};
    for (std::size_t i = 0; i < 3; ++i) {
      const Expected<std::vector<double>> row = number_row(o.file(), o.field("response"), (*rows.value())[i], 3);
      if (!row) return row.error();
      p.response[i] = vec_cast<float>(Vec3d{row.value()[0], row.value()[1], row.value()[2]});
    }
  }
  if (auto r = read_numbers(o, {{"black", &p.black},
                                {"vignetting", &p.vignetting},
                                {"blur_px", &p.blur_px},
                                {"ratio", &p.ratio},
                                {"row_noise", &p.row_noise},
                                {"hot_pixels", &p.hot_pixels},
                                {"hot_rate", &p.hot_rate}});
      !r) {
    return r;
  }
  if (auto r = read_whole(o, "bits", p.bits); !r) return r;
  if (auto r = read_whole(o, "exposures", p.exposures); !r) return r;
  if (auto r = read_whole(o, "serial", p.serial); !r) return r;
  return read_word(o, "mosaic", {"rggb", "bggr", "grbg", "gbrg"}, p.mosaic);
}

inline Outcome read_noise(const JsonObject& o, PhotographParams& p, std::vector<NoiseAtIso>& table) {
  if (auto k = o.allow_only({"residual", "colour_noise", "table", "black", "white"}); !k) return k;
  if (auto r = read_numbers(o, {{"residual", &p.residual_noise}, {"colour_noise", &p.colour_noise}}); !r) return r;
  if (!o.has("table")) return Done{};
  const Expected<const Json*> rows = o.list("table");
  if (!rows) return rows.error();
  double black = 0.0;
  double white = 1.0;
  if (o.has("black") || o.has("white")) {
    const Expected<double> low = o.number("black");
    if (!low) return low.error();
    const Expected<double> high = o.number("white");
    if (!high) return high.error();
    black = low.value();
    white = high.value();
    if (!(black >= 0.0 && white > black)) return Error{o.file(), o.field("white"), "expected more than black"};
  }
  table.clear();
  for (const Json& v : *rows.value()) {
    const Expected<std::vector<double>> row = number_row(o.file(), o.field("table"), v, 3);
    if (!row) return row.error();
    table.push_back(
        {static_cast<float>(row.value()[0]), without_black_level(row.value()[1], row.value()[2], black, white)});
  }
  if (const Status valid = validate(Span<const NoiseAtIso>(table.data(), table.size())); !valid.ok()) {
    return Error{o.file(), o.field("table"), std::string("expected valid rows; ") + valid.message()};
  }
  return Done{};
}

// `count` numbers, where the key is there.
inline Outcome read_vector(const JsonObject& o, const char* key, std::size_t count, float* out) {
  if (!o.has(key)) return Done{};
  const Expected<std::vector<double>> row = number_row(o.file(), o.field(key), o.value()[key], count);
  if (!row) return row.error();
  for (std::size_t i = 0; i < count; ++i) out[i] = static_cast<float>(row.value()[i]);
  return Done{};
}

inline Outcome read_motion(const JsonObject& o, MotionParams& p, std::vector<ObjectMotion>& objects) {
  if (auto k = o.allow_only({"velocity_m_s", "rotation_rad_s", "objects", "readout_s", "lamp_cd_m2", "samples"}); !k) {
    return k;
  }
  if (auto r = read_vector(o, "velocity_m_s", 3, &p.velocity_m_s.x); !r) return r;
  if (auto r = read_vector(o, "rotation_rad_s", 3, &p.rotation_rad_s.x); !r) return r;
  if (auto r = read_numbers(o, {{"readout_s", &p.readout_s}, {"lamp_cd_m2", &p.lamp_cd_m2}}); !r) return r;
  if (auto r = read_whole(o, "samples", p.samples); !r) return r;
  if (!o.has("objects")) return Done{};
  const Expected<const Json*> rows = o.list("objects");
  if (!rows) return rows.error();
  for (const Json& v : *rows.value()) {
    const Expected<std::vector<double>> row = number_row(o.file(), o.field("objects"), v, 4);
    if (!row) return row.error();
    const double id = row.value()[0];
    if (!(id >= 0.0 && id <= 65535.0 && id == std::floor(id))) {
      return Error{o.file(), o.field("objects"), "expected rows of an instance id, 0 to 65535, and a velocity x, y, z"};
    }
    objects.push_back(
        {static_cast<std::uint16_t>(id), vec_cast<float>(Vec3d{row.value()[1], row.value()[2], row.value()[3]})});
    p.objects = Span<const ObjectMotion>(objects.data(), objects.size());
  }
  return Done{};
}

inline Outcome read_flicker(const JsonObject& o, FlickerParams& p) {
  if (auto k = o.allow_only({"vehicle_hz", "vehicle_duty", "signal_hz", "signal_duty"}); !k) return k;
  p.on = true;
  if (auto r = read_vector(o, "vehicle_hz", 2, p.vehicle_hz); !r) return r;
  if (auto r = read_vector(o, "vehicle_duty", 2, p.vehicle_duty); !r) return r;
  return read_numbers(o, {{"signal_hz", &p.signal_hz}, {"signal_duty", &p.signal_duty}});
}

inline Outcome read_white_balance(const JsonObject& o, WhiteBalanceParams& p) {
  if (auto k = o.allow_only({"coolest_k", "warmest_k", "adaptation", "fixed_k"}); !k) return k;
  return read_numbers(o, {{"coolest_k", &p.coolest_k},
                          {"warmest_k", &p.warmest_k},
                          {"adaptation", &p.adaptation},
                          {"fixed_k", &p.fixed_k}});
}

inline Outcome read_isp(const JsonObject& o, IspParams& p, float& sharpening) {
  if (auto k = o.allow_only({"demosaic", "chroma", "pale_from", "pale", "saturation", "tone", "toe", "knee", "lift",
                             "local", "local_reach", "local_edge", "local_dark", "black_cast", "sharpening"});
      !k) {
    return k;
  }
  if (auto r = read_numbers(o, {{"pale_from", &p.pale_from},
                                {"pale", &p.pale},
                                {"saturation", &p.saturation},
                                {"toe", &p.tone.toe},
                                {"knee", &p.tone.knee},
                                {"lift", &p.tone.lift},
                                {"local", &p.local.share},
                                {"local_reach", &p.local.reach},
                                {"local_edge", &p.local.edge_stops},
                                {"local_dark", &p.local.dark},
                                {"sharpening", &sharpening}});
      !r) {
    return r;
  }
  if (auto r = read_vector(o, "black_cast", 3, &p.black_cast.x); !r) return r;
  if (auto r = read_word(o, "demosaic", {"bilinear", "gradient"}, p.demosaic); !r) return r;
  if (auto r = read_word(o, "chroma", {"4:4:4", "4:2:0"}, p.chroma); !r) return r;
  return read_word(o, "tone", {"clip", "filmic", "log"}, p.tone.kind);
}

// Calls read(object) for a part of the file that is there, then checks the part.
template <class Part, class Read>
Outcome read_part(const JsonObject& whole, const char* key, const Part& part, const Read& read) {
  if (!whole.has(key)) return Done{};
  const Expected<JsonObject> object = whole.object(key);
  if (!object) return object.error();
  if (const Outcome done = read(object.value()); !done) return done;
  const Status valid = validate(part);
  if (!valid.ok()) return Error{whole.file(), key, std::string("has a value out of range; ") + valid.message()};
  return Done{};
}

}  // namespace detail

[[nodiscard]] inline Expected<CameraModel> read_camera_file(const std::string& path, const ReadLimits& limits = {}) {
  const Expected<Json> json = read_json(path, limits);
  if (!json) return json.error();
  const Expected<JsonObject> object = JsonObject::of(path, "", json.value());
  if (!object) return object.error();
  const JsonObject& whole = object.value();
  if (auto k = whole.allow_only(
          {"preset", "exposure", "motion", "flicker", "glare", "sensor", "noise", "white_balance", "denoise", "isp"});
      !k) {
    return k.error();
  }
  std::string preset = "action-camera";
  if (whole.has("preset")) {
    const Expected<std::string> text = whole.text("preset");
    if (!text) return text.error();
    preset = text.value();
  }
  Expected<CameraModel> made = camera_preset(preset);
  if (!made) return Error{path, "preset", "is '" + preset + "', expected one of: " + kCameraPresets};
  CameraModel camera = made.value();
  camera.name = path;
  PhotographParams& p = camera.edit();
  using detail::read_part;
  if (auto r = read_part(whole, "exposure", p.exposure,
                         [&](const JsonObject& o) { return detail::read_exposure(o, p.exposure); });
      !r) {
    return r.error();
  }
  if (auto r = read_part(whole, "motion", p.motion,
                         [&](const JsonObject& o) { return detail::read_motion(o, p.motion, camera.objects); });
      !r) {
    return r.error();
  }
  if (auto r = read_part(whole, "flicker", p.flicker,
                         [&](const JsonObject& o) { return detail::read_flicker(o, p.flicker); });
      !r) {
    return r.error();
  }
  if (auto r = read_part(whole, "glare", p,
                         [&](const JsonObject& o) { return detail::read_glare(o, p.glare, p.starburst); });
      !r) {
    return r.error();
  }
  if (auto r =
          read_part(whole, "sensor", p.sensor, [&](const JsonObject& o) { return detail::read_sensor(o, p.sensor); });
      !r) {
    return r.error();
  }
  if (auto r =
          read_part(whole, "noise", p, [&](const JsonObject& o) { return detail::read_noise(o, p, camera.noise); });
      !r) {
    return r.error();
  }
  if (auto r = read_part(whole, "white_balance", p.white_balance,
                         [&](const JsonObject& o) { return detail::read_white_balance(o, p.white_balance); });
      !r) {
    return r.error();
  }
  if (auto r = read_part(
          whole, "denoise", p.denoise,
          [&](const JsonObject& o) {
            if (auto k = o.allow_only({"strength", "shadows"}); !k) return k;
            return detail::read_numbers(o, {{"strength", &p.denoise.strength}, {"shadows", &p.denoise.shadows}});
          });
      !r) {
    return r.error();
  }
  if (auto r =
          read_part(whole, "isp", p, [&](const JsonObject& o) { return detail::read_isp(o, p.isp, p.sharpening); });
      !r) {
    return r.error();
  }
  return camera;
}

// A preset's name, or a file.
[[nodiscard]] inline Expected<CameraModel> read_camera(const std::string& preset_or_file,
                                                       const ReadLimits& limits = {}) {
  Expected<CameraModel> preset = camera_preset(preset_or_file);
  if (preset) return preset;
  if (preset_or_file.find_first_of("./") == std::string::npos) return preset;
  return read_camera_file(preset_or_file, limits);
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_CAMERA_FILE_HPP
