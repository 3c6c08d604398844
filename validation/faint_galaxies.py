#!/usr/bin/python3
"""Galaxies of low surface brightness put into an SDSS frame and into a simulated one: what becomes of their light and size.

    faint_galaxies.py FOLDER_OF_DATA OUTPUT [SEED[,SEED...]]     seeds 1 to 4

Exponential discs, round to 0.5 axis ratio, of effective radius 4 and 8 arcsec (10 and 20 pixels) whose surface brightness there
is 24 to 27 mag/arcsec^2, blurred by the PSF's FWHM, 24 a seed on a grid of places moved at random, with their photon noise.
Each frame is run with them and without: what is measured on images is the difference of both, so that no other source and no
noise of the frame takes part. Medians of each kind:

    light     of the difference of restored images within 2 r_e, over what was put in there
    size      the radius that holds half of that light, over that of what was put in
    pieces    mean number of detections more than without the galaxy, within 2 r_e: 1 is right, more is shredded
    found     share of galaxies of which a detection within r_e / 2 holds at least a tenth of the light
    AUTO      FLUX_AUTO of the detection of most light there over all light put in; radius: its FLUX_RADIUS over r_e
"""
import json
import sys
from pathlib import Path

import numpy as np
from scipy import ndimage

import ledger
import tiles
from tiles import RESTORERS, near

SCALE, ZERO, LEVELS, RADII, COLUMNS, ROWS = 0.396, 22.5, (24, 25, 26, 27), (4, 8), 6, 4
B = 1.67835  # of an exponential disc: half of its light is within r_e


def discs(shape, fwhm, rng):
    """The light put in (nanomaggies a pixel), and each galaxy: x, y (from 0), r_e in pixels, total, mu."""
    light, known = np.zeros(shape), []
    height, width = shape
    kinds = rng.permutation([(mu, r) for mu in LEVELS for r in RADII] * (COLUMNS * ROWS // (len(LEVELS) * len(RADII))))
    for k, (mu, arcsec) in enumerate(kinds):
        x, y = ((k % COLUMNS + 0.5 + rng.uniform(-0.2, 0.2)) * width / COLUMNS, (k // COLUMNS + 0.5 + rng.uniform(-0.2, 0.2)) * height / ROWS)
        r, q, angle = arcsec / SCALE, rng.uniform(0.5, 1), rng.uniform(0, np.pi)
        rows, columns = np.mgrid[0:height, 0:width]
        u = (columns - x) * np.cos(angle) + (rows - y) * np.sin(angle)
        v = (rows - y) * np.cos(angle) - (columns - x) * np.sin(angle)
        disc = 10 ** (0.4 * (ZERO - mu)) * SCALE**2 * np.exp(-B * (np.sqrt(q * u * u + v * v / q) / r - 1))
        light += disc
        known.append((x, y, r, disc.sum(), mu, arcsec))
    return ndimage.gaussian_filter(light, fwhm / 2.3548), known


def half(image, distance, reach):
    """Radius that holds half of the light within `reach`."""
    order = np.argsort(distance[distance < reach])
    grown = np.cumsum(image[distance < reach][order])
    return np.sort(distance[distance < reach])[np.searchsorted(grown, grown[-1] / 2)]


def judge(before, after, light, galaxy):
    x, y, r, total, mu, arcsec = galaxy
    rows, columns = np.indices(light.shape)
    distance = np.hypot(columns - x, rows - y)
    change, inside = after.images["RESTORED"] - before.images["RESTORED"], distance < 2 * r
    at, centre = after.positions - 1, np.array([x, y])
    apart = np.hypot(*(at - centre).T)
    new = (apart < 2 * r) & ~near(at, before.positions - 1, 2.0)
    flux = np.where((apart < r / 2) & (after.table["FLUX_AUTO"] > 0.1 * total), after.table["FLUX_AUTO"], 0)
    row = {"mu": float(mu), "arcsec": float(arcsec), "light": change[inside].sum() / light[inside].sum(),
           "size": half(change, distance, 2 * r) / half(light, distance, 2 * r), "pieces": int(new.sum()), "found": bool(flux.any())}
    if flux.any():
        best = int(np.argmax(flux))
        row |= {"auto": flux[best] / total, "radius": after.table["FLUX_RADIUS"][best] / r}
    return row


def run(program, tile):
    return program.run(tile, images=("RESTORED",), PARAMETERS_NAME="sizes.param")


def main(data, out, seeds="1,2,3,4"):
    ledger.claim("faint_galaxies", out, seeds.split(","))
    program = tiles.Program(out)
    (Path(out) / "sizes.param").write_text("NUMBER\nX_IMAGE\nY_IMAGE\nFLUX_AUTO\nFLUX_RADIUS\n")
    result = []
    for tile, gain, fwhm in ((tiles.sdss_frame(Path(data)), None, None), (program.simulate("simulated frame"), 0, 3.28)):
        gain = tile.keywords["GAIN"] if gain is None else gain
        before, rows = run(program, tile), []
        fwhm = fwhm or before["RL"].fwhm
        for seed in map(int, seeds.split(",")):
            rng = np.random.default_rng([seed, 24])
            light, known = discs(tile.pixels.shape, fwhm, rng)
            noise = rng.standard_normal(light.shape) * np.sqrt(light / gain) if gain else 0
            after = run(program, tile.changed(tile.name, tile.pixels + light + noise))
            rows += [{"restorer": r} | judge(before[r], after[r], light, g) for r in RESTORERS for g in known]
            print(tile.name, seed, flush=True)
        for mu in LEVELS:
            for arcsec in RADII:
                for r in RESTORERS:
                    mine = [a for a in rows if (a["mu"], a["arcsec"], a["restorer"]) == (mu, arcsec, r)]
                    got = [a for a in mine if a["found"]]
                    cell = {"frame": tile.name, "mu": mu, "arcsec": arcsec, "restorer": r, "n": len(mine)}
                    cell |= {k: round(float(np.median([a[k] for a in mine])), 3) for k in ("light", "size")}
                    cell |= {k: round(float(np.mean([a[k] for a in mine])), 3) for k in ("pieces", "found")}
                    cell |= {k: round(float(np.median([a[k] for a in got])), 3) if got else None for k in ("auto", "radius")}
                    result.append(cell)
                    print(cell, flush=True)
    (Path(out) / "summary.json").write_text(json.dumps({"version": program.version(), "seeds": seeds, "cells": result}, indent=1) + "\n")


if __name__ == "__main__":
    if not 3 <= len(sys.argv) <= 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
