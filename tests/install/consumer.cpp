// SPDX-License-Identifier: Apache-2.0
// A user of the installed library: fails unless the headers are those of the version named on the command line.
#include <cstring>

#include "npsim/npsim.hpp"

int main(int argc, char** argv) {
  if (argc != 2 || std::strcmp(argv[1], NPSIM_VERSION_STRING) != 0) return 1;
  const npsim::Intrinsics camera = npsim::intrinsics_from_fov({640, 480}, 1.0F);
  return npsim::validate(camera).ok() ? 0 : 1;
}
