// SPDX-License-Identifier: Apache-2.0
// How lit sources look across their area.
#include <doctest/doctest.h>

#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "npsim/pipeline/detail/source_pixels.hpp"

namespace {

using namespace npsim;
using namespace npsim::relight_detail;
using npsim_test::Image;

// One source over the whole of a picture of 20 x 10.
struct Source {
  Image<Rgb8> image{{20, 10}, Rgb8{100, 100, 100}};
  Image<std::uint16_t> index{{20, 10}, 1};
  std::vector<LightMark> marks = {LightMark{1, LightClass::none, SignalState::unknown, 0}};
  Emitter emitter;

  [[nodiscard]] SceneView scene() {
    SceneView view;
    view.image = image.view();
    view.light_index = index.view();
    view.lights = Span<const LightMark>(marks.data(), marks.size());
    return view;
  }
  [[nodiscard]] Vec3f at(int x, int y) {
    const std::uint32_t emitter_of_mark = 0;
    SourceBrightness brightness;
    float count = 0;
    source_brightness(scene(), {&emitter, 1}, {&emitter_of_mark, 1}, {&brightness, 1}, {&count, 1});
    return source_pattern_at(scene(), source_pattern(emitter), brightness, x, y);
  }
  [[nodiscard]] float mean() {
    float sum = 0;
    for (int y = 0; y < 10; ++y) {
      for (int x = 0; x < 20; ++x) sum += luminance(at(x, y));
    }
    return sum / 200;
  }
};

}  // namespace

TEST_CASE("a lit sign keeps its colours and its contrast, and its mean luminance") {
  Source s;
  s.emitter.cls = LightClass::advertisement;
  for (int y = 3; y < 7; ++y) {
    for (int x = 4; x < 10; ++x) s.image(x, y) = {20, 20, 20};
    for (int x = 12; x < 16; ++x) s.image(x, y) = {180, 20, 20};
  }
  CHECK(s.mean() == doctest::Approx(1).epsilon(1e-4));
  CHECK(luminance(s.at(5, 5)) < 0.1F * luminance(s.at(0, 0)));  // dark letters: 20 to 100 in sRGB is 1 to 17
  CHECK(s.at(13, 5).x > 20 * s.at(13, 5).y);                    // red ones
}

TEST_CASE("a lit window shows its frame, be it brighter or darker than the panes by day") {
  for (const Rgb8 frame : {Rgb8{230, 230, 230}, Rgb8{25, 25, 25}}) {
    Source s;
    s.emitter.cls = LightClass::window_building;
    for (int y = 0; y < 10; ++y) s.image(9, y) = s.image(10, y) = frame;
    CHECK(s.mean() == doctest::Approx(1).epsilon(1e-4));
    CHECK(s.at(9, 4).x < 0.5F * s.at(2, 4).x);
    CHECK(s.at(9, 4).x > 0.0F);
    CHECK(s.at(9, 4).x == s.at(9, 4).z);
  }
}

TEST_CASE(
    "a window that shines by day shows its goods at night, without the cast of its light; what is cut off is white") {
  Source s;
  s.emitter.cls = LightClass::window_building;
  s.emitter.shines_by_day = true;
  for (Rgb8& c : s.image.view().pixels()) c = {220, 170, 90};  // a wall in warm light
  for (int y = 2; y < 6; ++y) {
    for (int x = 2; x < 6; ++x) s.image(x, y) = {200, 30, 15};
    for (int x = 8; x < 12; ++x) s.image(x, y) = {25, 20, 12};
  }
  s.image(15, 5) = {255, 252, 248};
  s.image(17, 5) = {255, 240, 150};  // a lamp
  CHECK(s.mean() == doctest::Approx(1).epsilon(0.02));
  const Vec3f wall = s.at(0, 0);
  CHECK(wall.x == doctest::Approx(static_cast<double>(wall.z)).epsilon(0.1));
  CHECK(s.at(3, 3).x > 2 * s.at(3, 3).y);
  CHECK(luminance(s.at(9, 3)) < 0.05F * luminance(wall));
  for (const int x : {15, 17}) CHECK(s.at(x, 5).x == doctest::Approx(static_cast<double>(s.at(x, 5).z)));
}

TEST_CASE("sources that are even, black or white by day glow evenly") {
  for (const std::uint8_t code : {std::uint8_t{0}, std::uint8_t{100}, std::uint8_t{255}}) {
    for (const LightClass cls : {LightClass::advertisement, LightClass::window_building, LightClass::street_light_ht}) {
      Source s;
      s.emitter.cls = cls;
      s.emitter.profile =
          cls == LightClass::street_light_ht ? EmissionProfile::street_luminaire : EmissionProfile::lambert;
      for (Rgb8& c : s.image.view().pixels()) c = {code, code, code};
      CHECK(s.at(3, 3).x == doctest::Approx(1).epsilon(1e-3));
    }
  }
}
