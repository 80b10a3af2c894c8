// SPDX-License-Identifier: Apache-2.0
// What the camera does not see, section 3.5.2: the background behind objects, and objects over uncertain pixels.
#ifndef NPSIM_MESH_COMPLETE_HPP
#define NPSIM_MESH_COMPLETE_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/background/anchors.hpp"
#include "npsim/mesh/detail/components.hpp"
#include "npsim/mesh/detail/foreground/objects.hpp"
#include "npsim/mesh/detail/layer.hpp"
#include "npsim/mesh/detail/rows.hpp"
#include "npsim/mesh/detail/street/background.hpp"
#include "npsim/mesh/detail/street/floor.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Completes the background behind foreground objects (section 3.5.2 and Algorithm 1).
//
// Region to complete: the uncertain pixels, the foreground (every segment, or as the thesis has it those that touch an
// uncertain pixel; a segment is a connected component of one label), and surface pixels that have no vertex. What is
// left of the sheet is kept; a run is a row's piece of the region. Three ways to fill it:
//   - street, the default: floor or something upright on it, whichever is nearer, from kept vertices left, right, above
//     and below (detail/street/);
//   - linear_position, as printed: between two kept vertices linearly, with Algorithm 1's weights;
//   - linear_inverse_depth: the same in inverse depth, which is linear in the image for a plane and leaves vertices on
//     the rays of their pixels.
// By rows alone, a run with one kept vertex, its other end the image border or the sky, goes along the plane fitted in
// inverse depth to the kept vertices around it, the depth clamped to a factor of the anchor's; with too few vertices
// for a plane, at constant depth. Two anchors whose depths differ by more than max_join_ratio belong to different
// surfaces: each is continued by its plane to the middle, where one steep quad closes the sheet behind the object.
//
// Invariant: kept vertices are bitwise those of the sheet; a run with an anchor is filled completely; one between sky
// and sky, or sky and border, not at all; one from border to border only as far as its columns tell (street). All faces
// that the vertices allow exist. Vertices of a row stay in the order of their columns, hence every face has its front
// towards the camera (interpolating position, as long as two anchors' depths differ by less than a factor of
// 2^20 / fx; beyond, a face seen edge-on may round to the other side). Rows, and strips of columns, are independent:
// any order, same bits.
// Cost: one pass over sheet and masks, one over the vertices, the rest by what is missing, with (2 fit_radius_px + 1)^2
// samples per run that is not joined: for streets at 1920x1080 about four times a memcpy of what is written. The
// thesis' region: four passes over the labels, and two more for each further turn of a spiral or tooth of a
// serpentine in one segment: a hundred times as much for a picture that is one serpentine.
// Memory: street two ranges per row, else none.
// Error: street, behind the objects of eight generated streets, from true depth: within 3 % of the truth on .74 to .90
// of the pixels at 960x540, .83 on average (by rows alone .26 to .48). What is hidden entirely, such as a bin behind a
// car, cannot be known: of what is wrong there, it is a quarter to a half. On planes: floor and upright walls 1e-4. By
// rows, between two anchors: half an ulp in inverse depth; in position each component 3 * 2^-24 of the larger anchor's.

enum class BackgroundInterpolation : std::uint8_t { linear_position, linear_inverse_depth, street };
enum class BackgroundRegion : std::uint8_t { touching_segments, all_foreground };

struct BackgroundParams {
  BackgroundInterpolation interpolation = BackgroundInterpolation::street;
  BackgroundRegion region = BackgroundRegion::all_foreground;
  LabelSet foreground = kForegroundLabels;  // section 3.4.2
  float max_join_ratio = 4.0F;              // > 1, or 0: join any two anchors. Our choice, not in the thesis
  float max_extension_ratio = 2.0F;         // >= 1. A house front 700 px from its vanishing point, 300 px on, is 1.4
  int fit_radius_px = 4;                    // 1 .. 64
  float fit_tolerance = 0.25F;  // > 0: inverse depths this much off the anchor's, relatively, are another surface

  StreetFloorParams floor;  // street only, as is the next
  StreetBackgroundParams street;

  // The text as printed; it does not say what happens at borders, so that part is shared.
  [[nodiscard]] static constexpr BackgroundParams thesis() noexcept {
    BackgroundParams params;
    params.interpolation = BackgroundInterpolation::linear_position;
    params.region = BackgroundRegion::touching_segments;
    params.max_join_ratio = 0.0F;
    return params;
  }
};

// What is completed. Masks may be empty views: nothing uncertain; surface everywhere. A foreground pixel is completed
// whatever its surface says: the mask speaks of what is seen there, not of what is behind.
struct BackgroundInput {
  ImageView<const Vec3f> sheet;  // vertices of build_sheet(); may be those that are written
  ImageView<const Label> labels;
  ImageView<const std::uint8_t> uncertain;
  ImageView<const std::uint8_t> surface;
  Intrinsics intrinsics;
};

[[nodiscard]] constexpr std::size_t complete_background_workspace_bytes(const BackgroundParams& params,
                                                                        Shape shape) noexcept {
  if (shape.empty()) return kWorkspaceAlignment;
  const bool kerbs = params.interpolation == BackgroundInterpolation::street;
  return (kerbs ? allocation_bytes<KerbRange>(2 * static_cast<std::size_t>(shape.height)) : 0) + kWorkspaceAlignment;
}

[[nodiscard]] inline Status validate(const BackgroundParams& params) noexcept {
  const bool join =
      params.max_join_ratio == 0.0F || (params.max_join_ratio > 1.0F && std::isfinite(params.max_join_ratio));
  const bool extension = params.max_extension_ratio >= 1.0F && std::isfinite(params.max_extension_ratio);
  const bool fit = params.fit_radius_px >= 1 && params.fit_radius_px <= kMaxFitRadius && params.fit_tolerance > 0.0F &&
                   std::isfinite(params.fit_tolerance);
  const auto from = [](float v, float least) { return v >= least && std::isfinite(v); };
  const bool street = from(params.street.join_ratio, 1.0F) && params.street.above_weight > 0.0F &&
                      std::isfinite(params.street.above_weight) && from(params.street.floor_tolerance, 1.0F) &&
                      from(params.street.same_ratio, 1.0F) && from(params.street.trunk_width_m, 0.0F) &&
                      params.street.farthest_floor > 0.0F && std::isfinite(params.street.farthest_floor) &&
                      from(params.floor.kerb_height_m, 0.0F) && from(params.floor.kerb_clearance_m, 0.0F);
  return join && extension && fit && street
             ? Status()
             : Status(StatusCode::invalid_argument, "a background completion parameter is out of range");
}

namespace mesh_detail {

// Rows are connected while they are still in the cache; those on either side of two chunks afterwards.
template <class F, class Executor>
void complete_street(const BackgroundParams& params, const StreetBackground& street, const SheetLayer& background,
                     Executor& executor) {
  const Shape shape = background.vertices.shape();
  executor.for_chunks(static_cast<std::size_t>(shape.width), static_cast<std::size_t>(kStreetColumns),
                      [&](std::size_t begin, std::size_t end) {
                        street.columns.guess<F>(static_cast<int>(begin), static_cast<int>(end));
                      });
  const auto slope = [&](int x, int y) {
    return inverse_depth_slope<F>(params.fit_radius_px, params.fit_tolerance, background.vertices, street.columns.state,
                                  x, y);
  };
  const auto connect = [&](int begin, int end) {
    for (int x = 0; x < shape.width && !background.quads.empty(); x += kStripColumns) {
      connect_strip<F>(shape, background.quads, x, begin, end, [&](int y, int x0, int n, float* z, int) {
        read_depths<F>(background.vertices.row(y) + x0, n, z);
      });
    }
  };
  for_row_chunks(executor, shape.height, [&](int begin, int end) {
    street.fill<F>(begin, end, slope);
    connect(begin, end - 1);
  });
  for_row_chunks(executor, shape.height, [&](int, int end) {
    if (end < shape.height) connect(end - 1, end);
  });
}

// A run between two anchors of one surface.
inline void join_anchors(BackgroundInterpolation interpolation, const Intrinsics& intrinsics, int l, int r, int y,
                         Vec3f* row) noexcept {
  const auto zl = static_cast<double>(row[l - 1].z);
  const auto zr = static_cast<double>(row[r + 1].z);
  for (int j = l; j <= r; ++j) {
    if (interpolation == BackgroundInterpolation::linear_position) {
      row[j] = between_anchors(row[l - 1], row[r + 1], l, r, j);
    } else {
      // 1 / (wl a / n + wr b / n), w = 1 / z, without leaving float range: n zl zr / (zr a + zl b).
      const double a = r - j + 1;
      const double b = j - l + 1;
      row[j] = unproject_pixel(intrinsics, j, y, static_cast<float>((a + b) * zl * zr / (zr * a + zl * b)));
    }
  }
}

// Columns first .. last along the plane through the anchor at anchor_x.
template <class F>
void extend_anchor(const BackgroundParams& params, const Intrinsics& intrinsics, ImageView<const std::uint8_t> state,
                   ImageView<Vec3f> vertices, int anchor_x, int y, int first, int last) noexcept {
  if (first > last) return;
  const double slope = inverse_depth_slope<F>(params.fit_radius_px, params.fit_tolerance, vertices, state, anchor_x, y);
  const double w = 1.0 / static_cast<double>(vertices(anchor_x, y).z);
  const auto ratio = static_cast<double>(params.max_extension_ratio);
  for (int j = first; j <= last; ++j) {
    const double extended = w + slope * static_cast<double>(j - anchor_x);
    vertices(j, y) =
        unproject_pixel(intrinsics, j, y, static_cast<float>(1.0 / clamp_to(extended, w / ratio, w * ratio)));
  }
}

// Every run of row y from the anchors at its ends.
template <class F>
void complete_row(const BackgroundParams& params, const Intrinsics& intrinsics, ImageView<const std::uint8_t> state,
                  ImageView<Vec3f> vertices, int y) noexcept {
  for_missing_runs(state.row(y), vertices.width(), [&](int l, int r, bool left, bool right) {
    if (left && right) {
      const float zl = vertices(l - 1, y).z;
      const float zr = vertices(r + 1, y).z;
      const float ratio = params.max_join_ratio;
      if (ratio == 0.0F || std::max(zl, zr) <= ratio * std::min(zl, zr)) {
        return join_anchors(params.interpolation, intrinsics, l, r, y, vertices.row(y));
      }
    }
    const int half = left && right ? (l + r) / 2 : (left ? r : l - 1);  // last column that goes on from the left
    if (left) extend_anchor<F>(params, intrinsics, state, vertices, l - 1, y, l, half);
    if (right) extend_anchor<F>(params, intrinsics, state, vertices, r + 1, y, half + 1, r);
  });
}

}  // namespace mesh_detail

// state: row_state of every pixel.
template <class F = simd::F32, class Executor>
[[nodiscard]] Status complete_background(const BackgroundParams& params, const BackgroundInput& in,
                                         const SheetLayer& background, ImageView<std::uint8_t> state,
                                         Workspace& workspace, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(in.intrinsics));
  NPSIM_RETURN_IF_ERROR(validate(background));
  const Shape shape = background.vertices.shape();
  if (in.sheet.data() == nullptr || in.sheet.shape() != shape || in.labels.data() == nullptr ||
      in.labels.shape() != shape || state.data() == nullptr || state.shape() != shape ||
      !mesh_detail::mask_fits(in.uncertain, shape) || !mesh_detail::mask_fits(in.surface, shape)) {
    return {StatusCode::shape_mismatch, "sheet, labels, masks, states and background must have one shape"};
  }
  const bool all = params.region == BackgroundRegion::all_foreground;
  if (!all) mesh_detail::mark_touching_segments(params.foreground, in.labels, in.uncertain, state);
  const bool by_street = params.interpolation == BackgroundInterpolation::street;
  for_rows(executor, shape.height, [&](int y) {
    const bool blocked_vertex = mesh_detail::find_states<F>(
        all ? &params.foreground : nullptr, in.labels.row(y),
        in.uncertain.data() != nullptr ? in.uncertain.row(y) : nullptr,
        in.surface.data() != nullptr ? in.surface.row(y) : nullptr, in.sheet.row(y), shape.width, state.row(y));
    if (!by_street) return;
    // What is missing may stay as it is for now: all of it is written later, and the kerbs look for vehicles there.
    Vec3f* row = background.vertices.row(y);
    if (row != in.sheet.row(y)) std::copy(in.sheet.row(y), in.sheet.row(y) + shape.width, row);
    for (int x = 0; x < shape.width && blocked_vertex; ++x) {
      if (state(x, y) == row_state::blocked) row[x] = {};
    }
  });
  // From here on only kept vertices are read, and only the others written: rows cannot disturb each other.
  if (by_street) {
    StreetFloor floor;
    NPSIM_RETURN_IF_ERROR(mesh_detail::find_floor<F>(params.floor, background.vertices, in.labels, in.uncertain, state,
                                                     in.intrinsics, workspace, executor, floor));
    const mesh_detail::KeptFloor kept{params.floor, floor, static_cast<double>(params.street.floor_tolerance),
                                      in.labels};
    mesh_detail::complete_street<F>(
        params,
        {params.street,
         params.max_extension_ratio,
         in.intrinsics,
         {kept, state, background.vertices, params.street.trunk_width_m * in.intrinsics.fx}},
        background, executor);
    return {};
  }
  for_rows(executor, shape.height, [&](int y) {
    mesh_detail::keep_known<F>(state.row(y), in.sheet.row(y), shape.width, background.vertices.row(y));
  });
  for_rows(executor, shape.height,
           [&](int y) { mesh_detail::complete_row<F>(params, in.intrinsics, state, background.vertices, y); });
  mesh_detail::connect_layer<F>(background, executor);
  return {};
}

// Completes foreground objects over their uncertain pixels (section 3.5.2): one sheet per object, all in one layer.
//
// An object is a connected component (4-neighbourhood) of foreground pixels with one label and, where instance ids are
// given, one instance. Its kept vertices are the sheet's at certain pixels. From them a breadth-first search enters the
// object's other pixels: a new vertex gets the mean depth of its neighbours of earlier levels, in the same object.
// An object without any kept vertex (thinner than the uncertain band around its outline: poles, far persons) would
// vanish; it stands at one depth, the median of its own pixels' (the lower one of two), and stays empty only if it has
// no valid depth at all. Faces join vertices of one object.
//
// A sheet spans pixel centres, so what is one pixel wide has no face. With widen_thin such a pixel lends its depth to
// a free pixel beside it (right, else left; for what is one pixel high below, else above), so that a pole of one pixel
// casts a shadow. The pixels added carry the object's id but another label.
//
// Invariant: a layer has one vertex a pixel at most, no face joins two objects, objects are numbered 1, 2, ... in
// raster order. Levels, not the order of visits, define the means: the result is a function of the input alone.
// Cost: about the time of copying the output, and tens of instructions for each pixel at the rim of a run of pixels, in
// doubt, or without one of its neighbours; numbering and growth are serial. Memory: half a byte a pixel, in whole words
// of 64 pixels a row; the rest is done in the outputs (detail/components.hpp, detail/foreground/objects.hpp). Error: of
// a mean, half an ulp each level, and of unproject().

struct ForegroundParams {
  LabelSet foreground = kForegroundLabels;  // section 3.4.2
  bool widen_thin = true;                   // ours, see above

  [[nodiscard]] static constexpr ForegroundParams thesis() noexcept { return {kForegroundLabels, false}; }
};

// Every value is valid.
[[nodiscard]] constexpr Status validate(const ForegroundParams&) noexcept { return {}; }

// What objects are made from: the sheet is that of build_sheet(), so its parameters, depth and surface are asked for
// again. Views that may be empty are marked.
struct ForegroundInput {
  SheetParams sheet;
  ImageView<const float> depth;           // m
  ImageView<const std::uint8_t> surface;  // empty: surface everywhere
  ImageView<const Label> labels;
  ImageView<const std::uint16_t> instances;  // empty: labels alone tell objects apart
  ImageView<const std::uint8_t> uncertain;   // empty: nothing is
  // The states that complete_background() wrote; foreground that it kept (thesis preset: segments far from any
  // uncertain pixel) belongs to the background layer and makes no object. Empty: every foreground pixel is an object's.
  ImageView<const std::uint8_t> background_state;
  Intrinsics intrinsics;
};

[[nodiscard]] constexpr std::size_t complete_foreground_workspace_bytes(const ForegroundParams&, Shape shape) noexcept {
  return 4 * pixel_bits_bytes(shape) + kWorkspaceAlignment;
}

// object: the number of each pixel's object, 0 outside.
template <class F = simd::F32, class Executor>
[[nodiscard]] Status complete_foreground(const ForegroundParams& params, const ForegroundInput& in,
                                         const SheetLayer& foreground, ImageView<std::uint32_t> object,
                                         Workspace& workspace, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(in.sheet));
  NPSIM_RETURN_IF_ERROR(validate(in.intrinsics));
  NPSIM_RETURN_IF_ERROR(validate(foreground));
  const Shape shape = foreground.vertices.shape();
  if (in.depth.data() == nullptr || in.depth.shape() != shape || in.labels.data() == nullptr ||
      in.labels.shape() != shape || object.data() == nullptr || object.shape() != shape ||
      !mesh_detail::mask_fits(in.surface, shape) || !mesh_detail::mask_fits(in.instances, shape) ||
      !mesh_detail::mask_fits(in.uncertain, shape) || !mesh_detail::mask_fits(in.background_state, shape)) {
    return {StatusCode::shape_mismatch, "depth, labels, instances, masks, object and foreground must have one shape"};
  }
  if (shape.pixels() >= 0x80000000U) return {StatusCode::capacity_exceeded, "the image has 2^31 pixels or more"};
  const WorkspaceScope scope(workspace);
  mesh_detail::ObjectPixels planes;
  planes.pixels = foreground.vertices;
  NPSIM_RETURN_IF_ERROR(mesh_detail::allocate_links(shape, workspace, planes.links));
  NPSIM_RETURN_IF_ERROR(mesh_detail::allocate_bits(shape, workspace, planes.known));
  const mesh_detail::ForegroundSource source{{in.sheet, in.depth, in.surface, in.intrinsics},
                                             params.foreground,
                                             in.labels,
                                             in.instances,
                                             in.uncertain,
                                             in.background_state};
  for_rows(executor, shape.height, [&](int y) { mesh_detail::find_objects<F>(source, planes, y); });
  for_rows(executor, shape.height, [&](int y) {
    for (int w = 0; y > 0 && w < planes.known.width(); ++w) planes.links.above(w, y) &= planes.links.member(w, y - 1);
  });
  std::uint32_t count = 0;
  NPSIM_RETURN_IF_ERROR(label_components(planes.links, object, count));
  mesh_detail::grow_objects(planes);
  mesh_detail::stand_up_uncertain(planes);
  // Now every member is known; the plane that said so takes the pixels with an object.
  const ImageView<std::uint64_t> present = planes.known;
  if (params.widen_thin) {
    for_rows(executor, shape.height,
             [&](int y) { mesh_detail::widen_thin(planes.links, present, foreground.vertices, object, y); });
  }
  for_rows(executor, shape.height,
           [&](int y) { mesh_detail::unproject_row<F>(in.intrinsics, present, foreground.vertices, y); });
  for_rows(executor, quad_shape(shape).height,
           [&](int y) { mesh_detail::connect_objects<F>(present, object, foreground, y); });
  return {};
}

// Row-wise interpolation of an attribute over missing pixels, with the weights of Algorithm 1: how the albedo behind an
// object is guessed along with its geometry, from the states that complete_background() wrote.
//
// A run of missing pixels l .. r in a row, between the known pixels l - 1 and r + 1, gets at column j
//   (known[l-1] (r - j + 1) + known[r+1] (j - l + 1)) / (r - l + 2).
// With one known end the run takes its value, with none it stays as it is. A blocked pixel (sky) is neither a source
// nor a target, and ends a run.
// Invariant: known and blocked pixels are not touched. Cost: one pass, rows in parallel. Memory: none.
// Error: 3 * 2^-24 of the larger of the two known values.
template <class Executor>
[[nodiscard]] Status interpolate_rows(ImageView<const std::uint8_t> state, ImageView<Vec3f> attribute,
                                      Executor& executor) {
  if (attribute.empty()) return {StatusCode::invalid_argument, "the attribute needs at least one pixel"};
  if (state.data() == nullptr || state.shape() != attribute.shape()) {
    return {StatusCode::shape_mismatch, "states and attribute must have one shape"};
  }
  for_rows(executor, attribute.height(), [&](int y) {
    Vec3f* row = attribute.row(y);
    mesh_detail::for_missing_runs(state.row(y), attribute.width(), [row](int l, int r, bool left, bool right) {
      for (int j = l; j <= r && (left || right); ++j) {
        row[j] = left && right ? mesh_detail::between_anchors(row[l - 1], row[r + 1], l, r, j)
                               : (left ? row[l - 1] : row[r + 1]);
      }
    });
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_COMPLETE_HPP
