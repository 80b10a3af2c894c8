// SPDX-License-Identifier: Apache-2.0
#include "coverage_errors.hpp"

#include <cmath>
#include <cstdint>
#include <cstdio>

#include "depth_recorder.hpp"
#include "masks.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/depth/normals.hpp"
#include "simple_fill.hpp"

namespace npsim::tool {
namespace {

constexpr std::size_t kGiven = 0;  // positions in CoverageErrors::rows
constexpr std::size_t kLinear = 2;

[[nodiscard]] Mask of_group(const SceneView& scene, const Mask& mask, std::size_t group) {
  return mask_where(mask.shape(), [&](int x, int y) { return mask(x, y) != 0 && in_group(scene.labels, group, x, y); });
}

[[nodiscard]] io::Image<Vec3f> normals_of(ImageView<const float> depth, const Mask& surface, const Intrinsics& camera,
                                          ThreadPool& pool) {
  io::Image<float> kept(depth.shape());
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) kept(x, y) = surface(x, y) != 0 ? depth(x, y) : 0.0F;
  }
  io::Image<Vec3f> out(depth.shape());
  Workspace none;
  (void)normals_from_depth(NormalsParams{}, ImageView<const float>(kept.view()), camera, out.view(), none, pool).ok();
  return out;
}

void judge_normals(const SceneView& scene, const Truth& truth, const RefinedDepth& refined, const Mask& surface,
                   ThreadPool& pool, CoverageErrors& out) {
  const ImageView<const Vec3f> true_normals = truth.normals.view();
  if (true_normals.empty()) return;
  const io::Image<Vec3f> of_refined = normals_of(refined.depth, surface, scene.camera, pool);
  const io::Image<Vec3f> of_truth = normals_of(truth.depth.view(), surface, scene.camera, pool);
  const float smooth_cosine = std::cos(kSmooth_deg * 0.017453293F);
  const Mask smooth = mask_where(surface.shape(), [&](int x, int y) {
    return surface(x, y) != 0 && dot(of_truth(x, y), normalized(true_normals(x, y))) > smooth_cosine;
  });
  std::vector<unsigned char> memory(normal_errors_workspace_bytes(surface.shape()));
  const auto judge = [&](std::string name, std::string key, ImageView<const Vec3f> normals) {
    if (normals.empty()) return;
    GroupNormals row;
    row.name = std::move(name);
    row.key = std::move(key);
    for (std::size_t g = 0; g < kLabelGroups.size(); ++g) {
      for (const auto& [mask, into] : {std::pair(&surface, &row.all[g]), std::pair(&smooth, &row.smooth[g])}) {
        Workspace workspace(memory.data(), memory.size());
        NormalErrors errors;
        const Mask group = of_group(scene, *mask, g);
        if (normal_errors(normals, true_normals, group.view(), errors, workspace, pool).ok()) *into = errors;
      }
    }
    out.normals.push_back(std::move(row));
  };
  judge("as given", "given", scene.normals);
  judge("that light falls on", "guiding", refined.normals);
  judge("of the refined depth", "of_refined_depth", of_refined.view());
  judge("of the true depth", "of_true_depth", of_truth.view());
}

}  // namespace

CoverageErrors coverage_errors(const SceneView& scene, const Truth& truth, const RefinedDepth& refined,
                               const std::vector<std::pair<Stage, io::Image<float>>>& steps, ThreadPool& pool) {
  const Shape shape = scene.shape();
  const ImageView<const float> true_depth = truth.depth.view();
  const Mask surface = mask_where(shape, [&](int x, int y) {
    return is_valid_depth(true_depth(x, y)) && (scene.labels.empty() || !kNoSurfaceLabels.contains(scene.labels(x, y)));
  });
  const Mask everywhere = mask_where(shape, [&](int x, int y) {
    return surface(x, y) != 0 &&
           std::all_of(steps.begin(), steps.end(), [&](const auto& s) { return is_valid_depth(s.second(x, y)); });
  });
  const auto has_input = [&](int x, int y) { return is_valid_depth(scene.depth(x, y)); };
  CoverageErrors out;
  out.source = refined.source;
  out.missing_pixels = marked(mask_where(shape, [&](int x, int y) { return surface(x, y) != 0 && !has_input(x, y); }));
  out.given_pixels = marked(mask_where(shape, [&](int x, int y) { return surface(x, y) != 0 && has_input(x, y); }));
  const Mask missing = mask_where(shape, [&](int x, int y) { return everywhere(x, y) != 0 && !has_input(x, y); });
  const Mask given = mask_where(shape, [&](int x, int y) { return everywhere(x, y) != 0 && has_input(x, y); });
  std::array<Mask, kLabelGroups.size()> missing_of, given_of;
  for (std::size_t g = 0; g < kLabelGroups.size(); ++g) {
    missing_of[g] = of_group(scene, missing, g);
    given_of[g] = of_group(scene, given, g);
  }
  const auto judge = [&](std::string name, std::string key, ImageView<const float> depth) {
    CoverageRow row;
    row.name = std::move(name);
    row.key = std::move(key);
    for (std::size_t g = 0; g < kLabelGroups.size(); ++g) {
      row.missing[g] = depth_shift(depth, true_depth, missing_of[g].view());
      row.given[g] = depth_shift(depth, true_depth, given_of[g].view());
    }
    out.rows.push_back(std::move(row));
  };
  io::Image<float> samples(shape);  // the yardsticks may not draw on what has no surface
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const bool off = !scene.labels.empty() && kNoSurfaceLabels.contains(scene.labels(x, y));
      samples(x, y) = off ? 0.0F : scene.depth(x, y);
    }
  }
  judge("as given", "given", scene.depth);
  judge("nearest neighbour", "nearest", filled_by_nearest(samples.view()).view());
  judge("linear in 1/z", "linear", filled_linearly(samples.view()).view());
  for (const auto& [stage, depth] : steps) {
    judge(std::string("after ") + stage_name(stage), stage_key(stage), depth.view());
  }
  judge_normals(scene, truth, refined, surface, pool, out);
  return out;
}

double missing_over_linear(const CoverageErrors& errors, const CoverageRow& row, std::size_t group) {
  return ratio(row.missing[group].mean, errors.rows[kLinear].missing[group].mean);
}

double given_over_input(const CoverageErrors& errors, const CoverageRow& row, std::size_t group) {
  return ratio(row.given[group].mean, errors.rows[kGiven].given[group].mean);
}

OrderedJson to_json(const CoverageErrors& e) {
  OrderedJson steps = OrderedJson::array();
  for (const CoverageRow& row : e.rows) {
    OrderedJson missing = OrderedJson::object();
    OrderedJson given = OrderedJson::object();
    for (std::size_t g = 0; g < kLabelGroups.size(); ++g) {
      missing[kLabelGroups[g].name] = to_json(row.missing[g]);
      missing[kLabelGroups[g].name]["ratio_to_linear"] = missing_over_linear(e, row, g);
      given[kLabelGroups[g].name] = to_json(row.given[g]);
      given[kLabelGroups[g].name]["ratio_to_given"] = given_over_input(e, row, g);
    }
    steps.push_back({{"step", row.key}, {"missing", std::move(missing)}, {"given", std::move(given)}});
  }
  OrderedJson normals = OrderedJson::object();
  for (const GroupNormals& row : e.normals) {
    OrderedJson& groups = normals[row.key];
    for (std::size_t g = 0; g < kLabelGroups.size(); ++g) {
      for (const auto& [key, of] : {std::pair("all", &row.all[g]), std::pair("smooth", &row.smooth[g])}) {
        if (!*of) continue;
        groups[kLabelGroups[g].name][key] = {
            {"pixels", (*of)->pixels}, {"mean_deg", (*of)->mean_deg}, {"median_deg", (*of)->median_deg}};
      }
    }
  }
  return {{"source", kDepthSourceNames[static_cast<std::size_t>(e.source)]},
          {"missing_pixels", e.missing_pixels},
          {"given_pixels", e.given_pixels},
          {"steps", std::move(steps)},
          {"normals", std::move(normals)}};
}

namespace {

void cell(int width, int digits, double value) {
  if (std::isfinite(value)) {
    std::printf(" %*.*f", width, digits, value);
  } else {
    std::printf(" %*s", width, "-");
  }
}

void print_groups(const char* title, const CoverageErrors& e,
                  const std::array<DepthShift, kLabelGroups.size()> CoverageRow::*part) {
  std::printf("\n%-30s", title);
  for (const LabelGroup& g : kLabelGroups) std::printf(" %8s", g.name);
  std::printf("\n");
  for (const CoverageRow& row : e.rows) {
    if ((row.*part)[0].pixels == 0) continue;
    std::printf("%-30s", row.name.c_str());
    for (const DepthShift& s : row.*part) cell(8, 4, s.mean);
    std::printf("\n");
  }
}

void print_normals(const char* title, const CoverageErrors& e,
                   const std::array<std::optional<NormalErrors>, kLabelGroups.size()> GroupNormals::*part) {
  if (e.normals.empty()) return;
  std::printf("\n%-30s", title);
  for (const LabelGroup& g : kLabelGroups) std::printf(" %8s", g.name);
  std::printf("\n");
  for (const GroupNormals& row : e.normals) {
    std::printf("%-30s", row.name.c_str());
    for (const std::optional<NormalErrors>& n : row.*part) cell(8, 2, n ? n->mean_deg : kNone);
    std::printf("\n");
  }
}

}  // namespace

void print_table(const CoverageErrors& e) {
  std::printf("\ndepth from %s: %zu pixels of surfaces without depth (%zu judged), %zu with\n",
              kDepthSourceNames[static_cast<std::size_t>(e.source)], e.missing_pixels,
              e.rows[kLinear].missing[0].pixels, e.given_pixels);
  std::printf("%-30s %8s %8s %8s   %8s %8s %8s %8s\n", "relative error where missing", "mean", "median", "/linear",
              "given:", "mean", "median", "/input");
  for (const CoverageRow& row : e.rows) {
    std::printf("%-30s", row.name.c_str());
    cell(8, 4, row.missing[0].mean);
    cell(8, 4, row.missing[0].median);
    cell(8, 3, missing_over_linear(e, row, 0));
    std::printf("   %8s", "");
    cell(8, 4, row.given[0].mean);
    cell(8, 4, row.given[0].median);
    cell(8, 3, given_over_input(e, row, 0));
    std::printf("\n");
  }
  print_groups("mean where missing, by label", e, &CoverageRow::missing);
  print_groups("mean where given, by label", e, &CoverageRow::given);
  print_normals("normals by label, mean degrees", e, &GroupNormals::all);
  print_normals("the same on smooth surfaces", e, &GroupNormals::smooth);
}

}  // namespace npsim::tool
