// SPDX-License-Identifier: Apache-2.0
// Boxes of ids against a search for their pixels, and what the COCO file says of them, decoded again.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include <unistd.h>

#include <nlohmann/json.hpp>

#include "npsim/core/random.hpp"
#include "npsim/io/coco.hpp"
#include "npsim/labels/boxes.hpp"
#include "unit/fixture.hpp"

namespace {

namespace fs = std::filesystem;
using namespace npsim;
using Ids = npsim_test::Image<std::uint16_t>;

Ids random_ids(Shape shape, int most, std::uint32_t seed) {
  Ids ids(shape, 0, 3, 1);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      RandomStream random(seed, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * shape.width + x), 0);
      // Some ids are rare, so that their boxes are not the whole picture.
      const float u = random.uniform();
      ids(x, y) = static_cast<std::uint16_t>(u * u * u * static_cast<float>(most + 1));
    }
  }
  return ids;
}

nlohmann::json written(const io::CocoWriter& writer) {
  const fs::path path = fs::temp_directory_path() / ("npsim_coco_" + std::to_string(getpid()) + ".json");
  REQUIRE(writer.write(path.string()).ok());
  std::ifstream file(path);
  nlohmann::json json = nlohmann::json::parse(file);
  file.close();
  fs::remove(path);
  return json;
}

std::vector<bool> decoded(const nlohmann::json& segmentation) {
  std::vector<bool> mask;  // column by column
  bool inside = false;
  for (const std::size_t run : segmentation["counts"]) {
    mask.insert(mask.end(), run, inside);
    inside = !inside;
  }
  return mask;
}

}  // namespace

TEST_CASE("boxes: those of every id as a search for its pixels finds them; ids beyond are passed over") {
  for (const Shape shape : {Shape{1, 1}, Shape{1, 9}, Shape{13, 1}, Shape{37, 23}}) {
    const Ids ids = random_ids(shape, 40, 5);
    std::vector<LabelBox> boxes(30);
    label_boxes(ids.view(), Span<LabelBox>(boxes.data(), boxes.size()));
    for (int id = 0; id < 30; ++id) {
      LabelBox plain;
      plain.left = plain.top = 1000;
      plain.right = plain.bottom = -1;
      for (int y = 0; y < shape.height; ++y) {
        for (int x = 0; x < shape.width; ++x) {
          if (ids(x, y) != id) continue;
          plain.left = std::min(plain.left, x);
          plain.right = std::max(plain.right, x);
          plain.top = std::min(plain.top, y);
          plain.bottom = std::max(plain.bottom, y);
          ++plain.pixels;
        }
      }
      const LabelBox& box = boxes[static_cast<std::size_t>(id)];
      CHECK(box.pixels == plain.pixels);
      if (plain.pixels == 0) {
        CHECK(box.left > box.right);
        continue;
      }
      CHECK(box.left == plain.left);
      CHECK(box.right == plain.right);
      CHECK(box.top == plain.top);
      CHECK(box.bottom == plain.bottom);
    }
  }
}

TEST_CASE("coco: boxes, areas and masks of every id come back, at borders and over whole columns too") {
  std::vector<Ids> pictures;
  pictures.push_back(random_ids({19, 11}, 12, 1));
  pictures.push_back(Ids({6, 4}, std::uint16_t{3}));  // nothing but the object
  pictures.push_back(Ids({4, 3}, {0, 5, 5, 0, 0, 5, 5, 0, 0, 5, 5, 0}));
  pictures.push_back(Ids({1, 1}, {9}));
  for (const Ids& ids : pictures) {
    const Shape shape = ids.shape();
    std::vector<LabelBox> boxes(13);
    label_boxes(ids.view(), Span<LabelBox>(boxes.data(), boxes.size()));
    io::CocoWriter writer;
    writer.add_category(26, "car", "object");
    writer.add_image(4, "night_004.png", shape);
    std::vector<std::uint16_t> of;
    for (std::uint16_t id = 1; id < 13; ++id) {
      if (boxes[id].pixels == 0) continue;
      writer.add_annotation(4, 26, ids.view(), id, boxes[id], {{"lit", true}});
      of.push_back(id);
    }
    const nlohmann::json json = written(writer);
    CHECK(json["images"][0]["height"] == shape.height);
    CHECK(json["categories"][0]["name"] == "car");
    REQUIRE(json["annotations"].size() == of.size());
    for (std::size_t i = 0; i < of.size(); ++i) {
      const nlohmann::json& a = json["annotations"][i];
      const LabelBox& box = boxes[of[i]];
      CHECK(a["id"] == i + 1);
      CHECK(a["image_id"] == 4);
      CHECK(a["lit"] == true);
      CHECK(a["bbox"] == nlohmann::json({box.left, box.top, box.right - box.left + 1, box.bottom - box.top + 1}));
      const std::vector<bool> mask = decoded(a["segmentation"]);
      REQUIRE(mask.size() == shape.pixels());
      CHECK(a["segmentation"]["size"] == nlohmann::json({shape.height, shape.width}));
      std::size_t area = 0;
      for (int x = 0; x < shape.width; ++x) {
        for (int y = 0; y < shape.height; ++y) {
          const bool in = mask[static_cast<std::size_t>(x * shape.height + y)];
          CHECK(in == (ids(x, y) == of[i]));
          area += in;
        }
      }
      CHECK(a["area"] == area);
      // Only the first run may be empty.
      const std::vector<std::size_t> counts = a["segmentation"]["counts"];
      CHECK(std::count(counts.begin() + 1, counts.end() - 1, 0U) == 0);
    }
  }
}

TEST_CASE("coco: nothing in it is a valid file") {
  const nlohmann::json json = written(io::CocoWriter());
  CHECK(json["images"].is_array());
  CHECK(json["annotations"].is_array());
  CHECK(json["annotations"].empty());
}
