// SPDX-License-Identifier: Apache-2.0
// Placed lamps against the true ones, class by class.
//
// A lamp and its truth share a mark. Judged are those that the photograph shows: no reconstruction knows of the others.
// Areas are those of an Emitter: of the faces for lit surfaces, half of them where they go all round, and of what the
// camera sees of them for lamps.
#ifndef NPSIM_SAMPLES_LAB_LAMP_EVALUATION_HPP
#define NPSIM_SAMPLES_LAB_LAMP_EVALUATION_HPP

#include <cstddef>
#include <string>
#include <vector>

#include "npsim/core/scene_view.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/light/placement.hpp"
#include "tool/figures.hpp"

namespace npsim::tool {

struct Quartiles {
  double low = kNone, median = kNone, high = kNone;
};

struct LampClassErrors {
  LightClass cls = LightClass::none;
  std::size_t marked = 0;  // with a truth
  std::size_t placed = 0;
  Quartiles distance_m;  // between the centres
  Quartiles range;       // distance from the camera over the true one
  Quartiles height_m;    // above the true one, along the estimated upward direction
  Quartiles axis_deg;    // to the true one: of a vehicle's lamp its heading, of a surface its normal
  Quartiles area;        // over the true one
};

struct LampErrors {
  std::string key;  // depth that they were placed by
  std::vector<LampClassErrors> classes;
};

// The lamps as the renderer places them.
[[nodiscard]] Status placed_lamps(const PlacementParams& params, const SceneView& scene, const RefinedDepth& refined,
                                  std::vector<Emitter>& out);

[[nodiscard]] std::vector<LampClassErrors> lamp_errors(Span<const LightMark> marks, Span<const Emitter> placed,
                                                       Span<const io::TrueEmitter> truth, const Vec3f& up);

[[nodiscard]] OrderedJson to_json(const LampErrors& errors);
void print_table(const LampErrors& errors);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_LAMP_EVALUATION_HPP
