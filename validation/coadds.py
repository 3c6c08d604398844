#!/usr/bin/python3
"""Fluxes and detection on simulated coadds, whose noise is correlated: drizzled, and Lanczos-interpolated with uneven depth.

    coadds.py FOLDER [SEED[,SEED...] [KIND[,KIND...]]]     seeds: 1,2; kinds: WHITE,DRIZZLE,LANCZOS

RESTORERS in the environment are those to run (NONE,RL,NET), REXTRACT and SIMULATE name the programs (default: those in build/),
RX_MODEL the network's model (config/psfnet.fits). FOLDER gets one folder a kind and seed; what lies there is not made again.
Each is a tile of 1000 x 1000 pixels, 800 stars and 500 galaxies per Mpixel, with its
weight map, and a run of rextract with RESTORE_TYPE NONE, RL and NET, a Gaussian as wide as a star as the filter,
and a low threshold (DETECT_THRESH 0.6). WHITE is one exposure, for comparison.

S/N is that of an ideal measurement of the true flux: the noise of wide sums at that place (weight map and RXCWIDE)
under a Gaussian as wide as PSF and galaxy together. First table: pulls (flux - true flux) / error of sources
without a neighbour of a tenth of their flux within NEAR pixels: median, and 1.4826 times the median deviation.
True fluxes are total ones; of APER and "AUTO, inside" those inside the aperture, or AUTO's own ellipse, on the same coadd
without noise, on the sharp reference for restored images: whether errors are right. Pulls of AUTO against total fluxes hold
beside noise what the ellipse leaves out, which differs from source to source and follows the noise. Second table: recall of objects above S/N 5 where precision falls below 0.95,
detections ranked by peak over threshold (RL, NET) or by the filtered tile over its noise (NONE: the matched
filter); a detection is right beside any object above S/N 2.
"""
import os
import subprocess
import sys

import numpy as np
from astropy.io import fits
from scipy.ndimage import gaussian_filter, maximum_filter
from scipy.spatial import cKDTree

import ledger

NEAR, RADIUS, APERTURE, SIDE = 16, 2.0, 12, 1000
BUILD = f"{os.path.dirname(os.path.abspath(__file__))}/../build"
MODEL = os.path.abspath(os.environ.get("RX_MODEL", f"{os.path.dirname(__file__)}/../config/psfnet.fits"))
BINS = (5, 10, 20, 50, 100)
# noise of a frame's pixel such that wide sums are as noisy as those of white noise of 5 ADU (LANCZOS: at full depth)
KINDS = {"WHITE": ["-NOISE_SIGMA", "5"],
         "DRIZZLE": ["-NOISE_SIGMA", "16.667", "-COADD_TYPE", "DRIZZLE"],
         "LANCZOS": ["-NOISE_SIGMA", "8.66", "-COADD_TYPE", "LANCZOS", "-COADD_FRAMES", "3", "-COADD_UNEVEN", "0.7"]}
SCENE = ["-IMAGE_SIZE", str(SIDE), "-STAR_COUNT", "800", "-STAR_MAG", "15,21", "-GALAXY_COUNT", "500",
         "-GALAXY_MAG", "16,21", "-SKY_LEVEL", "200"]
RESTORERS = os.environ.get("RESTORERS", "NONE,RL,NET").split(",")
FLUXES = ("AUTO", "APER", "TEMPLATE")
SHAPE = ["CXX_IMAGE", "CYY_IMAGE", "CXY_IMAGE", "KRON_RADIUS"]
COLUMNS = ["NUMBER", "X_IMAGE", "Y_IMAGE", "FLUX_MAX", "THRESHOLD", "FLAGS", *SHAPE,
           *(f"FLUX{e}_{f}" for f in FLUXES for e in ("", "ERR"))]
THRESHOLD = "0.6"  # S/N 4 of a star on white noise, through the filter


def list_of(restorer):
    return f"c_{restorer}.cat" if len(RESTORERS) > 1 else "c.cat"


def program(name):
    return os.path.abspath(os.environ.get(name, f"{BUILD}/{'rextract' if name == 'REXTRACT' else 'rextract-simulate'}"))


def run(folder, name, *arguments):
    with open(f"{folder}/log", "a") as log:
        subprocess.run([program(name), *arguments, "-NTHREADS", "2"], cwd=folder, check=True, stdout=log, stderr=log)


def make(folder, kind, seed):
    simulate = [*SCENE, *KINDS[kind], "-SEED", str(seed)]
    run(folder, "SIMULATE", *simulate, "-WEIGHT_NAME", "weight.fits", "-SHARP_NAME", "sharp.fits")
    # the same weights, no noise
    run(folder, "SIMULATE", *simulate, "-IMAGE_NAME", "clean.fits", "-TRUTH_NAME", "", "-NOISE_TYPE", "NONE",
        "-SKY_LEVEL", "0")


def extract(folder):
    header = fits.getheader(f"{folder}/sim.fits")
    sigma = header.get("RXCFWHM", header["RXFWHM"] * 1.03) / 2.3548
    half = int(np.ceil(2.5 * sigma))
    axis = np.exp(-0.5 * (np.arange(-half, half + 1) / sigma)**2)
    with open(f"{folder}/gauss.conv", "w") as conv:
        conv.write("CONV NORM\n")
        conv.writelines(" ".join(f"{a * b:.6f}" for a in axis) + "\n" for b in axis)
    common = ["sim.fits", "-CATALOG_TYPE", "FITS_1.0", "-HEADER_FACTS", "ALL", "-FILTER_NAME", "gauss.conv", "-MAG_ZEROPOINT", "25",
              "-PHOT_APERTURES", str(APERTURE), "-WEIGHT_TYPE", "MAP_WEIGHT", "-WEIGHT_IMAGE", "weight.fits",
              "-NET_MODEL", MODEL]
    with open(f"{folder}/c.param", "w") as param:
        param.write("\n".join(COLUMNS) + "\n")
    run(folder, "REXTRACT", *common, "-RESTORE_TYPE", ",".join(RESTORERS), "-PARAMETERS_NAME", "c.param",
        "-DETECT_THRESH", THRESHOLD, "-ANALYSIS_THRESH", THRESHOLD, "-CATALOG_NAME", "c.cat")


def image(folder, name):
    return fits.getdata(f"{folder}/{name}.fits").astype(float)


def table(folder, name):
    with fits.open(f"{folder}/{name}") as hdus:
        return hdus[1].data


def places(rows):
    return np.column_stack([np.asarray(rows[c], float) - 1 for c in ("X_IMAGE", "Y_IMAGE")])


def noise_of_sums(folder):
    """At each pixel: noise of sums over many pixels, over that of so many independent pixels of variance 1."""
    header, weight = fits.getheader(f"{folder}/sim.fits"), image(folder, "weight")
    drizzled = header.get("RXCOADD") == "DRIZZLE"
    return header.get("RXCWIDE", 1.0)**(not drizzled) / np.sqrt(gaussian_filter(weight, 3))


def truth(folder):
    header, rows = fits.getheader(f"{folder}/sim.fits"), table(folder, "sim_truth.fits")
    at = places(rows)
    x, y = np.clip(np.rint(at).astype(int), 0, SIDE - 1).T
    width = np.hypot(header.get("RXCFWHM", header["RXFWHM"]) / 2.3548, rows["FLUX_RADIUS"] / 1.1774)
    return at, rows["FLUX"], rows["FLUX"] / (noise_of_sums(folder)[y, x] * np.sqrt(4 * np.pi) * width)


def alone(at, flux):
    tree = cKDTree(at)
    return np.array([all(flux[j] < 0.1 * flux[i] for j in tree.query_ball_point(at[i], NEAR) if j != i)
                     for i in range(len(at))])


def aperture(pixels, at):
    """Sums inside the aperture, pixels cut 5 x 5 at its edge."""
    half, cut = APERTURE // 2 + 1, (np.arange(5) - 2) / 5
    sums = np.full(len(at), np.nan)
    for k, (x, y) in enumerate(at):
        i, j = int(round(x)), int(round(y))
        if not (half <= i < SIDE - half and half <= j < SIDE - half):
            continue
        u = (np.arange(i - half, i + half + 1)[:, None] + cut).ravel() - x
        v = (np.arange(j - half, j + half + 1)[:, None] + cut).ravel() - y
        inside = (u[None]**2 + v[:, None]**2 < (APERTURE / 2)**2).reshape(2 * half + 1, 5, 2 * half + 1, 5)
        sums[k] = np.sum(inside.mean((1, 3)) * pixels[j - half:j + half + 1, i - half:i + half + 1])
    return sums


def ellipse(pixels, rows):
    """Sums of the pixels whose centre is inside the ellipse of FLUX_AUTO."""
    sums = np.full(len(rows), np.nan)
    for k, ((x, y), row) in enumerate(zip(places(rows), rows)):
        cxx, cyy, cxy, kron = (float(row[c]) for c in SHAPE)
        if not kron > 0:
            continue
        reach = kron * np.sqrt(1 / min(cxx - cxy**2 / (4 * cyy), cyy - cxy**2 / (4 * cxx)))
        low, high = (np.round(v).astype(int) for v in ((x - reach, y - reach), (x + reach, y + reach)))
        if low.min() < 0 or high.max() >= SIDE:
            continue
        u, v = np.arange(low[0], high[0] + 1)[None] - x, np.arange(low[1], high[1] + 1)[:, None] - y
        inside = cxx * u**2 + cyy * v**2 + cxy * u * v <= kron**2
        sums[k] = np.sum(pixels[low[1]:high[1] + 1, low[0]:high[0] + 1][inside])
    return sums


def match(at, found):
    """Pairs (truth, detection), each once, the nearest first."""
    pairs = cKDTree(at).sparse_distance_matrix(cKDTree(found), RADIUS, output_type="ndarray")
    seen, taken, kept = set(), set(), []
    for d in np.sort(pairs, order="v"):
        if d["i"] not in seen and d["j"] not in taken:
            seen.add(d["i"])
            taken.add(d["j"])
            kept.append((d["i"], d["j"]))
    return np.array(kept, int).reshape(-1, 2)


def pulls(folder):
    at, flux, snr = truth(folder)
    single = alone(at, flux) & (np.minimum(at, SIDE - 1 - at).min(1) > 20)
    result = {}
    for restorer in RESTORERS:
        rows = table(folder, list_of(restorer))
        t, d = match(at, places(rows)).T
        t, d = t[single[t]], d[single[t]]
        rows = rows[d]
        light = image(folder, "clean" if restorer == "NONE" else "sharp")
        true = {"AUTO": flux[t], "AUTO, inside": ellipse(light, rows), "APER": aperture(light, places(rows)), "TEMPLATE": flux[t]}
        for name, is_true in true.items():
            column = name.split(",")[0]
            result[restorer, name] = snr[t], (rows[f"FLUX_{column}"] - is_true) / rows[f"FLUXERR_{column}"]
    return result


def ranked(folder, restorer):
    """Ranking of detections, whether each is right, and how many objects it stands for (above S/N 5)."""
    at, _, snr = truth(folder)
    rows = table(folder, list_of(restorer))
    found = places(rows)
    if restorer == "NONE":
        header = fits.getheader(f"{folder}/sim.fits")
        significance = image(folder, "sim") - header["RXBACK"]
        significance = gaussian_filter(significance, header.get("RXCFWHM", header["RXFWHM"]) / 2.3548)
        significance = maximum_filter(significance / noise_of_sums(folder), 3)
        x, y = np.clip(np.rint(found).astype(int), 0, SIDE - 1).T
        score = significance[y, x]
    else:
        score = rows["FLUX_MAX"] / rows["THRESHOLD"]
    seen = np.flatnonzero(snr > 2)
    right, wanted = np.zeros(len(rows), bool), np.zeros(len(rows), bool)
    t, d = match(at[seen], found).T
    right[d] = True
    wanted[d] = snr[seen[t]] > 5
    return score, right, wanted, np.sum(snr > 5)


def recall(lists):
    score, right, wanted = (np.concatenate([entry[k] for entry in lists]) for k in range(3))
    objects = sum(entry[3] for entry in lists)
    order = np.argsort(-score, kind="stable")
    precision = np.cumsum(right[order]) / np.arange(1, len(order) + 1)
    good = np.flatnonzero(precision >= 0.95)
    last = good[-1] + 1 if len(good) else 0
    return np.sum(wanted[order[:last]]) / objects, np.sum(wanted) / objects, np.mean(right), len(right)


def show(kind, folders):
    print(f"\n{kind}: pulls, median and width (sources)\n")
    names = [f"{low}-{high}" for low, high in zip(BINS, BINS[1:])]
    print("| | " + " | ".join(f"S/N {n}" for n in names) + " |\n| --- |" + " --- |" * len(names))
    each = [pulls(f) for f in folders]
    for key in each[0]:
        snr, pull = (np.concatenate([e[key][k] for e in each]) for k in range(2))
        cells = []
        for low, high in zip(BINS, BINS[1:]):
            p = pull[(snr >= low) & (snr < high) & np.isfinite(pull)]
            width = 1.4826 * np.median(np.abs(p - np.median(p))) if len(p) else np.nan
            cells.append(f"{np.median(p):+.2f} {width:.2f} ({len(p)})" if len(p) else "")
        print(f"| {' '.join(key)} | " + " | ".join(cells) + " |")
    print("\n| | recall at precision 0.95 | recall, precision of the whole list (detections) |\n| --- | --- | --- |")
    for restorer in RESTORERS:
        at, whole, precision, n = recall([ranked(f, restorer) for f in folders])
        print(f"| {restorer} | {at:.3f} | {whole:.3f}, {precision:.3f} ({n}) |")
    sys.stdout.flush()


def main(out, seeds="1,2", kinds=",".join(KINDS)):
    ledger.claim("coadds", out, seeds.split(","))
    for kind in kinds.split(","):
        folders = [f"{out}/{kind}-{seed}" for seed in seeds.split(",")]
        for folder, seed in zip(folders, seeds.split(",")):
            os.makedirs(folder, exist_ok=True)
            if not os.path.exists(f"{folder}/sim.fits"):
                make(folder, kind, seed)
            if not os.path.exists(f"{folder}/{list_of(RESTORERS[-1])}"):
                extract(folder)
        show(kind, folders)


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
