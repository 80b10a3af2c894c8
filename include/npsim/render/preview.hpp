// SPDX-License-Identifier: Apache-2.0
// A picture of a mesh from any side, for people to look at: is it whole, and is it where it should be?
//
// rasterize() finds the face of each pixel. Its colour is taken where the ray through the pixel's centre meets the
// plane of the face: between the colours of its vertices, or from a texture (the photograph), whose pixel each vertex
// knows; bilinear, so that large faces of a simplified mesh show the photograph too. Backs are tinted red: seen from
// the front they are holes, from the side what is missing. Shading darkens a face by how it turns from a lamp above the
// left shoulder, wires draw the edges. All of it works on encoded (sRGB) values: this is a drawing, not light.
//
// Barycentric weights are those of the ray d and the corners a, b, c seen from the eye, w_a = d . (b x c) and so on;
// they hold for faces that reach behind the camera as well. At the rim, where the pixel's centre lies outside by less
// than 1/256 pixel, they are clamped. A wire runs where a pixel's centre is within half a width of an edge's line.
//
// A view is a rigid pose of a camera in the frame of the mesh, which is that of the photograph's camera: x right, y
// down, z forward, metres. closer() and turned() make the poses that a mesh is judged by: some metres closer, and
// turned about a point of the scene. Clockwise is as seen from above: the camera's heading turns to the right, and the
// camera itself moves to the left, round the pivot. Which pivot shows the scene depends on it: about a far one the
// camera leaves a narrow street and stands behind the house fronts, about a near one it sees little of an open place;
// pivot_m() tries some on a coarse picture of points, at most 160 x 90 of them for each candidate, with 4 KB of stack.
// A pose made from a unit pose stays orthonormal to 1e-6.
//
// Invariant: the same bits for every executor. Cost: rasterize(), and about 60 multiplications a pixel. Memory: 8 bytes
// a pixel and rasterize()'s. Error: each channel within one of 255 of the exact colour, more than 1/256 pixel from
// edges.
#ifndef NPSIM_RENDER_PREVIEW_HPP
#define NPSIM_RENDER_PREVIEW_HPP

#include <algorithm>
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
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/render/detail/rasterize.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// The axes of the view's camera and its centre, in the mesh's frame. The default is the photograph's own camera.
struct ViewPose {
  Vec3f right{1, 0, 0};
  Vec3f down{0, 1, 0};
  Vec3f forward{0, 0, 1};
  Vec3f eye_m{0, 0, 0};
};

[[nodiscard]] inline Status validate(const ViewPose& pose) noexcept {
  constexpr float kTolerance = 1e-3F;
  const auto is_unit = [](const Vec3f& v) { return std::fabs(dot(v, v) - 1.0F) < kTolerance; };
  const Vec3f off = cross(pose.right, pose.down) - pose.forward;
  const bool good = is_finite(pose.eye_m) && is_unit(pose.right) && is_unit(pose.down) && is_unit(pose.forward) &&
                    dot(off, off) < kTolerance * kTolerance;
  return good ? Status()
              : Status(StatusCode::invalid_argument, "a view needs a finite place and right-handed unit axes");
}

// Moved along its own axis.
[[nodiscard]] constexpr ViewPose closer(const ViewPose& pose, float by_m) noexcept {
  return {pose.right, pose.down, pose.forward, pose.eye_m + pose.forward * by_m};
}

// Turned about the point pivot_m ahead of it: clockwise about its vertical, then climbing above that point. The point
// keeps its place in the picture and its distance.
[[nodiscard]] inline ViewPose turned(const ViewPose& pose, float clockwise_rad, float climb_rad,
                                     float pivot_m) noexcept {
  const Vec3f pivot = pose.eye_m + pose.forward * pivot_m;
  const float c = std::cos(clockwise_rad);
  const float s = std::sin(clockwise_rad);
  const Vec3f level = pose.forward * c + pose.right * s;
  const float cc = std::cos(climb_rad);
  const float sc = std::sin(climb_rad);
  ViewPose out;
  out.right = pose.right * c - pose.forward * s;
  out.forward = level * cc + pose.down * sc;
  out.down = pose.down * cc - level * sc;
  out.eye_m = pivot - out.forward * pivot_m;
  return out;
}

struct PivotParams {
  float min_m = 6.0F;  // > 0
  float max_m = 30.0F;
  int candidates = 12;  // 2 .. 64, each the same factor farther than the one before
};

namespace view_pose_detail {

// How many of at most 160 x 90 samples of the depth map's upright surfaces a view shows from their front: the ground is
// seen from everywhere. What hides them is found on a coarse picture of all samples.
[[nodiscard]] inline int fronts_seen(ImageView<const float> depth_m, const Intrinsics& k,
                                     const ViewPose& pose) noexcept {
  constexpr int kColumns = 40;
  constexpr int kRows = 24;
  float nearest[kRows][kColumns] = {};  // inverse depth of a cell's nearest sample; negative where its back is seen
  const int step = std::max(1, std::max(depth_m.width() / 160, depth_m.height() / 90));
  const float columns_per_px = static_cast<float>(kColumns) / static_cast<float>(depth_m.width());
  const float rows_per_px = static_cast<float>(kRows) / static_cast<float>(depth_m.height());
  const auto for_samples = [&](auto&& f) {
    for (int y = 0; y + 1 < depth_m.height(); y += step) {
      for (int x = 0; x + 1 < depth_m.width(); x += step) {
        const float z = depth_m(x, y);
        if (!is_valid_depth(z) || !is_valid_depth(depth_m(x + 1, y)) || !is_valid_depth(depth_m(x, y + 1))) continue;
        const Vec3f at = unproject_pixel(k, x, y, z);
        const Vec3f seen = at - pose.eye_m;
        const Vec3f p{dot(pose.right, seen), dot(pose.down, seen), dot(pose.forward, seen)};
        if (!(p.z > 0.1F)) continue;
        const Vec2f uv = project(k, p);
        const float column = uv.x * columns_per_px;
        const float row = uv.y * rows_per_px;
        if (!(column >= 0.0F && row >= 0.0F && column < kColumns && row < kRows)) continue;
        // Towards the photograph's camera, as every face of a sheet.
        const Vec3f normal = cross(unproject_pixel(k, x, y + 1, depth_m(x, y + 1)) - at,
                                   unproject_pixel(k, x + 1, y, depth_m(x + 1, y)) - at);
        const bool level = normal.y * normal.y > 0.5F * dot(normal, normal);
        f(nearest[static_cast<int>(row)][static_cast<int>(column)], dot(normal, seen) < 0.0F ? 1.0F / p.z : -1.0F / p.z,
          level);
      }
    }
  };
  for_samples([](float& cell, float inverse_depth, bool) {
    if (std::fabs(inverse_depth) > std::fabs(cell)) cell = inverse_depth;
  });
  constexpr float kSlack = 0.7F;  // the depth that a cell of a slanting surface spans
  int fronts = 0;
  for_samples([&](const float& cell, float inverse_depth, bool level) {
    fronts += !level && inverse_depth > kSlack * std::fabs(cell) && inverse_depth > 0.0F ? 1 : 0;
  });
  return fronts;
}

}  // namespace view_pose_detail

// How far ahead the point lies that a view turns about. Of the candidates those count from which nearly as much of the
// upright surfaces that the photograph saw is seen again, from its front, as from the best; the middle one of them is
// taken. The lower limit where there is no depth.
[[nodiscard]] inline float pivot_m(const PivotParams& params, ImageView<const float> depth_m, const Intrinsics& camera,
                                   float clockwise_rad, float climb_rad) noexcept {
  constexpr int kMaxCandidates = 64;
  constexpr float kNearly = 0.8F;
  int fronts[kMaxCandidates] = {};
  const int candidates = clamp_to(params.candidates, 2, kMaxCandidates);
  const auto candidate_m = [&](int i) {
    return params.min_m *
           std::pow(params.max_m / params.min_m, static_cast<float>(i) / static_cast<float>(candidates - 1));
  };
  int best = 0;
  for (int i = 0; i < candidates; ++i) {
    const ViewPose pose = turned(ViewPose{}, clockwise_rad, climb_rad, candidate_m(i));
    fronts[i] = view_pose_detail::fronts_seen(depth_m, camera, pose);
    best = std::max(best, fronts[i]);
  }
  int good[kMaxCandidates] = {};
  int count = 0;
  for (int i = 0; i < candidates; ++i) {
    if (static_cast<float>(fronts[i]) >= kNearly * static_cast<float>(best)) good[count++] = i;
  }
  if (best > 0) return candidate_m(good[(count - 1) / 2]);
  return params.min_m;
}

struct RasterizeParams {
  float near_m = 0.05F;  // nothing nearer than this is drawn
};

[[nodiscard]] inline Status validate(const RasterizeParams& p) noexcept {
  if (p.near_m >= 1e-4F && std::isfinite(p.near_m)) return {};
  return {StatusCode::invalid_argument, "rasterize: near_m must be at least 1e-4"};
}

struct PreviewParams {
  RasterizeParams rasterize;
  Rgb8 background{28, 30, 36};
  Rgb8 plain{200, 198, 192};  // of a mesh without colours
  Rgb8 back{150, 40, 34};     // what backs are tinted with
  float back_share = 0.65F;   // 0 .. 1
  float shading = 0.0F;       // 0: none; 1: black where a face is seen edge-on by the lamp
  float wire_px = 0.0F;       // width of the edges drawn; 0: none
  Rgb8 wire{20, 20, 24};
};

// One of: nothing (plain); vertex; texel with a texture.
struct PreviewColours {
  Span<const Rgb8> vertex;          // of each vertex
  Span<const std::uint32_t> texel;  // y * width + x in the texture, of each vertex
  ImageView<const Rgb8> texture;
};

[[nodiscard]] constexpr std::size_t preview_workspace_bytes(const PreviewParams&, Shape shape, std::size_t vertices,
                                                            std::size_t faces) noexcept {
  return allocation_bytes<std::uint32_t>(shape.pixels()) + allocation_bytes<float>(shape.pixels()) +
         rasterize_workspace_bytes(vertices, faces);
}

[[nodiscard]] inline Status validate(const PreviewParams& p) noexcept {
  const auto is_share = [](float v) { return v >= 0.0F && v <= 1.0F; };
  NPSIM_RETURN_IF_ERROR(validate(p.rasterize));
  const bool good = is_share(p.back_share) && is_share(p.shading) && p.wire_px >= 0.0F && p.wire_px <= 1000.0F;
  return good ? Status()
              : Status(StatusCode::invalid_argument, "preview: shares lie in 0 .. 1, the wires' width in 0 .. 1000 px");
}

[[nodiscard]] inline Status validate(const PreviewColours& colours, std::size_t vertices) noexcept {
  const bool vertex = colours.vertex.empty() || colours.vertex.size() == vertices;
  const bool texel = colours.texel.empty() || (colours.texel.size() == vertices && !colours.texture.empty());
  if (!vertex || !texel) return {StatusCode::shape_mismatch, "preview: one colour or texel per vertex, and a texture"};
  const std::size_t texels = colours.texel.empty() ? 0 : colours.texture.shape().pixels();
  for (const std::uint32_t t : colours.texel) {
    if (t >= texels) return {StatusCode::invalid_argument, "preview: a texel lies outside the texture"};
  }
  return {};
}

namespace rasterize_detail {

// From the mesh's frame to the pixels of a view.
[[nodiscard]] inline Projection projection_of(const Intrinsics& k, const ViewPose& pose, float near_m) noexcept {
  return {vec_cast<double>(pose.right), vec_cast<double>(pose.down), vec_cast<double>(pose.forward),
          vec_cast<double>(pose.eye_m), static_cast<double>(k.fx),   static_cast<double>(k.fy),
          static_cast<double>(k.cx),    static_cast<double>(k.cy),   static_cast<double>(near_m)};
}

}  // namespace rasterize_detail

namespace preview_detail {

[[nodiscard]] inline Vec3d to_vec(Rgb8 c) noexcept {
  return {static_cast<double>(c.r), static_cast<double>(c.g), static_cast<double>(c.b)};
}
[[nodiscard]] inline Rgb8 to_rgb(const Vec3d& v) noexcept {
  const auto byte = [](double x) { return static_cast<std::uint8_t>(clamp_to(x, 0.0, 255.0) + 0.5); };
  return {byte(v.x), byte(v.y), byte(v.z)};
}

// Between four texels; x and y are whole numbers at their centres.
[[nodiscard]] inline Vec3d bilinear(ImageView<const Rgb8> texture, double x, double y) noexcept {
  const auto column = static_cast<int>(clamp_to(x, 0.0, static_cast<double>(texture.width() - 1)));
  const auto row = static_cast<int>(clamp_to(y, 0.0, static_cast<double>(texture.height() - 1)));
  const int next_column = std::min(column + 1, texture.width() - 1);
  const int next_row = std::min(row + 1, texture.height() - 1);
  const double fx = clamp_to(x - column, 0.0, 1.0);
  const double fy = clamp_to(y - row, 0.0, 1.0);
  const Vec3d upper = to_vec(texture(column, row)) * (1 - fx) + to_vec(texture(next_column, row)) * fx;
  const Vec3d lower = to_vec(texture(column, next_row)) * (1 - fx) + to_vec(texture(next_column, next_row)) * fx;
  return upper * (1 - fy) + lower * fy;
}

struct Shader {
  const PreviewParams& params;
  const TriangleMeshView& mesh;
  const PreviewColours& colours;
  const rasterize_detail::Projection& view;

  [[nodiscard]] Vec3d surface_colour(const Face& f, double wa, double wb, double wc) const noexcept {
    if (!colours.vertex.empty()) {
      return to_vec(colours.vertex[f.a]) * wa + to_vec(colours.vertex[f.b]) * wb + to_vec(colours.vertex[f.c]) * wc;
    }
    if (colours.texel.empty()) return to_vec(params.plain);
    const auto width = static_cast<std::uint32_t>(colours.texture.width());
    // Weights times depth from the photograph's camera: what is linear on the face is projective on the photograph.
    const double za = static_cast<double>(mesh.vertices[f.a].z) * wa;
    const double zb = static_cast<double>(mesh.vertices[f.b].z) * wb;
    const double zc = static_cast<double>(mesh.vertices[f.c].z) * wc;
    const double z = za + zb + zc;
    const bool ahead = za >= 0 && zb >= 0 && zc >= 0 && z > 0;
    const double ta = ahead ? za / z : wa;
    const double tb = ahead ? zb / z : wb;
    const double tc = ahead ? zc / z : wc;
    const auto between = [&](auto&& coordinate) {
      return static_cast<double>(coordinate(colours.texel[f.a])) * ta +
             static_cast<double>(coordinate(colours.texel[f.b])) * tb +
             static_cast<double>(coordinate(colours.texel[f.c])) * tc;
    };
    return bilinear(colours.texture, between([width](std::uint32_t t) { return t % width; }),
                    between([width](std::uint32_t t) { return t / width; }));
  }

  [[nodiscard]] Rgb8 operator()(std::uint32_t face, int x, int y) const noexcept {
    if (face == kNoFace) return params.background;
    const Face& f = mesh.faces[face];
    const Vec3d a = vec_cast<double>(mesh.vertices[f.a]) - view.eye;
    const Vec3d b = vec_cast<double>(mesh.vertices[f.b]) - view.eye;
    const Vec3d c = vec_cast<double>(mesh.vertices[f.c]) - view.eye;
    const Vec3d step_x = view.right * (1.0 / view.fx);
    const Vec3d step_y = view.down * (1.0 / view.fy);
    const Vec3d d = view.forward + step_x * (x + 0.5 - view.cx) + step_y * (y + 0.5 - view.cy);
    const Vec3d across[3] = {cross(b, c), cross(c, a), cross(a, b)};
    const Vec3d normal = cross(b - a, c - a);
    const bool is_back = dot(normal, a) > 0;
    double weight[3];
    double sum = 0;
    for (int i = 0; i < 3; ++i) {
      weight[i] = std::max(is_back ? dot(across[i], d) : -dot(across[i], d), 0.0);
      sum += weight[i];
    }
    if (!(sum > 0)) weight[0] = sum = 1;
    Vec3d colour = surface_colour(f, weight[0] / sum, weight[1] / sum, weight[2] / sum);
    if (params.shading > 0.0F) {
      constexpr double kLamp[3] = {-0.36, -0.80, -0.48};  // unit; seen from a face that it lights best
      const double size = length(normal);
      const double cosine =
          size > 0 ? std::fabs(normal.x * kLamp[0] + normal.y * kLamp[1] + normal.z * kLamp[2]) / size : 0.0;
      colour *= 1.0 - static_cast<double>(params.shading) * (1.0 - cosine);
    }
    if (is_back) {
      const auto share = static_cast<double>(params.back_share);
      colour = colour * (1.0 - share) + to_vec(params.back) * share;
    }
    if (params.wire_px > 0.0F) {
      // An edge's line on the screen is across . d = 0, with d linear in the pixel.
      const double half = 0.5 * static_cast<double>(params.wire_px);
      for (const Vec3d& n : across) {
        const double gx = dot(n, step_x);
        const double gy = dot(n, step_y);
        const double e = dot(n, d);
        if (e * e < half * half * (gx * gx + gy * gy)) colour = to_vec(params.wire);
      }
    }
    return to_rgb(colour);
  }
};

}  // namespace preview_detail

// The face that each pixel shows, and its inverse depth.
template <class Executor>
[[nodiscard]] Status rasterize(const RasterizeParams& params, const TriangleMeshView& mesh, const Intrinsics& camera,
                               const ViewPose& pose, const RasterizedView& out, Workspace& workspace,
                               Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(camera));
  NPSIM_RETURN_IF_ERROR(validate(pose));
  if (!(std::fabs(camera.cx) <= 65536.0F && std::fabs(camera.cy) <= 65536.0F && camera.fx <= 1e9F &&
        camera.fy <= 1e9F)) {
    return {StatusCode::invalid_argument, "rasterize: principal point beyond 65536 px or focal length beyond 1e9 px"};
  }
  return rasterize(rasterize_detail::projection_of(camera, pose, params.near_m), mesh, out, workspace, executor);
}

template <class Executor>
[[nodiscard]] Status preview(const PreviewParams& params, const TriangleMeshView& mesh, const PreviewColours& colours,
                             const Intrinsics& camera, const ViewPose& pose, ImageView<Rgb8> picture,
                             Workspace& workspace, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(colours, mesh.vertices.size()));
  if (picture.empty()) return {StatusCode::invalid_argument, "preview: the picture is empty"};
  const Shape shape = picture.shape();
  const WorkspaceScope scope(workspace);
  ImageView<std::uint32_t> face;
  ImageView<float> inverse_depth;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, face));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, inverse_depth));
  const RasterizedView seen{face, inverse_depth};
  NPSIM_RETURN_IF_ERROR(rasterize(params.rasterize, mesh, camera, pose, seen, workspace, executor));
  const rasterize_detail::Projection view = rasterize_detail::projection_of(camera, pose, params.rasterize.near_m);
  const preview_detail::Shader shade{params, mesh, colours, view};
  executor.for_chunks(static_cast<std::size_t>(shape.height), 8, [&](std::size_t begin, std::size_t end) {
    for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) picture(x, y) = shade(face(x, y), x, y);
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_PREVIEW_HPP
