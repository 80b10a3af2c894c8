# SPDX-License-Identifier: Apache-2.0
"""Opens exported meshes in Blender, counts what arrives, and renders one picture of each.

  blender -b --factory-startup --python tests/developer/check_blender.py -- FOLDER PICTURES [SAMPLES]

FOLDER holds what `npsim night` wrote: mesh.glb, mesh.obj, mesh.ply and the same of the background. Fails where a file
gives no mesh, or the three formats of one mesh do not agree in their triangles. PICTURES gets one PNG per file, seen by
the photograph's camera; emitters shine.
"""
import math
import os
import sys

import bpy
import mathutils
import numpy

if not hasattr(numpy, "bool"):  # Blender 3.4's glTF importer wants it, numpy 1.24 beside it in Debian 12 has it no more
    numpy.bool = bool

folder, pictures = sys.argv[sys.argv.index("--") + 1:][:2]
samples = int((sys.argv[sys.argv.index("--") + 1:] + ["8"])[2])
os.makedirs(pictures, exist_ok=True)

OPEN = {
    ".glb": lambda path: bpy.ops.import_scene.gltf(filepath=path),
    ".obj": lambda path: bpy.ops.wm.obj_import(filepath=path),  # y up, looking along -z: Blender's own default
    ".ply": lambda path: bpy.ops.import_mesh.ply(filepath=path),
}


def open_file(path):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    extension = os.path.splitext(path)[1]
    OPEN[extension](path)
    meshes = [o for o in bpy.context.scene.objects if o.type == "MESH"]
    if extension == ".ply":  # has no convention of its own, and Blender takes none on
        for o in meshes:
            o.rotation_euler = (math.pi / 2, 0, 0)
            material = bpy.data.materials.new("colours")
            material.use_nodes = True
            nodes = material.node_tree.nodes
            attribute = nodes.new("ShaderNodeVertexColor")
            attribute.layer_name = o.data.color_attributes[0].name if o.data.color_attributes else ""
            material.node_tree.links.new(attribute.outputs["Color"], nodes["Principled BSDF"].inputs["Base Color"])
            o.data.materials.append(material)
    return meshes


def render(path):
    scene = bpy.context.scene
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.angle = math.radians(75)
    camera.data.clip_end = 1e5
    camera.matrix_world = mathutils.Matrix.Rotation(math.pi / 2, 4, "X")  # looks along +y, Blender's forward
    scene.collection.objects.link(camera)
    scene.camera = camera
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (0.6, 0.7, 0.9, 1)
    scene.world = world
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples
    scene.cycles.use_denoising = False  # not in every build
    scene.cycles.max_bounces = 2
    scene.render.resolution_x, scene.render.resolution_y = 640, 360
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)


failed = False
for stem in ("mesh", "background"):
    triangles = {}
    for extension in OPEN:
        path = os.path.join(folder, stem + extension)
        if not os.path.exists(path):
            continue
        meshes = open_file(path)
        vertices = sum(len(o.data.vertices) for o in meshes)
        triangles[extension] = sum(len(p.vertices) - 2 for o in meshes for p in o.data.polygons)
        materials = {slot.material.name for o in meshes for slot in o.material_slots if slot.material}
        print(f"{path}: {len(meshes)} objects, {vertices} vertices, {triangles[extension]} triangles, "
              f"{len(materials)} materials, {len([i for i in bpy.data.images if i.size[0] > 0])} images")
        low = [min((o.matrix_world @ mathutils.Vector(c))[k] for o in meshes for c in o.bound_box) for k in range(3)]
        high = [max((o.matrix_world @ mathutils.Vector(c))[k] for o in meshes for c in o.bound_box) for k in range(3)]
        print("  from", [round(c, 2) for c in low], "to", [round(c, 2) for c in high])
        render(os.path.join(os.path.abspath(pictures), stem + extension.replace(".", "_") + ".png"))
    if len(set(triangles.values())) > 1 or not all(triangles.values()):
        print(f"{stem}: the formats do not agree: {triangles}")
        failed = True
sys.exit(1 if failed else 0)
