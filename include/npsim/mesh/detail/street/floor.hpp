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
// where none is seen, that of a kerb of the usual height. Kerbs: each so many-th row with pavement and carriageway
// votes for the lines that pass between them (Hough), both sides for one vanishing column, then once more in finer
// steps. Where vehicles hide a side entirely, its kerb is taken to be behind the outermost of them. Cost: kFloorSamples
// pixels a few times; labels and states of about 256 to 512 rows, 64 pixels at a time, and 70 votes for each. Memory:
// two ranges per row, and 39 KiB of stack. Error: the plane of a floor without noise 1e-5; a kerb that is seen, a pixel
// at the bottom.
#ifndef NPSIM_MESH_DETAIL_STREET_FLOOR_HPP
#define NPSIM_MESH_DETAIL_STREET_FLOOR_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/bits.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/background/anchors.hpp"
#include "npsim/mesh/detail/layer.hpp"
#include "npsim/mesh/detail/rows.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/bytes.hpp"

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
    return clamp_to(beside / (kerb * below), 1.0, raise);
  }
};

// Columns of one row between which a kerb has to be: the last of pavement and the first of carriageway, or the other
// way round. Empty where end <= begin.
struct KerbRange {
  std::int32_t begin = 0;
  std::int32_t end = 0;
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
    PlaneSums s;
    for_floor_samples(shape, [&](int px, int py) {
      if (state(px, py) != row_state::known || !params.carriageway.contains(labels(px, py))) return;
      const double w = 1.0 / static_cast<double>(vertices(px, py).z);
      if (std::fabs(floor.carriageway(px, py) - w) > trim * w) return;
      const double x = px - 0.5 * shape.width;
      const double y = py - 0.5 * shape.height;
      s.n += 1, s.x += x, s.y += y, s.w += w;
      s.xx += x * x, s.xy += x * y, s.yy += y * y, s.xw += x * w, s.yw += y * w;
    });
    if (s.n < static_cast<double>(kMinFloorSamples)) return false;
    const CentredSums c = centred(s);
    if (!c.span_plane()) return false;
    floor.per_column = c.slope_x();
    floor.per_row = c.slope_y();
    floor.constant = (s.w - floor.per_column * s.x - floor.per_row * s.y) / s.n - 0.5 * shape.width * floor.per_column -
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

// Of the rows, only each so many-th votes.
[[nodiscard]] inline int kerb_row_step(Shape shape) noexcept { return std::max(1, shape.height / 256); }

// left: outermost pavement to the carriageway; right likewise.
template <class F>
[[nodiscard]] std::array<KerbRange, 2> find_kerbs(const StreetFloorParams& params, const Label* labels,
                                                  const std::uint8_t* state, int width) noexcept {
  using U = simd::BytesOf<F>;
  const LabelTest<U> is_pavement(params.pavement);
  const LabelTest<U> is_carriageway(params.carriageway);
  std::array<KerbRange, 2> found{};
  for (int side = 0; side < 2; ++side) {
    int last = -1;  // pavement passed last
    for (int x = 0; x < width; x += kWordBits) {
      const int at = side == 0 ? x : (width - 1) / kWordBits * kWordBits - x;
      const int n = std::min(kWordBits, width - at);
      const std::uint64_t known = test_bytes<U>(state + at, n, [](U s) { return equal_bits(s, U(row_state::known)); });
      if (known == 0) continue;
      const std::uint64_t pavement = known & test_bytes<U>(labels + at, n, is_pavement);
      std::uint64_t carriageway = known & test_bytes<U>(labels + at, n, is_carriageway);
      if (last < 0) {  // only what comes after pavement
        if (pavement == 0) continue;
        carriageway &= side == 0 ? ~low_bits(lowest_set_bit(pavement)) : low_bits(highest_set_bit(pavement) + 1);
      }
      if (carriageway == 0) {
        if (pavement != 0) last = at + (side == 0 ? highest_set_bit(pavement) : lowest_set_bit(pavement));
        continue;
      }
      const int first = side == 0 ? lowest_set_bit(carriageway) : highest_set_bit(carriageway);
      const std::uint64_t before = pavement & (side == 0 ? low_bits(first + 1) : ~low_bits(first));
      if (before != 0) last = at + (side == 0 ? highest_set_bit(before) : lowest_set_bit(before));
      found[static_cast<std::size_t>(side)] = side == 0 ? KerbRange{last, at + first} : KerbRange{at + first, last};
      break;
    }
  }
  return found;
}

// One vote over vanishing columns and slopes. Slopes run in t = s / (1 + |s|), which has them all in -1 .. 1.
struct KerbVote {
  static constexpr int kColumns = 33;
  static constexpr int kSlopes = 128;
  static constexpr std::uint32_t kWeight =
      256;  // of a row that allows one slope only; fewer per slope if it allows more
  double first_x = 0, step_x = 0;
  std::array<double, 2> first_t{}, step_t{};  // left, right
  std::array<std::array<std::uint32_t, kSlopes + 1>, kColumns> votes[2]{};

  void cast(int side, const KerbRange& range, double row_below, int column) noexcept {
    const double x = first_x + step_x * column;
    const auto bin = [&](int at) {
      const double s = (at - x) / row_below;
      return (s / (1 + std::fabs(s)) - first_t[static_cast<std::size_t>(side)]) /
             step_t[static_cast<std::size_t>(side)];
    };
    const double a = bin(range.begin);
    const double b = bin(range.end);
    if (!(b >= 0 && a < kSlopes)) return;
    const int low = static_cast<int>(std::max(a, 0.0));
    const int high = static_cast<int>(std::min(b, kSlopes - 1.0));
    const std::uint32_t weight = kWeight / static_cast<std::uint32_t>(b - a + 1.0);
    auto& row = votes[side][static_cast<std::size_t>(column)];
    row[static_cast<std::size_t>(low)] += weight;
    row[static_cast<std::size_t>(high) + 1] -= weight;  // wraps; the running sum wraps back
  }

  struct Peak {
    std::uint32_t height = 0;
    double t = 0;  // middle of the slopes with that many
  };
  [[nodiscard]] Peak peak(int side, int column) const noexcept {
    std::uint32_t sum = 0;
    Peak best;
    int first = 0;
    int last = -2;
    for (int i = 0; i < kSlopes; ++i) {
      sum += votes[side][static_cast<std::size_t>(column)][static_cast<std::size_t>(i)];
      if (sum > best.height) {
        best.height = sum;
        first = i;
        last = i;
      } else if (sum == best.height && last == i - 1) {
        last = i;
      }
    }
    const auto s = static_cast<std::size_t>(side);
    best.t = first_t[s] + step_t[s] * (0.5 * (first + last) + 0.5);
    return best;
  }
};

inline void find_vanishing_column(const StreetFloor& floor, double x, StreetFloor& out) noexcept {
  out.vanishing_x = x;
  out.vanishing_y = -(floor.constant + floor.per_column * x) / floor.per_row;
}

inline void vote_kerbs(Span<const KerbRange> ranges, Shape shape, const Intrinsics& k, StreetFloor& floor) noexcept {
  constexpr double kSpread = 0.35;  // of the width: how far the street may turn from straight ahead
  constexpr double kAhead = 16;     // rows that have to speak for such a turn
  constexpr std::uint32_t kEnough = 5 * KerbVote::kWeight;
  const int row_step = kerb_row_step(shape);
  KerbVote vote;
  vote.step_x = 2 * kSpread * shape.width / (KerbVote::kColumns - 1);
  vote.first_x = static_cast<double>(k.cx) - kSpread * shape.width;
  vote.first_t = {-1.0, 0.0};
  vote.step_t = {1.0 / KerbVote::kSlopes, 1.0 / KerbVote::kSlopes};
  find_vanishing_column(floor, static_cast<double>(k.cx), floor);
  for (int round = 0; round < 2; ++round) {
    for (int column = 0; column < KerbVote::kColumns; ++column) {
      StreetFloor at;
      find_vanishing_column(floor, vote.first_x + vote.step_x * column, at);
      for (int y = 0; y < shape.height; y += row_step) {
        const double below = y - at.vanishing_y;
        if (!(below > 0.005 * shape.width)) continue;  // too near to the horizon to tell one line from another
        for (int side = 0; side < 2; ++side) {
          const KerbRange& range = ranges[static_cast<std::size_t>(2 * y + side)];
          if (range.end > range.begin) vote.cast(side, range, below, column);
        }
      }
    }
    double most = 0;
    int best = KerbVote::kColumns / 2;
    for (int column = 0; column < KerbVote::kColumns; ++column) {
      const double off =
          std::fabs(vote.first_x + vote.step_x * column - static_cast<double>(k.cx)) / (kSpread * shape.width);
      const double sum = static_cast<double>(vote.peak(0, column).height) +
                         static_cast<double>(vote.peak(1, column).height) - kAhead * KerbVote::kWeight * off;
      if (column > 0 && sum <= most) continue;
      most = sum;
      best = column;
    }
    find_vanishing_column(floor, vote.first_x + vote.step_x * best, floor);
    vote.first_x = floor.vanishing_x - vote.step_x;
    vote.step_x *= 2.0 / (KerbVote::kColumns - 1);
    for (int side = 0; side < 2; ++side) {
      const auto s = static_cast<std::size_t>(side);
      const KerbVote::Peak peak = vote.peak(side, best);
      const double slope = peak.t / (1 - std::fabs(peak.t));
      // The finer round has less weight per slope.
      const bool found = round == 0 ? peak.height >= kEnough : floor.kerb_slope[s] != 0.0 && peak.height > 0;
      if (found) floor.kerb_slope[s] = slope;
      vote.first_t[s] = peak.t - 4 * vote.step_t[s];
      vote.step_t[s] *= 8.0 / KerbVote::kSlopes;
    }
    vote.votes[0] = {};
    vote.votes[1] = {};
  }
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

// The floor of the picture; not valid where there is none.
template <class F, class Executor>
[[nodiscard]] Status find_floor(const StreetFloorParams& params, ImageView<const Vec3f> sheet,
                                ImageView<const Label> labels, ImageView<const std::uint8_t> uncertain,
                                ImageView<const std::uint8_t> state, const Intrinsics& intrinsics, Workspace& workspace,
                                Executor& executor, StreetFloor& floor) {
  const Shape shape = sheet.shape();
  const WorkspaceScope scope(workspace);
  Span<KerbRange> kerbs;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(2 * static_cast<std::size_t>(shape.height), kerbs));
  floor.valid = fit_carriageway(params, sheet, labels, state, intrinsics, floor);
  if (!floor.valid) return {};
  fit_raise(params, sheet, labels, state, floor);
  for_rows(executor, shape.height, [&](int y) {
    if (y % kerb_row_step(shape) != 0) return;
    const auto found = find_kerbs<F>(params, labels.row(y), state.row(y), shape.width);
    kerbs[2 * static_cast<std::size_t>(y)] = found[0];
    kerbs[2 * static_cast<std::size_t>(y) + 1] = found[1];
  });
  vote_kerbs(kerbs, shape, intrinsics, floor);
  kerbs_behind_vehicles(params, sheet, labels, uncertain, state, intrinsics, floor);
  return {};
}

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_STREET_FLOOR_HPP
