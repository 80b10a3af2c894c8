// SPDX-License-Identifier: Apache-2.0
// One object of this for each instruction set. DISPATCH_SET is its name; CMakeLists.txt gives it with the flags. The
// library's own namespace is named after the flags, so that the linker has nothing to choose from.
#include "dispatch/kernels.hpp"

#include "npsim/npsim.hpp"

extern "C" std::size_t DISPATCH_JOIN(photograph_bytes_, DISPATCH_SET)(int width, int height) {
  return npsim::photograph_workspace_bytes({}, {width, height});
}

extern "C" const char* DISPATCH_JOIN(photograph_, DISPATCH_SET)(const float* luminance_cd_m2, int width, int height,
                                                                unsigned char* picture, void* memory,
                                                                std::size_t bytes) {
  static_assert(sizeof(npsim::Vec3f) == 3 * sizeof(float) && sizeof(npsim::Rgb8) == 3);
  const npsim::Shape shape{width, height};
  npsim::Workspace workspace(memory, bytes);
  npsim::SerialExecutor executor;
  npsim::CameraExposure exposure;
  return npsim::photograph({}, npsim::intrinsics_from_fov(shape, 1.2F), 1, 0,
                           {reinterpret_cast<const npsim::Vec3f*>(luminance_cd_m2), shape},
                           {reinterpret_cast<npsim::Rgb8*>(picture), shape}, exposure, workspace, executor)
      .message();
}
