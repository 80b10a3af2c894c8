// SPDX-License-Identifier: Apache-2.0
// What light of a lamp arrives at surface points past all that stands between: the costly part of direct light.
//
//   illuminance(p) = V(p) E(p),  E = I_peak * illuminance_per_cd (direct.hpp)
// V is the share of the lamp that point p sees: one shadow ray for a lamp that looks small from p, else four, one per
// quarter of its shape, and where these disagree (a penumbra) k x k more. Rays that leave below the receiver's horizon
// do not count: what lies there is no part of E. An occluder that hides part of the lamp but none of the four rays is
// missed. What hides a part of a lit surface counts as if it hid its share everywhere. A veil, a thing with gaps too
// fine for its mesh, takes its share of a ray, once, however many of its faces the ray crosses. None of it depends on
// strength or colour, so every night of one day shares it.
// Effort follows what is at stake, E times kShine where a surface mirrors or retroreflects, against c, the greater of
// cutoff_lx and cutoff_share times the light that is certain: what the point gets from lamps that every night lights.
// Rays leave from a lattice of a block's points, every `step`th of every `step`th row:
//   E < c         none: V = 0, as for points behind the lamp or turned away from it
//   E < 10 c      step 4 lattice; one ray, to anywhere on the lamp. Points between take the mean of the lattice's
//                 around
//   E < 50 c      step 2 lattice; the same
//   E < 250 c     step 2 lattice; rays as above. Points between take what the lattice's around them agree on. Where
//                 these differ, or a traced neighbour differs from what was taken, they are traced themselves
//   else          step lattice; the same
// Points are asked only on the same surface (within kSamePlane of its plane); one that finds none is traced.
// Error of the illuminance at a point: at most  n_emitters * c  away from shadow edges, plus there  50 c  per lamp,
// plus the penumbra's sampling noise; and shadows that are narrower than a step and meet no point of the lattice within
// a block are lost, and so are those of veils that take less than a quarter of the light there. Faces that carry a
// lamp's own mark do not block it: a lamp is not hidden by its own glass.
// Cost: E for every point of cells that the lamp may reach, and shadow rays in batches of neighbours and one lamp.
// Memory: 40 KiB of stack.
#ifndef NPSIM_RENDER_VISIBILITY_HPP
#define NPSIM_RENDER_VISIBILITY_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/config.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/render/direct.hpp"
#include "npsim/render/surface_points.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/scene.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct VisibilityParams {
  int samples_per_side = 4;    // k of the penumbra, 1..16
  float small_angle = 0.02F;   // longer side / distance below which one ray is enough
  float cutoff_lx = 5e-3F;     // full moon: 0.25 lx; city sky: 0.07 lx
  float cutoff_share = 2e-3F;  // of the illuminance that is certain
  int lattice = 2;             // points; 1, 2, 4 or 8. 1, without cut-off: every point is traced
};

[[nodiscard]] inline Status validate(const VisibilityParams& p) noexcept {
  if (!(p.samples_per_side >= 1 && p.samples_per_side <= 16 && p.cutoff_lx >= 0.0F && p.cutoff_share >= 0.0F &&
        p.small_angle >= 0.0F)) {
    return {StatusCode::invalid_argument, "visibility: samples_per_side in 1..16, cutoff and angle not negative"};
  }
  if (p.lattice != 1 && p.lattice != 2 && p.lattice != 4 && p.lattice != 8) {
    return {StatusCode::invalid_argument, "visibility: lattice 1, 2, 4 or 8"};
  }
  return {};
}

// What stops but a share of the light: bicycles, fences.
struct Veil {
  float cover = 1.0F;  // the share
  Vec3f low, high;     // box around its faces
};

struct Veils {
  static constexpr std::size_t kMost = 4;
  Span<const std::uint8_t> of_face;  // one more than the veil's place, 0 for faces that stop all; empty: all do
  Veil veil[kMost];
  std::size_t count = 0;
};

// What bulges or is flat: its own faces do not shade it.
struct Bodies {
  Span<const std::uint16_t> of_face;   // the number of its body, 0 for none; empty: there are none
  Span<const std::uint16_t> of_point;  // the same
  Span<const std::uint16_t> of_lamp;   // what it is a part of, which shades it like anything
};

// What is special about some faces; all others stop every ray.
struct Occluders {
  Span<const std::uint16_t> lamp_mark;  // of the lamp that a face is a part of, and does not hide; 0 for none
  Veils veils;
  Bodies bodies;
};

// What a lamp at its peak brings to the points of a block.
struct BlockLight {
  float illuminance_lx[kBlockPoints];  // 0: none, or nobody asks
  Vec3f to_light[kBlockPoints];        // unit, where it is not 0
  bool any;                            // whether one is not 0; else the arrays hold nothing
};

namespace visibility_detail {

// Whether q lies on the surface of p: within kSamePlane of its plane and kReach of p, both in depths of p.
inline constexpr float kSamePlane = 0.02F;
inline constexpr float kReach = 0.25F;
[[nodiscard]] inline bool on_surface_of(const SurfacePoints& points, std::size_t p, std::size_t q) noexcept {
  const Vec3f& at = points.position[p];
  const Vec3f way = points.position[q] - at;
  return dot(points.normal[p], points.normal[q]) > 0.9F && std::fabs(dot(points.normal[p], way)) < kSamePlane * at.z &&
         dot(way, way) < kReach * kReach * at.z * at.z;
}

// Coordinates of a block's lattice points: 0, step, 2 step, ... and the last, so that every slot lies between two.
inline constexpr int kLast = kBlockSide - 1;
[[nodiscard]] constexpr int lattice_below(int i, int step) noexcept { return i == kLast ? kLast : i & ~(step - 1); }
[[nodiscard]] constexpr int lattice_above(int i, int step) noexcept {
  const int below = lattice_below(i, step);
  return below == i ? i : (below + step < kLast ? below + step : kLast);
}

enum class Stake : std::uint8_t { none, weak, middling, full, dominant };
[[nodiscard]] constexpr Stake stake_of(float at_stake, float cutoff) noexcept {
  if (!(at_stake > cutoff)) return Stake::none;
  if (at_stake < 10.0F * cutoff) return Stake::weak;
  if (at_stake < 50.0F * cutoff) return Stake::middling;
  return at_stake < 250.0F * cutoff ? Stake::full : Stake::dominant;
}

[[nodiscard]] inline float longer_side_m(const Emitter& e) noexcept {
  return 2.0F * std::fmax(length(e.half_u_m), length(e.half_v_m));
}

// The most illuminance that a lamp could bring to any point of a cell.
[[nodiscard]] inline float most_illuminance_lx(const Emitter& e, float peak_cd, const CellBounds& bounds) noexcept {
  const Vec3f way = bounds.centre_m - e.centre_m;
  const float distance = length(way);
  const float around = bounds.radius_m + longer_side_m(e);
  const float nearest = distance - around;
  // At most: the cosine to the lamp of a normal in the cone, times the distance.
  float facing = 1.0F;
  if (bounds.cone_cosine > 0.0F && distance > 0.0F) {
    const float to_axis = -dot(bounds.normal, way) / distance;
    const float sine2 = (1.0F - bounds.cone_cosine * bounds.cone_cosine) * (1.0F - to_axis * to_axis);
    if (to_axis < bounds.cone_cosine) facing = to_axis * bounds.cone_cosine + std::sqrt(std::fmax(0.0F, sine2));
    facing += 1e-4F;
    if (facing * distance + around <= 0.0F) return 0.0F;
  }
  const bool ahead = shines_ahead(e);
  const float leaving = ahead ? dot(e.axis, way) + around : distance;
  if (leaving <= 0.0F) return 0.0F;
  if (!(nearest > 0.0F)) return std::numeric_limits<float>::infinity();
  const float received = std::fmin(1.0F, (facing * distance + around) / nearest);
  const float emitted = ahead && e.profile == EmissionProfile::lambert ? std::fmin(1.0F, leaving / nearest) : 1.0F;
  return peak_cd * received * emitted / (nearest * nearest);
}

// Whether all of a cell lies below the cut-off; else `most_lx` may be more than it.
[[nodiscard]] inline bool is_dark(const VisibilityParams& params, Span<const std::uint32_t> block, std::size_t cell,
                                  const CellBounds& bounds, Span<const float> certain_lx, float most_lx) noexcept {
  const float at_stake = bounds.shines ? kShine * most_lx : most_lx;
  if (at_stake <= params.cutoff_lx) return true;
  bool dark = true;
  for_cell(cell, [&](std::size_t slot) {
    const std::uint32_t p = block[slot];
    dark = dark && (p == kNoPoint || at_stake <= params.cutoff_share * certain_lx[p]);
  });
  return dark;
}

inline constexpr std::size_t kRaysPerBatch = 256;  // room for the rays of one point

// A slot of a block whose rays, side x side of them, wait in a batch.
struct Waiting {
  std::uint16_t slot;
  std::uint16_t side;
};

// Whether the ray's way from 0 to t_max comes into the box. One that grazes it may count either way.
[[nodiscard]] inline bool meets_box(const Ray& ray, const Vec3f& low, const Vec3f& high) noexcept {
  float from = 0.0F;
  float to = ray.t_max;
  for (const float Vec3f::*c : {&Vec3f::x, &Vec3f::y, &Vec3f::z}) {
    if (ray.direction.*c == 0.0F) {
      if (ray.origin.*c < low.*c || ray.origin.*c > high.*c) return false;
      continue;
    }
    const float inverse = 1.0F / ray.direction.*c;
    const float a = (low.*c - ray.origin.*c) * inverse;
    const float b = (high.*c - ray.origin.*c) * inverse;
    from = std::fmax(from, std::fmin(a, b));
    to = std::fmin(to, std::fmax(a, b));
  }
  return from <= to;
}

// Rays to one lamp that wait to be traced together.
struct Batch {
  Ray rays[kRaysPerBatch];
  std::uint8_t above[kRaysPerBatch];  // the receiver's horizon
  std::uint8_t blocked[kRaysPerBatch];
  std::uint8_t asked[kRaysPerBatch];  // whether a veil is in the way
  float through[kRaysPerBatch];       // share of the light
  Waiting waiting[kRaysPerBatch];
  std::size_t count = 0;
  std::size_t points = 0;
  std::uint16_t body = 0;  // that all rays leave
};

// One lamp and one block.
template <class Scene>
class BlockTracer {
 public:
  BlockTracer(const VisibilityParams& params, std::uint64_t seed, const Scene& scene, const SurfacePoints& points,
              Span<const std::uint32_t> block, const Emitter& emitter, std::uint32_t number, const Occluders& occluders,
              BlockLight& light) noexcept
      : params_(params),
        seed_(seed),
        scene_(scene),
        points_(points),
        block_(block),
        emitter_(emitter),
        number_(number),
        occluders_(occluders),
        light_(light),
        extent_(longer_side_m(emitter)) {}

  // lit: which cells the lamp may reach. Returns the sum of what is left out.
  float weigh(const bool (&lit)[kCellsOfBlock], Span<const CellBounds> cells, Span<const float> certain_lx,
              float peak_cd) noexcept {
    float left_out = 0.0F;
    for (std::size_t cell = 0; cell < kCellsOfBlock; ++cell) {
      if (lit[cell]) {
        left_out += weigh(cell, cells[cell], certain_lx, peak_cd);
      } else {
        for_cell(cell, [&](std::size_t i) {
          stake_[i] = Stake::none;
          light_.illuminance_lx[i] = 0.0F;
        });
      }
    }
    return left_out;
  }

  void trace() noexcept {
    if (!light_.any) return;
    std::uint16_t slots[kBlockPoints];
    std::size_t count = 0;
    for_slots([&](int x, int y, std::uint16_t i) {
      if (on_lattice(x, y, i)) slots[count++] = i;
    });
    trace(slots, count);
    count = 0;
    for_slots([&](int x, int y, std::uint16_t i) {
      const bool between = !on_lattice(x, y, i);
      taken_[i] = between && take_from_lattice(x, y, i);
      if (between && !taken_[i]) slots[count++] = i;
    });
    while (count > 0) {
      trace(slots, count);
      count = doubted_neighbours(slots, count);
    }
    for (std::size_t i = 0; i < kBlockPoints; ++i) {
      if (stake_[i] != Stake::none) light_.illuminance_lx[i] *= visible_[i];
    }
  }

 private:
  // Of a cell.
  float weigh(std::size_t cell, const CellBounds& bounds, Span<const float> certain_lx, float peak_cd) noexcept {
    float arriving[kCellPoints];
    Vec3f to_light[kCellPoints];
    arrive(cell, bounds, arriving, to_light);
    float left_out = 0.0F;
    std::size_t k = 0;
    for_cell(cell, [&](std::size_t i) {
      const std::size_t from = k++;
      const std::uint32_t p = block_[i];
      stake_[i] = Stake::none;
      light_.illuminance_lx[i] = 0.0F;
      const float lx = peak_cd * arriving[from];
      if (p == kNoPoint || !(lx > 0.0F)) return;
      const float cutoff = std::fmax(params_.cutoff_lx, params_.cutoff_share * certain_lx[p]);
      stake_[i] = stake_of(bounds.shines ? shine(points_, p) * lx : lx, cutoff);
      if (stake_[i] == Stake::none) {
        left_out += lx;
        return;
      }
      light_.illuminance_lx[i] = lx;
      light_.to_light[i] = to_light[from];
      light_.any = true;
    });
    return left_out;
  }

  // illuminance_per_cd() of the points of a cell, and where they have none something.
  void arrive(std::size_t cell, const CellBounds& bounds, float (&arriving)[kCellPoints],
              Vec3f (&to_light)[kCellPoints]) const noexcept {
    const float nearest = std::fmax(0.0F, length(bounds.centre_m - emitter_.centre_m) - bounds.radius_m);
    const bool as_point = emitter_.shape != EmitterShape::sphere && !is_extended(emitter_, 0.99F * nearest * nearest);
    Vec3f position[kCellPoints];
    Vec3f normal[kCellPoints];
    std::size_t k = 0;
    for_cell(cell, [&](std::size_t i) {
      const bool there = block_[i] != kNoPoint;
      position[k] = there ? points_.position[block_[i]] : bounds.centre_m;
      normal[k] = there ? points_.normal[block_[i]] : Vec3f{};
      if (!as_point) arriving[k] = illuminance_per_cd(emitter_, position[k], normal[k], to_light[k]);
      ++k;
    });
    if (!as_point) return;
    using F = simd::F32;
    for (k = 0; k < kCellPoints; k += F::lanes) {
      simd::F32x3<F> towards;
      const F per_cd = illuminance_as_point_per_cd<F>(emitter_, simd::load3<F>(&position[k].x),
                                                      simd::load3<F>(&normal[k].x), towards);
      per_cd.store(arriving + k);
      simd::store3<F>(&to_light[k].x, towards);
    }
  }

  template <class F>
  void for_slots(const F& f) const noexcept {
    for (int y = 0; y < kBlockSide; ++y) {
      for (int x = 0; x < kBlockSide; ++x) {
        const auto i = static_cast<std::uint16_t>(y * kBlockSide + x);
        if (stake_[i] != Stake::none) f(x, y, i);
      }
    }
  }

  [[nodiscard]] int step(std::size_t i) const noexcept {
    return params_.lattice * (stake_[i] == Stake::weak ? 4 : (stake_[i] == Stake::dominant ? 1 : 2));
  }
  [[nodiscard]] bool on_lattice(int x, int y, std::size_t i) const noexcept {
    return lattice_below(x, step(i)) == x && lattice_below(y, step(i)) == y;
  }

  // False where the lattice points around a slot do not say what it sees.
  [[nodiscard]] bool take_from_lattice(int x, int y, std::uint16_t i) noexcept {
    const int left = lattice_below(x, step(i));
    const int right = lattice_above(x, step(i));
    const int top = lattice_below(y, step(i));
    const int bottom = lattice_above(y, step(i));
    const int around[4] = {top * kBlockSide + left, top * kBlockSide + right, bottom * kBlockSide + left,
                           bottom * kBlockSide + right};
    float sum = 0.0F;
    float count = 0.0F;
    float least = 1.0F;
    float most = 0.0F;
    for (const int slot : around) {
      const auto j = static_cast<std::size_t>(slot);
      // A weak point on the finer lattice alone has not been traced.
      if (stake_[j] == Stake::none || !on_lattice(slot % kBlockSide, slot / kBlockSide, j)) continue;
      if (!on_surface_of(points_, block_[i], block_[j])) continue;
      sum += visible_[j];
      count += 1.0F;
      least = std::fmin(least, visible_[j]);
      most = std::fmax(most, visible_[j]);
    }
    if (!(count > 0.0F)) return false;
    visible_[i] = sum / count;
    const bool whole =
        least == 0.0F || least == 1.0F || occluders_.veils.count > 0;  // else a penumbra's, equal by chance
    return stake_[i] < Stake::full || (count > 1.0F && least == most && whole);
  }

  // Puts the slots whose values were taken and differ from those of traced neighbours on the same surface in the place
  // of these neighbours: shadows are followed between lattice points.
  [[nodiscard]] std::size_t doubted_neighbours(std::uint16_t (&slots)[kBlockPoints], std::size_t count) noexcept {
    std::uint16_t found[kBlockPoints];
    std::size_t next = 0;
    for (std::size_t t = 0; t < count; ++t) {
      const std::uint16_t from = slots[t];
      const int x = from % kBlockSide;
      const int y = from / kBlockSide;
      for (int v = y > 0 ? y - 1 : y; v <= y + 1 && v < kBlockSide; ++v) {
        for (int u = x > 0 ? x - 1 : x; u <= x + 1 && u < kBlockSide; ++u) {
          const auto i = static_cast<std::uint16_t>(v * kBlockSide + u);
          if (stake_[i] < Stake::full || !taken_[i] || !(std::fabs(visible_[i] - visible_[from]) > 0.25F)) continue;
          if (!on_surface_of(points_, block_[i], block_[from])) continue;
          taken_[i] = false;
          found[next++] = i;
        }
      }
    }
    std::copy(found, found + next, slots);
    return next;
  }

  // First one ray or four of every slot, then more of those that lie in a penumbra.
  void trace(const std::uint16_t (&slots)[kBlockPoints], std::size_t count) noexcept {
    std::uint16_t in_penumbra[kBlockPoints];
    for (const bool more : {false, true}) {
      const std::uint16_t* const traced = more ? in_penumbra : slots;
      std::size_t penumbra = 0;
      const auto send = [&] {
        trace_batch();
        std::size_t ray = 0;
        for (std::size_t w = 0; w < batch_.points; ++w) {
          const Waiting& waiting = batch_.waiting[w];
          float seen = 0.0F;
          float above = 0.0F;
          float least = 1.0F;
          float most = 0.0F;
          for (int s = 0; s < waiting.side * waiting.side; ++s, ++ray) {
            if (batch_.above[ray] == 0) continue;
            const float through = batch_.through[ray];
            above += 1.0F;
            seen += through;
            least = std::fmin(least, through);
            most = std::fmax(most, through);
          }
          visible_[waiting.slot] = above > 0.0F ? seen / above : 0.0F;
          if (!more && least < most) in_penumbra[penumbra++] = waiting.slot;
        }
        batch_.count = 0;
        batch_.points = 0;
      };
      for (std::size_t t = 0; t < count; ++t) {
        const std::uint16_t i = traced[t];
        const Vec3f origin = ray_start(points_, block_[i]);
        const bool small = extent_ < params_.small_angle * length(emitter_.centre_m - origin);
        const int side = more ? params_.samples_per_side : (small || stake_[i] < Stake::full ? 1 : 2);
        const std::uint16_t body = body_of(block_[i]);
        if (batch_.count + static_cast<std::size_t>(side * side) > kRaysPerBatch || body != batch_.body) send();
        batch_.body = body;
        RandomStream random(seed_, RandomPurpose::direct, 0, number_, block_[i], 0);
        if (more) {
          for (int drawn = 0; drawn < 8; ++drawn) static_cast<void>(random.uniform());  // by the first four rays
        }
        add_rays(origin, points_.normal[block_[i]], side, small, random);
        batch_.waiting[batch_.points++] = {i, static_cast<std::uint16_t>(side)};
      }
      send();
      count = penumbra;
    }
  }

  // That lets the rays to this lamp through.
  [[nodiscard]] std::uint16_t body_of(std::uint32_t point) const noexcept {
    const Bodies& bodies = occluders_.bodies;
    if (bodies.of_face.empty()) return 0;
    const std::uint16_t body = bodies.of_point[point];
    return body == bodies.of_lamp[number_] ? std::uint16_t{0} : body;
  }
  // Whether the rays of the batch take notice of a face.
  [[nodiscard]] bool stops(std::uint32_t face) const noexcept {
    const Span<const std::uint16_t>& marks = occluders_.lamp_mark;
    if (emitter_.mark != 0 && face < marks.size() && marks[face] == emitter_.mark) return false;
    return batch_.body == 0 || occluders_.bodies.of_face[face] != batch_.body;
  }

  void trace_batch() noexcept {
    const Span<const Ray> rays(batch_.rays, batch_.count);
    const Span<std::uint8_t> blocked(batch_.blocked, batch_.count);
    const Veils& veils = occluders_.veils;
    occluded(
        scene_, rays,
        [&](std::uint32_t face) noexcept { return (veils.of_face.empty() || veils.of_face[face] == 0) && stops(face); },
        blocked, Span<const std::uint8_t>(batch_.above, batch_.count));
    for (std::size_t r = 0; r < batch_.count; ++r) {
      batch_.through[r] = batch_.above[r] != 0 && batch_.blocked[r] == 0 ? 1.0F : 0.0F;
    }
    for (std::size_t v = 0; v < veils.count; ++v) {
      const Veil& veil = veils.veil[v];
      if (!(veil.low.x <= veil.high.x)) continue;  // it has no faces
      bool any = false;
      for (std::size_t r = 0; r < batch_.count; ++r) {
        const bool asked = batch_.through[r] > 0.0F && meets_box(batch_.rays[r], veil.low, veil.high);
        batch_.asked[r] = asked ? 1 : 0;
        any = any || asked;
      }
      if (!any) continue;
      occluded(
          scene_, rays, [&](std::uint32_t face) noexcept { return veils.of_face[face] == v + 1 && stops(face); },
          blocked, Span<const std::uint8_t>(batch_.asked, batch_.count));
      for (std::size_t r = 0; r < batch_.count; ++r) {
        if (batch_.asked[r] != 0 && batch_.blocked[r] != 0) batch_.through[r] *= 1.0F - veil.cover;
      }
    }
  }

  // To side x side strata of the lamp; to its middle where it is small.
  void add_rays(const Vec3f& origin, const Vec3f& normal, int side, bool small, RandomStream& random) noexcept {
    for (int s = 0; s < side * side; ++s) {
      const float u = small ? 0.5F : random.uniform();
      const float v = small ? 0.5F : random.uniform();
      Ray& ray = batch_.rays[batch_.count++];
      ray = Ray{};
      ray.origin = origin;
      ray.direction = sample_point(emitter_, origin, (static_cast<float>(s % side) + u) / static_cast<float>(side),
                                   (static_cast<float>(s / side) + v) / static_cast<float>(side)) -
                      origin;
      ray.t_max = 0.999F;
      batch_.above[batch_.count - 1] = small || dot(normal, ray.direction) > 0.0F ? 1 : 0;
    }
  }

  const VisibilityParams& params_;
  std::uint64_t seed_;
  const Scene& scene_;
  const SurfacePoints& points_;
  Span<const std::uint32_t> block_;
  const Emitter& emitter_;
  std::uint32_t number_;
  const Occluders& occluders_;
  BlockLight& light_;
  float extent_;
  Batch batch_;
  Stake stake_[kBlockPoints];
  float visible_[kBlockPoints];
  bool taken_[kBlockPoints];  // from the lattice
};

}  // namespace visibility_detail

// Of one lamp; `number`: which of the scene's it is, for the draws, one stream per pair. `scene`: see trace/scene.hpp.
// `peak_cd`: the greatest luminous intensity that it has in any variant. `certain_lx[p]`: illuminance that every night
// brings. untraced_lx[b] grows by what the lamp at its peak would bring where it is below the cut-off, summed over the
// points of block b: a bound of what leaving it out costs. each_block(b, const BlockLight&) is called for every block,
// in parallel; it may add to certain_lx of the block's points.
template <class Scene, class Executor, class Observer, class EachBlock>
Status light_blocks(const VisibilityParams& params, std::uint64_t seed, const Scene& scene, const SurfacePoints& points,
                    const PointBlocks& blocks, Span<const float> certain_lx, const Emitter& emitter,
                    std::uint32_t number, float peak_cd, const Occluders& occluders, Span<float> untraced_lx,
                    Executor& executor, Observer& observer, const EachBlock& each_block) {
  NPSIM_RETURN_IF_ERROR(validate(points));
  NPSIM_RETURN_IF_ERROR(validate(params));
  if (certain_lx.size() != points.size() || untraced_lx.size() != blocks.count()) {
    return Status(StatusCode::shape_mismatch, "visibility: one illuminance per point, one per block");
  }
  executor.for_chunks(blocks.count(), 2, [&](std::size_t begin, std::size_t end) {
    BlockLight light;
    for (std::size_t b = begin; b < end && !observer.cancelled(); ++b) {
      light.any = false;
      const Span<const std::uint32_t> block = blocks.of_block(b);
      bool lit[kCellsOfBlock];
      bool any = false;
      for (std::size_t cell = 0; cell < kCellsOfBlock; ++cell) {
        const CellBounds& bounds = blocks.cells[b * kCellsOfBlock + cell];
        lit[cell] = false;
        if (bounds.points == 0) continue;
        const float most_lx = visibility_detail::most_illuminance_lx(emitter, peak_cd, bounds);
        lit[cell] = !visibility_detail::is_dark(params, block, cell, bounds, certain_lx, most_lx);
        any = any || lit[cell];
        if (!lit[cell]) untraced_lx[b] += most_lx * static_cast<float>(bounds.points);
      }
      if (any) {
        visibility_detail::BlockTracer tracer(params, seed, scene, points, block, emitter, number, occluders, light);
        untraced_lx[b] += tracer.weigh(lit, blocks.cells.sub(b * kCellsOfBlock, kCellsOfBlock), certain_lx, peak_cd);
        tracer.trace();
      }
      each_block(b, light);
    }
  });
  return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled while tracing shadow rays") : Status();
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_RENDER_VISIBILITY_HPP
