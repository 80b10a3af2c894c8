// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "npsim/core/executor.hpp"
#include "npsim/core/random.hpp"
#include "npsim/sensor/detail/local_tone.hpp"
#include "npsim/sensor/isp.hpp"
#include "unit/fixture.hpp"

namespace {

using npsim::kMosaicMargin;
using npsim::kToneCell;
using npsim::LocalToneParams;
using npsim::Mosaic;
using npsim::Shape;
using npsim::Status;
using npsim::StatusCode;
using npsim::ToneLines;
using Plane = npsim_test::Image<float>;

struct Lines {
  Plane slope;
  Plane offset;

  // log2 of the base at a pixel whose largest channel is n, without `dark`.
  [[nodiscard]] double base(const LocalToneParams& params, int x, int y, float n) {
    float s = 0;
    float o = 0;
    npsim::lines_of_pixels({slope.view(), offset.view()}, x, y, 1, &s, &o);
    return static_cast<double>(s) * std::log2(static_cast<double>(n) + static_cast<double>(params.dark)) +
           static_cast<double>(o);
  }
};

template <class Executor = npsim::SerialExecutor>
Lines lines_of(const LocalToneParams& params, Shape shape, const Plane& plane, Executor executor = {}) {
  const Shape cells = npsim::tone_cells(shape);
  Lines out{Plane(cells), Plane(cells)};
  npsim_test::Scratch scratch(npsim::tone_lines_workspace_bytes(params, shape));
  REQUIRE(npsim::tone_lines(params, Mosaic::rggb, shape, plane.view(), {out.slope.view(), out.offset.view()},
                            scratch.workspace(), executor)
              .ok());
  return out;
}

// value(x, y) of the pixels of a picture, behind every filter alike.
template <class F>
Plane plane_of(Shape shape, const F& value) {
  Plane plane(npsim::mosaic_shape(shape));
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) plane(x + kMosaicMargin, y) = value(x, y);
  }
  return plane;
}

LocalToneParams local(float share = 0.8F) {
  LocalToneParams params;
  params.share = share;
  return params;
}

// What a logarithmic curve shows of a plane, local by `share`.
npsim_test::Image<npsim::Rgb8> developed(float lift, float share, Plane plane) {
  npsim::IspParams isp;
  isp.saturation = 1;
  isp.chroma = npsim::ChromaSampling::yuv444;
  isp.tone.kind = npsim::ToneKind::log;
  isp.tone.lift = lift;
  isp.local = local(share);
  const Shape shape{plane.shape().width - 2 * kMosaicMargin, plane.shape().height};
  npsim_test::Image<npsim::Rgb8> out(shape);
  npsim_test::Scratch scratch(npsim::develop_workspace_bytes(isp, shape));
  npsim::SerialExecutor executor;
  REQUIRE(npsim::develop(isp, {}, plane.view(), out.view(), scratch.workspace(), executor).ok());
  return out;
}

// The guided filter of the cells by its definition, windows summed anew for each cell.
struct Reference {
  Shape cells;
  std::vector<double> slope;
  std::vector<double> offset;
};

Reference reference(const LocalToneParams& params, Shape shape, const Plane& plane) {
  Reference out{npsim::tone_cells(shape), {}, {}};
  const auto at = [&](int x, int y) { return static_cast<std::size_t>(y * out.cells.width + x); };
  std::vector<double> light(out.cells.pixels());
  for (int cy = 0; cy < out.cells.height; ++cy) {
    for (int cx = 0; cx < out.cells.width; ++cx) {
      double sum[3] = {};
      double count[3] = {};
      for (int y = kToneCell * cy; y < std::min(kToneCell * (cy + 1), shape.height); ++y) {
        for (int x = kToneCell * cx; x < std::min(kToneCell * (cx + 1), shape.width); ++x) {
          const int filter = npsim::filter_at(Mosaic::rggb, x, y);
          sum[filter] += static_cast<double>(plane(x + kMosaicMargin, y));
          count[filter] += 1;
        }
      }
      double most = 0;
      for (int i = 0; i < 3; ++i) most = std::max(most, sum[i] / std::max(count[i], 1.0));
      light[at(cx, cy)] = std::log2(most + static_cast<double>(params.dark));
    }
  }
  const int radius =
      std::max(1, static_cast<int>(std::lround(static_cast<double>(params.reach) * shape.height / (2.0 * kToneCell))));
  const auto mean = [&](int x, int y, const auto& f) {
    double sum = 0;
    double count = 0;
    for (int j = std::max(0, y - radius); j <= std::min(out.cells.height - 1, y + radius); ++j) {
      for (int i = std::max(0, x - radius); i <= std::min(out.cells.width - 1, x + radius); ++i) {
        sum += f(at(i, j));
        count += 1;
      }
    }
    return sum / count;
  };
  std::vector<double> a(light.size());
  std::vector<double> b(light.size());
  const double stops = static_cast<double>(params.edge_stops);
  for (int y = 0; y < out.cells.height; ++y) {
    for (int x = 0; x < out.cells.width; ++x) {
      const double middle = mean(x, y, [&](std::size_t i) { return light[i]; });
      const double variance = mean(x, y, [&](std::size_t i) { return (light[i] - middle) * (light[i] - middle); });
      a[at(x, y)] = variance / (variance + 0.25 * stops * stops);
      b[at(x, y)] = middle * (1 - a[at(x, y)]);
    }
  }
  for (int y = 0; y < out.cells.height; ++y) {
    for (int x = 0; x < out.cells.width; ++x) {
      out.slope.push_back(mean(x, y, [&](std::size_t i) { return a[i]; }));
      out.offset.push_back(mean(x, y, [&](std::size_t i) { return b[i]; }));
    }
  }
  return out;
}

Plane noise(Shape shape) {
  return plane_of(shape, [&](int x, int y) {
    npsim::RandomStream random(4, npsim::RandomPurpose::test, 0, 0, static_cast<std::uint32_t>(y * 1000 + x), 0);
    return std::exp2(-12.0F * random.uniform()) * (x > shape.width / 2 ? 1.0F : 0.01F) - 1e-4F;
  });
}

}  // namespace

TEST_CASE("sensor: the lines of a local tone curve are those of the guided filter in double precision, at odd sizes") {
  for (const Shape shape : {Shape{97, 61}, Shape{5, 90}, Shape{3, 2}, Shape{1, 1}}) {
    const Plane plane = noise(shape);
    Lines lines = lines_of(local(), shape, plane);
    const Reference exact = reference(local(), shape, plane);
    CAPTURE(shape.width);
    for (int y = 0; y < exact.cells.height; ++y) {
      for (int x = 0; x < exact.cells.width; ++x) {
        const auto i = static_cast<std::size_t>(y * exact.cells.width + x);
        CHECK(std::fabs(static_cast<double>(lines.slope(x, y)) - exact.slope[i]) < 1e-4);
        CHECK(std::fabs(static_cast<double>(lines.offset(x, y)) - exact.offset[i]) < 1e-3);
      }
    }
  }
}

TEST_CASE("sensor: lines between cells are linear, and go on flat at the picture's borders") {
  const Shape shape{150, 37};
  Plane slope(npsim::tone_cells(shape));
  Plane offset(npsim::tone_cells(shape));
  for (int y = 0; y < slope.shape().height; ++y) {
    for (int x = 0; x < slope.shape().width; ++x) {
      slope(x, y) = static_cast<float>(x);
      offset(x, y) = static_cast<float>(y * y);
    }
  }
  const ToneLines lines{slope.view(), offset.view()};
  const auto place = [](int i, int cells) {
    return std::min(std::max((i + 0.5) / kToneCell - 0.5, 0.0), static_cast<double>(cells - 1));
  };
  for (const int begin : {0, 1, 22, 30}) {
    for (int y = 0; y < shape.height; ++y) {
      const int n = std::min(npsim::kMostLines, shape.width - begin);
      std::vector<float> s(npsim::kMostLines);
      std::vector<float> o(npsim::kMostLines);
      npsim::lines_of_pixels(lines, begin, y, n, s.data(), o.data());
      const double down = place(y, slope.shape().height);
      const double low = std::floor(down);
      for (int i = 0; i < n; ++i) {
        CHECK(static_cast<double>(s[static_cast<std::size_t>(i)]) ==
              doctest::Approx(place(begin + i, slope.shape().width)).epsilon(1e-5));
        CHECK(static_cast<double>(o[static_cast<std::size_t>(i)]) ==
              doctest::Approx(low * low + (down - low) * (2 * low + 1)).epsilon(1e-5));
      }
    }
  }
}

TEST_CASE("sensor: the base of constant light is that light, and a step of 8 stops stays in it by two thirds") {
  const Shape shape{240, 160};
  const LocalToneParams params = local();
  const float dark = 2e-3F;
  Lines flat = lines_of(params, shape, plane_of(shape, [&](int, int) { return dark; }));
  CHECK(std::fabs(flat.base(params, 100, 50, dark) - std::log2(2.2e-3)) < 1e-3);

  const float bright = 256.0F * dark;
  const double whole = std::log2((0.512 + 2e-4) / 2.2e-3);
  const int window = 24;                      // px: .15 of the height
  for (int edge = 120; edge < 124; ++edge) {  // within a cell
    Lines step = lines_of(params, shape, plane_of(shape, [&](int x, int) { return x < edge ? dark : bright; }));
    const auto kept = [&](int away) {
      return (step.base(params, edge + away, 80, bright) - step.base(params, edge - 1 - away, 80, dark)) / whole;
    };
    CAPTURE(edge);
    CHECK(kept(0) > 0.61);
    CHECK(kept(0) < 0.69);
    CHECK(kept(window / 2) > 0.91);
    CHECK(kept(window) > 0.98);
    CHECK(std::fabs(step.base(params, 20, 80, dark) - std::log2(2.2e-3)) < 1e-3);
  }
}

TEST_CASE("sensor: by a local tone curve a lit sign keeps its picture, and flat light is what the curve makes of it") {
  // A sign 8 stops above the street, on it letters a stop below; the curve of 120 dB shows them with little contrast.
  const Shape shape{256, 160};
  const auto light = [](int x, int y) {
    const bool sign = x >= 96 && x < 160 && y >= 48 && y < 112;
    const bool letter = (x / 8) % 2 == 0;
    return sign ? (letter ? 0.1F : 0.2F) : 8e-4F;
  };
  const npsim_test::Image<npsim::Rgb8> global = developed(1000, 0.0F, plane_of(shape, light));
  const npsim_test::Image<npsim::Rgb8> kept = developed(1000, 0.8F, plane_of(shape, light));
  const int contrast_before = global(124, 80).g - global(132, 80).g;
  const int contrast = kept(124, 80).g - kept(132, 80).g;
  CAPTURE(contrast_before);
  CAPTURE(contrast);
  CHECK(contrast > 2 * contrast_before);
  CHECK(kept(124, 80).g < 255);
  // Far from the sign nothing changes.
  CHECK(std::abs(kept(8, 8).g - global(8, 8).g) <= 1);
}

TEST_CASE("sensor: a local tone curve shows flat light of every brightness as the one curve does, white as white") {
  const Shape shape{32, 24};
  for (const float light : {0.0F, 1e-4F, 0.01F, 0.3F, 0.6F, 0.9F, 1.0F}) {
    const auto shown = [&](float share) {
      return developed(4000, share, plane_of(shape, [&](int, int) { return light; }))(16, 12).g;
    };
    CAPTURE(light);
    CHECK(std::abs(shown(0.0F) - shown(0.8F)) <= 1);
    CHECK((light < 1.0F || shown(0.8F) == 255));
  }
}

TEST_CASE("sensor: what exceeds its base arrives at white, monotonic and without a step") {
  float last = 0;
  for (int i = 0; i <= 4000; ++i) {
    const float y = 2.0F * static_cast<float>(i) / 4000.0F;
    const float shown = npsim::below_white(npsim::simd::scalar::F32(y), npsim::simd::scalar::F32(0.5F)).value;
    CHECK(shown >= last);
    CHECK(shown - last < 6e-4F);
    CHECK(shown <= 1.0F);
    last = shown;
  }
  CHECK(npsim::below_white(npsim::simd::scalar::F32(0.8F), npsim::simd::scalar::F32(0.5F)).value == 0.8F);
  CHECK(last == 1.0F);
}

TEST_CASE("sensor: a local tone curve has the same bits for any order of the chunks") {
  const Shape shape{130, 77};
  const Plane plane = noise(shape);
  Lines forward = lines_of(local(), shape, plane);
  Lines backward = lines_of(local(), shape, plane, npsim_test::BackwardExecutor{});
  for (int y = 0; y < forward.slope.shape().height; ++y) {
    for (int x = 0; x < forward.slope.shape().width; ++x) {
      CHECK(forward.slope(x, y) == backward.slope(x, y));
      CHECK(forward.offset(x, y) == backward.offset(x, y));
    }
  }
}

TEST_CASE("sensor: a local tone curve refuses parameters out of range, other sizes and a small workspace") {
  const Shape shape{16, 12};
  const Plane plane = noise(shape);
  Plane slope(npsim::tone_cells(shape));
  Plane offset(npsim::tone_cells(shape));
  npsim_test::Scratch scratch(npsim::tone_lines_workspace_bytes(local(), shape));
  npsim::SerialExecutor executor;
  const auto code = [&](const LocalToneParams& params, Shape of, npsim::Workspace& workspace) {
    return npsim::tone_lines(params, Mosaic::rggb, of, plane.view(), {slope.view(), offset.view()}, workspace, executor)
        .code();
  };
  CHECK(code(local(), shape, scratch.workspace()) == StatusCode::ok);
  CHECK(code(local(), {20, 12}, scratch.workspace()) == StatusCode::shape_mismatch);
  npsim::Workspace none;
  CHECK(code(local(), shape, none) == StatusCode::workspace_exhausted);
  for (const auto bad :
       {&LocalToneParams::share, &LocalToneParams::reach, &LocalToneParams::edge_stops, &LocalToneParams::dark}) {
    LocalToneParams params = local();
    params.edge_stops = 0.2F;
    CHECK(code(params, shape, scratch.workspace()) == StatusCode::invalid_argument);
    params = local();
    params.*bad = std::nanf("");
    CHECK(code(params, shape, scratch.workspace()) == StatusCode::invalid_argument);
  }
}
