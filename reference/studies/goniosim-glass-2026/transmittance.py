"""Transmittance of a clear pane, n = 1.52 and without absorption, against what eulumdat-goniosim 0.7.0 calls analytical.

R is Fresnel's reflectance of one face. Light that passes both faces and is reflected between them any number of times
is (1 - R) / (1 + R) of what arrives, for each polarisation. (1 - R)^2 leaves the reflections between the faces out.

Only Python's standard library is needed:  python3 transmittance.py
"""
import math

INDEX = 1.52
PUBLISHED = {0: 0.9174, 15: 0.9170, 30: 0.9143, 45: 0.9039, 60: 0.8596, 75: 0.6898, 80: 0.5333}


def faces(theta_deg):
    """Fresnel's reflectance of one face, perpendicular and parallel to the plane of incidence."""
    a = math.radians(theta_deg)
    b = math.asin(math.sin(a) / INDEX)
    perpendicular = (math.cos(a) - INDEX * math.cos(b)) / (math.cos(a) + INDEX * math.cos(b))
    parallel = (INDEX * math.cos(a) - math.cos(b)) / (INDEX * math.cos(a) + math.cos(b))
    return perpendicular**2, parallel**2


def with_all_reflections(theta_deg):
    return sum((1 - r) / (1 + r) for r in faces(theta_deg)) / 2


def without_reflections(theta_deg):
    return (1 - sum(faces(theta_deg)) / 2) ** 2


print("angle  published  all reflections  deviation  (1 - R)^2")
for theta, value in PUBLISHED.items():
    whole, bare = with_all_reflections(theta), without_reflections(theta)
    print(f"{theta:5}  {value:9.4f}  {whole:15.4f}  {100 * (value / whole - 1):+8.1f} %  {bare:9.4f}")
