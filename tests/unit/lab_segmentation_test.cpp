// SPDX-License-Identifier: Apache-2.0
// npsim evaluate --prediction: which files belong together, and what is refused.
#include <doctest/doctest.h>

#ifdef NPSIM_TOOL

#include <cstdint>
#include <string>

#include "npsim/io/image.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "tool_fixture.hpp"

using namespace tool_test;

namespace {

using namespace npsim;

// A folder of its own for each case.
struct Folders {
  fs::path root;
  explicit Folders(const std::string& name) : root(fixture().out("segmentation_" + name)) {
    fs::remove_all(root);
    fs::create_directories(root);
  }
  void put(const std::string& file, Shape shape, std::uint8_t left, std::uint8_t right) const {
    io::Image<std::uint8_t> image(shape, left);
    for (int y = 0; y < shape.height; ++y) {
      for (int x = shape.width / 2; x < shape.width; ++x) image(x, y) = right;
    }
    fs::create_directories((root / file).parent_path());
    REQUIRE(io::write_png((root / file).string(), std::as_const(image).view()).ok());
  }
  [[nodiscard]] std::string arguments(const std::string& more = "") const {
    return "evaluate --prediction '" + (root / "p").string() + "' --labels '" + (root / "l").string() + "' -o '" +
           (root / "out/f.json").string() + "' " + more;
  }
  [[nodiscard]] nlohmann::json figures() const { return json_of(root / "out/f.json"); }
};

constexpr Shape kLabelShape{8, 5};

}  // namespace

TEST_CASE("segmentation: Cityscapes' names in city folders, label ids, IoU of both classes") {
  const Folders f("cityscapes");
  f.put("l/aachen/aachen_000001_000019_gtFine_labelIds.png", kLabelShape, 7, 26);
  f.put("l/aachen/aachen_000001_000019_gtFine_instanceIds.png", kLabelShape, 7, 26);  // are no labels
  f.put("l/bonn/bonn_000002_000019_gtFine_labelIds.png", kLabelShape, 7, 4);          // static is not judged
  f.put("p/aachen_000001_000019_leftImg8bit.png", kLabelShape, 7, 7);
  f.put("p/bonn_000002_000019_leftImg8bit_pred.png", kLabelShape, 7, 26);
  const Run run = run_tool(f.arguments());
  REQUIRE_MESSAGE(run.status == 0, run.output);
  const nlohmann::json json = f.figures();
  CHECK(json["images"] == 2);
  CHECK(json["classes"]["road"]["iou"] == doctest::Approx(40.0 / 60));
  CHECK(json["classes"]["car"]["iou"] == 0.0);
  CHECK(json["classes"]["sky"]["iou"].is_null());
  CHECK(json["mean_iou"] == doctest::Approx(1.0 / 3));
  CHECK(json["mean_uiou"].is_null());
}

TEST_CASE("segmentation: ACDC's names, train ids, invalid masks and confidence") {
  const Folders f("acdc");
  f.put("l/GOPR0122/GOPR0122_frame_000161_gt_labelTrainIds.png", kLabelShape, 0, 13);
  f.put("l/GOPR0122/GOPR0122_frame_000161_gt_invIds.png", kLabelShape, 0, 1);
  f.put("p/GOPR0122_frame_000161_rgb_anon.png", kLabelShape, 0, 10);
  f.put("c/GOPR0122_frame_000161_rgb_anon_conf.png", kLabelShape, 255, 128);
  REQUIRE(run_tool(f.arguments()).status == 0);
  CHECK(f.figures()["mean_uiou"] == f.figures()["mean_iou"]);  // nothing was predicted invalid
  CHECK(f.figures()["classes"]["sky"]["iou"] == 0.0);          // predicted where it is not
  const Run run = run_tool(f.arguments("--confidence '" + (f.root / "c").string() + "'"));
  REQUIRE_MESSAGE(run.status == 0, run.output);
  const nlohmann::json json = f.figures();
  REQUIRE(json["by_threshold"].size() == 19);
  CHECK(json["by_threshold"][0]["mean_uiou"] == doctest::Approx(1.0 / 3));  // road, no car, wrong sky
  CHECK(json["by_threshold"][18]["mean_uiou"] == 1.0);                      // gives up on the car, rightly
  CHECK(json["by_threshold"][18]["mean_iou"] == 0.5);
  CHECK(json["mean_uiou_over_thresholds"] == doctest::Approx((9 * 1.0 / 3 + 10) / 19));
}

TEST_CASE("segmentation: predictions of the other kind of ids, and masks in a folder of their own") {
  const Folders f("ids");
  f.put("l/a_labelIds.png", kLabelShape, 7, 26);
  f.put("p/a.png", kLabelShape, 0, 13);
  REQUIRE(run_tool(f.arguments("--ids train")).status == 0);
  CHECK(f.figures()["mean_iou"] == 1.0);
  REQUIRE(run_tool(f.arguments()).status == 0);
  CHECK(f.figures()["mean_iou"] == 0.0);
  f.put("p/a.png", kLabelShape, 0, 255);
  f.put("m/a_invIds.png", kLabelShape, 0, 255);
  REQUIRE(run_tool(f.arguments("--ids train --invalid '" + (f.root / "m").string() + "'")).status == 0);
  CHECK(f.figures()["mean_iou"] == 0.5);
  CHECK(f.figures()["mean_uiou"] == 1.0);
  f.put("p/a.png", kLabelShape, 0, 26);
  check_refused(run_tool(f.arguments("--ids train")), "p/a.png: pixel (4, 0): is 26, expected a train id");
}

TEST_CASE("segmentation: a missing, a wrongly sized, an extra and a doubled file are refused by name") {
  const Folders f("refused");
  f.put("l/a_gt_labelIds.png", kLabelShape, 7, 26);
  f.put("l/b_gt_labelIds.png", kLabelShape, 7, 26);
  f.put("p/a.png", kLabelShape, 7, 26);
  const std::string output = (f.root / "out").string();
  check_refused(run_tool(f.arguments()), "b_gt_labelIds.png: has no prediction", output);
  f.put("p/b.png", {8, 4}, 7, 26);
  check_refused(run_tool(f.arguments()), "p/b.png: size: 8x4 pixels, expected 8x5", output);
  f.put("p/b.png", kLabelShape, 7, 26);
  f.put("p/c.png", kLabelShape, 7, 26);
  check_refused(run_tool(f.arguments()), "p/c.png: is a prediction without labels", output);
  fs::remove(f.root / "p/c.png");
  f.put("p/deeper/b_pred.png", kLabelShape, 7, 26);
  check_refused(run_tool(f.arguments()), "is of the same picture as", output);
  fs::remove(f.root / "p/deeper/b_pred.png");
  f.put("l/a_gt_invIds.png", kLabelShape, 0, 1);
  check_refused(run_tool(f.arguments()), "b_gt_labelIds.png: has no mask of invalid pixels", output);
  f.put("l/b_gt_invIds.png", {7, 5}, 0, 1);
  check_refused(run_tool(f.arguments()), "b_gt_invIds.png: size: 7x5", output);
  f.put("l/b_gt_invIds.png", kLabelShape, 0, 1);
  CHECK(run_tool(f.arguments()).status == 0);
}

TEST_CASE("segmentation: folders that are none or hold no labels, options that miss each other, outputs over inputs") {
  const Folders f("folders");
  f.put("p/a.png", kLabelShape, 7, 26);
  check_refused(run_tool(f.arguments()), "--labels: cannot be read");
  fs::create_directories(f.root / "l");
  check_refused(run_tool(f.arguments()), "expected files that end in labelIds.png");
  f.put("l/a_labelIds.png", kLabelShape, 7, 26);
  const std::string prediction = "--prediction '" + (f.root / "p").string() + "'";
  check_refused(run_tool("evaluate " + prediction), "--labels: is missing");
  check_refused(run_tool("evaluate --labels '" + (f.root / "l").string() + "'"), "--prediction");
  check_refused(run_tool("evaluate"), "scene: is missing");
  check_refused(run_tool("evaluate '" + fixture().street + "' " + prediction), "--prediction");
  check_refused(run_tool("evaluate " + prediction + " --labels '" + (f.root / "l").string() + "' -o '" +
                         (f.root / "p/a.png").string() + "'"),
                "would be written over");
}

#endif
