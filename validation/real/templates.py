#!/usr/bin/env python3
"""What templates leave of a real tile.

usage: templates.py chi2 RESTORERS NAME...            a table for all tiles
       templates.py picture RESTORERS NAME OUT.png    original, model and residual of one
       templates.py sdss RESTORERS FOLDER...          magnitudes against a reference: two QA reports side by side

NAME_<restorer>.cat and NAME_image_, NAME_model_, NAME_chi_<restorer>.fits are of templates.sh. chi2: mean square of
(pixel - model) over its noise of sky and photons, at least 8 pixels from saturated or masked ones; "covered": where the
model is above 1 sigma of a pixel, "bright": above 10; "cells": median over cells of 32 x 32 pixels.
"""
import json
import sys

import numpy as np
from astropy.io import fits
from astropy.table import Table
from scipy import ndimage

from picture import plt

AWAY, CELL = 8, 32


def sky_noise(image):
    values = image[np.isfinite(image)]
    return 1.4826 * np.median(np.abs(values - np.median(values)))


def cell_means(values, good):
    height, width = (n // CELL * CELL for n in values.shape)
    shape = (height // CELL, CELL, width // CELL, CELL)
    total = np.where(good, values, 0)[:height, :width].reshape(shape).sum(axis=(1, 3))
    count = good[:height, :width].reshape(shape).sum(axis=(1, 3))
    return total[count > CELL * CELL / 4] / count[count > CELL * CELL / 4]


def chi2_row(name, run):
    chi = fits.getdata(f"{name}_chi_{run}.fits").astype(float)
    model = fits.getdata(f"{name}_model_{run}.fits").astype(float)
    good = np.isfinite(chi)
    good &= ~ndimage.binary_dilation(~good, iterations=AWAY)
    square = np.where(good, chi, 0) ** 2
    noise = sky_noise(fits.getdata(f"{name}_image_NONE.fits").astype(float))
    covered, bright = good & (model > noise), good & (model > 10 * noise)
    cells = cell_means(square, good)
    sources = Table.read(f"{name}_{run}.cat", hdu=1)
    restore = np.array(sources["FLAGS_RESTORE"])
    mean = lambda where: square[where].mean() if where.sum() > 100 else np.nan
    return (f"| {name} | {run} | {len(sources)} | {np.sum(restore & 8 > 0)} | {np.sum(restore & 3 > 0)} | "
            f"{mean(good):.2f} | {np.median(cells):.2f} | {mean(covered):.2f} | {mean(bright):.2f} |")


def chi2(restorers, names):
    print("| tile | restorer | sources | added | not wanted | chi2 | cells | covered | bright |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for name in names:
        for run in restorers:
            try:
                print(chi2_row(name, run))
            except FileNotFoundError:
                continue


def window(model, side):
    if min(model.shape) <= side:
        return slice(None), slice(None)
    light = ndimage.uniform_filter(np.arcsinh(np.clip(np.nan_to_num(model), 0, None)), side, mode="constant")
    half = side // 2
    inner = light[half:light.shape[0] - half, half:light.shape[1] - half]
    y, x = np.unravel_index(np.argmax(inner), inner.shape)
    return slice(y, y + side), slice(x, x + side)


def picture(restorers, name, out, side=300):
    if not plt:
        return
    image = np.nan_to_num(fits.getdata(f"{name}_image_NONE.fits").astype(float))
    noise = sky_noise(image)
    cut = window(fits.getdata(f"{name}_model_NONE.fits").astype(float) / noise, side)
    panels = [("original", image, 0)]
    for run in restorers:
        try:
            panels.append((f"model, shapes by {run}", fits.getdata(f"{name}_model_{run}.fits").astype(float), 0))
            panels.append((f"residual {run} [sigma]", fits.getdata(f"{name}_chi_{run}.fits").astype(float), 1))
        except FileNotFoundError:
            continue
    figure, axes = plt.subplots(1, len(panels), figsize=(3.6 * len(panels), 3.9), squeeze=False)
    for axis, (title, plane, linear) in zip(axes[0], panels):
        shown = plane[cut] if linear else np.arcsinh(plane[cut] / (2 * noise))
        low, high = (-5, 5) if linear else (-0.5, 5)
        axis.set_facecolor("#884444")
        axis.imshow(shown, origin="lower", cmap="gray", vmin=low, vmax=high, interpolation="nearest")
        axis.set_title(title, fontsize=10)
        axis.set_xticks([])
        axis.set_yticks([])
    plt.tight_layout()
    plt.savefig(out, dpi=80, metadata={"Software": None})
    plt.close(figure)


def sdss(restorers, folders):
    tables = {folder: Table.read(f"{folder}/bins.ecsv") for folder in folders}
    print("| magnitude | restorer | n | " + " | ".join(
        f"{folder.removeprefix('qa_')} bias [mag] | scatter [mag] | MagErr [%]" for folder in folders) + " |")
    print("| --- | --- | --- | " + " | ".join("--- | --- | ---" for _ in folders) + " |")
    first = tables[folders[0]]
    for low in sorted(set(first["mag_low"][np.isfinite(first["mag_low"])])):
        for run in restorers:
            cells, count = [], 0
            for folder in folders:
                table = tables[folder]
                row = table[(table["run"] == run) & (table["mag_low"] == low)][0]
                count = row["bias_mag_n"]
                cells.append(f"{row['bias_mag']:+.3f} | {row['scatter_mag']:.3f} | {row['magerr']:.1f}")
            print(f"| {low:g}..{low + 1:g} | {run} | {count} | " + " | ".join(cells) + " |")
    for folder in folders:
        with open(f"{folder}/summary.json", encoding="utf-8") as file:
            runs = json.load(file)["runs"]
        for run in runs:
            if run["spurious"] is not None:
                print(f"\n{folder.removeprefix('qa_')} {run['run']}: precision {run['precision']['value']:.3f}, "
                      f"{run['spurious']:g} marked ({run['spurious_per_mpixel']:.3g} per Mpixel), "
                      f"{run['spurious_matched']:g} of them matched; precision without them {run['precision_without']:.3f}")


if __name__ == "__main__":
    kind, runs, rest = sys.argv[1], sys.argv[2].split(","), sys.argv[3:]
    if kind == "chi2":
        chi2(runs, rest)
    elif kind == "picture":
        picture(runs, rest[0], rest[1])
    else:
        sdss(runs, rest)
