// SPDX-License-Identifier: Apache-2.0
// The scene mesh in parts that a person can tell apart in a viewer: the background, each object by its label and
// number, each lamp by its class and the number of its mark.
#ifndef NPSIM_SAMPLES_TOOL_MESH_PARTS_HPP
#define NPSIM_SAMPLES_TOOL_MESH_PARTS_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"
#include "npsim/light/emitter.hpp"

namespace npsim::tool {

inline constexpr std::size_t kNoTexture = ~std::size_t{0};

// With vertices of its own.
struct MeshPart {
  std::string name;
  std::string material;
  std::size_t texture = kNoTexture;  // position in the list of textures
  Vec3f colour{1, 1, 1};             // linear
  Vec3f emissive;
  std::vector<Vec3f> vertices;
  std::vector<Vec3f> normals;
  std::vector<std::uint32_t> pixels;  // of each vertex, where there is a texture
  std::vector<Face> faces;
};

// A mesh of layers, its background first, and what belongs to its vertices.
struct LayeredMesh {
  Span<const Vec3f> vertices;
  Span<const Vec3f> normals;
  Span<const std::uint32_t> pixels;
  Span<const Face> faces;
  std::size_t background_faces = 0;
};

[[nodiscard]] inline std::string without_spaces(std::string name) {
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
}

inline constexpr std::uint32_t kUnused = 0xFFFFFFFFU;

// Spreads the layers over the parts that part_of(pixel) tells; vertices without a face are left out, the others
// keep their order.
template <class PartOf>
void fill_parts(const LayeredMesh& mesh, std::size_t first_face, std::size_t last_face, const PartOf& part_of,
                std::vector<MeshPart>& parts) {
  std::vector<std::uint32_t> local(mesh.vertices.size(), kUnused);
  for (std::size_t f = first_face; f < last_face; ++f) {
    for (const std::uint32_t v : {mesh.faces[f].a, mesh.faces[f].b, mesh.faces[f].c}) local[v] = 0;
  }
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (local[v] == kUnused) continue;
    MeshPart& part = parts[part_of(mesh.pixels[v])];
    local[v] = static_cast<std::uint32_t>(part.vertices.size());
    part.vertices.push_back(mesh.vertices[v]);
    part.normals.push_back(mesh.normals[v]);
    part.pixels.push_back(mesh.pixels[v]);
  }
  for (std::size_t f = first_face; f < last_face; ++f) {
    const Face& face = mesh.faces[f];
    parts[part_of(mesh.pixels[face.a])].faces.push_back({local[face.a], local[face.b], local[face.c]});
  }
}

[[nodiscard]] inline MeshPart background_part(const LayeredMesh& mesh, std::size_t texture) {
  std::vector<MeshPart> parts(1);
  parts[0].name = parts[0].material = "background";
  parts[0].texture = texture;
  fill_parts(
      mesh, 0, mesh.background_faces, [](std::uint32_t) { return std::size_t{0}; }, parts);
  return std::move(parts[0]);
}

// One part per object that has a face. labels: may be empty; object: the number of every pixel's.
[[nodiscard]] inline std::vector<MeshPart> object_parts(const LayeredMesh& mesh, ImageView<const Label> labels,
                                                        ImageView<const std::uint32_t> object, std::size_t texture) {
  const auto width = static_cast<std::uint32_t>(object.width());
  const auto object_of = [&](std::uint32_t pixel) {
    return std::size_t{object(static_cast<int>(pixel % width), static_cast<int>(pixel / width))};
  };
  std::size_t count = 0;
  for (int y = 0; y < object.height(); ++y) {
    for (int x = 0; x < object.width(); ++x) count = std::max<std::size_t>(count, object(x, y));
  }
  std::vector<MeshPart> parts(count + 1);
  fill_parts(mesh, mesh.background_faces, mesh.faces.size(), object_of, parts);
  std::vector<MeshPart> kept;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    MeshPart& part = parts[i];
    if (part.faces.empty()) continue;
    part.name = "object_" + std::to_string(i);
    for (std::size_t v = 0; v < part.pixels.size() && !labels.empty(); ++v) {
      const std::uint32_t pixel = part.pixels[v];
      const Label label = labels(static_cast<int>(pixel % width), static_cast<int>(pixel / width));
      if (!kStandingLabels.contains(label)) continue;  // an object may reach over its outline by a pixel
      part.name = without_spaces(kLabels[label].name) + "_" + std::to_string(i);
      break;
    }
    part.material = "objects";
    part.texture = texture;
    kept.push_back(std::move(part));
  }
  return kept;
}

// A colour to tell lamps by, of the kind that they have at night; linear.
[[nodiscard]] inline Vec3f emitter_colour(const Emitter& e) {
  switch (e.state) {
    case SignalState::red: return {1.0F, 0.04F, 0.02F};
    case SignalState::amber: return {1.0F, 0.4F, 0.02F};
    case SignalState::green: return {0.05F, 1.0F, 0.5F};
    case SignalState::unknown: break;
  }
  switch (e.cls) {
    case LightClass::parked_rear:
    case LightClass::moving_rear: return {1.0F, 0.04F, 0.02F};
    case LightClass::none:  // of the own car
    case LightClass::parked_front:
    case LightClass::moving_front: return {1.0F, 0.95F, 0.85F};
    case LightClass::window_building: return {1.0F, 0.7F, 0.4F};
    case LightClass::street_light_ht:
    case LightClass::street_light_lt: return {1.0F, 0.8F, 0.5F};
    default: return {1.0F, 0.9F, 0.7F};
  }
}

// Every emitter's luminous patch, black but for what it emits; those of one class and state side by side.
[[nodiscard]] inline std::vector<MeshPart> emitter_parts(Span<const Emitter> emitters, Span<const LightMark> marks) {
  std::vector<MeshPart> parts;
  std::size_t own = 0;
  std::size_t following = 0;
  for (const Emitter& e : emitters) {
    MeshPart part;
    const bool marked = e.mark != 0 && e.mark <= marks.size();
    const std::string cls = is_own_headlamp(e)    ? "own_headlamp"
                            : is_following_car(e) ? "following_car"
                                                  : (marked ? "" : "unseen_") + without_spaces(info(e.cls).name);
    const std::size_t number = marked                ? marks[e.mark - 1U].id
                               : is_own_headlamp(e)  ? ++own
                               : is_following_car(e) ? ++following
                                                     : e.unseen;
    part.name = cls + "_" + std::to_string(number);
    static constexpr const char* kStates[] = {"", "_red", "_amber", "_green"};
    part.material = "emitter_" + cls + kStates[static_cast<std::size_t>(e.state)];
    part.colour = {};
    part.emissive = emitter_colour(e);
    const Vec3f normal = normalized(cross(e.half_v_m, e.half_u_m));
    for (const auto& [u, v] : {std::pair{-1.0F, -1.0F}, {1.0F, -1.0F}, {1.0F, 1.0F}, {-1.0F, 1.0F}}) {
      part.vertices.push_back(e.centre_m + e.half_u_m * u + e.half_v_m * v);
      part.normals.push_back(normal);
    }
    part.faces = {{0, 2, 1}, {0, 3, 2}};
    if (normal != Vec3f{}) parts.push_back(std::move(part));
  }
  std::stable_sort(parts.begin(), parts.end(),
                   [](const MeshPart& a, const MeshPart& b) { return a.material < b.material; });
  return parts;
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_MESH_PARTS_HPP
