"""Where the points of CIE 171:2006 lie, cases 5.9 to 5.14, in the rooms of the specs beside this file. World axes, z up.

The room of all cases is 4 x 4 x 3 m and stands free in a larger black one, so that no meter lies on a surface. A to F
go down the middle of the wall, G to N lead away from it over the floor, O to V over the ceiling. The sun stands at 60
degrees, straight before the wall of A to F: before the facade, that is, where there is one.
"""
SUN_ZENITH_DEG = 30.0
UP, DOWN = (0, 0, 1), (0, 0, -1)
HEIGHTS = (2.75, 2.25, 1.75, 1.25, .75, .25)
DEPTHS = (.25, .75, 1.25, 1.75, 2.25, 2.75, 3.25, 3.75)
OVERHANG, MASK = (7.2, 4, 4.5), (12.2, 15, 19.5)        # centres of the luminaires at the masks' edges
# Of every variant: its case, whether it is upright, and how wide (y) and how long (x of a roof, z of a facade) it is.
VARIANTS = {
    "5.9-1m": ("roof", 1, 1), "5.9-4m": ("roof", 4, 4), "5.10-1m": ("roof", 1, 1), "5.10-4m": ("roof", 4, 4),
    "5.11-2x1m": ("facade", 2, 1), "5.11-4x3m": ("facade", 4, 3),
    "5.12-2x1m": ("facade", 2, 1), "5.12-4x3m": ("facade", 4, 3),
    "5.13-2x1m": ("overhang", 8, 6), "5.14-2x1m": ("mask", 30, 30),
}


def case_of(variant):
    return variant.split("-")[0]


def has_glass(variant):
    return case_of(variant) in ("5.10", "5.12")


def points(kind):
    """Letter, place and direction of every point."""
    if kind == "roof":
        wall = [((4, 2, .5 + z), (0, 1, 0)) for z in HEIGHTS]
        return dict(zip("ABCDEFGHIJKLMN", wall + [((4, 2 + d, .5), UP) for d in DEPTHS]))
    x, y, z = {"facade": (4, 4, .5), "overhang": (2, 4, 5.5), "mask": (2, 15, 1.5)}[kind]
    wall = [((x, y, z + h), (1, 0, 0)) for h in HEIGHTS]
    floor, ceiling = [((x + d, y, z), UP) for d in DEPTHS], [((x + d, y, z + 3), DOWN) for d in DEPTHS]
    if kind == "mask":      # black like the ground before it: nothing shines on the ceiling
        ceiling = []
    return dict(zip("ABCDEFGHIJKLMNOPQRSTUV", wall + floor + ceiling))
