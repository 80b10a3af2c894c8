// SPDX-License-Identifier: Apache-2.0
// PFM, NPY and Radiance HDR.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "io_fixture.hpp"
#include "npsim/io/detail/npy.hpp"
#include "npsim/io/hdr.hpp"
#include "npsim/io/pfm.hpp"

namespace {

using namespace npsim;
using io_test::check_error;
using io_test::contents;
using io_test::put;
using io_test::require_ok;
using io_test::TemporaryFolder;

io::Image<float> sample_plane(Shape shape) {
  io::Image<float> image(shape);
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) image(x, y) = static_cast<float>(y * 100 + x) * 0.37F - 5.0F;
  }
  image(0, 0) = -0.0F;
  return image;
}

std::string big_endian(std::initializer_list<float> values) {
  std::string out;
  for (const float v : values) {
    char b[4];
    std::memcpy(b, &v, 4);
    out += {b[3], b[2], b[1], b[0]};
  }
  return out;
}

std::string npy(const std::string& header, const std::string& data, char major = 1) {
  std::string out("\x93NUMPY", 6);
  out += {major, 0, static_cast<char>(header.size() % 256), static_cast<char>(header.size() / 256)};
  if (major > 1) out += std::string(2, '\0');
  return out + header + data;
}

template <class T>
std::string raw(std::initializer_list<T> values) {
  std::string out;
  for (const T v : values) out.append(reinterpret_cast<const char*>(&v), sizeof(T));
  return out;
}

const char* const kGood = "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }\n";

// Decoder of the Radiance format as its description gives it, for files with run-length encoded scan lines.
bool decode_hdr(const std::string& bytes, Shape shape, std::vector<double>& out) {
  std::size_t at = bytes.find("\n\n");
  if (bytes.compare(0, 11, "#?RADIANCE\n") != 0 || at == std::string::npos) return false;
  const std::string resolution = "-Y " + std::to_string(shape.height) + " +X " + std::to_string(shape.width) + "\n";
  at += 2;
  if (bytes.compare(at, resolution.size(), resolution) != 0) return false;
  at += resolution.size();
  const auto width = static_cast<std::size_t>(shape.width);
  const auto byte = [&](std::size_t i) { return i < bytes.size() ? static_cast<unsigned char>(bytes[i]) : 0U; };
  std::vector<unsigned> line(4 * width);
  for (int y = 0; y < shape.height; ++y) {
    if (width >= 8) {
      if (byte(at) != 2 || byte(at + 1) != 2 || byte(at + 2) * 256 + byte(at + 3) != width) return false;
      at += 4;
      for (std::size_t c = 0; c < 4; ++c) {
        std::size_t x = 0;
        while (x < width) {
          const unsigned n = byte(at++);
          const std::size_t count = n > 128 ? n - 128 : n;
          if (count == 0 || x + count > width || at >= bytes.size()) return false;
          for (std::size_t i = 0; i < count; ++i) line[4 * (x + i) + c] = byte(n > 128 ? at : at + i);
          at += n > 128 ? 1 : count;
          x += count;
        }
      }
    } else {
      for (std::size_t i = 0; i < 4 * width; ++i) line[i] = byte(at++);
    }
    for (std::size_t x = 0; x < width; ++x) {
      for (std::size_t c = 0; c < 3; ++c) {
        out.push_back(line[4 * x + 3] == 0 ? 0.0
                                           : std::ldexp(line[4 * x + c], static_cast<int>(line[4 * x + 3]) - 136));
      }
    }
  }
  return at == bytes.size();
}

}  // namespace

TEST_CASE("PFM: one and three channels survive bit by bit, NaN and infinity included") {
  const TemporaryFolder folder;
  io::Image<float> plane = sample_plane({5, 3});
  plane(1, 1) = std::numeric_limits<float>::quiet_NaN();
  plane(2, 1) = std::numeric_limits<float>::infinity();
  require_ok(io::write_pfm(folder / "a.pfm", plane.view()));
  const auto read = io::read_pfm(folder / "a.pfm");
  require_ok(read);
  REQUIRE(read.value().shape() == plane.shape());
  CHECK(std::memcmp(read.value().data(), plane.data(), 15 * 4) == 0);

  io::Image<Vec3f> colour({4, 7});
  for (std::size_t i = 0; i < 28; ++i) {
    const auto f = static_cast<float>(i);
    colour.data()[i] = {f, -f, f * f};
  }
  require_ok(io::write_pfm(folder / "c.pfm", colour.view().sub(1, 2, {3, 4})));
  const auto sub = io::read_pfm_rgb(folder / "c.pfm");
  require_ok(sub);
  CHECK(sub.value()(2, 3).z == colour(3, 5).z);
  CHECK(sub.value()(0, 0).y == colour(1, 2).y);
}

TEST_CASE("PFM: rows from the bottom up, both byte orders") {
  const TemporaryFolder folder;
  put(folder / "big.pfm", "Pf\n2 2\n1.0\n" + big_endian({1, 2, 3, 4}));
  put(folder / "little.pfm", "Pf 2\n2 -1.0\n" + raw<float>({1, 2, 3, 4}));
  for (const char* name : {"big.pfm", "little.pfm"}) {
    const auto read = io::read_pfm(folder / name);
    require_ok(read);
    CHECK(read.value()(0, 0) == 3);
    CHECK(read.value()(1, 0) == 4);
    CHECK(read.value()(0, 1) == 1);
    CHECK(read.value()(1, 1) == 2);
  }
}

TEST_CASE("PFM: every truncation, trailing bytes, and headers that lie are errors") {
  const TemporaryFolder folder;
  require_ok(io::write_pfm(folder / "whole.pfm", sample_plane({3, 2}).view()));
  const std::string whole = contents(folder / "whole.pfm");
  for (std::size_t length = 0; length < whole.size(); ++length) {
    put(folder / "cut.pfm", whole.substr(0, length));
    check_error(io::read_pfm(folder / "cut.pfm"), "cut.pfm");
  }
  const auto refused = [&](const std::string& bytes, const std::string& words) {
    put(folder / "bad.pfm", bytes);
    check_error(io::read_pfm(folder / "bad.pfm"), "bad.pfm", words);
  };
  refused(whole + "x", "25 bytes");
  refused("P5\n3 2\n255\n", "magic");
  refused("Pf\n-3 2\n-1\n", "-3x2");
  refused("Pf\n0 2\n-1\n", "0x2");
  refused("Pf\n3.5 2\n-1\n" + std::string(24, 'x'), "width");
  refused("Pf\nnan 2\n-1\n", "width");
  refused("Pf\nthree 2\n-1\n", "width");
  refused("Pf\n3 2\n0\n" + std::string(24, 'x'), "scale");
  refused("Pf\n3 2\ninf\n" + std::string(24, 'x'), "scale");
  refused("Pf\n100000 100000\n-1\n", "100000x100000");
  refused("Pf\n99999999999999999999 2\n-1\n", "width");
  refused("Pf\n16384 16384\n-1\n", "data");
  refused("Pf\n" + std::string(1000, '1') + " 2\n-1\n", "width");
  refused("PF\n1 1\n-1\n" + std::string(12, 'x'), "3 channels");
}

TEST_CASE("NPY: each type and shape that is promised, versions 1 to 3") {
  const TemporaryFolder folder;
  const auto first_two = [&](const std::string& descr, const std::string& data, char version) {
    put(folder / "a.npy",
        npy("{'descr': '" + descr + "', 'fortran_order': False, 'shape': (1, 2), }   \n", data, version));
    const auto read = io::read_npy(folder / "a.npy");
    require_ok(read);
    REQUIRE(read.value().shape() == Shape{2, 1});
    return std::to_string(read.value()(0, 0)) + " " + std::to_string(read.value()(1, 0));
  };
  CHECK(first_two("<f4", raw<float>({1.5F, -2.0F}), 1) == "1.500000 -2.000000");
  CHECK(first_two("<f8", raw<double>({1.5, -2.0}), 2) == "1.500000 -2.000000");
  CHECK(first_two("|u1", raw<std::uint8_t>({7, 255}), 3) == "7.000000 255.000000");
  CHECK(first_two("<u2", raw<std::uint16_t>({7, 65535}), 1) == "7.000000 65535.000000");
  CHECK(first_two("<i4", raw<std::int32_t>({-7, 100000}), 1) == "-7.000000 100000.000000");

  put(folder / "q.npy",
      npy("{\"shape\":(2,1,1),\"descr\":\"<u2\",\"fortran_order\":False}", raw<std::uint16_t>({3, 4})));
  const auto whole = io::read_npy_i32(folder / "q.npy");
  require_ok(whole);
  CHECK(whole.value().shape() == Shape{1, 2});
  CHECK(whole.value()(0, 1) == 4);

  put(folder / "c.npy",
      npy("{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2, 3), }\n", raw<float>({1, 2, 3, 4, 5, 6})));
  const auto colour = io::read_npy_rgb(folder / "c.npy");
  require_ok(colour);
  CHECK(colour.value()(1, 0).x == 4);
  CHECK(colour.value()(0, 0).z == 3);
  check_error(io::read_npy(folder / "c.npy"), "c.npy", "(1, 2, 3)");
}

TEST_CASE("NPY: what is written is read back, from strided views too") {
  const TemporaryFolder folder;
  const io::Image<float> plane = sample_plane({9, 6});
  require_ok(io::write_npy(folder / "a.npy", plane.view().sub(2, 1, {5, 4})));
  const auto read = io::read_npy(folder / "a.npy");
  require_ok(read);
  REQUIRE(read.value().shape() == Shape{5, 4});
  CHECK(read.value()(4, 3) == plane(6, 4));
  CHECK(contents(folder / "a.npy").size() % 64 == (5 * 4 * 4) % 64);
}

TEST_CASE("NPY: hostile and unfit headers") {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& bytes, const std::string& words) {
    put(folder / "bad.npy", bytes);
    check_error(io::read_npy(folder / "bad.npy"), "bad.npy", words);
  };
  const std::string data = raw<float>({1, 2});
  const std::string whole = npy(kGood, data);
  put(folder / "whole.npy", whole);
  require_ok(io::read_npy(folder / "whole.npy"));
  for (std::size_t length = 0; length < whole.size(); ++length) {
    put(folder / "cut.npy", whole.substr(0, length));
    check_error(io::read_npy(folder / "cut.npy"), "cut.npy");
  }
  refused(whole + "x", "9 bytes");
  refused("PK\x03\x04 an npz is a zip file", "magic");
  refused(npy(kGood, data, 4), "version");
  refused(npy("{'descr': '<f4', 'fortran_order': True, 'shape': (1, 2), }", data), "fortran_order");
  refused(npy("{'descr': '>f4', 'fortran_order': False, 'shape': (1, 2), }", data), ">f4");
  refused(npy("{'descr': '<f2', 'fortran_order': False, 'shape': (1, 2), }", data), "<f2");
  refused(npy("{'descr': '|O', 'fortran_order': False, 'shape': (1, 2), }", data), "|O");
  refused(npy("{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (1, 2), }", data), "descr");
  refused(npy("{'descr': '<f4', 'fortran_order': False, 'shape': (2,), }", data), "shape");
  refused(npy("{'descr': '<f4', 'fortran_order': False, 'shape': (), }", data), "shape");
  refused(npy("{'descr': '<f4', 'fortran_order': False, 'shape': (3, 1, 2), }", data), "(3, 1, 2)");
  refused(npy("{'descr': '<f4', 'fortran_order': False, 'shape': (-1, 2), }", data), "shape");
  refused(npy("{'descr': '<f4', 'fortran_order': False, 'shape': (0, 2), }", ""), "2x0");
  refused(npy("{'descr': '<f4', 'fortran_order': False, 'shape': (100000, 100000), }", data), "100000x100000");
  refused(npy("{'descr': '<f4', 'fortran_order': False, 'shape': (16384, 16384), }", data), "data");
  refused(npy("{'descr': '<f4', 'fortran_order': False, 'shape': (99999999999999999999, 2), }", data), "shape");
  refused(npy("{'descr': '<f4', 'fortran_order': False, }", data), "lacks a key");
  refused(npy("{'descr': '<f4', 'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }", data), "descr");
  refused(npy("{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), 'more': 1}", data), "more");
  refused(npy("{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2)", data), "shape");
  refused(npy("{'descr': '<f4", data), "descr");
  refused(npy("__import__('os')", data), "dictionary");
  refused(npy("{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2)} + {}", data), "after its dictionary");
  refused(npy(std::string(200, '('), data), "dictionary");
  std::string long_header = npy(kGood, data, 2);
  long_header[10] = 1;  // claims 64 KiB more
  refused(long_header, "header");
}

TEST_CASE("NPY: fractions are no ids") {
  const TemporaryFolder folder;
  put(folder / "f.npy", npy(kGood, raw<float>({1, 2})));
  check_error(io::read_npy_i32(folder / "f.npy"), "f.npy", "whole");
}

TEST_CASE("Radiance HDR: within 1/256 of the largest channel over the whole range, runs and noise") {
  const TemporaryFolder folder;
  std::mt19937 random(7);
  for (const Shape shape : {Shape{3, 5}, Shape{8, 2}, Shape{301, 9}}) {
    io::Image<Vec3f> image(shape);
    for (int y = 0; y < shape.height; ++y) {
      for (int x = 0; x < shape.width; ++x) {
        const auto value = [&] {
          return std::ldexp(static_cast<float>(random() % 1000 + 1), static_cast<int>(random() % 200) - 110);
        };
        image(x, y) = y % 2 == 0 ? Vec3f{value(), value(), value()} : Vec3f{0.5F, 0.25F, x < 150 ? 1.0F : 4.0F};
      }
    }
    require_ok(io::write_hdr(folder / "a.hdr", image.view()));
    std::vector<double> decoded;
    REQUIRE(decode_hdr(contents(folder / "a.hdr"), shape, decoded));
    REQUIRE(decoded.size() == shape.pixels() * 3);
    for (std::size_t i = 0; i < shape.pixels(); ++i) {
      const Vec3f& p = image.data()[i];
      const double largest = static_cast<double>(std::max(p.x, std::max(p.y, p.z)));
      const double bound = largest / 256;
      REQUIRE(std::abs(decoded[3 * i] - static_cast<double>(p.x)) <= bound);
      REQUIRE(std::abs(decoded[3 * i + 1] - static_cast<double>(p.y)) <= bound);
      REQUIRE(std::abs(decoded[3 * i + 2] - static_cast<double>(p.z)) <= bound);
    }
  }
}

TEST_CASE("Radiance HDR: NaN and negative become 0, infinity the largest value, a carry moves the exponent") {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  using Quad = std::array<std::uint8_t, 4>;
  CHECK(io::detail::rgbe({kNan, -1, 0}) == Quad{0, 0, 0, 0});
  CHECK(io::detail::rgbe({kInf, 0, 0})[3] == 255);
  CHECK(io::detail::rgbe({kInf, 0, 0})[0] >= 254);
  CHECK(io::detail::rgbe({std::nextafter(1.0F, 0.0F), 0, 0}) == Quad{128, 0, 0, 129});
  CHECK(io::detail::rgbe({1, 0.5F, 0.25F}) == Quad{128, 64, 32, 129});
  CHECK(io::detail::rgbe({1e-40F, 0, 0}) == Quad{0, 0, 0, 0});
}
