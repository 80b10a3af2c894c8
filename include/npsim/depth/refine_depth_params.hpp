// SPDX-License-Identifier: Apache-2.0
// What the depth refinement of refine_depth.hpp is asked for, what it gives, and the memory that it takes.
#ifndef NPSIM_DEPTH_REFINE_DEPTH_PARAMS_HPP
#define NPSIM_DEPTH_REFINE_DEPTH_PARAMS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/cross_bilateral.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/detail/estimated/anchor_ground.hpp"
#include "npsim/depth/detail/estimated/sharpen_edges.hpp"
#include "npsim/depth/detail/given/ground_markings.hpp"
#include "npsim/depth/detail/given/guessed_labels.hpp"
#include "npsim/depth/detail/given/outliers.hpp"
#include "npsim/depth/detail/given/plant_outlines.hpp"
#include "npsim/depth/detail/given/sign_outlines.hpp"
#include "npsim/depth/detail/given/sky.hpp"
#include "npsim/depth/detail/given/unlabelled_borders.hpp"
#include "npsim/depth/detail/ground_contact.hpp"
#include "npsim/depth/detail/measured/beyond_range.hpp"
#include "npsim/depth/detail/measured/border_spill.hpp"
#include "npsim/depth/detail/measured/ground_mismatches.hpp"
#include "npsim/depth/detail/measured/smooth_surfaces.hpp"
#include "npsim/depth/detail/measured/unlabelled_matches.hpp"
#include "npsim/depth/detail/normals/guiding_normals.hpp"
#include "npsim/depth/detail/normals/kerb_faces.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/depth/detail/planes/planar_segments.hpp"
#include "npsim/depth/detail/things/car_bodies.hpp"
#include "npsim/depth/detail/things/stand_before.hpp"
#include "npsim/depth/detail/things/standing_poles.hpp"
#include "npsim/depth/detail/things/street_furniture.hpp"
#include "npsim/depth/fill.hpp"
#include "npsim/depth/losses.hpp"
#include "npsim/depth/refine.hpp"
#include "npsim/depth/uncertainty.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Where edges are sharp already the filter has but noise to remove. Against the thesis' sigma of 10 px, mu of 5 and
// metric depth: a third of the sigma, the cited code's mu, and inverse depth, which is linear on planes.
[[nodiscard]] constexpr CrossBilateralParams default_depth_filter() noexcept {
  CrossBilateralParams p;
  p.mu = kCrossBilateralMuCitedCode;
  p.sigma_s_px = 3.0F;
  return p;
}
// Continuity on unit tangents does not pull trees onto houses. At 500 depth and normals balance at wavelengths of some
// 200 px at a focal length of 725 px.
[[nodiscard]] constexpr RefineParams default_depth_refinement() noexcept {
  RefineParams p;
  p.loss.continuity = ContinuityForm::unit_tangents;
  p.loss.lambda = {1, 1, 500};
  p.loss.normal_in_uncertain = false;
  return p;
}

// Where no normals are given. Those of the depth itself know of no step, so a loss that saturates in the slopes leaves
// the drift of a network's depth as stairs, whose risers shade facades and ground at night; this one is quadratic.
[[nodiscard]] constexpr LossParams default_losses_of_own_normals() noexcept {
  LossParams p = default_depth_refinement().loss;
  p.continuity = ContinuityForm::printed;
  p.lambda.normal = 0;
  return p;
}

struct RefineDepthParams {
  bool use_source = true;  // false: all depth is taken for a network's
  DepthSourceParams source;
  PlantOutlinesParams outlines;
  bool sign_outlines = true;
  bool ground_markings = true;
  bool drop_outliers = true;
  OutlierParams outliers;
  FillParams fill;
  SharpenEdgesParams sharpen;
  AnchorGroundParams anchor;
  GroundParams ground;  // of the one ground plane that all steps share
  CrossBilateralParams filter = default_depth_filter();
  // The filter's sigma_s and the radii of sharpening and of the search for specks are for images this wide and scale
  // with the width; 0: as they are.
  int reference_width_px = 960;
  bool filter_inverse_depth = true;
  // Labels (instances where there are any) alone, as the method's successor does: the colours of road and pavement are
  // too alike to hold a kerb. Without given labels colour alone. false: both, as (3.2) has it.
  bool filter_one_reference = true;
  PlanarSegmentsParams planes;  // of a depth without given normals
  UncertaintyParams uncertainty;
  GuidingNormalsParams normals;
  RefineParams refine = default_depth_refinement();               // its loss with given normals
  LossParams own_normals_loss = default_losses_of_own_normals();  // in place of refine.loss without given normals
  // Without given normals: by how much of itself depth may leave its surface from pixel to pixel, in an image one pixel
  // wide, before it is a jump to another one: 10 is .01 at 960 px. 0: no jump is looked for.
  float surface_jump = 10.0F;
  // The U of the refinement: pixels whose neighbour belongs to another object that is farther or nearer by more than
  // this share. The slopes there lead from surface to surface, all others are a surface's own. 0: (3.3) as in the text.
  float border_jump = 0.02F;
  // Of these the mesh is made as they were before filter and refinement, where those changed them by less than
  // plant_change: a crown shades itself in its gaps, and one that is smooth is .4 stops too bright at night.
  LabelSet plants = LabelSet::of(label::vegetation);
  float plant_change = 0.1F;
  KerbFaceParams kerbs;
  GroundMismatchParams ground_mismatches;  // of stereo
  SmoothSurfacesParams smooth;
  BeyondRangeParams beyond_range;  // of laser
  BorderSpillParams spill;         // of stereo
  BorderSpillParams laser_spill = BorderSpillParams::laser();
  CarBodiesParams cars;             // of all depth that is not exact, without given normals
  StreetFurnitureParams furniture;  // likewise
  StandingPolesParams masts;        // likewise
  StandBeforeParams stand_before;   // of estimated depth without normals
  GroundContactParams contact;
  // Of scenes without any (depth/detail/given/guessed_labels.hpp); else there is the sky and one class.
  bool guess_labels = true;
  // The caller's memory for the losses before each step of the refinement and at its end (figure 4.4), at most
  // refine_max_steps() + 1 of them; RefinedDepth::refinement says how many there were. Empty: none are kept.
  Span<LossValues> loss_curve;

  [[nodiscard]] static constexpr RefineDepthParams thesis() noexcept {
    RefineDepthParams params;
    params.use_source = false;
    params.outlines.reach_px = 0;
    params.sign_outlines = false;
    params.ground_markings = false;
    params.drop_outliers = false;
    params.sharpen.radius_px = 0;
    params.anchor.enabled = false;
    params.filter = CrossBilateralParams{};
    params.reference_width_px = 0;
    params.filter_inverse_depth = false;
    params.filter_one_reference = false;
    params.normals.form.tangents = TangentForm::thesis;
    params.normals.fit = false;
    params.normals.given_smoothing.iterations = 0;
    params.normals.ground.enabled = false;
    params.refine = thesis_refine_params();
    params.own_normals_loss = params.refine.loss;
    params.surface_jump = 0;
    params.planes.enabled = false;
    params.border_jump = 0;
    params.plants = {};
    params.kerbs.enabled = false;
    params.cars.enabled = false;
    params.furniture.enabled = false;
    params.masts.enabled = false;
    params.stand_before.enabled = false;
    params.contact.most_share = 0;
    params.guess_labels = false;
    return params;
  }
};

struct RefinedDepth {
  ImageView<float> depth;             // m; 0 where there is no surface
  ImageView<float> mesh_depth;        // what a mesh is made of, where it is not that: of measured depth without its
                                      // sensor's noise, of a network's with plants as they were given, of all with
                                      // feet above the ground
  ImageView<const Label> labels;      // the scene's, plants and signs without what is behind them, markings of the
                                      // ground its own; without any, a guess
  bool labels_guessed = false;        // the scene has none
  ImageView<std::uint8_t> surface;    // 1 where the pixel shows a surface of the scene
  ImageView<std::uint8_t> uncertain;  // U of (3.3)
  ImageView<Vec3f> normals;           // that guided the refinement: given or derived, smoothed, the ground's made plain
  DepthSource source = DepthSource::network;  // given or found
  DepthTrust trust;                           // by how much the filled depth may be changed
  DepthNoise noise;                           // of the depth as given
  ImageView<float> filled;  // m; while steps work, the depth before it was filtered and refined; empty where it moves
                            // freely, and at the end, when `mesh_depth` has taken its memory
  ImageView<float> confidence;  // 1 where measured, falling to 0 where made up far from it; empty of a network's depth
  PlanarMap planes;             // of facades and the like; empty where normals are given
  GroundPlane ground;           // of the anchored depth; inlier_share 0: a guess
  RefineResult refinement;

  // What a mesh is made of.
  [[nodiscard]] ImageView<const float> surface_depth() const noexcept {
    return mesh_depth.empty() ? depth : mesh_depth;
  }
};

namespace refine_detail {

// Parameters in pixels, for an image of another width than they were chosen for.

[[nodiscard]] constexpr float reference_scale(const RefineDepthParams& params, Shape shape) noexcept {
  if (params.reference_width_px <= 0) return 1.0F;
  return static_cast<float>(shape.width) / static_cast<float>(params.reference_width_px);
}

[[nodiscard]] constexpr CrossBilateralParams scaled_filter(const RefineDepthParams& params, Shape shape) noexcept {
  CrossBilateralParams filter = params.filter;
  if (params.reference_width_px > 0) {
    const float sigma = filter.sigma_s_px * reference_scale(params, shape);
    filter.sigma_s_px = sigma < 0.5F ? 0.5F : sigma;  // a NaN stays one and is refused
  }
  return filter;
}

// With either reference or both: which one a scene has is not known here.
[[nodiscard]] constexpr std::size_t filter_workspace_bytes(const RefineDepthParams& params, Shape shape) noexcept {
  const CrossBilateralParams both = scaled_filter(params, shape);
  CrossBilateralParams labels = both;
  CrossBilateralParams colour = both;
  labels.use_colour = false;
  colour.use_labels = false;
  return max_of(cross_bilateral_workspace_bytes(both, shape), cross_bilateral_workspace_bytes(labels, shape),
                cross_bilateral_workspace_bytes(colour, shape));
}

// In a smaller image the same window would hold whole poles and persons. In a larger one it costs more and finds no
// more.
[[nodiscard]] constexpr OutlierParams scaled_outliers(const RefineDepthParams& params, Shape shape) noexcept {
  OutlierParams outliers = params.outliers;
  const float scale = reference_scale(params, shape);
  outliers.strip_margin_px *= scale;
  if (scale < 1.0F) {
    outliers.speck_radius_px = static_cast<int>(static_cast<float>(outliers.speck_radius_px) * scale + 0.5F);
  }
  return outliers;
}

[[nodiscard]] constexpr BorderSpillParams scaled_spill(BorderSpillParams spill, float scale) noexcept {
  spill.under_px *= scale;
  const float reach = static_cast<float>(spill.reach_px) * scale + 0.5F;
  spill.reach_px = static_cast<int>(reach < 128.0F ? reach : 128.0F);
  const float lines = static_cast<float>(spill.lines) * scale + 0.5F;
  spill.lines = static_cast<int>(lines < 8.0F ? lines : 8.0F);
  return spill;
}

[[nodiscard]] constexpr AnchorGroundParams scaled_anchor(const RefineDepthParams& params, Shape shape) noexcept {
  AnchorGroundParams anchor = params.anchor;
  anchor.surroundings_px =
      static_cast<int>(static_cast<float>(anchor.surroundings_px) * reference_scale(params, shape));
  return anchor;
}

[[nodiscard]] constexpr SharpenEdgesParams scaled_sharpening(const RefineDepthParams& params, Shape shape) noexcept {
  SharpenEdgesParams sharpen = params.sharpen;
  if (params.reference_width_px > 0) {
    const float radius = sharpen.radius_px * reference_scale(params, shape);
    sharpen.radius_px = radius > 64.0F ? 64.0F : radius;
  }
  return sharpen;
}

}  // namespace refine_detail

[[nodiscard]] inline Status validate(const RefineDepthParams& params) noexcept {
  if (!(params.border_jump >= 0.0F)) return {StatusCode::invalid_argument, "refine_depth: border_jump is not negative"};
  if (!(params.surface_jump >= 0.0F)) {
    return {StatusCode::invalid_argument, "refine_depth: surface_jump is not negative"};
  }
  if (!(params.plant_change >= 0.0F)) {
    return {StatusCode::invalid_argument, "refine_depth: plant_change is not negative"};
  }
  NPSIM_RETURN_IF_ERROR(validate(params.source));
  NPSIM_RETURN_IF_ERROR(validate(params.ground));
  NPSIM_RETURN_IF_ERROR(validate(params.outlines));
  NPSIM_RETURN_IF_ERROR(validate(params.outliers));
  NPSIM_RETURN_IF_ERROR(validate(params.fill));
  NPSIM_RETURN_IF_ERROR(validate(params.sharpen));
  NPSIM_RETURN_IF_ERROR(validate(params.anchor));
  NPSIM_RETURN_IF_ERROR(validate(params.filter));
  NPSIM_RETURN_IF_ERROR(validate(params.planes));
  NPSIM_RETURN_IF_ERROR(validate(params.uncertainty));
  NPSIM_RETURN_IF_ERROR(validate(params.normals));
  NPSIM_RETURN_IF_ERROR(validate(params.kerbs));
  NPSIM_RETURN_IF_ERROR(validate(params.ground_mismatches));
  NPSIM_RETURN_IF_ERROR(validate(params.smooth));
  NPSIM_RETURN_IF_ERROR(validate(params.spill));
  NPSIM_RETURN_IF_ERROR(validate(params.laser_spill));
  NPSIM_RETURN_IF_ERROR(validate(params.cars));
  NPSIM_RETURN_IF_ERROR(validate(params.furniture));
  NPSIM_RETURN_IF_ERROR(validate(params.masts));
  NPSIM_RETURN_IF_ERROR(validate(params.stand_before));
  NPSIM_RETURN_IF_ERROR(validate(params.contact));
  NPSIM_RETURN_IF_ERROR(validate(params.own_normals_loss));
  return validate(params.refine);
}

// What only the scene can tell: the filter at this size, and whether the scene has a reference for it.
[[nodiscard]] inline Status validate(const RefineDepthParams& params, const SceneView& scene) noexcept {
  const bool reference =
      !params.filter_one_reference || (scene.labels.empty() ? params.filter.use_colour : params.filter.use_labels);
  if (!reference) {
    return {StatusCode::invalid_argument, "refine_depth: the filter may not use the one reference that the scene has"};
  }
  return validate(refine_detail::scaled_filter(params, scene.shape()));
}

// The planes of RefinedDepth, and on top of them the step that takes most.
[[nodiscard]] constexpr std::size_t refine_depth_workspace_bytes(const RefineDepthParams& params,
                                                                 Shape shape) noexcept {
  const std::size_t pixels = shape.pixels();
  const std::size_t steps = max_of(
      allocation_bytes<float>(pixels) + fill_workspace_bytes(params.fill, shape) +
          max_of(ground_workspace_bytes(params.ground, shape), ground_markings_workspace_bytes(shape),
                 refine_detail::unlabelled_borders_workspace_bytes(shape),
                 refine_detail::unlabelled_matches_workspace_bytes(shape),
                 allocation_bytes<float>(static_cast<std::size_t>(shape.width))),
      allocation_bytes<float>(pixels) + allocation_bytes<std::uint8_t>(pixels) +
          max_of(find_sky_workspace_bytes(shape), ground_workspace_bytes(params.ground, shape),
                 refine_detail::guess_labels_workspace_bytes(shape),
                 refine_detail::unlabelled_matches_workspace_bytes(shape)),
      sharpen_edges_workspace_bytes(params.sharpen, shape) + allocation_bytes<float>(pixels),
      anchor_ground_workspace_bytes(shape),
      allocation_bytes<Vec3f>(pixels) + allocation_bytes<float>(pixels) + allocation_bytes<std::uint16_t>(pixels) +
          refine_detail::filter_workspace_bytes(params, shape),
      plant_outlines_workspace_bytes(params.outlines, shape), sign_outlines_workspace_bytes(shape),
      allocation_bytes<float>(pixels) + place_beyond_range_workspace_bytes(shape),
      planar_segments_workspace_bytes(params.planes, shape), uncertainty_workspace_bytes(params.uncertainty, shape),
      guiding_normals_workspace_bytes(params.normals, shape),
      refine_workspace_bytes(params.refine, shape) + allocation_bytes<std::uint8_t>(pixels),
      kerb_faces_workspace_bytes(shape), ground_mismatches_workspace_bytes(shape),
      smooth_surfaces_workspace_bytes(shape), stand_poles_workspace_bytes(shape), stand_before_workspace_bytes(shape),
      shape_cars_workspace_bytes(params.cars, shape));
  return 3 * allocation_bytes<float>(pixels) + 4 * allocation_bytes<std::uint8_t>(pixels) +
         allocation_bytes<Vec3f>(pixels) + planar_map_bytes(params.planes, shape) + steps + kWorkspaceAlignment;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_REFINE_DEPTH_PARAMS_HPP
