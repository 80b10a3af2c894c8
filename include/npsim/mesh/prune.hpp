// SPDX-License-Identifier: Apache-2.0
// Deletes spurious faces from a sheet (section 3.5.1): those with at least one uncertain vertex.
//
// The vertices stay, as points without faces. Optionally a face over uncertain pixels survives where its three
// vertices carry one foreground label and their depths differ by less than 3 m, as in Zhang et al., "Sun Off, Lights
// On", WACV 2025: there the uncertainty lies inside one object.
// Invariant: faces are only removed. Cost: one pass over the quads. Memory: none.
#ifndef NPSIM_MESH_PRUNE_HPP
#define NPSIM_MESH_PRUNE_HPP

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {

enum class PrunePolicy : std::uint8_t {
  uncertain_vertex,       // the thesis
  keep_within_foreground  // the exception above
};

struct PruneParams {
  PrunePolicy policy = PrunePolicy::uncertain_vertex;
  LabelSet foreground = kForegroundLabels;  // used by keep_within_foreground only, as is the next
  float max_spread_m = 3.0F;
};

inline namespace NPSIM_ISA_NAMESPACE {

// labels may be empty under PrunePolicy::uncertain_vertex.
template <class Executor>
[[nodiscard]] Status prune(const PruneParams& params, ImageView<const std::uint8_t> uncertain,
                           ImageView<const Label> labels, const SheetLayer& sheet, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(sheet));
  const Shape shape = sheet.vertices.shape();
  const bool keep = params.policy == PrunePolicy::keep_within_foreground;
  if (keep && !(params.max_spread_m >= 0.0F && std::isfinite(params.max_spread_m))) {
    return {StatusCode::invalid_argument, "the depth spread of a kept face must be finite and not negative"};
  }
  if (uncertain.data() == nullptr || uncertain.shape() != shape ||
      (keep && (labels.data() == nullptr || labels.shape() != shape))) {
    return {StatusCode::shape_mismatch, "uncertain mask, labels and sheet must have one shape"};
  }
  mesh_detail::for_rows(executor, quad_shape(shape).height, [&](int y) {
    const auto survives = [&](const Face& corners, int x) {
      const std::uint32_t corner[3] = {corners.a, corners.b, corners.c};  // bit 0: right column, bit 1: lower row
      bool any_uncertain = false;
      bool one_label = keep;
      float nearest = 0.0F;
      float farthest = 0.0F;
      Label first = 0;
      for (int i = 0; i < 3; ++i) {
        const int px = x + static_cast<int>(corner[i] & 1U);
        const int py = y + static_cast<int>(corner[i] >> 1U);
        any_uncertain = any_uncertain || uncertain(px, py) != 0;
        if (!keep) continue;
        const float z = sheet.vertices(px, py).z;
        nearest = i == 0 ? z : std::min(nearest, z);
        farthest = i == 0 ? z : std::max(farthest, z);
        if (i == 0) first = labels(px, py);
        one_label = one_label && labels(px, py) == first;
      }
      if (!any_uncertain) return true;
      return one_label && params.foreground.contains(first) && farthest - nearest < params.max_spread_m;
    };
    for (int x = 0; x + 1 < shape.width; ++x) {
      std::uint8_t& quad = sheet.quads(x, y);
      const bool anti = (quad & kQuadAntiDiagonal) != 0;
      std::uint8_t kept = quad & kQuadAntiDiagonal;
      if ((quad & kQuadUpperFace) != 0 && survives(quad_face(anti, true, 0, 1, 2, 3), x)) kept |= kQuadUpperFace;
      if ((quad & kQuadLowerFace) != 0 && survives(quad_face(anti, false, 0, 1, 2, 3), x)) kept |= kQuadLowerFace;
      quad = (kept & (kQuadUpperFace | kQuadLowerFace)) != 0 ? kept : std::uint8_t{0};
    }
  });
  return {};
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_MESH_PRUNE_HPP
