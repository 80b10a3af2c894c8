// SPDX-License-Identifier: Apache-2.0
// Means over square windows of planes where only some pixels count, and the guided filter made of them.
//
// Running sums in double, one row or one strip of columns at a time: cost per pixel is the same for every radius, and
// the bits for every number of threads. Windows are cut at the border.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_PLANE_FILTER_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_PLANE_FILTER_HPP

#include <algorithm>
#include <cstddef>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/simd/math.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

using Plane = ImageView<float>;

inline constexpr std::size_t kFilterRows = 16;     // of a chunk
inline constexpr std::size_t kFilterColumns = 64;  // of a strip

// The same bits everywhere.
[[nodiscard]] inline float log2_of(float x) noexcept { return simd::log2(simd::scalar::F32(x)).value; }
[[nodiscard]] inline float exp2_of(float x) noexcept { return simd::exp2(simd::scalar::F32(x)).value; }

// f(x, y) of every pixel.
template <class F, class Executor>
void for_pixels(Shape shape, Executor& executor, F&& f) {
  executor.for_chunks(static_cast<std::size_t>(shape.height), kFilterRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      for (int x = 0; x < shape.width; ++x) f(x, static_cast<int>(row));
    }
  });
}

// out = sum of in(x, y) over the window; `in` is a function of the pixel, so that products need no plane of their own.
// `rows` is overwritten, and is not `out`.
template <class In, class Executor>
void window_sum(const In& in, int radius, Plane rows, Plane out, Executor& executor) {
  const int width = out.width();
  const int height = out.height();
  executor.for_chunks(static_cast<std::size_t>(height), kFilterRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const int y = static_cast<int>(row);
      double sum = 0.0;
      for (int x = 0; x < std::min(radius, width); ++x) sum += static_cast<double>(in(x, y));
      for (int x = 0; x < width; ++x) {
        if (x + radius < width) sum += static_cast<double>(in(x + radius, y));
        if (x - radius > 0) sum -= static_cast<double>(in(x - radius - 1, y));
        rows(x, y) = static_cast<float>(sum);
      }
    }
  });
  executor.for_chunks(static_cast<std::size_t>(width), kFilterColumns, [&](std::size_t begin, std::size_t end) {
    double sums[kFilterColumns] = {};
    const auto add = [&](int y, double sign) {
      const float* row = rows.row(y);
      for (std::size_t x = begin; x < end; ++x) sums[x - begin] += sign * static_cast<double>(row[x]);
    };
    for (int y = 0; y < std::min(radius, height); ++y) add(y, 1.0);
    for (int y = 0; y < height; ++y) {
      if (y + radius < height) add(y + radius, 1.0);
      if (y - radius > 0) add(y - radius - 1, -1.0);
      float* to = out.row(y);
      for (std::size_t x = begin; x < end; ++x) to[x] = static_cast<float>(sums[x - begin]);
    }
  });
}

// out = the weighted mean of value, shrunk towards `rest` as if `prior` more pixels of that value stood in the window.
template <class Weight, class Value, class Executor>
Status window_mean(const Weight& weight, const Value& value, int radius, float prior, float rest, Workspace& workspace,
                   Plane out, Executor& executor) {
  const WorkspaceScope scope(workspace);
  Plane rows, count;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(out.shape(), rows));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(out.shape(), count));
  window_sum(weight, radius, rows, count, executor);
  const auto product = [&](int x, int y) {
    const float w = weight(x, y);
    return w > 0.0F ? w * value(x, y) : 0.0F;
  };
  window_sum(product, radius, rows, out, executor);
  for_pixels(out.shape(), executor, [&](int x, int y) {
    const float n = std::max(count(x, y), 0.0F) + prior;
    out(x, y) = n > 1e-3F ? (out(x, y) + prior * rest) / n : rest;
  });
  return {};
}
inline constexpr std::size_t kWindowMeanPlanes = 2;

// Guided filter (He, Sun, Tang 2013) of `value` by `guide` where `inside`; elsewhere out is 0. out may be `value`'s
// plane. Smooth where the guide is, and follows its edges: those whose variance exceeds epsilon.
template <class Inside, class Guide, class Value, class Executor>
Status guided_filter(const Inside& inside, const Guide& guide, const Value& value, int radius, float epsilon,
                     Workspace& workspace, Plane out, Executor& executor) {
  const WorkspaceScope scope(workspace);
  const Shape shape = out.shape();
  Plane rows, count, mean_g, mean_v, gg, gv;
  for (Plane* p : {&rows, &count, &mean_g, &mean_v, &gg, &gv}) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, *p));
  }
  const auto masked = [&](auto&& f) { return [&inside, f](int x, int y) { return inside(x, y) ? f(x, y) : 0.0F; }; };
  window_sum(masked([](int, int) { return 1.0F; }), radius, rows, count, executor);
  window_sum(masked(guide), radius, rows, mean_g, executor);
  window_sum(masked(value), radius, rows, mean_v, executor);
  window_sum(masked([&](int x, int y) { return guide(x, y) * guide(x, y); }), radius, rows, gg, executor);
  window_sum(masked([&](int x, int y) { return guide(x, y) * value(x, y); }), radius, rows, gv, executor);
  for_pixels(shape, executor, [&](int x, int y) {
    const float n = std::max(count(x, y), 1.0F);
    const float mg = mean_g(x, y) / n;
    const float mv = mean_v(x, y) / n;
    const float variance = std::max(gg(x, y) / n - mg * mg, 0.0F);
    const float slope = (gv(x, y) / n - mg * mv) / (variance + epsilon);
    gg(x, y) = slope;
    gv(x, y) = mv - slope * mg;
  });
  window_sum(masked([&](int x, int y) { return gg(x, y); }), radius, rows, mean_g, executor);
  window_sum(masked([&](int x, int y) { return gv(x, y); }), radius, rows, mean_v, executor);
  for_pixels(shape, executor, [&](int x, int y) {
    const float n = std::max(count(x, y), 1.0F);
    out(x, y) = inside(x, y) ? (mean_g(x, y) * guide(x, y) + mean_v(x, y)) / n : 0.0F;
  });
  return {};
}
inline constexpr std::size_t kGuidedFilterPlanes = 6;

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_PLANE_FILTER_HPP
