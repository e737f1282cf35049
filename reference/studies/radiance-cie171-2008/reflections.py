"""After how many reflections the light stops that Radiance is reported to have read in CIE 171:2006, case 5.8.

In a closed room of one reflectance rho, the mean indirect illuminance after n reflections is
E_d rho (1 - rho^n) / (1 - rho), with E_d the mean direct illuminance: 10 000 lm / 96 m2.

Only Python's standard library is needed:  python3 reflections.py
"""
import math

DIRECT_LX = 10000 / 96
PUBLISHED_LX = {0.90: 884, 0.95: 1472}


def reflections(rho, indirect_lx):
    whole = DIRECT_LX * rho / (1 - rho)
    return math.log(1 - indirect_lx / whole) / math.log(rho)


for rho, lux in PUBLISHED_LX.items():
    low, high = reflections(rho, lux - 0.5), reflections(rho, lux + 0.5)
    whole = DIRECT_LX * rho / (1 - rho)
    print(f"rho {rho}: {lux} lx of {whole:.2f} lx, {100 * (lux / whole - 1):+.2f} %: {low:.2f} to {high:.2f} reflections")
