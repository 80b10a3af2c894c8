// SPDX-License-Identifier: Apache-2.0
// sRGB to CIELAB, beside OpenCV's cvtColor in float and in 8 bits. Errors: Delta E 1976 against the exact formula in
// double, over every fifth code of each channel and both ends (52^3 colours).
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "cases.hpp"
#include "npsim/color/chromaticity.hpp"
#include "npsim/color/srgb.hpp"
#include "opencv_peers.hpp"
#include "scene.hpp"

namespace npsim::bench {
namespace {

[[nodiscard]] double decode(double v) { return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4); }

[[nodiscard]] Vec3d exact_lab(const Rgb8& c) {
  const double rgb[3] = {decode(c.r / 255.0), decode(c.g / 255.0), decode(c.b / 255.0)};
  const double white[3] = {kWhiteD65Xyz.x, kWhiteD65Xyz.y, kWhiteD65Xyz.z};
  double f[3];
  for (int i = 0; i < 3; ++i) {
    const double* m = kLinearSrgbToXyz.m[i];
    const double t = (m[0] * rgb[0] + m[1] * rgb[1] + m[2] * rgb[2]) / white[i];
    f[i] = t > 216.0 / 24389.0 ? std::cbrt(t) : (24389.0 / 27.0 * t + 16.0) / 116.0;
  }
  return {116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])};
}

}  // namespace

Comparison lab_case(const Options& options) {
  const Scene& scene = street_scene(options.shape);
  const Shape shape = options.shape;
  const ImageView<const Rgb8> image = scene.image.view();
  Comparison comparison{"lab", "sRGB to CIELAB", shape, {}};

  io::Image<Rgb8> colours({52 * 52, 52});
  for (int y = 0; y < 52; ++y) {
    for (int x = 0; x < 52 * 52; ++x) {
      colours(x, y) = {static_cast<std::uint8_t>(5 * (x / 52)), static_cast<std::uint8_t>(5 * (x % 52)),
                       static_cast<std::uint8_t>(5 * y)};
    }
  }
  const auto as_float = [](const io::Image<Rgb8>& from) {
    auto to = std::make_shared<io::Image<Vec3f>>(from.shape());
    for (int y = 0; y < from.height(); ++y) {
      for (int x = 0; x < from.width(); ++x) {
        const Rgb8 c = from(x, y);
        (*to)(x, y) = {static_cast<float>(c.r) / 255.0F, static_cast<float>(c.g) / 255.0F,
                       static_cast<float>(c.b) / 255.0F};
      }
    }
    return to;
  };
  const auto colours_float = as_float(colours);
  const auto image_float = as_float(scene.image);
  const auto errors = [&](const auto& lab_at) {
    ErrorSum sum;
    for (int y = 0; y < colours.height(); ++y) {
      for (int x = 0; x < colours.width(); ++x) sum.add(length(lab_at(x, y) - exact_lab(colours(x, y))));
    }
    return std::vector<Error>{sum.error("Delta E 1976")};
  };
  io::Image<Vec3f> small(colours.shape());
  const auto from_float = [&](int x, int y) { return vec_cast<double>(small(x, y)); };
  const auto out = std::make_shared<io::Image<Vec3f>>(shape);

  SerialExecutor executor;
  must(srgb8_to_lab(std::as_const(colours).view(), small.view(), executor));
  comparison
      .add("npsim", "from 8 bits",
           [=] {
             SerialExecutor e;
             must(srgb8_to_lab(image, out->view(), e));
           })
      .errors = errors(from_float);
  must(srgb_to_lab(std::as_const(*colours_float).view(), small.view(), executor));
  comparison
      .add("npsim", "from float",
           [=] {
             SerialExecutor e;
             must(srgb_to_lab(std::as_const(*image_float).view(), out->view(), e));
           })
      .errors = errors(from_float);

  if (wanted(options, "opencv cvtColor")) {
    if (!opencv::available()) {
      comparison.add_absent("opencv imgproc");
    } else {
      opencv::lab_from_float(std::as_const(*colours_float).view(), small.view());
      comparison
          .add_peer("opencv cvtColor", "float",
                    [=] { opencv::lab_from_float(std::as_const(*image_float).view(), out->view()); })
          .errors = errors(from_float);
      io::Image<Rgb8> small8(colours.shape());
      const auto out8 = std::make_shared<io::Image<Rgb8>>(shape);
      opencv::lab_from_8bit(std::as_const(colours).view(), small8.view());
      comparison.add_peer("opencv cvtColor", "8 bits in and out", [=] { opencv::lab_from_8bit(image, out8->view()); })
          .errors = errors([&](int x, int y) {
        const Rgb8 c = small8(x, y);
        return Vec3d{c.r * 100.0 / 255.0, c.g - 128.0, c.b - 128.0};
      });
    }
  }
  measure(options, comparison);
  return comparison;
}

}  // namespace npsim::bench
