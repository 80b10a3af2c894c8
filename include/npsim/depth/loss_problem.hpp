// SPDX-License-Identifier: Apache-2.0
// What does not change while the losses of loss_params.hpp are minimised: unit normals, masks, label weights, counts.
//
// It is kept in planes whose rows are padded to whole blocks of 16 pixels, with one more block and one more row, and in
// which padding and missing pixels hold depth 1 and weight 0: the loops of loss_kernel.hpp have no tails and no tests.
//
// Cost: one pass over the image. Memory: 7 values per pixel, and a row for every 16.
#ifndef NPSIM_DEPTH_LOSS_PROBLEM_HPP
#define NPSIM_DEPTH_LOSS_PROBLEM_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/loss_params.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {

inline constexpr int kLossBlock = 16;
inline constexpr std::size_t kLossChunkRows = 16;

[[nodiscard]] constexpr std::ptrdiff_t loss_plane_stride(int width) noexcept {
  return (width + kLossBlock - 1) / kLossBlock * kLossBlock + kLossBlock;  // the block after the last is read at x + 1
}
[[nodiscard]] constexpr std::size_t loss_plane_elements(Shape shape) noexcept {
  return static_cast<std::size_t>(loss_plane_stride(shape.width)) * (static_cast<std::size_t>(shape.height) + 1);
}
// Row buffers of one chunk: the part of the gradient for the lower neighbours.
inline constexpr std::size_t kLossRowBuffers = 1;

template <class T>
[[nodiscard]] constexpr std::size_t loss_problem_bytes(Shape shape) noexcept {
  const std::size_t chunks = chunk_count(static_cast<std::size_t>(shape.height), kLossChunkRows);
  return 7 * allocation_bytes<T>(loss_plane_elements(shape)) +
         allocation_bytes<T>(chunks * kLossRowBuffers * static_cast<std::size_t>(loss_plane_stride(shape.width))) +
         3 * allocation_bytes<double>(static_cast<std::size_t>(shape.height));
}

inline namespace NPSIM_ISA_NAMESPACE {
namespace depth_detail {

template <class T>
[[nodiscard]] bool has_depth(T z_m) noexcept {
  return z_m >= T(1e-3) && z_m <= T(1e5);  // false for NaN
}

template <class T>
struct LossProblem {
  LossParams params;
  Intrinsics k;
  ImageView<T> estimate, nx, ny, nz;
  ImageView<T> normal_weight, continuity_weight, depth_weight;
  Span<T> row_buffers;
  Span<double> row_normal, row_continuity, row_depth;  // loss by row
  std::size_t normal_count = 0;
  std::size_t depth_count = 0;
};

template <class T>
[[nodiscard]] Status allocate_loss_plane(Shape shape, Workspace& workspace, ImageView<T>& plane) noexcept {
  Span<T> elements;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(loss_plane_elements(shape), elements));
  plane = ImageView<T>(elements.data(), shape, loss_plane_stride(shape.width));
  return {};
}

template <class T>
[[nodiscard]] Status validate_losses(const LossParams& params, const LossInput<T>& input) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(input.intrinsics));
  const auto weight = [](float w) { return w >= 0 && w <= 1e6F; };  // false for NaN
  const auto weights = [weight](const LossWeights& w) {
    return weight(w.normal) && weight(w.continuity) && weight(w.depth);
  };
  if (!weights(params.lambda)) return {StatusCode::invalid_argument, "losses: each lambda must lie in 0..1e6"};
  for (const LossWeights& w : input.label_weights) {
    if (!weights(w)) return {StatusCode::invalid_argument, "losses: label weights must lie in 0..1e6"};
  }
  if (!(params.depth_unit_m >= 1e-3F && params.depth_unit_m <= 1e5F)) {
    return {StatusCode::invalid_argument, "losses: depth_unit_m must lie in 1e-3..1e5"};
  }
  if (input.depth_est.empty()) return {StatusCode::no_valid_input, "losses: the depth image is empty"};
  const Shape shape = input.depth_est.shape();
  const auto fits = [shape](const auto& view) { return view.empty() || view.shape() == shape; };
  if (input.normals.empty() || !fits(input.normals) || !fits(input.uncertain) || !fits(input.labels)) {
    return {StatusCode::shape_mismatch, "losses: normals, uncertain and labels must have the shape of the depth"};
  }
  return {};
}

// The planes of one pixel. Returns whether it has the normal and continuity terms.
template <class T>
bool prepare_pixel(const LossInput<T>& input, LossProblem<T>& p, int x, int y) noexcept {
  const Shape shape = input.depth_est.shape();
  const auto present = [&](int i, int j) {
    return i < shape.width && j < shape.height && has_depth(input.depth_est(i, j));
  };
  const bool inside = present(x, y);
  LossWeights w;
  if (inside && !input.labels.empty() && input.labels(x, y) < input.label_weights.size()) {
    w = input.label_weights[input.labels(x, y)];
  }
  Vec3<T> n{};
  if (inside && present(x + 1, y) && present(x, y + 1)) {
    n = input.normals(x, y);
    const T norm = length(n);
    n = norm > T(1e-6) && std::isfinite(norm) ? n / norm : Vec3<T>{};
  }
  const bool has_normal = dot(n, n) > T(0.5);
  const bool sure = !inside || input.uncertain.empty() || input.uncertain(x, y) == 0;
  const T estimate = inside ? input.depth_est(x, y) : T(1);
  const T unit = p.params.depth_term == DepthTerm::metric ? T(p.params.depth_unit_m) : estimate;
  p.estimate.row(y)[x] = estimate;
  p.nx.row(y)[x] = n.x;
  p.ny.row(y)[x] = n.y;
  p.nz.row(y)[x] = n.z;
  p.normal_weight.row(y)[x] = has_normal && (sure || p.params.normal_in_uncertain) ? T(w.normal) : T(0);
  p.continuity_weight.row(y)[x] = has_normal && sure ? T(w.continuity) : T(0);
  p.depth_weight.row(y)[x] = inside ? T(w.depth) / (unit * unit) : T(0);
  if (inside) ++p.depth_count;
  return has_normal;
}

template <class T, class Executor>
[[nodiscard]] Status prepare_losses(const LossParams& params, const LossInput<T>& input, Workspace& workspace,
                                    Executor&, LossProblem<T>& p) noexcept {
  const Shape shape = input.depth_est.shape();
  p.params = params;
  p.k = input.intrinsics;
  for (ImageView<T>* plane :
       {&p.estimate, &p.nx, &p.ny, &p.nz, &p.normal_weight, &p.continuity_weight, &p.depth_weight}) {
    NPSIM_RETURN_IF_ERROR(allocate_loss_plane(shape, workspace, *plane));
  }
  const auto rows = static_cast<std::size_t>(shape.height);
  NPSIM_RETURN_IF_ERROR(workspace.allocate(
      chunk_count(rows, kLossChunkRows) * kLossRowBuffers * static_cast<std::size_t>(p.estimate.stride()),
      p.row_buffers));
  for (Span<double>* sums : {&p.row_normal, &p.row_continuity, &p.row_depth}) {
    NPSIM_RETURN_IF_ERROR(workspace.allocate(rows, *sums));
  }
  for (int y = 0; y <= shape.height; ++y) {
    for (int x = 0; x < p.estimate.stride(); ++x) {
      if (prepare_pixel(input, p, x, y)) ++p.normal_count;
    }
  }
  return p.depth_count > 0 ? Status() : Status(StatusCode::no_valid_input, "losses: no pixel has a usable depth");
}

}  // namespace depth_detail
}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_DEPTH_LOSS_PROBLEM_HPP
