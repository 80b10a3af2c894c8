// SPDX-License-Identifier: Apache-2.0
#include "daylight.hpp"

#include <cstdint>

#include "mesh_textures.hpp"

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

void DaylightRecorder::daylight(const ImageView<const Vec3f>& albedo, const ImageView<const float>& sun,
                                const DaylightReport& report) {
  report_ = to_json(report);
  albedo_ = io::Image<Rgb8>(albedo.shape());
  shadow_ = io::Image<std::uint8_t>(sun.shape());
  for (int y = 0; y < albedo.height(); ++y) {
    for (int x = 0; x < albedo.width(); ++x) {
      albedo_(x, y) = encoded(albedo(x, y));
      shadow_(x, y) = static_cast<std::uint8_t>(255.0F * sun(x, y) + 0.5F);
    }
  }
}

}  // namespace npsim::tool
