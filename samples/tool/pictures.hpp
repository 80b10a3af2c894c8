// SPDX-License-Identifier: Apache-2.0
// Pictures for people: coloured depth, normals, masks, and the contact sheet.
#ifndef NPSIM_SAMPLES_TOOL_PICTURES_HPP
#define NPSIM_SAMPLES_TOOL_PICTURES_HPP

#include <stb/stb_easy_font.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/io/image.hpp"

namespace npsim::tool {

[[nodiscard]] inline std::uint8_t to_byte(float v) {
  return static_cast<std::uint8_t>(std::clamp(v, 0.0F, 1.0F) * 255.0F + 0.5F);
}

// Near is warm and bright, far is dark and blue; t in [0, 1]. Brightness falls monotonically, so it also reads in grey.
[[nodiscard]] inline Rgb8 depth_colour(float t) {
  static constexpr std::array<std::array<float, 3>, 6> kStops = {{{0.99F, 0.95F, 0.65F},
                                                                  {0.98F, 0.68F, 0.25F},
                                                                  {0.86F, 0.36F, 0.30F},
                                                                  {0.58F, 0.20F, 0.46F},
                                                                  {0.29F, 0.13F, 0.45F},
                                                                  {0.06F, 0.05F, 0.18F}}};
  const float s = std::clamp(t, 0.0F, 1.0F) * static_cast<float>(kStops.size() - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(s), kStops.size() - 2);
  const float f = s - static_cast<float>(i);
  const auto mix = [&](std::size_t c) { return to_byte(kStops[i][c] * (1 - f) + kStops[i + 1][c] * f); };
  return {mix(0), mix(1), mix(2)};
}

// Logarithmic from 3 m to 120 m, the same scale for every picture so that before and after compare; missing is grey.
[[nodiscard]] inline io::Image<Rgb8> depth_picture(ImageView<const float> depth) {
  io::Image<Rgb8> out(depth.shape(), Rgb8{90, 90, 90});
  const float log_near = std::log(3.0F);
  const float log_far = std::log(120.0F);
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      const float z = depth(x, y);
      if (is_valid_depth(z)) out(x, y) = depth_colour((std::log(z) - log_near) / (log_far - log_near));
    }
  }
  return out;
}

// The same for what a sensor measured: points of a laser, fewer than a fifth of the pixels, as dots that are still seen
// where the picture is made smaller. The nearer hides the farther.
[[nodiscard]] inline io::Image<Rgb8> measured_picture(ImageView<const float> depth) {
  const auto measured = std::count_if(depth.pixels().begin(), depth.pixels().end(), is_valid_depth);
  const int radius = 5 * static_cast<std::size_t>(measured) < depth.shape().pixels() ? depth.width() / 600 : 0;
  if (radius == 0) return depth_picture(depth);
  io::Image<float> dots(depth.shape(), 0.0F);
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      const float z = depth(x, y);
      if (!is_valid_depth(z)) continue;
      for (int j = std::max(0, y - radius); j <= std::min(depth.height() - 1, y + radius); ++j) {
        for (int i = std::max(0, x - radius); i <= std::min(depth.width() - 1, x + radius); ++i) {
          float& at = dots(i, j);
          at = is_valid_depth(at) ? std::min(at, z) : z;
        }
      }
    }
  }
  return depth_picture(dots.view());
}

// The usual map of a normal to a colour, x right, y up, z towards the camera; no normal is black.
[[nodiscard]] inline io::Image<Rgb8> normal_picture(ImageView<const Vec3f> normals) {
  io::Image<Rgb8> out(normals.shape());
  for (int y = 0; y < normals.height(); ++y) {
    for (int x = 0; x < normals.width(); ++x) {
      const Vec3f n = normals(x, y);
      if (n == Vec3f{}) continue;
      out(x, y) = {to_byte(0.5F + 0.5F * n.x), to_byte(0.5F - 0.5F * n.y), to_byte(0.5F - 0.5F * n.z)};
    }
  }
  return out;
}

// The photograph, darkened, with the mask in yellow as in the thesis' figures.
[[nodiscard]] inline io::Image<Rgb8> mask_picture(ImageView<const Rgb8> day, ImageView<const std::uint8_t> mask) {
  io::Image<Rgb8> out(day.shape());
  for (int y = 0; y < day.height(); ++y) {
    for (int x = 0; x < day.width(); ++x) {
      const Rgb8 c = day(x, y);
      const auto dim = [](std::uint8_t v) { return static_cast<std::uint8_t>(v / 3); };
      out(x, y) = mask(x, y) != 0 ? Rgb8{250, 220, 40} : Rgb8{dim(c.r), dim(c.g), dim(c.b)};
    }
  }
  return out;
}

struct Panel {
  std::string title;
  io::Image<Rgb8> picture;
};

// Box-filtered to at most the given width; pictures are only ever made smaller.
[[nodiscard]] inline io::Image<Rgb8> shrunk(const io::Image<Rgb8>& in, Shape to) {
  if (in.shape() == to) return in;
  io::Image<Rgb8> out(to);
  for (int y = 0; y < to.height; ++y) {
    const int y0 = static_cast<int>(static_cast<long long>(y) * in.height() / to.height);
    const int y1 = std::max(y0 + 1, static_cast<int>(static_cast<long long>(y + 1) * in.height() / to.height));
    for (int x = 0; x < to.width; ++x) {
      const int x0 = static_cast<int>(static_cast<long long>(x) * in.width() / to.width);
      const int x1 = std::max(x0 + 1, static_cast<int>(static_cast<long long>(x + 1) * in.width() / to.width));
      int r = 0;
      int g = 0;
      int b = 0;
      for (int j = y0; j < y1; ++j) {
        for (int i = x0; i < x1; ++i) {
          r += in(i, j).r;
          g += in(i, j).g;
          b += in(i, j).b;
        }
      }
      const int n = (y1 - y0) * (x1 - x0);
      out(x, y) = {static_cast<std::uint8_t>((r + n / 2) / n), static_cast<std::uint8_t>((g + n / 2) / n),
                   static_cast<std::uint8_t>((b + n / 2) / n)};
    }
  }
  return out;
}

// Text as filled rectangles, `scale` pixels a dot.
inline void draw_text(io::Image<Rgb8>& out, int left, int top, int scale, std::string text, Rgb8 colour) {
  struct Corner {
    float x, y, z;
    unsigned char rgba[4];
  };
  std::vector<Corner> corners(text.size() * 64 + 4);
  const int quads = stb_easy_font_print(0, 0, text.data(), nullptr, corners.data(),
                                        static_cast<int>(corners.size() * sizeof(Corner)));
  for (int q = 0; q < quads; ++q) {
    const Corner* c = &corners[static_cast<std::size_t>(q) * 4];
    const int x0 = left + static_cast<int>(c[0].x) * scale;
    const int y0 = top + static_cast<int>(c[0].y) * scale;
    const int x1 = left + static_cast<int>(c[2].x) * scale;
    const int y1 = top + static_cast<int>(c[2].y) * scale;
    for (int y = std::max(0, y0); y < std::min(out.height(), y1); ++y) {
      for (int x = std::max(0, x0); x < std::min(out.width(), x1); ++x) out(x, y) = colour;
    }
  }
}

// All panels in rows of three, each with its title, shrunk to a common width.
[[nodiscard]] inline io::Image<Rgb8> contact_sheet(const std::vector<Panel>& panels, int columns = 3) {
  constexpr int kMargin = 8;
  constexpr int kTitle = 26;
  if (panels.empty()) return {};
  const Shape first = panels.front().picture.shape();
  const int width = std::min(first.width, 640);
  const int height = std::max(1, static_cast<int>(static_cast<long long>(first.height) * width / first.width));
  const int rows = (static_cast<int>(panels.size()) + columns - 1) / columns;
  io::Image<Rgb8> out({kMargin + columns * (width + kMargin), kMargin + rows * (height + kTitle + kMargin)},
                      Rgb8{18, 18, 20});
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const int left = kMargin + static_cast<int>(i) % columns * (width + kMargin);
    const int top = kMargin + static_cast<int>(i) / columns * (height + kTitle + kMargin);
    draw_text(out, left + 2, top + 6, 2, panels[i].title, Rgb8{225, 225, 220});
    const io::Image<Rgb8> picture = shrunk(panels[i].picture, {width, height});
    for (int y = 0; y < height; ++y) {
      std::copy_n(picture.view().row(y), width, out.view().row(top + kTitle + y) + left);
    }
  }
  return out;
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_PICTURES_HPP
