// SPDX-License-Identifier: Apache-2.0
#include "opencv_peers.hpp"

#ifdef NPSIM_BENCH_OPENCV
#include <cstdlib>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#ifdef NPSIM_BENCH_XIMGPROC
#include <opencv2/ximgproc/edge_filter.hpp>
#endif
#else
#include <cstdlib>
#endif

namespace npsim::bench::opencv {

#ifndef NPSIM_BENCH_XIMGPROC
bool ximgproc() { return false; }
void joint_bilateral(ImageView<const Vec3f>, ImageView<const float>, int, double, double, ImageView<float>) {
  std::abort();
}
#endif

#ifndef NPSIM_BENCH_OPENCV
bool available() { return false; }
std::string version() { return "none"; }
void bilateral(ImageView<const float>, int, double, double, ImageView<float>) { std::abort(); }
void gaussian_blur(ImageView<const float>, int, double, ImageView<float>) { std::abort(); }
void box_variance(ImageView<const float>, int, double, bool, ImageView<float>, ImageView<std::uint8_t>) {
  std::abort();
}
void integral_variance(ImageView<const float>, int, double, ImageView<float>, ImageView<std::uint8_t>) { std::abort(); }
void lab_from_float(ImageView<const Vec3f>, ImageView<Vec3f>) { std::abort(); }
void lab_from_8bit(ImageView<const Rgb8>, ImageView<Rgb8>) { std::abort(); }
#else
namespace {

// A header over our memory. OpenCV has no constant matrices; inputs are not written.
template <class T>
[[nodiscard]] cv::Mat mat(ImageView<const T> view, int type) {
  return cv::Mat(view.height(), view.width(), type, const_cast<T*>(view.data()),
                 static_cast<std::size_t>(view.stride()) * sizeof(T));
}
template <class T>
[[nodiscard]] cv::Mat mat(ImageView<T> view, int type) {
  return mat(ImageView<const T>(view), type);
}

// The window that a pixel names begins there: dilating with the anchor at the window's end paints all of its pixels.
void paint_windows(const cv::Mat& fires, int l, ImageView<std::uint8_t> mask) {
  cv::Mat out = mat(mask, CV_8U);
  cv::dilate(fires, out, cv::getStructuringElement(cv::MORPH_RECT, {l, l}), {l - 1, l - 1}, 1, cv::BORDER_CONSTANT,
             cv::Scalar(0));
}

}  // namespace

bool available() {
  cv::setNumThreads(1);
  return true;
}
std::string version() { return cv::getVersionString(); }

#ifdef NPSIM_BENCH_XIMGPROC
bool ximgproc() {
  cv::setNumThreads(1);
  return true;
}
void joint_bilateral(ImageView<const Vec3f> lab, ImageView<const float> depth, int diameter, double sigma_c,
                     double sigma_s, ImageView<float> out) {
  cv::Mat result = mat(out, CV_32F);
  cv::ximgproc::jointBilateralFilter(mat(lab, CV_32FC3), mat(depth, CV_32F), result, diameter, sigma_c, sigma_s);
}
#endif

void bilateral(ImageView<const float> depth, int diameter, double sigma_c, double sigma_s, ImageView<float> out) {
  cv::Mat result = mat(out, CV_32F);
  cv::bilateralFilter(mat(depth, CV_32F), result, diameter, sigma_c, sigma_s);
}

void gaussian_blur(ImageView<const float> depth, int side, double sigma, ImageView<float> out) {
  cv::Mat result = mat(out, CV_32F);
  cv::GaussianBlur(mat(depth, CV_32F), result, {side, side}, sigma);
}

void box_variance(ImageView<const float> depth, int l, double threshold, bool in_double, ImageView<float> variance,
                  ImageView<std::uint8_t> mask) {
  const int type = in_double ? CV_64F : CV_32F;
  static cv::Mat squared, mean, mean_squared, result, fires;  // kept from call to call, as our workspace is
  cv::Mat z = mat(depth, CV_32F);
  cv::multiply(z, z, squared, 1, type);
  cv::boxFilter(z, mean, type, {l, l}, {0, 0});
  cv::boxFilter(squared, mean_squared, type, {l, l}, {0, 0});
  cv::multiply(mean, mean, mean);
  cv::subtract(mean_squared, mean, result);
  cv::compare(result, cv::Scalar(threshold), fires, cv::CMP_GT);
  cv::Mat out = mat(variance, CV_32F);
  result.convertTo(out, CV_32F);
  paint_windows(fires, l, mask);
}

void integral_variance(ImageView<const float> depth, int l, double threshold, ImageView<float> variance,
                       ImageView<std::uint8_t> mask) {
  static cv::Mat sum, sum_squared, fires;
  cv::integral(mat(depth, CV_32F), sum, sum_squared, CV_64F, CV_64F);
  fires.create(depth.height(), depth.width(), CV_8U);
  const double n = static_cast<double>(l) * l;
  for (int y = 0; y < depth.height(); ++y) {
    auto* fire = fires.ptr<std::uint8_t>(y);
    float* out = variance.row(y);
    if (y + l > depth.height()) {
      for (int x = 0; x < depth.width(); ++x) {
        fire[x] = 0;
        out[x] = 0;
      }
      continue;
    }
    const double* top = sum.ptr<double>(y);
    const double* bottom = sum.ptr<double>(y + l);
    const double* top_squared = sum_squared.ptr<double>(y);
    const double* bottom_squared = sum_squared.ptr<double>(y + l);
    const int windows = depth.width() - l + 1;
    for (int x = 0; x < windows; ++x) {
      const double mean = (bottom[x + l] - bottom[x] - top[x + l] + top[x]) / n;
      const double of_squares = (bottom_squared[x + l] - bottom_squared[x] - top_squared[x + l] + top_squared[x]) / n;
      const double v = of_squares - mean * mean;
      out[x] = static_cast<float>(v);
      fire[x] = v > threshold ? 255 : 0;
    }
    for (int x = windows < 0 ? 0 : windows; x < depth.width(); ++x) {
      fire[x] = 0;
      out[x] = 0;
    }
  }
  paint_windows(fires, l, mask);
}

void lab_from_float(ImageView<const Vec3f> srgb, ImageView<Vec3f> lab) {
  cv::Mat result = mat(lab, CV_32FC3);
  cv::cvtColor(mat(srgb, CV_32FC3), result, cv::COLOR_RGB2Lab);
}

void lab_from_8bit(ImageView<const Rgb8> srgb, ImageView<Rgb8> lab) {
  cv::Mat result = mat(lab, CV_8UC3);
  cv::cvtColor(mat(srgb, CV_8UC3), result, cv::COLOR_RGB2Lab);
}
#endif

}  // namespace npsim::bench::opencv
