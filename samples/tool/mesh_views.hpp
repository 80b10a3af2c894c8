// SPDX-License-Identifier: Apache-2.0
// Views of the scene mesh from any side, with the photograph on it.
#ifndef NPSIM_SAMPLES_TOOL_MESH_VIEWS_HPP
#define NPSIM_SAMPLES_TOOL_MESH_VIEWS_HPP

#include <cstddef>
#include <cstdint>
#include <vector>

#include "any.hpp"
#include "mesh_view_params.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/span.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/io/image.hpp"
#include "npsim/pipeline/night.hpp"
#include "npsim/render/preview.hpp"
#include "pictures.hpp"

namespace npsim::tool {

[[nodiscard]] ViewPose view_pose(const MeshViewParams& params, ImageView<const float> depth, const Intrinsics& camera);

// The photograph twice, one above the other: as the camera saw it, and without its objects, so that none is painted on
// the wall behind it.
class ViewColours {
 public:
  // Of the whole mesh.
  ViewColours(const io::Image<Rgb8>& photograph, const SceneMesh& mesh);
  // Of a sheet that has nothing hidden.
  ViewColours(const io::Image<Rgb8>& photograph, Span<const std::uint32_t> vertex_pixel);

  // The colours of the first `vertices` vertices.
  [[nodiscard]] PreviewColours of(std::size_t vertices) const;

 private:
  ViewColours(const io::Image<Rgb8>& upper, const io::Image<Rgb8>& lower, Span<const std::uint32_t> texel);

  io::Image<Rgb8> texture_;
  std::vector<std::uint32_t> texel_;
};

// Drawn at twice the size and shrunk, which takes the jags off.
[[nodiscard]] Status draw_mesh(const PreviewParams& params, const TriangleMeshView& mesh, const PreviewColours& colours,
                               const Intrinsics& camera, const ViewPose& pose, Shape shape, AnyExecutor executor,
                               io::Image<Rgb8>& out);

// The mesh as the thesis shows it: from the photograph's camera, 3 m closer, turned by 45 degrees; and the background
// alone.
[[nodiscard]] Status mesh_panels(const io::Image<Rgb8>& photograph, const SceneMesh& mesh, ImageView<const float> depth,
                                 const Intrinsics& camera, AnyExecutor executor, std::vector<Panel>& panels);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_MESH_VIEWS_HPP
