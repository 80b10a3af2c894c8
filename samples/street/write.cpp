// SPDX-License-Identifier: Apache-2.0
#include "write.hpp"

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>

#include "npsim/io/atomic_file.hpp"
#include "npsim/io/pfm.hpp"
#include "npsim/io/png_jpeg.hpp"
#include "npsim/labels/light_classes.hpp"
#include "sensors.hpp"

namespace npsim {
namespace street {
namespace {

std::string number(float v) {
  char text[40];
  std::snprintf(text, sizeof text, "%.6g", static_cast<double>(v));
  return text;
}

std::string vector_json(const Vec3f& v) { return "[" + number(v.x) + ", " + number(v.y) + ", " + number(v.z) + "]"; }

const char* state_name(SignalState s) {
  switch (s) {
    case SignalState::red: return "red";
    case SignalState::amber: return "amber";
    case SignalState::green: return "green";
    default: return "white/unknown";
  }
}

std::string scene_json(const Street& s) {
  const Intrinsics& k = s.intrinsics;
  char camera[200];
  std::snprintf(camera, sizeof camera,
                "{\"fx\": %.9g, \"fy\": %.9g, \"cx\": %.9g, \"cy\": %.9g, \"pixel_centre\": 0.5, \"height_m\": %.2f",
                static_cast<double>(k.fx), static_cast<double>(k.fy), static_cast<double>(k.cx),
                static_cast<double>(k.cy), static_cast<double>(s.camera_height_m));
  const DepthSource source = s.params.depth;
  const bool normals = source != DepthSource::stereo && source != DepthSource::lidar;
  return std::string("{\n  \"npsim_scene\": 1,\n  \"name\": \"street\",\n  \"generator\": \"") + kGenerator +
         "\",\n  \"image\": \"image.png\",\n" +
         "  \"depth\": {\"file\": \"depth.pfm\", \"encoding\": \"metres\", \"source\": \"" +
         kDepthSourceNames[static_cast<std::size_t>(source)] + "\"},\n  \"camera\": " + camera +
         (source == DepthSource::stereo ? ", \"baseline\": " + number(kStereoBaseline_m) : "") + "},\n" +
         "  \"labels\": {\"file\": \"labels.png\", \"encoding\": \"cityscapes_label_ids\"},\n" +
         "  \"instances\": {\"file\": \"instances.png\", \"encoding\": \"cityscapes_instance_ids\"},\n" +
         (normals ? "  \"normals\": {\"file\": \"normals.pfm\", \"convention\": \"auto\"},\n" : "") +
         (s.params.materials
              ? "  \"albedo\": {\"file\": \"albedo.pfm\"},\n  \"roughness\": {\"file\": \"roughness.pfm\"},\n"
              : "") +
         "  \"lights\": {\"format\": \"segments_ai\", \"json\": \"lights.json\", \"bitmap\": \"lights.png\"},\n" +
         "  \"reflectors\": {\"format\": \"ids\", \"file\": \"reflectors.png\"},\n" +
         "  \"truth\": {\"depth\": \"truth/depth.pfm\", \"background_depth\": \"truth/background_depth.pfm\", " +
         "\"normals\": \"truth/normals.pfm\", \"albedo\": \"albedo.pfm\", \"mesh\": \"truth/street.obj\", " +
         "\"emitters\": \"truth/emitters.json\", \"ground\": {\"camera_height_m\": " + number(s.camera_height_m) +
         ", \"up\": " + vector_json(s.ground_up) + "}}\n}\n";
}

std::string lights_json(const Street& s) {
  std::string t =
      "{\n \"name\": \"v1\",\n \"description\": \"lights of a generated street\",\n \"dataset\": {\n"
      "  \"name\": \"npsim_street\",\n  \"owner\": \"npsim\",\n  \"task_type\": \"segmentation-bitmap\",\n"
      "  \"task_attributes\": {\n   \"format_version\": \"0.1\",\n   \"categories\": [\n";
  for (int i = 1; i < kLightClassCount; ++i) {
    t += std::string("    {\"name\": \"") + info(static_cast<LightClass>(i)).name + "\", \"id\": " + std::to_string(i) +
         ", \"has_instances\": true}" + (i + 1 < kLightClassCount ? ",\n" : "\n");
  }
  t +=
      "   ]\n  },\n  \"labelsets\": [{\"name\": \"ground-truth\", \"is_groundtruth\": true}],\n  \"samples\": [\n   {\n"
      "    \"uuid\": \"00000000-0000-0000-0000-000000000001\",\n    \"name\": \"image.png\",\n"
      "    \"attributes\": {\"image\": {\"url\": \"image.png\"}},\n    \"metadata\": {},\n    \"labels\": {\n"
      "     \"ground-truth\": {\n      \"label_status\": \"LABELED\",\n      \"attributes\": {\n"
      "       \"format_version\": \"0.1\",\n       \"annotations\": [\n";
  for (std::size_t i = 0; i < s.marks.size(); ++i) {
    const LightMark& m = s.marks[i];
    t += "        {\"id\": " + std::to_string(m.id) + ", \"category_id\": " + std::to_string(static_cast<int>(m.cls));
    const bool state = m.cls == LightClass::inferred_object;
    if (m.group != 0 || state) {
      t += ", \"attributes\": {";
      if (m.group != 0) t += "\"group\": " + std::to_string(s.marks[m.group - 1U].id) + (state ? ", " : "");
      if (state) t += std::string("\"state\": \"") + state_name(m.state) + "\"";
      t += "}";
    }
    t += i + 1 < s.marks.size() ? "},\n" : "}\n";
  }
  t += "       ],\n       \"segmentation_bitmap\": {\"url\": \"lights.png\"}\n      }\n     }\n    }\n   }\n  ]\n "
       "}\n}\n";
  return t;
}

std::string emitters_json(const Street& s) {
  std::string t = "{\n \"frame\": \"camera: x right, y down, z forward, metres\",\n \"emitters\": [\n";
  for (std::size_t i = 0; i < s.emitters.size(); ++i) {
    const Emitter& e = s.emitters[i];
    t += "  {\"id\": " + std::to_string(i + 1) + ", \"class\": \"" + info(e.cls).name +
         "\", \"group\": " + std::to_string(e.group) + ", \"group_class\": \"" + info(e.group_cls).name +
         "\", \"mark\": " + std::to_string(e.mark) + ", \"lit_by_day\": " + (e.lit_by_day ? "true" : "false");
    if (e.state != SignalState::unknown) t += std::string(", \"state\": \"") + state_name(e.state) + "\"";
    t += ", \"centre\": " + vector_json(e.centre) + ", \"half_extents\": [" + number(e.half_extents.x) + ", " +
         number(e.half_extents.y) + "], \"closed\": " + (e.closed ? "true" : "false") +
         ", \"area_m2\": " + number(e.area_m2) + ", \"seen_area_m2\": " + number(e.seen_area_m2) +
         ", \"normal\": " + vector_json(e.normal) + ", \"axis\": " + vector_json(e.axis) +
         ", \"up\": " + vector_json(e.up);
    if (e.mounting_height_m > 0) t += ", \"mounting_height_m\": " + number(e.mounting_height_m);
    t += i + 1 < s.emitters.size() ? "},\n" : "}\n";
  }
  return t + " ]\n}\n";
}

std::string mesh_mtl(const Street& s) {
  std::string t;
  for (const MeshMaterial& m : s.materials) {
    t += "newmtl " + m.name + "\nKd " + number(m.albedo.x) + " " + number(m.albedo.y) + " " + number(m.albedo.z) +
         "\nPr " + number(m.roughness) + "\n";
  }
  return t;
}

// Faces in order; a `g` line names the emitter ("e<id>"), or "none".
std::string mesh_obj(const Street& s) {
  std::string t = "# camera frame: x right, y down, z forward, metres\nmtllib street.mtl\n";
  t.reserve(s.vertices.size() * 30U + s.faces.size() * 26U);
  char line[120];
  for (const Vec3f& v : s.vertices) {
    std::snprintf(line, sizeof line, "v %.7g %.7g %.7g\n", static_cast<double>(v.x), static_cast<double>(v.y),
                  static_cast<double>(v.z));
    t += line;
  }
  std::uint32_t material = 0xFFFFFFFFU;
  std::uint32_t emitter = 0xFFFFFFFFU;
  for (std::size_t i = 0; i < s.faces.size(); ++i) {
    if (s.face_emitter[i] != emitter) {
      emitter = s.face_emitter[i];
      t += emitter != 0 ? "g e" + std::to_string(emitter) + "\n" : std::string("g none\n");
    }
    if (s.face_material[i] != material) {
      material = s.face_material[i];
      t += "usemtl " + s.materials[material].name + "\n";
    }
    const Face& f = s.faces[i];
    std::snprintf(line, sizeof line, "f %u %u %u\n", f.a + 1U, f.b + 1U, f.c + 1U);
    t += line;
  }
  return t;
}

io::Image<io::Rgba8> light_bitmap(const Street& s) {
  io::Image<io::Rgba8> out(s.params.shape);
  for (int y = 0; y < out.height(); ++y) {
    for (int x = 0; x < out.width(); ++x) {
      const std::uint16_t index = s.light_index(x, y);
      const std::uint32_t id = index != 0 ? s.marks[index - 1U].id : 0U;
      out(x, y) = {static_cast<std::uint8_t>(id & 255U), static_cast<std::uint8_t>((id >> 8U) & 255U),
                   static_cast<std::uint8_t>((id >> 16U) & 255U), 255};
    }
  }
  return out;
}

io::Image<std::uint8_t> reflector_ids(const Street& s) {
  io::Image<std::uint8_t> out(s.params.shape);
  for (std::size_t i = 0; i < out.shape().pixels(); ++i) {
    out.data()[i] = static_cast<std::uint8_t>(s.reflectors.data()[i]);
  }
  return out;
}

}  // namespace

io::Outcome write_street(const Street& s, const std::string& dir) {
  std::error_code code;
  std::filesystem::create_directories(dir + "/truth", code);
  if (code) return io::Error{dir, "", "the folder cannot be made: " + code.message()};
  const auto at = [&](const char* name) { return dir + "/" + name; };
  const io::Image<std::uint8_t> reflectors = reflector_ids(s);
  const auto write_all = [&]() -> io::Outcome {
    io::Outcome done = io::write_png(at("image.png"), s.image.view());
    if (done) done = io::write_pfm(at("depth.pfm"), s.est_depth.view());
    if (done) done = io::write_pfm(at("normals.pfm"), s.est_normals.view());
    if (done) done = io::write_png(at("labels.png"), s.labels.view());
    if (done) done = io::write_png16(at("instances.png"), s.instances.view());
    if (done) done = io::write_pfm(at("albedo.pfm"), s.albedo.view());
    if (done) done = io::write_pfm(at("roughness.pfm"), s.roughness.view());
    if (done) done = io::write_file(at("lights.json"), lights_json(s));
    if (done)
      done = io::write_png_rgba(at("lights.png"), static_cast<const io::Image<io::Rgba8>&>(light_bitmap(s)).view());
    if (done) done = io::write_png(at("reflectors.png"), reflectors.view());
    if (done) done = io::write_pfm(at("truth/depth.pfm"), s.depth.view());
    if (done) done = io::write_pfm(at("truth/background_depth.pfm"), s.background_depth.view());
    if (done) done = io::write_pfm(at("truth/normals.pfm"), s.normals.view());
    if (done) done = io::write_file(at("truth/street.mtl"), mesh_mtl(s));
    if (done) done = io::write_file(at("truth/street.obj"), mesh_obj(s));
    if (done) done = io::write_file(at("truth/emitters.json"), emitters_json(s));
    if (done) done = io::write_file(at("scene.json"), scene_json(s));
    return done;
  };
  return write_all();
}

}  // namespace street
}  // namespace npsim
