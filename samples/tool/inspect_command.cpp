// SPDX-License-Identifier: Apache-2.0
#include "inspect_command.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "console.hpp"
#include "loading.hpp"
#include "npsim/core/camera.hpp"
#include "npsim/geometry/ground.hpp"
#include "npsim/io/memory.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/io/scene_doubts.hpp"
#include "npsim/labels/cityscapes.hpp"
#include "npsim/labels/light_classes.hpp"
#include "options.hpp"
#include "outputs.hpp"
#include "overlay.hpp"

namespace npsim::tool {
namespace {

void print_depth(const io::Image<float>& depth) {
  std::vector<float> valid;
  for (int y = 0; y < depth.height(); ++y) {
    for (int x = 0; x < depth.width(); ++x) {
      if (is_valid_depth(depth(x, y))) valid.push_back(depth(x, y));
    }
  }
  const std::size_t total = depth.shape().pixels();
  const double invalid = 100.0 * static_cast<double>(total - valid.size()) / static_cast<double>(total);
  if (valid.empty()) {
    std::printf("depth         no valid sample\n");
    return;
  }
  std::sort(valid.begin(), valid.end());
  const auto at = [&](double q) {
    return static_cast<double>(valid[static_cast<std::size_t>(q * static_cast<double>(valid.size() - 1))]);
  };
  std::printf("depth         %.2f m to %.2f m, median %.2f m; %.1f %% missing (will be filled)\n", at(0), at(1),
              at(0.5), invalid);
}

void print_labels(const io::Image<Label>& labels) {
  if (labels.empty()) {
    std::printf("labels        none: all is one class, no object is told from the background\n");
    return;
  }
  std::array<std::size_t, kLabelCount> count{};
  for (int y = 0; y < labels.height(); ++y) {
    for (int x = 0; x < labels.width(); ++x) {
      if (labels(x, y) < kLabelCount) ++count[labels(x, y)];
    }
  }
  std::printf("labels       ");
  for (std::size_t i = 0; i < count.size(); ++i) {
    const double share = 100.0 * static_cast<double>(count[i]) / static_cast<double>(labels.shape().pixels());
    if (share >= 0.05) std::printf(" %s %.1f %%;", kLabels[i].name, share);
  }
  std::printf("\n");
}

void print_lights(const io::Scene& scene) {
  if (scene.lights.empty()) {
    std::printf("lights        none marked: only the own headlamps and the sky will give light\n");
    return;
  }
  std::array<int, kLightClassCount> count{};
  for (const LightMark& mark : scene.lights) ++count[static_cast<std::size_t>(mark.cls)];
  std::printf("lights       ");
  for (std::size_t i = 1; i < count.size(); ++i) {
    if (count[i] > 0) std::printf(" %d %s;", count[i], kLightClasses[i].name);
  }
  std::printf("\n");
}

// The ground as the depth has it; inlier_share 0: not found.
[[nodiscard]] GroundPlane ground_of(const SceneView& scene) {
  GroundPlane ground;
  const std::size_t bytes = ground_workspace_bytes({}, scene.shape());
  io::HostMemory memory(bytes);
  Workspace workspace = memory.workspace(bytes);
  if (!estimate_ground({}, scene.depth, scene.labels, scene.camera, workspace, ground).ok()) ground.inlier_share = 0.0F;
  return ground;
}

void print_ground(const GroundPlane& ground) {
  if (!(ground.inlier_share > 0.0F)) {
    std::printf("ground        not found: taken as level, %.2f m below the camera\n",
                static_cast<double>(ground.camera_height_m));
    return;
  }
  const double degrees = 180 / 3.14159265358979323846;
  std::printf("ground        %.2f m below the camera, which looks down by %.1f degrees and leans by %.1f\n",
              static_cast<double>(ground.camera_height_m), degrees * std::asin(static_cast<double>(-ground.up.z)),
              degrees * std::atan2(static_cast<double>(ground.up.x), static_cast<double>(-ground.up.y)));
}

// Shows where labels, ground and lamps lie.
[[nodiscard]] io::Outcome write_overlay(const io::Scene& scene, const GroundPlane& ground, const std::string& path) {
  if (const io::Outcome apart = InputFiles(scene).expect_none_of({path}); !apart) return apart;
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  if (!folder.empty()) {
    if (const io::Outcome made = make_folder(folder.string()); !made) return made;
  }
  const io::Image<Rgb8> picture = overlay_picture(scene.view(), ground);
  return io::write_png(path, picture.view());
}

}  // namespace

int run_inspect(const InspectOptions& options) {
  const io::Expected<io::Scene> loaded = load_scene(options.scene, "");
  if (!loaded) return fail(loaded.error());
  const io::Scene& scene = loaded.value();
  const auto present = [](bool there, const char* without) { return there ? "present" : without; };
  std::printf("scene         %s\n", scene.name.c_str());
  std::printf("image         %d x %d\n", scene.image.width(), scene.image.height());
  const Intrinsics& k = scene.intrinsics;
  std::printf("camera        fx %.2f fy %.2f cx %.2f cy %.2f px (pixel centres at +0.5)\n", static_cast<double>(k.fx),
              static_cast<double>(k.fy), static_cast<double>(k.cx), static_cast<double>(k.cy));
  print_depth(scene.depth);
  print_labels(scene.labels);
  std::printf("instances     %s\n", present(!scene.instances.empty(), "none: connected components stand for objects"));
  std::printf("normals       %s\n", present(!scene.normals.empty(), "none: computed from depth"));
  std::printf("albedo        %s\n", present(!scene.albedo.empty(), "none: estimated from the photograph"));
  std::printf("roughness     %s\n", present(!scene.roughness.empty(), "none: by class"));
  print_lights(scene);
  const GroundPlane ground = ground_of(scene.view());
  print_ground(ground);
  for (const std::string& note : scene.notes) std::printf("note          %s\n", note.c_str());
  for (const std::string& doubt : io::scene_doubts(scene)) std::printf("DOUBT         %s\n", doubt.c_str());
  if (!options.output.empty()) {
    if (const io::Outcome written = write_overlay(scene, ground, options.output); !written) {
      return fail(written.error());
    }
    std::printf("%s\n", options.output.c_str());
  }
  return kExitDone;
}

}  // namespace npsim::tool
