// SPDX-License-Identifier: Apache-2.0
// Gives a depth to pixels that have none (stereo shadows, sparse LiDAR, bonnet), guided by labels where there are any.
//
// Depth is continued within its label region only, in inverse depth, which is linear in the image on every plane: the
// filled pixels solve the membrane equation (each is the mean of its neighbours of the same label) with the valid
// pixels fixed, so a hole in a plane is filled with that plane. For the ground classes the membrane is stretched over
// the plane that fits all valid pixels of the class, so that the ground also goes on as a plane beyond the last
// measurement; elsewhere a hole that reaches the border of its region loses the slope across that border. A region
// without any valid pixel takes the plane of its class (ground that determines none: of the largest ground class), else
// the membrane over whatever surrounds it. Labels without a surface (the sky) get 0 and are never a source. Without
// labels the image is one region.
//
// Invariant: valid depths on surfaces come out unchanged, except those far beneath the near ground (stereo mismatches,
// which would otherwise spread over the hole they stand in), and every other surface pixel gets a positive depth within
// a factor 4 of the range of valid depths of its label. Depths outside 1e-4..1e6 m are kept but not used.
// Method: nearest valid pixel of the region along 4-connected paths, then red-black over-relaxation.
// Cost: O(pixels) + O(filled pixels x sweeps). Memory: 9 bytes per pixel. Deterministic for any executor.
#ifndef NPSIM_DEPTH_FILL_HPP
#define NPSIM_DEPTH_FILL_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/fill_class.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct FillParams {
  LabelSet no_surface = kNoSurfaceLabels;
  LabelSet planar = LabelSet::of(label::ground, label::road, label::sidewalk, label::parking, label::rail_track,
                                 label::terrain);
  float ground_outlier = 2;  // farther than this many times the near ground: filled anew; 0: kept
  int max_sweeps = 400;      // holes up to about this many pixels wide converge
  float tolerance = 1e-5F;   // stop when no inverse depth changes by more than this share of itself in one sweep
  float relaxation = 1.9F;   // of the over-relaxation, in (0, 2)
};

inline constexpr std::size_t kFillChunkRows = 16;

[[nodiscard]] constexpr std::size_t fill_workspace_bytes(const FillParams&, Shape shape) noexcept {
  return kWorkspaceAlignment + allocation_bytes<float>(shape.pixels()) +
         allocation_bytes<std::int32_t>(shape.pixels()) + allocation_bytes<std::uint8_t>(shape.pixels()) +
         allocation_bytes<std::uint8_t>(chunk_count(static_cast<std::size_t>(shape.height), kFillChunkRows));
}

namespace depth_detail {

enum FillFlag : std::uint8_t { kLeft = 1, kRight = 2, kUp = 4, kDown = 8, kOrphan = 16 };

enum class FillReach { same_label, any_surface, anything };

// One shortest-path relaxation of (x, y) from its neighbour; true if it improved.
[[nodiscard]] inline bool relax(FillState& state, FillReach reach, int x, int y, int from_x, int from_y) noexcept {
  if (!state.w.contains(from_x, from_y) || state.steps(from_x, from_y) == kUnreached) return false;
  const FillClass& c = state.class_at(x, y);
  const bool same = state.label_at(x, y) == state.label_at(from_x, from_y);
  if (reach == FillReach::same_label && !(same && c.surface)) return false;
  if (reach != FillReach::same_label && (state.flags(x, y) & kOrphan) == 0) return false;
  if (reach == FillReach::any_surface && !(c.surface && state.class_at(from_x, from_y).surface)) return false;
  if (state.steps(from_x, from_y) + 1 >= state.steps(x, y)) return false;
  state.steps(x, y) = state.steps(from_x, from_y) + 1;
  float w = state.w(from_x, from_y);
  if (same) w += static_cast<float>(x - from_x) * c.slope_u + static_cast<float>(y - from_y) * c.slope_v;
  state.w(x, y) = w;
  return true;
}

// Nearest valid pixel along paths, by raster passes to and fro until nothing changes, at most 16 times. Pixels in
// windings that 16 passes do not reach count as unreached, which is a worse start and not an error.
inline void spread(FillState& state, FillReach reach) noexcept {
  const int width = state.w.width();
  const int height = state.w.height();
  bool changed = true;
  for (int pass = 0; pass < 16 && changed; ++pass) {
    changed = false;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        if (relax(state, reach, x, y, x - 1, y)) changed = true;
        if (relax(state, reach, x, y, x, y - 1)) changed = true;
      }
    }
    for (int y = height - 1; y >= 0; --y) {
      for (int x = width - 1; x >= 0; --x) {
        if (relax(state, reach, x, y, x + 1, y)) changed = true;
        if (relax(state, reach, x, y, x, y + 1)) changed = true;
      }
    }
  }
}

// A start value for every pixel: from its region, else from its class' plane, else from any surface, else from
// anything.
inline void initialise(FillState& state) noexcept {
  spread(state, FillReach::same_label);
  for (int y = 0; y < state.w.height(); ++y) {
    for (int x = 0; x < state.w.width(); ++x) {
      state.flags(x, y) = 0;
      if (state.steps(x, y) != kUnreached) continue;
      const FillClass& c = state.class_at(x, y);
      if (c.plane) {
        state.w(x, y) = static_cast<float>(plane_at(c, x, y));
        state.steps(x, y) = 1;
      } else {
        state.flags(x, y) = kOrphan;
      }
    }
  }
  spread(state, FillReach::any_surface);
  spread(state, FillReach::anything);
}

// Which neighbours a pixel is the mean of: those of its label; for an orphan, all surfaces.
[[nodiscard]] inline std::uint8_t couplings(const FillState& state, int x, int y) noexcept {
  if (state.steps(x, y) == 0 || !state.class_at(x, y).surface) return 0;
  const bool orphan = (state.flags(x, y) & kOrphan) != 0;
  const auto coupled = [&](int i, int j) {
    return state.w.contains(i, j) &&
           (orphan ? state.class_at(i, j).surface : state.label_at(i, j) == state.label_at(x, y));
  };
  return static_cast<std::uint8_t>((orphan ? kOrphan : 0) | (coupled(x - 1, y) ? kLeft : 0) |
                                   (coupled(x + 1, y) ? kRight : 0) | (coupled(x, y - 1) ? kUp : 0) |
                                   (coupled(x, y + 1) ? kDown : 0));
}

// One over-relaxed update; whether it changed the value by more than the tolerance.
[[nodiscard]] inline bool relax_membrane(const FillState& state, const FillParams& params, int x, int y) noexcept {
  constexpr float kShare[5] = {0.0F, 1.0F, 0.5F, 1.0F / 3.0F, 0.25F};
  const std::uint8_t flags = state.flags(x, y);
  const FillClass& c = state.class_at(x, y);
  const bool orphan = (flags & kOrphan) != 0;
  const float du = orphan ? 0.0F : c.slope_u;
  const float dv = orphan ? 0.0F : c.slope_v;
  float* const w = state.w.row(y) + x;
  const std::ptrdiff_t stride = state.w.stride();
  float sum = 0;
  int count = 0;
  const auto add = [&](FillFlag flag, std::ptrdiff_t neighbour, float step) {
    if ((flags & flag) == 0) return;
    sum += w[neighbour] + step;
    ++count;
  };
  add(kLeft, -1, du);
  add(kRight, 1, -du);
  add(kUp, -stride, dv);
  add(kDown, stride, -dv);
  const float before = *w;
  float after = before + params.relaxation * (sum * kShare[count] - before);
  after = after > c.low ? after : c.low;
  after = after < c.high ? after : c.high;
  *w = after;
  return std::abs(after - before) > params.tolerance * after;
}

}  // namespace depth_detail

// labels: empty, or the shape of depth. output: the shape of depth; it may be the same memory. filled: empty, or gets 1
// where a depth was made up and 0 elsewhere. Status no_valid_input if no surface pixel has a usable depth; then the
// outputs are untouched.
template <class Executor>
[[nodiscard]] Status fill_depth(const FillParams& params, ImageView<const float> depth, ImageView<const Label> labels,
                                ImageView<float> output, ImageView<std::uint8_t> filled, Workspace& workspace,
                                Executor& executor) noexcept {
  using namespace depth_detail;
  if (params.max_sweeps < 0 || params.max_sweeps > 100000) {
    return {StatusCode::invalid_argument, "fill_depth: max_sweeps must lie in 0..100000"};
  }
  if (!(params.tolerance >= 0) || !(params.relaxation > 0 && params.relaxation < 2)) {
    return {StatusCode::invalid_argument, "fill_depth: tolerance must not be negative, relaxation must lie in (0, 2)"};
  }
  if (!(params.ground_outlier == 0 || (params.ground_outlier >= 1 && params.ground_outlier <= 1e6F))) {
    return {StatusCode::invalid_argument, "fill_depth: ground_outlier must be 0 or lie in 1..1e6"};
  }
  if (depth.empty()) return {StatusCode::no_valid_input, "fill_depth: the depth image is empty"};
  const Shape shape = depth.shape();
  if (output.empty() || output.shape() != shape || (!labels.empty() && labels.shape() != shape) ||
      (!filled.empty() && filled.shape() != shape)) {
    return {StatusCode::shape_mismatch, "fill_depth: labels and outputs must have the shape of the depth"};
  }

  const WorkspaceScope scope(workspace);
  FillState state;
  state.labels = labels;
  Span<std::uint8_t> changed;
  const auto rows = static_cast<std::size_t>(shape.height);
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, state.w));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, state.steps));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, state.flags));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(chunk_count(rows, kFillChunkRows), changed));

  if (describe_classes(params.no_surface, params.planar, params.ground_outlier, depth, state) == 0) {
    return {StatusCode::no_valid_input, "fill_depth: no pixel of a surface has a usable depth"};
  }
  initialise(state);
  executor.for_chunks(rows, kFillChunkRows, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) state.flags(x, y) = couplings(state, x, y);
    }
  });

  // Red pixels read black ones only and the reverse, so the order within a half-sweep does not matter.
  for (int sweep = 0; sweep < params.max_sweeps; ++sweep) {
    for (std::uint8_t& c : changed) c = 0;
    for (int colour = 0; colour < 2; ++colour) {
      executor.for_chunks(rows, kFillChunkRows, [&](std::size_t begin, std::size_t end) {
        bool moved = false;
        for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
          for (int x = (y + colour) & 1; x < shape.width; x += 2) {
            if ((state.flags(x, y) & (kLeft | kRight | kUp | kDown)) == 0) continue;
            if (relax_membrane(state, params, x, y)) moved = true;
          }
        }
        if (moved) changed[begin / kFillChunkRows] = 1;
      });
    }
    bool any = false;
    for (const std::uint8_t c : changed) any = any || c != 0;
    if (!any) break;
  }

  executor.for_chunks(rows, kFillChunkRows, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const FillClass& c = state.class_at(x, y);
        const bool dropped = state.steps(x, y) != 0 && is_fill_source(depth(x, y));
        const bool keep = c.surface && is_valid_depth(depth(x, y)) && !dropped;
        const float w = state.w(x, y) < c.low ? c.low : (state.w(x, y) > c.high ? c.high : state.w(x, y));
        output(x, y) = keep ? depth(x, y) : (c.surface ? 1.0F / w : 0.0F);
        if (!filled.empty()) filled(x, y) = c.surface && !keep ? 1 : 0;
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_FILL_HPP
