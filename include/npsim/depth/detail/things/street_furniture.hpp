// SPDX-License-Identifier: Apache-2.0
// Poles and persons as cylinders, signs, signals and hoardings as plates: what errors of depth made of them is drawn to
// what they are.
//
// A mast is as wide as the window that matching compares, as the gap between two points of a laser, or as the edges
// that a network blurs: its depth jumps by metres from row to row, and in the light of one lamp it comes out in bright
// and dark pieces. Pole pixels lie on a pole that stands (their run along the column is the longer one) or on an arm
// that lies.
//   Depth: the median of 1/z of the thing's pixels within reach_m along it, so as far as a straight pole keeps its depth.
//   Normal of what is round: that of a cylinder across the shorter run: over the run it turns from side to side.
//   Normal of a plate: level, towards the camera, for signs and signals face the traffic that sees them.
// What hangs before a house or the sky, of any kind, is a plate too where it is no wider than max_width_m: a shop's sign,
// a hoarding, whose dents face the ground as soon as the street and are black there. What stands on the ground, as bins,
// benches and planters do, may be deep and have a top: it stays.
// Of a plate smaller than plane_m2 a plane of its own says little: at its outline matching bends it, and parts that lie
// on no plane or on another one stand before it by more than noise, so that headlamps cast their shadows on it.
// Invariant: pixels of other labels, what lies on a larger plane of its own and runs of what is round or hangs that are
// wider than max_width_m are not touched. No pixel's new depth is outside of those around it on its thing. Deterministic.
// Cost: for each run of such things the pixels within reach, at most kMaxSamples, and for each pixel its runs, at most
// kLongest_px long.
#ifndef NPSIM_DEPTH_DETAIL_THINGS_STREET_FURNITURE_HPP
#define NPSIM_DEPTH_DETAIL_THINGS_STREET_FURNITURE_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/depth/detail/planes/planar_segments.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct StreetFurnitureParams {
  bool enabled = true;
  LabelSet poles = kPoleLabels;
  LabelSet persons = LabelSet::of(label::person, label::rider);  // with a number of their own; they stand
  LabelSet plates = kSignLabels;
  LabelSet hanging = LabelSet::of(label::static_object);
  LabelSet behind_hanging =  // what is seen below it
      kHouseLabels | kPoleLabels | LabelSet::of(label::vegetation, label::sky);
  float reach_m = 1.5F;      // along the thing, to either side
  float max_width_m = 1.0F;  // of what is round or hangs: larger ones have a shape that can be measured
  float plane_m2 = 2.0F;     // of the plane of a plate: a larger one has the angle that was measured
};

[[nodiscard]] inline Status validate(const StreetFurnitureParams& p) noexcept {
  const bool good = p.reach_m > 0.0F && std::isfinite(p.reach_m) && p.max_width_m > 0.0F && p.plane_m2 >= 0.0F;
  return good ? Status() : Status(StatusCode::invalid_argument, "street furniture: a parameter lies outside its range");
}

namespace furniture_detail {

inline constexpr std::size_t kMaxSamples = 640;
inline constexpr int kLongest_px = 4096;  // of a run

// Pixels of the object around (x, y) along a direction: to either side, itself left out.
struct Run {
  int before = 0;
  int after = 0;
  [[nodiscard]] int length() const noexcept { return before + after + 1; }
};
[[nodiscard]] inline Run run_along(const ObjectMap& objects, int x, int y, int dx, int dy) noexcept {
  const auto count = [&](int sign) {
    int n = 0;
    while (n < kLongest_px && objects.labels.contains(x + (n + 1) * sign * dx, y + (n + 1) * sign * dy) &&
           objects.same(x, y, x + (n + 1) * sign * dx, y + (n + 1) * sign * dy)) {
      ++n;
    }
    return n;
  };
  return {count(-1), count(1)};
}

// Median inverse depth of the thing's pixels on the lines across it within `reach` of (x, y), to the first line without
// any: what is of its class beyond a gap may be another thing; 0 where there is none. Of a large one every second,
// fourth, ... row and column of the picture counts, whatever (x, y): lines that reach as far have the same samples, or
// a median between two depths would make stripes of a plate.
[[nodiscard]] inline float typical_w(ImageView<const float> depth, const ObjectMap& objects, int x, int y, bool stands,
                                     const Run& across, int reach) noexcept {
  std::array<float, kMaxSamples> w;
  std::size_t n = 0;
  int step = 1;
  const auto most = [&](int length) { return static_cast<std::size_t>(length / step + 1); };
  while (step < kLongest_px && most(across.length()) * most(2 * reach + 1) > kMaxSamples) step *= 2;
  const int middle = stands ? y : x;
  const int first = (stands ? x : y) - across.before;
  const int last = (stands ? x : y) + across.after;
  const auto take_line = [&](int line, int begin, int by) {
    bool any = false;
    for (int i = begin; i <= last; i += by) {
      const int u = stands ? i : line;
      const int v = stands ? line : i;
      if (!depth.contains(u, v) || !objects.same(x, y, u, v)) continue;
      any = true;
      if (n < kMaxSamples && is_valid_depth(depth(u, v))) w[n++] = 1.0F / depth(u, v);
    }
    return any;
  };
  const int aligned = (first + step - 1) / step * step;
  const int begin = aligned <= last ? aligned : first;  // of what is thinner than a step
  const int nearest = middle / step * step;
  for (int line = nearest; line >= middle - reach && take_line(line, begin, step); line -= step) {
  }
  for (int line = nearest + step; line <= middle + reach && take_line(line, begin, step); line += step) {
  }
  if (n == 0) take_line(middle, first, 1 + across.length() / static_cast<int>(kMaxSamples));  // between two of them
  if (n == 0) return 0.0F;
  select_nth(w.data(), w.data() + n / 2, w.data() + n);
  return w[n / 2];
}

}  // namespace furniture_detail

// depth: as measured and filled. planes: of it, may be empty. up: of the ground, unit. normals, surface: changed in place;
// surface is the depth that a mesh is made of, and not the memory of `depth`. Without labels nothing changes.
template <class Executor>
[[nodiscard]] Status shape_furniture(const StreetFurnitureParams& params, ImageView<const float> depth,
                                     const ObjectMap& objects, const PlanarMap& planes, const Intrinsics& camera,
                                     const Vec3f& up, ImageView<Vec3f> normals, ImageView<float> surface,
                                     Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = depth.shape();
  NPSIM_RETURN_IF_ERROR(validate(camera));
  if (normals.shape() != shape || surface.shape() != shape || !objects.fits(shape) ||
      !(planes.of.empty() || planes.of.shape() == shape)) {
    return {StatusCode::shape_mismatch, "street furniture: all planes must have one shape"};
  }
  if (!params.enabled || objects.labels.empty()) return {};
  using namespace furniture_detail;  // NOLINT(google-build-using-namespace)
  const auto thing_w = [&](int x, int y, bool stands, const Run& across) {
    const float reach_px = params.reach_m * (stands ? camera.fy : camera.fx) / depth(x, y);
    const int reach =
        static_cast<int>(clamp_to(reach_px, 1.0F, static_cast<float>(stands ? shape.height : shape.width)));
    return typical_w(depth, objects, x, y, stands, across, reach);
  };
  const auto hangs = [&](int x, int y, const Run& column) {
    const int below = y + column.after + 1;
    return below < shape.height && params.behind_hanging.contains(objects.labels(x, below));
  };
  const auto is_small = [&](const PlanarSegment& plane, int x, int y) {
    const Vec3f ray = unproject_pixel(camera, x, y, 1.0F);
    const float w = dot(plane.q, ray);
    const float facing = -dot(plane.normal, normalized(ray));
    return plane.support_px < params.plane_m2 * camera.fx * camera.fy * w * w * facing;
  };
  const auto write = [&](int x, int y, bool plate, bool stands, const Run& across, float w) {
    const float focal = stands ? camera.fx : camera.fy;
    const bool of_any_width = params.plates.contains(objects.labels(x, y));
    const bool wide = static_cast<float>(across.length()) > params.max_width_m * focal * w;
    if (!(w > 0.0F) || (wide && !of_any_width)) return;
    surface(x, y) = 1.0F / w;
    // Square to the axis towards the camera, and from there to the right of a pole that stands, down on an arm.
    const Vec3f ray = unproject_pixel(camera, x, y, 1.0F);
    const Vec3f axis = stands ? up : normalized(cross(ray, up));
    const Vec3f facing = normalized(axis * dot(axis, ray) - ray);
    const Vec3f side = cross(axis, facing);
    const auto off_middle = static_cast<float>(across.before - across.after);
    const float t = plate ? 0.0F : clamp_to(off_middle / static_cast<float>(across.length()), -0.95F, 0.95F);
    normals(x, y) = normalized(facing * std::sqrt(1.0F - t * t) + side * t);
  };
  executor.for_chunks(static_cast<std::size_t>(shape.height), 8, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      float standing_w = 0.0F;  // of the run that x is in; 0: not known yet
      for (int x = 0; x < shape.width; ++x) {
        if (x > 0 && !objects.same(x - 1, y, x, y)) standing_w = 0.0F;
        const Label label = objects.labels(x, y);
        const bool may_hang = params.hanging.contains(label);
        const bool plate = params.plates.contains(label) || may_hang;
        const bool pole = params.poles.contains(label);
        const bool person =
            params.persons.contains(label) && !objects.instances.empty() && objects.instances(x, y) != 0;
        if (!(plate || pole || person) || !is_valid_depth(depth(x, y))) continue;
        if (const PlanarSegment* plane = planes.at(x, y); plane != nullptr && !(plate && is_small(*plane, x, y))) {
          continue;
        }
        const Run row = run_along(objects, x, y, 1, 0);
        const Run column = run_along(objects, x, y, 0, 1);
        if (may_hang && !hangs(x, y, column)) continue;
        if (pole && column.length() < row.length()) {
          write(x, y, false, false, column, thing_w(x, y, false, column));
          continue;
        }
        if (!(standing_w > 0.0F)) standing_w = thing_w(x, y, true, row);
        write(x, y, plate, true, row, standing_w);
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_THINGS_STREET_FURNITURE_HPP
