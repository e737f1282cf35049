"""Writes values/5.2.yaml to 5.7.yaml: lamps in rooms, by area quadrature of Lambert's law.

It is one of two derivations: tests/analytic_values.rs derives every value again, from closed forms and contour
integrals of luminaire::calculators and luminaire::geometry, and compares. Case 5.7 of CIE 171:2006 is not taken
from its Table 19, which holds errors. Case 5.8 has a law (the mean of a closed room) and no values here.

Only Python's standard library is needed:  python3 derive_lamps.py   (in this folder)
"""
import math
import sys

sys.path.insert(0, "../analytic")

import derive_values
from derive_values import NODES, factor, gauss, segment


def main():
    up, down = (0, 0, 1), (0, 0, -1)
    offsets = [(0, 0), (.5, 0), (1, 0), (1.5, 0), (.5, .5), (1, .5), (1.5, .5), (1, 1), (1.5, 1), (1.5, 1.5)]
    rows = []
    for x, y in offsets:
        d2 = x * x + y * y + 9
        candela, cosine = 1000 * 3 / math.sqrt(d2), 3 / math.sqrt(d2)
        rows.append(((4 + x, 4 + y, .5), up, candela * cosine / d2))
    write("5.2", {"direct_illuminance": ("point", rows)})

    source = rectangle((3.5, 4.5), (3.5, 4.5), 3.5)
    rows = [((4, 2, z + .5), (0, 1, 0)) for z in (2.75, 2.25, 1.75, 1.25, .75, .25)]
    rows += [((4, 2 + y, .5), up) for y in (.25, .75, 1.25, 1.75)]
    rows = [(p, n, 1000 * math.pi * factor(p, n, source)) for p, n in rows]
    write("5.3", {"direct_illuminance": ("area", rows)})

    # The meters of the spec: products of four Gauss-Legendre nodes on a quarter of each side.
    x, z = ([round(.5 + half * u, 9) for u, _ in sorted(gauss(4))] for half in (2, 1.5))
    rows = [((a, b, .5), up) for a in x for b in x] + [((a, b, 3.5), down) for a in x for b in x]
    rows += [((w, a, b), (n, 0, 0)) for w, n in ((.5, 1), (4.5, -1)) for a in x for b in z]
    rows += [((a, w, b), (0, n, 0)) for w, n in ((.5, 1), (4.5, -1)) for a in x for b in z]
    rows = [(p, n, isotropic(10_000, (2.5, 2.5, 2.0), p, n)) for p, n in rows]
    write("5.4", {"direct_illuminance": ("point", rows)})

    disc = segment((2, 2), 1.5, -math.inf)
    rows = [((2 + x, 2, 2.9), down) for x in (.25, .75, 1.25, 1.75)]
    rows += [((3.9, 2, z), (-1, 0, 0)) for z in (.25, .75, 1.25, 1.75, 2.25, 2.75)]
    rows = [(p, n, 800 * factor(p, n, disc)) for p, n in rows]
    # Direct light of the spot, a millimetre above the disc: 1000 lx 2.5^2 / cos^3 is its intensity.
    spot = [((2 + x, 2, .001), up, 1000 * (2.5 / 2.499) ** 2) for x in (0, .5, 1, 1.4)]
    write("5.6", {"indirect_illuminance": ("point", rows), "direct_illuminance": ("point", spot)})

    places = [((3.9, y, z), (-1, 0, 0)) for y in (2, 3) for z in (.5, 1.5, 2, 2.5, 2.9)]
    places += [((x, 2, 2.9), down) for x in (2.6, 3.0, 3.4, 3.8)]
    rows = [(p, n, 800 * factor(p, n, segment((1.2, 2), 1, shadow_edge(p)))) for p, n in places]
    write("5.7", {"indirect_illuminance": ("point", rows)})


def write(case, tables):
    # A number in quotes is a name.
    derive_values.write(case, f"CIE 171:2006-type case {case}", "closed_form", 3, tables, table=f'"{case}"')


def rectangle(xs, ys, z):
    return [((xs[0] + u * (xs[1] - xs[0]), ys[0] + v * (ys[1] - ys[0]), z), a * b * (xs[1] - xs[0]) * (ys[1] - ys[0]))
            for u, a in NODES for v, b in NODES]


def shadow_edge(point):
    """Where the line from a point through the screen's nearer lower edge (x 2.41, z 1) meets the floor."""
    x, _, z = point
    return x - (x - 2.41) * z / (z - 1) if z > 1 else -math.inf


def isotropic(flux_lm, lamp, place, normal):
    """Inverse-square law of a point that sends the same intensity everywhere."""
    ray = [a - b for a, b in zip(lamp, place)]
    distance = math.hypot(*ray)
    return flux_lm / (4 * math.pi) * sum(a * b for a, b in zip(ray, normal)) / distance ** 3


if __name__ == "__main__":
    main()
