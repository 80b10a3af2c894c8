// SPDX-License-Identifier: Apache-2.0
// A user of the installed library, with the kernel of docs/embedding.md as it is printed there. Fails unless the
// headers are those of the version named on the command line and the kernel works.
#include <cstring>

#include "npsim/core/config.hpp"

#include "npsim/color/srgb.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/depth/cross_bilateral.hpp"

constexpr npsim::Shape kShape{640, 480};

constexpr npsim::CrossBilateralParams filter_params() {
  npsim::CrossBilateralParams params;  // mu, sigma_s_px and sigma_c as in section 3.4.1
  params.max_relative_error = 1e-3F;   // of each depth, against equation (3.2) without rounding
  return params;
}

alignas(npsim::kWorkspaceAlignment) unsigned char
    memory[npsim::cross_bilateral_workspace_bytes(filter_params(), kShape)];

// depth_m: metres, 0 where none was measured. lab: room for the image's colours in CIELAB.
npsim::Status smooth(npsim::ImageView<const npsim::Rgb8> image, npsim::ImageView<const std::uint8_t> labels,
                     npsim::ImageView<npsim::Vec3f> lab, npsim::ImageView<float> depth_m) {
  npsim::Workspace workspace(memory, sizeof(memory));
  npsim::SerialExecutor executor;
  NPSIM_RETURN_IF_ERROR(npsim::srgb8_to_lab(image, lab, executor));
  npsim::CrossBilateralResult result;  // which method was chosen, and the error that it keeps
  return npsim::cross_bilateral(filter_params(), depth_m, labels, lab, depth_m, result, workspace, executor);
}

namespace {

constexpr npsim::Shape kSmall{32, 24};  // any shape does that needs no more memory
npsim::Rgb8 image[kSmall.pixels()];
std::uint8_t labels[kSmall.pixels()];
npsim::Vec3f lab[kSmall.pixels()];
float depth_m[kSmall.pixels()];

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2 || std::strcmp(argv[1], NPSIM_VERSION_STRING) != 0) return 1;
  for (float& z : depth_m) z = 7.0F;
  depth_m[100] = 0.0F;  // not measured
  if (!smooth({image, kSmall}, {labels, kSmall}, {lab, kSmall}, {depth_m, kSmall}).ok()) return 2;
  return depth_m[0] > 6.99F && depth_m[0] < 7.01F && depth_m[100] == 0.0F ? 0 : 3;
}
