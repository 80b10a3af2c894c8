// SPDX-License-Identifier: Apache-2.0
// The true lamps of a generated street, as the renderer takes lamps: in place of those that placement finds.
//
// One emitter per annotated lamp, and the two of the car that carries the camera: true place, axes, luminous area and
// mounting height, profile by class as in light/placement.hpp. A lamp's faces are one patch of their area about their
// centre; of those that surround a volume (a lantern, the windows of a car) a quarter counts, the mean share that is
// seen. The patch of a surface stands off it by kLampOffset, as placed ones do, so that a mesh does not shade it.
// Needs truth.emitters and truth.ground of scene.json.
#ifndef NPSIM_SAMPLES_LAB_TRUE_LAMPS_HPP
#define NPSIM_SAMPLES_LAB_TRUE_LAMPS_HPP

#include <cstdint>
#include <vector>

#include "npsim/geometry/ground.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/light/photometry.hpp"

namespace npsim::tool {

inline constexpr float kLampOffset = 0.02F;  // m

struct TrueLamps {
  // In the order of Emitter::mark (position + 1 in scene.lights); then own lamps, then street lamps outside
  // the picture, of classes that are marked in it.
  std::vector<Emitter> emitters;
  std::vector<std::uint32_t> faces_of;  // per emitter the id that its faces carry (TrueMesh::face_emitter); 0: own lamp
  GroundPlane ground;
  std::uint16_t unseen = 0;  // number of the last ones
};

[[nodiscard]] io::Expected<TrueLamps> read_true_lamps(const io::Scene& scene);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_TRUE_LAMPS_HPP
