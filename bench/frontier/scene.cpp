// SPDX-License-Identifier: Apache-2.0
#include "scene.hpp"

#include <utility>

#include "npsim/color/srgb.hpp"
#include "npsim/depth/uncertainty.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "street/street.hpp"

namespace npsim::bench {

const Scene& street_scene(Shape shape) {
  static Scene scene;
  if (scene.depth.shape() == shape) return scene;
  std::fprintf(stderr, "street %dx%d ...\n", shape.width, shape.height);
  ThreadPool pool;
  street::StreetParams params;
  params.shape = shape;
  params.samples = 1;  // a rougher photograph in a quarter of the time; the other planes are the same
  params.sky_rays = 1;
  street::Street street;
  must(street::make_street(params, pool, street));
  scene.intrinsics = street.intrinsics;
  scene.image = std::move(street.image);
  scene.depth = std::move(street.est_depth);
  scene.normals = std::move(street.est_normals);
  scene.labels = std::move(street.labels);
  scene.lab = io::Image<Vec3f>(shape);
  must(srgb8_to_lab(std::as_const(scene.image).view(), scene.lab.view(), pool));
  scene.uncertain = io::Image<std::uint8_t>(shape);
  UncertaintyOutput output;
  output.mask = scene.uncertain.view();
  const UncertaintyParams uncertain;
  Arena arena(uncertainty_workspace_bytes(uncertain, shape));
  must(uncertainty(uncertain, std::as_const(scene.depth).view(), std::as_const(scene.labels).view(), output,
                   arena.workspace(), pool));
  return scene;
}

}  // namespace npsim::bench
