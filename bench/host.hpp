// SPDX-License-Identifier: Apache-2.0
// What both benchmark programs need around a kernel: memory, and a way to stop where it fails.
#ifndef NPSIM_BENCH_HOST_HPP
#define NPSIM_BENCH_HOST_HPP

#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "npsim/core/status.hpp"
#include "npsim/core/workspace.hpp"

namespace npsim::bench {

// A benchmark that cannot run its kernel has nothing to say.
inline void must(const Status& status) {
  if (status.ok()) return;
  std::fprintf(stderr, "benchmark: %s: %s\n", status_code_name(status.code()), status.message());
  std::exit(1);
}

// A workspace with its memory.
class Arena {
 public:
  explicit Arena(std::size_t bytes)
      : memory_(bytes + kWorkspaceAlignment), workspace_(memory_.data(), memory_.size()) {}
  [[nodiscard]] Workspace& workspace() { return workspace_; }

 private:
  std::vector<unsigned char> memory_;
  Workspace workspace_;
};

}  // namespace npsim::bench

#endif  // NPSIM_BENCH_HOST_HPP
