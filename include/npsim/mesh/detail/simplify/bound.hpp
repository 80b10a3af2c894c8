// SPDX-License-Identifier: Apache-2.0
// Whether a triangle with corners at pixels may stand for the part of a sheet that it covers.
//
// Depth: with w = 1 / z both surfaces are piecewise linear on the image, so z' / z is a ratio of linear functions on
// each common piece and takes its extremes at the corners of the pieces: pixel centres, and crossings of an edge of the
// triangle with an edge of the sheet. Those are all that is looked at, and the bound holds everywhere between them.
// Labels: a face whose corners have one label covers no pixel centre of another one; a face with several labels has no
// pixel centre inside, and an edge none between its ends unless all three have one label. Hence the label of every
// pixel centre can be read off the faces, and is the one it had.
// Cost: a few operations for each pixel centre and crossing. Error: in double from w rounded to float, 2^-24.
#ifndef NPSIM_MESH_DETAIL_SIMPLIFY_BOUND_HPP
#define NPSIM_MESH_DETAIL_SIMPLIFY_BOUND_HPP

#include <cmath>
#include <cstdint>

#include "npsim/core/image_view.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace mesh_detail {

// Depths that differ by no more than this share are the same: what rounding two depths and their reciprocals makes.
inline constexpr double kRoundingOfDepth = 0x1p-21;

struct Corner {
  int x = 0;
  int y = 0;
  double w = 0;  // 1 / z
  std::uint32_t id = 0;
};

// The sheet as it was.
struct SheetPlanes {
  ImageView<const float> inverse_depth;  // 1 / z, 0 where there is no vertex
  ImageView<const std::uint8_t> quads;
  ImageView<const std::uint32_t> ids;  // may be empty

  [[nodiscard]] std::uint32_t id(int x, int y) const noexcept { return ids.data() == nullptr ? 0 : ids(x, y); }
  [[nodiscard]] Corner corner(int x, int y) const noexcept {
    return {x, y, static_cast<double>(inverse_depth(x, y)), id(x, y)};
  }
};

// Twice the area of a triangle, positive when it faces the camera.
[[nodiscard]] constexpr std::int64_t turn(const Corner& a, const Corner& b, const Corner& c) noexcept {
  return static_cast<std::int64_t>(c.x - a.x) * (b.y - a.y) - static_cast<std::int64_t>(b.x - a.x) * (c.y - a.y);
}

[[nodiscard]] constexpr std::int64_t squared_length(const Corner& a, const Corner& b) noexcept {
  const std::int64_t x = a.x - b.x;
  const std::int64_t y = a.y - b.y;
  return x * x + y * y;
}

// Whether a picture put linearly on the face lies within max_shift_px of where the camera saw it. Linear on the face is
// not linear on the image: a point with weights l_i on the image has l_i z_i / sum on the face. The shift, the
// covariance of depth and place over the mean depth, is at most L (sqrt r - 1) / (sqrt r + 1) for a longest side of L
// px and a ratio r of the largest to the smallest depth. Not asked of a face that is at most 1.5 px wide and bridges
// depths of more than 1 to 1.25: mostly a step between two surfaces, which shows no picture worth it.
[[nodiscard]] inline bool texture_stays(const Corner& a, const Corner& b, const Corner& c,
                                        double max_shift_px) noexcept {
  constexpr double kStep = 1.25;
  constexpr double kStepWidth_px = 1.5;
  const double least = std::fmin(a.w, std::fmin(b.w, c.w));
  const double most = std::fmax(a.w, std::fmax(b.w, c.w));
  const std::int64_t ab = squared_length(a, b);
  const std::int64_t bc = squared_length(b, c);
  const std::int64_t ca = squared_length(c, a);
  const double longest = std::sqrt(static_cast<double>(ab > bc ? (ab > ca ? ab : ca) : (bc > ca ? bc : ca)));
  const double share = max_shift_px / longest;
  if (share >= 1.0) return true;
  const double root = (1.0 + share) / (1.0 - share);
  if (most <= root * root * least) return true;
  const double width = static_cast<double>(turn(a, b, c)) / longest;
  return width <= kStepWidth_px && most > kStep * least;
}

// Greatest common divisor; an edge that spans (dx, dy) has as many pixel centres on it, one end left out.
[[nodiscard]] inline int steps_between(const Corner& a, const Corner& b) noexcept {
  int p = a.x > b.x ? a.x - b.x : b.x - a.x;
  int q = a.y > b.y ? a.y - b.y : b.y - a.y;
  while (q != 0) {
    const int r = p % q;
    p = q;
    q = r;
  }
  return p;
}

// Calls f(y, first, last) for each row of pixel centres in the closed triangle; stops when f returns false.
template <class RowFunction>
[[nodiscard]] bool for_triangle_rows(Corner a, Corner b, Corner c, const RowFunction& f) noexcept {
  const auto swap = [](Corner& p, Corner& q) {
    const Corner t = p;
    p = q;
    q = t;
  };
  if (b.y < a.y) swap(a, b);
  if (c.y < b.y) swap(b, c);
  if (b.y < a.y) swap(a, b);
  const auto slope = [](const Corner& p, const Corner& q) {
    return q.y == p.y ? 0.0 : static_cast<double>(q.x - p.x) / static_cast<double>(q.y - p.y);
  };
  const double whole = slope(a, c);
  const double upper = slope(a, b);
  const double lower = slope(b, c);
  for (int y = a.y; y <= c.y; ++y) {
    const double p = a.x + (y - a.y) * whole;
    const double q = y < b.y ? a.x + (y - a.y) * upper : b.x + (y - b.y) * lower;
    // A crossing is a whole number or at least 1 / 2^15 from one.
    const int first = static_cast<int>(std::ceil((p < q ? p : q) - 1e-6));
    const int last = static_cast<int>(std::floor((p < q ? q : p) + 1e-6));
    if (first <= last && !f(y, first, last)) return false;
  }
  return true;
}

// Plane of w over the image through three corners.
struct InversePlane {
  InversePlane(const Corner& a, const Corner& b, const Corner& c) noexcept : x0(a.x), y0(a.y), w0(a.w) {
    const double scale =
        1.0 / (static_cast<double>(b.x - a.x) * (c.y - a.y) - static_cast<double>(c.x - a.x) * (b.y - a.y));
    dx = ((b.w - a.w) * (c.y - a.y) - (c.w - a.w) * (b.y - a.y)) * scale;
    dy = ((c.w - a.w) * (b.x - a.x) - (b.w - a.w) * (c.x - a.x)) * scale;
  }
  [[nodiscard]] double at(int x, int y) const noexcept { return w0 + (x - x0) * dx + (y - y0) * dy; }
  int x0, y0;
  double w0, dx, dy;
};

// Calls f(w, thin) with w of the sheet and of the triangle at its pixel centres; stops when f returns false.
template <class F>
[[nodiscard]] bool at_centres(const SheetPlanes& sheet, const Corner& a, const Corner& b, const Corner& c,
                              const F& f) noexcept {
  const InversePlane plane(a, b, c);
  return for_triangle_rows(a, b, c, [&](int y, int first, int last) {
    const float* w = sheet.inverse_depth.row(y);
    for (int x = first; x <= last; ++x) {
      if (!f(static_cast<double>(w[x]), plane.at(x, y))) return false;
    }
    return true;
  });
}

// Whether depth at all pixel centres of a triangle is within a bound. Lanes are neighbouring pixels, in float with room
// for its rounding; what float cannot decide is looked at in double, so that every batch gives the same answer.
template <class F>
[[nodiscard]] bool centres_are_close(const SheetPlanes& sheet, const Corner& a, const Corner& b, const Corner& c,
                                     double bound) noexcept {
  using I = typename F::Int;
  if (turn(a, b, c) <= 1) return true;  // no centres but the corners
  const auto low = [](int p, int q, int r) { return p < q ? (p < r ? p : r) : (q < r ? q : r); };
  const auto high = [](int p, int q, int r) { return p > q ? (p > r ? p : r) : (q > r ? q : r); };
  const int x0 = low(a.x, b.x, c.x);
  const int x1 = high(a.x, b.x, c.x);
  const int y0 = low(a.y, b.y, c.y);
  const int y1 = high(a.y, b.y, c.y);
  const InversePlane plane(a, b, c);
  const double largest = a.w > b.w ? (a.w > c.w ? a.w : c.w) : (b.w > c.w ? b.w : c.w);
  // Rounding of the start of a batch, at most 16 slopes beyond w, of the slope, of their product and sum, of the
  // difference and of what is allowed: 5 of the largest w and 45 of the slope, in units of 2^-24.
  const F margin(static_cast<float>((largest + 4.0 * std::fabs(plane.dx)) * 0x1p-20));
  const F share(static_cast<float>(bound));
  const F slope = F::iota() * F(static_cast<float>(plane.dx));
  // Each side as a form that is not negative inside.
  struct Side {
    int dx, dy, start;
  };
  const auto side = [&](const Corner& p, const Corner& q) {
    const int dx = q.y - p.y;
    const int dy = p.x - q.x;
    return Side{dx, dy, (x0 - p.x) * dx + (y0 - p.y) * dy};
  };
  const Side sides[3] = {side(a, b), side(b, c), side(c, a)};
  for (int x = x0; x <= x1; x += F::lanes) {
    I along[3];
    for (int k = 0; k < 3; ++k) along[k] = I::iota() * I(sides[k].dx) + I(sides[k].start + (x - x0) * sides[k].dx);
    for (int y = y0; y <= y1; ++y) {
      const auto inside = (along[0] | along[1] | along[2]) >= I(0);
      for (int k = 0; k < 3; ++k) along[k] = along[k] + I(sides[k].dy);
      const F w = F::load(sheet.inverse_depth.row(y) + x);
      const F thin = slope + F(static_cast<float>(plane.at(x, y)));
      const F off = abs(w - thin);
      const F allowed = share * thin;
      const auto doubtful = inside & ~(off <= allowed - margin);
      if (none(doubtful)) continue;
      if (any(inside & ~(off <= allowed + margin))) return false;
      for (int i = 0; i < F::lanes; ++i) {
        if (!doubtful.lane(i)) continue;
        const double exact = plane.at(x + i, y);
        if (!(std::fabs(static_cast<double>(sheet.inverse_depth(x + i, y)) - exact) <= bound * exact)) return false;
      }
    }
  }
  return true;
}

// Labels of the pixel centres of a triangle whose corners have one label.
[[nodiscard]] inline bool triangle_is_pure(const SheetPlanes& sheet, const Corner& a, const Corner& b,
                                           const Corner& c) noexcept {
  return for_triangle_rows(a, b, c, [&](int y, int first, int last) {
    for (int x = first; x <= last; ++x) {
      if (sheet.id(x, y) != a.id) return false;
    }
    return true;
  });
}

// Labels on an edge.
[[nodiscard]] inline bool edge_is_pure(const SheetPlanes& sheet, const Corner& a, const Corner& b) noexcept {
  const int steps = steps_between(a, b);
  if (a.id != b.id) return steps == 1;
  for (int i = 1; i < steps; ++i) {
    if (sheet.id(a.x + (b.x - a.x) / steps * i, a.y + (b.y - a.y) / steps * i) != a.id) return false;
  }
  return true;
}

// No pixel centre inside: Pick's theorem.
[[nodiscard]] inline bool triangle_is_bare(const Corner& a, const Corner& b, const Corner& c) noexcept {
  return turn(a, b, c) + 2 == steps_between(a, b) + steps_between(b, c) + steps_between(c, a);
}

// Calls f(w, thin) where an edge crosses edges of the sheet, which lie along lines of constant x, y, x - y and x + y;
// stops when f returns false.
template <class F>
[[nodiscard]] bool at_crossings(const SheetPlanes& sheet, const Corner& a, const Corner& b, const F& f) noexcept {
  const double dx = b.x - a.x;
  const double dy = b.y - a.y;
  const double dw = b.w - a.w;
  // Calls visit(s, t) at each whole value s that a coordinate with these ends takes in between, t of the way along.
  const auto crossings = [](int from, int to, const auto& visit) {
    const int n = to > from ? to - from : from - to;
    const int step = to < from ? -1 : 1;
    const double share = n > 0 ? 1.0 / n : 0.0;
    for (int i = 1; i < n; ++i) {
      if (!visit(from + i * step, i * share)) return false;
    }
    return true;
  };
  // A crossing at a pixel centre may come out a little before it, and must be looked up beyond.
  const auto whole = [](double v) { return static_cast<int>(v + 1e-6); };
  // Along the edge of the sheet from pixel 0 to pixel 1.
  const auto at = [&](double t, int x0, int y0, int x1, int y1, double share) {
    const double w0 = static_cast<double>(sheet.inverse_depth(x0, y0));
    const double w1 = static_cast<double>(sheet.inverse_depth(x1, y1));
    if (!(w0 > 0.0) || !(w1 > 0.0)) return true;
    return f(w0 + share * (w1 - w0), a.w + t * dw);
  };
  const int right = sheet.inverse_depth.width() - 1;
  const int bottom = sheet.inverse_depth.height() - 1;
  return crossings(a.x, b.x,
                   [&](int x, double t) {
                     const double y = a.y + t * dy;
                     const int row = whole(y);
                     return row >= bottom || at(t, x, row, x, row + 1, y - row);
                   }) &&
         crossings(a.y, b.y,
                   [&](int y, double t) {
                     const double x = a.x + t * dx;
                     const int column = whole(x);
                     return column >= right || at(t, column, y, column + 1, y, x - column);
                   }) &&
         crossings(a.x - a.y, b.x - b.y,
                   [&](int difference, double t) {
                     const double x = a.x + t * dx;
                     const int column = whole(x);
                     const int row = column - difference;
                     if (!sheet.quads.contains(column, row)) return true;  // a pixel centre
                     return (sheet.quads(column, row) & kQuadAntiDiagonal) != 0 ||
                            at(t, column, row, column + 1, row + 1, x - column);
                   }) &&
         crossings(a.x + a.y, b.x + b.y, [&](int sum, double t) {
           const double x = a.x + t * dx;
           const int column = whole(x);
           const int row = sum - 1 - column;
           if (!sheet.quads.contains(column, row)) return true;
           return (sheet.quads(column, row) & kQuadAntiDiagonal) == 0 ||
                  at(t, column, row + 1, column + 1, row, x - column);
         });
}

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_SIMPLIFY_BOUND_HPP
