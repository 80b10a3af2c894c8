// SPDX-License-Identifier: Apache-2.0
// The generated street: mesh, exact planes, annotation, and independence of the order of work.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include "npsim/core/executor.hpp"
#include "street/layout.hpp"
#include "street/plan.hpp"
#include "street/scene.hpp"
#include "street/street.hpp"

namespace {

using npsim::Label;
using npsim::LightClass;
using npsim::LightMark;
using npsim::Vec3f;
namespace street = npsim::street;
namespace label = npsim::label;

// Runs the chunks from the last to the first.
struct BackwardsExecutor {
  template <class F>
  void for_chunks(std::size_t count, std::size_t chunk, F&& f) const {
    for (std::size_t i = npsim::chunk_count(count, chunk); i-- > 0;) {
      const std::size_t begin = i * chunk;
      f(begin, std::min(count, begin + chunk));
    }
  }
};

street::StreetParams small_params(std::uint64_t seed, int width = 192, int height = 108) {
  street::StreetParams p;
  p.seed = seed;
  p.shape = {width, height};
  p.samples = 1;
  p.sky_rays = 1;
  return p;
}

template <class Executor = npsim::SerialExecutor>
std::unique_ptr<street::Street> made(const street::StreetParams& p, Executor executor = {}) {
  auto s = std::make_unique<street::Street>();
  const npsim::Status status = street::make_street(p, executor, *s);
  REQUIRE_MESSAGE(status.ok(), status.message());
  return s;
}

// One street for the tests that only look at it.
const street::Street& common_street() {
  static const std::unique_ptr<street::Street> s = made(small_params(1));
  return *s;
}

template <class T>
bool same_bytes(const npsim::io::Image<T>& a, const npsim::io::Image<T>& b) {
  return a.shape() == b.shape() && std::memcmp(a.data(), b.data(), a.shape().pixels() * sizeof(T)) == 0;
}

bool same_planes(const street::Street& a, const street::Street& b) {
  return same_bytes(a.image, b.image) && same_bytes(a.depth, b.depth) &&
         same_bytes(a.background_depth, b.background_depth) && same_bytes(a.normals, b.normals) &&
         same_bytes(a.labels, b.labels) && same_bytes(a.instances, b.instances) && same_bytes(a.albedo, b.albedo) &&
         same_bytes(a.roughness, b.roughness) && same_bytes(a.light_index, b.light_index) &&
         same_bytes(a.reflectors, b.reflectors) && same_bytes(a.est_depth, b.est_depth) &&
         same_bytes(a.est_normals, b.est_normals);
}

}  // namespace

TEST_CASE("street: the order of work changes no byte") {
  const auto backwards = made(small_params(1), BackwardsExecutor{});
  CHECK(same_planes(common_street(), *backwards));
  CHECK(common_street().vertices.size() == backwards->vertices.size());
}

TEST_CASE("street: another seed is another street") {
  const auto other = made(small_params(2));
  const street::Street& one = common_street();
  CHECK(one.faces.size() != other->faces.size());
  std::size_t differing = 0;
  for (std::size_t i = 0; i < one.params.shape.pixels(); ++i)
    differing += one.labels.data()[i] != other->labels.data()[i] ? 1U : 0U;
  CHECK(differing > one.params.shape.pixels() / 10);
}

TEST_CASE("street: every face has valid indices, an area, a label and a material") {
  const street::Street& s = common_street();
  CHECK(s.faces.size() > 100000);
  CHECK(s.faces.size() < 520000);
  REQUIRE(s.face_label.size() == s.faces.size());
  REQUIRE(s.face_material.size() == s.faces.size());
  REQUIRE(s.face_instance.size() == s.faces.size());
  REQUIRE(s.face_emitter.size() == s.faces.size());
  std::size_t bad_index = 0, flat = 0, infinite = 0, bad_tag = 0;
  for (std::size_t i = 0; i < s.faces.size(); ++i) {
    const npsim::Face& f = s.faces[i];
    if (f.a >= s.vertices.size() || f.b >= s.vertices.size() || f.c >= s.vertices.size()) {
      ++bad_index;
      continue;
    }
    const auto a = npsim::vec_cast<double>(s.vertices[f.a]);
    const auto n = cross(npsim::vec_cast<double>(s.vertices[f.b]) - a, npsim::vec_cast<double>(s.vertices[f.c]) - a);
    flat += length(n) > 0 ? 0U : 1U;
    infinite +=
        npsim::is_finite(s.vertices[f.a]) && npsim::is_finite(s.vertices[f.b]) && npsim::is_finite(s.vertices[f.c])
            ? 0U
            : 1U;
    const bool tagged = s.face_label[i] > 0 && s.face_label[i] < npsim::kLabelCount &&
                        s.face_material[i] < s.materials.size() && s.face_emitter[i] <= s.emitters.size() &&
                        (s.face_instance[i] == s.face_label[i] || s.face_instance[i] / 1000 == s.face_label[i]);
    bad_tag += tagged ? 0U : 1U;
  }
  CHECK(bad_index == 0);
  CHECK(flat == 0);
  CHECK(infinite == 0);
  CHECK(bad_tag == 0);
}

TEST_CASE("street: depth of the road is that of the plane, in closed form") {
  const street::Street& s = common_street();
  const double cp = std::cos(static_cast<double>(s.camera_pitch_rad));
  const double sp = std::sin(static_cast<double>(s.camera_pitch_rad));
  int count = 0;
  double worst = 0, worst_normal = 0;
  for (int y = 0; y < s.depth.height(); ++y) {
    for (int x = 0; x < s.depth.width(); ++x) {
      if (s.labels(x, y) != label::road) continue;
      const double v =
          (static_cast<double>(y) + 0.5 - static_cast<double>(s.intrinsics.cy)) / static_cast<double>(s.intrinsics.fy);
      const double z = static_cast<double>(s.camera_height_m) / (v * cp + sp);
      // One pixel row of rounding matters near the horizon: the error is relative to z^2 / height.
      const double error = std::fabs(static_cast<double>(s.depth(x, y)) - z) / (z * std::fmax(1.0, z / 10));
      worst = std::fmax(worst, error);
      const Vec3f n = s.normals(x, y);
      worst_normal = std::fmax(worst_normal, std::fabs(static_cast<double>(n.y) + cp));
      ++count;
    }
  }
  CHECK(count > 2000);
  CHECK(worst < 4e-6);
  CHECK(worst_normal < 1e-5);
}

TEST_CASE("street: the depth behind the foreground is that of the nearest other face, face by face") {
  const street::Street& s = common_street();
  int wrong = 0, behind = 0, checked = 0;
  for (int y = 0; y < s.depth.height(); ++y) {
    for (int x = 0; x < s.depth.width(); ++x) {
      const float z = s.background_depth(x, y);
      if (!npsim::kForegroundLabels.contains(s.labels(x, y))) {
        wrong += z != s.depth(x, y) ? 1 : 0;
        continue;
      }
      wrong += z != 0.0F && !(z > s.depth(x, y)) ? 1 : 0;
      if (++behind % 97 != 0) continue;
      ++checked;
      const npsim::Vec3d d = npsim::vec_cast<double>(unproject_pixel(s.intrinsics, x, y, 1.0F));
      double nearest = 0;
      for (std::size_t i = 0; i < s.faces.size(); ++i) {
        if (npsim::kForegroundLabels.contains(s.face_label[i])) continue;
        const auto a = npsim::vec_cast<double>(s.vertices[s.faces[i].a]);
        const auto b = npsim::vec_cast<double>(s.vertices[s.faces[i].b]);
        const auto c = npsim::vec_cast<double>(s.vertices[s.faces[i].c]);
        // The volumes that the ray spans with the edges have one sign inside.
        const double u = dot(d, cross(b, c));
        const double v = dot(d, cross(c, a));
        const double w = dot(d, cross(a, b));
        if (!((u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0)) || u + v + w == 0.0) continue;
        const double t = (u * a.z + v * b.z + w * c.z) / (u + v + w);
        if (t > 0 && (nearest == 0.0 || t < nearest)) nearest = t;
      }
      CAPTURE(x);
      CAPTURE(y);
      CHECK(std::fabs(static_cast<double>(z) - nearest) <= 1e-5 * nearest);
    }
  }
  CHECK(wrong == 0);
  CHECK(checked > 10);
}

TEST_CASE("street: normals are unit and face the camera, the sky has no depth") {
  const street::Street& s = common_street();
  int wrong = 0, sky = 0;
  for (const npsim::io::Image<Vec3f>* plane : {&s.normals, &s.est_normals}) {
    for (int y = 0; y < s.depth.height(); ++y) {
      for (int x = 0; x < s.depth.width(); ++x) {
        const Vec3f n = (*plane)(x, y);
        const Vec3f ray = unproject_pixel(s.intrinsics, x, y, 1.0F);
        if (!(std::fabs(length(n) - 1.0F) < 1e-4F) || !(dot(n, ray) <= 0)) ++wrong;
        if (s.labels(x, y) == label::sky) {
          ++sky;
          if (s.depth(x, y) != 0.0F) ++wrong;
        } else if (!npsim::is_valid_depth(s.depth(x, y))) {
          ++wrong;
        }
      }
    }
  }
  CHECK(wrong == 0);
  CHECK(sky > 100);
}

TEST_CASE("street: each seed shows road, pavement, houses, sky, plants, poles, people and cars") {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    CAPTURE(seed);
    const auto s = made(small_params(seed));
    std::array<int, 256> seen{};
    for (std::size_t i = 0; i < s->params.shape.pixels(); ++i) ++seen[s->labels.data()[i]];
    for (const Label l : {label::road, label::sidewalk, label::building, label::sky, label::vegetation, label::pole,
                          label::car, label::person, label::traffic_light, label::traffic_sign}) {
      CAPTURE(static_cast<int>(l));
      CHECK(seen[l] > 0);
    }
    CHECK(seen[label::unlabeled] == 0);
  }
}

TEST_CASE("street: albedo and roughness stay physical") {
  const street::Street& s = common_street();
  int wrong = 0;
  for (int y = 0; y < s.depth.height(); ++y) {
    for (int x = 0; x < s.depth.width(); ++x) {
      const Vec3f a = s.albedo(x, y);
      if (s.labels(x, y) != label::sky && !(a.x > 0 && a.y > 0 && a.z > 0)) ++wrong;
      if (!(a.x <= 0.9F && a.y <= 0.9F && a.z <= 0.9F)) ++wrong;
      if (!(s.roughness(x, y) > 0 && s.roughness(x, y) <= 1)) ++wrong;
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("street: number plates are marked, on vehicles alone, pale with dark print") {
  const auto s = made(small_params(1, 960, 540));
  int plates = 0, elsewhere = 0, pale = 0;
  for (int y = 0; y < s->reflectors.height(); ++y) {
    for (int x = 0; x < s->reflectors.width(); ++x) {
      if (s->reflectors(x, y) == npsim::ReflectorClass::none) continue;
      ++plates;
      elsewhere += npsim::kVehicleLabels.contains(s->labels(x, y)) ? 0 : 1;
      pale += npsim::luminance(s->albedo(x, y)) > 0.25F ? 1 : 0;
    }
  }
  CHECK(plates > 100);
  CHECK(elsewhere == 0);
  CHECK(2 * pale > plates);
}

TEST_CASE("street: annotation and index plane agree") {
  const auto s = made(small_params(1, 480, 270));
  std::vector<int> pixels(s->marks.size() + 1, 0);
  int out_of_range = 0, on_sky = 0;
  for (int y = 0; y < s->depth.height(); ++y) {
    for (int x = 0; x < s->depth.width(); ++x) {
      const std::uint16_t index = s->light_index(x, y);
      if (index > s->marks.size()) {
        ++out_of_range;
        continue;
      }
      ++pixels[index];
      if (index != 0 && s->labels(x, y) == label::sky) ++on_sky;
    }
  }
  REQUIRE(out_of_range == 0);
  CHECK(on_sky == 0);
  std::vector<int> members(s->marks.size() + 1, 0);
  std::array<int, npsim::kLightClassCount> classes{};
  for (std::size_t i = 0; i < s->marks.size(); ++i) {
    const LightMark& m = s->marks[i];
    CHECK(m.id == i + 1);
    CHECK(m.cls != LightClass::none);
    ++classes[static_cast<std::size_t>(m.cls)];
    if (is_group(m.cls)) {
      CHECK(m.group == 0);
      continue;
    }
    CHECK(pixels[i + 1] >= s->params.light_min_px);
    REQUIRE(m.group <= s->marks.size());
    if (m.group != 0) {
      CHECK(is_group(s->marks[m.group - 1U].cls));
      ++members[m.group];
    }
    if (m.cls == LightClass::inferred_object) CHECK(m.state != npsim::SignalState::unknown);
  }
  for (std::size_t i = 0; i < s->marks.size(); ++i) {
    if (is_group(s->marks[i].cls)) CHECK(members[i + 1] > 0);
  }
  for (const LightClass c : {LightClass::window_building, LightClass::windows_group, LightClass::car_group,
                             LightClass::window_parked, LightClass::moving_rear, LightClass::moving_front,
                             LightClass::advertisement, LightClass::inferred_object, LightClass::traffic_light_group}) {
    CAPTURE(npsim::info(c).name);
    CHECK(classes[static_cast<std::size_t>(c)] > 0);
  }
  std::size_t linked = 0;
  for (const street::Emitter& e : s->emitters) {
    CHECK(std::fabs(length(e.normal) - 1.0F) < 1e-3F);
    CHECK(npsim::is_finite(e.centre));
    if (e.mark == 0) continue;
    ++linked;
    REQUIRE(e.mark <= s->marks.size());
    CHECK(s->marks[e.mark - 1].cls == e.cls);
    CHECK(e.half_extents.x + e.half_extents.y > 0);
  }
  std::size_t sources = 0;
  for (const LightMark& m : s->marks) sources += is_group(m.cls) ? 0U : 1U;
  CHECK(linked == sources);
}

TEST_CASE("street: all source classes exist among the emitters of some seeds") {
  std::array<int, npsim::kLightClassCount> classes{};
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const street::Scene scene = street::build_scene(street::make_layout(seed));
    for (const street::SceneLight& l : scene.lights) ++classes[static_cast<std::size_t>(l.cls)];
  }
  for (int c = 1; c <= static_cast<int>(LightClass::inferred_object); ++c) {
    CAPTURE(npsim::info(static_cast<LightClass>(c)).name);
    CHECK(classes[static_cast<std::size_t>(c)] > 0);
  }
}
