"""Writes luminaires/*.ies and the specs of cases 5.9 to 5.14: openings under the 16 skies of CIE S 011, as luminaires.

The light of a sky at infinity depends on direction alone and is the same at every point of an opening of no thickness.
Such an opening of area A is a luminaire flush with the room's surface, exactly: I(w) = L(-w) A cos(theta), w the
direction in which light travels, theta its angle with the opening's normal; behind clear glass, times the share that
the glass lets through at theta.

A roof looks down. A facade on the side x+ of a room is turned by `tilt: 90`: its nadir points inwards and its C 0 down.
Light of the sky travels within 90 degrees of C 0, light of the ground beyond, and planes a thousandth of a degree apart
hold the jump at the horizon. Where the sun stands over the plane C 0 - C 180, half the planes suffice. Angles are close
together about the sun, at grazing incidence and at the horizon. Files of one sky differ in their header alone: the
second number of its ninth line multiplies the table by the area of the opening.

Only Python's standard library is needed:  python3 make.py   (in this folder)
"""
import math
import sys

sys.path.insert(0, "../analytic")

from geometry import ASIDE, SUN_ZENITH_DEG, VARIANTS, case_of, has_glass, points
from skies import TYPES, Sky, glass, unglazed

KINDS = range(1, 17)


class Opening:
    """An opening of 1 m2 under a sky; `write` gives it its size."""

    def __init__(self, is_upright, sky, pane):
        self.is_upright, self.sky, self.pane = is_upright, sky, pane

    def seen(self, c_deg, gamma_deg):
        """Towards where light comes from that travels in a direction of the table, and the cosine of its incidence."""
        c, gamma = math.radians(c_deg), math.radians(gamma_deg)
        x, y, z = -math.sin(gamma) * math.cos(c), -math.sin(gamma) * math.sin(c), math.cos(gamma)
        if gamma_deg == 90:
            z = 0.0
        if not self.is_upright:
            return (x, y, z), z
        rise = 0.0 if c_deg in (90, 270) else -x
        if gamma_deg == 0:              # straight in from the horizon, above it or below it by the plane's side
            rise = 0.0 if c_deg <= 90 or c_deg >= 270 else -1e-9
        return (z, y, rise), z

    def intensity(self, c_deg, gamma_deg):
        towards, cosine = self.seen(c_deg, gamma_deg)
        if cosine == 0:
            return 0.0
        return self.sky.luminance(towards) * cosine * self.pane(cosine)

    def angles(self):
        # The transmittance of glass falls fast at grazing incidence.
        grazing = .5 if self.pane is glass else 1
        has_sun = self.sky.kind < 16 and TYPES[self.sky.kind][2] != 0
        if not self.is_upright:
            if not has_sun:
                return [0], steps((0, 76, 1), (76, 90, .5))
            # Light that comes from the sun travels towards C 180.
            return steps((0, 150, 5), (150, 180, 2.5)), steps((0, 20, 2), (20, 40, 1), (40, 76, 2), (76, 90, grazing))
        x, y, z = self.sky.sun
        if has_sun and abs(y) > 1e-9:
            # The plane and the angle that the sun lies in are among them.
            c, gamma = math.degrees(math.atan2(-y, z)) % 360, math.degrees(math.acos(x))
            planes = steps((0, 360, 2.5)) + [90.001, 269.999, round(c, 6)]
            return sorted(planes), sorted(steps((0, 76, 1), (76, 90, grazing)) + [round(gamma, 6)])
        planes = steps((0, 30, 2.5), (30, 80, 5), (80, 90, 2.5)) + [90.001, 180]
        return planes, steps((0, 50, 2), (50, 76, 1), (76, 90, grazing))

    def write(self, name, across, along, what):
        planes, gammas = self.angles()
        lines = ["IESNA:LM-63-2002", "[TEST] made up by reference/cie171/make.py, not a measurement", "[TESTLAB] none",
                 "[ISSUEDATE] 2026-11-30", "[MANUFAC] none", f"[LUMCAT] {name}", f"[LUMINAIRE] {what}", "TILT=NONE",
                 f"1 -1 {across * along:g} {len(gammas)} {len(planes)} 1 2 {across:g} {along:g} 0", "1 1 0"]
        lines += wrap([f"{g:.9g}" for g in gammas]) + wrap([f"{c:.9g}" for c in planes])
        for c in planes:
            lines += wrap([f"{self.intensity(c, g):.6g}" for g in gammas])
        with open(f"luminaires/{name}.ies", "w", newline="", encoding="ascii") as file:
            file.write("\r\n".join(lines) + "\r\n")


def wrap(words, per_line=16):
    return [" ".join(words[k:k + per_line]) for k in range(0, len(words), per_line)]


def steps(*ranges):
    """Angles from the first to the last of some ranges, each with its step."""
    angles = [ranges[0][0]]
    for low, high, step in ranges:
        angles += [low + step * (k + 1) for k in range(round((high - low) / step))]
    return angles


def main():
    for is_upright in (False, True):
        for pane in (unglazed, glass):
            for kind in KINDS:
                # Of a roof it stands in the plane that the table begins with; the spec turns it before the wall.
                opening = Opening(is_upright, Sky(kind, 0, SUN_ZENITH_DEG), pane)
                for variant, (shape, across, along) in VARIANTS.items():
                    if (shape != "roof") == is_upright and has_glass(variant) == (pane is glass):
                        name = f"{variant}-sky-{kind}"
                        opening.write(name, across, along, f"Opening {across} x {along} m of case {case_of(variant)}, sky {kind}")
    for name, (shape, across, along, kind, azimuth) in ASIDE.items():
        # That of a roof is the opening above; its spec turns it.
        if shape != "roof":
            opening = Opening(True, Sky(kind, azimuth, SUN_ZENITH_DEG), glass if has_glass(name) else unglazed)
            opening.write(name, across, along, f"Opening {across} x {along} m of case {name}, sky {kind}")
    for name, (variants, head, title) in SPECS.items():
        spec(name, variants, head, title)


ROOF = """room:
  size_m: [8, 8, 3.5]
  reflectance: {floor: 0, walls: 0, ceiling: 0}
luminaires:
  - {id: opening, photometry: PHOTOMETRY, at_m: [4, 4, 3.5], rotate_deg: {azimuth: 90}, model: area}
"""
FACADE = """room:
  size_m: [8, 8, 4]
  reflectance: {floor: 0, walls: 0, ceiling: 0}
luminaires:
  - {id: opening, photometry: PHOTOMETRY, at_m: [8, 4, 2], rotate_deg: {tilt: 90}, model: area}
"""
WALL = """obstacles:
  - box: {min_m: [6, 0, 0], max_m: [6.2, WIDTH, SILL], reflectance: 0}
  - box: {min_m: [6, 0, HEAD], max_m: [6.2, WIDTH, HEIGHT], reflectance: 0}
  - box: {min_m: [6, 0, SILL], max_m: [6.2, LEFT, HEAD], reflectance: 0}
  - box: {min_m: [6, RIGHT, SILL], max_m: [6.2, WIDTH, HEAD], reflectance: 0}
"""


def masked(size, sill, left, at):
    x, width, height = size
    wall = WALL.replace("WIDTH", f"{width:g}").replace("HEIGHT", f"{height:g}").replace("SILL", f"{sill:g}")
    wall = wall.replace("HEAD", f"{sill + 1:g}").replace("LEFT", f"{left:g}").replace("RIGHT", f"{left + 2:g}")
    return f"""room:
  size_m: [{x:g}, {width:g}, {height:g}]
  reflectance: {{floor: 0, walls: 0, ceiling: 0}}
{wall}luminaires:
  - {{id: opening, photometry: PHOTOMETRY, at_m: {list(at)}, rotate_deg: {{tilt: 90}}, model: area}}
"""


SPECS = {
    "5.9-roof": (("5.9-1m", "5.9-4m"), ROOF, "sky component under an unglazed roof opening"),
    "5.10-roof-glass": (("5.10-1m", "5.10-4m"), ROOF, "sky component under a glazed roof opening"),
    "5.11-facade": (("5.11-2x1m", "5.11-4x3m"), FACADE, "sky and ground through an unglazed facade opening"),
    "5.12-facade-glass": (("5.12-2x1m", "5.12-4x3m"), FACADE, "sky and ground through a glazed facade opening"),
    "5.13-overhang": (("5.13-2x1m",), masked((7.2, 8, 9), 6.5, 3, (7.2, 4, 4.5)), "a facade opening under an overhang"),
    "5.14-mask": (("5.14-2x1m",), masked((12.2, 30, 34.5), 2.5, 14, (12.2, 15, 19.5)), "a facade opening before a mask"),
}


def spec(name, variants, head, title):
    case = case_of(name)
    lines = [f"# Written by make.py. CIE 171:2006, case {case}: {title}. README.md describes points and skies; 1 % is",
             "# 100 lx, for every sky gives an open horizontal plane 10 000 lx.", "luxproof: 1",
             f'title: "CIE 171, {case}: {title}"']
    lines += head.replace("PHOTOMETRY", f"luminaires/{variants[0]}-sky-1.ies").splitlines() + ["meters:"]
    sets = {}
    for letter, (place, normal) in points(VARIANTS[variants[0]][0]).items():
        sets.setdefault(normal, []).append(place)
    names = {(0, 0, 1): "floor", (0, 0, -1): "ceiling"}
    for normal, places in sets.items():
        lines.append(f"  {names.get(normal, 'wall')}:")
        lines.append("    points_m: [" + ", ".join(f"[{', '.join(f'{v:g}' for v in place)}]" for place in places) + "]")
        lines.append(f"    normal: {list(normal)}")
    meters = ", ".join(names.get(normal, "wall") for normal in sets)
    lines += ["procedures:", f"  direct_illuminance: {{meters: [{meters}]}}", f"published: values/{case}.yaml"]
    if case in ("5.13", "5.14"):
        lines += ["budget: {relative_error: 0.004, seconds: 300}",
                  "# A point sees a small part of the luminaire, through a hole. Grids of points cannot show how much.",
                  "tolerances: {direct_illuminance: {relative: 0.02, absolute_lx: 0.001}}",
                  "engines: {simulator: {}, radiance: {}, mitsuba: {}, cycles: {}, luxcore: {}}"]
    else:
        lines.append("budget: {relative_error: 0.002, seconds: 20}")
    lines.append("cases:")
    for variant in variants:
        size = variant[len(case) + 1:]
        for k in KINDS:
            file = f"luminaires/{variant}-sky-{k}.ies"
            lines.append(f"  - {{name: {size}-sky-{k}, luminaires: {{opening: {{photometry: {file}}}}}}}")
    with open(f"{name}.yaml", "w", encoding="ascii") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
