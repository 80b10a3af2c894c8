// SPDX-License-Identifier: Apache-2.0
// A generated street written as a scene folder is read back as what it was.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "street/street.hpp"
#include "street/write.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/io/obj.hpp"
#include "npsim/io/pfm.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/io/scene.hpp"

namespace {

namespace io = npsim::io;
namespace street = npsim::street;

// A folder of its own that goes away with the test.
struct Folder {
  std::string path;
  Folder() {
    const std::filesystem::path base = std::filesystem::temp_directory_path();
    for (int i = 0; path.empty() && i < 1000; ++i) {
      const std::filesystem::path p = base / ("npsim_street_test_" + std::to_string(i));
      std::error_code code;
      if (std::filesystem::create_directory(p, code)) path = p.string();
    }
  }
  ~Folder() {
    std::error_code code;
    std::filesystem::remove_all(path, code);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
};

}  // namespace

TEST_CASE("street: a written folder reads back with the same planes, marks and groups") {
  street::StreetParams params;
  params.shape = {240, 135};
  params.samples = 1;
  params.sky_rays = 0;
  auto s = std::make_unique<street::Street>();
  npsim::SerialExecutor executor;
  REQUIRE(street::make_street(params, executor, *s).ok());
  const Folder folder;
  REQUIRE(!folder.path.empty());
  const io::Outcome written = street::write_street(*s, folder.path);
  REQUIRE_MESSAGE(written.ok(), (written.ok() ? std::string() : written.error().line()));
  const std::size_t n = params.shape.pixels();

  const auto image = io::read_rgb8(folder.path + "/image.png");
  REQUIRE(image.ok());
  CHECK(std::memcmp(image.value().data(), s->image.data(), n * sizeof(npsim::Rgb8)) == 0);
  const auto instances = io::read_u16(folder.path + "/instances.png");
  REQUIRE(instances.ok());
  CHECK(std::memcmp(instances.value().data(), s->instances.data(), n * sizeof(std::uint16_t)) == 0);
  const auto truth = io::read_pfm(folder.path + "/truth/depth.pfm");
  REQUIRE(truth.ok());
  CHECK(std::memcmp(truth.value().data(), s->depth.data(), n * sizeof(float)) == 0);
  const auto background = io::read_pfm(folder.path + "/truth/background_depth.pfm");
  REQUIRE(background.ok());
  CHECK(std::memcmp(background.value().data(), s->background_depth.data(), n * sizeof(float)) == 0);
  const auto estimate = io::read_pfm_rgb(folder.path + "/normals.pfm");
  REQUIRE(estimate.ok());
  CHECK(std::memcmp(estimate.value().data(), s->est_normals.data(), n * sizeof(npsim::Vec3f)) == 0);

  SUBCASE("the mesh reads back with all its faces") {
    const auto mesh = io::read_obj(folder.path + "/truth/street.obj");
    REQUIRE_MESSAGE(mesh.ok(), (mesh.ok() ? std::string() : mesh.error().line()));
    CHECK(mesh.value().faces.size() == s->faces.size());
  }
  SUBCASE("the scene reader takes the folder") {
    const auto scene = io::read_scene(folder.path);
    REQUIRE_MESSAGE(scene.ok(), (scene.ok() ? std::string() : scene.error().line()));
    CHECK(scene.value().lights.size() == s->marks.size());
    const auto behind = io::read_truth_background_depth(scene.value());
    REQUIRE(behind.ok());
    CHECK(std::memcmp(behind.value().data(), s->background_depth.data(), n * sizeof(float)) == 0);
    CHECK(std::fabs(scene.value().intrinsics.fx - s->intrinsics.fx) < 1e-3F);
    CHECK(std::memcmp(scene.value().depth.data(), s->est_depth.data(), n * sizeof(float)) == 0);
    CHECK(std::memcmp(scene.value().labels.data(), s->labels.data(), n) == 0);
    REQUIRE(scene.value().lights.size() == s->marks.size());
    int differing = 0;
    for (std::size_t i = 0; i < s->marks.size(); ++i) {
      const npsim::LightMark& a = scene.value().lights[i];
      const npsim::LightMark& b = s->marks[i];
      if (a.id != b.id || a.cls != b.cls || a.state != b.state) ++differing;
      // The reader may find a group for a source that stands alone; those that we wrote stay.
      if (b.group != 0 && a.group != b.group) ++differing;
    }
    CHECK(differing == 0);
  }
}

TEST_CASE("street: an unwritable folder is one line that names it") {
  street::Street s;
  const io::Outcome done = street::write_street(s, "/proc/npsim_no_such_place");
  REQUIRE(!done.ok());
  CHECK(done.error().line().find("/proc/npsim_no_such_place") != std::string::npos);
}
