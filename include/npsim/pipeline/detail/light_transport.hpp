// SPDX-License-Identifier: Apache-2.0
// From rays to the images of all lights: direct light, `bounces` gathers, what wet ground mirrors, the denoiser.
//
// kLightsAtOnce groups are made together: they share the reading of hits, and the weights of the denoiser. For each:
//   exitance of every point, lm/m2: albedo times the direct illuminance of the group's lamps at their strongest
//   indirect irradiance of every pixel, lx: the mean exitance that its rays meet, the sky, the street that is not seen
//   exitance of what pixels show += albedo times that; gather again, `bounces` times in all
// and the image is albedo / pi times the denoised irradiance. Direct light of each lamp has an image of its own,
// without noise to remove. On surfaces of unsure shape both are what may be expected there (render/unsure_light.hpp).
// The last gather is made with even and with odd rays apart. Half of what they differ by, weighted as in the night that
// is expected (every lamp at its mean intensity) and denoised like everything else, has the noise of the images: its
// size is error (LightTransport). It knows neither the denoiser's bias nor that of guesses about the scene. A single
// ray is compared with those of the neighbours, of which the denoiser takes what is not noise.
// Memory: light_transport_workspace_bytes(), 107 bytes a pixel and 33 for each point beyond their number; 24 more a
// pixel from 3 bounces on, 28 where it is wet.
#ifndef NPSIM_PIPELINE_DETAIL_LIGHT_TRANSPORT_HPP
#define NPSIM_PIPELINE_DETAIL_LIGHT_TRANSPORT_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/material/roughness.hpp"
#include "npsim/pipeline/detail/light_groups.hpp"
#include "npsim/pipeline/detail/mirrored_image.hpp"
#include "npsim/render/denoise.hpp"
#include "npsim/render/direct.hpp"
#include "npsim/render/gather.hpp"
#include "npsim/render/light_images.hpp"
#include "npsim/render/mirror.hpp"
#include "npsim/render/surface_points.hpp"
#include "npsim/render/unsure_light.hpp"
#include "npsim/render/visibility.hpp"
#include "npsim/simd/fixed.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace relight_detail {

inline constexpr std::size_t kPlanes = 3 * kLightsAtOnce;
static_assert(kPlanes <= kMostDenoisedPlanes && kPlanes == kLightLanes);

// What all groups have in common.
struct LitScene {
  SurfacePoints points;
  SurfacePoints lit_points;  // as lamps find them: of plants each a leaf of its own
  ImageView<const std::uint32_t> visible_point;
  Span<const Emitter> emitters;
  LightGroups groups;
  Span<const float> certain_cd;              // what each emitter shines in every night at least
  Span<const std::uint32_t> receivers;       // the points that pixels show, in the order of the pixels
  Span<const std::uint32_t> first_receiver;  // of each row, and their number
  Span<const std::uint32_t> hits;
  Span<const Vec3f> sky_irradiance;
  Span<const Vec2f> unseen;
  PointBlocks blocks;  // points that light is asked for
  Mirrors mirrors;
  UnsureLightGuides unsure;
  Vec3f up;
  float f0 = 0;
};

[[nodiscard]] constexpr std::size_t light_transport_workspace_bytes(Shape shape, std::size_t points, int bounces,
                                                                    bool wet) noexcept {
  const std::size_t pixels = shape.pixels();
  const std::size_t images = 1U + (bounces > 2 ? 1U : 0U) + (wet ? 1U : 0U);
  return LightImageBuilder::staging_bytes(shape) + allocation_bytes<float>(DenoiseGuides::floats(shape)) +
         images * allocation_bytes<float>(kPlanes * pixels) + (wet ? allocation_bytes<float>(pixels) : 0) +
         allocation_bytes<float>(3 * pixels) + allocation_bytes<float>(kPlanes * std::max(pixels, points)) +
         allocation_bytes<float>(points) + point_blocks_bytes(shape, points) +
         allocation_bytes<float>(light_tiles(shape).pixels() + points / kBlockPoints + 1);
}

class LightTransport {
 public:
  LightTransport(const LitScene& scene, int rays, int bounces, const DenoiseParams& denoise,
                 const UnsureLightParams& unsure_light) noexcept
      : scene_(scene),
        shape_(scene.visible_point.shape()),
        rays_(rays),
        bounces_(bounces),
        denoise_(denoise),
        unsure_light_(unsure_light) {}

  // Before make(). What it takes stays until the images are made.
  Status allocate(Workspace& workspace) noexcept {
    const std::size_t pixels = shape_.pixels();
    guides_.shape = shape_;
    NPSIM_RETURN_IF_ERROR(workspace.allocate(DenoiseGuides::floats(shape_), guides_.planes));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(kPlanes * pixels, now_));
    if (bounces_ > 2) NPSIM_RETURN_IF_ERROR(workspace.allocate(kPlanes * pixels, before_));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(3 * pixels, noise_));
    Span<float> room;
    NPSIM_RETURN_IF_ERROR(workspace.allocate(kPlanes * std::max(pixels, scene_.points.size()), room));
    exitance_ = room.sub(0, kLightLanes * scene_.points.size());
    spare_ = room.sub(0, kPlanes * pixels);
    NPSIM_RETURN_IF_ERROR(workspace.allocate(scene_.points.size(), certain_lx_));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(scene_.blocks.count(), untraced_lx_));
    for (float& e : certain_lx_) e = 0.0F;
    for (float& e : untraced_lx_) e = 0.0F;
    for (float& n : noise_) n = 0.0F;
    for (int y = 0; y < shape_.height; ++y) {
      for (int x = 0; x < shape_.width; ++x) {
        const std::uint32_t p = scene_.visible_point(x, y);
        guides_.set(x, y, p == kNoPoint ? Vec3f{} : scene_.points.position[p],
                    p == kNoPoint ? Vec3f{} : scene_.points.normal[p]);
      }
    }
    if (scene_.mirrors.pixel.empty()) return {};
    NPSIM_RETURN_IF_ERROR(workspace.allocate(kPlanes * pixels, mirrored_));
    NPSIM_RETURN_IF_ERROR(workspace.allocate(pixels, body_));
    for (float& share : body_) share = 1.0F;
    for (std::size_t i = 0; i < scene_.mirrors.pixel.size(); ++i) {
      body_[scene_.mirrors.pixel[i]] = share_below_film(scene_.f0, scene_.points, scene_.mirrors.point[i]);
    }
    return {};
  }

  // `expected`: the weight of each group in the night that is expected.
  template <class LightBlocks, class Executor, class Observer>
  Status make(Span<const Vec3f> expected, const LightBlocks& light_blocks, LightImageBuilder& images,
              Workspace& workspace, Executor& executor, Observer& observer) {
    for (std::size_t first = 0; first < scene_.groups.count && !observer.cancelled(); first += kLightsAtOnce) {
      first_ = first;
      in_batch_ = std::min(kLightsAtOnce, scene_.groups.count - first);
      NPSIM_RETURN_IF_ERROR(direct(light_blocks, images, workspace, executor, observer));
      indirect(expected, executor);
      NPSIM_RETURN_IF_ERROR(denoise_planes(denoise_, guides_, 3 * in_batch_, now_, spare_, executor));
      if (is_unsure()) {
        NPSIM_RETURN_IF_ERROR(spread_unsure_light(unsure_light_, scene_.unsure, 3 * in_batch_, now_, spare_, executor));
      }
      if (!mirrored_.empty()) {
        NPSIM_RETURN_IF_ERROR(
            denoise_planes(mirror_filter(denoise_), guides_, 3 * in_batch_, mirrored_, spare_, executor));
      }
      for (std::size_t i = 0; i < in_batch_; ++i) {
        stage_indirect(i, images, executor);
        NPSIM_RETURN_IF_ERROR(images.keep(first + i, i, workspace));
      }
      // The filter leaves its planes in either room; the next batch must not gather into its exitance.
      for (Span<float>* const planes : {&now_, &mirrored_}) {
        if (planes->data() == exitance_.data()) std::swap(*planes, spare_);
      }
    }
    return observer.cancelled() ? Status(StatusCode::cancelled, "cancelled while tracing light") : Status();
  }

  // Room for the image that error() is told, free from make() to error().
  [[nodiscard]] ImageView<Vec3f> night_room() const noexcept {
    static_assert(sizeof(Vec3f) == 3 * sizeof(float) && kPlanes >= 6, "three planes for it behind those of error()");
    return {reinterpret_cast<Vec3f*>(spare_.data() + 3 * shape_.pixels()), shape_};
  }

  // Root mean square over what pixels show, without the largest .1 %, of the noise of the expected night's luminance,
  // relative to it where a camera sees more than its own noise. night: that night, in night_room(). After make(), once.
  template <class Executor>
  Status error(ImageView<const Vec3f> night, double& out, Executor& executor) {
    constexpr float kFloor = 0.005F;  // cd/m2, that of luminance_errors()
    NPSIM_RETURN_IF_ERROR(denoise_planes(denoise_, guides_, 3, noise_, now_, executor));
    if (is_unsure())
      NPSIM_RETURN_IF_ERROR(spread_unsure_light(unsure_light_, scene_.unsure, 3, noise_, now_, executor));
    float* const squares = spare_.data();
    std::size_t n = 0;
    for_pixels(0, shape_.height, [&](int x, int y, std::size_t pixel, std::uint32_t p, std::size_t) {
      const float seen = luminance(night(x, y));
      if (!(seen > kFloor)) return;
      const float off = kInversePi * luminance(scene_.points.albedo[p] * channels(noise_, 0, pixel));
      squares[n++] = off * off / (seen * seen + kFloor * kFloor);
    });
    const std::size_t kept = n - n / 1000;
    if (kept < n) select_nth(squares, squares + kept, squares + n);
    double sum = 0;
    for (std::size_t i = 0; i < kept; ++i) sum += static_cast<double>(squares[i]);
    out = kept > 0 ? std::sqrt(sum / static_cast<double>(kept)) : 0.0;
    return {};
  }

  // Of what pixels show, the mean illuminance that lamps below the cut-off could bring, strongest and unhidden.
  [[nodiscard]] double mean_untraced_lx() const noexcept {
    double sum = 0;
    for (const float lx : untraced_lx_.sub(0, scene_.blocks.tiles)) sum += static_cast<double>(lx);
    return scene_.receivers.empty() ? 0.0 : sum / static_cast<double>(scene_.receivers.size());
  }

 private:
  static constexpr float kPi = 3.14159265F;
  static constexpr float kInversePi = 0.31830989F;

  // f(x, y, pixel, point, receiver) for what the pixels of some rows show.
  template <class F>
  void for_pixels(int begin, int end, const F& f) const {
    for (int y = begin; y < end; ++y) {
      std::size_t r = scene_.first_receiver[static_cast<std::size_t>(y)];
      for (int x = 0; x < shape_.width; ++x) {
        const std::uint32_t p = scene_.visible_point(x, y);
        if (p == kNoPoint) continue;
        f(x, y, static_cast<std::size_t>(y) * static_cast<std::size_t>(shape_.width) + static_cast<std::size_t>(x), p,
          r++);
      }
    }
  }
  template <class Executor, class F>
  void for_pixels(Executor& executor, const F& f) const {
    executor.for_chunks(static_cast<std::size_t>(shape_.height), 4, [&](std::size_t begin, std::size_t end) {
      for_pixels(static_cast<int>(begin), static_cast<int>(end), f);
    });
  }
  [[nodiscard]] Vec3f channels(Span<const float> planes, std::size_t light, std::size_t pixel) const noexcept {
    const float* const p = planes.data() + 3 * light * shape_.pixels() + pixel;
    return {p[0], p[shape_.pixels()], p[2 * shape_.pixels()]};
  }

  // Direct light of the batch's lamps: their images, and the exitance of all points.
  template <class LightBlocks, class Executor, class Observer>
  Status direct(const LightBlocks& light_blocks, LightImageBuilder& images, Workspace& workspace, Executor& executor,
                Observer& observer) {
    for (float& m : exitance_) m = 0.0F;
    const SurfacePoints& points = scene_.lit_points;
    const std::size_t count = scene_.emitters.size();
    for (std::size_t i = 0; i < 2 * count; ++i) {
      const std::size_t e = i % count;
      const std::size_t group = scene_.groups.group[e];
      const float peak = scene_.groups.peak_cd[e];
      if (group == kNoGroup || group < first_ || group >= first_ + in_batch_ || !(peak > 0.0F)) continue;
      // Light that is certain first, so that all others are set against all of it.
      if ((scene_.certain_cd[e] > 0.0F) != (i < count)) continue;
      const float certain = scene_.certain_cd[e] / peak;
      const std::size_t lane = 3 * (group - first_);
      const bool shown = scene_.groups.shines[e] != 0;  // else it is part of what its group may shine
      if (shown && is_unsure()) std::fill(now_.begin(), now_.end(), 0.0F);
      NPSIM_RETURN_IF_ERROR(light_blocks(e, certain_lx_, untraced_lx_, [&](std::size_t b, const BlockLight& light) {
        const Span<const std::uint32_t> block = scene_.blocks.of_block(b);
        for (std::size_t slot = 0; light.any && slot < kBlockPoints; ++slot) {
          const float lx = light.illuminance_lx[slot];
          if (!(lx > 0.0F)) continue;
          const std::uint32_t p = block[slot];
          const Vec3f handed_on = points.albedo[p] * lx;
          float* const to = exitance_.data() + std::size_t{p} * kLightLanes + lane;
          to[0] += handed_on.x;
          to[1] += handed_on.y;
          to[2] += handed_on.z;
          certain_lx_[p] += certain * lx;
        }
        if (b >= scene_.blocks.tiles || !shown) return;
        const auto luminance_of = [&](std::size_t slot) {
          const float lx = light.illuminance_lx[slot];
          return lx > 0.0F ? direct_light(points, block[slot], lx, light.to_light[slot], scene_.f0) : Vec3f{};
        };
        if (!is_unsure()) {
          images.stage(0, b, light.any, luminance_of);
        } else if (light.any) {
          lay_over_albedo(b, luminance_of);
        }
      }));
      if (shown && is_unsure()) NPSIM_RETURN_IF_ERROR(stage_spread(images, executor));
      if (shown) NPSIM_RETURN_IF_ERROR(images.keep(scene_.groups.image_of_emitter(e), 0, workspace));
      observer.progress(++done_, count);
    }
    return {};
  }

  [[nodiscard]] bool is_unsure() const noexcept { return !scene_.unsure.planes.empty(); }
  [[nodiscard]] Vec3f divisor(std::uint32_t p) const noexcept {
    return UnsureLightGuides::divisor(scene_.points.albedo[p]);
  }
  [[nodiscard]] std::size_t pixel_of(std::size_t tile, std::size_t slot) const noexcept {
    const auto across = static_cast<std::size_t>(light_tiles(shape_).width);
    const auto width = static_cast<std::size_t>(shape_.width);
    return (tile / across * kLightTile + slot / kLightTile) * width + tile % across * kLightTile + slot % kLightTile;
  }

  // Direct light of a tile, over albedo, into the first three planes of now_.
  template <class At>
  void lay_over_albedo(std::size_t tile, const At& luminance_of) noexcept {
    for (std::size_t slot = 0; slot < kLightTilePixels; ++slot) {
      const std::uint32_t p = scene_.blocks.of_block(tile)[slot];
      if (p == kNoPoint) continue;
      const Vec3f light = luminance_of(slot);
      const Vec3f albedo = divisor(p);
      float* const to = now_.data() + pixel_of(tile, slot);
      to[0] = light.x / albedo.x;
      to[shape_.pixels()] = light.y / albedo.y;
      to[2 * shape_.pixels()] = light.z / albedo.z;
    }
  }

  // Spreads what has been laid, with the other half of now_ as room, and stages it.
  template <class Executor>
  Status stage_spread(LightImageBuilder& images, Executor& executor) {
    static_assert(kPlanes >= 6, "three planes, and room for as many");
    Span<float> light = now_.sub(0, 3 * shape_.pixels());
    Span<float> other = now_.sub(3 * shape_.pixels(), 3 * shape_.pixels());
    const auto is_dark = [&](int y) {
      const std::size_t row = static_cast<std::size_t>(y) * static_cast<std::size_t>(shape_.width);
      for (std::size_t c = 0; c < 3; ++c) {
        const float* const from = light.data() + c * shape_.pixels() + row;
        if (std::any_of(from, from + shape_.width, [](float v) { return v != 0.0F; })) return false;
      }
      return true;
    };
    int first = 0;
    int last = shape_.height;
    while (first < last && is_dark(first)) ++first;
    while (last > first && is_dark(last - 1)) --last;
    if (first < last) {
      const int reach = unsure_light_reach_px(scene_.unsure.iterations);
      first = std::max(first - reach, 0);
      last = std::min(last + reach, shape_.height);
      NPSIM_RETURN_IF_ERROR(
          spread_unsure_light_in_rows(unsure_light_, scene_.unsure, first, last, 3, light, other, executor));
    }
    for_light_tiles(shape_, executor, [&](std::size_t tile, int, int top, int, int bottom) {
      images.stage(0, tile, bottom > first && top < last, [&](std::size_t slot) {
        const std::uint32_t p = scene_.blocks.of_block(tile)[slot];
        return p == kNoPoint ? Vec3f{} : divisor(p) * channels(light, 0, pixel_of(tile, slot));
      });
    });
    return {};
  }

  // Leaves the irradiance in now_, and what wet ground mirrors in mirrored_.
  template <class Executor>
  void indirect(Span<const Vec3f> expected, Executor& executor) {
    UnseenStreetLight street[kLightsAtOnce];
    unseen_street_light(scene_.points, scene_.receivers, scene_.up, exitance_, street);
    for (std::size_t e = 0; e < scene_.emitters.size(); ++e) {
      // The own headlamps light the picture and nothing else.
      const std::size_t group = scene_.groups.group[e];
      if (is_own_headlamp(scene_.emitters[e]) && group >= first_ && group < first_ + in_batch_) {
        street[group - first_] = UnseenStreetLight{};
      }
    }
    for (int bounce = 1;; ++bounce) {
      const bool last = bounce == bounces_;
      executor.for_chunks(static_cast<std::size_t>(shape_.height), 4, [&](std::size_t begin, std::size_t end) {
        gather_rows(static_cast<int>(begin), static_cast<int>(end), street, last, expected);
      });
      if (last) break;
      for_pixels(executor, [&](int, int, std::size_t pixel, std::uint32_t p, std::size_t) {
        for (std::size_t i = 0; i < in_batch_; ++i) {
          const Vec3f more =
              bounce == 1 ? channels(now_, i, pixel) : channels(now_, i, pixel) - channels(before_, i, pixel);
          const Vec3f handed_on = scene_.points.albedo[p] * more;
          float* const to = exitance_.data() + std::size_t{p} * kLightLanes + 3 * i;
          to[0] += handed_on.x;
          to[1] += handed_on.y;
          to[2] += handed_on.z;
        }
      });
      if (bounce + 1 < bounces_) std::swap(now_, before_);
    }
    if (mirrored_.empty()) return;
    for (float& m : mirrored_) m = 0.0F;
    executor.for_chunks(scene_.mirrors.pixel.size(), 1024, [&](std::size_t begin, std::size_t end) {
      for (std::size_t r = begin; r < end; ++r) {
        float lanes[kLightLanes];
        mirrored_luminance(scene_.mirrors, r, exitance_, lanes);
        if (first_ == 0) add(scene_.mirrors.sky[r], lanes);
        for (std::size_t c = 0; c < 3 * in_batch_; ++c) {
          mirrored_[c * shape_.pixels() + scene_.mirrors.pixel[r]] = lanes[c];
        }
      }
    });
  }

  static void add(const Vec3f& rgb, float* lanes) noexcept {
    lanes[0] += rgb.x;
    lanes[1] += rgb.y;
    lanes[2] += rgb.z;
  }

  void gather_rows(int begin, int end, const UnseenStreetLight (&street)[kLightsAtOnce], bool last,
                   Span<const Vec3f> expected) noexcept {
    const std::size_t plane = shape_.pixels();
    const float share = 1.0F / static_cast<float>(rays_);
    // Where one half has a ray more, their means are what differs by noise alone; one ray differs from its neighbours'.
    const auto odd_rays = static_cast<float>(rays_ / 2);
    const float uneven = rays_ == 1 ? 1.0F : std::sqrt((static_cast<float>(rays_) - odd_rays) / odd_rays);
    const float weight_of_even = share / uneven;
    const float odd_over_even = uneven * uneven;
    // The filter reads what lies between the points that it weighs, and must find numbers there.
    const std::size_t row = static_cast<std::size_t>(shape_.width);
    for (std::size_t c = 0; c < kPlanes; ++c) {
      std::fill(now_.data() + c * plane + static_cast<std::size_t>(begin) * row,
                now_.data() + c * plane + static_cast<std::size_t>(end) * row, 0.0F);
    }
    for_pixels(begin, end, [&](int x, int y, std::size_t pixel, std::uint32_t, std::size_t r) {
      float even[kLightLanes], odd[kLightLanes], sum[kLightLanes];
      const std::size_t first_hit = r * static_cast<std::size_t>(rays_);
      // Hits lie anywhere: their exitance is asked for ahead, by so many rays.
      constexpr std::size_t kAhead = 32;
      const std::size_t end_ahead = std::min(first_hit + kAhead + static_cast<std::size_t>(rays_), scene_.hits.size());
      for (std::size_t s = first_hit + kAhead; s < end_ahead; ++s) {
        const std::uint32_t hit = scene_.hits[s];
        if (hit != kNoPoint) simd::prefetch(exitance_.data() + std::size_t{hit} * kLightLanes);
      }
      gather_exitance(exitance_, scene_.hits.data() + first_hit, rays_, even, odd);
      for (std::size_t c = 0; c < kLightLanes; ++c) sum[c] = (even[c] + odd[c]) * share;
      for (std::size_t i = 0; i < in_batch_; ++i) add(street[i].luminance(scene_.unseen[r]) * kPi, sum + 3 * i);
      if (first_ == 0) add(scene_.sky_irradiance[r], sum);
      for (std::size_t c = 0; c < 3 * in_batch_; ++c) now_[c * plane + pixel] = sum[c];
      if (!last) return;
      const float signed_weight = rays_ == 1 && (x + y) % 2 == 1 ? -weight_of_even : weight_of_even;
      for (std::size_t i = 0; i < in_batch_; ++i) {
        const Vec3f weight = expected[first_ + i] * signed_weight;
        noise_[pixel] += weight.x * (even[3 * i] - odd_over_even * odd[3 * i]);
        noise_[plane + pixel] += weight.y * (even[3 * i + 1] - odd_over_even * odd[3 * i + 1]);
        noise_[2 * plane + pixel] += weight.z * (even[3 * i + 2] - odd_over_even * odd[3 * i + 2]);
      }
    });
  }

  template <class Executor>
  void stage_indirect(std::size_t light, LightImageBuilder& images, Executor& executor) const {
    for_light_tiles(shape_, executor, [&](std::size_t tile, int, int, int, int) {
      images.stage(light, tile, true, [&](std::size_t slot) {
        const std::uint32_t p = scene_.blocks.of_block(tile)[slot];
        if (p == kNoPoint) return Vec3f{};
        const std::size_t pixel = pixel_of(tile, slot);
        const Vec3f seen = scene_.points.albedo[p] * channels(now_, light, pixel) * kInversePi;
        return mirrored_.empty() ? seen : seen * body_[pixel] + channels(mirrored_, light, pixel);
      });
    });
  }

  const LitScene& scene_;
  Shape shape_;
  int rays_;
  int bounces_;
  DenoiseParams denoise_;
  UnsureLightParams unsure_light_;
  std::size_t first_ = 0;     // group of the batch
  std::size_t in_batch_ = 0;  // of its groups
  DenoiseGuides guides_;
  Span<float> now_, before_, mirrored_;  // kPlanes each: three channels of every light; `before` from 3 bounces on
  Span<float> spare_;        // as many for the filter, in the room of the exitance, which has served by then
  Span<float> noise_;        // three
  Span<float> exitance_;     // kLightLanes a point
  Span<float> body_;         // share of diffuse light that a film lets out, per pixel
  Span<float> untraced_lx_;  // per block, what weak lamps could bring that are not traced there
  std::size_t done_ = 0;     // emitters
  Span<float> certain_lx_;   // per point, that every night brings
};

}  // namespace relight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_LIGHT_TRANSPORT_HPP
