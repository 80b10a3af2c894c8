// SPDX-License-Identifier: Apache-2.0
// How a photograph is annotated: the label of a pixel, and the marks of the lamps in it.
//
// What the numbers mean stands in labels/: cityscapes.hpp for labels, light_classes.hpp for lamps.
#ifndef NPSIM_CORE_ANNOTATION_HPP
#define NPSIM_CORE_ANNOTATION_HPP

#include <cstdint>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

using Label = std::uint8_t;  // a Cityscapes label id

// The classes of table 3.1 by their numbers there: twelve kinds of source, nine kinds of group.
enum class LightClass : std::uint8_t {
  none = 0,
  window_building, window_parked, parked_front, parked_rear, moving_front, moving_rear, window_transport,
  street_light_ht, street_light_lt, advertisement, clock, inferred_object,
  windows_group, car_group, truck_group, bus_group, bicycle_group, motorcycle_group, train_group,
  traffic_light_group, traffic_sign_group
};

// What a signal shows by day, where the annotator wrote it down; otherwise it is inferred from the daytime colour.
enum class SignalState : std::uint8_t { unknown, red, amber, green };

// One annotated object. A light-index plane (std::uint16_t) refers to marks by position + 1; 0 is "no light".
struct LightMark {
  std::uint32_t id = 0;        // as in the file
  LightClass cls = LightClass::none;
  SignalState state = SignalState::unknown;
  std::uint16_t group = 0;     // position + 1 of the group's mark; 0 where the source stands alone
};

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_ANNOTATION_HPP
