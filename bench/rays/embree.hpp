// SPDX-License-Identifier: Apache-2.0
// The peer: Embree 3 in its single-ray mode on triangles, default or robust.
#ifndef NPSIM_BENCH_RAYS_EMBREE_HPP
#define NPSIM_BENCH_RAYS_EMBREE_HPP

#include <embree3/rtcore.h>

#include <sys/types.h>
#include <algorithm>
#include <cstddef>

#include "npsim/core/triangle_mesh.hpp"
#include "npsim/trace/ray.hpp"

namespace npsim::bench {

class Embree {
 public:
  Embree(const TriangleMeshView& mesh, bool robust) : device_(rtcNewDevice("threads=1")) {
    rtcSetDeviceMemoryMonitorFunction(
        device_,
        [](void* bytes, ssize_t change, bool) {
          *static_cast<ssize_t*>(bytes) += change;
          return true;
        },
        &bytes_);
    scene_ = rtcNewScene(device_);
    if (robust) rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_ROBUST);
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
    void* v = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(Vec3f),
                                      mesh.vertices.size());
    std::copy(mesh.vertices.begin(), mesh.vertices.end(), static_cast<Vec3f*>(v));
    void* f =
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, sizeof(Face), mesh.faces.size());
    std::copy(mesh.faces.begin(), mesh.faces.end(), static_cast<Face*>(f));
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
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

 private:
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
