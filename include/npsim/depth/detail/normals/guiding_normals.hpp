// SPDX-License-Identifier: Apache-2.0
// The normals that guide the refinement and shade the surface: given ones, else those of planes where the depth has
// them (detail/planes/planar_segments.hpp), else those fitted to the depth (fitted_normals.hpp); smoothed within
// surfaces, and set upright on the ground.
//
// Where a given normal is missing one fitted to the depth stands in.
// smooth_normals is the edge-avoiding a-trous filter (Dammertz et al., HPG 2010): iteration i takes 5 x 5 taps 2^i
// pixels apart with B3-spline weights. A tap counts when it has the centre's label, and the less the more its depth
// differs, relative to the depth, and the more its normal does. So the noise of predicted normals, up to 8 degrees, is
// averaged away, and edges, which turn farther, stay; an edge of less than 8 degrees is rounded, by up to a degree, and
// noise of more stays, as does that of normals that are derived from noisy depth. The sum is normalised.
// Invariant: unit length, or zero where there is no surface. Of the smoothing: equal normals stay equal; nothing
// crosses a label border; a pixel without a normal gets none and gives none.
// Cost: 25 taps per pixel and iteration of smoothing. Memory: an image for the smoothing, another for the ground.
// Error: of the smoothing 1e-5 from the same formulas in double precision.
#ifndef NPSIM_DEPTH_DETAIL_NORMALS_GUIDING_NORMALS_HPP
#define NPSIM_DEPTH_DETAIL_NORMALS_GUIDING_NORMALS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/detail/normals/fitted_normals.hpp"
#include "npsim/depth/detail/object_borders.hpp"
#include "npsim/depth/detail/planes/planar_segments.hpp"
#include "npsim/depth/normals.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct SmoothNormalsParams {
  int iterations = 3;         // footprint 29 px; 0 switches it off; at most 8
  float depth_sigma = 0.05F;  // relative depth difference at which a tap counts half
  float normal_sigma =
      std::numeric_limits<float>::infinity();  // distance of unit normals at which a tap counts a quarter
};

[[nodiscard]] inline Status validate(const SmoothNormalsParams& params) noexcept {
  if (params.iterations < 0 || params.iterations > 8 || !(params.depth_sigma > 0.0F) || !(params.normal_sigma > 0.0F)) {
    return {StatusCode::invalid_argument, "smooth_normals: iterations in 0..8, depth_sigma and normal_sigma positive"};
  }
  return {};
}

[[nodiscard]] constexpr std::size_t smooth_normals_workspace_bytes(const SmoothNormalsParams&, Shape shape) noexcept {
  return kWorkspaceAlignment + allocation_bytes<Vec3f>(shape.pixels());
}

namespace depth_detail {

// |a - b|^2 of unit vectors.
[[nodiscard]] inline float squared_chord(const Vec3f& a, const Vec3f& b) noexcept {
  return std::max(0.0F, 2.0F - 2.0F * dot(a, b));
}

// What smooth_normals reads in one iteration.
struct SmoothedView {
  ImageView<const float> depth;
  ImageView<const Label> labels;
  ImageView<const Vec3f> normals;

  template <class F>
  struct Pixels {
    F z;
    simd::F32x3<F> normal;
    typename F::Int label;
    typename F::MaskType known;  // have depth and a normal
  };

  // F::lanes pixels side by side, the first of them (x, y).
  template <class F>
  [[nodiscard]] NPSIM_ALWAYS_INLINE Pixels<F> at(int x, int y) const noexcept {
    Pixels<F> p;
    p.z = F::load(&depth(x, y));
    p.normal = simd::load3<F>(&normals(x, y).x);
    p.label = labels.empty() ? typename F::Int(0) : F::Int::load_u8(&labels(x, y));
    const F square = fma(p.normal.x, p.normal.x, fma(p.normal.y, p.normal.y, p.normal.z * p.normal.z));
    p.known = (p.z > F(0.0F)) & simd::is_finite(p.z) & (square > F(0.0F));
    return p;
  }
};

// The smoothed normals of F::lanes pixels; taps that lie in the picture do so for all of them.
template <class F>
void smoothed_normals(const SmoothNormalsParams& params, const SmoothedView& view, int x, int y, int step,
                      Vec3f* out) noexcept {
  constexpr float kSpline[5] = {1.0F / 16, 4.0F / 16, 6.0F / 16, 4.0F / 16, 1.0F / 16};
  const auto own = view.at<F>(x, y);
  const F scale = F(1.0F / params.depth_sigma) / own.z;
  const F turn_scale(1.0F / (params.normal_sigma * params.normal_sigma));
  simd::F32x3<F> sum{F(0.0F), F(0.0F), F(0.0F)};
  for (int j = -2; j <= 2; ++j) {
    const int v = y + j * step;
    if (v < 0 || v >= view.depth.height()) continue;
    for (int i = -2; i <= 2; ++i) {
      const int u = x + i * step;
      if (u < 0 || u >= view.depth.width()) continue;
      const auto tap = view.at<F>(u, v);
      const F off = (tap.z - own.z) * scale;
      const F cosine = fma(tap.normal.x, own.normal.x, fma(tap.normal.y, own.normal.y, tap.normal.z * own.normal.z));
      const F turn = fma(max(F(2.0F) - F(2.0F) * cosine, F(0.0F)), turn_scale, F(1.0F));  // of the chord, squared
      const F share = F(kSpline[i + 2] * kSpline[j + 2]) / (fma(off, off, F(1.0F)) * turn * turn);
      const F k = select(tap.known & (tap.label == own.label), share, F(0.0F));
      sum.x = fma(k, tap.normal.x, sum.x);
      sum.y = fma(k, tap.normal.y, sum.y);
      sum.z = fma(k, tap.normal.z, sum.z);
    }
  }
  const F length = sqrt(fma(sum.x, sum.x, fma(sum.y, sum.y, sum.z * sum.z)));
  const auto changed = own.known & (length > F(0.0F));
  const F inverse = F(1.0F) / select(changed, length, F(1.0F));
  const auto component = [&](const F& total, const F& before) { return select(changed, total * inverse, before); };
  simd::store3<F>(&out->x,
                  {component(sum.x, own.normal.x), component(sum.y, own.normal.y), component(sum.z, own.normal.z)});
}

}  // namespace depth_detail

// Filters `normals` (unit, or zero for none) in place. labels may be empty.
template <class Executor>
[[nodiscard]] Status smooth_normals(const SmoothNormalsParams& params, ImageView<const float> depth,
                                    ImageView<const Label> labels, ImageView<Vec3f> normals, Workspace& workspace,
                                    Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = normals.shape();
  if (depth.shape() != shape || (!labels.empty() && labels.shape() != shape)) {
    return {StatusCode::shape_mismatch, "smooth_normals: depth, labels and normals must have one shape"};
  }
  const WorkspaceScope scope(workspace);
  ImageView<Vec3f> other;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, other));
  for (int i = 0; i < params.iterations; ++i) {
    const auto rows = static_cast<std::size_t>(shape.height);
    const int step = 1 << i;
    const depth_detail::SmoothedView view{depth, labels, normals};
    executor.for_chunks(rows, 8, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
        int x = 0;
        const auto up_to = [&](int last) {
          for (; x < last; ++x) {
            depth_detail::smoothed_normals<simd::scalar::F32>(params, view, x, y, step, &other(x, y));
          }
        };
        up_to(std::min(2 * step, shape.width));
        for (; x + simd::F32::lanes + 2 * step <= shape.width; x += simd::F32::lanes) {
          depth_detail::smoothed_normals<simd::F32>(params, view, x, y, step, &other(x, y));
        }
        up_to(shape.width);
      }
    });
    executor.for_chunks(rows, 64, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
        for (int x = 0; x < shape.width; ++x) normals(x, y) = other(x, y);
      }
    });
  }
  return {};
}

// Predicted normals are worst on roads, which are the plainest surface there is. On these labels they are smoothed far
// more than elsewhere, and what they still lean away from the ground plane's (robustly fitted to depth) is taken back:
// a lean of x < min_rad to x (1 - x / min_rad), larger ones wholly, but none above max_rad, which is a kerb's face. So
// a quarter of min_rad is left at most: by headlamps, whose light comes in at .06 rad ten metres ahead, a lean of .02
// rad is a third more or less light, and the rim of a patch where the prediction leans shows as a ring.
// keep_steep: whether the faces of kerbs stay as they are. Where nothing can have seen them they are noise.
struct GroundNormalsParams {
  bool enabled = true;
  LabelSet labels = LabelSet::of(label::road, label::sidewalk, label::parking, label::ground);
  LabelSet kerbs = LabelSet::of(label::sidewalk, label::ground);
  SmoothNormalsParams smoothing{5};
  float min_rad = 0.02F;
  float max_rad = 0.90F;
  bool keep_steep = true;
};

struct GuidingNormalsParams {
  NormalsParams form;
  bool fit = true;  // normals that come from depth; false: differences between neighbours
  FittedNormalsParams fitted;
  SmoothNormalsParams fitted_smoothing{3};              // of fitted ones, whose samples lie pixels apart
  SmoothNormalsParams given_smoothing{5, 0.05F, 0.1F};  // of given ones
  GroundNormalsParams ground;                           // of both, after smoothing
};

[[nodiscard]] inline Status validate(const GuidingNormalsParams& params) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params.fitted));
  NPSIM_RETURN_IF_ERROR(validate(params.fitted_smoothing));
  NPSIM_RETURN_IF_ERROR(validate(params.given_smoothing));
  if (!(params.ground.min_rad > 0.0F) || !(params.ground.max_rad > 0.0F && params.ground.max_rad < 1.6F)) {
    return {StatusCode::invalid_argument, "guiding normals: angles of the ground's normals positive, at most 1.6"};
  }
  return validate(params.ground.smoothing);
}

[[nodiscard]] constexpr std::size_t guiding_normals_workspace_bytes(const GuidingNormalsParams& params,
                                                                    Shape shape) noexcept {
  return kWorkspaceAlignment + allocation_bytes<Vec3f>(shape.pixels()) +
         smooth_normals_workspace_bytes(params.fitted_smoothing, shape);
}

namespace refine_detail {

inline void straighten_ground(const GroundNormalsParams& params, const GroundPlane& ground,
                              ImageView<const Label> labels, ImageView<const Vec3f> smooth, ImageView<Vec3f> normals) {
  const float steep = std::cos(params.max_rad);
  const bool known = ground.inlier_share > 0.0F;  // a guess is no evidence against what was predicted
  for (int y = 0; y < normals.height(); ++y) {
    for (int x = 0; x < normals.width(); ++x) {
      if (!params.labels.contains(labels(x, y)) || normals(x, y) == Vec3f{}) continue;
      const float off = std::sqrt(depth_detail::squared_chord(smooth(x, y), ground.up));  // nearly the angle
      if (params.keep_steep) {
        if (off > params.max_rad) continue;
        if (params.kerbs.contains(labels(x, y)) && dot(normals(x, y), ground.up) < steep) continue;
      }
      const float towards = known ? clamp_to(off / params.min_rad, 0.0F, 1.0F) : 0.0F;
      normals(x, y) = normalized(smooth(x, y) * (1.0F - towards) + ground.up * towards);
    }
  }
}

}  // namespace refine_detail

// The normals that guide the refinement and shade the surface: given ones, else those of planes, else fitted ones.
// given: the scene's normals, may be empty. noise: of the depth. planes: may be empty. ground: the ground plane of the
// depth; inlier_share 0: none.
template <class Executor>
[[nodiscard]] Status guiding_normals(const GuidingNormalsParams& params, ImageView<const Vec3f> given,
                                     ImageView<const float> depth, ImageView<const Label> labels,
                                     const ObjectMap& objects, const DepthNoise& noise, const PlanarMap& planes,
                                     const Intrinsics& camera, const GroundPlane& ground, ImageView<Vec3f> normals,
                                     Workspace& workspace, Executor& executor) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape shape = depth.shape();
  NPSIM_RETURN_IF_ERROR(normals_from_depth(params.form, depth, camera, normals, workspace, executor));
  const auto is_given = [&](int x, int y) {
    return !given.empty() && is_finite(given(x, y)) && dot(given(x, y), given(x, y)) > 0.25F;
  };
  if (params.fit) {
    const auto asked = [&](int x, int y) { return !is_given(x, y) && planes.at(x, y) == nullptr; };
    NPSIM_RETURN_IF_ERROR(fitted_normals(params.fitted, depth, objects, noise, camera, asked, normals, executor));
  }
  for (int y = 0; y < (given.empty() ? 0 : shape.height); ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (is_given(x, y)) normals(x, y) = normalized(given(x, y));
    }
  }
  if (params.fit || !given.empty()) {
    const SmoothNormalsParams& smoothing = given.empty() ? params.fitted_smoothing : params.given_smoothing;
    NPSIM_RETURN_IF_ERROR(smooth_normals(smoothing, depth, labels, normals, workspace, executor));
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (const PlanarSegment* plane = planes.at(x, y)) normals(x, y) = plane->normal;
    }
  }
  if (!params.ground.enabled) return {};
  const WorkspaceScope scope(workspace);
  ImageView<Vec3f> smooth;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, smooth));
  copy_pixels(normals, smooth);
  NPSIM_RETURN_IF_ERROR(smooth_normals(params.ground.smoothing, depth, labels, smooth, workspace, executor));
  refine_detail::straighten_ground(params.ground, ground, labels, smooth, normals);
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_NORMALS_GUIDING_NORMALS_HPP
