// SPDX-License-Identifier: Apache-2.0
// npsim night --labels: label images that agree with the scene, with each other and with the night's description, and
// boxes that agree with the images.
#include <doctest/doctest.h>

#ifdef NPSIM_TOOL

#include <algorithm>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "npsim/io/image.hpp"
#include "npsim/io/pfm.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"
#include "tool/night_labels.hpp"
#include "tool_fixture.hpp"

using namespace tool_test;

namespace {

using namespace npsim;

// Two nights of the street with labels, made once.
const std::string& labelled() {
  static const std::string folder = [] {
    std::string out = fixture().out("labelled");
    const Run run = run_tool("night '" + fixture().street + "' -o '" + out +
                             "' --labels --variants 2 --rays 1 --threads 2 --quiet");
    REQUIRE_MESSAGE(run.status == 0, run.output);
    return out;
  }();
  return folder;
}

std::string file(int variant, const std::string& ending) {
  return labelled() + "/night_00" + std::to_string(variant) + ending;
}

struct PlainBox {
  int left = 1 << 20, top = 1 << 20, right = -1, bottom = -1;
  int pixels = 0;
};

template <class Ids>
std::map<int, PlainBox> plain_boxes(const Ids& ids, Shape shape) {
  std::map<int, PlainBox> boxes;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      PlainBox& b = boxes[ids(x, y)];
      b.left = std::min(b.left, x);
      b.right = std::max(b.right, x);
      b.top = std::min(b.top, y);
      b.bottom = std::max(b.bottom, y);
      ++b.pixels;
    }
  }
  return boxes;
}

}  // namespace

TEST_CASE("night labels: classes are the day's, sky stays sky, and objects are Cityscapes' instances of them") {
  const io::Scene scene = value_of(io::read_scene(fixture().street));
  for (int v = 0; v < 2; ++v) {
    const auto labels = value_of(io::read_u8(file(v, "_labelIds.png")));
    const auto instances = value_of(io::read_u16(file(v, "_instanceIds.png")));
    REQUIRE(labels.shape() == scene.shape());
    int sky = 0;
    std::map<int, std::set<int>> given;  // ids of an object in the scene
    for (std::size_t i = 0; i < labels.shape().pixels(); ++i) {
      CHECK(labels.data()[i] == scene.labels.data()[i]);
      sky += labels.data()[i] == label::sky;
      const int id = instances.data()[i];
      CHECK((id >= 1000) == (scene.instances.data()[i] != 0));
      CHECK((id >= 1000 ? id / 1000 : id) == labels.data()[i]);
      if (id >= 1000) given[id].insert(scene.instances.data()[i]);
    }
    CHECK(50 * sky > labels.width() * labels.height());
    CHECK(given.size() > 2);
    for (const auto& [id, of] : given) CHECK(of.size() == 1);
  }
}

TEST_CASE("night labels: depth and normals are those of the street, and no pixel is saturated and indiscernible") {
  CHECK(bytes_of(file(1, "_depth.pfm")) == bytes_of(labelled() + "/depth.pfm"));
  CHECK(bytes_of(file(1, "_normals.png")) == bytes_of(labelled() + "/normals.png"));
  for (int v = 0; v < 2; ++v) {
    const auto saturated = value_of(io::read_u8(file(v, "_saturated.png")));
    const auto invalid = value_of(io::read_u8(file(v, "_invIds.png")));
    const auto picture = value_of(io::read_rgb8(file(v, ".png")));
    int bright = 0;
    for (std::size_t i = 0; i < saturated.shape().pixels(); ++i) {
      CHECK(saturated.data()[i] <= 1);
      CHECK(invalid.data()[i] <= 1);
      CHECK(saturated.data()[i] + invalid.data()[i] <= 1);
      const auto shown = [&](int x, int y) {
        const Rgb8 c = picture(std::clamp(x, 0, picture.width() - 1), std::clamp(y, 0, picture.height() - 1));
        return static_cast<int>(std::max({c.r, c.g, c.b}));
      };
      const int x = static_cast<int>(i) % picture.width();
      const int y = static_cast<int>(i) / picture.width();
      if (invalid.data()[i] != 0) CHECK(shown(x, y) < 60);
      if (saturated.data()[i] == 0) continue;
      ++bright;
      int brightest = 0;  // of the pixels whose samples this one's colour is made of
      for (int k = 0; k < 9; ++k) brightest = std::max(brightest, shown(x + k % 3 - 1, y + k / 3 - 1));
      CHECK(brightest > 160);
    }
    CHECK(bright > 0);
  }
}

TEST_CASE("night labels: lamps are the marked ones, lit as the night's description says, and not alike in two nights") {
  const io::Scene scene = value_of(io::read_scene(fixture().street));
  std::string states[2];
  for (int v = 0; v < 2; ++v) {
    const auto ids = value_of(io::read_rgb8(file(v, "_lampIds.png")));
    const auto state = value_of(io::read_u8(file(v, "_lampStates.png")));
    states[v] = bytes_of(file(v, "_lampStates.png"));
    std::map<std::uint32_t, bool> lit;
    const nlohmann::json night = json_of(file(v, ".json"));
    for (const auto& source : night["sources"]) {
      if (source.contains("id")) lit[source["id"]] = source["lit"];
    }
    int seen[3] = {};
    for (std::size_t i = 0; i < ids.shape().pixels(); ++i) {
      const Rgb8 c = ids.data()[i];
      const std::uint32_t id = c.r + 256U * c.g + 65536U * c.b;
      const std::size_t mark = scene.light_index.data()[i];
      const bool lamp = mark != 0 && !is_group(scene.lights[mark - 1].cls);
      CHECK(id == (lamp ? scene.lights[mark - 1].id : 0U));
      CHECK(state.data()[i] == (lamp ? (lit[id] ? 2 : 1) : 0));
      ++seen[state.data()[i]];
    }
    CHECK(seen[1] > 0);
    CHECK(seen[2] > 0);
  }
  CHECK(states[0] != states[1]);
}

TEST_CASE("night labels: COCO has every object and lamp of every night, boxes as in the images") {
  const nlohmann::json coco = json_of(labelled() + "/coco.json");
  REQUIRE(coco["images"].size() == 2);
  CHECK(coco["images"][1]["file_name"] == "night_001.png");
  CHECK(coco["images"][1]["width"] == kStreet.width);
  std::map<int, std::string> categories;
  for (const auto& c : coco["categories"]) categories[c["id"]] = c["name"];
  for (int v = 0; v < 2; ++v) {
    const auto instances = value_of(io::read_u16(file(v, "_instanceIds.png")));
    const auto colours = value_of(io::read_rgb8(file(v, "_lampIds.png")));
    const auto state = value_of(io::read_u8(file(v, "_lampStates.png")));
    const Shape shape = instances.shape();
    std::map<int, PlainBox> objects = plain_boxes(instances, shape);
    const auto lamp_id = [&](int x, int y) {
      return colours(x, y).r + 256 * colours(x, y).g + 65536 * colours(x, y).b;
    };
    std::map<int, PlainBox> lamps = plain_boxes(lamp_id, shape);
    lamps.erase(0);
    for (auto o = objects.begin(); o != objects.end();) o = o->first < 1000 ? objects.erase(o) : std::next(o);
    for (const auto& a : coco["annotations"]) {
      if (a["image_id"] != v) continue;
      const int category = a["category_id"];
      REQUIRE(categories.count(category) == 1);
      const bool lamp = category >= 100;
      std::map<int, PlainBox>& boxes = lamp ? lamps : objects;
      const int id = a[lamp ? "lamp_id" : "instance_id"];
      REQUIRE(boxes.count(id) == 1);
      const PlainBox b = boxes[id];
      boxes.erase(id);
      CHECK(a["bbox"] == nlohmann::json({b.left, b.top, b.right - b.left + 1, b.bottom - b.top + 1}));
      CHECK(a["area"] == b.pixels);
      CHECK(a["indiscernible"] >= 0);
      CHECK(a["indiscernible"] <= 1);
      if (!lamp) {
        CHECK(category == id / 1000);
        CHECK(categories[category] == kLabels[static_cast<std::size_t>(category)].name);
        continue;
      }
      for (int y = b.top; y <= b.bottom; ++y) {
        for (int x = b.left; x <= b.right; ++x) {
          if (lamp_id(x, y) == id) CHECK((state(x, y) == 2) == a["lit"]);
        }
      }
    }
    CHECK(objects.empty());
    CHECK(lamps.empty());
  }
}

TEST_CASE("night labels: a prediction that is the truth has an IoU of 1 by the folder that night wrote") {
  const fs::path predictions = fixture().out("night_predictions");
  fs::create_directories(predictions);
  for (int v = 0; v < 2; ++v) {
    fs::copy(file(v, "_labelIds.png"), predictions / ("night_00" + std::to_string(v) + ".png"));
  }
  const std::string json = fixture().out("night_iou.json");
  const Run run =
      run_tool("evaluate --prediction '" + predictions.string() + "' --labels '" + labelled() + "' -o '" + json + "'");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  CHECK(json_of(json)["images"] == 2);
  CHECK(json_of(json)["mean_iou"] == 1.0);
  CHECK(json_of(json)["mean_uiou"] == 1.0);
}

TEST_CASE(
    "night labels: the same bytes on another number of threads; gone after a run without them; no partial files") {
  const std::string out = fixture().out("relabelled");
  const std::string night = "night '" + fixture().street + "' -o '" + out + "' --variants 2 --rays 1 --quiet";
  REQUIRE(run_tool(night + " --labels --threads 1").status == 0);
  int labels = 0;
  for (const auto& entry : fs::directory_iterator(labelled())) {
    const std::string name = entry.path().filename().string();
    CHECK(name.find(".partial") == std::string::npos);
    if (name.find("night_00") != 0 && name != "coco.json") continue;
    CHECK_MESSAGE(bytes_of(entry.path()) == bytes_of(out + "/" + name), name);
    ++labels;
  }
  CHECK(labels == 2 * 11 + 1);
  // A place that cannot be written is named, and nothing half is left.
  fs::remove(out + "/night_000_lampIds.png");
  fs::create_directories(out + "/night_000_lampIds.png");
  check_refused(run_tool(night + " --labels"), "night_000_lampIds.png: is a folder");
  fs::remove(out + "/night_000_lampIds.png");
  REQUIRE(run_tool(night + " --size 96x54").status == 0);
  CHECK(fs::exists(out + "/night_001.png"));
  CHECK(!fs::exists(out + "/coco.json"));
  for (const std::string& old : tool::label_files(out + "/night_001")) CHECK_MESSAGE(!fs::exists(old), old);
}

TEST_CASE(
    "night labels: a scene without labels, objects and lamps has empty ones, at an odd size; a limit needs labels") {
  const std::string scene = fixture().copy("bare_for_labels");
  nlohmann::json json = json_of(scene + "/scene.json");
  for (const char* key : {"labels", "instances", "lights", "truth"}) json.erase(key);
  std::ofstream(scene + "/scene.json") << json;
  const std::string out = fixture().out("bare_labelled");
  const std::string night = "night '" + scene + "' -o '" + out + "' --rays 1 --quiet --size 121x67";
  check_refused(run_tool(night + " --least-snr 2"), "--least-snr", out);
  const Run run = run_tool(night + " --labels --least-snr 50");
  REQUIRE_MESSAGE(run.status == 0, run.output);
  const auto instances = value_of(io::read_u16(out + "/night_000_instanceIds.png"));
  CHECK(instances.shape() == Shape{121, 67});
  CHECK(std::all_of(instances.data(), instances.data() + 121 * 67, [](int id) { return id == 0; }));
  CHECK(json_of(out + "/coco.json")["annotations"].empty());
}

TEST_CASE(
    "night labels: numbers of objects that are Cityscapes' stay, others become so, and of 1100 a hundred go without") {
  io::Image<Label> labels(Shape{1100, 3}, label::car);
  io::Image<std::uint16_t> instances(Shape{1100, 3});
  for (int x = 0; x < 1100; ++x) {
    instances(x, 0) = static_cast<std::uint16_t>(x + 7);  // of any kind
    labels(x, 1) = label::person;
    instances(x, 1) = static_cast<std::uint16_t>(24000 + x % 5);
    labels(x, 2) = label::road;
  }
  const auto ids = tool::cityscapes_instance_ids(std::as_const(labels).view(), std::as_const(instances).view());
  std::set<int> cars;
  for (int x = 0; x < 1100; ++x) {
    cars.insert(ids(x, 0));
    CHECK((ids(x, 0) == label::car || ids(x, 0) / 1000 == label::car));
    CHECK(ids(x, 1) == 24000 + x % 5);
    CHECK(ids(x, 2) == label::road);
  }
  CHECK(cars.size() == 1001);  // the rest are cars without a number
  CHECK(*cars.begin() == label::car);
}

#endif
