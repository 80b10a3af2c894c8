// SPDX-License-Identifier: Apache-2.0
// Cross-bilateral filter, sigma 10 px and 5 CIELAB units, window of 61: ours under several bounds, OpenCV's.
//
// OpenCV's filters know one reference, no labels, and a circular window; they measure colour as |dL| + |da| + |db|.
// Each is judged by that equation of its own, away from the border. Errors: on evenly spaced rows.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "cases.hpp"
#include "npsim/depth/cross_bilateral.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "opencv_peers.hpp"
#include "scene.hpp"

namespace npsim::bench {
namespace {

constexpr int kRadius = 30;
constexpr double kSigmaS = 10;
constexpr double kSigmaC = 5;

[[nodiscard]] std::vector<int> sampled_rows(const Options& options) {
  const int count = options.quick ? 4 : 12;
  std::vector<int> rows;
  for (int i = 0; i < count; ++i) rows.push_back((2 * i + 1) * options.shape.height / (2 * count));
  return rows;
}

// The filter in double with any weight(dx, dy, x, y, qx, qy) on the sampled rows, and how far `out` is from it.
// Pixels nearer to the border than `margin` are left out.
template <class Weight>
[[nodiscard]] std::vector<Error> errors_on_rows(const Options& options, ImageView<const float> depth,
                                                ImageView<const float> out, int margin, const Weight& weight) {
  const std::vector<int> rows = sampled_rows(options);
  const Shape shape = depth.shape();
  std::vector<double> exact(rows.size() * static_cast<std::size_t>(shape.width), kNone);
  ThreadPool pool;
  pool.for_chunks(rows.size(), 1, [&](std::size_t r, std::size_t) {
    const int y = rows[r];
    for (int x = margin; x < shape.width - margin; ++x) {
      if (y < margin || y >= shape.height - margin) continue;
      double sum = 0;
      double weights = 0;
      for (int dy = -kRadius; dy <= kRadius; ++dy) {
        for (int dx = -kRadius; dx <= kRadius; ++dx) {
          if (!depth.contains(x + dx, y + dy) || !is_valid_depth(depth(x + dx, y + dy))) continue;
          const double w = weight(dx, dy, x, y, x + dx, y + dy);
          sum += w * static_cast<double>(depth(x + dx, y + dy));
          weights += w;
        }
      }
      exact[r * static_cast<std::size_t>(shape.width) + static_cast<std::size_t>(x)] = sum / weights;
    }
  });
  ErrorSum relative;
  ErrorSum metres;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    for (int x = 0; x < shape.width; ++x) {
      const double e = exact[r * static_cast<std::size_t>(shape.width) + static_cast<std::size_t>(x)];
      if (std::isnan(e)) continue;
      const double difference = static_cast<double>(out(x, rows[r])) - e;
      relative.add(difference / e);
      metres.add(difference);
    }
  }
  return {relative.error("relative"), metres.error("m")};
}

[[nodiscard]] double gauss(double r2, double sigma) { return std::exp(-r2 / (2 * sigma * sigma)); }

[[nodiscard]] std::string number(float v) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.2g", static_cast<double>(v));
  return text;
}

}  // namespace

Comparison bilateral_case(const Options& options) {
  const Scene& scene = street_scene(options.shape);
  const ImageView<const float> depth = scene.depth.view();
  const ImageView<const Vec3f> lab = scene.lab.view();
  const ImageView<const Label> labels = scene.labels.view();
  Comparison comparison{"cross_bilateral", "Cross-bilateral filter, window 61", options.shape, {}};

  const auto colour = [lab](int x, int y, int qx, int qy) {
    const Vec3d d = vec_cast<double>(lab(qx, qy)) - vec_cast<double>(lab(x, y));
    return dot(d, d);
  };
  const auto ours = [&](const std::string& setting, CrossBilateralParams params, float held) {
    auto out = std::make_shared<io::Image<float>>(options.shape);
    const auto arena = make_arena(cross_bilateral_workspace_bytes(params, options.shape));
    Contender& c =
        comparison.add("npsim", held == params.max_relative_error ? setting : setting + ", holds " + number(held), [=] {
          CrossBilateralResult result;
          SerialExecutor executor;
          must(cross_bilateral(params, depth, labels, lab, out->view(), result, arena->workspace(), executor));
        });
    c.judge = [=] {
      return errors_on_rows(options, depth, std::as_const(*out).view(), 0,
                            [&](int dx, int dy, int x, int y, int qx, int qy) {
                              const double equal = params.use_labels && labels(x, y) == labels(qx, qy) ? 1 : 0;
                              return gauss(dx * dx + dy * dy, kSigmaS) *
                                     (equal + static_cast<double>(params.mu) * gauss(colour(x, y, qx, qy), kSigmaC));
                            });
    };
  };

  CrossBilateralParams params;
  params.sigma_s_px = static_cast<float>(kSigmaS);
  params.sigma_c = static_cast<float>(kSigmaC);
  params.radius_px = kRadius;
  // What the filter answers to a bound, from a corner of the image.
  const auto held_bound = [&] {
    io::Image<float> probe({64, 64});
    const auto arena = make_arena(cross_bilateral_workspace_bytes(params, probe.shape()));
    CrossBilateralResult result;
    SerialExecutor executor;
    must(cross_bilateral(params, depth.sub(0, 0, probe.shape()), labels.sub(0, 0, probe.shape()),
                         lab.sub(0, 0, probe.shape()), probe.view(), result, arena->workspace(), executor));
    return result.relative_error_bound;
  };
  float last = -1;
  for (const float bound : {2e-5F, 1e-3F, 1e-2F}) {
    params.max_relative_error = bound;
    const float held = held_bound();
    if (held != last) ours("bound " + number(bound), params, held);  // else the path of a tighter bound
    last = held;
  }
  params.max_relative_error = 2e-5F;
  params.use_labels = false;
  ours("colour alone, bound 2e-05", params, held_bound());

  const auto peer = [&](const std::string& method, const std::string& setting, bool built, int diameter, auto filter,
                        auto colour_weight) {
    if (!wanted(options, method + " " + setting)) return;
    if (!built) {
      comparison.add_absent(method.find("joint") != std::string::npos ? "opencv ximgproc" : "opencv imgproc");
      return;
    }
    auto out = std::make_shared<io::Image<float>>(options.shape);
    Contender& c = comparison.add_peer(method, setting, [=] { filter(out->view()); });
    const int reach = diameter / 2;
    c.judge = [=] {
      return errors_on_rows(options, depth, std::as_const(*out).view(), kRadius,
                            [&](int dx, int dy, int x, int y, int qx, int qy) {
                              if (dx * dx + dy * dy > reach * reach) return 0.0;
                              return gauss(dx * dx + dy * dy, kSigmaS) * colour_weight(x, y, qx, qy);
                            });
    };
  };
  const auto sum_of_parts = [lab](int x, int y, int qx, int qy) {
    const Vec3d d = vec_cast<double>(lab(qx, qy)) - vec_cast<double>(lab(x, y));
    const double distance = std::fabs(d.x) + std::fabs(d.y) + std::fabs(d.z);
    return gauss(distance * distance, kSigmaC);
  };
  const auto own_depth = [depth](int x, int y, int qx, int qy) {
    const double d = static_cast<double>(depth(qx, qy)) - static_cast<double>(depth(x, y));
    return gauss(d * d, kSigmaC);
  };
  for (const int diameter : {61, 41}) {
    peer(
        "opencv jointBilateralFilter", "d = " + std::to_string(diameter) + " Lab", opencv::ximgproc(), diameter,
        [=](ImageView<float> out) { opencv::joint_bilateral(lab, depth, diameter, kSigmaC, kSigmaS, out); },
        sum_of_parts);
  }
  peer(
      "opencv bilateralFilter", "d = 61 depth", opencv::available(), 61,
      [=](ImageView<float> out) { opencv::bilateral(depth, 61, kSigmaC, kSigmaS, out); }, own_depth);
  measure(options, comparison);
  return comparison;
}

}  // namespace npsim::bench
