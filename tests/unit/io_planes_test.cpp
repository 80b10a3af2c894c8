// SPDX-License-Identifier: Apache-2.0
// Depth, labels, instances, normals and cameras.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include "io_fixture.hpp"
#include "npsim/io/detail/camera.hpp"
#include "npsim/io/detail/depth.hpp"
#include "npsim/io/detail/labels.hpp"
#include "npsim/io/detail/normals.hpp"

namespace {

using namespace npsim;
using io_test::check_error;
using io_test::put;
using io_test::require_ok;
using io_test::TemporaryFolder;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

template <class T>
io::Image<T> row(std::initializer_list<T> values) {
  io::Image<T> image({static_cast<int>(values.size()), 1});
  std::size_t i = 0;
  for (const T v : values) image.data()[i++] = v;
  return image;
}

std::string row_u16(const TemporaryFolder& folder, const std::string& name, std::initializer_list<std::uint16_t> v) {
  require_ok(io::write_png16(folder / name, row<std::uint16_t>(v).view()));
  return folder / name;
}
std::string row_u8(const TemporaryFolder& folder, const std::string& name, std::initializer_list<std::uint8_t> v) {
  require_ok(io::write_png(folder / name, row<std::uint8_t>(v).view()));
  return folder / name;
}
std::string row_f32(const TemporaryFolder& folder, const std::string& name, std::initializer_list<float> v) {
  require_ok(io::write_pfm(folder / name, row<float>(v).view()));
  return folder / name;
}

io::Expected<io::Camera> camera_from(const TemporaryFolder& folder, const std::string& json) {
  put(folder / "scene.json", json);
  const auto parsed = io::read_json(folder / "scene.json");
  if (!parsed) return parsed.error();
  const auto object = io::JsonObject::of(folder / "scene.json", "camera", parsed.value());
  if (!object) return object.error();
  return io::camera_from_json(object.value(), {200, 100});
}

}  // namespace

TEST_CASE("depth in metres: NaN, infinite and negative become 0 and are counted apart from missing") {
  const TemporaryFolder folder;
  const std::string path = row_f32(folder, "d.pfm", {1.5F, 0.0F, -2.0F, kNan, kInf, -kInf, -0.0F, 1e-30F});
  io::DepthCounts counts;
  const auto depth = io::read_depth(path, {}, {}, &counts);
  require_ok(depth);
  CHECK(depth.value()(0, 0) == 1.5F);
  CHECK(depth.value()(7, 0) == 1e-30F);
  for (int x = 1; x < 7; ++x) CHECK(depth.value()(x, 0) == 0.0F);
  CHECK(counts.valid == 2);
  CHECK(counts.missing == 2);
  CHECK(counts.refused == 4);
}

TEST_CASE("depth as uint16: KITTI's 1/256 m and millimetres") {
  const TemporaryFolder folder;
  const std::string path = row_u16(folder, "d.png", {0, 1, 256, 2560, 65535});
  const auto kitti = io::read_depth(path, {io::DepthEncoding::uint16, 1.0 / 256, 0, 0});
  require_ok(kitti);
  CHECK(kitti.value()(0, 0) == 0.0F);
  CHECK(kitti.value()(2, 0) == 1.0F);
  CHECK(kitti.value()(4, 0) == 255.99609375F);
  const auto mm = io::read_depth(path, {io::DepthEncoding::uint16, 0.001, 0, 0});
  require_ok(mm);
  CHECK(mm.value()(3, 0) == doctest::Approx(2.56));
  check_error(io::read_depth(path, {io::DepthEncoding::uint16, 0, 0, 0}), "d.png", "scale");
  check_error(io::read_depth(path, {io::DepthEncoding::uint16, -1, 0, 0}), "d.png", "scale");
}

TEST_CASE("depth from Cityscapes disparity: 0 is missing, 1 is infinitely far") {
  const TemporaryFolder folder;
  const std::string path = row_u16(folder, "d.png", {0, 1, 2, 257, 25601});
  io::DepthCounts counts;
  const auto depth = io::read_depth(path, {io::DepthEncoding::cityscapes_disparity, 0, 0.2, 2000}, {}, &counts);
  require_ok(depth);
  CHECK(depth.value()(0, 0) == 0.0F);
  CHECK(depth.value()(1, 0) == 0.0F);
  CHECK(depth.value()(2, 0) == doctest::Approx(0.2 * 2000 * 256));
  CHECK(depth.value()(3, 0) == doctest::Approx(400.0));
  CHECK(depth.value()(4, 0) == doctest::Approx(4.0));
  CHECK(counts.missing == 1);
  CHECK(counts.refused == 1);
  check_error(io::read_depth(path, {io::DepthEncoding::cityscapes_disparity, 0, 0, 2000}), "d.png", "baseline");
}

TEST_CASE("depth without one valid pixel is an error, in every encoding") {
  const TemporaryFolder folder;
  check_error(io::read_depth(row_f32(folder, "d.pfm", {0, kNan, -1}), {}), "d.pfm", "none of 3");
  const std::string zero = row_u16(folder, "d.png", {0, 0});
  check_error(io::read_depth(zero, {io::DepthEncoding::uint16, 1, 0, 0}), "d.png", "none of 2");
  const std::string far = row_u16(folder, "far.png", {0, 1});
  check_error(io::read_depth(far, {io::DepthEncoding::cityscapes_disparity, 0, 1, 1}), "far.png", "none of 2");
}

TEST_CASE("depth: numbers beyond float are refused pixels, not undefined behaviour") {
  const TemporaryFolder folder;
  const std::string header = "{'descr': '<f8', 'fortran_order': False, 'shape': (1, 2), }\n";
  const double values[2] = {1e300, 7.5};
  std::string bytes("\x93NUMPY\x01", 7);
  bytes += {'\0', static_cast<char>(header.size()), '\0'};
  put(folder / "d.npy", bytes + header + std::string(reinterpret_cast<const char*>(values), 16));
  io::DepthCounts counts;
  const auto depth = io::read_depth(folder / "d.npy", {}, {}, &counts);
  require_ok(depth);
  CHECK(depth.value()(0, 0) == 0.0F);
  CHECK(depth.value()(1, 0) == 7.5F);
  CHECK(counts.refused == 1);
}

TEST_CASE("depth: a file of the wrong kind says which encoding fits") {
  const TemporaryFolder folder;
  check_error(io::read_depth(row_u16(folder, "d.png", {5}), {}), "d.png", "encoding uint16");
  check_error(io::read_depth(row_f32(folder, "d.pfm", {5}), {io::DepthEncoding::uint16, 1, 0, 0}), "d.pfm", "PFM");
  check_error(io::read_depth(folder.path(), {}), folder.path(), "folder");
  check_error(io::read_depth(folder / "absent.pfm", {}), "absent.pfm");
}

TEST_CASE("labels: label ids, train ids and instance ids; what is unknown is counted") {
  const TemporaryFolder folder;
  std::size_t unknown = 0;
  const std::string ids = row_u8(folder, "ids.png", {7, 33, 34, 255, 0});
  const auto by_id = io::read_labels(ids, io::LabelEncoding::cityscapes_label_ids, {}, &unknown);
  require_ok(by_id);
  CHECK(by_id.value()(0, 0) == label::road);
  CHECK(by_id.value()(1, 0) == label::bicycle);
  CHECK(by_id.value()(2, 0) == label::unlabeled);
  CHECK(by_id.value()(3, 0) == label::unlabeled);
  CHECK(unknown == 1);

  const std::string train = row_u8(folder, "train.png", {0, 10, 18, 19, 255});
  const auto by_train = io::read_labels(train, io::LabelEncoding::cityscapes_train_ids, {}, &unknown);
  require_ok(by_train);
  CHECK(by_train.value()(0, 0) == label::road);
  CHECK(by_train.value()(1, 0) == label::sky);
  CHECK(by_train.value()(2, 0) == label::bicycle);
  CHECK(by_train.value()(4, 0) == label::unlabeled);
  CHECK(unknown == 1);

  const std::string objects = row_u16(folder, "objects.png", {7, 26, 26000, 26004, 33999, 40000});
  const auto by_object = io::read_labels(objects, io::LabelEncoding::cityscapes_instance_ids, {}, &unknown);
  require_ok(by_object);
  CHECK(by_object.value()(0, 0) == label::road);
  CHECK(by_object.value()(1, 0) == label::car);
  CHECK(by_object.value()(2, 0) == label::car);
  CHECK(by_object.value()(4, 0) == label::bicycle);
  CHECK(unknown == 1);
  const auto instances = io::read_instances(objects, io::LabelEncoding::cityscapes_instance_ids);
  require_ok(instances);
  CHECK(instances.value()(1, 0) == 0);  // a crowd is no object
  CHECK(instances.value()(2, 0) == 26000);
  CHECK(instances.value()(3, 0) == 26004);
  const auto plain = io::read_instances(objects, io::LabelEncoding::ids);
  require_ok(plain);
  CHECK(plain.value()(1, 0) == 26);
}

TEST_CASE("labels: wrong types and encodings that do not fit") {
  const TemporaryFolder folder;
  io::Image<Rgb8> colours({2, 2});
  require_ok(io::write_png(folder / "colour.png", colours.view()));
  check_error(io::read_labels(folder / "colour.png", io::LabelEncoding::cityscapes_label_ids), "colour.png",
              "3-channel");
  const std::string floats = row_f32(folder, "labels.pfm", {1});
  check_error(io::read_labels(floats, io::LabelEncoding::cityscapes_label_ids), "labels.pfm", "PFM");
  const std::string good = row_u8(folder, "ids.png", {7});
  check_error(io::read_labels(good, io::LabelEncoding::ids), "ids.png", "encoding");
  check_error(io::read_instances(good, io::LabelEncoding::cityscapes_label_ids), "ids.png", "encoding");
  check_error(io::label_encoding("scene.json", "labels.encoding", "cityscape_ids"), "scene.json", "cityscape_ids");
}

TEST_CASE("normals: PNG maps 0..255 to -1..1, black is none; NaN in a PFM becomes none") {
  const TemporaryFolder folder;
  io::Image<Rgb8> png({3, 1});
  png(0, 0) = {255, 0, 128};
  png(2, 0) = {128, 128, 0};
  require_ok(io::write_png(folder / "n.png", png.view()));
  const auto read = io::read_raw_normals(folder / "n.png");
  require_ok(read);
  CHECK(read.value()(0, 0).x == doctest::Approx(1.0));
  CHECK(read.value()(0, 0).y == doctest::Approx(-1.0));
  CHECK(read.value()(0, 0).z == doctest::Approx(2.0 * 128 / 255 - 1));
  CHECK(length(read.value()(1, 0)) == 0.0F);

  io::Image<Vec3f> pfm({2, 1});
  pfm(0, 0) = {0, kNan, -1};
  pfm(1, 0) = {0.6F, 0, -0.8F};
  require_ok(io::write_pfm(folder / "n.pfm", pfm.view()));
  const auto floats = io::read_raw_normals(folder / "n.pfm");
  require_ok(floats);
  CHECK(length(floats.value()(0, 0)) == 0.0F);
  CHECK(floats.value()(1, 0).x == 0.6F);
  check_error(io::read_raw_normals(row_u8(folder, "grey.png", {7})), "grey.png", "8-bit grey");
  check_error(io::read_raw_normals(row_f32(folder, "one.pfm", {7})), "one.pfm", "expected 3");
}

TEST_CASE("camera: three forms, and pixel centres at +0.5 in all of them") {
  const TemporaryFolder folder;
  auto camera =
      camera_from(folder, R"({"fx": 100, "fy": 110, "cx": 99.5, "cy": 49.5, "pixel_centre": 0, "baseline": 0.3})");
  require_ok(camera);
  CHECK(camera.value().intrinsics.cx == 100.0F);
  CHECK(camera.value().intrinsics.cy == 50.0F);
  CHECK(camera.value().intrinsics.fy == 110.0F);
  CHECK(camera.value().baseline_m == 0.3);
  CHECK(camera.value().note.find("0.5") != std::string::npos);

  camera = camera_from(folder, R"({"fx": 100, "fy": 110, "cx": 99.5, "cy": 49.5})");
  require_ok(camera);
  CHECK(camera.value().intrinsics.cx == 99.5F);
  CHECK(camera.value().note.empty());

  camera = camera_from(folder, R"({"horizontal_fov_deg": 90})");
  require_ok(camera);
  CHECK(camera.value().intrinsics.fx == doctest::Approx(100.0));
  CHECK(camera.value().intrinsics.cy == 50.0F);

  CHECK(camera.value().height_m == 0);

  put(folder / "camera.json", R"({"extrinsic": {"baseline": 0.21, "pitch": 0.03, "z": 1.22}, "intrinsic": )"
                              R"({"fx": 90, "fy": 91, "u0": 100, "v0": 40}})");
  camera = camera_from(folder, R"({"cityscapes": "camera.json"})");
  require_ok(camera);
  CHECK(camera.value().intrinsics.cx == 100.5F);
  CHECK(camera.value().baseline_m == 0.21);
  CHECK(camera.value().height_m == 1.22);
  camera = camera_from(folder, R"({"cityscapes": "camera.json", "height_m": 1.3})");
  require_ok(camera);
  CHECK(camera.value().height_m == 1.3);
}

TEST_CASE("camera: what is missing, misspelt or impossible is named") {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& json, const std::string& words) {
    check_error(camera_from(folder, json), "scene.json", words);
  };
  refused(R"({"fx": 1, "fy": 1, "cx": 1})", "camera.cy");
  refused(R"({"fx": 1, "fy": 1, "cx": 1, "cy": 1, "pixel_center": 0})", "camera.pixel_center");
  refused(R"({"fx": "1", "fy": 1, "cx": 1, "cy": 1})", "camera.fx");
  refused(R"({"fx": 0, "fy": 1, "cx": 1, "cy": 1})", "camera.fx");
  refused(R"({"fx": 1e300, "fy": 1, "cx": 1, "cy": 1})", "camera.fx");
  refused(R"({"fx": 1, "fy": 1, "cx": 1, "cy": 1, "pixel_centre": 1})", "camera.pixel_centre");
  refused(R"({"fx": 1, "fy": 1, "cx": 1, "cy": 1, "baseline": -1})", "camera.baseline");
  refused(R"({"fx": 1, "fy": 1, "cx": 1, "cy": 1, "height_m": 0})", "camera.height_m");
  refused(R"({"horizontal_fov_deg": 60, "height_m": 1400})", "camera.height_m");
  refused(R"({"horizontal_fov_deg": 180})", "camera.horizontal_fov_deg");
  refused(R"({"horizontal_fov_deg": null})", "camera.horizontal_fov_deg");
  refused(R"({"horizontal_fov_deg": 60, "cityscapes": "camera.json"})", "camera.cityscapes");
  refused(R"({})", "camera.fx");
  refused(R"([1, 2])", "camera");
  put(folder / "camera.json", R"({"intrinsic": {"fx": 90, "fy": 91, "u0": 100}})");
  check_error(camera_from(folder, R"({"cityscapes": "camera.json"})"), "camera.json", "intrinsic.v0");
  check_error(camera_from(folder, R"({"cityscapes": "absent.json"})"), "absent.json", "does not exist");
}
