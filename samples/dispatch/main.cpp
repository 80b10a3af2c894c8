// SPDX-License-Identifier: Apache-2.0
// Photographs three lamps in the dark with the best instruction set that this machine has, or with the one named by
// --set, and prints which it was and a hash of the picture. Three sets stand in the one program: SSE2, which every
// x86-64 processor has, AVX2 with FMA, and AVX-512. On other processors there is the one that it was compiled for.
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <vector>

#include "dispatch/kernels.hpp"
#include "dispatch/processor.hpp"

namespace {

struct Set {
  const char* name;
  bool here;
  std::size_t (*photograph_bytes)(int, int);
  const char* (*photograph)(const float*, int, int, unsigned char*, void*, std::size_t);
};

// The best last.
std::vector<Set> sets() {
#if defined(__x86_64__)
  const dispatch::Processor processor = dispatch::this_processor();
  return {{"sse2", true, photograph_bytes_sse2, photograph_sse2},
          {"avx2", processor.v3, photograph_bytes_avx2, photograph_avx2},
          {"avx512", processor.v4, photograph_bytes_avx512, photograph_avx512}};
#else
  return {{"only", true, photograph_bytes_only, photograph_only}};
#endif
}

constexpr int kWidth = 320;
constexpr int kHeight = 180;

std::vector<float> lamps_in_the_dark() {
  std::vector<float> luminance_cd_m2(std::size_t{3} * kWidth * kHeight, 0.2F);
  for (const int x : {60, 150, 260}) {
    for (int i = 0; i < 4 * 4; ++i) {
      const auto pixel = static_cast<std::size_t>((50 + i / 4) * kWidth + x + i % 4);
      const float lamp[3] = {9000.0F, 6000.0F, 2500.0F};
      std::memcpy(&luminance_cd_m2[3 * pixel], lamp, sizeof lamp);
    }
  }
  return luminance_cd_m2;
}

std::uint64_t fnv1a(const std::vector<unsigned char>& bytes) {
  std::uint64_t hash = 0xcbf29ce484222325U;
  for (const unsigned char byte : bytes) hash = (hash ^ byte) * 0x100000001b3U;
  return hash;
}

}  // namespace

int main(int argc, char** argv) {
  const char* wanted = argc == 3 && std::strcmp(argv[1], "--set") == 0 ? argv[2] : nullptr;
  if (argc != 1 && wanted == nullptr) {
    std::fprintf(stderr, "usage: %s [--set NAME]\n", argv[0]);
    return 2;
  }
  const std::vector<Set> all = sets();
  const Set* chosen = nullptr;
  for (const Set& set : all) {
    if (wanted != nullptr ? std::strcmp(set.name, wanted) == 0 : set.here) chosen = &set;
  }
  if (chosen == nullptr || !chosen->here) {
    std::fprintf(stderr, "%s: %s\n", wanted,
                 chosen == nullptr ? "this program holds no such instruction set" : "this machine lacks it");
    return 1;
  }

  const std::vector<float> luminance_cd_m2 = lamps_in_the_dark();
  std::vector<unsigned char> picture(luminance_cd_m2.size());
  std::vector<unsigned char> memory(chosen->photograph_bytes(kWidth, kHeight));
  const char* problem =
      chosen->photograph(luminance_cd_m2.data(), kWidth, kHeight, picture.data(), memory.data(), memory.size());
  if (*problem != 0) {
    std::fprintf(stderr, "%s\n", problem);
    return 1;
  }
  std::printf("%s %016llx\n", chosen->name, static_cast<unsigned long long>(fnv1a(picture)));
  return 0;
}
