// SPDX-License-Identifier: Apache-2.0
// The sun's direction, from what it does to walls, and where it reaches them.
//
// Light of a face with normal n, over that of sunlit level ground, for a sun towards s, ground facing `up`, and a
// shadow that is 2^-drop as bright as the sunlit ground (which find_ground_light.hpp measures):
//   (1 - a) V max(0, n s) / (s up) + a (1 + n up) / 2 + r (1 - n up) / 2,   a = 2^-drop,
// V: whether the sun reaches it; r = .2: what a street throws back that lies half in the sun. Cameras' tone curves
// stretch contrasts: a drop over kMostDrop, which no clear day has, is taken for one of kMostDrop whose logarithms are
// stretched, and those of walls likewise.
// Walls have the albedo of plaster and brick or, fewer of them, of panes and openings. So each direction says how
// likely their luminance is, V being either in each pixel that faces the sun. The mean over a grid of directions is the
// estimate: no sun is found where what is likely is spread out, or where two lights that ask for no direction explain
// the walls as well. How bright all walls are over the ground is free within a binary order or two: exposure and tone
// curve.
// V follows from the posterior of each pixel and the mean field of its neighbours, as on the ground.
// Error: 10 degrees in the median of the eight generated streets of sixteen where a sun is found, 20 at worst.
#ifndef NPSIM_MATERIAL_DETAIL_DAYLIGHT_SUN_HPP
#define NPSIM_MATERIAL_DETAIL_DAYLIGHT_SUN_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/material/detail/daylight/ground_light.hpp"
#include "npsim/material/detail/daylight/mean_field.hpp"
#include "npsim/material/detail/daylight/picture.hpp"
#include "npsim/material/detail/daylight/planes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace daylight_detail {

struct SunParams {
  float block_px = 64.0F;        // at 960 px width: walls are alike within, so that as many pixels say what one does
  float least_together = 0.95F;  // length of the mean direction
  float least_gain = 0.12F;      // bits per pixel over lights without direction
  MeanFieldParams field;

  SunParams() noexcept {
    field.reach_px = 24.0F;
    field.weight = 2.0F;  // a house in dark paint is not told from one in the shade: what is not sure stays between
  }
};

// What is known of the sun and its light.
struct Sun {
  bool found = false;
  Vec3f direction{0, -1, 0};  // towards it
  float exposure = 0.0F;      // log2 of how much brighter walls are seen than their light and albedo make them
  // Of the light as such:
  Vec3f up{0, -1, 0};
  Vec3f ahead{0, 0, 1};
  float sky = 1.0F;      // light of level ground that the sun does not reach
  float thrown = 0.2F;   // light of what faces down
  float stretch = 1.0F;  // of logarithms

  // log2 of the light of a face; cosine: of the sun, 0 where it does not reach.
  [[nodiscard]] float log_light(const Vec3f& normal, float cosine) const noexcept {
    const float upward = 0.5F * (1.0F + dot(normal, up));
    return stretch * log2_of((1.0F - sky) * cosine / sine() + sky * upward + thrown * (1.0F - upward));
  }
  // Between a face and the sun, 0 where it faces away; a middle one where its direction is not known.
  [[nodiscard]] float cosine(const Vec3f& normal) const noexcept {
    return normal == Vec3f{} ? 0.5F : std::max(dot(normal, direction), 0.0F);
  }
  [[nodiscard]] Vec3f right() const noexcept { return cross(ahead, up); }
  [[nodiscard]] float azimuth() const noexcept { return std::atan2(dot(direction, right()), dot(direction, ahead)); }
  // Of the sun above the ground; low suns are no brighter on walls than one at some 6 degrees.
  [[nodiscard]] float sine() const noexcept { return std::max(dot(direction, up), 0.1F); }
};

// drop: log2 of luminance, sunlit over shadowed ground.
[[nodiscard]] inline Sun light_of_day(float drop, const GroundPlane& ground) noexcept {
  constexpr float kMostDrop = 3.0F;
  Sun sun;
  sun.up = ground.up;
  sun.ahead = forward_on_ground(ground);
  sun.stretch = std::max(1.0F, drop / kMostDrop);
  sun.sky = exp2_of(-drop / sun.stretch);
  return sun;
}

// One kind of surface among others: log2 of its albedo, how far that spreads, and how many are of it.
struct AlbedoKind {
  float level, spread, share;
};

// Density of log2 of the albedo of surfaces of two kinds, and a floor.
struct AlbedoPrior {
  static constexpr float kFirst = -12.0F;
  static constexpr float kPerOctave = 32.0F;
  std::array<float, 512> density;

  AlbedoPrior(const AlbedoKind& usual, const AlbedoKind& dark) noexcept {
    constexpr float kFloor = 1e-4F;
    for (std::size_t i = 0; i < density.size(); ++i) {
      const float x = kFirst + (static_cast<float>(i) + 0.5F) / kPerOctave;
      density[i] = kFloor;
      for (const AlbedoKind& kind : {usual, dark}) {
        const float off = (x - kind.level) / kind.spread;
        density[i] += kind.share / kind.spread * exp2_of(-0.5F * kLog2E * off * off);
      }
    }
  }
  [[nodiscard]] float operator()(float log_albedo) const noexcept {
    const float bin = (log_albedo - kFirst) * kPerOctave;
    return density[static_cast<std::size_t>(clamp_to(bin, 0.0F, static_cast<float>(density.size() - 1)))];
  }
};
[[nodiscard]] inline AlbedoPrior prior_of_walls() noexcept {
  constexpr AlbedoKind kWall{-1.5F, 0.9F, 0.7F};  // plaster and brick, of .35
  constexpr AlbedoKind kPane{-3.5F, 1.2F, 0.3F};  // and openings
  return {kWall, kPane};
}

// Directions over the upper half of the sky: rings of equal elevation, as dense as they are long.
inline constexpr int kSunRings = 9;
inline constexpr int kMostSunDirections = 304;
struct SunGrid {
  std::array<Vec3f, kMostSunDirections> direction;
  std::size_t count = 0;

  explicit SunGrid(const Sun& over) noexcept {
    constexpr float kTurn = 6.2831853F;
    constexpr float kLowest = 0.2F, kStep = 0.14F;  // elevation, rad: 11 to 76 degrees
    for (int ring = 0; ring < kSunRings; ++ring) {
      const float elevation = kLowest + kStep * static_cast<float>(ring);
      const int n = static_cast<int>(48.0F * std::cos(elevation));
      for (int i = 0; i < n && count < direction.size(); ++i) {
        const float azimuth = kTurn * static_cast<float>(i) / static_cast<float>(n);
        direction[count++] = over.up * std::sin(elevation) + over.right() * (std::cos(elevation) * std::sin(azimuth)) +
                             over.ahead * (std::cos(elevation) * std::cos(azimuth));
      }
    }
  }
};

// Roofs are darker than walls, and little stands between them and the sun.
[[nodiscard]] inline bool is_roof(const Vec3f& normal, const Vec3f& up) noexcept { return dot(normal, up) > 0.35F; }

struct FaceSample {
  Vec3f normal;
  float log_albedo;  // as if lit like sunlit ground
};
inline constexpr std::size_t kFaceSamples = 2048;
// Levels of all walls that are tried: steps of half a binary order about 0.
inline constexpr int kWallLevels = 13;
[[nodiscard]] inline float wall_level(int k) noexcept { return 0.5F * static_cast<float>(k - kWallLevels / 2); }
inline constexpr std::size_t kSunBytes =
    allocation_bytes<FaceSample>(kFaceSamples) +
    allocation_bytes<float>(kMostSunDirections * static_cast<std::size_t>(kWallLevels));

// Upright faces on a lattice that is as fine as `out` allows. independent: how many blocks of block_px (at 960 px
// width) they fill, within which faces are alike.
template <class Inside, class Normal>
std::size_t face_samples(const Picture& picture, const Inside& wanted, const Normal& normal, const Vec3f& up,
                         float scale, float block_px, Span<FaceSample> out, float& independent) {
  const Shape shape = picture.shape();
  const auto inside = [&](int x, int y) {
    return wanted(x, y) && normal(x, y) != Vec3f{} && !is_roof(normal(x, y), up);
  };
  std::size_t pixels = 0;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) pixels += inside(x, y) ? std::size_t{1} : std::size_t{0};
  }
  const auto block = static_cast<float>(picture.radius(block_px));
  independent = static_cast<float>(pixels) / (block * block);
  const auto step = 1 + static_cast<int>(std::sqrt(static_cast<float>(pixels) / static_cast<float>(out.size())));
  std::size_t n = 0;
  for (int y = step / 2; y < shape.height; y += step) {
    for (int x = step / 2; x < shape.width && n < out.size(); x += step) {
      if (inside(x, y)) out[n++] = {normal(x, y), picture.log_y(x, y) - scale};
    }
  }
  return n;
}

inline constexpr float kSunny = 0.6F;  // of what faces the sun

// bits(direction i, level k) at i * levels.size() + k: log2 of the density of the faces' albedos, in their mean, were
// the sun there and all faces seen brighter than they are by level k; at most kWallLevels of these. No face: 0.
template <class Executor>
void bits_of_directions(const Sun& sun, const SunGrid& grid, const AlbedoPrior& prior, Span<const FaceSample> faces,
                        Span<const float> levels, Span<float> bits, Executor& executor) {
  const float per_face = faces.empty() ? 0.0F : 1.0F / static_cast<float>(faces.size());
  executor.for_chunks(grid.count, 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      Sun tried = sun;
      tried.direction = grid.direction[i];
      float sums[kWallLevels] = {};
      for (const FaceSample& f : faces) {
        const float cosine = dot(f.normal, tried.direction);
        const float shade = f.log_albedo - tried.log_light(f.normal, 0.0F);
        const float lit = cosine > 0.0F ? f.log_albedo - tried.log_light(f.normal, cosine) : shade;
        for (std::size_t k = 0; k < levels.size(); ++k) {
          sums[k] += log2_of(kSunny * prior(lit - levels[k]) + (1.0F - kSunny) * prior(shade - levels[k]));
        }
      }
      for (std::size_t k = 0; k < levels.size(); ++k) bits[i * levels.size() + k] = sums[k] * per_face;
    }
  });
}

// Bits per pixel of two lights, whatever the direction of a face, at the level and the ratio that suit them best.
[[nodiscard]] inline float bits_without_direction(const AlbedoPrior& prior, Span<const FaceSample> walls) noexcept {
  float best = -1e30F;
  for (float brightness = -10.0F; brightness < 4.0F; brightness += 0.25F) {
    for (float drop = 0.0F; drop < 4.0F; drop += 0.5F) {
      float sum = 0.0F;
      for (const FaceSample& w : walls) {
        const float lit = w.log_albedo - brightness;
        sum += log2_of(kSunny * prior(lit) + (1.0F - kSunny) * prior(lit + drop));
      }
      best = std::max(best, sum / static_cast<float>(walls.size()));
    }
  }
  return best;
}

// Finds sun.direction and sun.exposure; scale: log2 of the luminance of albedo 1 on sunlit level ground.
template <class Inside, class Normal, class Executor>
Status find_sun(const SunParams& p, const Picture& picture, const Inside& inside, const Normal& normal, float scale,
                Workspace& workspace, Sun& sun, Executor& executor) {
  constexpr float kLevelSpread = 1.0F;
  constexpr std::size_t kFewest = 64;
  const WorkspaceScope scope(workspace);
  Span<FaceSample> room;
  Span<float> fit;  // bits per pixel, by direction and level
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kFaceSamples, room));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(kMostSunDirections * static_cast<std::size_t>(kWallLevels), fit));
  float independent = 0.0F;
  const Span<FaceSample> walls =
      room.sub(0, face_samples(picture, inside, normal, sun.up, scale, p.block_px, room, independent));
  if (walls.size() < kFewest) return {};
  const AlbedoPrior prior = prior_of_walls();
  const SunGrid grid(sun);
  std::array<float, kWallLevels> levels{};
  for (int k = 0; k < kWallLevels; ++k) levels[static_cast<std::size_t>(k)] = wall_level(k);
  bits_of_directions(sun, grid, prior, walls, {levels.data(), levels.size()}, fit, executor);
  for (std::size_t i = 0; i < grid.count * levels.size(); ++i) {
    const float off = levels[i % levels.size()] / kLevelSpread;
    fit[i] -= 0.5F * kLog2E * off * off / independent;
  }
  float best = fit[0];
  for (std::size_t i = 0; i < grid.count * levels.size(); ++i) best = std::max(best, fit[i]);
  double weight = 0.0, level = 0.0, mean[3] = {};
  for (std::size_t i = 0; i < grid.count * levels.size(); ++i) {
    const float bits = independent * (fit[i] - best);
    const auto w = static_cast<double>(exp2_of(std::max(bits, -100.0F)));
    const Vec3f& direction = grid.direction[i / levels.size()];
    weight += w;
    level += w * static_cast<double>(levels[i % levels.size()]);
    mean[0] += w * static_cast<double>(direction.x);
    mean[1] += w * static_cast<double>(direction.y);
    mean[2] += w * static_cast<double>(direction.z);
  }
  const Vec3f direction{static_cast<float>(mean[0] / weight), static_cast<float>(mean[1] / weight),
                        static_cast<float>(mean[2] / weight)};
  const float together = length(direction);
  sun.found = together >= p.least_together && best >= bits_without_direction(prior, walls) + p.least_gain;
  if (!sun.found) return {};
  sun.direction = direction / together;
  sun.exposure = static_cast<float>(level / weight);
  return {};
}

// share(x, y) of walls = how much of the sun reaches them, 0..1.
inline constexpr std::size_t kSunPlanes = 1 + kMeanFieldPlanes;
template <class Inside, class Normal, class Executor>
Status sun_on_walls(const SunParams& p, const Sun& sun, const Picture& picture, const Inside& inside,
                    const Normal& normal, float scale, Workspace& workspace, Plane share, Executor& executor) {
  constexpr float kSurest = 3.0F;  // log odds that the albedo of one pixel may give
  constexpr float kAway = -4.0F;   // log odds of what faces away
  const WorkspaceScope scope(workspace);
  Plane odds;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(picture.shape(), odds));
  const AlbedoPrior prior = prior_of_walls();
  for_pixels(picture.shape(), executor, [&](int x, int y) {
    if (!inside(x, y)) return;
    const Vec3f face = normal(x, y);
    const float cosine = sun.cosine(face);
    odds(x, y) = cosine > 0.0F ? kSurest : kAway;
    if (cosine > 0.0F && !is_roof(face, sun.up)) {
      const float seen = picture.log_y(x, y) - scale - sun.exposure;
      const float lit = log2_of(prior(seen - sun.log_light(face, cosine)));
      const float shade = log2_of(prior(seen - sun.log_light(face, 0.0F)));
      odds(x, y) = clamp_to(kLn2 * (lit - shade), -kSurest, kSurest);
    }
    share(x, y) = logistic(odds(x, y));
  });
  return mean_field(p.field, inside, picture.log_y, odds, picture, workspace, share, executor);
}

}  // namespace daylight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_DAYLIGHT_SUN_HPP
