// SPDX-License-Identifier: Apache-2.0
// What the error measures share: which pixels count, sums over an image, and the median.
//
// A mask selects the pixels that differ from 0; an empty one selects all. To judge one label, pass a mask of its
// pixels. Sums run in double along the rows of a chunk and then over the chunks in order. Invariant: the same bits for
// any number of threads. Error: a sum of n terms of one sign, at most 16 rows to a chunk, is within 16 (width + height)
// 2^-53 relative, which is below 1e-10 for every image that the readers take. Memory: one Sum per 16 rows.
#ifndef NPSIM_METRICS_DETAIL_PIXEL_SUMS_HPP
#define NPSIM_METRICS_DETAIL_PIXEL_SUMS_HPP

#include <algorithm>
#include <cmath>
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

inline constexpr std::size_t kMetricsRows = 16;  // rows to a chunk

template <class Sum>
[[nodiscard]] constexpr std::size_t row_sums_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<Sum>(
      chunk_count(static_cast<std::size_t>(shape.height > 0 ? shape.height : 0), kMetricsRows));
}

namespace metrics_detail {

[[nodiscard]] inline bool selected(const ImageView<const std::uint8_t>& mask, int x, int y) noexcept {
  return mask.empty() || mask(x, y) != 0;
}

// Sum is an aggregate of numbers with +=, all 0 at first; add(sum, y) adds row y to it.
template <class Sum, class Executor, class AddRow>
[[nodiscard]] Status sum_rows(int height, Sum& total, Workspace& workspace, Executor& executor,
                              const AddRow& add) noexcept {
  const auto rows = static_cast<std::size_t>(height);
  const WorkspaceScope scope(workspace);
  Span<Sum> partial;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(chunk_count(rows, kMetricsRows), partial));
  executor.for_chunks(rows, kMetricsRows, [&](std::size_t begin, std::size_t end) {
    Sum sum{};
    for (std::size_t y = begin; y < end; ++y) add(sum, static_cast<int>(y));
    partial[begin / kMetricsRows] = sum;
  });
  total = Sum{};
  for (const Sum& sum : partial) total += sum;
  return {};
}

// Of the values that are not NaN, of which there is at least one; for an even number the mean of the middle two.
// Reorders the values. Cost: O(values) on average.
[[nodiscard]] inline double median(Span<float> values) noexcept {
  float* const first = values.data();
  float* const last = std::remove_if(first, first + values.size(), [](float v) { return std::isnan(v); });
  float* const middle = first + (last - first) / 2;
  select_nth(first, middle, last);
  const auto upper = static_cast<double>(*middle);
  if ((last - first) % 2 != 0) return upper;
  return 0.5 * (upper + static_cast<double>(*std::max_element(first, middle, Less{})));
}

}  // namespace metrics_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_METRICS_DETAIL_PIXEL_SUMS_HPP
