// SPDX-License-Identifier: Apache-2.0
// npsim_bench_simplify: faces and time of the simplified layers by bound, beside meshoptimizer at the same error, as
// CSV.
//
// One line for each scene and bound. Both layers count together. The labels are kept ("labels") or not ("none"), which
// is how the peer sees the mesh.
//
// Equal error: of a row of targets (or those given by --target, in the unit of the space) the peer's mesh with the
// fewest faces counts whose error of depth at pixel centres, measured alike on both, is at most ours: by its RMS, and
// by its 99.9 % quantile (the peer does not bound its largest error). It is given the mesh in metres and, as the other
// space, over the image: (x, y, s ln z) with s such that 0.5 % of depth weigh as much as 0.25 px; the better of both
// counts. Its border is locked, as ours is.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "../host.hpp"
#include "../named_scene.hpp"
#include "../options.hpp"
#include "../timing.hpp"
#include "npsim/depth/refine_depth.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/image.hpp"
#include "npsim/mesh/complete.hpp"
#include "npsim/mesh/index.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/mesh/simplify.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#if defined(NPSIM_BENCH_MESHOPTIMIZER)
#include <meshoptimizer.h>
#endif

namespace {

using namespace npsim;

using bench::Arena;
using bench::median;
using bench::must;

struct Layer {
  explicit Layer(Shape shape) : vertices(shape), quads(quad_shape(shape)), ids(shape) {}
  [[nodiscard]] SheetLayer view() { return {vertices.view(), quads.view()}; }
  io::Image<Vec3f> vertices;
  io::Image<std::uint8_t> quads;
  io::Image<std::uint32_t> ids;  // label, object and lamp
};

struct Mesh {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<std::uint32_t> pixels;
};

struct Errors {
  double max = 0, quantile = 0, rms = 0;
};

class Case {
 public:
  Case(const SceneView& scene, ThreadPool& pool)
      : intrinsics_(scene.camera), layers_{Layer(scene.shape()), Layer(scene.shape())} {
    const Shape shape = scene.shape();
    const RefineDepthParams depth_params;
    const ReconstructParams params;
    Arena arena(refine_depth_workspace_bytes(depth_params, shape) + reconstruct_workspace_bytes(params, shape));
    Workspace& workspace = arena.workspace();
    RefinedDepth refined;
    NullObserver quiet;
    must(refine_depth(depth_params, scene, workspace, pool, quiet, refined));
    io::Image<std::uint8_t> state(shape);
    io::Image<std::uint32_t> object(shape);
    const SheetLayer back = layers_[0].view();
    must(build_sheet(params.sheet, refined.depth, refined.surface, scene.camera, back, pool));
    must(prune(params.prune, refined.uncertain, refined.labels, back, pool));
    must(complete_background(params.background,
                             {back.vertices, refined.labels, refined.uncertain, refined.surface, scene.camera}, back,
                             state.view(), workspace, pool));
    must(complete_foreground(params.foreground,
                             {params.sheet, refined.depth, refined.surface, refined.labels, scene.instances,
                              refined.uncertain, state.view(), scene.camera},
                             layers_[1].view(), object.view(), workspace, pool));
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const std::uint32_t lamp = scene.light_index.empty() ? 0U : scene.light_index(x, y);
        layers_[0].ids(x, y) = refined.labels(x, y) | lamp << 8U;
        layers_[1].ids(x, y) = object(x, y) << 8U ^ lamp << 20U ^ refined.labels(x, y);
      }
    }
    for (Layer& layer : layers_) {
      const MeshSize size = mesh_size(layer.view());
      Mesh mesh;
      mesh.vertices.resize(size.vertices);
      mesh.faces.resize(size.faces);
      mesh.pixels.resize(size.vertices);
      Arena memory(index_layer_workspace_bytes(shape));
      MeshSize written;
      must(index_layer(layer.view(), 0, buffers(mesh), written, memory.workspace(), pool));
      full_.push_back(std::move(mesh));
    }
  }

  [[nodiscard]] std::size_t faces() const { return full_[0].faces.size() + full_[1].faces.size(); }

  // Simplifies both layers; returns the time in ms.
  template <class Executor>
  double simplify(float bound, bool labels, Executor& executor, std::vector<Mesh>& out) {
    SimplifyParams params;
    params.max_relative_depth_error = bound;
    const Shape shape = layers_[0].vertices.shape();
    out.assign(2, {});
    double ms = 0;
    for (std::size_t l = 0; l < 2; ++l) {
      out[l] = full_[l];  // as large as it may get, and touched
      Arena arena(simplify_layer_workspace_bytes(params, shape));
      SimplifyResult result;
      const ImageView<const std::uint32_t> ids = std::as_const(layers_[l].ids).view();
      const auto start = std::chrono::steady_clock::now();
      must(simplify_layer(params, layers_[l].view(), labels ? ids : ImageView<const std::uint32_t>(), intrinsics_, 0,
                          buffers(out[l]), result, arena.workspace(), executor));
      ms += since(start);
      out[l].vertices.resize(result.size.vertices);
      out[l].pixels.resize(result.size.vertices);
      out[l].faces.resize(result.size.faces);
    }
    return ms;
  }

  // Depth at the pixel centres of every face against the layer's.
  [[nodiscard]] Errors errors(const std::vector<Mesh>& meshes) {
    std::vector<float> all;
    double sum = 0;
    for (std::size_t l = 0; l < 2; ++l) {
      io::Image<float> depth(layers_[l].vertices.shape());
      const Mesh& m = meshes[l];
      must(simplified_depth({{m.vertices.data(), m.vertices.size()}, {m.faces.data(), m.faces.size()}},
                            {m.pixels.data(), m.pixels.size()}, depth.view()));
      for (const std::uint32_t p : full_[l].pixels) {
        const float z = depth.data()[p];
        if (!(z > 0.0F)) continue;
        const float relative = std::fabs(z / layers_[l].vertices.data()[p].z - 1.0F);
        all.push_back(relative);
        sum += static_cast<double>(relative) * static_cast<double>(relative);
      }
    }
    Errors e;
    if (all.empty()) return e;
    e.rms = std::sqrt(sum / static_cast<double>(all.size()));
    const std::size_t k = all.size() - 1 - all.size() / 1000;
    std::nth_element(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(k), all.end());
    e.quantile = static_cast<double>(all[k]);
    e.max = static_cast<double>(*std::max_element(all.begin() + static_cast<std::ptrdiff_t>(k), all.end()));
    return e;
  }

#if defined(NPSIM_BENCH_MESHOPTIMIZER)
  double peer(double target, bool image_space, std::vector<Mesh>& out) {
    out.assign(2, {});
    double ms = 0;
    for (std::size_t l = 0; l < 2; ++l) {
      const Mesh& full = full_[l];
      if (full.faces.empty()) continue;
      std::vector<Vec3f> positions = full.vertices;
      if (image_space) {
        const auto width = static_cast<std::uint32_t>(layers_[l].vertices.width());
        for (std::size_t v = 0; v < positions.size(); ++v) {
          positions[v] = {static_cast<float>(full.pixels[v] % width), static_cast<float>(full.pixels[v] / width),
                          50.0F * std::log(full.vertices[v].z)};
        }
      }
      static_assert(sizeof(Face) == 3 * sizeof(unsigned));
      out[l] = full;
      const auto* indices = reinterpret_cast<const unsigned*>(full.faces.data());
      const auto* xyz = reinterpret_cast<const float*>(positions.data());
      const float scale = meshopt_simplifyScale(xyz, positions.size(), sizeof(Vec3f));
      const auto start = std::chrono::steady_clock::now();
      const std::size_t count = meshopt_simplify(
          reinterpret_cast<unsigned*>(out[l].faces.data()), indices, 3 * full.faces.size(), xyz, positions.size(),
          sizeof(Vec3f), 3, static_cast<float>(target) / scale, meshopt_SimplifyLockBorder, nullptr);
      ms += since(start);
      out[l].faces.resize(count / 3);
    }
    return ms;
  }
#endif

 private:
  static double since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  }
  static MeshBuffers buffers(Mesh& m) {
    return {
        {m.vertices.data(), m.vertices.size()}, {m.faces.data(), m.faces.size()}, {m.pixels.data(), m.pixels.size()}};
  }

  Intrinsics intrinsics_;
  Layer layers_[2];
  std::vector<Mesh> full_;
};

[[nodiscard]] std::size_t face_count(const std::vector<Mesh>& meshes) {
  return meshes[0].faces.size() + meshes[1].faces.size();
}

#if defined(NPSIM_BENCH_MESHOPTIMIZER)
struct PeerResult {
  std::size_t faces = 0;
  double ms = 0;
  Errors errors;
  double target = 0;
  const char* space = "";
};

// Both spaces at every target.
[[nodiscard]] std::vector<PeerResult> run_peer(Case& c, const std::vector<double>& targets) {
  std::vector<PeerResult> results;
  for (const bool image : {false, true}) {
    for (const double target : targets) {
      std::vector<Mesh> out;
      const double ms = c.peer(target, image, out);
      results.push_back({face_count(out), ms, c.errors(out), target, image ? "image" : "metres"});
    }
  }
  return results;
}

// The fewest faces with an error of at most `goal`.
template <class Measure>
[[nodiscard]] PeerResult best_peer(const std::vector<PeerResult>& results, double goal, const Measure& measure) {
  PeerResult best;
  for (const PeerResult& r : results) {
    if (measure(r.errors) <= goal && (best.faces == 0 || r.faces < best.faces)) best = r;
  }
  return best;
}
#endif

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Faces and time of simplified layers by bound, beside meshoptimizer at the same error, as CSV");
  std::vector<std::string> names;
  unsigned threads = 1;
  int rounds = 3;
  bool no_peer = false;
  std::vector<double> targets;
  app.add_option("scenes", names, "a scene.json, its folder, or streetSEED_WIDTHxHEIGHT (street1_960x540 where none)");
  app.add_option("--threads", threads, "time with so many as well")->capture_default_str()->check(CLI::Range(1, 1024));
  app.add_option("--rounds", rounds, "the median counts")->capture_default_str()->check(CLI::Range(1, 1000));
  app.add_option("--target", targets, "of meshoptimizer's error, in the unit of its space");
  app.add_flag("--no-peer", no_peer, "without meshoptimizer");
  if (const auto status = bench::parse(app, argc, argv)) return *status;
  const bool with_peer = !no_peer;
  if (targets.empty()) {
    for (int k = -16; k <= 6; ++k) targets.push_back(std::exp2(0.5 * k));
  }
  if (names.empty()) names.emplace_back("street1_960x540");
  std::printf(
      "scene,faces,bound,kept,simplified,percent,ms,ms_threads,max,q999,rms,peer_equal,peer_space,peer_target,peer_"
      "faces,peer_ms,"
      "peer_max,peer_q999,peer_rms\n");
  for (const std::string& name : names) {
    ThreadPool pool(threads);
    ThreadPool all;
    bench::NamedScene scene;
    if (!scene.load(name, all)) return 1;
    Case c(scene.view(), all);
#if defined(NPSIM_BENCH_MESHOPTIMIZER)
    std::vector<PeerResult> peer;
#endif
    for (const auto& setting : {std::pair{0.0F, true},
                                {0.001F, true},
                                {0.0025F, true},
                                {0.005F, true},
                                {0.005F, false},
                                {0.01F, true},
                                {0.02F, true},
                                {1.0F, true}}) {
      const float bound = setting.first;
      const bool labels = setting.second;
      std::vector<double> ms;
      std::vector<double> ms_threads;
      std::vector<Mesh> thin;
      for (int round = 0; round < rounds; ++round) {
        SerialExecutor serial;
        ms.push_back(c.simplify(bound, labels, serial, thin));
        if (threads > 1) ms_threads.push_back(c.simplify(bound, labels, pool, thin));
      }
      const Errors e = c.errors(thin);
      const auto line = [&] {
        std::printf("%s,%zu,%g,%s,%zu,%.2f,%.0f,%.0f,%.5f,%.5f,%.5f", name.c_str(), c.faces(),
                    static_cast<double>(bound), labels ? "labels" : "none", face_count(thin),
                    100.0 * static_cast<double>(face_count(thin)) / static_cast<double>(c.faces()), median(ms),
                    median(ms_threads), e.max, e.quantile, e.rms);
      };
      bool printed = false;
#if defined(NPSIM_BENCH_MESHOPTIMIZER)
      if (with_peer && bound == 0.005F) {
        if (peer.empty()) peer = run_peer(c, targets);
        const std::pair<const char*, PeerResult> peers[2] = {
            {"rms", best_peer(peer, e.rms, [](const Errors& x) { return x.rms; })},
            {"q999", best_peer(peer, e.quantile, [](const Errors& x) { return x.quantile; })}};
        for (const auto& [equal, p] : peers) {
          line();
          std::printf(",%s,%s,%g,%zu,%.0f,%.5f,%.5f,%.5f\n", equal, p.space, p.target, p.faces, p.ms, p.errors.max,
                      p.errors.quantile, p.errors.rms);
        }
        printed = true;
      }
#endif
      if (!printed) {
        line();
        std::printf(",,,,,,,,\n");
      }
      std::fflush(stdout);
    }
    static_cast<void>(with_peer);
  }
  return 0;
}
