// SPDX-License-Identifier: Apache-2.0
// Light transport by itself: the renderer's night of a scene, and the same mesh, materials and lamps by the reference.
#ifndef NPSIM_SAMPLES_LAB_TRANSPORT_ALONE_HPP
#define NPSIM_SAMPLES_LAB_TRANSPORT_ALONE_HPP

#include <cstdint>

#include "any.hpp"
#include "npsim/io/image.hpp"
#include "npsim/pipeline/night.hpp"

namespace npsim::tool {

// own: the renderer's light. converged: that of the reference after `samples` paths a pixel, of surfaces alone; what is
// no surface, or no point of the mesh, is black. params.mesh: with all faces, so that both trace the same.
[[nodiscard]] Status transport_alone(const NightParams& params, const SceneView& scene, const RefinedDepth& refined,
                                     std::uint64_t samples, AnyExecutor executor, AnyObserver observer,
                                     io::Image<Vec3f>& own, io::Image<Vec3f>& converged);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_TRANSPORT_ALONE_HPP
