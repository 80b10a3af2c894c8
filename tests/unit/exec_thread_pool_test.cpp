// SPDX-License-Identifier: Apache-2.0
#include "npsim/exec/thread_pool.hpp"

#include <doctest/doctest.h>

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <set>
#include <thread>
#include <vector>

#include "npsim/core/random.hpp"

using npsim::chunk_count;
using npsim::SerialExecutor;
using npsim::ThreadPool;

namespace {

// A float sum whose value depends on the order of addition: partial sums by chunk, combined in chunk order.
template <class Executor>
float ordered_sum(const std::vector<float>& values, Executor& executor) {
  constexpr std::size_t kChunk = 97;
  std::vector<float> partial(chunk_count(values.size(), kChunk), 0.0F);
  executor.for_chunks(values.size(), kChunk, [&](std::size_t begin, std::size_t end) {
    float sum = 0;
    for (std::size_t i = begin; i < end; ++i) sum += values[i];
    partial[begin / kChunk] = sum;
  });
  float total = 0;
  for (const float p : partial) total += p;
  return total;
}

}  // namespace

TEST_CASE("every chunk exactly once, with the bounds that the serial executor gives") {
  for (const unsigned threads : {1U, 2U, 5U}) {
    ThreadPool pool(threads);
    CHECK(pool.thread_count() == threads);
    for (const std::size_t count : std::array<std::size_t, 7>{0, 1, 2, 7, 64, 1000, 1001}) {
      for (const std::size_t chunk : std::array<std::size_t, 6>{0, 1, 3, 64, 1000, 5000}) {
        CAPTURE(threads);
        CAPTURE(count);
        CAPTURE(chunk);
        const std::size_t step = chunk == 0 ? 1 : chunk;
        std::vector<std::atomic<int>> calls(chunk_count(count, chunk));
        std::vector<std::size_t> ends(calls.size());
        std::atomic<bool> aligned{true};
        pool.for_chunks(count, chunk, [&](std::size_t begin, std::size_t end) {
          if (begin % step != 0 || begin >= count) {
            aligned = false;
            return;
          }
          ++calls[begin / step];
          ends[begin / step] = end;
        });
        CHECK(aligned.load());
        for (std::size_t i = 0; i < calls.size(); ++i) {
          REQUIRE(calls[i].load() == 1);
          REQUIRE(ends[i] == (count - i * step < step ? count : (i + 1) * step));
        }
      }
    }
  }
}

TEST_CASE("the same bits for 1, 2 and 5 threads and for the serial executor") {
  std::vector<float> values(10007);
  for (std::size_t i = 0; i < values.size(); ++i) {
    npsim::RandomStream random(1, npsim::RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(i), 0);
    values[i] = random.uniform(-1.0F, 1.0F) * (i % 3 == 0 ? 1e6F : 1e-3F);
  }
  SerialExecutor serial;
  const float expected = ordered_sum(values, serial);
  for (const unsigned threads : {1U, 2U, 5U}) {
    ThreadPool pool(threads);
    for (int repeat = 0; repeat < 20; ++repeat) CHECK(ordered_sum(values, pool) == expected);
  }
}

TEST_CASE("counts near the largest number end, with chunks that add up to them") {
  constexpr std::size_t kMax = ~std::size_t{0};
  ThreadPool pool(3);
  std::atomic<std::size_t> sum{0};
  std::atomic<int> calls{0};
  pool.for_chunks(kMax, kMax / 3, [&](std::size_t begin, std::size_t end) {
    sum += end - begin;
    ++calls;
  });
  CHECK(sum.load() == kMax);
  CHECK(calls.load() == 3);
}

TEST_CASE("a pool is used a thousand times") {
  ThreadPool pool(4);
  std::vector<std::uint32_t> values(50, 0);
  for (int repeat = 0; repeat < 1000; ++repeat) {
    pool.for_chunks(values.size(), 3, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) ++values[i];
    });
  }
  for (const std::uint32_t value : values) CHECK(value == 1000);
}

TEST_CASE("pools come and go without work") {
  for (int i = 0; i < 100; ++i) ThreadPool pool(3);
}

TEST_CASE("a call within a call runs serially, and ends") {
  ThreadPool pool(4);
  std::array<std::atomic<int>, 64> cells{};
  std::atomic<bool> same_thread{true};
  pool.for_chunks(8, 1, [&](std::size_t outer, std::size_t) {
    const std::thread::id self = std::this_thread::get_id();
    pool.for_chunks(8, 1, [&](std::size_t inner, std::size_t) {
      if (std::this_thread::get_id() != self) same_thread = false;
      ++cells[outer * 8 + inner];
    });
  });
  for (const auto& cell : cells) CHECK(cell.load() == 1);
  CHECK(same_thread.load());
}

TEST_CASE("two threads that use one pool at once both get all of their chunks") {
  ThreadPool pool(3);
  std::array<std::atomic<std::size_t>, 2> sums{};
  const auto use = [&](std::size_t who) {
    for (int repeat = 0; repeat < 200; ++repeat) {
      pool.for_chunks(100, 7, [&](std::size_t begin, std::size_t end) { sums[who] += end - begin; });
    }
  };
  std::thread other([&] { use(1); });
  use(0);
  other.join();
  CHECK(sums[0].load() == 20000);
  CHECK(sums[1].load() == 20000);
}

TEST_CASE("work that waits for two chunks at once needs two threads, and gets them") {
  ThreadPool pool(2);
  REQUIRE(pool.thread_count() == 2);
  std::atomic<int> arrived{0};
  pool.for_chunks(2, 1, [&](std::size_t, std::size_t) {
    ++arrived;
    while (arrived.load() < 2) std::this_thread::yield();
  });
  CHECK(arrived.load() == 2);
}

TEST_CASE("callables are taken by reference: const, mutable, move-only") {
  ThreadPool pool(2);
  std::atomic<int> calls{0};
  const auto constant = [&](std::size_t, std::size_t) { ++calls; };
  pool.for_chunks(10, 1, constant);
  const auto owner = std::make_unique<int>(1);
  struct MoveOnly {
    std::atomic<int>& calls;
    std::unique_ptr<int> owned;
    void operator()(std::size_t, std::size_t) { calls += *owned; }
  };
  MoveOnly callable{calls, std::make_unique<int>(1)};
  pool.for_chunks(10, 1, callable);
  pool.for_chunks(10, 1, [&calls, own = std::make_unique<int>(1)](std::size_t, std::size_t) mutable { calls += *own; });
  CHECK(calls.load() == 30);
}
