// SPDX-License-Identifier: Apache-2.0
// Reads the headers as text: includes run one way, the core stays free of what it must not need, and every header
// begins as a header should.
#include <doctest/doctest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace {

struct Header {
  std::string name;  // relative to include/, for example npsim/core/span.hpp
  std::string area;  // core; empty for npsim.hpp itself
  std::string text;
};

std::string area_of(const std::string& name) {
  const std::size_t first = name.find('/');
  const std::size_t second = name.find('/', first + 1);
  return second == std::string::npos ? std::string() : name.substr(first + 1, second - first - 1);
}

std::string text_of(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

const std::vector<Header>& headers() {
  static const std::vector<Header> all = [] {
    std::vector<Header> found;
    const std::filesystem::path root = std::filesystem::path(NPSIM_SOURCE_DIR) / "include";
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root)) {
      if (!entry.is_regular_file() || entry.path().extension() != ".hpp") continue;
      const std::string name = std::filesystem::relative(entry.path(), root).generic_string();
      found.push_back({name, area_of(name), text_of(entry.path())});
    }
    std::sort(found.begin(), found.end(), [](const Header& a, const Header& b) { return a.name < b.name; });
    return found;
  }();
  return all;
}

bool for_hosts(const Header& header) {
  return header.area == "io" || header.area == "exec" || header.area == "interop";
}

std::vector<std::string> included(const std::string& text) {
  static const std::regex pattern(R"re((?:^|\n)[ \t]*#[ \t]*include[ \t]*[<"]([^>"]+)[>"])re");
  std::vector<std::string> names;
  for (std::sregex_iterator i(text.begin(), text.end(), pattern), end; i != end; ++i) names.push_back((*i)[1]);
  return names;
}

// The text with comments and the contents of string and character literals blanked.
std::string code_only(const std::string& text) {
  std::string blanked = text;
  enum class In { code, line_comment, block_comment, string, character } in = In::code;
  for (std::size_t i = 0; i < blanked.size(); ++i) {
    const char c = text[i];
    const char next = i + 1 < text.size() ? text[i + 1] : '\0';
    const bool digit_separator = i > 0 && std::isxdigit(static_cast<unsigned char>(text[i - 1])) != 0;
    switch (in) {
      case In::code:
        if (c == '/' && next == '/') in = In::line_comment;
        if (c == '/' && next == '*') in = In::block_comment;
        if (c == '"') in = In::string;
        if (c == '\'' && !digit_separator) in = In::character;
        if (in == In::line_comment || in == In::block_comment) blanked[i] = ' ';
        break;
      case In::line_comment:
        if (c == '\n')
          in = In::code;
        else
          blanked[i] = ' ';
        break;
      case In::block_comment:
        blanked[i] = c == '\n' ? c : ' ';
        if (c == '/' && i > 0 && text[i - 1] == '*') in = In::code;
        break;
      case In::string:
      case In::character:
        if (c == '\\') {
          blanked[i] = ' ';
          if (i + 1 < blanked.size()) blanked[++i] = ' ';
        } else if (c == (in == In::string ? '"' : '\'')) {
          in = In::code;
        } else {
          blanked[i] = ' ';
        }
        break;
    }
  }
  return blanked;
}

std::vector<std::string> words(const std::string& code) {
  static const std::regex pattern(R"([A-Za-z_][A-Za-z0-9_]*)");
  std::vector<std::string> found;
  for (std::sregex_iterator i(code.begin(), code.end(), pattern), end; i != end; ++i) found.push_back(i->str());
  return found;
}

std::string guard_of(const std::string& name) {
  std::string guard;
  for (const char c : name) {
    guard += std::isalnum(static_cast<unsigned char>(c)) != 0
                 ? static_cast<char>(std::toupper(static_cast<unsigned char>(c)))
                 : '_';
  }
  return guard;
}

const std::set<std::string> kCoreAreas = {"core",  "geometry", "simd",   "color",  "labels",  "depth",   "mesh",
                                          "trace", "light",    "material", "render", "sensor", "metrics", "pipeline"};

std::map<std::string, std::set<std::string>> allowed_includes() {
  std::map<std::string, std::set<std::string>> allowed = {
      {"core", {}},
      {"simd", {"core"}},
      {"color", {"core", "simd"}},
      {"labels", {"core"}},
      {"geometry", {"core", "labels"}},
      {"depth", {"core", "simd", "color", "labels", "geometry"}},
      {"mesh", {"core", "simd", "labels", "geometry"}},
      {"trace", {"core", "simd", "geometry"}},
      {"light", {"core", "simd", "color", "labels", "geometry"}},
      {"material", {"core", "simd", "color", "labels", "geometry"}},
      {"render", {"core", "simd", "color", "labels", "geometry", "trace", "light", "material"}},
      {"sensor", {"core", "simd", "color"}},
      {"metrics", {"core", "simd", "color"}},
      {"exec", {"core"}},
      // A reader fills the light-source set, and the whole in one call needs the pipeline and threads.
      {"io", {"core", "labels", "geometry", "depth", "light", "pipeline", "exec"}},
      {"interop", {"core", "render"}},
      {"pipeline", kCoreAreas},
      {"", kCoreAreas},  // npsim.hpp
  };
  for (auto& [area, areas] : allowed) areas.insert(area);
  return allowed;
}

}  // namespace

TEST_CASE("the headers are found") { REQUIRE(headers().size() > 10); }

TEST_CASE("includes run one way, from the foundation upwards") {
  const auto allowed = allowed_includes();
  for (const Header& header : headers()) {
    CAPTURE(header.name);
    REQUIRE_MESSAGE(allowed.count(header.area) == 1, "this folder has no place in the order");
    for (const std::string& name : included(header.text)) {
      if (name.rfind("npsim/", 0) != 0) continue;
      CAPTURE(name);
      CHECK(allowed.at(header.area).count(area_of(name)) == 1);
      CHECK(std::filesystem::exists(std::filesystem::path(NPSIM_SOURCE_DIR) / "include" / name));
    }
  }
}

TEST_CASE("what stands in an area's detail/ is included by that area alone, tests of it excepted") {
  static const std::regex inside(R"(npsim/([a-z]+)/detail/.*)");
  const std::filesystem::path root(NPSIM_SOURCE_DIR);
  for (const char* folder : {"include", "samples", "bench"}) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(root / folder)) {
      const std::string extension = entry.path().extension().string();
      if (!entry.is_regular_file() || (extension != ".hpp" && extension != ".cpp")) continue;
      const std::string name = std::filesystem::relative(entry.path(), root / "include").generic_string();
      CAPTURE(name);
      for (const std::string& other : included(text_of(entry.path()))) {
        std::smatch match;
        if (!std::regex_match(other, match, inside)) continue;
        CAPTURE(other);
        CHECK(match[1].str() == (std::string(folder) == "include" ? area_of(name) : std::string()));
      }
    }
  }
}

TEST_CASE("no header includes itself by way of others") {
  std::map<std::string, std::vector<std::string>> next;
  for (const Header& header : headers()) next[header.name] = included(header.text);
  std::map<std::string, int> state;  // 1: on the way, 2: done
  std::vector<std::string> way;
  const std::function<void(const std::string&)> visit = [&](const std::string& name) {
    if (next.count(name) == 0 || state[name] == 2) return;
    way.push_back(name);
    if (state[name] == 1) {
      CAPTURE(name);
      CAPTURE(way.size());
      CHECK_MESSAGE(false, "a circle of includes ends here");
    } else {
      state[name] = 1;
      for (const std::string& other : next[name]) visit(other);
      state[name] = 2;
    }
    way.pop_back();
  };
  for (const Header& header : headers()) visit(header.name);
}

TEST_CASE("only npsim/simd sees xsimd and intrinsics") {
  static const std::regex foreign(R"(xsimd.*|.*intrin\.h|arm_neon\.h|arm_sve\.h)");
  for (const Header& header : headers()) {
    if (header.area == "simd") continue;
    CAPTURE(header.name);
    for (const std::string& name : included(header.text)) {
      CAPTURE(name);
      CHECK_FALSE(std::regex_match(name, foreign));
    }
  }
}

TEST_CASE("only npsim/interop sees Eigen") {
  static const std::regex foreign(R"((eigen3/)?Eigen/.*|unsupported/Eigen/.*)");
  for (const Header& header : headers()) {
    CAPTURE(header.name);
    for (const std::string& name : included(header.text)) {
      CAPTURE(name);
      CHECK((header.name == "npsim/interop/eigen.hpp" || !std::regex_match(name, foreign)));
    }
  }
}

TEST_CASE("the core includes no threads, files, streams, owning containers or heap") {
  const std::set<std::string> forbidden = {"thread",
                                           "mutex",
                                           "condition_variable",
                                           "future",
                                           "iostream",
                                           "fstream",
                                           "sstream",
                                           "ostream",
                                           "istream",
                                           "cstdio",
                                           "stdio.h",
                                           "filesystem",
                                           "vector",
                                           "string",
                                           "memory",
                                           "new",
                                           "functional",
                                           "map",
                                           "unordered_map",
                                           "set",
                                           "unordered_set",
                                           "deque",
                                           "list",
                                           "any",
                                           "memory_resource",
                                           "exception",
                                           "stdexcept",
                                           "typeinfo",
                                           "cstdlib",
                                           "stdlib.h"};
  for (const Header& header : headers()) {
    if (for_hosts(header)) continue;
    CAPTURE(header.name);
    for (const std::string& name : included(header.text)) {
      CAPTURE(name);
      CHECK(forbidden.count(name) == 0);
    }
  }
}

TEST_CASE("the core neither throws nor allocates nor asks for types at run time") {
  const std::set<std::string> forbidden = {"throw", "try",    "catch",       "dynamic_cast", "typeid",
                                           "new",   "delete", "malloc",      "calloc",       "realloc",
                                           "free",  "printf", "thread_local"};
  static const std::regex deleted_function(R"(=\s*delete\s*;)");  // that is not the heap's delete
  for (const Header& header : headers()) {
    if (for_hosts(header)) continue;
    CAPTURE(header.name);
    for (const std::string& word : words(std::regex_replace(code_only(header.text), deleted_function, ";"))) {
      if (forbidden.count(word) != 0) {
        CAPTURE(word);
        CHECK_MESSAGE(false, "forbidden in the core");
      }
    }
  }
}

TEST_CASE("every header has licence line, first comment and guard") {
  for (const Header& header : headers()) {
    CAPTURE(header.name);
    CHECK(header.text.rfind("// SPDX-License-Identifier: Apache-2.0\n// ", 0) == 0);
    const std::string guard = guard_of(header.name);
    CHECK(header.text.find("\n#ifndef " + guard + "\n#define " + guard + "\n") != std::string::npos);
    const std::string end = "#endif  // " + guard + "\n";
    CHECK(header.text.size() > end.size());
    CHECK(header.text.compare(header.text.size() - end.size(), end.size(), end) == 0);
  }
}

TEST_CASE("npsim.hpp lists every public header of the core, and nothing else") {
  std::set<std::string> listed;
  for (const Header& header : headers()) {
    if (header.area.empty()) {
      for (const std::string& name : included(header.text)) listed.insert(name);
    }
  }
  for (const Header& header : headers()) {
    if (header.area.empty()) continue;
    const bool detail = header.name.find("/detail/") != std::string::npos;
    CAPTURE(header.name);
    CHECK_MESSAGE(listed.count(header.name) == (for_hosts(header) || detail ? 0U : 1U),
                  "public headers of the core, and only these, stand in npsim.hpp");
  }
}

TEST_CASE("the whole of npsim.hpp, followed include by include, reaches no host header") {
  std::map<std::string, const Header*> by_name;
  for (const Header& header : headers()) by_name[header.name] = &header;
  std::set<std::string> reached;
  std::vector<std::string> open = {"npsim/npsim.hpp"};
  while (!open.empty()) {
    const std::string name = open.back();
    open.pop_back();
    if (by_name.count(name) == 0 || !reached.insert(name).second) continue;
    CAPTURE(name);
    CHECK_FALSE(for_hosts(*by_name[name]));
    for (const std::string& next : included(by_name[name]->text)) open.push_back(next);
  }
}

TEST_CASE("one version number") {
  const std::string text = text_of(std::filesystem::path(NPSIM_SOURCE_DIR) / "CHANGELOG.md");
  CHECK(text.find("## " NPSIM_PROJECT_VERSION) != std::string::npos);
}

TEST_CASE("blanking of comments and literals, which the checks above rest on") {
  CHECK(words(code_only("int a; // throw\nchar c = 'x'; /* new\n new */ const char* s = \"try \\\" catch\"; b")) ==
        std::vector<std::string>{"int", "a", "char", "c", "const", "char", "s", "b"});
  CHECK(words(code_only("1'000'000; delete_me")) == std::vector<std::string>{"delete_me"});
  CHECK(included("#include <a>\n  #  include \"b/c.hpp\"\n// #include <d>\n") ==
        std::vector<std::string>{"a", "b/c.hpp"});
}
