#!/usr/bin/python3
"""Fluxes of isolated stars where the sky has structure: bowls, steps, a large galaxy, cirrus.

    structure.py take FOLDER SEED [SEED...]    tiles, runs, FOLDER/structure.json
    structure.py page FOLDER                   FOLDER/structure.md of what is there, beside before.json where that is, an earlier one's

REXTRACT and SIMULATE name the programs (default: in build/), RX_RESTORERS who takes part (NONE,RL), RX_ARGUMENTS further arguments of rextract.

Tiles of 1024 x 1024 pixels with 400 stars, S/N 5 to 1000 with N(> S) ~ S^-0.9, FWHM 4 pixels, sky of 100 photons, hence 10 a pixel.

  flat      nothing else
  bowls     a sky that was subtracted before with a mesh of 24 pixels, which takes the wings of stars and the galaxies for sky
  steps     eight amplifiers, offset by 0 +- 2 sigma of a pixel
  galaxy    one of half-light radius 90 pixels, 30 sigma in its middle, with two arms that go from 0.6 to 1.4 of its light
  cirrus1   light of power k^-2.9, 1 sigma rms
  cirrus3   the same, 3 sigma

The PSF is given, so that what errors lack is not its. Isolated: no other true source within 4 FWHM. Bins by the S/N that the star would have on the flat sky. Bias: median of (flux - true) / true;
pull: 1.4826 times the median deviation of (flux - true) / error; far: share beyond 3 errors (0.3 % where errors are right).
"""
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from astropy.io import fits
from astropy.table import Table
from scipy.ndimage import map_coordinates, median_filter
from scipy.spatial import cKDTree

import ledger

TOP = Path(__file__).resolve().parent.parent
SIDE, FWHM, SKY, ZERO, STARS = 1024, 4.0, 100.0, 25.0, 400
SKIES = ("flat", "bowls", "steps", "galaxy", "cirrus1", "cirrus3")
BINS = (5, 10, 30, 100, 1000)
COLUMNS = ("XTEMPLATE_IMAGE", "YTEMPLATE_IMAGE", "FLUX_TEMPLATE", "FLUXERR_TEMPLATE", "P_REAL", "FLAGS_RESTORE", "CLASS_TEMPLATE", "RADIUS_TEMPLATE")


def run(name, *arguments):
    program = os.environ.get(name, TOP / "build" / ("rextract" if name == "REXTRACT" else "rextract-simulate"))
    subprocess.run([str(program), *map(str, arguments), "-NTHREADS", os.environ.get("RX_THREADS", "2"), "-VERBOSE_TYPE", "QUIET"], check=True)


def unit():
    """Flux of S/N 1."""
    return np.sqrt(SKY * 4 * np.pi) * FWHM / 2.3548


def cirrus(rng, rms):
    k = np.hypot(*np.meshgrid(np.fft.fftfreq(SIDE), np.fft.rfftfreq(SIDE), indexing="ij"))
    k[0, 0] = 1
    power = k**-1.45
    power[0, 0] = 0
    light = np.fft.irfft2(np.fft.rfft2(rng.normal(size=(SIDE, SIDE))) * power, (SIDE, SIDE))
    return rms * 10 * light / light.std()


def galaxy(rng):
    x, y = np.meshgrid(np.arange(SIDE) - 480.0, np.arange(SIDE) - 530.0)
    x, y = 0.8 * x + 0.6 * y, (0.8 * y - 0.6 * x) / 0.7
    r = np.hypot(x, y)
    arms = 1 + 0.4 * np.cos(2 * (np.arctan2(y, x) - 3 * np.log(r + 10))) * r / (r + 20)
    return 300 * np.exp(-1.678 * r / 90) * arms


def structure(sky, clean, rng):
    """Mean light that is added to the stars', and what is taken off after the noise."""
    if sky == "steps":
        return np.repeat(rng.normal(0, 20, 8), SIDE // 8)[None, :] * np.ones((SIDE, 1)), 0
    if sky == "galaxy":
        return galaxy(rng), 0
    if sky.startswith("cirrus"):
        return cirrus(rng, float(sky[6:])), 0
    if sky == "bowls":
        n = SIDE // 24
        edges = np.linspace(0, SIDE, n + 1).astype(int)
        mesh = np.array([[np.mean(np.minimum(clean[a:b, c:d], 30)) for c, d in zip(edges, edges[1:])] for a, b in zip(edges, edges[1:])])
        at = (np.arange(SIDE) + 0.5) * n / SIDE - 0.5
        return 0, map_coordinates(median_filter(mesh, 3), np.meshgrid(at, at, indexing="ij"), order=1, mode="nearest") * 2
    return 0, 0


def tile(folder, sky, seed):
    limits = ",".join(f"{ZERO - 2.5 * np.log10(s * unit()):.4f}" for s in (1000, 5))
    galaxies = ("-GALAXY_COUNT", 300 if sky == "bowls" else 0, "-GALAXY_MAG", limits, "-GALAXY_SLOPE", 0.36)
    run("SIMULATE", "-IMAGE_SIZE", SIDE, "-SEED", seed, "-MAG_ZEROPOINT", ZERO, "-PSF_FWHM", FWHM, "-STAR_COUNT", STARS, "-STAR_MAG", limits,
        "-STAR_SLOPE", "0.36", *galaxies, "-NOISE_TYPE", "NONE", "-SKY_LEVEL", 0, "-IMAGE_NAME", f"{folder}/clean.fits", "-TRUTH_NAME", f"{folder}/truth.fits")
    clean = fits.getdata(f"{folder}/clean.fits").astype(float)
    rng = np.random.default_rng([seed, SKIES.index(sky)])
    light, off = structure(sky, clean, rng)
    pixels = rng.poisson(np.maximum(clean + light + SKY, 1)) - off
    fits.writeto(f"{folder}/tile.fits", pixels.astype(np.float32), fits.Header([("GAIN", 1.0)]), overwrite=True)


def measure(folder, restorer):
    """(flux - true), error, true flux of each isolated star that is found."""
    (folder / "s.param").write_text("\n".join(COLUMNS) + "\n")
    run("REXTRACT", folder / "tile.fits", "-PSF_TYPE", "MOFFAT", "-PSF_FWHM", FWHM, "-PSF_BETA", 4.765, "-RESTORE_TYPE", restorer, "-RL_NITER", 20, "-CATALOG_TYPE", "FITS_1.0", "-CATALOG_NAME", folder / f"{restorer}.cat",
        "-PARAMETERS_NAME", folder / "s.param", "-BLANK_CHECK", 0, *os.environ.get("RX_ARGUMENTS", "").split())
    t, truth = Table.read(folder / f"{restorer}.cat", hdu=1), Table.read(folder / "truth.fits")
    at = np.column_stack([truth["X_IMAGE"], truth["Y_IMAGE"]])
    alone = (cKDTree(at).query(at, 2)[0][:, 1] > 4 * FWHM) & (truth["MAG"] < 99)
    if "TYPE" in truth.colnames:
        alone &= np.array([str(v).strip().upper().startswith("S") or v == 0 for v in truth["TYPE"]])
    found = np.column_stack([t["XTEMPLATE_IMAGE"], t["YTEMPLATE_IMAGE"]])
    fine = np.isfinite(found).all(axis=1) & np.isfinite(t["FLUX_TEMPLATE"]) & (t["FLAGS_RESTORE"] & 3 == 0)
    d, i = cKDTree(found[fine]).query(at[alone])
    near = d < 0.5 * FWHM
    true = np.array(truth["FLUX"])[alone]
    flux, error = (np.array(t[c])[fine][i] for c in ("FLUX_TEMPLATE", "FLUXERR_TEMPLATE"))
    false = int((cKDTree(at).query(found[fine])[0] > 0.5 * FWHM).sum())
    return {"off": (flux - true)[near].tolist(), "error": error[near].tolist(), "true": true[near].tolist(), "alone": int(alone.sum()), "false": false}


def take(out, *seeds):
    out = Path(out).resolve()
    ledger.claim("structure", str(out), [int(s) for s in seeds])
    rows = {}
    for sky in SKIES:
        for seed in map(int, seeds):
            folder = out / f"{sky}-{seed}"
            folder.mkdir(parents=True, exist_ok=True)
            if not (folder / "tile.fits").exists():
                tile(folder, sky, seed)
            for restorer in os.environ.get("RX_RESTORERS", "NONE,RL").split(","):
                rows.setdefault(f"{sky} {restorer}", []).append(measure(folder, restorer))
    (out / "structure.json").write_text(json.dumps({"seeds": list(seeds), "rows": {k: summary(v) for k, v in rows.items()}}, indent=1) + "\n")
    page(out)


def summary(runs):
    off, error, true = (np.concatenate([r[k] for r in runs]) for k in ("off", "error", "true"))
    row = {"found": len(off), "alone": sum(r["alone"] for r in runs), "false": sum(r["false"] for r in runs), "bins": []}
    for low, high in list(zip(BINS, BINS[1:])) + [(BINS[0], BINS[-1])]:
        here = (true >= low * unit()) & (true < high * unit())
        z = off[here] / error[here]
        row["bins"].append({"n": int(here.sum()), "bias": float(np.median(off[here] / true[here])), "pull": float(1.4826 * np.median(np.abs(z - np.median(z)))),
                            "far": float(np.mean(np.abs(z) > 3)), "error": float(np.median(error[here]) / unit())})
    return row


def page(out):
    kept = json.loads((Path(out) / "structure.json").read_text())
    before = Path(out) / "before.json"  # of an earlier program
    if before.exists():
        rows = json.loads(before.read_text())["rows"]
        kept["rows"] = {key: row for name in kept["rows"] for key, row in ((f"{name}, before", rows[name]), (f"{name}, now", kept["rows"][name]))}
    names = [f"{a} to {b}" for a, b in zip(BINS, BINS[1:])] + ["all"]
    lines = ["# Fluxes where the sky has structure", "", f"Seeds {', '.join(map(str, kept['seeds']))}. Per bin of S/N: bias, pull, share beyond 3 errors.", "",
             "| sky, restorer | found | false | " + " | ".join(names) + " |", "| --- " * (3 + len(names)) + "|"]
    for name, row in kept["rows"].items():
        lines.append(f"| {name} | {row['found']} of {row['alone']} | {row['false']} | " +
                     " | ".join(f"{b['bias']:+.3f} {b['pull']:.2f} {100 * b['far']:.1f}%" for b in row["bins"]) + " |")
    (Path(out) / "structure.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))


if __name__ == "__main__":
    if len(sys.argv) < 3 or sys.argv[1] not in ("take", "page"):
        sys.exit(__doc__)
    globals()[sys.argv[1]](*sys.argv[2:])
