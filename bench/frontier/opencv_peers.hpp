// SPDX-License-Identifier: Apache-2.0
// The functions of OpenCV that the kernels are set against, on our own memory, one thread.
//
// Where the program is built without OpenCV, available() and ximgproc() are false and nothing else may be called.
#ifndef NPSIM_BENCH_FRONTIER_OPENCV_PEERS_HPP
#define NPSIM_BENCH_FRONTIER_OPENCV_PEERS_HPP

#include <cstdint>
#include <string>

#include "npsim/core/image_view.hpp"
#include "npsim/core/vec.hpp"

namespace npsim::bench::opencv {

[[nodiscard]] bool available();
[[nodiscard]] bool ximgproc();
[[nodiscard]] std::string version();

// Windows are circular, of the given diameter; borders are mirrored.
void joint_bilateral(ImageView<const Vec3f> lab, ImageView<const float> depth, int diameter, double sigma_c,
                     double sigma_s, ImageView<float> out);
void bilateral(ImageView<const float> depth, int diameter, double sigma_c, double sigma_s, ImageView<float> out);
void gaussian_blur(ImageView<const float> depth, int side, double sigma, ImageView<float> out);

// Population variance of the l x l window at its upper-left pixel, as E[z^2] - E[z]^2 from box filters in float or in
// double; then 1 for every pixel of a window above the threshold. Nothing looks at labels.
void box_variance(ImageView<const float> depth, int l, double threshold, bool in_double, ImageView<float> variance,
                  ImageView<std::uint8_t> mask);
// The same from integral images in double. Windows that leave the image get 0.
void integral_variance(ImageView<const float> depth, int l, double threshold, ImageView<float> variance,
                       ImageView<std::uint8_t> mask);

// sRGB in 0..1 to L, a, b.
void lab_from_float(ImageView<const Vec3f> srgb, ImageView<Vec3f> lab);
// 8 bits to 8 bits: L 255/100, a + 128, b + 128.
void lab_from_8bit(ImageView<const Rgb8> srgb, ImageView<Rgb8> lab);

}  // namespace npsim::bench::opencv

#endif  // NPSIM_BENCH_FRONTIER_OPENCV_PEERS_HPP
