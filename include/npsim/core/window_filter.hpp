// SPDX-License-Identifier: Apache-2.0
// Means over square windows of planes where only some pixels count, the guided filter made of them (He, Sun and Tang,
// "Guided image filtering", IEEE Trans. Pattern Analysis and Machine Intelligence 35(6), 2013), and quantiles.
//
// Planes that are read are functions of the pixel, so that products and masks need no image of their own.
// Running sums in double, one row or one strip of columns at a time: cost per pixel is the same for every radius, and
// the bits for every number of threads. Windows are cut at the border.
#ifndef NPSIM_CORE_WINDOW_FILTER_HPP
#define NPSIM_CORE_WINDOW_FILTER_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// f(x, y) of every pixel.
template <class F, class Executor>
void for_pixels(Shape shape, Executor& executor, F&& f) {
  for_rows(executor, shape.height, [&](int y) {
    for (int x = 0; x < shape.width; ++x) f(x, y);
  });
}

// Quantile of a plane's values where inside(x, y); the histogram is over [-16, 16), and has kQuantileBins where nothing
// else is wanted.
inline constexpr std::size_t kQuantileBins = 4096;
template <class Inside, class Value>
[[nodiscard]] float plane_quantile(Shape shape, const Inside& inside, const Value& value, float quantile,
                                   Span<std::uint32_t> histogram) {
  for (std::uint32_t& h : histogram) h = 0;
  const auto bins = static_cast<float>(histogram.size());
  std::uint64_t n = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (!inside(x, y)) continue;
      ++histogram[static_cast<std::size_t>(clamp_to((value(x, y) + 16.0F) * bins / 32.0F, 0.0F, bins - 1.0F))];
      ++n;
    }
  }
  const auto wanted = static_cast<std::uint64_t>(quantile * static_cast<float>(n));
  std::uint64_t below = 0;
  for (std::size_t i = 0; i < histogram.size(); ++i) {
    below += histogram[i];
    if (below > wanted) return (static_cast<float>(i) + 0.5F) * 32.0F / bins - 16.0F;
  }
  return 0.0F;
}

inline constexpr std::size_t kWindowColumns = 64;  // of a strip

// out = sum of in(x, y) over the window; `in` is a function of the pixel, so that products need no plane of their own.
// `rows` is overwritten, and is not `out`.
template <class In, class Executor>
void window_sum(const In& in, int radius, ImageView<float> rows, ImageView<float> out, Executor& executor) {
  const int width = out.width();
  const int height = out.height();
  for_rows(executor, height, [&](int y) {
    double sum = 0.0;
    for (int x = 0; x < std::min(radius, width); ++x) sum += static_cast<double>(in(x, y));
    for (int x = 0; x < width; ++x) {
      if (x + radius < width) sum += static_cast<double>(in(x + radius, y));
      if (x - radius > 0) sum -= static_cast<double>(in(x - radius - 1, y));
      rows(x, y) = static_cast<float>(sum);
    }
  });
  executor.for_chunks(static_cast<std::size_t>(width), kWindowColumns, [&](std::size_t begin, std::size_t end) {
    double sums[kWindowColumns] = {};
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
                   ImageView<float> out, Executor& executor) {
  const WorkspaceScope scope(workspace);
  ImageView<float> rows, count;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(out.shape(), rows));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(out.shape(), count));
  window_sum(weight, radius, rows, count, executor);
  const auto product = [&](int x, int y) {
    const float w = weight(x, y);
    return w > 0.0F ? w * value(x, y) : 0.0F;
  };
  window_sum(product, radius, rows, out, executor);
  for_rows(executor, out.height(), [&](int y) {
    for (int x = 0; x < out.width(); ++x) {
      const float n = std::max(count(x, y), 0.0F) + prior;
      out(x, y) = n > 1e-3F ? (out(x, y) + prior * rest) / n : rest;
    }
  });
  return {};
}
inline constexpr std::size_t kWindowMeanPlanes = 2;

// The lines  slope guide(x, y) + offset  of the guided filter of `value` by `guide` where `inside`: value is smooth
// where the guide is, and follows its edges, those whose variance exceeds epsilon.
template <class Inside, class Guide, class Value, class Executor>
Status guided_lines(const Inside& inside, const Guide& guide, const Value& value, int radius, float epsilon,
                    Workspace& workspace, ImageView<float> slope, ImageView<float> offset, Executor& executor) {
  const WorkspaceScope scope(workspace);
  const Shape shape = slope.shape();
  ImageView<float> rows, count, gg, gv;
  for (ImageView<float>* p : {&rows, &count, &gg, &gv}) NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, *p));
  const auto masked = [&](auto&& f) { return [&inside, f](int x, int y) { return inside(x, y) ? f(x, y) : 0.0F; }; };
  window_sum(masked([](int, int) { return 1.0F; }), radius, rows, count, executor);
  window_sum(masked(guide), radius, rows, slope, executor);
  window_sum(masked(value), radius, rows, offset, executor);
  window_sum(masked([&](int x, int y) { return guide(x, y) * guide(x, y); }), radius, rows, gg, executor);
  window_sum(masked([&](int x, int y) { return guide(x, y) * value(x, y); }), radius, rows, gv, executor);
  for_pixels(shape, executor, [&](int x, int y) {
    const float n = std::max(count(x, y), 1.0F);
    const float mg = slope(x, y) / n;
    const float mv = offset(x, y) / n;
    const float variance = std::max(gg(x, y) / n - mg * mg, 0.0F);
    const float of_window = (gv(x, y) / n - mg * mv) / (variance + epsilon);
    gg(x, y) = of_window;
    gv(x, y) = mv - of_window * mg;
  });
  window_sum(masked([&](int x, int y) { return gg(x, y); }), radius, rows, slope, executor);
  window_sum(masked([&](int x, int y) { return gv(x, y); }), radius, rows, offset, executor);
  for_pixels(shape, executor, [&](int x, int y) {
    const float n = std::max(count(x, y), 1.0F);
    slope(x, y) /= n;
    offset(x, y) /= n;
  });
  return {};
}
inline constexpr std::size_t kGuidedLinesPlanes = 4;

// The guided filter itself; 0 where not `inside`. out may be `value`'s plane.
template <class Inside, class Guide, class Value, class Executor>
Status guided_filter(const Inside& inside, const Guide& guide, const Value& value, int radius, float epsilon,
                     Workspace& workspace, ImageView<float> out, Executor& executor) {
  const WorkspaceScope scope(workspace);
  ImageView<float> slope, offset;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(out.shape(), slope));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(out.shape(), offset));
  NPSIM_RETURN_IF_ERROR(guided_lines(inside, guide, value, radius, epsilon, workspace, slope, offset, executor));
  for_rows(executor, out.height(), [&](int y) {
    for (int x = 0; x < out.width(); ++x) {
      out(x, y) = inside(x, y) ? slope(x, y) * guide(x, y) + offset(x, y) : 0.0F;
    }
  });
  return {};
}
inline constexpr std::size_t kGuidedFilterPlanes = kGuidedLinesPlanes + 2;

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_WINDOW_FILTER_HPP
