// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <random>
#include <string>

#include "io_fixture.hpp"
#include "npsim/io/png_jpeg.hpp"

namespace {

using namespace npsim;
using io_test::check_error;
using io_test::contents;
using io_test::put;
using io_test::require_ok;
using io_test::TemporaryFolder;

// Smooth areas, noise and extremes: every PNG filter gets chosen somewhere.
template <class Set>
void paint(Shape shape, unsigned seed, unsigned most, Set&& set) {
  std::mt19937 random(seed);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      for (int c = 0; c < 4; ++c) {
        unsigned v = (static_cast<unsigned>(x * 37 + y * (c + 1) * 11)) % (most + 1);
        if (y % 7 == 3) v = static_cast<unsigned>(random() % (most + 1));
        if (y % 7 == 5) v = x % 2 == 0 ? 0 : most;
        set(x, y, c, v);
      }
    }
  }
}

io::Image<Rgb8> sample_picture(Shape shape, unsigned seed = 1) {
  io::Image<Rgb8> image(shape);
  paint(shape, seed, 255, [&](int x, int y, int c, unsigned v) {
    const auto b = static_cast<std::uint8_t>(v);
    if (c == 0) image(x, y).r = b;
    if (c == 1) image(x, y).g = b;
    if (c == 2) image(x, y).b = b;
  });
  return image;
}

// A PNG put together chunk by chunk, for kinds that the writer does not write.
std::string make_png(std::uint32_t width, std::uint32_t height, int depth, int color, const io::Bytes& raw,
                     const io::Bytes& palette = {}) {
  using namespace npsim::io::detail;
  io::Bytes out(kPngSignature.begin(), kPngSignature.end());
  io::Bytes header;
  append_big_endian_32(header, width);
  append_big_endian_32(header, height);
  for (const int v : {depth, color, 0, 0, 0}) header.push_back(static_cast<unsigned char>(v));
  append_chunk(out, "IHDR", header.data(), header.size());
  if (!palette.empty()) append_chunk(out, "PLTE", palette.data(), palette.size());
  io::Bytes copy = raw;
  int bytes = 0;
  unsigned char* packed = stb::stbi_zlib_compress(copy.data(), static_cast<int>(copy.size()), &bytes, 8);
  append_chunk(out, "IDAT", packed, static_cast<std::size_t>(bytes));
  std::free(packed);
  append_chunk(out, "IEND", nullptr, 0);
  return std::string(out.begin(), out.end());
}

// 24 x 16 pixels with (10 x, 15 y, 90) at (x, y): quality 60, chroma at half size, baseline and progressive.
const char* const kBaseline =
    "ffd8ffe000104a46494600010100000100010000ffdb0043000d090a0b0a080d0b0a0b0e0e0d0f13201513121213271c1e17202e2931302e"
    "292d2c333a4a3e333646372c2d405741464c4e525352323e5a615a50604a51524fffdb0043010e0e0e131113261515264f352d354f4f4f4f"
    "4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4fffc00011080010001803"
    "012200021101031101ffc40017000003010000000000000000000000000000040506ffc40018100003010100000000000000000000000000"
    "03056162ffc400160101010100000000000000000000000000040206ffc4001b110001050101000000000000000000000000030405213102"
    "22ffda000c03010002110311003f00c8267f23e99fc97133f07d33f0851e85652196424cfe40d6267e002e9ede9a84643ce9ffd9";
const char* const kProgressive =
    "ffd8ffe000104a46494600010100000100010000ffdb0043000d090a0b0a080d0b0a0b0e0e0d0f13201513121213271c1e17202e2931302e"
    "292d2c333a4a3e333646372c2d405741464c4e525352323e5a615a50604a51524fffdb0043010e0e0e131113261515264f352d354f4f4f4f"
    "4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4f4fffc20011080010001803"
    "012200021101031101ffc40017000003010000000000000000000000000000040503ffc40016010101010000000000000000000000000003"
    "0205ffda000c030100021003100000018ec3dbc922560753ffc400161000030000000000000000000000000000000103ffda000801010001"
    "05025314c5314c5314cfffc4001811000203000000000000000000000000000004020321ffda0008010301013f01a5820c61ffc400171100"
    "03010000000000000000000000000000010302ffda0008010201013f01d58763ffc40014100100000000000000000000000000000020ffda"
    "0008010100063f025fffc400161001010100000000000000000000000000610020ffda0008010100013f2128a2c55fffda000c0301000200"
    "0300000010980fffc40017110100030000000000000000000000000000213151ffda0008010301013f10aa5a1fffc4001611010101000000"
    "00000000000000000000002131ffda0008010201013f1035d7ffc400161001010100000000000000000000000000006110ffda0008010100"
    "013f10d0041041ffd9";

std::string make_jpeg(const char* hex = kBaseline) {
  const auto digit = [](char c) { return c <= '9' ? c - '0' : c - 'a' + 10; };
  std::string bytes;
  for (; *hex != '\0'; hex += 2) bytes += static_cast<char>(16 * digit(hex[0]) + digit(hex[1]));
  return bytes;
}

}  // namespace

TEST_CASE("PNG: 8-bit RGB survives writing and reading at awkward sizes, from strided views too") {
  const TemporaryFolder folder;
  for (const Shape shape : {Shape{1, 1}, Shape{1, 9}, Shape{9, 1}, Shape{3, 2}, Shape{67, 43}}) {
    const io::Image<Rgb8> image = sample_picture(shape);
    require_ok(io::write_png(folder / "a.png", image.view()));
    const auto read = io::read_rgb8(folder / "a.png");
    require_ok(read);
    REQUIRE(read.value().shape() == shape);
    CHECK(std::memcmp(read.value().data(), image.data(), shape.pixels() * 3) == 0);
  }
  const io::Image<Rgb8> image = sample_picture({20, 10});
  require_ok(io::write_png(folder / "sub.png", image.view().sub(3, 2, {7, 5})));
  const auto read = io::read_rgb8(folder / "sub.png");
  require_ok(read);
  REQUIRE(read.value().shape() == Shape{7, 5});
  for (int y = 0; y < 5; ++y) {
    for (int x = 0; x < 7; ++x) CHECK(read.value()(x, y).g == image(x + 3, y + 2).g);
  }
}

TEST_CASE("PNG: 16-bit values, 8-bit planes and RGBA survive; 8 bits widen without scaling") {
  const TemporaryFolder folder;
  const Shape shape{61, 29};
  io::Image<std::uint16_t> deep(shape);
  io::Image<std::uint8_t> flat(shape);
  io::Image<io::Rgba8> rgba(shape);
  paint(shape, 2, 65535, [&](int x, int y, int c, unsigned v) {
    if (c == 0) deep(x, y) = static_cast<std::uint16_t>(v);
    if (c == 0) flat(x, y) = static_cast<std::uint8_t>(v & 255U);
    rgba(x, y)[static_cast<std::size_t>(c)] = static_cast<std::uint8_t>(v >> 8);
  });
  require_ok(io::write_png16(folder / "deep.png", deep.view()));
  require_ok(io::write_png(folder / "flat.png", flat.view()));
  require_ok(io::write_png_rgba(folder / "rgba.png", rgba.view()));
  const auto deep_read = io::read_u16(folder / "deep.png");
  const auto flat_read = io::read_u8(folder / "flat.png");
  const auto wide_read = io::read_u16(folder / "flat.png");
  const auto rgba_read = io::read_rgba8(folder / "rgba.png");
  require_ok(deep_read);
  require_ok(flat_read);
  require_ok(wide_read);
  require_ok(rgba_read);
  for (std::size_t i = 0; i < shape.pixels(); ++i) {
    REQUIRE(deep_read.value().data()[i] == deep.data()[i]);
    REQUIRE(flat_read.value().data()[i] == flat.data()[i]);
    REQUIRE(wide_read.value().data()[i] == flat.data()[i]);
    REQUIRE(rgba_read.value().data()[i] == rgba.data()[i]);
  }
}

TEST_CASE("PNG: the same picture gives the same bytes, and no temporary file is left") {
  const TemporaryFolder folder;
  const io::Image<Rgb8> image = sample_picture({40, 30});
  require_ok(io::write_png(folder / "a.png", image.view()));
  require_ok(io::write_png(folder / "b.png", image.view()));
  CHECK(contents(folder / "a.png") == contents(folder / "b.png"));
  CHECK(folder.files() == 2);
}

TEST_CASE("pictures: grey, grey with alpha, RGBA, palette and 16 bits all become RGB") {
  const TemporaryFolder folder;
  put(folder / "grey.png", make_png(2, 1, 8, 0, {0, 10, 200}));
  put(folder / "grey_alpha.png", make_png(2, 1, 8, 4, {0, 10, 0, 200, 255}));
  put(folder / "rgba.png", make_png(1, 1, 8, 6, {0, 1, 2, 3, 0}));
  put(folder / "palette.png", make_png(2, 1, 8, 3, {0, 1, 0}, {9, 8, 7, 6, 5, 4}));
  put(folder / "deep.png", make_png(1, 1, 16, 2, {0, 0x12, 0x34, 0x56, 0x78, 0x9A, 0xBC}));
  const auto pixel = [&](const char* name, int x) {
    const auto image = io::read_rgb8(folder / name);
    require_ok(image);
    const Rgb8 p = image.value()(x, 0);
    return std::to_string(p.r) + " " + std::to_string(p.g) + " " + std::to_string(p.b);
  };
  CHECK(pixel("grey.png", 1) == "200 200 200");
  CHECK(pixel("grey_alpha.png", 0) == "10 10 10");
  CHECK(pixel("rgba.png", 0) == "1 2 3");
  CHECK(pixel("palette.png", 0) == "6 5 4");
  CHECK(pixel("deep.png", 0) == "18 86 154");
}

TEST_CASE("planes of numbers: a file of another kind is refused and named") {
  const TemporaryFolder folder;
  put(folder / "rgb.png", make_png(1, 1, 8, 2, {0, 1, 2, 3}));
  put(folder / "palette.png", make_png(1, 1, 8, 3, {0, 0}, {9, 8, 7}));
  put(folder / "bits.png", make_png(1, 1, 4, 0, {0, 0x70}));
  put(folder / "grey.png", make_png(1, 1, 8, 0, {0, 7}));
  put(folder / "deep.png", make_png(1, 1, 16, 0, {0, 7, 7}));
  put(folder / "photo.jpg", make_jpeg());
  check_error(io::read_u8(folder / "rgb.png"), "rgb.png", "3-channel");
  check_error(io::read_u16(folder / "rgb.png"), "rgb.png", "3-channel");
  check_error(io::read_u8(folder / "palette.png"), "palette.png", "palette");
  check_error(io::read_u8(folder / "bits.png"), "bits.png", "4-bit grey");
  check_error(io::read_u8(folder / "deep.png"), "deep.png", "16-bit grey");
  check_error(io::read_u16(folder / "photo.jpg"), "photo.jpg", "JPEG");
  check_error(io::read_rgba8(folder / "grey.png"), "grey.png", "8-bit grey");
}

TEST_CASE("PNG: every truncation is an error, and so is every flipped byte") {
  const TemporaryFolder folder;
  require_ok(io::write_png(folder / "whole.png", sample_picture({13, 11}).view()));
  const std::string whole = contents(folder / "whole.png");
  for (std::size_t length = 1; length < whole.size(); ++length) {
    put(folder / "cut.png", whole.substr(0, length));
    check_error(io::read_rgb8(folder / "cut.png"), "cut.png");
  }
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string bent = whole;
    bent[at] = static_cast<char>(bent[at] ^ 0x20);
    put(folder / "bent.png", bent);
    check_error(io::read_rgb8(folder / "bent.png"), "bent.png");
  }
}

TEST_CASE("JPEG: baseline and progressive are read; every truncation is an error; flipped bits never crash") {
  const TemporaryFolder folder;
  for (const char* hex : {kBaseline, kProgressive}) {
    const std::string whole = make_jpeg(hex);
    put(folder / "whole.jpg", whole);
    const auto read = io::read_rgb8(folder / "whole.jpg");
    require_ok(read);
    REQUIRE(read.value().shape() == Shape{24, 16});
    double error = 0;
    for (int y = 0; y < 16; ++y) {
      for (int x = 0; x < 24; ++x) {
        const Rgb8 p = read.value()(x, y);
        error += std::abs(p.r - 10 * x) + std::abs(p.g - 15 * y) + std::abs(p.b - 90);
      }
    }
    CHECK(error / (24 * 16 * 3) < 12);  // of 255, at this quality
    for (std::size_t length = 1; length < whole.size(); ++length) {
      put(folder / "cut.jpg", whole.substr(0, length));
      check_error(io::read_rgb8(folder / "cut.jpg"), "cut.jpg");
    }
    for (std::size_t bit = 16; bit < whole.size() * 8; ++bit) {
      std::string bent = whole;
      bent[bit / 8] = static_cast<char>(bent[bit / 8] ^ (1 << (bit % 8)));
      put(folder / "bent.jpg", bent);
      const auto result = io::read_rgb8(folder / "bent.jpg");
      if (!result.ok()) check_error(result, "bent.jpg");
    }
  }
}

// An EXIF block that holds nothing but an orientation, in either order of bytes.
std::string exif(int orientation, bool little, std::size_t directory = 8) {
  const auto two = [&](unsigned v) {
    const char low = static_cast<char>(v & 255U);
    const char high = static_cast<char>(v >> 8U & 255U);
    return little ? std::string{low, high} : std::string{high, low};
  };
  const auto four = [&](unsigned v) { return little ? two(v) + two(v >> 16U) : two(v >> 16U) + two(v & 0xFFFFU); };
  return std::string(little ? "II" : "MM") + two(42) + four(static_cast<unsigned>(directory)) + two(1) + two(0x0112) +
         two(3) + four(1) + two(static_cast<unsigned>(orientation)) + two(0) + four(0);
}

std::string with_exif(const std::string& jpeg, const std::string& tiff) {
  const std::string body = std::string("Exif\0\0", 6) + tiff;
  const std::size_t length = body.size() + 2;
  return jpeg.substr(0, 2) + std::string{'\xFF', '\xE1', static_cast<char>(length >> 8U), static_cast<char>(length)} +
         body + jpeg.substr(2);
}

TEST_CASE("EXIF: a picture lies as its orientation says; a broken block leaves it as it is") {
  const TemporaryFolder folder;
  const std::string whole = make_jpeg();
  put(folder / "plain.jpg", whole);
  const auto plain = io::read_rgb8(folder / "plain.jpg");
  require_ok(plain);
  const int w = plain.value().width();
  const int h = plain.value().height();
  REQUIRE(w != h);
  // Where pixel (x, y) of the picture as it is looked at lies in the file, after the table of EXIF 2.3.
  const auto source = [&](int orientation, int x, int y) -> Rgb8 {
    switch (orientation) {
      case 2: return plain.value()(w - 1 - x, y);
      case 3: return plain.value()(w - 1 - x, h - 1 - y);
      case 4: return plain.value()(x, h - 1 - y);
      case 5: return plain.value()(y, x);
      case 6: return plain.value()(y, h - 1 - x);
      case 7: return plain.value()(w - 1 - y, h - 1 - x);
      case 8: return plain.value()(w - 1 - y, x);
      default: return plain.value()(x, y);
    }
  };
  for (int orientation = 1; orientation <= 8; ++orientation) {
    CAPTURE(orientation);
    put(folder / "turned.jpg", with_exif(whole, exif(orientation, orientation % 2 == 0)));
    const auto turned = io::read_rgb8(folder / "turned.jpg");
    require_ok(turned);
    REQUIRE(turned.value().shape() == (orientation < 5 ? Shape{w, h} : Shape{h, w}));
    for (int y = 0; y < turned.value().height(); ++y) {
      for (int x = 0; x < turned.value().width(); ++x) {
        const Rgb8 expected = source(orientation, x, y);
        REQUIRE(turned.value()(x, y).r == expected.r);
        REQUIRE(turned.value()(x, y).g == expected.g);
      }
    }
  }
  for (const std::string& broken : {exif(9, true), exif(6, true, 5000), exif(6, true, 0xFFFFFFF0U),
                                    exif(6, true).substr(0, 15), std::string("II"), std::string()}) {
    put(folder / "broken.jpg", with_exif(whole, broken));
    const auto read = io::read_rgb8(folder / "broken.jpg");
    require_ok(read);
    CHECK(read.value().shape() == Shape{w, h});
  }
}

TEST_CASE("JPEG: a Huffman table with more symbols than there are is refused, one that is never defined does no harm") {
  const TemporaryFolder folder;
  const std::string whole = make_jpeg();
  const std::size_t table = whole.find("\xFF\xC4");
  REQUIRE(table != std::string::npos);
  std::string full = whole;
  for (std::size_t i = 0; i < 16; ++i) full[table + 5 + i] = '\xFF';
  put(folder / "full.jpg", full);
  check_error(io::read_rgb8(folder / "full.jpg"), "full.jpg", "Huffman");
  std::string none = whole;
  for (std::size_t at = none.find("\xFF\xC4"); at != std::string::npos; at = none.find("\xFF\xC4")) {
    none[at + 1] = '\xFE';  // a comment
  }
  put(folder / "none.jpg", none);
  const auto result = io::read_rgb8(folder / "none.jpg");
  if (!result.ok()) check_error(result, "none.jpg");
}

TEST_CASE("absurd dimensions are refused before anything is decoded") {
  const TemporaryFolder folder;
  put(folder / "huge.png", make_png(100000, 100000, 8, 2, {0, 1, 2, 3}));
  check_error(io::read_rgb8(folder / "huge.png"), "huge.png", "100000x100000");
  put(folder / "most.png", make_png(0xFFFFFFFFU, 0xFFFFFFFFU, 8, 0, {0, 1}));
  check_error(io::read_u8(folder / "most.png"), "most.png", "4294967295x4294967295");
  put(folder / "none.png", make_png(0, 5, 8, 0, {0, 1}));
  check_error(io::read_u8(folder / "none.png"), "none.png", "0x5");
  put(folder / "lies.png", make_png(9000, 9000, 8, 2, {0, 1, 2, 3}));
  check_error(io::read_rgb8(folder / "lies.png"), "lies.png");

  std::string jpeg = make_jpeg();
  const std::size_t frame = jpeg.find("\xFF\xC0");
  REQUIRE(frame != std::string::npos);
  for (const std::size_t i : {5U, 6U, 7U, 8U}) jpeg[frame + i] = static_cast<char>(0xFD);
  put(folder / "huge.jpg", jpeg);
  check_error(io::read_rgb8(folder / "huge.jpg"), "huge.jpg", "65021x65021");
}

TEST_CASE("the caller's limits: side, decoded bytes, file size") {
  const TemporaryFolder folder;
  require_ok(io::write_png(folder / "a.png", sample_picture({30, 20}).view()));
  io::ReadLimits limits;
  limits.max_side = 29;
  check_error(io::read_rgb8(folder / "a.png", limits), "a.png", "29 a side");
  limits = {};
  limits.max_bytes = 30 * 20 * 3 - 1;
  put(folder / "b.png", make_png(30, 20, 8, 2, {0}));
  check_error(io::read_rgb8(folder / "b.png", limits), "b.png", "bytes decoded");
  limits.max_bytes = 40;
  check_error(io::read_rgb8(folder / "a.png", limits), "a.png", "file size");
}

TEST_CASE("a stream that inflates far beyond the picture it claims is stopped") {
  const TemporaryFolder folder;
  put(folder / "bomb.png", make_png(4, 4, 8, 0, io::Bytes(8U << 20U, 0)));
  check_error(io::read_u8(folder / "bomb.png"), "bomb.png");
}

TEST_CASE("a small PNG before a JPEG leaves no limit behind") {
  const TemporaryFolder folder;
  put(folder / "tiny.png", make_png(1, 1, 8, 0, {0, 7}));
  put(folder / "photo.jpg", make_jpeg());
  require_ok(io::read_u8(folder / "tiny.png"));
  require_ok(io::read_rgb8(folder / "photo.jpg"));
}

TEST_CASE("no file, empty file, folder, text, other formats") {
  const TemporaryFolder folder;
  check_error(io::read_rgb8(folder / "absent.png"), "absent.png", "does not exist");
  put(folder / "empty.png", "");
  check_error(io::read_rgb8(folder / "empty.png"), "empty.png", "empty");
  check_error(io::read_rgb8(folder.path()), folder.path(), "folder");
  put(folder / "text.png", "this is no picture");
  check_error(io::read_rgb8(folder / "text.png"), "text.png", "expected a PNG or JPEG");
  put(folder / "gif.png", std::string("GIF89a\x01\x00\x01\x00\x00\x00\x00", 13));
  check_error(io::read_rgb8(folder / "gif.png"), "gif.png", "expected a PNG or JPEG");
}

TEST_CASE("writing: an impossible place and an empty image are errors, and nothing half-written stays") {
  const TemporaryFolder folder;
  const io::Image<Rgb8> image = sample_picture({4, 4});
  check_error(io::write_png(folder / "no/such/folder/a.png", image.view()), "a.png");
  check_error(io::write_png(folder / "empty.png", ImageView<const Rgb8>()), "empty.png");
  std::filesystem::create_directories(folder / "taken/inside");
  check_error(io::write_png(folder / "taken", image.view()), "taken");
  CHECK(folder.files() == 1);
}

TEST_CASE("an error stays one line whatever the file is called") {
  const io::Error error{"a\nb\t.png", "field", "problem"};
  CHECK(error.line() == "a b .png: field: problem");
}

TEST_CASE("jpeg: what is written is read as it was, the closer the higher the quality; other qualities are refused") {
  const TemporaryFolder folder;
  npsim::io::Image<Rgb8> picture({61, 37});
  for (int y = 0; y < 37; ++y) {
    for (int x = 0; x < 61; ++x) {
      picture(x, y) = {static_cast<std::uint8_t>(4 * x), static_cast<std::uint8_t>(6 * y),
                       static_cast<std::uint8_t>((x + y) % 16 < 8 ? 60 : 120)};
    }
  }
  double before = 1e9;
  for (const int quality : {20, 60, 95}) {
    REQUIRE(npsim::io::write_jpeg(folder / "night.jpg", picture.view(), quality).ok());
    const auto read = npsim::io::read_rgb8(folder / "night.jpg");
    REQUIRE(read.ok());
    double error = 0;
    for (std::size_t i = 0; i < picture.shape().pixels(); ++i) {
      const Rgb8& a = picture.data()[i];
      const Rgb8& b = read.value().data()[i];
      error += std::pow(a.r - b.r, 2) + std::pow(a.g - b.g, 2) + std::pow(a.b - b.b, 2);
    }
    error = std::sqrt(error / (3.0 * 61 * 37));
    CHECK(error < before);
    before = error;
  }
  CHECK(before < 4);
  CHECK_FALSE(npsim::io::write_jpeg(folder / "night.jpg", picture.view(), 0).ok());
  CHECK_FALSE(npsim::io::write_jpeg(folder / "night.jpg", npsim::ImageView<const Rgb8>(), 90).ok());
}
