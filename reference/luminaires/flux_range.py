"""How far the published tables fix the flux of the luminaire behind them: linear programs over all tables that fit.

Tables on the grid of reconstruct_cachet.py that meet Table 1, Table 2 within +-.01 lx and Table 3's lum1 column within
+-.01 lx at seven bounces, and are nowhere negative. For a bound on curvature (second difference over steps of 5 degrees
along gamma, in candela) the smallest and the largest flux; for a given flux the smallest bound that a table can keep.

Needs NumPy and SciPy:  python3 flux_range.py   (about a minute)
"""
import math

import numpy as np
from scipy.optimize import linprog

import reconstruct_cachet as paper

NODES = len(paper.PLANES) * len(paper.GAMMAS)
ROUNDING_LX = 0.01


def main():
    program = Program()
    print("curvature bound [cd]   flux [lm]")
    for bound in (None, 200.0, 100.0, 60.0, 45.0):
        low, high = program.flux_range(bound)
        print(f"{bound or 'none':>20}   {low:.0f} to {high:.0f}")
    print("flux [lm]   least curvature bound [cd]")
    bound, flux = program.least_curvature(None)
    print(f"{'any':>9}   {bound:.1f} (at {flux:.0f} lm)")
    for flux in (4300.0, 4400.0, 4500.0, 4600.0, 4700.0, 4800.0, 4920.0):
        print(f"{flux:>9.0f}   {program.least_curvature(flux)[0]:.1f}")


class Program:
    def __init__(self):
        unit = np.eye(NODES)
        self.flux = np.array([paper.flux(list(row)) for row in unit])
        exact = [({paper.node(0, g): 1.0}, v) for g, v in paper.TABLE_1.items()]
        for plane in range(1, len(paper.PLANES)):
            exact += [({paper.node(plane, g): 1.0}, paper.TABLE_1[g]) for g in (90, 180)]
        self.exact = [(dense(row), value) for row, value in exact]
        within = []
        for (x, y), lux in paper.TABLE_2:
            per_candela = 7.0 / math.dist((x, y, 17), paper.LUMINAIRE) ** 3
            within.append((per_candela * dense(paper.towards((x, y, 17))), lux))
        within += [(dense(paper.indirect_weights((x, y, 2.0))), lux) for (x, y), lux in paper.TABLE_3]
        self.rows, self.limits = [], []
        for row, lux in within:
            self.rows += [row, -row]
            self.limits += [lux + ROUNDING_LX, ROUNDING_LX - lux]
        self.curvature = []
        gammas = len(paper.GAMMAS)
        for plane in range(len(paper.PLANES)):
            for g in range(1, gammas):
                k = plane * gammas + g
                after = k + 1 if g + 1 < gammas else k - 1
                self.curvature.append(unit[k - 1] - 2 * unit[k] + unit[after])

    def flux_range(self, bound):
        rows, limits = list(self.rows), list(self.limits)
        if bound is not None:
            for row in self.curvature:
                rows += [row, -row]
                limits += [bound, bound]
        return [sign * self.solve(sign * self.flux, rows, limits, self.exact).fun for sign in (1, -1)]

    def least_curvature(self, flux):
        """The bound is one more unknown."""
        rows = [np.append(row, 0.0) for row in self.rows]
        for row in self.curvature:
            rows += [np.append(row, -1.0), np.append(-row, -1.0)]
        limits = self.limits + [0.0] * (2 * len(self.curvature))
        exact = [(np.append(row, 0.0), value) for row, value in self.exact]
        if flux is not None:
            exact.append((np.append(self.flux, 0.0), flux))
        solved = self.solve(np.append(np.zeros(NODES), 1.0), rows, limits, exact)
        return solved.fun, self.flux @ solved.x[:-1]

    def solve(self, cost, rows, limits, exact):
        solved = linprog(cost, A_ub=np.array(rows), b_ub=limits, A_eq=np.array([row for row, _ in exact]),
                         b_eq=[value for _, value in exact], bounds=(0, None), method="highs")
        if solved.status != 0:
            raise SystemExit(f"no table fits: {solved.message}")
        return solved


def dense(weights):
    row = np.zeros(NODES)
    for k, weight in weights.items():
        row[k] = weight
    return row


if __name__ == "__main__":
    main()
