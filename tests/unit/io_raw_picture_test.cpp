// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include "npsim/io/dng.hpp"
#include "npsim/io/raw_picture.hpp"
#include "unit/fixture.hpp"

namespace {

using namespace npsim;
namespace fs = std::filesystem;

const fs::path kFolder = fs::temp_directory_path() / "npsim_io_raw_picture_test";

struct Sample {
  npsim_test::Image<std::uint16_t> levels{{37, 21}};
  SensorParams sensor;
  CameraExposure exposure;
  RawPicture raw;
  Sample() {
    sensor.mosaic = Mosaic::grbg;
    sensor.bits = 12;
    sensor.black = 64;
    exposure.iso = 800;
    for (int y = 0; y < 21; ++y) {
      for (int x = 0; x < 37; ++x) levels(x, y) = static_cast<std::uint16_t>((x * 131 + y * 977) % 4096);
    }
    raw = {levels.view(), 4, {2, 1, 1.5F}, {1e-3F, 1e-6F}};
    fs::create_directories(kFolder);
  }
  ~Sample() { fs::remove_all(kFolder); }
};

std::vector<unsigned char> bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

struct Tag {
  unsigned type = 0;
  std::uint32_t count = 0;
  std::size_t at = 0;  // of the value
};

}  // namespace

TEST_CASE("raw picture: what is read is what was written, and the sidecar says how it was taken") {
  const Sample s;
  const std::string path = (kFolder / "night.raw").string();
  REQUIRE(io::write_raw(path, s.raw, s.sensor, s.exposure).ok());
  CHECK(fs::file_size(path) == 37 * 21 * 2);
  const auto read = io::read_raw(path);
  REQUIRE(read.ok());
  CHECK(read.value().black == 64);
  CHECK(read.value().white == 4095);
  CHECK(read.value().iso == 800);
  CHECK(read.value().headroom == 4);
  for (int y = 0; y < 21; ++y) {
    for (int x = 0; x < 37; ++x) CHECK(read.value().levels(x, y) == s.levels(x, y));
  }
  const auto json = io::read_json((kFolder / "night_raw.json").string());
  REQUIRE(json.ok());
  CHECK(json.value()["mosaic"] == "grbg");
  CHECK(json.value()["bits"] == 12);
  CHECK(json.value()["gains"][0] == 2);

  const std::string sidecar = (kFolder / "night_raw.json").string();
  nlohmann::ordered_json less = json.value();
  less["exposure"]["headroom"] = 0.5;
  std::ofstream(sidecar) << less;
  CHECK(io::read_raw(path).error().line().find("exposure.headroom: expected 1 or more") != std::string::npos);
  REQUIRE(io::write_raw(path, s.raw, s.sensor, s.exposure).ok());
  std::ofstream(path, std::ios::binary | std::ios::app) << 'x';
  CHECK(io::read_raw(path).error().line().find("expected 1554") != std::string::npos);
  fs::remove(kFolder / "night_raw.json");
  CHECK(io::read_raw(path).error().line().find("night_raw.json") != std::string::npos);
}

TEST_CASE("dng: tags ascend, levels, filters, matrix, neutral and noise are where they say, of odd sizes too") {
  const Sample s;
  const std::string path = (kFolder / "night.dng").string();
  REQUIRE(io::write_dng(path, s.raw, s.sensor, s.exposure).ok());
  const std::vector<unsigned char> bytes = bytes_of(path);
  const auto number = [&](std::size_t at, std::size_t size) {
    std::uint64_t v = 0;
    for (std::size_t i = 0; i < size; ++i) v |= static_cast<std::uint64_t>(bytes.at(at + i)) << (8 * i);
    return v;
  };
  REQUIRE(number(0, 2) == 0x4949);
  REQUIRE(number(2, 2) == 42);
  const auto directory = [&](std::size_t at) {
    std::map<unsigned, Tag> tags;
    unsigned before = 0;
    const std::size_t sizes[] = {0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8};
    for (std::size_t i = 0; i < number(at, 2); ++i) {
      const std::size_t e = at + 2 + 12 * i;
      const auto tag = static_cast<unsigned>(number(e, 2));
      CHECK(tag > before);
      before = tag;
      Tag t{static_cast<unsigned>(number(e + 2, 2)), static_cast<std::uint32_t>(number(e + 4, 4)), e + 8};
      if (sizes[t.type] * t.count > 4) t.at = number(e + 8, 4);
      CHECK(t.at + sizes[t.type] * t.count <= bytes.size());
      tags[tag] = t;
    }
    return tags;
  };
  auto tags = directory(number(4, 4));
  CHECK(number(tags[256].at, 4) == 37);
  CHECK(number(tags[257].at, 4) == 21);
  CHECK(number(tags[262].at, 2) == 32803);
  CHECK(number(tags[33422].at, 4) == 0x01020001);  // green red, blue green
  CHECK(number(tags[50717].at, 4) == 4095);
  CHECK(number(tags[50714].at, 4) == 6400);
  CHECK(number(tags[50728].at, 4) == 500000);
  CHECK(number(tags[50730].at, 4) == 20000);  // two stops
  const std::size_t strip = number(tags[273].at, 4);
  CHECK(number(tags[279].at, 4) == 37 * 21 * 2);
  REQUIRE(strip + 37 * 21 * 2 == bytes.size());
  for (int y = 0; y < 21; ++y) {
    for (int x = 0; x < 37; ++x) CHECK(number(strip + 2 * static_cast<std::size_t>(y * 37 + x), 2) == s.levels(x, y));
  }
  // The matrix takes daylight to what the response has of white.
  const double white[3] = {0.95047, 1, 1.08883};
  for (std::size_t row = 0; row < 3; ++row) {
    double sum = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      sum += white[c] * static_cast<std::int32_t>(number(tags[50721].at + 8 * (3 * row + c), 4)) / 1e4;
    }
    const Vec3f& r = s.sensor.response[row];
    CHECK(sum == doctest::Approx(static_cast<double>(r.x + r.y + r.z)).epsilon(1e-3));
  }
  double beta1 = 0;
  const std::uint64_t bits = number(tags[51041].at, 8);
  std::memcpy(&beta1, &bits, 8);
  CHECK(beta1 == doctest::Approx(1e-3));
  auto exif = directory(number(tags[34665].at, 4));
  CHECK(number(exif[34855].at, 2) == 800);
  CHECK(number(exif[33434].at, 4) == 33333);
  CHECK_FALSE(io::write_dng(path, {}, s.sensor, s.exposure).ok());
}
