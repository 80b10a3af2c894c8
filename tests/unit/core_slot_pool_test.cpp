// SPDX-License-Identifier: Apache-2.0
#include "npsim/core/executor.hpp"

#include <doctest/doctest.h>

#include <atomic>
#include <vector>

#include "npsim/exec/thread_pool.hpp"

using namespace npsim;

TEST_CASE("slot pool: the lowest free slot first, all of them, and again after they are given back") {
  for (const int count : {2, 3, kMaxSlots}) {
    SlotPool pool(count);
    for (int i = 0; i < count; ++i) CHECK(pool.take() == i);
    pool.give(count - 1);
    pool.give(0);
    CHECK(pool.take() == 0);
    CHECK(pool.take() == count - 1);
  }
}

TEST_CASE("slot pool: nobody shares a slot, with more threads than slots") {
  SlotPool pool(2);
  std::atomic<int> holders[2] = {};
  std::atomic<int> shared{0};
  ThreadPool threads(4);
  threads.for_chunks(2000, 1, [&](std::size_t, std::size_t) {
    const int slot = pool.take();
    if (slot < 0 || slot > 1 || holders[slot].fetch_add(1) != 0) shared.fetch_add(1);
    holders[slot].fetch_sub(1);
    pool.give(slot);
  });
  CHECK(shared.load() == 0);
}
