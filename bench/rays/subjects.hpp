// SPDX-License-Identifier: Apache-2.0
// What the robustness of rays is measured on: closed meshes, a sheet without holes, and the layers of a street as a
// mesh.
#ifndef NPSIM_BENCH_RAYS_SUBJECTS_HPP
#define NPSIM_BENCH_RAYS_SUBJECTS_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "../host.hpp"
#include "layers.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/io/mesh.hpp"
#include "npsim/trace/bvh.hpp"
#include "npsim/trace/sheet.hpp"
#if defined(NPSIM_BENCH_EMBREE)
#include "embree.hpp"
#endif

namespace npsim::bench {

[[nodiscard]] inline RandomStream dice(std::uint32_t set, std::uint32_t i) {
  return {set, RandomPurpose::test, 0, 0, i, 0};
}

[[nodiscard]] inline Vec3f in_cube(RandomStream& r, float half) {
  const float x = r.uniform(-half, half);
  const float y = r.uniform(-half, half);
  return {x, y, r.uniform(-half, half)};
}

// Of radius 1.
[[nodiscard]] inline io::Mesh sphere(std::uint32_t rings, std::uint32_t sectors) {
  io::Mesh mesh;
  const double pi = std::acos(-1.0);
  const auto put = [&](double x, double y, double z) {
    mesh.vertices.push_back({static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)});
  };
  put(0, -1, 0);
  for (std::uint32_t i = 1; i < rings; ++i) {
    for (std::uint32_t j = 0; j < sectors; ++j) {
      const double theta = pi * i / rings;
      const double phi = 2 * pi * j / sectors;
      put(std::sin(theta) * std::cos(phi), -std::cos(theta), std::sin(theta) * std::sin(phi));
    }
  }
  put(0, 1, 0);
  const auto last = static_cast<std::uint32_t>(mesh.vertices.size() - 1);
  const auto at = [sectors](std::uint32_t i, std::uint32_t j) { return 1 + (i - 1) * sectors + j % sectors; };
  for (std::uint32_t j = 0; j < sectors; ++j) {
    mesh.faces.push_back({0, at(1, j), at(1, j + 1)});
    mesh.faces.push_back({last, at(rings - 1, j + 1), at(rings - 1, j)});
    for (std::uint32_t i = 1; i + 1 < rings; ++i) {
      mesh.faces.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
      mesh.faces.push_back({at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)});
    }
  }
  return mesh;
}

// [-1, 1]^3 with n x n quads a side; corners are shared.
[[nodiscard]] inline io::Mesh cube(int n) {
  io::Mesh mesh;
  std::vector<std::uint32_t> number(static_cast<std::size_t>((n + 1) * (n + 1) * (n + 1)), kNoFace);
  const auto vertex = [&](int x, int y, int z) {
    std::uint32_t& at = number[static_cast<std::size_t>((z * (n + 1) + y) * (n + 1) + x)];
    if (at == kNoFace) {
      at = static_cast<std::uint32_t>(mesh.vertices.size());
      const float s = 2.0F / static_cast<float>(n);
      mesh.vertices.push_back(
          {static_cast<float>(x) * s - 1.0F, static_cast<float>(y) * s - 1.0F, static_cast<float>(z) * s - 1.0F});
    }
    return at;
  };
  for (int side = 0; side < 6; ++side) {
    const auto at = [&](int i, int j) {
      const int k = side % 2 == 0 ? 0 : n;
      const int u = side % 2 == 0 ? j : i;  // turned, so that the front is outside
      const int v = side % 2 == 0 ? i : j;
      return side / 2 == 0 ? vertex(k, u, v) : side / 2 == 1 ? vertex(v, k, u) : vertex(u, v, k);
    };
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        mesh.faces.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        mesh.faces.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
      }
    }
  }
  return mesh;
}

// Layers as a mesh whose faces keep the order of their numbers.
struct LayerMesh {
  io::Mesh mesh;
  std::vector<std::uint32_t> index_of;  // of a face number; kNoFace where there is none
  std::vector<std::uint32_t> number_of;
};

[[nodiscard]] inline LayerMesh mesh_of_layers(const std::vector<SheetLayer>& layers) {
  LayerMesh out;
  for (const SheetLayer& layer : layers) {
    const auto base = static_cast<std::uint32_t>(out.mesh.vertices.size());
    const int width = layer.vertices.width();
    for (int y = 0; y < layer.vertices.height(); ++y) {
      for (int x = 0; x < width; ++x) out.mesh.vertices.push_back(layer.vertices(x, y));
    }
    for (int y = 0; y < layer.quads.height(); ++y) {
      for (int x = 0; x < layer.quads.width(); ++x) {
        const unsigned quad = layer.quads(x, y);
        const std::uint32_t a = base + static_cast<std::uint32_t>(y * width + x);
        const std::uint32_t c = a + static_cast<std::uint32_t>(width);
        for (const bool upper : {true, false}) {
          const bool has = (quad & (upper ? kQuadUpperFace : kQuadLowerFace)) != 0;
          if (has) {
            out.number_of.push_back(static_cast<std::uint32_t>(out.index_of.size()));
            out.mesh.faces.push_back(quad_face((quad & kQuadAntiDiagonal) != 0, upper, a, a + 1, c, c + 1));
          }
          out.index_of.push_back(has ? static_cast<std::uint32_t>(out.mesh.faces.size() - 1) : kNoFace);
        }
      }
    }
  }
  return out;
}

// A sheet without holes or steps at `depth` m with waves of up to `height` m.
[[nodiscard]] inline Layer waves(const Intrinsics& k, Shape shape, float depth, float height) {
  Layer out(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      RandomStream r = dice(31, static_cast<std::uint32_t>(y * shape.width + x));
      const float wave = std::sin(0.2F * static_cast<float>(x)) + std::cos(0.3F * static_cast<float>(y));
      const float z = depth + height * (0.4F * wave + r.uniform(-0.02F, 0.02F));
      out.vertices.view()(x, y) = unproject_pixel(k, x, y, z);
    }
  }
  for (int y = 0; y < shape.height - 1; ++y) {
    for (int x = 0; x < shape.width - 1; ++x) {
      out.quads.view()(x, y) =
          static_cast<std::uint8_t>(6U | (dice(32, static_cast<std::uint32_t>(y * shape.width + x)).next_u32() & 1U));
    }
  }
  return out;
}

// The structures over layers, all reporting indices into one mesh, or over a mesh alone.
class Subject {
 public:
  Subject(std::string name, io::Mesh mesh) : name_(std::move(name)) {
    mesh_.mesh = std::move(mesh);
    build_general();
  }
  Subject(std::string name, const std::vector<SheetLayer>& layers, const Intrinsics& k) : name_(std::move(name)) {
    mesh_ = mesh_of_layers(layers);
    traces_.resize(layers.size());
    SerialExecutor serial;
    for (std::size_t i = 0; i < layers.size(); ++i) {
      memory_.push_back(std::make_unique<Arena>(sheet_workspace_bytes(layers[i].vertices.shape())));
      must(build_sheet_trace(layers[i], k, memory_.back()->workspace(), traces_[i], serial));
    }
    must(join_layers({traces_.data(), traces_.size()}, scene_));
    build_general();
  }
  Subject(const Subject&) = delete;
  Subject& operator=(const Subject&) = delete;
  ~Subject() = default;

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] TriangleMeshView mesh() const { return mesh_.mesh.view(); }
  [[nodiscard]] bool has_sheet() const { return !traces_.empty(); }
  [[nodiscard]] const SheetScene& scene() const { return scene_; }
  [[nodiscard]] const Bvh& bvh() const { return bvh_; }
  [[nodiscard]] std::uint32_t number_of(std::uint32_t index) const { return mesh_.number_of[index]; }
  [[nodiscard]] std::uint32_t index_of(std::uint32_t number) const { return mesh_.index_of[number]; }
  // Of everything in the mesh, as seen from a ray's origin.
  [[nodiscard]] double reach(const Vec3f& origin) const {
    const Vec3d o = vec_cast<double>(origin);
    const double x = std::max(std::fabs(low_.x - o.x), std::fabs(high_.x - o.x));
    const double y = std::max(std::fabs(low_.y - o.y), std::fabs(high_.y - o.y));
    return std::max({x, y, std::fabs(low_.z - o.z), std::fabs(high_.z - o.z)});
  }

  template <class F = simd::F32>
  [[nodiscard]] Hit by_sheet(const Ray& ray) const {
    Hit hit;
    if (closest_hit<F>(scene_, ray, hit)) hit.face = mesh_.index_of[hit.face];
    return hit;
  }
  [[nodiscard]] Hit by_tree(const Ray& ray) const {
    Hit hit;
    static_cast<void>(closest_hit(bvh_, ray, hit));
    return hit;
  }
#if defined(NPSIM_BENCH_EMBREE)
  [[nodiscard]] Hit by_peer(const Ray& ray) const { return peer_->closest(ray); }
#endif

 private:
  void build_general() {
    const TriangleMeshView view = mesh_.mesh.view();
    memory_.push_back(std::make_unique<Arena>(bvh_workspace_bytes(view.faces.size())));
    must(build_bvh(view, memory_.back()->workspace(), bvh_));
#if defined(NPSIM_BENCH_EMBREE)
    peer_ = std::make_unique<Embree>(view, true);
    peer_->build();
#endif
    low_ = high_ = corner_of(view.faces[0].a);
    for (const Face& f : view.faces) {
      for (const std::uint32_t v : {f.a, f.b, f.c}) {
        const Vec3d p = corner_of(v);
        low_ = {std::min(low_.x, p.x), std::min(low_.y, p.y), std::min(low_.z, p.z)};
        high_ = {std::max(high_.x, p.x), std::max(high_.y, p.y), std::max(high_.z, p.z)};
      }
    }
  }
  [[nodiscard]] Vec3d corner_of(std::uint32_t v) const { return vec_cast<double>(mesh_.mesh.vertices[v]); }

  std::string name_;
  LayerMesh mesh_;
  std::vector<std::unique_ptr<Arena>> memory_;
  std::vector<SheetTrace> traces_;
  SheetScene scene_;
  Bvh bvh_;
  Vec3d low_, high_;
#if defined(NPSIM_BENCH_EMBREE)
  std::unique_ptr<Embree> peer_;
#endif
};

}  // namespace npsim::bench

#endif  // NPSIM_BENCH_RAYS_SUBJECTS_HPP
