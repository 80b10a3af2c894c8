// SPDX-License-Identifier: Apache-2.0
#include "segmentation_evaluation.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <system_error>
#include <utility>

#include "npsim/core/config.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "tool/figures.hpp"
#include "tool/options.hpp"
#include "tool/outputs.hpp"

namespace npsim::tool {
namespace {

namespace fs = std::filesystem;

[[nodiscard]] bool ends_in(const std::string& text, const std::string& end) {
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

// What names the picture in a file's name.
[[nodiscard]] std::string picture_name(const fs::path& path) {
  std::string name = path.stem().string();
  const auto ending = [&] {
    return std::find_if(kNameEndings.begin(), kNameEndings.end(), [&](const char* e) { return ends_in(name, e); });
  };
  for (auto e = ending(); e != kNameEndings.end(); e = ending()) name.resize(name.size() - std::string(*e).size());
  return name;
}

using Named = std::map<std::string, std::string>;  // file by the name of its picture

// PNGs of the folder and those below it whose names, without .png, end so.
[[nodiscard]] io::Expected<Named> pngs(const std::string& folder, const std::string& option, const std::string& end) {
  Named found;
  std::error_code code;
  fs::recursive_directory_iterator at(folder, fs::directory_options::follow_directory_symlink, code);
  for (; !code && at != fs::recursive_directory_iterator(); at.increment(code)) {
    const fs::path& path = at->path();
    std::error_code ignored;
    if (path.extension() != ".png" || !ends_in(path.stem().string(), end) || !at->is_regular_file(ignored)) continue;
    const auto [other, first] = found.emplace(picture_name(path), path.string());
    if (!first) {
      return io::Error{path.string(), "name", "is of the same picture as " + other->second + ", expected one of them"};
    }
  }
  if (code) return io::Error{folder, option, "cannot be read: expected a folder"};
  return found;
}

// `what` for every picture that has labels, and none besides.
[[nodiscard]] io::Outcome assign(const Named& found, const std::string& folder, const char* what,
                                 std::vector<SegmentationFiles>& files, std::string SegmentationFiles::*member) {
  std::size_t used = 0;
  for (SegmentationFiles& f : files) {
    const auto file = found.find(f.name);
    if (file == found.end()) {
      return io::Error{f.labels, "",
                       std::string("has no ") + what + " in " + folder + ": expected a file " + f.name + "*.png"};
    }
    f.*member = file->second;
    ++used;
  }
  if (used == found.size()) return io::Done{};
  for (const auto& [name, file] : found) {
    const bool labelled = std::any_of(files.begin(), files.end(), [&n = name](const auto& f) { return f.name == n; });
    if (!labelled) {
      return io::Error{file, "", std::string("is a ") + what + " without labels: expected labels of " + name};
    }
  }
  return io::Done{};
}

// Ids as they are in a file to train ids.
[[nodiscard]] io::Expected<io::Image<std::uint8_t>> read_classes(const std::string& path, bool train_ids) {
  io::Expected<io::Image<std::uint8_t>> read = io::read_u8(path);
  if (!read) return read;
  for (std::size_t i = 0; i < read.value().shape().pixels(); ++i) {
    std::uint8_t& v = read.value().data()[i];
    if (v == kIgnoredTrainId) continue;
    if (v >= (train_ids ? kTrainIds : static_cast<std::size_t>(kLabelCount))) {
      const auto width = static_cast<std::size_t>(read.value().width());
      return io::Error{
          path, "pixel (" + std::to_string(i % width) + ", " + std::to_string(i / width) + ")",
          "is " + std::to_string(v) +
              (train_ids ? ", expected a train id: 0 to 18, 255 for none" : ", expected a label id: 0 to 33")};
    }
    if (!train_ids) v = kLabels[v].train_id;
  }
  return read;
}

[[nodiscard]] io::Expected<io::Image<float>> read_confidence(const std::string& path) {
  // Eight bits before sixteen: both are shares of their full scale.
  if (const auto narrow = io::read_u8(path); narrow) {
    io::Image<float> out(narrow.value().shape());
    std::transform(narrow.value().data(), narrow.value().data() + out.shape().pixels(), out.data(),
                   [](std::uint8_t v) { return static_cast<float>(v) / 255.0F; });
    return out;
  }
  const io::Expected<io::Image<std::uint16_t>> wide = io::read_u16(path);
  if (!wide) return wide.error();
  io::Image<float> out(wide.value().shape());
  std::transform(wide.value().data(), wide.value().data() + out.shape().pixels(), out.data(),
                 [](std::uint16_t v) { return static_cast<float>(v) / 65535.0F; });
  return out;
}

[[nodiscard]] float threshold(int i) { return static_cast<float>(i + 1) / static_cast<float>(kConfidenceThresholds); }

[[nodiscard]] io::Outcome add(const SegmentationFiles& files, bool label_train, bool prediction_train,
                              SegmentationEvaluation& out) {
  const auto truth = read_classes(files.labels, label_train);
  if (!truth) return truth.error();
  const auto prediction = read_classes(files.prediction, prediction_train);
  if (!prediction) return prediction.error();
  const Shape shape = truth.value().shape();
  if (auto o = io::expect_shape(files.prediction, prediction.value().shape(), shape, files.labels); !o) return o;
  io::Image<std::uint8_t> invalid;
  if (!files.invalid.empty()) {
    auto read = io::read_u8(files.invalid);
    if (!read) return read.error();
    invalid = std::move(read.value());
    if (auto o = io::expect_shape(files.invalid, invalid.shape(), shape, files.labels); !o) return o;
  }
  const auto mask = std::as_const(invalid).view();
  if (Status s = out.counts.add(prediction.value().view(), truth.value().view(), mask); !s.ok()) {
    return io::Error{files.prediction, "", s.message()};
  }
  if (files.confidence.empty()) return io::Done{};
  const auto confidence = read_confidence(files.confidence);
  if (!confidence) return confidence.error();
  if (auto o = io::expect_shape(files.confidence, confidence.value().shape(), shape, files.labels); !o) return o;
  for (int i = 0; i < kConfidenceThresholds; ++i) {
    const Status s = out.by_threshold[static_cast<std::size_t>(i)].add(prediction.value().view(), truth.value().view(),
                                                                       mask, confidence.value().view(), threshold(i));
    if (!s.ok()) return io::Error{files.confidence, "", s.message()};
  }
  return io::Done{};
}

[[nodiscard]] const char* class_name(std::size_t train_id) {
  return kLabels[label_from_train_id(static_cast<std::uint8_t>(train_id))].name;
}

[[nodiscard]] double mean_over_thresholds(const SegmentationEvaluation& e) {
  double sum = 0;
  for (const SegmentationCounts& c : e.by_threshold) sum += c.mean_uiou();
  return sum / static_cast<double>(e.by_threshold.size());
}

[[nodiscard]] OrderedJson to_json(const SegmentationEvaluation& e) {
  OrderedJson classes = OrderedJson::object();
  OrderedJson confusion = OrderedJson::array();
  for (std::size_t c = 0; c < kTrainIds; ++c) {
    classes[class_name(c)] = {{"iou", e.counts.iou(c)}, {"uiou", e.has_invalid ? e.counts.uiou(c) : kNone}};
    OrderedJson row = OrderedJson::array();
    for (std::size_t p = 0; p < kTrainIds; ++p) row.push_back(e.counts.predicted_as(c, p));
    confusion.push_back({{"class", class_name(c)},
                         {"predicted_as", std::move(row)},
                         {"true_invalid", e.counts.true_invalid(c)},
                         {"false_invalid", e.counts.false_invalid(c)}});
  }
  OrderedJson json = {{"npsim", NPSIM_VERSION_STRING},   {"images", e.images},
                      {"mean_iou", e.counts.mean_iou()}, {"mean_uiou", e.has_invalid ? e.counts.mean_uiou() : kNone},
                      {"classes", std::move(classes)},   {"confusion", std::move(confusion)}};
  if (!e.has_confidence) return json;
  json["mean_uiou_over_thresholds"] = mean_over_thresholds(e);
  for (int i = 0; i < kConfidenceThresholds; ++i) {
    const SegmentationCounts& c = e.by_threshold[static_cast<std::size_t>(i)];
    json["by_threshold"].push_back(
        {{"confidence", threshold(i)}, {"mean_iou", c.mean_iou()}, {"mean_uiou", c.mean_uiou()}});
  }
  return json;
}

void print_share(double value) {
  if (std::isfinite(value)) {
    std::printf(" %8.2f", 100 * value);
  } else {
    std::printf(" %8s", "-");
  }
}

void print_table(const SegmentationEvaluation& e) {
  std::printf("%zu images, %%\n\n%-16s %8s%s\n", e.images, "class", "IoU", e.has_invalid ? "     UIoU" : "");
  const auto line = [&](const char* name, double iou, double uiou) {
    std::printf("%-16s", name);
    print_share(iou);
    if (e.has_invalid) print_share(uiou);
    std::printf("\n");
  };
  for (std::size_t c = 0; c < kTrainIds; ++c) line(class_name(c), e.counts.iou(c), e.counts.uiou(c));
  line("mean", e.counts.mean_iou(), e.counts.mean_uiou());
  if (!e.has_confidence) return;
  std::printf("\n%-16s %8s %8s\n", "confidence from", "IoU", "UIoU");
  for (int i = 0; i < kConfidenceThresholds; ++i) {
    const SegmentationCounts& c = e.by_threshold[static_cast<std::size_t>(i)];
    std::printf("%-16.3f", static_cast<double>(threshold(i)));
    print_share(c.mean_iou());
    print_share(c.mean_uiou());
    std::printf("\n");
  }
  std::printf("%-16s %8s", "mean", "");
  print_share(mean_over_thresholds(e));
  std::printf("\n");
}

}  // namespace

io::Expected<SegmentationPairs> pair_segmentations(const SegmentationOptions& options) {
  SegmentationPairs pairs;
  io::Expected<Named> labels = pngs(options.labels, "--labels", "labelIds");
  if (!labels) return labels.error();
  if (labels.value().empty()) {
    labels = pngs(options.labels, "--labels", "labelTrainIds");
    if (!labels) return labels.error();
    pairs.labels_are_train_ids = true;
  }
  if (labels.value().empty()) {
    return io::Error{options.labels, "--labels", "expected files that end in labelIds.png or labelTrainIds.png"};
  }
  for (const auto& [name, file] : labels.value()) pairs.files.push_back({name, file, "", "", ""});
  const io::Expected<Named> predictions = pngs(options.prediction, "--prediction", "");
  if (!predictions) return predictions.error();
  if (auto o =
          assign(predictions.value(), options.prediction, "prediction", pairs.files, &SegmentationFiles::prediction);
      !o) {
    return o.error();
  }
  const std::string masks = options.invalid.empty() ? options.labels : options.invalid;
  const io::Expected<Named> invalid = pngs(masks, "--invalid", "invIds");
  if (!invalid) return invalid.error();
  if (!options.invalid.empty() || !invalid.value().empty()) {
    if (auto o = assign(invalid.value(), masks, "mask of invalid pixels", pairs.files, &SegmentationFiles::invalid);
        !o) {
      return o.error();
    }
  }
  if (options.confidence.empty()) return pairs;
  const io::Expected<Named> confidence = pngs(options.confidence, "--confidence", "");
  if (!confidence) return confidence.error();
  if (auto o =
          assign(confidence.value(), options.confidence, "confidence", pairs.files, &SegmentationFiles::confidence);
      !o) {
    return o.error();
  }
  return pairs;
}

io::Expected<SegmentationEvaluation> evaluate_segmentation(const SegmentationOptions& options) {
  const io::Expected<SegmentationPairs> paired = pair_segmentations(options);
  if (!paired) return paired.error();
  const SegmentationPairs& pairs = paired.value();
  if (!options.output.empty()) {
    InputFiles inputs;
    for (const SegmentationFiles& f : pairs.files) {
      for (const std::string& file : {f.labels, f.prediction, f.invalid, f.confidence}) {
        if (!file.empty()) inputs.add(file, "a picture of labels");
      }
    }
    if (const io::Outcome apart = inputs.expect_none_of({options.output}); !apart) return apart.error();
  }
  const bool train = options.prediction_ids.empty() ? pairs.labels_are_train_ids : options.prediction_ids == "train";
  SegmentationEvaluation out;
  out.images = pairs.files.size();
  out.has_invalid = !pairs.files.front().invalid.empty();
  out.has_confidence = !options.confidence.empty();
  if (out.has_confidence) out.by_threshold.assign(kConfidenceThresholds, SegmentationCounts(kTrainIds));
  for (const SegmentationFiles& f : pairs.files) {
    if (const io::Outcome added = add(f, pairs.labels_are_train_ids, train, out); !added) return added.error();
  }
  return out;
}

int run_segmentation(const SegmentationOptions& options) {
  if (options.labels.empty() || options.prediction.empty()) {
    return fail(io::Error{"", options.labels.empty() ? "--labels" : "--prediction",
                          "is missing, expected a folder each for --prediction and --labels"});
  }
  const io::Expected<SegmentationEvaluation> evaluated = evaluate_segmentation(options);
  if (!evaluated) return fail(evaluated.error());
  print_table(evaluated.value());
  if (options.output.empty()) return kExitDone;
  if (const io::Outcome made = make_folder_of(options.output); !made) return fail(made.error());
  const io::Outcome written = io::write_file(options.output, to_json(evaluated.value()).dump(2) + "\n");
  return written ? kExitDone : fail(written.error());
}

}  // namespace npsim::tool
