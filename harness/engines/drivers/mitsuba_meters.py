"""Mitsuba 3 sensor `meters`: points with a normal, one pixel each, for the integrator `ptracer`.

Import this file after `mi.set_variant(...)`. A particle that is reflected somewhere is connected with one meter, chosen at
random: its pixel gets cos / distance^2 of the particle's light, which is the irradiance from there. No particle can meet a
meter, and none is stopped by one. Mitsuba's own `irradiancemeter` does not say how much a direction counts there: `ptracer`
reads fourteen times the light of `path` on one.
"""

import json

import drjit as dr
import mitsuba as mi


class Meters(mi.Sensor):
    """Irradiance at points; nothing but connections of particles reaches it."""

    def __init__(self, props):
        mi.Sensor.__init__(self, props)
        places = json.loads(props["places"])
        self.count = len(places["positions"])
        self.positions, self.normals = memory(places["positions"]), memory(places["normals"])

    def sample_direction(self, it, sample, active=True):
        k = dr.minimum(mi.UInt32(sample.x * self.count), self.count - 1) if is_jit() else min(int(sample.x * self.count), self.count - 1)
        ds = dr.zeros(mi.DirectionSample3f) if is_jit() else mi.DirectionSample3f()
        ds.p, ds.n = mi.Point3f(*fetch(self.positions, k, active)), mi.Normal3f(*fetch(self.normals, k, active))
        ds.uv = mi.Point2f(mi.Float(k) + 0.5, 0.5)
        ds.time, ds.pdf, ds.delta = it.time, 1.0, True
        to_meter = ds.p - it.p
        ds.dist = dr.norm(to_meter)
        ds.d = to_meter / ds.dist
        cosine = dr.maximum(-dr.dot(ds.d, ds.n), 0)
        return ds, mi.Spectrum(cosine / (ds.dist * ds.dist))

    def sample_ray(self, time, wavelength_sample, sample_2, sample_3, active=True):
        raise NotImplementedError("meters: paths start elsewhere")

    def bbox(self):
        return mi.ScalarBoundingBox3f()

    def traverse(self, callback):
        pass

    def to_string(self):
        return "Meters[]"


def sensor(positions, normals):
    """The sensor of meters, rows of x, y and z, and its film of one row of pixels."""
    film = {
        "type": "hdrfilm", "width": len(positions), "height": 1, "rfilter": {"type": "box"},
        "pixel_format": "luminance", "component_format": "float32",
    }
    places = json.dumps({"positions": positions.tolist(), "normals": normals.tolist()})
    return mi.load_dict({"type": "meters", "places": places, "film": film, "sampler": {"type": "independent"}})


def is_jit():
    return not mi.variant().startswith("scalar")


def memory(rows):
    """Columns of numbers that kernels may look up."""
    return [mi.Float([float(v) for v in column]) if is_jit() else [float(v) for v in column] for column in zip(*rows)]


def fetch(columns, k, active):
    return [dr.gather(mi.Float, column, k, active) if is_jit() else column[k] for column in columns]


mi.register_sensor("meters", Meters)
