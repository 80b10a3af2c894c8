// SPDX-License-Identifier: Apache-2.0
// What lies between neighbouring points of a laser.
//
// A scanner samples its lines more densely than the picture across them: 7 px along and 25 px across with 32 lines at
// 1400 px. In a field that is smooth in the plane such points are spikes, for a point binds it next to nothing; a line
// binds it. So neighbours on a line whose inverse depth differs by little, one surface as a rule, are joined by
// a straight line in inverse depth, and so is what two lines meet at one distance: poles, and facades that face
// the camera. What is joined is a source like the points.
#ifndef NPSIM_DEPTH_DETAIL_FILL_SCAN_LINES_HPP
#define NPSIM_DEPTH_DETAIL_FILL_SCAN_LINES_HPP

#include <cmath>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/depth/detail/object_borders.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace depth_detail {

// The width of the picture over them: how far apart neighbours on a line are at most, and things on other lines; how
// far aside these may lie.
inline constexpr int kScanAlong = 48;
inline constexpr int kScanAcross = 24;
inline constexpr int kScanAside = 400;
inline constexpr int kScanTilt_px = 2;             // rows by which a line may rise to its next point
inline constexpr float kScanSameDistance = 0.01F;  // of 1/z

struct ScanPoint {
  int x = -1, y = -1;  // none
};

// The next point within `reach` steps of (dx, dy) from a pixel, or up to `aside` pixels beside it. is_point(x, y): not
// outside the picture.
template <class IsPoint>
[[nodiscard]] ScanPoint next_point(const IsPoint& is_point, int x, int y, int dx, int dy, int reach,
                                   int aside) noexcept {
  for (int i = 1; i <= reach; ++i) {
    for (int k = 0; k <= 2 * aside; ++k) {
      const int off = k % 2 == 0 ? k / 2 : -(k + 1) / 2;
      const ScanPoint at{x + dx * i + (dx == 0 ? off : 0), y + dy * i + (dy == 0 ? off : 0)};
      if (is_point(at.x, at.y)) return at;
    }
  }
  return {};
}

inline constexpr std::int32_t kJoined = -1;  // steps of a pixel between joined points: no point that lines start from

// Joins the point (x, y) to the next one that way, if they are of one object and their inverse depth differs by no more
// than `differ` of the larger. Where two joints cross, the nearer hides the other.
inline void join_to_next(const ObjectMap& objects, int x, int y, int dx, int dy, int reach, int aside, float differ,
                         ImageView<float> w, ImageView<std::int32_t> steps) noexcept {
  const auto is_source = [&](int u, int v) { return steps.contains(u, v) && steps(u, v) == 0; };
  const ScanPoint to = next_point(is_source, x, y, dx, dy, reach, aside);
  if (to.x < 0) return;
  const float a = w(x, y);
  const float b = w(to.x, to.y);
  if (!(std::fabs(a - b) <= differ * (a > b ? a : b)) || !objects.same(x, y, to.x, to.y)) return;
  const int n = dx != 0 ? to.x - x : to.y - y;
  for (int i = 1; i < n; ++i) {
    const float t = static_cast<float>(i) / static_cast<float>(n);
    const int u = x + static_cast<int>(std::lround(t * static_cast<float>(to.x - x)));
    const int v = y + static_cast<int>(std::lround(t * static_cast<float>(to.y - y)));
    const float between = a + (b - a) * t;
    const bool taken = steps(u, v) == kJoined ? w(u, v) > between : w(u, v) > 0.0F;  // measured, or dropped
    if (taken || !objects.same(x, y, u, v)) continue;
    w(u, v) = between;
    steps(u, v) = kJoined;
  }
}

// The next point on the same line. along: how much neighbours on a line may differ.
inline void join_along_line(float along, const ObjectMap& objects, int x, int y, ImageView<float> w,
                            ImageView<std::int32_t> steps) noexcept {
  join_to_next(objects, x, y, 1, 0, w.width() / kScanAlong, kScanTilt_px, along, w, steps);
}

// w: inverse depth, 0 where nothing was measured; steps: 0 where it is given. Pixels between joined points become given
// ones.
inline void join_scan_lines(float along, const ObjectMap& objects, ImageView<float> w,
                            ImageView<std::int32_t> steps) noexcept {
  const int width = w.width();
  for (int y = 0; y < w.height(); ++y) {
    for (int x = 0; x < width; ++x) {
      if (steps(x, y) != 0) continue;
      join_to_next(objects, x, y, 0, 1, width / kScanAcross, width / kScanAside, kScanSameDistance, w, steps);
      join_along_line(along, objects, x, y, w, steps);
    }
  }
  for (int y = 0; y < w.height(); ++y) {
    for (int x = 0; x < w.width(); ++x) {
      if (steps(x, y) == kJoined) steps(x, y) = 0;
    }
  }
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_FILL_SCAN_LINES_HPP
