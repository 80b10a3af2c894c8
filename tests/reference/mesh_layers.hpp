// SPDX-License-Identifier: Apache-2.0
// Sheet, pruning, objects and index of a layer straight from their definitions, a pixel at a time, with all the memory
// they like: what build_sheet(), prune(), complete_foreground() and index_layer() are tested against, bit by bit.
#ifndef NPSIM_TESTS_REFERENCE_MESH_LAYERS_HPP
#define NPSIM_TESTS_REFERENCE_MESH_LAYERS_HPP

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/complete.hpp"
#include "npsim/mesh/detail/layer.hpp"
#include "npsim/mesh/prune.hpp"
#include "npsim/mesh/sheet.hpp"

namespace npsim {
namespace reference {

struct Layer {
  explicit Layer(Shape s) : shape(s), vertices(s.pixels()), quads(quad_shape(s).pixels()) {}
  [[nodiscard]] Vec3f& vertex(int x, int y) { return vertices[static_cast<std::size_t>(y * shape.width + x)]; }
  [[nodiscard]] std::uint8_t& quad(int x, int y) {
    return quads[static_cast<std::size_t>(y * quad_shape(shape).width + x)];
  }
  Shape shape;
  std::vector<Vec3f> vertices;
  std::vector<std::uint8_t> quads;
};

// Bits of one quad from the depths of its corners, 0 where there is no vertex.
[[nodiscard]] inline std::uint8_t connect_quad(float a, float b, float c, float d) {
  const int count = (a > 0 ? 1 : 0) + (b > 0 ? 1 : 0) + (c > 0 ? 1 : 0) + (d > 0 ? 1 : 0);
  if (count < 3) return 0;
  if (count == 4) {
    const bool anti = std::fabs(b - c) < std::fabs(a - d);
    return static_cast<std::uint8_t>(kQuadUpperFace | kQuadLowerFace | (anti ? kQuadAntiDiagonal : 0));
  }
  if (!(a > 0)) return kQuadAntiDiagonal | kQuadLowerFace;
  if (!(d > 0)) return kQuadAntiDiagonal | kQuadUpperFace;
  return !(b > 0) ? kQuadLowerFace : kQuadUpperFace;
}

[[nodiscard]] inline Layer build_sheet(const SheetParams& params, ImageView<const float> depth,
                                       ImageView<const std::uint8_t> surface, const Intrinsics& intrinsics) {
  Layer sheet(depth.shape());
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      const float z = depth(x, y);
      if (!(z >= params.min_depth_m && z <= params.max_depth_m)) continue;
      if (surface.data() != nullptr && surface(x, y) == 0) continue;
      const Vec3f vertex = unproject_pixel(intrinsics, x, y, z);
      if (is_finite(vertex)) sheet.vertex(x, y) = vertex;
    }
  }
  for (int y = 0; y + 1 < depth.height(); ++y) {
    for (int x = 0; x + 1 < depth.width(); ++x) {
      sheet.quad(x, y) = connect_quad(sheet.vertex(x, y).z, sheet.vertex(x + 1, y).z, sheet.vertex(x, y + 1).z,
                                      sheet.vertex(x + 1, y + 1).z);
    }
  }
  return sheet;
}

inline void prune(const PruneParams& params, ImageView<const std::uint8_t> uncertain, ImageView<const Label> labels,
                  Layer& sheet) {
  const bool keep = params.policy == PrunePolicy::keep_within_foreground;
  for (int y = 0; y + 1 < sheet.shape.height; ++y) {
    for (int x = 0; x + 1 < sheet.shape.width; ++x) {
      const auto survives = [&](const Face& corners) {
        bool any_uncertain = false;
        bool one_label = keep;
        std::vector<float> z;
        std::vector<Label> label;
        for (const std::uint32_t corner : {corners.a, corners.b, corners.c}) {  // bit 0: right column, bit 1: lower row
          const int px = x + static_cast<int>(corner & 1U);
          const int py = y + static_cast<int>(corner >> 1U);
          any_uncertain = any_uncertain || uncertain(px, py) != 0;
          if (!keep) continue;
          z.push_back(sheet.vertex(px, py).z);
          label.push_back(labels(px, py));
          one_label = one_label && label.back() == label.front();
        }
        if (!any_uncertain) return true;
        return one_label && params.foreground.contains(label.front()) &&
               *std::max_element(z.begin(), z.end()) - *std::min_element(z.begin(), z.end()) < params.max_spread_m;
      };
      std::uint8_t& quad = sheet.quad(x, y);
      const bool anti = (quad & kQuadAntiDiagonal) != 0;
      std::uint8_t faces = 0;
      if ((quad & kQuadUpperFace) != 0 && survives(quad_face(anti, true, 0, 1, 2, 3))) faces |= kQuadUpperFace;
      if ((quad & kQuadLowerFace) != 0 && survives(quad_face(anti, false, 0, 1, 2, 3))) faces |= kQuadLowerFace;
      if (anti && faces != 0) faces |= kQuadAntiDiagonal;
      quad = faces;
    }
  }
}

struct Objects {
  explicit Objects(Shape s) : layer(s), object(s.pixels()) {}
  Layer layer;
  std::vector<std::uint32_t> object;
};

// The inputs of complete_foreground(). sheet: of build_sheet().
struct ForegroundInput {
  ImageView<const Label> labels;
  ImageView<const std::uint16_t> instances;
  ImageView<const std::uint8_t> uncertain;
  ImageView<const std::uint8_t> state;
  Intrinsics intrinsics;
};

[[nodiscard]] inline Objects complete_foreground(const ForegroundParams& params, Layer sheet,
                                                 const ForegroundInput& in) {
  const Shape shape = sheet.shape;
  Objects out(shape);
  const auto at = [shape](int x, int y) { return static_cast<std::size_t>(y * shape.width + x); };
  const auto inside = [shape](int x, int y) { return x >= 0 && y >= 0 && x < shape.width && y < shape.height; };
  const auto member = [&](int x, int y) {
    return params.foreground.contains(in.labels(x, y)) &&
           (in.state.data() == nullptr || in.state(x, y) != row_state::known);
  };
  const auto same = [&](int x, int y, int i, int j) {
    return in.labels(x, y) == in.labels(i, j) &&
           (in.instances.data() == nullptr || in.instances(x, y) == in.instances(i, j));
  };
  constexpr int kStep[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
  // Objects by flooding, in raster order of their first pixels.
  std::uint32_t count = 0;
  std::vector<std::vector<std::pair<int, int>>> pixels_of(1);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (!member(x, y) || out.object[at(x, y)] != 0) continue;
      out.object[at(x, y)] = ++count;
      std::vector<std::pair<int, int>> pixels = {{x, y}};
      for (std::size_t k = 0; k < pixels.size(); ++k) {
        for (const auto& step : kStep) {
          const auto [px, py] = pixels[k];
          const int i = px + step[0];
          const int j = py + step[1];
          if (!inside(i, j) || !member(i, j) || out.object[at(i, j)] != 0 || !same(px, py, i, j)) continue;
          out.object[at(i, j)] = count;
          pixels.emplace_back(i, j);
        }
      }
      pixels_of.push_back(pixels);
    }
  }
  // Depths: kept ones, or the median; then level by level, each from what was known before it.
  std::vector<float> depth(shape.pixels(), 0.0F);
  for (const auto& pixels : pixels_of) {
    std::vector<float> valid;
    bool kept = false;
    for (const auto& [x, y] : pixels) {
      if (!has_vertex(sheet.vertex(x, y))) continue;
      valid.push_back(sheet.vertex(x, y).z);
      if (in.uncertain.data() != nullptr && in.uncertain(x, y) != 0) continue;
      depth[at(x, y)] = sheet.vertex(x, y).z;
      kept = true;
    }
    if (valid.empty()) continue;
    std::sort(valid.begin(), valid.end());
    for (const auto& [x, y] : pixels) {
      if (!kept) depth[at(x, y)] = valid[(valid.size() - 1) / 2];
    }
    std::vector<std::pair<int, int>> unknown = pixels;
    for (;;) {
      std::vector<std::pair<int, int>> left;
      std::vector<std::pair<std::size_t, float>> level;
      for (const auto& [x, y] : unknown) {
        if (depth[at(x, y)] > 0) continue;
        left.emplace_back(x, y);
        double sum = 0;
        double n = 0;
        for (const auto& step : kStep) {
          const int i = x + step[0];
          const int j = y + step[1];
          if (!inside(i, j) || out.object[at(i, j)] != out.object[at(x, y)] || !(depth[at(i, j)] > 0)) continue;
          sum += static_cast<double>(depth[at(i, j)]);
          n += 1;
        }
        if (n > 0) level.emplace_back(at(x, y), static_cast<float>(sum / n));
      }
      if (level.empty()) break;
      for (const auto& [pixel, z] : level) depth[pixel] = z;
      unknown = left;
    }
  }
  // Free pixels beside thin members.
  const std::vector<std::uint32_t> objects = out.object;
  const std::vector<float> depths = depth;
  for (int y = 0; params.widen_thin && y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (objects[at(x, y)] != 0) continue;
      const auto thin = [&](int i, int j, int dx, int dy) {
        if (!inside(i, j) || objects[at(i, j)] == 0 || !(depths[at(i, j)] > 0)) return false;
        const auto alike = [&](int k, int l) { return inside(k, l) && objects[at(k, l)] == objects[at(i, j)]; };
        return !alike(i - dx, j - dy) && !alike(i + dx, j + dy);
      };
      const auto taken = [&](int i, int j) { return !inside(i, j) || objects[at(i, j)] != 0; };
      int from[2] = {-1, -1};
      const auto take = [&](int i, int j) { from[0] = i, from[1] = j; };
      if (thin(x - 1, y, 1, 0)) {
        take(x - 1, y);
      } else if (thin(x + 1, y, 1, 0) && taken(x + 2, y)) {
        take(x + 1, y);
      } else if (thin(x, y - 1, 0, 1)) {
        take(x, y - 1);
      } else if (thin(x, y + 1, 0, 1) && taken(x, y + 2)) {
        take(x, y + 1);
      } else {
        continue;
      }
      depth[at(x, y)] = depths[at(from[0], from[1])];
      out.object[at(x, y)] = objects[at(from[0], from[1])];
    }
  }
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (depth[at(x, y)] > 0) out.layer.vertex(x, y) = unproject_pixel(in.intrinsics, x, y, depth[at(x, y)]);
    }
  }
  for (int y = 0; y + 1 < shape.height; ++y) {
    for (int x = 0; x + 1 < shape.width; ++x) {
      std::map<std::uint32_t, int> corners;
      for (int k = 0; k < 4; ++k) ++corners[out.object[at(x + (k & 1), y + (k >> 1))]];
      for (const auto& [own, n] : corners) {
        if (own == 0 || n < 3) continue;
        const auto z = [&](int i, int j, std::uint32_t id) {
          return out.object[at(i, j)] == id ? depth[at(i, j)] : 0.0F;
        };
        out.layer.quad(x, y) = connect_quad(z(x, y, own), z(x + 1, y, own), z(x, y + 1, own), z(x + 1, y + 1, own));
      }
    }
  }
  return out;
}

struct Mesh {
  std::vector<Vec3f> vertices;
  std::vector<Face> faces;
  std::vector<std::uint32_t> pixels;
};

// Vertices in raster order; the faces around a vertex, clockwise from the edge above, get one copy for each stretch of
// them in which each shares an edge with the next, and the copies follow one another in the order of where they begin.
[[nodiscard]] inline Mesh index_layer(const SheetLayer& layer) {
  const Shape shape = layer.vertices.shape();
  Mesh mesh;
  struct Corner {
    int quad_x, quad_y;
    bool upper;
  };
  // The faces at the vertex (x, y) in clockwise order: of two in one quad the one that comes first.
  const auto faces_around = [&](int x, int y) {
    std::vector<Corner> slots(8, Corner{0, 0, false});
    std::vector<bool> there(8, false);
    const int quad[4][2] = {{x, y - 1}, {x, y}, {x - 1, y}, {x - 1, y - 1}};  // from the edge above: C, A, B, D
    for (int k = 0; k < 4; ++k) {
      const int i = quad[k][0];
      const int j = quad[k][1];
      if (layer.quads.data() == nullptr || !layer.quads.contains(i, j)) continue;
      const std::uint8_t q = layer.quads(i, j);
      const bool anti = (q & kQuadAntiDiagonal) != 0;
      const bool left_is_upper = anti;  // B-C cuts off A, with the left and the top edge
      const bool by_corner[4][2] = {
          {left_is_upper, false}, {true, left_is_upper}, {!left_is_upper, true}, {false, !left_is_upper}};
      for (int e = 0; e < 2; ++e) {
        const bool upper = by_corner[k][e];
        const auto slot = static_cast<std::size_t>(2 * k + e);
        there[slot] = (q & (upper ? kQuadUpperFace : kQuadLowerFace)) != 0;
        slots[slot] = {i, j, upper};
      }
    }
    return std::make_pair(slots, there);
  };
  std::map<std::tuple<int, int, bool, int, int>, std::uint32_t> number;  // of the vertex (x, y) in a face
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      const auto [slots, there] = faces_around(x, y);
      const bool whole = std::find(there.begin(), there.end(), false) == there.end();
      for (std::size_t k = 0; k < 8; ++k) {
        if (!there[k] || (whole ? k != 0 : there[(k + 7) % 8])) continue;
        for (std::size_t step = 0; step < 8 && there[(k + step) % 8]; ++step) {
          const Corner& c = slots[(k + step) % 8];
          number[{c.quad_x, c.quad_y, c.upper, x, y}] = static_cast<std::uint32_t>(mesh.vertices.size());
        }
        mesh.vertices.push_back(layer.vertices(x, y));
        mesh.pixels.push_back(static_cast<std::uint32_t>(y * shape.width + x));
      }
    }
  }
  for (int y = 0; y < layer.quads.height(); ++y) {
    for (int x = 0; x < layer.quads.width(); ++x) {
      const std::uint8_t q = layer.quads(x, y);
      for (const bool upper : {true, false}) {
        if ((q & (upper ? kQuadUpperFace : kQuadLowerFace)) == 0) continue;
        const Face f = quad_face((q & kQuadAntiDiagonal) != 0, upper, 0, 1, 2, 3);
        const auto vertex = [&, px = x, py = y](std::uint32_t corner) {
          return number.at({px, py, upper, px + static_cast<int>(corner & 1U), py + static_cast<int>(corner >> 1U)});
        };
        mesh.faces.push_back({vertex(f.a), vertex(f.b), vertex(f.c)});
      }
    }
  }
  return mesh;
}

}  // namespace reference
}  // namespace npsim

#endif  // NPSIM_TESTS_REFERENCE_MESH_LAYERS_HPP
