// SPDX-License-Identifier: Apache-2.0
// EULUMDAT, the text format of Europe (Stockmar, Licht 1990): one value a line, in a fixed order.
//
// Intensities are in cd per 1000 lm of the lamps; the flux is that of the first set of lamps. C = 90 is the road's
// side, as in CIE 121. The symmetry indicator says which planes are stored: all, one for all, those from 0 to 180, from
// 270 to 90, or from 0 to 90.
#ifndef NPSIM_IO_DETAIL_EULUMDAT_HPP
#define NPSIM_IO_DETAIL_EULUMDAT_HPP

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "npsim/io/detail/luminaire_planes.hpp"
#include "npsim/io/error.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

inline Expected<Luminaire> parse_eulumdat(const std::string& path, std::string_view text, double turn_deg) {
  constexpr double kAny = 1e9;
  LuminaireText in(path, text, LuminaireText::Unit::line);
  in.skip_lines(2);  // manufacturer, type of light source
  const std::size_t symmetry = in.count("symmetry indicator", 0, 4);
  const std::size_t around = in.count("number of C planes", 1, kMaxPlanes);
  const std::size_t multiple = symmetry < 2 ? 1 : (symmetry == 2 ? 2 : 4);
  if (around % multiple != 0) {
    in.fail("number of C planes", "is " + std::to_string(around) + ", expected a multiple of " +
                                      std::to_string(multiple) + " with this symmetry");
  }
  in.next("distance between C planes", 0.0, 360.0);
  const std::size_t gammas = in.count("number of intensities in a plane", 2, kMaxGammas);
  in.skip_lines(15);  // distance between them; report, name, number, file, date; sizes of lamp and luminous area
  in.next("downward flux fraction", -kAny, kAny);
  in.next("light output ratio", -kAny, kAny);
  const double conversion = in.next("conversion factor", 0.0, kAny);
  in.skip_lines(1);  // tilt at which it was measured
  const std::size_t sets = in.count("number of sets of lamps", 1, 20);
  in.skip_lines(2);  // of the first set: number of lamps, type
  const double flux_klm = in.next("total flux of the lamps", 0.0, kAny) / 1000.0;
  in.skip_lines(3 + 6 * (in.good() ? sets - 1 : 0) + 10);  // colour, rendering, watts; other sets; direct ratios
  const std::vector<double> c_deg = in.angles("C angle", around, 360.0);

  MeasuredPlanes out;
  out.gamma_deg = in.angles("gamma angle", gammas, 180.0);
  if (!in.good()) return in.error();
  const std::size_t first = symmetry == 3 ? 3 * around / 4 : 0;
  const std::size_t stored =
      symmetry == 0 ? around : (symmetry == 1 ? 1 : (symmetry == 4 ? around / 4 : around / 2) + 1);
  for (std::size_t p = first; p < first + stored; ++p) {
    out.c_deg.push_back(p < around ? c_deg[p] : c_deg[p - around] + 360.0);
  }
  if (symmetry > 1) {
    const double begin = symmetry == 3 ? 270.0 : 0.0;
    if (out.c_deg.front() != begin || out.c_deg.back() != begin + (symmetry == 4 ? 90.0 : 180.0)) {
      in.fail("C angles", "lack the planes of the symmetry, expected 0, 90, 180 and 270 among them");
    }
  }
  out.mirrored_at_c0 = symmetry == 2 || symmetry == 4;
  out.mirrored_at_c90 = symmetry == 3 || symmetry == 4;
  out.candela = in.candelas("luminous intensity", stored * gammas, conversion * flux_klm);
  if (!in.good()) return in.error();
  return whole_luminaire(path, out, turn_deg);
}

}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_EULUMDAT_HPP
