"""Reads illuminance in LuxCore: a job (JSON) in, readings (JSON) on standard output.

    python luxcore_read.py job.json
    python luxcore_read.py --serve

A meter is a small white square, there only while it is read; illuminance is pi times its diffuse light, direct or indirect, seen by a
camera close by. Every luminaire's direct light is read by itself, so that none is drawn by chance and points give it exactly. Sums are
in 64-bit floats, but for a film's. It reads in blocks of samples, a pixel each: see blocks.py.
"""

import concurrent.futures
import itertools
import math
import os
import sys
import time

os.environ["OMP_NUM_THREADS"] = "1"  # LuxCore's idle OpenMP threads would wait for work in loops, on a busy machine for longer than work takes
import numpy as np  # before LuxCore, whose allocator must not meet an import that is half done

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
import blocks

FILM = 1 << 16  # pixels side by side: LuxCore's tiles draw by a pixel's place, whatever `renderengine.seed` says
AHEAD = 1 << 12  # pixels that the blocks of one seed have for themselves
WIDE = 64  # times as wide a patch may be that has space about it: what its corners are rounded by tilts it less
METER_ID = 7  # what the camera must see
POLL_S = 5e-4
lux = None  # the module, once a job is there


def main():
    blocks.main("Reads illuminance in LuxCore.", instrument)


def instrument(job, folder, options):
    global lux
    if lux is None:
        # Here, since it prints a greeting, which must not mix with the answer.
        import pyluxcore

        lux = pyluxcore
        lux.Init()
        lux.SetLogHandler(None)
    os.chdir(folder)  # scenes name their files from there
    return Instrument(job, options.threads)


def properties(text):
    made = lux.Properties()
    made.SetFromString(text)
    return made


class Instrument(blocks.Instrument):
    lanes = 1 << 20

    def __init__(self, job, threads):
        super().__init__(job, {"luxcore": lux.Version()}, "CPU")
        self.settings, self.scene = lux.Properties("render.cfg"), lux.Properties("scene.scn")
        self.luminaires = luminaires(self.scene)
        if len(self.luminaires) != job["emitters"]:
            raise RuntimeError(f"the scene has {len(self.luminaires)} luminaires, the job says {job['emitters']}")
        self.threads = max(1, threads)
        self.benches = [None] * self.threads
        meters, lights = len(job["sensors"]), len(self.luminaires)
        solid = any(not of_luminaire(key) for key in self.scene.GetAllNames("scene.objects."))
        if job["transport"] in ("direct", "total") and lights:
            self.parts["direct"] = self.direct, meters * (lights if job["apart"] else 1)
        if job["transport"] in ("indirect", "total") and lights and solid and job["reflections"]:
            self.parts["indirect"] = self.indirect, meters

    def is_sampled(self, part):
        return bool(self.job["extended"] or not self.job["apart"] or part != "direct")

    def direct(self, m, seeds):
        each = range(len(self.luminaires)) if self.job["apart"] else [None]
        return sum(self.read("DIRECT_DIFFUSE", m, seeds, only) for only in each)

    def indirect(self, m, seeds):
        return self.read("INDIRECT_DIFFUSE", m, seeds, None)

    def read(self, channel, m, seeds, only):
        """Blocks of all meters; a worker each reads every so many of them, in a scene of its own."""
        if seeds == [None]:
            first, count, turned = 0, 1, 0.0
        else:
            first, count, turned = drawn(seeds)
        found = np.zeros((count, len(self.sensors)))

        def work(worker):
            bench = self.benches[worker] = self.benches[worker] or Bench(self.scene, self.settings, self.luminaires)
            bench.light(only)
            for k in range(worker, len(self.sensors), self.threads):
                sensor = self.job["sensors"][k]
                found[:, k] = bench.read(channel, sensor, self.job["patch"], turned, m, first, count)

        with concurrent.futures.ThreadPoolExecutor(self.threads) as pool:
            list(pool.map(work, range(min(self.threads, len(self.sensors)))))
        return found


def drawn(seeds):
    """The pixels of blocks of one stream, whose numbers follow one another, and how far their meters are turned."""
    (seed, stream, start) = map(int, seeds[0])
    if [tuple(map(int, s)) for s in seeds] != [(seed, stream, start + k) for k in range(len(seeds))]:
        raise RuntimeError("the blocks asked for do not follow one another")
    random = np.random.default_rng([seed, stream])
    first = int(random.integers(FILM - AHEAD)) + start
    if start + len(seeds) > AHEAD:
        raise RuntimeError(f"more than {AHEAD} blocks")
    return first, len(seeds), 2 * math.pi * random.random()


def of_luminaire(key):
    """The luminaire that a property of lights or objects belongs to; None for others."""
    name = key.split(".")[2]
    return name if name.startswith("luminaire") else None


def luminaires(scene):
    """The properties of each, by name, in the order of the file."""
    keys = [k for k in scene.GetAllNames() if k.startswith(("scene.lights.", "scene.objects.")) and of_luminaire(k)]
    found = {}
    for key in keys:
        found.setdefault(of_luminaire(key), lux.Properties()).Set(scene.Get(key))
    return found


class Bench:
    """A scene, of which one luminaire or all shine, and a camera that looks at one meter after the other."""

    numbers = itertools.count()  # a mesh once named is kept by its name

    def __init__(self, scene, settings, luminaires):
        self.scene, self.settings, self.luminaires = lux.Scene(), settings, luminaires
        try:
            self.scene.Parse(scene)
        except RuntimeError as error:
            # What is wrong with a file that it reads itself is for the user: no trace.
            raise SystemExit(str(error)) from None
        self.lit = set(luminaires)
        # So far along its normal rays start off a surface.
        clear = "scene.epsilon.min"
        self.clear = settings.Get(clear).GetFloat() if settings.IsDefined(clear) else 0.0

    def light(self, only):
        wanted = set(self.luminaires) if only is None else {list(self.luminaires)[only]}
        for name in self.lit - wanted:
            if any(key.startswith("scene.lights.") for key in self.luminaires[name].GetAllNames()):
                self.scene.DeleteLight(name)
            else:
                self.scene.DeleteObject(name)
        for name in sorted(wanted - self.lit):
            self.scene.Parse(self.luminaires[name])
        self.lit = wanted

    def read(self, channel, sensor, side, turned, m, first, count):
        name = f"meter{next(self.numbers)}"
        self.scene.Parse(properties(meter(name, sensor, side, turned, self.clear)))
        try:
            return math.pi * self.film(channel, m, first, count)
        finally:
            self.scene.DeleteObject(name)
            self.scene.RemoveUnusedMeshes()

    def film(self, channel, m, first, count):
        config = lux.Properties(self.settings)
        config.Set(
            properties(
                f"tilepath.sampling.aa.size = {m}\n"
                f"film.width = {FILM}\nfilm.height = 1\nfilm.subregion = {first} {first + count - 1} 0 0\n"
                f"film.outputs.0.type = {channel}\nfilm.outputs.0.filename = light.exr\n"
                "film.outputs.1.type = OBJECT_ID\nfilm.outputs.1.filename = seen.png\n"
            )
        )
        session = lux.RenderSession(lux.RenderConfig(config, self.scene))
        session.Start()
        while not session.HasDone():
            time.sleep(POLL_S)
        session.Stop()
        film = session.GetFilm()
        seen, light = np.zeros(FILM, np.uint32), np.zeros(3 * FILM, np.float32)
        film.GetOutputUInt(lux.FilmOutputType.OBJECT_ID, seen, 0)
        if (seen[first : first + count] != METER_ID).any():
            raise RuntimeError("the camera does not see the meter")
        film.GetOutputFloat(getattr(lux.FilmOutputType, channel), light, 0)
        return light.reshape(-1, 3)[first : first + count, 0].astype(np.float64)


def meter(name, sensor, side, turned, clear):
    """A white square whose rays start at the meter, or a quarter of a side before a surface beside it, and a camera a side before that."""
    at, normal = (np.array(sensor[key], np.float64) for key in ("position", "normal"))
    aside = np.array([0.0, 1.0, 0.0] if abs(normal[0]) > 0.5 else [1.0, 0.0, 0.0])
    across = np.cross(normal, aside)
    across /= np.linalg.norm(across)
    along = math.cos(turned) * np.cross(across, normal) + math.sin(turned) * across
    across = np.cross(normal, along)
    centre = at + (-clear if sensor["free"] else side / 4) * normal
    half = (WIDE if sensor["wide"] else 1) * side / 2
    corners = [centre + half * (x * along + y * across) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    window = side / 1000
    return (
        f"scene.materials.meter.type = matte\nscene.materials.meter.kd = 1 1 1\n"
        f"scene.objects.{name}.material = meter\n"
        f"scene.objects.{name}.id = {METER_ID}\n"
        f"scene.objects.{name}.vertices = {words(np.concatenate(corners))}\n"
        f"scene.objects.{name}.normals = {words(np.tile(normal, 4))}\n"
        f"scene.objects.{name}.faces = 0 1 2 0 2 3\n"
        "scene.camera.type = orthographic\n"
        f"scene.camera.screenwindow = {words([-window, window, -window, window])}\n"
        "scene.camera.autofocus.enable = 0\n"
        "scene.camera.lensradius = 0\n"
        f"scene.camera.cliphither = {side / 8}\n"
        f"scene.camera.lookat.orig = {words(centre + side * normal)}\n"
        f"scene.camera.lookat.target = {words(centre)}\n"
        f"scene.camera.up = {words(across)}\n"
    )


def words(values):
    return " ".join(repr(float(value)) for value in values)


if __name__ == "__main__":
    sys.exit(main())
