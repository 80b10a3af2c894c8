// SPDX-License-Identifier: Apache-2.0
// npsim calibrate-noise: beta1 and beta2 of equation (3.10) from raw pictures, for the noise table of a camera file.
//
// Two frames of one scene are compared in squares all over the picture; of one picture, the patches that are named must
// be flat. Raw is .raw with its sidecar, or a PNG of one channel with 8 or 16 bits and the mosaic's filters in it.
#ifndef NPSIM_SAMPLES_LAB_CALIBRATE_COMMAND_HPP
#define NPSIM_SAMPLES_LAB_CALIBRATE_COMMAND_HPP

#include <string>
#include <vector>

namespace npsim::tool {

struct CalibrateOptions {
  std::vector<std::string> pictures;  // one or two
  std::vector<std::string> patches;   // x0,y0,x1,y1 in pixels, the last ones outside
  int square = 32;                    // px
  double black = -1;                  // negative: as the sidecar has it
  double white = -1;
  double iso = 0;       // 0: as the sidecar has it
  double headroom = 0;  // full scale over white of the picture; 0: as the sidecar has it, 1 without one
};

[[nodiscard]] int run_calibrate(const CalibrateOptions& options);  // an exit status

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_CALIBRATE_COMMAND_HPP
