// SPDX-License-Identifier: Apache-2.0
// What night_NNN.json calls the profiles of lamps and the units of their strengths.
#ifndef NPSIM_SAMPLES_TOOL_LAMP_NAMES_HPP
#define NPSIM_SAMPLES_TOOL_LAMP_NAMES_HPP

#include "npsim/light/emitter.hpp"
#include "npsim/light/photometry.hpp"

namespace npsim::tool {

[[nodiscard]] inline const char* profile_name(EmissionProfile profile) {
  switch (profile) {
    case EmissionProfile::street_luminaire: return "street_luminaire";
    case EmissionProfile::hung_luminaire: return "hung_luminaire";
    case EmissionProfile::lantern: return "lantern";
    case EmissionProfile::low_beam: return "low_beam";
    case EmissionProfile::low_beam_left: return "low_beam_left";
    case EmissionProfile::high_beam: return "high_beam";
    case EmissionProfile::signal: return "signal";
    case EmissionProfile::measured: return "measured";
    case EmissionProfile::lambert: break;
  }
  return "lambert";
}

[[nodiscard]] inline const char* unit_name(StrengthUnit unit) {
  switch (unit) {
    case StrengthUnit::lumen: return "lm";
    case StrengthUnit::candela: return "cd";
    case StrengthUnit::candela_per_m2: break;
  }
  return "cd/m2";
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_LAMP_NAMES_HPP
