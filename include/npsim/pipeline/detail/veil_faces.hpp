// SPDX-License-Identifier: Apache-2.0
// Which faces of the scene mesh let light through: those of objects whose outline holds more gaps than the mesh does.
//
// A bicycle is tubes and spokes, but its label and its mesh are one skin. Light of lamps passes such a skin but for the
// share that the thing itself covers of its outline (render/visibility.hpp); what the camera sees of it stays. An
// object is of the class of most of its pixels: thin ones lie on their neighbours' too. Cost: a pass over the pixels
// and one over the faces. Memory: a byte a face where there are any, else none; 5 bytes a pixel for the search. Error:
// none; a rule.
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
#include "npsim/pipeline/detail/traced_faces.hpp"
#include "npsim/render/visibility.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Share of its outline that each of these classes covers; 1: a solid.
struct VeilParams {
  float bicycle = 0.35F;
  float fence = 0.5F;  // between wire and boards

  [[nodiscard]] static constexpr VeilParams none() noexcept { return {1.0F, 1.0F}; }
};

// On top of what is kept, a byte a face.
[[nodiscard]] constexpr std::size_t find_veils_workspace_bytes(Shape shape) noexcept {
  return allocation_bytes<std::uint8_t>(shape.pixels() + 1) + allocation_bytes<std::int32_t>(shape.pixels() + 1) +
         kWorkspaceAlignment;
}

[[nodiscard]] inline Status validate(const VeilParams& p) noexcept {
  for (const float cover : {p.bicycle, p.fence}) {
    if (!(cover >= 0.0F && cover <= 1.0F)) return {StatusCode::invalid_argument, "veils: shares in [0, 1]"};
  }
  return {};
}

// labels: those that the mesh was made with; empty: all is solid. object: of each pixel, 0 for none. for_each: see
// traced_faces.hpp. The workspace holds what `out` points at.
template <class ForEachFace>
[[nodiscard]] Status find_veils(const VeilParams& params, ImageView<const Label> labels,
                                ImageView<const std::uint32_t> object, std::size_t faces, const ForEachFace& for_each,
                                Workspace& workspace, Veils& out) {
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
  const auto veil_at = [&](int x, int y) -> std::uint8_t {
    return labels(x, y) < kLabelCount ? veil_of_label[labels(x, y)] : std::uint8_t{0};
  };
  bool any = false;
  for (int y = 0; y < labels.height() && !any; ++y) {
    for (int x = 0; x < labels.width() && !any; ++x) any = veil_at(x, y) != 0;
  }
  if (!any) {
    out = Veils{};
    return {};
  }
  Span<std::uint8_t> of_face;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(faces, of_face));
  std::fill(of_face.begin(), of_face.end(), std::uint8_t{0});
  const WorkspaceScope scope(workspace);
  Span<std::uint8_t> of_object;
  Span<std::int32_t> votes;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(labels.shape().pixels() + 1, of_object));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(labels.shape().pixels() + 1, votes));
  std::fill(of_object.begin(), of_object.end(), std::uint8_t{0});
  std::fill(votes.begin(), votes.end(), 0);
  for (int y = 0; y < labels.height(); ++y) {
    for (int x = 0; x < labels.width(); ++x) {
      const std::uint8_t veil = veil_at(x, y);
      votes[object(x, y)] += veil != 0 ? 1 : -1;
      if (veil != 0) of_object[object(x, y)] = veil;
    }
  }
  for (std::size_t o = 0; o < votes.size(); ++o) {
    if (o == 0 || votes[o] < 0) of_object[o] = 0;
  }
  for_each([&](std::size_t face, const Vec3f(&corners)[3], const std::uint32_t(&pixels)[3], bool is_object) {
    if (!is_object) return;
    const std::uint8_t of = of_object[at_pixel(object, pixels[0])];
    if (of == 0) return;
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
