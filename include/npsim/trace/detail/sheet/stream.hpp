// SPDX-License-Identifier: Apache-2.0
// Many rays through a sheet at once, in one thread.
//
// A ray alone waits: for a node's bounds, then for its test, then for the branch that depends on it. Here kStreamRays
// rays are under way together. Each turn takes those that have a quad, a tile, sixteen tiles or a node before them, one
// kind after the other, so that the machine works on several rays at any time and hardly a branch is to be guessed, and
// asks for what they read next a turn before it is read.
// Invariant: every ray takes the steps that it takes alone (walk.hpp), so the answers are those of single rays, bit for
// bit, for any order and number of rays and lanes.
// Cost: 0.5 to 0.9 of the time of single rays. Memory: 10 KiB of stack.
#ifndef NPSIM_TRACE_DETAIL_SHEET_STREAM_HPP
#define NPSIM_TRACE_DETAIL_SHEET_STREAM_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/bits.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/span.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/simd/fixed.hpp"
#include "npsim/trace/detail/sheet/layout.hpp"
#include "npsim/trace/detail/sheet/ray.hpp"
#include "npsim/trace/detail/sheet/walk.hpp"
#include "npsim/trace/detail/triangle.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
inline constexpr int kStreamRays = 32;

namespace sheet_detail {

// A ray under way.
template <class Query>
struct StreamRay {
  SheetRay ray;
  SheetWalk walk;
  typename Query::Answer answer;
  const SheetTrace* sheet;
  std::size_t index;         // in the caller's span; its size: no ray
  std::size_t layer;         // that follows
  std::uint32_t first_face;  // of this layer
  std::uint32_t next_face;   // of the one that follows
  std::uint32_t faces;       // of the tile
  std::uint32_t quads;       // of the tile, to be tested
};

template <class T>
NPSIM_ALWAYS_INLINE void prefetch_object(const T& object) noexcept {
  const auto* line = reinterpret_cast<const unsigned char*>(&object);
  for (std::size_t i = 0; i < sizeof(T); i += 64) simd::prefetch(line + i);
}

// Rays that have the same before them, in no order that matters.
struct StreamList {
  std::uint8_t rays[kStreamRays];
  int count = 0;
  void add(int i) noexcept { rays[count++] = static_cast<std::uint8_t>(i); }
  // Empties the list for a loop over its n rays; what the loop adds does not overtake it.
  [[nodiscard]] int take() noexcept {
    const int n = count;
    count = 0;
    return n;
  }
};

template <class F, class Query>
class Stream {
 public:
  Stream(Span<const SheetTrace> layers, const SheetBounds& bounds, Span<const Ray> rays, const Query& query,
         Span<const std::uint8_t> active) noexcept
      : layers_(layers), bounds_(bounds), input_(rays), active_(active), query_(query) {}

  void run() noexcept {
    for (int i = 0; i < kStreamRays; ++i) {
      slots_[i].layer = layers_.size();
      slots_[i].index = input_.size();
      list(Step::none).add(i);
    }
    for (;;) {
      supply();
      if (list(Step::tile).count + list(Step::tiles).count + list(Step::nodes).count + with_quads_.count == 0) return;
      visit_faces();
      visit_leaves();
      visit_tiles();
      visit_nodes();
      fetch();
    }
  }

 private:
  using Slot = StreamRay<Query>;

  [[nodiscard]] StreamList& list(Step step) noexcept { return lists_[static_cast<int>(step)]; }

  void go_on(int i) noexcept { list(next_step(slots_[i].walk)).add(i); }

  void supply() noexcept {
    StreamList& idle = list(Step::none);
    const int n = idle.take();
    for (int k = 0; k < n; ++k) {
      const int i = idle.rays[k];
      const Step step = next_way(slots_[i]);
      if (step != Step::none) list(step).add(i);
    }
  }

  // The ray's next layer, or the next ray's first; none: there is no more.
  [[nodiscard]] Step next_way(Slot& s) noexcept {
    for (;;) {
      while (s.layer < layers_.size()) {
        s.sheet = &layers_[s.layer++];
        s.first_face = s.next_face;
        s.next_face += sheet_face_count(s.sheet->vertices.shape());
        if (s.sheet->levels > 0) return begin_walk<Query::kOrdered>(*s.sheet, s.ray, s.walk);
      }
      if (s.index < input_.size()) query_.end(s.answer, s.index);
      s.index = input_.size();
      while (!active_.empty() && next_ < input_.size() && active_[next_] == 0) ++next_;
      if (next_ == input_.size()) return Step::none;
      start(s, next_++);
    }
  }

  void start(Slot& s, std::size_t index) noexcept {
    const Ray& ray = input_[index];
    if (!make_sheet_ray(bounds_, ray, s.ray)) {
      query_.miss(index);
      return;
    }
    query_.begin(s.answer, s.ray);
    s.index = index;
    if (s.ray.everything) {
      static_cast<void>(trace_one<F>(layers_, bounds_, ray, query_, s.answer));
      return;
    }
    s.layer = 0;
    s.next_face = 0;
  }

  void visit_nodes() noexcept {
    StreamList& nodes = list(Step::nodes);
    const int n = nodes.take();
    for (int k = 0; k < n; ++k) {
      const int i = nodes.rays[k];
      Slot& s = slots_[i];
      add_children<Query::kOrdered>(test_node_at<F>(*s.sheet, s.ray, s.walk.level, s.walk.x, s.walk.y), s.walk);
      go_on(i);
    }
  }

  void visit_tiles() noexcept {
    StreamList& tiles = list(Step::tiles);
    const int n = tiles.take();
    for (int k = 0; k < n; ++k) {
      const int i = tiles.rays[k];
      Slot& s = slots_[i];
      add_children<Query::kOrdered>(test_tiles_at<F>(*s.sheet, s.ray, s.walk.x, s.walk.y), s.walk);
      go_on(i);
    }
  }

  void visit_leaves() noexcept {
    StreamList& leaves = list(Step::tile);
    const int n = leaves.take();
    for (int k = 0; k < n; ++k) {
      const int i = leaves.rays[k];
      Slot& s = slots_[i];
      s.quads = visit_tile<F, Query::kOrdered>(*s.sheet, s.ray, s.walk, s.faces);
      if (s.quads == 0) {
        go_on(i);
        continue;
      }
      with_quads_.add(i);
      const auto first = static_cast<unsigned>(lowest_set_bit(s.quads)) ^ s.walk.flip;
      const int x = 4 * s.walk.x + static_cast<int>(first & 3U);
      const int y = 4 * s.walk.y + static_cast<int>(first >> 2U);
      simd::prefetch(s.sheet->vertices.row(y) + x);
      simd::prefetch(s.sheet->vertices.row(y + 1) + x);
      simd::prefetch(s.sheet->quads.row(y) + x);
    }
  }

  void visit_faces() noexcept {
    const int n = with_quads_.take();
    for (int k = 0; k < n; ++k) {
      const int i = with_quads_.rays[k];
      Slot& s = slots_[i];
      const float end = s.ray.s_max;
      const auto on_hit = [&](std::uint32_t face, const TriangleHit& hit) noexcept {
        return query_.meet(s.answer, s.ray, s.first_face + face, hit);
      };
      if (visit_quads(*s.sheet, s.ray, s.walk, s.quads, s.faces, on_hit)) {
        s.layer = layers_.size();
        s.walk.pending = 0;
      } else if (s.ray.s_max < end) {
        forget_beyond<F>(*s.sheet, s.ray, s.walk);
      }
      go_on(i);
    }
  }

  // Asks for what the next turn reads.
  void fetch() noexcept {
    const StreamList& nodes = list(Step::nodes);
    for (int k = 0; k < nodes.count; ++k) {
      const Slot& s = slots_[nodes.rays[k]];
      prefetch_object(
          s.sheet->nodes[s.sheet->first[s.walk.level] + node_index(*s.sheet, s.walk.level, s.walk.x, s.walk.y)]);
    }
    const StreamList& tiles = list(Step::tiles);
    for (int k = 0; k < tiles.count; ++k) {
      const Slot& s = slots_[tiles.rays[k]];
      prefetch_object(s.sheet->tiles[node_index(*s.sheet, 0, s.walk.x, s.walk.y)]);
    }
    const StreamList& leaves = list(Step::tile);
    for (int k = 0; k < leaves.count; ++k) {
      const Slot& s = slots_[leaves.rays[k]];
      prefetch_relief(*s.sheet, place_of_tile(*s.sheet, s.walk.x, s.walk.y));
    }
  }

  Span<const SheetTrace> layers_;
  const SheetBounds& bounds_;
  Span<const Ray> input_;
  Span<const std::uint8_t> active_;
  const Query& query_;
  std::size_t next_ = 0;
  StreamList lists_[4];
  StreamList with_quads_;
  Slot slots_[kStreamRays];
};

// `active`: 0 where a ray is left out and its answer stays as it is; empty: all are traced.
template <class F, class Query>
void trace_stream(Span<const SheetTrace> layers, const SheetBounds& bounds, Span<const Ray> rays, const Query& query,
                  Span<const std::uint8_t> active) noexcept {
  if (layers.empty()) {
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (active.empty() || active[i] != 0) query.miss(i);
    }
    return;
  }
  Stream<F, Query>(layers, bounds, rays, query, active).run();
}

}  // namespace sheet_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_TRACE_DETAIL_SHEET_STREAM_HPP
