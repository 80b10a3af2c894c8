// SPDX-License-Identifier: Apache-2.0
// The table of contents: every header of the library that runs without an operating system, by stage of the method.
// What stands in a detail/ folder belongs to the area around it. Hosts add npsim/io/ (files) and npsim/exec/ (threads).
#ifndef NPSIM_NPSIM_HPP
#define NPSIM_NPSIM_HPP

// what everything stands on: status, views, memory, threads, random numbers
#include "npsim/core/algorithm.hpp"
#include "npsim/core/bits.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/executor.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/observe.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/scene_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/window_filter.hpp"
#include "npsim/core/workspace.hpp"

// meshes, layers over the pixel grid, the ground plane
#include "npsim/geometry/ground.hpp"
#include "npsim/geometry/triangle_mesh.hpp"

// the one place that knows the instruction set
#include "npsim/simd/batch.hpp"
#include "npsim/simd/bytes.hpp"
#include "npsim/simd/fixed.hpp"
#include "npsim/simd/math.hpp"

#include "npsim/color/chromaticity.hpp"
#include "npsim/color/srgb.hpp"

#include "npsim/labels/boxes.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"

// section 3.4: from measured or predicted depth to one that a mesh can be built on
#include "npsim/depth/cross_bilateral.hpp"
#include "npsim/depth/depth_source.hpp"
#include "npsim/depth/fill.hpp"
#include "npsim/depth/losses.hpp"
#include "npsim/depth/normals.hpp"
#include "npsim/depth/refine.hpp"
#include "npsim/depth/refine_depth.hpp"
#include "npsim/depth/refine_depth_params.hpp"
#include "npsim/depth/things.hpp"
#include "npsim/depth/uncertainty.hpp"

// sections 3.1, 3.3, 3.5: the layered scene mesh
#include "npsim/mesh/check.hpp"
#include "npsim/mesh/complete.hpp"
#include "npsim/mesh/index.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/mesh/simplify.hpp"
#include "npsim/mesh/solidify.hpp"

// rays
#include "npsim/trace/bvh.hpp"
#include "npsim/trace/ray.hpp"
#include "npsim/trace/scene.hpp"
#include "npsim/trace/sheet.hpp"

// sections 3.2, 3.6: lamps
#include "npsim/light/activation.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/light/light_set.hpp"
#include "npsim/light/photometry.hpp"
#include "npsim/light/placement.hpp"
#include "npsim/light/unmarked.hpp"

#include "npsim/material/albedo.hpp"
#include "npsim/material/bsdf.hpp"
#include "npsim/material/retroreflection.hpp"
#include "npsim/material/roughness.hpp"

// section 3.6: light transport
#include "npsim/render/denoise.hpp"
#include "npsim/render/direct.hpp"
#include "npsim/render/gather.hpp"
#include "npsim/render/light_images.hpp"
#include "npsim/render/mirror.hpp"
#include "npsim/render/preview.hpp"
#include "npsim/render/surface_points.hpp"
#include "npsim/render/unsure_light.hpp"
#include "npsim/render/visibility.hpp"

// section 3.6.3: the camera
#include "npsim/sensor/denoise.hpp"
#include "npsim/sensor/exposure.hpp"
#include "npsim/sensor/glare.hpp"
#include "npsim/sensor/isp.hpp"
#include "npsim/sensor/motion.hpp"
#include "npsim/sensor/noise.hpp"
#include "npsim/sensor/raw.hpp"
#include "npsim/sensor/signal_masks.hpp"
#include "npsim/sensor/starburst.hpp"

// errors against a known truth
#include "npsim/metrics/geometry_errors.hpp"
#include "npsim/metrics/luminance_errors.hpp"
#include "npsim/metrics/night_statistics.hpp"
#include "npsim/metrics/picture_errors.hpp"
#include "npsim/metrics/segmentation_errors.hpp"

// the steps, then the whole
#include "npsim/pipeline/enlarge_night.hpp"
#include "npsim/pipeline/night.hpp"
#include "npsim/pipeline/photograph.hpp"
#include "npsim/pipeline/reconstruct.hpp"
#include "npsim/pipeline/relight.hpp"

#endif  // NPSIM_NPSIM_HPP
