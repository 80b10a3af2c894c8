// SPDX-License-Identifier: Apache-2.0
// Colours of light: linear sRGB and CIE XYZ, CIE xy, correlated colour temperature and channel ratios, and the light
// sources of a street at night.
//
// XYZ (1931, 2 degrees) is relative to white Y = 1. The matrices are computed from the chromaticities of the primaries
// in IEC 61966-2-1 and from the white D65 = (0.95047, 1, 1.08883), and not taken from the rounded table of the
// standard, so that R = G = B = 1 is this white exactly and greys have no colour in CIELAB. They agree with the
// standard's four digits.
// A light's colour is a linear sRGB triple of luminance 1, so that its product with a photometric quantity keeps that
// quantity's value. Chromaticities outside the sRGB gamut (sodium, coloured signals) move along the straight line to
// white D65 until the smallest channel is zero: hue is kept nearly, luminance exactly.
// Luminance here is row Y of kLinearSrgbToXyz; the four-digit weights of luminance() in core/vec.hpp differ from it by
// less than 1e-4, so luminance() of such a triple is 1 within 2e-3.
// Computed in double; error: a few double roundings, and where the result is float its rounding.
#ifndef NPSIM_COLOR_CHROMATICITY_HPP
#define NPSIM_COLOR_CHROMATICITY_HPP

#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Row-major: out = m * in.
struct Matrix3d {
  double m[3][3] = {};

  [[nodiscard]] constexpr Vec3d operator*(const Vec3d& v) const noexcept {
    return {m[0][0] * v.x + m[0][1] * v.y + m[0][2] * v.z, m[1][0] * v.x + m[1][1] * v.y + m[1][2] * v.z,
            m[2][0] * v.x + m[2][1] * v.y + m[2][2] * v.z};
  }
};

inline constexpr Vec3d kWhiteD65Xyz{0.95047, 1.0, 1.08883};

namespace color_detail {

[[nodiscard]] constexpr Matrix3d inverse(const Matrix3d& a) noexcept {
  Matrix3d out;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      // The cyclic minor of (j, i) carries its sign with it.
      const int r0 = (j + 1) % 3;
      const int r1 = (j + 2) % 3;
      const int c0 = (i + 1) % 3;
      const int c1 = (i + 2) % 3;
      out.m[i][j] = a.m[r0][c0] * a.m[r1][c1] - a.m[r0][c1] * a.m[r1][c0];
    }
  }
  const double determinant = a.m[0][0] * out.m[0][0] + a.m[0][1] * out.m[1][0] + a.m[0][2] * out.m[2][0];
  for (auto& row : out.m) {
    for (double& value : row) value /= determinant;
  }
  return out;
}

// Columns are the primaries at Y = 1, scaled so that their sum is white.
[[nodiscard]] constexpr Matrix3d rgb_to_xyz() noexcept {
  constexpr double kX[3] = {0.64, 0.30, 0.15};
  constexpr double kY[3] = {0.33, 0.60, 0.06};
  Matrix3d primaries;
  for (int i = 0; i < 3; ++i) {
    primaries.m[0][i] = kX[i] / kY[i];
    primaries.m[1][i] = 1.0;
    primaries.m[2][i] = (1.0 - kX[i] - kY[i]) / kY[i];
  }
  const Vec3d amount = inverse(primaries) * kWhiteD65Xyz;
  for (auto& row : primaries.m) {
    row[0] *= amount.x;
    row[1] *= amount.y;
    row[2] *= amount.z;
  }
  return primaries;
}

}  // namespace color_detail

inline constexpr Matrix3d kLinearSrgbToXyz = color_detail::rgb_to_xyz();
inline constexpr Matrix3d kXyzToLinearSrgb = color_detail::inverse(kLinearSrgbToXyz);

[[nodiscard]] constexpr Vec3d linear_srgb_to_xyz(const Vec3d& rgb) noexcept { return kLinearSrgbToXyz * rgb; }
[[nodiscard]] constexpr Vec3d xyz_to_linear_srgb(const Vec3d& xyz) noexcept { return kXyzToLinearSrgb * xyz; }

// CIE 1931 xy, 2 degrees.
struct Chromaticity {
  float x = 0.3127F;
  float y = 0.3290F;
};

// CIE 15:2018 for A, D65 and the LED-B/V and HP series (typical LEDs: B phosphor-converted blue, V phosphor-converted
// violet; high-pressure sodium: HP1 standard, HP2 colour-enhanced). The metal halide and mercury lamps are typical
// values and meant as defaults that a user may replace.
namespace illuminant {

inline constexpr Chromaticity kD65{0.3127F, 0.3290F};
inline constexpr Chromaticity kA{0.44757F, 0.40745F};  // incandescent, 2856 K

inline constexpr Chromaticity kLedB1{0.4560F, 0.4078F};  // about 2700 K
inline constexpr Chromaticity kLedB2{0.4357F, 0.4012F};  // 3000 K
inline constexpr Chromaticity kLedB3{0.3756F, 0.3723F};  // 4100 K
inline constexpr Chromaticity kLedB4{0.3422F, 0.3502F};  // 5100 K
inline constexpr Chromaticity kLedV1{0.4548F, 0.4044F};  // 2700 K
inline constexpr Chromaticity kLedV2{0.3781F, 0.3775F};  // 4100 K

inline constexpr Chromaticity kHighPressureSodium1{0.5330F, 0.4150F};  // HP1, 2000 K
inline constexpr Chromaticity kHighPressureSodium2{0.4778F, 0.4158F};  // HP2, 2500 K
inline constexpr Chromaticity kMetalHalideWarm{0.4286F, 0.3882F};
inline constexpr Chromaticity kMetalHalideNeutral{0.3731F, 0.3714F};
inline constexpr Chromaticity kMercury{0.3112F, 0.3829F};

}  // namespace illuminant

// Luminance-1 linear sRGB of a chromaticity with 0 <= x, 1e-3 <= y, x + y <= 1.
[[nodiscard]] constexpr Result<Vec3f> xy_to_linear_srgb(const Chromaticity& xy) noexcept {
  const auto x = static_cast<double>(xy.x);
  const auto y = static_cast<double>(xy.y);
  if (!(x >= 0.0 && y >= 1e-3 && x + y <= 1.0 + 1e-6)) {
    return Status(StatusCode::invalid_argument, "chromaticity: x >= 0, y >= 0.001 and x + y <= 1 are needed");
  }
  const Vec3d rgb = xyz_to_linear_srgb({x / y, 1.0, (1.0 - x - y) / y});
  double least = rgb.x < rgb.y ? rgb.x : rgb.y;
  least = least < rgb.z ? least : rgb.z;
  // White, (1, 1, 1), has luminance 1 too, and so has every mixture.
  const auto mix = [least](double c) {
    if (least >= 0.0) return static_cast<float>(c);
    return c > least ? static_cast<float>(1.0 + (c - 1.0) / (1.0 - least)) : 0.0F;
  };
  return Vec3f{mix(rgb.x), mix(rgb.y), mix(rgb.z)};
}

// Chromaticity of a colour with non-negative X, Y, Z and a positive finite sum.
[[nodiscard]] constexpr Result<Chromaticity> linear_srgb_to_xy(const Vec3f& rgb) noexcept {
  const Vec3d xyz = linear_srgb_to_xyz(vec_cast<double>(rgb));
  const double sum = xyz.x + xyz.y + xyz.z;
  if (!(sum > 0.0 && sum < 1e300 && xyz.x >= 0.0 && xyz.y >= 0.0 && xyz.z >= 0.0)) {
    return Status(StatusCode::invalid_argument, "colour: black, not finite, or outside of all colours");
  }
  return Chromaticity{static_cast<float>(xyz.x / sum), static_cast<float>(xyz.y / sum)};
}

// Luminance-1 linear sRGB with the given ratios of channels, both finite and >= 0 (at most 1e6).
[[nodiscard]] constexpr Result<Vec3f> ratios_to_linear_srgb(float r_over_g, float b_over_g) noexcept {
  if (!(r_over_g >= 0.0F && r_over_g <= 1e6F && b_over_g >= 0.0F && b_over_g <= 1e6F)) {
    return Status(StatusCode::invalid_argument, "channel ratios r/g and b/g must lie in [0, 1e6]");
  }
  const Vec3d ratio{static_cast<double>(r_over_g), 1.0, static_cast<double>(b_over_g)};
  return vec_cast<float>(ratio / linear_srgb_to_xyz(ratio).y);
}

enum class Locus : std::uint8_t {
  planckian,  // glowing bodies and lamps that imitate them; 1667 K to 25000 K
  daylight,   // CIE D series; 4000 K to 25000 K
};

// Chromaticity of a temperature on a locus.
// Planckian: the cubic fit of Kim et al. (US patent 7024034, 2006), within 1e-3 in x and y of the black body.
// Daylight: CIE 15, on the present temperature scale (D65 stands at 6504 K).
[[nodiscard]] constexpr Result<Chromaticity> cct_to_xy(float cct_k, Locus locus) noexcept {
  const double lowest_k = locus == Locus::planckian ? 1667.0 : 4000.0;
  const auto t = static_cast<double>(cct_k);
  if (!(t >= lowest_k && t <= 25000.0)) {
    return Status(StatusCode::invalid_argument,
                  "colour temperature: 1667 K to 25000 K on the Planckian locus, from 4000 K in daylight");
  }
  const auto cubic = [](double u, double c3, double c2, double c1, double c0) {
    return ((c3 * u + c2) * u + c1) * u + c0;
  };
  const double u = 1000.0 / t;
  double x = 0.0;
  double y = 0.0;
  if (locus == Locus::planckian) {
    x = t <= 4000.0 ? cubic(u, -0.2661239, -0.2343589, 0.8776956, 0.179910)
                    : cubic(u, -3.0258469, 2.1070379, 0.2226347, 0.240390);
    if (t <= 2222.0) {
      y = cubic(x, -1.1063814, -1.34811020, 2.18555832, -0.20219683);
    } else if (t <= 4000.0) {
      y = cubic(x, -0.9549476, -1.37418593, 2.09137015, -0.16748867);
    } else {
      y = cubic(x, 3.0817580, -5.87338670, 3.75112997, -0.37001483);
    }
  } else {
    x = t <= 7000.0 ? cubic(u, -4.6070, 2.9678, 0.09911, 0.244063) : cubic(u, -2.0064, 1.9018, 0.24748, 0.237040);
    y = cubic(x, 0.0, -3.0, 2.870, -0.275);
  }
  return Chromaticity{static_cast<float>(x), static_cast<float>(y)};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_COLOR_CHROMATICITY_HPP
