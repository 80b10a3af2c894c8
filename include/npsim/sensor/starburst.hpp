// SPDX-License-Identifier: Apache-2.0
// Starbursts: the light of lamps that straight edges diffract, of an iris a spike to either side of every blade, of a
// wiped windscreen one streak.
#ifndef NPSIM_SENSOR_STARBURST_HPP
#define NPSIM_SENSOR_STARBURST_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/sensor/detail/signal.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Of the light that passes an opening of area A and perimeter P the share beyond the angle t is, at many times the
// width of the core,  lambda P / (2 pi^2 A t)  (2 lambda / (pi^2 D t) for a disc of diameter D: Born and Wolf,
// "Principles of optics", 8.5.2; the edges alone send it, Keller, "Geometrical theory of diffraction", J. Opt. Soc. Am.
// 52(2), 1962). A round iris spreads it as rings, which the halo holds. A polygon of n blades sends
// it along the normals of its edges: 2 n spikes of 1 / (2 n) of it each, which fall on each other where n is even. For
// a regular one P / A = 2 / apothem. So along a spike, in pixels s with t = s / focal,
//   light between s and s + ds  =  I c ds / s^2,   c = lambda focal / (2 pi^2 apothem n).
// lambda: 610, 540 and 460 nm for red, green and blue, so spikes are reddish.
// A wiper leaves a film of parallel stripes on a windscreen, whose edges do the same across them: one streak through
// every lamp, of all colours alike since stripes differ in width, with c = focal `streak` / 57.3 to each side.
// Spikes are a pixel wide (lambda / edge is less than that for most lenses) and go from the second column of the
// picture beside the lamp, or row where they are steeper, to the border or to where a pixel gets less than `least`;
// what is not sent out stays in the lamp. What is dimmer than `lamp` sends none, which would be lost beside it.
//
// Every spike has another opposite to it. So the picture is cut along each direction into lines a pixel wide; what the
// lamps on a line's pixels send is summed up along it and laid down once. Its middle passes them within half a pixel:
// from picture to picture a spike may move by a pixel against its lamp.
// Invariants: out >= 0; sum(out) == sum(in) within 1e-5 relative, up to 8192 pixels a side; neither blades nor streak:
// a copy.
// Error: the equation within 5 % of the light that hexagons, pentagons and octagons diffract (Fourier transforms of
// them, from 6 lambda / D on); each column of a spike, or row, within 1e-4 of the equation, as long as it gets `least`
// and up to 8192 pixels a side.
// Cost: two passes over the picture, and one over what the lines of each direction reach. The lines are one thread's.
// Memory: 24 bytes for each pixel that is a lamp, of which all may be, and 200 for each pixel of the longer side.

struct StarburstParams {
  int blades = 0;            // of the iris, 3 to 31; 0: it is round, or wide open
  float turn_deg = 0.0F;     // of the iris, clockwise; the first blade's normal points to the right at 0
  float apothem_mm = 0.65F;  // from the middle of the opening to a blade; focal length / f-number / 2 nearly
  float streak = 0.0F;       // share of a lamp's light that the windscreen sends further than a degree, to each side
  float streak_deg = 0.0F;   // of the streak, clockwise; along the rows at 0
  float least = 1e-3F;       // cd/m2 of a spike that are worth a pixel
  float lamp = 20.0F;        // cd/m2 of what has spikes
  float cap = 1e6F;          // cd/m2, as GlareParams has it
};

[[nodiscard]] inline Status validate(const StarburstParams& p) noexcept {
  const bool good = (p.blades == 0 || (p.blades >= 3 && p.blades <= 31)) && std::fabs(p.turn_deg) <= 360.0F &&
                    p.apothem_mm >= 0.05F && p.apothem_mm <= 100.0F && p.streak >= 0.0F && p.streak <= 0.002F &&
                    std::fabs(p.streak_deg) <= 360.0F && p.least >= 1e-6F && p.least <= 1e6F && p.lamp >= 0.0F &&
                    p.lamp <= kMaxSample && p.cap > 0.0F && p.cap <= kMaxSample;
  return good ? Status()
              : Status(StatusCode::invalid_argument,
                       "starburst: blades 0 or 3 to 31, angles in [-360, 360] degrees, apothem in [.05, 100] "
                       "mm, streak in [0, .002], least in [1e-6, 1e6], lamp in [0, 1e12], cap in (0, 1e12] cd/m2");
}

[[nodiscard]] constexpr bool has_starburst(const StarburstParams& p) noexcept {
  return p.blades > 0 || p.streak > 0.0F;
}

namespace starburst_detail {

inline constexpr float kRadiansPerDegree = 0.017453292519943295F;

// Two opposite spikes.
struct Axis {
  Vec2f along;
  Vec3f strength;  // c of the equation, px
};

struct Axes {
  Axis axis[32];  // of 31 blades and a streak
  int count = 0;

  void add(float degrees, const Vec3f& strength) noexcept {
    const float radians = degrees * kRadiansPerDegree;
    axis[count++] = {{std::cos(radians), std::sin(radians)}, strength};
  }
};

[[nodiscard]] inline Axes axes_of(const StarburstParams& p, float focal_px) noexcept {
  Axes axes;
  constexpr float kTwoPiSquared = 19.7392088F;
  const Vec3f wavelength_mm{610e-6F, 540e-6F, 460e-6F};
  const bool even = p.blades % 2 == 0;  // opposite blades share their spikes
  const int count = even ? p.blades / 2 : p.blades;
  const auto blades = static_cast<float>(p.blades);
  for (int i = 0; i < count; ++i) {
    axes.add(p.turn_deg + 360.0F * static_cast<float>(i) / blades,
             wavelength_mm * (focal_px * (even ? 2.0F : 1.0F) / (kTwoPiSquared * p.apothem_mm * blades)));
  }
  if (p.streak > 0.0F) {
    const float c = p.streak * focal_px * kRadiansPerDegree;
    axes.add(p.streak_deg, {c, c, c});
  }
  return axes;
}

// From one to another.
struct Steps {
  int from = 0;
  int to = -1;

  void add(const Steps& more) noexcept {
    if (more.to < more.from) return;
    from = more.from < from ? more.from : from;
    to = max_of(to, more.to);
  }
};

// The picture cut into lines along an axis. A line's steps are the columns, or the rows where the axis is steep, and
// each has one of the line's pixels.
struct Lines {
  bool steep = false;
  float pace = 1.0F;   // steps a pixel of the spike's length
  float slope = 0.0F;  // pixels across a step
  int steps = 0;
  int across = 0;
  int first = 0;  // where the first line begins, across
  int count = 0;

  Lines(const Axis& axis, Shape shape) noexcept : steep(std::fabs(axis.along.y) >= std::fabs(axis.along.x)) {
    const float forward = steep ? axis.along.y : axis.along.x;
    pace = std::fabs(forward);
    slope = (steep ? axis.along.x : axis.along.y) / forward;
    steps = steep ? shape.height : shape.width;
    across = steep ? shape.width : shape.height;
    const int last = shift(steps - 1);
    first = last > 0 ? -last : 0;
    count = across + (last > 0 ? last : -last);
  }
  [[nodiscard]] int shift(int step) const noexcept {
    return static_cast<int>(std::floor(slope * static_cast<float>(step) + 0.5F));
  }
  [[nodiscard]] int step_of(int x, int y) const noexcept { return steep ? y : x; }
  [[nodiscard]] int line_of(int x, int y) const noexcept { return (steep ? x : y) - shift(step_of(x, y)) - first; }
  // The steps of a line that has pixels.
  [[nodiscard]] Steps steps_of(int line) const noexcept {
    if (slope == 0.0F) return {0, steps - 1};
    const auto inside = [&](int step) {
      const int at = line + first + shift(step);
      return at >= 0 && at < across;
    };
    const auto begin = static_cast<float>(line + first);
    const auto crossing = [&](float border) {
      return static_cast<int>(clamp_to((border - 0.5F - begin) / slope, 0.0F, static_cast<float>(steps - 1)));
    };
    const int low = crossing(0.0F);
    const int high = crossing(static_cast<float>(across));
    Steps r = slope > 0.0F ? Steps{low, high} : Steps{high, low};
    if (r.to < steps - 1) ++r.to;
    while (!inside(r.from)) ++r.from;
    while (!inside(r.to)) --r.to;
    return r;
  }
};

struct Lamp {
  Vec3f light;  // at most `cap`
  int x;
  int y;
};

// Lines beside each other whose light is summed up and laid down together.
inline constexpr int kBundle = 16;

// What is sent along a bundle's lines: every channel of every line, one after the other.
struct BundleLight {
  Span<float> sums;
  int steps = 0;

  [[nodiscard]] float* channel(int line, int c) const noexcept { return sums.data() + (3 * line + c) * steps; }
};

// 1 / (k^2 - 1/4), the integral of 1 / s^2 from k - 1/2 to k + 1/2, for |k| >= 2: from -(steps - 1) to steps - 1.
inline void fill_table(int steps, Span<float> table) noexcept {
  for (int k = 1 - steps; k < steps; ++k) {
    const auto s = static_cast<float>(k);
    table[static_cast<std::size_t>(k + steps - 1)] = k > -2 && k < 2 ? 0.0F : 1.0F / (s * s - 0.25F);
  }
}

// What the table holds from 2 to k.
[[nodiscard]] constexpr float sum_of_table(int k) noexcept {
  return k < 2 ? 0.0F : 1.0F / 1.5F - 1.0F / (static_cast<float>(k) + 0.5F);
}

// Adds a lamp's two spikes to its line, which has the steps `whole`, and takes their light out of its pixel. Returns
// how far they go.
inline Steps add_spikes(int step, const Steps& whole, const Vec3f& each, float least, Span<const float> table,
                        const BundleLight& light, int line, Vec3f& lamp) noexcept {
  using F = simd::F32;
  const float reach = std::sqrt(max_of(each.x, each.y, each.z) / least);
  const int longest = reach < static_cast<float>(light.steps) ? static_cast<int>(reach) : light.steps;
  if (longest < 2) return {};
  const Steps r{max_of(whole.from, step - longest), step + longest < whole.to ? step + longest : whole.to};
  const float* weights = table.data() + (r.from - step + light.steps - 1);
  const int n = r.to - r.from + 1;
  for (int c = 0; c < 3; ++c) {
    const F source((&each.x)[c]);
    float* const sum = light.channel(line, c) + r.from;
    for_batches<F>(n, [&](int i, int lanes) {
      store_first(load_first<F>(sum + i, lanes) + source * load_first<F>(weights + i, lanes), sum + i, lanes);
    });
  }
  lamp -= each * (sum_of_table(step - r.from) + sum_of_table(r.to - step));
  return r;
}

// Puts the light of n lines, of which the first is `line`, into the two pixels of each step between which each passes,
// and clears it. Step by step: lines that lie side by side share the picture's cache lines.
inline void lay_down(const Lines& lines, int line, int n, const Steps* reach, const BundleLight& light,
                     ImageView<Vec3f> out) noexcept {
  Steps all{lines.steps, -1};
  for (int i = 0; i < n; ++i) all.add(reach[i]);
  for (int step = all.from; step <= all.to; ++step) {
    const float at = static_cast<float>(line + lines.first) + lines.slope * static_cast<float>(step);
    const auto below = std::floor(at);
    const float share = at - below;
    const auto add = [&](int across, const Vec3f& part) {
      const int inside = clamp_to(across, 0, lines.across - 1);
      (lines.steep ? out(inside, step) : out(step, inside)) += part;
    };
    for (int i = 0; i < n; ++i) {
      if (step < reach[i].from || step > reach[i].to) continue;
      Vec3f whole;
      for (int c = 0; c < 3; ++c) {
        float& sum = light.channel(i, c)[step];
        (&whole.x)[c] = sum;
        sum = 0.0F;
      }
      const int across = static_cast<int>(below) + i;
      add(across, whole * (1.0F - share));
      if (share > 0.0F) add(across + 1, whole * share);
    }
  }
}

[[nodiscard]] constexpr bool is_lamp(const Vec3f& light, float lamp) noexcept {
  return max_of(light.x, light.y, light.z) >= lamp;
}

// Copies a row of n pixels as light; returns how many are lamps.
inline std::uint32_t take_row(const Vec3f* from, int n, float lamp, Vec3f* to) noexcept {
  using F = simd::F32;
  F most(0.0F);
  for_batches<F>(3 * n, [&](int i, int lanes) {
    const F sane = load_sane<F>(&from->x + i, lanes);
    store_first(sane, &to->x + i, lanes);
    most = max(sane, most);
  });
  if (none(most >= F(lamp))) return 0;
  std::uint32_t count = 0;
  for (int x = 0; x < n; ++x) count += is_lamp(to[x], lamp) ? 1U : 0U;
  return count;
}

// The lamps of the rows that have any, in their order.
inline void collect_lamps(const StarburstParams& params, ImageView<const Vec3f> image,
                          Span<const std::uint32_t> lamps_of_row, Span<Lamp> lamps) noexcept {
  std::size_t count = 0;
  for (int y = 0; y < image.height(); ++y) {
    if (lamps_of_row[static_cast<std::size_t>(y)] == 0) continue;
    for (int x = 0; x < image.width(); ++x) {
      if (is_lamp(image(x, y), params.lamp)) lamps[count++] = {capped(image(x, y), params.cap), x, y};
    }
  }
}

// What the lines of one axis need.
struct Sorted {
  Span<std::uint32_t> lamps;  // by line
  Span<std::uint32_t> ends;   // of lines, in lamps
};

// Lamps by their lines, in their order within one.
inline void sort_by_line(const Lines& lines, Span<const Lamp> lamps, const Sorted& sorted) noexcept {
  for (std::uint32_t& end : sorted.ends) end = 0;
  const auto line_of = [&](const Lamp& lamp) { return static_cast<std::size_t>(lines.line_of(lamp.x, lamp.y)); };
  for (const Lamp& lamp : lamps) ++sorted.ends[line_of(lamp) + 1];
  for (std::size_t i = 1; i < sorted.ends.size(); ++i) sorted.ends[i] += sorted.ends[i - 1];
  for (std::size_t i = 0; i < lamps.size(); ++i) {
    sorted.lamps[sorted.ends[line_of(lamps[i])]++] = static_cast<std::uint32_t>(i);
  }
}

// Adds what lamps send along an axis. sorted, table, light: room, of which light is dark before and after.
inline void add_axis(const StarburstParams& params, const Axis& axis, Span<const Lamp> lamps, const Sorted& sorted,
                     Span<float> table, BundleLight light, ImageView<Vec3f> out) noexcept {
  const Lines lines(axis, out.shape());
  light.steps = lines.steps;
  fill_table(lines.steps, table);
  sort_by_line(lines, lamps, sorted);
  std::size_t next = 0;
  for (int bundle = 0; bundle < lines.count; bundle += kBundle) {
    const int n = lines.count - bundle < kBundle ? lines.count - bundle : kBundle;
    Steps reach[kBundle];
    for (int i = 0; i < n; ++i) {
      const std::size_t end = sorted.ends[static_cast<std::size_t>(bundle + i)];
      if (next == end) continue;
      const Steps whole = lines.steps_of(bundle + i);
      reach[i].from = lines.steps;
      for (; next < end; ++next) {
        const Lamp& lamp = lamps[sorted.lamps[next]];
        reach[i].add(add_spikes(lines.step_of(lamp.x, lamp.y), whole, lamp.light * axis.strength * lines.pace,
                                params.least, table, light, i, out(lamp.x, lamp.y)));
      }
    }
    lay_down(lines, bundle, n, reach, light, out);
  }
}

// Longest side, and lines of any axis.
[[nodiscard]] constexpr std::size_t longest_side(Shape shape) noexcept {
  return static_cast<std::size_t>(max_of(shape.width, shape.height));
}
[[nodiscard]] constexpr std::size_t most_lines(Shape shape) noexcept {
  return static_cast<std::size_t>(shape.width) + static_cast<std::size_t>(shape.height);
}

}  // namespace starburst_detail

[[nodiscard]] constexpr std::size_t starburst_workspace_bytes(const StarburstParams& p, Shape shape) noexcept {
  namespace d = starburst_detail;
  if (!has_starburst(p) || shape.empty()) return kWorkspaceAlignment;
  const std::size_t side = d::longest_side(shape);
  return kWorkspaceAlignment + allocation_bytes<std::uint32_t>(static_cast<std::size_t>(shape.height)) +
         allocation_bytes<d::Lamp>(shape.pixels()) + allocation_bytes<std::uint32_t>(shape.pixels()) +
         allocation_bytes<std::uint32_t>(d::most_lines(shape) + 1) + allocation_bytes<float>(3 * d::kBundle * side) +
         allocation_bytes<float>(2 * side);
}

// focal_px: of the lens, which makes angles of pixels. `out` may be `in`.
template <class Executor>
[[nodiscard]] Status add_starburst(const StarburstParams& params, float focal_px, ImageView<const Vec3f> in,
                                   ImageView<Vec3f> out, Workspace& workspace, Executor& executor) {
  namespace d = starburst_detail;
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(check_images(in, out));
  if (!(focal_px > 0.0F && focal_px <= 1e6F)) {
    return {StatusCode::invalid_argument, "starburst: focal length in (0, 1e6] px"};
  }
  const d::Axes axes = has_starburst(params) ? d::axes_of(params, focal_px) : d::Axes{};
  float strength = 0.0F;
  for (int i = 0; i < axes.count; ++i) strength += 2.0F * axes.axis[i].strength.x;
  if (strength > 0.5F) {
    return {StatusCode::invalid_argument,
            "starburst: at this focal length spikes and streak would take a third of the light"};
  }
  const WorkspaceScope scope(workspace);
  const Shape shape = in.shape();
  if (axes.count == 0) {
    for_rows(executor, shape.height, [&](int y) { (void)d::take_row(in.row(y), shape.width, 0.0F, out.row(y)); });
    return {};
  }
  Span<std::uint32_t> lamps_of_row;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(shape.height), lamps_of_row));
  for_rows(executor, shape.height, [&](int y) {
    lamps_of_row[static_cast<std::size_t>(y)] = d::take_row(in.row(y), shape.width, params.lamp, out.row(y));
  });
  std::size_t count = 0;
  for (const std::uint32_t of_row : lamps_of_row) count += of_row;
  if (count == 0) return {};

  Span<d::Lamp> lamps;
  d::Sorted sorted;
  Span<float> table;
  d::BundleLight light;
  const std::size_t side = d::longest_side(shape);
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, lamps));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, sorted.lamps));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(d::most_lines(shape) + 1, sorted.ends));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(3 * d::kBundle * side, light.sums));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(2 * side, table));
  d::collect_lamps(params, out, lamps_of_row, lamps);
  for (float& sum : light.sums) sum = 0.0F;
  for (int a = 0; a < axes.count; ++a) {
    d::add_axis(params, axes.axis[a], lamps, sorted, table, light, out);
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_STARBURST_HPP
