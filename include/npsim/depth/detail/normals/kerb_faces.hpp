// SPDX-License-Identifier: Apache-2.0
// Kerbs: where ground ends in a step and what is seen below it is laid flat, the step has no face.
//
// Depth of the ground, measured or laid flat, knows two levels and nothing between them. The pixels that show a kerb's
// face then get the depth of one level. With the lower one they lie under the edge of the upper, where no lamp reaches,
// with the upper one the edge hangs over the road: a black line along every kerb. Labels tell which: pavements and
// grass include their kerb (Cityscapes' rule), so the face is among their pixels and its foot at their border; where
// both levels have one label it is among the lower pixels, and its top at the step.
//   line: pixels of ground with ground of the other level (min_step_m to max_step_m) beside them, the lower ones at a
//         border of labels, else the upper ones; its direction from the line's points around, by their principal axis
//         in plan, where they are a line. Of an estimate, and of guessed labels, steps at borders of labels alone
//         (only_at_borders)
//   face: a pixel of the other ground near the line, whose ray meets the upright plane through the line between the
//         two levels, gets that depth and the plane's normal: farther than before at a border of labels, else nearer
// A step that looks away from the camera has no such pixel: rays over its edge meet the plane above it.
// Invariant: depth changes on ground labels alone, and by no more than a step's height allows. Ground without steps
// stays as it is, bit by bit.
// Cost: two passes over the image, and per pixel of a line at most 4/3 of 97 x 97 samples of it and 4 reach^2 of its
// face. Memory: 21 bytes a pixel.
#ifndef NPSIM_DEPTH_DETAIL_NORMALS_KERB_FACES_HPP
#define NPSIM_DEPTH_DETAIL_NORMALS_KERB_FACES_HPP

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
  LabelSet with_kerb = LabelSet::of(label::sidewalk, label::terrain);  // whose pixels include the face
  bool only_at_borders = false;  // false: also of steps within one label, and from other ground down to `with_kerb`
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
  return 2 * allocation_bytes<float>(shape.pixels()) + allocation_bytes<Vec3f>(shape.pixels()) +
         allocation_bytes<std::uint8_t>(shape.pixels()) + kWorkspaceAlignment;
}

namespace depth_detail {

struct KerbPixel {
  int x, y;
};

// Which end of a face the two levels show: its top edge, or its foot.
enum class KerbLine : std::uint8_t { top, foot };

// The ground's points and heights, as the depth was before.
struct KerbScene {
  const KerbFaceParams& params;
  const Intrinsics& camera;
  const GroundPlane& ground;
  ImageView<const Label> labels;
  ImageView<const float> depth;
  ImageView<float> height;          // m above the ground plane; NAN off the ground
  ImageView<std::uint8_t> on_line;  // of either kind, a bit each
  // Directions in plan.
  Vec3f across = normalized(cross(ground.up, Vec3f{0.0F, 0.0F, 1.0F}));
  Vec3f ahead = cross(across, ground.up);

  [[nodiscard]] bool is_on(KerbLine line, int x, int y) const noexcept {
    return ((on_line(x, y) >> static_cast<int>(line)) & 1) != 0;
  }
  [[nodiscard]] Vec3f point(int x, int y) const noexcept { return unproject_pixel(camera, x, y, depth(x, y)); }
  // Whether the pixel `upper` stands a step above `lower`, and the face is among the pixels of the ground that `line`
  // does not lie in. NAN compares false with everything.
  [[nodiscard]] bool is_step(KerbLine line, KerbPixel upper, KerbPixel lower) const noexcept {
    const float rise = height(upper.x, upper.y) - height(lower.x, lower.y);
    if (!(rise >= params.min_step_m && rise <= params.max_step_m)) return false;
    const Label above = labels(upper.x, upper.y);
    const Label below = labels(lower.x, lower.y);
    const bool in_upper = params.with_kerb.contains(above) && above != below;
    if (params.only_at_borders && (above == below || (params.with_kerb.contains(below) && !in_upper))) return false;
    return in_upper == (line == KerbLine::foot);
  }
  // Of a pixel p of the line and one of the other ground.
  [[nodiscard]] bool is_step_from(KerbLine line, KerbPixel p, KerbPixel other) const noexcept {
    return line == KerbLine::foot ? is_step(line, other, p) : is_step(line, p, other);
  }
  // The highest step from a pixel of the line to a neighbour; 0: it is none. Where the lower ground is seen above the
  // upper one the step looks away.
  [[nodiscard]] float step(KerbLine line, int x, int y) const noexcept {
    const float here = height(x, y);
    float most = 0.0F;
    const auto try_neighbour = [&](int i, int j) {
      if (!height.contains(i, j) || !is_step_from(line, {x, y}, {i, j})) return;
      most = max_of(most, std::fabs(here - height(i, j)));
    };
    try_neighbour(x - 1, y);
    try_neighbour(x + 1, y);
    try_neighbour(x, line == KerbLine::foot ? y - 1 : y + 1);
    return most;
  }
};

// An upright plane: dot(normal, X) = distance, the normal horizontal and towards the camera.
struct KerbPlane {
  Vec3f normal;
  float distance = 0.0F;
};

// That through the line about (x, y), by its points at this height within `reach` pixels. Steps of a row or a column,
// which outlines have, are evened out: a foot may lie before the plane, a top behind it. False where the points are no
// line, or where the upper ground lies on the camera's side: such a step looks away.
[[nodiscard]] inline bool fit_face(const KerbScene& s, KerbLine line, int x, int y, int reach,
                                   KerbPlane& plane) noexcept {
  constexpr double kLine = 0.03;  // squared ratio of a line's width to its length, at most
  constexpr int kBeside_px = 6;   // within which the line's ground is looked for
  const Vec3f centre = s.point(x, y);
  double n = 0, a = 0, b = 0, aa = 0, ab = 0, bb = 0;
  Vec3f same;  // sum of the offsets of the points of the line's ground
  for (int j = y - reach; j <= y + reach; ++j) {
    for (int i = x - reach; i <= x + reach; ++i) {
      if (!s.height.contains(i, j)) continue;
      const bool on_line = s.is_on(line, i, j);
      const bool beside =
          clamp_to(i, x - kBeside_px, x + kBeside_px) == i && clamp_to(j, y - kBeside_px, y + kBeside_px) == j;
      if (!on_line && !beside) continue;
      const float rise = std::fabs(s.height(i, j) - s.height(x, y));
      if (!(rise < s.params.min_step_m)) continue;  // a NaN is another surface too
      const Vec3f d = s.point(i, j) - centre;
      if (beside) same += d;
      if (!on_line) continue;
      const double u = static_cast<double>(dot(d, s.across));
      const double v = static_cast<double>(dot(d, s.ahead));
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
  // Rows of the image sample the ground this far apart, and no line is known better.
  const double row_m = static_cast<double>(centre.z * centre.z / (s.camera.fy * s.ground.camera_height_m));
  if (!(uu + vv - spread < kLine * (uu + vv + spread) + n * row_m * row_m / 6)) return false;
  const double angle = 0.5 * std::atan2(2 * uv, uu - vv);
  plane.normal = s.ahead * static_cast<float>(std::cos(angle)) - s.across * static_cast<float>(std::sin(angle));
  if (dot(plane.normal, centre) > 0.0F) plane.normal = -plane.normal;
  const float away = dot(plane.normal, s.across * static_cast<float>(a / n) + s.ahead * static_cast<float>(b / n));
  const bool foot = line == KerbLine::foot;
  plane.distance = dot(plane.normal, centre) + (foot ? std::fmin(away, 0.0F) : std::fmax(away, 0.0F));
  return foot ? dot(plane.normal, same) > 0.0F : dot(plane.normal, same) < 0.0F;
}

// The same by as long a stretch of the line as is straight.
[[nodiscard]] inline bool find_face(const KerbScene& s, KerbLine line, int x, int y, KerbPlane& plane) noexcept {
  constexpr float kStretch_m = 2.0F;  // to either side
  const float z = s.depth(x, y);
  for (int reach = static_cast<int>(clamp_to(kStretch_m * s.camera.fx / z, 6.0F, 48.0F)); reach >= 6; reach /= 2) {
    if (fit_face(s, line, x, y, reach, plane)) return true;
  }
  return false;
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
  KerbScene s{params, camera, ground, labels, depth, {}, {}};
  ImageView<float> off;   // squared distance in pixels to the point of a line that a face was found for
  ImageView<Vec3f> face;  // depth in z, and the normal's plan components
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, s.height));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, s.on_line));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, off));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, face));
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const bool known = params.labels.contains(labels(x, y)) && is_valid_depth(depth(x, y));
      s.height(x, y) = known ? dot(ground.up, s.point(x, y)) + ground.camera_height_m : NAN;
      off(x, y) = INFINITY;
    }
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const int top = s.step(KerbLine::top, x, y) > 0.0F ? 1 : 0;
      const int foot = s.step(KerbLine::foot, x, y) > 0.0F ? 1 : 0;
      s.on_line(x, y) = static_cast<std::uint8_t>((top << static_cast<int>(KerbLine::top)) |
                                                  (foot << static_cast<int>(KerbLine::foot)));
    }
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      for (const KerbLine line : {KerbLine::top, KerbLine::foot}) {
        KerbPlane plane;
        if (!s.is_on(line, x, y) || !find_face(s, line, x, y, plane)) continue;
        const float step = s.step(line, x, y);
        const Vec3f at = s.point(x, y);
        // A face is no larger than the step looks from the side; half as much again for a leaning camera.
        const auto reach = static_cast<int>(
            clamp_to(1.5F * step * camera.fy / at.z + 2.0F, 3.0F, static_cast<float>(max_of(params.most_px, 3))));
        for (int j = y - reach; j <= y + reach; ++j) {
          for (int i = x - reach; i <= x + reach; ++i) {
            if (!s.height.contains(i, j) || !s.is_step_from(line, {x, y}, {i, j})) continue;
            const auto squared = static_cast<float>((i - x) * (i - x) + (j - y) * (j - y));
            if (!(squared < off(i, j))) continue;
            const Vec3f ray = unproject_pixel(camera, i, j, 1.0F);
            const float z = plane.distance / dot(plane.normal, ray);
            if (!(z > 0.0F && (line == KerbLine::foot ? z > depth(i, j) : z < depth(i, j)))) continue;
            const float up = dot(ground.up, ray) * z + ground.camera_height_m;
            // Between the two levels: nearer to either than they are to each other.
            const float rise = std::fabs(s.height(x, y) - s.height(i, j));
            const bool between = std::fabs(up - s.height(x, y)) < rise && std::fabs(up - s.height(i, j)) < rise;
            if (!between || length(ray * z - at) > 3.0F * step) continue;
            off(i, j) = squared;
            face(i, j) = {dot(plane.normal, s.across), dot(plane.normal, s.ahead), z};
          }
        }
      }
    }
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (!std::isfinite(off(x, y))) continue;
      depth(x, y) = face(x, y).z;
      if (!normals.empty()) normals(x, y) = s.across * face(x, y).x + s.ahead * face(x, y).y;
    }
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_NORMALS_KERB_FACES_HPP
