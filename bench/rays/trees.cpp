// SPDX-License-Identifier: Apache-2.0
// npsim_bench_trees: the general tree beside Embree 3, on the sheet of a generated street and on meshes from files.
//
// One thread. Every round builds every tree (the first three rounds) and runs it once on each set, one after the other;
// medians are printed, the rates in million rays a second. Sets:
//       a  camera rays through a random point of each pixel, in scan order, closest hit: from the camera's place for a
//          sheet, from 2.5 radii away for a file;
//       b  from points seen to 30 lamps, lamp by lamp, points in scan order, any hit;
//       c  cosine-distributed bounces from those points in random order, closest hit;   c2  the same in pixel order.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "../host.hpp"
#include "../options.hpp"
#include "../timing.hpp"
#include "layers.hpp"
#include "npsim/core/random.hpp"
#include "npsim/io/obj.hpp"
#include "npsim/trace/bvh.hpp"
#include "ray_sets.hpp"
#if defined(NPSIM_BENCH_EMBREE)
#include "embree.hpp"
#endif

namespace {

using namespace npsim;
using bench::Arena;
using bench::median;
using bench::must;
using bench::RaySet;
using bench::seconds;

struct Subject {
  std::string name;
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  Intrinsics intrinsics;
  Shape picture;
  Vec3f eye;  // looks along +z
  std::vector<Vec3f> lamps;
  [[nodiscard]] TriangleMeshView view() const {
    return {{vertices.data(), vertices.size()}, {faces.data(), faces.size()}};
  }
};

[[nodiscard]] Subject of_sheet(const char* name, bench::Layers& layers) {
  Subject out;
  out.name = name;
  const SheetLayer layer = layers.all[0].view();
  bench::IndexedLayers mesh = bench::index_layers({layer});
  out.vertices = std::move(mesh.vertices);
  out.faces = std::move(mesh.faces);
  out.intrinsics = layers.intrinsics;
  out.picture = layer.vertices.shape();
  for (std::uint32_t l = 0; l < bench::kLampCount; ++l) out.lamps.push_back(bench::street_lamp(l));
  return out;
}

[[nodiscard]] bool of_file(const char* name, Subject& out) {
  auto mesh = io::read_obj(name);
  if (!mesh.ok()) return false;
  out.name = name;
  out.name = out.name.substr(out.name.rfind('/') + 1);
  out.vertices = std::move(mesh.value().vertices);
  out.faces = std::move(mesh.value().faces);
  if (out.faces.empty()) return false;
  Vec3f low = out.vertices[0];
  Vec3f high = low;
  for (const Vec3f& v : out.vertices) {
    low = {std::min(low.x, v.x), std::min(low.y, v.y), std::min(low.z, v.z)};
    high = {std::max(high.x, v.x), std::max(high.y, v.y), std::max(high.z, v.z)};
  }
  const Vec3f centre = 0.5F * (low + high);
  const float radius = 0.5F * length(high - low);
  out.picture = {960, 540};
  out.intrinsics = {600.0F, 600.0F, 480.0F, 270.0F};
  out.eye = centre - Vec3f{0, 0, 2.5F * radius};
  for (std::uint32_t l = 0; l < bench::kLampCount; ++l) {
    RandomStream r(2, RandomPurpose::test, 0, l, 0, 0);
    const float x = r.uniform(-1.0F, 1.0F);
    const float y = r.uniform(-1.0F, 1.0F);
    out.lamps.push_back(centre + Vec3f{x, y, r.uniform(-1.0F, 0.0F)} * (2.0F * radius));
  }
  return true;
}

[[nodiscard]] Vec3f off_surface(const SurfacePoint& p, const Vec3f& direction) {
  const Vec3f normal = dot(p.normal, direction) < 0 ? -p.normal : p.normal;
  return offset_ray_origin(p.position, p.error, normal, direction);
}

[[nodiscard]] std::vector<RaySet> make_rays(const Subject& subject, const Bvh& bvh, std::size_t count) {
  std::vector<RaySet> sets = {{"a", false, {}}, {"b", true, {}}, {"c", false, {}}, {"c2", false, {}}};
  sets[0].rays = bench::camera_rays(subject.intrinsics, subject.picture, subject.eye, count);
  std::vector<SurfacePoint> seen;  // with their normals towards the eye
  for (const Ray& ray : sets[0].rays) {
    Hit hit;
    if (!closest_hit(bvh, ray, hit)) continue;
    seen.push_back(surface_point(subject.view(), hit));
    if (dot(seen.back().normal, ray.direction) > 0) seen.back().normal = -seen.back().normal;
  }
  if (seen.empty()) return sets;
  const std::size_t stride = std::max<std::size_t>(1, seen.size() * subject.lamps.size() / count);
  for (std::size_t l = 0; l < subject.lamps.size(); ++l) {
    for (std::size_t i = l % stride; i < seen.size(); i += stride) {
      const Vec3f start = off_surface(seen[i], subject.lamps[l] - seen[i].position);
      Ray ray{start, subject.lamps[l] - start};
      ray.t_max = 1.0F;
      sets[1].rays.push_back(ray);
    }
  }
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const Vec3f d = bench::bounce_direction(i, seen[i].normal);
    sets[3].rays.push_back({off_surface(seen[i], d), d});
  }
  sets[2].rays = bench::shuffled(sets[3].rays);
  return sets;
}

struct Contender {
  std::string name;
  std::vector<double> build_times;
  double bytes = 0;
  std::vector<std::vector<double>> times;  // a set each
  std::vector<std::vector<std::uint32_t>> faces;
  std::function<void()> prepare;  // outside of the clock
  std::function<void()> build;
  std::function<void(const RaySet&, std::vector<std::uint32_t>&)> trace;
};

template <class Closest, class Any>
[[nodiscard]] auto tracer(Closest closest, Any any) {
  return [closest, any](const RaySet& set, std::vector<std::uint32_t>& faces) {
    if (set.any) {
      for (std::size_t i = 0; i < faces.size(); ++i) faces[i] = any(set.rays[i]) ? 0 : kNoFace;
    } else {
      for (std::size_t i = 0; i < faces.size(); ++i) faces[i] = closest(set.rays[i]).face;
    }
  };
}

template <unsigned W, unsigned P>
struct Ours {
  explicit Ours(const Subject& subject) : arena(wide_bvh_workspace_bytes<W, P>(subject.faces.size())) {}
  Arena arena;
  WideBvh<W, P> tree;
};

template <unsigned W, unsigned P>
[[nodiscard]] Contender ours(const Subject& subject, const std::shared_ptr<Ours<W, P>>& mine) {
  Contender c;
  c.name = "tree " + std::to_string(W) + "/" + std::to_string(P);
  c.prepare = [] {};
  c.build = [mine, &subject] {
    const WorkspaceScope scope(mine->arena.workspace());
    must(build_bvh(subject.view(), mine->arena.workspace(), mine->tree));
  };
  c.build();
  c.bytes = static_cast<double>(mine->tree.nodes.size() * sizeof(BvhNode<W>) +
                                mine->tree.packs.size() * sizeof(TrianglePack<P>));
  c.trace = tracer(
      [mine](const Ray& r) {
        Hit h;
        static_cast<void>(closest_hit(mine->tree, r, h));
        return h;
      },
      [mine](const Ray& r) { return occluded(mine->tree, r); });
  return c;
}

#if defined(NPSIM_BENCH_EMBREE)
[[nodiscard]] Contender peer(const Subject& subject, bool robust) {
  const auto held = std::make_shared<std::unique_ptr<bench::Embree>>();
  Contender c;
  c.name = robust ? "robust" : "embree";
  c.prepare = [held, robust, &subject] { *held = std::make_unique<bench::Embree>(subject.view(), robust); };
  c.build = [held] { (*held)->build(); };
  c.trace = tracer([held](const Ray& r) { return (*held)->closest(r); },
                   [held](const Ray& r) { return (*held)->occluded(r); });
  c.prepare();
  c.build();
  c.bytes = (*held)->bytes();
  return c;
}
#endif

void measure(const Subject& subject, std::size_t rays, int rounds, bool widths) {
  const auto production = std::make_shared<Ours<kBvhWidth, kBvhPack>>(subject);
  std::vector<Contender> all;
  all.push_back(ours(subject, production));
#if defined(NPSIM_BENCH_EMBREE)
  all.push_back(peer(subject, true));
  all.push_back(peer(subject, false));
#endif
  if (widths) {
    all.push_back(ours(subject, std::make_shared<Ours<4, 4>>(subject)));
    all.push_back(ours(subject, std::make_shared<Ours<4, 8>>(subject)));
    all.push_back(ours(subject, std::make_shared<Ours<8, 4>>(subject)));
    all.push_back(ours(subject, std::make_shared<Ours<16, 8>>(subject)));
    all.push_back(ours(subject, std::make_shared<Ours<8, 8>>(subject)));
  }
  const std::vector<RaySet> sets = make_rays(subject, production->tree, rays);
  for (Contender& c : all) {
    c.times.resize(sets.size());
    for (const RaySet& s : sets) c.faces.emplace_back(s.rays.size());
  }
  for (int round = 0; round < rounds; ++round) {
    for (Contender& c : all) {
      if (round >= 3) break;
      c.prepare();
      c.build_times.push_back(seconds(c.build));
    }
    for (std::size_t s = 0; s < sets.size(); ++s) {
      for (Contender& c : all) c.times[s].push_back(seconds([&] { c.trace(sets[s], c.faces[s]); }));
    }
  }
  const auto faces = static_cast<double>(subject.faces.size());
  std::printf("%s: %zu triangles, %zu nodes, %zu packs; rays", subject.name.c_str(), subject.faces.size(),
              production->tree.nodes.size(), production->tree.packs.size());
  for (const RaySet& s : sets) std::printf(" %s %zu", s.name, s.rays.size());
  std::printf("\n%-10s %9s %9s", "what", "build s", "B/face");
  for (const RaySet& s : sets) std::printf(" %8s", s.name);
  std::printf("   differing faces a million\n");
  for (const Contender& c : all) {
    std::printf("%-10s %9.5f %9.2f", c.name.c_str(), median(c.build_times), c.bytes / faces);
    for (std::size_t s = 0; s < sets.size(); ++s) {
      std::printf(" %8.3f", 1e-6 * static_cast<double>(sets[s].rays.size()) / median(c.times[s]));
    }
    for (std::size_t s = 0; s < sets.size(); ++s) {
      std::size_t differing = 0;
      for (std::size_t i = 0; i < sets[s].rays.size(); ++i) differing += c.faces[s][i] != all[0].faces[s][i] ? 1U : 0U;
      std::printf(" %7.0f", 1e6 * static_cast<double>(differing) / static_cast<double>(sets[s].rays.size()));
    }
    std::printf("\n");
  }
  for (std::size_t i = 1; i < all.size() && i < 3; ++i) {
    std::printf("tree / %s: build %.2fx", all[i].name.c_str(), median(all[i].build_times) / median(all[0].build_times));
    for (std::size_t s = 0; s < sets.size(); ++s) {
      std::printf(", %s %.2fx", sets[s].name, median(all[i].times[s]) / median(all[0].times[s]));
    }
    std::printf("\n");
  }
  std::printf("\n");
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The general tree beside Embree 3, one thread: time to build, million rays a second");
  std::size_t rays = 200000;
  int rounds = 5;
  bool widths = false;
  std::string save;
  std::vector<std::string> names;
  app.add_option("names", names, "WIDTHxHEIGHT of generated streets, files of layers, .obj files (960x540 where none)");
  app.add_option("--rays", rays, "of each set")->capture_default_str()->check(CLI::Range(1, 100000000));
  app.add_option("--rounds", rounds, "the median counts")->capture_default_str()->check(CLI::Range(1, 1000));
  app.add_flag("--widths", widths, "trees of other widths and packs too");
  app.add_option("--save", save, "write the layers of the first size to this file, and stop");
  if (const auto status = bench::parse(app, argc, argv)) return *status;
  if (names.empty()) names.emplace_back("960x540");
  for (const std::string& name : names) {
    Subject subject;
    Shape shape;
    if (name.size() > 4 && name.compare(name.size() - 4, 4, ".obj") == 0) {
      if (!of_file(name.c_str(), subject)) {
        std::fprintf(stderr, "npsim_bench_trees: cannot read %s\n", name.c_str());
        return 1;
      }
    } else {
      bench::Layers layers;
      if (bench::parse_size(name, shape)) {
        layers = bench::make_layers(shape);
      } else if (!bench::load_layers(name.c_str(), layers)) {
        std::fprintf(stderr, "npsim_bench_trees: cannot read %s\n", name.c_str());
        return 1;
      }
      if (!save.empty()) return bench::save_layers(layers, save.c_str()) ? 0 : 1;
      subject = of_sheet(name.c_str(), layers);
    }
    measure(subject, rays, rounds, widths);
  }
  return 0;
}
