// SPDX-License-Identifier: Apache-2.0
#include "scene_truth.hpp"

#include "npsim/io/pfm.hpp"
#include "npsim/io/scene_resize.hpp"
#include "tool/loading.hpp"
#include "tool/options.hpp"
#include "tool/outputs.hpp"
#include "true_lamps.hpp"

namespace npsim::tool {

io::Expected<std::pair<io::Scene, Truth>> load_with_truth(const std::string& folder, const std::string& at_size,
                                                          const std::string& output) {
  Shape size;
  if (!at_size.empty()) {
    const io::Expected<Shape> parsed = parse_size(at_size);
    if (!parsed) return parsed.error();
    size = parsed.value();
  }
  io::Expected<io::Scene> scene = load_scene(folder, "");  // resized when all is read
  if (!scene) return scene.error();
  io::Scene& s = scene.value();
  if (!output.empty()) {
    if (const io::Outcome apart = InputFiles(s).expect_none_of({output}); !apart) return apart.error();
  }
  Truth truth;
  io::Expected<io::Image<float>> depth = io::read_truth_depth(s);
  if (!depth) return depth.error();
  truth.depth = std::move(depth.value());
  if (const io::Outcome o = io::expect_shape(s.truth.depth, truth.depth.shape(), s.shape(), "the image"); !o) {
    return o.error();
  }
  if (s.truth.normals.empty()) {
    s.notes.push_back("truth: no normals, so none are judged");
  } else {
    io::Expected<io::Image<Vec3f>> normals = io::read_truth_normals(s);
    if (!normals) return normals.error();
    truth.normals = std::move(normals.value());
    if (const io::Outcome o = io::expect_shape(s.truth.normals, truth.normals.shape(), s.shape(), "the image"); !o) {
      return o.error();
    }
  }
  if (!s.truth.background_depth.empty()) {
    io::Expected<io::Image<float>> background = io::read_truth_background_depth(s);
    if (!background) return background.error();
    truth.background_depth = std::move(background.value());
    if (const io::Outcome o =
            io::expect_shape(s.truth.background_depth, truth.background_depth.shape(), s.shape(), "the image");
        !o) {
      return o.error();
    }
  }
  if (!s.truth.albedo.empty()) {
    io::Expected<io::Image<Vec3f>> albedo = io::read_truth_albedo(s);
    if (!albedo) return albedo.error();
    truth.albedo = std::move(albedo.value());
    if (const io::Outcome o = io::expect_shape(s.truth.albedo, truth.albedo.shape(), s.shape(), "the image"); !o) {
      return o.error();
    }
  }
  if (!s.truth.emitters.empty()) {
    io::Expected<std::vector<io::TrueEmitter>> emitters = io::read_truth_emitters(s);
    if (!emitters) return emitters.error();
    truth.emitters = std::move(emitters.value());
  }
  io::Expected<MeshTruth> mesh = read_mesh_truth(s, truth.emitters);
  if (!mesh) return mesh.error();
  truth.mesh = std::move(mesh.value());
  if (!at_size.empty()) {
    if (const io::Outcome resized = io::resize_scene(s, size); !resized) return resized.error();
    truth.depth = io::resized_nearest(truth.depth, size);
    if (!truth.background_depth.empty()) truth.background_depth = io::resized_nearest(truth.background_depth, size);
    if (!truth.normals.empty()) truth.normals = io::resized_nearest(truth.normals, size);
    if (!truth.albedo.empty()) truth.albedo = io::resized_area(truth.albedo, size);
  }
  return std::pair<io::Scene, Truth>(std::move(s), std::move(truth));
}

io::Expected<TrueNight> read_true_night(const io::Scene& scene, const std::string& pfm) {
  TrueNight night;
  io::Expected<io::Image<Vec3f>> light = io::read_pfm_rgb(pfm);
  if (!light) return light.error();
  night.luminance = std::move(light.value());
  if (const io::Outcome o = io::expect_shape(pfm, night.luminance.shape(), scene.shape(), "the scene"); !o) {
    return o.error();
  }
  io::Expected<TrueLamps> lamps = read_true_lamps(scene);
  if (!lamps) return lamps.error();
  night.lamps = std::move(lamps.value().emitters);
  night.ground = lamps.value().ground;
  return night;
}

}  // namespace npsim::tool
