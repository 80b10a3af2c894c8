// SPDX-License-Identifier: Apache-2.0
// npsim_bench_rays: the ray structure of the sheet beside Embree 3.
//
// One thread. Every round runs every structure once on each set, one after the other; medians are printed, the rates in
// million rays a second. npsim_bench_rays_8 and _4 are the same for AVX2 and for 4 lanes. Scenes: "sheet", one layer as
// photographed, uncertain faces deleted; "layers", background and foreground as one. Sets:
//       a  camera rays through a random point of each pixel, in scan order, closest hit;
//       b  from points seen by the camera to 30 lamps, lamp by lamp, points in scan order, any hit;
//       l  the same where all pixels of a row follow each other, as when one lamp's shadows are computed together;
//       c  cosine-distributed bounces from those points in random order, closest hit;   c2  the same in pixel order.
// What traces them: "sheet", one ray after the other; "stream", all of a set in one call;
// Embree's single rays, default ("embree"), robust, and default on quads, where a quad has both its triangles
// ("quads"); for information its coherent packets of 16 and its streams.
// Agreement is against Embree's robust mode: rays whose hit, face or distance (1e-5 of max(t, depth)) differs, per
// million; "ties" are those of them whose faces touch: the same distance to 1e-5.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "../host.hpp"
#include "../options.hpp"
#include "../timing.hpp"
#include "layers.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/trace/ray.hpp"
#include "npsim/trace/sheet.hpp"
#include "ray_sets.hpp"
#if defined(NPSIM_BENCH_EMBREE)
#include "embree.hpp"
#endif

namespace {

using namespace npsim;
using bench::Arena;
using bench::Layer;
using bench::Layers;
using bench::must;
using bench::RaySet;
using Mesh = bench::IndexedLayers;
using bench::median;
using bench::seconds;

[[nodiscard]] Vec3f off_surface(const Mesh& mesh, Hit hit, const Vec3f& direction, bool keep_side) {
  hit.face = mesh.index_of[hit.face];
  const SurfacePoint p = surface_point(mesh.view(), hit);
  Vec3f normal = p.normal;
  if (!keep_side && dot(normal, direction) < 0) normal = -normal;
  return offset_ray_origin(p.position, p.error, normal, direction);
}

[[nodiscard]] std::vector<RaySet> make_rays(const SheetScene& scene, const Mesh& mesh, std::size_t count) {
  const SheetTrace& first = scene.layers[0];
  const Shape shape = first.vertices.shape();
  std::vector<RaySet> sets = {{"a", false, {}}, {"b", true, {}}, {"l", true, {}}, {"c", false, {}}, {"c2", false, {}}};
  const auto width = static_cast<std::size_t>(shape.width);
  sets[0].rays = bench::camera_rays(first.intrinsics, shape, {}, count);
  struct Seen {
    Hit hit;
    Vec3f direction;
  };
  std::vector<Seen> seen;
  for (const Ray& ray : sets[0].rays) {
    Hit hit;
    if (closest_hit(scene, ray, hit)) seen.push_back({hit, ray.direction});
  }
  if (seen.empty()) return sets;
  const std::size_t stride = std::max<std::size_t>(1, seen.size() * bench::kLampCount / count);
  const std::size_t together = seen.size() / stride;  // rays of a lamp, about a part in 30 of the points seen
  for (std::uint32_t l = 0; l < bench::kLampCount; ++l) {
    const Vec3f lamp = bench::street_lamp(l);
    const auto add = [&](std::size_t i, std::size_t set) {
      const Vec3f from = off_surface(mesh, seen[i].hit, lamp, false);
      const Vec3f start = off_surface(mesh, seen[i].hit, lamp - from, false);
      Ray ray{start, lamp - start};
      ray.t_max = 1.0F;
      sets[set].rays.push_back(ray);
    };
    for (std::size_t i = l % stride; i < seen.size(); i += stride) add(i, 1);
    // A row's worth of points from each of several places.
    for (std::size_t i = 0; i < together; ++i) {
      const std::size_t row = i / width;
      add((row * width * stride + l * width + i % width) % seen.size(), 2);
    }
  }
  for (std::size_t i = 0; i < seen.size(); ++i) {
    Hit h = seen[i].hit;
    h.face = mesh.index_of[h.face];
    Vec3f n = surface_point(mesh.view(), h).normal;
    if (dot(n, seen[i].direction) > 0) n = -n;
    const Vec3f d = bench::bounce_direction(i, n);
    sets[4].rays.push_back({off_surface(mesh, seen[i].hit, d, true), d});
  }
  sets[3].rays = bench::shuffled(sets[4].rays);
  return sets;
}

struct Contender {
  std::string name;
  std::vector<double> build;
  double bytes = 0;
  std::vector<std::vector<double>> times;  // a set each
  std::vector<std::vector<Hit>> hits;
};

template <class Closest, class Any>
void run(const std::vector<RaySet>& sets, Contender& c, const Closest& closest, const Any& any) {
  c.times.resize(sets.size());
  c.hits.resize(sets.size());
  for (std::size_t s = 0; s < sets.size(); ++s) {
    std::vector<Hit>& hits = c.hits[s];
    hits.assign(sets[s].rays.size(), Hit{});
    c.times[s].push_back(seconds([&] {
      for (std::size_t i = 0; i < hits.size(); ++i) {
        if (sets[s].any) {
          hits[i].face = any(sets[s].rays[i]) ? 0 : kNoFace;
        } else {
          hits[i] = closest(sets[s].rays[i]);
        }
      }
    }));
  }
}

// The same with all rays of a set in one call.
template <class Closest, class Any>
void run_many(const std::vector<RaySet>& sets, Contender& c, const Closest& closest, const Any& any) {
  c.times.resize(sets.size());
  c.hits.resize(sets.size());
  for (std::size_t s = 0; s < sets.size(); ++s) {
    const Span<const Ray> rays(sets[s].rays.data(), sets[s].rays.size());
    std::vector<Hit>& hits = c.hits[s];
    hits.assign(rays.size(), Hit{});
    std::vector<std::uint8_t> blocked(sets[s].any ? rays.size() : 0);
    c.times[s].push_back(seconds([&] {
      if (sets[s].any) {
        any(rays, Span<std::uint8_t>(blocked.data(), blocked.size()));
      } else {
        closest(rays, Span<Hit>(hits.data(), hits.size()));
      }
    }));
    for (std::size_t i = 0; i < blocked.size(); ++i) hits[i].face = blocked[i] != 0 ? 0 : kNoFace;
  }
}

[[nodiscard]] double ns_a_ray(const Contender& c, const std::vector<RaySet>& sets, std::size_t s) {
  return 1e9 * median(c.times[s]) / static_cast<double>(std::max<std::size_t>(sets[s].rays.size(), 1));
}

void agreement(const RaySet& set, const std::vector<Hit>& ours, const std::vector<Hit>& peer, const Mesh& mesh,
               const char* scene) {
  std::size_t missed = 0;
  std::size_t extra = 0;
  std::size_t far = 0;
  std::size_t ties = 0;
  for (std::size_t i = 0; i < ours.size(); ++i) {
    const bool a = ours[i].face != kNoFace;
    const bool b = peer[i].face != kNoFace;
    if (a != b) {
      ++(a ? extra : missed);
    } else if (a && !set.any) {
      const float z = std::fabs(set.rays[i].origin.z + ours[i].t * set.rays[i].direction.z);
      const bool same_t = std::fabs(ours[i].t - peer[i].t) <= 1e-5F * std::max(ours[i].t, z);
      if (!same_t) {
        ++far;
      } else if (mesh.index_of[ours[i].face] != peer[i].face) {
        ++ties;
      }
    }
  }
  const double scale = 1e6 / static_cast<double>(std::max<std::size_t>(ours.size(), 1));
  std::printf("%-7s %-3s of a million: missed %.0f, hit alone %.0f, other distance %.0f, other face at the same %.0f\n",
              scene, set.name, scale * static_cast<double>(missed), scale * static_cast<double>(extra),
              scale * static_cast<double>(far), scale * static_cast<double>(ties));
}

void measure(const char* name, std::vector<SheetLayer> layers, const Intrinsics& intrinsics, std::size_t rays,
             int rounds, bool with_peer, bool csv) {
  const Mesh mesh = bench::index_layers(layers);
  const Shape shape = layers[0].vertices.shape();
  const auto faces = static_cast<double>(mesh.faces.size());
  if (!csv) std::printf("%-7s %d x %d, %zu triangles\n", name, shape.width, shape.height, mesh.faces.size());
  SerialExecutor serial;
  std::vector<std::unique_ptr<Arena>> memory;
  std::vector<SheetTrace> traces(layers.size());
  for (std::size_t l = 0; l < layers.size(); ++l) {
    memory.push_back(std::make_unique<Arena>(sheet_workspace_bytes(shape)));
  }
  Contender sheet{"sheet", {}, 0, {}, {}};
  Contender stream{"stream", {}, 0, {}, {}};
  const auto build = [&] {
    for (std::size_t l = 0; l < layers.size(); ++l) {
      const WorkspaceScope scope(memory[l]->workspace());
      must(build_sheet_trace(layers[l], intrinsics, memory[l]->workspace(), traces[l], serial));
    }
  };
  build();
  SheetScene scene;
  must(join_layers({traces.data(), traces.size()}, scene));
  sheet.bytes = static_cast<double>(sheet_workspace_bytes(shape)) * static_cast<double>(layers.size());
  const std::vector<RaySet> sets = make_rays(scene, mesh, rays);

#if defined(NPSIM_BENCH_EMBREE)
  Contender plain{"embree", {}, 0, {}, {}};
  Contender robust{"robust", {}, 0, {}, {}};
  Contender packets{"packets", {}, 0, {}, {}};
  Contender streams{"streams", {}, 0, {}, {}};
  Contender quads{"quads", {}, 0, {}, {}};
  std::unique_ptr<bench::Embree> peers[3];
  Contender* const singles[3] = {&plain, &robust, &quads};
  if (with_peer) {
    peers[0] = std::make_unique<bench::Embree>(mesh.view(), false);
    peers[1] = std::make_unique<bench::Embree>(mesh.view(), true);
    peers[2] = std::make_unique<bench::Embree>(mesh.view().vertices, bench::pair_faces(mesh));
    for (int i = 0; i < 3; ++i) {
      singles[i]->build.push_back(seconds([&] { peers[i]->build(); }));
      singles[i]->bytes = peers[i]->bytes();
    }
  }
#endif
  for (int round = 0; round < rounds; ++round) {
    sheet.build.push_back(seconds(build));
    run(
        sets, sheet,
        [&](const Ray& r) {
          Hit h;
          static_cast<void>(closest_hit(scene, r, h));
          return h;
        },
        [&](const Ray& r) { return occluded(scene, r); });
    run_many(
        sets, stream, [&](Span<const Ray> r, Span<Hit> h) { closest_hits(scene, r, h); },
        [&](Span<const Ray> r, Span<std::uint8_t> blocked) {
          occluded(
              scene, r, [](std::uint32_t) noexcept { return true; }, blocked);
        });
#if defined(NPSIM_BENCH_EMBREE)
    for (int i = 0; with_peer && i < 3; ++i) {
      run(
          sets, *singles[i], [&](const Ray& r) { return peers[i]->closest(r); },
          [&](const Ray& r) { return peers[i]->occluded(r); });
    }
    if (with_peer && round < 3) {
      run_many(
          sets, packets, [&](Span<const Ray> r, Span<Hit> h) { peers[0]->closest_by_16(r, h); },
          [&](Span<const Ray> r, Span<std::uint8_t> blocked) { peers[0]->occluded_by_16(r, blocked); });
      run_many(
          sets, streams, [&](Span<const Ray> r, Span<Hit> h) { peers[0]->closest_stream(r, h); },
          [&](Span<const Ray> r, Span<std::uint8_t> blocked) { peers[0]->occluded_stream(r, blocked); });
    }
#endif
  }
  for (std::size_t s = 0; s < sets.size(); ++s) {
    const auto same = [](const Hit& p, const Hit& q) { return std::memcmp(&p, &q, sizeof p) == 0; };
    if (!std::equal(sheet.hits[s].begin(), sheet.hits[s].end(), stream.hits[s].begin(), same)) {
      std::fprintf(stderr, "npsim_bench_rays: the stream's answers differ on %s\n", sets[s].name);
      std::exit(1);
    }
  }
  if (csv) {
    std::printf("%s,%d,%d,%zu,%.5f", name, shape.width, shape.height, mesh.faces.size(), median(sheet.build));
    for (std::size_t s = 0; s < sets.size(); ++s) std::printf(",%.1f", ns_a_ray(sheet, sets, s));
    for (std::size_t s = 0; s < sets.size(); ++s) std::printf(",%.1f", ns_a_ray(stream, sets, s));
    std::printf("\n");
    std::fflush(stdout);
    return;
  }
  std::vector<const Contender*> all = {&sheet, &stream};
#if defined(NPSIM_BENCH_EMBREE)
  if (with_peer) all.insert(all.end(), {&plain, &robust, &quads, &packets, &streams});
#endif
  std::printf("%-7s %-7s %9s %9s", "scene", "what", "build s", "B/face");
  for (const RaySet& s : sets) std::printf(" %8s", s.name);
  std::printf("   million rays a second\n");
  for (const Contender* c : all) {
    std::printf("%-7s %-7s", name, c->name.c_str());
    if (c->build.empty()) {
      std::printf(" %9s %9s", "", "");
    } else {
      std::printf(" %9.4f %9.2f", median(c->build), c->bytes / faces);
    }
    for (std::size_t s = 0; s < sets.size(); ++s) std::printf(" %8.3f", 1e3 / ns_a_ray(*c, sets, s));
    std::printf("\n");
  }
#if defined(NPSIM_BENCH_EMBREE)
  if (with_peer) {
    std::printf("%-7s embree / sheet: build %.0fx\n", name, median(plain.build) / median(sheet.build));
    for (const Contender* c : {&sheet, &stream}) {
      std::printf("%-7s embree / %s:", name, c->name.c_str());
      for (std::size_t s = 0; s < sets.size(); ++s) {
        std::printf(" %s %.2fx", sets[s].name, ns_a_ray(plain, sets, s) / ns_a_ray(*c, sets, s));
      }
      std::printf("\n");
    }
    for (std::size_t s = 0; s < sets.size(); ++s) agreement(sets[s], sheet.hits[s], robust.hits[s], mesh, name);
  }
#else
  static_cast<void>(with_peer);
#endif
  std::printf("\n");
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The ray structure of the sheet beside Embree 3, one thread: million rays a second, and who disagrees");
  std::size_t rays = 200000;
  int rounds = 5;
  bool no_peer = false;
  bool csv = false;
  std::string save;
  std::vector<std::string> scenes;
  std::vector<std::string> sizes;
  app.add_option("sizes", sizes, "WIDTHxHEIGHT of generated streets, or files of layers (960x540 where none)");
  app.add_option("--scene", scenes, "a scene.json or its folder as well");
  app.add_option("--rays", rays, "of each set")->capture_default_str()->check(CLI::Range(1, 100000000));
  app.add_option("--rounds", rounds, "the median counts")->capture_default_str()->check(CLI::Range(1, 1000));
  app.add_flag("--no-peer", no_peer, "without Embree");
  app.add_flag("--csv", csv, "ns a ray, one line for each size; without Embree");
  app.add_option("--save", save, "write the layers of the first scene to this file, and stop");
  if (const auto status = bench::parse(app, argc, argv)) return *status;
  const bool with_peer = !no_peer && !csv;
  struct Name {
    std::string text;
    bool scene;
  };
  std::vector<Name> names;
  for (const std::string& size : sizes) names.push_back({size, false});
  for (const std::string& scene : scenes) names.push_back({scene, true});
  if (names.empty()) names.push_back({"960x540", false});
  if (csv) {
    std::printf("scene,width,height,triangles,build s,a,b,l,c,c2,stream a,stream b,stream l,stream c,stream c2\n");
  }
  for (const Name& name : names) {
    Layers layers;
    Shape shape;
    if (name.scene) {
      if (!bench::make_layers(name.text, layers)) return 1;
    } else if (bench::parse_size(name.text, shape)) {
      layers = bench::make_layers(shape);
    } else if (!bench::load_layers(name.text.c_str(), layers)) {
      std::fprintf(stderr, "npsim_bench_rays: cannot read %s\n", name.text.c_str());
      return 1;
    }
    if (!save.empty()) return bench::save_layers(layers, save.c_str()) ? 0 : 1;
    measure("sheet", {layers.all[0].view()}, layers.intrinsics, rays, rounds, with_peer, csv);
    measure("layers", {layers.all[1].view(), layers.all[2].view()}, layers.intrinsics, rays, rounds, with_peer, csv);
  }
  return 0;
}
