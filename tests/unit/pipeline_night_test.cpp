// SPDX-License-Identifier: Apache-2.0
// The whole method on the generated street, and on scenes that lack nearly everything.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <vector>

#include "fixture.hpp"
#include "made_street.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/memory.hpp"
#include "npsim/mesh/check.hpp"
#include "npsim/pipeline/night.hpp"
#include "street/scene_view.hpp"
#include "street/street.hpp"
#include "tool/engine.hpp"

namespace {

using namespace npsim;

// What a scene view looks into.
struct Scene {
  io::Image<Rgb8> image;
  io::Image<float> depth;
  io::Image<Label> labels;
  SceneView view;

  explicit Scene(Shape shape) : image(shape, Rgb8{90, 90, 95}), depth(shape, 10.0F) {
    view.camera = intrinsics_from_fov(shape, 1.2F);
    refresh();
  }
  void refresh() {
    view.image = image.view();
    view.depth = depth.view();
    view.labels = labels.view();
  }
};

// Keeps what the pipeline hands over.
struct Keeper {
  std::vector<io::Image<Vec3f>> nights;
  std::vector<io::Image<Rgb8>> pictures;
  std::vector<std::vector<bool>> lit;
  std::vector<LightClass> classes;
  io::Image<float> refined;
  MeshReport mesh;

  Status reconstructed(const RefinedDepth& depth, const SceneMesh& scene, const Relighting& light) {
    refined = io::Image<float>(depth.depth.shape());
    for (int y = 0; y < refined.height(); ++y) {
      for (int x = 0; x < refined.width(); ++x) refined(x, y) = depth.depth(x, y);
    }
    for (const Emitter& e : light.emitters) classes.push_back(e.cls);
    npsim_test::Scratch scratch(check_mesh_workspace_bytes(scene.mesh.vertices.size(), scene.mesh.faces.size()));
    Workspace& workspace = scratch.workspace();
    return check_mesh(scene.mesh, workspace, mesh);
  }
  Status night(const Night& night) {
    io::Image<Vec3f> linear(night.luminance.shape());
    io::Image<Rgb8> picture(night.picture.shape());
    for (int y = 0; y < linear.height(); ++y) {
      for (int x = 0; x < linear.width(); ++x) {
        linear(x, y) = night.luminance(x, y);
        picture(x, y) = night.picture(x, y);
      }
    }
    nights.push_back(linear);
    pictures.push_back(picture);
    lit.emplace_back();
    for (const Activation& a : night.activations) lit.back().push_back(a.lit);
    return {};
  }
};

Status run(const NightParams& params, const SceneView& view, AnyExecutor executor, Keeper& keeper) {
  const std::size_t bytes = night_workspace_bytes(params, view.shape(), view.lights.size());
  const std::unique_ptr<unsigned char[]> memory(new unsigned char[bytes]);
  Workspace workspace(memory.get(), bytes);
  NullObserver observer;
  return engine::make_nights(params, view, workspace, executor, observer, keeper);
}

const street::Street& small_street() {
  static const street::Street shared = testing::made_street(5, {160, 90});
  return shared;
}

double mean_luminance(const io::Image<Vec3f>& image, int first_row, int last_row) {
  double sum = 0;
  for (int y = first_row; y < last_row; ++y) {
    for (int x = 0; x < image.width(); ++x) sum += static_cast<double>(luminance(image(x, y)));
  }
  return sum / (static_cast<double>(last_row - first_row) * image.width());
}

}  // namespace

TEST_CASE("night of the street: finite, road brighter than sky, lit lamps brighter than the road, mesh whole") {
  NightParams params = default_night_params();
  params.variants = 2;
  Keeper keeper;
  ThreadPool pool(2);
  REQUIRE(run(params, view_of(small_street()), pool, keeper).ok());
  REQUIRE(keeper.nights.size() == 2);
  const io::Image<Vec3f>& night = keeper.nights[0];
  double brightest = 0;
  for (int y = 0; y < night.height(); ++y) {
    for (int x = 0; x < night.width(); ++x) {
      REQUIRE(is_finite(night(x, y)));
      REQUIRE(night(x, y).x >= 0);
      brightest = std::max(brightest, static_cast<double>(luminance(night(x, y))));
    }
  }
  double sky = 0;
  double road = 0;
  int sky_count = 0;
  int road_count = 0;
  for (int y = 0; y < night.height(); ++y) {
    for (int x = 0; x < night.width(); ++x) {
      if (small_street().light_index(x, y) != 0) continue;
      const auto l = static_cast<double>(luminance(night(x, y)));
      if (small_street().labels(x, y) == label::sky) sky += l, ++sky_count;
      if (small_street().labels(x, y) == label::road) road += l, ++road_count;
    }
  }
  REQUIRE(sky_count > 100);
  REQUIRE(road_count > 1000);
  CHECK(road / road_count > 3 * sky / sky_count);
  // EN 13201 streets have 0.3 to 2 cd/m2; the range allows for near headlamps.
  CHECK(road / road_count > 0.1);
  CHECK(road / road_count < 10);
  CHECK(brightest > 100 * road / road_count);
  CHECK(keeper.mesh.oriented_manifold());
}

TEST_CASE("night of the street: serial and any number of threads give the same bits") {
  NightParams params = default_night_params();
  Keeper serial_keeper;
  SerialExecutor serial;
  REQUIRE(run(params, view_of(small_street()), serial, serial_keeper).ok());
  for (const unsigned threads : {2U, 5U}) {
    ThreadPool pool(threads);
    Keeper keeper;
    REQUIRE(run(params, view_of(small_street()), pool, keeper).ok());
    bool same = true;
    for (int y = 0; y < 90; ++y) {
      for (int x = 0; x < 160; ++x) {
        same = same && keeper.nights[0](x, y) == serial_keeper.nights[0](x, y) &&
               keeper.refined(x, y) == serial_keeper.refined(x, y) &&
               keeper.pictures[0](x, y).g == serial_keeper.pictures[0](x, y).g;
      }
    }
    CHECK(same);
  }
}

TEST_CASE("night of the street: a variant does not depend on how many others are made") {
  NightParams params = default_night_params();
  params.variants = 1;
  Keeper one;
  ThreadPool pool(2);
  REQUIRE(run(params, view_of(small_street()), pool, one).ok());
  params.variants = 3;
  Keeper three;
  REQUIRE(run(params, view_of(small_street()), pool, three).ok());
  CHECK(one.lit[0] == three.lit[0]);
  CHECK(three.lit[0] != three.lit[1]);
  bool same = true;
  for (int y = 0; y < 90; ++y) {
    for (int x = 0; x < 160; ++x) same = same && one.nights[0](x, y) == three.nights[0](x, y);
  }
  CHECK(same);
}

namespace {

// Between unit vectors.
double angle_rad(const Vec3f& a, const Vec3f& b) {
  return std::acos(static_cast<double>(std::fmin(1.0F, std::fmax(-1.0F, dot(a, b)))));
}

// Mean relative error of the depth and mean angle between its normals and the true ones.
struct StreetErrors {
  double depth = 0;
  double normals_rad = 0;
};

StreetErrors errors_of(const street::Street& street, ImageView<const float> depth) {
  const Shape shape = depth.shape();
  io::Image<Vec3f> normals(shape);
  SerialExecutor serial;
  Workspace none;
  REQUIRE(normals_from_depth({}, depth, street.intrinsics, normals.view(), none, serial).ok());
  StreetErrors sum;
  double count = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const float truth = street.depth(x, y);
      if (!is_valid_depth(truth)) continue;
      sum.depth += static_cast<double>(std::fabs(depth(x, y) - truth) / truth);
      sum.normals_rad += angle_rad(normals(x, y), street.normals(x, y));
      ++count;
    }
  }
  return {sum.depth / count, sum.normals_rad / count};
}

}  // namespace

TEST_CASE("refine_depth brings depth and normals of the street nearer to the truth on every seed and at every size") {
  for (const Shape shape : {Shape{160, 90}, Shape{480, 270}}) {
    for (const std::uint64_t seed : {1U, 2U, 3U, 7U}) {
      const street::Street street = testing::plain_street(seed, shape);
      ThreadPool pool(2);
      const StreetErrors before = errors_of(street, street.est_depth.view());
      const RefineDepthParams refine;
      for (const bool height_known : {true, false}) {
        SceneView view = view_of(street);
        if (height_known) view.camera_height_m = street.camera_height_m;
        npsim_test::Scratch scratch(refine_depth_workspace_bytes(refine, shape));
        Workspace& workspace = scratch.workspace();
        NullObserver observer;
        RefinedDepth refined;
        REQUIRE(engine::refine_depth(refine, view, workspace, pool, observer, refined).ok());
        const StreetErrors after = errors_of(street, refined.depth);
        CHECK(after.depth < (height_known ? 0.85 : 0.95) * before.depth);
        CHECK(after.normals_rad < (shape.width < 200 ? 0.8 : 0.5) * before.normals_rad);
      }
    }
  }
}

// Mean angle between the normals that light falls on and the true ones, of some labels.
double normals_off_rad(const street::Street& street, ImageView<const Vec3f> normals, LabelSet labels) {
  double sum = 0;
  double count = 0;
  for (int y = 0; y < normals.height(); ++y) {
    for (int x = 0; x < normals.width(); ++x) {
      if (!labels.contains(street.labels(x, y)) || street.normals(x, y) == Vec3f{}) continue;
      sum += angle_rad(normals(x, y), street.normals(x, y));
      ++count;
    }
  }
  return sum / count;
}

TEST_CASE(
    "refine_depth: cars and poles of a network's depth without normals stand as such things do, given normals stay") {
  const Shape shape{480, 270};
  const street::Street street = testing::plain_street(1, shape);
  ThreadPool pool(2);
  NullObserver observer;
  RefineDepthParams shaped;
  shaped.plants = {};  // has no say in it
  RefineDepthParams plain = shaped;
  plain.cars.enabled = plain.furniture.enabled = plain.masts.enabled = false;
  const auto refined = [&](const RefineDepthParams& refine, const SceneView& view, Workspace& workspace) {
    RefinedDepth out;
    REQUIRE(engine::refine_depth(refine, view, workspace, pool, observer, out).ok());
    REQUIRE(out.source == DepthSource::network);
    return out;
  };
  SceneView view = view_of(street);
  npsim_test::Scratch one(refine_depth_workspace_bytes(shaped, shape));
  npsim_test::Scratch other(refine_depth_workspace_bytes(plain, shape));
  {
    const WorkspaceScope scope(one.workspace());
    const WorkspaceScope other_scope(other.workspace());
    const RefinedDepth with = refined(shaped, view, one.workspace());
    const RefinedDepth without = refined(plain, view, other.workspace());
    bool same = true;
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        same = same && with.normals(x, y) == without.normals(x, y) && with.mesh_depth(x, y) == without.mesh_depth(x, y);
      }
    }
    CHECK(same);
  }
  view.normals = {};
  const RefinedDepth with = refined(shaped, view, one.workspace());
  const RefinedDepth without = refined(plain, view, other.workspace());
  constexpr LabelSet kThin = kPoleLabels | kSignLabels;
  CHECK(normals_off_rad(street, with.normals, kThin) < 0.6 * normals_off_rad(street, without.normals, kThin));
  const LabelSet cars = LabelSet::of(label::car);
  CHECK(normals_off_rad(street, with.normals, cars) < 0.9 * normals_off_rad(street, without.normals, cars));
}

// The rectangle of a scene's planes.
SceneView part_of(SceneView view, int x, int y, Shape shape) {
  view.image = view.image.sub(x, y, shape);
  view.depth = view.depth.sub(x, y, shape);
  view.labels = view.labels.sub(x, y, shape);
  view.instances = view.instances.sub(x, y, shape);
  view.normals = {};
  view.albedo = {};
  view.roughness = {};
  view.light_index = {};
  return view;
}

TEST_CASE("refine_depth runs in the memory it asks for: either preset, what a scene may lack, one row, one column") {
  SerialExecutor serial;
  NullObserver observer;
  const SceneView street = view_of(small_street());
  for (const bool thesis : {false, true}) {
    for (int known = 0; known < 3; ++known) {
      for (const SceneView& part : {street, part_of(street, 20, 80, {64, 1}), part_of(street, 80, 20, {1, 64})}) {
        SceneView view = part;
        if (known < 2) view.instances = {};
        if (known < 1) view.labels = {};
        RefineDepthParams params = thesis ? RefineDepthParams::thesis() : RefineDepthParams{};
        params.refine.adam.steps = 1;
        npsim_test::Scratch scratch(refine_depth_workspace_bytes(params, view.shape()));
        RefinedDepth refined;
        const Status status = engine::refine_depth(params, view, scratch.workspace(), serial, observer, refined);
        CHECK_MESSAGE(status.ok(), status.message());
      }
    }
  }
}

TEST_CASE("night: image, depth and camera alone are enough, and all light is the own headlamps' and the sky's") {
  Scene scene({64, 48});
  Keeper keeper;
  SerialExecutor serial;
  REQUIRE(run(default_night_params(), scene.view, serial, keeper).ok());
  CHECK(keeper.classes.size() == 2);
  CHECK(mean_luminance(keeper.nights[0], 0, 48) > 0.05);
}

TEST_CASE("night: one pixel, one row and one column run to the end") {
  for (const Shape shape : {Shape{1, 1}, Shape{17, 1}, Shape{1, 17}, Shape{2, 2}}) {
    Scene scene(shape);
    Keeper keeper;
    SerialExecutor serial;
    const Status status = run(default_night_params(), scene.view, serial, keeper);
    CHECK_MESSAGE(status.ok(), status.message());
  }
}

TEST_CASE("night: a rectification frame on one row or column, or everywhere, stays inside the image") {
  for (const Shape shape : {Shape{1, 300}, Shape{300, 1}, Shape{40, 30}}) {
    for (const Label frame : {label::rectification_border, label::out_of_roi}) {
      Scene scene(shape);
      scene.labels = io::Image<Label>(shape, frame);
      scene.labels(shape.width / 2, shape.height / 2) = label::road;
      scene.refresh();
      Keeper keeper;
      SerialExecutor serial;
      const Status status = run(default_night_params(), scene.view, serial, keeper);
      CHECK_MESSAGE(status.ok(), status.message());
    }
  }
}

TEST_CASE("night: two photographs with one seed share no draw") {
  Keeper a;
  Keeper b;
  ThreadPool pool(2);
  NightParams params = default_night_params();
  REQUIRE(run(params, view_of(small_street()), pool, a).ok());
  params.photograph = 1;
  REQUIRE(run(params, view_of(small_street()), pool, b).ok());
  CHECK(a.lit[0] != b.lit[0]);
}

TEST_CASE("night: a following car adds two lamps that light the road's sides, and its own lane as good as not") {
  Scene scene({64, 48});
  SerialExecutor serial;
  NightParams params = default_night_params();
  Keeper alone, followed;
  params.relight.ego_headlamps = false;
  REQUIRE(run(params, scene.view, serial, alone).ok());
  params.relight.following_car_m = 12.0F;
  REQUIRE(run(params, scene.view, serial, followed).ok());
  CHECK(followed.classes.size() == alone.classes.size() + 2);
  const auto gain = [&](int x, int y) {
    return static_cast<double>(luminance(followed.nights[0](x, y)) - luminance(alone.nights[0](x, y)));
  };
  CHECK(gain(4, 40) > 0.05);
  CHECK(gain(4, 40) > 10.0 * gain(32, 40));  // that is bounced light
  for (const Vec3f& p : followed.nights[0].view().pixels()) CHECK(is_finite(p));
}

TEST_CASE("night: parameters that are not finite or out of range are refused before the first stage begins") {
  struct Counting : NullObserver {
    int begun = 0;
    void begin(Stage) noexcept { ++begun; }
  };
  Scene scene({16, 12});
  SerialExecutor serial;
  NullSink sink;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto code = [&](auto&& spoil) {
    NightParams params = default_night_params();
    spoil(params);
    Counting observer;
    npsim_test::Scratch scratch(night_workspace_bytes(params, scene.view.shape(), 0));
    const Status status = engine::make_nights(params, scene.view, scratch.workspace(), serial, observer, sink);
    CHECK(observer.begun == 0);
    return status.code();
  };
  CHECK(code([&](NightParams& p) { p.depth.filter.use_colour = false; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.depth.normals.ground.max_rad = nan; }) == StatusCode::invalid_argument);
  scene.view.camera_height_m = nan;
  CHECK(code([](NightParams&) {}) == StatusCode::invalid_argument);
  scene.view.camera_height_m = 0;
  CHECK(code([&](NightParams& p) { p.camera.exposure.compensation = 2; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.camera.exposure.iso_min = nan; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.camera.white_balance.adaptation = 2; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.camera.residual_noise = -1; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.mesh.simplify.max_texture_shift = nan; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.depth.refine.gauss_newton.steps = -1; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.relight.placement.max_side_m = nan; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.relight.f0 = nan; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.relight.f0 = 7; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.relight.material.wide_if_guessed.alpha = nan; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.relight.following_car_m = nan; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.relight.following_car_m = 3; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.relight.bounces = 0; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.relight.sky.zenith_cd_m2.x = nan; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.relight.denoise.plane_sigma = 0; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.relight.unsure_light.reach = nan; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.depth.filter.sigma_s_px = nan; }) == StatusCode::invalid_argument);
  CHECK(code([&](NightParams& p) { p.variants = 0; }) == StatusCode::invalid_argument);
}

TEST_CASE("night: labels that change in every pixel, and holes of NaN in the depth, run to the end") {
  Scene scene({60, 40});
  scene.labels = io::Image<Label>(scene.image.shape());
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 60; ++x) {
      scene.labels(x, y) = static_cast<Label>((x * 7 + y * 13) % kLabelCount);
      scene.depth(x, y) = (x + y) % 5 == 0 ? std::numeric_limits<float>::quiet_NaN() : 3.0F + static_cast<float>(x % 9);
    }
  }
  scene.refresh();
  Keeper keeper;
  SerialExecutor serial;
  const Status status = run(default_night_params(), scene.view, serial, keeper);
  REQUIRE_MESSAGE(status.ok(), status.message());
  CHECK(keeper.mesh.oriented_manifold());
}

TEST_CASE("night: depth without a single valid sample, or nothing but sky, is no_valid_input") {
  Scene invalid({16, 16});
  for (int i = 0; i < 256; ++i) invalid.depth(i % 16, i / 16) = i % 2 == 0 ? 0.0F : -1.0F;
  Keeper keeper;
  SerialExecutor serial;
  CHECK(run(default_night_params(), invalid.view, serial, keeper).code() == StatusCode::no_valid_input);
  Scene sky({16, 16});
  sky.labels = io::Image<Label>(sky.image.shape(), label::sky);
  sky.refresh();
  CHECK(run(default_night_params(), sky.view, serial, keeper).code() == StatusCode::no_valid_input);
}

TEST_CASE("night: planes of another size and light indices without a mark are refused") {
  Scene scene({16, 16});
  const io::Image<float> small({8, 8}, 5.0F);
  scene.view.depth = small.view();
  Keeper keeper;
  SerialExecutor serial;
  CHECK(run(default_night_params(), scene.view, serial, keeper).code() == StatusCode::shape_mismatch);
  scene.refresh();
  io::Image<std::uint16_t> index({16, 16});
  index(3, 3) = 1;
  scene.view.light_index = index.view();
  CHECK(run(default_night_params(), scene.view, serial, keeper).code() == StatusCode::invalid_argument);
}

TEST_CASE(
    "night: what the workspace is asked for is at most 1.3 times what is used, on the street with and without labels, "
    "dry and wet") {
  street::StreetParams street_params;
  street_params.shape = {480, 270};
  const street::Street street = testing::made_street(street_params);
  ThreadPool pool(2);
  NightParams params = default_night_params();
  params.relight.gather.rays = 1;
  struct Case {
    bool labelled;
    float wetness;
  };
  for (const Case& c : {Case{true, 0.0F}, Case{false, 0.0F}, Case{true, 1.0F}}) {
    params.relight.material.film.wetness = c.wetness;
    SceneView view = view_of(street);
    if (!c.labelled) {
      view.labels = {};
      view.instances = {};
      view.light_index = {};
      view.lights = {};
    }
    const std::size_t bound = night_workspace_bytes(params, view.shape(), view.lights.size());
    io::HostMemory memory(bound);
    REQUIRE(memory.ok());
    Workspace workspace = memory.workspace();
    NullObserver observer;
    NullSink sink;
    REQUIRE(engine::make_nights(params, view, workspace, pool, observer, sink).ok());
    CHECK(workspace.used() == 0);
    CHECK(memory.usable() <= bound);
    CHECK(static_cast<double>(memory.usable()) <= 1.3 * static_cast<double>(workspace.peak()));
  }
}

TEST_CASE(
    "night of a wet street: runs in the memory of its bound, the same bits for any number of threads, and it mirrors") {
  const SceneView view = view_of(small_street());
  NightParams params = default_night_params();
  params.seed = 3;
  Keeper dry, wet, threaded;
  SerialExecutor serial;
  REQUIRE(run(params, view, serial, dry).ok());
  params.relight.material.film.wetness = 1;
  REQUIRE(run(params, view, serial, wet).ok());
  ThreadPool pool(3);
  REQUIRE(run(params, view, pool, threaded).ok());
  double road = 0, changed = 0;
  for (int y = 0; y < view.shape().height; ++y) {
    for (int x = 0; x < view.shape().width; ++x) {
      const Vec3f light = wet.nights[0](x, y);
      CHECK(light == threaded.nights[0](x, y));
      CHECK_UNARY(is_finite(light) && light.x >= 0 && light.y >= 0 && light.z >= 0);
      if (view.labels(x, y) != label::road) continue;
      ++road;
      // Headlamps leave it ahead, lamps are mirrored in it.
      const float ratio = luminance(light) / luminance(dry.nights[0](x, y));
      if (!(ratio > 0.7F && ratio < 1.4F)) ++changed;
    }
  }
  CHECK(road > 1000);
  CHECK(changed > 0.5 * road);
}

TEST_CASE("night of a wet street: it does not mirror how a street lamp lights its own head; a dark window it does") {
  // Ground, and above it nothing but a column that is the marked thing from top to foot.
  Scene scene({96, 64});
  scene.labels = io::Image<Label>(scene.image.shape(), label::sky);
  io::Image<std::uint16_t> index(scene.image.shape());
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 96; ++x) {
      const float below = (static_cast<float>(y) + 0.5F - scene.view.camera.cy) / scene.view.camera.fy;
      scene.depth(x, y) = below > 0.05F ? 1.5F / below : 0.0F;
      if (below > 0.05F) scene.labels(x, y) = label::road;
      if (x < 46 || x >= 50 || y < 8 || below > 1.5F / 6.0F) continue;
      scene.depth(x, y) = 6.0F;
      scene.labels(x, y) = label::pole;
      index(x, y) = 1;
      scene.image(x, y) = {230, 230, 230};
    }
  }
  scene.refresh();
  LightMark mark;
  scene.view.light_index = index.view();
  scene.view.lights = {&mark, 1};
  NightParams params = default_night_params();
  params.relight.material.film.wetness = 1;
  params.relight.sky.zenith_cd_m2 = params.relight.sky.horizon_cd_m2 = {};
  SerialExecutor serial;
  for (const LightClass cls : {LightClass::street_light_ht, LightClass::window_building}) {
    mark.cls = cls;
    Keeper few, many;
    params.relight.mirror.rays = 1;
    REQUIRE(run(params, scene.view, serial, few).ok());
    params.relight.mirror.rays = 64;
    REQUIRE(run(params, scene.view, serial, many).ok());
    double most = 0, off = 0;
    for (int y = 0; y < 64; ++y) {
      for (int x = 0; x < 96; ++x) {
        if (scene.labels(x, y) != label::road) continue;
        const auto light = static_cast<double>(luminance(many.nights[0](x, y)));
        most = std::max(most, light);
        off = std::max(off, std::fabs(static_cast<double>(luminance(few.nights[0](x, y))) - light));
      }
    }
    CHECK(most > 0.1);                                            // cd/m2
    CHECK((off > 1e-6) == (cls == LightClass::window_building));  // the number of rays changes nothing
  }
}

TEST_CASE("night: a workspace one page short is a status, not a crash") {
  Scene scene({32, 24});
  const NightParams params = default_night_params();
  NullObserver observer;
  SerialExecutor serial;
  Keeper keeper;
  std::vector<unsigned char> memory(night_workspace_bytes(params, scene.view.shape(), scene.view.lights.size()));
  for (const std::size_t bytes : {std::size_t{0}, std::size_t{100}, memory.size() / 100, memory.size() / 10}) {
    Workspace workspace(memory.data(), bytes);
    CHECK(engine::make_nights(params, scene.view, workspace, serial, observer, keeper).code() ==
          StatusCode::workspace_exhausted);
  }
}

TEST_CASE("night: an observer that cancels stops the run with that status") {
  struct Cancelling : NullObserver {
    [[nodiscard]] bool cancelled() const noexcept { return true; }
  };
  Scene scene({32, 24});
  const NightParams params = default_night_params();
  npsim_test::Scratch scratch(night_workspace_bytes(params, scene.view.shape(), scene.view.lights.size()));
  Workspace& workspace = scratch.workspace();
  Cancelling observer;
  SerialExecutor serial;
  Keeper keeper;
  CHECK(engine::make_nights(params, scene.view, workspace, serial, observer, keeper).code() == StatusCode::cancelled);
}

TEST_CASE("night: the depth of refine_depth and the lamps of placement, handed in, give the same bits") {
  struct Lamps : Keeper {
    std::vector<Emitter> emitters;
    Status reconstructed(const RefinedDepth& depth, const SceneMesh& scene, const Relighting& light) {
      emitters.assign(light.emitters.begin(), light.emitters.end());
      return Keeper::reconstructed(depth, scene, light);
    }
  };
  const SceneView view = view_of(small_street());
  NightParams params = default_night_params();
  NullObserver observer;
  ThreadPool pool(2);
  io::HostMemory memory(night_workspace_bytes(params, view.shape(), view.lights.size()));
  Lamps whole;
  {
    Workspace workspace = memory.workspace();
    REQUIRE(engine::make_nights(params, view, workspace, pool, observer, whole).ok());
  }
  npsim_test::Scratch scratch(refine_depth_workspace_bytes(params.depth, view.shape()));
  RefinedDepth refined;
  REQUIRE(engine::refine_depth(params.depth, view, scratch.workspace(), pool, observer, refined).ok());
  params.relight.lamps = Span<const Emitter>(whole.emitters.data(), whole.emitters.size());
  params.relight.ego_headlamps = false;  // they are among the lamps
  Keeper parts;
  Workspace workspace = memory.workspace();
  REQUIRE(engine::make_nights_of_depth(params, view, refined, workspace, pool, observer, parts).ok());
  for (int y = 0; y < view.shape().height; ++y) {
    REQUIRE(std::memcmp(whole.nights[0].view().row(y), parts.nights[0].view().row(y),
                        sizeof(Vec3f) * static_cast<std::size_t>(view.shape().width)) == 0);
  }
  std::vector<std::uint8_t> shops(view.lights.size(), 1);
  params.relight.shop_fronts = {shops.data(), shops.size() - 1};
  CHECK(engine::make_nights_of_depth(params, view, refined, workspace, pool, observer, parts).code() ==
        StatusCode::shape_mismatch);
  params.relight.shop_fronts = {shops.data(), shops.size()};
  Lamps told;
  REQUIRE(engine::make_nights_of_depth(params, view, refined, workspace, pool, observer, told).ok());
  for (const Emitter& e : told.emitters) CHECK(e.shop_front == (e.mark != 0));
  params.relight.shop_fronts = {};
  whole.emitters[0].mark = static_cast<std::uint16_t>(view.lights.size() + 1);
  CHECK(engine::make_nights_of_depth(params, view, refined, workspace, pool, observer, parts).code() ==
        StatusCode::invalid_argument);
  refined.uncertain = {};
  CHECK(engine::make_nights_of_depth(params, view, refined, workspace, pool, observer, parts).code() ==
        StatusCode::shape_mismatch);
}
