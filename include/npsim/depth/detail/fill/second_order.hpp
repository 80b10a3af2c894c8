// SPDX-License-Identifier: Apache-2.0
// Fills the holes of a field with the one of least absolute slope and curvature, on a pyramid.
//
//   E = sum over couplings psi-norm of (w_q - w_p) + sum over pixels psi-norms of w_xx, w_yy and twice w_xy
// with differences of neighbours and the norm sqrt(e^2 + r^2), which is |r| for |r| >> e and a square below: so a hole
// goes on as the planes around it, and where they disagree it bends in few places instead of sagging everywhere (total
// variation of first and second order). e: `edge` times the field at the pixel, plus `edge_step`.
// Terms reach only over pixels of one object, but for a weak coupling of neighbours (kFillAcross, kFillAcrossGround).
// For labels with a plane, the ground, w is the deviation from it.
//
// Method: on each level every free pixel in turn takes the minimum of E's quadratic majorant at the current field
// (half- quadratic minimisation by Gauss-Seidel), pixels of the same (x + 2 y) mod 5 at a time, which share no term.
// Levels halve the image; a cell stands for one object, that of most of its pixels, and holds their mean. On a grid of
// step h differences are 1/h of those between pixels at a distance h and curvatures 1/h^2; a cell counts h^2 times. The
// coarsest level comes first, each finer one starts from the coarser one's result, bilinearly within objects.
// Moves are over-relaxed, which lowers E all the same. Cost: some 60 ns per free pixel and sweep. Memory: 6 bytes per
// pixel beside the field and its kinds.
#ifndef NPSIM_DEPTH_DETAIL_FILL_SECOND_ORDER_HPP
#define NPSIM_DEPTH_DETAIL_FILL_SECOND_ORDER_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/object_borders.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

inline constexpr std::size_t kFillChunkRows = 16;
inline constexpr int kFillMaxLevels = 16;
// Of a coupling between objects, but of the ground to others, since its plane says more. Absolute differences make it
// nearly harmless: where an object knows its own depth a step to its neighbour costs the same wherever the object lies;
// where it does not, the neighbour says. Labels are drawn by hand, and a hole often leaves an object no sample but
// those on its border. Kinds of ground lie one beside the other: a pavement that ends at its own height hangs over the
// road.
inline constexpr float kFillAcross = 0.1F;
inline constexpr float kFillAcrossGround = 0.5F;

// Bits of FillLevel::links: which pixels around a free one belong to its terms.
enum FillLink : std::uint16_t {
  kLeft = 1,
  kRight = 2,
  kUp = 4,
  kDown = 8,
  kLeft2 = 16,
  kRight2 = 32,
  kUp2 = 64,
  kDown2 = 128,
  kUpLeft = 256,
  kUpRight = 512,
  kDownLeft = 1024,
  kDownRight = 2048,
  kOtherLeft = 4096,
  kOtherRight = 8192,
  kOtherUp = 16384,
  kOtherDown = 32768  // of another object
};

enum FillKind : std::uint8_t { kNothing, kGiven, kFree, kOrphan };  // orphan: free, and takes from any object

// Per label: its plane w0 + u x + v y (0 where it has none) and the range of the field.
struct FillSlope {
  float w0 = 0, u = 0, v = 0, low = 0, high = 0;
  bool plane = false;
};

struct FillLevel {
  ImageView<float> w;  // of the field, without the label's plane
  ImageView<std::uint8_t> kind;
  ImageView<std::uint16_t> links;
  ObjectMap objects;
  float step = 1;  // h

  [[nodiscard]] Shape shape() const noexcept { return w.shape(); }
  [[nodiscard]] std::size_t label_at(int x, int y) const noexcept {
    return objects.labels.empty() ? 0 : objects.labels(x, y);
  }
  [[nodiscard]] float plane_at(const FillSlope& s, int x, int y) const noexcept {
    const float u = (static_cast<float>(x) + 0.5F) * step - 0.5F;
    const float v = (static_cast<float>(y) + 0.5F) * step - 0.5F;
    return s.w0 + s.u * u + s.v * v;
  }
};

struct FillSmoothness {
  float edge = 0.005F;
  float edge_step = 0;
  float relaxation = 1;  // in (0, 2): of each move
  int sweeps = 0;
  float tolerance = 0;
};

[[nodiscard]] constexpr std::size_t fill_pyramid_bytes(Shape shape) noexcept {
  std::size_t bytes =
      kWorkspaceAlignment + allocation_bytes<std::uint16_t>(shape.pixels()) +
      allocation_bytes<std::uint8_t>(chunk_count(static_cast<std::size_t>(shape.height), kFillChunkRows));
  while (shape.width > 4 && shape.height > 4) {
    shape = {(shape.width + 1) / 2, (shape.height + 1) / 2};
    bytes += allocation_bytes<float>(shape.pixels()) + 2 * allocation_bytes<std::uint8_t>(shape.pixels()) +
             2 * allocation_bytes<std::uint16_t>(shape.pixels());
  }
  return bytes;
}

// The terms of one pixel as a x^2 + 2 b x + ..., whose minimum is x = -b / a.
struct FillTerms {
  float edge2;  // e^2
  float a = 0;
  float b = 0;
  // A residual that is now r, changes by c for a change of the pixel by 1, and counts `weight` times; h of its order.
  NPSIM_ALWAYS_INLINE void add(float r, float c, float weight, float inverse_h2) noexcept {
    const float slope2 = r * r * inverse_h2;
    const float share = weight / std::sqrt(edge2 + slope2);
    a += share * c * c;
    b += share * c * r;
  }
};

// The change of pixel (x, y) to the minimum of its terms.
[[nodiscard]] inline float second_order_move(const FillLevel& level, const FillSmoothness& s,
                                             Span<const FillSlope> slopes, int x, int y) noexcept {
  const unsigned links = level.links(x, y);
  const float* const w = level.w.row(y) + x;
  const std::ptrdiff_t stride = level.w.stride();
  const auto has = [links](unsigned bits) { return (links & bits) == bits; };
  const FillSlope& slope = slopes[level.label_at(x, y)];
  const bool orphan = level.kind(x, y) == kOrphan;
  const float here = *w;
  const float e = s.edge * (slope.plane ? here + level.plane_at(slope, x, y) : here) + s.edge_step;
  FillTerms t{e * e};
  const float h = level.step;
  const float first = 1.0F / (h * h);  // r / h
  const float second = first * first;  // r / h^2
  // Other objects may have planes of their own.
  const auto whole = [&](int i, int j) {
    const FillSlope& other = slopes[level.label_at(i, j)];
    return other.plane ? level.w(i, j) + level.plane_at(other, i, j) : level.w(i, j);
  };
  const auto side = [&](unsigned own, unsigned other, int dx, int dy) {
    const int i = x + dx;
    const int j = y + dy;
    if (has(own)) t.add(here - (orphan ? whole(i, j) : w[dx + dy * stride]), 1.0F, 1.0F, first);
    if (!has(other)) return;
    if (!slope.plane) {
      t.add(here - whole(i, j), 1.0F, kFillAcross, first);
    } else if (const FillSlope& o = slopes[level.label_at(i, j)]; o.plane) {
      // Both planes in the middle of the two, so that each of them has the same term.
      const float apart =
          level.plane_at(slope, x, y) + level.plane_at(slope, i, j) - level.plane_at(o, x, y) - level.plane_at(o, i, j);
      t.add(here - level.w(i, j) + 0.5F * apart, 1.0F, kFillAcrossGround, first);
    }
  };
  side(kLeft, kOtherLeft, -1, 0);
  side(kRight, kOtherRight, 1, 0);
  side(kUp, kOtherUp, 0, -1);
  side(kDown, kOtherDown, 0, 1);
  if (orphan) return t.a > 0.0F ? -t.b / t.a : 0.0F;
  const auto along = [&](unsigned before, unsigned after, unsigned before2, unsigned after2, std::ptrdiff_t d) {
    if (has(before | after)) t.add(2.0F * here - w[-d] - w[d], 2.0F, first, second);
    if (has(before | before2)) t.add(here - 2.0F * w[-d] + w[-2 * d], 1.0F, first, second);
    if (has(after | after2)) t.add(here - 2.0F * w[d] + w[2 * d], 1.0F, first, second);
  };
  along(kLeft, kRight, kLeft2, kRight2, 1);
  along(kUp, kDown, kUp2, kDown2, stride);
  const auto corner = [&](unsigned beside, unsigned over, unsigned diagonal, std::ptrdiff_t dx, std::ptrdiff_t dy) {
    if (has(beside | over | diagonal)) t.add(here - w[dx] - w[dy] + w[dx + dy], 1.0F, 2.0F * first, second);
  };
  corner(kLeft, kUp, kUpLeft, -1, -stride);
  corner(kRight, kUp, kUpRight, 1, -stride);
  corner(kLeft, kDown, kDownLeft, -1, stride);
  corner(kRight, kDown, kDownRight, 1, stride);
  return t.a > 0.0F ? -t.b / t.a : 0.0F;
}

inline void link_pixels(const FillLevel& level, int y) noexcept {
  constexpr int kOffsets[12][2] = {{-1, 0}, {1, 0}, {0, -1},  {0, 1},  {-2, 0}, {2, 0},
                                   {0, -2}, {0, 2}, {-1, -1}, {1, -1}, {-1, 1}, {1, 1}};
  for (int x = 0; x < level.w.width(); ++x) {
    unsigned links = 0;
    if (level.kind(x, y) == kFree || level.kind(x, y) == kOrphan) {
      for (unsigned k = 0; k < 12; ++k) {
        const int i = x + kOffsets[k][0];
        const int j = y + kOffsets[k][1];
        if (!level.w.contains(i, j) || level.kind(i, j) == kNothing) continue;
        const bool own = level.kind(x, y) == kOrphan || level.objects.same(x, y, i, j);
        if (own) links |= 1U << k;
        if (!own && k < 4) links |= unsigned{kOtherLeft} << k;
      }
    }
    level.links(x, y) = static_cast<std::uint16_t>(links);
  }
}

// Of the cell's pixels those of the object that has most of them; among objects with as many, one with a given pixel.
inline void coarsen_cell(const FillLevel& fine, const FillLevel& coarse, ImageView<Label> labels,
                         ImageView<std::uint16_t> instances, int cx, int cy) noexcept {
  int best_x = -1;
  int best_y = -1;
  int best = 0;
  const auto each = [&](const auto& f) {
    for (int y = 2 * cy; y < 2 * cy + 2 && y < fine.w.height(); ++y) {
      for (int x = 2 * cx; x < 2 * cx + 2 && x < fine.w.width(); ++x) {
        if (fine.kind(x, y) != kNothing) f(x, y);
      }
    }
  };
  each([&](int x, int y) {
    int votes = 0;
    each([&](int i, int j) {
      if (fine.objects.same(x, y, i, j)) votes += fine.kind(i, j) == kGiven ? 5 : 4;
    });
    if (votes <= best) return;
    best = votes;
    best_x = x;
    best_y = y;
  });
  coarse.kind(cx, cy) = kNothing;
  coarse.w(cx, cy) = 0.0F;
  const int x0 = best > 0 ? best_x : 2 * cx;
  const int y0 = best > 0 ? best_y : 2 * cy;
  if (!labels.empty()) labels(cx, cy) = fine.objects.labels(x0, y0);
  if (!instances.empty()) instances(cx, cy) = fine.objects.instances(x0, y0);
  if (best == 0) return;
  float given = 0;
  float all = 0;
  float given_count = 0;
  float count = 0;
  bool orphan = true;
  each([&](int x, int y) {
    if (!fine.objects.same(best_x, best_y, x, y)) return;
    all += fine.w(x, y);
    count += 1;
    orphan = orphan && fine.kind(x, y) == kOrphan;
    if (fine.kind(x, y) != kGiven) return;
    given += fine.w(x, y);
    given_count += 1;
  });
  coarse.kind(cx, cy) = given_count > 0 ? kGiven : (orphan ? kOrphan : kFree);
  coarse.w(cx, cy) = given_count > 0 ? given / given_count : all / count;
}

// Free pixels take what the coarser level has for their object; those that it has nothing for stay.
inline void refine_row(const FillLevel& coarse, const FillLevel& fine, int y) noexcept {
  const int cy = y / 2;
  const int far_y = cy + ((y & 1) != 0 ? 1 : -1);
  for (int x = 0; x < fine.w.width(); ++x) {
    if (fine.links(x, y) == 0) continue;
    const int cx = x / 2;
    const int far_x = cx + ((x & 1) != 0 ? 1 : -1);
    float sum = 0;
    float weights = 0;
    const auto add = [&](int i, int j, float weight) {
      if (!coarse.w.contains(i, j) || coarse.kind(i, j) == kNothing) return;
      const bool same =
          (fine.objects.labels.empty() || fine.objects.labels(x, y) == coarse.objects.labels(i, j)) &&
          (fine.objects.instances.empty() || fine.objects.instances(x, y) == coarse.objects.instances(i, j));
      if (!same) return;
      sum += weight * coarse.w(i, j);
      weights += weight;
    };
    add(cx, cy, 9.0F);
    add(far_x, cy, 3.0F);
    add(cx, far_y, 3.0F);
    add(far_x, far_y, 1.0F);
    if (weights > 0.0F) fine.w(x, y) = sum / weights;
  }
}

template <class Executor>
void smooth_level(const FillLevel& level, const FillSmoothness& s, Span<const FillSlope> slopes,
                  Span<std::uint8_t> changed, Executor& executor) noexcept {
  const int width = level.w.width();
  for (int sweep = 0; sweep < s.sweeps; ++sweep) {
    for (std::uint8_t& c : changed) c = 0;
    for (int colour = 0; colour < 5; ++colour) {
      executor.for_chunks(static_cast<std::size_t>(level.w.height()), kFillChunkRows,
                          [&](std::size_t begin, std::size_t end) {
                            bool moved = false;
                            for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
                              for (int x = (colour + 3 * y) % 5; x < width; x += 5) {  // x + 2 y = colour, modulo 5
                                if (level.links(x, y) == 0) continue;
                                const FillSlope& slope = slopes[level.label_at(x, y)];
                                const float plane = slope.plane ? level.plane_at(slope, x, y) : 0.0F;
                                const float before = level.w(x, y);
                                float after = before + s.relaxation * second_order_move(level, s, slopes, x, y);
                                after = after > slope.low - plane ? after : slope.low - plane;
                                after = after < slope.high - plane ? after : slope.high - plane;
                                level.w(x, y) = after;
                                moved = moved || std::abs(after - before) > s.tolerance * (after + plane);
                              }
                            }
                            if (moved) changed[begin / kFillChunkRows] = 1;
                          });
    }
    bool any = false;
    for (const std::uint8_t c : changed) any = any || c != 0;
    if (!any) return;
  }
}

// field: start values, and given ones that stay. kind: of each pixel. slopes: per label id.
template <class Executor>
[[nodiscard]] Status fill_second_order(const FillSmoothness& s, const ObjectMap& objects, Span<const FillSlope> slopes,
                                       ImageView<float> field, ImageView<std::uint8_t> kind, Workspace& workspace,
                                       Executor& executor) noexcept {
  const WorkspaceScope scope(workspace);
  FillLevel level[kFillMaxLevels];
  const auto shift_by_planes = [&](float sign) {
    for (int y = 0; y < field.height(); ++y) {
      for (int x = 0; x < field.width(); ++x) {
        const FillSlope& slope = slopes[level[0].label_at(x, y)];
        if (slope.plane) field(x, y) += sign * level[0].plane_at(slope, x, y);
      }
    }
  };
  level[0].w = field;
  level[0].kind = kind;
  level[0].objects = objects;
  Span<std::uint8_t> changed;
  NPSIM_RETURN_IF_ERROR(
      workspace.allocate(chunk_count(static_cast<std::size_t>(field.height()), kFillChunkRows), changed));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(field.shape(), level[0].links));
  shift_by_planes(-1.0F);
  int levels = 1;
  for (Shape shape = field.shape(); shape.width > 4 && shape.height > 4 && levels < kFillMaxLevels; ++levels) {
    const FillLevel& fine = level[levels - 1];
    FillLevel& coarse = level[levels];
    shape = {(shape.width + 1) / 2, (shape.height + 1) / 2};
    coarse.step = 2.0F * fine.step;
    ImageView<Label> labels;
    ImageView<std::uint16_t> instances;
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, coarse.w));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, coarse.kind));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, coarse.links));
    if (!objects.labels.empty()) NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, labels));
    if (!objects.instances.empty()) NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, instances));
    coarse.objects = {labels, instances};
    executor.for_chunks(static_cast<std::size_t>(shape.height), kFillChunkRows,
                        [&](std::size_t begin, std::size_t end) {
                          for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
                            for (int x = 0; x < shape.width; ++x) coarsen_cell(fine, coarse, labels, instances, x, y);
                          }
                        });
  }
  for (int l = levels - 1; l >= 0; --l) {
    const FillLevel& here = level[l];
    const auto rows = static_cast<std::size_t>(here.w.height());
    executor.for_chunks(rows, kFillChunkRows, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
        link_pixels(here, y);
        if (l + 1 < levels) refine_row(level[l + 1], here, y);
      }
    });
    smooth_level(here, s, slopes, Span<std::uint8_t>(changed.data(), chunk_count(rows, kFillChunkRows)), executor);
  }
  shift_by_planes(1.0F);
  return {};
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_FILL_SECOND_ORDER_HPP
