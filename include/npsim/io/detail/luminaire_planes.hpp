// SPDX-License-Identifier: Apache-2.0
// What readers of luminaire files share: a host's copy of a table, numbers in text, and planes that the files leave to
// symmetry.
#ifndef NPSIM_IO_DETAIL_LUMINAIRE_PLANES_HPP
#define NPSIM_IO_DETAIL_LUMINAIRE_PLANES_HPP

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "npsim/io/error.hpp"
#include "npsim/light/emitter.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

// Owns what its table looks at; a moved vector keeps its place in memory, a copied one does not.
struct Luminaire {
  std::vector<float> gamma_rad;
  std::vector<float> c_rad;
  std::vector<float> relative;
  LuminaireTable table;

  Luminaire() = default;
  Luminaire(Luminaire&&) = default;
  Luminaire& operator=(Luminaire&&) = default;
  Luminaire(const Luminaire&) = delete;
  Luminaire& operator=(const Luminaire&) = delete;
  ~Luminaire() = default;
};

namespace detail {

inline constexpr std::size_t kMaxGammas = 361;  // every half degree, the most that EULUMDAT allows
inline constexpr std::size_t kMaxPlanes = 721;

[[nodiscard]] inline std::string_view trimmed(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

// A whole word as a finite number; a sign in front and a decimal comma are allowed, as some of these files have them.
[[nodiscard]] inline bool number_of(std::string_view word, double& value) {
  std::string text(word.substr(0, 64));
  std::replace(text.begin(), text.end(), ',', '.');
  const char* begin = text.data() + (!text.empty() && text.front() == '+' ? 1 : 0);
  const std::from_chars_result r = std::from_chars(begin, text.data() + text.size(), value);
  return r.ec == std::errc() && r.ptr == text.data() + text.size() && word.size() <= 64 && std::isfinite(value);
}

// The values of a file one after the other: words between blanks, commas and line ends, or whole lines. After a fault,
// which the first is that is kept, all further values are 0.
class LuminaireText {
 public:
  enum class Unit { word, line };

  LuminaireText(std::string path, std::string_view text, Unit unit, std::size_t lines_before = 0)
      : path_(std::move(path)), text_(text), unit_(unit), line_(lines_before) {}

  void skip_lines(std::size_t lines) {
    for (std::size_t i = 0; i < lines; ++i) take_line();
  }
  double next(const std::string& field, double least, double most) {
    if (!good()) return 0.0;
    const bool ended = unit_ == Unit::line && text_.empty();
    const std::string_view word = unit_ == Unit::line ? take_line() : take_word();
    double value = 0.0;
    if (ended || (unit_ == Unit::word && word.empty())) {
      fail(field, "the file ends before it, expected a number");
    } else if (!number_of(word, value)) {
      fail(field, "is '" + std::string(word.substr(0, 32)) + "', expected a number");
    } else if (!(value >= least && value <= most)) {
      fail(field,
           "is " + std::string(word.substr(0, 32)) + ", expected " + short_text(least) + " to " + short_text(most));
    } else {
      return value;
    }
    return 0.0;
  }
  std::size_t count(const std::string& field, std::size_t least, std::size_t most) {
    const double value = next(field, static_cast<double>(least), static_cast<double>(most));
    if (value != std::floor(value)) fail(field, "is " + short_text(value) + ", expected a whole number");
    return static_cast<std::size_t>(value);
  }
  std::vector<double> angles(const std::string& field, std::size_t n, double most) {
    std::vector<double> all;
    for (std::size_t i = 0; i < n && good(); ++i) {
      const std::string name = field + " " + std::to_string(i + 1);
      const double value = next(name, 0.0, most);
      if (i > 0 && !(value > all.back())) {
        fail(name, "is not greater than the one before, expected ascending angles");
      }
      all.push_back(value);
    }
    return all;
  }
  // The rest of the file: `n` intensities, each times `scale`.
  std::vector<double> candelas(const std::string& field, std::size_t n, double scale) {
    constexpr double kMost = 1e9;
    std::vector<double> all;
    for (std::size_t i = 0; i < n && good(); ++i) {
      all.push_back(next(field + " " + std::to_string(i + 1), 0.0, kMost) * scale);
      if (!(all.back() <= kMost)) fail(field, "is more than 1e9 cd with its factors, expected less");
    }
    return all;
  }
  void fail(const std::string& field, const std::string& problem) {
    if (good()) error_ = {path_, "line " + std::to_string(line_) + ", " + field, problem};
  }
  [[nodiscard]] bool good() const { return error_.problem.empty(); }
  [[nodiscard]] const Error& error() const { return error_; }

 private:
  [[nodiscard]] static bool separates(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n' || c == ','; }
  [[nodiscard]] static std::string short_text(double value) {
    std::string text = std::to_string(value);
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
    return text;
  }
  std::string_view take_line() {
    const std::size_t end = text_.find('\n');
    const std::string_view found = text_.substr(0, end);
    text_.remove_prefix(end == std::string_view::npos ? text_.size() : end + 1);
    ++line_;
    return trimmed(found);
  }
  std::string_view take_word() {
    for (; !text_.empty() && separates(text_.front()); text_.remove_prefix(1)) line_ += text_.front() == '\n' ? 1U : 0U;
    std::size_t size = 0;
    while (size < text_.size() && !separates(text_[size])) ++size;
    const std::string_view word = text_.substr(0, size);
    text_.remove_prefix(size);
    return word;
  }

  std::string path_;
  std::string_view text_;
  Unit unit_;
  std::size_t line_;  // of the last value, from 1
  Error error_;
};

// Planes as a file stores them. Its mirrors give the rest.
struct MeasuredPlanes {
  std::vector<double> gamma_deg;
  std::vector<double> c_deg;
  std::vector<double> candela;   // plane by plane
  bool mirrored_at_c0 = false;   // what lies at C lies at -C too
  bool mirrored_at_c90 = false;  // and at 180 - C
};

// turn_deg: by which the luminaire is turned about its axis, counter-clockwise seen from above.
inline Expected<Luminaire> whole_luminaire(const std::string& path, const MeasuredPlanes& planes, double turn_deg) {
  constexpr double kRadian = 3.14159265358979324 / 180.0;
  const std::size_t gammas = planes.gamma_deg.size();
  double peak = 0.0;
  for (const double cd : planes.candela) peak = std::max(peak, cd);
  if (!(peak > 0.0)) return Error{path, "candela values", "are all 0, expected a lamp that shines"};
  Luminaire out;
  for (const double g : planes.gamma_deg) out.gamma_rad.push_back(static_cast<float>(g * kRadian));
  std::vector<std::pair<double, std::size_t>> all;  // angle and measured plane
  const auto add = [&](double c_deg, std::size_t plane) {
    const double turned = std::fmod(c_deg + turn_deg, 360.0);
    all.emplace_back(turned < 0.0 ? turned + 360.0 : turned, plane);
  };
  for (std::size_t p = 0; p < planes.c_deg.size(); ++p) {
    const double c = planes.c_deg[p];
    add(c, p);
    if (planes.mirrored_at_c0) add(-c, p);
    if (planes.mirrored_at_c90) add(180.0 - c, p);
    if (planes.mirrored_at_c0 && planes.mirrored_at_c90) add(180.0 + c, p);
  }
  std::sort(all.begin(), all.end());
  const auto near = [](const auto& a, const auto& b) { return b.first - a.first < 1e-3; };
  all.erase(std::unique(all.begin(), all.end(), near), all.end());
  if (all.size() > 1 && all.front().first + 360.0 - all.back().first < 1e-3) all.pop_back();
  if (all.size() > 1) {  // all the way round, and beyond where no plane lies at 0
    const std::pair<double, std::size_t> first = all.front();
    const std::pair<double, std::size_t> last = all.back();
    if (first.first > 0.0) all.insert(all.begin(), {last.first - 360.0, last.second});
    all.emplace_back(first.first + 360.0, first.second);
  }
  for (const auto& [c_deg, plane] : all) {
    out.c_rad.push_back(static_cast<float>(c_deg * kRadian));
    for (std::size_t g = 0; g < gammas; ++g) {
      out.relative.push_back(static_cast<float>(planes.candela[plane * gammas + g] / peak));
    }
  }
  if (all.size() == 1) out.c_rad[0] = 0.0F;
  out.table = {Span<const float>(out.gamma_rad.data(), out.gamma_rad.size()),
               Span<const float>(out.c_rad.data(), out.c_rad.size()),
               Span<const float>(out.relative.data(), out.relative.size())};
  const double flux_sr = luminaire_flux_sr(out.table);
  out.table.flux_sr = static_cast<float>(flux_sr);
  out.table.flux_lm = static_cast<float>(flux_sr * peak);
  if (const Status status = validate(out.table); !status.ok()) return Error{path, "angles", status.message()};
  return Expected<Luminaire>(std::move(out));
}

}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_LUMINAIRE_PLANES_HPP
