"""An adapter that reads direct light of point luminaires rightly, boxes' shadows included, but for one bug that its argument names.

    planted.py BUG      one of BUGS, or `none`, or `noisy` for right readings with an honest standard error
    planted.py --list   the names
"""
import json
import math
import random
import sys
from bisect import bisect_right

# Each bug: what it does, and where it bites.
BUGS = {
    "factor": "everything 3 % too bright",
    "pi": "divided by pi",
    "inverse_linear": "1/d in place of 1/d^2 beyond 5 m",
    "no_cosine": "no cosine at the meter",
    "abs_cosine": "light from behind the meter counts",
    "cosine_clamp": "cosines below .05 are 0",
    "cosine_twice": "the cosine counts twice below .2",
    "unnormalised": "the normal's z component alone below the horizon",
    "c_reversed": "C planes counted the other way round",
    "c_swap": "C 90 and C 270 exchanged",
    "c_offset": "C planes turned by a step of the table",
    "c_nearest": "the nearest plane in place of interpolation",
    "c_last": "beyond the last plane but one the one before it",
    "c_half": "C above 180 read as C - 180",
    "c_fold": "C above 180 mirrored to 360 - C",
    "gamma_nearest": "the nearest gamma in place of interpolation",
    "gamma_offset": "gamma off by half a degree",
    "gamma_90": "nothing above gamma 90",
    "gamma_first": "below the table's first gamma its first value",
    "gamma_last": "above the table's last gamma its last value",
    "gamma_even": "gamma steps taken as even",
    "c_even": "steps of C taken as even",
    "odd_value": "one value off all other planes' is taken for a slip of the pen",
    "cos_interpolation": "interpolated in cos gamma",
    "peak_clamp": "intensities beyond 1e5 cd are 1e5 cd",
    "faint_zero": "intensities below .001 cd are 0",
    "zero_skip": "a zero in the table is taken as missing: its neighbour's value",
    "tilt_sign": "tilted the other way",
    "azimuth_ignored": "luminaires are not turned about z",
    "roll_ignored": "luminaires do not roll",
    "upside_down": "a luminaire upside down is read as upright",
    "same_file": "luminaires that share a table share the first one's axes",
    "fifth_lamp": "only four luminaires count",
    "same_spot": "of luminaires in one spot one counts",
    "dim_square": "lamps read by the seventh digit of their table's scale: below 1 cd doubled",
    "near_clip": "no light from nearer than .05 m",
    "far_clip": "no light from beyond 40 m",
    "near_eps": "distances grow by a millimetre",
    "shadow_none": "bodies hide nothing",
    "shadow_eps": "bodies nearer than 2 cm to the meter hide nothing",
    "shadow_thin": "bodies thinner than a centimetre hide nothing",
    "shadow_first": "only the first body hides anything",
    "shadow_inverse": "bodies above the lamp hide, too",
    "f32_far": "coordinates beyond 20 m rounded to .05 m",
    "nan_axis": "NaN on the axis",
    "crash_many": "crashes with more than four luminaires",
    "drop_meter": "leaves out the last of more than eight meters",
    "negative": "negative light from behind",
    "float_room": "a meter within 2 cm of a wall reads half",
    "intensity_far": "reads 2 % less at distances beyond 10 m",
}


def cell(angles, angle):
    if not angles[0] <= angle <= angles[-1]:
        return None
    k = min(max(bisect_right(angles, angle) - 1, 0), len(angles) - 2)
    return k, (angle - angles[k]) / (angles[k + 1] - angles[k])


def even(angles, angle):
    found = cell(angles, angle)
    if found is None:
        return None
    steps = len(angles) - 1
    x = (angle - angles[0]) / (angles[-1] - angles[0]) * steps
    k = min(int(x), steps - 1)
    return k, x - k


def inside(x, low, high):
    return max(low, min(high, x))


def rotated(bug, lamp, first):
    axes = [list(a) for a in lamp["axes"]]
    x, y, z = axes
    if bug == "same_file":
        axes = [list(a) for a in first.setdefault(json.dumps(lamp["candela"]), axes)]
    if bug == "tilt_sign" and z[2] < 1 - 1e-9:
        h = math.hypot(z[0], z[1])
        u = (z[0] / h, z[1] / h) if h > 1e-9 else (1.0, 0.0)
        def mirror(a):  # the plane at a right angle to the tilt
            s = a[0] * u[0] + a[1] * u[1]
            return [a[0] - 2 * s * u[0], a[1] - 2 * s * u[1], a[2]]
        z = mirror(z)
        y = [z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]]
        n = math.sqrt(sum(v * v for v in y)) or 1.0
        y = [v / n for v in y]
        x = [y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0]]
        axes = [x, y, z]
    if bug == "azimuth_ignored" and z[2] > 1 - 1e-9:
        axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    if bug == "roll_ignored" and z[2] < 1 - 1e-9:
        h = math.hypot(z[0], z[1])
        y = [-z[1] / h, z[0] / h, 0.0] if h > 1e-9 else [0.0, 1.0, 0.0]
        x = [y[1] * z[2] - y[2] * z[1], y[2] * z[0] - y[0] * z[2], y[0] * z[1] - y[1] * z[0]]
        axes = [x, y, z]
    if bug == "upside_down" and z[2] < -0.999:
        axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    return axes


def intensity_cd(bug, lamp, axes, ray):
    x, y, z = (sum(a * r for a, r in zip(axis, ray)) for axis in axes)
    c_deg = math.degrees(math.atan2(y, x)) % 360.0
    gamma = math.degrees(math.atan2(math.hypot(x, y), -z))
    planes, gammas, table = lamp["c_deg"], lamp["gamma_deg"], lamp["candela"]
    if bug == "nan_axis" and gamma < 1e-6:
        return math.nan
    if bug == "c_reversed":
        c_deg = (360.0 - c_deg) % 360.0
    elif bug == "c_swap":
        c_deg = (360.0 - c_deg) if abs(c_deg % 180.0 - 90.0) < 1.0 else c_deg
    elif bug == "c_offset":
        c_deg = (c_deg + (planes[1] - planes[0]) % 360.0) % 360.0
    elif bug == "c_half" and c_deg > 180.0:
        c_deg -= 180.0
    elif bug == "c_fold" and c_deg > 180.0:
        c_deg = 360.0 - c_deg
    if bug == "gamma_offset":
        gamma = inside(gamma + 0.5, gammas[0], gammas[-1]) if gammas[0] <= gamma <= gammas[-1] else gamma
    elif bug == "gamma_90" and gamma > 90.0:
        return 0.0
    elif bug == "gamma_first":
        gamma = max(gamma, gammas[0])
    elif bug == "gamma_last":
        gamma = min(gamma, gammas[-1])
    found = (even if bug == "gamma_even" else cell)(gammas, gamma)
    plane = (even if bug == "c_even" else cell)(planes, c_deg)
    if found is None or plane is None:
        return 0.0
    (g, v), (c, u) = found, plane
    if bug == "cos_interpolation":
        a, b, t = (math.cos(math.radians(angle)) for angle in (gammas[g], gammas[g + 1], gamma))
        v = (t - a) / (b - a)
    if bug == "gamma_nearest":
        v = round(v)
    if bug == "c_nearest":
        u = round(u)
    if bug == "c_last" and len(planes) > 2 and c == len(planes) - 2:
        c, u = c - 1, 1.0
    rows = [list(row) for row in table[c:c + 2]]
    if bug == "odd_value" and len(planes) > 2:
        for k, row in enumerate(rows):
            for j in range(len(row)):
                column = sorted(r[j] for r in table)
                middle = column[len(column) // 2]
                if sum(1 for x in column if x != middle) == 1:
                    row[j] = middle
    if bug == "zero_skip":
        for row in rows:
            for j in range(1, len(row)):
                row[j] = row[j] or row[j - 1]
    if bug == "peak_clamp":
        rows = [[min(x, 1e5) for x in row] for row in rows]
    if bug == "faint_zero":
        rows = [[x if x >= 1e-3 else 0.0 for x in row] for row in rows]
    along = [(1 - v) * row[g] + v * row[g + 1] for row in rows]
    candela = (1 - u) * along[0] + u * along[1]
    if bug == "dim_square" and max(max(row) for row in table) < 1.0:
        candela *= 2.0
    return candela


def hides(bug, k, body, at, lamp):
    if bug == "shadow_none" or bug == "shadow_first" and k > 0:
        return False
    low, high = body["min_m"], body["max_m"]
    if bug == "shadow_thin" and min(h - l for l, h in zip(low, high)) < 0.01:
        return False
    if bug == "shadow_eps" and math.dist(at, [inside(x, l, h) for x, l, h in zip(at, low, high)]) < 0.02:
        return False
    start, end = 0.0, 2.0 if bug == "shadow_inverse" else 1.0
    for p, q, l, h in zip(at, lamp, low, high):
        step = q - p
        if abs(step) < 1e-300:
            if not l <= p <= h:
                return False
            continue
        a, b = sorted(((l - p) / step, (h - p) / step))
        start, end = max(start, a), min(end, b)
    return start < end


def illuminance_lx(bug, job, meter):
    total, first, spots = 0.0, {}, set()
    lamps = job["luminaires"]
    if bug == "fifth_lamp":
        lamps = lamps[:4]
    at, normal = list(meter["position_m"]), meter["normal"]
    for lamp in lamps:
        place = list(lamp["position_m"])
        if bug == "f32_far":
            place = [round(x / 0.05) * 0.05 if abs(x) > 20 else x for x in place]
        if bug == "same_spot":
            if tuple(place) in spots:
                continue
            spots.add(tuple(place))
        axes = rotated(bug, lamp, first)
        if any(hides(bug, k, body, at, place) for k, body in enumerate(job["obstacles"])):
            continue
        ray = [p - q for p, q in zip(at, place)]
        square = sum(r * r for r in ray)
        d = math.sqrt(square)
        if bug == "near_clip" and d < 0.05 or bug == "far_clip" and d > 40.0:
            continue
        if bug == "near_eps":
            square = (d + 1e-3) ** 2
        if bug == "inverse_linear" and d > 5.0:
            square = 5.0 * d
        cosine = -sum(r * n for r, n in zip(ray, normal)) / d
        if bug == "unnormalised" and normal[2] < -1e-9:
            cosine *= abs(normal[2])
        if bug == "abs_cosine":
            cosine = abs(cosine)
        if bug == "no_cosine" and cosine > 0:
            cosine = 1.0
        if bug == "cosine_clamp" and cosine < 0.05:
            cosine = 0.0
        if bug == "cosine_twice" and 0 < cosine < 0.2:
            cosine *= 5 * cosine
        if bug != "negative":
            cosine = max(cosine, 0.0)
        total += cosine * intensity_cd(bug, lamp, axes, ray) / square * (0.98 if bug == "intensity_far" and d > 10 else 1)
    if bug == "factor":
        total *= 1.03
    if bug == "pi":
        total /= math.pi
    if bug == "float_room" and job["room"]:
        if min(min(x, s - x) for x, s in zip(at, job["room"]["size_m"])) < 0.02:
            total *= 0.5
    return total


def answer(bug, job):
    if job["light"] != "direct":
        return {"declined": "direct light only"}
    if any("min_m" not in body for body in job["obstacles"]):
        return {"declined": "boxes alone"}
    if any(lamp["model"] != "point" for lamp in job["luminaires"]):
        return {"declined": "points alone"}
    if bug == "crash_many" and len(job["luminaires"]) > 4:
        sys.exit("too many luminaires")
    noise = random.Random(f"{job['seed']} {job['procedure']}") if bug.startswith("noisy") else None
    samples, error = 16, 4e-3
    readings = []
    for meter in job["meters"]:
        lux = illuminance_lx("none" if bug == "noisy" else bug.removeprefix("noisy-"), job, meter)
        reading = {"meter": meter["id"], "illuminance_lx": lux, "error_bound_lx": 1e-9 * abs(lux)}
        if noise and lux > 0:
            blocks = [lux * (1 + error * noise.gauss(0, 1)) for _ in range(samples)]
            mean = sum(blocks) / samples
            spread = math.sqrt(sum((b - mean) ** 2 for b in blocks) / (samples - 1) / samples)
            reading = {"meter": meter["id"], "illuminance_lx": mean, "std_error_lx": spread, "degrees_of_freedom": samples - 1}
        readings.append(reading)
    if bug == "drop_meter" and len(readings) > 8:
        readings.pop()
    return {"readings": readings}


def reply(bug, request):
    if request["verb"] == "probe":
        return {"protocol": 2, "name": f"planted {bug}", "version": "1", "capabilities": ["obstacles"]}
    return {"answers": [{"job": job["job"], **answer(bug, job)} for job in request["jobs"]]}


if __name__ == "__main__":
    if sys.argv[1] == "--list":
        print("\n".join(BUGS))
    else:
        json.dump(reply(sys.argv[1], json.load(sys.stdin)), sys.stdout)
