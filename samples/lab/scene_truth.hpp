// SPDX-License-Identifier: Apache-2.0
// A scene with the truth that its scene.json names, both at the size that is wanted.
#ifndef NPSIM_SAMPLES_LAB_SCENE_TRUTH_HPP
#define NPSIM_SAMPLES_LAB_SCENE_TRUTH_HPP

#include <string>
#include <utility>
#include <vector>

#include "mesh_truth.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/light/emitter.hpp"

namespace npsim::tool {

struct Truth {
  io::Image<float> depth;
  io::Image<Vec3f> normals;           // this and all that follow may be empty
  io::Image<float> background_depth;  // behind the foreground
  io::Image<Vec3f> albedo;            // linear
  MeshTruth mesh;
  std::vector<io::TrueEmitter> emitters;
};

// What a night is judged by; all of the scene's size.
struct TrueNight {
  io::Image<Vec3f> luminance;  // linear RGB, luminance() in cd/m2, lamps and sky included
  std::vector<Emitter> lamps;  // all of them, those of the own car included
  GroundPlane ground;
};

// at_size: WIDTHxHEIGHT, or empty. output: a file that is going to be written, which must not be one of the scene's; or
// empty.
[[nodiscard]] io::Expected<std::pair<io::Scene, Truth>> load_with_truth(const std::string& folder,
                                                                        const std::string& at_size,
                                                                        const std::string& output);

// The true night of a scene as `npsim truth` wrote it, with the true lamps.
[[nodiscard]] io::Expected<TrueNight> read_true_night(const io::Scene& scene, const std::string& pfm);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_SCENE_TRUTH_HPP
