// SPDX-License-Identifier: Apache-2.0
// IES LM-63, the text format of North America: 1986, 1991, 1995, 2002 and 2019.
//
// Label lines, then TILT=NONE or TILT=INCLUDE, then numbers between blanks, commas and line ends, in a fixed order.
// Photometric type C alone: planes about the vertical, as luminaires of roads are measured. A lamp's tilt changes
// nothing here, since street lamps hang level. Values are multiplied by the candela multiplier and the ballast factor,
// and by the ballast-lamp photometric factor where the format is older than 1995 and has one.
// What 0 degrees means differs from file to file: where the planes run from 0 to 180, 0 is taken for the road's side,
// as in American lists of area lights; else 90 is, as in CIE 121.
#ifndef NPSIM_IO_DETAIL_IES_HPP
#define NPSIM_IO_DETAIL_IES_HPP

#include <cstddef>
#include <string>
#include <string_view>

#include "npsim/io/detail/luminaire_planes.hpp"
#include "npsim/io/error.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

inline Expected<Luminaire> parse_ies(const std::string& path, std::string_view text, double turn_deg) {
  const std::string_view first = trimmed(text.substr(0, text.find('\n')));
  const bool old = first.substr(0, 12) != "IESNA:LM-63-" && first.substr(0, 10) != "IES:LM-63-";
  std::string_view tilt;
  std::size_t line = 1;
  while (!text.empty() && tilt.empty()) {
    const std::size_t end = text.find('\n');
    const std::string_view label = trimmed(text.substr(0, end));
    if (label.substr(0, 5) == "TILT=") tilt = label;
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    ++line;
  }
  if (tilt != "TILT=NONE" && tilt != "TILT=INCLUDE") {
    return Error{path, "TILT",
                 tilt.empty() ? std::string("no line has it, expected TILT=NONE or TILT=INCLUDE")
                              : "is '" + std::string(tilt.substr(0, 64)) + "', expected TILT=NONE or TILT=INCLUDE"};
  }
  LuminaireText in(path, text, LuminaireText::Unit::word, line);
  constexpr double kAny = 1e9;
  if (tilt == "TILT=INCLUDE") {
    in.count("lamp to luminaire geometry", 1, 3);
    const std::size_t pairs = in.count("number of tilt angles", 1, 1000);
    for (std::size_t i = 0; i < pairs; ++i) in.next("tilt angle", -360.0, 360.0);
    for (std::size_t i = 0; i < pairs; ++i) in.next("tilt factor", 0.0, 100.0);
  }
  in.next("number of lamps", 0.0, kAny);
  in.next("lumens per lamp", -1.0, kAny);
  double scale = in.next("candela multiplier", 0.0, kAny);
  const std::size_t gammas = in.count("number of vertical angles", 2, kMaxGammas);
  const std::size_t planes = in.count("number of horizontal angles", 1, kMaxPlanes);
  const std::size_t type = in.count("photometric type", 1, 3);
  if (type > 1) {
    in.fail("photometric type",
            std::string("is ") + (type == 2 ? "2 (B)" : "3 (A)") + ", expected 1 (C), planes about the vertical");
  }
  in.count("units of length", 1, 2);
  for (const char* field : {"width", "length", "height"}) in.next(field, -kAny, kAny);
  scale *= in.next("ballast factor", 0.0, 1000.0);
  const double photometric = in.next("ballast-lamp photometric factor", 0.0, 1000.0);
  if (old) scale *= photometric;
  in.next("input watts", 0.0, kAny);

  MeasuredPlanes out;
  out.gamma_deg = in.angles("vertical angle", gammas, 180.0);
  out.c_deg = in.angles("horizontal angle", planes, 360.0);
  if (!in.good()) return in.error();
  const double begin = out.c_deg.front();
  const double end = out.c_deg.back();
  if (begin == 0.0 && end == 90.0) {
    out.mirrored_at_c0 = out.mirrored_at_c90 = true;
  } else if (begin == 0.0 && end == 180.0) {
    out.mirrored_at_c0 = true;
    turn_deg += 90.0;
  } else if (begin == 90.0 && end == 270.0) {
    out.mirrored_at_c90 = true;
  } else if (begin != 0.0 || (planes > 1 && end <= 180.0)) {
    in.fail("horizontal angles", "are no whole set, expected 0 alone, 0 to 90, 0 to 180, 90 to 270 or 0 to 360");
  }
  out.candela = in.candelas("candela value", gammas * planes, scale);
  if (!in.good()) return in.error();
  return whole_luminaire(path, out, turn_deg);
}

}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_IES_HPP
