// SPDX-License-Identifier: Apache-2.0
// What the exported mesh wears: the photograph as it is for what stands in front, and for the background a picture of
// the street without its objects, in which what they hide is continued from both sides along the row, as the light
// that the night's simulation reflects there is. Either of the photograph or of the albedo, both as 8-bit sRGB.
#ifndef NPSIM_SAMPLES_TOOL_MESH_TEXTURES_HPP
#define NPSIM_SAMPLES_TOOL_MESH_TEXTURES_HPP

#include <string>
#include <vector>

#include "npsim/core/vec.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"
#include "npsim/pipeline/night.hpp"

namespace npsim::tool {

struct MeshTexture {
  std::string name;
  std::string file;  // in the output folder
  io::Image<Rgb8> image;
  std::vector<unsigned char> png;  // the file
};

struct MeshTextures {
  MeshTexture background;
  MeshTexture objects;
};

[[nodiscard]] Rgb8 encoded(const Vec3f& linear);

// The photograph with the pixels that show objects filled from the background beside them.
[[nodiscard]] io::Image<Rgb8> without_objects(const io::Image<Rgb8>& photograph, const SceneMesh& mesh);

[[nodiscard]] MeshTextures photograph_textures(const io::Image<Rgb8>& photograph, const SceneMesh& mesh);
[[nodiscard]] MeshTextures albedo_textures(const SceneMesh& mesh, const SurfacePoints& points);

// Writes the file, and keeps its bytes for those that hold everything in one.
[[nodiscard]] io::Outcome write_texture(const std::string& folder, MeshTexture& texture);

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_MESH_TEXTURES_HPP
