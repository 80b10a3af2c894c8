// SPDX-License-Identifier: Apache-2.0
// Gives the ground what lies on it and was labelled as a thing that stands.
//
// Networks take the stripes of a crossing for signs, arrows for persons and patches for objects. What follows from such
// a label would set them upright in the road. Where the depth knows better it decides: a connected piece of one such
// label, kLies of whose measured pixels, at least kFewest, are within ground_within_m() of the ground plane, is of that
// class of ground that borders on it most, and of label::ground where none does.
// Invariant: pieces in which a lamp was marked stay.
// Cost: a pass for each class of things that there is, and some operations per pixel of things.
// Memory: ground_markings_workspace_bytes().
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_GROUND_MARKINGS_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_GROUND_MARKINGS_HPP

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/ground_level.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

[[nodiscard]] constexpr std::size_t ground_markings_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<std::uint32_t>(shape.pixels()) + allocation_bytes<std::uint8_t>(shape.pixels()) +
         kWorkspaceAlignment;
}

namespace depth_detail {

inline constexpr LabelSet kTakenToStand = kForegroundLabels | LabelSet::of(label::static_object, label::dynamic_object);
inline constexpr float kLies = 0.8F;
inline constexpr int kFewest = 8;

// The class of ground that a piece is of; unlabeled: it is not of the ground.
[[nodiscard]] inline Label ground_of_piece(ImageView<const float> depth, const Intrinsics& camera,
                                           const GroundPlane& ground, ImageView<const std::uint16_t> marks,
                                           ImageView<const Label> labels, Span<const std::uint32_t> piece) noexcept {
  const float most_m = ground_within_m(ground);
  const auto width = static_cast<std::uint32_t>(labels.width());
  std::array<int, kLabelCount> beside{};
  int measured = 0;
  int low = 0;
  for (const std::uint32_t p : piece) {
    const auto x = static_cast<int>(p % width);
    const auto y = static_cast<int>(p / width);
    if (!marks.empty() && marks(x, y) != 0) return label::unlabeled;
    for (const auto& [i, j] :
         {std::array{x - 1, y}, std::array{x + 1, y}, std::array{x, y - 1}, std::array{x, y + 1}}) {
      if (labels.contains(i, j) && kGroundLabels.contains(labels(i, j))) ++beside[labels(i, j)];
    }
    if (!is_valid_depth(depth(x, y))) continue;
    ++measured;
    low += std::fabs(height_above_ground(ground, unproject_pixel(camera, x, y, depth(x, y)))) < most_m ? 1 : 0;
  }
  if (measured < kFewest || static_cast<float>(low) < kLies * static_cast<float>(measured)) return label::unlabeled;
  Label most = label::ground;
  for (std::size_t l = 0; l < beside.size(); ++l) {
    if (beside[l] > beside[most]) most = static_cast<Label>(l);
  }
  return most;
}

}  // namespace depth_detail

// labels: in place. depth: as it was measured, 0 where it was not. marks of lamps: 0: none; may be empty.
[[nodiscard]] inline Status lay_markings(ImageView<const float> depth, const Intrinsics& camera,
                                         const GroundPlane& ground, ImageView<const std::uint16_t> marks,
                                         ImageView<Label> labels, Workspace& workspace) noexcept {
  const Shape shape = labels.shape();
  if (depth.shape() != shape || (!marks.empty() && marks.shape() != shape)) {
    return {StatusCode::shape_mismatch, "ground markings: all planes must have one shape"};
  }
  if (!(ground.inlier_share > 0.0F)) return {};
  const WorkspaceScope scope(workspace);
  ImageView<std::uint8_t> open;
  Span<std::uint32_t> list;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, open));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), list));
  LabelSet there;
  for (const Label l : labels.pixels()) there = there | LabelSet::of(l);
  for (Label thing = 0; thing < kLabelCount; ++thing) {
    if (!there.contains(thing) || !depth_detail::kTakenToStand.contains(thing)) continue;
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) open(x, y) = labels(x, y) == thing ? 1 : 0;
    }
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (open(x, y) == 0) continue;
        const Span<const std::uint32_t> piece = list.sub(0, take_piece(open, x, y, list));
        const Label l = depth_detail::ground_of_piece(depth, camera, ground, marks, labels, piece);
        if (l == label::unlabeled) continue;
        for (const std::uint32_t p : piece) labels.pixels()[p] = l;
      }
    }
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_GROUND_MARKINGS_HPP
