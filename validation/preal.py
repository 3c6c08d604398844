#!/usr/bin/python3
"""Are P_REAL, CLASS_TEMPLATE and P_BLEND probabilities, and do the errors that injections measure hold?

    preal.py FOLDER [SEED[,SEED...] [CELL[,CELL...]]]     seeds: 1,2; cells: all

A cell is DENSITY-FWHM as in crowded.py, with G where a fifth of the objects are galaxies, H where two thirds are, T where none is fainter
than S/N 5, and C where it is a coadd of four resampled frames, whose noise is correlated:
DENSITY objects of S/N 5 to 3000 per Mpixel, N(> S) ~ S^-0.9, and, but for T, the fainter ones of the same law down to S/N 2. Tiles
have 1024 x 1024 pixels, 512 x 512 in crowds, and a sky of 100 photons; the PSF is measured on the tile. REXTRACT, SIMULATE and
RX_MODEL as in crowded.py, RX_PROGRAMS the restorers (NONE,RL,NET), RX_COVERED those whose errors are looked at (NONE), RX_COVERED_CELLS on
which cells (injecting into crowds takes long). FOLDER gets preal.json and preal.md.

A detection is matched where a true object lies within half a FWHM, each object once, brightest detections first, the object
that is nearest in position and magnitude as in crowded.py. It is real where it is matched or where half of its flux and more is, under
its template, that of true objects which no brighter detection has: two faint stars seen as one, a star of S/N 2 to 3 that noise has
moved. It is a star where that is what it is matched to, and two where an object that no detection is matched to, at least half as bright as the one
that it is matched to, lies within one FWHM. Those nearer to the border than one FWHM are left out: the truth holds no stars beyond it. Intervals are Wilson's at 95 %; off:
how far the mean P_REAL lies outside the interval, in bins of 40 and more. Marked: share of the real ones, by true S/N, of P_REAL below 0.5. Errors: 1000 objects are injected, a tenth of the
tile's density at once; share of matched fluxes of P_REAL above 0.5 within the errors named, by measured S/N.
"""
import os
import subprocess
import sys

import numpy as np
from astropy.io import fits
from scipy.spatial import cKDTree

import ledger
from crowded import SKY, ZERO, MODEL, run, unit

CELLS = ["300-2.5G", "300-4G", "300-6G", "2000-4", "2000-4T", "8000-4"]
BINS = (0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 0.98, 1.0001)
SNR_BINS = (0, 5, 7, 10, 15, 20, 50, 1e9)
ADDED = 8  # FLAGS_RESTORE
EDGES = (0, 0.2, 0.4, 0.6, 0.8, 0.9, 1.0001)
PLENTY = 40  # detections of a bin that is judged
COLUMNS = ("XTEMPLATE_IMAGE", "YTEMPLATE_IMAGE", "MAG_TEMPLATE", "FLUX_TEMPLATE", "FLUXERR_TEMPLATE", "SNR_TEMPLATE",
           "EVIDENCE_TEMPLATE", "P_REAL", "CLASS_TEMPLATE", "P_BLEND", "FLAGS_RESTORE")
INJECTED = ("MAGERR_INJECTED", "MAGERR95_INJECTED")
COVERED = os.environ.get("RX_COVERED_CELLS", "300-4G,2000-4,8000-4").split(",")


def checks(name, mode):
    """Arguments."""
    if mode != "INJECTED":
        return ["-BLANK_CHECK", "0"]
    return ["-BLANK_CHECK", "0", "-SELF_CHECK", "Y", "-SELF_CHECK_COUNT", "1000", "-SELF_CHECK_DENSITY",
            str(max(200, kind(name)[0] / 10))]


def kind(name):
    """Per Mpixel, FWHM, share of galaxies, least S/N, side, frames of which it is a coadd."""
    density, rest = name.split("-")
    share = 0.2 * ("G" in rest) + 2 / 3 * ("H" in rest)
    return int(density), float(rest.rstrip("GHTC")), share, 5.0 if "T" in rest else 2.0, 512 if int(density) > 1000 else 1024, 4 if "C" in rest else 1


def make(folder, name, seed):
    density, fwhm, share, faint, side, frames = kind(name)
    density *= (5 / faint)**0.9
    low, high = (f"{ZERO - 2.5 * np.log10(s * unit(fwhm)):.4f}" for s in (3000, faint))
    galaxies = share * density
    run(folder, "SIMULATE", "-IMAGE_SIZE", str(side), "-SEED", str(seed), "-MAG_ZEROPOINT", str(ZERO), "-PSF_FWHM", str(fwhm),
        "-STAR_COUNT", str(density - galaxies), "-STAR_MAG", f"{low},{high}", "-STAR_SLOPE", "0.36",
        "-GALAXY_COUNT", str(galaxies), "-GALAXY_MAG", f"{low},{high}", "-GALAXY_SLOPE", "0.36", "-GAIN", "1", "-READ_NOISE", "0.01",
        "-NOISE_TYPE", "CCD", "-SKY_LEVEL", str(SKY), *(["-COADD_TYPE", "LANCZOS", "-COADD_FRAMES", str(frames)] if frames > 1 else []))


def extract(folder, name, by, mode):
    catalog = f"{by}.{mode}.cat"
    if not os.path.exists(f"{folder}/sim_truth.fits"):
        os.makedirs(folder, exist_ok=True)
        make(folder, name, int(folder.rsplit("-", 1)[1]))
    if not os.path.exists(f"{folder}/{catalog}"):
        with open(f"{folder}/p.param", "w") as file:
            file.write("\n".join(COLUMNS + (INJECTED if mode == "INJECTED" else ())) + "\n")
        run(folder, "REXTRACT", "sim.fits", "-RESTORE_TYPE", by, "-NET_MODEL", MODEL, "-CATALOG_TYPE", "FITS_1.0", "-HEADER_FACTS", "ALL", "-CATALOG_NAME",
            catalog, "-PARAMETERS_NAME", "p.param", "-MAG_ZEROPOINT",
            str(ZERO), "-SATUR_LEVEL", "1e9", *checks(name, mode))
    with fits.open(f"{folder}/{catalog}") as hdus:
        t = {c.name: np.array(hdus[1].data[c.name], float) for c in hdus[1].columns}
    t.update(match(folder, name, t))
    fwhm, side = kind(name)[1], kind(name)[4]
    inside = np.minimum.reduce([t[k] - (0.5 + fwhm) for k in COLUMNS[:2]] + [side + 0.5 - fwhm - t[k] for k in COLUMNS[:2]]) > 0
    return {k: v[inside] for k, v in t.items()}


def gather(folder, cells, seeds, by, mode):
    parts = [extract(f"{folder}/{name}-{seed}", name, by, mode) for name in cells for seed in seeds]
    return {k: np.concatenate([p[k] for p in parts]) for k in parts[0]}


def match(folder, name, t):
    """Of every detection true S/N and flux, NAN where it is not matched, the share of its flux that is true light, whether what it is matched
    to is a star, and the flux of the brightest object that is not matched within one FWHM."""
    fwhm = kind(name)[1]
    with fits.open(f"{folder}/sim_truth.fits") as hdus:
        truth = hdus[1].data
        at, true = np.column_stack([truth["X_IMAGE"], truth["Y_IMAGE"]]), np.array(truth["MAG"], float)
        stars = np.char.strip(np.array(truth["TYPE"], str)) == "STAR"
    xy, mag = np.column_stack([t["XTEMPLATE_IMAGE"], t["YTEMPLATE_IMAGE"]]), np.nan_to_num(t["MAG_TEMPLATE"], nan=40)
    tree, used, flux = cKDTree(at), np.zeros(len(at), bool), np.full(len(mag), np.nan)
    star, second = np.zeros(len(mag), bool), np.zeros(len(mag))
    left, light = 10**(-0.4 * (true - ZERO)), np.zeros(len(mag))  # of every object what no detection has yet
    for k in np.argsort(-np.nan_to_num(t["SNR_TEMPLATE"], nan=-9), kind="stable"):
        if not np.isfinite(xy[k]).all():
            continue
        near = np.array(tree.query_ball_point(xy[k], 1.5 * fwhm), int)
        under = np.exp(-np.log(2) * np.sum((at[near] - xy[k])**2, axis=1) / (0.5 * fwhm)**2 / 2)  # two Gaussian PSFs
        need, total = t["FLUX_TEMPLATE"][k], np.sum(left[near] * under)
        light[k] = total / need if need > 0 else 0
        for j, u in sorted(zip(near, under), key=lambda one: -one[1] * left[one[0]]):
            if need > 0 and u > 0.3:
                taken = min(left[j], need / u)
                left[j] -= taken
                need -= taken * u
        free = [j for j in tree.query_ball_point(xy[k], 0.5 * fwhm) if not used[j]]
        if free:
            j = min(free, key=lambda j: np.sum((at[j] - xy[k])**2) + ((true[j] - mag[k]) / 0.5)**2)
            used[j], flux[k], star[k] = True, 10**(-0.4 * (true[j] - ZERO)), stars[j]
    for k in np.flatnonzero(np.isfinite(flux)):
        second[k] = max((10**(-0.4 * (true[j] - ZERO)) for j in tree.query_ball_point(xy[k], fwhm) if not used[j]), default=0)
    return {"true_snr": flux / unit(fwhm), "true_flux": flux, "light": light, "star": star, "second": second}


def wilson(share, n, z=1.96):
    middle, half = share + z * z / 2 / n, z * np.sqrt(share * (1 - share) / n + z * z / 4 / n**2)
    return (middle - half) / (1 + z * z / n), (middle + half) / (1 + z * z / n)


def reliability(p, real, matched):
    rows = []
    for a, b in zip(EDGES, EDGES[1:]):
        inside = (p >= a) & (p < b)
        n = int(inside.sum())
        if n:
            share = float(real[inside].mean())
            low, high = wilson(share, n)
            rows.append({"n": n, "p": p[inside].mean(), "real": share, "low": low, "high": high, "matched": float(matched[inside].mean())})
    return rows


def shares(p, true, by, edges):
    """Mean probability, share and its interval, in bins of `by`."""
    rows = []
    for a, b in zip(edges, edges[1:]):
        inside = (by >= a) & (by < b)
        n = int(inside.sum())
        if n:
            share = float(true[inside].mean())
            low, high = wilson(share, n)
            rows.append({"from": a, "n": n, "p": float(p[inside].mean()), "true": share, "low": low, "high": high})
    return rows


def posterior(t):
    """P_REAL of listed and of added sources, CLASS_TEMPLATE and P_BLEND of those that are matched, in bins of themselves and of S/N."""
    matched, added = np.isfinite(t["true_snr"]), (t["FLAGS_RESTORE"].astype(int) & ADDED) > 0
    real, known = matched | (t["light"] >= 0.5), np.isfinite(t["P_REAL"])
    two = t["second"] >= 0.5 * np.nan_to_num(t["true_flux"], nan=np.inf)
    cases = (("P_REAL", "listed", real, known & ~added), ("P_REAL", "added", real, known & added),
             ("CLASS_TEMPLATE", "matched", t["star"], matched), ("P_BLEND", "matched", two, matched & np.isfinite(t["P_BLEND"])))
    rows = []
    for column, part, true, use in cases:
        for by, edges in (column, BINS), ("SNR_TEMPLATE", SNR_BINS):
            bins = shares(t[column][use], true[use], t[by][use], edges)
            some = [b for b in bins if b["n"] >= PLENTY]
            rows.append({"column": column, "part": part, "by": by, "bins": bins,
                         "off": max((abs(b["true"] - b["p"]) for b in some), default=0.0),
                         "beyond": max((max(0.0, b["low"] - b["p"], b["p"] - b["high"]) for b in some), default=0.0)})
    return rows


def pulls(t):
    """By true S/N and kind: median and width of (measured - true) / FLUXERR_TEMPLATE, and the median of measured / true - 1."""
    rows = []
    for kinds, which in ("stars", t["star"] > 0), ("galaxies", t["star"] == 0):
        for a, b in ((5, 7), (7, 10), (10, 20), (20, 50)):
            inside = which & (t["true_snr"] >= a) & (t["true_snr"] < b)
            if inside.sum() >= PLENTY / 2:
                pull = ((t["FLUX_TEMPLATE"] - t["true_flux"]) / t["FLUXERR_TEMPLATE"])[inside]
                low, middle, high = np.percentile(pull, (15.87, 50, 84.13))
                rows.append({"kind": kinds, "from": a, "to": b, "n": int(inside.sum()), "pull": middle, "width": (high - low) / 2,
                             "bias": float(np.median((t["FLUX_TEMPLATE"] / t["true_flux"])[inside]) - 1)})
    return rows


def off(bins):
    """How far P_REAL lies outside the intervals, and from the shares, in bins of PLENTY and more between 0.6 and 0.9."""
    some = [b for b in bins if b["n"] >= PLENTY and 0.6 <= b["p"] < 0.9]
    return [max((f(b) for b in some), default=0.0)
            for f in (lambda b: max(0.0, b["low"] - b["p"], b["p"] - b["high"]), lambda b: abs(b["real"] - b["p"]))]


def coverage(t, flux):
    """By measured S/N: share within one FLUXERR_TEMPLATE, and within the two that injections measure, and how many have one."""
    rows = []
    for a, b in ((3, 5), (5, 10), (10, 20), (20, 80), (3, 80)):
        inside = (t["SNR_TEMPLATE"] >= a) & (t["SNR_TEMPLATE"] < b) & np.isfinite(flux) & (t["P_REAL"] >= 0.5)
        off = np.abs(t["FLUX_TEMPLATE"] - flux)[inside]
        relative = [np.nan_to_num(t[c][inside], nan=-1) / 1.0857362 * t["FLUX_TEMPLATE"][inside] for c in INJECTED]
        known = relative[1] > 0
        rows.append({"from": a, "to": b, "n": int(inside.sum()), "known": int(known.sum()),
                     "template": float((off < t["FLUXERR_TEMPLATE"][inside]).mean()) if len(off) else None,
                     **{c: float((off < r)[known].mean()) if known.any() else None for c, r in zip(("68", "95"), relative)}})
    return rows


def group(names):
    """What is pooled."""
    alone = [c for c in names if c.startswith("300") and c.endswith("G")]
    result = {"isolated": alone}
    result.update({c: [c] for c in names if c not in alone})
    return {k: v for k, v in result.items() if v}


def page(result):
    text = ["# P_REAL and errors from injections", "",
            f"`validation/preal.py`, seeds {', '.join(map(str, result['seeds']))}. Isolated: 300 objects of S/N 5 to 3000 per Mpixel at FWHM "
            "2.5, 4 and 6, a fifth galaxies; others DENSITY-FWHM, T: none fainter than S/N 5.", "",
            "## Reliability: mean P_REAL: share that is real, matched (detections)", "",
            "| | | " + " | ".join(f"{a:g} to {min(b, 1):g}" for a, b in zip(EDGES, EDGES[1:])) + " | off between 0.6 and 0.9, outside the intervals |",
            "| --- | --- |" + " --- |" * len(EDGES)]
    for r in result["reliability"]:
        cells = []
        for a, b in zip(EDGES, EDGES[1:]):
            one = [x for x in r["bins"] if a <= x["p"] < b]
            cells.append(f"{one[0]['p']:.2f}: {one[0]['real']:.2f}, {one[0]['matched']:.2f} ({one[0]['n']})" if one else "")
        text.append(f"| {r['cell']} | {r['by']} | " + " | ".join(cells) + f" | {r['off']:.2f}, {r['beyond']:.2f} |")
    text += ["", "## Real detections that are marked, by true S/N, and false ones that are not, per Mpixel", "",
             "| | | S/N 5 to 7 | above 5 | false, all | false, unmarked |", "| --- | --- | --- | --- | --- | --- |"]
    for r in result["reliability"]:
        text.append(f"| {r['cell']} | {r['by']} | {r['marked_5_7']:.4f} | {r['marked_5']:.4f} | {r['false']:.0f} | {r['kept']:.0f} |")
    text += ["", f"## Posteriors: probability: share (sources), by bins of the probability and of S/N; off: largest deviation, outside the intervals, "
             f"of bins of {PLENTY} and more", "", "| | | column | of | off by itself | off by S/N | by itself | by S/N |",
             "| --- | --- | --- | --- | --- | --- | --- | --- |"]
    for r in result["posterior"]:
        for one, other in zip(r["rows"][::2], r["rows"][1::2]):
            cells = [", ".join(f"{b['p']:.2f}: {b['true']:.2f} ({b['n']})" for b in x["bins"]) for x in (one, other)]
            offs = [f"{x['off']:.2f}, {x['beyond']:.2f}" for x in (one, other)]
            text.append(f"| {r['cell']} | {r['by']} | {one['column']} | {one['part']} | {offs[0]} | {offs[1]} | {cells[0]} | {cells[1]} |")
    text += ["", "## Pulls of FLUX_TEMPLATE by true S/N: median, width; bias (sources)", "", "| | | of | S/N 5 to 7 | 7 to 10 | 10 to 20 | 20 to 50 |",
             "| --- | --- | --- |" + " --- |" * 4]
    for r in result["posterior"]:
        for kinds in ("stars", "galaxies"):
            found = {x["from"]: f"{x['pull']:.2f}, {x['width']:.2f}; {x['bias']:.3f} ({x['n']})" for x in r["pulls"] if x["kind"] == kinds}
            if found:
                text.append(f"| {r['cell']} | {r['by']} | {kinds} | " + " | ".join(found.get(a, "") for a in (5, 7, 10, 20)) + " |")
    text += ["", "## Fluxes within one FLUXERR_TEMPLATE; within the 68 % and the 95 % error of injections (matched detections; of these with such an error)",
             "", "| | | S/N 3 to 5 | 5 to 10 | 10 to 20 | 20 to 80 | 3 to 80 |", "| --- | --- |" + " --- |" * 5]
    for r in result["coverage"]:
        text.append(f"| {r['cell']} | {r['by']} | " + " | ".join(
            f"{x['template']:.3f}; {x['68']:.3f} {x['95']:.3f} ({x['n']}; {x['known']})" if x["68"] is not None else f"({x['n']}; 0)"
            for x in r["rows"]) + " |")
    return text


def main():
    folder, seeds = os.path.abspath(sys.argv[1]), [int(s) for s in (sys.argv[2:3] or ["1,2"])[0].split(",")]
    names = sys.argv[3].split(",") if len(sys.argv) > 3 else CELLS
    ledger.claim("preal", folder, seeds)
    result = {"seeds": seeds, "reliability": [], "posterior": [], "coverage": []}
    for title, cells in group(names).items():
        area = sum(kind(name)[4]**2 / 1e6 for name in cells) * len(seeds)
        for by in os.environ.get("RX_PROGRAMS", "NONE,RL,NET").split(","):
            t = gather(folder, cells, seeds, by, "DEFAULT")
            known, snr = np.isfinite(t["P_REAL"]), t["true_snr"]
            matched, marked = np.isfinite(snr), t["P_REAL"] < 0.5
            real = matched | (t["light"] >= 0.5)
            bins = reliability(t["P_REAL"][known], real[known], matched[known])
            beyond, deviation = off(bins)
            result["reliability"].append(
                {"cell": title, "by": by, "bins": bins,
                 "off": deviation, "beyond": beyond,
                 "marked_5_7": float(marked[(snr >= 5) & (snr < 7)].mean()), "marked_5": float(marked[snr >= 5].mean()),
                 "false": float((~real).sum() / area), "kept": float((~real & ~marked).sum() / area)})
            result["posterior"].append({"cell": title, "by": by, "rows": posterior(t), "pulls": pulls(t)})
            print(title, by, flush=True)
    for name in (c for c in COVERED if c in names):
        for by in filter(None, os.environ.get("RX_COVERED", "NONE").split(",")):
            t = gather(folder, [name], seeds, by, "INJECTED")
            result["coverage"].append({"cell": name, "by": by, "rows": coverage(t, t["true_flux"])})
            print(name, by, "INJECTED", flush=True)
    ledger.store(folder, "preal", page(result), result)


if __name__ == "__main__":
    try:
        main()
    except (OSError, KeyError, subprocess.CalledProcessError) as problem:
        raise SystemExit(f"preal.py: {problem}") from problem
