// SPDX-License-Identifier: Apache-2.0
// Which lamps share the image of what they light by way of other surfaces.
//
// Direct light has an image for each lamp. What surfaces hand on is smooth, so lamps of one group and class that hang
// together (the windows of a floor, the lamps of a car's front, the discs of a traffic light) share one image, made
// with all of them at their strongest; in a night it counts as much as its lamps that are lit shine, of what all could.
// So do the own headlamps, and the street lamps that the picture does not show. Every other lamp is a group of its own.
// The sky is group 0. Groups that at their strongest bring less than kSmallShare of the light that other lamps (of
// streets, and what shines by day) are certain to bring are one group together.
// Error: none for a group that is switched as one; else light that comes by two surfaces from one window is shared out
// among the windows of its floor, or among all of them beside such lamps. Energy is kept.
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
#include "npsim/light/photometry.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr std::uint32_t kNoGroup = 0xFFFFFFFFU;
inline constexpr float kSmallShare = 0.01F;  // of the luminous flux that is certain

struct LightGroups {
  std::size_t count = 1;      // with the sky
  Span<std::uint32_t> group;  // of each emitter; kNoGroup where no variant lights the group
  Span<float> peak_cd;        // the strongest that each emitter could have been drawn, whether it was or not
  Span<float> group_peak_cd;  // sum over the group's emitters; one element more than there are emitters
  Span<std::uint8_t> shines;  // of each emitter, whether a variant lights it
  // Images: of the groups, then of the emitters.
  [[nodiscard]] std::size_t image_count() const noexcept { return count + group.size(); }
  [[nodiscard]] std::size_t image_of_emitter(std::size_t e) const noexcept { return count + e; }
};

[[nodiscard]] constexpr std::size_t light_groups_bytes(std::size_t emitters) noexcept {
  return 2 * allocation_bytes<std::uint32_t>(emitters) + 2 * allocation_bytes<float>(emitters) +
         allocation_bytes<float>(emitters + 1) + allocation_bytes<std::uint8_t>(emitters);
}

namespace relight_detail {

[[nodiscard]] constexpr bool light_as_one(const Emitter& a, const Emitter& b) noexcept {
  if (is_own_headlamp(a) || is_own_headlamp(b)) return is_own_headlamp(a) && is_own_headlamp(b);
  if (a.unseen != 0 || b.unseen != 0)
    return a.unseen != 0 && b.unseen != 0 && a.cls == b.cls && is_moon(a) == is_moon(b);
  return a.group != 0 && a.group == b.group && a.cls == b.cls;
}

[[nodiscard]] inline float flux_lm(const Emitter& e, float peak_cd) noexcept {
  if (is_moon(e)) return 0.0F;  // the sun's, if it were counted
  return peak_cd * flux_sr(e);
}

// A group counts whole as soon as any variant lights one of its lamps, so that no variant's bits depend on the others.
[[nodiscard]] inline Status group_lights(const ActivationParams& params, Span<const Emitter> emitters, int variants,
                                         Span<const Activation> activations, Workspace& workspace,
                                         LightGroups& out) noexcept {
  const std::size_t count = emitters.size();
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, out.group));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, out.peak_cd));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count + 1, out.group_peak_cd));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, out.shines));
  const WorkspaceScope scope(workspace);
  Span<std::uint32_t> foremost;  // of the lamps that light as one with each
  Span<float> together_lm;       // of all lamps that light as one with a foremost lamp, at their strongest
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, foremost));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, together_lm));
  float certain_lm = 0.0F;
  for (std::size_t e = 0; e < count; ++e) {
    out.peak_cd[e] = strongest_intensity_cd(params, emitters[e]);
    out.group[e] = kNoGroup;
    out.shines[e] = 0;
    for (int v = 0; v < variants; ++v) {
      if (activations[static_cast<std::size_t>(v) * count + e].lit) out.shines[e] = 1;
    }
    foremost[e] = 0;
    while (foremost[e] < e && !light_as_one(emitters[e], emitters[foremost[e]])) ++foremost[e];
    together_lm[e] = 0.0F;
    together_lm[foremost[e]] += flux_lm(emitters[e], out.peak_cd[e]);
    if (!is_own_headlamp(emitters[e])) certain_lm += flux_lm(emitters[e], certain_intensity_cd(params, emitters[e]));
  }
  // Becomes a group if it is lit: all lamps for which is_member(e).
  out.count = 1;
  const auto add_group = [&](const auto& is_member) {
    bool lit = false;
    float sum = 0.0F;
    for (std::size_t e = 0; e < count; ++e) {
      if (!is_member(e)) continue;
      lit = lit || out.shines[e] != 0;
      sum += out.peak_cd[e];
    }
    if (!lit || !(sum > 0.0F)) return;
    for (std::size_t e = 0; e < count; ++e) {
      if (is_member(e)) out.group[e] = static_cast<std::uint32_t>(out.count);
    }
    out.group_peak_cd[out.count++] = sum;
  };
  const auto is_certain = [&](std::size_t e) { return certain_intensity_cd(params, emitters[e]) > 0.0F; };
  const auto is_small = [&](std::size_t first) {
    const Emitter& e = emitters[first];
    return together_lm[first] < kSmallShare * certain_lm && !is_own_headlamp(e) && !is_moon(e);
  };
  // Light that is certain first: the others are traced as carefully as they matter beside it.
  for (const bool certain : {true, false}) {
    for (std::size_t e = 0; e < count; ++e) {
      if (foremost[e] != e || is_certain(e) != certain || is_small(e)) continue;
      add_group([&](std::size_t member) { return foremost[member] == e; });
    }
  }
  add_group([&](std::size_t member) { return is_small(foremost[member]); });
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
