// SPDX-License-Identifier: Apache-2.0
// How different two displayed pictures are: PSNR, SSIM and FLIP.
#ifndef NPSIM_METRICS_PICTURE_ERRORS_HPP
#define NPSIM_METRICS_PICTURE_ERRORS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "npsim/color/srgb.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/metrics/detail/pixel_sums.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Errors between two displayed pictures by formula: PSNR over all channels, and structural similarity (SSIM) of luma as
// Wang et al. (IEEE TIP 13(4), 2004) define it: Gaussian window of 11 x 11, sigma 1.5, K = (.01, .03), no downsampling;
// the mean runs over the windows that lie inside the picture.
//
// Luma: .299 R + .587 G + .114 B of the codes. PSNR is infinite where the pictures are equal.
// Invariant: the same bits for any number of threads. Error: 1e-5 of SSIM against the same equations in double.
// Cost: 55 multiplications a pixel and direction. Memory: 40 bytes a pixel.

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

// How different two displayed pictures look to a person who flips between them: FLIP (Andersson et al., Proc. ACM
// Comput. Graph. Interact. Tech. 3(2), 2020), its form for pictures as they are shown (LDR).
//
// Both pictures are filtered by the contrast sensitivity of the eye in an opponent space, compared in CIELAB by the
// HyAB distance with chroma scaled by lightness (Hunt), and the distance is raised where edges or points stand in one
// of them only: error = colour^(1 - feature), in [0, 1] per pixel. The mean over the pixels is the usual single figure.
// Invariant: 0 exactly where the neighbourhoods are equal; the same bits for any number of threads.
// Error: 1e-4 per pixel, against the same equations in double. Cost: about 160 multiplications a pixel and picture at
// the default resolution. Memory: 64 bytes a pixel.

struct FlipParams {
  float pixels_per_degree = 67.0206F;  // of sight; the paper's: 3840 pixels on 0.7 m, seen from 0.7 m. In 1..200
};

[[nodiscard]] inline Status validate(const FlipParams& p) noexcept {
  return p.pixels_per_degree >= 1.0F && p.pixels_per_degree <= 200.0F
             ? Status()
             : Status(StatusCode::invalid_argument, "flip: pixels_per_degree in 1..200");
}

[[nodiscard]] constexpr std::size_t flip_workspace_bytes(const FlipParams&, Shape shape) noexcept {
  const std::size_t pixels = shape.empty() ? 0 : shape.pixels();
  return kWorkspaceAlignment + allocation_bytes<Vec3f>(2 * pixels) +
         2 * (allocation_bytes<Vec3f>(pixels) + 2 * allocation_bytes<float>(pixels)) +
         row_sums_workspace_bytes<double>(shape);
}

namespace flip_detail {

inline constexpr int kMaxRadius = 30;  // 28 at 200 pixels per degree

// exp(-x^2 / (2 sigma^2)) at whole pixels, its first and second derivative, scaled as needed by the caller.
struct Kernel {
  int radius = 0;
  float tap[2 * kMaxRadius + 1] = {};

  [[nodiscard]] float& at(int x) noexcept { return tap[x + radius]; }
};

[[nodiscard]] inline Kernel gaussian(int radius, double sigma_px) noexcept {
  Kernel k;
  k.radius = radius;
  double sum = 0;
  for (int x = -radius; x <= radius; ++x) sum += std::exp(-0.5 * x * x / (sigma_px * sigma_px));
  for (int x = -radius; x <= radius; ++x) {
    k.at(x) = static_cast<float>(std::exp(-0.5 * x * x / (sigma_px * sigma_px)) / sum);
  }
  return k;
}

// Derivatives of a Gaussian whose positive taps add up to 1 and whose negative ones to -1.
[[nodiscard]] inline Kernel derivative(int radius, double sigma_px, int order) noexcept {
  Kernel k;
  k.radius = radius;
  double positive = 0;
  double negative = 0;
  const auto value = [&](int x) {
    const double g = std::exp(-0.5 * x * x / (sigma_px * sigma_px));
    return order == 1 ? -x * g : (x * x / (sigma_px * sigma_px) - 1.0) * g;
  };
  for (int x = -radius; x <= radius; ++x) {
    const double v = value(x);
    (v > 0 ? positive : negative) += std::fabs(v);
  }
  for (int x = -radius; x <= radius; ++x) {
    const double v = value(x);
    k.at(x) = static_cast<float>(v > 0 ? v / positive : (negative > 0 ? v / negative : 0.0));
  }
  return k;
}

// Contrast sensitivity: a sqrt(pi / b) exp(-pi^2 r^2 / b) over r in degrees, table 1 of the paper; of blue-yellow a sum
// of two. The sensitivities to luminance and red-green are one Gaussian each.
inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kLightWidth = 0.0047;
inline constexpr double kRedGreenWidth = 0.0053;
inline constexpr double kBlueYellow[2][2] = {{34.1, 0.04}, {13.5, 0.025}};  // a, b
inline constexpr double kFeatureWidth_deg = 0.082;

[[nodiscard]] inline double sigma_px(double width, double pixels_per_degree) noexcept {
  return std::sqrt(width / (2 * kPi * kPi)) * pixels_per_degree;
}

struct Filters {
  Kernel light, red_green, blue_yellow[2];
  float blue_yellow_share[2] = {};  // of the two Gaussians in the sum, each of which adds up to 1
  Kernel blur, edge, point;         // of features

  [[nodiscard]] static Filters of(const FlipParams& p) noexcept {
    const auto ppd = static_cast<double>(p.pixels_per_degree);
    const int radius = static_cast<int>(std::ceil(3 * sigma_px(kBlueYellow[0][1], ppd)));
    Filters f;
    f.light = gaussian(radius, sigma_px(kLightWidth, ppd));
    f.red_green = gaussian(radius, sigma_px(kRedGreenWidth, ppd));
    double weight[2];
    for (int i = 0; i < 2; ++i) {
      const double sigma = sigma_px(kBlueYellow[i][1], ppd);
      f.blue_yellow[i] = gaussian(radius, sigma);
      double sum = 0;
      for (int x = -radius; x <= radius; ++x) sum += std::exp(-0.5 * x * x / (sigma * sigma));
      weight[i] = kBlueYellow[i][0] * std::sqrt(kPi / kBlueYellow[i][1]) * sum * sum;
    }
    for (int i = 0; i < 2; ++i) f.blue_yellow_share[i] = static_cast<float>(weight[i] / (weight[0] + weight[1]));
    const double feature = 0.5 * kFeatureWidth_deg * ppd;
    const int reach = static_cast<int>(std::ceil(3 * feature));
    f.blur = gaussian(reach, feature);
    f.edge = derivative(reach, feature, 1);
    f.point = derivative(reach, feature, 2);
    return f;
  }
};

// Sum of value(i + x) tap(x) over the kernel, i + x clamped to [0, size).
template <class Value>
[[nodiscard]] float convolved(const Kernel& k, int i, int size, const Value& value) noexcept {
  float sum = 0;
  for (int x = -k.radius; x <= k.radius; ++x) sum += k.tap[x + k.radius] * value(clamp_to(i + x, 0, size - 1));
  return sum;
}

// Linear opponent space: X, Y, Z relative to white as 116 Y - 16, 500 (X - Y), 200 (Y - Z).
[[nodiscard]] inline Vec3f opponent(const Rgb8& c) noexcept {
  using F = simd::scalar::F32;
  const Vec3f rgb = srgb_decode8(c);
  const simd::F32x3<F> batch{F(rgb.x), F(rgb.y), F(rgb.z)};
  const float x = color_detail::relative_xyz(batch, 0, kWhiteD65Xyz.x).value;
  const float y = color_detail::relative_xyz(batch, 1, kWhiteD65Xyz.y).value;
  const float z = color_detail::relative_xyz(batch, 2, kWhiteD65Xyz.z).value;
  return {116.0F * y - 16.0F, 500.0F * (x - y), 200.0F * (y - z)};
}

[[nodiscard]] inline Vec3f rgb_of_opponent(const Vec3f& c) noexcept {
  const double y = (static_cast<double>(c.x) + 16.0) / 116.0;
  const Vec3d xyz{(y + static_cast<double>(c.y) / 500.0) * kWhiteD65Xyz.x, y * kWhiteD65Xyz.y,
                  (y - static_cast<double>(c.z) / 200.0) * kWhiteD65Xyz.z};
  const Vec3f rgb = vec_cast<float>(xyz_to_linear_srgb(xyz));
  return {clamp_to(rgb.x, 0.0F, 1.0F), clamp_to(rgb.y, 0.0F, 1.0F), clamp_to(rgb.z, 0.0F, 1.0F)};
}

// CIELAB with chroma scaled by lightness: colours in the dark differ less.
[[nodiscard]] inline Vec3f hunt_lab(const Vec3f& rgb) noexcept {
  const Vec3f lab = linear_rgb_to_lab(rgb);
  return {lab.x, 0.01F * lab.x * lab.y, 0.01F * lab.x * lab.z};
}

[[nodiscard]] inline float hyab(const Vec3f& a, const Vec3f& b) noexcept {
  const Vec3f d = a - b;
  return std::fabs(d.x) + std::sqrt(d.y * d.y + d.z * d.z);
}

// The distance to the power of 0.7, mapped so that 0.4 of the largest one, between green and blue, becomes 0.95.
[[nodiscard]] inline float colour_error(float distance) noexcept {
  constexpr float kPower = 0.7F;
  constexpr float kKnee = 0.4F;
  constexpr float kKneeValue = 0.95F;
  const float most = std::pow(hyab(hunt_lab({0.0F, 1.0F, 0.0F}), hunt_lab({0.0F, 0.0F, 1.0F})), kPower);
  const float d = std::pow(distance, kPower);
  const float knee = kKnee * most;
  const float error = d < knee ? d / knee * kKneeValue : kKneeValue + (d - knee) / (most - knee) * (1.0F - kKneeValue);
  return error < 1.0F ? error : 1.0F;
}

// A picture as the eye sees it: HyAB's colour, and strength of edge and point in it.
struct Seen {
  ImageView<Vec3f> colour;
  ImageView<float> edge;
  ImageView<float> point;
};

// rows: scratch of two Vec3f a pixel.
template <class Executor>
void look(const Filters& f, ImageView<const Rgb8> picture, const Seen& out, Span<Vec3f> rows,
          Executor& executor) noexcept {
  const int width = picture.width();
  const int height = picture.height();
  const auto pixels = picture.shape().pixels();
  const auto at = [width](int x, int y) {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x);
  };
  // Both directions of each filter in turn; blue-yellow has two, the second in the edge plane until that is needed.
  for_rows(executor, height, [&](int y) {
    for (int x = 0; x < width; ++x) out.colour(x, y) = opponent(picture(x, y));
  });
  for_rows(executor, height, [&](int y) {
    const Vec3f* in = out.colour.row(y);
    for (int x = 0; x < width; ++x) {
      const auto blue = [&](int i) { return in[i].z; };
      rows[at(x, y)] = {convolved(f.light, x, width, [&](int i) { return in[i].x; }),
                        convolved(f.red_green, x, width, [&](int i) { return in[i].y; }),
                        convolved(f.blue_yellow[0], x, width, blue)};
      out.edge(x, y) = convolved(f.blue_yellow[1], x, width, blue);
      const auto light = [&](int i) { return (in[i].x + 16.0F) / 116.0F; };
      rows[pixels + at(x, y)] = {convolved(f.blur, x, width, light), convolved(f.edge, x, width, light),
                                 convolved(f.point, x, width, light)};
    }
  });
  for_rows(executor, height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      const Vec3f filtered{
          convolved(f.light, y, height, [&](int i) { return rows[at(x, i)].x; }),
          convolved(f.red_green, y, height, [&](int i) { return rows[at(x, i)].y; }),
          f.blue_yellow_share[0] * convolved(f.blue_yellow[0], y, height, [&](int i) { return rows[at(x, i)].z; }) +
              f.blue_yellow_share[1] * convolved(f.blue_yellow[1], y, height, [&](int i) { return out.edge(x, i); })};
      out.colour(x, y) = hunt_lab(rgb_of_opponent(filtered));
    }
  });
  for_rows(executor, height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      const auto of = [&](const Kernel& k, float Vec3f::*channel) {
        return convolved(k, y, height, [&](int i) { return rows[pixels + at(x, i)].*channel; });
      };
      out.edge(x, y) = std::hypot(of(f.blur, &Vec3f::y), of(f.edge, &Vec3f::x));
      out.point(x, y) = std::hypot(of(f.blur, &Vec3f::z), of(f.point, &Vec3f::x));
    }
  });
}

}  // namespace flip_detail

// Pictures of one shape; `error` of that shape, per pixel. `mean` is written on success only.
template <class Executor>
[[nodiscard]] Status flip(const FlipParams& params, ImageView<const Rgb8> reference, ImageView<const Rgb8> test,
                          ImageView<float> error, double& mean, Workspace& workspace, Executor& executor) noexcept {
  using namespace flip_detail;
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = reference.shape();
  if (reference.empty()) return {StatusCode::no_valid_input, "flip: the reference is empty"};
  if (test.shape() != shape || error.shape() != shape) {
    return {StatusCode::shape_mismatch, "flip: both pictures and the error must have one shape"};
  }
  const WorkspaceScope scope(workspace);
  Seen seen[2];
  Span<Vec3f> rows;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(2 * shape.pixels(), rows));
  for (Seen& s : seen) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, s.colour));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, s.edge));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, s.point));
  }
  const Filters filters = Filters::of(params);
  look(filters, reference, seen[0], rows, executor);
  look(filters, test, seen[1], rows, executor);

  double sum = 0;
  NPSIM_RETURN_IF_ERROR(metrics_detail::sum_rows(shape.height, sum, workspace, executor, [&](double& total, int y) {
    for (int x = 0; x < shape.width; ++x) {
      const float colour = colour_error(hyab(seen[0].colour(x, y), seen[1].colour(x, y)));
      const float feature = std::fmax(std::fabs(seen[0].edge(x, y) - seen[1].edge(x, y)),
                                      std::fabs(seen[0].point(x, y) - seen[1].point(x, y)));
      const float raised = std::sqrt(std::fmin(feature * 0.70710678F, 1.0F));
      error(x, y) = std::pow(colour, 1.0F - raised);
      total += static_cast<double>(error(x, y));
    }
  }));
  mean = sum / static_cast<double>(shape.pixels());
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_METRICS_PICTURE_ERRORS_HPP
