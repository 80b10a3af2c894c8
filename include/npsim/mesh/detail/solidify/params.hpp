// SPDX-License-Identifier: Apache-2.0
// How thick things are that a photograph shows from one side only: one rule per label, in metres.
//
// Cost and memory: none. Error: these are typical sizes; a thing of another size is wrong by the difference.
#ifndef NPSIM_MESH_DETAIL_SOLIDIFY_PARAMS_HPP
#define NPSIM_MESH_DETAIL_SOLIDIFY_PARAMS_HPP

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/status.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

enum class BackShape : std::uint8_t {
  plate,  // thickness length_m everywhere
  round,  // as thick as wide where the pixel is (the shorter of its runs along row and column), length_m at most
  soft,   // as round, but tapering to nothing towards the rim as an ellipse does; runs count to length_m either way
  box     // the far sides of an upright box, length_m x width_m, that stands where the visible sides stand
};

struct BackRule {
  BackShape shape = BackShape::round;
  float length_m = 0.5F;
  float width_m = 0.0F;  // of a box
  // Above this height the far end and the far side of a box lie nearer, as those of a car's cabin do. 0: they do not.
  float belt_m = 0.0F;
  float cabin_end_m = 0.0F;
  float cabin_side_m = 0.0F;
};

struct SolidifyParams {
  // Typical sizes. Cars: mean length of new cars in Europe 4.4 to 4.5 m, width without mirrors 1.8 m (ICCT European
  // vehicle market statistics); windows from 1 m up, the roof 0.9 m shorter at the far end, which is bonnet as often as
  // boot, and 0.2 m narrower on a side. Buses: 12 m x 2.55 m, the commonest city bus, at the width limit of EU
  // directive 96/53; trucks in towns are shorter than that directive's 12 m: 8 m x 2.5 m. A car of a tram or
  // train: 2.65 m wide, of which a street scene shows about 25 m. Motorcycle 2.1 m x 0.7 m, bicycle 1.8 m long and,
  // being mostly air beside its handlebars, 0.3 m wide. Persons: shoulder breadth 0.4 to 0.5 m, depth 0.25 to 0.3 m
  // (ISO 7250), so 0.4 m from an unknown side, and limbs as thick as wide. Signs are sheets on a 3 cm frame. A pole is
  // round; 0.6 m bounds advertising columns and the heads of lamps.
  std::array<BackRule, kLabelCount> rules = [] {
    std::array<BackRule, kLabelCount> r{};
    r[label::car] = {BackShape::box, 4.5F, 1.8F, 1.0F, 0.9F, 0.2F};
    r[label::truck] = {BackShape::box, 8.0F, 2.5F};
    r[label::bus] = {BackShape::box, 12.0F, 2.55F};
    r[label::caravan] = {BackShape::box, 6.0F, 2.3F};
    r[label::trailer] = {BackShape::box, 4.0F, 2.0F};
    r[label::train] = {BackShape::box, 25.0F, 2.65F};
    r[label::motorcycle] = {BackShape::box, 2.1F, 0.7F};
    r[label::bicycle] = {BackShape::box, 1.8F, 0.3F};
    r[label::person] = r[label::rider] = {BackShape::round, 0.4F, 0.0F};
    r[label::pole] = r[label::polegroup] = {BackShape::round, 0.6F, 0.0F};
    r[label::traffic_light] = {BackShape::round, 0.35F, 0.0F};
    r[label::traffic_sign] = {BackShape::plate, 0.03F, 0.0F};
    r[label::vegetation] = {BackShape::soft, 3.0F, 0.0F};
    r[label::terrain] = {BackShape::soft, 1.0F, 0.0F};
    return r;
  }();
  float min_relative = 1e-3F;    // a back lies at least this share of the depth behind its front
  float background_gap = 5e-3F;  // and ends this share of its depth before the background of its pixel
  float ground_gap_m = 0.02F;    // and this far above the ground plane
  float outlier_share = 0.01F;   // of a vehicle's vertices at either end of an extent, taken for errors of depth
  float full_side = 0.85F;       // a side seen over this share of its nominal size is taken to be all of it
  float street_weight = 0.05F;   // of the prior that vehicles stand along or across the street, see solidify_box.hpp
};

[[nodiscard]] inline Status validate(const SolidifyParams& p) noexcept {
  bool good = p.min_relative >= 1e-5F && p.min_relative <= 0.5F && p.background_gap >= 0.0F &&
              p.background_gap < 1.0F && p.ground_gap_m >= 0.0F && std::isfinite(p.ground_gap_m) &&
              p.outlier_share >= 0.0F && p.outlier_share < 0.5F && p.full_side > 0.0F && p.full_side <= 1.0F &&
              p.street_weight >= 0.0F && p.street_weight <= 1.0F;
  for (const BackRule& r : p.rules) {
    good = good && r.length_m >= 0.0F && r.length_m <= 1e3F && r.width_m >= 0.0F && r.width_m <= 1e3F &&
           r.belt_m >= 0.0F && r.belt_m <= 1e3F && r.cabin_end_m >= 0.0F && r.cabin_end_m <= 1e3F &&
           r.cabin_side_m >= 0.0F && r.cabin_side_m <= 1e3F &&
           (r.shape != BackShape::box || (r.width_m > 0.0F && r.length_m >= r.width_m));
  }
  return good ? Status() : Status(StatusCode::invalid_argument, "solidify: a parameter lies outside its range");
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_SOLIDIFY_PARAMS_HPP
