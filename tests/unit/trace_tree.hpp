// SPDX-License-Identifier: Apache-2.0
// A tree with its memory, checked; and bytes at an address of whole 64, as stored structures need them.
#ifndef NPSIM_TESTS_UNIT_TRACE_TREE_HPP
#define NPSIM_TESTS_UNIT_TRACE_TREE_HPP

#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <vector>

#include "npsim/core/span.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/trace/bvh.hpp"
#include "reference/triangle_scan.hpp"

namespace npsim::testing {

template <unsigned W = kBvhWidth, unsigned P = kBvhPack>
struct Tree {
  std::vector<unsigned char> bytes;
  WideBvh<W, P> bvh;

  explicit Tree(const reference::ScanMesh& mesh) : bytes(wide_bvh_workspace_bytes<W, P>(mesh.faces.size())) {
    Workspace workspace(bytes.data(), bytes.size());
    REQUIRE(build_bvh(mesh.view(), workspace, bvh).ok());
    REQUIRE(check_bvh(bvh, mesh.faces.size()).ok());
  }
};

struct Block {
  std::vector<unsigned char> memory;
  Span<unsigned char> bytes;

  // `shift`: so many bytes past the address.
  explicit Block(std::size_t size, std::size_t shift = 0) : memory(size + 128) {
    REQUIRE(size < (std::size_t{1} << 30U));  // else g++ 12 warns of copies of 2^64 - 128 bytes
    const auto address = reinterpret_cast<std::uintptr_t>(memory.data());
    bytes = {memory.data() + (64 - address % 64) % 64 + shift, size};
  }
};

}  // namespace npsim::testing

#endif  // NPSIM_TESTS_UNIT_TRACE_TREE_HPP
