// SPDX-License-Identifier: Apache-2.0
// The ray structure of a sheet brought up to date in a region, and stored, damaged and attached again.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/simd/detail/scalar.hpp"
#include "npsim/trace/detail/sheet/build.hpp"
#include "npsim/trace/detail/sheet/store.hpp"
#include "npsim/trace/detail/sheet/traverse.hpp"
#include "reference/sheet_rays.hpp"
#include "trace_tree.hpp"

namespace {

using npsim::Hit;
using npsim::RandomPurpose;
using npsim::RandomStream;
using npsim::Ray;
using npsim::Shape;
using npsim::SheetTrace;
using npsim::StatusCode;
using npsim::Vec3f;
using npsim::reference::TracedSheet;
using Bytes = npsim::Span<const unsigned char>;

RandomStream stream(std::uint32_t i) { return {9, RandomPurpose::test, 0, 0, i, 0}; }

float depth_at(int x, int y, std::uint32_t seed) {
  RandomStream r = stream(seed * 100000U + static_cast<std::uint32_t>(x + 300 * y));
  return (x / 5 + y / 7) % 3 == 0 ? r.uniform(3.0F, 3.2F) : r.uniform(9.0F, 30.0F);
}

TracedSheet some_sheet(Shape shape) {
  TracedSheet sheet(shape);
  sheet.fill([](int x, int y) { return depth_at(x, y, 1); });
  sheet.connect(false);
  for (std::size_t i = 0; i < sheet.vertices.size(); i += 13) sheet.vertices[i] = {};
  REQUIRE(sheet.build().ok());
  return sheet;
}

bool same_block(const SheetTrace& a, const SheetTrace& b) {
  return a.block.size() == b.block.size() && std::memcmp(a.block.data(), b.block.data(), a.block.size()) == 0;
}

bool same_bounds(const npsim::SheetBounds& a, const npsim::SheetBounds& b) {
  return std::memcmp(a.x, b.x, sizeof a.x) == 0 && std::memcmp(a.y, b.y, sizeof a.y) == 0 &&
         std::memcmp(a.z, b.z, sizeof a.z) == 0 && std::memcmp(a.d, b.d, sizeof a.d) == 0 &&
         std::memcmp(a.low, b.low, sizeof a.low) == 0 && std::memcmp(a.high, b.high, sizeof a.high) == 0 &&
         a.max_inverse_depth == b.max_inverse_depth && a.pad_px == b.pad_px && a.focal_reach == b.focal_reach;
}

// A copy of a structure's bytes at an address of whole 64, or `shift` bytes past one.
struct Stored {
  explicit Stored(Bytes from, std::size_t shift = 0) : block(from.size(), shift), size(from.size()) {
    data = block.bytes.data();
    std::copy(from.begin(), from.end(), data);
  }
  [[nodiscard]] Bytes bytes() const { return {data, size}; }
  npsim::testing::Block block;
  std::size_t size;
  unsigned char* data = nullptr;
};

}  // namespace

TEST_CASE("trace sheet: after a refit of a region the structure is that of building anew, bit for bit") {
  npsim::SerialExecutor executor;
  for (const Shape shape : {Shape{140, 90}, Shape{17, 33}, Shape{2, 2}, Shape{300, 5}}) {
    TracedSheet sheet = some_sheet(shape);
    TracedSheet fresh(shape);
    for (std::uint32_t i = 0; i < 60; ++i) {
      RandomStream r = stream(i);
      const auto pick = [&r](int n) { return static_cast<int>(r.next_u32() % static_cast<std::uint32_t>(n)); };
      npsim::SheetRegion region;
      region.x = pick(shape.width);
      region.y = pick(shape.height);
      region.shape = {1 + pick(shape.width - region.x), 1 + pick(shape.height - region.y)};
      if (i % 3 == 0) region.shape = {1, 1};
      if (i == 30) region = {0, 0, shape};
      for (int y = region.y; y < region.y + region.shape.height; ++y) {
        for (int x = region.x; x < region.x + region.shape.width; ++x) {
          const bool gone = i == 30 || (x + y) % 11 == 0;  // once nothing is left at all
          sheet.at(x, y) =
              gone ? Vec3f{}
                   : npsim::unproject_pixel(sheet.k, x, y, depth_at(x, y, i + 2) / (1.0F + static_cast<float>(i % 4)));
          for (const int qx : {x - 1, x}) {
            for (const int qy : {y - 1, y}) {
              if (qx < 0 || qy < 0 || qx >= shape.width - 1 || qy >= shape.height - 1) continue;
              sheet.quads[static_cast<std::size_t>(qy * (shape.width - 1) + qx)] =
                  static_cast<std::uint8_t>(r.next_u32() % 8U);
            }
          }
        }
      }
      REQUIRE(npsim::refit_sheet_trace(region, sheet.trace, executor).ok());
      fresh.vertices = sheet.vertices;
      fresh.quads = sheet.quads;
      REQUIRE(fresh.build().ok());
      CAPTURE(i);
      CAPTURE(shape.width);
      REQUIRE(same_block(sheet.trace, fresh.trace));
      REQUIRE(sheet.trace.levels == fresh.trace.levels);
      REQUIRE(same_bounds(sheet.trace.bounds, fresh.trace.bounds));
    }
  }
}

TEST_CASE("trace sheet: a change beside the region of a refit is not seen, one within it is") {
  npsim::SerialExecutor executor;
  TracedSheet sheet = some_sheet({140, 90});
  TracedSheet fresh = sheet;
  REQUIRE(fresh.build().ok());
  sheet.at(70, 40) = npsim::unproject_pixel(sheet.k, 70, 40, 1.5F);
  REQUIRE(npsim::refit_sheet_trace({0, 0, {16, 16}}, sheet.trace, executor).ok());
  CHECK(same_block(sheet.trace, fresh.trace));  // the old state, outside of the region
  REQUIRE(npsim::refit_sheet_trace({70, 40, {1, 1}}, sheet.trace, executor).ok());
  CHECK_FALSE(same_block(sheet.trace, fresh.trace));
}

TEST_CASE("trace sheet: a region outside of the layer is refused, an empty one changes nothing") {
  npsim::SerialExecutor executor;
  TracedSheet sheet = some_sheet({40, 30});
  const std::vector<unsigned char> before = sheet.bytes;
  for (const npsim::SheetRegion& bad :
       {npsim::SheetRegion{-1, 0, {5, 5}}, npsim::SheetRegion{0, -1, {5, 5}}, npsim::SheetRegion{36, 0, {5, 5}},
        npsim::SheetRegion{0, 26, {5, 5}}, npsim::SheetRegion{2147483647, 0, {2147483647, 1}},
        npsim::SheetRegion{0, 0, {-1, 5}}}) {
    CHECK(npsim::refit_sheet_trace(bad, sheet.trace, executor).code() == StatusCode::invalid_argument);
  }
  CHECK(npsim::refit_sheet_trace({3, 3, {0, 5}}, sheet.trace, executor).ok());
  CHECK(sheet.bytes == before);
  // Vertices that are nowhere near their pixels' rays: nothing is hit afterwards, until they are back.
  const Vec3f good = sheet.at(5, 5);
  const Ray ahead{{0, 0, 0}, sheet.at(20, 16) + Vec3f{0.01F, 0.02F, 0}};
  Hit hit;
  const bool hit_before = npsim::closest_hit(sheet.trace, ahead, hit);
  sheet.at(5, 5) = {1e15F, 0, 1e-9F};
  CHECK(npsim::refit_sheet_trace({5, 5, {1, 1}}, sheet.trace, executor).code() == StatusCode::invalid_argument);
  CHECK_FALSE(npsim::closest_hit(sheet.trace, ahead, hit));
  sheet.at(5, 5) = good;
  CHECK(npsim::refit_sheet_trace({0, 0, {40, 30}}, sheet.trace, executor).ok());
  CHECK(npsim::closest_hit(sheet.trace, ahead, hit) == hit_before);
  CHECK(sheet.bytes == before);
}

TEST_CASE("trace sheet: any number of lanes builds the same bytes, signs of zero included") {
  TracedSheet sheet(Shape{90, 40});
  sheet.fill([](int x, int y) { return depth_at(x, y, 1); });
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 90; ++x) {
      if ((x + y) % 4 == 0) sheet.at(x, y).x = (x + y) % 8 == 0 ? 0.0F : -0.0F;  // off the grid, within reason
    }
  }
  sheet.connect(false);
  REQUIRE(sheet.build().ok());
  const std::vector<unsigned char> many(sheet.trace.block.begin(), sheet.trace.block.end());
  REQUIRE(sheet.build<npsim::simd::scalar::F32>().ok());
  CHECK(std::memcmp(many.data(), sheet.trace.block.data(), many.size()) == 0);
}

TEST_CASE("trace sheet: a structure that was stored gives the same hits at another address") {
  for (const Shape shape : {Shape{140, 90}, Shape{2, 2}, Shape{70, 3}}) {
    TracedSheet sheet = some_sheet(shape);
    const Stored stored(sheet.trace.block);
    SheetTrace attached;
    REQUIRE(npsim::attach_sheet_trace(sheet.layer(), sheet.k, stored.bytes(), attached).ok());
    CHECK(npsim::attach_sheet_trace<npsim::simd::scalar::F32>(sheet.layer(), sheet.k, stored.bytes(), attached).ok());
    CHECK(attached.levels == sheet.trace.levels);
    CHECK(same_bounds(attached.bounds, sheet.trace.bounds));
    for (std::uint32_t i = 0; i < 3000; ++i) {
      RandomStream r = stream(i);
      const Vec3f to = sheet.vertices[r.next_u32() % sheet.vertices.size()];
      const Ray ray{{r.uniform(-1.0F, 1.0F), r.uniform(-1.0F, 1.0F), 0}, to + Vec3f{0.01F, 0.02F, 0}};
      Hit a;
      Hit b;
      REQUIRE(npsim::closest_hit(attached, ray, a) == npsim::closest_hit(sheet.trace, ray, b));
      CHECK(std::memcmp(&a, &b, sizeof a) == 0);
    }
    npsim::SerialExecutor executor;
    CHECK(npsim::refit_sheet_trace({0, 0, {1, 1}}, attached, executor).code() == StatusCode::invalid_argument);
  }
}

TEST_CASE("trace sheet: a stored structure with any bit changed is refused, and never crashes") {
  for (const Shape shape : {Shape{23, 19}, Shape{2, 2}, Shape{70, 40}}) {
    TracedSheet sheet = some_sheet(shape);
    Stored stored(sheet.trace.block);
    SheetTrace attached;
    const std::size_t step = shape.width == 70 ? 7 : 1;
    for (std::size_t i = 0; i < stored.size; i += step) {
      for (const unsigned change : {1U, 0x80U, 0xFFU}) {
        stored.data[i] = static_cast<unsigned char>(stored.data[i] ^ change);
        const npsim::Status status = npsim::attach_sheet_trace(sheet.layer(), sheet.k, stored.bytes(), attached);
        CAPTURE(i);
        REQUIRE_FALSE(status.ok());
        REQUIRE(attached.levels == 0);
        REQUIRE(std::string(status.message()).size() > 10);
        stored.data[i] = static_cast<unsigned char>(stored.data[i] ^ change);
      }
    }
    CHECK(npsim::attach_sheet_trace(sheet.layer(), sheet.k, stored.bytes(), attached).ok());
  }
}

TEST_CASE("trace sheet: a stored structure cut short, moved, of another layer or camera, or noise is refused") {
  TracedSheet sheet = some_sheet({40, 30});
  const Stored stored(sheet.trace.block);
  SheetTrace attached;
  const auto attach = [&](Bytes bytes) {
    return npsim::attach_sheet_trace(sheet.layer(), sheet.k, bytes, attached).code();
  };
  for (std::size_t size = 0; size < stored.size; size += size < 200 ? 1 : 97) {
    CHECK(attach({stored.data, size}) != StatusCode::ok);
  }
  CHECK(attach({}) == StatusCode::shape_mismatch);
  const Stored shifted(sheet.trace.block, 4);
  CHECK(attach(shifted.bytes()) == StatusCode::invalid_argument);
  npsim::Intrinsics other = sheet.k;
  other.fx *= 1.001F;
  CHECK(npsim::attach_sheet_trace(sheet.layer(), other, stored.bytes(), attached).code() ==
        StatusCode::invalid_argument);
  TracedSheet wider = some_sheet({41, 30});
  CHECK(npsim::attach_sheet_trace(wider.layer(), sheet.k, stored.bytes(), attached).code() ==
        StatusCode::shape_mismatch);
  sheet.at(7, 7).z *= 1.01F;  // the layer has moved on
  CHECK(attach(stored.bytes()) == StatusCode::invalid_argument);
  sheet = some_sheet({40, 30});
  sheet.quads[100] ^= 2;
  CHECK(attach(stored.bytes()) == StatusCode::invalid_argument);
  sheet.quads[100] ^= 2;
  CHECK(attach(stored.bytes()) == StatusCode::ok);
  Stored noise(sheet.trace.block);
  for (std::uint32_t round = 0; round < 200; ++round) {
    for (std::size_t i = round % 2 == 0 ? 0 : sizeof(npsim::SheetHeader); i < noise.size; ++i) {
      noise.data[i] = static_cast<unsigned char>(stream(round * 7919U + static_cast<std::uint32_t>(i / 4)).next_u32() >>
                                                 (8 * (i % 4)));
    }
    CHECK(attach(noise.bytes()) != StatusCode::ok);
    std::memcpy(noise.data, stored.data, noise.size);
  }
  TracedSheet row(Shape{5, 1});
  row.fill([](int, int) { return 2.0F; });
  CHECK(npsim::attach_sheet_trace(row.layer(), row.k, {}, attached).ok());
  CHECK(npsim::attach_sheet_trace(row.layer(), row.k, stored.bytes(), attached).code() == StatusCode::shape_mismatch);
}
