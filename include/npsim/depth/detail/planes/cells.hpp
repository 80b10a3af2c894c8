// SPDX-License-Identifier: Apache-2.0
// A plane for each object in each square of the image.
//
// A square of some 24 px is small enough to hold one surface of an object as a rule; where it holds two, the larger one
// wins here and the pixels of the other go to a neighbour's plane later (assign.hpp). A seeded search over pairs of
// samples (upright planes) or triples finds the plane that most samples agree with (RANSAC; Fischler and Bolles 1981),
// and reweighted least squares with Tukey's weights refine it.
#ifndef NPSIM_DEPTH_DETAIL_PLANES_CELLS_HPP
#define NPSIM_DEPTH_DETAIL_PLANES_CELLS_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/span.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/depth/detail/planes/moments.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace planes_detail {

inline constexpr int kSlots = 3;              // objects of a square that may have planes, the largest ones
inline constexpr std::size_t kSamples = 256;  // of a cell, at most
inline constexpr std::size_t kFewest = 6;     // samples of a plane
inline constexpr std::uint16_t kNoPlane = 0;

inline constexpr float kKept = 0.1F;  // a sample that was moved by more than this share is no measurement any longer

struct Sample {
  double x, y, w;
  double precision;  // 1 / variance of w
};

struct Cell {
  PlaneMoments own;          // of its samples
  PlaneMoments moments;      // of its region, where it stands for one
  std::uint32_t parent = 0;  // itself, or towards the cell that stands for its region
  float own_px = 0.0F;       // of its object's pixels in the square those that the plane explains
  float area_px = 0.0F;      // of its region
  float waves = 0.0F;        // of its region: measure_waves()
  std::uint16_t plane = kNoPlane;
  std::uint16_t instance = 0;
  Label label = 0;
  bool valid = false;  // has a plane of its own
  bool blind = false;  // nothing was measured here
  bool upright = false;
  bool plumb = false;  // its own plane never leans
};

struct Grid {
  Shape image;
  int cell_px = 1;
  int columns = 0;
  int rows = 0;

  Grid(Shape shape, int px)
      : image(shape), cell_px(px), columns((shape.width + px - 1) / px), rows((shape.height + px - 1) / px) {}
  [[nodiscard]] std::size_t squares() const noexcept {
    return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  }
  [[nodiscard]] std::size_t cell(int column, int row, int slot) const noexcept {
    return (static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(column)) *
               kSlots +
           static_cast<std::size_t>(slot);
  }
};

struct CellInput {
  ImageView<const float> measured;  // 0 where nothing was
  ImageView<const float> depth;
  ObjectMap objects;
  LabelSet labels, upright;  // that have planes; those whose planes stand on the ground as a rule
  LabelSet plumb;            // and those whose planes always do, above the eye
  Intrinsics camera;
  Vec3f up;
  UprightBasis basis;
  DepthNoise noise;
  float inlier = 0.0F, outlier = 0.0F;  // deviations
  float min_share = 0.0F;
  float relief_m = 0.0F;
  std::uint64_t seed = 0;

  [[nodiscard]] Label label(int x, int y) const noexcept {
    return objects.labels.empty() ? Label{0} : objects.labels(x, y);
  }
  // Of w where a surface with relief was measured.
  [[nodiscard]] float deviation(float w) const noexcept {
    const float noisy = noise.drift * noise.deviation(w);
    const float rough = relief_m * w * w;
    return std::sqrt(noisy * noisy + rough * rough);
  }
  [[nodiscard]] bool stands(Label l) const noexcept { return !objects.labels.empty() && upright.contains(l); }
  [[nodiscard]] std::uint16_t instance(int x, int y) const noexcept {
    return objects.instances.empty() ? std::uint16_t{0} : objects.instances(x, y);
  }
  [[nodiscard]] Vec3d ray(int x, int y) const noexcept {
    return {(static_cast<double>(x) + 0.5 - static_cast<double>(camera.cx)) / static_cast<double>(camera.fx),
            (static_cast<double>(y) + 0.5 - static_cast<double>(camera.cy)) / static_cast<double>(camera.fy), 1.0};
  }
};

[[nodiscard]] inline double residual(const Sample& s, const Vec3d& q) noexcept {
  return (q.x * s.x + q.y * s.y + q.z - s.w) * std::sqrt(s.precision);
}

// The plane through two samples that stands upright.
[[nodiscard]] inline bool upright_through(const UprightBasis& basis, const Sample& a, const Sample& b,
                                          Vec3d& q) noexcept {
  const Vec3d ray_a{a.x, a.y, 1.0};
  const Vec3d ray_b{b.x, b.y, 1.0};
  const double ar = dot(basis.right, ray_a);
  const double af = dot(basis.ahead, ray_a);
  const double br = dot(basis.right, ray_b);
  const double bf = dot(basis.ahead, ray_b);
  const double det = ar * bf - af * br;
  if (!(std::fabs(det) > 1e-9)) return false;
  q = basis.right * ((a.w * bf - b.w * af) / det) + basis.ahead * ((ar * b.w - br * a.w) / det);
  return true;
}

[[nodiscard]] inline bool through_three(const Sample& a, const Sample& b, const Sample& c, Vec3d& q) noexcept {
  const Vec3d column_x{a.x, b.x, c.x};
  const Vec3d column_y{a.y, b.y, c.y};
  const Vec3d ones{1.0, 1.0, 1.0};
  const Vec3d w{a.w, b.w, c.w};
  const Vec3d y_ones = cross(column_y, ones);
  const double det = dot(column_x, y_ones);
  if (!(std::fabs(det) > 1e-12)) return false;
  q = {dot(w, y_ones) / det, dot(column_x, cross(w, ones)) / det, dot(column_x, cross(column_y, w)) / det};
  return true;
}

// Samples that the best of the planes tried explains; q is that plane.
[[nodiscard]] inline int search(const CellInput& in, Span<const Sample> samples, bool upright, std::uint32_t cell,
                                Vec3d& q) noexcept {
  constexpr int kTries = 24;  // three samples of a plane that holds 70 % of them are missed with probability 5e-5
  RandomStream random(in.seed, RandomPurpose::generic, 1, upright ? 1 : 0, cell, 0);
  const auto draw = [&]() -> const Sample& { return samples[random.next_u32() % samples.size()]; };
  const double inlier = static_cast<double>(in.inlier);
  double best = inlier * static_cast<double>(samples.size());
  int most = 0;
  for (int i = 0; i < kTries; ++i) {
    const Sample& a = draw();
    const Sample& b = draw();
    const Sample& c = draw();
    Vec3d tried;
    if (!(upright ? upright_through(in.basis, a, b, tried) : through_three(a, b, c, tried))) continue;
    double sum = 0.0;
    int inside = 0;
    for (std::size_t s = 0; s < samples.size() && sum < best; ++s) {
      const double off = std::fabs(residual(samples[s], tried));
      sum += std::min(off, inlier);
      inside += off < inlier ? 1 : 0;
    }
    if (sum >= best) continue;
    best = sum;
    most = inside;
    q = tried;
  }
  return most;
}

// Tukey's weights about q, three times; the sums of the last.
[[nodiscard]] inline bool refined(const CellInput& in, Span<const Sample> samples, bool upright, Vec3d q,
                                  PlaneMoments& out) noexcept {
  const double limit = static_cast<double>(in.outlier);
  for (int round = 0; round < 3; ++round) {
    PlaneMoments sums;
    for (const Sample& s : samples) {
      const double t = residual(s, q) / limit;
      if (!(t * t < 1.0)) continue;
      const double share = (1.0 - t * t) * (1.0 - t * t);
      sums.add(s.x, s.y, s.w, s.precision * share, share);
    }
    const PlaneFit fit = upright ? sums.upright_plane(in.basis) : sums.free_plane();
    if (!fit.found) return false;
    q = fit.q;
    out = sums;
  }
  return true;
}

// What one object shows in the square that begins at (x0, y0): up to kSamples samples, evenly.
[[nodiscard]] inline std::size_t collect(const CellInput& in, ImageView<const std::uint8_t> slots, const Grid& grid,
                                         int x0, int y0, std::uint8_t slot, Span<Sample> out) noexcept {
  const int x1 = std::min(grid.image.width, x0 + grid.cell_px);
  const int y1 = std::min(grid.image.height, y0 + grid.cell_px);
  const auto usable = [&](int x, int y) {
    const float z = in.depth(x, y);
    const float given = in.measured(x, y);
    return slots(x, y) == slot && is_valid_depth(given) && is_valid_depth(z) && std::isfinite(1.0F / z) &&
           std::fabs(z - given) <= kKept * given;
  };
  std::size_t total = 0;
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) total += usable(x, y) ? 1U : 0U;
  }
  const std::size_t step = (total + out.size() - 1) / out.size();
  std::size_t seen = 0;
  std::size_t count = 0;
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) {
      if (!usable(x, y) || seen++ % step != 0) continue;
      const Vec3d ray = in.ray(x, y);
      const float w = 1.0F / in.depth(x, y);
      const double deviation = static_cast<double>(in.deviation(w));
      out[count++] = {ray.x, ray.y, static_cast<double>(w), 1.0 / (deviation * deviation)};
    }
  }
  return count;
}

// The objects of a square by their number of pixels, the largest kSlots of them; marks their pixels 1 .. kSlots.
inline void divide_square(const CellInput& in, const Grid& grid, int column, int row, ImageView<std::uint8_t> slots,
                          Span<Cell> cells) noexcept {
  struct Part {
    Label label;
    std::uint16_t instance;
    int pixels;
  };
  std::array<Part, 8> parts;
  std::size_t count = 0;
  const int x0 = column * grid.cell_px;
  const int y0 = row * grid.cell_px;
  const int x1 = std::min(grid.image.width, x0 + grid.cell_px);
  const int y1 = std::min(grid.image.height, y0 + grid.cell_px);
  const auto part_of = [&](int x, int y) {
    std::size_t i = 0;
    while (i < count && (parts[i].label != in.label(x, y) || parts[i].instance != in.instance(x, y))) ++i;
    return i;
  };
  const auto has_planes = [&](int x, int y) { return in.objects.labels.empty() || in.labels.contains(in.label(x, y)); };
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) {
      slots(x, y) = 0;
      if (!has_planes(x, y)) continue;
      const std::size_t i = part_of(x, y);
      if (i == parts.size()) continue;
      if (i == count) parts[count++] = {in.label(x, y), in.instance(x, y), 0};
      ++parts[i].pixels;
    }
  }
  std::array<std::size_t, kSlots> chosen{};
  std::size_t filled = 0;
  std::uint32_t taken = 0;
  while (filled < kSlots && filled < count) {
    std::size_t largest = parts.size();
    for (std::size_t i = 0; i < count; ++i) {
      if ((taken >> i & 1U) == 0 && (largest == parts.size() || parts[i].pixels > parts[largest].pixels)) largest = i;
    }
    taken |= 1U << largest;
    Cell& cell = cells[grid.cell(column, row, static_cast<int>(filled))];
    cell.label = parts[largest].label;
    cell.instance = parts[largest].instance;
    cell.area_px = static_cast<float>(parts[largest].pixels);
    chosen[filled++] = largest;
  }
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) {
      if (!has_planes(x, y)) continue;
      const std::size_t i = part_of(x, y);
      for (std::size_t k = 0; k < filled; ++k) {
        if (chosen[k] == i) slots(x, y) = static_cast<std::uint8_t>(k + 1);
      }
    }
  }
}

// A plane for each part of a square that has enough samples which agree on one.
inline void fit_square(const CellInput& in, const Grid& grid, int column, int row, ImageView<std::uint8_t> slots,
                       Span<Cell> cells) noexcept {
  divide_square(in, grid, column, row, slots, cells);
  std::array<Sample, kSamples> buffer;
  for (int slot = 0; slot < kSlots; ++slot) {
    const std::size_t index = grid.cell(column, row, slot);
    Cell& cell = cells[index];
    if (!(cell.area_px > 0.0F)) continue;
    const std::size_t count = collect(in, slots, grid, column * grid.cell_px, row * grid.cell_px,
                                      static_cast<std::uint8_t>(slot + 1), Span<Sample>(buffer.data(), buffer.size()));
    cell.blind = count == 0;
    if (count < kFewest) continue;
    const Span<const Sample> samples(buffer.data(), count);
    const auto id = static_cast<std::uint32_t>(index);
    Vec3d q;
    int inside = 0;
    const Vec3d middle = in.ray(column * grid.cell_px + grid.cell_px / 2, row * grid.cell_px + grid.cell_px / 2);
    cell.plumb = in.stands(cell.label) && in.plumb.contains(cell.label) && dot(vec_cast<double>(in.up), middle) > 0.0;
    if (in.stands(cell.label)) {
      inside = search(in, samples, true, id, q);
      cell.upright = inside > 0;
    }
    if (static_cast<float>(inside) < 0.7F * static_cast<float>(count) && !cell.plumb) {
      Vec3d tilted;
      const int more = search(in, samples, false, id, tilted);
      if (static_cast<float>(more) > static_cast<float>(inside) + 0.15F * static_cast<float>(count)) {
        q = tilted;
        inside = more;
        cell.upright = false;
      }
    }
    const float share = static_cast<float>(inside) / static_cast<float>(count);
    if (share < in.min_share || !refined(in, samples, cell.upright, q, cell.moments)) continue;
    cell.own = cell.moments;
    cell.own_px = cell.area_px *= share;
    cell.valid = true;
  }
}

}  // namespace planes_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_PLANES_CELLS_HPP
