#!/usr/bin/python3
"""Crowded fields: template photometry beside IRAF's ALLSTAR in two passes, on the same simulated tiles.

    crowded.py FOLDER [SEED[,SEED...] [CELL[,CELL...]]]     seeds: 1,2; cells: all

A cell is DENSITY-FWHM with V where the PSF varies and G where a fifth of the objects are galaxies: 8000-4, 500-2.5V,
20000-6VG. DENSITY 500, 2000, 8000, 20000 objects per Mpixel, FWHM 2.5, 4, 6 pixels. REXTRACT and SIMULATE in the environment
name the programs (default: rextract and rextract-simulate in the current folder), RX_MODEL the network's model
(config/psfnet.fits), RX_ARGUMENTS further arguments of rextract, RX_PROGRAMS which take part (NONE,NET,ALLSTAR). FOLDER gets one folder a cell and seed; what lies there is
not made again.

A tile has 1024 x 1024 pixels, a sky of 100 photons, and objects of S/N 5 to 3000 with N(> S) ~ S^-0.9, S/N that of an isolated
point on the sky's noise. Both measure the PSF on the tile. In the order of S/N (SNR_TEMPLATE, 1 / MERR) each detection takes the
true object within half a FWHM that is nearest in position (pixels) and magnitude (halves of one), each object once. "At 0.95":
recall where precision falls below 0.95. AP: area under precision over recall. Then, by true S/N, of matched objects median and
scatter (1.4826 times the median deviation) of measured - true magnitude and the width of that over the error. ALLSTAR's
magnitudes are those of an aperture: they are shifted by the median of stars above S/N 200. chi2: mean over pixels of residual^2 /
true variance.

IRAF (Debian: iraf, iraf-noao) is run as its user guide says: daofind, phot, pstselect, psf, allstar; again daofind on what is left,
pfmerge, allstar. Where it is not installed the tables say so.
"""
import os
import shutil
import subprocess
import sys
import time

import numpy as np
from astropy.io import fits
from scipy.spatial import cKDTree

MODEL = os.path.abspath(os.environ.get("RX_MODEL", f"{os.path.dirname(__file__)}/../config/psfnet.fits"))
SIDE, SKY, ZERO = 1024, 100.0, 25.0
CELLS = [f"{d}-{f}{k}" for d in (500, 2000, 8000, 20000) for f in ("2.5", "4", "6") for k in ("", "V", "G", "VG")]
BINS = (5, 10, 20, 50, 200, 3001)
COLUMNS = ("NUMBER", "XTEMPLATE_IMAGE", "YTEMPLATE_IMAGE", "MAG_TEMPLATE", "MAGERR_TEMPLATE", "SNR_TEMPLATE",
           "EVIDENCE_TEMPLATE", "CHI2_TEMPLATE", "FLAGS_RESTORE", "FLAGS")
IRAF = """noao
digiphot
daophot
daophot.verify=no
daophot.update=no
daophot.verbose=no
datapars.fwhmpsf={fwhm}
datapars.sigma=10.
datapars.datamin=20.
datapars.datamax=INDEF
datapars.noise="poisson"
datapars.readnoise=0.
datapars.epadu=1.
findpars.threshold={threshold}
findpars.sharplo=0.1
findpars.sharphi=1.2
centerpars.calgorithm="none"
fitskypars.salgorithm="mode"
fitskypars.annulus={annulus}
fitskypars.dannulus=10.
photpars.apertures="{fwhm}"
photpars.zmag=25.
daopars.function="moffat25,moffat15,penny2"
daopars.varorder={order}
daopars.psfrad={radius}
daopars.fitrad={fwhm}
daopars.fitsky=no
daopars.recenter=yes
daopars.groupsky=yes
daopars.maxiter=50
daopars.maxgroup=100
daopars.matchrad={match}
daopars.nclean=3
daofind i i.coo1 interactive-
phot i i.coo1 i.mag1 interactive-
pstselect i i.mag1 i.pst1 30 interactive-
psf i i.mag1 i.pst1 i_pm i.pst2 i.psg1 interactive-
allstar i i.mag1 i_pm i.als1 i.arj1 i_sub1
daofind i_sub1 i.coo2 interactive-
phot i_sub1 i.coo2 i.mag2 interactive-
pfmerge i.als1,i.mag2 i.mrg
allstar i i.mrg i_pm i.als2 i.arj2 i_sub2
pdump i.als2 XCENTER,YCENTER,MAG,MERR yes > i.als2.txt
logout
"""


def program(name):
    return os.path.abspath(os.environ.get(name, "rextract" if name == "REXTRACT" else "rextract-simulate"))


def run(folder, name, *arguments):
    with open(f"{folder}/log", "a") as log:
        subprocess.run([program(name), *arguments, "-NTHREADS", "2"], cwd=folder, check=True, stdout=log, stderr=log)


def cell(name):
    density, rest = name.split("-")
    return float(density), float(rest.rstrip("VG")), "V" in rest, "G" in rest


def unit(fwhm):
    """Flux of S/N 1."""
    return np.sqrt(SKY * 4 * np.pi) * fwhm / 2.3548


def make(folder, name, seed):
    density, fwhm, varying, mixed = cell(name)
    low, high = (f"{ZERO - 2.5 * np.log10(s * unit(fwhm)):.4f}" for s in (3000, 5))
    galaxies = 0.2 * density * mixed
    common = ["-IMAGE_SIZE", str(SIDE), "-SEED", str(seed), "-MAG_ZEROPOINT", str(ZERO), "-PSF_FWHM", str(fwhm),
              "-PSF_VARIATION", "0.15" if varying else "0", "-STAR_COUNT", str(density - galaxies), "-STAR_MAG", f"{low},{high}",
              "-STAR_SLOPE", "0.36", "-GALAXY_COUNT", str(galaxies), "-GALAXY_MAG", f"{low},{high}", "-GALAXY_SLOPE", "0.36",
              "-GAIN", "1", "-READ_NOISE", "0.01"]
    run(folder, "SIMULATE", *common, "-NOISE_TYPE", "CCD", "-SKY_LEVEL", str(SKY))
    run(folder, "SIMULATE", *common, "-NOISE_TYPE", "NONE", "-SKY_LEVEL", "0", "-IMAGE_NAME", "clean.fits", "-TRUTH_NAME", "")


def extract(folder, restorer):
    with open(f"{folder}/c.param", "w") as param:
        param.write("\n".join(COLUMNS) + "\n")
    begin = time.time()
    run(folder, "REXTRACT", "sim.fits", "-RESTORE_TYPE", restorer, "-NET_MODEL", MODEL, "-CATALOG_TYPE", "FITS_1.0",
        "-CATALOG_NAME", f"{restorer}.cat", "-PARAMETERS_NAME", "c.param", "-FILTER", "Y", "-FILTER_NAME",
        os.path.abspath(f"{os.path.dirname(__file__)}/../config/default.conv"), "-MAG_ZEROPOINT", str(ZERO), "-BLANK_CHECK", "0",
        "-SATUR_LEVEL", "1e9", "-CHECKIMAGE_TYPE", "TEMPLATE_RESIDUAL", "-CHECKIMAGE_NAME", f"{restorer}.res.fits",
        *os.environ.get("RX_ARGUMENTS", "").split())
    with open(f"{folder}/{restorer}.seconds", "w") as file:
        file.write(f"{time.time() - begin:.1f}\n")


def allstar(folder, name):
    _, fwhm, varying, _ = cell(name)
    work = f"{folder}/iraf"
    shutil.rmtree(work, ignore_errors=True)  # IRAF writes over nothing
    os.makedirs(f"{work}/uparm")
    data = fits.getdata(f"{folder}/sim.fits")
    fits.writeto(f"{work}/i.fits", data, overwrite=True)
    with open(f"{work}/login.cl", "w") as login:
        login.write(f'set home = "{work}/"\nset imdir = "HDR$"\nset uparm = "{work}/uparm/"\nset cache = "{work}/"\n'
                    'set userid = "me"\nset imtype = "fits"\npackage user\nclpackage\nkeep\n')
    # S/N 5 through daofind's filter (Stetson 1987), in sigmas of a pixel: 1.4 at FWHM 4
    script = IRAF.format(fwhm=fwhm, threshold=5.6 / fwhm, annulus=5 * fwhm, order=2 if varying else 0, radius=4 * fwhm,
                         match=max(1.0, fwhm / 2))
    begin = time.time()
    with open(f"{work}/log", "w") as log:
        subprocess.run(["irafcl"], input=script, cwd=work, env={**os.environ, "HOME": work, "TERM": "dumb"}, stdout=log, stderr=log,
                       text=True, check=False)
    if not os.path.exists(f"{work}/i.als2.txt"):
        raise SystemExit(f"crowded.py: ALLSTAR wrote no list; see {work}/log")
    with open(f"{folder}/ALLSTAR.seconds", "w") as file:
        file.write(f"{time.time() - begin:.1f}\n")


def image(name):
    return fits.getdata(name).astype(float)


def measured(folder, by):
    """x, y, magnitude, its error, rank; residual image."""
    if by != "ALLSTAR":
        with fits.open(f"{folder}/{by}.cat") as hdus:
            t = hdus[1].data
            t = t[np.isfinite(t["FLAGS_RESTORE"]) & (t["FLAGS_RESTORE"] & 3 == 0)]  # not significant, or split off
            rows = [t[c] for c in COLUMNS[1:6]]
        return np.array(rows, float), image(f"{folder}/{by}.res.fits")
    with open(f"{folder}/iraf/i.als2.txt") as file:
        rows = np.array([[np.nan if v == "INDEF" else float(v) for v in line.split()] for line in file]).T
    residual = image(f"{folder}/iraf/i_sub2.fits")
    return np.vstack([rows, 1 / rows[3]]), residual - np.median(residual)


def judge(folder, name, by):
    _, fwhm, _, _ = cell(name)
    (x, y, mag, err, rank), residual = measured(folder, by)
    with fits.open(f"{folder}/sim_truth.fits") as hdus:
        truth = hdus[1].data
        at, true = np.column_stack([truth["X_IMAGE"], truth["Y_IMAGE"]]), np.array(truth["MAG"], float)
    snr = 10**(-0.4 * (true - ZERO)) / unit(fwhm)
    good = np.isfinite(mag + rank + err)
    x, y, mag, err, rank = (v[good][np.argsort(-rank[good], kind="stable")] for v in (x, y, mag, err, rank))
    tree, used, of = cKDTree(at), np.zeros(len(at), bool), np.full(len(x), -1)
    near = tree.query_ball_point(np.column_stack([x, y]), 0.5 * fwhm)
    if by == "ALLSTAR":
        d, i = tree.query(np.column_stack([x, y]))
        bright = (snr[i] > 200) & (d < 0.25 * fwhm)
        mag = mag - np.median(mag[bright] - true[i[bright]])
    for k, candidates in enumerate(near):
        free = [j for j in candidates if not used[j]]
        if free:
            of[k] = min(free, key=lambda j: np.sum((at[j] - (x[k], y[k]))**2) + ((true[j] - mag[k]) / 0.5)**2)
            used[of[k]] = True
    variance = image(f"{folder}/clean.fits") + SKY
    return {"right": of >= 0, "rank": rank, "objects": len(at), "snr": snr[of], "dm": np.where(of >= 0, mag - true[of], np.nan),
            "err": err, "chi2": np.mean(residual**2 / variance), "seconds": float(open(f"{folder}/{by}.seconds").read()),
            "complete": [used[(snr >= a) & (snr < b)].mean() for a, b in zip(BINS, BINS[1:])]}


def row(by, each):
    right, rank = (np.concatenate([e[k] for e in each]) for k in ("right", "rank"))
    right = right[np.argsort(-rank, kind="stable")]
    objects, hits = sum(e["objects"] for e in each), np.cumsum(right)
    precision = hits / np.arange(1, len(right) + 1)
    cells = [by, f"{np.max(np.where(precision >= 0.95, hits, 0)) / objects:.3f}", f"{np.sum(precision * right) / objects:.3f}",
             f"{right.sum() / objects:.3f} {right.mean():.3f}"]
    snr, dm, err, ok = (np.concatenate([e[k] for e in each]) for k in ("snr", "dm", "err", "right"))
    for low, high in zip(BINS, BINS[1:]):
        d, s = (v[ok & (snr >= low) & (snr < high)] for v in (dm, err))
        if len(d) < 5:
            cells.append("")
            continue
        middle, pull = np.median(d), d / s
        width, pulls = (1.4826 * np.median(np.abs(v - np.median(v))) for v in (d, pull))
        cells.append(f"{middle:+.3f} {width:.3f} {pulls:.2f}")
    return cells + [f"{np.mean([e['chi2'] for e in each]):.3f}", f"{np.mean([e['seconds'] for e in each]):.0f}"]


def show(name, folders, programs):
    print(f"\n{name}\n\n| | at 0.95 | AP | recall, precision | " +
          " | ".join(f"S/N {a}-{b}" for a, b in zip(BINS, BINS[1:])) + " | chi2 | s |\n|" + " --- |" * (len(BINS) + 5))
    for by in programs:
        print("| " + " | ".join(row(by, [judge(f, name, by) for f in folders])) + " |")
    sys.stdout.flush()


def main(out, seeds="1,2", cells=",".join(CELLS)):
    programs = os.environ.get("RX_PROGRAMS", "NONE,NET,ALLSTAR").split(",")
    if "ALLSTAR" in programs and not shutil.which("irafcl"):
        programs.remove("ALLSTAR")
        print("ALLSTAR is absent: irafcl is not installed (Debian: iraf, iraf-noao)")
    for name in cells.split(","):
        folders = [os.path.abspath(f"{out}/{name}-{seed}") for seed in seeds.split(",")]
        for folder, seed in zip(folders, seeds.split(",")):
            os.makedirs(folder, exist_ok=True)
            if not os.path.exists(f"{folder}/clean.fits"):
                make(folder, name, seed)
            for by in programs:
                if not os.path.exists(f"{folder}/{by}.seconds"):
                    allstar(folder, name) if by == "ALLSTAR" else extract(folder, by)
        show(name, folders, programs)


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
