// SPDX-License-Identifier: Apache-2.0
// The floor of a street as seen in one picture: carriageway, raised pavements left and right of it, the kerbs between.
//
// The carriageway is one plane, and a plane's inverse depth is linear in the image: w = x0 + x1 x + x2 y. Pavements are
// parallel to it, nearer to the camera: w times one factor. The kerbs are parallel lines, hence meet in one point of
// the horizon, (u, h); a line through it is told by its slope s = (x - u) / (y - h), which is the distance of the kerb
// to the side of the camera over the camera's height. The kerb stone stands upright, so that from the foot of the
// kerb outwards w grows with s, until it is that of the pavement:
//   inverse depth = w(x, y) * clamp(s / s_kerb, 1, raise).
// Least squares over kept pixels of carriageway, trimmed; the raise is the median over kept pixels of pavement, or,
// where none is seen, that of a kerb of the usual height. Kerbs: each row with pavement and carriageway votes for the
// lines that pass between them (Hough), both sides for one vanishing column, then once more in finer steps. Where
// vehicles hide a side entirely, its kerb is taken to be behind the outermost of them.
// Cost: kFloorSamples pixels a few times, and the kerbs (street_kerbs.hpp). Memory: 4 KiB of stack. Error: the plane of
// a floor without noise 1e-5; a kerb that is seen, a pixel at the bottom.
#ifndef NPSIM_MESH_DETAIL_STREET_FLOOR_HPP
#define NPSIM_MESH_DETAIL_STREET_FLOOR_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/layer.hpp"
#include "npsim/mesh/interpolate_rows.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct StreetFloorParams {
  LabelSet carriageway = LabelSet::of(label::ground, label::road, label::parking, label::rail_track);
  LabelSet pavement = LabelSet::of(label::sidewalk, label::terrain);
  LabelSet vehicles = LabelSet::of(label::car, label::truck, label::bus, label::caravan, label::trailer);
  float kerb_height_m = 0.12F;    // >= 0. RASt 06 (Germany); 0.10 to 0.15 elsewhere. Used where no pavement is seen
  float kerb_clearance_m = 0.8F;  // from what is seen of a row of parked vehicles to the kerb behind them

  [[nodiscard]] constexpr bool is_floor(Label l) const noexcept {
    return carriageway.contains(l) || pavement.contains(l);
  }
};

struct StreetFloor {
  bool valid = false;
  double constant = 0, per_column = 0, per_row = 0;  // inverse depth of the carriageway, 1/m, at the pixel (x, y)
  double camera_height_m = 0;
  double raise = 1;                         // inverse depth of the pavement over that
  double vanishing_x = 0, vanishing_y = 0;  // where the kerbs meet, px
  std::array<double, 2> kerb_slope{};       // left < 0, right > 0; 0: not known, no pavement there

  [[nodiscard]] double carriageway(int x, int y) const noexcept { return constant + per_column * x + per_row * y; }
  // What the kerb makes of it: in 1 .. raise.
  [[nodiscard]] double profile(int x, int y) const noexcept {
    const double below = y - vanishing_y;
    const double beside = x - vanishing_x;
    const double kerb = kerb_slope[beside < 0 ? 0 : 1];
    if (kerb == 0.0 || !(below > 0)) return 1.0;
    return std::clamp(beside / (kerb * below), 1.0, raise);
  }
};

namespace mesh_detail {

inline constexpr std::size_t kFloorSamples = 16384;
inline constexpr std::size_t kMinFloorSamples = 48;

// Calls f(x, y) for about kFloorSamples pixels on a grid.
template <class F>
void for_floor_samples(Shape shape, F&& f) {
  int step = 1;
  while (shape.pixels() / (static_cast<std::size_t>(step) * static_cast<std::size_t>(step)) > kFloorSamples) ++step;
  for (int y = step / 2; y < shape.height; y += step) {
    for (int x = step / 2; x < shape.width; x += step) f(x, y);
  }
}

// The plane of the carriageway. False where too little of it is kept, or where it does not come nearer downwards.
[[nodiscard]] inline bool fit_carriageway(const StreetFloorParams& params, ImageView<const Vec3f> vertices,
                                          ImageView<const Label> labels, ImageView<const std::uint8_t> state,
                                          const Intrinsics& k, StreetFloor& floor) noexcept {
  const Shape shape = vertices.shape();
  // Samples farther off than this from the fit before, relatively, take no part: kerbs, ramps, wrong labels.
  constexpr double kTrim[] = {1e30, 0.3, 0.1, 0.05, 0.05};
  for (const double trim : kTrim) {
    double n = 0, sx = 0, sy = 0, sw = 0, sxx = 0, sxy = 0, syy = 0, sxw = 0, syw = 0;
    for_floor_samples(shape, [&](int px, int py) {
      if (state(px, py) != row_state::known || !params.carriageway.contains(labels(px, py))) return;
      const double w = 1.0 / static_cast<double>(vertices(px, py).z);
      if (std::fabs(floor.carriageway(px, py) - w) > trim * w) return;
      const double x = px - 0.5 * shape.width;
      const double y = py - 0.5 * shape.height;
      n += 1, sx += x, sy += y, sw += w;
      sxx += x * x, sxy += x * y, syy += y * y, sxw += x * w, syw += y * w;
    });
    if (n < static_cast<double>(kMinFloorSamples)) return false;
    const double cxx = sxx - sx * sx / n;
    const double cxy = sxy - sx * sy / n;
    const double cyy = syy - sy * sy / n;
    const double cxw = sxw - sx * sw / n;
    const double cyw = syw - sy * sw / n;
    const double determinant = cxx * cyy - cxy * cxy;
    if (!(determinant > 1e-6 * cxx * cyy)) return false;
    floor.per_column = (cyy * cxw - cxy * cyw) / determinant;
    floor.per_row = (cxx * cyw - cxy * cxw) / determinant;
    floor.constant = (sw - floor.per_column * sx - floor.per_row * sy) / n - 0.5 * shape.width * floor.per_column -
                     0.5 * shape.height * floor.per_row;
  }
  // w = n . (ray / ray.z), and 1 / |n| is the distance of the plane from the camera.
  const double nx = floor.per_column * static_cast<double>(k.fx);
  const double ny = floor.per_row * static_cast<double>(k.fy);
  const double nz = floor.constant + floor.per_column * (static_cast<double>(k.cx) - 0.5) +
                    floor.per_row * (static_cast<double>(k.cy) - 0.5);
  floor.camera_height_m = 1.0 / std::sqrt(nx * nx + ny * ny + nz * nz);
  return ny > std::fabs(nx) && ny > std::fabs(nz) && std::isfinite(floor.camera_height_m);
}

inline void fit_raise(const StreetFloorParams& params, ImageView<const Vec3f> vertices, ImageView<const Label> labels,
                      ImageView<const std::uint8_t> state, StreetFloor& floor) noexcept {
  constexpr int kBins = 256;
  constexpr double kLow = 0.8;
  constexpr double kHigh = 1.6;
  std::array<std::uint32_t, kBins> bins{};
  std::uint32_t count = 0;
  for_floor_samples(vertices.shape(), [&](int x, int y) {
    if (state(x, y) != row_state::known || !params.pavement.contains(labels(x, y))) return;
    const double ratio = 1.0 / (static_cast<double>(vertices(x, y).z) * floor.carriageway(x, y));
    if (!(ratio >= kLow && ratio < kHigh)) return;
    ++bins[static_cast<std::size_t>((ratio - kLow) / (kHigh - kLow) * kBins)];
    ++count;
  });
  const double kerb = static_cast<double>(params.kerb_height_m);
  floor.raise = floor.camera_height_m > 4 * kerb ? floor.camera_height_m / (floor.camera_height_m - kerb) : 1.0;
  if (count < kMinFloorSamples) return;
  std::uint32_t below = 0;
  int bin = 0;
  while (2 * (below + bins[static_cast<std::size_t>(bin)]) < count) below += bins[static_cast<std::size_t>(bin++)];
  const double part = (0.5 * count - below) / bins[static_cast<std::size_t>(bin)];
  floor.raise = std::max(1.0, kLow + (bin + part) * (kHigh - kLow) / kBins);
}

// A side without a kerb gets one behind its outermost vehicle. `sheet` still has the vehicles.
inline void kerbs_behind_vehicles(const StreetFloorParams& params, ImageView<const Vec3f> sheet,
                                  ImageView<const Label> labels, ImageView<const std::uint8_t> uncertain,
                                  ImageView<const std::uint8_t> state, const Intrinsics& k,
                                  StreetFloor& floor) noexcept {
  constexpr int kBins = 128;
  constexpr double kFarthest = 8;    // slopes; beyond, in heights of the camera, no kerb is guessed
  constexpr double kOutside = 0.02;  // of the area of the vehicles on a side: mirrors, wrong depth
  std::array<std::array<double, kBins>, 2> area{};
  std::array<int, 2> count{};
  for_floor_samples(sheet.shape(), [&](int x, int y) {
    if (!params.vehicles.contains(labels(x, y)) || state(x, y) == row_state::blocked) return;
    if (!has_vertex(sheet(x, y))) return;
    if (uncertain.data() != nullptr && uncertain(x, y) != 0) return;
    const double z = static_cast<double>(sheet(x, y).z);
    const double slope = (x - floor.vanishing_x) * z / (static_cast<double>(k.fy) * floor.camera_height_m);
    const double bin = std::fabs(slope) * (kBins / kFarthest);
    if (!(bin < kBins)) return;
    const std::size_t side = slope < 0 ? 0 : 1;
    area[side][static_cast<std::size_t>(bin)] += z * z;
    ++count[side];
  });
  for (std::size_t side = 0; side < 2; ++side) {
    if (floor.kerb_slope[side] != 0.0 || count[side] < static_cast<int>(kMinFloorSamples)) continue;
    double total = 0;
    for (const double a : area[side]) total += a;
    double outside = 0;
    int bin = kBins - 1;
    while (bin > 0 && outside + area[side][static_cast<std::size_t>(bin)] < kOutside * total) {
      outside += area[side][static_cast<std::size_t>(bin--)];
    }
    floor.kerb_slope[side] =
        (side == 0 ? -1.0 : 1.0) *
        ((bin + 1) * (kFarthest / kBins) + static_cast<double>(params.kerb_clearance_m) / floor.camera_height_m);
  }
}

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_STREET_FLOOR_HPP
