// SPDX-License-Identifier: Apache-2.0
// Gives the ground what lies on it and was labelled as a sign, a pole or an object.
//
// Networks take the stripes of a crossing for signs and patches for objects. What follows from such a label would set
// them upright in the road. Where the depth knows better it decides. A connected piece of one such label lies on the
// ground if all its rays meet the ground plane, and of its upper and of its lower half alike kLies of the measured
// pixels, at least kFewest, are within ground_within_m() of it and 1/z grows from the one to the other by more than half
// of what it does on the plane; of what stands it does not grow. It is then of that class of ground that borders on it
// most, and of label::ground where none does.
// Invariant: pieces with numbers of their own or in which a lamp was marked stay.
// Cost: two passes over the labels, some operations per pixel of things.
// Memory: ground_markings_workspace_bytes().
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_GROUND_MARKINGS_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_GROUND_MARKINGS_HPP

#include <algorithm>
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

inline constexpr LabelSet kTakenToStand =
    kSignLabels | kPoleLabels | LabelSet::of(label::static_object, label::dynamic_object);
inline constexpr float kLies = 0.8F;
inline constexpr int kFewest = 4;

struct MarkingScene {
  ImageView<const float> depth;
  Intrinsics camera;
  GroundPlane ground;
  ImageView<const std::uint16_t> instances, marks;  // may be empty

  [[nodiscard]] bool is_named(int x, int y) const noexcept {
    return (!instances.empty() && instances(x, y) != 0) || (!marks.empty() && marks(x, y) != 0);
  }
};

// The upper or the lower half of a piece.
struct MarkingHalf {
  int measured = 0;
  int low = 0;
  double inverse_depth = 0;           // sum over the measured pixels, 1/m
  double inverse_depth_of_plane = 0;  // likewise

  [[nodiscard]] bool lies() const noexcept {
    return measured >= kFewest && static_cast<float>(low) >= kLies * static_cast<float>(measured);
  }
};

[[nodiscard]] inline bool lies_on_ground(const MarkingScene& scene, int width,
                                         Span<const std::uint32_t> piece) noexcept {
  int top = place_of(piece[0], width).y;
  int bottom = top;
  for (const std::uint32_t p : piece) {
    top = std::min(top, place_of(p, width).y);
    bottom = std::max(bottom, place_of(p, width).y);
  }
  MarkingHalf halves[2];
  for (const std::uint32_t p : piece) {
    const auto [x, y] = place_of(p, width);
    const float fall = fall_of_ray(scene.ground, scene.camera, x, y);
    if (!(fall > 0.0F) || scene.is_named(x, y)) return false;
    const float z = scene.depth(x, y);
    if (!is_valid_depth(z)) continue;
    MarkingHalf& half = halves[2 * y > top + bottom ? 1 : 0];
    ++half.measured;
    half.low += std::fabs(scene.ground.camera_height_m - fall * z) < ground_within_m(scene.ground) ? 1 : 0;
    half.inverse_depth += static_cast<double>(1.0F / z);
    half.inverse_depth_of_plane += static_cast<double>(fall / scene.ground.camera_height_m);
  }
  if (!halves[0].lies() || !halves[1].lies()) return false;
  const auto upper = static_cast<double>(halves[0].measured);
  const auto lower = static_cast<double>(halves[1].measured);
  return halves[1].inverse_depth / lower - halves[0].inverse_depth / upper >
         0.5 * (halves[1].inverse_depth_of_plane / lower - halves[0].inverse_depth_of_plane / upper);
}

// The class of ground that borders on a piece most.
[[nodiscard]] inline Label ground_beside(ImageView<const Label> labels, Span<const std::uint32_t> piece) noexcept {
  std::array<int, kLabelCount> beside{};
  for (const std::uint32_t p : piece) {
    const auto [x, y] = place_of(p, labels.width());
    for (const auto& [i, j] :
         {std::array{x - 1, y}, std::array{x + 1, y}, std::array{x, y - 1}, std::array{x, y + 1}}) {
      if (labels.contains(i, j) && kGroundLabels.contains(labels(i, j))) ++beside[labels(i, j)];
    }
  }
  Label most = label::ground;
  for (std::size_t l = 0; l < beside.size(); ++l) {
    if (beside[l] > beside[most]) most = static_cast<Label>(l);
  }
  return most;
}

}  // namespace depth_detail

// labels: in place. depth: as it was measured, 0 where it was not. instances, marks of lamps: 0: none; may be empty.
[[nodiscard]] inline Status lay_markings(ImageView<const float> depth, const Intrinsics& camera,
                                         const GroundPlane& ground, ImageView<const std::uint16_t> instances,
                                         ImageView<const std::uint16_t> marks, ImageView<Label> labels,
                                         Workspace& workspace) noexcept {
  const Shape shape = labels.shape();
  const auto fits = [&](ImageView<const std::uint16_t> plane) { return plane.empty() || plane.shape() == shape; };
  if (depth.shape() != shape || !fits(instances) || !fits(marks)) {
    return {StatusCode::shape_mismatch, "ground markings: all planes must have one shape"};
  }
  if (!(ground.inlier_share > 0.0F)) return {};
  const WorkspaceScope scope(workspace);
  ImageView<std::uint8_t> open;
  Span<std::uint32_t> list;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, open));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), list));
  const depth_detail::MarkingScene scene{depth, camera, ground, instances, marks};
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      open(x, y) = depth_detail::kTakenToStand.contains(labels(x, y)) ? labels(x, y) : std::uint8_t{0};
    }
  }
  for_pieces(open, list, [&](Span<const std::uint32_t> piece) {
    if (!depth_detail::lies_on_ground(scene, shape.width, piece)) return;
    const Label l = depth_detail::ground_beside(labels, piece);
    for (const std::uint32_t p : piece) labels(place_of(p, shape.width)) = l;
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_GROUND_MARKINGS_HPP
