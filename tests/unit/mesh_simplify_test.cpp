// SPDX-License-Identifier: Apache-2.0
#include "npsim/mesh/simplify.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "mesh_fixture.hpp"

using namespace mesh_test;

namespace {

struct Simplified {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<std::uint32_t> pixels;
  SimplifyResult result;
  [[nodiscard]] TriangleMeshView view() const {
    return {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}};
  }
};

template <class Executor>
Simplified simplify(const SheetLayer& layer, ImageView<const std::uint32_t> ids, const Intrinsics& intrinsics,
                    const SimplifyParams& params, Executor& executor) {
  Simplified mesh;
  const MeshSize full = mesh_size(layer);
  mesh.vertices.resize(full.vertices);
  mesh.pixels.resize(full.vertices);
  mesh.faces.resize(full.faces);
  Scratch scratch(simplify_layer_workspace_bytes(params, layer.vertices.shape()));
  const MeshBuffers out{
      {mesh.vertices.data(), full.vertices}, {mesh.faces.data(), full.faces}, {mesh.pixels.data(), full.vertices}};
  const Status status =
      simplify_layer(params, layer, ids, intrinsics, 0, out, mesh.result, scratch.workspace(), executor);
  REQUIRE_MESSAGE(status.ok(), status.message());
  CHECK(mesh.result.full.faces == full.faces);
  CHECK(mesh.result.full.vertices == full.vertices);
  mesh.vertices.resize(mesh.result.size.vertices);
  mesh.pixels.resize(mesh.result.size.vertices);
  mesh.faces.resize(mesh.result.size.faces);
  return mesh;
}

struct Point {
  double x = 0, y = 0, w = 0;
};
double cross2(const Point& a, const Point& b, const Point& c) {
  return (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
}

// A mesh over the image, by pixels.
struct Flat {
  Flat(const std::vector<Vec3f>& vertices, const std::vector<std::uint32_t>& pixels, const std::vector<Face>& mesh,
       int width)
      : faces(mesh) {
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      points.push_back({static_cast<double>(pixels[v] % static_cast<std::uint32_t>(width)),
                        static_cast<double>(pixels[v] / static_cast<std::uint32_t>(width)),
                        1.0 / static_cast<double>(vertices[v].z)});
    }
    for (const Face& f : faces) {
      for (const auto& [from, to] : {std::pair{f.a, f.b}, {f.b, f.c}, {f.c, f.a}}) {
        edges.emplace_back(std::min(from, to), std::max(from, to));
      }
    }
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  }
  [[nodiscard]] double area() const {
    double sum = 0;
    for (const Face& f : faces) sum -= cross2(points[f.a], points[f.b], points[f.c]);
    return 0.5 * sum;
  }
  std::vector<Point> points;
  std::vector<Face> faces;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
};

// Plain double: depth at every pixel centre of every face and at every crossing of an edge with an edge.
double largest_error(const Flat& full, const Flat& thin) {
  double largest = 0;
  const auto compare = [&](double w, double other) { largest = std::max(largest, std::fabs(w / other - 1.0)); };
  for (const Face& f : thin.faces) {
    const Point& a = thin.points[f.a];
    const Point& b = thin.points[f.b];
    const Point& c = thin.points[f.c];
    for (const Point& p : full.points) {
      const double whole = cross2(a, b, c);
      const double u = cross2(p, b, c) / whole;
      const double v = cross2(a, p, c) / whole;
      const double t = cross2(a, b, p) / whole;
      if (u < 0 || v < 0 || t < 0) continue;
      compare(p.w, u * a.w + v * b.w + t * c.w);
    }
  }
  for (const auto& [i, j] : thin.edges) {
    const Point& a = thin.points[i];
    const Point& b = thin.points[j];
    for (const auto& [k, l] : full.edges) {
      const Point& c = full.points[k];
      const Point& d = full.points[l];
      if (std::max(c.x, d.x) < std::min(a.x, b.x) || std::max(c.y, d.y) < std::min(a.y, b.y) ||
          std::min(c.x, d.x) > std::max(a.x, b.x) || std::min(c.y, d.y) > std::max(a.y, b.y)) {
        continue;
      }
      const double along = (b.x - a.x) * (d.y - c.y) - (b.y - a.y) * (d.x - c.x);
      if (along == 0) continue;
      const double s = ((c.x - a.x) * (d.y - c.y) - (c.y - a.y) * (d.x - c.x)) / along;
      const double t = ((c.x - a.x) * (b.y - a.y) - (c.y - a.y) * (b.x - a.x)) / along;
      if (s < 0 || s > 1 || t < 0 || t > 1) continue;
      compare(c.w + t * (d.w - c.w), a.w + s * (b.w - a.w));
    }
  }
  return largest;
}

// Every pixel centre lies in a face, on an edge or at a vertex whose corners all have its id.
void check_ids(const Flat& full, const Flat& thin, const std::vector<std::uint32_t>& full_pixels,
               const std::vector<std::uint32_t>& thin_pixels, const Image<std::uint32_t>& ids) {
  const auto id = [&](std::uint32_t pixel) {
    const auto width = static_cast<std::uint32_t>(ids.shape().width);
    return ids(static_cast<int>(pixel % width), static_cast<int>(pixel / width));
  };
  std::vector<bool> found(full.points.size(), false);
  for (const Face& f : thin.faces) {
    const std::uint32_t corner[3] = {f.a, f.b, f.c};
    const double whole = cross2(thin.points[f.a], thin.points[f.b], thin.points[f.c]);
    REQUIRE(whole < 0);
    for (std::size_t i = 0; i < full.points.size(); ++i) {
      const Point& p = full.points[i];
      bool inside = true;
      bool same = true;
      for (int k = 0; k < 3; ++k) {  // a corner matters unless p is on the side across from it
        const double side = cross2(p, thin.points[corner[(k + 1) % 3]], thin.points[corner[(k + 2) % 3]]);
        inside = inside && side <= 0;
        same = same && (side == 0 || id(thin_pixels[corner[k]]) == id(full_pixels[i]));
      }
      if (!inside) continue;
      REQUIRE(same);
      found[i] = true;
    }
  }
  for (std::size_t i = 0; i < found.size(); ++i) REQUIRE(found[i]);
}

// What holds for every simplified layer.
Simplified check_simplified(const SheetLayer& layer, const Image<std::uint32_t>& ids, const Intrinsics& intrinsics,
                            float bound) {
  SimplifyParams params;
  params.max_relative_depth_error = bound;
  SerialExecutor serial;
  Simplified mesh = simplify(layer, ids.cview(), intrinsics, params, serial);
  const Indexed indexed = index(layer);
  const MeshReport before = report(indexed.view());
  const MeshReport after = report(mesh.view());
  CHECK(after.oriented_manifold());
  CHECK(after.isolated_vertices == 0);
  CHECK(after.components == before.components);
  CHECK(after.boundary_loops == before.boundary_loops);
  CHECK(after.euler_characteristic == before.euler_characteristic);
  const int width = layer.vertices.width();
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const auto p = static_cast<int>(mesh.pixels[i]);
    REQUIRE(layer.vertices(p % width, p / width) == mesh.vertices[i]);
    if (i > 0) REQUIRE(mesh.pixels[i - 1] <= mesh.pixels[i]);
  }
  for (const Face& f : mesh.faces) {
    const Vec3d a = vec_cast<double>(mesh.vertices[f.a]);
    REQUIRE(dot(cross(vec_cast<double>(mesh.vertices[f.b]) - a, vec_cast<double>(mesh.vertices[f.c]) - a), a) < 0.0);
  }
  const Flat full(indexed.vertices, indexed.pixels, indexed.faces, width);
  const Flat thin(mesh.vertices, mesh.pixels, mesh.faces, width);
  CHECK(thin.area() == full.area());
  const double error = largest_error(full, thin);
  CHECK(error <= static_cast<double>(bound) + 0x1p-21 + 0x1p-22);
  CHECK(std::fabs(error - static_cast<double>(mesh.result.depth.max_relative)) <= 0x1p-22);
  check_ids(full, thin, indexed.pixels, mesh.pixels, ids);

  Image<float> depth(layer.vertices.shape(), -1.0F, kPadding, -2.0F);
  REQUIRE(simplified_depth(mesh.view(), {mesh.pixels.data(), mesh.pixels.size()}, depth.view()).ok());
  std::vector<bool> covered(layer.vertices.shape().pixels(), false);
  for (const std::uint32_t p : indexed.pixels) covered[p] = true;
  for (std::size_t p = 0; p < covered.size(); ++p) {
    const int x = static_cast<int>(p) % width;
    const int y = static_cast<int>(p) / width;
    if (!covered[p]) {
      REQUIRE(depth(x, y) == 0.0F);
    } else {
      REQUIRE(std::fabs(depth(x, y) / layer.vertices(x, y).z - 1.0F) <= bound + 0x1p-20F);
    }
  }
  return mesh;
}

struct Terrain {
  explicit Terrain(Shape s) : picture(s), ids(s, 0, kPadding, 99) {}
  // A sum of waves with noise, over some planes.
  void raise(std::uint32_t seed, float noise) {
    RandomStream random(11, RandomPurpose::test, seed, 0, 0, 0);
    float wave[4][4];
    for (auto& w : wave) {
      for (float& v : w) v = random.uniform(-1.0F, 1.0F);
    }
    const float tilt = random.uniform(-0.02F, 0.02F);
    for (int y = 0; y < ids.shape().height; ++y) {
      for (int x = 0; x < ids.shape().width; ++x) {
        const auto u = static_cast<float>(x);
        const auto v = static_cast<float>(y);
        float inverse = 0.1F * std::exp(tilt * (u - 0.5F * v));
        for (const auto& w : wave)
          inverse *= 1.0F + 0.05F * w[0] * std::sin(0.5F * (w[1] * u + w[2] * v) + 3.0F * w[3]);
        picture.depth(x, y) = (1.0F + noise * random.uniform(-1.0F, 1.0F)) / inverse;
      }
    }
  }
  SheetLayer sheet() {
    SerialExecutor executor;
    REQUIRE(build_sheet({}, picture.depth.cview(), picture.surface.cview(), picture.intrinsics, picture.sheet.view(),
                        executor)
                .ok());
    return picture.sheet.view();
  }
  Simplified check(float bound) { return check_simplified(sheet(), ids, picture.intrinsics, bound); }

  Picture picture;
  Image<std::uint32_t> ids;
};

// z of a plane of the world that shows at pixel (x, y).
float plane_depth(const Intrinsics& k, int x, int y, const Vec3d& normal, double offset) {
  const Vec3d ray{(x + 0.5 - static_cast<double>(k.cx)) / static_cast<double>(k.fx),
                  (y + 0.5 - static_cast<double>(k.cy)) / static_cast<double>(k.fy), 1.0};
  return static_cast<float>(offset / dot(normal, ray));
}

}  // namespace

TEST_CASE("simplify: random terrains with masks and labels keep the bound, their rims, labels and topology") {
  std::size_t before = 0;
  std::size_t after = 0;
  for (std::uint32_t trial = 0; trial < 120; ++trial) {
    CAPTURE(trial);
    RandomStream random(12, RandomPurpose::test, trial, 0, 0, 0);
    const Shape shape{2 + static_cast<int>(random.uniform(0.0F, 24.0F)),
                      2 + static_cast<int>(random.uniform(0.0F, 24.0F))};
    Terrain t(shape);
    t.raise(trial, trial % 3 == 0 ? 0.02F : 0.001F);
    const float holes = trial % 4 == 0 ? 0.15F : (trial % 4 == 1 ? 0.02F : 0.0F);
    const bool regions = trial % 5 != 0;
    const int radius = 3 + static_cast<int>(random.uniform(0.0F, 9.0F));
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (random.uniform() < holes) t.picture.surface(x, y) = 0;
        if (regions) t.ids(x, y) = (x * x + y * y < radius * radius ? 1U : 0U) + (3 * x > 2 * y + 14 ? 2U : 0U);
        if (trial % 7 == 6 && random.uniform() < 0.1F) t.ids(x, y) = 9;
      }
    }
    SheetLayer sheet = t.sheet();
    if (trial % 6 == 5) {  // faces at random: pinched vertices
      for (int y = 0; y + 1 < shape.height; ++y) {
        for (int x = 0; x + 1 < shape.width; ++x) {
          if (random.uniform() >= 0.2F) continue;
          const unsigned gone = random.uniform() < 0.5F ? kQuadUpperFace : kQuadLowerFace;
          sheet.quads(x, y) = static_cast<std::uint8_t>(sheet.quads(x, y) & ~gone);
        }
      }
    }
    const float bound = trial % 2 == 0 ? 0.005F : 0.05F;
    const Simplified mesh = check_simplified(sheet, t.ids, t.picture.intrinsics, bound);
    before += mesh.result.full.faces;
    after += mesh.result.size.faces;
  }
  CHECK(10 * after < 7 * before);
}

TEST_CASE("simplify: a plane of the world becomes two triangles, with labels two for each rectangle or so") {
  Terrain t({60, 40});
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 60; ++x) t.picture.depth(x, y) = plane_depth(t.picture.intrinsics, x, y, {0.1, 0.8, 0.6}, 9.0);
  }
  CHECK(t.check(0.005F).result.size.faces == 2);
  CHECK(t.check(0.0F).result.size.faces < 10);  // planes but for the rounding of depth
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 60; ++x) t.ids(x, y) = (x < 23 ? 0U : 1U) + (y < 17 ? 0U : 2U);
  }
  CHECK(t.check(0.005F).result.size.faces <= 24);
}

TEST_CASE("simplify: a photograph put linearly on the faces of a road stays within the bound of where it was seen") {
  Terrain t({120, 90});
  for (int y = 0; y < 90; ++y) {  // from 3 m away to half a pixel below the horizon
    for (int x = 0; x < 120; ++x) t.picture.depth(x, y) = 300.0F / (0.5F + static_cast<float>(y));
  }
  const SheetLayer sheet = t.sheet();
  SerialExecutor serial;
  // Largest distance between a texel and the pixel that saw its place, over points of all faces.
  const auto largest_shift = [&](const Simplified& mesh) {
    double largest = 0;
    for (const Face& f : mesh.faces) {
      double u[3];
      double v[3];
      double z[3];
      for (int k = 0; k < 3; ++k) {
        const std::uint32_t corner = k == 0 ? f.a : (k == 1 ? f.b : f.c);
        u[k] = mesh.pixels[corner] % 120;
        v[k] = static_cast<double>(mesh.pixels[corner] / 120);
        z[k] = static_cast<double>(mesh.vertices[corner].z);
      }
      const double longest = std::max({std::hypot(u[1] - u[0], v[1] - v[0]), std::hypot(u[2] - u[1], v[2] - v[1]),
                                       std::hypot(u[0] - u[2], v[0] - v[2])});
      const double area = std::fabs((u[1] - u[0]) * (v[2] - v[0]) - (u[2] - u[0]) * (v[1] - v[0]));
      const bool step = area / longest <= 1.5 && std::max({z[0], z[1], z[2]}) > 1.25 * std::min({z[0], z[1], z[2]});
      if (step) continue;  // as the parameter says
      for (int i = 0; i <= 20; ++i) {
        for (int j = 0; i + j <= 20; ++j) {
          const double on_face[3] = {i / 20.0, j / 20.0, (20 - i - j) / 20.0};
          double sum = 0;
          double at[2] = {0, 0};
          double texel[2] = {0, 0};
          for (int k = 0; k < 3; ++k) {
            sum += on_face[k] * z[k];
            at[0] += on_face[k] * z[k] * u[k];  // the projection of the point
            at[1] += on_face[k] * z[k] * v[k];
            texel[0] += on_face[k] * u[k];
            texel[1] += on_face[k] * v[k];
          }
          largest = std::max(largest, std::hypot(texel[0] - at[0] / sum, texel[1] - at[1] / sum));
        }
      }
    }
    return largest;
  };
  SimplifyParams params;
  const Simplified any = simplify(sheet, {}, t.picture.intrinsics, params, serial);
  CHECK(any.faces.size() == 2);
  CHECK(largest_shift(any) > 20);
  for (const float bound : {0.25F, 1.0F, 4.0F}) {
    CAPTURE(bound);
    params.max_texture_shift = bound;
    const Simplified mesh = simplify(sheet, {}, t.picture.intrinsics, params, serial);
    CHECK(largest_shift(mesh) <= static_cast<double>(bound) * (1 + 1e-6));
    CHECK(mesh.faces.size() < mesh.result.full.faces / 4);
  }
  params.max_texture_shift = -1.0F;
  CHECK(validate(params).code() == StatusCode::invalid_argument);
}

TEST_CASE("simplify: a bound of nothing merges what is coplanar and nothing else") {
  Terrain t({40, 30});
  t.raise(5, 0.01F);
  CHECK(t.check(0.0F).result.size.faces == t.check(0.0F).result.full.faces);
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 20; ++x) t.picture.depth(x, y) = 8.0F;
  }
  const Simplified half = t.check(0.0F);
  CHECK(half.result.size.faces > half.result.full.faces / 2 - 40);
  CHECK(half.result.size.faces < half.result.full.faces / 2 + 90);
}

TEST_CASE("simplify: labels that change in every pixel change nothing") {
  Terrain t({20, 14});
  for (int y = 0; y < 14; ++y) {
    for (int x = 0; x < 20; ++x) t.ids(x, y) = static_cast<std::uint32_t>(y * 20 + x);
  }
  const Simplified each = t.check(1.0F);
  CHECK(each.result.size.faces == each.result.full.faces);
  for (int y = 0; y < 14; ++y) {
    for (int x = 0; x < 20; ++x) t.ids(x, y) = static_cast<std::uint32_t>((x + y) % 2);
  }
  // A checkerboard's diagonals have one label: at most its rim may change.
  t.check(1.0F);
}

TEST_CASE("simplify: 1 x N and N x 1 images have no faces, 2 x N images may lose some") {
  for (const Shape shape : {Shape{1, 1}, {1, 9}, {9, 1}}) {
    Terrain t(shape);
    CHECK(t.check(0.005F).faces.empty());
  }
  Terrain strip({2, 50});
  CHECK(strip.check(0.005F).faces.size() == 2);
}

TEST_CASE("simplify: depth with a ring of NaN, a hole, a comb, a pole one pixel wide, two objects that touch") {
  Terrain ring({40, 40});
  ring.raise(3, 0.001F);
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 40; ++x) {
      const int r = (x - 20) * (x - 20) + (y - 20) * (y - 20);
      if (r >= 100 && r <= 150) ring.picture.depth(x, y) = kNaN;
    }
  }
  CHECK(report(ring.check(0.01F).view()).components == 2);

  Terrain hole({30, 30});
  for (int y = 9; y < 21; ++y) {
    for (int x = 9; x < 21; ++x) hole.picture.surface(x, y) = 0;
  }
  const Simplified square = hole.check(0.005F);
  CHECK(square.result.size.faces <= 12);
  CHECK(report(square.view()).boundary_loops == 2);

  Terrain comb({41, 20});
  for (int y = 5; y < 20; ++y) {
    for (int x = 0; x < 41; ++x) comb.picture.surface(x, y) = x % 4 < 2 ? 1 : 0;
  }
  CHECK(comb.check(0.005F).result.size.faces < 100);

  // One pixel has no face of its own: as a label it is a line of edges that stays.
  Terrain pole({31, 40});
  for (int y = 3; y < 40; ++y) pole.ids(15, y) = 7;
  CHECK(pole.check(0.005F).result.size.faces < 30);

  Terrain touch({30, 20});
  for (int y = 4; y < 16; ++y) {
    for (int x = 4; x < 26; ++x) touch.ids(x, y) = x < 15 ? 1 : 2;
  }
  CHECK(touch.check(0.005F).result.size.faces < 60);
}

TEST_CASE("simplify: vertices at 1e5 m beside vertices at 1 m") {
  Terrain t({48, 32});
  t.picture.intrinsics = {1000.0F, 1000.0F, 24.0F, 16.0F};
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 48; ++x)
      t.picture.depth(x, y) = x < 24 ? 1.0F : 1.0e5F * (1.0F + 0.002F * static_cast<float>(y % 3));
  }
  const Simplified mesh = t.check(0.005F);
  CHECK(mesh.result.size.faces < 500);
  t.check(0.0005F);
}

TEST_CASE("simplify: the same bits for any executor, across tiles") {
  Terrain t({230, 210});
  t.raise(8, 0.003F);
  for (int y = 0; y < 210; ++y) {
    for (int x = 0; x < 230; ++x) t.ids(x, y) = x * x + 2 * y * y < 30000 ? 1 : 0;
  }
  const SheetLayer sheet = t.sheet();
  SerialExecutor serial;
  BackwardExecutor reverse;
  const Simplified a = simplify(sheet, t.ids.cview(), t.picture.intrinsics, {}, serial);
  const Simplified b = simplify(sheet, t.ids.cview(), t.picture.intrinsics, {}, reverse);
  CHECK(a.pixels == b.pixels);
  REQUIRE(a.faces.size() == b.faces.size());
  for (std::size_t i = 0; i < a.faces.size(); ++i) {
    REQUIRE((a.faces[i].a == b.faces[i].a && a.faces[i].b == b.faces[i].b && a.faces[i].c == b.faces[i].c));
  }
  CHECK(a.result.depth.max_relative == b.result.depth.max_relative);
  CHECK(report(a.view()).oriented_manifold());
  CHECK(a.result.size.faces * 4 < a.result.full.faces);
}

TEST_CASE("simplify: every batch decides as double does, at the very bound too") {
  const Shape shape{70, 50};
  std::vector<float> inverse(shape.pixels() + simd::kMaxLanes, 0.0F);
  RandomStream random(13, RandomPurpose::test, 0, 0, 0, 0);
  for (std::size_t i = 0; i < shape.pixels(); ++i) {
    inverse[i] = 0.05F + 0.001F * static_cast<float>(i % 70) + 0.0001F * random.uniform(-1.0F, 1.0F);
  }
  const mesh_detail::SheetPlanes sheet{ImageView<const float>(inverse.data(), shape), {}, {}};
  int close = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    mesh_detail::Corner c[3];
    for (auto& p : c) {
      p = sheet.corner(static_cast<int>(random.uniform(0.0F, 69.99F)), static_cast<int>(random.uniform(0.0F, 49.99F)));
    }
    if (mesh_detail::turn(c[0], c[1], c[2]) <= 0) continue;
    double largest = 0;
    REQUIRE(mesh_detail::at_centres(sheet, c[0], c[1], c[2], [&](double w, double thin) {
      largest = std::max(largest, std::fabs(w - thin) / thin);
      return true;
    }));
    for (const double bound : {0.002, largest, largest * (1.0 + 1e-9), largest * (1.0 - 1e-9)}) {
      const bool in_double = mesh_detail::at_centres(
          sheet, c[0], c[1], c[2], [&](double w, double thin) { return std::fabs(w - thin) <= bound * thin; });
      REQUIRE(mesh_detail::centres_are_close<simd::F32>(sheet, c[0], c[1], c[2], bound) == in_double);
      REQUIRE(mesh_detail::centres_are_close<simd::scalar::F32>(sheet, c[0], c[1], c[2], bound) == in_double);
      close += in_double ? 1 : 0;
    }
  }
  CHECK(close > 1000);
}

TEST_CASE("simplify: vertices away from their pixels stay, and what is around them") {
  Terrain t({24, 24});
  SheetLayer sheet = t.sheet();
  sheet.vertices(11, 12).x += 0.1F * sheet.vertices(11, 12).z / t.picture.intrinsics.fx;
  SerialExecutor serial;
  SimplifyParams params;
  params.max_pixel_error = 0.05F;
  const Simplified mesh = simplify(sheet, t.ids.cview(), t.picture.intrinsics, params, serial);
  for (int y = 11; y <= 13; ++y) {
    for (int x = 10; x <= 12; ++x) {
      CHECK(std::count(mesh.pixels.begin(), mesh.pixels.end(), static_cast<std::uint32_t>(y * 24 + x)) == 1);
    }
  }
  CHECK(mesh.result.pixel_error < 1e-4F);
  const Simplified loose = simplify(sheet, t.ids.cview(), t.picture.intrinsics, {}, serial);
  CHECK(loose.result.size.faces < mesh.result.size.faces);
  CHECK(static_cast<double>(loose.result.pixel_error) == doctest::Approx(0.1).epsilon(1e-3));
}

TEST_CASE("simplify: bad input is refused and nothing written") {
  Terrain t({6, 5});
  const SheetLayer sheet = t.sheet();
  SerialExecutor executor;
  std::vector<Vec3f> vertices(30, Vec3f{5, 5, 5});
  std::vector<Face> faces(40, Face{7, 7, 7});
  std::vector<std::uint32_t> pixels(30, 77);
  Scratch scratch(simplify_layer_workspace_bytes({}, sheet.vertices.shape()));
  Workspace none;
  SimplifyResult result;
  const MeshBuffers out{{vertices.data(), 30}, {faces.data(), 40}, {pixels.data(), 30}};
  const auto run = [&](const SimplifyParams& p, const MeshBuffers& buffers, const Intrinsics& k, Workspace& w) {
    return simplify_layer(p, sheet, t.ids.cview(), k, 0, buffers, result, w, executor).code();
  };
  const Intrinsics& k = t.picture.intrinsics;
  CHECK(run({-0.1F, 0.25F}, out, k, scratch.workspace()) == StatusCode::invalid_argument);
  CHECK(run({kNaN, 0.25F}, out, k, scratch.workspace()) == StatusCode::invalid_argument);
  CHECK(run({0.005F, 0.6F}, out, k, scratch.workspace()) == StatusCode::invalid_argument);
  CHECK(run({}, out, {0, 1, 0, 0}, scratch.workspace()) == StatusCode::invalid_argument);
  CHECK(run({}, out, k, none) == StatusCode::workspace_exhausted);
  CHECK(run({}, {{vertices.data(), 3}, {faces.data(), 40}, {}}, k, scratch.workspace()) ==
        StatusCode::capacity_exceeded);
  CHECK(result.size.vertices == 4);
  CHECK(result.size.faces == 2);
  CHECK(run({}, {{vertices.data(), 4}, {faces.data(), 1}, {}}, k, scratch.workspace()) ==
        StatusCode::capacity_exceeded);
  CHECK(run({}, {{vertices.data(), 4}, {faces.data(), 2}, {pixels.data(), 3}}, k, scratch.workspace()) ==
        StatusCode::capacity_exceeded);
  const Image<std::uint32_t> other({5, 5}, 0, kPadding, 0);
  CHECK(simplify_layer({}, sheet, other.cview(), k, 0, out, result, scratch.workspace(), executor).code() ==
        StatusCode::shape_mismatch);
  CHECK(vertices[0] == Vec3f{5, 5, 5});
  CHECK(faces[0].a == 7);
  CHECK(pixels[0] == 77);
  CHECK(run({}, {{vertices.data(), 4}, {faces.data(), 2}, {}}, k, scratch.workspace()) == StatusCode::ok);

  Image<float> depth({6, 5}, 0.0F, kPadding, 0.0F);
  const TriangleMeshView mesh{{vertices.data(), 4}, {faces.data(), 2}};
  CHECK(simplified_depth(mesh, {pixels.data(), 4}, depth.view()).code() == StatusCode::invalid_argument);
  CHECK(simplified_depth(mesh, {pixels.data(), 2}, depth.view()).code() == StatusCode::invalid_argument);
  CHECK(simplified_depth(mesh, {pixels.data(), 4}, {}).code() == StatusCode::invalid_argument);
}
