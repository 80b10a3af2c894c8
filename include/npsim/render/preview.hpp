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
// Invariant: the same bits for every executor. Cost: rasterize(), and about 60 multiplications a pixel. Memory: 8 bytes
// a pixel and rasterize()'s. Error: each channel within one of 255 of the exact colour, more than 1/256 pixel from
// edges.
#ifndef NPSIM_RENDER_PREVIEW_HPP
#define NPSIM_RENDER_PREVIEW_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/render/detail/rasterize.hpp"
#include "npsim/render/view_pose.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

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

[[nodiscard]] constexpr std::size_t preview_workspace_bytes(const PreviewParams& params, Shape shape,
                                                            std::size_t vertices, std::size_t faces) noexcept {
  return allocation_bytes<std::uint32_t>(shape.pixels()) + allocation_bytes<float>(shape.pixels()) +
         rasterize_workspace_bytes(params.rasterize, vertices, faces);
}

[[nodiscard]] inline Status validate(const PreviewParams& p) noexcept {
  const auto is_share = [](float v) { return v >= 0.0F && v <= 1.0F; };
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

namespace preview_detail {

[[nodiscard]] inline Vec3d to_vec(Rgb8 c) noexcept {
  return {static_cast<double>(c.r), static_cast<double>(c.g), static_cast<double>(c.b)};
}
[[nodiscard]] inline Rgb8 to_rgb(const Vec3d& v) noexcept {
  const auto byte = [](double x) { return static_cast<std::uint8_t>(std::clamp(x, 0.0, 255.0) + 0.5); };
  return {byte(v.x), byte(v.y), byte(v.z)};
}

// Between four texels; x and y are whole numbers at their centres.
[[nodiscard]] inline Vec3d bilinear(ImageView<const Rgb8> texture, double x, double y) noexcept {
  const auto column = static_cast<int>(std::clamp(x, 0.0, static_cast<double>(texture.width() - 1)));
  const auto row = static_cast<int>(std::clamp(y, 0.0, static_cast<double>(texture.height() - 1)));
  const int next_column = std::min(column + 1, texture.width() - 1);
  const int next_row = std::min(row + 1, texture.height() - 1);
  const double fx = std::clamp(x - column, 0.0, 1.0);
  const double fy = std::clamp(y - row, 0.0, 1.0);
  const Vec3d upper = to_vec(texture(column, row)) * (1 - fx) + to_vec(texture(next_column, row)) * fx;
  const Vec3d lower = to_vec(texture(column, next_row)) * (1 - fx) + to_vec(texture(next_column, next_row)) * fx;
  return upper * (1 - fy) + lower * fy;
}

struct Shader {
  const PreviewParams& params;
  const TriangleMeshView& mesh;
  const PreviewColours& colours;
  Vec3d right, down, forward, eye;
  double fx, fy, cx, cy;

  Shader(const PreviewParams& p, const TriangleMeshView& m, const PreviewColours& c, const Intrinsics& k,
         const ViewPose& pose) noexcept
      : params(p),
        mesh(m),
        colours(c),
        right(vec_cast<double>(pose.right)),
        down(vec_cast<double>(pose.down)),
        forward(vec_cast<double>(pose.forward)),
        eye(vec_cast<double>(pose.eye_m)),
        fx(static_cast<double>(k.fx)),
        fy(static_cast<double>(k.fy)),
        cx(static_cast<double>(k.cx)),
        cy(static_cast<double>(k.cy)) {}

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
    const Vec3d a = vec_cast<double>(mesh.vertices[f.a]) - eye;
    const Vec3d b = vec_cast<double>(mesh.vertices[f.b]) - eye;
    const Vec3d c = vec_cast<double>(mesh.vertices[f.c]) - eye;
    const Vec3d step_x = right * (1.0 / fx);
    const Vec3d step_y = down * (1.0 / fy);
    const Vec3d d = forward + step_x * (x + 0.5 - cx) + step_y * (y + 0.5 - cy);
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
  NPSIM_RETURN_IF_ERROR(
      rasterize(params.rasterize, mesh, camera, pose, RasterizedView{face, inverse_depth}, workspace, executor));
  const preview_detail::Shader shade(params, mesh, colours, camera, pose);
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
