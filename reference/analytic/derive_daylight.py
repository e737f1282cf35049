"""Writes values/cie-5.9*.yaml to cie-5.14*.yaml, the daylight cases, by quadrature of the sky's own law over openings.

It is one of two derivations: tests/analytic_values/daylight.rs derives every value again, under the uniform sky in
closed form and under all over the solid angle of the sky in place of the area of the opening. No value is taken from
CIE 171. With `--tables` it tells instead how far the straight lines of the photometric files stray at every meter.

Only Python's standard library is needed:  python3 derive_daylight.py   (in this folder)
"""
import math
import sys

from derive_values import gauss, write
from make_openings import OPENINGS

NODES = gauss(60)
UP, DOWN, IN = (0, 0, 1), (0, 0, -1), (1, 0, 0)
ROOF_TURN_DEG = 30              # the clear sky over the roof


def main():
    # The 4 x 4 x 3 m room of the cases stands at (2, 2, .5) in a larger one, so that no meter lies on a surface.
    wall = [((4, 2, z), (0, 1, 0)) for z in (3, 2.5, 2, 1.5, 1)]
    floor = [((4, 2 + y, .5), UP) for y in (.25, .75, 1.75)]
    around = [((4, 2, 2.5), (0, 1, 0)), ((4, 6, 2.5), (0, -1, 0)), ((2, 4, 1), (1, 0, 0)), ((6, 4, 1), (-1, 0, 0))]
    around += [((2.5, 2.5, .5), UP), ((2.5, 5.5, .5), UP), ((5.5, 2.5, .5), UP), ((5.5, 5.5, .5), UP)]
    roof("cie-5.9", "uniform-4m", wall + floor, 0)
    roof("cie-5.9", "overcast-1m", wall + floor, 0)
    roof("cie-5.9", "gradual-4m", wall + floor, 0)
    roof("cie-5.9", "clear-1m", around, ROOF_TURN_DEG)
    roof("cie-5.10", "overcast-1m-glass", wall + floor, 0)
    roof("cie-5.10", "clear-1m-glass", around, ROOF_TURN_DEG)

    # Seen from within, at (4, 2, .5): the facade is its side x = 8.
    back = [((4, 4, z), IN) for z in (.75, 1.75, 2.75)]
    depth = [((x, 4, .5), UP) for x in (7.5, 6.5, 5.5)] + [((x, 4, 3.5), DOWN) for x in (7.5, 6.5, 5.5)]
    aside = [((7, 3.5, .5), UP), ((7, 5, .5), UP), ((7, 3, 3.5), DOWN), ((7, 5, 3.5), DOWN)]
    aside += [((4, 3, 1), IN), ((4, 5, 1), IN), ((6, 2, 1.5), (0, 1, 0)), ((6, 6, 1.5), (0, -1, 0))]
    edges = [((4, 4, z), IN) for z in (.5, 2, 3.5)]
    facade("cie-5.11", "uniform-4x3m", edges + depth)
    facade("cie-5.11", "overcast-2x1m", back + depth)
    facade("cie-5.11", "clear-2x1m", aside)
    facade("cie-5.12", "gradual-4x3m-glass", edges + depth)
    facade("cie-5.12", "clear-2x1m-glass", aside)

    # At (2, 2, 1.5) behind a wall of .2 m, x = 6 to 6.2, and an overhang of 1 m at the opening's head.
    seen = [((2, 4, z), IN) for z in (2, 3, 4)] + [((4.5, 4, 1.5), UP), ((3, 3, 1.5), UP)]
    seen += [((4.5, 4, 4.5), DOWN), ((3, 5, 4.5), DOWN), ((4, 2, 3), (0, 1, 0))]
    masked("cie-5.13", "sky-below-overhang", (7.2, 4, 2), seen)
    # At (2, 4.5, 1.5) behind the same wall; 6 m before it stands a mask of 4.5 m, black like what lies between.
    seen = [((2, 6.5, z), IN) for z in (1.75, 2.25)]
    seen += [((4, 6.5, 1.5), UP), ((3, 6.5, 1.5), UP), ((3, 5.5, 1.5), UP), ((2.5, 4.5, 2.5), (0, 1, 0))]
    masked("cie-5.14", "sky-above-mask", (12.2, 6.5, 6.75), seen)


def roof(case, name, meters, turn_deg):
    opening = OPENINGS["sky-roof-" + name]
    half, turn = opening.across / 2, math.radians(turn_deg)
    ways = [(math.cos(turn), math.sin(turn), 0), (-math.sin(turn), math.cos(turn), 0)]
    corners = [tuple(c + s * half * u + t * half * v for c, u, v in zip((4, 4, 3.5), *ways))
               for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    table(case, name, opening, [corners], meters, turn)


def facade(case, name, meters):
    opening = OPENINGS["sky-facade-" + name]
    corners = rectangle(8, 4, opening.across, 2 - opening.along / 2, 2 + opening.along / 2)
    table(case, name, opening, [corners], meters, 0)


def masked(case, name, centre, meters):
    """The luminaire stands at the mask's outer edge; of it shows what both faces of the wall's opening leave."""
    opening, (x, y, z), polygons = OPENINGS[name], centre, []
    for place, _ in meters:
        ends = [(y - opening.across / 2, y + opening.across / 2), (z - opening.along / 2, z + opening.along / 2)]
        for face in (6, 6.2):
            further = (x - place[0]) / (face - place[0])
            for axis, (low, high) in ((1, (y - 1, y + 1)), (2, (2.5, 3.5))):
                low, high = (place[axis] + further * (end - place[axis]) for end in (low, high))
                ends[axis - 1] = max(ends[axis - 1][0], low), min(ends[axis - 1][1], high)
        (left, right), (low, high) = ends
        polygons.append(rectangle(x, (left + right) / 2, right - left, low, high))
    table(case, name, opening, polygons, meters, 0)


def rectangle(x, y, across, low, high):
    return [(x, y + s * across / 2, z) for s, z in ((-1, low), (1, low), (1, high), (-1, high))]


def table(case, name, opening, polygons, meters, turn):
    rows, strays = [], []
    for (place, normal), corners in zip(meters, polygons * len(meters) if len(polygons) == 1 else polygons):
        rows.append((place, normal, illuminance(opening, place, normal, corners, turn, law)))
        if "--tables" in sys.argv:
            strays.append(illuminance(opening, place, normal, corners, turn, interpolated) / rows[-1][2] - 1)
    if strays:
        print(case, name, "largest", f"{max(map(abs, strays)):.1e}", "each", " ".join(f"{s:+.1e}" for s in strays))
        return
    name = name.removeprefix("sky-")
    write(f"{case}-{name}", f"CIE 171:2006-type case {case[4:]}, {name}", "closed_form", 3,
          {"direct_illuminance": ("area", rows)}, table=case)


def law(opening, towards, cosine):
    return opening.sky.luminance(towards) * opening.pane(cosine)


def illuminance(opening, place, normal, corners, turn, law):
    """The integral of L tau cos cos / d^2 over the opening, in parts about the sun's image or the nearest place."""
    total = 0.0
    for above in (False, True):
        part = cut(corners, place[2], above)
        if len(part) < 3:
            continue
        apex = sun_in(opening, place, part, turn) or nearest(opening, place, part)
        for a, b in zip(part, part[1:] + part[:1]):
            total += triangle(opening, place, normal, apex, a, b, turn, law)
    return total


def cut(corners, height, above):
    """The part of a polygon that lies above a height, or below it."""
    out, sign = [], 1 if above else -1
    for p, q in zip(corners, corners[1:] + corners[:1]):
        hp, hq = sign * (p[2] - height), sign * (q[2] - height)
        if hp >= 0:
            out.append(p)
        if hp * hq < 0:
            out.append(tuple(a + (b - a) * hp / (hp - hq) for a, b in zip(p, q)))
    return out


def sun_in(opening, place, part, turn):
    """Where the sun's direction meets the part's plane, if that is within it."""
    if opening.sky.kind != 12:
        return None
    x, y, z = opening.sky.sun
    sun = (x * math.cos(turn) - y * math.sin(turn), x * math.sin(turn) + y * math.cos(turn), z)
    axis = 0 if opening.facade else 2
    distance = (part[0][axis] - place[axis]) / sun[axis]
    at = tuple(p + distance * s for p, s in zip(place, sun))
    return at if distance > 0 and contains(part, at, axis) else None


def nearest(opening, place, part):
    """The foot of the perpendicular to the part's plane, if within it, else a corner or the middle of a side."""
    axis = 0 if opening.facade else 2
    foot = tuple(part[0][k] if k == axis else p for k, p in enumerate(place))
    if contains(part, foot, axis):
        return foot
    middles = [tuple((p + q) / 2 for p, q in zip(a, b)) for a, b in zip(part, part[1:] + part[:1])]
    return min(part + middles, key=lambda at: math.dist(at, place))


def contains(part, at, axis):
    sides = [cross(a, b, at)[axis] for a, b in zip(part, part[1:] + part[:1])]
    return min(sides) >= 0 or max(sides) <= 0


def cross(a, b, at):
    u, v = [q - p for p, q in zip(a, b)], [q - p for p, q in zip(a, at)]
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


def triangle(opening, place, normal, apex, a, b, turn, law):
    """Gauss's rule on a square that is folded onto the triangle, at whose apex the integrand may have a cusp."""
    area, total = math.hypot(*cross(a, b, apex)), 0.0
    axis = 0 if opening.facade else 2
    for s, ws in NODES:
        for t, wt in NODES:
            at = [o + s * (p + t * (q - p) - o) for o, p, q in zip(apex, a, b)]
            ray = [p - q for p, q in zip(at, place)]
            distance = math.hypot(*ray)
            x, y, z = (r / distance for r in ray)
            local = (x * math.cos(turn) + y * math.sin(turn), y * math.cos(turn) - x * math.sin(turn), z)
            cosine = local[axis]
            received = max(0.0, sum(r * n for r, n in zip((x, y, z), normal)))
            total += ws * wt * s * area * law(opening, local, cosine) * cosine * received / distance ** 2
    return total


def interpolated(opening, towards, cosine):
    """What the photometric file has in place of the law."""
    x, y, z = towards
    down, side, axial = (z, -y, x) if opening.facade else (-x, -y, z)
    c = math.degrees(math.atan2(side, down)) % 360
    gamma = math.degrees(math.atan2(math.hypot(side, down), axial))
    planes, gammas = opening.angles()
    if planes[-1] == 180 and c > 180:
        c = 360 - c
    (j, v), (i, u) = ((0, 0.0) if len(planes) == 1 else between(planes, c)), between(gammas, gamma)
    lit = [[candela(opening, planes[min(j + m, len(planes) - 1)], gammas[i + n]) for n in (0, 1)] for m in (0, 1)]
    value = sum(lit[m][n] * (v if m else 1 - v) * (u if n else 1 - u) for m in (0, 1) for n in (0, 1))
    return value / (opening.across * opening.along * cosine)


def between(angles, angle):
    k = min(max(sum(a <= angle for a in angles) - 1, 0), len(angles) - 2)
    return k, (angle - angles[k]) / (angles[k + 1] - angles[k])


KNOWN = {}


def candela(opening, c, gamma):
    key = opening.name, c, gamma
    if key not in KNOWN:
        KNOWN[key] = opening.intensity(c, gamma)
    return KNOWN[key]


if __name__ == "__main__":
    main()
