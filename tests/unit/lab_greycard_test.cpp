// SPDX-License-Identifier: Apache-2.0
// npsim greycard: the ratios of the light that fell on a card, through noise and 8 bits; what cannot be measured.
#include <doctest/doctest.h>

#ifdef NPSIM_TOOL

#include <cmath>
#include <string>

#include "lab/greycard_command.hpp"
#include "npsim/core/random.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/pfm.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "tool_fixture.hpp"

using namespace tool_test;

namespace {

using namespace npsim;

// A card of one colour with noise, in black.
io::Image<Vec3f> photograph(const Vec3f& colour, float noise) {
  io::Image<Vec3f> out(Shape{60, 40});
  for (int y = 10; y < 30; ++y) {
    for (int x = 20; x < 50; ++x) {
      RandomStream random(1, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 60 + x), 0);
      out.view()(x, y) =
          colour + Vec3f{random.uniform(-noise, noise), random.uniform(-noise, noise), random.uniform(-noise, noise)};
    }
  }
  return out;
}

}  // namespace

TEST_CASE("greycard: means of linear channels, so noise averages out, and the border does not count") {
  const io::Image<Vec3f> picture = photograph({0.3F, 0.2F, 0.05F}, 0.05F);
  const auto card = tool::parse_card("20,10,50,30", picture.shape());
  REQUIRE(card.ok());
  const auto m = tool::measure_card("a", picture.view(), card.value());
  REQUIRE(m.ok());
  CHECK(m.value().pixels == 600);
  CHECK(m.value().r_g == doctest::Approx(1.5).epsilon(0.02));
  CHECK(m.value().b_g == doctest::Approx(0.25).epsilon(0.04));
  CHECK(m.value().s == doctest::Approx(0.2126 * 0.3 + 0.7152 * 0.2 + 0.0722 * 0.05).epsilon(0.02));
}

TEST_CASE("greycard: rectangles that are none, cards that are clipped, black, tiny or no numbers are refused") {
  const Shape shape{60, 40};
  for (const char* text : {"", "1,2,3", "1,2,3,4,5", "20,10,20,30", "20,10,10,30", "-1,0,5,5", "0,0,61,40", "a,0,5,5",
                           "0,0,5,5 ", "0;0;5;5", "99999999999,0,5,5"}) {
    const auto card = tool::parse_card(text, shape);
    CHECK(!card.ok());
    if (!card.ok()) CHECK(card.error().line().find("expected x0,y0,x1,y1") != std::string::npos);
  }
  const auto problem = [](const io::Image<Vec3f>& picture, std::array<int, 4> card) {
    const auto m = tool::measure_card("a.png", picture.view(), card);
    REQUIRE(!m.ok());
    CHECK(m.error().line().find("a.png: card: ") == 0);
    return m.error().problem;
  };
  CHECK(problem(photograph({0.3F, 0.2F, 0.1F}, 0), {20, 10, 27, 17}).find("64 or more") != std::string::npos);
  CHECK(problem(photograph({1.3F, 0.2F, 0.1F}, 0), {20, 10, 50, 30}).find("shorter exposure") != std::string::npos);
  CHECK(problem(photograph({0.3F, 0, 0.1F}, 0), {20, 10, 50, 30}).find("longer exposure") != std::string::npos);
  CHECK(problem(photograph({0.3F, NAN, 0.1F}, 0), {20, 10, 50, 30}).find("no number") != std::string::npos);
}

TEST_CASE("greycard: the command reads sRGB and linear files alike, and an exposure gives lx and cd") {
  const std::string folder = fixture().out("greycard");
  fs::create_directories(folder);
  io::Image<Rgb8> coded(Shape{20, 20});
  io::Image<Vec3f> linear(Shape{20, 20});
  for (std::size_t i = 0; i < 400; ++i) {
    coded.data()[i] = {188, 118, 60};
    linear.data()[i] = {0.50289F, 0.18116F, 0.045186F};
  }
  REQUIRE(io::write_png(folder + "/card.png", coded.view()).ok());
  REQUIRE(io::write_pfm(folder + "/card.pfm", linear.view()).ok());
  for (const std::string& name : {std::string("card.png"), std::string("card.pfm")}) {
    const Run run = run_tool("greycard " + folder + "/" + name +
                             " --card 0,0,20,20 --iso 3200 --f-number 2 --time 0.033333 --distance 3");
    CHECK(run.status == 0);
    CHECK(run.output.find("r/g  2.77") != std::string::npos);
    CHECK(run.output.find("b/g  0.249") != std::string::npos);
    // 1 cd/m2 is .2417 of full scale; .2397 / .2417 * pi / .18.
    CHECK(run.output.find("E    17.3") != std::string::npos);
    CHECK(run.output.find("I    155") != std::string::npos);
  }
  check_refused(run_tool("greycard " + folder + "/card.png --card 0,0,20,20 --iso 100"), "--iso, --f-number, --time");
  check_refused(run_tool("greycard " + folder + "/none.png --card 0,0,20,20"), "none.png");
}

#endif
