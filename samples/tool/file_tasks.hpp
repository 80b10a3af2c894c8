// SPDX-License-Identifier: Apache-2.0
// Files that are made side by side: encoding one takes a processor longer than the disk needs to take it.
#ifndef NPSIM_SAMPLES_TOOL_FILE_TASKS_HPP
#define NPSIM_SAMPLES_TOOL_FILE_TASKS_HPP

#include <cstddef>
#include <functional>
#include <new>
#include <string>
#include <vector>

#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/error.hpp"

namespace npsim::tool {

struct FileTask {
  std::string path;  // named where memory runs out
  std::function<io::Outcome()> write;
};

// Tries all of them; the error is that of the first in the list that failed.
[[nodiscard]] inline io::Outcome write_files(const std::vector<FileTask>& tasks, ThreadPool& pool) {
  std::vector<io::Outcome> outcomes;
  for (const FileTask& task : tasks) {  // written down while there is memory for it
    outcomes.emplace_back(io::Error{task.path, "", "could not be made: expected more free memory"});
  }
  pool.for_chunks(tasks.size(), 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      try {
        outcomes[i] = tasks[i].write();
      } catch (const std::bad_alloc&) {  // what stands there says so
      }
    }
  });
  for (const io::Outcome& outcome : outcomes) {
    if (!outcome) return outcome;
  }
  return io::Done{};
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_FILE_TASKS_HPP
