// SPDX-License-Identifier: Apache-2.0
// The z-buffer against rays in double, coverage of closed sheets, and what the picture of a mesh shows.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/image.hpp"
#include "npsim/render/detail/rasterize.hpp"
#include "npsim/render/preview.hpp"
#include "unit/fixture.hpp"

namespace {

using namespace npsim;  // NOLINT(google-build-using-namespace)

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

struct Soup {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  [[nodiscard]] TriangleMeshView view() const {
    return {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}};
  }
  void add(Vec3f a, Vec3f b, Vec3f c) {
    const auto n = static_cast<std::uint32_t>(vertices.size());
    vertices.insert(vertices.end(), {a, b, c});
    faces.push_back({n, n + 1, n + 2});
  }
};

struct Buffers {
  explicit Buffers(Shape shape) : face(shape, 77), inverse_depth(shape, -7.0F) {}
  RasterizedView view() { return {face.view(), inverse_depth.view()}; }
  io::Image<std::uint32_t> face;
  io::Image<float> inverse_depth;
};

template <class Executor>
Status rasterized(const Soup& soup, const Intrinsics& k, const ViewPose& pose, Buffers& out, Executor& executor,
                  const RasterizeParams& params = {}) {
  npsim_test::Scratch scratch(rasterize_workspace_bytes(soup.vertices.size(), soup.faces.size()));
  return rasterize(params, soup.view(), k, pose, out.view(), scratch.workspace(), executor);
}

template <class Executor>
Status previewed(const PreviewParams& params, const Soup& soup, const PreviewColours& colours, const Intrinsics& k,
                 const ViewPose& pose, io::Image<Rgb8>& out, Executor& executor) {
  npsim_test::Scratch scratch(preview_workspace_bytes(params, out.shape(), soup.vertices.size(), soup.faces.size()));
  return preview(params, soup.view(), colours, k, pose, out.view(), scratch.workspace(), executor);
}

struct Random {
  std::uint64_t seed;
  std::uint32_t count = 0;
  float operator()(float low, float high) {
    const auto block = philox4x32(
        {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32U), count++, 0}, {0x76696577U, 1});
    return low + (high - low) * static_cast<float>(block[0] >> 8U) * 0x1p-24F;
  }
};

// ---- The reference: a ray in double through the centre of each pixel.

struct Seen {
  double inverse_depth = 0;
  std::uint32_t face = kNoFace;
  double margin_px = 1e9;  // distance of the centre to the nearest edge's line, of faces that could matter
  double slope = 0;        // change of inverse depth per pixel
  double runner_up = 0;    // inverse depth of the second
};

Vec3d in_view(const ViewPose& pose, const Vec3f& p) {
  const Vec3d v = vec_cast<double>(p) - vec_cast<double>(pose.eye_m);
  return {dot(vec_cast<double>(pose.right), v), dot(vec_cast<double>(pose.down), v),
          dot(vec_cast<double>(pose.forward), v)};
}

Seen first_hit(const Soup& soup, const Intrinsics& k, const ViewPose& pose, double near, int x, int y) {
  const double fx = static_cast<double>(k.fx);
  const double fy = static_cast<double>(k.fy);
  const Vec3d d{(x + 0.5 - static_cast<double>(k.cx)) / fx, (y + 0.5 - static_cast<double>(k.cy)) / fy, 1};
  Seen best;
  for (std::size_t i = 0; i < soup.faces.size(); ++i) {
    const Face& f = soup.faces[i];
    const Vec3d p[3] = {in_view(pose, soup.vertices[f.a]), in_view(pose, soup.vertices[f.b]),
                        in_view(pose, soup.vertices[f.c])};
    if (!is_finite(p[0]) || !is_finite(p[1]) || !is_finite(p[2])) continue;
    const Vec3d normal = cross(p[1] - p[0], p[2] - p[0]);
    const double det = dot(normal, p[0]);
    if (det == 0) continue;
    const double w = dot(normal, d) / det;  // 1 / z where the ray meets the plane
    bool inside = true;
    double margin = 1e9;
    for (int e = 0; e < 3; ++e) {
      const Vec3d n = cross(p[(e + 1) % 3], p[(e + 2) % 3]);
      const double value = dot(n, d) * (det > 0 ? 1 : -1);
      inside = inside && value > 0;
      // Distance to the segment, or to what of it lies in front of the near plane.
      Vec3d a = p[(e + 1) % 3];
      Vec3d b = p[(e + 2) % 3];
      if (a.z < near && b.z < near) continue;
      if (a.z < near) a = b + (a - b) * ((b.z - near) / (b.z - a.z));
      if (b.z < near) b = a + (b - a) * ((a.z - near) / (a.z - b.z));
      const double ax = fx * (a.x / a.z - d.x);
      const double ay = fy * (a.y / a.z - d.y);
      const double ex = fx * (b.x / b.z - a.x / a.z);
      const double ey = fy * (b.y / b.z - a.y / a.z);
      const double along =
          ex * ex + ey * ey > 0 ? std::clamp(-(ax * ex + ay * ey) / (ex * ex + ey * ey), 0.0, 1.0) : 0.0;
      margin = std::min(margin, std::hypot(ax + along * ex, ay + along * ey));
    }
    // The cut at the near plane is an edge of the picture too.
    const double slope = std::hypot(normal.x / (det * fx), normal.y / (det * fy));
    if (inside && slope > 0) margin = std::min(margin, std::fabs(w - 1.0 / near) / slope);
    best.margin_px = std::min(best.margin_px, margin);
    if (!inside || !(w > 0) || w > 1.0 / near) continue;
    if (w > best.inverse_depth) {
      best.runner_up = best.inverse_depth;
      best.inverse_depth = w;
      best.face = static_cast<std::uint32_t>(i);
      best.slope = slope;
    } else {
      best.runner_up = std::max(best.runner_up, w);
    }
  }
  return best;
}

struct Agreement {
  int pixels = 0;
  int judged = 0;
  int wrong_face = 0;
  int wrong_depth = 0;
};

Agreement compare(const Soup& soup, const Intrinsics& k, const ViewPose& pose, const Buffers& buffers, double near) {
  Agreement a;
  const Shape shape = buffers.face.shape();
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const Seen seen = first_hit(soup, k, pose, near, x, y);
      ++a.pixels;
      if (seen.margin_px < 1.0 / 256) continue;
      const double step = seen.slope / 256 + 1e-6 * seen.inverse_depth;
      if (seen.face != kNoFace && seen.inverse_depth - seen.runner_up < 4 * step) continue;
      ++a.judged;
      if (buffers.face(x, y) != seen.face) {
        ++a.wrong_face;
      } else if (seen.face != kNoFace) {
        const double w = static_cast<double>(buffers.inverse_depth(x, y));
        a.wrong_depth += std::fabs(w - seen.inverse_depth) > seen.slope / 256 + 3e-7 * seen.inverse_depth ? 1 : 0;
      }
    }
  }
  return a;
}

ViewPose some_pose(Random& random) {
  ViewPose pose = turned(ViewPose{}, random(-3.1F, 3.1F), random(-1.2F, 1.2F), random(1.0F, 20.0F));
  pose.eye_m += Vec3f{random(-2, 2), random(-2, 2), random(-2, 2)};
  return pose;
}

// A sheet over a picture, its corners far outside, its vertices moved by up to `jitter` of their distance.
Soup closed_sheet(int cells, float size_px, float jitter, const Intrinsics& k, Shape shape, std::uint64_t seed) {
  Random random{seed};
  Soup soup;
  const int n = cells + 1;
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      const float u = 0.5F * static_cast<float>(shape.width) +
                      size_px * (static_cast<float>(x) - 0.5F * static_cast<float>(cells) + random(-jitter, jitter));
      const float v = 0.5F * static_cast<float>(shape.height) +
                      size_px * (static_cast<float>(y) - 0.5F * static_cast<float>(cells) + random(-jitter, jitter));
      soup.vertices.push_back(unproject(k, u, v, random(1.0F, 100.0F)));
    }
  }
  for (int y = 0; y < cells; ++y) {
    for (int x = 0; x < cells; ++x) {
      const auto a = static_cast<std::uint32_t>(y * n + x);
      const auto below = a + static_cast<std::uint32_t>(n);
      if (random(0, 1) < 0.5F) {
        soup.faces.push_back({a, below + 1, a + 1});
        soup.faces.push_back({a, below, below + 1});
      } else {
        soup.faces.push_back({a, below, a + 1});
        soup.faces.push_back({a + 1, below, below + 1});
      }
    }
  }
  return soup;
}

// How often each pixel is drawn, whatever the depth.
io::Image<int> times_drawn(const Soup& soup, const Intrinsics& k, Shape shape) {
  io::Image<int> count(shape, 0);
  const rasterize_detail::Projection projection = rasterize_detail::projection_of(k, ViewPose{}, 0.05F);
  std::vector<ScreenCorner> corners;
  for (const Vec3f& v : soup.vertices) {
    const Vec3d p = projection.scaled_point(v);
    corners.push_back(projection.within(p) ? projection.corner(p) : ScreenCorner{});
  }
  for (const Face& f : soup.faces) {
    rasterize_detail::for_triangles(projection, soup.view(), corners.data(), f,
                                    [&](const ScreenCorner& a, const ScreenCorner& b, const ScreenCorner& c) {
                                      for_covered(a, b, c, 0, shape.height, shape.width,
                                                  [&](int x, int y, float) { ++count(x, y); });
                                    });
  }
  return count;
}

int count_not(const io::Image<int>& image, int expected) {
  int n = 0;
  for (int y = 0; y < image.height(); ++y) {
    for (int x = 0; x < image.width(); ++x) n += image(x, y) != expected ? 1 : 0;
  }
  return n;
}

bool same_bytes(const Buffers& a, const Buffers& b) {
  const std::size_t n = a.face.shape().pixels();
  return std::memcmp(a.face.data(), b.face.data(), n * sizeof(std::uint32_t)) == 0 &&
         std::memcmp(a.inverse_depth.data(), b.inverse_depth.data(), n * sizeof(float)) == 0;
}

const Intrinsics kCamera{80, 75, 48.3F, 31.7F};
constexpr Shape kShape{97, 64};

TEST_CASE("render preview: each pixel shows the face that its ray meets first, to 1/256 pixel") {
  SerialExecutor serial;
  Agreement all;
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    Random random{seed};
    Soup soup;
    for (int i = 0; i < 120; ++i) {
      const Vec3f centre{random(-20, 20), random(-20, 20), random(-20, 20)};
      const float size = random(0.0F, 1.0F) < 0.3F ? 20.0F : 3.0F;
      const auto corner = [&] { return centre + Vec3f{random(-size, size), random(-size, size), random(-size, size)}; };
      soup.add(corner(), corner(), corner());
    }
    const ViewPose pose = some_pose(random);
    Buffers buffers(kShape);
    REQUIRE(rasterized(soup, kCamera, pose, buffers, serial).ok());
    const Agreement a = compare(soup, kCamera, pose, buffers, static_cast<double>(RasterizeParams{}.near_m));
    CHECK(a.wrong_face == 0);
    CHECK(a.wrong_depth == 0);
    all.pixels += a.pixels;
    all.judged += a.judged;
  }
  CHECK(all.judged > 0.9 * all.pixels);
}

TEST_CASE("render preview: faces that cross the near plane, or lie behind it") {
  SerialExecutor serial;
  Agreement all;
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    Random random{100 + seed};
    Soup soup;
    for (int i = 0; i < 6; ++i) {
      const auto corner = [&] { return Vec3f{random(-9, 9), random(-9, 9), random(-9, 9)}; };
      soup.add(corner(), corner(), corner());
    }
    Buffers buffers(kShape);
    REQUIRE(rasterized(soup, kCamera, ViewPose{}, buffers, serial, {0.5F}).ok());
    const Agreement a = compare(soup, kCamera, ViewPose{}, buffers, 0.5);
    CHECK(a.wrong_face == 0);
    CHECK(a.wrong_depth == 0);
    all.pixels += a.pixels;
    all.judged += a.judged;
  }
  CHECK(all.judged > 0.9 * all.pixels);
  Soup behind;
  behind.add({-1, -1, -2}, {1, -1, -2}, {0, 1, -2});
  behind.add({-1, -1, 0.01F}, {1, -1, 0.01F}, {0, 1, 0.04F});
  Buffers buffers(kShape);
  REQUIRE(rasterized(behind, kCamera, ViewPose{}, buffers, serial).ok());
  CHECK(std::count(buffers.face.data(), buffers.face.data() + kShape.pixels(), kNoFace) ==
        static_cast<std::ptrdiff_t>(kShape.pixels()));
}

TEST_CASE("render preview: a closed sheet covers every pixel exactly once") {
  // Cells of many pixels, of one, and of a third of one; jitter keeps every cell convex, so that none folds over.
  CHECK(count_not(times_drawn(closed_sheet(12, 17.0F, 0.24F, kCamera, kShape, 1), kCamera, kShape), 1) == 0);
  CHECK(count_not(times_drawn(closed_sheet(130, 1.0F, 0.24F, kCamera, kShape, 2), kCamera, kShape), 1) == 0);
  CHECK(count_not(times_drawn(closed_sheet(400, 0.33F, 0.2F, kCamera, kShape, 3), kCamera, kShape), 1) == 0);
  // Vertices exactly on the centres of pixels, as a sheet has them from its own camera: every pixel is a vertex.
  const Intrinsics whole{64, 64, 48.5F, 32};
  CHECK(count_not(times_drawn(closed_sheet(130, 1.0F, 0, whole, kShape, 4), whole, kShape), 1) == 0);
  // Edges along rows and columns of centres.
  CHECK(count_not(times_drawn(closed_sheet(8, 20.0F, 0, whole, {80, 80}, 5), {64, 64, 40, 40}, {80, 80}), 1) == 0);
}

TEST_CASE("render preview: a fan around a point on a pixel's centre gives the pixel to one face") {
  const Intrinsics k{64, 64, 16.5F, 16.5F};  // the axis runs through the centre of pixel (16, 16)
  Soup soup;
  constexpr int kSides = 13;
  for (int i = 0; i < kSides; ++i) {
    const auto at = [](int j) {
      const float t = 6.2831853F * static_cast<float>(j % kSides) / kSides;
      return Vec3f{std::cos(t), std::sin(t), 1};
    };
    soup.add({0, 0, 1}, at(i), at(i + 1));
  }
  CHECK(count_not(times_drawn(soup, k, {33, 33}), 1) == 0);
}

TEST_CASE("render preview: a floor that runs from behind the camera to the horizon has no crack") {
  // 40 strips that all cross the near plane, and the plane of the camera.
  Soup soup;
  Random random{9};
  std::vector<float> x;
  for (int i = 0; i <= 40; ++i) x.push_back(-400.0F + 20.0F * static_cast<float>(i) + random(-5, 5));
  for (std::size_t i = 0; i < 40; ++i) {
    soup.vertices.insert(soup.vertices.end(), {Vec3f{x[i], 1, -50}, Vec3f{x[i], 1, 1e5F}});
    const auto n = static_cast<std::uint32_t>(2 * i);
    soup.faces.push_back({n, n + 1, n + 2});
    soup.faces.push_back({n + 1, n + 3, n + 2});
  }
  soup.vertices.insert(soup.vertices.end(), {Vec3f{x[40], 1, -50}, Vec3f{x[40], 1, 1e5F}});
  const io::Image<int> count = times_drawn(soup, {50, 50, 48, 20}, {96, 64});
  int wrong = 0;
  for (int y = 21; y < 64; ++y) {
    for (int px = 0; px < 96; ++px) wrong += count(px, y) != 1 ? 1 : 0;
  }
  CHECK(wrong == 0);
}

TEST_CASE("render preview: degenerate, infinite, huge and tiny faces") {
  SerialExecutor serial;
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  constexpr float kMax = std::numeric_limits<float>::max();
  Soup soup;
  soup.add({-1, 0, 2}, {0, 0, 2}, {1, 0, 2});                      // collinear
  soup.add({0.2F, 0.1F, 2}, {0.2F, 0.1F, 2}, {0.2F, 0.1F, 2});     // a point
  soup.add({-9, -9, 2}, {9, -9, kNaN}, {0, 9, 2});                 // not a number
  soup.add({-9, -9, 2}, {kInfinity, -9, 2}, {0, 9, 2});            // infinite
  soup.add({-9, -9, 2}, {9, -9, 2}, {0, -kInfinity, -kInfinity});  // infinite
  soup.faces.push_back({0, 0, 1});                                 // an index twice
  Buffers buffers(kShape);
  REQUIRE(rasterized(soup, kCamera, ViewPose{}, buffers, serial).ok());
  for (int i = 0; i < static_cast<int>(kShape.pixels()); ++i) REQUIRE(buffers.face.data()[i] == kNoFace);
  // Of the size of the largest float: it covers the picture, at 1e30 m and from before the camera to behind it.
  Soup huge;
  huge.add({-kMax, -kMax, 1e30F}, {kMax, -kMax, 1e30F}, {0, kMax, 1e30F});
  Buffers far_away(kShape);
  REQUIRE(rasterized(huge, kCamera, ViewPose{}, far_away, serial).ok());
  CHECK(far_away.face(48, 31) == 0);
  CHECK(static_cast<double>(far_away.inverse_depth(48, 31)) == doctest::Approx(1e-30).epsilon(1e-5));
  Soup through;
  through.add({-3e38F, 1, -3e38F}, {3e38F, 1, -3e38F}, {0, 1, 3e38F});  // the ground, from behind to the horizon
  Buffers ground(kShape);
  REQUIRE(rasterized(through, kCamera, ViewPose{}, ground, serial).ok());
  CHECK(ground.face(48, 60) == 0);
  CHECK(static_cast<double>(ground.inverse_depth(48, 60)) == doctest::Approx((60.5 - 31.7) / 75).epsilon(1e-5));
  CHECK(ground.face(48, 10) == kNoFace);
}

TEST_CASE("render preview: of two faces at one place the first is shown") {
  SerialExecutor serial;
  Soup soup;
  for (int i = 0; i < 3; ++i) soup.add({-9, -9, 2}, {9, -9, 2}, {0, 9, 2});
  Buffers buffers(kShape);
  REQUIRE(rasterized(soup, kCamera, ViewPose{}, buffers, serial).ok());
  CHECK(buffers.face(48, 31) == 0);
}

TEST_CASE("render preview: the same bits for any executor") {
  SerialExecutor serial;
  npsim_test::BackwardExecutor backward;
  ThreadPool pool(3);
  const Shape shape{160, 123};
  const Intrinsics k{120, 120, 80, 60};
  const Soup soup = closed_sheet(150, 1.7F, 0.4F, k, shape, 6);  // folds and all
  const ViewPose pose = turned(ViewPose{}, 0.6F, 0.2F, 8.0F);
  Buffers a(shape);
  Buffers b(shape);
  Buffers c(shape);
  REQUIRE(rasterized(soup, k, pose, a, serial).ok());
  REQUIRE(rasterized(soup, k, pose, b, backward).ok());
  REQUIRE(rasterized(soup, k, pose, c, pool).ok());
  CHECK(same_bytes(a, b));
  CHECK(same_bytes(a, c));
  io::Image<Rgb8> p(shape);
  io::Image<Rgb8> q(shape);
  PreviewParams params;
  params.shading = 0.5F;
  params.wire_px = 1;
  REQUIRE(previewed(params, soup, {}, k, pose, p, serial).ok());
  REQUIRE(previewed(params, soup, {}, k, pose, q, pool).ok());
  CHECK(std::memcmp(p.data(), q.data(), shape.pixels() * sizeof(Rgb8)) == 0);
}

TEST_CASE("render preview: more rows than bands can be numbered") {
  SerialExecutor serial;
  Soup soup;
  const Intrinsics k{100, 100, 1, 5000};
  soup.add({-9, -900, 10}, {9, -900, 10}, {0, 900, 10});
  Buffers buffers({2, 10007});
  REQUIRE(rasterized(soup, k, ViewPose{}, buffers, serial).ok());
  int wrong = 0;
  for (int y = 0; y < 10007; ++y) wrong += buffers.face(1, y) != 0 ? 1 : 0;
  CHECK(wrong == 0);
}

TEST_CASE("render preview: colours between vertices, in perspective") {
  SerialExecutor serial;
  // A floor from 1 m to 9 m: half way on the screen is not half way on the floor.
  Soup soup;
  soup.vertices = {{-5, 1, 1}, {5, 1, 1}, {-45, 1, 9}, {45, 1, 9}};
  soup.faces = {{0, 1, 2}, {2, 1, 3}};  // its front is up
  const std::vector<Rgb8> colours = {{0, 40, 0}, {0, 40, 0}, {240, 40, 0}, {240, 40, 0}};
  PreviewColours by_vertex;
  by_vertex.vertex = {colours.data(), colours.size()};
  const Intrinsics k{100, 100, 50, 0};
  io::Image<Rgb8> picture({100, 100});
  PreviewParams params;
  REQUIRE(previewed(params, soup, by_vertex, k, ViewPose{}, picture, serial).ok());
  for (int y = 12; y < 99; y += 7) {
    const double z = 100.0 / (y + 0.5);
    const double expected = z <= 9 ? 240.0 * (z - 1) / 8 : 0;
    const double found = static_cast<double>(picture(50, y).r);
    CHECK(std::fabs(found - expected) <= 1.0);
    CHECK(picture(50, y).g == 40);
  }
}

TEST_CASE("render preview: from its own camera a sheet shows its photograph") {
  SerialExecutor serial;
  const Shape shape{40, 30};
  const Intrinsics k{35, 33, 20.2F, 14.6F};
  Random random{3};
  Soup soup;
  std::vector<std::uint32_t> texel;
  io::Image<Rgb8> photograph(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      soup.vertices.push_back(unproject_pixel(k, x, y, random(2, 60)));
      texel.push_back(static_cast<std::uint32_t>(y * shape.width + x));
      const auto byte = [&] { return static_cast<std::uint8_t>(random(0, 255)); };
      photograph(x, y) = {byte(), byte(), byte()};
    }
  }
  for (int y = 0; y + 1 < shape.height; ++y) {
    for (int x = 0; x + 1 < shape.width; ++x) {
      const auto a = static_cast<std::uint32_t>(y * shape.width + x);
      const auto below = a + static_cast<std::uint32_t>(shape.width);
      soup.faces.push_back({a, below + 1, a + 1});
      soup.faces.push_back({a, below, below + 1});
    }
  }
  PreviewColours colours;
  colours.texel = {texel.data(), texel.size()};
  colours.texture = photograph.view();
  io::Image<Rgb8> picture(shape);
  PreviewParams params;
  params.background = {255, 0, 255};
  REQUIRE(previewed(params, soup, colours, k, ViewPose{}, picture, serial).ok());
  int off = 0;
  // Rim pixels have their centre on the outermost edges.
  for (int y = 1; y + 1 < shape.height; ++y) {
    for (int x = 1; x + 1 < shape.width; ++x) {
      const Rgb8 a = picture(x, y);
      const Rgb8 b = photograph(x, y);
      off += std::abs(a.r - b.r) > 1 || std::abs(a.g - b.g) > 1 || std::abs(a.b - b.b) > 1 ? 1 : 0;
    }
  }
  CHECK(off == 0);
}

TEST_CASE("render preview: a face as large as the road wears the photograph undistorted") {
  SerialExecutor serial;
  const Shape shape{64, 48};
  const Intrinsics k{50, 50, 32, 10};
  io::Image<Rgb8> photograph(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      photograph(x, y) = {static_cast<std::uint8_t>(4 * x), static_cast<std::uint8_t>(5 * y), 9};
    }
  }
  // A floor 1 m below the camera, its corners on pixels of the rows 12 and 46.
  Soup soup;
  std::vector<std::uint32_t> texel;
  for (const auto& [x, y] : {std::pair{1, 12}, {62, 12}, {1, 46}, {62, 46}}) {
    soup.vertices.push_back(unproject_pixel(k, x, y, k.fy / (static_cast<float>(y) + 0.5F - k.cy)));
    texel.push_back(static_cast<std::uint32_t>(y * shape.width + x));
  }
  soup.faces = {{0, 2, 1}, {1, 2, 3}};
  PreviewColours colours;
  colours.texel = {texel.data(), texel.size()};
  colours.texture = photograph.view();
  io::Image<Rgb8> picture(shape);
  REQUIRE(previewed({}, soup, colours, k, ViewPose{}, picture, serial).ok());
  int off = 0;
  for (int y = 13; y < 46; ++y) {
    for (int x = 2; x < 62; ++x) {
      const Rgb8 a = picture(x, y);
      const Rgb8 b = photograph(x, y);
      off += std::abs(a.r - b.r) > 1 || std::abs(a.g - b.g) > 1 ? 1 : 0;
    }
  }
  CHECK(off == 0);
}

TEST_CASE("render preview: backs, shading and wires are told apart") {
  SerialExecutor serial;
  Soup soup;
  soup.add({-4, -2, 2}, {-4, 2, 2}, {0, 0, 2});  // front: counter-clockwise for who looks along z with y down
  soup.add({4, -2, 2}, {0, 0, 2}, {4, 2, 2});
  std::swap(soup.faces[1].b, soup.faces[1].c);
  const Intrinsics k{40, 40, 50, 50};
  io::Image<Rgb8> picture({100, 100});
  PreviewParams params;
  params.back_share = 1;
  REQUIRE(previewed(params, soup, {}, k, ViewPose{}, picture, serial).ok());
  CHECK(picture(20, 50).r == params.plain.r);
  CHECK(picture(80, 50).r == params.back.r);
  CHECK(picture(80, 50).g == params.back.g);
  CHECK(picture(50, 5).b == params.background.b);
  params.shading = 1;
  params.wire_px = 3;
  REQUIRE(previewed(params, soup, {}, k, ViewPose{}, picture, serial).ok());
  const double lit = static_cast<double>(params.plain.r) * 0.48;
  CHECK(std::fabs(static_cast<double>(picture(20, 50).r) - lit) <= 1.0);
  CHECK(picture(47, 50).r == params.wire.r);
  CHECK(picture(53, 50).r == params.wire.r);
  CHECK(picture(25, 50).r != params.wire.r);
}

TEST_CASE("render preview: bad input is refused and the picture left alone") {
  SerialExecutor serial;
  Soup soup;
  soup.add({-1, -1, 2}, {1, -1, 2}, {0, 1, 2});
  Buffers buffers(kShape);
  const auto untouched = [&] { return buffers.face(3, 3) == 77 && buffers.inverse_depth(3, 3) == -7.0F; };
  Soup dangling = soup;
  dangling.faces.push_back({0, 1, 3});
  CHECK(rasterized(dangling, kCamera, ViewPose{}, buffers, serial).code() == StatusCode::invalid_argument);
  CHECK(untouched());
  for (const float near : {0.0F, -1.0F, kNaN, 1e-9F}) {
    CHECK(rasterized(soup, kCamera, ViewPose{}, buffers, serial, {near}).code() == StatusCode::invalid_argument);
  }
  ViewPose skewed;
  skewed.right = {1, 0.1F, 0};
  CHECK(rasterized(soup, kCamera, skewed, buffers, serial).code() == StatusCode::invalid_argument);
  ViewPose mirrored;
  mirrored.right = {-1, 0, 0};
  CHECK(rasterized(soup, kCamera, mirrored, buffers, serial).code() == StatusCode::invalid_argument);
  ViewPose nowhere;
  nowhere.eye_m.x = kNaN;
  CHECK(rasterized(soup, kCamera, nowhere, buffers, serial).code() == StatusCode::invalid_argument);
  CHECK(rasterized(soup, {80, -80, 1, 1}, ViewPose{}, buffers, serial).code() == StatusCode::invalid_argument);
  CHECK(rasterized(soup, {80, 80, 1e9F, 1}, ViewPose{}, buffers, serial).code() == StatusCode::invalid_argument);
  CHECK(untouched());
  Workspace none;
  CHECK(rasterize({}, soup.view(), kCamera, {}, buffers.view(), none, serial).code() ==
        StatusCode::workspace_exhausted);
  io::Image<float> small({3, 3});
  CHECK(rasterize({}, soup.view(), kCamera, {}, {buffers.face.view(), small.view()}, none, serial).code() ==
        StatusCode::shape_mismatch);
  CHECK(untouched());
  io::Image<Rgb8> picture(kShape, Rgb8{1, 2, 3});
  const std::vector<Rgb8> two(2);
  PreviewColours colours;
  colours.vertex = {two.data(), two.size()};
  CHECK(previewed({}, soup, colours, kCamera, {}, picture, serial).code() == StatusCode::shape_mismatch);
  const std::vector<std::uint32_t> texels = {0, 1, 4};
  const io::Image<Rgb8> texture({2, 2});
  PreviewColours textured;
  textured.texel = {texels.data(), texels.size()};
  CHECK(previewed({}, soup, textured, kCamera, {}, picture, serial).code() == StatusCode::shape_mismatch);
  textured.texture = texture.view();
  CHECK(previewed({}, soup, textured, kCamera, {}, picture, serial).code() == StatusCode::invalid_argument);
  PreviewParams params;
  params.back_share = kNaN;
  CHECK(previewed(params, soup, {}, kCamera, {}, picture, serial).code() == StatusCode::invalid_argument);
  CHECK(picture(3, 3).g == 2);
}

TEST_CASE("render preview: a mesh without faces is all background") {
  SerialExecutor serial;
  io::Image<Rgb8> picture({5, 4});
  PreviewParams params;
  REQUIRE(previewed(params, Soup{}, {}, kCamera, {}, picture, serial).ok());
  CHECK(picture(2, 2).b == params.background.b);
}

TEST_CASE("render preview: the pivot stays where it is in the picture, and the camera goes round it clockwise") {
  const ViewPose pose = turned(ViewPose{}, 0.7853982F, 0.0F, 10.0F);
  CHECK(validate(pose).ok());
  CHECK(pose.forward.x == doctest::Approx(0.70711));  // heading to the right
  CHECK(pose.eye_m.x == doctest::Approx(-7.0711));    // from the left
  CHECK(pose.eye_m.z == doctest::Approx(2.9289));
  Random random{5};
  for (int i = 0; i < 200; ++i) {
    const float pivot = random(1, 50);
    const ViewPose p = turned(ViewPose{}, random(-3, 3), random(-1.5F, 1.5F), pivot);
    REQUIRE(validate(p).ok());
    const Vec3f rest = cross(p.right, p.down) - p.forward;
    REQUIRE(length(rest) < 1e-6F);
    const Vec3f seen = Vec3f{0, 0, pivot} - p.eye_m;
    REQUIRE(std::fabs(dot(seen, p.right)) < 1e-5F * pivot);
    REQUIRE(std::fabs(dot(seen, p.down)) < 1e-5F * pivot);
    REQUIRE(dot(seen, p.forward) == doctest::Approx(static_cast<double>(pivot)));
  }
  const ViewPose near = closer(pose, 3.0F);
  CHECK(length(near.eye_m - pose.eye_m) == doctest::Approx(3.0));
  CHECK(near.eye_m.z > pose.eye_m.z);
}

TEST_CASE("render preview: the pivot keeps the camera out of the houses, and shows an open place") {
  const Intrinsics k{150, 150, 160, 90};
  // A street between two rows of houses, or a place with one row of houses across its far end.
  const auto depth_of = [&](float half_width, float end) {
    io::Image<float> depth({320, 180}, kNaN);
    for (int y = 0; y < 180; ++y) {
      for (int x = 0; x < 320; ++x) {
        const Vec3f ray = unproject_pixel(k, x, y, 1.0F);
        float z = std::min(end, half_width / std::fabs(ray.x));
        if (ray.y > 0) z = std::min(z, 1.5F / ray.y);
        depth(x, y) = z;
      }
    }
    return depth;
  };
  PivotParams params;
  const io::Image<float> street = depth_of(7.0F, 150.0F);
  const io::Image<float> place = depth_of(1000.0F, 40.0F);
  const float in_street = pivot_m(params, street.view(), k, 0.7853982F, 0);
  const float in_place = pivot_m(params, place.view(), k, 0.7853982F, 0);
  CHECK(in_street * 0.70711F < 7.0F);  // before the left row of houses
  CHECK(in_street >= params.min_m);
  CHECK(in_place > 1.5F * in_street);
  const io::Image<float> none({30, 30}, kNaN);
  CHECK(pivot_m(params, none.view(), k, 0.7853982F, 0) == params.min_m);
  CHECK(pivot_m(params, ImageView<const float>{}, k, 0.7853982F, 0) == params.min_m);
  const io::Image<float> one({1, 1}, 5.0F);
  CHECK(pivot_m(params, one.view(), k, 0.7853982F, 0) == params.min_m);
}

}  // namespace
