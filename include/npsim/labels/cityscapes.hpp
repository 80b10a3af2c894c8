// SPDX-License-Identifier: Apache-2.0
// The Cityscapes label definition: label ids 0..33, their names, train ids, and the sets that the method needs.
//
// Label planes in this library hold label ids (std::uint8_t). Ids outside 0..33, the licence plate (-1, stored as 255)
// included, count as unlabeled (0).
#ifndef NPSIM_LABELS_CITYSCAPES_HPP
#define NPSIM_LABELS_CITYSCAPES_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "npsim/core/scene_view.hpp"
#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

namespace label {
inline constexpr Label unlabeled = 0, ego_vehicle = 1, rectification_border = 2, out_of_roi = 3, static_object = 4,
                       dynamic_object = 5, ground = 6, road = 7, sidewalk = 8, parking = 9, rail_track = 10,
                       building = 11, wall = 12, fence = 13, guard_rail = 14, bridge = 15, tunnel = 16, pole = 17,
                       polegroup = 18, traffic_light = 19, traffic_sign = 20, vegetation = 21, terrain = 22, sky = 23,
                       person = 24, rider = 25, car = 26, truck = 27, bus = 28, caravan = 29, trailer = 30, train = 31,
                       motorcycle = 32, bicycle = 33;
}  // namespace label

inline constexpr int kLabelCount = 34;
inline constexpr std::uint8_t kIgnoredTrainId = 255;

struct LabelInfo {
  const char* name;
  std::uint8_t train_id;  // kIgnoredTrainId where the benchmark ignores the class
};

inline constexpr std::array<LabelInfo, kLabelCount> kLabels = {{
    {"unlabeled", 255}, {"ego vehicle", 255}, {"rectification border", 255}, {"out of roi", 255}, {"static", 255},
    {"dynamic", 255},   {"ground", 255},      {"road", 0},                   {"sidewalk", 1},     {"parking", 255},
    {"rail track", 255}, {"building", 2},     {"wall", 3},                   {"fence", 4},        {"guard rail", 255},
    {"bridge", 255},    {"tunnel", 255},      {"pole", 5},                   {"polegroup", 255},  {"traffic light", 6},
    {"traffic sign", 7}, {"vegetation", 8},   {"terrain", 9},                {"sky", 10},         {"person", 11},
    {"rider", 12},      {"car", 13},          {"truck", 14},                 {"bus", 15},         {"caravan", 255},
    {"trailer", 255},   {"train", 16},        {"motorcycle", 17},            {"bicycle", 18},
}};

// Label id of a train id; unlabeled for the ignored one and for anything else.
[[nodiscard]] constexpr Label label_from_train_id(std::uint8_t train_id) noexcept {
  if (train_id == kIgnoredTrainId) return label::unlabeled;
  for (int i = 0; i < kLabelCount; ++i) {
    if (kLabels[static_cast<std::size_t>(i)].train_id == train_id) return static_cast<Label>(i);
  }
  return label::unlabeled;
}

// A set of labels as one word; constexpr-friendly and trivially copyable, so that it can be a kernel parameter.
class LabelSet {
 public:
  constexpr LabelSet() noexcept = default;
  template <class... L>
  [[nodiscard]] static constexpr LabelSet of(L... labels) noexcept {
    LabelSet set;
    ((set.bits_ |= std::uint64_t{1} << static_cast<unsigned>(labels)), ...);
    return set;
  }
  [[nodiscard]] static constexpr LabelSet all() noexcept {
    LabelSet set;
    set.bits_ = ~std::uint64_t{0};
    return set;
  }
  [[nodiscard]] constexpr bool contains(Label l) const noexcept { return l < 64 && ((bits_ >> l) & 1U) != 0; }
  [[nodiscard]] constexpr std::uint64_t bits() const noexcept { return bits_; }
  [[nodiscard]] friend constexpr LabelSet operator|(LabelSet a, LabelSet b) noexcept {
    a.bits_ |= b.bits_;
    return a;
  }

 private:
  std::uint64_t bits_ = 0;
};

// Foreground of section 3.4.2: vehicles, persons (and riders), poles, traffic lights and traffic signs.
inline constexpr LabelSet kForegroundLabels =
    LabelSet::of(label::pole, label::polegroup, label::traffic_light, label::traffic_sign, label::person, label::rider,
                 label::car, label::truck, label::bus, label::caravan, label::trailer, label::train, label::motorcycle,
                 label::bicycle);

// What stands before the rest of a scene, which goes on behind it: the foreground, plants, fences, and the small things
// of a street that have no class of their own (posts of advertisements, bins).
inline constexpr LabelSet kStandingLabels =
    kForegroundLabels | LabelSet::of(label::vegetation, label::fence, label::guard_rail, label::static_object,
                                     label::dynamic_object);

inline constexpr LabelSet kVehicleLabels = LabelSet::of(label::car, label::truck, label::bus, label::caravan,
                                                        label::trailer, label::train, label::motorcycle, label::bicycle);

inline constexpr LabelSet kPoleLabels = LabelSet::of(label::pole, label::polegroup);

// What hangs on poles.
inline constexpr LabelSet kSignLabels = LabelSet::of(label::traffic_light, label::traffic_sign);

// What one walks or drives on.
inline constexpr LabelSet kGroundLabels =
    LabelSet::of(label::road, label::sidewalk, label::parking, label::ground, label::rail_track, label::terrain);

// What goes on upright behind the things that stand before it.
inline constexpr LabelSet kHouseLabels = LabelSet::of(label::building, label::wall);

// Labels that bound no surface of the scene: the sky, and what belongs to the camera rather than to the street.
inline constexpr LabelSet kNoSurfaceLabels =
    LabelSet::of(label::sky, label::ego_vehicle, label::rectification_border, label::out_of_roi);

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LABELS_CITYSCAPES_HPP
