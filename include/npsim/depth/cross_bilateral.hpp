// SPDX-License-Identifier: Apache-2.0
// Dual-reference cross-bilateral filter, equation (3.2): depth averaged over pixels of the same label or colour.
//
//   d(p) = sum_q Gs(|q - p|) [delta(h(q), h(p)) + mu Gc(|J(q) - J(p)|)] d^(q)  /  the same sum without d^(q)
// with G(r) = exp(-r^2 / (2 sigma^2)), delta = 1 for equal labels, J in CIELAB (Delta E 1976), q in the square window
// of the given radius. Samples outside the image and samples whose depth is invalid have weight 0; a sample or centre
// whose colour is not finite has colour weight 0. A pixel that itself is invalid is computed from its neighbours, or
// stays invalid with keep_invalid. Where the weights sum to less than 1e-12 the result is 0 (invalid).
//
// This is the direct form: one tap after the other, lanes are neighbouring pixels, so it gives the same bits for every
// number of lanes. Sums are kept per row of the window first, which bounds rounding by the window's side, not its area.
// Error: relative to exact evaluation at most 4 (2R + 1) 2^-24 from the sums (1.5e-5 for R = 30) and 3e-6 from the
// weights; measured at R = 30: 7e-7. Depth below 1e30 m.
// Cost: O(pixels (2R + 1)^2), one exp per tap. Memory: 20 bytes per pixel of the image widened by 2R + 16 columns.
#ifndef NPSIM_DEPTH_CROSS_BILATERAL_HPP
#define NPSIM_DEPTH_CROSS_BILATERAL_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/isa.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace v1 {

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
  // What the result may differ from equation (3.2) evaluated without rounding, relative to the result.
  float max_relative_error = 2e-5F;
};

enum class CrossBilateralMethod { exact, approximate };

struct CrossBilateralResult {
  CrossBilateralMethod method = CrossBilateralMethod::exact;
  float relative_error_bound = 0.0F;  // holds for every pixel that has a result
};

[[nodiscard]] inline int cross_bilateral_radius(const CrossBilateralParams& params, Shape shape) noexcept {
  const int side = shape.width > shape.height ? shape.width : shape.height;
  if (params.radius_px >= 0) return params.radius_px < side ? params.radius_px : side;
  const float radius = std::ceil(3.0F * params.sigma_s_px);  // a window wider than the image adds nothing
  return radius < static_cast<float>(side) ? static_cast<int>(radius) : side;
}

inline constexpr int kTapPadding = 16;  // the widest batch

// Elements of one plane whose rows are widened by the window and one batch.
[[nodiscard]] constexpr std::size_t tap_plane_elements(Shape shape, int radius) noexcept {
  return static_cast<std::size_t>(shape.width + 2 * radius + kTapPadding) * static_cast<std::size_t>(shape.height);
}

[[nodiscard]] inline std::size_t cross_bilateral_workspace_bytes(const CrossBilateralParams& params,
                                                                 Shape shape) noexcept {
  const int radius = cross_bilateral_radius(params, shape);
  const std::size_t elements = tap_plane_elements(shape, radius);
  return kWorkspaceAlignment + 4 * allocation_bytes<float>(elements) + allocation_bytes<std::int32_t>(elements) +
         allocation_bytes<float>(static_cast<std::size_t>(radius) + 1);
}

inline namespace NPSIM_ISA_NAMESPACE {
namespace depth_detail {

// Samples as the tap loop reads them, in rows padded on both sides. A sample that must not count holds label -1, which
// no centre has, and an L far from any colour, so that both its terms are exactly 0.
struct TapPlanes {
  ImageView<float> l, a, b, depth_m;  // data() points at pixel (0, 0); the padding lies left and right of each row
  ImageView<std::int32_t> label;
  const float* spatial = nullptr;  // Gs by distance along one axis, 0..radius
};

inline constexpr float kFarLightness = 1e9F;
inline constexpr float kNoWeight = 1e-12F;

// One batch of pixels starting at (x, y), `n` of them inside the image.
template <class F, bool kLabels, bool kColour>
[[nodiscard]] F filter_pixels(const TapPlanes& t, const simd::F32x3<F>& centre, typename F::Int centre_label, int x,
                              int y, int radius, F mu, F minus_half_inverse_variance) noexcept {
  F numerator(0.0F);
  F denominator(0.0F);
  const int first_row = y > radius ? y - radius : 0;
  const int last_row = y + radius < t.l.height() ? y + radius : t.l.height() - 1;
  for (int qy = first_row; qy <= last_row; ++qy) {
    const float* l = t.l.row(qy) + x;
    const float* a = t.a.row(qy) + x;
    const float* b = t.b.row(qy) + x;
    const float* z = t.depth_m.row(qy) + x;
    const std::int32_t* label = t.label.row(qy) + x;
    F row_numerator(0.0F);
    F row_denominator(0.0F);
    for (int dx = -radius; dx <= radius; ++dx) {
      F weight(0.0F);
      if constexpr (kColour) {
        const F dl = F::load(l + dx) - centre.x;
        const F da = F::load(a + dx) - centre.y;
        const F db = F::load(b + dx) - centre.z;
        const F distance_squared = fma(dl, dl, fma(da, da, db * db));
        weight = mu * simd::exp(distance_squared * minus_half_inverse_variance);
      }
      if constexpr (kLabels) {
        weight = select(F::Int::load(label + dx) == centre_label, weight + 1.0F, weight);
      }
      weight = weight * F(t.spatial[dx < 0 ? -dx : dx]);
      row_numerator = fma(weight, F::load(z + dx), row_numerator);
      row_denominator = row_denominator + weight;
    }
    const F row_weight(t.spatial[qy < y ? y - qy : qy - y]);
    numerator = fma(row_weight, row_numerator, numerator);
    denominator = fma(row_weight, row_denominator, denominator);
  }
  const F result = numerator / denominator;
  return select((denominator > F(kNoWeight)) & simd::is_finite(result), result, F(0.0F));
}

template <class F, bool kLabels, bool kColour, class LabelPixel>
void filter_row(const CrossBilateralParams& params, const TapPlanes& t, ImageView<const float> depth,
                ImageView<const LabelPixel> labels, ImageView<const Vec3f> lab, int radius, int y,
                ImageView<float> output) noexcept {
  const F scale(static_cast<float>(-0.5 / (static_cast<double>(params.sigma_c) * static_cast<double>(params.sigma_c))));
  const F mu(params.mu);
  for (int x = 0; x < depth.width(); x += F::lanes) {
    const int n = depth.width() - x < F::lanes ? depth.width() - x : F::lanes;
    simd::F32x3<F> centre{F(0.0F), F(0.0F), F(0.0F)};
    if constexpr (kColour) {
      centre = simd::load3<F>(&lab(x, y).x, n);
      const auto finite = simd::is_finite(centre.x) & simd::is_finite(centre.y) & simd::is_finite(centre.z);
      centre.x = select(finite, centre.x, F(-kFarLightness));
      centre.y = select(finite, centre.y, F(0.0F));
      centre.z = select(finite, centre.z, F(0.0F));
    }
    typename F::Int centre_label(0);
    if constexpr (kLabels && sizeof(LabelPixel) == 1) centre_label = F::Int::load_u8(labels.row(y) + x, n);
    if constexpr (kLabels && sizeof(LabelPixel) == 2) centre_label = F::Int::load_u16(labels.row(y) + x, n);
    F result = filter_pixels<F, kLabels, kColour>(t, centre, centre_label, x, y, radius, mu, scale);
    if (params.keep_invalid) {
      const F before = F::load(depth.row(y) + x, n);
      result = select((before > F(0.0F)) & simd::is_finite(before), result, F(0.0F));
    }
    result.store(output.row(y) + x, n);
  }
}

template <class T>
[[nodiscard]] Status allocate_tap_plane(Shape shape, int radius, Workspace& workspace, ImageView<T>& plane) noexcept {
  Span<T> elements;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(tap_plane_elements(shape, radius), elements));
  plane = ImageView<T>(elements.data() + radius, shape, shape.width + 2 * radius + kTapPadding);
  return {};
}

// The filter with a given batch; cross_bilateral() calls it with the native one.
template <class F, class LabelPixel, class Executor>
[[nodiscard]] Status cross_bilateral_with(const CrossBilateralParams& params, ImageView<const float> depth,
                                          ImageView<const LabelPixel> labels, ImageView<const Vec3f> lab,
                                          ImageView<float> output, Workspace& workspace, Executor& executor) noexcept {
  static_assert(F::lanes <= kTapPadding);
  const Shape shape = depth.shape();
  const int radius = cross_bilateral_radius(params, shape);
  const bool colour = params.use_colour && params.mu > 0;
  const WorkspaceScope scope(workspace);
  TapPlanes t;
  NPSIM_RETURN_IF_ERROR(allocate_tap_plane(shape, radius, workspace, t.l));
  NPSIM_RETURN_IF_ERROR(allocate_tap_plane(shape, radius, workspace, t.a));
  NPSIM_RETURN_IF_ERROR(allocate_tap_plane(shape, radius, workspace, t.b));
  NPSIM_RETURN_IF_ERROR(allocate_tap_plane(shape, radius, workspace, t.depth_m));
  NPSIM_RETURN_IF_ERROR(allocate_tap_plane(shape, radius, workspace, t.label));
  Span<float> spatial;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(radius) + 1, spatial));
  const double sigma_s = static_cast<double>(params.sigma_s_px);
  for (std::size_t i = 0; i < spatial.size(); ++i) {
    const double r = static_cast<double>(i) / sigma_s;
    spatial[i] = static_cast<float>(std::exp(-0.5 * r * r));
  }
  t.spatial = spatial.data();

  const auto rows = static_cast<std::size_t>(shape.height);
  executor.for_chunks(rows, 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = -radius; x < shape.width + radius + kTapPadding; ++x) {
        const bool counts = x >= 0 && x < shape.width && is_valid_depth(depth(x, y));
        const bool coloured = counts && colour && is_finite(lab(x, y));
        t.depth_m.row(y)[x] = counts ? depth(x, y) : 0.0F;
        t.l.row(y)[x] = coloured ? lab(x, y).x : kFarLightness;
        t.a.row(y)[x] = coloured ? lab(x, y).y : 0.0F;
        t.b.row(y)[x] = coloured ? lab(x, y).z : 0.0F;
        t.label.row(y)[x] = counts && params.use_labels ? std::int32_t{labels(x, y)} : -1;
      }
    }
  });
  executor.for_chunks(rows, 4, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      if (params.use_labels && colour) {
        filter_row<F, true, true>(params, t, depth, labels, lab, radius, y, output);
      } else if (colour) {
        filter_row<F, false, true>(params, t, depth, labels, lab, radius, y, output);
      } else {
        filter_row<F, true, false>(params, t, depth, labels, lab, radius, y, output);
      }
    }
  });
  return {};
}

}  // namespace depth_detail

// depth: metres. labels: 8- or 16-bit classes or instances (may be empty without use_labels). lab: CIELAB (may be empty
// without use_colour). output: the shape of depth, 0 where invalid; it may be the same memory as depth.
template <class AnyLabel, class Executor>
[[nodiscard]] Status cross_bilateral(const CrossBilateralParams& params, ImageView<const float> depth,
                                     ImageView<AnyLabel> labels, ImageView<const Vec3f> lab, ImageView<float> output,
                                     CrossBilateralResult& result, Workspace& workspace, Executor& executor) noexcept {
  using LabelPixel = std::remove_const_t<AnyLabel>;
  static_assert(std::is_same_v<LabelPixel, std::uint8_t> || std::is_same_v<LabelPixel, std::uint16_t>,
                "labels are 8- or 16-bit and unsigned");
  const auto in_range = [](float v, float low, float high) { return v >= low && v <= high; };  // false for NaN
  if (!in_range(params.mu, 0.0F, 1e6F)) {
    return {StatusCode::invalid_argument, "cross_bilateral: mu must lie in 0..1e6"};
  }
  if (!in_range(params.sigma_s_px, 1e-3F, 1e6F) || !in_range(params.sigma_c, 1e-3F, 1e6F)) {
    return {StatusCode::invalid_argument, "cross_bilateral: sigma_s_px and sigma_c must lie in 1e-3..1e6"};
  }
  const bool colour = params.use_colour && params.mu > 0;
  if (!params.use_labels && !colour) {
    return {StatusCode::invalid_argument, "cross_bilateral: neither labels nor colour would be used"};
  }
  if (depth.empty()) return {StatusCode::no_valid_input, "cross_bilateral: the depth image is empty"};
  const Shape shape = depth.shape();
  if (output.empty() || output.shape() != shape || (params.use_labels && (labels.empty() || labels.shape() != shape)) ||
      (colour && (lab.empty() || lab.shape() != shape))) {
    return {StatusCode::shape_mismatch, "cross_bilateral: labels, lab and output must have the shape of the depth"};
  }
  if (!(params.max_relative_error >= 2e-5F)) {
    return {StatusCode::invalid_argument, "cross_bilateral: max_relative_error must be at least 2e-5"};
  }
  result = {CrossBilateralMethod::exact, 2e-5F};
  return depth_detail::cross_bilateral_with<simd::F32>(params, depth, ImageView<const LabelPixel>(labels), lab, output,
                                                       workspace, executor);
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_DEPTH_CROSS_BILATERAL_HPP
