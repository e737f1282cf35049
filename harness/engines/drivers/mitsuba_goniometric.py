"""Mitsuba 3 emitter `goniometric`: a luminaire with a tabulated luminous intensity distribution.

Import this file after `mi.set_variant(...)`, then use the emitter in a scene:

    <emitter type="goniometric">
        <string name="table" value="table.json"/>       c_deg, gamma_deg, candela[c][gamma]
        <float name="scale" value="1"/>                 on every intensity
        <string name="opening" value="box"/>            point (default), box, ellipse, ellipsoid, cylinder_x, cylinder_y
        <vector name="size" value="0.6, 0.6, 0"/>       extents of the opening along its own x, y, z
        <transform name="to_world"> ... </transform>    rotation and position; C 0 is +x, gamma 0 is -z
    </emitter>

Intensity is bilinear in (C, gamma) in degrees, the definition of IES LM-63 type C tables; outside the table's gamma
range it is zero. A part of an extended opening has the intensity of the table in proportion to the area that it shows;
all parts together have that of the table. The emitter has no body: rays neither meet it nor are stopped by it.
With candela and metres, irradiance is in lux.
"""

import json
import math

import drjit as dr
import mitsuba as mi
import numpy as np

# A direction in 32-bit floats is known to about this angle; the last angles of a table count as inside within it.
EDGE_DEG = 5e-5
# How far from the opening a ray starts, in parts of its coordinates.
CLEAR = 1e-6


class Goniometric(mi.Emitter):
    """The emitter; paths reach it by next-event estimation, and particles start from it."""

    def __init__(self, props):
        mi.Emitter.__init__(self, props)
        self.table = Table.load(props["table"])
        self.opening = Opening(props.get("opening", "point"), props.get("size", mi.ScalarVector3f(0)))
        self.scale = opaque(mi.Float(props.get("scale", 1.0)))
        to_world = np.array(props["to_world"].matrix, np.float64).reshape(4, 4)
        if not np.allclose(to_world[:3, :3] @ to_world[:3, :3].T, np.eye(3), atol=1e-5):
            raise ValueError("goniometric: to_world must be a rotation and a translation")
        self.position = opaque(mi.Point3f(*to_world[:3, 3].tolist()))
        self.axes = [opaque(mi.Vector3f(*to_world[:3, k].tolist())) for k in range(3)]
        self.m_flags = mi.EmitterFlags.DeltaPosition
        self.m_needs_sample_2 = self.m_needs_sample_3 = False

    def intensity(self, d, active):
        """Candela of the whole luminaire towards the unit world direction `d`."""
        return self.scale * self.table.intensity(self.to_own(d), active)

    def to_own(self, d):
        return mi.Vector3f(*[dr.dot(axis, d) for axis in self.axes])

    def sample_direction(self, it, sample, active=True):
        part, area = self.opening.part(sample.x, sample.y)
        ds = dr.zeros(mi.DirectionSample3f) if is_jit() else mi.DirectionSample3f()
        ds.p = self.position + sum((axis * x for axis, x in zip(self.axes, part)), mi.Vector3f(0))
        # No ray can meet the emitter by chance: to the integrator that is a delta distribution.
        ds.time, ds.pdf, ds.delta = it.time, 1.0, True
        to_light = ds.p - it.p
        ds.dist = dr.norm(to_light)
        ds.d = to_light / ds.dist
        ds.emitter = mi.EmitterPtr(self) if is_jit() else self
        share = self.opening.share(area, self.to_own(-ds.d))
        return ds, mi.Spectrum(share * self.intensity(-ds.d, active) / (ds.dist * ds.dist))

    def eval_direction(self, it, ds, active=True):
        return mi.Spectrum(self.intensity(-ds.d, active) / (ds.dist * ds.dist))

    def pdf_direction(self, it, ds, active=True):
        return mi.Float(0)

    def eval(self, si, active=True):
        return mi.Spectrum(0)

    def sample_ray(self, time, wavelength_sample, sample_2, sample_3, active=True):
        """A ray from a part of the opening in any direction, for integrators that trace light from the emitter."""
        part, area = self.opening.part(sample_2.x, sample_2.y)
        own = mi.warp.square_to_uniform_sphere(sample_3)
        world = lambda v: sum((axis * x for axis, x in zip(self.axes, v)), mi.Vector3f(0))
        d = world((own.x, own.y, own.z))
        start = self.position + world(part)
        # Clear of a surface that the opening lies on.
        reach = dr.maximum(dr.maximum(dr.abs(start.x), dr.abs(start.y)), dr.abs(start.z))
        ray = mi.Ray3f(start + d * (CLEAR * (1 + reach)), d)
        ray.time = time
        return ray, mi.Spectrum(4 * math.pi * self.opening.share(area, own) * self.intensity(d, active))

    def bbox(self):
        # Invalid on purpose, as for Mitsuba's own `point`: it does not enlarge the scene.
        return mi.ScalarBoundingBox3f()

    def traverse(self, callback):
        pass

    def to_string(self):
        return "Goniometric[]"


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
        # Older Mitsubas have a resolver a thread.
        resolver = mi.file_resolver() if hasattr(mi, "file_resolver") else mi.Thread.thread().file_resolver()
        path = str(resolver.resolve(name))
        if (mi.variant(), path) not in cls.cache:
            cls.cache[mi.variant(), path] = cls(path)
        return cls.cache[mi.variant(), path]

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


class Axis:
    """Rising nodes of a table, searchable from inside a kernel and in scalar mode."""

    def __init__(self, nodes_deg):
        self.last = len(nodes_deg) - 1
        self.ends_deg = float(nodes_deg[0]), float(nodes_deg[-1])
        self.nodes = memory(nodes_deg)

    def bracket(self, angle_deg, active):
        """The interval that holds an angle, and the fraction of it that the angle lies along."""
        above = dr.binary_search(0, self.last, lambda k: fetch(self.nodes, k, active) <= angle_deg)
        low = dr.clip(mi.Int32(above) if is_jit() else int(above), 1, self.last) - 1
        first, second = fetch(self.nodes, low, active), fetch(self.nodes, low + 1, active)
        return low, dr.clip((angle_deg - first) / (second - first), 0, 1)


class Opening:
    """The luminous opening in the luminaire's frame."""

    def __init__(self, kind, size):
        self.half = [0.5 * abs(float(s)) for s in size]
        # Cylinders stand along z here; `order` lays them.
        self.order = {"cylinder_x": (2, 1, 0), "cylinder_y": (0, 2, 1)}.get(kind, (0, 1, 2))
        self.half = self.laid(self.half)
        kinds = {"ellipse": "cylinder", "cylinder_x": "cylinder", "cylinder_y": "cylinder"}
        self.kind = kinds.get(kind, kind)
        if self.kind not in ("point", "box", "cylinder", "ellipsoid"):
            raise ValueError(f"goniometric: no opening `{kind}`")
        dimensions = sum(h > 0 for h in self.half)
        if dimensions < 2:
            self.kind = ("point", "line")[dimensions]
        # From a sheet, every point shines alike to both sides.
        self.is_sheet = dimensions == 2 and (self.kind == "box" or (self.kind == "cylinder" and self.half[2] == 0))

    def laid(self, vector):
        return [vector[k] for k in self.order]

    def part(self, u, v):
        """A point of the opening, and its outward normal times the area that it stands for."""
        if self.kind == "point":
            return (0, 0, 0), None
        if self.kind == "line":
            return self.laid([h * (2 * u - 1) for h in self.half]), None
        if self.is_sheet and self.kind == "box":
            grid = iter((2 * u - 1, 2 * v - 1))
            return self.laid([h * next(grid) if h > 0 else 0 for h in self.half]), None
        at, area = {"box": self.box, "cylinder": self.cylinder, "ellipsoid": self.ellipsoid}[self.kind](u, v)
        return self.laid(at), self.laid(area)

    def share(self, area, own):
        """How much of the table's intensity towards `own` a part stands for; 1 in the mean over the parts."""
        if area is None or self.is_sheet:
            return 1
        shown = sum(a * w for a, w in zip(area, (own.x, own.y, own.z)))
        return dr.maximum(shown, 0) / self.shadow(self.laid([dr.abs(own.x), dr.abs(own.y), dr.abs(own.z)]))

    def shadow(self, w):
        """Projected area along a direction."""
        x, y, z = self.half
        if self.kind == "box":
            return 4 * (y * z * w[0] + x * z * w[1] + x * y * w[2])
        if self.kind == "cylinder":
            return math.pi * x * y * w[2] + 4 * z * dr.sqrt((y * w[0]) ** 2 + (x * w[1]) ** 2)
        return math.pi * dr.sqrt((y * z * w[0]) ** 2 + (x * z * w[1]) ** 2 + (x * y * w[2]) ** 2)

    def box(self, u, v):
        """One of three pairs of faces, by area; then a side; then a point."""
        x, y, z = self.half
        faces = [y * z, x * z, x * y]
        total = sum(faces)
        at, area = [0, 0, 0], [0, 0, 0]
        low = 0.0
        for k, face in enumerate(faces):
            high = low + face / total
            chosen = (u >= low) & (u < high) if k < 2 else u >= low
            side, a = halves((u - low) / (high - low) if high > low else u)
            local = [None] * 3
            local[k], local[(k + 1) % 3], local[(k + 2) % 3] = side, 2 * a - 1, 2 * v - 1
            at = [dr.select(chosen, h * s, old) for h, s, old in zip(self.half, local, at)]
            area[k] = dr.select(chosen, side * 8 * total, 0)
            low = high
        return at, area

    def cylinder(self, u, v):
        """Both ends or the side; any split is unbiased, one by shown area is good."""
        x, y, z = self.half
        cap, side = math.pi * x * y, 4 * z * max(x, y)
        share = cap / (cap + side)
        cos, sin = dr.cos(2 * math.pi * v), dr.sin(2 * math.pi * v)
        on_cap = u < share
        up, a = halves(u / share)
        r = dr.select(on_cap, dr.sqrt(dr.clip(a, 0, 1)), 1)
        along = 2 * (u - share) / (1 - share) - 1 if side > 0 else 0
        at = [x * r * cos, y * r * sin, z * dr.select(on_cap, up, along)]
        whole = 4 * math.pi * z / (1 - share) if side > 0 else 0
        area = [
            dr.select(on_cap, 0, whole * y * cos),
            dr.select(on_cap, 0, whole * x * sin),
            dr.select(on_cap, up * 2 * cap / share, 0),
        ]
        return at, area

    def ellipsoid(self, u, v):
        x, y, z = self.half
        up = 1 - 2 * u
        r = dr.sqrt(dr.maximum(1 - up * up, 0))
        sphere = [r * dr.cos(2 * math.pi * v), r * dr.sin(2 * math.pi * v), up]
        cofactor = [y * z, x * z, x * y]
        return [h * s for h, s in zip(self.half, sphere)], [4 * math.pi * c * s for c, s in zip(cofactor, sphere)]


def halves(u):
    """The side, -1 or 1, that the half of the unit interval which holds `u` stands for, and where in it `u` lies."""
    upper = u >= 0.5
    return dr.select(upper, 1, -1), 2 * u - dr.select(upper, 1, 0)


def is_jit():
    return not mi.variant().startswith("scalar")


def memory(values):
    """Numbers that kernels may look up."""
    return mi.Float(np.asarray(values, np.float32)) if is_jit() else [float(v) for v in values]


def fetch(values, k, active):
    return dr.gather(mi.Float, values, mi.UInt32(k), active) if is_jit() else values[int(k)]


def opaque(value):
    """Keeps a number out of a kernel's source, so that many luminaires share one kernel."""
    if is_jit():
        dr.make_opaque(value)
    return value


mi.register_emitter("goniometric", Goniometric)
