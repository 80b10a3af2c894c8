// SPDX-License-Identifier: Apache-2.0
// Linear images of single lights, kept small, and their weighted sum: light adds up, so a night is
//   L(pixel) = sum_i w_i * L_i(pixel),   w_i linear RGB, channel by channel
// and a further night costs one pass over the images.
//
// An image lies in tiles of 32 x 32 pixels; tiles that stay below a threshold at weight 1 are left out, and
// left_out_cd_m2 bounds what that takes from a pixel. Values are floats of 16 bits without a sign: 6 bits of exponent, 10 of mantissa,
// from 2^-40 to 2^24, where half floats end at 65504 and lose their precision below 6e-5.
// Error: 2^-11 of each value that is kept; below 2^-40 all of it. Sums are float, in the order of the images, so the bits
// depend on no executor. Memory: 6 KiB a kept tile, 4 bytes an image and tile; while images are made, 24 KiB a tile.
// Cost: reading what is kept, once.
#ifndef NPSIM_RENDER_LIGHT_IMAGES_HPP
#define NPSIM_RENDER_LIGHT_IMAGES_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr int kLightTile = 32;  // px
inline constexpr std::size_t kLightTilePixels = std::size_t{kLightTile} * kLightTile;
inline constexpr std::size_t kLightBlock = 3 * kLightTilePixels;  // values of a tile: red, then green, then blue
inline constexpr std::uint32_t kNoBlock = 0xFFFFFFFFU;

// What one batch makes at a time: one alone is slower by a twentieth, more are no quicker and take 32 bytes a pixel each.
inline constexpr std::size_t kLightsAtOnce = 2;
inline constexpr std::size_t kLightLanes = 3 * kLightsAtOnce;

namespace light_image_detail {

inline constexpr int kExponentOffset = (127 - 40) << 10;

// Half a unit up; 0 from NaN and from below the range, the greatest from above it.
[[nodiscard]] inline std::uint16_t pack(float x) noexcept {
  const float positive = x > 0.0F ? x : 0.0F;
  std::uint32_t bits = 0;
  std::memcpy(&bits, &positive, sizeof bits);
  const int value = static_cast<int>((bits + 0x1000U) >> 13U) - kExponentOffset;
  return static_cast<std::uint16_t>(value > 0 ? (value < 0xFFFF ? value : 0xFFFF) : 0);
}

template <class F>
[[nodiscard]] F unpack(const std::uint16_t* packed) noexcept {
  using I = typename F::Int;
  const I value = I::load_u16(packed);
  return select(value == I(0), F(0.0F), bitcast_float((value + I(kExponentOffset)) << 13));
}

}  // namespace light_image_detail

[[nodiscard]] constexpr Shape light_tiles(Shape shape) noexcept {
  return {(shape.width + kLightTile - 1) / kLightTile, (shape.height + kLightTile - 1) / kLightTile};
}

struct LightImages {
  Shape shape;
  Span<const std::uint32_t> block;   // of image i and tile t: i * tiles + t -> its place among the blocks, kNoBlock
  Span<const std::uint16_t> values;  // kLightBlock a block
  std::size_t count = 0;
  float left_out_cd_m2 = 0;  // at most so much is missing from any pixel, where all weights are 1

  [[nodiscard]] std::size_t bytes() const noexcept { return values.size() * sizeof(std::uint16_t); }
};

// Calls f(tile, left, top, right, bottom) for every tile, in parallel.
template <class Executor, class F>
void for_light_tiles(Shape shape, Executor& executor, const F& f) {
  const Shape tiles = light_tiles(shape);
  executor.for_chunks(tiles.pixels(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t t = begin; t < end; ++t) {
      const int left = static_cast<int>(t % static_cast<std::size_t>(tiles.width)) * kLightTile;
      const int top = static_cast<int>(t / static_cast<std::size_t>(tiles.width)) * kLightTile;
      f(t, left, top, std::min(left + kLightTile, shape.width), std::min(top + kLightTile, shape.height));
    }
  });
}

// Makes images, kLightsAtOnce at a time: their tiles are staged in any order, then kept.
class LightImageBuilder {
 public:
  [[nodiscard]] static constexpr std::size_t index_bytes(Shape shape, std::size_t images) noexcept {
    return allocation_bytes<std::uint32_t>(images * light_tiles(shape).pixels());
  }
  [[nodiscard]] static constexpr std::size_t staging_bytes(Shape shape) noexcept {
    const std::size_t tiles = light_tiles(shape).pixels();
    return allocation_bytes<std::uint16_t>(kLightsAtOnce * tiles * kLightBlock) +
           allocation_bytes<float>(kLightsAtOnce * tiles) + allocation_bytes<float>(tiles);
  }

  // The index outlives the builder; nothing else may be taken from the workspace between start() and the last keep().
  Status start(Shape shape, float threshold_cd_m2, Span<std::uint32_t> block, Workspace& workspace) noexcept {
    tiles_ = light_tiles(shape).pixels();
    threshold_ = threshold_cd_m2;
    block_ = block;
    NPSIM_RETURN_IF_ERROR(workspace.allocate(kLightsAtOnce * tiles_ * kLightBlock, staged_));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(kLightsAtOnce * tiles_, greatest_));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(tiles_, left_out_));
    for (std::uint32_t& b : block_) b = kNoBlock;
    for (float& l : left_out_) l = 0.0F;
    return {};
  }

  // One tile of the light in a slot below kLightsAtOnce; at(i) is its luminance at weight 1 in pixel i of the tile, row
  // by row, beyond the picture 0. `any`: whether there is light in it.
  template <class At>
  void stage(std::size_t slot, std::size_t tile, bool any, const At& at) noexcept {
    std::uint16_t* const block = staged_.data() + (slot * tiles_ + tile) * kLightBlock;
    float greatest = 0.0F;
    for (std::size_t i = 0; any && i < kLightTilePixels; ++i) {
      const Vec3f light = at(i);
      block[i] = light_image_detail::pack(light.x);
      block[kLightTilePixels + i] = light_image_detail::pack(light.y);
      block[2 * kLightTilePixels + i] = light_image_detail::pack(light.z);
      greatest = std::max(greatest, luminance(light));
    }
    greatest_[slot * tiles_ + tile] = greatest;
  }

  // Takes over all tiles of a slot as image i.
  Status keep(std::size_t image, std::size_t slot, Workspace& workspace) noexcept {
    std::size_t kept = 0;
    for (std::size_t t = 0; t < tiles_; ++t) kept += greatest_[slot * tiles_ + t] > threshold_ ? 1U : 0U;
    Span<std::uint16_t> room;
    NPSIM_RETURN_IF_ERROR(workspace.ensure(allocation_bytes<std::uint16_t>(kept * kLightBlock) + kWorkspaceAlignment));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(kept * kLightBlock, room));
    if (values_.empty()) values_ = room.sub(0, 0);
    std::size_t next = 0;
    for (std::size_t t = 0; t < tiles_; ++t) {
      const float greatest = greatest_[slot * tiles_ + t];
      if (greatest > threshold_) {
        const std::uint16_t* const from = staged_.data() + (slot * tiles_ + t) * kLightBlock;
        std::copy(from, from + kLightBlock, room.data() + next * kLightBlock);
        block_[image * tiles_ + t] = static_cast<std::uint32_t>(values_.size() / kLightBlock + next++);
      } else {
        left_out_[t] += greatest;
      }
    }
    // Allocations of whole blocks lie one behind the other.
    values_ = Span<std::uint16_t>(values_.data(), values_.size() + room.size());
    return {};
  }

  [[nodiscard]] Span<const std::uint16_t> values() const noexcept { return values_; }
  [[nodiscard]] float left_out_cd_m2() const noexcept {
    float most = 0.0F;
    for (const float l : left_out_) most = std::max(most, l);
    return most;
  }

 private:
  std::size_t tiles_ = 0;
  float threshold_ = 0.0F;
  Span<std::uint32_t> block_;
  Span<std::uint16_t> staged_;
  Span<float> greatest_;  // luminance in a staged tile
  Span<float> left_out_;  // of each tile, by all images
  Span<std::uint16_t> values_;
};

// out = sum over the images of weight * image; 0 where there is none. `weights`: one per image.
template <class F = simd::F32, class Executor>
Status sum_light_images(const LightImages& images, Span<const Vec3f> weights, ImageView<Vec3f> out,
                        Executor& executor) {
  const std::size_t tiles = light_tiles(images.shape).pixels();
  if (weights.size() != images.count || out.shape() != images.shape || images.block.size() != images.count * tiles) {
    return Status(StatusCode::shape_mismatch, "light images: one weight per image, and an image of their size");
  }
  for_light_tiles(images.shape, executor, [&](std::size_t tile, int left, int top, int right, int bottom) {
    float sum[kLightBlock] = {};
    for (std::size_t i = 0; i < weights.size(); ++i) {
      const std::uint32_t block = images.block[i * tiles + tile];
      const Vec3f weight = weights[i];
      if (block == kNoBlock || weight == Vec3f{}) continue;
      const std::uint16_t* const values = images.values.data() + std::size_t{block} * kLightBlock;
      const F channel[3] = {F(weight.x), F(weight.y), F(weight.z)};
      for (std::size_t p = 0; p < kLightBlock; p += static_cast<std::size_t>(F::lanes)) {
        const F light = light_image_detail::unpack<F>(values + p);
        (F::load(sum + p) + channel[p / kLightTilePixels] * light).store(sum + p);
      }
    }
    for (int y = top; y < bottom; ++y) {
      for (int x = left; x < right; ++x) {
        const auto p = static_cast<std::size_t>((y - top) * kLightTile + x - left);
        out(x, y) = {sum[p], sum[kLightTilePixels + p], sum[2 * kLightTilePixels + p]};
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_LIGHT_IMAGES_HPP
