// SPDX-License-Identifier: Apache-2.0
// Kerbs: where ground ends in a step and what is seen below it is laid flat, the step has no face.
//
// Depth of the ground, measured or laid flat, knows two levels and nothing between them. The pixels that show a kerb's
// face then get the depth of the lower level, which puts them under the edge of the upper one, where no lamp reaches:
// a black line along every kerb. What the camera sees there can only be the face. It stands upright below the edge:
//   edge: pixels of ground with lower ground (min_step_m to max_step_m) beside them; its direction from the edge's
//         points around, by their principal axis in plan, where they are a line
//   face: a pixel of lower ground near an edge, whose ray meets the upright plane through the edge before it meets the
//         lower ground, and does so below the edge, gets that depth and the plane's normal
// A step that looks away from the camera has no such pixel: rays over its edge meet the plane above it.
// Invariant: depth only gets nearer, on ground labels alone, and by no more than a step's height allows. Ground without
// steps stays as it is, bit by bit.
// Cost: a pass over the image, and (2 reach + 1)^2 per edge pixel. Memory: a number and an index a pixel.
#ifndef NPSIM_DEPTH_KERB_FACES_HPP
#define NPSIM_DEPTH_KERB_FACES_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct KerbFaceParams {
  bool enabled = true;
  LabelSet labels = kGroundLabels;
  float min_step_m = 0.03F;
  float max_step_m = 0.4F;
  int most_px = 256;  // of a face's extent, 1..1024; nearer than where a kerb is this large it is cut
};

[[nodiscard]] inline Status validate(const KerbFaceParams& p) noexcept {
  const bool good = p.min_step_m > 0.0F && p.max_step_m > p.min_step_m && std::isfinite(p.max_step_m) &&
                    p.most_px >= 1 && p.most_px <= 1024;
  return good ? Status() : Status(StatusCode::invalid_argument, "kerb_faces: a parameter lies outside its range");
}

[[nodiscard]] constexpr std::size_t kerb_faces_workspace_bytes(Shape shape) noexcept {
  return 2 * allocation_bytes<float>(shape.pixels()) + allocation_bytes<Vec3f>(shape.pixels()) + kWorkspaceAlignment;
}

namespace depth_detail {

// The ground's points and heights, as the depth was before.
struct KerbScene {
  const KerbFaceParams& params;
  const Intrinsics& camera;
  const GroundPlane& ground;
  ImageView<const Label> labels;
  ImageView<const float> depth;
  ImageView<float> height;  // m above the ground plane; NAN off the ground

  [[nodiscard]] Vec3f point(int x, int y) const noexcept { return unproject_pixel(camera, x, y, depth(x, y)); }
  // NAN compares false with everything.
  [[nodiscard]] bool is_step(float upper, float lower) const noexcept {
    return upper - lower >= params.min_step_m && upper - lower <= params.max_step_m;
  }
  // The highest step down to a neighbour; 0: none.
  [[nodiscard]] float step(int x, int y) const noexcept {
    const float here = height(x, y);
    float most = 0.0F;
    const auto try_neighbour = [&](int i, int j) {
      if (height.contains(i, j) && is_step(here, height(i, j))) most = max_of(most, here - height(i, j));
    };
    try_neighbour(x - 1, y);
    try_neighbour(x + 1, y);
    try_neighbour(x, y - 1);
    try_neighbour(x, y + 1);
    return most;
  }
};

// The upright plane through the edge at (x, y): its normal, horizontal and towards the camera, from the edge's points
// within `reach` pixels. False where they are no line, or where the upper ground lies on the camera's side: such a step
// looks away.
[[nodiscard]] inline bool edge_plane(const KerbScene& s, int x, int y, int reach, Vec3f& normal) noexcept {
  constexpr double kLine = 0.03;  // squared ratio of a line's width to its length, at most
  const Vec3f across = normalized(cross(s.ground.up, Vec3f{0.0F, 0.0F, 1.0F}));
  const Vec3f ahead = cross(across, s.ground.up);
  const Vec3f centre = s.point(x, y);
  double n = 0, a = 0, b = 0, aa = 0, ab = 0, bb = 0;
  Vec3f upper;  // sum of the offsets of the upper ground's points
  for (int j = y - reach; j <= y + reach; ++j) {
    for (int i = x - reach; i <= x + reach; ++i) {
      if (!s.height.contains(i, j)) continue;
      const float rise = std::fabs(s.height(i, j) - s.height(x, y));
      if (!(rise < s.params.min_step_m)) continue;  // a NaN is another surface too
      const Vec3f d = s.point(i, j) - centre;
      upper += d;
      if (!(s.step(i, j) > 0.0F)) continue;
      const double u = static_cast<double>(dot(d, across));
      const double v = static_cast<double>(dot(d, ahead));
      n += 1;
      a += u;
      b += v;
      aa += u * u;
      ab += u * v;
      bb += v * v;
    }
  }
  if (n < 3) return false;
  const double uu = aa - a * a / n;
  const double uv = ab - a * b / n;
  const double vv = bb - b * b / n;
  const double spread = std::sqrt((uu - vv) * (uu - vv) + 4 * uv * uv);
  if (!(uu + vv - spread < kLine * (uu + vv + spread))) return false;
  const double angle = 0.5 * std::atan2(2 * uv, uu - vv);
  normal = ahead * static_cast<float>(std::cos(angle)) - across * static_cast<float>(std::sin(angle));
  if (dot(normal, centre) > 0.0F) normal = -normal;
  return dot(normal, upper) < 0.0F;
}

}  // namespace depth_detail

// depth, normals (empty, or unit and towards the camera): in place. ground: of the depth; inlier_share 0: nothing is
// done. labels empty: nothing is done.
[[nodiscard]] inline Status kerb_faces(const KerbFaceParams& params, const Intrinsics& camera,
                                       const GroundPlane& ground, ImageView<const Label> labels, ImageView<float> depth,
                                       ImageView<Vec3f> normals, Workspace& workspace) noexcept {
  using namespace depth_detail;
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = depth.shape();
  if ((!labels.empty() && labels.shape() != shape) || (!normals.empty() && normals.shape() != shape)) {
    return {StatusCode::shape_mismatch, "kerb_faces: depth, labels and normals must have one shape"};
  }
  if (!params.enabled || labels.empty() || !(ground.inlier_share > 0.0F)) return {};
  const WorkspaceScope scope(workspace);
  KerbScene s{params, camera, ground, labels, depth, {}};
  ImageView<float> off;   // squared distance in pixels to the edge that a face was found for
  ImageView<Vec3f> face;  // depth in z, and the normal's plan components
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, s.height));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, off));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, face));
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const bool known = params.labels.contains(labels(x, y)) && is_valid_depth(depth(x, y));
      s.height(x, y) = known ? dot(ground.up, s.point(x, y)) + ground.camera_height_m : NAN;
      off(x, y) = INFINITY;
    }
  }
  const Vec3f across = normalized(cross(ground.up, Vec3f{0.0F, 0.0F, 1.0F}));
  const Vec3f ahead = cross(across, ground.up);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const float step = s.step(x, y);
      if (!(step > 0.0F)) continue;
      const Vec3f edge = s.point(x, y);
      // A face is no larger than the step looks from the side; half as much again for a leaning camera.
      const int reach = clamp_to(static_cast<int>(1.5F * step * camera.fy / edge.z) + 2, 3, params.most_px);
      Vec3f normal;
      if (!edge_plane(s, x, y, reach < 12 ? reach : 12, normal)) continue;
      const float distance = dot(normal, edge);
      for (int j = y - reach; j <= y + reach; ++j) {
        for (int i = x - reach; i <= x + reach; ++i) {
          if (!s.height.contains(i, j) || !s.is_step(s.height(x, y), s.height(i, j))) continue;
          const auto squared = static_cast<float>((i - x) * (i - x) + (j - y) * (j - y));
          if (!(squared < off(i, j))) continue;
          const Vec3f ray = unproject_pixel(camera, i, j, 1.0F);
          const float z = distance / dot(normal, ray);
          if (!(z > 0.0F && z < depth(i, j))) continue;
          const float up = dot(ground.up, ray) * z + ground.camera_height_m;
          if (!(up > s.height(i, j) && up < s.height(x, y)) || length(ray * z - edge) > 3.0F * step) continue;
          off(i, j) = squared;
          face(i, j) = {dot(normal, across), dot(normal, ahead), z};
        }
      }
    }
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (!std::isfinite(off(x, y))) continue;
      depth(x, y) = face(x, y).z;
      if (!normals.empty()) normals(x, y) = across * face(x, y).x + ahead * face(x, y).y;
    }
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_KERB_FACES_HPP
