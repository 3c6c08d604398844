#!/usr/bin/python3
"""Richardson-Lucy against its number of iterations, plain and accelerated.

    iterations.py run FOLDER [SEED ...]    simulated tiles (seeds 401, 402): FOLDER/summary.json and page
    iterations.py page FOLDER              FOLDER/iterations.md anew

REXTRACT and SIMULATE name the programs (default: those in build/), RX_THREADS the threads (2).

What the columns mean

A tile has 1024 x 1024 pixels, 2000 stars and 300 galaxies of S/N 5 to 3000 with N(> S) ~ S^-0.9 on a sky of 100 photons, seen through
a Moffat PSF (beta 4.765) of that FWHM, which is given (PSF_TYPE MOFFAT). PSNR: 10 log10(peak^2 / mean square error) of asinh(image / 3
sigma), of the restored image smoothed to the sharp truth's PSF (Gaussian, 2 pixels), peak 1000 sigma. AP and bias from the default
catalogue (RL_DENOISE 0.8 FWHM, its detection list in the order of FLUX_AUTO / FLUXERR_AUTO): area under precision over recall;
median MAG_AUTO - true of stars of S/N above 200 that have no neighbour of more than 1 % of their flux within 5 FWHM. An accelerated iteration takes
the same four transforms.
"""
import json
import os
import sys
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

import crowded
import ledger

PLAIN = (5, 10, 15, 20, 30, 50, 100, 200, 400)
FAST = (4, 6, 8, 10, 12, 15, 18, 22, 30, 50, 100)
FWHMS = (2.5, 4.0, 7.0)
COLUMNS = ("X_IMAGE", "Y_IMAGE", "MAG_AUTO", "FLUX_AUTO", "FLUXERR_AUTO")


def make(folder, fwhm, seed):
    limits = ",".join(f"{crowded.ZERO - 2.5 * np.log10(s * crowded.unit(fwhm)):.4f}" for s in (3000, 5))
    crowded.run(folder, "SIMULATE", "-IMAGE_SIZE", 1024, "-SEED", seed, "-MAG_ZEROPOINT", crowded.ZERO, "-PSF_FWHM", fwhm, "-STAR_COUNT",
                2000, "-STAR_MAG", limits, "-STAR_SLOPE", "0.36", "-GALAXY_COUNT", 300, "-GALAXY_MAG", limits, "-GALAXY_SLOPE", "0.36",
                "-GAIN", "1", "-READ_NOISE", "0.01", "-NOISE_TYPE", "CCD", "-SKY_LEVEL", crowded.SKY, "-SHARP_NAME", "sharp.fits",
                "-SHARP_FWHM", "2")


def extract(folder, fwhm, restorer, *arguments):
    """rl.cat and rl.fits of it. restorer: RESTORE_TYPE and its arguments."""
    (Path(folder) / "c.param").write_text("\n".join(COLUMNS) + "\n")
    crowded.run(folder, "REXTRACT", "sim.fits", "-RESTORE_TYPE", *restorer, "-PSF_TYPE", "MOFFAT", "-PSF_FWHM", fwhm, "-PARAMETERS_NAME",
                "c.param", "-CATALOG_TYPE", "FITS_1.0", "-CATALOG_NAME", "rl.cat", "-MAG_ZEROPOINT", crowded.ZERO, "-GAIN", "1",
                "-BLANK_CHECK", "0", "-FILTER_NAME", crowded.TOP / "config/default.conv", "-CHECKIMAGE_TYPE", "RESTORED",
                "-CHECKIMAGE_NAME", "rl.fits", *arguments)


def restore(folder, fwhm, niter, accelerate, *arguments):
    extract(folder, fwhm, ("RL", "-RL_NITER", niter, "-RL_ACCELERATE", accelerate), *arguments)


def psnr(image, sharp):
    scale, top = 3 * crowded.SKY**0.5, 1000 * crowded.SKY**0.5
    error = np.mean((np.arcsinh(image / scale) - np.arcsinh(sharp / scale))**2)
    return 10 * np.log10(np.arcsinh(top / scale)**2 / error)


def judge(folder, fwhm):
    """AP of the list, and bias and scatter of the magnitudes of bright, lonely stars."""
    found, truth = crowded.table(f"{folder}/rl.cat"), crowded.table(f"{folder}/sim_truth.fits")
    order = np.argsort(-found["FLUX_AUTO"] / found["FLUXERR_AUTO"], kind="stable")
    at = np.column_stack([truth["X_IMAGE"], truth["Y_IMAGE"]])
    tree, used, of = cKDTree(at), np.zeros(len(at), bool), np.full(len(order), -1)
    for k, i in enumerate(order):
        here = np.array([found["X_IMAGE"][i], found["Y_IMAGE"][i]])
        free = [j for j in tree.query_ball_point(here, 0.5 * fwhm) if not used[j]]
        if free:
            of[k] = min(free, key=lambda j: np.sum((at[j] - here)**2))
            used[of[k]] = True
    right = of >= 0
    ap = np.sum(np.cumsum(right) / np.arange(1, len(right) + 1) * right) / len(at)
    flux = 10**(-0.4 * truth["MAG"])
    lonely = [all(flux[j] < 0.01 * flux[k] or j == k for j in near) for k, near in enumerate(tree.query_ball_point(at, 5 * fwhm))]
    snr = flux * 10**(0.4 * crowded.ZERO) / crowded.unit(fwhm)
    bright = right & np.array(lonely)[of] & (snr[of] > 200)
    off = found["MAG_AUTO"][order][bright] - truth["MAG"][of[bright]]
    return {"ap": ap, "recall": right.sum() / len(at), "precision": right.mean(), "bias": np.median(off), "scatter": crowded.width(off),
            "bright": int(bright.sum())}


def campaign(out, *seeds):
    rows = []
    ledger.claim("iterations", out, seeds)
    for seed in seeds or ("401", "402"):
        for fwhm in FWHMS:
            folder = os.path.abspath(f"{out}/{fwhm}-{seed}")
            os.makedirs(folder, exist_ok=True)
            make(folder, fwhm, seed)
            sharp = crowded.image(f"{folder}/sharp.fits")
            for accelerate, numbers in (("N", PLAIN), ("Y", FAST)):
                for niter in numbers:
                    restore(folder, fwhm, niter, accelerate)
                    row = {"seed": int(seed), "fwhm": fwhm, "accelerate": accelerate, "niter": niter} | judge(folder, fwhm)
                    restore(folder, fwhm, niter, accelerate, "-RL_DENOISE", 2 / fwhm)
                    restored = crowded.image(f"{folder}/rl.fits")
                    row |= {"psnr": psnr(restored - np.median(restored), sharp - np.median(sharp))}
                    rows.append(row)
                    print(" ".join(f"{k} {v:.4g}" if isinstance(v, float) else f"{k} {v}" for k, v in row.items()), flush=True)
    crowded.keep(f"{out}/summary.json", rows)


def page(out):
    """Means over the seeds."""
    rows = json.loads((Path(out) / "summary.json").read_text())
    seeds = sorted({r["seed"] for r in rows})
    text = ["# Richardson-Lucy against its number of iterations", "", f"Seeds {', '.join(map(str, seeds))}.", ""]
    text += __doc__.split("What the columns mean")[1].strip().splitlines() + [""]
    for fwhm in FWHMS:
        text += [f"## FWHM {fwhm:g} pixels", "", "| RL_NITER | RL_ACCELERATE | AP | recall | precision | bias [mag] | scatter [mag] | PSNR [dB] |",
                 "| --- | --- | --- | --- | --- | --- | --- | --- |"]
        for accelerate, numbers in (("N", PLAIN), ("Y", FAST)):
            for niter in numbers:
                these = [r for r in rows if (r["fwhm"], r["accelerate"], r["niter"]) == (fwhm, accelerate, niter)]
                ap, recall, precision, bias, scatter, quality = (np.mean([r[k] for r in these]) for k in (
                    "ap", "recall", "precision", "bias", "scatter", "psnr"))
                text.append(f"| {niter} | {accelerate} | {ap:.3f} | {recall:.3f} | {precision:.3f} | {bias:+.4f} | {scatter:.4f} | {quality:.2f} |")
        text.append("")
    (Path(out) / "iterations.md").write_text("\n".join(text))


if __name__ == "__main__":
    if len(sys.argv) < 3 or sys.argv[1] not in ("run", "page"):
        sys.exit("usage: iterations.py run FOLDER [SEED ...] | iterations.py page FOLDER")
    if sys.argv[1] == "run":
        campaign(*sys.argv[2:])
    page(sys.argv[2])
