// SPDX-License-Identifier: Apache-2.0
// How rough surfaces are, dry and under a film of water.
#ifndef NPSIM_MATERIAL_ROUGHNESS_HPP
#define NPSIM_MATERIAL_ROUGHNESS_HPP

#include <cstddef>
#include <cstdint>

#include "npsim/core/config.hpp"
#include "npsim/core/image_view.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/material/detail/class_priors.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

// Roughness (GGX alpha) of every pixel by its class, dry, where no inverse-rendering network supplies it, and the alpha
// of such a network's roughness. Classes whose normals are too unsure to mirror a lamp can be given a wider gloss: over
// normals that scatter, a narrow lobe is on average a wide one (Toksvig, Journal of Graphics Tools 2005).
//
// Cost: one look-up per pixel.

// Roughness as renderers, glTF and networks give it, 0..1, looks even; GGX alpha is its square (Burley, SIGGRAPH 2012).
[[nodiscard]] constexpr float alpha_of_roughness(float roughness) noexcept { return roughness * roughness; }

// Classes that have a GGX alpha of at least `alpha`.
struct WideGloss {
  LabelSet labels;
  float alpha = 1.0F;
};

[[nodiscard]] inline Status validate(const WideGloss& w) noexcept {
  return w.alpha > 0.0F && w.alpha <= 1.0F
             ? Status()
             : Status(StatusCode::invalid_argument, "roughness: alpha of a wide gloss in (0, 1]");
}

// GGX alpha by class, kMatt for what has none. `labels` may be empty: one class.
template <class Executor>
Status estimate_roughness(ImageView<const Label> labels, const WideGloss& wide, ImageView<float> alpha,
                          Executor& executor) {
  if (alpha.empty()) return Status(StatusCode::invalid_argument, "roughness: the output is empty");
  NPSIM_RETURN_IF_ERROR(validate(wide));
  if (!labels.empty() && labels.shape() != alpha.shape()) {
    return Status(StatusCode::shape_mismatch, "roughness: labels must have the shape of the output");
  }
  executor.for_chunks(static_cast<std::size_t>(alpha.height()), 64, [&](std::size_t begin, std::size_t end) {
    for (std::size_t row = begin; row < end; ++row) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < alpha.width(); ++x) {
        const Label l = labels.empty() ? label::unlabeled : labels(x, y);
        const float own = surface_prior(l).alpha;
        alpha(x, y) = wide.labels.contains(l) && own < wide.alpha ? wide.alpha : own;
      }
    }
  });
  return {};
}

// A film of water on the ground: roads, pavements and the like become darker and smoother, and mirror.
//
// Under a film of index n light that the ground scatters is reflected back onto it and absorbed (Angstrom 1925; Lekner
// and Dorf, Applied Optics 1988):  albedo_wet = a / (n^2 (1 - a) + a).  So asphalt of .1 gets .059; white stays white.
// The film takes over the interface: its GGX alpha, and its reflectance at normal incidence,
// ((n - 1) / (n + 1))^2 = .020. `wetness` blends all of it linearly, as a share of the surface that is covered.
// Cost: a division per channel of wet pixels.

inline constexpr float kWaterIndex = 1.33F;
inline constexpr float kWaterF0 =
    ((kWaterIndex - 1.0F) / (kWaterIndex + 1.0F)) * ((kWaterIndex - 1.0F) / (kWaterIndex + 1.0F));

struct WetFilmParams {
  float wetness = 0.0F;  // 0 dry .. 1 a closed film
  float alpha = 0.12F;   // of a film on asphalt: .05 to .2
};

[[nodiscard]] inline Status validate(const WetFilmParams& p) noexcept {
  const bool good = p.wetness >= 0.0F && p.wetness <= 1.0F && p.alpha > 0.0F && p.alpha <= 1.0F;
  return good ? Status() : Status(StatusCode::invalid_argument, "wet film: wetness in 0..1, alpha in (0, 1]");
}

inline constexpr LabelSet kWettedLabels = LabelSet::of(label::road, label::parking, label::sidewalk, label::ground);

[[nodiscard]] constexpr float wet_albedo(float a) noexcept { return a / (kWaterIndex * kWaterIndex * (1.0F - a) + a); }

// Reflectance at normal incidence under a film of `share` / 255.
[[nodiscard]] constexpr float film_f0(float dry_f0, std::uint8_t share) noexcept {
  return dry_f0 + (kWaterF0 - dry_f0) * (static_cast<float>(share) * (1.0F / 255.0F));
}

// Changes albedo and alpha in place and writes the share of the film. `labels` may be empty: nothing gets wet.
template <class Executor>
Status apply_wet_film(const WetFilmParams& p, ImageView<const Label> labels, ImageView<Vec3f> albedo,
                      ImageView<float> alpha, ImageView<std::uint8_t> film, Executor& executor) {
  NPSIM_RETURN_IF_ERROR(validate(p));
  const Shape shape = film.shape();
  if (albedo.shape() != shape || alpha.shape() != shape || (!labels.empty() && labels.shape() != shape)) {
    return Status(StatusCode::shape_mismatch, "wet film: all planes must have one size");
  }
  const auto share = static_cast<std::uint8_t>(p.wetness * 255.0F + 0.5F);
  const auto wet = [&](float a) { return a + (wet_albedo(a) - a) * p.wetness; };
  executor.for_chunks(static_cast<std::size_t>(shape.height), 64, [&](std::size_t begin, std::size_t end) {
    for (auto y = static_cast<int>(begin); y < static_cast<int>(end); ++y) {
      for (int x = 0; x < shape.width; ++x) {
        film(x, y) = 0;
        if (share == 0 || labels.empty() || !kWettedLabels.contains(labels(x, y))) continue;
        const Vec3f a = albedo(x, y);
        film(x, y) = share;
        albedo(x, y) = {wet(a.x), wet(a.y), wet(a.z)};
        alpha(x, y) += (p.alpha - alpha(x, y)) * p.wetness;
      }
    }
  });
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_ROUGHNESS_HPP
