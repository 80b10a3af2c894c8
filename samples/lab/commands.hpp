// SPDX-License-Identifier: Apache-2.0
// The commands of npsim-lab, which npsim hands on to it.
#ifndef NPSIM_SAMPLES_LAB_COMMANDS_HPP
#define NPSIM_SAMPLES_LAB_COMMANDS_HPP

namespace npsim::tool {

struct LabCommand {
  const char* name;
  const char* about;
};

inline constexpr LabCommand kLabCommands[] = {
    {"evaluate", "Judge the depth, as given and after each step, and the mesh by the scene's ground truth"},
    {"judge", "Judge every stage by the true night of generated streets; what the folder has already is kept"},
    {"truth", "Compute the true night of a generated street, with the lamps that a night lit"},
    {"stats", "Say how bright, how dark, of which colour and how noisy night pictures are, beside real nights"},
    {"greycard", "Measure {s, r/g, b/g} of the light on a grey card, for the light set of night --lights"},
    {"calibrate-noise", "Measure beta1 and beta2 of a camera's noise, of two frames or of flat patches of one"},
};

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_COMMANDS_HPP
