// SPDX-License-Identifier: Apache-2.0
// The documents: what they link to exists, and the programs that they print are those that are built and run.
#include <doctest/doctest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <sstream>
#include <string>
#include <vector>

namespace {

namespace fs = std::filesystem;

const fs::path kRoot(NPSIM_SOURCE_DIR);

std::string text_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

std::vector<fs::path> documents() {
  std::vector<fs::path> found;
  for (const fs::path& folder : {kRoot, kRoot / "docs"}) {
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().extension() == ".md") found.push_back(entry.path());
    }
  }
  return found;
}

// The names by which its headings can be linked to: lower case, blanks as dashes, without punctuation.
std::vector<std::string> anchors_of(const std::string& document) {
  std::vector<std::string> anchors;
  std::istringstream lines(document);
  bool code = false;
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind("```", 0) == 0) code = !code;
    const std::size_t marks = line.find_first_not_of('#');
    if (code || marks == 0 || marks == std::string::npos || line[marks] != ' ') continue;
    std::string anchor;
    for (const char c : line.substr(marks + 1)) {
      if (c == ' ') anchor += '-';
      if (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_') {
        anchor += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
      }
    }
    anchors.push_back(anchor);
  }
  return anchors;
}

// The blocks of C++ that it prints.
std::vector<std::string> programs_in(const std::string& document) {
  std::vector<std::string> programs;
  for (std::size_t at = document.find("```cpp\n"); at != std::string::npos; at = document.find("```cpp\n", at)) {
    at += 7;
    programs.push_back(document.substr(at, document.find("```", at) - at));
  }
  return programs;
}

// From its first include on, which its own comments precede.
std::string from_first_include(const std::string& program) {
  const std::size_t at = program.find("#include");
  return at == std::string::npos ? std::string() : program.substr(at);
}

}  // namespace

TEST_CASE("what the documents link to exists, headings included") {
  static const std::regex link(R"(\]\(([^)#\s]*)(#[^)\s]*)?\))");
  REQUIRE(documents().size() > 10);
  for (const fs::path& document : documents()) {
    const std::string text = text_of(document);
    CAPTURE(document.string());
    for (std::sregex_iterator i(text.begin(), text.end(), link), end; i != end; ++i) {
      const std::string name = (*i)[1].str();
      const std::string heading = (*i)[2].str();
      CAPTURE(i->str());
      if (name.rfind("http", 0) == 0) continue;
      const fs::path target = name.empty() ? document : document.parent_path() / name;
      CHECK(fs::exists(target));
      if (heading.empty() || target.extension() != ".md") continue;
      const std::vector<std::string> anchors = anchors_of(text_of(target));
      CHECK(std::count(anchors.begin(), anchors.end(), heading.substr(1)) == 1);
    }
  }
}

TEST_CASE("the programs that README.md and docs/embedding.md print are those under samples/ and tests/") {
  const std::vector<std::string> readme = programs_in(text_of(kRoot / "README.md"));
  const std::vector<std::string> embedding = programs_in(text_of(kRoot / "docs/embedding.md"));
  REQUIRE(readme.size() == 1);
  REQUIRE(embedding.size() >= 2);
  CHECK(readme[0] == from_first_include(text_of(kRoot / "samples/programs/scene_to_picture.cpp")));
  CHECK(std::count(readme[0].begin(), readme[0].end(), '\n') <= 12);
  CHECK(embedding[0] == from_first_include(text_of(kRoot / "samples/programs/arrays_to_picture.cpp")));
  CHECK(std::count(embedding[0].begin(), embedding[0].end(), '\n') <= 30);
  CHECK(text_of(kRoot / "tests/install/consumer.cpp").find(embedding[1]) != std::string::npos);
}
