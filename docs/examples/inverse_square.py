"""An adapter for luxproof: direct light of point luminaires by the inverse-square law, from the table in the job."""
import json
import math
import sys
from bisect import bisect_right


def cell(angles, angle):
    """The interval that holds an angle, and how far into it the angle lies (0 to 1); None outside the table."""
    if not angles[0] <= angle <= angles[-1]:
        return None
    k = min(max(bisect_right(angles, angle) - 1, 0), len(angles) - 2)
    return k, (angle - angles[k]) / (angles[k + 1] - angles[k])


def intensity_cd(lamp, ray):
    """Bilinear in (C, gamma); gamma counts from the nadir, the luminaire's own -z."""
    x, y, z = (sum(a * r for a, r in zip(axis, ray)) for axis in lamp["axes"])
    c_deg = math.degrees(math.atan2(y, x)) % 360.0
    gamma = cell(lamp["gamma_deg"], math.degrees(math.atan2(math.hypot(x, y), -z)))
    plane = cell(lamp["c_deg"], c_deg)
    if gamma is None or plane is None:
        return 0.0
    (g, v), (c, u) = gamma, plane
    along = [(1 - v) * row[g] + v * row[g + 1] for row in lamp["candela"][c:c + 2]]
    return (1 - u) * along[0] + u * along[1]


def illuminance_lx(lamps, meter):
    total = 0.0
    for lamp in lamps:
        ray = [p - q for p, q in zip(meter["position_m"], lamp["position_m"])]
        square = sum(r * r for r in ray)
        cosine = -sum(r * n for r, n in zip(ray, meter["normal"])) / math.sqrt(square)
        total += max(cosine, 0.0) * intensity_cd(lamp, ray) / square
    return total


def answer(job):
    if job["light"] != "direct":
        return {"declined": "the inverse-square law knows direct light only"}
    if job["obstacles"]:
        return {"declined": "the inverse-square law knows no shadows"}
    if any(lamp["model"] != "point" for lamp in job["luminaires"]):
        return {"declined": "the inverse-square law is one of points"}
    readings = []
    for meter in job["meters"]:
        lux = illuminance_lx(job["luminaires"], meter)
        readings.append({"meter": meter["id"], "illuminance_lx": lux, "error_bound_lx": 1e-12 * lux})
    return {"readings": readings, "settings": {"python": sys.version.split()[0]}}


def reply(request):
    if request["verb"] == "probe":
        return {"protocol": 2, "name": "inverse square", "version": "1", "capabilities": ["batch"]}
    return {"answers": [{"job": job["job"], **answer(job)} for job in request["jobs"]]}


json.dump(reply(json.load(sys.stdin)), sys.stdout)
