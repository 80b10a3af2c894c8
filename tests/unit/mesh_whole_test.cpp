// SPDX-License-Identifier: Apache-2.0
// Every mesh that the kernels make is whole, whatever the masks: 10,000 random pictures of 1 to 40 pixels a side.
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "mesh_fixture.hpp"
#include "npsim/mesh/check_layer.hpp"

using namespace mesh_test;

namespace {

constexpr std::uint32_t kTrials = 10000;

enum MaskKind : std::uint32_t {
  mask_empty,
  mask_full,
  mask_noise,
  mask_rectangle,
  mask_border,     // a frame along the image border, or a rectangle that leaves the image
  mask_corners,    // squares that touch at their corners only
  mask_ring,       // rings, one pixel thick or more
  mask_comb,       // teeth on a bar
  mask_dots,       // single pixels
  mask_rows,       // whole rows: no anchor to either side
  mask_columns,    // poles
  mask_diagonals,  // one pixel wide, touching at corners
  mask_blobs,      // a few discs
  kMaskKinds
};

std::vector<std::uint8_t> make_mask(Shape shape, MaskKind kind, RandomStream& random) {
  std::vector<std::uint8_t> mask(shape.pixels(), kind == mask_full ? 1 : 0);
  const auto below = [&random](int n) { return static_cast<int>(random.next_u32() % static_cast<std::uint32_t>(n)); };
  const auto paint = [&](const auto& inside) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (inside(x, y)) mask[static_cast<std::size_t>(y * shape.width + x)] = 1;
      }
    }
  };
  const int w = shape.width;
  const int h = shape.height;
  const int x0 = below(w);
  const int y0 = below(h);
  const int step = 2 + below(5);
  const int phase = below(step);
  switch (kind) {
    case mask_noise: {
      const float density = random.uniform();
      paint([&](int, int) { return random.uniform() < density; });
      break;
    }
    case mask_rectangle: {
      const int x1 = x0 + below(w);
      const int y1 = y0 + below(h);
      paint([&](int x, int y) { return x >= x0 && x <= x1 && y >= y0 && y <= y1; });
      break;
    }
    case mask_border:
      paint([&](int x, int y) { return x < phase || y < phase || x >= w - step / 2 || y >= h - step / 3; });
      break;
    case mask_corners: paint([&](int x, int y) { return ((x + phase) / step + y / step) % 2 == 0; }); break;
    case mask_ring: {
      const int inner = below(10);
      const int outer = inner + 1 + below(4);
      paint([&](int x, int y) {
        const int r = std::max(std::abs(x - x0), std::abs(y - y0));
        return r >= inner && r < outer;
      });
      break;
    }
    case mask_comb: paint([&](int x, int y) { return y == y0 || (y > y0 && (x + phase) % step == 0); }); break;
    case mask_dots: paint([&](int x, int y) { return (x + phase) % step == 0 && y % step == 0; }); break;
    case mask_rows: paint([&](int, int y) { return (y + phase) % step < step / 2; }); break;
    case mask_columns: paint([&](int x, int) { return (x + phase) % step < step / 2; }); break;
    case mask_diagonals: paint([&](int x, int y) { return (x + (y0 % 2 == 0 ? y : h - y)) % step == phase; }); break;
    case mask_blobs:
      for (int n = 1 + below(4); n > 0; --n) {
        const int cx = below(w);
        const int cy = below(h);
        const int r = 1 + below(8);
        paint([&](int x, int y) { return (x - cx) * (x - cx) + (y - cy) * (y - cy) <= r * r; });
      }
      break;
    default: break;
  }
  return mask;
}

MaskKind any_kind(RandomStream& random) { return static_cast<MaskKind>(random.next_u32() % kMaskKinds); }

void paint_labels(Picture& p, RandomStream& random) {
  constexpr Label kForeground[] = {label::car, label::person, label::pole, label::bus, label::traffic_sign};
  const bool of_every_pixel = random.next_u32() % 8 == 0;  // labels that change in every pixel
  for (int layers = 1 + static_cast<int>(random.next_u32() % 3); layers > 0; --layers) {
    const std::vector<std::uint8_t> mask = make_mask(p.shape, any_kind(random), random);
    const Label one = kForeground[random.next_u32() % 5];
    for (int y = 0; y < p.shape.height; ++y) {
      for (int x = 0; x < p.shape.width; ++x) {
        if (mask[static_cast<std::size_t>(y * p.shape.width + x)] == 0) continue;
        p.labels(x, y) = of_every_pixel ? kForeground[random.next_u32() % 5] : one;
        p.instances(x, y) = static_cast<std::uint16_t>(random.next_u32() % (layers == 1 ? 3 : 1));
      }
    }
  }
  const std::vector<std::uint8_t> sky =
      make_mask(p.shape, random.next_u32() % 2 == 0 ? mask_empty : any_kind(random), random);
  const std::vector<std::uint8_t> doubt = make_mask(p.shape, any_kind(random), random);
  for (int y = 0; y < p.shape.height; ++y) {
    for (int x = 0; x < p.shape.width; ++x) {
      const auto i = static_cast<std::size_t>(y * p.shape.width + x);
      if (sky[i] != 0) p.labels(x, y) = label::sky;
      p.surface(x, y) = kNoSurfaceLabels.contains(p.labels(x, y)) ? 0 : 1;
      p.uncertain(x, y) = doubt[i];
    }
  }
}

void paint_depth(Picture& p, RandomStream& random) {
  const std::uint32_t kind = random.next_u32() % 5;
  const std::vector<std::uint8_t> step = make_mask(p.shape, any_kind(random), random);
  const std::vector<std::uint8_t> none =
      make_mask(p.shape, random.next_u32() % 3 == 0 ? any_kind(random) : mask_empty, random);
  const float far = random.next_u32() % 8 == 0 ? 1.0e5F : 80.0F;
  const float tilt = random.uniform(0.0F, 0.5F);
  for (int y = 0; y < p.shape.height; ++y) {
    for (int x = 0; x < p.shape.width; ++x) {
      const auto i = static_cast<std::size_t>(y * p.shape.width + x);
      float z = 12.0F;
      if (kind == 1) z = 5.0F + tilt * static_cast<float>(x + y);
      if (kind == 2) z = step[i] != 0 ? 4.0F : far;
      if (kind == 3) z = std::exp(random.uniform(0.0F, std::log(far)));
      if (kind == 4) z = (step[i] != 0 ? 4.0F : far) * random.uniform(0.9F, 1.1F);
      p.depth(x, y) = none[i] == 0 ? z : (x % 3 == 0 ? kNaN : (x % 3 == 1 ? 0.0F : -1.0F));
    }
  }
}

// Why a mesh is not what every mesh has to be; empty if it is.
std::string fault(const Indexed& mesh) {
  const MeshReport r = report(mesh.view());
  std::string why;
  const auto expect_none = [&why](std::size_t n, const char* what) {
    if (n != 0) why += std::to_string(n) + " " + what + "; ";
  };
  expect_none(r.out_of_range_faces, "faces out of range");
  expect_none(r.repeated_index_faces, "faces with a repeated index");
  expect_none(r.not_finite_vertices, "vertices not finite");
  expect_none(r.flat_faces, "flat faces");
  expect_none(r.duplicate_faces, "duplicate faces");
  expect_none(r.nonmanifold_edges, "non-manifold edges");
  expect_none(r.inconsistent_edges, "edges between faces of opposite orientation");
  expect_none(r.pinched_vertices, "pinched vertices");
  expect_none(r.isolated_vertices, "vertices without a face");
  std::size_t backs = 0;
  for (const Face& f : mesh.faces) {
    const Vec3d a = vec_cast<double>(mesh.vertices[f.a]);
    const Vec3d normal = cross(vec_cast<double>(mesh.vertices[f.b]) - a, vec_cast<double>(mesh.vertices[f.c]) - a);
    backs += dot(normal, a) < 0.0 ? 0U : 1U;
  }
  expect_none(backs, "faces that turn their back to the camera");
  return why;
}

std::string fault(const LayerReport& r) {
  if (r.whole()) return {};
  return std::to_string(r.uncovered_pixels) + " pixels uncovered, " + std::to_string(r.missing_faces) +
         " faces missing, " + std::to_string(r.stray_faces) + " stray";
}

}  // namespace

TEST_CASE("10,000 random masks: no hole inside a sheet, no fault in any mesh") {
  std::size_t faces = 0;
  std::size_t objects = 0;
  std::size_t splits = 0;  // vertices that exist more than once, because fans of faces meet in them
  for (std::uint32_t trial = 0; trial < kTrials; ++trial) {
    CAPTURE(trial);
    RandomStream random(11, RandomPurpose::test, trial, 0, 0, 0);
    // One in eight is a single row or column.
    const auto side = [&random] {
      return random.next_u32() % 16 == 0 ? 1 : 1 + static_cast<int>(random.next_u32() % 40);
    };
    const int width = side();
    Picture p({width, side()});
    CAPTURE(p.shape.width);
    CAPTURE(p.shape.height);
    paint_labels(p, random);
    paint_depth(p, random);
    const bool thesis = trial % 4 == 3;
    if (thesis) {
      p.run(BackgroundParams::thesis(), ForegroundParams::thesis());
    } else {
      p.run();
    }

    const Indexed sheet = index(p.sheet.view());
    const Indexed background = index(p.background.view());
    const Indexed foreground = index(p.foreground.view());
    CHECK(fault(sheet) == "");
    CHECK(fault(background) == "");
    CHECK(fault(foreground) == "");
    LayerReport layer;
    REQUIRE(check_background(p.background.view(), p.state.cview(), layer).ok());
    CHECK(fault(layer) == "");
    std::vector<unsigned char> bytes(check_foreground_workspace_bytes(p.shape));
    Workspace workspace(bytes.data(), bytes.size());
    REQUIRE(check_foreground(p.foreground.view(), p.object.cview(), workspace, layer).ok());
    CHECK(fault(layer) == "");

    faces += sheet.faces.size() + background.faces.size() + foreground.faces.size();
    for (std::size_t i = 1; i < foreground.pixels.size(); ++i) {
      splits += foreground.pixels[i] == foreground.pixels[i - 1] ? 1U : 0U;
      objects += foreground.pixels[i] == foreground.pixels[i - 1] ? 0U : 1U;
    }
  }
  // The masks are worth the name: there were faces, objects and pinches to get wrong.
  CHECK(faces > 5000000);
  CHECK(objects > 500000);
  CHECK(splits > 10000);
}
