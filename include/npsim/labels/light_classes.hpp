// SPDX-License-Identifier: Apache-2.0
// The 21 inactive-light-source classes of table 3.1: twelve kinds of source and nine kinds of group.
//
// Numbers are those of the table (1..21); 0 means none. A mark is one annotated object; marks that name the same group
// share one activation parameter (section 3.6.2).
#ifndef NPSIM_LABELS_LIGHT_CLASSES_HPP
#define NPSIM_LABELS_LIGHT_CLASSES_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace v1 {

enum class LightClass : std::uint8_t {
  none = 0,
  window_building, window_parked, parked_front, parked_rear, moving_front, moving_rear, window_transport,
  street_light_ht, street_light_lt, advertisement, clock, inferred_object,
  windows_group, car_group, truck_group, bus_group, bicycle_group, motorcycle_group, train_group,
  traffic_light_group, traffic_sign_group
};

enum class LightCategory : std::uint8_t { none, building, vehicle, object, group };

inline constexpr int kLightClassCount = 22;  // with none

struct LightClassInfo {
  const char* name;  // as written in annotation files
  LightCategory category;
};

inline constexpr std::array<LightClassInfo, kLightClassCount> kLightClasses = {{
    {"none", LightCategory::none},
    {"window_building", LightCategory::building},
    {"window_parked", LightCategory::vehicle},
    {"parked_front", LightCategory::vehicle},
    {"parked_rear", LightCategory::vehicle},
    {"moving_front", LightCategory::vehicle},
    {"moving_rear", LightCategory::vehicle},
    {"window_transport", LightCategory::vehicle},
    {"street_light_HT", LightCategory::object},
    {"street_light_LT", LightCategory::object},
    {"advertisement", LightCategory::object},
    {"clock", LightCategory::object},
    {"inferred object", LightCategory::object},
    {"windows_group", LightCategory::group},
    {"car_group", LightCategory::group},
    {"truck_group", LightCategory::group},
    {"bus_group", LightCategory::group},
    {"bicycle_group", LightCategory::group},
    {"motorcycle_group", LightCategory::group},
    {"train_group", LightCategory::group},
    {"traffic_light_group", LightCategory::group},
    {"traffic_sign_group", LightCategory::group},
}};

[[nodiscard]] constexpr const LightClassInfo& info(LightClass c) noexcept {
  return kLightClasses[static_cast<std::size_t>(c)];
}
[[nodiscard]] constexpr bool is_group(LightClass c) noexcept { return info(c).category == LightCategory::group; }

// What a signal shows by day, where the annotator wrote it down; otherwise it is inferred from the daytime colour.
enum class SignalState : std::uint8_t { unknown, red, amber, green };

// One annotated object. A light-index plane (std::uint16_t) refers to marks by position + 1; 0 is "no light".
struct LightMark {
  std::uint32_t id = 0;        // as in the file
  LightClass cls = LightClass::none;
  SignalState state = SignalState::unknown;
  std::uint16_t group = 0;     // position + 1 of the group's mark; 0 where the source stands alone
};

}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_LABELS_LIGHT_CLASSES_HPP
