// SPDX-License-Identifier: Apache-2.0
// A scene folder in: scene.json names the files, their encodings and the camera.
//
// Only "image", "depth" and "camera" are required. Relative names are relative to scene.json. Every key is checked: an
// unknown one is an error that names it. Planes have to be of the image's size. What was found, assumed and converted
// is written to Scene::notes. Cost: every named file is read once, except "truth", which is read on demand.
// Invariant of a scene that was read: image and depth are not empty; every other plane is empty or of their size;
// depth is 0 where missing; normals have unit length, camera frame, or are zero where there is none; every entry of
// light_index is 0 or a position + 1 in lights.
#ifndef NPSIM_IO_SCENE_HPP
#define NPSIM_IO_SCENE_HPP

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

// What is known to be true (generated scenes). Files are read on demand; names are empty where there is none.
struct TruthFiles {
  std::string depth;             // metres
  std::string background_depth;  // metres, with all foreground taken away; 0: sky
  std::string normals;           // canonical convention
  std::string albedo;            // linear
  std::string mesh;              // OBJ
  std::string emitters;          // JSON
  std::optional<GroundPlane> ground;
};

// A file that a scene is made of, and the field of scene.json that names it.
struct SceneFile {
  std::string field;  // empty: scene.json itself
  std::string path;
};

struct Scene {
  std::string name;
  std::string file;              // the scene.json
  std::string generator;         // the program that made the scene, where scene.json says so
  std::vector<SceneFile> files;  // scene.json and every file it names, also those that are read on demand
  Image<Rgb8> image;
  std::uint64_t photograph = 0;  // photograph_key() of the image as it was read, for NightParams::photograph
  Image<float> depth;            // z-depth, m
  DepthSource depth_source = DepthSource::unknown;
  Intrinsics intrinsics;
  double baseline_m = 0;             // of a stereo pair; 0 where unknown
  double camera_height_m = 0;        // above the road, to put estimated depth to scale; 0 where unknown or not needed
  Image<Label> labels;               // Cityscapes label ids
  Image<std::uint16_t> instances;    // 0 = no object
  Image<Vec3f> normals;              // camera frame, facing the camera
  Image<Vec3f> albedo;               // linear, 0..1
  Image<float> roughness;            // 0..1
  Image<std::uint16_t> light_index;  // position + 1 in lights
  std::vector<LightMark> lights;
  Image<ReflectorClass> reflectors;
  TruthFiles truth;
  std::vector<std::string> notes;  // what was found, assumed and converted, one line each

  [[nodiscard]] Shape shape() const { return image.shape(); }

  // What the pipeline takes; views into this scene, which has to outlive them and stay as it is.
  [[nodiscard]] SceneView view() const {
    SceneView view;
    view.camera = intrinsics;
    view.camera_height_m = static_cast<float>(camera_height_m);
    view.image = image.view();
    view.depth = depth.view();
    view.depth_source = depth_source;
    view.stereo_baseline_m = static_cast<float>(baseline_m);
    view.labels = labels.view();
    view.instances = instances.view();
    view.normals = normals.view();
    view.albedo = albedo.view();
    view.roughness = roughness.view();
    view.light_index = light_index.view();
    view.lights = Span<const LightMark>(lights.data(), lights.size());
    view.reflectors = reflectors.view();
    return view;
  }
};

// A lamp of a generated scene.
struct TrueEmitter {
  std::uint32_t id = 0;  // that its faces carry: TrueMesh::face_emitter
  LightClass cls = LightClass::none;
  LightClass group_cls = LightClass::none;
  SignalState state = SignalState::unknown;
  Vec3f centre_m;  // camera frame
  Vec3f normal;    // unit; light leaves on this side
  Vec2f half_extents_m;
  bool closed = false;          // faces all round, and no direction of its own: the normal leads to the camera
  float area_m2 = 0;            // of its faces
  float seen_area_m2 = 0;       // of those that face the camera, turned parallel to the image
  Vec3f axis;                   // unit: where a lamp shines (a vehicle's along its heading); a surface's normal
  Vec3f up;                     // unit, normal to axis: of a street lamp along the road
  float mounting_height_m = 0;  // of a street lamp's centre above the road
  std::uint32_t mark = 0;       // id of its annotation; 0: the photograph does not show it; read for street lamps alone
};

// A folder with a scene.json, or the scene.json itself.
[[nodiscard]] Expected<Scene> read_scene(const std::string& dir_or_json, const ReadLimits& limits = {});

// The truth of a generated scene, at the size it was generated with. Each is an error where scene.json names none.
[[nodiscard]] Expected<Image<float>> read_truth_depth(const Scene& scene, const ReadLimits& limits = {});
// Behind the foreground; 0 where nothing but sky is.
[[nodiscard]] Expected<Image<float>> read_truth_background_depth(const Scene& scene, const ReadLimits& limits = {});
// Canonical convention, zero where there is no surface.
[[nodiscard]] Expected<Image<Vec3f>> read_truth_normals(const Scene& scene, const ReadLimits& limits = {});
[[nodiscard]] Expected<Image<Vec3f>> read_truth_albedo(const Scene& scene, const ReadLimits& limits = {});
[[nodiscard]] Expected<std::vector<TrueEmitter>> read_truth_emitters(const Scene& scene, const ReadLimits& limits = {});

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#include "npsim/io/detail/read_scene.hpp"

#endif  // NPSIM_IO_SCENE_HPP
