"""Says which Mitsuba 3 there is and proves that a variant works, by tracing paths in a small box.

    python mitsuba_probe.py llvm_ad_mono,llvm_ad_rgb

A libLLVM that is too old kills the process here and not in the middle of a measurement.
"""

import json
import sys

import drjit as dr
import mitsuba as mi


def llvm_version():
    """Numbers, or a text that holds them; Dr.Jit 0.4 tells nothing."""
    told = getattr(dr.detail, "llvm_version", lambda: "of an unknown version")()
    return told if isinstance(told, str) else ".".join(map(str, told))


# The first of these that there is: before 3.6 the wheels have no mono.
mi.set_variant(*sys.argv[1].split(","))
# An isotropic source of 100 cd at the centre of a grey box.
scene = mi.load_dict({
    "type": "scene",
    "integrator": {"type": "path"},
    "lamp": {"type": "point", "position": [0, 0, 0], "intensity": 100.0},
    "box": {"type": "cube", "flip_normals": True, "bsdf": {"type": "diffuse", "reflectance": 0.5}},
})
count = 64
sampler = mi.load_dict({"type": "independent"})
if mi.variant().startswith("scalar"):
    sampler.seed(0, 1)
    ray = mi.RayDifferential3f(mi.Point3f(0.1), mi.Vector3f(0, 0, 1))
    radiance = scene.integrator().sample(scene, sampler, ray)[0][0]
    llvm = None
else:
    sampler.seed(0, count)
    ray = mi.RayDifferential3f(mi.Point3f(0.1), mi.warp.square_to_uniform_sphere(sampler.next_2d()))
    radiance = min(scene.integrator().sample(scene, sampler, ray)[0][0])
    llvm = llvm_version() if mi.variant().startswith("llvm") else None
if not radiance > 0:
    sys.exit(f"{mi.variant()} finds radiance {radiance} in a lit box")
print(json.dumps({"mitsuba": mi.__version__, "drjit": dr.__version__, "llvm": llvm, "variant": mi.variant()}))
