// SPDX-License-Identifier: Apache-2.0
// Losses of the refinement with their gradient, (1, 5, 1) in d / 80: one evaluation, its planes prepared beforehand as
// in the solvers, and one whole call. Beside it a plain loop that reads as many planes and writes one.
//
// Errors: of the gradient, against the same evaluation in double, relative to the largest gradient. (That the formula
// in double is right is checked against finite differences by the unit tests.)
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "cases.hpp"
#include "npsim/depth/refine.hpp"
#include "scene.hpp"

namespace npsim::bench {
namespace {

constexpr int kPlanesRead = 8;

template <class T>
[[nodiscard]] LossInput<T> loss_input(const Scene& scene, ImageView<const T> depth, ImageView<const Vec3<T>> normals) {
  LossInput<T> input;
  input.depth_est = depth;
  input.normals = normals;
  input.uncertain = scene.uncertain.view();
  input.intrinsics = scene.intrinsics;
  return input;
}

}  // namespace

Comparison losses_case(const Options& options) {
  const Scene& scene = street_scene(options.shape);
  const Shape shape = options.shape;
  Comparison comparison{"losses", "Losses and gradient", shape, {}};

  const auto errors = [&](const LossParams& params) {
    io::Image<double> depth(shape);
    io::Image<Vec3d> normals(shape);
    for (std::size_t i = 0; i < shape.pixels(); ++i) {
      depth.data()[i] = static_cast<double>(scene.depth.data()[i]);
      normals.data()[i] = vec_cast<double>(scene.normals.data()[i]);
    }
    io::Image<double> exact(shape);
    io::Image<float> given(shape);
    LossValues values;
    SerialExecutor executor;
    const auto arena = make_arena(depth_losses_workspace_bytes<double>(params, shape));
    must(depth_losses(params, loss_input<double>(scene, std::as_const(depth).view(), std::as_const(normals).view()),
                      std::as_const(depth).view(), exact.view(), values, arena->workspace(), executor));
    must(depth_losses(params, loss_input<float>(scene, scene.depth.view(), scene.normals.view()), scene.depth.view(),
                      given.view(), values, arena->workspace(), executor));
    double largest = 0;
    for (std::size_t i = 0; i < shape.pixels(); ++i) largest = std::max(largest, std::fabs(exact.data()[i]));
    ErrorSum sum;
    for (std::size_t i = 0; i < shape.pixels(); ++i) {
      sum.add((static_cast<double>(given.data()[i]) - exact.data()[i]) / largest);
    }
    return std::vector<Error>{sum.error("share of the largest gradient")};
  };
  const auto ours = [&](const char* setting, const LossParams& params) {
    struct Problem {
      explicit Problem(std::size_t bytes) : arena(bytes) {}
      Arena arena;
      depth_detail::LossProblem<float> problem;
      ImageView<float> depth, gradient;
    };
    const auto p = std::make_shared<Problem>(depth_losses_workspace_bytes<float>(params, shape));
    SerialExecutor executor;
    must(depth_detail::prepare_losses(params, loss_input<float>(scene, scene.depth.view(), scene.normals.view()),
                                      p->arena.workspace(), executor, p->problem));
    must(depth_detail::allocate_loss_plane(shape, p->arena.workspace(), p->depth));
    must(depth_detail::allocate_loss_plane(shape, p->arena.workspace(), p->gradient));
    std::copy_n(p->problem.estimate.data(), depth_detail::loss_plane_elements(shape), p->depth.data());
    comparison
        .add("npsim", setting,
             [=] {
               LossValues values;
               SerialExecutor e;
               depth_detail::evaluate_losses<float>(p->problem, p->depth, p->gradient, values, e);
             })
        .judge = [=, &errors] { return errors(params); };
  };
  LossParams params;
  ours("perspective tangents", params);
  params.continuity = ContinuityForm::unit_tangents;
  ours("perspective tangents, unit continuity", params);
  params = {};
  params.tangents = TangentForm::thesis;
  ours("thesis tangents", params);
  {
    const LossParams whole;
    const auto out = std::make_shared<io::Image<float>>(shape);
    const auto arena = make_arena(depth_losses_workspace_bytes<float>(whole, shape));
    comparison
        .add("npsim", "perspective tangents, with preparation",
             [=, &scene] {
               LossValues values;
               SerialExecutor e;
               must(depth_losses(whole, loss_input<float>(scene, scene.depth.view(), scene.normals.view()),
                                 scene.depth.view(), out->view(), values, arena->workspace(), e));
             })
        .judge = [=, &errors] { return errors(whole); };
  }

  const auto planes = std::make_shared<std::vector<io::Image<float>>>(kPlanesRead + 1, io::Image<float>(shape, 1.0F));
  comparison.add_peer("memory", "8 planes read, 1 written", [=] {
    const std::vector<io::Image<float>>& p = *planes;
    float* out = (*planes)[kPlanesRead].data();
    for (std::size_t i = 0; i < shape.pixels(); ++i) {
      out[i] = ((p[0].data()[i] + p[1].data()[i]) + (p[2].data()[i] + p[3].data()[i])) +
               ((p[4].data()[i] + p[5].data()[i]) + (p[6].data()[i] + p[7].data()[i]));
    }
  });
  measure(options, comparison);
  return comparison;
}

}  // namespace npsim::bench
