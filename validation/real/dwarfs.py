#!/usr/bin/env python3
"""Dwarf galaxies of low surface brightness: what restoring does to their light. A table and dwarf_<name>.png.

usage: dwarfs.py GALAXIES_FOLDER RESTORERS NAME...     in the folder of run.sh

Flux on restored pixels over that of the unrestored image, in round apertures around the brightest smoothed point, and
in the annulus that holds the outskirts; detections within the outer aperture: a galaxy in pieces is shredded.
"""
import sys

import numpy as np
from astropy.io import fits
from scipy import ndimage

import picture

RADII = (10, 20, 40)  # pixels


def main():
    folder, restorers, names = sys.argv[1], sys.argv[2].split(","), sys.argv[3:]
    print("| galaxy | run | " + " | ".join(f"flux ratio, r < {r} px" for r in RADII) +
          f" | {RADII[1]} to {RADII[2]} px | detections, r < {RADII[2]} px |")
    print("| --- | --- | " + "--- | " * (len(RADII) + 2))
    for name in names:
        none = picture.above_sky(f"dwarf_{name}", "NONE")
        smooth = ndimage.gaussian_filter(none, 4)
        y, x = np.indices(none.shape)
        y0, x0 = ndimage.center_of_mass(smooth * (smooth > 0.5 * smooth.max()))
        distance = np.hypot(x - x0, y - y0)
        for run in restorers:
            image = picture.above_sky(f"dwarf_{name}", run)
            sums = [image[distance < r].sum() / none[distance < r].sum() for r in RADII]
            ring = (distance >= RADII[1]) & (distance < RADII[2])
            table = fits.getdata(f"dwarf_{name}_{run}.cat", 1)
            n = int((np.hypot(table["X_IMAGE"] - 1 - x0, table["Y_IMAGE"] - 1 - y0) < RADII[2]).sum())
            print(f"| {name} | {run} | " + " | ".join(f"{s:.3f}" for s in sums) +
                  f" | {image[ring].sum() / none[ring].sum():.3f} | {n} |")
        picture.draw(f"dwarf_{name}", restorers, f"dwarf_{name}.png", side=None)


if __name__ == "__main__":
    main()
