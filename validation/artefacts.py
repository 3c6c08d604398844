#!/usr/bin/python3
"""What no light made: how many false sources pass unmarked, and how many stars and galaxies are marked with them.

    artefacts.py FOLDER [SEED[,SEED...] [KIND[,KIND...] [FWHM[,FWHM...] [RESTORER[,RESTORER...]]]]]

SEED: 101 to try and to choose by, from 1000 on final ones (ledger.py). KIND: of KINDS. Tiles have 640 x 640 pixels of noise 10 ADU with the
photons of a gain of 10, 800 stars of S/N 3 to 3000 and 200 galaxies per Mpixel (fewer above FWHM 4.5), FWHM 1.3 to 14; the program measures its PSF.

    clean     nothing is added
    hits      400 cosmic rays per Mpixel: tracks through a detector 10 pixels thick (120 ADU a pixel), low electrons, single pixels
    trails    two satellites, 1 to 3 FWHM wide (to 20 pixels), 0.3 to 10 sigma a pixel, one of them 1 to 3 sigma
    columns   12 interpolated columns of 1 to 3 pixels, between their neighbours or the median of five; beside half of them 3 sigma were left
    edges     a gap of 20 columns and a tilted corner without data, whose border pixels are filled by 0 to 1; light of 5 sigma that
              falls off by e in 3 pixels at an edge; a step of 2 sigma between two amplifiers
    crowd     nothing is added, 12,000 stars per Mpixel
    pairs     nothing is added, half of the stars have a companion at 0.5 to 1.5 FWHM
    cut       nothing is added, stars are saturated at S/N of 300

A source is false where no object is within 2 pixels and within 0.75 FWHM (the larger), unmarked where FLAGS_RESTORE says neither
spurious nor sharp (MARKS). A star or galaxy is marked where the source nearest to it, within the same, is sharp; those whose light touches
what was added are left out. FOLDER gets artefacts.json and artefacts.md. RX_PROGRAM names the program.
"""
import json
import sys

import numpy as np
from astropy.io import fits
from scipy.ndimage import binary_dilation, gaussian_filter
from scipy.spatial import cKDTree

import ledger
import tiles

SIDE, NOISE, GAIN, EDGE = 640, 10.0, 10.0, 8
KINDS = ("clean", "hits", "trails", "columns", "edges", "crowd", "pairs", "cut")
MARKS, SHARP = 1 | 2 | 256, 256
FWHMS = (1.3, 2.2, 3, 4, 6, 14)


def magnitude(snr, fwhm):
    return 25 - 2.5 * np.log10(snr * NOISE * np.sqrt(4 * np.pi) * fwhm / 2.3548)


def track(out, rng, x, y, angle, length, light):
    """`light` ADU a pixel of the way, spread by diffusion of 0.25 pixels."""
    steps = max(int(20 * length), 1)
    at = (np.arange(steps) + 0.5) / steps * length
    u, v = x + at * np.cos(angle) + rng.normal(0, 0.25, steps), y + at * np.sin(angle) + rng.normal(0, 0.25, steps)
    good = (u >= 0) & (v >= 0) & (u < SIDE) & (v < SIDE)
    np.add.at(out, (v[good].astype(int), u[good].astype(int)), light * length / steps)


def hits(pixels, fwhm, rng):
    out = np.zeros(pixels.shape)
    for _ in range(int(400 * pixels.size / 1e6)):
        x, y = rng.uniform(0, SIDE, 2)
        angle, kind = rng.uniform(0, 2 * np.pi), rng.uniform()
        if kind < 0.5:  # muons, cos^2 of the zenith angle; at least through one pixel
            track(out, rng, x, y, angle, min(max(10 * np.tan(np.arccos(rng.uniform() ** (1 / 3))), 0.7), 80), 120 * rng.uniform(0.7, 2))
        elif kind < 0.7:  # electrons that are scattered
            for _ in range(rng.integers(3, 20)):
                track(out, rng, x, y, angle, 1.0, 120 * rng.uniform(1, 4))
                x, y, angle = x + np.cos(angle), y + np.sin(angle), angle + rng.normal(0, 0.6)
        else:  # of one pixel, or two
            u, v = int(x), int(y)
            out[v, u] += NOISE * 10 ** rng.uniform(0.7, 2.5)
            if kind > 0.9:
                out[v, min(u + 1, SIDE - 1)] += out[v, u] * rng.uniform(0.3, 1)
    return pixels + out, out > 0


def trails(pixels, fwhm, rng):
    y, x = np.indices(pixels.shape).astype(float)
    out = np.zeros(pixels.shape)
    for light in (10 ** rng.uniform(-0.5, 1), 10 ** rng.uniform(0, 0.5)):
        angle, width = rng.uniform(0, np.pi), min(fwhm * rng.uniform(1, 3), 20)
        offset = (x - rng.uniform(200, 440)) * np.sin(angle) - (y - rng.uniform(200, 440)) * np.cos(angle)
        out += light * NOISE * np.exp(-offset ** 2 / 2 / (width / 2.3548) ** 2)
    return pixels + out, out > 0.2


def columns(pixels, fwhm, rng):
    out, touched = pixels.copy(), np.zeros(pixels.shape, bool)
    for k in range(12):
        x, width = 30 + 50 * k + rng.integers(0, 15), k % 3 + 1
        if k % 2:
            out[:, [x - 1, x + width]] += 3 * NOISE
        for i in range(width):
            share = (i + 1) / (width + 1)
            if k % 4 < 2:
                out[:, x + i] = (1 - share) * out[:, x - 1] + share * out[:, x + width]
            else:
                out[:, x + i] = np.median(out[:, [x - 3, x - 2, x - 1, x + width, x + width + 1]], axis=1)
        touched[:, x - 1:x + width + 1] = True
    return out, touched


def edges(pixels, fwhm, rng):
    y, x = np.indices(pixels.shape).astype(float)
    out = pixels.copy()
    out[:, 150:] += 5 * NOISE * np.exp(-(x[:, 150:] - 150) / 3)
    out[:, 400:] += 2 * NOISE
    corner = (x - 640) * 0.9 - (y - 560) * 0.44
    partly = (x == 129) | (x == 150) | (abs(corner) < 0.7)
    share = rng.uniform(0, 1, pixels.shape)
    out = np.where(partly, out * share, out)
    gone = ((x > 129) & (x < 150)) | (corner >= 0.7)
    out = np.where(gone, np.where(x < 200, np.nan, 0), out)
    return out, binary_dilation(gone | partly | (abs(x - 400) < 2) | ((x > 140) & (x < 165)), iterations=2)


def nothing(pixels, fwhm, rng):
    return pixels, np.zeros(pixels.shape, bool)


def make(program, kind, fwhm, seed):
    stars = {"STAR_COUNT": 12000, "STAR_SLOPE": 0.2} if kind == "crowd" else {"STAR_COUNT": 800, "STAR_SLOPE": 0.05}
    more = {"PAIR_SHARE": 0.5, "PAIR_DISTANCE": "0.5,1.5"} if kind == "pairs" else {}
    peak = 300 * NOISE * np.sqrt(4 * np.pi) * fwhm / 2.3548 / (1.133 * fwhm ** 2 + 1)
    more |= {"SATUR_LEVEL": 1000 + peak} if kind == "cut" else {}
    count = min(1, (4.5 / fwhm) ** 2)  # as crowded in FWHM
    stars["STAR_COUNT"] = int(stars["STAR_COUNT"] * count)
    tile = program.simulate(kind, IMAGE_SIZE=SIDE, MAG_ZEROPOINT=25, PSF_FWHM=fwhm, SKY_LEVEL=1000, NOISE_TYPE="CCD", GAIN=GAIN, READ_NOISE=5,
                            STAR_MAG=f"{magnitude(3000, fwhm)},{magnitude(3, fwhm)}", GALAXY_COUNT=int(200 * count), GALAXY_SLOPE=0.3,
                            GALAXY_MAG=f"{magnitude(500, fwhm)},{magnitude(5, fwhm)}", SEED=seed, NTHREADS=1, **stars, **more)
    truth = np.array(fits.getdata(program.folder / "truth.fits", 1))
    rng = np.random.default_rng(seed + int(100 * fwhm))
    pixels, touched = globals().get(kind, nothing)(tile.pixels.astype(float), fwhm, rng)
    tile = tile.changed(kind, pixels)
    tile.keywords = {"GAIN": GAIN, "MAG_ZEROPOINT": 25, "NTHREADS": 1, "SATUR_LEVEL": 1000 + 0.98 * peak if kind == "cut" else 1e9}
    return tile, truth, touched


def measure(run, truth, touched, fwhm):
    reach = max(2.0, 0.75 * fwhm)
    t, at = run.table, np.column_stack([truth["X_IMAGE"], truth["Y_IMAGE"]]).astype(float)
    inner = ((run.positions > EDGE) & (run.positions < SIDE - EDGE)).all(1)
    marked = (t["FLAGS_RESTORE"] & MARKS) > 0
    false = inner & ~tiles.near(run.positions, at, reach)
    near = gaussian_filter(touched.astype(float), max(fwhm / 2.3548, 1)) > 1e-3
    u, v = np.clip(np.rint(at).astype(int) - 1, 0, SIDE - 1).T
    star = ~near[v, u]
    distance, which = cKDTree(run.positions).query(at[star], distance_upper_bound=reach)
    found = np.isfinite(distance)
    spoilt = (t["FLAGS_RESTORE"][which[found]] & SHARP) > 0
    return {"sources": len(t), "false": int(false.sum()), "unmarked": int((false & ~marked).sum()), "objects": int(found.sum()), "marked": int(spoilt.sum())}


def main(folder, seeds, kinds, fwhms, restorers):
    ledger.claim("artefacts", folder, seeds)
    tiles.COLUMNS += " P_REAL"
    program, cells = tiles.Program(folder), []
    for kind in kinds:
        for fwhm in fwhms:
            sums, mpixel = {r: {} for r in restorers}, 0
            for seed in seeds:
                tile, truth, touched = make(program, kind, fwhm, seed)
                mpixel += (SIDE - 2 * EDGE) ** 2 / 1e6
                for r, run in program.run(tile, restorers).items():
                    for k, n in measure(run, truth, touched, fwhm).items():
                        sums[r][k] = sums[r].get(k, 0) + n
            for r in restorers:
                s = sums[r]
                cells.append({"kind": kind, "fwhm": fwhm, "restorer": r, **s, "unmarked_per_mpixel": round(s["unmarked"] / mpixel, 1),
                              "marked_per_1000": round(1000 * s["marked"] / max(s["objects"], 1), 2)})
                print(*cells[-1].values(), flush=True)
    text = ["# Artefacts", "", f"`validation/artefacts.py`, seeds {', '.join(map(str, seeds))}, {program.version()}. False: without an object; unmarked: without a "
            "mark; both counted, the second per Mpixel. Objects: found where nothing was added; marked: as hits.", "",
            "| kind | FWHM | restorer | sources | false | unmarked per Mpixel | objects | marked |", "| --- | --- | --- | --- | --- | --- | --- | --- |"]
    text += ["| " + " | ".join(str(c[k]) for k in ("kind", "fwhm", "restorer", "sources", "false", "unmarked_per_mpixel", "objects", "marked")) + " |" for c in cells]
    for name, content in (("json", json.dumps({"seeds": seeds, "cells": cells}, indent=1)), ("md", "\n".join(text))):
        (program.folder / f"artefacts.{name}").write_text(content + "\n")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    given = [a.split(",") for a in sys.argv[2:]] + [None] * 4
    main(sys.argv[1], [int(s) for s in given[0] or [101]], given[1] or KINDS, [float(f) for f in given[2] or FWHMS], tuple(given[3] or ("NONE", "RL")))
