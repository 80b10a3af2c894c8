// SPDX-License-Identifier: Apache-2.0
// Gives a depth to pixels that have none (stereo shadows, sparse LiDAR, bonnet), guided by labels where there are any.
//
// Depth is continued within its object only, in inverse depth, which is linear in the image on every plane, by the
// field of least absolute slope and curvature with the valid pixels fixed (detail/fill/second_order.hpp): planes go on
// in holes, and meet in creases. For the ground classes slope counts from the plane that fits all valid pixels of the
// class, so that the ground also goes on as a plane beyond the last measurement, and kinds of ground meet at their
// borders. A crown or a pole stands upright before what lies beside it: but for pixels close to what was measured of
// it, it is as far away as the nearest of that; of a laser, crowns as the median of these to either side. Points of a
// laser are joined first (detail/fill/scan_lines.hpp). A region without any valid pixel takes the plane of its class
// (ground that determines none: of the largest ground class), else the depth of what it is a part of
// (detail/fill/orphans.hpp), else that of what surrounds it. Labels without a surface (the sky) get 0 and are never a
// source. Without labels the image is one region.
//
// Invariant: valid depths on surfaces come out unchanged, except those far beneath the near ground (stereo mismatches,
// which would otherwise spread over the hole they stand in), and every other surface pixel gets a positive depth within
// a factor 4 of the range of valid depths of its label, or of what it is a part of. Depths outside 1e-4..1e6 m are kept
// but not used.
// Method: start from the nearest valid or joined pixel of the object along 4-connected paths, then coarse to fine.
// Cost: O(pixels) + sweeps over the filled pixels, and up to three passes over the image per planar label. Memory: 14
// bytes per pixel, 16 KiB of stack. Deterministic for any executor.
#ifndef NPSIM_DEPTH_FILL_HPP
#define NPSIM_DEPTH_FILL_HPP

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/fill/orphans.hpp"
#include "npsim/depth/detail/fill/scan_lines.hpp"
#include "npsim/depth/detail/fill/second_order.hpp"
#include "npsim/depth/detail/grow.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct FillParams {
  LabelSet no_surface = kNoSurfaceLabels;
  LabelSet planar = kGroundLabels;
  LabelSet behind = kHouseLabels;  // go on behind what stands before them
  float behind_reach = 0.125F;     // of the width
  LabelSet hung = kPoleLabels | kSignLabels |
                  LabelSet::of(label::vegetation, label::static_object, label::dynamic_object);  // on one another
  // On the ground. No cars: one that is all at one distance would be a mirror for the own headlamps.
  LabelSet standing = kPoleLabels | LabelSet::of(label::person, label::rider, label::bicycle, label::motorcycle);
  float upright_reach = 0.01F;  // of the width: what hangs, and is farther from all measured of it, is upright
  float ground_outlier = 2;     // farther than this many times the near ground: filled anew; 0: kept
  int max_sweeps = 32;          // per level
  float tolerance = 1e-5F;      // stop when no inverse depth changes by more than this share of itself in one sweep
  float relaxation = 1.8F;      // of the over-relaxation, in (0, 2)
  float edge = 0.005F;          // slopes and curvatures of 1/z per pixel below this share of it count as squares
  float edge_inverse = 0;       // 1/m, on top: the noise of stereo is uniform in 1/z
  bool laser = false;           // the depth is a laser's: neighbouring points are joined, crowns levelled
  float same_surface = 0.06F;   // of 1/z, that neighbours on such a line differ by at most
};

[[nodiscard]] constexpr std::size_t fill_workspace_bytes(const FillParams&, Shape shape) noexcept {
  return kWorkspaceAlignment + allocation_bytes<float>(shape.pixels()) +
         allocation_bytes<std::int32_t>(shape.pixels()) + allocation_bytes<std::uint8_t>(shape.pixels()) +
         max_of(depth_detail::fill_pyramid_bytes(shape), depth_detail::carry_regions_bytes(shape));
}

[[nodiscard]] inline Status validate(const FillParams& params) noexcept {
  if (params.max_sweeps < 0 || params.max_sweeps > 100000) {
    return {StatusCode::invalid_argument, "fill_depth: max_sweeps must lie in 0..100000"};
  }
  if (!(params.behind_reach >= 0 && params.behind_reach <= 1 && params.upright_reach >= 0 &&
        params.upright_reach <= 1)) {
    return {StatusCode::invalid_argument, "fill_depth: behind_reach and upright_reach must lie in 0..1"};
  }
  if (!(params.tolerance >= 0) || !(params.relaxation > 0 && params.relaxation < 2)) {
    return {StatusCode::invalid_argument, "fill_depth: tolerance must not be negative, relaxation must lie in (0, 2)"};
  }
  if (!(params.edge > 0) || !(params.edge_inverse >= 0) || !(params.same_surface >= 0)) {
    return {StatusCode::invalid_argument,
            "fill_depth: edge must be positive, edge_inverse and same_surface not negative"};
  }
  if (!(params.ground_outlier == 0 || (params.ground_outlier >= 1 && params.ground_outlier <= 1e6F))) {
    return {StatusCode::invalid_argument, "fill_depth: ground_outlier must be 0 or lie in 1..1e6"};
  }
  return {};
}

namespace depth_detail {

// What is known of one label: range of inverse depth, and for planar labels the plane w = w0 + slope_u x + slope_v y.
struct FillClass {
  bool surface = true;
  bool plane = false;
  float low = 0;
  float high = 0;
  double w0 = 0;
  float slope_u = 0;
  float slope_v = 0;
};

struct FillState {
  ObjectMap objects;              // without labels: one class
  ImageView<float> w;             // inverse depth
  ImageView<std::int32_t> steps;  // length of the path to the pixel that a pixel started from; 0: valid or joined
  ImageView<std::uint8_t> kind;   // FillKind
  std::array<FillClass, 256> classes;

  [[nodiscard]] Label label_at(int x, int y) const noexcept {
    return objects.labels.empty() ? Label{0} : objects.labels(x, y);
  }
  [[nodiscard]] const FillClass& class_at(int x, int y) const noexcept { return classes[label_at(x, y)]; }
};

[[nodiscard]] inline bool is_fill_source(float z_m) noexcept { return z_m >= 1e-4F && z_m <= 1e6F; }

// Sums for the least-squares plane of one label, relative to the image centre.
struct PlaneSums {
  double n = 0, u = 0, v = 0, uu = 0, uv = 0, vv = 0, w = 0, uw = 0, vw = 0;
  int left = std::numeric_limits<int>::max(), right = -1, top = std::numeric_limits<int>::max(), bottom = -1;  // valid
  int label_left = std::numeric_limits<int>::max(), label_right = -1;
  int label_top = std::numeric_limits<int>::max(), label_bottom = -1;
};

// Least squares in inverse depth, which is linear in the image and where stereo noise is uniform. Fits the plane if the
// valid pixels determine it: at least 16, spread over a quarter of the label's extent each way.
inline void fit_plane(const PlaneSums& s, double u0, double v0, FillClass& c) noexcept {
  if (s.n < 16 || 4 * (s.right - s.left) < s.label_right - s.label_left ||
      4 * (s.bottom - s.top) < s.label_bottom - s.label_top) {
    return;
  }
  const double uu = s.uu - s.u * s.u / s.n;
  const double uv = s.uv - s.u * s.v / s.n;
  const double vv = s.vv - s.v * s.v / s.n;
  const double uw = s.uw - s.u * s.w / s.n;
  const double vw = s.vw - s.v * s.w / s.n;
  const double determinant = uu * vv - uv * uv;
  if (!(determinant > 1e-3 * uu * vv) || !(uu > 0) || !(vv > 0)) return;
  const double slope_u = (vv * uw - uv * vw) / determinant;
  const double slope_v = (uu * vw - uv * uw) / determinant;
  c.plane = true;
  c.slope_u = static_cast<float>(slope_u);
  c.slope_v = static_cast<float>(slope_v);
  c.w0 = (s.w - slope_u * s.u - slope_v * s.v) / s.n - slope_u * u0 - slope_v * v0;
}

// The sums of one label, over its sources.
[[nodiscard]] inline PlaneSums sum_plane(const FillState& state, std::size_t l, double u0, double v0) noexcept {
  PlaneSums s;
  for (int y = 0; y < state.w.height(); ++y) {
    for (int x = 0; x < state.w.width(); ++x) {
      if (state.label_at(x, y) != l) continue;
      s.label_left = x < s.label_left ? x : s.label_left;
      s.label_right = x > s.label_right ? x : s.label_right;
      s.label_top = y < s.label_top ? y : s.label_top;
      s.label_bottom = y > s.label_bottom ? y : s.label_bottom;
      if (state.steps(x, y) != 0) continue;
      s.left = x < s.left ? x : s.left;
      s.right = x > s.right ? x : s.right;
      s.top = y < s.top ? y : s.top;
      s.bottom = y > s.bottom ? y : s.bottom;
      const double u = x - u0;
      const double v = y - v0;
      const double w = static_cast<double>(state.w(x, y));
      s.n += 1;
      s.u += u;
      s.v += v;
      s.w += w;
      s.uu += u * u;
      s.uv += u * v;
      s.vv += v * v;
      s.uw += u * w;
      s.vw += v * w;
    }
  }
  return s;
}

[[nodiscard]] inline double plane_at(const FillClass& c, int x, int y) noexcept {
  return c.w0 + static_cast<double>(c.slope_u) * x + static_cast<double>(c.slope_v) * y;
}

// What is seen at more than `factor` times the distance of the ground plane lies far beneath the ground, whatever its
// label. That is a stereo mismatch where the plane is near, within four times its nearest distance; farther off it may
// be a slope. Such pixels stop being sources. Returns how many.
inline std::size_t drop_below_ground(FillState& state, const FillClass& plane, double nearest, double factor) noexcept {
  std::size_t dropped = 0;
  for (int y = 0; y < state.w.height(); ++y) {
    for (int x = 0; x < state.w.width(); ++x) {
      if (state.steps(x, y) != 0) continue;
      const double w = plane_at(plane, x, y);
      if (!(w > 0.25 * nearest) || !(factor * static_cast<double>(state.w(x, y)) < w)) continue;
      state.steps(x, y) = kUnreached;
      ++dropped;
    }
  }
  return dropped;
}

// Fits a plane to every planar label. The one with the most sources is the ground: it tells which measurements lie
// beneath it, and stands in for labels that determine no plane themselves. Returns the sources dropped.
inline std::size_t describe_ground(const FillParams& params, FillState& state) noexcept {
  const double u0 = 0.5 * state.w.width();
  const double v0 = 0.5 * state.w.height();
  const auto is_planar = [&](std::size_t l) {
    return state.classes[l].surface && params.planar.contains(static_cast<Label>(l));
  };
  FillClass ground;
  double most = 0;
  double nearest = 0;
  for (std::size_t l = 0; l < state.classes.size(); ++l) {
    if (!is_planar(l)) continue;
    FillClass& c = state.classes[l];
    const PlaneSums s = sum_plane(state, l, u0, v0);
    fit_plane(s, u0, v0, c);
    if (!c.plane || s.n <= most) continue;
    most = s.n;
    ground = c;
    // The plane is linear, so it is nearest at a corner of the label's extent.
    for (int corner = 0; corner < 4; ++corner) {
      const double w = plane_at(c, (corner & 1) != 0 ? s.label_right : s.label_left,
                                (corner & 2) != 0 ? s.label_bottom : s.label_top);
      nearest = w > nearest ? w : nearest;
    }
  }
  if (!ground.plane) return 0;
  const std::size_t dropped =
      params.ground_outlier > 0 ? drop_below_ground(state, ground, nearest, static_cast<double>(params.ground_outlier))
                                : 0;
  for (std::size_t l = 0; l < state.classes.size(); ++l) {
    if (!is_planar(l)) continue;
    FillClass& c = state.classes[l];
    if (dropped > 0) {
      c.plane = false;
      fit_plane(sum_plane(state, l, u0, v0), u0, v0, c);
    }
    if (c.plane) continue;
    c.plane = true;
    c.w0 = ground.w0;
    c.slope_u = ground.slope_u;
    c.slope_v = ground.slope_v;
    c.low = ground.low < c.low ? ground.low : c.low;
    c.high = ground.high > c.high ? ground.high : c.high;
  }
  return dropped;
}

// Copies valid depths as inverse depth and describes each label. Returns the number of sources.
[[nodiscard]] inline std::size_t describe_classes(const FillParams& params, ImageView<const float> depth,
                                                  FillState& state) noexcept {
  float low = std::numeric_limits<float>::max();
  float high = 0;
  for (std::size_t l = 0; l < state.classes.size(); ++l) {
    state.classes[l] = {};
    state.classes[l].surface = state.objects.labels.empty() || !params.no_surface.contains(static_cast<Label>(l));
    state.classes[l].low = low;
  }
  std::size_t sources = 0;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      FillClass& c = state.classes[state.label_at(x, y)];
      const bool source = c.surface && is_fill_source(depth(x, y));
      const float w = source ? 1.0F / depth(x, y) : 0.0F;
      state.steps(x, y) = source ? 0 : kUnreached;
      state.w(x, y) = w;
      if (!source) continue;
      ++sources;
      c.low = w < c.low ? w : c.low;
      c.high = w > c.high ? w : c.high;
      low = w < low ? w : low;
      high = w > high ? w : high;
    }
  }
  for (FillClass& c : state.classes) {
    if (c.high == 0) {
      c.low = low;
      c.high = high;
    }
    c.low *= 0.25F;
    c.high *= 4.0F;
  }
  if (!state.objects.labels.empty()) sources -= describe_ground(params, state);
  return sources;
}

enum class FillReach { same_object, any_surface, anything };

// One shortest-path relaxation of (x, y) from its neighbour; true if it improved.
[[nodiscard]] inline bool relax(FillState& state, FillReach reach, int x, int y, int from_x, int from_y) noexcept {
  if (state.steps(from_x, from_y) == kUnreached) return false;
  const FillClass& c = state.class_at(x, y);
  const bool same = state.objects.same(x, y, from_x, from_y);
  if (reach == FillReach::same_object && !(same && c.surface)) return false;
  if (reach != FillReach::same_object && state.kind(x, y) != kOrphan) return false;
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
  settle(state.w.shape(),
         [&](int x, int y, int from_x, int from_y) { return relax(state, reach, x, y, from_x, from_y); });
}

// Above a laser's last row each column of a crown stands upright on its own topmost sample, and leaves are metres
// before or behind those beside them: strips, of which one would throw its shadow on the next. Farther than half of
// kCrownReach from what was measured, the median over kCrownReach of the width to either side makes one crown of them,
// and the mean of what differs little a smooth one. What is narrower than the reach comes as far as what is beside it.
// row: the width.
inline void level_crowns(FillState& state, Span<float> row) noexcept {
  constexpr float kCrownReach = 1.0F / 32.0F;
  constexpr float kOneCrown = 0.25F;  // of 1/z
  constexpr int kSteps = 16;          // to either side
  const int width = state.w.width();
  const int reach = static_cast<int>(kCrownReach * static_cast<float>(width));
  for (int y = 0; y < state.w.height(); ++y) {
    const auto is_crown = [&](int x) {
      return state.kind(x, y) == kGiven && state.steps(x, y) > reach / 2 && state.label_at(x, y) == label::vegetation;
    };
    for (const bool median : {true, false}) {
      for (int x = 0; x < width; ++x) row[static_cast<std::size_t>(x)] = state.w(x, y);
      for (int x = 0; x < width; ++x) {
        if (!is_crown(x)) continue;
        const float own = row[static_cast<std::size_t>(x)];
        float seen[2 * kSteps + 1];
        int count = 0;
        float sum = 0.0F;
        for (int i = -kSteps; i <= kSteps; ++i) {
          const int u = x + i * reach / kSteps;
          if (u < 0 || u >= width || !is_crown(u)) continue;
          const float w = row[static_cast<std::size_t>(u)];
          if (!median && !(std::fabs(w - own) < kOneCrown * own)) continue;
          seen[count++] = w;
          sum += w;
        }
        if (median) select_nth(seen, seen + count / 2, seen + count);
        state.w(x, y) = median ? seen[count / 2] : sum / static_cast<float>(count);
      }
    }
  }
}

// A start value for every pixel: from its region, else from its class' plane, else from what it is a part of
// (detail/fill/orphans.hpp), else from any surface, else from anything.
[[nodiscard]] inline Status initialise(const FillParams& params, FillState& state, Workspace& workspace) noexcept {
  spread(state, FillReach::same_object);
  const bool labelled = !state.objects.labels.empty();
  const auto far = static_cast<std::int32_t>(params.upright_reach * static_cast<float>(state.w.width()));
  for (int y = 0; y < state.w.height(); ++y) {
    for (int x = 0; x < state.w.width(); ++x) {
      const FillClass& c = state.class_at(x, y);
      state.kind(x, y) = !c.surface ? kNothing : (state.steps(x, y) == 0 ? kGiven : kFree);
      if (state.steps(x, y) != kUnreached) {
        const bool upright = labelled && params.hung.contains(state.label_at(x, y));
        if (upright && state.steps(x, y) > far) state.kind(x, y) = kGiven;
        continue;
      }
      if (c.plane) {
        state.w(x, y) = static_cast<float>(plane_at(c, x, y));
        state.steps(x, y) = 1;
      } else {
        state.kind(x, y) = kOrphan;
      }
    }
  }
  if (labelled) {
    if (params.laser) {
      const WorkspaceScope scope(workspace);
      Span<float> row;
      NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(state.w.width()), row));
      level_crowns(state, row);
    }
    const OrphanView orphans{state.objects, state.w, state.steps, state.kind};
    const float reach = params.behind_reach * static_cast<float>(state.w.width());
    continue_behind(params.behind, static_cast<int>(reach), orphans);
    NPSIM_RETURN_IF_ERROR(hang_on_supports(params.hung, orphans, workspace));
    NPSIM_RETURN_IF_ERROR(stand_on_ground(params.standing, params.planar, orphans, workspace));
  }
  spread(state, FillReach::any_surface);
  spread(state, FillReach::anything);
  return {};
}

}  // namespace depth_detail

// objects: empty views, or the shape of depth. output: the shape of depth; it may be the same memory. filled: empty, or
// gets 1 where a depth was made up and 0 elsewhere. Status no_valid_input if no surface pixel has a usable depth; then
// the outputs are untouched.
template <class Executor>
[[nodiscard]] Status fill_depth(const FillParams& params, ImageView<const float> depth, const ObjectMap& objects,
                                ImageView<float> output, ImageView<std::uint8_t> filled, Workspace& workspace,
                                Executor& executor) noexcept {
  using namespace depth_detail;
  NPSIM_RETURN_IF_ERROR(validate(params));
  if (depth.empty()) return {StatusCode::no_valid_input, "fill_depth: the depth image is empty"};
  const Shape shape = depth.shape();
  if (output.empty() || output.shape() != shape || !objects.fits(shape) ||
      (!filled.empty() && filled.shape() != shape)) {
    return {StatusCode::shape_mismatch, "fill_depth: labels and outputs must have the shape of the depth"};
  }

  const WorkspaceScope scope(workspace);
  FillState state;
  state.objects = objects;
  const auto rows = static_cast<std::size_t>(shape.height);
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, state.w));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, state.steps));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, state.kind));
  if (describe_classes(params, depth, state) == 0) {
    return {StatusCode::no_valid_input, "fill_depth: no pixel of a surface has a usable depth"};
  }
  if (params.laser) join_scan_lines(params.same_surface, objects, state.w, state.steps);
  NPSIM_RETURN_IF_ERROR(initialise(params, state, workspace));
  std::array<FillSlope, 256> slopes;
  for (std::size_t l = 0; l < slopes.size(); ++l) {
    const FillClass& c = state.classes[l];
    slopes[l] = {static_cast<float>(c.w0), c.slope_u, c.slope_v, c.low, c.high, c.plane};
  }
  const FillSmoothness smoothness{params.edge, params.edge_inverse, params.relaxation, params.max_sweeps,
                                  params.tolerance};
  NPSIM_RETURN_IF_ERROR(fill_second_order(smoothness, objects, Span<const FillSlope>(slopes.data(), slopes.size()),
                                          state.w, state.kind, workspace, executor));
  executor.for_chunks(rows, kFillChunkRows, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const FillClass& c = state.class_at(x, y);
        const bool dropped = state.steps(x, y) != 0 && is_fill_source(depth(x, y));
        const bool keep = c.surface && is_valid_depth(depth(x, y)) && !dropped;
        // What carries a thing may be nearer than all that was measured of its label.
        const float w = state.kind(x, y) == kGiven ? state.w(x, y) : clamp_to(state.w(x, y), c.low, c.high);
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
