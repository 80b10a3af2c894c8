// SPDX-License-Identifier: Apache-2.0
#include "judge_command.hpp"

#include <cstdio>
#include <filesystem>
#include <utility>
#include <vector>

#include "night_stages.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "scene_truth.hpp"
#include "tool/console.hpp"
#include "tool/figures.hpp"
#include "tool/night_command.hpp"
#include "tool/options.hpp"
#include "tool/pictures.hpp"
#include "tool/street_command.hpp"
#include "truth_command.hpp"

namespace npsim::tool {
namespace {

struct StreetFiles {
  std::string street, night, truth, sheet;

  StreetFiles(const std::string& folder, int seed)
      : street(folder + "/street_" + std::to_string(seed)),
        night(folder + "/night_" + std::to_string(seed)),
        truth(folder + "/truth_" + std::to_string(seed) + ".pfm"),
        sheet(folder + "/night_" + std::to_string(seed) + ".png") {}
};

// The street with its depth from one source; one that is there already is kept.
[[nodiscard]] int make_street(const JudgeOptions& options, int seed, const std::string& folder,
                              const std::string& source) {
  if (std::filesystem::exists(folder + "/scene.json")) return kExitDone;
  StreetOptions street;
  street.output = folder;
  street.seed = static_cast<std::uint64_t>(seed);
  street.size = options.size;
  street.depth = source;
  street.threads = options.threads;
  street.quiet = options.quiet;
  return run_street(street);
}

// The street, the night that is drawn on it, and its true light; what is there already is kept.
[[nodiscard]] int prepare(const JudgeOptions& options, int seed, const StreetFiles& files) {
  if (const int failed = make_street(options, seed, files.street, "network"); failed != kExitDone) return failed;
  if (!std::filesystem::exists(files.night + "/night_000.json")) {
    NightOptions night;
    night.scene = files.street;
    night.output = files.night;
    night.seed = static_cast<std::uint64_t>(seed);
    night.threads = options.threads;
    night.quiet = options.quiet;
    if (const int failed = run_night(night); failed != kExitDone) return failed;
  }
  if (std::filesystem::exists(files.truth)) return kExitDone;
  TruthOptions truth;
  truth.scene = files.street;
  truth.night = files.night + "/night_000.json";
  truth.output = files.truth;
  truth.samples = options.samples;
  truth.threads = options.threads;
  truth.quiet = options.quiet;
  return run_truth(truth);
}

[[nodiscard]] NightParams night_params(int seed, const io::Scene& scene) {
  NightParams params = default_night_params();
  params.seed = static_cast<std::uint64_t>(seed);
  params.photograph = scene.photograph;
  return params;
}

// Nights of the same street with its depth from other sources: the same lamps are lit, so the true night is the same.
[[nodiscard]] int judge_sources(const JudgeOptions& options, int seed, const StreetFiles& files, const TrueNight& night,
                                const std::vector<std::uint8_t>& shop_fronts, ThreadPool& pool, Console& console,
                                std::vector<NightErrors>& rows) {
  for (const std::string& source : options.sources) {
    const std::string folder = files.street + "_" + source;
    if (const int failed = make_street(options, seed, folder, source); failed != kExitDone) return failed;
    const io::Expected<std::pair<io::Scene, Truth>> loaded = load_with_truth(folder, "", "");
    if (!loaded) return fail(loaded.error());
    const auto& [scene, truth] = loaded.value();
    const Status judged = night_of_source(night_params(seed, scene), scene.view(), truth, night, shop_fronts, source,
                                          pool, console, rows);
    if (!judged.ok()) return fail(folder, judged);
  }
  return kExitDone;
}

}  // namespace

int run_judge(const JudgeOptions& options) {
  if (options.first > options.last) return fail(io::Error{"", "--last", "expected a seed that is not before --first"});
  if (const io::Outcome made = make_folder(options.output); !made) return fail(made.error());
  std::vector<std::vector<NightErrors>> scenes;
  OrderedJson json;
  for (int seed = options.first; seed <= options.last; ++seed) {
    const StreetFiles files(options.output, seed);
    if (const int failed = prepare(options, seed, files); failed != kExitDone) return failed;
    const io::Expected<std::pair<io::Scene, Truth>> loaded = load_with_truth(files.street, "", "");
    if (!loaded) return fail(loaded.error());
    const auto& [scene, truth] = loaded.value();
    const io::Expected<TrueNight> night = read_true_night(scene, files.truth);
    if (!night) return fail(night.error());
    Console console(true);
    ThreadPool pool(thread_count(options.threads));
    scenes.emplace_back();
    NightPictures pictures;
    std::vector<std::uint8_t> shop_fronts;
    const Status judged = night_stages(night_params(seed, scene), scene.view(), truth, night.value(),
                                       static_cast<std::uint64_t>(options.transport_samples), pool, console,
                                       scenes.back(), pictures, shop_fronts);
    if (!judged.ok()) return fail(files.street, judged);
    if (const int failed =
            judge_sources(options, seed, files, night.value(), shop_fronts, pool, console, scenes.back());
        failed != kExitDone) {
      return failed;
    }
    json[std::to_string(seed)] = to_json(scenes.back());
    if (!options.quiet) {
      std::printf("\nstreet %d", seed);
      print_table(scenes.back());
      std::fflush(stdout);
    }
    const std::vector<Panel> panels = {{"day", scene.image},
                                       {"true night", std::move(pictures.truth)},
                                       {"night", std::move(pictures.own)},
                                       {"error: blue dark, red bright", std::move(pictures.signed_error)}};
    if (const io::Outcome o = io::write_png(files.sheet, contact_sheet(panels, 2).view()); !o) return fail(o.error());
  }
  const std::vector<NightErrors> mean = mean_of(scenes);
  json["mean"] = to_json(mean);
  std::printf("\nmean of streets %d to %d", options.first, options.last);
  print_table(mean);
  if (!options.sources.empty()) {
    const std::vector<SourceRatios> ratios = source_ratios(mean, options.sources);
    json["ratios"] = to_json(ratios);
    print_table(ratios);
  }
  const io::Outcome written = io::write_file(options.output + "/judge.json", json.dump(2) + "\n");
  return written ? kExitDone : fail(written.error());
}

}  // namespace npsim::tool
