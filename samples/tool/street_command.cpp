// SPDX-License-Identifier: Apache-2.0
#include "street_command.hpp"

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <system_error>

#include <nlohmann/json.hpp>

#include "console.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "options.hpp"
#include "street/street.hpp"
#include "street/write.hpp"

namespace npsim::tool {
namespace {

// A street may replace one that was generated before, and nothing else: neither another scene nor single files.
[[nodiscard]] io::Outcome expect_replaceable(const std::string& folder) {
  namespace fs = std::filesystem;
  std::error_code ignored;
  const std::string scene_file = folder + "/scene.json";
  if (fs::is_regular_file(scene_file, ignored)) {
    std::ifstream file(scene_file, std::ios::binary);
    const nlohmann::json scene = nlohmann::json::parse(file, nullptr, false);
    const auto generator = scene.is_object() ? scene.find("generator") : scene.end();
    if (generator != scene.end() && *generator == street::kGenerator) return io::Done{};
    return io::Error{scene_file, "generator",
                     std::string("is not \"") + street::kGenerator +
                         "\", so this scene was made by somebody else: expected a new folder or a generated street"};
  }
  for (const char* name : street::kStreetFiles) {
    const std::string path = folder + "/" + name;
    if (fs::exists(fs::symlink_status(path, ignored))) {
      return io::Error{path, "", "would be written over: expected a new folder or a generated street"};
    }
  }
  return io::Done{};
}

}  // namespace

int run_street(const StreetOptions& options) {
  const io::Expected<Shape> size = parse_size(options.size);
  if (!size) return fail(size.error());
  if (const io::Outcome free = expect_replaceable(options.output); !free) return fail(free.error());
  if (const io::Outcome folder = make_folder(options.output); !folder) return fail(folder.error());
  Console console(options.quiet);
  street::StreetParams params;
  params.seed = options.seed;
  params.shape = size.value();
  params.depth = depth_source_named(options.depth);  // one of them, the options say
  params.materials = options.albedo != "none";
  ThreadPool pool(thread_count(options.threads));
  const InterruptibleExecutor executor{pool};
  street::Street street;
  const Status made =
      console.timed("build and photograph", [&] { return street::make_street(params, executor, street); });
  if (console.cancelled()) return fail(options.output, Status(StatusCode::cancelled, ""));
  if (!made.ok()) return fail(options.output, made);
  const io::Outcome written =
      console.timed("write scene", [&] { return street::write_street(street, options.output); });
  if (!written) return fail(written.error());
  std::printf("%s\n", (options.output + "/scene.json").c_str());
  return kExitDone;
}

}  // namespace npsim::tool
