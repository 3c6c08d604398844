#!/usr/bin/python3
"""The core of a globular cluster as SDSS sees it: a published comparison of deblenders, on a twin of its sky.

    globular.py FOLDER [SEED[,SEED...]]     seed 61

Liu, McAuliffe & Regier (2021, arXiv:2102.02409; github.com/Runjing-Liu120/DeblendingStarfields) compare StarNet, PCAT and DAOPHOT on 100 x 100 pixels
of M2 (SDSS run 2583, camcol 2, field 136, r) with the stars of the Hubble telescope's catalogue there that have 1000 electrons (r about 22.3). A star is found where a
detection lies within 0.5 pixels in x and y and 0.5 mag; 5 pixels at the border do not count. That catalogue is not at hand, so the sky is drawn:
STARS such stars in the middle 100 x 100 pixels, N(> f) ~ f^-SLOPE from 20 to 10^6 electrons, density falling from the cluster's centre, 289 pixels away,
as the frame's light does; Moffat PSF of FWHM 2.65 pixels (psField) and beta 3.5; sky of 686 electrons. STARS and SLOPE are such that the
pixels are as bright as the frame's (percentiles below the table) and DAOPHOT finds there what was published.
Ours are runs with zero point, no saturation and no check on blank noise given, all else as it is by default; DAOPHOT is IRAF's (allstar.py). REXTRACT and RX_MODEL as in crowded.py.
"""
import os
import sys

import numpy as np
from astropy.io import fits
from scipy.spatial import cKDTree

import allstar
import ledger
from crowded import extract, table

SIDE, BOX, FINE, FWHM, BETA, SKY = 400, 100, 4, 2.65, 3.5, 686.0
STARS, LEAST, MOST, FAINTEST, SLOPE = 900, 1e3, 1e6, 20.0, 0.9
CENTRE = (-147.0, 249.0)  # of the cluster, from the middle
LIGHT = ((0, 50, 100, 150, 200, 300, 400, 500), (55860, 31877, 13095, 5946, 3168, 1640, 852, 669))  # electrons a pixel on 60 x 60 of the frame, by distance
ZERO = 25.0
PUBLISHED = {"StarNet, wake-sleep": (.506, .601, .549), "StarNet": (.510, .469, .489), "PCAT": (.559, .405, .469), "DAOPHOT": (.200, .631, .303)}
FRAME = (164.8, 293.6, 739.9, 2168.6, 12568.4)  # percentiles 1, 10, 50, 90, 99 of the frame's box, electrons above the sky


def density(x, y):
    """Of stars, over that in the middle."""
    r = np.hypot(x - SIDE / 2 - CENTRE[0], y - SIDE / 2 - CENTRE[1])
    light = np.exp(np.interp(r, LIGHT[0], np.log(LIGHT[1])))
    return light / np.exp(np.interp(np.hypot(*CENTRE), LIGHT[0], np.log(LIGHT[1])))


def sky(seed):
    """Pixels in electrons; x, y, electrons of all stars above LEAST."""
    rng = np.random.default_rng([seed, 7])
    cells = density(*np.meshgrid(np.arange(0, SIDE, 4) + 2, np.arange(0, SIDE, 4) + 2))
    most = cells.max()
    n = rng.poisson(most * STARS / BOX**2 * (FAINTEST / LEAST)**-SLOPE * SIDE**2)
    x, y = rng.uniform(0, SIDE, (2, n))
    kept = rng.uniform(0, most, n) < density(x, y)
    x, y = x[kept], y[kept]
    low, high = FAINTEST**-SLOPE, MOST**-SLOPE
    flux = (low - rng.uniform(size=len(x)) * (low - high))**(-1 / SLOPE)
    side = SIDE * FINE
    image = np.histogram2d(y, x, bins=side, range=[[0, SIDE]] * 2, weights=flux)[0]
    f = np.fft.fftfreq(side)
    p = np.minimum(np.arange(side), side - np.arange(side)) / FINE
    r2 = p[None, :]**2 + p[:, None]**2
    psf = (1 + r2 * 4 * (2**(1 / BETA) - 1) / FWHM**2)**-BETA
    image = np.fft.irfft2(np.fft.rfft2(image) * np.fft.rfft2(psf / psf.sum()), s=image.shape)
    # stars lie in the middles of fine pixels
    x, y = (np.floor(v * FINE) + 0.5 for v in (x, y))
    clean = image.reshape(SIDE, FINE, SIDE, FINE).sum((1, 3)) + SKY
    bright = flux > LEAST
    return rng.poisson(clean).astype(np.float32), x[bright] / FINE - 0.5, y[bright] / FINE - 0.5, flux[bright]


def inside(x, y, border):
    low = (SIDE - BOX) / 2
    return (x > low + border) & (x < low + BOX - border) & (y > low + border) & (y < low + BOX - border)


def score(found, truth):
    """Rate of stars found, precision, F1; the magnitudes of both against zero point 25."""
    found, truth = (np.column_stack(c)[inside(c[0], c[1], 5)] for c in (found, truth))
    if not len(found):
        return 0.0, 0.0, 0.0, 0
    near = cKDTree(truth).query_ball_point(found, 0.5, p=np.inf)
    ppv, tpr = np.mean([len(n) > 0 for n in near]), len(set(sum(near, []))) / len(truth)
    return tpr, ppv, 2 * tpr * ppv / max(tpr + ppv, 1e-9), len(found)


def lists(folder, pixels, programs):
    fits.writeto(f"{folder}/sim.fits", pixels, overwrite=True)
    for by in programs:
        if by == "ALLSTAR":
            (x, y, mag, _), _, seconds = allstar.run(f"{folder}/iraf", pixels, FWHM, 0, float(np.sqrt(np.median(pixels))))
        else:
            _, seconds = extract(folder, "sim.fits", by, by)
            t = table(f"{folder}/{by}.cat")
            fine = (t["FLAGS_RESTORE"].astype(int) & 3) == 0
            x, y, mag = (t[c][fine] for c in ("XTEMPLATE_IMAGE", "YTEMPLATE_IMAGE", "MAG_TEMPLATE"))
        good = np.isfinite(x + y + mag)
        yield by, (x[good] - 1, y[good] - 1, mag[good]), seconds


def zero_of(found, x, y, mag):
    """ALLSTAR's magnitudes are an aperture's: what they are off by, from stars of 20,000 electrons and more."""
    d, i = cKDTree(np.column_stack([x, y])).query(np.column_stack(found[:2]))
    some = (d < 0.5) & (mag[i] < ZERO - 2.5 * np.log10(2e4))
    return np.median(found[2][some] - mag[i[some]])


def main():
    folder, seeds = os.path.abspath(sys.argv[1]), [int(s) for s in (sys.argv[2] if len(sys.argv) > 2 else "61").split(",")]
    ledger.claim("globular", folder, seeds)
    os.makedirs(folder, exist_ok=True)
    rows, light = {}, []
    for seed in seeds:
        pixels, x, y, flux = sky(seed)
        mag, low = ZERO - 2.5 * np.log10(flux), (SIDE - BOX) // 2
        light.append(np.percentile(pixels[low:-low, low:-low] - SKY, (1, 10, 50, 90, 99)))
        for by, found, seconds in lists(folder, pixels, os.environ.get("RX_PROGRAMS", "NONE,RL,NET,ALLSTAR").split(",")):
            if by == "ALLSTAR":
                found = (*found[:2], found[2] - zero_of(found, x, y, mag))
            rows.setdefault(by, []).append((*score(found, (x, y, mag)), seconds))
            print(seed, by, rows[by][-1], flush=True)
    text = ["# The core of a globular cluster", "", f"`validation/globular.py`, seeds {', '.join(map(str, seeds))}: {STARS} stars of {LEAST:g} electrons and more in the box. Share of them that is found, "
            "precision, F1 (ranges over the seeds), detections, seconds.", "", "| | found | precision | F1 | detections | seconds |", "| --- | --- | --- | --- | --- | --- |"]
    for by, values in rows.items():
        mean, f1 = np.mean(values, 0), [v[2] for v in values]
        text.append(f"| {by} | {mean[0]:.3f} | {mean[1]:.3f} | {mean[2]:.3f} ({min(f1):.3f} to {max(f1):.3f}) | {mean[3]:.0f} | {mean[4]:.0f} |")
    text += [f"| {by}, published | {' | '.join(f'{v:.3f}' for v in values)} | | |" for by, values in PUBLISHED.items()]
    text += ["", "Electrons a pixel above the sky, percentiles 1, 10, 50, 90, 99: " + ", ".join(f"{v:.0f}" for v in np.mean(light, 0)) + "; of the frame "
             + ", ".join(f"{v:.0f}" for v in FRAME) + "."]
    ledger.store(folder, "globular", text, {"seeds": seeds, "rows": rows})


if __name__ == "__main__":
    main()
