// SPDX-License-Identifier: Apache-2.0
// What was measured of the scene mesh, as a table and as JSON.
#ifndef NPSIM_SAMPLES_NPSIM_MESH_REPORT_HPP
#define NPSIM_SAMPLES_NPSIM_MESH_REPORT_HPP

#include <cstddef>
#include <cstdio>
#include <string>

#include <nlohmann/json.hpp>

#include "figures.hpp"
#include "mesh_evaluation.hpp"

namespace npsim::tool {

[[nodiscard]] inline OrderedJson to_json(const MeshReport& r) {
  return {{"vertices", r.vertices},
          {"faces", r.faces},
          {"components", r.components},
          {"boundary_loops", r.boundary_loops},
          {"boundary_edges", r.boundary_edges},
          {"euler_characteristic", r.euler_characteristic},
          {"oriented_manifold", r.oriented_manifold()},
          {"nonmanifold_edges", r.nonmanifold_edges},
          {"inconsistent_edges", r.inconsistent_edges},
          {"pinched_vertices", r.pinched_vertices},
          {"duplicate_faces", r.duplicate_faces},
          {"flat_faces", r.flat_faces},
          {"smallest_angle_rad", r.smallest_angle_rad}};
}

[[nodiscard]] inline OrderedJson to_json(const BackgroundErrors& e) {
  return {{"pixels", e.pixels},
          {"missing", e.missing},
          {"within_3_percent", share(e.within_3_percent, e.pixels)},
          {"abs_rel", e.abs_rel}};
}

[[nodiscard]] inline OrderedJson to_json(const ShadowErrors& e) {
  return {{"pairs", e.pairs},
          {"dark", share(e.dark, e.pairs)},
          {"wrongly_lit", share(e.wrongly_lit, e.pairs)},
          {"wrongly_dark", share(e.wrongly_dark, e.pairs)},
          {"leaks", e.leaks},
          {"leak_rate", share(e.leaks, e.dark_by_seen)}};
}

[[nodiscard]] inline OrderedJson to_json(const MeshErrors& e) {
  OrderedJson stages = OrderedJson::object();
  for (std::size_t i = 0; i < kMeshStages; ++i) {
    stages[kMeshStageKeys[i]] = {{"mesh", to_json(e.report[i])},
                                 {"shadows", i < e.shadows.size() ? to_json(e.shadows[i]) : OrderedJson()}};
  }
  return {{"of", e.key},
          {"stages", std::move(stages)},
          {"background", e.background ? to_json(*e.background) : OrderedJson()}};
}

inline void print_table(const MeshErrors& e, const char* title) {
  std::printf("\n%-30s %9s %6s %7s %9s %8s %8s %8s %9s\n", title, "faces", "parts", "loops", "manifold", "lit !",
              "dark !", "wrong", "leaks");
  for (std::size_t i = 0; i < kMeshStages; ++i) {
    const MeshReport& r = e.report[i];
    std::printf("%-30s %9zu %6zu %7zu %9s", kMeshStageNames[i], r.faces, r.components, r.boundary_loops,
                r.oriented_manifold() ? "yes" : "NO");
    if (i < e.shadows.size()) {
      const ShadowErrors& s = e.shadows[i];
      std::printf(" %7.2f%% %7.2f%% %7.2f%% %8.3f%%", 100 * share(s.wrongly_lit, s.pairs),
                  100 * share(s.wrongly_dark, s.pairs), 100 * share(s.wrongly_lit + s.wrongly_dark, s.pairs),
                  100 * share(s.leaks, s.dark_by_seen));
    }
    std::printf("\n");
  }
  if (!e.shadows.empty()) {
    const ShadowErrors& s = e.shadows.front();
    std::printf("of %zu pairs of point and lamp, %.1f %% dark in truth (%.1f %% because of what the camera sees)\n",
                s.pairs, 100 * share(s.dark, s.pairs), 100 * share(s.dark_by_seen, s.pairs));
  }
  if (e.background) {
    const BackgroundErrors& b = *e.background;
    std::printf("background behind objects: %.1f %% of %zu pixels within 3 %% of the truth, AbsRel %.4f, %zu missing\n",
                100 * share(b.within_3_percent, b.pixels), b.pixels, b.abs_rel, b.missing);
  }
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_NPSIM_MESH_REPORT_HPP
