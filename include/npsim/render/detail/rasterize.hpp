// SPDX-License-Identifier: Apache-2.0
// Which face of a mesh each pixel of a view shows, and how far away it is: a z-buffer rasteriser.
//
// Corners are projected in double and rounded to 1/256 pixel; from there coverage is whole-number arithmetic, so it is
// exact: a pixel belongs to a triangle when its centre lies inside, or on a top or left edge (top-left rule). Hence two
// triangles that share an edge leave no gap along it and never draw a pixel twice. Triangles are clipped to the near
// plane and to 2^20 pixels around the principal point, always from the inner to the outer end of an edge, so that both
// triangles at a clipped edge get the same new corner. The nearest face wins, of equals the first. Both sides are
// drawn. A face with a corner that is not finite is left out; flat ones cover nothing.
//
// Invariant: the same bits for every executor: a band of rows takes the faces in their order, and no other band touches
// its pixels. Cost: O(faces) for projection, one byte pair per face and band, then the pixels covered.
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

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/render/detail/coverage.hpp"
#include "npsim/render/view_pose.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct RasterizeParams {
  float near_m = 0.05F;  // nothing nearer than this is drawn
};

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

[[nodiscard]] constexpr std::size_t rasterize_workspace_bytes(const RasterizeParams&, std::size_t vertices,
                                                              std::size_t faces) noexcept {
  return allocation_bytes<ScreenCorner>(vertices) + allocation_bytes<BandRange>(faces) +
         allocation_bytes<std::uint8_t>(chunk_count(faces, kRasterFacesPerChunk)) + kWorkspaceAlignment;
}

namespace rasterize_detail {

inline constexpr double kReachPx = 1 << 20;  // of coordinates around the principal point
// In place of an inverse depth, where a vertex has no place on the screen.
inline constexpr float kToClip = 0.0F;
inline constexpr float kNotFinite = -1.0F;

[[nodiscard]] constexpr int band_rows(int height) noexcept {
  constexpr int kMaxBands = 254;  // bytes count them
  return std::max(16, (height + kMaxBands - 1) / kMaxBands);
}

// From points of the mesh to the pixel grid of one view.
struct Projection {
  Vec3d right, down, forward, eye;
  double fx, fy, cx, cy, near;

  Projection(const Intrinsics& k, const ViewPose& pose, float near_m) noexcept
      : right(vec_cast<double>(pose.right)),
        down(vec_cast<double>(pose.down)),
        forward(vec_cast<double>(pose.forward)),
        eye(vec_cast<double>(pose.eye_m)),
        fx(static_cast<double>(k.fx)),
        fy(static_cast<double>(k.fy)),
        cx(static_cast<double>(k.cx)),
        cy(static_cast<double>(k.cy)),
        near(static_cast<double>(near_m)) {}

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

}  // namespace rasterize_detail

[[nodiscard]] inline Status validate(const RasterizeParams& params, const Intrinsics& camera) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(camera));
  if (!(params.near_m >= 1e-4F) || !std::isfinite(params.near_m)) {
    return {StatusCode::invalid_argument, "rasterize: near_m must be at least 1e-4"};
  }
  if (!(std::fabs(camera.cx) <= 65536.0F && std::fabs(camera.cy) <= 65536.0F && camera.fx <= 1e9F &&
        camera.fy <= 1e9F)) {
    return {StatusCode::invalid_argument, "rasterize: principal point beyond 65536 px or focal length beyond 1e9 px"};
  }
  return {};
}

template <class Executor>
[[nodiscard]] Status rasterize(const RasterizeParams& params, const TriangleMeshView& mesh, const Intrinsics& camera,
                               const ViewPose& pose, const RasterizedView& out, Workspace& workspace,
                               Executor& executor) {
  namespace detail = rasterize_detail;
  NPSIM_RETURN_IF_ERROR(validate(params, camera));
  NPSIM_RETURN_IF_ERROR(validate(pose));
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

  const detail::Projection projection(camera, pose, params.near_m);
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
      bands[i] = {};
      if (face.a >= n || face.b >= n || face.c >= n) {
        all_known = false;
        continue;
      }
      PixelRange span{shape.height, -1};
      const auto widen = [&](const ScreenCorner& a, const ScreenCorner& b, const ScreenCorner& c) {
        const PixelRange rows_of_it = coverage_detail::covered_rows(a, b, c, shape.width, shape.height);
        if (rows_of_it.first > rows_of_it.last) return;
        span = {std::min(span.first, rows_of_it.first), std::max(span.last, rows_of_it.last)};
      };
      detail::for_triangles(projection, mesh, corners.data(), face, widen);
      if (span.first <= span.last) {
        bands[i] = {static_cast<std::uint8_t>(span.first / rows), static_cast<std::uint8_t>(span.last / rows)};
      }
    }
    bad[begin / kRasterFacesPerChunk] = all_known ? 0 : 1;
  });
  for (const std::uint8_t chunk : bad) {
    if (chunk != 0) return {StatusCode::invalid_argument, "rasterize: a face names a vertex that does not exist"};
  }

  executor.for_chunks(
      static_cast<std::size_t>(shape.height), static_cast<std::size_t>(rows), [&](std::size_t begin, std::size_t end) {
        const auto first_row = static_cast<int>(begin);
        const auto end_row = static_cast<int>(end);
        const std::size_t band = begin / static_cast<std::size_t>(rows);
        for (int y = first_row; y < end_row; ++y) {
          std::fill_n(out.face.row(y), shape.width, kNoFace);
          std::fill_n(out.inverse_depth_pm.row(y), shape.width, 0.0F);
        }
        for (std::size_t i = 0; i < bands.size(); ++i) {
          if (bands[i].first > band || bands[i].last < band) continue;
          const auto draw = [&](const ScreenCorner& a, const ScreenCorner& b, const ScreenCorner& c) {
            for_covered(a, b, c, first_row, end_row, shape.width, [&](int x, int y, float inverse_depth) {
              float& nearest = out.inverse_depth_pm(x, y);
              if (!(inverse_depth > nearest)) return;
              nearest = inverse_depth;
              out.face(x, y) = static_cast<std::uint32_t>(i);
            });
          };
          detail::for_triangles(projection, mesh, corners.data(), mesh.faces[i], draw);
        }
      });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_DETAIL_RASTERIZE_HPP
