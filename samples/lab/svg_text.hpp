// SPDX-License-Identifier: Apache-2.0
// What all charts write as SVG is made of: formatted lines, and text with its special characters escaped.
#ifndef NPSIM_SAMPLES_LAB_SVG_TEXT_HPP
#define NPSIM_SAMPLES_LAB_SVG_TEXT_HPP

#include <cstdio>
#include <string>

namespace npsim::tool {

template <class... T>
void print(std::string& out, const char* format, T... values) {
  char line[1024];
  std::snprintf(line, sizeof line, format, values...);
  out += line;
}

[[nodiscard]] inline std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&': out += "&amp;"; break;
      case '<': out += "&lt;"; break;
      case '>': out += "&gt;"; break;
      default: out += c;
    }
  }
  return out;
}

}  // namespace npsim::tool

#endif  // NPSIM_SAMPLES_LAB_SVG_TEXT_HPP
