// SPDX-License-Identifier: Apache-2.0
#include "layers.hpp"

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <utility>

#include "../host.hpp"
#include "../named_scene.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/depth/refine_depth.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/mesh/complete.hpp"
#include "npsim/mesh/index.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim::bench {
namespace {

struct Close {
  void operator()(std::FILE* f) const { static_cast<void>(std::fclose(f)); }
};
using File = std::unique_ptr<std::FILE, Close>;

Layers layers_of(const SceneView& scene, ThreadPool& pool) {
  const Shape shape = scene.shape();
  Layers out{scene.camera, {Layer(shape), Layer(shape), Layer(shape)}};
  const RefineDepthParams depth_params;
  const ReconstructParams params;
  Arena arena(refine_depth_workspace_bytes(depth_params, shape) + reconstruct_workspace_bytes(params, shape));
  Workspace& workspace = arena.workspace();
  RefinedDepth refined;
  NullObserver quiet;
  must(refine_depth(depth_params, scene, workspace, pool, quiet, refined));
  io::Image<std::uint8_t> state(shape);
  io::Image<std::uint32_t> object(shape);
  const SheetLayer sheet = out.all[0].view();
  must(build_sheet(params.sheet, refined.depth, refined.surface, scene.camera, sheet, pool));
  must(prune(params.prune, refined.uncertain, refined.labels, sheet, pool));
  copy_pixels(sheet.vertices, out.all[1].vertices.view());
  copy_pixels(sheet.quads, out.all[1].quads.view());
  must(complete_background(params.background,
                           {sheet.vertices, refined.labels, refined.uncertain, refined.surface, scene.camera},
                           out.all[1].view(), state.view(), workspace, pool));
  must(complete_foreground(params.foreground,
                           {params.sheet, refined.depth, refined.surface, refined.labels, scene.instances,
                            refined.uncertain, state.view(), scene.camera},
                           out.all[2].view(), object.view(), workspace, pool));
  return out;
}

}  // namespace

Layers make_layers(Shape shape) {
  Layers out;
  const std::string name = "street1_" + std::to_string(shape.width) + "x" + std::to_string(shape.height);
  if (!make_layers(name, out)) std::exit(1);
  return out;
}

bool make_layers(const std::string& scene, Layers& layers) {
  ThreadPool pool;
  NamedScene named;
  if (!named.load(scene, pool)) return false;
  layers = layers_of(named.view(), pool);
  return true;
}

IndexedLayers index_layers(const std::vector<SheetLayer>& layers) {
  IndexedLayers out;
  for (const SheetLayer& layer : layers) {
    const MeshSize size = mesh_size(layer);
    const std::size_t v = out.vertices.size();
    const std::size_t f = out.faces.size();
    out.vertices.resize(v + size.vertices);
    out.faces.resize(f + size.faces);
    Arena arena(index_layer_workspace_bytes(layer.vertices.shape()));
    SerialExecutor serial;
    MeshSize written;
    must(index_layer(layer, static_cast<std::uint32_t>(v),
                     {{out.vertices.data() + v, size.vertices}, {out.faces.data() + f, size.faces}, {}}, written,
                     arena.workspace(), serial));
    auto next = static_cast<std::uint32_t>(f);
    for (int y = 0; y < layer.quads.height(); ++y) {
      for (int x = 0; x < layer.quads.width(); ++x) {
        for (const unsigned bit : {kQuadUpperFace, kQuadLowerFace}) {
          out.index_of.push_back((layer.quads(x, y) & bit) != 0 ? next++ : kNoFace);
        }
      }
    }
  }
  return out;
}

PairedFaces pair_faces(const IndexedLayers& mesh) {
  PairedFaces out;
  for (std::size_t q = 0; q < mesh.index_of.size(); q += 2) {
    const std::uint32_t upper = mesh.index_of[q];
    const std::uint32_t lower = mesh.index_of[q + 1];
    if (upper == kNoFace || lower == kNoFace) {
      for (const std::uint32_t f : {upper, lower}) {
        if (f != kNoFace) out.triangles.push_back(mesh.faces[f]);
      }
      continue;
    }
    // quad_face(): {a, c, b} and {b, c, d}, or {a, d, b} and {a, c, d}.
    const Face& u = mesh.faces[upper];
    const Face& l = mesh.faces[lower];
    out.quads.push_back(u.c == l.a ? Quad{{u.a, u.b, l.c, u.c}} : Quad{{u.c, u.a, l.b, u.b}});
  }
  return out;
}

bool save_layers(const Layers& layers, const char* path) {
  const File file(std::fopen(path, "wb"));
  if (!file) return false;
  const Shape shape = layers.all[0].vertices.shape();
  bool good = std::fwrite(&shape, sizeof shape, 1, file.get()) == 1 &&
              std::fwrite(&layers.intrinsics, sizeof layers.intrinsics, 1, file.get()) == 1;
  for (const Layer& l : layers.all) {
    good = good && std::fwrite(l.vertices.data(), sizeof(Vec3f), shape.pixels(), file.get()) == shape.pixels();
    const std::size_t quads = quad_shape(shape).pixels();
    good = good && std::fwrite(l.quads.data(), 1, quads, file.get()) == quads;
  }
  return good;
}

bool load_layers(const char* path, Layers& layers) {
  const File file(std::fopen(path, "rb"));
  if (!file) return false;
  Shape shape;
  bool good = std::fread(&shape, sizeof shape, 1, file.get()) == 1 &&
              std::fread(&layers.intrinsics, sizeof layers.intrinsics, 1, file.get()) == 1;
  if (!good || shape.width < 2 || shape.height < 2 || shape.width > 65536 || shape.height > 65536) return false;
  layers.all.assign(3, Layer(shape));
  for (Layer& l : layers.all) {
    good = good && std::fread(l.vertices.data(), sizeof(Vec3f), shape.pixels(), file.get()) == shape.pixels();
    const std::size_t quads = quad_shape(shape).pixels();
    good = good && std::fread(l.quads.data(), 1, quads, file.get()) == quads;
  }
  return good;
}

}  // namespace npsim::bench
