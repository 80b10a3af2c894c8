// SPDX-License-Identifier: Apache-2.0
// A generated street as the pipeline sees a scene: its photograph, its annotation, its estimated depth and normals. The
// camera's height is left out; who knows it adds it.
#ifndef NPSIM_SAMPLES_STREET_SCENE_VIEW_HPP
#define NPSIM_SAMPLES_STREET_SCENE_VIEW_HPP

#include "npsim/core/scene_view.hpp"
#include "params.hpp"

namespace npsim {
namespace street {

// Views into the street, which has to outlive them.
[[nodiscard]] inline SceneView view_of(const Street& s) {
  SceneView view;
  view.camera = s.intrinsics;
  view.image = s.image.view();
  view.depth = s.est_depth.view();
  view.labels = s.labels.view();
  view.instances = s.instances.view();
  view.normals = s.est_normals.view();
  view.light_index = s.light_index.view();
  view.reflectors = s.reflectors.view();
  view.lights = Span<const LightMark>(s.marks.data(), s.marks.size());
  return view;
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_SCENE_VIEW_HPP
