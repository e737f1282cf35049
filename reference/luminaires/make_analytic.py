"""Writes the made-up luminaires of the analytic cases: Lambertian panels, an isotropic point, a spot that lights evenly, and one that glares.

Tables are linear between their angles in every engine, so that each is given where a case reads it, and finely enough
that between its angles it strays at most 4e-5 (1 degree of a cosine) or 2e-5 (0.25 degrees of the spot) from its law.

Only Python's standard library is needed:  python3 make_analytic.py   (in this folder)
"""
import math

AXIAL_CD = 1000.0                       # of every Lambertian luminaire
ISOTROPIC_LM = 10000.0
GLARE_CD, GLARE_DEG = 200.0, 30.0
SPOT_LUX, SPOT_HEIGHT_M = 1000.0, 2.5   # the spot lights the plane this far below it evenly
SPOT_RADII_M = {"even-spot-1m.ies": 1.0, "even-spot-15dm.ies": 1.5}


def main():
    # The offsets of CIE 171:2006-type case 5.2, 3 m below the source, so that its readings need no interpolation.
    offsets = [math.hypot(x, y) for x in (0, 0.5, 1, 1.5) for y in (0, 0.5, 1, 1.5)]
    exact = {math.degrees(math.atan2(r, 3.0)) for r in offsets}
    gammas = sorted({float(g) for g in range(91)} | {round(g, 9) for g in exact})
    lambertian = [(g, AXIAL_CD * math.cos(math.radians(g)) if g < 90 else 0.0) for g in gammas] + [(180.0, 0.0)]
    for name, side_m in (("lambertian-point.ies", 0), ("lambertian-06m.ies", 0.6), ("lambertian-1m.ies", 1),
                         ("lambertian-2m.ies", 2)):
        what = f"Lambertian {side_m} x {side_m} m panel" if side_m else "Lambertian point"
        write(name, f"{what}, {AXIAL_CD:g} cd on axis, dark backwards", lambertian, side_m)
    candela = ISOTROPIC_LM / (4 * math.pi)
    write("isotropic.ies", f"Isotropic point, {ISOTROPIC_LM:g} lm", [(0.0, candela), (180.0, candela)], 0)
    # It shines on an eye and on nothing that reflects.
    glare = [(0.0, GLARE_CD), (GLARE_DEG, GLARE_CD), (GLARE_DEG + 1e-4, 0.0), (180.0, 0.0)]
    write("glare-10cm.ies", f"Opening of 0.1 x 0.1 m, {GLARE_CD:g} cd within {GLARE_DEG:g} degrees, sharp edge", glare, 0.1)
    for name, radius_m in SPOT_RADII_M.items():
        edge = math.degrees(math.atan2(radius_m, SPOT_HEIGHT_M))
        gammas = [0.25 * k for k in range(int(edge / 0.25) + 1)] + [edge]
        table = [(g, SPOT_LUX * SPOT_HEIGHT_M ** 2 / math.cos(math.radians(g)) ** 3) for g in gammas]
        table += [(edge + 1e-4, 0.0), (180.0, 0.0)]
        what = f"Point spot: {SPOT_LUX:g} lx on a disc of radius {radius_m:g} m, {SPOT_HEIGHT_M:g} m below, sharp edge"
        write(name, what, table, 0)


def write(name, what, table, side_m):
    lines = [
        "IESNA:LM-63-2002",
        "[TEST] made up by make_analytic.py, not a measurement",
        "[TESTLAB] none",
        "[ISSUEDATE] 2026-11-21",
        "[MANUFAC] none",
        f"[LUMCAT] {name.removesuffix('.ies')}",
        f"[LUMINAIRE] {what}",
        "TILT=NONE",
        f"1 -1 1 {len(table)} 1 1 2 {side_m:g} {side_m:g} 0",
        "1 1 0",
    ]
    lines += wrap([f"{g:.9g}" for g, _ in table]) + ["0"] + wrap([f"{i:.10g}" for _, i in table])
    with open(name, "w", newline="", encoding="ascii") as file:
        file.write("\r\n".join(lines) + "\r\n")


def wrap(words, per_line=10):
    return [" ".join(words[k:k + per_line]) for k in range(0, len(words), per_line)]


if __name__ == "__main__":
    main()
