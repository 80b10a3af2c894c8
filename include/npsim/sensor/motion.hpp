// SPDX-License-Identifier: Apache-2.0
// What moves while the shutter is open: blur by the camera's own motion and that of objects, rolling shutter, and lamps
// that are switched on and off faster than the eye sees.
//
// A camera that moves at v and turns at w (its own frame: x right, y down, z ahead) sees a point at P move by
//   dP/dt = u - v - w x P,   u the velocity of the object that it belongs to, over the street;
// its image moves at (dX - x dZ) fx / Z, (dY - y dZ) fy / Z with x = X / Z, y = Y / Z (Longuet-Higgins and Prazdny,
// "The interpretation of a moving retinal image", 1980). Where there is no depth, at the sky, only the turn counts.
// Over the time of one picture this velocity is taken for constant: a path is a straight segment.
// The photograph is the moment at which its middle row is half exposed; row y is exposed for `time` seconds about
//   t_y = readout ((y + 1/2) / height - 1/2).
//
// Light up to `lamp_cd_m2` is gathered: a pixel takes the mean of n samples along the path of what stands there at t_y,
// nearest pixels at equal steps, n about the length, even, and at most `samples`; 8 pixels of a row whose paths end
// within half a pixel of each other share one. Samples on something clearly nearer are left out: a pole does not smear
// over the houses behind it, whose own motion is another. So edges of near things stay sharp towards the outside, and
// what moves against its background by rows is narrowed by that, not shifted.
// What is brighter is a lamp, which would be lost among pixels that move otherwise: the light above lamp_cd_m2 is laid
// down along the lamp's own path, at most a pixel at a time, and none is lost. A lamp that flickers lays down all its
// light so, by its square wave 1 / duty for `duty` of each period: over many periods its mean is 1, in a short exposure
// it is dark or brighter than it seems, and its streak is dashed. What hides a lamp on its way is not looked for.
// Paths are mirrored at the borders: what leaves the picture is replaced by what enters.
// Invariants: a constant stays; streaks of lamps keep the sum within 1e-5, and so does a motion along rows or columns
// that all pixels share (a slanted one but for the corners, and a street that is driven through within 1 %); time 0 is
// the rows' moments.
// Error of what is gathered, against the integral along the path: at most g (1 + length / (4 n)) for light that changes
// by at most g a pixel; g more where rows are read one by one. Not modelled: shorter exposures of several, light of
// headlamps that moves with the car.
// Cost: about 10 ns a pixel and .8 ns a sample. Memory: 16 bytes a pixel, and 12 for the motion itself.
#ifndef NPSIM_SENSOR_MOTION_HPP
#define NPSIM_SENSOR_MOTION_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/sensor/detail/signal.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct ObjectMotion {
  std::uint16_t instance = 0;
  Vec3f velocity_m_s;  // over the street
};

struct MotionParams {
  Vec3f velocity_m_s;    // of the camera over the street
  Vec3f rotation_rad_s;  // about its axes; y > 0 turns it to the right
  Span<const ObjectMotion> objects;
  float readout_s = 0.0F;  // from the first row to the last; 0: all at once
  float lamp_cd_m2 = 20.0F;
  int samples = 12;  // 2 to 256; even
};

[[nodiscard]] inline Status validate(const MotionParams& p) noexcept {
  const auto below = [](const Vec3f& v, float most) noexcept { return is_finite(v) && length(v) <= most; };
  bool good = below(p.velocity_m_s, 1000.0F) && below(p.rotation_rad_s, 100.0F) && p.readout_s >= 0.0F &&
              p.readout_s <= 1.0F && p.lamp_cd_m2 > 0.0F && p.lamp_cd_m2 <= kMaxSample && p.samples >= 2 &&
              p.samples <= 256;
  for (const ObjectMotion& o : p.objects) good = good && below(o.velocity_m_s, 1000.0F);
  return good ? Status()
              : Status(StatusCode::invalid_argument,
                       "motion: speeds up to 1000 m/s, turns up to 100 rad/s, readout in [0, 1] s, lamps above more "
                       "than 0 cd/m2, 2 to 256 samples");
}

[[nodiscard]] constexpr bool has_motion(const MotionParams& p) noexcept {
  return p.velocity_m_s != Vec3f{} || p.rotation_rad_s != Vec3f{} || !p.objects.empty();
}

// A lamp's square wave.
struct LampFlicker {
  float frequency_hz = 0.0F;  // 0: shines evenly
  float duty = 1.0F;          // share of the period in which it is on; (0, 1]
  float phase = 0.0F;         // in periods, at the middle row's middle; it is on from phase 0 to duty
};

// Mean of the wave from one time to another, 1 over whole periods; its value where both are the same.
[[nodiscard]] inline double flicker_mean(const LampFlicker& lamp, double from_s, double to_s) noexcept {
  if (!(lamp.frequency_hz > 0.0F)) return 1.0;
  const auto duty = static_cast<double>(lamp.duty);
  const auto periods = [&lamp](double t) {
    return t * static_cast<double>(lamp.frequency_hz) + static_cast<double>(lamp.phase);
  };
  const auto on_time = [duty](double u) {  // of the periods before u
    const double whole = std::floor(u);
    return whole + (u - whole < duty ? (u - whole) / duty : 1.0);
  };
  const double from = periods(from_s);
  const double to = periods(to_s);
  if (!(to - from > 1e-9)) return from - std::floor(from) < duty ? 1.0 / duty : 0.0;
  return (on_time(to) - on_time(from)) / (to - from);
}

// What a pixel shows moves at (x, y), px/s; z is 1 / depth in 1/m, 0 at the sky.
using PixelMotion = Vec3f;

// depth: m, not positive or not finite: none; instances: ids, may be empty.
template <class Executor>
[[nodiscard]] Status motion_field(const MotionParams& params, const Intrinsics& camera, ImageView<const float> depth,
                                  ImageView<const std::uint16_t> instances, ImageView<PixelMotion> out,
                                  Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(validate(camera));
  const Shape shape = out.shape();
  if (out.empty() || depth.shape() != shape || (!instances.empty() && instances.shape() != shape)) {
    return {StatusCode::shape_mismatch, "motion: depth, instances and result must have the same size"};
  }
  using F = simd::F32;
  const Vec3f w = params.rotation_rad_s;
  const bool objects = !params.objects.empty() && !instances.empty();
  for_rows(executor, shape.height, [&](int row) {
    const F y((static_cast<float>(row) + 0.5F - camera.cy) / camera.fy);
    float v[3][simd::kMaxLanes];  // of the points against the camera
    const auto set = [&](int lane, const Vec3f& object) {
      const Vec3f relative = object - params.velocity_m_s;
      v[0][lane] = relative.x;
      v[1][lane] = relative.y;
      v[2][lane] = relative.z;
    };
    for (int i = 0; i < simd::kMaxLanes; ++i) set(i, {});
    for (int column = 0; column < shape.width; column += F::lanes) {
      const int n = shape.width - column < F::lanes ? shape.width - column : F::lanes;
      for (int i = 0; objects && i < n; ++i) {
        set(i, {});
        for (const ObjectMotion& o : params.objects) {
          if (o.instance == instances(column + i, row)) set(i, o.velocity_m_s);
        }
      }
      const F x = (F::iota() + F(static_cast<float>(column) + 0.5F - camera.cx)) * F(1.0F / camera.fx);
      const F z = load_first<F>(depth.row(row) + column, n);
      const F nearness = select(z > F(0.0F), F(1.0F) / max(z, F(0.1F)), F(0.0F));  // 0 of NaN and infinity
      const F dx = F::load(v[0]) * nearness + (F(w.z) * y - F(w.y));
      const F dy = F::load(v[1]) * nearness + (F(w.x) - F(w.z) * x);
      const F dz = F::load(v[2]) * nearness + (F(w.y) * x - F(w.x) * y);
      const auto speed = [](F d, F f) { return simd::clamp(d * f, -1e6F, 1e6F); };
      simd::store3<F>(&out.row(row)[column].x,
                      {speed(dx - x * dz, F(camera.fx)), speed(dy - y * dz, F(camera.fy)), nearness}, n);
    }
  });
  return {};
}

namespace motion_detail {

inline constexpr int kBlock = 8;  // pixels of a row that share a path, where they move alike

inline constexpr int kSegment = 64;  // pixels of a row that are searched for lamps together

// The light that is gathered and how near it is; rows have room for a batch more. Beside each other, so that samples of
// a path lie in few pages of memory.
struct Sample {
  float rgb[3];
  float nearness;
};

[[nodiscard]] constexpr Shape light_shape(Shape shape) noexcept {
  return {shape.width + simd::kMaxLanes, shape.height};
}
[[nodiscard]] constexpr Shape segment_shape(Shape shape) noexcept {
  return {(shape.width + kSegment - 1) / kSegment, shape.height};
}

[[nodiscard]] constexpr float row_time_s(float readout_s, int y, int height) noexcept {
  return readout_s * ((static_cast<float>(y) + 0.5F) / static_cast<float>(height) - 0.5F);
}

// Mirrored between the pixels of the border and those outside.
[[nodiscard]] constexpr int mirrored(int i, int n) noexcept {
  if (i >= 0 && i < n) return i;
  const int period = 2 * n;
  const int j = ((i % period) + period) % period;
  return j < n ? j : period - 1 - j;
}

// Halves away from 0, so that nearest(-v) is -nearest(v).
[[nodiscard]] constexpr int nearest(float v) noexcept { return static_cast<int>(v < 0.0F ? v - 0.5F : v + 0.5F); }

// What is clearly nearer than a pixel; a road under the car's nose is not, along a path.
[[nodiscard]] constexpr float hidden_from(float nearness) noexcept { return 1.25F * nearness + 0.005F; }

inline constexpr int kMostSteps = 4096;  // of a lamp's path

// Lays light down about (x, y), in pixels with the first one's centre at 0, shared by the four nearest.
inline void deposit(ImageView<Vec3f> out, float x, float y, const Vec3f& light) noexcept {
  const float left = std::floor(x);
  const float top = std::floor(y);
  const float share[2][2] = {{1.0F - (x - left), x - left}, {1.0F - (y - top), y - top}};
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      const float weight = share[0][i] * share[1][j];
      if (weight == 0.0F) continue;
      out(mirrored(static_cast<int>(left) + i, out.width()), mirrored(static_cast<int>(top) + j, out.height())) +=
          light * weight;
    }
  }
}

}  // namespace motion_detail

// The pixel of the photograph's moment that the picture of a rolling shutter shows at (x, y): labels move by it as the
// picture does. It solves q + velocity(q) t_y = (x, y) by fixed-point steps, an odd number: where the one thing has
// left and the other not arrived, the slower one stands there.
struct Pixel {
  int x = 0;
  int y = 0;
};
[[nodiscard]] inline Pixel shutter_source(float readout_s, ImageView<const PixelMotion> motion, int x, int y) noexcept {
  Pixel q{x, y};
  if (readout_s == 0.0F) return q;
  const float t = motion_detail::row_time_s(readout_s, y, motion.height());
  for (int i = 0; i < 3; ++i) {
    const PixelMotion& m = motion(q.x, q.y);
    q = {motion_detail::mirrored(x - motion_detail::nearest(m.x * t), motion.width()),
         motion_detail::mirrored(y - motion_detail::nearest(m.y * t), motion.height())};
  }
  return q;
}

namespace motion_detail {

// Whether kBlock pixels from `first` on keep within half a pixel of a motion for so long.
[[nodiscard]] inline bool moves_as(const PixelMotion& motion, ImageView<const PixelMotion> of, const Pixel& first,
                                   float time_s) noexcept {
  using F = simd::F32;
  constexpr int n = F::lanes < kBlock ? F::lanes : kBlock;
  F apart(0.0F);
  for (int i = 0; i < kBlock; i += F::lanes) {
    const simd::F32x3<F> m = simd::load3<F>(&of(first.x + i, first.y).x, n);
    const F most = max(abs(m.x - F(motion.x)), abs(m.y - F(motion.y)));
    apart = max(apart, select(F::MaskType::first(n), most, F(0.0F)));
  }
  return !any(apart * F(time_s) > F(0.5F));
}

// Means along paths.
struct Gather {
  Shape shape;
  ImageView<const Sample> light;
  float half_s;
  float most;  // px, of half a path
  int most_pairs;

  struct Path {
    float x, y;  // half of it
    int pairs;
    float from_x,
        from_y;  // its middle, against the pixel that shows it; not rounded, or slanted edges would have steps
  };
  [[nodiscard]] Path path(const PixelMotion& m, float row_s) const noexcept {
    const float x = clamp_to(m.x * half_s, -most, most);
    const float y = clamp_to(m.y * half_s, -most, most);
    const float length = max_of(std::fabs(x), std::fabs(y));
    const int wanted = length < 1.0F ? nearest(2.0F * length) : nearest(length);
    return {x, y, wanted < most_pairs ? wanted : most_pairs, clamp_to(-m.x * row_s, -most, most),
            clamp_to(-m.y * row_s, -most, most)};
  }
  // Calls f(dx, dy) for samples at either end in turn, so that they are symmetrical and no light is lost by rounding.
  template <class F>
  static void for_samples(const Path& path, const F& f) noexcept {
    if (path.pairs == 0) f(nearest(path.from_x), nearest(path.from_y));
    const float step = path.pairs > 0 ? 1.0F / static_cast<float>(path.pairs) : 0.0F;
    for (int k = 0; k < path.pairs; ++k) {
      const float at = (static_cast<float>(k) + 0.5F) * step;
      f(nearest(path.from_x + path.x * at), nearest(path.from_y + path.y * at));
      f(nearest(path.from_x - path.x * at), nearest(path.from_y - path.y * at));
    }
  }

  // Of the pixel that shows what is at `source` in the photograph's moment.
  [[nodiscard]] Vec3f pixel(const PixelMotion& m, const Pixel& shown, const Pixel& source, float row_s) const noexcept {
    const float limit = hidden_from(m.z);
    Vec3f sum;
    float count = 0.0F;
    const auto add = [&](int column, int row) {
      const int x = mirrored(column, shape.width);
      const int y = mirrored(row, shape.height);
      const Sample& s = light(x, y);
      if (s.nearness > limit) return;
      sum += Vec3f{s.rgb[0], s.rgb[1], s.rgb[2]};
      count += 1.0F;
    };
    for_samples(path(m, row_s), [&](int dx, int dy) { add(shown.x + dx, shown.y + dy); });
    if (count == 0.0F) add(source.x, source.y);
    return sum * (1.0F / count);
  }

  // Of kBlock pixels that share a path; false where it leaves the picture sideways. first: the first of them.
  [[nodiscard]] bool block(const PixelMotion& m, const Pixel& first, const Pixel& source, float row_s,
                           float* out) const noexcept {
    using F = simd::F32;
    const Path p = path(m, row_s);
    const int reach_x = nearest(std::fabs(p.x) + std::fabs(p.from_x));
    if (first.x < reach_x || first.x + kBlock + reach_x > shape.width) return false;
    for (int i = 0; i < kBlock; i += F::lanes) {
      const auto load = [&](int x, int y, F(&channel)[4]) {
        simd::load_columns<F>(light.row(y)[x + i].rgb, 16, 0, channel);
      };
      F own[4];
      load(source.x, source.y, own);
      const F limit = F(1.25F) * own[3] + F(0.005F);
      F sum[3] = {F(0.0F), F(0.0F), F(0.0F)};
      F count(0.0F);
      for_samples(p, [&](int dx, int dy) {
        F s[4];
        load(first.x + dx, mirrored(first.y + dy, shape.height), s);
        const auto seen = s[3] <= limit;
        for (int c = 0; c < 3; ++c) sum[c] = sum[c] + select(seen, s[c], F(0.0F));
        count = count + select(seen, F(1.0F), F(0.0F));
      });
      const auto none = count == F(0.0F);
      const F scale = F(1.0F) / select(none, F(1.0F), count);
      const auto mean = [&](int c) { return select(none, own[c], sum[c] * scale); };
      simd::store3<F>(out + 3 * i, {mean(0), mean(1), mean(2)}, F::lanes < kBlock ? F::lanes : kBlock);
    }
    return true;
  }
};

}  // namespace motion_detail

[[nodiscard]] constexpr std::size_t motion_workspace_bytes(Shape shape) noexcept {
  if (shape.empty()) return kWorkspaceAlignment;
  return allocation_bytes<motion_detail::Sample>(motion_detail::light_shape(shape).pixels()) +
         allocation_bytes<std::uint8_t>(motion_detail::segment_shape(shape).pixels()) + kWorkspaceAlignment;
}

// motion: of motion_field(). in, out: not the same. lamps: position + 1 in `flicker` of the lamp that a pixel shows, 0
// for none; may be empty.
template <class Executor>
[[nodiscard]] Status add_motion(const MotionParams& params, float time_s, ImageView<const PixelMotion> motion,
                                ImageView<const std::uint16_t> lamps, Span<const LampFlicker> flicker,
                                ImageView<const Vec3f> in, ImageView<Vec3f> out, Workspace& workspace,
                                Executor& executor) {
  using namespace motion_detail;
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(check_images(in, out));
  const Shape shape = in.shape();
  if (motion.shape() != shape || (!lamps.empty() && lamps.shape() != shape)) {
    return {StatusCode::shape_mismatch, "motion: the planes must have the picture's size"};
  }
  if (!(time_s >= 0.0F && time_s <= 3600.0F)) return {StatusCode::invalid_argument, "motion: time in [0, 3600] s"};
  for (const LampFlicker& lamp : flicker) {
    if (!(lamp.frequency_hz >= 0.0F && lamp.frequency_hz <= 1e6F && lamp.duty > 0.0F && lamp.duty <= 1.0F &&
          std::isfinite(lamp.phase))) {
      return {StatusCode::invalid_argument, "motion: lamps flicker at 0 to 1e6 Hz, with a duty in (0, 1]"};
    }
  }
  const WorkspaceScope scope(workspace);
  ImageView<Sample> light;
  ImageView<std::uint8_t> has_lamps;  // by segment
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(light_shape(shape), light));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(segment_shape(shape), has_lamps));

  const auto flicker_at = [&](int x, int y) -> const LampFlicker* {
    if (lamps.empty() || lamps(x, y) == 0 || lamps(x, y) > flicker.size()) return nullptr;
    const LampFlicker& lamp = flicker[lamps(x, y) - 1U];
    return lamp.frequency_hz > 0.0F ? &lamp : nullptr;
  };
  for_rows(executor, shape.height, [&](int y) {
    for (int x = 0; x < has_lamps.width(); ++x) has_lamps(x, y) = 0;
    Sample* to = light.row(y);
    for (int x = 0; x < shape.width; ++x) {
      const Vec3f rgb = sane_sample(in(x, y));
      to[x] = {{rgb.x, rgb.y, rgb.z}, motion(x, y).z};
      const float brightest = max_of(rgb.x, rgb.y, rgb.z);
      const bool flickers = flicker_at(x, y) != nullptr;
      if (!(brightest > params.lamp_cd_m2) && !flickers) continue;
      const float kept = flickers ? 0.0F : params.lamp_cd_m2 / brightest;
      for (float& c : to[x].rgb) c *= kept;
      has_lamps(x / kSegment, y) = 1;
    }
    for (int x = shape.width; x < light.width(); ++x) to[x] = {};
  });

  const auto most = static_cast<float>(4 * (shape.width + shape.height));  // px, of half a path
  const Gather gather{shape, light, 0.5F * time_s, most, params.samples / 2};
  for_rows(executor, shape.height, [&](int y) {
    const float row_s = row_time_s(params.readout_s, y, shape.height);
    for (int x = 0; x < shape.width; x += kBlock) {
      const int n = shape.width - x < kBlock ? shape.width - x : kBlock;
      if (n == kBlock) {
        const Pixel first{x, y};
        const PixelMotion& here = motion(x + kBlock / 2, y);
        const Pixel source{x - nearest(here.x * row_s), y - nearest(here.y * row_s)};
        if (source.x >= 0 && source.x + kBlock <= shape.width && source.y >= 0 && source.y < shape.height) {
          const PixelMotion& m = motion(source.x + kBlock / 2, source.y);
          if (moves_as(m, motion, source, gather.half_s) &&
              (row_s == 0.0F || moves_as(m, motion, first, std::fabs(row_s))) &&
              gather.block(m, first, source, row_s, &out(x, y).x)) {
            continue;
          }
        }
      }
      for (int i = 0; i < n; ++i) {
        const Pixel q = shutter_source(params.readout_s, motion, x + i, y);
        out(x + i, y) = gather.pixel(motion(q.x, q.y), {x + i, y}, q, row_s);
      }
    }
  });

  // Lamps are few, and their order is part of the sums: one after the other.
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (has_lamps(x / kSegment, y) == 0) {
        x += kSegment - 1;  // segments begin at their multiples, and so does x
        continue;
      }
      const LampFlicker* lamp = flicker_at(x, y);
      const Vec3f spread = sane_sample(in(x, y)) - Vec3f{light(x, y).rgb[0], light(x, y).rgb[1], light(x, y).rgb[2]};
      if (spread == Vec3f{}) continue;
      const PixelMotion& m = motion(x, y);
      // A row that is read `a` seconds after the one above sees the lamp while t (1 - a m.y) is within its exposure.
      const float approach = clamp_to(1.0F - m.y * params.readout_s / static_cast<float>(shape.height), 0.1F, 10.0F);
      const float middle = row_time_s(params.readout_s, y, shape.height) / approach;
      const float seen = time_s / approach;
      const float px = clamp_to(max_of(std::fabs(m.x), std::fabs(m.y)) * seen, 0.0F, 2.0F * most);
      const int steps = static_cast<int>(clamp_to(px + 1.0F, 1.0F, static_cast<float>(kMostSteps)));
      const float weight = 1.0F / (approach * static_cast<float>(steps));
      const float dt = seen / static_cast<float>(steps);
      for (int i = 0; i < steps; ++i) {
        const float from = middle + (static_cast<float>(i) - 0.5F * static_cast<float>(steps)) * dt;
        const float t = from + 0.5F * dt;
        const double on =
            lamp == nullptr ? 1.0 : flicker_mean(*lamp, static_cast<double>(from), static_cast<double>(from + dt));
        deposit(out, static_cast<float>(x) + clamp_to(m.x * t, -2.0F * most, 2.0F * most),
                static_cast<float>(y) + clamp_to(m.y * t, -2.0F * most, 2.0F * most),
                spread * (weight * static_cast<float>(on)));
      }
    }
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_SENSOR_MOTION_HPP
