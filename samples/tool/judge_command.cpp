// SPDX-License-Identifier: Apache-2.0
#include "judge_command.hpp"

#include <cstdio>
#include <filesystem>
#include <utility>
#include <vector>

#include "console.hpp"
#include "figures.hpp"
#include "night_command.hpp"
#include "night_stages.hpp"
#include "npsim/exec/thread_pool.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "options.hpp"
#include "pictures.hpp"
#include "scene_truth.hpp"
#include "street_command.hpp"
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

// The street, the night that is drawn on it, and its true light; what is there already is kept.
[[nodiscard]] int prepare(const JudgeOptions& options, int seed, const StreetFiles& files) {
  if (!std::filesystem::exists(files.street + "/scene.json")) {
    StreetOptions street;
    street.output = files.street;
    street.seed = static_cast<std::uint64_t>(seed);
    street.size = options.size;
    street.threads = options.threads;
    street.quiet = options.quiet;
    if (const int failed = run_street(street); failed != kExitDone) return failed;
  }
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
    NightParams params = default_night_params();
    params.seed = static_cast<std::uint64_t>(seed);
    params.photograph = scene.photograph;
    Console console(true);
    ThreadPool pool(thread_count(options.threads));
    scenes.emplace_back();
    NightPictures pictures;
    const Status judged = night_stages(params, scene.view(), truth, night.value(),
                                       static_cast<std::uint64_t>(options.transport_samples), pool, console,
                                       scenes.back(), pictures);
    if (!judged.ok()) return fail(files.street, judged);
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
  const io::Outcome written = io::write_file(options.output + "/judge.json", json.dump(2) + "\n");
  return written ? kExitDone : fail(written.error());
}

}  // namespace npsim::tool
