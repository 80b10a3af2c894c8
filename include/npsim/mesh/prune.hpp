// SPDX-License-Identifier: Apache-2.0
// Faces that a layer should not have: deleted, or open to rays.
#ifndef NPSIM_MESH_PRUNE_HPP
#define NPSIM_MESH_PRUNE_HPP

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/layer.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Deletes spurious faces from a sheet (section 3.5.1): those with at least one uncertain vertex.
//
// The vertices stay, as points without faces. Optionally a face over uncertain pixels survives where its three
// vertices carry one foreground label and their depths differ by less than 3 m, as in Zhang et al., "Sun Off, Lights
// On", WACV 2025: there the uncertainty lies inside one object.
// Invariant: faces are only removed. Exact. Cost: one pass over the quads, 64 at a time: less than an instruction a
// quad (with the exception, tens where a face is uncertain). Memory: none.

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

// Which faces of a layer rays do not meet: those that join a surface to one that it hides.
//
// A layer is one sheet without holes, so between the edge of a house and the street behind it there are faces that the
// scene does not have: walls along the line of sight, which take the light of every lamp beside it. A step between two
// neighbours of a row or column is such an edge where neither surface leads to the other: with w the inverse depth,
// which is linear in the image on a plane, and a0 a b b0 four pixels in a line,
//   |b - (2a - a0)| > min_step max(a, b)   and   |a - (2b - b0)| > min_step max(a, b).
// A wall or a road at a grazing angle is steep as well, but goes on as it came. A face is open if it has such a step.
// What is missing beside the two counts as level. Only rays are let through; the layer keeps its faces.
//
// Invariant: faces are only taken away. Cost: one pass over the vertices, some tens of instructions a quad in batches.
// Memory: 20 KiB of stack. Error: 2^-22 max(a, b), in single precision.

struct OpenStepsParams {
  float min_step = 0.05F;  // > 0; a share of the nearer depth
};

[[nodiscard]] inline Status validate(const OpenStepsParams& params) noexcept {
  return params.min_step > 0.0F && std::isfinite(params.min_step)
             ? Status()
             : Status(StatusCode::invalid_argument, "open steps: a step must be positive and finite");
}

namespace mesh_detail {

inline constexpr int kStepColumns = 256;

// Inverse depths around the quads of rows begin .. end - 1 and columns strip .. strip + n - 1: from one row and column
// before to two after the last; 0 where there is no vertex.
struct InverseDepths {
  static constexpr int kRows = static_cast<int>(kRowsPerChunk) + 3;
  static constexpr int kColumns = kStepColumns + 3 + simd::kMaxLanes;
  float w[kRows][kColumns];

  template <class F>
  void load(ImageView<const Vec3f> vertices, int strip, int n, int begin, int end) noexcept {
    const int first = strip > 0 ? strip - 1 : 0;
    const int last = strip + n + 2 < vertices.width() ? strip + n + 2 : vertices.width();
    for (int y = begin - 1; y <= end + 1; ++y) {
      float* row = w[y - (begin - 1)];
      std::fill(row, row + kColumns, 0.0F);
      if (y < 0 || y >= vertices.height()) continue;
      float* to = row + (first - (strip - 1));
      for (int i = 0; i < last - first; i += F::lanes) {
        const int lanes = last - first - i < F::lanes ? last - first - i : F::lanes;
        const F z = simd::load3<F>(&vertices(first + i, y).x, lanes).z;
        const auto there = z > F(0.0F);
        select(there, F(1.0F) / select(there, z, F(1.0F)), F(0.0F)).store(to + i);
      }
    }
  }
};

// Of pixels in a line: whether neither surface leads over the step from a to b.
template <class F>
[[nodiscard]] typename F::MaskType is_step(F min_step, F before, F a, F b, F after) noexcept {
  const F zero(0.0F);
  const F two(2.0F);
  const F from_a = select(before > zero, two * a - before, a);
  const F from_b = select(after > zero, two * b - after, b);
  const F least = min_step * max(a, b);
  return (a > zero) & (b > zero) & (abs(b - from_a) > least) & (abs(a - from_b) > least);
}

}  // namespace mesh_detail

// quads: becomes the layer's, without the faces that are open; may not be the layer's own.
template <class F = simd::F32, class Executor>
[[nodiscard]] Status open_steps(const OpenStepsParams& params, const SheetLayer& layer, ImageView<std::uint8_t> quads,
                                Executor& executor) {
  using namespace mesh_detail;
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(layer));
  const Shape shape = quad_shape(layer.vertices.shape());
  if (shape.empty()) return {};
  if (quads.shape() != shape) return {StatusCode::shape_mismatch, "open steps: quads must have the layer's shape"};
  const F min_step(params.min_step);
  for_row_chunks(executor, shape.height, [&](int begin, int end) {
    InverseDepths depths;
    for (int strip = 0; strip < shape.width; strip += kStepColumns) {
      const int n = shape.width - strip < kStepColumns ? shape.width - strip : kStepColumns;
      depths.load<F>(layer.vertices, strip, n, begin, end);
      for (int y = begin; y < end; ++y) {
        const auto row = [&](int dy) { return depths.w[y - begin + 1 + dy] + 1; };
        for (int x = 0; x < n; x += kWordBits) {
          const int columns = n - x < kWordBits ? n - x : kWordBits;
          std::uint64_t top = 0, bottom = 0, left = 0, right = 0;
          for (int i = 0; i < columns; i += F::lanes) {
            const auto at = [&](int dx, int dy) { return F::load(row(dy) + x + i + dx); };
            const auto put = [i](auto mask) { return std::uint64_t{bits(mask)} << static_cast<unsigned>(i); };
            top |= put(is_step<F>(min_step, at(-1, 0), at(0, 0), at(1, 0), at(2, 0)));
            bottom |= put(is_step<F>(min_step, at(-1, 1), at(0, 1), at(1, 1), at(2, 1)));
            left |= put(is_step<F>(min_step, at(0, -1), at(0, 0), at(0, 1), at(0, 2)));
            right |= put(is_step<F>(min_step, at(1, -1), at(1, 0), at(1, 1), at(1, 2)));
          }
          QuadBits faces = load_quads<F>(layer.quads.row(y) + strip + x, columns);
          faces.upper &= ~(top | (faces.anti & left) | (~faces.anti & right));
          faces.lower &= ~(bottom | (faces.anti & right) | (~faces.anti & left));
          faces.anti &= faces.upper | faces.lower;
          store_quads<F>(faces, quads.row(y) + strip + x, columns);
        }
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_PRUNE_HPP
