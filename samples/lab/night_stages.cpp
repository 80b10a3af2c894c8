// SPDX-License-Identifier: Apache-2.0
#include "night_stages.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "mesh_evaluation.hpp"
#include "npsim/io/memory.hpp"
#include "npsim/metrics/picture_errors.hpp"
#include "npsim/pipeline/photograph.hpp"
#include "tool/engine.hpp"
#include "tool/shop_fronts.hpp"
#include "transport_alone.hpp"

namespace npsim::tool {
namespace {

// The planes of a refined depth, to be handed to several nights: each takes the memory of its normals.
struct KeptDepth {
  io::Image<float> depth;
  io::Image<Label> labels;
  io::Image<std::uint8_t> surface, uncertain;
  io::Image<Vec3f> normals;
  io::Image<float> confidence;  // of measured depth
  RefinedDepth like;            // for what is no plane

  static KeptDepth of(const RefinedDepth& refined) {
    const Shape shape = refined.depth.shape();
    KeptDepth kept{io::Image<float>(shape),
                   io::Image<Label>(shape),
                   io::Image<std::uint8_t>(shape),
                   io::Image<std::uint8_t>(shape),
                   io::Image<Vec3f>(shape),
                   io::Image<float>(),
                   refined};
    copy_pixels(refined.surface_depth(), kept.depth.view());
    copy_pixels(refined.labels, kept.labels.view());
    copy_pixels(refined.surface, kept.surface.view());
    copy_pixels(refined.uncertain, kept.uncertain.view());
    copy_pixels(refined.normals, kept.normals.view());
    if (!refined.confidence.empty()) {
      kept.confidence = io::Image<float>(shape);
      copy_pixels(refined.confidence, kept.confidence.view());
    }
    kept.like.filled = {};  // nights need neither
    kept.like.planes = PlanarMap{};
    return kept;
  }
  [[nodiscard]] RefinedDepth refined() {
    RefinedDepth out = like;
    out.depth = depth.view();
    out.mesh_depth = {};
    out.labels = labels.view();
    out.surface = surface.view();
    out.uncertain = uncertain.view();
    out.normals = normals.view();
    out.confidence = confidence.view();
    return out;
  }
};

// Keeps the light of one night.
struct KeptLight : NullSink {
  io::Image<Vec3f>* luminance;
  explicit KeptLight(io::Image<Vec3f>& out) : luminance(&out) {}
  Status night(const Night& night) const {
    *luminance = io::Image<Vec3f>(night.luminance.shape());
    copy_pixels(night.luminance, luminance->view());
    return {};
  }
};

[[nodiscard]] Status night_of(const NightParams& params, const SceneView& scene, const KeptDepth& depth,
                              ThreadPool& pool, Console& console, io::Image<Vec3f>& out) {
  KeptDepth own = depth;
  const RefinedDepth refined = own.refined();
  io::HostMemory memory(night_workspace_bytes(params, scene.shape(), scene.lights.size()));
  Workspace workspace = memory.workspace();
  KeptLight sink(out);
  return engine::make_nights_of_depth(params, scene, refined, workspace, pool, console, sink);
}

[[nodiscard]] Status refined_depth(const NightParams& params, const SceneView& scene, ThreadPool& pool,
                                   Console& console, KeptDepth& out) {
  std::vector<unsigned char> memory(refine_depth_workspace_bytes(params.depth, scene.shape()));
  Workspace workspace(memory.data(), memory.size());
  RefinedDepth refined;
  NPSIM_RETURN_IF_ERROR(engine::refine_depth(params.depth, scene, workspace, pool, console, refined));
  out = KeptDepth::of(refined);
  return {};
}

// A depth that nothing has refined. normals: empty: those that guided the refinement.
[[nodiscard]] Status unrefined(const NightParams& params, const SceneView& scene, const KeptDepth& like,
                               ImageView<const float> depth, ImageView<const Vec3f> normals, ThreadPool& pool,
                               KeptDepth& out) {
  KeptDepth guide = like;
  TrueDepthAsRefined taken;
  NPSIM_RETURN_IF_ERROR(taken.take(scene, guide.refined(), depth, params.depth.uncertainty, pool));
  out = KeptDepth::of(taken.refined);
  if (!normals.empty()) copy_pixels(normals, out.normals.view());
  return {};
}

[[nodiscard]] bool is_lamp(const SceneView& scene, int x, int y) {
  const std::uint16_t mark = scene.light_index.empty() ? std::uint16_t{0} : scene.light_index(x, y);
  return mark != 0 && !is_group(scene.lights[mark - 1U].cls);
}

template <class Holds>
[[nodiscard]] io::Image<std::uint8_t> judged_pixels(const SceneView& scene, const Truth& truth, const Holds& holds) {
  io::Image<std::uint8_t> mask(scene.shape());
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x) {
      const bool surface =
          is_valid_depth(truth.depth(x, y)) && (scene.labels.empty() || !kNoSurfaceLabels.contains(scene.labels(x, y)));
      mask(x, y) = surface && !is_lamp(scene, x, y) && holds(x, y) ? 1 : 0;
    }
  }
  return mask;
}

class StageJudge {
 public:
  StageJudge(const NightParams& params, const SceneView& scene, const Truth& truth, const TrueNight& night,
             ThreadPool& pool)
      : params_(params), scene_(scene), truth_(truth), night_(night), pool_(pool) {
    params_.camera.residual_noise = 0;
  }

  [[nodiscard]] Status start() {
    NPSIM_RETURN_IF_ERROR(shown(night_.luminance, true_picture_));
    params_.camera.exposure.metering = Metering::fixed;
    params_.camera.exposure.camera.iso = exposure_.iso;
    return {};
  }

  [[nodiscard]] Status judge(const std::string& name, const io::Image<Vec3f>& own, NightErrors& out) {
    const Shape shape = scene_.shape();
    std::vector<unsigned char> memory(
        std::max({luminance_errors_workspace_bytes(shape), flip_workspace_bytes({}, shape),
                  picture_errors_workspace_bytes(shape)}));
    Workspace workspace(memory.data(), memory.size());
    out.name = name;
    const auto errors = [&](const io::Image<std::uint8_t>& mask, std::optional<LuminanceErrors>& into) {
      LuminanceErrors e;
      const Status done = luminance_errors({}, own.view(), night_.luminance.view(), mask.view(), e, workspace);
      if (done.ok()) into = e;
      return done.code() == StatusCode::no_valid_input ? Status() : done;
    };
    NPSIM_RETURN_IF_ERROR(errors(judged_pixels(scene_, truth_, [](int, int) { return true; }), out.all));
    for (std::size_t i = 0; i < kJudgedLabels.size() && !scene_.labels.empty(); ++i) {
      const auto of_label = [&](int x, int y) { return scene_.labels(x, y) == kJudgedLabels[i]; };
      NPSIM_RETURN_IF_ERROR(errors(judged_pixels(scene_, truth_, of_label), out.by_label[i]));
    }
    NPSIM_RETURN_IF_ERROR(shown(own, own_picture_));
    NPSIM_RETURN_IF_ERROR(picture_errors(std::as_const(true_picture_).view(), std::as_const(own_picture_).view(),
                                         out.picture, workspace, pool_));
    io::Image<float> map(shape);
    return flip({}, std::as_const(true_picture_).view(), std::as_const(own_picture_).view(), map.view(), out.flip,
                workspace, pool_);
  }

  // Of the night that was judged last.
  void pictures(const io::Image<Vec3f>& own, NightPictures& out) const {
    out.truth = true_picture_;
    out.own = own_picture_;
    out.signed_error = io::Image<Rgb8>(scene_.shape(), Rgb8{70, 70, 70});
    const io::Image<std::uint8_t> mask = judged_pixels(scene_, truth_, [](int, int) { return true; });
    for (int y = 0; y < mask.height(); ++y) {
      for (int x = 0; x < mask.width(); ++x) {
        const float t = luminance(night_.luminance(x, y));
        if (mask(x, y) == 0 || !(t > LuminanceErrorParams{}.floor_cd_m2)) continue;
        const float stops = std::log2(std::max(luminance(own(x, y)), 1e-6F) / t);
        const float strength = std::min(std::fabs(stops) / 3.0F, 1.0F);
        const auto fade = static_cast<std::uint8_t>(255.0F * (1.0F - strength));
        out.signed_error(x, y) = stops > 0 ? Rgb8{255, fade, fade} : Rgb8{fade, fade, 255};
      }
    }
  }

 private:
  [[nodiscard]] Status shown(const io::Image<Vec3f>& light, io::Image<Rgb8>& out) {
    out = io::Image<Rgb8>(light.shape());
    std::vector<unsigned char> memory(photograph_workspace_bytes(params_.camera, light.shape()));
    Workspace workspace(memory.data(), memory.size());
    return photograph(params_.camera, scene_.camera, 0, 0, light.view(), out.view(), exposure_, workspace, pool_);
  }

  NightParams params_;
  const SceneView& scene_;
  const Truth& truth_;
  const TrueNight& night_;
  ThreadPool& pool_;
  CameraExposure exposure_;
  io::Image<Rgb8> true_picture_, own_picture_;
};

[[nodiscard]] NightParams one_night(NightParams params) {
  params.variants = 1;
  return params;
}

[[nodiscard]] NightParams with_true_lamps(NightParams params, const TrueNight& night) {
  params.relight.lamps = Span<const Emitter>(night.lamps.data(), night.lamps.size());
  params.relight.ego_headlamps = false;  // they are among the lamps
  return params;
}

[[nodiscard]] SceneView without_materials(const SceneView& scene) {
  SceneView guessed = scene;  // they are estimated
  guessed.albedo = {};
  guessed.roughness = {};
  return guessed;
}

// The renderer against the reference on one and the same mesh, with the same materials and lamps.
[[nodiscard]] Status judge_transport(NightParams params, const SceneView& scene, const Truth& truth, KeptDepth depth,
                                     std::uint64_t samples, ThreadPool& pool, Console& console, NightErrors& out) {
  params.mesh.traced = TracedFaces::mesh;  // what the reference gets
  params.mesh.simplify_faces = false;
  params.relight.unseen.share = 0.0F;  // of which the reference knows nothing
  params.relight.veils = VeilParams::none();
  params.relight.bodies = LabelSet();
  io::Image<Vec3f> own;
  TrueNight night;
  NPSIM_RETURN_IF_ERROR(transport_alone(params, scene, depth.refined(), samples, pool, console, own, night.luminance));
  // The pictures shall differ by what surfaces show, not by lamps and sky.
  for (int y = 0; y < own.height(); ++y) {
    for (int x = 0; x < own.width(); ++x) {
      const bool surface = is_valid_depth(truth.depth(x, y)) && !is_lamp(scene, x, y);
      if (!surface || night.luminance(x, y) == Vec3f{}) night.luminance(x, y) = own(x, y);
    }
  }
  StageJudge judge(params, scene, truth, night, pool);
  NPSIM_RETURN_IF_ERROR(judge.start());
  return judge.judge("transport alone", own, out);
}

}  // namespace

Status night_stages(const NightParams& params, const SceneView& scene, const Truth& truth, const TrueNight& night,
                    std::uint64_t transport_samples, ThreadPool& pool, Console& console, std::vector<NightErrors>& out,
                    NightPictures& pictures, std::vector<std::uint8_t>& shop_fronts) {
  NightParams placed = one_night(params);
  const SceneView guessed = without_materials(scene);

  KeptDepth refined, given, exact, sheet, by_thesis;
  NPSIM_RETURN_IF_ERROR(refined_depth(params, scene, pool, console, refined));
  // Those of the night that was drawn, so that every stage draws the same one.
  NPSIM_RETURN_IF_ERROR(shop_fronts_of(params, scene, refined.refined(), shop_fronts));
  placed.relight.shop_fronts = {shop_fronts.data(), shop_fronts.size()};
  const NightParams known = with_true_lamps(placed, night);
  NPSIM_RETURN_IF_ERROR(unrefined(params, scene, refined, scene.depth, {}, pool, given));
  NPSIM_RETURN_IF_ERROR(unrefined(params, scene, refined, truth.depth.view(), truth.normals.view(), pool, exact));
  exact.like.ground = night.ground;
  exact.like.source = DepthSource::exact;
  exact.confidence = io::Image<float>(scene.shape(), 1.0F);  // nothing of it is blurred
  sheet = given;
  for (std::uint8_t& u : sheet.uncertain.view().pixels()) u = 0;
  NightParams connected = placed;  // nothing is deleted, nothing let through
  connected.mesh.outline_px = 0;
  connected.mesh.open_steps.min_step = 1e6F;
  NightParams thesis = thesis_night_params();
  thesis.seed = params.seed;
  thesis.photograph = params.photograph;
  NPSIM_RETURN_IF_ERROR(refined_depth(thesis, scene, pool, console, by_thesis));

  struct Row {
    const char* name;
    const NightParams* params;
    const SceneView* scene;
    const KeptDepth* depth;
  };
  const std::vector<Row> rows = {
      {"mesh of the true depth", &known, &scene, &exact},
      {"+ placed lamps", &placed, &scene, &exact},
      {kWholeChain, &placed, &scene, &refined},
      {kWholeChainEstimated, &placed, &guessed, &refined},
      {"refined depth alone", &known, &scene, &refined},
      {"given depth alone", &known, &scene, &given},
      {"estimated materials alone", &known, &guessed, &exact},
      {"whole chain, depth as given", &placed, &scene, &given},
      {"unrefined, unpruned sheet", &connected, &scene, &sheet},
      {"thesis preset", &thesis, &scene, &by_thesis},
  };
  StageJudge judge(params, scene, truth, night, pool);
  NPSIM_RETURN_IF_ERROR(judge.start());
  out.clear();
  if (transport_samples > 0) {
    out.emplace_back();
    NPSIM_RETURN_IF_ERROR(judge_transport(known, scene, truth, exact, transport_samples, pool, console, out.back()));
  }
  for (const Row& row : rows) {
    io::Image<Vec3f> own;
    NPSIM_RETURN_IF_ERROR(night_of(*row.params, *row.scene, *row.depth, pool, console, own));
    NightErrors errors;
    NPSIM_RETURN_IF_ERROR(judge.judge(row.name, own, errors));
    out.push_back(std::move(errors));
    if (row.depth == &refined && row.scene == &scene && row.params == &placed) judge.pictures(own, pictures);
  }
  return {};
}

std::array<std::string, 3> source_rows(const std::string& name) {
  return {name + " depth", name + ", estimated materials", name + " depth, true lamps"};
}

Status night_of_source(const NightParams& params, const SceneView& scene, const Truth& truth, const TrueNight& night,
                       const std::vector<std::uint8_t>& shop_fronts, const std::string& name, ThreadPool& pool,
                       Console& console, std::vector<NightErrors>& out) {
  NightParams placed = one_night(params);
  placed.relight.shop_fronts = {shop_fronts.data(), shop_fronts.size()};
  const NightParams known = with_true_lamps(placed, night);
  KeptDepth refined;
  NPSIM_RETURN_IF_ERROR(refined_depth(params, scene, pool, console, refined));
  StageJudge judge(params, scene, truth, night, pool);
  NPSIM_RETURN_IF_ERROR(judge.start());
  const SceneView guessed = without_materials(scene);
  const std::array<std::pair<const NightParams*, const SceneView*>, 3> rows = {
      {{&placed, &scene}, {&placed, &guessed}, {&known, &scene}}};
  const std::array<std::string, 3> names = source_rows(name);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    io::Image<Vec3f> own;
    NPSIM_RETURN_IF_ERROR(night_of(*rows[i].first, *rows[i].second, refined, pool, console, own));
    NightErrors errors;
    NPSIM_RETURN_IF_ERROR(judge.judge(names[i], own, errors));
    out.push_back(std::move(errors));
  }
  return {};
}

std::vector<SourceRatios> source_ratios(const std::vector<NightErrors>& rows, const std::vector<std::string>& sources) {
  const auto error_of = [&](const std::string& name) {
    const auto row = std::find_if(rows.begin(), rows.end(), [&](const NightErrors& e) { return e.name == name; });
    return row != rows.end() && row->all ? row->all->median : kNone;
  };
  const double given = error_of(kWholeChain);
  const double estimated = error_of(kWholeChainEstimated);
  std::vector<SourceRatios> out = {{"network", 1.0, 1.0, ratio(estimated, given)}};
  for (const std::string& source : sources) {
    const std::array<std::string, 3> names = source_rows(source);
    out.push_back({source, ratio(error_of(names[0]), given), ratio(error_of(names[1]), estimated),
                   ratio(error_of(names[1]), error_of(names[0]))});
  }
  return out;
}

OrderedJson to_json(const std::vector<SourceRatios>& ratios) {
  OrderedJson out = OrderedJson::object();
  for (const SourceRatios& r : ratios) {
    out[r.name] = {{"given_materials", r.given},
                   {"estimated_materials", r.estimated},
                   {"estimated_over_given", r.estimated_over_given}};
  }
  return out;
}

void print_table(const std::vector<SourceRatios>& ratios) {
  std::printf("\n%-30s %16s %20s %22s\n", "median over that of network", "given materials", "estimated materials",
              "estimated over given");
  for (const SourceRatios& r : ratios) {
    std::printf("%-30s %16.2f %20.2f %22.2f\n", r.name.c_str(), r.given, r.estimated, r.estimated_over_given);
  }
}

std::vector<NightErrors> mean_of(const std::vector<std::vector<NightErrors>>& scenes) {
  std::vector<NightErrors> out;
  for (std::size_t row = 0; !scenes.empty() && row < scenes.front().size(); ++row) {
    NightErrors mean;
    mean.name = scenes.front()[row].name;
    const auto n = static_cast<double>(scenes.size());
    const auto average = [&](const auto& part_of) {
      std::optional<LuminanceErrors> sum;
      for (const std::vector<NightErrors>& scene : scenes) {
        const std::optional<LuminanceErrors>& e = part_of(scene[row]);
        if (!e || e->pixels == 0) continue;
        if (!sum) {
          sum = e;
          continue;
        }
        sum->pixels += e->pixels;
        const double share = static_cast<double>(e->pixels) / static_cast<double>(sum->pixels);
        sum->median += (e->median - sum->median) * share;
        sum->p95 += (e->p95 - sum->p95) * share;
        sum->bias += (e->bias - sum->bias) * share;
        sum->trimmed_relative_squared += (e->trimmed_relative_squared - sum->trimmed_relative_squared) * share;
      }
      return sum;
    };
    mean.all = average([](const NightErrors& e) -> const std::optional<LuminanceErrors>& { return e.all; });
    for (std::size_t i = 0; i < kJudgedLabels.size(); ++i) {
      mean.by_label[i] =
          average([i](const NightErrors& e) -> const std::optional<LuminanceErrors>& { return e.by_label[i]; });
    }
    for (const std::vector<NightErrors>& scene : scenes) {
      mean.picture.psnr_db += scene[row].picture.psnr_db / n;
      mean.picture.ssim += scene[row].picture.ssim / n;
      mean.flip += scene[row].flip / n;
    }
    out.push_back(std::move(mean));
  }
  return out;
}

OrderedJson to_json(const std::vector<NightErrors>& rows) {
  const auto errors = [](const std::optional<LuminanceErrors>& e) -> OrderedJson {
    if (!e) return nullptr;
    return {{"pixels", e->pixels},
            {"median", e->median},
            {"p95", e->p95},
            {"bias", e->bias},
            {"trimmed_relative_squared", e->trimmed_relative_squared}};
  };
  OrderedJson out = OrderedJson::array();
  for (const NightErrors& row : rows) {
    OrderedJson json = {{"night", row.name}, {"log2_luminance", errors(row.all)}};
    OrderedJson labels;
    for (std::size_t i = 0; i < kJudgedLabels.size(); ++i) {
      labels[kLabels[kJudgedLabels[i]].name] = errors(row.by_label[i]);
    }
    json["by_label"] = std::move(labels);
    json["psnr_db"] = row.picture.psnr_db;
    json["ssim"] = row.picture.ssim;
    json["flip"] = row.flip;
    out.push_back(std::move(json));
  }
  return out;
}

void print_table(const std::vector<NightErrors>& rows) {
  const auto cell = [](int width, int digits, const std::optional<LuminanceErrors>& e,
                       double LuminanceErrors::*member) {
    if (e) {
      std::printf(" %*.*f", width, digits, (*e).*member);
    } else {
      std::printf(" %*s", width, "-");
    }
  };
  std::printf("\n%-30s %6s %6s %6s %6s |", "night: |log2(L / true L)|", "median", "95th", "bias", "rSE");
  for (const Label l : kJudgedLabels) std::printf(" %15.15s", kLabels[l].name);
  std::printf(" | %6s %6s %6s\n", "PSNR", "SSIM", "FLIP");
  for (const NightErrors& row : rows) {
    std::printf("%-30s", row.name.c_str());
    cell(6, 3, row.all, &LuminanceErrors::median);
    cell(6, 2, row.all, &LuminanceErrors::p95);
    cell(6, 2, row.all, &LuminanceErrors::bias);
    cell(6, 2, row.all, &LuminanceErrors::trimmed_relative_squared);
    std::printf(" |");
    for (const std::optional<LuminanceErrors>& e : row.by_label) {
      cell(7, 3, e, &LuminanceErrors::median);
      cell(7, 2, e, &LuminanceErrors::bias);
    }
    std::printf(" | %6.2f %6.3f %6.3f\n", row.picture.psnr_db, row.picture.ssim, row.flip);
  }
}

}  // namespace npsim::tool
