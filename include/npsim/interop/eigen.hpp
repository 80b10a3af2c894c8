// SPDX-License-Identifier: Apache-2.0
// Eigen's matrices as the library's images, spans and points, and back, without a copy; poses from isometries.
//
//   as_image_view(m)    row-major matrix, array, map or block -> ImageView, row y of m is row y of the image
//   as_span(v)          vector -> Span
//   as_points(p)        3 x n, a column for each point -> Span<Vec3>
//   as_eigen(view)      ImageView, Span, Span<Vec3> -> the Eigen::Map of the same memory
//   to_eigen, to_vec3   three numbers by value
//   to_view_pose(t)     isometry that takes points of the view's camera to the mesh's frame -> ViewPose; to_isometry
//   back
//
// A view lives as long as the matrix does, and no longer than its size: resizing the matrix leaves the view behind.
// What is const stays const. Maps are Unaligned: the library's rows begin anywhere.
// No kernel uses Eigen. Matrices as members or arguments of one's own functions that are compiled for several
// instruction sets are a trap, for their alignment follows the compiler's flags; what stands here takes references.
#ifndef NPSIM_INTEROP_EIGEN_HPP
#define NPSIM_INTEROP_EIGEN_HPP

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cstddef>
#include <type_traits>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/render/preview.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace interop_detail {

template <class M>
using Dense = std::remove_cv_t<std::remove_reference_t<M>>;

// A matrix that owns its numbers must outlive the view; a map or a block of one may be a temporary.
template <class M>
constexpr void require_direct_access() noexcept {
  using D = Dense<M>;
  static_assert(std::is_lvalue_reference_v<M> || !std::is_base_of_v<Eigen::PlainObjectBase<D>, D>,
                "the view would outlive this temporary matrix");
  static_assert((static_cast<int>(D::Flags) & static_cast<int>(Eigen::DirectAccessBit)) != 0,
                "an expression has no memory to look at: evaluate it into a matrix");
  static_assert(static_cast<int>(D::InnerStrideAtCompileTime) == 1, "neighbours must lie side by side in memory");
}

template <class T>
constexpr void require_three_numbers() noexcept {
  static_assert(std::is_standard_layout_v<Vec3<T>> && std::is_trivially_copyable_v<Vec3<T>> &&
                    sizeof(Vec3<T>) == 3 * sizeof(T) && alignof(Vec3<T>) == alignof(T) && offsetof(Vec3<T>, x) == 0 &&
                    offsetof(Vec3<T>, y) == sizeof(T) && offsetof(Vec3<T>, z) == 2 * sizeof(T),
                "a Vec3 is a column of three numbers");
}

// Like T in being const.
template <class T, class Plain>
using ConstLike = std::conditional_t<std::is_const_v<T>, const Plain, Plain>;

}  // namespace interop_detail

template <class M>
[[nodiscard]] auto as_image_view(M&& m) noexcept {
  interop_detail::require_direct_access<M>();
  using D = interop_detail::Dense<M>;
  static_assert(static_cast<bool>(D::IsRowMajor), "pixels of a row lie side by side: a row-major matrix is wanted");
  using T = std::remove_pointer_t<decltype(m.data())>;
  return ImageView<T>(m.data(), {static_cast<int>(m.cols()), static_cast<int>(m.rows())}, m.outerStride());
}

template <class M>
[[nodiscard]] auto as_span(M&& m) noexcept {
  interop_detail::require_direct_access<M>();
  static_assert(static_cast<bool>(interop_detail::Dense<M>::IsVectorAtCompileTime), "a vector is wanted");
  using T = std::remove_pointer_t<decltype(m.data())>;
  return Span<T>(m.data(), static_cast<std::size_t>(m.size()));
}

template <class M>
[[nodiscard]] auto as_points(M&& m) noexcept {
  interop_detail::require_direct_access<M>();
  using D = interop_detail::Dense<M>;
  using T = std::remove_pointer_t<decltype(m.data())>;
  using Number = std::remove_const_t<T>;
  interop_detail::require_three_numbers<Number>();
  static_assert(!static_cast<bool>(D::IsRowMajor) && static_cast<int>(D::RowsAtCompileTime) == 3 &&
                    static_cast<int>(D::OuterStrideAtCompileTime) == 3,
                "a column-major matrix of three rows without gaps is wanted");
  using Point = interop_detail::ConstLike<T, Vec3<Number>>;
  return Span<Point>(reinterpret_cast<Point*>(m.data()), static_cast<std::size_t>(m.cols()));
}

template <class T>
[[nodiscard]] auto as_eigen(const ImageView<T>& view) noexcept {
  static_assert(std::is_arithmetic_v<T>, "pixels that are numbers are wanted");
  using Plain = Eigen::Matrix<std::remove_const_t<T>, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<interop_detail::ConstLike<T, Plain>, Eigen::Unaligned, Eigen::OuterStride<>>(
      view.data(), view.height(), view.width(), Eigen::OuterStride<>(view.stride()));
}

template <class T, std::enable_if_t<std::is_arithmetic_v<T>, int> = 0>
[[nodiscard]] auto as_eigen(const Span<T>& span) noexcept {
  using Plain = Eigen::Matrix<std::remove_const_t<T>, Eigen::Dynamic, 1>;
  return Eigen::Map<interop_detail::ConstLike<T, Plain>, Eigen::Unaligned>(span.data(),
                                                                           static_cast<Eigen::Index>(span.size()));
}

template <class T>
[[nodiscard]] auto as_eigen(const Span<Vec3<T>>& points) noexcept {
  interop_detail::require_three_numbers<T>();
  return Eigen::Map<Eigen::Matrix<T, 3, Eigen::Dynamic>, Eigen::Unaligned>(reinterpret_cast<T*>(points.data()), 3,
                                                                           static_cast<Eigen::Index>(points.size()));
}

template <class T>
[[nodiscard]] auto as_eigen(const Span<const Vec3<T>>& points) noexcept {
  interop_detail::require_three_numbers<T>();
  return Eigen::Map<const Eigen::Matrix<T, 3, Eigen::Dynamic>, Eigen::Unaligned>(
      reinterpret_cast<const T*>(points.data()), 3, static_cast<Eigen::Index>(points.size()));
}

template <class T>
[[nodiscard]] Eigen::Matrix<T, 3, 1> to_eigen(const Vec3<T>& v) noexcept {
  return {v.x, v.y, v.z};
}

template <class D>
[[nodiscard]] Vec3<typename D::Scalar> to_vec3(const Eigen::MatrixBase<D>& v) noexcept {
  static_assert(static_cast<int>(D::SizeAtCompileTime) == 3, "three numbers are wanted");
  const Eigen::Matrix<typename D::Scalar, 3, 1> three(v);
  return {three.x(), three.y(), three.z()};
}

// A pose in another convention (x forward, z up, say) is multiplied by its axes first. validate(pose) tells whether the
// linear part is a rotation.
template <class T, int Options>
[[nodiscard]] ViewPose to_view_pose(const Eigen::Transform<T, 3, Eigen::Isometry, Options>& mesh_from_view) noexcept {
  const auto column = [&](int i) {
    return vec_cast<float>(to_vec3(mesh_from_view.matrix().template block<3, 1>(0, i)));
  };
  return {column(0), column(1), column(2), column(3)};
}

template <class T = float>
[[nodiscard]] Eigen::Transform<T, 3, Eigen::Isometry> to_isometry(const ViewPose& pose) noexcept {
  Eigen::Transform<T, 3, Eigen::Isometry> mesh_from_view = Eigen::Transform<T, 3, Eigen::Isometry>::Identity();
  mesh_from_view.linear() << to_eigen(vec_cast<T>(pose.right)), to_eigen(vec_cast<T>(pose.down)),
      to_eigen(vec_cast<T>(pose.forward));
  mesh_from_view.translation() = to_eigen(vec_cast<T>(pose.eye_m));
  return mesh_from_view;
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_INTEROP_EIGEN_HPP
