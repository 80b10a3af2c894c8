// SPDX-License-Identifier: Apache-2.0
// Completes foreground objects over their uncertain pixels (section 3.5.2): one sheet per object, all in one layer.
//
// An object is a connected component (4-neighbourhood) of foreground pixels with one label and, where instance ids are
// given, one instance. Its kept vertices are the sheet's at certain pixels. From them a breadth-first search enters the
// object's other pixels: a new vertex gets the mean depth of its neighbours of earlier levels, in the same object.
// An object without any kept vertex (thinner than the uncertain band around its outline: poles, far persons) would
// vanish; it stands at one depth, the median of its own pixels' (the lower one of two), and stays empty only if it has
// no valid depth at all. Faces join vertices of one object.
//
// A sheet spans pixel centres, so what is one pixel wide has no face. With widen_thin such a pixel lends its depth to
// a free pixel beside it (right, else left; for what is one pixel high below, else above), so that a pole of one pixel
// casts a shadow. The pixels added carry the object's id but another label.
//
// Invariant: a layer has one vertex a pixel at most, no face joins two objects, objects are numbered 1, 2, ... in
// raster order. Levels, not the order of visits, define the means: the result is a function of the input alone.
// Cost: about the time of copying the output, and tens of instructions for each pixel at the rim of a run of pixels, in
// doubt, or without one of its neighbours; numbering and growth are serial. Memory: half a byte a pixel, in whole words
// of 64 pixels a row; the rest is done in the outputs (components.hpp, foreground_growth.hpp). Error: of a mean, half
// an ulp each level, and of unproject().
#ifndef NPSIM_MESH_COMPLETE_FOREGROUND_HPP
#define NPSIM_MESH_COMPLETE_FOREGROUND_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/components.hpp"
#include "npsim/mesh/detail/connect.hpp"
#include "npsim/mesh/detail/foreground/growth.hpp"
#include "npsim/mesh/detail/foreground/pixels.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct ForegroundParams {
  LabelSet foreground = kForegroundLabels;  // section 3.4.2
  bool widen_thin = true;                   // ours, see above

  [[nodiscard]] static constexpr ForegroundParams thesis() noexcept { return {kForegroundLabels, false}; }
};

[[nodiscard]] constexpr std::size_t complete_foreground_workspace_bytes(const ForegroundParams&, Shape shape) noexcept {
  return 4 * pixel_bits_bytes(shape) + kWorkspaceAlignment;
}

namespace mesh_detail {

// Unprojects the pixels of row y that are present, and clears the others of the words that hold any.
template <class F>
void unproject_row(const Intrinsics& intrinsics, ImageView<const std::uint64_t> present, ImageView<Vec3f> vertices,
                   int y) noexcept {
  const F zero(0.0F);
  for (int w = 0; w < present.width(); ++w) {
    const std::uint64_t word = present(w, y);
    if (word == 0) continue;
    const int end = std::min(kWordBits * (w + 1), vertices.width());
    for (int x = kWordBits * w; x < end; x += F::lanes) {
      const int n = std::min(F::lanes, end - x);
      float* p = &vertices(x, y).x;
      const auto here =
          F::MaskType::from_bits(static_cast<std::uint32_t>(word >> static_cast<unsigned>(x % kWordBits)));
      const F z = select(here, simd::load3<F>(p, n).z, zero);
      const simd::F32x3<F> v = unproject_pixels<F>(intrinsics, x, y, z);
      const auto valid = z > zero;
      simd::store3(p, simd::F32x3<F>{select(valid, v.x, zero), select(valid, v.y, zero), z}, n);
    }
  }
}

// Quads of row y from those of their corners that belong to one object; three of four decide which.
template <class F>
void connect_objects(ImageView<const std::uint64_t> present, ImageView<const std::uint32_t> object,
                     const SheetLayer& layer, int y) noexcept {
  using I = typename F::Int;
  const int width = object.width();
  for (int w = 0; kWordBits * w < width - 1; ++w) {
    const int x = kWordBits * w;
    const int n = std::min(kWordBits, width - 1 - x);
    const bool more = w + 1 < present.width();
    const QuadCorners there = {present(w, y), right_bits(present(w, y), more ? present(w + 1, y) : 0),
                               present(w, y + 1), right_bits(present(w, y + 1), more ? present(w + 1, y + 1) : 0)};
    QuadBits faces = connect_bits(there, 0);
    if ((faces.upper | faces.lower) != 0) {
      std::uint64_t ab = 0, ac = 0, ad = 0, bc = 0, bd = 0;  // same object
      QuadCorners deep = {0, 0, 0, 0};
      std::uint64_t smaller_bc = 0;
      for (int i = 0; i < n; i += F::lanes) {
        const auto put = [i](auto mask) { return std::uint64_t{bits(mask)} << static_cast<unsigned>(i); };
        const auto id = [&](int px, int py) {
          const auto* p = reinterpret_cast<const std::int32_t*>(object.row(py) + px);
          return width - px >= I::lanes ? I::load(p) : I::load(p, std::max(0, width - px));
        };
        const auto depth = [&](int px, int py) {
          return simd::load3<F>(&layer.vertices.row(py)[px].x, std::clamp(width - px, 0, F::lanes)).z;
        };
        const I a = id(x + i, y), b = id(x + i + 1, y), c = id(x + i, y + 1), d = id(x + i + 1, y + 1);
        ab |= put(a == b), ac |= put(a == c), ad |= put(a == d), bc |= put(b == c), bd |= put(b == d);
        const F za = depth(x + i, y), zb = depth(x + i + 1, y), zc = depth(x + i, y + 1), zd = depth(x + i + 1, y + 1);
        const F zero(0.0F);
        deep.a |= put(za > zero), deep.b |= put(zb > zero), deep.c |= put(zc > zero), deep.d |= put(zd > zero);
        smaller_bc |= put(abs(zb - zc) < abs(za - zd));
      }
      const std::uint64_t first = (ab & ac) | (ab & ad) | (ac & ad);  // A belongs to the object that decides; else B
      const QuadCorners own = {deep.a & there.a & (first | ab), deep.b & there.b & (~first | ab),
                               deep.c & there.c & ((first & ac) | (~first & bc)),
                               deep.d & there.d & ((first & ad) | (~first & bd))};
      faces = connect_bits(own, smaller_bc);
    }
    store_quads<F>(faces, layer.quads.row(y) + x, n);
  }
}

}  // namespace mesh_detail

// sheet, depth, surface: as for build_sheet(); surface, instances, uncertain may be empty views. background_state: the
// states that complete_background() wrote; foreground that it kept (thesis preset: segments far from any uncertain
// pixel) belongs to the background layer and makes no object. Empty: every foreground pixel is an object's. object: 0
// outside.
template <class F = simd::F32, class Executor>
[[nodiscard]] Status complete_foreground(const ForegroundParams& params, const SheetParams& sheet,
                                         ImageView<const float> depth, ImageView<const std::uint8_t> surface,
                                         ImageView<const Label> labels, ImageView<const std::uint16_t> instances,
                                         ImageView<const std::uint8_t> uncertain,
                                         ImageView<const std::uint8_t> background_state, const Intrinsics& intrinsics,
                                         const SheetLayer& foreground, ImageView<std::uint32_t> object,
                                         Workspace& workspace, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(sheet));
  NPSIM_RETURN_IF_ERROR(validate(intrinsics));
  NPSIM_RETURN_IF_ERROR(validate(foreground));
  const Shape shape = foreground.vertices.shape();
  if (depth.data() == nullptr || depth.shape() != shape || labels.data() == nullptr || labels.shape() != shape ||
      object.data() == nullptr || object.shape() != shape || !mesh_detail::mask_fits(surface, shape) ||
      !mesh_detail::mask_fits(instances, shape) || !mesh_detail::mask_fits(uncertain, shape) ||
      !mesh_detail::mask_fits(background_state, shape)) {
    return {StatusCode::shape_mismatch, "depth, labels, instances, masks, object and foreground must have one shape"};
  }
  if (shape.pixels() >= 0x80000000U) return {StatusCode::capacity_exceeded, "the image has 2^31 pixels or more"};
  const WorkspaceScope scope(workspace);
  mesh_detail::ObjectPixels planes;
  planes.pixels = foreground.vertices;
  NPSIM_RETURN_IF_ERROR(mesh_detail::allocate_links(shape, workspace, planes.links));
  NPSIM_RETURN_IF_ERROR(mesh_detail::allocate_bits(shape, workspace, planes.known));
  const mesh_detail::ForegroundSource source{
      {sheet, depth, surface, intrinsics}, params.foreground, labels, instances, uncertain, background_state};
  mesh_detail::for_rows(executor, shape.height, [&](int y) { mesh_detail::find_objects<F>(source, planes, y); });
  mesh_detail::for_rows(executor, shape.height, [&](int y) {
    for (int w = 0; y > 0 && w < planes.known.width(); ++w) planes.links.above(w, y) &= planes.links.member(w, y - 1);
  });
  std::uint32_t count = 0;
  NPSIM_RETURN_IF_ERROR(label_components(planes.links, object, count));
  mesh_detail::grow_objects(planes);
  mesh_detail::stand_up_uncertain(planes);
  // Now every member is known; the plane that said so takes the pixels with an object.
  const ImageView<std::uint64_t> present = planes.known;
  if (params.widen_thin) {
    mesh_detail::for_rows(executor, shape.height, [&](int y) {
      mesh_detail::widen_thin(planes.links, present, foreground.vertices, object, y);
    });
  }
  mesh_detail::for_rows(executor, shape.height,
                        [&](int y) { mesh_detail::unproject_row<F>(intrinsics, present, foreground.vertices, y); });
  mesh_detail::for_rows(executor, quad_shape(shape).height,
                        [&](int y) { mesh_detail::connect_objects<F>(present, object, foreground, y); });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_COMPLETE_FOREGROUND_HPP
