#!/usr/bin/python3
"""Does a list with PRECISION_TARGET have that precision, on how many tiles, and how deep is it?

    precision.py FOLDER [SEED [TILES [CELL[,CELL...]]]]     seed 31, 20 tiles of each cell

Cells as in preal.py, whose tiles these are. Tile k has the seed 1000 SEED + k. REXTRACT, SIMULATE and RX_MODEL as in crowded.py,
RX_PROGRAMS the restorers (NONE,RL,NET), RX_TARGETS the precisions (0,0.9,0.95,0.98; 0: by default). A source is one where a true object lies within one FWHM that no brighter source has, or where
half of its flux and more is, under its template, that of true objects which no brighter one has (preal.py). Sources nearer to the border than one FWHM are left out, and those that
could not be tested. By default: the list without PRECISION_TARGET. Recall: of true objects of S/N above 5 (the two lists have their own). FOLDER gets precision.json
and precision.md.
"""
import os
import subprocess
import sys

import numpy as np
from astropy.io import fits
from scipy.spatial import cKDTree

import ledger
import preal

CELLS = ["300-2.5G", "300-4", "300-4G", "300-6H", "2000-4", "2000-4T", "300-4GC", "8000-4"]
TARGETS = [float(t) for t in os.environ.get("RX_TARGETS", "0,0.9,0.95,0.98").split(",")]


def sources(folder, name, by, target):
    """Of each source whether it is one, and the recall."""
    preal.checks = lambda *_: ["-BLANK_CHECK", "0", "-PRECISION_TARGET", str(target)]
    t, fwhm = preal.extract(folder, name, by, f"P{target}"), preal.kind(name)[1]
    with fits.open(f"{folder}/sim_truth.fits") as hdus:
        truth = hdus[1].data
        at = np.column_stack([truth["X_IMAGE"], truth["Y_IMAGE"]])
        snr = 10**(-0.4 * (np.array(truth["MAG"], float) - preal.ZERO)) / preal.unit(fwhm)
    tree, used, side = cKDTree(at), np.zeros(len(at), bool), preal.kind(name)[4]
    real = np.isfinite(t["true_snr"]) | (t["light"] >= 0.5)
    for k in np.argsort(-np.nan_to_num(t["SNR_TEMPLATE"], nan=-9), kind="stable"):
        near = [j for j in tree.query_ball_point([t["XTEMPLATE_IMAGE"][k], t["YTEMPLATE_IMAGE"][k]], fwhm) if not used[j]]
        if near:
            used[max(near, key=lambda j: snr[j])] = real[k] = True
    inside = np.all((at > 0.5 + fwhm) & (at < side + 0.5 - fwhm), axis=1) & (snr * np.sqrt(preal.kind(name)[5]) >= 5)
    return real[np.isfinite(t["P_REAL"])], used[inside].mean()


def main():
    folder, seed = os.path.abspath(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 31
    tiles = int(sys.argv[3]) if len(sys.argv) > 3 else 20
    names = sys.argv[4].split(",") if len(sys.argv) > 4 else CELLS
    ledger.claim("precision", folder, [seed])
    rows = []
    for name in names:
        for by in os.environ.get("RX_PROGRAMS", "NONE,RL,NET").split(","):
            for target in TARGETS:
                found = [sources(f"{folder}/{name}-{1000 * seed + k}", name, by, target) for k in range(tiles)]
                precision = np.array([real.mean() if len(real) else 1.0 for real, _ in found])
                rows.append({"cell": name, "by": by, "target": target, "tiles": tiles, "listed": float(np.mean([len(real) for real, _ in found])),
                             "precision": float(precision.mean()), "least": float(precision.min()), "kept": float((precision >= target).mean()),
                             "recall": float(np.mean([recall for _, recall in found]))})
                print({k: round(v, 3) if isinstance(v, float) else v for k, v in rows[-1].items()}, flush=True)
    text = ["# Lists of a promised precision", "", f"`validation/precision.py`, seed {seed}, {tiles} tiles of each cell: sources a tile; mean precision, the least; share of the tiles "
            "that have PRECISION_TARGET; recall of objects of S/N above 5.", "",
            "| cell | | by default | " + " | ".join(f"PRECISION_TARGET {t}" for t in TARGETS[1:]) + " |", "| --- | --- |" + " --- |" * len(TARGETS)]
    for name in names:
        for by in dict.fromkeys(r["by"] for r in rows):
            some = [r for r in rows if (r["cell"], r["by"]) == (name, by)]
            text.append(f"| {name} | {by} | " + " | ".join(
                f"{r['listed']:.0f}; {r['precision']:.3f}, {r['least']:.3f}" + (f"; {r['kept']:.2f}" if r["target"] else "") + f"; {r['recall']:.3f}" for r in some) + " |")
    ledger.store(folder, "precision", text, {"seed": seed, "rows": rows})


if __name__ == "__main__":
    try:
        main()
    except (OSError, KeyError, subprocess.CalledProcessError) as problem:
        raise SystemExit(f"precision.py: {problem}") from problem
