// SPDX-License-Identifier: Apache-2.0
// Marks of signals without the rim of their head.
//
// Who marks the bright pixels of a traffic light marks the white rim of its housing as well, and the rim would shine at
// night. A part of a signal's mark that lies along the edge of the head, which is the group's pixels and those of its
// lenses, is no lens and goes to the group. Heads of which fewer pixels are marked than of their lenses, small ones and
// those with a lens whose state the file names stay as they are.
// Cost: some passes over the boxes of traffic lights.
#ifndef NPSIM_IO_DETAIL_SIGNAL_RIMS_HPP
#define NPSIM_IO_DETAIL_SIGNAL_RIMS_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/io/image.hpp"
#include "npsim/labels/light_classes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {
namespace detail {

// Of one traffic light: [left, right] x [top, bottom].
struct SignalHead {
  int left = 0, top = 0, right = -1, bottom = -1;
  std::size_t own_px = 0;   // of the group
  std::size_t lens_px = 0;  // of its members
};

// Steps to the nearest pixel outside the head's outline, 1 at its edge; 0 outside. Along rows, columns and diagonals.
// Inside is what lies between the head's pixels along its row and its column, marked or not.
[[nodiscard]] inline Image<int> steps_to_edge(const Image<std::uint16_t>& index, const SignalHead& head,
                                              const std::vector<std::uint16_t>& head_of, std::uint16_t group) {
  Image<int> steps({head.right - head.left + 1, head.bottom - head.top + 1});
  std::vector<std::pair<int, int>> rows(static_cast<std::size_t>(steps.height()), {steps.width(), -1});
  std::vector<std::pair<int, int>> columns(static_cast<std::size_t>(steps.width()), {steps.height(), -1});
  for (int y = 0; y < steps.height(); ++y) {
    for (int x = 0; x < steps.width(); ++x) {
      if (head_of[index(head.left + x, head.top + y)] != group) continue;
      auto& row = rows[static_cast<std::size_t>(y)];
      auto& column = columns[static_cast<std::size_t>(x)];
      row = {std::min(row.first, x), std::max(row.second, x)};
      column = {std::min(column.first, y), std::max(column.second, y)};
    }
  }
  const auto inside = [&](int x, int y) {
    const auto& row = rows[static_cast<std::size_t>(y)];
    const auto& column = columns[static_cast<std::size_t>(x)];
    return x >= row.first && x <= row.second && y >= column.first && y <= column.second;
  };
  const auto at = [&](int x, int y) { return steps.view().contains(x, y) ? steps(x, y) : 0; };
  for (int y = 0; y < steps.height(); ++y) {
    for (int x = 0; x < steps.width(); ++x) {
      if (!inside(x, y)) continue;
      steps(x, y) = 1 + std::min({at(x - 1, y), at(x - 1, y - 1), at(x, y - 1), at(x + 1, y - 1)});
    }
  }
  for (int y = steps.height() - 1; y >= 0; --y) {
    for (int x = steps.width() - 1; x >= 0; --x) {
      if (steps(x, y) == 0) continue;
      const int after = 1 + std::min({at(x + 1, y), at(x + 1, y + 1), at(x, y + 1), at(x - 1, y + 1)});
      steps(x, y) = std::min(steps(x, y), after);
    }
  }
  return steps;
}

// Gives the parts along the edge of one head to its group. Returns how many there were.
inline std::size_t trim_rim(const SignalHead& head, const std::vector<std::uint16_t>& head_of, std::uint16_t group,
                            Image<std::uint16_t>& index) {
  constexpr float kRimShare = 0.12F;  // of the narrower side of the head
  constexpr int kNarrow_px = 8;       // all of a smaller head is near its edge
  if (std::min(head.right - head.left, head.bottom - head.top) + 1 < kNarrow_px) return 0;
  const Image<int> steps = steps_to_edge(index, head, head_of, group);
  const auto side_px = static_cast<float>(std::min(steps.width(), steps.height()));
  const int rim_px = std::max(1, static_cast<int>(kRimShare * side_px + 0.5F));
  Image<std::uint8_t> seen(steps.shape());
  std::vector<std::pair<int, int>> part;
  std::size_t trimmed = 0;
  for (int y = 0; y < steps.height(); ++y) {
    for (int x = 0; x < steps.width(); ++x) {
      const std::uint16_t mark = index(head.left + x, head.top + y);
      if (head_of[mark] != group || mark == group || seen(x, y) != 0) continue;
      std::size_t near = 0;
      part.assign(1, {x, y});
      seen(x, y) = 1;
      for (std::size_t i = 0; i < part.size(); ++i) {
        const auto [px, py] = part[i];
        near += steps(px, py) <= rim_px ? 1U : 0U;
        for (int v = py - 1; v <= py + 1; ++v) {
          for (int u = px - 1; u <= px + 1; ++u) {
            if (!steps.view().contains(u, v) || seen(u, v) != 0 || index(head.left + u, head.top + v) != mark) continue;
            seen(u, v) = 1;
            part.emplace_back(u, v);
          }
        }
      }
      if (5 * near <= 3 * part.size()) continue;  // of a rim, more than three pixels of five are so near the edge
      for (const auto& [px, py] : part) index(head.left + px, head.top + py) = group;
      ++trimmed;
    }
  }
  return trimmed;
}

inline std::size_t trim_signal_rims(const std::vector<LightMark>& marks, Image<std::uint16_t>& index) {
  std::vector<std::uint16_t> head_of(marks.size() + 1, 0);  // of each position + 1 that of its traffic light
  for (std::size_t i = 0; i < marks.size(); ++i) {
    const std::size_t group = is_group(marks[i].cls) ? i + 1 : marks[i].group;
    if (group == 0 || marks[group - 1].cls != LightClass::traffic_light_group) continue;
    head_of[i + 1] = static_cast<std::uint16_t>(group);
  }
  std::vector<SignalHead> heads(marks.size() + 1);
  for (int y = 0; y < index.height(); ++y) {
    for (int x = 0; x < index.width(); ++x) {
      const std::uint16_t group = head_of[index(x, y)];
      if (group == 0) continue;
      SignalHead& head = heads[group];
      if (head.right < head.left) head = {x, y, x, y, 0, 0};
      head.left = std::min(head.left, x);
      head.right = std::max(head.right, x);
      head.bottom = y;
      (index(x, y) == group ? head.own_px : head.lens_px) += 1;
    }
  }
  std::size_t trimmed = 0;
  for (const LightMark& mark : marks) {
    if (mark.state != SignalState::unknown && mark.group != 0) heads[mark.group].lens_px = 0;
  }
  for (std::size_t group = 1; group < heads.size(); ++group) {
    const SignalHead& head = heads[group];
    if (head.lens_px == 0 || head.own_px < head.lens_px) continue;
    trimmed += trim_rim(head, head_of, static_cast<std::uint16_t>(group), index);
  }
  return trimmed;
}

}  // namespace detail
}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_SIGNAL_RIMS_HPP
