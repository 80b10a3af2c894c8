// SPDX-License-Identifier: Apache-2.0
// What a scene says about its photograph, drawn over it: labels, horizon and ground as the depth has them, marked lamps.
#ifndef NPSIM_SAMPLES_TOOL_OVERLAY_HPP
#define NPSIM_SAMPLES_TOOL_OVERLAY_HPP

#include "npsim/core/scene_view.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/io/image.hpp"

namespace npsim::tool {

// Tinted by label, the outlines of instances dark; the horizon and a grid on the ground, 5 m along and 2.5 m across,
// to 60 m; outlines of the marked lamps with their ids, groups fainter and without.
[[nodiscard]] io::Image<Rgb8> overlay_picture(const SceneView& scene, const GroundPlane& ground);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_OVERLAY_HPP
