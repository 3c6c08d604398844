#!/usr/bin/python3
"""The PSF that is measured on a tile, against the truth and beside PSFEx's.

    psf.py truth FOLDER [SEED[,SEED...] [CASE[;CASE...] [PSF_TYPE[,PSF_TYPE...]]]]
                                   simulated tiles (psf_truth.py): FOLDER/truth.json
    psf.py real FOLDER             real tiles: FOLDER/real.json and pictures
    psf.py small FOLDER [SEED]     small and empty tiles: FOLDER/small.json
    psf.py few FOLDER [SEED[,SEED...]]  tiles of few stars, and of a stated FWHM: FOLDER/few.json
    psf.py grid FOLDER [SEED[,SEED...] [TILE[;TILE...]]]  FWHM 1.3 to 14 with 3 to 1000 stars, and hard tiles: FOLDER/grid.json
    psf.py page FOLDER             FOLDER/psf.md from the json files that are there

RX_PROGRAM names rextract (default: build/rextract, else rextract in the root), RX_SHARED_DATA the folder of real tiles.
psfex and source-extractor (Debian) take part where they are: at their defaults (polynomial of degree 2), with stamps of 10
FWHM. Our PSF is read from CHECKIMAGE_TYPE PSF.

What the columns mean

A model is held against the truth, without noise, on a grid of 12 x 12 places that no star chose and, for "corner", 2 % of
the side from each corner. dT/T, de1, de2: size T = xx + yy and ellipticities (xx - yy, 2 xy) / T with a round Gaussian
weight of the truth's FWHM, taken off as if both were Gaussian; mean over the grid and, rms, how much of the variation is
missed. residual: what a fit of the flux leaves, rms over that of the star, median over places; stack: the largest of its
mean over the peak. growth: where to 20 FWHM the curve of growth (light within a radius over all light) is most off, at the
middle. predicted: the magnitude that such a fit finds, less the true one; mean, and the worst corner.

mag: MAG_TEMPLATE of bright stars (S/N above 100, unsaturated, no neighbour of 0.5 % of their flux within 2 FWHM) less the
true one of all their light: median, scatter, and the worst median of the corners (a fifth of the side). pull: (flux -
true) / error, median; width: 1.4826 times the median of its size. limit: 1 sigma of dT/T and de of the best that the usable
stars allow (Cramer and Rao's bound; their photons and those of the sky, profile and neighbours known). CPU: user seconds of rextract, or of source-extractor and
psfex together, on a machine that others used as well.
"""
import json
import os
import re
import resource
import shutil
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
from astropy.io import fits
from astropy.wcs import WCS
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

import ledger
import psf_truth
import tiles
from psf_truth import GAIN, SATURATION, ZEROPOINT, Truth

TOP = Path(__file__).resolve().parent.parent
WAYS = ("AUTO", "PSFEX")  # PSF_TYPE; of PSFEX the model is psfex's, from source-extractor's catalogue
BRIGHT, PLACES, CORNER = 100, 12, 0.2  # S/N of bright stars, positions a side, share of the side that is a corner
COLUMNS = "NUMBER X_IMAGE Y_IMAGE FLUX_TEMPLATE FLUXERR_TEMPLATE CLASS_TEMPLATE FLAGS FLAGS_TEMPLATE"
RADII = np.array([1, 2, 3, 5, 8, 12, 20])  # FWHM, of curves of growth

# name: truth, stars per Mpixel, galaxies per Mpixel
CASES = {
    "Moffat 2.5": (Truth("MOFFAT 2.5", 4.0), 300, 0),
    "Moffat 3.5, linear": (Truth("MOFFAT 3.5", 3.0, 0.1, "LINEAR"), 1000, 300),
    "Moffat 4.765, quadratic": (Truth("MOFFAT 4.765", 5.0, 0.2, "QUADRATIC"), 300, 0),
    "Moffat 6, ellipticity 0.3": (Truth("MOFFAT 6", 8.0, 0.3), 100, 0),
    "halo": (Truth("HALO", 4.0), 300, 0),
    "halo, quadratic": (Truth("HALO", 3.0, 0.05, "QUADRATIC"), 1000, 300),
    "Kolmogorov, linear": (Truth("KOLMOGOROV", 3.5, 0.05, "LINEAR"), 300, 300),
    "Kolmogorov, wide": (Truth("KOLMOGOROV", 6.0), 120, 0),
    "spikes": (Truth("SPIKES", 4.0), 300, 0),
    "spikes, linear": (Truth("SPIKES", 2.5, 0.1, "LINEAR"), 1000, 0),
    "bad corner, Moffat": (Truth("MOFFAT 3.5", 4.0, 0.0, "CORNER"), 1000, 0),
    "bad corner, Kolmogorov": (Truth("KOLMOGOROV", 3.0, 0.1, "CORNER"), 300, 300),
    "undersampled, Moffat": (Truth("MOFFAT 3", 1.5), 300, 0),
    "undersampled, halo": (Truth("HALO", 2.0, 0.1, "QUADRATIC"), 1000, 0),
    "crowded, Moffat": (Truth("MOFFAT 3.5", 3.0, 0.1, "LINEAR"), 20000, 0),
    "crowded, Kolmogorov": (Truth("KOLMOGOROV", 4.0), 5000, 0),
    "sparse, Moffat": (Truth("MOFFAT 3.5", 4.0, 0.1), 20, 0),
    "sparse, halo": (Truth("HALO", 4.0), 50, 300),
    "4096 x 4096": (Truth("KOLMOGOROV", 4.0, 0.05, "QUADRATIC", 4096), 119, 0),
}
LIMITS = {"dT/T": 1e-3, "de": 2e-4, "mean": 0.003, "corner": 0.01, "pull": 0.15}


# --- programs

def find(name):
    places = [os.environ.get("RX_PROGRAM"), TOP / "build/rextract", TOP / "rextract"]
    main = next((Path(p).resolve() for p in places if p and Path(p).exists()), None)
    if main is None:
        sys.exit("no rextract; build first (./quickstart), or set RX_PROGRAM")
    return main if name == "rextract" else main.with_name(name)


def call(folder, program, *arguments):
    """Runs it; what it said and its user CPU seconds, without those of threads that wait for others (a busy machine)."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run([str(program), *map(str, arguments)], cwd=folder, capture_output=True, text=True,
                          env={**os.environ, "OMP_WAIT_POLICY": "passive"})
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    if done.returncode:
        raise RuntimeError(f"{Path(program).name}: exit status {done.returncode}: {done.stderr.strip()[-300:]}")
    return done.stderr, seconds


def warned(log):
    """Warnings of a log, long ones in one line."""
    lines = log.replace("\nrextract:     ", " ").splitlines()
    return [re.sub(r"^rextract: warning: (tile\.fits\[0\]: )?", "", a) for a in lines
            if "warning" in a and "default.sex" not in a]


def keywords(**values):
    return [a for k, v in values.items() for a in ("-" + k, v)]


# --- models

class Model:
    """A file in PSFEx's format: the stamp at a place, sum 1."""

    def __init__(self, path):
        with fits.open(path) as hdus:
            row = hdus[1].data[0]
            head = {k.upper(): row[k] for k in hdus[1].columns.names} | dict(hdus[1].header)  # merged tables have columns
        height, width = ((head["PSFAXIS2"], head["PSFAXIS1"]) if "PSFAXIS2" in head
                         else np.shape(row["PSF_MASK"])[-2:])
        self.mask = np.array(row["PSF_MASK"], float).reshape(-1, height, width)
        self.step, self.stars = head.get("PSF_SAMP", 1.0), head.get("ACCEPTED", 0)
        self.degree = head.get("POLDEG1", 0) if head.get("POLNAXIS", 0) else 0
        self.zero, self.scale = ([head.get(f"{k}{i}", d) for i in (1, 2)] for k, d in (("POLZERO", 0), ("POLSCAL", 1)))

    def stamp(self, x, y):
        u, v = (x + 1 - self.zero[0]) / self.scale[0], (y + 1 - self.zero[1]) / self.scale[1]
        terms = [u**i * v**j for j in range(self.degree + 1) for i in range(self.degree + 1 - j)]
        fine = np.tensordot(terms[:len(self.mask)], self.mask, 1)
        half = int((fine.shape[0] // 2) * self.step)
        at = np.mgrid[-half:half + 1, -half:half + 1] / self.step + fine.shape[0] // 2
        pixels = map_coordinates(fine, at, order=5, mode="constant") if self.step != 1 else fine
        return pixels / pixels.sum()


def psfex(folder, tile, side, aperture, *more):
    """psfex's model from source-extractor's catalogue, both at their defaults but for what a careful user sets."""
    (folder / "sex.param").write_text(f"VIGNET({side},{side})\nX_IMAGE\nY_IMAGE\nFLUX_RADIUS\nSNR_WIN\nFLUX_APER(1)\n"
                                      "FLUXERR_APER(1)\nELONGATION\nFLAGS\n")
    (folder / "default.conv").write_text("CONV NORM\n1 2 1\n2 4 2\n1 2 1\n")
    _, first = call(folder, "source-extractor", tile, *keywords(
        CATALOG_TYPE="FITS_LDAC", CATALOG_NAME="stars.cat", PARAMETERS_NAME="sex.param", FILTER_NAME="default.conv",
        DETECT_THRESH=5, PHOT_APERTURES=aperture, VERBOSE_TYPE="QUIET"), *more)
    _, second = call(folder, "psfex", "stars.cat", *keywords(
        PSF_SIZE=f"{side},{side}", SAMPLE_FWHMRANGE="1,20", CHECKPLOT_TYPE="NONE", CHECKIMAGE_TYPE="NONE", WRITE_XML="N",
        VERBOSE_TYPE="QUIET", NTHREADS=1))
    return first + second


# --- simulated tiles

def simulate(folder, truth, density, galaxies, seed):
    """tile.fits, unless it lies there; places and fluxes of its stars."""
    rng = np.random.default_rng([seed, *np.frombuffer(folder.name.encode(), np.uint8)])
    x, y, flux = psf_truth.stars(truth, density, rng)
    if (folder / "tile.fits").exists():
        return x, y, flux
    light = psf_truth.draw(truth, x, y, flux)
    if galaxies:  # by our simulator, through the PSF of the middle
        stamp = truth.stamp(truth.side / 2, truth.side / 2, int(6 * truth.fwhm))
        fits.writeto(folder / "middle.fits", (stamp / stamp.sum()).astype(np.float32), overwrite=True)
        call(folder, find("rextract-simulate"), *keywords(
            IMAGE_SIZE=truth.side, SEED=seed, PSF_TYPE="FILE", PSF_NAME="middle.fits", NOISE_TYPE="NONE", SKY_LEVEL=0,
            STAR_COUNT=0, GALAXY_COUNT=galaxies, GALAXY_MAG="13,19", MAG_ZEROPOINT=ZEROPOINT, IMAGE_NAME="galaxies.fits",
            TRUTH_NAME=""))
        light = light + np.maximum(fits.getdata(folder / "galaxies.fits"), 0)
    fits.writeto(folder / "tile.part", psf_truth.expose(light, rng), overwrite=True)
    (folder / "tile.part").rename(folder / "tile.fits")
    return x, y, flux


def lonely(x, y, flux, distance):
    """Without a neighbour of 0.5 % of its flux within the distance."""
    at = np.column_stack([x, y])
    return np.array([all(flux[j] < 0.005 * flux[i] for j in near if j != i)
                     for i, near in enumerate(cKDTree(at).query_ball_point(at, distance))])


def saturates(truth):
    """Flux at which a star centred on a pixel saturates, in the middle of the tile."""
    return (SATURATION - psf_truth.SKY) / truth.stamp(truth.side / 2, truth.side / 2, 1).max()


def drawing_error(folder):
    """Largest difference, of the brightest pixel, between stars drawn here and by rextract-simulate, which shares nothing."""
    folder.mkdir(parents=True, exist_ok=True)
    call(folder, find("rextract-simulate"), *keywords(
        IMAGE_SIZE=256, PSF_FWHM=4, PSF_BETA=3.5, PSF_RATIO=0.8, PSF_ANGLE=25, NOISE_TYPE="NONE", SKY_LEVEL=0, STAR_COUNT=300,
        STAR_MAG="10,12", GALAXY_COUNT=0, IMAGE_NAME="check.fits", TRUTH_NAME="check_truth.fits"))
    stars, image = fits.getdata(folder / "check_truth.fits", 1), fits.getdata(folder / "check.fits")
    ours = psf_truth.draw(Truth("MOFFAT 3.5", 4.0, 0.2, side=256), stars["X_IMAGE"] - 1, stars["Y_IMAGE"] - 1, stars["FLUX"])
    return float(np.abs(ours - image)[20:-20, 20:-20].max() / image.max())


def width(values):
    return float(1.4826 * np.median(np.abs(values))) if len(values) else None


def middle(values):
    return float(np.median(values)) if len(values) else None


@lru_cache(maxsize=1)
def true_stamps(truth):
    return [truth.stamp(*place, int(np.ceil(10 * truth.fwhm))) for place in places_of(truth.side, truth.side)]


def places_of(width, height):
    """A grid over the tile, then its corners."""
    x, y = ((np.arange(PLACES) + 0.5) / PLACES * (n - 1) for n in (width, height))
    return ([(float(a), float(b)) for b in y for a in x]
            + [(a * (width - 1), b * (height - 1)) for b in (0.02, 0.98) for a in (0.02, 0.98)])


def compare(model, places, stamps, fwhm):
    """Of the model alone, no noise: moments, predicted magnitudes and residuals at places that no star chose, against
    stamps there; corners come last."""
    shapes, light, left, pictures = [], [], [], []
    for place, stamp in zip(places, stamps):
        m, t = psf_truth.common(model.stamp(*place), stamp)
        (tm, am, bm), (tt, at, bt) = (psf_truth.moments(p, fwhm) for p in (m, t))
        shapes.append(((tm - tt) / tt, am - at, bm - bt))
        flux = (m * t).sum() / (m * m).sum()
        light.append(-2.5 * np.log10(flux))
        left.append(np.sqrt(((t - flux * m)**2).sum() / (t * t).sum()))
        half = m.shape[0] // 2
        pictures.append((t - flux * m)[half - 8:half + 9, half - 8:half + 9])
    shapes, n, peak = np.array(shapes), len(places) - 4, np.mean([a.max() for a in stamps])
    return {"dT/T": shapes[:n, 0].mean(), "dT/T rms": shapes[:n, 0].std(), "de1": shapes[:n, 1].mean(),
            "de2": shapes[:n, 2].mean(), "de rms": np.sqrt(shapes[:n, 1:].var(0).sum()),
            "corner dT/T": np.abs(shapes[n:, 0]).max(), "corner de": np.hypot(*shapes[n:, 1:].T).max(),
            "predicted mag": np.mean(light[:n]), "predicted corner mag": max(light[n:], key=abs),
            "residual": np.median(left[:n]), "stacked residual": np.abs(np.mean(pictures[:n], 0)).max() / peak}


def against_truth(model, truth):
    places = places_of(truth.side, truth.side)
    place = places[PLACES**2 // 2 + PLACES // 2]
    true = truth.stamp(*place, int(np.ceil(20 * truth.fwhm)))
    missed = psf_truth.growth(model.stamp(*place), RADII * truth.fwhm) - psf_truth.growth(true, RADII * truth.fwhm)
    return compare(model, places, true_stamps(truth), truth.fwhm) | {
        "growth": missed.tolist(), "growth missed": float(missed[np.argmax(np.abs(missed))])}


def photometry(folder, truth, x, y, flux):
    """Bright lone stars of the catalogue against the truth."""
    rows = fits.getdata(folder / "out.cat", 1)
    wanted = np.flatnonzero((psf_truth.signal_to_noise(truth, flux) > BRIGHT) & (flux < 0.85 * saturates(truth))
                            & lonely(x, y, flux, 2 * truth.fwhm))
    at = np.column_stack([rows["X_IMAGE"], rows["Y_IMAGE"]]) - 1.0
    if len(wanted) == 0 or len(rows) == 0:
        return {"bright": len(wanted), "matched": 0}
    distance, k = cKDTree(at).query(np.column_stack([x, y])[wanted])
    good = (distance < 1) & (rows["FLUX_TEMPLATE"][k] > 0)
    star, row = wanted[good], rows[k[good]]
    off = -2.5 * np.log10(row["FLUX_TEMPLATE"] / flux[star])
    pull = (row["FLUX_TEMPLATE"] - flux[star]) / row["FLUXERR_TEMPLATE"]
    u, v = x[star] / (truth.side - 1), y[star] / (truth.side - 1)
    corners = [off[(abs(u - a) < CORNER) & (abs(v - b) < CORNER)] for b in (0, 1) for a in (0, 1)]
    corners = [float(np.median(c)) for c in corners if len(c) > 2]
    return {"bright": len(wanted), "matched": len(star), "mag": middle(off), "mag scatter": width(off - np.median(off)),
            "corner mag": max(corners, key=abs) if corners else None, "pulls": [round(float(p), 3) for p in pull],
            "pull": middle(pull), "pull width": width(pull), "points": float(np.mean(row["CLASS_TEMPLATE"] > 0.5))}


def measure(folder, truth, way):
    """out.cat by that PSF; the model, the log and seconds."""
    common = keywords(RESTORE_TYPE="NONE", CATALOG_TYPE="FITS_1.0", HEADER_FACTS="ALL", CATALOG_NAME="out.cat", PARAMETERS_NAME="out.param",
                      GAIN=GAIN, SATUR_LEVEL=SATURATION, MAG_ZEROPOINT=ZEROPOINT, VERBOSE_TYPE="FULL", NTHREADS=2)
    made = 0.0
    for name in ("out.cat", "model.psf"):
        (folder / name).unlink(missing_ok=True)
    if way == "PSFEX":
        side = int(max(35, 10 * truth.fwhm)) // 2 * 2 + 1
        made = psfex(folder, "tile.fits", side, 5 * truth.fwhm, "-GAIN", GAIN, "-SATUR_LEVEL", SATURATION)
        shutil.move(folder / "stars.psf", folder / "model.psf")
        common += keywords(PSF_TYPE="PSFEX", PSF_NAME="model.psf")
    else:
        common += keywords(PSF_TYPE=way, CHECKIMAGE_TYPE="PSF", CHECKIMAGE_NAME="model.psf")
    log, seconds = call(folder, find("rextract"), "tile.fits", *common)
    if not (folder / "model.psf").exists():
        raise RuntimeError("no PSF: " + "; ".join(warned(log)))
    model = Model(folder / "model.psf")
    if not np.isfinite(model.mask).all():
        raise RuntimeError("no PSF: " + "; ".join(warned(log)))
    timing = re.search(r"PSF ([\d.]+)$", log, re.M)
    line = re.search(r"PSF (AUTO|MOFFAT).*", log)
    return model, {"said": warned(log), "seconds": made or seconds, "wall of PSF": float(timing[1]) if timing else None,
                   "line": line[0] if line else None,
                   "cards": {k: v for k, v in fits.getheader(folder / "out.cat", 1).items()
                             if k.startswith(("RXPSF", "RXTP"))}}


def case(folder, name, seed, ways):
    truth, density, galaxies = CASES[name]
    folder = folder / f"seed-{seed}" / re.sub(r"[ ,.]+", "-", name)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "out.param").write_text(COLUMNS.replace(" ", "\n") + "\n")
    x, y, flux = simulate(folder, truth, density, galaxies, seed)
    usable = (psf_truth.signal_to_noise(truth, flux) > 20) & (flux < saturates(truth))
    bound = psf_truth.limits(truth, x[usable], y[usable], flux[usable])
    rows = []
    for way in ways:
        row = {"case": name, "seed": seed, "way": way, "stars": len(x), "usable": int(usable.sum())} | bound
        try:
            model, facts = measure(folder, truth, way)
            row |= facts | against_truth(model, truth) | photometry(folder, truth, x, y, flux)
        except (RuntimeError, OSError) as error:
            row["failed"] = str(error)
        rows.append(row)
        print(line_of(row), flush=True)
    for big in folder.glob("*.raw"):
        big.unlink()
    return rows


def number(value, form):
    return "" if value is None else format(value, form)


HEAD = ["tile", "PSF", "dT/T (1e-3)", "rms", "de1 (1e-4)", "de2", "rms", "corner dT/T (1e-3)", "residual (%)", "stack (%)",
        "growth (%)", "bright stars", "mag", "scatter", "corner", "predicted", "corner", "pull", "width", "CPU s"]


def line_of(a):
    if "failed" in a:
        return f"| {a['case']} | {a['way']} | failed: {a['failed']} |" + " |" * (len(HEAD) - 3)
    cells = [a["case"], a["way"], *(number(a[k] * f, s) for k, f, s in (
        ("dT/T", 1e3, "+.2f"), ("dT/T rms", 1e3, ".2f"), ("de1", 1e4, "+.1f"), ("de2", 1e4, "+.1f"), ("de rms", 1e4, ".1f"),
        ("corner dT/T", 1e3, ".1f"), ("residual", 100, ".2f"), ("stacked residual", 100, ".2f"),
        ("growth missed", 100, "+.2f"))),
        str(a["matched"]), *(number(a.get(k), s) for k, s in (
            ("mag", "+.4f"), ("mag scatter", ".4f"), ("corner mag", "+.4f"), ("predicted mag", "+.4f"),
            ("predicted corner mag", "+.4f"), ("pull", "+.2f"), ("pull width", ".2f"), ("seconds", ".1f")))]
    return "| " + " | ".join(cells) + " |"


def plain(value):
    return float(value) if isinstance(value, np.floating) else value.tolist() if isinstance(value, np.ndarray) else str(value)


def truth(out, seeds="1", names="", ways=""):
    """Rows go into truth.json as they come, in place of those of the same tile and PSF_TYPE."""
    ways = ways.split(",") if ways else list(WAYS)
    if not (shutil.which("psfex") and shutil.which("source-extractor")):
        ways = [w for w in ways if w != "PSFEX"]
        print("psfex and source-extractor are not installed; their model does not take part", file=sys.stderr)
    ledger.claim("psf truth", out, seeds.split(","))
    file = Path(out) / "truth.json"
    known = {key(a): a for a in json.loads(file.read_text())} if file.exists() else {}
    print("| " + " | ".join(HEAD) + " |\n|" + " --- |" * len(HEAD))
    for seed in map(int, seeds.split(",")):
        for name in [n for n in CASES if any(w in n for w in names.split(";"))]:
            known |= {key(a): a for a in case(Path(out), name, seed, ways)}
            rows = sorted(known.values(), key=lambda a: (a["seed"], list(CASES).index(a["case"]), WAYS.index(a["way"])))
            file.write_text(json.dumps(rows, indent=1, default=plain) + "\n")


def key(a):
    return a["case"], a["seed"], a["way"]


# --- real tiles

class KarhunenLoeve:
    """SDSS's own PSF of a frame: psf(row, col) = sum_k a_k RROWS_k, a_k = sum_ij C_k[i, j] (0.001 row)^i (0.001 col)^j
    (sdss.org, algorithms, read_psf); its stamps are counts on 51 x 51 pixels."""

    def __init__(self, path, band="r"):
        with fits.open(path) as hdus:
            rows = hdus["ugriz".index(band) + 1].data
            self.images = [np.array(r["RROWS"], float).reshape(r["RNROW"], r["RNCOL"]) for r in rows]
            self.terms = [np.array(r["c"], float)[:r["nrow_b"], :r["ncol_b"]] for r in rows]

    def stamp(self, x, y):
        powers = [np.outer((0.001 * y)**np.arange(c.shape[0]), (0.001 * x)**np.arange(c.shape[1])) for c in self.terms]
        image = sum((c * p).sum() * a for c, p, a in zip(self.terms, powers, self.images))
        return image / image.sum()


REAL_COLUMNS = COLUMNS + " FLUX_AUTO FLUXERR_AUTO FWHM_IMAGE FLUX_MAX BACKGROUND"
STACK = 32  # half side of stacks, pixels
# Share of the highest pixel above which stars are not stacked: on the plate of M67 stars of peaks to 10,000 ADU have a FWHM of
# 2.0 pixels, from there on they are flattened and grow to 4 and more; on Spitzer's mosaic from half of the highest on.
FLAT = {"M67": 0.75, "Spitzer IRAC": 0.5}


def real_tiles(data):
    """tiles.py's, with what the stamps of DECam come with."""
    fields = data / "fields"
    found = []
    for make in (lambda: tiles.sdss_frame(data), lambda: tiles.decam(data),
                 lambda: tiles.plain(fields / "M6707HH.fits", "M67", "photographic")[0],
                 lambda: tiles.plain(fields / "M13_blue_0001.fits", "M13", "as taken")[0],
                 lambda: tiles.plain(fields / "spitzer_example_image.fits", "Spitzer IRAC", "mosaic", SATUR_LEVEL=1e9)[0],
                 lambda: tiles.plain(fields / "aligned_eso085-030-004.fit", "ESO 085-030", "stacked")[0]):
        try:
            found.append(make())
        except OSError as error:
            print(f"left out: {error}", file=sys.stderr)
    for tile in found:
        tile.keywords.pop("PSF_TYPE", None)
        tile.keywords.pop("PSF_FWHM", None)
    return found


def extract(folder, tile, way, fwhm=4.0):
    """Runs a real tile: rows, planes, model, facts."""
    for name in ("out.cat", "model.psf"):
        (folder / name).unlink(missing_ok=True)
    images = {"-BACKGROUND": "image.fits", "TEMPLATE_MODEL": "templates.fits"}
    arguments = {"RESTORE_TYPE": "NONE", "CATALOG_TYPE": "FITS_1.0", "HEADER_FACTS": "ALL", "CATALOG_NAME": "out.cat",
                 "PARAMETERS_NAME": "out.param", "VERBOSE_TYPE": "FULL", "NTHREADS": 2, **tile.keywords}
    if tile.weight is not None:
        arguments |= {"WEIGHT_IMAGE": "weight.fits", "WEIGHT_TYPE": "MAP_WEIGHT"}
    made = 0.0
    if way == "PSFEX":
        gain = [a for k in ("GAIN", "SATUR_LEVEL") if k in tile.keywords for a in ("-" + k, tile.keywords[k])]
        weight = ["-WEIGHT_IMAGE", "weight.fits", "-WEIGHT_TYPE", "MAP_WEIGHT"] if tile.weight is not None else []
        made = psfex(folder, "tile.fits", 41, 5 * fwhm, *gain, *weight)
        shutil.move(folder / "stars.psf", folder / "model.psf")
        arguments |= {"PSF_TYPE": "PSFEX", "PSF_NAME": "model.psf"}
    else:
        arguments["PSF_TYPE"], images["PSF"] = way, "model.psf"
    arguments |= {"CHECKIMAGE_TYPE": ",".join(images), "CHECKIMAGE_NAME": ",".join(images.values())}
    log, seconds = call(folder, find("rextract"), "tile.fits", *keywords(**arguments))
    rows, head = fits.getdata(folder / "out.cat", 1, header=True)
    planes = {k: np.nan_to_num(fits.getdata(folder / v).astype(float)) for k, v in images.items() if k != "PSF"}
    model = Model(folder / "model.psf") if (folder / "model.psf").exists() else None
    line = re.search(r"PSF (AUTO|MOFFAT|FILE|PSFEX|stated)[^\n]*", log)
    cards = {k: v for k, v in head.items() if k.startswith(("RXPSF", "RXFWHM", "RXTPFWHM", "RXTPCHI2"))}
    return rows, planes, model, {"said": warned(log), "line": line[0] if line else None, "cards": cards,
                                 "seconds": made or seconds}


def choose(rows, shape, limit, fwhm, least=20):
    """Places of bright, lone, unsaturated sources as wide as most of the 60 brightest: whatever a PSF takes for a star."""
    x, y, flux = (rows[k].astype(float) for k in ("X_IMAGE", "Y_IMAGE", "FLUX_AUTO"))
    good = ((rows["FLAGS"] & 4 == 0) & (flux > least * rows["FLUXERR_AUTO"]) & (rows["FLUX_MAX"] + rows["BACKGROUND"] < limit)
            & (np.minimum(x, y) > STACK + 1) & (x < shape[1] - STACK) & (y < shape[0] - STACK))
    at = np.column_stack([x, y])
    near = cKDTree(at).query_ball_point(at, 2.5 * fwhm)
    lone = np.array([i for i in np.flatnonzero(good) if all(flux[j] < 0.2 * flux[i] for j in near[i] if j != i)], int)
    lone = lone[np.argsort(-flux[lone])]
    wide = rows["FWHM_IMAGE"][lone]
    return at[lone[abs(wide - np.median(wide[:60])) < 0.15 * np.median(wide[:60])]] if len(lone) else []


def stack(rows, planes, places):
    """Mean image of the stars and of what the templates leave of them, per flux, of the middle 60 % of each pixel; how many
    stars, and the share that is taken for points."""
    at = np.column_stack([rows["X_IMAGE"], rows["Y_IMAGE"]]).astype(float)
    distance, k = cKDTree(at).query(places)
    k = k[(distance < 1) & (rows["FLUX_TEMPLATE"][k] > 0)]
    pieces = []
    for i in k:
        a, b = (int(round(v)) - 1 for v in at[i])
        cut = np.s_[b - STACK:b + STACK + 1, a - STACK:a + STACK + 1]
        image, model = planes["-BACKGROUND"][cut], planes["TEMPLATE_MODEL"][cut]
        if image.shape == (2 * STACK + 1,) * 2:
            pieces.append(np.stack([image, image - model]) / rows["FLUX_TEMPLATE"][i])
    if not pieces:
        return None, 0, 0.0
    ordered = np.sort(pieces, axis=0)
    edge = len(pieces) // 5
    return ordered[edge:len(pieces) - edge].mean(0), len(pieces), float(np.mean(rows["CLASS_TEMPLATE"][k] > 0.5))


def picture(stacks, fwhm, path):
    """The stars as they are (logarithm, 1e-4 of the peak to the peak), what each PSF leaves (-5 to 5 % of the peak), and
    curves of growth of stars and of what is left."""
    if not shutil.which("gnuplot"):
        print("gnuplot is not installed; no pictures are made", file=sys.stderr)
        return
    image = next(iter(stacks.values()))[0]
    panels = [("stars", np.log10(np.clip(image / image.max(), 1e-4, 1)), "[-4:0]")]
    panels += [(way, 100 * left / whole.max(), "[-5:5]") for way, (whole, left) in stacks.items()]
    radii = np.arange(0.5, STACK + 0.25, 0.5)
    curves = [("stars", psf_truth.growth(image, radii))]
    curves += [(f"left by {way}", psf_truth.growth(left, radii)) for way, (_, left) in stacks.items()]
    lines = [f"set terminal pngcairo noenhanced size {300 * (len(panels) + 1)},330 font ',9'", f"set output '{path}'",
             f"set multiplot layout 1,{len(panels) + 1}", "set size ratio -1; unset key; set tics out nomirror"]
    for name, values, limits in panels:
        lines += [f"set title '{name}'", f"set cbrange {limits}",
                  "set palette gray" if name == "stars" else "set palette defined (0 'blue', 1 'white', 2 'red')",
                  f"plot [-{STACK}:{STACK}][-{STACK}:{STACK}] '-' matrix using ($1-{STACK}):($2-{STACK}):3 with image"]
        lines += [" ".join(f"{v:.4g}" for v in row) for row in values] + ["e"]
    lines += ["set size noratio; set key center right; set grid; set title 'curves of growth'", "set xlabel 'FWHM'",
              "plot [0:] [-0.2:1.1] " + ", ".join(f"'-' with lines lw 2 title '{n}'" for n, _ in curves)]
    for _, values in curves:
        lines += [f"{r / fwhm:.4g} {v:.5g}" for r, v in zip(radii, values)] + ["e"]
    subprocess.run(["gnuplot"], input="\n".join(lines) + "\n", text=True, check=True)


def coadd_differences(data, rows, header):
    """MAG_TEMPLATE less the magnitude of the deep coadd, by magnitude."""
    table = fits.getdata(data / "sdss/94-1-12/stripe82_coadd_catalog.fit", 1)
    model = -2.5 * np.log10(table["fracdev_r"] * 10**(-0.4 * table["devmag_r"].astype(float))
                            + (1 - table["fracdev_r"]) * 10**(-0.4 * table["expmag_r"].astype(float)))
    star = table["probpsf"] > 0.5
    mag = np.where(star, table["psfmag_r"], model)
    good = table["is_saturated"] == 0
    known = np.column_stack(WCS(header).all_world2pix(table["ra"], table["dec"], 1))[good]
    distance, k = cKDTree(np.column_stack([rows["X_IMAGE"], rows["Y_IMAGE"]])).query(known)
    ours = rows["FLUX_TEMPLATE"][k].astype(float)
    near = (distance < 2.5) & (ours > 0)
    off = 22.5 - 2.5 * np.log10(np.where(ours > 0, ours, 1)) - mag[good]
    bins = []
    for low in range(16, 21):
        for kind, chosen in (("stars", star[good]), ("all", np.full(len(known), True))):
            d = off[near & chosen & (mag[good] >= low) & (mag[good] < low + 1)]
            if len(d) > 4:
                bins.append({"from": low, "of": kind, "n": len(d), "bias": float(np.median(d)),
                             "scatter": width(d - np.median(d))})
    return bins


def survey_differences(data):
    """PSF magnitudes that SDSS's own pipeline measured on this frame less those of the deep coadd: what is due to the frame."""
    table = fits.getdata(data / "sdss/94-1-12/stripe82_coadd_catalog.fit", 1)
    frame = fits.getdata(next((data / "sdss/94-1-12").glob("photoObj*.fits")), 1)
    sky = [np.column_stack([t["ra"] * np.cos(np.radians(t["dec"])), t["dec"]]) * 3600 for t in (frame, table)]
    distance, k = cKDTree(sky[0]).query(sky[1])
    flux = frame["PSFFLUX"][k, 2].astype(float)
    good = (distance < 1) & (flux > 0) & (table["probpsf"] > 0.5) & (table["is_saturated"] == 0)
    off = 22.5 - 2.5 * np.log10(np.where(flux > 0, flux, 1)) - table["psfmag_r"]
    picked = [(low, off[good & (table["psfmag_r"] >= low) & (table["psfmag_r"] < low + 1)]) for low in range(16, 21)]
    return [{"from": low, "of": "stars", "n": len(d), "bias": float(np.median(d)), "scatter": width(d - np.median(d))}
            for low, d in picked]


OTHERS = {"SDSS frame": lambda data: KarhunenLoeve(data / "sdss/94-1-12/psField-000094-1-0012.fit"),
          "DECam stamp": lambda data: Model(data / "decam/c4d_171113_060340_ooi_r_ls9-psfex.fits")}


def real(out, ways=None):
    data = Path(os.environ.get("RX_SHARED_DATA", TOP / "../shared/data")).resolve()
    if not data.is_dir():
        sys.exit(f"psf.py: {data} is missing (RX_SHARED_DATA); real tiles are left out")
    ways = ways.split(",") if ways else ["AUTO", "PSFEX"]
    rows = []
    for tile in real_tiles(data):
        folder = Path(out) / tile.name.replace(" ", "-")
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "out.param").write_text(REAL_COLUMNS.replace(" ", "\n") + "\n")
        fits.writeto(folder / "tile.fits", tile.pixels.astype(np.float32), tile.header, overwrite=True,
                     output_verify="silentfix")
        if tile.weight is not None:
            fits.writeto(folder / "weight.fits", np.maximum(tile.weight, 0).astype(np.float32), overwrite=True)
        saturation = min(float(tile.keywords.get("SATUR_LEVEL", 1e9)), FLAT.get(tile.name, 0.9) * np.nanmax(tile.pixels))
        places, stacks, widths = None, {}, {}
        for way in ways:
            a = {"tile": tile.name, "way": way}
            rows.append(a)
            try:
                found, planes, model, facts = extract(folder, tile, way)
                a |= facts | {"sources": len(found)}
                height, wide = tile.pixels.shape
                at = places_of(wide, height)
                if places is None and len(found):
                    places = choose(found, tile.pixels.shape, saturation, float(facts["cards"].get("RXTPFWHM", 4)),
                                    8 if tile.name in FLAT else 20)
                if places is not None and len(places):
                    made, a["stacked"], a["points"] = stack(found, planes, places)
                    if made is not None:
                        stacks[way], widths[way] = made, float(facts["cards"].get("RXTPFWHM", 4))
                        a |= judged(made, float(facts["cards"].get("RXTPFWHM", 4)))
                if tile.name == "SDSS frame" and model is not None:
                    a["coadd"], a["own"] = coadd_differences(data, found, tile.header), survey_differences(data)
                    a["beyond"] = 1 - float(psf_truth.growth(model.stamp(*at[0]), [7.43 / 0.396])[0])
                if tile.name in OTHERS and model is not None:
                    own = OTHERS[tile.name](data)
                    a["survey"] = compare(model, at, [own.stamp(*p) for p in at], float(facts["cards"].get("RXTPFWHM", 4)))
            except (RuntimeError, OSError, ValueError) as error:
                a["failed"] = str(error)
            print({k: v for k, v in a.items() if k not in ("said", "cards")}, flush=True)
        if stacks:
            picture(stacks, widths["AUTO"] if "AUTO" in widths else next(iter(widths.values())), Path(out) / f"{folder.name}.png")
        (Path(out) / "real.json").write_text(json.dumps(rows, indent=1, default=plain) + "\n")


def judged(made, fwhm):
    image, left = made
    half = image.shape[0] // 2
    r = np.hypot(*np.mgrid[-half:half + 1, -half:half + 1])
    core, radii = r <= 2 * fwhm, [a * fwhm for a in (1, 2, 3, 5, 8) if a * fwhm <= half]
    return {"stacked residual": float(np.abs(left[core]).max() / image.max()),
            "rms residual": float(np.sqrt((left[core]**2).sum() / (image[core]**2).sum())),
            "growth": [float(v) for v in psf_truth.growth(left, radii)], "radii": [float(v / fwhm) for v in radii]}


# --- small and empty tiles

# side, bright stars, what else is known: keywords, or FWHM in the header
SMALL = [(100, 0, {}), (100, 1, {}), (100, 2, {}), (150, 1, {}), (150, 3, {}), (200, 2, {}), (200, 4, {}), (250, 3, {}),
         (250, 5, {}), (150, 0, {"FWHM": 4.0}), (150, 2, {"FWHM": 4.0}), (150, 0, {"SEEING_FWHM": 1.6, "PIXEL_SCALE": 0.4}),
         (150, 0, {"PSF_FWHM": 4.0}), (150, 0, {"tile.psf": 4.0})]


def small(out, seed="1"):
    """Kolmogorov, FWHM 4; bright stars have S/N 30 to 300, ten times as many are fainter."""
    ledger.claim("psf small", out, [seed])
    truth = Truth("KOLMOGOROV", 4.0, 0.1)
    folder = Path(out) / "small"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "out.param").write_text(COLUMNS.replace(" ", "\n") + "\n")
    rows = []
    for number_of, (side, stars, known) in enumerate(SMALL):
        rng = np.random.default_rng([int(seed), number_of])
        x, y = rng.uniform(12, side - 13, (2, stars))
        floor = psf_truth.SIGMA / np.sqrt((truth.stamp(0, 0, 20)**2).sum())
        flux = floor * 10**rng.uniform(np.log10(30), np.log10(300), stars)
        faint = rng.uniform(0, side - 1, (2, 10 * stars)), floor * 10**rng.uniform(0.3, 1.2, 10 * stars)
        light = psf_truth.draw(Truth("KOLMOGOROV", 4.0, 0.1, side=side), [*x, *faint[0][0]], [*y, *faint[0][1]],
                               [*flux, *faint[1]])
        header = fits.Header([("FWHM", known["FWHM"], "[pixel] of stars")] if "FWHM" in known else [])
        fits.writeto(folder / "tile.fits", psf_truth.expose(light, rng), header, overwrite=True)
        (folder / "tile.psf").unlink(missing_ok=True)
        if "tile.psf" in known:
            stamp = truth.stamp(side / 2, side / 2, 40)
            fits.writeto(folder / "tile.psf", (stamp / stamp.sum()).astype(np.float32))
        rows.append({"tile": f"{side} px", "bright stars": stars,
                     "stated": ", ".join(f"{k} {v:g}" for k, v in known.items())}
                    | answer(folder, "tile.fits", {k: v for k, v in known.items() if k not in ("FWHM", "tile.psf")} | {
                        "GAIN": GAIN, "SATUR_LEVEL": SATURATION, "MAG_ZEROPOINT": ZEROPOINT}, x, y, flux))
    (folder / "tile.psf").unlink(missing_ok=True)
    data = Path(os.environ.get("RX_SHARED_DATA", TOP / "../shared/data")).resolve()
    for make, cut in ((tiles.sdss_frame, np.s_[700:850, 900:1050]), (tiles.sdss_frame, np.s_[200:450, 300:550]),
                      (tiles.decam, np.s_[:, :])):
        try:
            tile = make(data)
        except OSError:
            continue
        pixels = tile.pixels[cut]
        header = fits.Header([c for c in tile.header.cards if c.keyword in ("GAIN", "FWHM")])
        fits.writeto(folder / "tile.fits", pixels, header, overwrite=True)
        rows.append({"tile": f"{tile.name}, {pixels.shape[1]} x {pixels.shape[0]} px", "bright stars": None, "stated": ""}
                    | answer(folder, "tile.fits", {k: v for k, v in tile.keywords.items() if not k.startswith("PSF_")}))
    (Path(out) / "small.json").write_text(json.dumps(rows, indent=1, default=plain) + "\n")


def answer(folder, tile, keys, x=(), y=(), flux=()):
    """What the program says and does: cards, warnings, MAG_TEMPLATE of the bright stars against the truth."""
    arguments = {"RESTORE_TYPE": "RL", "PSF_TYPE": "AUTO", "CATALOG_TYPE": "FITS_1.0", "HEADER_FACTS": "ALL", "CATALOG_NAME": "out.cat",
                 "PARAMETERS_NAME": "out.param", "NTHREADS": 2, **keys}
    try:
        log, _ = call(folder, find("rextract"), tile, *keywords(**arguments))
    except RuntimeError as error:
        return {"failed": str(error)}
    rows, head = fits.getdata(folder / "out.cat", 1, header=True)
    off = []
    if len(rows) and len(x):
        distance, k = cKDTree(np.column_stack([rows["X_IMAGE"], rows["Y_IMAGE"]]) - 1.0).query(np.column_stack([x, y]))
        ours = rows["FLUX_TEMPLATE"][k].astype(float)
        off = [round(float(-2.5 * np.log10(o / f)), 4) for o, f, d in zip(ours, flux, distance) if d < 2 and o > 0]
    keep = ("RXREST", "RXASKED", "RXWHY", "RXPSF", "RXFWHM", "RXTPFWHM")
    return {"cards": {k: v for k, v in head.items() if k.startswith(keep)}, "said": warned(log), "mag": off}


# --- tiles of few stars: errors of fluxes on the lower rungs

KINDS = ("MOFFAT 2.5", "MOFFAT 3.5", "MOFFAT 4.765", "HALO", "KOLMOGOROV", "SPIKES")
FEW = [(1, 150), (2, 150), (3, 200), (4, 200), (6, 250), (7, 250), (8, 250)]  # bright stars, side
STATED = 0.1  # 1 sigma of the FWHM that the header states


def few(out, seeds="1"):
    """FWHM 4; bright stars have S/N 30 to 300, ten times as many are fainter. Each tile twice: by PSF_TYPE AUTO, and by the
    header's FWHM alone, which is off by 10 % (1 sigma). Bright lone stars of the catalogue against the truth."""
    ledger.claim("psf few", out, seeds.split(","))
    folder = Path(out) / "few"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "out.param").write_text(COLUMNS.replace(" ", "\n") + "\n")
    rows = []
    for seed in map(int, seeds.split(",")):
        for number_of, kind in enumerate(KINDS):
            for stars, side in FEW:
                rng = np.random.default_rng([seed, number_of, stars])
                truth = Truth(kind, 4.0, 0.1, side=side)
                floor = psf_truth.SIGMA / np.sqrt((truth.stamp(0, 0, 20)**2).sum())
                x, y = np.hstack([rng.uniform(12, side - 13, (2, stars)), rng.uniform(0, side - 1, (2, 10 * stars))])
                flux = floor * 10**np.hstack([rng.uniform(np.log10(30), np.log10(300), stars),
                                              rng.uniform(0.3, 1.2, 10 * stars)])
                head = fits.Header([("FWHM", 4.0 * (1 + STATED * rng.standard_normal()), "[pixel] of stars")])
                fits.writeto(folder / "tile.fits", psf_truth.expose(psf_truth.draw(truth, x, y, flux), rng), head,
                             overwrite=True)
                bright = np.flatnonzero(lonely(x, y, flux, 2.5 * truth.fwhm)[:stars])
                for way in ("AUTO", "MOFFAT"):
                    call(folder, find("rextract"), "tile.fits", *keywords(
                        RESTORE_TYPE="NONE", PSF_TYPE=way, CATALOG_TYPE="FITS_1.0", HEADER_FACTS="ALL", CATALOG_NAME="out.cat",
                        PARAMETERS_NAME="out.param", GAIN=GAIN, SATUR_LEVEL=SATURATION, NTHREADS=1))
                    found, head = fits.getdata(folder / "out.cat", 1, header=True)
                    if "RXPSFERR" not in head or not len(found):
                        continue
                    distance, k = cKDTree(np.column_stack([found["X_IMAGE"], found["Y_IMAGE"]]) - 1.0).query(
                        np.column_stack([x, y])[bright])
                    k, true = k[distance < 1.5], flux[bright][distance < 1.5]
                    off, error = found["FLUX_TEMPLATE"][k] - true, found["FLUXERR_TEMPLATE"][k]
                    rows.append({"kind": kind, "seed": seed, "stars": stars, "how": head["RXPSFHOW"],
                                 "error": head["RXPSFERR"], "off": (off / true).tolist(), "pull": (off / error).tolist()})
    (Path(out) / "few.json").write_text(json.dumps(rows, default=plain) + "\n")


# --- the stated error

# name: FWHM, bright stars, galaxies per Mpixel, how the PSF varies
GRID = {f"FWHM {f}, {n} stars": (f, n, 0, "CONSTANT") for f in (1.3, 2.5, 4.0, 8.0, 14.0) for n in (3, 10, 30, 100, 1000)
        if n * f < 3000} | {
    "crowd": (3.0, 800, 0, "CONSTANT"), "varying, 40 stars": (3.0, 40, 0, "QUADRATIC"),
    "varying, 200 stars": (3.0, 200, 0, "QUADRATIC"), "galaxies, 10 stars": (3.0, 10, 1000, "CONSTANT"),
    "galaxies, 40 stars": (3.0, 40, 1000, "LINEAR"), "hit, 3 stars": (4.0, 3, 0, "CONSTANT"),
    "saturated, 10 stars": (4.0, 10, 0, "CONSTANT")}


def grid_tile(folder, name, seed):
    """Bright stars have S/N from 30 to what saturates, N(> F) ~ F^-0.6, one in 144 FWHM^2, or in what 1024 pixels leave; as many are
    fainter. The crowd has 8000 per Mpixel of S/N above 5 in all. Tiles that lie there are not drawn again."""
    fwhm, n, galaxies, varies = GRID[name]
    side = int(np.clip(12 * fwhm * np.sqrt(n), max(192, 40 * fwhm), 1024)) if name != "crowd" else 512
    number_of = list(GRID).index(name)
    rng = np.random.default_rng([seed, number_of, 49])
    truth = Truth(KINDS[(seed + number_of) % len(KINDS)], fwhm, 0.1, varies, side)
    middle = truth.stamp(side / 2, side / 2, int(4 * fwhm + 2))
    floor, top = psf_truth.SIGMA / np.sqrt((middle**2).sum()), 0.85 * (SATURATION - psf_truth.SKY) / middle.max()
    faint = n * (1 if name != "crowd" else 2)

    def fluxes(low, high, m):
        return low * (1 - rng.random(m) * (1 - (high / low)**-0.6))**(-1 / 0.6)
    margin = min(3 * fwhm, 0.1 * side)
    x, y = np.hstack([rng.uniform(margin, side - 1 - margin, (2, n)), rng.uniform(0, side - 1, (2, faint))])
    flux = np.hstack([fluxes(30 * floor, top, n), fluxes(5 * floor, 30 * floor, faint)])
    if name.startswith("saturated"):
        x, y = np.hstack([[x, y], rng.uniform(0, side - 1, (2, 10))])
        flux = np.hstack([flux, rng.uniform(1.5, 10, 10) * top])
    if (folder / "tile.fits").exists():
        return truth
    light = psf_truth.draw(truth, x, y, flux)
    if galaxies:
        size = int(6 * fwhm)
        stamp = truth.stamp(side / 2, side / 2, size)
        fits.writeto(folder / "middle.fits", (stamp / stamp.sum()).astype(np.float32), overwrite=True)
        call(folder, find("rextract-simulate"), *keywords(
            IMAGE_SIZE=side, SEED=seed, PSF_TYPE="FILE", PSF_NAME="middle.fits", NOISE_TYPE="NONE", SKY_LEVEL=0, STAR_COUNT=0,
            GALAXY_COUNT=galaxies, GALAXY_MAG="13,19", MAG_ZEROPOINT=ZEROPOINT, IMAGE_NAME="galaxies.fits", TRUTH_NAME=""))
        light = light + np.maximum(fits.getdata(folder / "galaxies.fits"), 0)
    if name.startswith("hit"):  # of a particle
        light[side // 3, side // 4:side // 4 + 2] += 20000
    fits.writeto(folder / "tile.part", psf_truth.expose(light, rng), overwrite=True)
    (folder / "tile.part").rename(folder / "tile.fits")
    return truth


def grid(out, seeds="1", names=""):
    """What the measured PSF does to the fluxes of bright stars, against what RXPSFERR says of it."""
    ledger.claim("psf grid", out, seeds.split(","))
    file = Path(out) / "grid.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    rows = json.loads(file.read_text()) if file.exists() else []
    for seed in map(int, seeds.split(",")):
        for name in [n for n in GRID if any(w in n for w in names.split(";"))]:
            folder = Path(os.environ.get("RX_TILES", out)) / f"seed-{seed}" / re.sub("[ ,.]+", "-", name)
            folder.mkdir(parents=True, exist_ok=True)
            (folder / "out.param").write_text((COLUMNS if name == "crowd" else "NUMBER X_IMAGE Y_IMAGE").replace(" ", "\n") + "\n")
            rows = [a for a in rows if (a["tile"], a["seed"]) != (name, seed)]
            truth = grid_tile(folder, name, seed)
            row = {"tile": name, "seed": seed, "kind": truth.kind}
            try:
                model, facts = measure(folder, truth, "AUTO")
            except (RuntimeError, OSError) as error:
                rows.append(row | {"failed": str(error)})
                continue
            cards = facts["cards"]
            row |= {"how": cards.get("RXPSFHOW"), "stated": cards.get("RXPSFERR"), "largest": cards.get("RXPSFERX"),
                    "seconds": facts["seconds"], "said": facts["said"], "line": facts["line"]}
            places = places_of(truth.side, truth.side)[:PLACES**2:7]
            off = []
            for place in places if truth.varies != "CONSTANT" else places[:1]:
                m, t = psf_truth.common(model.stamp(*place), truth.stamp(*place, int(np.ceil(10 * truth.fwhm))))
                off.append(float((m * t).sum() / (m * m).sum() - 1))
            row |= {"off": off}
            rows.append(row)
            file.write_text(json.dumps(rows, indent=1, default=plain) + "\n")
            print(f"{name:24s} {truth.kind:12s} {row['how'] or '-':12s} flux {100 * np.mean(off):+6.2f} % rms {100 * np.std(off):5.2f} "
                  f"stated {100 * (row['stated'] or 0):5.2f} {row['seconds']:.2f} s", flush=True)
    print("\n".join(grid_page(rows, out)))


def grid_page(rows, _):
    lines = []
    for name in [*GRID, "all"]:
        mine = [a for a in rows if (a["tile"] == name or name == "all") and a.get("stated")]
        failed = sum("failed" in a or not a.get("stated") for a in rows if a["tile"] == name or name == "all")
        if not mine:
            continue
        off = np.array([np.sqrt(np.mean(np.square(a["off"]))) * np.sign(np.mean(a["off"])) for a in mine])
        stated = np.array([a["stated"] for a in mine])
        lines.append(f"| {name} | {len(mine)} | {failed} | {100 * off.mean():+.2f} | {100 * np.sqrt((off**2).mean()):.2f} | "
                     f"{100 * np.median(abs(off)):.2f} | {100 * np.sqrt((stated**2).mean()):.2f} | {np.sqrt(((off / stated)**2).mean()):.2f} | "
                     f"{width(off / stated):.2f} | {np.mean([a['seconds'] for a in mine]):.2f} |")
    return ["## The stated error", "",
            f"Seeds {', '.join(sorted({str(a['seed']) for a in rows}, key=int))}, whose true PSFs are {', '.join(KINDS)} in turn. off: flux that a fit of "
            "the measured PSF finds of a star without noise, less the true one; stated: RXPSFERR; no PSF: tiles where no star gave one.", "",
            *table(["tile", "tiles", "no PSF", "off (%), mean", "rms", "median size", "stated, rms", "rms of off / stated", "robust",
                    "CPU s"], lines)]


# --- the page

def held(a):
    """Which of the goals a tile with 100 usable stars or more misses, and which of them its stars cannot show: off by no more
    than twice what they allow."""
    if "failed" in a:
        return [a["failed"]], []
    wrong, beyond = [], []
    for goal, limit, text, values in (("dT/T", "limit dT/T", "dT/T {:+.4f}", [a["dT/T"]]),
                                      ("de", "limit de", "de {:+.5f}, {:+.5f}", [a["de1"], a["de2"]])):
        if max(map(abs, values)) > LIMITS[goal]:
            (wrong if max(map(abs, values)) > 2 * a.get(limit, 0) else beyond).append(text.format(*values))
    if a.get("mag") is not None and abs(a["mag"]) > LIMITS["mean"]:
        wrong.append(f"fluxes {a['mag']:+.4f} mag")
    if abs(a["predicted corner mag"]) > LIMITS["corner"]:
        wrong.append(f"a corner {a['predicted corner mag']:+.3f} mag")
    if a.get("pull width") is not None and abs(a["pull width"] - 1) > LIMITS["pull"]:
        wrong.append(f"pulls {a['pull width']:.2f}")
    return wrong, beyond


def table(head, rows):
    return ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head), *rows, ""]


def truth_page(rows, out):
    version = subprocess.run([find("rextract"), "-v"], capture_output=True, text=True).stdout.split("\n")[0]
    by = {key(a): a for a in rows if "failed" not in a}
    judged = [(a, *held(a)) for a in rows if a["way"] == "AUTO" and a["usable"] >= 100]
    lines = []
    for way in dict.fromkeys(a["way"] for a in by.values()):
        mine = [a for a in by.values() if a["way"] == way]
        pull = np.array([p for a in mine for p in a.get("pulls", [])])
        medians = (np.median([abs(a[k]) for a in mine if a.get(k) is not None])
                   for k in ("dT/T", "residual", "growth missed", "mag"))
        lines.append("| " + " | ".join([way, str(len(mine)), *(f"{m:.4f}" for m in medians), str(len(pull)),
                     f"{np.median(pull):+.2f}", f"{width(pull):.2f}", f"{sum(a['seconds'] for a in mine):.0f}"]) + " |")
    duels = [(a, by[a["case"], a["seed"], "PSFEX"]) for a in by.values()
             if a["way"] == "AUTO" and (a["case"], a["seed"], "PSFEX") in by]
    better = ", ".join(f"{k} on {sum(abs(a.get(k) or 0) <= abs(b.get(k) or 0) for a, b in duels)}"
                       for k in ("residual", "dT/T", "de rms", "growth missed", "mag", "seconds"))
    return ["## Known truths", "",
            f"Seeds {', '.join(sorted({str(a['seed']) for a in rows}))}; {version}. Stars drawn here and by rextract-simulate"
            f" differ by {drawing_error(Path(out) / 'check'):.0e} of the peak at most.", "", *table(HEAD, map(line_of, rows)),
            "Goals, on tiles with 100 usable stars or more (S/N above 20, not saturated): |dT/T| 1e-3, |de| 2e-4, median flux"
            " 0.003 mag, every corner 0.01 mag, pulls 1 +- 0.15. A goal below twice the limit is not one that these stars can show;"
            " what is above the goal but not above twice the limit stands apart.", "",
            *table(["tile", "seed", "usable stars", "limit dT/T (1e-3)", "limit de (1e-4)", "AUTO misses", "within twice the limit"],
                   [f"| {a['case']} | {a['seed']} | {a['usable']} | {number(1e3 * a.get('limit dT/T', np.nan), '.2f')} | "
                    f"{number(1e4 * a.get('limit de', np.nan), '.1f')} | {'; '.join(w) or 'nothing'} | {'; '.join(b)} |"
                    for a, w, b in judged]),
            f"{sum(not w for _, w, _ in judged)} of {len(judged)} tiles miss nothing; on"
            f" {sum(a.get('limit de', 0) > LIMITS['de'] for a, _, _ in judged)} of them 1 sigma of de is above its goal for any"
            " method. Medians over all tiles:", "",
            *table(["PSF", "tiles", *(f"size of {k}" for k in ("dT/T", "residual", "growth", "mag")), "bright stars",
                    "median pull", "width", "CPU s in all"], lines),
            f"AUTO is as good as psfex's model or better, of {len(duels)} tiles that both do: {better}.", ""]


def real_page(rows, _):
    head = ["tile", "PSF", "RXPSFHOW", "FWHM", "stars stacked", "taken for points", "largest residual (%)", "rms (%)",
            "light left within 1, 2, 3, 5, 8 FWHM (%)", "beside the survey's own PSF: dT/T, rms; de rms", "RXTPCHI2",
            "warnings"]
    lines, coadd = [], []
    for a in rows:
        cards, s = a.get("cards", {}), a.get("survey")
        left = [number(100 * a[k] if k in a else None, ".1f") for k in ("stacked residual", "rms residual")]
        said = "<br>".join(a.get("said", [])) or a.get("failed", "").strip().split("\n")[-1]
        lines.append("| " + " | ".join([
            a["tile"], a["way"], cards.get("RXPSFHOW", ""), number(cards.get("RXTPFWHM"), ".3f"), str(a.get("stacked", "")),
            number(a.get("points"), ".2f"), *left, " ".join(f"{100 * v:+.1f}" for v in a.get("growth", [])),
            f"{s['dT/T']:+.4f}, {s['dT/T rms']:.4f}; {s['de rms']:.4f}" if s else "", number(cards.get("RXTPCHI2"), ".2f"),
            said]) + " |")
        inside = -2.5 * np.log10(1 - a.get("beyond", 0))
        coadd += [f"| {b['from']} to {b['from'] + 1} | {b['of']} | {a['way']} | {b['n']} | {b['bias']:+.3f} | "
                  f"{b['bias'] + inside:+.3f} | {b['scatter']:.3f} |" for b in a.get("coadd", [])]
    coadd += [f"| {b['from']} to {b['from'] + 1} | {b['of']} | SDSS | {b['n']} | {b['bias']:+.3f} | {b['bias']:+.3f} | "
              f"{b['scatter']:.3f} |" for b in next((a["own"] for a in rows if "own" in a), [])]
    beyond = ", ".join(f"{100 * a['beyond']:+.1f} % ({a['way']})" for a in rows if "beyond" in a)
    pictures = [f"[{n}]({n.replace(' ', '-')}.png)" for n in dict.fromkeys(a["tile"] for a in rows if a.get("stacked"))]
    return ["## Real tiles", "",
            f"Stacks of bright lone stars (logarithm, four decades), then what the templates of {', '.join(unique(rows))}"
            f" leave of them (-5 to 5 % of the peak), and curves of growth: {', '.join(pictures)}. Stars of M67 are those below"
            " the plate's flattening: those above have twice the width.", "", *table(head, lines),
            "MAG_TEMPLATE of the SDSS frame less the deep coadd, whose magnitudes hold the light within 7.43 arcsec; beyond"
            f" that the PSFs have {beyond}:", "", *table(["r", "of", "PSF", "n", "median", "scatter"], sorted(coadd))]


def unique(rows):
    return dict.fromkeys(a["way"] for a in rows)


def small_page(rows, _):
    lines = []
    for a in rows:
        cards, said = a.get("cards", {}), "<br>".join(a.get("said", [])) or a.get("failed", "")
        lines.append("| " + " | ".join([
            a["tile"], number(a["bright stars"], "d"), a["stated"], cards.get("RXPSFHOW", ""),
            number(cards.get("RXPSFMAX"), "g"), cards.get("RXPSF", ""),
            cards.get("RXREST", ""), " ".join(f"{m:+.3f}" for m in a.get("mag", [])), said]) + " |")
    return ["## Small and empty tiles", "",
            "RESTORE_TYPE RL, PSF_TYPE AUTO; a Kolmogorov PSF of FWHM 4, but for the real ones.", "",
            *table(["tile", "bright stars", "stated", "RXPSFHOW", "RXPSFMAX", "RXPSF", "restored by", "their MAG_TEMPLATE - truth",
                    "what it says"], lines)]


def few_page(rows, _):
    lines = []
    for how in sorted({a["how"] for a in rows}):
        for kind in (*KINDS, ""):
            mine = [a for a in rows if a["how"] == how and kind in a["kind"] and a["off"]]
            off, pull = (np.array([v for a in mine for v in a[k]]) for k in ("off", "pull"))
            if len(off):
                lines.append(f"| {how} | {kind or 'all'} | {len(mine)} | {len(off)} | {100 * np.median(off):+.1f} | "
                             f"{100 * np.sqrt((off**2).mean()):.1f} | {width(pull):.2f} | "
                             f"{np.median([a['error'] for a in mine]):.3f} |")
    return ["## Few stars, or a stated FWHM", "",
            f"Seeds {', '.join(sorted({str(a['seed']) for a in rows}))}. FWHM 4, tiles of 150 to 250 pixels with one to eight bright"
            " stars; STATED has the header's FWHM alone, which is 10 % off (1 sigma). RXPSFERR is part of the error in pulls.", "",
            *table(["RXPSFHOW", "true PSF", "tiles", "stars", "flux - truth (%), median", "rms", "pulls' width", "RXPSFERR"], lines)]


def page(out):
    out = Path(out)
    text = ["# The PSF that is measured on a tile", "", *__doc__[__doc__.index("What the columns"):].splitlines(), ""]
    for name, write in (("truth", truth_page), ("real", real_page), ("small", small_page), ("few", few_page), ("grid", grid_page)):
        if (out / f"{name}.json").exists():
            text += write(json.loads((out / f"{name}.json").read_text()), out)
    (out / "psf.md").write_text("\n".join(text).rstrip() + "\n")


if __name__ == "__main__":
    programs = {"truth": truth, "real": real, "small": small, "few": few, "grid": grid, "page": page}
    if len(sys.argv) < 3 or sys.argv[1] not in programs:
        sys.exit(__doc__)
    programs[sys.argv[1]](*sys.argv[2:])
