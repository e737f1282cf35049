#!/usr/bin/env python3
"""Prints what changed between releases, from the runs of ci/benchmarks/releases: tables of Markdown.

    python3 ci/benchmarks/releases.py OUT
"""

import json
import pathlib
import re
import sys

MOVED = 2e-3  # of a reading: how far one may lie from that of the release before it to count as the same


def main(out):
    axial, readers = read(out, "axial"), read(out, "readers")
    print("| release | luminous intensity | direct | indirect | total | readings |\n|---|---|---|---|---|---|")
    for engine in engines(axial):
        earlier = None
        for release, report in axial[engine]:
            cells = [cell(report, p) for p in ("luminous_intensity", "direct_illuminance", "indirect_illuminance", "total_illuminance")]
            print(f"| `{engine}@{release}` | {' | '.join(cells)} | {against(earlier, report)} |")
            earlier = report
    print("\n| release | of 19 files | against the release before |\n|---|---|---|")
    for engine in engines(readers):
        earlier = None
        for release, report in readers[engine]:
            told = by_file(report)
            right = sum(v == "pass" for v in told.values())
            unread = sum(v == "missing" for v in told.values())
            print(f"| `{engine}@{release}` | {right} right, {len(told) - right - unread} off, {unread} not read | {files(earlier, report)} |")
            earlier = report


def read(out, spec):
    found = {}
    for file in pathlib.Path(out).glob(f"*@*/{spec}/report.json"):
        name = file.parts[-3]
        engine, release = name.split("@")
        report = json.loads(file.read_text())
        own = [c for c in report["comparisons"] if c["engine"] == name]
        skips = {s["procedure"]: s["reason"] for s in report["skips"] if s["engine"] == name and s["scope"] == "procedure"}
        found.setdefault(engine, []).append((release, {"own": own, "skips": skips}))
    order = lambda pair: [int(n) for n in re.findall(r"\d+", pair[0])]
    return {engine: sorted(all, key=order) for engine, all in found.items()}


def engines(found):
    return [e for e in ("mitsuba", "radiance", "cycles", "luxcore") if e in found]


def cell(report, procedure):
    if procedure in report["skips"]:
        return "declined"
    own = [c for c in report["own"] if c["procedure"] == procedure]
    if not own:
        return "-"
    verdicts = {v: sum(c["verdict"] == v for c in own) for v in ("fail", "undecided", "missing")}
    told = [f"{n} {v}" for v, n in verdicts.items() if n] or ["pass"]
    off = [abs(c["relative_deviation"]) for c in own if c["relative_deviation"] is not None]
    return f"{', '.join(told)}, {100 * max(off, default=0):.2g} %"


def key(c):
    return c["case"], c["procedure"], c["meter"], (c["reference"] or {}).get("basis")


def against(earlier, report):
    if earlier is None:
        return ""
    old = {key(c): c["value"] for c in earlier["own"]}
    both = [(old[key(c)], c["value"]) for c in report["own"] if old.get(key(c)) is not None and c["value"] is not None]
    if all(a == b for a, b in both):
        return "the same bits"
    off = max(abs(b / a - 1) for a, b in both if a)
    return f"within {off:.1e} of those before"


def by_file(report):
    """pass, fail or missing by case, the worst of its meters."""
    worst = {}
    rank = ["pass", "known_deviation", "undecided", "fail", "missing"]
    for c in report["own"]:
        case = c["case"].split("/")[-1]
        worst[case] = max(worst.get(case, "pass"), c["verdict"], key=rank.index)
    return worst


def files(earlier, report):
    if earlier is None:
        return ""
    old, new = by_file(earlier), by_file(report)
    told = [f"`{case}`: {old[case]} before, {new[case]} now" for case in sorted(new) if old.get(case) != new[case]]
    before = {key(c): c["value"] for c in earlier["own"]}
    moved = {}
    for c in report["own"]:
        was, now = before.get(key(c)), c["value"]
        if was and now is not None and abs(now / was - 1) > MOVED:
            case = c["case"].split("/")[-1]
            moved[case] = max(moved.get(case, 0), abs(now / was - 1))
    alike = {}
    for case, by in sorted(moved.items()):
        if old.get(case) == new[case]:
            alike.setdefault(f"{100 * by:.2g} %", []).append(f"`{case}`")
    for by, cases in alike.items():
        told.append(f"{', '.join(cases) if len(cases) < 4 else f'{len(cases)} files'} moved by {by}")
    return "; ".join(told) or "nothing"


if __name__ == "__main__":
    main(sys.argv[1])
