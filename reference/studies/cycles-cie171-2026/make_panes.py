"""Writes pane-*.ies: a roof opening under sky 1 behind two panes, as luminaires for check.yaml.

`single` transmits .96 (1 - R)^2 of the mean R of both polarisations, as the study does. `all` transmits .96 of what all
reflections between both faces leave. make_study.py has both laws.

Only Python's standard library is needed:  python3 make_panes.py   (in this folder)
"""
import os

from make_study import HERE, all_reflections, single_pass

from make import Opening, steps
from skies import Sky
from geometry import SUN_ZENITH_DEG


class Pane(Opening):
    def angles(self):
        return [0], steps((0, 60, 1), (60, 90, .25))


def main():
    os.makedirs(os.path.join(HERE, "luminaires"), exist_ok=True)
    os.chdir(HERE)
    for name, law in (("all", all_reflections), ("single", single_pass)):
        pane = Pane(False, Sky(1, 0, SUN_ZENITH_DEG), law)
        for side in (1, 4):
            pane.write(f"pane-{side}m-{name}", side, side, f"Opening {side} x {side} m behind a pane: {name}")


if __name__ == "__main__":
    main()
