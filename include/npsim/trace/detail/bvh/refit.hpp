// SPDX-License-Identifier: Apache-2.0
// New boxes for a tree whose vertices moved: same faces, same shape of the tree.
//
// Invariant: answers are those of a tree built anew from the faces that are in this one. A face that became unusable
// (bvh_build.hpp) turns into a point, which nothing hits, and comes back with a later refit; one that the build left
// out stays out. The tree gets slower as it fits worse: bvh_cost() says by how much, and when to build again.
// Cost: one pass over packs and one over nodes, about a fifth of the build. Memory: none.
#ifndef NPSIM_TRACE_DETAIL_BVH_REFIT_HPP
#define NPSIM_TRACE_DETAIL_BVH_REFIT_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/status.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/trace/detail/bvh/build.hpp"
#include "npsim/trace/detail/bvh/layout.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace bvh_detail {

// Writes the corners of a pack's faces and returns their box, empty when none is usable; `point` is where those go that
// are not, if no face of the pack is.
template <unsigned P>
[[nodiscard]] inline Box refit_pack(const TriangleMeshView& mesh, const Vec3f& point, TrianglePack<P>& pack) noexcept {
  Box box = empty_box();
  Vec3f place = point;
  std::uint32_t unusable = 0;
  for (unsigned lane = 0; lane < P; ++lane) {
    Vec3f corners[3];
    if (!corners_of(mesh, pack.face[lane], corners)) {
      unusable |= 1U << lane;
      continue;
    }
    write_lane(corners, pack.face[lane], lane, pack);
    BvhPrimitive primitive;
    write_primitive(corners, 0, primitive);
    box = min(box, load_box(primitive));
    place = corners[0];
  }
  for (; unusable != 0; unusable &= unusable - 1) {
    const auto lane = static_cast<unsigned>(lowest_set_bit(unusable));
    write_lane({place, place, place}, pack.face[lane], lane, pack);
  }
  return box;
}

[[nodiscard]] inline Box box_of_point(const Vec3f& p) noexcept {
  const float both[8] = {p.x, p.y, p.z, 0.0F, -p.x, -p.y, -p.z, 0.0F};
  return Box::load(both);
}

}  // namespace bvh_detail

// `mesh` has at least the faces that the tree was built from; nothing changes if it has not. The bytes of the tree must
// be writable.
template <unsigned W, unsigned P>
[[nodiscard]] Status refit_bvh(TriangleMeshView mesh, WideBvh<W, P>& bvh) noexcept {
  using namespace bvh_detail;
  const std::size_t n = mesh.vertices.size();
  Vec3f anchor{};
  bool anchored = false;
  for (const TrianglePack<P>& pack : bvh.packs) {
    for (const std::uint32_t face : pack.face) {
      if (face >= mesh.faces.size() || mesh.faces[face].a >= n || mesh.faces[face].b >= n || mesh.faces[face].c >= n) {
        return Status(StatusCode::invalid_argument, "refit: the mesh lacks a face or vertex of the tree");
      }
      Vec3f corners[3];
      if (anchored || !corners_of(mesh, face, corners)) continue;
      anchor = corners[0];
      anchored = true;
    }
  }
  // Children have higher numbers than their parents.
  for (std::size_t i = bvh.nodes.size(); i-- > 0;) {
    BvhNode<W>& node = bvh.nodes[i];
    for (unsigned slot = 0; slot < node.count; ++slot) {
      Box box = empty_box();
      if ((node.child[slot] & kBvhLeaf) != 0) {
        box = refit_pack(mesh, anchor, bvh.packs[node.child[slot] & ~kBvhLeaf]);
      } else {
        const BvhNode<W>& below = bvh.nodes[node.child[slot]];
        for (unsigned j = 0; j < below.count; ++j) {
          const float both[8] = {below.bound[0][j],  below.bound[1][j],  below.bound[2][j],  0.0F,
                                 -below.bound[3][j], -below.bound[4][j], -below.bound[5][j], 0.0F};
          box = min(box, Box::load(both));
        }
      }
      float all[8];
      box.store(all);
      if (!(all[0] <= -all[4])) box_of_point(anchor).store(all);  // a pack of unusable faces
      for (unsigned k = 0; k < 3; ++k) {
        node.bound[k][slot] = all[k];
        node.bound[k + 3][slot] = -all[k + 4];
      }
    }
  }
  if (bvh.nodes.empty()) return {};
  const BvhNode<W>& root = bvh.nodes[0];
  for (unsigned k = 0; k < 3; ++k) {
    bvh.low[k] = root.bound[k][0];
    bvh.high[k] = root.bound[k + 3][0];
    for (unsigned slot = 1; slot < root.count; ++slot) {
      bvh.low[k] = root.bound[k][slot] < bvh.low[k] ? root.bound[k][slot] : bvh.low[k];
      bvh.high[k] = root.bound[k + 3][slot] > bvh.high[k] ? root.bound[k + 3][slot] : bvh.high[k];
    }
  }
  return {};
}

// Boxes that a random ray through the bounds is expected to meet: the sum of all surfaces over that of the bounds. Much
// more than just after the build, say twice, and building again pays soon.
template <unsigned W, unsigned P>
[[nodiscard]] double bvh_cost(const WideBvh<W, P>& bvh) noexcept {
  const auto half_surface = [](const auto& low, const auto& high) noexcept {
    double e[3];
    for (unsigned k = 0; k < 3; ++k) e[k] = static_cast<double>(high(k)) - static_cast<double>(low(k));
    return e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
  };
  double sum = 0.0;
  for (const BvhNode<W>& node : bvh.nodes) {
    for (unsigned slot = 0; slot < node.count; ++slot) {
      sum += half_surface([&](unsigned k) { return node.bound[k][slot]; },
                          [&](unsigned k) { return node.bound[k + 3][slot]; });
    }
  }
  const double whole = half_surface([&](unsigned k) { return bvh.low[k]; }, [&](unsigned k) { return bvh.high[k]; });
  return whole > 0.0 ? sum / whole : 0.0;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_BVH_REFIT_HPP
