// SPDX-License-Identifier: Apache-2.0
#include "npsim/depth/detail/given/sky.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "fixture.hpp"

using namespace npsim;
using npsim_test::Image;

namespace {

constexpr DepthNoise kNoise{0.001F, 0};  // of stereo, 1/m

void find(const Image<Rgb8>& image, const Image<float>& depth, DepthSource source, Image<std::uint8_t>& surface,
          const GroundPlane& ground = {}, const DepthNoise& noise = kNoise) {
  const Shape shape = depth.cview().shape();
  const Intrinsics camera{100, 100, 0.5F * static_cast<float>(shape.width), 0.5F * static_cast<float>(shape.height)};
  npsim_test::Scratch scratch(find_sky_workspace_bytes(shape));
  REQUIRE(
      find_sky(ground, camera, image.cview(), depth.cview(), source, noise, surface.view(), scratch.workspace()).ok());
}

// A photograph and its depth, which those that follow draw, and what is found in them.
struct Drawn {
  Shape shape;
  Image<Rgb8> image;
  Image<float> depth;
  Image<std::uint8_t> surface;
  GroundPlane ground;
  explicit Drawn(Shape s, const Rgb8& all = {}) : shape(s), image(s, all), depth(s, 0.0F), surface(s, 9) {}
  void run(DepthSource source = DepthSource::lidar, const DepthNoise& noise = kNoise) {
    find(image, depth, source, surface, ground, noise);
  }
};

// Measured below row 40; a dark tower from there up to row 10, and beside it the sky down to row 30.
struct View : Drawn {
  View() : Drawn({100, 60}, {70, 70, 60}) {
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 100; ++x) {
        const bool tower = x >= 30 && x < 60 && y >= 10;
        if (y < 30 && !tower) image(x, y) = Rgb8{190, 200, 220};
        if (y >= 40 && (x + y) % 3 == 0) depth(x, y) = 20.0F;
      }
    }
  }
};

}  // namespace

TEST_CASE("without labels a tower keeps its outline above the sensor's last row, and the sky begins where it is seen") {
  View v;
  for (int y = 20; y < 24; ++y) {
    for (int x = 40; x < 44; ++x) v.image(x, y) = Rgb8{250, 250, 250};  // a bright window
  }
  v.image(80, 5) = Rgb8{20, 20, 20};  // a bird
  v.run();
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) CHECK(v.surface(x, y) == (y >= 30 || (x >= 30 && x < 60 && y >= 10) ? 1 : 0));
  }
}

TEST_CASE("where the picture does not tell the sky apart it begins above the topmost measurements") {
  View v;
  for (Rgb8& c : v.image.view().pixels()) c = Rgb8{120, 120, 120};
  v.run();
  for (int y = 0; y < 60; ++y) CHECK(v.surface(50, y) == (y >= 40 ? 1 : 0));
  View night;  // the road is brighter than all above it
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      const auto grey = static_cast<std::uint8_t>(y >= 40 ? 200 : night.image(x, y).g / 4);
      night.image(x, y) = Rgb8{grey, grey, grey};
    }
  }
  night.run();
  for (int y = 0; y < 60; ++y) CHECK(night.surface(50, y) == (y >= 40 ? 1 : 0));
}

TEST_CASE("a dense depth map is all surface but for what is far and looks like the sky, below an arm across it too") {
  View v;
  for (float& z : v.depth.view().pixels()) z = 10.0F;
  v.run();
  for (const std::uint8_t s : v.surface.view().pixels()) CHECK(s == 1);
  const auto sky = [](int x, int y) { return y < 30 && y != 20 && !(x >= 30 && x < 60 && y >= 10); };
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 100; ++x) v.depth(x, y) = y == 20 ? 25.0F : 80.0F;  // an arm; the tower is far too
  }
  for (int x = 0; x < 100; ++x) v.image(x, 20) = Rgb8{60, 60, 60};
  v.run();
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) CHECK(v.surface(x, y) == (sky(x, y) ? 0 : 1));
  }
  for (Rgb8& c : v.image.view().pixels()) c = Rgb8{120, 120, 120};  // nothing is told apart
  v.run();
  for (const std::uint8_t s : v.surface.view().pixels()) CHECK(s == 1);
}

namespace {

// A sensor that looks up to row 10: walls on either side answer all the way, the gap between them only below row 40.
// The sky fills the gap and all above the walls, which are taller than the field of view and end at row 4.
struct Canyon : Drawn {
  static bool wall(int x, int y) { return y >= 4 && (x < 70 || x >= 130); }
  // grain: how much the two differ from pixel to pixel.
  Canyon(const Rgb8& of_wall, int wall_grain, const Rgb8& of_sky, int sky_grain) : Drawn({200, 60}) {
    const auto rough = [](const Rgb8& c, int grain, int x, int y) {
      const int off = ((x * 7 + y * 13) % 3 - 1) * grain;
      const auto add = [off](int v) { return static_cast<std::uint8_t>(v + off); };
      return Rgb8{add(c.r), add(c.g), add(c.b)};
    };
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const bool street = y >= 40;
        image(x, y) = street       ? Rgb8{90, 90, 90}
                      : wall(x, y) ? rough(of_wall, wall_grain, x, y)
                                   : rough(of_sky, sky_grain, x, y);
        if ((street || (wall(x, y) && y >= 10)) && (x + y) % 3 == 0) depth(x, y) = 20.0F;
      }
    }
  }
  int wrong() {
    run();
    int n = 0;
    for (int y = 0; y < 40; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (x > 60 && x < 140 && y >= 10 && y < 42 && (x < 80 || x >= 120)) continue;  // beside measurements
        n += surface(x, y) == (wall(x, y) ? 1 : 0) ? 0 : 1;
      }
    }
    return n;
  }
};

}  // namespace

TEST_CASE(
    "a deep blue sky behind white walls, and dark clouds above bright ones, are what the sensor had no answer from") {
  CHECK(Canyon({240, 235, 225}, 6, {60, 110, 190}, 0).wrong() == 0);
  CHECK(Canyon({190, 190, 190}, 5, {100, 104, 110}, 1).wrong() == 0);
  CHECK(Canyon({70, 60, 50}, 5, {200, 215, 240}, 1).wrong() == 0);  // as ever
}

TEST_CASE("far trees that do not answer are no sky") {
  Canyon v({60, 70, 40}, 20, {235, 240, 245}, 0);
  for (int y = 8; y < 40; ++y) {
    for (int x = 70; x < 130; ++x) v.image(x, y) = v.image(x - 60, y);
  }
  v.run();
  CHECK(v.surface(20, 8) == 1);  // the wall's top, above the field of view
  CHECK(v.surface(100, 2) == 0);
  CHECK(v.surface(20, 1) == 0);
}

TEST_CASE("smooth houses out of reach below rough clouds are not the sky") {
  Canyon v({70, 60, 50}, 8, {200, 205, 210}, 6);
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 200; ++x) {
      if (!Canyon::wall(x, y) && y < 8)
        v.image(x, y) = Rgb8{110, static_cast<std::uint8_t>(110 + (x * 7 + y) % 9), 115};
      if (!Canyon::wall(x, y) && y >= 8 && y < 40) v.image(x, y) = Rgb8{90, 60, 40};
    }
  }
  v.run();
  for (int x = 0; x < 200; ++x) CHECK(v.surface(x, 1) == 0);
}

TEST_CASE("nearly dense depth with its sky left out has the sky where nothing was measured") {
  for (const float missing : {0.0F, std::numeric_limits<float>::infinity()}) {
    View v;
    for (float& z : v.depth.view().pixels()) z = 12.0F;
    for (int x = 66; x < 90; ++x) {  // 4 % of the picture
      for (int y = 0; y < 10; ++y) v.depth(x, y) = missing;
    }
    v.run();
    for (int x = 75; x < 81; ++x) CHECK(v.surface(x, 3) == 0);
    CHECK(v.surface(40, 20) == 1);
    CHECK(v.surface(95, 3) == 1);
  }
}

TEST_CASE("of a network's depth a bright house that is far stays, and a sky that alone is far is one, clouds and all") {
  View v;
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) v.depth(x, y) = y < 30 && !(x >= 30 && x < 60 && y >= 10) ? 90.0F : 12.0F;
  }
  for (int y = 30; y < 36; ++y) {
    for (int x = 40; x < 50; ++x) {  // white, apart from the sky
      v.depth(x, y) = 65.0F;
      v.image(x, y) = Rgb8{230, 230, 230};
    }
  }
  v.run();
  CHECK(v.surface(45, 33) == 1);
  CHECK(v.surface(80, 20) == 0);
  View clouds;
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      clouds.depth(x, y) = y < 20 ? 80.0F : 15.0F;
      if (y < 20) clouds.image(x, y) = x < 50 ? Rgb8{110, 150, 220} : Rgb8{245, 245, 245};
      if (y >= 20) clouds.image(x, y) = Rgb8{70, 70, 60};
    }
  }
  clouds.run();
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) CHECK(clouds.surface(x, y) == (y < 20 ? 0 : 1));
  }
}

TEST_CASE("of a stereo pair clouds that were matched at 30 m are sky, a tower that was not matched is none") {
  View v;
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      const bool tower = x >= 30 && x < 60 && y >= 10;
      if (y < 30 && !tower) v.depth(x, y) = (x / 5 + y / 5) % 2 == 0 ? 30.0F + static_cast<float>(x) : 0.0F;
      if (y >= 30 && y < 40) v.depth(x, y) = 40.0F;
    }
  }
  v.run(DepthSource::stereo);
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      const bool tower = x >= 30 && x < 60 && y >= 10;
      CAPTURE(x);
      CAPTURE(y);
      CHECK(v.surface(x, y) == (y < 30 && !tower ? 0 : 1));
    }
  }
  v.run();  // what a laser measures is there
  CHECK(v.surface(80, 20) == 1);
}

TEST_CASE("of a stereo pair a pale front that goes on in what is matched as planes are is no sky; clouds as grey are") {
  // Left a front that stands on a darker one, in the middle a cloud as grey, matched anyhow or as smoothly but far
  // behind what is below it, right a part of the sky as smooth as the front, beyond a dark post.
  const auto front = [](int x, int y) { return x < 10 && y < 40; };
  const auto cloud = [](int x, int y) { return x >= 44 && x < 56 && y < 30; };
  const auto post = [](int x, int y) { return x >= 86 && x < 90 && y < 30; };
  const auto run = [&](bool smooth_cloud, bool smooth_sky, float nearness, const DepthNoise& noise) {
    Drawn d({100, 60}, {60, 60, 55});
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 100; ++x) {
        const bool pale = front(x, y) || cloud(x, y);
        if (y < 30 || pale) d.image(x, y) = pale ? Rgb8{150, 155, 148} : Rgb8{210, 216, 216};
        if (y >= 40 && x < 10) d.image(x, y) = Rgb8{20, 20, 18};
        if (post(x, y)) d.image(x, y) = Rgb8{20, 20, 18};
        const bool part = x >= 86 && y < 30;
        const bool smooth = cloud(x, y) ? smooth_cloud : part || smooth_sky;
        const float slanted_m = 1.0F / (nearness * (0.02F + 0.0002F * static_cast<float>(x)));
        const float matched_m = 30.0F + static_cast<float>((17 * x + 23 * y) % 40);
        const bool missing = x >= 10 && !part && (x + y) % 9 == 0;
        d.depth(x, y) = missing ? 0.0F : (x < 10 || smooth ? slanted_m : matched_m);
        if (y >= 30 && x >= 10) d.depth(x, y) = 15.0F;
      }
    }
    d.run(DepthSource::stereo, noise);
    int sky_of_front = 0;
    for (int y = 0; y < 39; ++y) {
      for (int x = 0; x < 100; ++x) {
        CAPTURE(x);
        CAPTURE(y);
        if (front(x, y) && x < 9) sky_of_front += d.surface(x, y) == 0 ? 1 : 0;  // all but its outline
        if (y < 28 && x > 10 && !post(x, y)) CHECK(d.surface(x, y) == 0);
      }
    }
    return sky_of_front;
  };
  CHECK(run(false, false, 1.0F, kNoise) == 0);
  CHECK(run(true, false, 1.0F, kNoise) == 0);
  // What does not tell: a sky that is as smooth, disparities that are nearly the sky's, and noise of no pair.
  CHECK(run(true, true, 1.0F, kNoise) > 200);
  CHECK(run(false, false, 0.4F, kNoise) > 200);
  CHECK(run(false, false, 1.0F, {0.001F, 1}) > 200);
}

TEST_CASE(
    "the sun that a road mirrors, as far as clouds by the depth, is no sky; beyond a climb or an edge there is some") {
  for (const DepthSource source : {DepthSource::stereo, DepthSource::network}) {
    CAPTURE(static_cast<int>(source));
    View v;
    const auto glare = [](int x, int y) { return x >= 70 && x < 90 && y >= 36 && y < 56; };
    const auto edge = [](int x, int y) { return x < 10 && y < 50; };
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 100; ++x) {
        if (glare(x, y)) v.image(x, y) = Rgb8{255, 255, 255};
        if (edge(x, y)) v.image(x, y) = v.image(0, 0);
        v.depth(x, y) = glare(x, y) || edge(x, y) || y < 30 ? 400.0F : 20.0F;
        if (source == DepthSource::stereo && (x + y) % 7 == 0) v.depth(x, y) = 0.0F;
      }
    }
    v.run(source);
    for (const int y : {20, 38, 50}) CHECK(v.surface(80, y) == 0);
    v.ground.inlier_share = 0.8F;  // level: the horizon is row 30, a road that climbs by a tenth ends at row 40
    v.run(source);
    for (const int y : {20, 38}) CHECK(v.surface(80, y) == 0);
    for (int y = 40; y < 60; ++y) CHECK(v.surface(80, y) == 1);
    for (const int y : {0, 20, 38, 48}) CHECK(v.surface(5, y) == 0);
  }
}

TEST_CASE(
    "of a stereo pair an even sky no brighter than the street, which the picture cannot tell, is above the matches") {
  View v;
  v.image = Image<Rgb8>(v.shape, Rgb8{100, 100, 100});
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) v.depth(x, y) = y >= 25 && (x + y) % 7 != 0 ? 20.0F : 0.0F;
  }
  v.run(DepthSource::stereo);
  for (int y = 0; y < 60; ++y) {
    CAPTURE(y);
    if (y != 25) CHECK(v.surface(50, y) == (y > 25 ? 1 : 0));
  }
}

TEST_CASE(
    "of a stereo pair a dark sky without matches is one, bright houses at 40 m that reach the upper edge are not") {
  View v;
  const auto house = [](int x) { return x < 30 || x >= 80; };
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      v.image(x, y) = y < 40 && house(x) ? Rgb8{200, 195, 190} : (y < 40 ? Rgb8{70, 75, 85} : Rgb8{120, 120, 120});
      v.depth(x, y) = y >= 40 ? 15.0F : (house(x) ? 40.0F : 0.0F);
    }
  }
  v.run(DepthSource::stereo);
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      CAPTURE(x);
      CAPTURE(y);
      // Beside a house the sky begins eight columns off, as for any sensor with gaps.
      if (house(x)) CHECK(v.surface(x, y) == 1);
      if (x >= 38 && x < 72) CHECK(v.surface(x, y) == (y < 40 ? 0 : 1));
    }
  }
}

TEST_CASE(
    "of a network's depth blue beside a white cloud is sky as well, a front as white and nearer by a step is none") {
  for (const bool small_cloud : {false, true}) {
    const auto front = [](int x, int y) { return x < 25 && y >= 8 && y < 40; };
    // How white: within 14 px of its rim it is not all of it.
    const auto cloud = [&](int x, int y) {
      const int within = std::min(x - (small_cloud ? 84 : 50), 34 - y);
      return std::fmin(1.0F, std::fmax(0.0F, static_cast<float>(within) / 14.0F));
    };
    View v;
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 100; ++x) {
        const bool sky = y < 40 && !front(x, y);
        const auto code = [&](int blue, int white) {
          return static_cast<std::uint8_t>(static_cast<float>(blue) + cloud(x, y) * static_cast<float>(white - blue));
        };
        v.image(x, y) = sky           ? Rgb8{code(95, 240), code(140 + (7 * x + 3 * y) % 3, 246), code(210, 248)}
                        : front(x, y) ? Rgb8{240, 238, 235}
                                      : Rgb8{70, 70, 70};
        // The sky comes nearer to one side, to 55 m.
        v.depth(x, y) = sky ? 80.0F - 0.25F * static_cast<float>(x) : front(x, y) ? 50.0F : 15.0F;
      }
    }
    v.run(DepthSource::network);
    CAPTURE(small_cloud);
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 100; ++x) {
        CAPTURE(x);
        CAPTURE(y);
        CHECK(v.surface(x, y) == (y < 40 && !front(x, y) ? 0 : 1));
      }
    }
  }
}

TEST_CASE(
    "of a network's depth clouds end at a step of depth, where what is as white comes near, and where it darkens") {
  View v;
  const auto stepped = [](int x, int y) { return x >= 62 && x < 70 && y >= 20; };
  const auto near = [](int x, int y) { return x >= 75 && y >= 10; };
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      const float white = std::fmin(1.0F, std::fmax(0.0F, static_cast<float>(x - 40) / 14.0F));
      const int darker = x < 60 && x >= 54 && y > 20 ? 10 * (y - 20) : 0;
      const auto code = [&](int blue) {
        return static_cast<std::uint8_t>(static_cast<float>(blue) + white * static_cast<float>(246 - blue) -
                                         static_cast<float>(darker));
      };
      v.image(x, y) = y < 40 ? Rgb8{code(95), code(140 + (7 * x + 3 * y) % 3), code(210)} : Rgb8{70, 70, 70};
      const float z = stepped(x, y) ? 58.0F : (near(x, y) ? 70.0F * std::pow(0.98F, static_cast<float>(y - 9)) : 70.0F);
      v.depth(x, y) = y < 40 ? z : 15.0F;
    }
  }
  v.run(DepthSource::network);
  CHECK(v.surface(10, 30) == 0);
  CHECK(v.surface(66, 10) == 0);
  CHECK(v.surface(90, 8) == 0);
  CHECK(v.surface(72, 35) == 0);
  CHECK(v.surface(66, 30) == 1);
  CHECK(v.surface(90, 30) == 1);
  CHECK(v.surface(57, 33) == 1);
}

TEST_CASE("of a stereo pair a found sky stays beside what was not matched up to the upper edge: front, strip, crown") {
  for (const int kind : {0, 1, 2}) {
    View v;
    const auto unmatched = [&](int x, int y) { return x < 12 && (kind == 1 || y < 30); };
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 100; ++x) {
        const bool beside = x < 12;
        const bool sky = y < 40 && !beside;
        const auto leaf = static_cast<std::uint8_t>(kind == 2 ? 30 + 20 * ((5 * x + 3 * y) % 4) : 60);
        v.image(x, y) = sky ? Rgb8{200, 205, 215} : (beside ? Rgb8{leaf, leaf, leaf} : Rgb8{60, 60, 60});
        // Only beside the front was the sky not matched in places; filled maps have no such holes.
        const float matched = kind != 0 || (7 * x + 3 * y) % 5 < 3 ? 40.0F + static_cast<float>(x % 9) : 0.0F;
        v.depth(x, y) = unmatched(x, y) ? 0.0F : (sky ? matched : 15.0F);
      }
    }
    v.run(DepthSource::stereo);
    CAPTURE(kind);
    for (int y = 0; y < 60; ++y) {
      for (int x = 12; x < 100; ++x) CHECK(v.surface(x, y) == (y < 40 ? 0 : 1));
      CHECK(v.surface(3, y) == 1);
    }
  }
}

TEST_CASE("of a network's depth wet road and a blue house that come up to the sky without a step are none of it") {
  View v;
  const auto house = [](int x, int y) { return x < 40 && y >= 6 && y < 36; };
  const auto road = [](int y) { return y >= 36; };
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      const auto grain = static_cast<std::uint8_t>((7 * x + 3 * y) % 3);
      v.image(x, y) = road(y)       ? Rgb8{85, static_cast<std::uint8_t>(95 + grain), 112}
                      : house(x, y) ? Rgb8{70, static_cast<std::uint8_t>(80 + grain), 110}
                                    : Rgb8{110, static_cast<std::uint8_t>(160 + grain), 225};
      // From the sky's 80 m down the road by 2 % a row, and along the house from 62 m, behind a soft edge.
      const float away = std::fmin(1.0F, static_cast<float>(40 - x) / 16.0F);
      v.depth(x, y) = road(y)       ? 80.0F * std::pow(0.98F, static_cast<float>(y - 35))
                      : house(x, y) ? 80.0F - 18.0F * away - 0.5F * static_cast<float>(39 - x)
                                    : 80.0F;
    }
  }
  v.run(DepthSource::network);
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      if (house(x, y) && x >= 28) continue;  // as far as the sky nearly
      CAPTURE(x);
      CAPTURE(y);
      CHECK(v.surface(x, y) == (road(y) || house(x, y) ? 1 : 0));
    }
  }
}

TEST_CASE("where all is blue, a front that alone is far and closes a street is no sky") {
  View v;
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      const auto code = static_cast<std::uint8_t>(100 + (7 * x + 3 * y) % 3);
      v.image(x, y) = Rgb8{static_cast<std::uint8_t>(code - 20), code, static_cast<std::uint8_t>(code + 30)};
      v.depth(x, y) = x >= 30 && x < 70 && y < 35 ? 70.0F : 15.0F;
    }
  }
  v.run(DepthSource::network);
  for (const std::uint8_t s : v.surface.view().pixels()) CHECK(s == 1);
}

TEST_CASE(
    "a pale wall that goes on above the sensor's rows is none, the sky behind its roof is, seen through points too") {
  for (const int step : {1, 5}) {  // columns from one point of the laser to the next
    View v;
    v.depth = Image<float>(v.shape, 0.0F);
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 100; ++x) {
        const bool house = x >= 30;
        const bool roofed = x >= 70 && y < 34;  // the sky above a roof whose foot is measured
        const bool roof = x >= 70 && y >= 30 && y < 34;
        const bool corner = x >= 28 && x < 32;
        const auto grey = static_cast<std::uint8_t>(196 + y / 4);  // paler towards the ground
        v.image(x, y) = corner || roof       ? Rgb8{60, 40, 30}
                        : house && !(roofed) ? Rgb8{grey, grey, grey}
                        : !house && y >= 30  ? Rgb8{50, 60, 40}
                                             : Rgb8{190, 200, 220};
        if (y >= 40 && y % 4 == 0 && x % step == 0) v.depth(x, y) = 20.0F;
      }
    }
    for (int y = 0; y < 30; ++y) v.image(69, y) = Rgb8{60, 40, 30};  // the wall's other corner
    v.run();
    CAPTURE(step);
    CHECK(v.surface(10, 5) == 0);
    CHECK(v.surface(80, 5) == 0);
    for (int y = 0; y < 60; ++y) CHECK(v.surface(50, y) == 1);
  }
}

TEST_CASE("dark trees and panes that do not answer are no sky, though alike and smooth, where there is none at all") {
  View v;
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      const int grain = (x * 7 + y * 13) % 3 * 30;
      const bool tiles = x < 40;
      v.image(x, y) = tiles || y >= 40 ? Rgb8{80, static_cast<std::uint8_t>(100 + grain), 150} : Rgb8{20, 22, 20};
      v.depth(x, y) = (y >= 40 || (tiles && y >= 20)) && (x + y) % 3 == 0 ? 15.0F : 0.0F;
    }
  }
  v.run();
  for (int x = 0; x < 100; ++x) {
    CAPTURE(x);
    for (int y = 25; y < 60; ++y) CHECK(v.surface(x, y) == 1);
    if (x > 45) CHECK(v.surface(x, 5) == 1);
  }
}

TEST_CASE(
    "a white house in the sun above the sensor's rows is none of a blue sky, but may be a cloud beside white ones") {
  for (const bool clouds : {false, true}) {
    View v;
    v.depth = Image<float>(v.shape, 0.0F);
    for (int y = 0; y < 60; ++y) {
      for (int x = 0; x < 100; ++x) {
        const bool hedge = y >= 36;
        const bool roof = x >= 30 && x < 34;
        v.image(x, y) = hedge || roof                 ? Rgb8{50, 60, 40}
                        : x < 30                      ? Rgb8{252, 250, 246}
                        : clouds && y >= 10 && y < 14 ? Rgb8{250, 250, 250}
                                                      : Rgb8{120, 190, 240};
        if (y >= 40 && x % 3 == 0) v.depth(x, y) = 20.0F;
      }
    }
    v.run();
    CAPTURE(clouds);
    CHECK(v.surface(80, 5) == 0);
    CHECK(v.surface(20, 5) == (clouds ? 0 : 1));
    CHECK(v.surface(20, 33) == (clouds ? 0 : 1));
    CHECK(v.surface(20, 37) == 1);
  }
}

TEST_CASE("the sky comes up to a pole that the sensor sees high up, between its points too") {
  View v;
  v.depth = Image<float>(v.shape, 0.0F);
  const auto pole = [](int x) { return x >= 50 && x < 53; };
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      const auto blue = static_cast<std::uint8_t>(215 + y % 3 * 4);
      v.image(x, y) = y >= 36 || pole(x) ? Rgb8{50, 60, 50} : Rgb8{170, 190, blue};
      const bool measured = y % 4 == 0 && (y >= 40 ? x % 3 == 0 : x == 51 && y >= 8);
      if (measured) v.depth(x, y) = y >= 40 ? 20.0F : 12.0F;
    }
  }
  v.run();
  for (int x = 0; x < 100; ++x) {
    CAPTURE(x);
    for (const int y : {3, 15, 30}) CHECK(v.surface(x, y) == (pole(x) ? 1 : 0));
    CHECK(v.surface(x, 38) == 1);
  }
}

namespace {

// A street 140 px wide, measured from row 60 on, as far as every row and every third column; skies to be told from it.
struct Wide : Drawn {
  template <class Colour>
  explicit Wide(const Colour& colour) : Drawn({140, 100}) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        image(x, y) = colour(x, y);
        if (y >= 60 && x % 3 == 0) depth(x, y) = 20.0F;
      }
    }
  }
  // Of rows [from, to) at columns where the predicate holds, the share that is sky.
  template <class Column>
  double sky(int from, int to, const Column& column) {
    run();
    double n = 0;
    double count = 0;
    for (int y = from; y < to; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (!column(x)) continue;
        count += 1;
        n += surface(x, y) == 0 ? 1 : 0;
      }
    }
    return n / count;
  }
};

constexpr Rgb8 kHedge{50, 60, 40};

}  // namespace

TEST_CASE("a grey sky over snow, without an edge between them, stays, trees before it or not") {
  for (const int trees : {4, 1000}) {
    const auto tree = [&](int x) { return x / 10 % trees == 3; };
    Wide v([&](int x, int y) {
      const auto grey = static_cast<std::uint8_t>(212 + y / 20);
      return tree(x) && y >= 20 && y < 60 ? kHedge : Rgb8{grey, grey, grey};
    });
    for (int x = 0; x < v.shape.width; ++x) v.image(x, 99) = Rgb8{30, 30, 30};  // the own car
    CAPTURE(trees);
    CHECK(v.sky(0, 50, [&](int x) { return !tree(x) && !tree(x - 1) && !tree(x + 1); }) > 0.99);
  }
}

TEST_CASE("a noisy sky is even, and so is one that poles cut into twenty parts") {
  const auto noise = [](int x, int y, int c) {
    return ((x * 73 + y * 151 + c * 37 + x * y * 29) % 41 - 20) * 3 / 4;  // 15 at most, 9 as root mean square
  };
  Wide noisy([&](int x, int y) {
    const auto add = [&](int v, int c) { return static_cast<std::uint8_t>(v + noise(x, y, c)); };
    return y >= 52 ? kHedge : Rgb8{add(180, 0), add(195, 1), add(215, 2)};
  });
  CHECK(noisy.sky(0, 50, [](int) { return true; }) > 0.97);
  const auto pole = [](int x) { return x % 7 < 2; };
  Wide parts([&](int x, int y) { return y >= 52 || pole(x) ? kHedge : Rgb8{205, 210, 215}; });
  CHECK(parts.sky(0, 50, [&](int x) { return x % 7 > 2 && x % 7 < 6; }) > 0.99);
}

TEST_CASE("the sky's two halves beside a tower may differ as the sun makes them; a front in the sun is neither") {
  const auto scene = [](Rgb8 left, Rgb8 right, int tower) {
    return Wide([=](int x, int y) {
      return y >= 35 || (x >= tower && x < tower + 6) ? kHedge : x < tower ? left : right;
    });
  };
  Wide sunset = scene({130, 150, 200}, {240, 180, 130}, 80);
  CHECK(sunset.sky(0, 33, [](int x) { return x < 78 || x > 88; }) > 0.99);
  Wide hazy = scene({110, 150, 220}, {255, 255, 255}, 80);
  CHECK(hazy.sky(0, 33, [](int x) { return x < 78 || x > 88; }) > 0.99);
  Wide front([](int x, int y) {  // no dark edge between them
    return y >= 52 ? kHedge : x >= 110 ? Rgb8{225, 190, 160} : Rgb8{225, 232, 240};
  });
  CHECK(front.sky(0, 50, [](int x) { return x < 108; }) > 0.99);
  CHECK(front.sky(0, 50, [](int x) { return x > 111; }) == 0.0);
}

TEST_CASE(
    "the sky above a pale wall is none of it: by a faint edge, where the sensor could see higher, by few points") {
  struct Case {
    Rgb8 wall;
    int tree_from;  // the row from which trees beside it are measured
    int every;      // columns of the wall from one point to the next
    bool sky;
  };
  const Rgb8 sky{215, 218, 222};
  for (const Case& c : {Case{{195, 196, 200}, 40, 3, true}, Case{{212, 214, 217}, 5, 3, true},
                        Case{{212, 214, 217}, 40, 20, true}, Case{{212, 214, 217}, 40, 3, false}}) {
    Wide v([&](int x, int y) { return x < 80 || y >= 80 ? kHedge : y >= 40 ? c.wall : sky; });
    for (int y = 0; y < 100; ++y) {
      for (int x = 0; x < 140; ++x) {
        const bool tree = x < 80 && y >= c.tree_from && x % 3 == 0;
        v.depth(x, y) = tree || (x >= 80 && y >= 40 && x % c.every == 0) ? 20.0F : 0.0F;
      }
    }
    CAPTURE(c.wall.r);
    CAPTURE(c.tree_from);
    CAPTURE(c.every);
    CHECK(v.sky(0, 38, [](int x) { return x > 90; }) == (c.sky ? 1.0 : 0.0));
  }
}

TEST_CASE("a pale front that is measured stays between the laser's columns, though the sky above is as pale and even") {
  for (const int every : {2, 3, 5, 7}) {
    Wide v([](int x, int y) {
      const auto tone = static_cast<std::uint8_t>(y < 40 ? 222 : 208 + (x + 2 * y) % 5);
      return y >= 80 || x < 20 ? kHedge : Rgb8{tone, tone, tone};
    });
    for (int y = 0; y < 100; ++y) {
      for (int x = 0; x < 140; ++x) {
        v.depth(x, y) = y >= 40 && y % 6 == 0 && (x + y / 6 * 2) % every == 0 ? 20.0F : 0.0F;
      }
    }
    CAPTURE(every);
    CHECK(v.sky(48, 80, [](int x) { return x >= 10 && x < 130; }) == 0.0);
  }
}

TEST_CASE("a wall that fades into the dark at the picture's upper edge, all of it going on, is none of the sky") {
  Wide v([](int, int y) {
    const auto grey = static_cast<std::uint8_t>(y < 35 ? 60 + 4 * y : y < 75 ? 200 : 60);
    return Rgb8{grey, grey, grey};
  });
  CHECK(v.sky(36, 100, [](int) { return true; }) == 0.0);
}

TEST_CASE("a front of tiles as bright as a sky, whose upper half is not measured, is in crumbs and none") {
  Wide v([](int x, int y) {
    const auto tone = static_cast<std::uint8_t>(150 + (x / 4 * 7 + y / 4 * 5) % 4 * 25);
    return y < 75 ? Rgb8{tone, tone, tone} : Rgb8{70, 70, 70};
  });
  for (int y = 0; y < 50; ++y) {
    for (int x = 0; x < 30; ++x) v.image(x, y) = kHedge;  // a tree before it
  }
  CHECK(v.sky(0, 60, [](int) { return true; }) == 0.0);
}

TEST_CASE("a deep blue sky beside a white front is one, though what does not answer are panes that mirror white") {
  View v;
  const auto is_front = [](int x, int y) { return x >= 94 && y < 40; };
  const auto is_pane = [](int x, int y) { return x >= 20 && x < 45 && y >= 40 && y < 55; };
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      const auto grain = static_cast<std::uint8_t>((x * 7 + y * 13) % 3 * 20);
      v.image(x, y) = is_front(x, y)
                          ? Rgb8{static_cast<std::uint8_t>(210 + grain), static_cast<std::uint8_t>(205 + grain), 212}
                      : is_pane(x, y) ? (x % 4 == 0 ? Rgb8{214, 214, 214} : Rgb8{58, 75, 70})
                      : y < 40        ? Rgb8{40, 70, 125}
                                      : Rgb8{static_cast<std::uint8_t>(100 + grain / 2), 112, 110};
      v.depth(x, y) = !is_pane(x, y) && y >= 40 && (x + y) % 3 == 0 ? 20.0F : 0.0F;
    }
  }
  v.run();
  for (int y = 0; y < 38; ++y) {
    for (int x = 0; x < 100; ++x) CHECK(v.surface(x, y) == (is_front(x, y) ? 1 : 0));
  }
}

TEST_CASE("blue fronts over most of the upper edge are no sky, smooth or not, beside a narrow white one") {
  for (const int grain : {0, 3, 6}) {
    for (const Rgb8 front : {Rgb8{60, 90, 130}, Rgb8{55, 65, 85}, Rgb8{40, 70, 125}}) {
      View v;
      const auto is_gap = [](int x, int y) { return x >= 44 && x < 52 && y < 30; };
      for (int y = 0; y < 60; ++y) {
        for (int x = 0; x < 100; ++x) {
          const int n = (x * 7 + y * 13) % 5 * grain / 2;
          v.image(x, y) =
              is_gap(x, y) ? Rgb8{235, static_cast<std::uint8_t>(238 + (x * 5 + y * 3) % 3), 242}
              : y < 40 ? Rgb8{static_cast<std::uint8_t>(front.r + n), static_cast<std::uint8_t>(front.g + n), front.b}
                       : v.image(x, y);
        }
      }
      v.run();
      CAPTURE(grain);
      CAPTURE(static_cast<int>(front.r));
      CHECK(v.surface(48, 10) == 0);
      for (const int x : {5, 20, 40, 60, 80, 95}) CHECK(v.surface(x, 10) == 1);
    }
  }
}

TEST_CASE("a sky in pieces between leaves is rough, and a smooth blue front beside it no sky") {
  View v;
  const auto is_gap = [](int x, int y) { return x >= 30 && x < 60 && y < 40; };
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 100; ++x) {
      const auto tone = static_cast<std::uint8_t>(200 + (x * 7 + y * 5) % 3 * 25);
      v.image(x, y) = !is_gap(x, y)                      ? Rgb8{60, 90, 130}
                      : (x / 2 * 7 + y / 2 * 5) % 3 == 0 ? Rgb8{40, 55, 30}
                                                         : Rgb8{tone, tone, tone};
    }
  }
  v.run();
  for (const int x : {5, 20, 70, 95}) CHECK(v.surface(x, 10) == 1);
}

TEST_CASE("white clouds that come down to the houses below a blue sky are sky too, where they reach the upper edge") {
  View v;
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 100; ++x) {
      v.image(x, y) = y >= 30             ? Rgb8{static_cast<std::uint8_t>(60 + (x * 7 + y) % 4 * 10), 60, 55}
                      : y < 12 && x >= 10 ? Rgb8{90, 135, 200}
                                          : Rgb8{235, static_cast<std::uint8_t>(238 + (x + y) % 3), 242};
    }
  }
  v.run();
  for (int y = 0; y < 28; ++y) CHECK(v.surface(50, y) == 0);
}

TEST_CASE("storm clouds of a third of the brightness of white fronts beside them are the sky") {
  Canyon v({238, 236, 232}, 10, {88, 90, 94}, 2);
  v.run();
  CHECK(v.surface(100, 4) == 0);
  CHECK(v.surface(20, 8) == 1);
}

TEST_CASE("a white sky between dark trees that take up most of the upper edge and do not answer is the sky, not they") {
  View v;
  const auto is_sky = [](int x, int y) { return x >= 60 && x < 80 && y < 30; };
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      const bool tree = y < 50 && !(x >= 55 && x < 85);  // up to the road that is measured
      v.image(x, y) = is_sky(x, y)           ? Rgb8{static_cast<std::uint8_t>(220 + (x * 5 + y * 3) % 4 * 8), 235, 240}
                      : tree || y < 40       ? Rgb8{52, 62, 54}
                      : (x * 7 + y) % 2 == 0 ? Rgb8{90, 90, 88}
                                             : Rgb8{70, 72, 70};
      v.depth(x, y) = y >= (tree ? 50 : 40) && (x + y) % 3 == 0 ? 20.0F : 0.0F;
    }
  }
  v.run();
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 100; ++x) CHECK(v.surface(x, y) == (is_sky(x, y) ? 0 : 1));
  }
}

TEST_CASE("of a network's depth a deep blue sky beside white fronts in the sun is far and one") {
  Wide v([](int x, int y) {
    return y >= 60              ? Rgb8{235, 235, 240}
           : x < 30 || x >= 120 ? Rgb8{228, static_cast<std::uint8_t>(220 + (x * 7 + y * 13) % 3 * 5), 218}
                                : Rgb8{50, 90, 170};
  });
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 140; ++x) v.depth(x, y) = y >= 60 || x % 20 == 0 ? 20.0F : x < 30 || x >= 120 ? 70.0F : 80.0F;
  }
  CHECK(v.sky(0, 58, [](int x) { return x % 20 != 0 && x >= 30 && x < 120; }) > 0.99);  // poles stand before it
  CHECK(v.sky(0, 58, [](int x) { return x < 30 || x >= 120; }) == 0.0);
}

TEST_CASE("below wires the sky goes on in its own colour; a ledge as thin above another colour, or a beam, parts it") {
  constexpr Shape kShape{480, 120};
  const Rgb8 sky{190, 200, 220};
  Image<Rgb8> image(kShape, sky);
  Image<float> depth(kShape, 0.0F);
  Image<std::uint8_t> surface(kShape, 9);
  for (int y = 80; y < 120; ++y) {
    for (int x = 0; x < 480; ++x) {
      image(x, y) = Rgb8{70, 70, 60};
      if ((x + y) % 3 == 0) depth(x, y) = 20.0F;
    }
  }
  for (int x = 0; x < 480; ++x) {
    image(x, 20) = image(x, 21) = Rgb8{30, 30, 30};  // two wires, from one side of the picture to the other
    image(x, 40 + x % 2) = Rgb8{60, 60, 60};
    if (x >= 300 && x < 400) {
      for (int y = 50; y < 53; ++y) image(x, y) = Rgb8{50, 50, 50};
      for (int y = 53; y < 80; ++y) image(x, y) = Rgb8{235, 225, 205};  // a front in the sun below its ledge
      image(299, 50 + x % 30) = image(400, 50 + x % 30) = Rgb8{90, 80, 70};
    }
    if (x >= 100 && x < 200) {
      for (int y = 60; y < 65; ++y) image(x, y) = Rgb8{50, 50, 50};  // wider than a wire
      image(99, 60 + x % 20) = image(200, 60 + x % 20) = Rgb8{50, 50, 50};
    }
  }
  find(image, depth, DepthSource::lidar, surface);
  CHECK(surface(50, 10) == 0);
  CHECK(surface(50, 30) == 0);
  CHECK(surface(50, 70) == 0);
  CHECK(surface(350, 30) == 0);
  CHECK(surface(350, 65) == 1);
  CHECK(surface(150, 55) == 0);
  CHECK(surface(150, 72) == 1);
}

TEST_CASE(
    "of an exact map without its sky, that below a lamp and below measured wires is sky, and between branches, clouds "
    "and all; far houses and a wall that it has not are surface; of a network branches may be a wall; of a laser it is "
    "sky below the lamp") {
  View v;
  v.ground.inlier_share = 0.8F;
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      const bool tower = x >= 30 && x < 60 && y >= 10;
      v.depth(x, y) = y >= 30 || tower ? 20.0F : 0.0F;
    }
  }
  for (int x = 70; x < 80; ++x) {
    v.image(x, 5) = Rgb8{40, 40, 40};
    v.depth(x, 5) = 15.0F;
  }
  for (int x = 0; x < 30; ++x) {  // from the picture's edge to the tower
    v.image(x, 14) = Rgb8{40, 40, 40};
    v.depth(x, 14) = 12.0F;
  }
  for (int y = 6; y < 18; ++y) {  // branches thicker than wires, and sky between them
    for (int x = 84; x < 98; ++x) {
      if (y > 8 && y < 15 && x > 86 && x < 95) continue;
      v.image(x, y) = Rgb8{40, 40, 40};
      v.depth(x, y) = 15.0F;
    }
  }
  for (int x = 8; x < 16; ++x) {
    for (int y = 4; y < 8; ++y) v.image(x, y) = Rgb8{90, 95, 100};   // a dark cloud
    for (int y = 22; y < 30; ++y) v.image(x, y) = Rgb8{80, 70, 60};  // a house out of reach
    for (int y = 40; y < 45; ++y) v.depth(x, y) = 0.0F;              // a pane
  }
  for (const DepthSource source : {DepthSource::exact, DepthSource::network}) {
    v.run(source);
    CHECK(v.surface(75, 5) == 1);
    for (int y = 6; y < 30; ++y) CHECK(v.surface(75, y) == 0);
    for (int y = 15; y < 30; ++y) CHECK(v.surface(4, y) == 0);
    CHECK(v.surface(12, 6) == 0);
    CHECK(v.surface(90, 8) == 1);
    CHECK(v.surface(90, 12) == (source == DepthSource::exact ? 0 : 1));
    CHECK(v.surface(12, 25) == 1);
    CHECK(v.surface(12, 42) == 1);
    CHECK(v.surface(45, 15) == 1);
  }
  v.run(DepthSource::lidar);
  CHECK(v.surface(75, 15) == 0);
  v.ground.inlier_share = 0.0F;  // without a ground what is enclosed may be a hole in it
  v.run(DepthSource::exact);
  CHECK(v.surface(90, 12) == 1);
  CHECK(v.surface(90, 2) == 0);
  for (Rgb8& c : v.image.view().pixels()) c = Rgb8{120, 120, 120};  // nothing is told apart: a pane is none of the sky
  v.run(DepthSource::exact);
  CHECK(v.surface(12, 42) == 1);
  CHECK(v.surface(90, 12) == 1);
  CHECK(v.surface(90, 2) == 0);
  CHECK(v.surface(75, 15) == 0);
  CHECK(v.surface(4, 20) == 1);
}

TEST_CASE(
    "of an exact map a white wall in the sun that it has not stays one beside a blue sky; where nothing is told apart "
    "strips that it has not at the side are sky down to what a street climbs") {
  View v;
  v.ground.inlier_share = 0.8F;  // level: the horizon is row 30, a road that climbs by a tenth ends at row 40
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 100; ++x) {
      Rgb8& seen = v.image(x, y);
      if (y < 30 && seen.r > 100) seen = Rgb8{110, 160, 220};
      if (y >= 8 && y < 30 && x >= 60 && x < 75) seen = Rgb8{230, 228, 215};
      v.depth(x, y) = y >= 30 && x >= 3 ? 20.0F : 0.0F;
    }
  }
  v.run(DepthSource::exact);
  CHECK(v.surface(90, 12) == 0);
  for (int y = 10; y < 30; ++y) CHECK(v.surface(67, y) == 1);
  for (Rgb8& c : v.image.view().pixels()) c = Rgb8{120, 120, 120};
  v.run(DepthSource::exact);
  for (int y = 0; y < 38; ++y) CHECK(v.surface(1, y) == 0);
  for (int y = 42; y < 60; ++y) CHECK(v.surface(1, y) == 1);
}

namespace {

// A laser of one row in four: a street below row 60, a wall up to row 40 on the right, a pole and a wire across all
// that both answer from row 10 on. The sky is of clouds. A dark tower out of reach, up to the upper edge, tells it from
// the rest where there is one.
struct Wired : Drawn {
  bool has_tower;
  static bool wall(int x, int y) { return x >= 140 && y >= 40; }
  static bool pole(int x, int y) { return x >= 60 && x < 63 && y >= 10; }
  static bool wire(int y) { return y == 12; }
  static bool street(int y) { return y >= 60; }
  [[nodiscard]] bool tower(int x) const { return has_tower && x >= 20 && x < 40; }
  Wired(int sky, bool with_tower) : Drawn({200, 90}), has_tower(with_tower) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const auto cloud = static_cast<std::uint8_t>(sky + (x / 8 + y / 4) % 5);
        const bool thin = pole(x, y) || wire(y);
        const bool solid = wall(x, y) || street(y) || tower(x);
        image(x, y) = thin ? Rgb8{40, 35, 30} : (solid ? Rgb8{90, 85, 80} : Rgb8{cloud, cloud, cloud});
        const bool answers = thin || wall(x, y) || street(y);
        if (answers && y % 4 == 0) depth(x, y) = thin ? 15.0F : 25.0F;
      }
    }
  }
  // Pixels of the sky called surface, and the other way round.
  [[nodiscard]] int wrong() {
    run();
    int count = 0;
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const bool solid = pole(x, y) || wire(y) || wall(x, y) || street(y) || tower(x);
        count += surface(x, y) == (solid ? 1 : 0) ? 0 : 1;
      }
    }
    return count;
  }
};

}  // namespace

TEST_CASE("of a laser the sky goes on below a wire and beside a pole that answer far up, told from a tower or alone") {
  for (const bool with_tower : {false, true}) {
    CAPTURE(with_tower);
    Wired v(200, with_tower);
    const int wrong = v.wrong();
    CAPTURE(wrong);
    CHECK(wrong < 200 * 8);  // rows that no ray of the laser sees, above the street, the wall and the wire
    for (int x = 0; x < v.shape.width; ++x) {
      CHECK(v.surface(x, 30) == (Wired::pole(x, 30) || v.tower(x) ? 1 : 0));
      CHECK(v.surface(x, 64) == 1);
    }
    CHECK(v.surface(150, 44) == 1);
  }
}

TEST_CASE("of a laser a darker house out of reach below a wire is no sky, blurred or not, told from a tower or alone") {
  for (const bool with_tower : {false, true}) {
    for (const bool blurred : {false, true}) {
      CAPTURE(with_tower);
      CAPTURE(blurred);
      const int sky = with_tower ? 200 : 110;
      Wired v(sky, with_tower);
      for (int y = 20; y < 60; ++y) {
        for (int x = 72; x < 112; ++x) {
          const int in = std::min({x - 71, 112 - x, y - 19});  // from its edge
          const auto c = static_cast<std::uint8_t>(blurred ? std::max(78, sky - 8 * in) : 78);
          v.image(x, y) = Rgb8{c, c, c};
        }
      }
      v.run();
      CHECK(v.surface(90, 16) == 0);
      CHECK(v.surface(92, 45) == 1);
    }
  }
}

TEST_CASE("of a laser what lies below the horizon of a known ground is no sky, haze or not") {
  Wired v(200, false);
  v.run();
  CHECK(v.surface(100, 55) == 0);
  v.ground.inlier_share = 0.8F;  // level: the horizon is row 45
  v.run();
  CHECK(v.surface(100, 43) == 0);
  for (int y = 46; y < 60; ++y) CHECK(v.surface(100, y) == 1);
}

TEST_CASE(
    "of a laser a pane that does not answer is no sky, though it shows one, and neither is a wall of its colour") {
  for (const bool with_tower : {false, true}) {
    CAPTURE(with_tower);
    Wired v(200, with_tower);
    for (int y = 44; y < 58; ++y) {
      for (int x = 150; x < 190; ++x) {
        v.image(x, y) = Rgb8{200, 200, 200};
        v.depth(x, y) = 0.0F;
      }
    }
    for (int y = 40; y < 60; ++y) {
      for (int x = 90; x < 130; ++x) {
        v.image(x, y) = Rgb8{204, 204, 204};
        const bool lost = x < 104 && y == 48;
        v.depth(x, y) = y % 4 == 0 && !lost ? 30.0F : 0.0F;
      }
    }
    v.run();
    CHECK(v.surface(80, 30) == 0);
    for (int y = 46; y < 56; ++y) {
      CHECK(v.surface(170, y) == 1);
      CHECK(v.surface(92, y) == 1);
    }
  }
}
