// SPDX-License-Identifier: Apache-2.0
// Which method keeps the bound that the cross-bilateral filter was given, and what error it leaves to be spent.
//
// The method is the lowest degree of the polynomial for 2^x whose bound leaves at least a twentieth of what the caller
// allows; the rest is for the scaled form of the pairs and for leaving out blocks that cannot matter. So looser bounds
// are faster on all counts.
#ifndef NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_PLAN_HPP
#define NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_PLAN_HPP

#include <cmath>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/depth/detail/cross_bilateral/grids.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace cross_bilateral_detail {

inline constexpr int kMinDegree = 2, kMaxDegree = 5;
inline constexpr double kExp2Error[6] = {1, 1, 1.73e-3, 7.5e-5, 2.7e-6, 3e-7};  // by degree

// What the filter is asked for.
struct FilterTerms {
  float mu = 0, sigma_s_px = 0, sigma_c = 0;
  int radius_px = 0;
  bool labels = false, colour = false;
  bool keep_invalid = false;  // pixels without depth stay so
  float max_relative_error = 0;
};

struct FilterPlan {
  bool possible = false;
  int degree = 0;           // of the polynomial for 2^x; 0 without colour
  double prune_error = 0;   // of either sum, relative; 0: nothing is left out
  double scaled_error = 0;  // of the mean, relative: what pairs in the scaled form may do, all errors together
  float relative_error_bound = 0;
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
      raise(out.mean_without_centre, a * log_a / (a > 1 ? a : 1) + of_b / (a + b > 1 ? a + b : 1));
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
[[nodiscard]] inline double root_scale(const FilterTerms& terms) noexcept {
  return std::sqrt(0.5 * 1.4426950408889634) / static_cast<double>(terms.sigma_c);
}

// What a mean of depths is off by, relative: what all pairs do, and what the scaled form adds once, and per unit of the
// distance of p's scaled colours from 0.
struct PairErrors {
  double all = 0, scaled = 0, per_near = 0;
};

// How far the square of the float of root_scale is off, relative.
[[nodiscard]] inline double scale_error(const FilterTerms& terms) noexcept {
  const double exact = root_scale(terms);
  return std::fabs(static_cast<double>(static_cast<float>(exact)) / exact - 1) * 2;
}

// Of depths within `ratio` of each other, where each pixel has a weight of its own.
[[nodiscard]] inline PairErrors pair_errors(const FilterTerms& terms, const ColourGrid& g, int degree,
                                            const MeanExponents& exponents, double ratio) noexcept {
  // The most that the shares of numerator and denominator differ: errors between -e and e make 2 e of it.
  const double spread = 2 * (std::sqrt(ratio) - 1) / (std::sqrt(ratio) + 1);
  return {spread * kExp2Error[degree] + 2 * colour_chain(g) * kRounding + 7 * kExponentRounding * exponents.mean,
          scale_error(terms) * kLn2 * exponents.mean, 4 * kExponentRounding * exponents.mean_root};
}

// Likewise where one of the sums is all labels, the other all colours. A mean of square roots is at most the root of
// the mean.
[[nodiscard]] inline PairErrors mixed_errors(const FilterTerms& terms, const ColourGrid& g, int degree,
                                             double label_sum, double ratio) noexcept {
  const double mean = mean_exponent(g.taps() * ratio);
  return {label_sum + kExp2Error[degree] + colour_chain(g) * kRounding + 7 * kExponentRounding * mean,
          scale_error(terms) * kLn2 * mean, 4 * kExponentRounding * std::sqrt(mean)};
}

[[nodiscard]] inline double label_sum_error(const FilterTerms& terms, const LabelGrid& g) noexcept {
  return terms.labels ? label_sum_roundings(g) * kRounding : 0.0;
}

[[nodiscard]] inline FilterPlan filter_plan(const FilterTerms& terms, Shape shape) noexcept {
  const ColourGrid g = colour_grid(shape, terms.radius_px);
  const double allowed = static_cast<double>(terms.max_relative_error);
  const LabelGrid label_sums = label_grid(shape, terms.radius_px);
  const double label = terms.labels ? label_roundings(label_sums) * kRounding : 0.0;
  const double last = 8 * kRounding;  // both terms together, mu, the division
  FilterPlan plan;
  double bound = label + last;
  if (!terms.colour) {
    bound = 1.00001 * (label + kRounding);  // the division; and the products of the errors
    plan.possible = bound <= allowed;
    plan.relative_error_bound = static_cast<float>(bound);
    return plan;
  }
  const MeanExponents exponents = mean_exponents(g, static_cast<double>(terms.sigma_s_px), kMostDepthRatio);
  for (int degree = kMinDegree; degree <= kMaxDegree; ++degree) {
    const PairErrors pairs = pair_errors(terms, g, degree, exponents, kMostDepthRatio);
    const double without_centre = pairs.all + 7 * kExponentRounding * (exponents.mean_without_centre - exponents.mean);
    const double mixed = mixed_errors(terms, g, degree, label_sum_error(terms, label_sums), kMostDepthRatio).all;
    double worst = without_centre > pairs.all ? without_centre : pairs.all;
    if (label > worst) worst = label;
    if (terms.labels && mixed > worst) worst = mixed;
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
    plan.relative_error_bound = terms.max_relative_error;
    return plan;
  }
  return plan;
}

// How far from 0 scaled colours of p may be in an image whose depths differ by a factor of `ratio`; -1: none may be.
// The nearer the depths lie to each other, the less errors of weights matter.
[[nodiscard]] inline float scaled_near(const FilterTerms& terms, const ColourGrid& g, const FilterPlan& plan,
                                       double ratio) noexcept {
  if (!(ratio < kMostDepthRatio)) ratio = kMostDepthRatio;
  const MeanExponents exponents = mean_exponents(g, static_cast<double>(terms.sigma_s_px), ratio);
  const auto most_near = [&](const PairErrors& e) { return (plan.scaled_error - e.all - e.scaled) / e.per_near; };
  double near = most_near(pair_errors(terms, g, plan.degree, exponents, ratio));
  near = near < kMostNear ? near : kMostNear;
  if (terms.labels) {
    const double label_sum = label_sum_error(terms, label_grid(g.shape, g.rx > g.ry ? g.rx : g.ry));
    const double beside_labels = most_near(mixed_errors(terms, g, plan.degree, label_sum, ratio));
    near = beside_labels < near ? beside_labels : near;
  }
  return near > 0.5 ? static_cast<float>(0.999 * near) : -1.0F;
}

}  // namespace cross_bilateral_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_CROSS_BILATERAL_PLAN_HPP
