// SPDX-License-Identifier: Apache-2.0
// What the surfaces of a street are like, by Cityscapes label: median albedo (of luminance) and GGX roughness.
//
// Albedo: asphalt new .07-.08, aged .12-.15; concrete .14-.20; soil .22; grass .21 (broadband; the visible part of
// leaves reflects about .1). The others, and all of roughness, are plausible defaults [default]: dry asphalt .8-1,
// clear coat .05-.1, other painted things .1-.4; leaves, blades, fibres and spokes make no common interface at all. A
// photograph shows relative albedo only; the prior sets its scale per class.
#ifndef NPSIM_MATERIAL_DETAIL_CLASS_PRIORS_HPP
#define NPSIM_MATERIAL_DETAIL_CLASS_PRIORS_HPP

#include <array>

#include "npsim/core/config.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/material/bsdf.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct SurfacePrior {
  float albedo = 0.2F;  // median luminance of the albedo, linear
  float alpha = 0.6F;   // GGX, or kMatt
};

inline constexpr std::array<SurfacePrior, kLabelCount> kSurfacePriors = {{
    {0.20F, 0.60F},  // unlabeled
    {0.10F, 0.40F},  // ego vehicle
    {0.20F, 0.60F},  // rectification border
    {0.20F, 0.60F},  // out of roi
    {0.25F, 0.50F},  // static
    {0.25F, 0.50F},  // dynamic
    {0.17F, 0.90F},  // ground
    {0.10F, 0.85F},  // road: between new and aged asphalt, polished by tyres
    {0.17F, 0.90F},  // sidewalk: concrete
    {0.13F, 0.85F},  // parking
    {0.15F, 0.80F},  // rail track
    {0.27F, 0.70F},  // building: plaster and brick, with window panes
    {0.25F, 0.80F},  // wall
    {0.20F, 0.60F},  // fence
    {0.35F, 0.40F},  // guard rail: zinc
    {0.20F, 0.80F},  // bridge
    {0.20F, 0.80F},  // tunnel
    {0.25F, 0.40F},  // pole
    {0.25F, 0.40F},  // polegroup
    {0.08F, 0.40F},  // traffic light: dark housing
    {0.40F, 0.35F},  // traffic sign
    {0.08F, kMatt},  // vegetation: leaves in visible light, with the gaps between them that a solid skin lacks
    {0.19F, kMatt},  // terrain: soil and grass
    {0.20F, 1.00F},  // sky: no surface
    {0.20F, kMatt},  // person: cloth
    {0.20F, kMatt},  // rider
    {0.20F, 0.10F},  // car: paint under clear coat, and panes
    {0.25F, 0.12F},  // truck
    {0.30F, 0.10F},  // bus
    {0.40F, 0.15F},  // caravan
    {0.25F, 0.20F},  // trailer
    {0.30F, 0.12F},  // train
    {0.12F, 0.45F},  // motorcycle: in part like a bicycle
    {0.15F, kMatt},  // bicycle: tubes, and gaps between them that its outline takes for one skin
}};

// Ids outside the definition count as unlabeled.
[[nodiscard]] constexpr const SurfacePrior& surface_prior(Label l) noexcept {
  return kSurfacePriors[l < kLabelCount ? l : label::unlabeled];
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_CLASS_PRIORS_HPP
