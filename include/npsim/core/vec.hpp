// SPDX-License-Identifier: Apache-2.0
// Small vectors, and angles and points of the disc made of them.
#ifndef NPSIM_CORE_VEC_HPP
#define NPSIM_CORE_VEC_HPP

#include <cmath>
#include <cstdint>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Small fixed-size vectors for points, directions and linear RGB. Standard layout, no alignment beyond the element,
// so that arrays of them may be exchanged with any other library.

template <class T>
struct Vec2 {
  T x{};
  T y{};
};

template <class T>
struct Vec3 {
  T x{};
  T y{};
  T z{};

  constexpr Vec3& operator+=(const Vec3& b) noexcept {
    x += b.x;
    y += b.y;
    z += b.z;
    return *this;
  }
  constexpr Vec3& operator-=(const Vec3& b) noexcept {
    x -= b.x;
    y -= b.y;
    z -= b.z;
    return *this;
  }
  constexpr Vec3& operator*=(T s) noexcept {
    x *= s;
    y *= s;
    z *= s;
    return *this;
  }
};

using Vec2f = Vec2<float>;
using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;

// One displayed pixel: sRGB-encoded, 8 bits a channel.
struct Rgb8 {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
};

// clang-format off
template <class T> [[nodiscard]] constexpr Vec2<T> operator+(const Vec2<T>& a, const Vec2<T>& b) noexcept { return {a.x + b.x, a.y + b.y}; }
template <class T> [[nodiscard]] constexpr Vec2<T> operator-(const Vec2<T>& a, const Vec2<T>& b) noexcept { return {a.x - b.x, a.y - b.y}; }
template <class T> [[nodiscard]] constexpr Vec3<T> operator+(const Vec3<T>& a, const Vec3<T>& b) noexcept { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
template <class T> [[nodiscard]] constexpr Vec3<T> operator-(const Vec3<T>& a, const Vec3<T>& b) noexcept { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
template <class T> [[nodiscard]] constexpr Vec3<T> operator-(const Vec3<T>& a) noexcept { return {-a.x, -a.y, -a.z}; }
template <class T> [[nodiscard]] constexpr Vec3<T> operator*(const Vec3<T>& a, T s) noexcept { return {a.x * s, a.y * s, a.z * s}; }
template <class T> [[nodiscard]] constexpr Vec3<T> operator*(T s, const Vec3<T>& a) noexcept { return a * s; }
// Component-wise product: light times albedo.
template <class T> [[nodiscard]] constexpr Vec3<T> operator*(const Vec3<T>& a, const Vec3<T>& b) noexcept { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
template <class T> [[nodiscard]] constexpr Vec3<T> operator/(const Vec3<T>& a, T s) noexcept { return {a.x / s, a.y / s, a.z / s}; }
template <class T> [[nodiscard]] constexpr bool operator==(const Vec3<T>& a, const Vec3<T>& b) noexcept { return a.x == b.x && a.y == b.y && a.z == b.z; }
template <class T> [[nodiscard]] constexpr bool operator!=(const Vec3<T>& a, const Vec3<T>& b) noexcept { return !(a == b); }
template <class T> [[nodiscard]] constexpr T dot(const Vec3<T>& a, const Vec3<T>& b) noexcept { return a.x * b.x + a.y * b.y + a.z * b.z; }
template <class T> [[nodiscard]] constexpr Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) noexcept { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
// clang-format on

template <class T>
[[nodiscard]] inline T length(const Vec3<T>& a) noexcept {
  return std::sqrt(dot(a, a));
}

// Unit vector along a; the zero vector (and one whose squared length underflows) stays zero.
template <class T>
[[nodiscard]] inline Vec3<T> normalized(const Vec3<T>& a) noexcept {
  const T l = length(a);
  return l > T(0) ? a / l : Vec3<T>{};
}

template <class T>
[[nodiscard]] inline bool is_finite(const Vec3<T>& a) noexcept {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}

template <class To, class From>
[[nodiscard]] constexpr Vec3<To> vec_cast(const Vec3<From>& a) noexcept {
  return {static_cast<To>(a.x), static_cast<To>(a.y), static_cast<To>(a.z)};
}

// Relative luminance of linear RGB with sRGB primaries and white D65 (IEC 61966-2-1).
[[nodiscard]] constexpr float luminance(const Vec3f& rgb) noexcept {
  return 0.2126F * rgb.x + 0.7152F * rgb.y + 0.0722F * rgb.z;
}

// Angles, and points of the unit disc, by short polynomials: the bits do not depend on the C library.
//
// angle_of(): Abramowitz and Stegun 4.4.49, 2e-8 before rounding, 4e-7 with it. concentric_disc(): the map of the
// square to the disc that keeps areas and neighbours (Shirley and Chiu 1997); its angles stay within pi/4, where sine
// and cosine are right to 4e-7.

// Of the vector (x, y) from the x axis, -pi to pi; 0 for the zero vector.
[[nodiscard]] inline float angle_of(float y, float x) noexcept {
  constexpr float kHalfPi = 1.57079633F;
  const float ax = std::fabs(x);
  const float ay = std::fabs(y);
  const bool steep = ay > ax;
  const float longer = steep ? ay : ax;
  if (!(longer > 0.0F)) return 0.0F;
  const float t = (steep ? ax : ay) / longer;
  const float q = t * t;
  const float series =
      1.0F +
      q * (-0.3333314528F +
           q * (0.1999355085F +
                q * (-0.1420889944F +
                     q * (0.1065626393F +
                          q * (-0.0752896400F + q * (0.0429096138F + q * (-0.0161657367F + q * 0.0028662257F)))))));
  float angle = t * series;
  if (steep) angle = kHalfPi - angle;
  if (x < 0.0F) angle = 2.0F * kHalfPi - angle;
  return y < 0.0F ? -angle : angle;
}

// A point of the unit disc from u, v in [0, 1), uniform where they are.
[[nodiscard]] inline Vec2f concentric_disc(float u, float v) noexcept {
  const float a = 2.0F * u - 1.0F;
  const float b = 2.0F * v - 1.0F;
  if (a == 0.0F && b == 0.0F) return {};
  const bool wide = std::fabs(a) > std::fabs(b);
  const float radius = wide ? a : b;
  const float angle = 0.78539816F * (wide ? b / a : a / b);
  const float q = angle * angle;
  const float sine = angle * (1.0F + q * (-1.0F / 6.0F + q * (1.0F / 120.0F - q * (1.0F / 5040.0F))));
  const float cosine = 1.0F + q * (-0.5F + q * (1.0F / 24.0F + q * (-1.0F / 720.0F + q * (1.0F / 40320.0F))));
  return {radius * (wide ? cosine : sine), radius * (wide ? sine : cosine)};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_VEC_HPP
