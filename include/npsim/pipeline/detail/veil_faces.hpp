// SPDX-License-Identifier: Apache-2.0
// Which faces of the scene mesh let light through: those of objects whose outline holds more gaps than the mesh does.
//
// A bicycle is tubes and spokes, but its label and its mesh are one skin. Light of lamps passes such a skin but for the
// share that the thing itself covers of its outline (render/visibility.hpp); what the camera sees of it stays. A face is
// one of a class where two of its corners are, so that the rim of a post beside a bicycle stays solid. Cost: a pass over
// the faces. Memory: a byte a face where there are any, else none. Error: none; a rule.
#ifndef NPSIM_PIPELINE_DETAIL_VEIL_FACES_HPP
#define NPSIM_PIPELINE_DETAIL_VEIL_FACES_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/render/visibility.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Share of its outline that each of these classes covers; 1: a solid.
struct VeilParams {
  float bicycle = 0.35F;
  float fence = 0.5F;  // between wire and boards

  [[nodiscard]] static constexpr VeilParams none() noexcept { return {1.0F, 1.0F}; }
};

[[nodiscard]] inline Status validate(const VeilParams& p) noexcept {
  for (const float cover : {p.bicycle, p.fence}) {
    if (!(cover >= 0.0F && cover <= 1.0F)) return {StatusCode::invalid_argument, "veils: shares in [0, 1]"};
  }
  return {};
}

// labels: those that the mesh was made with; empty: all is solid. for_each: see traced_faces.hpp. The workspace holds
// what `out` points at.
template <class ForEachFace>
[[nodiscard]] Status find_veils(const VeilParams& params, ImageView<const Label> labels, std::size_t faces,
                                const ForEachFace& for_each, Workspace& workspace, Veils& out) {
  out = Veils{};
  if (labels.empty()) return {};
  std::uint8_t veil_of_label[kLabelCount] = {};
  constexpr float kFar = 1e30F;
  const auto add = [&](Label l, float cover) {
    if (!(cover < 1.0F)) return;
    out.veil[out.count++] = {cover, {kFar, kFar, kFar}, {-kFar, -kFar, -kFar}};
    veil_of_label[l] = static_cast<std::uint8_t>(out.count);
  };
  add(label::bicycle, params.bicycle);
  add(label::fence, params.fence);
  bool any = false;
  for (int y = 0; y < labels.height() && !any; ++y) {
    for (int x = 0; x < labels.width() && !any; ++x)
      any = labels(x, y) < kLabelCount && veil_of_label[labels(x, y)] != 0;
  }
  if (!any) {
    out = Veils{};
    return {};
  }
  Span<std::uint8_t> of_face;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(faces, of_face));
  std::fill(of_face.begin(), of_face.end(), std::uint8_t{0});
  const auto width = static_cast<std::uint32_t>(labels.width());
  const auto veil_at = [&](std::uint32_t pixel) -> std::uint8_t {
    const Label l = labels(static_cast<int>(pixel % width), static_cast<int>(pixel / width));
    return l < kLabelCount ? veil_of_label[l] : std::uint8_t{0};
  };
  for_each([&](std::size_t face, const Vec3f(&corners)[3], const std::uint32_t(&pixels)[3], bool of_object) {
    if (!of_object) return;
    const std::uint8_t a = veil_at(pixels[0]);
    const std::uint8_t b = veil_at(pixels[1]);
    const std::uint8_t of = a == b ? a : veil_at(pixels[2]);
    if (of == 0 || (a != of && b != of)) return;
    of_face[face] = of;
    Veil& veil = out.veil[of - 1U];
    for (const Vec3f& c : corners) {
      veil.low = {std::fmin(veil.low.x, c.x), std::fmin(veil.low.y, c.y), std::fmin(veil.low.z, c.z)};
      veil.high = {std::fmax(veil.high.x, c.x), std::fmax(veil.high.y, c.y), std::fmax(veil.high.z, c.z)};
    }
  });
  out.of_face = of_face;
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_VEIL_FACES_HPP
