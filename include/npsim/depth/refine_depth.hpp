// SPDX-License-Identifier: Apache-2.0
// Section 3.4: the depth refinement kernel, from the depth as given to one that a mesh can be built on.
//
//   find the source -> guess labels where there are none -> clear outlines of plants, signs -> fit the ground plane
//     -> find the own car -> drop outliers, lay markings, fill -> sharpen edges -> anchor ground
//     -> cross-bilateral filter (3.2) -> uncertain map (3.3) -> normal-guided refinement (3.6 - 3.9)
//     -> faces of kerbs, or surfaces without the noise that was measured
// The thesis has neither sharpening nor anchoring, and no kerbs. The first two, and the filter, mend what networks do
// wrong and harm what was measured (docs/evaluation.md), so they are left out for stereo, laser and exact depth
// (depth/depth_source.hpp), and what refinement does to such depth is held within what its source leaves open. The
// uncertain map is of the filtered depth: refinement moves surfaces, not the edges between them. Guessed labels
// (depth/detail/given/guessed_labels.hpp) have no say in what is dropped, nor in the filter where it has one reference;
// for the fill they tell ground from what stands beside it (depth/detail/given/unlabelled_borders.hpp). Without given
// normals those of the filtered depth, smoothed within each class, guide the refinement: it then flattens noise rather
// than correcting shape. What each default is worth on generated streets stands in docs/evaluation.md.
// Cost: that of the steps. Memory: see refine_depth_workspace_bytes(); the planes of RefinedDepth stay in the
// workspace.
#ifndef NPSIM_DEPTH_REFINE_DEPTH_HPP
#define NPSIM_DEPTH_REFINE_DEPTH_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/color/srgb.hpp"
#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/detail/estimated/surface_jumps.hpp"
#include "npsim/depth/detail/fill/fill_confidence.hpp"
#include "npsim/depth/detail/given/guessed_labels.hpp"
#include "npsim/depth/detail/given/own_car.hpp"
#include "npsim/depth/detail/given/unlabelled_borders.hpp"
#include "npsim/depth/detail/given/unlabelled_ground.hpp"
#include "npsim/depth/detail/measured/hanging_points.hpp"
#include "npsim/depth/detail/measured/hidden_points.hpp"
#include "npsim/depth/detail/measured/unlabelled_matches.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace refine_detail {

// The steps, each from and to the planes of RefinedDepth.

// Given normals know more than planes do.
[[nodiscard]] inline bool finds_planes(const RefineDepthParams& params, const SceneView& scene) noexcept {
  return params.planes.enabled && scene.normals.empty();
}

// labels: those of the scene with plants cut to their leaves and signs to their plates.
template <class Executor>
[[nodiscard]] Status own_labels(const RefineDepthParams& params, const SceneView& scene, Workspace& workspace,
                                Executor& executor, ImageView<Label> labels) {
  NPSIM_RETURN_IF_ERROR(
      clear_plant_outlines(params.outlines, scene.image, scene.labels, scene.light_index, labels, workspace, executor));
  return params.sign_outlines ? clear_sign_outlines(scene.image, scene.instances, scene.light_index, labels, workspace)
                              : Status();
}

[[nodiscard]] inline Status allocate_planes(const RefineDepthParams& params, const SceneView& scene,
                                            Workspace& workspace, RefinedDepth& out) noexcept {
  const Shape shape = scene.shape();
  if (out.trust.bounded) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.filled));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.confidence));
  }
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.depth));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.surface));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.uncertain));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.normals));
  out.planes = PlanarMap{};
  return finds_planes(params, scene) ? allocate_planar_map(params.planes, shape, workspace, out.planes) : Status();
}

inline void mark_surface(const SceneView& scene, ImageView<const float> depth,
                         ImageView<std::uint8_t> surface) noexcept {
  for (int y = 0; y < surface.height(); ++y) {
    for (int x = 0; x < surface.width(); ++x) {
      surface(x, y) = !kNoSurfaceLabels.contains(scene.labels(x, y)) && is_valid_depth(depth(x, y)) ? 1 : 0;
    }
  }
}

// What the depth is taken for.
[[nodiscard]] inline DepthSource taken_for(const RefineDepthParams& params, const RefinedDepth& out) noexcept {
  return params.use_source ? out.source : DepthSource::network;
}
[[nodiscard]] inline bool is_laser(const RefineDepthParams& params, const RefinedDepth& out) noexcept {
  return taken_for(params, out) == DepthSource::lidar;
}

// Beside near things, what has their depth and not that of what is seen there.
template <class Executor>
[[nodiscard]] Status drop_spill(const RefineDepthParams& params, const SceneView& scene, const ObjectMap& objects,
                                DepthSource source, const GroundPlane& ground, ImageView<float> measured,
                                Workspace& workspace, Executor& executor) {
  if (!is_noisy(source)) return {};
  const bool stereo = source == DepthSource::stereo;
  const BorderSpillParams spill =
      scaled_spill(stereo ? params.spill : params.laser_spill, reference_scale(params, scene.shape()));
  if (objects.labels.empty()) {
    if (stereo) {
      return drop_unlabelled_matches(scene.image, scene.depth, spill.reach_px, measured, workspace, executor);
    }
    const int reach = hidden_reach_px(scene.depth);
    drop_hidden_points(scene.depth, reach, measured, executor);
    drop_hanging_points(scene.depth, scene.camera, ground, reach, measured, executor);
    return {};
  }
  const SpillView view{scene.camera, ground, stereo ? stereo_focal_baseline_px_m(params.source, scene) : 0.0F};
  return drop_border_spill(spill, scene.depth, objects, view, measured, executor);
}

// The depth as given without what cannot be.
template <class Executor>
[[nodiscard]] Status drop_mismatches(const RefineDepthParams& params, const SceneView& scene, const ObjectMap& objects,
                                     const RefinedDepth& out, ImageView<float> measured, Workspace& workspace,
                                     Executor& executor) {
  copy_pixels(scene.depth, measured);
  if (!params.drop_outliers) return {};
  const float height_m = out.ground.inlier_share > 0.0F ? out.ground.camera_height_m : 0.0F;
  OutlierParams outliers = scaled_outliers(params, scene.shape());
  outliers.by_object = outliers.by_object || out.trust.focal_baseline_px_m > 0.0F;
  NPSIM_RETURN_IF_ERROR(drop_outliers(outliers, scene.depth, objects, out.ground.up, height_m, scene.camera,
                                      out.trust.focal_baseline_px_m, measured, executor));
  return drop_spill(params, scene, objects, taken_for(params, out), out.ground, measured, workspace, executor);
}

// Of a scene without labels, and its ground. Where none shall be guessed there is the sky and all else.
template <class Executor>
[[nodiscard]] Status guess_scene_labels(const RefineDepthParams& params, const SceneView& scene,
                                        ImageView<Label> labels, Workspace& workspace, Executor& executor,
                                        RefinedDepth& out) {
  const WorkspaceScope scope(workspace);
  const Shape shape = scene.shape();
  ImageView<float> measured;
  ImageView<std::uint8_t> surface;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, measured));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, surface));
  NPSIM_RETURN_IF_ERROR(estimate_ground(params.ground, scene.depth, scene.labels, scene.camera, workspace, out.ground));
  NPSIM_RETURN_IF_ERROR(
      find_sky(out.ground, scene.camera, scene.image, scene.depth, out.source, out.noise, surface, workspace));
  if (!params.guess_labels) {
    for_pixels(shape, executor,
               [&](int x, int y) { labels(x, y) = surface(x, y) == 0 ? label::sky : label::unlabeled; });
    return {};
  }
  NPSIM_RETURN_IF_ERROR(drop_mismatches(params, scene, ObjectMap{}, out, measured, workspace, executor));
  return guess_labels(scene.image, measured, scene.camera, out.ground, out.noise, is_laser(params, out), surface,
                      labels, workspace, executor);
}

// drawn: the labels before they were cut to outlines. labels: those of scene and objects, which change where a marking
// was taken for a thing. A guess of labels says no more than where ground may end: where it is wrong it would part what
// hangs together.
template <class Executor>
[[nodiscard]] Status complete_depth(const RefineDepthParams& params, const SceneView& scene,
                                    ImageView<const Label> drawn, ImageView<Label> labels, const ObjectMap& objects,
                                    Workspace& workspace, Executor& executor, RefinedDepth& out) {
  const Shape shape = scene.shape();
  const ObjectMap given = out.labels_guessed ? ObjectMap{} : objects;
  ImageView<float> measured;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, measured));
  if (!out.labels_guessed) {  // else the guess has estimated it
    NPSIM_RETURN_IF_ERROR(
        estimate_ground(params.ground, scene.depth, scene.labels, scene.camera, workspace, out.ground));
  }
  if (!is_laser(params, out)) {
    const LabelSet may_be = out.labels_guessed ? kGuessedBonnetLabels : kBonnetLabels;
    mark_own_car(scene.depth, scene.camera, out.ground, may_be, scene.light_index, labels);
  }
  NPSIM_RETURN_IF_ERROR(drop_mismatches(params, scene, given, out, measured, workspace, executor));
  if (!out.labels_guessed) {
    drop_depth_of_outlines(params.outlines, drawn, scene.labels, scene.depth, measured, executor);
    if (params.ground_markings) {  // after that, to which their depth would be one of cut outlines
      NPSIM_RETURN_IF_ERROR(
          lay_markings(scene.depth, scene.camera, out.ground, scene.instances, scene.light_index, labels, workspace));
    }
  }
  if (out.trust.bounded) {  // before what is virtual joins it
    rate_confidence(measured, kConfidenceReach_px * reference_scale(params, shape), out.confidence);
  }
  FillParams fill = params.fill;
  if (out.noise.power == 0) fill.edge_inverse += 1.2F * out.noise.amplitude;
  fill.laser = fill.laser || is_laser(params, out);
  const bool continued = out.labels_guessed && out.ground.inlier_share > 0.0F;
  if (continued) {
    NPSIM_RETURN_IF_ERROR(continue_ground(out.ground, scene.camera, scene.depth, fill.laser ? fill.same_surface : 0.0F,
                                          measured, workspace));
    if (params.guess_labels && is_noisy(taken_for(params, out))) {
      NPSIM_RETURN_IF_ERROR(pin_borders(scene.image, scene.labels, out.ground, scene.camera, measured, workspace));
    }
  }
  NPSIM_RETURN_IF_ERROR(fill_depth(fill, ImageView<const float>(measured), given, out.depth, ImageView<std::uint8_t>(),
                                   workspace, executor));
  if (is_laser(params, out) && !out.labels_guessed) {
    NPSIM_RETURN_IF_ERROR(
        place_beyond_range(params.beyond_range, ImageView<const float>(measured), scene.labels, out.depth, workspace));
  }
  mark_surface(scene, out.depth, out.surface);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (out.surface(x, y) == 0) out.depth(x, y) = 0.0F;
    }
  }
  if (out.trust.bounded) copy_pixels(ImageView<const float>(out.depth), out.filled);
  return {};
}

// What a step made of the depth, held within what its source leaves open.
template <class Executor>
void hold_depth(const RefinedDepth& out, Executor& executor) noexcept {
  if (!out.trust.bounded) return;
  executor.for_chunks(static_cast<std::size_t>(out.depth.height()), 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < out.depth.width(); ++x) {
        out.depth(x, y) = out.trust.held(out.filled(x, y), out.depth(x, y), out.confidence(x, y));
      }
    }
  });
}

template <class Executor>
[[nodiscard]] Status sharpen(const RefineDepthParams& params, const ObjectMap& objects, Workspace& workspace,
                             Executor& executor, RefinedDepth& out) {
  const Shape shape = out.depth.shape();
  ImageView<float> sharp;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, sharp));
  NPSIM_RETURN_IF_ERROR(sharpen_edges(scaled_sharpening(params, shape), ImageView<const float>(out.depth), objects,
                                      sharp, workspace, executor));
  copy_pixels(sharp, out.depth);
  return {};
}

template <class Executor>
[[nodiscard]] Status anchor(const RefineDepthParams& params, const SceneView& scene, Workspace& workspace,
                            Executor& executor, RefinedDepth& out) {
  return anchor_ground(scaled_anchor(params, scene.shape()), scene.camera_height_m, scene.camera, out.labels,
                       scene.normals, out.depth, out.ground, workspace, executor);
}

inline void invert_depth(ImageView<float> plane) noexcept {
  for (int y = 0; y < plane.height(); ++y) {
    for (int x = 0; x < plane.width(); ++x) {
      if (plane(x, y) > 0.0F) plane(x, y) = 1.0F / plane(x, y);
    }
  }
}

template <class Executor>
[[nodiscard]] Status filter(const RefineDepthParams& params, const SceneView& scene, Workspace& workspace,
                            Executor& executor, RefinedDepth& out) {
  const Shape shape = scene.shape();
  const bool labelled = !out.labels_guessed;  // a guess says nothing of what stands before what
  ImageView<Vec3f> lab;
  ImageView<float> filtered;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, lab));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, filtered));
  NPSIM_RETURN_IF_ERROR(srgb8_to_lab(scene.image, lab, executor));
  CrossBilateralParams filter = scaled_filter(params, shape);
  filter.use_colour = filter.use_colour && !(params.filter_one_reference && labelled);
  filter.use_labels = filter.use_labels && !(params.filter_one_reference && !labelled);
  if (params.filter_inverse_depth) invert_depth(out.depth);
  const ImageView<const float> depth = out.depth;
  const ImageView<const Vec3f> colours = lab;
  CrossBilateralResult result;
  if (params.filter_one_reference && labelled && !scene.instances.empty()) {
    ImageView<std::uint16_t> objects;  // two of one label mix only if their ids are equal modulo 1024
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, objects));
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        objects(x, y) = static_cast<std::uint16_t>((scene.instances(x, y) * 64U) | (out.labels(x, y) & 63U));
      }
    }
    NPSIM_RETURN_IF_ERROR(cross_bilateral(filter, depth, ImageView<const std::uint16_t>(objects), colours, filtered,
                                          result, workspace, executor));
  } else {
    NPSIM_RETURN_IF_ERROR(cross_bilateral(filter, depth, out.labels, colours, filtered, result, workspace, executor));
  }
  if (params.filter_inverse_depth) invert_depth(filtered);
  copy_pixels(filtered, out.depth);
  return {};
}

template <class Executor>
[[nodiscard]] Status fit_planes(const RefineDepthParams& params, const SceneView& scene, const ObjectMap& objects,
                                Workspace& workspace, Executor& executor, RefinedDepth& out) {
  PlanarSegmentsParams planes = params.planes;
  planes.guessed = planes.guessed || out.labels_guessed;
  if (!(out.ground.inlier_share > 0.0F)) planes.plumb = {};  // nothing says what is upright
  NPSIM_RETURN_IF_ERROR(planar_segments(planes, scene.depth, objects, out.noise, out.ground.up, scene.camera, out.depth,
                                        out.planes, workspace, executor));
  if (is_laser(params, out) && !out.labels_guessed) {
    const WorkspaceScope scope(workspace);
    ImageView<float> measured;  // what was kept of it
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(out.depth.shape(), measured));
    for (int y = 0; y < out.depth.height(); ++y) {
      for (int x = 0; x < out.depth.width(); ++x) {
        measured(x, y) = scene.depth(x, y) == out.filled(x, y) ? scene.depth(x, y) : 0.0F;
      }
    }
    NPSIM_RETURN_IF_ERROR(
        place_beyond_range(params.beyond_range, ImageView<const float>(measured), scene.labels, out.depth, workspace));
  }
  // What moved by more than noise was no measurement, but a mismatch or made up: the plane stands in its place.
  constexpr float kNoise = 2.0F;
  for (int y = 0; y < (out.filled.empty() ? 0 : out.depth.height()); ++y) {
    for (int x = 0; x < out.depth.width(); ++x) {
      if (out.planes.at(x, y) == nullptr || !is_valid_depth(out.filled(x, y))) continue;
      const float w = 1.0F / out.filled(x, y);
      if (std::fabs(1.0F / out.depth(x, y) - w) > kNoise * out.noise.deviation(w)) out.filled(x, y) = out.depth(x, y);
    }
  }
  return {};
}

template <class Executor>
[[nodiscard]] Status refine(const RefineDepthParams& params, const SceneView& scene, const ObjectMap& objects,
                            Workspace& workspace, Executor& executor, RefinedDepth& out) {
  NPSIM_RETURN_IF_ERROR(guiding_normals(params.normals, scene.normals, out.depth, out.labels, objects, out.noise,
                                        out.planes, scene.camera, out.ground, out.normals, workspace, executor));
  // Normals of measured depth know nothing that it does not.
  out.refinement = RefineResult{};
  if (out.trust.bounded && scene.normals.empty()) return {};
  const WorkspaceScope scope(workspace);
  ImageView<std::uint8_t> edges;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(scene.shape(), edges));
  if (params.border_jump > 0.0F) {
    NPSIM_RETURN_IF_ERROR(
        mark_depth_borders(params.border_jump, ImageView<const float>(out.depth), objects, edges, executor));
  } else {
    copy_pixels(ImageView<const std::uint8_t>(out.uncertain), edges);
  }
  RefineParams refinement = params.refine;
  if (scene.normals.empty()) refinement.loss = params.own_normals_loss;
  if (scene.normals.empty() && params.surface_jump > 0.0F) {
    NPSIM_RETURN_IF_ERROR(mark_surface_jumps(params.surface_jump / static_cast<float>(scene.shape().width),
                                             ImageView<const float>(out.depth), out.normals, objects, scene.camera,
                                             edges, executor));
  }
  LossInput<float> input;
  input.depth_est = out.depth;
  input.normals = out.normals;
  input.uncertain = edges;
  input.labels = out.labels;
  input.intrinsics = scene.camera;
  return refine_with_normals(refinement, input, out.depth, params.loss_curve, out.refinement, workspace, executor);
}

// Estimated and exact depth has steps of ground, and lacks the faces of kerbs. Plants keep the shape they were given.
template <class Executor>
[[nodiscard]] Status complete_steps(const RefineDepthParams& params, const SceneView& scene, Workspace& workspace,
                                    Executor& executor, RefinedDepth& out) {
  KerbFaceParams kerbs = params.kerbs;
  kerbs.enabled = kerbs.enabled && scene.normals.empty();  // refinement has found the faces that given ones show
  // Steps within one label, and roads above their pavement, are errors of an estimate; where labels are guessed a car's
  // sill is ground.
  kerbs.only_at_borders = kerbs.only_at_borders || !out.trust.bounded || out.labels_guessed;
  NPSIM_RETURN_IF_ERROR(kerb_faces(kerbs, scene.camera, out.ground, scene.labels, out.depth, out.normals, workspace));
  if (out.trust.bounded) {
    out.mesh_depth = out.filled;  // its memory: no step asks any more
    out.filled = {};
    copy_pixels(ImageView<const float>(out.depth), out.mesh_depth);
    return {};
  }
  for_rows(executor, out.mesh_depth.height(), [&](int y) {
    for (int x = 0; x < out.mesh_depth.width(); ++x) {
      const float z = out.depth(x, y);
      const bool kept =
          params.plants.contains(scene.labels(x, y)) && std::fabs(out.mesh_depth(x, y) - z) < params.plant_change * z;
      if (!kept) out.mesh_depth(x, y) = z;
    }
  });
  return {};
}

// Stereo and laser show the faces of kerbs as ramps, and a step between two of their pixels is noise: surfaces are
// smoothed.
template <class Executor>
[[nodiscard]] Status smooth_measured(const RefineDepthParams& params, const SceneView& scene, const ObjectMap& objects,
                                     Workspace& workspace, Executor& executor, RefinedDepth& out) {
  out.mesh_depth = out.filled;  // its memory: no step asks any more
  out.filled = {};
  return smooth_surfaces(params.smooth, ImageView<const float>(out.depth), objects, out.planes, out.noise, scene.camera,
                         out.ground, out.mesh_depth, workspace, executor);
}

// What classes of things are like. Given normals know more than shapes do.
template <class Executor>
[[nodiscard]] Status shape_things(const RefineDepthParams& params, const SceneView& scene, const ObjectMap& objects,
                                  Workspace& workspace, Executor& executor, RefinedDepth& out) {
  if (!scene.normals.empty()) return {};
  const ImageView<const float> depth = out.depth;
  NPSIM_RETURN_IF_ERROR(shape_furniture(params.furniture, depth, objects, out.planes, scene.camera, out.ground.up,
                                        out.normals, out.mesh_depth, executor));
  NPSIM_RETURN_IF_ERROR(
      stand_poles(params.masts, depth, scene.labels, scene.camera, out.ground, out.mesh_depth, workspace));
  if (!out.trust.bounded) {
    NPSIM_RETURN_IF_ERROR(stand_before(params.stand_before, scene.labels, out.mesh_depth, workspace));
  }
  return shape_cars(params.cars, depth, objects, out.noise, scene.camera, out.ground, out.normals, out.mesh_depth,
                    workspace, executor);
}

// What the mesh is made of.
template <class Executor>
[[nodiscard]] Status complete_surfaces(const RefineDepthParams& params, const SceneView& scene,
                                       const ObjectMap& objects, Workspace& workspace, Executor& executor,
                                       RefinedDepth& out) {
  const bool noisy = out.trust.bounded && out.source != DepthSource::exact;
  NPSIM_RETURN_IF_ERROR(noisy ? smooth_measured(params, scene, objects, workspace, executor, out)
                              : complete_steps(params, scene, workspace, executor, out));
  if (taken_for(params, out) != DepthSource::exact) {
    NPSIM_RETURN_IF_ERROR(shape_things(params, scene, objects, workspace, executor, out));
  }
  GroundContactParams contact = params.contact;
  if (!noisy) contact.unsure_m = 0.0F;
  if (out.source == DepthSource::exact) {  // deeper than the least step, things are seen over one, and stand right
    contact.unsure_m = std::max(-0.005F, -contact.clear_m);
    contact.deepest_m = params.kerbs.min_step_m;
  }
  return keep_above_ground(contact, scene.labels, scene.camera, out.ground, out.normals, out.mesh_depth, executor);
}

}  // namespace refine_detail

// A scene without a usable depth on any surface is no_valid_input.
template <class Executor, class Observer>
Status refine_depth(const RefineDepthParams& params, const SceneView& given, Workspace& workspace, Executor& executor,
                    Observer& observer, RefinedDepth& out) {
  SceneView scene = given;  // with labels of its own where there are any
  const auto step = [&](Stage stage, auto&& work, bool shows_depth) {
    observer.begin(stage);
    {
      const WorkspaceScope scope(workspace);
      NPSIM_RETURN_IF_ERROR(work());
    }
    observer.end(stage);
    if (shows_depth) observer.depth(stage, out.depth);
    return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled while refining depth") : Status();
  };
  NPSIM_RETURN_IF_ERROR(workspace.ensure(refine_depth_workspace_bytes(params, scene.shape())));
  const Shape shape = scene.shape();
  const auto judge_depth = [&](const ObjectMap& objects) {
    out.source = scene.depth_source;
    if (out.source == DepthSource::unknown) out.source = find_depth_source(params.source, scene.depth, objects.labels);
    out.noise = depth_noise(out.source, scene.stereo_baseline_m, scene.depth, objects, scene.camera);
    out.trust = depth_trust(params.source, refine_detail::taken_for(params, out), out.noise,
                            stereo_focal_baseline_px_m(params.source, scene));
  };
  ImageView<Label> labels;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, labels));
  out.labels = labels;
  out.labels_guessed = given.labels.empty();
  if (out.labels_guessed) {
    ImageView<Label> guess;
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, guess));
    judge_depth(ObjectMap{});
    NPSIM_RETURN_IF_ERROR(refine_detail::guess_scene_labels(params, given, guess, workspace, executor, out));
    scene.labels = guess;
    scene.instances = {};
    scene.depth_source = out.source;
  }
  const ImageView<const Label> drawn = scene.labels;
  NPSIM_RETURN_IF_ERROR(refine_detail::own_labels(params, scene, workspace, executor, labels));
  scene.labels = labels;
  out.filled = {};
  out.confidence = {};
  out.mesh_depth = {};
  const ObjectMap objects{scene.labels, scene.instances};
  judge_depth(objects);
  if (refine_detail::is_laser(params, out)) {
    NPSIM_RETURN_IF_ERROR(keep_measured_plants(params.outlines, drawn, scene.depth, labels, workspace, executor));
  }
  NPSIM_RETURN_IF_ERROR(refine_detail::allocate_planes(params, scene, workspace, out));

  NPSIM_RETURN_IF_ERROR(step(
      Stage::fill,
      [&] { return refine_detail::complete_depth(params, scene, drawn, labels, objects, workspace, executor, out); },
      true));
  if (params.sharpen.radius_px > 0.0F && !out.trust.bounded) {
    NPSIM_RETURN_IF_ERROR(step(
        Stage::sharpen, [&] { return refine_detail::sharpen(params, objects, workspace, executor, out); }, true));
  }
  if (!out.trust.bounded) {
    NPSIM_RETURN_IF_ERROR(step(
        Stage::ground, [&] { return refine_detail::anchor(params, scene, workspace, executor, out); },
        params.anchor.enabled));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, out.mesh_depth));
    copy_pixels(ImageView<const float>(out.depth), out.mesh_depth);
    NPSIM_RETURN_IF_ERROR(step(
        Stage::cross_bilateral, [&] { return refine_detail::filter(params, scene, workspace, executor, out); }, true));
  }
  if (refine_detail::finds_planes(params, scene)) {
    NPSIM_RETURN_IF_ERROR(step(
        Stage::planes, [&] { return refine_detail::fit_planes(params, scene, objects, workspace, executor, out); },
        true));
  }
  if (out.trust.bounded && out.source == DepthSource::stereo) {
    NPSIM_RETURN_IF_ERROR(step(
        Stage::ground,
        [&] {
          return replace_ground_mismatches(params.ground_mismatches, objects, out.noise, scene.camera, out.ground,
                                           out.filled, out.depth, workspace, executor);
        },
        true));
  }
  NPSIM_RETURN_IF_ERROR(step(
      Stage::uncertainty,
      [&] {
        UncertaintyOutput uncertain;
        uncertain.mask = out.uncertain;
        return uncertainty(params.uncertainty, ImageView<const float>(out.depth), out.labels, uncertain, workspace,
                           executor);
      },
      false));
  return step(
      Stage::refine,
      [&] {
        NPSIM_RETURN_IF_ERROR(refine_detail::refine(params, scene, objects, workspace, executor, out));
        refine_detail::hold_depth(out, executor);
        return refine_detail::complete_surfaces(params, scene, objects, workspace, executor, out);
      },
      true);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_REFINE_DEPTH_HPP
