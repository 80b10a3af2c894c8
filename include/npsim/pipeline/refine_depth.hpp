// SPDX-License-Identifier: Apache-2.0
// Section 3.4: the depth refinement kernel, from the depth as given to one that a mesh can be built on.
//
//   drop outliers, fill -> cross-bilateral filter (3.2) -> uncertain map (3.3) -> normal-guided refinement (3.6 - 3.9)
// The uncertain map is of the filtered depth: refinement moves surfaces, not the edges between them.
// Without labels everything is one class and nothing is uncertain. Without given normals those of the filtered depth,
// smoothed within each class, guide the refinement: it then flattens noise rather than correcting shape.
// Memory: see refine_depth_workspace_bytes(); the planes of RefinedDepth stay in the workspace.
#ifndef NPSIM_PIPELINE_REFINE_DEPTH_HPP
#define NPSIM_PIPELINE_REFINE_DEPTH_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/color/lab.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/cross_bilateral.hpp"
#include "npsim/depth/fill.hpp"
#include "npsim/depth/normals.hpp"
#include "npsim/depth/outliers.hpp"
#include "npsim/depth/refine.hpp"
#include "npsim/depth/smooth_normals.hpp"
#include "npsim/depth/uncertainty.hpp"
#include "npsim/light/ground.hpp"
#include "npsim/pipeline/scene_view.hpp"

namespace npsim {
inline namespace v1 {

// Predicted normals are worst on roads, which are the plainest surface there is. On these labels they are smoothed far
// more than elsewhere, and where they still lean away from the ground plane's (robustly fitted to depth) they turn into
// it: not at all below min_rad, which is the road's own shape, fully from twice that to max_rad; more is a kerb's face.
struct GroundNormalsParams {
  bool enabled = true;
  LabelSet labels = LabelSet::of(label::road, label::sidewalk, label::parking, label::ground);
  SmoothNormalsParams smoothing{5};
  float min_rad = 0.02F;
  float max_rad = 0.90F;
  GroundParams ground;
};

// Measured on generated streets (960 px wide, mean relative depth error .044 as given): the thesis' sigma of 10 px, its
// mu of 5 and metric depth leave .049 after the filter and .074 after the refinement with printed continuity, because
// that pulls trees onto houses; half the sigma, the cited code's mu, inverse depth (linear on planes) and continuity on
// unit tangents leave .042 and .040.
[[nodiscard]] constexpr CrossBilateralParams default_depth_filter() noexcept {
  CrossBilateralParams p;
  p.mu = kCrossBilateralMuCitedCode;
  p.sigma_s_px = 5.0F;
  return p;
}
[[nodiscard]] constexpr RefineParams default_depth_refinement() noexcept {
  RefineParams p;
  p.loss.continuity = ContinuityForm::unit_tangents;
  p.loss.lambda = {1, 1, 100};
  return p;
}

struct RefineDepthParams {
  bool drop_outliers = true;
  OutlierParams outliers;
  FillParams fill;
  CrossBilateralParams filter = default_depth_filter();
  int filter_reference_width_px = 960;  // sigma_s is for images this wide and scales with the width; 0: as it is
  bool filter_inverse_depth = true;
  UncertaintyParams uncertainty;
  NormalsParams normals;
  RefineParams refine = default_depth_refinement();
  // The U that the refinement sees is (3.3) with these labels for foreground. A tree in front of a house is an edge for it
  // too, though neither is a foreground object; continuity would pull one onto the other.
  LabelSet edge_labels = LabelSet::all();
  SmoothNormalsParams derived_smoothing{3};  // of normals that come from depth
  SmoothNormalsParams given_smoothing{2};    // of given ones
  GroundNormalsParams ground_normals;        // of both, after smoothing

  [[nodiscard]] static RefineDepthParams thesis() noexcept {
    RefineDepthParams params;
    params.normals.tangents = TangentForm::thesis;
    params.refine = thesis_refine_params();
    params.edge_labels = kForegroundLabels;
    params.drop_outliers = false;
    params.filter = CrossBilateralParams{};
    params.filter_reference_width_px = 0;
    params.filter_inverse_depth = false;
    params.derived_smoothing.iterations = 0;
    params.given_smoothing.iterations = 0;
    params.ground_normals.enabled = false;
    return params;
  }
};

struct RefinedDepth {
  ImageView<float> depth;             // m; 0 where there is no surface
  ImageView<const Label> labels;      // the scene's, or all one class
  ImageView<std::uint8_t> surface;    // 1 where the pixel shows a surface of the scene
  ImageView<std::uint8_t> uncertain;  // U of (3.3)
  ImageView<Vec3f> normals;           // that guided the refinement: given or derived, smoothed, the ground's made plain
  Span<float> loss_curve;             // of the refinement: before each of refinement.steps steps and at the end
  RefineResult refinement;
};

namespace refine_detail {

[[nodiscard]] inline CrossBilateralParams scaled_filter(const RefineDepthParams& params, Shape shape) noexcept {
  CrossBilateralParams filter = params.filter;
  filter.keep_invalid = true;
  if (params.filter_reference_width_px > 0) {
    const float scale = static_cast<float>(shape.width) / static_cast<float>(params.filter_reference_width_px);
    const float sigma = filter.sigma_s_px * scale;
    filter.sigma_s_px = sigma < 0.5F ? 0.5F : sigma;  // a NaN stays one and is refused
  }
  return filter;
}
}  // namespace refine_detail

[[nodiscard]] constexpr std::size_t refine_loss_count(const RefineParams& params) noexcept {
  return static_cast<std::size_t>(refine_max_steps(params)) + 1;
}

[[nodiscard]] inline std::size_t refine_depth_workspace_bytes(const RefineDepthParams& params, Shape shape) noexcept {
  const std::size_t pixels = shape.pixels();
  const std::size_t steps =
      std::max({fill_workspace_bytes(params.fill, shape) + allocation_bytes<float>(pixels) +
                    ground_workspace_bytes(params.ground_normals.ground, shape),
                allocation_bytes<Vec3f>(pixels) + cross_bilateral_workspace_bytes(refine_detail::scaled_filter(params, shape), shape),
                uncertainty_workspace_bytes(params.uncertainty, shape),
                smooth_normals_workspace_bytes(params.derived_smoothing, shape) + allocation_bytes<Vec3f>(pixels),
                ground_workspace_bytes(params.ground_normals.ground, shape), refine_workspace_bytes(params.refine, shape)});
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

inline void straighten_ground(const GroundNormalsParams& params, const GroundPlane& ground,
                              ImageView<const Label> labels, ImageView<const Vec3f> smooth, ImageView<Vec3f> normals) {
  const bool known = ground.inlier_share > 0.0F;  // a guess is no evidence against what was predicted
  for (int y = 0; y < normals.height(); ++y) {
    for (int x = 0; x < normals.width(); ++x) {
      if (!params.labels.contains(labels(x, y)) || normals(x, y) == Vec3f{}) continue;
      const float cosine = dot(smooth(x, y), ground.up);
      const float off = std::sqrt(std::max(0.0F, 2.0F - 2.0F * cosine));  // the chord; nearly the angle
      if (off > params.max_rad) continue;
      const float towards = known ? std::clamp((off - params.min_rad) / params.min_rad, 0.0F, 1.0F) : 0.0F;
      normals(x, y) = normalized(smooth(x, y) * (1.0F - towards) + ground.up * towards);
    }
  }
}

// The normals that guide the refinement and shade the surface: given ones, else those of the filtered depth.
template <class Executor>
Status guiding_normals(const RefineDepthParams& params, const SceneView& scene, const RefinedDepth& out,
                       Workspace& workspace, Executor& executor) {
  const Shape shape = scene.shape();
  const ImageView<const float> depth = out.depth;
  const bool given = !scene.normals.empty();
  NPSIM_RETURN_IF_ERROR(normals_from_depth(params.normals, depth, scene.camera, out.normals, workspace, executor));
  for (int y = 0; y < (given ? shape.height : 0); ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const Vec3f n = scene.normals(x, y);
      if (is_finite(n) && dot(n, n) > 0.25F) out.normals(x, y) = normalized(n);
    }
  }
  NPSIM_RETURN_IF_ERROR(smooth_normals(given ? params.given_smoothing : params.derived_smoothing, depth, out.labels,
                                       out.normals, workspace, executor));
  if (!params.ground_normals.enabled) return {};
  GroundPlane ground;
  NPSIM_RETURN_IF_ERROR(
      estimate_ground(params.ground_normals.ground, depth, out.labels, scene.camera, workspace, ground));
  WorkspaceScope scope(workspace);
  ImageView<Vec3f> smooth;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, smooth));
  copy_pixels(out.normals, smooth);
  NPSIM_RETURN_IF_ERROR(
      smooth_normals(params.ground_normals.smoothing, depth, out.labels, smooth, workspace, executor));
  straighten_ground(params.ground_normals, ground, out.labels, smooth, out.normals);
  return {};
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
      NPSIM_RETURN_IF_ERROR(
          estimate_ground(params.ground_normals.ground, scene.depth, out.labels, scene.camera, workspace, ground));
      NPSIM_RETURN_IF_ERROR(drop_outliers(params.outliers, scene.depth, scene.labels, ground.up,
                                          ground.inlier_share > 0.0F ? ground.camera_height_m : 0.0F, scene.camera,
                                          measured, executor));
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

  observer.begin(Stage::cross_bilateral);
  {
    WorkspaceScope scope(workspace);
    ImageView<Vec3f> lab;
    ImageView<float> filtered;
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, lab));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, filtered));
    NPSIM_RETURN_IF_ERROR(srgb8_to_lab(scene.image, lab, executor));
    const CrossBilateralParams filter = refine_detail::scaled_filter(params, shape);
    const auto exchange = [&](ImageView<float> plane) {
      for (int y = 0; y < (params.filter_inverse_depth ? shape.height : 0); ++y) {
        for (int x = 0; x < shape.width; ++x) {
          if (plane(x, y) > 0.0F) plane(x, y) = 1.0F / plane(x, y);
        }
      }
    };
    exchange(out.depth);
    CrossBilateralResult filter_result;
    NPSIM_RETURN_IF_ERROR(cross_bilateral(filter, ImageView<const float>(out.depth), out.labels,
                                          ImageView<const Vec3f>(lab), filtered, filter_result, workspace, executor));
    exchange(filtered);
    copy_pixels(filtered, out.depth);
  }
  observer.end(Stage::cross_bilateral);
  observer.depth(Stage::cross_bilateral, out.depth);
  NPSIM_RETURN_IF_ERROR(cancelled());

  observer.begin(Stage::uncertainty);
  UncertaintyOutput uncertain;
  uncertain.mask = out.uncertain;
  NPSIM_RETURN_IF_ERROR(uncertainty(params.uncertainty, ImageView<const float>(out.depth), out.labels, uncertain,
                                    workspace, executor));
  observer.end(Stage::uncertainty);
  NPSIM_RETURN_IF_ERROR(cancelled());

  observer.begin(Stage::refine);
  NPSIM_RETURN_IF_ERROR(refine_detail::guiding_normals(params, scene, out, workspace, executor));
  ImageView<std::uint8_t> edges;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, edges));
  {
    UncertaintyParams any_edge = params.uncertainty;
    any_edge.foreground = params.edge_labels;
    UncertaintyOutput output;
    output.mask = edges;
    NPSIM_RETURN_IF_ERROR(
        uncertainty(any_edge, ImageView<const float>(out.depth), out.labels, output, workspace, executor));
  }
  LossInput<float> input;
  input.depth_est = out.depth;
  input.normals = out.normals;
  input.uncertain = edges;
  input.labels = out.labels;
  input.intrinsics = scene.camera;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(refine_loss_count(params.refine), out.loss_curve));
  NPSIM_RETURN_IF_ERROR(refine_with_normals(params.refine, input, out.depth, out.loss_curve, out.refinement, workspace,
                                            executor));
  observer.end(Stage::refine);
  observer.depth(Stage::refine, out.depth);
  return cancelled();
}

}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_PIPELINE_REFINE_DEPTH_HPP
