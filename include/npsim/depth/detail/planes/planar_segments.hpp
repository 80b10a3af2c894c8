// SPDX-License-Identifier: Apache-2.0
// Facades, walls and the sides of large vehicles as planes.
//
// Noise of measured depth is wider than any slope that it could hide: a facade's slope is known to 2 degrees from some
// 80 px at a disparity of 10 px, not from the few that a difference spans. So each object of each square of some 24 px
// gets a robust plane (detail/planes/cells.hpp), upright on the ground where its class stands so as a rule, and houses
// in any case where depth drifts: what leans then leans by that, roofs included, but for what lies below the eye and is
// only called a house. Planes that agree within the noise are united, also across what stands before them (merge.hpp),
// and those with enough support are kept. Inverse depth of a plane is linear in the image, and everything is measured
// in deviations of it (depth_source.hpp).
// A pixel that a plane explains is on it and takes its normal; where several do, neighbours agree (agreed_plane()), and
// borders are straight (edges.hpp). Its depth stays as it was measured: buildings have relief, and on held-out points
// of real frames depth drawn to planes, even within the noise, is worse. Only where nothing was measured does the plane
// stand in (extend_planes()), and where a mismatch makes a dent (PlanarSegmentsParams::dent_m). A bulge as large is on
// the plane, and its depth stays.
// Invariant: all other depth is not touched.
// Deterministic: seeded, and the same for any number of threads.
// Cost: some 500 operations a pixel in planar classes. Memory: 3 bytes per pixel and some 1,300 per square.
#ifndef NPSIM_DEPTH_DETAIL_PLANES_PLANAR_SEGMENTS_HPP
#define NPSIM_DEPTH_DETAIL_PLANES_PLANAR_SEGMENTS_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/depth/detail/planes/assign.hpp"
#include "npsim/depth/detail/planes/cells.hpp"
#include "npsim/depth/detail/planes/edges.hpp"
#include "npsim/depth/detail/planes/merge.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct PlanarSegmentsParams {
  bool enabled = true;
  std::uint64_t seed = 0;
  LabelSet labels =
      LabelSet::of(label::building, label::wall, label::fence, label::guard_rail, label::bridge, label::tunnel,
                   label::traffic_sign, label::truck, label::bus, label::caravan, label::trailer, label::train);
  LabelSet upright = labels;
  LabelSet plumb = kHouseLabels;   // never lean where depth drifts, above the eye
  bool guessed = false;            // labels are: above a laser's rows a car and a crown may have one
  float cell_px = 24.0F;           // of an image 2048 wide
  float min_support_px = 4000.0F;  // of an image 2048 x 1024; fewer, at least three squares, where the noise is so low
  float sure_rad = 0.035F;         // that the plane's angle is known to this
  float relief_m = 0.05F;          // of what counts as one plane
  float inlier = 4.0F;             // deviations; of stereo .7 px
  float outlier = 8.0F;            // where Tukey's weight ends; of stereo 2 px
  float merge_rise = 1.2F;         // of the residual when planes are united, deviations; of stereo .2 px
  float min_share = 0.5F;          // of a cell's samples that its plane explains
  float on_plane = 6.0F;           // deviations within which a pixel takes a plane's normal
  float dent_m = 3.0F;             // what a plane surrounds and lies this far off it is a mismatch
  float dent_px = 64.0F;           // reach of the search for what surrounds a dent, of an image 2048 wide
};

[[nodiscard]] inline Status validate(const PlanarSegmentsParams& p) noexcept {
  const bool good = p.cell_px >= 4.0F && p.cell_px <= 1024.0F && p.min_support_px > 0.0F && p.inlier > 0.0F &&
                    p.outlier > 0.0F && p.merge_rise >= 0.0F && p.min_share >= 0.0F && p.on_plane >= 0.0F;
  return good ? Status() : Status(StatusCode::invalid_argument, "planar segments: a parameter lies outside its range");
}

struct PlanarSegment {
  Vec3f q;       // 1/z = q . (ray_x, ray_y, 1), 1/m
  Vec3f normal;  // unit, towards the camera
  Label label = 0;
  bool upright = false;
  bool plumb = false;  // never leans by its own samples
  float support_px = 0.0F;
  float residual = 0.0F;  // root mean square, deviations
  float turn_rad = 0.0F;  // deviation of the angle about the vertical
  bool squared = false;   // the angle is that of the street, or at right angles to it
};

namespace planes_detail {

// What it costs a cell, in rises at which two planes unite, that a neighbour lies on another plane; that it has none.
inline constexpr double kStray = 2.0;
inline constexpr double kNone = 8.0;
inline constexpr double kSamplesWanted = 32.0;  // of a square
// Of the variance of a sample what the whole plane shares: sub-pixel locking of stereo, relief.
inline constexpr double kShared = 0.03;
inline constexpr float kSure_rad = 0.035F;     // angles known to this make the common one,
inline constexpr double kSquare_rad = 0.0087;  // and those that are not known to this may be it

[[nodiscard]] constexpr int cell_px(const PlanarSegmentsParams& p, Shape shape) noexcept {
  const float px = p.cell_px * static_cast<float>(shape.width) / 2048.0F;
  return px < 6.0F ? 6 : (px > 4096.0F ? 4096 : static_cast<int>(px + 0.5F));
}

// Of the neighbours that a pixel's plane is agreed upon with at first; then half of it, down to the next ones.
[[nodiscard]] constexpr int agreement_px(Shape shape) noexcept {
  const int px = shape.width / 256;
  return px < 1 ? 1 : px;
}

[[nodiscard]] constexpr float min_support_px(const PlanarSegmentsParams& p, Shape shape) noexcept {
  return p.min_support_px * static_cast<float>(shape.pixels()) / (2048.0F * 1024.0F);
}

[[nodiscard]] constexpr std::size_t squares(const PlanarSegmentsParams& p, Shape shape) noexcept {
  const auto px = static_cast<std::size_t>(cell_px(p, shape));
  return ((static_cast<std::size_t>(shape.width) + px - 1) / px) *
         ((static_cast<std::size_t>(shape.height) + px - 1) / px);
}

[[nodiscard]] constexpr std::size_t max_planes(const PlanarSegmentsParams& p, Shape shape) noexcept {
  const std::size_t most = squares(p, shape) * kSlots;
  return most < 65534 ? most : 65534;
}

}  // namespace planes_detail

[[nodiscard]] constexpr std::size_t planar_segments_workspace_bytes(const PlanarSegmentsParams& p,
                                                                    Shape shape) noexcept {
  const std::size_t cells = planes_detail::squares(p, shape) * planes_detail::kSlots;
  return kWorkspaceAlignment + allocation_bytes<std::uint8_t>(shape.pixels()) +
         allocation_bytes<planes_detail::Cell>(cells) + allocation_bytes<planes_detail::Choice>(cells) +
         allocation_bytes<planes_detail::Link>(cells * planes_detail::kLinks) + allocation_bytes<std::uint16_t>(cells) +
         allocation_bytes<planes_detail::PlaneMoments>(planes_detail::max_planes(p, shape)) +
         allocation_bytes<planes_detail::Edge>(planes_detail::max_planes(p, shape) * planes_detail::kEdges) +
         allocation_bytes<std::uint16_t>(shape.pixels());
}

// Segments and, per pixel, the number of its own, 0 for none: segments[n - 1].
struct PlanarMap {
  Span<PlanarSegment> segments;
  ImageView<std::uint16_t> of;

  [[nodiscard]] const PlanarSegment* at(int x, int y) const noexcept {
    return of.empty() || of(x, y) == 0 ? nullptr : &segments[of(x, y) - std::size_t{1}];
  }
};

[[nodiscard]] constexpr std::size_t planar_map_bytes(const PlanarSegmentsParams& p, Shape shape) noexcept {
  return allocation_bytes<PlanarSegment>(planes_detail::max_planes(p, shape)) +
         allocation_bytes<std::uint16_t>(shape.pixels());
}

// Memory for the result, which outlives the search.
[[nodiscard]] inline Status allocate_planar_map(const PlanarSegmentsParams& p, Shape shape, Workspace& workspace,
                                                PlanarMap& map) noexcept {
  NPSIM_RETURN_IF_ERROR(workspace.allocate(planes_detail::max_planes(p, shape), map.segments));
  return workspace.allocate_image(shape, map.of);
}

namespace planes_detail {

inline constexpr double kQuarter = 1.5707963267948966;
inline constexpr double kAligned_rad = 0.05;

// An angle off the nearest multiple of 90 degrees.
[[nodiscard]] inline double off_square(double angle_rad) noexcept {
  return angle_rad - kQuarter * std::round(angle_rad / kQuarter);
}

// The angle about the vertical, modulo 90 degrees, that most of what is known lies at: streets are built at right
// angles as a rule. Regions count by their area, the less the less sure theirs is. False where none is known.
inline bool common_angle(const CellInput& in, Span<const PlanarSegment> segments, double& angle_rad) noexcept {
  constexpr int kBins = 90;
  std::array<double, kBins> bins{};
  for (const PlanarSegment& s : segments) {
    if (!s.upright || !(s.support_px > 0.0F) || !(s.turn_rad < kSure_rad)) continue;
    const double angle = in.basis.angle(vec_cast<double>(s.q));
    const double in_quarter = angle / kQuarter - std::floor(angle / kQuarter);
    const int at = std::min(kBins - 1, static_cast<int>(in_quarter * kBins));
    for (int i = -2; i <= 2; ++i) {
      bins[static_cast<std::size_t>((at + i + kBins) % kBins)] += static_cast<double>(s.support_px) * (3 - std::abs(i));
    }
  }
  std::size_t best = 0;
  for (std::size_t i = 1; i < bins.size(); ++i) best = bins[i] > bins[best] ? i : best;
  if (!(bins[best] > 0.0)) return false;
  double sum = 0.0;
  double off = 0.0;
  for (const PlanarSegment& s : segments) {
    if (!s.upright || !(s.support_px > 0.0F) || !(s.turn_rad < kSure_rad)) continue;
    const double centre = (static_cast<double>(best) + 0.5) / kBins * kQuarter;
    const double d = off_square(in.basis.angle(vec_cast<double>(s.q)) - centre);
    if (std::fabs(d) > kAligned_rad) continue;
    const double weight = static_cast<double>(s.support_px) / (1e-6 + static_cast<double>(s.turn_rad * s.turn_rad));
    sum += weight;
    off += weight * d;
  }
  angle_rad = (static_cast<double>(best) + 0.5) / kBins * kQuarter + (sum > 0.0 ? off / sum : 0.0);
  return true;
}

// What plane a region's sums make. One of a class that stands upright stands so unless it fits much worse; where its
// angle is not well known and may be the common one or at right angles to it, it is that.
inline void set_plane(const PlanarSegmentsParams& p, const CellInput& in, const PlaneMoments& moments, float area_px,
                      const double* common, PlanarSegment& s) noexcept {
  PlaneFit fit = moments.free_plane();
  const PlaneFit upright = moments.upright_plane(in.basis);
  const double rise = static_cast<double>(p.merge_rise);
  s.upright = in.stands(s.label) && upright.found &&
              (s.plumb || !fit.found || upright.cost - fit.cost <= rise * rise * moments.weight);
  s.support_px = 0.0F;
  s.squared = false;
  if (s.upright) fit = upright;
  if (!fit.found || !(moments.weight > 0.0)) return;
  const double width = static_cast<double>(in.noise.width_px);
  const double shared = std::max(1.0, moments.weight * width * width / std::max(1.0, static_cast<double>(area_px))) +
                        kShared * moments.weight;
  const double scatter = std::max(1.0, fit.cost / moments.weight);
  const double turn = std::sqrt(std::min(10.0, moments.turn_variance(in.basis, fit.q) * shared * scatter));
  if (s.upright && common != nullptr && turn > kSquare_rad && moments.weight >= kSamplesWanted) {
    const double far = fit.cost + 9.0 * shared * scatter;  // three deviations
    const PlaneFit one = moments.facing_plane(in.basis.at(*common));
    const PlaneFit other = moments.facing_plane(in.basis.at(*common + kQuarter));
    const bool may_be_one = one.found && one.cost <= far;
    const bool may_be_other = other.found && other.cost <= far;
    if (may_be_one != may_be_other) {
      fit = may_be_one ? one : other;
      s.squared = true;
    }
  }
  s.q = vec_cast<float>(fit.q);
  s.normal = vec_cast<float>(normalized(-fit.q));
  s.support_px = area_px;
  s.residual = static_cast<float>(std::sqrt(fit.cost / moments.weight));
  s.turn_rad = static_cast<float>(turn);
}

// Whether a plane stands at the street's angle or at right angles to it, by its own samples.
[[nodiscard]] inline bool on_grid(const CellInput& in, const double* common, const PlanarSegment& s) noexcept {
  return common != nullptr && s.upright && !s.squared &&
         std::fabs(off_square(in.basis.angle(vec_cast<double>(s.q)) - *common)) <= kAligned_rad;
}

// Of each region's mean square what planes of its single squares take away, in squared deviations.
inline void measure_waves(const CellInput& in, Span<const PlanarSegment> segments, Span<Cell> cells) noexcept {
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const Cell& cell = cells[i];
    if (!cell.valid) continue;
    Cell& region = cells[region_of(cells, static_cast<std::uint32_t>(i))];
    if (region.plane == kNoPlane) continue;
    const Vec3d q = vec_cast<double>(segments[region.plane - std::size_t{1}].q);
    region.waves += static_cast<float>(cell.own.weight / region.moments.weight * misfit(cell, in.basis, q));
  }
}

// Regions become part of larger planes, at most three squares away, in two cases; of several planes of the largest one.
//
// A small region, of one with enough support and four times its area that fits it worse than its own by at most
// on_plane in the root mean square. Beside what stands before a facade matching draws the facade forward by a part of a
// pixel, flat or as a ramp, which is no noise, and at 100 m is ten metres; a real oriel or return so small and so near
// the noise is lost with it. Where the two are not parallel the large one must stand at the street's angle, and the
// small one not by its own samples.
// A region in waves, of one a quarter larger that fits it worse by at most four times the waves: matching leaves them
// on plain walls, a part of a pixel high and some 100 px long, and each makes a plane of any angle. Noise from pixel to
// pixel makes none, so a return that is clear of it stays.
// Where the other becomes part of a third, that must fit the region too.
// apart: links between regions. into: memory, one for each segment.
inline void unite_explained(const PlanarSegmentsParams& p, const CellInput& in, float enough_px, const double* common,
                            Span<const PlanarSegment> segments, Span<const Link> apart, Span<Cell> cells,
                            Span<std::uint16_t> into) noexcept {
  constexpr float kLarger = 4.0F;
  constexpr float kParallel = 0.966F;  // cosine of 15 degrees
  constexpr float kSomewhatLarger = 1.25F;
  constexpr double kWaves = 4.0;  // times their mean square
  const auto segment = [&](std::uint16_t n) -> const PlanarSegment& { return segments[n - std::size_t{1}]; };
  const auto into_of = [&](std::uint16_t n) -> std::uint16_t& { return into[n - std::size_t{1}]; };
  for (std::size_t i = 0; i < segments.size(); ++i) into[i] = kNoPlane;
  const auto explained = [&](const Cell& cell, const PlanarSegment& own, const PlanarSegment& other) {
    const double cost = cell.moments.cost(vec_cast<double>(own.q));
    const double under = cell.moments.cost(vec_cast<double>(other.q));
    if (other.support_px >= max_of(enough_px, kSomewhatLarger * own.support_px) &&
        under - cost <= kWaves * static_cast<double>(cell.waves) * cell.moments.weight) {
      return true;
    }
    if (!(own.support_px < enough_px && other.support_px >= max_of(enough_px, kLarger * own.support_px))) return false;
    const bool of_street = (other.squared || on_grid(in, common, other)) && !on_grid(in, common, own);
    if (!of_street && dot(own.normal, other.normal) < kParallel) return false;
    return under - cost <= static_cast<double>(p.on_plane * p.on_plane) * cell.moments.weight;
  };
  const auto offer = [&](std::uint32_t a, std::uint32_t b) {
    const std::uint16_t from = cells[a].plane;
    const std::uint16_t to = cells[b].plane;
    if (from == kNoPlane || to == kNoPlane) return;
    if (into_of(from) != kNoPlane && !(segment(to).support_px > segment(into_of(from)).support_px)) return;
    if (explained(cells[a], segment(from), segment(to))) into_of(from) = to;
  };
  for (const Link& link : apart) {
    offer(link.a, link.b);
    offer(link.b, link.a);
  }
  for (Cell& cell : cells) {
    const std::uint16_t own = cell.plane;
    if (own == kNoPlane || into_of(own) == kNoPlane) continue;
    const std::uint16_t first = into_of(own);
    const std::uint16_t last = into_of(first) == kNoPlane ? first : into_of(first);
    const bool fits = last == first || explained(cell, segment(own), segment(last));
    if (fits && into_of(last) == kNoPlane) cell.plane = last;
  }
}

// Regions with enough support, as segments; their cells learn the segment's number. Then cells choose once more, and
// segments follow from those that chose them.
inline std::size_t keep_supported(const PlanarSegmentsParams& p, const CellInput& in, const Grid& grid,
                                  Span<const Link> apart, Span<Cell> cells, Span<std::uint16_t> next,
                                  Span<PlaneMoments> sums, Span<PlanarSegment> segments) noexcept {
  const float enough = min_support_px(p, grid.image);
  const float fewest = 3.0F * static_cast<float>(grid.cell_px * grid.cell_px);
  const auto sure = [&](const PlanarSegment& s) {
    return s.support_px >= enough || (s.support_px >= fewest && s.turn_rad <= p.sure_rad);
  };
  std::size_t count = 0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    Cell& cell = cells[i];
    if (!cell.valid || cell.parent != i || count == segments.size()) continue;
    PlanarSegment& s = segments[count];
    s.label = cell.label;
    s.plumb = cell.plumb;
    set_plane(p, in, cell.moments, cell.area_px, nullptr, s);
    if (s.support_px > 0.0F) cell.plane = static_cast<std::uint16_t>(++count);
  }
  double angle = 0.0;
  const double* common = common_angle(in, segments.sub(0, count), angle) ? &angle : nullptr;
  for (Cell& cell : cells) {
    if (cell.plane == kNoPlane) continue;
    PlanarSegment& s = segments[cell.plane - std::size_t{1}];
    if (common != nullptr) set_plane(p, in, cell.moments, cell.area_px, common, s);
    if (!sure(s) && !s.squared) cell.plane = kNoPlane;
  }
  measure_waves(in, segments, cells);
  unite_explained(p, in, enough, common, segments.sub(0, count), apart, cells, next);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    if (cells[i].valid) cells[i].plane = cells[region_of(cells, static_cast<std::uint32_t>(i))].plane;
  }
  const auto plane_of = [&](std::uint16_t n) { return vec_cast<double>(segments[n - std::size_t{1}].q); };
  const auto rise = static_cast<double>(p.merge_rise);
  smooth_regions(grid, plane_of, in.basis, kStray * rise * rise, kNone * rise * rise, cells, next);
  for (std::size_t n = 0; n < count; ++n) {
    sums[n] = PlaneMoments{};
    segments[n].support_px = 0.0F;
  }
  for (const Cell& cell : cells) {
    if (cell.plane == kNoPlane) continue;
    sums[cell.plane - std::size_t{1}] += cell.own;
    segments[cell.plane - std::size_t{1}].support_px += cell.own_px;
  }
  for (std::size_t n = 0; n < count; ++n) set_plane(p, in, sums[n], segments[n].support_px, common, segments[n]);
  for (Cell& cell : cells) {
    if (cell.plane == kNoPlane) continue;
    const PlanarSegment& s = segments[cell.plane - std::size_t{1}];
    if (!sure(s) && !s.squared) cell.plane = kNoPlane;
  }
  return count;
}

// Squares for this depth: larger ones where samples are few, so that a square holds some.
[[nodiscard]] inline int wanted_cell_px(const PlanarSegmentsParams& p, ImageView<const float> measured) noexcept {
  std::size_t found = 0;
  for (int y = 0; y < measured.height(); ++y) {
    for (int x = 0; x < measured.width(); ++x) found += is_valid_depth(measured(x, y)) ? 1U : 0U;
  }
  const double per_sample = static_cast<double>(measured.shape().pixels()) / std::max(1.0, static_cast<double>(found));
  const int sparse = static_cast<int>(std::sqrt(kSamplesWanted * per_sample));
  return std::min(std::max(cell_px(p, measured.shape()), sparse), 4096);
}

[[nodiscard]] inline bool is_blind(const Grid& grid, Span<const Cell> cells, std::uint8_t slot, int x, int y) noexcept {
  return slot != 0 && cells[grid.cell(x / grid.cell_px, y / grid.cell_px, slot - 1)].blind;
}

// Whether a pixel that lies on none refused the plane of its square (nearest_plane()).
[[nodiscard]] inline bool refuses(const Grid& grid, Span<const Cell> cells, std::uint8_t slot, int x, int y) noexcept {
  return is_blind(grid, cells, slot, x, y) &&
         cells[grid.cell(x / grid.cell_px, y / grid.cell_px, slot - 1)].plane != kNoPlane;
}

// Of one object in a square; 0 where it has no depth.
[[nodiscard]] inline float mean_inverse_depth(const CellInput& in, const Grid& grid,
                                              ImageView<const std::uint8_t> slots, int column, int row,
                                              int slot) noexcept {
  const int x1 = std::min(grid.image.width, (column + 1) * grid.cell_px);
  const int y1 = std::min(grid.image.height, (row + 1) * grid.cell_px);
  float sum = 0.0F;
  int count = 0;
  for (int y = row * grid.cell_px; y < y1; y += 2) {
    for (int x = column * grid.cell_px; x < x1; x += 2) {
      if (slots(x, y) != slot + 1 || !is_valid_depth(in.depth(x, y))) continue;
      sum += 1.0F / in.depth(x, y);
      ++count;
    }
  }
  return count > 0 ? sum / static_cast<float>(count) : 0.0F;
}

// The plane that surrounds a pixel which lies on none: in at least six of eight directions a plane is the first
// thing of the object's within `reach_px` that lies on any, in `most`, at least three, this one. What stands before the
// pixel, as a pole beside which matching went wrong, may take up to two of the six; then it is not `open` all around.
[[nodiscard]] inline std::uint16_t surrounding_plane(const CellInput& in, ImageView<const std::uint16_t> of,
                                                     int reach_px, int x, int y, int& most, bool& open) noexcept {
  std::array<std::uint16_t, kAround> met{};
  std::size_t hits = 0;
  std::size_t hidden = 0;
  for (int k = 0; k < kAround; ++k) {
    for (int step = 1; step <= reach_px; ++step) {
      const int i = x + kAroundX[k] * step;
      const int j = y + kAroundY[k] * step;
      if (!of.contains(i, j)) break;
      if (!in.objects.same(x, y, i, j)) {
        hidden += is_valid_depth(in.depth(i, j)) && in.depth(i, j) < 1.1F * in.depth(x, y) ? 1U : 0U;
        break;
      }
      if (of(i, j) == kNoPlane) continue;
      met[hits++] = of(i, j);
      break;
    }
  }
  open = hits >= 6;
  if (hits + std::min(hidden, std::size_t{2}) < 6) return kNoPlane;
  std::uint16_t plane = kNoPlane;
  most = 2;
  for (std::size_t k = 0; k < hits; ++k) {
    int same = 0;
    for (std::size_t i = 0; i < hits; ++i) same += met[i] == met[k] ? 1 : 0;
    if (same <= most) continue;
    most = same;
    plane = met[k];
  }
  return plane;
}

}  // namespace planes_detail

// Finds the planes of `depth` (m, 0 where there is no surface), evidence being pixels that `measured` has, and draws
// the depth to them. up: the ground's. map: allocate_planar_map().
template <class Executor>
[[nodiscard]] Status planar_segments(const PlanarSegmentsParams& params, ImageView<const float> measured,
                                     const ObjectMap& objects, const DepthNoise& noise, const Vec3f& up,
                                     const Intrinsics& camera, ImageView<float> depth, PlanarMap& map,
                                     Workspace& workspace, Executor& executor) noexcept {
  using namespace planes_detail;
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(camera));
  const Shape shape = depth.shape();
  if (measured.shape() != shape || map.of.shape() != shape || !objects.fits(shape)) {
    return {StatusCode::shape_mismatch, "planar segments: depth, what was measured, objects and map have one shape"};
  }
  const Grid grid(shape, wanted_cell_px(params, measured));
  const WorkspaceScope scope(workspace);
  ImageView<std::uint8_t> slots;
  Span<Cell> cells;
  Span<Choice> choices;
  Span<Link> links;
  Span<std::uint16_t> next;
  Span<PlaneMoments> sums;
  Span<Edge> edges;
  ImageView<std::uint16_t> nearest;
  const std::size_t cell_count = grid.squares() * kSlots;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, slots));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(cell_count, cells));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(cell_count, choices));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(cell_count * kLinks, links));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(cell_count, next));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(map.segments.size(), sums));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(map.segments.size() * kEdges, edges));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, nearest));

  CellInput in;
  in.measured = measured;
  in.depth = depth;
  in.objects = objects;
  in.labels = params.labels;
  in.upright = params.upright;
  if (!objects.labels.empty() && noise.drift > 1.0F) in.plumb = params.plumb;
  in.camera = camera;
  in.up = up;
  in.basis = UprightBasis::across(up);
  in.noise = noise;
  in.inlier = params.inlier;
  in.outlier = params.outlier;
  in.min_share = params.min_share;
  in.relief_m = params.relief_m;
  in.seed = params.seed;
  for (std::size_t i = 0; i < cells.size();
       ++i) {  // also for an executor that leaves chunks out when it is told to stop
    cells[i] = Cell{};
    cells[i].parent = static_cast<std::uint32_t>(i);
  }
  executor.for_chunks(static_cast<std::size_t>(grid.rows), 1, [&](std::size_t begin, std::size_t end) {
    for (auto row = static_cast<int>(begin); row < static_cast<int>(end); ++row) {
      for (int column = 0; column < grid.columns; ++column) fit_square(in, grid, column, row, slots, cells);
    }
  });
  for (int y = 0; y < shape.height; ++y) std::fill_n(nearest.row(y), shape.width, kNoPlane);
  const std::size_t link_count = link_cells(grid, cells, links);
  const auto rise = static_cast<double>(params.merge_rise);
  const std::size_t apart = merge_cells(cells, links.sub(0, link_count), choices, in.basis, rise * rise);
  const std::size_t found = keep_supported(params, in, grid, links.sub(0, apart), cells, next, sums, map.segments);
  map.segments = map.segments.sub(0, found);
  const auto plane_of = [&](std::uint16_t n) { return map.segments[n - std::size_t{1}].q; };
  const auto support = [&](std::uint16_t n) { return map.segments[n - std::size_t{1}].support_px; };
  extend_planes(
      grid, params.guessed && noise.power == 2, support,
      [&](std::uint16_t n, int column, int row) {
        return plane_of_ray(in, plane_of(n), column * grid.cell_px + grid.cell_px / 2,
                            row * grid.cell_px + grid.cell_px / 2);
      },
      [&](int column, int row, int slot) { return mean_inverse_depth(in, grid, slots, column, row, slot); }, cells);
  const auto planar = [&](int x, int y) {
    return is_valid_depth(depth(x, y)) && (objects.labels.empty() || params.labels.contains(objects.labels(x, y)));
  };
  executor.for_chunks(static_cast<std::size_t>(shape.height), 8, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        nearest(x, y) =
            planar(x, y) ? nearest_plane(in, grid, cells, slots, plane_of, support, params.on_plane, x, y) : kNoPlane;
      }
    }
  });
  const auto choose = [&](ImageView<const std::uint16_t> from, ImageView<std::uint16_t> to, const auto& choice) {
    executor.for_chunks(static_cast<std::size_t>(shape.height), 8, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
        for (int x = 0; x < shape.width; ++x) {
          to(x, y) = from(x, y);
          if (!planar(x, y) || is_blind(grid, cells, slots(x, y), x, y)) continue;
          to(x, y) = choice(from, x, y);
        }
      }
    });
  };
  for (int apart_px = agreement_px(shape); apart_px > 0; apart_px /= 2) {
    const auto agreed = [&](ImageView<const std::uint16_t> of, int x, int y) {
      return agreed_plane(in, plane_of, of, params.on_plane, apart_px, x, y);
    };
    choose(nearest, map.of, agreed);
    choose(map.of, nearest, agreed);
  }
  edges = edges.sub(0, found * kEdges);
  find_edges(in, plane_of, nearest, edges);
  const auto sided = [&](ImageView<const std::uint16_t> of, int x, int y) {
    return plane_of_side(in, plane_of, edges, of, params.on_plane, x, y);
  };
  choose(nearest, map.of, sided);
  choose(map.of, nearest, sided);
  const auto reach_px = static_cast<int>(params.dent_px * static_cast<float>(shape.width) / 2048.0F);
  executor.for_chunks(static_cast<std::size_t>(shape.height), 8, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        map.of(x, y) = nearest(x, y);
        if (!planar(x, y)) continue;
        const bool on_plane = nearest(x, y) != kNoPlane;
        if (!on_plane && refuses(grid, cells, slots(x, y), x, y)) continue;
        int around = 0;
        bool open = true;
        const std::uint16_t plane =
            on_plane ? nearest(x, y) : surrounding_plane(in, nearest, reach_px, x, y, around, open);
        if (plane == kNoPlane) continue;
        const float off = residual_at(in, plane_of(plane), x, y);
        const bool blind = on_plane && is_blind(grid, cells, slots(x, y), x, y);
        const float flat_z = 1.0F / plane_of_ray(in, plane_of(plane), x, y);
        const bool dent = !on_plane && noise.power != 2 && !objects.labels.empty() &&
                          std::fabs(depth(x, y) - flat_z) > params.dent_m && std::fabs(off) > params.on_plane &&
                          (open || depth(x, y) < flat_z);
        if (!on_plane && !dent && std::fabs(off) > params.outlier) continue;
        map.of(x, y) = plane;
        const bool behind = dent && depth(x, y) > flat_z;
        if ((behind || blind) && flat_z > 0.0F) depth(x, y) = flat_z;
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_PLANES_PLANAR_SEGMENTS_HPP
