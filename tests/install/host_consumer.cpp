// SPDX-License-Identifier: Apache-2.0
#include <stb/stb_image.h>
#include <tiny_obj_loader.h>
#include <nlohmann/json.hpp>

#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/atomic_file.hpp"

int main() {
  npsim::ThreadPool pool(2);
  int hits[4] = {};
  pool.for_chunks(4, 1, [&](std::size_t begin, std::size_t) { ++hits[begin]; });
  return hits[0] * hits[1] * hits[2] * hits[3] == 1 ? 0 : 1;
}
