// SPDX-License-Identifier: Apache-2.0
#include "charts.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <limits>

#include "svg_text.hpp"

namespace npsim::tool {
namespace {

constexpr const char* kStyle =
    "<style>text{font:12px system-ui,-apple-system,'Segoe UI','DejaVu Sans',sans-serif;fill:#3a3a38}"
    ".b{fill:#fcfcfb}.t{font-size:14px;font-weight:600;fill:#111}.s{fill:#6b6b68;font-size:11px}"
    ".g{stroke:#e3e2de}.a{stroke:#a5a49f;fill:none}.c{fill:none;stroke-width:1.8}"
    "@media(prefers-color-scheme:dark){text{fill:#d0cfca}.b{fill:#171716}.t{fill:#fff}.s{fill:#9a9993}"
    ".g{stroke:#33332f}.a{stroke:#6a6a64}}</style>\n";
constexpr std::array<const char*, 6> kColours = {"#1f6fd0", "#c2410c", "#2e8b57", "#8a5cc2", "#b8860b", "#6b6b68"};

void begin(std::string& out, const std::string& title, double width, double height) {
  print(out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %g %g\" width=\"%g\" height=\"%g\" role=\"img\" "
        "aria-label=\"",
        width, height, width, height);
  out += escaped(title) + "\">\n" + kStyle;
  print(out, "<rect class=\"b\" width=\"%g\" height=\"%g\" rx=\"6\"/>\n<text class=\"t\" x=\"16\" y=\"25\">", width,
        height);
  out += escaped(title) + "</text>\n";
}

void text(std::string& out, const char* cls, double x, double y, const char* anchor, const std::string& what) {
  print(out, "<text class=\"%s\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"%s\">", cls, x, y, anchor);
  out += escaped(what) + "</text>\n";
}

[[nodiscard]] bool drawn(double v) { return std::isfinite(v) && v > 0; }

// A round number of steps between ticks, for about five of them.
[[nodiscard]] std::size_t tick_step(std::size_t count) {
  for (std::size_t decade = 1;; decade *= 10) {
    for (const std::size_t step : {decade, 2 * decade, 5 * decade}) {
      if (count <= 6 * step) return step;
    }
  }
}

struct Frame {
  double left = 76, right = 700, top = 44, bottom = 388;
  double low = 0, high = 1;  // log10
  std::size_t last = 1;      // count at the right

  [[nodiscard]] double x(std::size_t i) const {
    return left + (right - left) * static_cast<double>(i) / static_cast<double>(last);
  }
  [[nodiscard]] double y(double v) const { return bottom - (bottom - top) * (std::log10(v) - low) / (high - low); }
};

void draw_axes(const Frame& f, const std::string& along, std::string& out) {
  const int span = static_cast<int>(std::ceil(f.high - f.low));
  const int skip = span > 8 ? 2 : 1;
  const int last = static_cast<int>(std::floor(f.high));
  for (int decade = static_cast<int>(std::ceil(f.low)); decade <= last; decade += skip) {
    const double y = f.y(std::pow(10.0, decade));
    print(out, "<path class=\"g\" d=\"M%g %.1fH%g\"/>\n", f.left, y, f.right);
    char label[16];
    std::snprintf(label, sizeof label, "1e%d", decade);
    text(out, "s", f.left - 8, y + 4, "end", label);
  }
  for (std::size_t i = 0; i <= f.last; i += tick_step(f.last)) {
    print(out, "<path class=\"g\" d=\"M%.1f %gV%g\"/>\n", f.x(i), f.top, f.bottom);
    text(out, "s", f.x(i), f.bottom + 16, "middle", std::to_string(i));
  }
  print(out, "<path class=\"a\" d=\"M%g %gV%gH%g\"/>\n", f.left, f.top, f.bottom, f.right);
  text(out, "s", (f.left + f.right) / 2, f.bottom + 36, "middle", along);
}

}  // namespace

std::string svg_of_curves(const std::string& title, const std::string& along, const std::vector<Curve>& curves) {
  double least = std::numeric_limits<double>::infinity();
  double greatest = 0;
  Frame f;
  for (const Curve& c : curves) {
    if (!c.values.empty()) f.last = std::max(f.last, c.values.size() - 1);
    for (const double v : c.values) {
      if (!drawn(v)) continue;
      least = std::min(least, v);
      greatest = std::max(greatest, v);
    }
  }
  if (!(greatest > 0)) return "";
  f.low = std::floor(std::log10(least));
  f.high = std::max(f.low + 1, std::ceil(std::log10(greatest)));
  std::string out;
  begin(out, title, 860, 440);
  draw_axes(f, along, out);
  for (std::size_t k = 0; k < curves.size(); ++k) {
    const char* colour = kColours[k % kColours.size()];
    std::string path;
    for (std::size_t i = 0; i < curves[k].values.size(); ++i) {
      if (!drawn(curves[k].values[i])) continue;
      print(path, "%c%.1f %.1f", path.empty() ? 'M' : 'L', f.x(i), f.y(curves[k].values[i]));
    }
    out += "<path class=\"c\" stroke=\"" + std::string(colour) + "\" d=\"" + path + "\"/>\n";
    const double y = f.top + 16 + 18 * static_cast<double>(k);
    print(out, "<path class=\"c\" stroke=\"%s\" d=\"M%g %gh22\"/>\n", colour, f.right + 16, y - 4);
    text(out, "s", f.right + 44, y, "start", curves[k].name);
  }
  return out + "</svg>\n";
}

namespace {

// From light to dark blue; the text on it.
struct Shade {
  int r, g, b;
  const char* ink;
};
[[nodiscard]] Shade shade(double part) {
  const auto mix = [&](int from, int to) { return static_cast<int>(std::lround(from + (to - from) * part)); };
  return {mix(238, 18), mix(243, 62), mix(250, 128), part > 0.5 ? "#ffffff" : "#1a1a1a"};
}

void draw_map(const HeatMap& map, std::size_t columns, double left, double top, double cell, std::string& out) {
  double least = std::numeric_limits<double>::infinity();
  double greatest = -least;
  for (const double v : map.values) {
    if (!std::isfinite(v)) continue;
    least = std::min(least, v);
    greatest = std::max(greatest, v);
  }
  const auto part_of = [&](double v) {
    if (!(greatest - least > std::pow(10.0, -map.digits))) return 0.0;  // all alike, as they are printed
    if (!(least > 0)) return (v - least) / (greatest - least);
    return std::log(v / least) / std::log(greatest / least);
  };
  for (std::size_t i = 0; i < map.values.size(); ++i) {
    if (!std::isfinite(map.values[i])) continue;
    const double x = left + cell * static_cast<double>(i % columns);
    const double y = top + cell * static_cast<double>(i / columns);
    const Shade s = shade(part_of(map.values[i]));
    print(out, "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\" fill=\"#%02x%02x%02x\"/>\n", x + 1, y + 1,
          cell - 2, cell - 2, static_cast<unsigned>(s.r), static_cast<unsigned>(s.g), static_cast<unsigned>(s.b));
    print(out, "<text style=\"font-size:10px;fill:%s\" x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">%.*f</text>\n",
          s.ink, x + cell / 2, y + cell / 2 + 4, map.digits, map.values[i]);
  }
}

}  // namespace

std::string svg_of_maps(const std::string& title, const std::string& across, const std::vector<std::string>& columns,
                        const std::string& down, const std::vector<std::string>& rows,
                        const std::vector<HeatMap>& maps) {
  constexpr double kCell = 44;
  constexpr double kLeft = 76;  // of a map's squares in its place
  constexpr double kTop = 26;
  constexpr double kMapsAbreast = 2;
  const double width = kLeft + kCell * static_cast<double>(columns.size()) + 24;
  const double height = kTop + kCell * static_cast<double>(rows.size()) + 52;
  const double lines = std::ceil(static_cast<double>(maps.size()) / kMapsAbreast);
  const double abreast = std::min(kMapsAbreast, static_cast<double>(maps.size()));
  std::string out;
  begin(out, title, abreast * width, 40 + lines * height);
  for (std::size_t m = 0; m < maps.size(); ++m) {
    const double left = kLeft + width * static_cast<double>(m % 2);
    const double top = 40 + kTop + height * static_cast<double>(m / 2);
    text(out, "s", left, top - 8, "start", maps[m].name);
    draw_map(maps[m], columns.size(), left, top, kCell, out);
    for (std::size_t c = 0; c < columns.size(); ++c) {
      text(out, "s", left + kCell * (static_cast<double>(c) + 0.5), top + kCell * static_cast<double>(rows.size()) + 16,
           "middle", columns[c]);
    }
    for (std::size_t r = 0; r < rows.size(); ++r) {
      text(out, "s", left - 6, top + kCell * (static_cast<double>(r) + 0.5) + 4, "end", rows[r]);
    }
    text(out, "s", left + kCell * static_cast<double>(columns.size()) / 2,
         top + kCell * static_cast<double>(rows.size()) + 34, "middle", across);
    text(out, "s", left - 6, top - 8, "end", down);
  }
  return out + "</svg>\n";
}

std::string svg_of_ranges(const std::string& title, const std::string& along, const std::vector<RangeRow>& rows) {
  constexpr double kLeft = 130;
  constexpr double kRight = 640;
  constexpr double kTop = 52;
  constexpr double kRow = 26;
  const double bottom = kTop + kRow * static_cast<double>(rows.size());
  const auto x = [&](double multiple) {
    return kLeft + (kRight - kLeft) * (std::clamp(std::log2(multiple), -3.0, 3.0) + 3) / 6;
  };
  std::string out;
  begin(out, title, 760, bottom + 46);
  constexpr std::array<const char*, 7> kTicks = {"1/8", "1/4", "1/2", "1", "2", "4", "8"};
  for (std::size_t i = 0; i < kTicks.size(); ++i) {
    const double at = kLeft + (kRight - kLeft) * static_cast<double>(i) / 6;
    print(out, "<path class=\"%s\" d=\"M%.1f %gV%g\"/>\n", i == 3 ? "a" : "g", at, kTop, bottom);
    text(out, "s", at, bottom + 16, "middle", kTicks[i]);
  }
  text(out, "s", (kLeft + kRight) / 2, bottom + 34, "middle", along);
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const RangeRow& row = rows[r];
    const double y = kTop + kRow * (static_cast<double>(r) + 0.5);
    text(out, "s", kLeft - 10, y + 4, "end", row.name);
    if (row.least > 0) {
      print(out, "<rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"10\" rx=\"3\" fill=\"%s\" opacity=\".3\"/>\n",
            x(row.least / row.mean), y - 5, x(row.most / row.mean) - x(row.least / row.mean), kColours[0]);
    }
    for (const double v : row.values) {
      if (!std::isfinite(v)) continue;
      print(out, "<circle cx=\"%.1f\" cy=\"%.1f\" r=\"4\" fill=\"%s\" opacity=\".8\"/>\n", x(v / row.mean), y,
            kColours[1]);
    }
    char mean[32];
    std::snprintf(mean, sizeof mean, "%.4f", row.mean_value);
    text(out, "s", kRight + 14, y + 4, "start", std::isfinite(row.mean_value) ? mean : "-");
  }
  return out + "</svg>\n";
}

}  // namespace npsim::tool
