// SPDX-License-Identifier: Apache-2.0
// A measured luminaire: luminous intensity over the C-gamma angles of CIE 121, as goniophotometers give it.
//
//   gamma  angle from the lamp's axis (straight down of a street lamp), 0 to pi
//   C      angle about it: 0 along the road, pi/2 over the road, counter-clockwise seen from above
// Between the measured angles intensity is bilinear in both; outside the measured gammas it is zero. The flux is the
// integral of just that, exact but for rounding: linear in gamma times sine has a closed form. A Lambertian lamp that
// is measured every 5 degrees has 0.06 % less flux than a cosine, the chords' error.
// The bits do not depend on the C library.
// Cost: two angles and two bisections of at most ten steps. Memory: the caller's; io/luminaire.hpp reads and owns it.
#ifndef NPSIM_LIGHT_LUMINAIRE_TABLE_HPP
#define NPSIM_LIGHT_LUMINAIRE_TABLE_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/circle.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct LuminaireTable {
  Span<const float> gamma_rad;  // ascending, within 0 to pi, two at least
  Span<const float> c_rad;      // ascending, from 0 or less to 2 pi or more; one alone: the same all round
  Span<const float> relative;   // plane by plane, gammas within; 0..1, 1 at the peak
  float flux_sr = 0;            // lm per cd at the peak
  float flux_lm = 0;            // as measured, lamp and ballast included
};

inline constexpr std::size_t kMaxLuminaireAngles = 724;  // of either kind: planes every half degree, turned and closed

namespace luminaire_detail {

// The interval [i, i + 1] of ascending angles that holds `a`, and how far in it `a` lies.
struct Cell {
  std::size_t index = 0;
  float share = 0;
};

[[nodiscard]] inline Cell cell_of(Span<const float> angles, float a) noexcept {
  std::size_t low = 0;
  std::size_t high = angles.size() - 1;
  while (high - low > 1) {
    const std::size_t middle = low + (high - low) / 2;
    (angles[middle] <= a ? low : high) = middle;
  }
  const float share = (a - angles[low]) / (angles[high] - angles[low]);
  return {low, share > 0.0F ? (share < 1.0F ? share : 1.0F) : 0.0F};
}

}  // namespace luminaire_detail

[[nodiscard]] inline Status validate(const LuminaireTable& t) noexcept {
  const auto ascending = [](Span<const float> a) {
    for (std::size_t i = 0; i < a.size(); ++i) {
      if (!std::isfinite(a[i]) || (i > 0 && !(a[i] > a[i - 1]))) return false;
    }
    return a.size() <= kMaxLuminaireAngles;
  };
  bool good = t.gamma_rad.size() >= 2 && !t.c_rad.empty() && ascending(t.gamma_rad) && ascending(t.c_rad) &&
              t.relative.size() == t.gamma_rad.size() * t.c_rad.size() && t.flux_sr > 0.0F;
  good = good && t.gamma_rad[0] >= 0.0F && t.gamma_rad[t.gamma_rad.size() - 1] < 3.142F &&
         (t.c_rad.size() == 1 || (t.c_rad[0] <= 0.0F && t.c_rad[t.c_rad.size() - 1] > 6.283F));
  for (std::size_t i = 0; good && i < t.relative.size(); ++i) good = t.relative[i] >= 0.0F && t.relative[i] <= 1.0F;
  return good ? Status()
              : Status(StatusCode::invalid_argument, "luminaire: angles ascend around the lamp, intensities in 0..1");
}

// Share of the peak in a unit direction, by its cosines to the lamp's axis, along the road, and over the road.
[[nodiscard]] inline float luminaire_relative(const LuminaireTable& t, float axial, float along, float over) noexcept {
  using luminaire_detail::cell_of;
  constexpr float kSlack = 1e-6F;  // rounding of the angle at the first and the last gamma
  const float gamma = angle_of(std::sqrt(along * along + over * over), axial);
  const std::size_t gammas = t.gamma_rad.size();
  if (!(gamma >= t.gamma_rad[0] - kSlack && gamma <= t.gamma_rad[gammas - 1] + kSlack)) return 0.0F;
  const luminaire_detail::Cell g = cell_of(t.gamma_rad, gamma);
  const auto in_plane = [&](std::size_t plane) {
    const float* row = t.relative.data() + plane * gammas + g.index;
    return row[0] + (row[1] - row[0]) * g.share;
  };
  if (t.c_rad.size() == 1) return in_plane(0);
  const float around = angle_of(over, along);
  const luminaire_detail::Cell c = cell_of(t.c_rad, around < 0.0F ? around + 6.28318531F : around);
  const float first = in_plane(c.index);
  return first + (in_plane(c.index + 1) - first) * c.share;
}

// lm per cd at the peak: the integral of luminaire_relative() over the sphere, before flux_sr is set.
[[nodiscard]] inline double luminaire_flux_sr(const LuminaireTable& t) noexcept {
  const std::size_t gammas = t.gamma_rad.size();
  const auto of_plane = [&](std::size_t plane) {
    double sum = 0.0;
    for (std::size_t g = 0; g + 1 < gammas; ++g) {
      const auto a = static_cast<double>(t.gamma_rad[g]);
      const auto b = static_cast<double>(t.gamma_rad[g + 1]);
      const auto low = static_cast<double>(t.relative[plane * gammas + g]);
      const double slope = (static_cast<double>(t.relative[plane * gammas + g + 1]) - low) / (b - a);
      // Integral of (low + slope (x - a)) sin x from a to b.
      sum += low * (std::cos(a) - std::cos(b)) + slope * (std::sin(b) - std::sin(a) - (b - a) * std::cos(b));
    }
    return sum;
  };
  constexpr double kTurn = 6.28318530717958648;
  if (t.c_rad.size() == 1) return kTurn * of_plane(0);
  // Planes below 0 and beyond a whole turn stand there to interpolate; their parts outside count nothing.
  double flux = 0.0;
  double before = of_plane(0);
  for (std::size_t c = 0; c + 1 < t.c_rad.size(); ++c) {
    const double after = of_plane(c + 1);
    const auto a = static_cast<double>(t.c_rad[c]);
    const auto b = static_cast<double>(t.c_rad[c + 1]);
    const double from = a > 0.0 ? a : 0.0;
    const double to = b < kTurn ? b : kTurn;
    const double middle = (0.5 * (from + to) - a) / (b - a);
    if (to > from) flux += (to - from) * (before + (after - before) * middle);
    before = after;
  }
  return flux;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_LUMINAIRE_TABLE_HPP
