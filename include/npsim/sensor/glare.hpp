// SPDX-License-Identifier: Apache-2.0
// Veiling glare: the light that a lens, its dirt and the windscreen scatter from lamps over the whole picture.
#ifndef NPSIM_SENSOR_GLARE_HPP
#define NPSIM_SENSOR_GLARE_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/sensor/detail/signal.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// The point-spread function has the two powers of the CIE general disability glare equation (CIE 146:2002; Vos, "On the
// cause of disability glare and its dependence on glare angle, age and ocular pigmentation", 2003), each with a share
// of its own, and a shoulder in place of the pole:
//   L_veil / E = halo 10 / t^3 + veil 5 / t^2 per sr,   t^2 = theta^2 + core^2, theta in degrees.
// halo = veil = 1 is a young eye. Lenses are cleaner far from a lamp: halos of street lamps in real nights fall by
// t^-3 to t^-3.4 between 2 and 8 degrees and leave the sky further off dark, so there is no square by default; a dirty
// windscreen has one. With the defaults 2 % of a lamp's light goes further than .8 degrees; ISO 9358 measures veiling
// glare of .5 to 2 % in good clean lenses and several times that in small ones behind a cover or with a film of dirt.
//
// An integral over Gaussians of every width gives such powers:
//   integral of s^-q exp(-t^2 / (2 s^2)) ds / s = 2^(q/2-1) Gamma(q/2) t^-q,
// so lobes an octave apart with shares of the light w = 2 pi s^2 ln 2 sum A_q s^-q / (2^(q/2-1) Gamma(q/2)) make it,
// and exp(-core^2 / (2 s^2)) the shoulder. The lobes are the levels of a pyramid with the filter (1 3 3 1) / 8, down
// and up again: variance (4^k - 1) / 2 px^2 at level k. The last cell of an odd row has what area is left; cells
// exchange light in equal amounts, so a constant stays, and so does the energy. At its borders the picture is mirrored.
//   out = (1 - sum w) I + sum w_k U^k D^k I.  Linear, on the unclipped light: any unit will do.
// Invariants: out >= 0; sum(out) == sum(in) within 1e-5 relative; halo = veil = 0 is a copy.
// Error against the equation: the mean over all directions within 20 % from 3 px to a quarter of the height, a single
// pixel within 35 % from 8 px on and 60 % from 3 px on, since a pyramid is not quite the same for every place.
// Cost: two passes over the image and a third of one, about 25 ns per pixel. Memory: a third of an image.

struct GlareParams {
  float halo = 0.8F;      // the third power, against the eye's
  float veil = 0.0F;      // the square; both 0: no glare
  float core_deg = 0.1F;  // the equation is measured from here on
  // Samples above this, in the unit of the image (cd/m2), scatter as if they were this bright; they themselves keep
  // their value. Bounds the halo of a single wrong or unsampled pixel. A street lamp's lens has 1e4 to 1e5 cd/m2.
  float cap = 1e6F;
};

[[nodiscard]] inline Status validate(const GlareParams& p) noexcept {
  const bool good = p.halo >= 0.0F && p.halo <= 4.0F && p.veil >= 0.0F && p.veil <= 4.0F && p.core_deg >= 0.02F &&
                    p.core_deg <= 10.0F && p.cap > 0.0F && p.cap <= kMaxSample;
  return good ? Status()
              : Status(StatusCode::invalid_argument,
                       "glare: halo and veil in [0, 4], core in [.02, 10] degrees, cap in (0, 1e12]");
}

[[nodiscard]] constexpr bool has_glare(const GlareParams& p) noexcept { return p.halo > 0.0F || p.veil > 0.0F; }

// Veil of a point of illuminance 1 lx, in cd/m2, at an angle: the equation itself.
[[nodiscard]] inline double glare_function(const GlareParams& p, double angle_deg) noexcept {
  const double core = static_cast<double>(p.core_deg);
  const double t2 = angle_deg * angle_deg + core * core;
  return (10.0 * static_cast<double>(p.halo) / std::sqrt(t2) + 5.0 * static_cast<double>(p.veil)) / t2;
}

namespace glare_detail {

inline constexpr int kMaxLevels = 14;  // to one cell at 16384 pixels

// A level of the pyramid: cells have area 1 but for those of the last column and row, which have what is left there.
struct Level {
  Shape shape;
  double column = 1.0;
  double row = 1.0;
};

[[nodiscard]] constexpr Level coarser(const Level& fine) noexcept {
  const auto area = [](int n, double tail) { return n % 2 == 0 ? 0.5 * (1.0 + tail) : 0.5 * tail; };
  return {{(fine.shape.width + 1) / 2, (fine.shape.height + 1) / 2},
          area(fine.shape.width, fine.column),
          area(fine.shape.height, fine.row)};
}

[[nodiscard]] constexpr int level_count(Shape shape) noexcept {
  int levels = 0;
  for (Level level{shape}; level.shape.pixels() > 1 && levels < kMaxLevels; ++levels) level = coarser(level);
  return levels;
}

// Along one axis of n cells, the last of area `tail`.
struct Axis {
  int n = 0;
  double tail = 1.0;

  [[nodiscard]] constexpr double area(int i) const noexcept { return i == n - 1 ? tail : 1.0; }
  // A quarter of the smaller of two neighbours' areas crosses the border between their parents; none the picture's.
  [[nodiscard]] constexpr double crossing(int i, int j) const noexcept {
    if (i < 0 || j < 0 || i >= n || j >= n) return 0.0;
    return 0.25 * (area(i) < area(j) ? area(i) : area(j));
  }
};

// Weights of the cells 2 p - 1 .. 2 p + 2 in parent p; a weight of 0 stands where there is no cell.
struct DownTaps {
  float w[4];
};

[[nodiscard]] constexpr DownTaps down_taps(const Axis& axis, int p) noexcept {
  const int first = 2 * p;
  const int last = first + 1 < axis.n ? first + 1 : first;
  const double left = axis.crossing(first - 1, first);
  const double right = axis.crossing(last, last + 1);
  const double whole = axis.area(first) + (last > first ? axis.area(last) : 0.0);
  double own[2] = {axis.area(first) - left, last > first ? axis.area(last) : 0.0};
  own[last - first] -= right;
  const auto f = [whole](double v) { return static_cast<float>(v / whole); };
  return {{f(left), f(own[0]), f(own[1]), f(right)}};
}

// Share that cell i takes from the parent beside its own; the adjoint of down_taps().
[[nodiscard]] constexpr float up_tap(const Axis& axis, int i) noexcept {
  const int beside = i % 2 == 0 ? i - 1 : i + 1;
  return static_cast<float>(axis.crossing(i, beside) / axis.area(i));
}

[[nodiscard]] constexpr int clamped(int i, int n) noexcept { return i < 0 ? 0 : (i < n ? i : n - 1); }

inline constexpr int kTile = 64;  // parents at a time
// Their children, and what a batch may touch beyond them.
inline constexpr int kRun = 2 * kTile + 2 + (simd::kMaxLanes + 2) / 3;

template <class Load, class Executor>
void down(const Level& fine, const Level& coarse, ImageView<Vec3f> out, Executor& executor, const Load& load_row) {
  const Axis columns{fine.shape.width, fine.column};
  const Axis rows{fine.shape.height, fine.row};
  const DownTaps inner{{0.125F, 0.375F, 0.375F, 0.125F}};
  for_rows(executor, coarse.shape.height, [&](int py) {
    const DownTaps v = down_taps(rows, py);
    for (int begin = 0; begin < coarse.shape.width; begin += kTile) {
      const int end = begin + kTile < coarse.shape.width ? begin + kTile : coarse.shape.width;
      // Columns 2 begin - 1 .. 2 end, those beyond the picture repeated: their weight is 0.
      Vec3f sum[kRun] = {};
      const int from = 2 * begin - 1 < 0 ? 0 : 2 * begin - 1;
      const int to = 2 * end + 1 < fine.shape.width ? 2 * end + 1 : fine.shape.width;
      for (int t = 0; t < 4; ++t) {
        if (v.w[t] == 0.0F) continue;
        load_row(2 * py - 1 + t, from, to, v.w[t], sum + (from - (2 * begin - 1)));
      }
      for (int px = begin; px < end; ++px) {
        const DownTaps h = px > 0 && px < coarse.shape.width - 2 ? inner : down_taps(columns, px);
        const Vec3f* s = sum + 2 * (px - begin);
        out(px, py) = s[0] * h.w[0] + s[1] * h.w[1] + s[2] * h.w[2] + s[3] * h.w[3];
      }
    }
  });
}

// take(x, y, n, values): what comes up to n fine cells of row y from x on; values of whole batches may be read.
template <class Executor, class Take>
void up(const Level& fine, const Level& coarse, ImageView<const Vec3f> in, Executor& executor, const Take& take) {
  const Axis columns{fine.shape.width, fine.column};
  const Axis rows{fine.shape.height, fine.row};
  for_rows(executor, fine.shape.height, [&](int y) {
    const float v = up_tap(rows, y);
    const Vec3f* own = in.row(y / 2);
    const Vec3f* beside = in.row(clamped(y % 2 == 0 ? y / 2 - 1 : y / 2 + 1, coarse.shape.height));
    for (int begin = 0; begin < coarse.shape.width; begin += kTile) {
      const int end = begin + kTile < coarse.shape.width ? begin + kTile : coarse.shape.width;
      Vec3f mixed[kTile + 2];  // of the parents begin - 1 .. end, those beyond the picture repeated
      for (int i = 0; i < end - begin + 2; ++i) {
        const int p = clamped(begin - 1 + i, coarse.shape.width);
        mixed[i] = own[p] * (1.0F - v) + beside[p] * v;
      }
      Vec3f values[kRun];
      for (int p = begin; p < end; ++p) {
        const bool inner = p > 0 && p < coarse.shape.width - 2;
        const Vec3f* parents = mixed + (p - begin);
        const float h[2] = {inner ? 0.25F : up_tap(columns, 2 * p), inner ? 0.25F : up_tap(columns, 2 * p + 1)};
        values[2 * (p - begin)] = parents[1] * (1.0F - h[0]) + parents[0] * h[0];
        values[2 * (p - begin) + 1] = parents[1] * (1.0F - h[1]) + parents[2] * h[1];
      }
      const int last = 2 * end < fine.shape.width ? 2 * end : fine.shape.width;
      take(2 * begin, y, last - 2 * begin, values);
    }
  });
}

// The light of n pixels, and that which the optics scatter of it: with a largest channel of at most `cap`, its hue
// kept.
template <class F>
void split_light(const Vec3f* in, int n, float cap, Vec3f (&light)[kRun], Vec3f (&scattering)[kRun]) noexcept {
  F most(0.0F);
  for_batches<F>(3 * n, [&](int i, int lanes) {
    const F sane = load_sane<F>(&in->x + i, lanes);
    sane.store(&light->x + i);
    sane.store(&scattering->x + i);
    most = max(sane, most);
  });
  if (none(most > F(cap))) return;
  for (int i = 0; i < n; ++i) scattering[i] = capped(light[i], cap);
}

// Share of the light that level k = 1, 2, ... spreads.
[[nodiscard]] inline double share(const GlareParams& p, double focal_px, int k) noexcept {
  const auto sigma_deg = [focal_px](int level) {
    return std::sqrt(0.5 * (std::pow(4.0, level) - 1.0)) / focal_px * 57.29577951308232;
  };
  const double s = sigma_deg(k);
  // The widths of the first levels are not quite an octave apart.
  const double octave = k == 1 ? std::log(sigma_deg(2) / s) : 0.5 * std::log(sigma_deg(k + 1) / sigma_deg(k - 1));
  const double core = static_cast<double>(p.core_deg);
  // Times s^2; 2^(1/2) Gamma(3/2) for the third power, 1 for the square.
  const double per_sr = 10.0 * static_cast<double>(p.halo) / (1.2533141373155 * s) + 5.0 * static_cast<double>(p.veil);
  return 6.283185307179586 * octave * per_sr * 3.0461741978670857e-4 * std::exp(-0.5 * core * core / (s * s));
}

}  // namespace glare_detail

[[nodiscard]] constexpr std::size_t glare_workspace_bytes(const GlareParams& params, Shape shape) noexcept {
  std::size_t bytes = kWorkspaceAlignment;
  if (shape.empty() || !has_glare(params)) return bytes;
  glare_detail::Level level{shape};
  for (int k = glare_detail::level_count(shape); k > 0; --k) {
    level = glare_detail::coarser(level);
    bytes += allocation_bytes<Vec3f>(level.shape.pixels());
  }
  return bytes;
}

// focal_px: of the lens, which makes angles of pixels. `out` may be `in`.
template <class Executor>
[[nodiscard]] Status add_glare(const GlareParams& params, float focal_px, ImageView<const Vec3f> in,
                               ImageView<Vec3f> out, Workspace& workspace, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(check_images(in, out));
  if (!(focal_px > 0.0F && focal_px <= 1e6F)) {
    return {StatusCode::invalid_argument, "glare: focal length in (0, 1e6] px"};
  }
  const Shape shape = in.shape();
  const int count = glare_detail::level_count(shape);
  if (!has_glare(params) || count == 0) {
    for_rows(executor, shape.height, [&](int y) {
      for (int x = 0; x < shape.width; ++x) out(x, y) = sane_sample(in(x, y));
    });
    return {};
  }
  const WorkspaceScope scope(workspace);
  glare_detail::Level levels[glare_detail::kMaxLevels + 1];
  ImageView<Vec3f> light[glare_detail::kMaxLevels + 1];
  float shares[glare_detail::kMaxLevels + 1] = {};
  levels[0].shape = shape;
  double total = 0.0;
  for (int k = 1; k <= count; ++k) {
    levels[k] = glare_detail::coarser(levels[k - 1]);
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(levels[k].shape, light[k]));
    const double share = glare_detail::share(params, static_cast<double>(focal_px), k);
    shares[k] = static_cast<float>(share);
    total += static_cast<double>(shares[k]);
  }
  if (!(total <= 1.0)) return {StatusCode::invalid_argument, "glare: the optics would scatter more than all the light"};

  using F = simd::F32;
  for (int k = 1; k <= count; ++k) {
    glare_detail::down(levels[k - 1], levels[k], light[k], executor,
                       [&](int y, int from, int to, float weight, Vec3f* sum) noexcept {
                         Vec3f whole[glare_detail::kRun];
                         Vec3f scattering[glare_detail::kRun];
                         if (k == 1)
                           glare_detail::split_light<F>(in.row(y) + from, to - from, params.cap, whole, scattering);
                         const float* row = k == 1 ? &scattering->x : &(light[k - 1].row(y) + from)->x;
                         for_batches<F>(3 * (to - from), [&](int i, int n) {
                           (F::load(&sum->x + i) + load_first<F>(row + i, n) * F(weight)).store(&sum->x + i);
                         });
                       });
  }
  for (int k = count; k > 1; --k) {
    // The coarsest level is multiplied as it is first read.
    const float here = shares[k - 1];
    const float above = k == count ? shares[k] : 1.0F;
    glare_detail::up(
        levels[k - 1], levels[k], light[k], executor, [&](int x, int y, int n, const Vec3f* spread) noexcept {
          float* row = &(light[k - 1].row(y) + x)->x;
          for_batches<F>(3 * n, [&](int i, int lanes) {
            store_first(load_first<F>(row + i, lanes) * F(here) + F::load(&spread->x + i) * F(above), row + i, lanes);
          });
        });
  }
  const auto scattered = static_cast<float>(total);
  const float above = count == 1 ? shares[1] : 1.0F;
  const auto keep = [&](int x, int y, int n, const Vec3f* spread) noexcept {
    Vec3f whole[glare_detail::kRun];
    Vec3f scattering[glare_detail::kRun];
    glare_detail::split_light<F>(in.row(y) + x, n, params.cap, whole, scattering);
    float* row = &(out.row(y) + x)->x;
    for_batches<F>(3 * n, [&](int i, int lanes) {
      const F kept = F::load(&whole->x + i) - F::load(&scattering->x + i) * F(scattered);
      store_first(kept + F::load(&spread->x + i) * F(above), row + i, lanes);
    });
  };
  glare_detail::up(levels[0], levels[1], light[1], executor, keep);
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_GLARE_HPP
