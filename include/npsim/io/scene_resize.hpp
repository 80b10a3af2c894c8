// SPDX-License-Identifier: Apache-2.0
// A scene at another size.
//
// The photograph, albedo and roughness: average over the area of each new pixel (box filter; the photograph in linear
// light). Depth, normals, labels, instances and the light index: the sample nearest to the new pixel's centre, because
// an average across an edge belongs to neither side. A light source that would lose its last pixel keeps one, unless
// that would take the last pixel of another source; a group, which shines no light of its own, may lose all. Intrinsics
// are scaled; pixels may become non-square. Cost: the area average is separable, source pixels times twice the overlap.
// Memory: one float image.
#ifndef NPSIM_IO_SCENE_RESIZE_HPP
#define NPSIM_IO_SCENE_RESIZE_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/scene.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

// The source coordinate whose pixel holds the centre of new pixel i, in whole numbers so that it is exact.
[[nodiscard]] constexpr int nearest_sample(int i, int from, int to) noexcept {
  return static_cast<int>((2 * static_cast<std::int64_t>(i) + 1) * from / (2 * static_cast<std::int64_t>(to)));
}

template <class T>
[[nodiscard]] Image<T> resized_nearest(ImageView<const T> source, Shape to) {
  Image<T> out(to);
  if (source.empty()) return out;
  for (int y = 0; y < to.height; ++y) {
    const T* row = source.row(nearest_sample(y, source.height(), to.height));
    for (int x = 0; x < to.width; ++x) out(x, y) = row[nearest_sample(x, source.width(), to.width)];
  }
  return out;
}
template <class T>
[[nodiscard]] Image<T> resized_nearest(const Image<T>& source, Shape to) {
  return resized_nearest(source.view(), to);
}

namespace detail {

// Adds to `out` the part of `row` that new pixel i covers, as weights that sum to 1.
template <class Add>
void for_covered(int i, int from, int to, Add&& add) {
  const double begin = static_cast<double>(i) * from / to;
  const double end = static_cast<double>(i + 1) * from / to;
  const int first = static_cast<int>(begin);
  const int last = std::min(from - 1, static_cast<int>(std::ceil(end)) - 1);
  for (int s = first; s <= last; ++s) {
    const double covered = std::min(end, s + 1.0) - std::max(begin, static_cast<double>(s));
    if (covered > 0) add(s, static_cast<float>(covered / (end - begin)));
  }
}

}  // namespace detail

// T is float or Vec3f.
template <class T>
[[nodiscard]] Image<T> resized_area(const Image<T>& source, Shape to) {
  Image<T> wide(Shape{to.width, source.height()});
  for (int y = 0; y < source.height(); ++y) {
    for (int x = 0; x < to.width; ++x) {
      T sum{};
      detail::for_covered(x, source.width(), to.width, [&](int s, float w) { sum += source(s, y) * w; });
      wide(x, y) = sum;
    }
  }
  Image<T> out(to);
  for (int y = 0; y < to.height; ++y) {
    detail::for_covered(y, source.height(), to.height, [&](int s, float w) {
      for (int x = 0; x < to.width; ++x) out(x, y) += wide(x, s) * w;
    });
  }
  return out;
}

namespace detail {

// IEC 61966-2-1, both ways; io/ stands beside color/ and depends on neither its layout nor its speed.
[[nodiscard]] inline float srgb_decoded(std::uint8_t v) {
  const double c = v / 255.0;
  return static_cast<float>(c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4));
}
[[nodiscard]] inline std::uint8_t srgb_encoded(float linear) {
  const double c = std::min(1.0, std::max(0.0, static_cast<double>(linear)));
  const double encoded = c <= 0.0031308 ? 12.92 * c : 1.055 * std::pow(c, 1.0 / 2.4) - 0.055;
  return static_cast<std::uint8_t>(std::lround(255.0 * encoded));
}

[[nodiscard]] inline Image<Rgb8> resized_photograph(const Image<Rgb8>& source, Shape to) {
  std::array<float, 256> table{};
  for (std::size_t v = 0; v < 256; ++v) table[v] = srgb_decoded(static_cast<std::uint8_t>(v));
  Image<Vec3f> linear(source.shape());
  for (std::size_t i = 0; i < source.shape().pixels(); ++i) {
    const Rgb8& p = source.data()[i];
    linear.data()[i] = {table[p.r], table[p.g], table[p.b]};
  }
  const Image<Vec3f> small = resized_area(linear, to);
  Image<Rgb8> out(to);
  for (std::size_t i = 0; i < to.pixels(); ++i) {
    const Vec3f& p = small.data()[i];
    out.data()[i] = {srgb_encoded(p.x), srgb_encoded(p.y), srgb_encoded(p.z)};
  }
  return out;
}

// Nearest sample, then one pixel for each source that lost all. Returns how many were kept in that way.
inline std::size_t resize_light_index(Image<std::uint16_t>& index, const std::vector<LightMark>& lights, Shape to) {
  const std::size_t marks = lights.size();
  Image<std::uint16_t> out = resized_nearest(index, to);
  std::vector<std::size_t> left(marks + 1, 0);
  for (const std::uint16_t v : out.view().pixels()) {
    if (v <= marks) ++left[v];
  }
  // The centre of gravity of what a lost mark covered; sums in whole numbers.
  std::vector<std::array<std::int64_t, 3>> sums(marks + 1, {0, 0, 0});
  for (int y = 0; y < index.height(); ++y) {
    for (int x = 0; x < index.width(); ++x) {
      const std::uint16_t v = index(x, y);
      if (v == 0 || v > marks || left[v] > 0) continue;
      sums[v][0] += x;
      sums[v][1] += y;
      ++sums[v][2];
    }
  }
  std::size_t kept = 0;
  for (std::size_t v = 1; v <= marks; ++v) {
    if (sums[v][2] == 0 || is_group(lights[v - 1].cls)) continue;
    const int x = static_cast<int>((2 * sums[v][0] / sums[v][2] + 1) * to.width / (2 * index.width()));
    const int y = static_cast<int>((2 * sums[v][1] / sums[v][2] + 1) * to.height / (2 * index.height()));
    std::uint16_t& pixel = out(std::min(x, to.width - 1), std::min(y, to.height - 1));
    if (pixel != 0 && left[pixel] <= 1 && !is_group(lights[pixel - 1U].cls)) continue;
    --left[pixel];
    ++left[v];
    pixel = static_cast<std::uint16_t>(v);
    ++kept;
  }
  index = std::move(out);
  return kept;
}

// The class that most of the marked source pixels of a new pixel have, if they are a quarter of all: strips stay.
[[nodiscard]] inline Image<ReflectorClass> resized_reflectors(const Image<ReflectorClass>& source, Shape to) {
  constexpr float kLeast = 0.25F;
  Image<ReflectorClass> out(to);
  for (int y = 0; y < to.height; ++y) {
    for (int x = 0; x < to.width; ++x) {
      std::array<float, kReflectorNames.size()> share{};
      for_covered(y, source.height(), to.height, [&](int sy, float wy) {
        for_covered(x, source.width(), to.width,
                    [&](int sx, float wx) { share[static_cast<std::size_t>(source(sx, sy))] += wx * wy; });
      });
      share[0] = kLeast - 1e-4F;  // none; weights are rounded
      out(x, y) = static_cast<ReflectorClass>(std::max_element(share.begin(), share.end()) - share.begin());
    }
  }
  return out;
}

}  // namespace detail

[[nodiscard]] inline Expected<Scene> resized_scene(const Scene& scene, Shape to, const ReadLimits& limits = {}) {
  return guarded(scene.file, [&]() -> Expected<Scene> {
    const Expected<Shape> allowed = checked_shape(scene.file, to.width, to.height, sizeof(Vec3f), limits);
    if (!allowed) return allowed.error();
    const Shape from = scene.shape();
    if (from.empty()) return Error{scene.file, "image", "is empty, expected a scene that was read"};
    Scene out = scene;
    if (from == to) return out;
    out.image = detail::resized_photograph(scene.image, to);
    out.depth = resized_nearest(scene.depth, to);
    if (!scene.labels.empty()) out.labels = resized_nearest(scene.labels, to);
    if (!scene.instances.empty()) out.instances = resized_nearest(scene.instances, to);
    if (!scene.normals.empty()) out.normals = resized_nearest(scene.normals, to);
    if (!scene.albedo.empty()) out.albedo = resized_area(scene.albedo, to);
    if (!scene.reflectors.empty()) out.reflectors = detail::resized_reflectors(scene.reflectors, to);
    if (!scene.roughness.empty()) out.roughness = resized_area(scene.roughness, to);
    out.notes.push_back("resized from " + size_text(from) + " to " + size_text(to));
    if (!scene.light_index.empty()) {
      const std::size_t kept = detail::resize_light_index(out.light_index, out.lights, to);
      if (kept > 0) out.notes.push_back("lights: " + std::to_string(kept) + " small sources held at one pixel");
    }
    out.intrinsics = scaled(scene.intrinsics, from, to);
    bool any = false;
    for (const float z : std::as_const(out.depth).view().pixels()) any = any || is_valid_depth(z);
    if (!any)
      return Error{scene.file, "size", "no valid depth is left at " + size_text(to) + ", expected a larger size"};
    return out;
  });
}

inline Outcome resize_scene(Scene& scene, Shape to, const ReadLimits& limits = {}) {
  if (scene.shape() == to && !to.empty()) return Done{};
  Expected<Scene> resized = resized_scene(scene, to, limits);
  if (!resized) return resized.error();
  scene = std::move(resized.value());
  return Done{};
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_SCENE_RESIZE_HPP
