// SPDX-License-Identifier: Apache-2.0
// The core as a target without an operating system uses it: static memory, no exceptions, no RTTI. The heap is
// replaced by a trap, so that an allocation anywhere in the core fails the test. First the pieces that everything
// stands on, then the whole method on a small street. The exit status is the number of the first check that failed.
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <new>

#include "npsim/npsim.hpp"

void* operator new(std::size_t) { std::abort(); }
void* operator new[](std::size_t) { std::abort(); }
void operator delete(void*) noexcept {}
void operator delete[](void*) noexcept {}
void operator delete(void*, std::size_t) noexcept {}
void operator delete[](void*, std::size_t) noexcept {}

namespace {

constexpr npsim::Shape kShape{64, 48};
constexpr std::size_t kPixels = kShape.pixels();

alignas(npsim::kWorkspaceAlignment) unsigned char memory[std::size_t{32} << 20U];

template <class T>
struct StaticImage {
  T pixels[kPixels];
  [[nodiscard]] npsim::ImageView<T> view() { return npsim::ImageView<T>(pixels, kShape); }
};

StaticImage<npsim::Rgb8> image;
StaticImage<float> depth_m;
StaticImage<npsim::Label> labels;
StaticImage<std::uint16_t> light_index;
StaticImage<npsim::Rgb8> first_picture;
StaticImage<npsim::Rgb8> picture;

int check_core() {
  constexpr std::size_t kBytes =
      npsim::allocation_bytes<npsim::Vec3f>(kPixels) + npsim::allocation_bytes<float>(kPixels);
  npsim::Workspace workspace(memory, kBytes);
  npsim::ImageView<npsim::Vec3f> points;
  npsim::ImageView<float> depth;
  if (!workspace.allocate_image(kShape, points).ok()) return 1;
  if (!workspace.allocate_image(kShape, depth).ok()) return 2;

  const npsim::Intrinsics camera = npsim::intrinsics_from_fov(kShape, 1.2F);
  const npsim::SerialExecutor executor;
  executor.for_chunks(static_cast<std::size_t>(kShape.height), 4, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const auto pixel = static_cast<std::uint32_t>(y * kShape.width + x);
        npsim::RandomStream random(1, npsim::RandomPurpose::test, 0, 0, pixel, 0);
        depth(x, y) = random.uniform(1.0F, 80.0F);
        points(x, y) = npsim::unproject_pixel(camera, x, y, depth(x, y));
      }
    }
  });
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const npsim::Vec2f p = npsim::project(camera, points(x, y));
      if (!(std::fabs(p.x - (static_cast<float>(x) + 0.5F)) < 1e-3F)) return 3;
      if (!(std::fabs(p.y - (static_cast<float>(y) + 0.5F)) < 1e-3F)) return 4;
    }
  }

  npsim::Span<float> too_much;
  if (workspace.allocate(1, too_much).code() != npsim::StatusCode::workspace_exhausted) return 5;
  return workspace.peak() == workspace.capacity() ? 0 : 6;
}

// A road that ends at a house 12 m away, with one lamp on it, under the sky.
npsim::SceneView small_street() {
  npsim::SceneView scene;
  scene.camera = npsim::intrinsics_from_fov(kShape, 1.2F);
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const float below_horizon = static_cast<float>(y) + 0.5F - scene.camera.cy;
      const float road_m = below_horizon > 0 ? 1.5F * scene.camera.fy / below_horizon : 1000.0F;
      const bool sky = y < 6;
      const bool road = road_m < 12.0F;
      const bool lamp = x >= 40 && x < 44 && y >= 12 && y < 15;
      labels.view()(x, y) = sky ? npsim::label::sky : (road ? npsim::label::road : npsim::label::building);
      depth_m.view()(x, y) = sky ? 0.0F : (road ? road_m : 12.0F);
      image.view()(x, y) =
          sky ? npsim::Rgb8{180, 200, 230} : (road ? npsim::Rgb8{90, 90, 95} : npsim::Rgb8{150, 120, 100});
      light_index.view()(x, y) = lamp ? 1 : 0;
    }
  }
  static const npsim::LightMark marks[] = {{7, npsim::LightClass::street_light_ht, npsim::SignalState::unknown, 0}};
  scene.image = image.view();
  scene.depth = depth_m.view();
  scene.labels = labels.view();
  scene.light_index = light_index.view();
  scene.lights = marks;
  return scene;
}

struct Sink {
  std::size_t faces = 0;
  int nights = 0;
  bool finite = true;
  float brightest = 0;
  template <class Refined, class Mesh, class Light>
  npsim::Status reconstructed(const Refined&, const Mesh& mesh, const Light&) {
    faces = mesh.mesh.faces.size();
    return {};
  }
  npsim::Status night(const npsim::Night& night) {
    if (nights == 0) npsim::copy_pixels(night.picture, first_picture.view());
    ++nights;
    for (int y = 0; y < kShape.height; ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        finite = finite && npsim::is_finite(night.luminance(x, y));
        brightest = std::fmax(brightest, npsim::luminance(night.luminance(x, y)));
      }
    }
    return {};
  }
};

int check_night() {
  const npsim::SceneView scene = small_street();
  npsim::NightParams params = npsim::default_night_params();
  params.variants = 2;
  const std::size_t need = npsim::night_workspace_bytes(params, scene.shape(), scene.lights.size());
  if (need > sizeof(memory)) return 11;
  npsim::SerialExecutor executor;
  npsim::NullObserver observer;

  npsim::Workspace workspace(memory, need);
  Sink sink;
  if (!npsim::make_nights(params, scene, workspace, executor, observer, sink).ok()) return 12;
  if (sink.nights != 2 || sink.faces == 0) return 13;
  if (!sink.finite || !(sink.brightest > 0)) return 14;

  // In one call the first of them is made, of the scene's size and no other.
  npsim::Workspace again(memory, need);
  if (!npsim::make_night(params, scene, again, executor, picture.view()).ok()) return 16;
  for (std::size_t i = 0; i < kPixels; ++i) {
    const npsim::Rgb8 a = first_picture.pixels[i];
    const npsim::Rgb8 b = picture.pixels[i];
    if (a.r != b.r || a.g != b.g || a.b != b.b) return 17;
  }
  const npsim::ImageView<npsim::Rgb8> smaller = picture.view().sub(0, 0, {kShape.width - 1, kShape.height});
  if (npsim::make_night(params, scene, again, executor, smaller).code() != npsim::StatusCode::shape_mismatch) return 18;

  // With too little memory it stops with a reason, wherever the memory ends.
  for (std::size_t part = 0; part < 8; ++part) {
    npsim::Workspace small(memory, workspace.peak() * part / 8);
    Sink nothing;
    const npsim::Status status = npsim::make_nights(params, scene, small, executor, observer, nothing);
    if (status.code() != npsim::StatusCode::workspace_exhausted) return 15;
  }
  return 0;
}

}  // namespace

int main() {
  const int core = check_core();
  return core != 0 ? core : check_night();
}
