#!/usr/bin/python3
"""Are the program's warnings right, and does it warn where results are wrong? On good skies and on bad ones.

    alarms.py OUTPUT [SEED[,SEED...] [NAME[,NAME...]]]

SEED: 101 to try and to choose by, from 1000 on final ones (ledger.py). Skies are those of robustness.py and those of MORE, with more
stars of S/N 10 to 100. NONE and RL run on each at default settings, by RX_PROGRAM and, where RX_OLD names an earlier program, by that.
What a sky does to results is measured on all seeds together, against the truth; it fails where one of LIMITS is passed. A word is
a warning of the log about that tile. It is right where the sky fails by that restorer, or the sources do that it is about, those in
places which the model does not explain (FLAGS_RESTORE 32; of earlier programs 512 and 1024, too). A silent failure is a sky that
fails on which a tile has no word. Stars are measured that have no neighbour of a twentieth of their flux within 2 FWHM.
Into OUTPUT: summary.json.
"""
import json
import os
import re
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

import ledger
import robustness
import tiles
from robustness import CROWD, FWHM, GIVEN, SIGMA, SKY, STARS, Departure, clouds

RESTORERS = ("NONE", "RL")
LIMITS = {"bias": 0.03, "pull": 1.3, "false": 0.05}  # of stars of S/N 20 to 200 and 10 to 100; of the sources without a mark
DOUBT = 32 | 512 | 1024  # FLAGS_RESTORE
ANEW = {STARS: 600, "STAR_MAG": "16,23", "GALAXY_COUNT": 200}


def bowls(x, y, rng):
    """Over-subtracted sky: hollows as wide as the mesh of a reduction, a sigma deep."""
    at = rng.uniform(0, x.shape[0], (12, 2))
    return -sum(np.exp(-((x - u) ** 2 + (y - v) ** 2) / 2 / 25**2) for u, v in at)


def amplifiers(x, y, rng):
    return np.select([x < 200, x < 400, x < 600], [0, 1.2, -0.8], 0.6)


def edge_glow(x, y, rng):
    return 4 * np.exp(-x / 12) + 4 * np.exp(-(y.max() - y) / 12)


def streaks(x, y, rng):
    out = np.zeros(x.shape)
    for _ in range(8):
        angle, at = rng.uniform(0, np.pi), rng.uniform(0, x.shape[0], 2)
        out += 3 * np.exp(-((x - at[0]) * np.sin(angle) - (y - at[1]) * np.cos(angle)) ** 2 / 2 / 1.4**2)
    return out


def interpolated(pixels, x, y):
    """Every 40th column is the mean of its neighbours."""
    out, bad = pixels.copy(), np.arange(20, pixels.shape[1] - 1, 40)
    out[:, bad] = (pixels[:, bad - 1] + pixels[:, bad + 1]) / 2
    return out


CCD = {"NOISE_TYPE": "CCD", "GAIN": 905, "READ_NOISE": 5}
MORE = [
    Departure("good", "FWHM 1.3", "", {"PSF_FWHM": 1.3}),
    Departure("good", "FWHM 2.3", "", {"PSF_FWHM": 2.3}),
    Departure("good", "FWHM 5", "", {"PSF_FWHM": 5}),
    Departure("good", "FWHM 8", "", {"PSF_FWHM": 8}),
    Departure("good", "FWHM 14", "", {"PSF_FWHM": 14}),
    Departure("good", "sparse", "", {STARS: 80, "GALAXY_COUNT": 60}),
    Departure("good", "galaxies x5", "", {"GALAXY_COUNT": 1500}),
    Departure("good", "large galaxies", "", {"GALAXY_COUNT": 120, "GALAXY_MAG": "14,21", "GALAXY_SCALE": 3}),
    Departure("good", "shallow", "", {"NOISE_SIGMA": 0.2}),
    Departure("good", "photons known", "", CCD, run={"GAIN": 905}),
    Departure("good", "x30 wide", "", {STARS: 6000, "PSF_FWHM": 4.5, **CROWD}),
    Departure("bad", "bowls", "", post=bowls),
    Departure("bad", "amplifiers", "", post=amplifiers),
    Departure("bad", "cirrus", "", post=clouds(60, 5)),
    Departure("bad", "streaks", "", post=streaks),
    Departure("bad", "interpolated columns", "", edit=interpolated),
    Departure("bad", "gain x5", "", CCD, run={"GAIN": 905 * 5}),
    Departure("bad", "gain /5", "", CCD, run={"GAIN": 905 / 5}),
    Departure("bad", "edge glow", "", post=edge_glow),
    Departure("bad", "given 5 % wide", "", run={**GIVEN, "PSF_FWHM": 1.05 * FWHM}),
    Departure("bad", "columns", "", post=lambda x, y, rng: 0.5 * rng.standard_normal(x.shape[1])[None, :]),
]
SKIES = [d for d in robustness.DEPARTURES if d.name != "cut-outs"] + MORE


def measure(run, known, width, side):
    """Counts and values of all sources, and of those that are marked as in places which the model does not explain."""
    at, flux, snr, star, clear = known
    fwhm, tree = 2.3548 * width, cKDTree(at)
    alone = np.array([all(flux[j] < 0.05 * flux[i] for j in tree.query_ball_point(at[i], 2 * fwhm) if j != i) for i in range(len(at))])
    reach = max(2.0, fwhm)
    distance, which = cKDTree(run.positions).query(at, distance_upper_bound=reach)
    found = star & clear & alone & np.isfinite(distance)
    which = np.where(found, which, 0)
    got, error = run.table["FLUX_TEMPLATE"][which], run.table["FLUXERR_TEMPLATE"][which]
    found &= np.isfinite(got) & (error > 0) & (snr > 10) & (snr < 200)
    flags, false = run.table["FLAGS_RESTORE"], ~tiles.near(run.positions, at, reach) & robustness.inside(run.positions, side)
    in_doubt, out = (flags & DOUBT) > 0, {}
    for name, these, hidden in ("all", np.ones(len(flags), bool), flags & (robustness.MARKS | DOUBT)), ("doubt", in_doubt, flags & robustness.MARKS & ~DOUBT):
        use = found & these[which]
        out[name] = {"sources": int(these.sum()), "false": int((false & these & (hidden == 0)).sum()),
                     "ratio": (got / flux - 1)[use & (snr > 20)].tolist(), "pulls": ((got - flux) / error)[use & (snr < 100)].tolist()}
    return out


def limits_passed(parts):
    pool = {k: sum((p[k] for p in parts), type(parts[0][k])()) for k in parts[0]}
    ratio, pulls = np.array(pool["ratio"]), np.array(pool["pulls"])
    cell = {"sources": pool["sources"], "stars": len(pulls), "false": round(pool["false"] / max(pool["sources"], 1), 4),
            "bias": round(float(np.median(ratio)), 4) if len(ratio) > 9 else 0.0,
            "pull": round(float(robustness.spread(pulls)), 3) if len(pulls) > 14 else 0.0}
    return cell | {"fails": [k for k, most in LIMITS.items() if abs(cell[k]) > most]}


def words(run, restorer):
    """The warnings of the tile that are about this restorer, or about none."""
    other = [r for r in RESTORERS if r != restorer]
    return [w for w in run.said if "has no effect" not in w and (restorer + ": " in w or not any(o + ": " in w for o in other))]


def main(output, seeds, names):
    ledger.claim("alarms", output, seeds)
    programs = {"new": tiles.Program(output)}
    if os.environ.get("RX_OLD"):
        programs["old"] = tiles.Program(output)
        programs["old"].path = Path(os.environ["RX_OLD"]).resolve()
    cells = []
    for sky in SKIES:
        if names and sky.name not in names:
            continue
        parts = {(p, r): [] for p in programs for r in RESTORERS}
        said = {k: [] for k in parts}
        for seed in seeds:
            tile, truth, width = robustness.expose(programs["new"], replace(sky, sim=ANEW | sky.sim), seed, 0)
            known = robustness.objects(truth, width, tile.pixels)
            for p, program in programs.items():
                for r, run in program.run(tile, RESTORERS).items():
                    parts[p, r].append(measure(run, known, width, len(tile.pixels)))
                    said[p, r].append(words(run, r))
        for (p, r), found in parts.items():
            cell = {"program": p, "sky": sky.name, "restorer": r} | limits_passed([f["all"] for f in found])
            doubt = limits_passed([f["doubt"] for f in found])
            cell |= {"doubt": round(doubt["sources"] / max(cell["sources"], 1), 3), "pull_doubt": doubt["pull"], "false_doubt": doubt["false"],
                     "right": bool(cell["fails"] or doubt["fails"]), "tiles": len(seeds), "with_word": sum(bool(s) for s in said[p, r]),
                     "silent": sum(not s for s in said[p, r]) if cell["fails"] else 0,
                     "words": Counter(re.sub("[0-9.]+", "#", w)[:150] for s in said[p, r] for w in s)}
            cells.append(cell)
            print({k: v for k, v in cell.items() if k != "words"}, *cell["words"].items(), sep="\n    ", flush=True)
    summary = {"version": programs["new"].version(), "seeds": seeds, "limits": LIMITS, "cells": cells}
    for p in programs:
        own = [c for c in cells if c["program"] == p]
        told = sum(c["with_word"] for c in own)
        summary[p] = {"tiles": sum(c["tiles"] for c in own), "failing": sum(c["tiles"] for c in own if c["fails"]), "with_word": told,
                      "right": sum(c["with_word"] for c in own if c["right"]), "where_sky_fails": sum(c["with_word"] for c in own if c["fails"]), "silent": sum(c["silent"] for c in own)}
        print(p, summary[p])
    (Path(output) / "summary.json").write_text(json.dumps(summary, indent=1) + "\n")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1], [int(s) for s in (sys.argv[2] if len(sys.argv) > 2 else "101").split(",")],
         sys.argv[3].split(",") if len(sys.argv) > 3 else [])
