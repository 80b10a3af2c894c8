// SPDX-License-Identifier: Apache-2.0
// npsim truth on a small street: what it writes, that it goes on where it was stopped, and what it refuses.
#include <doctest/doctest.h>

#ifdef NPSIM_TOOL

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>
#include <utility>

#include "lab/true_lamps.hpp"
#include "lab/truth_night.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/io/pfm.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/io/scene_resize.hpp"
#include "tool_fixture.hpp"

using namespace tool_test;

namespace {

namespace io = npsim::io;

// A night of the street, drawn once.
const std::string& night_folder() {
  static const std::string folder = [] {
    const std::string out = fixture().out("night_for_truth");
    const Run run = run_tool("night '" + fixture().street + "' -o '" + out + "' --seed 3 --quiet");
    REQUIRE_MESSAGE(run.status == 0, run.output);
    return out;
  }();
  return folder;
}

std::string truth_of(const std::string& scene, const std::string& json, const std::string& output,
                     const std::string& options) {
  return "truth '" + scene + "' '" + json + "' -o '" + output + "' --size 96x54 --quiet " + options;
}

}  // namespace

TEST_CASE("tool truth: a night in cd/m2, with its error, its direct light and its lamps") {
  const std::string json = night_folder() + "/night_000.json";
  const std::string out = fixture().out("truth/a.pfm");
  const Run run = run_tool(truth_of(fixture().street, json, out, "--samples 40"));
  REQUIRE_MESSAGE(run.status == 0, run.output);
  CHECK(run.output == out + "\n");
  const auto all = io::read_pfm_rgb(out);
  const auto direct = io::read_pfm_rgb(fixture().out("truth/a_direct.pfm"));
  const auto emitted = io::read_pfm_rgb(fixture().out("truth/a_emitted.pfm"));
  const auto error = io::read_pfm(fixture().out("truth/a_error.pfm"));
  REQUIRE(all.ok());
  REQUIRE(direct.ok());
  REQUIRE(emitted.ok());
  REQUIRE(error.ok());
  double mean = 0;
  std::size_t wrong = 0;
  std::size_t lamps = 0;
  for (std::size_t p = 0; p < all.value().shape().pixels(); ++p) {
    const float light = npsim::luminance(all.value().data()[p]);
    const float parts = npsim::luminance(direct.value().data()[p]) + npsim::luminance(emitted.value().data()[p]);
    mean += static_cast<double>(light) / static_cast<double>(all.value().shape().pixels());
    wrong += std::isfinite(light) && light >= parts * 0.9999F && error.value().data()[p] >= 0 ? 0U : 1U;
    lamps += npsim::luminance(emitted.value().data()[p]) > 0 ? 1U : 0U;
  }
  CHECK(wrong == 0);
  CHECK(lamps > 5);
  CHECK(mean > 0.05);
  CHECK(mean < 500);
  CHECK(!fs::exists(out + ".partial"));
}

TEST_CASE("tool truth: in two goes, on other threads, the bytes are those of one") {
  const std::string json = night_folder() + "/night_000.json";
  const auto truth = [&](const char* name, const char* options) {
    const Run run = run_tool(truth_of(fixture().street, json, fixture().out(name), options));
    REQUIRE_MESSAGE(run.status == 0, run.output);
  };
  truth("truth/whole.pfm", "--samples 80 --threads 2");
  truth("truth/parts.pfm", "--samples 48 --threads 1 --keep");
  CHECK(fs::exists(fixture().out("truth/parts.pfm.partial")));
  check_refused(run_tool(truth_of(fixture().street, json, fixture().out("truth/parts.pfm"), "--samples 32")),
                "--samples");
  check_refused(run_tool(truth_of(fixture().street, json, fixture().out("truth/parts.pfm"), "--samples 80 --seed 1")),
                "another scene, night, seed");
  CHECK(bytes_of(fixture().out("truth/whole.pfm")) != bytes_of(fixture().out("truth/parts.pfm")));
  truth("truth/parts.pfm", "--samples 80 --threads 3");
  for (const char* plane : {".pfm", "_error.pfm", "_direct.pfm", "_emitted.pfm"}) {
    CHECK(bytes_of(fixture().out(std::string("truth/whole") + plane)) ==
          bytes_of(fixture().out(std::string("truth/parts") + plane)));
  }
  CHECK(!fs::exists(fixture().out("truth/parts.pfm.partial")));
}

TEST_CASE("tool truth: a pass that is stopped half-way leaves the sums as they were") {
  auto scene = io::read_scene(fixture().street);
  REQUIRE(scene.ok());
  REQUIRE(io::resize_scene(scene.value(), {32, 18}).ok());
  const auto night_of = npsim::tool::make_truth_night(scene.value(), night_folder() + "/night_000.json");
  REQUIRE_MESSAGE(night_of.ok(), (night_of.ok() ? std::string() : night_of.error().line()));
  const npsim::tool::TruthTracer tracer(night_of.value(), {});
  struct Impatient : npsim::NullObserver {
    mutable int asked = 0;
    [[nodiscard]] bool cancelled() const { return ++asked > 3; }
  } impatient;
  npsim::SerialExecutor serial;
  npsim::NullObserver patient;
  npsim::tool::TruthSums sums;
  CHECK(!tracer.add(16, sums, serial, impatient));
  CHECK(sums.samples == 0);
  REQUIRE(tracer.add(16, sums, serial, patient));
  const npsim::tool::TruthSums before = sums;
  impatient.asked = 0;
  CHECK(!tracer.add(32, sums, serial, impatient));
  CHECK(sums.samples == 16);
  std::size_t changed = 0;
  for (std::size_t p = 0; p < sums.pixels.size(); ++p) {
    changed +=
        sums.pixels[p].light == before.pixels[p].light && sums.pixels[p].squared == before.pixels[p].squared ? 0U : 1U;
  }
  CHECK(changed == 0);
  npsim::reference::PathParams params;
  const std::uint64_t print = npsim::tool::fingerprint(night_of.value(), params);
  params.bounces = 3;
  CHECK(npsim::tool::fingerprint(night_of.value(), params) != print);
}

TEST_CASE("tool truth: what cannot be right is refused, and nothing is written") {
  const std::string json = night_folder() + "/night_000.json";
  const std::string out = fixture().out("refused_truth/a.pfm");
  const auto refused = [&](const std::string& scene, const std::string& drawn, const std::string& mentions) {
    check_refused(run_tool(truth_of(scene, drawn, out, "--samples 16")), mentions, fixture().out("refused_truth"));
  };
  refused(fixture().street, night_folder() + "/absent.json", "absent.json");
  check_refused(run_tool(truth_of(fixture().street, json, fixture().out("refused_truth/a.png"), "")), ".pfm");
  // A night of another street, or spoilt.
  const auto spoilt = [&](const char* name, auto&& change) {
    nlohmann::json changed = json_of(json);
    change(changed["sources"]);
    write_json(fixture().out(name), changed);
    return fixture().out(name);
  };
  const auto first_lit = [](nlohmann::json& sources) -> nlohmann::json& {
    for (nlohmann::json& source : sources) {
      if (source["lit"] == true && source.contains("id")) return source;
    }
    return sources[0];
  };
  refused(fixture().street, spoilt("id.json", [&](auto& s) { s[0]["id"] = 60000; }), "sources[0].id");
  refused(fixture().street, spoilt("lit.json", [&](auto& s) { s[0].erase("lit"); }), "sources[0].lit");
  refused(fixture().street, spoilt("strength.json", [&](auto& s) { first_lit(s)["strength"] = "much"; }), "strength");
  refused(fixture().street, spoilt("profile.json", [&](auto& s) { first_lit(s)["profile"] = "laser"; }), "profile");
  refused(fixture().street, spoilt("xy.json", [&](auto& s) { first_lit(s)["xy"] = {1}; }), "xy");
  // A scene without its truth.
  const std::string blind = fixture().copy("blind");
  nlohmann::json scene = json_of(blind + "/scene.json");
  scene["truth"].erase("ground");
  write_json(blind + "/scene.json", scene);
  refused(blind, json, "truth.ground");
  scene.erase("truth");
  write_json(blind + "/scene.json", scene);
  refused(blind, json, "truth");
  // Outputs are no inputs, and what another run keeps is not taken for one's own.
  const std::string copy = fixture().copy("own_planes");
  const std::string before = bytes_of(copy + "/albedo.pfm");
  check_refused(run_tool(truth_of(copy, json, copy + "/albedo.pfm", "--samples 16")), "albedo");
  CHECK(bytes_of(copy + "/albedo.pfm") == before);
  const std::string other = fixture().out("other.pfm");
  std::ofstream(other + ".partial") << "npsim truth 1 0123456789abcdef 16\n";
  check_refused(run_tool(truth_of(fixture().street, json, other, "--samples 16")), "another scene");
  std::ofstream(other + ".partial") << "a letter\n";
  check_refused(run_tool(truth_of(fixture().street, json, other, "--samples 16")), "other.pfm.partial");
  CHECK(!fs::exists(other));
}

TEST_CASE("tool truth: true lamps hang where the street has them and shine where they are meant to") {
  const auto scene = io::read_scene(fixture().street);
  REQUIRE(scene.ok());
  const auto lamps = npsim::tool::read_true_lamps(scene.value());
  REQUIRE_MESSAGE(lamps.ok(), (lamps.ok() ? std::string() : lamps.error().line()));
  const npsim::GroundPlane& ground = lamps.value().ground;
  REQUIRE(lamps.value().emitters.size() > 10);
  std::uint16_t last = 0;
  int behind = 0;
  for (std::size_t i = 0; i < lamps.value().emitters.size(); ++i) {
    const npsim::Emitter& e = lamps.value().emitters[i];
    CHECK(std::fabs(length(e.axis) - 1) < 1e-3F);
    CHECK(std::fabs(dot(e.axis, e.up)) < 1e-3F);
    if (e.unseen != 0) {  // a row of the street goes on behind the camera
      CHECK(e.mark == 0);
      CHECK(is_street_profile(e.profile));
      CHECK(lamps.value().faces_of[i] != 0);
      CHECK(dot(e.axis, ground.up) < -0.999F);
      CHECK(e.mounting_height_m > 3);
      behind += e.centre_m.z < 0 ? 1 : 0;
      continue;
    }
    if (e.mark == 0) {
      CHECK(i + 2 + lamps.value().unseen >= lamps.value().emitters.size());
      CHECK(std::fabs(height_above_ground(ground, e.centre_m) - 0.65F) < 0.01F);
      continue;
    }
    CHECK(e.mark > last);
    last = e.mark;
    CHECK(e.cls == scene.value().lights[e.mark - 1U].cls);
    CHECK(lamps.value().faces_of[i] != 0);
    const float height = height_above_ground(ground, e.centre_m);
    const float patch = 4 * length(cross(e.half_u_m, e.half_v_m));
    CHECK(patch > 0);
    switch (e.profile) {
      case npsim::EmissionProfile::street_luminaire:
      case npsim::EmissionProfile::hung_luminaire:
      case npsim::EmissionProfile::lantern:
        CHECK((e.profile == npsim::EmissionProfile::lantern) == (height < 5));
        CHECK(std::fabs(height - e.mounting_height_m) < 0.05F);
        CHECK(e.mounting_height_m > 3);
        CHECK(dot(e.axis, ground.up) < -0.999F);
        CHECK(std::fabs(e.up.z) > 0.9F);  // along the street
        break;
      case npsim::EmissionProfile::low_beam:
      case npsim::EmissionProfile::low_beam_left:
      case npsim::EmissionProfile::high_beam:
        CHECK(std::fabs(dot(e.axis, ground.up) + 0.01F) < 2e-3F);
        CHECK(height > 0.3F);
        CHECK(height < 1.3F);
        break;
      case npsim::EmissionProfile::signal: CHECK(std::fabs(dot(e.axis, ground.up)) < 0.02F); break;
      case npsim::EmissionProfile::lambert: CHECK(std::fabs(patch - e.area_m2) < 0.01F * patch); break;
      case npsim::EmissionProfile::measured: FAIL("a generated street measures no luminaire"); break;
    }
  }
  CHECK(behind >= 3);
}

#endif  // NPSIM_TOOL
