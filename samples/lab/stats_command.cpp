// SPDX-License-Identifier: Apache-2.0
#include "stats_command.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <utility>

#include "charts.hpp"
#include "npsim/core/config.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/metrics/night_statistics.hpp"
#include "tool/figures.hpp"
#include "tool/options.hpp"
#include "tool/outputs.hpp"

namespace npsim::tool {
namespace {

struct Figure {
  std::string name;  // in the table and in JSON
  StatisticRange real;
  std::vector<double> values;  // of the pictures
};

[[nodiscard]] std::vector<Figure> figures_of(const std::vector<NightStatistics>& pictures) {
  std::vector<Figure> figures;
  const auto add = [&](const std::string& name, const StatisticRange& real, const auto& of) {
    figures.push_back({name, real, {}});
    for (const NightStatistics& s : pictures) figures.back().values.push_back(of(s));
  };
  const RealNights& real = kRealNights;
  add("mean", real.mean, [](const NightStatistics& s) { return s.mean; });
  add("road", real.road, [](const NightStatistics& s) { return s.road; });
  add("top", real.top, [](const NightStatistics& s) { return s.top; });
  add("road/top", real.road_to_top, [](const NightStatistics& s) { return s.road_to_top; });
  add("r/g", real.red_to_green, [](const NightStatistics& s) { return s.red_to_green; });
  add("black", real.black, [](const NightStatistics& s) { return s.black; });
  add("saturated", real.saturated, [](const NightStatistics& s) { return s.saturated; });
  for (std::size_t k = 0; k < kNoiseBands; ++k) {
    add("n" + std::to_string(kNoiseLevels[k]) + "-" + std::to_string(kNoiseLevels[k + 1]),
        {kNone, real.noise[k], kNone}, [k](const NightStatistics& s) { return s.noise[k]; });
  }
  return figures;
}

// Of the pictures that have the figure.
[[nodiscard]] double mean_of(const std::vector<double>& values) {
  double sum = 0;
  std::size_t n = 0;
  for (const double v : values) {
    if (!std::isfinite(v)) continue;
    sum += v;
    ++n;
  }
  return n > 0 ? sum / static_cast<double>(n) : kNone;
}

void print_row(const std::vector<Figure>& figures, const std::string& name, double (*of)(const Figure&)) {
  for (const Figure& f : figures) {
    if (const double v = of(f); std::isfinite(v)) {
      std::printf(" %9.4f", v);
    } else {
      std::printf(" %9s", "-");
    }
  }
  std::printf(" %s\n", name.c_str());
}

void print_table(const std::vector<Figure>& figures, const std::vector<std::string>& pictures) {
  for (const Figure& f : figures) std::printf(" %9s", f.name.c_str());
  std::printf("\n");
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    std::vector<Figure> one;
    for (const Figure& f : figures) one.push_back({f.name, f.real, {f.values[i]}});
    print_row(one, pictures[i], [](const Figure& f) { return f.values.front(); });
  }
  if (pictures.size() > 1) print_row(figures, "mean", [](const Figure& f) { return mean_of(f.values); });
  print_row(figures, "real nights, mean", [](const Figure& f) { return f.real.mean; });
  print_row(figures, "real nights, least", [](const Figure& f) { return f.real.least; });
  print_row(figures, "real nights, most", [](const Figure& f) { return f.real.most; });
}

[[nodiscard]] OrderedJson to_json(const std::vector<Figure>& figures, const std::vector<std::string>& pictures) {
  OrderedJson json = {{"npsim", NPSIM_VERSION_STRING}};
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    OrderedJson entry = {{"picture", pictures[i]}};
    for (const Figure& f : figures) entry[f.name] = f.values[i];
    json["pictures"].push_back(std::move(entry));
  }
  for (const Figure& f : figures) {
    json["mean"][f.name] = mean_of(f.values);
    json["real_nights"][f.name] = {{"mean", f.real.mean}, {"least", f.real.least}, {"most", f.real.most}};
  }
  return json;
}

[[nodiscard]] std::string svg(const std::vector<Figure>& figures) {
  std::vector<RangeRow> rows;
  for (const Figure& f : figures) {
    const bool ranged = std::isfinite(f.real.least);
    rows.push_back(
        {f.name, ranged ? f.real.least : 0, f.real.mean, ranged ? f.real.most : 0, f.values, mean_of(f.values)});
  }
  return svg_of_ranges("Night pictures beside real nights",
                       "multiple of the real nights' mean; bars: their range; right: mean of the pictures", rows);
}

[[nodiscard]] io::Expected<NightStatistics> measure(const std::string& path) {
  const io::Expected<io::Image<Rgb8>> picture = io::read_rgb8(path);
  if (!picture) return picture.error();
  std::vector<unsigned char> memory(kNightStatisticsBytes);
  Workspace workspace(memory.data(), memory.size());
  NightStatistics statistics;
  const Status status = night_statistics(picture.value().view(), statistics, workspace);
  if (!status.ok()) {
    return io::Error{path, "size", io::size_text(picture.value().shape()) + " pixels, expected at least 4x4"};
  }
  return statistics;
}

}  // namespace

int run_stats(const StatsOptions& options) {
  InputFiles inputs;
  for (const std::string& file : options.pictures) inputs.add(file, "a picture");
  for (const std::string& file : {options.json, options.svg}) {
    if (file.empty()) continue;
    if (const io::Outcome apart = inputs.expect_none_of({file}); !apart) return fail(apart.error());
  }
  std::vector<NightStatistics> statistics;
  for (const std::string& file : options.pictures) {
    const io::Expected<NightStatistics> measured = measure(file);
    if (!measured) return fail(measured.error());
    statistics.push_back(measured.value());
  }
  const std::vector<Figure> figures = figures_of(statistics);
  print_table(figures, options.pictures);
  const std::array<std::pair<std::string, std::string>, 2> files = {
      {{options.json, to_json(figures, options.pictures).dump(2) + "\n"}, {options.svg, svg(figures)}}};
  for (const auto& [file, text] : files) {
    if (file.empty()) continue;
    if (const io::Outcome made = make_folder_of(file); !made) return fail(made.error());
    if (const io::Outcome written = io::write_file(file, text); !written) return fail(written.error());
  }
  return kExitDone;
}

}  // namespace npsim::tool
