// SPDX-License-Identifier: Apache-2.0
// ThreadPool: the executor concept of core/executor.hpp over a fixed number of std::threads. For hosts.
//
// for_chunks(count, chunk, f) hands out chunks through one counter; the calling thread works too. Which thread runs a
// chunk is not determined, which chunks there are is: they are those of SerialExecutor, so results that depend on
// chunks alone are the same for any number of threads.
// A call from within f, and a call while another thread uses the same pool, run serially in the thread that calls.
// f must not throw: an exception that leaves it in a worker ends the program.
// Cost: one wake-up of the workers per call (tens of microseconds) and one atomic addition per chunk; no heap.
#ifndef NPSIM_EXEC_THREAD_POOL_HPP
#define NPSIM_EXEC_THREAD_POOL_HPP

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <system_error>
#include <thread>
#include <type_traits>
#include <vector>

#include "npsim/core/executor.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

class ThreadPool {
 public:
  // `threads` counts the caller; 0 takes what the machine offers. Where the system refuses a thread, the pool has
  // fewer.
  explicit ThreadPool(unsigned threads = 0) {
    const unsigned wanted = threads != 0 ? threads : std::thread::hardware_concurrency();
    try {
      for (unsigned i = 1; i < wanted; ++i) workers_.emplace_back([this] { work(); });
    } catch (const std::system_error&) {
      return;  // slower, with the same results
    }
  }

  ~ThreadPool() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stop_ = true;
    }
    wake_.notify_all();
    for (std::thread& worker : workers_) worker.join();
  }

  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  // Threads that work on a call, the caller included.
  [[nodiscard]] std::size_t thread_count() const noexcept { return workers_.size() + 1; }

  template <class F>
  void for_chunks(std::size_t count, std::size_t chunk, F&& f) {
    const std::size_t step = chunk == 0 ? 1 : chunk;
    if (workers_.empty() || count <= step || busy_.test_and_set(std::memory_order_acquire)) {
      SerialExecutor().for_chunks(count, step, f);
      return;
    }
    using Function = std::remove_reference_t<F>;
    Job job;
    job.call = [](void* function, std::size_t begin, std::size_t end) {
      (*static_cast<Function*>(function))(begin, end);
    };
    job.function = const_cast<void*>(static_cast<const void*>(std::addressof(f)));
    job.count = count;
    job.step = step;
    job.chunks = chunk_count(count, step);
    publish(&job);
    run(job);
    retire();
    busy_.clear(std::memory_order_release);
  }

 private:
  // Lives on the stack of the call; workers see it between publish() and retire().
  struct Job {
    void (*call)(void* function, std::size_t begin, std::size_t end) = nullptr;
    void* function = nullptr;
    std::size_t count = 0;
    std::size_t step = 1;
    std::size_t chunks = 0;
    std::atomic<std::size_t> next{0};
  };

  static void run(Job& job) {
    for (std::size_t i = job.next.fetch_add(1, std::memory_order_relaxed); i < job.chunks;
         i = job.next.fetch_add(1, std::memory_order_relaxed)) {
      const std::size_t begin = i * job.step;
      job.call(job.function, begin, job.count - begin < job.step ? job.count : begin + job.step);
    }
  }

  void publish(Job* job) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      job_ = job;
      ++generation_;
    }
    wake_.notify_all();
  }

  // Every chunk has been taken: no worker may join any more, and those at work are waited for.
  void retire() {
    std::unique_lock<std::mutex> lock(mutex_);
    job_ = nullptr;
    idle_.wait(lock, [this] { return at_work_ == 0; });
  }

  void work() {
    std::uint64_t seen = 0;  // the last job this worker took part in: it joins each at most once
    std::unique_lock<std::mutex> lock(mutex_);
    for (;;) {
      wake_.wait(lock, [&] { return stop_ || (job_ != nullptr && generation_ != seen); });
      if (stop_) return;
      seen = generation_;
      Job& job = *job_;
      ++at_work_;
      lock.unlock();
      run(job);
      lock.lock();
      if (--at_work_ == 0) idle_.notify_one();
    }
  }

  std::atomic_flag busy_ = ATOMIC_FLAG_INIT;
  std::mutex mutex_;  // guards everything below except workers_
  std::condition_variable wake_;
  std::condition_variable idle_;
  Job* job_ = nullptr;
  std::uint64_t generation_ = 0;
  std::size_t at_work_ = 0;
  bool stop_ = false;
  std::vector<std::thread> workers_;
};

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_EXEC_THREAD_POOL_HPP
