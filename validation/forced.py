#!/usr/bin/python3
"""Forced photometry (POSITIONS_NAME): pulls and upper limits at empty places, of faint stars, and of all stars of a list.

    forced.py OUTPUT [SEED ...]      seeds: 61 62 63 64
    forced.py sdss DATA OUTPUT       the SDSS frame at the places of the deep coadd of the same sky: OUTPUT/sdss.md

RESTORE_TYPE NONE, PSF_TYPE AUTO, else defaults, on skies of 100 photons a pixel, FWHM 4 pixels (Moffat, beta 4.765), with stars of
S/N 5 to 3000, N(> S) ~ S^-0.9, S/N that of an isolated point on the sky's noise:

    sparse    500 stars per Mpixel, 1024 x 1024 pixels
    crowd     8,000 stars per Mpixel, 512 x 512 pixels, three skies for each seed
    galaxies  400 stars and 600 galaxies per Mpixel, 1024 x 1024 pixels
    lanczos, drizzle    sparse, as a coadd of four frames, whose noise is correlated

Added are stars of 1, 2, 3, 4 and 5 times the median error at empty places, 400 per Mpixel and S/N; listed are these and as many empty
places, a FWHM or more from all that is there; of these stars those within 0.75 FWHM of another object, which the image does not resolve
by itself, are rows of their own ("blended"). In a second run (sparse, crowd) all stars of the field are listed besides, and all count.

pull: (FLUX_TEMPLATE - true) / FLUXERR_TEMPLATE, its mean and median and half its 16 to 84 %
range; below: share of true fluxes below
FLUXLIM_TEMPLATE; detected: share of rows that were fitted in place of a source. Into OUTPUT: forced.md, summary.json.
"""
import json
import sys
from pathlib import Path

import numpy as np
from astropy.io import fits
from scipy.spatial import cKDTree

import ledger
import tiles

SKY, ZERO, FWHM, ADDED = 100.0, 25.0, 4.0, 400
UNIT = np.sqrt(SKY * 4 * np.pi) * FWHM / 2.3548  # photons of S/N 1
CELLS = {"sparse": (1024, 500, 0, None, 1), "crowd": (512, 8000, 0, None, 3), "galaxies": (1024, 400, 600, None, 1),
         "lanczos": (1024, 500, 0, "LANCZOS", 1), "drizzle": (1024, 500, 0, "DRIZZLE", 1)}
LISTED = ("sparse", "crowd")
BINS = (5, 20, 100, 3000)


def magnitude(flux):
    return f"{ZERO - 2.5 * np.log10(flux):.5f}"


def simulate(program, seed, scene, side, coadd, **keywords):
    """Pixels, header, true x, y (from 1) and fluxes."""
    coadds = {"COADD_TYPE": coadd} if coadd else {}
    base = {"IMAGE_SIZE": side, "SEED": seed, "SCENE_NUMBER": scene, "PSF_FWHM": FWHM, "PSF_BETA": 4.765, "MAG_ZEROPOINT": ZERO, "STAR_SLOPE": 0.36,
            "GALAXY_COUNT": 0, "GALAXY_SLOPE": 0.36, "NOISE_TYPE": "CCD", "SKY_LEVEL": SKY, "GAIN": 1, "READ_NOISE": 0.01, "IMAGE_NAME": "sim.fits",
            "TRUTH_NAME": "truth.fits", **coadds}
    program.call(program.path.with_name("rextract-simulate"), [a for k, v in (base | keywords).items() for a in ("-" + k, v)])
    truth = fits.getdata(program.folder / "truth.fits", 1)
    pixels, header = fits.getdata(program.folder / "sim.fits", header=True)
    return pixels.astype(float), header, np.column_stack([truth["X_IMAGE"], truth["Y_IMAGE"]]).astype(float), 10**(0.4 * (ZERO - truth["MAG"]))


def measure(program, pixels, header, places):
    (program.folder / "list.cat").write_text("# X_IMAGE Y_IMAGE\n" + "".join(f"{x:.5f} {y:.5f}\n" for x, y in places))
    tile = tiles.Tile("forced", "simulated", pixels.astype(np.float32), tiles.bare(header),
                      {"MAG_ZEROPOINT": ZERO, "SATUR_LEVEL": 1e9, "GAIN": 1, "PSF_TYPE": "AUTO"})
    run = program.run(tile, ("NONE",), POSITIONS_NAME="list.cat")["NONE"]
    return fits.getdata(program.folder / "out_FORCED.cat", 1), run.fwhm


def empty(random, count, shape, others, apart):
    tree, kept = cKDTree(others), np.empty((0, 2))
    while len(kept) < count:
        new = random.uniform(8, np.array(shape[::-1]) - 8, (count, 2))
        kept = np.vstack([kept, new[tree.query(new)[0] > apart]])[:count]
    return kept


def rows(table, true, names):
    """What is kept of each row: name, pull, below, replaced."""
    pull = (table["FLUX_TEMPLATE"] - true) / table["FLUXERR_TEMPLATE"]
    return [[n, float(p), bool(b), bool(r)] for n, p, b, r in zip(names, pull, table["FLUXLIM_TEMPLATE"] > true, table["NUMBER_ASSOC"] > 0)]


def sky(program, name, seed, turn):
    side, stars, galaxies, coadd, _ = CELLS[name]
    random, bright = np.random.default_rng([seed, turn]), f"{magnitude(3000 * UNIT)},{magnitude(5 * UNIT)}"
    pixels, header, field, fluxes = simulate(program, seed, 10 * turn, side, coadd, STAR_COUNT=stars, STAR_MAG=bright, GALAXY_COUNT=galaxies,
                                             GALAXY_MAG=bright)
    count = int(ADDED * pixels.size / 1e6)
    first, fwhm = measure(program, pixels, header, empty(random, count, pixels.shape, field, FWHM))
    error, places, true, names = np.median(first["FLUXERR_TEMPLATE"]), [], [], []
    for snr in range(1, 6):
        light, _, at, flux = simulate(program, seed, 10 * turn + snr, side, coadd, STAR_COUNT=ADDED, STAR_MAG=f"{magnitude(snr * error)},{magnitude(snr * error)}",
                                      NOISE_TYPE="NONE", SKY_LEVEL=0)
        pixels += light if coadd else random.poisson(np.clip(light, 0, None))
        places.append(at)
        true.append(flux)
        names += [f"S/N {snr}"] * len(at)
    places, true = np.vstack(places), np.concatenate(true)
    every = np.vstack([field, places])
    free = empty(random, len(places), pixels.shape, every, fwhm)
    table, fwhm = measure(program, pixels, header, np.vstack([places, free]))
    blended = cKDTree(every).query(places, 2)[0][:, 1] < 0.75 * fwhm
    true, names = np.append(true, np.zeros(len(free))), np.array(names + ["empty"] * len(free))
    found = rows(table, true, np.where(np.append(blended, np.zeros(len(free), bool)), "blended", names))
    if name in LISTED:
        table, _ = measure(program, pixels, header, np.vstack([field, places, free]))
        bins = np.clip(np.searchsorted(BINS, fluxes / UNIT) - 1, 0, len(BINS) - 2)
        labels = np.append([f"S/N {BINS[i]} to {BINS[i + 1]}" for i in bins], names)
        found += rows(table, np.append(fluxes, true), np.char.add("all listed: ", labels))
    return found


def summary(found):
    result = {}
    for label in sorted({f[0] for f in found}, key=lambda s: (s.startswith("all"), "empty" not in s, "blended" in s, [int(w) for w in s.split() if w.isdigit()])):
        these = [f for f in found if f[0] == label and np.isfinite(f[1])]
        pulls = np.array([f[1] for f in these])
        low, high = np.percentile(pulls, [15.87, 84.13])
        result[label] = {"n": len(these), "mean": pulls.mean(), "mean_error": pulls.std() / len(pulls)**0.5, "median": np.median(pulls),
                         "width": (high - low) / 2, "below": np.mean([f[2] for f in these]), "detected": np.mean([f[3] for f in these])}
    return result


def page(cells, seeds, version):
    lines = ["# Forced photometry at listed positions", "", f"`validation/forced.py OUTPUT {' '.join(map(str, seeds))}`, {version}. What the columns mean "
             "is said at the head of the script; upper limits are to hold at 0.95 or more.", "",
             "| sky | listed | rows | mean pull | median | width | below the limit | detected |", "| --- | --- | --- | --- | --- | --- | --- | --- |"]
    lines += [f"| {cell} | {label} | {r['n']} | {r['mean']:+.3f} +- {r['mean_error']:.3f} | {r['median']:+.3f} | {r['width']:.3f} | {r['below']:.3f} | "
              f"{r['detected']:.2f} |" for cell, table in cells.items() for label, r in table.items()]
    return "\n".join(lines) + "\n"


def sdss(data, out):
    """Fluxes of points at the places of the coadd's stars beside its own PSF magnitudes."""
    program = tiles.Program(out / "work")
    coadd = fits.getdata(data / "sdss/94-1-12/stripe82_coadd_catalog.fit", 1)
    coadd = coadd[(coadd["probpsf"] > 0.5) & (coadd["psfmag_r"] > 16) & (coadd["psfmag_r"] < 25)]
    columns = [fits.Column(k, f, array=coadd[k.lower()]) for k, f in (("objid", "K"), ("ra", "D"), ("dec", "D"))]
    fits.BinTableHDU.from_columns(columns).writeto(program.folder / "list.fits", overwrite=True)
    program.run(tiles.sdss_frame(data), ("NONE",), POSITIONS_NAME="list.fits")
    found, true = fits.getdata(program.folder / "out_FORCED.cat", 1), 10**(0.4 * (22.5 - coadd["psfmag_r"].astype(float)))
    lines = ["# Stars of the deep coadd on the SDSS frame", "", f"`validation/forced.py sdss DATA OUTPUT`, {program.version()}: PSF magnitudes of the coadd "
             "against FLUX_TEMPLATE at its positions, RESTORE_TYPE NONE, PSF_TYPE AUTO. The pull leaves out the coadd's own errors.", "",
             "| r | stars on the frame | detected on it | median flux ratio | median pull | width | below the limit |", "| --- | --- | --- | --- | --- | --- | --- |"]
    for low, high in ((16, 18), (18, 20), (20, 21), (21, 22), (22, 23), (23, 25)):
        these = (coadd["psfmag_r"] >= low) & (coadd["psfmag_r"] < high) & np.isfinite(found["FLUX_TEMPLATE"])
        f, t = found[these], true[these]
        pull = (f["FLUX_TEMPLATE"] - t) / f["FLUXERR_TEMPLATE"]
        lines.append(f"| {low} to {high} | {len(f)} | {np.mean(f['NUMBER_ASSOC'] > 0):.2f} | {np.median(f['FLUX_TEMPLATE'] / t):.3f} | {np.median(pull):+.2f} | "
                     f"{np.subtract(*np.percentile(pull, [84.13, 15.87])) / 2:.2f} | {np.mean(f['FLUXLIM_TEMPLATE'] > t):.3f} |")
    (out / "sdss.md").write_text("\n".join(lines) + "\n")


def main():
    if sys.argv[1] == "sdss":
        return sdss(Path(sys.argv[2]), Path(sys.argv[3]))
    out, seeds = Path(sys.argv[1]), [int(s) for s in sys.argv[2:]] or [61, 62, 63, 64]
    ledger.claim("forced", out, seeds)
    program, cells = tiles.Program(out / "work"), {}
    for name, (*_, turns) in CELLS.items():
        found = [f for seed in seeds for turn in range(turns) for f in sky(program, name, seed, turn)]
        cells[name] = summary(found)
        (out / "summary.json").write_text(json.dumps({"seeds": seeds, "cells": cells}, indent=1, default=float) + "\n")
        (out / "forced.md").write_text(page(cells, seeds, program.version()))
        print(name, json.dumps(cells[name], default=float), flush=True)


if __name__ == "__main__":
    main()
