// SPDX-License-Identifier: Apache-2.0
// What the cross-bilateral filter is asked for, the method that this selects, the error it guarantees and the memory.
//
// The method is the lowest degree of the polynomial for 2^x whose bound leaves at least a twentieth of what the caller
// allows; the rest is for leaving out blocks that cannot matter. So looser bounds are faster on both counts.
#ifndef NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_PARAMS_HPP
#define NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_PARAMS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/cross_bilateral/colour.hpp"
#include "npsim/depth/detail/cross_bilateral/label_grid.hpp"

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
  bool keep_invalid = false;  // leave pixels without depth (the sky) without depth
  // What the result may differ from equation (3.2) evaluated without rounding, relative to the result, for the pixels
  // and depths that cross_bilateral.hpp names. At R = 30 no less than 1.22e-5 can be asked, with labels alone 9.6e-7.
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
  // Holds for every pixel with depth and colour, or whose weights sum to mu, where depths in one window differ by a
  // factor of 1000 at most and lie in 1e-25..1e25; beyond, it grows by 7 %, and by 3e-7 per further factor of 2.
  float relative_error_bound = 0.0F;
};

[[nodiscard]] inline int cross_bilateral_radius(const CrossBilateralParams& params, Shape shape) noexcept {
  const int side = shape.width > shape.height ? shape.width : shape.height;
  if (params.radius_px >= 0) return params.radius_px < side ? params.radius_px : side;
  const float radius = std::ceil(3.0F * params.sigma_s_px);  // a window wider than the image adds nothing
  return radius < static_cast<float>(side) ? static_cast<int>(radius) : side;
}

namespace cross_bilateral_detail {

[[nodiscard]] constexpr bool uses_colour(const CrossBilateralParams& params) noexcept {
  return params.use_colour && params.mu > 0;
}

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
  if (!params.use_labels && !uses_colour(params)) {
    return {StatusCode::invalid_argument, "cross_bilateral: neither labels nor colour would be used"};
  }
  return {};
}

struct CrossBilateralPlan {
  bool possible = false;
  int degree = 0;           // of the polynomial for 2^x; 0 without colour
  double prune_error = 0;   // of either sum, relative; 0: nothing is left out
  double scaled_error = 0;  // of the mean, relative: what pairs in the scaled form may do, all errors together
  CrossBilateralResult result;
};

inline constexpr double kLn2 = 0.6931471805599453;

// The largest mean of -x over n weights 2^x next to one of weight 1: x0 - 1 / ln 2 with n 2^-x0 = x0 ln 2 - 1.
[[nodiscard]] inline double mean_exponent(double n) noexcept {
  double x = 4 + std::log2(n + 1);
  for (int i = 0; i < 20; ++i) x = std::log2((n + 1) / (x * kLn2 > 1.1 ? x * kLn2 - 1 : 0.1));
  return (x > 2 ? x - 1 / kLn2 : 1.0) + 0.1;
}

// What errors of weights can do to a mean of depths z: each weight w = 2^-x counts in the shares p of the denominator
// and r of the numerator, its error e with r - p, so that the mean is off by at most sum |r - p| e. Where r < p let A
// be the sum of w, elsewhere B that of w z, in units of the least z; z <= ratio. With a weight of 1 at the centre the
// denominator is at least 1 + A and the numerator 1 + A + B. x = s + c, of which s is known, by the distance, and c is
// the colour's: w = G 2^-c. An error of 4 s + 7 c is 7 log2(G^(3/7) / w), so that by concavity
//   sum |r - p| (4 s + 7 c) <= 7 A log2(n / A) / (1 + A) + 7 B log2(ratio n / B) / (1 + A + B),   n = sum G^(3/7),
// and with square roots of c and of the logarithms alike, n = sum G. Without the centre, but weights of sum 1 or more,
// the denominators are at least 1 and A or A + B. Largest over A and B; the grid misses less than the 1 % that is
// added.
struct MeanExponents {
  double mean = 0;                 // of (4 s + 7 c) / 7, with which errors grow that come from roundings
  double mean_root = 0;            // of sqrt(c)
  double mean_without_centre = 0;  // as mean
};

// What all weights of a window sum to where no colour differs, with Gs to some power.
[[nodiscard]] inline double sum_of_taps(const ColourGrid& g, double sigma_s, double power) noexcept {
  const auto along = [&](int r) {
    double sum = 1;
    for (int i = 1; i <= r; ++i) sum += 2 * std::exp(-0.5 * power * (double(i) / sigma_s) * (double(i) / sigma_s));
    return sum;
  };
  return along(g.rx) * along(g.ry);
}

[[nodiscard]] inline MeanExponents mean_exponents(const ColourGrid& g, double sigma_s, double ratio) noexcept {
  const double taps = sum_of_taps(g, sigma_s, 1);
  const double n = sum_of_taps(g, sigma_s, 3.0 / 7.0);
  MeanExponents out;
  const auto raise = [](double& most, double x) { most = x > most ? x : most; };
  const auto on_grid = [](double last, auto&& f) {
    for (double x = 0x1p-6; x < last; x *= 1.4142135623730951) f(x);
    f(last);
  };
  on_grid(ratio * taps, [&](double b) {
    const double of_b = b * std::log2(ratio * n / b);
    const double root_of_b = b * std::sqrt(std::log2(ratio * taps / b));
    on_grid(taps, [&](double a) {
      const double log_a = std::log2(n / a);
      raise(out.mean, a * log_a / (1 + a) + of_b / (1 + a + b));
      raise(out.mean_root, a * std::sqrt(std::log2(taps / a)) / (1 + a) + root_of_b / (1 + a + b));
      raise(out.mean_without_centre, a * log_a / std::max(a, 1.0) + of_b / std::max(a + b, 1.0));
    });
  });
  out.mean *= 1.01;
  out.mean_root *= 1.01;
  out.mean_without_centre *= 1.01;
  return out;
}

inline constexpr double kRounding = 0x1p-24;
inline constexpr double kExponentRounding = kRounding * kLn2;
inline constexpr double kMostDepthRatio = 1000;  // of the depths in a window, as far as the bound is promised
inline constexpr double kMostNear = 64;          // far beyond all colours that there are

// Of a colour, so that squared distances are powers of two.
[[nodiscard]] inline double root_scale(const CrossBilateralParams& params) noexcept {
  return std::sqrt(0.5 * 1.4426950408889634) / static_cast<double>(params.sigma_c);
}

// What a mean of depths is off by, relative: what all pairs do, and what the scaled form adds once, and per unit of the
// distance of p's scaled colours from 0.
struct PairErrors {
  double all = 0, scaled = 0, per_near = 0;
};

// How far the square of the float of root_scale is off, relative.
[[nodiscard]] inline double scale_error(const CrossBilateralParams& params) noexcept {
  const double exact = root_scale(params);
  return std::fabs(static_cast<double>(static_cast<float>(exact)) / exact - 1) * 2;
}

// Of depths within `ratio` of each other, where each pixel has a weight of its own.
[[nodiscard]] inline PairErrors pair_errors(const CrossBilateralParams& params, const ColourGrid& g, int degree,
                                            const MeanExponents& exponents, double ratio) noexcept {
  // The most that the shares of numerator and denominator differ: errors between -e and e make 2 e of it.
  const double spread = 2 * (std::sqrt(ratio) - 1) / (std::sqrt(ratio) + 1);
  return {spread * kExp2Error[degree] + 2 * colour_chain(g) * kRounding + 7 * kExponentRounding * exponents.mean,
          scale_error(params) * kLn2 * exponents.mean, 4 * kExponentRounding * exponents.mean_root};
}

// Likewise where one of the sums is all labels, the other all colours. A mean of square roots is at most the root of
// the mean.
[[nodiscard]] inline PairErrors mixed_errors(const CrossBilateralParams& params, const ColourGrid& g, int degree,
                                             double label_sum, double ratio) noexcept {
  const double mean = mean_exponent(g.taps() * ratio);
  return {label_sum + kExp2Error[degree] + colour_chain(g) * kRounding + 7 * kExponentRounding * mean,
          scale_error(params) * kLn2 * mean, 4 * kExponentRounding * std::sqrt(mean)};
}

[[nodiscard]] inline double label_sum_error(const CrossBilateralParams& params, const LabelGrid& g) noexcept {
  return params.use_labels ? label_sum_roundings(g) * kRounding : 0.0;
}

[[nodiscard]] inline CrossBilateralPlan cross_bilateral_plan(const CrossBilateralParams& params, Shape shape) noexcept {
  const int radius = cross_bilateral_radius(params, shape);
  const ColourGrid g = colour_grid(shape, radius);
  const double allowed = static_cast<double>(params.max_relative_error);
  const LabelGrid label_sums = label_grid(shape, radius);
  const double label = params.use_labels ? label_roundings(label_sums) * kRounding : 0.0;
  const double last = 8 * kRounding;  // both terms together, mu, the division
  CrossBilateralPlan plan;
  double bound = label + last;
  if (!uses_colour(params)) {
    bound = 1.00001 * (label + kRounding);  // the division; and the products of the errors
    plan.possible = bound <= allowed;
    plan.result = {CrossBilateralMethod::label_sums, static_cast<float>(bound)};
    return plan;
  }
  const MeanExponents exponents = mean_exponents(g, static_cast<double>(params.sigma_s_px), kMostDepthRatio);
  for (int degree = kMinDegree; degree <= kMaxDegree; ++degree) {
    const PairErrors pairs = pair_errors(params, g, degree, exponents, kMostDepthRatio);
    const double without_centre = pairs.all + 7 * kExponentRounding * (exponents.mean_without_centre - exponents.mean);
    const double mixed = mixed_errors(params, g, degree, label_sum_error(params, label_sums), kMostDepthRatio).all;
    double worst = without_centre > pairs.all ? without_centre : pairs.all;
    if (label > worst) worst = label;
    if (params.use_labels && mixed > worst) worst = mixed;
    const double grown = 1 + 4 * kExp2Error[degree];
    bound = worst * grown + last;
    if (bound > (degree < kMaxDegree ? 0.95 : 1.0) * allowed) continue;
    // Three quarters of what is left may go to the scaled form, the rest to what is left out.
    const double most_scaled = pairs.all + pairs.scaled + pairs.per_near * kMostNear;
    plan.scaled_error = worst + 0.75 * (allowed - bound) / grown;
    if (plan.scaled_error > most_scaled) plan.scaled_error = most_scaled;
    if (plan.scaled_error > worst) bound = plan.scaled_error * grown + last;
    const double left = (allowed - bound) / (1 + allowed);
    plan.possible = true;
    plan.degree = degree;
    plan.prune_error = left / (1 + left);
    constexpr CrossBilateralMethod kMethods[] = {
        CrossBilateralMethod::quadratic_weights, CrossBilateralMethod::cubic_weights,
        CrossBilateralMethod::quartic_weights, CrossBilateralMethod::quintic_weights};
    plan.result = {kMethods[degree - kMinDegree], params.max_relative_error};
    return plan;
  }
  return plan;
}

// How far from 0 scaled colours of p may be in an image whose depths differ by a factor of `ratio`; -1: none may be.
// The nearer the depths lie to each other, the less errors of weights matter.
[[nodiscard]] inline float scaled_near(const CrossBilateralParams& params, const ColourGrid& g,
                                       const CrossBilateralPlan& plan, double ratio) noexcept {
  if (!(ratio < kMostDepthRatio)) ratio = kMostDepthRatio;
  const MeanExponents exponents = mean_exponents(g, static_cast<double>(params.sigma_s_px), ratio);
  const auto most_near = [&](const PairErrors& e) { return (plan.scaled_error - e.all - e.scaled) / e.per_near; };
  double near = std::min(kMostNear, most_near(pair_errors(params, g, plan.degree, exponents, ratio)));
  if (params.use_labels) {
    const double label_sum = label_sum_error(params, label_grid(g.shape, std::max(g.rx, g.ry)));
    near = std::min(near, most_near(mixed_errors(params, g, plan.degree, label_sum, ratio)));
  }
  return near > 0.5 ? static_cast<float>(0.999 * near) : -1.0F;
}

[[nodiscard]] inline std::size_t spatial_elements(const ColourGrid& g) noexcept {
  return static_cast<std::size_t>(2 * g.rx + 1) * static_cast<std::size_t>(g.ry + 1) + 2;  // two are read beyond
}
[[nodiscard]] inline std::size_t colour_sums_elements(const ColourGrid& g) noexcept {
  return g.sums_rows() * 4 * static_cast<std::size_t>(g.width);
}
[[nodiscard]] inline std::size_t colour_scratch_elements(const ColourGrid& g) noexcept {
  return static_cast<std::size_t>(g.strips) * (kOwnSums + g.skew_elements());
}

}  // namespace cross_bilateral_detail

[[nodiscard]] inline std::size_t cross_bilateral_workspace_bytes(const CrossBilateralParams& params,
                                                                 Shape shape) noexcept {
  using namespace cross_bilateral_detail;
  if (shape.empty()) return kWorkspaceAlignment;
  const int radius = cross_bilateral_radius(params, shape);
  const ColourGrid g = colour_grid(shape, radius);
  std::size_t bytes = kWorkspaceAlignment + allocation_bytes<float>(g.samples());
  if (params.use_labels) {
    bytes += label_workspace_bytes(label_grid(shape, radius), !uses_colour(params));
  }
  if (uses_colour(params)) {
    bytes += 3 * allocation_bytes<float>(g.samples()) + allocation_bytes<float>(block_elements(g)) +
             allocation_bytes<float>(spatial_elements(g)) + allocation_bytes<float>(colour_sums_elements(g)) +
             allocation_bytes<float>(colour_scratch_elements(g)) +
             allocation_bytes<float>(2 * static_cast<std::size_t>(shape.height));
  }
  return bytes;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_PARAMS_HPP
