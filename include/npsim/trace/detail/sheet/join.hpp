// SPDX-License-Identifier: Apache-2.0
// Layers of one shape and camera as one scene: what bounds a ray is the union of what bounds the layers.
//
// Cost: none to speak of. Memory: none; the layers stay with the caller.
#ifndef NPSIM_TRACE_DETAIL_SHEET_JOIN_HPP
#define NPSIM_TRACE_DETAIL_SHEET_JOIN_HPP

#include <algorithm>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"

namespace npsim {
inline namespace NPSIM_ABI {


// Layers of one shape and camera as one scene. `layers` stays with the caller.
[[nodiscard]] inline Status join_layers(Span<const SheetTrace> layers, SheetScene& out) noexcept {
  SheetScene scene;
  const SheetTrace* first = nullptr;
  for (const SheetTrace& layer : layers) {
    if (layer.levels == 0) continue;
    if (first == nullptr) {
      first = &layer;
      scene.bounds = layer.bounds;
      continue;
    }
    const Intrinsics& a = first->intrinsics;
    const Intrinsics& b = layer.intrinsics;
    if (layer.vertices.shape() != first->vertices.shape() || a.fx != b.fx || a.fy != b.fy || a.cx != b.cx ||
        a.cy != b.cy) {
      return Status(StatusCode::shape_mismatch, "layers that are traced as one must have one shape and one camera");
    }
    SheetBounds& to = scene.bounds;
    const SheetBounds& from = layer.bounds;
    for (int k = 0; k < 3; ++k) {
      to.low[k] = std::min(to.low[k], from.low[k]);
      to.high[k] = std::max(to.high[k], from.high[k]);
    }
    to.max_inverse_depth = std::max(to.max_inverse_depth, from.max_inverse_depth);
    to.pad_px = std::max(to.pad_px, from.pad_px);
    to.focal_reach = std::max(to.focal_reach, from.focal_reach);
    for (int i = 0; i < 8; ++i) {  // x and y are alike; the greater z or d of a side takes in more
      to.z[i] = std::max(to.z[i], from.z[i]);
      to.d[i] = std::max(to.d[i], from.d[i]);
      to.size[i] = std::max(to.size[i], from.size[i]);
    }
  }
  scene.layers = layers;
  out = scene;
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_JOIN_HPP
