// SPDX-License-Identifier: Apache-2.0
// Cars as bodies: what depth shows of paint and glass, drawn to the two upright sides that a car turns to the camera.
//
// Matching finds what glass mirrors or shows behind it, guesses on plain paint, and mixes a car's rim with what is
// behind it: errors half a metre deep and a metre wide, which no local fit tells from shape, and whose normals make
// night out of the lit side of a car. A network lays cars down along the road.
//   Heading and distances: of all rectangles on the ground, turned by kTurn_rad at a time and then finer, the one whose
//   near corner explains inverse depth best, between belt_low_m and belt_high_m above the ground, where cars are
//   upright and not of glass. A ray meets the box where the nearer plane's 1/z is the smaller one, and each plane is
//   n . p = -distance, so that 1/z = -(n . ray) / distance: distances are medians, and the search is over angles alone
//   (after L-shape fitting, Zhang et al., IV 2017, which has laser points and squared distances).
//   Of a car that shows nothing between the belts since something nearer covers it, the rectangle stands along the
//   street, as far away as all that is seen of the car.
//   Profile: each row of pixels on one side has one distance, the median of its own, then the median of the rows over
//   window_m, and their mean. How it recedes with height is how far the side leans: bonnet, windscreen, roof. A side
//   wider than side_m is no end: its rows are within a hand of its doors, and it leans as cars do (lean_of_side()),
//   which below the waist an end does too, and above it the more (lean_of_end()) the less depth is known.
//   Stance: a side that would stand beyond the place where its outline meets the ground or behind a farther car that it
//   covers, or an end that would not overhang the wheels beside it, comes as much nearer, each plane by most_shift at
//   most. Wheels are dark and round, and stereo sees them, and what is above them, too far: .04 of 15 to 50 m on real
//   frames. What the label has too much below a wheel counts as wheel. Where the ground below is no carriageway the
//   ground plane counts if it is lower, for wheels may stand behind a pavement. Farther cars come first.
//   Blend: where both planes are within some corner_m of each other the corner is round, and so it is at the car's own
//   outline, with the radius rim_m (detail/things/car_rim.hpp).
// A normal turns to the body's where it is farther than a bound from it, up to that bound: what is curved stays so. The
// bound is turn_rad on exact depth and half of that where depth is known to calm_m, for its noise becomes the normals'.
// Depth keeps what it is off the body as measured where that is little, half of `deviations` of the noise, and less of
// what is more.
// Invariant: pixels of other things are not touched, nor cars that show their doors and no box explains (max_loss),
// that have no number of their own, or fewer than min_px. No normal comes to look away from the camera.
// Deterministic. Cost: some 10 medians of a car's rows, and 19 x 10 of 2048 samples.
#ifndef NPSIM_DEPTH_DETAIL_THINGS_CAR_BODIES_HPP
#define NPSIM_DEPTH_DETAIL_THINGS_CAR_BODIES_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/detail/ground_level.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/depth/detail/things/car_corner.hpp"
#include "npsim/depth/detail/things/car_rim.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct CarBodiesParams {
  bool enabled = true;
  LabelSet cars = LabelSet::of(label::car);
  float min_px = 400.0F;  // of an image 2048 x 1024
  float belt_low_m = 0.25F;
  float belt_high_m = 0.95F;
  float relief_m = 0.05F;  // of what is upright: handles, arches, bumpers
  float max_loss = 4.0F;   // mean difference from the box in deviations of noise and relief, each at most 6
  float window_m = 0.3F;
  float side_m = 2.0F;  // wider than what is seen of any end, less a tenth of it on either side
  float corner_m = 0.15F;
  float rim_m = 0.3F;
  float turn_rad = 0.35F;
  float calm_m = 0.25F;
  float deviations = 4.0F;
  float contact_share = 0.1F;  // of the columns of a side: as many may meet the ground nearer than it stands
  float overhang_m = 0.7F;     // of an end before the wheels of the side beside it: bumpers lie .6 to 1 m before axles
  float most_shift = 0.1F;     // of its distance; 0: cars stay where they are
};

[[nodiscard]] inline Status validate(const CarBodiesParams& p) noexcept {
  const bool good = p.min_px > 0.0F && p.belt_low_m >= 0.0F && p.belt_high_m > p.belt_low_m && p.relief_m >= 0.0F &&
                    p.max_loss >= 0.0F && p.window_m > 0.0F && p.window_m <= 10.0F && p.side_m > 0.0F &&
                    p.corner_m > 0.0F && p.rim_m > 0.0F && p.turn_rad >= 0.0F && p.turn_rad <= 3.1416F &&
                    p.calm_m > 0.0F && p.deviations > 0.0F && p.contact_share >= 0.0F && p.contact_share < 1.0F &&
                    p.overhang_m >= 0.0F && std::isfinite(p.overhang_m) && p.most_shift >= 0.0F && p.most_shift < 1.0F;
  return good ? Status() : Status(StatusCode::invalid_argument, "car bodies: a parameter lies outside its range");
}

namespace car_detail {

inline constexpr std::size_t kMaxCars = 1024;
inline constexpr std::size_t kMaxSamples = 2048;

// Share of a car's height at which it is widest, and upright.
inline constexpr float kWaist = 0.42F;

// How far the side of a car leans at this share of its height: sill, lower door, upper door, windows, the roof's edge.
[[nodiscard]] inline float lean_of_side(float share) noexcept {
  const auto ramp = [share](float from, float to) { return clamp_to((share - from) / (to - from), 0.0F, 1.0F); };
  return 0.3F * (ramp(0.14F, 0.28F) - 1.0F) + 0.2F * (ramp(0.14F, kWaist) - 1.0F) + 0.44F * ramp(0.55F, 0.65F) +
         0.61F * ramp(0.82F, 0.94F);
}

// The same of an end: above the waist windscreens and rear windows of cars lie between those of estates and coupes.
[[nodiscard]] inline float lean_of_end(float share) noexcept {
  return lean_of_side(share) + 0.3F * clamp_to((share - 0.55F) / 0.15F, 0.0F, 1.0F);
}

struct Car {
  std::uint16_t id = 0;
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;  // its pixels lie in [x0, x1) x [y0, y1)
  std::size_t pixels = 0;
};

// A row of pixels on one side of a car. 0: not known.
struct Row {
  float seen_m = 0.0F;      // median distance of its pixels from the camera, along the side's normal
  float distance_m = 0.0F;  // the same over the rows around it
  float height_m = 0.0F;    // above the ground
  float lean_rad = 0.0F;
};

// Unknown rows take their value from the known ones around them. False where there is none.
[[nodiscard]] inline bool fill_rows(Span<Row> rows, float Row::*value) noexcept {
  const std::size_t n = rows.size();
  std::size_t known = n;  // the last one
  for (std::size_t i = 0; i < n; ++i) {
    const float to = rows[i].*value;
    if (!(to > 0.0F)) continue;
    const float from = known == n ? to : rows[known].*value;
    const std::size_t first = known == n ? 0 : known + 1;
    for (std::size_t j = first; j < i; ++j) {
      rows[j].*value = from + (to - from) * (static_cast<float>(j + 1 - first) / static_cast<float>(i + 1 - first));
    }
    known = i;
  }
  for (std::size_t j = known + 1; j < n; ++j) rows[j].*value = rows[known].*value;
  return known != n;
}

// What the steps for one car share.
struct CarFit {
  const CarBodiesParams& params;
  ImageView<const float> depth;
  const ObjectMap& objects;
  const DepthNoise& noise;
  const Intrinsics& camera;
  const GroundPlane& ground;
  Span<Sample> samples;
  Span<float> scratch;
  Span<Row> rows[2];                    // of the image's height
  Span<const std::uint16_t> car_of_id;  // one more than its place among the cars
  Span<const Car> cars;
  Car car;
  Corner corner;
  float z_m = 0.0F;  // of its middle
  bool side[2] = {false, false};
  float top_m[2] = {0.0F, 0.0F};
  float shrinks[2] = {1.0F, 1.0F};  // the distances of the side, for the car to stand where it is seen to

  [[nodiscard]] bool on_car(int x, int y) const noexcept {
    return objects.instances(x, y) == car.id && params.cars.contains(objects.labels(x, y)) &&
           is_valid_depth(depth(x, y));
  }
  [[nodiscard]] Span<Row> own_rows(int k) const noexcept {
    return rows[k].sub(static_cast<std::size_t>(car.y0), static_cast<std::size_t>(car.y1 - car.y0));
  }
  [[nodiscard]] float w(int k, int y, const Vec3f& ray) const noexcept {
    return plane_w(corner.normal[k], rows[k][static_cast<std::size_t>(y)].distance_m, ray);
  }
  // Whether a ray of row y meets side k first.
  [[nodiscard]] bool shows(int k, int y, const Vec3f& ray) const noexcept { return w(k, y, ray) <= w(1 - k, y, ray); }
  // Whether a pixel shows a car farther than this one: of two cars the one that reaches lower is the nearer one.
  [[nodiscard]] bool is_farther_car(int x, int y) const noexcept {
    const std::uint16_t other = car_of_id[objects.instances(x, y)];
    return other != 0 && cars[other - std::size_t{1}].y1 < car.y1;
  }
  // The lowest row of the car in a column; car.y0 - 1: none.
  [[nodiscard]] int lowest_row(int x) const noexcept {
    int y = car.y1 - 1;
    while (y >= car.y0 && !on_car(x, y)) --y;
    return y;
  }
  // How far depth at z is known, from 1 down: a half at calm_m.
  [[nodiscard]] float known(float z) const noexcept {
    const float noisy = noise.deviation(1.0F / z) * z * z / params.calm_m;
    return 1.0F / (1.0F + noisy * noisy);
  }
  // Half the window of rows.
  [[nodiscard]] std::size_t window_px() const noexcept {
    return static_cast<std::size_t>(max_of(2.0F, 0.5F * params.window_m / z_m * camera.fy));
  }
};

// Along the ground, of the samples on side k; a tenth left out at either end.
[[nodiscard]] inline float seen_width_m(const CarFit& fit, Span<const Sample> samples, int k) noexcept {
  const Corner& c = fit.corner;
  std::size_t count = 0;
  for (const Sample& s : samples) {
    const float w = plane_w(c.normal[k], c.distance_m[k], s.ray);
    if (w > plane_w(c.normal[1 - k], c.distance_m[1 - k], s.ray)) continue;
    fit.scratch[count++] = dot(c.normal[1 - k], s.ray) / s.w;
  }
  if (count < 20) return 0.0F;
  const std::size_t out = count / 10;
  float* const first = fit.scratch.data();
  select_nth(first, first + out, first + count);
  const float low = first[out];
  select_nth(first + out, first + (count - 1 - out), first + count);
  return first[count - 1 - out] - low;
}

// Samples of the car between two heights above the ground; returns how many.
[[nodiscard]] inline std::size_t take_samples(CarFit& fit, float low_m, float high_m) noexcept {
  const Car& car = fit.car;
  int step = 1;
  const auto area = static_cast<std::size_t>(car.x1 - car.x0) * static_cast<std::size_t>(car.y1 - car.y0);
  while (area / (static_cast<std::size_t>(step) * static_cast<std::size_t>(step)) > kMaxSamples) ++step;
  std::size_t n = 0;
  for (int y = car.y0; y < car.y1; y += step) {
    for (int x = car.x0; x < car.x1; x += step) {
      if (!fit.on_car(x, y) || n == kMaxSamples) continue;
      const Vec3f ray = unproject_pixel(fit.camera, x, y, 1.0F);
      const float z = fit.depth(x, y);
      const float height = fit.ground.camera_height_m + z * dot(fit.ground.up, ray);
      if (height >= low_m && height <= high_m) fit.samples[n++] = {ray, 1.0F / z};
    }
  }
  return n;
}

// Whether something nearer ends the car below in most of its columns.
[[nodiscard]] inline bool is_covered(const CarFit& fit) noexcept {
  int covered = 0;
  int columns = 0;
  for (int x = fit.car.x0; x < fit.car.x1; ++x) {
    const int y = fit.lowest_row(x);
    if (y < fit.car.y0) continue;
    ++columns;
    if (y + 1 >= fit.depth.height() || !kStandingLabels.contains(fit.objects.labels(x, y + 1))) continue;
    const float before = fit.depth(x, y + 1);
    covered += is_valid_depth(before) && before < fit.depth(x, y) ? 1 : 0;
  }
  return 2 * covered > columns;
}

[[nodiscard]] inline bool find_corner(CarFit& fit) noexcept {
  constexpr std::size_t kFewest = 64;
  std::size_t n = take_samples(fit, fit.params.belt_low_m, fit.params.belt_high_m);
  const bool hidden = n < kFewest && is_covered(fit);
  if (hidden) n = take_samples(fit, fit.params.belt_low_m, std::numeric_limits<float>::infinity());
  if (n < kFewest) return false;
  const Span<const Sample> samples = fit.samples.sub(0, n);
  Vec3f middle;
  for (const Sample& s : samples) middle += s.ray * (1.0F / s.w);
  middle = middle * (1.0F / static_cast<float>(n));
  fit.z_m = middle.z;
  if (hidden) {
    const Vec3f forward = forward_on_ground(fit.ground);
    fit.corner =
        corner_at(fit.noise, fit.params.relief_m, cross(forward, fit.ground.up), forward, middle, samples, fit.scratch);
  } else {
    fit.corner = fit_corner(fit.noise, fit.params.relief_m, fit.ground, middle, samples, fit.scratch);
    if (fit.corner.loss > fit.params.max_loss) return false;
  }
  // Over all its height: what stands before a car hides its doors first.
  const Span<const Sample> all = fit.samples.sub(0, take_samples(fit, 0.0F, std::numeric_limits<float>::infinity()));
  const float width_m[2] = {seen_width_m(fit, all, 0), seen_width_m(fit, all, 1)};
  for (int k = 0; k < 2; ++k) fit.side[k] = width_m[k] > fit.params.side_m && width_m[k] > width_m[1 - k];
  return true;
}

// Median distance and mean height of each row of side k, over the pixels that are its own.
inline void see_rows(CarFit& fit, int k) noexcept {
  for (int y = fit.car.y0; y < fit.car.y1; ++y) {
    std::size_t count = 0;
    float rise = 0.0F;
    for (int x = fit.car.x0; x < fit.car.x1; ++x) {
      if (!fit.on_car(x, y)) continue;
      const Vec3f ray = unproject_pixel(fit.camera, x, y, 1.0F);
      const float a = -dot(fit.corner.normal[k], ray);
      if (a < 0.05F || !fit.shows(k, y, ray)) continue;
      fit.scratch[count++] = fit.depth(x, y) * a;
      rise += dot(fit.ground.up, ray) / a;
    }
    Row& row = fit.rows[k][static_cast<std::size_t>(y)];
    row.seen_m = count >= 4 ? median(fit.scratch.sub(0, count)) : 0.0F;
    row.height_m = count >= 4 ? rise / static_cast<float>(count) : 0.0F;  // for now: per metre of distance
  }
}

// The rows within `window` of row i, of n: [first, end).
struct RowsAround {
  std::size_t first, end;
  RowsAround(std::size_t i, std::size_t n, std::size_t window) noexcept
      : first(i < window ? 0 : i - window), end(std::min(i + window + 1, n)) {}
};

// Medians have steps, which the edge between both sides would show: their mean over the rows within `window`.
inline void average_rows(Span<Row> rows, std::size_t window) noexcept {
  for (Row& row : rows) row.lean_rad = row.distance_m;  // for now
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const RowsAround around(i, rows.size(), window);
    float sum = 0.0F;
    for (std::size_t j = around.first; j < around.end; ++j) sum += rows[j].lean_rad;
    rows[i].distance_m = sum / static_cast<float>(around.end - around.first);
  }
}

// A side of which no row is seen keeps its distances.
inline void smooth_rows(CarFit& fit, int k) noexcept {
  const Span<Row> rows = fit.own_rows(k);
  const std::size_t window = fit.window_px();
  bool any = false;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::size_t count = 0;
    const RowsAround around(i, rows.size(), window);
    for (std::size_t j = around.first; j < around.end; ++j) {
      if (rows[j].seen_m > 0.0F && count < fit.scratch.size()) fit.scratch[count++] = rows[j].seen_m;
    }
    const float smooth = count >= 3 ? median(fit.scratch.sub(0, count)) : 0.0F;
    any = any || smooth > 0.0F;
    rows[i].lean_rad = smooth;  // for now
  }
  if (!any) return;
  for (Row& row : rows) row.distance_m = row.lean_rad;
  (void)fill_rows(rows, &Row::distance_m);
  average_rows(rows, window);
  if (!fit.side[k]) return;
  constexpr float kOut_m = 0.1F;  // sills
  constexpr float kIn_m = 0.25F;  // the roof's edge; what seems farther in is seen through glass
  const float door_m = fit.corner.distance_m[k];
  for (Row& row : rows) row.distance_m = clamp_to(row.distance_m, door_m - kOut_m, door_m + kIn_m);
}

// How far each row leans, from how its distance changes with its height.
inline void lean_rows(CarFit& fit, int k) noexcept {
  const Span<Row> rows = fit.own_rows(k);
  for (Row& row : rows) {
    row.lean_rad = 0.0F;
    row.height_m = row.seen_m > 0.0F ? max_of(fit.ground.camera_height_m + row.distance_m * row.height_m, 0.01F) : 0.0F;
  }
  fit.top_m[k] = 0.0F;
  if (!fill_rows(rows, &Row::height_m)) return;
  for (const Row& row : rows) fit.top_m[k] = max_of(fit.top_m[k], row.height_m);
  const std::size_t window = fit.window_px();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const RowsAround around(i, rows.size(), window);
    const float middle = 0.5F * static_cast<float>(around.end - 1 - around.first);
    float back = 0.0F;
    float up = 0.0F;
    for (std::size_t j = around.first; j < around.end; ++j) {
      const float above = middle - static_cast<float>(j - around.first);
      back += above * rows[j].distance_m;
      up += above * rows[j].height_m;
    }
    rows[i].lean_rad = clamp_to(std::atan2(back, max_of(up, 1e-6F)), -0.26F, 1.48F);
  }
}

// The body at a pixel: its depth (0: the ray misses it) and its normal.
[[nodiscard]] inline float body_at(const CarFit& fit, int y, const Vec3f& ray, Vec3f& normal) noexcept {
  const float w[2] = {fit.w(0, y, ray), fit.w(1, y, ray)};
  const float nearest = w[0] < w[1] ? w[0] : w[1];
  if (!(nearest < kAway)) return 0.0F;
  const float known = fit.known(1.0F / nearest);
  Vec3f sum;
  for (int k = 0; k < 2; ++k) {
    const float behind_m = (w[k] - nearest) / (nearest * nearest);
    if (!(behind_m < 20.0F * fit.params.corner_m)) continue;
    const float height = fit.ground.camera_height_m + dot(fit.ground.up, ray) / w[k];
    const float share = height / max_of(fit.top_m[k], 0.5F);
    float lean = lean_of_side(share);
    if (!fit.side[k] && share > kWaist) {
      const float seen = max_of(lean, fit.rows[k][static_cast<std::size_t>(y)].lean_rad);
      lean = lean_of_end(share) + (seen - lean_of_end(share)) * known;
    }
    sum += (fit.corner.normal[k] * std::cos(lean) + fit.ground.up * std::sin(lean)) *
           std::exp(-behind_m / fit.params.corner_m);
  }
  normal = normalized(sum);
  return 1.0F / nearest;
}

// Where the outline of the car meets the ground in column x, and its lowest row there. False: not seen.
[[nodiscard]] inline bool contact_at(const CarFit& fit, ImageView<const float> surface, int x, int& y,
                                     Vec3f& contact) noexcept {
  constexpr LabelSet kCarriageway = LabelSet::of(label::road, label::parking);
  y = fit.lowest_row(x);
  if (y < fit.car.y0 || y + 1 >= surface.height()) return false;
  const Label below = fit.objects.labels(x, y + 1);
  if (!kGroundLabels.contains(below) || !is_valid_depth(surface(x, y + 1))) return false;
  float under_m = depth_detail::below_camera_m(surface, fit.objects.labels, fit.camera, fit.ground.up, x, y + 1);
  if (!kCarriageway.contains(below)) under_m = max_of(under_m, fit.ground.camera_height_m);
  const float fall = depth_detail::fall_of_ray(fit.ground, fit.camera, x, y);
  if (!(fall > 0.0F) || !(under_m > 0.0F)) return false;
  contact = unproject_pixel(fit.camera, x, y, 1.0F) * (under_m / fall);
  return true;
}

// `normal`, or what lies turn_rad from `towards` on the way to it.
[[nodiscard]] inline Vec3f turned(const Vec3f& normal, const Vec3f& towards, float turn_rad) noexcept {
  const float cosine = dot(normal, towards);
  if (normal == Vec3f{}) return towards;
  if (cosine >= std::cos(turn_rad)) return normal;
  const Vec3f aside = normalized(normal - towards * cosine);
  if (aside == Vec3f{}) return towards;
  return towards * std::cos(turn_rad) + aside * std::sin(turn_rad);
}

[[nodiscard]] inline RowEnds ends_of_row(const CarFit& fit, int y) noexcept {
  RowEnds ends{fit.car.x0, fit.car.x1 - 1, {false, false}};
  while (ends.first <= ends.last && !fit.on_car(ends.first, y)) ++ends.first;
  while (ends.first < ends.last && !fit.on_car(ends.last, y)) --ends.last;
  // What stands beside it may stand before it.
  constexpr float kBefore = 0.9F;  // of the car's depth
  const auto behind = [&](int x, int from_x) {
    if (x < 0 || x >= fit.depth.width()) return false;
    const Label beside = fit.objects.labels(x, y);
    if (beside != label::sky && kNoSurfaceLabels.contains(beside)) return false;
    if (!kStandingLabels.contains(beside)) {
      return !is_valid_depth(fit.depth(x, y)) || fit.depth(x, y) > kBefore * fit.depth(from_x, y);
    }
    return fit.is_farther_car(x, y);
  };
  if (ends.first > ends.last) return ends;
  ends.own[0] = behind(ends.first - 1, ends.first);
  ends.own[1] = behind(ends.last + 1, ends.last);
  return ends;
}

// The shrink that all but contact_share of the first `count` in the scratch allow; 1: nothing.
[[nodiscard]] inline float shrink_of(const CarFit& fit, std::size_t count) noexcept {
  constexpr std::size_t kFewest = 8;
  if (count < kFewest) return 1.0F;
  float* const first = fit.scratch.data();
  float* const at = first + static_cast<std::size_t>(fit.params.contact_share * static_cast<float>(count));
  select_nth(first, at, first + count);
  return clamp_to(*at, 1.0F - fit.params.most_shift, 1.0F);
}

// What the distances of side k shrink by for it to lie before_m before what stands in the columns of side `seen`.
[[nodiscard]] inline float shrink_to_contact(const CarFit& fit, ImageView<const float> surface, int k, int seen,
                                             float before_m) noexcept {
  std::size_t count = 0;
  for (int x = fit.car.x0; x < fit.car.x1; ++x) {
    int y = 0;
    Vec3f contact;
    if (!contact_at(fit, surface, x, y, contact)) continue;
    if (!fit.shows(seen, y, contact)) continue;
    const float distance_m = -dot(fit.corner.normal[k], contact) - before_m;
    const float shrink = distance_m / fit.rows[k][static_cast<std::size_t>(y)].distance_m;
    if (shrink > 0.0F) fit.scratch[count++] = shrink;  // else the side is not seen from here
  }
  return shrink_of(fit, count);
}

// The same for it to lie before the farther cars that it covers, at the ends of its rows.
[[nodiscard]] inline float shrink_before_others(const CarFit& fit, ImageView<const float> surface, int k) noexcept {
  std::size_t count = 0;
  for (int y = fit.car.y0; y < fit.car.y1; ++y) {
    const RowEnds ends = ends_of_row(fit, y);
    if (ends.first > ends.last) continue;
    for (const int off : {-1, 1}) {
      const int x = off < 0 ? ends.first : ends.last;
      if (!surface.contains(x + off, y) || !fit.params.cars.contains(fit.objects.labels(x + off, y))) continue;
      if (!fit.is_farther_car(x + off, y)) continue;
      const Vec3f ray = unproject_pixel(fit.camera, x, y, 1.0F);
      const float z = surface(x + off, y);
      if (!is_valid_depth(z) || !fit.shows(k, y, ray) || count == fit.scratch.size()) continue;
      fit.scratch[count++] = fit.w(k, y, ray) * z;
    }
  }
  return shrink_of(fit, count);
}

// surface: of the ground and of farther cars, too.
inline void stand_on_ground(CarFit& fit, ImageView<const float> surface) noexcept {
  for (int k = 0; k < 2; ++k) {
    fit.shrinks[k] = std::min(shrink_to_contact(fit, surface, k, k, 0.0F), shrink_before_others(fit, surface, k));
    if (!fit.side[1 - k]) continue;
    fit.shrinks[k] = std::min(fit.shrinks[k], shrink_to_contact(fit, surface, k, 1 - k, fit.params.overhang_m));
  }
}

template <class Executor>
void draw_to_body(const CarFit& fit, ImageView<Vec3f> normals, ImageView<float> surface, Executor& executor) noexcept {
  const auto rows = static_cast<std::size_t>(fit.car.y1 - fit.car.y0);
  executor.for_chunks(rows, 16, [&](std::size_t begin, std::size_t end) {
    for (int y = fit.car.y0 + static_cast<int>(begin); y < fit.car.y0 + static_cast<int>(end); ++y) {
      const RowEnds ends = ends_of_row(fit, y);
      for (int x = ends.first; x <= ends.last; ++x) {
        if (!fit.on_car(x, y)) continue;
        const Vec3f ray = unproject_pixel(fit.camera, x, y, 1.0F);
        Vec3f normal;
        const float z = body_at(fit, y, ray, normal);
        if (!(z > 0.0F) || normal == Vec3f{}) continue;
        for (int e = 0; e < 2; ++e) {
          if (!ends.own[e]) continue;
          const auto from_px = static_cast<float>(e == 0 ? x - ends.first : ends.last - x) + 0.5F;
          normal = round_at_rim(normal, ray, fit.ground.up, e == 1, from_px * z / fit.camera.fx, fit.params.rim_m);
        }
        const Vec3f towards = turned(normals(x, y), normal, fit.params.turn_rad * fit.known(z));
        if (dot(towards, ray) < 0.0F || dot(normals(x, y), ray) >= 0.0F) normals(x, y) = towards;
        const float here = 1.0F / surface(x, y);
        const float off = (here - 1.0F / z) / max_of(fit.params.deviations * fit.noise.deviation(here), 1e-9F);
        const float stands = std::min(fit.w(0, y, ray) / fit.shrinks[0], fit.w(1, y, ray) / fit.shrinks[1]);
        surface(x, y) = 1.0F / (stands + (here - 1.0F / z) / (1.0F + off * off));
      }
    }
  });
}

struct FartherFirst {
  [[nodiscard]] bool operator()(const Car& a, const Car& b) const noexcept {
    return a.y1 != b.y1 ? a.y1 < b.y1 : a.id < b.id;
  }
};

// Cars with a number of their own, the farther ones first.
[[nodiscard]] inline std::size_t find_cars(const CarBodiesParams& params, const ObjectMap& objects,
                                           Span<std::uint16_t> car_of_id, Span<Car> cars) noexcept {
  const Shape shape = objects.labels.shape();
  std::size_t count = 0;
  for (std::uint16_t& of : car_of_id) of = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const std::uint16_t id = objects.instances(x, y);
      if (id == 0 || !params.cars.contains(objects.labels(x, y))) continue;
      if (car_of_id[id] == 0) {
        if (count == cars.size()) continue;
        cars[count++] = Car{id, x, y, x + 1, y + 1, 0};
        car_of_id[id] = static_cast<std::uint16_t>(count);
      }
      Car& car = cars[car_of_id[id] - std::size_t{1}];
      car.x0 = std::min(car.x0, x);
      car.x1 = std::max(car.x1, x + 1);
      car.y1 = y + 1;
      ++car.pixels;
    }
  }
  std::sort(cars.data(), cars.data() + count, FartherFirst{});
  for (std::size_t i = 0; i < count; ++i) car_of_id[cars[i].id] = static_cast<std::uint16_t>(i + 1);
  return count;
}

}  // namespace car_detail

[[nodiscard]] constexpr std::size_t shape_cars_workspace_bytes(const CarBodiesParams&, Shape shape) noexcept {
  const auto longest = static_cast<std::size_t>(shape.width > shape.height ? shape.width : shape.height);
  return allocation_bytes<std::uint16_t>(65536) + allocation_bytes<car_detail::Car>(car_detail::kMaxCars) +
         allocation_bytes<car_detail::Sample>(car_detail::kMaxSamples) +
         allocation_bytes<float>(max_of(car_detail::kMaxSamples, longest)) +
         2 * allocation_bytes<car_detail::Row>(static_cast<std::size_t>(shape.height)) + kWorkspaceAlignment;
}

// depth: as measured and filled. noise: its. normals, surface: changed in place; surface is the depth that a mesh is
// made of, valid where `depth` is, and not its memory. Without labels, numbers of objects or a ground plane nothing
// changes.
template <class Executor>
[[nodiscard]] Status shape_cars(const CarBodiesParams& params, ImageView<const float> depth, const ObjectMap& objects,
                                const DepthNoise& noise, const Intrinsics& camera, const GroundPlane& ground,
                                ImageView<Vec3f> normals, ImageView<float> surface, Workspace& workspace,
                                Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = depth.shape();
  if (normals.shape() != shape || surface.shape() != shape || !objects.fits(shape)) {
    return {StatusCode::shape_mismatch, "car bodies: all planes must have one shape"};
  }
  if (!params.enabled || objects.labels.empty() || objects.instances.empty() || !(ground.inlier_share > 0.0F))
    return {};
  using namespace car_detail;  // NOLINT(google-build-using-namespace)
  const WorkspaceScope scope(workspace);
  Span<std::uint16_t> car_of_id;
  Span<Car> cars;
  CarFit fit{params, depth, objects, noise, camera, ground, {}, {}, {}, {}, {}, {}, {}};
  const auto longest = static_cast<std::size_t>(std::max(shape.width, shape.height));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(65536, car_of_id));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kMaxCars, cars));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kMaxSamples, fit.samples));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(max_of(kMaxSamples, longest), fit.scratch));
  for (Span<Row>& rows : fit.rows) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(shape.height), rows));
  }
  const float min_px = params.min_px * static_cast<float>(shape.pixels()) / (2048.0F * 1024.0F);
  fit.cars = cars.sub(0, find_cars(params, objects, car_of_id, cars));
  fit.car_of_id = car_of_id;
  for (const Car& car : fit.cars) {
    if (static_cast<float>(car.pixels) < min_px) continue;
    fit.car = car;
    if (!find_corner(fit)) continue;
    for (int k = 0; k < 2; ++k) {
      for (Row& row : fit.own_rows(k)) row = Row{0.0F, fit.corner.distance_m[k], 0.0F, 0.0F};
    }
    constexpr int kRounds = 3;  // which pixels are whose follows from the distances
    for (int round = 0; round < kRounds; ++round) {
      for (int k = 0; k < 2; ++k) {
        see_rows(fit, k);
        smooth_rows(fit, k);
      }
    }
    for (int k = 0; k < 2; ++k) lean_rows(fit, k);
    stand_on_ground(fit, surface);
    draw_to_body(fit, normals, surface, executor);
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_THINGS_CAR_BODIES_HPP
