// SPDX-License-Identifier: Apache-2.0
// Directional albedo of a rough dielectric interface: the share of the light from one direction that GGX reflects.
//
//   E(mu, alpha, f0) = integral of D V F cos over the hemisphere = f0 a(mu, alpha) + b(mu, alpha)
// since Schlick's term is linear in f0. What the interface does not reflect enters the body below it, so the diffuse
// part needs E; Schlick's term at the surface normal would darken rough roads seen at a grazing angle threefold.
// Tables: alpha at ((i + 1) / 7)^2, mu at (j / 15)^2 (0.001 for 0), bilinear in the square roots. They were computed by
// stratified sampling of visible normals (Heitz, JCGT 2018), 5.4e5 samples a node; the averages are those of the
// interpolated tables over the cosine-weighted hemisphere. A test integrates again and finds E within 0.02 (0.013 at
// worst, narrow lobes at 3 degrees).
#ifndef NPSIM_MATERIAL_DETAIL_SPECULAR_ALBEDO_HPP
#define NPSIM_MATERIAL_DETAIL_SPECULAR_ALBEDO_HPP

#include <array>
#include <cmath>
#include <cstddef>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr std::size_t kSpecularAlphas = 7;
inline constexpr std::size_t kSpecularCosines = 16;
using SpecularTable = std::array<std::array<float, kSpecularCosines>, kSpecularAlphas>;

inline constexpr SpecularTable kSpecularScale = {{
    {{0.2548F, 0.2401F, 0.2156F, 0.2485F, 0.3397F, 0.4602F, 0.5883F, 0.7088F, 0.8117F, 0.8909F, 0.9452F, 0.9774F,
      0.9928F, 0.9982F, 0.9993F, 0.9993F}},
    {{0.5527F, 0.5472F, 0.5302F, 0.5156F, 0.5210F, 0.5588F, 0.6268F, 0.7114F, 0.7962F, 0.8690F, 0.9234F, 0.9589F,
      0.9785F, 0.9874F, 0.9909F, 0.9924F}},
    {{0.7442F, 0.7403F, 0.7288F, 0.7155F, 0.7047F, 0.7021F, 0.7124F, 0.7372F, 0.7740F, 0.8167F, 0.8584F, 0.8936F,
      0.9198F, 0.9375F, 0.9489F, 0.9564F}},
    {{0.8498F, 0.8446F, 0.8300F, 0.8124F, 0.7945F, 0.7784F, 0.7663F, 0.7596F, 0.7594F, 0.7658F, 0.7775F, 0.7927F,
      0.8093F, 0.8257F, 0.8409F, 0.8547F}},
    {{0.9045F, 0.8966F, 0.8747F, 0.8479F, 0.8195F, 0.7913F, 0.7646F, 0.7405F, 0.7195F, 0.7021F, 0.6888F, 0.6794F,
      0.6739F, 0.6720F, 0.6734F, 0.6777F}},
    {{0.9323F, 0.9209F, 0.8892F, 0.8505F, 0.8087F, 0.7664F, 0.7252F, 0.6859F, 0.6491F, 0.6151F, 0.5842F, 0.5563F,
      0.5315F, 0.5099F, 0.4913F, 0.4758F}},
    {{0.9462F, 0.9308F, 0.8879F, 0.8354F, 0.7789F, 0.7217F, 0.6658F, 0.6123F, 0.5620F, 0.5153F, 0.4721F, 0.4326F,
      0.3964F, 0.3636F, 0.3338F, 0.3068F}},
}};
inline constexpr SpecularTable kSpecularBias = {{
    {{0.7350F, 0.7178F, 0.6787F, 0.6632F, 0.6155F, 0.5192F, 0.4017F, 0.2857F, 0.1851F, 0.1070F, 0.0533F, 0.0215F,
      0.0063F, 0.0010F, 0.0000F, 0.0000F}},
    {{0.4444F, 0.4402F, 0.4244F, 0.3996F, 0.3682F, 0.3295F, 0.2794F, 0.2184F, 0.1540F, 0.0962F, 0.0519F, 0.0230F,
      0.0078F, 0.0017F, 0.0002F, 0.0000F}},
    {{0.2536F, 0.2510F, 0.2415F, 0.2263F, 0.2062F, 0.1821F, 0.1547F, 0.1251F, 0.0945F, 0.0651F, 0.0397F, 0.0206F,
      0.0085F, 0.0026F, 0.0004F, 0.0000F}},
    {{0.1475F, 0.1455F, 0.1386F, 0.1282F, 0.1151F, 0.1000F, 0.0839F, 0.0674F, 0.0514F, 0.0366F, 0.0239F, 0.0138F,
      0.0067F, 0.0025F, 0.0006F, 0.0000F}},
    {{0.0917F, 0.0900F, 0.0844F, 0.0766F, 0.0673F, 0.0572F, 0.0469F, 0.0370F, 0.0279F, 0.0199F, 0.0132F, 0.0080F,
      0.0042F, 0.0018F, 0.0005F, 0.0000F}},
    {{0.0625F, 0.0609F, 0.0558F, 0.0493F, 0.0421F, 0.0347F, 0.0277F, 0.0213F, 0.0156F, 0.0110F, 0.0072F, 0.0044F,
      0.0024F, 0.0011F, 0.0004F, 0.0000F}},
    {{0.0469F, 0.0451F, 0.0401F, 0.0342F, 0.0282F, 0.0224F, 0.0173F, 0.0128F, 0.0091F, 0.0062F, 0.0040F, 0.0024F,
      0.0013F, 0.0006F, 0.0002F, 0.0000F}},
}};
inline constexpr std::array<float, kSpecularAlphas> kSpecularScaleMean = {0.9514F, 0.9428F, 0.9017F, 0.8134F,
                                                                          0.6851F, 0.5409F, 0.4066F};
inline constexpr std::array<float, kSpecularAlphas> kSpecularBiasMean = {0.0466F, 0.0371F, 0.0244F, 0.0144F,
                                                                         0.0082F, 0.0047F, 0.0028F};


// E of one alpha and f0, for any cosine; made once per evaluation.
class SpecularAlbedo {
 public:
  SpecularAlbedo(float alpha, float f0) noexcept : f0_(f0) {
    const float at = 7.0F * std::sqrt(alpha > 0.0F ? alpha : 0.0F) - 1.0F;
    const float last = static_cast<float>(kSpecularAlphas - 1);
    const float bounded = at > 0.0F ? (at < last ? at : last) : 0.0F;
    row_ = static_cast<std::size_t>(bounded);
    if (row_ > kSpecularAlphas - 2) row_ = kSpecularAlphas - 2;
    share_ = bounded - static_cast<float>(row_);
  }

  [[nodiscard]] float operator()(float cosine) const noexcept {
    const float at =
        static_cast<float>(kSpecularCosines - 1) * std::sqrt(cosine > 0.0F ? (cosine < 1.0F ? cosine : 1.0F) : 0.0F);
    std::size_t column = static_cast<std::size_t>(at);
    if (column > kSpecularCosines - 2) column = kSpecularCosines - 2;
    const float u = at - static_cast<float>(column);
    const auto of = [&](const SpecularTable& t, std::size_t row) {
      return t[row][column] + (t[row][column + 1] - t[row][column]) * u;
    };
    return combine(of(kSpecularScale, row_), of(kSpecularScale, row_ + 1), of(kSpecularBias, row_),
                   of(kSpecularBias, row_ + 1));
  }

  // Over the cosine-weighted hemisphere.
  [[nodiscard]] float mean() const noexcept {
    return combine(kSpecularScaleMean[row_], kSpecularScaleMean[row_ + 1], kSpecularBiasMean[row_],
                   kSpecularBiasMean[row_ + 1]);
  }

 private:
  [[nodiscard]] float combine(float scale0, float scale1, float bias0, float bias1) const noexcept {
    return f0_ * (scale0 + (scale1 - scale0) * share_) + bias0 + (bias1 - bias0) * share_;
  }

  float f0_;
  float share_;
  std::size_t row_;
};

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_MATERIAL_DETAIL_SPECULAR_ALBEDO_HPP
