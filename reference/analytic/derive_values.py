"""Writes values/*.yaml: what the analytic cases must read, by area quadrature of Lambert's law.

It is one of two derivations: tests/analytic_values.rs derives every value again, from closed forms and contour
integrals of luminaire::calculators and luminaire::geometry, and compares. ../cie171/derive_lamps.py writes those of
CIE 171:2006 by the same functions.

Only Python's standard library is needed:  python3 derive_values.py   (in this folder)
"""
import math

FORMAT = "# Format: see reference/published/cachet.yaml; `basis` says that these are no readings but derived values.\n"


def main():
    up, down = (0, 0, 1), (0, 0, -1)
    places = [(p, n) for n in (up, down, (1, 0, 0), (.36, -.48, .8))
              for p in ((2, 2, 2), (1.6, 2.3, 2.45), (1.55, 1.6, 1.55), (2.4, 1.7, 2.1))]
    rows = [(p, n, 250 * math.pi) for p, n in places]
    write("furnace", "Furnace of luminous panels", "closed_form", 3, {"direct_illuminance": ("area", rows)})

    # An opening of .01 m2 and 200 cd, its face upright, .3 and .5 times as high above the line of sight as it is far along it: 1.90 and
    # 2.86 are entries of CIE 117's table 4.1. The background is the lit disc of case 5.6 of CIE 171:2006.
    disc, rows = segment((2, 2), 1.5, -math.inf), []
    for z, index in ((1.25, 1.9), (.65, 2.86)):
        eye, source = (3.9, 2, z), (.9, 2, 2.15)
        d2 = sum((a - b) ** 2 for a, b in zip(eye, source))
        cosine = 3 / math.sqrt(d2)
        luminance, solid = 200 / (.01 * cosine), .01 * cosine / d2
        background = 800 * factor(eye, (-1, 0, 0), disc) / math.pi
        rows.append((eye, (-1, 0, 0), 8 * math.log10(.25 / background * luminance ** 2 * solid / index ** 2)))
    write("glare", "Glare before an evenly lit disc", "closed_form", 3, {"unified_glare_rating": ("point", rows)})

    # A convex body that nothing but the panels lights: E = M on all of it, L = rho M / pi, rho .3 times their 250 cd/m2.
    rows = [((x, y, z), n, .3 * 250) for (x, y, z), n in (
        ((1.8, 1.9, 2.401), up), ((2.3, 2.2, 2.401), up), ((1.8, 1.9, 1.499), down), ((2.3, 2.2, 1.499), down),
        ((1.599, 1.9, 1.7), (-1, 0, 0)), ((1.599, 2.2, 2.2), (-1, 0, 0)), ((2.1, 2.301, 1.7), (0, 1, 0)))]
    write("lit-body", "Body in a furnace", "closed_form", 3, {"luminance": ("area", rows)})

    # One luminance from wherever it is seen: the panel's 1000 cd over .36 m2. Eyes are aimed at its centre.
    rows = []
    for eye in ((2, 2, 1), (3.5, 2.9, 1.2), (2.1, .4, 2.1), (1.9, 2.1, 2.3)):
        away = [c - p for c, p in zip((2, 2, 2.7), eye)]
        rows.append((eye, [a / math.hypot(*away) for a in away], 1000 / .36))
    write("opening", "A Lambertian panel, seen", "closed_form", 3, {"opening_luminance": ("area", rows)})

    ceiling = zip(((2, 2, 17), (2, 10, 17), (10, 2, 17), (10, 10, 17)),
                  (.852757463, 2.230931615, 2.230931615, 13.559183673))
    plane = zip(((2, 2, 2), (2, 10, 2), (10, 2, 2), (10, 10, 2)), (.94314714, 1.15551735, 1.15551735, 1.42062868))
    write("s1", "Case S1, two independent exact methods (the same to 5e-8 lx)", "simulator", 8, {
        "direct_illuminance": ("point", [(p, down, e) for p, e in ceiling]),
        "indirect_illuminance": ("point", [(p, up, e) for p, e in plane])}, units=5)

    desk = [(.25, .25), (1.75, 1.25), (3.75, 2.75), (4.25, .75), (5.25, 3.75), (7.25, .25)]
    direct = (66.24407, 226.03927, 161.02976, 123.15923, 210.12365, 0)
    indirect = (51.0232, 53.0644, 48.966, 53.512, 50.245, 18.788)
    title = "Case S2; direct by clipped polygons, indirect by path tracing (standard errors .005 to .024 lx)"
    write("s2", title, "simulator", 2, {
        "direct_illuminance": ("area", [((x, y, .8), up, e) for (x, y), e in zip(desk, direct)]),
        "indirect_illuminance": ("area", [((x, y, .8), up, e) for (x, y), e in zip(desk, indirect)])}, units=5)


def gauss(n):
    """Nodes and weights of Gauss-Legendre quadrature on 0..1, by Newton's method."""
    out = []
    for k in range(n):
        x = math.cos(math.pi * (k + .75) / (n + .5))
        for _ in range(50):
            p0, p1 = 1.0, x
            for j in range(2, n + 1):
                p0, p1 = p1, ((2 * j - 1) * x * p1 - (j - 1) * p0) / j
            slope = n * (x * p1 - p0) / (x * x - 1)
            x -= p1 / slope
        out.append(((1 + x) / 2, 1 / ((1 - x * x) * slope * slope)))
    return out


NODES = gauss(60)


def segment(centre, radius, beyond):
    """Points and areas of the part x > beyond of a disc on the floor; x = r cos t takes the square root away."""
    edge = max(-radius, beyond - centre[0])
    if edge >= radius:
        return []
    widest = math.acos(edge / radius)
    out = []
    for u, a in NODES:
        t = u * widest
        half, step = radius * math.sin(t), a * widest * radius * math.sin(t)
        for v, b in NODES:
            out.append(((centre[0] + radius * math.cos(t), centre[1] + half * (2 * v - 1), 0.0), step * b * 2 * half))
    return out


def factor(point, normal, patches):
    """Configuration factor by summing cos cos / (pi d^2) over horizontal patches."""
    total = 0.0
    for at, area in patches:
        ray = [a - b for a, b in zip(at, point)]
        d2 = sum(r * r for r in ray)
        total += max(0.0, sum(r * n for r, n in zip(ray, normal))) * abs(ray[2]) / (math.pi * d2 * d2) * area
    return total


LUMINANCE = "luminance_cd_m2"
QUANTITIES = {"luminance": LUMINANCE, "opening_luminance": LUMINANCE, "unified_glare_rating": "unified_glare_rating"}


def write(name, title, basis, digits, tables, units=1, table=None):
    lines = [FORMAT + "luxproof_published: 1", "citation:", f'  title: "{title}"', f"  basis: {basis}",
             f"rounding: {{units_in_last_digit: {units}}}", "tables:"]
    meaning = "Derived, no program's output" if basis == "closed_form" else "Exact methods, see the title"
    # The engine of a column is compared with it; no engine has these names.
    engine = "exact" if basis == "simulator" else basis
    for procedure, (model, rows) in tables.items():
        column = f'{{reference: true, engine: {engine}, model: {model}, meaning: "{meaning}"}}'
        quantity = QUANTITIES.get(procedure, "illuminance_lx")
        lines += [f"  {procedure}:", f"    name: {table or name}", f"    quantity: {quantity}", "    columns:",
                  f"      value: {column}", "    rows:"]
        for point, normal, value in rows:
            at, facing = (f"[{', '.join(f'{v:.9g}' for v in vector)}]" for vector in (point, normal))
            places = digits if value else 6     # nothing at all is known better than by its last digit
            lines.append(f'      - {{at_m: {at}, normal: {facing}, cells: {{value: "{value:.{places}f}"}}}}')
    with open(f"values/{name}.yaml", "w", encoding="ascii") as file:
        file.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
