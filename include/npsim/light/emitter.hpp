// SPDX-License-Identifier: Apache-2.0
// What a lamp is: its shape, and in which directions it shines, by closed forms or as measured.
#ifndef NPSIM_LIGHT_EMITTER_HPP
#define NPSIM_LIGHT_EMITTER_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/light_classes.hpp"
#include "npsim/light/detail/low_beam.hpp"
#include "npsim/light/detail/road_luminaire.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// A measured luminaire: luminous intensity over the C-gamma angles of CIE 121, as goniophotometers give it.
//
//   gamma  angle from the lamp's axis (straight down of a street lamp), 0 to pi
//   C      angle about it: 0 along the road, pi/2 over the road, counter-clockwise seen from above
// Between the measured angles intensity is bilinear in both; outside the measured gammas it is zero. The flux is the
// integral of just that, exact but for rounding: linear in gamma times sine has a closed form. A Lambertian lamp that
// is measured every 5 degrees has 0.06 % less flux than a cosine, the chords' error.
// The bits do not depend on the C library.
// Cost: two angles and two bisections of at most ten steps. Memory: the caller's; io/luminaire.hpp reads and owns it.

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

// An emitter: a small luminous shape with a far-field intensity distribution (a luminaire's "profile").
//
//   I(direction) = I_peak * relative_intensity(emitter, direction),   relative_intensity in [0, 1], 1 at the peak.
// Profiles, with c = cosine to the axis:
//   lambert           c; of a sphere 1, of a tube the sine to it    window, sign: luminance independent of direction
//   signal            c^4                                           signal and rear lamps: half value at 33 degrees
//   street_luminaire  road luminaire on a mast beside the road, and
//   hung_luminaire    one hung over its middle: see detail/road_luminaire.hpp; almost nothing leaves above 80 degrees
//   lantern           (1 - g) c (1/2 + 8/3 r^4) + g,  r = cosine to the road's direction (`up`), g = 0.01
//                     Peak at 60 degrees along the road, half of it straight down and c/2 across: a batwing. g is the
//                     glow of the glass: a lantern can be seen from everywhere, and 2.3 % of its light goes up.
//   low_beam, low_beam_left   headlamp of UN R112 class B for right-hand and left-hand traffic, see detail/low_beam.hpp
//   high_beam         the same headlamp with both beams on
//   measured          the table of a luminaire file, about `axis` with C = 0 along `up` (LuminaireTable)
// The closed forms are ours, chosen so that the flux integrals in photometry.hpp are exact where they can be; they use
// only + * / sqrt, so that every machine gets the same bits.
// Cost: a few dot products.
// Error: at most 1e-6 against the same formula in double.

enum class EmissionProfile : std::uint8_t {
  lambert,
  street_luminaire,
  low_beam,
  signal,
  hung_luminaire,
  lantern,
  low_beam_left,
  high_beam,
  measured
};

[[nodiscard]] constexpr bool is_headlamp_profile(EmissionProfile p) noexcept {
  return p == EmissionProfile::low_beam || p == EmissionProfile::low_beam_left || p == EmissionProfile::high_beam;
}

// Those whose strength is a luminous flux, and which hang level, shining down.
[[nodiscard]] constexpr bool is_street_profile(EmissionProfile p) noexcept {
  return p == EmissionProfile::street_luminaire || p == EmissionProfile::hung_luminaire ||
         p == EmissionProfile::lantern || p == EmissionProfile::measured;
}

[[nodiscard]] constexpr bool is_street_lamp(LightClass c) noexcept {
  return c == LightClass::street_light_ht || c == LightClass::street_light_lt;
}

enum class EmitterShape : std::uint8_t {
  patch,   // centre + a half_u + b half_v with a, b in [-1, 1]
  disc,    // the same with a^2 + b^2 <= 1
  sphere,  // of radius |half_u|
  tube     // along half_u, its half length, of radius |half_v|
};

struct Emitter {
  Vec3f centre_m;  // camera frame
  Vec3f half_u_m;
  Vec3f half_v_m;
  Vec3f axis;  // unit: main direction. low_beam: towards the elbow of the cut-off, 1 % below the horizontal
  // Unit, normal to axis. low_beam: upwards; lamps of streets: along the road, so that cross(up, axis) of a
  // street_luminaire points over the road and not to the houses; else any.
  Vec3f up;
  // Luminous area as the camera sees it (image-parallel); for lambert that of the surface, of a sphere and a tube of
  // their greatest outline.
  float area_m2 = 0;
  EmissionProfile profile = EmissionProfile::lambert;
  EmitterShape shape = EmitterShape::patch;
  LightClass cls = LightClass::none;
  SignalState state = SignalState::unknown;
  // Position + 1 of its LightMark; 0 = one that the photograph does not show: a lamp of the vehicle that carries the
  // camera, or one with a number of its own (unseen).
  std::uint16_t mark = 0;
  std::uint16_t unseen = 0;  // of what the photograph does not show: 1, 2, ... street lamps, kMoonNumber, ...; else 0
  std::uint16_t group = 0;   // position + 1 of its group's LightMark; 0 = stands alone
  LightClass group_cls = LightClass::none;
  float mounting_height_m = 0;                // of a street lamp above the ground; 0 = unknown
  bool shop_front = false;                    // a window as large and low as those of shops; set anew by relight.hpp
  bool shines_by_day = false;                 // the photograph shows its light; set anew by relight.hpp
  const LuminaireTable* luminaire = nullptr;  // of profile measured; the caller's
  // Of a headlamp: what stands before it takes all light whose slope (tangent) to the lamp's right lies between the
  // first two, and whose slope upwards lies below the third; the axis has the slope -kLowBeamAim in that measure. The
  // first two alike: nothing stands there.
  float shade_from = 0;
  float shade_to = 0;
  float shade_below = 0;
};

// Of the vehicle that carries the camera.
[[nodiscard]] constexpr bool is_own_headlamp(const Emitter& e) noexcept { return e.mark == 0 && e.unseen == 0; }

// Whether nothing leaves the emitter against its axis: a surface that shines to one side, a lens, a headlamp.
[[nodiscard]] constexpr bool shines_ahead(const Emitter& e) noexcept {
  const bool flat = e.shape == EmitterShape::patch || e.shape == EmitterShape::disc;
  return is_headlamp_profile(e.profile) || e.profile == EmissionProfile::signal ||
         (flat && e.profile == EmissionProfile::lambert);
}

// The moon is an unseen lamp: a sphere of constant luminance and a radius of 0.26 degrees, so far off that a street is
// a point to it, and so near that float keeps its shadows sharp.
inline constexpr std::uint16_t kMoonNumber = 0xFFFF;
inline constexpr float kMoonDistance_m = 2e4F;
inline constexpr float kMoonRadius = 0.00453F;  // over the distance
[[nodiscard]] constexpr bool is_moon(const Emitter& e) noexcept { return e.unseen == kMoonNumber; }

inline constexpr float kLanternGlow = 0.01F;  // share of the peak that leaves in every direction, upwards included

// Both low beams of the car that follows the one with the camera.
inline constexpr std::uint16_t kFollowingCarNumber = 0xFFFE;
[[nodiscard]] constexpr bool is_following_car(const Emitter& e) noexcept { return e.unseen == kFollowingCarNumber; }

// Whether it is of a car that drives in every night: the own one, or the one that follows.
[[nodiscard]] constexpr bool is_headlamp_always_on(const Emitter& e) noexcept {
  return is_own_headlamp(e) || is_following_car(e);
}

// `direction` is a unit vector that leaves the emitter. F: a batch of simd/batch.hpp. 0 for a NaN.
template <class F>
[[nodiscard]] F relative_intensity(const Emitter& e, const simd::F32x3<F>& direction) noexcept {
  const auto along = [&](const Vec3f& to) {
    return F(to.x) * direction.x + F(to.y) * direction.y + F(to.z) * direction.z;
  };
  const F c = along(e.axis);
  F value(0.0F);
  switch (e.profile) {
    case EmissionProfile::lambert:
      if (e.shape == EmitterShape::sphere) {
        value = select(c == c, F(1.0F), F(0.0F));
      } else if (e.shape == EmitterShape::tube) {
        const F cosine = along(normalized(e.half_u_m));
        value = sqrt(max(F(1.0F) - cosine * cosine, F(0.0F)));
      } else {
        value = c;
      }
      break;
    case EmissionProfile::signal: value = select(c > F(0.0F), (c * c) * (c * c), F(0.0F)); break;
    case EmissionProfile::street_luminaire:
    case EmissionProfile::hung_luminaire:
      value = road_luminaire_relative(c, along(e.up), along(cross(e.up, e.axis)),
                                      e.profile == EmissionProfile::hung_luminaire);
      break;
    case EmissionProfile::lantern: {
      const F r = along(e.up);
      const F r2 = r * r;
      const F down = F(1.0F - kLanternGlow) * c * (F(0.5F) + F(8.0F / 3.0F) * (r2 * r2));
      value = F(kLanternGlow) + select(c > F(0.0F), down, F(0.0F));
      break;
    }
    case EmissionProfile::low_beam:
    case EmissionProfile::low_beam_left:
    case EmissionProfile::high_beam: {
      // Right of the lamp as it looks along its axis; x right, y down, z forward is a right-handed frame.
      const F ahead = select(c > F(0.0F), c, F(1.0F));
      const F right = along(cross(e.axis, e.up)) / ahead;
      const F h = e.profile == EmissionProfile::low_beam_left ? -right : right;
      const F v = along(e.up) / ahead - F(kLowBeamAim);
      const F beam =
          e.profile == EmissionProfile::high_beam ? high_beam_relative(h, v, ahead) : low_beam_relative(h, v, ahead);
      const auto shaded = (right > F(e.shade_from)) & (right < F(e.shade_to)) & (v < F(e.shade_below));
      value = select(c > F(0.0F), select(shaded, F(0.0F), beam), F(0.0F));
      break;
    }
    case EmissionProfile::measured: {
      if (e.luminaire == nullptr) break;
      const F r = along(e.up);
      const F s = along(cross(e.up, e.axis));
      float lanes[F::lanes];
      for (int i = 0; i < F::lanes; ++i) lanes[i] = luminaire_relative(*e.luminaire, c.lane(i), r.lane(i), s.lane(i));
      value = F::load(lanes);
      break;
    }
  }
  return select((value > F(0.0F)) & (c == c), min(value, F(1.0F)), F(0.0F));
}

[[nodiscard]] inline float relative_intensity(const Emitter& e, const Vec3f& direction) noexcept {
  using F = simd::scalar::F32;
  return relative_intensity<F>(e, {F(direction.x), F(direction.y), F(direction.z)}).value;
}

// A point of what the shape shows of itself to `from`: of patch and disc their own, of a sphere the disc
// within its outline, of a tube the strip across the view. u, v in [0, 1] cover it uniformly, (.5, .5) is its middle.
[[nodiscard]] inline Vec3f sample_point(const Emitter& e, const Vec3f& from, float u, float v) noexcept {
  const float a = 2.0F * u - 1.0F;
  const float b = 2.0F * v - 1.0F;
  switch (e.shape) {
    case EmitterShape::patch: break;
    case EmitterShape::disc: {
      const Vec2f p = concentric_disc(u, v);
      return e.centre_m + e.half_u_m * p.x + e.half_v_m * p.y;
    }
    case EmitterShape::sphere: {
      const Vec3f towards = from - e.centre_m;
      const float distance2 = dot(towards, towards);
      const float radius2 = dot(e.half_u_m, e.half_u_m);
      if (!(distance2 > radius2)) return e.centre_m;
      // The circle in which the view touches the sphere.
      const float nearer = radius2 / distance2;
      const float radius = std::sqrt(radius2 * (1.0F - nearer));
      const Vec3f other = std::fabs(towards.x) < std::fabs(towards.y) ? Vec3f{1, 0, 0} : Vec3f{0, 1, 0};
      const Vec3f s = normalized(cross(towards, other));
      const Vec3f t = cross(normalized(towards), s);
      const Vec2f p = concentric_disc(u, v);
      return e.centre_m + towards * nearer + s * (radius * p.x) + t * (radius * p.y);
    }
    case EmitterShape::tube: {
      const Vec3f across = normalized(cross(e.half_u_m, from - e.centre_m));
      return e.centre_m + e.half_u_m * a + across * (length(e.half_v_m) * b);
    }
  }
  return e.centre_m + e.half_u_m * a + e.half_v_m * b;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_EMITTER_HPP
