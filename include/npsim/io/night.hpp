// SPDX-License-Identifier: Apache-2.0
// The whole of the library in one call, for hosts: a scene folder or arrays in, pictures of its nights out.
//
// Memory and threads are taken care of. Who wants more than the pictures (the linear images, the mesh, which lamp is
// lit, progress) calls make_nights() of pipeline/night.hpp with a sink and an observer. Error: none of its own; the
// bits are those of make_nights() for any number of threads. Of a folder whose photograph has more than
// kMostWorkPixels, depth and light are computed at a smaller size (large_night.hpp).
#ifndef NPSIM_IO_NIGHT_HPP
#define NPSIM_IO_NIGHT_HPP

#include <string>
#include <utility>
#include <vector>

#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/large_night.hpp"
#include "npsim/io/memory.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/pipeline/night.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

namespace detail {

[[nodiscard]] inline Expected<std::vector<Image<Rgb8>>> night_pictures(const NightParams& params,
                                                                       const SceneView& photograph,
                                                                       const SceneView& work, unsigned threads) {
  struct Keep : NullSink {
    std::vector<Image<Rgb8>> pictures;
    Status night(const Night& night) {
      pictures.emplace_back(night.picture.shape());
      copy_pixels(night.picture, pictures.back().view());
      return {};
    }
  };
  HostMemory memory(night_workspace_bytes(params, work.shape(), work.lights.size()));
  if (!memory.ok()) return Error{"", "memory", "cannot be reserved, expected more or a smaller picture"};
  Workspace workspace = memory.workspace();
  ThreadPool pool(threads);
  NullObserver observer;
  Keep sink;
  const Status status = make_large_nights(params, photograph, work, workspace, pool, observer, sink);
  if (!status.ok()) return Error{"", status_code_name(status.code()), status.message()};
  return std::move(sink.pictures);
}

}  // namespace detail

// params.variants nights of `scene`, whose planes the caller keeps meanwhile. threads: 0 = one a processor.
[[nodiscard]] inline Expected<std::vector<Image<Rgb8>>> make_nights(const SceneView& scene,
                                                                    const NightParams& params = default_night_params(),
                                                                    unsigned threads = 0) {
  return detail::night_pictures(params, scene, scene, threads);
}

// Of a folder with a scene.json, or of the scene.json itself. params.photograph is replaced by the photograph's own
// number, so that no two photographs share a random draw.
[[nodiscard]] inline Expected<std::vector<Image<Rgb8>>> make_nights(const std::string& scene_folder,
                                                                    NightParams params = default_night_params(),
                                                                    unsigned threads = 0) {
  Expected<Scene> scene = read_scene(scene_folder);
  if (!scene) return scene.error();
  params.photograph = scene.value().photograph;
  const Expected<Scene> work = take_work_scene(scene.value(), work_shape(scene.value().shape()));
  if (!work) return work.error();
  Expected<std::vector<Image<Rgb8>>> nights =
      detail::night_pictures(params, scene.value().view(), work.value().view(), threads);
  if (!nights) return Error{scene.value().file, nights.error().field, nights.error().problem};
  return nights;
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_NIGHT_HPP
