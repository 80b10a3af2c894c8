// SPDX-License-Identifier: Apache-2.0
#include "greycard_command.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>

#include "npsim/color/srgb.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/pfm.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/light/photometry.hpp"
#include "npsim/sensor/exposure.hpp"
#include "tool/options.hpp"

namespace npsim::tool {
namespace {

[[nodiscard]] Vec3<int> codes(const Rgb8& p) { return {p.r, p.g, p.b}; }
[[nodiscard]] Vec3<int> codes(const io::Rgb16& p) { return {p[0], p[1], p[2]}; }

template <class Pixel>
[[nodiscard]] io::Image<Vec3f> scaled_to_one(const io::Image<Pixel>& picture, float full, bool linear) {
  const auto value = [&](float code) { return linear ? code / full : srgb_decode(code / full); };
  io::Image<Vec3f> out(picture.shape());
  for (std::size_t i = 0; i < picture.shape().pixels(); ++i) {
    const Vec3f p = vec_cast<float>(codes(picture.data()[i]));
    out.data()[i] = {value(p.x), value(p.y), value(p.z)};
  }
  return out;
}

// 16 bits where the file has them.
[[nodiscard]] io::Expected<io::Image<Vec3f>> read_linear(const std::string& path, bool linear) {
  const std::string ending = std::filesystem::path(path).extension().string();
  if (ending == ".pfm") return io::read_pfm_rgb(path);
  if (ending == ".png") {
    const io::Expected<io::Image<io::Rgb16>> picture = io::read_rgb16(path);
    if (!picture) return picture.error();
    return scaled_to_one(picture.value(), 65535.0F, linear);
  }
  const io::Expected<io::Image<Rgb8>> picture = io::read_rgb8(path);
  if (!picture) return picture.error();
  return scaled_to_one(picture.value(), 255.0F, linear);
}

}  // namespace

io::Expected<std::array<int, 4>> parse_card(const std::string& text, Shape image) {
  std::array<int, 4> card{};
  const char* at = text.data();
  const char* const end = at + text.size();
  bool good = true;
  for (std::size_t i = 0; i < 4 && good; ++i) {
    const std::from_chars_result r = std::from_chars(at, end, card[i]);
    good = r.ec == std::errc() && (i < 3 ? r.ptr != end && *r.ptr == ',' : r.ptr == end);
    at = good && i < 3 ? r.ptr + 1 : r.ptr;
  }
  const auto [x0, y0, x1, y1] = card;
  good = good && x0 >= 0 && y0 >= 0 && x1 > x0 && y1 > y0 && x1 <= image.width && y1 <= image.height;
  if (good) return card;
  return io::Error{"", "--card",
                   "is '" + text + "', expected x0,y0,x1,y1 with x0 < x1 and y0 < y1 inside the picture of " +
                       io::size_text(image) + " pixels"};
}

io::Expected<CardMeasure> measure_card(const std::string& file, ImageView<const Vec3f> linear,
                                       const std::array<int, 4>& card) {
  const auto [x0, y0, x1, y1] = card;
  Vec3d sum;
  std::size_t pixels = 0;
  std::size_t clipped = 0;
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) {
      const Vec3f p = linear(x, y);
      if (!is_finite(p)) return io::Error{file, "card", "has a pixel that is no number, expected finite ones"};
      clipped += std::max({p.x, p.y, p.z}) >= 0.99F ? 1U : 0U;
      sum += vec_cast<double>(p);
      ++pixels;
    }
  }
  if (pixels < 64) {
    return io::Error{file, "card", "has " + std::to_string(pixels) + " pixels, expected 64 or more"};
  }
  if (clipped * 1000 > pixels) {
    return io::Error{file, "card",
                     std::to_string(clipped) + " of its " + std::to_string(pixels) +
                         " pixels are at full scale, expected a shorter exposure"};
  }
  const Vec3d mean = sum / static_cast<double>(pixels);
  if (!(mean.y > 1e-4)) return io::Error{file, "card", "is black in the green channel, expected a longer exposure"};
  return CardMeasure{static_cast<double>(luminance(vec_cast<float>(mean))), mean.x / mean.y, mean.z / mean.y, pixels};
}

int run_greycard(const GreycardOptions& options) {
  const io::Expected<io::Image<Vec3f>> picture = read_linear(options.image, options.linear);
  if (!picture) return fail(picture.error());
  const io::Expected<std::array<int, 4>> card = parse_card(options.card, picture.value().shape());
  if (!card) return fail(card.error());
  const bool exposed = options.iso > 0 && options.f_number > 0 && options.time_s > 0;
  if (!exposed && (options.iso > 0 || options.f_number > 0 || options.time_s > 0 || options.distance_m > 0)) {
    return fail(
        io::Error{"", "--iso, --f-number, --time", "expected all three of an exposure, or none and no distance"});
  }
  const io::Expected<CardMeasure> measured = measure_card(options.image, picture.value().view(), card.value());
  if (!measured) return fail(measured.error());
  const CardMeasure& m = measured.value();
  const Vec2f xy = light_xy({static_cast<float>(m.r_g), 1.0F, static_cast<float>(m.b_g)});
  std::printf("s    %.5f of full scale, mean of %zu pixels\nr/g  %.4f\nb/g  %.4f\nxy   %.4f %.4f\n", m.s, m.pixels,
              m.r_g, m.b_g, static_cast<double>(xy.x), static_cast<double>(xy.y));
  if (exposed) {
    CameraExposure camera;
    camera.iso = options.iso;
    camera.f_number = options.f_number;
    camera.time_s = options.time_s;
    if (const Status status = validate(camera); !status.ok()) return fail("--iso, --f-number, --time", status);
    // A matt card of luminance L has pi L / reflectance lx.
    constexpr double kPi = 3.14159265358979324;
    const double lx = kPi * m.s / static_cast<double>(signal_per_luminance(camera) * options.reflectance);
    std::printf("E    %.4g lx on the card\n", lx);
    const auto d = static_cast<double>(options.distance_m);
    if (d > 0) std::printf("I    %.4g cd of a lamp at %g m\n", lx * d * d, d);
  }
  return kExitDone;
}

}  // namespace npsim::tool
