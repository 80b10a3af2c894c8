// SPDX-License-Identifier: Apache-2.0
// What sends a lamp's light back to where it came from: faces of traffic signs, painted markings and the grain of a
// road, which labels and albedo tell; number plates, reflective clothing and other sheeting, which are marked.
//
// Two measures are in use. EN 12899-1 gives for sheeting the coefficient R_A = I / (E A) in cd/(lx m2), with E measured
// across the beam, I the intensity that a sheet of area A sends to the eye. Seen at an angle v to its normal the sheet
// has the area A cos v, so that
//   L = R_A E / cos v
// EN 1436 gives for ground R_L = L / E in cd/(m2 lx) at the geometry of a driver who looks 30 m ahead (entrance 88.76
// degrees, observation 1.05), E again across the beam. Observation is the angle at the surface between lamp and eye.
// Both are in proportion to the albedo per channel, because ink filters the light that returns as it filters daylight:
// EN 12899-1 asks of yellow .68 of white's R_A and .69 of its luminance factor, of red .18 and .14. So a sign keeps its
// colours and its black print, and nothing needs to be told apart by colour.
//
//   sheeting  R_A = strength albedo c^3 / sqrt(1 + (o / .283 deg)^4), c = cosine of entrance, o = observation. Class
//             RA2 at .2, .33, 2 degrees: 1, .72, .02 of the first, here 1, .65, .022; entrance 5, 30, 40 degrees: 1,
//             .60, .44, here 1, .66, .45.
//   grain     R_L = strength albedo g(ci) g(co) / (1 + (o / 15 deg)^2), stones show lamp and eye the side that faces
//             both [default]. Oren and Nayar (SIGGRAPH 1994) find the same at a roughness of 35 degrees, twice
//             Lambert's light at 5 m.
//   beads     .15 of grain, the stones under the paint [default], and .85 of strength albedo g(ci) g(co) / (1 + o / 2.2
//             deg) (1 - (o / 23 deg)^2), 0 from 23 degrees on. Through a bead of index 1.5 a lamp lights a spot of 23
//             degrees of the paint behind it, the brightest at its rim, and is seen through it from as far as that.
//             Rays traced through beads that stick out by .36 to .42 of their height and whose outlines, seen along
//             the ground, are .15 of the paint's area return at 5, 6, 8, 10, 20 m ahead of a car .28, .33, .42, .50,
//             .73 of what they do at the geometry of 30 m; this .23, .31, .43, .53, .77 (within a fourth, tested).
//   g(c) = (1 - c) c / (c + .006), c = cosine to the normal: nothing from above, where albedo counts it already, and
//   not more than arrives where light grazes.
// It comes on top of bsdf.hpp. Energy: together they return at most the light that arrives up to an entrance of 89.5
// degrees (own headlamps 75 m ahead), whatever the albedo of paint, of other ground up to .45 (tested); at 89.9 degrees
// up to 1.1 of it from paint, 1.3 from such ground. Of what scatters more than .6 of a channel's light
// ((1 - albedo) / .4)^2 is left.
// Reciprocal but for c^3 / cos v, the standard's own factors, within the width of the lobe.
// Cost: a square root. Error: rounding; the models' against the standards' tables is stated above.
#ifndef NPSIM_MATERIAL_RETROREFLECTION_HPP
#define NPSIM_MATERIAL_RETROREFLECTION_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

enum class RetroKind : std::uint8_t { none, sheeting, beads, grain };

// strength times albedo is R_A at .2 degrees and normal entrance, or R_L at the geometry of 30 m.
struct Retroreflector {
  float strength = 0;
  RetroKind kind = RetroKind::none;
};

struct RetroreflectionParams {
  bool on = true;
  float sign_cd_lx_m2 = 250.0F;    // R_A of white sheeting: EN 12899-1 class RA2 [default]; RA1 70
  float plate_cd_lx_m2 = 45.0F;    // of a white number plate: ISO 7591
  float vest_cd_lx_m2 = 330.0F;    // of the strips of high-visibility clothing: EN ISO 20471
  float marking_cd_lx_m2 = 0.15F;  // R_L of white paint, dry: EN 1436 class R3 [default]; R2 .1, R4 .2, R5 .3
  float road_cd_lx_m2 = 0.0125F;   // R_L of bare asphalt, dry: .010 to .020, less what bsdf.hpp gives there
  float wet_share = 0.2F;          // what a film of water leaves: RW2 .035 of R3 .15
  // Paint has so many times the albedo of the picture's road and of a third of the ground around it; old concrete has
  // .2 to asphalt's .1 [default]. Worn paint beside such pixels has less: find_retroreflectors().
  float marking_contrast = 2.0F;
};

// What find_retroreflectors() looks at.
struct ReflectorScene {
  ImageView<const Label> labels;           // may be empty or of one class: nothing is told apart
  ImageView<const ReflectorClass> marked;  // may be empty
  ImageView<const Vec3f> albedo;
  ImageView<const float> depth{};  // z-depth, m; where it is missing the road as a whole tells paint
  Intrinsics camera{};             // with depth
  float camera_height_m = 1.5F;    // above the road
};

[[nodiscard]] inline Status validate(const RetroreflectionParams& p) noexcept {
  const auto good = [](float v) { return v >= 0.0F && v <= 1e4F; };
  const bool valid = good(p.sign_cd_lx_m2) && good(p.plate_cd_lx_m2) && good(p.vest_cd_lx_m2) &&
                     good(p.marking_cd_lx_m2) && good(p.road_cd_lx_m2) && p.wet_share >= 0.0F && p.wet_share <= 1.0F &&
                     p.marking_contrast >= 1.0F;
  return valid ? Status()
               : Status(StatusCode::invalid_argument,
                        "retroreflection: strengths in 0..10000, the share when wet in 0..1, contrast at least 1");
}

namespace retro_detail {

inline constexpr float kDegree = 0.017453293F;
inline constexpr float kWhitePaint = 0.5F;    // albedo of the paint that R_L is given for [default]
inline constexpr float kAsphalt = 0.1F;       // and of the asphalt; class_priors.hpp
inline constexpr float kLeastWhite = 0.27F;   // luminance factor that EN 12899-1 asks of white sheeting, class RA2
inline constexpr float kLeastMarked = 0.05F;  // white of marked sheeting may be guessed as dark, in the shade
inline constexpr float kGrazing = 0.006F;
inline constexpr float kBeadsWidth = 2.2F * kDegree;
inline constexpr float kBeadsReach = 23.0F * kDegree;
inline constexpr float kGrainWidth = 15.0F * kDegree;
inline constexpr float kStones = 0.15F;  // of R_L at 30 m that paint has from the stones under it

[[nodiscard]] constexpr float grazing(float c) noexcept { return (1.0F - c) * (c / (c + kGrazing)); }
[[nodiscard]] constexpr float share_of_bright(float albedo) noexcept {
  const float left = albedo < 1.0F ? (1.0F - albedo) / 0.4F : 0.0F;
  return left < 1.0F ? left * left : 1.0F;
}
[[nodiscard]] constexpr float grain_lobe(float angle_rad) noexcept {
  return 1.0F / (1.0F + angle_rad * angle_rad / (kGrainWidth * kGrainWidth));
}
[[nodiscard]] constexpr float beads_lobe(float angle_rad) noexcept {
  const float part = angle_rad < kBeadsReach ? angle_rad / kBeadsReach : 1.0F;
  return (1.0F - part * part) / (1.0F + angle_rad / kBeadsWidth);
}
// At 30 m, where a strength of 1 returns 1.
inline constexpr float kObservation = 1.05F * kDegree;
inline constexpr float kGrazingAt30 = grazing(0.02164F) * grazing(0.03996F);  // cosines of 88.76 and 87.71 degrees

}  // namespace retro_detail

// Luminance towards wo per lux across the beam from wi, per strength and albedo: 1/sr. All are unit vectors as in
// eval_bsdf().
[[nodiscard]] inline float eval_retroreflection(RetroKind kind, const Vec3f& n, const Vec3f& wo,
                                                const Vec3f& wi) noexcept {
  using namespace retro_detail;
  const float no = dot(n, wo);
  const float ni = dot(n, wi);
  if (kind == RetroKind::none || !(no > 0.0F) || !(ni > 0.0F)) return 0.0F;
  const Vec3f chord = wo - wi;
  const float o2 = dot(chord, chord);  // the angle squared, within 1 % up to 30 degrees
  if (kind == RetroKind::sheeting) {
    constexpr float kWidth = 0.283F * kDegree;
    constexpr float kAtFifth = 1.1176F;  // sqrt(1 + (.2 / .283)^4)
    const float t = o2 / (kWidth * kWidth);
    const float cosine = ni < 1.0F ? ni : 1.0F;
    return kAtFifth * cosine * cosine * cosine / (std::sqrt(1.0F + t * t) * (no > 0.05F ? no : 0.05F));
  }
  const float o = std::sqrt(o2);
  const float grain = grain_lobe(o) / grain_lobe(kObservation);
  const float beads = beads_lobe(o) / beads_lobe(kObservation);
  const float lobe = kind == RetroKind::beads ? beads + (grain - beads) * kStones : grain;
  const float value = grazing(no) * grazing(ni) / kGrazingAt30 * lobe;
  return value > 0.0F ? value : 0.0F;
}

// Memory: nine bytes a pixel.
[[nodiscard]] constexpr std::size_t find_retroreflectors_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<std::uint32_t>(shape.pixels()) + allocation_bytes<float>(shape.pixels()) +
         allocation_bytes<std::uint8_t>(shape.pixels()) + kWorkspaceAlignment;
}

namespace retro_detail {

[[nodiscard]] inline float most_of(const Vec3f& c) noexcept { return max_of(c.x, c.y, c.z); }
[[nodiscard]] inline float least_of(const Vec3f& c) noexcept {
  const float xy = c.x < c.y ? c.x : c.y;
  return xy < c.z ? xy : c.z;
}

// Pieces of pixels that hang together: those that are open, and scratch for a value of each. Nine bytes a pixel.
struct Pieces {
  Span<std::uint32_t> list;
  Span<float> values;
  ImageView<std::uint8_t> open;

  [[nodiscard]] Status allocate(Shape shape, Workspace& workspace) noexcept {
    NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), list));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), values));
    return workspace.allocate_image(shape, open);
  }
  // f(pixels) of each piece, which is open no more.
  template <class F>
  void take(const F& f) const {
    for_pieces(open, list, f);
  }
};

// What a piece of sheeting shows: the albedo of its white, 0 where it has none, and whether it is the face of a sign. A
// face has ink of a saturated colour on a part of it, or is white; a back is grey, however the light falls on it:
// aluminium sheet reflects .3 to .5 [default].
struct PieceOfSheeting {
  float white = 0;
  bool is_face = false;
};

template <class IsInner>
[[nodiscard]] PieceOfSheeting look_at_piece(ImageView<const Vec3f> albedo, Span<const std::uint32_t> pixels,
                                            const IsInner& is_inner, Span<float> strongest) noexcept {
  constexpr float kInk = 0.4F;        // (most - least) / most of a channel; grey surfaces beside lawns have up to .3
  constexpr float kInkShare = 0.15F;  // of the sign
  constexpr float kWhite = 0.6F;
  const auto width = static_cast<std::uint32_t>(albedo.width());
  const auto at = [&](std::uint32_t p) { return albedo(static_cast<int>(p % width), static_cast<int>(p / width)); };
  // Outlines hold what is behind the piece, unless nothing else is left.
  for (const bool inner : {true, false}) {
    std::size_t count = 0;
    std::size_t inked = 0;
    for (const std::uint32_t p : pixels) {
      if (inner && !is_inner(p)) continue;
      const Vec3f a = at(p);
      const float most = most_of(a);
      if (!(most >= 0.0F)) continue;  // NaN
      if (most > 0.05F && most - least_of(a) > kInk * most) ++inked;
      strongest[count++] = most;
    }
    if (count < 9 && inner) continue;
    if (count == 0) return {};
    float* const first = strongest.data();
    float* const tenth = first + count - 1 - count / 10;
    select_nth(first, tenth, first + count);
    const float white = *tenth;
    select_nth(first, first + count / 2, first + count);
    const bool face = static_cast<float>(inked) >= kInkShare * static_cast<float>(count) || first[count / 2] >= kWhite;
    return {white, face};
  }
  return {};
}

// Median luminance of the road's albedo, within 3 % at .1, from a histogram of its root; 0 without a road.
[[nodiscard]] inline float albedo_of_road(ImageView<const Label> labels, ImageView<const Vec3f> albedo) noexcept {
  constexpr int kBins = 256;
  std::uint32_t bins[kBins] = {};
  std::uint32_t count = 0;
  for (int y = 0; y < labels.height(); ++y) {
    for (int x = 0; x < labels.width(); ++x) {
      if (labels(x, y) != label::road) continue;
      const float a = luminance(albedo(x, y));
      if (!(a > 0.0F)) continue;
      const float root = std::sqrt(a < 1.0F ? a : 1.0F);
      ++bins[clamp_to(static_cast<int>(root * static_cast<float>(kBins)), 0, kBins - 1)];
      ++count;
    }
  }
  std::uint32_t below = 0;
  for (int i = 0; i < kBins; ++i) {
    below += bins[i];
    if (2 * below > count) {
      const float root = (static_cast<float>(i) + 0.5F) / static_cast<float>(kBins);
      return root * root;
    }
  }
  return 0.0F;
}

inline constexpr LabelSet kPainted = LabelSet::of(label::road, label::parking, label::ground);

// Whether a pixel is `contrast` times as bright as a third of the ground around it, so that a crossing is told from the
// asphalt between its bars, and a wide piece of pale ground has no paint but .5 m along its borders, 1 m at corners and
// at the lower edge of the picture, where less is seen around. True where depth is missing or little ground is seen.
[[nodiscard]] inline bool stands_out(const ReflectorScene& s, int x, int y, float own, float contrast) noexcept {
  constexpr float kReach_m = 1.5F;  // to each side: three bars of a crossing, and no lane [default]
  constexpr int kSteps = 5;         // to each side, so many samples
  constexpr int kSamples = (2 * kSteps + 1) * (2 * kSteps + 1);
  const float z = s.depth.empty() ? 0.0F : s.depth(x, y);
  if (!is_valid_depth(z)) return true;
  // At least a pixel a step, so that no row counts twice.
  const auto reach_px = [](float reach, int size) {
    return reach < static_cast<float>(size) ? max_of(static_cast<int>(reach), kSteps) : size;
  };
  const int across = reach_px(s.camera.fx * kReach_m / z, s.albedo.width());
  const int away = reach_px(s.camera.fy * s.camera_height_m * kReach_m / (z * z), s.albedo.height());
  int ground = 0;
  int darker = 0;
  for (int j = -kSteps; j <= kSteps; ++j) {
    for (int i = -kSteps; i <= kSteps; ++i) {
      const int u = x + i * across / kSteps;
      const int v = y + j * away / kSteps;
      if (!s.albedo.contains(u, v) || !kPainted.contains(s.labels(u, v))) continue;
      ++ground;
      darker += own > contrast * luminance(s.albedo(u, v)) ? 1 : 0;
    }
  }
  return 4 * ground < kSamples || 3 * darker > ground;
}

// Paint and grain. Worn, dirty or blurred, the albedo of one marking lies as often below as above the contrast that
// paint has. So a piece of what stands out by half of that (1.5 of 2) is looked at as a whole: where its median has
// kWorn of the road's albedo by the contrast, and a third of its pixels are paint by themselves, what has kAlike of the
// median is paint as well. A gutter beside a white line has not, and a pale stretch of road has no such third.
template <class Executor>
[[nodiscard]] Status find_ground(const RetroreflectionParams& p, float wetness, const ReflectorScene& s,
                                 ImageView<Retroreflector> out, Workspace& workspace, Executor& executor) {
  constexpr float kAlike = 0.75F;
  constexpr float kWorn = 0.95F;
  constexpr std::size_t kMost = 3;  // pixels to one of paint by itself
  const float pale_contrast = 0.5F * (1.0F + p.marking_contrast);
  const Shape shape = out.shape();
  const float road = albedo_of_road(s.labels, s.albedo);
  const float left = 1.0F - (1.0F - p.wet_share) * wetness;
  const Retroreflector paint{left * p.marking_cd_lx_m2 / kWhitePaint, RetroKind::beads};
  const Retroreflector grain{left * p.road_cd_lx_m2 / kAsphalt, RetroKind::grain};
  const WorkspaceScope scope(workspace);
  Pieces pieces;
  NPSIM_RETURN_IF_ERROR(pieces.allocate(shape, workspace));
  for_pixels(shape, executor, [&](int x, int y) {
    const Label l = s.labels(x, y);
    const float own = luminance(s.albedo(x, y));
    const auto has = [&](float contrast) { return own > contrast * road && stands_out(s, x, y, own, contrast); };
    const bool pale = kPainted.contains(l) && road > 0.0F && has(pale_contrast);
    pieces.open(x, y) = pale ? 1 : 0;
    if (kGroundLabels.contains(l)) out(x, y) = pale && has(p.marking_contrast) ? paint : grain;
  });
  pieces.take([&](Span<const std::uint32_t> piece) {
    const auto own = [&](std::uint32_t pixel) { return luminance(s.albedo(place_of(pixel, shape.width))); };
    std::size_t sure = 0;
    float* last = pieces.values.data();
    for (const std::uint32_t pixel : piece) {
      *last++ = own(pixel);
      sure += out(place_of(pixel, shape.width)).kind == RetroKind::beads ? 1U : 0U;
    }
    float* const middle = pieces.values.data() + piece.size() / 2;
    select_nth(pieces.values.data(), middle, last);
    const float median = *middle;
    if (kMost * sure < piece.size() || median < kWorn * p.marking_contrast * road) return;
    for (const std::uint32_t pixel : piece) {
      if (own(pixel) > kAlike * median) out(place_of(pixel, shape.width)) = paint;
    }
  });
  for_pixels(shape, executor, [&](int x, int y) {
    if (kGroundLabels.contains(s.labels(x, y))) out(x, y).strength *= share_of_bright(most_of(s.albedo(x, y)));
  });
  return {};
}

// Makes sheeting of every piece of the pixels for which is_member(x, y), white of which has the R_A `white_cd_lx_m2`.
// `marked`: no piece is a back, and its white counts as white down to kLeastMarked; below, R_A falls with it.
template <class IsMember>
[[nodiscard]] Status find_sheeting(float white_cd_lx_m2, bool marked, const IsMember& is_member,
                                   ImageView<const Vec3f> albedo, ImageView<Retroreflector> out,
                                   Workspace& workspace) noexcept {
  const Shape shape = out.shape();
  const WorkspaceScope scope(workspace);
  Pieces pieces;
  NPSIM_RETURN_IF_ERROR(pieces.allocate(shape, workspace));
  const auto holds = [&](int x, int y) { return pieces.open.contains(x, y) && is_member(x, y); };
  const auto is_inner = [&](std::uint32_t pixel) {
    const auto [x, y] = place_of(pixel, shape.width);
    return holds(x - 1, y) && holds(x + 1, y) && holds(x, y - 1) && holds(x, y + 1);
  };
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) pieces.open(x, y) = is_member(x, y) ? 1 : 0;
  }
  pieces.take([&](Span<const std::uint32_t> pixels) {
    const PieceOfSheeting piece = look_at_piece(albedo, pixels, is_inner, pieces.values);
    if (!(piece.white > 0.0F) || !(marked || piece.is_face)) return;
    const float white = clamp_to(piece.white, marked ? kLeastMarked : kLeastWhite, 1.0F);
    const Retroreflector sheet{white_cd_lx_m2 / white, RetroKind::sheeting};
    for (const std::uint32_t pixel : pixels) out(place_of(pixel, shape.width)) = sheet;
  });
  return {};
}

[[nodiscard]] constexpr float strength_of_white(const RetroreflectionParams& p, ReflectorClass c) noexcept {
  if (c == ReflectorClass::number_plate) return p.plate_cd_lx_m2;
  return c == ReflectorClass::vest ? p.vest_cd_lx_m2 : p.sign_cd_lx_m2;
}

}  // namespace retro_detail

// What each pixel shows. `wetness` as in roughness.hpp. By pieces of a label or mark, because front and back of a sign
// are one object each, and of pale ground, because a marking is. Cost: four passes over the pixels, one of them serial,
// .3 us for each of ground that is 1.5 times as pale as the road and .6 us for each that is twice as pale.
template <class Executor>
Status find_retroreflectors(const RetroreflectionParams& p, float wetness, const ReflectorScene& scene,
                            ImageView<Retroreflector> out, Workspace& workspace, Executor& executor) {
  using namespace retro_detail;
  NPSIM_RETURN_IF_ERROR(validate(p));
  const Shape shape = out.shape();
  const auto fits = [shape](const auto& view) { return view.empty() || view.shape() == shape; };
  if (scene.albedo.shape() != shape || !fits(scene.labels) || !fits(scene.marked) || !fits(scene.depth)) {
    return Status(StatusCode::shape_mismatch,
                  "retroreflection: labels, marks, albedo, depth and output must have one size");
  }
  for (Retroreflector& r : out.pixels()) r = Retroreflector{};
  if (!scene.depth.empty()) {
    NPSIM_RETURN_IF_ERROR(validate(scene.camera));
    if (!(scene.camera_height_m > 0.0F)) {
      return Status(StatusCode::invalid_argument, "retroreflection: the camera must be above the road");
    }
  }
  if (!p.on) return {};
  if (!scene.labels.empty()) {
    NPSIM_RETURN_IF_ERROR(find_ground(p, wetness, scene, out, workspace, executor));
    const auto is_sign = [&](int x, int y) { return scene.labels(x, y) == label::traffic_sign; };
    NPSIM_RETURN_IF_ERROR(find_sheeting(p.sign_cd_lx_m2, false, is_sign, scene.albedo, out, workspace));
  }
  if (scene.marked.empty()) return {};
  for (const ReflectorClass c : {ReflectorClass::number_plate, ReflectorClass::vest, ReflectorClass::sheeting}) {
    const auto is_marked = [&](int x, int y) { return scene.marked(x, y) == c; };
    NPSIM_RETURN_IF_ERROR(find_sheeting(strength_of_white(p, c), true, is_marked, scene.albedo, out, workspace));
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_RETROREFLECTION_HPP
