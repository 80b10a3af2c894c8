// SPDX-License-Identifier: Apache-2.0
#include "night_labels.hpp"

#include <algorithm>
#include <cstddef>
#include <map>
#include <set>
#include <utility>

#include "engine.hpp"
#include "npsim/io/pfm.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/io/scene_resize.hpp"
#include "npsim/labels/boxes.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"
#include "npsim/pipeline/photograph.hpp"
#include "pictures.hpp"

namespace npsim::tool {
namespace {

constexpr int kLampCategories = 100;  // categories of lamps begin here

template <class T>
[[nodiscard]] io::Image<T> copy_of(ImageView<const T> view) {
  io::Image<T> out(view.shape());
  copy_pixels(view, out.view());
  return out;
}

// Share of the pixels of each id that the mask has.
[[nodiscard]] std::vector<double> shares(const io::Image<std::uint16_t>& ids, const io::Image<std::uint8_t>& mask,
                                         const std::vector<LabelBox>& boxes) {
  std::vector<double> sum(boxes.size());
  for (std::size_t i = 0; i < ids.shape().pixels(); ++i) sum[ids.data()[i]] += mask.data()[i];
  for (std::size_t id = 0; id < sum.size(); ++id) {
    sum[id] /= static_cast<double>(std::max<std::size_t>(1, boxes[id].pixels));
  }
  return sum;
}

[[nodiscard]] std::vector<LabelBox> boxes_of(const io::Image<std::uint16_t>& ids) {
  std::vector<LabelBox> boxes(65536);
  label_boxes(ids.view(), Span<LabelBox>(boxes.data(), boxes.size()));
  return boxes;
}

[[nodiscard]] bool has_box(const LightMark& mark) { return mark.cls != LightClass::none && !is_group(mark.cls); }

}  // namespace

std::vector<std::string> label_files(const std::string& base) {
  std::vector<std::string> files;
  for (const char* ending : {"_labelIds.png", "_instanceIds.png", "_invIds.png", "_saturated.png", "_lampIds.png",
                             "_lampStates.png", "_depth.pfm", "_normals.png"}) {
    files.push_back(base + ending);
  }
  return files;
}

io::Image<std::uint16_t> cityscapes_instance_ids(ImageView<const Label> labels,
                                                 ImageView<const std::uint16_t> instances) {
  std::map<Label, std::set<std::uint16_t>> objects;
  for (int y = 0; y < labels.height() && !instances.empty(); ++y) {
    for (int x = 0; x < labels.width(); ++x) {
      if (instances(x, y) != 0) objects[labels(x, y)].insert(instances(x, y));
    }
  }
  std::map<std::pair<Label, std::uint16_t>, std::uint16_t> renamed;
  for (const auto& [label, ids] : objects) {
    const bool stays = std::all_of(ids.begin(), ids.end(), [l = label](int id) { return id / 1000 == l; });
    int k = 0;
    for (const std::uint16_t id : ids) {
      const int numbered = k < 1000 ? label * 1000 + k++ : label;
      renamed[{label, id}] = stays ? id : static_cast<std::uint16_t>(numbered);
    }
  }
  io::Image<std::uint16_t> out(labels.shape());
  for (int y = 0; y < labels.height(); ++y) {
    for (int x = 0; x < labels.width(); ++x) {
      const bool object = !instances.empty() && instances(x, y) != 0;
      out(x, y) = object ? renamed[{labels(x, y), instances(x, y)}] : labels(x, y);
    }
  }
  return out;
}

NightLabels::NightLabels(const io::Scene& scene, const NightParams& params, const SignalMaskParams& masks)
    : scene_(scene), params_(params), masks_(masks) {
  const io::Image<Label> none(scene.shape());
  instances_ =
      cityscapes_instance_ids(scene.labels.empty() ? none.view() : scene.labels.view(), scene.instances.view());
  std::set<int> labels;
  for (std::size_t i = 0; i < instances_.shape().pixels(); ++i) {
    if (const int id = instances_.data()[i]; id >= 1000) labels.insert(id / 1000);
  }
  std::set<LightClass> lamps;
  for (const LightMark& mark : scene.lights) {
    if (has_box(mark)) lamps.insert(mark.cls);
  }
  for (const int label : labels) coco_.add_category(label, kLabels[static_cast<std::size_t>(label)].name, "object");
  for (const LightClass cls : lamps)
    coco_.add_category(kLampCategories + static_cast<int>(cls), info(cls).name, "lamp");
}

void NightLabels::keep(const RefinedDepth& refined) {
  normals_ = io::resized_nearest(normal_picture(refined.normals), scene_.shape());
}

Status NightLabels::of(const Night& night, AnyExecutor executor, Images& out) const {
  const Shape shape = scene_.shape();
  out.labels = scene_.labels.empty() ? io::Image<Label>(shape) : scene_.labels;
  out.instances = instances_;
  out.lamps = scene_.light_index.empty() ? io::Image<std::uint16_t>(shape) : scene_.light_index;
  out.depth = copy_of(night.street.depth);
  out.normals = normals_;
  const PhotographParams& camera = params_.camera;
  if (has_motion(camera.motion) && camera.motion.readout_s > 0.0F) {
    io::Image<PixelMotion> motion(shape);
    if (const Status s = picture_motion(camera, scene_.intrinsics, night.street, motion.view(), executor); !s.ok()) {
      return s;
    }
    const auto move = [&](auto& image) {
      auto moved = image;
      for (int y = 0; y < shape.height; ++y) {
        for (int x = 0; x < shape.width; ++x) {
          const Pixel from = shutter_source(camera.motion.readout_s, std::as_const(motion).view(), x, y);
          moved(x, y) = image(from.x, from.y);
        }
      }
      image = std::move(moved);
    };
    move(out.labels);
    move(out.instances);
    move(out.lamps);
    move(out.depth);
    move(out.normals);
  }
  out.saturated = io::Image<std::uint8_t>(shape);
  out.indiscernible = io::Image<std::uint8_t>(shape);
  std::vector<unsigned char> memory(picture_masks_workspace_bytes(camera, shape, scene_.lights.size()));
  Workspace workspace(memory.data(), memory.size());
  return engine::picture_masks(masks_, camera, scene_.intrinsics, night,
                               {out.saturated.view(), out.indiscernible.view()}, workspace, executor);
}

void NightLabels::add_boxes(const Images& images, const std::vector<bool>& lit, int variant,
                            const std::string& picture) {
  coco_.add_image(variant, picture, images.labels.shape());
  const std::vector<LabelBox> objects = boxes_of(images.instances);
  const std::vector<double> object_shares = shares(images.instances, images.indiscernible, objects);
  for (std::size_t id = 1000; id < objects.size(); ++id) {
    if (objects[id].pixels == 0) continue;
    coco_.add_annotation(variant, static_cast<int>(id / 1000), images.instances.view(), static_cast<std::uint16_t>(id),
                         objects[id], {{"instance_id", id}, {"indiscernible", object_shares[id]}});
  }
  const std::vector<LabelBox> lamps = boxes_of(images.lamps);
  const std::vector<double> lamp_shares = shares(images.lamps, images.indiscernible, lamps);
  for (std::size_t m = 0; m < scene_.lights.size(); ++m) {
    const LightMark& mark = scene_.lights[m];
    if (!has_box(mark) || lamps[m + 1].pixels == 0) continue;
    coco_.add_annotation(
        variant, kLampCategories + static_cast<int>(mark.cls), images.lamps.view(), static_cast<std::uint16_t>(m + 1),
        lamps[m + 1],
        {{"lamp_id", mark.id}, {"lit", static_cast<bool>(lit[m + 1])}, {"indiscernible", lamp_shares[m + 1]}});
  }
}

io::Outcome NightLabels::write(const std::string& base, const std::string& picture, const Night& night,
                               AnyExecutor executor) {
  Images images;
  const Status made = of(night, executor, images);
  if (!made.ok()) return io::Error{base, "labels", made.message()};
  std::vector<bool> lit(scene_.lights.size() + 1);
  for (std::size_t e = 0; e < night.emitters.size(); ++e) {
    if (night.activations[e].lit) lit[night.emitters[e].mark] = true;
  }
  lit[0] = false;  // lamps outside the picture
  io::Image<Rgb8> lamp_ids(images.lamps.shape());
  io::Image<std::uint8_t> lamp_states(images.lamps.shape());
  for (std::size_t i = 0; i < images.lamps.shape().pixels(); ++i) {
    const std::size_t lamp = images.lamps.data()[i];
    if (lamp == 0 || !has_box(scene_.lights[lamp - 1])) continue;
    const std::uint32_t id = scene_.lights[lamp - 1].id;
    lamp_ids.data()[i] = {static_cast<std::uint8_t>(id), static_cast<std::uint8_t>(id >> 8U),
                          static_cast<std::uint8_t>(id >> 16U)};
    lamp_states.data()[i] = lit[lamp] ? 2 : 1;
  }
  add_boxes(images, lit, night.variant, picture);
  const std::vector<std::string> files = label_files(base);
  if (auto o = io::write_png(files[0], std::as_const(images.labels).view()); !o) return o;
  if (auto o = io::write_png16(files[1], std::as_const(images.instances).view()); !o) return o;
  if (auto o = io::write_png(files[2], std::as_const(images.indiscernible).view()); !o) return o;
  if (auto o = io::write_png(files[3], std::as_const(images.saturated).view()); !o) return o;
  if (auto o = io::write_png(files[4], std::as_const(lamp_ids).view()); !o) return o;
  if (auto o = io::write_png(files[5], std::as_const(lamp_states).view()); !o) return o;
  if (auto o = io::write_pfm(files[6], std::as_const(images.depth).view()); !o) return o;
  return io::write_png(files[7], std::as_const(images.normals).view());
}

}  // namespace npsim::tool
