// SPDX-License-Identifier: Apache-2.0
// npsim evaluate as a person runs it: what it says of a street whose truth is known, and what it refuses.
#include <doctest/doctest.h>

#ifdef NPSIM_TOOL

#include <fstream>
#include <string>

#include "npsim/io/image.hpp"
#include "npsim/io/pfm.hpp"
#include "tool_fixture.hpp"

using namespace tool_test;

TEST_CASE("lab: evaluate judges every step by the truth, and says the same on any number of threads") {
  const std::string file = fixture().out("evaluation/figures.json");
  const Run run = run_tool("evaluate '" + fixture().street + "' -o '" + file + "' --quiet --threads 1");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  for (const char* word :
       {"as given", "after depth fill", "after cross-bilateral filter", "after normal-guided refinement", "AbsRel",
        "RMSE", "d<1.25", "ratio", "<11.5", "true depth", "uncertain"}) {
    CHECK_MESSAGE(run.output.find(word) != std::string::npos, word);
  }
  const nlohmann::json json = json_of(file);
  const nlohmann::json& steps = json["steps"];
  REQUIRE(steps.size() >= 4);
  CHECK(steps.front()["step"] == "given");
  CHECK(steps[1]["step"] == "depth_fill");
  CHECK(steps.back()["step"] == "normal_guided_refinement");
  const double given = steps.front()["depth"]["abs_rel"].get<double>();
  for (const nlohmann::json& step : steps) {
    const double abs_rel = step["depth"]["abs_rel"].get<double>();
    CHECK(step["depth"]["pixels"] == json["pixels"]["judged"]);
    CHECK(step["normals_of_depth"]["all"]["pixels"] == steps.front()["normals_of_depth"]["all"]["pixels"]);
    CHECK(abs_rel > 0.001);
    CHECK(abs_rel < 0.2);
    CHECK(step["ratio_to_given"]["abs_rel"].get<double>() == doctest::Approx(abs_rel / given));
    CHECK(step["depth"]["delta_1"].get<double>() > 0.8);
    CHECK(step["edges"]["accuracy_px"].get<double>() < 10);
    CHECK(json["labels"]["road"].contains(step["step"].get<std::string>()));
  }
  CHECK(steps.back()["ratio_to_given"]["normal_mean_deg"].get<double>() < 0.8);
  CHECK(json["normals"]["given"]["all"]["below_30"].get<double>() > 0.5);
  CHECK(json["uncertain"]["foreground_edges"]["hit_rate"].get<double>() > 0.5);
  CHECK(!json["labels"].contains("sky"));
  REQUIRE(run_tool("evaluate '" + fixture().street + "' -o '" + file + "3' --quiet --threads 3").status == 0);
  const auto without_times = [](nlohmann::json figures) {
    CHECK(figures["costs"]["refined"]["sheet"]["seconds"].get<double>() > 0);
    figures.erase("costs");
    return figures.dump();
  };
  CHECK(without_times(json) == without_times(json_of(file + "3")));
  for (const nlohmann::json& mesh : json["mesh"]) {
    CAPTURE(mesh["of"]);
    for (const nlohmann::json& stage : mesh["stages"]) CHECK(stage["mesh"]["oriented_manifold"] == true);
    CHECK(mesh["simplified_parts"]["background"]["oriented_manifold"] == true);
    CHECK(mesh["simplified_parts"]["objects"]["watertight"] == true);
    for (const char* layer : {"background", "objects"}) {
      CHECK(mesh["layers"][layer]["whole"] == true);
      const nlohmann::json& errors = mesh["simplification"][layer];
      CHECK(errors["faces_after"] < errors["faces_before"]);
      CHECK(errors["max_relative_depth"].get<double>() <= 0.005);
      CHECK(errors["rms_relative_depth"].get<double>() <= errors["max_relative_depth"].get<double>());
      CHECK(errors["max_px"].get<double>() <= 0.25);
      CHECK(errors["rms_px"].get<double>() <= errors["max_px"].get<double>());
    }
  }
  for (const char* step : {"sheet", "prune", "complete_background", "complete_objects", "index", "simplify_background",
                           "simplify_objects"}) {
    CAPTURE(step);
    CHECK(json["costs"]["true_depth"][step]["output_bytes"].get<double>() > 0);
  }
  CHECK(json["night_of_simplified_mesh"].is_null());
  for (const auto& entry : fs::directory_iterator(fs::path(file).parent_path())) {
    CHECK(entry.path().extension() != ".partial");
  }
}

TEST_CASE("lab: evaluate renders a night of the simplified mesh when asked to") {
  const std::string file = fixture().out("night_change.json");
  const Run run = run_tool("evaluate '" + fixture().street + "' --simplified --size 96x54 --quiet -o '" + file + "'");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  const nlohmann::json night = json_of(file)["night_of_simplified_mesh"];
  CHECK(night["faces_after"] < night["faces_before"]);
  CHECK(night["mean_colour"].get<double>() < 0.02);
  CHECK(night["rms_codes_of_255"].get<double>() < 20);
  CHECK(run.output.find("mean colour changes by") != std::string::npos);
}

TEST_CASE("lab: evaluate finds no error in the truth itself") {
  const std::string scene = fixture().copy("exact");
  fs::copy_file(scene + "/truth/depth.pfm", scene + "/depth.pfm", fs::copy_options::overwrite_existing);
  fs::copy_file(scene + "/truth/normals.pfm", scene + "/normals.pfm", fs::copy_options::overwrite_existing);
  const std::string file = fixture().out("exact.json");
  const Run run = run_tool("evaluate '" + scene + "' -o '" + file + "' --quiet");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  const nlohmann::json json = json_of(file);
  const nlohmann::json& given = json["steps"][0];
  CHECK(given["depth"]["abs_rel"] == 0);
  CHECK(given["depth"]["rmse_m"] == 0);
  CHECK(given["depth"]["delta_1"] == 1);
  CHECK(given["depth_near_edges"]["abs_rel"] == 0);
  CHECK(given["edges"]["accuracy_px"] == 0);
  CHECK(given["edges"]["completeness_px"] == 0);
  CHECK(given["normals_of_depth"] == json["normals"]["of_true_depth"]);
  CHECK(json["normals"]["given"]["all"]["rms_deg"] == doctest::Approx(0).epsilon(1e-3));
  CHECK(given["normals_of_depth"]["smooth"]["rms_deg"].get<double>() < 5);
  CHECK(json["steps"].back()["ratio_to_given"]["abs_rel"].is_null());
  CHECK(run.output.find(" -") != std::string::npos);
}

TEST_CASE("lab: evaluate takes a size and a preset, and does without true normals and without a file") {
  const Run thesis = run_tool("evaluate '" + fixture().street + "' --size 96x54 --preset thesis --quiet");
  CHECK_MESSAGE(thesis.status == 0, thesis.output);
  CHECK(thesis.output.find("96 x 54, preset thesis") != std::string::npos);
  const std::string scene = fixture().copy("no_true_normals");
  nlohmann::json json = json_of(scene + "/scene.json");
  json["truth"].erase("normals");
  std::ofstream(scene + "/scene.json") << json;
  const std::string file = fixture().out("no_true_normals.json");
  const Run run = run_tool("evaluate '" + scene + "' -o '" + file + "' --size 96x54 --quiet");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  CHECK(json_of(file)["steps"].back()["normals_of_depth"]["all"].is_null());
  CHECK(json_of(file)["steps"].back()["depth"]["abs_rel"].is_number());
}

TEST_CASE("lab: evaluate without a usable truth ends in one line that names what is missing") {
  const std::string none = fixture().out("no_evaluation");
  const auto evaluate = [&](const std::string& scene, const std::string& more = "") {
    return run_tool("evaluate '" + scene + "' -o '" + none + "/figures.json' --quiet " + more);
  };
  const std::string without = fixture().copy("no_truth");
  const nlohmann::json json = json_of(without + "/scene.json");
  nlohmann::json changed = json;
  changed.erase("truth");
  std::ofstream(without + "/scene.json") << changed;
  check_refused(evaluate(without), "scene.json: truth.depth", none);
  changed = json;
  changed["truth"].erase("depth");
  std::ofstream(without + "/scene.json") << changed;
  check_refused(evaluate(without), "scene.json: truth.depth", none);
  changed = json;
  changed["truth"]["depth"] = "truth/none.pfm";
  std::ofstream(without + "/scene.json") << changed;
  check_refused(evaluate(without), "none.pfm", none);
  changed["truth"]["depth"] = "truth/small.pfm";
  std::ofstream(without + "/scene.json") << changed;
  REQUIRE(npsim::io::write_pfm(without + "/truth/small.pfm", npsim::io::Image<float>({3, 2}, 5.0F).view()).ok());
  check_refused(evaluate(without), "small.pfm", none);
  check_refused(evaluate(fixture().out("absent")), "absent", none);
  check_refused(evaluate(fixture().street, "--size 10"), "--size", none);
  check_refused(evaluate(fixture().street, "--preset best"), "preset", none);
  std::ofstream(fixture().out("a_file")) << "x";
  check_refused(
      run_tool("evaluate '" + fixture().street + "' --quiet -o '" + fixture().out("a_file") + "/figures.json'"),
      "a_file");
}

#endif  // NPSIM_TOOL
