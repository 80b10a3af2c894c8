// SPDX-License-Identifier: Apache-2.0
// depth_edges, edge_errors, mark_near and mask_overlap.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "fixture.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/metrics/geometry_errors.hpp"

namespace {

using npsim::DepthEdgeParams;
using npsim::EdgeErrors;
using npsim::ImageView;
using npsim::MaskOverlap;
using npsim::Shape;
using npsim::StatusCode;

using Plane = std::vector<float>;
using Mask = std::vector<std::uint8_t>;

ImageView<const std::uint8_t> view(const Mask& mask, Shape shape) {
  return mask.empty() ? ImageView<const std::uint8_t>() : ImageView<const std::uint8_t>(mask.data(), shape);
}

Mask edges_of(const Plane& depth, Shape shape, const Mask& mask = {}, const DepthEdgeParams& params = {}) {
  Mask edges(depth.size(), 9);
  npsim::SerialExecutor serial;
  REQUIRE(npsim::depth_edges(params, ImageView<const float>(depth.data(), shape), view(mask, shape),
                             ImageView<std::uint8_t>(edges.data(), shape), serial)
              .ok());
  return edges;
}

// One row as a text, 1 for an edge pixel.
std::string row_edges(const Plane& row) {
  std::string text;
  for (const std::uint8_t e : edges_of(row, {static_cast<int>(row.size()), 1})) text += e != 0 ? '1' : '0';
  return text;
}

std::size_t count(const Mask& mask) {
  std::size_t n = 0;
  for (const std::uint8_t m : mask) n += m != 0 ? 1U : 0U;
  return n;
}

EdgeErrors compare(const Mask& estimate, const Mask& truth, Shape shape) {
  npsim_test::Scratch scratch(npsim::edge_errors_workspace_bytes({}, shape));
  npsim::Workspace& workspace = scratch.workspace();
  npsim::SerialExecutor serial;
  EdgeErrors errors;
  REQUIRE(npsim::edge_errors({}, view(estimate, shape), view(truth, shape), errors, workspace, serial).ok());
  return errors;
}

// Depth of a plane w = a + b x + c y.
Plane plane_depth(Shape shape, double a, double b, double c) {
  Plane depth;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) depth.push_back(static_cast<float>(1 / (a + b * x + c * y)));
  }
  return depth;
}

// A column of 20 px at 10 m before a wall at 40 m.
constexpr Shape kPost{64, 24};
Plane post(int left = 20) {
  Plane depth(kPost.pixels(), 40.0F);
  for (int y = 0; y < kPost.height; ++y) {
    for (int x = left; x < left + 20; ++x) depth[static_cast<std::size_t>(y * kPost.width + x)] = 10;
  }
  return depth;
}

}  // namespace

TEST_CASE("depth edges: a step marks the nearer of its two pixels") {
  CHECK(row_edges({10, 10, 10, 10, 10, 20, 20, 20, 20, 20}) == "0000100000");
  CHECK(row_edges({20, 20, 20, 20, 20, 10, 10, 10, 10, 10}) == "0000010000");
  CHECK(row_edges({10, 10, 10, 10, 10, 10.4F, 10.4F, 10.4F, 10.4F}) == "000000000");  // below 5 %
  CHECK(row_edges({10, 10, 10, 10, 10, 10.6F, 10.6F, 10.6F, 10.6F}) == "000010000");
}

TEST_CASE("depth edges: posts of any width have both rims") {
  CHECK(row_edges({20, 20, 20, 20, 20, 20, 5, 20, 20, 20, 20, 20, 20}) == "0000001000000");
  CHECK(row_edges({20, 20, 20, 20, 20, 20, 5, 5, 20, 20, 20, 20, 20}) == "0000001100000");
  CHECK(row_edges({20, 20, 20, 20, 20, 5, 5, 5, 5, 20, 20, 20, 20, 20}) == "00000100100000");  // as wide as the reach
}

TEST_CASE("depth edges: both rims of a slit one pixel wide, and no small step between two large ones") {
  CHECK(row_edges({5, 5, 5, 5, 5, 40, 10, 10, 10, 10, 10}) == "00001010000");
  CHECK(row_edges({5, 5, 5, 5, 20, 20, 20, 20, 20.1F, 20.1F, 20.1F, 20.1F, 5, 5, 5, 5}) == "0001000000001000");
}

TEST_CASE("depth edges: an edge smeared over several pixels is found once, in its middle") {
  Plane row;
  for (int x = 0; x < 31; ++x) {
    const double side = 0.5 + 0.5 * std::erf((x - 15.5) / (2 * std::sqrt(2.0)));  // sigma 2 px
    row.push_back(static_cast<float>(10 * std::pow(4.0, side)));
  }
  const std::string edges = row_edges(row);
  std::size_t marked = 0;
  for (const char c : edges) marked += c == '1' ? 1U : 0U;
  CHECK(marked == 1);
  const std::size_t at = edges.find('1');
  CHECK(at >= 12);
  CHECK(at <= 16);
}

TEST_CASE("depth edges: no plane has any, however grazing, and no crease where two meet") {
  const Shape shape{40, 60};
  CHECK(count(edges_of(plane_depth(shape, 0.05, 0, 0), shape)) == 0);
  CHECK(count(edges_of(plane_depth(shape, 0.001, 0.0, 0.02), shape)) == 0);  // 95 % a row at the top
  CHECK(count(edges_of(plane_depth(shape, 0.001, 0.011, 0.017), shape)) == 0);
  // A road of 12 % a row that ends at a wall.
  Plane row;
  for (int i = 0; i < 12; ++i) row.push_back(static_cast<float>(1 / (0.02 + 0.0025 * (12 - i))));
  for (int i = 0; i < 12; ++i) row.push_back(50);
  CHECK(row_edges(row).find('1') == std::string::npos);
}

TEST_CASE("depth edges: along columns as along rows") {
  const Shape tall{1, 10};
  const Plane depth = {10, 10, 10, 10, 10, 20, 20, 20, 20, 20};
  CHECK(edges_of(depth, tall) == Mask{0, 0, 0, 0, 1, 0, 0, 0, 0, 0});
}

TEST_CASE("depth edges: next to missing and masked pixels there is none") {
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  CHECK(row_edges({10, 10, 10, 10, kNaN, 20, 20, 20, 20}) == "000000000");
  CHECK(row_edges({10, 10, 10, 10, 0, 20, 20, 20, 20}) == "000000000");
  const Plane depth = {10, 10, 10, 10, 20, 20, 20, 20};
  CHECK(count(edges_of(depth, {8, 1}, {1, 1, 1, 0, 1, 1, 1, 1})) == 0);
  CHECK(count(edges_of(depth, {8, 1}, {0, 0, 0, 1, 1, 0, 0, 0})) == 1);
  CHECK(count(edges_of(Plane(1, 5.0F), {1, 1})) == 0);
}

TEST_CASE("depth edges: what is wrong with the arguments is a status") {
  Plane depth(6, 1.0F);
  Mask edges(6, 7);
  npsim::SerialExecutor serial;
  const ImageView<const float> z(depth.data(), {3, 2});
  const ImageView<std::uint8_t> out(edges.data(), {3, 2});
  for (const DepthEdgeParams& bad : {DepthEdgeParams{0, 4}, DepthEdgeParams{1, 4}, DepthEdgeParams{NAN, 4},
                                     DepthEdgeParams{0.1F, 0}, DepthEdgeParams{0.1F, 65}}) {
    CHECK(npsim::depth_edges(bad, z, {}, out, serial).code() == StatusCode::invalid_argument);
  }
  CHECK(npsim::depth_edges({}, {}, {}, out, serial).code() == StatusCode::no_valid_input);
  CHECK(npsim::depth_edges({}, z, {}, ImageView<std::uint8_t>(edges.data(), {2, 3}), serial).code() ==
        StatusCode::shape_mismatch);
  CHECK(edges == Mask(6, 7));
}

TEST_CASE("edge errors: none for the exact depth; for edges that are off, by how much") {
  const Mask truth = edges_of(post(), kPost);
  CHECK(count(truth) == 2 * static_cast<std::size_t>(kPost.height));
  const EdgeErrors exact = compare(truth, truth, kPost);
  CHECK(exact.accuracy_px == 0);
  CHECK(exact.completeness_px == 0);
  CHECK(exact.truth_pixels == exact.pixels);
  const EdgeErrors off = compare(edges_of(post(23), kPost), truth, kPost);
  CHECK(off.accuracy_px == doctest::Approx(3));
  CHECK(off.completeness_px == doctest::Approx(3));
}

TEST_CASE("edge errors: what is invented costs accuracy, what is missed costs completeness, at most D") {
  const Shape shape{60, 3};
  Mask truth(shape.pixels(), 0);
  Mask estimate(shape.pixels(), 0);
  truth[5] = 1;
  estimate[5] = 1;
  estimate[50] = 1;
  const EdgeErrors invented = compare(estimate, truth, shape);
  CHECK(invented.accuracy_px == doctest::Approx(5));
  CHECK(invented.completeness_px == 0);
  const EdgeErrors missed = compare(truth, estimate, shape);
  CHECK(missed.accuracy_px == 0);
  CHECK(missed.completeness_px == doctest::Approx(5));
  const EdgeErrors nothing = compare(Mask(shape.pixels(), 0), truth, shape);
  CHECK(nothing.pixels == 0);
  CHECK(nothing.accuracy_px == 10);
  CHECK(nothing.completeness_px == 10);
}

TEST_CASE("edge errors: distances are Euclidean") {
  const Shape shape{8, 8};
  Mask a(shape.pixels(), 0);
  Mask b(shape.pixels(), 0);
  a[0] = 1;
  b[4 * 8 + 3] = 1;  // (3, 4)
  CHECK(compare(a, b, shape).accuracy_px == doctest::Approx(5).epsilon(1e-12));
}

TEST_CASE("edge errors: against every pair of pixels, and the same bits in any order of the chunks") {
  const Shape shape{70, 53};
  Mask a;
  Mask b;
  for (std::size_t i = 0; i < shape.pixels(); ++i) {
    npsim::RandomStream random(3, npsim::RandomPurpose::generic, 0, 0, static_cast<std::uint32_t>(i), 0);
    a.push_back(random.uniform() < 0.01F ? 1 : 0);
    b.push_back(random.uniform() < 0.004F ? 1 : 0);
  }
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i] == 0) continue;
    double nearest = 10;
    for (std::size_t k = 0; k < b.size(); ++k) {
      if (b[k] == 0) continue;
      const auto w = static_cast<std::size_t>(shape.width);
      const double dx = static_cast<double>(i % w) - static_cast<double>(k % w);
      const double dy = static_cast<double>(i / w) - static_cast<double>(k / w);
      nearest = std::min(nearest, std::sqrt(dx * dx + dy * dy));
    }
    sum += nearest;
  }
  const EdgeErrors one = compare(a, b, shape);
  CHECK(one.accuracy_px == doctest::Approx(sum / static_cast<double>(count(a))).epsilon(1e-10).scale(0));
  npsim_test::BackwardExecutor backward;
  npsim_test::Scratch scratch(npsim::edge_errors_workspace_bytes({}, shape));
  npsim::Workspace& workspace = scratch.workspace();
  EdgeErrors many;
  REQUIRE(npsim::edge_errors({}, view(a, shape), view(b, shape), many, workspace, backward).ok());
  CHECK(std::memcmp(&many, &one, sizeof one) == 0);
}

TEST_CASE("edge errors: no true edge, and what is wrong with the arguments, are a status") {
  const Shape shape{4, 4};
  const Mask none(16, 0);
  const Mask some(16, 1);
  npsim_test::Scratch scratch(npsim::edge_errors_workspace_bytes({}, shape));
  npsim::Workspace& workspace = scratch.workspace();
  npsim::SerialExecutor serial;
  EdgeErrors out;
  CHECK(npsim::edge_errors({}, view(some, shape), view(none, shape), out, workspace, serial).code() ==
        StatusCode::no_valid_input);
  CHECK(npsim::edge_errors({}, view(some, {2, 8}), view(some, shape), out, workspace, serial).code() ==
        StatusCode::shape_mismatch);
  CHECK(npsim::edge_errors({0}, view(some, shape), view(some, shape), out, workspace, serial).code() ==
        StatusCode::invalid_argument);
  CHECK(npsim::edge_errors({65}, view(some, shape), view(some, shape), out, workspace, serial).code() ==
        StatusCode::invalid_argument);
  CHECK(out.pixels == 0);
}

TEST_CASE("depth error near edges: zero on the exact depth, and blind to what happens elsewhere") {
  const Plane truth = post();
  Plane estimate = truth;
  const Mask edges = edges_of(truth, kPost);
  Mask near(truth.size(), 9);
  npsim::SerialExecutor serial;
  REQUIRE(npsim::mark_near(view(edges, kPost), 3, ImageView<std::uint8_t>(near.data(), kPost), serial).ok());
  CHECK(count(near) == 14 * static_cast<std::size_t>(kPost.height));
  npsim_test::Scratch scratch(npsim::depth_errors_workspace_bytes(kPost));
  npsim::Workspace& workspace = scratch.workspace();
  const auto abs_rel = [&] {
    npsim::DepthErrors errors;
    REQUIRE(npsim::depth_errors(ImageView<const float>(estimate.data(), kPost),
                                ImageView<const float>(truth.data(), kPost), view(near, kPost), errors, workspace,
                                serial)
                .ok());
    return errors.abs_rel;
  };
  CHECK(abs_rel() == 0);
  for (int y = 0; y < kPost.height; ++y) estimate[static_cast<std::size_t>(y * kPost.width + 5)] = 1;
  CHECK(abs_rel() == 0);
  for (int y = 0; y < kPost.height; ++y) estimate[static_cast<std::size_t>(y * kPost.width + 19)] = 20;  // between
  CHECK(abs_rel() == doctest::Approx(0.5 / 14).epsilon(1e-9));
}

TEST_CASE("mark_near: the square round each pixel, cut at the border; radius 0 is the mask itself") {
  const Shape shape{5, 4};
  Mask mask(20, 0);
  mask[0] = 5;
  Mask near(20, 9);
  npsim::SerialExecutor serial;
  const ImageView<std::uint8_t> out(near.data(), shape);
  REQUIRE(npsim::mark_near(view(mask, shape), 1, out, serial).ok());
  CHECK(near == Mask{1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
  REQUIRE(npsim::mark_near(view(mask, shape), 0, out, serial).ok());
  CHECK(count(near) == 1);
  CHECK(npsim::mark_near(view(mask, shape), 65, out, serial).code() == StatusCode::invalid_argument);
  CHECK(npsim::mark_near(view(mask, shape), -1, out, serial).code() == StatusCode::invalid_argument);
  CHECK(npsim::mark_near(view(mask, {4, 5}), 1, out, serial).code() == StatusCode::shape_mismatch);
}

TEST_CASE("mask_overlap counts") {
  const Shape shape{3, 40};
  Mask a(shape.pixels(), 0);
  Mask b(shape.pixels(), 0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    a[i] = i % 2 == 0 ? 3 : 0;
    b[i] = i % 3 == 0 ? 1 : 0;
  }
  npsim_test::Scratch scratch(npsim::mask_overlap_workspace_bytes(shape));
  npsim::Workspace& workspace = scratch.workspace();
  npsim::SerialExecutor serial;
  MaskOverlap overlap;
  REQUIRE(npsim::mask_overlap(view(a, shape), view(b, shape), overlap, workspace, serial).ok());
  CHECK(overlap.first == 60);
  CHECK(overlap.second == 40);
  CHECK(overlap.both == 20);
  CHECK(npsim::mask_overlap(view(a, {40, 3}), view(b, shape), overlap, workspace, serial).code() ==
        StatusCode::shape_mismatch);
}
