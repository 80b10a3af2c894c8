// SPDX-License-Identifier: Apache-2.0
// What of the sheet is background: the states of its pixels, and the sheet with what is not known left out, 64 pixels
// at a time. Part of complete_background.hpp.
//
// A pixel is removed where it shows a foreground object that goes (all of the foreground, or the segments that are
// marked with other than 0 in the state plane). Known: a vertex of the sheet that is neither removed nor uncertain.
// Blocked: no surface, and not removed. Missing: the rest.
//
// Exact. Cost: one pass over labels, masks and sheet; one over states and vertices, which in place writes only around
// what is missing. Memory: none.
#ifndef NPSIM_MESH_DETAIL_BACKGROUND_STATE_HPP
#define NPSIM_MESH_DETAIL_BACKGROUND_STATE_HPP

#include <algorithm>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/detail/foreground/pixels.hpp"
#include "npsim/mesh/interpolate_rows.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/simd/bytes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace mesh_detail {

// A row of states; true where a blocked pixel has a vertex in the sheet. removed: labels that go, or nullptr where
// `state` has marks. uncertain, surface: may be nullptr.
template <class F>
bool find_states(const LabelSet* removed, const Label* labels, const std::uint8_t* uncertain,
                 const std::uint8_t* surface, const Vec3f* sheet, int width, std::uint8_t* state) noexcept {
  using U = simd::BytesOf<F>;
  bool blocked_vertex = false;
  const LabelTest<U> goes(removed != nullptr ? *removed : LabelSet());
  for (int x = 0; x < width; x += kWordBits) {
    const int n = std::min(kWordBits, width - x);
    const std::uint64_t gone = removed != nullptr ? test_bytes<U>(labels + x, n, goes) : nonzero_bits<U>(state + x, n);
    const std::uint64_t shows = surface != nullptr ? nonzero_bits<U>(surface + x, n) : low_bits(n);
    const std::uint64_t doubt = uncertain != nullptr ? nonzero_bits<U>(uncertain + x, n) : 0;
    std::uint64_t there = 0;
    std::uint64_t empty = 0;
    for (int i = 0; i < n; i += F::lanes) {
      const F z = simd::load3<F>(&sheet[x + i].x, std::min(F::lanes, n - i)).z;
      there |= std::uint64_t{bits(z > F(0.0F))} << static_cast<unsigned>(i);
      empty |= std::uint64_t{bits(z == F(0.0F))} << static_cast<unsigned>(i);
    }
    const std::uint64_t known = shows & ~gone & ~doubt & there;
    const std::uint64_t blocked = low_bits(n) & ~shows & ~gone;
    blocked_vertex = blocked_vertex || (blocked & ~empty) != 0;
    for (int i = 0; i < n; i += U::lanes) {
      const auto shift = static_cast<unsigned>(i);
      const U states =
          U::from_bits(known >> shift, row_state::known) | U::from_bits(blocked >> shift, row_state::blocked);
      if (n - i >= U::lanes) {
        states.store(state + x + i);
      } else {
        states.store(state + x + i, n - i);
      }
    }
  }
  return blocked_vertex;
}

// A row of the sheet where the state is known, {0, 0, 0} elsewhere. kept may be the sheet itself.
template <class F>
void keep_known(const std::uint8_t* state, const Vec3f* sheet, int width, Vec3f* kept) noexcept {
  using U = simd::BytesOf<F>;
  for (int x = 0; x < width; x += kWordBits) {
    const int n = std::min(kWordBits, width - x);
    const std::uint64_t known = test_bytes<U>(state + x, n, [](U s) { return equal_bits(s, U(row_state::known)); });
    if (known == low_bits(n)) {
      if (kept != sheet) std::copy(sheet + x, sheet + x + n, kept + x);
      continue;
    }
    for (int i = 0; i < n; i += F::lanes) {
      const int lanes = std::min(F::lanes, n - i);
      const simd::F32x3<F> v = simd::load3<F>(&sheet[x + i].x, lanes);
      const auto here = F::MaskType::from_bits(static_cast<std::uint32_t>(known >> static_cast<unsigned>(i)));
      const F zero(0.0F);
      simd::store3(&kept[x + i].x,
                   simd::F32x3<F>{select(here, v.x, zero), select(here, v.y, zero), select(here, v.z, zero)}, lanes);
    }
  }
}

}  // namespace mesh_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_DETAIL_BACKGROUND_STATE_HPP
