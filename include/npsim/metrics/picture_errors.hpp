// SPDX-License-Identifier: Apache-2.0
// Errors between two displayed pictures by formula: PSNR over all channels, and structural similarity (SSIM) of luma as
// Wang et al. (IEEE TIP 13(4), 2004) define it: Gaussian window of 11 x 11, sigma 1.5, K = (.01, .03), no downsampling;
// the mean runs over the windows that lie inside the picture.
//
// Luma: .299 R + .587 G + .114 B of the codes. PSNR is infinite where the pictures are equal.
// Invariant: the same bits for any number of threads. Error: 1e-5 of SSIM against the same equations in double.
// Cost: 55 multiplications a pixel and direction. Memory: 40 bytes a pixel.
#ifndef NPSIM_METRICS_PICTURE_ERRORS_HPP
#define NPSIM_METRICS_PICTURE_ERRORS_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/metrics/detail/pixel_sums.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct PictureErrors {
  double psnr_db = 0;
  double ssim = 0;
};

namespace metrics_detail {

inline constexpr int kSsimRadius = 5;

// Window means of a, b, a^2, b^2 and ab.
struct Moments {
  double a = 0, b = 0, aa = 0, bb = 0, ab = 0;

  constexpr Moments& operator+=(const Moments& o) noexcept {
    a += o.a;
    b += o.b;
    aa += o.aa;
    bb += o.bb;
    ab += o.ab;
    return *this;
  }
  [[nodiscard]] constexpr Moments operator*(double w) const noexcept { return {a * w, b * w, aa * w, bb * w, ab * w}; }
};

[[nodiscard]] constexpr double luma(const Rgb8& c) noexcept { return 0.299 * c.r + 0.587 * c.g + 0.114 * c.b; }

[[nodiscard]] constexpr double ssim_of(const Moments& m) noexcept {
  constexpr double kC1 = (0.01 * 255) * (0.01 * 255);
  constexpr double kC2 = (0.03 * 255) * (0.03 * 255);
  const double va = m.aa - m.a * m.a;
  const double vb = m.bb - m.b * m.b;
  const double covariance = m.ab - m.a * m.b;
  return (2 * m.a * m.b + kC1) * (2 * covariance + kC2) / ((m.a * m.a + m.b * m.b + kC1) * (va + vb + kC2));
}

}  // namespace metrics_detail

[[nodiscard]] constexpr std::size_t picture_errors_workspace_bytes(Shape shape) noexcept {
  return kWorkspaceAlignment + allocation_bytes<metrics_detail::Moments>(shape.empty() ? 0 : shape.pixels()) +
         row_sums_workspace_bytes<double>(shape);
}

// Pictures of one shape, at least 11 pixels wide and high.
template <class Executor>
[[nodiscard]] Status picture_errors(ImageView<const Rgb8> reference, ImageView<const Rgb8> test, PictureErrors& out,
                                    Workspace& workspace, Executor& executor) noexcept {
  using namespace metrics_detail;
  constexpr int kWidth = 2 * kSsimRadius + 1;
  const Shape shape = reference.shape();
  if (test.shape() != shape) return {StatusCode::shape_mismatch, "picture_errors: the pictures must have one shape"};
  if (shape.width < kWidth || shape.height < kWidth) {
    return {StatusCode::no_valid_input, "picture_errors: the pictures must be at least 11 pixels wide and high"};
  }
  double tap[kWidth];
  double taps = 0;
  for (int i = 0; i < kWidth; ++i) {
    const int d = i - kSsimRadius;
    taps += tap[i] = std::exp(-d * d / (2 * 1.5 * 1.5));
  }
  for (double& t : tap) t /= taps;

  const WorkspaceScope scope(workspace);
  ImageView<Moments> rows;  // filtered along x; the window's left end is its pixel
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, rows));
  double squared = 0;
  NPSIM_RETURN_IF_ERROR(sum_rows(shape.height, squared, workspace, executor, [&](double& sum, int y) {
    for (int x = 0; x < shape.width; ++x) {
      const Rgb8 a = reference(x, y);
      const Rgb8 b = test(x, y);
      for (const int d : {a.r - b.r, a.g - b.g, a.b - b.b}) sum += static_cast<double>(d * d);
      if (x + kWidth > shape.width) continue;
      Moments m;
      for (int i = 0; i < kWidth; ++i) {
        const double p = luma(reference(x + i, y));
        const double q = luma(test(x + i, y));
        m += Moments{p, q, p * p, q * q, p * q} * tap[i];
      }
      rows(x, y) = m;
    }
  }));
  const int across = shape.width - kWidth + 1;
  const int down = shape.height - kWidth + 1;
  double similarity = 0;
  NPSIM_RETURN_IF_ERROR(sum_rows(down, similarity, workspace, executor, [&](double& sum, int y) {
    for (int x = 0; x < across; ++x) {
      Moments m;
      for (int i = 0; i < kWidth; ++i) m += rows(x, y + i) * tap[i];
      sum += ssim_of(m);
    }
  }));
  out.psnr_db = 10 * std::log10(255.0 * 255.0 * 3.0 * static_cast<double>(shape.pixels()) / squared);
  out.ssim = similarity / (static_cast<double>(across) * static_cast<double>(down));
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_METRICS_PICTURE_ERRORS_HPP
