// SPDX-License-Identifier: Apache-2.0
// The cross-bilateral filter on a generated street, against equation (3.2) in double.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "made_street.hpp"
#include "npsim/color/srgb.hpp"
#include "npsim/depth/cross_bilateral.hpp"
#include "street/street.hpp"

using namespace npsim;

namespace {

struct Error {
  double largest = 0;  // relative
  double rmse_m = 0;
};

Error error_of(const CrossBilateralParams& p, ImageView<const float> depth, ImageView<const Label> labels,
               ImageView<const Vec3f> lab, ImageView<const float> out) {
  const int radius = cross_bilateral_radius(p, depth.shape());
  Error error;
  double squares = 0;
  int count = 0;
  for (int y = 0; y < depth.height(); y += 2) {
    for (int x = y / 2 % 3; x < depth.width(); x += 3) {
      double numerator = 0;
      double weight = 0;
      for (int qy = std::max(0, y - radius); qy <= std::min(depth.height() - 1, y + radius); ++qy) {
        for (int qx = std::max(0, x - radius); qx <= std::min(depth.width() - 1, x + radius); ++qx) {
          if (!is_valid_depth(depth(qx, qy))) continue;
          const Vec3d step = vec_cast<double>(lab(qx, qy)) - vec_cast<double>(lab(x, y));
          const double c = static_cast<double>(p.sigma_c);
          const double s = static_cast<double>(p.sigma_s_px);
          const double r2 = (qx - x) * (qx - x) + (qy - y) * (qy - y);
          const double same = p.use_labels && labels(qx, qy) == labels(x, y) ? 1.0 : 0.0;
          const double colour = static_cast<double>(p.mu) * std::exp(-dot(step, step) / (2 * c * c));
          const double w = std::exp(-r2 / (2 * s * s)) * (same + colour);
          numerator += w * static_cast<double>(depth(qx, qy));
          weight += w;
        }
      }
      if (weight < 1e-6) continue;
      const double expected = numerator / weight;
      const double off = std::abs(static_cast<double>(out(x, y)) - expected);
      error.largest = std::max(error.largest, off / expected);
      squares += off * off;
      ++count;
    }
  }
  error.rmse_m = std::sqrt(squares / std::max(1, count));
  return error;
}

}  // namespace

TEST_CASE("cross-bilateral on a generated street: bound kept at every setting, RMSE below 0.1 mm by default") {
  const Shape shape{224, 126};
  const street::Street street = testing::plain_street(5, shape);
  SerialExecutor serial;
  std::vector<Vec3f> lab_pixels(shape.pixels());
  std::vector<float> out_pixels(shape.pixels());
  const ImageView<Vec3f> lab(lab_pixels.data(), shape);
  const ImageView<float> out(out_pixels.data(), shape);
  REQUIRE(srgb8_to_lab(ImageView<const Rgb8>(street.image.view()), lab, serial).ok());
  for (const bool measured : {false, true}) {  // with the sky's holes, and without
    const ImageView<const float> depth = measured ? street.est_depth.view() : street.depth.view();
    for (const float bound : {2e-5F, 1e-3F, 1e-2F}) {
      CrossBilateralParams p;
      p.max_relative_error = bound;
      npsim_test::Scratch scratch(cross_bilateral_workspace_bytes(p, shape));
      Workspace& workspace = scratch.workspace();
      CrossBilateralResult result;
      REQUIRE(cross_bilateral(p, depth, ImageView<const Label>(street.labels.view()), ImageView<const Vec3f>(lab), out,
                              result, workspace, serial, FilteredPixels::all)
                  .ok());
      const Error error = error_of(p, depth, street.labels.view(), lab, out);
      CHECK(result.relative_error_bound <= bound);
      CHECK(error.largest <= static_cast<double>(result.relative_error_bound));
      if (bound < 1e-4F) CHECK(error.rmse_m < 1e-4);
    }
  }
}
