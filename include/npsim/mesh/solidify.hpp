// SPDX-License-Identifier: Apache-2.0
// Objects with a back: closes the front sides of objects, all that a photograph shows of them, into solids.
//
// Without a back a car seen from the front is a shell: light of a lamp behind it passes through where its body should
// be. Every vertex of the front gets one behind it on the same ray of the camera, every face its mirror image between
// those, and every edge on the rim two faces that join front and back. The camera never sees any of it, as it lies in
// the shadow of the front; no visible point comes to lie inside a solid.
//
// Thickness: one rule per label, in metres along the ray. These are typical sizes; a thing of another size is wrong by
// the difference. A back then stays in front of the background of its pixel and above the ground where these are known,
// so that a car does not stick in the wall behind it nor in the road; it always stays min_relative behind the front,
// which wins where both cannot be had.
//
// Vehicles fill an upright box, of which one camera sees two sides at most.
// Heading: a vehicle's sides stand at right angles, so their horizontal normals agree when the angle is taken four
// times: the mean of w exp(4 i angle) over the faces, w = area as the camera sees it times depth squared, times the
// squared horizontal share of the normal. Area on the surface would let a ramp of wrong depth, which is all but
// parallel to the view, outvote the side. A vote of share street_weight for the camera's direction on the ground
// decides where the faces have nothing to say.
// Which of the two axes is the length: the one along which more is seen than any width explains; else the one nearer
// to the camera's direction on the ground, as traffic and parking mostly run along the street.
// Extent: the visible vertices span [low, high] along each axis, outlier_share at either end left out. A side seen over
// full_side of its nominal size is taken as it is. Else the box has its nominal size and extends away from the camera
// from the side that faces it; along an axis on which the camera stands abreast of the vehicle, to both sides alike.
// Error: on exact depth of a box of nominal size seen on two sides its outline lies within 0.65 m (test); the headings
// of cars and buses are within 3 degrees on the exact depth of four generated streets and within 3.5 on the refined
// depth of two, most within 1.5. A bicycle shows too few faces for a heading: it stands along the street.
//
// Invariants: an oriented manifold in gives closed oriented manifolds out, one for each of its components, holes
// through an object included; no face is flat, as the rays of its vertices differ; vertex i's back is number
// first_vertex + count + i, at 1 + min_relative times its depth or more; order is that of the front, whatever the
// executor does; no trigonometry, so the same bits everywhere.
// A front that is not such a manifold is refused: an edge with a third face or with two in one direction, a vertex
// where two fans meet, an index or pixel out of range, a vertex that is not finite and in front of the camera.
// Cost: linear (edges are matched within the few at one vertex), for round and soft things times their width in pixels;
// serial but for the thickness. Memory: a byte a face and four a vertex, and the greater of 12 a face
// and 5 a vertex for the rims, or of 4 a pixel and at most 40 a vertex for the thickness. Error of arithmetic: on the
// ray to 2^-23 of the depth, along it 1e-6.
#ifndef NPSIM_MESH_SOLIDIFY_HPP
#define NPSIM_MESH_SOLIDIFY_HPP

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/core/workspace.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/geometry/triangle_mesh.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/mesh/index.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

enum class BackShape : std::uint8_t {
  plate,  // thickness length_m everywhere
  round,  // as thick as wide where the pixel is (the shorter of its runs along row and column), length_m at most
  soft,   // as round, but tapering to nothing towards the rim as an ellipse does; runs count to length_m either way
  box     // the far sides of an upright box, length_m x width_m, that stands where the visible sides stand
};

struct BackRule {
  BackShape shape = BackShape::round;
  float length_m = 0.5F;
  float width_m = 0.0F;  // of a box
  // Above this height the far end and the far side of a box lie nearer, as those of a car's cabin do. 0: they do not.
  float belt_m = 0.0F;
  float cabin_end_m = 0.0F;
  float cabin_side_m = 0.0F;
  float clearance_m = 0.0F;  // between its underside and the ground, where the ground is known
};

struct SolidifyParams {
  // Typical sizes. Cars: mean length of new cars in Europe 4.4 to 4.5 m, width without mirrors 1.8 m (ICCT European
  // vehicle market statistics); windows from 1 m up, the roof 0.9 m shorter at the far end, which is bonnet as often as
  // boot, and 0.2 m narrower on a side; the underside 0.15 m above the ground, as that of most cars. Buses: 12 m x
  // 2.55 m, the commonest city bus, at the width limit of EU directive 96/53; trucks in towns are shorter than that
  // directive's 12 m: 8 m x 2.5 m. A car of a tram or train: 2.65 m wide, of which a street scene shows about 25 m.
  // Motorcycle 2.1 m x 0.7 m, bicycle 1.8 m long and, being mostly air beside its handlebars, 0.3 m wide. Persons:
  // shoulder breadth 0.4 to 0.5 m, depth 0.25 to 0.3 m (ISO 7250), so 0.4 m from an unknown side, and limbs as thick as
  // wide. Signs are sheets on a 3 cm frame, fences of 5 cm. A pole is round; 0.6 m bounds advertising columns and the
  // heads of lamps.
  std::array<BackRule, kLabelCount> rules = [] {
    std::array<BackRule, kLabelCount> r{};
    r[label::car] = {BackShape::box, 4.5F, 1.8F, 1.0F, 0.9F, 0.2F, 0.15F};
    r[label::truck] = {BackShape::box, 8.0F, 2.5F};
    r[label::bus] = {BackShape::box, 12.0F, 2.55F};
    r[label::caravan] = {BackShape::box, 6.0F, 2.3F};
    r[label::trailer] = {BackShape::box, 4.0F, 2.0F};
    r[label::train] = {BackShape::box, 25.0F, 2.65F};
    r[label::motorcycle] = {BackShape::box, 2.1F, 0.7F};
    r[label::bicycle] = {BackShape::box, 1.8F, 0.3F};
    r[label::person] = r[label::rider] = {BackShape::round, 0.4F, 0.0F};
    r[label::pole] = r[label::polegroup] = {BackShape::round, 0.6F, 0.0F};
    r[label::traffic_light] = {BackShape::round, 0.35F, 0.0F};
    r[label::traffic_sign] = {BackShape::plate, 0.03F, 0.0F};
    r[label::fence] = r[label::guard_rail] = {BackShape::plate, 0.05F, 0.0F};
    r[label::vegetation] = {BackShape::soft, 3.0F, 0.0F};
    r[label::terrain] = {BackShape::soft, 1.0F, 0.0F};
    return r;
  }();
  float min_relative = 1e-3F;    // a back lies at least this share of the depth behind its front
  float background_gap = 5e-3F;  // and ends this share of its depth before the background of its pixel
  float ground_gap_m = 0.02F;    // and this far above the ground plane, or its clearance
  float outlier_share = 0.01F;   // of a vehicle's vertices at either end of an extent, taken for errors of depth
  float full_side = 0.85F;       // a side seen over this share of its nominal size is taken to be all of it
  float street_weight = 0.05F;   // of the prior that vehicles stand along or across the street, see above
};

[[nodiscard]] inline Status validate(const SolidifyParams& p) noexcept {
  bool good = p.min_relative >= 1e-5F && p.min_relative <= 0.5F && p.background_gap >= 0.0F &&
              p.background_gap < 1.0F && p.ground_gap_m >= 0.0F && std::isfinite(p.ground_gap_m) &&
              p.outlier_share >= 0.0F && p.outlier_share < 0.5F && p.full_side > 0.0F && p.full_side <= 1.0F &&
              p.street_weight >= 0.0F && p.street_weight <= 1.0F;
  for (const BackRule& r : p.rules) {
    good = good && r.length_m >= 0.0F && r.length_m <= 1e3F && r.width_m >= 0.0F && r.width_m <= 1e3F &&
           r.belt_m >= 0.0F && r.belt_m <= 1e3F && r.cabin_end_m >= 0.0F && r.cabin_end_m <= 1e3F &&
           r.cabin_side_m >= 0.0F && r.cabin_side_m <= 1e3F && r.clearance_m >= 0.0F && r.clearance_m <= 1e3F &&
           (r.shape != BackShape::box || (r.width_m > 0.0F && r.length_m >= r.width_m));
  }
  return good ? Status() : Status(StatusCode::invalid_argument, "solidify: a parameter lies outside its range");
}

// The front sides of all objects, indexed: what index_layer() or a simplification of it writes. Faces count vertices
// from first_vertex on: index i is vertices[i - first_vertex].
struct SolidifyFront {
  TriangleMeshView mesh;
  Span<const std::uint32_t> pixel;  // y * width + x of each vertex
  std::uint32_t first_vertex = 0;
};

// What is known about the scene around it.
struct SolidifyScene {
  Intrinsics camera;
  ImageView<const std::uint32_t> object;  // as complete_foreground() writes it; less than the number of pixels
  ImageView<const Label> labels;
  LabelSet foreground = kForegroundLabels;  // a widened object's extra pixels have labels that do not count
  ImageView<const Vec3f> background;        // vertices of the completed background; may be empty
  Vec3f up{0.0F, -1.0F, 0.0F};              // unit, camera frame
  float camera_height_m = 0.0F;             // above the ground plane; 0 where it is not known
};

// Edges of a layer's faces that have no face on their other side. With mesh_size(layer) and back_faces() this is the
// size of the backs, before the layer is indexed.
[[nodiscard]] inline std::size_t rim_edge_count(const SheetLayer& layer) noexcept {
  const ImageView<std::uint8_t> quads = layer.quads;
  const auto has = [&](int x, int y, mesh_detail::QuadEdge edge) {
    return quads.contains(x, y) && mesh_detail::edge_has_face(quads(x, y), edge);
  };
  std::size_t n = 0;
  for (int y = 0; y <= quads.height(); ++y) {
    for (int x = 0; x <= quads.width(); ++x) {
      n += has(x, y, mesh_detail::QuadEdge::top) != has(x, y - 1, mesh_detail::QuadEdge::bottom) ? 1U : 0U;
      n += has(x, y, mesh_detail::QuadEdge::left) != has(x - 1, y, mesh_detail::QuadEdge::right) ? 1U : 0U;
      if (!quads.contains(x, y)) continue;
      const unsigned faces = quads(x, y) & (kQuadUpperFace | kQuadLowerFace);
      n += faces == kQuadUpperFace || faces == kQuadLowerFace ? 1U : 0U;
    }
  }
  return n;
}

// Faces of the backs of a front with so many faces and rim edges.
[[nodiscard]] constexpr std::size_t back_faces(std::size_t front_faces, std::size_t rim_edges) noexcept {
  return front_faces + 2 * rim_edges;
}

namespace solidify_detail {

// Sum of w exp(4 i angle) over the faces of an object, angle from `right` towards `forward`.
struct HeadingVotes {
  double cosine = 0;
  double sine = 0;
  double weight = 0;
};

}  // namespace solidify_detail

[[nodiscard]] constexpr std::size_t solidify_workspace_bytes(const SolidifyParams&, Shape shape, std::size_t vertices,
                                                             std::size_t faces) noexcept {
  const std::size_t rim = allocation_bytes<std::uint32_t>(vertices + 1) + allocation_bytes<std::uint32_t>(3 * faces) +
                          allocation_bytes<std::uint8_t>(vertices);
  const std::size_t thickness = allocation_bytes<std::uint32_t>(shape.empty() ? 0 : shape.pixels() + 1) +
                                allocation_bytes<std::uint32_t>(vertices + 1) +
                                allocation_bytes<std::uint32_t>(vertices) + allocation_bytes<float>(vertices) +
                                allocation_bytes<solidify_detail::HeadingVotes>(vertices) +
                                allocation_bytes<Label>(vertices);
  return allocation_bytes<std::uint8_t>(faces) + allocation_bytes<float>(vertices) +
         (rim > thickness ? rim : thickness) + kWorkspaceAlignment;
}

namespace solidify_detail {

// Two horizontal directions, and the interval that the box takes up along each. The camera is at 0 on both.
struct UprightBox {
  Vec3f along[2];
  float low_m[2] = {0.0F, 0.0F};
  float high_m[2] = {0.0F, 0.0F};
  int length_axis = 1;  // of the two
};

// The horizontal frame: right and forward are unit and normal to up and to each other.
struct Horizon {
  Vec3f up, right, forward;
};

[[nodiscard]] inline Horizon horizon_of(const Vec3f& up) noexcept {
  GroundPlane ground;
  ground.up = up;
  const Vec3f forward = forward_on_ground(ground);
  return {up, cross(forward, up), forward};
}

inline void vote(const Horizon& horizon, const Vec3f& a, const Vec3f& b, const Vec3f& c, HeadingVotes& votes) noexcept {
  const Vec3d pa = vec_cast<double>(a);
  const Vec3d n = cross(vec_cast<double>(b) - pa, vec_cast<double>(c) - pa);
  const double area2 = dot(n, n);
  const double view2 = dot(pa, pa);
  if (!(area2 > 0.0) || !(view2 > 0.0)) return;
  const double x = dot(n, vec_cast<double>(horizon.right));
  const double y = dot(n, vec_cast<double>(horizon.forward));
  const double level2 = x * x + y * y;
  if (!(level2 > 0.0)) return;
  const double seen = std::fabs(dot(n, pa)) / std::sqrt(view2);  // twice the area that the camera sees
  const double w = seen * (level2 / area2);
  const double c2 = (x * x - y * y) / level2;
  const double s2 = 2.0 * x * y / level2;
  votes.cosine += w * (c2 * c2 - s2 * s2);
  votes.sine += w * (2.0 * c2 * s2);
  votes.weight += w;
}

// From exp(i a) to exp(i a / 2), -90 < a / 2 <= 90 degrees.
inline void halve_angle(double& cosine, double& sine) noexcept {
  const double x = 1.0 + cosine;
  const double l = std::sqrt(x * x + sine * sine);
  if (!(l > 1e-9)) {
    cosine = 0.0;
    sine = 1.0;
    return;
  }
  cosine = x / l;
  sine = sine / l;
}

// Directions of the sides: along[0] within 45 degrees of right, along[1] within 45 degrees of forward.
inline void set_heading(const Horizon& horizon, const HeadingVotes& votes, float street_weight,
                        UprightBox& box) noexcept {
  const double prior = static_cast<double>(street_weight);
  double c = votes.cosine * (1.0 - prior) + votes.weight * prior;
  double s = votes.sine * (1.0 - prior);
  const double l = std::sqrt(c * c + s * s);
  if (l > 0.0 && std::isfinite(l)) {
    c /= l;
    s /= l;
    halve_angle(c, s);
    halve_angle(c, s);
  } else {
    c = 1.0;
    s = 0.0;
  }
  const auto x = static_cast<float>(c);
  const auto y = static_cast<float>(s);
  box.along[0] = horizon.right * x + horizon.forward * y;
  box.along[1] = horizon.forward * x - horizon.right * y;
}

// Sets the box's intervals. projected: room for as many floats as there are vertices in `members`.
inline void set_extent(const SolidifyParams& params, const BackRule& rule, Span<const Vec3f> vertices,
                       Span<const std::uint32_t> members, Span<float> projected, UprightBox& box) noexcept {
  const std::size_t n = members.size();
  const auto outliers = static_cast<std::size_t>(params.outlier_share * static_cast<float>(n - 1));
  float seen[2];
  for (int k = 0; k < 2; ++k) {
    for (std::size_t i = 0; i < n; ++i) projected[i] = dot(vertices[members[i]], box.along[k]);
    float* first = projected.data();
    select_nth(first, first + outliers, first + n);
    box.low_m[k] = first[outliers];
    select_nth(first + outliers, first + (n - 1 - outliers), first + n);
    box.high_m[k] = first[n - 1 - outliers];
    seen[k] = box.high_m[k] - box.low_m[k];
  }
  const bool right_is_length = seen[0] > seen[1] && seen[0] > 1.4F * rule.width_m;
  box.length_axis = right_is_length ? 0 : 1;
  for (int k = 0; k < 2; ++k) {
    const float nominal = k == box.length_axis ? rule.length_m : rule.width_m;
    if (seen[k] >= params.full_side * nominal) continue;
    if (box.low_m[k] > 0.0F) {
      box.high_m[k] = box.low_m[k] + nominal;
    } else if (box.high_m[k] < 0.0F) {
      box.low_m[k] = box.high_m[k] - nominal;
    } else {
      const float middle = 0.5F * (box.low_m[k] + box.high_m[k]);
      box.low_m[k] = middle - 0.5F * nominal;
      box.high_m[k] = middle + 0.5F * nominal;
    }
  }
}

// The ray from the camera through p leaves the box at this multiple of p: below 1 for a point behind the box. end_m and
// side_m are taken off its far end and side.
[[nodiscard]] inline float exit_ratio(const UprightBox& box, const Vec3f& p, float end_m, float side_m) noexcept {
  float ratio = std::numeric_limits<float>::infinity();
  for (int k = 0; k < 2; ++k) {
    const float x = dot(p, box.along[k]);
    const float inset = k == box.length_axis ? end_m : side_m;
    const float limit = x > 0.0F ? box.high_m[k] - inset : box.low_m[k] + inset;
    if (x != 0.0F) ratio = std::fmin(ratio, limit / x);
  }
  return ratio;
}

// The same of box and cabin. camera_height_m: 0 where it is not known, and then there is no cabin.
[[nodiscard]] inline float exit_ratio(const UprightBox& box, const BackRule& rule, const Vec3f& up,
                                      float camera_height_m, const Vec3f& p) noexcept {
  if (rule.belt_m > 0.0F && camera_height_m > 0.0F) {
    const float ratio = std::fmax(exit_ratio(box, p, rule.cabin_end_m, rule.cabin_side_m), 1.0F);
    if (camera_height_m + ratio * dot(up, p) > rule.belt_m) return ratio;
  }
  return exit_ratio(box, p, 0.0F, 0.0F);
}

// Pixels of one object around (x, y) along a row (dx = 1) or column (dy = 1): to either side, itself left out, at most
// `limit` each.
struct Run {
  int before = 0;
  int after = 0;
};
[[nodiscard]] inline Run run_at(ImageView<const std::uint32_t> object, int x, int y, int dx, int dy,
                                int limit) noexcept {
  const std::uint32_t own = object(x, y);
  const auto count = [&](int sx, int sy) {
    int n = 0;
    while (n < limit && object.contains(x + (n + 1) * sx, y + (n + 1) * sy) &&
           object(x + (n + 1) * sx, y + (n + 1) * sy) == own) {
      ++n;
    }
    return n;
  };
  return {count(-dx, -dy), count(dx, dy)};
}

// Thickness, m, of a thing that is as thick as wide at this pixel; limit_m bounds it.
[[nodiscard]] inline float own_thickness(const SolidifyScene& scene, bool soft, float limit_m, int x, int y,
                                         float z) noexcept {
  float thickness = limit_m;
  for (const bool row : {true, false}) {
    const float pixel_m = z / (row ? scene.camera.fx : scene.camera.fy);
    const float limit_px = limit_m / pixel_m;
    const int limit = limit_px < 16384.0F ? static_cast<int>(limit_px) + 1 : 16384;
    const Run run = run_at(scene.object, x, y, row ? 1 : 0, row ? 0 : 1, limit);
    // The ellipse over a run from 0 to w has the height 2 sqrt(s (w - s)) at s.
    const float width_px =
        soft ? 2.0F * std::sqrt((static_cast<float>(run.before) + 0.5F) * (static_cast<float>(run.after) + 0.5F))
             : static_cast<float>(run.before + run.after + 1);
    thickness = std::fmin(thickness, width_px * pixel_m);
  }
  return thickness;
}

// Objects that the front has vertices of, as bodies 0 .. count - 1 in the order of their first vertex.
struct Bodies {
  Span<std::uint32_t> of_object;  // object -> body
  Span<std::uint32_t> start;      // of each body's members, and one past the last
  Span<std::uint32_t> members;    // vertices, in order
  Span<Label> label;
  Span<HeadingVotes> votes;
};

inline constexpr std::uint32_t kNoBody = 0xFFFFFFFFU;

[[nodiscard]] inline Status collect_bodies(const SolidifyFront& front, const SolidifyScene& scene, Workspace& workspace,
                                           Bodies& bodies) {
  const std::size_t n = front.mesh.vertices.size();
  const int width = scene.object.width();
  const auto object_of = [&](std::size_t v) { return scene.object(place_of(front.pixel[v], width)); };
  NPSIM_RETURN_IF_ERROR(workspace.allocate(scene.object.shape().pixels() + 1, bodies.of_object));
  std::fill(bodies.of_object.begin(), bodies.of_object.end(), kNoBody);
  std::uint32_t count = 0;
  for (std::size_t v = 0; v < n; ++v) {
    const std::uint32_t object = object_of(v);
    if (object >= bodies.of_object.size()) {
      return {StatusCode::invalid_argument, "solidify: more objects than pixels"};
    }
    if (bodies.of_object[object] == kNoBody) bodies.of_object[object] = count++;
  }
  NPSIM_RETURN_IF_ERROR(workspace.allocate(std::size_t{count} + 1, bodies.start));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(n, bodies.members));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, bodies.label));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(count, bodies.votes));
  std::fill(bodies.start.begin(), bodies.start.end(), 0U);
  for (std::size_t v = 0; v < n; ++v) ++bodies.start[bodies.of_object[object_of(v)]];
  std::uint32_t end = 0;
  for (std::uint32_t& s : bodies.start) s = end += s;  // the ends of all, then moved down to the starts
  for (std::size_t v = n; v-- > 0;) {
    bodies.members[--bodies.start[bodies.of_object[object_of(v)]]] = static_cast<std::uint32_t>(v);
  }
  for (std::uint32_t b = 0; b < count; ++b) {
    std::array<std::uint32_t, kLabelCount> seen{};
    Label best = label::unlabeled;
    for (std::uint32_t i = bodies.start[b]; i < bodies.start[b + 1]; ++i) {
      const Label l = scene.labels(place_of(front.pixel[bodies.members[i]], width));
      if (l >= kLabelCount || !scene.foreground.contains(l)) continue;
      if (++seen[l] > seen[best]) best = l;
    }
    bodies.label[b] = best;
    bodies.votes[b] = {};
  }
  return {};
}

// ratio has one element per vertex. The front and the scene must have passed solidify()'s checks.
template <class Executor>
[[nodiscard]] Status back_ratios(const SolidifyParams& params, const SolidifyFront& front, const SolidifyScene& scene,
                                 Span<float> ratio, Workspace& workspace, Executor& executor) {
  const WorkspaceScope scope(workspace);
  Bodies bodies;
  NPSIM_RETURN_IF_ERROR(collect_bodies(front, scene, workspace, bodies));
  Span<float> projected;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(ratio.size(), projected));
  const int width = scene.object.width();
  const Horizon horizon = horizon_of(scene.up);
  const auto vertex = [&](std::uint32_t i) { return front.mesh.vertices[i - front.first_vertex]; };
  for (const Face& f : front.mesh.faces) {
    const std::uint32_t body = bodies.of_object[scene.object(place_of(front.pixel[f.a - front.first_vertex], width))];
    if (params.rules[bodies.label[body]].shape != BackShape::box) continue;
    vote(horizon, vertex(f.a), vertex(f.b), vertex(f.c), bodies.votes[body]);
  }
  executor.for_chunks(bodies.label.size(), 4, [&](std::size_t begin, std::size_t end) {
    for (std::size_t b = begin; b < end; ++b) {
      const BackRule& rule = params.rules[bodies.label[b]];
      const Span<const std::uint32_t> members(bodies.members.data() + bodies.start[b],
                                              bodies.start[b + 1] - bodies.start[b]);
      UprightBox box;
      if (rule.shape == BackShape::box) {
        set_heading(horizon, bodies.votes[b], params.street_weight, box);
        set_extent(params, rule, front.mesh.vertices, members,
                   Span<float>(projected.data() + bodies.start[b], members.size()), box);
      }
      const float diagonal = std::sqrt(rule.length_m * rule.length_m + rule.width_m * rule.width_m);
      for (const std::uint32_t v : members) {
        const Vec3f p = front.mesh.vertices[v];
        const auto [x, y] = place_of(front.pixel[v], width);
        const float distance = length(p);
        float thickness = rule.length_m;
        if (rule.shape == BackShape::round || rule.shape == BackShape::soft) {
          thickness = own_thickness(scene, rule.shape == BackShape::soft, rule.length_m, x, y, p.z);
        }
        float r = 1.0F + thickness / distance;
        if (rule.shape == BackShape::box) {
          r = std::fmin(exit_ratio(box, rule, scene.up, scene.camera_height_m, p), 1.0F + diagonal / distance);
        }
        if (!scene.background.empty() && has_vertex(scene.background(x, y))) {
          r = std::fmin(r, scene.background(x, y).z / p.z * (1.0F - params.background_gap));
        }
        const float sinking = -dot(scene.up, p);
        if (scene.camera_height_m > 0.0F && sinking > 0.0F) {
          r = std::fmin(r, (scene.camera_height_m - std::fmax(params.ground_gap_m, rule.clearance_m)) / sinking);
        }
        ratio[v] = std::fmax(r, 1.0F + params.min_relative);
      }
    }
  });
  return {};
}

[[nodiscard]] inline Status check_front(const SolidifyFront& front, const SolidifyScene& scene) noexcept {
  NPSIM_RETURN_IF_ERROR(validate(scene.camera));
  const Shape shape = scene.object.shape();
  if (scene.object.empty() || scene.labels.data() == nullptr || scene.labels.shape() != shape ||
      !mesh_detail::mask_fits(scene.background, shape)) {
    return {StatusCode::shape_mismatch, "solidify: object, labels and background must have one shape"};
  }
  if (!is_finite(scene.up) || std::fabs(length(scene.up) - 1.0F) > 1e-3F || !std::isfinite(scene.camera_height_m)) {
    return {StatusCode::invalid_argument, "solidify: up must be a unit vector and the camera's height finite"};
  }
  const std::size_t n = front.mesh.vertices.size();
  if (front.pixel.size() != n) return {StatusCode::shape_mismatch, "solidify: one pixel per vertex"};
  if (2 * n + front.first_vertex >= 0xFFFFFFFFU || front.mesh.faces.size() > 0xFFFFFFFFU / 3) {
    return {StatusCode::capacity_exceeded, "solidify handles up to 2^31 vertices and 2^32 / 3 faces"};
  }
  for (std::size_t v = 0; v < n; ++v) {
    const Vec3f p = front.mesh.vertices[v];
    if (!is_finite(p) || !has_vertex(p) || front.pixel[v] >= shape.pixels()) {
      return {StatusCode::invalid_argument, "solidify: a vertex is not finite, behind the camera or of no pixel"};
    }
  }
  for (const Face& f : front.mesh.faces) {
    for (const std::uint32_t i : {f.a, f.b, f.c}) {
      if (i < front.first_vertex || i - front.first_vertex >= n) {
        return {StatusCode::invalid_argument, "solidify: a face names a vertex that does not exist"};
      }
    }
  }
  return {};
}

[[nodiscard]] inline std::uint32_t corner_of(const Face& f, unsigned k) noexcept {
  return k == 0 ? f.a : (k == 1 ? f.b : f.c);
}

// Sets bit k of rim[f] where the edge from corner k of face f to the next has no face on its other side.
[[nodiscard]] inline Status find_rim(const SolidifyFront& front, Span<std::uint8_t> rim, std::size_t& rim_edges,
                                     Workspace& workspace) {
  const WorkspaceScope scope(workspace);
  const std::size_t n = front.mesh.vertices.size();
  const std::uint32_t first = front.first_vertex;
  Span<std::uint32_t> start;      // per vertex: of the edges that leave it
  Span<std::uint32_t> target;     // where they lead
  Span<std::uint8_t> leaves_rim;  // per vertex
  NPSIM_RETURN_IF_ERROR(workspace.allocate(n + 1, start));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(3 * front.mesh.faces.size(), target));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(n, leaves_rim));
  std::fill(start.begin(), start.end(), 0U);
  std::fill(leaves_rim.begin(), leaves_rim.end(), std::uint8_t{0});
  for (const Face& f : front.mesh.faces) {
    for (unsigned k = 0; k < 3; ++k) ++start[corner_of(f, k) - first];
  }
  std::uint32_t end = 0;
  for (std::uint32_t& s : start) s = end += s;
  for (const Face& f : front.mesh.faces) {
    for (unsigned k = 0; k < 3; ++k) target[--start[corner_of(f, k) - first]] = corner_of(f, (k + 1) % 3);
  }
  const auto count = [&](std::uint32_t from, std::uint32_t to) {
    std::size_t edges = 0;
    for (std::uint32_t i = start[from - first]; i < start[from - first + 1]; ++i) edges += target[i] == to ? 1U : 0U;
    return edges;
  };
  rim_edges = 0;
  for (std::size_t f = 0; f < front.mesh.faces.size(); ++f) {
    rim[f] = 0;
    for (unsigned k = 0; k < 3; ++k) {
      const std::uint32_t from = corner_of(front.mesh.faces[f], k);
      const std::uint32_t to = corner_of(front.mesh.faces[f], (k + 1) % 3);
      const std::size_t back = count(to, from);
      if (from == to || back > 1 || count(from, to) != 1) {
        return {StatusCode::invalid_argument, "solidify: an edge has more than two faces or two in one direction"};
      }
      if (back == 1) continue;
      if (leaves_rim[from - first]++ != 0) {
        return {StatusCode::invalid_argument, "solidify: two fans of faces meet in one vertex"};
      }
      rim[f] = static_cast<std::uint8_t>(rim[f] | (1U << k));
      ++rim_edges;
    }
  }
  return {};
}

}  // namespace solidify_detail

// Writes the backs' vertices (out.pixels those of their fronts, where not empty) and faces: mirrored fronts in the
// order of the fronts, then the rims. Indices go on from the front's. size says how much was written, or on
// capacity_exceeded how much is needed. On any error the output is untouched.
template <class Executor>
[[nodiscard]] Status solidify(const SolidifyParams& params, const SolidifyFront& front, const SolidifyScene& scene,
                              const MeshBuffers& out, MeshSize& size, Workspace& workspace, Executor& executor) {
  size = {};
  NPSIM_RETURN_IF_ERROR(validate(params));
  NPSIM_RETURN_IF_ERROR(solidify_detail::check_front(front, scene));
  const std::size_t n = front.mesh.vertices.size();
  const std::size_t faces = front.mesh.faces.size();
  const WorkspaceScope scope(workspace);
  Span<std::uint8_t> rim;
  Span<float> ratio;
  NPSIM_RETURN_IF_ERROR(workspace.allocate(faces, rim));
  NPSIM_RETURN_IF_ERROR(workspace.allocate(n, ratio));
  std::size_t rim_edges = 0;
  NPSIM_RETURN_IF_ERROR(solidify_detail::find_rim(front, rim, rim_edges, workspace));
  size = {n, back_faces(faces, rim_edges)};
  if (!have_room(out, size))
    return {StatusCode::capacity_exceeded, "solidify: the buffers are too small for the backs"};
  NPSIM_RETURN_IF_ERROR(solidify_detail::back_ratios(params, front, scene, ratio, workspace, executor));
  // A back at infinity would follow from a front there: depth times ratio overflows.
  for (std::size_t v = 0; v < n; ++v) {
    if (!is_finite(front.mesh.vertices[v] * ratio[v])) {
      return {StatusCode::invalid_argument, "solidify: a vertex is too far away for a back"};
    }
  }
  for (std::size_t v = 0; v < n; ++v) {
    out.vertices[v] = front.mesh.vertices[v] * ratio[v];
    if (out.pixels.data() != nullptr) out.pixels[v] = front.pixel[v];
  }
  const auto shift = static_cast<std::uint32_t>(n);
  std::size_t next = faces;
  for (std::size_t f = 0; f < faces; ++f) {
    const Face face = front.mesh.faces[f];
    out.faces[f] = {face.a + shift, face.c + shift, face.b + shift};
    for (unsigned k = 0; k < 3; ++k) {
      if ((rim[f] & (1U << k)) == 0) continue;
      const std::uint32_t a = solidify_detail::corner_of(face, k);
      const std::uint32_t b = solidify_detail::corner_of(face, (k + 1) % 3);
      out.faces[next++] = {b, a, a + shift};
      out.faces[next++] = {b, a + shift, b + shift};
    }
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MESH_SOLIDIFY_HPP
