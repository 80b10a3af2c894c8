// SPDX-License-Identifier: Apache-2.0
// npsim_bench_layers: time of the steps from depth to the layered mesh, as a multiple of the time that memcpy takes to
// write the same outputs.
//
// Each round runs every step and every memcpy once, one after the other, so that a change of the machine's speed meets
// all alike; medians are printed. The picture is a street generated at 960x540 and resampled; the uncertain pixels are
// found at each size.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "../host.hpp"
#include "../options.hpp"
#include "../timing.hpp"
#include "npsim/depth/uncertainty.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/image.hpp"
#include "npsim/mesh/complete.hpp"
#include "npsim/mesh/index.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/mesh/sheet.hpp"
#include "street/street.hpp"

namespace {

using namespace npsim;

using bench::Arena;
using bench::median;
using bench::must;
using bench::seconds;

template <class T>
[[nodiscard]] io::Image<T> nearest(const io::Image<T>& from, Shape shape) {
  io::Image<T> to(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      to(x, y) = from(x * from.width() / shape.width, y * from.height() / shape.height);
    }
  }
  return to;
}

struct Layer {
  explicit Layer(Shape shape) : vertices(shape), quads(quad_shape(shape)) {}
  [[nodiscard]] SheetLayer view() { return {vertices.view(), quads.view()}; }
  io::Image<Vec3f> vertices;
  io::Image<std::uint8_t> quads;
};

struct Planes {
  Planes(const street::Street& street, Shape shape, ThreadPool& pool)
      : intrinsics(scaled(street.intrinsics, street.depth.shape(), shape)),
        depth(nearest(street.est_depth, shape)),
        labels(nearest(street.labels, shape)),
        instances(nearest(street.instances, shape)),
        uncertain(shape),
        surface(shape),
        state(shape),
        object(shape),
        background(shape),
        foreground(shape) {
    for (std::size_t i = 0; i < shape.pixels(); ++i) {
      surface.data()[i] = kNoSurfaceLabels.contains(labels.data()[i]) ? 0 : 1;
    }
    UncertaintyOutput output;
    output.mask = uncertain.view();
    Arena arena(uncertainty_workspace_bytes({}, shape));
    must(uncertainty({}, std::as_const(depth).view(), std::as_const(labels).view(), output, arena.workspace(), pool));
  }

  Intrinsics intrinsics;
  io::Image<float> depth;
  io::Image<Label> labels;
  io::Image<std::uint16_t> instances;
  io::Image<std::uint8_t> uncertain, surface, state;
  io::Image<std::uint32_t> object;
  Layer background, foreground;
};

enum Step { kSheet, kPrune, kBackground, kForeground, kIndex, kStepCount };
constexpr const char* kStepName[kStepCount] = {"sheet", "prune", "complete_background", "complete_foreground", "index"};

void measure(const street::Street& street, Shape shape, unsigned threads, int rounds) {
  ThreadPool pool(threads);
  Planes p(street, shape, pool);
  const BackgroundParams background;
  const ForegroundParams foreground;
  Arena arena(std::max({complete_background_workspace_bytes(background, shape),
                        complete_foreground_workspace_bytes(foreground, shape), index_layer_workspace_bytes(shape)}));

  const std::size_t layer = shape.pixels() * sizeof(Vec3f) + quad_shape(shape).pixels();
  std::array<std::size_t, kStepCount> bytes = {layer, quad_shape(shape).pixels(), layer + shape.pixels(),
                                               layer + shape.pixels() * sizeof(std::uint32_t), 0};
  MeshBuffers buffers;
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<std::uint32_t> pixels;
  const auto run = [&](int step) {
    switch (step) {
      case kSheet:
        must(build_sheet({}, std::as_const(p.depth).view(), std::as_const(p.surface).view(), p.intrinsics,
                         p.background.view(), pool));
        break;
      case kPrune:
        must(prune({}, std::as_const(p.uncertain).view(), std::as_const(p.labels).view(), p.background.view(), pool));
        break;
      case kBackground:
        must(complete_background(
            background,
            {p.background.vertices.view(), p.labels.view(), p.uncertain.view(), p.surface.view(), p.intrinsics},
            p.background.view(), p.state.view(), arena.workspace(), pool));
        break;
      case kForeground:
        must(complete_foreground(foreground,
                                 {{},
                                  p.depth.view(),
                                  p.surface.view(),
                                  p.labels.view(),
                                  p.instances.view(),
                                  p.uncertain.view(),
                                  p.state.view(),
                                  p.intrinsics},
                                 p.foreground.view(), p.object.view(), arena.workspace(), pool));
        break;
      default: {
        MeshSize first;
        MeshSize second;
        must(index_layers(p.background.view(), p.foreground.view(), buffers, first, second, arena.workspace(), pool));
      }
    }
  };
  for (int step = kSheet; step < kIndex; ++step) run(step);
  const MeshSize back = mesh_size(p.background.view());
  const MeshSize front = mesh_size(p.foreground.view());
  vertices.resize(back.vertices + front.vertices);
  pixels.resize(vertices.size());
  faces.resize(back.faces + front.faces);
  buffers = {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}, {pixels.data(), pixels.size()}};
  bytes[kIndex] = vertices.size() * (sizeof(Vec3f) + sizeof(std::uint32_t)) + faces.size() * sizeof(Face);

  const std::size_t all_bytes = 2 * layer + shape.pixels() * (sizeof(std::uint32_t) + 1);
  const std::size_t largest = std::max(all_bytes, bytes[kIndex]);
  std::vector<unsigned char> from(largest, 1);
  std::vector<unsigned char> to(largest, 2);
  const auto copy = [&](std::size_t n) {
    std::memcpy(to.data(), from.data(), n);
    const volatile unsigned char keep = to[n / 2];
    static_cast<void>(keep);
  };
  std::array<std::vector<double>, kStepCount> steps;
  std::array<std::vector<double>, kStepCount> copies;
  std::vector<double> four;
  std::vector<double> four_copies;
  for (int round = 0; round < rounds; ++round) {
    double sum = 0;
    for (int step = 0; step < kStepCount; ++step) {
      const auto s = static_cast<std::size_t>(step);
      steps[s].push_back(seconds([&] { run(step); }));
      if (step < kIndex) sum += steps[s].back();
      copies[s].push_back(seconds([&] { copy(bytes[s]); }));
    }
    four.push_back(sum);
    four_copies.push_back(seconds([&] { copy(all_bytes); }));
  }
  const auto print = [&](const char* name, double step, double copied, std::size_t n) {
    std::printf("%5d x %4d  %u  %-20s %9.3f ms  %9.3f ms  %7.2f   %8.2f MB\n", shape.width, shape.height, threads, name,
                1e3 * step, 1e3 * copied, step / copied, 1e-6 * static_cast<double>(n));
  };
  for (std::size_t s = 0; s < kStepCount; ++s) print(kStepName[s], median(steps[s]), median(copies[s]), bytes[s]);
  print("the first four", median(four), median(four_copies), all_bytes);
  std::printf("%5d x %4d  %u  workspace %.2f MB\n", shape.width, shape.height, threads,
              1e-6 * static_cast<double>(std::max(complete_background_workspace_bytes(background, shape),
                                                  complete_foreground_workspace_bytes(foreground, shape))));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("From depth to the layered mesh, beside memcpy of the same outputs");
  unsigned most = 2;
  int rounds = 21;
  std::vector<std::string> sizes{"424x240", "960x540", "1920x1080", "3840x2160"};
  app.add_option("--threads", most, "from one to so many")->capture_default_str()->check(CLI::Range(1, 1024));
  app.add_option("--rounds", rounds, "the median counts")->capture_default_str()->check(CLI::Range(1, 1000));
  app.add_option("--size", sizes, "WIDTHxHEIGHT of the images")->capture_default_str()->check(bench::is_size);
  if (const auto status = bench::parse(app, argc, argv)) return *status;
  street::Street street;
  street::StreetParams params;
  params.samples = 1;
  params.sky_rays = 1;
  {
    ThreadPool pool;
    must(street::make_street(params, pool, street));
  }
  std::printf("        size  threads  step              time       memcpy of its outputs  ratio   outputs\n");
  for (unsigned threads = 1; threads <= most; ++threads) {
    for (const std::string& size : sizes) {
      Shape shape;
      static_cast<void>(bench::parse_size(size, shape));
      measure(street, shape, threads, rounds);
    }
  }
  return 0;
}
