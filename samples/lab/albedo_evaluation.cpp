// SPDX-License-Identifier: Apache-2.0
#include "albedo_evaluation.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>

#include "npsim/color/srgb.hpp"
#include "npsim/io/image.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "tool/daylight.hpp"
#include "tool/engine.hpp"

namespace npsim::tool {
namespace {

constexpr float kDarkest = 0.02F;
constexpr double kTwoModes = 0.7;  // log2
constexpr double kFewest = 0.05;

struct Group {
  const char* name;
  LabelSet labels;
};
constexpr std::array<Group, 6> kGroups = {{
    {"all", LabelSet::all()},
    {"road", LabelSet::of(label::road, label::parking)},
    {"pavement", LabelSet::of(label::sidewalk, label::ground)},
    {"facade", LabelSet::of(label::building, label::wall)},
    {"vehicle", kVehicleLabels},
    {"foliage", LabelSet::of(label::vegetation)},
}};

[[nodiscard]] double log2_of(float v) { return std::log2(static_cast<double>(std::max(v, kDarkest))); }

[[nodiscard]] double median(std::vector<double> v) {
  if (v.empty()) return kNone;
  const auto middle = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
  std::nth_element(v.begin(), middle, v.end());
  return *middle;
}

// A pixel of asphalt: log2 of its light, and of estimate over truth.
struct Asphalt {
  double light, error;
};

// The threshold between two modes: between the means of the classes that differ most (Otsu 1979), then in the middle of
// their medians.
[[nodiscard]] double between_modes(std::vector<Asphalt>& pixels, double& apart) {
  std::sort(pixels.begin(), pixels.end(), [](const Asphalt& a, const Asphalt& b) { return a.light < b.light; });
  double all = 0.0;
  for (const Asphalt& p : pixels) all += p.light;
  const auto n = static_cast<double>(pixels.size());
  double below = 0.0, best = -1.0;
  std::size_t cut = 0;
  for (std::size_t i = 0; i + 1 < pixels.size(); ++i) {
    below += pixels[i].light;
    const double k = static_cast<double>(i + 1);
    const double off = below / k - (all - below) / (n - k);
    const double between = k * (n - k) * off * off;
    if (between <= best) continue;
    best = between;
    cut = i + 1;
  }
  const double low = pixels[cut / 2].light;
  const double high = pixels[cut + (pixels.size() - cut) / 2].light;
  apart = high - low;
  return 0.5 * (low + high);
}

void judge_shadow(std::vector<Asphalt>& pixels, AlbedoErrors& out) {
  if (pixels.size() < 100) return;
  double apart = 0.0;
  const double threshold = between_modes(pixels, apart);
  std::vector<double> sunlit, shadowed;
  for (const Asphalt& p : pixels) (p.light < threshold ? shadowed : sunlit).push_back(p.error);
  out.light_ratio = std::exp2(apart);
  out.sunlit_share = share(sunlit.size(), pixels.size());
  if (apart < kTwoModes || std::min(out.sunlit_share, 1.0 - out.sunlit_share) < kFewest) return;
  out.sunlit_over_shadowed = std::exp2(median(sunlit) - median(shadowed));
}

}  // namespace

Status albedo_errors(const AlbedoParams& params, const SceneView& scene, ImageView<const Vec3f> true_albedo,
                     const RefinedDepth& refined, ThreadPool& pool, AlbedoErrors& out) {
  const Shape shape = scene.shape();
  std::vector<unsigned char> memory(guessed_albedo_workspace_bytes(params, shape));
  Workspace workspace(memory.data(), memory.size());
  io::Image<Vec3f> albedo(shape);
  AlbedoScene day;
  NPSIM_RETURN_IF_ERROR(albedo_scene(scene, refined, workspace, day));
  NPSIM_RETURN_IF_ERROR(
      engine::estimate_albedo(params, day, workspace, AlbedoEstimate{albedo.view(), {}}, out.report, pool));
  const auto label_at = [&](int x, int y) { return scene.labels.empty() ? label::unlabeled : scene.labels(x, y); };
  const auto judged = [&](int x, int y) {
    return refined.surface(x, y) != 0 && (scene.labels.empty() || label_at(x, y) > label::out_of_roi);
  };
  std::vector<double> off;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (judged(x, y)) off.push_back(log2_of(luminance(albedo(x, y))) - log2_of(luminance(true_albedo(x, y))));
    }
  }
  out.common_log2 = median(off);
  if (off.empty()) return {};

  std::array<double, kGroups.size()> sums{}, signed_sums{};
  std::array<std::size_t, kGroups.size()> counts{};
  struct Car {
    double truth = 0.0, estimate = 0.0;
    std::size_t pixels = 0;
  };
  std::map<std::uint16_t, Car> cars;
  std::vector<Asphalt> asphalt;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (!judged(x, y)) continue;
      const float truth = luminance(true_albedo(x, y));
      const float estimate = luminance(albedo(x, y));
      const double error = log2_of(estimate) - log2_of(truth) - out.common_log2;
      for (std::size_t g = 0; g < kGroups.size(); ++g) {
        if (!kGroups[g].labels.contains(label_at(x, y))) continue;
        sums[g] += std::fabs(error);
        signed_sums[g] += error;
        ++counts[g];
      }
      constexpr float kPaint = 0.165F;  // albedo: asphalt is darker
      if (label_at(x, y) == label::road && truth < kPaint) {
        const double seen = std::log2(static_cast<double>(std::max(luminance(srgb_decode8(scene.image(x, y))), 1e-4F)));
        asphalt.push_back({seen - log2_of(truth), error});
      }
      if (label_at(x, y) == label::car && !scene.instances.empty()) {
        Car& car = cars[scene.instances(x, y)];
        car.truth += static_cast<double>(truth);
        car.estimate += static_cast<double>(estimate);
        ++car.pixels;
      }
    }
  }
  for (std::size_t g = 0; g < kGroups.size(); ++g) {
    const auto n = static_cast<double>(counts[g]);
    out.groups.push_back({kGroups[g].name, counts[g], ratio(sums[g], n), counts[g] > 0 ? signed_sums[g] / n : kNone});
  }
  for (const auto& [instance, car] : cars) {
    if (car.pixels * 1300 < shape.pixels()) continue;
    const auto n = static_cast<double>(car.pixels);
    out.cars.push_back({instance, car.truth / n, car.estimate / n});
  }
  judge_shadow(asphalt, out);
  return {};
}

OrderedJson to_json(const AlbedoErrors& e) {
  OrderedJson groups = OrderedJson::object();
  for (const AlbedoGroupErrors& g : e.groups) {
    groups[g.name] = {{"pixels", g.pixels}, {"mean_abs_log2", g.mean_log2}, {"bias_log2", g.bias_log2}};
  }
  OrderedJson cars = OrderedJson::array();
  for (const CarAlbedo& c : e.cars) {
    cars.push_back({{"instance", c.instance}, {"truth", c.truth}, {"estimate", c.estimate}});
  }
  return {{"common_log2", e.common_log2},
          {"groups", std::move(groups)},
          {"sunlit_over_shadowed_asphalt", e.sunlit_over_shadowed},
          {"light_ratio", e.light_ratio},
          {"sunlit_share", e.sunlit_share},
          {"found", to_json(e.report)},
          {"cars", std::move(cars)}};
}

void print_table(const AlbedoErrors& e) {
  std::printf("\n%-30s %9s %9s %9s\n", "albedo, estimated", "pixels", "|log2|", "bias");
  for (const AlbedoGroupErrors& g : e.groups) {
    if (g.pixels > 0) std::printf("%-30s %9zu %9.3f %9.3f\n", g.name.c_str(), g.pixels, g.mean_log2, g.bias_log2);
  }
  if (std::isfinite(e.sunlit_over_shadowed)) {
    std::printf("sunlit over shadowed asphalt, estimated to true: %.2f (of light %.1f, sunlit %.0f %%)\n",
                e.sunlit_over_shadowed, e.light_ratio, 100 * e.sunlit_share);
  }
}

}  // namespace npsim::tool
