// SPDX-License-Identifier: Apache-2.0
// What a night loses when its rays meet the simplified mesh: one variant, rendered with all faces and with fewer.
#ifndef NPSIM_SAMPLES_TOOL_NIGHT_CHANGE_HPP
#define NPSIM_SAMPLES_TOOL_NIGHT_CHANGE_HPP

#include <array>
#include <cstddef>

#include "arena.hpp"
#include "console.hpp"
#include "kept_night.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/pipeline/night.hpp"

namespace npsim::tool {

struct NightChange {
  std::array<std::size_t, 2> faces{};  // all, simplified
  double mean_colour = 0;              // of the linear picture: relative change of the channel that changes most
  double rms_codes = 0;                // root mean square over the picture as shown, in codes of 255
};

inline Status night_change(NightParams params, const SceneView& scene, ThreadPool& pool, Console& console,
                           NightChange& out) {
  params.variants = 1;
  params.mesh.traced = TracedFaces::mesh;
  std::array<KeptNight, 2> nights;
  for (std::size_t i = 0; i < nights.size(); ++i) {
    params.mesh.simplify_faces = i == 1;
    const Arena arena(night_workspace_bytes(params, scene.shape(), scene.lights.size()));
    if (arena.bytes() == 0) return {StatusCode::workspace_exhausted, "not enough memory for a night at this size"};
    Workspace workspace(arena.data(), arena.bytes());
    NPSIM_RETURN_IF_ERROR(make_nights(params, scene, workspace, pool, console, nights[i]));
    out.faces[i] = nights[i].faces;
  }
  out.mean_colour = mean_colour_change(nights[0], nights[1]);
  out.rms_codes = rms_change_codes(nights[0], nights[1]);
  return {};
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_NIGHT_CHANGE_HPP
