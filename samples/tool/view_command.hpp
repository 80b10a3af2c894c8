// SPDX-License-Identifier: Apache-2.0
// npsim view: one picture of a scene's mesh, or of a mesh in an OBJ file, from any side; and what the mesh consists of.
#ifndef NPSIM_SAMPLES_TOOL_VIEW_COMMAND_HPP
#define NPSIM_SAMPLES_TOOL_VIEW_COMMAND_HPP

#include <string>

#include "mesh_view_params.hpp"

namespace npsim::tool {

struct ViewOptions {
  std::string scene;
  std::string output;
  std::string mesh = "complete";  // or raw, pruned, background, objects
  MeshViewParams from;
  std::string picture;  // size of the picture; empty: the scene's
  std::string size;     // size to work at; empty: the image's
  std::string preset = "default";
  float shading = 0;
  float wire_px = 0;
  int threads = 0;
  bool plain = false;
  bool y_down = false;  // an OBJ's axes are those of the camera
  bool quiet = false;
};

[[nodiscard]] int run_view(const ViewOptions& options);  // an exit status

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_VIEW_COMMAND_HPP
