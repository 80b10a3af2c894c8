// SPDX-License-Identifier: Apache-2.0
// write_street: a generated street as a scene folder, with the truth beside the estimates.
//
//   scene.json image.png depth.pfm normals.pfm labels.png instances.png albedo.pfm roughness.pfm lights.json lights.png
//   reflectors.png
//   truth/depth.pfm truth/background_depth.pfm truth/normals.pfm truth/street.obj truth/street.mtl truth/emitters.json
// depth.pfm and normals.pfm are the estimates; scene.json names normals, albedo and roughness only where the street is
// asked to give them. Everything is in the camera frame (x right, y down, z forward), metres. lights.json is a
// Segments.ai release; a pixel of lights.png holds id = R + 256 G + 65536 B.
#ifndef NPSIM_SAMPLES_STREET_WRITE_HPP
#define NPSIM_SAMPLES_STREET_WRITE_HPP

#include <string>

#include "npsim/io/error.hpp"
#include "params.hpp"

namespace npsim {
namespace street {

inline constexpr const char* kGenerator = "npsim street";  // as scene.json names what made it

// Everything that write_street() writes into its folder.
inline constexpr const char* kStreetFiles[] = {"image.png",           "depth.pfm",
                                               "normals.pfm",         "labels.png",
                                               "instances.png",       "albedo.pfm",
                                               "roughness.pfm",       "lights.json",
                                               "lights.png",          "truth/depth.pfm",
                                               "truth/street.mtl",    "truth/street.obj",
                                               "truth/normals.pfm",   "truth/background_depth.pfm",
                                               "truth/emitters.json", "reflectors.png",
                                               "scene.json"};

// Creates `dir` and its subfolder; scene.json comes last, so that a folder with one is complete.
[[nodiscard]] io::Outcome write_street(const Street& s, const std::string& dir);

}  // namespace street
}  // namespace npsim

#endif  // NPSIM_SAMPLES_STREET_WRITE_HPP
