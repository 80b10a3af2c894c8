// SPDX-License-Identifier: Apache-2.0
#include "simple_fill.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "npsim/core/camera.hpp"

namespace npsim::tool {
namespace {

struct Point {
  std::int64_t x = 0;
  std::int64_t y = 0;
  double w = 0;  // 1 / depth
};

// Twice the area of a triangle; positive if a, b, c turn as x turns to y.
[[nodiscard]] std::int64_t area(const Point& a, const Point& b, const Point& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

[[nodiscard]] bool in_circle(const Point& a, const Point& b, const Point& c, const Point& p) {
  const std::int64_t ax = a.x - p.x;
  const std::int64_t ay = a.y - p.y;
  const std::int64_t bx = b.x - p.x;
  const std::int64_t by = b.y - p.y;
  const std::int64_t cx = c.x - p.x;
  const std::int64_t cy = c.y - p.y;
  return (ax * ax + ay * ay) * (bx * cy - by * cx) - (bx * bx + by * by) * (ax * cy - ay * cx) +
             (cx * cx + cy * cy) * (ax * by - ay * bx) >
         0;
}

// Incremental (Bowyer 1981, Watson 1981): a new point replaces all triangles whose circle holds it by a fan.
class Delaunay {
 public:
  // The first four points are the corners of a rectangle, in order around it; all others lie within.
  explicit Delaunay(const std::vector<Point>& points) : points_(points) {
    triangles_ = {{{0, 1, 2}, {-1, -1, 1}}, {{0, 2, 3}, {0, -1, -1}}};
    for (int p = 4; p < static_cast<int>(points.size()); ++p) insert(p);
  }

  // 1/z at a position; where the last search ended is where this one begins.
  [[nodiscard]] double at(std::int64_t x, std::int64_t y) {
    const Point p{x, y, 0};
    const Triangle& t = triangles_[static_cast<std::size_t>(locate(p))];
    const Point& a = corner(t, 0);
    const Point& b = corner(t, 1);
    const Point& c = corner(t, 2);
    const double whole = static_cast<double>(area(a, b, c));
    return (static_cast<double>(area(p, b, c)) * a.w + static_cast<double>(area(a, p, c)) * b.w +
            static_cast<double>(area(a, b, p)) * c.w) /
           whole;
  }

 private:
  struct Triangle {
    std::array<int, 3> point;
    std::array<int, 3> beyond;  // the triangle across the edge from point i to i + 1; -1: none
  };
  struct Edge {
    int from, to, beyond;
  };

  [[nodiscard]] const Point& corner(const Triangle& t, std::size_t i) const {
    return points_[static_cast<std::size_t>(t.point[i])];
  }
  [[nodiscard]] int locate(const Point& p) {
    for (bool moved = true; moved;) {
      moved = false;
      const Triangle& t = triangles_[static_cast<std::size_t>(last_)];
      for (std::size_t i = 0; i < 3 && !moved; ++i) {
        if (area(corner(t, i), corner(t, (i + 1) % 3), p) >= 0 || t.beyond[i] < 0) continue;
        last_ = t.beyond[i];
        moved = true;
      }
    }
    return last_;
  }
  void insert(int index) {
    const Point& p = points_[static_cast<std::size_t>(index)];
    std::vector<int> cavity = {locate(p)};
    std::vector<Edge> rim;
    const auto inside = [&](int t) { return std::find(cavity.begin(), cavity.end(), t) != cavity.end(); };
    for (std::size_t k = 0; k < cavity.size(); ++k) {
      for (const int next : triangles_[static_cast<std::size_t>(cavity[k])].beyond) {
        if (next < 0 || inside(next)) continue;
        const Triangle& t = triangles_[static_cast<std::size_t>(next)];
        if (in_circle(corner(t, 0), corner(t, 1), corner(t, 2), p)) cavity.push_back(next);
      }
    }
    for (const int k : cavity) {
      const Triangle& t = triangles_[static_cast<std::size_t>(k)];
      for (std::size_t i = 0; i < 3; ++i) {
        if (t.beyond[i] < 0 || !inside(t.beyond[i])) rim.push_back({t.point[i], t.point[(i + 1) % 3], t.beyond[i]});
      }
    }
    // The rim is one closed path: a triangle for each edge, joined with those of the edges before and behind it.
    std::vector<int> made(rim.size());
    for (std::size_t k = 0; k < rim.size(); ++k) {
      made[k] = k < cavity.size() ? cavity[k] : static_cast<int>(triangles_.size() + k - cavity.size());
    }
    triangles_.resize(triangles_.size() + rim.size() - cavity.size());
    for (std::size_t k = 0; k < rim.size(); ++k) {
      const Edge& e = rim[k];
      Triangle& t = triangles_[static_cast<std::size_t>(made[k])];
      t.point = {e.from, e.to, index};
      t.beyond = {e.beyond, -1, -1};
      for (std::size_t other = 0; other < rim.size(); ++other) {
        if (rim[other].from == e.to) t.beyond[1] = made[other];
        if (rim[other].to == e.from) t.beyond[2] = made[other];
      }
      if (e.beyond < 0) continue;
      Triangle& outer = triangles_[static_cast<std::size_t>(e.beyond)];
      for (std::size_t i = 0; i < 3; ++i) {
        if (outer.point[i] == e.to && outer.point[(i + 1) % 3] == e.from) outer.beyond[i] = made[k];
      }
    }
    last_ = made[0];
  }

  const std::vector<Point>& points_;
  std::vector<Triangle> triangles_;
  int last_ = 0;
};

// Position along the curve that goes through ever smaller quarters: near in it is near in the image.
[[nodiscard]] std::uint64_t along_quarters(const Point& p) {
  std::uint64_t key = 0;
  for (unsigned bit = 0; bit < 16; ++bit) {
    key |= ((static_cast<std::uint64_t>(p.x) >> bit) & 1U) << (2 * bit);
    key |= ((static_cast<std::uint64_t>(p.y) >> bit) & 1U) << (2 * bit + 1);
  }
  return key;
}

[[nodiscard]] bool beside_missing(ImageView<const float> depth, int x, int y) {
  for (int j = y - 1; j <= y + 1; ++j) {
    for (int i = x - 1; i <= x + 1; ++i) {
      if (!depth.contains(i, j) || !is_valid_depth(depth(i, j))) return true;
    }
  }
  return false;
}

}  // namespace

io::Image<float> filled_by_nearest(ImageView<const float> depth) {
  const Shape shape = depth.shape();
  // Per column the nearest sample above or at, and below; then over columns outward until none can be nearer.
  constexpr int kNoRow = std::numeric_limits<int>::max();
  io::Image<int> row_of(shape);  // of the sample of the same column that is nearest
  for (int x = 0; x < shape.width; ++x) {
    int above = kNoRow;
    for (int y = 0; y < shape.height; ++y) {
      above = is_valid_depth(depth(x, y)) ? y : above;
      row_of(x, y) = above;
    }
    int below = kNoRow;
    for (int y = shape.height - 1; y >= 0; --y) {
      below = is_valid_depth(depth(x, y)) ? y : below;
      const bool nearer = below != kNoRow && (row_of(x, y) == kNoRow || below - y < y - row_of(x, y));
      if (nearer) row_of(x, y) = below;
    }
  }
  io::Image<float> out(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      std::int64_t best = std::numeric_limits<std::int64_t>::max();
      out(x, y) = 0.0F;
      const auto look = [&](int i) {
        if (i < 0 || i >= shape.width || row_of(i, y) == kNoRow) return;
        const std::int64_t dx = i - x;
        const std::int64_t dy = row_of(i, y) - y;
        if (dx * dx + dy * dy >= best) return;
        best = dx * dx + dy * dy;
        out(x, y) = depth(i, row_of(i, y));
      };
      for (std::int64_t reach = 0; reach < shape.width && reach * reach < best; ++reach) {
        look(x - static_cast<int>(reach));
        look(x + static_cast<int>(reach));
      }
    }
  }
  return out;
}

io::Image<float> filled_linearly(ImageView<const float> depth) {
  const Shape shape = depth.shape();
  const io::Image<float> nearest = filled_by_nearest(depth);
  const int right = shape.width - 1;
  const int bottom = shape.height - 1;
  if (depth.empty() || !(nearest(0, 0) > 0.0F)) return io::Image<float>(shape);
  const auto inverse = [&](int x, int y) { return 1.0 / static_cast<double>(nearest(x, y)); };
  std::vector<Point> points = {{-1, -1, inverse(0, 0)},
                               {shape.width, -1, inverse(right, 0)},
                               {shape.width, shape.height, inverse(right, bottom)},
                               {-1, shape.height, inverse(0, bottom)}};
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      if (is_valid_depth(depth(x, y)) && beside_missing(depth, x, y)) points.push_back({x, y, inverse(x, y)});
    }
  }
  std::sort(points.begin() + 4, points.end(),
            [](const Point& a, const Point& b) { return along_quarters(a) < along_quarters(b); });
  Delaunay mesh(points);
  io::Image<float> out(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      out(x, y) = is_valid_depth(depth(x, y)) ? depth(x, y) : static_cast<float>(1.0 / mesh.at(x, y));
    }
  }
  return out;
}

}  // namespace npsim::tool
