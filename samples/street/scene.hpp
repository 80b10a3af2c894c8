// SPDX-License-Identifier: Apache-2.0
// The street under construction: triangles with material, label, instance and light, and the solids they are built of.
//
// World frame of the builder: x right, y up, z along the street, metres, origin on the road below the camera. Heights
// are easier to write that way; finishing turns it into the camera frame (y down), which also mirrors the handedness.
// Invariant: a face is stored so that cross(b - a, c - a), in world coordinates, points out of the solid.
#ifndef NPSIM_SAMPLES_STREET_SCENE_HPP
#define NPSIM_SAMPLES_STREET_SCENE_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dice.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"

namespace npsim {
namespace street {

enum class Kind : std::uint8_t {
  plain,
  road,
  pavement,
  kerb,
  plaster,
  brick,
  stone,
  roof_tiles,
  metal,
  pane,
  shop_pane,
  door,
  lettering,
  car_paint,
  car_glass,
  tyre,
  rim,
  lamp,
  plate,
  bark,
  leaf,
  cloth,
  sign,
  poster,
  clock_face,
  grass,
  hedge,
  awning,
  interior
};

// Where a local frame stands in the world: orthonormal axes and an origin.
struct Pose {
  Vec3f o{};
  Vec3f x{1, 0, 0};
  Vec3f y{0, 1, 0};
  Vec3f z{0, 0, 1};
  [[nodiscard]] Vec3f point(const Vec3f& p) const { return o + x * p.x + y * p.y + z * p.z; }
  [[nodiscard]] Vec3f direction(const Vec3f& d) const { return x * d.x + y * d.y + z * d.z; }
  [[nodiscard]] Vec3f to_local(const Vec3f& p) const {
    const Vec3f d = p - o;
    return {dot(d, x), dot(d, y), dot(d, z)};
  }
  [[nodiscard]] Pose moved(const Vec3f& local) const { return {point(local), x, y, z}; }
};

// Standing upright at `o`, its z axis turned from the street's by `heading` towards +x.
inline Pose upright(const Vec3f& o, float heading) {
  const float c = std::cos(heading);
  const float s = std::sin(heading);
  return {o, {c, 0, -s}, {0, 1, 0}, {s, 0, c}};
}

// Textures are functions of the hit point in the material's own frame; see surface.hpp.
struct Material {
  Kind kind = Kind::plain;
  Vec3f base{0.5F, 0.5F, 0.5F};  // linear
  Vec3f second{0.2F, 0.2F, 0.2F};
  float roughness = 0.8F;
  float mirror = 0;     // strength of the clear reflection at normal incidence (0.04: glass, varnish)
  float glow = 0;       // radiance by day relative to a sunlit white wall; burning lamps only
  float variation = 1;  // strength of stains and grain
  std::uint32_t seed = 0;
  int variant = 0;
  Vec2f size{1, 1};  // extent of the textured patch in the frame, m
  Pose frame{};
};

struct FaceInfo {
  std::uint16_t material = 0;
  std::uint16_t instance = 0;
  std::uint16_t light = 0;  // position + 1 in Scene::lights
  Label label = label::unlabeled;
  bool smooth = false;  // shaded with interpolated normals in the photograph
};

// A light of the scene; its patch is collected from the faces that carry it.
struct SceneLight {
  LightClass cls = LightClass::none;
  SignalState state = SignalState::unknown;
  std::uint16_t group = 0;  // position + 1 in Scene::groups
  bool lit_by_day = false;
  Vec3f axis{};  // unit, world: main direction; zero for glowing surfaces, which have that of their faces
  Vec3f up{};    // unit, normal to axis; of a street lamp along the road
};

// `instance` != 0: the annotation marks the faces of this instance (car body, bus), apart from its lights, as the
// group.
struct SceneGroup {
  LightClass cls = LightClass::none;
};

// What the next faces are made of.
struct Brush {
  std::uint16_t material = 0;
  Label label = label::unlabeled;
  std::uint16_t instance = 0;
  std::uint16_t light = 0;
  std::uint16_t panel = 0;  // group whose body these faces are; 0: none
  bool smooth = false;
  [[nodiscard]] Brush with(std::uint16_t m) const {
    Brush b = *this;
    b.material = m;
    return b;
  }
  [[nodiscard]] Brush lit(std::uint16_t m, std::uint16_t l) const {
    Brush b = with(m);
    b.light = l;
    return b;
  }
  [[nodiscard]] Brush smoothed() const {
    Brush b = *this;
    b.smooth = true;
    return b;
  }
  [[nodiscard]] Brush labelled(Label l) const {
    Brush b = *this;
    b.label = l;
    return b;
  }
};

class Scene {
 public:
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<FaceInfo> info;
  std::vector<std::uint16_t> panel;  // per face: group whose body it is, or 0
  std::vector<Material> materials;
  std::vector<SceneLight> lights;
  std::vector<SceneGroup> groups;

  std::uint16_t add(const Material& m) {
    materials.push_back(m);
    return static_cast<std::uint16_t>(materials.size() - 1);
  }
  std::uint16_t add_plain(const Vec3f& base, float roughness, float variation = 1) {
    Material m;
    m.base = base;
    m.roughness = roughness;
    m.variation = variation;
    m.seed = static_cast<std::uint32_t>(materials.size()) * 7919U;
    return add(m);
  }
  std::uint16_t add_light(LightClass cls, std::uint16_t group = 0, SignalState state = SignalState::unknown,
                          bool lit_by_day = false) {
    lights.push_back({cls, state, group, lit_by_day});
    return static_cast<std::uint16_t>(lights.size());
  }
  // The light, now a lamp that shines along `axis`.
  std::uint16_t aimed(std::uint16_t light, const Vec3f& axis, const Vec3f& up) {
    lights[light - 1U].axis = axis;
    lights[light - 1U].up = up;
    return light;
  }
  std::uint16_t add_group(LightClass cls) {
    groups.push_back({cls});
    return static_cast<std::uint16_t>(groups.size());
  }
  // label * 1000 + k, as in Cityscapes.
  std::uint16_t next_instance(Label l) {
    const std::uint16_t k = counts_[l]++;
    return static_cast<std::uint16_t>(l * 1000 + (k < 999 ? k : 999));
  }

  std::uint32_t vertex(const Vec3f& p) {
    vertices.push_back(p);
    return static_cast<std::uint32_t>(vertices.size() - 1);
  }
  // Drops triangles without area, so that every stored face has a normal.
  void triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c, const Brush& brush) {
    const Vec3f n = cross(vertices[b] - vertices[a], vertices[c] - vertices[a]);
    if (!(dot(n, n) > 1e-14F)) return;
    faces.push_back({a, b, c});
    const std::uint16_t instance = brush.instance != 0 ? brush.instance : static_cast<std::uint16_t>(brush.label);
    info.push_back({brush.material, instance, brush.light, brush.label, brush.smooth});
    panel.push_back(brush.panel);
  }
  void quad(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t d, const Brush& brush) {
    triangle(a, b, c, brush);
    triangle(a, c, d, brush);
  }
  // Corners in either sense of rotation; the face looks along `out`.
  void quad(const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& d, const Vec3f& out, const Brush& brush) {
    const std::uint32_t i = vertex(a);
    vertex(b);
    vertex(c);
    vertex(d);
    const Vec3f n = cross(c - a, d - b);
    if (dot(n, out) >= 0) {
      quad(i, i + 1, i + 2, i + 3, brush);
    } else {
      quad(i, i + 3, i + 2, i + 1, brush);
    }
  }
  void triangle(const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& out, const Brush& brush) {
    const bool keep = dot(cross(b - a, c - a), out) >= 0;
    const std::uint32_t i = vertex(a);
    vertex(keep ? b : c);
    vertex(keep ? c : b);
    triangle(i, i + 1, i + 2, brush);
  }
  // The rectangle [x0, x1] x [y0, y1] of a local plane z, looking along local +z.
  void panel_xy(const Pose& pose, float x0, float x1, float y0, float y1, float z, const Brush& brush) {
    quad(pose.point({x0, y0, z}), pose.point({x1, y0, z}), pose.point({x1, y1, z}), pose.point({x0, y1, z}), pose.z,
         brush);
  }
  void box(const Pose& pose, const Vec3f& lo, const Vec3f& hi, const Brush& brush) {
    const auto p = [&](int i) {
      return pose.point({(i & 1) != 0 ? hi.x : lo.x, (i & 2) != 0 ? hi.y : lo.y, (i & 4) != 0 ? hi.z : lo.z});
    };
    quad(p(1), p(3), p(7), p(5), pose.x, brush);
    quad(p(0), p(2), p(6), p(4), -pose.x, brush);
    quad(p(2), p(3), p(7), p(6), pose.y, brush);
    quad(p(0), p(1), p(5), p(4), -pose.y, brush);
    quad(p(4), p(5), p(7), p(6), pose.z, brush);
    quad(p(0), p(1), p(3), p(2), -pose.z, brush);
  }

  // Surface over the grid (i, j) in [0, nu] x [0, nv]; `point(i, j)` gives world points. `flip` turns its front side.
  template <class F>
  void grid(int nu, int nv, const F& point, bool flip, const Brush& brush) {
    const std::uint32_t first = static_cast<std::uint32_t>(vertices.size());
    for (int j = 0; j <= nv; ++j) {
      for (int i = 0; i <= nu; ++i) vertex(point(i, j));
    }
    for (int j = 0; j < nv; ++j) {
      for (int i = 0; i < nu; ++i) {
        const std::uint32_t a = first + static_cast<std::uint32_t>(j * (nu + 1) + i);
        const std::uint32_t b = a + 1;
        const std::uint32_t d = a + static_cast<std::uint32_t>(nu + 1);
        const std::uint32_t c = d + 1;
        if (flip) {
          quad(a, d, c, b, brush);
        } else {
          quad(a, b, c, d, brush);
        }
      }
    }
  }

  // Round bar from p to q (world), radii r0 and r1, `n` sides, both ends closed.
  void bar(const Vec3f& p, const Vec3f& q, float r0, float r1, int n, const Brush& brush) {
    const Vec3f axis = normalized(q - p);
    const Vec3f side = normalized(cross(axis, std::fabs(axis.y) < 0.9F ? Vec3f{0, 1, 0} : Vec3f{1, 0, 0}));
    const Vec3f other = cross(axis, side);
    const auto ring = [&](const Vec3f& c, float r, int i) {
      const float a = 2 * kPi * static_cast<float>(i) / static_cast<float>(n);
      return c + side * (r * std::cos(a)) + other * (r * std::sin(a));
    };
    const std::uint32_t first = static_cast<std::uint32_t>(vertices.size());
    for (int i = 0; i < n; ++i) {
      vertex(ring(p, r0, i));
      vertex(ring(q, r1, i));
    }
    const Brush round = brush.smoothed();
    for (int i = 0; i < n; ++i) {
      const std::uint32_t a = first + static_cast<std::uint32_t>(2 * i);
      const std::uint32_t b = first + static_cast<std::uint32_t>(2 * ((i + 1) % n));
      quad(a, b, b + 1, a + 1, round);
    }
    for (int i = 1; i + 1 < n; ++i) {
      triangle(ring(p, r0, 0), ring(p, r0, i), ring(p, r0, i + 1), -axis, brush);
      triangle(ring(q, r1, 0), ring(q, r1, i), ring(q, r1, i + 1), axis, brush);
    }
  }

  // Ellipsoid with half-axes `r` along the axes of `pose`.
  void ellipsoid(const Pose& pose, const Vec3f& r, int nu, int nv, const Brush& brush) {
    const auto point = [&](int i, int j) {
      const float a = 2 * kPi * static_cast<float>(i % nu) / static_cast<float>(nu);
      const float b = kPi * (static_cast<float>(j) / static_cast<float>(nv) - 0.5F);
      return pose.point({r.x * std::cos(b) * std::cos(a), r.y * std::sin(b), r.z * std::cos(b) * std::sin(a)});
    };
    const std::uint32_t first = static_cast<std::uint32_t>(vertices.size());
    for (int j = 0; j <= nv; ++j) {
      for (int i = 0; i < nu; ++i) vertex(point(i, j));
    }
    const Brush round = brush.smoothed();
    for (int j = 0; j < nv; ++j) {
      for (int i = 0; i < nu; ++i) {
        const std::uint32_t a = first + static_cast<std::uint32_t>(j * nu + i);
        const std::uint32_t b = first + static_cast<std::uint32_t>(j * nu + (i + 1) % nu);
        const std::uint32_t un = static_cast<std::uint32_t>(nu);
        quad(a, a + un, b + un, b, round);
      }
    }
  }

  // Flat disc (or regular polygon) round `centre`, looking along pose.z.
  void disc(const Pose& pose, float radius, int n, float first_angle, const Brush& brush) {
    const std::uint32_t c = vertex(pose.o);
    for (int i = 0; i < n; ++i) {
      const float a = first_angle + 2 * kPi * static_cast<float>(i) / static_cast<float>(n);
      vertex(pose.point({radius * std::cos(a), radius * std::sin(a), 0}));
    }
    const bool keep = dot(cross(vertices[c + 1] - vertices[c], vertices[c + 2] - vertices[c]), pose.z) >= 0;
    for (int i = 0; i < n; ++i) {
      const std::uint32_t a = c + 1 + static_cast<std::uint32_t>(i);
      const std::uint32_t b = c + 1 + static_cast<std::uint32_t>((i + 1) % n);
      if (keep) {
        triangle(c, a, b, brush);
      } else {
        triangle(c, b, a, brush);
      }
    }
  }

 private:
  std::uint16_t counts_[64] = {};
};

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_SCENE_HPP
