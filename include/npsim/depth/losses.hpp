// SPDX-License-Identifier: Apache-2.0
// What the losses of normal-guided refinement are, equations (3.6) to (3.9), and their parameters.
//
//   L = lambda1 L_normal + lambda2 L_continuity + lambda3 L_depth
//   L_normal     = mean |n - N|^2, n the unit normal of the depth map, N the given one (unit length, facing the camera)
//   L_continuity = mean ((X . N)^2 + (Y . N)^2) (1 - U), X and Y the tangents of the depth map
//   L_depth      = mean ((d - d_est) / depth_unit_m)^2, or relative: mean ((d - d_est) / d_est)^2
// With a = u - cx, b = v - cy and the relative slopes s_x = z_u / z, s_y = z_v / z,
//   n ~ (fx s_x, fy s_y, -(1 + a s_x + b s_y)),  X = (1 + a s_x, b fx/fy s_x, fx s_x),  Y likewise:
// perspective tangents per metre of motion parallel to the image. The thesis' tangents are the case a = b = 0.
// Slopes are forward differences: (z' - z) / z as printed for the thesis' form, (z' - z) / z' for the perspective one,
// which makes the normal exact on planes (see normals.hpp).
// A pixel has the normal and continuity terms if its depth, its right and its lower neighbour's, and its normal are
// there; the last row and column have none. Both are divided by the number of such pixels, uncertain ones included
// (the n of (3.7)); L_depth by the number of pixels with depth. Pixels outside 1e-3..1e5 m count as having none.
//
// L_continuity as printed depends on resolution: fx multiplies a depth edge, so the loss of one scene grows with its
// width (23, 57, 187 at 512, 960, 1920 px). ContinuityForm::unit_tangents divides X and Y by their lengths: the squared
// sine between the depth map's tangent and the given surface, at most 1 a direction, the same at every resolution.
//
// refine.hpp minimises them, and evaluates them once, with their gradient.
#ifndef NPSIM_DEPTH_LOSSES_HPP
#define NPSIM_DEPTH_LOSSES_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/normals.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

enum class ContinuityForm : std::uint8_t { printed, unit_tangents };
enum class DepthTerm : std::uint8_t { metric, relative };

// One factor per term: the lambdas of (3.9), and the weights of a label.
struct LossWeights {
  float normal = 1;
  float continuity = 1;
  float depth = 1;
};

inline constexpr LossWeights kLambdaThesis{1, 5, 1};      // appendix B, whose argument it agrees with
inline constexpr LossWeights kLambdaSection343{1, 1, 5};  // as section 3.4.3 prints it
inline constexpr LossWeights kLambdaSolo{1, 50, 1};       // the published successor (WACV 2025)

// For the relative depth term. Depth holds low frequencies, normals the high ones: at 1000 they balance at wavelengths
// of some 100 px, so that noise in the normals does not drift into depth over longer distances.
inline constexpr LossWeights kLambdaDefault{1, 5, 1000};

// The successor's weights on road and pavement, where predicted normals are worst: 5 for depth, 1e-4 for normals.
[[nodiscard]] constexpr std::array<LossWeights, kLabelCount> solo_label_weights() noexcept {
  std::array<LossWeights, kLabelCount> weights{};
  weights[label::road] = {1e-4F, 1e-4F, 5};
  weights[label::sidewalk] = {1e-4F, 1e-4F, 5};
  return weights;
}

struct LossParams {
  TangentForm tangents = TangentForm::perspective;
  ContinuityForm continuity = ContinuityForm::printed;
  DepthTerm depth_term = DepthTerm::metric;
  LossWeights lambda = kLambdaThesis;
  // Of metric L_depth, and of Adam's rate. 80 is the depth range that the thesis' network works in; 1 for metres.
  float depth_unit_m = 80;
  bool normal_in_uncertain = true;  // (3.6) has no (1 - U); false drops L_normal where U is 1
};

// T is float, or double where gradients are checked. uncertain and labels may be empty; label_weights too, and labels
// beyond its end weigh 1. Normals need not have unit length; zero or not finite: no normal.
template <class T>
struct LossInput {
  ImageView<const T> depth_est;
  ImageView<const Vec3<T>> normals;
  ImageView<const std::uint8_t> uncertain;  // U of (3.3): 0 or not
  ImageView<const Label> labels;
  Span<const LossWeights> label_weights;
  Intrinsics intrinsics;
};

struct LossValues {
  double total = 0;
  double normal = 0;  // the terms before lambda
  double continuity = 0;
  double depth = 0;
  std::size_t normal_count = 0;  // pixels that have the term
  std::size_t depth_count = 0;
};

namespace depth_detail {

[[nodiscard]] constexpr bool usable(const LossWeights& w) noexcept {
  const auto in_range = [](float v) { return v >= 0 && v <= 1e6F; };  // false for NaN
  return in_range(w.normal) && in_range(w.continuity) && in_range(w.depth);
}

}  // namespace depth_detail

[[nodiscard]] inline Status validate(const LossParams& params) noexcept {
  if (!depth_detail::usable(params.lambda)) {
    return {StatusCode::invalid_argument, "losses: each lambda must lie in 0..1e6"};
  }
  if (!(params.depth_unit_m >= 1e-3F && params.depth_unit_m <= 1e5F)) {
    return {StatusCode::invalid_argument, "losses: depth_unit_m must lie in 1e-3..1e5"};
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_LOSSES_HPP
