// SPDX-License-Identifier: Apache-2.0
// What a sheet's tiles say of their vertices and faces, against double precision and a scan of all faces.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <vector>

#include "npsim/core/random.hpp"
#include "npsim/simd/detail/scalar.hpp"
#include "npsim/trace/detail/sheet/ray.hpp"
#include "npsim/trace/detail/sheet/walk.hpp"
#include "reference/sheet_rays.hpp"

namespace {

using npsim::Face;
using npsim::RandomPurpose;
using npsim::RandomStream;
using npsim::Ray;
using npsim::Shape;
using npsim::SheetRelief;
using npsim::SheetTiles;
using npsim::SheetTrace;
using npsim::Vec3f;
using npsim::reference::TracedSheet;

RandomStream stream(std::uint32_t i) { return {17, RandomPurpose::test, 0, 0, i, 0}; }

enum Kind { kRough, kSteps, kHugeSteps, kAnyDepth, kFlat, kNearlyFlat, kHoles, kAlmostNothing, kKinds };

float depth_of(int kind, int x, int y) {
  RandomStream r = stream(static_cast<std::uint32_t>(x + 1000 * y + 1000000 * kind));
  switch (kind) {
    case kSteps: return 1.0F + ((x / 3 + y / 5) % 2 == 0 ? 40.0F : 0.0F) + r.uniform(0.0F, 0.01F);
    case kHugeSteps: return (r.next_u32() & 1U) == 0 ? 0.1F : 1e5F * r.uniform();  // the limit of detail/sheet/ray.hpp
    case kAnyDepth: return std::exp2(r.uniform(-13.3F, 16.6F));
    case kFlat: return 4.0F;
    case kNearlyFlat: return (r.next_u32() & 1U) != 0 ? 4.0F : std::nextafter(4.0F, 5.0F);
    default: return (20.0F + 0.3F * static_cast<float>(x) - 0.2F * static_cast<float>(y)) * r.uniform(0.95F, 1.05F);
  }
}

TracedSheet make_sheet(int kind, Shape shape) {
  TracedSheet sheet(shape);
  sheet.fill([kind](int x, int y) { return depth_of(kind, x, y); });
  sheet.connect(kind != kHoles);
  for (std::size_t i = 0; i < sheet.vertices.size(); ++i) {
    const bool gone = (kind == kHoles && i % 9 == 0) || (kind == kAlmostNothing && i % 50 != 0 && i % 50 != 1);
    if (gone) sheet.vertices[i] = {};
  }
  if (kind == kAlmostNothing) {  // a few single faces
    for (std::size_t i = 0; i < sheet.vertices.size(); ++i) {
      if (i % 7 < 4)
        sheet.vertices[i] =
            npsim::unproject_pixel(sheet.k, static_cast<int>(i) % shape.width, static_cast<int>(i) / shape.width, 5.0F);
    }
  }
  REQUIRE(sheet.build().ok());
  return sheet;
}

const SheetRelief& relief_at(const SheetTrace& sheet, int x, int y) {
  const auto group = static_cast<std::size_t>(y / 16 * sheet.across[0] + x / 16);
  return sheet.relief[16 * group + static_cast<std::size_t>(4 * (y / 4 % 4) + x / 4 % 4)];
}

bool has_face(const TracedSheet& sheet, int x, int y, bool upper, Face& corners) {
  const unsigned quad = sheet.trace.quads(x, y);
  const auto a = static_cast<std::uint32_t>(y * sheet.shape.width + x);
  const auto width = static_cast<std::uint32_t>(sheet.shape.width);
  corners = npsim::quad_face((quad & npsim::kQuadAntiDiagonal) != 0, upper, a, a + 1, a + width, a + width + 1);
  return (quad & (upper ? npsim::kQuadUpperFace : npsim::kQuadLowerFace)) != 0 && sheet.vertices[corners.a].z > 0 &&
         sheet.vertices[corners.b].z > 0 && sheet.vertices[corners.c].z > 0;
}

// Of a tile's vertices.
double greatest_w(const TracedSheet& sheet, int tx, int ty) {
  double w = 0;
  for (int y = ty; y < std::min(ty + 5, sheet.shape.height); ++y) {
    for (int x = tx; x < std::min(tx + 5, sheet.shape.width); ++x) {
      const float z = sheet.vertices[static_cast<std::size_t>(y * sheet.shape.width + x)].z;
      if (z > 0) w = std::max(w, 1.0 / static_cast<double>(z));
    }
  }
  return w;
}

}  // namespace

TEST_CASE("sheet relief: faces are those of quads and vertices, and vertices lie where their tile says") {
  for (int kind = 0; kind < kKinds; ++kind) {
    for (const Shape shape : {Shape{70, 41}, Shape{2, 2}, Shape{300, 18}, Shape{18, 7}}) {
      const TracedSheet sheet = make_sheet(kind, shape);
      double greatest = 0;
      std::vector<std::uint8_t> used(sheet.trace.relief.size() * 25);
      std::size_t bad_faces = 0;
      std::size_t bad_vertices = 0;
      for (int y = 0; y + 1 < shape.height; ++y) {
        for (int x = 0; x + 1 < shape.width; ++x) {
          const SheetRelief& relief = relief_at(sheet.trace, x, y);
          const auto tile = static_cast<std::size_t>(&relief - sheet.trace.relief.data());
          const SheetTiles& tiles = sheet.trace.tiles[tile / 16];
          const std::size_t k = tile % 16;
          for (const bool upper : {true, false}) {
            Face f;
            const bool there = has_face(sheet, x, y, upper, f);
            const auto bit = static_cast<unsigned>(4 * (y % 4) + x % 4 + (upper ? 0 : 16));
            bad_faces += there != ((relief.faces >> bit & 1U) != 0) ? 1U : 0U;
            if (!there) continue;
            for (const std::uint32_t v : {f.a, f.b, f.c}) {
              const int i = static_cast<int>(v) % shape.width - x + x % 4;
              const int j = static_cast<int>(v) / shape.width - y + y % 4;
              used[25 * tile + static_cast<std::size_t>(5 * j + i)] = 1;
              const double w = 1.0 / static_cast<double>(sheet.vertices[v].z);
              const double gx = static_cast<double>(tiles.gx[k]);
              const double gy = static_cast<double>(tiles.gy[k]);
              const double half = static_cast<double>(tiles.half[k]);
              const double rest = w - static_cast<double>(tiles.base[k]) - gx * i - gy * j;
              const double step = half * static_cast<double>(npsim::kSheetReliefStep);
              const int q = i < 4 ? relief.left[4 * j + i] : relief.right[4 * j + i - 1];
              if (i > 0 && i < 4) bad_vertices += relief.right[4 * j + i - 1] != q ? 1U : 0U;
              const double slack =
                  0x1p-20 * (greatest_w(sheet, x - x % 4, y - y % 4) + 4 * std::fabs(gx) + 4 * std::fabs(gy));
              const double off = std::fabs(rest + half - q * step);
              bad_vertices += std::fabs(rest) > half + slack ? 1U : 0U;
              bad_vertices += off > static_cast<double>(npsim::kSheetReliefError) * step + slack ? 1U : 0U;
              greatest = std::max(greatest, (off - slack) / step);
            }
          }
        }
      }
      CAPTURE(kind);
      CAPTURE(shape.width);
      CHECK(bad_faces == 0);
      CHECK(bad_vertices == 0);
      if ((kind == kRough || kind == kAnyDepth) && shape.width > 20) CHECK(greatest > 0.49);  // half a step does occur
      std::size_t unused = 0;
      for (std::size_t tile = 0; tile < sheet.trace.relief.size(); ++tile) {
        const SheetRelief& relief = sheet.trace.relief[tile];
        for (std::size_t v = 0; v < 25; ++v) {
          const std::size_t i = v % 5;
          if (used[25 * tile + v] == 0)
            unused += (i < 4 ? relief.left[4 * (v / 5) + i] : relief.right[4 * (v / 5) + 3]);
        }
        unused += relief.unused;
      }
      CHECK(unused == 0);
    }
  }
}

namespace {

// Rays through vertices, along and across edges and through faces, from everywhere.
Ray ray_at(const TracedSheet& sheet, std::uint32_t i) {
  RandomStream r = stream(5000000 + i);
  const auto any = [&] { return r.next_u32() % static_cast<std::uint32_t>(sheet.vertices.size()); };
  const std::uint32_t at = any();
  const Vec3f v = sheet.vertices[at];
  const Vec3f w =
      sheet.vertices[(at + 1 + (i & 1U) * static_cast<std::uint32_t>(sheet.shape.width)) % sheet.vertices.size()];
  const Vec3f to = i % 3 == 0 ? v : v + (w - v) * r.uniform();
  const Vec3f beside =
      to + Vec3f{r.uniform(-1.0F, 1.0F), r.uniform(-1.0F, 1.0F), r.uniform(-0.2F, 0.2F)} * (0.5F * to.z);
  Ray ray{beside, to - beside};
  if (i % 4 == 1) ray = {sheet.vertices[any()] * r.uniform(0.5F, 1.0F), {}};
  if (i % 4 == 2) ray = {{0, 0, 0}, to};
  if (i % 4 != 2) ray.direction = to - ray.origin;
  return ray;
}

template <class F>
std::size_t lost_quads(const TracedSheet& sheet, std::uint32_t rays, std::size_t& hits) {
  using namespace npsim::sheet_detail;
  const SheetTrace& s = sheet.trace;
  std::size_t lost = 0;
  for (std::uint32_t i = 0; i < rays; ++i) {
    npsim::SheetRay ray;
    if (!make_sheet_ray(s.bounds, ray_at(sheet, i), ray) || ray.everything) continue;
    for (int ty = 0; ty < s.quads.height(); ty += 4) {
      for (int tx = 0; tx < s.quads.width(); tx += 4) {
        const SheetRelief& relief = relief_at(s, tx, ty);
        const auto tile = static_cast<std::size_t>(&relief - s.relief.data());
        const auto k = static_cast<unsigned>(tile % 16);
        std::uint32_t hit = 0;
        for (unsigned q = 0; q < 32; ++q) {
          if ((relief.faces >> q & 1U) == 0) continue;
          const int x = tx + static_cast<int>(q % 4);
          const int y = ty + static_cast<int>(q / 4 % 4);
          Face f;
          static_cast<void>(has_face(sheet, x, y, q < 16, f));
          float corner[3][3];
          const std::uint32_t numbers[3] = {f.a, f.b, f.c};
          for (int c = 0; c < 3; ++c) {
            const Vec3f& p = sheet.vertices[numbers[c]];
            corner[c][0] = p.x;
            corner[c][1] = p.y;
            corner[c][2] = p.z;
          }
          npsim::TriangleHit h;
          if (npsim::intersect_triangle(ray.frame, corner, h) && h.t < ray.frame.t_max) hit |= 1U << (q % 16);
        }
        if (hit == 0) continue;
        ++hits;
        const std::uint32_t found =
            test_quads<F>(s.tiles[tile / 16], k, relief, ray, static_cast<float>(tx), static_cast<float>(ty));
        const std::uint32_t tiles =
            test_tiles<F>(s.tiles[tile / 16], ray, static_cast<float>(tx / 16 * 16), static_cast<float>(ty / 16 * 16));
        lost += (hit & ~found) != 0 || (tiles >> k & 1U) == 0 ? 1U : 0U;
      }
    }
  }
  return lost;
}

}  // namespace

TEST_CASE("sheet relief: the tests of tiles and quads leave out nothing that is hit") {
  for (int kind = 0; kind < kKinds; ++kind) {
    const TracedSheet sheet = make_sheet(kind, {38, 27});
    std::size_t hits = 0;
    CAPTURE(kind);
    CHECK(lost_quads<npsim::simd::F32>(sheet, 3000, hits) == 0);
    CHECK(lost_quads<npsim::simd::scalar::F32>(sheet, 500, hits) == 0);
    CHECK(hits > 300);
  }
}

namespace {

template <class T>
bool same_bytes(npsim::Span<const T> a, npsim::Span<const T> b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

bool same_structure(const SheetTrace& a, const SheetTrace& b) {
  return a.levels == b.levels && same_bytes(a.tiles, b.tiles) && same_bytes(a.relief, b.relief) &&
         same_bytes(a.nodes, b.nodes) && std::memcmp(a.bounds.low, b.bounds.low, sizeof a.bounds.low) == 0 &&
         std::memcmp(a.bounds.high, b.bounds.high, sizeof a.bounds.high) == 0 && a.bounds.pad_px == b.bounds.pad_px &&
         a.bounds.max_inverse_depth == b.bounds.max_inverse_depth && a.bounds.focal_reach == b.bounds.focal_reach;
}

}  // namespace

TEST_CASE("trace sheet: any number of lanes and any executor build the same bytes, signs of zero included") {
  TracedSheet sheet(Shape{90, 40});
  sheet.fill([](int x, int y) {
    RandomStream r = stream(static_cast<std::uint32_t>(x + 300 * y));
    return (x / 5 + y / 7) % 3 == 0 ? r.uniform(3.0F, 3.2F) : r.uniform(9.0F, 30.0F);
  });
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 90; ++x) {
      if ((x + y) % 4 == 0) sheet.at(x, y).x = (x + y) % 8 == 0 ? 0.0F : -0.0F;  // off the grid, within reason
    }
  }
  sheet.connect(false);
  REQUIRE(sheet.build().ok());
  const std::size_t bytes = npsim::sheet_workspace_bytes(sheet.shape);
  npsim_test::Scratch one_lane(bytes);
  npsim_test::Scratch backwards(bytes);
  SheetTrace other;
  npsim::SerialExecutor serial;
  REQUIRE(
      npsim::build_sheet_trace<npsim::simd::scalar::F32>(sheet.layer(), sheet.k, one_lane.workspace(), other, serial)
          .ok());
  CHECK(same_structure(sheet.trace, other));
  npsim_test::BackwardExecutor backward;
  REQUIRE(npsim::build_sheet_trace(sheet.layer(), sheet.k, backwards.workspace(), other, backward).ok());
  CHECK(same_structure(sheet.trace, other));
}
