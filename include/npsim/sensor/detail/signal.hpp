// SPDX-License-Identifier: Apache-2.0
// What the sensor kernels share: how they read a sample, how they divide the rows.
//
// A sample that is NaN or negative reads as 0, one above kMaxSample (infinity included) as kMaxSample: light is never
// negative, and one broken pixel must not spread through a blur or a mean.
#ifndef NPSIM_SENSOR_DETAIL_SIGNAL_HPP
#define NPSIM_SENSOR_DETAIL_SIGNAL_HPP

#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr std::size_t kSensorRowChunk = 16;  // rows per task
inline constexpr float kMaxSample = 1e12F;          // the sun's disc is 2e9 cd/m2

[[nodiscard]] constexpr float sane_sample(float x) noexcept {
  return x > 0.0F ? (x < kMaxSample ? x : kMaxSample) : 0.0F;
}
[[nodiscard]] constexpr Vec3f sane_sample(const Vec3f& rgb) noexcept {
  return {sane_sample(rgb.x), sane_sample(rgb.y), sane_sample(rgb.z)};
}

// Light with a largest channel of at most `cap`, its hue kept.
[[nodiscard]] constexpr Vec3f capped(const Vec3f& light, float cap) noexcept {
  const float brightest = max_of(light.x, light.y, light.z);
  return brightest > cap ? light * (cap / brightest) : light;
}

// sane_sample, saturated at full scale.
[[nodiscard]] constexpr float saturated(float x) noexcept { return x > 0.0F ? (x < 1.0F ? x : 1.0F) : 0.0F; }
[[nodiscard]] constexpr Vec3f saturated(const Vec3f& rgb) noexcept {
  return {saturated(rgb.x), saturated(rgb.y), saturated(rgb.z)};
}

[[nodiscard]] inline Status check_image(ImageView<const Vec3f> in) noexcept {
  if (in.empty()) return Status(StatusCode::no_valid_input, "the sensor needs an image of at least one pixel");
  return {};
}

template <class Out>
[[nodiscard]] Status check_images(ImageView<const Vec3f> in, ImageView<Out> out) noexcept {
  NPSIM_RETURN_IF_ERROR(check_image(in));
  if (out.empty() || out.shape() != in.shape()) {
    return Status(StatusCode::shape_mismatch, "input and output image must have the same size");
  }
  return {};
}

// A batch of which the first n lanes count. Whole ones go the common way: masked stores are slow on some processors.
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE F load_first(const float* p, int n) noexcept {
  return n == F::lanes ? F::load(p) : F::load(p, n);
}
template <class F>
NPSIM_ALWAYS_INLINE void store_first(F v, float* p, int n) noexcept {
  if (n == F::lanes) {
    v.store(p);
  } else {
    v.store(p, n);
  }
}
template <class F>
[[nodiscard]] NPSIM_ALWAYS_INLINE F load_sane(const float* p, int n) noexcept {
  return min(max(load_first<F>(p, n), F(0.0F)), F(kMaxSample));
}

// Calls use(i, n) for the batches of `count` channels, n of them whole but in the last.
template <class F, class Use>
NPSIM_ALWAYS_INLINE void for_batches(int count, const Use& use) noexcept {
  for (int i = 0; i < count; i += F::lanes) use(i, count - i < F::lanes ? count - i : F::lanes);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_DETAIL_SIGNAL_HPP
