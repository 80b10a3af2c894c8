// SPDX-License-Identifier: Apache-2.0
// Nights as sums of lights: groups, weights, the error that is asked for.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "made_street.hpp"
#include "night_of_street.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/pipeline/detail/rays_for_error.hpp"
#include "npsim/pipeline/detail/surface_attributes.hpp"
#include "npsim/pipeline/night.hpp"
#include "street/scene_view.hpp"
#include "street/street.hpp"
#include "unit/fixture.hpp"
#include "unit/standing_blocks.hpp"

namespace {

using namespace npsim;

Emitter lamp(LightClass cls, std::uint16_t mark, std::uint16_t group, EmissionProfile profile) {
  Emitter e;
  e.cls = cls;
  e.mark = mark;
  e.group = group;
  e.profile = profile;
  e.area_m2 = 1.0F;
  return e;
}

const street::Street& small_street() {
  static const street::Street shared = testing::made_street(1, {160, 90});
  return shared;
}

// Lights each emitter alone, and all at once.
struct Sink {
  double error = 0;
  int rays = 0;
  std::size_t groups = 0;
  double later_batches = 0;  // sum of the indirect luminance of all groups but those of the first batch
  double worst = 0;          // relative, of the sum of single lamps against all of them
  io::Image<Vec3f> night_image;

  Status reconstructed(const RefinedDepth&, const SceneMesh&, const Relighting& light) {
    error = light.error;
    rays = light.rays;
    groups = light.groups.count;
    SerialExecutor serial;
    const Shape shape = light.visible_point.shape();
    std::vector<Vec3f> weights(light.images.count), one(light.images.count);
    io::Image<Vec3f> all(shape), single(shape), sum(shape);
    for (std::size_t g = kLightsAtOnce; g < groups; ++g) weights[g] = {1, 1, 1};
    REQUIRE(sum_light_images(light.images, {weights.data(), weights.size()}, all.view(), serial).ok());
    for (std::size_t p = 0; p < shape.pixels(); ++p) {
      later_batches += static_cast<double>(luminance(all.view().data()[p]));
    }
    const Span<const Activation> lit = light.of_variant(0);
    relight_detail::light_weights(light.groups, [lit](std::size_t e) { return lit[e].intensity_cd; },
                                  {weights.data(), weights.size()});
    REQUIRE(sum_light_images(light.images, {weights.data(), weights.size()}, all.view(), serial).ok());
    for (std::size_t i = 0; i < weights.size(); ++i) {
      if (weights[i] == Vec3f{}) continue;
      one.assign(one.size(), Vec3f{});
      one[i] = weights[i];
      REQUIRE(sum_light_images(light.images, {one.data(), one.size()}, single.view(), serial).ok());
      for (std::size_t p = 0; p < shape.pixels(); ++p) sum.view().data()[p] += single.view().data()[p];
    }
    for (std::size_t p = 0; p < shape.pixels(); ++p) {
      const double whole = static_cast<double>(luminance(all.view().data()[p]));
      const double parts = static_cast<double>(luminance(sum.view().data()[p]));
      if (whole > 0) worst = std::max(worst, std::fabs(parts / whole - 1));
    }
    return {};
  }
  Status night(const Night& night) {
    night_image = io::Image<Vec3f>(night.luminance.shape());
    copy_pixels(night.luminance, night_image.view());
    return {};
  }
};

}  // namespace

TEST_CASE(
    "light groups: windows of a dark street share one by floors, as do own headlamps; what is never lit has none") {
  std::vector<Emitter> emitters{lamp(LightClass::window_building, 1, 9, EmissionProfile::lambert),
                                lamp(LightClass::advertisement, 2, 0, EmissionProfile::lambert),
                                lamp(LightClass::window_building, 3, 9, EmissionProfile::lambert),
                                lamp(LightClass::window_building, 4, 8, EmissionProfile::lambert),
                                lamp(LightClass::moving_front, 0, 0, EmissionProfile::low_beam),
                                lamp(LightClass::moving_front, 0, 0, EmissionProfile::low_beam),
                                lamp(LightClass::clock, 5, 9, EmissionProfile::lambert)};
  std::vector<Activation> drawn(2 * emitters.size());
  drawn[0].lit = true;                    // variant 0: the first window
  drawn[emitters.size() + 1].lit = true;  // variant 1: the sign
  for (const std::size_t own : {4U, 5U, 11U, 12U}) drawn[own].lit = true;
  npsim_test::Scratch scratch(light_groups_bytes(emitters.size()) + kWorkspaceAlignment);
  LightGroups groups;
  REQUIRE(relight_detail::group_lights({}, {emitters.data(), emitters.size()}, 2, {drawn.data(), drawn.size()},
                                       scratch.workspace(), groups)
              .ok());
  CHECK(groups.count == 4);                   // with the sky
  CHECK(groups.group[0] == groups.group[2]);  // whole, though the second is never lit
  CHECK(groups.group[3] == kNoGroup);
  CHECK(groups.group[6] == kNoGroup);
  CHECK(groups.group[4] == groups.group[5]);
  CHECK(groups.group[1] != groups.group[0]);
  CHECK(groups.group[4] < groups.group[0]);  // light that is certain comes first

  std::vector<Vec3f> weights(groups.image_count());
  relight_detail::light_weights(groups,
                                [&](std::size_t e) {
                                  return e == 0 ? Vec3f{1, 2, 3} * groups.peak_cd[0] : Vec3f{};
                                },
                                {weights.data(), weights.size()});
  CHECK(weights[0] == Vec3f{1, 1, 1});
  CHECK(weights[groups.image_of_emitter(0)] == Vec3f{1, 2, 3});
  CHECK(weights[groups.image_of_emitter(2)] == Vec3f{});
  CHECK(weights[groups.group[0]].y == doctest::Approx(1));  // one of two equal windows
}

TEST_CASE("light groups: beside lit street lamps all windows share one, lit or not; the sum of weights stays") {
  std::vector<Emitter> emitters{lamp(LightClass::window_building, 1, 9, EmissionProfile::lambert),
                                lamp(LightClass::window_building, 2, 8, EmissionProfile::lambert),
                                lamp(LightClass::window_building, 3, 7, EmissionProfile::lambert),
                                lamp(LightClass::street_light_ht, 4, 0, EmissionProfile::street_luminaire),
                                lamp(LightClass::moving_front, 0, 0, EmissionProfile::low_beam)};
  std::vector<Activation> drawn(emitters.size());
  for (const std::size_t e : {0U, 3U, 4U}) drawn[e].lit = true;
  npsim_test::Scratch scratch(light_groups_bytes(emitters.size()) + kWorkspaceAlignment);
  LightGroups groups;
  REQUIRE(relight_detail::group_lights({}, {emitters.data(), emitters.size()}, 1, {drawn.data(), drawn.size()},
                                       scratch.workspace(), groups)
              .ok());
  CHECK(groups.count == 4);
  CHECK(groups.group[0] == groups.group[1]);
  CHECK(groups.group[0] == groups.group[2]);
  CHECK(groups.group[3] < groups.group[0]);
  CHECK(groups.group[4] < groups.group[0]);
  CHECK(groups.shines[0] == 1);
  CHECK(groups.shines[1] == 0);
  std::vector<Vec3f> weights(groups.image_count());
  relight_detail::light_weights(groups,
                                [&](std::size_t e) {
                                  return Vec3f{1, 1, 1} * groups.peak_cd[e];
                                },
                                {weights.data(), weights.size()});
  for (std::size_t g = 0; g < groups.count; ++g) CHECK(weights[g].y == doctest::Approx(1));
}

TEST_CASE("lights: the sum of the lamps' nights is the night of all of them within 1e-5") {
  const Sink sink = npsim::testing::night_of<Sink>(small_street(), default_night_params());
  CHECK(sink.worst < 1e-5);
  CHECK(sink.rays == GatherParams{}.rays);
}

TEST_CASE("lights: an odd number of filter passes loses none, over several batches, three bounces and a wet road") {
  NightParams params = default_night_params();
  params.relight.bounces = 3;
  params.relight.material.film.wetness = 0.8F;
  const auto indirect_after = [&](int iterations) {
    params.relight.denoise.iterations = iterations;
    const Sink sink = npsim::testing::night_of<Sink>(small_street(), params);
    CHECK(sink.groups > 2 * kLightsAtOnce);
    return sink.later_batches;
  };
  const double unfiltered = indirect_after(0);
  CHECK(unfiltered > 0);
  for (const int iterations : {1, 2, 3}) {
    INFO("iterations " << iterations);
    CHECK(indirect_after(iterations) == doctest::Approx(unfiltered).epsilon(0.03));
  }
}

namespace {

// Of the light of indirect rays alone: root mean square relative to the luminance, without the largest .1 %.
double noise_between(const Sink& converged, const Sink& noisy) {
  std::vector<double> squares;
  for (std::size_t p = 0; p < converged.night_image.shape().pixels(); ++p) {
    const double truth = static_cast<double>(luminance(converged.night_image.view().data()[p]));
    const double off = static_cast<double>(luminance(noisy.night_image.view().data()[p])) - truth;
    if (truth > 0.005) squares.push_back(off * off / (truth * truth + 0.005 * 0.005));
  }
  std::sort(squares.begin(), squares.end());
  squares.resize(squares.size() - squares.size() / 1000);
  double sum = 0;
  for (const double s : squares) sum += s;
  return std::sqrt(sum / static_cast<double>(squares.size()));
}

street::Street measured_street(DepthSource source) {
  street::StreetParams params;
  params.seed = 1;
  params.shape = {160, 90};
  params.depth = source;
  return testing::made_street(params);
}

}  // namespace

TEST_CASE("lights: the error that is said is that of the noise within a factor of 1.4, and one asked for is reached") {
  NightParams params = default_night_params();
  params.relight.denoise.iterations = 0;  // nothing but noise
  params.relight.gather.rays = 256;
  params.relight.max_rays = 256;
  const Sink converged = npsim::testing::night_of<Sink>(small_street(), params);
  Sink noisy;
  for (const int rays : {3, 4}) {  // halves of two rays and one, and of two
    params.relight.gather.rays = rays;
    noisy = npsim::testing::night_of<Sink>(small_street(), params);
    const double measured = noise_between(converged, noisy);
    CAPTURE(rays);
    CHECK(noisy.error > 0.7 * measured);
    CHECK(noisy.error < 1.4 * measured);
  }
  CHECK(converged.error < 0.2 * noisy.error);

  params.relight.max_error = static_cast<float>(0.4 * noisy.error);
  const Sink asked = npsim::testing::night_of<Sink>(small_street(), params);
  CHECK(asked.rays > 16);
  CHECK(asked.rays < 256);
  CHECK(asked.error <= static_cast<double>(params.relight.max_error));
}

TEST_CASE("lights: however slowly noise falls with the rays, the third try has an error that is asked for") {
  for (const double power : {-0.5, -0.42, -0.355, -0.26}) {
    for (const double wanted : {0.045, 0.02, 0.012}) {
      CAPTURE(power);
      CAPTURE(wanted);
      const auto error_of = [power](int rays) { return 0.05 * std::pow(0.5 * rays, power); };
      relight_detail::RaysForError search;
      int rays = 2;
      int tries = 1;
      for (; error_of(rays) > wanted; ++tries) {
        const int next = search.next(rays, error_of(rays), error_of(rays) / wanted, 100000);
        REQUIRE(next > rays);
        rays = next;
      }
      CHECK(tries <= 3);
      CHECK(error_of(rays) > 0.65 * wanted);  // nor many more rays than that takes
      CHECK(relight_detail::RaysForError().next(2, 0.05, 0.05 / wanted, 3) == 3);
    }
  }
}

TEST_CASE("lights: the error of a single ray is told from its neighbours', with the denoiser") {
  NightParams params = default_night_params();
  params.relight.gather.rays = 256;
  params.relight.max_rays = 256;
  const Sink converged = npsim::testing::night_of<Sink>(small_street(), params);
  params.relight.gather.rays = 1;
  const Sink noisy = npsim::testing::night_of<Sink>(small_street(), params);
  const double measured = noise_between(converged, noisy);
  CHECK(noisy.error > 0.5 * measured);
  CHECK(noisy.error < 2.0 * measured);
}

TEST_CASE(
    "lights by stereo and laser: the error is that of the spread noise; ground keeps its light, all keeps its sum") {
  for (const DepthSource source : {DepthSource::stereo, DepthSource::lidar}) {
    CAPTURE(kDepthSourceNames[static_cast<std::size_t>(source)]);
    const street::Street street = measured_street(source);
    SceneView view = view_of(street);
    view.depth_source = source;  // of so small a picture a laser's is not told
    NightParams params = default_night_params();
    params.relight.gather.rays = 64;
    const Sink converged = npsim::testing::night_of<Sink>(view, params);
    params.relight.gather.rays = 4;
    const Sink noisy = npsim::testing::night_of<Sink>(view, params);
    const double measured = noise_between(converged, noisy);
    CHECK(noisy.error > measured / 1.4);
    CHECK(noisy.error < 1.4 * measured);

    params.relight.unsure_light.reach = 0;
    const Sink as_traced = npsim::testing::night_of<Sink>(view, params);
    int road = 0, same = 0;
    double spread_sum = 0, traced_sum = 0;
    int spread_steps = 0, traced_steps = 0;  // of a factor of 8 from a pixel of a facade to the next
    const auto at = [](const Sink& sink, int x, int y) {
      return static_cast<double>(luminance(sink.night_image.view()(x, y)));
    };
    const auto is_step = [&](const Sink& sink, int x, int y) {
      const double a = at(sink, x, y), b = at(sink, x + 1, y);
      return std::max(a, b) > 0.02 && std::max(a, b) > 8 * std::min(a, b);
    };
    for (int y = 0; y < 90; ++y) {
      for (int x = 0; x + 1 < 160; ++x) {
        spread_sum += at(noisy, x, y);
        traced_sum += at(as_traced, x, y);
        if (view.labels(x, y) == label::road) {
          ++road;
          same += std::fabs(at(noisy, x, y) / at(as_traced, x, y) - 1) < 2e-3 ? 1 : 0;
        }
        if (view.labels(x, y) != label::building || view.labels(x + 1, y) != label::building) continue;
        spread_steps += is_step(noisy, x, y) ? 1 : 0;
        traced_steps += is_step(as_traced, x, y) ? 1 : 0;
      }
    }
    CAPTURE(spread_steps);
    CAPTURE(traced_steps);
    CAPTURE(same);
    CAPTURE(road);
    CHECK(100 * same > 99 * road);
    CHECK(spread_sum == doctest::Approx(traced_sum).epsilon(0.02));
    CHECK(10 * spread_steps < 8 * traced_steps);
  }
}

TEST_CASE(
    "vehicles and things have a wide gloss where their normals and roughness are guessed, but for those of exact "
    "depth") {
  struct Case {
    DepthSource source;
    bool labels, normals, roughness, changes;
  };
  const Case cases[] = {
      {DepthSource::stereo, true, false, false, true},  {DepthSource::lidar, true, false, false, true},
      {DepthSource::network, true, false, false, true}, {DepthSource::network, true, true, false, false},
      {DepthSource::stereo, true, true, false, false},  {DepthSource::stereo, true, false, true, false},
      {DepthSource::exact, true, false, false, false},  {DepthSource::stereo, false, false, false, true},
      {DepthSource::stereo, false, false, true, false}, {DepthSource::exact, false, false, false, false}};
  for (const Case& c : cases) {
    CAPTURE(kDepthSourceNames[static_cast<std::size_t>(c.source)]);
    CAPTURE(c.labels);
    CAPTURE(c.normals);
    CAPTURE(c.roughness);
    const street::Street& street = small_street();
    SceneView view = view_of(street);
    view.depth_source = c.source;
    if (!c.labels) {
      view.labels = {};
      view.albedo = {};  // things are told from buildings where albedo is guessed
    }
    if (!c.normals) view.normals = {};
    if (c.roughness) view.roughness = street.roughness.view();
    NightParams params = default_night_params();
    params.relight.gather.rays = 1;  // one is enough to differ
    const Sink wide = npsim::testing::night_of<Sink>(view, params);
    params.relight.material.wide_if_guessed = {};
    const Sink glossy = npsim::testing::night_of<Sink>(view, params);
    int changed = 0;
    for (int y = 0; y < 90; ++y) {
      for (int x = 0; x < 160; ++x) changed += wide.night_image(x, y) == glossy.night_image(x, y) ? 0 : 1;
    }
    CHECK((changed > 0) == c.changes);
  }
}

TEST_CASE("a thing among guessed labels has a wide gloss if its normals are guessed, else that of a building") {
  npsim_test::StandingBlocks blocks;
  const Shape shape = blocks.kShape;
  blocks.stand(0, shape.width, 20.0F, 7.5F);
  blocks.stand(100, 140, 8.0F, 1.3F);  // a car before a house
  const npsim_test::Image<Rgb8> image(shape, {100, 100, 100});
  const npsim_test::Image<Vec3f> normals(shape, Vec3f{0, 0, -1});
  const npsim_test::Image<Vec3f> given(shape, Vec3f{0.3F, 0.3F, 0.3F});
  const float house = surface_prior(label::building).alpha;
  const auto gloss = [&](DepthSource source, bool given_normals, bool given_albedo) {
    SceneView scene;
    scene.camera = blocks.kCamera;
    scene.image = image.view();
    if (given_normals) scene.normals = normals.view();
    if (given_albedo) scene.albedo = given.view();
    npsim_test::Image<Vec3f> facing(shape, Vec3f{0, 0, -1});
    RefinedDepth refined;
    refined.depth = blocks.depth.view();
    refined.labels = blocks.labels.cview();
    refined.normals = facing.view();
    refined.labels_guessed = true;
    refined.ground = blocks.kGround;
    refined.source = source;
    const MaterialParams params;
    npsim_test::Scratch scratch(guessed_albedo_workspace_bytes(params.albedo, shape) + kWorkspaceAlignment);
    npsim_test::Image<Vec3f> albedo(shape, Vec3f{});
    npsim_test::Image<float> alpha(shape, 0.0F);
    SerialExecutor serial;
    NullObserver nobody;
    REQUIRE(attributes_detail::albedo_and_gloss(params, scene, refined, albedo.view(), alpha.view(),
                                                scratch.workspace(), serial, nobody)
                .ok());
    CHECK(alpha(20, 40) == house);
    CHECK(alpha(20, 150) == surface_prior(label::road).alpha);
    return alpha(120, 80);
  };
  CHECK(gloss(DepthSource::lidar, false, false) == 1.0F);
  CHECK(gloss(DepthSource::exact, false, false) == house);
  CHECK(gloss(DepthSource::network, true, false) == house);
  CHECK(gloss(DepthSource::lidar, false, true) == house);
}
