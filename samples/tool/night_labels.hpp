// SPDX-License-Identifier: Apache-2.0
// Labels of nights, aligned with their pictures: what a network is trained with (docs/labels.md).
//
// All label images of a night are made in one place, of() in night_labels.cpp; boxes and files follow from them.
#ifndef NPSIM_SAMPLES_TOOL_NIGHT_LABELS_HPP
#define NPSIM_SAMPLES_TOOL_NIGHT_LABELS_HPP

#include <cstdint>
#include <string>
#include <vector>

#include "any.hpp"
#include "npsim/io/coco.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/scene.hpp"
#include "npsim/pipeline/night.hpp"
#include "npsim/sensor/signal_masks.hpp"

namespace npsim::tool {

inline constexpr const char* kCocoFile = "coco.json";

// The files of one night; base: its path without an ending.
[[nodiscard]] std::vector<std::string> label_files(const std::string& base);

// Cityscapes' instance ids: label * 1000 + k for object k of that label, the label alone where there is no object, and
// of objects beyond the thousandth. Ids that are of that kind already stay.
[[nodiscard]] io::Image<std::uint16_t> cityscapes_instance_ids(ImageView<const Label> labels,
                                                               ImageView<const std::uint16_t> instances);

class NightLabels {
 public:
  // scene: of the size of the pictures.
  NightLabels(const io::Scene& scene, const NightParams& params, const SignalMaskParams& masks);

  // Keeps what nights are made in the memory of; refined: of the scene's size or smaller.
  void keep(const RefinedDepth& refined);
  [[nodiscard]] io::Outcome write(const std::string& base, const std::string& picture, const Night& night,
                                  AnyExecutor executor);
  [[nodiscard]] io::Outcome write_coco(const std::string& path) const { return coco_.write(path); }

 private:
  struct Images {
    io::Image<Label> labels;
    io::Image<std::uint16_t> instances;
    io::Image<std::uint16_t> lamps;  // position + 1 of the mark, 0: none
    io::Image<float> depth;
    io::Image<Rgb8> normals;
    io::Image<std::uint8_t> saturated;
    io::Image<std::uint8_t> indiscernible;
  };

  [[nodiscard]] Status of(const Night& night, AnyExecutor executor, Images& out) const;
  void add_boxes(const Images& images, const std::vector<bool>& lit, int variant, const std::string& picture);

  const io::Scene& scene_;
  const NightParams& params_;
  SignalMaskParams masks_;
  io::Image<std::uint16_t> instances_;
  io::Image<Rgb8> normals_;
  io::CocoWriter coco_;
};

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_TOOL_NIGHT_LABELS_HPP
