// SPDX-License-Identifier: Apache-2.0
// Randomness of the street: seeded draws for the layout, and lattice noise for the textures.
//
// Both are pure functions of their arguments, so neither the order of building nor the number of threads matters.
#ifndef NPSIM_SAMPLES_STREET_DICE_HPP
#define NPSIM_SAMPLES_STREET_DICE_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/random.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
namespace street {

inline constexpr float kPi = 3.14159265F;

// What a stream of draws decides; keeps objects independent, so that one more draw for a tree moves no car.
enum class Topic : std::uint32_t {
  layout,
  road,
  building_left,
  building_right,
  car,
  bus,
  tree,
  person,
  furniture,
  sky,
  degrade,
  render,
  sign,
  leaf
};

class Dice {
 public:
  Dice(std::uint64_t seed, Topic topic, std::uint32_t index, std::uint32_t part = 0)
      : stream_(seed, RandomPurpose::street, 0, static_cast<std::uint32_t>(topic), index, part) {}
  float uniform() { return stream_.uniform(); }
  float uniform(float low, float high) { return stream_.uniform(low, high); }
  bool chance(float p) { return stream_.uniform() < p; }
  // 0 .. count - 1
  int pick(int count) { return static_cast<int>(stream_.uniform() * static_cast<float>(count)); }
  std::uint32_t bits() { return stream_.next_u32(); }
  float sign() { return chance(0.5F) ? 1.0F : -1.0F; }
  // One of some colours, darker or lighter by a factor in [low, high). Drawn one after the other: operands and
  // arguments are evaluated in an order that compilers choose, so no expression may hold two draws.
  template <std::size_t N>
  Vec3f one_of(const Vec3f (&colours)[N], float low, float high) {
    const Vec3f colour = colours[pick(static_cast<int>(N))];
    return colour * uniform(low, high);
  }

 private:
  RandomStream stream_;
};

inline float clamp01(float v) { return v < 0 ? 0.0F : (v > 1 ? 1.0F : v); }
inline float mix(float a, float b, float t) { return a + (b - a) * t; }
inline Vec3f mix(const Vec3f& a, const Vec3f& b, float t) { return a + (b - a) * t; }
inline float smoothstep(float low, float high, float v) {
  const float t = clamp01((v - low) / (high - low));
  return t * t * (3 - 2 * t);
}
inline float fract(float v) { return v - std::floor(v); }

// Integer finaliser (xor-shift and multiply); good enough for textures, not for sampling.
inline std::uint32_t hash(std::uint32_t v) {
  v ^= v >> 16U;
  v *= 0x7FEB352DU;
  v ^= v >> 15U;
  v *= 0x846CA68BU;
  return v ^ (v >> 16U);
}
inline std::uint32_t hash(int x, int y, std::uint32_t seed) {
  return hash(static_cast<std::uint32_t>(x) * 0x9E3779B1U ^ hash(static_cast<std::uint32_t>(y) + seed * 0x85EBCA77U));
}
inline float to_unit(std::uint32_t v) { return static_cast<float>(v >> 8U) * 0x1p-24F; }
inline float cell_value(int x, int y, std::uint32_t seed) { return to_unit(hash(x, y, seed)); }

// Value noise in [0, 1], smooth, with one lattice cell per unit.
inline float noise(float x, float y, std::uint32_t seed) {
  const float fx = std::floor(x);
  const float fy = std::floor(y);
  const int ix = static_cast<int>(fx);
  const int iy = static_cast<int>(fy);
  const float tx = x - fx;
  const float ty = y - fy;
  const float sx = tx * tx * (3 - 2 * tx);
  const float sy = ty * ty * (3 - 2 * ty);
  return mix(mix(cell_value(ix, iy, seed), cell_value(ix + 1, iy, seed), sx),
             mix(cell_value(ix, iy + 1, seed), cell_value(ix + 1, iy + 1, seed), sx), sy);
}

// Octaves of noise about 0 (roughly -0.5 .. 0.5). Octaves finer than `footprint` (the width of a pixel in the units of
// x and y) fade out, which is what keeps distant texture from flickering.
inline float fractal(float x, float y, int octaves, std::uint32_t seed, float footprint) {
  float sum = 0;
  float weight = 0.5F;
  float frequency = 1;
  for (int i = 0; i < octaves; ++i) {
    const float fade = clamp01(1.5F - 1.5F * footprint * frequency);
    if (fade <= 0) break;
    sum += weight * fade * (noise(x * frequency, y * frequency, seed + static_cast<std::uint32_t>(i) * 101U) - 0.5F);
    weight *= 0.55F;
    frequency *= 2.03F;
  }
  return sum;
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_DICE_HPP
