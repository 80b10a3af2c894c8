// SPDX-License-Identifier: Apache-2.0
// A user of the installed library, with the example of docs/embedding.md. Fails unless the headers are those of the
// version named on the command line and the example works.
#include <cstring>

#include "npsim/npsim.hpp"

namespace {

constexpr npsim::Shape kShape{640, 480};
alignas(npsim::kWorkspaceAlignment) unsigned char memory[npsim::fill_workspace_bytes({}, kShape)];

// Depth with holes in, depth without holes out.
npsim::Status fill(npsim::ImageView<const float> measured_m, npsim::ImageView<float> depth_m) {
  npsim::Workspace workspace(memory, sizeof(memory));
  npsim::SerialExecutor executor;
  const npsim::FillParams params;  // or your own
  // parameters, inputs, outputs, workspace, executor; a view left empty is an input or output that is not wanted
  return npsim::fill_depth(params, measured_m, {}, depth_m, {}, workspace, executor);
}

float measured_m[kShape.pixels()];
float depth_m[kShape.pixels()];

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2 || std::strcmp(argv[1], NPSIM_VERSION_STRING) != 0) return 1;
  measured_m[1000] = 7.0F;  // all that was measured
  if (!fill({measured_m, kShape}, {depth_m, kShape}).ok()) return 2;
  return depth_m[0] > 6.9F && depth_m[0] < 7.1F ? 0 : 3;
}
