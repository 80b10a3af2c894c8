// SPDX-License-Identifier: Apache-2.0
// Linear sRGB <-> CIE XYZ (1931, 2 degrees), relative to white Y = 1.
//
// The matrices are computed from the chromaticities of the primaries in IEC 61966-2-1 and from the white D65 =
// (0.95047, 1, 1.08883), and not taken from the rounded table of the standard, so that R = G = B = 1 is this white
// exactly and greys have no colour in CIELAB. They agree with the standard's four digits. Error: a few double
// roundings.
#ifndef NPSIM_COLOR_XYZ_HPP
#define NPSIM_COLOR_XYZ_HPP

#include "npsim/core/config.hpp"
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

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_COLOR_XYZ_HPP
