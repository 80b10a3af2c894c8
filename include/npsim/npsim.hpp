// SPDX-License-Identifier: Apache-2.0
// Everything that runs without an operating system. Hosts add npsim/io/ (files) and npsim/exec/ (threads) by name.
#ifndef NPSIM_NPSIM_HPP
#define NPSIM_NPSIM_HPP

#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/triangle_mesh.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"

#include "npsim/simd/batch.hpp"
#include "npsim/simd/isa.hpp"
#include "npsim/simd/native.hpp"
#include "npsim/simd/native_ops.hpp"
#include "npsim/simd/scalar.hpp"

#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"

#include "npsim/depth/normal_convention.hpp"
#include "npsim/depth/normals.hpp"
#include "npsim/depth/uncertainty.hpp"

#include "npsim/mesh/components.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/mesh/sheet.hpp"

#include "npsim/trace/build.hpp"
#include "npsim/trace/bvh.hpp"
#include "npsim/trace/bvh_layout.hpp"
#include "npsim/trace/ray.hpp"
#include "npsim/trace/spawn.hpp"
#include "npsim/trace/traverse.hpp"
#include "npsim/trace/triangle.hpp"

#include "npsim/render/denoise.hpp"
#include "npsim/render/direct.hpp"
#include "npsim/render/gather.hpp"
#include "npsim/render/surface_points.hpp"
#include "npsim/render/visibility.hpp"

#include "npsim/pipeline/relight.hpp"
#include "npsim/pipeline/scene_view.hpp"

#endif  // NPSIM_NPSIM_HPP
