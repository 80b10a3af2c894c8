// SPDX-License-Identifier: Apache-2.0
// A five by seven pixel font, for shop names, number plates, posters and signs.
//
// A glyph is seven rows of five bits, top row first, leftmost pixel in the highest bit.
#ifndef NPSIM_SAMPLES_STREET_LETTERING_HPP
#define NPSIM_SAMPLES_STREET_LETTERING_HPP

#include <array>
#include <cstddef>
#include <cstdint>

#include "dice.hpp"

namespace npsim {
namespace street {

using Glyph = std::array<std::uint8_t, 7>;

inline constexpr std::array<Glyph, 36> kGlyphs = {{
    {14, 17, 17, 31, 17, 17, 17}, {30, 17, 17, 30, 17, 17, 30}, {14, 17, 16, 16, 16, 17, 14},
    {28, 18, 17, 17, 17, 18, 28}, {31, 16, 16, 30, 16, 16, 31}, {31, 16, 16, 30, 16, 16, 16},
    {14, 17, 16, 23, 17, 17, 15}, {17, 17, 17, 31, 17, 17, 17}, {14, 4, 4, 4, 4, 4, 14},
    {7, 2, 2, 2, 2, 18, 12},      {17, 18, 20, 24, 20, 18, 17}, {16, 16, 16, 16, 16, 16, 31},
    {17, 27, 21, 21, 17, 17, 17}, {17, 25, 21, 19, 17, 17, 17}, {14, 17, 17, 17, 17, 17, 14},
    {30, 17, 17, 30, 16, 16, 16}, {14, 17, 17, 17, 21, 18, 13}, {30, 17, 17, 30, 20, 18, 17},
    {15, 16, 16, 14, 1, 1, 30},   {31, 4, 4, 4, 4, 4, 4},       {17, 17, 17, 17, 17, 17, 14},
    {17, 17, 17, 17, 17, 10, 4},  {17, 17, 17, 21, 21, 27, 17}, {17, 10, 4, 4, 4, 10, 17},
    {17, 17, 10, 4, 4, 4, 4},     {31, 1, 2, 4, 8, 16, 31},     {14, 17, 19, 21, 25, 17, 14},
    {4, 12, 4, 4, 4, 4, 14},      {14, 17, 1, 6, 8, 16, 31},    {30, 1, 1, 14, 1, 1, 30},
    {2, 6, 10, 18, 31, 2, 2},     {31, 16, 30, 1, 1, 17, 14},   {6, 8, 16, 30, 17, 17, 14},
    {31, 1, 2, 4, 4, 4, 4},       {14, 17, 17, 14, 17, 17, 14}, {14, 17, 17, 15, 1, 2, 12},
}};

inline constexpr std::array<const char*, 16> kShopNames = {
    {"CAFE MILO", "BLUMEN", "APOTHEKE", "KIOSK 24", "OPTIK KERN", "HOTEL ADLER", "BROT UND MEHL", "RADHAUS", "TABAC",
     "BUCH", "PIZZERIA SOLE", "FRISEUR", "MODE NORD", "FOTO LUX", "BISTRO", "MARKT"}};

inline std::size_t text_length(const char* text) {
  std::size_t n = 0;
  while (text[n] != '\0' && n < 32) ++n;
  return n;
}

// Whether (column, row) in pixels of the font, row 0 at the top, lies on ink of `text`; six columns a letter.
inline bool ink(const char* text, float column, float row) {
  if (column < 0 || row < 0 || row >= 7) return false;
  const std::size_t i = static_cast<std::size_t>(column / 6.0F);
  if (i >= text_length(text)) return false;
  const int bit = static_cast<int>(column - 6.0F * static_cast<float>(i));
  if (bit > 4) return false;
  const char c = text[i];
  int glyph = -1;
  if (c >= 'A' && c <= 'Z') glyph = c - 'A';
  if (c >= '0' && c <= '9') glyph = 26 + c - '0';
  if (glyph < 0) return false;
  const unsigned bits = kGlyphs[static_cast<std::size_t>(glyph)][static_cast<std::size_t>(row)];
  return ((bits >> static_cast<unsigned>(4 - bit)) & 1U) != 0;
}

// The text centred in a field of `width` x `height` metres at (x, y) from the field's middle, letters `size` high.
inline bool ink_centred(const char* text, float x, float y, float size) {
  const float pixel = size / 7.0F;
  const float columns = 6.0F * static_cast<float>(text_length(text)) - 1.0F;
  return ink(text, x / pixel + 0.5F * columns, 3.5F - y / pixel);
}

// Seven characters of a number plate.
inline std::array<char, 10> plate_text(std::uint32_t seed) {
  std::array<char, 10> text{};
  for (std::size_t i = 0; i < 8; ++i) {
    const std::uint32_t h = hash(seed + static_cast<std::uint32_t>(i) * 31U);
    text[i] = i == 2 ? ' ' : (i < 5 ? static_cast<char>('A' + h % 26U) : static_cast<char>('0' + h % 10U));
  }
  return text;
}

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_LETTERING_HPP
