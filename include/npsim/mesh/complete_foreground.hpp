// SPDX-License-Identifier: Apache-2.0
// Completes foreground objects over their uncertain pixels (section 3.5.2): one sheet per object, all in one layer.
//
// An object is a connected component (4-neighbourhood) of foreground pixels with one label and, where instance ids are
// given, one instance. Its kept vertices are those of certain pixels. From them a breadth-first search enters the
// object's other pixels: a new vertex gets the mean depth of its neighbours of earlier levels, in the same object.
// An object without any kept vertex (thinner than the uncertain band around its outline: poles, far persons) would
// vanish; it stands at one depth, the median of its own pixels' (the lower one of two), and stays empty only if it has
// no valid depth at all. Faces join vertices of one object.
//
// A sheet spans pixel centres, so what is one pixel wide has no face. With widen_thin such a pixel lends its depth to
// a free pixel beside it (right, else left; for what is one pixel high below, else above), so that a pole of one pixel
// casts a shadow. The pixels added carry the object's id but another label.
//
// Invariant: a layer has one vertex a pixel at most, no face joins two objects, objects are numbered 1, 2, ... in
// raster order. Levels, not the order of visits, define the means: the result is a function of the input alone. Cost:
// linear in the pixels, serial but for the last pass. Memory: 16 bytes a pixel. Error: a mean of at most four floats,
// summed in double: half an ulp each level.
#ifndef NPSIM_MESH_COMPLETE_FOREGROUND_HPP
#define NPSIM_MESH_COMPLETE_FOREGROUND_HPP

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/components.hpp"
#include "npsim/mesh/interpolate_rows.hpp"
#include "npsim/mesh/sheet.hpp"
#include "npsim/simd/isa.hpp"

namespace npsim {
inline namespace v1 {

struct ForegroundParams {
  LabelSet foreground = kForegroundLabels;  // section 3.4.2
  bool widen_thin = true;                   // ours, see above

  [[nodiscard]] static constexpr ForegroundParams thesis() noexcept { return {kForegroundLabels, false}; }
};

[[nodiscard]] constexpr std::size_t complete_foreground_workspace_bytes(const ForegroundParams&, Shape shape) noexcept {
  const std::size_t pixels = shape.empty() ? 0 : shape.pixels();
  // Depth, level, and in turn the labelling's own, the median's samples and cursors, the queue.
  return 3 * allocation_bytes<std::uint32_t>(pixels) + allocation_bytes<std::uint32_t>(pixels + 1) +
         kWorkspaceAlignment;
}

inline namespace NPSIM_ISA_NAMESPACE {
namespace mesh_detail {

inline constexpr std::uint32_t kOutside = 0xFFFFFFFFU;    // level of a pixel of no object
inline constexpr std::uint32_t kUnreached = 0xFFFFFFFEU;  // level of a pixel without a vertex so far

struct ForegroundPlanes {
  ImageView<std::uint32_t> object;  // caller's
  ImageView<float> depth;           // 0 where there is none yet
  ImageView<std::uint32_t> level;

  [[nodiscard]] bool joined(int x, int y, int i, int j) const noexcept {
    return object.contains(i, j) && level(i, j) != kOutside && object(i, j) == object(x, y);
  }
};

inline constexpr int kStepX[4] = {-1, 1, 0, 0};
inline constexpr int kStepY[4] = {0, 0, -1, 1};

// Breadth-first search from every vertex there is. The queue holds each pixel once at most.
inline void grow_objects(const ForegroundPlanes& planes, Span<std::uint32_t> queue) {
  const Shape shape = planes.depth.shape();
  const auto width = static_cast<std::uint32_t>(shape.width);
  std::size_t tail = 0;
  const auto push_neighbours = [&](int x, int y) {
    for (int k = 0; k < 4; ++k) {
      const int i = x + kStepX[k];
      const int j = y + kStepY[k];
      if (!planes.joined(x, y, i, j) || planes.level(i, j) != kUnreached) continue;
      planes.level(i, j) = planes.level(x, y) + 1;
      queue[tail++] = static_cast<std::uint32_t>(j) * width + static_cast<std::uint32_t>(i);
    }
  };
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (planes.level(x, y) == 0) push_neighbours(x, y);
    }
  }
  for (std::size_t head = 0; head < tail; ++head) {
    const int x = static_cast<int>(queue[head] % width);
    const int y = static_cast<int>(queue[head] / width);
    double sum = 0;
    double count = 0;
    for (int k = 0; k < 4; ++k) {
      const int i = x + kStepX[k];
      const int j = y + kStepY[k];
      if (!planes.joined(x, y, i, j) || planes.level(i, j) >= planes.level(x, y)) continue;
      sum += static_cast<double>(planes.depth(i, j));
      count += 1;
    }
    planes.depth(x, y) = static_cast<float>(sum / count);  // the pixel that pushed this one counts
    push_neighbours(x, y);
  }
}

// Gives every object without a kept vertex the lower median depth of its pixels in the sheet.
[[nodiscard]] inline Status stand_up_uncertain(const ForegroundPlanes& planes, ImageView<const Vec3f> sheet,
                                               std::uint32_t count, Workspace& workspace) {
  constexpr std::uint32_t kAnchored = 0x80000000U;  // flag: has a kept vertex, hence an empty bucket
  const Shape shape = planes.depth.shape();
  const WorkspaceScope scope(workspace);
  Span<float> samples;         // depths, one bucket per object
  Span<std::uint32_t> cursor;  // per object: number of samples, then start of its bucket, at last the bucket's end
  NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), samples));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(std::size_t{count} + 1, cursor));
  std::fill(cursor.begin(), cursor.end(), 0U);
  const auto for_members = [&](const auto& f) {
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        if (planes.level(x, y) != kOutside) f(x, y, cursor[planes.object(x, y)]);
      }
    }
  };
  for_members([&](int x, int y, std::uint32_t& c) {
    if (planes.level(x, y) == 0) c = kAnchored;
  });
  for_members([&](int x, int y, std::uint32_t& c) {
    if (c != kAnchored && has_vertex(sheet(x, y))) ++c;
  });
  std::uint32_t total = 0;
  for (std::uint32_t o = 1; o <= count; ++o) {
    const std::uint32_t size = cursor[o] & ~kAnchored;
    cursor[o] = total | (cursor[o] & kAnchored);
    total += size;
  }
  for_members([&](int x, int y, std::uint32_t& c) {
    if ((c & kAnchored) == 0 && has_vertex(sheet(x, y))) samples[c++] = sheet(x, y).z;
  });
  const auto bucket_begin = [&](std::uint32_t o) { return o == 1 ? 0U : cursor[o - 1] & ~kAnchored; };
  for (std::uint32_t o = 1; o <= count; ++o) {
    const std::uint32_t begin = bucket_begin(o);
    if ((cursor[o] & kAnchored) != 0 || cursor[o] == begin) continue;
    float* first = samples.data() + begin;
    float* last = samples.data() + cursor[o];
    float* middle = first + (last - first - 1) / 2;
    std::nth_element(first, middle, last);
    std::swap(*first, *middle);
  }
  for_members([&](int x, int y, std::uint32_t& c) {
    const std::uint32_t begin = bucket_begin(planes.object(x, y));
    if ((c & kAnchored) != 0 || c == begin) return;
    planes.depth(x, y) = samples[begin];
    planes.level(x, y) = 0;
  });
  return {};
}

// The member whose depth a free pixel takes over, if any: {-1, -1} when none. Pulled, so that pixels are independent.
struct PixelIndex {
  int x = -1;
  int y = -1;
};
[[nodiscard]] inline PixelIndex thin_neighbour(const ForegroundPlanes& planes, int x, int y) noexcept {
  const auto joined = [&](int i, int j, int ni, int nj) {
    return planes.joined(i, j, ni, nj) && planes.depth(ni, nj) > 0.0F;
  };
  const auto thin = [&](int i, int j, int dx, int dy) {
    return planes.level.contains(i, j) && planes.level(i, j) != kOutside && planes.depth(i, j) > 0.0F &&
           !joined(i, j, i - dx, j - dy) && !joined(i, j, i + dx, j + dy);
  };
  const auto taken = [&](int i, int j) { return !planes.level.contains(i, j) || planes.level(i, j) != kOutside; };
  if (thin(x - 1, y, 1, 0)) return {x - 1, y};
  if (thin(x + 1, y, 1, 0) && taken(x + 2, y)) return {x + 1, y};
  if (thin(x, y - 1, 0, 1)) return {x, y - 1};
  if (thin(x, y + 1, 0, 1) && taken(x, y + 2)) return {x, y + 1};
  return {};
}

// Bits of a quad from those of its corners that belong to one object; three of four decide which.
[[nodiscard]] inline std::uint8_t connect_object_quad(const SheetLayer& layer, ImageView<const std::uint32_t> object,
                                                      int x, int y) noexcept {
  const std::uint32_t id[4] = {object(x, y), object(x + 1, y), object(x, y + 1), object(x + 1, y + 1)};
  const int like_first = (id[1] == id[0] ? 1 : 0) + (id[2] == id[0] ? 1 : 0) + (id[3] == id[0] ? 1 : 0);
  const std::uint32_t own = like_first >= 2 ? id[0] : id[1];
  if (own == 0) return 0;
  const auto depth = [&](int k) { return id[k] == own ? layer.vertices(x + (k & 1), y + (k >> 1)).z : 0.0F; };
  return connect_quad(depth(0), depth(1), depth(2), depth(3));
}

}  // namespace mesh_detail

// sheet: vertices of build_sheet(). instances, uncertain: may be empty views. background_state: the states that
// complete_background() wrote; foreground that it kept (thesis preset: segments far from any uncertain pixel) belongs
// to the background layer and makes no object. Empty: every foreground pixel is an object's. object: 0 outside.
template <class Executor>
[[nodiscard]] Status complete_foreground(const ForegroundParams& params, ImageView<const Vec3f> sheet,
                                         ImageView<const Label> labels, ImageView<const std::uint16_t> instances,
                                         ImageView<const std::uint8_t> uncertain,
                                         ImageView<const std::uint8_t> background_state, const Intrinsics& intrinsics,
                                         const SheetLayer& foreground, ImageView<std::uint32_t> object,
                                         Workspace& workspace, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(intrinsics));
  NPSIM_RETURN_IF_ERROR(validate(foreground));
  const Shape shape = foreground.vertices.shape();
  if (sheet.data() == nullptr || sheet.shape() != shape || labels.data() == nullptr || labels.shape() != shape ||
      object.data() == nullptr || object.shape() != shape || !mesh_detail::mask_fits(instances, shape) ||
      !mesh_detail::mask_fits(uncertain, shape) || !mesh_detail::mask_fits(background_state, shape)) {
    return {StatusCode::shape_mismatch, "sheet, labels, instances, masks, object and foreground must have one shape"};
  }
  if (shape.pixels() >= 0x80000000U) return {StatusCode::capacity_exceeded, "the image has 2^31 pixels or more"};
  const WorkspaceScope scope(workspace);
  mesh_detail::ForegroundPlanes planes;
  planes.object = object;
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, planes.depth));
  NPSIM_RETURN_IF_ERROR(workspace.allocate_image(shape, planes.level));
  std::uint32_t count = 0;
  NPSIM_RETURN_IF_ERROR(connected_components(
      [&](int x, int y) {
        return params.foreground.contains(labels(x, y)) &&
               (background_state.data() == nullptr || background_state(x, y) != row_state::known);
      },
      [&](int x0, int y0, int x1, int y1) {
        return labels(x0, y0) == labels(x1, y1) &&
               (instances.data() == nullptr || instances(x0, y0) == instances(x1, y1));
      },
      object, workspace, count));
  mesh_detail::for_rows(executor, shape.height, [&](int y) {
    for (int x = 0; x < shape.width; ++x) {
      const bool member = object(x, y) != 0;
      const bool kept = member && !mesh_detail::mask_at(uncertain, x, y, false) && has_vertex(sheet(x, y));
      planes.depth(x, y) = kept ? sheet(x, y).z : 0.0F;
      planes.level(x, y) = kept ? 0U : (member ? mesh_detail::kUnreached : mesh_detail::kOutside);
    }
  });
  NPSIM_RETURN_IF_ERROR(mesh_detail::stand_up_uncertain(planes, sheet, count, workspace));
  {
    const WorkspaceScope queue_scope(workspace);
    Span<std::uint32_t> queue;
    NPSIM_RETURN_IF_ERROR(workspace.allocate(shape.pixels(), queue));
    mesh_detail::grow_objects(planes, queue);
  }
  mesh_detail::for_rows(executor, shape.height, [&](int y) {
    for (int x = 0; x < shape.width; ++x) {
      float z = planes.depth(x, y);
      if (params.widen_thin && planes.level(x, y) == mesh_detail::kOutside) {
        const mesh_detail::PixelIndex from = mesh_detail::thin_neighbour(planes, x, y);
        if (from.x >= 0) {
          z = planes.depth(from.x, from.y);
          object(x, y) = object(from.x, from.y);  // only members' ids are read, and theirs do not change
        }
      }
      foreground.vertices(x, y) = z > 0.0F ? unproject_pixel(intrinsics, x, y, z) : Vec3f{};
    }
  });
  mesh_detail::for_rows(executor, quad_shape(shape).height, [&](int y) {
    for (int x = 0; x + 1 < shape.width; ++x) {
      foreground.quads(x, y) = mesh_detail::connect_object_quad(foreground, object, x, y);
    }
  });
  return {};
}

}  // namespace NPSIM_ISA_NAMESPACE
}  // namespace v1
}  // namespace npsim

#endif  // NPSIM_MESH_COMPLETE_FOREGROUND_HPP
