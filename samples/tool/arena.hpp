// SPDX-License-Identifier: Apache-2.0
// Memory for a workspace.
#ifndef NPSIM_SAMPLES_TOOL_ARENA_HPP
#define NPSIM_SAMPLES_TOOL_ARENA_HPP

#include <cstddef>
#include <cstdlib>
#include <memory>

namespace npsim::tool {

// Uninitialised, page-aligned by the system: pages that no kernel touches cost nothing.
class Arena {
 public:
  explicit Arena(std::size_t bytes) : bytes_(bytes), data_(std::malloc(bytes)) {}
  [[nodiscard]] void* data() const { return data_.get(); }
  [[nodiscard]] std::size_t bytes() const { return data_ ? bytes_ : 0; }

 private:
  struct Free {
    void operator()(void* p) const { std::free(p); }
  };
  std::size_t bytes_;
  std::unique_ptr<void, Free> data_;
};

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_ARENA_HPP
