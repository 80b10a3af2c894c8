// SPDX-License-Identifier: Apache-2.0
// Probabilistic light source activation (section 3.6.2): which sources are on in one night, how strong, of which
// colour.
//
// Every (group, class) draws one p ~ U(a, b), one strength and one colour; every source of it is then on with
// probability p, independently. Groups are independent of each other and of ungrouped sources, each of which is its own
// group.
// Beyond the text, because one sees it at once when it is missing:
//   - the lamps of one vehicle are switched together: one p and one draw for front and rear; rear lamps are stop lamps
//     with stop_probability, and show the indicator of one side with indicator_probability;
//   - street lamps of a class share technology and strength all over the image, with a small jitter per lamp, and low
//     ones carry less light;
//   - shop fronts are lit more often and more strongly than flats, and those of one group together; what shines in the
//     photograph already (shop windows at dusk, signs) is lit, and its windows outshine the day as shops' do;
//   - of a traffic light that shows several discs one is on: the annotated one, else one that glows by day, else any.
//     Unknown states follow the daytime colour, then the place in the panel, then a draw.
// `by_text_alone` leaves the first three out: every lamp is drawn by itself with the p of its group.
// Randomness: streams (seed, activation, variant, key) with key = kind | class | group or mark in disjoint bits, so the
// order of emitters and the presence of others never change a draw, and each variant is a new night.
// The seed must differ between photographs; otherwise their windows light up together.
// Cost: O(n), plus O(n) for each disc of a grouped traffic light. Memory: none.
#ifndef NPSIM_LIGHT_ACTIVATION_HPP
#define NPSIM_LIGHT_ACTIVATION_HPP

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "npsim/core/algorithm.hpp"
#include "npsim/core/config.hpp"
#include "npsim/core/random.hpp"
#include "npsim/core/span.hpp"
#include "npsim/core/status.hpp"
#include "npsim/core/vec.hpp"
#include "npsim/labels/light_classes.hpp"
#include "npsim/light/emitter.hpp"
#include "npsim/light/light_set.hpp"
#include "npsim/light/photometry.hpp"

namespace npsim {
inline namespace NPSIM_ABI {

struct Activation {
  bool lit = false;
  float strength = 0;     // as drawn, in the unit of the profile (strength_unit); also where not lit
  float probability = 0;  // the p of its (group, class); 1 of what is always lit
  Vec2f xy;
  Vec3f intensity_cd;     // peak luminous intensity times linear RGB of luminance 1; zero where not lit
  Vec3f luminance_cd_m2;  // what the camera at the origin sees on the emitter's pixels; zero where not lit
};

struct ActivationParams {
  Span<const LightSetEntry> light_set;  // replaces the default strengths and colours of the classes that it names
  float stop_probability = 0.35F;       // of rear lamps of a moving vehicle that are lit [default]
  float indicator_probability =
      0.06F;  // that one is seen on such a vehicle: every eighth turns, half of the time it is on
  float street_strength_jitter = 0.1F;  // relative, of single lamps: age and dirt [default]
  float street_xy_jitter = 0.003F;      // about one step of a 3-step MacAdam ellipse
  float bicycle_parked_p[2] = {0.1F, 0.2F};
  bool by_text_alone = false;
  float moon_lx = 0.25F;                 // of a full moon high above, on what faces it; clouds and phases: less
  float signal_draw[2] = {0.5F, 0.05F};  // shares of red and amber where nothing tells the state; green is the rest
};

[[nodiscard]] inline Status validate(const ActivationParams& p) noexcept {
  const auto share = [](float v) { return v >= 0.0F && v <= 1.0F; };
  const bool good = p.moon_lx >= 0.0F && p.moon_lx <= 10.0F && share(p.stop_probability) &&
                    share(p.indicator_probability) && share(p.street_strength_jitter) && p.street_xy_jitter >= 0.0F &&
                    p.street_xy_jitter <= 0.05F && share(p.bicycle_parked_p[0]) && share(p.bicycle_parked_p[1]) &&
                    share(p.signal_draw[0]) && share(p.signal_draw[1]) && share(p.signal_draw[0] + p.signal_draw[1]);
  if (!good) return Status(StatusCode::invalid_argument, "activation: a probability or jitter lies outside its range");
  for (const LightSetEntry& e : p.light_set) {
    if (!std::isfinite(e.strength) || e.strength < 0.0F || !(e.xy.x >= 0.0F) || !(e.xy.y > 0.0F) ||
        !(e.xy.x + e.xy.y <= 1.0F)) {
      return Status(StatusCode::invalid_argument,
                    "light set: strength not negative, (x, y) inside the colour triangle");
    }
    if (e.luminaire != nullptr) NPSIM_RETURN_IF_ERROR(validate(*e.luminaire));
  }
  return {};
}

namespace light_detail {

enum class ActivationKey : std::uint32_t { group, alone, source, technology, vehicle, signal, ego, unseen, indicator };

[[nodiscard]] constexpr RandomStream activation_stream(std::uint64_t seed, std::uint32_t variant, ActivationKey key,
                                                       std::uint32_t id, LightClass cls) noexcept {
  const std::uint32_t light =
      (static_cast<std::uint32_t>(key) << 21U) | (static_cast<std::uint32_t>(cls) << 16U) | (id & 0xFFFFU);
  return RandomStream(seed, RandomPurpose::activation, variant, light, 0, 0);
}

[[nodiscard]] constexpr bool is_vehicle_lamp(LightClass c) noexcept {
  return c == LightClass::parked_front || c == LightClass::parked_rear || c == LightClass::moving_front ||
         c == LightClass::moving_rear;
}
[[nodiscard]] constexpr bool is_traffic_light(const Emitter& e) noexcept {
  return e.cls == LightClass::inferred_object && e.profile == EmissionProfile::signal;
}

// What a lamp's height says of its type. Roads are lit to a class, so that flux grows with the square of the height
// between types: a lantern of 4 m has a quarter of the strengths that a class gives for 8 m. Beyond these two nothing is
// scaled: how high a mast really is, is not known better than how far away it stands, and flux must not repeat that.
[[nodiscard]] inline float height_factor(float height_m) noexcept {
  if (!(height_m > 0.0F)) return 1.0F;
  const float h = clamp_to(height_m, 4.0F, 8.0F) / 8.0F;
  return h * h;
}

// Uniform in the square root.
[[nodiscard]] inline float draw_strength(float low, float high, float u) noexcept {
  const float a = std::sqrt(low);
  const float root = a + u * (std::sqrt(high) - a);
  return root * root;
}

// Red, amber or green as a lit signal photographs by day; unknown where the colour is dark or nearly white.
// The limit between red and amber: signal amber has g/r = 0.24 in linear sRGB, signal red 0.
[[nodiscard]] inline SignalState state_from_colour(const Vec3f& c) noexcept {
  if (!is_finite(c)) return SignalState::unknown;
  const float high = c.x > c.y ? (c.x > c.z ? c.x : c.z) : (c.y > c.z ? c.y : c.z);
  const float low = c.x < c.y ? (c.x < c.z ? c.x : c.z) : (c.y < c.z ? c.y : c.z);
  if (!(high > 0.02F) || high - low < 0.3F * high) return SignalState::unknown;
  if (c.y >= c.x) return c.y >= 0.8F * c.z ? SignalState::green : SignalState::unknown;
  if (c.z > 0.8F * c.x) return SignalState::unknown;
  return c.y < 0.18F * c.x ? SignalState::red : SignalState::amber;
}

[[nodiscard]] constexpr LightClassModel model_of(const ActivationParams& p, const Emitter& e) noexcept {
  const bool bright = (e.shop_front || e.shines_by_day) && e.cls == LightClass::window_building && !p.by_text_alone;
  return bright ? kShopFront : light_class_model(e.cls, e.profile);
}

// In every night: headlamps of cars that drive, and what shines in the photograph already.
[[nodiscard]] constexpr bool is_always_on(const ActivationParams& p, const Emitter& e) noexcept {
  return is_headlamp_always_on(e) || (e.shines_by_day && !p.by_text_alone);
}

struct SignalChoice {
  bool on = true;
  SignalState state = SignalState::unknown;
};

[[nodiscard]] inline SignalChoice choose_signal(const ActivationParams& p, std::uint64_t seed, std::uint32_t variant,
                                                Span<const Emitter> emitters, Span<const Vec3f> day_rgb,
                                                std::size_t self) noexcept {
  const Emitter& e = emitters[self];
  const auto day = [&](std::size_t i) { return day_rgb.empty() ? Vec3f{} : day_rgb[i]; };
  SignalChoice choice;
  choice.state = e.state != SignalState::unknown ? e.state : state_from_colour(day(self));
  std::size_t discs = 1;
  std::size_t above = 0;
  if (e.group != 0) {
    // Evidence that a disc is the lit one: 2 annotated, 1 a signal colour by day, 0 none. The strongest wins, then the
    // brighter one, then the draw.
    int best_evidence = -1;
    float best_weight = -1.0F;
    std::size_t best = self;
    discs = 0;
    RandomStream random = activation_stream(seed, variant, ActivationKey::signal, e.group, LightClass::none);
    for (std::size_t i = 0; i < emitters.size(); ++i) {
      const Emitter& other = emitters[i];
      if (other.group != e.group || !is_traffic_light(other)) continue;
      ++discs;
      if (other.centre_m.y < e.centre_m.y || (other.centre_m.y == e.centre_m.y && i < self)) ++above;
      const float u = random.uniform();
      const int evidence =
          other.state != SignalState::unknown ? 2 : (state_from_colour(day(i)) != SignalState::unknown);
      const float weight = evidence == 1 ? luminance(day(i)) : u;
      if (evidence > best_evidence || (evidence == best_evidence && weight > best_weight)) {
        best_evidence = evidence;
        best_weight = weight;
        best = i;
      }
    }
    choice.on = best == self || (e.state != SignalState::unknown && e.state == emitters[best].state);
  }
  if (choice.state == SignalState::unknown) {
    if (discs > 1) {
      choice.state = above == 0 ? SignalState::red : (above + 1 == discs ? SignalState::green : SignalState::amber);
    } else {
      RandomStream random = activation_stream(seed, variant, ActivationKey::source, e.mark, e.cls);
      const float u = random.uniform();
      choice.state = u < p.signal_draw[0]                      ? SignalState::red
                     : u < p.signal_draw[0] + p.signal_draw[1] ? SignalState::amber
                                                               : SignalState::green;
    }
  }
  return choice;
}

// Adds the indicator to a rear lamp: both lie behind one lens, so their light adds up to one colour. The side is
// drawn; of a vehicle's rear lamps those left of their mean are the left ones.
inline void add_indicator(const ActivationParams& p, std::uint64_t seed, std::uint32_t variant,
                          Span<const Emitter> emitters, const Emitter& e, float& strength, Vec2f& xy) noexcept {
  RandomStream random = activation_stream(seed, variant, ActivationKey::indicator, e.group != 0 ? e.group : e.mark,
                                          e.group != 0 ? LightClass::none : e.cls);
  if (!(random.uniform() < p.indicator_probability)) return;
  const bool turns_left = random.uniform() < 0.5F;
  const float added = draw_strength(kIndicatorCd[0], kIndicatorCd[1], random.uniform());
  float sum = 0.0F;
  float count = 0.0F;
  for (const Emitter& other : emitters) {
    if (other.cls != e.cls || (e.group != 0 ? other.group != e.group : other.mark != e.mark)) continue;
    sum += other.centre_m.x;
    count += 1.0F;
  }
  if ((e.centre_m.x * count < sum) != turns_left) return;
  xy = light_xy(light_rgb(xy) * strength + light_rgb(chromaticity::signal_amber) * added);
  strength += added;
}

// Replaces strength and colour by one of the user's entries of this class, if there are any.
[[nodiscard]] inline bool draw_from_set(Span<const LightSetEntry> set, LightClass cls, float u, float& strength,
                                        Vec2f& xy) noexcept {
  std::size_t n = 0;
  for (const LightSetEntry& e : set) n += e.cls == cls ? 1U : 0U;
  if (n == 0) return false;
  const auto wanted = static_cast<std::size_t>(u * static_cast<float>(n));
  std::size_t seen = 0;
  for (const LightSetEntry& e : set) {
    if (e.cls != cls || seen++ != (wanted < n ? wanted : n - 1)) continue;
    strength = e.strength;
    xy = e.xy;
  }
  return true;
}

}  // namespace light_detail

// What an emitter of given strength and colour gives off.
[[nodiscard]] inline Activation make_activation(const Emitter& e, bool lit, float probability, float strength,
                                                const Vec2f& xy) noexcept {
  Activation a;
  a.lit = lit;
  a.strength = strength;
  a.probability = probability;
  a.xy = xy;
  if (lit) {
    const Vec3f rgb = light_rgb(xy);
    const float peak = peak_intensity_cd(e, strength);
    a.intensity_cd = rgb * peak;
    a.luminance_cd_m2 = rgb * seen_luminance_cd_m2(e, peak);
  }
  return a;
}

// Luminance of the moon that gives moon_lx.
[[nodiscard]] constexpr float moon_luminance_cd_m2(const ActivationParams& p) noexcept {
  return p.moon_lx / (3.14159265F * kMoonRadius * kMoonRadius);
}

// The greatest peak intensity, in cd, that activate_lights() can draw for an emitter in any variant.
[[nodiscard]] inline float strongest_intensity_cd(const ActivationParams& p, const Emitter& e) noexcept {
  if (is_moon(e)) return peak_intensity_cd(e, moon_luminance_cd_m2(p));
  const LightClassModel model = light_detail::model_of(p, e);
  if (model.xy_count == 0) return 0.0F;
  const bool street = is_street_lamp(e.cls);
  float strength = model.strength_high;
  if (e.cls == LightClass::moving_rear) strength = max_of(strength, kStopLampCd[1]) + kIndicatorCd[1];
  if (street) strength *= light_detail::height_factor(e.mounting_height_m);
  for (const LightSetEntry& entry : p.light_set) {
    if (entry.cls == e.cls && entry.strength > strength) strength = entry.strength;
  }
  if (street) strength *= 1.0F + p.street_strength_jitter;
  return peak_intensity_cd(e, strength);
}

// What a lamp shines in every night at least, in cd; 0 for one that may be off.
[[nodiscard]] inline float certain_intensity_cd(const ActivationParams& p, const Emitter& e) noexcept {
  if (is_moon(e)) return peak_intensity_cd(e, moon_luminance_cd_m2(p));
  const LightClassModel model = light_detail::model_of(p, e);
  const bool always =
      model.xy_count > 0 && (light_detail::is_always_on(p, e) || (is_street_lamp(e.cls) && model.p_low >= 1.0F));
  if (!always) return 0.0F;
  float strength = model.strength_low;
  if (is_street_lamp(e.cls)) strength *= light_detail::height_factor(e.mounting_height_m);
  for (const LightSetEntry& entry : p.light_set) {
    if (entry.cls == e.cls && entry.strength < strength) strength = entry.strength;
  }
  return peak_intensity_cd(e, strength);
}

// The mean peak intensity, in cd, over many nights: where a class has a range, of its middle; without light sets.
[[nodiscard]] inline float mean_intensity_cd(const ActivationParams& p, const Emitter& e) noexcept {
  if (is_moon(e)) return peak_intensity_cd(e, moon_luminance_cd_m2(p));
  const LightClassModel model = light_detail::model_of(p, e);
  if (model.xy_count == 0) return 0.0F;
  float strength = light_detail::draw_strength(model.strength_low, model.strength_high, 0.5F);
  if (is_street_lamp(e.cls)) strength *= light_detail::height_factor(e.mounting_height_m);
  const float lit = light_detail::is_always_on(p, e) ? 1.0F : 0.5F * (model.p_low + model.p_high);
  return lit * peak_intensity_cd(e, strength);
}

// One night. `day_rgb` is empty or holds, per emitter, the linear mean colour of its brightest pixels by day.
// Emitters of a class without a model (groups, none) stay dark.
[[nodiscard]] inline Status activate_lights(const ActivationParams& p, std::uint64_t seed, std::uint32_t variant,
                                            Span<const Emitter> emitters, Span<const Vec3f> day_rgb,
                                            Span<Activation> out) noexcept {
  using light_detail::ActivationKey;
  NPSIM_RETURN_IF_ERROR(validate(p));
  if (out.size() != emitters.size() || (!day_rgb.empty() && day_rgb.size() != emitters.size())) {
    return Status(StatusCode::shape_mismatch, "activation: one activation and one daytime colour per emitter");
  }
  for (std::size_t i = 0; i < emitters.size(); ++i) {
    const Emitter& e = emitters[i];
    if (is_moon(e)) {
      out[i] = make_activation(e, true, 1.0F, moon_luminance_cd_m2(p), chromaticity::moon);
      continue;
    }
    const LightClassModel model = light_detail::model_of(p, e);
    if (model.xy_count == 0) {
      out[i] = Activation{};
      continue;
    }
    const bool ego = is_own_headlamp(e);
    const bool vehicle = light_detail::is_vehicle_lamp(e.cls);
    const bool street = is_street_lamp(e.cls);
    const bool technology = street && !p.by_text_alone;
    const ActivationKey key = ego            ? ActivationKey::ego
                              : technology   ? ActivationKey::technology
                              : e.group != 0 ? ActivationKey::group
                                             : ActivationKey::alone;
    const std::uint32_t id = ego || technology ? 0U : (e.group != 0 ? e.group : e.mark);
    RandomStream shared = light_detail::activation_stream(seed, variant, key, id, e.cls);
    RandomStream source = e.unseen != 0
                              ? light_detail::activation_stream(seed, variant, ActivationKey::unseen, e.unseen, e.cls)
                              : light_detail::activation_stream(seed, variant, ActivationKey::source, e.mark, e.cls);
    float u_p = shared.uniform();
    const float u_strength = shared.uniform();
    const float u_xy = shared.uniform();
    const float u_stop = shared.uniform();
    float u_lit = source.uniform();
    if (e.group != 0 && (p.by_text_alone || (vehicle && !ego))) {
      RandomStream lamps =
          light_detail::activation_stream(seed, variant, ActivationKey::vehicle, e.group, LightClass::none);
      u_p = lamps.uniform();
      if (!p.by_text_alone) u_lit = lamps.uniform();
    }

    if (e.shop_front && e.group != 0 && !p.by_text_alone) u_lit = shared.uniform();

    float p_low = model.p_low;
    float p_high = model.p_high;
    if (e.group_cls == LightClass::bicycle_group &&
        (e.cls == LightClass::parked_front || e.cls == LightClass::parked_rear)) {
      p_low = p.bicycle_parked_p[0];
      p_high = p.bicycle_parked_p[1];
    }
    const float probability = light_detail::is_always_on(p, e) ? 1.0F : p_low + (p_high - p_low) * u_p;
    bool lit = u_lit < probability;

    float strength = light_detail::draw_strength(model.strength_low, model.strength_high, u_strength);
    if (e.cls == LightClass::moving_rear && u_stop < p.stop_probability) {
      strength = light_detail::draw_strength(kStopLampCd[0], kStopLampCd[1], u_strength);
    }
    const auto pick = static_cast<int>(u_xy * static_cast<float>(model.xy_count));
    Vec2f xy = model.xy[pick < model.xy_count ? pick : model.xy_count - 1];
    if (e.cls == LightClass::inferred_object && !day_rgb.empty() && is_finite(day_rgb[i]) &&
        luminance(day_rgb[i]) > 0.0F) {
      xy = light_xy(day_rgb[i]);
    }
    const bool from_set = light_detail::draw_from_set(p.light_set, e.cls, u_xy, strength, xy);
    const bool turns = e.cls == LightClass::moving_rear && e.group_cls != LightClass::bicycle_group;
    if (turns && !from_set && !p.by_text_alone) {
      light_detail::add_indicator(p, seed, variant, emitters, e, strength, xy);
    }
    if (street && !from_set) strength *= light_detail::height_factor(e.mounting_height_m);
    if (street) {
      strength *= 1.0F + p.street_strength_jitter * source.uniform(-1.0F, 1.0F);
      xy = {xy.x + p.street_xy_jitter * source.uniform(-1.0F, 1.0F),
            xy.y + p.street_xy_jitter * source.uniform(-1.0F, 1.0F)};
    }
    if (light_detail::is_traffic_light(e)) {
      // The colour of a signal is its meaning: neither a light set nor a draw may change it.
      const light_detail::SignalChoice choice = light_detail::choose_signal(p, seed, variant, emitters, day_rgb, i);
      lit = lit && choice.on;
      xy = choice.state == SignalState::red     ? chromaticity::signal_red
           : choice.state == SignalState::amber ? chromaticity::signal_amber
                                                : chromaticity::signal_green;
    }
    out[i] = make_activation(e, lit, probability, strength, xy);
  }
  return {};
}

}  // namespace NPSIM_ABI
}  // namespace npsim

#endif  // NPSIM_LIGHT_ACTIVATION_HPP
