// SPDX-License-Identifier: Apache-2.0
#include "flatness.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "evaluate_command.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/pipeline/night.hpp"
#include "tool/console.hpp"
#include "tool/engine.hpp"
#include "tool/loading.hpp"
#include "tool/options.hpp"

namespace npsim::tool {
namespace {

constexpr float kDegree_rad = 0.017453293F;

void print_planes(const RefinedDepth& refined) {
  std::vector<PlanarSegment> planes(refined.planes.segments.begin(), refined.planes.segments.end());
  planes.erase(std::remove_if(planes.begin(), planes.end(), [](const PlanarSegment& s) { return !(s.support_px > 0); }),
               planes.end());
  std::sort(planes.begin(), planes.end(),
            [](const PlanarSegment& a, const PlanarSegment& b) { return a.support_px > b.support_px; });
  std::size_t facade = 0;
  std::size_t on_plane = 0;
  for (int y = 0; y < refined.labels.height(); ++y) {
    for (int x = 0; x < refined.labels.width(); ++x) {
      if (refined.labels(x, y) != label::building || refined.normals(x, y) == Vec3f{}) continue;
      ++facade;
      on_plane += refined.planes.at(x, y) != nullptr ? 1U : 0U;
    }
  }
  std::printf("planes        %zu, with %.1f %% of the facades; the largest:\n", planes.size(),
              facade > 0 ? 100.0 * static_cast<double>(on_plane) / static_cast<double>(facade) : 0.0);
  std::printf("%12s %12s %14s %16s  %s\n", "distance m", "support px", "residual, sd", "angle known to", "class");
  for (std::size_t i = 0; i < std::min<std::size_t>(planes.size(), 12); ++i) {
    const PlanarSegment& s = planes[i];
    std::printf("%12.2f %12.0f %14.2f %15.1f%s  %s\n", static_cast<double>(1.0F / length(s.q)),
                static_cast<double>(s.support_px), static_cast<double>(s.residual),
                static_cast<double>(s.turn_rad / kDegree_rad), s.squared ? "*" : " ", kLabels[s.label].name);
  }
  std::printf("  * the street's own angle, or at right angles to it, was taken\n");
}

}  // namespace

Flatness flatness(const FlatnessParams& params, ImageView<const Vec3f> normals, ImageView<const Label> labels) {
  const int apart =
      std::max(1, static_cast<int>(std::lround(params.distance_px * static_cast<double>(normals.width()) / 2048)));
  const float least = std::cos(params.angle_deg * kDegree_rad);
  const auto counts = [&](int x, int y) {
    return normals.contains(x, y) && normals(x, y) != Vec3f{} && (labels.empty() || labels(x, y) == params.label);
  };
  Flatness out;
  for (int y = 0; y < normals.height(); ++y) {
    for (int x = 0; x < normals.width(); ++x) {
      if (!counts(x, y)) continue;
      const auto compare = [&](int i, int j) {
        if (!counts(i, j)) return;
        ++out.pairs;
        out.agreeing += dot(normals(x, y), normals(i, j)) >= least ? 1U : 0U;
      };
      compare(x + apart, y);
      compare(x, y + apart);
    }
  }
  return out;
}

int run_flatness(const EvaluateOptions& options) {
  Console console(options.quiet);
  const io::Expected<io::Scene> loaded = load_scene(options.scene, options.size);
  if (!loaded) return fail(loaded.error());
  const io::Scene& scene = loaded.value();
  ThreadPool pool(thread_count(options.threads));
  const RefineDepthParams params = (options.preset == "thesis" ? thesis_night_params() : default_night_params()).depth;
  std::vector<unsigned char> memory(refine_depth_workspace_bytes(params, scene.shape()));
  Workspace workspace(memory.data(), memory.size());
  RefinedDepth refined;
  const Status status = engine::refine_depth(params, scene.view(), workspace, pool, console, refined);
  if (!status.ok()) return fail(options.scene, status);
  const Flatness all = flatness({}, refined.normals, scene.labels.view());
  std::printf("%s, %d x %d\n", scene.name.c_str(), scene.image.width(), scene.image.height());
  std::printf("flatness      %.3f of %zu pairs of %s pixels have normals within 2 degrees\n", all.share(), all.pairs,
              scene.labels.empty() ? "all" : "building");
  print_planes(refined);
  return kExitDone;
}

}  // namespace npsim::tool
