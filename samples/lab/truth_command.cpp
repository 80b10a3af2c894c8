// SPDX-License-Identifier: Apache-2.0
#include "truth_command.hpp"

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <system_error>
#include <vector>

#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/pfm.hpp"
#include "tool/console.hpp"
#include "tool/loading.hpp"
#include "tool/options.hpp"
#include "tool/outputs.hpp"
#include "truth_night.hpp"

namespace npsim::tool {
namespace {

constexpr std::uint64_t kSamplesPerPass = 32;  // what an interruption loses at most
constexpr std::chrono::seconds kKeepEvery{30};

struct TruthFiles {
  std::string all, error, direct, emitted, partial;

  explicit TruthFiles(const std::string& output) {
    const std::string stem = std::filesystem::path(output).replace_extension().string();
    all = output;
    error = stem + "_error.pfm";
    direct = stem + "_direct.pfm";
    emitted = stem + "_emitted.pfm";
    partial = output + ".partial";
  }
};

// The partial file: a line of text that says what it belongs to, then the sums, seven doubles a pixel as the machine
// has them.
static_assert(sizeof(reference::PixelSums) == 7 * sizeof(double), "sums are written as they lie in memory");

[[nodiscard]] std::string partial_header(std::uint64_t print, std::uint64_t samples) {
  char text[96];
  std::snprintf(text, sizeof text, "npsim truth 1 %016llx %llu\n", static_cast<unsigned long long>(print),
                static_cast<unsigned long long>(samples));
  return text;
}

[[nodiscard]] io::Outcome keep(const std::string& path, std::uint64_t print, const TruthSums& sums) {
  std::string bytes = partial_header(print, sums.samples);
  bytes.append(reinterpret_cast<const char*>(sums.pixels.data()), sums.pixels.size() * sizeof(reference::PixelSums));
  return io::write_file(path, bytes);
}

// Takes up what an earlier run left; nothing where there is no such file.
[[nodiscard]] io::Outcome resume(const std::string& path, std::uint64_t print, std::size_t pixels,
                                 std::uint64_t samples, TruthSums& sums) {
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) return io::Done{};
  std::ifstream file(path, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const std::string header = bytes.substr(0, bytes.find('\n') + 1);
  unsigned long long kept = 0;
  unsigned long long of = 0;
  if (std::sscanf(header.c_str(), "npsim truth 1 %llx %llu", &of, &kept) != 2 || header != partial_header(of, kept)) {
    return io::Error{path, "", "is not what npsim truth keeps, expected no file or one of its own: move it away"};
  }
  if (of != print || bytes.size() - header.size() != pixels * sizeof(reference::PixelSums)) {
    return io::Error{path, "",
                     "was begun with another scene, night, seed or other settings: expected the same, or "
                     "remove it to begin anew"};
  }
  if (kept > samples || kept % reference::kBlock != 0) {
    return io::Error{
        path, "--samples",
        "the file holds " + std::to_string(kept) + " samples a pixel, expected to be asked for at least as many"};
  }
  sums.samples = kept;
  sums.pixels.resize(pixels);
  std::memcpy(static_cast<void*>(sums.pixels.data()), bytes.data() + header.size(), bytes.size() - header.size());
  return io::Done{};
}

[[nodiscard]] io::Outcome write_planes(const TruthFiles& files, const TruthNight& night, const TruthSums& sums) {
  io::Image<Vec3f> all(night.shape);
  io::Image<Vec3f> direct(night.shape);
  io::Image<Vec3f> emitted(night.shape);
  io::Image<float> error(night.shape);
  const auto n = static_cast<double>(sums.samples);
  for (std::size_t p = 0; p < night.seen.size(); ++p) {
    const reference::PixelSums& sum = sums.pixels[p];
    all.data()[p] = vec_cast<float>(sum.light / n + night.emitted[p] + night.sky[p]);
    direct.data()[p] = vec_cast<float>(sum.direct / n);
    emitted.data()[p] = vec_cast<float>(night.emitted[p]);
    error.data()[p] = static_cast<float>(reference::standard_error(sum, sums.samples));
  }
  const auto view = [](const auto& image) { return image.view(); };
  if (auto o = io::write_pfm(files.error, view(std::as_const(error))); !o) return o;
  if (auto o = io::write_pfm(files.direct, view(std::as_const(direct))); !o) return o;
  if (auto o = io::write_pfm(files.emitted, view(std::as_const(emitted))); !o) return o;
  return io::write_pfm(files.all, view(std::as_const(all)));
}

// Up to the wanted number of samples; kept now and then, and when interrupted.
[[nodiscard]] io::Outcome trace(const TruthNight& night, const reference::PathParams& params, std::uint64_t samples,
                                const std::string& partial, std::uint64_t print, TruthSums& sums, ThreadPool& pool,
                                Console& console) {
  const TruthTracer tracer(night, params);
  console.begin("path tracing");
  auto kept = std::chrono::steady_clock::now();
  while (sums.samples < samples) {
    const bool done = tracer.add(std::min(sums.samples + kSamplesPerPass, samples), sums, pool, console);
    const auto now = std::chrono::steady_clock::now();
    if ((!done && sums.samples > 0) || (sums.samples < samples && now - kept > kKeepEvery)) {
      if (const io::Outcome written = keep(partial, print, sums); !written) return written;
      kept = now;
    }
    if (!done) break;
    console.progress(sums.samples, samples);
  }
  console.end("path tracing");
  return io::Done{};
}

}  // namespace

int run_truth(const TruthOptions& options) {
  Console console(options.quiet);
  if (std::filesystem::path(options.output).extension() != ".pfm") {
    return fail(io::Error{options.output, "", "expected a name that ends in .pfm"});
  }
  const TruthFiles files(options.output);
  const io::Expected<io::Scene> loaded =
      console.timed("read scene", [&] { return load_scene(options.scene, options.size); });
  if (!loaded) return fail(loaded.error());
  const io::Scene& scene = loaded.value();
  InputFiles inputs(scene);
  inputs.add(options.night, "the night");
  const std::vector<std::string> outputs{files.all, files.error, files.direct, files.emitted, files.partial};
  if (const io::Outcome apart = inputs.expect_none_of(outputs); !apart) return fail(apart.error());
  const io::Expected<TruthNight> night =
      console.timed("true mesh and lamps", [&] { return make_truth_night(scene, options.night); });
  if (!night) return fail(night.error());

  reference::PathParams params;
  params.seed = options.seed;
  params.bounces = options.bounces;
  const std::uint64_t print = fingerprint(night.value(), params);
  const std::uint64_t blocks =
      (static_cast<std::uint64_t>(options.samples) + reference::kBlock - 1) / reference::kBlock;
  const std::uint64_t samples = std::max<std::uint64_t>(blocks, 2) * reference::kBlock;
  TruthSums sums;
  if (const io::Outcome resumed = resume(files.partial, print, night.value().seen.size(), samples, sums); !resumed) {
    return fail(resumed.error());
  }
  if (sums.samples > 0 && !options.quiet) {
    std::fprintf(stderr, "  goes on from %llu samples of %s\n", static_cast<unsigned long long>(sums.samples),
                 files.partial.c_str());
  }
  const std::filesystem::path folder = std::filesystem::absolute(options.output).parent_path();
  if (const io::Outcome made = make_folder(folder.string()); !made) return fail(made.error());
  ThreadPool pool(thread_count(options.threads));
  const io::Outcome traced = trace(night.value(), params, samples, files.partial, print, sums, pool, console);
  if (!traced) return fail(traced.error());
  if (sums.samples < samples) {
    std::fprintf(stderr, "npsim: interrupted; the same command goes on\n");
    return kExitInterrupted;
  }
  if (const io::Outcome written = write_planes(files, night.value(), sums); !written) {
    if (const io::Outcome kept = keep(files.partial, print, sums); !kept) return fail(kept.error());
    return fail(written.error());
  }
  std::error_code ignored;
  if (!options.keep) {
    std::filesystem::remove(files.partial, ignored);
  } else if (const io::Outcome kept = keep(files.partial, print, sums); !kept) {
    return fail(kept.error());
  }
  std::printf("%s\n", files.all.c_str());
  return kExitDone;
}

}  // namespace npsim::tool
