// SPDX-License-Identifier: Apache-2.0
// The core as a target without an operating system uses it: static memory, no exceptions, no RTTI. The heap is
// replaced by a trap, so that an allocation anywhere in the core fails the test. The exit status is the number of the
// first check that failed.
#include <cmath>
#include <cstdlib>
#include <new>

#include "npsim/npsim.hpp"

void* operator new(std::size_t) { std::abort(); }
void* operator new[](std::size_t) { std::abort(); }
void operator delete(void*) noexcept {}
void operator delete[](void*) noexcept {}
void operator delete(void*, std::size_t) noexcept {}
void operator delete[](void*, std::size_t) noexcept {}

namespace {

constexpr npsim::Shape kShape{64, 48};

alignas(npsim::kWorkspaceAlignment) unsigned char memory[npsim::allocation_bytes<npsim::Vec3f>(kShape.pixels()) +
                                                         npsim::allocation_bytes<float>(kShape.pixels())];

int first_failure() {
  npsim::Workspace workspace(memory, sizeof(memory));
  npsim::ImageView<npsim::Vec3f> points;
  npsim::ImageView<float> depth_m;
  if (!workspace.allocate_image(kShape, points).ok()) return 1;
  if (!workspace.allocate_image(kShape, depth_m).ok()) return 2;

  const npsim::Intrinsics camera = npsim::intrinsics_from_fov(kShape, 1.2F);
  const npsim::SerialExecutor executor;
  executor.for_chunks(static_cast<std::size_t>(kShape.height), 4, [&](std::size_t begin, std::size_t end) {
    for (int y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < kShape.width; ++x) {
        const auto pixel = static_cast<std::uint32_t>(y * kShape.width + x);
        npsim::RandomStream random(1, npsim::RandomPurpose::test, 0, 0, pixel, 0);
        depth_m(x, y) = random.uniform(1.0F, 80.0F);
        points(x, y) = npsim::unproject_pixel(camera, x, y, depth_m(x, y));
      }
    }
  });
  for (int y = 0; y < kShape.height; ++y) {
    for (int x = 0; x < kShape.width; ++x) {
      const npsim::Vec2f p = npsim::project(camera, points(x, y));
      if (!(std::fabs(p.x - (static_cast<float>(x) + 0.5F)) < 1e-3F)) return 3;
      if (!(std::fabs(p.y - (static_cast<float>(y) + 0.5F)) < 1e-3F)) return 4;
    }
  }

  npsim::Span<float> too_much;
  if (workspace.allocate(1, too_much).code() != npsim::StatusCode::workspace_exhausted) return 5;
  return workspace.peak() == workspace.capacity() ? 0 : 6;
}

}  // namespace

int main() { return first_failure(); }
