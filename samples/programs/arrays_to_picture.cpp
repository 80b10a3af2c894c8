// SPDX-License-Identifier: Apache-2.0
// From arrays to a picture in static memory, without heap, threads or files: docs/embedding.md. main() makes the arrays
// up: a road that ends at a wall 20 m away, under the sky.
#include "npsim/npsim.hpp"

constexpr npsim::Shape kShape{160, 96};
constexpr npsim::NightParams kParams{};
alignas(npsim::kWorkspaceAlignment) unsigned char memory[npsim::night_workspace_bytes(kParams, kShape, 0)];

// image: sRGB. depth_m: z-depth in metres, 0 where none was measured. Both and the picture: kShape, row by row.
npsim::Status night(const npsim::Rgb8* image, const float* depth_m, npsim::Rgb8* picture) {
  npsim::SceneView scene;  // labels, normals and marked lamps may be given as well
  scene.camera = npsim::intrinsics_from_fov(kShape, 1.2F);
  scene.image = {image, kShape};
  scene.depth = {depth_m, kShape};
  npsim::Workspace workspace(memory, sizeof(memory));
  npsim::SerialExecutor executor;
  return npsim::make_night(kParams, scene, workspace, executor, {picture, kShape});
}

npsim::Rgb8 day[kShape.pixels()], dark[kShape.pixels()];
float day_depth_m[kShape.pixels()];

int main() {
  for (std::size_t i = 0; i < kShape.pixels(); ++i) {
    const auto row = static_cast<float>(i / kShape.width);
    day[i] = {120, 120, 120};
    day_depth_m[i] = row < 10 ? 0.0F : row < 58 ? 20.0F : 200.0F / (row - 48);
  }
  return night(day, day_depth_m, dark).ok() ? 0 : 1;
}
