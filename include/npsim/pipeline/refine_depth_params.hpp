// SPDX-License-Identifier: Apache-2.0
// What refine_depth is asked for: the parameters of its steps, by default what measured better than the text, or as the
// thesis has it, and their sizes in pixels for an image of another width.
//
// Each default's figures on generated streets stand in docs/guide.md.
#ifndef NPSIM_PIPELINE_REFINE_DEPTH_PARAMS_HPP
#define NPSIM_PIPELINE_REFINE_DEPTH_PARAMS_HPP

#include "npsim/core/image_view.hpp"
#include "npsim/depth/anchor_ground.hpp"
#include "npsim/depth/cross_bilateral.hpp"
#include "npsim/depth/fill.hpp"
#include "npsim/depth/guiding_normals.hpp"
#include "npsim/depth/outliers.hpp"
#include "npsim/depth/refine.hpp"
#include "npsim/depth/sharpen_edges.hpp"
#include "npsim/depth/uncertainty.hpp"
#include "npsim/geometry/ground.hpp"

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

struct RefineDepthParams {
  bool drop_outliers = true;
  OutlierParams outliers;
  FillParams fill;
  SharpenEdgesParams sharpen;
  AnchorGroundParams anchor;
  GroundParams ground;  // of all that needs the ground plane
  CrossBilateralParams filter = default_depth_filter();
  // The filter's sigma_s and the radii of sharpening and of the search for specks are for images this wide and scale
  // with the width; 0: as they are.
  int reference_width_px = 960;
  bool filter_inverse_depth = true;
  // Labels (instances where there are any) alone, as the method's successor does: the colours of road and pavement are
  // too alike to hold a kerb. Without labels colour alone. false: both, as (3.2) has it.
  bool filter_one_reference = true;
  UncertaintyParams uncertainty;
  GuidingNormalsParams normals;
  RefineParams refine = default_depth_refinement();
  // The U of the refinement: pixels whose neighbour belongs to another object that is farther or nearer by more than
  // this share. The slopes there lead from surface to surface, all others are a surface's own. 0: (3.3) as in the text.
  float border_jump = 0.02F;

  [[nodiscard]] static RefineDepthParams thesis() noexcept {
    RefineDepthParams params;
    params.drop_outliers = false;
    params.sharpen.radius_px = 0;
    params.anchor.enabled = false;
    params.filter = CrossBilateralParams{};
    params.reference_width_px = 0;
    params.filter_inverse_depth = false;
    params.filter_one_reference = false;
    params.normals.form.tangents = TangentForm::thesis;
    params.normals.derived_smoothing.iterations = 0;
    params.normals.given_smoothing.iterations = 0;
    params.normals.ground.enabled = false;
    params.refine = thesis_refine_params();
    params.border_jump = 0;
    return params;
  }
};

namespace refine_detail {

[[nodiscard]] inline float reference_scale(const RefineDepthParams& params, Shape shape) noexcept {
  if (params.reference_width_px <= 0) return 1.0F;
  return static_cast<float>(shape.width) / static_cast<float>(params.reference_width_px);
}

[[nodiscard]] inline CrossBilateralParams scaled_filter(const RefineDepthParams& params, Shape shape) noexcept {
  CrossBilateralParams filter = params.filter;
  filter.keep_invalid = true;
  if (params.reference_width_px > 0) {
    const float sigma = filter.sigma_s_px * reference_scale(params, shape);
    filter.sigma_s_px = sigma < 0.5F ? 0.5F : sigma;  // a NaN stays one and is refused
  }
  return filter;
}

// In a smaller image the same window would hold whole poles and persons. In a larger one it costs more and finds no
// more.
[[nodiscard]] inline OutlierParams scaled_outliers(const RefineDepthParams& params, Shape shape) noexcept {
  OutlierParams outliers = params.outliers;
  const float scale = reference_scale(params, shape);
  if (scale < 1.0F) {
    outliers.speck_radius_px = static_cast<int>(static_cast<float>(outliers.speck_radius_px) * scale + 0.5F);
  }
  return outliers;
}

[[nodiscard]] inline AnchorGroundParams scaled_anchor(const RefineDepthParams& params, Shape shape) noexcept {
  AnchorGroundParams anchor = params.anchor;
  anchor.surroundings_px =
      static_cast<int>(static_cast<float>(anchor.surroundings_px) * reference_scale(params, shape));
  return anchor;
}

[[nodiscard]] inline SharpenEdgesParams scaled_sharpening(const RefineDepthParams& params, Shape shape) noexcept {
  SharpenEdgesParams sharpen = params.sharpen;
  if (params.reference_width_px > 0) {
    const float radius = sharpen.radius_px * reference_scale(params, shape);
    sharpen.radius_px = radius > 64.0F ? 64.0F : radius;
  }
  return sharpen;
}
}  // namespace refine_detail

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_REFINE_DEPTH_PARAMS_HPP
