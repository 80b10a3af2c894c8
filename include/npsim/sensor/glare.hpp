// SPDX-License-Identifier: Apache-2.0
// Veiling glare and bloom: the light that a lens, its dirt and the windscreen scatter from lamps over the picture.
//
// out = (1 - s W) I + s sum_i w_i G_i * I,  W = sum w_i: each lobe takes a share w_i of every pixel's light and
// spreads it by a Gaussian whose sigma is a share of the image height; s is the strength, 0 = off. Works on the
// unclipped linear image, since a lamp 1e4 times as bright as the road is what makes a halo. Linear: any unit will do.
//
// A Gaussian is three passes per axis of an extended box (Gwosdek, Grewenig, Bruhn and Weickert, "Theoretical
// foundations of Gaussian convolution by extended box filtering", 2011) with its exact variance, in running sums: the
// cost does not grow with sigma. The lobes are made one from the other, as variances add. The picture is mirrored at
// its borders, which makes the filter symmetric: it keeps a constant, and it keeps the energy.
// Invariants: out >= 0; sum(out) == sum(in) within 1e-5 relative; strength 0 is a copy.
// Error of the first lobe against the true Gaussian (measured): below 13 % of its peak for a sigma of 2 px or more, 20
// % for .8 px; each further lobe has three boxes more, and less error. Cost: six box passes per lobe, about .1 us per
// pixel and lobe. Memory: two images.
#ifndef NPSIM_SENSOR_GLARE_HPP
#define NPSIM_SENSOR_GLARE_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/sensor/detail/signal.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct GlareLobe {
  float sigma;   // share of the image height; lobes in ascending order
  float weight;  // share of the light
};

inline constexpr int kGlareLobes = 6;
inline constexpr int kGlareBoxes = 3;  // per axis and lobe

struct GlareParams {
  // Widths double and weights fall a little faster than 1 / sigma: together a halo of r^-3, as that of street lamps in
  // photographs of real nights (radial means round a near and a far lamp, 540 rows, from 5 to 75 px). The total, 1.3 %,
  // assumes 3e4 cd/m2 for those lamps and 15 cd/m2 for full scale, which the pictures do not tell.
  GlareLobe lobes[kGlareLobes] = {{0.003F, 0.0067F}, {0.006F, 0.0033F}, {0.012F, 0.0015F},
                                  {0.024F, 0.0007F}, {0.048F, 0.0003F}, {0.096F, 0.00012F}};
  float strength = 1.0F;
  // Samples above this, in the unit of the image (cd/m2 by default), scatter as if they were this bright; they
  // themselves keep their value. Bounds the halo of a single wrong or unsampled pixel. A street lamp's lens has 1e4
  // to 1e5 cd/m2.
  float cap = 1e5F;
};

[[nodiscard]] inline Status validate(const GlareParams& p) noexcept {
  bool good = std::isfinite(p.strength) && p.strength >= 0.0F && p.cap > 0.0F && p.cap <= kMaxSample;
  float total = 0.0F;
  float before = 0.0F;
  for (const GlareLobe& lobe : p.lobes) {
    good = good && lobe.sigma >= before && lobe.sigma <= 1.0F && lobe.weight >= 0.0F && lobe.weight <= 1.0F;
    before = lobe.sigma;
    total += lobe.weight;
  }
  good = good && p.strength * total <= 1.0F;
  return good ? Status()
              : Status(StatusCode::invalid_argument,
                       "glare: ascending sigmas in [0, 1], weights >= 0 with strength * sum <= 1, cap in (0, 1e12]");
}

[[nodiscard]] constexpr std::size_t glare_workspace_bytes(const GlareParams& params, Shape shape) noexcept {
  return shape.empty() || params.strength == 0.0F ? kWorkspaceAlignment
                                                  : 2 * allocation_bytes<Vec3f>(shape.pixels()) + kWorkspaceAlignment;
}

namespace glare_detail {

// 1 on |i| <= radius, `edge` at +-(radius + 1), times scale.
struct ExtendedBox {
  int radius = 0;
  double edge = 0.0;
  double scale = 1.0;
};

[[nodiscard]] inline ExtendedBox extended_box(double variance) noexcept {
  const int radius = static_cast<int>(0.5 * std::sqrt(12.0 * variance + 1.0) - 0.5);
  const double r = radius;
  const double width = 2.0 * r + 1.0;
  const double edge = width * (3.0 * variance - r * (r + 1.0)) / (6.0 * ((r + 1.0) * (r + 1.0) - variance));
  const double clean = edge > 0.0 ? edge : 0.0;
  return {radius, clean, 1.0 / (width + 2.0 * clean)};
}

// Index into [0, n) of the signal mirrored about its ends: ... 1 0 | 0 1 ... n-1 | n-1 n-2 ...
[[nodiscard]] constexpr int mirrored(int i, int n) noexcept {
  if (i >= 0 && i < n) return i;
  int m = i % (2 * n);
  if (m < 0) m += 2 * n;
  return m < n ? m : 2 * n - 1 - m;
}

// Filters `lanes` neighbouring signals of n samples in one sweep: sample i of lane k is at(i)[k]. The running sums are
// double, so that subtracting a lamp leaves nothing of it behind.
constexpr int kMaxLanes = 64;

template <class In, class Out>
void box_pass(const ExtendedBox& box, int n, int lanes, const In& in_at, const Out& out_at) noexcept {
  Vec3d sum[kMaxLanes] = {};
  for (int i = -box.radius; i <= box.radius; ++i) {
    const Vec3f* row = in_at(mirrored(i, n));
    for (int k = 0; k < lanes; ++k) sum[k] += vec_cast<double>(row[k]);
  }
  for (int i = 0; i < n; ++i) {
    const Vec3f* before = in_at(mirrored(i - box.radius - 1, n));
    const Vec3f* last = in_at(mirrored(i - box.radius, n));
    const Vec3f* next = in_at(mirrored(i + box.radius + 1, n));
    Vec3f* out = out_at(i);
    for (int k = 0; k < lanes; ++k) {
      const Vec3d entering = vec_cast<double>(next[k]);
      const Vec3d value = (sum[k] + (vec_cast<double>(before[k]) + entering) * box.edge) * box.scale;
      // Rounding of what a lamp added and took away again can leave a sum of zeros just below 0.
      out[k] = {value.x > 0 ? static_cast<float>(value.x) : 0.0F, value.y > 0 ? static_cast<float>(value.y) : 0.0F,
                value.z > 0 ? static_cast<float>(value.z) : 0.0F};
      sum[k] += entering - vec_cast<double>(last[k]);
    }
  }
}

template <class Executor>
void blur_rows(const ExtendedBox& box, ImageView<const Vec3f> in, ImageView<Vec3f> out, Executor& executor) {
  for_rows(in.shape(), executor, [&](int y) {
    const Vec3f* from = in.row(y);
    Vec3f* to = out.row(y);
    box_pass(
        box, in.width(), 1, [from](int x) { return from + x; }, [to](int x) { return to + x; });
  });
}

template <class Executor>
void blur_columns(const ExtendedBox& box, ImageView<const Vec3f> in, ImageView<Vec3f> out, Executor& executor) {
  executor.for_chunks(static_cast<std::size_t>(in.width()), kMaxLanes, [&](std::size_t begin, std::size_t end) {
    const auto x = static_cast<std::ptrdiff_t>(begin);
    box_pass(
        box, in.height(), static_cast<int>(end - begin), [&in, x](int y) { return in.row(y) + x; },
        [&out, x](int y) { return out.row(y) + x; });
  });
}

}  // namespace glare_detail

// `out` may be `in`.
template <class Executor>
[[nodiscard]] Status add_glare(const GlareParams& params, ImageView<const Vec3f> in, ImageView<Vec3f> out,
                               Workspace& workspace, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(check_images(in, out));
  const Shape shape = in.shape();
  if (params.strength == 0.0F) {
    for_rows(shape, executor, [&](int y) {
      for (int x = 0; x < shape.width; ++x) out(x, y) = in(x, y);
    });
    return {};
  }
  const WorkspaceScope scope(workspace);
  ImageView<Vec3f> spread;
  ImageView<Vec3f> other;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, spread));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, other));

  float total = 0.0F;
  for (const GlareLobe& lobe : params.lobes) total += params.strength * lobe.weight;
  for_rows(shape, executor, [&](int y) {
    for (int x = 0; x < shape.width; ++x) {
      const Vec3f light = sane_sample(in(x, y));
      const float brightest = std::fmax(light.x, std::fmax(light.y, light.z));
      const Vec3f source = brightest > params.cap ? light * (params.cap / brightest) : light;  // keeps its hue
      spread(x, y) = source;
      const Vec3f kept = light - source * total;
      out(x, y) = sane_sample(kept);
    }
  });

  double variance_so_far = 0.0;
  for (const GlareLobe& lobe : params.lobes) {
    const double sigma_px = static_cast<double>(lobe.sigma) * shape.height;
    const double more = sigma_px * sigma_px - variance_so_far;
    if (more > 0.0) {
      const glare_detail::ExtendedBox box = glare_detail::extended_box(more / kGlareBoxes);
      for (int pass = 0; pass < 2 * kGlareBoxes; ++pass) {
        if (pass < kGlareBoxes) {
          glare_detail::blur_rows(box, spread, other, executor);
        } else {
          glare_detail::blur_columns(box, spread, other, executor);
        }
        const ImageView<Vec3f> done = other;
        other = spread;
        spread = done;
      }
      variance_so_far += more;
    }
    const float weight = params.strength * lobe.weight;
    for_rows(shape, executor, [&](int y) {
      for (int x = 0; x < shape.width; ++x) out(x, y) += spread(x, y) * weight;
    });
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_GLARE_HPP
