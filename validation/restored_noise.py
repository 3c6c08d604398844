#!/usr/bin/python3
"""CHECKIMAGE_TYPE RESTORED_RMS against the scatter of many exposures of one sky.

    restored_noise.py FOLDER [SEED [EXPOSURES]]     seed 41, 24 exposures

The same 600 stars and 300 galaxies on 512 x 512 pixels, FWHM 4, a sky of 100 photons, in 24 exposures that differ in their noise: white, and
coadds of four frames, Lanczos-interpolated and drizzled. RESTORED_RMS is that of the first; all are restored. By the light that is there, in sigmas of the sky: rms of what is stated and
scatter of the restored images, both over pixels, and the rms of pulls of single pixels. Then fluxes of isolated stars in apertures of 2 to 20 pixels on
restored images: scatter over FLUXERR_APER. REXTRACT, SIMULATE and RX_MODEL as in crowded.py; RX_PROGRAMS the restorers (NONE,RL,NET).
"""
import os
import subprocess
import sys

import numpy as np
from astropy.io import fits
from scipy.spatial import cKDTree

import ledger
from crowded import MODEL, run

SIDE, FWHM, SKY, ZERO = 512, 4.0, 100.0, 30.0
KINDS = {"white": [], "Lanczos": ["-COADD_TYPE", "LANCZOS", "-COADD_FRAMES", "4"], "drizzled": ["-COADD_TYPE", "DRIZZLE", "-COADD_FRAMES", "4"]}
EDGES = (-9, 0.3, 1, 3, 10, 100, 1e9)
DIAMETERS = (2, 3, 4, 6, 10, 20)


def simulate(folder, name, seed, arguments):
    if not os.path.exists(f"{folder}/{name}.fits"):
        run(folder, "SIMULATE", "-IMAGE_NAME", f"{name}.fits", "-TRUTH_NAME", f"{name}_truth.fits", "-IMAGE_SIZE", str(SIDE), "-SEED", str(seed), "-MAG_ZEROPOINT", str(ZERO),
            "-PSF_FWHM", str(FWHM), "-GAIN", "1", "-READ_NOISE", "0.01", "-SKY_LEVEL", str(SKY), *arguments)


def restore(folder, name, by, rms):
    checks = ["RESTORED", "BACKGROUND"] + ["RESTORED_RMS"] * rms
    files = [f"{name}.{by}.{c}.fits" for c in checks]
    run(folder, "REXTRACT", f"{name}.fits", "-RESTORE_TYPE", by, "-NET_MODEL", MODEL, "-PSF_TYPE", "MOFFAT", "-PSF_FWHM", str(FWHM), "-CATALOG_TYPE", "FITS_1.0", "-CATALOG_NAME",
        f"{name}.{by}.cat", "-PARAMETERS_NAME", "p.param", "-PHOT_APERTURES", ",".join(map(str, DIAMETERS)), "-SATUR_LEVEL", "1e9", "-BLANK_CHECK", "0", "-CHECKIMAGE_TYPE", ",".join(checks),
        "-CHECKIMAGE_NAME", ",".join(files))
    planes = [np.array(fits.getdata(f"{folder}/{f}"), float) for f in files]
    for f in files:
        os.remove(f"{folder}/{f}")
    with fits.open(f"{folder}/{name}.{by}.cat") as hdus:
        c = hdus[1].data
        return planes[0] - planes[1], planes[-1] if rms else None, np.column_stack([c["X_IMAGE"], c["Y_IMAGE"]]), np.array(c["FLUX_APER"], float), np.array(c["FLUXERR_APER"], float)


def pixels(images, rms, light):
    scatter, rows = images.var(0, ddof=1), []
    for low, high in zip(EDGES, EDGES[1:]):
        some = (light >= low) & (light < high) & np.isfinite(rms)
        pulls = (images[:, some] - images[:, some].mean(0)) * np.sqrt(len(images) / (len(images) - 1)) / rms[some]
        rows.append({"from": low, "n": int(some.sum()), "stated": float(np.sqrt((rms[some]**2).mean())), "found": float(np.sqrt(scatter[some].mean())),
                     "pull": float(np.sqrt((pulls**2).mean()))})
    return rows


def apertures(lists, at, isolated):
    flux = np.full((len(lists), len(at), len(DIAMETERS)), np.nan)
    error = flux.copy()
    for k, (xy, f, e) in enumerate(lists):
        distance, j = cKDTree(xy).query(at)
        near = distance < 1.5
        flux[k, near], error[k, near] = f[j[near]], e[j[near]]
    use = isolated & (np.isfinite(flux[:, :, 0]).sum(0) > 0.8 * len(lists))
    pulls = (flux - np.nanmean(flux, 0))[:, use] * np.sqrt(len(lists) / (len(lists) - 1)) / error[:, use]
    return {"stars": int(use.sum()), "pulls": [float(np.sqrt(np.nanmean(pulls[:, :, i]**2))) for i in range(len(DIAMETERS))]}


def main():
    folder, seed = os.path.abspath(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 41
    exposures = int(sys.argv[3]) if len(sys.argv) > 3 else 24
    ledger.claim("restored_noise", folder, [seed])
    os.makedirs(folder, exist_ok=True)
    with open(f"{folder}/p.param", "w") as file:
        file.write(f"X_IMAGE\nY_IMAGE\nFLUX_APER({len(DIAMETERS)})\nFLUXERR_APER({len(DIAMETERS)})\n")
    simulate(folder, "sky", 1000 * seed, ["-STAR_COUNT", "2300", "-STAR_MAG", "17,25", "-GALAXY_COUNT", "1150", "-GALAXY_MAG", "18,25", "-NOISE_TYPE", "NONE"])
    with fits.open(f"{folder}/sky_truth.fits") as hdus:
        truth = hdus[1].data
        at, stars = np.column_stack([truth["X_IMAGE"], truth["Y_IMAGE"]]), np.char.strip(np.array(truth["TYPE"], str)) == "STAR"
    isolated = stars & (cKDTree(at).query(at, k=2)[0][:, 1] > 3 * FWHM)
    rows = []
    for kind, arguments in KINDS.items():
        for by in os.environ.get("RX_PROGRAMS", "NONE,RL,NET").split(","):
            images, lists = [], []
            for k in range(exposures):
                name = f"{kind}{k}"
                simulate(folder, name, 1000 * seed + k + 1, ["-CATALOG_NAME", "sky_truth.fits", "-NOISE_TYPE", "CCD", *arguments])
                image, map_, *found = restore(folder, name, by, k == 0)
                images.append(image)
                lists.append(found)
                rms = map_ if k == 0 else rms
            sigma = float(np.median(np.array([i[rms.shape[0] // 2] for i in images]).std(0))) if by == "NONE" else sigma
            light = (np.array(fits.getdata(f"{folder}/sky.fits"), float) - SKY) / sigma
            rows.append({"noise": kind, "by": by, "exposures": exposures, "pixels": pixels(np.array(images), rms, light), "apertures": apertures(lists, at, isolated)})
            print(kind, by, [(r["from"], round(r["stated"], 2), round(r["found"], 2), round(r["pull"], 2)) for r in rows[-1]["pixels"]], rows[-1]["apertures"], flush=True)
    heads = [f"{a:g} to {b:g}" if a > 0 and b < 1e9 else f"below {b:g}" if a <= 0 else f"above {a:g}" for a, b in zip(EDGES, EDGES[1:])]
    text = ["# Noise of restored images", "", f"`validation/restored_noise.py`, seed {seed}, {exposures} exposures of one sky. By the light that is there, in sigmas of the sky: RESTORED_RMS : scatter "
            "of the restored images (rms of pulls).", "", "| noise | | " + " | ".join(heads) + " |", "| --- | --- |" + " --- |" * len(heads)]
    text += [f"| {r['noise']} | {r['by']} | " + " | ".join(f"{p['stated']:.2f} : {p['found']:.2f} ({p['pull']:.2f})" for p in r["pixels"]) + " |" for r in rows]
    text += ["", "Fluxes of isolated stars on restored images, apertures of so many pixels across: scatter over FLUXERR_APER.", "",
             "| noise | | stars | " + " | ".join(map(str, DIAMETERS)) + " |", "| --- | --- | --- |" + " --- |" * len(DIAMETERS)]
    text += [f"| {r['noise']} | {r['by']} | {r['apertures']['stars']} | " + " | ".join(f"{p:.2f}" for p in r["apertures"]["pulls"]) + " |" for r in rows]
    ledger.store(folder, "restored_noise", text, {"seed": seed, "rows": rows})


if __name__ == "__main__":
    try:
        main()
    except (OSError, KeyError, subprocess.CalledProcessError) as problem:
        raise SystemExit(f"restored_noise.py: {problem}") from problem
