// SPDX-License-Identifier: Apache-2.0
// Takes the daytime photograph and the exact planes of a built street by ray casting.
//
// Light relative to a white wall facing the sun (1): sun with a traced shadow, sky and one bounce by a few hemisphere
// rays, mirror reflections of paint and glass, haze. The sky part is gathered apart from the albedo and smoothed
// across neighbours on the same surface, so that a few rays a pixel suffice. Cost: about five rays a sample.
// Every pixel is a function of its own coordinates only: rows may be done in any order.
#ifndef NPSIM_SAMPLES_STREET_RENDER_HPP
#define NPSIM_SAMPLES_STREET_RENDER_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dice.hpp"
#include "layout.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/trace/bvh.hpp"
#include "params.hpp"
#include "scene.hpp"
#include "sky.hpp"
#include "surface.hpp"

namespace npsim {
namespace street {

inline constexpr float kSkyScale = 0.42F;    // the sky's light against the sun's, on surfaces
inline constexpr float kSkyDisplay = 0.80F;  // and as the camera sees it between the roofs
inline constexpr std::size_t kRowsPerChunk = 4;

// Camera frame axes (right, down, forward) in the world.
inline Pose camera_pose(const Layout& l) {
  const float cy = std::cos(l.camera_yaw);
  const float sy = std::sin(l.camera_yaw);
  const float cp = std::cos(l.camera_pitch);
  const float sp = std::sin(l.camera_pitch);
  return {l.at(0, l.camera_d, l.camera_height), {cy, 0, -sy}, {-sy * sp, -cp, -cy * sp}, {sy * cp, -sp, cy * cp}};
}

// The scene in the camera frame with its tree; what rays are cast against.
struct Stage {
  const Scene* scene = nullptr;
  const Layout* layout = nullptr;
  Pose camera;
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<Vec3f> vertex_normals;  // world; zero where no smooth face meets
  std::vector<unsigned char> memory;
  Bvh bvh;

  [[nodiscard]] TriangleMeshView mesh() const {
    return {Span<const Vec3f>(vertices.data(), vertices.size()), Span<const Face>(faces.data(), faces.size())};
  }
  [[nodiscard]] Vec3f to_camera(const Vec3f& d) const { return {dot(d, camera.x), dot(d, camera.y), dot(d, camera.z)}; }
};

inline Status make_stage(const Scene& scene, const Layout& layout, Stage& stage) {
  stage.scene = &scene;
  stage.layout = &layout;
  stage.camera = camera_pose(layout);
  stage.vertices.reserve(scene.vertices.size());
  for (const Vec3f& v : scene.vertices) stage.vertices.push_back(stage.camera.to_local(v));
  stage.faces.reserve(scene.faces.size());
  for (const Face& f : scene.faces) stage.faces.push_back({f.a, f.c, f.b});  // the frame changes handedness
  stage.vertex_normals.assign(scene.vertices.size(), Vec3f{});
  for (std::size_t i = 0; i < scene.faces.size(); ++i) {
    if (!scene.info[i].smooth) continue;
    const Face& f = scene.faces[i];
    const Vec3f n = cross(scene.vertices[f.b] - scene.vertices[f.a], scene.vertices[f.c] - scene.vertices[f.a]);
    stage.vertex_normals[f.a] += n;
    stage.vertex_normals[f.b] += n;
    stage.vertex_normals[f.c] += n;
  }
  stage.memory.resize(bvh_workspace_bytes(stage.faces.size()));
  Workspace workspace(stage.memory.data(), stage.memory.size());
  return build_bvh(stage.mesh(), workspace, stage.bvh);
}

// A hit, made ready for shading. Points and directions in the world.
struct ShadePoint {
  std::uint32_t face = 0;
  float t = 0;
  Vec3f position{};
  Vec3f geometric{};  // unit, against the ray
  Vec3f normal{};     // interpolated where smooth
};

inline ShadePoint shade_point(const Stage& stage, const Vec3f& origin, const Vec3f& direction, const Hit& hit) {
  const Scene& scene = *stage.scene;
  const Face& f = scene.faces[hit.face];
  ShadePoint p;
  p.face = hit.face;
  p.t = hit.t;
  p.position = origin + direction * hit.t;
  p.geometric = normalized(cross(scene.vertices[f.b] - scene.vertices[f.a], scene.vertices[f.c] - scene.vertices[f.a]));
  if (dot(p.geometric, direction) > 0) p.geometric = -p.geometric;
  p.normal = p.geometric;
  if (scene.info[hit.face].smooth) {
    // Barycentric coordinates of the stage's face, whose b and c are exchanged.
    Vec3f n = normalized(stage.vertex_normals[f.a]) * (1 - hit.u - hit.v) + normalized(stage.vertex_normals[f.c]) * hit.u +
              normalized(stage.vertex_normals[f.b]) * hit.v;
    n = normalized(n);
    if (dot(n, p.geometric) < 0) n = -n;
    if (dot(n, direction) < -0.02F) p.normal = n;
  }
  return p;
}

inline bool trace_world(const Stage& stage, const Vec3f& origin, const Vec3f& direction, float t_max, Hit& hit) {
  Ray ray;
  ray.origin = stage.camera.to_local(origin);
  ray.direction = stage.to_camera(direction);
  ray.t_min = 1e-3F;
  ray.t_max = t_max;
  return closest_hit(stage.bvh, ray, hit);
}

inline bool in_shadow(const Stage& stage, const Vec3f& origin, const Vec3f& direction) {
  Ray ray;
  ray.origin = stage.camera.to_local(origin);
  ray.direction = stage.to_camera(direction);
  ray.t_min = 1e-3F;
  ray.t_max = 400;
  return occluded(stage.bvh, ray);
}

inline Vec3f sun_colour(const Layout& l) { return Vec3f{1.0F, 0.93F, 0.80F} * l.sun_strength; }

// Light leaving a face that a bounce ray meets: no further rays, sun assumed to reach half of what faces it.
inline Vec3f bounce_radiance(const Stage& stage, const ShadePoint& p) {
  const Material& m = stage.scene->materials[stage.scene->info[p.face].material];
  const float cosine = dot(p.geometric, stage.layout->sun);
  const Vec3f sky = horizon_radiance(*stage.layout) * (kSkyScale * (0.34F + 0.2F * p.geometric.y));
  return m.base * (sky + sun_colour(*stage.layout) * (cosine > 0 ? 0.5F * cosine : 0.0F));
}

// Orthonormal frame round n (Frisvad's construction with the sign fix of Duff et al., 2017).
inline void tangents(const Vec3f& n, Vec3f& t, Vec3f& b) {
  const float sign = n.z < 0 ? -1.0F : 1.0F;
  const float a = -1.0F / (sign + n.z);
  const float c = n.x * n.y * a;
  t = {1 + sign * n.x * n.x * a, sign * c, -sign * n.x};
  b = {c, sign + n.y * n.y * a, -n.y};
}

struct SampleLight {
  Vec3f direct{};   // finished radiance, haze included
  Vec3f albedo{};   // what the gathered sky light is still to be multiplied by
  Vec3f sky{};      // mean radiance from the hemisphere
};

// Where sample `index` of a pixel lies in its random domains: one lattice for all samples of the pixel (the R2 sequence,
// Roberts 2018), shifted per pixel, so that a few samples cover the sun's disc and the hemisphere evenly.
struct Lattice {
  Vec2f sun{};
  Vec2f sky{};
  int index = 0;
  [[nodiscard]] static Vec2f at(const Vec2f& shift, int i) {
    const float n = static_cast<float>(i);
    return {fract(shift.x + n * 0.7548777F), fract(shift.y + n * 0.5698403F)};
  }
};

inline Vec3f gather(const Stage& stage, const ShadePoint& p, int rays, const Lattice& lattice) {
  Vec3f t, b;
  tangents(p.normal, t, b);
  const Vec3f origin = p.position + p.geometric * 3e-3F;
  Vec3f sum{};
  for (int i = 0; i < rays; ++i) {
    const Vec2f uv = Lattice::at(lattice.sky, lattice.index * rays + i);
    const float r = std::sqrt(uv.y);
    const float a = 2 * kPi * uv.x;
    const Vec3f d = normalized(t * (r * std::cos(a)) + b * (r * std::sin(a)) + p.normal * std::sqrt(1 - uv.y));
    Hit hit;
    if (dot(d, p.geometric) <= 0) continue;
    if (trace_world(stage, origin, d, 60, hit)) {
      sum += bounce_radiance(stage, shade_point(stage, origin, d, hit));
    } else {
      sum += clear_sky(*stage.layout, d) * kSkyScale;
    }
  }
  return rays > 0 ? sum / static_cast<float>(rays) : horizon_radiance(*stage.layout) * (0.4F * kSkyScale);
}

inline float schlick(float f0, float cosine) {
  const float k = 1 - cosine;
  const float k2 = k * k;
  return f0 + (1 - f0) * k2 * k2 * k;
}

inline SampleLight shade(const Stage& stage, const Vec3f& eye, const Vec3f& ray, const ShadePoint& p, float pixel_rad,
                         int sky_rays, const Lattice& lattice, Dice& dice) {
  const Layout& l = *stage.layout;
  const Material& m = stage.scene->materials[stage.scene->info[p.face].material];
  const float view = std::fmax(0.02F, -dot(p.normal, ray));
  const float fp = p.t * pixel_rad * 0.65F / std::sqrt(view);
  const SurfaceSample s = surface_at(l, m, p.position, ray, fp);
  const Vec3f origin = p.position + p.geometric * 3e-3F;
  SampleLight out;
  out.albedo = s.albedo;
  out.sky = gather(stage, p, sky_rays, lattice);
  // A point of the sun's disc, half an angle of 0.0047 rad.
  Vec3f st, sb;
  tangents(l.sun, st, sb);
  const Vec2f su = Lattice::at(lattice.sun, lattice.index);
  const float disc = l.sun_radius * std::sqrt(su.x);
  const Vec3f sun_direction =
      normalized(l.sun + st * (disc * std::cos(2 * kPi * su.y)) + sb * (disc * std::sin(2 * kPi * su.y)));
  const float facing = dot(p.normal, sun_direction);
  const bool leaf = m.kind == Kind::leaf;
  float lit = 0;
  if ((leaf || (facing > 0 && dot(p.geometric, sun_direction) > 0))) {
    const Vec3f from = facing > 0 ? origin : p.position - p.geometric * 3e-3F;
    if (!in_shadow(stage, from, sun_direction)) lit = 1;
  }
  const Vec3f sun = sun_colour(l);
  if (lit > 0) {
    const float cosine = facing > 0 ? facing : -facing * 0.6F;  // leaves let light through
    out.direct += s.albedo * sun * cosine;
    if (s.mirror >= 0.03F && facing > 0) {
      const Vec3f half = normalized(sun_direction - ray);
      const float nh = dot(p.normal, half);
      const float a = std::fmax(0.06F, s.roughness * s.roughness);
      const float q = nh * nh * (a * a - 1) + 1;
      const float spec = schlick(s.mirror, std::fmax(0.0F, dot(half, sun_direction))) * a * a / (4 * q * q * view + 1e-4F);
      out.direct += sun * std::fmin(spec, 3.0F);
    }
  }
  if (s.mirror >= 0.04F) {
    const Vec3f n = p.normal;
    Vec3f d = ray - n * (2 * dot(ray, n));
    const float blur = 0.05F * s.roughness;
    d = normalized(d + Vec3f{dice.uniform(-1, 1), dice.uniform(-1, 1), dice.uniform(-1, 1)} * blur);
    if (dot(d, p.geometric) < 0.01F) d = normalized(d + p.geometric * (0.02F - dot(d, p.geometric)));
    const float fresnel = schlick(s.mirror, view);
    Hit hit;
    Vec3f seen{};
    if (trace_world(stage, origin, d, 200, hit)) {
      const ShadePoint q = shade_point(stage, origin, d, hit);
      const Material& qm = stage.scene->materials[stage.scene->info[q.face].material];
      const SurfaceSample qs = surface_at(l, qm, q.position, d, fp + hit.t * 0.004F);
      seen = qs.albedo * (horizon_radiance(l) * (kSkyScale * 0.45F));
      const float c = dot(q.geometric, l.sun);
      if (c > 0 && fresnel > 0.03F && !in_shadow(stage, q.position + q.geometric * 3e-3F, l.sun)) seen += qs.albedo * sun * c;
    } else {
      seen = sky_radiance(l, d) * kSkyDisplay;
    }
    out.direct += seen * fresnel;
  }
  if (s.glow > 0) out.direct += s.albedo * s.glow;
  // Aerial perspective.
  const float clear = std::exp(-p.t * 0.0007F * (0.4F + l.haze));
  const Vec3f air = horizon_radiance(l) * (kSkyDisplay * 0.9F);
  out.direct = out.direct * clear + air * (1 - clear);
  out.albedo *= clear;
  (void)eye;
  return out;
}

// Sky light smoothed over neighbours with like normal and depth.
inline Vec3f smoothed_sky(const std::vector<Vec3f>& sky, const Street& street, int x, int y, int radius) {
  const Vec3f n = street.normals(x, y);
  const float z = street.depth(x, y);
  Vec3f sum{};
  float weights = 0;
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx) {
      const int u = x + dx;
      const int v = y + dy;
      if (!street.depth.view().contains(u, v)) continue;
      const float zq = street.depth(u, v);
      if (!(zq > 0)) continue;
      const float cosine = dot(n, street.normals(u, v));
      if (cosine < 0.9F) continue;
      // Distance from the plane of the middle pixel, relative to its depth.
      const Vec3f pq = unproject_pixel(street.intrinsics, u, v, zq) - unproject_pixel(street.intrinsics, x, y, z);
      const float off = dot(pq, n) / (0.01F * z + 0.02F);
      const float w = std::exp(-off * off - 0.06F * static_cast<float>(dx * dx + dy * dy));
      sum += sky[static_cast<std::size_t>(v) * static_cast<std::size_t>(street.depth.width()) + static_cast<std::size_t>(u)] * w;
      weights += w;
    }
  }
  return weights > 0 ? sum / weights : sky[static_cast<std::size_t>(y) * static_cast<std::size_t>(street.depth.width()) + static_cast<std::size_t>(x)];
}

inline float srgb_encode(float v) {
  return v <= 0.0031308F ? 12.92F * v : 1.055F * std::pow(v, 1 / 2.4F) - 0.055F;
}

// Toe and shoulder of a camera: 0.18 stays, 2 nearly reaches white.
inline float tone_curve(float v) {
  const float p = std::pow(std::fmax(v, 0.0F), 1.28F);
  return 1.18F * p / (p + 0.62F);
}

// Fills image, the exact planes and, per pixel, the face seen (kNoFace for the sky).
template <class Executor>
void render_street(const Stage& stage, Street& street, std::vector<std::uint32_t>& seen, Executor& executor) {
  const Shape shape = street.params.shape;
  const Layout& l = *stage.layout;
  const Scene& scene = *stage.scene;
  const Intrinsics& k = street.intrinsics;
  const std::size_t width = static_cast<std::size_t>(shape.width);
  seen.assign(shape.pixels(), kNoFace);
  std::vector<Vec3f> direct(shape.pixels());
  std::vector<Vec3f> albedo(shape.pixels());
  std::vector<Vec3f> sky(shape.pixels());
  const float pixel_rad = 1.0F / k.fx;
  const int samples = street.params.samples;
  // Under a closed cover the ceiling is little brighter than what it lights.
  const float sky_display = mix(kSkyDisplay, 0.60F, smoothstep(0.8F, 0.95F, l.cloudiness));
  executor.for_chunks(static_cast<std::size_t>(shape.height), kRowsPerChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < shape.width; ++x) {
        const std::size_t at = row * width + static_cast<std::size_t>(x);
        // The exact planes.
        Ray centre;
        centre.direction = unproject_pixel(k, x, y, 1.0F);
        Hit hit;
        if (closest_hit(stage.bvh, centre, hit)) {
          const Vec3f d = stage.camera.direction(centre.direction);
          const float norm = length(d);
          Hit scaled_hit = hit;
          scaled_hit.t *= norm;
          const ShadePoint p = shade_point(stage, stage.camera.o, d / norm, scaled_hit);
          const FaceInfo& info = scene.info[hit.face];
          const float view = std::fmax(0.02F, -dot(p.geometric, d / norm));
          const SurfaceSample s = surface_at(l, scene.materials[info.material], p.position, d / norm,
                                             p.t * pixel_rad / std::sqrt(view));
          const Face& f = stage.faces[hit.face];
          Vec3f n = normalized(cross(stage.vertices[f.b] - stage.vertices[f.a], stage.vertices[f.c] - stage.vertices[f.a]));
          if (dot(n, centre.direction) > 0) n = -n;
          seen[at] = hit.face;
          street.depth(x, y) = hit.t;
          street.normals(x, y) = n;
          street.labels(x, y) = info.label;
          street.instances(x, y) = info.instance;
          street.albedo(x, y) = s.albedo;
          street.roughness(x, y) = s.roughness;
        } else {
          street.depth(x, y) = 0;
          street.normals(x, y) = {0, 0, -1};
          street.labels(x, y) = label::sky;
          street.instances(x, y) = label::sky;
          street.albedo(x, y) = {};
          street.roughness(x, y) = 1;
        }
        // The photograph: samples on a rotated rank-one lattice.
        Dice dice(street.params.seed, Topic::render, static_cast<std::uint32_t>(at));
        const float ox = dice.uniform();
        const float oy = dice.uniform();
        Lattice lattice;
        lattice.sun = {dice.uniform(), dice.uniform()};
        lattice.sky = {dice.uniform(), dice.uniform()};
        Vec3f sum_direct{};
        Vec3f sum_albedo{};
        Vec3f sum_sky{};
        int on_surface = 0;
        for (int i = 0; i < samples; ++i) {
          lattice.index = i;
          Dice d(street.params.seed, Topic::render, static_cast<std::uint32_t>(at), static_cast<std::uint32_t>(i) + 1U);
          // A tent a little wider than the pixel, as a lens and a low-pass filter would give.
          const auto tent = [](float u) { return u < 0.5F ? std::sqrt(2 * u) - 1 : 1 - std::sqrt(2 - 2 * u); };
          const float jx = 0.5F + 0.75F * tent(fract(ox + static_cast<float>(i) * 0.7548777F));
          const float jy = 0.5F + 0.75F * tent(fract(oy + static_cast<float>(i) * 0.5698403F));
          Ray ray;
          const Vec3f cam = unproject(k, static_cast<float>(x) + jx, static_cast<float>(y) + jy, 1.0F);
          ray.direction = normalized(cam);
          const Vec3f world = stage.camera.direction(ray.direction);
          Hit h;
          if (closest_hit(stage.bvh, ray, h)) {
            const ShadePoint p = shade_point(stage, stage.camera.o, world, h);
            const SampleLight light = shade(stage, stage.camera.o, world, p, pixel_rad, street.params.sky_rays, lattice, d);
            sum_direct += light.direct;
            sum_albedo += light.albedo;
            sum_sky += light.sky;
            ++on_surface;
          } else {
            sum_direct += sky_radiance(l, world) * sky_display;
          }
        }
        direct[at] = sum_direct / static_cast<float>(samples);
        albedo[at] = sum_albedo / static_cast<float>(samples);
        sky[at] = on_surface > 0 ? sum_sky / static_cast<float>(on_surface) : Vec3f{};
      }
    }
  });

  std::vector<Vec3f> radiance(shape.pixels());
  executor.for_chunks(static_cast<std::size_t>(shape.height), kRowsPerChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      for (int x = 0; x < shape.width; ++x) {
        const std::size_t at = row * width + static_cast<std::size_t>(x);
        const bool surface = street.depth(x, static_cast<int>(row)) > 0;
        const Vec3f s = surface ? smoothed_sky(sky, street, x, static_cast<int>(row), 4) : sky[at];
        radiance[at] = direct[at] + albedo[at] * s;
      }
    }
  });

  // Exposure: the mean of the logarithm goes to a dark grey, as matrix metering with a bright sky does.
  double sum = 0;
  for (const Vec3f& v : radiance) sum += std::log(1e-3 + static_cast<double>(luminance(v)));
  const float mean = static_cast<float>(std::exp(sum / static_cast<double>(radiance.size())));
  const float exposure = 0.175F / mean;
  Dice balance(street.params.seed, Topic::sky, 1);
  const Vec3f white{balance.uniform(0.97F, 1.04F), 1.0F, balance.uniform(0.97F, 1.05F)};
  executor.for_chunks(static_cast<std::size_t>(shape.height), kRowsPerChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      for (int x = 0; x < shape.width; ++x) {
        const std::size_t at = row * width + static_cast<std::size_t>(x);
        const Vec3f d = unproject_pixel(k, x, static_cast<int>(row), 1.0F);
        const float falloff = mix(1.0F, 1.0F / ((d.x * d.x + d.y * d.y + 1) * (d.x * d.x + d.y * d.y + 1)), 0.35F);
        Vec3f v = radiance[at] * white * (exposure * falloff);
        const float grey = luminance(v);
        v = mix(Vec3f{grey, grey, grey}, v, 1.06F);
        if (street.params.sensor_noise > 0) {
          // var = beta1 x + beta2, about ISO 200, after a mild denoiser.
          Dice dice(street.params.seed, Topic::render, static_cast<std::uint32_t>(at), 0xFFFFU);
          const auto gauss = [&] {
            return (dice.uniform() + dice.uniform() + dice.uniform() + dice.uniform() - 2.0F) * 1.7320508F;
          };
          const auto noisy = [&](float c) {
            return c + street.params.sensor_noise * gauss() * std::sqrt(4.0e-5F * std::fmax(c, 0.0F) + 1.0e-6F);
          };
          v = {noisy(v.x), noisy(v.y), noisy(v.z)};
        }
        const auto code = [](float c) {
          return static_cast<std::uint8_t>(255.0F * clamp01(srgb_encode(clamp01(tone_curve(c)))) + 0.5F);
        };
        street.image(x, static_cast<int>(row)) = {code(v.x), code(v.y), code(v.z)};
      }
    }
  });
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_RENDER_HPP
