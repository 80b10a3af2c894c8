// SPDX-License-Identifier: Apache-2.0
// npsim_bench_leaks: the robustness of rays, counted; nothing is timed.
//
// leaks  Rays that must hit, by topology alone. Closed meshes: one end of the ray in a point round which the mesh winds
//        (solid angles in double), the other outside of the mesh's box; it goes through a vertex, an edge or a point of
//        a face. Sheets without holes: a point in front of the sheet and one behind it on the ray, both within the
//        frustum and decided in double. Street: from the camera at vertices and edges with all faces round them.
//        Meshes are scaled by 1e-4 .. 1e4 and stand at the origin or 1e5 m away (1e5 times the scale below 1); the
//        sheets "away" are seen through a long lens. Where float coordinates leave no such ray nothing is asked.
// agree  Camera, shadow and bounce rays: all tracers against each other; each reported hit against double precision
//        (exact.hpp); where tracers disagree, and for a sample, against every face in double precision.
// spawn  Rays that leave a hit (offset_ray_origin()) and meet the face that they left.
// hash   Hits of a million rays as one number: to be compared between builds for other instruction sets. Serial, on
//        threads, and with one lane must be equal.
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

#include "../options.hpp"
#include "exact.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/obj.hpp"
#include "npsim/simd/batch.hpp"
#include "npsim/trace/ray.hpp"
#include "npsim/trace/sheet.hpp"
#include "subjects.hpp"

namespace {

using namespace npsim;
using namespace npsim::bench;

struct Options {
  std::string part = "all";
  std::uint32_t rays = 100000;
  Shape street{960, 540};
  std::string only;
  std::vector<std::string> files;
  [[nodiscard]] bool wants(const char* p) const { return part == "all" || part == p; }
  [[nodiscard]] bool asks(const std::string& name) const { return only.empty() || name.rfind(only, 0) == 0; }
};

constexpr float kScales[] = {1e-4F, 1e-2F, 1.0F, 1e2F, 1e4F};

enum Aim { kVertex, kEdge, kPoint, kAims };

[[nodiscard]] Vec3f target(const TriangleMeshView& mesh, const Face& face, int aim, RandomStream& r) {
  const Vec3f a = mesh.vertices[face.a];
  const Vec3f b = mesh.vertices[face.b];
  if (aim == kVertex) return a;
  const float s = r.next_u32() % 4U == 0 ? 0.5F : r.uniform();
  if (aim == kEdge) return a + (b - a) * s;
  const float t = r.uniform();
  const bool flip = s + t > 1;
  return a + (b - a) * (flip ? 1 - s : s) + (mesh.vertices[face.c] - a) * (flip ? 1 - t : t);
}

struct Leaks {
  std::size_t asked[kAims] = {};
  std::size_t sheet[kAims] = {};
  std::size_t tree[kAims] = {};
  std::size_t peer[kAims] = {};
  std::vector<Ray> rays;  // not yet traced
  std::vector<int> aims;

  void ask(const Subject& subject, const Ray& ray, int aim) {
    rays.push_back(ray);
    aims.push_back(aim);
    if (rays.size() == 4096) flush(subject);
  }
  void flush(const Subject& subject) {
    std::vector<Hit> hits(rays.size());
    std::vector<std::uint8_t> blocked(rays.size());
    if (subject.has_sheet()) {
      closest_hits(subject.scene(), {rays.data(), rays.size()}, {hits.data(), hits.size()});
      occluded(subject.scene(), {rays.data(), rays.size()}, [](std::uint32_t) { return true; },
               {blocked.data(), blocked.size()});
    }
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Ray& ray = rays[i];
      const int aim = aims[i];
      ++asked[aim];
      Hit hit;
      if (subject.has_sheet()) {
        const bool found = closest_hit(subject.scene(), ray, hit);
        const bool streamed = hits[i].face != kNoFace && blocked[i] != 0;
        if (!found || !occluded(subject.scene(), ray) || !streamed) ++sheet[aim];
      }
      if (!closest_hit(subject.bvh(), ray, hit) || !occluded(subject.bvh(), ray)) ++tree[aim];
#if defined(NPSIM_BENCH_EMBREE)
      if (subject.by_peer(ray).face == kNoFace) ++peer[aim];
#endif
    }
    rays.clear();
    aims.clear();
  }
  void add(const Leaks& other) {
    for (int i = 0; i < kAims; ++i) {
      asked[i] += other.asked[i];
      sheet[i] += other.sheet[i];
      tree[i] += other.tree[i];
      peer[i] += other.peer[i];
    }
  }
  void print(const char* name) const {
    std::printf("%-34s asked %8zu %8zu %8zu | sheet %zu %zu %zu | tree %zu %zu %zu | embree %zu %zu %zu\n", name,
                asked[0], asked[1], asked[2], sheet[0], sheet[1], sheet[2], tree[0], tree[1], tree[2], peer[0], peer[1],
                peer[2]);
    std::fflush(stdout);
  }
};

[[nodiscard]] io::Mesh moved(io::Mesh mesh, float scale, const Vec3f& by) {
  for (Vec3f& v : mesh.vertices) v = v * scale + by;
  return mesh;
}

// Points inside the mesh, well off its surface.
[[nodiscard]] std::vector<Vec3f> inner_points(const Subject& subject, float scale, std::size_t count) {
  std::vector<Vec3f> out;
  const TriangleMeshView mesh = subject.mesh();
  for (std::uint32_t i = 0; i < 60 * count && out.size() < count; ++i) {
    RandomStream r = dice(11, i);
    const Vec3f a = mesh.vertices[r.next_u32() % mesh.vertices.size()];
    const Vec3f b = mesh.vertices[r.next_u32() % mesh.vertices.size()];
    const Vec3f p = a + (b - a) * r.uniform(0.2F, 0.8F);
    const Vec3d at = vec_cast<double>(p);
    const double far_off = 0x1p-19 * subject.reach({}) + 1e-3 * static_cast<double>(scale);
    if (clearance(mesh, at) > far_off && std::fabs(winding(mesh, at)) > 0.9) out.push_back(p);
  }
  return out;
}

[[nodiscard]] Leaks closed_mesh_leaks(const Subject& subject, float scale, std::uint32_t rays) {
  Leaks out;
  const TriangleMeshView mesh = subject.mesh();
  const std::vector<Vec3f> inner = inner_points(subject, scale, 24);
  if (inner.empty()) return out;
  for (std::uint32_t i = 0; i < rays; ++i) {
    RandomStream r = dice(12, i);
    const Vec3f in = inner[r.next_u32() % inner.size()];
    const int aim = static_cast<int>(i % kAims);
    const Vec3f to = target(mesh, mesh.faces[r.next_u32() % mesh.faces.size()], aim, r);
    Ray ray{in, to - in};
    if (r.next_u32() % 2U == 0) {  // from outside, to the point inside
      const float away = length(to - in);
      if (!(away > 0)) continue;
      const Vec3f out_there = in + (to - in) * (8.0F * scale / away);
      ray = {out_there, in - out_there, 0.0F, 1.0F};
    }
    out.ask(subject, ray, aim);
  }
  out.flush(subject);
  return out;
}

// How far the point lies behind the sheet, as a part of its depth; NaN outside of the faces.
[[nodiscard]] double behind(const SheetTrace& sheet, const Vec3d& p) {
  const double none = std::numeric_limits<double>::quiet_NaN();
  if (!(p.z > 0)) return none;
  const Intrinsics& k = sheet.intrinsics;
  const double u = static_cast<double>(k.fx) * p.x / p.z + static_cast<double>(k.cx) - 0.5;
  const double v = static_cast<double>(k.fy) * p.y / p.z + static_cast<double>(k.cy) - 0.5;
  if (!(u > 1 && v > 1 && u < sheet.quads.width() - 1 && v < sheet.quads.height() - 1)) return none;
  const int x = static_cast<int>(u);
  const int y = static_cast<int>(v);
  const bool anti = (sheet.quads(x, y) & kQuadAntiDiagonal) != 0;
  const double fu = u - x;
  const double fv = v - y;
  const bool upper = anti ? fu + fv < 1 : fv < fu;
  const auto number = static_cast<std::uint32_t>(2 * (y * sheet.quads.width() + x) + (upper ? 0 : 1));
  const Face f = sheet_face(sheet.quads, number);
  const Vec3d a = vec_cast<double>(sheet.vertices.data()[f.a]);
  const Vec3d n =
      cross(vec_cast<double>(sheet.vertices.data()[f.b]) - a, vec_cast<double>(sheet.vertices.data()[f.c]) - a);
  return 1 - dot(n, a) / dot(n, p);
}

[[nodiscard]] Leaks sheet_leaks(const Subject& subject, float depth, std::uint32_t rays) {
  Leaks out;
  const SheetTrace& sheet = subject.scene().layers[0];
  const TriangleMeshView mesh = subject.mesh();
  const int width = sheet.quads.width();
  for (std::uint32_t i = 0; i < rays; ++i) {
    RandomStream r = dice(13, i);
    const auto x = static_cast<int>(6 + r.next_u32() % static_cast<std::uint32_t>(width - 12));
    const auto y = static_cast<int>(6 + r.next_u32() % static_cast<std::uint32_t>(sheet.quads.height() - 12));
    const int aim = static_cast<int>(i % kAims);
    const std::uint32_t number = 2U * static_cast<std::uint32_t>(y * width + x) + r.next_u32() % 2U;
    const Vec3f to = target(mesh, sheet_face(sheet.quads, number), aim, r);
    Ray ray{{0, 0, 0}, to};
    const std::uint32_t kind = r.next_u32() % 3U;
    if (kind == 1)
      ray.origin = in_cube(r, 0.04F * depth * std::min(1.0F, static_cast<float>(width) / sheet.intrinsics.fx));
    if (kind == 2) {
      const Vec3f p = mesh.vertices[r.next_u32() % mesh.vertices.size()];
      ray.origin = p * r.uniform(0.2F, 0.95F);
    }
    ray.direction = to - ray.origin;
    const Vec3d o = vec_cast<double>(ray.origin);
    const Vec3d d = vec_cast<double>(ray.direction);
    const double sure = 0x1p-17 * subject.reach(ray.origin) / static_cast<double>(depth);
    bool in_front = false;
    for (const double t : {0.0, 0.1, 0.3, 0.6, 0.9}) in_front = in_front || behind(sheet, o + d * t) < -sure;
    bool past = false;
    for (const double t : {1.02, 1.1, 1.5}) past = past || behind(sheet, o + d * t) > sure;
    if (in_front && past) out.ask(subject, ray, aim);
  }
  out.flush(subject);
  return out;
}

// From the camera at vertices whose faces are all there, and at edges between two of them.
[[nodiscard]] Leaks street_leaks(const Subject& subject, std::uint32_t rays) {
  Leaks out;
  const SheetTrace& sheet = subject.scene().layers[0];
  const auto full = [&](int x, int y) {
    for (const int dx : {-1, 0}) {
      for (const int dy : {-1, 0}) {
        if ((sheet.quads(x + dx, y + dy) & 6U) != 6U) return false;
      }
    }
    return true;
  };
  for (std::uint32_t i = 0; i < rays; ++i) {
    RandomStream r = dice(14, i);
    const auto x = static_cast<int>(1 + r.next_u32() % static_cast<std::uint32_t>(sheet.quads.width() - 2));
    const auto y = static_cast<int>(1 + r.next_u32() % static_cast<std::uint32_t>(sheet.quads.height() - 2));
    if (!full(x, y) || !full(x + 1, y)) continue;
    const Vec3f a = sheet.vertices(x, y);
    const Vec3f b = sheet.vertices(x + 1, y);
    const int aim = static_cast<int>(i % 2U);
    const Vec3f to = aim == kVertex ? a : a + (b - a) * r.uniform();
    out.ask(subject, {{0, 0, 0}, i % 4U < 2U ? to : normalized(to)}, aim);
  }
  out.flush(subject);
  return out;
}

[[nodiscard]] Ray camera_ray(const Subject& subject, std::uint32_t i) {
  RandomStream r = dice(21, i);
  if (subject.has_sheet()) {
    const SheetTrace& sheet = subject.scene().layers[0];
    const float u = r.uniform(0.0F, static_cast<float>(sheet.vertices.width()));
    const float v = r.uniform(0.0F, static_cast<float>(sheet.vertices.height()));
    return {{0, 0, 0}, normalized(unproject(sheet.intrinsics, u, v, 1.0F))};
  }
  const Vec3f from = normalized(in_cube(r, 1.0F) + Vec3f{0, 0, 1e-3F}) * 4.0F;
  return {from, in_cube(r, 1.1F) - from};
}

// Every third ray from the camera, to a lamp and onwards from what was seen.
[[nodiscard]] std::vector<Ray> mixed_rays(const Subject& subject, std::uint32_t count) {
  std::vector<Ray> rays;
  while (rays.size() < count) {
    const auto i = static_cast<std::uint32_t>(rays.size());
    const Ray first = camera_ray(subject, i);
    rays.push_back(first);
    Hit hit;
    if (!closest_hit(subject.bvh(), first, hit)) continue;
    RandomStream r = dice(22, i);
    const SurfacePoint p = surface_point(subject.mesh(), hit);
    const Vec3f n = dot(p.normal, first.direction) > 0 ? -p.normal : p.normal;
    const Vec3f lamp = subject.has_sheet()
                           ? Vec3f{r.uniform(-7.0F, 7.0F), -r.uniform(3.0F, 5.0F), r.uniform(4.0F, 90.0F)}
                           : normalized(in_cube(r, 1.0F) + Vec3f{1e-3F, 0, 0}) * 3.0F;
    const Vec3f start = offset_ray_origin(p.position, p.error, p.normal, lamp - p.position);
    rays.push_back({start, lamp - start, 0.0F, 1.0F});
    const Vec3f d = normalized(normalized(in_cube(r, 1.0F) + Vec3f{1e-4F, 0, 0}) + n * 1.0001F);
    rays.push_back({offset_ray_origin(p.position, p.error, p.normal, d), d});
  }
  rays.resize(count);
  return rays;
}

struct Score {
  const char* name;
  std::function<Hit(const Ray&)> trace;
  std::size_t far = 0;  // t farther than 1e-5 max(t, z) from the plane of the reported face
  double worst = 0;     // of |t error| / bound
  std::size_t wrong[6] = {};
};

void agreement(const Subject& subject, std::uint32_t count) {
  const TriangleMeshView mesh = subject.mesh();
  const std::vector<Ray> rays = mixed_rays(subject, count);
  std::vector<Score> scores;
  if (subject.has_sheet()) scores.push_back({"sheet", [&](const Ray& r) { return subject.by_sheet(r); }});
  scores.push_back({"tree", [&](const Ray& r) { return subject.by_tree(r); }});
#if defined(NPSIM_BENCH_EMBREE)
  scores.push_back({"embree", [&](const Ray& r) { return subject.by_peer(r); }});
#endif
  const std::size_t last = scores.size() - 1;
  std::vector<Hit> hits(scores.size());
  std::size_t other_hit = 0;
  std::size_t other_face = 0;
  std::size_t other_t = 0;
  std::size_t ties = 0;
  std::size_t ours_differ = 0;
  std::size_t searched = 0;
  const std::size_t sample = std::max<std::size_t>(1, rays.size() / 200);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Ray& ray = rays[i];
    const ExactRay exact = exact_ray(ray, subject.reach(ray.origin));
    bool dispute = i % sample == 0;
    for (std::size_t s = 0; s < scores.size(); ++s) {
      Hit& h = hits[s];
      h = scores[s].trace(ray);
      if (h.face != hits[0].face) dispute = true;
      if (h.face == kNoFace) continue;
      const ExactFace f = exact_face(mesh, mesh.faces[h.face], exact);
      const double z = std::fabs(exact.origin.z + f.t * exact.size * exact.unit.z);
      const double error = std::fabs(static_cast<double>(h.t) - f.t);
      if (f.inside > exact.slack && error > 1e-5 * std::max(f.t, z)) ++scores[s].far;
      scores[s].worst = std::max(scores[s].worst, error / f.bound);
      dispute = dispute || error > f.bound;
    }
    const Hit& a = hits[0];
    const Hit& b = hits[last];
    if (last == 1 ? false : std::memcmp(&hits[0], &hits[1], sizeof(Hit)) != 0) ++ours_differ;
    if ((a.face == kNoFace) != (b.face == kNoFace)) {
      ++other_hit;
    } else if (a.face != kNoFace) {
      const float z = std::fabs(ray.origin.z + a.t * ray.direction.z);
      const bool same_t = std::fabs(a.t - b.t) <= 1e-5F * std::max(a.t, z);
      if (a.face == b.face) {
        other_t += same_t ? 0 : 1;
      } else {
        ++(same_t ? ties : other_face);
      }
    }
    if (!dispute || searched >= 4000) continue;
    ++searched;
    for (std::size_t s = 0; s < scores.size(); ++s) ++scores[s].wrong[static_cast<int>(judge(mesh, exact, hits[s]))];
  }
  const double million = 1e6 / static_cast<double>(rays.size());
  std::printf(
      "%-20s %zu faces, %zu rays; of a million against embree: other hit %.0f, other face %.0f, other t %.0f, ties "
      "%.0f; "
      "sheet and tree differ %zu; %zu searched\n",
      subject.name().c_str(), mesh.faces.size(), rays.size(), million * static_cast<double>(other_hit),
      million * static_cast<double>(other_face), million * static_cast<double>(other_t),
      million * static_cast<double>(ties), ours_differ, searched);
  for (const Score& s : scores) {
    std::printf(
        "  %-8s t beyond 1e-5 %.0f of a million, worst / bound %.3g; of the searched: right %zu, leak %zu, ghost %zu, "
        "not nearest %zu, distance %zu\n",
        s.name, million * static_cast<double>(s.far), s.worst, s.wrong[0], s.wrong[1], s.wrong[2], s.wrong[3],
        s.wrong[5]);
  }
  std::fflush(stdout);
}

// Directions that leave the face to either side: at random, grazing, along its edges.
void spawn(const Subject& subject, const std::vector<Ray>& rays, const char* name) {
  const TriangleMeshView mesh = subject.mesh();
  std::size_t spawned = 0;
  std::size_t own[2] = {};
  for (std::uint32_t i = 0; i < rays.size(); ++i) {
    const Hit hit = subject.has_sheet() ? subject.by_sheet(rays[i]) : subject.by_tree(rays[i]);
    if (hit.face == kNoFace) continue;
    RandomStream r = dice(41, i);
    const SurfacePoint p = surface_point(mesh, hit);
    const Face& f = mesh.faces[hit.face];
    Vec3f d = in_cube(r, 1.0F);
    if (i % 4U == 1) d = cross(p.normal, d) + p.normal * r.uniform(-1e-3F, 1e-3F);
    if (i % 4U == 2) d = normalized(mesh.vertices[f.b] - mesh.vertices[f.a]);
    if (i % 4U == 3) d = cross(p.normal, d) + p.normal * r.uniform(-1e-6F, 1e-6F);
    const Ray away{offset_ray_origin(p.position, p.error, p.normal, d), d};
    ++spawned;
    if (occluded(subject.bvh(), away, [&](std::uint32_t face) { return face == hit.face; })) ++own[1];
    if (!subject.has_sheet()) continue;
    const std::uint32_t number = subject.number_of(hit.face);
    if (occluded(subject.scene(), away, [&](std::uint32_t face) { return face == number; })) ++own[0];
  }
  std::printf("%-34s spawned %zu, own face met: sheet %zu, tree %zu\n", name, spawned, own[0], own[1]);
  std::fflush(stdout);
}

struct Fnv {
  std::uint64_t value = 14695981039346656037ULL;
  void add(const void* data, std::size_t bytes) {
    const auto* p = static_cast<const unsigned char*>(data);
    for (std::size_t i = 0; i < bytes; ++i) value = (value ^ p[i]) * 1099511628211ULL;
  }
};

template <class Executor, class Trace>
[[nodiscard]] std::uint64_t hash_of(const std::vector<Ray>& rays, Executor& executor, const Trace& trace) {
  std::vector<Hit> hits(rays.size());
  executor.for_chunks(rays.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) hits[i] = trace(rays[i]);
  });
  Fnv hash;
  hash.add(hits.data(), hits.size() * sizeof(Hit));
  return hash.value;
}

void hashes(const Subject& subject, std::uint32_t count) {
  const std::vector<Ray> rays = mixed_rays(subject, count);
  const auto print = [&](const char* what, std::uint64_t value) {
    std::printf("%-20s %-24s %016llx\n", subject.name().c_str(), what, static_cast<unsigned long long>(value));
    std::fflush(stdout);
  };
  Fnv input;
  input.add(subject.mesh().vertices.data(), subject.mesh().vertices.size() * sizeof(Vec3f));
  input.add(rays.data(), rays.size() * sizeof(Ray));
  print("vertices and rays", input.value);
  SerialExecutor serial;
  ThreadPool two(2);
  ThreadPool five(5);
  const auto sheet = [&](const Ray& r) { return subject.by_sheet(r); };
  const auto one_lane = [&](const Ray& r) { return subject.by_sheet<simd::scalar::F32>(r); };
  const auto tree = [&](const Ray& r) { return subject.by_tree(r); };
  if (subject.has_sheet()) {
    print("sheet", hash_of(rays, serial, sheet));
    print("sheet, 2 threads", hash_of(rays, two, sheet));
    print("sheet, 5 threads", hash_of(rays, five, sheet));
    print("sheet, one lane", hash_of(rays, serial, one_lane));
    std::vector<Hit> hits(rays.size());
    closest_hits(subject.scene(), {rays.data(), rays.size()}, {hits.data(), hits.size()});
    for (Hit& h : hits) h.face = h.face == kNoFace ? kNoFace : subject.index_of(h.face);
    Fnv stream;
    stream.add(hits.data(), hits.size() * sizeof(Hit));
    print("sheet, streams", stream.value);
  }
  print("tree", hash_of(rays, serial, tree));
  print("tree, 5 threads", hash_of(rays, five, tree));
}

[[nodiscard]] bool ends_with(const std::string& s, const char* end) {
  const std::size_t n = std::strlen(end);
  return s.size() >= n && s.compare(s.size() - n, n, end) == 0;
}

void all_leaks(const Options& options, const std::vector<std::pair<std::string, io::Mesh>>& meshes) {
  std::printf("leaks (at vertices, edges, points)\n");
  Leaks sum;
  char name[128];
  for (const auto& [file, mesh] : meshes) {
    if (!options.asks(file)) continue;
    for (const float scale : kScales) {
      for (const bool away : {false, true}) {
        const float shift = away ? 1e5F * std::min(1.0F, scale) : 0.0F;
        std::snprintf(name, sizeof name, "%s x %.0e%s", file.c_str(), static_cast<double>(scale), away ? " away" : "");
        const Subject subject(name, moved(mesh, scale, {0.6F * shift, -shift, 0.3F * shift}));
        const Leaks leaks = closed_mesh_leaks(subject, scale, options.rays);
        leaks.print(name);
        sum.add(leaks);
      }
    }
  }
  const Shape shape{161, 121};
  for (const float scale : kScales) {
    if (!options.asks("waves")) break;
    for (const bool away : {false, true}) {
      const float depth = away ? 1e5F * std::min(1.0F, scale) : 8.0F * scale;
      const Intrinsics k = intrinsics_from_fov(shape, away ? 12.0F * scale / depth : 1.2F);
      Layer layer = waves(k, shape, depth, scale);
      std::snprintf(name, sizeof name, "waves x %.0e%s", static_cast<double>(scale), away ? " away" : "");
      const Subject subject(name, {layer.view()}, k);
      const Leaks leaks = sheet_leaks(subject, depth, 4 * options.rays);
      leaks.print(name);
      sum.add(leaks);
    }
  }
  if (options.asks("street")) {
    Layers street = make_layers(options.street);
    const Subject subject("street", {street.all[0].view()}, street.intrinsics);
    const Leaks leaks = street_leaks(subject, 10 * options.rays);
    leaks.print("street from the camera");
    sum.add(leaks);
  }
  sum.print("sum");
}

void all_spawns(const Options& options) {
  std::printf("spawned rays\n");
  char name[128];
  for (float scale = 1e-4F; scale < 2e5F; scale *= 10) {
    for (const float shift : {0.0F, 1.0F, 1e3F}) {
      const Subject ball("sphere", moved(sphere(24, 48), scale, {shift * scale, -0.4F * shift * scale, shift * scale}));
      std::vector<Ray> rays(options.rays);
      for (std::uint32_t i = 0; i < rays.size(); ++i) {
        RandomStream r = dice(42, i);
        const Vec3f from{shift * scale, -0.4F * shift * scale, shift * scale};
        rays[i] = {from + in_cube(r, 0.5F * scale), in_cube(r, 1.0F)};
      }
      std::snprintf(name, sizeof name, "sphere x %.0e at %.0e", static_cast<double>(scale),
                    static_cast<double>(shift * scale));
      spawn(ball, rays, name);
    }
    const Shape shape{97, 73};
    const Intrinsics k = intrinsics_from_fov(shape, 1.2F);
    Layer layer = waves(k, shape, scale, 0.2F * scale);
    const Subject sheet("waves", {layer.view()}, k);
    std::vector<Ray> rays(options.rays);
    for (std::uint32_t i = 0; i < rays.size(); ++i) {
      RandomStream r = dice(43, i);
      const Vec3f to = sheet.mesh().vertices[r.next_u32() % sheet.mesh().vertices.size()];
      const Vec3f from = i % 2U == 0 ? Vec3f{} : in_cube(r, 0.7F * scale);
      rays[i] = {from, to + in_cube(r, 0.02F * scale) - from};
    }
    std::snprintf(name, sizeof name, "waves at %.0e", static_cast<double>(scale));
    spawn(sheet, rays, name);
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("The robustness of rays, counted against topology and double precision; nothing is timed");
  Options options;
  std::string street = "960x540";
  app.add_option("files", options.files, "closed meshes (.obj), or layers that npsim_bench_rays --save wrote");
  app.add_option("--part", options.part, "which of the counts")
      ->capture_default_str()
      ->check(CLI::IsMember({"leaks", "agree", "spawn", "hash", "all"}));
  app.add_option("--rays", options.rays, "of each row")->capture_default_str()->check(CLI::Range(1, 100000000));
  app.add_option("--street", street, "WIDTHxHEIGHT of the generated street")->capture_default_str()->check(is_size);
  app.add_option("--only", options.only, "only sphere, cube, waves, street or the files whose names begin so");
  if (const auto status = parse(app, argc, argv)) return *status;
  static_cast<void>(parse_size(street, options.street));
  std::vector<std::pair<std::string, io::Mesh>> meshes;
  meshes.emplace_back("sphere", sphere(100, 200));
  meshes.emplace_back("cube", cube(40));
  std::vector<std::pair<std::string, Layers>> files;
  for (const std::string& file : options.files) {
    const std::string name = file.substr(file.find_last_of('/') + 1);
    if (ends_with(file, ".obj")) {
      auto mesh = io::read_obj(file);
      if (!mesh) {
        std::fprintf(stderr, "npsim_bench_leaks: cannot read %s\n", file.c_str());
        return 1;
      }
      meshes.emplace_back(name, std::move(mesh.value()));
    } else {
      Layers layers;
      if (!load_layers(file.c_str(), layers)) {
        std::fprintf(stderr, "npsim_bench_leaks: cannot read %s\n", file.c_str());
        return 1;
      }
      files.emplace_back(name, std::move(layers));
    }
  }
  if (options.wants("leaks")) all_leaks(options, meshes);
  if (options.wants("spawn")) all_spawns(options);
  if (options.wants("agree") || options.wants("hash")) {
    if (options.asks("street")) files.insert(files.begin(), {"street", make_layers(options.street)});
    for (auto& [name, layers] : files) {
      if (!options.asks(name)) continue;
      const Subject sheet(name + " sheet", {layers.all[0].view()}, layers.intrinsics);
      if (options.wants("agree")) agreement(sheet, options.rays);
      const Subject both(name + " layers", {layers.all[1].view(), layers.all[2].view()}, layers.intrinsics);
      if (options.wants("agree")) agreement(both, options.rays);
      if (options.wants("hash")) hashes(both, options.rays);
    }
    for (auto& [name, mesh] : meshes) {
      if (!options.asks(name)) continue;
      const Subject subject(name, mesh);
      if (options.wants("agree")) agreement(subject, options.rays);
    }
  }
  return 0;
}
