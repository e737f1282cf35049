"""Random rooms as specs: any size, many or few luminaires, bodies, meters, tolerances. `rooms.py SEED COUNT FOLDER [PROCEDURE]` writes them."""
import math, os, random, sys

LUMINAIRES = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../reference/luminaires")
TABLES = {"point": ["axial", "isotropic", "lambertian-point", "cachet-reconstructed"], "area": ["lambertian-06m", "lambertian-1m"]}


def magnitude(draw, low, high):
    """Evenly in the logarithm."""
    return math.exp(draw.uniform(math.log(low), math.log(high)))


def boxes(draw, size, count):
    found = []
    for _ in range(8 * count):
        if len(found) == count:
            break
        extent = [draw.uniform(0.2, 1.8), draw.uniform(0.2, 1.2), draw.uniform(0.2, min(2.0, size[2] - 1.2))]
        if any(e > s - 0.3 for e, s in zip(extent, size)):
            continue
        low = [draw.uniform(0.1, s - e - 0.1) for s, e in zip(size, extent)]
        low[2] = 0.0 if draw.random() < 0.7 else draw.uniform(0.1, 0.4)
        high = [a + b for a, b in zip(low, extent)]
        if all(any(a > d + 0.01 or b < c - 0.01 for a, b, c, d in zip(low, high, *other)) for other in found):
            found.append((low, high))
    return found


def inside(point, body):
    return all(a - 0.02 <= x <= b + 0.02 for x, a, b in zip(point, *body))


def numbers(values):
    return "[" + ", ".join(f"{v:.4f}" for v in values) + "]"


def spec(seed, procedure=None):
    draw = random.Random(seed)
    side = magnitude(draw, 2.5, 25)
    size = [side, side * draw.uniform(0.5, 1.6), draw.uniform(2.4, min(9, 2.6 + side / 2))]
    rho = {k: draw.uniform(0.05, 0.85) for k in ("floor", "walls", "ceiling")}
    bodies = boxes(draw, size, draw.choice([0, 0, 1, 2, 3, 5, 8]))
    kinds = draw.choice([["point"], ["point"], ["area"], ["point", "area"]])
    luminaires, places = [], []
    for k in range(round(magnitude(draw, 1, 20))):
        kind = draw.choice(kinds)
        at = [draw.uniform(0.1 * s, 0.9 * s) for s in size[:2]]
        flush = kind == "area" and draw.random() < 0.5
        at.append(size[2] - (0 if flush else draw.uniform(0.2, 0.8)))
        # Openings do not overlap.
        if any(math.dist(at[:2], other[:2]) < 1.5 for other in places) or any(inside(at, b) for b in bodies):
            continue
        if kind == "area" and min(min(x, s - x) for x, s in zip(at[:2], size)) < 0.75:
            continue
        places.append(at)
        tilt = draw.uniform(0, 60) if kind == "point" and draw.random() < 0.3 else 0
        luminaires.append(f"  - {{id: l{k}, photometry: {LUMINAIRES}/{draw.choice(TABLES[kind])}.ies, at_m: {numbers(at)}, "
                          f"rotate_deg: {{azimuth: {draw.uniform(0, 360) if kind == 'point' else 0:.1f}, tilt: {tilt:.1f}, roll: 0}}, model: {kind}}}")
    if not luminaires:
        at = [0.5 * size[0], 0.5 * size[1], size[2] - 0.3]
        luminaires.append(f"  - {{id: l, photometry: {LUMINAIRES}/isotropic.ies, at_m: {numbers(at)}, model: point}}")
    meters = []
    for _ in range(round(magnitude(draw, 1, 120))):
        at = [draw.uniform(0.1, s - 0.1) for s in size[:2]] + [draw.choice([0.75, draw.uniform(0.05, size[2] - 1.0)])]
        if not any(inside(at, b) for b in bodies):
            meters.append(numbers(at))
    meters = meters or [numbers([0.05, 0.05, 0.05])]
    procedure = procedure or draw.choice(["direct", "indirect", "indirect", "total", "total"])
    lines = ["luxproof: 1", f'title: "random room {seed}"',
             f"room: {{size_m: {numbers(size)}, reflectance: {{floor: {rho['floor']:.3f}, walls: {rho['walls']:.3f}, ceiling: {rho['ceiling']:.3f}}}}}"]
    if bodies:
        lines.append("obstacles:")
        lines += [f"  - box: {{min_m: {numbers(a)}, max_m: {numbers(b)}, reflectance: {draw.uniform(0.1, 0.8):.3f}}}" for a, b in bodies]
    lines += ["luminaires:", *luminaires, "meters:", f"  some: {{points_m: [{', '.join(meters)}], normal: [0, 0, {draw.choice([1, 1, 1, -1])}]}}",
              "procedures:", f"  {procedure}_illuminance: {{meters: some}}",
              f"budget: {{relative_error: {magnitude(draw, 0.003, 0.05):.4f}, seconds: {magnitude(draw, 8, 40):.0f}}}"]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    first, count, folder = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    os.makedirs(folder, exist_ok=True)
    for k in range(first, first + count):
        with open(f"{folder}/room{k}.yaml", "w") as f:
            f.write(spec(k, sys.argv[4] if len(sys.argv) > 4 else None))
