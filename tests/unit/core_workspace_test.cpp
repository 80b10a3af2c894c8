// SPDX-License-Identifier: Apache-2.0
#include "npsim/core/workspace.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <vector>

using npsim::allocation_bytes;
using npsim::ImageView;
using npsim::kWorkspaceAlignment;
using npsim::Span;
using npsim::StatusCode;
using npsim::Workspace;
using npsim::WorkspaceScope;

namespace {

template <class T>
bool aligned(const T* pointer) {
  return reinterpret_cast<std::uintptr_t>(pointer) % kWorkspaceAlignment == 0;
}

}  // namespace

TEST_CASE("bytes of an allocation are padded to the alignment") {
  static_assert(allocation_bytes<float>(0) == 0);
  static_assert(allocation_bytes<char>(1) == kWorkspaceAlignment);
  static_assert(allocation_bytes<char>(64) == 64);
  static_assert(allocation_bytes<char>(65) == 128);
  static_assert(allocation_bytes<double>(9) == 128);
}

TEST_CASE("every start of the caller's bytes: aligned, inside, without overlap, and the promised size suffices") {
  constexpr std::size_t kNeed = allocation_bytes<char>(3) + allocation_bytes<double>(17) + allocation_bytes<char>(1);
  std::vector<unsigned char> memory(kNeed + 2 * kWorkspaceAlignment);
  for (std::size_t offset = 0; offset < kWorkspaceAlignment; ++offset) {
    CAPTURE(offset);
    unsigned char* begin = memory.data() + offset;
    Workspace workspace(begin, kNeed + kWorkspaceAlignment);
    Span<char> a;
    Span<double> b;
    Span<char> c;
    REQUIRE(workspace.allocate(3, a).ok());
    REQUIRE(workspace.allocate(17, b).ok());
    REQUIRE(workspace.allocate(1, c).ok());
    CHECK(aligned(a.data()));
    CHECK(aligned(b.data()));
    CHECK(aligned(c.data()));
    CHECK(reinterpret_cast<unsigned char*>(a.begin()) >= begin);
    CHECK(reinterpret_cast<unsigned char*>(b.begin()) >= reinterpret_cast<unsigned char*>(a.end()));
    CHECK(reinterpret_cast<unsigned char*>(c.begin()) >= reinterpret_cast<unsigned char*>(b.end()));
    CHECK(reinterpret_cast<unsigned char*>(c.end()) <= begin + kNeed + kWorkspaceAlignment);
    for (double& value : b) value = 1.0;  // under the address sanitizer this must be ours
  }
}

TEST_CASE("exhaustion is a status, leaves the output alone, and the arena stays usable") {
  alignas(kWorkspaceAlignment) unsigned char memory[256];
  Workspace workspace(memory, sizeof(memory));
  CHECK(workspace.capacity() == 256);
  Span<float> kept;
  REQUIRE(workspace.allocate(16, kept).ok());
  Span<float> out(kept.data(), 1);
  CHECK(workspace.allocate(64, out).code() == StatusCode::workspace_exhausted);
  CHECK(out.size() == 1);
  CHECK(workspace.used() == 64);
  CHECK(workspace.allocate(48, out).ok());
  CHECK(workspace.used() == 256);
  CHECK(workspace.allocate(1, out).code() == StatusCode::workspace_exhausted);
  CHECK(workspace.allocate(0, out).ok());
  CHECK(out.empty());
}

TEST_CASE("counts whose size in bytes wraps round are refused") {
  alignas(kWorkspaceAlignment) unsigned char memory[256];
  Workspace workspace(memory, sizeof(memory));
  Span<double> out;
  CHECK_FALSE(workspace.allocate(~std::size_t{0}, out).ok());
  CHECK_FALSE(workspace.allocate(~std::size_t{0} / sizeof(double), out).ok());
  CHECK_FALSE(workspace.allocate(~std::size_t{0} / sizeof(double) + 2, out).ok());
  Span<char> bytes;
  CHECK_FALSE(workspace.allocate(~std::size_t{0} - 1, bytes).ok());
  CHECK(workspace.used() == 0);
}

TEST_CASE("no memory, and too little to align, hold nothing but do not crash") {
  unsigned char byte = 0;
  Workspace none;
  Workspace null(nullptr, 1000);
  Workspace tiny(&byte, 1);
  Span<char> out;
  CHECK_FALSE(none.allocate(1, out).ok());
  CHECK_FALSE(null.allocate(1, out).ok());
  CHECK_FALSE(tiny.allocate(1, out).ok());
}

TEST_CASE("scopes give back in reverse order, the peak remembers the most that was used") {
  alignas(kWorkspaceAlignment) unsigned char memory[1024];
  Workspace workspace(memory, sizeof(memory));
  Span<char> a;
  Span<char> b;
  Span<char> c;
  REQUIRE(workspace.allocate(64, a).ok());
  {
    const WorkspaceScope outer(workspace);
    REQUIRE(workspace.allocate(128, b).ok());
    {
      const WorkspaceScope inner(workspace);
      REQUIRE(workspace.allocate(256, c).ok());
      CHECK(workspace.used() == 448);
    }
    CHECK(workspace.used() == 192);
  }
  CHECK(workspace.used() == 64);
  CHECK(workspace.peak() == 448);
  REQUIRE(workspace.allocate(128, c).ok());
  CHECK(c.data() == b.data());
  CHECK(workspace.peak() == 448);
  CHECK_FALSE(workspace.allocate(2000, c).ok());
  CHECK(workspace.peak() == 448);
}

TEST_CASE("an image from a workspace is contiguous; an empty one takes nothing") {
  alignas(kWorkspaceAlignment) unsigned char memory[1024];
  Workspace workspace(memory, sizeof(memory));
  ImageView<float> image;
  REQUIRE(workspace.allocate_image({7, 5}, image).ok());
  CHECK(image.contiguous());
  CHECK(image.shape() == npsim::Shape{7, 5});
  CHECK(workspace.used() == allocation_bytes<float>(35));
  const std::size_t before = workspace.used();
  REQUIRE(workspace.allocate_image({-7, 5}, image).ok());
  CHECK(image.empty());
  CHECK(workspace.used() == before);
  CHECK_FALSE(workspace.allocate_image({70000, 70000}, image).ok());
}

TEST_CASE("the latest allocation can be shortened, an earlier one not") {
  alignas(kWorkspaceAlignment) unsigned char memory[1024];
  Workspace workspace(memory, sizeof(memory));
  Span<int> first;
  Span<int> second;
  REQUIRE(workspace.allocate(16, first).ok());
  REQUIRE(workspace.allocate(100, second).ok());
  workspace.shorten(first, 1);
  CHECK(first.size() == 16);
  workspace.shorten(second, 17);
  CHECK(second.size() == 17);
  CHECK(workspace.used() == 64 + 128);
  workspace.shorten(second, 20);  // longer is not shorter
  CHECK(second.size() == 17);
  CHECK(workspace.used() == 64 + 128);
  CHECK(workspace.peak() == 64 + 448);
}

TEST_CASE("room is there, is made where the owner can make it, or is refused with the workspace as it was") {
  constexpr std::size_t kShare = kWorkspaceAlignment;  // of every workspace_bytes(), for the first byte
  alignas(kWorkspaceAlignment) unsigned char memory[1024];
  Workspace plain(memory, 512);
  CHECK(plain.ensure(512 + kShare).ok());
  CHECK(plain.ensure(513 + kShare).code() == StatusCode::workspace_exhausted);
  Workspace askew(memory + 1, 512 + kShare);  // what a vector of bytes gives
  CHECK(askew.ensure(512 + kShare).ok());

  struct Owner {
    std::size_t limit;
    int calls = 0;
    static std::size_t grow(void* self, std::size_t bytes) {
      auto& owner = *static_cast<Owner*>(self);
      ++owner.calls;
      return bytes <= owner.limit ? bytes : owner.limit;
    }
  } owner{1000};
  for (const std::size_t offset : {std::size_t{0}, std::size_t{1}}) {
    owner.calls = 0;
    Workspace growing(memory + offset, offset == 0 ? 0U : 64U, {&owner, &Owner::grow});
    CHECK(growing.ensure(200 + kShare).ok());
    CHECK(owner.calls == 1);
    Span<char> taken;
    REQUIRE(growing.allocate(128, taken).ok());
    CHECK(growing.ensure(72 + kShare).ok());
    CHECK(owner.calls == 1);
    CHECK(growing.ensure(500 + kShare).ok());
    CHECK(growing.capacity() >= 628);
    CHECK(offset + growing.capacity() <= 1000);
    CHECK(growing.ensure(900 + kShare).code() == StatusCode::workspace_exhausted);
    CHECK(growing.ensure(~std::size_t{0}).code() == StatusCode::workspace_exhausted);
    CHECK(growing.used() == 128);
  }
}
