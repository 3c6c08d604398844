#!/usr/bin/env python3
"""Column by column, NAME.sex.fits (source-extractor) against NAME.rx.fits (rextract) in this folder.

Rows are matched by position within 0.05 pixel. Deblended sources (FLAGS bit 2 in either) share the pixels
between them by lots in both programs, with different random numbers: they are counted apart, and the limits
hold for the others, and for FLUX_AUTO of all where less than half of the tile is deblended. Prints markdown; exit 1 when a limit is broken.

usage: compare.py NAME...
"""
import sys
import warnings

import numpy as np
from astropy.table import Table
from scipy.spatial import cKDTree

warnings.filterwarnings("ignore")
MATCH = 0.05  # pixel

# column: (kind of difference, limit of the median, limit of the 90 % quantile); None: printed only
COLUMNS = {
    "X_IMAGE": ("pixel", 1e-4, 1e-3), "Y_IMAGE": ("pixel", 1e-4, 1e-3),
    "A_IMAGE": ("relative", 1e-5, 1e-3), "B_IMAGE": ("relative", 1e-5, 1e-3), "THETA_IMAGE": ("deg", 0.01, 0.1),
    "CXX_IMAGE": ("relative", 1e-5, 1e-3), "X2_IMAGE": ("relative", 1e-5, 1e-3),
    "ERRX2_IMAGE": ("relative", 1e-4, 1e-2),
    "XPEAK_IMAGE": ("pixel", 0, 0), "YPEAK_IMAGE": ("pixel", 0, 0), "XMIN_IMAGE": ("pixel", 0, 0),
    "YMAX_IMAGE": ("pixel", 0, 0), "ISOAREA_IMAGE": ("pixel", 0, 0), "ISOAREAF_IMAGE": ("pixel", 0, 0),
    "ISO0": ("pixel", 0, 0), "ISO4": ("pixel", 0, 0),
    "FLUX_ISO": ("mmag", 0.5, 20), "FLUXERR_ISO": ("relative", 1e-5, 1e-3),
    "FLUX_ISOCOR": ("mmag", 0.5, 20), "FLUX_AUTO": ("mmag", 0.5, 20), "FLUXERR_AUTO": ("relative", 1e-5, 1e-2),
    "KRON_RADIUS": ("relative", 1e-4, 1e-2), "FLUX_PETRO": ("mmag", 0.5, 20),
    "FLUX_APER": ("relative", 1e-5, 1e-3), "FLUXERR_APER": ("relative", 1e-5, 1e-3),
    "FLUX_RADIUS": ("relative", 1e-4, 1e-2), "FLUX_MAX": ("mmag", 0.5, 20), "FWHM_IMAGE": ("relative", 1e-4, 1e-2),
    "BACKGROUND": ("relative", None, None), "THRESHOLD": ("relative", 1e-5, 1e-3),
    "CLASS_STAR": ("absolute", 1e-3, 1e-2),
    "XWIN_IMAGE": ("pixel", 1e-3, 0.05), "YWIN_IMAGE": ("pixel", 1e-3, 0.05), "X2WIN_IMAGE": ("relative", 1e-4, 1e-2),
    "AWIN_IMAGE": ("relative", 1e-4, 1e-2), "ERRX2WIN_IMAGE": ("relative", 1e-3, 1e-2), "FLUX_WIN": ("mmag", 0.5, 20),
    "SNR_WIN": ("relative", 1e-4, 1e-2), "FLAGS": ("differ", 0, 0), "FLAGS_WIN": ("differ", 0, 0),
}
REASONS = {
    "BACKGROUND": "at the centroid from the spline that was subtracted; source-extractor interpolates linearly",
    "FLUX_APER": "single precision of pixels minus a sky of thousands of ADU",
}


def column(table, name):
    values = np.asarray(table[name], dtype=float)
    return values[:, 0] if values.ndim > 1 else values


def difference(kind, x, y):
    with np.errstate(all="ignore"):
        if kind == "mmag":
            both = (x > 0) & (y > 0)
            return np.where(both, 2500 * np.abs(np.log10(np.where(both, y / x, 1))), np.where(x == y, 0, 9e9))
        if kind == "relative":
            return np.abs(y - x) / np.maximum(np.abs(x), 1e-30)
        if kind == "deg":
            turn = np.abs(y - x) % 180
            return np.minimum(turn, 180 - turn)
        if kind == "differ":
            return (x != y).astype(float)
        return np.abs(y - x)


def main():
    broken, rows, parts = [], {}, []
    print("| tile | source-extractor | rextract | within 0.05 pixel | deblended | AUTO, all: median, 90 % (mmag) |")
    print("| --- | --- | --- | --- | --- | --- |")
    for name in sys.argv[1:]:
        a, b = Table.read(name + ".sex.fits", 1), Table.read(name + ".rx.fits", 1)
        xy = [np.c_[np.asarray(t["X_IMAGE"], float), np.asarray(t["Y_IMAGE"], float)] for t in (a, b)]
        distance, index = cKDTree(xy[1]).query(xy[0])
        near = distance < MATCH
        sex, ours = a[near], b[index[near]]
        plain = ((sex["FLAGS"] | ours["FLAGS"]) & 2) == 0
        auto = difference("mmag", column(sex, "FLUX_AUTO"), column(ours, "FLUX_AUTO"))
        print(f"| {name} | {len(a)} | {len(b)} | {100 * near.mean():.2f} % | {100 * (~plain).mean():.1f} % "
              f"| {np.median(auto):.2g}, {np.quantile(auto, 0.9):.2g} |")
        # a handful of sources may differ on any tile: a limit in per cent says nothing there
        slack = max(3, 0.005 * len(a))
        if abs(len(a) - len(b)) > slack:
            broken.append(f"{name}: {len(b)} detections, source-extractor has {len(a)}")
        # the lots of blends alone move it from 99.4 to 99.6 % (M67, spitzer; other random numbers in either program)
        if (~near).sum() > max(6, 0.0075 * len(a)):
            broken.append(f"{name}: {100 * near.mean():.2f} % within {MATCH} pixel, less than 99.25 %")
        if np.median(auto) > 0.5 and len(a) > 100:
            broken.append(f"{name}: FLUX_AUTO of all sources differs by {np.median(auto):.3g} mmag in the median")
        if np.quantile(auto, 0.9) > 20 and (~plain).mean() < 0.5:
            broken.append(f"{name}: FLUX_AUTO of all sources differs by {np.quantile(auto, 0.9):.3g} mmag at 90 %")
        for c, (kind, _, _) in COLUMNS.items():
            rows.setdefault(c, []).append(difference(kind, column(sex, c), column(ours, c))[np.asarray(plain)])
        parts.append(len(sex))
    print()
    print("| column | difference | median | 90 % | 99 % | largest | reason |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for c, (kind, middle, most) in COLUMNS.items():
        d = np.concatenate(rows[c])
        q = np.quantile(d, [0.5, 0.9, 0.99])
        print(f"| {c} | {kind} | {q[0]:.1e} | {q[1]:.1e} | {q[2]:.1e} | {d.max():.1e} | {REASONS.get(c, '')} |")
        if middle is not None and (q[0] > middle or q[1] > most):
            broken.append(f"{c}: median {q[0]:.2e} (limit {middle:g}), 90 % {q[1]:.2e} (limit {most:g})")
    print(f"\n{sum(parts)} matched sources on {len(parts)} tiles; the second table leaves the deblended ones out.")
    for text in broken:
        print("compare: limit broken:", text, file=sys.stderr)
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
