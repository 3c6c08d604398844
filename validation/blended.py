#!/usr/bin/python3
"""How many sources of a field like Rubin's are blends that nothing says so of?

    blended.py FOLDER [SEED[,SEED...] [RESTORER[,RESTORER...]]]     seeds: 311; NONE,RL,NET

Tiles of 2048 x 2048 pixels of 0.2 arcsec (46 square arcmin), seeing 0.8 arcsec, i = 25.8 at S/N 5 for a point, galaxies of 46 x 10^(0.31 (i - 25))
a square arcmin to i = 27 (LSST Science Book, sec. 3.7.2) and 60 stars per Mpixel. Sources of 23 < MAG_AUTO < 24.5 with an object of the truth
within 1 arcsec. A blend has another one within 1 arcsec: of i < 27, or of a tenth of its light (both counted). It is recognised where
the list has two sources within 1 arcsec, or is marked: FLAGS 1 or 2, or P_BLEND above 0.5. Of Rubin's DP1 18 % of these sources are blends
unrecognised beside HST (SITCOMTN-128). Alarms: single sources that are marked. FOLDER gets blended.json and blended.md. RX_PROGRAM names the program.
"""
import json
import sys

import numpy as np
from scipy.spatial import cKDTree

import ledger
import tiles

SIDE, SCALE, FWHM, ZERO, DEPTH = 2048, 0.2, 4.0, 27.0, 25.8
NEAR = 1 / SCALE  # pixels
PER_MPIXEL = 1e6 * SCALE**2 / 3600  # square arcmin
LIMITS = {"i < 27": lambda own, other: other < 27, "a tenth of its light": lambda own, other: other < own + 2.5}


def field(program, seed):
    noise = 10 ** (0.4 * (ZERO - DEPTH)) / (5 * np.sqrt(4 * np.pi) * FWHM / 2.3548)
    tile = program.simulate(f"rubin-{seed}", IMAGE_SIZE=SIDE, SEED=seed, PIXEL_SCALE=SCALE, MAG_ZEROPOINT=ZERO, PSF_FWHM=FWHM, SKY_LEVEL=10,
                            NOISE_SIGMA=f"{noise:.5f}", STAR_COUNT=60, STAR_MAG="18,27", STAR_SLOPE=0.1, GALAXY_COUNT=46 * 10**0.62 * PER_MPIXEL,
                            GALAXY_MAG="19,27", GALAXY_SLOPE=0.31)
    tile.keywords["MAG_ZEROPOINT"] = ZERO
    return tile, tiles.fits.getdata(program.folder / "truth.fits", 1)["MAG"].astype(float)


def measure(run, known, magnitudes, tile):
    """Of each source of that brightness: blends by LIMITS, recognised, marked."""
    t = run.table
    good = (t["MAG_AUTO"] > 23) & (t["MAG_AUTO"] < 24.5) & ((t["FLAGS_RESTORE"] & tiles.MARKS) == 0)
    marked = ((t["FLAGS"] & 3) > 0) | (t["P_BLEND"] > 0.5)
    objects, listed = cKDTree(known), cKDTree(run.positions)
    rows = []
    for k in np.flatnonzero(good):
        here = objects.query_ball_point(run.positions[k], NEAR)
        if not here:
            continue
        own = min(here, key=lambda i: magnitudes[i])
        parts = listed.query_ball_point(run.positions[k], NEAR)
        rows.append([*(any(i != own and limit(magnitudes[own], magnitudes[i]) for i in here) for limit in LIMITS.values()),
                     len(parts) > 1, bool(marked[k])])
    return rows


def main(out, seeds, restorers):
    ledger.claim("blended", out, seeds)
    tiles.COLUMNS += " MAG_AUTO P_BLEND"
    program, rows = tiles.Program(out), {r: [] for r in restorers}
    for seed in seeds:
        tile, magnitudes = field(program, seed)
        for r, run in program.run(tile, restorers).items():
            rows[r] += measure(run, tile.known, magnitudes, tile)
    cells = []
    for r in restorers:
        a = np.array(rows[r], bool)
        split, marked = a[:, -2], a[:, -1]
        for k, limit in enumerate(LIMITS):
            blend = a[:, k]
            cells.append({"restorer": r, "companion": limit, "sources": len(a), "blends": blend.mean(), "split": (blend & split).mean(),
                          "marked": (blend & marked).mean(), "unrecognised": (blend & ~split & ~marked).mean(),
                          "alarms": (~blend & marked).sum() / max((~blend).sum(), 1)})
    names = list(cells[0])
    text = ["# Blends of a field like Rubin's", "", f"`validation/blended.py`, seeds {', '.join(map(str, seeds))}, {program.version()}. Shares of the sources "
            "of 23 to 24.5; split: the list has two within an arcsec; alarms: of the single ones.", "",
            "| " + " | ".join(names) + " |", "|" + " --- |" * len(names)]
    text += ["| " + " | ".join(f"{v:.3f}" if isinstance(v, float) else str(v) for v in c.values()) + " |" for c in cells]
    print("\n".join(text[4:]))
    for name, content in (("json", json.dumps({"seeds": seeds, "cells": cells}, indent=1, default=float)), ("md", "\n".join(text))):
        (program.folder / f"blended.{name}").write_text(content + "\n")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    given = [a.split(",") for a in sys.argv[2:]] + [None] * 2
    main(sys.argv[1], [int(s) for s in given[0] or [311]], tuple(given[1] or tiles.RESTORERS))
