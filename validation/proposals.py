#!/usr/bin/python3
"""Which sources there are: FILTER_TYPE AUTO, decided by the original pixels, beside CONV.

    proposals.py FOLDER [SEED [TILES]]     seed 1, 3 tiles of 512 x 512 pixels for each seeing and kind
    proposals.py real DATA FOLDER          real tiles as they are and upside down (2 median - pixel, in which no source is real), and the
                                           SDSS frame against the deep coadd's catalogue

The first is the campaign of detection.conf, with RL by 18 iterations and a filter of half a FWHM, once as it stands and once with
AUTO from 3 sigmas on: FOLDER gets a table of average precision and of recall at precision 0.95. REXTRACT and VALIDATE name the
programs (build/rextract, build/rextract-validate).
"""
import bz2
import csv
import os
import re
import subprocess
import sys

import numpy as np
from astropy.io import fits
from astropy.wcs import WCS
from scipy.spatial import cKDTree

import ledger

HERE = os.path.dirname(os.path.abspath(__file__))
MODEL = os.environ.get("RX_MODEL", f"{HERE}/../config/psfnet.fits")
WAYS = {"CONV": ["-STAGE.FILTER_TYPE", "CONV"], "AUTO": ["-STAGE.FILTER_TYPE", "AUTO", "-STAGE.DETECT_THRESH", "3"]}
REAL = ("sdss/94-1-12/frame-r-000094-1-0012.fits.bz2", "sdss/reprojected_sdss_r.fits.bz2", "sextractor/galaxies.fits", "fields/M6707HH.fits",
        "fields/aligned_eso085-030-004.fit", "fields/spitzer_example_image.fits", "decam/c4d_171113_060340_ooi_r_ls9.N6.fits",
        "reports/vircam_h_swarp_median_400.fits", "reports/viking_z_mystery.fits")


def program(name, default):
    return os.path.abspath(os.environ.get(name, f"{HERE}/../build/{default}"))


def campaign(folder, seed, tiles):
    ledger.claim("proposals", folder, [seed])
    cells = {}
    for way, more in WAYS.items():
        subprocess.run([program("VALIDATE", "rextract-validate"), "-c", f"{HERE}/detection.conf", "-SEED", str(seed), "-SCENES", "STARS,GALAXIES",
                        "-SCENE_TILES", f"{tiles},{tiles}", "-TUNE_NITER", "18", "-TUNE_FILTER", "0.5", "-QA_FIGURES", "N", "-STAGE.NET_MODEL", MODEL,
                        "-OUTPUT_NAME", way, "-JOURNAL_NAME", f"{way}.journal", *more], cwd=folder, check=True)
        with open(f"{folder}/{way}/cells.ecsv") as file:
            for row in csv.DictReader(line for line in file if not line.startswith("#")):
                cells[way, row["scene"], row["condition"], row["run"].split()[0], row["quantity"]] = float(row["value"])
    columns = [(way, run) for run in ("NONE", "MATCHED", "RL", "NET") for way in WAYS if (way, run) != ("AUTO", "MATCHED")]
    lines = [f"Seed {seed}, {tiles} tiles of 512 x 512 pixels a row; RL with 18 iterations; average precision / recall at precision 0.95.", "",
             "| | " + " | ".join(f"{run} {way}" if run != "MATCHED" else "matched filter" for way, run in columns) + " |", "| --- |" + " --- |" * len(columns)]
    for scene, condition in dict.fromkeys(key[1:3] for key in cells):
        values = [f"{cells[way, scene, condition, run, 'ap']:.3f} / {cells[way, scene, condition, run, 'recall_p0.95']:.3f}" for way, run in columns]
        lines.append(f"| {scene.lower()}, {condition} | " + " | ".join(values) + " |")
    with open(f"{folder}/cells.md", "w") as file:
        file.write("\n".join(lines) + "\n")


def detect(folder, tile, way, *more):
    """Positions and log."""
    with open(f"{folder}/p.param", "w") as file:
        file.write("X_IMAGE\nY_IMAGE\n")
    done = subprocess.run([program("REXTRACT", "rextract"), tile, "-RESTORE_TYPE", "NONE", "-CATALOG_NAME", "p.cat", "-CATALOG_TYPE", "FITS_1.0",
                           "-PARAMETERS_NAME", "p.param", "-FILTER_TYPE", way, *more], cwd=folder, check=True, capture_output=True, text=True)
    table = fits.getdata(f"{folder}/p.cat", 1)
    return np.column_stack([table["X_IMAGE"], table["Y_IMAGE"]]), done.stderr


def against_coadd(data, tile, found):
    """Recall from r = 22 to 23, and share of the list that the coadd's catalogue has."""
    reference = fits.getdata(f"{data}/sdss/94-1-12/stripe82_coadd_catalog.fit", 1)
    sky = np.column_stack(WCS(fits.getheader(tile)).all_world2pix(reference["ra"], reference["dec"], 1))
    inside = np.all((sky > 1) & (sky < [2048, 1489]), axis=1)
    faint = sky[inside & (reference["psfmag_r"] > 22) & (reference["psfmag_r"] < 23)]
    return (cKDTree(found).query(faint)[0] < 3).mean(), (cKDTree(sky[inside]).query(found)[0] < 3).mean()


def real(data, folder):
    lines = ["Sources by NONE, and on the tile upside down with the PSF of the tile (a Moffat of its FWHM), all of which are false.", "",
             "| tile | Mpixel | CONV | AUTO | CONV, upside down | AUTO, upside down |", "| --- | --- | --- | --- | --- | --- |"]
    after = []
    for name in REAL:
        tile = f"{folder}/tile.fits"
        with open(f"{data}/{name}", "rb") as packed, open(tile, "wb") as plain:
            plain.write(bz2.decompress(packed.read()) if name.endswith(".bz2") else packed.read())
        with fits.open(tile) as hdus:
            pixels = next(hdu.data for hdu in hdus if hdu.data is not None and hdu.data.ndim == 2).astype("f4")
        fits.writeto(f"{folder}/inverse.fits", (2 * np.nanmedian(pixels) - pixels).astype("f4"), overwrite=True)
        auto, log = detect(folder, "tile.fits", "AUTO")
        conv, _ = detect(folder, "tile.fits", "CONV")
        width = re.search(r"FWHM ([0-9.]+) px", log)
        psf = ["-PSF_TYPE", "MOFFAT", "-PSF_FWHM", width.group(1) if width else "3"]
        false = [len(detect(folder, "inverse.fits", way, *psf)[0]) for way in ("CONV", "AUTO")]
        lines.append(f"| {os.path.basename(name)} | {pixels.size / 1e6:.2f} | {len(conv)} | {len(auto)} | {false[0]} | {false[1]} |")
        if "frame-r" in name:
            for way, found in (("CONV", conv), ("AUTO", auto)):
                recall, known = against_coadd(data, tile, found)
                after.append(f"SDSS frame, {way}: {recall:.3f} of the coadd's sources of r = 22 to 23; {known:.3f} of the list are in that catalogue, which ends near 23.")
    with open(f"{folder}/real.md", "w") as file:
        file.write("\n".join(lines + [""] + after) + "\n")


def main():
    if sys.argv[1] == "real":
        os.makedirs(sys.argv[3], exist_ok=True)
        real(os.path.abspath(sys.argv[2]), os.path.abspath(sys.argv[3]))
    else:
        os.makedirs(sys.argv[1], exist_ok=True)
        campaign(os.path.abspath(sys.argv[1]), int((sys.argv[2:3] or [1])[0]), int((sys.argv[3:4] or [3])[0]))


if __name__ == "__main__":
    main()
