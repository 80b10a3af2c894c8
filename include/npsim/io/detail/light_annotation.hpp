// SPDX-License-Identifier: Apache-2.0
// Inactive-light-source annotations in (table 3.1): a Segments.ai release or COCO panoptic JSON, and its id bitmap;
// or a plain list of rectangles and polygons.
//
// Marks come in the order of the file; the index plane holds position + 1, 0 is no light. Bitmap pixels spell ids as
// R + 256 G + 65536 B, 0 = none, alpha ignored. Groups are marks of their own: their pixels are the parts of the
// object (panel, car) that are no source themselves.
// What is marked along the rim of a traffic light is no lens (detail/signal_rims.hpp).
// A source whose entry names no group joins the group that may hold its class (can_hold) and whose bounding box in the
// bitmap overlaps its own most, where one overlaps at all; the first in the file wins a tie.
#ifndef NPSIM_IO_DETAIL_LIGHT_ANNOTATION_HPP
#define NPSIM_IO_DETAIL_LIGHT_ANNOTATION_HPP

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "npsim/core/image_view.hpp"
#include "npsim/io/detail/json_fields.hpp"
#include "npsim/io/detail/light_entries.hpp"
#include "npsim/io/detail/light_shapes.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/detail/signal_rims.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/labels/light_classes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

// Whether a group of one class may hold a source of another: table 3.1's definitions, read as sets.
[[nodiscard]] constexpr bool can_hold(LightClass group, LightClass source) noexcept {
  const bool lamp = source == LightClass::parked_front || source == LightClass::parked_rear ||
                    source == LightClass::moving_front || source == LightClass::moving_rear;
  switch (group) {
    case LightClass::windows_group: return source == LightClass::window_building;
    case LightClass::car_group:
    case LightClass::truck_group: return lamp || source == LightClass::window_parked;
    case LightClass::bus_group:
    case LightClass::train_group:
      return lamp || source == LightClass::window_parked || source == LightClass::window_transport;
    case LightClass::bicycle_group:
    case LightClass::motorcycle_group: return lamp;
    case LightClass::traffic_light_group: return source == LightClass::inferred_object;
    case LightClass::traffic_sign_group:
      return source == LightClass::inferred_object || source == LightClass::advertisement ||
             source == LightClass::clock;
    default: return false;
  }
}

struct LightAnnotation {
  std::vector<LightMark> marks;
  Image<std::uint16_t> index;      // position + 1 in marks, 0 = none
  std::vector<std::string> notes;  // what was found, joined or left without pixels
};

enum class LightAnnotationFormat : std::uint8_t { segments_ai, coco_panoptic };

namespace detail {

struct PixelBox {
  int left = 0, top = 0, right = -1, bottom = -1;  // px, inclusive; empty where right < left

  void include(int x, int y) {
    if (right < left) {
      *this = {x, y, x, y};
      return;
    }
    left = std::min(left, x);
    right = std::max(right, x);
    top = std::min(top, y);
    bottom = std::max(bottom, y);
  }
};

[[nodiscard]] inline std::int64_t overlap_px(const PixelBox& a, const PixelBox& b) noexcept {
  const std::int64_t w = std::min(a.right, b.right) - std::max(a.left, b.left) + 1;
  const std::int64_t h = std::min(a.bottom, b.bottom) - std::max(a.top, b.top) + 1;
  return w > 0 && h > 0 ? w * h : 0;
}

// Marks from entries: classes known, ids unique, groups resolved where the entries name them.
inline Outcome make_marks(const std::string& json_path, const std::vector<LightEntry>& entries,
                          std::unordered_map<std::uint32_t, std::uint16_t>& positions, LightAnnotation& out) {
  constexpr std::size_t kMostMarks = 65534;
  if (entries.size() > kMostMarks) {
    return Error{json_path, "annotations", std::to_string(entries.size()) + " marks, expected at most 65534"};
  }
  for (const LightEntry& entry : entries) {
    const std::string field = "annotation " + std::to_string(entry.id);
    if (entry.id <= 0 || entry.id > 0xFFFFFF) {
      return Error{json_path, field + ".id", "is outside its range, expected 1 to 16777215"};
    }
    LightMark mark;
    mark.id = static_cast<std::uint32_t>(entry.id);
    mark.cls = light_class_from_name(entry.category);
    mark.state = entry.state;
    if (mark.cls == LightClass::none) {
      return Error{json_path, field + ".category_id",
                   "names '" + entry.category + "', expected one of the 21 light classes such as window_building"};
    }
    const auto position = static_cast<std::uint16_t>(out.marks.size() + 1);
    if (!positions.emplace(mark.id, position).second) {
      return Error{json_path, field + ".id", "is given twice, expected unique ids"};
    }
    out.marks.push_back(mark);
  }
  for (std::size_t i = 0; i < entries.size(); ++i) {
    LightMark& mark = out.marks[i];
    if (entries[i].group == LightEntry::kNoGroup) continue;
    const std::string field = "annotation " + std::to_string(mark.id) + ".attributes.group";
    const std::int64_t group = entries[i].group;
    const auto found =
        group > 0 && group <= 0xFFFFFF ? positions.find(static_cast<std::uint32_t>(group)) : positions.end();
    if (found == positions.end() || !is_group(out.marks[found->second - 1U].cls)) {
      return Error{json_path, field, "is " + std::to_string(group) + ", expected the id of a group annotation"};
    }
    if (is_group(mark.cls)) {
      if (static_cast<std::uint32_t>(group) == mark.id) continue;  // a group may name itself
      return Error{json_path, field, "stands at a group, expected it at light sources only"};
    }
    mark.group = found->second;
    const LightClass cls = out.marks[found->second - 1U].cls;
    if (!can_hold(cls, mark.cls)) {
      out.notes.push_back("lights: " + std::string(info(mark.cls).name) + " " + std::to_string(mark.id) +
                          " belongs to a " + info(cls).name + ", as the file says");
    }
  }
  return Done{};
}

// Joins sources without a group to the one that overlaps them most. Returns how many were joined.
inline std::size_t join_groups(const std::vector<PixelBox>& boxes, std::vector<LightMark>& marks) {
  std::size_t joined = 0;
  for (std::size_t i = 0; i < marks.size(); ++i) {
    if (is_group(marks[i].cls) || marks[i].group != 0) continue;
    std::int64_t best = 0;
    for (std::size_t g = 0; g < marks.size(); ++g) {
      if (!can_hold(marks[g].cls, marks[i].cls)) continue;
      const std::int64_t overlap = overlap_px(boxes[i], boxes[g]);
      if (overlap <= best) continue;
      best = overlap;
      marks[i].group = static_cast<std::uint16_t>(g + 1);
    }
    if (best > 0) ++joined;
  }
  return joined;
}

}  // namespace detail

namespace detail {

// What is left when the index plane is filled: boxes, groups that are joined by them, and notes.
inline void finish_annotation(LightAnnotation& out) {
  const auto boxes_of_marks = [&] {
    std::vector<PixelBox> boxes(out.marks.size());
    for (int y = 0; y < out.index.height(); ++y) {
      for (int x = 0; x < out.index.width(); ++x) {
        if (out.index(x, y) != 0) boxes[out.index(x, y) - 1U].include(x, y);
      }
    }
    return boxes;
  };
  const std::size_t joined = join_groups(boxes_of_marks(), out.marks);
  const std::size_t trimmed = trim_signal_rims(out.marks, out.index);
  const std::vector<PixelBox> boxes = boxes_of_marks();
  std::size_t groups = 0;
  constexpr std::size_t kNamed = 8;
  std::size_t without_pixels = 0;
  std::string named;
  for (std::size_t i = 0; i < out.marks.size(); ++i) {
    groups += is_group(out.marks[i].cls) ? 1U : 0U;
    if (boxes[i].right < boxes[i].left) {
      if (++without_pixels <= kNamed) named += (named.empty() ? "" : ", ") + std::to_string(out.marks[i].id);
    }
  }
  out.notes.insert(out.notes.begin(), "lights: " + std::to_string(out.marks.size() - groups) + " sources and " +
                                          std::to_string(groups) + " groups");
  if (joined > 0) {
    out.notes.push_back("lights: " + std::to_string(joined) + " sources joined to the group that overlaps them");
  }
  if (trimmed > 0) {
    out.notes.push_back("lights: " + std::to_string(trimmed) +
                        " parts of marks along the rims of traffic lights taken for no lamps");
  }
  if (without_pixels > 0) {
    out.notes.push_back("lights: " + std::to_string(without_pixels) + " annotations without pixels: " + named +
                        (without_pixels > kNamed ? ", ..." : ""));
  }
}

// Position + 1 of the mark whose id each pixel of the bitmap spells.
inline Outcome read_light_bitmap(const std::string& bitmap_path, const std::string& json_path,
                                 const std::unordered_map<std::uint32_t, std::uint16_t>& positions,
                                 const ReadLimits& limits, Image<std::uint16_t>& index) {
  const Expected<Image<Rgba8>> bitmap = read_rgba8(bitmap_path, limits);
  if (!bitmap) return bitmap.error();
  const Outcome same = expect_shape(bitmap_path, bitmap.value().shape(), index.shape(), "the image");
  if (!same) return same;
  std::uint32_t last_id = 0;
  std::uint16_t last_position = 0;
  for (int y = 0; y < index.height(); ++y) {
    for (int x = 0; x < index.width(); ++x) {
      const Rgba8& p = bitmap.value()(x, y);
      const std::uint32_t id = p[0] + 256U * p[1] + 65536U * p[2];
      if (id == 0) continue;
      if (id != last_id) {
        const auto found = positions.find(id);
        if (found == positions.end()) {
          return Error{bitmap_path, "pixel (" + std::to_string(x) + ", " + std::to_string(y) + ")",
                       "has id " + std::to_string(id) + ", expected 0 or an id with an entry in " + json_path};
        }
        last_id = id;
        last_position = found->second;
      }
      index(x, y) = last_position;
    }
  }
  return Done{};
}

}  // namespace detail

inline Expected<LightAnnotation> read_light_annotation(LightAnnotationFormat format, const std::string& json_path,
                                                       const std::string& bitmap_path, Shape image_shape,
                                                       const ReadLimits& limits = {}) {
  return guarded(json_path, [&]() -> Expected<LightAnnotation> {
    const Expected<Json> json = read_json(json_path, limits);
    if (!json) return json.error();
    const Expected<std::vector<detail::LightEntry>> entries =
        format == LightAnnotationFormat::segments_ai
            ? detail::segments_ai_entries(json_path, json.value(), bitmap_path)
            : detail::coco_panoptic_entries(json_path, json.value(), bitmap_path);
    if (!entries) return entries.error();
    LightAnnotation out;
    out.index = Image<std::uint16_t>(image_shape);
    std::unordered_map<std::uint32_t, std::uint16_t> positions;
    const Outcome made = detail::make_marks(json_path, entries.value(), positions, out);
    if (!made) return made.error();
    const Outcome read = detail::read_light_bitmap(bitmap_path, json_path, positions, limits, out.index);
    if (!read) return read.error();
    detail::finish_annotation(out);
    return out;
  });
}

// A list of rectangles and polygons; see detail/light_shapes.hpp.
inline Expected<LightAnnotation> read_light_shapes(const std::string& json_path, Shape image_shape,
                                                   const ReadLimits& limits = {}) {
  return guarded(json_path, [&]() -> Expected<LightAnnotation> {
    const Expected<Json> json = read_json(json_path, limits);
    if (!json) return json.error();
    const Expected<detail::LightShapes> shapes = detail::light_shapes(json_path, json.value());
    if (!shapes) return shapes.error();
    LightAnnotation out;
    out.index = Image<std::uint16_t>(image_shape);
    std::unordered_map<std::uint32_t, std::uint16_t> positions;
    const Outcome made = detail::make_marks(json_path, shapes.value().entries, positions, out);
    if (!made) return made.error();
    for (const bool groups : {true, false}) {
      for (const detail::LightPiece& piece : shapes.value().pieces) {
        if (is_group(out.marks[piece.entry].cls) != groups) continue;
        detail::draw_shape(piece.corners, static_cast<std::uint16_t>(piece.entry + 1), out.index.view());
      }
    }
    detail::finish_annotation(out);
    return out;
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_LIGHT_ANNOTATION_HPP
