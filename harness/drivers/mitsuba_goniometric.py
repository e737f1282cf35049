"""Mitsuba 3 emitter `goniometric`: a point source with a tabulated luminous intensity distribution.

Import it after `mi.set_variant(...)`, then use it in a scene:

    <emitter type="goniometric">
        <string name="table" value="luminaire.json"/>   c_deg, gamma_deg, candela[c][gamma]
        <float name="scale" value="1"/>                 dimming
        <transform name="to_world"> ... </transform>    rotation and position; C 0 is +x, gamma 0 is -z
    </emitter>

Intensity is bilinear in (C, gamma) in degrees, the definition of IES LM-63 Type C tables; outside the table's gamma
range it is zero. With intensity in candela and lengths in metres, a Lambertian receiver's irradiance is in lux.
"""

import json

import drjit as dr
import mitsuba as mi
import numpy as np

# A direction in 32-bit floats is known to about this angle; a table's last angle counts as inside within it.
EDGE_DEG = 5e-5


class Axis:
    """Rising nodes of a table, searchable from inside a kernel and in scalar mode."""

    def __init__(self, nodes_deg):
        self.last = len(nodes_deg) - 1
        self.ends_deg = float(nodes_deg[0]), float(nodes_deg[-1])
        self.nodes = memory(nodes_deg)

    def bracket(self, angle_deg, active):
        """The interval that holds an angle, and the fraction of it that the angle lies along."""
        above = dr.binary_search(0, self.last, lambda k: fetch(self.nodes, k, active) <= angle_deg)
        low = dr.clip(index(above), 1, self.last) - 1
        first, second = fetch(self.nodes, low, active), fetch(self.nodes, low + 1, active)
        return low, dr.clip((angle_deg - first) / (second - first), 0, 1)


class Table:
    """A luminous intensity distribution over the full circle of C."""

    cache = {}

    def __init__(self, path):
        with open(path, encoding="utf-8") as file:
            data = json.load(file)
        candela = np.array(data["candela"], np.float64)
        self.c, self.gamma = Axis(data["c_deg"]), Axis(data["gamma_deg"])
        if candela.shape != (self.c.last + 1, self.gamma.last + 1) or self.c.ends_deg != (0.0, 360.0):
            raise ValueError(f"{path}: candela must be a table over C 0 to 360 and gamma")
        self.candela = memory(candela.ravel())

    @classmethod
    def load(cls, name):
        """The table of a file named relative to the scene; luminaires of one kind share it."""
        path = str(mi.file_resolver().resolve(name))
        key = (mi.variant(), path)
        if key not in cls.cache:
            cls.cache[key] = cls(path)
        return cls.cache[key]

    def intensity(self, d, active):
        """Candela towards `d` in the luminaire's frame; atan2 keeps full precision at both poles."""
        gamma = dr.rad2deg(dr.atan2(dr.sqrt(d.x * d.x + d.y * d.y), -d.z))
        c = dr.rad2deg(dr.atan2(d.y, d.x))
        c = dr.select(c < 0, c + 360, c)
        i, s = self.c.bracket(c, active)
        j, t = self.gamma.bracket(gamma, active)
        row = self.gamma.last + 1
        at = lambda m, n: fetch(self.candela, (i + m) * row + j + n, active)
        value = dr.lerp(dr.lerp(at(0, 0), at(0, 1), t), dr.lerp(at(1, 0), at(1, 1), t), s)
        first, last = self.gamma.ends_deg
        return dr.select((gamma >= first - EDGE_DEG) & (gamma <= last + EDGE_DEG), value, 0)


class Goniometric(mi.Emitter):
    """The point source."""

    def __init__(self, props):
        mi.Emitter.__init__(self, props)
        self.table = Table.load(props["table"])
        self.scale = opaque(mi.Float(props.get("scale", 1.0)))
        to_world = np.array(props["to_world"].matrix, np.float64).reshape(4, 4)
        if not np.allclose(to_world[:3, :3] @ to_world[:3, :3].T, np.eye(3), atol=1e-5):
            raise ValueError("goniometric: to_world must be a rotation and a translation")
        self.position = opaque(mi.Point3f(*to_world[:3, 3].tolist()))
        self.axes = [opaque(mi.Vector3f(*to_world[:3, k].tolist())) for k in range(3)]
        self.m_flags = mi.EmitterFlags.DeltaPosition
        self.m_needs_sample_2 = False

    def intensity(self, d, active):
        """Candela towards the unit world direction `d`."""
        local = mi.Vector3f(*[dr.dot(axis, d) for axis in self.axes])
        return self.scale * self.table.intensity(local, active)

    def sample_direction(self, it, sample, active=True):
        ds = dr.zeros(mi.DirectionSample3f) if is_jit() else mi.DirectionSample3f()
        ds.p, ds.time, ds.pdf, ds.delta = self.position, it.time, 1.0, True
        to_light = self.position - it.p
        ds.dist = dr.norm(to_light)
        ds.d = to_light / ds.dist
        ds.emitter = mi.EmitterPtr(self) if is_jit() else self
        return ds, mi.Spectrum(self.intensity(-ds.d, active) / dr.square(ds.dist))

    def eval_direction(self, it, ds, active=True):
        return mi.Spectrum(self.intensity(-ds.d, active) / dr.square(ds.dist))

    def pdf_direction(self, it, ds, active=True):
        return mi.Float(0)

    def eval(self, si, active=True):
        return mi.Spectrum(0)

    def sample_ray(self, time, wavelength_sample, sample_2, sample_3, active=True):
        d = mi.warp.square_to_uniform_sphere(sample_3)
        power = 4 * dr.pi * self.intensity(d, active)
        return mi.Ray3f(self.position, d, time, mi.Color0f()), mi.Spectrum(power)

    def sample_wavelengths(self, si, sample, active=True):
        return mi.Color0f(), mi.Spectrum(1)

    def bbox(self):
        # Invalid on purpose, as for Mitsuba's own `point`: a point does not enlarge the scene.
        return mi.ScalarBoundingBox3f()

    def traverse(self, callback):
        pass

    def to_string(self):
        return "Goniometric[]"


def is_jit():
    return not mi.variant().startswith("scalar")


def memory(values):
    """Numbers that kernels may look up."""
    return mi.Float(np.asarray(values, np.float32)) if is_jit() else [float(v) for v in values]


def fetch(values, k, active):
    return dr.gather(mi.Float, values, mi.UInt32(k), active) if is_jit() else values[int(k)]


def index(k):
    return mi.Int32(k) if is_jit() else int(k)


def opaque(value):
    """Keeps a number out of a kernel's source, so that many luminaires share one kernel."""
    if is_jit():
        dr.make_opaque(value)
    return value


mi.register_emitter("goniometric", Goniometric)
