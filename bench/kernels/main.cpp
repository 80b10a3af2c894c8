// SPDX-License-Identifier: Apache-2.0
// npsim_bench: time of the kernels of depth refinement by image size and number of threads.
//
// Arguments of each benchmark: width, height, threads. items_per_second are pixels per second: the same at every size
// where cost grows as the image does. The planes are those of a street generated at 960x540 and resampled, so that
// every size shows the same picture.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "../host.hpp"
#include "npsim/color/srgb.hpp"
#include "npsim/depth/cross_bilateral.hpp"
#include "npsim/depth/normals.hpp"
#include "npsim/depth/refine.hpp"
#include "npsim/depth/uncertainty.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/image.hpp"
#include "street/street.hpp"

namespace {

using namespace npsim;

using bench::Arena;
using bench::must;

[[nodiscard]] const street::Street& original() {
  static const street::Street street = [] {
    street::Street s;
    street::StreetParams params;
    params.samples = 1;
    params.sky_rays = 1;
    ThreadPool pool;
    must(street::make_street(params, pool, s));
    return s;
  }();
  return street;
}

struct Scene {
  Intrinsics intrinsics;
  io::Image<Rgb8> image;
  io::Image<Vec3f> srgb, lab;
  io::Image<float> depth;
  io::Image<Vec3f> normals;
  io::Image<Label> labels;
  io::Image<std::uint8_t> uncertain;
};

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

// Depth is smooth: steps of whole pixels would be another problem for the solver at every size.
[[nodiscard]] io::Image<float> bilinear(const io::Image<float>& from, Shape shape) {
  io::Image<float> to(shape);
  const auto place = [](int i, int target, int source, float& share) {
    const float at = (static_cast<float>(i) + 0.5F) * static_cast<float>(source) / static_cast<float>(target) - 0.5F;
    const int low = std::clamp(static_cast<int>(at), 0, source - 2);
    share = std::clamp(at - static_cast<float>(low), 0.0F, 1.0F);
    return low;
  };
  for (int y = 0; y < shape.height; ++y) {
    float v = 0;
    const int j = place(y, shape.height, from.height(), v);
    for (int x = 0; x < shape.width; ++x) {
      float u = 0;
      const int i = place(x, shape.width, from.width(), u);
      const float top = from(i, j) + u * (from(i + 1, j) - from(i, j));
      const float bottom = from(i, j + 1) + u * (from(i + 1, j + 1) - from(i, j + 1));
      to(x, y) = top + v * (bottom - top);
    }
  }
  return to;
}

[[nodiscard]] const Scene& scene_of(Shape shape) {
  static Scene scene;  // of one size at a time
  if (scene.depth.shape() == shape) return scene;
  const street::Street& s = original();
  scene.intrinsics = scaled(s.intrinsics, s.depth.shape(), shape);
  scene.image = nearest(s.image, shape);
  scene.depth = bilinear(s.est_depth, shape);
  scene.normals = nearest(s.est_normals, shape);
  scene.labels = nearest(s.labels, shape);
  scene.lab = io::Image<Vec3f>(shape);
  scene.srgb = io::Image<Vec3f>(shape);
  scene.uncertain = io::Image<std::uint8_t>(shape);
  for (std::size_t i = 0; i < shape.pixels(); ++i) {
    const Rgb8 c = scene.image.data()[i];
    scene.srgb.data()[i] =
        Vec3f{static_cast<float>(c.r), static_cast<float>(c.g), static_cast<float>(c.b)} * (1.0F / 255.0F);
  }
  ThreadPool pool;
  must(srgb8_to_lab(std::as_const(scene.image).view(), scene.lab.view(), pool));
  UncertaintyOutput output;
  output.mask = scene.uncertain.view();
  Arena arena(uncertainty_workspace_bytes({}, shape));
  must(uncertainty({}, std::as_const(scene.depth).view(), std::as_const(scene.labels).view(), output, arena.workspace(),
                   pool));
  return scene;
}

// Runs kernel(scene, executor) as often as wanted.
template <class MakeKernel>
void run(benchmark::State& state, const MakeKernel& make_kernel) {
  const Shape shape{static_cast<int>(state.range(0)), static_cast<int>(state.range(1))};
  ThreadPool pool(static_cast<unsigned>(state.range(2)));
  const auto kernel = make_kernel(scene_of(shape), shape);
  for (auto _ : state) {
    kernel(pool);
    benchmark::ClobberMemory();
  }
  const auto pixels = static_cast<std::int64_t>(shape.pixels());
  state.SetItemsProcessed(pixels * state.iterations());
}

void filter(benchmark::State& state, const CrossBilateralParams& params) {
  run(state, [&](const Scene& s, Shape shape) {
    return [&s, &params, out = std::make_shared<io::Image<float>>(shape),
            arena = std::make_shared<Arena>(cross_bilateral_workspace_bytes(params, shape))](ThreadPool& pool) {
      CrossBilateralResult result;
      must(cross_bilateral(params, s.depth.view(), s.labels.view(), s.lab.view(), out->view(), result,
                           arena->workspace(), pool));
    };
  });
}
void cross_bilateral_exact(benchmark::State& state) { filter(state, {}); }
void cross_bilateral_within_1e_3(benchmark::State& state) {
  CrossBilateralParams params;
  params.max_relative_error = 1e-3F;
  filter(state, params);
}
void cross_bilateral_label_term(benchmark::State& state) {
  CrossBilateralParams params;
  params.use_colour = false;
  filter(state, params);
}

void variance_filter(benchmark::State& state, bool all_outputs) {
  struct Planes {
    explicit Planes(Shape shape) : variance(shape), windows(shape), mask(shape) {}
    io::Image<float> variance;
    io::Image<std::uint8_t> windows, mask;
  };
  run(state, [&](const Scene& s, Shape shape) {
    return [&s, all_outputs, out = std::make_shared<Planes>(shape),
            arena = std::make_shared<Arena>(uncertainty_workspace_bytes({}, shape))](ThreadPool& pool) {
      UncertaintyOutput output;
      output.mask = out->mask.view();
      if (all_outputs) {
        output.windows = out->windows.view();
        output.variance_m2 = out->variance.view();
      }
      must(uncertainty({}, s.depth.view(), s.labels.view(), output, arena->workspace(), pool));
    };
  });
}
void uncertainty_mask(benchmark::State& state) { variance_filter(state, false); }
void uncertainty_all_outputs(benchmark::State& state) { variance_filter(state, true); }

void lab_from_8_bits(benchmark::State& state) {
  run(state, [](const Scene& s, Shape shape) {
    return [&s, out = std::make_shared<io::Image<Vec3f>>(shape)](ThreadPool& pool) {
      must(srgb8_to_lab(s.image.view(), out->view(), pool));
    };
  });
}

void lab_from_float(benchmark::State& state) {
  run(state, [](const Scene& s, Shape shape) {
    return [&s, out = std::make_shared<io::Image<Vec3f>>(shape)](ThreadPool& pool) {
      must(srgb_to_lab(s.srgb.view(), out->view(), pool));
    };
  });
}

void normals_with(benchmark::State& state, const NormalsParams& params) {
  run(state, [&](const Scene& s, Shape shape) {
    return [&s, &params, out = std::make_shared<io::Image<Vec3f>>(shape),
            arena = std::make_shared<Arena>(normals_workspace_bytes(params, shape))](ThreadPool& pool) {
      must(normals_from_depth(params, s.depth.view(), s.intrinsics, out->view(), arena->workspace(), pool));
    };
  });
}
void normals(benchmark::State& state) { normals_with(state, {}); }
void normals_thesis(benchmark::State& state) {
  NormalsParams params;
  params.tangents = TangentForm::thesis;
  normals_with(state, params);
}

[[nodiscard]] LossInput<float> loss_input(const Scene& s) {
  LossInput<float> input;
  input.depth_est = s.depth.view();
  input.normals = s.normals.view();
  input.uncertain = s.uncertain.view();
  input.intrinsics = s.intrinsics;
  return input;
}

void evaluate(benchmark::State& state, const LossParams& params) {
  struct Problem {
    explicit Problem(std::size_t bytes) : arena(bytes) {}
    Arena arena;
    depth_detail::LossProblem<float> problem;
    ImageView<float> depth, gradient;
  };
  run(state, [&](const Scene& s, Shape shape) {
    const auto p = std::make_shared<Problem>(depth_losses_workspace_bytes<float>(params, shape));
    SerialExecutor executor;
    must(depth_detail::prepare_losses(params, loss_input(s), p->arena.workspace(), executor, p->problem));
    must(depth_detail::allocate_loss_plane(shape, p->arena.workspace(), p->depth));
    must(depth_detail::allocate_loss_plane(shape, p->arena.workspace(), p->gradient));
    std::copy_n(p->problem.estimate.data(), depth_detail::loss_plane_elements(shape), p->depth.data());
    return [p](ThreadPool& pool) {
      LossValues values;
      depth_detail::evaluate_losses<float>(p->problem, p->depth, p->gradient, values, pool);
    };
  });
}

void losses_and_gradient(benchmark::State& state) { evaluate(state, {}); }
void losses_and_gradient_thesis(benchmark::State& state) {
  LossParams params;
  params.tangents = TangentForm::thesis;
  evaluate(state, params);
}

void losses_with_preparation(benchmark::State& state) {
  run(state, [](const Scene& s, Shape shape) {
    return [&s, out = std::make_shared<io::Image<float>>(shape),
            arena = std::make_shared<Arena>(depth_losses_workspace_bytes<float>({}, shape))](ThreadPool& pool) {
      LossValues values;
      must(depth_losses({}, loss_input(s), s.depth.view(), out->view(), values, arena->workspace(), pool));
    };
  });
}

void refine(benchmark::State& state, const RefineParams& params) {
  run(state, [&](const Scene& s, Shape shape) {
    return [&s, &params, out = std::make_shared<io::Image<float>>(shape),
            arena = std::make_shared<Arena>(refine_workspace_bytes(params, shape))](ThreadPool& pool) {
      RefineResult result;
      must(refine_with_normals(params, loss_input(s), out->view(), {}, result, arena->workspace(), pool));
    };
  });
}
void refine_default(benchmark::State& state) { refine(state, {}); }
void refine_10_steps_of_adam(benchmark::State& state) {
  RefineParams params = thesis_refine_params();
  params.adam.steps = 10;
  refine(state, params);
}

// 1, 2, 4 .. threads, at least two, and as many as there are.
void sizes(benchmark::internal::Benchmark* b) {
  const int most = std::max(2, static_cast<int>(std::thread::hardware_concurrency()));
  for (int threads = 1; threads <= most; threads = threads < most && 2 * threads > most ? most : 2 * threads) {
    for (const Shape shape : {Shape{424, 240}, Shape{960, 540}, Shape{1920, 1080}, Shape{3840, 2160}}) {
      b->Args({shape.width, shape.height, threads});
    }
  }
  b->ArgNames({"width", "height", "threads"})->UseRealTime()->Unit(benchmark::kMillisecond);
}

BENCHMARK(cross_bilateral_exact)->Apply(sizes);
BENCHMARK(cross_bilateral_within_1e_3)->Apply(sizes);
BENCHMARK(cross_bilateral_label_term)->Apply(sizes);
BENCHMARK(uncertainty_mask)->Apply(sizes);
BENCHMARK(uncertainty_all_outputs)->Apply(sizes);
BENCHMARK(lab_from_8_bits)->Apply(sizes);
BENCHMARK(lab_from_float)->Apply(sizes);
BENCHMARK(normals)->Apply(sizes);
BENCHMARK(normals_thesis)->Apply(sizes);
BENCHMARK(losses_and_gradient)->Apply(sizes);
BENCHMARK(losses_and_gradient_thesis)->Apply(sizes);
BENCHMARK(losses_with_preparation)->Apply(sizes);
BENCHMARK(refine_default)->Apply(sizes);
BENCHMARK(refine_10_steps_of_adam)->Apply(sizes);

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
