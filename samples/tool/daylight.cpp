// SPDX-License-Identifier: Apache-2.0
#include "daylight.hpp"

#include <cstdint>
#include <vector>

#include "engine.hpp"
#include "npsim/color/srgb.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/pipeline/relight.hpp"

namespace npsim::tool {

OrderedJson to_json(const DaylightReport& r) {
  OrderedJson out = {{"shadow_found", r.shadow},
                     {"sunlit_over_shadowed_rgb", {r.ratio.x, r.ratio.y, r.ratio.z}},
                     {"sunlit_share_of_ground", r.sunlit_share},
                     {"contrast", r.contrast},
                     {"error_log2", r.error_log2}};
  if (r.sun_found) {
    constexpr float kDegrees = 57.2957795F;
    out["sun"] = {{"azimuth_deg", kDegrees * r.azimuth_rad},  // 0 ahead, 90 to the right
                  {"elevation_deg", kDegrees * r.elevation_rad}};
  }
  return out;
}

io::Outcome write_daylight(const std::string& folder, const io::Scene& scene, const RefinedDepth& refined,
                           ThreadPool& pool, OrderedJson& report) {
  if (!scene.albedo.empty()) return io::Done{};
  const AlbedoParams params;
  const Shape shape = scene.shape();
  std::vector<unsigned char> memory(estimate_albedo_workspace_bytes(params, shape));
  Workspace workspace(memory.data(), memory.size());
  io::Image<Vec3f> albedo(shape);
  io::Image<float> sun(shape);
  DaylightReport found;
  const Status status = engine::estimate_albedo(params, albedo_scene(scene.view(), refined), workspace,
                                                AlbedoEstimate{albedo.view(), sun.view()}, found, pool);
  if (!status.ok()) return io::Error{folder, kDaylightFiles[0], status.message()};
  report = to_json(found);
  io::Image<Rgb8> picture(shape);
  io::Image<std::uint8_t> shadow(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const Vec3f a = albedo(x, y);
      picture(x, y) = {srgb_encode8(a.x), srgb_encode8(a.y), srgb_encode8(a.z)};
      shadow(x, y) = static_cast<std::uint8_t>(255.0F * sun(x, y) + 0.5F);
    }
  }
  if (auto o = io::write_png(folder + "/" + kDaylightFiles[0], picture.view()); !o) return o;
  return io::write_png(folder + "/" + kDaylightFiles[1], shadow.view());
}

}  // namespace npsim::tool
