// SPDX-License-Identifier: Apache-2.0
// How far away street lamps are. Their heads hang before the sky, where neither stereo nor networks know the depth, and
// their poles are so thin that depth mixes them with what is behind. So every piece of evidence gives ln z with the
// error that is to be expected of it, and they are combined by their inverse variances:
//   foot   where the pole's lowest pixel touches the ground: z = (camera height - height of the ground there) / fall.
//          A row's error dv gives dz/z = z dv / (f camera height), and so does a tilt of the plane for f times it.
//   pole   depth of the pole's pixels. What stereo or a laser measured is of one thing, as it is. Else a thing w pixels
//          wide keeps a share of itself in a blurred depth, the rest is what is beside it:
//          ln z = ln z_seen - c ln(z_beside / z_seen), with c falling with w; as much as c is not known, z is not.
//          Depth that does not stand out from what is beside it says nothing of the pole.
//   head   depth of the head's own pixels, likewise. Without a pole a head that does not stand out hangs on the wall.
//   sign   depth of a sign or signal on the pole: it is wider.
//   row    lamps of one class hang equally high: the height on which those agree that have evidence of their own gives
//          z = (h - camera height) / rise, dz/z = dh / (h - camera height).
//   height default_height_m, where all this is weaker than a guess.
// Robust: the most precise piece comes first; one that lies further off than kOutlier of their standard deviations is
// left out, and so is any that hangs the lamp lower than min_height_m or higher than max_height_m.
// Cost: for each lamp a pass over a band of the image below it.
#ifndef NPSIM_LIGHT_DETAIL_STREET_LAMPS_HPP
#define NPSIM_LIGHT_DETAIL_STREET_LAMPS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/light/detail/lamp_depth.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct StreetLampParams {
  float min_height_m = 2.0F;  // credible mounting heights above the ground
  float max_height_m = 16.0F;
  float default_height_m = 8.0F;
  float max_distance_m = 300.0F;
  float arm_m = 3.0F;  // reach of an arm, which bounds the search for the pole to either side
};

namespace light_detail {

inline constexpr float kOutlier = 2.0F;         // standard deviations
inline constexpr float kDepthError = 0.05F;     // relative, of depth inside a surface [default]
inline constexpr float kLostError = 0.35F;      // of a head that hangs on what is behind it, or is lost before it
inline constexpr float kSkyError_px = 0.5F;     // over the width of a head before the sky: its relative error [default]
inline constexpr float kBlurWidth_px = 480.0F;  // image width at which depth is blurred by about a pixel [default]
inline constexpr float kFootError_px = 0.7F;    // of the row of a pole's foot
inline constexpr float kWitness = 0.2F;         // relative error below which a lamp speaks for its row
inline constexpr float kPavement_m = 0.3F;      // above the road at most
inline constexpr float kTiltError_rad = 0.003F;  // of the ground plane [default]
inline constexpr float kHeightSpread_m = 0.4F;   // between lamps of one class in one street [default]
inline constexpr float kBehind = 1.15F;          // of what is seen around a head: a lamp further off is not before it
inline constexpr float kVague = 0.15F;           // relative error above which the default height helps
inline constexpr float kHeightGuess_m = 2.0F;    // standard deviation of default_height_m [default]

inline constexpr LabelSet kLampHeadLabels =
    kPoleLabels | kSignLabels | LabelSet::of(label::static_object, label::dynamic_object, label::unlabeled);

// ln z and its standard deviation, which is the relative error of z.
struct LogDepth {
  float mean = 0;
  float sigma = 0;  // 0: not known

  [[nodiscard]] bool known() const noexcept { return sigma > 0.0F; }
};

// A street lamp on its way to a place.
struct StreetLamp {
  float u = 0, v = 0;               // of the head's middle
  LogDepth own;                     // from its own foot, pole and head
  float behind_m = kMaxLightDepth;  // z of what is seen around the head; nothing that is seen before it lies beyond
  float half_width = 0;             // of the head, px
  float pole_u = 0;                 // of the pole's top
  int pole_rows = 0;                // in which the pole is seen; 0: there is none
};

struct LampView {
  const StreetLampParams& params;
  const RegionInput& in;
  const Intrinsics& camera;
  const GroundPlane& ground;

  [[nodiscard]] float rise(float u, float v) const noexcept { return dot(ground.up, unproject(camera, u, v, 1.0F)); }
  [[nodiscard]] float height(const StreetLamp& l, float z) const noexcept {
    return height_above_ground(ground, unproject(camera, l.u, l.v, z));
  }
  // The depth at which something seen there hangs h above the ground; 0 where it cannot.
  [[nodiscard]] float depth_at_height(float u, float v, float h) const noexcept {
    const float z = (h - ground.camera_height_m) / rise(u, v);
    return is_valid_depth(z) ? z : 0.0F;
  }
  [[nodiscard]] bool credible(const StreetLamp& l, float z) const noexcept {
    if (!is_valid_depth(z) || z > params.max_distance_m || z > kBehind * l.behind_m) return false;
    const float h = height(l, z);
    return h >= params.min_height_m && h <= params.max_height_m;
  }
};

inline constexpr std::size_t kMaxEvidence = 6;
inline constexpr std::size_t kMaxWitnesses = 64;

struct Evidence {
  LogDepth pieces[kMaxEvidence];
  std::size_t count = 0;

  void add(float z, float sigma) noexcept {
    if (count < kMaxEvidence && is_valid_depth(z) && sigma > 0.0F) pieces[count++] = {std::log(z), sigma};
  }
  // Inverse-variance mean of the pieces that agree with the most precise one.
  [[nodiscard]] LogDepth combined() const noexcept {
    LogDepth best;
    for (std::size_t i = 0; i < count; ++i) {
      if (!best.known() || pieces[i].sigma < best.sigma) best = pieces[i];
    }
    if (!best.known()) return best;
    float weight = 0.0F;
    float sum = 0.0F;
    for (std::size_t i = 0; i < count; ++i) {
      const LogDepth& p = pieces[i];
      const float spread = std::sqrt(p.sigma * p.sigma + best.sigma * best.sigma);
      if (std::fabs(p.mean - best.mean) > kOutlier * spread) continue;
      const float w = 1.0F / (p.sigma * p.sigma);
      weight += w;
      sum += w * (p.mean - best.mean);
    }
    return {best.mean + sum / weight, 1.0F / std::sqrt(weight)};
  }
};

// The pole under a head: from its top to the lowest row that shows it.
struct Pole {
  int x = 0, y = 0;          // its lowest pixel
  int top_x = 0, top_y = 0;  // the highest
  int rows = 0;              // in which it is seen
};

// Follows a pole down from one of its pixels: it leans as verticals do in the picture, and by a pixel more. It may be
// hidden for a quarter of what was seen of it, or by its own signs. visit(x, y) is called for pixels of the pole and of
// its signs.
template <class Visit>
[[nodiscard]] inline Pole follow_pole(const LampView& lamp, int x, int y, Visit&& visit) noexcept {
  const ImageView<const Label>& labels = lamp.in.labels;
  Pole pole{x, y, x, y, 1};
  visit(x, y);
  float column = static_cast<float>(x);
  int last = y;  // row that shows the pole or one of its signs
  for (int row = y + 1; row < labels.height() && row - last <= std::max(3, (last - y) / 4); ++row) {
    column += vertical_slope(lamp.ground, lamp.camera, column + 0.5F, static_cast<float>(row));
    const int middle = static_cast<int>(std::lround(clamp_to(column, -2.0F, static_cast<float>(labels.width() + 1))));
    const auto shown = [&](LabelSet set, int at) {
      return at >= 0 && at < labels.width() && set.contains(labels(at, row));
    };
    for (const int at : {middle, middle - 1, middle + 1}) {
      if (!shown(kPoleLabels, at)) continue;
      pole.x = at;
      pole.y = last = row;
      ++pole.rows;
      column += 0.5F * (static_cast<float>(at) - column);
      visit(at, row);
      break;
    }
    if (last != row && shown(kSignLabels, middle)) {
      last = row;
      visit(middle, row);
    }
  }
  return pole;
}

[[nodiscard]] inline bool shows_pole(const ImageView<const Label>& labels, int x, int y) noexcept {
  for (int at = std::max(x - 1, 0); y >= 0 && at <= std::min(x + 1, labels.width() - 1); ++at) {
    if (kPoleLabels.contains(labels(at, y))) return true;
  }
  return false;
}

// The longest pole that begins below the middle of the head, else within an arm's reach; no rows where there is none.
[[nodiscard]] inline Pole find_pole(const LampView& lamp, const LightRegion& r, const StreetLamp& l) noexcept {
  const ImageView<const Label>& labels = lamp.in.labels;
  // What an arm spans is judged at the distance of a default lamp.
  const float guess_m = lamp.depth_at_height(l.u, l.v, lamp.params.default_height_m);
  const float metre_px = lamp.camera.fx / (guess_m > 2.0F ? std::min(guess_m, lamp.params.max_distance_m) : 2.0F);
  const int reach =
      std::max(r.x1 - r.x0 + 1,
               static_cast<int>(std::min(lamp.params.arm_m * metre_px, 0.25F * static_cast<float>(labels.width()))));
  const int drop = std::max(2, static_cast<int>(std::min(metre_px, 0.25F * static_cast<float>(labels.height()))));
  const int middle = (r.x0 + r.x1) / 2;
  const int shortest = std::max(6, 2 * (r.y1 - r.y0 + 1));
  Pole best;
  for (int d = 0; d <= reach; ++d) {
    if (best.rows > 0 && d == (r.x1 - r.x0) / 4 + 1) break;
    for (const int x : {middle - d, middle + d}) {
      if (x < 0 || x >= labels.width()) continue;
      for (int y = r.y0; y <= std::min(r.y1 + drop, labels.height() - 1); ++y) {
        if (!kPoleLabels.contains(labels(x, y))) continue;
        int above = 0;  // a pole that goes on above the head carries another one
        while (above <= drop && shows_pole(labels, x, r.y0 - above - 1)) ++above;
        if (above > drop) break;
        const Pole pole = follow_pole(lamp, x, y, [](int, int) {});
        if (pole.rows >= shortest && pole.rows > best.rows) best = pole;
        break;
      }
    }
  }
  return best;
}

// Share c of a thing in  ln z = ln z_seen - c ln(z_beside / z_seen): about that of a box seen through a Gaussian of a
// pixel of an image kBlurWidth_px wide, since networks see a picture at a size of their own. What is less than three of
// them wide has no inside, so that no depth of it is certain. [default]
[[nodiscard]] inline float mixed_share(const RegionInput& in, int width_px, bool certain) noexcept {
  if (!in.confidence.empty()) return 0.0F;  // a measurement is of one thing
  const float blur_px = std::max(1.0F, static_cast<float>(in.depth.width()) / kBlurWidth_px);
  const float width = static_cast<float>(width_px) / blur_px;
  if (certain && width >= 3.0F) return 0.0F;
  return std::min(1.2F, 4.0F * std::exp(-0.75F * width));
}
// Standard deviation of ln z for a share c and a contrast ln(z_beside / z_seen): c is known to half of itself.
// [default]
[[nodiscard]] inline float mixing_error(float share, float contrast) noexcept {
  const float spread = share * (0.5F * contrast + 0.1F);
  return std::sqrt(kDepthError * kDepthError + spread * spread);
}

inline constexpr float kContrast = 0.07F;  // of ln z: below it a thing does not stand out from what is beside it

// What was not measured was made up from what lies around it.
[[nodiscard]] inline bool is_measured(const RegionInput& in, int x, int y) noexcept {
  return in.confidence.empty() || in.confidence(x, y) == 1.0F;
}

// Depth beside a thing that spans columns x0..x1 of a row; 0 where there is only sky or nothing was measured.
[[nodiscard]] inline float depth_beside(const RegionInput& in, int x0, int x1, int y) noexcept {
  float sum = 0.0F;
  int count = 0;
  for (const int x : {x0 - 3, x1 + 3}) {
    if (x < 0 || x >= in.depth.width() || kPoleLabels.contains(in.labels(x, y)) || !is_surface(in, x, y) ||
        !is_measured(in, x, y)) {
      continue;
    }
    sum += std::log(in.depth(x, y));
    ++count;
  }
  return count > 0 ? std::exp(sum / static_cast<float>(count)) : 0.0F;
}

// Depth of the pole and of its signs.
inline void add_pole_depth(const LampView& lamp, const Pole& pole, Span<float> scratch, Evidence& evidence) noexcept {
  const RegionInput& in = lamp.in;
  const Span<float> of_pole = scratch.sub(0, scratch.size() / 2);
  const Span<float> of_signs = scratch.sub(scratch.size() / 2, scratch.size() - scratch.size() / 2);
  std::size_t rows = 0;
  std::size_t signs = 0;
  float contrasts = 0.0F;
  float shares = 0.0F;
  (void)follow_pole(lamp, pole.top_x, pole.top_y, [&](int x, int y) {
    if (!kPoleLabels.contains(in.labels(x, y))) {
      if (is_surface(in, x, y) && is_measured(in, x, y) && signs < of_signs.size()) of_signs[signs++] = in.depth(x, y);
      return;
    }
    int x0 = x;
    int x1 = x;
    while (x0 > 0 && kPoleLabels.contains(in.labels(x0 - 1, y))) --x0;
    while (x1 + 1 < in.labels.width() && kPoleLabels.contains(in.labels(x1 + 1, y))) ++x1;
    if (!in.confidence.empty()) {
      const float behind = depth_beside(in, x0, x1, y);
      for (int at = x0; at <= x1 && rows < of_pole.size(); ++at) {
        const bool lost = behind > 0.0F && std::log(behind / in.depth(at, y)) < kContrast;
        if (is_measured(in, at, y) && is_surface(in, at, y) && !lost) of_pole[rows++] = in.depth(at, y);
      }
      return;
    }
    const int nearest = in.depth(x0, y) < in.depth(x, y) ? x0 : (in.depth(x1, y) < in.depth(x, y) ? x1 : x);
    if (!is_surface(in, nearest, y) || rows == of_pole.size()) return;
    const float seen = in.depth(nearest, y);
    const float beside = depth_beside(in, x0, x1, y);
    const float share = mixed_share(in, x1 - x0 + 1, is_certain(in, nearest, y));
    if (share > 0.0F && !(beside > 0.0F)) return;
    const float contrast = share > 0.0F ? std::log(beside / seen) : 0.0F;
    if (share > 0.0F && contrast < kContrast) return;
    of_pole[rows++] = seen * std::exp(-share * contrast);
    contrasts += contrast;
    shares += share;
  });
  if (rows >= 3) {
    const auto n = static_cast<float>(rows);
    evidence.add(robust_median(of_pole.sub(0, rows)), mixing_error(shares / n, contrasts / n));
  }
  if (signs >= 3) evidence.add(robust_median(of_signs.sub(0, signs)), 2.0F * kDepthError);
}

// Where the pole stands, if its foot is seen: its lowest row against the ground there, which may be a pavement.
inline void add_foot(const LampView& lamp, const Pole& pole, Span<float> scratch, Evidence& evidence) noexcept {
  const RegionInput& in = lamp.in;
  const int below = pole.y + 1;
  if (below >= in.labels.height() || !kGroundLabels.contains(in.labels(pole.x, below))) return;
  const float floor_z = robust_median(collect_depth(
      in, pole.x - 3, below, pole.x + 3, below + 2,
      [&](int x, int y) { return kGroundLabels.contains(in.labels(x, y)) && is_surface(in, x, y); }, scratch));
  const float row = static_cast<float>(below);
  const float u = static_cast<float>(pole.x) + 0.5F;
  const float raised = height_above_ground(lamp.ground, unproject(lamp.camera, u, row + 1.5F, floor_z));
  // The plane is known to a tilt, so to a height that grows with the distance.
  const bool floor_known = floor_z > 0.0F && std::fabs(raised) < kPavement_m + kTiltError_rad * floor_z;
  const float drop = lamp.ground.camera_height_m - (floor_known ? raised : 0.0F);
  const float z = -drop / lamp.rise(u, row);
  if (!(drop > 0.0F) || !(z > 0.0F)) return;
  const float row_error = z * kFootError_px / (lamp.camera.fy * drop);
  const float tilt_error = z * kTiltError_rad / drop;  // far roads are laid on the plane, so they share it
  evidence.add(z, std::sqrt(kDepthError * kDepthError + row_error * row_error + tilt_error * tilt_error));
}

// Depth of the head itself; `alone`: without a pole, so that one that does not stand out hangs on what is behind it.
inline void add_head(const LampView& lamp, const LightRegion& r, std::uint16_t value, bool alone, Span<float> scratch,
                     Evidence& evidence) noexcept {
  const RegionInput& in = lamp.in;
  const auto taken = [&](int x, int y, bool certain) {
    return in.light_index(x, y) == value && is_surface(in, x, y) && is_measured(in, x, y) &&
           (!certain || is_certain(in, x, y)) &&
           (in.labels.empty() || alone || kLampHeadLabels.contains(in.labels(x, y)));
  };
  const std::size_t enough = std::max<std::size_t>(2, r.pixels / 10);
  for (const bool certain : {true, false}) {
    const Span<float> own = collect_depth(
        in, r.x0, r.y0, r.x1, r.y1, [&](int x, int y) { return taken(x, y, certain); }, scratch);
    if (own.size() < enough) continue;
    const float seen = robust_median(own);
    const int width = std::min(r.x1 - r.x0, r.y1 - r.y0) + 1;
    const float share = mixed_share(in, width, certain);
    const float beside = in.labels.empty() ? 0.0F : depth_beside(in, r.x0, r.x1, (r.y0 + r.y1) / 2);
    const float contrast = beside > 0.0F ? std::log(beside / seen) : 0.0F;
    if (!(beside > 0.0F)) {
      evidence.add(seen,
                   kDepthError + std::max(kSkyError_px / static_cast<float>(width), mixed_share(in, width, false)));
    } else if (contrast >= kContrast) {
      evidence.add(seen * std::exp(-share * contrast), mixing_error(share, contrast));
    } else if (alone) {
      evidence.add(seen, kLostError);
    }
    return;
  }
}

// z of the farthest surface around a head; kMaxLightDepth where it hangs before the sky or nothing was measured.
[[nodiscard]] inline float depth_behind(const RegionInput& in, const LightRegion& r) noexcept {
  const int middle_x = (r.x0 + r.x1) / 2;
  const int middle_y = (r.y0 + r.y1) / 2;
  const int around[4][2] = {{r.x0 - 3, middle_y}, {r.x1 + 3, middle_y}, {middle_x, r.y0 - 3}, {middle_x, r.y1 + 3}};
  float farthest = 0.0F;
  for (const auto& at : around) {
    const int x = at[0];
    const int y = at[1];
    if (x < 0 || y < 0 || x >= in.depth.width() || y >= in.depth.height()) continue;
    if (!is_surface(in, x, y) || !is_measured(in, x, y)) return kMaxLightDepth;
    farthest = std::max(farthest, in.depth(x, y));
  }
  return farthest > 0.0F ? farthest : kMaxLightDepth;
}

// What a lamp's own foot, pole and head say.
[[nodiscard]] inline StreetLamp look_at_lamp(const LampView& lamp, const LightRegion& r, std::uint16_t value,
                                             Span<float> scratch) noexcept {
  StreetLamp l;
  l.u = static_cast<float>(r.mean_x());
  l.v = static_cast<float>(r.mean_y());
  l.half_width = 0.5F * static_cast<float>(r.x1 - r.x0 + 1);
  if (!lamp.in.labels.empty()) l.behind_m = depth_behind(lamp.in, r);
  Evidence all;
  Pole pole;
  if (!lamp.in.labels.empty()) {
    pole = find_pole(lamp, r, l);
    l.pole_rows = pole.rows;
    l.pole_u = static_cast<float>(pole.top_x) + 0.5F;
    if (pole.rows > 0) {
      add_foot(lamp, pole, scratch, all);
      add_pole_depth(lamp, pole, scratch, all);
    }
  }
  add_head(lamp, r, value, pole.rows == 0, scratch, all);
  Evidence believed;
  for (std::size_t i = 0; i < all.count; ++i) {
    const float z = std::exp(all.pieces[i].mean);
    if (lamp.credible(l, z)) believed.add(z, all.pieces[i].sigma);
  }
  l.own = believed.combined();
  return l;
}

// How high above the camera a lamp hangs by its own evidence.
struct LampHeight {
  std::size_t lamp = 0;  // position among the lamps
  float h = 0, variance = 0;

  [[nodiscard]] bool agrees(const LampHeight& o) const noexcept {
    return (h - o.h) * (h - o.h) <= kOutlier * kOutlier * (variance + o.variance);
  }
};

[[nodiscard]] inline LampHeight own_height(const LampView& lamp, const StreetLamp& l, std::size_t position) noexcept {
  const float h = std::exp(l.own.mean) * lamp.rise(l.u, l.v);
  return {position, h, h * h * l.own.sigma * l.own.sigma + kHeightSpread_m * kHeightSpread_m};
}
[[nodiscard]] inline bool is_witness(const StreetLamp& l) noexcept { return l.own.known() && l.own.sigma < kWitness; }

// The lamps that speak for their row: those wanted that have evidence of their own, at most as many as there is room.
template <class Wanted>
[[nodiscard]] inline std::size_t collect_witnesses(const LampView& lamp, Span<const StreetLamp> lamps, Wanted&& wanted,
                                                   Span<LampHeight> out) noexcept {
  std::size_t count = 0;
  for (std::size_t i = 0; i < lamps.size() && count < out.size(); ++i) {
    if (is_witness(lamps[i]) && wanted(i)) out[count++] = own_height(lamp, lamps[i], i);
  }
  return count;
}

// By the height on which most of the witnesses agree; where the lamp is one itself, of those that it agrees with. One
// of them alone is taken for a hint.
[[nodiscard]] inline LogDepth depth_of_row(const LampView& lamp, const StreetLamp& l, std::size_t self,
                                           Span<const LampHeight> witnesses) noexcept {
  const float rise = lamp.rise(l.u, l.v);
  const LampHeight own = is_witness(l) ? own_height(lamp, l, self) : LampHeight{};
  const auto heard = [&](const LampHeight& w) { return w.lamp != self && (!is_witness(l) || w.agrees(own)); };
  int most = 0;
  float best_weight = 0.0F;
  float best_h = 0.0F;
  for (const LampHeight& first : witnesses) {
    if (!heard(first)) continue;
    int count = 0;
    float weight = 0.0F;
    float sum = 0.0F;
    for (const LampHeight& other : witnesses) {
      if (!heard(other) || !first.agrees(other)) continue;
      ++count;
      weight += 1.0F / other.variance;
      sum += other.h / other.variance;
    }
    if (count < most || (count == most && weight <= best_weight)) continue;
    most = count;
    best_weight = weight;
    best_h = sum / weight;
  }
  if (most == 0 || !(rise > 1e-3F) || !(best_h > 0.0F)) return {};
  const float spread = most > 1 ? kHeightSpread_m : 2.5F * kHeightSpread_m;
  return {std::log(best_h / rise), std::sqrt(1.0F / best_weight + spread * spread) / best_h};
}

// z of a lamp from all that is known; 0 where that is nothing.
[[nodiscard]] inline float street_lamp_depth(const LampView& lamp, const StreetLamp& l, std::size_t self,
                                             Span<const LampHeight> witnesses) noexcept {
  Evidence evidence;
  const auto add = [&](const LogDepth& piece) {
    if (piece.known() && lamp.credible(l, std::exp(piece.mean))) evidence.add(std::exp(piece.mean), piece.sigma);
  };
  add(l.own);
  add(depth_of_row(lamp, l, self, witnesses));
  const LogDepth known = evidence.combined();
  const float guess_m = lamp.params.default_height_m - lamp.ground.camera_height_m;
  const float hung = std::min(lamp.depth_at_height(l.u, l.v, lamp.params.default_height_m), l.behind_m);
  if ((!known.known() || known.sigma > kVague) && guess_m > 0.0F) evidence.add(hung, kHeightGuess_m / guess_m);
  const LogDepth best = evidence.combined();
  return best.known() ? std::min(std::exp(best.mean), lamp.params.max_distance_m) : 0.0F;
}

}  // namespace light_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_DETAIL_STREET_LAMPS_HPP
