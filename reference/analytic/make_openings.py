"""Writes ../luminaires/sky-*.ies: openings of rooms as luminaires that send in the light of a sky.

The light of a sky at infinity depends on direction alone and is the same at every point of an opening of no thickness.
Such an opening of area A is a luminaire flush with the room's surface, exactly: I(w) = L(-w) A cos(theta), w the
direction in which light travels, theta its angle with the opening's normal; behind clear glass, times the share that
the glass lets through at theta.

A roof looks down. A facade on the side x+ of a room is turned by `tilt: 90`: its nadir points inwards and its C 0 down.
Light of the sky travels within 90 degrees of C 0, light of the ground beyond, and planes a thousandth of a degree apart
hold the jump at the horizon. What the straight lines between a table's angles leave out of a reading is told by
derive_daylight.py.

Only Python's standard library is needed:  python3 make_openings.py   (in this folder)
"""
import math

from skies import Sky, glass, unglazed


class Opening:
    """An opening under a sky, `across` metres along y and `along` metres along x of a roof or z of a facade."""

    def __init__(self, name, facade, across, along, sky, pane=unglazed, what=""):
        self.name, self.facade, self.across, self.along = name, facade, across, along
        self.sky, self.pane, self.what = sky, pane, what

    def seen(self, c_deg, gamma_deg):
        """Towards where light comes from that travels in a direction of the table, and the cosine of its incidence."""
        c, gamma = math.radians(c_deg), math.radians(gamma_deg)
        x, y, z = -math.sin(gamma) * math.cos(c), -math.sin(gamma) * math.sin(c), math.cos(gamma)
        if gamma_deg == 90:
            z = 0.0
        if not self.facade:
            return (x, y, z), z
        rise = 0.0 if c_deg in (90, 270) else -x
        if gamma_deg == 0:              # straight in from the horizon, above it or below it by the plane's side
            rise = 0.0 if c_deg <= 90 or c_deg >= 270 else -1e-9
        return (z, y, rise), z

    def intensity(self, c_deg, gamma_deg):
        towards, cosine = self.seen(c_deg, gamma_deg)
        if cosine == 0:
            return 0.0
        return self.sky.luminance(towards) * self.across * self.along * cosine * self.pane(cosine)

    def angles(self):
        """The table's planes and angles; those that the sun lies in are among them."""
        clear = self.sky.kind == 12
        if not self.facade:
            return (evenly(180, 2.5), evenly(90, 1)) if clear else ([0], evenly(90, .25))
        if not clear:
            return sorted(evenly(180, 2.5) + [90.001]), evenly(90, 1)
        x, y, z = self.sky.sun
        c, gamma = math.degrees(math.atan2(-y, z)) % 360, math.degrees(math.acos(x))
        return sorted(evenly(360, 2.5) + [90.001, 269.999, round(c, 6)]), sorted(evenly(90, 1) + [round(gamma, 6)])

    def write(self):
        planes, gammas = self.angles()
        lines = [
            "IESNA:LM-63-2002",
            "[TEST] made up by analytic/make_openings.py, not a measurement",
            "[TESTLAB] none",
            "[ISSUEDATE] 2026-11-26",
            "[MANUFAC] none",
            f"[LUMCAT] {self.name}",
            f"[LUMINAIRE] {self.what}",
            "TILT=NONE",
            f"1 -1 1 {len(gammas)} {len(planes)} 1 2 {self.across:g} {self.along:g} 0",
            "1 1 0",
        ]
        lines += wrap([f"{g:.9g}" for g in gammas]) + wrap([f"{c:.9g}" for c in planes])
        digits = 9 if len(planes) == 1 else 6
        for c in planes:
            lines += wrap([f"{self.intensity(c, g):.{digits}g}" for g in gammas])
        with open(f"../luminaires/{self.name}.ies", "w", newline="", encoding="ascii") as file:
            file.write("\r\n".join(lines) + "\r\n")


def evenly(end, step):
    return [step * k for k in range(round(end / step) + 1)]


def wrap(words, per_line=16):
    return [" ".join(words[k:k + per_line]) for k in range(0, len(words), per_line)]


# The clear sky's sun stands off the facade's normal, so that mirrored tables are noticed; the spec turns the roof's.
UNIFORM, OVERCAST, GRADUAL = Sky(5), Sky(16), Sky(1)
OPENINGS = {o.name: o for o in (
    Opening("sky-roof-uniform-4m", False, 4, 4, UNIFORM, unglazed, "Roof opening 4 x 4 m, sky 5, uniform"),
    Opening("sky-roof-overcast-1m", False, 1, 1, OVERCAST, unglazed, "Roof opening 1 x 1 m, sky 16, overcast"),
    Opening("sky-roof-gradual-4m", False, 4, 4, GRADUAL, unglazed, "Roof opening 4 x 4 m, sky 1, overcast"),
    Opening("sky-roof-clear-1m", False, 1, 1, Sky(12), unglazed, "Roof opening 1 x 1 m, sky 12, clear"),
    Opening("sky-roof-overcast-1m-glass", False, 1, 1, OVERCAST, glass, "Roof glass 1 x 1 m, sky 16, overcast"),
    Opening("sky-roof-clear-1m-glass", False, 1, 1, Sky(12), glass, "Roof glass 1 x 1 m, sky 12, clear"),
    Opening("sky-facade-uniform-4x3m", True, 4, 3, UNIFORM, unglazed, "Facade opening 4 x 3 m, sky 5, uniform"),
    Opening("sky-facade-overcast-2x1m", True, 2, 1, OVERCAST, unglazed, "Facade opening 2 x 1 m, sky 16, overcast"),
    Opening("sky-facade-clear-2x1m", True, 2, 1, Sky(12, 45), unglazed, "Facade opening 2 x 1 m, sky 12, clear"),
    Opening("sky-facade-gradual-4x3m-glass", True, 4, 3, GRADUAL, glass, "Facade glass 4 x 3 m, sky 1, overcast"),
    Opening("sky-facade-clear-2x1m-glass", True, 2, 1, Sky(12, 45), glass, "Facade glass 2 x 1 m, sky 12, clear"),
    Opening("sky-below-overhang", True, 6, 3, OVERCAST, unglazed, "6 x 3 m below an overhang, sky 16, overcast"),
    Opening("sky-above-mask", True, 12, 4.5, OVERCAST, unglazed, "12 x 4.5 m above a mask, sky 16, overcast"),
)}


def main():
    for opening in OPENINGS.values():
        opening.write()


if __name__ == "__main__":
    main()
