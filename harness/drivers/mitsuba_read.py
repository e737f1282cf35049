"""Reads illuminance in Mitsuba 3: a job (JSON) in, readings (JSON) on standard output.

    python mitsuba_read.py job.json

Meters are no part of the scene, so nothing disturbs the light. Direct light is what `Scene.sample_emitter_direction`
gives at a meter, which is exact for point sources. Indirect light is E = pi x the mean radiance that the scene's own
integrator returns along cosine-distributed rays, first directions stratified. Sums are in 64-bit floats, since a film
adds up in 32. Every block of samples has a seed of its own; the standard error is that of the mean of the blocks.
"""

import argparse
import json
import math
import os
import sys
import time

START = time.monotonic()

import drjit as dr
import mitsuba as mi
import numpy as np

LEAST_BLOCKS = 8  # for a standard error
GOOD_BLOCKS = 32  # for one that is itself good to 13 %
LANES = 1 << 17  # rays in flight
LEAST_SIDE = 64  # strata a side of a block, so that blocks are many strata and their errors near normal
PLAN_MARGIN = 2.0  # the spread of two blocks is a rough guess of the error of one


def main():
    options = arguments()
    # Mitsuba's log must not mix with the answer.
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    with open(options.job, encoding="utf-8") as file:
        job = json.load(file)
    mi.set_variant(options.variant or job["variant"])
    if is_jit():
        dr.set_thread_count(options.threads)
    import mitsuba_goniometric  # registers the emitters, for the variant just set

    folder = os.path.dirname(os.path.abspath(options.job))
    # Without optimize=False two luminaires of one kind may be merged into one.
    scene = mi.load_file(os.path.join(folder, job["scene"]), optimize=False)
    json.dump(measure(scene, job), answer, allow_nan=False)
    answer.close()


def arguments():
    parser = argparse.ArgumentParser(description="Reads illuminance in Mitsuba 3.")
    parser.add_argument("job", help="the job, a JSON file beside its scene")
    parser.add_argument("--threads", type=int, default=os.cpu_count(), help="worker threads; no result depends on them")
    parser.add_argument("--variant", help="Mitsuba variant to use instead of the job's")
    return parser.parse_args()


def measure(scene, job):
    """All readings of a job."""
    meters = Meters(job["stations"])
    report = Report(job)
    emitters = list(scene.emitters())
    if len(emitters) != job["emitters"]:
        raise RuntimeError(f"the scene has {len(emitters)} emitters, the job says {job['emitters']}")
    if job["film"]:
        block = lambda m, seed: film(scene, job["film"], meters.count, seed)
        return report.with_readings(*report.blocks(job["transport"], block, meters.count))
    dark = np.zeros(meters.count), np.zeros(meters.count)
    parts = []
    if job["transport"] in ("direct", "total") and emitters:
        block = lambda m, seed: direct(scene, meters, len(emitters), m, seed)
        if not job["extended"]:
            parts.append((block(1, None), dark[1]))
        else:
            parts.append(report.blocks("direct", block, meters.count * len(emitters)))
    if job["transport"] in ("indirect", "total") and emitters and scene.shapes():
        block = lambda m, seed: indirect(scene, meters, m, seed)
        parts.append(report.blocks("indirect", block, meters.count))
    values = sum((value for value, _ in parts), dark[0])
    errors = np.sqrt(sum((error**2 for _, error in parts), dark[1]))
    return report.with_readings(values, errors)


def film(scene, reading, meters, seed):
    """Illuminance from a rendered film: a tile of pixels a meter, side by side."""
    image = np.array(mi.render(scene, seed=int(generator(seed, 0).integers(2**32))), np.float64)
    tile = reading["tile"]
    if image.shape[:2] != (tile, tile * meters):
        raise RuntimeError(f"the film measures {image.shape}, not {tile} x {tile} pixels for each of {meters} meters")
    return reading["factor"] * image[:, :, 0].reshape(tile, meters, tile).mean((0, 2))


class Meters:
    """Points and unit normals."""

    def __init__(self, stations):
        self.count = len(stations)
        self.positions = np.array([s["position"] for s in stations], np.float64).reshape(-1, 3)
        self.normals = np.array([s["normal"] for s in stations], np.float64).reshape(-1, 3)
        # A meter that lies on a surface must not see that surface: rays start this far in front of it.
        self.offset = 1e-5 * (1 + np.abs(self.positions).max(initial=0))
        side = np.where(np.abs(self.normals[:, :1]) > 0.5, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
        s = np.cross(side, self.normals)
        self.tangents = s / np.linalg.norm(s, axis=1, keepdims=True)
        self.bitangents = np.cross(self.normals, self.tangents)

    def repeated(self, each):
        """Slices of meters, each meter `each` times, that fit in flight."""
        step = max(1, LANES // each)
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
        it.p, it.n = mi.Point3f(*columns(p)), mi.Normal3f(*columns(n))
        ds, weight = scene.sample_emitter_direction(it, mi.Point2f(floats(u), floats(v)), True)
        return np.array(ds.d, np.float64).T, np.array(weight[0], np.float64)
    directions, weights = np.zeros_like(p), np.zeros(len(p))
    for k in range(len(p)):
        it = mi.SurfaceInteraction3f()
        it.p, it.n = mi.Point3f(*p[k]), mi.Normal3f(*n[k])
        ds, weight = scene.sample_emitter_direction(it, mi.Point2f(u[k], v[k]), True)
        directions[k], weights[k] = ds.d, weight[0]
    return directions, weights


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


def trace(scene, p, d, seed):
    """Radiance that the scene's integrator finds along rays; the emitters have no body to be seen at first hand."""
    sampler = mi.load_dict({"type": "independent"})
    integrator = scene.integrator()
    if is_jit():
        sampler.seed(mi.UInt32(seed), len(p))
        ray = mi.RayDifferential3f(mi.Point3f(*columns(p)), mi.Vector3f(*columns(d)))
        radiance, _, _ = integrator.sample(scene, sampler, ray)
        return np.array(radiance[0], np.float64)
    sampler.seed(seed, 1)
    found = np.zeros(len(p))
    for k in range(len(p)):
        ray = mi.RayDifferential3f(mi.Point3f(*p[k]), mi.Vector3f(*d[k]))
        found[k] = integrator.sample(scene, sampler, ray)[0][0]
    return found


class Report:
    """What is written down of a measurement."""

    def __init__(self, job):
        self.job = job
        self.settings = {"seed": str(job["seed"])}
        self.notes = []

    def blocks(self, name, block, rays):
        """Mean and standard error of independent blocks, as many as the job's budget asks for.

        `block(m, seed)` estimates every meter from m x m samples for each of `rays` (meter, emitter) pairs.
        """
        m = self.block_side(block, rays)
        fixed, target = self.job["fixed_blocks"], self.job["relative_error"]
        means, slowest = [], 0.0
        while True:
            count = len(means)
            if count >= LEAST_BLOCKS:
                mean, error = mean_and_error(means)
                worst = np.max(np.divide(error, mean, out=np.zeros_like(mean), where=mean > 0), initial=0)
                if (fixed and count >= fixed) or (not fixed and count >= GOOD_BLOCKS and worst <= target):
                    break
                if time.monotonic() - START + 1.1 * slowest > self.job["seconds"]:
                    if worst > target:
                        self.notes.append(f"{name}: out of time at a relative standard error of {worst:.2g}")
                    break
            began = time.monotonic()
            means.append(block(m, (self.job["seed"], name == "direct", count)))
            slowest = max(slowest, time.monotonic() - began)
        self.settings[f"{name}_blocks"] = str(count)
        self.settings[f"{name}_samples_a_meter_and_block"] = str(m * m * rays // len(mean))
        return mean, error

    def block_side(self, block, rays):
        """m such that a block fills the rays in flight at most, and enough blocks about reach the error and fit in the time."""
        if self.job["fixed_samples"]:
            return max(1, math.isqrt(self.job["fixed_samples"]))
        full = min(256, max(2, math.isqrt(LANES // rays)))
        trial = full if is_jit() else 2
        trials = []
        for seed in (0, 1):  # the first one compiles kernels
            began = time.monotonic()
            trials.append(block(trial, (self.job["seed"], 2, seed)))
        ray_s = (time.monotonic() - began) / (trial**2 * rays)
        left_s = self.job["seconds"] - (time.monotonic() - START)
        affordable = max(left_s, 0) / GOOD_BLOCKS / ray_s / rays
        mean, error = mean_and_error(trials)
        worst = np.max(np.divide(error, mean, out=np.zeros_like(mean), where=mean > 0), initial=0)
        # `error` is that of the mean of two; m x m samples are at least as good as m x m independent ones.
        needed = trial * PLAN_MARGIN * worst / self.job["relative_error"] * math.sqrt(2 / GOOD_BLOCKS)
        return max(2, min(full, math.ceil(max(needed, LEAST_SIDE)), math.isqrt(int(affordable))))

    def with_readings(self, values, errors):
        rows = list(zip((s["id"] for s in self.job["stations"]), values.tolist(), errors.tolist()))
        bad = [name for name, value, error in rows if not math.isfinite(value + error)]
        if bad:
            raise RuntimeError(f"illuminance is not finite at {', '.join(bad)}")
        readings = [{"id": name, "value": value, "std_error": error} for name, value, error in rows]
        versions = {"mitsuba": mi.__version__, "drjit": dr.__version__}
        settings = {"variant": mi.variant(), **self.settings}
        return {"versions": versions, "readings": readings, "settings": settings, "notes": self.notes}


def mean_and_error(blocks):
    blocks = np.array(blocks)
    return blocks.mean(0), blocks.std(0, ddof=1) / math.sqrt(len(blocks))


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
