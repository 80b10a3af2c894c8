// SPDX-License-Identifier: Apache-2.0
// A night that `npsim night` drew, on the true street: what the reference path tracer (tests/reference) needs.
//
// Lamps are those of the night's sources, each with its true shape, axes and the strength that was drawn for it. Where
// that strength followed the height at which a street lamp was placed, it is taken to its true height. The materials of
// the points that pixels show are those of the scene's planes, of all others those of the true mesh.
#ifndef NPSIM_SAMPLES_LAB_TRUTH_NIGHT_HPP
#define NPSIM_SAMPLES_LAB_TRUTH_NIGHT_HPP

#include <cstdint>
#include <string>
#include <vector>

#include "any.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/scene.hpp"
#include "reference/path_tracer.hpp"

namespace npsim::tool {

struct TruthNight {
  Shape shape;
  reference::NightScene scene;
  reference::TriangleTree tree;
  std::vector<reference::ViewedPoint> seen;  // per pixel
  std::vector<Vec3d> emitted;                // per pixel: of the lamp that it shows, cd/m2
  std::vector<Vec3d> sky;                    // per pixel: where it shows nothing else
};

[[nodiscard]] io::Expected<TruthNight> make_truth_night(const io::Scene& scene, const std::string& night_json);

// Of everything that the result depends on but the number of samples: equal numbers, equal nights.
[[nodiscard]] std::uint64_t fingerprint(const TruthNight& night, const reference::PathParams& params);

// Sums over the samples of each pixel; `samples` of them are in it.
struct TruthSums {
  std::uint64_t samples = 0;
  std::vector<reference::PixelSums> pixels;
};

class TruthTracer {
 public:
  // The night has to outlive it.
  TruthTracer(const TruthNight& night, const reference::PathParams& params)
      : night_(night), tracer_(params, night.scene, night.tree) {}

  // Adds samples up to `last` to the sums. False where `observer` was cancelled: they are as before then.
  [[nodiscard]] bool add(std::uint64_t last, TruthSums& sums, AnyExecutor executor, AnyObserver observer) const;

 private:
  const TruthNight& night_;
  reference::PathTracer<reference::TriangleTree> tracer_;
};

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_TRUTH_NIGHT_HPP
