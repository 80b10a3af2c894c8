// SPDX-License-Identifier: Apache-2.0
// A light annotation by hand: a plain list of rectangles and polygons, in pixels of the image.
//
//   {"lights": [{"class": "street_light_HT", "rectangle": [x0, y0, x1, y1]},
//               {"class": "window_building", "polygon": [[x, y], [x, y], [x, y]], "id": 7, "group": 3}]}
// Coordinates count from the image's upper left corner, so pixel (0, 0) reaches from 0 to 1, and need not be whole. A
// pixel belongs to the last shape that holds its centre (even-odd rule), to a group only where no source holds it; a
// shape between centres gets the pixel of its middle. Where `id` is left out it is the position in the list, from 1, or
// a number that no entry has, if that is taken. Shapes of one id and class are pieces of one object, each of which may
// say its group and state. `group` and `state` are those of the other formats.
#ifndef NPSIM_IO_DETAIL_LIGHT_SHAPES_HPP
#define NPSIM_IO_DETAIL_LIGHT_SHAPES_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "npsim/core/image_view.hpp"
#include "npsim/io/detail/json_fields.hpp"
#include "npsim/io/detail/light_entries.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"
#include "npsim/labels/light_classes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

struct ShapePoint {
  double x, y;
};

// One rectangle or polygon of an entry.
struct LightPiece {
  std::size_t entry = 0;
  std::vector<ShapePoint> corners;
};

struct LightShapes {
  std::vector<LightEntry> entries;
  std::vector<LightPiece> pieces;
};

inline Expected<ShapePoint> shape_point(const JsonObject& object, const std::string& field, const Json& x,
                                        const Json& y) {
  if (!x.is_number() || !y.is_number() || !(std::fabs(x.get<double>()) < 1e6) || !(std::fabs(y.get<double>()) < 1e6)) {
    return Error{object.file(), field, "holds something else than coordinates, expected numbers of pixels"};
  }
  return ShapePoint{x.get<double>(), y.get<double>()};
}

inline Expected<std::vector<ShapePoint>> shape_corners(const JsonObject& object) {
  if (object.has("rectangle") == object.has("polygon")) {
    return Error{object.file(), object.field("rectangle"), "stands with or without polygon, expected one of the two"};
  }
  const bool rectangle = object.has("rectangle");
  const Expected<const Json*> list = object.list(rectangle ? "rectangle" : "polygon");
  if (!list) return list.error();
  const Json& values = *list.value();
  std::vector<ShapePoint> corners;
  if (rectangle) {
    const std::string field = object.field("rectangle");
    if (values.size() != 4) return Error{object.file(), field, "expected [x0, y0, x1, y1]"};
    const Expected<ShapePoint> a = shape_point(object, field, values[0], values[1]);
    if (!a) return a.error();
    const Expected<ShapePoint> b = shape_point(object, field, values[2], values[3]);
    if (!b) return b.error();
    corners = {a.value(), {b.value().x, a.value().y}, b.value(), {a.value().x, b.value().y}};
    return corners;
  }
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::string field = object.field("polygon[" + std::to_string(i) + "]");
    if (!values[i].is_array() || values[i].size() != 2) return Error{object.file(), field, "expected a corner [x, y]"};
    const Expected<ShapePoint> corner = shape_point(object, field, values[i][0], values[i][1]);
    if (!corner) return corner.error();
    corners.push_back(corner.value());
  }
  if (corners.size() < 3) return Error{object.file(), object.field("polygon"), "expected at least three corners"};
  return corners;
}

inline Expected<LightEntry> shape_entry(const JsonObject& o) {
  if (const Outcome known = o.allow_only({"class", "id", "group", "state", "rectangle", "polygon"}); !known) {
    return known.error();
  }
  LightEntry entry;
  const Expected<std::string> category = o.text("class");
  if (!category) return category.error();
  entry.category = category.value();
  if (light_class_from_name(entry.category) == LightClass::none) {
    std::string names;
    for (std::size_t i = 1; i < kLightClasses.size(); ++i)
      names += (i > 1 ? ", " : "") + std::string(kLightClasses[i].name);
    return Error{o.file(), o.field("class"), "is '" + entry.category + "', expected one of: " + names};
  }
  if (o.has("id")) {
    const Expected<std::int64_t> id = o.whole("id");
    if (!id) return id.error();
    entry.id = id.value();
  }
  if (const Outcome read = read_attributes(o, entry); !read) return read.error();
  if (!o.has("state") || entry.state != SignalState::unknown) return entry;
  const Json& state = o.value()["state"];
  if (state.is_null() || plain_name(state.get<std::string>()) == "unknown") return entry;
  return Error{o.file(), o.field("state"),
               "is '" + state.get<std::string>() + "', expected red, amber, green or unknown"};
}

inline Expected<LightShapes> light_shapes(const std::string& path, const Json& json) {
  const Expected<JsonObject> root = JsonObject::of(path, "", json);
  if (!root) return root.error();
  const Expected<const Json*> list = root.value().list("lights");
  if (!list) return list.error();
  LightShapes out;
  std::unordered_map<std::int64_t, std::size_t> given;  // position in entries by the id that the file gives
  std::vector<std::size_t> unnamed;                     // places in the list, from 0, of those without
  for (std::size_t i = 0; i < list.value()->size(); ++i) {
    const auto object = JsonObject::of(path, "lights[" + std::to_string(i) + "]", (*list.value())[i]);
    if (!object) return object.error();
    const JsonObject& o = object.value();
    const Expected<LightEntry> entry = shape_entry(o);
    if (!entry) return entry.error();
    Expected<std::vector<ShapePoint>> corners = shape_corners(o);
    if (!corners) return corners.error();
    std::size_t position = out.entries.size();
    if (o.has("id")) {
      const auto [found, is_new] = given.emplace(entry.value().id, position);
      position = found->second;
      if (!is_new && plain_name(out.entries[position].category) != plain_name(entry.value().category)) {
        return Error{path, o.field("id"),
                     "is that of a " + out.entries[position].category +
                         ", expected another, or the same class for a piece of it"};
      }
    } else {
      unnamed.push_back(i);
    }
    if (position == out.entries.size()) out.entries.push_back(entry.value());
    LightEntry& whole = out.entries[position];
    const LightEntry& piece = entry.value();
    const bool groups = piece.group != LightEntry::kNoGroup && piece.group != whole.group;
    const bool states = piece.state != SignalState::unknown && piece.state != whole.state;
    if ((groups && whole.group != LightEntry::kNoGroup) || (states && whole.state != SignalState::unknown)) {
      return Error{path, o.field(groups ? "group" : "state"),
                   "differs from that of another piece of the object, expected the same"};
    }
    if (groups) whole.group = piece.group;
    if (states) whole.state = piece.state;
    out.pieces.push_back({position, std::move(corners.value())});
  }
  auto free = static_cast<std::int64_t>(list.value()->size());
  for (const std::size_t i : unnamed) {
    const std::size_t position = out.pieces[i].entry;
    auto id = static_cast<std::int64_t>(i) + 1;
    while (!given.emplace(id, position).second) id = ++free;
    out.entries[position].id = id;
  }
  return out;
}

// Sets the pixels of the shape, clipped to the image.
template <class T>
void draw_shape(const std::vector<ShapePoint>& corners, T value, ImageView<T> out) {
  double low = corners[0].y, high = corners[0].y, middle_x = 0, middle_y = 0;
  for (const ShapePoint& p : corners) {
    low = std::min(low, p.y);
    high = std::max(high, p.y);
    middle_x += p.x / static_cast<double>(corners.size());
    middle_y += p.y / static_cast<double>(corners.size());
  }
  bool any = false;
  const int first = std::max(0, static_cast<int>(std::floor(low)));
  const int last = std::min(out.height() - 1, static_cast<int>(std::floor(high)));
  std::vector<double> crossings;
  for (int y = first; y <= last; ++y) {
    crossings.clear();
    const double centre = y + 0.5;
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const ShapePoint& a = corners[i];
      const ShapePoint& b = corners[(i + 1) % corners.size()];
      if ((a.y <= centre) == (b.y <= centre)) continue;
      crossings.push_back(a.x + (centre - a.y) / (b.y - a.y) * (b.x - a.x));
    }
    std::sort(crossings.begin(), crossings.end());
    for (std::size_t i = 0; i + 1 < crossings.size(); i += 2) {
      const int left = std::max(0, static_cast<int>(std::ceil(crossings[i] - 0.5)));
      const int right = std::min(out.width(), static_cast<int>(std::ceil(crossings[i + 1] - 0.5)));
      for (int x = left; x < right; ++x) out(x, y) = value;
      any = any || left < right;
    }
  }
  const int x = static_cast<int>(std::floor(middle_x));
  const int y = static_cast<int>(std::floor(middle_y));
  if (!any && out.contains(x, y)) out(x, y) = value;
}

}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_LIGHT_SHAPES_HPP
