// SPDX-License-Identifier: Apache-2.0
// The label term of the cross-bilateral filter alone (a Gaussian over the pixels of the same label, sigma 10 px, window
// of 61), beside a plain Gaussian of the same size, which has no labels to respect.
//
// Errors: on evenly spaced rows; of the plain Gaussian against its own equation, away from the border.
#include <cmath>
#include <cstddef>
#include <memory>
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

[[nodiscard]] std::vector<Error> errors_of(const Options& options, ImageView<const float> depth,
                                           ImageView<const Label> labels, ImageView<const float> out, bool use_labels) {
  const int margin = use_labels ? 0 : kRadius;
  const int count = options.quick ? 4 : 24;
  double g[2 * kRadius + 1];
  for (int i = -kRadius; i <= kRadius; ++i) g[i + kRadius] = std::exp(-i * i / 200.0);
  ErrorSum all_relative;
  ErrorSum all_metres;
  std::vector<std::vector<double>> exact(static_cast<std::size_t>(count));
  ThreadPool pool;
  const auto row_of = [&](std::size_t i) {
    return margin + static_cast<int>((2 * i + 1) * static_cast<std::size_t>(depth.height() - 2 * margin) /
                                     (2 * static_cast<std::size_t>(count)));
  };
  pool.for_chunks(exact.size(), 1, [&](std::size_t i, std::size_t) {
    const int y = row_of(i);
    for (int x = margin; x < depth.width() - margin; ++x) {
      double sum = 0;
      double weights = 0;
      for (int dy = -kRadius; dy <= kRadius; ++dy) {
        for (int dx = -kRadius; dx <= kRadius; ++dx) {
          if (!depth.contains(x + dx, y + dy) || !is_valid_depth(depth(x + dx, y + dy))) continue;
          if (use_labels && labels(x + dx, y + dy) != labels(x, y)) continue;
          const double w = g[dx + kRadius] * g[dy + kRadius];
          sum += w * static_cast<double>(depth(x + dx, y + dy));
          weights += w;
        }
      }
      exact[i].push_back(sum / weights);
    }
  });
  for (std::size_t i = 0; i < exact.size(); ++i) {
    for (std::size_t j = 0; j < exact[i].size(); ++j) {
      const double difference = static_cast<double>(out(margin + static_cast<int>(j), row_of(i))) - exact[i][j];
      all_relative.add(difference / exact[i][j]);
      all_metres.add(difference);
    }
  }
  return {all_relative.error("relative"), all_metres.error("m")};
}

}  // namespace

Comparison label_term_case(const Options& options) {
  const Scene& scene = street_scene(options.shape);
  const ImageView<const float> depth = scene.depth.view();
  const ImageView<const Label> labels = scene.labels.view();
  Comparison comparison{"label_term", "Label term of the cross-bilateral filter, window 61", options.shape, {}};

  CrossBilateralParams params;
  params.sigma_s_px = 10;
  params.radius_px = kRadius;
  params.use_colour = false;
  auto out = std::make_shared<io::Image<float>>(options.shape);
  const auto arena = make_arena(cross_bilateral_workspace_bytes(params, options.shape));
  const auto run = [=] {
    CrossBilateralResult result;
    SerialExecutor executor;
    must(cross_bilateral(params, depth, labels, ImageView<const Vec3f>(), out->view(), result, arena->workspace(),
                         executor));
  };
  comparison.add("npsim", "labels alone", run).judge = [&] {
    return errors_of(options, depth, labels, std::as_const(*out).view(), true);
  };

  if (wanted(options, "opencv GaussianBlur")) {
    if (opencv::available()) {
      auto blurred = std::make_shared<io::Image<float>>(options.shape);
      Contender& c = comparison.add_peer("opencv GaussianBlur", "61x61 float, no labels",
                                         [=] { opencv::gaussian_blur(depth, 61, 10, blurred->view()); });
      c.judge = [&, blurred] { return errors_of(options, depth, labels, std::as_const(*blurred).view(), false); };
    } else {
      comparison.add_absent("opencv imgproc");
    }
  }
  measure(options, comparison);
  return comparison;
}

}  // namespace npsim::bench
