// SPDX-License-Identifier: Apache-2.0
// What a night loses when its rays meet the simplified mesh: one variant, rendered with all faces and with fewer.
#ifndef NPSIM_SAMPLES_NPSIM_NIGHT_CHANGE_HPP
#define NPSIM_SAMPLES_NPSIM_NIGHT_CHANGE_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "arena.hpp"
#include "console.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/image.hpp"
#include "npsim/pipeline/night.hpp"

namespace npsim::tool {

struct NightChange {
  std::array<std::size_t, 2> faces{};  // all, simplified
  double mean_colour = 0;              // of the linear picture: relative change of the channel that changes most
  double rms_codes = 0;                // root mean square over the picture as shown, in codes of 255
};

namespace night_change_detail {

struct Kept {
  std::size_t faces = 0;
  std::array<double, 3> mean{};
  io::Image<Rgb8> picture;

  Status reconstructed(const RefinedDepth&, const SceneMesh& mesh, const Relighting&) {
    faces = mesh.mesh.faces.size();
    return {};
  }
  Status night(const Night& night) {
    picture = io::Image<Rgb8>(night.picture.shape());
    copy_pixels(night.picture, picture.view());
    for (int y = 0; y < night.luminance.height(); ++y) {
      for (int x = 0; x < night.luminance.width(); ++x) {
        const Vec3f c = night.luminance(x, y);
        mean[0] += static_cast<double>(c.x);
        mean[1] += static_cast<double>(c.y);
        mean[2] += static_cast<double>(c.z);
      }
    }
    return {};
  }
};

}  // namespace night_change_detail

inline Status night_change(NightParams params, const SceneView& scene, ThreadPool& pool, Console& console,
                           NightChange& out) {
  params.variants = 1;
  params.mesh.traced = TracedFaces::mesh;
  std::array<night_change_detail::Kept, 2> nights;
  for (std::size_t i = 0; i < nights.size(); ++i) {
    params.mesh.simplify_faces = i == 1;
    const Arena arena(night_workspace_bytes(params, scene));
    if (arena.bytes() == 0) return {StatusCode::workspace_exhausted, "not enough memory for a night at this size"};
    Workspace workspace(arena.data(), arena.bytes());
    NPSIM_RETURN_IF_ERROR(make_nights(params, scene, workspace, pool, console, nights[i]));
    out.faces[i] = nights[i].faces;
  }
  for (std::size_t c = 0; c < 3; ++c) {
    const double full = nights[0].mean[c];
    if (full > 0) out.mean_colour = std::max(out.mean_colour, std::fabs(nights[1].mean[c] / full - 1.0));
  }
  double sum = 0;
  const Shape shape = nights[0].picture.shape();
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const Rgb8 a = nights[0].picture(x, y);
      const Rgb8 b = nights[1].picture(x, y);
      for (const int off : {a.r - b.r, a.g - b.g, a.b - b.b}) sum += static_cast<double>(off) * off;
    }
  }
  out.rms_codes = std::sqrt(sum / (3.0 * static_cast<double>(shape.pixels())));
  return {};
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_NPSIM_NIGHT_CHANGE_HPP
