// SPDX-License-Identifier: Apache-2.0
// Surface normals from z-depth, equation (3.4), with the full perspective tangents or with the thesis' own.
//
// perspective: with w = 1/z and (a, b) = (u - cx, v - cy) the normal that faces the camera is
//     n = -(fx w_u, fy w_v, w - a w_u - b w_v) / |.|,
//   which is (-fx z_u, -fy z_v, z + a z_u + b z_v) up to scale and sign. Inverse depth of a plane is linear in the
//   image, so taking the differences in w makes the discrete normal exact on planes: it is the normal of the triangle
//   through the pixel and its two neighbours. Invariant: n . ray < 0 for every depth.
// thesis: n = (fx z_u / z, fy z_v / z, -1) / |.|, equations (3.4) and (3.5) with the printed sign turned towards the
//   camera. It takes du/dx = fx/d, which holds d constant, and is biased away from the image centre. n.z < 0 always,
//   n . ray < 0 only on surfaces that are not steep.
// Differences are forward; backward in the last column and row and where the forward neighbour is missing. A pixel
// whose depth is missing, or that has no neighbour along a row or along a column, gets the zero vector ("no normal").
//
// Cost: one pass, O(pixels). Memory: none. Error: evaluated in double; each component within 1e-7 of the exact value.
#ifndef NPSIM_DEPTH_NORMALS_HPP
#define NPSIM_DEPTH_NORMALS_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {

// How the tangents of the depth map are formed; shared by normals_from_depth and by the losses.
enum class TangentForm : std::uint8_t {
  perspective,  // the pinhole camera's, exact on planes: the default
  thesis,       // (1, 0, dz/dx) and (0, 1, dz/dy) as printed in (3.4)
};

struct NormalsParams {
  TangentForm tangents = TangentForm::perspective;
};

[[nodiscard]] constexpr std::size_t normals_workspace_bytes(const NormalsParams&, Shape) noexcept { return 0; }

inline namespace NPSIM_ISA_NAMESPACE {
namespace depth_detail {

// Normal that faces the camera, from inverse depth and its derivatives per pixel at image coordinates (u, v).
[[nodiscard]] inline Vec3d perspective_normal(const Intrinsics& k, double u, double v, double w, double w_u,
                                              double w_v) noexcept {
  const double a = u - static_cast<double>(k.cx);
  const double b = v - static_cast<double>(k.cy);
  return normalized(Vec3d{-static_cast<double>(k.fx) * w_u, -static_cast<double>(k.fy) * w_v, a * w_u + b * w_v - w});
}

// Derivative of z (thesis) or 1/z (perspective) between a pixel and the neighbour one pixel further (step = 1) or one
// pixel back (step = -1).
[[nodiscard]] inline double pixel_derivative(TangentForm form, float here, float there, double step) noexcept {
  const double z = static_cast<double>(here);
  const double z_there = static_cast<double>(there);
  return form == TangentForm::thesis ? (z_there - z) * step : (1.0 / z_there - 1.0 / z) * step;
}

// Along one axis: forward difference, else backward, else false. `next`/`previous` are null outside the image.
[[nodiscard]] inline bool one_sided_derivative(TangentForm form, float here, const float* next, const float* previous,
                                               double& derivative) noexcept {
  if (next != nullptr && is_valid_depth(*next)) {
    derivative = pixel_derivative(form, here, *next, 1.0);
    return true;
  }
  if (previous != nullptr && is_valid_depth(*previous)) {
    derivative = pixel_derivative(form, here, *previous, -1.0);
    return true;
  }
  return false;
}

}  // namespace depth_detail

// depth: z-depth in metres. normals: same shape, camera frame. They may not share memory.
template <class Executor>
[[nodiscard]] Status normals_from_depth(const NormalsParams& params, ImageView<const float> depth,
                                        const Intrinsics& intrinsics, ImageView<Vec3f> normals, Workspace&,
                                        Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(intrinsics));
  if (depth.empty()) return {StatusCode::no_valid_input, "normals_from_depth: the depth image is empty"};
  if (normals.empty() || normals.shape() != depth.shape()) {
    return {StatusCode::shape_mismatch, "normals_from_depth: normals and depth differ in shape"};
  }
  if (params.tangents != TangentForm::perspective && params.tangents != TangentForm::thesis) {
    return {StatusCode::invalid_argument, "normals_from_depth: unknown form of tangents"};
  }
  const int width = depth.width();
  const int height = depth.height();
  executor.for_chunks(static_cast<std::size_t>(height), 16, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      const float* row = depth.row(y);
      const float* below = y + 1 < height ? depth.row(y + 1) : nullptr;
      const float* above = y > 0 ? depth.row(y - 1) : nullptr;
      for (int x = 0; x < width; ++x) {
        Vec3f& out = normals(x, y);
        out = {};
        if (!is_valid_depth(row[x])) continue;
        double along_u = 0;
        double along_v = 0;
        if (!depth_detail::one_sided_derivative(params.tangents, row[x], x + 1 < width ? row + x + 1 : nullptr,
                                                x > 0 ? row + x - 1 : nullptr, along_u) ||
            !depth_detail::one_sided_derivative(params.tangents, row[x], below == nullptr ? nullptr : below + x,
                                                above == nullptr ? nullptr : above + x, along_v)) {
          continue;
        }
        const double z = static_cast<double>(row[x]);
        if (params.tangents == TangentForm::perspective) {
          out = vec_cast<float>(
              depth_detail::perspective_normal(intrinsics, x + 0.5, y + 0.5, 1.0 / z, along_u, along_v));
        } else {
          const double fx = static_cast<double>(intrinsics.fx);
          const double fy = static_cast<double>(intrinsics.fy);
          out = vec_cast<float>(normalized(Vec3d{fx * along_u / z, fy * along_v / z, -1.0}));
        }
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_DEPTH_NORMALS_HPP
