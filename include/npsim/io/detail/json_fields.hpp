// SPDX-License-Identifier: Apache-2.0
// JSON in, with errors that name file and field. Nothing throws: what the parser throws becomes an Error here.
//
// A key that is given twice is an error, and allow_only() makes an error of any key the caller does not know, so that
// a typing mistake is never silently a default.
#ifndef NPSIM_IO_DETAIL_JSON_FIELDS_HPP
#define NPSIM_IO_DETAIL_JSON_FIELDS_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

using Json = nlohmann::json;

inline Expected<Json> read_json(const std::string& path, const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<Json> {
    const Expected<Bytes> file = read_file_bytes(path, limits);
    if (!file) return file.error();
    const Bytes& bytes = file.value();
    std::vector<std::set<std::string>> open;  // keys of the objects around the parser's position
    std::string repeated;
    const Json::parser_callback_t watch = [&](int, Json::parse_event_t event, Json& parsed) {
      if (event == Json::parse_event_t::object_start) open.emplace_back();
      if (event == Json::parse_event_t::object_end && !open.empty()) open.pop_back();
      if (event == Json::parse_event_t::key && !open.empty() &&
          !open.back().insert(parsed.get_ref<const std::string&>()).second && repeated.empty()) {
        repeated = parsed.get<std::string>();
      }
      return true;
    };
    try {
      Json value = Json::parse(bytes.begin(), bytes.end(), watch);
      if (!repeated.empty()) return Error{path, repeated, "is given twice in one object, expected once"};
      return Expected<Json>(std::move(value));
    } catch (const Json::parse_error& caught) {
      std::size_t line = 1;
      for (std::size_t i = 0; i + 1 < caught.byte && i < bytes.size(); ++i) line += bytes[i] == '\n' ? 1U : 0U;
      return Error{path, "line " + std::to_string(line),
                   "is not valid JSON at byte " + std::to_string(caught.byte) + ", expected a complete JSON value"};
    } catch (const Json::exception&) {
      return Error{path, "", "is not valid JSON: a number or text is out of range, expected ordinary values"};
    }
  });
}

// A name in a file that describes other files: relative to that file's folder, or absolute.
[[nodiscard]] inline std::string resolved_path(const std::string& beside, const std::string& name) {
  const std::filesystem::path p(name);
  return p.is_absolute() ? name : (std::filesystem::path(beside).parent_path() / p).string();
}

// A view of one JSON value that is to be an object; it lives no longer than the document.
class JsonObject {
 public:
  static Expected<JsonObject> of(const std::string& file, const std::string& name, const Json& value) {
    if (!value.is_object()) return Error{file, name, std::string("is ") + kind(value) + ", expected an object {...}"};
    return JsonObject(file, name, value);
  }

  [[nodiscard]] const std::string& file() const { return file_; }
  [[nodiscard]] std::string field(const std::string& key) const { return name_.empty() ? key : name_ + "." + key; }
  [[nodiscard]] bool has(const char* key) const { return value_->contains(key); }

  Outcome allow_only(std::initializer_list<const char*> keys) const {
    for (const auto& item : value_->items()) {
      bool known = false;
      std::string list;
      for (const char* key : keys) {
        known = known || item.key() == key;
        list += (list.empty() ? "" : ", ") + std::string(key);
      }
      if (!known) return Error{file_, field(item.key()), "is an unknown key, expected one of: " + list};
    }
    return Done{};
  }

  Expected<const Json*> required(const char* key) const {
    const auto found = value_->find(key);
    if (found == value_->end()) return Error{file_, field(key), "is missing, expected this key"};
    return &*found;
  }
  Expected<std::string> text(const char* key) const {
    const Expected<const Json*> found = required(key);
    if (!found) return found.error();
    if (!found.value()->is_string() || found.value()->get_ref<const std::string&>().empty()) {
      return Error{file_, field(key), std::string("is ") + kind(*found.value()) + ", expected a non-empty text"};
    }
    return found.value()->get<std::string>();
  }
  Expected<double> number(const char* key) const {
    const Expected<const Json*> found = required(key);
    if (!found) return found.error();
    if (!found.value()->is_number() || !std::isfinite(found.value()->get<double>())) {
      return Error{file_, field(key), std::string("is ") + kind(*found.value()) + ", expected a number"};
    }
    return found.value()->get<double>();
  }
  Expected<std::int64_t> whole(const char* key) const {
    const Expected<const Json*> found = required(key);
    if (!found) return found.error();
    const Json& v = *found.value();
    constexpr std::int64_t kMost = std::int64_t{1} << 53;
    const bool fits = v.is_number_unsigned() ? v.get<std::uint64_t>() <= static_cast<std::uint64_t>(kMost)
                                             : v.is_number_integer() && v.get<std::int64_t>() >= -kMost;
    if (!fits) return Error{file_, field(key), std::string("is ") + kind(v) + ", expected a whole number"};
    return v.get<std::int64_t>();
  }
  Expected<const Json*> list(const char* key) const {
    const Expected<const Json*> found = required(key);
    if (!found) return found.error();
    if (!found.value()->is_array()) {
      return Error{file_, field(key), std::string("is ") + kind(*found.value()) + ", expected a list [...]"};
    }
    return found.value();
  }
  Expected<JsonObject> object(const char* key) const {
    const Expected<const Json*> found = required(key);
    if (!found) return found.error();
    return of(file_, field(key), *found.value());
  }
  [[nodiscard]] const Json& value() const { return *value_; }

  [[nodiscard]] static const char* kind(const Json& v) {
    if (v.is_null()) return "null";
    if (v.is_boolean()) return "true or false";
    if (v.is_number()) return "a number";
    if (v.is_string()) return v.get_ref<const std::string&>().empty() ? "an empty text" : "a text";
    return v.is_array() ? "a list" : "an object";
  }

 private:
  JsonObject(std::string file, std::string name, const Json& value)
      : file_(std::move(file)), name_(std::move(name)), value_(&value) {}
  std::string file_;
  std::string name_;
  const Json* value_;
};

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_JSON_FIELDS_HPP
