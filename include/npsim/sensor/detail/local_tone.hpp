// SPDX-License-Identifier: Apache-2.0
// A tone curve that follows the light of each place, as cameras of several exposures have it: the curve that shows a
// range of 120 dB at once leaves little contrast within a lit sign or a dark pavement; this one compresses the light
// that falls there and leaves what is drawn on it.
//
//   y = n T(c) / c,   log2(c + dark) = l + share (base - l),   l = log2(n + dark)
// n: the pixel's largest channel, T: the tone curve (sensor/isp.hpp). share 0 is y = T(n).
// base: l, smooth but for its edges: the guided filter of l by itself (core/window_filter.hpp) over windows of `reach`
// of the picture's height, with steps above `edge_stops` kept. Its lines base = slope l + offset are found in cells of
// 4x4 pixels, of n the largest of the cell's mean red, green and blue, and taken linearly in between at each pixel's
// own l: edges are as sharp as the picture (He and Sun, "Fast guided filter", arXiv 1505.00996, 2015).
// What differs from its base may exceed 1: above kLocalKnee y goes on as the parabola that leaves with the slope 1 and
// arrives at 1 with the slope 0, but not below the one curve's T(n), so flat light is shown as by that.
// Error: lines within 1e-3 of the filter in double precision. By default a step of 8 stops keeps .62 to .68 of its
// height in the base right at the step, .92 half a window away, .99 a window away.
// Cost: see docs/camera.md. Memory: 7/16 of a float per pixel.
#ifndef NPSIM_SENSOR_DETAIL_LOCAL_TONE_HPP
#define NPSIM_SENSOR_DETAIL_LOCAL_TONE_HPP

#include <algorithm>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/sensor/raw.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct LocalToneParams {
  float share = 0.0F;       // of the local contrast that is kept; 0: one curve for the whole picture
  float reach = 0.15F;      // side of the window, of the picture's height
  float edge_stops = 4.0F;  // what steps less is drawn on a surface, what steps more is another light
  float dark = 2e-4F;       // of full scale: light far below differs by noise
};

[[nodiscard]] inline Status validate(const LocalToneParams& p) noexcept {
  const bool good = p.share >= 0.0F && p.share <= 1.0F && p.reach > 0.0F && p.reach <= 1.0F && p.edge_stops >= 0.25F &&
                    p.edge_stops <= 20.0F && p.dark >= 1e-9F && p.dark <= 1.0F;
  return good ? Status()
              : Status(StatusCode::invalid_argument,
                       "local tone: share in [0, 1], reach in (0, 1], edge_stops in [.25, 20], dark in [1e-9, 1]");
}

[[nodiscard]] constexpr bool is_local(const LocalToneParams& p) noexcept { return p.share > 0.0F; }

inline constexpr int kToneCell = 4;
inline constexpr float kLocalKnee = 0.8F;

// base = slope l + offset of every cell; empty where the tone curve is one.
struct ToneLines {
  ImageView<float> slope;
  ImageView<float> offset;
};

[[nodiscard]] constexpr Shape tone_cells(Shape shape) noexcept {
  return {(shape.width + kToneCell - 1) / kToneCell, (shape.height + kToneCell - 1) / kToneCell};
}

// Of the lines, and of what tone_lines() takes besides.
[[nodiscard]] constexpr std::size_t tone_lines_bytes(const LocalToneParams& p, Shape shape) noexcept {
  return is_local(p) ? 2 * allocation_bytes<float>(tone_cells(shape).pixels()) : 0;
}
[[nodiscard]] constexpr std::size_t tone_lines_workspace_bytes(const LocalToneParams& p, Shape shape) noexcept {
  const std::size_t planes = 1 + kGuidedLinesPlanes;
  return kWorkspaceAlignment + (is_local(p) ? planes * allocation_bytes<float>(tone_cells(shape).pixels()) : 0);
}

// plane: as capture() makes it, of a picture of `shape`, times gains and clipped to [.., 1].
template <class Executor>
[[nodiscard]] Status tone_lines(const LocalToneParams& params, Mosaic mosaic, Shape shape, ImageView<const float> plane,
                                ToneLines lines, Workspace& workspace, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Shape cells = tone_cells(shape);
  if (plane.empty() || plane.shape() != mosaic_shape(shape) || lines.slope.shape() != cells ||
      lines.offset.shape() != cells) {
    return {StatusCode::shape_mismatch, "local tone: needs the picture's plane and its cells"};
  }
  const WorkspaceScope scope(workspace);
  ImageView<float> light;  // l
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(cells, light));
  for_rows(executor, cells.height, [&](int cy) {
    for (int cx = 0; cx < cells.width; ++cx) {
      float sum[4] = {};  // by place in the quad; cells begin at even pixels
      int count[4] = {};
      for (int y = kToneCell * cy; y < std::min(kToneCell * (cy + 1), shape.height); ++y) {
        const float* row = plane.row(y) + kMosaicMargin;
        for (int x = kToneCell * cx; x < std::min(kToneCell * (cx + 1), shape.width); ++x) {
          const int place = 2 * (y & 1) + (x & 1);
          sum[place] += row[x];
          ++count[place];
        }
      }
      float channel[3] = {};
      int samples[3] = {};
      for (int i = 0; i < 4; ++i) {
        const int filter = filter_at(mosaic, i & 1, i >> 1);
        channel[filter] += sum[i];
        samples[filter] += count[i];
      }
      float most = 0.0F;
      for (int i = 0; i < 3; ++i) most = max_of(most, channel[i] / static_cast<float>(max_of(samples[i], 1)));
      light(cx, cy) = simd::log2(simd::scalar::F32(most + params.dark)).value;
    }
  });
  const auto everywhere = [](int, int) { return true; };
  const auto l = [&light](int x, int y) { return light(x, y); };
  const float half = 0.5F * params.reach * static_cast<float>(shape.height) / static_cast<float>(kToneCell);
  // A step of s stops through the middle of a window has the variance s^2 / 4.
  const float epsilon = 0.25F * params.edge_stops * params.edge_stops;
  return guided_lines(everywhere, l, l, max_of(1, static_cast<int>(half + 0.5F)), epsilon, workspace, lines.slope,
                      lines.offset, executor);
}

inline constexpr int kMostLines = 128;

// The lines of n pixels x, x + 1, ... of row y, between the middles of the cells; n at most kMostLines.
inline void lines_of_pixels(const ToneLines& lines, int x, int y, int n, float* slope, float* offset) noexcept {
  // Pixel i lies (i + 2) mod 4 + .5 quarters of a cell behind the middle of cell (i + 2) / 4 - 1.
  constexpr int kHalf = kToneCell / 2;
  const auto share = [](int i) { return (static_cast<float>((i + kHalf) % kToneCell) + 0.5F) * (1.0F / kToneCell); };
  const int first = (x + kHalf) / kToneCell - 1;
  const int count = (x + n - 1 + kHalf) / kToneCell - first + 1;
  const auto mix = [&](const ImageView<float>& of, float* to) {
    const float* upper = of.row(max_of((y + kHalf) / kToneCell - 1, 0));
    const float* lower = of.row(std::min((y + kHalf) / kToneCell, of.height() - 1));
    float row[kMostLines / kToneCell + 2];
    for (int i = 0; i < count; ++i) {
      const int cell = clamp_to(first + i, 0, of.width() - 1);
      row[i] = upper[cell] + (lower[cell] - upper[cell]) * share(y);
    }
    for (int i = 0; i < n; ++i) {
      const int cell = (x + i + kHalf) / kToneCell - 1 - first;
      to[i] = row[cell] + (row[cell + 1] - row[cell]) * share(x + i);
    }
  };
  mix(lines.slope, slope);
  mix(lines.offset, offset);
}

// What the tone curve is applied to in place of n.
template <class F>
[[nodiscard]] F local_light(const LocalToneParams& params, F n, F slope, F offset) noexcept {
  const F l = simd::log2(n + F(params.dark));
  const F base = fma(slope, l, offset);
  return max(simd::exp2(fma(F(params.share), base - l, l)) - F(params.dark), F(0.0F));
}

// The shoulder of what exceeds its base. global: T(n).
template <class F>
[[nodiscard]] F below_white(F y, F global) noexcept {
  const F t = simd::clamp((y - F(kLocalKnee)) * F(1.0F / (1.0F - kLocalKnee)), 0.0F, 2.0F);
  const F shoulder = fma(F(1.0F - kLocalKnee) * t, fma(t, F(-0.25F), F(1.0F)), F(kLocalKnee));
  return select(y > F(kLocalKnee), max(shoulder, min(y, global)), y);
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_DETAIL_LOCAL_TONE_HPP
