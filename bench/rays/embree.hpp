// SPDX-License-Identifier: Apache-2.0
// The peer: Embree 3 on triangles, default or robust, or on quads: single rays; packets of 16 marked coherent; streams.
#ifndef NPSIM_BENCH_RAYS_EMBREE_HPP
#define NPSIM_BENCH_RAYS_EMBREE_HPP

#include <embree3/rtcore.h>

#include <sys/types.h>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "layers.hpp"
#include "npsim/core/span.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim::bench {

class Embree {
 public:
  Embree(const TriangleMeshView& mesh, bool robust) : Embree(robust) {
    attach(RTC_GEOMETRY_TYPE_TRIANGLE, RTC_FORMAT_UINT3, mesh.vertices, mesh.faces);
    given_ = bytes_;
  }
  // Its hits have numbers of their own.
  Embree(Span<const Vec3f> vertices, const PairedFaces& faces) : Embree(false) {
    if (!faces.quads.empty()) {
      attach(RTC_GEOMETRY_TYPE_QUAD, RTC_FORMAT_UINT4, vertices,
             Span<const Quad>(faces.quads.data(), faces.quads.size()));
    }
    if (!faces.triangles.empty()) {
      attach(RTC_GEOMETRY_TYPE_TRIANGLE, RTC_FORMAT_UINT3, vertices,
             Span<const Face>(faces.triangles.data(), faces.triangles.size()));
    }
    given_ = bytes_;
  }
  ~Embree() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  Embree(const Embree&) = delete;
  Embree& operator=(const Embree&) = delete;

  void build() { rtcCommitScene(scene_); }
  // Of the structure, without the mesh.
  [[nodiscard]] double bytes() const { return static_cast<double>(bytes_ - given_); }

  [[nodiscard]] Hit closest(const Ray& ray) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit r;
    r.ray = of(ray);
    r.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    r.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene_, &context, &r);
    Hit hit;
    if (r.hit.geomID != RTC_INVALID_GEOMETRY_ID) hit = {r.ray.tfar, r.hit.primID, r.hit.u, r.hit.v};
    return hit;
  }
  [[nodiscard]] bool occluded(const Ray& ray) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRay r = of(ray);
    rtcOccluded1(scene_, &context, &r);
    return r.tfar < 0;
  }

  void closest_by_16(Span<const Ray> rays, Span<Hit> hits) const {
    RTCIntersectContext context = coherent();
    for (std::size_t first = 0; first < rays.size(); first += 16) {
      RTCRayHit16 p;
      alignas(64) int valid[16];
      put(rays, first, valid, p.ray);
      for (int i = 0; i < 16; ++i) p.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      for (int i = 0; i < 16; ++i) p.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
      rtcIntersect16(valid, scene_, &context, &p);
      for (std::size_t i = 0; i < 16 && first + i < rays.size(); ++i) {
        const bool hit = p.hit.geomID[i] != RTC_INVALID_GEOMETRY_ID;
        hits[first + i] = hit ? Hit{p.ray.tfar[i], p.hit.primID[i], p.hit.u[i], p.hit.v[i]} : Hit{};
      }
    }
  }
  void occluded_by_16(Span<const Ray> rays, Span<std::uint8_t> blocked) const {
    RTCIntersectContext context = coherent();
    for (std::size_t first = 0; first < rays.size(); first += 16) {
      RTCRay16 p;
      alignas(64) int valid[16];
      put(rays, first, valid, p);
      rtcOccluded16(valid, scene_, &context, &p);
      for (std::size_t i = 0; i < 16 && first + i < rays.size(); ++i) blocked[first + i] = p.tfar[i] < 0 ? 1 : 0;
    }
  }
  void closest_stream(Span<const Ray> rays, Span<Hit> hits) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit some[kStream];
    for (std::size_t first = 0; first < rays.size(); first += kStream) {
      const std::size_t n = std::min(kStream, rays.size() - first);
      for (std::size_t i = 0; i < n; ++i) {
        some[i].ray = of(rays[first + i]);
        some[i].hit.geomID = RTC_INVALID_GEOMETRY_ID;
        some[i].hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
      }
      rtcIntersect1M(scene_, &context, some, static_cast<unsigned>(n), sizeof(RTCRayHit));
      for (std::size_t i = 0; i < n; ++i) {
        const RTCHit& h = some[i].hit;
        hits[first + i] = h.geomID != RTC_INVALID_GEOMETRY_ID ? Hit{some[i].ray.tfar, h.primID, h.u, h.v} : Hit{};
      }
    }
  }
  void occluded_stream(Span<const Ray> rays, Span<std::uint8_t> blocked) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRay some[kStream];
    for (std::size_t first = 0; first < rays.size(); first += kStream) {
      const std::size_t n = std::min(kStream, rays.size() - first);
      for (std::size_t i = 0; i < n; ++i) some[i] = of(rays[first + i]);
      rtcOccluded1M(scene_, &context, some, static_cast<unsigned>(n), sizeof(RTCRay));
      for (std::size_t i = 0; i < n; ++i) blocked[first + i] = some[i].tfar < 0 ? 1 : 0;
    }
  }

 private:
  static constexpr std::size_t kStream = 256;

  explicit Embree(bool robust) : device_(rtcNewDevice("threads=1")) {
    rtcSetDeviceMemoryMonitorFunction(
        device_,
        [](void* bytes, ssize_t change, bool) {
          *static_cast<ssize_t*>(bytes) += change;
          return true;
        },
        &bytes_);
    scene_ = rtcNewScene(device_);
    if (robust) rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
  }
  template <class Corners>
  void attach(RTCGeometryType type, RTCFormat format, Span<const Vec3f> vertices, Span<Corners> faces) {
    RTCGeometry geometry = rtcNewGeometry(device_, type);
    void* v =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3f), vertices.size());
    std::copy(vertices.begin(), vertices.end(), static_cast<Vec3f*>(v));
    void* f = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, format, sizeof(Corners), faces.size());
    std::copy(faces.begin(), faces.end(), static_cast<std::remove_const_t<Corners>*>(f));
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
  }

  static RTCIntersectContext coherent() {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    return context;
  }
  static void put(Span<const Ray> rays, std::size_t first, int* valid, RTCRay16& out) {
    for (std::size_t i = 0; i < 16; ++i) {
      valid[i] = first + i < rays.size() ? -1 : 0;
      const RTCRay r = of(rays[std::min(first + i, rays.size() - 1)]);
      out.org_x[i] = r.org_x;
      out.org_y[i] = r.org_y;
      out.org_z[i] = r.org_z;
      out.dir_x[i] = r.dir_x;
      out.dir_y[i] = r.dir_y;
      out.dir_z[i] = r.dir_z;
      out.tnear[i] = r.tnear;
      out.tfar[i] = r.tfar;
      out.time[i] = r.time;
      out.mask[i] = r.mask;
      out.id[i] = r.id;
      out.flags[i] = r.flags;
    }
  }
  static RTCRay of(const Ray& ray) {
    RTCRay r;
    r.org_x = ray.origin.x;
    r.org_y = ray.origin.y;
    r.org_z = ray.origin.z;
    r.dir_x = ray.direction.x;
    r.dir_y = ray.direction.y;
    r.dir_z = ray.direction.z;
    r.tnear = ray.t_min;
    r.tfar = ray.t_max;
    r.time = 0;
    r.mask = ~0U;
    r.id = 0;
    r.flags = 0;
    return r;
  }

  RTCDevice device_;
  RTCScene scene_ = nullptr;
  ssize_t bytes_ = 0;
  ssize_t given_ = 0;
};

}  // namespace npsim::bench

#endif  // NPSIM_BENCH_RAYS_EMBREE_HPP
