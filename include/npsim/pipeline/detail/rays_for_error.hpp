// SPDX-License-Identifier: Apache-2.0
// How many rays reach an error, by the errors of the tries so far.
//
// The rays that an error takes go as a power of it: -2 where they are independent; a few stratified ones gain less by
// more. What the power is in a scene is seen from its second try on.
#ifndef NPSIM_PIPELINE_DETAIL_RAYS_FOR_ERROR_HPP
#define NPSIM_PIPELINE_DETAIL_RAYS_FOR_ERROR_HPP

#include <cmath>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {
namespace relight_detail {

class RaysForError {
 public:
  // Of the next try. `rays` < most had an error that is `more` > 1 times the one to be reached.
  [[nodiscard]] int next(int rays, double error, double more, int most) noexcept {
    constexpr double kUsual = 2.4, kLeast = 2.0, kMost = 4.0;
    constexpr double kMargin = 1.05;
    double power = kUsual;
    const auto rays_now = static_cast<double>(rays);
    if (error_before_ > error) power = std::log(rays_now / rays_before_) / std::log(error_before_ / error);
    rays_before_ = rays_now;
    error_before_ = error;
    const double needed = std::ceil(kMargin * rays_now * std::pow(more, clamp_to(power, kLeast, kMost)));
    return needed < most ? static_cast<int>(needed) : most;
  }

 private:
  double rays_before_ = 0.0, error_before_ = 0.0;
};

}  // namespace relight_detail
}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_PIPELINE_DETAIL_RAYS_FOR_ERROR_HPP
