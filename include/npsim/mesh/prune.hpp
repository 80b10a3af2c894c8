// SPDX-License-Identifier: Apache-2.0
// Deletes spurious faces from a sheet (section 3.5.1): those with at least one uncertain vertex.
//
// The vertices stay, as points without faces. Optionally a face over uncertain pixels survives where its three
// vertices carry one foreground label and their depths differ by less than 3 m, as in Zhang et al., "Sun Off, Lights
// On", WACV 2025: there the uncertainty lies inside one object.
// Invariant: faces are only removed. Exact. Cost: one pass over the quads, 64 at a time: less than an instruction a
// quad (with the exception, tens where a face is uncertain). Memory: none.
#ifndef NPSIM_MESH_PRUNE_HPP
#define NPSIM_MESH_PRUNE_HPP

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/layer.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

enum class PrunePolicy : std::uint8_t {
  uncertain_vertex,       // the thesis
  keep_within_foreground  // the exception above
};

struct PruneParams {
  PrunePolicy policy = PrunePolicy::uncertain_vertex;
  LabelSet foreground = kForegroundLabels;  // used by keep_within_foreground only, as is the next
  float max_spread_m = 3.0F;
};

[[nodiscard]] inline Status validate(const PruneParams& p) noexcept {
  if (p.policy != PrunePolicy::keep_within_foreground || (p.max_spread_m >= 0.0F && std::isfinite(p.max_spread_m))) {
    return {};
  }
  return {StatusCode::invalid_argument, "the depth spread of a kept face must be finite and not negative"};
}

namespace mesh_detail {

[[nodiscard]] inline bool within_foreground(const PruneParams& params, ImageView<const Label> labels,
                                            ImageView<const Vec3f> vertices, const Face& corners, int x,
                                            int y) noexcept {
  const auto pixel_x = [x](std::uint32_t corner) { return x + static_cast<int>(corner & 1U); };
  const auto pixel_y = [y](std::uint32_t corner) { return y + static_cast<int>(corner >> 1U); };
  const Label first = labels(pixel_x(corners.a), pixel_y(corners.a));
  float nearest = vertices(pixel_x(corners.a), pixel_y(corners.a)).z;
  float farthest = nearest;
  for (const std::uint32_t corner : {corners.b, corners.c}) {
    if (labels(pixel_x(corner), pixel_y(corner)) != first) return false;
    const float z = vertices(pixel_x(corner), pixel_y(corner)).z;
    nearest = std::min(nearest, z);
    farthest = std::max(farthest, z);
  }
  return params.foreground.contains(first) && farthest - nearest < params.max_spread_m;
}

}  // namespace mesh_detail

// labels may be empty under PrunePolicy::uncertain_vertex.
template <class F = simd::F32, class Executor>
[[nodiscard]] Status prune(const PruneParams& params, ImageView<const std::uint8_t> uncertain,
                           ImageView<const Label> labels, const SheetLayer& sheet, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(sheet));
  const Shape shape = sheet.vertices.shape();
  const bool keep = params.policy == PrunePolicy::keep_within_foreground;
  if (uncertain.data() == nullptr || uncertain.shape() != shape ||
      (keep && (labels.data() == nullptr || labels.shape() != shape))) {
    return {StatusCode::shape_mismatch, "uncertain mask, labels and sheet must have one shape"};
  }
  using U = simd::BytesOf<F>;
  const Shape quads = quad_shape(shape);
  for_rows(executor, quads.width > 0 ? quads.height : 0, [&](int y) {
    for (int x = 0; x < quads.width; x += kWordBits) {
      const int n = quads.width - x < kWordBits ? quads.width - x : kWordBits;
      std::uint8_t* row = sheet.quads.row(y) + x;
      const mesh_detail::QuadCorners doubt = {mesh_detail::nonzero_bits<U>(uncertain.row(y) + x, n),
                                              mesh_detail::nonzero_bits<U>(uncertain.row(y) + x + 1, n),
                                              mesh_detail::nonzero_bits<U>(uncertain.row(y + 1) + x, n),
                                              mesh_detail::nonzero_bits<U>(uncertain.row(y + 1) + x + 1, n)};
      mesh_detail::QuadBits faces = mesh_detail::load_quads<F>(row, n);
      const std::uint64_t anti = faces.anti;
      std::uint64_t upper = faces.upper & (doubt.a | doubt.b | (anti & doubt.c) | (~anti & doubt.d));  // spurious
      std::uint64_t lower = faces.lower & (doubt.c | doubt.d | (anti & doubt.b) | (~anti & doubt.a));
      if (keep) {
        const auto spare = [&](std::uint64_t& spurious, bool is_upper) {
          for_set_bits(spurious, [&](int i) {
            const Face corners = quad_face(bit_at(anti, i), is_upper, 0, 1, 2, 3);
            if (mesh_detail::within_foreground(params, labels, sheet.vertices, corners, x + i, y)) {
              spurious ^= std::uint64_t{1} << static_cast<unsigned>(i);
            }
          });
        };
        spare(upper, true);
        spare(lower, false);
      }
      faces.upper &= ~upper;
      faces.lower &= ~lower;
      faces.anti &= faces.upper | faces.lower;
      mesh_detail::store_quads<F>(faces, row, n);
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_PRUNE_HPP
