// SPDX-License-Identifier: Apache-2.0
// One object of this for each instruction set, with the whole pipeline in it.
#include "night.hpp"

#include "npsim/npsim.hpp"

namespace {

constexpr npsim::Shape kShape{64, 48};

template <class T>
struct StaticImage {
  T pixels[kShape.pixels()];
  [[nodiscard]] npsim::ImageView<T> view() { return npsim::ImageView<T>(pixels, kShape); }
};

StaticImage<npsim::Rgb8> image;
StaticImage<float> depth_m;
StaticImage<npsim::Label> labels;
StaticImage<std::uint16_t> light_index;

// A road that ends at a house 12 m away, with one lamp on it, under the sky. The depth is a little rough.
npsim::SceneView small_street() {
  npsim::SceneView scene;
  scene.camera = {50.0F, 50.0F, 32.0F, 24.0F};
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const float below_horizon = static_cast<float>(y) + 0.5F - scene.camera.cy;
      const float road_m = below_horizon > 0 ? 1.5F * scene.camera.fy / below_horizon : 1000.0F;
      const float rough = 1.0F + 0.002F * static_cast<float>((7 * x + 5 * y) % 11 - 5);
      const bool sky = y < 6;
      const bool road = road_m < 12.0F;
      const bool lamp = x >= 40 && x < 44 && y >= 12 && y < 15;
      labels.view()(x, y) = sky ? npsim::label::sky : (road ? npsim::label::road : npsim::label::building);
      depth_m.view()(x, y) = sky ? 0.0F : rough * (road ? road_m : 12.0F);
      image.view()(x, y) =
          sky ? npsim::Rgb8{180, 200, 230} : (road ? npsim::Rgb8{90, 90, 95} : npsim::Rgb8{150, 120, 100});
      light_index.view()(x, y) = lamp ? 1 : 0;
    }
  }
  static constexpr npsim::LightMark kMarks[] = {
      {7, npsim::LightClass::street_light_ht, npsim::SignalState::unknown, 0}};
  scene.image = image.view();
  scene.depth = depth_m.view();
  scene.labels = labels.view();
  scene.light_index = light_index.view();
  scene.lights = kMarks;
  return scene;
}

// FNV-1a.
struct Hash {
  std::uint64_t value = 0xcbf29ce484222325U;

  template <class T>
  void add(const npsim::ImageView<const T>& pixels) {
    for (int y = 0; y < pixels.height(); ++y) {
      const auto* bytes = reinterpret_cast<const unsigned char*>(pixels.row(y));
      const std::size_t n = static_cast<std::size_t>(pixels.width()) * sizeof(T);
      for (std::size_t i = 0; i < n; ++i) value = (value ^ bytes[i]) * 0x100000001b3U;
    }
  }
  template <class Refined, class Mesh, class Light>
  npsim::Status reconstructed(const Refined&, const Mesh& mesh, const Light&) {
    const auto& vertices = mesh.mesh.vertices;
    add(npsim::ImageView<const npsim::Vec3f>(vertices.data(), {static_cast<int>(vertices.size()), 1}));
    return {};
  }
  npsim::Status night(const npsim::Night& night) {
    add(night.luminance);
    add(night.picture);
    return {};
  }
};

}  // namespace

extern "C" std::uint64_t DISPATCH_JOIN(night_, DISPATCH_SET)(unsigned char* memory, std::size_t bytes) {
  npsim::NightParams params = npsim::default_night_params();
  params.variants = 2;
  npsim::Workspace workspace(memory, bytes);
  npsim::SerialExecutor executor;
  npsim::NullObserver observer;
  Hash hash;
  const npsim::Status status = npsim::make_nights(params, small_street(), workspace, executor, observer, hash);
  return status.ok() ? hash.value : 0;
}
