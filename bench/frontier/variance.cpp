// SPDX-License-Identifier: Apache-2.0
// Dual-reference variance filter, windows of 8x8: beside a copy of the depth plane, OpenCV's box filters (E[z^2] -
// E[z]^2 in float and in double) and integral images in double.
//
// Two scenes: the street at the default threshold, and a wall at 80 m +- 1 mm with the median of its variances as
// threshold and labels that let every window pass. "wrong decisions" is the share of windows whose answer differs from
// that of a two-pass variance in double. Peers test no labels, and are judged by variance alone. "from memory": with
// emptied caches, as a copy of a plane is no measure of memory where both planes fit into the last cache.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cases.hpp"
#include "npsim/depth/uncertainty.hpp"
#include "opencv_peers.hpp"
#include "scene.hpp"

namespace npsim::bench {
namespace {

constexpr int kWindow = 8;

// Two passes in double for every window inside the image; NaN elsewhere.
[[nodiscard]] std::vector<double> exact_variance(ImageView<const float> depth) {
  std::vector<double> out(depth.shape().pixels(), kNone);
  for (int y = 0; y + kWindow <= depth.height(); ++y) {
    for (int x = 0; x + kWindow <= depth.width(); ++x) {
      double sum = 0;
      int count = 0;
      for (int j = 0; j < kWindow; ++j) {
        for (int i = 0; i < kWindow; ++i) {
          const float z = depth(x + i, y + j);
          if (!is_valid_depth(z)) continue;
          sum += static_cast<double>(z);
          ++count;
        }
      }
      const double mean = sum / count;
      double squares = 0;
      for (int j = 0; j < kWindow; ++j) {
        for (int i = 0; i < kWindow; ++i) {
          const float z = depth(x + i, y + j);
          if (is_valid_depth(z)) squares += (static_cast<double>(z) - mean) * (static_cast<double>(z) - mean);
        }
      }
      out[static_cast<std::size_t>(y) * static_cast<std::size_t>(depth.width()) + static_cast<std::size_t>(x)] =
          count < 2 ? 0 : squares / count;
    }
  }
  return out;
}

// Whether the labels of each window let it fire.
[[nodiscard]] std::vector<bool> labels_pass(ImageView<const float> depth, ImageView<const Label> labels,
                                            LabelSet foreground) {
  std::vector<bool> out(depth.shape().pixels(), false);
  for (int y = 0; y + kWindow <= depth.height(); ++y) {
    for (int x = 0; x + kWindow <= depth.width(); ++x) {
      std::uint64_t held = 0;
      for (int j = 0; j < kWindow; ++j) {
        for (int i = 0; i < kWindow; ++i) {
          if (is_valid_depth(depth(x + i, y + j))) held |= std::uint64_t{1} << labels(x + i, y + j);
        }
      }
      out[static_cast<std::size_t>(y) * static_cast<std::size_t>(depth.width()) + static_cast<std::size_t>(x)] =
          (held & (held - 1)) != 0 && (held & foreground.bits()) != 0;
    }
  }
  return out;
}

struct Planes {
  explicit Planes(Shape shape) : variance(shape), windows(shape), mask(shape) {}
  io::Image<float> variance;
  io::Image<std::uint8_t> windows, mask;
};

// decides(x, y): what the contender says of the window there.
template <class Decides>
[[nodiscard]] std::vector<Error> errors_of(const std::vector<double>& exact, const std::vector<bool>* pass,
                                           double threshold, ImageView<const float> variance, const Decides& decides) {
  ErrorSum relative;
  double wrong = 0;
  double windows = 0;
  for (int y = 0; y < variance.height(); ++y) {
    for (int x = 0; x < variance.width(); ++x) {
      const auto i =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(variance.width()) + static_cast<std::size_t>(x);
      if (std::isnan(exact[i])) continue;
      if (exact[i] > 0) relative.add((static_cast<double>(variance(x, y)) - exact[i]) / exact[i]);
      const bool fires = exact[i] > threshold && (pass == nullptr || (*pass)[i]);
      wrong += fires == decides(x, y) ? 0 : 1;
      windows += 1;
    }
  }
  return {relative.error("relative variance"), {wrong / windows, kNone, "wrong decisions"}};
}

void add_scene(const Options& options, const std::string& name, ImageView<const float> depth,
               ImageView<const Label> labels, double threshold, LabelSet foreground, Comparison& comparison) {
  const Shape shape = options.shape;
  const auto exact = std::make_shared<const std::vector<double>>(exact_variance(depth));
  const auto pass = std::make_shared<const std::vector<bool>>(labels_pass(depth, labels, foreground));
  if (threshold <= 0) {
    std::vector<double> sorted;
    for (const double v : *exact) {
      if (!std::isnan(v)) sorted.push_back(v);
    }
    std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2), sorted.end());
    threshold = sorted[sorted.size() / 2];
  }
  UncertaintyParams params;
  params.window_px = kWindow;
  params.variance_m2 = threshold;
  params.foreground = foreground;
  const auto ours = [&](const std::string& setting, bool all_outputs, bool from_memory) {
    const auto planes = std::make_shared<Planes>(shape);
    const auto arena = make_arena(uncertainty_workspace_bytes(params, shape));
    const auto run = [=](bool all) {
      UncertaintyOutput output;
      output.mask = planes->mask.view();
      if (all) {
        output.windows = planes->windows.view();
        output.variance_m2 = planes->variance.view();
      }
      SerialExecutor executor;
      must(uncertainty(params, depth, labels, output, arena->workspace(), executor));
    };
    Contender& c = comparison.add("npsim", setting + ", " + name, [=] { run(all_outputs); });
    c.group = from_memory ? name + " from memory" : name;
    c.from_memory = from_memory;
    c.judge = [=] {
      run(true);
      return errors_of(*exact, pass.get(), threshold, std::as_const(planes->variance).view(),
                       [&](int x, int y) { return planes->windows(x, y) != 0; });
    };
  };
  const auto copy = [&](const std::string& setting, bool from_memory) {
    const auto to = std::make_shared<io::Image<float>>(shape);
    Contender& c = comparison.add_peer("memcpy", setting,
                                       [=] { std::memcpy(to->data(), depth.data(), shape.pixels() * sizeof(float)); });
    c.group = from_memory ? name + " from memory" : name;
    c.from_memory = from_memory;
  };
  ours("mask", false, false);
  ours("mask windows variance", true, false);
  copy("depth plane", false);
  ours("mask, from memory", false, true);
  copy("depth plane, from memory", true);
  const auto peer = [&](const std::string& method, const std::string& setting, auto filter) {
    if (!wanted(options, method)) return;
    if (!opencv::available()) {
      comparison.add_absent("opencv imgproc");
      return;
    }
    const auto planes = std::make_shared<Planes>(shape);
    const auto run = [=] { filter(planes->variance.view(), planes->mask.view()); };
    Contender& c = comparison.add_peer(method, setting + ", " + name, run);
    c.group = name;
    c.judge = [=] {
      return errors_of(*exact, nullptr, threshold, std::as_const(planes->variance).view(),
                       [&](int x, int y) { return static_cast<double>(planes->variance(x, y)) > threshold; });
    };
  };
  for (const bool in_double : {false, true}) {
    peer("opencv boxFilter", in_double ? "double" : "float",
         [=](ImageView<float> variance, ImageView<std::uint8_t> mask) {
           opencv::box_variance(depth, kWindow, threshold, in_double, variance, mask);
         });
  }
  peer("opencv integral", "double", [=](ImageView<float> variance, ImageView<std::uint8_t> mask) {
    opencv::integral_variance(depth, kWindow, threshold, variance, mask);
  });
}

}  // namespace

Comparison variance_case(const Options& options) {
  const Scene& scene = street_scene(options.shape);
  Comparison comparison{"variance", "Variance filter, windows of 8x8", options.shape, {}};
  const UncertaintyParams defaults;
  add_scene(options, "street", scene.depth.view(), scene.labels.view(), defaults.variance_m2, defaults.foreground,
            comparison);

  static io::Image<float> wall;
  static io::Image<Label> checks;
  wall = io::Image<float>(options.shape);
  checks = io::Image<Label>(options.shape);
  for (int y = 0; y < options.shape.height; ++y) {
    for (int x = 0; x < options.shape.width; ++x) {
      const auto draw = static_cast<std::uint32_t>(y * options.shape.width + x) * 2654435761U;
      const std::uint32_t mixed = (draw ^ (draw >> 15U)) * 2246822519U;
      wall(x, y) = 80.0F + 0.001F * (static_cast<float>(mixed >> 8U) * 0x1p-23F - 1.0F);
      checks(x, y) = (x + y) % 2 == 0 ? label::road : label::pole;
    }
  }
  add_scene(options, "80 m +- 1 mm", std::as_const(wall).view(), std::as_const(checks).view(), 0, defaults.foreground,
            comparison);
  measure(options, comparison);
  return comparison;
}

}  // namespace npsim::bench
