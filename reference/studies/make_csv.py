"""Writes cycles-cie171-2026/cycles.csv: readings as J. Thompson published them, as a table of recorded readings.

Only Python's standard library is needed:  python3 make_csv.py   (in this folder)
"""
# Points A to J lie on the floor for case 5.2, A to F on the wall and G to J on the floor for 5.3,
# A to F on the wall and G to N on the floor for 5.9. Values are texts: their last digit is the rounding.
CASE_5_2 = "111.828 105.956 90.726 71.725 100.534 86.418 68.686 75.078 60.557 49.881"
CASE_5_3_WALL = "34.294 76.244 81.670 69.933 53.921 40.272"
CASE_5_3_FLOOR = "61.595 79.531 96.329 106.253"
# Shares in % of the horizontal illuminance outside, which is 10 000 lx in the spec: 1 % is 100 lx.
CASE_5_9 = {
    "roof-sky-1": ("35.682 31.526 26.812 22.069 17.910 14.361", "31.878 37.373 41.196 43.303 43.346 41.286 37.272 31.973"),
    "roof-sky-5": ("44.765 35.936 28.022 21.627 16.715 12.961", "26.737 30.967 33.986 35.623 35.657 33.993 30.946 26.877"),
}


def lux(percent):
    """A share of 10 000 lx, with as many digits as it was published with."""
    whole, decimals = percent.split(".")
    return f"{whole}{decimals[:2]}.{decimals[2:]}".lstrip("0")


def rows(case, meters, values):
    return [f"{case},direct_illuminance,{meters}[{k}],{value}" for k, value in enumerate(values)]


def main():
    lines = ["case,procedure,meter,value"]
    lines += rows("point", "floor", CASE_5_2.split())
    lines += rows("panel", "wall", CASE_5_3_WALL.split()) + rows("panel", "floor", CASE_5_3_FLOOR.split())
    for case, (wall, floor) in CASE_5_9.items():
        lines += rows(case, "wall", map(lux, wall.split())) + rows(case, "floor", map(lux, floor.split()))
    with open("cycles-cie171-2026/cycles.csv", "w", encoding="ascii") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
