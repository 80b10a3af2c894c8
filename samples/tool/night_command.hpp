// SPDX-License-Identifier: Apache-2.0
// npsim night: runs the whole method on a scene and writes everything it made.
#ifndef NPSIM_SAMPLES_TOOL_NIGHT_COMMAND_HPP
#define NPSIM_SAMPLES_TOOL_NIGHT_COMMAND_HPP

#include <cstdint>
#include <string>

#include "npsim/render/gather.hpp"

namespace npsim::tool {

struct NightOptions {
  std::string scene;
  std::string output;
  int variants = 1;
  std::uint64_t seed = 0;
  std::string preset = "default";
  int threads = 0;
  std::string size;
  std::string work_size;  // of depth, mesh and light; empty: at most kMostWorkPixels
  std::string light_set;
  int rays = GatherParams{}.rays;  // of each pixel, for indirect light
  float error = 0.0F;              // relative noise to be reached in place of that effort; 0: effort decides
  float wet = 0.0F;                // share of the ground under a film of water
  std::string texture = "photograph";
  std::string unseen_lamps;      // continued, dark; empty: as the preset has it
  float assume_lamps_m = 0.0F;   // width of a road without marked street lamps that gets a row of them; 0: none does
  float unseen_street = -1.0F;   // share of its light; negative: as the preset has it
  std::string moon;              // "azimuth,elevation" in degrees, the first to the right of the camera; empty: none
  std::string headlamps;         // empty: as the preset has it
  float following_car_m = 0.0F;  // behind the camera; 0: none follows
  std::string traffic = "right";
  float mesh_error = -1.0F;  // relative, of depth; 0: not simplified; negative: as the preset has it
  // Of the camera; what is empty or negative is as the camera has it.
  std::string camera;  // preset or file; empty: action-camera, of the preset thesis thesis
  float iso = -1.0F;
  float exposure_s = -1.0F;
  float f_number = -1.0F;
  float ev = 0.0F;
  std::string meter;
  bool labels = false;
  float least_snr = 1.0F;  // of pixels that are not indiscernible
  float speed_m_s = 0.0F;  // ahead; 0: as the camera has it, which is at rest unless a file says otherwise
  float yaw_rate = 0.0F;   // rad/s, to the right
  bool flicker = false;
  bool raw = false;
  int jpeg = 0;  // quality; 0: none
  bool quiet = false;
};

[[nodiscard]] int run_night(const NightOptions& options);  // an exit status

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_NIGHT_COMMAND_HPP
