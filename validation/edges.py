#!/usr/bin/python3
"""P_REAL where the sky has structure: edges of chips, bright and dark nebulae.

    edges.py FOLDER [SEED[,SEED...]]     seeds: 101,102,103

Tiles of a Mpixel with 1,500 stars and 1,500 galaxies, as rextract-simulate makes them (noise 10 ADU), by Richardson-Lucy: as they are (0);
with two edges across which the sky rises by 1, 2 and 3 sigmas (1, 2, 3); with a nebula of lognormal brightness and power k^-3,
smooth within the PSF, of 2 sigmas (N), and the same as a dark cloud of up to 6 sigmas (D). A detection is real where a true object of
at least 0.3 of its FLUX_TEMPLATE lies within 3 pixels. FOLDER gets edges.json and edges.md: real and false detections, and how
many of the real are below P_REAL 0.5, of the false above. REXTRACT names the program (build/rextract), SIMULATE that which makes the tiles:
the same command with an earlier program is what a change is worth.
"""
import json
import os
import subprocess
import sys

import numpy as np
from astropy.io import fits
from scipy.spatial import cKDTree

import ledger
from crowded import run

NOISE, SKIES = 10.0, "0123ND"


def sky(kind, shape, seed):
    """What is added, ADU."""
    y, x = np.indices(shape)
    if kind.isdigit():
        return int(kind) * NOISE * ((x >= 300).astype(float) + (y >= 650))
    k = np.hypot(*np.meshgrid(np.fft.rfftfreq(shape[1]), np.fft.fftfreq(shape[0])))
    power = np.where(k > 1 / 256, np.maximum(k, 1e-9), np.inf)**-1.5 * np.exp(-(k * 2 * np.pi * 1.7)**2 / 2)
    g = np.fft.irfft2(np.fft.rfft2(np.random.default_rng(seed).normal(size=shape)) * power, shape)
    cloud = np.exp(0.9 * g / g.std())
    return 2 * NOISE * cloud if kind == "N" else -6 * NOISE * cloud / cloud.max()


def count(folder, kind):
    """Real, real below 0.5, false, false above 0.5."""
    with fits.open(f"{folder}/{kind}.cat") as hdus, fits.open(f"{folder}/truth.fits") as truth:
        t, true = hdus[1].data, truth[1].data
    tree = cKDTree(np.column_stack([true["X_IMAGE"], true["Y_IMAGE"]]))
    flux = 10**(-0.4 * (np.array(true["MAG"], float) - 25))
    near = tree.query_ball_point(np.column_stack([t["X_IMAGE"], t["Y_IMAGE"]]), 3)
    real = np.array([any(flux[k] > 0.3 * f for k in some) for some, f in zip(near, t["FLUX_TEMPLATE"])])
    likely = t["P_REAL"] >= 0.5
    return [int(n.sum()) for n in (real, real & ~likely, ~real, ~real & likely)]


def main():
    folder, seeds = os.path.abspath(sys.argv[1]), [int(s) for s in (sys.argv[2:3] or ["101,102,103"])[0].split(",")]
    ledger.claim("edges", folder, seeds)
    sums = {kind: [0] * 4 for kind in SKIES}
    for seed in seeds:
        here = f"{folder}/{seed}"
        os.makedirs(here, exist_ok=True)
        run(here, "SIMULATE", "-IMAGE_SIZE", 1024, "-SEED", seed, "-STAR_COUNT", 1500, "-GALAXY_COUNT", 1500, "-IMAGE_NAME", "sim.fits", "-TRUTH_NAME",
            "truth.fits")
        with open(f"{here}/p.param", "w") as file:
            file.write("X_IMAGE\nY_IMAGE\nFLUX_TEMPLATE\nP_REAL\n")
        for kind in SKIES:
            with fits.open(f"{here}/sim.fits") as hdus:
                pixels = hdus[0].data + sky(kind, hdus[0].data.shape, seed)
                fits.writeto(f"{here}/{kind}.fits", pixels.astype("f4"), hdus[0].header, overwrite=True)
            run(here, "REXTRACT", f"{kind}.fits", "-RESTORE_TYPE", "RL", "-CATALOG_NAME", f"{kind}.cat", "-CATALOG_TYPE", "FITS_1.0", "-PARAMETERS_NAME", "p.param")
            sums[kind] = [a + b for a, b in zip(sums[kind], count(here, kind))]
            print(seed, kind, sums[kind], flush=True)
    text = ["# P_REAL where the sky has structure", "", f"`validation/edges.py`, seeds {', '.join(map(str, seeds))}, RL. 1 to 3: two edges of so many sigmas; N, D: a bright "
            "nebula, a dark cloud.", "", "| sky | real | of them P_REAL < 0.5 | false | of them P_REAL >= 0.5 |", "| --- | --- | --- | --- | --- |"]
    text += ["| " + " | ".join(map(str, [kind, *row])) + " |" for kind, row in sums.items()]
    for name, content in (("json", json.dumps({"seeds": seeds, "skies": sums}, indent=1)), ("md", "\n".join(text))):
        with open(f"{folder}/edges.{name}", "w") as file:
            file.write(content + "\n")


if __name__ == "__main__":
    try:
        main()
    except (OSError, KeyError, subprocess.CalledProcessError) as problem:
        raise SystemExit(f"edges.py: {problem}") from problem
