// SPDX-License-Identifier: Apache-2.0
// The sheet: one vertex per pixel on the ray of its centre, two triangles per quad of neighbouring pixels (type:
// geometry/triangle_mesh.hpp). A quad with four vertices is cut along the diagonal with the smaller depth jump; a tie
// takes the one from upper left to lower right. With three it gets the one triangle they allow, with fewer none.
//
//   V(x, y) = [(u - cx) d / fx, (v - cy) d / fy, d],  u = x + 0.5, v = y + 0.5        equation (3.1), offsets 0
//
// (3.1) after Hu et al., "Worldsheet", ICCV 2021, with general intrinsics in place of a field of view. Its offsets, one
// pair for all vertices, are a shift of the principal point: with_offsets().
//
// Invariant: those of a layer. Cost: one pass, depth in and vertices and quads out: about the time of copying the
// output. Memory: 10 KiB of stack. Error: of unproject(), at most 2.5 ulp a component (one subtraction, one product,
// one quotient).
#ifndef NPSIM_MESH_SHEET_HPP
#define NPSIM_MESH_SHEET_HPP

#include <cmath>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/mesh/detail/layer.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct SheetParams {
  // Depth outside this range is treated as missing. The range is what keeps areas and normals representable.
  float min_depth_m = 0.01F;
  float max_depth_m = 1.0e6F;
};

[[nodiscard]] inline Status validate(const SheetParams& params) noexcept {
  if (!(params.min_depth_m > 0.0F) || !(params.max_depth_m > params.min_depth_m) ||
      !std::isfinite(params.max_depth_m)) {
    return {StatusCode::invalid_argument, "sheet depth range must satisfy 0 < min < max < infinity"};
  }
  return {};
}

// The camera whose sheet has the offsets of (3.1), in its coordinates, in which the picture spans -1 to 1 both ways:
// (x^ + offset) tan(theta / 2) = (u - cx + offset width / 2) / fx.
[[nodiscard]] constexpr Intrinsics with_offsets(const Intrinsics& k, Shape shape, Vec2f offset) noexcept {
  return {k.fx, k.fy, k.cx - 0.5F * static_cast<float>(shape.width) * offset.x,
          k.cy - 0.5F * static_cast<float>(shape.height) * offset.y};
}

namespace mesh_detail {

// unproject_pixel() of the pixels x, x + 1, ... of row y.
template <class F>
[[nodiscard]] simd::F32x3<F> unproject_pixels(const Intrinsics& k, int x, int y, F z) noexcept {
  const F u = to_float(typename F::Int(x) + F::Int::iota()) + F(0.5F);
  const float v = static_cast<float>(y) + 0.5F;
  return {(u - F(k.cx)) * z / F(k.fx), F(v - k.cy) * z / F(k.fy), z};
}

// What a sheet is made from.
struct SheetSource {
  SheetParams params;
  ImageView<const float> depth;
  ImageView<const std::uint8_t> surface;  // may be empty
  Intrinsics intrinsics;

  // The sheet's vertices at n <= F::lanes pixels from (x, y) on, {0, 0, 0} where there is none.
  template <class F>
  [[nodiscard]] simd::F32x3<F> vertices(int x, int y, int n) const noexcept {
    using I = typename F::Int;
    const bool whole = n == F::lanes;
    const F z = whole ? F::load(depth.row(y) + x) : F::load(depth.row(y) + x, n);
    // A NaN fails every comparison.
    typename F::MaskType valid = (z >= F(params.min_depth_m)) & (z <= F(params.max_depth_m));
    if (surface.data() != nullptr) {
      const std::uint8_t* p = surface.row(y) + x;
      valid = valid & ((whole ? I::load_u8(p) : I::load_u8(p, n)) != I(0));
    }
    simd::F32x3<F> v = unproject_pixels<F>(intrinsics, x, y, z);
    valid = valid & simd::is_finite(v.x) & simd::is_finite(v.y);  // absurd intrinsics
    return {select(valid, v.x, F(0.0F)), select(valid, v.y, F(0.0F)), select(valid, z, F(0.0F))};
  }
};

}  // namespace mesh_detail

// depth: z-depth in m, any invalid value allowed. surface: 0 where the pixel shows no surface (sky, ego vehicle);
// an empty view means that every pixel does.
template <class F = simd::F32, class Executor>
[[nodiscard]] Status build_sheet(const SheetParams& params, ImageView<const float> depth,
                                 ImageView<const std::uint8_t> surface, const Intrinsics& intrinsics,
                                 const SheetLayer& sheet, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(intrinsics));
  NPSIM_RETURN_IF_ERROR(validate(sheet));
  const Shape shape = sheet.vertices.shape();
  if (depth.data() == nullptr || depth.shape() != shape || !mesh_detail::mask_fits(surface, shape)) {
    return {StatusCode::shape_mismatch, "depth, surface mask and sheet must have one shape"};
  }
  const mesh_detail::SheetSource source{params, depth, surface, intrinsics};
  mesh_detail::for_row_chunks(executor, shape.height, [&](int begin, int end) {
    for (int strip = 0; strip < shape.width; strip += mesh_detail::kStripColumns) {
      mesh_detail::connect_strip<F>(shape, sheet.quads, strip, begin, end,
                                    [&](int y, int x, int columns, float* z, int own) {
                                      for (int i = 0; i < columns; i += F::lanes) {
                                        const int n = columns - i < F::lanes ? columns - i : F::lanes;
                                        const simd::F32x3<F> v = source.vertices<F>(x + i, y, n);
                                        v.z.store(z + i);
                                        if (i < own)
                                          simd::store3(&sheet.vertices(x + i, y).x, v, own - i < n ? own - i : n);
                                      }
                                    });
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_SHEET_HPP
