#!/usr/bin/env python3
"""The odds of a consensus, computed a second time.

The Rust code factorises the covariance of all witnesses and integrates the truth out by weights. Here the truth drops
out beforehand: the differences from the first witness are normal, whatever it is. Their determinant and their
quadratic form come from Gaussian elimination. Run the script to print the values of `src/consensus_odds_tests.rs`.
"""
from math import exp, inf, log, pi

SOUND_SHARE, SHARED_VARIANCE, LARGEST, SMALLEST = 1 / 3, 0.5, 10.0, 1e-6


def log_density(covariance, values):
    """The density of the differences from the first value."""
    n = len(values) - 1
    c = [[covariance[i][j] - covariance[i][0] - covariance[0][j] + covariance[0][0] for j in range(1, n + 1)] + [values[i] - values[0]]
         for i in range(1, n + 1)]
    determinant, rest = 1.0, [row[:] for row in c]
    for k in range(n):
        determinant *= rest[k][k]
        for i in range(k + 1, n):
            factor = rest[i][k] / rest[k][k]
            rest[i] = [a - factor * b for a, b in zip(rest[i], rest[k])]
    solution = [0.0] * n
    for i in reversed(range(n)):
        solution[i] = (rest[i][n] - sum(rest[i][j] * solution[j] for j in range(i + 1, n))) / rest[i][i]
    form = sum(s * row[n] for s, row in zip(solution, c))
    return -0.5 * (log(determinant) + form + n * log(2 * pi))


def odds(readings, errors, relative, shares):
    """Readings and errors by witness and meter; `shares` are groups of two or more witnesses with one component.

    All meters differ. The relative tolerance is that of each reading.
    """
    count, meters = len(readings), len(readings[0])
    hypotheses = [frozenset([i]) for i in range(count)] + [frozenset(s) for s in shares]

    def mean_log(holders, size):
        total = 0.0
        for k in range(meters):
            scale = sorted(r[k] for r in readings)[count // 2]
            covariance = [[0.0] * count for _ in range(count)]
            for i in range(count):
                for j in range(count):
                    a, b = (SOUND_SHARE * relative * readings[w][k] / scale for w in (i, j))
                    if i == j:
                        covariance[i][j] = (errors[i][k] / scale) ** 2 + a * a
                    elif any({i, j} <= h for h in hypotheses):
                        covariance[i][j] = SHARED_VARIANCE * min(a, b) ** 2
                    if {i, j} <= holders:
                        covariance[i][j] += size * size
            total += log_density(covariance, [r[k] / scale for r in readings])
        return total / meters

    smallest = inf
    for k in range(meters):
        scale = sorted(r[k] for r in readings)[count // 2]
        smallest = min(smallest, min(relative * r[k] for r in readings) / scale)
    sizes = [min(max(smallest, SMALLEST), LARGEST)]
    while sizes[-1] < LARGEST:
        sizes.append(2 * sizes[-1])
    evidence = [exp(mean_log(frozenset(), 0.0))]
    evidence += [sum(exp(mean_log(h, size)) for size in sizes) / len(sizes) for h in hypotheses]
    best = max(range(len(hypotheses)), key=lambda k: evidence[k + 1])
    return sorted(hypotheses[best]), evidence[best + 1] / (sum(evidence) - evidence[best + 1])


# Witnesses: four, of which the last two share a component in the last two cases. Two meters.
READINGS = {
    "one of four": ([[100.0, 50.0], [100.4, 49.9], [99.8, 50.1], [103.6, 51.8]], []),
    "one of a pair": ([[100.0, 50.0], [100.4, 49.9], [99.8, 50.1], [103.6, 51.8]], [(2, 3)]),
    "what a pair shares": ([[100.0, 50.0], [100.4, 49.9], [103.8, 51.7], [103.6, 51.8]], [(2, 3)]),
}
ERRORS = [[0.0, 0.0], [0.5, 0.25], [0.3, 0.15], [0.2, 0.1]]

if __name__ == "__main__":
    for name, (readings, shares) in READINGS.items():
        print(name, *odds(readings, ERRORS, 0.02, shares))
