// SPDX-License-Identifier: Apache-2.0
#include "overlay.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"
#include "pictures.hpp"

namespace npsim::tool {
namespace {

// A hue for each label, far from that of its neighbours in the list.
[[nodiscard]] Rgb8 label_colour(Label l) {
  const float turn = std::fmod(static_cast<float>(l) * 0.618034F, 1.0F) * 6.0F;
  const auto channel = [&](float at) {
    float d = std::fabs(turn - at);
    d = std::min(d, 6.0F - d);
    return to_byte(std::clamp(2.0F - d, 0.15F, 1.0F));
  };
  return {channel(0), channel(2), channel(4)};
}

[[nodiscard]] Rgb8 mixed(Rgb8 a, Rgb8 b, float share) {
  const auto channel = [&](std::uint8_t p, std::uint8_t q) {
    return to_byte((static_cast<float>(p) + (static_cast<float>(q) - static_cast<float>(p)) * share) / 255.0F);
  };
  return {channel(a.r, b.r), channel(a.g, b.g), channel(a.b, b.b)};
}

// The cell of the ground's grid that the pixel's ray meets; 0: none, or beyond 60 m.
class GroundGrid {
 public:
  GroundGrid(const Intrinsics& camera, const GroundPlane& ground) : camera_(camera), ground_(ground) {
    const Vec3f ahead{0.0F, 0.0F, 1.0F};
    forward_ = normalized(ahead - ground.up * dot(ahead, ground.up));
    right_ = cross(forward_, ground.up);
  }
  // Above 0 where the ray climbs from the ground.
  [[nodiscard]] float climb(int x, int y) const { return dot(ground_.up, unproject_pixel(camera_, x, y, 1.0F)); }
  [[nodiscard]] int cell(int x, int y) const {
    const float rise = climb(x, y);
    if (!(rise < -1e-4F)) return 0;
    const Vec3f p = unproject_pixel(camera_, x, y, -ground_.camera_height_m / rise);
    const float along = dot(p, forward_);
    if (!(along < 60.0F)) return 0;
    return 1 + static_cast<int>(along / 5.0F) * 4096 + static_cast<int>(std::floor(dot(p, right_) / 2.5F)) + 2048;
  }

 private:
  Intrinsics camera_;
  GroundPlane ground_;
  Vec3f forward_, right_;
};

void draw_ground(const SceneView& scene, const GroundPlane& ground, io::Image<Rgb8>& out) {
  const GroundGrid grid(scene.camera, ground);
  for (int y = 0; y + 1 < out.height(); ++y) {
    for (int x = 0; x + 1 < out.width(); ++x) {
      const int cell = grid.cell(x, y);
      if (cell != 0 && (grid.cell(x + 1, y) != cell || grid.cell(x, y + 1) != cell)) {
        out(x, y) = mixed(out(x, y), {255, 255, 255}, 0.6F);
      }
      if ((grid.climb(x, y) > 0.0F) != (grid.climb(x, y + 1) > 0.0F)) out(x, y) = {255, 60, 60};
    }
  }
}

void draw_lamps(const SceneView& scene, io::Image<Rgb8>& out) {
  if (scene.light_index.empty()) return;
  struct Sum {
    std::int64_t x = 0, y = 0, count = 0;
  };
  std::vector<Sum> sums(scene.lights.size() + 1);
  for (int y = 0; y < out.height(); ++y) {
    for (int x = 0; x < out.width(); ++x) {
      const std::uint16_t mark = scene.light_index(x, y);
      if (mark == 0) continue;
      Sum& s = sums[mark];
      s.x += x;
      s.y += y;
      ++s.count;
      bool inside = true;
      for (const auto& [i, j] : {std::array{x - 1, y}, {x + 1, y}, {x, y - 1}, {x, y + 1}}) {
        inside = inside && scene.light_index.contains(i, j) && scene.light_index(i, j) == mark;
      }
      const bool group = is_group(scene.lights[mark - 1U].cls);
      if (!inside) out(x, y) = mixed(out(x, y), {255, 230, 40}, group ? 0.4F : 1.0F);
    }
  }
  for (std::size_t i = 1; i < sums.size(); ++i) {
    if (sums[i].count == 0 || is_group(scene.lights[i - 1].cls)) continue;
    draw_text(out, static_cast<int>(sums[i].x / sums[i].count) + 2, static_cast<int>(sums[i].y / sums[i].count) - 3, 1,
              std::to_string(scene.lights[i - 1].id), {255, 255, 255});
  }
}

void draw_reflectors(const SceneView& scene, io::Image<Rgb8>& out) {
  for (int y = 0; y < scene.reflectors.height(); ++y) {
    for (int x = 0; x < scene.reflectors.width(); ++x) {
      if (scene.reflectors(x, y) != ReflectorClass::none) out(x, y) = mixed(out(x, y), {60, 230, 255}, 0.6F);
    }
  }
}

}  // namespace

io::Image<Rgb8> overlay_picture(const SceneView& scene, const GroundPlane& ground) {
  io::Image<Rgb8> out(scene.shape());
  const auto object = [&](int x, int y) {
    return scene.instances.empty() ? 0 : static_cast<int>(scene.instances(x, y));
  };
  for (int y = 0; y < out.height(); ++y) {
    for (int x = 0; x < out.width(); ++x) {
      out(x, y) = scene.image(x, y);
      if (scene.labels.empty()) continue;
      out(x, y) = mixed(out(x, y), label_colour(scene.labels(x, y)), 0.35F);
      const bool edge = (x > 0 && (object(x - 1, y) != object(x, y) || scene.labels(x - 1, y) != scene.labels(x, y))) ||
                        (y > 0 && (object(x, y - 1) != object(x, y) || scene.labels(x, y - 1) != scene.labels(x, y)));
      if (edge) out(x, y) = {0, 0, 0};
    }
  }
  if (ground.inlier_share > 0.0F) draw_ground(scene, ground, out);
  draw_reflectors(scene, out);
  draw_lamps(scene, out);
  return out;
}

}  // namespace npsim::tool
