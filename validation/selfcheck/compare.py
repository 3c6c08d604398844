#!/usr/bin/env python3
"""Completeness by injection against completeness from the deep catalogue, per magnitude, as a Markdown table.

Of the catalogue's sources every one on the frame with a magnitude counts; a star is one of probpsf > 0.5. "All"
weighs the injected stars and galaxies of a bin as the catalogue mixes them there, and 18-22 the bins as the
catalogue fills them. Intervals are 95 %: of counts Clopper and Pearson's; where shares are weighted, the range in which
the catalogue's share is then expected (normal approximation). p: Fisher's exact test that both shares are the same, or
the difference over its error; with as many rows as there are here, Holm's p is what counts. A second table has the flux
scale of the injected stars.

usage: compare.py COADD.fit FOLDER
"""
import json
import math
import re
import sys

import numpy as np
from astropy.io import fits
from astropy.table import Table

BINS = [(18, 19), (19, 20), (20, 20.5), (20.5, 21), (21, 21.25), (21.25, 21.5), (21.5, 21.75), (21.75, 22)]


def upper(k, n, level):
    """p at which k or fewer of n have probability `level`, by bisection."""
    low, high = 0.0, 1.0
    for _ in range(60):
        p = 0.5 * (low + high)
        if p in (0.0, 1.0):
            break
        below = sum(math.exp(math.lgamma(n + 1) - math.lgamma(i + 1) - math.lgamma(n - i + 1)
                             + i * math.log(p) + (n - i) * math.log1p(-p)) for i in range(k + 1))
        low, high = (p, high) if below > level else (low, p)
    return 0.5 * (low + high)


def interval(k, n):
    if n == 0:
        return 0.0, 1.0
    return (0.0 if k == 0 else 1 - upper(n - k, n, 0.025)), (1.0 if k == n else upper(k, n, 0.025))


def fisher(a, n, b, m):
    """Two-sided: tables as improbable as the one found, or more."""
    def log_choose(n, k):
        return math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)
    total = log_choose(n + m, a + b)
    logs = [log_choose(n, i) + log_choose(m, a + b - i) - total
            for i in range(max(0, a + b - m), min(n, a + b) + 1)]
    found = log_choose(n, a) + log_choose(m, b) - total
    return min(1.0, sum(math.exp(x) for x in logs if x <= found + 1e-7))


def holm(p):
    order, adjusted, worst = np.argsort(p), np.ones(len(p)), 0.0
    for rank, i in enumerate(order):
        worst = max(worst, min(1.0, (len(p) - rank) * p[i]))
        adjusted[i] = worst
    return adjusted


def outcomes(path):
    """Magnitude, position and whether found, of every reference that counts."""
    t = Table.read(path, format="ascii.ecsv")
    t = t[(t["state"] == "matched") | (t["state"] == "missed")]
    return t["mag_ref"], t["ra"], t["dec"], t["state"] == "matched"


def share(k, n):
    low, high = interval(k, n)
    return "%d/%d = %.3f (%.3f..%.3f)" % (k, n, k / n if n else float("nan"), low, high)


def count(mag, found, use, low, high):
    inside = use & (mag >= low) & (mag < high)
    return int(found[inside].sum()), int(inside.sum())


class Sum:
    """Found of the catalogue's in all bins, and what the injected shares of the bins lead to expect."""

    def __init__(self):
        self.found = self.all = 0
        self.expected = self.variance = 0.0

    def add(self, k, n, share, error):
        self.found += k
        self.all += n
        self.expected += n * share
        self.variance += n * share * (1 - share) + (n * error) ** 2

    def row(self):
        low, high = (self.expected + side * 1.96 * math.sqrt(self.variance) for side in (-1, 1))
        p = math.erfc(abs(self.found - self.expected) / math.sqrt(2 * self.variance))
        return share(self.found, self.all), "%.3f (%.3f..%.3f)" % (
            self.expected / self.all, low / self.all, min(1.0, high / self.all)), p


def smoothed(a, b):
    """Share of a in b and its error, neither 0 nor 1 (Laplace)."""
    q = (a + 1) / (b + 2)
    return q, math.sqrt(q * (1 - q) / (b + 2))


def compare(run, folder, rows, lines, tests):
    mag, ra, dec, found = outcomes("%s/qa/matches_%s.ecsv" % (folder, run))
    star = np.array([rows["probpsf"][np.argmin(np.hypot(rows["ra"] - r, rows["dec"] - d))] > 0.5
                     for r, d in zip(ra, dec)])
    injected = {k: outcomes("%s/%s/matches_%s.ecsv" % (folder, k, run)) for k in ("stars", "galaxies")}
    sums = {"stars": Sum(), "galaxies": Sum(), "all": Sum()}
    for low, high in BINS:
        mixed = variance = 0.0
        both = count(mag, found, np.ones(len(mag), bool), low, high)
        for kind, use in ("stars", star), ("galaxies", ~star):
            k, n = count(mag, found, use, low, high)
            m = injected[kind]
            a, b = count(m[0], m[3], np.ones(len(m[0]), bool), low, high)
            q, error = smoothed(a, b)
            mixed += n / both[1] * q
            variance += (n / both[1] * error) ** 2
            sums[kind].add(k, n, q, error)
            tests.append(fisher(k, n, a, b) if n else 1.0)
            lines.append((run, "%g-%g" % (low, high), kind, share(k, n), share(a, b)))
        one = Sum()
        one.add(both[0], both[1], mixed, math.sqrt(variance))
        sums["all"].add(both[0], both[1], mixed, math.sqrt(variance))
        catalogue, expected, p = one.row()
        tests.append(p)
        lines.append((run, "%g-%g" % (low, high), "all", catalogue, expected))
    for kind in "stars", "galaxies", "all":
        catalogue, expected, p = sums[kind].row()
        tests.append(p)
        lines.append((run, "%g-%g" % (BINS[0][0], BINS[-1][1]), kind, catalogue, expected))


def main():
    rows = fits.getdata(sys.argv[1], 1)
    lines, tests = [], []
    for run in "NONE", "RL":
        compare(run, sys.argv[2], rows, lines, tests)
    print("| run | r | of | found of the catalogue's | found of the injected | p | p (Holm) |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for line, p, adjusted in zip(lines, tests, holm(tests)):
        print("| %s | %s | %s | %s | %s | %.2g | %.2g |" % (line + (p, adjusted)))
    print("\n| run | isolated stars in wide apertures (mag) | without the sky's error (mag) |\n| --- | --- | --- |")
    with open("%s/stars/summary.json" % sys.argv[2], encoding="utf-8") as file:
        for run in json.load(file)["runs"]:
            print("| %s | %s | %s |" % ((run["run"],) + re.search(
                r"isolated ones in wide apertures (\S+ \(\S+\)), of these without the sky's error (\S+ \(\S+\))",
                run["settings"]).groups()))


if __name__ == "__main__":
    main()
