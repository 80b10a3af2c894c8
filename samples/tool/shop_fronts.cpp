// SPDX-License-Identifier: Apache-2.0
#include "shop_fronts.hpp"

#include <algorithm>
#include <cstddef>
#include <string>

#include "engine.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/memory.hpp"
#include "npsim/io/scene_resize.hpp"
#include "npsim/light/placement.hpp"
#include "npsim/pipeline/relight.hpp"
#include "options.hpp"

namespace npsim::tool {

Status shop_fronts_of(const NightParams& params, const SceneView& scene, const RefinedDepth& refined,
                      std::vector<std::uint8_t>& by_mark) {
  by_mark.assign(scene.lights.size(), 0);
  if (scene.light_index.empty() || scene.lights.empty()) return {};
  std::vector<Emitter> placed(scene.lights.size());
  std::vector<unsigned char> memory(placement_workspace_bytes(params.relight.placement, scene.shape()));
  Workspace workspace(memory.data(), memory.size());
  std::size_t count = 0;
  NPSIM_RETURN_IF_ERROR(place_lights(params.relight.placement, placement_scene(scene, refined), workspace,
                                     {placed.data(), placed.size()}, count));
  for (std::size_t i = 0; i < count; ++i) by_mark[placed[i].mark - 1U] = is_shop_front(refined.ground, placed[i]);
  return {};
}

io::Expected<std::vector<std::uint8_t>> shop_fronts(const NightParams& params, const io::Scene& scene, int threads) {
  std::vector<std::uint8_t> by_mark(scene.lights.size(), 0);
  const auto is_window = [](const LightMark& mark) { return mark.cls == LightClass::window_building; };
  if (params.relight.activation.by_text_alone) return by_mark;
  if (std::none_of(scene.lights.begin(), scene.lights.end(), is_window)) return by_mark;
  Shape shape = scene.shape();
  if (shape.width > kShopFrontWidth) {
    shape = {kShopFrontWidth, std::max(1, shape.height * kShopFrontWidth / shape.width)};
  }
  const io::Expected<io::Scene> small = io::resized_scene(scene, shape);
  if (!small) return small.error();
  const SceneView view = small.value().view();
  io::HostMemory memory(refine_depth_workspace_bytes(params.depth, view.shape()));
  Workspace workspace = memory.workspace();
  ThreadPool pool(thread_count(threads));
  NullObserver observer;
  RefinedDepth refined;
  Status status = engine::refine_depth(params.depth, view, workspace, pool, observer, refined);
  if (status.ok()) status = shop_fronts_of(params, view, refined, by_mark);
  if (!status.ok()) by_mark.clear();  // the night itself says what is wrong
  return by_mark;
}

}  // namespace npsim::tool
