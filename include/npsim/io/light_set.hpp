// SPDX-License-Identifier: Apache-2.0
// The light-source set E of section 3.6.2 from a file: measured strengths, colours and luminaires by class.
//
// As JSON:
//   [{"class": "street_light_LT", "strength": 10000, "xy": [0.533, 0.415]},
//    {"class": "street_light_HT", "luminaire": "lamp.ldt", "turn_deg": 90, "xy": [0.3756, 0.3723]},
//    {"class": "window_building", "strength": 12, "rg_bg": [1.9, 0.35]}]
// As CSV, by the name's ending, with the thesis' tuples {s, r/g, b/g} of section 3.2:
//   sensor_to_srgb,1.9,-0.7,-0.2,-0.3,1.6,-0.3,0,-0.5,1.5
//   class,s,r/g,b/g
//   window_building,12,1.4,0.5
// strength and s are in the unit of the class (see light/light_set.hpp: lm, cd or cd/m2); of a luminaire its measured
// flux where none is given. rg_bg is (r/g, b/g) in linear sRGB, as are the ratios of a CSV, unless a row before them
// gives the matrix, row by row, that takes the sensor's linear RGB there. Files of luminaires lie relative to this one.
#ifndef NPSIM_IO_LIGHT_SET_HPP
#define NPSIM_IO_LIGHT_SET_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "npsim/core/vec.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/detail/json_fields.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/luminaire.hpp"
#include "npsim/labels/light_classes.hpp"
#include "npsim/light/light_set.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

struct LightSet {
  std::vector<LightSetEntry> entries;
  std::vector<std::string> luminaire_files;                  // each once
  std::vector<std::unique_ptr<const Luminaire>> luminaires;  // which the entries point to

  [[nodiscard]] Span<const LightSetEntry> view() const { return {entries.data(), entries.size()}; }
};

namespace detail {

// Chromaticity of linear sRGB, IEC 61966-2-1 primaries; (0, 0) where it is none.
[[nodiscard]] inline Vec2f xy_of_linear_srgb(const Vec3d& rgb) {
  const double x = 0.4124 * rgb.x + 0.3576 * rgb.y + 0.1805 * rgb.z;
  const double y = 0.2126 * rgb.x + 0.7152 * rgb.y + 0.0722 * rgb.z;
  const double z = 0.0193 * rgb.x + 0.1192 * rgb.y + 0.9505 * rgb.z;
  if (!(x > 0 && y > 0 && z >= 0)) return {};
  return {static_cast<float>(x / (x + y + z)), static_cast<float>(y / (x + y + z))};
}

// One of the 12 that shine, else none.
[[nodiscard]] inline LightClass source_class(const std::string& name) {
  for (std::size_t i = 1; i < kLightClasses.size(); ++i) {
    const auto cls = static_cast<LightClass>(i);
    if (name == info(cls).name && !is_group(cls)) return cls;
  }
  return LightClass::none;
}

inline Error unknown_class(const std::string& file, const std::string& field, const std::string& name) {
  return {file, field, "is '" + name + "', expected one of the 12 light-source classes, such as window_building"};
}

inline constexpr double kMaxStrength = 1e7;
inline constexpr const char* kStrengthRange = "expected more than 0 and at most 1e7 (lm, cd or cd/m2)";

inline Expected<Vec2<double>> number_pair(const JsonObject& object, const char* key) {
  const Expected<const Json*> list = object.list(key);
  if (!list) return list.error();
  const Json& v = *list.value();
  if (v.size() != 2 || !v[0].is_number() || !v[1].is_number()) {
    return Error{object.file(), object.field(key), "expected a list of two numbers"};
  }
  return Vec2<double>{v[0].get<double>(), v[1].get<double>()};
}

inline Expected<LightSetEntry> light_set_entry(const JsonObject& object, const ReadLimits& limits, LightSet& set) {
  const Outcome known = object.allow_only({"class", "strength", "xy", "rg_bg", "luminaire", "turn_deg"});
  if (!known) return known.error();
  const Expected<std::string> name = object.text("class");
  if (!name) return name.error();
  LightSetEntry entry;
  entry.cls = source_class(name.value());
  if (entry.cls == LightClass::none) return unknown_class(object.file(), object.field("class"), name.value());
  if (object.has("luminaire")) {
    if (!is_street_lamp(entry.cls)) {
      return Error{object.file(), object.field("luminaire"), "is for street_light_HT and street_light_LT alone"};
    }
    const Expected<std::string> file = object.text("luminaire");
    if (!file) return file.error();
    const Expected<double> turn = object.has("turn_deg") ? object.number("turn_deg") : Expected<double>(0.0);
    if (!turn) return turn.error();
    if (!(std::fabs(turn.value()) <= 360.0)) {
      return Error{object.file(), object.field("turn_deg"), "expected -360 to 360 degrees"};
    }
    for (const LightSetEntry& other : set.entries) {
      if (other.cls == entry.cls && other.luminaire != nullptr) {
        return Error{object.file(), object.field("luminaire"),
                     "is the second one of this class, expected one: the optics of a lamp are not drawn"};
      }
    }
    const std::string path = resolved_path(object.file(), file.value());
    Expected<Luminaire> luminaire = read_luminaire(path, turn.value(), limits);
    if (!luminaire) return luminaire.error();
    set.luminaires.push_back(std::make_unique<const Luminaire>(std::move(luminaire.value())));
    set.luminaire_files.push_back(path);
    entry.luminaire = &set.luminaires.back()->table;
    entry.strength = entry.luminaire->flux_lm;
  } else if (object.has("turn_deg")) {
    return Error{object.file(), object.field("turn_deg"), "turns a luminaire, expected a luminaire too"};
  }
  if (entry.luminaire == nullptr || object.has("strength")) {
    const Expected<double> strength = object.number("strength");
    if (!strength) return strength.error();
    if (!(strength.value() > 0 && strength.value() <= kMaxStrength)) {
      return Error{object.file(), object.field("strength"), kStrengthRange};
    }
    entry.strength = static_cast<float>(strength.value());
  }
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
  entry.xy = ratios ? xy_of_linear_srgb({p.x, 1.0, p.y}) : Vec2f{static_cast<float>(p.x), static_cast<float>(p.y)};
  return entry;
}

inline Expected<LightSet> read_light_set_json(const std::string& path, const ReadLimits& limits) {
  const Expected<Json> json = read_json(path, limits);
  if (!json) return json.error();
  if (!json.value().is_array() || json.value().empty()) {
    return Error{path, "", "expected a non-empty list of {class, strength or luminaire, xy or rg_bg}"};
  }
  LightSet set;
  for (std::size_t i = 0; i < json.value().size(); ++i) {
    const Expected<JsonObject> object = JsonObject::of(path, "[" + std::to_string(i) + "]", json.value()[i]);
    if (!object) return object.error();
    const Expected<LightSetEntry> entry = light_set_entry(object.value(), limits, set);
    if (!entry) return entry.error();
    set.entries.push_back(entry.value());
  }
  return Expected<LightSet>(std::move(set));
}

[[nodiscard]] inline std::vector<std::string> csv_cells(std::string_view line) {
  std::vector<std::string> cells;
  for (;;) {
    const std::size_t comma = line.find(',');
    cells.emplace_back(trimmed(line.substr(0, comma)));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

inline Expected<LightSet> read_light_set_csv(const std::string& path, const ReadLimits& limits) {
  const Expected<Bytes> bytes = read_file_bytes(path, limits);
  if (!bytes) return bytes.error();
  const std::string text(bytes.value().begin(), bytes.value().end());
  std::array<double, 9> to_srgb{1, 0, 0, 0, 1, 0, 0, 0, 1};
  const std::vector<std::string> head = {"class", "s", "r/g", "b/g"};
  LightSet set;
  bool headed = false;
  std::string_view rest = text;
  for (std::size_t number = 1; !rest.empty(); ++number) {
    const std::size_t end = rest.find('\n');
    const std::string_view line = trimmed(rest.substr(0, end));
    rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    if (line.empty() || line.front() == '#') continue;
    const std::string where = "line " + std::to_string(number);
    const std::vector<std::string> cells = csv_cells(line);
    const auto numbers = [&](double* out, std::size_t n) {
      if (cells.size() != n + 1) return false;
      for (std::size_t i = 0; i < n; ++i) {
        if (!number_of(cells[i + 1], out[i])) return false;
      }
      return true;
    };
    if (!headed && cells[0] == "sensor_to_srgb") {
      if (!numbers(to_srgb.data(), 9)) return Error{path, where, "expected sensor_to_srgb and nine numbers, by rows"};
      continue;
    }
    if (!headed) {
      if (cells != head) return Error{path, where, "expected the head of the columns: class,s,r/g,b/g"};
      headed = true;
      continue;
    }
    std::array<double, 3> v{};
    if (!numbers(v.data(), 3)) return Error{path, where, "expected a class and three numbers: class,s,r/g,b/g"};
    const double s = v[0];
    const double rg = v[1];
    const double bg = v[2];
    LightSetEntry entry;
    entry.cls = source_class(cells[0]);
    if (entry.cls == LightClass::none) return unknown_class(path, where + ", class", cells[0]);
    if (!(s > 0 && s <= kMaxStrength)) return Error{path, where + ", s", kStrengthRange};
    if (!(rg >= 0 && bg >= 0 && rg <= 100 && bg <= 100)) {
      return Error{path, where + ", r/g and b/g", "expected ratios of 0 to 100"};
    }
    entry.strength = static_cast<float>(s);
    const auto row = [&](std::size_t i) { return to_srgb[i] * rg + to_srgb[i + 1] + to_srgb[i + 2] * bg; };
    entry.xy = xy_of_linear_srgb({row(0), row(3), row(6)});
    if (!(entry.xy.y > 0.0F)) {
      return Error{path, where + ", r/g and b/g",
                   "are no colour through sensor_to_srgb, expected ratios of that sensor"};
    }
    set.entries.push_back(entry);
  }
  if (set.entries.empty()) return Error{path, "", "has no rows, expected class,s,r/g,b/g and one row at least"};
  return Expected<LightSet>(std::move(set));
}

}  // namespace detail

inline Expected<LightSet> read_light_set(const std::string& path, const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<LightSet> {
    const std::string ending = std::filesystem::path(path).extension().string();
    const bool csv = ending == ".csv" || ending == ".CSV";
    return csv ? detail::read_light_set_csv(path, limits) : detail::read_light_set_json(path, limits);
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_LIGHT_SET_HPP
