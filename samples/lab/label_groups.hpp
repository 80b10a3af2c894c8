// SPDX-License-Identifier: Apache-2.0
// Groups of labels by which depth and normals are judged.
#ifndef NPSIM_SAMPLES_LAB_LABEL_GROUPS_HPP
#define NPSIM_SAMPLES_LAB_LABEL_GROUPS_HPP

#include <array>
#include <cstddef>

#include "npsim/core/image_view.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim::tool {

struct LabelGroup {
  const char* name;
  LabelSet labels;
};

// The first holds everything.
inline constexpr std::array<LabelGroup, 8> kLabelGroups = {{
    {"all", LabelSet::all()},
    {"ground",
     LabelSet::of(label::ground, label::road, label::sidewalk, label::parking, label::rail_track, label::terrain)},
    {"facades", LabelSet::of(label::building, label::wall, label::bridge, label::tunnel)},
    {"fences", LabelSet::of(label::fence, label::guard_rail)},
    {"plants", LabelSet::of(label::vegetation)},
    {"vehicles", kVehicleLabels},
    {"persons", LabelSet::of(label::person, label::rider)},
    {"thin", kPoleLabels | kSignLabels},
}};

// Without labels a pixel is in the first alone.
[[nodiscard]] inline bool in_group(ImageView<const Label> labels, std::size_t group, int x, int y) {
  return group == 0 || (!labels.empty() && kLabelGroups[group].labels.contains(labels(x, y)));
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_LABEL_GROUPS_HPP
