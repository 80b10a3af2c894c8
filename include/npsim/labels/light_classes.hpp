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
#include "npsim/core/scene_view.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LABELS_LIGHT_CLASSES_HPP
