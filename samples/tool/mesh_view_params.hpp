// SPDX-License-Identifier: Apache-2.0
// Where a mesh is seen from.
#ifndef NPSIM_SAMPLES_TOOL_MESH_VIEW_PARAMS_HPP
#define NPSIM_SAMPLES_TOOL_MESH_VIEW_PARAMS_HPP

namespace npsim::tool {

// In words of the thesis' figures.
struct MeshViewParams {
  float closer_m = 0;
  float turn_deg = 0;   // clockwise, seen from above
  float climb_deg = 0;  // looking down
  float pivot_m = 0;    // ahead of the photograph's camera; 0: chosen for the scene
};

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_MESH_VIEW_PARAMS_HPP
