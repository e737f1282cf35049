"""Laws of the daylight cases: luminance of skies and of the ground, transmittance of clear glass. World axes, z up.

Skies are those of ISO 15469 / CIE S 011, without the sun and scaled so that an unobstructed horizontal plane has
10 000 lx; below the horizon lies an endless ground that reflects .3 of that.
"""
import math

from derive_values import gauss

HORIZONTAL_LX = 10_000.0
GROUND_CD_M2 = 0.3 * HORIZONTAL_LX / math.pi
# Table 1 of the standard: a, b of the six gradations, and c, d, e of the six indicatrices.
GRADATIONS = ((4, -.7), (1.1, -.8), (0, -1), (-1, -.55), (-1, -.32), (-1, -.15))
INDICATRICES = ((0, -1, 0), (2, -1.5, .15), (5, -2.5, .3), (10, -3, .45), (16, -3, .3), (24, -2.8, .15))
# The two of each type, from 0. Type 16, the traditional overcast sky, has another law.
PAIRS = ((0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2), (2, 3), (3, 1), (3, 2), (3, 3), (4, 3), (4, 4), (5, 4),
         (5, 5))
TYPES = {k + 1: GRADATIONS[g] + INDICATRICES[i] for k, (g, i) in enumerate(PAIRS)}
NODES = gauss(48)
REFRACTION, DEPTH = 1.52, 0.02  # of the glass: index, and optical depth straight through


class Sky:
    """A sky, its sun over the azimuth `sun_deg` (from x to y) and `zenith_deg` from the zenith."""

    def __init__(self, kind, sun_deg, zenith_deg):
        zenith, azimuth = math.radians(zenith_deg), math.radians(sun_deg)
        self.sun = (math.sin(zenith) * math.cos(azimuth), math.sin(zenith) * math.sin(azimuth), math.cos(zenith))
        self.kind, self.scale = kind, 1.0
        self.scale = HORIZONTAL_LX / self.horizontal()

    def luminance(self, towards):
        """In cd/m2 towards a unit vector; the horizon itself counts as sky."""
        rise = towards[2]
        if rise < -1e-12:
            return GROUND_CD_M2
        if self.kind == 16:
            return self.scale * (1 + 2 * max(rise, 0.0)) / 3
        a, b, c, d, e = TYPES[self.kind]
        gradation = 1 + (a * math.exp(b / rise) if rise > 1e-9 else 0.0)
        chord = min(math.dist(towards, self.sun), 2.0)      # keeps its digits close to the sun, where a cosine does not
        indicatrix = 1 + c * (math.exp(2 * d * math.asin(chord / 2)) - math.exp(d * math.pi / 2))
        return self.scale * gradation * (indicatrix + e * (1 - chord * chord / 2) ** 2)

    def horizontal(self):
        """The illuminance of an open plane: luminance over the unit disc below, in polar coordinates about the sun."""
        total, turns = 0.0, 512
        s2 = self.sun[0] ** 2 + self.sun[1] ** 2
        for k in range(turns):
            x, y = math.cos(2 * math.pi * k / turns), math.sin(2 * math.pi * k / turns)
            along = self.sun[0] * x + self.sun[1] * y
            reach = -along + math.sqrt(along * along + 1 - s2)
            for v, weight in NODES:
                r = reach * (1 - v * v)                     # straightens the square root at the horizon
                px, py = self.sun[0] + r * x, self.sun[1] + r * y
                towards = (px, py, math.sqrt(max(1 - px * px - py * py, 0.0)))
                total += self.luminance(towards) * r * 2 * reach * v * weight * 2 * math.pi / turns
        return total


def glass(cosine):
    """What a clear pane lets through of unpolarised light: two faces (Fresnel), all reflections between, absorption."""
    if cosine <= 0.0:
        return 0.0
    inner = math.sqrt(1 - (1 - cosine * cosine) / REFRACTION ** 2)
    left = math.exp(-DEPTH / inner)
    across = ((cosine - REFRACTION * inner) / (cosine + REFRACTION * inner)) ** 2
    along = ((inner - REFRACTION * cosine) / (inner + REFRACTION * cosine)) ** 2
    return sum((1 - r) ** 2 * left / (1 - (r * left) ** 2) for r in (across, along)) / 2


def unglazed(cosine):
    return 1.0 if cosine > 0.0 else 0.0
