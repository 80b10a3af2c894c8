// SPDX-License-Identifier: Apache-2.0
// Gives back what the outlines of signs have taken of what is behind them, and those of poles and signals of the sky.
//
// Labels are drawn as polygons around signs, a little too wide or some pixels beside them, and networks make poles
// twice as thick as they are. By day nobody sees it; at night a sign shines by its sheeting, and the wall within its
// outline shines as a border that no sign has; a pole before the sky is a black one. So an outline is walked from
// outside inwards for as long as the picture shows the colour that it has a little further outside of where the walk
// began, at most kReach of the picture's width; what is walked over is of the class there. Where a quarter of the walks
// would go on, or half of a thing would go, it is as bright as the wall and keeps its outline, and so does a pole where
// nothing of it would be left across. A border of the wall's colour, or the wall's grey, within a sign that ends before
// that is lost.
// Invariant: labels of other classes, things with numbers of their own and pixels of marked lamps stay. Deterministic.
// Cost: four passes over the labels, some operations per pixel of things. Memory: sign_outlines_workspace_bytes().
#ifndef NPSIM_DEPTH_DETAIL_GIVEN_SIGN_OUTLINES_HPP
#define NPSIM_DEPTH_DETAIL_GIVEN_SIGN_OUTLINES_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

[[nodiscard]] constexpr std::size_t sign_outlines_workspace_bytes(Shape shape) noexcept {
  return 2 * allocation_bytes<std::uint32_t>(shape.pixels()) + 2 * allocation_bytes<std::uint8_t>(shape.pixels()) +
         kWorkspaceAlignment;
}

namespace depth_detail {

inline constexpr LabelSet kBehindSigns = LabelSet::of(label::building, label::wall, label::sky);
inline constexpr LabelSet kOutlined = kPoleLabels | kSignLabels;

class SignOutlines {
 public:
  SignOutlines(ImageView<const Rgb8> picture, ImageView<const std::uint16_t> instances,
               ImageView<const std::uint16_t> marks, ImageView<Label> labels) noexcept
      : picture_(picture),
        instances_(instances),
        marks_(marks),
        labels_(labels),
        width_(static_cast<std::uint32_t>(labels.width())),
        apart_px_(clamp_to(static_cast<int>(kApart * static_cast<float>(labels.width()) + 0.5F), 2, kFarthest)),
        reach_px_(clamp_to(static_cast<int>(kReach * static_cast<float>(labels.width()) + 0.5F), 1, kFarthest)) {}

  [[nodiscard]] Status allocate(Workspace& workspace) noexcept {
    NPSIM_RETURN_IF_ERROR(workspace.allocate(labels_.shape().pixels(), list_));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(labels_.shape(), from_));
    NPSIM_RETURN_IF_ERROR(workspace.allocate_image(labels_.shape(), open_));
    return workspace.allocate_image(labels_.shape(), steps_);
  }

  void run() noexcept {
    walk();
    for (int y = 0; y < labels_.height(); ++y) {
      for (int x = 0; x < labels_.width(); ++x) open_(x, y) = is_thing(x, y) ? 1 : 0;
    }
    for (int y = 0; y < labels_.height(); ++y) {
      for (int x = 0; x < labels_.width(); ++x) {
        if (open_(x, y) != 0) clear(take_piece(open_, x, y, list_));
      }
    }
  }

 private:
  static constexpr float kReach = 1.0F / 160.0F;
  static constexpr float kApart = 1.0F / 400.0F;  // beside an outline that is exact lies a blend of both
  static constexpr int kFarthest = 120;           // px; steps are bytes
  static constexpr int kNoise = 12;               // of 8 bits: sensor, compression, the wall's own grain
  static constexpr int kX[4] = {1, -1, 0, 0};
  static constexpr int kY[4] = {0, 0, 1, -1};

  [[nodiscard]] bool is_thing(int x, int y) const noexcept {
    if (!labels_.contains(x, y) || !kOutlined.contains(labels_(x, y))) return false;
    return (instances_.empty() || instances_(x, y) == 0) && (marks_.empty() || marks_(x, y) == 0);
  }
  [[nodiscard]] static bool lies_behind(Label thing, Label l) noexcept {
    return thing == label::traffic_sign ? kBehindSigns.contains(l) : l == label::sky;
  }
  [[nodiscard]] bool is_of(int x, int y, Label l) const noexcept {
    return labels_.contains(x, y) && labels_(x, y) == l;
  }
  [[nodiscard]] std::uint32_t pixel(int x, int y) const noexcept {
    return static_cast<std::uint32_t>(y) * width_ + static_cast<std::uint32_t>(x);
  }
  [[nodiscard]] int x_of(std::uint32_t p) const noexcept { return place_of(p, labels_.width()).x; }
  [[nodiscard]] int y_of(std::uint32_t p) const noexcept { return place_of(p, labels_.width()).y; }

  [[nodiscard]] static bool near(std::uint8_t a, std::uint8_t b) noexcept { return (a > b ? a - b : b - a) <= kNoise; }
  // From `outside` on, a step further.
  void reach(int x, int y, std::uint32_t outside, int steps) noexcept {
    const Rgb8 a = picture_(x, y);
    const Rgb8 b = picture_(x_of(outside), y_of(outside));
    if (steps_(x, y) != 0 || !near(a.r, b.r) || !near(a.g, b.g) || !near(a.b, b.b)) return;
    steps_(x, y) = static_cast<std::uint8_t>(steps);
    from_(x, y) = outside;
    list_[count_++] = pixel(x, y);
  }
  void walk() noexcept {
    for (std::uint8_t& s : steps_.pixels()) s = 0;
    for (int y = 0; y < labels_.height(); ++y) {
      for (int x = 0; x < labels_.width(); ++x) {
        if (!is_thing(x, y)) continue;
        for (int k = 0; k < 4; ++k) {
          const int u = x + kX[k];
          const int v = y + kY[k];
          if (!labels_.contains(u, v) || !lies_behind(labels_(x, y), labels_(u, v))) continue;
          int apart = 1;
          while (apart < apart_px_ && is_of(x + (apart + 1) * kX[k], y + (apart + 1) * kY[k], labels_(u, v))) ++apart;
          if (apart == apart_px_) reach(x, y, pixel(x + apart * kX[k], y + apart * kY[k]), 1);
        }
      }
    }
    for (std::size_t next = 0; next < count_; ++next) {
      const int x = x_of(list_[next]);
      const int y = y_of(list_[next]);
      if (steps_(x, y) > reach_px_) continue;
      for (int k = 0; k < 4; ++k) {
        if (is_thing(x + kX[k], y + kY[k])) reach(x + kX[k], y + kY[k], from_(x, y), steps_(x, y) + 1);
      }
    }
  }

  // Of the thing whose pixels are the first `count` of the list.
  void clear(std::size_t count) noexcept {
    std::size_t walked = 0;
    std::size_t begun = 0;
    std::size_t gone_on = 0;
    for (const std::uint32_t p : list_.sub(0, count)) {
      const int steps = steps_(x_of(p), y_of(p));
      walked += is_given_back(steps) ? 1U : 0U;
      begun += steps == 1 ? 1U : 0U;
      gone_on += steps > reach_px_ ? 1U : 0U;
    }
    if (2 * walked >= count || 4 * gone_on >= begun) return;
    for (const std::uint32_t p : list_.sub(0, count)) {
      const int x = x_of(p);
      const int y = y_of(p);
      const bool stays = kPoleLabels.contains(labels_(x, y)) && is_given_back(steps_(x, y)) && !leaves_core(x, y);
      if (stays) from_(x, y) = p;
    }
    for (const std::uint32_t p : list_.sub(0, count)) {
      const int x = x_of(p);
      const int y = y_of(p);
      if (is_given_back(steps_(x, y))) labels_(x, y) = labels_(x_of(from_(x, y)), y_of(from_(x, y)));
    }
  }
  // Whether something of a pole is left on the way from outside through (x, y): an arm as grey as the sky is no rim.
  [[nodiscard]] bool leaves_core(int x, int y) const noexcept {
    const int across = x - x_of(from_(x, y));
    const int down = y - y_of(from_(x, y));
    const bool along_row = across * across >= down * down;
    const int dx = along_row ? (across > 0 ? 1 : -1) : 0;
    const int dy = along_row ? 0 : (down > 0 ? 1 : -1);
    for (int k = 1; k <= reach_px_ && is_thing(x + k * dx, y + k * dy); ++k) {
      if (!is_given_back(steps_(x + k * dx, y + k * dy))) return true;
    }
    return false;
  }
  [[nodiscard]] bool is_given_back(int steps) const noexcept { return steps > 0 && steps <= reach_px_; }

  ImageView<const Rgb8> picture_;
  ImageView<const std::uint16_t> instances_;
  ImageView<const std::uint16_t> marks_;
  ImageView<Label> labels_;
  std::uint32_t width_;
  int apart_px_;
  int reach_px_;
  Span<std::uint32_t> list_;
  std::size_t count_ = 0;          // of the list, while it is walked
  ImageView<std::uint32_t> from_;  // the pixel outside, or itself where that stays
  ImageView<std::uint8_t> open_;   // things that were not cleared yet
  ImageView<std::uint8_t> steps_;  // from it, up to one more than may be; 0: not walked over
};

}  // namespace depth_detail

// labels: in place. instances, marks of lamps: 0: none; may be empty.
[[nodiscard]] inline Status clear_sign_outlines(ImageView<const Rgb8> picture, ImageView<const std::uint16_t> instances,
                                                ImageView<const std::uint16_t> marks, ImageView<Label> labels,
                                                Workspace& workspace) noexcept {
  const Shape shape = labels.shape();
  const auto fits = [&](ImageView<const std::uint16_t> plane) { return plane.empty() || plane.shape() == shape; };
  if (picture.shape() != shape || !fits(instances) || !fits(marks)) {
    return {StatusCode::shape_mismatch, "sign outlines: all planes must have one shape"};
  }
  const WorkspaceScope scope(workspace);
  NPSIM_RETURN_IF_ERROR(workspace.ensure(sign_outlines_workspace_bytes(shape)));
  depth_detail::SignOutlines outlines(picture, instances, marks, labels);
  NPSIM_RETURN_IF_ERROR(outlines.allocate(workspace));
  outlines.run();
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_GIVEN_SIGN_OUTLINES_HPP
