// SPDX-License-Identifier: Apache-2.0
// What rays are traced through: the sheet of a scene after refinement of its depth, and its two completed layers.
#ifndef NPSIM_BENCH_RAYS_LAYERS_HPP
#define NPSIM_BENCH_RAYS_LAYERS_HPP

#include <cstdint>
#include <string>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/io/image.hpp"

namespace npsim::bench {

struct Layer {
  explicit Layer(Shape shape) : vertices(shape), quads(quad_shape(shape)) {}
  [[nodiscard]] SheetLayer view() { return {vertices.view(), quads.view()}; }
  io::Image<Vec3f> vertices;
  io::Image<std::uint8_t> quads;
};

struct Layers {
  Intrinsics intrinsics;
  std::vector<Layer> all;  // the sheet alone; the background; the foreground
};

// Layers as one indexed mesh.
struct IndexedLayers {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<std::uint32_t> index_of;  // of every face of the layers' own numbers; kNoFace where there is none
  [[nodiscard]] TriangleMeshView view() const {
    return {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}};
  }
};

[[nodiscard]] IndexedLayers index_layers(const std::vector<SheetLayer>& layers);

// The corners of a quad in order; Embree's diagonal is that from the second to the fourth.
struct Quad {
  std::uint32_t corner[4];
};

// The faces of layers as quads where both triangles are there, and the triangles that are alone. The quads consist of
// the same triangles.
struct PairedFaces {
  std::vector<Quad> quads;
  std::vector<Face> triangles;
};

[[nodiscard]] PairedFaces pair_faces(const IndexedLayers& mesh);

[[nodiscard]] Layers make_layers(Shape shape);  // of the generated street
// Of a scene.json or its folder; false, and a line on stderr, where it cannot be read.
[[nodiscard]] bool make_layers(const std::string& scene, Layers& layers);
[[nodiscard]] bool save_layers(const Layers& layers, const char* path);
[[nodiscard]] bool load_layers(const char* path, Layers& layers);

}  // namespace npsim::bench

#endif  // NPSIM_BENCH_RAYS_LAYERS_HPP
