// SPDX-License-Identifier: Apache-2.0
// npsim_frontier: how fast each kernel is at which error, beside what others offer for the same work.
//
// Prints CSV, and draws an SVG per kernel where a folder is given. One thread; see comparison.hpp for how time is
// taken.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "../options.hpp"
#include "cases.hpp"
#include "opencv_peers.hpp"
#include "picture.hpp"

namespace {

using namespace npsim::bench;

struct Case {
  const char* name;
  Comparison (*run)(const Options&);
};
constexpr Case kCases[] = {
    {"cross_bilateral", bilateral_case},
    {"label_term", label_term_case},
    {"variance", variance_case},
    {"lab", lab_case},
    {"normals", normals_case},
    {"losses", losses_case},
    {"refine", refine_case},
    {"light", light_case},
};

// A field of CSV: numbers short, an empty one for NaN, quotes where there is a comma.
[[nodiscard]] std::string field(double v) {
  if (v != v) return "";
  char text[32];
  std::snprintf(text, sizeof(text), "%.6g", v);
  return text;
}
[[nodiscard]] std::string field(const std::string& text) {
  if (text.find_first_of(",\"") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) out += c == '"' ? std::string("\"\"") : std::string(1, c);
  return out + "\"";
}

constexpr const char* kHeader =
    "kernel,method,setting,width,height,time_ms,peer,peer_time_ms,ratio,error_max,error_rms,error_unit\n";

[[nodiscard]] std::string csv(const std::vector<Line>& lines) {
  std::string out;
  for (const Line& l : lines) {
    out += l.kernel + "," + field(l.method) + "," + field(l.setting) + "," + std::to_string(l.shape.width) + "," +
           std::to_string(l.shape.height) + "," + field(l.time_ms) + "," + field(l.peer) + "," + field(l.peer_time_ms) +
           "," + field(l.ratio) + "," + field(l.error.max) + "," + field(l.error.rms) + "," + field(l.error.unit) +
           "\n";
  }
  return out;
}

// The lines of each kernel in a table of ours, "" where there is none.
[[nodiscard]] std::map<std::string, std::string> read_table(const std::string& path) {
  std::map<std::string, std::string> lines;
  std::ifstream file(path, std::ios::binary);
  std::string line;
  if (!std::getline(file, line) || line + "\n" != kHeader) return lines;
  while (std::getline(file, line)) lines[line.substr(0, line.find(','))] += line + "\n";
  return lines;
}

[[nodiscard]] bool write_file(const std::string& path, const std::string& content) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  if (file == nullptr) return false;
  const bool written = std::fwrite(content.data(), 1, content.size(), file) == content.size();
  return (std::fclose(file) == 0) && written;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Speed against error of every kernel, beside its peers, as CSV on the standard output");
  Options options;
  std::vector<std::string> kernels;
  std::string size = "1920x1080";
  std::string csv_path;
  std::string svg_folder;
  std::string names;
  for (const Case& c : kCases) names += (names.empty() ? "" : ", ") + std::string(c.name);
  app.add_option("--kernel", kernels, "only these: " + names);
  app.add_option("--peer", options.peers, "only peers whose name contains one of these");
  app.add_option("--size", size, "WIDTHxHEIGHT of the images, sides of 64 to 8192")->capture_default_str();
  app.add_option("--repeats", options.repeats, "rounds; the median counts")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  app.add_option("--csv", csv_path, "write the CSV to this file as well; what it holds of other kernels stays");
  app.add_option("--svg-dir", svg_folder, "draw one picture per kernel into this folder");
  app.add_flag("--quick", options.quick, "480x270, one round, errors from fewer samples: to see that all of it runs");
  if (const auto status = npsim::bench::parse(app, argc, argv)) return *status;
  if (options.quick) {
    if (app.count("--size") == 0) size = "480x270";
    if (app.count("--repeats") == 0) options.repeats = 1;
  }
  const npsim::Shape& shape = options.shape;
  if (!parse_size(size, options.shape) || std::min(shape.width, shape.height) < 64 ||
      std::max(shape.width, shape.height) > 8192) {
    std::fprintf(stderr, "npsim_frontier: --size: expected WIDTHxHEIGHT, sides of 64 to 8192, got '%s'\n",
                 size.c_str());
    return 2;
  }
  for (const std::string& k : kernels) {
    bool known = false;
    for (const Case& c : kCases) known = known || k == c.name;
    if (!known) {
      std::fprintf(stderr, "npsim_frontier: --kernel: no '%s'; there are %s\n", k.c_str(), names.c_str());
      return 2;
    }
  }
  std::fprintf(stderr, "OpenCV: %s%s\n", opencv::available() ? opencv::version().c_str() : "not built",
               opencv::available() && !opencv::ximgproc() ? ", without ximgproc" : "");

  std::map<std::string, std::string> tables;
  if (!csv_path.empty()) tables = read_table(csv_path);
  std::fputs(kHeader, stdout);
  for (const Case& c : kCases) {
    bool run = kernels.empty();
    for (const std::string& k : kernels) run = run || k == c.name;
    if (!run) continue;
    std::fprintf(stderr, "%s\n", c.name);
    const Comparison comparison = c.run(options);
    const std::string lines = csv(lines_of(comparison));
    std::fputs(lines.c_str(), stdout);
    std::fflush(stdout);
    tables[c.name] = lines;
    if (!svg_folder.empty()) {
      std::error_code ignored;
      std::filesystem::create_directories(svg_folder, ignored);
      const std::string path = svg_folder + "/" + c.name + ".svg";
      if (!write_file(path, svg_of(comparison))) {
        std::fprintf(stderr, "npsim_frontier: cannot write %s\n", path.c_str());
        return 1;
      }
    }
  }
  std::string table = kHeader;
  for (const Case& c : kCases) table += tables[c.name];
  if (!csv_path.empty() && !write_file(csv_path, table)) {
    std::fprintf(stderr, "npsim_frontier: cannot write %s\n", csv_path.c_str());
    return 1;
  }
  return 0;
}
