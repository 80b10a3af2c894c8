// SPDX-License-Identifier: Apache-2.0
// How high the carriageway lies over the plane that fits it as a whole, row by row: streets rise and fall.
//
// The image is cut into strips of rows. A strip's height is the median over at most kProfileSamples of its pixels; a
// strip that shows too little takes that of the one above it, and none differs from the one above by more than
// `max_step_m`, so that a strip in which most is wrong does not follow it.
// Memory: 1.3 KiB of stack.
#ifndef NPSIM_DEPTH_DETAIL_ROAD_PROFILE_HPP
#define NPSIM_DEPTH_DETAIL_ROAD_PROFILE_HPP

#include <array>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

inline constexpr int kProfileStrips = 64;
inline constexpr int kProfileSamples = 256;
inline constexpr int kProfileLeast = 24;

class RoadProfile {
 public:
  RoadProfile() noexcept = default;
  // height(x, y, h): false where the pixel is not measured carriageway, else its height over the plane, m.
  template <class Height>
  RoadProfile(int width, int height, float max_step_m, const Height& height_at) noexcept
      : rows_((height + kProfileStrips - 1) / kProfileStrips) {
    std::array<float, kProfileSamples> some;
    bool known = false;
    float last = 0.0F;
    for (int s = 0; s * rows_ < height; ++s) {
      const int pixels = width * rows_;
      const int step = pixels / kProfileSamples + 1;
      std::size_t count = 0;
      for (int i = step / 2; i < pixels && count < some.size(); i += step) {
        const int y = s * rows_ + i / width;
        if (y < height && height_at(i % width, y, some[count])) ++count;
      }
      if (count >= static_cast<std::size_t>(kProfileLeast)) {
        select_nth(some.data(), some.data() + count / 2, some.data() + count);
        const float median = some[count / 2];
        last = known ? clamp_to(median, last - max_step_m, last + max_step_m) : median;
        known = true;
      }
      height_m_[static_cast<std::size_t>(s)] = last;
    }
  }
  [[nodiscard]] float at(int y) const noexcept { return height_m_[static_cast<std::size_t>(y / rows_)]; }

 private:
  int rows_ = 1 << 30;
  std::array<float, kProfileStrips> height_m_{};
};

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_ROAD_PROFILE_HPP
