// SPDX-License-Identifier: Apache-2.0
#include "hold_out.hpp"

#include <charconv>
#include <cstdio>
#include <system_error>
#include <utility>
#include <vector>

#include "depth_recorder.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/random.hpp"
#include "npsim/io/image.hpp"
#include "simple_fill.hpp"
#include "tool/engine.hpp"

namespace npsim::tool {
namespace {

enum Role : std::uint8_t { kUnjudged, kKept, kLeftOut, kNeither };  // neither given nor judged

// The depth without the strip at the left border that a stereo pair cannot see: it is no measure of anything.
[[nodiscard]] io::Image<float> seen_by_both(const SceneView& scene, const RefineDepthParams& steps, DepthSource source,
                                            ThreadPool& pool) {
  io::Image<float> out(scene.shape());
  copy_pixels(scene.depth, out.view());
  if (source != DepthSource::stereo) return out;
  OutlierParams strip = refine_detail::scaled_outliers(steps, scene.shape());
  strip.speck_radius_px = 0;
  (void)drop_outliers(strip, scene.depth, {}, {0, -1, 0}, 0.0F, scene.camera,
                      stereo_focal_baseline_px_m(steps.source, scene), out.view(), pool)
      .ok();
  return out;
}

// The same without what was measured beyond the borders of near objects at their depth, and, by stereo, beyond those of
// plants and signs within their drawn outlines.
[[nodiscard]] io::Image<float> without_spill(const SceneView& scene, const RefineDepthParams& steps, DepthSource source,
                                             ImageView<const float> seen, ThreadPool& pool) {
  io::Image<float> out(scene.shape());
  copy_pixels(seen, out.view());
  const ObjectMap objects{scene.labels, scene.labels.empty() ? ImageView<const std::uint16_t>() : scene.instances};
  std::vector<unsigned char> memory(refine_depth_workspace_bytes(steps, scene.shape()));
  Workspace workspace(memory.data(), memory.size());
  GroundPlane ground;  // without inliers unless it is found
  (void)estimate_ground(steps.ground, scene.depth, scene.labels, scene.camera, workspace, ground).ok();
  (void)refine_detail::drop_spill(steps, scene, objects, source, ground, out.view(), workspace, pool).ok();
  ImageView<Label> labels;
  if (source == DepthSource::stereo && !scene.labels.empty() &&
      refine_detail::own_labels(steps, scene, workspace, pool, labels).ok()) {
    drop_depth_of_outlines(steps.outlines, scene.labels, ImageView<const Label>(labels), scene.depth, out.view(), pool);
  }
  return out;
}

// What becomes of each pixel of the depth.
[[nodiscard]] io::Image<std::uint8_t> draw_roles(const HoldOut& params, const SceneView& scene,
                                                 ImageView<const float> seen, ImageView<const float> own,
                                                 HoldOutResult& out) {
  const Shape shape = scene.shape();
  io::Image<std::uint8_t> roles(shape);
  const int across = shape.width / kHoldOutBlock_px + 1;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      roles(x, y) = kUnjudged;
      if (!is_valid_depth(scene.depth(x, y))) continue;
      if (!scene.labels.empty() && kNoSurfaceLabels.contains(scene.labels(x, y))) continue;
      const int key = params.blocks ? y / kHoldOutBlock_px * across + x / kHoldOutBlock_px : y * shape.width + x;
      RandomStream random(params.seed, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(key), 0);
      const bool out_of_it = static_cast<double>(random.uniform()) < params.share;
      roles(x, y) = out_of_it ? kLeftOut : kKept;
      if (!is_valid_depth(own(x, y))) {
        if (out_of_it) roles(x, y) = kNeither;
        ++(is_valid_depth(seen(x, y)) ? out.spilled : out.false_strip);
        continue;
      }
      ++out.measured;
      out.left_out += out_of_it ? 1U : 0U;
    }
  }
  return roles;
}

// All pixels of one role that are in the group.
[[nodiscard]] io::Image<std::uint8_t> mask_of(const SceneView& scene, const io::Image<std::uint8_t>& roles, Role role,
                                              std::size_t group) {
  io::Image<std::uint8_t> mask(roles.shape());
  for (int y = 0; y < mask.height(); ++y) {
    for (int x = 0; x < mask.width(); ++x) {
      mask(x, y) = roles(x, y) == role && in_group(scene.labels, group, x, y) ? 1 : 0;
    }
  }
  return mask;
}

}  // namespace

io::Expected<HoldOut> parse_hold_out(const std::string& text) {
  HoldOut out;
  const std::size_t comma = text.find(',');
  const std::string number = text.substr(0, comma);
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), out.share);
  out.blocks = comma != std::string::npos;
  const bool form = !out.blocks || text.substr(comma) == ",blocks";
  if (form && error == std::errc() && end == number.data() + number.size() && out.share > 0 && out.share < 1) {
    return out;
  }
  return io::Error{"", "--hold-out", "expected a share between 0 and 1, or SHARE,blocks, got '" + text + "'"};
}

Status hold_out(const HoldOut& params, const SceneView& scene, const RefineDepthParams& steps, ThreadPool& pool,
                Console& console, HoldOutResult& out) {
  const Shape shape = scene.shape();
  out.source = scene.depth_source;
  if (out.source == DepthSource::unknown) {  // from all: what is left would look sparser than it is
    out.source = find_depth_source(steps.source, scene.depth, scene.labels);
  }
  const io::Image<float> seen = seen_by_both(scene, steps, out.source, pool);
  const io::Image<float> own = without_spill(scene, steps, out.source, seen.view(), pool);
  const io::Image<std::uint8_t> roles = draw_roles(params, scene, seen.view(), own.view(), out);
  out.labelled = !scene.labels.empty();
  io::Image<float> left(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) left(x, y) = roles(x, y) >= kLeftOut ? 0.0F : scene.depth(x, y);
  }
  SceneView rest = scene;
  rest.depth = left.view();
  rest.depth_source = out.source;

  const io::Image<std::uint8_t> kept = mask_of(scene, roles, kKept, 0);
  const auto judge = [&](std::string name, std::string key, ImageView<const float> depth) {
    HoldOutRow row;
    row.name = std::move(name);
    row.key = std::move(key);
    for (std::size_t g = 0; g < kLabelGroups.size(); ++g) {
      row.errors[g] = depth_shift(depth, scene.depth, mask_of(scene, roles, kLeftOut, g).view());
    }
    row.kept = depth_shift(depth, scene.depth, kept.view());
    out.rows.push_back(std::move(row));
  };
  // The yardsticks may not draw on what has no surface either.
  io::Image<float> samples(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) samples(x, y) = roles(x, y) == kKept ? scene.depth(x, y) : 0.0F;
  }
  judge("nearest neighbour", "nearest", filled_by_nearest(samples.view()).view());
  judge("linear in 1/z", "linear", filled_linearly(samples.view()).view());

  DepthRecorder recorder(console);
  std::vector<unsigned char> memory(refine_depth_workspace_bytes(steps, shape));
  Workspace workspace(memory.data(), memory.size());
  RefinedDepth refined;
  NPSIM_RETURN_IF_ERROR(engine::refine_depth(steps, rest, workspace, pool, recorder, refined));
  for (const auto& [stage, depth] : recorder.kept()) {
    judge(std::string("after ") + stage_name(stage), stage_key(stage), depth.view());
  }
  return {};
}

void print_table(const HoldOutResult& result) {
  std::printf("depth from %s: %zu measured pixels on surfaces, %zu of them left out (%.1f %%)\n\n",
              kDepthSourceNames[static_cast<std::size_t>(result.source)], result.measured, result.left_out,
              100 * share(result.left_out, result.measured));
  std::printf("%-30s %8s %8s %8s   %8s %8s %8s %8s\n", "relative error where left out", "mean", "median", "lost",
              "moved:", "mean", "median", "95th");
  for (const HoldOutRow& r : result.rows) {
    std::printf("%-30s %8.5f %8.5f %8zu   %8s %8.5f %8.5f %8.5f\n", r.name.c_str(), r.errors[0].mean,
                r.errors[0].median, r.errors[0].lost, "", r.kept.mean, r.kept.median, r.kept.most);
  }
  if (result.false_strip > 0) {
    std::printf("not judged: %zu pixels at the left border, where only one of two cameras looks\n", result.false_strip);
  }
  if (result.spilled > 0) {
    std::printf("not judged: %zu pixels behind the borders of near objects, at the depth of those\n", result.spilled);
  }
  if (!result.labelled) return;
  std::printf("\n%-30s", "mean by label");
  for (std::size_t g = 1; g < kLabelGroups.size(); ++g) std::printf(" %8s", kLabelGroups[g].name);
  std::printf("\n");
  for (const HoldOutRow& r : result.rows) {
    std::printf("%-30s", r.name.c_str());
    for (std::size_t g = 1; g < kLabelGroups.size(); ++g) {
      if (r.errors[g].pixels > 0) {
        std::printf(" %8.5f", r.errors[g].mean);
      } else {
        std::printf(" %8s", "-");
      }
    }
    std::printf("\n");
  }
}

OrderedJson to_json(const HoldOutResult& result) {
  OrderedJson steps = OrderedJson::array();
  for (const HoldOutRow& r : result.rows) {
    OrderedJson errors = OrderedJson::object();
    for (std::size_t g = 0; g < kLabelGroups.size(); ++g) errors[kLabelGroups[g].name] = to_json(r.errors[g]);
    steps.push_back({{"step", r.key}, {"left_out", std::move(errors)}, {"kept_moved", to_json(r.kept)}});
  }
  return {{"source", kDepthSourceNames[static_cast<std::size_t>(result.source)]},
          {"measured", result.measured},
          {"left_out", result.left_out},
          {"false_strip", result.false_strip},
          {"spilled", result.spilled},
          {"steps", std::move(steps)}};
}

}  // namespace npsim::tool
