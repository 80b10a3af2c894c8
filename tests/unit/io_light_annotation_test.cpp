// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "io_fixture.hpp"
#include "npsim/io/detail/light_annotation.hpp"

namespace {

using namespace npsim;
using io_test::check_error;
using io_test::put;
using io_test::require_ok;
using io_test::TemporaryFolder;

struct Box {
  int x, y, width, height;
  std::uint32_t id;
};

// A 20 x 10 bitmap with later boxes over earlier ones.
void put_bitmap(const std::string& path, const std::vector<Box>& boxes, Shape shape = {20, 10}) {
  io::Image<io::Rgba8> bitmap(shape);
  for (const Box& b : boxes) {
    for (int y = b.y; y < b.y + b.height; ++y) {
      for (int x = b.x; x < b.x + b.width; ++x) {
        bitmap(x, y) = {static_cast<std::uint8_t>(b.id & 255U), static_cast<std::uint8_t>(b.id >> 8 & 255U),
                        static_cast<std::uint8_t>(b.id >> 16), 255};
      }
    }
  }
  require_ok(io::write_png_rgba(path, bitmap.view()));
}

std::string categories() {
  std::string list;
  for (int i = 1; i < kLightClassCount; ++i) {
    list += (i > 1 ? ", " : "") + std::string(R"({"id": )") + std::to_string(100 + i) + R"(, "name": ")" +
            kLightClasses[static_cast<std::size_t>(i)].name + "\"}";
  }
  return list + R"(, {"id": 7, "name": "tree"})";
}

std::string entry(std::uint32_t id, LightClass cls, const std::string& attributes = "") {
  return R"({"id": )" + std::to_string(id) + R"(, "category_id": )" + std::to_string(100 + static_cast<int>(cls)) +
         (attributes.empty() ? "" : R"(, "attributes": {)" + attributes + "}") + "}";
}

std::string segments(const std::string& annotations, const std::string& more_samples = "") {
  return R"({"dataset": {"task_attributes": {"categories": [)" + categories() +
         R"(]}, "samples": [{"name": "a.png", "labels": {"ground-truth": {"attributes": {"annotations": [)" +
         annotations + R"(], "segmentation_bitmap": {"url": "https://somewhere.invalid/x/lights.png?key=1"}}}}})" +
         more_samples + "]}}";
}

std::string panoptic(const std::string& segments_info) {
  return R"({"categories": [)" + categories() + R"(], "images": [], "annotations": [{"image_id": 1, "file_name": )" +
         R"("lights.png", "segments_info": [)" + segments_info + "]}]}";
}

io::Expected<io::LightAnnotation> read_annotation(
    const TemporaryFolder& folder, const std::string& json,
    io::LightAnnotationFormat format = io::LightAnnotationFormat::segments_ai) {
  put(folder / "lights.json", json);
  return io::read_light_annotation(format, folder / "lights.json", folder / "lights.png", {20, 10});
}

}  // namespace

TEST_CASE("light annotation: classes, states, explicit groups, ids of three bytes, the index plane") {
  const TemporaryFolder folder;
  put_bitmap(folder / "lights.png", {{2, 2, 6, 4, 70000}, {3, 3, 1, 1, 5}, {15, 0, 2, 2, 300}});
  const auto lights = read_annotation(
      folder, segments(entry(5, LightClass::inferred_object, R"("group": 70000, "state": "red")") + ", " +
                       entry(70000, LightClass::traffic_light_group, R"("note": "x")") + ", " +
                       entry(300, LightClass::street_light_lt, R"("group": null, "state": "white/unknown")")));
  require_ok(lights);
  const auto& marks = lights.value().marks;
  REQUIRE(marks.size() == 3);
  CHECK(marks[0].cls == LightClass::inferred_object);
  CHECK(marks[0].state == SignalState::red);
  CHECK(marks[0].group == 2);
  CHECK(marks[1].cls == LightClass::traffic_light_group);
  CHECK(marks[1].id == 70000);
  CHECK(marks[2].group == 0);
  CHECK(marks[2].state == SignalState::unknown);
  CHECK(lights.value().index(3, 3) == 1);
  CHECK(lights.value().index(4, 3) == 2);
  CHECK(lights.value().index(16, 1) == 3);
  CHECK(lights.value().index(10, 8) == 0);
}

TEST_CASE("light annotation: COCO panoptic says the same, attributes in the segment or below it") {
  const TemporaryFolder folder;
  put_bitmap(folder / "lights.png", {{2, 2, 6, 4, 70000}, {3, 3, 1, 1, 5}});
  const auto lights =
      read_annotation(folder,
                      panoptic(R"({"id": 5, "category_id": 112, "group": "70000", "state": "green"}, )" +
                               entry(70000, LightClass::traffic_light_group)),
                      io::LightAnnotationFormat::coco_panoptic);
  require_ok(lights);
  REQUIRE(lights.value().marks.size() == 2);
  CHECK(lights.value().marks[0].group == 2);
  CHECK(lights.value().marks[0].state == SignalState::green);
  CHECK(lights.value().index(3, 3) == 1);
}

TEST_CASE("light annotation: a source without a group joins the compatible one that overlaps most") {
  const TemporaryFolder folder;
  // A car (1) and a truck (2) side by side, the lamp (3) reaches further into the truck; the window (4) lies inside the
  // car but no car can hold it; the street lamp (5) touches nothing.
  put_bitmap(folder / "lights.png",
             {{0, 0, 8, 6, 1}, {8, 0, 8, 6, 2}, {6, 2, 6, 2, 3}, {1, 1, 2, 2, 4}, {18, 8, 1, 1, 5}, {17, 0, 2, 2, 6}});
  const auto lights = read_annotation(
      folder, segments(entry(1, LightClass::car_group) + "," + entry(2, LightClass::truck_group) + "," +
                       entry(3, LightClass::parked_rear) + "," + entry(4, LightClass::window_building) + "," +
                       entry(5, LightClass::street_light_ht) + "," + entry(6, LightClass::parked_front)));
  require_ok(lights);
  CHECK(lights.value().marks[2].group == 2);
  CHECK(lights.value().marks[3].group == 0);
  CHECK(lights.value().marks[4].group == 0);
  CHECK(lights.value().marks[5].group == 0);
}

TEST_CASE("which group holds which source") {
  CHECK(io::can_hold(LightClass::windows_group, LightClass::window_building));
  CHECK_FALSE(io::can_hold(LightClass::windows_group, LightClass::window_parked));
  CHECK(io::can_hold(LightClass::car_group, LightClass::moving_rear));
  CHECK_FALSE(io::can_hold(LightClass::car_group, LightClass::window_transport));
  CHECK(io::can_hold(LightClass::bus_group, LightClass::window_transport));
  CHECK(io::can_hold(LightClass::train_group, LightClass::window_transport));
  CHECK_FALSE(io::can_hold(LightClass::bicycle_group, LightClass::window_parked));
  CHECK(io::can_hold(LightClass::traffic_light_group, LightClass::inferred_object));
  CHECK_FALSE(io::can_hold(LightClass::traffic_light_group, LightClass::moving_front));
  for (int g = 0; g < kLightClassCount; ++g) {
    for (int s = 0; s < kLightClassCount; ++s) {
      const auto group = static_cast<LightClass>(g);
      const auto source = static_cast<LightClass>(s);
      if (!is_group(group) || is_group(source) || source == LightClass::none) CHECK_FALSE(io::can_hold(group, source));
    }
  }
}

TEST_CASE("light annotation: entries without pixels are kept, with a note") {
  const TemporaryFolder folder;
  put_bitmap(folder / "lights.png", {});
  const auto lights = read_annotation(folder, segments(entry(9, LightClass::clock)));
  require_ok(lights);
  CHECK(lights.value().marks.size() == 1);
  REQUIRE_FALSE(lights.value().notes.empty());
  CHECK(lights.value().notes.back().find("without pixels") != std::string::npos);
}

TEST_CASE("light annotation: names in another case or with underscores are the same class") {
  CHECK(io::detail::light_class_from_name("Inferred_Object") == LightClass::inferred_object);
  CHECK(io::detail::light_class_from_name("street-light-ht") == LightClass::street_light_ht);
  CHECK(io::detail::light_class_from_name("none") == LightClass::none);
  CHECK(io::detail::light_class_from_name("") == LightClass::none);
  CHECK(io::detail::signal_state_from_name("Yellow") == SignalState::amber);
}

TEST_CASE("light annotation: of several samples the one with the bitmap's name counts") {
  const TemporaryFolder folder;
  put_bitmap(folder / "lights.png", {{0, 0, 2, 2, 5}});
  const std::string other = R"(, {"labels": {"auto": null, "gt": {"attributes": {"annotations": [], )"
                            R"("segmentation_bitmap": {"url": "other.png"}}}}})";
  const auto lights = read_annotation(folder, segments(entry(5, LightClass::clock), other));
  require_ok(lights);
  CHECK(lights.value().marks.size() == 1);
  put_bitmap(folder / "third.png", {{0, 0, 2, 2, 5}});
  check_error(io::read_light_annotation(io::LightAnnotationFormat::segments_ai, folder / "lights.json",
                                        folder / "third.png", {20, 10}),
              "lights.json", "third.png");
}

TEST_CASE("light annotation: bad input ends in one line that names it") {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& json, const std::string& words) {
    check_error(read_annotation(folder, json), "lights.", words);
  };
  put_bitmap(folder / "lights.png", {{0, 0, 2, 2, 5}, {4, 3, 2, 2, 77}});
  refused(segments(entry(5, LightClass::clock)), "pixel (4, 3): has id 77");
  put_bitmap(folder / "lights.png", {{0, 0, 2, 2, 5}});
  refused(segments(R"({"id": 5, "category_id": 7})"), "'tree'");
  refused(segments(R"({"id": 5, "category_id": 999})"), "999");
  refused(segments(R"({"id": 5})"), "category_id");
  refused(segments(R"({"category_id": 101})"), "id");
  refused(segments(R"({"id": "5", "category_id": 101})"), "id");
  refused(segments(R"({"id": 5.5, "category_id": 101})"), "id");
  refused(segments(R"({"id": 0, "category_id": 101})"), "id");
  refused(segments(R"({"id": 16777216, "category_id": 101})"), "id");
  refused(segments(R"({"id": 18446744073709551615, "category_id": 101})"), "id");
  refused(segments(entry(5, LightClass::clock) + "," + entry(5, LightClass::clock)), "given twice");
  refused(segments(entry(5, LightClass::moving_rear, R"("group": 9)")), "attributes.group: is 9");
  refused(segments(entry(5, LightClass::moving_rear, R"("group": 6)") + "," + entry(6, LightClass::clock)),
          "group annotation");
  refused(segments(entry(5, LightClass::moving_rear, R"("group": "left")")), "left");
  refused(segments(entry(5, LightClass::moving_rear, R"("group": -1)")), "group");
  refused(segments(entry(5, LightClass::moving_rear, R"("group": [1])")), "group");
  refused(segments(entry(5, LightClass::clock, R"("state": 3)")), "state");
  refused(segments("17"), "annotations[0]");
  refused("{\"dataset\": 3}", "dataset");
  refused("{}", "dataset");
  refused("[]", "object");
  refused("", "empty");
  refused("{\"dataset\": {", "not valid JSON");
  refused("{\"a\": 1, \"a\": 2}", "twice");
  refused("{\"a\": 1e999}", "JSON");
  refused(std::string("\xFF\xFE\x00{", 4), "JSON");

  std::string many;
  for (std::uint32_t i = 1; i <= 65535; ++i) many += (i > 1 ? "," : "") + entry(i, LightClass::clock);
  refused(segments(many), "65534");
}

TEST_CASE("light annotation: truncated at every length") {
  const TemporaryFolder folder;
  put_bitmap(folder / "lights.png", {{0, 0, 2, 2, 5}});
  const std::string whole = segments(entry(5, LightClass::clock));
  require_ok(read_annotation(folder, whole));
  for (std::size_t length = 0; length < whole.size(); length += 7) {
    check_error(read_annotation(folder, whole.substr(0, length)), "lights.json");
  }
}

TEST_CASE("light annotation: a bitmap of another size or kind") {
  const TemporaryFolder folder;
  put_bitmap(folder / "lights.png", {}, {10, 10});
  check_error(read_annotation(folder, segments(entry(5, LightClass::clock))), "lights.png", "10x10");
  io::Image<std::uint8_t> grey({20, 10});
  require_ok(io::write_png(folder / "lights.png", grey.view()));
  check_error(read_annotation(folder, segments(entry(5, LightClass::clock))), "lights.png", "grey");
}

TEST_CASE("light shapes: rectangles and polygons, the last one on top, a sliver between centres, groups by overlap") {
  const TemporaryFolder folder;
  const std::string path = folder / "lights.json";
  put(path, R"({"lights": [
    {"class": "windows_group", "id": 40, "rectangle": [0, 0, 8, 8]},
    {"class": "window_building", "rectangle": [1, 1, 3, 4]},
    {"class": "window_building", "polygon": [[4, 1], [8, 1], [8, 5]], "id": 7},
    {"class": "street light_HT", "rectangle": [12.2, 3.1, 12.4, 3.3]},
    {"class": "inferred object", "polygon": [[15, 0], [25, 0], [25, 4], [15, 4]], "state": "red"}]})");
  const auto read = io::read_light_shapes(path, {20, 10});
  require_ok(read);
  const io::LightAnnotation& a = read.value();
  REQUIRE(a.marks.size() == 5);
  CHECK(a.marks[0].id == 40);
  CHECK(a.marks[1].id == 2);
  CHECK(a.marks[1].group == 1);
  CHECK(a.marks[2].id == 7);
  CHECK(a.marks[2].group == 1);
  CHECK(a.marks[4].state == SignalState::red);
  const auto count = [&](std::uint16_t position) {
    int n = 0;
    for (const std::uint16_t v : a.index.view().pixels()) n += v == position ? 1 : 0;
    return n;
  };
  CHECK(count(2) == 6);
  CHECK(a.index(1, 1) == 2);
  CHECK(a.index(2, 3) == 2);
  CHECK(a.index(3, 3) == 1);
  CHECK(count(3) == 10);  // half of 4 x 4 and the centres on the slanted side, which count as right of it
  CHECK(a.index(7, 2) == 3);
  CHECK(a.index(4, 3) == 1);
  CHECK(count(4) == 1);
  CHECK(a.index(12, 3) == 4);
  CHECK(count(5) == 20);  // cut at the image's border
  CHECK(a.index(19, 3) == 5);
}

TEST_CASE(
    "light annotation: the rim of a traffic light is no lens, the lens of a small one and of one without a head is") {
  const TemporaryFolder folder;
  const std::string path = folder / "lights.json";
  // A head of 16 x 32 with its rim and a lens in one mark, and one whose rim alone is marked; a far one of 5 x 11 whose
  // lens is 3 px wide; a lens with as good as no head.
  put(path, R"({"lights": [
    {"class": "traffic_light_group", "id": 1, "rectangle": [10, 10, 26, 42]},
    {"class": "inferred object", "id": 2, "group": 1, "rectangle": [10, 10, 26, 12]},
    {"class": "inferred object", "id": 3, "group": 1, "rectangle": [14, 15, 22, 23]},
    {"class": "traffic_light_group", "id": 4, "rectangle": [40, 10, 56, 42]},
    {"class": "inferred object", "id": 5, "group": 4, "rectangle": [54, 12, 56, 40]},
    {"class": "traffic_light_group", "id": 6, "rectangle": [70, 10, 75, 21]},
    {"class": "inferred object", "id": 7, "group": 6, "rectangle": [71, 11, 74, 14]},
    {"class": "traffic_light_group", "id": 8, "rectangle": [90, 10, 94, 11]},
    {"class": "inferred object", "id": 9, "group": 8, "rectangle": [90, 11, 94, 15]},
    {"class": "car_group", "id": 10, "rectangle": [10, 50, 40, 60]},
    {"class": "parked_rear", "id": 11, "group": 10, "rectangle": [10, 50, 13, 54]}]})");
  const auto read = io::read_light_shapes(path, {110, 64});
  require_ok(read);
  const io::LightAnnotation& lights = read.value();
  const auto pixels = [&](std::uint16_t mark) {
    int n = 0;
    for (int y = 0; y < 64; ++y) {
      for (int x = 0; x < 110; ++x) n += lights.index(x, y) == mark ? 1 : 0;
    }
    return n;
  };
  CHECK(pixels(2) == 0);
  CHECK(pixels(3) == 64);
  CHECK(pixels(1) == 16 * 32 - 64);
  CHECK(pixels(5) == 0);
  CHECK(pixels(7) == 9);
  CHECK(pixels(9) == 16);
  CHECK(pixels(11) == 12);  // a lamp at the corner of a car is one
  std::string all;
  for (const std::string& note : lights.notes) all += note + "; ";
  CHECK(all.find("2 parts of marks along the rims of traffic lights") != std::string::npos);
  CHECK(all.find("2 annotations without pixels: 2, 5") != std::string::npos);
}

TEST_CASE("light shapes: groups listed last lie below, ids that collide with positions, one lamp in two pieces") {
  const TemporaryFolder folder;
  const std::string path = folder / "lights.json";
  put(path, R"({"lights": [
    {"class": "parked_rear", "rectangle": [1, 1, 3, 3]},
    {"class": "parked_rear", "rectangle": [5, 1, 7, 3], "state": null},
    {"class": "inferred object", "id": 5, "rectangle": [10, 0, 12, 9]},
    {"class": "car_group", "id": 1, "rectangle": [0, 0, 8, 8]},
    {"class": "Inferred_Object", "id": 5, "group": 30, "state": "green", "rectangle": [14, 0, 16, 9]},
    {"class": "traffic_light_group", "id": 30, "rectangle": [18, 0, 19, 9]}]})");
  const auto read = io::read_light_shapes(path, {20, 10});
  require_ok(read);
  const io::LightAnnotation& a = read.value();
  REQUIRE(a.marks.size() == 5);
  CHECK(a.marks[3].id == 1);
  CHECK(a.marks[2].group == 5);  // as its second piece says
  CHECK(a.marks[2].state == SignalState::green);
  CHECK(a.marks[0].id == 7);  // 1 is the car's
  CHECK(a.marks[1].id == 2);
  CHECK(a.marks[0].group == 4);
  CHECK(a.marks[1].group == 4);
  CHECK(a.index(1, 1) == 1);
  CHECK(a.index(6, 2) == 2);
  CHECK(a.index(4, 4) == 4);
  CHECK(a.index(11, 5) == 3);
  CHECK(a.index(13, 5) == 0);
  CHECK(a.index(15, 5) == 3);
}

TEST_CASE("light shapes: bad input ends in one line that names it") {
  const TemporaryFolder folder;
  const std::string path = folder / "lights.json";
  const auto refused = [&](const std::string& entry, const std::string& words) {
    put(path, R"({"lights": [)" + entry + "]}");
    check_error(io::read_light_shapes(path, {20, 10}), "lights.json", words);
  };
  refused(R"({"class": "clock"})", "rectangle");
  refused(R"({"class": "clock", "rectangle": [1, 2, 3]})", "lights[0].rectangle");
  refused(R"({"class": "clock", "rectangle": [1, 2, 3, "4"]})", "numbers");
  refused(R"({"class": "clock", "rectangle": [1, 2, 3, 4], "polygon": []})", "one of the two");
  refused(R"({"class": "clock", "polygon": [[1, 2], [3, 4]]})", "three corners");
  refused(R"({"class": "clock", "polygon": [[1, 2], [3, 4], [5]]})", "polygon[2]");
  refused(R"({"class": "clock", "polygon": [[1, 2], [3, 4], [1e300, 5]]})", "numbers");
  refused(R"({"class": "lighthouse", "rectangle": [1, 2, 3, 4]})", "lighthouse");
  refused(R"({"class": "clock", "rectangle": [1, 2, 3, 4], "colour": 1})", "colour");
  refused(R"({"class": "lighthouse", "rectangle": [1, 2, 3, 4]})", "window_building, window_parked");
  refused(R"({"class": "inferred object", "state": "off", "rectangle": [1, 2, 3, 4]})", "lights[0].state: is 'off'");
  refused(R"({"class": "clock", "id": 2, "rectangle": [1, 2, 3, 4]},
             {"class": "car_group", "id": 2, "rectangle": [1, 2, 3, 4]})",
          "lights[1].id: is that of a clock");
  refused(R"({"class": "inferred object", "id": 2, "state": "red", "rectangle": [1, 2, 3, 4]},
             {"class": "inferred object", "id": 2, "state": "green", "rectangle": [5, 2, 6, 4]})",
          "lights[1].state: differs");
  refused(R"({"class": "parked_rear", "id": 2, "group": 3, "rectangle": [1, 2, 3, 4]},
             {"class": "parked_rear", "id": 2, "group": 4, "rectangle": [5, 2, 6, 4]},
             {"class": "car_group", "id": 3, "rectangle": [1, 2, 3, 4]},
             {"class": "car_group", "id": 4, "rectangle": [1, 2, 3, 4]})",
          "lights[1].group: differs");
  put(path, "{}");
  check_error(io::read_light_shapes(path, {20, 10}), "lights.json", "lights");
}
