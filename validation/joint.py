#!/usr/bin/python3
"""Would one sparse fit of all sources be better than the groups that templates are fitted in?

    joint.py FOLDER [SEED[,SEED...] [CELL[,CELL...]]]     seeds: 301; cells of crowded.py without V and G: 8000-4,20000-4

On tiles of crowded.py, with the true PSF and gain given to rextract (RESTORE_TYPE NONE), its list of points is fitted once more: all fluxes at
rextract's places in one sparse least squares, weighed by the noise of the model; then fluxes and places, three Gauss-Newton turns, places with a
prior of a quarter FWHM. What rextract has of the sky and of other profiles stays. Shift: of a flux in its FLUXERR_TEMPLATE, the 68th
percentile. Then bias and scatter (1.4826 times the median deviation) of magnitudes and the width of pulls, by true S/N, of objects
matched within half a FWHM; pulls are in rextract's errors. REXTRACT and SIMULATE as in crowded.py. FOLDER gets joint.json and joint.md.
"""
import json
import sys
from pathlib import Path

import numpy as np
from astropy.io import fits
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

import crowded
import ledger

BETA, HALF, FINE = 4.765, 14, 5  # of crowded.py's PSF; pixels; samples along a pixel
BINS = (5, 10, 20, 50, 200)


def stamp(x, y, fwhm, shape, middle):
    """The PSF at (x, y), in pixels that begin at 0, around `middle`: values, and the numbers of their pixels."""
    radius = fwhm / 2 / np.sqrt(2 ** (1 / BETA) - 1)
    u, v = (np.arange(c - HALF, c + HALF + 1) for c in middle)
    across, up = (((w[:, None] + (np.arange(FINE) - FINE // 2) / FINE).ravel() - c) for w, c in ((u, x), (v, y)))
    light = (BETA - 1) / (np.pi * radius**2) * (1 + (across[None] ** 2 + up[:, None] ** 2) / radius**2) ** -BETA
    light = light.reshape(len(v), FINE, len(u), FINE).mean((1, 3))
    inside = (v[:, None] >= 0) & (v[:, None] < shape[0]) & (u[None] >= 0) & (u[None] < shape[1])
    return light * inside, np.where(inside, v[:, None] * shape[1] + u[None], 0)


def columns(x, y, flux, fwhm, shape):
    """Of each source its flux, and the flux times its move in x and in y."""
    values, pixels, step = [], [], 0.01
    for a, b, f in zip(x, y, flux):
        middle = round(a), round(b)
        light, at = stamp(a, b, fwhm, shape, middle)
        moves = [stamp(a + i, b + j, fwhm, shape, middle)[0] - stamp(a - i, b - j, fwhm, shape, middle)[0] for i, j in ((step, 0), (0, step))]
        values += [light, *(f * m / (2 * step) for m in moves)]
        pixels += [at] * 3
    n = (2 * HALF + 1) ** 2
    return csr_matrix((np.concatenate([v.ravel() for v in values]), (np.concatenate([p.ravel() for p in pixels]), np.repeat(np.arange(len(values)), n))),
                      shape=(shape[0] * shape[1], len(values)))


def tile(folder, cell, seed):
    """Shift of fluxes, and rows of both fits."""
    fwhm = crowded.cell(cell)[1]
    crowded.make(folder, cell, seed)
    crowded.extract(folder, "sim.fits", "NONE", "NONE", "-FILTER_TYPE", "AUTO", "-PSF_TYPE", "MOFFAT", "-PSF_FWHM", fwhm, "-PSF_BETA", BETA, "-GAIN", 1,
                    "-CHECKIMAGE_TYPE", "TEMPLATE_RESIDUAL,TEMPLATE_MODEL", "-CHECKIMAGE_NAME", "left.fits,model.fits")
    table, left, model = crowded.table(f"{folder}/NONE.cat"), crowded.image(f"{folder}/left.fits"), crowded.image(f"{folder}/model.fits")
    flux = 10 ** (-0.4 * (table["MAG_TEMPLATE"] - crowded.ZERO))
    use = np.isfinite(flux) & (table["CLASS_TEMPLATE"] > 0.5)
    x, y, flux, error = (v[use] for v in (table["XTEMPLATE_IMAGE"] - 1, table["YTEMPLATE_IMAGE"] - 1, flux, flux * table["MAGERR_TEMPLATE"] / 1.0857))
    weight = diags((1 / (crowded.SKY + np.maximum(model, 0))).ravel())
    a = columns(x, y, flux, fwhm, model.shape)
    data = left.ravel() + a[:, ::3] @ flux
    alone = spsolve((a[:, ::3].T @ weight @ a[:, ::3]).tocsc(), a[:, ::3].T @ (weight @ data))
    free = [x.copy(), y.copy(), flux.copy()]
    prior = np.tile([0, 1, 1], len(x)) / (0.25 * fwhm) ** 2
    for _ in range(3):
        a = columns(*free, fwhm, model.shape)
        move = spsolve((a.T @ weight @ a + diags(prior)).tocsc(), a.T @ (weight @ (data - a[:, ::3] @ free[2])))
        free = [c + (np.clip(d, -1, 1) if k < 2 else d) for k, (c, d) in enumerate(zip(free, (move[1::3], move[2::3], move[::3])))]
    truth = crowded.table(f"{folder}/sim_truth.fits")
    at = np.column_stack([truth["X_IMAGE"], truth["Y_IMAGE"]]) - 1
    snr, rows = truth["FLUX"] / crowded.unit(fwhm), []
    for name, (u, v, f) in (("groups", (x, y, flux)), ("one fit", free)):
        place = np.column_stack([u, v])
        distance, i = cKDTree(place).query(at)
        good = (distance < fwhm / 2) & (cKDTree(at).query(place)[1][i] == np.arange(len(at))) & (f[i] > 0)
        for low, high in zip(BINS, BINS[1:]):
            k = good & (snr > low) & (snr < high)
            off = -2.5 * np.log10(f[i][k] / truth["FLUX"][k])
            rows.append([name, f"{low} to {high}", int(k.sum()), *(float(w) for w in (np.median(off), crowded.width(off), crowded.width(((f[i] - truth["FLUX"]) / error[i])[k])))])
    return float(np.percentile(abs(alone - flux) / error, 68)), rows


def main(folder, seeds, cells):
    ledger.claim("joint", folder, seeds)
    Path(folder).mkdir(parents=True, exist_ok=True)
    found = [{"cell": c, "seed": s, "shift": shift, "rows": rows} for c in cells for s in seeds for shift, rows in [tile(folder, c, s)]]
    crowded.keep(f"{folder}/joint.json", found)
    text = ["# One sparse fit beside groups", "", "`validation/joint.py`. Shift of fluxes at fixed places, 68 %, in errors; then magnitudes.", "",
            "| cell | seed | shift | fit | S/N | objects | bias | scatter | pull |", "| --- | --- | --- | --- | --- | --- | --- | --- | --- |"]
    for f in found:
        text += [f"| {f['cell']} | {f['seed']} | {f['shift']:.3f} | {r[0]} | {r[1]} | {r[2]} | {r[3]:.4f} | {r[4]:.3f} | {r[5]:.2f} |" for r in f["rows"]]
    (Path(folder) / "joint.md").write_text("\n".join(text) + "\n")
    print("\n".join(text))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    given = [a.split(",") for a in sys.argv[2:]] + [None] * 2
    main(sys.argv[1], [int(s) for s in given[0] or [301]], given[1] or ["8000-4", "20000-4"])
