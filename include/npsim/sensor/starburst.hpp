// SPDX-License-Identifier: Apache-2.0
// Starbursts: the light of lamps that the straight edges of an iris diffract, a spike to either side of every blade.
//
// Of the light that passes an opening of area A and perimeter P the share beyond the angle t is, at many times the
// width of the core,  lambda P / (2 pi^2 A t)  (2 lambda / (pi^2 D t) for a disc of diameter D: Born and Wolf,
// "Principles of optics", 8.5.2; the edges alone send it, Keller, "Geometrical theory of diffraction", J. Opt. Soc. Am.
// 52(2), 1962). A round iris spreads it as rings, which the halo of sensor/glare.hpp holds. A polygon of n blades sends
// it along the normals of its edges: 2 n spikes of 1 / (2 n) of it each, which fall on each other where n is even. For
// a regular one P / A = 2 / apothem. So along a spike, in pixels s with t = s / focal,
//   light between s and s + ds  =  I c ds / s^2,   c = lambda focal / (2 pi^2 apothem n).
// lambda: 610, 540 and 460 nm for red, green and blue, so spikes are reddish.
// Spikes are a pixel wide (lambda / edge is less than that for most lenses), begin 1.5 px from the lamp, and end at the
// border or where a pixel gets less than `least`; what is not sent out stays in the lamp. What is dimmer than `lamp`
// sends none, which would be lost beside it.
// Invariants: out >= 0; sum(out) == sum(in) within 1e-5 relative; no blades: a copy.
// Error: the equation within 5 % of the light that hexagons, pentagons and octagons diffract (Fourier transforms of
// them, from 6 lambda / D on); a spike within 1e-4 of the equation, as long as a pixel of it gets `least`.
// Cost: by the lamps, 50 us a pixel of 1e4 cd/m2 with six blades; one thread. Memory: an image.
#ifndef NPSIM_SENSOR_STARBURST_HPP
#define NPSIM_SENSOR_STARBURST_HPP

#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/sensor/detail/signal.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct StarburstParams {
  int blades = 0;            // of the iris, 3 to 31; 0: it is round, or wide open
  float turn_deg = 0.0F;     // of the iris, clockwise; the first blade's normal points to the right at 0
  float apothem_mm = 0.65F;  // from the middle of the opening to a blade; focal length / f-number / 2 nearly
  float least = 1e-3F;       // cd/m2 of a spike that are worth a pixel
  float lamp = 20.0F;        // cd/m2 of what has spikes
  float cap = 1e6F;          // cd/m2, as GlareParams has it
};

[[nodiscard]] inline Status validate(const StarburstParams& p) noexcept {
  const bool good = (p.blades == 0 || (p.blades >= 3 && p.blades <= 31)) && std::fabs(p.turn_deg) <= 360.0F &&
                    p.apothem_mm >= 0.05F && p.apothem_mm <= 100.0F && p.least >= 1e-6F && p.least <= 1e6F &&
                    p.lamp >= 0.0F && p.lamp <= kMaxSample && p.cap > 0.0F && p.cap <= kMaxSample;
  return good ? Status()
              : Status(StatusCode::invalid_argument,
                       "starburst: blades 0 or 3 to 31, turn in [-360, 360] degrees, apothem in [.05, 100] mm, "
                       "least in [1e-6, 1e6], lamp in [0, 1e12], cap in (0, 1e12] cd/m2");
}

[[nodiscard]] constexpr bool has_starburst(const StarburstParams& p) noexcept { return p.blades > 0; }

inline constexpr int kMaxSpikes = 62;  // of 31 blades

// Distinct spikes: opposite blades share theirs.
[[nodiscard]] constexpr int spike_count(const StarburstParams& p) noexcept {
  return p.blades % 2 == 0 ? p.blades : 2 * p.blades;
}

// c of the equation, for one of the distinct spikes, px.
[[nodiscard]] inline Vec3f spike_strength(const StarburstParams& p, float focal_px) noexcept {
  constexpr float kTwoPiSquared = 19.7392088F;
  constexpr float kMillimetresPerNanometre = 1e-6F;
  const Vec3f wavelength{610.0F, 540.0F, 460.0F};
  const float shared = p.blades % 2 == 0 ? 2.0F : 1.0F;
  return wavelength *
         (kMillimetresPerNanometre * focal_px * shared / (kTwoPiSquared * p.apothem_mm * static_cast<float>(p.blades)));
}

[[nodiscard]] constexpr std::size_t starburst_workspace_bytes(const StarburstParams& p, Shape shape) noexcept {
  return kWorkspaceAlignment + (has_starburst(p) ? allocation_bytes<Vec3f>(shape.pixels()) : 0);
}

namespace starburst_detail {

inline constexpr float kFirst = 2.0F;  // px from the lamp to the middle of the first pixel of a spike

// One spike of a pixel's light, times c: into `change` along `along`, and out of the pixel.
inline void add_spike(const Vec3f& source, float end, const Vec2f& along, int x, int y,
                      ImageView<Vec3f> change) noexcept {
  Vec3f sent{};
  for (float s = kFirst; s <= end; s += 1.0F) {
    const float px = static_cast<float>(x) + s * along.x;
    const float py = static_cast<float>(y) + s * along.y;
    const int x0 = static_cast<int>(std::floor(px));
    const int y0 = static_cast<int>(std::floor(py));
    if (x0 < -1 || y0 < -1 || x0 >= change.width() || y0 >= change.height()) break;
    const Vec3f here = source * (1.0F / (s * s - 0.25F));  // the integral from s - 1/2 to s + 1/2
    const float u = px - static_cast<float>(x0);
    const float v = py - static_cast<float>(y0);
    const auto add = [&](int cx, int cy, float share) {
      if (cx < 0 || cy < 0 || cx >= change.width() || cy >= change.height()) return;
      change(cx, cy) += here * share;
      sent += here * share;
    };
    add(x0, y0, (1.0F - u) * (1.0F - v));
    add(x0 + 1, y0, u * (1.0F - v));
    add(x0, y0 + 1, (1.0F - u) * v);
    add(x0 + 1, y0 + 1, u * v);
  }
  change(x, y) -= sent;
}

inline void scatter(const StarburstParams& params, const Vec3f& strength, ImageView<const Vec3f> in,
                    ImageView<Vec3f> change) noexcept {
  Vec2f along[kMaxSpikes];
  const int spikes = spike_count(params);
  for (int i = 0; i < spikes; ++i) {
    const float degrees = params.turn_deg + 360.0F * static_cast<float>(i) / static_cast<float>(spikes);
    along[i] = {std::cos(degrees * 0.017453292519943295F), std::sin(degrees * 0.017453292519943295F)};
  }
  for (int y = 0; y < in.height(); ++y) {
    for (int x = 0; x < in.width(); ++x) {
      const Vec3f light = sane_sample(in(x, y));
      const float brightest = max_of(light.x, light.y, light.z);
      const float capped = brightest > params.cap ? params.cap / brightest : 1.0F;
      const Vec3f source = light * strength * capped;
      const float end = std::sqrt(max_of(source.x, source.y, source.z) / params.least);
      if (brightest < params.lamp || end < kFirst) continue;
      for (int i = 0; i < spikes; ++i) add_spike(source, end, along[i], x, y, change);
    }
  }
}

}  // namespace starburst_detail

// focal_px: of the lens, which makes angles of pixels. `out` may be `in`.
template <class Executor>
[[nodiscard]] Status add_starburst(const StarburstParams& params, float focal_px, ImageView<const Vec3f> in,
                                   ImageView<Vec3f> out, Workspace& workspace, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(check_images(in, out));
  if (!(focal_px > 0.0F && focal_px <= 1e6F)) {
    return {StatusCode::invalid_argument, "starburst: focal length in (0, 1e6] px"};
  }
  const WorkspaceScope scope(workspace);
  const Shape shape = in.shape();
  ImageView<Vec3f> change;  // what spikes bring and lamps lose
  if (has_starburst(params)) {
    const Vec3f strength = spike_strength(params, focal_px);
    if (strength.x * static_cast<float>(spike_count(params)) > 0.5F) {
      return {StatusCode::invalid_argument, "starburst: so small an iris would diffract a third of the light"};
    }
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, change));
    for_rows(executor, shape.height, [&](int y) {
      for (int x = 0; x < shape.width; ++x) change(x, y) = {};
    });
    starburst_detail::scatter(params, strength, in, change);
  }
  for_rows(executor, shape.height, [&](int y) {
    for (int x = 0; x < shape.width; ++x) {
      const Vec3f light = sane_sample(in(x, y));
      out(x, y) = change.empty() ? light : sane_sample(light + change(x, y));
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_STARBURST_HPP
