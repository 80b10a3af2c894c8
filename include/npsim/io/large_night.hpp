// SPDX-License-Identifier: Apache-2.0
// Nights of photographs that are larger than the method needs.
//
// Depth, mesh and light gain nothing from more than some two million pixels, and cost by the pixel. A larger scene is
// resampled to that (scene_resize.hpp); its nights are then brought to the size of the photograph
// (pipeline/enlarge_night.hpp), and the camera takes its picture there, with its own noise in each pixel.
// Memory on the heap: 12 bytes a pixel of the photograph for the light, 3 for the picture, 4 for depth, 1 for labels
// where there are none, 2 for raw levels, and what photograph() takes; besides the workspace at the smaller size.
#ifndef NPSIM_IO_LARGE_NIGHT_HPP
#define NPSIM_IO_LARGE_NIGHT_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "npsim/core/image_view.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/memory.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/io/scene_resize.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/pipeline/enlarge_night.hpp"
#include "npsim/pipeline/night.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

inline constexpr std::size_t kMostWorkPixels = std::size_t{2048} * 1024;

// Of a picture's shape, or smaller with its sides in the same ratio, within half a pixel.
[[nodiscard]] inline Shape work_shape(Shape picture, std::size_t most = kMostWorkPixels) {
  if (picture.pixels() <= most) return picture;
  const double scale = std::sqrt(static_cast<double>(most) / static_cast<double>(picture.pixels()));
  const auto side = [scale](int s) { return std::max(1, static_cast<int>(s * scale + 0.5)); };
  return {side(picture.width), side(picture.height)};
}

// The scene that depth and light are computed of. What nights at the photograph's size do not need leaves it.
[[nodiscard]] inline Expected<Scene> take_work_scene(Scene& photograph, Shape to) {
  Expected<Scene> work = resized_scene(photograph, to);
  if (!work) return work;
  photograph.depth = {};
  photograph.normals = {};
  photograph.albedo = {};
  photograph.roughness = {};
  return work;
}

// A sink of make_nights() at the smaller size that hands another sink each night at the photograph's. What is
// reconstructed it hands on as it is. Where both sizes are the same, so are the nights.
template <class Executor, class Observer, class Sink>
class LargeNights {
 public:
  // work: the scene that the nights are made of; photograph: image, camera, and labels, instances and lamps where there
  // are any, labels only where work has them, lamps with the indices of work. Both, and their planes, outlive this.
  LargeNights(const NightParams& params, const SceneView& photograph, const SceneView& work, Executor& executor,
              Observer& observer, Sink& sink)
      : params_(params), photograph_(photograph), work_(work), executor_(executor), observer_(observer), sink_(sink) {}

  Status reconstructed(const RefinedDepth& refined, const SceneMesh& mesh, const Relighting& light) {
    const Shape shape = photograph_.shape();
    if (shape == work_.shape()) return sink_.reconstructed(refined, mesh, light);
    depth_ = resized_nearest<float>(refined.depth, shape);
    if (photograph_.labels.empty()) {
      work_labels_ = Image<Label>(work_.shape());
      copy_pixels(refined.labels, work_labels_.view());
      for (int y = 0; y < work_.shape().height; ++y) {
        for (int x = 0; x < work_.shape().width; ++x) {
          if (refined.surface(x, y) == 0) work_labels_(x, y) = label::sky;  // where no class says so
        }
      }
      labels_ = resized_nearest(work_labels_, shape);
    }
    return sink_.reconstructed(refined, mesh, light);
  }

  Status night(const Night& small) {
    const Shape shape = photograph_.shape();
    if (shape == work_.shape()) return sink_.night(small);
    if (light_.empty()) {
      light_ = Image<Vec3f>(shape);
      picture_ = Image<Rgb8>(shape);
      if (params_.raw) levels_ = Image<std::uint16_t>(shape);
    }
    const bool labelled = !photograph_.labels.empty();
    const DayView from{work_.image, labelled ? work_.labels : std::as_const(work_labels_).view(), work_.light_index};
    const DayView to{photograph_.image, photograph_.labels, photograph_.light_index};
    observer_.begin(Stage::add_lights);
    NPSIM_RETURN_IF_ERROR(enlarge_night(EnlargeNightParams{}, from, small.luminance, to, light_.view(), executor_));
    observer_.end(Stage::add_lights);
    Night night = small;
    RawPicture raw;
    raw.levels = levels_.view();
    night.street = {std::as_const(depth_).view(), labelled ? photograph_.labels : std::as_const(labels_).view(),
                    photograph_.instances, photograph_.light_index, photograph_.lights};
    observer_.begin(Stage::camera);
    const std::size_t bytes = photograph_workspace_bytes(params_.camera, shape, photograph_.lights.size());
    HostMemory memory(bytes);
    if (!memory.ok()) return {StatusCode::workspace_exhausted, "memory for the camera cannot be reserved"};
    Workspace workspace = memory.workspace(bytes);
    NPSIM_RETURN_IF_ERROR(photograph(params_.camera, photograph_.camera, small.key,
                                     static_cast<std::uint32_t>(small.variant), std::as_const(light_).view(),
                                     picture_.view(), night.exposure, workspace, executor_, night.street, &raw));
    observer_.end(Stage::camera);
    night.luminance = std::as_const(light_).view();
    night.picture = std::as_const(picture_).view();
    night.raw = raw;
    return sink_.night(night);
  }

 private:
  const NightParams& params_;
  const SceneView& photograph_;
  const SceneView& work_;
  Executor& executor_;
  Observer& observer_;
  Sink& sink_;
  Image<Label> work_labels_, labels_;  // of a scene without
  Image<float> depth_;
  Image<Vec3f> light_;
  Image<Rgb8> picture_;
  Image<std::uint16_t> levels_;
};

// make_nights() of `work`, the sink being shown nights of the photograph's size.
template <class Executor, class Observer, class Sink>
Status make_large_nights(const NightParams& params, const SceneView& photograph, const SceneView& work,
                         Workspace& workspace, Executor& executor, Observer& observer, Sink& sink) {
  LargeNights<Executor, Observer, Sink> large(params, photograph, work, executor, observer, sink);
  return npsim::make_nights(params, work, workspace, executor, observer, large);
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_LARGE_NIGHT_HPP
