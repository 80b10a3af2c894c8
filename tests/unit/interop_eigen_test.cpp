// SPDX-License-Identifier: Apache-2.0
// g++ 12 warns of its own AVX-512 headers where Eigen uses them (GCC bug 105593).
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wuninitialized"
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#pragma GCC diagnostic ignored "-Warray-bounds"
#endif

#include "npsim/interop/eigen.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <type_traits>
#include <vector>

#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/render/preview.hpp"

namespace {

using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using RowMajorArray = Eigen::Array<std::uint8_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

RowMajor counted(int rows, int columns) {
  RowMajor m(rows, columns);
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) m(y, x) = static_cast<float>(100 * y + x);
  }
  return m;
}

}  // namespace

TEST_CASE("a row-major matrix is an image of the same memory") {
  RowMajor m = counted(5, 7);
  const auto image = npsim::as_image_view(m);
  static_assert(std::is_same_v<decltype(image), const npsim::ImageView<float>>);
  CHECK(image.shape() == npsim::Shape{7, 5});
  CHECK(image.data() == m.data());
  CHECK(image(6, 4) == 406.0F);
  image(2, 3) = -1.0F;
  CHECK(m(3, 2) == -1.0F);

  const RowMajor& constant = m;
  static_assert(std::is_same_v<decltype(npsim::as_image_view(constant)), npsim::ImageView<const float>>);
  RowMajorArray labels = RowMajorArray::Constant(3, 4, 7);
  static_assert(std::is_same_v<decltype(npsim::as_image_view(labels)), npsim::ImageView<std::uint8_t>>);
  CHECK(npsim::as_image_view(labels)(3, 2) == 7);
}

TEST_CASE("blocks and maps keep their outer stride") {
  RowMajor m = counted(5, 7);
  const auto part = npsim::as_image_view(m.block(1, 2, 3, 4));
  CHECK(part.shape() == npsim::Shape{4, 3});
  CHECK(part.stride() == 7);
  CHECK(part(3, 2) == 305.0F);

  // A camera's buffer with padded rows.
  std::vector<float> padded(4 * 10);
  for (std::size_t i = 0; i < padded.size(); ++i) padded[i] = static_cast<float>(i);
  Eigen::Map<const RowMajor, Eigen::Unaligned, Eigen::OuterStride<>> map(padded.data() + 1, 4, 8,
                                                                         Eigen::OuterStride<>(10));
  const auto view = npsim::as_image_view(map);
  static_assert(std::is_same_v<decltype(view), const npsim::ImageView<const float>>);
  CHECK(view.stride() == 10);
  CHECK(view(7, 3) == 38.0F);

  const Eigen::Ref<const RowMajor> reference(m);
  CHECK(npsim::as_image_view(reference).data() == m.data());
}

TEST_CASE("an image is a map of the same memory, aligned or not") {
  std::vector<float> pixels(3 * 9, 1.0F);
  const npsim::ImageView<float> image(pixels.data() + 1, {5, 3}, 9);
  auto map = npsim::as_eigen(image);
  CHECK(map.rows() == 3);
  CHECK(map.cols() == 5);
  map.row(2).setConstant(4.0F);
  CHECK(image(4, 2) == 4.0F);
  CHECK(pixels[2 * 9 + 6] == 1.0F);
  CHECK(map(1, 4) == 1.0F);
  CHECK(npsim::as_image_view(map).stride() == 9);

  const auto constant = npsim::as_eigen(npsim::ImageView<const float>(image));
  CHECK(constant(2, 0) == 4.0F);
  CHECK((static_cast<int>(decltype(constant)::Flags) & static_cast<int>(Eigen::LvalueBit)) == 0);
}

TEST_CASE("vectors and spans") {
  Eigen::VectorXf column = Eigen::VectorXf::LinSpaced(4, 0.0F, 3.0F);
  const auto span = npsim::as_span(column);
  CHECK(span.size() == 4);
  span[3] = 9.0F;
  CHECK(column(3) == 9.0F);
  CHECK(npsim::as_span(column.head(2)).size() == 2);
  auto back = npsim::as_eigen(span);
  CHECK(back.data() == column.data());
  CHECK(back(3) == 9.0F);
  const std::uint32_t numbers[] = {1, 2, 3};
  CHECK(npsim::as_eigen(npsim::Span<const std::uint32_t>(numbers))(2) == 3);
}

TEST_CASE("points are the columns of a matrix of three rows") {
  Eigen::Matrix3Xf p(3, 4);
  for (int i = 0; i < 12; ++i) p(i) = static_cast<float>(i);
  const npsim::Span<npsim::Vec3f> points = npsim::as_points(p);
  CHECK(points.size() == 4);
  CHECK(points[2] == npsim::Vec3f{6, 7, 8});
  CHECK(npsim::as_points(p.middleCols(1, 2))[1] == npsim::Vec3f{6, 7, 8});
  points[0].y = -5.0F;
  CHECK(p(1, 0) == -5.0F);

  auto map = npsim::as_eigen(points);
  CHECK(map.cols() == 4);
  map.colwise() += Eigen::Vector3f(1, 2, 3);
  CHECK(points[3] == npsim::Vec3f{10, 12, 14});
  const Eigen::Matrix3Xd constant = Eigen::Matrix3Xd::Ones(3, 2);
  const npsim::Span<const npsim::Vec3d> doubles = npsim::as_points(constant);
  CHECK(npsim::as_eigen(doubles).col(1) == constant.col(1));

  CHECK(npsim::to_vec3(npsim::to_eigen(npsim::Vec3f{1, 2, 3})) == npsim::Vec3f{1, 2, 3});
  CHECK(npsim::to_vec3(p.col(3)) == points[3]);
}

TEST_CASE("an isometry is the pose of a view") {
  // A quarter turn to the right about the vertical, which points down, and a step aside.
  Eigen::Isometry3d t = Eigen::Isometry3d::Identity();
  t.rotate(Eigen::AngleAxisd(0.5 * 3.14159265358979323846, Eigen::Vector3d::UnitY()));
  t.pretranslate(Eigen::Vector3d(1, -2, 3));
  const npsim::ViewPose pose = npsim::to_view_pose(t);
  CHECK(npsim::validate(pose).ok());
  CHECK(npsim::length(pose.forward - npsim::Vec3f{1, 0, 0}) < 1e-6F);
  CHECK(npsim::length(pose.right - npsim::Vec3f{0, 0, -1}) < 1e-6F);
  CHECK(npsim::length(pose.down - npsim::Vec3f{0, 1, 0}) < 1e-6F);
  CHECK(pose.eye_m == npsim::Vec3f{1, -2, 3});
  CHECK(npsim::to_isometry<double>(pose).isApprox(t, 1e-6));

  // What the pose says of a point of the view is what the isometry makes of it.
  const Eigen::Vector3f in_view(0.3F, -0.2F, 5.0F);
  const npsim::Vec3f in_mesh = pose.eye_m + pose.right * 0.3F - pose.down * 0.2F + pose.forward * 5.0F;
  CHECK((npsim::to_isometry(pose) * in_view).isApprox(npsim::to_eigen(in_mesh), 1e-5F));

  const npsim::ViewPose own = npsim::to_view_pose(Eigen::Isometry3f::Identity());
  CHECK(own.right == npsim::ViewPose{}.right);
  CHECK(own.forward == npsim::ViewPose{}.forward);
}
