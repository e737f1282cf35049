"""A second reader of the pack, written from the formats alone, with a switch for each mistake.

    reader.py DIR    prints {mistake: submission} for the pack in DIR; the empty name is the right reader

It shares no code with luxproof: it parses the bytes of the files and has its own look-up.
"""
import io
import json
import math
import sys
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path

TINY = 1e-6


class Table:
    def __init__(self, kind, horizontals, verticals, rows, factor, planes=None):
        self.kind, self.h, self.v, self.rows, self.factor = kind, horizontals, verticals, rows, factor
        self.planes = planes


def even(angles):
    step = (angles[-1] - angles[0]) / max(len(angles) - 1, 1)
    return [angles[0] + k * step for k in range(len(angles))]


def parse_ies(data, wrong):
    lines = data.decode("ascii").splitlines()
    first = lines[0]
    edition = next((year for mark, year in [("IESNA91", 91), ("LM-63-1995", 95), ("LM-63-2002", 102), ("LM-63-2019", 119)]
                    if mark in first), 86)
    start = next(k for k, line in enumerate(lines) if line.startswith("TILT="))
    numbers = [float(word) for line in lines[start + 1:] for word in line.split()]
    at = 0
    if lines[start].strip() == "TILT=INCLUDE":
        at = 2 + 2 * int(numbers[1])
    lamps, lumens, multiplier, nv, nh, kind, units, *_ = numbers[at:at + 10]
    ballast, third, _ = numbers[at + 10:at + 13]
    at += 13
    nv, nh = int(nv), int(nh)
    vertical, horizontal = numbers[at:at + nv], numbers[at + nv:at + nv + nh]
    values = numbers[at + nv + nh:]
    assert len(values) == nv * nh
    if wrong == "table-transposed":
        rows = [[values[v * nh + h] for v in range(nv)] for h in range(nh)]
    else:
        rows = [values[h * nv:(h + 1) * nv] for h in range(nh)]
    factor = 1.0
    if wrong != "multiplier-ignored":
        factor *= multiplier
    if wrong != "ballast-factor-ignored":
        factor *= ballast
    if edition in (86, 91) and wrong != "ballast-lamp-factor-ignored":
        factor *= third
    if edition == 119 and wrong == "file-generation-applied":
        factor *= third
    if wrong == "lamps-multiplied":
        factor *= lamps
    if wrong == "lumens-scaled" and lumens > 0:
        factor *= lamps * lumens / 1000
    if wrong == "minus-one-multiplied" and lumens < 0:
        factor *= lumens
    if wrong == "feet-applied" and units == 1:
        factor *= 0.3048**2
    if wrong == "even-steps-assumed":
        vertical, horizontal = even(vertical), even(horizontal)
    return Table("CBA"[int(kind) - 1], horizontal, vertical, rows, factor)


def parse_ldt(data, wrong):
    lines = data.decode("ascii").split("\r\n")
    isym, mc, ng = int(lines[2]), int(lines[3]), int(lines[5])
    dff, lorl, conversion, sets = float(lines[21]), float(lines[22]), float(lines[23]), int(lines[25])
    lamps, lumens = int(lines[26]), float(lines[28])
    at = 26 + 6 * sets + 10
    planes = [float(line) for line in lines[at:at + mc]]
    gammas = [float(line) for line in lines[at + mc:at + mc + ng]]
    values = [float(line) for line in lines[at + mc + ng:] if line]
    if isym == 1:
        stored = planes[:1]
    elif isym == 2:
        stored = planes[:mc // 2 + 1]
    elif isym == 3:
        stored = [plane - 360 for plane in planes[3 * mc // 4:]] + planes[:mc // 4 + 1]
    elif isym == 4:
        stored = planes[:mc // 4 + 1]
    else:
        stored = planes
    rows = [values[k * ng:(k + 1) * ng] for k in range(len(stored))]
    assert len(values) == ng * len(stored)
    if isym == 0:
        stored, rows = stored + [360.0], rows + rows[:1]
    factor = 1.0 if wrong == "lumens-not-scaled" else lumens / 1000
    if wrong != "conversion-factor-ignored":
        factor *= conversion
    if wrong == "output-ratio-applied":
        factor *= lorl / 100
    if wrong == "downward-fraction-applied":
        factor *= dff / 100
    if wrong == "lamps-multiplied":
        factor *= abs(lamps)
    if wrong == "minus-one-multiplied" and lamps < 0:
        factor *= lamps
    return Table("C", stored, gammas, rows, factor)


def parse_xml(data, wrong):
    root = ElementTree.fromstring(data)
    text = {node.tag: (node.text or "").strip() for node in root.iter()}
    nodes = {(float(n.get("h")), float(n.get("v"))): float(n.text) for n in root.iter("IntData")}
    horizontal, vertical = sorted({h for h, _ in nodes}), sorted({v for _, v in nodes})
    rows = [[nodes[h, v] for v in vertical] for h in horizontal]
    factor = 1.0 if wrong == "multiplier-ignored" else float(text["Multiplier"])
    if wrong == "lumens-scaled" and text["AbsolutePhotometry"] == "false":
        factor *= float(text["RatedLumens"]) / 1000
    return Table(text["PhotometryType"][-1], horizontal, vertical, rows, factor)


def parse_gldf(data, wrong):
    archive = zipfile.ZipFile(io.BytesIO(data))
    root = ElementTree.fromstring(archive.read("product.xml"))
    wanted = root.find(".//PhotometryFileReference").get("fileId")
    name = next(node.text for node in root.iter("File") if node.get("id") == wanted)
    if wrong == "unlisted-file-read":
        name = next(entry for entry in archive.namelist() if entry.endswith(".ldt")).split("/")[-1]
    return parse_ldt(archive.read("ldc/" + name), wrong)


PARSERS = {".ies": parse_ies, ".ldt": parse_ldt, ".xml": parse_xml, ".gldf": parse_gldf}


def lookup(table, direction, wrong):
    x, y, z = direction["towards"]
    if wrong == "azimuth-reversed":
        y = -y
    turn = {"turned-by-90": 90, "turned-by-180": 180, "turned-by-270": 270}.get(wrong, 0)
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    x, y = x * c - y * s, x * s + y * c
    if wrong == "up-down-swapped":
        z = -z
    radius = math.hypot(x, y)
    azimuth = math.degrees(math.atan2(y, x)) if radius > 1e-12 else 0.0
    gamma = math.degrees(math.atan2(radius, -z))
    kind = table.kind
    if wrong == "type-as-c":
        kind = "C"
    if wrong == "type-b-as-a" and kind == "B":
        kind = "A"
    if kind == "A":
        h, v = -azimuth, gamma - 90
    elif kind == "B":
        across = math.hypot(x, z)
        h, v = math.degrees(math.atan2(-y, across)), math.degrees(math.atan2(x, -z)) if across > 1e-12 else 0.0
    else:
        h, v = azimuth % 360, gamma
        if 360 - h < TINY:
            h = 0.0
    if wrong == "axes-swapped" and table.kind != "C":
        h, v = v, h
    h = fold(table, kind, h, wrong)
    if h is None:
        return 0.0
    first, last = table.v[0], table.v[-1]
    if table.kind == "C":
        if wrong == "angles-stretched":
            v = first + (last - first) * v / 180
        if wrong == "first-angle-ignored":
            v += first
        if wrong == "mirrored-beyond-end" and not first - TINY <= v <= last + TINY and 90 in (first, last):
            v = 180 - v
    if wrong == "clamped-beyond-end":
        v = min(max(v, first), last)
    if not first - TINY <= v <= last + TINY:
        return 0.0
    return table.factor * bilinear(table, h, v)


def fold(table, kind, h, wrong):
    first, last = table.h[0], table.h[-1]
    if wrong == "first-plane-only":
        return first
    if kind != "C" or table.kind != "C" and wrong != "type-as-c":
        if first == 0 and wrong != "mirror-missing":
            h = abs(h)
        if wrong == "clamped-beyond-end":
            h = min(max(h, first), last)
        return h if first - TINY <= h <= last + TINY else None
    if len(table.h) == 1:
        return None if wrong == "single-plane-only" and h > TINY else first
    if first == 0 and last >= 360:
        return h
    if first == 0:
        if h <= last + TINY:
            return h
        if wrong == "mirror-missing":
            return None
        if wrong == "mirror-repeated":
            return h % last
        h = min(h, 360 - h)
        return h if last == 180 else min(h, 180 - h)
    # From 90 to 270, or from -90 to 90.
    if wrong == "planes-90-270-as-0-180":
        return first + min(h, 360 - h)
    along = (h + (180 if wrong == "half-on-other-side" else 0) - first) % 360
    along = 0.0 if 360 - along < TINY else along
    if along <= 180 + TINY:
        return first + along
    if wrong == "mirror-missing":
        return None
    return first + (along - 180 if wrong == "mirror-repeated" else 360 - along)


def place(angles, at):
    if len(angles) == 1:
        return 0, 0, 0.0
    k = min(max(sum(angle <= at for angle in angles), 1), len(angles) - 1)
    return k - 1, k, min(max((at - angles[k - 1]) / (angles[k] - angles[k - 1]), 0.0), 1.0)


def bilinear(table, h, v):
    a, b, s = place(table.h, h)
    i, j, t = place(table.v, v)
    low, high = ((1 - t) * table.rows[k][i] + t * table.rows[k][j] for k in (a, b))
    return (1 - s) * low + s * high


def submission(folder, wrong):
    files = {}
    for path in sorted((folder / "files").iterdir()):
        expected = json.loads((folder / "expected" / (path.name + ".json")).read_text())
        table = PARSERS[path.suffix](path.read_bytes(), wrong)
        files[path.name] = {"candela": [lookup(table, d, wrong) for d in expected["directions"]]}
    return {"pack": "1.0.0", "reader": {"name": "second reader", "version": wrong or "right"}, "files": files}


def main():
    folder = Path(sys.argv[1])
    index = json.loads((folder / "pack.json").read_text())
    names = [""] + [entry["name"] for entry in index["mistakes"]]
    json.dump({name: submission(folder, name) for name in names}, sys.stdout)


if __name__ == "__main__":
    main()
