// SPDX-License-Identifier: Apache-2.0
// Depth of an object's uncertain pixels: from its kept ones by levels, or the object's median. Part of
// complete_foreground.hpp.
//
// Scratch is the memory of the layer's own vertices, which nothing else needs before they are unprojected: z holds the
// depth, x says whether a pixel has been put on a list, y the pixel that follows it on the list.
//
// Invariant: a level is computed from earlier levels only, then it becomes known as a whole, so the order of visits
// does not matter. Cost: linear in the uncertain pixels of objects; serial. Memory: 3 KiB of stack. Error: a mean of at
// most four floats, summed in double: half an ulp each level; the median is exact.
#ifndef NPSIM_MESH_DETAIL_FOREGROUND_GROWTH_HPP
#define NPSIM_MESH_DETAIL_FOREGROUND_GROWTH_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/mesh/detail/components.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace mesh_detail {

struct ObjectPixels {
  PixelLinks links;
  ImageView<std::uint64_t> known;  // members that have their depth
  ImageView<Vec3f> pixels;         // scratch, see above; x is 0 at first

  [[nodiscard]] bool is_known(int x, int y) const noexcept { return PixelLinks::at(known, x, y); }
  void set_known(int x, int y) const noexcept {
    known(x / kWordBits, y) |= std::uint64_t{1} << static_cast<unsigned>(x % kWordBits);
  }
  [[nodiscard]] bool is_waiting(int x, int y) const noexcept { return !is_known(x, y) && pixels(x, y).x == 0.0F; }

  // f(i, j) for the neighbours in the same object.
  template <class F>
  void for_joined(int x, int y, F&& f) const {
    if (links.joined_left(x, y)) f(x - 1, y);
    if (links.joined_right(x, y)) f(x + 1, y);
    if (links.joined_above(x, y)) f(x, y - 1);
    if (links.joined_below(x, y)) f(x, y + 1);
  }
};

// A list of pixels that is threaded through the pixels themselves.
class PixelList {
 public:
  explicit PixelList(const ObjectPixels& planes) noexcept
      : pixels_(planes.pixels), width_(static_cast<std::uint32_t>(planes.links.width)) {}

  [[nodiscard]] bool empty() const noexcept { return empty_; }
  void push(int x, int y) noexcept {
    const std::uint32_t pixel = static_cast<std::uint32_t>(y) * width_ + static_cast<std::uint32_t>(x);
    pixels_(x, y).x = 1.0F;
    if (empty_) {
      first_ = pixel;
    } else {
      std::memcpy(&at(last_).y, &pixel, sizeof(pixel));
    }
    last_ = pixel;
    empty_ = false;
  }
  // f(x, y) for each, those included that f appends.
  template <class F>
  void for_each(F&& f) const {
    if (empty_) return;
    std::uint32_t pixel = first_;
    for (;;) {
      f(static_cast<int>(pixel % width_), static_cast<int>(pixel / width_));
      if (pixel == last_) return;
      std::memcpy(&pixel, &at(pixel).y, sizeof(pixel));
    }
  }

 private:
  [[nodiscard]] Vec3f& at(std::uint32_t pixel) const noexcept {
    return pixels_(static_cast<int>(pixel % width_), static_cast<int>(pixel / width_));
  }
  ImageView<Vec3f> pixels_;
  std::uint32_t width_;
  std::uint32_t first_ = 0;
  std::uint32_t last_ = 0;
  bool empty_ = true;
};

// Members without a depth beside one that has it.
[[nodiscard]] inline std::uint64_t first_level(const ObjectPixels& planes, int w, int y) noexcept {
  const PixelLinks& links = planes.links;
  const std::uint64_t known = planes.known(w, y);
  const std::uint64_t unknown = links.member(w, y) & ~known;
  if (unknown == 0) return 0;
  const bool more = w + 1 < links.member.width();
  std::uint64_t beside = links.left(w, y) & left_bits(w > 0 ? planes.known(w - 1, y) : 0, known);
  beside |= right_bits(links.left(w, y), more ? links.left(w + 1, y) : 0) &
            right_bits(known, more ? planes.known(w + 1, y) : 0);
  if (y > 0) beside |= links.above(w, y) & planes.known(w, y - 1);
  if (y + 1 < links.height()) beside |= links.above(w, y + 1) & planes.known(w, y + 1);
  return unknown & beside;
}

// Breadth-first search from every pixel that is known.
inline void grow_objects(const ObjectPixels& planes) {
  PixelList level(planes);
  for (int y = 0; y < planes.links.height(); ++y) {
    for (int w = 0; w < planes.known.width(); ++w) {
      for_set_bits(first_level(planes, w, y), [&](int i) { level.push(kWordBits * w + i, y); });
    }
  }
  while (!level.empty()) {
    level.for_each([&planes](int x, int y) {
      double sum = 0;
      double count = 0;
      planes.for_joined(x, y, [&](int i, int j) {
        if (!planes.is_known(i, j)) return;
        sum += static_cast<double>(planes.pixels(i, j).z);
        count += 1;
      });
      planes.pixels(x, y).z = static_cast<float>(sum / count);  // the pixel that put this one on the list counts
    });
    PixelList next(planes);
    level.for_each([&](int x, int y) {
      planes.set_known(x, y);
      planes.for_joined(x, y, [&](int i, int j) {
        if (planes.is_waiting(i, j)) next.push(i, j);
      });
    });
    level = next;
  }
}

// The lower median of the positive depths of a list, 0 if there is none.
[[nodiscard]] inline float lower_median(const PixelList& list, ImageView<const Vec3f> pixels) {
  constexpr std::size_t kFew = 256;
  float few[kFew];
  std::size_t n = 0;
  list.for_each([&](int x, int y) {
    const float z = pixels(x, y).z;
    if (!(z > 0.0F)) return;
    if (n < kFew) few[n] = z;
    ++n;
  });
  if (n == 0) return 0.0F;
  std::size_t rank = (n - 1) / 2;
  if (n <= kFew) {
    std::nth_element(few, few + rank, few + n);
    return few[rank];
  }
  // Positive floats are ordered like their bits: eight bits at a time, the highest first.
  std::uint32_t found = 0;
  for (const unsigned shift : {24U, 16U, 8U, 0U}) {
    std::size_t number[256] = {};
    list.for_each([&](int x, int y) {
      const float z = pixels(x, y).z;
      if (!(z > 0.0F)) return;
      std::uint32_t key = 0;
      std::memcpy(&key, &z, sizeof(key));
      if (std::uint64_t{key} >> (shift + 8) == std::uint64_t{found} >> (shift + 8)) ++number[key >> shift & 0xFFU];
    });
    std::uint32_t byte = 0;
    for (; rank >= number[byte]; ++byte) rank -= number[byte];
    found |= byte << shift;
  }
  float median = 0;
  std::memcpy(&median, &found, sizeof(median));
  return median;
}

// Gives every object that nothing has grown into the median depth of its pixels. Its z is the sheet's depth until then.
inline void stand_up_uncertain(const ObjectPixels& planes) {
  for (int y = 0; y < planes.links.height(); ++y) {
    for (int w = 0; w < planes.known.width(); ++w) {
      for (;;) {
        const std::uint64_t left_out = planes.links.member(w, y) & ~planes.known(w, y);
        if (left_out == 0) break;
        PixelList object(planes);
        object.push(kWordBits * w + lowest_set_bit(left_out), y);
        object.for_each([&](int x0, int y0) {
          planes.for_joined(x0, y0, [&](int i, int j) {
            if (planes.is_waiting(i, j)) object.push(i, j);
          });
        });
        const float z = lower_median(object, planes.pixels);
        object.for_each([&](int x0, int y0) {
          planes.pixels(x0, y0).z = z;
          planes.set_known(x0, y0);
        });
      }
    }
  }
}

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_FOREGROUND_GROWTH_HPP
