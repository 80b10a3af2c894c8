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

struct MarkedShape {
  ReflectorClass cls = ReflectorClass::none;
  std::vector<ShapePoint> corners;  // none: nothing is drawn
};

inline Expected<ReflectorClass> reflector_class(const JsonObject& shape) {
  const Expected<std::string> name = shape.text("class");
  if (!name) return name.error();
  for (std::size_t i = 1; i < kReflectorNames.size(); ++i) {
    if (name.value() == kReflectorNames[i]) return static_cast<ReflectorClass>(i);
  }
  return Error{shape.file(), shape.field("class"),
               "is '" + name.value() + "', expected number_plate, vest or sheeting"};
}

// Draws the shapes that shape_of(object) makes of the list `key`, one over the other; check(root) may refuse the file.
template <class Check, class ShapeOf>
Expected<Image<ReflectorClass>> draw_listed(const std::string& path, const char* key, Shape shape,
                                            const ReadLimits& limits, const Check& check, const ShapeOf& shape_of) {
  const Expected<Json> json = read_json(path, limits);
  if (!json) return json.error();
  const Expected<JsonObject> root = JsonObject::of(path, "", json.value());
  if (!root) return root.error();
  if (const Outcome checked = check(root.value()); !checked) return checked.error();
  const Expected<const Json*> list = root.value().list(key);
  if (!list) return list.error();
  Image<ReflectorClass> out(shape);
  for (std::size_t i = 0; i < list.value()->size(); ++i) {
    const auto object = JsonObject::of(path, std::string(key) + "[" + std::to_string(i) + "]", (*list.value())[i]);
    if (!object) return object.error();
    const Expected<MarkedShape> marked = shape_of(object.value());
    if (!marked) return marked.error();
    if (!marked.value().corners.empty()) draw_shape(marked.value().corners, marked.value().cls, out.view());
  }
  return out;
}

inline Expected<Image<ReflectorClass>> read_reflector_shapes(const std::string& path, Shape shape,
                                                             const ReadLimits& limits) {
  const auto any = [](const JsonObject&) -> Outcome { return Done{}; };
  return draw_listed(path, "reflectors", shape, limits, any, [](const JsonObject& o) -> Expected<MarkedShape> {
    if (const Outcome known = o.allow_only({"class", "rectangle", "polygon"}); !known) return known.error();
    const Expected<ReflectorClass> cls = reflector_class(o);
    if (!cls) return cls.error();
    Expected<std::vector<ShapePoint>> corners = shape_corners(o);
    if (!corners) return corners.error();
    return MarkedShape{cls.value(), std::move(corners.value())};
  });
}

inline Expected<Image<ReflectorClass>> read_cityscapes_plates(const std::string& path, Shape shape,
                                                              const ReadLimits& limits) {
  const auto of_image = [&](const JsonObject& root) -> Outcome {
    for (const auto& [key, size] :
         {std::pair<const char*, int>{"imgWidth", shape.width}, {"imgHeight", shape.height}}) {
      const Expected<std::int64_t> given = root.whole(key);
      if (!given) return given.error();
      if (given.value() == size) continue;
      return Error{path, key, "is " + std::to_string(given.value()) + ", expected the image's " + std::to_string(size)};
    }
    return Done{};
  };
  return draw_listed(path, "objects", shape, limits, of_image, [](const JsonObject& o) -> Expected<MarkedShape> {
    // What was deleted, and what has no area, is drawn nowhere.
    const Json none;
    const Json& deleted = o.has("deleted") ? o.value()["deleted"] : none;
    if (!deleted.is_null() && deleted != Json(false) && deleted != Json(0)) return MarkedShape{};
    Expected<std::vector<ShapePoint>> corners = shape_corners(o);
    if (!corners) return MarkedShape{};
    const Expected<std::string> label = o.text("label");
    if (!label) return label.error();
    return MarkedShape{label.value() == "license plate" ? ReflectorClass::number_plate : ReflectorClass::none,
                       std::move(corners.value())};
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
