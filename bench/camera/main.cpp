// SPDX-License-Identifier: Apache-2.0
// npsim_bench_camera: time of the camera's steps on one thread, as a multiple of the time that a copy of the float RGB
// image takes, and of a normal number beside the standard library's.
//
// Each round runs everything once, one after the other, so that a change of the machine's speed meets all alike;
// medians are printed. The picture is made of random light from .01 to 3 cd/m2 with a lamp in a thousand pixels; where it
// moves, it is a street of 16 m between facades, driven through at 10 m/s.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "../host.hpp"
#include "../options.hpp"
#include "../timing.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/io/image.hpp"
#include "npsim/pipeline/photograph.hpp"

namespace {

using namespace npsim;

using bench::Arena;
using bench::median;
using bench::must;
using bench::seconds;

struct Step {
  std::string name;
  double count;  // numbers or pixels per run
  std::function<void()> run;
  std::vector<double> times;
};

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Time of the camera's steps on one thread");
  int width = 1920;
  int height = 1080;
  int rounds = 9;
  app.add_option("--width", width)->check(CLI::Range(16, 16384))->capture_default_str();
  app.add_option("--height", height)->check(CLI::Range(16, 16384))->capture_default_str();
  app.add_option("--rounds", rounds)->check(CLI::Range(1, 1000))->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  const Shape shape{width, height};
  io::Image<Vec3f> light(shape);
  io::Image<Vec3f> other(shape);
  io::Image<float> plane(mosaic_shape(shape));
  io::Image<float> clean(mosaic_shape(shape));
  io::Image<Rgb8> picture(shape);
  io::Image<float> depth(shape);
  io::Image<PixelMotion> motion(shape);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      RandomStream random(1, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * width + x), 0);
      const float level = 0.01F * std::exp(5.7F * random.uniform());
      light(x, y) = Vec3f{1.3F, 1.0F, 0.6F} * (random.uniform() < 1e-3F ? 1e4F : level);
    }
  }
  const Intrinsics camera = intrinsics_from_fov(shape, 1.2F);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const float down = (static_cast<float>(y) + 0.5F - camera.cy) / camera.fy;
      const float aside = std::fabs(static_cast<float>(x) + 0.5F - camera.cx) / camera.fx;
      const float nearest = std::fmax(std::fmax(down / 1.4F, aside / 8.0F), 1.0F / 100.0F);
      depth(x, y) = down < -0.25F && nearest <= 0.01F ? 0.0F : 1.0F / nearest;
    }
  }
  const PhotographParams with_glare;
  PhotographParams without = with_glare;
  without.glare.halo = without.glare.veil = 0.0F;
  without.starburst = {};
  PhotographParams with_motion = with_glare;
  with_motion.motion.velocity_m_s = {0.0F, 0.0F, 10.0F};
  StarburstParams six_blades;
  six_blades.blades = 6;
  IspParams local_tone = with_glare.isp;
  local_tone.local.share = 0.8F;
  const PhotographedStreet street{depth.view(), {}, {}, {}, {}};
  Arena arena(photograph_workspace_bytes(with_motion, shape));
  Workspace& workspace = arena.workspace();
  SerialExecutor executor;
  const NoiseParams noise{noise_level(1600.0F).value(), with_glare.residual_noise};
  CameraExposure exposure;
  AutoExposureResult metered;
  Vec3f gains;
  volatile float sink = 0;
  const auto pixels = static_cast<double>(shape.pixels());
  const auto chain = [&](const PhotographParams& params) {
    must(photograph(params, camera, 0, 0, light.view(), picture.view(), exposure, workspace, executor, street));
  };
  constexpr int kNumbers = 1 << 20;
  std::vector<Step> steps = {
      {"copy of the float RGB image",
       pixels,
       [&] { std::memcpy(other.view().data(), light.view().data(), shape.pixels() * sizeof(Vec3f)); },
       {}},
      {"metering",
       pixels,
       [&] { must(auto_exposure(with_glare.exposure, light.view(), metered, workspace, executor)); },
       {}},
      {"motion of the pixels",
       pixels,
       [&] { must(motion_field(with_motion.motion, camera, depth.view(), {}, motion.view(), executor)); },
       {}},
      {"blur, rolling shutter",
       pixels,
       [&] {
         must(add_motion(with_motion.motion, with_motion.exposure.camera.time_s, motion.view(), {}, {}, light.view(),
                         other.view(), workspace, executor));
       },
       {}},
      {"glare",
       pixels,
       [&] { must(add_glare(with_glare.glare, camera.fx, light.view(), other.view(), workspace, executor)); },
       {}},
      {"streak of a windscreen",
       pixels,
       [&] { must(add_starburst(with_glare.starburst, camera.fx, light.view(), other.view(), workspace, executor)); },
       {}},
      {"starburst of six blades",
       pixels,
       [&] { must(add_starburst(six_blades, camera.fx, light.view(), other.view(), workspace, executor)); },
       {}},
      {"raw",
       pixels,
       [&] { must(capture(with_glare.sensor, 0.1F, noise, camera, 0, 0, light.view(), plane.view(), executor)); },
       {}},
      {"white balance",
       pixels,
       [&] {
         must(white_balance(with_glare.white_balance, with_glare.sensor, plane.view(), gains, workspace, executor));
       },
       {}},
      {"denoise",
       pixels,
       [&] { must(denoise_raw(with_glare.denoise, with_glare.sensor, noise, plane.view(), clean.view(), executor)); },
       {}},
      {"demosaic and picture",
       pixels,
       [&] { must(develop(with_glare.isp, with_glare.sensor, clean.view(), picture.view(), workspace, executor)); },
       {}},
      {"the same, local tone curve",
       pixels,
       [&] { must(develop(local_tone, with_glare.sensor, clean.view(), picture.view(), workspace, executor)); },
       {}},
      {"whole chain without glare", pixels, [&] { chain(without); }, {}},
      {"whole chain with glare", pixels, [&] { chain(with_glare); }, {}},
      {"whole chain with glare and motion", pixels, [&] { chain(with_motion); }, {}},
      {"normal numbers",
       kNumbers,
       [&] {
         float numbers[noise_detail::kSegment];
         for (std::uint32_t i = 0; i < kNumbers / noise_detail::kSegment; ++i) {
           noise_detail::normal_segment({1, 0, 0}, i, numbers);
           sink = sink + numbers[5];
         }
       },
       {}},
      {"std::normal_distribution over std::mt19937",
       kNumbers,
       [&] {
         std::mt19937 engine(1);
         std::normal_distribution<> normal;
         double sum = 0;
         for (int i = 0; i < kNumbers; ++i) sum += normal(engine);
         sink = static_cast<float>(sum);
       },
       {}},
  };
  for (int round = 0; round < rounds; ++round) {
    for (Step& step : steps) step.times.push_back(seconds(step.run));
  }
  const double copy = median(steps[0].times);
  std::printf("%-44s %10s %10s %10s\n", "", "ms", "ns each", "copies");
  for (const Step& step : steps) {
    const double t = median(step.times);
    std::printf("%-44s %10.2f %10.2f %10.2f\n", step.name.c_str(), t * 1e3, t / step.count * 1e9, t / copy);
  }
  return 0;
}
