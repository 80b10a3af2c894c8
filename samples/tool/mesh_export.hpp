// SPDX-License-Identifier: Apache-2.0
// The scene mesh as files: mesh.glb, mesh.obj with its materials, mesh.ply; and background.glb, .obj, .ply, the street
// with all objects taken away. All with x right, y up, z backward, as viewers expect, in metres.
#ifndef NPSIM_SAMPLES_TOOL_MESH_EXPORT_HPP
#define NPSIM_SAMPLES_TOOL_MESH_EXPORT_HPP

#include <cstddef>
#include <string>

#include "mesh_parts.hpp"
#include "mesh_textures.hpp"
#include "npsim/core/span.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/pipeline/night.hpp"

namespace npsim::tool {

// Everything that export_mesh() may write, with either texture.
inline constexpr const char* kMeshFiles[] = {
    "mesh.glb",       "mesh.obj",       "mesh.mtl",       "mesh.ply", "background.glb", "background.obj",
    "background.mtl", "background.ply", "background.png", "day.png",  "albedo.png",     "albedo_background.png"};

struct MeshExportOptions {
  bool albedo = false;  // as texture, in place of the photograph
};

// Positions in the list of textures.
inline constexpr std::size_t kBackgroundTexture = 0;
inline constexpr std::size_t kObjectsTexture = 1;

// mesh or background, in every format.
[[nodiscard]] io::Outcome write_parts(const std::string& stem, Span<const MeshPart> parts, const MeshTextures& textures,
                                      ThreadPool& pool);

[[nodiscard]] io::Outcome export_mesh(const std::string& folder, const io::Scene& scene, const SceneMesh& mesh,
                                      const Relighting& light, ThreadPool& pool, const MeshExportOptions& options = {});

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_MESH_EXPORT_HPP
