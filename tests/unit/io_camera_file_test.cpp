// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "npsim/io/camera_file.hpp"

namespace {

using namespace npsim;

io::Expected<io::CameraModel> read_camera_text(const std::string& text) {
  const std::string path = (std::filesystem::temp_directory_path() / "npsim_camera_file_test.json").string();
  std::ofstream(path) << text;
  auto result = io::read_camera(path);
  std::filesystem::remove(path);
  return result;
}

std::string fault(const std::string& text) {
  const auto camera = read_camera_text(text);
  return camera ? std::string() : camera.error().line();
}

bool has(const std::string& text, const char* part) { return text.find(part) != std::string::npos; }

}  // namespace

TEST_CASE("camera file: presets by name, each valid; another name is refused with the list") {
  for (const char* name : {"action-camera", "dashcam", "automotive-hdr", "automotive-raw", "thesis"}) {
    const auto camera = io::read_camera(name);
    REQUIRE(camera.ok());
    CHECK(validate(camera.value().params()).ok());
    CHECK_FALSE(camera.value().from_file());
    // Those of video look through a wiped windscreen; black was measured of action cameras.
    const PhotographParams p = camera.value().params();
    const bool action = std::string(name) == "action-camera";
    CHECK((p.starburst.streak == 0.0004F && p.starburst.streak_deg == -45.0F) ==
          (action || std::string(name) == "dashcam"));
    CHECK((p.starburst.streak == 0.0F) == !(action || std::string(name) == "dashcam"));
    CHECK(p.isp.black_cast == (action ? Vec3f{0.0010F, 0, 0.0013F} : Vec3f{}));
  }
  CHECK(io::read_camera("thesis").value().params().ideal_sensor);
  CHECK(has(io::read_camera("webcam").error().line(), "automotive-hdr"));
}

TEST_CASE("camera file: every part is read, and what is not named is the preset's") {
  const auto camera = read_camera_text(R"({"preset": "dashcam",
    "exposure": {"iso": 500, "f_number": 2.8, "time_s": 0.02},
    "glare": {"halo": 0.1, "cap": 1e5, "blades": 6, "turn_deg": 10, "apothem_mm": 2, "streak": 0.001,
    "streak_deg": 30},
    "sensor": {"mosaic": "gbrg", "bits": 10, "black": 32, "row_noise": 0.2, "hot_pixels": 1e-4, "serial": 9,
    "response": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]},
    "noise": {"residual": 0.5, "table": [[100, 1e-4, 1e-7], [200, 2e-4, 4e-7]]},
    "white_balance": {"fixed_k": 4000}, "denoise": {"strength": 0},
    "isp": {"demosaic": "bilinear", "chroma": "4:4:4", "tone": "log", "lift": 50, "local": 0.5, "local_edge": 3,
    "local_reach": 0.2, "local_dark": 0.001, "black_cast": [0.001, 0, 0.002], "sharpening": 0.7}})");
  REQUIRE(camera.ok());
  const PhotographParams p = camera.value().params();
  CHECK(p.exposure.metering == Metering::fixed);
  CHECK(p.exposure.camera.iso == 500.0F);
  CHECK(p.glare.halo == 0.1F);
  CHECK(p.glare.veil == PhotographParams::dashcam().glare.veil);
  CHECK(p.sensor.mosaic == Mosaic::gbrg);
  CHECK(p.sensor.bits == 10);
  CHECK(p.sensor.row_noise == 0.2F);
  CHECK(p.sensor.hot_pixels == 1e-4F);
  CHECK(p.sensor.serial == 9);
  CHECK(p.sharpening == 0.7F);
  CHECK(p.sensor.response[2] == Vec3f{0, 0, 1});
  CHECK(noise_level(200.0F, p.noise_table).value().beta2 == doctest::Approx(4e-7));
  CHECK(p.white_balance.fixed_k == 4000.0F);
  CHECK(p.isp.demosaic == Demosaic::bilinear);
  CHECK(p.isp.chroma == ChromaSampling::yuv444);
  CHECK(p.isp.tone.kind == ToneKind::log);
  CHECK(p.starburst.blades == 6);
  CHECK(p.starburst.turn_deg == 10.0F);
  CHECK(p.starburst.apothem_mm == 2.0F);
  CHECK(p.starburst.cap == 1e5F);
  CHECK(p.starburst.streak == 0.001F);
  CHECK(p.starburst.streak_deg == 30.0F);
  CHECK(p.isp.black_cast == Vec3f{0.001F, 0, 0.002F});
  CHECK(p.isp.local.share == 0.5F);
  CHECK(p.isp.local.edge_stops == 3.0F);
  CHECK(p.isp.local.reach == 0.2F);
  CHECK(p.isp.local.dark == 0.001F);
  CHECK(camera.value().from_file());
}

TEST_CASE("camera file: motion of camera and objects, readout, flicker; presets are at rest") {
  for (const char* name : {"action-camera", "dashcam", "automotive-hdr", "automotive-raw", "thesis"}) {
    const PhotographParams p = io::read_camera(name).value().params();
    CHECK_FALSE(has_motion(p.motion));
    CHECK_FALSE(p.flicker.on);
  }
  const auto camera =
      read_camera_text(R"({"motion": {"velocity_m_s": [0.5, 0, 14], "rotation_rad_s": [0, 0.2, 0], "readout_s": 0.01,
    "objects": [[26001, -1, 0, 10], [7, 0, 0, 3]]}, "flicker": {"vehicle_hz": [100, 200], "signal_duty": 0.25}})");
  REQUIRE(camera.ok());
  const io::CameraModel copy = camera.value();
  const PhotographParams p = copy.params();
  CHECK(p.motion.velocity_m_s == Vec3f{0.5F, 0, 14});
  CHECK(p.motion.rotation_rad_s == Vec3f{0, 0.2F, 0});
  CHECK(p.motion.readout_s == 0.01F);
  REQUIRE(p.motion.objects.size() == 2);
  CHECK(p.motion.objects[0].instance == 26001);
  CHECK(p.motion.objects[1].velocity_m_s == Vec3f{0, 0, 3});
  CHECK(p.flicker.on);
  CHECK(p.flicker.vehicle_hz[1] == 200.0F);
  CHECK(p.flicker.vehicle_duty[1] == FlickerParams{}.vehicle_duty[1]);
  CHECK(p.flicker.signal_duty == 0.25F);
  CHECK(has(fault(R"({"motion": {"speed": 3}})"), "motion.speed"));
  CHECK(has(fault(R"({"motion": {"velocity_m_s": [1, 2]}})"), "motion.velocity_m_s"));
  CHECK(has(fault(R"({"motion": {"objects": [[1.5, 0, 0, 0]]}})"), "motion.objects"));
  CHECK(has(fault(R"({"motion": {"readout_s": -1}})"), "readout in [0, 1] s"));
  CHECK(has(fault(R"({"flicker": {"vehicle_hz": [400, 90]}})"), "ranges ascending"));
}

TEST_CASE("camera file: a noise table with the black level folded in is converted") {
  const auto camera =
      read_camera_text(R"({"noise": {"table": [[100, 0.141923, -8.890307]], "black": 64, "white": 1023}})");
  REQUIRE(camera.ok());
  const NoiseLevel level = noise_level(100.0F, camera.value().params().noise_table).value();
  CHECK(level.beta1 == doctest::Approx(1.48e-4).epsilon(1e-3));
  CHECK(level.beta2 == doctest::Approx(2.096e-7).epsilon(1e-3));
}

TEST_CASE("camera file: each fault is named by file and field") {
  CHECK(has(fault(R"({"preset": "phone"})"), "preset"));
  CHECK(has(fault(R"({"exposures": {}})"), "exposures"));
  CHECK(has(fault(R"({"exposure": {"isos": 1}})"), "exposure.isos"));
  CHECK(has(fault(R"({"exposure": {"time_s": 0}})"), "time in (0, 3600] s"));
  CHECK(has(fault(R"({"exposure": {"meter": "spot"}})"), "exposure.meter"));
  CHECK(has(fault(R"({"sensor": {"mosaic": "xtrans"}})"), "sensor.mosaic"));
  CHECK(has(fault(R"({"sensor": {"hot_pixels": 0.5}})"), "hot pixels in [0, .1]"));
  CHECK(has(fault(R"({"isp": {"sharpening": 9}})"), "sharpening in [0, 4]"));
  CHECK(has(fault(R"({"isp": {"local": 2}})"), "share in [0, 1]"));
  CHECK(has(fault(R"({"glare": {"blades": 2}})"), "blades 0 or 3 to 31"));
  CHECK(has(fault(R"({"glare": {"blades": 6.5}})"), "glare.blades"));
  CHECK(has(fault(R"({"sensor": {"bits": 99}})"), "bits in 8..16"));
  CHECK(has(fault(R"({"sensor": {"response": [[1, 0], [0, 1], [0, 0]]}})"), "sensor.response"));
  CHECK(has(fault(R"({"noise": {"table": []}})"), "noise.table"));
  CHECK(has(fault(R"({"noise": {"table": [[100, 1e-4, -1e-3]]}})"), "negative beta2"));
  CHECK(has(fault(R"({"noise": {"table": [[100, 1, -1]], "black": 64, "white": 10}})"), "noise.white"));
  CHECK(has(fault(R"({"glare": {"halo": "much"}})"), "glare.halo"));
  CHECK(has(fault(R"([1])"), "object"));
}
