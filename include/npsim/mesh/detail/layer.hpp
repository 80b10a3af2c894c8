// SPDX-License-Identifier: Apache-2.0
// Walking over the rows of a layer (geometry/sheet_layer.hpp), and masks that may be left out.
//
// Invariant: chunks of rows do not depend on the executor. Cost, memory: none of their own.
#ifndef NPSIM_MESH_DETAIL_LAYER_HPP
#define NPSIM_MESH_DETAIL_LAYER_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/geometry/sheet_layer.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace mesh_detail {

inline constexpr std::size_t kRowsPerChunk = 16;

// f(begin, end) for chunks of rows.
template <class Executor, class F>
void for_row_chunks(Executor& executor, int rows, F&& f) {
  executor.for_chunks(rows > 0 ? static_cast<std::size_t>(rows) : 0, kRowsPerChunk,
                      [&f](std::size_t begin, std::size_t end) { f(static_cast<int>(begin), static_cast<int>(end)); });
}

template <class Executor, class F>
void for_rows(Executor& executor, int rows, F&& f) {
  for_row_chunks(executor, rows, [&f](int begin, int end) {
    for (int y = begin; y < end; ++y) f(y);
  });
}

// A mask that may be left out.
template <class T>
[[nodiscard]] inline bool mask_fits(const ImageView<T>& mask, Shape shape) noexcept {
  return mask.data() == nullptr || mask.shape() == shape;
}
[[nodiscard]] inline bool mask_at(const ImageView<const std::uint8_t>& mask, int x, int y, bool missing) noexcept {
  return mask.data() == nullptr ? missing : mask(x, y) != 0;
}

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_LAYER_HPP
