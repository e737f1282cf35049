"""Reads illuminance in Mitsuba 3: a job (JSON) in, readings (JSON) on standard output.

    python mitsuba_read.py job.json
    python mitsuba_read.py --serve

Meters are no part of the scene, so nothing disturbs the light. Direct light is what `Scene.sample_emitter_direction`
gives at a meter, which is exact for point sources. Indirect light is E = pi x the mean radiance that the scene's own
integrator returns along cosine-distributed rays, first directions stratified; `ptracer` sends particles instead. Sums are in 64-bit floats, since a film
adds up in 32. It reads in blocks of samples, of direct light a meter and emitter: see blocks.py.
"""

import os
import sys
import types

import drjit as dr
import mitsuba as mi
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
import blocks

# Read now: jobs may follow whose own folder is another, when this one is gone.
SOURCES = {name: open(os.path.join(HERE, f"{name}.py"), encoding="utf-8").read() for name in ("mitsuba_goniometric", "mitsuba_meters")}

CLEAR = 1e-6  # of coordinates: how far off a meter its shadow rays start
SHADOW_EPSILON = 9e-4  # of distances: how far before an emitter they end, as Mitsuba's own do
FEW_RAYS = 1 << 19  # some .2 s, for which more threads take a quarter more: they wait for kernels without sleeping


def main():
    blocks.main("Reads illuminance in Mitsuba 3.", instrument, more)


def more(parser):
    parser.add_argument("--variant", help="Mitsuba variant to use instead of the job's")


def instrument(job, folder, options):
    mi.set_variant(options.variant or job["variant"])
    if is_jit():
        dr.set_thread_count(options.threads)
        dr.flush_malloc_cache()  # of an earlier job
    plugins("mitsuba_goniometric")
    return Instrument(load(os.path.join(folder, job["scene"])), job, options.threads)


def plugins(name, known={}):
    """The file of plugins of this name, which registers them for the variant that is set; each job may set another."""
    if (name, mi.variant()) not in known:
        module = types.ModuleType(f"{name}_{mi.variant()}")
        exec(compile(SOURCES[name], f"{name}.py", "exec"), module.__dict__)
        known[name, mi.variant()] = module
    return known[name, mi.variant()]


def load(scene):
    """A scene in which luminaires of one kind are not merged into one; older Mitsubas merge nothing, and refuse the option."""
    try:
        return mi.load_file(scene, optimize=False)
    except RuntimeError as error:
        if 'Unused parameter "optimize"' not in str(error):
            raise
        # Loading side by side crashed one process in eight there.
        return mi.load_file(scene, parallel=False)


class Instrument(blocks.Instrument):
    def __init__(self, scene, job, threads):
        self.threads = threads
        # Before a variant is set, older ones tell no version.
        super().__init__(job, {"mitsuba": mi.__version__, "drjit": dr.__version__}, mi.variant())
        meters = Meters(job["sensors"])
        emitters = len(scene.emitters())
        if emitters != job["emitters"]:
            raise RuntimeError(f"the scene has {emitters} emitters, the job says {job['emitters']}")
        if job["film"]:
            of_film = lambda m, seed: film(scene, job["film"], meters.count, seed)
            self.parts[job["transport"]] = blocks.one_by_one(of_film), meters.count
            return
        if job["transport"] in ("direct", "total") and emitters:
            rays = meters.count * emitters
            self.parts["direct"] = blocks.one_by_one(lambda m, seed: direct(scene, meters, emitters, m, seed)), rays
        if job["transport"] in ("indirect", "total") and emitters and scene.shapes():
            reflected = particles if job["integrator"] == "ptracer" else indirect
            self.parts["indirect"] = blocks.one_by_one(lambda m, seed: reflected(scene, meters, m, seed)), meters.count

    def blocks(self, part, m, seeds):
        if is_jit():
            is_short = not self.job["film"] and self.parts[part][1] * m * m * len(seeds) <= FEW_RAYS
            dr.set_thread_count(1 if is_short else self.threads)
        return super().blocks(part, m, seeds)

    def is_sampled(self, part):
        return bool(self.job["film"] or self.job["extended"] or part != "direct")


def film(scene, reading, meters, seed):
    """Illuminance from a rendered film: a tile of pixels a meter, side by side."""
    image = np.array(mi.render(scene, seed=int(generator(seed, 0).integers(2**32))), np.float64)
    tile = reading["tile"]
    if image.shape[:2] != (tile, tile * meters):
        raise RuntimeError(f"the film measures {image.shape}, not {tile} x {tile} pixels for each of {meters} meters")
    return reading["factor"] * image[:, :, 0].reshape(tile, meters, tile).mean((0, 2))


class Meters:
    """Points and unit normals."""

    def __init__(self, sensors):
        self.count = len(sensors)
        self.positions = np.array([s["position"] for s in sensors], np.float64).reshape(-1, 3)
        self.normals = np.array([s["normal"] for s in sensors], np.float64).reshape(-1, 3)
        # A meter that lies on a surface must not see that surface: reflected light's rays start this far in front of it.
        self.offset = 1e-5 * (1 + np.abs(self.positions).max(initial=0))
        side = np.where(np.abs(self.normals[:, :1]) > 0.5, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
        s = np.cross(side, self.normals)
        self.tangents = s / np.linalg.norm(s, axis=1, keepdims=True)
        self.bitangents = np.cross(self.normals, self.tangents)

    def repeated(self, each):
        """Slices of meters, each meter `each` times, that fit in flight."""
        step = max(1, Instrument.lanes // each)
        for first in range(0, self.count, step):
            yield np.repeat(np.arange(first, min(first + step, self.count)), each)


def direct(scene, meters, emitters, m, seed):
    """Light straight from the emitters: for each, m x m stratified samples over its extent."""
    total = np.zeros(meters.count)
    each = emitters * m * m
    for k, rows in enumerate(meters.repeated(each)):
        sample = np.tile(np.arange(each), len(rows) // each)
        if seed is None:
            u = v = np.full(len(rows), 0.5)
        else:
            u, v = strata(sample % (m * m), m, generator(seed, k))
        p, n = meters.positions[rows], meters.normals[rows]
        # The scene picks the emitter by the first number and hands its remainder on.
        d, radiance = sample_emitters(scene, p, n, (sample // (m * m) + u) / emitters, v)
        received = radiance * np.maximum(np.einsum("ij,ij->i", d, n), 0)
        total[rows[::each]] = received.reshape(-1, each).mean(1)
    return total


def sample_emitters(scene, p, n, u, v):
    """Direction and weight of one emitter sample a row, with its shadow ray."""
    if is_jit():
        it = dr.zeros(mi.SurfaceInteraction3f, len(p))
        it.p = mi.Point3f(*columns(p))
        ds, weight = scene.sample_emitter_direction(it, mi.Point2f(floats(u), floats(v)), False)
        hidden = scene.ray_test(shadow_ray(mi.Point3f(*columns(clear(p, n))), ds))
        directions = np.stack([np.array(x, np.float64) for x in (ds.d.x, ds.d.y, ds.d.z)], 1)
        return directions, np.where(np.array(hidden), 0, np.array(weight[0], np.float64))
    directions, weights = np.zeros_like(p), np.zeros(len(p))
    for k, start in enumerate(clear(p, n)):
        it = mi.SurfaceInteraction3f()
        it.p = mi.Point3f(*p[k])
        ds, weight = scene.sample_emitter_direction(it, mi.Point2f(u[k], v[k]), False)
        hidden = scene.ray_test(shadow_ray(mi.Point3f(*start), ds))
        directions[k], weights[k] = ds.d, 0 if hidden else weight[0]
    return directions, weights


def clear(p, n):
    """Where shadow rays start: clear of a surface that a meter lies on, by as much as 32-bit floats take.

    Mitsuba's own start is a hundred times as far off, which moves the edge of a shadow by a millimetre.
    """
    return p + CLEAR * (1 + np.abs(p).max(axis=1, keepdims=True)) * n


def shadow_ray(start, ds):
    """From a meter to just before a point of an emitter."""
    to_light = ds.p - start
    distance = dr.norm(to_light)
    ray = mi.Ray3f(start, to_light / distance)
    ray.maxt = distance * (1 - SHADOW_EPSILON)
    return ray


def indirect(scene, meters, m, seed):
    """Light reflected at least once: m x m paths a meter."""
    total = np.zeros(meters.count)
    each = m * m
    for k, rows in enumerate(meters.repeated(each)):
        random = generator(seed, k)
        u, v = strata(np.tile(np.arange(each), len(rows) // each), m, random)
        radius, phi = np.sqrt(u)[:, None], (2 * np.pi * v)[:, None]
        n = meters.normals[rows]
        d = radius * np.cos(phi) * meters.tangents[rows] + radius * np.sin(phi) * meters.bitangents[rows]
        d += np.sqrt(1 - radius**2) * n
        radiance = trace(scene, meters.positions[rows] + meters.offset * n, d, int(random.integers(2**32)))
        total[rows[::each]] = np.pi * radiance.reshape(-1, each).mean(1)
    return total


def particles(scene, meters, m, seed):
    """Light reflected at least once: m x m particles a meter from the emitters, connected with a meter at each reflection."""
    sensor = plugins("mitsuba_meters").sensor(meters.positions + meters.offset * meters.normals, meters.normals)
    random = generator(seed, 0)
    total, left = np.zeros(meters.count), m * m
    while left > 0:
        count = min(left, max(1, Instrument.lanes // meters.count))
        number = int(random.integers(2**32))
        image = mi.render(scene, sensor=sensor, integrator=scene.integrator(), spp=count, seed=number)
        total += count * np.array(image, np.float64).reshape(-1)
        left -= count
    return total / (m * m)


def trace(scene, p, d, seed):
    """Radiance that the scene's integrator finds along rays; the emitters have no body to be seen at first hand."""
    sampler = mi.load_dict({"type": "independent"})
    integrator = scene.integrator()
    if is_jit():
        try:
            sampler.seed(mi.UInt32(seed), len(p))
        except TypeError:  # Mitsuba before 3.6 takes plain numbers alone.
            sampler.seed(seed, len(p))
        ray = mi.RayDifferential3f(mi.Point3f(*columns(p)), mi.Vector3f(*columns(d)))
        # By its name: where its module is has changed over the releases.
        if type(integrator).__name__ == "PRBIntegrator":
            radiance = integrator.sample(dr.ADMode.Primal, scene, sampler, ray, None, None, mi.Bool(True))[0]
        else:
            radiance = integrator.sample(scene, sampler, ray)[0]
        return np.array(radiance[0], np.float64)
    sampler.seed(seed, 1)
    found = np.zeros(len(p))
    for k in range(len(p)):
        ray = mi.RayDifferential3f(mi.Point3f(*p[k]), mi.Vector3f(*d[k]))
        found[k] = integrator.sample(scene, sampler, ray)[0][0]
    return found


def strata(cell, m, random):
    """A random point in each cell of an m x m grid over the unit square."""
    jitter = random.random((2, len(cell)))
    return (cell % m + jitter[0]) / m, (cell // m + jitter[1]) / m


def generator(seed, k):
    return np.random.default_rng([*map(int, seed), k])


def columns(rows):
    return [floats(rows[:, k]) for k in range(3)]


def floats(values):
    return mi.Float(np.ascontiguousarray(values, np.float32))


def is_jit():
    return not mi.variant().startswith("scalar")


if __name__ == "__main__":
    sys.exit(main())
