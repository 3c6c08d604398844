#!/usr/bin/python3
"""Do faint extended sources keep their light? Discs put into a sky, restored with and without them.

    discs.py FOLDER [SEED]      seed 71

16 exponential discs of 24 to 27 mag/arcsec^2 at an effective radius of 10 or 20 pixels (4, 8 arcsec) on 768 x 768 pixels: a simulated sky like SDSS's
(tiles.py) and a piece of the SDSS frame. The restored image with them less the one without is what became of their light: within two effective
radii over what was put in (in the observed pixels: the same, blurred), and the radius of half of what is within four. FOLDER gets discs.md and discs.json. RX_PROGRAM and RX_MODEL as in tiles.py.
"""
import os
import sys

import numpy as np
from scipy.ndimage import gaussian_filter

import ledger
import tiles
from tiles import RESTORERS

SIDE, SCALE, FWHM, APART = 768, 0.396, 3.28, 192
BRIGHTNESS, RADII = (24, 25, 26, 27), (10, 20)


def centres(rng):
    grid = np.arange(APART // 2, SIDE, APART)
    return [(x, y) for x, y in np.array(np.meshgrid(grid, grid)).reshape(2, -1).T + rng.uniform(-0.5, 0.5, (len(grid)**2, 2))]


def discs(at, brightness, radius):
    y, x = np.mgrid[:SIDE, :SIDE]
    level = 10**(-0.4 * (brightness - 22.5)) * SCALE**2
    return gaussian_filter(sum(level * np.exp(-1.678 * (np.hypot(x - u, y - v) / radius - 1)) for u, v in at), FWHM / 2.3548)


def growth(image, at, radius):
    """Light of all discs within 0, 1, ... pixels."""
    y, x = np.mgrid[:SIDE, :SIDE]
    nearest = np.min([np.hypot(x - u, y - v) for u, v in at], 0)  # they do not overlap
    return np.concatenate([[0], np.cumsum(np.histogram(nearest, np.arange(radius + 1), weights=image)[0])])


def skies(program, seed):
    yield "simulated", program.simulate("discs", IMAGE_SIZE=SIDE, SEED=seed, GALAXY_COUNT=100)
    data = tiles.Path(os.environ.get("RX_SHARED_DATA", tiles.TOP / "../shared/data"))
    if data.is_dir():
        whole = tiles.sdss_frame(data)
        piece = whole.changed("SDSS frame", whole.pixels[300:300 + SIDE, 700:700 + SIDE])
        piece.header, piece.keywords["PSF_TYPE"] = tiles.fits.Header(), "AUTO"
        yield "SDSS frame", piece


def main(folder, seed):
    ledger.claim("discs", folder, [seed])
    program, rng, rows = tiles.Program(folder), np.random.default_rng(seed), []
    text = ["# Faint discs", "", f"`validation/discs.py`, seed {seed}: light within two effective radii and half-light radius, restored over put in.", "",
            "| sky | mag/arcsec^2 | effective radius, pixels | " + " | ".join(f"{r}: light | size" for r in RESTORERS) + " |", "| --- " * (3 + 2 * len(RESTORERS)) + "|"]
    for name, tile in skies(program, seed):
        at = centres(rng)
        images = lambda t: {r: run.images["RESTORED"] for r, run in program.run(t, RESTORERS, ("RESTORED", ), PARAMETERS_NAME="few.param", NTHREADS=1).items()}
        before = images(tile)
        for brightness in BRIGHTNESS:
            for radius in RADII:
                put = discs(at, brightness, radius)
                after = images(tile.changed(tile.name, tile.pixels + put))
                row = {"sky": name, "brightness": brightness, "radius": radius}
                for r in RESTORERS:
                    found, true = (growth(image, at, 4 * radius) for image in (after[r] - before[r], put))
                    half = [np.interp(sums[-1] / 2, sums, np.arange(len(sums))) for sums in (found, true)]
                    row[r] = [found[2 * radius] / true[2 * radius], half[0] / half[1]]
                rows.append(row)
                text.append(f"| {name} | {brightness} | {radius} | " + " | ".join(f"{row[r][0]:.3f} | {row[r][1]:.2f}" for r in RESTORERS) + " |")
                print(text[-1], flush=True)
    ledger.store(folder, "discs", text, {"seed": seed, "rows": rows})


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 71)
