// SPDX-License-Identifier: Apache-2.0
// From a scene folder to a picture of its night: README.md.
#include <cstdio>
#include <string>
#include "npsim/io/night.hpp"
#include "npsim/io/png_jpeg.hpp"

int main(int argc, char** argv) {
  const auto nights = npsim::io::make_nights(std::string(argc > 1 ? argv[1] : "out/street"));
  const auto done = nights ? npsim::io::write_png(argc > 2 ? argv[2] : "night.png", nights.value()[0].view())
                           : npsim::io::Outcome(nights.error());
  if (!done) std::fprintf(stderr, "%s\n", done.error().line().c_str());
  return done ? 0 : 1;
}
