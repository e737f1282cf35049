"""Draws the table that `cargo bench -p luxproof-physics-tests --bench simulator` prints: `error_against_time.py < table > picture.svg`.

Bounds as lines, errors as dots; colours and words serve on white and on black."""
import math, sys

WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 760, 420, 70, 230, 34, 46
SERIES = {"S1": ("#0067a8", "empty cube: collocation"), "S1, paths": ("#62a5da", "the same by paths"),
          "S2, by the solver before": ("#8a6d00", "furnished room, before balance"), "S2": ("#b84a00", "furnished room: balance"), "S2, paths": ("#d99a4e", "the same by paths")}

rows = {}
for line in sys.stdin:
    cells = [c.strip() for c in line.strip().strip("|").split("|")]
    if len(cells) == 7 and cells[0] in SERIES and cells[2]:
        rows.setdefault(cells[0], []).append((float(cells[5]), float(cells[2]), float(cells[4])))
points = [p for found in rows.values() for p in found]
ends = [(math.floor(math.log10(min(v))), math.ceil(math.log10(max(v)))) for v in (
    [p[0] for p in points], [e for p in points for e in p[1:] if e > 0])]


def x(ms):
    low, high = ends[0]
    return LEFT + (math.log10(ms) - low) / (high - low) * (WIDTH - LEFT - RIGHT)


def y(error):
    low, high = ends[1]
    return TOP + (high - math.log10(error)) / (high - low) * (HEIGHT - TOP - BOTTOM)


def text(at_x, at_y, words, more=""):
    print(f'<text x="{at_x:.1f}" y="{at_y:.1f}"{more}>{words}</text>')


print(f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" font-size="12" role="img">')
print("<title>Bound and error of reflected light against processor time, by solver</title>")
# Both schemes: the reader's own where the picture stands in a page of its own, white where nobody says.
print("<style>svg { color: #222; } .paper { fill: #fff; } .grid { stroke: #ddd; } text { fill: currentColor; }"
      " @media (prefers-color-scheme: dark) { svg { color: #ddd; } .paper { fill: #16181c; } .grid { stroke: #3a3e45; } }</style>")
print(f'<rect class="paper" width="{WIDTH}" height="{HEIGHT}"/>')
for k in range(ends[0][0], ends[0][1] + 1):
    print(f'<line class="grid" x1="{x(10 ** k):.1f}" x2="{x(10 ** k):.1f}" y1="{TOP}" y2="{HEIGHT - BOTTOM}"/>')
    text(x(10 ** k), HEIGHT - BOTTOM + 16, f"{10 ** k:g} ms" if k < 3 else f"{10 ** (k - 3):g} s", ' text-anchor="middle"')
for k in range(ends[1][0], ends[1][1] + 1):
    print(f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y(10 ** k):.1f}" y2="{y(10 ** k):.1f}"/>')
    text(LEFT - 6, y(10 ** k) + 4, f"1e{k}", ' text-anchor="end"')
text(LEFT, 20, "Relative error of reflected light against processor time: lines are bounds, dots are errors", ' font-weight="bold"')
text(0.5 * (LEFT + WIDTH - RIGHT), HEIGHT - 8, "processor time, one core", ' text-anchor="middle"')
for k, (name, found) in enumerate(rows.items()):
    colour, words = SERIES[name]
    found.sort()
    path = " ".join(f"{x(ms):.1f},{y(bound):.1f}" for ms, _, bound in found)
    print(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
    for ms, error, _ in found:
        if error > 0:
            print(f'<circle cx="{x(ms):.1f}" cy="{y(error):.1f}" r="3.5" fill="{colour}"/>')
    at = TOP + 14 + 20 * k
    print(f'<line x1="{WIDTH - RIGHT + 14}" x2="{WIDTH - RIGHT + 38}" y1="{at - 4}" y2="{at - 4}" stroke="{colour}" stroke-width="2"/>')
    print(f'<circle cx="{WIDTH - RIGHT + 26}" cy="{at - 4}" r="3.5" fill="{colour}"/>')
    text(WIDTH - RIGHT + 46, at, words)
print("</svg>")
