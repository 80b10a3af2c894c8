// SPDX-License-Identifier: Apache-2.0
// Scene folders: everything read, nothing more than required, every key checked, and resizing.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "io_fixture.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/io/scene_resize.hpp"

namespace {

using namespace npsim;
using io_test::check_error;
using io_test::put;
using io_test::replaced;
using io_test::require_ok;
using io_test::TemporaryFolder;

constexpr Shape kShape{32, 24};
const Intrinsics kCamera{30, 30, 16, 12};

// A floor in front of a wall: planes with three different normals, so that a convention can be told from depth.
float sample_depth(int x, int y) {
  if (y >= 14) return 1.5F * kCamera.fy / (static_cast<float>(y) + 0.5F - kCamera.cy);
  const float slope = (static_cast<float>(x) + 0.5F - kCamera.cx) / kCamera.fx;
  return 6.0F / (1.0F - 0.5F * slope);
}
Vec3f sample_normal(int, int y) { return y >= 14 ? Vec3f{0, -1, 0} : normalized(Vec3f{0.5F, 0, -1}); }

// One source of 2 x 2 pixels in a group, and one of a single pixel.
const char* const kLights =
    R"({"dataset": {"task_attributes": {"categories": [{"id": 1, "name": "traffic_light_group"},
    {"id": 2, "name": "inferred object"}, {"id": 3, "name": "street_light_LT"}]}, "samples": [{"labels":
    {"ground-truth": {"attributes": {"annotations": [{"id": 10, "category_id": 1}, {"id": 11, "category_id": 2,
    "attributes": {"group": 10, "state": "green"}}, {"id": 12, "category_id": 3}]}}}}]}})";

const char* const kMinimal =
    R"({"image": "image.png", "depth": {"file": "depth.pfm", "encoding": "metres"},
    "camera": {"fx": 30, "fy": 30, "cx": 16, "cy": 12}})";

const char* const kWhole = R"({"npsim_scene": 1, "name": "corner", "image": "image.png",
  "depth": {"file": "depth.pfm", "encoding": "metres"},
  "camera": {"fx": 30, "fy": 30, "cx": 16, "cy": 12},
  "labels": {"file": "objects.png", "encoding": "cityscapes_instance_ids"},
  "own_car": {"file": "bonnet.png"},
  "normals": {"file": "normals.pfm", "convention": "auto"},
  "albedo": {"file": "albedo.pfm"}, "roughness": {"file": "roughness.pfm"},
  "lights": {"format": "segments_ai", "json": "lights.json", "bitmap": "lights.png"},
  "reflectors": {"format": "ids", "file": "plates.png"},
  "truth": {"depth": "depth.pfm", "normals": "true_normals.pfm", "mesh": "absent.obj"}})";

void put_files(const TemporaryFolder& folder) {
  io::Image<Rgb8> image(kShape);
  io::Image<float> depth(kShape);
  io::Image<Vec3f> normals(kShape);  // x right, y up, z towards the viewer
  io::Image<Vec3f> true_normals(kShape);
  io::Image<Vec3f> albedo(kShape, Vec3f{0.2F, 0.4F, 0.6F});
  io::Image<float> roughness(kShape, 0.7F);
  io::Image<std::uint16_t> objects(kShape, 7);
  io::Image<std::uint16_t> bonnet(kShape);
  io::Image<io::Rgba8> lights(kShape);
  io::Image<std::uint8_t> plates(kShape);
  plates(9, 17) = 1;
  plates(2, 12) = 2;
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      image(x, y) = {static_cast<std::uint8_t>(x * 8), static_cast<std::uint8_t>(y * 10), 77};
      depth(x, y) = sample_depth(x, y);
      const Vec3f n = sample_normal(x, y);
      true_normals(x, y) = n;
      normals(x, y) = {n.x, -n.y, -n.z};
      if (x < 8) objects(x, y) = 26003;
      if (y == kShape.height - 1) bonnet(x, y) = 255;
      if (x >= 20 && x < 26 && y < 6) lights(x, y) = {10, 0, 0, 255};
      if (x >= 21 && x < 23 && y >= 1 && y < 3) lights(x, y) = {11, 0, 0, 255};
    }
  }
  lights(3, 3) = {12, 0, 0, 255};
  require_ok(io::write_png(folder / "image.png", image.view()));
  require_ok(io::write_pfm(folder / "depth.pfm", depth.view()));
  require_ok(io::write_pfm(folder / "normals.pfm", normals.view()));
  require_ok(io::write_pfm(folder / "true_normals.pfm", true_normals.view()));
  require_ok(io::write_pfm(folder / "albedo.pfm", albedo.view()));
  require_ok(io::write_pfm(folder / "roughness.pfm", roughness.view()));
  require_ok(io::write_png16(folder / "objects.png", objects.view()));
  require_ok(io::write_png16(folder / "bonnet.png", bonnet.view()));
  require_ok(io::write_png_rgba(folder / "lights.png", lights.view()));
  require_ok(io::write_png(folder / "plates.png", plates.view()));
  put(folder / "lights.json", kLights);
}

io::Expected<io::Scene> read_scene_text(const TemporaryFolder& folder, const std::string& json) {
  put(folder / "scene.json", json);
  return io::read_scene(folder.path());
}

bool any_note(const io::Scene& scene, const std::string& words) {
  for (const std::string& note : scene.notes) {
    if (note.find(words) != std::string::npos) return true;
  }
  return false;
}

}  // namespace

TEST_CASE("scene: only image, depth and camera; the folder gives the name; folder and file are the same") {
  const TemporaryFolder folder;
  put_files(folder);
  const auto scene = read_scene_text(folder, kMinimal);
  require_ok(scene);
  CHECK(scene.value().shape() == kShape);
  CHECK(scene.value().depth(5, 20) == sample_depth(5, 20));
  CHECK(scene.value().intrinsics.cx == 16.0F);
  CHECK(scene.value().name == std::filesystem::path(folder.path()).filename().string());
  CHECK(scene.value().labels.empty());
  CHECK(scene.value().instances.empty());
  CHECK(scene.value().normals.empty());
  CHECK(scene.value().albedo.empty());
  CHECK(scene.value().roughness.empty());
  CHECK(scene.value().light_index.empty());
  CHECK(scene.value().lights.empty());
  require_ok(io::read_scene(folder / "scene.json"));
  require_ok(io::read_scene(folder.path() + "/"));
}

TEST_CASE("scene: everything there is, and the convention of the normals found from depth") {
  const TemporaryFolder folder;
  put_files(folder);
  const auto read = read_scene_text(folder, kWhole);
  require_ok(read);
  const io::Scene& scene = read.value();
  CHECK(scene.name == "corner");
  CHECK(scene.labels(3, 3) == label::car);
  CHECK(scene.labels(30, 3) == label::road);
  CHECK(scene.instances(3, 3) == 26003);
  CHECK(scene.instances(30, 3) == 0);
  CHECK(scene.labels(3, kShape.height - 1) == label::ego_vehicle);
  CHECK(scene.instances(3, kShape.height - 1) == 0);
  CHECK(scene.labels(3, kShape.height - 2) == label::car);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      REQUIRE(length(scene.normals(x, y) - sample_normal(x, y)) < 1e-5F);
    }
  }
  CHECK(any_note(scene, "x = +x, y = -y, z = -z"));
  CHECK(scene.albedo(1, 1).y == 0.4F);
  CHECK(scene.roughness(1, 1) == 0.7F);
  REQUIRE(scene.lights.size() == 3);
  CHECK(scene.lights[1].group == 1);
  CHECK(scene.light_index(22, 2) == 2);
  CHECK(scene.light_index(24, 4) == 1);
  CHECK(scene.reflectors(9, 17) == ReflectorClass::number_plate);
  CHECK(scene.reflectors(2, 12) == ReflectorClass::vest);
  CHECK(scene.reflectors(3, 12) == ReflectorClass::none);
  const auto truth = io::read_truth_depth(scene);
  require_ok(truth);
  CHECK(truth.value()(2, 2) == scene.depth(2, 2));
  require_ok(io::read_truth_normals(scene));
  const auto behind = io::read_truth_background_depth(scene);
  REQUIRE(!behind.ok());
  CHECK(behind.error().line().find("truth.background_depth") != std::string::npos);
  CHECK(any_note(scene, "absent.obj"));
}

TEST_CASE("scene: its view has all planes, its files are all that scene.json names, and who made it") {
  const TemporaryFolder folder;
  put_files(folder);
  const auto read = read_scene_text(folder, replaced(kWhole, "\"name\"", "\"generator\": \"a camera\", \"name\""));
  require_ok(read);
  const io::Scene& scene = read.value();
  CHECK(scene.generator == "a camera");
  std::vector<std::string> files;
  for (const io::SceneFile& file : scene.files) files.push_back(file.field + " " + file.path);
  const std::vector<std::string> expected = {" " + (folder / "scene.json"),
                                             "image " + (folder / "image.png"),
                                             "depth.file " + (folder / "depth.pfm"),
                                             "labels.file " + (folder / "objects.png"),
                                             "labels.file " + (folder / "objects.png"),  // read as instances too
                                             "own_car.file " + (folder / "bonnet.png"),
                                             "normals.file " + (folder / "normals.pfm"),
                                             "albedo.file " + (folder / "albedo.pfm"),
                                             "roughness.file " + (folder / "roughness.pfm"),
                                             "lights.json " + (folder / "lights.json"),
                                             "lights.bitmap " + (folder / "lights.png"),
                                             "reflectors.file " + (folder / "plates.png"),
                                             "truth.depth " + (folder / "depth.pfm"),
                                             "truth.normals " + (folder / "true_normals.pfm"),
                                             "truth.mesh " + (folder / "absent.obj")};
  CHECK(files == expected);
  const SceneView view = scene.view();
  CHECK(validate(view).ok());
  CHECK(view.camera.cx == scene.intrinsics.cx);
  CHECK(view.image.data() == scene.image.data());
  CHECK(view.depth.data() == scene.depth.data());
  CHECK(view.labels.data() == scene.labels.data());
  CHECK(view.instances.data() == scene.instances.data());
  CHECK(view.reflectors.data() == scene.reflectors.data());
  CHECK(view.normals.data() == scene.normals.data());
  CHECK(view.albedo.data() == scene.albedo.data());
  CHECK(view.roughness.data() == scene.roughness.data());
  CHECK(view.light_index.data() == scene.light_index.data());
  CHECK(view.lights.size() == scene.lights.size());
}

TEST_CASE("scene: true emitters are read in the camera's frame, those that the picture hides as nothing but that") {
  const TemporaryFolder folder;
  put_files(folder);
  const auto emitters = [&](const std::string& list) {
    put(folder / "emitters.json", "{\"emitters\": [" + list + "]}");
    const auto scene =
        read_scene_text(folder, replaced(kWhole, "\"mesh\": \"absent.obj\"", "\"emitters\": \"emitters.json\""));
    require_ok(scene);
    return io::read_truth_emitters(scene.value());
  };
  const std::string lamp = R"({"id": 9, "mark": 7, "class": "street_light_LT", "group_class": "none",
    "centre": [1, 2, 3], "normal": [0, 0, -2], "half_extents": [0.5, 0.25], "area_m2": 0.5, "closed": false, "seen_area_m2": 0.25, "axis": [0, 1, 0],
    "up": [0, 0, 1], "mounting_height_m": 4.25})";
  const auto read = emitters("{\"mark\": 0}, " + lamp);
  require_ok(read);
  REQUIRE(read.value().size() == 2);
  CHECK(read.value()[0].mark == 0);
  CHECK(read.value()[1].mark == 7);
  CHECK(read.value()[1].centre_m == Vec3f{1, 2, 3});
  CHECK(read.value()[1].normal == Vec3f{0, 0, -1});
  CHECK(read.value()[1].half_extents_m.y == 0.25F);
  CHECK(read.value()[1].id == 9);
  CHECK(read.value()[1].cls == npsim::LightClass::street_light_lt);
  CHECK(read.value()[1].axis == Vec3f{0, 1, 0});
  CHECK(read.value()[1].up == Vec3f{0, 0, 1});
  CHECK(read.value()[1].area_m2 == 0.5F);
  CHECK(read.value()[1].mounting_height_m == 4.25F);
  const auto spoilt = [&](const char* from, const char* to, const char* field) {
    check_error(emitters(replaced(lamp, from, to)), "emitters.json", std::string("emitters[0].") + field);
  };
  spoilt("[1, 2, 3]", "[1, 2]", "centre");
  spoilt("[1, 2, 3]", "[1, 2, \"x\"]", "centre");
  spoilt("\"axis\": [0, 1, 0]", "\"axis\": [0, 0, 0]", "axis");
  spoilt("street_light_LT", "street_lamp", "class");
  spoilt("0.5, \"closed\"", "0, \"closed\"", "area_m2");
  spoilt("false", "\"no\"", "closed");
  spoilt("\"mounting_height_m\"", "\"height_m\"", "mounting_height_m");
  spoilt("\"id\": 9, ", "\"id\": 9, \"state\": \"blue\", ", "state");
}

TEST_CASE("scene: the true ground") {
  const TemporaryFolder folder;
  put_files(folder);
  const auto with = [&](const std::string& ground) {
    return read_scene_text(folder, replaced(kWhole, "\"mesh\": \"absent.obj\"", "\"ground\": " + ground));
  };
  const auto read = with(R"({"camera_height_m": 1.25, "up": [0, -2, 0]})");
  require_ok(read);
  REQUIRE(read.value().truth.ground.has_value());
  CHECK(read.value().truth.ground->camera_height_m == 1.25F);
  CHECK(read.value().truth.ground->up == Vec3f{0, -1, 0});
  check_error(with(R"({"camera_height_m": 1.25, "up": [0, 0, 0]})"), "scene.json", "truth.ground.up");
  check_error(with(R"({"camera_height_m": 1.25})"), "scene.json", "truth.ground.up");
  check_error(with(R"({"height": 1.25})"), "scene.json", "truth.ground.height");
}

TEST_CASE("scene: a named convention is taken as it is") {
  const TemporaryFolder folder;
  put_files(folder);
  const auto opengl = read_scene_text(folder, replaced(kWhole, "\"auto\"", "\"opengl\""));
  require_ok(opengl);
  CHECK(opengl.value().normals(5, 20).y == -1.0F);
  const auto canonical = read_scene_text(folder, replaced(kWhole, "\"auto\"", "\"canonical\""));
  require_ok(canonical);
  CHECK(canonical.value().normals(5, 20).y == 1.0F);
  CHECK(any_note(canonical.value(), "depth suggests"));
  check_error(read_scene_text(folder, replaced(kWhole, "\"auto\"", "\"directx\"")), "scene.json", "normals.convention");
}

TEST_CASE("scene: absolute names, and names that leave the folder") {
  const TemporaryFolder folder;
  const TemporaryFolder elsewhere;
  put_files(elsewhere);
  require_ok(read_scene_text(folder, replaced(replaced(kMinimal, "image.png", elsewhere / "image.png"), "depth.pfm",
                                              elsewhere / "depth.pfm")));
  const std::string up = "../" + std::filesystem::path(elsewhere.path()).filename().string() + "/";
  require_ok(read_scene_text(
      folder, replaced(replaced(kMinimal, "image.png", up + "image.png"), "depth.pfm", up + "depth.pfm")));
}

TEST_CASE("scene: missing keys, unknown keys and wrong kinds are named with their place") {
  const TemporaryFolder folder;
  put_files(folder);
  const auto refused = [&](const std::string& json, const std::string& words) {
    check_error(read_scene_text(folder, json), "scene.json", words);
  };
  refused("{}", "image");
  refused("[]", "object");
  refused("null", "object");
  refused("{\"image\": \"image.png\",", "not valid JSON");
  refused("", "empty");
  refused(replaced(kMinimal, "\"image\"", "\"picture\""), "picture");
  refused(replaced(kMinimal, "\"image.png\"", "3"), "image: is a number");
  refused(replaced(kMinimal, "\"image.png\"", "\"\""), "image: is an empty text");
  refused(replaced(kMinimal, "\"file\"", "\"path\""), "depth.path");
  refused(replaced(kMinimal, "\"metres\"", "\"meters\""), "depth.encoding: is 'meters'");
  refused(replaced(kMinimal, ", \"encoding\": \"metres\"", ""), "depth.encoding: is missing");
  refused(replaced(kMinimal, "\"encoding\": \"metres\"", "\"encoding\": \"uint16\""), "depth.scale: is missing");
  refused(replaced(kMinimal, "\"metres\"", "\"metres\", \"scale\": 2"), "depth.scale");
  refused(replaced(kMinimal, "\"metres\"", "\"uint16\", \"scale\": 0"), "depth.scale");
  refused(replaced(kMinimal, "\"metres\"", "\"cityscapes_disparity\""), "camera.baseline");
  refused(replaced(kMinimal, "\"fx\": 30,", ""), "camera.fx: is missing");
  refused(replaced(kWhole, "\"npsim_scene\": 1", "\"npsim_scene\": 2"), "npsim_scene");
  refused(replaced(kWhole, "\"segments_ai\"", "\"segments\""), "lights.format");
  refused(replaced(kWhole, "\"bitmap\": \"lights.png\"", "\"bitmaps\": \"lights.png\""), "lights.bitmaps");
  refused(replaced(kWhole, "\"ids\", \"file\"", "\"masks\", \"file\""), "reflectors.format: is 'masks'");
  refused(replaced(kWhole, "\"plates.png\"", "\"plates.png\", \"scale\": 1"), "reflectors.scale");
  refused(replaced(kWhole, "\"cityscapes_instance_ids\"", "\"ade20k\""), "labels.encoding");
  refused(replaced(kWhole, "\"mesh\"", "\"meshes\""), "truth.meshes");
  refused(replaced(kWhole, "\"roughness\"", "\"roughnes\""), "roughnes");
  refused(replaced(kWhole, "\"bonnet.png\"}", "\"bonnet.png\", \"encoding\": \"mask\"}"), "own_car.encoding");
  refused(replaced(kMinimal, "\"image.png\",", "\"image.png\", \"own_car\": {\"file\": \"bonnet.png\"},"),
          "own_car.file: is given without labels");
  refused(replaced(kWhole, "\"albedo\": {", "\"albedo\": {\"encoding\": \"srgb\", "), "albedo.encoding");
  check_error(io::read_scene(folder / "absent"), "absent", "does not exist");
  const TemporaryFolder empty;
  check_error(io::read_scene(empty.path()), "scene.json", "does not exist");
}

TEST_CASE("scene: reflectors as shapes and as the number plates of Cityscapes polygons; ids that mean nothing") {
  const TemporaryFolder folder;
  put_files(folder);
  const auto with = [&](const char* format, const std::string& json) {
    put(folder / "reflectors.json", json);
    return read_scene_text(folder, replaced(kWhole, "\"ids\", \"file\": \"plates.png\"",
                                            "\"" + std::string(format) + "\", \"file\": \"reflectors.json\""));
  };
  const auto shapes = with("shapes", R"({"reflectors": [{"class": "number_plate", "rectangle": [2, 3, 7, 5]},
      {"class": "sheeting", "polygon": [[4, 4], [9, 4], [9, 6], [4, 6]]}]})");
  require_ok(shapes);
  CHECK(shapes.value().reflectors(2, 3) == ReflectorClass::number_plate);
  CHECK(shapes.value().reflectors(6, 3) == ReflectorClass::number_plate);
  CHECK(shapes.value().reflectors(7, 3) == ReflectorClass::none);
  CHECK(shapes.value().reflectors(4, 4) == ReflectorClass::sheeting);  // the later one counts
  CHECK(any_note(shapes.value(), "reflectors: 17 pixels"));            // 5 x 2 and 5 x 2, three of them in both
  const std::string objects = R"("objects": [{"label": "car", "polygon": [[0, 0], [20, 0], [20, 20]]},
      {"label": "license plate", "polygon": [[10, 10], [14, 10], [14, 12], [10, 12]]},
      {"label": "license plate", "polygon": [[1, 1], [2, 2]]}, {"label": "tree", "deleted": null},
      {"label": "license plate", "deleted": 1, "polygon": [[20, 1], [24, 1], [24, 5]]},
      {"label": "person", "deleted": 0, "polygon": [[13, 0], [16, 0], [16, 20], [13, 20]]}]})";
  const auto plates = with("cityscapes_polygons", R"({"imgHeight": 24, "imgWidth": 32, )" + objects);
  require_ok(plates);
  CHECK(plates.value().reflectors(12, 11) == ReflectorClass::number_plate);
  CHECK(plates.value().reflectors(12, 5) == ReflectorClass::none);   // the car's polygon holds it
  CHECK(plates.value().reflectors(13, 11) == ReflectorClass::none);  // a person stands before it
  CHECK(plates.value().reflectors(23, 2) == ReflectorClass::none);   // deleted
  check_error(with("cityscapes_polygons", R"({"imgHeight": 1024, "imgWidth": 32, )" + objects), "reflectors.json",
              "imgHeight: is 1024");
  check_error(with("shapes", R"({"reflectors": [{"class": "plate", "rectangle": [2, 3, 7, 5]}]})"), "reflectors.json",
              "reflectors[0].class: is 'plate'");
  check_error(with("shapes", R"({"reflectors": [{"class": "none", "rectangle": [2, 3, 7, 5]}]})"), "reflectors.json",
              "reflectors[0].class");
  check_error(with("shapes", R"({"reflectors": [{"class": "vest", "polygon": [[2, 3], [7, 5]]}]})"), "reflectors.json",
              "three corners");
  io::Image<std::uint8_t> unknown(kShape);
  unknown(5, 5) = 4;
  require_ok(io::write_png(folder / "plates.png", unknown.view()));
  check_error(read_scene_text(folder, kWhole), "plates.png", "one of them is 4");
}

TEST_CASE("scene: every plane has to be of the image's size") {
  const Shape wrong{31, 24};
  const auto refused = [&](const char* name, auto&& write) {
    const TemporaryFolder folder;
    put_files(folder);
    require_ok(write(folder / name));
    check_error(read_scene_text(folder, kWhole), name, "31x24");
  };
  refused("depth.pfm", [&](const std::string& p) { return io::write_pfm(p, io::Image<float>(wrong, 1).view()); });
  refused("normals.pfm", [&](const std::string& p) { return io::write_pfm(p, io::Image<Vec3f>(wrong).view()); });
  refused("albedo.pfm", [&](const std::string& p) { return io::write_pfm(p, io::Image<Vec3f>(wrong).view()); });
  refused("roughness.pfm", [&](const std::string& p) { return io::write_pfm(p, io::Image<float>(wrong).view()); });
  refused("objects.png",
          [&](const std::string& p) { return io::write_png16(p, io::Image<std::uint16_t>(wrong).view()); });
  refused("bonnet.png",
          [&](const std::string& p) { return io::write_png16(p, io::Image<std::uint16_t>(wrong).view()); });
  refused("plates.png", [&](const std::string& p) { return io::write_png(p, io::Image<std::uint8_t>(wrong).view()); });
  refused("lights.png",
          [&](const std::string& p) { return io::write_png_rgba(p, io::Image<io::Rgba8>(wrong).view()); });
}

TEST_CASE("scene: a missing, empty or unfit file behind any key is an error that names it") {
  for (const char* name : {"image.png", "depth.pfm", "objects.png", "bonnet.png", "normals.pfm", "albedo.pfm",
                           "roughness.pfm", "lights.png", "lights.json", "plates.png"}) {
    const TemporaryFolder folder;
    put_files(folder);
    put(folder / name, "");
    check_error(read_scene_text(folder, kWhole), name, "empty");
    put(folder / name, "neither picture nor numbers");
    check_error(read_scene_text(folder, kWhole), name);
    std::filesystem::remove(folder / name);
    check_error(read_scene_text(folder, kWhole), name, "does not exist");
    std::filesystem::create_directory(folder / name);
    check_error(read_scene_text(folder, kWhole), name, "folder");
  }
}

TEST_CASE(
    "scene: NaN in a material plane is an error, beyond 0..1 is clamped and said, all-zero normals are an error") {
  const TemporaryFolder folder;
  put_files(folder);
  io::Image<float> roughness(kShape, 1.5F);
  require_ok(io::write_pfm(folder / "roughness.pfm", roughness.view()));
  const auto clamped = read_scene_text(folder, kWhole);
  require_ok(clamped);
  CHECK(clamped.value().roughness(0, 0) == 1.0F);
  CHECK(any_note(clamped.value(), "clamped"));
  roughness(4, 5) = std::numeric_limits<float>::quiet_NaN();
  require_ok(io::write_pfm(folder / "roughness.pfm", roughness.view()));
  check_error(read_scene_text(folder, kWhole), "roughness.pfm", "not finite");
  put_files(folder);
  require_ok(io::write_pfm(folder / "normals.pfm", io::Image<Vec3f>(kShape).view()));
  check_error(read_scene_text(folder, kWhole), "normals.pfm", "none of them");
}

TEST_CASE("resize: constants stay, light is conserved, edges of depth stay sharp, intrinsics follow") {
  const TemporaryFolder folder;
  put_files(folder);
  for (const Shape to : {Shape{16, 12}, Shape{11, 7}, Shape{64, 48}, Shape{33, 23}, Shape{1, 1}}) {
    auto read = read_scene_text(folder, kWhole);
    require_ok(read);
    io::Scene& scene = read.value();
    require_ok(io::resize_scene(scene, to));
    REQUIRE(scene.shape() == to);
    for (const Shape s :
         {scene.depth.shape(), scene.labels.shape(), scene.instances.shape(), scene.normals.shape(),
          scene.albedo.shape(), scene.roughness.shape(), scene.light_index.shape(), scene.reflectors.shape()}) {
      REQUIRE(s == to);
    }
    CHECK(scene.intrinsics.fx == doctest::Approx(30.0 * to.width / kShape.width));
    CHECK(scene.intrinsics.cy == doctest::Approx(12.0 * to.height / kShape.height));
    for (int y = 0; y < to.height; ++y) {
      for (int x = 0; x < to.width; ++x) {
        REQUIRE(scene.image(x, y).b == 77);
        REQUIRE(scene.albedo(x, y).z == doctest::Approx(0.6));
        REQUIRE(scene.roughness(x, y) == doctest::Approx(0.7));
        const int sx = static_cast<int>(std::floor((x + 0.5) * kShape.width / to.width));
        const int sy = static_cast<int>(std::floor((y + 0.5) * kShape.height / to.height));
        REQUIRE(scene.depth(x, y) == sample_depth(sx, sy));
      }
    }
  }
}

TEST_CASE("resize: the area average against a naive one in double, and half of black and white is 188 in sRGB") {
  const Shape from{13, 9};
  io::Image<float> source(from);
  double sum = 0;
  for (int i = 0; i < 13 * 9; ++i) {
    source.data()[i] = static_cast<float>((i * 7919) % 101);
    sum += static_cast<double>(source.data()[i]);
  }
  for (const Shape to : {Shape{5, 4}, Shape{1, 1}, Shape{13, 9}, Shape{29, 31}}) {
    const io::Image<float> out = io::resized_area(source, to);
    double total = 0;
    for (int y = 0; y < to.height; ++y) {
      for (int x = 0; x < to.width; ++x) {
        const double x0 = 13.0 * x / to.width, x1 = 13.0 * (x + 1) / to.width;
        const double y0 = 9.0 * y / to.height, y1 = 9.0 * (y + 1) / to.height;
        double average = 0;
        for (int sy = 0; sy < 9; ++sy) {
          for (int sx = 0; sx < 13; ++sx) {
            const double w = std::max(0.0, std::min(x1, sx + 1.0) - std::max(x0, 0.0 + sx));
            const double h = std::max(0.0, std::min(y1, sy + 1.0) - std::max(y0, 0.0 + sy));
            average += w * h * static_cast<double>(source(sx, sy));
          }
        }
        average /= (x1 - x0) * (y1 - y0);
        REQUIRE(std::abs(static_cast<double>(out(x, y)) - average) < 100 * 2e-6);
        total += static_cast<double>(out(x, y));
      }
    }
    CHECK(total / static_cast<double>(to.pixels()) == doctest::Approx(sum / 117).epsilon(1e-5));
  }
  io::Image<Rgb8> stripes({2, 1});
  stripes(1, 0) = {255, 255, 255};
  CHECK(io::detail::resized_photograph(stripes, {1, 1})(0, 0).r == 188);
  for (int v = 0; v < 256; ++v) {
    CHECK(io::detail::srgb_encoded(io::detail::srgb_decoded(static_cast<std::uint8_t>(v))) == v);
  }
}

TEST_CASE("resize: no annotated source vanishes, even inside its group's last pixel") {
  const TemporaryFolder folder;
  put_files(folder);
  for (const Shape to : {Shape{16, 12}, Shape{8, 6}, Shape{5, 4}}) {
    auto read = read_scene_text(folder, kWhole);
    require_ok(read);
    require_ok(io::resize_scene(read.value(), to));
    std::vector<int> pixels(4, 0);
    for (int y = 0; y < to.height; ++y) {
      for (int x = 0; x < to.width; ++x) ++pixels.at(read.value().light_index(x, y));
    }
    CHECK(pixels[2] > 0);
    CHECK(pixels[3] > 0);
    if (to.width >= 16) CHECK(pixels[1] > 0);
  }
}

TEST_CASE(
    "resize: a reflecting strip two pixels thin stays at a quarter of the size, what is thinner or alone does not") {
  io::Image<ReflectorClass> marked({40, 40});
  for (int x = 4; x < 36; ++x) {
    for (const int y : {9, 10}) marked(x, y) = ReflectorClass::vest;
    for (const int y : {23, 24}) marked(x, y) = ReflectorClass::sheeting;  // in two rows of the smaller image
  }
  marked(20, 34) = ReflectorClass::number_plate;
  const io::Image<ReflectorClass> small = io::detail::resized_reflectors(marked, {10, 10});
  for (int x = 1; x < 9; ++x) {
    CHECK(small(x, 2) == ReflectorClass::vest);
    CHECK(small(x, 5) == ReflectorClass::sheeting);
    CHECK(small(x, 6) == ReflectorClass::sheeting);
    CHECK(small(x, 1) == ReflectorClass::none);
    CHECK(small(x, 8) == ReflectorClass::none);
  }
  CHECK(small(0, 2) == ReflectorClass::none);
}

TEST_CASE("resize: impossible sizes, and sizes without a valid depth, leave the scene as it was") {
  const TemporaryFolder folder;
  put_files(folder);
  io::Image<float> sparse(kShape);
  sparse(3, 3) = 5;
  require_ok(io::write_pfm(folder / "depth.pfm", sparse.view()));
  auto read = read_scene_text(folder, kMinimal);
  require_ok(read);
  io::Scene& scene = read.value();
  check_error(io::resize_scene(scene, {0, 5}), "scene.json", "0x5");
  check_error(io::resize_scene(scene, {-3, 5}), "scene.json");
  check_error(io::resize_scene(scene, {100000, 5}), "scene.json", "100000x5");
  check_error(io::resize_scene(scene, {1, 1}), "scene.json", "no valid depth");
  CHECK(scene.shape() == kShape);
  CHECK(scene.depth(3, 3) == 5.0F);
}

TEST_CASE("real data, where the environment names it: Cityscapes, CARLA, KITTI and RGB-D frames are read") {
  const char* const data = std::getenv("NPSIM_TEST_DATA");
  if (data == nullptr || *data == '\0') {
    MESSAGE("skipped: NPSIM_TEST_DATA is not set");
    return;
  }
  const std::string root = std::string(data) + "/";
  const TemporaryFolder folder;
  const auto camera = [](const char* text) { return std::string(", \"camera\": ") + text; };
  const auto image_depth = [&](const std::string& image, const std::string& depth, const std::string& encoding) {
    return "{\"image\": \"" + root + image + "\", \"depth\": {\"file\": \"" + root + depth + "\", " + encoding + "}";
  };
  const std::string d = "cityscapes/dusseldorf_000020_000019";
  auto scene = read_scene_text(
      folder, image_depth(d + "_leftImg8bit.png", d + "_disparity.png", "\"encoding\": \"cityscapes_disparity\"") +
                  ", \"camera\": {\"cityscapes\": \"" + root + d + "_camera.json\"}, \"labels\": {\"file\": \"" + root +
                  d + "_gtFine_instanceIds.png\", \"encoding\": \"cityscapes_instance_ids\"}, \"lights\": " +
                  "{\"format\": \"segments_ai\", \"json\": \"" + root + d + "_segments_release.json\", \"bitmap\": \"" +
                  root + d + "_label_ground-truth.png\"}}");
  require_ok(scene);
  CHECK(scene.value().shape() == Shape{2048, 1024});
  CHECK(scene.value().lights.size() == 45);
  CHECK(scene.value().baseline_m > 0.1);

  scene = read_scene_text(folder, image_depth("carla/0183_rgb.png", "carla/0183_depth_m_x256_DERIVED.png",
                                              "\"encoding\": \"uint16\", \"scale\": 0.00390625") +
                                      camera(R"({"fx": 951.07, "fy": 951.07, "cx": 691, "cy": 256})") +
                                      ", \"labels\": {\"file\": \"" + root +
                                      "carla/0183_labelIds_DERIVED.png\", \"encoding\": \"cityscapes_label_ids\"}}");
  require_ok(scene);
  // The road lies 1.70 m below the camera, within 1 %: where labels say road, in the lower middle of the picture.
  double below = 0;
  int count = 0;
  for (int y = 400; y < 500; ++y) {
    for (int x = 600; x < 780; ++x) {
      if (scene.value().labels(x, y) != label::road || scene.value().depth(x, y) <= 0) continue;
      below += static_cast<double>(unproject_pixel(scene.value().intrinsics, x, y, scene.value().depth(x, y)).y);
      ++count;
    }
  }
  REQUIRE(count > 1000);
  CHECK(below / count == doctest::Approx(1.70).epsilon(0.02));

  scene = read_scene_text(folder, image_depth("kitti/0000000050_rgb.png", "kitti/0000000050_depth.png",
                                              "\"encoding\": \"uint16\", \"scale\": 0.00390625") +
                                      camera(R"({"fx": 707.0493, "fy": 707.0493, "cx": 604.0814, "cy": 180.5066,
                                           "pixel_centre": 0})") +
                                      "}");
  require_ok(scene);
  CHECK(any_note(scene.value(), "20.6 % valid"));

  scene = read_scene_text(folder, image_depth("rgbd/frame-000000.color.jpg", "rgbd/frame-000000.depth.png",
                                              "\"encoding\": \"uint16\", \"scale\": 0.001") +
                                      camera(R"({"fx": 585, "fy": 585, "cx": 320, "cy": 240})") + "}");
  require_ok(scene);
  CHECK(scene.value().depth(320, 240) < 10.0F);
}
