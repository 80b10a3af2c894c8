// SPDX-License-Identifier: Apache-2.0
// Photographs that tests paint by day, and the albedo that is estimated from them.
#ifndef NPSIM_TESTS_DAY_PICTURE_HPP
#define NPSIM_TESTS_DAY_PICTURE_HPP

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/material/albedo.hpp"

namespace npsim_test {

using namespace npsim;

inline std::uint8_t encode(float linear) {
  const float v = std::min(1.0F, std::max(0.0F, linear));
  const double s = static_cast<double>(v);
  const double e = s <= 0.0031308 ? 12.92 * s : 1.055 * std::pow(s, 1 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(std::lround(255 * e));
}

struct Picture {
  Shape shape;
  std::vector<Rgb8> day;
  std::vector<Label> labels;
  std::vector<Vec3f> albedo;
  explicit Picture(int w, int h) : shape{w, h}, day(shape.pixels()), labels(shape.pixels()), albedo(shape.pixels()) {}
  std::size_t i(int x, int y) const { return static_cast<std::size_t>(y * shape.width + x); }

  std::vector<std::uint16_t> instances;
  std::vector<Vec3f> normals;
  GroundPlane ground;
  std::vector<float> sun;
  DaylightReport report;

  AlbedoScene scene(bool with_labels = true) const {
    AlbedoScene out;
    out.image = ImageView<const Rgb8>(day.data(), shape);
    if (with_labels) out.labels = ImageView<const Label>(labels.data(), shape);
    if (with_labels && !instances.empty()) out.instances = ImageView<const std::uint16_t>(instances.data(), shape);
    if (!normals.empty()) out.normals = ImageView<const Vec3f>(normals.data(), shape);
    out.ground = ground;
    return out;
  }
  template <class Executor = SerialExecutor>
  Status run(const AlbedoParams& p = {}, bool with_labels = true, Executor executor = {}) {
    npsim_test::Scratch scratch(estimate_albedo_workspace_bytes(p, shape));
    sun.assign(shape.pixels(), -1.0F);
    return estimate_albedo(p, scene(with_labels), scratch.workspace(),
                           {ImageView<Vec3f>(albedo.data(), shape), ImageView<float>(sun.data(), shape)}, report,
                           executor);
  }
  double median(Label l) const {
    std::vector<float> v;
    for (std::size_t k = 0; k < labels.size(); ++k) {
      if (labels[k] == l) v.push_back(luminance(albedo[k]));
    }
    REQUIRE(!v.empty());
    std::nth_element(v.begin(), v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2), v.end());
    return static_cast<double>(v[v.size() / 2]);
  }
};

// Mean luminance of the albedo in columns x0 to x1 - 1 of rows y0 to y1 - 1.
inline double mean(const Picture& p, int x0, int x1, int y0, int y1) {
  double sum = 0;
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) sum += static_cast<double>(luminance(p.albedo[p.i(x, y)]));
  }
  return sum / ((x1 - x0) * (y1 - y0));
}

}  // namespace npsim_test

#endif  // NPSIM_TESTS_DAY_PICTURE_HPP
