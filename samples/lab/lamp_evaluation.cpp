// SPDX-License-Identifier: Apache-2.0
#include "lamp_evaluation.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "npsim/labels/light_classes.hpp"

namespace npsim::tool {
namespace {

[[nodiscard]] Quartiles quartiles(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {
    return values[static_cast<std::size_t>(std::lround(share * static_cast<double>(values.size() - 1)))];
  };
  return {at(0.25), at(0.5), at(0.75)};
}

[[nodiscard]] LampClassErrors class_errors(LightClass cls, Span<const LightMark> marks, Span<const Emitter> placed,
                                           Span<const io::TrueEmitter> truth, const Vec3f& up) {
  LampClassErrors errors;
  errors.cls = cls;
  std::vector<double> distance, range, height, axis, area;
  for (const io::TrueEmitter& t : truth) {
    const auto mark = std::find_if(marks.begin(), marks.end(), [&](const LightMark& m) { return m.id == t.mark; });
    if (t.mark == 0 || mark == marks.end() || mark->cls != cls) continue;
    ++errors.marked;
    const auto position = static_cast<std::uint16_t>(mark - marks.begin() + 1);
    const auto e = std::find_if(placed.begin(), placed.end(), [&](const Emitter& p) { return p.mark == position; });
    if (e == placed.end()) continue;
    ++errors.placed;
    const Vec3d off = vec_cast<double>(e->centre_m) - vec_cast<double>(t.centre_m);
    distance.push_back(length(off));
    range.push_back(ratio(length(vec_cast<double>(e->centre_m)), length(vec_cast<double>(t.centre_m))));
    height.push_back(dot(vec_cast<double>(up), off));
    const double cosine = dot(vec_cast<double>(e->axis), vec_cast<double>(t.axis));
    axis.push_back(std::acos(std::clamp(cosine, -1.0, 1.0)) * 57.29577951308232);
    const float one_side = t.closed ? 0.5F * t.area_m2 : t.area_m2;
    const float true_area = e->profile == EmissionProfile::lambert ? one_side : t.seen_area_m2;
    area.push_back(ratio(static_cast<double>(e->area_m2), static_cast<double>(true_area)));
  }
  errors.distance_m = quartiles(std::move(distance));
  errors.range = quartiles(std::move(range));
  errors.height_m = quartiles(std::move(height));
  errors.axis_deg = quartiles(std::move(axis));
  errors.area = quartiles(std::move(area));
  return errors;
}

[[nodiscard]] const char* class_name(LightClass cls) { return kLightClasses[static_cast<std::size_t>(cls)].name; }

[[nodiscard]] OrderedJson to_json(const Quartiles& q) {
  return {{"lower_quartile", q.low}, {"median", q.median}, {"upper_quartile", q.high}};
}

}  // namespace

Status placed_lamps(const PlacementParams& params, const SceneView& scene, const RefinedDepth& refined,
                    std::vector<Emitter>& out) {
  out.clear();
  if (scene.light_index.empty() || scene.lights.empty()) return {};
  std::vector<unsigned char> memory(placement_workspace_bytes(params, scene.shape()));
  out.resize(scene.lights.size());
  std::size_t count = 0;
  Workspace workspace(memory.data(), memory.size());
  NPSIM_RETURN_IF_ERROR(
      place_lights(params, placement_scene(scene, refined), workspace, Span<Emitter>(out.data(), out.size()), count));
  out.resize(count);
  return {};
}

std::vector<LampClassErrors> lamp_errors(Span<const LightMark> marks, Span<const Emitter> placed,
                                         Span<const io::TrueEmitter> truth, const Vec3f& up) {
  std::vector<LampClassErrors> all;
  for (int c = 1; c < kLightClassCount; ++c) {
    LampClassErrors errors = class_errors(static_cast<LightClass>(c), marks, placed, truth, up);
    if (errors.marked > 0) all.push_back(errors);
  }
  return all;
}

OrderedJson to_json(const LampErrors& errors) {
  OrderedJson json = {{"placed_by", errors.key}};
  OrderedJson& classes = json["classes"] = OrderedJson::object();
  for (const LampClassErrors& c : errors.classes) {
    classes[class_name(c.cls)] = {{"marked", c.marked},
                                  {"placed", c.placed},
                                  {"distance_m", to_json(c.distance_m)},
                                  {"range_ratio", to_json(c.range)},
                                  {"height_m", to_json(c.height_m)},
                                  {"axis_deg", to_json(c.axis_deg)},
                                  {"area_ratio", to_json(c.area)}};
  }
  return json;
}

void print_table(const LampErrors& errors) {
  std::printf("\n%-28s %7s %7s %23s %20s %20s %17s %20s\n", ("lamps by " + errors.key).c_str(), "marked", "placed",
              "metres off (quartiles)", "range / true", "metres above", "axis, degrees", "area / true");
  for (const LampClassErrors& c : errors.classes) {
    const auto cell = [](const Quartiles& q, int width, int digits) {
      std::printf(" %*.*f %*.*f %*.*f", width, digits, q.low, width, digits, q.median, width, digits, q.high);
    };
    std::printf("%-28s %7zu %7zu", class_name(c.cls), c.marked, c.placed);
    cell(c.distance_m, 7, 2);
    cell(c.range, 6, 3);
    cell(c.height_m, 6, 2);
    cell(c.axis_deg, 5, 1);
    cell(c.area, 6, 2);
    std::printf("\n");
  }
}

}  // namespace npsim::tool
