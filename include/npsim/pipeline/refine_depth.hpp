// SPDX-License-Identifier: Apache-2.0
// Section 3.4: the depth refinement kernel, from the depth as given to one that a mesh can be built on.
//
//   drop outliers, fill -> sharpen edges -> anchor ground -> cross-bilateral filter (3.2) -> uncertain map (3.3)
//     -> normal-guided refinement (3.6 - 3.9)
// The thesis has neither sharpening nor anchoring. The uncertain map is of the filtered depth: refinement moves
// surfaces, not the edges between them. Without labels everything is one class and nothing is uncertain. Without given
// normals those of the filtered depth, smoothed within each class, guide the refinement: it then flattens noise rather
// than correcting shape. Memory: see refine_depth_workspace_bytes(); the planes of RefinedDepth stay in the workspace.
#ifndef NPSIM_PIPELINE_REFINE_DEPTH_HPP
#define NPSIM_PIPELINE_REFINE_DEPTH_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/color/lab.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/anchor_ground.hpp"
#include "npsim/depth/cross_bilateral.hpp"
#include "npsim/depth/fill.hpp"
#include "npsim/depth/guiding_normals.hpp"
#include "npsim/depth/object_borders.hpp"
#include "npsim/depth/outliers.hpp"
#include "npsim/depth/refine.hpp"
#include "npsim/depth/sharpen_edges.hpp"
#include "npsim/depth/uncertainty.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/pipeline/refine_depth_params.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct RefinedDepth {
  ImageView<float> depth;             // m; 0 where there is no surface
  ImageView<const Label> labels;      // the scene's, or all one class
  ImageView<std::uint8_t> surface;    // 1 where the pixel shows a surface of the scene
  ImageView<std::uint8_t> uncertain;  // U of (3.3)
  ImageView<Vec3f> normals;           // that guided the refinement: given or derived, smoothed, the ground's made plain
  Span<float> loss_curve;             // of the refinement: before each of refinement.steps steps and at the end
  RefineResult refinement;
};

[[nodiscard]] constexpr std::size_t refine_loss_count(const RefineParams& params) noexcept {
  return static_cast<std::size_t>(refine_max_steps(params)) + 1;
}

[[nodiscard]] inline std::size_t refine_depth_workspace_bytes(const RefineDepthParams& params, Shape shape) noexcept {
  const std::size_t pixels = shape.pixels();
  const std::size_t steps =
      std::max({fill_workspace_bytes(params.fill, shape) + allocation_bytes<float>(pixels) +
                    ground_workspace_bytes(params.ground, shape),
                sharpen_edges_workspace_bytes(params.sharpen, shape) + allocation_bytes<float>(pixels),
                anchor_ground_workspace_bytes(params.ground, shape),
                allocation_bytes<Vec3f>(pixels) + allocation_bytes<std::uint16_t>(pixels) +
                    cross_bilateral_workspace_bytes(refine_detail::scaled_filter(params, shape), shape),
                uncertainty_workspace_bytes(params.uncertainty, shape),
                guiding_normals_workspace_bytes(params.normals, shape), refine_workspace_bytes(params.refine, shape)});
  return 2 * allocation_bytes<float>(pixels) + 4 * allocation_bytes<std::uint8_t>(pixels) +
         allocation_bytes<Vec3f>(pixels) + allocation_bytes<float>(refine_loss_count(params.refine)) + steps +
         kWorkspaceAlignment;
}

namespace refine_detail {

// Without labels the sky is not known. What lies above the topmost measurement of its neighbourhood is taken for it:
// a range sensor sees nothing there, and a dense depth map leaves no such pixel.
inline void mark_surface(ImageView<const float> given, ImageView<const Label> labels, ImageView<const float> depth,
                         bool labelled, ImageView<std::uint8_t> surface) {
  constexpr int kReach = 8;
  const Shape shape = surface.shape();
  for (int x = 0; x < shape.width; ++x) {
    int top = 0;
    if (!labelled) {
      top = shape.height;
      for (int i = std::max(0, x - kReach); i <= std::min(shape.width - 1, x + kReach); ++i) {
        int y = 0;
        while (y < top && !is_valid_depth(given(i, y))) ++y;
        top = y;
      }
    }
    for (int y = 0; y < shape.height; ++y) {
      surface(x, y) = y >= top && !kNoSurfaceLabels.contains(labels(x, y)) && is_valid_depth(depth(x, y)) ? 1 : 0;
    }
  }
}

}  // namespace refine_detail

template <class Executor, class Observer>
Status refine_depth(const RefineDepthParams& params, const SceneView& scene, Workspace& workspace, Executor& executor,
                    Observer& observer, RefinedDepth& out) {
  const Shape shape = scene.shape();
  const auto cancelled = [&] {
    return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled while refining depth") : Status();
  };
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.depth));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.surface));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.uncertain));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.normals));
  ImageView<Label> one_class;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, one_class));
  const bool labelled = !scene.labels.empty();
  if (!labelled) {
    for (Label& l : one_class.pixels()) l = label::unlabeled;
  }
  out.labels = labelled ? scene.labels : ImageView<const Label>(one_class);

  observer.begin(Stage::fill);
  {
    WorkspaceScope scope(workspace);
    ImageView<float> measured;
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, measured));
    copy_pixels(scene.depth, measured);
    if (params.drop_outliers) {
      GroundPlane ground;
      NPSIM_RETURN_IF_ERROR(estimate_ground(params.ground, scene.depth, out.labels, scene.camera, workspace, ground));
      NPSIM_RETURN_IF_ERROR(drop_outliers(refine_detail::scaled_outliers(params, shape), scene.depth, scene.labels,
                                          ground.up, ground.inlier_share > 0.0F ? ground.camera_height_m : 0.0F,
                                          scene.camera, measured, executor));
    }
    NPSIM_RETURN_IF_ERROR(fill_depth(params.fill, ImageView<const float>(measured), scene.labels, out.depth,
                                     ImageView<std::uint8_t>(), workspace, executor));
  }
  refine_detail::mark_surface(scene.depth, out.labels, out.depth, labelled, out.surface);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (out.surface(x, y) == 0) out.depth(x, y) = 0.0F;
    }
  }
  observer.end(Stage::fill);
  observer.depth(Stage::fill, out.depth);
  NPSIM_RETURN_IF_ERROR(cancelled());

  const ObjectMap objects{scene.labels, labelled ? scene.instances : ImageView<const std::uint16_t>()};
  if (params.sharpen.radius_px > 0.0F) {
    observer.begin(Stage::sharpen);
    const WorkspaceScope scope(workspace);
    ImageView<float> sharp;
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, sharp));
    NPSIM_RETURN_IF_ERROR(sharpen_edges(refine_detail::scaled_sharpening(params, shape),
                                        ImageView<const float>(out.depth), objects, sharp, workspace, executor));
    copy_pixels(sharp, out.depth);
    observer.end(Stage::sharpen);
    observer.depth(Stage::sharpen, out.depth);
    NPSIM_RETURN_IF_ERROR(cancelled());
  }

  observer.begin(Stage::ground);
  GroundPlane ground;
  NPSIM_RETURN_IF_ERROR(anchor_ground(refine_detail::scaled_anchor(params, shape), params.ground, scene.camera_height_m,
                                      scene.camera, out.labels, scene.normals, out.depth, ground, workspace, executor));
  observer.end(Stage::ground);
  if (params.anchor.enabled) observer.depth(Stage::ground, out.depth);
  NPSIM_RETURN_IF_ERROR(cancelled());

  observer.begin(Stage::cross_bilateral);
  {
    WorkspaceScope scope(workspace);
    ImageView<Vec3f> lab;
    ImageView<float> filtered;
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, lab));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, filtered));
    NPSIM_RETURN_IF_ERROR(srgb8_to_lab(scene.image, lab, executor));
    CrossBilateralParams filter = refine_detail::scaled_filter(params, shape);
    filter.use_colour = filter.use_colour && !(params.filter_one_reference && labelled);
    filter.use_labels = filter.use_labels && !(params.filter_one_reference && !labelled);
    const auto exchange = [&](ImageView<float> plane) {
      for (int y = 0; y < (params.filter_inverse_depth ? shape.height : 0); ++y) {
        for (int x = 0; x < shape.width; ++x) {
          if (plane(x, y) > 0.0F) plane(x, y) = 1.0F / plane(x, y);
        }
      }
    };
    exchange(out.depth);
    CrossBilateralResult filter_result;
    const ImageView<const float> unfiltered = out.depth;
    const ImageView<const Vec3f> colours = lab;
    const bool by_object = params.filter_one_reference && labelled && !scene.instances.empty();
    ImageView<std::uint16_t> object_ids;  // two of one label mix only if their ids are equal modulo 1024
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, object_ids));
    for (int y = 0; y < (by_object ? shape.height : 0); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        object_ids(x, y) = static_cast<std::uint16_t>((scene.instances(x, y) * 64U) | (out.labels(x, y) & 63U));
      }
    }
    NPSIM_RETURN_IF_ERROR(by_object ? cross_bilateral(filter, unfiltered, ImageView<const std::uint16_t>(object_ids),
                                                      colours, filtered, filter_result, workspace, executor)
                                    : cross_bilateral(filter, unfiltered, out.labels, colours, filtered, filter_result,
                                                      workspace, executor));
    exchange(filtered);
    copy_pixels(filtered, out.depth);
  }
  observer.end(Stage::cross_bilateral);
  observer.depth(Stage::cross_bilateral, out.depth);
  NPSIM_RETURN_IF_ERROR(cancelled());

  observer.begin(Stage::uncertainty);
  UncertaintyOutput uncertain;
  uncertain.mask = out.uncertain;
  NPSIM_RETURN_IF_ERROR(
      uncertainty(params.uncertainty, ImageView<const float>(out.depth), out.labels, uncertain, workspace, executor));
  observer.end(Stage::uncertainty);
  NPSIM_RETURN_IF_ERROR(cancelled());

  observer.begin(Stage::refine);
  NPSIM_RETURN_IF_ERROR(guiding_normals(params.normals, scene.normals, out.depth, out.labels, scene.camera, ground,
                                        out.normals, workspace, executor));
  ImageView<std::uint8_t> edges;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, edges));
  if (params.border_jump > 0.0F) {
    NPSIM_RETURN_IF_ERROR(
        mark_depth_borders(params.border_jump, ImageView<const float>(out.depth), objects, edges, executor));
  } else {
    copy_pixels(ImageView<const std::uint8_t>(out.uncertain), edges);
  }
  LossInput<float> input;
  input.depth_est = out.depth;
  input.normals = out.normals;
  input.uncertain = edges;
  input.labels = out.labels;
  input.intrinsics = scene.camera;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(refine_loss_count(params.refine), out.loss_curve));
  NPSIM_RETURN_IF_ERROR(
      refine_with_normals(params.refine, input, out.depth, out.loss_curve, out.refinement, workspace, executor));
  observer.end(Stage::refine);
  observer.depth(Stage::refine, out.depth);
  return cancelled();
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_REFINE_DEPTH_HPP
