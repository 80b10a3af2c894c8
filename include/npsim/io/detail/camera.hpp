// SPDX-License-Identifier: Apache-2.0
// Cameras in: fx fy cx cy, a horizontal field of view, or a Cityscapes camera file.
//
// The result has pixel centres at +0.5. "pixel_centre": 0 says that a file counts from the centre of the first pixel;
// then 0.5 is added to cx and cy. Cityscapes camera files count that way. Their extrinsic z is the height over the road.
#ifndef NPSIM_IO_DETAIL_CAMERA_HPP
#define NPSIM_IO_DETAIL_CAMERA_HPP

#include <cmath>
#include <string>

#include "npsim/core/camera.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/io/detail/json_fields.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

struct Camera {
  Intrinsics intrinsics;
  double baseline_m = 0;  // of a stereo pair; 0 where there is none
  double height_m = 0;    // above the road; 0 where it is not known
  std::string note;       // what was assumed or converted
};

namespace detail {

inline Expected<double> positive_number(const JsonObject& object, const char* key) {
  const Expected<double> number = object.number(key);
  if (number && !(number.value() > 0))
    return Error{object.file(), object.field(key), "is not positive, expected more than 0"};
  return number;
}

inline Expected<Camera> camera_from_numbers(const JsonObject& object, const char* cx_key, const char* cy_key,
                                            double pixel_centre) {
  const Expected<double> fx = positive_number(object, "fx");
  if (!fx) return fx.error();
  const Expected<double> fy = positive_number(object, "fy");
  if (!fy) return fy.error();
  const Expected<double> cx = object.number(cx_key);
  if (!cx) return cx.error();
  const Expected<double> cy = object.number(cy_key);
  if (!cy) return cy.error();
  Camera camera;
  const double shift = 0.5 - pixel_centre;
  camera.intrinsics = {narrowed(fx.value()), narrowed(fy.value()), narrowed(cx.value() + shift),
                       narrowed(cy.value() + shift)};
  if (!validate(camera.intrinsics))
    return Error{object.file(), object.field("fx"), "is beyond the range of float, expected pixels"};
  if (pixel_centre == 0) camera.note = "camera: 0.5 px added to cx and cy (the file counts from pixel centres)";
  return camera;
}

}  // namespace detail

inline Expected<Camera> read_cityscapes_camera(const std::string& path, const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<Camera> {
    const Expected<Json> json = read_json(path, limits);
    if (!json) return json.error();
    const Expected<JsonObject> root = JsonObject::of(path, "", json.value());
    if (!root) return root.error();
    const Expected<JsonObject> intrinsic = root.value().object("intrinsic");
    if (!intrinsic) return intrinsic.error();
    Expected<Camera> camera = detail::camera_from_numbers(intrinsic.value(), "u0", "v0", 0);
    if (!camera || !root.value().has("extrinsic")) return camera;
    const Expected<JsonObject> extrinsic = root.value().object("extrinsic");
    if (!extrinsic) return extrinsic.error();
    const Expected<double> baseline = detail::positive_number(extrinsic.value(), "baseline");
    if (!baseline) return baseline.error();
    camera.value().baseline_m = baseline.value();
    if (extrinsic.value().has("z")) {
      const Expected<double> height = extrinsic.value().number("z");
      if (!height) return height.error();
      if (height.value() > 0) camera.value().height_m = height.value();
    }
    return camera;
  });
}

// The "camera" of a scene whose image has the given shape; file names inside are relative to the scene file.
inline Expected<Camera> camera_from_json(const JsonObject& object, Shape shape, const ReadLimits& limits = {}) {
  return guarded(object.file(), [&]() -> Expected<Camera> {
    const bool from_fov = object.has("horizontal_fov_deg");
    const bool from_file = object.has("cityscapes");
    if (from_fov && from_file) {
      return Error{object.file(), object.field("cityscapes"), "stands beside horizontal_fov_deg, expected one of them"};
    }
    Outcome known = from_file  ? object.allow_only({"cityscapes", "baseline", "height_m"})
                    : from_fov ? object.allow_only({"horizontal_fov_deg", "baseline", "height_m"})
                               : object.allow_only({"fx", "fy", "cx", "cy", "pixel_centre", "baseline", "height_m",
                                                    "horizontal_fov_deg", "cityscapes"});
    if (!known) return known.error();
    Expected<Camera> camera = Camera{};
    if (from_file) {
      const Expected<std::string> name = object.text("cityscapes");
      if (!name) return name.error();
      camera = read_cityscapes_camera(resolved_path(object.file(), name.value()), limits);
    } else if (from_fov) {
      const Expected<double> degrees = object.number("horizontal_fov_deg");
      if (!degrees) return degrees.error();
      if (!(degrees.value() > 0 && degrees.value() < 180)) {
        return Error{object.file(), object.field("horizontal_fov_deg"),
                     "is outside its range, expected 0 < angle < 180"};
      }
      constexpr double kRadians = 3.14159265358979323846 / 180;
      camera.value().intrinsics = intrinsics_from_fov(shape, static_cast<float>(degrees.value() * kRadians));
      camera.value().note = "camera: square pixels and a central principal point, from the field of view";
    } else {
      double centre = 0.5;
      if (object.has("pixel_centre")) {
        const Expected<double> given = object.number("pixel_centre");
        if (!given) return given.error();
        centre = given.value();
        if (centre != 0 && centre != 0.5) {
          return Error{object.file(), object.field("pixel_centre"), "is neither 0 nor 0.5, expected one of them"};
        }
      }
      camera = detail::camera_from_numbers(object, "cx", "cy", centre);
    }
    if (!camera) return camera;
    if (object.has("baseline")) {
      const Expected<double> baseline = detail::positive_number(object, "baseline");
      if (!baseline) return baseline.error();
      camera.value().baseline_m = baseline.value();
    }
    if (object.has("height_m")) {
      const Expected<double> height = detail::positive_number(object, "height_m");
      if (!height) return height.error();
      if (height.value() > 1000) {
        return Error{object.file(), object.field("height_m"), "is beyond 1000, expected metres above the road"};
      }
      camera.value().height_m = height.value();
    }
    if (!validate(camera.value().intrinsics)) {
      return Error{object.file(), object.field("horizontal_fov_deg"),
                   "gives no finite focal length, expected a usual angle"};
    }
    const Intrinsics& k = camera.value().intrinsics;
    if (k.cx < 0 || k.cy < 0 || k.cx > static_cast<float>(shape.width) || k.cy > static_cast<float>(shape.height)) {
      std::string& note = camera.value().note;
      note += std::string(note.empty() ? "" : "; ") + "camera: the principal point lies outside the " +
              size_text(shape) + " image; is it that of another image size?";
    }
    return camera;
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_DETAIL_CAMERA_HPP
