// SPDX-License-Identifier: Apache-2.0
// The entries of a light annotation, taken out of the two JSON layouts that hold them.
//
// Segments.ai release: dataset.task_attributes.categories, dataset.samples[].labels.<set>.attributes.annotations.
// COCO panoptic: categories, images, annotations[].segments_info. Both: {id, category_id, attributes: {group, state}},
// in COCO also directly in the segment. Where a file describes several images, the entry of the bitmap's name counts.
#ifndef NPSIM_IO_DETAIL_LIGHT_ENTRIES_HPP
#define NPSIM_IO_DETAIL_LIGHT_ENTRIES_HPP

#include <cctype>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <initializer_list>
#include <string>
#include <unordered_map>
#include <vector>

#include "npsim/io/detail/json_fields.hpp"
#include "npsim/io/error.hpp"
#include "npsim/labels/light_classes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

struct LightEntry {
  static constexpr std::int64_t kNoGroup = -1;
  std::int64_t id = 0;
  std::string category;
  std::int64_t group = kNoGroup;  // id of the group's entry
  SignalState state = SignalState::unknown;
};

// Lower case, with one kind of separator: annotation tools differ in both.
[[nodiscard]] inline std::string plain_name(const std::string& name) {
  std::string out;
  for (const char c : name) {
    out += c == ' ' || c == '-' ? '_' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return out;
}

[[nodiscard]] inline LightClass light_class_from_name(const std::string& name) {
  const std::string wanted = plain_name(name);
  for (std::size_t i = 1; i < kLightClasses.size(); ++i) {
    if (plain_name(kLightClasses[i].name) == wanted) return static_cast<LightClass>(i);
  }
  return LightClass::none;
}

[[nodiscard]] inline SignalState signal_state_from_name(const std::string& name) {
  const std::string s = plain_name(name);
  if (s == "red") return SignalState::red;
  if (s == "amber" || s == "yellow" || s == "orange") return SignalState::amber;
  return s == "green" ? SignalState::green : SignalState::unknown;
}

// The last part of a path or URL.
[[nodiscard]] inline std::string base_name(const std::string& path) {
  std::string name = path.substr(0, path.find_first_of("?#"));
  const std::size_t slash = name.find_last_of("/\\");
  return slash == std::string::npos ? name : name.substr(slash + 1);
}

using CategoryNames = std::unordered_map<std::int64_t, std::string>;

inline Expected<CategoryNames> category_names(const JsonObject& holder) {
  const Expected<const Json*> list = holder.list("categories");
  if (!list) return list.error();
  CategoryNames names;
  for (std::size_t i = 0; i < list.value()->size(); ++i) {
    const auto category =
        JsonObject::of(holder.file(), holder.field("categories[" + std::to_string(i) + "]"), (*list.value())[i]);
    if (!category) return category.error();
    const Expected<std::int64_t> id = category.value().whole("id");
    if (!id) return id.error();
    const Expected<std::string> name = category.value().text("name");
    if (!name) return name.error();
    names[id.value()] = name.value();
  }
  return names;
}

// "group" and "state" where an object has them; null counts as absent, a group may be a number or digits.
inline Outcome read_attributes(const JsonObject& object, LightEntry& entry) {
  if (object.has("group") && !object.value()["group"].is_null()) {
    const Json& group = object.value()["group"];
    if (group.is_string()) {
      const std::string& text = group.get_ref<const std::string&>();
      const bool digits =
          !text.empty() && text.size() < 10 && text.find_first_not_of("0123456789") == std::string::npos;
      if (!digits)
        return Error{object.file(), object.field("group"), "is '" + text + "', expected the id of a group annotation"};
      entry.group = std::atoll(text.c_str());
    } else {
      const Expected<std::int64_t> number = object.whole("group");
      if (!number) return number.error();
      if (number.value() < 0)
        return Error{object.file(), object.field("group"), "is negative, expected the id of a group annotation"};
      entry.group = number.value();
    }
  }
  if (object.has("state") && !object.value()["state"].is_null()) {
    if (!object.value()["state"].is_string())
      return Error{object.file(), object.field("state"), "is no text, expected red, amber, green or unknown"};
    entry.state = signal_state_from_name(object.value()["state"].get<std::string>());
  }
  return Done{};
}

inline Expected<std::vector<LightEntry>> light_entries(const JsonObject& holder, const char* key,
                                                       const CategoryNames& names) {
  const Expected<const Json*> list = holder.list(key);
  if (!list) return list.error();
  std::vector<LightEntry> entries;
  for (std::size_t i = 0; i < list.value()->size(); ++i) {
    const auto object = JsonObject::of(holder.file(), holder.field(std::string(key) + "[" + std::to_string(i) + "]"),
                                       (*list.value())[i]);
    if (!object) return object.error();
    const JsonObject& o = object.value();
    LightEntry entry;
    const Expected<std::int64_t> id = o.whole("id");
    if (!id) return id.error();
    entry.id = id.value();
    const Expected<std::int64_t> category = o.whole("category_id");
    if (!category) return category.error();
    const auto name = names.find(category.value());
    if (name == names.end()) {
      return Error{o.file(), o.field("category_id"),
                   "is " + std::to_string(category.value()) + " (annotation " + std::to_string(entry.id) +
                       "), expected an id of the categories"};
    }
    entry.category = name->second;
    const Outcome direct = read_attributes(o, entry);
    if (!direct) return direct.error();
    if (o.has("attributes") && !o.value()["attributes"].is_null()) {
      const Expected<JsonObject> attributes = o.object("attributes");
      if (!attributes) return attributes.error();
      const Outcome read = read_attributes(attributes.value(), entry);
      if (!read) return read.error();
    }
    entries.push_back(entry);
  }
  return entries;
}

// The text at a chain of keys, or nothing.
[[nodiscard]] inline std::string text_at(const Json& value, std::initializer_list<const char*> keys) {
  const Json* at = &value;
  for (const char* key : keys) {
    if (!at->is_object() || !at->contains(key)) return {};
    at = &(*at)[key];
  }
  return at->is_string() ? at->get<std::string>() : std::string();
}

inline Expected<std::vector<LightEntry>> segments_ai_entries(const std::string& path, const Json& json,
                                                             const std::string& bitmap_path) {
  const Expected<JsonObject> root = JsonObject::of(path, "", json);
  if (!root) return root.error();
  const Expected<JsonObject> dataset = root.value().object("dataset");
  if (!dataset) return dataset.error();
  const Expected<JsonObject> task = dataset.value().object("task_attributes");
  if (!task) return task.error();
  const Expected<CategoryNames> names = category_names(task.value());
  if (!names) return names.error();
  const Expected<const Json*> samples = dataset.value().list("samples");
  if (!samples) return samples.error();

  // Every label of every sample is a candidate; the bitmap's file name decides between several.
  const std::string wanted = base_name(bitmap_path);
  const Json* only = nullptr;
  const Json* named = nullptr;
  std::string only_field;
  std::string named_field;
  std::size_t candidates = 0;
  for (std::size_t i = 0; i < samples.value()->size(); ++i) {
    const Json& sample = (*samples.value())[i];
    if (!sample.is_object() || !sample.contains("labels") || !sample["labels"].is_object()) continue;
    for (const auto& item : sample["labels"].items()) {
      if (!item.value().is_object()) continue;  // null: not labelled
      const std::string field = "dataset.samples[" + std::to_string(i) + "].labels." + item.key();
      ++candidates;
      only = &item.value();
      only_field = field;
      if (base_name(text_at(item.value(), {"attributes", "segmentation_bitmap", "url"})) != wanted) continue;
      named = &item.value();
      named_field = field;
    }
  }
  const Json* chosen = named != nullptr ? named : candidates == 1 ? only : nullptr;
  if (chosen == nullptr) {
    return Error{path, "dataset.samples",
                 std::to_string(candidates) + " labels, none with the bitmap " + wanted +
                     ", expected one with it or exactly one label"};
  }
  const auto labelled = JsonObject::of(path, named != nullptr ? named_field : only_field, *chosen);
  if (!labelled) return labelled.error();
  const Expected<JsonObject> attributes = labelled.value().object("attributes");
  if (!attributes) return attributes.error();
  return light_entries(attributes.value(), "annotations", names.value());
}

inline Expected<std::vector<LightEntry>> coco_panoptic_entries(const std::string& path, const Json& json,
                                                               const std::string& bitmap_path) {
  const Expected<JsonObject> root = JsonObject::of(path, "", json);
  if (!root) return root.error();
  const Expected<CategoryNames> names = category_names(root.value());
  if (!names) return names.error();
  const Expected<const Json*> annotations = root.value().list("annotations");
  if (!annotations) return annotations.error();
  const std::size_t count = annotations.value()->size();
  const std::string wanted = base_name(bitmap_path);
  std::size_t chosen = count;
  for (std::size_t i = 0; i < count; ++i) {
    if (count == 1 || base_name(text_at((*annotations.value())[i], {"file_name"})) == wanted) chosen = i;
  }
  if (chosen == count) {
    return Error{path, "annotations",
                 std::to_string(count) + " images, none with the file_name " + wanted +
                     ", expected one with it or exactly one image"};
  }
  const auto annotation =
      JsonObject::of(path, "annotations[" + std::to_string(chosen) + "]", (*annotations.value())[chosen]);
  if (!annotation) return annotation.error();
  return light_entries(annotation.value(), "segments_info", names.value());
}

}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_LIGHT_ENTRIES_HPP
