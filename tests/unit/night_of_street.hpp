// SPDX-License-Identifier: Apache-2.0
// What a sink keeps of the nights of a generated street.
#ifndef NPSIM_TESTS_UNIT_NIGHT_OF_STREET_HPP
#define NPSIM_TESTS_UNIT_NIGHT_OF_STREET_HPP

#include <doctest/doctest.h>

#include <cstddef>
#include <memory>

#include "npsim/core/observe.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/pipeline/night.hpp"
#include "street/scene_view.hpp"
#include "street/street.hpp"
#include "tool/engine.hpp"

namespace npsim::testing {

template <class Sink>
Sink night_of(const SceneView& view, const NightParams& params) {
  const std::size_t bytes = night_workspace_bytes(params, view.shape(), view.lights.size());
  const std::unique_ptr<unsigned char[]> memory(new unsigned char[bytes]);
  Workspace workspace(memory.get(), bytes);
  NullObserver observer;
  ThreadPool pool(2);
  Sink sink;
  REQUIRE(engine::make_nights(params, view, workspace, pool, observer, sink).ok());
  return sink;
}

template <class Sink>
Sink night_of(const street::Street& street, const NightParams& params) {
  return night_of<Sink>(view_of(street), params);
}

}  // namespace npsim::testing

#endif  // NPSIM_TESTS_UNIT_NIGHT_OF_STREET_HPP
