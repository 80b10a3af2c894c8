// SPDX-License-Identifier: Apache-2.0
// What was measured of the scene mesh, as a table and as JSON.
#ifndef NPSIM_SAMPLES_LAB_MESH_REPORT_HPP
#define NPSIM_SAMPLES_LAB_MESH_REPORT_HPP

#include <cstddef>
#include <cstdio>
#include <string>

#include <nlohmann/json.hpp>

#include "mesh_evaluation.hpp"
#include "night_change.hpp"
#include "tool/figures.hpp"

namespace npsim::tool {

[[nodiscard]] inline OrderedJson to_json(const MeshReport& r) {
  return {{"vertices", r.vertices},
          {"faces", r.faces},
          {"components", r.components},
          {"boundary_loops", r.boundary_loops},
          {"boundary_edges", r.boundary_edges},
          {"euler_characteristic", r.euler_characteristic},
          {"oriented_manifold", r.oriented_manifold()},
          {"watertight", r.watertight()},
          {"out_of_range_faces", r.out_of_range_faces},
          {"repeated_index_faces", r.repeated_index_faces},
          {"not_finite_vertices", r.not_finite_vertices},
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
          {"leak_rate", share(e.leaks, e.dark_by_seen)},
          {"by_illuminance",
           {{"wrongly_lit", ratio(e.wrongly_lit_lx, e.all_lx)}, {"wrongly_dark", ratio(e.wrongly_dark_lx, e.all_lx)}}}};
}

[[nodiscard]] inline OrderedJson to_json(const LayerReport& r) {
  return {{"whole", r.whole()},
          {"covered_pixels", r.covered_pixels},
          {"uncovered_pixels", r.uncovered_pixels},
          {"unanchored_pixels", r.unanchored_pixels},
          {"faces", r.faces},
          {"missing_faces", r.missing_faces},
          {"stray_faces", r.stray_faces}};
}

[[nodiscard]] inline OrderedJson to_json(const SimplificationErrors& e) {
  return {{"faces_before", e.faces_before},
          {"faces_after", e.faces_after},
          {"share", share(e.faces_after, e.faces_before)},
          {"max_relative_depth", e.max_relative_depth},
          {"rms_relative_depth", e.rms_relative_depth},
          {"max_px", e.max_px},
          {"rms_px", e.rms_px}};
}

[[nodiscard]] inline OrderedJson to_json(const NightChange& n) {
  return {{"faces_before", n.faces[0]},
          {"faces_after", n.faces[1]},
          {"mean_colour", n.mean_colour},
          {"rms_codes_of_255", n.rms_codes}};
}

// Apart from the other figures, as it is another one at each run.
[[nodiscard]] inline OrderedJson costs_json(const MeshErrors& e) {
  OrderedJson json = OrderedJson::object();
  for (const StepCost& c : e.steps.costs) {
    json[c.step] = {{"seconds", c.seconds}, {"output_bytes", c.output_bytes}, {"workspace_bytes", c.workspace_bytes}};
  }
  return json;
}

[[nodiscard]] inline OrderedJson to_json(const MeshErrors& e) {
  OrderedJson stages = OrderedJson::object();
  for (std::size_t i = 0; i < kMeshStages; ++i) {
    stages[kMeshStageKeys[i]] = {{"mesh", to_json(e.report[i])},
                                 {"shadows", i < e.shadows.size() ? to_json(e.shadows[i]) : OrderedJson()}};
  }
  return {{"of", e.key},
          {"stages", std::move(stages)},
          {"shadows_as_rays_meet_it", e.shadows.empty() ? OrderedJson() : to_json(e.shadows.back())},
          {"simplified_parts",
           {{"background", to_json(e.simplified_background)}, {"objects", to_json(e.simplified_objects)}}},
          {"layers", {{"background", to_json(e.steps.background)}, {"objects", to_json(e.steps.foreground)}}},
          {"simplification",
           {{"background", to_json(e.steps.simplified_background)}, {"objects", to_json(e.steps.simplified_objects)}}},
          {"background", e.background ? to_json(*e.background) : OrderedJson()}};
}

[[nodiscard]] inline const char* soundness(const MeshReport& r) {
  return r.watertight() ? "closed" : (r.oriented_manifold() ? "manifold" : "NOT A MANIFOLD");
}

inline void print_simplification(const char* name, const SimplificationErrors& e) {
  std::printf("%-30s %9zu %9zu %7.1f%% %9.4f%% %9.4f%% %9.5f %9.5f\n", name, e.faces_before, e.faces_after,
              e.faces_before > 0 ? 100 * share(e.faces_after, e.faces_before) : 0.0, 100 * e.max_relative_depth,
              100 * e.rms_relative_depth, e.max_px, e.rms_px);
}

inline void print_table(const NightChange& n) {
  std::printf(
      "\nnight with %zu faces instead of %zu: mean colour changes by %.3f %%, pixels by %.2f codes of 255 (rms)\n",
      n.faces[1], n.faces[0], 100 * n.mean_colour, n.rms_codes);
}

inline void print_shadows(const ShadowErrors& s) {
  const auto percent = [](double part, double whole) { return whole > 0 ? 100 * part / whole : kNone; };
  std::printf(" %7.2f%% %7.2f%% %7.2f%% %8.2f%% %8.3f%%", 100 * share(s.wrongly_lit, s.pairs),
              100 * share(s.wrongly_dark, s.pairs), 100 * share(s.wrongly_lit + s.wrongly_dark, s.pairs),
              percent(s.wrongly_lit_lx + s.wrongly_dark_lx, s.all_lx), 100 * share(s.leaks, s.dark_by_seen));
}

inline void print_table(const MeshErrors& e, const char* title) {
  std::printf("\n%-30s %9s %6s %7s %9s %8s %8s %8s %9s %9s\n", title, "faces", "parts", "loops", "manifold", "lit !",
              "dark !", "wrong", "by lux", "leaks");
  for (std::size_t i = 0; i < kMeshStages; ++i) {
    const MeshReport& r = e.report[i];
    std::printf("%-30s %9zu %6zu %7zu %9s", kMeshStageNames[i], r.faces, r.components, r.boundary_loops,
                r.oriented_manifold() ? "yes" : "NO");
    if (i < e.shadows.size()) print_shadows(e.shadows[i]);
    std::printf("\n");
  }
  if (!e.shadows.empty()) {
    std::printf("%-30s %34s", kTracedName, "");
    print_shadows(e.shadows.back());
    std::printf("\n");
  }
  std::printf("the simplified parts: background %s, objects %s; the layers: background %s, objects %s\n",
              soundness(e.simplified_background), soundness(e.simplified_objects),
              e.steps.background.whole() ? "whole" : "NOT WHOLE", e.steps.foreground.whole() ? "whole" : "NOT WHOLE");
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
  std::printf("%-30s %9s %9s %8s %10s %10s %9s %9s\n", "simplification", "faces", "left", "share", "depth max", "rms",
              "px max", "rms");
  print_simplification("  background", e.steps.simplified_background);
  print_simplification("  objects", e.steps.simplified_objects);
  std::printf("%-30s %9s %9s %12s\n", "cost of a step", "ms", "out MB", "borrowed MB");
  for (const StepCost& c : e.steps.costs) {
    std::printf("  %-28s %9.2f %9.2f %12.2f\n", c.step, 1e3 * c.seconds, 1e-6 * static_cast<double>(c.output_bytes),
                1e-6 * static_cast<double>(c.workspace_bytes));
  }
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_MESH_REPORT_HPP
