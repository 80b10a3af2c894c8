// SPDX-License-Identifier: Apache-2.0
// Faces of kerbs against the exact picture of one: a pavement 12 cm above the road, with the face left out.
// Either the face is labelled pavement, as Cityscapes has it, or the two levels have one label.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "fixture.hpp"
#include "npsim/depth/detail/normals/kerb_faces.hpp"
#include "npsim/io/image.hpp"

namespace {

using namespace npsim;

constexpr float kHeight_m = 1.4F;
constexpr float kKerb_m = 0.12F;

enum class FaceIs { pavement, road };

// Seen from a camera that looks along z, level. The pavement is where inside(x, z) is.
template <class Inside>
struct Kerb {
  Shape shape{480, 270};
  Intrinsics camera = intrinsics_from_fov(shape, 1.17F);
  GroundPlane ground{{0, -1, 0}, kHeight_m, 1.0F};
  io::Image<float> exact{shape}, flat{shape};  // with its face, and with ground of one level in its place
  io::Image<Label> labels{shape, label::sky};
  io::Image<Vec3f> normals{shape, Vec3f{0, -1, 0}};
  int faces = 0;

  explicit Kerb(const Inside& inside, FaceIs face_is = FaceIs::pavement) {
    for (int y = shape.height / 2 + 8; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const Vec3f ray = unproject_pixel(camera, x, y, 1.0F);
        const float top = (kHeight_m - kKerb_m) / ray.y;
        const float road = kHeight_m / ray.y;
        const bool pavement = inside(ray.x * top, top);
        const bool face = !pavement && inside(ray.x * road, road);
        const bool upper = pavement || (face && face_is == FaceIs::pavement);
        labels(x, y) = upper && face_is == FaceIs::pavement ? label::sidewalk : label::road;
        flat(x, y) = upper ? top : road;
        exact(x, y) = flat(x, y);
        if (!face) continue;
        ++faces;
        float near = top;  // where the ray enters the pavement's solid
        float far = road;
        for (int k = 0; k < 30; ++k) {
          const float middle = 0.5F * (near + far);
          (inside(ray.x * middle, middle) ? far : near) = middle;
        }
        exact(x, y) = near;
      }
    }
  }
  Status mend(KerbFaceParams params = {}) {
    npsim_test::Scratch scratch(kerb_faces_workspace_bytes(shape));
    return kerb_faces(params, camera, ground, labels.view(), flat.view(), normals.view(), scratch.workspace());
  }
};

template <class Inside>
void check_faces(const Inside& inside, FaceIs face_is, int least) {
  Kerb<Inside> kerb(inside, face_is);
  REQUIRE(kerb.faces > least);
  const io::Image<float> before = kerb.flat;
  REQUIRE(kerb.mend().ok());
  int mended = 0;
  double worst = 0;
  for (int y = 0; y < kerb.shape.height; ++y) {
    for (int x = 0; x < kerb.shape.width; ++x) {
      if (kerb.flat(x, y) == before(x, y)) continue;
      CHECK((kerb.flat(x, y) > before(x, y)) == (face_is == FaceIs::pavement));
      ++mended;
      // One row of ground is this share of its depth.
      const double row = 1.0 / (y + 0.5 - kerb.shape.height / 2);
      worst = std::max(worst, std::fabs(static_cast<double>(kerb.flat(x, y) / kerb.exact(x, y)) - 1) / row);
      CHECK(kerb.normals(x, y).y == doctest::Approx(0.0));
      CHECK(dot(kerb.normals(x, y), unproject_pixel(kerb.camera, x, y, 1.0F)) < 0.0F);
    }
  }
  CHECK(mended > kerb.faces * 8 / 10);
  CHECK(worst < 1.5);
}

}  // namespace

TEST_CASE("kerb faces: a kerb beside the road, one across it, and one aslant, with the face on either level") {
  for (const FaceIs face_is : {FaceIs::pavement, FaceIs::road}) {
    CAPTURE(face_is == FaceIs::pavement);
    check_faces([](float x, float) { return x < -1.2F; }, face_is, 200);
    check_faces([](float x, float z) { return x > 2.0F && z < 20.0F; }, face_is, 150);
    check_faces([](float, float z) { return z > 6.0F; }, face_is, 200);
    check_faces([](float x, float z) { return z + 2.0F * x > 9.0F; }, face_is, 200);
  }
}

TEST_CASE(
    "kerb faces: an outline that falls by a row in eight columns, each row of which is a line across the kerb's") {
  check_faces([](float x, float z) { return x < 0.32F * z - 11.4F && z < 20.0F; }, FaceIs::pavement, 100);
}

TEST_CASE("kerb faces: an edge that looks away from the camera stays as it is, bit by bit, and so does flat ground") {
  auto away = [](float, float z) { return z < 7.0F; };
  Kerb<decltype(away)> kerb(away);
  io::Image<float> before = kerb.flat;
  REQUIRE(kerb.mend().ok());
  CHECK(std::memcmp(before.data(), kerb.flat.data(), before.shape().pixels() * sizeof(float)) == 0);
  auto nowhere = [](float, float) { return false; };
  Kerb<decltype(nowhere)> plain(nowhere);
  before = plain.flat;
  REQUIRE(plain.mend().ok());
  CHECK(std::memcmp(before.data(), plain.flat.data(), before.shape().pixels() * sizeof(float)) == 0);
}

TEST_CASE("kerb faces: of an estimate a step within one label or from a road down to a pavement has none, a kerb has") {
  auto beside = [](float x, float) { return x < -1.2F; };
  for (const bool swapped : {false, true}) {
    CAPTURE(swapped);
    Kerb<decltype(beside)> kerb(beside, swapped ? FaceIs::pavement : FaceIs::road);
    for (int y = 0; y < kerb.shape.height; ++y) {
      for (int x = 0; swapped && x < kerb.shape.width; ++x) {
        Label& l = kerb.labels(x, y);
        if (l != label::sky) l = l == label::road ? label::sidewalk : label::road;
      }
    }
    const io::Image<float> before = kerb.flat;
    const auto unchanged = [&] {
      return std::memcmp(before.data(), kerb.flat.data(), before.shape().pixels() * sizeof(float)) == 0;
    };
    KerbFaceParams estimate;
    estimate.only_at_borders = true;
    REQUIRE(kerb.mend(estimate).ok());
    CHECK(unchanged());
    REQUIRE(kerb.mend().ok());
    CHECK(!unchanged());
  }
  for (const Label upper : {label::sidewalk, label::ground}) {
    CAPTURE(static_cast<int>(upper));
    Kerb<decltype(beside)> at_border(beside);
    for (int y = 0; y < at_border.shape.height; ++y) {
      for (int x = 0; x < at_border.shape.width; ++x) {
        Label& l = at_border.labels(x, y);
        if (l == label::sidewalk) l = upper;
      }
    }
    Kerb<decltype(beside)> as_measured = at_border;
    const io::Image<float> before = at_border.flat;
    const auto same = [&](const io::Image<float>& a, const io::Image<float>& b) {
      return std::memcmp(a.data(), b.data(), a.shape().pixels() * sizeof(float)) == 0;
    };
    KerbFaceParams estimate;
    estimate.only_at_borders = true;
    REQUIRE(at_border.mend(estimate).ok());
    REQUIRE(as_measured.mend().ok());
    CHECK(!same(at_border.flat, before));
    CHECK(same(at_border.flat, as_measured.flat));
  }
}

TEST_CASE("kerb faces: without a ground plane nothing is done; parameters out of range are refused") {
  auto beside = [](float x, float) { return x < -1.2F; };
  Kerb<decltype(beside)> kerb(beside);
  kerb.ground.inlier_share = 0.0F;
  const io::Image<float> before = kerb.flat;
  REQUIRE(kerb.mend().ok());
  CHECK(std::memcmp(before.data(), kerb.flat.data(), before.shape().pixels() * sizeof(float)) == 0);
  KerbFaceParams params;
  params.min_step_m = 0.0F;
  CHECK(kerb.mend(params).code() == StatusCode::invalid_argument);
  params = {};
  params.most_px = 5000;
  CHECK(kerb.mend(params).code() == StatusCode::invalid_argument);
}
