// SPDX-License-Identifier: Apache-2.0
// What is marked as sending headlamps back, in one of three forms:
//
//   shapes               {"reflectors": [{"class": "number_plate", "rectangle": [x0, y0, x1, y1]},
//                                        {"class": "vest", "polygon": [[x, y], [x, y], [x, y]]}]}
//   cityscapes_polygons  *_gtFine_polygons.json: what is left of its objects "license plate", which label images leave
//                        out, when later objects are drawn over earlier ones
//   ids                  a PNG of one channel: 0 none, 1 number_plate, 2 vest, 3 sheeting
// Coordinates and pixels of a shape: as in light_shapes.hpp.
#ifndef NPSIM_IO_DETAIL_REFLECTORS_HPP
#define NPSIM_IO_DETAIL_REFLECTORS_HPP

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "npsim/core/scene_view.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/detail/json_fields.hpp"
#include "npsim/io/detail/light_shapes.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/png_jpeg.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

inline Expected<ReflectorClass> reflector_class(const JsonObject& shape) {
  const Expected<std::string> name = shape.text("class");
  if (!name) return name.error();
  for (std::size_t i = 1; i < kReflectorNames.size(); ++i) {
    if (name.value() == kReflectorNames[i]) return static_cast<ReflectorClass>(i);
  }
  return Error{shape.file(), shape.field("class"),
               "is '" + name.value() + "', expected number_plate, vest or sheeting"};
}

// Draws the objects of the list `key` for which counts(object), one over the other, each as class_of(object).
template <class Counts, class ClassOf>
Expected<Image<ReflectorClass>> draw_reflectors(const JsonObject& root, const char* key, Shape shape,
                                                const Counts& counts, const ClassOf& class_of) {
  const Expected<const Json*> list = root.list(key);
  if (!list) return list.error();
  Image<ReflectorClass> out(shape);
  for (std::size_t i = 0; i < list.value()->size(); ++i) {
    const auto object =
        JsonObject::of(root.file(), std::string(key) + "[" + std::to_string(i) + "]", (*list.value())[i]);
    if (!object) return object.error();
    if (!counts(object.value())) continue;
    const Expected<ReflectorClass> cls = class_of(object.value());
    if (!cls) return cls.error();
    const Expected<std::vector<ShapePoint>> corners = shape_corners(object.value());
    if (!corners) return corners.error();
    draw_shape(corners.value(), cls.value(), out.view());
  }
  return out;
}

inline Expected<Image<ReflectorClass>> read_reflector_shapes(const std::string& path, Shape shape,
                                                             const ReadLimits& limits) {
  const Expected<Json> json = read_json(path, limits);
  if (!json) return json.error();
  const Expected<JsonObject> root = JsonObject::of(path, "", json.value());
  if (!root) return root.error();
  const auto all = [](const JsonObject&) { return true; };
  return draw_reflectors(root.value(), "reflectors", shape, all, [](const JsonObject& o) -> Expected<ReflectorClass> {
    if (const Outcome known = o.allow_only({"class", "rectangle", "polygon"}); !known) return known.error();
    return reflector_class(o);
  });
}

inline Expected<Image<ReflectorClass>> read_cityscapes_plates(const std::string& path, Shape shape,
                                                              const ReadLimits& limits) {
  const Expected<Json> json = read_json(path, limits);
  if (!json) return json.error();
  const Expected<JsonObject> root = JsonObject::of(path, "", json.value());
  if (!root) return root.error();
  for (const auto& [key, size] : {std::pair<const char*, int>{"imgWidth", shape.width}, {"imgHeight", shape.height}}) {
    const Expected<std::int64_t> given = root.value().whole(key);
    if (!given) return given.error();
    if (given.value() == size) continue;
    return Error{path, key, "is " + std::to_string(given.value()) + ", expected the image's " + std::to_string(size)};
  }
  // What was deleted, and what has no area, is drawn nowhere.
  const auto counts = [](const JsonObject& o) {
    const Json none;
    const Json& deleted = o.has("deleted") ? o.value()["deleted"] : none;
    return (deleted.is_null() || deleted == Json(false) || deleted == Json(0)) && shape_corners(o).ok();
  };
  return draw_reflectors(root.value(), "objects", shape, counts, [](const JsonObject& o) -> Expected<ReflectorClass> {
    const Expected<std::string> label = o.text("label");
    if (!label) return label.error();
    return label.value() == "license plate" ? ReflectorClass::number_plate : ReflectorClass::none;
  });
}

inline Expected<Image<ReflectorClass>> read_reflector_ids(const std::string& path, Shape shape,
                                                          const ReadLimits& limits) {
  const Expected<Image<std::uint16_t>> plane = read_u16(path, limits);
  if (!plane) return plane.error();
  if (const Outcome same = expect_shape(path, plane.value().shape(), shape, "the image"); !same) return same.error();
  Image<ReflectorClass> out(shape);
  for (std::size_t i = 0; i < shape.pixels(); ++i) {
    const std::uint16_t id = plane.value().data()[i];
    if (id >= kReflectorNames.size()) {
      return Error{path, "pixels", "one of them is " + std::to_string(id) + ", expected 0 to 3"};
    }
    out.data()[i] = static_cast<ReflectorClass>(id);
  }
  return out;
}

}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_REFLECTORS_HPP
