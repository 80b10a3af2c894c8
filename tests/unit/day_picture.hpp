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
#include "npsim/core/random.hpp"
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

// A level ground 1.5 m below the camera in the lower half of 480x270, and a wall that bounds it; no labels.
struct Ground {
  std::vector<float> depth = std::vector<float>(std::size_t{480} * 270);
  std::vector<Vec3f> normals = std::vector<Vec3f>(std::size_t{480} * 270);
  Ground() {
    for (int y = 0; y < 270; ++y) {
      for (int x = 0; x < 480; ++x) {
        const bool road = y >= 135;
        const auto i = static_cast<std::size_t>(y * 480 + x);
        depth[i] = road ? 1.5F * 400.0F / (static_cast<float>(y) + 0.5F - 120.0F) : 60.0F;
        normals[i] = road ? Vec3f{0, -1, 0} : Vec3f{0, 0, -1};
      }
    }
  }
  template <class Executor = SerialExecutor>
  Status run(Picture& p, bool with_labels = false, Executor executor = {}) const {
    AlbedoScene scene = p.scene(with_labels);
    scene.depth = ImageView<const float>(depth.data(), p.shape);
    scene.normals = ImageView<const Vec3f>(normals.data(), p.shape);
    scene.camera = {400, 400, 240, 120};
    scene.ground.inlier_share = 0.9F;
    Scratch scratch(estimate_albedo_workspace_bytes({}, p.shape));
    return estimate_albedo({}, scene, scratch.workspace(), {ImageView<Vec3f>(p.albedo.data(), p.shape), {}}, p.report,
                           executor);
  }
};

// A road 1.5 m below the camera whose light or paint is colour(across, away), m; labels, and depth of level ground.
template <class Colour>
Picture level_road(const Colour& colour) {
  Picture p(480, 270);
  for (int y = 0; y < 270; ++y) {
    for (int x = 0; x < 480; ++x) {
      RandomStream r(3, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 480 + x), 0);
      Vec3f seen{0.5F, 0.55F, 0.6F};
      if (y >= 135) {
        seen = {};
        for (int k = 0; k < 9; ++k) {  // a pixel is the mean of what it covers
          const float z = 1.5F * 400.0F / (static_cast<float>(y) + (static_cast<float>(k / 3) + 0.5F) / 3.0F - 120.0F);
          const float across =
              (static_cast<float>(x) + (static_cast<float>(k % 3) + 0.5F) / 3.0F - 240.0F) / 400.0F * z;
          seen += colour(across, z) * (1.0F / 9.0F);
        }
        seen *= 0.9F + 0.2F * r.uniform();
      }
      p.labels[p.i(x, y)] = y >= 135 ? label::road : label::sky;
      p.day[p.i(x, y)] = {encode(seen.x), encode(seen.y), encode(seen.z)};
    }
  }
  REQUIRE(Ground().run(p, true).ok());
  return p;
}

struct Everywhere {
  bool operator()(float, float) const { return true; }
};

// Mean albedo of the road where inside(across, away) over that elsewhere, of those parts of a level_road() where
// among(across, away).
template <class Inside, class Among = Everywhere>
double contrast(const Picture& p, const Inside& inside, int first_row, const Among& among = {}) {
  double sum[2] = {};
  double n[2] = {};
  for (int y = first_row; y < 265; ++y) {
    const float away = 1.5F * 400.0F / (static_cast<float>(y) + 0.5F - 120.0F);
    for (int x = 5; x < 475; ++x) {
      const float across = (static_cast<float>(x) + 0.5F - 240.0F) / 400.0F * away;
      if (!among(across, away)) continue;
      const std::size_t k = inside(across, away) ? 1 : 0;
      sum[k] += static_cast<double>(luminance(p.albedo[p.i(x, y)]));
      n[k] += 1;
    }
  }
  return (sum[1] / n[1]) / (sum[0] / n[0]);
}

}  // namespace npsim_test

#endif  // NPSIM_TESTS_DAY_PICTURE_HPP
