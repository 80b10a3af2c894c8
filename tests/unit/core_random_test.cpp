// SPDX-License-Identifier: Apache-2.0
#include "npsim/core/random.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cstdint>
#include <set>
#include <vector>

using npsim::philox4x32;
using npsim::RandomPurpose;
using npsim::RandomStream;

namespace {

using Block = std::array<std::uint32_t, 4>;

Block first_block(RandomStream stream) {
  return {stream.next_u32(), stream.next_u32(), stream.next_u32(), stream.next_u32()};
}

}  // namespace

TEST_CASE("Philox4x32-10 gives the known answers of its authors") {
  constexpr std::uint32_t kOnes = 0xFFFFFFFFU;
  CHECK(philox4x32({0, 0, 0, 0}, {0, 0}) == Block{0x6627e8d5U, 0xe169c58dU, 0xbc57ac4cU, 0x9b00dbd8U});
  CHECK(philox4x32({kOnes, kOnes, kOnes, kOnes}, {kOnes, kOnes}) ==
        Block{0x408f276dU, 0x41c83b0eU, 0xa20bc7c6U, 0x6d5451fdU});
  CHECK(philox4x32({0x243f6a88U, 0x85a308d3U, 0x13198a2eU, 0x03707344U}, {0xa4093822U, 0x299f31d0U}) ==
        Block{0xd16cfe09U, 0x94fdccebU, 0x5001e420U, 0x24126ea1U});
}

TEST_CASE("changing any one of the six keys changes the stream") {
  std::set<Block> blocks;
  std::size_t streams = 0;
  const auto add = [&](const RandomStream& stream) {
    blocks.insert(first_block(stream));
    ++streams;
  };
  add({0, RandomPurpose::generic, 0, 0, 0, 0});
  for (unsigned bit = 0; bit < 64; ++bit) add({std::uint64_t{1} << bit, RandomPurpose::generic, 0, 0, 0, 0});
  for (unsigned bit = 0; bit < 32; ++bit) {
    add({0, RandomPurpose::generic, 1U << bit, 0, 0, 0});
    add({0, RandomPurpose::generic, 0, 0, 1U << bit, 0});
  }
  for (unsigned bit = 0; bit < 24; ++bit) {
    add({0, RandomPurpose::generic, 0, 1U << bit, 0, 0});
    add({0, RandomPurpose::generic, 0, 0, 0, 1U << bit});
  }
  for (std::uint32_t purpose = 1; purpose <= static_cast<std::uint32_t>(RandomPurpose::test); ++purpose) {
    add({0, static_cast<RandomPurpose>(purpose), 0, 0, 0, 0});
  }
  CHECK(blocks.size() == streams);
}

TEST_CASE("neighbouring lights, pixels and samples share no block within all their draws") {
  std::set<Block> blocks;
  std::size_t drawn = 0;
  for (std::uint32_t light = 0; light < 3; ++light) {
    for (std::uint32_t pixel = 0; pixel < 3; ++pixel) {
      for (std::uint32_t sample = 0; sample < 3; ++sample) {
        RandomStream stream(7, RandomPurpose::direct, 1, light, pixel, sample);
        for (int block = 0; block < 256; ++block, ++drawn) {
          blocks.insert({stream.next_u32(), stream.next_u32(), stream.next_u32(), stream.next_u32()});
        }
      }
    }
  }
  CHECK(blocks.size() == drawn);
}

TEST_CASE("a stream is a pure function of its keys: interleaving changes nothing") {
  RandomStream a(1, RandomPurpose::noise, 2, 3, 4, 5);
  RandomStream b(1, RandomPurpose::noise, 2, 3, 5, 5);
  std::vector<std::uint32_t> interleaved;
  for (int i = 0; i < 9; ++i) {
    interleaved.push_back(a.next_u32());
    (void)b.next_u32();
  }
  RandomStream again(1, RandomPurpose::noise, 2, 3, 4, 5);
  for (const std::uint32_t value : interleaved) CHECK(again.next_u32() == value);
}

TEST_CASE("uniform numbers: below one, on the lattice, mean and variance of the uniform law") {
  constexpr std::uint32_t kStreams = 4096;
  constexpr int kDraws = 64;
  double sum = 0;
  double squares = 0;
  for (std::uint32_t pixel = 0; pixel < kStreams; ++pixel) {
    RandomStream stream(42, RandomPurpose::test, 0, 0, pixel, 0);
    for (int i = 0; i < kDraws; ++i) {
      const float u = stream.uniform();
      REQUIRE(u >= 0.0F);
      REQUIRE(u < 1.0F);
      const double lattice = static_cast<double>(u) * 16777216.0;
      REQUIRE(lattice == static_cast<double>(static_cast<std::uint32_t>(lattice)));
      sum += static_cast<double>(u);
      squares += static_cast<double>(u) * static_cast<double>(u);
    }
  }
  constexpr double kCount = static_cast<double>(kStreams) * kDraws;
  const double mean = sum / kCount;
  // Five standard errors: sqrt(1/12 / n) for the mean, sqrt(1/180 / n) for the variance.
  CHECK(mean == doctest::Approx(0.5).scale(1.0).epsilon(5 * 0.2887 / 512.0));
  CHECK(squares / kCount - mean * mean == doctest::Approx(1.0 / 12.0).scale(1.0).epsilon(5 * 0.0745 / 512.0));
}

TEST_CASE("uniform between two bounds keeps to them") {
  RandomStream stream(3, RandomPurpose::test, 0, 0, 0, 0);
  for (int i = 0; i < 1000; ++i) {
    const float v = stream.uniform(-2.0F, 3.0F);
    CHECK(v >= -2.0F);
    CHECK(v <= 3.0F);
  }
  CHECK(stream.uniform(5.0F, 5.0F) == 5.0F);
}
