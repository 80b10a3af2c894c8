// SPDX-License-Identifier: Apache-2.0
// From labels to objects with depth and faces: the steps of mesh/complete.hpp, in their order.
//   - which pixels belong to objects, 64 at a time: members, their links, and those that keep the sheet's depth;
//   - depth of the uncertain ones: from kept ones by levels, or the object's median;
//   - pixels beside thin objects that take over a depth;
//   - vertices, and the faces that join vertices of one object.
//
// Scratch is the memory of the layer's own vertices, which nothing else needs before they are unprojected: z holds the
// depth, x says whether a pixel has been put on a list, y the pixel that follows it on the list.
//
// Invariant: a level is computed from earlier levels only, then it becomes known as a whole, so the order of visits
// does not matter. Cost: a few instructions for 64 pixels without an object, one or two a pixel elsewhere, linear in
// the uncertain pixels; growth is serial. Memory: 3 KiB of stack. Error: a mean of at most four floats, summed in
// double: half an ulp each level; the median is exact.
#ifndef NPSIM_MESH_DETAIL_FOREGROUND_OBJECTS_HPP
#define NPSIM_MESH_DETAIL_FOREGROUND_OBJECTS_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/components.hpp"
#include "npsim/mesh/detail/layer.hpp"
#include "npsim/mesh/detail/rows.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace mesh_detail {

// What objects are found in.
struct ForegroundSource {
  SheetSource sheet;
  LabelSet foreground;
  ImageView<const Label> labels;
  ImageView<const std::uint16_t> instances;  // may be empty, as may the next two
  ImageView<const std::uint8_t> uncertain;
  ImageView<const std::uint8_t> background_state;
};

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

// Row y of the bits, and of the scratch that growth expects. links.above still has to be masked with the members above.
template <class F>
void find_objects(const ForegroundSource& source, const ObjectPixels& planes, int y) noexcept {
  using U = simd::BytesOf<F>;
  using I = typename F::Int;
  const int width = planes.links.width;
  const LabelTest<U> in_foreground(source.foreground);
  const Label* labels = source.labels.row(y);
  const std::uint16_t* instances = source.instances.data() != nullptr ? source.instances.row(y) : nullptr;
  std::uint64_t last_member = 0;
  std::uint64_t last_alike = 0;  // with the pixel on their right
  for (int w = 0; w < planes.known.width(); ++w) {
    const int x = kWordBits * w;
    const int n = std::min(kWordBits, width - x);
    std::uint64_t member = test_bytes<U>(labels + x, n, in_foreground);
    if (member != 0 && source.background_state.data() != nullptr) {
      member &=
          ~test_bytes<U>(source.background_state.row(y) + x, n, [](U s) { return equal_bits(s, U(row_state::known)); });
    }
    planes.links.member(w, y) = member;
    planes.links.left(w, y) = planes.links.above(w, y) = planes.known(w, y) = 0;
    float* scratch = &planes.pixels(x, y).x;
    if (member == 0) {
      for (int i = 0; i < 3 * n; i += F::lanes) F(0.0F).store(scratch + i, std::min(F::lanes, 3 * n - i));
      last_member = 0;
      continue;
    }
    const int pairs = std::min(n, width - 1 - x);
    std::uint64_t alike = equal_bytes<U>(labels + x, labels + x + 1, pairs);
    if (instances != nullptr) alike &= equal_halves<I>(instances + x, instances + x + 1, pairs);
    planes.links.left(w, y) = member & left_bits(last_member, member) & left_bits(last_alike, alike);
    if (y > 0) {
      std::uint64_t above = member & equal_bytes<U>(labels + x, source.labels.row(y - 1) + x, n);
      if (instances != nullptr) above &= equal_halves<I>(instances + x, source.instances.row(y - 1) + x, n);
      planes.links.above(w, y) = above;
    }
    std::uint64_t valid = 0;
    for (int i = 0; i < n; i += F::lanes) {
      const int lanes = std::min(F::lanes, n - i);
      const F z = source.sheet.vertices<F>(x + i, y, lanes).z;
      valid |= std::uint64_t{bits(z > F(0.0F))} << static_cast<unsigned>(i);
      simd::store3(scratch + 3 * i, simd::F32x3<F>{F(0.0F), F(0.0F), z}, lanes);
    }
    const std::uint64_t doubt =
        source.uncertain.data() != nullptr ? nonzero_bits<U>(source.uncertain.row(y) + x, n) : 0;
    planes.known(w, y) = member & valid & ~doubt;
    last_member = member;
    last_alike = alike;
  }
}

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
    select_nth(few, few + rank, few + n);
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

// Members that have none of their object on either side, or neither above nor below.
[[nodiscard]] inline std::uint64_t thin_across(const PixelLinks& links, int w, int y) noexcept {
  if (w < 0 || w >= links.member.width()) return 0;
  const std::uint64_t next = w + 1 < links.member.width() ? links.left(w + 1, y) : 0;
  return links.member(w, y) & ~links.left(w, y) & ~right_bits(links.left(w, y), next);
}
[[nodiscard]] inline std::uint64_t thin_upright(const PixelLinks& links, int w, int y) noexcept {
  if (y < 0 || y >= links.height()) return 0;
  return links.member(w, y) & ~links.above(w, y) & ~(y + 1 < links.height() ? links.above(w, y + 1) : 0);
}

// Row y of `present` becomes the members and the other pixels that take over the depth and the object of a thin member
// beside them. Pulled, from members only, so that pixels are independent.
inline void widen_thin(const PixelLinks& links, ImageView<std::uint64_t> present, ImageView<Vec3f> vertices,
                       ImageView<std::uint32_t> object, int y) noexcept {
  const auto taken = [&links](int x, int row) {
    return x >= links.width || row >= links.height() || PixelLinks::at(links.member, x, row);
  };
  for (int w = 0; w < present.width(); ++w) {
    const std::uint64_t member = links.member(w, y);
    std::uint64_t added = 0;
    const std::uint64_t vacant = ~member & low_bits(std::min(kWordBits, links.width - kWordBits * w));
    if (vacant != 0) {
      const std::uint64_t own = thin_across(links, w, y);
      const std::uint64_t from_left = left_bits(thin_across(links, w - 1, y), own);
      const std::uint64_t from_right = right_bits(own, thin_across(links, w + 1, y));
      const std::uint64_t from_above = thin_upright(links, w, y - 1);
      const std::uint64_t from_below = thin_upright(links, w, y + 1);
      for_set_bits(vacant & (from_left | from_right | from_above | from_below), [&](int i) {
        const int x = kWordBits * w + i;
        const auto take = [&](int from_x, int from_y) {
          const float z = vertices(from_x, from_y).z;
          if (!(z > 0.0F)) return false;
          vertices(x, y).z = z;
          object(x, y) = object(from_x, from_y);
          added |= std::uint64_t{1} << static_cast<unsigned>(i);
          return true;
        };
        if (bit_at(from_left, i) && take(x - 1, y)) return;
        if (bit_at(from_right, i) && taken(x + 2, y) && take(x + 1, y)) return;
        if (bit_at(from_above, i) && take(x, y - 1)) return;
        if (bit_at(from_below, i) && taken(x, y + 2)) static_cast<void>(take(x, y + 1));
      });
    }
    present(w, y) = member | added;
  }
}

// Unprojects the pixels of row y that are present, and clears the others of the words that hold any.
template <class F>
void unproject_row(const Intrinsics& intrinsics, ImageView<const std::uint64_t> present, ImageView<Vec3f> vertices,
                   int y) noexcept {
  const F zero(0.0F);
  for (int w = 0; w < present.width(); ++w) {
    const std::uint64_t word = present(w, y);
    if (word == 0) continue;
    const int end = std::min(kWordBits * (w + 1), vertices.width());
    for (int x = kWordBits * w; x < end; x += F::lanes) {
      const int n = std::min(F::lanes, end - x);
      float* p = &vertices(x, y).x;
      const auto here =
          F::MaskType::from_bits(static_cast<std::uint32_t>(word >> static_cast<unsigned>(x % kWordBits)));
      const F z = select(here, simd::load3<F>(p, n).z, zero);
      const simd::F32x3<F> v = unproject_pixels<F>(intrinsics, x, y, z);
      const auto valid = z > zero;
      simd::store3(p, simd::F32x3<F>{select(valid, v.x, zero), select(valid, v.y, zero), z}, n);
    }
  }
}

// Quads of row y from those of their corners that belong to one object; three of four decide which.
template <class F>
void connect_objects(ImageView<const std::uint64_t> present, ImageView<const std::uint32_t> object,
                     const SheetLayer& layer, int y) noexcept {
  using I = typename F::Int;
  const int width = object.width();
  for (int w = 0; kWordBits * w < width - 1; ++w) {
    const int x = kWordBits * w;
    const int n = std::min(kWordBits, width - 1 - x);
    const bool more = w + 1 < present.width();
    const QuadCorners there = {present(w, y), right_bits(present(w, y), more ? present(w + 1, y) : 0),
                               present(w, y + 1), right_bits(present(w, y + 1), more ? present(w + 1, y + 1) : 0)};
    QuadBits faces = connect_bits(there, 0);
    if ((faces.upper | faces.lower) != 0) {
      std::uint64_t ab = 0, ac = 0, ad = 0, bc = 0, bd = 0;  // same object
      QuadCorners deep = {0, 0, 0, 0};
      std::uint64_t smaller_bc = 0;
      for (int i = 0; i < n; i += F::lanes) {
        const auto put = [i](auto mask) { return std::uint64_t{bits(mask)} << static_cast<unsigned>(i); };
        const auto id = [&](int px, int py) {
          const auto* p = reinterpret_cast<const std::int32_t*>(object.row(py) + px);
          return width - px >= I::lanes ? I::load(p) : I::load(p, std::max(0, width - px));
        };
        const auto depth = [&](int px, int py) {
          return simd::load3<F>(&layer.vertices.row(py)[px].x, clamp_to(width - px, 0, F::lanes)).z;
        };
        const I a = id(x + i, y), b = id(x + i + 1, y), c = id(x + i, y + 1), d = id(x + i + 1, y + 1);
        ab |= put(a == b), ac |= put(a == c), ad |= put(a == d), bc |= put(b == c), bd |= put(b == d);
        const F za = depth(x + i, y), zb = depth(x + i + 1, y), zc = depth(x + i, y + 1), zd = depth(x + i + 1, y + 1);
        const F zero(0.0F);
        deep.a |= put(za > zero), deep.b |= put(zb > zero), deep.c |= put(zc > zero), deep.d |= put(zd > zero);
        smaller_bc |= put(abs(zb - zc) < abs(za - zd));
      }
      const std::uint64_t first = (ab & ac) | (ab & ad) | (ac & ad);  // A belongs to the object that decides; else B
      const QuadCorners own = {deep.a & there.a & (first | ab), deep.b & there.b & (~first | ab),
                               deep.c & there.c & ((first & ac) | (~first & bc)),
                               deep.d & there.d & ((first & ad) | (~first & bd))};
      faces = connect_bits(own, smaller_bc);
    }
    store_quads<F>(faces, layer.quads.row(y) + x, n);
  }
}

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_FOREGROUND_OBJECTS_HPP
