#!/usr/bin/python3
"""What Richardson-Lucy gathers around stars, beside their own light: sigmas of the sky's noise per pixel of an aperture.

    flux_scale.py FOLDER [SEED[,SEED...]]     seeds: 101 to 112

Tiles of 400 x 360 pixels with 3,500 stars per Mpixel of magnitude 15 to 21 (noise 10 ADU, FWHM 4), restored by RL with the true PSF. Around each
true star above S/N 50 that is 12 pixels and more from any as bright and from the border: the sum of the restored image within 10 pixels
less that of the tile on its known sky, over the 314 pixels, in sigmas. FOLDER gets flux_scale.md: median, its error, by magnitude. REXTRACT and
SIMULATE name the programs.
"""
import os
import subprocess
import sys

import numpy as np
from astropy.io import fits
from scipy.spatial import cKDTree

import ledger
from crowded import run

NOISE, RADIUS, SHAPE, MAGNITUDES = 10.0, 10, (360, 400), (15, 16, 17, 18)


def gathered(here, seed):
    """Magnitudes of the stars, and what their apertures have more once restored, sigmas a pixel."""
    os.makedirs(here, exist_ok=True)
    run(here, "SIMULATE", "-IMAGE_SIZE", f"{SHAPE[1]},{SHAPE[0]}", "-SEED", seed, "-PSF_FWHM", 4, "-NOISE_SIGMA", NOISE, "-SKY_LEVEL", 0,
        "-STAR_COUNT", 3500, "-STAR_MAG", "15,21", "-GALAXY_COUNT", 0, "-IMAGE_NAME", "sim.fits", "-TRUTH_NAME", "truth.fits")
    run(here, "REXTRACT", "sim.fits", "-RESTORE_TYPE", "RL", "-PSF_TYPE", "MOFFAT", "-PSF_FWHM", 4, "-CATALOG_TYPE", "NONE", "-CHECKIMAGE_TYPE", "RESTORED",
        "-CHECKIMAGE_NAME", "restored.fits", "-BACK_TYPE", "MANUAL", "-BACK_VALUE", 0)
    with fits.open(f"{here}/truth.fits") as truth:
        at = np.column_stack([truth[1].data["X_IMAGE"], truth[1].data["Y_IMAGE"]]) - 1
        mag = np.array(truth[1].data["MAG"], float)
    more = fits.getdata(f"{here}/restored.fits").astype(float) - fits.getdata(f"{here}/sim.fits")
    y, x = np.indices(SHAPE)
    bright = (mag < MAGNITUDES[-1]) & (np.minimum(at, np.array(SHAPE[::-1]) - 1 - at).min(axis=1) > 12)
    some = cKDTree(at)
    alone = [i for i in np.flatnonzero(bright) if not any(mag[j] <= mag[i] for j in some.query_ball_point(at[i], 12) if j != i)]
    inside = [np.hypot(x - at[i, 0], y - at[i, 1]) <= RADIUS for i in alone]
    return mag[alone], np.array([more[k].mean() / NOISE for k in inside])


def main():
    folder, seeds = os.path.abspath(sys.argv[1]), [int(s) for s in sys.argv[2].split(",")] if len(sys.argv) > 2 else list(range(101, 113))
    ledger.claim("flux_scale", folder, seeds)
    mag, more = (np.concatenate(part) for part in zip(*(gathered(f"{folder}/{seed}", seed) for seed in seeds)))
    text = ["# What RL gathers around stars", "", f"`validation/flux_scale.py`, seeds {seeds[0]} to {seeds[-1]}.", "", "| magnitude | stars | sigmas a pixel |", "| --- | --- | --- |"]
    for a, b in zip(MAGNITUDES, MAGNITUDES[1:]):
        some = more[(mag >= a) & (mag < b)]
        text.append(f"| {a} to {b} | {len(some)} | {np.median(some):.4f} +- {1.2533 * some.std() / np.sqrt(len(some)):.4f} |")
    ledger.store(folder, "flux_scale", text)


if __name__ == "__main__":
    try:
        main()
    except (OSError, KeyError, subprocess.CalledProcessError) as problem:
        raise SystemExit(f"flux_scale.py: {problem}") from problem
