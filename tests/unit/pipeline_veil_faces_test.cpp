// SPDX-License-Identifier: Apache-2.0
#include "npsim/pipeline/detail/veil_faces.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "fixture.hpp"

using namespace npsim;

namespace {

constexpr Shape kShape{8, 4};

// A quad of faces around each pixel but those of the last row and column; vertex (x, y) at (x, y, 5).
struct Scene {
  npsim_test::Image<Label> labels{kShape, label::road};
  npsim_test::Image<std::uint32_t> object{kShape};
  npsim_test::Scratch memory{8192};
  bool of_object = true;
  Veils veils;

  [[nodiscard]] static std::size_t upper(int x, int y) { return 2 * static_cast<std::size_t>(y * kShape.width + x); }
  void find(const VeilParams& params = {}) {
    const auto each = [this](const auto& f) {
      for (int y = 0; y + 1 < kShape.height; ++y) {
        for (int x = 0; x + 1 < kShape.width; ++x) {
          const auto at = [](int u, int v) { return Vec3f{static_cast<float>(u), static_cast<float>(v), 5.0F}; };
          const auto pixel = [](int u, int v) { return static_cast<std::uint32_t>(v * kShape.width + u); };
          const Vec3f a[3] = {at(x, y), at(x + 1, y), at(x, y + 1)};
          const std::uint32_t of_a[3] = {pixel(x, y), pixel(x + 1, y), pixel(x, y + 1)};
          f(upper(x, y), a, of_a, of_object);
          const Vec3f b[3] = {at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)};
          const std::uint32_t of_b[3] = {pixel(x + 1, y), pixel(x + 1, y + 1), pixel(x, y + 1)};
          f(upper(x, y) + 1, b, of_b, of_object);
        }
      }
    };
    REQUIRE(
        find_veils(params, labels.cview(), object.cview(), 2 * kShape.pixels(), each, memory.workspace(), veils).ok());
  }
};

}  // namespace

TEST_CASE("veil faces: all of an object's, also where it is widened over others' pixels, and none of a post that is") {
  Scene s;
  s.labels(2, 1) = s.labels(3, 1) = s.labels(2, 2) = label::bicycle;
  s.object(2, 1) = s.object(3, 1) = s.object(2, 2) = 7;
  s.object(3, 2) = 7;  // the road's
  s.labels(6, 0) = s.labels(6, 1) = s.labels(6, 2) = label::pole;
  s.labels(5, 2) = label::bicycle;
  s.object(6, 0) = s.object(6, 1) = s.object(6, 2) = s.object(5, 2) = 9;
  s.find();
  REQUIRE(s.veils.of_face.size() == 2 * kShape.pixels());
  CHECK(s.veils.veil[0].cover == VeilParams{}.bicycle);
  for (int y = 0; y + 1 < kShape.height; ++y) {
    for (int x = 0; x + 1 < kShape.width; ++x) {
      CAPTURE(x);
      CAPTURE(y);
      // Numbers of faces are those of their first corners' objects.
      CHECK(s.veils.of_face[Scene::upper(x, y)] == (s.object(x, y) == 7 ? 1 : 0));
      CHECK(s.veils.of_face[Scene::upper(x, y) + 1] == (s.object(x + 1, y) == 7 ? 1 : 0));
    }
  }
  CHECK(s.veils.veil[0].low == Vec3f{1, 1, 5});
  CHECK(s.veils.veil[0].high == Vec3f{4, 3, 5});
  // Of fences there are none, and their box meets nothing.
  CHECK(!(s.veils.veil[1].low.x <= s.veils.veil[1].high.x));
}

TEST_CASE(
    "veil faces: none in a scene without such things, in the background, without labels, or where all cover all") {
  Scene plain;
  plain.find();
  CHECK(plain.veils.count == 0);
  CHECK(plain.veils.of_face.empty());
  CHECK(plain.memory.workspace().used() == 0);

  Scene fence;
  fence.labels = npsim_test::Image<Label>(kShape, label::fence);
  fence.object = npsim_test::Image<std::uint32_t>(kShape, 1);
  fence.find(VeilParams::none());
  CHECK(fence.veils.count == 0);
  fence.of_object = false;
  fence.find();
  for (const std::uint8_t of : fence.veils.of_face) CHECK(of == 0);

  Scene bare;
  bare.labels = npsim_test::Image<Label>();
  bare.find();
  CHECK(bare.veils.count == 0);
}

TEST_CASE("veil faces: ids outside the definition of labels are solid, and shares beyond 0 and 1 are refused") {
  Scene s;
  s.labels = npsim_test::Image<Label>(kShape, Label{200});
  s.object = npsim_test::Image<std::uint32_t>(kShape, 1);
  s.labels(0, 0) = label::fence;
  s.find();
  for (const std::uint8_t of : s.veils.of_face) CHECK(of == 0);
  VeilParams params;
  params.fence = 1.5F;
  CHECK(validate(params).code() == StatusCode::invalid_argument);
  params.fence = std::nanf("");
  CHECK(validate(params).code() == StatusCode::invalid_argument);
}
