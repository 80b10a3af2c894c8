// SPDX-License-Identifier: Apache-2.0
// Small fixed-size vectors for points, directions and linear RGB. Standard layout, no alignment beyond the element,
// so that arrays of them may be exchanged with any other library.
#ifndef NPSIM_CORE_VEC_HPP
#define NPSIM_CORE_VEC_HPP

#include <cmath>
#include <cstdint>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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

  constexpr Vec3& operator+=(const Vec3& b) noexcept { x += b.x; y += b.y; z += b.z; return *this; }
  constexpr Vec3& operator-=(const Vec3& b) noexcept { x -= b.x; y -= b.y; z -= b.z; return *this; }
  constexpr Vec3& operator*=(T s) noexcept { x *= s; y *= s; z *= s; return *this; }
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

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_VEC_HPP
