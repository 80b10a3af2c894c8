// SPDX-License-Identifier: Apache-2.0
#include "street.hpp"

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "annotate.hpp"
#include "background.hpp"
#include "degrade.hpp"
#include "layout.hpp"
#include "npsim/core/camera.hpp"
#include "plan.hpp"
#include "render.hpp"
#include "scene.hpp"
#include "sensors.hpp"

namespace npsim {
namespace street {
namespace {

[[nodiscard]] Status validate(const StreetParams& p) {
  const auto bad = [](const char* what) { return Status(StatusCode::invalid_argument, what); };
  if (p.shape.width < 1 || p.shape.height < 1 || p.shape.width > 16384 || p.shape.height > 16384) {
    return bad("street: width and height must lie in 1..16384");
  }
  if (!(p.horizontal_fov_rad > 0.1F && p.horizontal_fov_rad < 2.8F))
    return bad("street: field of view must lie in 0.1..2.8 rad");
  if (p.samples < 1 || p.samples > 64) return bad("street: samples must lie in 1..64");
  if (p.sky_rays < 0 || p.sky_rays > 16) return bad("street: sky rays must lie in 0..16");
  if (p.depth == DepthSource::unknown) return bad("street: depth must be of network, stereo, lidar or exact");
  if (p.light_min_px < 1) return bad("street: light_min_px must be at least 1");
  const Degradation& g = p.degradation;
  for (const float s : {p.sensor_noise, g.edge_smear, g.scale_error, g.field_error, g.noise, g.sky_error, g.normal_blur,
                        g.normal_noise, g.normal_road, g.normal_sky}) {
    if (!(s >= 0 && s <= 4)) return bad("street: strengths must lie in 0..4");
  }
  return {};
}

}  // namespace

Status make_street(const StreetParams& params, AnyExecutor executor, Street& street) {
  NPSIM_RETURN_IF_ERROR(validate(params));
  const Layout layout = make_layout(params.seed);
  Scene scene = build_scene(layout);
  if (scene.lights.size() > 65000 || scene.materials.size() > 65000) {
    return Status(StatusCode::capacity_exceeded, "street: too many lights or materials");
  }
  Stage stage;
  NPSIM_RETURN_IF_ERROR(make_stage(scene, layout, stage));

  street = Street{};
  street.params = params;
  street.intrinsics = intrinsics_from_fov(params.shape, params.horizontal_fov_rad);
  street.camera_height_m = layout.camera_height;
  street.camera_pitch_rad = layout.camera_pitch;
  street.ground_up = stage.to_camera({0, 1, 0});
  street.image = io::Image<Rgb8>(params.shape);
  street.depth = io::Image<float>(params.shape);
  street.background_depth = io::Image<float>(params.shape);
  street.normals = io::Image<Vec3f>(params.shape);
  street.labels = io::Image<Label>(params.shape);
  street.instances = io::Image<std::uint16_t>(params.shape);
  street.albedo = io::Image<Vec3f>(params.shape);
  street.roughness = io::Image<float>(params.shape);
  street.light_index = io::Image<std::uint16_t>(params.shape);
  street.reflectors = io::Image<ReflectorClass>(params.shape);
  std::vector<std::uint32_t> seen;
  render_street(stage, street, seen, executor);
  NPSIM_RETURN_IF_ERROR(render_background(stage, street, executor));
  collect_emitters(stage, street);
  annotate(stage, seen, street);
  if (params.depth == DepthSource::network) {
    degrade_depth(street, executor);
    degrade_normals(street, executor);
  } else {
    street.est_depth = street.depth;
    street.est_normals = street.normals;
    if (params.depth == DepthSource::stereo) measure_stereo(street);
    if (params.depth == DepthSource::lidar) measure_laser(stage, street);
  }

  for (std::size_t i = 0; i < scene.faces.size(); ++i) {
    const FaceInfo& f = scene.info[i];
    street.face_material.push_back(f.material);
    street.face_label.push_back(f.label);
    street.face_instance.push_back(f.instance);
    street.face_emitter.push_back(f.light);
  }
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    street.materials.push_back({"m" + std::to_string(i), scene.materials[i].base, scene.materials[i].roughness});
  }
  street.vertices = std::move(stage.vertices);
  street.faces = std::move(stage.faces);
  return {};
}

}  // namespace street
}  // namespace npsim
