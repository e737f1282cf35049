"""Remakes cachet-reconstructed.ies: the smoothest intensity table that agrees with what was published of the luminaire.

The manufacturer's file of the Ledalite Cachet 8913H01 is not public. This program finds, among all tables on a grid of
five C planes and 5 degree steps, the one of least curvature that meets
 - Table 1 of the paper (../published/cachet.yaml), column "IES file": C = 0 at seven angles, exactly;
 - Table 2, column "inverse square", read backwards: I = E d^3 / h towards three points of the ceiling plane, exactly;
 - Table 3, column "lum1", in the least-squares sense: illuminance of the work plane by light reflected one to seven
   times, as a linear function of the table (radiosity of the 20 m cube with 1 m patches, run back from the points).
So Tables 1 and 2 and Table 3's lum1 are put in: that a renderer reproduces them from this table shows consistency,
not proof.

Only Python's standard library is needed:  python3 reconstruct_cachet.py > cachet-reconstructed.ies   (about 20 s)
"""
import math
import sys

SIDE, N = 20.0, 20                      # the room is a cube; patches along its edge
RHO = (0.2, 0.8, 0.5, 0.5, 0.5, 0.5)    # z-, z+, x-, x+, y-, y+
LUMINAIRE = (10.0, 10.0, 10.0)
BOUNCES = 7
PLANES = [0.0, 22.5, 45.0, 67.5, 90.0]
GAMMAS = [90.0 + 5.0 * k for k in range(19)]
DARK = [0.0, 89.9]                      # stated zeros, so that no reader of the file extrapolates downwards
TABLE_1 = {90: 4.5, 95: 35.7, 115: 218.3, 135: 421.6, 155: 576.4, 175: 662.3, 180: 664.4}
TABLE_2 = [((2, 2), 2.70), ((2, 10), 2.24), ((10, 2), 6.91)]    # lx at z = 17, facing down
TABLE_3 = [((2, 2), 1.98), ((2, 10), 2.48), ((10, 2), 2.45), ((10, 10), 3.06)]  # lx at z = 2, facing up
SIGMA_LX = 0.005                        # half a unit in the last digit of Table 3
# How much the curvature weighs against Table 3, and that along C (steps of 22.5 degrees) against that along gamma (5).
CURVATURE_CD, C_WEIGHT = 150.0, 0.1
# The opening: a rectangle of 0.24536 m2 with the length of a 4 ft pendant; flat, so that it radiates from one plane.
LENGTH_M, WIDTH_M = 1.2268, 0.2         # along C0-C180 (the lamps' axis) and along C90-C270


def main():
    unknowns = len(PLANES) * len(GAMMAS)
    exact = [({node(0, g): 1.0}, value) for g, value in TABLE_1.items()]
    # One value at the zenith, and Table 1's horizon for every plane: the paper says nothing of the others there.
    for p in range(1, len(PLANES)):
        exact += [({node(p, 180): 1.0}, TABLE_1[180]), ({node(p, 90): 1.0}, TABLE_1[90])]
    for (x, y), lux in TABLE_2:
        candela = lux * math.dist((x, y, 17), LUMINAIRE) ** 3 / 7.0
        exact.append((towards((x, y, 17)), candela))
    soft = curvature()
    readings = [(indirect_weights((x, y, 2.0)), lux) for (x, y), lux in TABLE_3]
    for weights, lux in readings:
        soft.append(({k: w / SIGMA_LX for k, w in weights.items()}, lux / SIGMA_LX))
    table = least_squares(unknowns, soft, exact)
    if min(table) < 0.0:
        raise SystemExit("the smoothest table is negative somewhere; give the curvature another weight")
    table = [round(v, 1) for v in table]
    for (weights, lux), ((x, y), _) in zip(readings, TABLE_3):
        value = sum(w * table[k] for k, w in weights.items())
        print(f"({x}, {y}, 2): paper {lux:.2f}, from the table {value:.4f} lx", file=sys.stderr)
    for (x, y), lux in TABLE_2:
        value = sum(w * table[k] for k, w in towards((x, y, 17)).items()) * 7.0 / math.dist((x, y, 17), LUMINAIRE) ** 3
        print(f"({x}, {y}, 17): paper {lux:.2f}, from the table {value:.4f} lx", file=sys.stderr)
    print(f"flux {flux(table):.1f} lm, all upward", file=sys.stderr)
    sys.stdout.write(lm63(table))


def node(plane, gamma):
    return plane * len(GAMMAS) + GAMMAS.index(float(gamma))


def spread(c, gamma):
    """Bilinear weights of the nodes round a direction above the horizon, any C, degrees."""
    c = c % 360.0
    c = min(c, 360.0 - c)
    c = min(c, 180.0 - c)
    s, t = c / 22.5, (gamma - 90.0) / 5.0
    p, g = min(int(s), len(PLANES) - 2), min(int(t), len(GAMMAS) - 2)
    s, t = s - p, t - g
    k = p * len(GAMMAS) + g
    above = k + len(GAMMAS)
    weights = {k: (1 - s) * (1 - t), k + 1: (1 - s) * t, above: s * (1 - t), above + 1: s * t}
    return {j: w for j, w in weights.items() if w}


def towards(point):
    dx, dy, dz = (point[a] - LUMINAIRE[a] for a in range(3))
    return spread(math.degrees(math.atan2(dy, dx)), math.degrees(math.atan2(math.hypot(dx, dy), -dz)))


def curvature():
    """Second differences along gamma and along C, mirrored at C0 and C90 and across the zenith; candela."""
    rows = []
    n, last = len(GAMMAS), len(PLANES) - 1
    for p in range(last + 1):
        for g in range(1, n):
            k = p * n + g
            up = k + 1 if g + 1 < n else k - 1
            row = {}
            for j, w in ((k - 1, 1.0), (k, -2.0), (up, 1.0)):
                row[j] = row.get(j, 0.0) + w
            rows.append(({k: w / CURVATURE_CD for k, w in row.items()}, 0.0))
        for g in range(1, n - 1):
            k, weight = p * n + g, C_WEIGHT * math.sin(math.radians(GAMMAS[g])) ** 2
            before = k - n if p > 0 else k + n
            after = k + n if p < last else k - n
            row = {}
            for j, w in ((before, 1.0), (k, -2.0), (after, 1.0)):
                row[j] = row.get(j, 0.0) + w * weight
            rows.append(({k: w / CURVATURE_CD for k, w in row.items()}, 0.0))
    return rows


def indirect_weights(point):
    """Illuminance facing up at `point` by light reflected once to BOUNCES times, per candela of every node."""
    importance = reflected_importance(point)
    weights = {}
    steps_c, step = 144, 1.0
    for a in range(steps_c):
        c = (a + 0.5) * 360.0 / steps_c
        for b in range(90):
            gamma = 90.0 + (b + 0.5) * step
            band = math.cos(math.radians(gamma - step / 2)) - math.cos(math.radians(gamma + step / 2))
            w = 2 * math.pi / steps_c * band * importance[patch_hit(c, gamma)] / (SIDE / N) ** 2
            for k, share in spread(c, gamma).items():
                weights[k] = weights.get(k, 0.0) + w * share
    return weights


def patch_hit(c, gamma):
    sin_g = math.sin(math.radians(gamma))
    direction = (sin_g * math.cos(math.radians(c)), sin_g * math.sin(math.radians(c)), -math.cos(math.radians(gamma)))
    distance = min(((SIDE if d > 0 else 0.0) - p) / d if d else math.inf for p, d in zip(LUMINAIRE, direction))
    hit = [p + distance * d for p, d in zip(LUMINAIRE, direction)]
    axis = max(range(3), key=lambda k: abs(hit[k] - SIDE / 2))
    return patch(axis, hit[axis] > SIDE / 2, *(min(int(hit[k] / SIDE * N), N - 1) for k in others(axis)))


def others(axis):
    return ((1, 2), (0, 2), (0, 1))[axis]


def patch(axis, far, i, j):
    face = {2: 0, 0: 2, 1: 4}[axis] + bool(far)
    return (face * N + i) * N + j


def reflected_importance(point):
    """Lux at the point per lux of first illuminance of each patch: rho (1 + F rho + ... (F rho)^6) k, F symmetric."""
    k = seen_from(point)
    total, term = k[:], k
    for _ in range(BOUNCES - 1):
        term = exchange([RHO[i // (N * N)] * v for i, v in enumerate(term)])
        total = [a + b for a, b in zip(total, term)]
    return [RHO[i // (N * N)] * v for i, v in enumerate(total)]


def seen_from(point):
    """Configuration factors of every patch seen from an upward element, differences of closed forms."""
    x, y, z = point
    k = [0.0] * (6 * N * N)
    h, d = SIDE / N, SIDE - z
    ceiling = lambda a, b: parallel(a, b, d)
    walls = ((0, 0, x, y), (0, 1, SIDE - x, y), (1, 0, y, x), (1, 1, SIDE - y, x))
    for i in range(N):
        for j in range(N):
            k[patch(2, True, i, j)] = difference(ceiling, i * h - x, i * h + h - x, j * h - y, j * h + h - y)
            if (j + 1) * h > z:
                low, high = max(j * h, z) - z, (j + 1) * h - z
                for axis, far, distance, along in walls:
                    k[patch(axis, far, i, j)] = difference(
                        lambda a, b, d=distance: upright(a, b, d), i * h - along, i * h + h - along, low, high)
    return k


def difference(corner, a0, a1, b0, b1):
    return corner(a1, b1) - corner(a0, b1) - corner(a1, b0) + corner(a0, b0)


def parallel(a, b, d):
    """Rectangle a x b parallel to the element at distance d, one corner on its normal; odd in a and b."""
    p, q = math.sqrt(d * d + a * a), math.sqrt(d * d + b * b)
    return (a / p * math.atan(b / p) + b / q * math.atan(a / q)) / (2 * math.pi)


def upright(a, b, d):
    """Rectangle of width a and height b above the element's plane, perpendicular to it at distance d; odd in a."""
    q = math.sqrt(d * d + b * b)
    return (math.atan(a / d) - d / q * math.atan(a / q)) / (2 * math.pi)


def exchange(value):
    """F v by the closed factor from the centre of each patch; equal areas make F symmetric up to discretisation."""
    n = N
    if not FACTORS:
        FACTORS["parallel"] = [[difference(lambda a, b: parallel(a, b, n), i - 0.5, i + 0.5, j - 0.5, j + 0.5)
                                for j in range(n)] for i in range(n)]
        # [distance of the element from the common edge][offset along it][height of the patch]
        FACTORS["upright"] = [[[difference(lambda a, b: upright(a, b, e + 0.5), i - 0.5, i + 0.5, float(j), j + 1.0)
                                for j in range(n)] for i in range(n)] for e in range(n)]
    opposite, corner = FACTORS["parallel"], FACTORS["upright"]
    face = [[value[(f * n + i) * n:(f * n + i) * n + n] for i in range(n)] for f in range(6)]
    out = [0.0] * len(value)
    for f in range(6):
        axis = (2, 2, 0, 0, 1, 1)[f]
        ours = others(axis)
        for i in range(n):
            for j in range(n):
                at = {ours[0]: i, ours[1]: j}
                total = 0.0
                other = face[f ^ 1]
                for a in range(n):
                    row, source = opposite[abs(a - i)], other[a]
                    total += sum(map(lambda b: row[abs(b - j)] * source[b], RANGE))
                for g in range(6):
                    if g // 2 == f // 2:
                        continue
                    axis_g = (2, 2, 0, 0, 1, 1)[g]
                    edge = 3 - axis - axis_g
                    from_edge = at[axis_g] if g % 2 == 0 else n - 1 - at[axis_g]
                    table = corner[from_edge]
                    theirs = others(axis_g)
                    for a in range(n):
                        row = table[abs(a - at[edge])]
                        if theirs[0] == edge:
                            source = face[g][a]
                        else:
                            source = [face[g][b][a] for b in RANGE]
                        if f % 2:
                            source = source[::-1]
                        total += sum(map(float.__mul__, row, source))
                out[(f * n + i) * n + j] = total
    return out


RANGE = range(N)
FACTORS = {}


def least_squares(n, soft, exact):
    """Minimises the sum of squared soft rows under the exact rows, by the normal equations with multipliers."""
    m = n + len(exact)
    a = [[0.0] * (m + 1) for _ in range(m)]
    for row, value in soft:
        for i, u in row.items():
            for j, v in row.items():
                a[i][j] += u * v
            a[i][m] += u * value
    for e, (row, value) in enumerate(exact):
        for i, u in row.items():
            a[i][n + e] += u
            a[n + e][i] += u
        a[n + e][m] = value
    for k in range(m):
        pivot = max(range(k, m), key=lambda r: abs(a[r][k]))
        a[k], a[pivot] = a[pivot], a[k]
        for r in range(k + 1, m):
            factor = a[r][k] / a[k][k]
            if factor:
                a[r] = [u - factor * v for u, v in zip(a[r], a[k])]
    x = [0.0] * m
    for k in reversed(range(m)):
        x[k] = (a[k][m] - sum(a[k][j] * x[j] for j in range(k + 1, m))) / a[k][k]
    return x[:n]


def flux(table):
    """Lumens, exact for linear interpolation in gamma and trapezoids in C."""
    n, total = len(GAMMAS), 0.0
    mean = [sum(w * table[p * n + g] for p, w in enumerate((1, 2, 2, 2, 1))) / 8 for g in range(n)]
    for g in range(n - 1):
        a, b = math.radians(GAMMAS[g]), math.radians(GAMMAS[g + 1])
        slope = (mean[g + 1] - mean[g]) / (b - a)
        total += mean[g] * math.cos(a) - mean[g + 1] * math.cos(b) + slope * (math.sin(b) - math.sin(a))
    dark = math.radians(DARK[-1])
    return 2 * math.pi * (total + 0.5 * mean[0] * (math.pi / 2 - dark))


def lm63(table):
    angles = DARK + GAMMAS
    lines = [
        "IESNA:LM-63-2002",
        "[TEST] RECONSTRUCTION, not a measurement: made by reconstruct_cachet.py",
        "[TESTLAB] none",
        "[ISSUEDATE] 2026-11-21",
        "[MANUFAC] none (after published data of the Ledalite Cachet 8913H01)",
        "[LUMCAT] cachet-reconstructed",
        "[LUMINAIRE] Pendant uplight, smoothest table that meets the published values",
        "[OTHER] Exact: Table 1 column IES file (C 0) and Table 2 column inverse square of the paper",
        "[MORE] Simulation of Luminaires in Radiance: Verification Method; fitted: Table 3 column lum1.",
        "[MORE] All else is interpolation. The opening is a rectangle of 0.24536 m2, chosen by us.",
        "TILT=NONE",
        f"1 -1 1 {len(angles)} {len(PLANES)} 1 2 {WIDTH_M} {LENGTH_M} 0",
        "1 1 0",
    ]
    lines += wrap([f"{g:g}" for g in angles]) + wrap([f"{c:g}" for c in PLANES])
    n = len(GAMMAS)
    for p in range(len(PLANES)):
        lines += wrap(["0"] * len(DARK) + [f"{v:g}" for v in table[p * n:p * n + n]])
    return "\r\n".join(lines) + "\r\n"


def wrap(words, per_line=11):
    return [" ".join(words[k:k + per_line]) for k in range(0, len(words), per_line)]


if __name__ == "__main__":
    main()
