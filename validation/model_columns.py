#!/usr/bin/python3
"""The columns of PSF and Sersic fits against what was drawn, and beside source-extractor with psfex.

    model_columns.py FOLDER [SEED[,SEED...]]      seed 1

galaxies: isolated Sersic profiles, half-light radius 0.3 to 1.2 FWHM along the major axis, n and b/a as of COSMOS galaxies
(src/simulate/scene.h), S/N 12 to 200, and STEEP ones of n = 4, drawn here on 5 x 5 cells a pixel and convolved there with a Moffat
PSF of FWHM 4 that is given; noise of independent pixels, or smoothed by a Gaussian of FWHM 1.5 (GRAIN). S/N is that of the true profile at fixed shape. Pulls
are medians and half the distance of the 16 and 84 % of (found - true) / error, of angles where b/a is below 0.8; slopes those of found against true ln R, ellipticity (the
two components of (1 - q) / (1 + q)) and ln n, weighted by the errors that Fisher's matrix of the true profile gives (with the prior of
ln n); scatter is the rms of (found - true) over these errors, clipped at 5.

stars: rextract-simulate, stars and smooth galaxies 6 FWHM apart at least, FWHM 4. psfex measures the PSF, which source-extractor and rextract are
given (PSFEX), and rextract measures it, too (AUTO). By S/N of FLUX_PSF: FLUX_PSF and SPREAD_MODEL of stars against the truth and in errors; of
galaxies those of both programs against each other, and of those that are one Sersic profile what each finds of it.

crowd: 8000 stars per Mpixel on 512 x 512 pixels, the PSF given. Time: user time of one core a source, with and without the columns.

REXTRACT and SIMULATE name the programs. FOLDER gets model_columns.json and model_columns.md.
"""
import json
import os
import subprocess
import sys

import numpy as np
from astropy.io import fits
from scipy.optimize import brentq, least_squares
from scipy.fft import irfft2, next_fast_len, rfft2
from scipy.spatial import cKDTree
from scipy.special import gammainc, gamma

import ledger

HERE = os.path.dirname(os.path.abspath(__file__))
FWHM, BETA, CELLS, STEP, ZERO = 4.0, 4.765, 5, 72, 25.0
N_DECILES = [0.502, 0.702, 0.848, 0.941, 1.095, 1.286, 1.482, 1.887, 2.535, 3.113, 4.048]
Q_DECILES = [0.159, 0.256, 0.346, 0.419, 0.514, 0.574, 0.628, 0.701, 0.758, 0.864, 0.994]
PRIOR_N, MEAN_N, PRIOR_G = 0.62, 0.32, 0.5
GIVEN = ("-PSF_TYPE", "MOFFAT", "-PSF_FWHM", str(FWHM), "-PSF_BETA", str(BETA))
COLUMNS = ("X_IMAGE Y_IMAGE XTEMPLATE_IMAGE YTEMPLATE_IMAGE FLUX_TEMPLATE FLUXERR_TEMPLATE FLUX_PSF FLUXERR_PSF MAG_PSF XPSF_IMAGE YPSF_IMAGE "
           "CHI2_PSF CLASS_TEMPLATE SPREAD_MODEL SPREADERR_MODEL FLUX_MODEL FLUX_SPHEROID FLUXERR_SPHEROID SPHEROID_REFF_IMAGE SPHEROID_REFFERR_IMAGE "
           "SPHEROID_SERSICN SPHEROID_SERSICNERR SPHEROID_ASPECT_IMAGE SPHEROID_ASPECTERR_IMAGE SPHEROID_THETA_IMAGE SPHEROID_THETAERR_IMAGE")


def program(name, default):
    return os.path.abspath(os.environ.get(name, f"{HERE}/../build/{default}"))


def fine_moffat():
    half = 10 * int(FWHM) * CELLS // 2
    y, x = np.mgrid[-half:half + 1, -half:half + 1] / CELLS
    alpha = FWHM / 2 / np.sqrt(2**(1 / BETA) - 1)
    psf = (1 + (x * x + y * y) / alpha**2)**-BETA
    return psf / psf.sum()


PSF = fine_moffat()
ROOM = next_fast_len(STEP * CELLS + len(PSF), real=True)
OPTICS = rfft2(PSF.astype(np.float64), (ROOM, ROOM))


def sersic(x, y, flux, radius, q, theta, n, side):
    """A stamp of side x side pixels, the profile's centre at (x, y) of it; the cells near its centre are divided again."""
    b = brentq(lambda t: gammainc(2 * n, t) - 0.5, 1e-3, 30)
    total = 2 * np.pi * n * gamma(2 * n) * b**(-2 * n) * radius**2 * q

    def light(u, v):
        along = u * np.cos(theta) + v * np.sin(theta)
        across = (v * np.cos(theta) - u * np.sin(theta)) / q
        return np.exp(-b * (np.hypot(along, across) / radius)**(1 / n)) / total

    at = (np.arange(side * CELLS) + 0.5) / CELLS - 0.5
    fine = light(at[None, :] - x, at[:, None] - y) / CELLS**2
    i, j = int((x + 0.5) * CELLS), int((y + 0.5) * CELLS)
    part = (np.arange(60) + 0.5) / 60 / CELLS
    for v in range(j - 6, j + 7):
        for u in range(i - 6, i + 7):
            fine[v, u] = light((at[u] - 0.5 / CELLS + part)[None, :] - x, (at[v] - 0.5 / CELLS + part)[:, None] - y).mean() / CELLS**2
    half = len(PSF) // 2
    blurred = irfft2(rfft2(fine, (ROOM, ROOM)) * OPTICS, (ROOM, ROOM))[half:half + side * CELLS, half:half + side * CELLS]
    return flux * blurred.reshape(side, CELLS, side, CELLS).sum((1, 3))


def deciles(rng, table):
    return np.interp(rng.random(), np.linspace(0, 1, 11), table)


def vector(truth):
    """Flux, x, y, ln R, g1, g2, ln n."""
    g = (1 - truth["q"]) / (1 + truth["q"])
    return np.array([truth["flux"], truth["x"], truth["y"], np.log(truth["radius"]), g * np.cos(2 * truth["theta"]),
                     g * np.sin(2 * truth["theta"]), np.log(truth["n"])])


def from_vector(p, side):
    g = np.hypot(p[4], p[5])
    return sersic(p[1], p[2], p[0], np.exp(p[3]), (1 - g) / (1 + g), 0.5 * np.arctan2(p[5], p[4]), np.exp(p[6]), side)


def fisher(truth, side):
    """Errors of the vector by the true profile, noise 1 a pixel, and the prior of ln n."""
    p = vector(truth)
    stamp = from_vector(p, side)
    slopes = [(stamp / p[0]).ravel(), -np.gradient(stamp, axis=1).ravel(), -np.gradient(stamp, axis=0).ravel()]
    for k in range(3, 7):
        up, down = p.copy(), p.copy()
        up[k] += 0.02
        down[k] -= 0.02
        slopes.append(((from_vector(up, side) - from_vector(down, side)) / 0.04).ravel())
    slopes = np.array(slopes)
    a = slopes @ slopes.T
    a[6, 6] += PRIOR_N**-2
    return np.sqrt(np.diag(np.linalg.inv(a)))


def draw_galaxies(folder, seed, steep, grain, count=14):
    rng = np.random.default_rng([seed, steep, grain])
    size = count * STEP
    image = np.zeros((size, size))
    truths = []
    for k in range(count * count):
        side = STEP
        truth = {"x": side / 2 + rng.uniform(-0.5, 0.5), "y": side / 2 + rng.uniform(-0.5, 0.5), "n": 4.0 if steep else deciles(rng, N_DECILES),
                 "q": deciles(rng, Q_DECILES), "theta": rng.uniform(-np.pi / 2, np.pi / 2), "radius": FWHM * np.exp(rng.uniform(np.log(0.3), np.log(1.2)))}
        truth["flux"] = 1.0
        stamp = from_vector(vector(truth), side)
        truth["snr"] = np.exp(rng.uniform(np.log(12), np.log(200)))
        truth["flux"] = truth["snr"] / np.sqrt((stamp**2).sum())
        if not grain:
            truth["fisher"] = fisher(truth, side)
        i, j = k % count * side, k // count * side
        image[j:j + side, i:i + side] += truth["flux"] * stamp
        truth["x"] += i
        truth["y"] += j
        truths.append(truth)
    noise = rng.standard_normal((size, size))
    if grain:
        from scipy.ndimage import gaussian_filter
        noise = gaussian_filter(noise, 1.5 / 2.3548)
        noise /= noise.std()
    name = f"{folder}/galaxies.fits"
    fits.writeto(name, (image + noise + 100).astype(np.float32), overwrite=True)
    return name, truths


def extract(folder, image, *arguments, columns=COLUMNS):
    with open(f"{folder}/columns.param", "w") as f:
        f.write("\n".join(columns.split()) + "\n")
    out = f"{folder}/rextract.cat"
    begin = os.times()
    subprocess.run([program("REXTRACT", "rextract"), image, "-c", "/dev/null", "-RESTORE_TYPE", "NONE", "-PARAMETERS_NAME", f"{folder}/columns.param",
                    "-CATALOG_NAME", out, "-CATALOG_TYPE", "FITS_1.0", "-MAG_ZEROPOINT", str(ZERO), "-NTHREADS", "1", *arguments], check=True,
                   stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    end = os.times()
    return fits.getdata(out, 1), end.children_user - begin.children_user


def middle(values):
    low, mid, high = np.percentile(values, (16, 50, 84))
    return {"median": float(mid), "width": float((high - low) / 2), "n": len(values)}


def slope(true, found, error):
    if true.std() < 1e-9:
        return None
    w = error**-2
    x, y = true - np.average(true, weights=w), found - np.average(found, weights=w)
    return float((w * x * y).sum() / (w * x * x).sum())


def galaxies(folder, seeds, steep, grain):
    rows = []
    for seed in seeds:
        image, truths = draw_galaxies(folder, seed, steep, grain)
        found, _ = extract(folder, image, *GIVEN)
        tree = cKDTree(np.c_[found["X_IMAGE"] - 1, found["Y_IMAGE"] - 1])
        for truth in truths:
            away, i = tree.query((truth["x"], truth["y"]))
            if away < 2:
                rows.append((truth, found[i]))
    result = {}
    for label, low, high in (("12-20", 12, 20), ("20-50", 20, 50), ("50-200", 50, 200)):
        part = [(t, f) for t, f in rows if low <= t["snr"] < high and np.isfinite(f["FLUX_SPHEROID"])]
        lost = len([t for t, f in rows if low <= t["snr"] < high]) - len(part)
        column = lambda name: np.array([f[name] for t, f in part], float)
        true = np.array([vector(t) for t, f in part])
        radius, q, theta, n = (column(f"SPHEROID_{k}") for k in ("REFF_IMAGE", "ASPECT_IMAGE", "THETA_IMAGE", "SERSICN"))
        theta = np.radians(theta)
        g = (1 - q) / (1 + q)
        vec = np.array([column("FLUX_SPHEROID"), column("FLUX_SPHEROID"), column("FLUX_SPHEROID"), np.log(radius), g * np.cos(2 * theta), g * np.sin(2 * theta), np.log(n)]).T
        turn = (theta - np.array([t["theta"] for t, f in part]) + np.pi / 2) % np.pi - np.pi / 2
        pulls = {"FLUX": (vec[:, 0] - true[:, 0]) / column("FLUXERR_SPHEROID"),
                 "REFF": (radius - np.exp(true[:, 3])) / column("SPHEROID_REFFERR_IMAGE"),
                 "SERSICN": (n - np.exp(true[:, 6])) / column("SPHEROID_SERSICNERR"),
                 "ASPECT": (q - np.array([t["q"] for t, f in part])) / column("SPHEROID_ASPECTERR_IMAGE"),
                 "THETA": (turn / np.radians(column("SPHEROID_THETAERR_IMAGE")))[[t["q"] < 0.8 for t, f in part]],
                 "FLUX_TEMPLATE": (column("FLUX_TEMPLATE") - true[:, 0]) / column("FLUXERR_TEMPLATE")}
        cell = {"galaxies": len(part), "lost": lost, "at a limit": int(np.isnan(column("SPHEROID_REFFERR_IMAGE") * column("SPHEROID_SERSICNERR") * column("SPHEROID_ASPECTERR_IMAGE")).sum()),
                "pulls": {k: middle(v[np.isfinite(v)]) for k, v in pulls.items()},
                "flux ratio": float(np.median(vec[:, 0] / true[:, 0])), "template flux ratio": float(np.median(column("FLUX_TEMPLATE") / true[:, 0]))}
        if not grain:
            error = np.array([t["fisher"] for t, f in part])
            cell["slopes"] = {"ln R": slope(true[:, 3], vec[:, 3], error[:, 3]), "ln n": slope(true[:, 6], vec[:, 6], error[:, 6]),
                              "ellipticity": slope(np.r_[true[:, 4], true[:, 5]], np.r_[vec[:, 4], vec[:, 5]], np.r_[error[:, 4], error[:, 5]])}
            scatter = lambda k: float(np.sqrt(np.mean(np.clip((vec[:, k] - true[:, k]) / error[:, k], -5, 5)**2)))
            cell["scatter"] = {"flux": scatter(0), "ln R": scatter(3), "g1": scatter(4), "g2": scatter(5), "ln n": scatter(6)}
        result[label] = cell
    return result


def sex(params, out, kind, *arguments):
    with open("theirs.param", "w") as f:
        f.write("\n".join(params.split()) + "\n")
    subprocess.run(["source-extractor", "sim.fits", "-c", "/dev/null", "-PARAMETERS_NAME", "theirs.param", "-FILTER", "N", "-DETECT_THRESH", "2",
                    "-CATALOG_TYPE", kind, "-CATALOG_NAME", out, "-MAG_ZEROPOINT", str(ZERO), "-GAIN", "0", "-SATUR_LEVEL", "1e9",
                    "-VERBOSE_TYPE", "QUIET", *arguments], check=True)


def simulate(image, seed, *arguments):
    subprocess.run([program("SIMULATE", "rextract-simulate"), "-c", "/dev/null", "-IMAGE_NAME", f"{image}.fits", "-TRUTH_NAME", f"{image}_truth.fits",
                    "-SEED", str(seed), "-MAG_ZEROPOINT", str(ZERO), "-PSF_FWHM", str(FWHM), "-NOISE_SIGMA", "10", *arguments], check=True,
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return fits.getdata(f"{image}_truth.fits", 1)


def match(found, truth, reach):
    away, i = cKDTree(np.c_[found["X_IMAGE"], found["Y_IMAGE"]]).query(np.c_[truth["X_IMAGE"], truth["Y_IMAGE"]])
    return np.where(away < reach, i, -1)


def spread_tile(folder, seed):
    """Isolated objects that all have: truth, ours by PSFEx's PSF and by our own, theirs."""
    os.chdir(folder)
    truth = simulate("sim", seed, "-IMAGE_SIZE", "1400", "-STAR_COUNT", "250", "-STAR_MAG", "12,17.5", "-GALAXY_COUNT", "250", "-GALAXY_MAG", "13,17.5",
                     "-GALAXY_SCALE", "0.3", "-GALAXY_TYPE", "SMOOTH", "-LEAST_DISTANCE", "6")
    sex("VIGNET(45,45) X_IMAGE Y_IMAGE FLUX_RADIUS SNR_WIN FLUX_APER(1) FLUXERR_APER(1) ELONGATION FLAGS", "stars.cat", "FITS_LDAC", "-PHOT_APERTURES", "20")
    subprocess.run(["psfex", "stars.cat", "-c", "/dev/null", "-PSF_SIZE", "45,45", "-PSFVAR_DEGREES", "0", "-CHECKPLOT_TYPE", "NONE", "-CHECKIMAGE_TYPE",
                    "NONE", "-WRITE_XML", "N", "-VERBOSE_TYPE", "QUIET", "-SAMPLE_MINSN", "60"], check=True, stdout=subprocess.DEVNULL)
    sex("X_IMAGE Y_IMAGE FLUX_PSF FLUXERR_PSF XPSF_IMAGE YPSF_IMAGE SPREAD_MODEL SPREADERR_MODEL FLUX_SPHEROID FLUXERR_SPHEROID SPHEROID_REFF_IMAGE "
        "SPHEROID_REFFERR_IMAGE SPHEROID_SERSICN SPHEROID_SERSICNERR SPHEROID_ASPECT_IMAGE SPHEROID_ASPECTERR_IMAGE", "theirs.cat", "FITS_1.0", "-PSF_NAME",
        "stars.psf")
    lists = [extract(folder, "sim.fits", "-PSF_TYPE", "PSFEX", "-PSF_NAME", "stars.psf")[0],
             extract(folder, "sim.fits")[0], fits.getdata("theirs.cat", 1)]
    at = np.c_[truth["X_IMAGE"], truth["Y_IMAGE"]]
    use = (cKDTree(at).query(at, k=2)[0][:, 1] > 24) & (at.min(1) > 30) & (at.max(1) < 1370)
    found = [match(c, truth, 1.5) for c in lists]
    use &= np.all([f >= 0 for f in found], axis=0)
    return truth[use], [c[f[use]] for c, f in zip(lists, found)]


def spreads(folder, seeds):
    tiles = [spread_tile(folder, seed) for seed in seeds]
    truth = np.concatenate([t for t, _ in tiles])
    ours, auto, theirs = (np.concatenate([c[k] for _, c in tiles]) for k in range(3))
    star = np.char.strip(truth["TYPE"].astype(str)) == "STAR"
    single = ~star & (truth["BULGE_SHARE"] >= 1)
    snr = auto["FLUX_PSF"] / auto["FLUXERR_PSF"]
    result = {}
    for low, high in ((10, 30), (30, 100), (100, 1000)):
        inside = (snr >= low) & (snr < high)
        cell = {}
        for name, c in (("PSFEX", ours), ("AUTO", auto), ("source-extractor", theirs)):
            k = inside & star
            row = {"stars": {"flux": middle(c["FLUX_PSF"][k] / truth["FLUX"][k] - 1), "flux pull": middle((c["FLUX_PSF"][k] - truth["FLUX"][k]) / c["FLUXERR_PSF"][k]),
                             "x off": middle(c["XPSF_IMAGE"][k] - truth["X_IMAGE"][k]), "spread": middle(c["SPREAD_MODEL"][k]),
                             "spread pull": middle(c["SPREAD_MODEL"][k] / c["SPREADERR_MODEL"][k])}}
            k = inside & ~star
            value, other = c["SPREAD_MODEL"][k].astype(float), theirs["SPREAD_MODEL"][k].astype(float)
            row["galaxies"] = {"FLUX_PSF over source-extractor's": middle(c["FLUX_PSF"][k] / theirs["FLUX_PSF"][k]),
                               "spread, slope": float(np.polyfit(other, value, 1)[0]), "spread, correlation": float(np.corrcoef(other, value)[0, 1])}
            k = inside & single & np.isfinite(c["FLUX_SPHEROID"]) & (c["FLUX_SPHEROID"] > 0)
            with np.errstate(divide="ignore", invalid="ignore"):
                pulls = {key: (c[column][k] - true[k]) / c[error][k] for key, column, error, true in (
                    ("flux", "FLUX_SPHEROID", "FLUXERR_SPHEROID", truth["FLUX"]), ("R", "SPHEROID_REFF_IMAGE", "SPHEROID_REFFERR_IMAGE", truth["FLUX_RADIUS"]),
                    ("n", "SPHEROID_SERSICN", "SPHEROID_SERSICNERR", truth["SERSIC_N"]),
                    ("q", "SPHEROID_ASPECT_IMAGE", "SPHEROID_ASPECTERR_IMAGE", 1 / truth["ELONGATION"]))}
            row["Sersic"] = {"flux": middle(c["FLUX_SPHEROID"][k] / truth["FLUX"][k]), "R": middle(c["SPHEROID_REFF_IMAGE"][k] / truth["FLUX_RADIUS"][k]),
                             "n": middle(c["SPHEROID_SERSICN"][k] / truth["SERSIC_N"][k]), "q": middle(c["SPHEROID_ASPECT_IMAGE"][k] - 1 / truth["ELONGATION"][k]),
                             "pulls": {key: middle(v[np.isfinite(v)]) for key, v in pulls.items()}}
            cell[name] = row
        result[f"{low}-{high}"] = cell
    return result


def crowd(folder, seeds):
    result, off, pulls, seconds, plain, count = {}, [], [], 0.0, 0.0, 0
    for seed in seeds:
        truth = simulate(f"{folder}/crowd", seed, "-IMAGE_SIZE", "512", "-STAR_COUNT", "8000", "-STAR_MAG", "11,18", "-STAR_SLOPE", "0.36", "-GALAXY_COUNT", "0")
        plain += extract(folder, f"{folder}/crowd.fits", *GIVEN, columns="NUMBER FLUX_TEMPLATE")[1]
        found, used = extract(folder, f"{folder}/crowd.fits", *GIVEN)
        seconds += used
        count += len(found)
        i = match(found, truth, 0.5)
        f = found[i[i >= 0]]
        t = truth[i >= 0]
        bright = f["FLUX_PSF"] > 20 * f["FLUXERR_PSF"]
        off += list((f["FLUX_PSF"] / t["FLUX"])[bright])
        pulls += list(((f["FLUX_PSF"] - t["FLUX"]) / f["FLUXERR_PSF"])[bright])
    return {"sources": count, "flux": middle(np.array(off)), "pulls": middle(np.array(pulls)), "ms a source": 1000 * (seconds - plain) / count}


def one(folder, seed, count=4):
    """Galaxies of S/N 500, each fitted by scipy, too, with the same priors, on the pixels within 2 FWHM and 3 radii: largest differences."""
    rng = np.random.default_rng([seed, 7])
    worst = {}
    for _ in range(count):
        truth = {"x": STEP / 2 + rng.uniform(-0.5, 0.5), "y": STEP / 2 + rng.uniform(-0.5, 0.5), "n": np.exp(rng.uniform(-0.5, 0.9)), "q": rng.uniform(0.3, 0.8),
                 "theta": rng.uniform(-1.5, 1.5), "radius": rng.uniform(2.5, 4.5), "flux": 1.0}
        truth["flux"] = 500 / np.sqrt((from_vector(vector(truth), STEP)**2).sum())
        pixels = from_vector(vector(truth), STEP) + rng.standard_normal((STEP, STEP))
        whole = rng.standard_normal((3 * STEP, 3 * STEP))
        whole[STEP:2 * STEP, STEP:2 * STEP] = pixels
        fits.writeto(f"{folder}/one.fits", whole.astype(np.float32), overwrite=True)
        found, _ = extract(folder, f"{folder}/one.fits", *GIVEN, "-BACK_TYPE", "MANUAL", "-BACK_VALUE", "0", "-TEMPLATE_BACKSIZE", "0", "-TEMPLATE_PSFERR", "0")
        f = found[np.argmax(found["FLUX_SPHEROID"])]
        half = int(2 * FWHM + 3 * truth["radius"]) + 2
        cut = np.s_[STEP // 2 - half:STEP // 2 + half + 1, STEP // 2 - half:STEP // 2 + half + 1]

        def residual(p):
            p = np.r_[p[0] * truth["flux"], p[1:]]
            return np.r_[(from_vector(p, STEP) - pixels)[cut].ravel(), p[4] / PRIOR_G, p[5] / PRIOR_G, (p[6] - MEAN_N) / PRIOR_N]

        start = vector(truth)
        start[0] = 1
        p = least_squares(residual, start, x_scale=[0.01, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1], diff_step=1e-4).x
        g = np.hypot(p[4], p[5])
        scipy = {"FLUX": p[0] * truth["flux"], "REFF": np.exp(p[3]), "SERSICN": np.exp(p[6]), "ASPECT": (1 - g) / (1 + g)}
        rextract = {"FLUX": f["FLUX_SPHEROID"], "REFF": f["SPHEROID_REFF_IMAGE"], "SERSICN": f["SPHEROID_SERSICN"], "ASPECT": f["SPHEROID_ASPECT_IMAGE"]}
        for key, value in scipy.items():
            worst[key] = max(worst.get(key, 0), abs(float(rextract[key]) / value - 1))
        turn = np.degrees(0.5 * np.arctan2(p[5], p[4])) - f["SPHEROID_THETA_IMAGE"]
        worst["THETA [deg]"] = max(worst.get("THETA [deg]", 0), abs((float(turn) + 90) % 180 - 90))
    return worst


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "| " + " | ".join("---" for _ in head) + " |"]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def show(value, form="{:.2f}"):
    if value is None:
        return ""
    if isinstance(value, dict):
        return f"{form} ({form})".format(value["median"], value["width"])
    return form.format(value)


def page(result):
    """Medians, in brackets half the distance of the 16 and 84 %."""
    out = [f"# Columns of PSF and Sersic fits\n\nMade by `validation/model_columns.py`, seed {', '.join(map(str, result['seeds']))}; its head says what was "
           "drawn. Medians, in brackets half the distance of the 16 and 84 %.\n"]
    keys = ("FLUX", "REFF", "SERSICN", "ASPECT", "THETA")
    for name in ("galaxies", "n = 4", "correlated noise"):
        rows = [[snr, str(c["galaxies"]), str(c["lost"]), str(c["at a limit"]), show(c["flux ratio"], "{:.3f}"), show(c["template flux ratio"], "{:.3f}")]
                + [show(c["pulls"][k]) for k in keys] for snr, c in result[name].items()]
        out.append(f"## {name}: flux found / true, and pulls of SPHEROID_\n")
        out.append(table(["S/N", "galaxies", "lost", "at a limit", "FLUX_SPHEROID / true", "FLUX_TEMPLATE / true", *keys], rows))
        if "slopes" in next(iter(result[name].values())):
            rows = [[snr] + [show(c["slopes"][k]) for k in ("ln R", "ellipticity", "ln n")]
                    + [show(c["scatter"][k]) for k in ("flux", "ln R", "g1", "g2", "ln n")] for snr, c in result[name].items()]
            out.append("Slope of found against true; scatter over Fisher's bound:\n")
            out.append(table(["S/N", "slope ln R", "ellipticity", "ln n", "scatter flux", "ln R", "g1", "g2", "ln n"], rows))
    out.append("## One source by scipy.optimize.least_squares: largest relative difference of four\n")
    out.append(table(list(result["one"]), [[show(v, "{:.4f}") for v in result["one"].values()]]))
    c = result["crowd"]
    out.append("## Crowd and time\n")
    out.append(f"8000 stars per Mpixel, {c['sources']} sources: all columns cost {c['ms a source']:.2f} ms a source besides the templates. FLUX_PSF of S/N above "
               f"20 (there mostly FLUX_TEMPLATE) over the true one {show(c['flux'], '{:.3f}')}, pulls {show(c['pulls'])}.\n")
    out.append("## Beside source-extractor\n")
    for part, columns in (("stars", (("flux", "{:+.4f}"), ("flux pull", "{:+.2f}"), ("x off", "{:+.3f}"), ("spread", "{:+.5f}"), ("spread pull", "{:+.2f}"))),
                          ("galaxies", (("FLUX_PSF over source-extractor's", "{:.3f}"), ("spread, slope", "{:.3f}"), ("spread, correlation", "{:.4f}"))),
                          ("Sersic", (("flux", "{:.3f}"), ("R", "{:.3f}"), ("n", "{:.2f}"), ("q", "{:+.3f}")))):
        rows = [[snr, name, str(next(iter(row[part].values()))["n"])]
                + [show(row[part][k], form) for k, form in columns]
                + ([show(row[part]["pulls"][k]) for k in ("flux", "R", "n", "q")] if part == "Sersic" else [])
                for snr, cell in result["stars"].items() for name, row in cell.items()]
        head = ["S/N", "", "number"] + [k for k, _ in columns] + (["pull flux", "R", "n", "q"] if part == "Sersic" else [])
        out.append({"stars": "Stars: FLUX_PSF / true - 1, SPREAD_MODEL\n", "galaxies": "Galaxies: against source-extractor's own\n",
                    "Sersic": "Single Sersic profiles: found / true, q found - true\n"}[part])
        out.append(table(head, rows))
    return "\n".join(out)


def main(folder, seeds="1"):
    seeds = [int(s) for s in seeds.split(",")]
    os.makedirs(folder, exist_ok=True)
    ledger.claim("model_columns", folder, seeds)
    folder = os.path.abspath(folder)
    work = f"{folder}/work"
    os.makedirs(work, exist_ok=True)
    result = {"seeds": seeds, "galaxies": galaxies(work, seeds, 0, 0), "n = 4": galaxies(work, seeds, 1, 0), "correlated noise": galaxies(work, seeds, 0, 1),
              "one": one(work, seeds[0]), "crowd": crowd(work, seeds), "stars": spreads(work, seeds)}
    with open(f"{folder}/model_columns.json", "w") as f:
        json.dump(result, f, indent=1)
    with open(f"{folder}/model_columns.md", "w") as f:
        f.write(page(result))


if __name__ == "__main__":
    main(*sys.argv[1:])
