#!/usr/bin/env python3
"""Expected values of the tests of this crate, computed a second time.

The Rust code takes its distributions from `statrs`. Here every probability is an integral of the density, by
Simpson's rule on 400 intervals. Run the script to print the values; the tests hold them as constants.
"""
from math import erfc, exp, inf, lgamma, log, pi, sqrt


def simpson(density, low, high, steps=400):
    width = (high - low) / steps
    inner = sum((4 if k % 2 else 2) * density(low + k * width) for k in range(1, steps))
    return width / 3 * (density(low) + inner + density(high))


def normal_tail(z):
    return 0.5 * erfc(z / sqrt(2))


def student_density(x, n):
    scale = lgamma((n + 1) / 2) - lgamma(n / 2) - 0.5 * log(n * pi)
    return exp(scale - (n + 1) / 2 * log(1 + x * x / n))


def student_tail(z, n):
    if n == inf:
        return normal_tail(z)
    return 0.5 - simpson(lambda x: student_density(x, n), 0.0, z) if z else 0.5


def gamma_tail(x, shape, rate=1.0):
    """From x on, where the density is smooth, until it is negligible."""
    scale = shape * log(rate) - lgamma(shape)
    return simpson(lambda t: exp(scale + (shape - 1) * log(t) - rate * t), x, x + (50 + 5 * shape) / rate)


def chi_squared_tail(x, n):
    return gamma_tail(x, n / 2, 0.5)


def f_tail(x, m, n):
    """By the integral of the beta density, with its variable t = s^2."""
    upper = m * x / (m * x + n)
    scale = log(2) + lgamma((m + n) / 2) - lgamma(m / 2) - lgamma(n / 2)
    density = lambda s: exp(scale + (m - 1) * log(s) + (n / 2 - 1) * log(1 - s * s)) if s > 0 else 0.0
    return 1 - simpson(density, 0.0, sqrt(upper))


def quantile(tail, probability, low, high):
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if tail(middle) > probability else (low, middle)
    return high


def convolved_tail(x, sigma, half_width, n=inf):
    """Student's t of this sigma plus a rectangular distribution of this half width."""
    mean = lambda r: student_tail((x - r) / sigma, n) if x >= r else 1 - student_tail((r - x) / sigma, n)
    return simpson(mean, -half_width, half_width, 100) / (2 * half_width)


TAIL = normal_tail(2.0)


def gum_h1():
    """JCGM 100:2008, H.1: the length of an end gauge, in nanometres, with degrees of freedom."""
    components = [(25.0, 18), (9.7, 25.6), (2.9, 50), (16.6, 2)]
    variance = sum(u * u for u, _ in components)
    freedom = variance**2 / sum(u**4 / n for u, n in components)
    factor = quantile(lambda z: student_tail(z, freedom), 0.005, 0.0, 10.0)
    return sqrt(variance), freedom, factor * sqrt(variance)


def stage(share, deviation, allowed):
    """The p-value where chance of one unit may spend only a share of the error probability."""
    wide = quantile(normal_tail, TAIL * share, 0.0, 10.0) / 2.0
    return normal_tail((deviation - allowed) / wide) + normal_tail((deviation + allowed) / wide)


def birge(values):
    """Value, uncertainty, degrees of freedom, ratio, its p-value and the mean's p-value, after Birge and Meier."""
    weights = [1 / (u * u) for _, u, _ in values]
    total = sum(weights)
    mean = sum(w * d for w, (d, _, _) in zip(weights, values)) / total
    squares = sum(w * (d - mean) ** 2 for w, (d, _, _) in zip(weights, values))
    free = len(values) - 1
    shares = [(w / total, n) for w, (_, _, n) in zip(weights, values)]
    meier = 1 + 4 * sum(s * (1 - s) / n for s, n in shares)
    uncertainty = sqrt(max(squares / free, meier) / total)
    freedom = 1 / sum(s * s / n for s, n in shares)
    # Mean and variance of the square of Student's t, from its second and fourth moments.
    moments = [(n / (n - 2), 3 * n * n / ((n - 2) * (n - 4)) - (n / (n - 2)) ** 2) for _, _, n in values]
    first = sum(m for m, _ in moments) * free / len(values)
    second = sum(v for _, v in moments) * free / len(values)
    return mean, uncertainty, freedom, sqrt(squares / free), gamma_tail(squares, first**2 / second, first / second), 2 * student_tail(abs(mean) / uncertainty, freedom)


def single_meter(readings, stated, freedom):
    """Scatter of one meter's readings over an equal stated error: F by its definition."""
    n = len(readings)
    mean = sum(readings) / n
    f = sum((r - mean) ** 2 for r in readings) / (n - 1) / stated**2
    above, below = n - 1, n * freedom
    tail = f_tail(f, above, below)
    unbiased = f * (below - 2) / below
    ends = [sqrt(f / quantile(lambda x: f_tail(x, above, below), p, 1e-3, 100.0)) for p in (0.025, 0.975)]
    return sqrt(unbiased), *ends, 2 * min(tail, 1 - tail)


def bartlett(ratios):
    """M. S. Bartlett's statistic and its probability, for ratios with degrees of freedom."""
    freedom = sum(n for _, n in ratios)
    pooled = sum(n * r * r for r, n in ratios) / freedom
    raw = sum(n * log(pooled / (r * r)) for r, n in ratios)
    correction = 1 + (sum(1 / n for _, n in ratios) - 1 / freedom) / (3 * (len(ratios) - 1))
    return raw, raw / correction, chi_squared_tail(raw, len(ratios) - 1), chi_squared_tail(raw / correction, len(ratios) - 1)


if __name__ == "__main__":
    print("GUM H.1: combined, degrees of freedom, expanded", *gum_h1())
    print("p-value at a stage of half the error", stage(0.5, 3.0, 1.0), "at the only one", stage(1.0, 3.0, 1.0))
    print("normal 1 and rectangular 1", quantile(lambda x: convolved_tail(x, 1.0, 1.0), TAIL, 0.0, 10.0))
    print("t of 5, sigma 1, rectangular 2", quantile(lambda x: convolved_tail(x, 1.0, 2.0, 5), TAIL, 0.0, 20.0))
    print("three values", birge([(0.010, 0.002, 7), (0.013, 0.001, 15), (0.006, 0.002, 20)]))
    print("one meter", single_meter([98.0, 103.0, 99.5, 101.0], 1.0, 7))
    for ratio in (4.6, 4.8):
        print("Bartlett", *bartlett([(1.0, 3), (2.0, 3), (ratio, 4)]))
