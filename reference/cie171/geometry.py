"""Where the points of CIE 171:2006 lie, cases 5.9 to 5.14, in the rooms of the specs beside this file. World axes, z up.

The room of all cases is 4 x 4 x 3 m and stands free in a larger black one, so that no meter lies on a surface. A to F
go down the middle of the wall, G to N lead away from it over the floor, O to V over the ceiling. The sun stands at 60
degrees, straight before the wall of A to F: before the facade, that is, where there is one.

Cases named `aside` have points to the left and right of that middle, and a sun or an opening that is turned. Cases named
`far` have points in that middle that stay away from a large opening.
"""
SUN_ZENITH_DEG = 30.0
UP, DOWN = (0, 0, 1), (0, 0, -1)
HEIGHTS = (2.75, 2.25, 1.75, 1.25, .75, .25)
DEPTHS = (.25, .75, 1.25, 1.75, 2.25, 2.75, 3.25, 3.75)
# Where luminaires stand that end at a mask's edge: their x, their middle's y, and the z of the edge. One hangs below
# the edge of the overhang, one stands on that of the mask.
OVERHANG, MASK = (7.2, 4, 7.5), (12.2, 15, 4.5)
# Of every variant: its case, whether it is upright, and how wide (y) and how long (x of a roof, z of a facade) it is.
VARIANTS = {
    "5.9-1m": ("roof", 1, 1), "5.9-4m": ("roof", 4, 4), "5.10-1m": ("roof", 1, 1), "5.10-4m": ("roof", 4, 4),
    "5.11-2x1m": ("facade", 2, 1), "5.11-4x3m": ("facade", 4, 3),
    "5.12-2x1m": ("facade", 2, 1), "5.12-4x3m": ("facade", 4, 3),
    "5.13-2x1m": ("overhang", 8, 6), "5.14-2x1m": ("mask", 30, 30),
}
# Of every case aside: its shape and sizes as above, the sky, and the azimuth of the sun (from x to y) in degrees. The
# opening of a roof is turned by it too.
ASIDE = {
    "5.9-aside": ("roof", 1, 1, 12, 30), "5.10-aside": ("roof", 1, 1, 12, 30),
    "5.11-aside": ("facade", 2, 1, 12, 45), "5.12-aside": ("facade", 2, 1, 12, 45),
    "5.13-aside": ("overhang", 6, 3, 16, 0), "5.14-aside": ("mask", 12, 4.5, 16, 0),
}
# Of every case far: its shape and sizes, and the skies.
FAR = {"5.9-far": ("roof", 4, 4, (1, 5)), "5.11-far": ("facade", 4, 3, (5,)), "5.12-far": ("facade", 4, 3, (1,))}


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


def aside_points(kind):
    """Place and direction of every point of a case aside."""
    in_x, in_y, out_x, out_y = (1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)
    if kind == "roof":
        walls = [((4, 2, 2.5), in_y), ((4, 6, 2.5), out_y), ((2, 4, 1), in_x), ((6, 4, 1), out_x)]
        return walls + [((x, y, .5), UP) for x in (2.5, 5.5) for y in (2.5, 5.5)]
    if kind == "facade":
        level = [((7, 3.5, .5), UP), ((7, 5, .5), UP), ((7, 3, 3.5), DOWN), ((7, 5, 3.5), DOWN)]
        return level + [((4, 3, 1), in_x), ((4, 5, 1), in_x), ((6, 2, 1.5), in_y), ((6, 6, 1.5), out_y)]
    if kind == "overhang":
        wall = [((2, 4, z), in_x) for z in (6, 7, 8)] + [((4, 2, 7), in_y)]
        return wall + [((4.5, 4, 5.5), UP), ((3, 3, 5.5), UP), ((4.5, 4, 8.5), DOWN), ((3, 5, 8.5), DOWN)]
    wall = [((2, 15, z), in_x) for z in (1.75, 2.25)] + [((2.5, 13, 2.5), in_y)]
    return wall + [((4, 15, 1.5), UP), ((3, 15, 1.5), UP), ((3, 14, 1.5), UP)]


def far_points(kind):
    """Place and direction of every point of a case far: at least half a metre from a large opening."""
    in_x, in_y = (1, 0, 0), (0, 1, 0)
    if kind == "roof":
        return [((4, 2, z), in_y) for z in (3, 2.5, 2, 1.5, 1)] + [((4, 2 + y, .5), UP) for y in (.25, .75, 1.75)]
    back = [((4, 4, z), in_x) for z in (.5, 2, 3.5)]
    return back + [((x, 4, z), normal) for z, normal in ((.5, UP), (3.5, DOWN)) for x in (7.5, 6.5, 5.5)]


def middle_z(kind, along):
    """The height of the middle of a luminaire at a mask's edge."""
    return OVERHANG[2] - along / 2 if kind == "overhang" else MASK[2] + along / 2
