# SPDX-License-Identifier: Apache-2.0
"""Light transport beside Blender's Cycles: seconds against error, on the exported mesh, albedo and lamps of one night.

  npsim night SCENE -o NIGHT --seed 1 --size 480x270 --texture albedo
  blender -b --factory-startup --python tests/developer/cycles.py -- SCENE NIGHT [REFERENCE [SAMPLES...]]

Cycles lights the same lamps: lit surfaces as rectangles, beams as spots, all others as small surfaces of the same flux
that shine by the cosine. So its night differs a little from ours, and each renderer is held against its own reference
(REFERENCE samples a pixel, 2048): root of the mean of ((L - R) / R)^2 where R is above .005 cd/m2, without the largest
.1 %, as in metrics/luminance_errors.hpp. Two bounces, one thread but for the reference, neither clamping nor denoiser nor adaptive sampling.
Seconds are those of a render less those of a render with one sample, which builds the scene.
"""
import json
import math
import os
import sys
import tempfile
import time

import bpy
import mathutils
import numpy

if not hasattr(numpy, "bool"):  # Blender 3.4's glTF importer wants it, numpy 1.24 beside it in Debian 12 has it no more
    numpy.bool = bool

given = sys.argv[sys.argv.index("--") + 1:]
scene_folder, night_folder = given[:2]
reference_samples = int(given[2]) if len(given) > 2 else 2048
sample_counts = [int(n) for n in given[3:]] or [4, 16, 64, 256]
night = json.load(open(os.path.join(night_folder, "night_000.json")))
width, height = night["size"]


def to_blender(v):  # x right, y down, z forward -> x right, y forward, z up
    return mathutils.Vector((v[0], v[2], -v[1]))


def rgb_of(xy):  # of luminance 1
    x, y = xy
    big_x, big_z = x / y, (1 - x - y) / y
    rgb = [3.2406 * big_x - 1.5372 - 0.4986 * big_z, -0.9689 * big_x + 1.8758 + 0.0415 * big_z,
           0.0557 * big_x - 0.2040 + 1.0570 * big_z]
    rgb = [max(c, 0.0) for c in rgb]
    luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]
    return [c / luminance for c in rgb]


def add_lamp(source):
    peak = source["peak_intensity_cd"]
    profile = source["profile"]
    axis = to_blender(source["axis"]).normalized()
    sides = [to_blender(s) for s in source["half_sides_m"]]
    if "beam" in profile:
        light = bpy.data.lights.new("beam", "SPOT")
        light.spot_size, light.spot_blend = math.radians(30), 1.0
        light.energy = 4 * math.pi * peak
        light.shadow_soft_size = 0.05
    else:
        light = bpy.data.lights.new("lamp", "AREA")
        light.shape = "RECTANGLE"
        light.size, light.size_y = (max(2 * s.length, 0.02) for s in sides)
        flux = source["strength"] if source["unit"] == "lm" else peak * math.pi * (0.4 if profile == "signal" else 1)
        light.energy = flux * 4 / math.pi  # its radiance is energy / (4 area)
    light.color = rgb_of(source["xy"])
    lamp = bpy.data.objects.new(light.name, light)
    across = sides[0] - axis * sides[0].dot(axis)
    across = across.normalized() if across.length > 1e-6 else axis.orthogonal().normalized()
    rotation = mathutils.Matrix((across, (-axis).cross(across), -axis)).transposed()
    # Clear of the lamp's own glass, which is part of the mesh.
    place = to_blender(source["position_m"]) + axis * (0.05 if profile == "lambert" else 0.4)
    lamp.matrix_world = mathutils.Matrix.Translation(place) @ rotation.to_4x4()
    bpy.context.scene.collection.objects.link(lamp)


bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=os.path.join(night_folder, "mesh.glb"))
for material in bpy.data.materials:  # what shines in the export is lit by its lamp here
    for node in material.node_tree.nodes if material.use_nodes else []:
        if node.type == "BSDF_PRINCIPLED":
            node.inputs["Emission Strength"].default_value = 0
            node.inputs["Specular"].default_value = 0
lit = [s for s in night["sources"] if s["lit"]]
for s in lit:
    add_lamp(s)
intrinsics = json.load(open(os.path.join(scene_folder, "scene.json")))["camera"]
camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
camera.data.angle = 2 * math.atan(intrinsics["cx"] / intrinsics["fx"])
camera.data.clip_end = 1e4
camera.matrix_world = mathutils.Matrix.Rotation(math.pi / 2, 4, "X")
scene = bpy.context.scene
scene.collection.objects.link(camera)
scene.camera = camera
scene.world = bpy.data.worlds.new("sky")
scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs[0].default_value = (0.02, 0.02, 0.02, 1)
scene.render.engine = "CYCLES"
scene.render.resolution_x, scene.render.resolution_y = width, height
scene.render.threads_mode = "FIXED"
scene.render.image_settings.file_format = "OPEN_EXR"
scene.render.image_settings.color_depth = "32"
scene.view_settings.view_transform = "Raw"
cycles = scene.cycles
cycles.device = "CPU"
cycles.use_denoising = cycles.use_adaptive_sampling = False
cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = 2
cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0


def render(samples, seed, threads=1):
    cycles.samples, cycles.seed = samples, seed
    scene.render.threads = threads
    scene.render.filepath = os.path.join(tempfile.gettempdir(), "npsim_cycles.exr")
    start = time.time()
    bpy.ops.render.render(write_still=True)
    seconds = time.time() - start
    image = bpy.data.images.load(scene.render.filepath)
    pixels = numpy.array(image.pixels[:]).reshape(height, width, 4)[::-1, :, :3]
    bpy.data.images.remove(image)
    return pixels @ numpy.array([0.2126, 0.7152, 0.0722]), seconds


def error_of(picture, reference):
    seen = reference > 0.005
    squares = numpy.sort((picture[seen] / reference[seen] - 1) ** 2)
    return math.sqrt(squares[: len(squares) - len(squares) // 1000].mean())


_, build = render(1, 0)
reference, _ = render(reference_samples, 1, os.cpu_count())
with open(os.path.join(night_folder, "night_000.pfm"), "rb") as f:
    f.readline(), f.readline(), f.readline()
    ours = numpy.frombuffer(f.read(), "<f4").reshape(height, width, 3)[::-1] @ numpy.array([0.2126, 0.7152, 0.0722])
both = (ours > 0.005) & (reference > 0.005)
print(f"{len(lit)} lamps; Cycles over NPSim, median of log2 {numpy.median(numpy.log2(reference[both] / ours[both])):.2f}, "
      f"of its size {numpy.median(numpy.abs(numpy.log2(reference[both] / ours[both]))):.2f}")
print("samples,seconds,error")
for n in sample_counts:
    picture, seconds = render(n, 2)
    print(f"{n},{seconds - build:.2f},{error_of(picture, reference):.4f}")
