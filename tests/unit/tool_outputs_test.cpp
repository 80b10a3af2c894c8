// SPDX-License-Identifier: Apache-2.0
// No command writes over a file that its scene is made of, by whatever name the file or its folder goes.
#include <doctest/doctest.h>

#ifdef NPSIM_TOOL

#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "npsim/io/obj.hpp"
#include "npsim/io/scene.hpp"
#include "tool_fixture.hpp"

using namespace tool_test;

namespace {

// Every regular file below a folder, with what is in it.
std::map<std::string, std::string> contents_of(const fs::path& folder) {
  std::map<std::string, std::string> contents;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) contents[entry.path().string()] = bytes_of(entry.path());
  }
  return contents;
}

std::string in_quotes(const std::string& text) { return "'" + text + "'"; }

// A scene that has a file for everything a scene can name, its camera and the textures of its true mesh included.
std::string full_scene(const std::string& name) {
  const std::string scene = fixture().copy(name);
  nlohmann::json json = json_of(scene + "/scene.json");
  const double fx = json["camera"]["fx"];
  const nlohmann::json intrinsic = {{"fx", fx}, {"fy", fx}, {"u0", kStreet.width / 2}, {"v0", kStreet.height / 2}};
  write_json(scene + "/camera.json", {{"intrinsic", intrinsic}});
  json["camera"] = {{"cityscapes", "camera.json"}};
  write_json(scene + "/scene.json", json);
  std::ofstream(scene + "/truth/street.mtl", std::ios::app) << "map_Kd -clamp on brick wall.png\n";
  std::ofstream(scene + "/truth/brick wall.png") << "x";
  std::ofstream(scene + "/truth/wall.png") << "x";
  write_json(scene + "/measured.json", {{{"class", "clock"}, {"strength", 9}, {"xy", {0.4, 0.4}}}});
  return scene;
}

}  // namespace

TEST_CASE("tool: a scene knows all files that it is made of") {
  const std::string folder = full_scene("all_files");
  const auto scene = npsim::io::read_scene(folder);
  REQUIRE(scene.ok());
  CHECK(scene.value().generator == "npsim street");
  std::set<fs::path> known;
  for (const npsim::io::SceneFile& file : scene.value().files) known.insert(fs::path(file.path).lexically_normal());
  for (const std::string& file : npsim::io::files_beside_obj(folder + "/truth/street.obj")) {
    known.insert(fs::path(file).lexically_normal());
  }
  for (const auto& [path, bytes] : contents_of(folder)) {
    if (path == folder + "/measured.json") continue;
    CHECK_MESSAGE(known.count(fs::path(path).lexically_normal()) == 1, path);
  }
}

TEST_CASE("tool: a night into the scene's own folder is refused, by any name of the folder or the file") {
  const std::string scene = full_scene("own_folder");
  const std::string beside = fixture().out("own_folder_links");
  fs::create_directories(beside + "/soft");
  fs::create_directories(beside + "/hard");
  fs::create_directories(scene + "/nights");
  fs::create_directory_symlink(scene, beside + "/scene");
  fs::create_symlink(scene + "/depth.pfm", beside + "/soft/depth.pfm");
  fs::create_hard_link(scene + "/depth.pfm", beside + "/hard/depth.pfm");
  const auto before = contents_of(scene);
  const std::string night = "night " + in_quotes(scene) + " --quiet -o ";
  for (const std::string& out :
       {scene, scene + "/", scene + "/.", scene + "//", scene + "/truth/..", scene + "/none/..", beside + "/scene",
        beside + "/../own_folder", beside + "/soft", beside + "/hard"}) {
    CAPTURE(out);
    check_refused(run_tool(night + in_quotes(out)), "depth.pfm: would be written over");
  }
  check_refused(run_tool("night " + in_quotes(beside + "/scene") + " --quiet -o " + in_quotes(scene)), "depth.pfm");
  check_refused(run_tool("night " + in_quotes(scene + "/scene.json") + " --quiet -o " + in_quotes(scene)), "depth.pfm");
  const fs::path here = fs::current_path();
  fs::current_path(scene);
  check_refused(run_tool("night . --quiet -o ."), "depth.pfm");
  check_refused(run_tool("night scene.json --quiet -o ../own_folder"), "depth.pfm");
  check_refused(run_tool("view scene.json --quiet -o ./image.png"), "image.png");
  fs::current_path(here);
  CHECK(contents_of(scene) == before);
  // A folder in the scene's is another folder.
  const Run inside = run_tool(night + in_quotes(scene + "/nights") + " --size 64x36");
  CHECK_MESSAGE(inside.status == 0, inside.output);
}

TEST_CASE("tool: whatever a night writes it refuses to write over") {
  for (const char* texture : {"photograph", "albedo"}) {
    const std::string out = fixture().out(std::string("written_") + texture);
    const std::string options =
        " --quiet --size 64x36 --variants 2 --texture " + std::string(texture) + " -o " + in_quotes(out);
    REQUIRE(run_tool("night " + in_quotes(fixture().street) + options).status == 0);
    const auto written = contents_of(out);
    REQUIRE(written.size() == 16 + 3 * 2);
    const std::string scene = fixture().copy(std::string("names_") + texture);
    nlohmann::json json = json_of(scene + "/scene.json");
    for (const auto& [path, bytes] : written) {
      CAPTURE(path);
      json["truth"]["emitters"] = path;
      write_json(scene + "/scene.json", json);
      check_refused(run_tool("night " + in_quotes(scene) + options), path);
    }
    CHECK(contents_of(out) == written);
  }
}

TEST_CASE("tool: every file of a scene is safe from every command that writes") {
  const std::string scene = full_scene("safe");
  const std::string night = fixture().out("safe_night");
  fs::create_directories(night);
  const auto before = contents_of(scene);
  REQUIRE(before.size() == 21);
  for (const auto& [path, bytes] : before) {
    CAPTURE(path);
    const bool lights = path == scene + "/measured.json";
    if (!lights) {
      check_refused(run_tool("view " + in_quotes(scene) + " --quiet -o " + in_quotes(path)), path);
      check_refused(run_tool("evaluate " + in_quotes(scene) + " --quiet -o " + in_quotes(path)), path);
    }
    fs::create_hard_link(path, night + "/report.json");
    check_refused(run_tool("night " + in_quotes(scene) + " --quiet --lights " + in_quotes(scene + "/measured.json") +
                           " -o " + in_quotes(night)),
                  "report.json");
    fs::remove(night + "/report.json");
  }
  const std::string mesh = scene + "/truth/street.obj";
  for (const char* name : {"street.obj", "street.mtl", "wall.png", "brick wall.png"}) {
    CAPTURE(name);
    check_refused(run_tool("view " + in_quotes(mesh) + " --quiet -o " + in_quotes(scene + "/truth/" + name)), name);
  }
  CHECK(contents_of(scene) == before);
  CHECK(!has_files(night));
}

TEST_CASE("tool: what an earlier night left is removed, but no file of the scene") {
  const std::string scene = fixture().copy("numbered");
  fs::rename(scene + "/image.png", scene + "/night_002.png");
  nlohmann::json json = json_of(scene + "/scene.json");
  json["image"] = "night_002.png";
  json["depth"]["file"] = "given.pfm";
  fs::rename(scene + "/depth.pfm", scene + "/given.pfm");
  json["normals"]["file"] = "given_normals.pfm";
  fs::rename(scene + "/normals.pfm", scene + "/given_normals.pfm");
  write_json(scene + "/scene.json", json);
  const std::string image = bytes_of(scene + "/night_002.png");
  for (const char* name : {"/night_001.json", "/night_002.json", "/night_003.png"}) std::ofstream(scene + name) << "x";
  const std::string night = "night " + in_quotes(scene) + " --quiet --size 64x36 -o " + in_quotes(scene);
  check_refused(run_tool(night + " --variants 3"), "night_002.png");
  const Run run = run_tool(night + " --variants 1");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  CHECK(fs::exists(scene + "/night_000.png"));
  for (const char* name : {"/night_001.json", "/night_002.json", "/night_003.png"}) CHECK(!fs::exists(scene + name));
  CHECK(bytes_of(scene + "/night_002.png") == image);
}

TEST_CASE("tool: a street replaces a generated street, and neither another scene nor single files") {
  const std::string scene = fixture().copy("again_street");
  const auto street = [](const std::string& folder) {
    return run_tool("street " + in_quotes(folder) + " --size 32x18 --quiet");
  };
  CHECK(street(scene).status == 0);
  nlohmann::json json = json_of(scene + "/scene.json");
  for (const nlohmann::json& generator : {nlohmann::json(), nlohmann::json("camera"), nlohmann::json(7)}) {
    json["generator"] = generator;
    if (generator.is_null()) json.erase("generator");
    write_json(scene + "/scene.json", json);
    const auto before = contents_of(scene);
    check_refused(street(scene), "scene.json: generator");
    check_refused(street(scene + "/../again_street/"), "scene.json: generator");
    CHECK(contents_of(scene) == before);
  }
  std::ofstream(scene + "/scene.json") << "{";
  check_refused(street(scene), "scene.json: generator");
  fs::remove(scene + "/scene.json");
  check_refused(street(scene), "would be written over");
  const std::string photographs = fixture().out("photographs");
  fs::create_directories(photographs);
  std::ofstream(photographs + "/notes.txt") << "x";
  CHECK(street(photographs).status == 0);  // nothing of the street's is there
  const std::string truth = fixture().out("only_truth");
  fs::create_directories(truth + "/truth");
  std::ofstream(truth + "/truth/depth.pfm") << "x";
  check_refused(street(truth), "truth/depth.pfm: would be written over");
  CHECK(bytes_of(truth + "/truth/depth.pfm") == "x");
}

#endif  // NPSIM_TOOL
