// SPDX-License-Identifier: Apache-2.0
// Sheet, pruning, foreground completion and index against their definitions, bit by bit: every number of lanes, chunks
// in any order, rows that end within a word and pictures wider than a strip.
#include <cstring>
#include <vector>

#include "mesh_fixture.hpp"
#include "npsim/mesh/detail/background/anchors.hpp"
#include "npsim/simd/batch.hpp"
#include "reference/mesh_layers.hpp"

using namespace mesh_test;

namespace {

template <class T>
[[nodiscard]] bool same_bytes(const Image<T>& image, const std::vector<T>& expected) {
  std::size_t i = 0;
  for (int y = 0; y < image.shape().height; ++y) {
    for (int x = 0; x < image.shape().width; ++x, ++i) {
      if (std::memcmp(&image(x, y), &expected[i], sizeof(T)) != 0) return false;
    }
  }
  return i == expected.size();
}

// What stands between the rows is nobody's.
template <class T>
[[nodiscard]] bool padding_intact(const Image<T>& image, const Image<T>& fresh) {
  const int width = image.shape().width;
  for (int y = 0; y < image.shape().height; ++y) {
    if (std::memcmp(image.view().row(y) + width, fresh.view().row(y) + width, sizeof(T) * kPadding) != 0) return false;
  }
  return true;
}

struct Options {
  BackgroundParams background;
  ForegroundParams foreground;
  PruneParams prune;
  bool instances = true;
  bool masks = true;  // surface and uncertain
};

template <class F, class Executor>
void compare(Picture& p, const Options& o, Executor& executor) {
  const ImageView<const std::uint8_t> surface = o.masks ? p.surface.cview() : ImageView<const std::uint8_t>();
  const ImageView<const std::uint8_t> uncertain = o.masks ? p.uncertain.cview() : ImageView<const std::uint8_t>();
  const ImageView<const std::uint16_t> instances = o.instances ? p.instances.cview() : ImageView<const std::uint16_t>();
  Picture fresh(p.shape);
  p.sheet = fresh.sheet;
  p.foreground = fresh.foreground;
  p.object = fresh.object;

  reference::Layer sheet = reference::build_sheet({}, p.depth.cview(), surface, p.intrinsics);
  REQUIRE(build_sheet<F>({}, p.depth.cview(), surface, p.intrinsics, p.sheet.view(), executor).ok());
  REQUIRE(same_bytes(p.sheet.vertices, sheet.vertices));
  REQUIRE(same_bytes(p.sheet.quads, sheet.quads));

  BackgroundInput behind = p.background_input();
  behind.uncertain = uncertain;
  behind.surface = surface;
  Scratch for_background(complete_background_workspace_bytes(o.background, p.shape));
  REQUIRE(complete_background(o.background, behind, p.background.view(), p.state.view(), for_background.workspace(),
                              executor)
              .ok());
  const reference::Objects objects = reference::complete_foreground(
      o.foreground, sheet, {p.labels.cview(), instances, uncertain, p.state.cview(), p.intrinsics});
  ForegroundInput in = p.foreground_input();
  in.surface = surface;
  in.instances = instances;
  in.uncertain = uncertain;
  Scratch for_foreground(complete_foreground_workspace_bytes(o.foreground, p.shape));
  REQUIRE(complete_foreground<F>(o.foreground, in, p.foreground.view(), p.object.view(), for_foreground.workspace(),
                                 executor)
              .ok());
  REQUIRE(same_bytes(p.object, objects.object));
  REQUIRE(same_bytes(p.foreground.vertices, objects.layer.vertices));
  REQUIRE(same_bytes(p.foreground.quads, objects.layer.quads));

  reference::prune(o.prune, p.uncertain.cview(), p.labels.cview(), sheet);
  REQUIRE(prune<F>(o.prune, p.uncertain.cview(), p.labels.cview(), p.sheet.view(), executor).ok());
  REQUIRE(same_bytes(p.sheet.quads, sheet.quads));

  REQUIRE(padding_intact(p.sheet.vertices, fresh.sheet.vertices));
  REQUIRE(padding_intact(p.sheet.quads, fresh.sheet.quads));
  REQUIRE(padding_intact(p.foreground.vertices, fresh.foreground.vertices));
  REQUIRE(padding_intact(p.foreground.quads, fresh.foreground.quads));
  REQUIRE(padding_intact(p.object, fresh.object));
}

template <class F, class Executor>
void compare_index(const SheetLayer& layer, Executor& executor) {
  const reference::Mesh expected = reference::index_layer(layer);
  MeshSize size = mesh_size<F>(layer);
  REQUIRE(size.vertices == expected.vertices.size());
  REQUIRE(size.faces == expected.faces.size());
  Indexed mesh{std::vector<Vec3f>(size.vertices), std::vector<Face>(size.faces),
               std::vector<std::uint32_t>(size.vertices)};
  Scratch scratch(index_layer_workspace_bytes(layer.vertices.shape()));
  const MeshBuffers out{
      {mesh.vertices.data(), size.vertices}, {mesh.faces.data(), size.faces}, {mesh.pixels.data(), size.vertices}};
  REQUIRE(index_layer<F>(layer, 0, out, size, scratch.workspace(), executor).ok());
  REQUIRE(mesh.pixels == expected.pixels);
  REQUIRE(mesh.vertices == expected.vertices);
  REQUIRE((size.faces == 0 || std::memcmp(mesh.faces.data(), expected.faces.data(), size.faces * sizeof(Face)) == 0));
}

void compare_all(Picture& p, const Options& o) {
  SerialExecutor serial;
  BackwardExecutor reverse;
  compare<simd::F32>(p, o, serial);
  compare<simd::F32>(p, o, reverse);
  compare<simd::scalar::F32>(p, o, serial);
  for (const SheetLayer& layer : {p.sheet.view(), p.foreground.view()}) {
    compare_index<simd::F32>(layer, reverse);
    compare_index<simd::scalar::F32>(layer, serial);
  }
}

// Blobs of labels, smeared with single pixels; `change`: the share of pixels that change the label at random.
Picture random_picture(Shape shape, std::uint32_t trial) {
  RandomStream random(11, RandomPurpose::test, trial, 0, 0, 0);
  Picture p(shape);
  if (trial % 4 == 1) p.intrinsics = {1310.5F, 1290.25F, 12.75F, 9.5F};
  const Label choice[] = {label::road, label::car,    label::pole, label::sky,
                          label::car,  label::person, 99,          static_cast<Label>(63)};
  const float change = trial % 3 == 0 ? 0.9F : (trial % 3 == 1 ? 0.02F : 0.0F);
  const float doubt = trial % 2 == 0 ? 0.1F : 0.7F;
  const auto below = [&random](int n) { return static_cast<int>(random.uniform(0.0F, static_cast<float>(n))); };
  for (int blob = 0; blob < 2 + shape.width / 20; ++blob) {
    const int x = below(shape.width);
    const int y = below(shape.height);
    const float z = random.uniform(2.0F, 60.0F);
    const Label l = choice[below(8)];
    const int right = std::min(shape.width - 1, x + below(90));
    const int bottom = std::min(shape.height - 1, y + below(40));
    p.rectangle(x, y, right, bottom, l, z);
    if (random.uniform() < 0.5F) p.doubt(x, y, right, bottom);
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (random.uniform() < change) p.rectangle(x, y, x, y, choice[below(8)], random.uniform(1.0F, 60.0F));
      if (random.uniform() < 0.05F) p.depth(x, y) = kNaN;
      if (random.uniform() < 0.3F) p.depth(x, y) *= random.uniform(0.9F, 1.1F);
      if (change > 0.1F && random.uniform() < doubt) p.uncertain(x, y) = 255;
      p.instances(x, y) = static_cast<std::uint16_t>(x < shape.width / 2 ? 26000 : 26256);  // they differ above 8 bits
    }
  }
  return p;
}

}  // namespace

TEST_CASE("random pictures of every width up to two words, bit by bit") {
  for (std::uint32_t trial = 0; trial < 2 * 131; ++trial) {
    CAPTURE(trial);
    Picture p = random_picture({1 + static_cast<int>(trial / 2), 1 + static_cast<int>(trial * 7 % 23)}, trial);
    Options o;
    if (trial % 5 == 0) o.background = BackgroundParams::thesis();
    if (trial % 2 == 0) o.foreground.widen_thin = false;
    if (trial % 7 == 0) o.foreground.foreground = LabelSet::all();
    if (trial % 2 == 1) o.prune.policy = PrunePolicy::keep_within_foreground;
    o.instances = trial % 4 < 2;
    o.masks = trial % 9 != 0;
    compare_all(p, o);
  }
}

TEST_CASE("pictures wider than a strip of columns, with more rows than a chunk, bit by bit") {
  for (const int width : {1023, 1024, 1025, 1026, 2049}) {
    CAPTURE(width);
    Picture p = random_picture({width, 35}, static_cast<std::uint32_t>(width));
    compare_all(p, {});
  }
}

TEST_CASE("faces that are there or not at random, two fans and more at a vertex: the index as defined") {
  for (std::uint32_t trial = 0; trial < 40; ++trial) {
    CAPTURE(trial);
    RandomStream random(13, RandomPurpose::test, trial, 0, 0, 0);
    Picture p({60 + static_cast<int>(trial) * 2, 19});
    const float density = 0.5F + 0.0125F * static_cast<float>(trial);
    for (int y = 0; y + 1 < p.shape.height; ++y) {
      for (int x = 0; x + 1 < p.shape.width; ++x) {
        unsigned quad = random.uniform() < 0.5F ? 0U : kQuadAntiDiagonal;
        if (random.uniform() < density) quad |= kQuadUpperFace;
        if (random.uniform() < density) quad |= kQuadLowerFace;
        p.sheet.quads(x, y) = static_cast<std::uint8_t>(quad);
      }
    }
    SerialExecutor executor;
    compare_index<simd::F32>(p.sheet.view(), executor);
    compare_index<simd::scalar::F32>(p.sheet.view(), executor);
  }
}

namespace {

template <class F>
void check_states(Picture& p, bool marked, bool masks, bool in_place) {
  SerialExecutor executor;
  REQUIRE(build_sheet<F>({}, p.depth.cview(), {}, p.intrinsics, p.sheet.view(), executor).ok());
  const Layer before = p.sheet;
  const LabelSet removed = LabelSet::of(label::car, label::person, 63);
  for (int y = 0; y < p.shape.height; ++y) {
    for (int x = 0; x < p.shape.width; ++x) p.state(x, y) = p.instances(x, y) % 3 == 0 ? 7 : 0;
    const std::vector<std::uint8_t> marks(p.state.view().row(y), p.state.view().row(y) + p.shape.width);
    mesh_detail::find_states<F>(marked ? nullptr : &removed, p.labels.view().row(y),
                                masks ? p.uncertain.view().row(y) : nullptr, masks ? p.surface.view().row(y) : nullptr,
                                p.sheet.vertices.view().row(y), p.shape.width, p.state.view().row(y));
    Layer& kept = in_place ? p.sheet : p.background;
    mesh_detail::keep_known<F>(p.state.view().row(y), p.sheet.vertices.view().row(y), p.shape.width,
                               kept.vertices.view().row(y));
    for (int x = 0; x < p.shape.width; ++x) {
      const bool gone = marked ? marks[static_cast<std::size_t>(x)] != 0 : removed.contains(p.labels(x, y));
      const bool blocked = !gone && masks && p.surface(x, y) == 0;
      const bool missing = gone || (masks && p.uncertain(x, y) != 0) || !has_vertex(before.vertices(x, y));
      REQUIRE(p.state(x, y) == (blocked ? row_state::blocked : missing ? row_state::missing : row_state::known));
      REQUIRE(kept.vertices(x, y) == (blocked || missing ? Vec3f{} : before.vertices(x, y)));
    }
    REQUIRE(p.state.view().row(y)[p.shape.width] == 78);
    REQUIRE(kept.vertices.view().row(y)[p.shape.width] == Vec3f{7, 7, 7});
  }
}

}  // namespace

TEST_CASE("states of the background as defined, and what is kept, in place and not") {
  for (std::uint32_t trial = 0; trial < 64; ++trial) {
    CAPTURE(trial);
    Picture p = random_picture({1 + static_cast<int>(trial) * 3, 5}, trial);
    for (int y = 0; y < 5; ++y) {
      for (int x = 0; x < p.shape.width; ++x) p.instances(x, y) = static_cast<std::uint16_t>(x * x + y);
    }
    Picture copy = p;
    check_states<simd::F32>(p, trial % 2 == 0, trial % 3 != 0, trial % 4 < 2);
    check_states<simd::scalar::F32>(copy, trial % 2 == 0, trial % 3 != 0, trial % 4 < 2);
  }
}

TEST_CASE("a spiral, a comb and a picture in doubt as a whole, bit by bit") {
  const Shape shape{150, 97};
  Picture spiral(shape);
  for (int ring = 0; 4 * ring + 3 < shape.height; ++ring) {
    const int a = 2 * ring;
    spiral.rectangle(a, a, shape.width - 1 - a, a, label::car, 5.0F);
    spiral.rectangle(shape.width - 1 - a, a, shape.width - 1 - a, shape.height - 1 - a, label::car, 5.0F);
    spiral.rectangle(a, shape.height - 1 - a, shape.width - 1 - a, shape.height - 1 - a, label::car, 5.0F);
    spiral.rectangle(a, a + 2, a, shape.height - 1 - a, label::car, 5.0F);
    spiral.rectangle(a, a + 2, a + 2, a + 2, label::car, 5.0F);
  }
  spiral.doubt(0, 0, shape.width - 1, shape.height - 1);
  spiral.uncertain(0, 0) = 0;  // the search follows the arm to the middle
  spiral.depth(0, 0) = 3.0F;
  compare_all(spiral, {});
  CHECK(spiral.foreground.vertices(shape.width / 2, 46).z == 3.0F);

  Picture comb(shape);
  for (int x = 0; x < shape.width; x += 2) comb.rectangle(x, 0, x, 95, label::person, static_cast<float>(x + 1));
  comb.rectangle(0, 96, shape.width - 1, 96, label::person, 4.0F);
  compare_all(comb, {});
  CHECK(comb.object(148, 0) == 1);

  RandomStream random(12, RandomPurpose::test, 0, 0, 0, 0);
  Picture doubtful(shape);  // one object of thousands of samples and many of a few: both ways to a median
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const Label l = x < 90 ? label::bus : (random.uniform() < 0.5F ? label::person : label::rider);
      doubtful.rectangle(x, y, x, y, l, std::exp(random.uniform(-4.0F, 13.0F)));
    }
  }
  doubtful.doubt(0, 0, shape.width - 1, shape.height - 1);
  compare_all(doubtful, {});
}
