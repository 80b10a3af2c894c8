// SPDX-License-Identifier: Apache-2.0
// The observer concept: how a pipeline tells its caller what it is doing, and asks whether to go on.
//
// An observer O offers  o.begin(stage), o.progress(done, total), o.end(stage), o.depth(stage, depth),
// o.daylight(albedo, sun, report)  and  o.cancelled().
// begin/end come in pairs from the calling thread; progress may come from any thread. depth shows the z-depth (m, 0
// where there is no surface) as each step that changes it left it, after end(stage). daylight shows the diffuse albedo
// (linear RGB) and the share of the direct sun that were estimated from the photograph, before end(Stage::material); a
// scene that gives albedo has none. Both come from the calling thread, and their views hold for the length of the call.
// Observing never changes a result.
#ifndef NPSIM_CORE_OBSERVE_HPP
#define NPSIM_CORE_OBSERVE_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct DaylightReport;  // of material/albedo.hpp

enum class Stage : std::uint8_t {
  fill,
  sharpen,
  ground,
  cross_bilateral,
  planes,
  uncertainty,
  refine,
  sheet,
  prune,
  complete,
  mesh,
  material,
  lights,
  build_trace,
  render,
  add_lights,
  camera,
  count_
};

[[nodiscard]] constexpr const char* stage_name(Stage stage) noexcept {
  switch (stage) {
    case Stage::fill: return "depth fill";
    case Stage::sharpen: return "edge sharpening";
    case Stage::ground: return "ground";
    case Stage::cross_bilateral: return "cross-bilateral filter";
    case Stage::planes: return "planes";
    case Stage::uncertainty: return "variance filter";
    case Stage::refine: return "normal-guided refinement";
    case Stage::sheet: return "sheet mesh";
    case Stage::prune: return "delete spurious faces";
    case Stage::complete: return "mesh completion";
    case Stage::mesh: return "scene mesh";
    case Stage::material: return "material";
    case Stage::lights: return "light sources";
    case Stage::build_trace: return "ray tracer build";
    case Stage::render: return "light transport";
    case Stage::add_lights: return "sum of the lights";
    case Stage::camera: return "camera";
    case Stage::count_: break;
  }
  return "unknown";
}

struct NullObserver {
  constexpr void begin(Stage) const noexcept {}
  constexpr void progress(std::size_t, std::size_t) const noexcept {}
  constexpr void end(Stage) const noexcept {}
  constexpr void depth(Stage, const ImageView<const float>&) const noexcept {}
  constexpr void daylight(const ImageView<const Vec3f>&, const ImageView<const float>&,
                          const DaylightReport&) const noexcept {}
  [[nodiscard]] constexpr bool cancelled() const noexcept { return false; }
};

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_CORE_OBSERVE_HPP
