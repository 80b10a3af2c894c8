// SPDX-License-Identifier: Apache-2.0
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
#ifndef NPSIM_MESH_COMPLETE_FOREGROUND_HPP
#define NPSIM_MESH_COMPLETE_FOREGROUND_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/components.hpp"
#include "npsim/mesh/detail/foreground/objects.hpp"
#include "npsim/mesh/detail/layer.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_COMPLETE_FOREGROUND_HPP
