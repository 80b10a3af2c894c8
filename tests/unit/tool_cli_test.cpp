// SPDX-License-Identifier: Apache-2.0
// The npsim program as a person runs it: what it writes, what it refuses, and that threads do not change a byte.
#include <doctest/doctest.h>

#ifdef NPSIM_TOOL

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "npsim/io/image.hpp"
#include "npsim/io/pfm.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "tool_fixture.hpp"

using namespace tool_test;

TEST_CASE("tool: one run writes everything that is promised, whole and under its final name") {
  const std::string out = fixture().out("night");
  const Run run = run_tool("night '" + fixture().street + "' -o '" + out + "' --variants 2 --quiet");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  for (const char* name : {"depth.pfm", "depth.png", "uncertain.png", "normals.png", "mesh.glb", "mesh.obj", "mesh.mtl",
                           "mesh.ply", "background.glb", "background.obj", "background.mtl", "background.ply", "day.png",
                           "background.png", "report.json",
                           "overview.png", "night_000.png", "night_000.pfm", "night_000.json", "night_001.png",
                           "night_001.pfm", "night_001.json"}) {
    CHECK_MESSAGE(fs::exists(fs::path(out) / name), name);
    CHECK_MESSAGE(fs::file_size(fs::path(out) / name) > 50, name);
  }
  for (const auto& entry : fs::directory_iterator(out)) CHECK(entry.path().extension() != ".partial");
  const nlohmann::json report = json_of(fs::path(out) / "report.json");
  CHECK(report["stages"].size() >= 10);
  CHECK(report["peak_memory_bytes"].get<double>() > 1e6);
  CHECK(report["mesh"]["triangles"].get<int>() > 10000);
  const nlohmann::json night = json_of(fs::path(out) / "night_000.json");
  CHECK(night["exposure"]["iso"].get<double>() >= 100);
  int lit = 0;
  for (const auto& source : night["sources"]) {
    if (!source["lit"].get<bool>()) continue;
    ++lit;
    CHECK(source["xy"].size() == 2);
    CHECK(source["strength"].get<double>() > 0);
  }
  CHECK(lit > 3);
}

TEST_CASE("tool: the same seed gives the same bytes for 1, 2 and 5 threads") {
  std::vector<std::string> reference;
  for (const int threads : {1, 2, 5}) {
    const std::string out = fixture().out("threads" + std::to_string(threads));
    const Run run = run_tool("night '" + fixture().street + "' -o '" + out + "' --variants 2 --quiet --threads " +
                          std::to_string(threads));
    REQUIRE_MESSAGE(run.status == 0, run.output);
    std::vector<std::string> all;
    for (const char* name : {"depth.pfm", "uncertain.png", "normals.png", "mesh.glb", "mesh.obj", "mesh.ply", "night_000.png",
                             "night_000.pfm", "night_000.json", "night_001.png", "night_001.pfm", "overview.png"}) {
      all.push_back(bytes_of(fs::path(out) / name));
    }
    if (reference.empty()) reference = all;
    for (std::size_t i = 0; i < all.size(); ++i) CHECK_MESSAGE(all[i] == reference[i], i);
  }
}

TEST_CASE("tool: different seeds and different variants light different windows") {
  const auto lit_windows = [](const std::string& file) {
    std::string lit;
    const nlohmann::json night = json_of(file);
    for (const auto& source : night["sources"]) {
      if (source.value("class", "") == "window_building") lit += source["lit"].get<bool>() ? '1' : '0';
    }
    return lit;
  };
  const auto render = [&](int seed) {
    const std::string out = fixture().out("seed" + std::to_string(seed));
    const Run run = run_tool("night '" + fixture().street + "' -o '" + out + "' --variants 2 --quiet --seed " +
                          std::to_string(seed));
    REQUIRE_MESSAGE(run.status == 0, run.output);
    return out;
  };
  const std::string a = render(1);
  const std::string b = render(2);
  const std::string first = lit_windows(a + "/night_000.json");
  REQUIRE(first.size() >= 8);
  CHECK(first != lit_windows(b + "/night_000.json"));
  CHECK(first != lit_windows(a + "/night_001.json"));
}

TEST_CASE("tool: the thesis preset runs and gives another picture") {
  const std::string out = fixture().out("thesis");
  const Run run = run_tool("night '" + fixture().street + "' -o '" + out + "' --preset thesis --quiet");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  const std::string plain = fixture().out("plain");
  REQUIRE(run_tool("night '" + fixture().street + "' -o '" + plain + "' --quiet").status == 0);
  CHECK(bytes_of(out + "/night_000.png") != bytes_of(plain + "/night_000.png"));
  CHECK(bytes_of(out + "/depth.pfm") != bytes_of(plain + "/depth.pfm"));
}

TEST_CASE("tool: an error that two rays reach costs no more than two, and the report says what was traced") {
  const std::string out = fixture().out("loose_error");
  const Run run = run_tool("night '" + fixture().street + "' -o '" + out + "' --error 0.9 --quiet");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  const nlohmann::json report = json_of(fs::path(out) / "report.json");
  CHECK(report["settings"]["rays"] == 2);  // where the search begins
  CHECK(report["light"]["rays"] == 2);
  CHECK(report["light"]["error"].get<double>() < 0.9);
  check_refused(run_tool("night '" + fixture().street + "' -o '" + out + "' --error 0.9 --rays 4 --quiet"), "--rays");
}

TEST_CASE("tool: a scene of nothing but image, depth and camera runs on its own headlamps") {
  const std::string scene = fixture().copy("bare");
  nlohmann::json json = json_of(scene + "/scene.json");
  nlohmann::json bare;
  for (const char* key : {"npsim_scene", "name", "image", "depth", "camera"}) bare[key] = json[key];
  std::ofstream(scene + "/scene.json") << bare;
  const std::string out = fixture().out("bare_night");
  const Run run = run_tool("night '" + scene + "' -o '" + out + "' --quiet");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  CHECK(json_of(out + "/night_000.json")["sources"].size() == 2);
}

TEST_CASE("tool: inspect says what is there and what is missing") {
  const Run run = run_tool("inspect '" + fixture().street + "'");
  CHECK(run.status == 0);
  for (const char* word : {"160 x 90", "depth", "missing", "labels", "road", "lights", "window_building"}) {
    CHECK_MESSAGE(run.output.find(word) != std::string::npos, word);
  }
}

TEST_CASE("tool: view draws the mesh from any side, and an OBJ file, and says what the mesh consists of") {
  const auto view = [&](const std::string& scene, const std::string& name, const std::string& more) {
    const Run run = run_tool("view '" + scene + "' -o '" + fixture().out(name) + "' --quiet " + more);
    REQUIRE_MESSAGE(run.status == 0, run.output);
    return run.output;
  };
  const std::string said = view(fixture().street, "front.png", "--threads 1");
  for (const char* word : {"background", "objects", "faces", "boundary loops", "manifold", "front.png"}) {
    CHECK_MESSAGE(said.find(word) != std::string::npos, word);
  }
  CHECK(said.find("not a manifold") == std::string::npos);
  view(fixture().street, "front3.png", "--threads 3");
  CHECK(bytes_of(fixture().out("front.png")) == bytes_of(fixture().out("front3.png")));
  view(fixture().street, "side.png", "--turn 45 --closer 3 --picture 200x100");
  const auto side = npsim::io::read_rgb8(fixture().out("side.png"));
  REQUIRE(side.ok());
  CHECK(side.value().shape() == npsim::Shape{200, 100});
  CHECK(view(fixture().street, "raw.png", "--mesh raw").find("raw") != std::string::npos);
  CHECK(bytes_of(fixture().out("raw.png")) != bytes_of(fixture().out("front.png")));
  view(fixture().street, "pruned.png", "--mesh pruned --preset thesis --size 96x54");
  view(fixture().street, "background.png", "--mesh background --wire 0.5 --plain");
  view(fixture().street, "objects.png", "--mesh objects --climb 30");
  view(fixture().street + "/truth/street.obj", "truth.png", "--turn 30 --climb 20 --y-down");
  CHECK(fs::file_size(fixture().out("truth.png")) > 1000);
}

TEST_CASE("tool: view refuses what it cannot draw in one line") {
  const std::string none = fixture().out("no_view");
  const auto view = [&](const std::string& scene, const std::string& more) {
    return run_tool("view '" + scene + "' -o '" + none + "/view.png' --quiet " + more);
  };
  check_refused(view(fixture().out("absent"), ""), "absent", none);
  for (const char* option : {"--turn", "--closer", "--climb", "--pivot"}) {
    CAPTURE(option);
    check_refused(view(fixture().street, std::string(option) + " nan"), option, none);
  }
  check_refused(view(fixture().out("absent.obj"), ""), "absent.obj", none);
  check_refused(view(fixture().street, "--mesh best"), "mesh", none);
  check_refused(view(fixture().street, "--picture 10"), "--picture", none);
  check_refused(view(fixture().street, "--size 10"), "--size", none);
  check_refused(view(fixture().street, "--turn north"), "turn", none);
  check_refused(run_tool("view '" + fixture().street + "'"), "--output");
  std::ofstream(fixture().out("points.obj")) << "v 0 0 1\nv 1 0 1\nv 0 1 1\n";
  check_refused(view(fixture().out("points.obj"), ""), "points.obj: has no faces", none);
  std::ofstream(fixture().out("a_file")) << "x";
  check_refused(run_tool("view '" + fixture().street + "' --quiet -o '" + fixture().out("a_file") + "/view.png'"),
                "a_file");
  for (const char* name : {"mesh.glb", "mesh.PLY"}) {
    std::ofstream(fixture().out(name)) << "x";
    check_refused(view(fixture().out(name), ""), "or an .obj", none);
    check_refused(run_tool("inspect '" + fixture().out(name) + "'"), "is no scene, expected a folder");
    check_refused(run_tool("evaluate --quiet '" + fixture().out(name) + "'"), "is no scene, expected a folder");
  }
}

TEST_CASE("tool: view makes the folder that it writes to") {
  const Run run = run_tool("view '" + fixture().street + "' --size 96x54 --quiet -o '" + fixture().out("new/folder/v.png") + "'");
  CHECK_MESSAGE(run.status == 0, run.output);
  CHECK(fs::file_size(fixture().out("new/folder/v.png")) > 100);
}

TEST_CASE("tool: bad input ends in one line that names the file, status 2, and writes nothing") {
  const std::string none = fixture().out("none");
  const auto night = [&](const std::string& scene, const std::string& more = "") {
    return run_tool("night '" + scene + "' -o '" + none + "' --quiet " + more);
  };
  check_refused(night(fixture().out("absent")), "absent", none);
  check_refused(night(fixture().street, "--size 10"), "--size", none);
  check_refused(night(fixture().street, "--size 0x10"), "--size", none);
  check_refused(night(fixture().street, "--size 99999x99999"), "--size", none);
  check_refused(night(fixture().street, "--variants 0"), "variants", none);
  check_refused(night(fixture().street, "--preset best"), "preset", none);
  check_refused(night(fixture().street, "--mesh-error 2"), "mesh-error", none);
  check_refused(night(fixture().street, "--texture marble"), "texture", none);
  for (const char* seed : {"-1", "99999999999999999999", "0x10", "1.5", "x"}) {
    check_refused(night(fixture().street, std::string("--seed ") + seed), "seed", none);
  }
  check_refused(night(fixture().street, "--lights '" + fixture().out("no.json") + "'"), "no.json", none);
  check_refused(run_tool("night '" + fixture().street + "'"), "--output");
  check_refused(run_tool("nights"), "npsim");
  check_refused(run_tool("inspect '" + fixture().out("absent") + "'"), "absent");
  check_refused(run_tool("street '" + none + "' --size 3"), "--size", none);

  const std::string truncated = fixture().copy("truncated");
  fs::resize_file(truncated + "/image.png", fs::file_size(truncated + "/image.png") / 2);
  check_refused(night(truncated), "image.png", none);

  const std::string unknown_key = fixture().copy("unknown_key");
  nlohmann::json json = json_of(unknown_key + "/scene.json");
  json["lable"] = "x.png";
  std::ofstream(unknown_key + "/scene.json") << json;
  check_refused(night(unknown_key), "lable", none);

  const std::string no_camera = fixture().copy("no_camera");
  json = json_of(no_camera + "/scene.json");
  json.erase("camera");
  std::ofstream(no_camera + "/scene.json") << json;
  check_refused(night(no_camera), "camera", none);

  const std::string unknown_ids = fixture().copy("unknown_ids");
  REQUIRE(npsim::io::write_png(unknown_ids + "/labels.png", npsim::io::Image<std::uint8_t>(kStreet, 200).view()).ok());
  check_refused(night(unknown_ids), "labels.png: labels.encoding", none);

  const std::string not_json = fixture().copy("not_json");
  std::ofstream(not_json + "/scene.json") << "{\"image\": ";
  check_refused(night(not_json), "scene.json", none);
}

TEST_CASE("tool: depth that is all missing, or all sky, names the scene file and the field") {
  const std::string scene = fixture().copy("all_sky");
  const npsim::io::Image<std::uint8_t> sky(kStreet, npsim::label::sky);
  REQUIRE(npsim::io::write_png(scene + "/labels.png", sky.view()).ok());
  const Run run = run_tool("night '" + scene + "' -o '" + fixture().out("all_sky_night") + "' --quiet");
  check_refused(run, "scene.json: depth: ", fixture().out("all_sky_night"));
}

TEST_CASE("tool: pictures of nothing but one object, and of one row, run to the end") {
  const std::string scene = fixture().copy("one_object");
  const npsim::io::Image<std::uint8_t> car(kStreet, npsim::label::car);
  REQUIRE(npsim::io::write_png(scene + "/labels.png", car.view()).ok());
  CHECK(run_tool("night '" + scene + "' -o '" + fixture().out("one_object_night") + "' --quiet").status == 0);
  const Run row = run_tool("night '" + fixture().street + "' -o '" + fixture().out("row") + "' --quiet --size 64x1");
  CHECK_MESSAGE(row.status == 0, row.output);
}

TEST_CASE("tool: an interrupt ends a run with status 130 and leaves no partial file") {
  for (const char* command : {"street '%s' --size 1920x1080 --quiet", "night '%s' -o '%s' --size 960x540 --variants 9 --quiet"}) {
    std::array<char, 1024> line{};
    const std::string out = fixture().out("interrupted");
    const bool night = command[0] == 'n';
    std::snprintf(line.data(), line.size(), command, night ? fixture().street.c_str() : out.c_str(), out.c_str());
    const std::string shell =
        "timeout --preserve-status -s INT 1 '" + std::string(NPSIM_TOOL) + "' " + line.data() + " 2>/dev/null";
    const int status = std::system(shell.c_str());
    CHECK(WEXITSTATUS(status) == 130);
    if (fs::exists(out)) {
      for (const auto& entry : fs::recursive_directory_iterator(out)) CHECK(entry.path().extension() != ".partial");
      CHECK(!fs::exists(fs::path(out) / "report.json"));
    }
  }
}

TEST_CASE("tool: fewer variants into the same folder leave no night of the earlier run") {
  const std::string out = fixture().out("again");
  REQUIRE(run_tool("night '" + fixture().street + "' -o '" + out + "' --quiet --variants 3").status == 0);
  REQUIRE(run_tool("night '" + fixture().street + "' -o '" + out + "' --quiet --variants 1").status == 0);
  CHECK(fs::exists(out + "/night_000.png"));
  CHECK(!fs::exists(out + "/night_001.png"));
  CHECK(!fs::exists(out + "/night_002.json"));
}

TEST_CASE("tool: an output folder that cannot be made is refused before any work") {
  std::ofstream(fixture().out("file")) << "x";
  check_refused(run_tool("night '" + fixture().street + "' -o '" + fixture().out("file") + "/inside' --quiet"), "inside");
}

TEST_CASE("tool: help and version end with status 0") {
  for (const char* arguments : {"--help", "--version", "night --help", "street --help", "inspect --help"}) {
    CHECK_MESSAGE(run_tool(arguments).status == 0, arguments);
  }
}

TEST_CASE("tool: commands that npsim-lab has are in its help, and without npsim-lab one line says what is missing") {
  const std::string help = run_tool("--help").output;
  for (const char* command : {"evaluate", "judge", "truth", "stats", "greycard", "calibrate-noise"}) {
    CHECK_MESSAGE(help.find("\n  " + std::string(command)) != std::string::npos, command);
    const Run own = run_tool(std::string(command) + " --help");
    CHECK_MESSAGE(own.status == 0, own.output);
    CHECK_MESSAGE(own.output.find("Positionals:") != std::string::npos, own.output);
    CHECK(run_tool("--help " + std::string(command)).output == own.output);
  }
  const fs::path alone = fixture().out("alone");
  fs::create_directories(alone);
  fs::copy_file(NPSIM_TOOL, alone / "npsim");
  const Run run = run_program((alone / "npsim").string(), "judge '" + fixture().out("judged") + "'");
  CHECK(run.status == 1);
  CHECK(line_count(run.output) == 1);
  CHECK_MESSAGE(run.output.find((alone / "npsim-lab").string() + ": No such file") != std::string::npos, run.output);
  CHECK(!fs::exists(fixture().out("judged")));
}

#endif  // NPSIM_TOOL
