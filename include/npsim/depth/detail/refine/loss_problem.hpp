// SPDX-License-Identifier: Apache-2.0
// What does not change while the losses of loss_params.hpp are minimised: unit normals, masks, label weights, counts.
//
// It is kept in planes whose rows are padded to whole blocks of 16 pixels, with one more block and one more row, and in
// which padding and missing pixels hold depth 1 and weight 0: the loops of loss_kernel.hpp have no tails and no tests.
//
// Invariant: the planes and counts do not depend on the batch nor on the executor. Error: correctly rounded operations,
// some six of them from a normal to the unit normal; each component within 4e-7 of the exact value, relatively.
// Cost: one pass, bound by memory: 18 bytes read and 28 written per pixel. Memory: 7 values per pixel, and a row for
// every 16.
#ifndef NPSIM_DEPTH_DETAIL_REFINE_LOSS_PROBLEM_HPP
#define NPSIM_DEPTH_DETAIL_REFINE_LOSS_PROBLEM_HPP

#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/depth/detail/refine/loss_batch.hpp"
#include "npsim/depth/detail/refine/loss_params.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/simd/batch.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr int kLossBlock = 16;
inline constexpr std::size_t kLossChunkRows = 16;

[[nodiscard]] constexpr std::ptrdiff_t loss_plane_stride(int width) noexcept {
  return (width + kLossBlock - 1) / kLossBlock * kLossBlock + kLossBlock;  // the block after the last is read at x + 1
}
[[nodiscard]] constexpr std::size_t loss_plane_elements(Shape shape) noexcept {
  return static_cast<std::size_t>(loss_plane_stride(shape.width)) * (static_cast<std::size_t>(shape.height) + 1);
}
// Depth beyond them counts as missing.
inline constexpr double kLossMinDepth_m = 1e-3;
inline constexpr double kLossMaxDepth_m = 1e5;

// Row buffers of one chunk: the part of the gradient for the lower neighbours.
inline constexpr std::size_t kLossRowBuffers = 1;

template <class T>
[[nodiscard]] constexpr std::size_t loss_problem_bytes(Shape shape) noexcept {
  const std::size_t chunks = chunk_count(static_cast<std::size_t>(shape.height), kLossChunkRows);
  return 7 * allocation_bytes<T>(loss_plane_elements(shape)) +
         allocation_bytes<T>(chunks * kLossRowBuffers * static_cast<std::size_t>(loss_plane_stride(shape.width))) +
         3 * allocation_bytes<double>(static_cast<std::size_t>(shape.height));
}

namespace depth_detail {

template <class T>
[[nodiscard]] bool has_depth(T z_m) noexcept {
  return z_m >= T(kLossMinDepth_m) && z_m <= T(kLossMaxDepth_m);  // false for NaN
}

template <class T, class V>
[[nodiscard]] typename V::MaskType usable_depth(V z_m) noexcept {
  return (z_m >= V(T(kLossMinDepth_m))) & (z_m <= V(T(kLossMaxDepth_m)));
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

// Factors of a pixel by its label; those of depth include 1 / depth_unit_m^2 where that is the same for all pixels.
template <class T>
struct LabelFactors {
  static constexpr std::size_t kLabels = std::size_t{std::numeric_limits<Label>::max()} + 1;
  T normal[kLabels], continuity[kLabels], depth[kLabels];
};
template <class T>
[[nodiscard]] LabelFactors<T> label_factors(const LossParams& params, Span<const LossWeights> weights) noexcept {
  const T unit = params.depth_term == DepthTerm::metric ? T(params.depth_unit_m) : T(1);
  LabelFactors<T> factors;
  for (std::size_t label = 0; label < LabelFactors<T>::kLabels; ++label) {
    const LossWeights w = label < weights.size() ? weights[label] : LossWeights{};
    factors.normal[label] = T(w.normal);
    factors.continuity[label] = T(w.continuity);
    factors.depth[label] = T(w.depth) / (unit * unit);
  }
  return factors;
}

template <class V>
struct LossFactors {
  V normal, continuity, depth;
};
template <class V, class T>
[[nodiscard]] LossFactors<V> factors_of(const LabelFactors<T>& factors, Label label) noexcept {
  return {V(factors.normal[label]), V(factors.continuity[label]), V(factors.depth[label])};
}
// Labels come in runs: those of a batch are mostly equal.
template <class V, class T>
[[nodiscard]] LossFactors<V> factors_of(const LabelFactors<T>& factors, const Label* labels, int n) noexcept {
  using I = typename V::Int;
  const I index = n == V::lanes ? I::load_u8(labels) : I::load_u8(labels, n);
  if (n == V::lanes && all(index == I(labels[0]))) return factors_of<V>(factors, labels[0]);
  return {V::gather(factors.normal, index), V::gather(factors.continuity, index), V::gather(factors.depth, index)};
}

// The n values from p on, n possibly negative or beyond the batch; the other lanes are 0.
template <class V, class T>
[[nodiscard]] V load_at_most(const T* p, int n) noexcept {
  return n >= V::lanes ? V::load(p) : V::load(p, n > 0 ? n : 0);
}
template <class V, class T>
[[nodiscard]] simd::F32x3<V> load_normals(const Vec3<T>* p, int n) noexcept {
  if constexpr (std::is_same_v<T, double>) {
    return n > 0 ? simd::F32x3<V>{p->x, p->y, p->z} : simd::F32x3<V>{0.0, 0.0, 0.0};
  } else {
    return simd::load3<V>(&p->x, n);
  }
}

template <class V>
[[nodiscard]] double sum_of_lanes(V batch) noexcept {
  double sum = 0;
  for (int i = 0; i < V::lanes; ++i) sum += static_cast<double>(batch.lane(i));
  return sum;
}

// The planes of row y with their padding; y may be the row after the last. The numbers of pixels that have the normal
// and continuity terms and the depth term go to row_normal and row_depth.
template <class V, class T>
void prepare_row(const LossInput<T>& input, const LabelFactors<T>& factors, LossProblem<T>& p, int y) noexcept {
  using I = typename V::Int;
  using M = typename V::MaskType;
  const Shape shape = input.depth_est.shape();
  const int width = y < shape.height ? shape.width : 0;
  const int width_below = y + 1 < shape.height ? shape.width : 0;
  const T* here_row = input.depth_est.row(width > 0 ? y : 0);
  const T* below_row = input.depth_est.row(width_below > 0 ? y + 1 : 0);
  const Vec3<T>* normal_row = input.normals.row(width > 0 ? y : 0);
  const std::uint8_t* uncertain = width > 0 && !input.uncertain.empty() ? input.uncertain.row(y) : nullptr;
  const Label* labels = width > 0 && !input.labels.empty() ? input.labels.row(y) : nullptr;
  const V zero(T(0));
  const V one(T(1));
  V normal_count = zero;
  V depth_count = zero;
  LossFactors<V> w = factors_of<V>(factors, Label{0});
  for (int x = 0; x < static_cast<int>(p.estimate.stride()); x += V::lanes) {
    const auto left_of = [x](int end) { return end - x < 0 ? 0 : (end - x < V::lanes ? end - x : V::lanes); };
    const int n = left_of(width);
    const int at = n > 0 ? x : 0;  // no pointer behind the image
    const V here = load_at_most<V>(here_row + at, n);
    const V right = load_at_most<V>(here_row + at + (width - at > 1 ? 1 : 0), left_of(width - 1));
    const V below = load_at_most<V>(below_row + at, left_of(width_below));
    const simd::F32x3<V> normal = load_normals<V>(normal_row + at, n);
    const V norm = sqrt(fma(normal.x, normal.x, fma(normal.y, normal.y, normal.z * normal.z)));
    const M inside = usable_depth<T>(here);
    const M has_normal = inside & usable_depth<T>(right) & usable_depth<T>(below) & (norm > V(T(1e-6))) &
                         (norm <= V(std::numeric_limits<T>::max()));  // false for NaN
    M sure(true);
    if (uncertain != nullptr) {
      sure = (n == V::lanes ? I::load_u8(uncertain + at) : I::load_u8(uncertain + at, n)) == I(0);
    }
    if (labels != nullptr && n > 0) w = factors_of<V>(factors, labels + at, n);
    const M has_sure_normal = has_normal & sure;
    const M has_normal_term = p.params.normal_in_uncertain ? has_normal : has_sure_normal;
    const V depth_factor = p.params.depth_term == DepthTerm::relative ? w.depth / (here * here) : w.depth;
    select(inside, here, one).store(p.estimate.row(y) + x);
    select(has_normal, normal.x / norm, zero).store(p.nx.row(y) + x);
    select(has_normal, normal.y / norm, zero).store(p.ny.row(y) + x);
    select(has_normal, normal.z / norm, zero).store(p.nz.row(y) + x);
    select(has_normal_term, w.normal, zero).store(p.normal_weight.row(y) + x);
    select(has_sure_normal, w.continuity, zero).store(p.continuity_weight.row(y) + x);
    select(inside, depth_factor, zero).store(p.depth_weight.row(y) + x);
    normal_count = normal_count + select(has_normal, one, zero);
    depth_count = depth_count + select(inside, one, zero);
  }
  if (y < shape.height) {
    p.row_normal[static_cast<std::size_t>(y)] = sum_of_lanes(normal_count);
    p.row_depth[static_cast<std::size_t>(y)] = sum_of_lanes(depth_count);
  }
}

// V: the batch; the result is the same for all.
template <class T, class V = LossBatch<T>, class Executor>
[[nodiscard]] Status prepare_losses(const LossParams& params, const LossInput<T>& input, Workspace& workspace,
                                    Executor& executor, LossProblem<T>& p) noexcept {
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
  const LabelFactors<T> factors =
      label_factors<T>(params, input.labels.empty() ? Span<const LossWeights>() : input.label_weights);
  executor.for_chunks(rows + 1, kLossChunkRows, [&](std::size_t begin, std::size_t end) {
    for (std::size_t y = begin; y < end; ++y) prepare_row<V>(input, factors, p, static_cast<int>(y));
  });
  p.normal_count = 0;
  p.depth_count = 0;
  for (std::size_t y = 0; y < rows; ++y) {
    p.normal_count += static_cast<std::size_t>(p.row_normal[y]);
    p.depth_count += static_cast<std::size_t>(p.row_depth[y]);
  }
  return p.depth_count > 0 ? Status() : Status(StatusCode::no_valid_input, "losses: no pixel has a usable depth");
}

}  // namespace depth_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_DEPTH_DETAIL_REFINE_LOSS_PROBLEM_HPP
