"""Writes values/5.9.yaml to 5.14.yaml: every point of these cases of CIE 171:2006 under the 16 skies of CIE S 011.

The luminance of sky and ground is integrated over the area of the opening that shows, by Gauss's rule on triangles. It
is one of two derivations: tests/analytic_values/cie171.rs integrates over the solid angle of the sky and shares no code.
Both agree to 1e-6 of every value. No value is taken from the standard.

Only Python's standard library is needed:  python3 derive.py   (in this folder; some minutes). With `aside` as its
argument it writes the values of the cases aside and far alone, in seconds.
"""
import math
import sys

sys.path.insert(0, "../analytic")

from derive_values import gauss
from geometry import (ASIDE, FAR, MASK, OVERHANG, SUN_ZENITH_DEG, VARIANTS, aside_points, case_of, far_points, has_glass,
                      middle_z, points)
from skies import GRADATIONS, GROUND_CD_M2, INDICATRICES, PAIRS, Sky, glass

NODES = gauss(40)
KINDS = range(1, 17)


def main():
    for variant in ASIDE:
        aside(variant)
    for variant in FAR:
        far(variant)
    if sys.argv[1:] == ["aside"]:
        return
    tables = {}
    for variant, (kind, across, along) in VARIANTS.items():
        sun = Sky(5, 90 if kind == "roof" else 0, SUN_ZENITH_DEG).sun
        scales = [Sky(k, 0, SUN_ZENITH_DEG).scale for k in KINDS]
        rows = tables.setdefault(case_of(variant), {})
        for letter, (place, normal) in points(kind).items():
            sums = light_that_shows(outline(kind, across, along, place), place, normal, kind, sun, has_glass(variant))
            cells = rows.setdefault(letter, (place, normal, {}))[2]
            size = variant[len(case_of(variant)) + 1:]
            for k, scale in zip(KINDS, scales):
                cells[f"{size}-sky-{k}"] = scale * sums[k - 1] + sums[16]
    for case, rows in tables.items():
        write(case, rows, "Written by derive.py. A column is a case of the spec.")


def aside(variant):
    """Writes the values of a case aside, which has one sky."""
    kind, across, along, number, azimuth = ASIDE[variant]
    sky, rows = Sky(number, azimuth, SUN_ZENITH_DEG), {}
    for k, (place, normal) in enumerate(aside_points(kind)):
        corners = outline(kind, across, along, place, azimuth if kind == "roof" else 0)
        sums = light_that_shows(corners, place, normal, kind, sky.sun, has_glass(variant))
        rows[k] = place, normal, {"value": sky.scale * sums[number - 1] + sums[16]}
    write(variant, rows, "Written by derive.py.")


def far(variant):
    """Writes the values of a case far; its skies have no sun."""
    kind, across, along, numbers = FAR[variant]
    skies, rows = [Sky(number, 0, SUN_ZENITH_DEG) for number in numbers], {}
    for k, (place, normal) in enumerate(far_points(kind)):
        sums = light_that_shows(outline(kind, across, along, place), place, normal, kind, skies[0].sun, has_glass(variant))
        values = {f"sky-{sky.kind}": sky.scale * sums[sky.kind - 1] + sums[16] for sky in skies}
        rows[k] = place, normal, values if len(skies) > 1 else {"value": next(iter(values.values()))}
    write(variant, rows, "Written by derive.py.")


def light_that_shows(corners, place, normal, kind, sun, is_glazed):
    """The illuminance by what shows: of the 16 skies, unscaled, and of the ground, which is the same under every sky."""
    sums = [0.0] * 17
    # Each half lies above the horizon or below it.
    for part in halves(corners, 2, place[2]):
        above = sum(corner[2] - place[2] for corner in part) > 0
        add(sums, part, above, place, normal, 2 if kind == "roof" else 0, sun, is_glazed)
    return sums


def outline(kind, across, along, place, turn_deg=0):
    """The corners of the part of the opening, or of the plane of a mask's edge, that shows; in order."""
    if kind == "roof":
        turn = math.radians(turn_deg)
        corners = [(s * across / 2, t * along / 2) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        return [(4 + u * math.cos(turn) - v * math.sin(turn), 4 + u * math.sin(turn) + v * math.cos(turn), 3.5)
                for u, v in corners]
    if kind == "facade":
        return upright(8, (4 - across / 2, 4 + across / 2), (2 - along / 2, 2 + along / 2))
    x, y, _ = OVERHANG if kind == "overhang" else MASK
    z = middle_z(kind, along)
    sill = 6.5 if kind == "overhang" else 2.5
    ends = [[y - across / 2, y + across / 2], [z - along / 2, z + along / 2]]
    for face in (6, 6.2):       # both faces of the wall around the opening of 2 x 1 m
        reach = (x - place[0]) / (face - place[0])
        for k, frame in enumerate(((y - 1, y + 1), (sill, sill + 1))):
            low, high = (place[k + 1] + reach * (end - place[k + 1]) for end in frame)
            ends[k] = [max(ends[k][0], low), min(ends[k][1], high)]
    return upright(x, *ends) if all(low < high for low, high in ends) else []


def upright(x, ys, zs):
    return [(x, ys[0], zs[0]), (x, ys[1], zs[0]), (x, ys[1], zs[1]), (x, ys[0], zs[1])]


def add(sums, part, above, place, normal, axis, sun, is_glazed):
    """Adds a part of sky or ground to the sums, in triangles about the sun's image and the foot of the perpendicular."""
    plane = part[0][axis] - place[axis]
    foot = tuple(plane + place[axis] if k == axis else p for k, p in enumerate(place))
    image = tuple(p + plane / sun[axis] * s for p, s in zip(place, sun))
    parts = [part]
    if above:
        # Cut through the sun's image along both other axes, so that its cusp is a corner of every piece.
        for k in {0, 1, 2} - {axis}:
            parts = [piece for whole in parts for piece in halves(whole, k, image[k])]
    for piece in parts:
        is_near_sun = above and any(math.dist(image, corner) < 1e-9 for corner in piece)
        apex = image if is_near_sun else nearest(piece, foot, axis)
        for a, b in zip(piece, piece[1:] + piece[:1]):
            triangle(sums, apex, a, b, above, place, normal, axis, sun, is_glazed)


def halves(polygon, axis, at):
    """The parts of a polygon beyond a plane across an axis and before it, without those that are no more than a side."""
    sides = []
    for sign in (1, -1):
        out = []
        for p, q in zip(polygon, polygon[1:] + polygon[:1]):
            hp, hq = sign * (p[axis] - at), sign * (q[axis] - at)
            if hp >= 0:
                out.append(p)
            if hp * hq < 0:
                out.append(tuple(a + (b - a) * hp / (hp - hq) for a, b in zip(p, q)))
        if len(out) >= 3 and any(sign * (p[axis] - at) > 0 for p in out):
            sides.append(out)
    return sides


def nearest(polygon, foot, axis):
    """The point of a convex polygon's plane nearest to the foot: itself where it lies within."""
    crosses = [cross(a, b, foot)[axis] for a, b in zip(polygon, polygon[1:] + polygon[:1])]
    if min(crosses) >= 0 or max(crosses) <= 0:
        return foot
    return min((along_side(a, b, foot) for a, b in zip(polygon, polygon[1:] + polygon[:1])),
               key=lambda at: math.dist(at, foot))


def along_side(a, b, foot):
    side = [q - p for p, q in zip(a, b)]
    length = sum(s * s for s in side)
    if length == 0:
        return a
    t = min(1.0, max(0.0, sum(s * (f - p) for s, f, p in zip(side, foot, a)) / length))
    return tuple(p + t * s for p, s in zip(a, side))


def cross(a, b, at):
    u, v = [q - p for p, q in zip(a, b)], [q - p for p, q in zip(a, at)]
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


def triangle(sums, apex, a, b, above, place, normal, axis, sun, is_glazed):
    """Gauss's rule on a square that is folded onto the triangle; long sides are divided."""
    area = math.hypot(*cross(a, b, apex))
    if area < 1e-14:
        return
    for s, ws in NODES:
        for t, wt in NODES:
            ray = [o + s * (p + t * (q - p) - o) - e for o, p, q, e in zip(apex, a, b, place)]
            d2 = ray[0] ** 2 + ray[1] ** 2 + ray[2] ** 2
            distance = math.sqrt(d2)
            towards = [r / distance for r in ray]
            received = sum(r * n for r, n in zip(towards, normal))
            if received <= 0:
                continue
            cosine = towards[axis]
            weight = ws * wt * s * area * cosine * received / d2 * (glass(cosine) if is_glazed else 1.0)
            if above:
                for k, luminance in enumerate(luminances(towards, sun)):
                    sums[k] += weight * luminance
            else:
                sums[16] += weight * GROUND_CD_M2


def luminances(towards, sun):
    """Of the 16 skies, unscaled. The distance of two unit vectors keeps its digits where their angle is small."""
    rise = towards[2]
    chord = min(math.dist(towards, sun), 2.0)
    angle = 2 * math.asin(chord / 2)
    near = (1 - chord * chord / 2) ** 2
    gradations = [1 + a * math.exp(b / rise) if rise > 1e-9 else 1.0 for a, b in GRADATIONS]
    indicatrices = [1 + c * (math.exp(d * angle) - math.exp(d * math.pi / 2)) + e * near for c, d, e in INDICATRICES]
    return [gradations[g] * indicatrices[i] for g, i in PAIRS] + [(1 + 2 * max(rise, 0.0)) / 3]


def write(case, rows, comment):
    lines = ["# Format: see reference/published/cachet.yaml; `basis` says that these are no readings but derived values.",
             f"# {comment}",
             "luxproof_published: 1", "citation:", f'  title: "CIE 171:2006, case {case}"', "  basis: closed_form",
             "rounding: {units_in_last_digit: 1}", "tables:", "  direct_illuminance:", f'    name: "{case}"',
             "    quantity: illuminance_lx", "    columns:"]
    for name in next(iter(rows.values()))[2]:
        of_case = "" if name == "value" else f" case: {name},"
        lines.append(f'      {name}: {{reference: true, engine: closed_form, model: area,{of_case} '
                     f'meaning: "Derived, no program\'s output"}}')
    lines.append("    rows:")
    for letter, (place, normal, cells) in rows.items():
        at, facing = (f"[{', '.join(f'{v:.9g}' for v in vector)}]" for vector in (place, normal))
        printed = ", ".join(f'{name}: "{digits(value)}"' for name, value in cells.items())
        if isinstance(letter, str):
            lines.append(f"      # {letter}")
        lines.append(f"      - {{at_m: {at}, normal: {facing}, cells: {{{printed}}}}}")
    with open(f"values/{case}.yaml", "w", encoding="ascii") as file:
        file.write("\n".join(lines) + "\n")


def digits(value):
    """Nine significant ones, and no exponent."""
    places = 9 if value == 0 else max(0, 8 - math.floor(math.log10(value)))
    return f"{value:.{places}f}"


if __name__ == "__main__":
    main()
