// SPDX-License-Identifier: Apache-2.0
#include "evaluation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>

#include "depth_recorder.hpp"
#include "masks.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/depth/normals.hpp"
#include "tool/engine.hpp"

namespace npsim::tool {
namespace {

// The measures of one image size, with their memory.
class Judge {
 public:
  using Mask = ImageView<const std::uint8_t>;

  Judge(Shape shape, ThreadPool& pool)
      : shape_(shape),
        pool_(pool),
        memory_(std::max({depth_errors_workspace_bytes(shape), normal_errors_workspace_bytes(shape),
                          edge_errors_workspace_bytes({}, shape), mask_overlap_workspace_bytes(shape)})) {}

  [[nodiscard]] std::optional<DepthErrors> depth(ImageView<const float> z, ImageView<const float> truth, Mask mask) {
    DepthErrors errors;
    return taken(errors, [&](Workspace& w) { return depth_errors(z, truth, mask, errors, w, pool_); });
  }
  [[nodiscard]] std::optional<NormalErrors> normals(ImageView<const Vec3f> n, ImageView<const Vec3f> truth, Mask mask) {
    NormalErrors errors;
    if (n.empty() || truth.empty()) return {};
    return taken(errors, [&](Workspace& w) { return normal_errors(n, truth, mask, errors, w, pool_); });
  }
  [[nodiscard]] std::optional<EdgeErrors> edges(const EdgeErrorParams& params, Mask estimate, Mask truth) {
    EdgeErrors errors;
    return taken(errors, [&](Workspace& w) { return edge_errors(params, estimate, truth, errors, w, pool_); });
  }
  [[nodiscard]] MaskOverlap overlap(Mask first, Mask second) {
    MaskOverlap sums;
    return taken(sums, [&](Workspace& w) { return mask_overlap(first, second, sums, w, pool_); })
        .value_or(MaskOverlap{});
  }
  [[nodiscard]] io::Image<std::uint8_t> edges_of(const DepthEdgeParams& params, ImageView<const float> z, Mask mask) {
    io::Image<std::uint8_t> out(shape_);
    (void)depth_edges(params, z, mask, out.view(), pool_).ok();
    return out;
  }
  [[nodiscard]] io::Image<std::uint8_t> near(Mask mask, int radius_px) {
    io::Image<std::uint8_t> out(shape_);
    (void)mark_near(mask, radius_px, out.view(), pool_).ok();
    return out;
  }
  // Of the depth on the pixels of the mask alone.
  [[nodiscard]] io::Image<Vec3f> normals_of(ImageView<const float> z, Mask mask, const Intrinsics& camera) {
    io::Image<float> kept(shape_);
    for (int y = 0; y < shape_.height; ++y) {
      for (int x = 0; x < shape_.width; ++x) kept(x, y) = mask(x, y) != 0 ? z(x, y) : 0.0F;
    }
    io::Image<Vec3f> out(shape_);
    Workspace none;
    (void)normals_from_depth(NormalsParams{}, ImageView<const float>(kept.view()), camera, out.view(), none, pool_)
        .ok();
    return out;
  }

 private:
  template <class Errors, class Measure>
  [[nodiscard]] std::optional<Errors> taken(const Errors& errors, const Measure& measure) {
    Workspace workspace(memory_.data(), memory_.size());
    return measure(workspace).ok() ? std::optional<Errors>(errors) : std::nullopt;
  }

  Shape shape_;
  ThreadPool& pool_;
  std::vector<unsigned char> memory_;
};

[[nodiscard]] StepErrors step_after(Stage stage) {
  StepErrors step;
  step.name = std::string("after ") + stage_name(stage);
  step.key = stage_key(stage);
  return step;
}

Status evaluate_meshes(const SceneView& scene, const Truth& truth, const UncertaintyParams& uncertainty_params,
                       const ReconstructParams& params, const RefinedDepth& refined, ThreadPool& pool, Console& console,
                       std::vector<MeshErrors>& out, std::vector<LampErrors>& lamps) {
  MeshJudges judges;
  judges.true_depth = truth.depth.view();
  judges.true_normals = truth.normals.view();
  judges.background_depth = truth.background_depth.view();
  judges.mesh = &truth.mesh;
  TrueDepthAsRefined ideal;
  NPSIM_RETURN_IF_ERROR(ideal.take(scene, refined, truth.depth.view(), uncertainty_params, pool));
  out.resize(2);
  out[0].key = "refined";
  NPSIM_RETURN_IF_ERROR(evaluate_mesh(params, scene, refined, judges, pool, console, out[0]));
  out[1].key = "true_depth";
  NPSIM_RETURN_IF_ERROR(evaluate_mesh(params, scene, ideal.refined, judges, pool, console, out[1]));
  if (truth.emitters.empty()) return {};
  io::Image<float> certain(scene.shape(), 1.0F);  // nothing of the true depth is blurred
  ideal.refined.confidence = certain.view();
  const std::array<const RefinedDepth*, 2> depths = {&refined, &ideal.refined};
  for (std::size_t i = 0; i < depths.size(); ++i) {
    std::vector<Emitter> placed;
    NPSIM_RETURN_IF_ERROR(placed_lamps(judges.placement, scene, *depths[i], placed));
    lamps.push_back({out[i].key, lamp_errors(scene.lights, Span<const Emitter>(placed.data(), placed.size()),
                                             Span<const io::TrueEmitter>(truth.emitters.data(), truth.emitters.size()),
                                             depths[i]->ground.up)});
  }
  return {};
}

}  // namespace

Status evaluate(const SceneView& scene, const Truth& truth, const RefineDepthParams& params,
                const ReconstructParams* mesh_params, ThreadPool& pool, Console& console, Evaluation& out) {
  const Shape shape = scene.shape();
  DepthRecorder recorder(console);
  std::vector<unsigned char> memory(refine_depth_workspace_bytes(params, shape));
  Workspace workspace(memory.data(), memory.size());
  RefinedDepth refined;
  NPSIM_RETURN_IF_ERROR(engine::refine_depth(params, scene, workspace, pool, recorder, refined));

  std::vector<ImageView<const float>> depths = {scene.depth};
  out.steps = {{"as given", "given", {}, {}, {}, {}}};
  for (const auto& [stage, depth] : recorder.kept()) {
    depths.push_back(depth.view());
    out.steps.push_back(step_after(stage));
  }
  const ImageView<const float> true_depth = truth.depth.view();
  const ImageView<const Vec3f> true_normals = truth.normals.view();
  const auto on_surface = [&](int x, int y) {
    return is_valid_depth(true_depth(x, y)) &&
           !(!scene.labels.empty() && kNoSurfaceLabels.contains(scene.labels(x, y)));
  };
  const Mask common_mask = mask_where(shape, [&](int x, int y) {
    return on_surface(x, y) &&
           std::all_of(depths.begin(), depths.end(), [&](const auto& z) { return is_valid_depth(z(x, y)); });
  });
  out.surface_pixels = marked(mask_where(shape, on_surface));
  out.pixels = marked(common_mask);
  const Judge::Mask common = common_mask.view();

  // Pixels are those of images 960 wide; the width over which edges are smeared grows with the image.
  out.edge_params.reach_px = std::clamp(shape.width / 240, 2, 64);
  out.near_edges_px = std::clamp(shape.width / 320, 1, 64);
  Judge judge(shape, pool);
  const io::Image<std::uint8_t> true_edges = judge.edges_of(out.edge_params, true_depth, common);
  const io::Image<std::uint8_t> at_edges = judge.near(true_edges.view(), out.near_edges_px);
  const io::Image<std::uint8_t> near_edges =
      mask_where(shape, [&](int x, int y) { return common(x, y) != 0 && at_edges(x, y) != 0; });
  const io::Image<Vec3f> best_normals = judge.normals_of(true_depth, common, scene.camera);
  const io::Image<std::uint8_t> with_normals =
      mask_where(shape, [&](int x, int y) { return best_normals(x, y) != Vec3f{}; });
  const float smooth_cosine = std::cos(kSmooth_deg * 0.017453293F);
  const io::Image<std::uint8_t> smooth = mask_where(shape, [&](int x, int y) {
    return !true_normals.empty() && dot(best_normals(x, y), normalized(true_normals(x, y))) > smooth_cosine;
  });
  const auto judged = [&](ImageView<const Vec3f> n) -> NormalRow {
    return {judge.normals(n, true_normals, with_normals.view()), judge.normals(n, true_normals, smooth.view())};
  };
  out.true_depth_normals = judged(best_normals.view());
  out.given_normals = judged(scene.normals);
  out.guiding_normals = judged(refined.normals);

  std::vector<io::Image<Vec3f>> normals;
  for (std::size_t i = 0; i < depths.size(); ++i) {
    StepErrors& step = out.steps[i];
    normals.push_back(judge.normals_of(depths[i], common, scene.camera));
    step.depth = judge.depth(depths[i], true_depth, common);
    step.near_edges = judge.depth(depths[i], true_depth, near_edges.view());
    step.edges =
        judge.edges(out.distance_params, judge.edges_of(out.edge_params, depths[i], common).view(), true_edges.view());
    step.normals = judged(normals.back().view());
  }

  const io::Image<std::uint8_t> uncertain =
      mask_where(shape, [&](int x, int y) { return common(x, y) != 0 && refined.uncertain(x, y) != 0; });
  const io::Image<std::uint8_t> foreground_edges = mask_where(
      shape, [&](int x, int y) { return true_edges(x, y) != 0 && kForegroundLabels.contains(refined.labels(x, y)); });
  const io::Image<std::uint8_t> window =
      judge.near(true_edges.view(), std::clamp(params.uncertainty.window_px - 1, 0, 64));
  out.uncertain_on_edges = judge.overlap(true_edges.view(), uncertain.view());
  out.uncertain_on_foreground_edges = judge.overlap(foreground_edges.view(), uncertain.view());
  out.uncertain_near_edges = judge.overlap(window.view(), uncertain.view());

  std::array<bool, kLabelCount> present{};
  for (int y = 0; y < (scene.labels.empty() ? 0 : shape.height); ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (common(x, y) != 0 && scene.labels(x, y) < kLabelCount) present[scene.labels(x, y)] = true;
    }
  }
  for (std::size_t l = 0; l < present.size(); ++l) {
    if (!present[l]) continue;
    LabelErrors errors;
    errors.label = static_cast<Label>(l);
    const io::Image<std::uint8_t> mask =
        mask_where(shape, [&](int x, int y) { return common(x, y) != 0 && scene.labels(x, y) == errors.label; });
    const io::Image<std::uint8_t> mask_with_normals =
        mask_where(shape, [&](int x, int y) { return mask(x, y) != 0 && with_normals(x, y) != 0; });
    for (std::size_t i = 0; i < depths.size(); ++i) {
      errors.depth.push_back(judge.depth(depths[i], true_depth, mask.view()));
      errors.normals.push_back(judge.normals(normals[i].view(), true_normals, mask_with_normals.view()));
    }
    out.labels.push_back(std::move(errors));
  }
  out.coverage = coverage_errors(scene, truth, refined, recorder.kept(), pool);
  if (mesh_params == nullptr) return {};
  const ImageView<const Vec3f> true_albedo = scene.albedo.empty() ? truth.albedo.view() : scene.albedo;
  if (!true_albedo.empty()) {
    NPSIM_RETURN_IF_ERROR(albedo_errors(AlbedoParams{}, scene, true_albedo, refined, pool, out.albedo.emplace()));
  }
  return evaluate_meshes(scene, truth, params.uncertainty, *mesh_params, refined, pool, console, out.meshes, out.lamps);
}

}  // namespace npsim::tool
