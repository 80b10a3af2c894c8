// SPDX-License-Identifier: Apache-2.0
// Direct and gathered light where scenes are at their worst: no NaN, no infinity, nothing negative.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "lit_points.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/light/activation.hpp"
#include "npsim/render/direct.hpp"
#include "npsim/render/gather.hpp"
#include "npsim/render/visibility.hpp"
#include "npsim/trace/bvh.hpp"

namespace {

using namespace npsim;

// A floor of points at y = 1 and a wall of points at z = 12, all faces two-sided; black, white and grey, alpha 0 to 1.
struct Corner {
  std::vector<Vec3f> position, normal, albedo;
  std::vector<float> alpha, lift_m;
  std::vector<Face> faces;
  std::vector<unsigned char> memory;
  Bvh bvh;

  Corner() {
    const int n = 12;
    for (const bool wall : {false, true}) {
      const auto first = static_cast<std::uint32_t>(position.size());
      for (int j = 0; j < n; ++j) {
        for (int i = 0; i < n; ++i) {
          const float x = -3 + 0.5F * static_cast<float>(i);
          const float s = 0.5F * static_cast<float>(j);
          position.push_back(wall ? Vec3f{x, 1 - s, 12} : Vec3f{x, 1, 6.5F + s});
          normal.push_back(wall ? Vec3f{0, 0, -1} : Vec3f{0, -1, 0});
          const float shade = (i + j) % 3 == 0 ? 0.0F : ((i + j) % 3 == 1 ? 1.0F : 0.3F);
          albedo.push_back({shade, shade, shade});
          alpha.push_back(i % 2 == 0 ? 0.0F : 1.0F);
          lift_m.push_back(j % 2 == 0 ? 0.0F : 0.02F);
          if (i == 0 || j == 0) continue;
          const std::uint32_t at = first + static_cast<std::uint32_t>(j * n + i);
          const std::uint32_t row = n;
          faces.push_back({at, at - 1, at - row});
          faces.push_back({at - 1, at - row - 1, at - row});
        }
      }
    }
    memory.resize(bvh_workspace_bytes(faces.size()));
    Workspace workspace(memory.data(), memory.size());
    REQUIRE(build_bvh({{position.data(), position.size()}, {faces.data(), faces.size()}}, workspace, bvh).ok());
  }
  [[nodiscard]] SurfacePoints points() const {
    return {{position.data(), position.size()},
            {normal.data(), normal.size()},
            {albedo.data(), albedo.size()},
            {alpha.data(), alpha.size()},
            {lift_m.data(), lift_m.size()}};
  }
};

Emitter lamp_at(Vec3f centre, EmissionProfile profile, EmitterShape shape) {
  Emitter e;
  e.centre_m = centre;
  e.half_u_m = {0.2F, 0, 0};
  e.half_v_m = {0, 0, 0.2F};
  e.axis = {0, 1, 0};
  e.up = {0, 0, 1};
  e.area_m2 = 0.16F;
  e.profile = profile;
  e.shape = shape;
  return e;
}

// Direct light and one gather of it; the sums over all points.
struct Sums {
  double direct = 0;
  double gathered = 0;
};

Sums light(const Corner& corner, const std::vector<Emitter>& lamps) {
  const std::size_t n = corner.position.size();
  std::vector<Vec3f> illuminance(n), luminance_out(n), sky(n), gathered(n);
  std::vector<Vec2f> unseen(n);
  std::vector<std::uint32_t> all(n), hits(4 * n);
  for (std::size_t i = 0; i < n; ++i) all[i] = static_cast<std::uint32_t>(i);
  SerialExecutor serial;
  NullObserver observer;
  npsim_test::LampQuestion question;
  question.face_mark.assign(corner.faces.size(), 0);
  for (std::size_t e = 0; e < lamps.size(); ++e) {
    const Activation lit = make_activation(lamps[e], true, 1, 1000, {0.4F, 0.4F});
    question.number = static_cast<std::uint32_t>(e);
    question.peak_cd = peak_intensity_cd(lamps[e], 1000);
    REQUIRE(std::isfinite(question.peak_cd));
    const npsim_test::LitPoints at = npsim_test::lit_points(corner.bvh, corner.points(), lamps[e], question);
    for (std::size_t p = 0; p < n; ++p) {
      if (!(at.lx[p] > 0.0F)) continue;
      const float lx = at.lx[p] / question.peak_cd;
      illuminance[p] += lit.intensity_cd * lx;
      luminance_out[p] += lit.intensity_cd * direct_light(corner.points(), p, lx, at.to_light[p], 0.04F);
    }
  }
  GatherParams gather;
  gather.rays = 4;
  const auto corner_of = [&](const Hit& hit) { return corner.faces[hit.face].a; };
  REQUIRE(trace_gather_rays(gather, 1, corner.bvh, corner_of, corner.points(), {all.data(), n}, SkyParams{},
                            UnseenStreetParams{}, {hits.data(), hits.size()}, {sky.data(), n}, {unseen.data(), n},
                            serial, observer)
              .ok());
  std::vector<float> exitance(n * kLightLanes, 0.0F);
  for (std::size_t p = 0; p < n; ++p) {
    const Vec3f sent = corner.albedo[p] * illuminance[p];
    exitance[p * kLightLanes] = sent.x;
    exitance[p * kLightLanes + 1] = sent.y;
    exitance[p * kLightLanes + 2] = sent.z;
  }
  for (std::size_t p = 0; p < n; ++p) {
    float even[kLightLanes], odd[kLightLanes];
    gather_exitance({exitance.data(), exitance.size()}, hits.data() + 4 * p, 4, even, odd);
    gathered[p] = Vec3f{even[0] + odd[0], even[1] + odd[1], even[2] + odd[2]} / 4.0F;
  }
  Sums sums;
  bool good = true;
  for (std::size_t i = 0; i < n; ++i) {
    for (const Vec3f& v : {illuminance[i], luminance_out[i], sky[i], gathered[i]}) {
      good = good && is_finite(v) && v.x >= 0 && v.y >= 0 && v.z >= 0;
    }
    // A black surface sends no more than its interface mirrors.
    if (corner.albedo[i].x == 0.0F && corner.alpha[i] == 1.0F) {
      good = good && luminance(luminance_out[i]) <= 0.2F * luminance(illuminance[i]) + 1e-6F;
    }
    sums.direct += static_cast<double>(luminance(illuminance[i]));
    sums.gathered += static_cast<double>(luminance(gathered[i]));
  }
  CHECK(good);
  return sums;
}

}  // namespace

TEST_CASE(
    "stability: lamps that touch, pierce and lie within surfaces, at 1 mm and at 1 km, of every shape and profile") {
  const Corner corner;
  for (const EmissionProfile profile :
       {EmissionProfile::lambert, EmissionProfile::signal, EmissionProfile::street_luminaire, EmissionProfile::lantern,
        EmissionProfile::low_beam, EmissionProfile::measured}) {
    for (const EmitterShape shape :
         {EmitterShape::patch, EmitterShape::disc, EmitterShape::sphere, EmitterShape::tube}) {
      std::vector<Emitter> lamps;
      for (const Vec3f at :
           {Vec3f{0, 1, 9}, Vec3f{0, 0.999F, 9}, Vec3f{0, 1.1F, 9}, Vec3f{0.5F, 0.999F, 9.5F}, Vec3f{0, 0, 12},
            Vec3f{0, 0, 11.999F}, Vec3f{0, 3, 12}, Vec3f{0, -1000, 9}, Vec3f{700, -700, 9}, Vec3f{0, -2, 9}}) {
        lamps.push_back(lamp_at(at, profile, shape));
      }
      light(corner, lamps);
    }
  }
}

TEST_CASE("stability: no source leaves the dark, a thousand give a thousand times one") {
  const Corner corner;
  const Sums none = light(corner, {});
  CHECK(none.direct == 0);
  CHECK(none.gathered == 0);
  const Emitter lamp = lamp_at({0.2F, -3, 9}, EmissionProfile::street_luminaire, EmitterShape::patch);
  const Sums one = light(corner, {lamp});
  CHECK(one.direct > 0);
  CHECK(one.gathered > 0);
  const Sums many = light(corner, std::vector<Emitter>(1000, lamp));
  CHECK(many.direct == doctest::Approx(1000 * one.direct).epsilon(1e-2));
  CHECK(many.gathered == doctest::Approx(1000 * one.gathered).epsilon(1e-2));
}
