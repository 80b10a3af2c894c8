// SPDX-License-Identifier: Apache-2.0
// Builds the ray structure of a layer (sheet_layout.hpp) from its vertices and quads.
//
// The plane of a tile has the mean slope of its neighbouring vertices (the least-squares plane where no face is
// missing), its slab is the narrowest about it; roads and facades are planes in inverse depth as well, so their slabs
// are thin. Left out, hence never hit: faces with a vertex that is missing, not finite, beyond kTraceMaxCoordinate or
// nearer than kSheetMinDepth. No sorting, no index buffer; the same layer gives the same bytes for any executor.
// Vertices may lie off their pixels' rays: the largest distance is found and every test is that much more generous,
// which costs speed and nothing else. Cost: two passes over the layer, a few ns a pixel. Memory:
// sheet_workspace_bytes(). Error: inverse depths are rounded once; sheet_ray.hpp allows for it.
#ifndef NPSIM_TRACE_SHEET_BUILD_HPP
#define NPSIM_TRACE_SHEET_BUILD_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include "npsim/core/bits.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/sheet_layer.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/sheet_layout.hpp"
#include "npsim/trace/triangle.hpp"

namespace npsim {
inline namespace v1 {

inline constexpr float kSheetMinDepth = 0x1p-40F;  // metres

inline namespace NPSIM_ISA_NAMESPACE {
namespace sheet_detail {

using sheet_layout::RowBounds;

// Inverse depths of one row of pixels, and what its vertices add to the bounds.
template <class F>
void invert_row(const SheetTrace& sheet, int y, float* out, RowBounds& bounds) noexcept {
  using M = typename F::MaskType;
  const int width = sheet.vertices.width();
  const Intrinsics& k = sheet.intrinsics;
  const F inf(std::numeric_limits<float>::infinity());
  F low[3] = {inf, inf, inf};
  F high[3] = {-inf, -inf, -inf};
  F greatest(0.0F);
  F off(0.0F);
  const Vec3f* p = sheet.vertices.row(y);
  const float v = static_cast<float>(y) + 0.5F - k.cy;
  for (int x = 0; x < width; x += F::lanes) {
    const int n = std::min(F::lanes, width - x);
    const simd::F32x3<F> at = simd::load3<F>(&p[x].x, n);
    const M good = (at.z >= F(kSheetMinDepth)) & (at.z <= F(kTraceMaxCoordinate)) &
                   (abs(at.x) <= F(kTraceMaxCoordinate)) & (abs(at.y) <= F(kTraceMaxCoordinate));
    const F w = select(good, F(1.0F) / select(good, at.z, F(1.0F)), F(0.0F));
    if (n == F::lanes) {
      w.store(out + x);
    } else {
      w.store(out + x, n);
    }
    const F all[3] = {at.x, at.y, at.z};
    for (int i = 0; i < 3; ++i) {
      low[i] = min(select(good, all[i], inf), low[i]);
      high[i] = max(select(good, all[i], -inf), high[i]);
    }
    greatest = max(w, greatest);
    const F u = to_float(typename F::Int(x) + F::Int::iota()) + F(0.5F - k.cx);
    const F du = abs(at.x * w * F(k.fx) - u);
    const F dv = abs(at.y * w * F(k.fy) - F(v));
    off = max(select(good, max(du, dv), F(0.0F)), off);
  }
  for (int i = 0; i < F::lanes; ++i) {
    for (int c = 0; c < 3; ++c) {
      bounds.low[c] = std::min(bounds.low[c], low[c].lane(i));
      bounds.high[c] = std::max(bounds.high[c], high[c].lane(i));
    }
    bounds.max_inverse_depth = std::max(bounds.max_inverse_depth, greatest.lane(i));
    bounds.off_grid_px = std::max(bounds.off_grid_px, off.lane(i));
  }
}

// The faces of the tile at quad (x, y) whose vertices are all there, as in SheetTiles; used: the vertices that
// they have, bit 5 j + i.
[[nodiscard]] inline std::uint32_t tile_faces(const SheetTrace& sheet, int x, int y, std::uint32_t& used) noexcept {
  std::uint32_t faces = 0;
  used = 0;
  const int columns = std::min(4, sheet.quads.width() - x);
  const int rows = std::min(4, sheet.quads.height() - y);
  for (int j = 0; j < rows; ++j) {
    const std::uint8_t* quads = sheet.quads.row(y + j) + x;
    const float* upper = sheet.inverse_depth.row(y + j) + x;
    const float* lower = upper + sheet.inverse_depth.stride();
    for (int i = 0; i < columns; ++i) {
      const unsigned quad = quads[i];
      const bool corner[4] = {upper[i] > 0.0F, upper[i + 1] > 0.0F, lower[i] > 0.0F, lower[i + 1] > 0.0F};
      const auto at = static_cast<unsigned>(5 * j + i);
      for (const bool is_upper : {true, false}) {
        if ((quad & (is_upper ? kQuadUpperFace : kQuadLowerFace)) == 0) continue;
        const Face f = quad_face((quad & kQuadAntiDiagonal) != 0, is_upper, 0, 1, 2, 3);
        if (!corner[f.a] || !corner[f.b] || !corner[f.c]) continue;
        faces |= 1U << static_cast<unsigned>(4 * j + i + (is_upper ? 0 : 16));
        for (const std::uint32_t c : {f.a, f.b, f.c}) used |= 1U << (at + (c & 1U) + 5U * (c >> 1U));
      }
    }
  }
  return faces;
}

struct Slab {
  float base, gx, gy, half;
  float low, high;  // of w itself
};

// The slab of a tile from its 5x5 samples, all of them used.
[[nodiscard]] inline Slab whole_slab(const float* w, std::ptrdiff_t stride) noexcept {
  float columns[5] = {};
  float rows[5] = {};
  for (int j = 0; j < 5; ++j) {
    for (int i = 0; i < 5; ++i) {
      columns[i] += w[j * stride + i];
      rows[j] += w[j * stride + i];
    }
  }
  Slab s{};
  s.gx = (2.0F * (columns[4] - columns[0]) + (columns[3] - columns[1])) * 0.02F;
  s.gy = (2.0F * (rows[4] - rows[0]) + (rows[3] - rows[1])) * 0.02F;
  float least = std::numeric_limits<float>::infinity();
  float greatest = -least;
  s.low = least;
  s.high = greatest;
  for (int j = 0; j < 5; ++j) {
    for (int i = 0; i < 5; ++i) {
      const float value = w[j * stride + i];
      const float rest = value - s.gx * static_cast<float>(i) - s.gy * static_cast<float>(j);
      least = rest < least ? rest : least;
      greatest = rest > greatest ? rest : greatest;
      s.low = value < s.low ? value : s.low;
      s.high = value > s.high ? value : s.high;
    }
  }
  s.base = 0.5F * (least + greatest);
  s.half = 0.5F * (greatest - least);
  return s;
}

// The same from some of the samples.
[[nodiscard]] inline Slab partial_slab(const float* w, std::ptrdiff_t stride, std::uint32_t used) noexcept {
  const float inf = std::numeric_limits<float>::infinity();
  Slab s{0, 0, 0, -inf, inf, -inf};
  if (used == 0) return s;
  float sums[2] = {};
  int pairs[2] = {};
  const auto has = [used](int i, int j) {
    return i < 5 && j < 5 && (used >> static_cast<unsigned>(5 * j + i) & 1U) != 0;
  };
  for (int j = 0; j < 5; ++j) {
    for (int i = 0; i < 5; ++i) {
      if (!has(i, j)) continue;
      const float value = w[j * stride + i];
      s.low = std::min(s.low, value);
      s.high = std::max(s.high, value);
      if (has(i + 1, j)) {
        sums[0] += w[j * stride + i + 1] - value;
        ++pairs[0];
      }
      if (has(i, j + 1)) {
        sums[1] += w[(j + 1) * stride + i] - value;
        ++pairs[1];
      }
    }
  }
  s.gx = pairs[0] > 0 ? sums[0] / static_cast<float>(pairs[0]) : 0.0F;
  s.gy = pairs[1] > 0 ? sums[1] / static_cast<float>(pairs[1]) : 0.0F;
  float least = inf;
  float greatest = -inf;
  for (int j = 0; j < 5; ++j) {
    for (int i = 0; i < 5; ++i) {
      if (!has(i, j)) continue;
      const float rest = w[j * stride + i] - s.gx * static_cast<float>(i) - s.gy * static_cast<float>(j);
      least = std::min(least, rest);
      greatest = std::max(greatest, rest);
    }
  }
  s.base = 0.5F * (least + greatest);
  s.half = 0.5F * (greatest - least);
  return s;
}

// Whether the tile at quad (x, y) has all its faces, as far as the quads say.
[[nodiscard]] inline bool is_full(const SheetTrace& sheet, int x, int y) noexcept {
  constexpr std::uint32_t kAll = 0x01010101U * (kQuadUpperFace | kQuadLowerFace);
  if (x + 4 > sheet.quads.width() || y + 4 > sheet.quads.height()) return false;
  std::uint32_t all = kAll;
  for (int j = 0; j < 4; ++j) {
    std::uint32_t row = 0;
    std::memcpy(&row, sheet.quads.row(y + j) + x, sizeof row);
    all &= row;
  }
  return all == kAll;
}

// The 16 tiles at quad (x, y), and the bounds of w in them.
inline void build_tiles(const SheetTrace& sheet, int x, int y, SheetTiles& out, float& low, float& high) noexcept {
  low = std::numeric_limits<float>::infinity();
  high = -low;
  for (int k = 0; k < 16; ++k) {
    const int tx = x + 4 * (k % 4);
    const int ty = y + 4 * (k / 4);
    const float* w = sheet.inverse_depth.row(ty) + tx;
    const std::ptrdiff_t stride = sheet.inverse_depth.stride();
    Slab s{};
    bool whole = is_full(sheet, tx, ty);
    if (whole) {
      s = whole_slab(w, stride);
      whole = s.low > 0.0F;
      out.faces[k] = ~0U;
    }
    if (!whole) {
      std::uint32_t used = 0;
      out.faces[k] = tile_faces(sheet, tx, ty, used);
      s = partial_slab(w, stride, used);
    }
    out.base[k] = s.base;
    out.gx[k] = s.gx;
    out.gy[k] = s.gy;
    out.half[k] = s.half;
    low = std::min(low, s.low);
    high = std::max(high, s.high);
  }
}

// A child's bounds put into its parent; slots without a child stay empty.
inline void put_bounds(SheetNode* nodes, int across, int x, int y, float low, float high) noexcept {
  SheetNode& node = nodes[(y / 4) * across + x / 4];
  const int k = 4 * (y % 4) + x % 4;
  node.low[k] = low;
  node.high[k] = high;
}

// The bounds from what was found: the frustum of the vertices' pixels, half a pixel and their errors wider, and their
// range of depth.
[[nodiscard]] inline SheetBounds bounds_of(const RowBounds& b, Shape shape, const Intrinsics& k) noexcept {
  SheetBounds out;
  const auto width = static_cast<float>(shape.width);
  const auto height = static_cast<float>(shape.height);
  const float reach_x = std::max(std::fabs(k.cx), std::fabs(width - k.cx));
  const float reach_y = std::max(std::fabs(k.cy), std::fabs(height - k.cy));
  out.max_inverse_depth = b.max_inverse_depth;
  out.pad_px = b.off_grid_px + 0x1p-19F * (std::max(width, height) + std::max(reach_x, reach_y));
  out.focal_reach = std::max(k.fx + reach_x, k.fy + reach_y) + 2.0F * (1.0F + out.pad_px);
  for (int i = 0; i < 3; ++i) {
    out.low[i] = b.low[i];
    out.high[i] = b.high[i];
  }
  const double margin = static_cast<double>(out.pad_px) + 0.5;
  const double sides[4] = {
      static_cast<double>(k.cx) - 0.5 + margin, shape.width - 0.5 + margin - static_cast<double>(k.cx),
      static_cast<double>(k.cy) - 0.5 + margin, shape.height - 0.5 + margin - static_cast<double>(k.cy)};
  for (int i = 0; i < 8; ++i) {
    const double sign = i % 2 == 0 ? 1.0 : -1.0;
    out.x[i] = i < 2 ? sign * static_cast<double>(k.fx) : 0.0;
    out.y[i] = i == 2 || i == 3 ? sign * static_cast<double>(k.fy) : 0.0;
    out.z[i] = i < 4 ? sides[i] : sign;
    out.d[i] = i < 4 ? 0.0
                     : (i % 2 == 0 ? -(1 - 0x1p-20) * static_cast<double>(b.low[2])
                                   : (1 + 0x1p-20) * static_cast<double>(b.high[2]));
    out.size[i] = std::fabs(out.x[i]) + std::fabs(out.y[i]) + std::fabs(out.z[i]);
  }
  return out;
}

}  // namespace sheet_detail

// `out` points into the workspace and at the layer and stays good as long as both do.
template <class F = simd::F32, class Executor>
[[nodiscard]] Status build_sheet_trace(const SheetLayer& layer, const Intrinsics& intrinsics, Workspace& workspace,
                                       SheetTrace& out, Executor& executor) {
  using namespace sheet_detail;
  using namespace sheet_layout;
  out = SheetTrace{};
  NPSIM_RETURN_IF_ERROR(validate(layer));
  NPSIM_RETURN_IF_ERROR(validate(intrinsics));
  const Shape shape = layer.vertices.shape();
  const Levels levels = levels_of(shape);
  if (levels.count == 0) return {};
  if (shape.pixels() >= (std::size_t{1} << 30U)) {
    return Status(StatusCode::capacity_exceeded, "a ray tracer takes fewer than 2^31 faces");
  }
  const auto rows = static_cast<std::size_t>(levels.down[0]);
  const Shape plane = plane_shape(shape);
  ImageView<float> inverse_depth;
  Span<SheetTiles> tiles;
  Span<SheetNode> nodes;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(plane, inverse_depth));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(static_cast<std::size_t>(levels.across[0]) * rows, tiles));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(levels.nodes, nodes));
  const WorkspaceScope scope(workspace);
  Span<RowBounds> row_bounds;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(rows, row_bounds));

  SheetTrace sheet;
  sheet.vertices = layer.vertices;
  sheet.quads = layer.quads;
  sheet.inverse_depth = inverse_depth;
  sheet.intrinsics = intrinsics;
  const float inf = std::numeric_limits<float>::infinity();
  executor.for_chunks(rows, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t g = begin; g < end; ++g) {
      RowBounds bounds{{inf, inf, inf}, {-inf, -inf, -inf}, 0.0F, 0.0F};
      const int y0 = kSheetGroupQuads * static_cast<int>(g);
      const int y1 = g + 1 == rows ? plane.height : y0 + kSheetGroupQuads;
      for (int y = y0; y < y1; ++y) {
        float* row = inverse_depth.row(y);
        int x = 0;
        if (y < shape.height) {
          invert_row<F>(sheet, y, row, bounds);
          x = shape.width;
        }
        std::fill(row + x, row + plane.width, 0.0F);
      }
      row_bounds[g] = bounds;
    }
  });
  RowBounds bounds = row_bounds[0];
  for (const RowBounds& b : row_bounds) {
    for (int k = 0; k < 3; ++k) {
      bounds.low[k] = std::min(bounds.low[k], b.low[k]);
      bounds.high[k] = std::max(bounds.high[k], b.high[k]);
    }
    bounds.max_inverse_depth = std::max(bounds.max_inverse_depth, b.max_inverse_depth);
    bounds.off_grid_px = std::max(bounds.off_grid_px, b.off_grid_px);
  }
  if (!(bounds.max_inverse_depth > 0.0F)) return {};  // no vertex: nothing to hit

  sheet.bounds = bounds_of(bounds, shape, intrinsics);
  if (!(sheet.bounds.focal_reach < 0x1p30F)) {
    return Status(StatusCode::invalid_argument, "the vertices of a traced sheet must lie near their pixels' rays");
  }
  for (SheetNode& node : nodes) {
    std::fill_n(node.low, 16, inf);
    std::fill_n(node.high, 16, -inf);
  }
  executor.for_chunks(rows, 1, [&](std::size_t begin, std::size_t end) {
    for (auto g = static_cast<int>(begin); g < static_cast<int>(end); ++g) {
      for (int x = 0; x < levels.across[0]; ++x) {
        float low = 0;
        float high = 0;
        build_tiles(sheet, kSheetGroupQuads * x, kSheetGroupQuads * g,
                    tiles[static_cast<std::size_t>(g * levels.across[0] + x)], low, high);
        if (levels.count > 1) put_bounds(nodes.data(), levels.across[1], x, g, low, high);
      }
    }
  });
  for (int level = 1; level + 1 < levels.count; ++level) {
    for (int y = 0; y < levels.down[level]; ++y) {
      for (int x = 0; x < levels.across[level]; ++x) {
        const SheetNode& node = nodes[levels.first[level] + static_cast<std::size_t>(y * levels.across[level] + x)];
        put_bounds(nodes.data() + levels.first[level + 1], levels.across[level + 1], x, y,
                   *std::min_element(node.low, node.low + 16), *std::max_element(node.high, node.high + 16));
      }
    }
  }
  sheet.tiles = tiles;
  sheet.nodes = nodes;
  sheet.levels = levels.count;
  for (int level = 0; level < levels.count; ++level) {
    sheet.first[level] = levels.first[level];
    sheet.across[level] = levels.across[level];
    sheet.down[level] = levels.down[level];
  }
  out = sheet;
  return {};
}

// Layers of one shape and camera as one scene. `layers` stays with the caller.
[[nodiscard]] inline Status join_layers(Span<const SheetTrace> layers, SheetScene& out) noexcept {
  SheetScene scene;
  const SheetTrace* first = nullptr;
  for (const SheetTrace& layer : layers) {
    if (layer.levels == 0) continue;
    if (first == nullptr) {
      first = &layer;
      scene.bounds = layer.bounds;
      continue;
    }
    const Intrinsics& a = first->intrinsics;
    const Intrinsics& b = layer.intrinsics;
    if (layer.vertices.shape() != first->vertices.shape() || a.fx != b.fx || a.fy != b.fy || a.cx != b.cx ||
        a.cy != b.cy) {
      return Status(StatusCode::shape_mismatch, "layers that are traced as one must have one shape and one camera");
    }
    SheetBounds& to = scene.bounds;
    const SheetBounds& from = layer.bounds;
    for (int k = 0; k < 3; ++k) {
      to.low[k] = std::min(to.low[k], from.low[k]);
      to.high[k] = std::max(to.high[k], from.high[k]);
    }
    to.max_inverse_depth = std::max(to.max_inverse_depth, from.max_inverse_depth);
    to.pad_px = std::max(to.pad_px, from.pad_px);
    to.focal_reach = std::max(to.focal_reach, from.focal_reach);
    for (int i = 0; i < 8; ++i) {  // x and y are alike; the greater z or d of a side takes in more
      to.z[i] = std::max(to.z[i], from.z[i]);
      to.d[i] = std::max(to.d[i], from.d[i]);
      to.size[i] = std::max(to.size[i], from.size[i]);
    }
  }
  scene.layers = layers;
  out = scene;
  return {};
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_TRACE_SHEET_BUILD_HPP
