// SPDX-License-Identifier: Apache-2.0
#include "picture.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include "lab/svg_text.hpp"

namespace npsim::bench {
namespace {

using tool::escaped;
using tool::print;

constexpr double kWidth = 720;
constexpr double kHeight = 440;
constexpr double kLeft = 76;
constexpr double kRight = 20;
constexpr double kTop = 44;
constexpr double kBottom = 52;
constexpr double kLetter = 6.3;  // px, mean width at the labels' size
constexpr double kMark = 5.0;    // px, half its size

struct Box {
  double x0, y0, x1, y1;
};
[[nodiscard]] double overlap(const Box& a, const Box& b) {
  const double w = std::min(a.x1, b.x1) - std::max(a.x0, b.x0);
  const double h = std::min(a.y1, b.y1) - std::max(a.y0, b.y0);
  return w > 0 && h > 0 ? w * h : 0;
}

struct Axis {
  double low = 0;  // log10
  double high = 1;
  double from_px = 0;
  double to_px = 1;

  [[nodiscard]] double px(double value) const {
    return from_px + (to_px - from_px) * (std::log10(value) - low) / (high - low);
  }
  void fit(double least, double greatest, double room) {
    low = std::log10(least) - room;
    high = std::log10(greatest) + room;
    const double missing = 1.0 - (high - low);  // at least one decade
    if (missing > 0) {
      low -= 0.5 * missing;
      high += 0.5 * missing;
    }
  }
  [[nodiscard]] std::vector<double> ticks() const {
    const double span = high - low;
    const std::vector<double> steps = span < 2.2 ? std::vector<double>{1, 2, 5} : std::vector<double>{1};
    const int skip = span > 12 ? 3 : span > 7 ? 2 : 1;
    std::vector<double> values;
    for (int decade = static_cast<int>(std::floor(low)); decade <= static_cast<int>(std::ceil(high)); ++decade) {
      if (decade % skip != 0) continue;
      for (const double step : steps) {
        const double v = step * std::pow(10.0, decade);
        if (std::log10(v) >= low - 1e-9 && std::log10(v) <= high + 1e-9) values.push_back(v);
      }
    }
    return values;
  }
};

[[nodiscard]] std::string time_text(double ms) {
  std::string out;
  if (ms >= 1000) {
    print(out, "%.3g s", ms / 1000);
  } else if (ms >= 1) {
    print(out, "%.3g ms", ms);
  } else {
    print(out, "%.3g µs", ms * 1000);
  }
  return out;
}

struct Mark {
  const Contender* contender = nullptr;
  double x = 0;
  double y = 0;
  bool line = false;
  std::string label;
  Box box{};  // of the label
};

// Where a label of this width may stand beside its mark, the best places first.
[[nodiscard]] std::vector<Box> places(const Mark& m) {
  const double w = kLetter * static_cast<double>(m.label.size());
  constexpr double kLineHeight = 14;
  std::vector<Box> boxes;
  const auto add = [&](double x, double middle) {
    boxes.push_back({x, middle - kLineHeight / 2, x + w, middle + kLineHeight / 2});
  };
  if (m.line) {
    for (double x = kWidth - kRight - w - 4; x > kLeft; x -= 40) {
      add(x, m.y - 8);
      add(x, m.y + 9);
    }
    return boxes;
  }
  for (const double away : {0.0, 14.0, 28.0, 42.0, 56.0, 70.0, 84.0}) {
    for (const double sign : {-1.0, 1.0}) {
      add(m.x + kMark + 5, m.y + sign * away);
      add(m.x - kMark - 5 - w, m.y + sign * away);
      add(m.x - w / 2, m.y + sign * (away + 16));
    }
  }
  return boxes;
}

// Greedy: each label takes the place that hides least of what stands already.
void place_labels(std::vector<Mark>& marks) {
  std::vector<Box> taken;
  for (const Mark& m : marks) {
    if (m.line) {
      taken.push_back({kLeft, m.y - 1, kWidth - kRight, m.y + 1});
    } else {
      taken.push_back({m.x - kMark - 1, m.y - kMark - 1, m.x + kMark + 1, m.y + kMark + 1});
    }
  }
  for (Mark& m : marks) {
    double best = std::numeric_limits<double>::infinity();
    double rank = 0;
    for (const Box& b : places(m)) {
      const double inside = overlap(b, {kLeft + 2, kTop, kWidth - 4, kHeight - kBottom - 2});
      double cost = 8 * ((b.x1 - b.x0) * (b.y1 - b.y0) - inside) + 3 * rank++;
      for (const Box& t : taken) cost += 4 * overlap(b, t);
      if (cost < best) {
        best = cost;
        m.box = b;
      }
    }
    taken.push_back(m.box);
  }
}

constexpr const char* kStyle =
    "<style>text{font:12px system-ui,-apple-system,'Segoe UI','DejaVu Sans',sans-serif;fill:#3a3a38}"
    ".b{fill:#fcfcfb}.t{font-size:14px;font-weight:600;fill:#111}.l{font-size:11px}.s{fill:#6b6b68;font-size:11px}"
    ".g{stroke:#e3e2de}.a{stroke:#a5a49f}.o{fill:#1f6fd0}.p{fill:#fcfcfb;stroke:#c2410c;stroke-width:2}"
    ".d{stroke:#c2410c;stroke-dasharray:5 4}.h{stroke:#a5a49f}"
    "@media(prefers-color-scheme:dark){text{fill:#d0cfca}.b{fill:#171716}.t{fill:#fff}.s{fill:#9a9993}"
    ".g{stroke:#33332f}.a{stroke:#6a6a64}.o{fill:#5aa2f5}.p{fill:#171716;stroke:#f08a4b}.d{stroke:#f08a4b}"
    ".h{stroke:#6a6a64}}</style>\n";

}  // namespace

std::string svg_of(const Comparison& comparison) {
  std::string unit;
  double least = 0;  // error above 0
  double greatest = 0;
  double fastest = 0;
  double slowest = 0;
  const auto error_of = [&](const Contender& c) {
    return !c.errors.empty() && c.errors.front().unit == unit ? c.errors.front().max : kNone;
  };
  for (const Contender& c : comparison.contenders) {
    if (!c.errors.empty() && unit.empty()) unit = c.errors.front().unit;
    if (!(c.time_ms > 0)) continue;
    fastest = fastest > 0 ? std::min(fastest, c.time_ms) : c.time_ms;
    slowest = std::max(slowest, c.time_ms);
    const double e = error_of(c);
    if (!(e > 0) || !std::isfinite(e)) continue;
    least = least > 0 ? std::min(least, e) : e;
    greatest = std::max(greatest, e);
  }
  if (!(fastest > 0)) return "";
  if (!(least > 0)) least = greatest = 1;

  Axis error_axis{0, 1, kLeft, kWidth - kRight};
  Axis time_axis{0, 1, kHeight - kBottom, kTop};
  error_axis.fit(least, greatest, 0.35);
  time_axis.fit(fastest, slowest, 0.2);

  std::string out;
  print(out,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %g %g\" width=\"%g\" height=\"%g\" role=\"img\" "
        "aria-label=\"%s\">\n",
        kWidth, kHeight, kWidth, kHeight, escaped(comparison.title).c_str());
  out += kStyle;
  print(out, "<rect class=\"b\" width=\"%g\" height=\"%g\" rx=\"6\"/>\n", kWidth, kHeight);
  print(out, "<text class=\"t\" x=\"16\" y=\"25\">%s, %dx%d</text>\n", escaped(comparison.title).c_str(),
        comparison.shape.width, comparison.shape.height);
  for (const double v : time_axis.ticks()) {
    const double y = time_axis.px(v);
    print(out,
          "<path class=\"g\" d=\"M%g %.1fH%g\"/><text class=\"s\" x=\"%g\" y=\"%.1f\" text-anchor=\"end\">%s</text>\n",
          kLeft, y, kWidth - kRight, kLeft - 8, y + 4, time_text(v).c_str());
  }
  for (const double v : error_axis.ticks()) {
    const double x = error_axis.px(v);
    print(
        out,
        "<path class=\"g\" d=\"M%.1f %gV%g\"/><text class=\"s\" x=\"%.1f\" y=\"%g\" text-anchor=\"middle\">%g</text>\n",
        x, kTop, kHeight - kBottom, x, kHeight - kBottom + 16, v);
  }
  print(out, "<path class=\"a\" fill=\"none\" d=\"M%g %gV%gH%g\"/>\n", kLeft, kTop, kHeight - kBottom, kWidth - kRight);
  print(out, "<text class=\"s\" x=\"%g\" y=\"%g\" text-anchor=\"middle\">largest error, %s</text>\n",
        (kLeft + kWidth - kRight) / 2, kHeight - 14, escaped(unit).c_str());
  print(out, "<text class=\"s\" x=\"%g\" y=\"25\" text-anchor=\"end\">time, one thread</text>\n", kWidth - kRight);

  std::vector<Mark> marks;
  for (const Contender& c : comparison.contenders) {
    if (!(c.time_ms > 0)) continue;
    Mark m;
    m.contender = &c;
    const double e = error_of(c);
    m.line = std::isnan(e);
    m.x = e > 0 && std::isfinite(e) ? error_axis.px(e) : std::isinf(e) ? kWidth - kRight : kLeft;
    m.y = time_axis.px(c.time_ms);
    m.label = !c.label.empty() ? c.label : c.setting.empty() ? c.method : c.method + ", " + c.setting;
    if (e == 0) m.label += " (0)";
    const bool drawn = m.line && std::any_of(marks.begin(), marks.end(),
                                             [&](const Mark& other) { return other.line && other.label == m.label; });
    if (drawn) continue;
    marks.push_back(m);
  }
  place_labels(marks);
  for (const Mark& m : marks) {
    if (m.line) print(out, "<path class=\"d\" d=\"M%g %.1fH%g\"/>\n", kLeft, m.y, kWidth - kRight);
  }
  for (const Mark& m : marks) {
    if (!m.line) {
      const double middle = (m.box.y0 + m.box.y1) / 2;
      if (std::fabs(middle - m.y) > 18) {  // too far to be read as its own without a line
        const double end = m.x < m.box.x0 ? m.box.x0 - 2 : m.x > m.box.x1 ? m.box.x1 + 2 : m.x;
        print(out, "<path class=\"h\" d=\"M%.1f %.1fL%.1f %.1f\"/>\n", m.x, m.y, end,
              end == m.x ? (middle < m.y ? m.box.y1 : m.box.y0) : middle);
      }
      if (m.contender->peer) {
        print(out, "<rect class=\"p\" x=\"%.1f\" y=\"%.1f\" width=\"9\" height=\"9\"/>\n", m.x - 4.5, m.y - 4.5);
      } else {
        print(out, "<circle class=\"o\" cx=\"%.1f\" cy=\"%.1f\" r=\"5\"/>\n", m.x, m.y);
      }
    }
    print(out, "<text class=\"l\" x=\"%.1f\" y=\"%.1f\">%s</text>\n", m.box.x0, m.box.y1 - 3, escaped(m.label).c_str());
  }
  out += "</svg>\n";
  return out;
}

}  // namespace npsim::bench
