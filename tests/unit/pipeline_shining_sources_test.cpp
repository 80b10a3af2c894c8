// SPDX-License-Identifier: Apache-2.0
// Which sources shine in the photograph already.
#include <doctest/doctest.h>

#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "npsim/pipeline/detail/shining_sources.hpp"

namespace {

using namespace npsim;
using namespace npsim::relight_detail;
using npsim_test::Image;

// A wall of linear albedo .3 over a road of .1 in bluish light, with one marked source in it; sky above.
struct Dusk {
  Image<Rgb8> image{{60, 60}, Rgb8{150, 152, 160}};
  Image<Label> labels{{60, 60}, label::building};
  Image<std::uint16_t> index{{60, 60}};
  std::vector<LightMark> marks = {LightMark{1, LightClass::none, SignalState::unknown, 0}};

  Dusk() {
    image.fill_rectangle(0, 40, 60, 60, Rgb8{88, 90, 97});
    labels.fill_rectangle(0, 40, 60, 60, label::road);
    image.fill_rectangle(0, 0, 60, 8, Rgb8{250, 250, 255});
    labels.fill_rectangle(0, 0, 60, 8, label::sky);
  }
  [[nodiscard]] bool shines(LightClass cls, Rgb8 colour) {
    image.fill_rectangle(20, 15, 35, 30, colour);
    index.fill_rectangle(20, 15, 35, 30, std::uint16_t{1});
    SceneView view;
    view.image = image.view();
    view.labels = labels.view();
    view.light_index = index.view();
    view.lights = Span<const LightMark>(marks.data(), marks.size());
    const std::uint32_t emitter_of_mark[] = {0, kNoPoint};
    Emitter e;
    e.cls = cls;
    DaySource source;
    find_shining(view, {emitter_of_mark, marks.size()}, {&source, 1}, {&e, 1});
    return e.shines_by_day;
  }
};

}  // namespace

TEST_CASE("a lit window is warmer than its wall and as bright; panes that mirror the day, and blinds, are not lit") {
  CHECK(Dusk().shines(LightClass::window_building, {240, 190, 110}));
  CHECK(!Dusk().shines(LightClass::window_building, {190, 200, 220}));  // the sky
  CHECK(!Dusk().shines(LightClass::window_building, {170, 160, 145}));  // a cream curtain
  CHECK(!Dusk().shines(LightClass::window_building, {90, 70, 35}));     // a brown shutter
  CHECK(!Dusk().shines(LightClass::window_building, {180, 144, 89}));   // an ochre blind, albedo .3
  CHECK(!Dusk().shines(LightClass::window_building, {190, 160, 124}));  // pine, .38
  CHECK(!Dusk().shines(LightClass::window_building, {10, 10, 10}));
}

TEST_CASE("a wall as warm as the window behind which nobody is at home shines no more than it does") {
  Dusk evening;
  evening.image.fill_rectangle(0, 8, 60, 40, Rgb8{190, 150, 100});
  CHECK(!evening.shines(LightClass::window_building, {240, 190, 110}));
}

TEST_CASE("a pane in the shade that mirrors a sunny wall does not shine where the picture shows one as well") {
  Dusk noon;
  noon.image.fill_rectangle(40, 8, 60, 40, Rgb8{255, 240, 200});
  CHECK(!noon.shines(LightClass::window_building, {230, 185, 110}));
}

TEST_CASE("the dark frame of a rectified picture is no surface that a pane must outshine") {
  Dusk noon;
  noon.image.fill_rectangle(47, 8, 60, 40, Rgb8{255, 240, 200});
  noon.image.fill_rectangle(0, 52, 60, 60, Rgb8{0, 0, 0});
  noon.labels.fill_rectangle(0, 52, 60, 60, label::rectification_border);
  CHECK(!noon.shines(LightClass::window_building, {230, 185, 110}));
}

TEST_CASE("a neighbouring lamp that could not be placed is no wall around a window") {
  Dusk pair;
  pair.marks.push_back(LightMark{2, LightClass::window_building, SignalState::unknown, 0});
  pair.index.fill_rectangle(5, 9, 55, 39, std::uint16_t{2});
  pair.image.fill_rectangle(5, 9, 55, 39, Rgb8{240, 190, 110});
  CHECK(pair.shines(LightClass::window_building, {240, 190, 110}));
}

TEST_CASE("the wall between the windows of a group is marked as the group's, and is around them all the same") {
  Dusk group;
  group.marks.push_back(LightMark{2, LightClass::windows_group, SignalState::unknown, 0});
  group.index.fill_rectangle(5, 9, 55, 39, std::uint16_t{2});
  CHECK(group.shines(LightClass::window_building, {240, 190, 110}));
}

TEST_CASE("a sign shines that is brighter than paper could be; lamps, signals and cars are not asked") {
  Dusk wall_in_shade;
  wall_in_shade.image.fill_rectangle(0, 8, 60, 60, Rgb8{66, 68, 72});
  CHECK(wall_in_shade.shines(LightClass::advertisement, {250, 250, 250}));
  CHECK(!Dusk().shines(LightClass::advertisement, {250, 250, 250}));  // the wall is bright as well
  CHECK(!wall_in_shade.shines(LightClass::advertisement, {180, 182, 190}));
  CHECK(!Dusk().shines(LightClass::advertisement, {220, 170, 40}));  // printed in yellow
  CHECK(!wall_in_shade.shines(LightClass::street_light_ht, {250, 250, 250}));
  CHECK(!wall_in_shade.shines(LightClass::window_parked, {250, 200, 90}));
}

TEST_CASE("without a road, labels or marks nothing shines") {
  Dusk no_road;
  no_road.labels.fill_rectangle(0, 40, 60, 60, label::terrain);
  CHECK(!no_road.shines(LightClass::window_building, {240, 190, 110}));
  Emitter e;
  DaySource source;
  find_shining(SceneView{}, {}, {&source, 1}, {&e, 1});
  CHECK(!e.shines_by_day);
}
