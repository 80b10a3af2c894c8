// SPDX-License-Identifier: Apache-2.0
// sRGB and CIELAB.
#ifndef NPSIM_COLOR_SRGB_HPP
#define NPSIM_COLOR_SRGB_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/color/chromaticity.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// The sRGB transfer function of IEC 61966-2-1: linear light <-> encoded value, as floats and in 8 bits.
//
//   decode(v) = v / 12.92                     for v <= 0.04045,   ((v + 0.055) / 1.055)^2.4  above
//   encode(x) = 12.92 x                       for x <= 0.0031308, 1.055 x^(1/2.4) - 0.055    above
// Both continue straight below 0 and as the power above 1 (up to 2^100); a NaN stays one.
// Error: srgb_decode and srgb_encode within 2.5e-7 of the exact value, absolutely, on [0, 1]; relatively within 4e-7.
// srgb_decode8 is the float nearest to the exact value. srgb_encode8 is exact: it returns round(255 encode(x)) of the
// exact function for every float, values outside [0, 1] clamped and a NaN as 0; the approximate code is corrected by
// the table of the 255 floats at which the code changes.
// Cost: about one pow or one cbrt per value. Memory: two tables of 1 KiB, computed by the compiler.

namespace color_detail {

// v^(2/5) for 0 < v <= 1, by Newton's method for y^5 = v^2 from above, until it no longer falls.
[[nodiscard]] constexpr double two_fifths_power(double v) noexcept {
  double y = 1.0;
  for (int i = 0; i < 100; ++i) {
    const double y2 = y * y;
    const double next = y - (y2 * y2 * y - v * v) / (5.0 * y2 * y2);
    if (!(next < y)) break;
    y = next;
  }
  return y;
}

[[nodiscard]] constexpr double srgb_decode_exact(double v) noexcept {
  if (v <= 0.04045) return v / 12.92;
  const double base = (v + 0.055) / 1.055;
  return base * base * two_fifths_power(base);
}

struct SrgbTables {
  float decode[256] = {};     // linear value of a code
  float threshold[257] = {};  // the smallest float whose code is at least the index
};

[[nodiscard]] constexpr SrgbTables make_srgb_tables() noexcept {
  SrgbTables t;
  for (int code = 0; code < 256; ++code) {
    t.decode[code] = static_cast<float>(srgb_decode_exact(code / 255.0));
    if (code == 0) continue;
    const double edge = srgb_decode_exact((code - 0.5) / 255.0);
    const auto nearest = static_cast<float>(edge);
    // The next float up is one unit away; 1.25 to 0.625 units are added, which rounds to one.
    t.threshold[code] = static_cast<double>(nearest) < edge
                            ? static_cast<float>(static_cast<double>(nearest) * (1.0 + 0x1.4p-24))
                            : nearest;
  }
  t.threshold[256] = std::numeric_limits<float>::infinity();
  return t;
}

inline constexpr SrgbTables kSrgbTables = make_srgb_tables();

}  // namespace color_detail

template <class F>
[[nodiscard]] F srgb_decode(F v) noexcept {
  const F base = fma(v, F(static_cast<float>(1.0 / 1.055)), F(static_cast<float>(0.055 / 1.055)));
  const simd::Pair<F> exponent{F(2.4F), F(static_cast<float>(2.4 - static_cast<double>(2.4F)))};
  return select(v <= F(0.04045F), v / F(12.92F), simd::pow(base, exponent));
}

template <class F>
[[nodiscard]] F srgb_encode(F x) noexcept {
  // x^(1/2.4) = x^(5/12) = (x x^(1/4))^(1/3): the root divides the error of its argument by three.
  const F power = simd::cbrt(x * sqrt(sqrt(x)));
  return select(x <= F(0.0031308F), x * F(12.92F), fma(power, F(1.055F), F(-0.055F)));
}

template <class F>
[[nodiscard]] typename F::Int srgb_encode8(F x) noexcept {
  using I = typename F::Int;
  const F in_range = simd::clamp(x, 0.0F, 1.0F);
  const I near = simd::round_to_int(srgb_encode(in_range) * F(255.0F));
  const F low = F::gather(color_detail::kSrgbTables.threshold, near);
  const F high = F::gather(color_detail::kSrgbTables.threshold + 1, near);
  return near - select(in_range < low, I(1), I(0)) + select(in_range >= high, I(1), I(0));
}

// Codes outside [0, 255] are not allowed.
template <class F>
[[nodiscard]] F srgb_decode8(typename F::Int code) noexcept {
  return F::gather(color_detail::kSrgbTables.decode, code);
}

[[nodiscard]] inline float srgb_decode(float v) noexcept { return srgb_decode(simd::scalar::F32(v)).value; }
[[nodiscard]] inline float srgb_encode(float x) noexcept { return srgb_encode(simd::scalar::F32(x)).value; }
[[nodiscard]] constexpr float srgb_decode8(std::uint8_t code) noexcept {
  return color_detail::kSrgbTables.decode[code];
}
[[nodiscard]] inline std::uint8_t srgb_encode8(float x) noexcept {
  return static_cast<std::uint8_t>(srgb_encode8(simd::scalar::F32(x)).value);
}

[[nodiscard]] constexpr Vec3f srgb_decode8(const Rgb8& c) noexcept {
  return {srgb_decode8(c.r), srgb_decode8(c.g), srgb_decode8(c.b)};
}
[[nodiscard]] inline Rgb8 srgb_encode8(const Vec3f& c) noexcept {
  return {srgb_encode8(c.x), srgb_encode8(c.y), srgb_encode8(c.z)};
}

inline constexpr std::size_t kColorRowsPerChunk = 16;

// A displayed image as linear light.
template <class Executor>
Status srgb8_to_linear(const ImageView<const Rgb8>& in, const ImageView<Vec3f>& out, Executor& executor) noexcept {
  if (in.shape() != out.shape())
    return {StatusCode::shape_mismatch, "srgb8_to_linear: input and output differ in size"};
  if (in.empty()) return {};
  executor.for_chunks(static_cast<std::size_t>(in.height()), kColorRowsPerChunk,
                      [&](std::size_t begin, std::size_t end) {
                        for (std::size_t y = begin; y < end; ++y) {
                          const Rgb8* from = in.row(static_cast<int>(y));
                          Vec3f* to = out.row(static_cast<int>(y));
                          for (int x = 0; x < in.width(); ++x) to[x] = srgb_decode8(from[x]);
                        }
                      });
  return {};
}

// Linear light as a displayed image: clamped to [0, 1], rounded exactly, without dithering.
template <class Executor>
Status linear_to_srgb8(const ImageView<const Vec3f>& in, const ImageView<Rgb8>& out, Executor& executor) noexcept {
  if (in.shape() != out.shape())
    return {StatusCode::shape_mismatch, "linear_to_srgb8: input and output differ in size"};
  if (in.empty()) return {};
  using F = simd::F32;
  executor.for_chunks(static_cast<std::size_t>(in.height()), kColorRowsPerChunk,
                      [&](std::size_t begin, std::size_t end) {
                        for (std::size_t y = begin; y < end; ++y) {
                          const Vec3f* from = in.row(static_cast<int>(y));
                          Rgb8* to = out.row(static_cast<int>(y));
                          for (int x = 0; x < in.width(); x += F::lanes) {
                            const int n = in.width() - x < F::lanes ? in.width() - x : F::lanes;
                            const simd::F32x3<F> c = simd::load3<F>(&from[x].x, n);
                            std::int32_t code[3][F::lanes];
                            srgb_encode8(c.x).store(code[0]);
                            srgb_encode8(c.y).store(code[1]);
                            srgb_encode8(c.z).store(code[2]);
                            for (int i = 0; i < n; ++i) {
                              to[x + i] = {static_cast<std::uint8_t>(code[0][i]), static_cast<std::uint8_t>(code[1][i]),
                                           static_cast<std::uint8_t>(code[2][i])};
                            }
                          }
                        }
                      });
  return {};
}

// CIELAB (CIE 15) of sRGB colours, white D65: the colour space in which the cross-bilateral filter measures distance.
//
//   f(t) = cbrt(t) for t > 216/24389, (24389/27 t + 16) / 116 below;  t = X/Xn, Y/Yn, Z/Zn
//   L = 116 f(Y/Yn) - 16,  a = 500 (f(X/Xn) - f(Y/Yn)),  b = 200 (f(Y/Yn) - f(Z/Zn))
// Nothing is rounded to 8 bits. L, a, b stand in the x, y, z of a Vec3f.
// Error against the exact formula in double, as Delta E 1976: at most 1.2e-4 over all 2^24 colours of 8 bits a channel
// and, from encoded floats, over [0, 1]^3. Encoded values above 1 have no such bound, as their polynomial is made for
// [0, 1] and Lab itself grows; measured 1.7e-4 over [1, 2], 5.5e-4 over [0, 10], 2.1e-2 over [0, 1000], 6e-4 over
// [-10, 0], NaN at 1e30.
// Negative linear values stay on the straight part of f; a NaN goes through. A pixel with an infinity has no colour:
// its channels come out infinite or NaN.
// Cost: per pixel nine multiplications, three cube roots (15 instructions each, no division) and three table look-ups
// or, from floats, three powers (20 instructions each). No memory but 1.5 KiB of stack.

namespace color_detail {

// Row `row` of the matrix from linear sRGB to XYZ / white. The three weights sum to 1 exactly as floats or to within
// 2^-24.
template <class F>
[[nodiscard]] F relative_xyz(const simd::F32x3<F>& rgb, int row, double white) noexcept {
  const double* m = ::npsim::kLinearSrgbToXyz.m[row];
  const F r(static_cast<float>(m[0] / white));
  const F g(static_cast<float>(m[1] / white));
  const F b(static_cast<float>(m[2] / white));
  return fma(g, rgb.y, fma(r, rgb.x, b * rgb.z));
}

template <class F>
[[nodiscard]] F lab_f(F t) noexcept {
  constexpr double kEpsilon = 216.0 / 24389.0;
  constexpr double kKappa = 24389.0 / 27.0;
  const F straight = fma(t, F(static_cast<float>(kKappa / 116.0)), F(static_cast<float>(16.0 / 116.0)));
  return select(t <= F(static_cast<float>(kEpsilon)), straight, simd::cbrt_of_positive(t));
}

// The sRGB decoding function within 1e-6 relative on [0, 1]: t^2.4 = (t r)^3 with r = t^(-1/5), which is found like the
// guess above. srgb_decode() is ten times as exact and takes three times as long.
template <class F>
[[nodiscard]] F fast_srgb_decode(F v) noexcept {
  using I = typename F::Int;
  static constexpr float kC[] = {0x1.000000p+0F, 0x1.9999A8p-3F, 0x1.EB7298p-4F,
                                 0x1.6853FAp-4F, 0x1.2836AAp-4F, 0x1.F60758p-5F};
  const F t = fma(v, F(static_cast<float>(1.0 / 1.055)), F(static_cast<float>(0.055 / 1.055)));
  const F guess = bitcast_float(I(0x4C2A8000) - (bitcast_int(t) >> 12) * I(819));
  const F square = guess * guess;
  const F defect = fma(-(t * guess), square * square, F(1.0F));
  const F root = t * guess * simd::math_detail::polynomial(defect, kC);  // t^(4/5)
  return select(v <= F(0.04045F), v * F(static_cast<float>(1.0 / 12.92)), root * root * root);
}

}  // namespace color_detail

// Batch form.
template <class F>
[[nodiscard]] simd::F32x3<F> linear_rgb_to_lab(const simd::F32x3<F>& rgb) noexcept {
  const F fx = color_detail::lab_f(color_detail::relative_xyz(rgb, 0, kWhiteD65Xyz.x));
  const F fy = color_detail::lab_f(color_detail::relative_xyz(rgb, 1, kWhiteD65Xyz.y));
  const F fz = color_detail::lab_f(color_detail::relative_xyz(rgb, 2, kWhiteD65Xyz.z));
  return {fma(fy, F(116.0F), F(-16.0F)), (fx - fy) * F(500.0F), (fy - fz) * F(200.0F)};
}

[[nodiscard]] inline Vec3f linear_rgb_to_lab(const Vec3f& rgb) noexcept {
  using F = simd::scalar::F32;
  const simd::F32x3<F> lab = linear_rgb_to_lab(simd::F32x3<F>{rgb.x, rgb.y, rgb.z});
  return {lab.x.value, lab.y.value, lab.z.value};
}

[[nodiscard]] inline Vec3f srgb8_to_lab(const Rgb8& c) noexcept { return linear_rgb_to_lab(srgb_decode8(c)); }

namespace color_detail {

// Rows of pixels of any kind to Lab: `load(pixels, n)` makes batches of linear light of n of them.
template <class F, class In, class Executor, class Load>
void rows_to_lab(const ImageView<const In>& in, const ImageView<Vec3f>& out, Executor& executor, Load load) noexcept {
  executor.for_chunks(static_cast<std::size_t>(in.height()), kColorRowsPerChunk,
                      [&](std::size_t begin, std::size_t end) {
                        for (std::size_t y = begin; y < end; ++y) {
                          const In* from = in.row(static_cast<int>(y));
                          Vec3f* to = out.row(static_cast<int>(y));
                          for (int x = 0; x < in.width(); x += F::lanes) {
                            const int n = in.width() - x < F::lanes ? in.width() - x : F::lanes;
                            simd::store3(&to[x].x, linear_rgb_to_lab(load(from + x, n)), n);
                          }
                        }
                      });
}

}  // namespace color_detail

// An 8-bit image as CIELAB.
template <class Executor>
Status srgb8_to_lab(const ImageView<const Rgb8>& in, const ImageView<Vec3f>& out, Executor& executor) noexcept {
  if (in.shape() != out.shape()) return {StatusCode::shape_mismatch, "srgb8_to_lab: input and output differ in size"};
  if (in.empty()) return {};
  using F = simd::F32;
  executor.for_chunks(
      static_cast<std::size_t>(in.height()), kColorRowsPerChunk, [&](std::size_t begin, std::size_t end) {
        // The table is read for some batches ahead: a batch made of stores that have only just been
        // issued would have to wait for them.
        constexpr int kAhead = 8 * simd::kMaxLanes;
        alignas(64) float linear[3][kAhead] = {};
        for (std::size_t y = begin; y < end; ++y) {
          const Rgb8* from = in.row(static_cast<int>(y));
          Vec3f* to = out.row(static_cast<int>(y));
          for (int x = 0; x < in.width(); x += kAhead) {
            const int n = in.width() - x < kAhead ? in.width() - x : kAhead;
            for (int i = 0; i < n; ++i) {
              linear[0][i] = srgb_decode8(from[x + i].r);
              linear[1][i] = srgb_decode8(from[x + i].g);
              linear[2][i] = srgb_decode8(from[x + i].b);
            }
            for (int i = 0; i < n; i += F::lanes) {
              const simd::F32x3<F> rgb{F::load(linear[0] + i), F::load(linear[1] + i), F::load(linear[2] + i)};
              simd::store3(&to[x + i].x, linear_rgb_to_lab(rgb), n - i < F::lanes ? n - i : F::lanes);
            }
          }
        }
      });
  return {};
}

// An image of encoded sRGB values, 0 .. 1 for black .. white, as CIELAB; `out` may be `in`.
template <class Executor>
Status srgb_to_lab(const ImageView<const Vec3f>& in, const ImageView<Vec3f>& out, Executor& executor) noexcept {
  if (in.shape() != out.shape()) return {StatusCode::shape_mismatch, "srgb_to_lab: input and output differ in size"};
  if (in.empty()) return {};
  using F = simd::F32;
  color_detail::rows_to_lab<F>(in, out, executor, [](const Vec3f* from, int n) {
    const simd::F32x3<F> coded = simd::load3<F>(&from->x, n);
    return simd::F32x3<F>{color_detail::fast_srgb_decode(coded.x), color_detail::fast_srgb_decode(coded.y),
                          color_detail::fast_srgb_decode(coded.z)};
  });
  return {};
}

// A linear image as CIELAB; `out` may be `in`.
template <class Executor>
Status linear_to_lab(const ImageView<const Vec3f>& in, const ImageView<Vec3f>& out, Executor& executor) noexcept {
  if (in.shape() != out.shape()) return {StatusCode::shape_mismatch, "linear_to_lab: input and output differ in size"};
  if (in.empty()) return {};
  using F = simd::F32;
  color_detail::rows_to_lab<F>(in, out, executor, [](const Vec3f* from, int n) { return simd::load3<F>(&from->x, n); });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_COLOR_SRGB_HPP
