// SPDX-License-Identifier: Apache-2.0
// Which face of a mesh each pixel of a view shows, and how far away it is: a z-buffer rasteriser. Part of preview.hpp.
//
// Corners are projected in double and rounded to 1/256 pixel; from there coverage is whole-number arithmetic, so it is
// exact: a pixel belongs to a triangle when its centre lies inside, or on a top or left edge (top-left rule). Hence
// triangles that share edges leave no gap and take no pixel twice, whatever their size, as long as they do not overlap.
// The range of pixels of a row comes from three divisions, so that a sliver a thousand pixels long costs its rows, not
// its box. Triangles are clipped to the near plane and to 2^20 pixels around the principal point, always from the inner
// to the outer end of an edge, so that both triangles at a clipped edge get the same new corner. The nearest face wins,
// of equals the first. Both sides are drawn. A face with a corner that is not finite is left out; flat ones cover
// nothing.
//
// Invariant: the same bits for every executor: a band of rows takes the faces in their order, and no other band touches
// its pixels; sums of coordinates are exact up to 2^29 subpixels. Cost: O(faces) for projection, one byte pair per face
// and band, then the rows and pixels covered.
// Memory: 12 bytes a vertex, 2 a face.
// Error: a pixel whose centre is more than 1/256 pixel from every projected edge shows exactly the face that a ray
// through its centre meets first, but where two of them are equally far to 1e-6; the inverse depth lies within that of
// the face's corners and is off by at most what it changes over 1/256 pixel, and 3e-7 relative.
#ifndef NPSIM_RENDER_DETAIL_RASTERIZE_HPP
#define NPSIM_RENDER_DETAIL_RASTERIZE_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr int kSubpixelBits = 8;
inline constexpr std::int32_t kSubpixels = 1 << kSubpixelBits;  // per pixel
inline constexpr std::int32_t kHalfPixel = kSubpixels / 2;

// A corner on the screen, x right and y down, in subpixels; value is what is interpolated, not negative.
struct ScreenCorner {
  std::int32_t x = 0;
  std::int32_t y = 0;
  float value = 0;
};

// Rows or columns, both ends included; empty where first > last.
struct PixelRange {
  int first = 0;
  int last = -1;
};

namespace coverage_detail {

// Rows or columns whose centres lie between two coordinates, ends included.
[[nodiscard]] inline PixelRange centres_between(std::int32_t low, std::int32_t high, int size) noexcept {
  // Shifts round down.
  const std::int32_t first = (low - kHalfPixel + kSubpixels - 1) >> kSubpixelBits;
  const std::int32_t last = (high - kHalfPixel) >> kSubpixelBits;
  return {std::max(first, 0), std::min(last, size - 1)};
}

[[nodiscard]] constexpr std::int64_t divided_down(std::int64_t a, std::int64_t positive) noexcept {
  return a >= 0 ? a / positive : -((positive - 1 - a) / positive);
}

// The edge from p to q of a triangle that runs clockwise on the screen (y down): positive inside.
struct Edge {
  std::int64_t dx, dy, px, py;
  std::int64_t least;  // a centre on the edge counts if it is a top or left one: 0, else 1

  Edge(const ScreenCorner& p, const ScreenCorner& q) noexcept
      : dx(std::int64_t{q.x} - p.x),
        dy(std::int64_t{q.y} - p.y),
        px(p.x),
        py(p.y),
        least(dy < 0 || (dy == 0 && dx > 0) ? 0 : 1) {}
  // Twice the area of the triangle with the centre of pixel (x, y), in square subpixels.
  [[nodiscard]] std::int64_t at(int x, int y) const noexcept {
    return dx * (std::int64_t{y} * kSubpixels + kHalfPixel - py) -
           dy * (std::int64_t{x} * kSubpixels + kHalfPixel - px);
  }
  // Narrows a range of pixels of row y to those on the inner side.
  void narrow(int y, std::int64_t& first, std::int64_t& last) const noexcept {
    const std::int64_t e = at(0, y) - least;  // at column x: e - x dy kSubpixels
    if (dy < 0) first = std::max(first, -divided_down(e, -dy * kSubpixels));
    if (dy > 0) last = std::min(last, divided_down(e, dy * kSubpixels));
    if (dy == 0 && e < 0) last = first - 1;
  }
};

// The rows of a picture in which a triangle may cover a pixel; empty if it covers none.
[[nodiscard]] inline PixelRange covered_rows(const ScreenCorner& a, const ScreenCorner& b, const ScreenCorner& c,
                                             int width, int height) noexcept {
  const PixelRange x = centres_between(std::min(a.x, std::min(b.x, c.x)), std::max(a.x, std::max(b.x, c.x)), width);
  const PixelRange y = centres_between(std::min(a.y, std::min(b.y, c.y)), std::max(a.y, std::max(b.y, c.y)), height);
  return x.first <= x.last ? y : PixelRange{};
}

}  // namespace coverage_detail

// Calls f(x, y, value) for each pixel of the rows [first_row, end_row) that a triangle covers.
template <class F>
void for_covered(ScreenCorner a, ScreenCorner b, ScreenCorner c, int first_row, int end_row, int width, F&& f) {
  std::int64_t area =
      (std::int64_t{b.x} - a.x) * (std::int64_t{c.y} - a.y) - (std::int64_t{b.y} - a.y) * (std::int64_t{c.x} - a.x);
  if (area == 0) return;
  if (area < 0) {
    std::swap(b, c);
    area = -area;
  }
  const PixelRange columns =
      coverage_detail::centres_between(std::min(a.x, std::min(b.x, c.x)), std::max(a.x, std::max(b.x, c.x)), width);
  const PixelRange rows =
      coverage_detail::centres_between(std::min(a.y, std::min(b.y, c.y)), std::max(a.y, std::max(b.y, c.y)), end_row);
  if (columns.first > columns.last) return;
  const coverage_detail::Edge to_a(b, c);
  const coverage_detail::Edge to_b(c, a);
  const coverage_detail::Edge to_c(a, b);
  const double scale = 1.0 / static_cast<double>(area);
  const double wa = static_cast<double>(a.value) * scale;
  const double wb = static_cast<double>(b.value) * scale;
  const double wc = static_cast<double>(c.value) * scale;
  for (int y = std::max(rows.first, first_row); y <= rows.last; ++y) {
    std::int64_t first = columns.first;
    std::int64_t last = columns.last;
    to_a.narrow(y, first, last);
    to_b.narrow(y, first, last);
    to_c.narrow(y, first, last);
    for (; first <= last; ++first) {
      const auto x = static_cast<int>(first);
      // A sum of positive terms: it stays within the corners'.
      f(x, y,
        static_cast<float>(static_cast<double>(to_a.at(x, y)) * wa + static_cast<double>(to_b.at(x, y)) * wb +
                           static_cast<double>(to_c.at(x, y)) * wc));
    }
  }
}

namespace rasterize_detail {

inline constexpr double kReachPx = 1 << 20;  // of coordinates around the principal point
// In place of an inverse depth, where a vertex has no place on the screen.
inline constexpr float kToClip = 0.0F;
inline constexpr float kNotFinite = -1.0F;

// From points of the mesh to the pixel grid of one view.
struct Projection {
  Vec3d right, down, forward, eye;
  double fx, fy, cx, cy, near;

  // In pixels from the principal point, times depth: what clipping works on.
  [[nodiscard]] Vec3d scaled_point(const Vec3f& p) const noexcept {
    const Vec3d v = vec_cast<double>(p) - eye;
    return {fx * dot(right, v), fy * dot(down, v), dot(forward, v)};
  }
  [[nodiscard]] ScreenCorner corner(const Vec3d& p) const noexcept {
    // The offset makes truncation round down. Clipped corners may be beyond the reach by a rounding.
    constexpr double kOffset = 4 * kReachPx * kSubpixels;
    const auto snap = [](double px) {
      const auto whole = static_cast<std::int64_t>(px * kSubpixels + (kOffset + 0.5));
      return static_cast<std::int32_t>(whole - static_cast<std::int64_t>(kOffset));
    };
    return {snap(p.x / p.z + cx), snap(p.y / p.z + cy), static_cast<float>(1.0 / p.z)};
  }
  [[nodiscard]] bool within(const Vec3d& p) const noexcept {
    return p.z >= near && std::fabs(p.x) <= kReachPx * p.z && std::fabs(p.y) <= kReachPx * p.z;
  }
  // How far inside clipping plane `plane` a point is.
  [[nodiscard]] double inside(int plane, const Vec3d& p) const noexcept {
    switch (plane) {
      case 0: return p.z - near;
      case 1: return kReachPx * p.z - p.x;
      case 2: return kReachPx * p.z + p.x;
      case 3: return kReachPx * p.z - p.y;
      default: return kReachPx * p.z + p.y;
    }
  }
};

}  // namespace rasterize_detail

struct RasterizedView {
  ImageView<std::uint32_t> face;      // kNoFace where nothing is seen
  ImageView<float> inverse_depth_pm;  // 1 / z-depth of the view, 1/m; 0 where nothing is seen
};

// The bands of rows that a face may show in; first > last: in none.
struct BandRange {
  std::uint8_t first = 1;
  std::uint8_t last = 0;
};

inline constexpr std::size_t kRasterFacesPerChunk = 1U << 14U;

[[nodiscard]] constexpr std::size_t rasterize_workspace_bytes(std::size_t vertices, std::size_t faces) noexcept {
  return allocation_bytes<ScreenCorner>(vertices) + allocation_bytes<BandRange>(faces) +
         allocation_bytes<std::uint8_t>(chunk_count(faces, kRasterFacesPerChunk)) + kWorkspaceAlignment;
}

namespace rasterize_detail {

[[nodiscard]] constexpr int band_rows(int height) noexcept {
  constexpr int kMaxBands = 254;  // bytes count them
  return std::max(16, (height + kMaxBands - 1) / kMaxBands);
}

inline constexpr int kMaxClippedCorners = 8;  // a triangle and five planes

struct ClippedPolygon {
  Vec3d corner[kMaxClippedCorners + 1];
  int count = 0;
};

// The next polygon of Sutherland and Hodgman's method.
[[nodiscard]] inline ClippedPolygon clipped(const Projection& projection, int plane,
                                            const ClippedPolygon& in) noexcept {
  ClippedPolygon out;
  for (int i = 0; i < in.count; ++i) {
    const Vec3d& p = in.corner[i];
    const Vec3d& q = in.corner[i + 1 < in.count ? i + 1 : 0];
    const double dp = projection.inside(plane, p);
    const double dq = projection.inside(plane, q);
    if (dp >= 0 && out.count < kMaxClippedCorners) out.corner[out.count++] = p;
    if ((dp >= 0) == (dq >= 0) || out.count >= kMaxClippedCorners) continue;
    const Vec3d& kept = dp >= 0 ? p : q;
    const Vec3d& lost = dp >= 0 ? q : p;
    const double d = dp >= 0 ? dp : dq;
    const double t = d / (d - (dp >= 0 ? dq : dp));
    Vec3d cut = kept + (lost - kept) * t;
    cut.z = std::max(cut.z, projection.near);
    out.corner[out.count++] = cut;
  }
  return out;
}

// Calls f(a, b, c) with the corners of what is left of a face, in at most six triangles.
template <class F>
void for_triangles(const Projection& projection, const TriangleMeshView& mesh, const ScreenCorner* corners,
                   const Face& face, F&& f) {
  const ScreenCorner& a = corners[face.a];
  const ScreenCorner& b = corners[face.b];
  const ScreenCorner& c = corners[face.c];
  const float least = std::min(a.value, std::min(b.value, c.value));
  if (least > 0.0F) return f(a, b, c);
  if (least < 0.0F) return;
  ClippedPolygon polygon;
  polygon.count = 3;
  polygon.corner[0] = projection.scaled_point(mesh.vertices[face.a]);
  polygon.corner[1] = projection.scaled_point(mesh.vertices[face.b]);
  polygon.corner[2] = projection.scaled_point(mesh.vertices[face.c]);
  for (int plane = 0; plane < 5 && polygon.count > 0; ++plane) polygon = clipped(projection, plane, polygon);
  for (int i = 2; i < polygon.count; ++i) {
    f(projection.corner(polygon.corner[0]), projection.corner(polygon.corner[i - 1]),
      projection.corner(polygon.corner[i]));
  }
}

using Corners = Span<const ScreenCorner>;

// The bands of `rows` rows that a face may show in.
[[nodiscard]] inline BandRange bands_of(const Projection& projection, const TriangleMeshView& mesh, Corners corners,
                                        const Face& face, Shape shape, int rows) noexcept {
  PixelRange span{shape.height, -1};
  const auto widen = [&](const ScreenCorner& a, const ScreenCorner& b, const ScreenCorner& c) {
    const PixelRange rows_of_it = coverage_detail::covered_rows(a, b, c, shape.width, shape.height);
    if (rows_of_it.first > rows_of_it.last) return;
    span = {std::min(span.first, rows_of_it.first), std::max(span.last, rows_of_it.last)};
  };
  for_triangles(projection, mesh, corners.data(), face, widen);
  if (span.first > span.last) return {};
  return {static_cast<std::uint8_t>(span.first / rows), static_cast<std::uint8_t>(span.last / rows)};
}

// Draws the faces that may show in the band of rows [first_row, end_row).
inline void draw_band(const Projection& projection, const TriangleMeshView& mesh, Corners corners,
                      Span<const BandRange> bands, std::size_t band, int first_row, int end_row,
                      const RasterizedView& out) noexcept {
  const int width = out.face.width();
  for (int y = first_row; y < end_row; ++y) {
    std::fill_n(out.face.row(y), width, kNoFace);
    std::fill_n(out.inverse_depth_pm.row(y), width, 0.0F);
  }
  for (std::size_t i = 0; i < bands.size(); ++i) {
    if (bands[i].first > band || bands[i].last < band) continue;
    const auto draw = [&](const ScreenCorner& a, const ScreenCorner& b, const ScreenCorner& c) {
      for_covered(a, b, c, first_row, end_row, width, [&](int x, int y, float inverse_depth) {
        float& nearest = out.inverse_depth_pm(x, y);
        if (!(inverse_depth > nearest)) return;
        nearest = inverse_depth;
        out.face(x, y) = static_cast<std::uint32_t>(i);
      });
    };
    for_triangles(projection, mesh, corners.data(), mesh.faces[i], draw);
  }
}

}  // namespace rasterize_detail

template <class Executor>
[[nodiscard]] Status rasterize(const rasterize_detail::Projection& projection, const TriangleMeshView& mesh,
                               const RasterizedView& out, Workspace& workspace, Executor& executor) {
  namespace detail = rasterize_detail;
  if (out.face.empty() || out.inverse_depth_pm.empty() || out.face.shape() != out.inverse_depth_pm.shape()) {
    return {StatusCode::shape_mismatch, "rasterize: face and inverse depth must be of one shape, not empty"};
  }
  const Shape shape = out.face.shape();
  if (shape.width > 65536 || shape.height > 65536 || mesh.faces.size() >= kNoFace) {
    return {StatusCode::capacity_exceeded, "rasterize handles 65536 pixels a side and 2^32 - 2 faces"};
  }
  const WorkspaceScope scope(workspace);
  Span<ScreenCorner> corners;
  Span<BandRange> bands;
  Span<std::uint8_t> bad;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(mesh.vertices.size(), corners));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(mesh.faces.size(), bands));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(chunk_count(mesh.faces.size(), kRasterFacesPerChunk), bad));

  executor.for_chunks(mesh.vertices.size(), kRasterFacesPerChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3d p = projection.scaled_point(mesh.vertices[i]);
      corners[i] = {0, 0, is_finite(p) ? detail::kToClip : detail::kNotFinite};
      if (projection.within(p)) corners[i] = projection.corner(p);
    }
  });
  const int rows = detail::band_rows(shape.height);
  executor.for_chunks(mesh.faces.size(), kRasterFacesPerChunk, [&](std::size_t begin, std::size_t end) {
    bool all_known = true;
    for (std::size_t i = begin; i < end; ++i) {
      const Face& face = mesh.faces[i];
      const std::size_t n = corners.size();
      const bool known = face.a < n && face.b < n && face.c < n;
      bands[i] = known ? detail::bands_of(projection, mesh, corners, face, shape, rows) : BandRange{};
      all_known = all_known && known;
    }
    bad[begin / kRasterFacesPerChunk] = all_known ? 0 : 1;
  });
  for (const std::uint8_t chunk : bad) {
    if (chunk != 0) return {StatusCode::invalid_argument, "rasterize: a face names a vertex that does not exist"};
  }
  executor.for_chunks(static_cast<std::size_t>(shape.height), static_cast<std::size_t>(rows),
                      [&](std::size_t begin, std::size_t end) {
                        detail::draw_band(projection, mesh, corners, bands, begin / static_cast<std::size_t>(rows),
                                          static_cast<int>(begin), static_cast<int>(end), out);
                      });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_DETAIL_RASTERIZE_HPP
