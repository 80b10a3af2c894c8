// SPDX-License-Identifier: Apache-2.0
// Continues a field that is known on some pixels smoothly to all others, by a pyramid ("pull-push").
//
// Every coarser level holds the mean of what is known and the share of the cell that is known. On the way back a cell
// takes its own mean by that share and for the rest what the coarser level says there, bilinearly. So near the known
// pixels the result is theirs, farther off an average over ever wider surroundings, in the end over all.
// Invariant: known pixels keep their value; the result lies within the range of the known values (0 if there are none).
// Cost: O(pixels). Memory: 8/3 floats per pixel.
#ifndef NPSIM_DEPTH_DETAIL_EXTEND_FIELD_HPP
#define NPSIM_DEPTH_DETAIL_EXTEND_FIELD_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

[[nodiscard]] constexpr std::size_t extend_field_workspace_bytes(Shape shape) noexcept {
  std::size_t bytes = kWorkspaceAlignment + allocation_bytes<float>(shape.pixels());
  while (shape.width > 1 || shape.height > 1) {
    shape = {(shape.width + 1) / 2, (shape.height + 1) / 2};
    bytes += 2 * allocation_bytes<float>(shape.pixels());
  }
  return bytes;
}

namespace depth_detail {

struct FieldLevel {
  ImageView<float> value;  // mean of what is known of a cell
  ImageView<float> share;  // of the cell that is known
};

inline constexpr int kFieldMaxLevels = 32;

inline void coarsen_field(const FieldLevel& fine, const FieldLevel& coarse) noexcept {
  for (int y = 0; y < coarse.value.height(); ++y) {
    for (int x = 0; x < coarse.value.width(); ++x) {
      float sum = 0.0F;
      float share = 0.0F;
      for (int j = 2 * y; j < 2 * y + 2; ++j) {
        for (int i = 2 * x; i < 2 * x + 2; ++i) {
          if (!fine.value.contains(i, j)) continue;
          sum += fine.share(i, j) * fine.value(i, j);
          share += fine.share(i, j);
        }
      }
      coarse.value(x, y) = share > 0.0F ? sum / share : 0.0F;
      coarse.share(x, y) = 0.25F * share;
    }
  }
}

// Cells of the finer level have their centres at quarters between the coarse ones'.
[[nodiscard]] inline float coarse_value_at(ImageView<const float> coarse, int x, int y) noexcept {
  const int near_x = x / 2;
  const int near_y = y / 2;
  const int far_x = near_x + ((x & 1) != 0 ? 1 : -1);
  const int far_y = near_y + ((y & 1) != 0 ? 1 : -1);
  const auto at = [&](int i, int j) {
    i = i < 0 ? 0 : (i < coarse.width() ? i : coarse.width() - 1);
    j = j < 0 ? 0 : (j < coarse.height() ? j : coarse.height() - 1);
    return coarse(i, j);
  };
  return 0.5625F * at(near_x, near_y) + 0.1875F * (at(far_x, near_y) + at(near_x, far_y)) + 0.0625F * at(far_x, far_y);
}

}  // namespace depth_detail

// field: in place. known: 1 where it is given, else 0.
template <class Executor>
[[nodiscard]] Status extend_field(ImageView<const std::uint8_t> known, ImageView<float> field, Workspace& workspace,
                                  Executor& executor) noexcept {
  using depth_detail::FieldLevel;
  Shape shape = field.shape();
  if (known.shape() != shape) return {StatusCode::shape_mismatch, "extend_field: field and known must have one shape"};
  if (field.empty()) return {};
  const WorkspaceScope scope(workspace);
  FieldLevel level[depth_detail::kFieldMaxLevels];
  int levels = 1;
  level[0].value = field;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, level[0].share));
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) level[0].share(x, y) = known(x, y) != 0 ? 1.0F : 0.0F;
  }
  while (shape.width > 1 || shape.height > 1) {
    shape = {(shape.width + 1) / 2, (shape.height + 1) / 2};
    FieldLevel& coarse = level[levels];
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, coarse.value));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, coarse.share));
    depth_detail::coarsen_field(level[levels - 1], coarse);
    ++levels;
  }
  if (levels == 1) {
    if (known(0, 0) == 0) field(0, 0) = 0.0F;
    return {};
  }
  for (int l = levels - 2; l >= 0; --l) {
    const FieldLevel& fine = level[l];
    const ImageView<const float> coarse = level[l + 1].value;
    executor.for_chunks(static_cast<std::size_t>(fine.value.height()), 16, [&](std::size_t begin, std::size_t end) {
      for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
        for (int x = 0; x < fine.value.width(); ++x) {
          const float share = fine.share(x, y);
          if (share == 1.0F) continue;
          const float around = depth_detail::coarse_value_at(coarse, x, y);
          fine.value(x, y) = share > 0.0F ? share * fine.value(x, y) + (1.0F - share) * around : around;
        }
      }
    });
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_EXTEND_FIELD_HPP
