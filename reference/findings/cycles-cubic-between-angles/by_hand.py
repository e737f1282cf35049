"""Cycles alone: illuminance of a white square a metre from a point light with an IES texture, as a part of what an even table gives."""
import math
import os
import tempfile

import bpy
from mathutils import Vector

FOLDER = tempfile.mkdtemp()


def ies(name, gammas, candela):
    path = os.path.join(FOLDER, name)
    rows = [" ".join(map(str, gammas)), "0", " ".join(map(str, candela))]
    with open(path, "w") as file:
        file.write(f"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {len(gammas)} 1 1 2 0 0 0\n1 1 0\n" + "\n".join(rows) + "\n")
    return path


def read(path, gamma_deg, c_deg=0.0):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 4, False, False
    scene.cycles.pixel_filter_type = "BOX"
    lamp = bpy.data.lights.new("lamp", "POINT")
    lamp.energy, lamp.shadow_soft_size, lamp.use_nodes = 1000, 0, True
    tree = lamp.node_tree
    texture = tree.nodes.new("ShaderNodeTexIES")
    texture.mode, texture.filepath = "EXTERNAL", path
    emission = next(n for n in tree.nodes if n.type == "EMISSION")
    tree.links.new(texture.outputs["Fac"], emission.inputs["Strength"])
    scene.collection.objects.link(bpy.data.objects.new("lamp", lamp))
    g = math.radians(gamma_deg)
    c = math.radians(c_deg)
    at = (math.sin(g) * math.cos(c), math.sin(g) * math.sin(c), -math.cos(g)) if 0 < gamma_deg < 180 else (0.0, 0.0, 1.0 if gamma_deg else -1.0)
    normal = [-x for x in at]
    across = (-math.sin(c), math.cos(c), 0.0)
    along = (normal[1] * across[2] - normal[2] * across[1], normal[2] * across[0] - normal[0] * across[2], normal[0] * across[1] - normal[1] * across[0])
    h = 0.0005
    corners = [[at[k] + h * (u * along[k] + v * across[k]) for k in range(3)] for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    mesh = bpy.data.meshes.new("square")
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    white = bpy.data.materials.new("white")
    white.use_nodes = True
    white.node_tree.nodes.clear()
    diffuse, output = white.node_tree.nodes.new("ShaderNodeBsdfDiffuse"), white.node_tree.nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (1, 1, 1, 1)
    white.node_tree.links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
    mesh.materials.append(white)
    scene.collection.objects.link(bpy.data.objects.new("square", mesh))
    camera = bpy.data.cameras.new("camera")
    camera.type, camera.ortho_scale, camera.clip_start = "ORTHO", 1e-4, 1e-4
    seen = bpy.data.objects.new("camera", camera)
    seen.location = [at[k] + 0.1 * normal[k] for k in range(3)]
    seen.rotation_mode = "QUATERNION"
    seen.rotation_quaternion = Vector(at).to_track_quat("-Z", "Y")
    scene.collection.objects.link(seen)
    scene.camera = seen
    scene.render.resolution_x = scene.render.resolution_y = 4
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = os.path.join(FOLDER, "out.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    image.colorspace_settings.name = "Non-Color"
    pixels = list(image.pixels)
    return sum(pixels[0::4]) / (len(pixels) // 4)


even, ramp = ies("even.ies", [0, 180], [100, 100]), ies("ramp.ies", [0, 180], [0, 100])
print("Blender", bpy.app.version_string)
first = read(even, 1)
for gamma, c in ((1, 0), (45, 0), (90, 0), (120, 0), (150, 0), (179.9, 0), (180, 0), (90, 45), (90, 90), (90, 135), (90, 180), (90, 269), (90, 271)):
    x, h = gamma / 180, (270 - c) % 360 / 360
    told = (1 + 0.5 * x * x * (1 - x)) * (1 + 0.5 * h * (1 - h)) / (1 + 0.5 * 0.75 * 0.25)
    print(f"even table, gamma {gamma:5}, C {c:3}: {read(even, gamma, c) / first:.5f} of nadir; 1 is right; by cubics that are dark beyond the ends {told:.5f}")
for gamma in (30, 60, 90, 120):
    x = gamma / 180
    print(f"0 to 100 cd, gamma {gamma}: {100 * read(ramp, gamma) / first:.3f} cd, straight line {100 * x:.3f}, Catmull-Rom {100 * x * x * (3 - 2 * x):.3f}")
