"""Reads illuminance in Blender Cycles: a job (JSON) in, readings (JSON) on standard output.

    python cycles_read.py job.json
    python cycles_read.py --serve

A meter is a small white patch that no ray but its own meets; illuminance is pi times its baked diffuse light, direct or indirect. Every
luminaire's direct light is baked by itself, so that none is drawn by chance and points give it exactly. Sums are in 64-bit floats.
It reads in blocks of samples: see blocks.py.
"""

import math
import os
import runpy
import sys

import bpy
import numpy as np

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import blocks
import cycles_scene

EXACT_SIDE = 16  # samples along a side of what is not sampled: they differ by where in its patch a meter is alone
UNREADABLE_CD = 100 * cycles_scene.POINT_W / (4 * math.pi)  # what Cycles lights a scene with in place of a file that it cannot read


def main():
    blocks.main("Reads illuminance in Blender Cycles.", instrument)


def instrument(job, folder, options):
    for table in job["tables"]:
        check(os.path.join(folder, table))
    os.chdir(folder)  # that of an earlier job may be gone
    sys.modules.pop("cycles_scene", None)  # the one beside the scene knows where its files are
    runpy.run_path(os.path.join(folder, "scene.py"))
    return Instrument(job, options.threads)


def check(table):
    """Fails where Cycles cannot read a table, in place of which it would silently shine evenly."""
    cycles_scene.start()
    cycles_scene.stock_luminaire("probe", table, 1, np.eye(4).tolist())
    directions = np.array([[0.36, 0.48, -0.8], [-0.48, 0.6, -0.64], [0.6, -0.48, 0.64], [-0.36, -0.8, 0.48]])
    patches = Patches([{"position": d.tolist(), "normal": (-d).tolist(), "free": True} for d in directions], 1e-4, 1)
    if np.allclose(patches.bake({"DIRECT"}, 1, 0), UNREADABLE_CD, rtol=1e-3):
        raise RuntimeError(f"Cycles cannot read {os.path.basename(table)}, and would shine evenly in its place")


class Instrument(blocks.Instrument):
    def __init__(self, job, threads):
        super().__init__(job, {"blender": bpy.app.version_string}, "CPU")
        self.lights = [o for o in bpy.data.objects if o.type == "LIGHT"]
        if len(self.lights) != job["emitters"]:
            raise RuntimeError(f"the scene has {len(self.lights)} lights, the job says {job['emitters']}")
        solid = any(o.type == "MESH" for o in bpy.data.objects)
        self.patches = Patches(job["sensors"], job["patch"], threads)
        self.normals_off = self.patches.normals_off.tolist()
        count, lights = len(job["sensors"]), len(self.lights)
        if job["transport"] in ("direct", "total") and lights:
            read, each = (self.direct, lights) if job["apart"] else (self.of_all({"DIRECT"}), 1)
            self.parts["direct"] = blocks.one_by_one(read), count * each
        if job["transport"] in ("indirect", "total") and lights and solid and job["reflections"]:
            self.parts["indirect"] = blocks.one_by_one(self.of_all({"INDIRECT"})), count

    def is_sampled(self, part):
        return bool(self.job["extended"] or not self.job["apart"] or part != "direct")

    def of_all(self, kind):
        return lambda m, seed: self.patches.bake(kind, *drawn(m, seed))

    def direct(self, m, seed):
        """The light of one luminaire after the other."""
        total = np.zeros(len(self.sensors))
        samples, seed = drawn(m, seed)
        for k, light in enumerate(self.lights):
            for other in self.lights:
                other.hide_render = other is not light
            total += self.patches.bake({"DIRECT"}, samples, seed + k)
        for light in self.lights:
            light.hide_render = False
        return total


def drawn(m, seed):
    """The number of samples, and the seed as Blender takes one."""
    if seed is None:
        return EXACT_SIDE * EXACT_SIDE, 0
    return m * m, int(np.random.default_rng([*map(int, seed)]).integers(2**30))


class Patches:
    """Small white squares at meters, one texel each. Their normals are given, not taken from corners in 32-bit floats."""

    def __init__(self, sensors, side, threads):
        self.count = len(sensors)
        positions = np.array([s["position"] for s in sensors], np.float64).reshape(-1, 3)
        normals = np.array([s["normal"] for s in sensors], np.float64).reshape(-1, 3)
        aside = np.where(np.abs(normals[:, :1]) > 0.5, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
        along = np.cross(aside, normals)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        across = np.cross(normals, along)
        # Half a side before a surface beside the meter.
        clear = np.where(np.array([s["free"] for s in sensors], bool).reshape(-1, 1), 0.0, normals)
        corners = [positions + side / 2 * (clear + x * along + y * across) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        texel = np.arange(self.count)
        uv = [np.stack([(texel + u) / self.count, np.full(self.count, v)], 1) for u, v in ((0, 0), (1, 0), (1, 1), (0, 1))]
        mesh = bpy.data.meshes.new("meters")
        faces = np.arange(4 * self.count).reshape(-1, 4).tolist()
        mesh.from_pydata(np.stack(corners, 1).reshape(-1, 3).tolist(), [], faces)
        mesh.uv_layers.new(name="texels").data.foreach_set("uv", np.stack(uv, 1).astype(np.float32).ravel())
        mesh.shade_smooth()
        self.normals_off = set_normals(mesh, normals)
        material = bpy.data.materials.new("meters")
        material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        white, output, target = (
            tree.nodes.new("ShaderNode" + kind) for kind in ("BsdfDiffuse", "OutputMaterial", "TexImage")
        )
        white.inputs["Color"].default_value = (1, 1, 1, 1)
        tree.links.new(white.outputs["BSDF"], output.inputs["Surface"])
        self.image = target.image = bpy.data.images.new("meters", self.count, 1, float_buffer=True, alpha=False)
        self.image.colorspace_settings.name = "Non-Color"
        tree.nodes.active = target
        mesh.materials.append(material)
        patches = bpy.data.objects.new("meters", mesh)
        bpy.context.scene.collection.objects.link(patches)
        for kind in ("diffuse", "glossy", "transmission", "volume_scatter", "shadow"):
            setattr(patches, f"visible_{kind}", False)
        bpy.ops.object.select_all(action="DESELECT")  # imported bodies come selected, and would be baked, too
        bpy.context.view_layer.objects.active = patches
        patches.select_set(True)
        render = bpy.context.scene.render
        render.threads_mode, render.threads = "FIXED", max(1, threads)

    def bake(self, kind, samples, seed):
        cycles = bpy.context.scene.cycles
        cycles.samples, cycles.seed = samples, seed
        bpy.ops.object.bake(type="DIFFUSE", pass_filter=kind, margin=0, use_clear=True, target="IMAGE_TEXTURES")
        texels = np.empty(4 * self.count, np.float32)
        self.image.pixels.foreach_get(texels)
        return math.pi * texels.reshape(-1, 4)[:, 0].astype(np.float64)


def set_normals(mesh, normals):
    """Gives faces of four corners their normals; how far those that Blender has are from them."""
    own = np.empty(12 * len(normals), np.float32)

    def off():
        mesh.update()
        mesh.corner_normals.foreach_get("vector", own)
        return np.linalg.norm(own.reshape(-1, 4, 3) - normals[:, None], axis=2).max(1)

    shading = mesh.attributes.new("custom_normal", "FLOAT_VECTOR", "CORNER")
    shading.data.foreach_set("vector", np.repeat(normals, 4, 0).astype(np.float32).ravel())
    left = off()
    if left.max(initial=0.0) > 1e-6:  # before 4.5 they are kept in 16 bits
        mesh.attributes.remove(mesh.attributes["custom_normal"])
        mesh.normals_split_custom_set(np.repeat(normals, 4, 0).tolist())
        left = off()
    return left


if __name__ == "__main__":
    sys.exit(main())
