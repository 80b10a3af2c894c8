// SPDX-License-Identifier: Apache-2.0
// Trees stored, moved and mapped again; damaged ones are refused, or harmless.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "npsim/trace/bvh.hpp"
#include "reference/triangle_scan.hpp"
#include "trace_tree.hpp"

namespace {

using npsim::Bvh;
using npsim::Hit;
using npsim::RandomStream;
using npsim::Ray;
using npsim::reference::hard_ray;
using npsim::reference::same;
using npsim::reference::ScanMesh;
using npsim::reference::soup;
using npsim::reference::stream;
using npsim::testing::Block;
using npsim::testing::Tree;

}  // namespace

TEST_CASE("trace check: a stored tree answers the same at another place") {
  for (const std::uint32_t faces : {0U, 1U, 16U, 17U, 700U}) {
    CAPTURE(faces);
    const ScanMesh mesh = soup(faces, 0.2F, 1.0F, 5);
    Tree<> tree(mesh);
    Block block(npsim::bvh_storage_bytes(tree.bvh));
    REQUIRE(npsim::store_bvh(tree.bvh, block.bytes).ok());
    Block moved(block.bytes.size());
    std::copy(block.bytes.begin(), block.bytes.end(), moved.bytes.begin());
    Bvh mapped;
    REQUIRE(npsim::map_bvh(moved.bytes, faces, mapped).ok());
    std::fill(block.memory.begin(), block.memory.end(), static_cast<unsigned char>(0xFF));
    const Bvh kept = tree.bvh;
    for (std::uint32_t i = 0; i < 300 && faces > 0; ++i) {
      const Ray ray = hard_ray(mesh, i, 1.0F, {});
      Hit a;
      Hit b;
      CHECK(npsim::closest_hit(kept, ray, a) == npsim::closest_hit(mapped, ray, b));
      CHECK(same(a, b));
    }
  }
}

TEST_CASE("trace check: another kind, length, place or number of faces is refused") {
  Tree<> tree(soup(100, 0.2F, 1.0F, 6));
  Block block(npsim::bvh_storage_bytes(tree.bvh) + 64);
  const npsim::Span<unsigned char> bytes = block.bytes.sub(0, block.bytes.size() - 64);
  CHECK_FALSE(npsim::store_bvh(tree.bvh, block.bytes).ok());
  REQUIRE(npsim::store_bvh(tree.bvh, bytes).ok());
  Bvh out;
  npsim::WideBvh<4, 4> narrow;
  CHECK(npsim::map_bvh(bytes, 100, out).ok());
  CHECK_FALSE(npsim::map_bvh(bytes, 99, out).ok());
  CHECK(out.nodes.empty());
  CHECK_FALSE(npsim::map_bvh(bytes, 100, narrow).ok());
  CHECK_FALSE(npsim::map_bvh(block.bytes, 100, out).ok());
  CHECK_FALSE(npsim::map_bvh(bytes.sub(0, bytes.size() - 64), 100, out).ok());
  CHECK_FALSE(npsim::map_bvh(bytes.sub(0, 63), 100, out).ok());
  CHECK_FALSE(npsim::map_bvh(npsim::Span<unsigned char>(), 100, out).ok());
  std::copy_backward(bytes.begin(), bytes.end(), bytes.end() + 4);
  CHECK_FALSE(npsim::map_bvh(block.bytes.sub(4, bytes.size()), 100, out).ok());
}

TEST_CASE("trace check: every index, count, depth, box and face out of range is found") {
  const ScanMesh mesh = soup(2500, 0.2F, 1.0F, 7);
  const Tree<> good(mesh);
  REQUIRE(npsim::check_bvh(good.bvh, 2500).ok());
  const auto nodes = static_cast<std::uint32_t>(good.bvh.nodes.size());
  const auto packs = static_cast<std::uint32_t>(good.bvh.packs.size());
  REQUIRE(nodes > 6);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto refused = [&](auto&& damage) {
    Tree<> tree(mesh);
    damage(tree.bvh);
    return !npsim::check_bvh(tree.bvh, 2500).ok();
  };
  for (std::uint32_t n = 0; n < nodes; n += 2) {
    for (unsigned slot = 0; slot < good.bvh.nodes[n].count; ++slot) {
      for (const std::uint32_t child : {0U, n, nodes, nodes + 1, 0x7FFFFFFFU, npsim::kBvhLeaf | packs, 0xFFFFFFFFU,
                                        good.bvh.nodes[n].child[slot] ^ 1U}) {
        CHECK(refused([&](Bvh& b) { b.nodes[n].child[slot] = child; }));
      }
      for (const unsigned k : {0U, 1U, 2U}) {
        CHECK(refused([&](Bvh& b) { b.nodes[n].bound[k][slot] = nan; }));
        CHECK(refused([&](Bvh& b) { b.nodes[n].bound[k][slot] += 1e-3F; }));
        CHECK(refused([&](Bvh& b) { b.nodes[n].bound[k + 3][slot] -= 1e-3F; }));
      }
    }
    for (const std::uint32_t count : {0U, 1U, npsim::kBvhWidth + 1, 0xFFFFFFFFU, good.bvh.nodes[n].count - 1}) {
      CHECK(refused([&](Bvh& b) { b.nodes[n].count = count; }));
    }
  }
  CHECK(refused([](Bvh& b) { b.packs[3].face[2] = 2500; }));
  CHECK(refused([&](Bvh& b) { b.packs[3].vertex[1][1][7] = nan; }));
  CHECK(refused([&](Bvh& b) { b.packs[3].vertex[1][1][7] = 100.0F; }));
  CHECK(refused([&](Bvh& b) { b.low[1] = nan; }));
  CHECK(refused([&](Bvh& b) { b.high[2] -= 0.1F; }));
  CHECK(refused([&](Bvh& b) { b.high[2] = 0x1p61F; }));
  CHECK(refused([&](Bvh& b) { b.nodes = b.nodes.sub(0, nodes - 1); }));
  CHECK(refused([&](Bvh& b) { b.packs = b.packs.sub(0, packs - 1); }));
  CHECK(refused([&](Bvh& b) { b.nodes = {}; }));
}

TEST_CASE("trace check: a chain of nodes deeper than the bound is found") {
  for (const int links : {64, 65}) {
    // Each node has the next and a leaf, all with the same box.
    std::vector<npsim::BvhNode<2>> nodes(static_cast<std::size_t>(links));
    std::vector<npsim::TrianglePack<2>> packs(nodes.size() + 1);
    for (std::uint32_t i = 0; i < nodes.size(); ++i) {
      nodes[i].count = 2;
      nodes[i].child[0] = npsim::kBvhLeaf | i;
      nodes[i].child[1] = i + 1 < nodes.size() ? i + 1 : npsim::kBvhLeaf | (i + 1);
    }
    npsim::WideBvh<2, 2> chain;
    chain.nodes = {nodes.data(), nodes.size()};
    chain.packs = {packs.data(), packs.size()};
    CHECK(npsim::check_bvh(chain, 1).ok() == (links == 64));
    Hit hit;
    if (links == 64) CHECK_FALSE(npsim::closest_hit(chain, Ray{{0, 0, -1}, {0, 0, 1}}, hit));
  }
}

TEST_CASE("trace check: what passes with random bytes changed can be traced") {
  const ScanMesh mesh = soup(120, 0.2F, 1.0F, 8);
  Tree<> tree(mesh);
  Block block(npsim::bvh_storage_bytes(tree.bvh));
  REQUIRE(npsim::store_bvh(tree.bvh, block.bytes).ok());
  std::size_t passed = 0;
  for (std::uint32_t i = 0; i < 20000; ++i) {
    RandomStream random = stream(i);
    const std::size_t at = random.next_u32() % block.bytes.size();
    const unsigned char before = block.bytes[at];
    block.bytes[at] = static_cast<unsigned char>(random.next_u32());
    Bvh mapped;
    if (npsim::map_bvh(block.bytes, 120, mapped).ok()) {
      ++passed;
      Hit hit;
      static_cast<void>(npsim::closest_hit(mapped, hard_ray(mesh, i, 1.0F, {}), hit));
      CHECK((hit.face < 120 || hit.face == npsim::kNoFace));
    }
    block.bytes[at] = before;
  }
  CHECK(passed > 1000);  // a vertex that moves inside its box
  CHECK(passed < 15000);
}
