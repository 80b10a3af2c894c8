// SPDX-License-Identifier: Apache-2.0
// Scene: one daytime photograph and everything known about it, owned, for hosts.
//
// Invariant (of a scene that was read): image and depth are not empty; every other plane is empty or of their size;
// depth is 0 where missing; normals have unit length, camera frame, or are zero where there is none; every entry of
// light_index is 0 or a position + 1 in lights.
#ifndef NPSIM_IO_DETAIL_SCENE_DATA_HPP
#define NPSIM_IO_DETAIL_SCENE_DATA_HPP

#include <cstdint>
#include <string>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/io/image.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

// Files with what is known to be true (generated scenes); empty where there is none. Read on demand.
struct TruthFiles {
  std::string depth;             // metres
  std::string background_depth;  // metres, with all foreground taken away; 0: sky
  std::string normals;           // canonical convention
  std::string mesh;              // OBJ
  std::string emitters;          // JSON
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
  Image<float> depth;  // z-depth, m
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
  TruthFiles truth;
  std::vector<std::string> notes;  // what was found, assumed and converted, one line each

  [[nodiscard]] Shape shape() const { return image.shape(); }
};

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_SCENE_DATA_HPP
