// SPDX-License-Identifier: Apache-2.0
// What a generated street is asked for (StreetParams) and what it yields (Street).
//
// Every plane of Street except `image` belongs to the ray through the pixel centre and is exact: nothing is
// anti-aliased, so labels, depth and normals agree with the mesh to the last pixel. The photograph is anti-aliased.
#ifndef NPSIM_SAMPLES_STREET_PARAMS_HPP
#define NPSIM_SAMPLES_STREET_PARAMS_HPP

#include <cstdint>
#include <string>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/io/image.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"

namespace npsim {
namespace street {

// How far the depth and the normals are from the truth, as a monocular network would err. Each strength is 1 for what
// such networks show on street scenes and 0 for none; all zero gives the exact planes, bit by bit.
struct Degradation {
  float edge_smear = 1.0F;    // 1: depth mixes over about 0.5 % of the image width across every discontinuity
  float scale_error = 1.0F;   // 1: the whole image up to 6 % too near or too far
  float field_error = 1.0F;   // 1: a smooth field of about 5 % over tens of pixels
  float noise = 1.0F;         // 1: noise of about 0.6 % correlated over a few pixels
  float sky_error = 1.0F;     // 1: the sky stands at 60..90 m, ramping; 0: no surface (depth 0)
  float normal_blur = 1.0F;   // 1: normals mixed over about 0.4 % of the image width
  float normal_noise = 1.0F;  // 1: about 4 degrees, correlated
  float normal_road = 1.0F;   // 1: a part of the road tilted by about 20 degrees
  float normal_sky = 1.0F;    // 1: sky normals tilted towards the ground; 0: the convention for no surface
};

struct StreetParams {
  std::uint64_t seed = 1;
  Shape shape{960, 540};
  float horizontal_fov_rad = 1.17F;          // 67 degrees, a dashboard camera
  int samples = 4;                           // jittered samples a pixel, 1..64
  int sky_rays = 2;                          // hemisphere rays a sample, 0..16
  int light_min_px = 3;                      // smaller lights are left out of the annotation (not out of the emitters)
  float sensor_noise = 1.0F;                 // 1: noise of a small daytime sensor; 0: none
  DepthSource depth = DepthSource::network;  // network: `degradation`; stereo, lidar: sensors.hpp, and no normals
  bool materials = true;                     // whether the scene gives albedo and roughness
  Degradation degradation{};
};

// One lamp, window, sign or signal of the true scene, seen or not. Centre and normal in the camera frame; the emitter
// is a flat patch with half-extents along an in-plane horizontal and an in-plane vertical direction.
struct Emitter {
  LightClass cls = LightClass::none;
  SignalState state = SignalState::unknown;
  LightClass group_cls = LightClass::none;
  std::uint32_t group = 0;      // emitters with the same number belong together; 0: alone
  std::uint32_t mark = 0;       // position + 1 in Street::marks; 0: not annotated (out of sight or too small)
  bool lit_by_day = false;      // the lit disc of a traffic light, burning brake lamps
  Vec3f centre{};               // m
  Vec3f normal{};               // unit
  Vec2f half_extents{};         // m
  float area_m2 = 0;            // of all its faces
  float seen_area_m2 = 0;       // of those that face the camera, turned parallel to the image
  bool closed = false;          // faces all round (a lantern, the windows of a car): has no direction of its own
  Vec3f axis{};                 // unit: where a lamp shines; of a glowing surface its normal
  Vec3f up{};                   // unit, normal to axis: of a street lamp along the road
  float mounting_height_m = 0;  // of a street lamp's centre above the road
};

struct MeshMaterial {
  std::string name;
  Vec3f albedo{};  // linear, mean
  float roughness = 1;
};

struct Street {
  StreetParams params;
  Intrinsics intrinsics;
  float camera_height_m = 0;
  float camera_pitch_rad = 0;          // positive: looking down
  Vec3f ground_up{};                   // unit normal of the road, camera frame
  io::Image<Rgb8> image;               // the daytime photograph, sRGB
  io::Image<float> depth;              // exact z-depth in metres; 0 for the sky
  io::Image<float> background_depth;   // the same with all foreground (kForegroundLabels) taken away
  io::Image<Vec3f> normals;            // exact, camera frame, facing the camera; (0, 0, -1) for the sky
  io::Image<Label> labels;             // Cityscapes label ids
  io::Image<std::uint16_t> instances;  // label * 1000 + k for countable things, the label id otherwise
  io::Image<Vec3f> albedo;             // linear
  io::Image<float> roughness;
  io::Image<std::uint16_t> light_index;  // position + 1 in marks; 0: no light
  io::Image<ReflectorClass> reflectors;  // number plates
  std::vector<LightMark> marks;          // sources and groups; ids are positions + 1
  std::vector<Emitter> emitters;
  io::Image<float> est_depth;    // as StreetParams::depth has it
  io::Image<Vec3f> est_normals;  // of a network; exact where the depth is

  // The true mesh, camera frame.
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<std::uint16_t> face_material;  // into materials
  std::vector<Label> face_label;
  std::vector<std::uint16_t> face_instance;
  std::vector<std::uint32_t> face_emitter;  // position + 1 in emitters; 0: none
  std::vector<MeshMaterial> materials;

  [[nodiscard]] TriangleMeshView mesh() const {
    return {Span<const Vec3f>(vertices.data(), vertices.size()), Span<const Face>(faces.data(), faces.size())};
  }
};

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_PARAMS_HPP
