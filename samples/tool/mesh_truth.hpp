// SPDX-License-Identifier: Apache-2.0
// The true scene as geometry: its mesh behind a ray tracer, and where its lamps are.
//
// Only a generated scene has it: scene.json names truth.mesh (OBJ) and truth.emitters (JSON). Camera frame, metres.
#ifndef NPSIM_SAMPLES_TOOL_MESH_TRUTH_HPP
#define NPSIM_SAMPLES_TOOL_MESH_TRUTH_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/io/detail/json_fields.hpp"
#include "npsim/io/mesh.hpp"
#include "npsim/io/obj.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/trace/bvh.hpp"

namespace npsim::tool {

// A lamp as a shadow ray sees it. Only marked ones count: no reconstruction knows of those that the picture hides.
struct TrueLamp {
  Vec3f centre_m;
  Vec3f normal;            // unit; light leaves on this side
  float extent_m = 0;      // the larger half side
  std::uint32_t mark = 0;  // id of its annotation
};

// A mesh with its tree. Moving keeps the tree valid: its bytes stay where they are.
struct TracedMesh {
  std::vector<unsigned char> memory;
  Bvh tree;

  [[nodiscard]] Status build(const TriangleMeshView& mesh) {
    memory.resize(bvh_workspace_bytes(mesh.faces.size()));
    Workspace workspace(memory.data(), memory.size());
    return build_bvh(mesh, workspace, tree);
  }
};

struct MeshTruth {
  io::Mesh mesh;
  TracedMesh traced;
  std::vector<TrueLamp> lamps;

  [[nodiscard]] bool known() const { return !traced.tree.nodes.empty(); }
};

namespace truth_detail {

[[nodiscard]] inline io::Outcome read_floats(const io::JsonObject& object, const char* key, float* out,
                                             std::size_t count) {
  const io::Expected<const io::Json*> list = object.list(key);
  if (!list) return list.error();
  const io::Json& values = *list.value();
  if (values.size() != count) {
    return io::Error{
        object.file(), object.field(key),
        "has " + std::to_string(values.size()) + " entries, expected " + std::to_string(count) + " numbers"};
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (!values[i].is_number()) {
      return io::Error{object.file(), object.field(key), "holds something else than numbers, expected numbers"};
    }
    out[i] = values[i].get<float>();
  }
  return io::Done{};
}

[[nodiscard]] inline io::Expected<std::vector<TrueLamp>> read_lamps(const std::string& path) {
  const io::Expected<io::Json> json = io::read_json(path);
  if (!json) return json.error();
  const io::Expected<io::JsonObject> root = io::JsonObject::of(path, "", json.value());
  if (!root) return root.error();
  const io::Expected<const io::Json*> list = root.value().list("emitters");
  if (!list) return list.error();
  std::vector<TrueLamp> lamps;
  for (std::size_t i = 0; i < list.value()->size(); ++i) {
    const io::Expected<io::JsonObject> entry =
        io::JsonObject::of(path, "emitters[" + std::to_string(i) + "]", (*list.value())[i]);
    if (!entry) return entry.error();
    const io::Expected<std::int64_t> mark = entry.value().whole("mark");
    if (!mark) return mark.error();
    if (mark.value() == 0) continue;
    float centre[3];
    float normal[3];
    float half[2];
    if (const io::Outcome o = read_floats(entry.value(), "centre", centre, 3); !o) return o.error();
    if (const io::Outcome o = read_floats(entry.value(), "normal", normal, 3); !o) return o.error();
    if (const io::Outcome o = read_floats(entry.value(), "half_extents", half, 2); !o) return o.error();
    lamps.push_back({{centre[0], centre[1], centre[2]},
                     normalized(Vec3f{normal[0], normal[1], normal[2]}),
                     std::max(half[0], half[1]),
                     static_cast<std::uint32_t>(mark.value())});
  }
  return lamps;
}

}  // namespace truth_detail

// A scene that names no true mesh or no emitters gives an empty truth, which is not an error.
[[nodiscard]] inline io::Expected<MeshTruth> read_mesh_truth(const io::Scene& scene) {
  MeshTruth truth;
  if (scene.truth.mesh.empty() || scene.truth.emitters.empty()) return truth;
  io::Expected<io::Mesh> mesh = io::read_obj(scene.truth.mesh);
  if (!mesh) return mesh.error();
  truth.mesh = std::move(mesh.value());
  io::Expected<std::vector<TrueLamp>> lamps = truth_detail::read_lamps(scene.truth.emitters);
  if (!lamps) return lamps.error();
  if (const Status built = truth.traced.build(truth.mesh.view()); !built.ok()) {
    return io::Error{scene.truth.mesh, "", std::string(built.message()) + ", expected a mesh that can be traced"};
  }
  truth.lamps = std::move(lamps.value());
  return truth;
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_MESH_TRUTH_HPP
