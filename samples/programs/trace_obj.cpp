// SPDX-License-Identifier: Apache-2.0
// Traces a ray through each pixel of a camera before a mesh from an OBJ file, and writes what it meets as a picture.
#include <cstdint>
#include <cstdio>
#include <vector>

#include "npsim/core/camera.hpp"
#include "npsim/io/obj.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/trace/bvh.hpp"

int main(int argc, char** argv) {
  if (argc != 3) return std::fprintf(stderr, "usage: trace_obj MESH.obj PICTURE.png\n"), 2;
  const auto mesh = npsim::io::read_obj(argv[1]);
  if (!mesh) return std::fprintf(stderr, "%s\n", mesh.error().line().c_str()), 1;

  std::vector<unsigned char> memory(npsim::bvh_workspace_bytes(mesh.value().view().faces.size()));
  npsim::Workspace workspace(memory.data(), memory.size());
  npsim::Bvh bvh;
  const npsim::Status built = npsim::build_bvh(mesh.value().view(), workspace, bvh);
  if (!built.ok()) return std::fprintf(stderr, "%s: %s\n", argv[1], built.message()), 1;

  npsim::io::Image<std::uint8_t> picture({640, 360});
  const npsim::Intrinsics camera = npsim::intrinsics_from_fov(picture.shape(), 1.0F);
  for (int y = 0; y < picture.height(); ++y) {
    for (int x = 0; x < picture.width(); ++x) {
      npsim::Ray ray;
      ray.direction = npsim::unproject_pixel(camera, x, y, 1.0F);  // hit.t is then z-depth
      npsim::Hit hit;
      if (npsim::closest_hit(bvh, ray, hit)) picture(x, y) = static_cast<std::uint8_t>(255.0F / (1.0F + 0.1F * hit.t));
    }
  }
  const auto written = npsim::io::write_png(argv[2], picture.view());
  if (!written) std::fprintf(stderr, "%s\n", written.error().line().c_str());
  return written ? 0 : 1;
}
