#!/usr/bin/python3
"""Crowded fields, close pairs and stars put into real clusters: template photometry, beside IRAF's ALLSTAR.

    crowded.py cells FOLDER [SEED [CELL[,CELL...]]]    simulated tiles (seed 201, all cells)
    crowded.py pairs FOLDER [SEED]                     two stars half to one FWHM apart
    crowded.py real DATA FOLDER                        stars put into M13, M67, the SDSS frame
    crowded.py coadd DATA FOLDER                       the whole SDSS frame against its deep coadd
    crowded.py large FOLDER                            100,000 stars on 4096 x 4096 pixels: seconds and memory
    crowded.py page FOLDER [SEED]                      FOLDER/crowded.md and summary.json of what is there

What lies in FOLDER is not made again; ours and ALLSTAR's rows can be made apart: RX_PROGRAMS says who takes part
(NONE,NET,ALLSTAR). REXTRACT and SIMULATE name the programs (default: rextract and rextract-simulate in build/), RX_MODEL the
network's model (config/psfnet.fits), RX_ARGUMENTS further arguments of rextract, RX_THREADS the threads (2). Where IRAF is
not installed the page says so.

What the columns mean

A cell is DENSITY-FWHM with V where the PSF varies (FWHM 15 % larger in the corners) and G where a fifth of the objects are galaxies:
500, 2000, 8000, 20000 objects per Mpixel on tiles of 724, 724, 512 and 320 pixels (262 to 2,097 objects), FWHM 2.5, 4, 6
pixels. The sky is 100 photons, S/N 5 to 3000 with N(> S) ~ S^-0.9, S/N that of an isolated point on the sky's noise; Moffat of beta
4.765. Both measure the PSF on the tile. In the order of S/N (SNR_TEMPLATE, 1 / MERR) each detection takes the
true object within half a FWHM that is nearest in position (pixels) and magnitude (halves of one), each object once. Ours are those
without FLAGS_RESTORE 1 and 2. "At 0.95": recall where precision falls below 0.95; in parentheses where the list ends before. AP:
area under precision over recall. Then, by true S/N, of matched objects the median (bias) and scatter (1.4826 times the median
deviation) of measured - true magnitude and the width of that over its error (pull). ALLSTAR's magnitudes are those of an aperture:
they are shifted by the median of stars above S/N 200, which takes any constant off its bias and off no other's: ours are as they are. chi2: mean over pixels of residual^2 / true variance.

ALLSTAR is run in two passes as its guide says (validation/allstar.py). For it were chosen, on seed 101, 8000-4, by recall at 0.95:
the PSF's stars from a list of S/N 10 (of the deep list none is taken) and the PSF made anew twice (0.61 without, 0.68 with; before, with
a PSF of chi2 84, 0.53); the sky of each star not fitted (0.68 where it is, 0.78 where not), from an annulus of 2 FWHM and 16 pixels;
profile and flat errors of 1 and 0.1 %, nearer to its scatter than 5 and 0.75 %; thresholds of S/N 4 (at 3.5 and 5 the same; in sigmas
of its filter 1.0: at 2 to 3 sigmas, with a wider filter, 0.63) but 6 at 500 per Mpixel (0.795; at 8 0.70; at 4 it takes long and ranks
noise); on 8000-4V a PSF that varies linearly, from 30 stars (0.73; quadratically 0.69, from 100 stars 0.65). Its lists go on into
the noise, so that recall and AP are the better for it and precision at their end is low.
"""
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from astropy.io import fits
from astropy.wcs import WCS
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree

import allstar
import ledger
import psf_truth

TOP = Path(__file__).resolve().parent.parent
MODEL = os.path.abspath(os.environ.get("RX_MODEL", TOP / "config/psfnet.fits"))
SKY, ZERO = 100.0, 25.0
SIDES = {500: 724, 2000: 724, 8000: 512, 20000: 320}
CELLS = [f"{d}-{f}" for f in ("4", "2.5", "6", "4G", "4V") for d in (8000, 2000, 20000, 500)]
ALLSTAR_ORDER = 1  # of the variation of its PSF
BINS = (5, 10, 20, 50, 200, 3001)
COADD_RADIUS, COADD_BINS = 2.5, (16, 18, 20, 21, 22, 23)  # 1 arcsec; of r
COLUMNS = ("NUMBER", "XTEMPLATE_IMAGE", "YTEMPLATE_IMAGE", "MAG_TEMPLATE", "MAGERR_TEMPLATE", "SNR_TEMPLATE", "CHI2_TEMPLATE",
           "CLASS_TEMPLATE", "FLAGS_RESTORE")
PROGRAMS = os.environ.get("RX_PROGRAMS", "NONE,NET,ALLSTAR").split(",")
APART, RATIOS = (0.5, 0.625, 0.75, 0.875, 1.0), (1.0, 0.5, 0.2)  # pairs: FWHM, fainter over brighter
PAIR_BINS = (20, 50, 200, 501)


# --- programs

def run(folder, name, *arguments):
    """User seconds and wall seconds."""
    program = os.path.abspath(os.environ.get(name, TOP / "build" / ("rextract" if name == "REXTRACT" else "rextract-simulate")))
    begin, before = time.time(), resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    with open(f"{folder}/log", "a") as log:
        subprocess.run([program, *map(str, arguments), "-NTHREADS", os.environ.get("RX_THREADS", "2")], cwd=folder, check=True,
                       stdout=log, stderr=log)
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before, time.time() - begin


def extract(folder, image, restorer, name, *arguments):
    (Path(folder) / "c.param").write_text("\n".join(COLUMNS) + "\n")
    return run(folder, "REXTRACT", image, "-RESTORE_TYPE", restorer, "-NET_MODEL", MODEL, "-CATALOG_TYPE", "FITS_1.0", "-HEADER_FACTS", "ALL",
               "-CATALOG_NAME", f"{name}.cat", "-PARAMETERS_NAME", "c.param", "-MAG_ZEROPOINT", ZERO, "-BLANK_CHECK", "0", "-SATUR_LEVEL", "1e9", "-CHECKIMAGE_TYPE",
               "TEMPLATE_RESIDUAL", "-CHECKIMAGE_NAME", f"{name}.res.fits", *arguments,
               *os.environ.get("RX_ARGUMENTS", "").split())


def table(name):
    with fits.open(name) as hdus:
        return {c.name: np.array(hdus[1].data[c.name], float) for c in hdus[1].columns if "A" not in c.format}


def image(name):
    return fits.getdata(name).astype(float)


def keep(name, value):
    Path(name).write_text(json.dumps(value, indent=1, default=float) + "\n")  # numpy's numbers are none of json's


# --- cells

def cell(name):
    density, rest = name.split("-")
    return int(density), float(rest.rstrip("VG")), "V" in rest, "G" in rest


def unit(fwhm):
    """Flux of S/N 1."""
    return np.sqrt(SKY * 4 * np.pi) * fwhm / 2.3548


def make(folder, name, seed):
    density, fwhm, varying, mixed = cell(name)
    limits = ",".join(f"{ZERO - 2.5 * np.log10(s * unit(fwhm)):.4f}" for s in (3000, 5))
    galaxies = 0.2 * density * mixed
    common = ["-IMAGE_SIZE", SIDES[density], "-SEED", seed, "-MAG_ZEROPOINT", ZERO, "-PSF_FWHM", fwhm, "-PSF_VARIATION", 0.15 * varying,
              "-STAR_COUNT", density - galaxies, "-STAR_MAG", limits, "-STAR_SLOPE", "0.36", "-GALAXY_COUNT", galaxies, "-GALAXY_MAG",
              limits, "-GALAXY_SLOPE", "0.36", "-GAIN", "1", "-READ_NOISE", "0.01"]
    run(folder, "SIMULATE", *common, "-NOISE_TYPE", "NONE", "-SKY_LEVEL", "0", "-IMAGE_NAME", "clean.fits", "-TRUTH_NAME", "")
    run(folder, "SIMULATE", *common, "-NOISE_TYPE", "CCD", "-SKY_LEVEL", SKY)


def measured(folder, name, by):
    """x, y, magnitude, its error, rank; residual image; seconds."""
    if by == "ALLSTAR":
        density, fwhm, varying, _ = cell(name)
        rows, left, seconds = allstar.run(f"{folder}/iraf", fits.getdata(f"{folder}/sim.fits"), fwhm, ALLSTAR_ORDER * varying, SKY**0.5,
                                          faint=6 if density == 500 else 4)
        fits.writeto(f"{folder}/ALLSTAR.res.fits", left, overwrite=True)
        return np.vstack([rows, 1 / rows[3]]), left - np.median(left), seconds
    _, seconds = extract(folder, "sim.fits", by, by)
    t = table(f"{folder}/{by}.cat")
    fine = (t["FLAGS_RESTORE"].astype(int) & 3) == 0
    return np.array([t[c][fine] for c in COLUMNS[1:6]]), image(f"{folder}/{by}.res.fits"), seconds


def width(values):
    return 1.4826 * np.median(np.abs(values - np.median(values)))


def judge(folder, name, by):
    """A row of the tables: how the list and its magnitudes compare with the truth."""
    (x, y, mag, err, rank), residual, seconds = measured(folder, name, by)
    fwhm, t = cell(name)[1], table(f"{folder}/sim_truth.fits")
    at, true = np.column_stack([t["X_IMAGE"], t["Y_IMAGE"]]), t["MAG"]
    snr = 10**(-0.4 * (true - ZERO)) / unit(fwhm)
    good = np.isfinite(mag + rank + err)
    x, y, mag, err, rank = (v[good][np.argsort(-rank[good], kind="stable")] for v in (x, y, mag, err, rank))
    tree, used, of = cKDTree(at), np.zeros(len(at), bool), np.full(len(x), -1)
    if by == "ALLSTAR":
        d, i = tree.query(np.column_stack([x, y]))
        bright = (snr[i] > 200) & (d < 0.25 * fwhm)
        mag = mag - np.median(mag[bright] - true[i[bright]])
    for k, candidates in enumerate(tree.query_ball_point(np.column_stack([x, y]), 0.5 * fwhm)):
        free = [j for j in candidates if not used[j]]
        if free:
            of[k] = min(free, key=lambda j: np.sum((at[j] - (x[k], y[k]))**2) + ((true[j] - mag[k]) / 0.5)**2)
            used[of[k]] = True
    right = of >= 0
    hits = np.cumsum(right)
    precision = hits / np.arange(1, len(right) + 1)
    row = {"objects": len(at), "at95": np.max(np.where(precision >= 0.95, hits, 0)) / len(at), "ap": np.sum(precision * right) / len(at),
           "recall": right.sum() / len(at), "precision": right.mean(), "bins": [],
           "chi2": np.mean(residual**2 / (image(f"{folder}/clean.fits") + SKY)), "seconds": round(seconds, 1)}
    for low, high in zip(BINS, BINS[1:]):
        here = right & (snr[of] >= low) & (snr[of] < high)
        d, s = mag[here] - true[of[here]], err[here]
        row["bins"].append({"low": low, "high": high, "complete": used[(snr >= low) & (snr < high)].mean(), "n": len(d)} | (
            {"bias": np.median(d), "scatter": width(d), "pull": width(d / s)} if len(d) >= 5 else {}))
    return row


def cells(out, seed="201", names=",".join(CELLS)):
    programs = [p for p in PROGRAMS if p != "ALLSTAR" or allstar.here()]
    ledger.claim("crowded cells", out, [seed])
    for name in names.split(","):
        folder = os.path.abspath(f"{out}/{name}-{seed}")
        os.makedirs(folder, exist_ok=True)
        if not os.path.exists(f"{folder}/sim_truth.fits"):
            make(folder, name, seed)
        for by in programs:
            if not os.path.exists(f"{folder}/{by}.json"):
                keep(f"{folder}/{by}.json", judge(folder, name, by))
            print(name, by, brief(json.loads(Path(f"{folder}/{by}.json").read_text())), flush=True)


def brief(row):
    return " | ".join([f"{row['at95']:.3f} | {row['ap']:.3f} | {row['recall']:.3f} {row['precision']:.3f}"] +
                      [f"{b['bias']:+.3f} {b['scatter']:.3f} {b['pull']:.2f}" if "bias" in b else "" for b in row["bins"]] +
                      [f"{row['chi2']:.3f} | {row['seconds']:.0f}"])


# --- pairs

def pair_tile(folder, seed, apart, side=1400, fwhm=4.0, step=42):
    """Single stars and, in every third place, pairs; S/N of the brighter 20 to 500, even in its logarithm."""
    rng = np.random.default_rng([int(seed), int(1000 * apart)])
    grid = np.arange(step, side - step / 2, step)
    x, y = (v.ravel() + rng.uniform(-4, 4, v.size) for v in np.meshgrid(grid, grid))
    snr, ratio = 20 * 25**rng.random(len(x)), rng.choice(RATIOS, len(x))
    pair, angle = np.arange(len(x)) % 3 == 0, rng.uniform(0, 2 * np.pi, len(x))
    x2, y2 = x + apart * fwhm * np.cos(angle), y + apart * fwhm * np.sin(angle)
    truth = psf_truth.Truth("MOFFAT 4.765", fwhm, side=side)
    light = psf_truth.draw(truth, np.r_[x, x2[pair]], np.r_[y, y2[pair]], unit(fwhm) * np.r_[snr, (snr * ratio)[pair]])
    fits.writeto(f"{folder}/pairs.fits", rng.poisson(light + SKY).astype(np.float32), fits.Header([("GAIN", 1.0)]), overwrite=True)
    return x + 1, y + 1, x2 + 1, y2 + 1, snr, ratio, pair


def pairs(out, seed="201"):
    """Of each pair: resolved, magnitudes of both against the truth; of each unresolved pair and single star: chi2, class."""
    ledger.claim("crowded pairs", out, [seed])
    os.makedirs(out, exist_ok=True)
    fwhm, rows = 4.0, {}
    for way, restorer, arguments in (("NONE", "NONE", ()), ("RL", "RL", ()), ("NET", "NET", ()),
                                     ("NET, CROWDING Y", "NET", ("-CROWDING", "Y")), ("NET, one fit", "NET", ("-CROWDING", "N", "-TEMPLATE_PASSES", "1"))):
        every = []
        for apart in APART:
            x, y, x2, y2, snr, ratio, pair = pair_tile(out, seed, apart)
            extract(out, "pairs.fits", restorer, "pairs", *arguments)
            t = table(f"{out}/pairs.cat")
            t = {c: v[np.isfinite(t["MAG_TEMPLATE"]) & ((t["FLAGS_RESTORE"].astype(int) & 3) == 0)] for c, v in t.items()}
            at = np.column_stack([t["XTEMPLATE_IMAGE"], t["YTEMPLATE_IMAGE"]])
            middle = np.column_stack([np.where(pair, (x + x2) / 2, x), np.where(pair, (y + y2) / 2, y)])
            for k, near in enumerate(cKDTree(at).query_ball_point(middle, 1.25 * fwhm)):
                d = np.hypot(*(at[near].T[:, :, None] - np.array([[x[k], x2[k]], [y[k], y2[k]]])[:, None]))  # by source, star
                first = int(np.argmin(d[:, 0])) if near else -1
                second = int(np.argmin(d[:, 1])) if near else -1
                split = bool(near) and pair[k] and first != second and d[first, 0] < 0.3 * fwhm and d[second, 1] < 0.3 * fwhm
                row = {"apart": apart if pair[k] else 0, "snr": snr[k], "ratio": ratio[k], "sources": len(near), "resolved": split}
                if split:
                    row["error"] = t["MAG_TEMPLATE"][near[second]] - t["MAG_TEMPLATE"][near[first]] + 2.5 * np.log10(ratio[k])
                elif near:
                    best = near[int(np.argmax(t["SNR_TEMPLATE"][near]))]
                    row |= {"chi2": t["CHI2_TEMPLATE"][best], "class": t["CLASS_TEMPLATE"][best]}
                every.append(row)
        rows[way] = pair_rows(every)
        print(way, flush=True)
        keep(f"{out}/pairs.json", rows)


def pair_rows(every):
    """By S/N of the brighter, ratio, distance. Marked: chi2 above that of 95 % of the single stars of this S/N, or no point."""
    rows = []
    for low, high in zip(PAIR_BINS, PAIR_BINS[1:]):
        bright = [r for r in every if low <= r["snr"] < high]
        single = [r for r in bright if not r["apart"] and "chi2" in r]
        limit = np.quantile([r["chi2"] for r in single], 0.95)
        rows.append({"low": low, "high": high, "ratio": None, "apart": 0, "n": sum(not r["apart"] for r in bright),
                     "resolved": float(np.mean([r["sources"] > 1 for r in bright if not r["apart"]])), "limit": limit,
                     "marked": float(np.mean([r["chi2"] > limit or r["class"] < 0.5 for r in single]))})
        for ratio in RATIOS:
            for apart in APART:
                these = [r for r in bright if r["ratio"] == ratio and r["apart"] == apart]
                errors = np.array([r["error"] for r in these if r["resolved"]])
                left = [r["chi2"] > limit or r["class"] < 0.5 for r in these if "chi2" in r]
                rows.append({"low": low, "high": high, "ratio": ratio, "apart": apart, "n": len(these),
                             "resolved": float(np.mean([r["resolved"] for r in these])),
                             "error": float(np.median(np.abs(errors))) if len(errors) > 4 else None,
                             "marked": float(np.mean(left)) if left else None, "left": len(left)})
    return rows


# --- stars put into real tiles

def real_tiles(data, out):
    """Name, image, arguments, zero-based centre; the SDSS cut is where the frame has most of the coadd's sources."""
    data = Path(data).resolve()
    frame, reference = f"{out}/frame.fits", f"{out}/reference.fits"
    with open(frame, "wb") as file:
        subprocess.run(["bunzip2", "-c", data / "sdss/94-1-12/frame-r-000094-1-0012.fits.bz2"], stdout=file, check=True)
    gain = subprocess.run([sys.executable, TOP / "validation/sdss/reference.py", data / "sdss/94-1-12/stripe82_coadd_catalog.fit",
                           frame, "4.71", reference], check=True, capture_output=True, text=True).stdout.strip()
    pixels, header = fits.getdata(frame), fits.getheader(frame)
    stars = np.column_stack(WCS(header).all_world2pix(*(fits.getdata(reference, 1)[c] for c in ("RA", "DEC")), 0))
    side = 512
    corner = max(((x, y) for y in range(0, pixels.shape[0] - side + 1, 64) for x in range(0, pixels.shape[1] - side + 1, 64)),
                 key=lambda c: np.sum(np.all((stars >= c) & (stars < np.add(c, side)), axis=1)))
    cut = tuple(slice(c, c + side) for c in corner[::-1])
    fits.writeto(f"{out}/cut.fits", pixels[cut], overwrite=True)
    sdss = ("-GAIN", gain)
    return [("M13", data / "fields/M13_blue_0001.fits", ("-PSF_TYPE", "MOFFAT", "-PSF_FWHM", "14")),
            ("M67", data / "fields/M6707HH.fits", ("-PSF_TYPE", "MOFFAT", "-PSF_FWHM", "4.6")), ("SDSS cut", f"{out}/cut.fits", sdss)], (frame, reference, sdss)


def centre(found, shape):
    """Where sources are densest."""
    fine = np.isfinite(found["XTEMPLATE_IMAGE"])
    count, _, _ = np.histogram2d(found["YTEMPLATE_IMAGE"][fine], found["XTEMPLATE_IMAGE"][fine], [np.arange(n + 1) for n in shape])
    y, x = np.unravel_index(np.argmax(gaussian_filter(count, min(shape) / 10)), shape)
    return x, y


def real(data, out, rounds="2"):
    """Completeness, bias and pull of stars put into each tile, by distance from its centre."""
    os.makedirs(out, exist_ok=True)
    out = os.path.abspath(out)
    found, _ = real_tiles(data, out)
    rows = []
    for name, path, arguments in found:
        for by, more in (("NONE", ()), ("NET", ()), ("NET, CROWDING N", ("-CROWDING", "N"))):
            extract(out, path, by[:4].rstrip(","), "before", *arguments, *more)
            header, before = fits.getheader(f"{out}/before.cat", 1), table(f"{out}/before.cat")
            sigma, fwhm = header["RXSIGMA"], header["RXTPFWHM"]
            noise = sigma * np.sqrt(4 * np.pi) * fwhm / 2.3548 * header["RXNFACT"]  # of a star's flux
            if by == "NONE":
                rest = before, noise, fwhm
                middle = centre(before, image(path).shape)
                picture(f"{out}/{name.replace(' ', '-')}.png", image(path), [f"{out}/before.res.fits"], middle, sigma)
            before, noise, fwhm = rest  # the same stars for all
            every = [inject(out, path, by[:4].rstrip(","), arguments, more, before, noise, fwhm, seed)
                     for seed in range(201, 201 + int(rounds))]
            rows += [{"tile": name, "by": by, "sources": header["NAXIS2"], "crowded": header["RXCROWD"], "chi2": header["RXTPCHI2"],
                      "fwhm": fwhm} | r for r in rings(np.hstack(every), middle)]
            print(json.dumps(rows[-4:], default=float), flush=True)
    keep(f"{out}/real.json", {"rings": rows})


def coadd(data, out):
    """The whole SDSS frame with CROWDING AUTO and N, against the deep coadd: what is found, what is not there, magnitudes."""
    os.makedirs(out, exist_ok=True)
    out = os.path.abspath(out)
    frame, reference, sdss = real_tiles(data, out)[1]
    known = fits.getdata(reference, 1)
    places = cKDTree(np.column_stack(WCS(fits.getheader(frame)).all_world2pix(known["RA"], known["DEC"], 1)))
    rows = []
    for by in os.environ.get("RX_PROGRAMS", "NONE,NET").split(","):
        for crowding in ("AUTO", "N"):
            extract(out, "frame.fits[0]", by, "frame", *sdss, "-CROWDING", crowding, "-MAG_ZEROPOINT", "22.5")
            header, t = fits.getheader(f"{out}/frame.cat", 1), table(f"{out}/frame.cat")
            fine = np.isfinite(t["MAG_TEMPLATE"] + t["XTEMPLATE_IMAGE"]) & ((t["FLAGS_RESTORE"].astype(int) & 3) == 0)
            at, mag = np.column_stack([t["XTEMPLATE_IMAGE"], t["YTEMPLATE_IMAGE"]])[fine], t["MAG_TEMPLATE"][fine]
            far, index = places.query(at, distance_upper_bound=COADD_RADIUS)
            back = cKDTree(at).query(places.data)[1]  # each takes the other
            one = np.isfinite(far) & (back[np.minimum(index, len(known) - 1)] == np.arange(len(at)))
            judged = ~one | np.isfinite(known["MAG"][np.where(one, index, 0)])  # what is saturated in the coadd does not count
            true = np.where(one, known["MAG"][np.where(one, index, 0)], np.nan)
            bins = []
            for low, high in zip(COADD_BINS, COADD_BINS[1:]):
                d = (mag - true)[(true >= low) & (true < high)]
                bins.append({"low": low, "high": high, "n": len(d), "bias": float(np.median(d)), "scatter": width(d)})
            rows.append({"by": by, "crowding": crowding, "crowded": header.get("RXCROWD", 0.0), "fits": header["RXTPPASS"], "sources": int(judged.sum()),
                         "matched": int(np.isfinite(true).sum()), "false": float(np.mean(~one[judged])),
                         "false_bright": float(np.mean(~one[judged & (mag < 22)])), "bins": bins})
            print(json.dumps(rows[-1], default=float), flush=True)
            keep(f"{out}/coadd.json", rows)


def inject(out, path, restorer, arguments, more, before, noise, fwhm, seed):
    """True x, y, S/N of each star that was put in, whether it is found (within half a FWHM and 0.75 mag), magnitude error and pull."""
    (Path(out) / "inject.sex").write_text("".join(f"{k[1:]} {v}\n" for k, v in zip(arguments[::2], arguments[1::2])))
    limits = ",".join(f"{ZERO - 2.5 * np.log10(s * noise):.4f}" for s in (500, 10))
    psf = arguments if "-PSF_TYPE" in arguments else ("-PSF_TYPE", "AUTO")
    run(out, "SIMULATE", "-INJECT_IMAGE", path, "-INJECT_CONFIG", "inject.sex", *psf, "-SEED", seed, "-MAG_ZEROPOINT", ZERO, "-STAR_COUNT",
        "300", "-STAR_MAG", limits, "-STAR_SLOPE", "0.2", "-GALAXY_COUNT", "0", "-IMAGE_NAME", "with.fits", "-TRUTH_NAME", "with_truth.fits")
    extract(out, "with.fits", restorer, "with", *arguments, *more)
    t, truth = table(f"{out}/with.cat"), table(f"{out}/with_truth.fits")
    fine = np.isfinite(t["MAG_TEMPLATE"] + t["XTEMPLATE_IMAGE"]) & ((t["FLAGS_RESTORE"].astype(int) & 3) == 0)
    known = np.isfinite(before["MAG_TEMPLATE"] + before["XTEMPLATE_IMAGE"])
    x, y, mag = truth["X_IMAGE"], truth["Y_IMAGE"], truth["MAG"]

    def nearest(c, use):
        at = np.column_stack([c["XTEMPLATE_IMAGE"][use], c["YTEMPLATE_IMAGE"][use]])
        for k, near in enumerate(cKDTree(at).query_ball_point(np.column_stack([x, y]), 0.5 * fwhm)):
            d = c["MAG_TEMPLATE"][use][near] - mag[k]
            yield (int(np.argmin(np.abs(d))), near, d) if near and np.abs(d).min() < 0.75 else None

    there = np.array([n is not None for n in nearest(before, known)])  # such a source was there before
    rows = []
    for k, n in enumerate(nearest(t, fine)):
        if not there[k]:
            d = n[2][n[0]] if n else np.nan
            rows.append((x[k] - 1, y[k] - 1, 10**(-0.4 * (mag[k] - ZERO)) / noise, n is not None, d,
                         d / t["MAGERR_TEMPLATE"][fine][n[1][n[0]]] if n else np.nan))
    return np.array(rows).T


def rings(stars, middle):
    """Quarters of the stars by distance from the centre."""
    x, y, snr, found, d, pull = stars
    r = np.hypot(x - middle[0], y - middle[1])
    edges = np.quantile(r, (0, 0.25, 0.5, 0.75, 1))
    for low, high in zip(edges, edges[1:]):
        here = (r >= low) & (r <= high)
        row = {"from": low, "to": high, "n": int(here.sum())}
        for a, b in ((10, 30), (30, 100), (100, 501)):
            these = here & (snr >= a) & (snr < b)
            got = these & (found > 0)
            row[f"{a}"] = {"n": int(these.sum()), "complete": found[these].mean() if these.any() else None} | (
                {"bias": np.median(d[got]), "scatter": width(d[got]), "pull": width(pull[got])} if got.sum() > 4 else {})
        yield row


def picture(path, pixels, residuals, middle, sigma, side=200):
    """The tile around this place (asinh of its light in 3 sigma), then what is left (-5 to 5 sigma)."""
    try:
        from PIL import Image
    except ImportError:
        return
    x, y = (int(np.clip(m - side / 2, 0, n - side)) for m, n in zip(middle, pixels.shape[::-1]))
    box = (slice(y, y + side), slice(x, x + side))
    light = np.arcsinh((pixels[box] - np.nanpercentile(pixels[box], 5)) / (3 * sigma))
    panels = [light / np.nanmax(light)] + [(image(r)[box] - np.nanmedian(image(r))) / (10 * sigma) + 0.5 for r in residuals]
    wide = np.hstack([np.pad(np.kron(np.clip(np.nan_to_num(p[::-1]), 0, 1), np.ones((2, 2))), 2, constant_values=1) for p in panels])
    Image.fromarray((255 * wide).astype(np.uint8)).save(path)


# --- 100,000 stars

def large(out, seed="201", restorer="NONE"):
    ledger.claim("crowded large", out, [seed])
    os.makedirs(out, exist_ok=True)
    low, high = (f"{ZERO - 2.5 * np.log10(s * unit(4.0)):.4f}" for s in (3000, 5))
    if not os.path.exists(f"{out}/sim.fits"):
        run(out, "SIMULATE", "-IMAGE_SIZE", "4096", "-SEED", seed, "-MAG_ZEROPOINT", ZERO, "-PSF_FWHM", "4", "-STAR_COUNT", 1e5 / 16.777216,
            "-STAR_MAG", f"{low},{high}", "-STAR_SLOPE", "0.36", "-GALAXY_COUNT", "0", "-GAIN", "1", "-READ_NOISE", "0.01", "-NOISE_TYPE",
            "CCD", "-SKY_LEVEL", SKY)
    user, wall = extract(out, "sim.fits", restorer, "large")
    t = table(f"{out}/large.cat")
    keep(f"{out}/large.json", {"restorer": restorer, "cpu": round(user, 1), "seconds": round(wall, 1), "sources": len(t["NUMBER"]),
                               "gigabytes": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 2**20,
                               "loop": {k: fits.getheader(f"{out}/large.cat", 1).get(k) for k in ("RXTPPASS", "RXCROWD", "RXTPCHI2")}})
    print(Path(f"{out}/large.json").read_text())


# --- the page

def show(value, form="{:.3f}"):
    return "" if value is None else form.format(value)


def columns(head, rows):
    return ["| " + " | ".join(r) + " |" for r in [head, ["---"] * len(head)] + rows] + [""]


def goals(rows):
    """Of each goal how many cells hold it, by restorer."""
    def middle(row):
        return [b for b in row["bins"] if 20 <= b["low"] < 200 and "bias" in b]

    def peers(key, peer, ours):
        return peer and (all(a["scatter"] < b["scatter"] for a, b in zip(middle(ours), middle(peer))) if key == "scatter"
                         else ours[key] > peer[key])
    tests = {
        "recall at precision 0.95 above ALLSTAR's": lambda o, p: peers("at95", p, o),
        "AP above ALLSTAR's": lambda o, p: peers("ap", p, o),
        "bias within 0.01 mag at S/N 20 to 200": lambda o, p: all(abs(b["bias"]) < 0.01 for b in middle(o)),
        "scatter below ALLSTAR's there": lambda o, p: peers("scatter", p, o),
        "pull 0.9 to 1.1 there": lambda o, p: all(0.9 <= b["pull"] <= 1.1 for b in middle(o)),
        "chi2 0.95 to 1.05": lambda o, p: 0.95 <= o["chi2"] <= 1.05}
    made = {}
    for goal, test in tests.items():
        for by in ("NONE", "NET"):
            judged = {n: test(r[by], r.get("ALLSTAR")) for n, r in rows.items() if by in r}
            judged = {n: bool(v) for n, v in judged.items() if v is not None}
            made.setdefault(goal, {})[by] = {"held": sum(judged.values()), "of": len(judged), "not": [n for n in judged if not judged[n]]}
    return made


def cells_page(rows, seed, peer):
    """One line a cell, NONE / NET / ALLSTAR in each column."""
    programs = ("NONE", "NET", "ALLSTAR")

    def three(row, get, form="{:.3f}"):
        return " / ".join(show(get(row[by]) if by in row else None, form) or "-" for by in programs)

    def at95(row):
        return " / ".join("-" if by not in row else f"({row[by]['at95']:.3f})" if row[by]["precision"] >= 0.95 else f"{row[by]['at95']:.3f}"
                          for by in programs)
    text = [f"## Cells, seed {seed}: NONE / NET / ALLSTAR", ""]
    if peer != seed:
        text += [f"ALLSTAR's rows are of tiles of seed {peer}, drawn in the same way: other stars.", ""]
    made = goals(rows)
    text += columns(["goal", "NONE", "NET", "not held (NET)"],
                    [[g] + [f"{v[by]['held']} of {v[by]['of']}" for by in ("NONE", "NET")] + [" ".join(v["NET"]["not"])] for g, v in made.items()])
    text += columns(["cell", "at 0.95", "AP", "recall", "precision", "chi2", "s"],
                    [[n, at95(r)] + [three(r, lambda v, k=k: v[k]) for k in ("ap", "recall", "precision", "chi2")] +
                     [three(r, lambda v: v["seconds"], "{:.0f}")] for n, r in rows.items()])
    for k, (low, high) in enumerate(zip(BINS, BINS[1:])):
        text += [f"S/N {low} to {high - high % 10}", ""]
        text += columns(["cell", "complete", "bias [mag]", "scatter [mag]", "pull"],
                        [[n] + [three(r, lambda v, q=q: v["bins"][k].get(q) if np.isfinite(v["bins"][k]["complete"] or np.nan) else None, f)
                                for q, f in (("complete", "{:.3f}"), ("bias", "{:+.3f}"), ("scatter", "{:.3f}"), ("pull", "{:.2f}"))]
                         for n, r in rows.items()])
    return text


def pairs_page(rows):
    text = ["## Pairs", "", "FWHM 4 pixels, S/N of the brighter star, 341 pairs a distance among 683 single stars. Resolved: both stars have their own source "
            "within 0.3 FWHM. Error: median of |magnitude difference - true|. Marked: of what is not resolved, the share whose CHI2_TEMPLATE is above that of 95 % of the "
            "single stars of this S/N, or whose CLASS_TEMPLATE is below 0.5. In the line of single stars: found as two or more, and marked.", ""]
    head = ["", "S/N", "ratio"] + [f"{a:g} FWHM" for a in APART]
    lines = []
    for way, found in rows.items():
        for low, high in zip(PAIR_BINS, PAIR_BINS[1:]):
            for ratio in RATIOS:
                these = {r["apart"]: r for r in found if r["low"] == low and r["ratio"] == ratio}
                lines.append([way, f"{low}-{high - high % 10}", f"{ratio:g}"] + [f"{these[a]['resolved']:.2f}, {show(these[a]['error'], '{:.2f}') or '-'}, "
                             f"{show(these[a]['marked'], '{:.2f}') or '-'}" for a in APART])
            one = next(r for r in found if r["low"] == low and r["ratio"] is None)
            lines.append([way, f"{low}-{high - high % 10}", "single", f"{one['resolved']:.2f}, {one['marked']:.2f}"] + [""] * (len(APART) - 1))
    return text + ["Each cell: resolved, error of the ratio [mag], marked of the rest.", ""] + columns(head, lines)


def real_page(found):
    text = ["## Stars put into real tiles", "", "300 stars per Mpixel and round of S/N 10 to 500 (rextract-simulate INJECT_IMAGE) with the PSF that PSF_TYPE AUTO measures "
            "(M13 and M67, where it finds no star or the grain of the plate: Moffat of FWHM 14 and 4.6), by distance from where sources are densest, a quarter of the stars each. Found: within half a FWHM and 0.75 mag; "
            "stars put where such a source was before do not count.", ""]
    head = ["tile", "run", "sources", "crowded", "chi2", "radius [pixels]"] + [f"S/N {a}: complete, bias, scatter, pull" for a in ("10-30", "30-100", "100-500")]
    text += columns(head, [[r["tile"], r["by"], str(r["sources"]), f"{r['crowded']:.2f}", f"{r['chi2']:.2f}", f"{r['from']:.0f}-{r['to']:.0f}"] + [
        f"{show(r[k]['complete'])} {show(r[k].get('bias'), '{:+.3f}')} {show(r[k].get('scatter'))} {show(r[k].get('pull'), '{:.2f}')}"
        for k in ("10", "30", "100")] for r in found["rings"]])
    return text + ["Pictures: the core as it is and what templates leave of it (NONE; -5 to 5 sigma): [M13](M13.png), [M67](M67.png), [SDSS cut](SDSS-cut.png).", ""]


def coadd_page(rows):
    text = ["## The SDSS frame against its deep coadd", "", f"Detections and sources of the coadd that are nearest to each other within {COADD_RADIUS} pixels. "
            "The coadd is complete to r of about 23: of what is not matched some is real. By r of the coadd: how many, median and scatter of MAG_TEMPLATE - r.", ""]
    head = ["run", "CROWDING", "crowded", "fits", "sources", "matched", "not matched", "of those with MAG_TEMPLATE below 22"] + [
        f"r {b['low']:g}-{b['high']:g}" for b in rows[0]["bins"]]
    return text + columns(head, [[r["by"], r["crowding"], f"{r['crowded']:.3f}", str(r["fits"]), str(r["sources"]), str(r["matched"]), f"{r['false']:.3f}",
                                  f"{r['false_bright']:.3f}"] + [f"{b['n']}, {b['bias']:+.3f}, {b['scatter']:.3f}" for b in r["bins"]] for r in rows])


def large_page(v):
    return ["## 100,000 stars", "", f"4096 x 4096 pixels, FWHM 4, {v['restorer']}: {v['sources']} sources, {v['seconds']:.0f} s on a machine shared with other work, "
            f"{v['cpu']:.0f} CPU seconds, {v['gigabytes']:.2f} GB, {v['loop']['RXTPPASS']} fits, chi2 {v['loop']['RXTPCHI2']:.3f}.", ""]


def page(out, seed=None):
    """What is there, beside what summary.json in FOLDER holds already; of another seed ALLSTAR's rows alone."""
    old = Path(out) / "summary.json"
    summary = json.loads(old.read_text()) if old.exists() else {}
    seed = int(seed or summary.get("seed", 201))
    rows = summary.get("cells", {})
    if summary.get("seed", seed) != seed:
        rows = {name: {"ALLSTAR": row["ALLSTAR"]} for name, row in rows.items() if "ALLSTAR" in row}
        summary.setdefault("allstar", summary["seed"])
    for name in CELLS:
        for by in ("NONE", "NET", "ALLSTAR"):
            file = Path(out) / f"{name}-{seed}" / f"{by}.json"
            if file.exists():
                rows.setdefault(name, {})[by] = json.loads(file.read_text())
    rows = dict(sorted(rows.items(), key=lambda r: cell(r[0])[0]))
    summary |= {"seed": seed, "cells": rows, "goals": goals(rows)}
    text = ["# Crowded fields", "", *__doc__[__doc__.index("What the columns"):].splitlines(), "", *cells_page(rows, seed, summary.get("allstar", seed))]
    for name, write in (("pairs", pairs_page), ("real", real_page), ("coadd", coadd_page), ("large", large_page)):
        if (Path(out) / f"{name}.json").exists():
            summary[name] = json.loads((Path(out) / f"{name}.json").read_text())
        if name in summary:
            text += write(summary[name])
    missing = [n for n in CELLS if not {"NONE", "NET", "ALLSTAR"} <= set(rows.get(n, ()))]
    if missing:
        text += ["Rows that are missing: " + ", ".join(f"{n} ({' '.join(sorted({'NONE', 'NET', 'ALLSTAR'} - set(rows.get(n, ()))))})" for n in missing) +
                 f". `crowded.py cells FOLDER {seed}` makes them."]
    folder = f"{out}/8000-4-{seed}"
    if all(os.path.exists(f"{folder}/{by}.res.fits") for by in ("NONE", "NET", "ALLSTAR")):
        tile = image(f"{folder}/sim.fits")
        picture(f"{out}/8000-4.png", tile, [f"{folder}/{by}.res.fits" for by in ("NONE", "NET", "ALLSTAR")], (256, 256), SKY**0.5)
    if os.path.exists(f"{out}/8000-4.png"):
        text += ["", "[The middle of 8000-4](8000-4.png), and what NONE, NET and ALLSTAR leave of it (-5 to 5 sigma of the sky)."]
    keep(f"{out}/summary.json", summary)
    (Path(out) / "crowded.md").write_text("\n".join(text).rstrip() + "\n")


if __name__ == "__main__":
    modes = {f.__name__: f for f in (cells, pairs, real, coadd, large, page)}
    if len(sys.argv) < 3 or sys.argv[1] not in modes:
        sys.exit(__doc__)
    modes[sys.argv[1]](*sys.argv[2:])
