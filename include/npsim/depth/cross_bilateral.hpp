// SPDX-License-Identifier: Apache-2.0
// Dual-reference cross-bilateral filter, equation (3.2): depth averaged over pixels of the same label or colour.
//
//   d(p) = sum_q Gs(|q - p|) [delta(h(q), h(p)) + mu Gc(|J(q) - J(p)|)] d^(q)  /  the same sum without d^(q)
// with G(r) = exp(-r^2 / (2 sigma^2)), delta = 1 for equal labels, J in CIELAB (Delta E 1976), q in the square window
// of the given radius. Samples outside the image and samples whose depth is invalid have weight 0; a sample or centre
// whose colour is not finite, or beyond 1e9, has colour weight 0. A pixel that itself is invalid stays so, unless all
// pixels are asked for: then it is computed from its neighbours. Where the weights sum to less than 1e-12 the result is
// 0 (invalid). Any positive plane may stand for the depth, inverse depth say, with values in 1e-25..1e25.
//
// The two terms are summed apart, labels by masked Gaussians (detail/cross_bilateral/label.hpp), colours tap by tap
// (colour.hpp there). Every tap of the equation is evaluated, except blocks of which it is proven that they do not
// matter to the bound.
// Error: the caller bounds it; the method is the cheapest that provably keeps the bound, and what it keeps is returned.
// The bound is relative and holds for every pixel with depth and colour, or whose weights sum to mu, where depths in
// one window differ by a factor of 1000 at most; beyond, it grows by 7 %, and by 3e-7 per further factor of 2. At R =
// 30 and the default bound of 2e-5, measured against double: at most 5.4e-6, on images made to be hard; 2.9e-7 on a
// street. Label term alone: bound 9.6e-7, measured 3e-7. Tightest bound that can be asked at R = 30: 1.22e-5, with
// labels alone 9.6e-7. It grows with R: the default can be kept up to R = 1100 in images of any size. Depths outside
// 1e-25..1e25 are outside the promise.
// Cost: colour makes nearly all of it, (2R + 1)^2 / 2 weights per pixel. Memory at R = 30: 54 bytes per pixel, 12 with
// labels alone, 41 with colour alone.
// The same bits for every number of lanes and threads.
#ifndef NPSIM_DEPTH_CROSS_BILATERAL_HPP
#define NPSIM_DEPTH_CROSS_BILATERAL_HPP

#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/cross_bilateral/filter.hpp"
#include "npsim/depth/detail/cross_bilateral/grids.hpp"
#include "npsim/depth/detail/cross_bilateral/plan.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Section 3.4.1.
inline constexpr float kCrossBilateralMu = 5.0F;
// What the code of Sakaridis et al. (ECCV 2018) amounts to: it normalises its grid kernels to sum 1, which turns the
// same 5 into 5 / (1 + 2 exp(-1/2))^3 here.
inline constexpr float kCrossBilateralMuCitedCode = 0.461307F;

struct CrossBilateralParams {
  float mu = kCrossBilateralMu;  // weight of the colour term, >= 0
  float sigma_s_px = 10.0F;      // section 3.4.1
  float sigma_c = 5.0F;          // section 3.4.1, CIELAB units, in 1e-3..1e6
  int radius_px = -1;            // half the window's side, centre excluded; negative: ceil(3 sigma_s)
  bool use_labels = true;
  bool use_colour = true;
  // How far the result may be from equation (3.2) evaluated without rounding, relative to the result, for the pixels
  // and depths that the first comment names. At R = 30 no less than 1.22e-5 can be asked, with labels alone 9.6e-7.
  float max_relative_error = 2e-5F;
};

enum class CrossBilateralMethod {
  label_sums,         // no colour: separable sums, and nothing else
  quintic_weights,    // colour weights within 3e-7
  quartic_weights,    // 2.7e-6; with the default bound
  cubic_weights,      // 7.5e-5
  quadratic_weights,  // 1.7e-3
};

struct CrossBilateralResult {
  CrossBilateralMethod method = CrossBilateralMethod::label_sums;
  // For the pixels and depths that the first comment names.
  float relative_error_bound = 0.0F;
};

// Which pixels get a value.
enum class FilteredPixels : std::uint8_t {
  with_depth,  // what has no depth (the sky) stays without
  all,         // as equation (3.2) has it
};

[[nodiscard]] inline Status validate(const CrossBilateralParams& params) noexcept {
  const auto in_range = [](float v, float low, float high) { return v >= low && v <= high; };  // false for NaN
  if (!in_range(params.mu, 0.0F, 1e6F)) {
    return {StatusCode::invalid_argument, "cross_bilateral: mu must lie in 0..1e6"};
  }
  if (!in_range(params.sigma_s_px, 1e-3F, 1e6F) || !in_range(params.sigma_c, 1e-3F, 1e6F)) {
    return {StatusCode::invalid_argument, "cross_bilateral: sigma_s_px and sigma_c must lie in 1e-3..1e6"};
  }
  if (!(params.max_relative_error > 0.0F)) {
    return {StatusCode::invalid_argument, "cross_bilateral: max_relative_error must be positive"};
  }
  if (!params.use_labels && !(params.use_colour && params.mu > 0.0F)) {
    return {StatusCode::invalid_argument, "cross_bilateral: neither labels nor colour would be used"};
  }
  return {};
}

// A window wider than the image adds nothing.
[[nodiscard]] constexpr int cross_bilateral_radius(const CrossBilateralParams& params, Shape shape) noexcept {
  const int side = shape.width > shape.height ? shape.width : shape.height;
  if (params.radius_px >= 0) return params.radius_px < side ? params.radius_px : side;
  const float three_sigma = 3.0F * params.sigma_s_px;
  if (!(three_sigma < static_cast<float>(side))) return side;
  const int below = three_sigma > 0.0F ? static_cast<int>(three_sigma) : 0;
  return static_cast<float>(below) < three_sigma ? below + 1 : below;
}

[[nodiscard]] constexpr std::size_t cross_bilateral_workspace_bytes(const CrossBilateralParams& params,
                                                                    Shape shape) noexcept {
  using namespace cross_bilateral_detail;
  if (shape.empty()) return kWorkspaceAlignment;
  const int radius = cross_bilateral_radius(params, shape);
  const ColourGrid g = colour_grid(shape, radius);
  const bool colour = params.use_colour && params.mu > 0.0F;
  return kWorkspaceAlignment + allocation_bytes<float>(g.samples()) +
         (params.use_labels ? label_workspace_bytes(label_grid(shape, radius), !colour) : 0) +
         (colour ? colour_workspace_bytes(g) : 0);
}

namespace cross_bilateral_detail {

[[nodiscard]] constexpr FilterTerms filter_terms(const CrossBilateralParams& params, Shape shape,
                                                 FilteredPixels pixels) noexcept {
  FilterTerms terms;
  terms.mu = params.mu;
  terms.sigma_s_px = params.sigma_s_px;
  terms.sigma_c = params.sigma_c;
  terms.radius_px = cross_bilateral_radius(params, shape);
  terms.labels = params.use_labels;
  terms.colour = params.use_colour && params.mu > 0.0F;
  terms.keep_invalid = pixels == FilteredPixels::with_depth;
  terms.max_relative_error = params.max_relative_error;
  return terms;
}

[[nodiscard]] constexpr CrossBilateralResult filter_result(const FilterPlan& plan) noexcept {
  constexpr CrossBilateralMethod kMethods[] = {
      CrossBilateralMethod::quadratic_weights, CrossBilateralMethod::cubic_weights,
      CrossBilateralMethod::quartic_weights, CrossBilateralMethod::quintic_weights};
  return {plan.degree == 0 ? CrossBilateralMethod::label_sums : kMethods[plan.degree - kMinDegree],
          plan.relative_error_bound};
}

}  // namespace cross_bilateral_detail

// depth: metres. labels: 8- or 16-bit classes or instances (may be empty without use_labels). lab: CIELAB (may be empty
// without use_colour). output: the shape of depth, 0 where invalid; it may be the same memory as depth.
template <class AnyLabel, class Executor>
[[nodiscard]] Status cross_bilateral(const CrossBilateralParams& params, ImageView<const float> depth,
                                     ImageView<AnyLabel> labels, ImageView<const Vec3f> lab, ImageView<float> output,
                                     CrossBilateralResult& result, Workspace& workspace, Executor& executor,
                                     FilteredPixels pixels = FilteredPixels::with_depth) noexcept {
  using namespace cross_bilateral_detail;
  using LabelPixel = std::remove_const_t<AnyLabel>;
  static_assert(std::is_same_v<LabelPixel, std::uint8_t> || std::is_same_v<LabelPixel, std::uint16_t>,
                "labels are 8- or 16-bit and unsigned");
  NPSIM_RETURN_IF_ERROR(validate(params));
  if (depth.empty()) return {StatusCode::no_valid_input, "cross_bilateral: the depth image is empty"};
  const Shape shape = depth.shape();
  const FilterTerms terms = filter_terms(params, shape, pixels);
  if (output.empty() || output.shape() != shape || (terms.labels && (labels.empty() || labels.shape() != shape)) ||
      (terms.colour && (lab.empty() || lab.shape() != shape))) {
    return {StatusCode::shape_mismatch, "cross_bilateral: labels, lab and output must have the shape of the depth"};
  }
  const FilterPlan plan = filter_plan(terms, shape);
  if (!plan.possible) {
    return {StatusCode::invalid_argument, "cross_bilateral: max_relative_error is below what floats can hold"};
  }
  NPSIM_RETURN_IF_ERROR(filter_with<simd::F32>(terms, plan, depth, ImageView<const LabelPixel>(labels), lab, output,
                                               workspace, executor));
  result = filter_result(plan);
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_CROSS_BILATERAL_HPP
