// SPDX-License-Identifier: Apache-2.0
// A raw picture as NAME.raw, its levels row by row in 16 bits (little-endian, no header), and NAME_raw.json beside it:
// size, mosaic, bits, black and white level, gains of white balance, noise, exposure and its headroom.
//
// A level is round(black + (white - black) x), x the signal of equation (3.10); its variance is beta1 x + beta2.
// Error: none; what is read is what was written.
#ifndef NPSIM_IO_RAW_PICTURE_HPP
#define NPSIM_IO_RAW_PICTURE_HPP

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#include <nlohmann/json.hpp>

#include "npsim/io/atomic_file.hpp"
#include "npsim/io/detail/file_bytes.hpp"
#include "npsim/io/detail/json_fields.hpp"
#include "npsim/io/detail/limits.hpp"
#include "npsim/io/error.hpp"
#include "npsim/io/image.hpp"
#include "npsim/pipeline/photograph.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace io {

inline constexpr const char* kMosaicNames[] = {"rggb", "bggr", "grbg", "gbrg"};

// NAME of NAME.raw.
[[nodiscard]] inline std::string raw_sidecar(const std::string& path) {
  const std::string ending = ".raw";
  const bool ends =
      path.size() > ending.size() && path.compare(path.size() - ending.size(), ending.size(), ending) == 0;
  return (ends ? path.substr(0, path.size() - ending.size()) : path) + "_raw.json";
}

inline Outcome write_raw(const std::string& path, const RawPicture& raw, const SensorParams& sensor,
                         const CameraExposure& exposure) {
  return guarded(path, [&]() -> Outcome {
    const ImageView<const std::uint16_t> levels = raw.levels;
    if (levels.empty()) return Error{path, "size", "the picture is empty: expected at least 1x1 pixels"};
    Bytes bytes;
    bytes.reserve(2 * levels.shape().pixels());
    for (int y = 0; y < levels.height(); ++y) {
      for (int x = 0; x < levels.width(); ++x) append_little(bytes, levels(x, y), 2);
    }
    nlohmann::ordered_json response = nlohmann::ordered_json::array();
    for (const Vec3f& row : sensor.response) response.push_back({row.x, row.y, row.z});
    const nlohmann::ordered_json sidecar = {{"npsim_raw", 1},
                                            {"width", levels.width()},
                                            {"height", levels.height()},
                                            {"mosaic", kMosaicNames[static_cast<std::size_t>(sensor.mosaic)]},
                                            {"bits", sensor.bits},
                                            {"black", sensor.black},
                                            {"white", white_level(sensor)},
                                            {"response", std::move(response)},
                                            {"gains", {raw.gains.x, raw.gains.y, raw.gains.z}},
                                            {"noise", {{"beta1", raw.noise.beta1}, {"beta2", raw.noise.beta2}}},
                                            {"exposure",
                                             {{"iso", exposure.iso},
                                              {"headroom", raw.headroom},
                                              {"f_number", exposure.f_number},
                                              {"time_s", exposure.time_s}}}};
    if (auto o = write_file(path, bytes.data(), bytes.size()); !o) return o;
    return write_file(raw_sidecar(path), sidecar.dump(2) + "\n");
  });
}

struct RawFile {
  Image<std::uint16_t> levels;
  double black = 0;
  double white = 0;
  double iso = 0;
  double headroom = 1;  // full scale over the white of the picture
};

// Of a .raw with its sidecar.
[[nodiscard]] inline Expected<RawFile> read_raw(const std::string& path, const ReadLimits& limits = {}) {
  return guarded(path, [&]() -> Expected<RawFile> {
    const std::string beside = raw_sidecar(path);
    const Expected<Json> json = read_json(beside, limits);
    if (!json) return json.error();
    const Expected<JsonObject> object = JsonObject::of(beside, "", json.value());
    if (!object) return object.error();
    const JsonObject& o = object.value();
    const Expected<std::int64_t> width = o.whole("width");
    if (!width) return width.error();
    const Expected<std::int64_t> height = o.whole("height");
    if (!height) return height.error();
    const Expected<double> black = o.number("black");
    if (!black) return black.error();
    const Expected<double> white = o.number("white");
    if (!white) return white.error();
    const Expected<JsonObject> exposure = o.object("exposure");
    if (!exposure) return exposure.error();
    const Expected<double> iso = exposure.value().number("iso");
    if (!iso) return iso.error();
    const Expected<double> headroom = exposure.value().number("headroom");
    if (!headroom) return headroom.error();
    if (!(headroom.value() >= 1)) return Error{beside, "exposure.headroom", "expected 1 or more"};
    const Expected<Shape> shape = checked_shape(beside, width.value(), height.value(), 2, limits);
    if (!shape) return shape.error();
    if (!(black.value() >= 0 && white.value() > black.value())) {
      return Error{beside, "white", "expected more than black"};
    }
    const Expected<Bytes> file = read_file_bytes(path, limits);
    if (!file) return file.error();
    const Bytes& bytes = file.value();
    if (bytes.size() != 2 * shape.value().pixels()) {
      return Error{path, "file size",
                   std::to_string(bytes.size()) + " bytes, expected " + std::to_string(2 * shape.value().pixels()) +
                       " as the sidecar has it"};
    }
    RawFile raw{Image<std::uint16_t>(shape.value()), black.value(), white.value(), iso.value(), headroom.value()};
    for (std::size_t i = 0; i < shape.value().pixels(); ++i) {
      raw.levels.data()[i] = static_cast<std::uint16_t>(bytes[2 * i] | (bytes[2 * i + 1] << 8U));
    }
    return raw;
  });
}

}  // namespace io
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_IO_RAW_PICTURE_HPP
