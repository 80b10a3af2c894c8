// SPDX-License-Identifier: Apache-2.0
// Activation: frequencies against p, sharing within groups, independence between them, and the rules for lamps and
// signals.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "npsim/light/activation.hpp"

namespace {

using namespace npsim;

Emitter make(LightClass cls, std::uint16_t mark, std::uint16_t group = 0,
             EmissionProfile profile = EmissionProfile::lambert) {
  Emitter e;
  e.cls = cls;
  e.mark = mark;
  e.group = group;
  e.profile = profile;
  e.centre_m = {0, -1, 10};
  e.axis = {0, 0, -1};
  e.up = {0, -1, 0};
  e.area_m2 = 0.5F;
  return e;
}

std::vector<Activation> draw(const std::vector<Emitter>& emitters, std::uint32_t variant, std::uint64_t seed = 1,
                             const std::vector<Vec3f>& day = {}, const ActivationParams& params = {}) {
  std::vector<Activation> out(emitters.size());
  const Status s = activate_lights(params, seed, variant, Span<const Emitter>(emitters.data(), emitters.size()),
                                   Span<const Vec3f>(day.data(), day.size()), Span<Activation>(out.data(), out.size()));
  REQUIRE(s.ok());
  return out;
}

bool same(const Activation& a, const Activation& b) {
  return a.lit == b.lit && a.strength == b.strength && a.probability == b.probability && a.xy.x == b.xy.x &&
         a.xy.y == b.xy.y && a.intensity_cd == b.intensity_cd && a.luminance_cd_m2 == b.luminance_cd_m2;
}

constexpr int kVariants = 20000;

}  // namespace

TEST_CASE("each class is lit as often as its range of p says, and p itself is uniform in it") {
  struct Expected {
    LightClass cls;
    double low, high;
    EmissionProfile profile;
  };
  const Expected table[] = {
      {LightClass::window_building, 0.3, 0.6, EmissionProfile::lambert},
      {LightClass::window_parked, 0.1, 0.4, EmissionProfile::lambert},
      {LightClass::parked_front, 0.1, 0.3, EmissionProfile::signal},
      {LightClass::parked_rear, 0.1, 0.3, EmissionProfile::signal},
      {LightClass::moving_front, 0.95, 1.0, EmissionProfile::low_beam},
      {LightClass::moving_rear, 0.95, 1.0, EmissionProfile::signal},
      {LightClass::window_transport, 0.9, 1.0, EmissionProfile::lambert},
      {LightClass::street_light_ht, 1.0, 1.0, EmissionProfile::street_luminaire},
      {LightClass::street_light_lt, 1.0, 1.0, EmissionProfile::street_luminaire},
      {LightClass::advertisement, 0.6, 0.8, EmissionProfile::lambert},
      {LightClass::clock, 0.8, 1.0, EmissionProfile::lambert},
      {LightClass::inferred_object, 1.0, 1.0, EmissionProfile::signal},
  };
  for (const Expected& row : table) {
    INFO("class " << static_cast<int>(row.cls));
    const std::vector<Emitter> one = {make(row.cls, 5, 0, row.profile)};
    int lit = 0;
    double sum = 0;
    double squares = 0;
    for (int v = 0; v < kVariants; ++v) {
      const Activation a = draw(one, static_cast<std::uint32_t>(v))[0];
      lit += a.lit ? 1 : 0;
      const double p = static_cast<double>(a.probability);
      CHECK_UNARY(p >= row.low - 1e-6 && p <= row.high + 1e-6);
      sum += p;
      squares += p * p;
    }
    const double mean = 0.5 * (row.low + row.high);
    const double sigma = std::sqrt(std::max(mean * (1 - mean), 1e-12) / kVariants);
    CHECK(std::fabs(static_cast<double>(lit) / kVariants - mean) <= 4 * sigma + 1e-9);
    const double width = row.high - row.low;
    CHECK(std::fabs(sum / kVariants - mean) <= 4 * width / std::sqrt(12.0 * kVariants) + 1e-6);
    const double variance = squares / kVariants - (sum / kVariants) * (sum / kVariants);
    CHECK(variance == doctest::Approx(width * width / 12).epsilon(0.05));
  }
}

TEST_CASE("windows of one floor share p, strength and colour, and are lit one by one with that p") {
  std::vector<Emitter> floor;
  for (std::uint16_t i = 0; i < 40; ++i) {
    floor.push_back(make(LightClass::window_building, static_cast<std::uint16_t>(10 + i), 3));
  }
  double chi = 0;
  int both = 0;
  for (int v = 0; v < 2000; ++v) {
    const std::vector<Activation> a = draw(floor, static_cast<std::uint32_t>(v));
    int lit = 0;
    for (const Activation& w : a) {
      CHECK_UNARY(w.probability == a[0].probability && w.strength == a[0].strength && w.xy.x == a[0].xy.x);
      lit += w.lit ? 1 : 0;
    }
    both += lit > 0 && lit < 40 ? 1 : 0;
    const double p = static_cast<double>(a[0].probability);
    chi += (lit - 40 * p) * (lit - 40 * p) / (40 * p * (1 - p));
  }
  CHECK(both > 1990);  // hardly ever all or none
  // The standardised squares have mean 1 when the count is binomial with exactly that p.
  CHECK(chi / 2000 == doctest::Approx(1.0).epsilon(4 * std::sqrt(2.0 / 2000)));
}

TEST_CASE("shop fronts are lit more often and brighter than flats of their group, all of them together") {
  std::vector<Emitter> house;
  for (std::uint16_t i = 0; i < 6; ++i) {
    house.push_back(make(LightClass::window_building, static_cast<std::uint16_t>(10 + i), 3));
    house.back().shop_front = i < 3;
  }
  int lit = 0;
  for (int v = 0; v < kVariants; ++v) {
    const std::vector<Activation> a = draw(house, static_cast<std::uint32_t>(v));
    for (int i = 0; i < 3; ++i) {
      const Activation& shop = a[static_cast<std::size_t>(i)];
      CHECK_UNARY(shop.probability >= 0.7F && shop.probability <= 0.95F);
      CHECK_UNARY(shop.strength >= 15.0F && shop.strength <= 120.0F);
      CHECK_UNARY(shop.lit == a[0].lit);
    }
    CHECK_UNARY(a[4].probability <= 0.6F && a[4].strength <= 15.0F);
    if (v < 100) {  // flats are drawn as they are without shops
      std::vector<Emitter> flats = house;
      for (Emitter& e : flats) e.shop_front = false;
      CHECK(same(a[4], draw(flats, static_cast<std::uint32_t>(v))[4]));
    }
    lit += a[0].lit ? 1 : 0;
  }
  CHECK(static_cast<double>(lit) / kVariants == doctest::Approx(0.825).epsilon(0.01));
  ActivationParams by_text;
  by_text.by_text_alone = true;
  CHECK(draw(house, 0, 1, {}, by_text)[0].probability <= 0.6F);
  Emitter sign = make(LightClass::advertisement, 5);
  sign.shop_front = true;  // of no meaning
  CHECK(draw({sign}, 0)[0].strength == draw({make(LightClass::advertisement, 5)}, 0)[0].strength);
}

TEST_CASE("a window that shines by day is lit in every night, as strong as a shop's; not so by the text alone") {
  std::vector<Emitter> window = {make(LightClass::window_building, 5)};
  std::vector<Emitter> shining = window;
  shining[0].shines_by_day = true;
  ActivationParams by_text;
  by_text.by_text_alone = true;
  int dark = 0;
  for (std::uint32_t v = 0; v < 100; ++v) {
    const Activation a = draw(shining, v)[0];
    CHECK(a.lit);
    CHECK(a.probability == 1.0F);
    CHECK(a.strength >= 15.0F);
    dark += draw(shining, v, 1, {}, by_text)[0].lit ? 0 : 1;
  }
  CHECK(dark > 20);
  CHECK(certain_intensity_cd({}, shining[0]) > 0.0F);
  CHECK(certain_intensity_cd({}, window[0]) == 0.0F);
  CHECK(mean_intensity_cd({}, shining[0]) > 2.0F * mean_intensity_cd({}, window[0]));
}

TEST_CASE("groups are independent of each other, and so are windows that stand alone") {
  const std::vector<Emitter> pairs[] = {
      {make(LightClass::window_building, 10, 3), make(LightClass::window_building, 11, 4)},
      {make(LightClass::window_building, 10), make(LightClass::window_building, 11)},
      {make(LightClass::window_building, 4, 7), make(LightClass::window_building, 7)},  // group 7 against mark 7
      {make(LightClass::parked_rear, 10, 3, EmissionProfile::signal),
       make(LightClass::parked_rear, 11, 4, EmissionProfile::signal)}};
  for (const std::vector<Emitter>& pair : pairs) {
    double joint[2][2] = {};
    double p_sum[2] = {};
    double p_product = 0;
    for (int v = 0; v < kVariants; ++v) {
      const std::vector<Activation> a = draw(pair, static_cast<std::uint32_t>(v));
      joint[a[0].lit][a[1].lit] += 1.0;
      p_sum[0] += static_cast<double>(a[0].probability);
      p_sum[1] += static_cast<double>(a[1].probability);
      p_product += static_cast<double>(a[0].probability) * static_cast<double>(a[1].probability);
    }
    double chi2 = 0;
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 2; ++j) {
        const double expected = (joint[i][0] + joint[i][1]) * (joint[0][j] + joint[1][j]) / kVariants;
        chi2 += (joint[i][j] - expected) * (joint[i][j] - expected) / expected;
      }
    }
    CHECK(chi2 < 10.83);  // one degree of freedom, 0.1 %
    const double covariance = p_product / kVariants - p_sum[0] / kVariants * p_sum[1] / kVariants;
    CHECK(std::fabs(covariance) < 4 * 0.09 / 12 / std::sqrt(1.0 * kVariants));
  }
}

TEST_CASE("front and rear lamps of one car are switched together; two cars are not") {
  const std::vector<Emitter> cars = {make(LightClass::parked_front, 1, 20, EmissionProfile::signal),
                                     make(LightClass::parked_front, 2, 20, EmissionProfile::signal),
                                     make(LightClass::parked_rear, 3, 20, EmissionProfile::signal),
                                     make(LightClass::parked_rear, 4, 20, EmissionProfile::signal),
                                     make(LightClass::parked_rear, 5, 21, EmissionProfile::signal)};
  int differ = 0;
  for (std::uint32_t v = 0; v < 3000; ++v) {
    const std::vector<Activation> a = draw(cars, v);
    CHECK_UNARY(a[0].lit == a[1].lit && a[0].lit == a[2].lit && a[0].lit == a[3].lit);
    CHECK_UNARY(a[2].strength == a[3].strength);
    differ += a[3].lit != a[4].lit ? 1 : 0;
  }
  CHECK(differ > 500);
}

TEST_CASE("rear lamps of moving cars brake as often as asked, both at once, within the limits of UN R7") {
  const std::vector<Emitter> lamps = {make(LightClass::moving_rear, 1, 9, EmissionProfile::signal),
                                      make(LightClass::moving_rear, 2, 9, EmissionProfile::signal)};
  ActivationParams straight;
  straight.indicator_probability = 0;
  int braking = 0;
  for (int v = 0; v < kVariants; ++v) {
    const std::vector<Activation> a = draw(lamps, static_cast<std::uint32_t>(v), 1, {}, straight);
    CHECK_UNARY(a[0].strength == a[1].strength);
    const bool stop = a[0].strength > 50;
    braking += stop ? 1 : 0;
    CHECK_UNARY(stop ? (a[0].strength >= 59.99F && a[0].strength <= 185.01F)
                     : (a[0].strength >= 3.99F && a[0].strength <= 17.01F));
    CHECK_UNARY(a[0].intensity_cd.y == 0.0F);  // red
  }
  CHECK(std::fabs(braking / (1.0 * kVariants) - 0.35) < 4 * std::sqrt(0.35 * 0.65 / kVariants));
}

TEST_CASE(
    "an indicator turns one side of a car amber, as often as asked, and leaves bicycles and the other draws alone") {
  std::vector<Emitter> lamps = {make(LightClass::moving_rear, 1, 9, EmissionProfile::signal),
                                make(LightClass::moving_rear, 2, 9, EmissionProfile::signal),
                                make(LightClass::moving_rear, 3, 9, EmissionProfile::signal),
                                make(LightClass::moving_rear, 4, 8, EmissionProfile::signal)};
  lamps[0].centre_m.x = -1;
  lamps[1].centre_m.x = 1;
  lamps[2].centre_m.x = 1.1F;
  lamps[3].group_cls = LightClass::bicycle_group;
  ActivationParams often;
  often.indicator_probability = 0.5F;
  ActivationParams never;
  never.indicator_probability = 0;
  int left = 0;
  int right = 0;
  for (int v = 0; v < kVariants; ++v) {
    const std::vector<Activation> a = draw(lamps, static_cast<std::uint32_t>(v), 1, {}, often);
    const std::vector<Activation> straight = draw(lamps, static_cast<std::uint32_t>(v), 1, {}, never);
    const auto turns = [&](std::size_t i) { return !same(a[i], straight[i]); };
    CHECK_UNARY(!(turns(0) && turns(1)));
    CHECK_UNARY(turns(1) == turns(2));
    CHECK_UNARY(!turns(3));
    for (std::size_t i = 0; i < 3; ++i) {
      if (!turns(i)) continue;
      const float added = a[i].strength - straight[i].strength;
      CHECK_UNARY((added > 49.9F && added < 200.1F));
      CHECK_UNARY(a[i].xy.x < straight[i].xy.x);  // from red towards amber
      CHECK_UNARY(a[i].strength <= 385.1F);
    }
    if (!a[0].lit) continue;
    left += turns(0) ? 1 : 0;
    right += turns(1) ? 1 : 0;
  }
  CHECK(std::fabs(left / (0.975 * kVariants) - 0.25) < 0.015);
  CHECK(std::fabs(right / (0.975 * kVariants) - 0.25) < 0.015);
}

TEST_CASE("by the text alone each lamp is drawn by itself with the p of its group, whatever the class") {
  ActivationParams text;
  text.by_text_alone = true;
  const std::vector<Emitter> car = {make(LightClass::parked_front, 1, 9, EmissionProfile::signal),
                                    make(LightClass::parked_rear, 2, 9, EmissionProfile::signal),
                                    make(LightClass::parked_rear, 3, 9, EmissionProfile::signal)};
  const std::vector<Emitter> lamps = {make(LightClass::street_light_lt, 1, 0, EmissionProfile::street_luminaire),
                                      make(LightClass::street_light_lt, 2, 0, EmissionProfile::street_luminaire)};
  int differ = 0;
  int technologies = 0;
  for (std::uint32_t v = 0; v < 2000; ++v) {
    const std::vector<Activation> a = draw(car, v, 1, {}, text);
    CHECK_UNARY((a[0].probability == a[1].probability && a[1].probability == a[2].probability));
    differ += a[1].lit != a[2].lit ? 1 : 0;
    const std::vector<Activation> b = draw(lamps, v, 1, {}, text);
    technologies += std::fabs(b[0].xy.x - b[1].xy.x) > 0.03F ? 1 : 0;
  }
  CHECK(differ > 300);
  CHECK(technologies > 500);
}

TEST_CASE("street lamps of an image share their technology, with a small jitter") {
  std::vector<Emitter> lamps;
  for (std::uint16_t i = 0; i < 8; ++i) {
    lamps.push_back(make(i < 4 ? LightClass::street_light_ht : LightClass::street_light_lt,
                         static_cast<std::uint16_t>(i + 1), 0, EmissionProfile::street_luminaire));
  }
  for (std::uint32_t v = 0; v < 200; ++v) {
    const std::vector<Activation> a = draw(lamps, v);
    for (std::size_t i = 0; i < lamps.size(); ++i) {
      const Activation& first = a[i < 4 ? 0 : 4];
      CHECK_UNARY(std::fabs(a[i].xy.x - first.xy.x) <= 0.0061F);
      CHECK_UNARY(a[i].strength / first.strength < 1.1F / 0.9F + 1e-4F);
      CHECK_UNARY(a[i].lit);
    }
    CHECK_UNARY(a[4].xy.x > 0.47F);  // sodium
    CHECK_UNARY(a[0].xy.x < 0.46F);
  }
}

TEST_CASE("a street lamp on a low post carries less light, unless its strength was measured") {
  Emitter low = make(LightClass::street_light_ht, 1, 0, EmissionProfile::street_luminaire);
  Emitter high = low;
  high.mounting_height_m = 8.0F;
  // With the square of the height between the types, and no further: a height is known no better than a distance.
  for (const auto& [height, share] : {std::pair(3.5F, 0.25), std::pair(5.0F, 25.0 / 64), std::pair(12.0F, 1.0)}) {
    low.mounting_height_m = height;
    const float ratio = draw({low}, 0)[0].strength / draw({high}, 0)[0].strength;
    CHECK(ratio == doctest::Approx(share).epsilon(1e-4));
  }
  const LightSetEntry set[] = {{LightClass::street_light_ht, 6000.0F, {0.4F, 0.39F}}};
  ActivationParams params;
  params.light_set = set;
  params.street_strength_jitter = 0;
  CHECK(draw({low}, 0, 1, {}, params)[0].strength == 6000.0F);
}

TEST_CASE("same seed, same night; order, company and class of other emitters change nothing") {
  std::vector<Emitter> some;
  for (std::uint16_t i = 1; i <= 30; ++i) {
    some.push_back(make(i % 3 == 0 ? LightClass::clock : LightClass::window_building, i,
                        i % 4 == 0 ? std::uint16_t{40} : std::uint16_t{0}));
  }
  const std::vector<Activation> a = draw(some, 3, 99);
  const std::vector<Activation> again = draw(some, 3, 99);
  std::vector<Emitter> reversed(some.rbegin(), some.rend());
  const std::vector<Activation> b = draw(reversed, 3, 99);
  int differs_by_seed = 0;
  int differs_by_variant = 0;
  const std::vector<Activation> other_seed = draw(some, 3, 100);
  const std::vector<Activation> other_variant = draw(some, 4, 99);
  for (std::size_t i = 0; i < some.size(); ++i) {
    CHECK(same(a[i], again[i]));
    CHECK(same(a[i], b[some.size() - 1 - i]));
    CHECK(same(a[i], draw({some[i]}, 3, 99)[0]));
    differs_by_seed += a[i].lit != other_seed[i].lit ? 1 : 0;
    differs_by_variant += a[i].lit != other_variant[i].lit ? 1 : 0;
  }
  CHECK(differs_by_seed > 0);
  CHECK(differs_by_variant > 0);
}

TEST_CASE("unlit means no light at all; lit means finite light") {
  std::vector<Emitter> all;
  for (int c = 0; c < kLightClassCount; ++c) {
    for (const EmissionProfile p : {EmissionProfile::lambert, EmissionProfile::street_luminaire,
                                    EmissionProfile::low_beam, EmissionProfile::signal}) {
      all.push_back(make(static_cast<LightClass>(c), static_cast<std::uint16_t>(all.size() + 1), 0, p));
    }
  }
  for (std::uint32_t v = 0; v < 50; ++v) {
    const std::vector<Activation> out = draw(all, v);
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (out[i].lit) {
        CHECK_UNARY(is_finite(out[i].intensity_cd) && luminance(out[i].intensity_cd) > 0);
        CHECK_UNARY(luminance(out[i].luminance_cd_m2) > 0);
      } else {
        CHECK_UNARY(out[i].intensity_cd == Vec3f{} && out[i].luminance_cd_m2 == Vec3f{});
      }
      if (is_group(all[i].cls) || all[i].cls == LightClass::none) CHECK_UNARY_FALSE(out[i].lit);
    }
  }
}

TEST_CASE("a signal keeps its annotated colour, whatever the daytime colour or the light set say") {
  const LightSetEntry set[] = {{LightClass::inferred_object, 77.0F, {0.2F, 0.2F}}};
  ActivationParams params;
  params.light_set = set;
  Emitter e = make(LightClass::inferred_object, 1, 0, EmissionProfile::signal);
  const Vec2f expected[] = {chromaticity::signal_red, chromaticity::signal_amber, chromaticity::signal_green};
  const SignalState states[] = {SignalState::red, SignalState::amber, SignalState::green};
  for (int i = 0; i < 3; ++i) {
    e.state = states[i];
    const Activation a = draw({e}, 0, 1, {{0.1F, 0.9F, 0.1F}}, params)[0];
    CHECK(a.xy.x == expected[i].x);
    CHECK(a.xy.y == expected[i].y);
    CHECK(a.strength == 77.0F);
    CHECK(a.lit);
  }
}

TEST_CASE("a signal of unknown state follows its daytime colour; a white one is drawn from red, amber and green") {
  const Emitter e = make(LightClass::inferred_object, 1, 0, EmissionProfile::signal);
  CHECK(draw({e}, 0, 1, {{0.8F, 0.05F, 0.03F}})[0].xy.x == chromaticity::signal_red.x);
  CHECK(draw({e}, 0, 1, {{0.9F, 0.4F, 0.05F}})[0].xy.x == chromaticity::signal_amber.x);
  CHECK(draw({e}, 0, 1, {{0.2F, 0.9F, 0.6F}})[0].xy.x == chromaticity::signal_green.x);
  int red = 0;
  int green = 0;
  for (int v = 0; v < kVariants; ++v) {
    const float x = draw({e}, static_cast<std::uint32_t>(v), 1, {{0.8F, 0.8F, 0.75F}})[0].xy.x;
    red += x == chromaticity::signal_red.x ? 1 : 0;
    green += x == chromaticity::signal_green.x ? 1 : 0;
  }
  CHECK(std::fabs(red / (1.0 * kVariants) - 0.5) < 4 * 0.5 / std::sqrt(1.0 * kVariants));
  CHECK(std::fabs(green / (1.0 * kVariants) - 0.45) < 4 * 0.5 / std::sqrt(1.0 * kVariants));
}

TEST_CASE("of the three discs of a traffic light exactly one is on, the colours by place, and it varies") {
  std::vector<Emitter> panel;
  for (std::uint16_t i = 0; i < 3; ++i) {
    panel.push_back(make(LightClass::inferred_object, static_cast<std::uint16_t>(i + 1), 8, EmissionProfile::signal));
    panel.back().centre_m.y = -4.0F + 0.3F * static_cast<float>(i);
  }
  int on[3] = {};
  for (std::uint32_t v = 0; v < 3000; ++v) {
    const std::vector<Activation> a = draw(panel, v);
    CHECK_UNARY(static_cast<int>(a[0].lit) + static_cast<int>(a[1].lit) + static_cast<int>(a[2].lit) == 1);
    for (int i = 0; i < 3; ++i) on[i] += a[static_cast<std::size_t>(i)].lit ? 1 : 0;
    CHECK_UNARY(a[0].xy.x == chromaticity::signal_red.x && a[1].xy.x == chromaticity::signal_amber.x &&
                a[2].xy.x == chromaticity::signal_green.x);
  }
  for (const int n : on) CHECK(std::fabs(n - 1000.0) < 4 * std::sqrt(3000 * 2.0 / 9));
  // By day the lowest glows green: that is the one, in every night.
  const std::vector<Vec3f> day = {{0.02F, 0.02F, 0.02F}, {0.03F, 0.02F, 0.02F}, {0.1F, 0.7F, 0.4F}};
  for (std::uint32_t v = 0; v < 50; ++v) CHECK_UNARY(draw(panel, v, 1, day)[2].lit);
  // The annotator knows better than the colour.
  panel[0].state = SignalState::red;
  for (std::uint32_t v = 0; v < 50; ++v) {
    const std::vector<Activation> a = draw(panel, v, 1, day);
    CHECK_UNARY(a[0].lit && !a[1].lit && !a[2].lit);
  }
}

TEST_CASE("a light set replaces strength and colour of its classes only, all entries get their turn") {
  const LightSetEntry set[] = {{LightClass::window_building, 11.0F, {0.40F, 0.39F}},
                               {LightClass::clock, 5.0F, {0.3F, 0.3F}},
                               {LightClass::window_building, 22.0F, {0.45F, 0.41F}}};
  ActivationParams params;
  params.light_set = set;
  int first = 0;
  for (std::uint32_t v = 0; v < 2000; ++v) {
    const std::vector<Activation> a =
        draw({make(LightClass::window_building, 1), make(LightClass::advertisement, 2)}, v, 1, {}, params);
    const bool one = a[0].strength == 11.0F && a[0].xy.x == 0.40F;
    const bool two = a[0].strength == 22.0F && a[0].xy.x == 0.45F;
    CHECK_UNARY(one || two);
    first += one ? 1 : 0;
    CHECK_UNARY(a[1].strength >= 7.9F);
    CHECK_UNARY(a[1].strength <= 60.1F);
  }
  CHECK(std::fabs(first - 1000.0) < 4 * std::sqrt(500.0));
}

TEST_CASE("bicycles that are parked are lit less often") {
  Emitter e = make(LightClass::parked_rear, 1, 5, EmissionProfile::signal);
  e.group_cls = LightClass::bicycle_group;
  for (std::uint32_t v = 0; v < 200; ++v) {
    const float p = draw({e}, v)[0].probability;
    CHECK_UNARY(p >= 0.1F && p <= 0.2F);
  }
}

TEST_CASE("activation refuses lengths that disagree and parameters out of range") {
  const Emitter e[] = {make(LightClass::clock, 1)};
  Activation out[2];
  CHECK(activate_lights({}, 0, 0, e, {}, out).code() == StatusCode::shape_mismatch);
  ActivationParams bad;
  bad.stop_probability = 1.5F;
  CHECK(activate_lights(bad, 0, 0, e, {}, Span<Activation>(out, 1)).code() == StatusCode::invalid_argument);
  const LightSetEntry set[] = {{LightClass::clock, 1.0F, {0.4F, 0.0F}}};
  ActivationParams black;
  black.light_set = set;
  CHECK(activate_lights(black, 0, 0, e, {}, Span<Activation>(out, 1)).code() == StatusCode::invalid_argument);
  CHECK(activate_lights({}, 0, 0, Span<const Emitter>(), {}, Span<Activation>()).ok());
}
