#!/usr/bin/python3
"""Every way in which a sky departs from what restorers and templates are made for, one at a time, and whether the program
notices where it fails.

    robustness.py OUTPUT [SEED [NAME[,NAME...]]]      (validation/run.sh robustness [OUTPUT [SEED ...]])

SEED: 101 to try and to choose by, from 1000 on final ones (ledger.py). The sky is a simulated one like an SDSS frame (tiles.py): 600
stars of magnitude 16 to 23 and 200 galaxies per Mpixel, FWHM 3.28 pixels, noise 0.031. A departure is a line of DEPARTURES: arguments of rextract-simulate, what
is done to the pixels afterwards, arguments of rextract. NONE, RL and NET run on it at default settings, and each of these
cells is judged by what LIMITS says, on objects that have no neighbour of 0.3 of their flux within 1 FWHM:

    recall    of objects of S/N above 10, of an ideal matched filter in wide-sum noise
    false     sources per Mpixel without an object within 2 pixels and within 1 FWHM (the larger of both) and without a mark of
              FLAGS_RESTORE that says so (MARKS); and their share. Not within 8 pixels of the border: objects lie beyond it,
              too, whose light comes in, and the truth does not list them
    bias      median of FLUX_TEMPLATE / true flux - 1 of stars of S/N 20 to 200
    pull      1.4826 times the median deviation of (FLUX_TEMPLATE - true flux) / FLUXERR_TEMPLATE of stars of S/N 10 to 100

A cell is off where one of them is beyond its limit by more than two standard errors. It has warned where its own header or
catalogue says so: SAID, or FLAGS_RESTORE of MARKS for half of the sources, and the sky without a departure does not. Off without a
warning is a silent failure; the log does not count. A warning is right where a value is beyond its limit at all, false sources that are
marked for their place alone among them; that half of the sources are marked is right where these are false, too. Into OUTPUT: summary.json.
"""
import json
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from astropy.io import fits
from scipy.ndimage import gaussian_filter, minimum_filter
from scipy.spatial import cKDTree

import ledger
import psf_truth
import tiles
from tiles import RESTORERS, near

SKY, SIGMA, FWHM, SIDE, EDGE = 0.87, 0.031, 3.28, 768, 8
MARKS = 1 | 2 | 4 | 16 | 32 | 64 | 128 | 256  # FLAGS_RESTORE: all but ADDED, which is no doubt
DONE = 16 | 64  # of these: what was done, or in training, as RXREST and RXNETIN say, and no word on what came of it
WORDS = DONE | 32 | 128  # of these: what is said of a place or a tile, and not found of the source itself
# name: limit, and why there
LIMITS = {
    "recall": (0.9, "nine of ten that stand ten times above the noise"),
    "false": (20, "per Mpixel, or a fiftieth of the sources where those are more: a purity of 0.98"),
    "bias": (0.02, "0.02 mag, what the flux check allows AUTO (RXFLXOK)"),
    "pull": (1.3, "errors that are 0.77 of the true ones or less, or, below 0.8, 1.25 or more"),
}
LOW = 0.8  # pulls
# cards that are a warning, and where
SAID = {
    "RXNOISOK": lambda card: card in ("F", False),
    "RXNEVEN": lambda card: card in ("F", False),
    "RXFLXOK": lambda card: card in ("F", False),
    "RXPSFHOW": lambda card: card == "UNKNOWN",
    "RXPSFMAX": lambda card: True,
    "RXPSFLIM": lambda card: True,
    "RXMISFIT": lambda card: True,
    "RXUNSEEN": lambda card: card > 1,  # unseen neighbours are more than half of the errors
}


@dataclass
class Departure:
    kind: str
    name: str
    what: str
    sim: dict = field(default_factory=dict)
    post: object = None  # of x, y, rng: light in noise sigmas
    run: dict = field(default_factory=dict)
    psf: str = ""  # profile of psf_truth.py
    tiles: int = 1
    edit: object = None  # of pixels, x, y: what becomes of them


def smoothed(fwhm):
    return lambda x, y, rng: gaussian_filter(rng.standard_normal(x.shape), fwhm / 2.3548, mode="wrap")


def fringes(x, y, rng):
    return 2 * np.sin(2 * np.pi * (x + 0.4 * y) / np.hypot(1, 0.4) / 30)


def trail(x, y, rng):
    return 6 * np.exp(-((y - 0.37 * x - 120) / np.hypot(1, 0.37)) ** 2 / 2 / 1.4 ** 2)


def ghost(x, y, rng):
    return 1.0 * (abs(np.hypot(x - x.max() / 2, y - y.max() / 2) - 200) < 20)


def cosmic_rays(x, y, rng):
    out = np.zeros(x.shape)
    for _ in range(int(200 * x.size / 1e6)):
        u, v, angle, length = *rng.uniform(0, x.shape[0], 2), rng.uniform(0, np.pi), rng.integers(1, 13)
        at = np.array([v + np.arange(length) * np.sin(angle), u + np.arange(length) * np.cos(angle)]).astype(int)
        at = at[:, ((at >= 0) & (at < x.shape[0])).all(0)]
        out[tuple(at)] = rng.uniform(10, 100)
    return out


def bad_columns(x, y, rng):
    return np.where(x == 300, -0.5 * SKY / SIGMA, np.where(x == 600, 30, 0))


def clouds(fwhm, height):
    """A nebula: smooth random light of that scale, its highest crest that high."""
    def make(x, y, rng):
        light = gaussian_filter(rng.standard_normal(x.shape), fwhm / 2.3548, mode="wrap")
        return height * np.maximum(light, 0) / light.max()
    return make


def bowls(x, y, rng):
    """Over-subtracted sky: hollows as wide as the mesh of a reduction, a sigma deep."""
    at = rng.uniform(0, x.shape[0], (12, 2))
    return -sum(np.exp(-((x - u) ** 2 + (y - v) ** 2) / 2 / 25**2) for u, v in at)


def amplifiers(x, y, rng):
    return np.select([x < 200, x < 400, x < 600], [0, 1.2, -0.8], 0.6)


def edge_glow(x, y, rng):
    return 4 * np.exp(-x / 12) + 4 * np.exp(-(y.max() - y) / 12)


def streaks(x, y, rng):
    out = np.zeros(x.shape)
    for _ in range(8):
        angle, at = rng.uniform(0, np.pi), rng.uniform(0, x.shape[0], 2)
        out += 3 * np.exp(-(((x - at[0]) * np.sin(angle) - (y - at[1]) * np.cos(angle)) ** 2) / 2 / 1.4**2)
    return out


def pupils(x, y, rng):
    """Out-of-focus images of bright stars: disks with a hole, half a sigma to three sigmas high."""
    out = np.zeros(x.shape)
    for u, v, high in zip(*rng.uniform(0, x.shape[0], (2, 4)), (0.5, 1, 2, 3)):
        r = np.hypot(x - u, y - v)
        out += high * ((r < 70) & (r > 25))
    return out


def interpolated(pixels, x, y):
    """Every 40th column is the mean of its neighbours."""
    out, bad = pixels.copy(), np.arange(20, pixels.shape[1] - 1, 40)
    out[:, bad] = (pixels[:, bad - 1] + pixels[:, bad + 1]) / 2
    return out


def chip_edges(pixels, x, y):
    """Two chips side by side, their outermost pixels cut by half in sensitivity, and nothing in the gap."""
    out = np.where((x > 370) & (x < 398), 0, pixels)
    return np.where((x == 370) | (x == 398), 0.5 * pixels, out)


STARS = "STAR_COUNT"
CCD = {"NOISE_TYPE": "CCD", "GAIN": 905, "READ_NOISE": 5}
CROWD = {"IMAGE_SIZE": 512}
GIVEN = {"PSF_TYPE": "MOFFAT", "PSF_BETA": 4.765}
DEPARTURES = [
    Departure("none", "none", "as it is"),
    Departure("noise", "smoothed", "noise smoothed by a Gaussian of FWHM 2", {"NOISE_TYPE": "NONE"}, smoothed(2)),
    Departure("noise", "smoothed 4", "noise smoothed by a Gaussian of FWHM 4", {"NOISE_TYPE": "NONE"}, smoothed(4)),
    Departure("noise", "drizzled", "4 frames drizzled", {"NOISE_SIGMA": SIGMA / 0.3, "COADD_TYPE": "DRIZZLE"}),
    Departure("noise", "Lanczos", "3 frames interpolated, depths uneven, no weight map",
              {"NOISE_SIGMA": SIGMA * 3**0.5, "COADD_TYPE": "LANCZOS", "COADD_FRAMES": 3, "COADD_UNEVEN": 0.7}),
    Departure("noise", "rows", "an offset of 0.5 sigma for each row", post=lambda x, y, rng: 0.5 * rng.standard_normal(len(x))[:, None]),
    Departure("noise", "half deep", "noise twice as high in one half, no weight map",
              post=lambda x, y, rng: 3**0.5 * rng.standard_normal(x.shape) * (x > x.max() / 2)),
    Departure("noise", "photons", "photon noise without a gain", {"NOISE_TYPE": "CCD", "GAIN": 905, "READ_NOISE": 0}),
    Departure("noise", "rounded", "numbers in steps of 3 sigma", edit=lambda pixels, x, y: 3 * SIGMA * np.rint(pixels / (3 * SIGMA))),
    Departure("noise", "cut off", "values more than half a sigma below the sky cut off",
              edit=lambda pixels, x, y: np.maximum(pixels, SKY - 0.5 * SIGMA)),
    Departure("PSF", "halo", "a tenth of the light in a halo", psf="HALO"),
    Departure("PSF", "Kolmogorov", "a turbulent atmosphere's", psf="KOLMOGOROV"),
    Departure("PSF", "undersampled", "FWHM 1.5", {"PSF_FWHM": 1.5}),
    Departure("PSF", "narrow", "FWHM 1.9", {"PSF_FWHM": 1.9}),
    Departure("PSF", "wide", "FWHM 11", {"PSF_FWHM": 11}),
    Departure("PSF", "elliptical", "axis ratio 0.7", {"PSF_RATIO": 0.7, "PSF_ANGLE": 30}),
    Departure("PSF", "varying", "30 % wider in the corners", {"PSF_VARIATION": 0.3}),
    Departure("PSF", "given wide", "given 10 % too wide", run={**GIVEN, "PSF_FWHM": 1.1 * FWHM}),
    Departure("PSF", "given narrow", "given 10 % too narrow", run={**GIVEN, "PSF_FWHM": 0.9 * FWHM}),
    Departure("PSF", "no star", "galaxies alone", {STARS: 0, "GALAXY_COUNT": 600}),
    Departure("crowding", "x3", "1,200 stars per Mpixel", {STARS: 1200}),
    Departure("crowding", "x10", "4,000 stars per Mpixel", {STARS: 4000, **CROWD}),
    Departure("crowding", "x30", "12,000 stars per Mpixel", {STARS: 12000, **CROWD}),
    Departure("bright", "saturated", "stars to magnitude 11 with spikes, cut at 30 ADU, level given",
              {"STAR_MAG": "11,23", "SATUR_LEVEL": 30}, run={"SATUR_LEVEL": 29}, psf="SPIKES"),
    Departure("bright", "level unknown", "the same, level not given", {"STAR_MAG": "11,23", "SATUR_LEVEL": 30}, psf="SPIKES"),
    Departure("sky", "nebula", "light of 10 sigma that varies over 200 pixels", post=clouds(200, 10)),
    Departure("sky", "filaments", "light of 3 sigma that varies over 20 pixels", post=clouds(20, 3)),
    Departure("sky", "gradient", "20 sigma from side to side", post=lambda x, y, rng: 20 * x / x.max()),
    Departure("sky", "step", "2 sigma at a straight edge", post=lambda x, y, rng: 2.0 * (x > 400)),
    Departure("sky", "fringes", "2 sigma high, period 30 pixels", post=fringes),
    Departure("sky", "ghost", "a ring of radius 200 and width 40 pixels, 1 sigma high", post=ghost),
    Departure("defects", "cosmic rays", "200 per Mpixel, 1 to 12 pixels of 10 to 100 sigma", post=cosmic_rays),
    Departure("defects", "bad columns", "a dead one and one 30 sigma too bright", post=bad_columns),
    Departure("defects", "trail", "a satellite's, 6 sigma high", post=trail),
    Departure("defects", "no data", "a corner filled with zeros, no weight map",
              edit=lambda pixels, x, y: np.where(x + 0.6 * y < 300, 0, pixels)),
    Departure("noise", "photons known", "photon noise, its gain given", CCD, run={"GAIN": 905}),
    Departure("noise", "gain x5", "the gain given is 5 times the true one", CCD, run={"GAIN": 905 * 5}),
    Departure("noise", "gain /5", "a fifth of it", CCD, run={"GAIN": 905 / 5}),
    Departure("noise", "columns", "an offset of 0.5 sigma for each column", post=lambda x, y, rng: 0.5 * rng.standard_normal(x.shape[1])[None, :]),
    Departure("PSF", "FWHM 1.3", "", {"PSF_FWHM": 1.3}),
    Departure("PSF", "FWHM 2.3", "", {"PSF_FWHM": 2.3}),
    Departure("PSF", "FWHM 5", "", {"PSF_FWHM": 5}),
    Departure("PSF", "FWHM 8", "", {"PSF_FWHM": 8}),
    Departure("PSF", "FWHM 14", "", {"PSF_FWHM": 14}),
    Departure("PSF", "given 5 % wide", "given 5 % too wide", run={**GIVEN, "PSF_FWHM": 1.05 * FWHM}),
    Departure("crowding", "sparse", "80 stars and 60 galaxies per Mpixel", {STARS: 80, "GALAXY_COUNT": 60}),
    Departure("crowding", "galaxies x5", "1,500 galaxies per Mpixel", {"GALAXY_COUNT": 1500}),
    Departure("bright", "large galaxies", "120 per Mpixel of magnitude 14 to 21, three times as large",
              {"GALAXY_COUNT": 120, "GALAXY_MAG": "14,21", "GALAXY_SCALE": 3}),
    Departure("sky", "bowls", "12 hollows a sigma deep, of 25 pixels (sigma)", post=bowls),
    Departure("sky", "amplifiers", "steps of 1 to 2 sigma", post=amplifiers),
    Departure("sky", "cirrus", "light of 5 sigma that varies over 60 pixels", post=clouds(60, 5)),
    Departure("sky", "edge glow", "4 sigma at two edges, of 12 pixels", post=edge_glow),
    Departure("sky", "pupils", "4 rings of radius 25 to 70 pixels, 0.5 to 3 sigma high", post=pupils),
    Departure("defects", "streaks", "8, 3 sigma high", post=streaks),
    Departure("defects", "interpolated", "every 40th column is the mean of its neighbours", edit=interpolated),
    Departure("defects", "chip edges", "a gap of zeros between two chips, half sensitivity along it", edit=chip_edges),
    Departure("size", "cut-outs", "16 tiles of 100 pixels", {"IMAGE_SIZE": 100}, tiles=16),
]


def expose(program, departure, seed, number):
    """The tile, its truth table and the width (sigma, pixels) of its PSF."""
    sim = {"IMAGE_SIZE": SIDE, "PSF_FWHM": FWHM, STARS: 600, "STAR_MAG": "16,23", "GALAXY_COUNT": 200, "SEED": seed, "SCENE_NUMBER": number,
           **departure.sim}
    if departure.psf:
        truth = psf_truth.Truth(departure.psf, FWHM)
        stamp = truth.stamp(512, 512, 63)
        fits.writeto(program.folder / "psf.fits", (stamp / stamp.sum()).astype(np.float32), overwrite=True)
        sim |= {"PSF_TYPE": "FILE", "PSF_NAME": "psf.fits"}
    tile = program.simulate(departure.name, **sim)
    width = fits.getheader(program.folder / "sim.fits").get("RXCFWHM", sim["PSF_FWHM"]) / 2.3548
    tile.header.remove("GAIN", ignore_missing=True)
    tile.header.remove("SATURATE", ignore_missing=True)
    if departure.post is not None:
        y, x = np.indices(tile.pixels.shape).astype(float)
        more = departure.post(x, y, np.random.default_rng(seed + number))
        tile = tile.changed(tile.name, tile.pixels + SIGMA * more)
    if departure.edit is not None:
        y, x = np.indices(tile.pixels.shape).astype(float)
        tile = tile.changed(tile.name, departure.edit(tile.pixels, x, y))
    tile.keywords |= {"NTHREADS": 1, **departure.run}
    return tile, np.array(fits.getdata(program.folder / "truth.fits", 1)), width


def inside(at, side):
    return ((at > EDGE) & (at < side - EDGE)).all(1)


def objects(truth, width, pixels):
    """Places, fluxes, S/N, whether a star, and whether it may be judged: not at a border of the data."""
    side, data = len(pixels), minimum_filter(pixels != 0, 2 * EDGE + 1)
    at = np.column_stack([truth["X_IMAGE"], truth["Y_IMAGE"]]).astype(float)
    flux = truth["FLUX"].astype(float)
    star = np.char.strip(truth["TYPE"].astype(str)) == "STAR" if truth["TYPE"].dtype.kind in "SU" else truth["TYPE"] == 0
    snr = flux / (SIGMA * np.sqrt(4 * np.pi) * np.hypot(width, np.where(star, 0, truth["FLUX_RADIUS"] / 1.1774)))
    tree = cKDTree(at)
    clear = np.array([all(flux[j] < 0.3 * flux[i] for j in tree.query_ball_point(at[i], 2.3548 * width) if j != i)
                      for i in range(len(at))], bool)
    x, y = np.clip(np.rint(at).astype(int) - 1, 0, side - 1).T
    return at, flux, snr, star, clear & inside(at, side) & data[y, x]


def measure(run, known, reach, side):
    """Counts and values of one run, to be pooled."""
    at, flux, snr, star, judged = known
    table = run.table
    marked = (table["FLAGS_RESTORE"] & MARKS) > 0
    untrue = ~near(run.positions, at, reach) & inside(run.positions, side)
    false, bare = untrue & ~marked, untrue & ((table["FLAGS_RESTORE"] & MARKS & ~WORDS) == 0)
    out = {"sources": len(table), "marked": int(marked.sum()), **{k: int(v.sum()) for k, v in (("untrue", untrue), ("false", false), ("bare", bare))}}
    deep = judged & (snr > 10)
    out["found"] = near(at[deep], run.positions, reach).tolist()
    distance, which = (cKDTree(run.positions).query(at, distance_upper_bound=reach) if len(table) else
                       (np.full(len(at), np.inf), np.zeros(len(at), int)))
    fitted = star & judged & np.isfinite(distance)
    which = np.where(fitted, which, 0)
    got, error = (table[c][which] if len(table) else np.zeros(len(at)) for c in ("FLUX_TEMPLATE", "FLUXERR_TEMPLATE"))
    out["due"] = int((star & judged & (snr > 10) & (snr < 100)).sum())
    fitted &= np.isfinite(got) & (error > 0) & (snr > 10) & (snr < 200)
    out["ratio"] = (got / flux - 1)[fitted & (snr > 20)].tolist()
    out["pulls"] = ((got - flux) / np.where(error > 0, error, 1))[fitted & (snr < 100)].tolist()
    return out


def spread(values):
    return 1.4826 * np.median(abs(values - np.median(values)))


def judge(parts, mpixel):
    """Values with their errors, and which are off."""
    pool = {k: sum((p[k] for p in parts), type(parts[0][k])()) for k in parts[0]}
    found, ratio, pulls = (np.array(pool[k]) for k in ("found", "ratio", "pulls"))
    cell = {"sources": pool["sources"], "marked": pool["marked"], "false": pool["false"] / mpixel, "bare": pool["bare"] / mpixel, "untrue": pool["untrue"] / mpixel, "n": len(found), "stars": len(ratio)}
    cell["recall"] = float(found.mean()) if len(found) else None
    cell["bias"] = float(np.median(ratio)) if len(ratio) > 4 else None
    cell["pull"] = float(spread(pulls)) if len(pulls) > 9 else None
    limit = {k: v[0] for k, v in LIMITS.items()}
    most = max(limit["false"] * mpixel, 0.02 * pool["sources"])
    passed = {}  # by errors
    for errors in (0, 2):
        off = {"false": pool["false" if errors else "bare"] > most + errors * np.sqrt(most), "pull": False}
        if cell["recall"] is not None:
            off["recall"] = cell["recall"] < limit["recall"] - errors * np.sqrt(limit["recall"] * (1 - limit["recall"]) / len(found))
        if cell["bias"] is not None:
            off["bias"] = abs(cell["bias"]) > limit["bias"] + errors * 1.2533 * spread(ratio) / np.sqrt(len(ratio))
        if cell["pull"] is not None:
            chance = errors * 1.17 / np.sqrt(len(pulls))
            off["pull"] = cell["pull"] > limit["pull"] * (1 + chance) or cell["pull"] < LOW * (1 - chance)
        off["pull"] |= len(pulls) < 0.5 * pool["due"]  # hardly a flux at all
        passed[errors] = [k for k in LIMITS if off.get(k)]
    return cell | {"beyond": passed[0], "off": passed[2]}


def warnings(runs):
    """What the headers and catalogues of a cell say: of several tiles what half of them do."""
    said = []
    for run in runs:
        cards = run.cards()
        said += [k for k, is_said in SAID.items() if k in cards and is_said(cards[k])]
        if len(run.table) and ((run.table["FLAGS_RESTORE"] & MARKS & ~DONE) > 0).mean() >= 0.5:
            said.append("FLAGS_RESTORE")
    return sorted({k for k in said if 2 * said.count(k) >= len(runs)})


def main(output, seed, names):
    ledger.claim("robustness", output, [seed])
    program, cells, usual = tiles.Program(output), [], {}
    for departure in DEPARTURES:
        if names and departure.name not in names and departure.name != "none":
            continue
        parts, runs, mpixel = {r: [] for r in RESTORERS}, {r: [] for r in RESTORERS}, 0
        for number in range(departure.tiles):
            tile, truth, width = expose(program, departure, seed, number)
            known, reach = objects(truth, width, tile.pixels), max(2.0, 2.3548 * width)
            mpixel += tile.mpixel * (1 - 2 * EDGE / len(tile.pixels)) ** 2 * (tile.pixels != 0).mean()  # that false sources are counted on
            for r, run in program.run(tile).items():
                parts[r].append(measure(run, known, reach, len(tile.pixels)))
                runs[r].append(run)
        for r in RESTORERS:
            cell = {"kind": departure.kind, "departure": departure.name, "what": departure.what, "restorer": r} | judge(parts[r], mpixel)
            cell["said"] = [w for w in warnings(runs[r]) if w not in usual.get(r, ())]
            usual.setdefault(r, cell["said"])
            cell["log"] = sorted({w[:110] for run in runs[r] for w in run.said if "has no effect" not in w and (r + ": " in w or not any(o + ": " in w for o in RESTORERS))})
            cell["silent"] = bool(cell["off"]) and not cell["said"]
            marks = bool("FLAGS_RESTORE" in cell["said"] and cell["untrue"] * mpixel > max(LIMITS["false"][0] * mpixel, 0.02 * cell["sources"]))
            cell["right"] = bool(cell["beyond"]) or marks if cell["said"] else None
            cards = runs[r][0].cards()
            cell["cards"] = {k: cards[k] for k in (*SAID, "RXMODEL", "RXPSFERR", "RXNFACT", "RXCROWD") if k in cards}
            cells.append(cell)
            print({k: v for k, v in cell.items() if k not in ("cards", "what", "kind")}, flush=True)
    silent = [f"{c['departure']}, {c['restorer']}: {' '.join(c['off'])}" for c in cells if c["silent"]]
    cells = [{k: float(f"{v:.5g}") if isinstance(v, float) else v for k, v in c.items()} for c in cells]
    words = [c["right"] for c in cells if c["said"]]
    summary = {"version": program.version(), "seed": seed, "limits": LIMITS, "silent": len(silent), "words": len(words), "right": sum(words),
               "off": sum(bool(c["off"]) for c in cells), "cells": cells}
    (Path(output) / "summary.json").write_text(json.dumps(summary, indent=1) + "\n")
    print(f"{len(silent)} silent failures of {summary['off']} cells off a limit, {len(cells)} in all; {sum(words)} of {len(words)} words are right", *silent, sep="\n  ")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 101, sys.argv[3].split(",") if len(sys.argv) > 3 else [])
