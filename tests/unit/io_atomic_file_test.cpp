// SPDX-License-Identifier: Apache-2.0
#include "npsim/io/atomic_file.hpp"

#include <sys/stat.h>

#include <cstdio>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "io_fixture.hpp"

using namespace io_test;
using namespace npsim;

TEST_CASE("a file is replaced as a whole, and nothing else stays") {
  const TemporaryFolder folder;
  require_ok(io::write_file(folder / "a", "one"));
  require_ok(io::write_file(folder / "a", "another"));
  CHECK(contents(folder / "a") == "another");
  require_ok(io::write_file(folder / "a", ""));
  CHECK(contents(folder / "a").empty());
  CHECK(folder.files() == 1);
}

TEST_CASE("what another writer left under a temporary name is neither used nor disturbed") {
  const TemporaryFolder folder;
  const std::string other = folder / "a.0.partial";
  std::FILE* file = std::fopen(other.c_str(), "wb");
  REQUIRE(file != nullptr);
  std::fputs("half", file);
  std::fclose(file);
  require_ok(io::write_file(folder / "a", "whole"));
  CHECK(contents(folder / "a") == "whole");
  CHECK(contents(other) == "half");
  CHECK(folder.files() == 2);
}

TEST_CASE("many writers of one file: it is always that of one of them, complete") {
  const TemporaryFolder folder;
  std::vector<std::thread> writers;
  std::vector<int> failed(4, 0);
  for (int w = 0; w < 4; ++w) {
    writers.emplace_back([&, w] {
      const std::string text(100000, static_cast<char>('a' + w));
      for (int i = 0; i < 50; ++i) failed[static_cast<std::size_t>(w)] += io::write_file(folder / "a", text) ? 0 : 1;
    });
  }
  for (std::thread& t : writers) t.join();
  for (const int f : failed) CHECK(f == 0);
  const std::string text = contents(folder / "a");
  CHECK(text == std::string(100000, text[0]));
  CHECK(folder.files() == 1);
}

TEST_CASE("a pipe or a device is refused and stays what it is") {
  const TemporaryFolder folder;
  const std::string pipe = folder / "pipe";
  REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
  check_error(io::write_file(pipe, "text"), "pipe", "expected a file");
  CHECK(std::filesystem::is_fifo(pipe));
  CHECK(folder.files() == 1);
}

TEST_CASE("where no file can be, the error names it and nothing is left") {
  const TemporaryFolder folder;
  check_error(io::write_file(folder / "no/such/folder/a", "text"), "no/such/folder/a", "writable folder");
  std::filesystem::create_directory(folder / "taken");
  std::filesystem::create_directory(folder / "taken/inside");
  check_error(io::write_file(folder / "taken", "text"), "taken");
  CHECK(folder.files() == 1);
}
