// SPDX-License-Identifier: Apache-2.0
// The real pictures that NPSIM_TEST_DATA names, each as the text of a scene.json. They may not be distributed; tests
// that want them are skipped, saying so, where the variable is not set.
#ifndef NPSIM_TESTS_UNIT_REAL_SCENES_HPP
#define NPSIM_TESTS_UNIT_REAL_SCENES_HPP

#include <doctest/doctest.h>

#include <cstdlib>
#include <string>
#include <vector>

namespace npsim_test {

struct RealScene {
  std::string name;
  std::string json;
};

// Empty, with a message, without data.
inline std::vector<RealScene> real_scenes() {
  const char* const data = std::getenv("NPSIM_TEST_DATA");
  if (data == nullptr || *data == '\0') {
    MESSAGE("skipped: NPSIM_TEST_DATA is not set");
    return {};
  }
  const std::string root = std::string(data) + "/";
  const auto cityscapes = [&](const std::string& name) {
    const std::string d = root + "cityscapes/" + name;
    const std::string ids =
        "{\"file\": \"" + d + "_gtFine_instanceIds.png\", \"encoding\": \"cityscapes_instance_ids\"}";
    return "{\"image\": \"" + d + "_leftImg8bit.png\", \"depth\": {\"file\": \"" + d +
           "_disparity.png\", \"encoding\": \"cityscapes_disparity\"}, \"camera\": {\"cityscapes\": \"" + d +
           "_camera.json\"}, \"labels\": " + ids + ", \"instances\": " + ids + "}";
  };
  const auto plain = [&](const std::string& image, const std::string& depth, const char* scale,
                         const std::string& rest) {
    return "{\"image\": \"" + root + image + "\", \"depth\": {\"file\": \"" + root + depth +
           "\", \"encoding\": \"uint16\", \"scale\": " + scale + "}, " + rest + "}";
  };
  return {{"dusseldorf", cityscapes("dusseldorf_000020_000019")},
          {"aachen", cityscapes("aachen_000001_000019")},
          {"carla", plain("carla/0183_rgb.png", "carla/0183_depth_m_x256_DERIVED.png", "0.00390625",
                          "\"camera\": {\"fx\": 951.07, \"fy\": 951.07, \"cx\": 691, \"cy\": 256}, \"labels\": "
                          "{\"file\": \"" + root +
                              "carla/0183_labelIds_DERIVED.png\", \"encoding\": \"cityscapes_label_ids\"}")},
          {"kitti", plain("kitti/0000000050_rgb.png", "kitti/0000000050_depth.png", "0.00390625",
                          R"("camera": {"fx": 707.0493, "fy": 707.0493, "cx": 604.0814, "cy": 180.5066})")},
          {"rgbd", plain("rgbd/frame-000000.color.jpg", "rgbd/frame-000000.depth.png", "0.001",
                         R"("camera": {"fx": 585, "fy": 585, "cx": 320, "cy": 240})")}};
}

}  // namespace npsim_test

#endif  // NPSIM_TESTS_UNIT_REAL_SCENES_HPP
