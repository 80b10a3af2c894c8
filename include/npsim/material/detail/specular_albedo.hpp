// SPDX-License-Identifier: Apache-2.0
// Directional albedo of a rough dielectric interface: the share of the light from one direction that GGX reflects.
//
//   E(mu, alpha, f0) = integral of D V F cos over the hemisphere = f0 a(mu, alpha) + b(mu, alpha)
// since Schlick's term is linear in f0. What the interface does not reflect enters the body below it, so the diffuse
// part needs E; Schlick's term at the surface normal would darken rough roads seen at a grazing angle threefold.
// Tables: alpha at (.14 + .86 i / 12)^2, mu at (j / 24)^2, bilinear in the square roots. The nodes are those that come
// nearest to E of 73 roughnesses and 145 angles, each integrated by sampling visible normals (Heitz, JCGT 2018) at
// 6.6e4 points of a Sobol sequence; the averages are those of the interpolated tables over the cosine-weighted
// hemisphere. A test integrates again and finds E within 0.005 for f0 <= 0.1, 0.01 for a metal.
#ifndef NPSIM_MATERIAL_DETAIL_SPECULAR_ALBEDO_HPP
#define NPSIM_MATERIAL_DETAIL_SPECULAR_ALBEDO_HPP

#include <array>
#include <cmath>
#include <cstddef>

#include "npsim/core/config.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

inline constexpr std::size_t kSpecularAlphas = 13;
inline constexpr std::size_t kSpecularCosines = 25;
inline constexpr float kSpecularFirstRoot = 0.14F;  // of alpha; the last is 1
using SpecularTable = std::array<std::array<float, kSpecularCosines>, kSpecularAlphas>;

inline constexpr SpecularTable kSpecularScale = {{
    {{0.2548F, 0.2462F, 0.2256F, 0.2075F, 0.2143F, 0.2493F, 0.3062F, 0.3777F, 0.4592F,
      0.5376F, 0.6209F, 0.6951F, 0.7639F, 0.8240F, 0.8746F, 0.9153F, 0.9463F, 0.9686F,
      0.9834F, 0.9923F, 0.9969F, 0.9990F, 0.9996F, 0.9997F, 0.9997F}},
    {{0.4150F, 0.4103F, 0.3967F, 0.3829F, 0.3652F, 0.3677F, 0.3904F, 0.4329F, 0.4906F,
      0.5568F, 0.6281F, 0.6969F, 0.7618F, 0.8195F, 0.8690F, 0.9093F, 0.9407F, 0.9635F,
      0.9790F, 0.9886F, 0.9940F, 0.9965F, 0.9975F, 0.9979F, 0.9981F}},
    {{0.5524F, 0.5495F, 0.5418F, 0.5273F, 0.5211F, 0.5125F, 0.5135F, 0.5258F, 0.5542F,
      0.5949F, 0.6448F, 0.6994F, 0.7550F, 0.8076F, 0.8541F, 0.8936F, 0.9253F, 0.9495F,
      0.9668F, 0.9783F, 0.9853F, 0.9892F, 0.9913F, 0.9924F, 0.9931F}},
    {{0.6620F, 0.6596F, 0.6538F, 0.6464F, 0.6357F, 0.6280F, 0.6230F, 0.6246F, 0.6330F,
      0.6514F, 0.6776F, 0.7118F, 0.7505F, 0.7908F, 0.8307F, 0.8667F, 0.8976F, 0.9227F,
      0.9420F, 0.9562F, 0.9660F, 0.9725F, 0.9767F, 0.9795F, 0.9815F}},
    {{0.7453F, 0.7430F, 0.7375F, 0.7300F, 0.7221F, 0.7136F, 0.7067F, 0.7018F, 0.7015F,
      0.7059F, 0.7166F, 0.7327F, 0.7538F, 0.7790F, 0.8061F, 0.8334F, 0.8600F, 0.8834F,
      0.9033F, 0.9194F, 0.9319F, 0.9415F, 0.9487F, 0.9541F, 0.9584F}},
    {{0.8071F, 0.8045F, 0.7984F, 0.7906F, 0.7815F, 0.7723F, 0.7634F, 0.7559F, 0.7500F,
      0.7470F, 0.7472F, 0.7514F, 0.7593F, 0.7708F, 0.7852F, 0.8017F, 0.8191F, 0.8368F,
      0.8536F, 0.8688F, 0.8821F, 0.8935F, 0.9032F, 0.9113F, 0.9183F}},
    {{0.8522F, 0.8489F, 0.8416F, 0.8323F, 0.8217F, 0.8105F, 0.7993F, 0.7886F, 0.7790F,
      0.7708F, 0.7646F, 0.7605F, 0.7591F, 0.7604F, 0.7642F, 0.7703F, 0.7783F, 0.7877F,
      0.7981F, 0.8088F, 0.8195F, 0.8299F, 0.8397F, 0.8489F, 0.8574F}},
    {{0.8847F, 0.8807F, 0.8717F, 0.8603F, 0.8472F, 0.8333F, 0.8191F, 0.8051F, 0.7917F,
      0.7791F, 0.7678F, 0.7579F, 0.7497F, 0.7433F, 0.7389F, 0.7364F, 0.7358F, 0.7369F,
      0.7396F, 0.7436F, 0.7487F, 0.7547F, 0.7614F, 0.7686F, 0.7762F}},
    {{0.9082F, 0.9033F, 0.8922F, 0.8782F, 0.8621F, 0.8449F, 0.8271F, 0.8093F, 0.7919F,
      0.7750F, 0.7590F, 0.7440F, 0.7303F, 0.7179F, 0.7069F, 0.6974F, 0.6895F, 0.6833F,
      0.6785F, 0.6753F, 0.6736F, 0.6732F, 0.6742F, 0.6763F, 0.6796F}},
    {{0.9253F, 0.9192F, 0.9058F, 0.8888F, 0.8693F, 0.8483F, 0.8265F, 0.8046F, 0.7828F,
      0.7614F, 0.7408F, 0.7210F, 0.7022F, 0.6846F, 0.6681F, 0.6528F, 0.6389F, 0.6263F,
      0.6151F, 0.6052F, 0.5967F, 0.5895F, 0.5838F, 0.5793F, 0.5762F}},
    {{0.9376F, 0.9304F, 0.9145F, 0.8942F, 0.8708F, 0.8457F, 0.8196F, 0.7932F, 0.7668F,
      0.7409F, 0.7156F, 0.6911F, 0.6676F, 0.6451F, 0.6238F, 0.6036F, 0.5846F, 0.5668F,
      0.5501F, 0.5347F, 0.5205F, 0.5075F, 0.4958F, 0.4851F, 0.4757F}},
    {{0.9467F, 0.9383F, 0.9195F, 0.8957F, 0.8683F, 0.8388F, 0.8082F, 0.7771F, 0.7460F,
      0.7154F, 0.6855F, 0.6565F, 0.6285F, 0.6016F, 0.5759F, 0.5515F, 0.5282F, 0.5062F,
      0.4853F, 0.4657F, 0.4473F, 0.4300F, 0.4138F, 0.3986F, 0.3845F}},
    {{0.9533F, 0.9436F, 0.9219F, 0.8944F, 0.8628F, 0.8288F, 0.7934F, 0.7576F, 0.7218F,
      0.6866F, 0.6522F, 0.6189F, 0.5867F, 0.5560F, 0.5265F, 0.4985F, 0.4719F, 0.4467F,
      0.4229F, 0.4004F, 0.3792F, 0.3592F, 0.3403F, 0.3226F, 0.3060F}},
}};
inline constexpr SpecularTable kSpecularBias = {{
    {{0.7471F, 0.7387F, 0.7134F, 0.6851F, 0.6761F, 0.6653F, 0.6405F, 0.5907F, 0.5250F,
      0.4514F, 0.3740F, 0.3016F, 0.2330F, 0.1743F, 0.1237F, 0.0836F, 0.0527F, 0.0307F,
      0.0160F, 0.0072F, 0.0026F, 0.0007F, 0.0001F, 0.0000F, 0.0000F}},
    {{0.5859F, 0.5825F, 0.5722F, 0.5566F, 0.5349F, 0.5158F, 0.4966F, 0.4747F, 0.4382F,
      0.3907F, 0.3354F, 0.2760F, 0.2193F, 0.1660F, 0.1206F, 0.0825F, 0.0531F, 0.0314F,
      0.0168F, 0.0078F, 0.0030F, 0.0009F, 0.0001F, 0.0000F, 0.0000F}},
    {{0.4481F, 0.4462F, 0.4400F, 0.4297F, 0.4157F, 0.3979F, 0.3802F, 0.3547F, 0.3314F,
      0.3012F, 0.2674F, 0.2292F, 0.1880F, 0.1479F, 0.1102F, 0.0781F, 0.0517F, 0.0319F,
      0.0178F, 0.0088F, 0.0037F, 0.0012F, 0.0003F, 0.0000F, 0.0000F}},
    {{0.3385F, 0.3369F, 0.3323F, 0.3247F, 0.3141F, 0.3011F, 0.2846F, 0.2675F, 0.2470F,
      0.2253F, 0.2009F, 0.1748F, 0.1472F, 0.1193F, 0.0929F, 0.0683F, 0.0473F, 0.0305F,
      0.0180F, 0.0095F, 0.0044F, 0.0017F, 0.0005F, 0.0001F, 0.0000F}},
    {{0.2550F, 0.2537F, 0.2499F, 0.2437F, 0.2353F, 0.2246F, 0.2125F, 0.1980F, 0.1826F,
      0.1657F, 0.1480F, 0.1294F, 0.1102F, 0.0910F, 0.0724F, 0.0551F, 0.0398F, 0.0270F,
      0.0169F, 0.0096F, 0.0048F, 0.0020F, 0.0007F, 0.0002F, 0.0000F}},
    {{0.1932F, 0.1921F, 0.1888F, 0.1836F, 0.1766F, 0.1681F, 0.1580F, 0.1470F, 0.1348F,
      0.1219F, 0.1084F, 0.0947F, 0.0809F, 0.0674F, 0.0544F, 0.0423F, 0.0314F, 0.0221F,
      0.0145F, 0.0088F, 0.0047F, 0.0022F, 0.0008F, 0.0002F, 0.0000F}},
    {{0.1482F, 0.1472F, 0.1442F, 0.1397F, 0.1339F, 0.1267F, 0.1187F, 0.1096F, 0.1001F,
      0.0900F, 0.0797F, 0.0694F, 0.0592F, 0.0494F, 0.0401F, 0.0315F, 0.0238F, 0.0172F,
      0.0117F, 0.0074F, 0.0043F, 0.0021F, 0.0009F, 0.0003F, 0.0000F}},
    {{0.1157F, 0.1147F, 0.1120F, 0.1080F, 0.1029F, 0.0969F, 0.0901F, 0.0828F, 0.0751F,
      0.0671F, 0.0591F, 0.0512F, 0.0435F, 0.0362F, 0.0294F, 0.0232F, 0.0178F, 0.0130F,
      0.0091F, 0.0059F, 0.0036F, 0.0019F, 0.0009F, 0.0003F, 0.0000F}},
    {{0.0923F, 0.0913F, 0.0888F, 0.0851F, 0.0806F, 0.0754F, 0.0696F, 0.0634F, 0.0571F,
      0.0506F, 0.0443F, 0.0381F, 0.0322F, 0.0267F, 0.0217F, 0.0171F, 0.0131F, 0.0097F,
      0.0068F, 0.0046F, 0.0028F, 0.0016F, 0.0008F, 0.0003F, 0.0000F}},
    {{0.0754F, 0.0744F, 0.0719F, 0.0685F, 0.0644F, 0.0597F, 0.0547F, 0.0494F, 0.0441F,
      0.0388F, 0.0336F, 0.0287F, 0.0241F, 0.0199F, 0.0160F, 0.0126F, 0.0097F, 0.0072F,
      0.0051F, 0.0034F, 0.0022F, 0.0013F, 0.0006F, 0.0002F, 0.0000F}},
    {{0.0631F, 0.0621F, 0.0597F, 0.0564F, 0.0525F, 0.0483F, 0.0438F, 0.0392F, 0.0346F,
      0.0301F, 0.0259F, 0.0219F, 0.0182F, 0.0149F, 0.0120F, 0.0094F, 0.0072F, 0.0053F,
      0.0038F, 0.0026F, 0.0016F, 0.0010F, 0.0005F, 0.0002F, 0.0000F}},
    {{0.0542F, 0.0531F, 0.0506F, 0.0474F, 0.0438F, 0.0398F, 0.0357F, 0.0316F, 0.0276F,
      0.0238F, 0.0202F, 0.0169F, 0.0139F, 0.0113F, 0.0090F, 0.0070F, 0.0053F, 0.0039F,
      0.0028F, 0.0019F, 0.0012F, 0.0007F, 0.0004F, 0.0002F, 0.0000F}},
    {{0.0476F, 0.0465F, 0.0439F, 0.0407F, 0.0372F, 0.0334F, 0.0296F, 0.0259F, 0.0223F,
      0.0190F, 0.0160F, 0.0132F, 0.0108F, 0.0087F, 0.0068F, 0.0053F, 0.0040F, 0.0029F,
      0.0021F, 0.0014F, 0.0009F, 0.0006F, 0.0003F, 0.0001F, 0.0000F}},
}};
inline constexpr std::array<float, kSpecularAlphas> kSpecularScaleMean = {0.9524F, 0.9507F, 0.9442F, 0.9295F, 0.9036F,
                                                                          0.8654F, 0.8151F, 0.7544F, 0.6861F, 0.6137F,
                                                                          0.5410F, 0.4710F, 0.4060F};
inline constexpr std::array<float, kSpecularAlphas> kSpecularBiasMean = {0.0462F, 0.0426F, 0.0370F, 0.0305F, 0.0242F,
                                                                         0.0187F, 0.0143F, 0.0108F, 0.0081F, 0.0061F,
                                                                         0.0046F, 0.0035F, 0.0027F};

// E of one alpha and f0, for any cosine; made once per evaluation.
class SpecularAlbedo {
 public:
  SpecularAlbedo(float alpha, float f0) noexcept : f0_(f0) {
    constexpr float last = static_cast<float>(kSpecularAlphas - 1);
    const float at =
        (std::sqrt(alpha > 0.0F ? alpha : 0.0F) - kSpecularFirstRoot) * (last / (1.0F - kSpecularFirstRoot));
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
