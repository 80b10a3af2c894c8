// SPDX-License-Identifier: Apache-2.0
// Our image files against OpenImageIO: what we write is read back by it bit by bit, and what it writes by us.
//
//   PNG           grey and RGB of 8 bits, grey of 16, RGBA of 8: both ways. Its grey with alpha, RGB and RGBA of 16
//                 bits, every filter, and files compressed little and much: read by us.
//   PFM           1 and 3 channels: ours read by it, and files of either byte order read by both; it writes none before
//                 2.5.12. Its rows are from the top down, as ours are, whatever the file's order.
//   Radiance HDR  ours read by it: each byte is what Ward's shared exponent with rounding to nearest gives, computed
//   here
//                 in double. We read none.
// It is asked for the numbers in the file: alpha as it is, no change of colour space (it makes none unless told to).
#define DOCTEST_CONFIG_IMPLEMENT_WITH_MAIN
#include <doctest/doctest.h>

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "npsim/core/random.hpp"
#include "npsim/io/hdr.hpp"
#include "npsim/io/pfm.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "unit/io_fixture.hpp"

namespace {

using namespace npsim;
using io_test::TemporaryFolder;

// One pixel, one row, one column, odd and even, and rows longer than 8 bits count.
constexpr Shape kShapes[] = {{1, 1}, {7, 5}, {1, 40}, {8, 8}, {67, 33}, {1000, 3}, {160, 120}};

// Rows of noise, of runs, of ramps and of extremes.
template <class Sample>
std::vector<Sample> samples(Shape shape, int channels) {
  std::vector<Sample> out;
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      for (int c = 0; c < channels; ++c) {
        RandomStream r(1, RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(out.size()), 0);
        const std::uint32_t noise = r.next_u32();
        const auto ramp = static_cast<std::uint32_t>(257 * x + 3 * y + 1000 * c);
        const std::uint32_t extremes[] = {0, 0xFFFFU, 0x00FFU, 0xFF00U, 0x8000U, 0x7FFFU};
        const std::uint32_t kinds[] = {noise, static_cast<std::uint32_t>(x / 50 * 7777), ramp, extremes[noise % 6U]};
        out.push_back(static_cast<Sample>(kinds[y % 4]));
      }
    }
  }
  return out;
}

template <class Sample>
constexpr OIIO::TypeDesc type_of() {
  if constexpr (std::is_same_v<Sample, float>) return OIIO::TypeDesc::FLOAT;
  return sizeof(Sample) == 2 ? OIIO::TypeDesc::UINT16 : OIIO::TypeDesc::UINT8;
}

// The samples of a file, which must be of this type, size and number of channels.
template <class Sample>
std::vector<Sample> read_by_peer(const std::string& path, Shape shape, int channels) {
  OIIO::ImageSpec raw;
  raw.attribute("oiio:UnassociatedAlpha", 1);
  const auto in = OIIO::ImageInput::open(path, &raw);
  if (in == nullptr) FAIL(OIIO::geterror());
  const OIIO::ImageSpec& spec = in->spec();
  REQUIRE(spec.width == shape.width);
  REQUIRE(spec.height == shape.height);
  REQUIRE(spec.nchannels == channels);
  REQUIRE(spec.format == type_of<Sample>());
  std::vector<Sample> out(shape.pixels() * static_cast<std::size_t>(channels));
  REQUIRE(in->read_image(0, 0, 0, channels, type_of<Sample>(), out.data()));
  return out;
}

struct Attribute {
  const char* name;
  int value;
};

template <class Sample>
void write_by_peer(const std::string& path, Shape shape, int channels, const std::vector<Sample>& pixels,
                   const std::vector<Attribute>& attributes = {}) {
  const auto out = OIIO::ImageOutput::create(path);
  if (out == nullptr) FAIL(OIIO::geterror());
  OIIO::ImageSpec spec(shape.width, shape.height, channels, type_of<Sample>());
  spec.attribute("oiio:UnassociatedAlpha", 1);
  for (const Attribute& a : attributes) spec.attribute(a.name, a.value);
  REQUIRE(out->open(path, spec));
  REQUIRE(out->write_image(type_of<Sample>(), pixels.data()));
  REQUIRE(out->close());
}

template <class Pixel, class Sample>
ImageView<const Pixel> as_image(const std::vector<Sample>& pixels, Shape shape) {
  return ImageView<const Pixel>(reinterpret_cast<const Pixel*>(pixels.data()), shape);
}

template <class Pixel, class Sample>
bool same_bytes(const io::Expected<io::Image<Pixel>>& image, Shape shape, const std::vector<Sample>& pixels) {
  REQUIRE(image);
  REQUIRE(image.value().shape() == shape);
  REQUIRE(pixels.size() * sizeof(Sample) == shape.pixels() * sizeof(Pixel));
  return std::memcmp(image.value().data(), pixels.data(), pixels.size() * sizeof(Sample)) == 0;
}

TEST_CASE("PNG that we write is read by OpenImageIO bit by bit") {
  const TemporaryFolder folder;
  const std::string path = folder / "ours.png";
  for (const Shape shape : kShapes) {
    CAPTURE(shape.width);
    CAPTURE(shape.height);
    const auto grey = samples<std::uint8_t>(shape, 1);
    REQUIRE(io::write_png(path, as_image<std::uint8_t>(grey, shape)));
    CHECK(read_by_peer<std::uint8_t>(path, shape, 1) == grey);
    const auto rgb = samples<std::uint8_t>(shape, 3);
    REQUIRE(io::write_png(path, as_image<Rgb8>(rgb, shape)));
    CHECK(read_by_peer<std::uint8_t>(path, shape, 3) == rgb);
    const auto rgba = samples<std::uint8_t>(shape, 4);
    REQUIRE(io::write_png_rgba(path, as_image<io::Rgba8>(rgba, shape)));
    CHECK(read_by_peer<std::uint8_t>(path, shape, 4) == rgba);
    const auto wide = samples<std::uint16_t>(shape, 1);
    REQUIRE(io::write_png16(path, as_image<std::uint16_t>(wide, shape)));
    CHECK(read_by_peer<std::uint16_t>(path, shape, 1) == wide);
  }
}

TEST_CASE("PNG that OpenImageIO writes is read by us bit by bit") {
  const TemporaryFolder folder;
  const std::string path = folder / "theirs.png";
  // PNG_FILTER_NONE, SUB, UP, AVG, PAETH of png.h.
  const std::vector<Attribute> settings[] = {{},
                                             {{"png:filter", 8}},
                                             {{"png:filter", 16}},
                                             {{"png:filter", 32}},
                                             {{"png:filter", 64}},
                                             {{"png:filter", 128}},
                                             {{"png:filter", 248}, {"png:compressionLevel", 9}},
                                             {{"png:filter", 8}, {"png:compressionLevel", 0}}};
  for (const Shape shape : kShapes) {
    for (const auto& setting : settings) {
      CAPTURE(shape.width);
      CAPTURE(shape.height);
      CAPTURE(&setting - &settings[0]);
      const auto grey = samples<std::uint8_t>(shape, 1);
      write_by_peer(path, shape, 1, grey, setting);
      CHECK(same_bytes(io::read_u8(path), shape, grey));
      CHECK(same_bytes(io::read_u16(path), shape, std::vector<std::uint16_t>(grey.begin(), grey.end())));
      std::vector<std::uint8_t> spread;
      for (const std::uint8_t v : grey) spread.insert(spread.end(), 3, v);
      CHECK(same_bytes(io::read_rgb8(path), shape, spread));

      const auto wide = samples<std::uint16_t>(shape, 1);
      write_by_peer(path, shape, 1, wide, setting);
      CHECK(same_bytes(io::read_u16(path), shape, wide));
      CHECK_FALSE(io::read_u8(path));

      const auto rgb = samples<std::uint8_t>(shape, 3);
      write_by_peer(path, shape, 3, rgb, setting);
      CHECK(same_bytes(io::read_rgb8(path), shape, rgb));
      std::vector<std::uint16_t> widened;
      for (const std::uint8_t v : rgb) widened.push_back(static_cast<std::uint16_t>(257 * v));
      CHECK(same_bytes(io::read_rgb16(path), shape, widened));

      const auto rgb16 = samples<std::uint16_t>(shape, 3);
      write_by_peer(path, shape, 3, rgb16, setting);
      CHECK(same_bytes(io::read_rgb16(path), shape, rgb16));
      std::vector<std::uint8_t> cut;
      for (const std::uint16_t v : rgb16) cut.push_back(static_cast<std::uint8_t>(v >> 8));
      CHECK(same_bytes(io::read_rgb8(path), shape, cut));

      const auto rgba = samples<std::uint8_t>(shape, 4);
      write_by_peer(path, shape, 4, rgba, setting);
      CHECK(same_bytes(io::read_rgba8(path), shape, rgba));

      const auto rgba16 = samples<std::uint16_t>(shape, 4);
      write_by_peer(path, shape, 4, rgba16, setting);
      std::vector<std::uint16_t> without_alpha;
      for (std::size_t i = 0; i < rgba16.size(); ++i) {
        if (i % 4U != 3U) without_alpha.push_back(rgba16[i]);
      }
      CHECK(same_bytes(io::read_rgb16(path), shape, without_alpha));

      const auto grey_alpha = samples<std::uint8_t>(shape, 2);
      write_by_peer(path, shape, 2, grey_alpha, setting);
      spread.clear();
      for (std::size_t i = 0; i < grey_alpha.size(); i += 2) spread.insert(spread.end(), 3, grey_alpha[i]);
      CHECK(same_bytes(io::read_rgb8(path), shape, spread));
    }
  }
}

// Floats of every size and both signs, with zeros, denormals, infinities and NaN that carry a number.
std::vector<float> floats(std::size_t count) {
  std::vector<float> out;
  for (std::uint32_t i = 0; i < count; ++i) {
    RandomStream r(2, RandomPurpose::test, 0, 0, i, 0);
    std::uint32_t bits = r.next_u32();
    const std::uint32_t special[] = {0,           0x80000000U, 1,           0x807FFFFFU,
                                     0x7F800000U, 0xFF800000U, 0x7FC12345U, 0x7F7FFFFFU};
    if (i % 5U == 0) bits = special[i / 5U % 8U];
    if ((bits & 0x7F800000U) == 0x7F800000U && (bits & 0x7FFFFFU) != 0) bits |= 0x400000U;  // quiet
    float value = 0;
    std::memcpy(&value, &bits, sizeof value);
    out.push_back(value);
  }
  return out;
}

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

TEST_CASE("PFM that we write, and of either byte order, is read by OpenImageIO as by us") {
  const TemporaryFolder folder;
  const std::string path = folder / "plane.pfm";
  for (const Shape shape : kShapes) {
    for (const int channels : {1, 3}) {
      CAPTURE(shape.width);
      CAPTURE(shape.height);
      CAPTURE(channels);
      const auto all = static_cast<std::size_t>(channels);
      const std::vector<float> values = floats(shape.pixels() * all);
      const io::Outcome written = channels == 1 ? io::write_pfm(path, as_image<float>(values, shape))
                                                : io::write_pfm(path, as_image<Vec3f>(values, shape));
      REQUIRE(written);
      CHECK(same_bits(read_by_peer<float>(path, shape, channels), values));

      for (const bool big : {false, true}) {
        CAPTURE(big);
        std::string file = std::string(channels == 1 ? "Pf" : "PF") + "\n" + std::to_string(shape.width) + " " +
                           std::to_string(shape.height) + "\n" + (big ? "1.0" : "-1.0") + "\n";
        const std::size_t row = static_cast<std::size_t>(shape.width) * all;
        for (std::size_t y = static_cast<std::size_t>(shape.height); y-- > 0;) {
          for (std::size_t i = y * row; i < (y + 1) * row; ++i) {
            std::uint32_t bits = 0;
            std::memcpy(&bits, &values[i], sizeof bits);
            for (int byte = 0; byte < 4; ++byte) {
              file += static_cast<char>((bits >> (8 * (big ? 3 - byte : byte))) & 0xFFU);
            }
          }
        }
        io_test::put(path, file);
        CHECK(same_bits(read_by_peer<float>(path, shape, channels), values));
        CHECK((channels == 1 ? same_bytes(io::read_pfm(path), shape, values)
                             : same_bytes(io::read_pfm_rgb(path), shape, values)));
      }
    }
  }
}

// Ward's shared exponent: e the least for which the largest channel, rounded to m 2^(e - 8), has m <= 255.
std::array<int, 4> shared_exponent(const float (&rgb)[3]) {
  double c[3];
  for (int i = 0; i < 3; ++i) c[i] = rgb[i] > 0 ? std::min(static_cast<double>(rgb[i]), 1.69e38) : 0;
  const double largest = std::max({c[0], c[1], c[2]});
  if (largest < 1e-38) return {0, 0, 0, 0};
  int e = -127;
  while (std::floor(std::ldexp(largest, 8 - e) + 0.5) > 255) ++e;
  std::array<int, 4> out{};
  for (std::size_t i = 0; i < 3; ++i) out[i] = static_cast<int>(std::floor(std::ldexp(c[i], 8 - e) + 0.5));
  out[3] = e + 128;
  return out;
}

TEST_CASE("Radiance HDR that we write is read by OpenImageIO byte by byte") {
  const TemporaryFolder folder;
  const std::string path = folder / "ours.hdr";
  for (const Shape shape : kShapes) {
    CAPTURE(shape.width);
    CAPTURE(shape.height);
    std::vector<float> values;
    for (std::uint32_t i = 0; i < shape.pixels(); ++i) {
      RandomStream r(3, RandomPurpose::test, 0, 0, i, 0);
      const std::uint32_t kind = i / 50U % 4U;
      const float size = kind == 0 ? 1.0F : std::exp2(r.uniform(-125.0F, 126.0F));
      for (int c = 0; c < 3; ++c) {
        float v = kind == 1 ? 0.25F : size * std::exp2(-r.uniform(0.0F, 10.0F));  // rows of one value are runs
        const float rare[] = {0.0F,         -1.0F,
                              255.5F / 256, std::numeric_limits<float>::quiet_NaN(),
                              3e38F,        std::numeric_limits<float>::infinity(),
                              1e-40F};
        if (kind == 3 && r.next_u32() % 3U == 0) v = rare[r.next_u32() % 7U];
        values.push_back(v);
      }
    }
    REQUIRE(io::write_hdr(path, as_image<Vec3f>(values, shape)));
    const std::vector<float> read = read_by_peer<float>(path, shape, 3);
    std::size_t other = 0;
    std::size_t far_off = 0;
    for (std::size_t i = 0; i < values.size(); i += 3) {
      const float rgb[3] = {values[i], values[i + 1], values[i + 2]};
      const std::array<int, 4> bytes = shared_exponent(rgb);
      const double unit = std::ldexp(1.0, 136 - bytes[3]);
      const float largest = std::max({read[i], read[i + 1], read[i + 2]});
      for (std::size_t c = 0; c < 3; ++c) {
        // 2.4 takes 2^-96, 2^87 and 2^90 for one unit in the last place less: bytes, not bits of its floats.
        const double byte = static_cast<double>(read[i + c]) * unit;
        if (!(std::fabs(byte - bytes[c]) <= 0x1p-23 * bytes[c])) ++other;
        const float held = rgb[c] > 0 ? std::min(rgb[c], 1.69e38F) : 0.0F;
        if (!(std::fabs(read[i + c] - held) <= largest / 256 + 1e-38F)) ++far_off;
      }
    }
    CHECK(other == 0);
    CHECK(far_off == 0);
  }
}

}  // namespace
