// SPDX-License-Identifier: Apache-2.0
// Every kernel of depth refinement states its memory and checks its parameters before it runs: sizes are constants, so
// that memory can be static, and validate() refuses what the kernel would.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/cross_bilateral.hpp"
#include "npsim/depth/detail/estimated/anchor_ground.hpp"
#include "npsim/depth/detail/estimated/sharpen_edges.hpp"
#include "npsim/depth/detail/given/outliers.hpp"
#include "npsim/depth/detail/normals/guiding_normals.hpp"
#include "npsim/depth/fill.hpp"
#include "npsim/depth/normals.hpp"
#include "npsim/depth/refine.hpp"
#include "npsim/depth/uncertainty.hpp"

using namespace npsim;

namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
constexpr Shape kShape{64, 48};

static_assert(fill_workspace_bytes({}, kShape) >= 9 * kShape.pixels());
static_assert(sharpen_edges_workspace_bytes({}, kShape) >= 8 * kShape.pixels());
static_assert(anchor_ground_workspace_bytes(kShape) >= 20 * kShape.pixels());
static_assert(cross_bilateral_workspace_bytes({}, kShape) == 532032);
static_assert(uncertainty_workspace_bytes({}, kShape) == 448);
static_assert(normals_workspace_bytes({}, kShape) == 0);
static_assert(smooth_normals_workspace_bytes({}, kShape) >= sizeof(Vec3f) * kShape.pixels());
static_assert(guiding_normals_workspace_bytes({}, kShape) >= 2 * sizeof(Vec3f) * kShape.pixels());
static_assert(depth_losses_workspace_bytes<float>({}, kShape) >= 9 * sizeof(float) * kShape.pixels());
static_assert(refine_workspace_bytes({}, kShape) == 376960);
static_assert(refine_workspace_bytes(thesis_refine_params(), kShape) == 182720);

constexpr CrossBilateralParams labels_alone() {
  CrossBilateralParams p;
  p.use_colour = false;
  return p;
}
constexpr CrossBilateralParams with_sigma(float sigma_s_px) {
  CrossBilateralParams p;
  p.sigma_s_px = sigma_s_px;
  return p;
}

// What a vehicle's memory map would hold.
alignas(kWorkspaceAlignment) unsigned char filter_memory[cross_bilateral_workspace_bytes(labels_alone(), kShape)];
alignas(kWorkspaceAlignment) unsigned char refine_memory[refine_workspace_bytes({}, kShape)];

}  // namespace

TEST_CASE("the filter's radius is 3 sigma rounded up, or the image's longer side, as a constant too") {
  static_assert(cross_bilateral_radius(with_sigma(10.0F), kShape) == 30);
  static_assert(cross_bilateral_radius(with_sigma(10.000001F), kShape) == 31);
  static_assert(cross_bilateral_radius(with_sigma(1e-3F), kShape) == 1);
  static_assert(cross_bilateral_radius(with_sigma(1e6F), kShape) == 64);
  for (float sigma = 0.001F; sigma < 30.0F; sigma *= 1.003F) {
    const float exact = std::ceil(3.0F * sigma);
    CHECK(cross_bilateral_radius(with_sigma(sigma), kShape) == (exact < 64.0F ? static_cast<int>(exact) : 64));
  }
  CHECK(cross_bilateral_radius(with_sigma(kNaN), kShape) == 64);
  CHECK(cross_bilateral_radius(with_sigma(-1.0F), kShape) == 0);
}

TEST_CASE("kernels run in static memory that was sized when the program was compiled") {
  const std::vector<float> depth(kShape.pixels(), 8.0F);
  const std::vector<Label> labels(kShape.pixels(), label::road);
  const std::vector<Vec3f> normals(kShape.pixels(), Vec3f{0, 0, -1});
  std::vector<float> out(kShape.pixels());
  const SerialExecutor serial;
  Workspace filter(filter_memory, sizeof(filter_memory));
  CrossBilateralResult filtered;
  REQUIRE(cross_bilateral(labels_alone(), ImageView<const float>(depth.data(), kShape),
                          ImageView<const Label>(labels.data(), kShape), {}, ImageView<float>(out.data(), kShape),
                          filtered, filter, serial)
              .ok());
  CHECK(std::fabs(out[100] - 8.0F) < 1e-5F);
  Workspace refine(refine_memory, sizeof(refine_memory));
  LossInput<float> input;
  input.depth_est = {depth.data(), kShape};
  input.normals = {normals.data(), kShape};
  input.intrinsics = {60.0F, 60.0F, 32.0F, 24.0F};
  RefineResult refined;
  REQUIRE(refine_with_normals({}, input, {out.data(), kShape}, {}, refined, refine, serial).ok());
  CHECK(std::fabs(out[100] - 8.0F) < 1e-3F);
}

TEST_CASE("validate: defaults and presets pass, what a kernel would refuse does not") {
  CHECK(validate(OutlierParams{}).ok());
  CHECK(validate(FillParams{}).ok());
  CHECK(validate(SharpenEdgesParams{}).ok());
  CHECK(validate(AnchorGroundParams{}).ok());
  CHECK(validate(CrossBilateralParams{}).ok());
  CHECK(validate(UncertaintyParams{}).ok());
  CHECK(validate(SmoothNormalsParams{}).ok());
  CHECK(validate(GuidingNormalsParams{}).ok());
  CHECK(validate(LossParams{}).ok());
  CHECK(validate(RefineParams{}).ok());
  CHECK(validate(thesis_refine_params()).ok());

  const auto refuses = [](auto params, auto&& change) {
    change(params);
    return validate(params).code() == StatusCode::invalid_argument;
  };
  CHECK(refuses(OutlierParams{}, [](OutlierParams& p) { p.speck_radius_px = 33; }));
  CHECK(refuses(OutlierParams{}, [](OutlierParams& p) { p.ground_slope = kNaN; }));
  CHECK(refuses(FillParams{}, [](FillParams& p) { p.relaxation = 2.0F; }));
  CHECK(refuses(FillParams{}, [](FillParams& p) { p.ground_outlier = kNaN; }));
  CHECK(refuses(SharpenEdgesParams{}, [](SharpenEdgesParams& p) { p.radius_px = 65.0F; }));
  CHECK(refuses(SharpenEdgesParams{}, [](SharpenEdgesParams& p) { p.min_change = kNaN; }));
  CHECK(refuses(AnchorGroundParams{}, [](AnchorGroundParams& p) { p.height_trust = 1.5F; }));
  CHECK(refuses(CrossBilateralParams{}, [](CrossBilateralParams& p) { p.sigma_s_px = kNaN; }));
  CHECK(refuses(CrossBilateralParams{}, [](CrossBilateralParams& p) { p.use_labels = p.use_colour = false; }));
  CHECK(refuses(UncertaintyParams{}, [](UncertaintyParams& p) { p.window_px = 0; }));
  CHECK(refuses(UncertaintyParams{}, [](UncertaintyParams& p) { p.variance_m2 = -1.0; }));
  CHECK(refuses(SmoothNormalsParams{}, [](SmoothNormalsParams& p) { p.iterations = 9; }));
  CHECK(refuses(SmoothNormalsParams{}, [](SmoothNormalsParams& p) { p.normal_sigma = 0; }));
  CHECK(refuses(GuidingNormalsParams{}, [](GuidingNormalsParams& p) { p.ground.smoothing.depth_sigma = kNaN; }));
  CHECK(refuses(LossParams{}, [](LossParams& p) { p.depth_unit_m = 0.0F; }));
  CHECK(refuses(LossParams{}, [](LossParams& p) { p.lambda.normal = kNaN; }));
  CHECK(refuses(RefineParams{}, [](RefineParams& p) { p.loss.depth_unit_m = kNaN; }));
  CHECK(refuses(RefineParams{}, [](RefineParams& p) { p.gauss_newton.inner_steps = 0; }));
}
