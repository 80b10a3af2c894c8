// SPDX-License-Identifier: Apache-2.0
// Random masks of the kinds that are hard for meshes over a pixel grid.
#ifndef NPSIM_TESTS_UNIT_MESH_MASKS_HPP
#define NPSIM_TESTS_UNIT_MESH_MASKS_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "npsim/core/image_view.hpp"
#include "npsim/core/random.hpp"

namespace mesh_test {

using namespace npsim;  // NOLINT(google-build-using-namespace)

enum MaskKind : std::uint32_t {
  mask_empty,
  mask_full,
  mask_noise,
  mask_rectangle,
  mask_border,     // a frame along the image border, or a rectangle that leaves the image
  mask_corners,    // squares that touch at their corners only
  mask_ring,       // rings, one pixel thick or more
  mask_comb,       // teeth on a bar
  mask_dots,       // single pixels
  mask_rows,       // whole rows: no anchor to either side
  mask_columns,    // poles
  mask_diagonals,  // one pixel wide, touching at corners
  mask_blobs,      // a few discs
  kMaskKinds
};

inline std::vector<std::uint8_t> make_mask(Shape shape, MaskKind kind, RandomStream& random) {
  std::vector<std::uint8_t> mask(shape.pixels(), kind == mask_full ? 1 : 0);
  const auto below = [&random](int n) { return static_cast<int>(random.next_u32() % static_cast<std::uint32_t>(n)); };
  const auto paint = [&](const auto& inside) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (inside(x, y)) mask[static_cast<std::size_t>(y * shape.width + x)] = 1;
      }
    }
  };
  const int w = shape.width;
  const int h = shape.height;
  const int x0 = below(w);
  const int y0 = below(h);
  const int step = 2 + below(5);
  const int phase = below(step);
  switch (kind) {
    case mask_noise: {
      const float density = random.uniform();
      paint([&](int, int) { return random.uniform() < density; });
      break;
    }
    case mask_rectangle: {
      const int x1 = x0 + below(w);
      const int y1 = y0 + below(h);
      paint([&](int x, int y) { return x >= x0 && x <= x1 && y >= y0 && y <= y1; });
      break;
    }
    case mask_border:
      paint([&](int x, int y) { return x < phase || y < phase || x >= w - step / 2 || y >= h - step / 3; });
      break;
    case mask_corners: paint([&](int x, int y) { return ((x + phase) / step + y / step) % 2 == 0; }); break;
    case mask_ring: {
      const int inner = below(10);
      const int outer = inner + 1 + below(4);
      paint([&](int x, int y) {
        const int r = std::max(std::abs(x - x0), std::abs(y - y0));
        return r >= inner && r < outer;
      });
      break;
    }
    case mask_comb: paint([&](int x, int y) { return y == y0 || (y > y0 && (x + phase) % step == 0); }); break;
    case mask_dots: paint([&](int x, int y) { return (x + phase) % step == 0 && y % step == 0; }); break;
    case mask_rows: paint([&](int, int y) { return (y + phase) % step < step / 2; }); break;
    case mask_columns: paint([&](int x, int) { return (x + phase) % step < step / 2; }); break;
    case mask_diagonals: paint([&](int x, int y) { return (x + (y0 % 2 == 0 ? y : h - y)) % step == phase; }); break;
    case mask_blobs:
      for (int n = 1 + below(4); n > 0; --n) {
        const int cx = below(w);
        const int cy = below(h);
        const int r = 1 + below(8);
        paint([&](int x, int y) { return (x - cx) * (x - cx) + (y - cy) * (y - cy) <= r * r; });
      }
      break;
    default: break;
  }
  return mask;
}

inline MaskKind any_kind(RandomStream& random) { return static_cast<MaskKind>(random.next_u32() % kMaskKinds); }

}  // namespace mesh_test

#endif  // NPSIM_TESTS_UNIT_MESH_MASKS_HPP
