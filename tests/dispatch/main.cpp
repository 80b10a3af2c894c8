// SPDX-License-Identifier: Apache-2.0
// Makes the nights with each of the named instruction sets and prints their hashes. Fails where one fails or two
// differ; exits with 77 where the machine lacks a set that is named.
#include <cstdio>
#include <cstring>

#include "dispatch/processor.hpp"
#include "night.hpp"

namespace {

alignas(64) unsigned char memory[std::size_t{32} << 20U];

struct Set {
  const char* name;
  bool here;
  std::uint64_t (*night)(unsigned char*, std::size_t);
};

}  // namespace

int main(int argc, char** argv) {
#if defined(DISPATCH_SSE2_ALONE)
  const Set sets[] = {{"sse2", true, night_sse2}};
#else
  const dispatch::Processor processor = dispatch::this_processor();
  const Set sets[] = {
      {"sse2", true, night_sse2}, {"avx2", processor.v3, night_avx2}, {"avx512", processor.v4, night_avx512}};
#endif
  std::uint64_t first = 0;
  for (int i = 1; i < argc; ++i) {
    for (const Set& set : sets) {
      if (std::strcmp(argv[i], set.name) != 0) continue;
      if (!set.here) {
        std::printf("skipped: this machine lacks %s\n", set.name);
        return 77;
      }
      const std::uint64_t hash = set.night(memory, sizeof memory);
      std::printf("%016llx\n", static_cast<unsigned long long>(hash));
      if (i == 1) first = hash;
      if (hash == 0 || hash != first) return 1;
    }
  }
  return first == 0 ? 2 : 0;
}
