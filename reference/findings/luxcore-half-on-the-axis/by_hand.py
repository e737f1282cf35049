"""LuxCore alone: illuminance of a white square a metre from a point light with an IES file, in parts of what is aside of its axis."""
import math
import os
import tempfile
import time

import numpy as np
import pyluxcore as lux

lux.Init()
lux.SetLogHandler(None)
FOLDER = tempfile.mkdtemp()


def ies(name, gammas, candela):
    path = os.path.join(FOLDER, name)
    rows = [" ".join(map(str, gammas)), "0", " ".join(map(str, candela))]
    with open(path, "w") as file:
        file.write(f"IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 {len(gammas)} 1 1 2 0 0 0\n1 1 0\n" + "\n".join(rows) + "\n")
    return path


def words(vector):
    return " ".join(repr(float(x)) for x in vector)


def read(path, gamma_deg):
    g = math.radians(gamma_deg)
    at = np.array([math.sin(g), 0.0, -math.cos(g)])
    across = np.array([0.0, 1.0, 0.0])
    along, h = np.cross(-at, across), 5e-4
    corners = [at + h * (u * along + v * across) for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    eye = 0.5 * at
    scene, p = lux.Scene(), lux.Properties()
    p.SetFromString(f"""scene.camera.type = orthographic
scene.camera.screenwindow = -1e-5 1e-5 -1e-5 1e-5
scene.camera.autofocus.enable = 0
scene.camera.lookat.orig = {words(eye)}
scene.camera.lookat.target = {words(at)}
scene.camera.up = 0 1 0
scene.lights.lamp.type = mappoint
scene.lights.lamp.iesfile = {path}
scene.lights.lamp.flipz = 1
scene.materials.white.type = matte
scene.materials.white.kd = 1 1 1
scene.objects.square.material = white
scene.objects.square.vertices = {words(np.concatenate(corners))}
scene.objects.square.faces = 0 1 2 0 2 3
""")
    scene.Parse(p)
    c = lux.Properties()
    c.SetFromString("""renderengine.type = PATHCPU
sampler.type = SOBOL
batch.haltspp = 64
film.width = 4
film.height = 4
film.filter.type = NONE
film.imagepipelines.0.0.type = NOP
film.outputs.0.type = RGB
film.outputs.0.filename = a.exr
native.threads.count = 1
""")
    session = lux.RenderSession(lux.RenderConfig(c, scene))
    session.Start()
    while not session.HasDone():
        time.sleep(0.01)
        session.UpdateStats()
    session.Stop()
    out = np.zeros(48, np.float32)
    session.GetFilm().GetOutputFloat(lux.FilmOutputType.RGB, out)
    return math.pi * float(out.reshape(-1, 3)[:, 0].mean())


print("LuxCore", lux.Version())
for what, gammas, candela in (
    ("100 cd from 0 to 180", [0, 90, 180], [100, 100, 100]),
    ("1000 cd from 0 to 180", [0, 90, 180], [1000, 1000, 1000]),
    ("100 cd from 0 to 90", [0, 90], [100, 100]),
):
    table = ies("table.ies", gammas, candela)
    for gamma in (0, 0.1, 0.2, 1, 45, 89, 91, 135, 179.9, 180):
        print(f"{what}, gamma {gamma}: {read(table, gamma):.5f}")
