// SPDX-License-Identifier: Apache-2.0
// Boxes and outlines of objects as COCO's instances JSON: images, categories, annotations.
//
// bbox is [left, top, width, height] in pixels, area the number of pixels, segmentation an uncompressed run-length
// encoding: lengths of runs of pixels outside and inside in turn, column by column, the first outside.
#ifndef NPSIM_IO_COCO_HPP
#define NPSIM_IO_COCO_HPP

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "npsim/core/image_view.hpp"
#include "npsim/io/atomic_file.hpp"
#include "npsim/io/error.hpp"
#include "npsim/labels/boxes.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

class CocoWriter {
 public:
  using Json = nlohmann::ordered_json;

  void add_category(int id, const std::string& name, const std::string& supercategory) {
    categories_.push_back({{"id", id}, {"name", name}, {"supercategory", supercategory}});
  }
  void add_image(int id, const std::string& file_name, Shape shape) {
    images_.push_back({{"id", id}, {"file_name", file_name}, {"width", shape.width}, {"height", shape.height}});
  }
  // The pixels of `ids` that are `id`; box: of them, not empty. more: further keys of the annotation.
  void add_annotation(int image, int category, ImageView<const std::uint16_t> ids, std::uint16_t id,
                      const LabelBox& box, const Json& more = Json::object()) {
    Json annotation = {{"id", annotations_.size() + 1},
                       {"image_id", image},
                       {"category_id", category},
                       {"bbox", {box.left, box.top, box.right - box.left + 1, box.bottom - box.top + 1}},
                       {"area", box.pixels},
                       {"iscrowd", 0},
                       {"segmentation", {{"size", {ids.height(), ids.width()}}, {"counts", runs(ids, id, box)}}}};
    annotation.update(more);
    annotations_.push_back(std::move(annotation));
  }

  [[nodiscard]] Outcome write(const std::string& path) const {
    const Json json = {{"images", images_}, {"categories", categories_}, {"annotations", annotations_}};
    return write_file(path, json.dump() + "\n");
  }

 private:
  [[nodiscard]] static Json runs(ImageView<const std::uint16_t> ids, std::uint16_t id, const LabelBox& box) {
    Json counts = Json::array();
    const auto height = static_cast<std::size_t>(ids.height());
    std::size_t begin = 0;  // of the run, column by column
    bool inside = false;
    // A column more than the box has, where there is one, ends the last run.
    for (int x = box.left; x <= box.right + 1 && x < ids.width(); ++x) {
      for (int y = 0; y < ids.height(); ++y) {
        if ((ids(x, y) == id) == inside) continue;
        const std::size_t at = static_cast<std::size_t>(x) * height + static_cast<std::size_t>(y);
        counts.push_back(at - begin);
        begin = at;
        inside = !inside;
      }
    }
    counts.push_back(static_cast<std::size_t>(ids.width()) * height - begin);
    return counts;
  }

  Json images_ = Json::array();
  Json categories_ = Json::array();
  Json annotations_ = Json::array();
};

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_COCO_HPP
