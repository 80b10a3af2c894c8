// SPDX-License-Identifier: Apache-2.0
#include "calibrate_command.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "greycard_command.hpp"
#include "npsim/io/image.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/io/raw_picture.hpp"
#include "npsim/sensor/noise.hpp"
#include "tool/options.hpp"

namespace npsim::tool {
namespace {

[[nodiscard]] io::Expected<io::RawFile> read_picture(const std::string& path, const CalibrateOptions& options) {
  io::RawFile raw;
  if (std::filesystem::path(path).extension() == ".raw") {
    io::Expected<io::RawFile> read = io::read_raw(path);
    if (!read) return read;
    raw = std::move(read.value());
  } else {
    io::Expected<io::Image<std::uint16_t>> read = io::read_u16(path);
    if (!read) return read.error();
    if (options.black < 0 || options.white < 0) {
      return io::Error{path, "--black, --white", "expected both: a PNG does not say its levels"};
    }
    raw.levels = std::move(read.value());
  }
  if (options.black >= 0) raw.black = options.black;
  if (options.white >= 0) raw.white = options.white;
  if (options.iso > 0) raw.iso = options.iso;
  if (options.headroom > 0) raw.headroom = options.headroom;
  if (!(raw.white > raw.black)) return io::Error{path, "--white", "expected more than the black level"};
  return raw;
}

}  // namespace

int run_calibrate(const CalibrateOptions& options) {
  std::vector<io::RawFile> frames;
  for (const std::string& path : options.pictures) {
    io::Expected<io::RawFile> read = read_picture(path, options);
    if (!read) return fail(read.error());
    frames.push_back(std::move(read.value()));
  }
  const Shape shape = frames[0].levels.shape();
  if (frames.size() == 2 && frames[1].levels.shape() != shape) {
    return fail(io::Error{
        options.pictures[1], "size",
        io::size_text(frames[1].levels.shape()) + ", expected that of the first frame, " + io::size_text(shape)});
  }
  std::vector<std::array<int, 4>> areas;
  for (const std::string& text : options.patches) {
    const io::Expected<std::array<int, 4>> patch = parse_card(text, shape);
    if (!patch) return fail(io::Error{"", "--patch", patch.error().problem});
    areas.push_back(patch.value());
  }
  if (areas.empty() && frames.size() == 1) {
    return fail(io::Error{"", "--patch", "is missing: expected flat patches, or a second frame of the same scene"});
  }
  if (areas.empty()) {
    for (int y = 0; y + options.square <= shape.height; y += options.square) {
      for (int x = 0; x + options.square <= shape.width; x += options.square) {
        areas.push_back({x, y, x + options.square, y + options.square});
      }
    }
  }
  const RawScale scale{frames[0].black, frames[0].white};
  std::vector<NoiseSample> samples;
  for (const auto& [x0, y0, x1, y1] : areas) {
    const auto area = [&, left = x0, top = y0, size = Shape{x1 - x0, y1 - y0}](const io::RawFile& frame) {
      return frame.levels.view().sub(left, top, size);
    };
    for (int filter = 0; filter < 4; ++filter) {
      const int px = filter % 2;
      const int py = filter / 2;
      samples.push_back(frames.size() == 1 ? noise_of_area(scale, area(frames[0]), px, py)
                                           : noise_of_pair(scale, area(frames[0]), area(frames[1]), px, py));
    }
  }
  NoiseFit fit;
  const Status status = fit_noise(Span<const NoiseSample>(samples.data(), samples.size()), fit);
  if (!status.ok()) return fail(options.pictures[0], status);
  std::size_t used = 0;
  for (const NoiseSample& s : samples) used += s.freedom > 0 ? 1U : 0U;
  std::printf("beta1  %.4e +- %.1e (95 %%)\nbeta2  %.4e +- %.1e (95 %%)\nchi2   %.2f a degree of freedom, %zu areas\n",
              fit.beta1, 1.96 * fit.error1, fit.beta2, 1.96 * fit.error2, fit.chi2, used);
  if (const io::RawFile& raw = frames[0]; raw.iso > 0) {  // tables are in whites of the picture
    const double room = raw.headroom;
    std::printf("table  [%g, %.4e, %.4e]\n", raw.iso, fit.beta1 * room, fit.beta2 * room * room);
  }
  if (fit.beta2 < 0) std::printf("note: beta2 below 0, the black level is higher than %g\n", scale.black);
  return kExitDone;
}

}  // namespace npsim::tool
