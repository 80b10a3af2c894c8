// SPDX-License-Identifier: Apache-2.0
// Which lamps share the image of what they light by way of other surfaces.
//
// Direct light has an image for each lamp. What surfaces hand on is smooth, so lamps of one group and class that hang
// together (the windows of a floor, the lamps of a car's front, the discs of a traffic light) share one image, made with
// all of them at their strongest; in a night it counts as much as its lamps that are lit shine, of what all could. So do
// the own headlamps, and the street lamps that the picture does not show. Every other lamp is a group of its own. The sky
// is group 0.
// Error: none for a group that is switched as one; else light that comes by two surfaces from one window is shared out
// among the windows of its floor. Energy is kept.
#ifndef NPSIM_PIPELINE_DETAIL_LIGHT_GROUPS_HPP
#define NPSIM_PIPELINE_DETAIL_LIGHT_GROUPS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/light/emitter.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr std::uint32_t kNoGroup = 0xFFFFFFFFU;

struct LightGroups {
  std::size_t count = 1;      // with the sky
  Span<std::uint32_t> group;  // of each emitter; kNoGroup where no variant lights the group
  Span<float> peak_cd;        // the strongest that each emitter could have been drawn, whether it was or not
  Span<float> group_peak_cd;  // sum over the group's emitters; one element more than there are emitters
  // Images: of the groups, then of the emitters.
  [[nodiscard]] std::size_t image_count() const noexcept { return count + group.size(); }
  [[nodiscard]] std::size_t image_of_emitter(std::size_t e) const noexcept { return count + e; }
};

[[nodiscard]] constexpr std::size_t light_groups_bytes(std::size_t emitters) noexcept {
  return allocation_bytes<std::uint32_t>(emitters) + allocation_bytes<float>(emitters) +
         allocation_bytes<float>(emitters + 1);
}

namespace relight_detail {

[[nodiscard]] constexpr bool light_as_one(const Emitter& a, const Emitter& b) noexcept {
  if (is_own_headlamp(a) || is_own_headlamp(b)) return is_own_headlamp(a) && is_own_headlamp(b);
  if (a.unseen != 0 || b.unseen != 0)
    return a.unseen != 0 && b.unseen != 0 && a.cls == b.cls && is_moon(a) == is_moon(b);
  return a.group != 0 && a.group == b.group && a.cls == b.cls;
}

// A group counts whole as soon as any variant lights one of its lamps, so that no variant's bits depend on the others.
[[nodiscard]] inline Status group_lights(const ActivationParams& params, Span<const Emitter> emitters, int variants,
                                         Span<const Activation> activations, Workspace& workspace,
                                         LightGroups& out) noexcept {
  NPSIM_RETURN_IF_ERROR(workspace.allocate(emitters.size(), out.group));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(emitters.size(), out.peak_cd));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(emitters.size() + 1, out.group_peak_cd));
  out.count = 1;
  for (std::size_t e = 0; e < emitters.size(); ++e) {
    out.peak_cd[e] = strongest_intensity_cd(params, emitters[e]);
    out.group[e] = kNoGroup;
  }
  // Light that is certain first: the others are traced as carefully as they matter beside it.
  for (const bool certain : {true, false}) {
    for (std::size_t e = 0; e < emitters.size(); ++e) {
      if ((certain_intensity_cd(params, emitters[e]) > 0.0F) != certain) continue;
      bool first = true;
      for (std::size_t other = 0; other < e && first; ++other) first = !light_as_one(emitters[e], emitters[other]);
      if (!first) continue;
      bool lit = false;
      float sum = 0.0F;
      for (std::size_t member = e; member < emitters.size(); ++member) {
        if (member != e && !light_as_one(emitters[e], emitters[member])) continue;
        sum += out.peak_cd[member];
        for (int v = 0; v < variants; ++v) {
          lit = lit || activations[static_cast<std::size_t>(v) * emitters.size() + member].lit;
        }
      }
      if (!lit || !(sum > 0.0F)) continue;
      for (std::size_t member = e; member < emitters.size(); ++member) {
        if (member == e || light_as_one(emitters[e], emitters[member])) {
          out.group[member] = static_cast<std::uint32_t>(out.count);
        }
      }
      out.group_peak_cd[out.count++] = sum;
    }
  }
  return {};
}

// What each image counts in a night in which emitter e has the peak intensity intensity_cd(e).
template <class Intensity>
void light_weights(const LightGroups& groups, const Intensity& intensity_cd, Span<Vec3f> weights) noexcept {
  for (Vec3f& w : weights) w = Vec3f{};
  weights[0] = {1.0F, 1.0F, 1.0F};
  for (std::size_t e = 0; e < groups.group.size(); ++e) {
    const std::uint32_t g = groups.group[e];
    if (g == kNoGroup || !(groups.peak_cd[e] > 0.0F)) continue;
    const Vec3f intensity = intensity_cd(e);
    weights[groups.image_of_emitter(e)] = intensity / groups.peak_cd[e];
    weights[g] += intensity / groups.group_peak_cd[g];
  }
}

}  // namespace relight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_LIGHT_GROUPS_HPP
