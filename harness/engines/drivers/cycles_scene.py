"""Rooms, bodies and luminaires for Blender 4.5 with Cycles, in metres, candela and lux, z up; scene.py builds its scene of them.

Illuminance is pi times the diffuse light of a white surface. Cycles divides the candela of an IES file by 177.83 lm/W and multiplies
them with 4 pi; the power of a light undoes that.
"""

import math
import os

import bpy
from mathutils import Matrix

HERE = os.path.dirname(os.path.abspath(__file__))
POINT_W = 4 * math.pi / 0.0706650768394  # of a point light whose IES texture then gives candela
AREA_W = POINT_W / 4  # of an area light, whose texture then gives candela once divided by the cosine


def start():
    """An empty scene, dark all round, that Cycles renders."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.engine = "CYCLES"


def accurate(reflections, light_tree, roulette_from):
    """No short cut that costs light: no clamping, no skipped lights, nothing adaptive, so many reflections; a tree to pick among several lights,
    and Russian roulette after so many reflections."""
    cycles = bpy.context.scene.cycles
    cycles.max_bounces = cycles.diffuse_bounces = reflections
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.light_sampling_threshold = 0
    cycles.use_light_tree = light_tree
    cycles.min_light_bounces = roulette_from
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.sampling_pattern = "TABULATED_SOBOL"


def surface(name, reflectance, vertices, faces):
    """A grey diffuse reflector."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], faces)
    mesh.materials.append(diffuse(name, reflectance))
    return linked(name, mesh)


def cuboid(name, reflectance, low, high):
    corners = [(x, y, z) for z in (low[2], high[2]) for y in (low[1], high[1]) for x in (low[0], high[0])]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return surface(name, reflectance, corners, faces)


def body(name, reflectance, obj_file):
    """A mesh from an OBJ file, in its own axes."""
    before = set(bpy.data.objects)
    bpy.ops.wm.obj_import(filepath=os.path.join(HERE, obj_file), forward_axis="Y", up_axis="Z")
    for found in set(bpy.data.objects) - before:
        found.name = name
        found.data.materials.clear()
        found.data.materials.append(diffuse(name, reflectance))
        found.data.shade_flat()


def diffuse(name, reflectance):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    reflector, output = (tree.nodes.new(kind) for kind in ("ShaderNodeBsdfDiffuse", "ShaderNodeOutputMaterial"))
    reflector.inputs["Color"].default_value = (reflectance, reflectance, reflectance, 1)
    reflector.inputs["Roughness"].default_value = 0
    tree.links.new(reflector.outputs["BSDF"], output.inputs["Surface"])
    return material


def point_luminaire(name, table, scale, placed):
    """A point light with an IES texture whose planes are those of the file; `placed` is its matrix, C 0 along x, nadir along -z."""
    light = point_light(name, POINT_W * scale, placed)
    tree, emission, texture = ies_nodes(light, table)
    normal = tree.nodes.new("ShaderNodeTexCoord").outputs["Normal"]
    tree.links.new(file_planes(tree, normal, upwards=False), texture.inputs["Vector"])
    tree.links.new(texture.outputs["Fac"], emission.inputs["Strength"])


def stock_luminaire(name, table, scale, placed):
    """The same as Blender's manual has it: the texture's planes are what Cycles takes them for."""
    light = point_light(name, POINT_W * scale, placed)
    tree, emission, texture = ies_nodes(light, table)
    tree.links.new(texture.outputs["Fac"], emission.inputs["Strength"])


def area_luminaire(name, table, scale, placed, shape, size, upwards):
    """One side of a flat opening: an area light of the luminance that the texture's intensities have at every point of it."""
    light = bpy.data.lights.new(name, "AREA")
    light.energy = AREA_W * scale
    light.shape, light.size, light.size_y = shape, *size
    turned = Matrix.Diagonal((1, -1, -1, 1)) if upwards else Matrix.Identity(4)
    linked(name, light).matrix_world = Matrix(placed) @ turned
    tree, emission, texture = ies_nodes(light, table)
    geometry, to_object, cosine, luminance = (
        tree.nodes.new("ShaderNode" + kind) for kind in ("NewGeometry", "VectorTransform", "VectorMath", "Math")
    )
    to_object.vector_type, to_object.convert_from, to_object.convert_to = "VECTOR", "WORLD", "OBJECT"
    cosine.operation, luminance.operation = "DOT_PRODUCT", "DIVIDE"
    incoming = geometry.outputs["Incoming"]
    tree.links.new(incoming, to_object.inputs["Vector"])
    tree.links.new(file_planes(tree, to_object.outputs["Vector"], upwards), texture.inputs["Vector"])
    tree.links.new(incoming, cosine.inputs[0])
    tree.links.new(geometry.outputs["Normal"], cosine.inputs[1])
    tree.links.new(texture.outputs["Fac"], luminance.inputs[0])
    tree.links.new(cosine.outputs["Value"], luminance.inputs[1])
    tree.links.new(luminance.outputs["Value"], emission.inputs["Strength"])


SEAM_DEG = 0.03  # the files' planes are turned so far: Cycles is dark in the plane where its table begins and ends


def file_planes(tree, direction, upwards):
    """Directions for which Cycles looks up the file's own planes: it takes 270 degrees less the azimuth for C."""
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Scale"].default_value = (1, 1, -1) if upwards else (1, -1, 1)
    mapping.inputs["Rotation"].default_value = (0, 0, -math.radians(90 + SEAM_DEG))
    tree.links.new(direction, mapping.inputs["Vector"])
    return mapping.outputs["Vector"]


def point_light(name, power, placed):
    light = bpy.data.lights.new(name, "POINT")
    light.energy, light.shadow_soft_size, light.use_soft_falloff = power, 0, False
    linked(name, light).matrix_world = Matrix(placed)
    return light


def ies_nodes(light, table):
    light.use_nodes = True
    tree = light.node_tree
    tree.nodes.clear()
    texture, emission, output = (
        tree.nodes.new("ShaderNode" + kind) for kind in ("TexIES", "Emission", "OutputLight")
    )
    texture.mode, texture.filepath = "EXTERNAL", os.path.join(HERE, table)
    tree.links.new(emission.outputs["Emission"], output.inputs["Surface"])
    return tree, emission, texture


def linked(name, data):
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    return made
