// SPDX-License-Identifier: Apache-2.0
// The light-source set E of section 3.6.2 from a file: measured strengths and colours by class.
//
//   [{"class": "street_light_LT", "strength": 10000, "xy": [0.533, 0.415]},
//    {"class": "window_building", "strength": 12, "rg_bg": [1.9, 0.35]}]
// strength is in the unit of the class (see light/light_set.hpp: lm, cd or cd/m2). "rg_bg" is (r/g, b/g) in linear sRGB;
// sensor ratios must be taken through that sensor's colour matrix first.
#ifndef NPSIM_IO_LIGHT_SET_HPP
#define NPSIM_IO_LIGHT_SET_HPP

#include <cstddef>
#include <string>
#include <vector>

#include "npsim/core/vec.hpp"
#include "npsim/io/detail/json_fields.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"
#include "npsim/labels/light_classes.hpp"
#include "npsim/light/light_set.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

// Chromaticity of linear sRGB (ratio_r, 1, ratio_b), IEC 61966-2-1 primaries.
[[nodiscard]] inline Vec2f xy_of_ratios(double ratio_r, double ratio_b) {
  const double x = 0.4124 * ratio_r + 0.3576 + 0.1805 * ratio_b;
  const double y = 0.2126 * ratio_r + 0.7152 + 0.0722 * ratio_b;
  const double z = 0.0193 * ratio_r + 0.1192 + 0.9505 * ratio_b;
  const double sum = x + y + z;
  return {static_cast<float>(x / sum), static_cast<float>(y / sum)};
}

inline Expected<Vec2<double>> number_pair(const JsonObject& object, const char* key) {
  const Expected<const Json*> list = object.list(key);
  if (!list) return list.error();
  const Json& v = *list.value();
  if (v.size() != 2 || !v[0].is_number() || !v[1].is_number()) {
    return Error{object.file(), object.field(key), "expected a list of two numbers"};
  }
  return Vec2<double>{v[0].get<double>(), v[1].get<double>()};
}

inline Expected<LightSetEntry> light_set_entry(const JsonObject& object) {
  if (const Outcome known = object.allow_only({"class", "strength", "xy", "rg_bg"}); !known) return known.error();
  const Expected<std::string> name = object.text("class");
  if (!name) return name.error();
  LightSetEntry entry;
  for (std::size_t i = 1; i < kLightClasses.size(); ++i) {
    const auto cls = static_cast<LightClass>(i);
    if (name.value() == info(cls).name && !is_group(cls)) entry.cls = cls;
  }
  if (entry.cls == LightClass::none) {
    return Error{object.file(), object.field("class"),
                 "is '" + name.value() + "', expected one of the 12 light-source classes, such as window_building"};
  }
  const Expected<double> strength = object.number("strength");
  if (!strength) return strength.error();
  if (!(strength.value() > 0 && strength.value() <= 1e7)) {
    return Error{object.file(), object.field("strength"), "expected more than 0 and at most 1e7 (lm, cd or cd/m2)"};
  }
  entry.strength = static_cast<float>(strength.value());
  const bool ratios = object.has("rg_bg");
  if (ratios == object.has("xy")) {
    return Error{object.file(), object.field("xy"), "expected either xy or rg_bg, one of them"};
  }
  const Expected<Vec2<double>> pair = number_pair(object, ratios ? "rg_bg" : "xy");
  if (!pair) return pair.error();
  const Vec2<double> p = pair.value();
  if (ratios ? !(p.x >= 0 && p.y >= 0 && p.x <= 100 && p.y <= 100) : !(p.x > 0 && p.y > 0 && p.x + p.y <= 1)) {
    return Error{object.file(), object.field(ratios ? "rg_bg" : "xy"),
                 ratios ? "expected ratios of 0 to 100" : "expected x and y inside the CIE triangle"};
  }
  entry.xy = ratios ? xy_of_ratios(p.x, p.y) : Vec2f{static_cast<float>(p.x), static_cast<float>(p.y)};
  return entry;
}

}  // namespace detail

inline Expected<std::vector<LightSetEntry>> read_light_set(const std::string& path, const ReadLimits& limits = {}) {
  const Expected<Json> json = read_json(path, limits);
  if (!json) return json.error();
  if (!json.value().is_array() || json.value().empty()) {
    return Error{path, "", "expected a non-empty list of {class, strength, xy or rg_bg}"};
  }
  std::vector<LightSetEntry> entries;
  for (std::size_t i = 0; i < json.value().size(); ++i) {
    const Expected<JsonObject> object = JsonObject::of(path, "[" + std::to_string(i) + "]", json.value()[i]);
    if (!object) return object.error();
    const Expected<LightSetEntry> entry = detail::light_set_entry(object.value());
    if (!entry) return entry.error();
    entries.push_back(entry.value());
  }
  return entries;
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_LIGHT_SET_HPP
