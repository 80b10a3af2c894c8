// SPDX-License-Identifier: Apache-2.0
// Label and instance planes in, from the three Cityscapes encodings, as PNG (8 or 16 bits) or NPY of whole numbers.
//
// Labels are Cityscapes label ids; values outside the definition become unlabeled and are counted (255, the licence
// plate and the ignored train id, is known). Instances: equal number = same object, 0 = no object.
#ifndef NPSIM_IO_DETAIL_LABELS_HPP
#define NPSIM_IO_DETAIL_LABELS_HPP

#include <cstddef>
#include <cstdint>
#include <string>

#include "npsim/io/detail/depth.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"
#include "npsim/labels/cityscapes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

enum class LabelEncoding : std::uint8_t {
  cityscapes_label_ids,
  cityscapes_train_ids,
  cityscapes_instance_ids,  // v < 1000: the label; else label v / 1000 of object v
  ids,                      // instances only: any numbers from 0 to 65535
};

inline Expected<LabelEncoding> label_encoding(const std::string& file, const std::string& field,
                                              const std::string& name) {
  if (name == "cityscapes_label_ids") return LabelEncoding::cityscapes_label_ids;
  if (name == "cityscapes_train_ids") return LabelEncoding::cityscapes_train_ids;
  if (name == "cityscapes_instance_ids") return LabelEncoding::cityscapes_instance_ids;
  if (name == "ids") return LabelEncoding::ids;
  return Error{
      file, field,
      "is '" + name + "', expected cityscapes_label_ids, cityscapes_train_ids, cityscapes_instance_ids or ids"};
}

// The label of one stored number; known is cleared where the definition has no such number.
[[nodiscard]] constexpr Label decode_label(std::int32_t v, LabelEncoding encoding, bool& known) noexcept {
  constexpr std::int32_t kNone = 255;
  constexpr std::int32_t kNone16 = 65535;  // -1, the licence plate's id, in 16 bits
  if (v == kNone || v == kNone16 || v == -1) return label::unlabeled;
  const std::int32_t id = encoding == LabelEncoding::cityscapes_instance_ids && v >= 1000 ? v / 1000 : v;
  if (encoding == LabelEncoding::cityscapes_train_ids) {
    const Label l = id >= 0 && id < kNone ? label_from_train_id(static_cast<std::uint8_t>(id)) : label::unlabeled;
    known = known && l != label::unlabeled;
    return l;
  }
  if (id >= 0 && id < kLabelCount) return static_cast<Label>(id);
  known = false;
  return label::unlabeled;
}

inline Expected<Image<Label>> read_labels(const std::string& path, LabelEncoding encoding,
                                          const ReadLimits& limits = {}, std::size_t* unknown = nullptr) {
  return guarded(path, [&]() -> Expected<Image<Label>> {
    if (encoding == LabelEncoding::ids) {
      return Error{path, "encoding", "ids name objects, expected one of the cityscapes encodings for labels"};
    }
    const Expected<Image<std::int32_t>> plane = detail::read_whole_numbers(path, limits);
    if (!plane) return plane.error();
    Image<Label> labels(plane.value().shape());
    std::size_t count = 0;
    for (std::size_t i = 0; i < labels.shape().pixels(); ++i) {
      bool known = true;
      labels.data()[i] = decode_label(plane.value().data()[i], encoding, known);
      if (!known) ++count;
    }
    if (unknown != nullptr) *unknown = count;
    return labels;
  });
}

inline Expected<Image<std::uint16_t>> read_instances(const std::string& path, LabelEncoding encoding,
                                                     const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<Image<std::uint16_t>> {
    if (encoding != LabelEncoding::ids && encoding != LabelEncoding::cityscapes_instance_ids) {
      return Error{path, "encoding", "holds no objects, expected cityscapes_instance_ids or ids for instances"};
    }
    const Expected<Image<std::int32_t>> plane = detail::read_whole_numbers(path, limits);
    if (!plane) return plane.error();
    Image<std::uint16_t> instances(plane.value().shape());
    for (std::size_t i = 0; i < instances.shape().pixels(); ++i) {
      const std::int32_t v = plane.value().data()[i];
      if (v < 0 || v > 65535) {
        return Error{path, "instance", "is " + std::to_string(v) + ", expected 0 to 65535"};
      }
      const bool object = encoding == LabelEncoding::ids || v >= 1000;
      instances.data()[i] = object ? static_cast<std::uint16_t>(v) : std::uint16_t{0};
    }
    return instances;
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_LABELS_HPP
