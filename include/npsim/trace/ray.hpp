// SPDX-License-Identifier: Apache-2.0
// Ray and Hit: what is asked of a ray tracer, and what it answers.
//
// A ray is the open interval of points origin + t direction with t_min < t < t_max: a surface exactly at either limit
// is not hit. The direction need not be a unit vector; t is in units of its length. A ray with a component that is
// not finite, with a NaN limit or without a direction hits nothing; a negative t_min counts as 0.
#ifndef NPSIM_TRACE_RAY_HPP
#define NPSIM_TRACE_RAY_HPP

#include <cstdint>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// What Hit::face holds when nothing was hit.
inline constexpr std::uint32_t kNoFace = 0xFFFFFFFFU;

struct Ray {
  Vec3f origin;
  Vec3f direction;
  float t_min = 0.0F;
  float t_max = std::numeric_limits<float>::infinity();
};

// The point is (1 - u - v) a + u b + v c of face `face` (index into the mesh that the tree was built from).
struct Hit {
  float t = std::numeric_limits<float>::infinity();
  std::uint32_t face = kNoFace;
  float u = 0.0F;  // barycentric coordinate of vertex b
  float v = 0.0F;  // barycentric coordinate of vertex c
};

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_RAY_HPP
