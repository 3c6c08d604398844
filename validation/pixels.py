#!/usr/bin/python3
"""What restoring makes of skies whose pixels are known: sources that are none, patterns on plateaus, light around galaxies.

    pixels.py OUTPUT [SEED ...]      seeds: 701 702 703

Restorers are given the true PSF (Moffat, beta 4.765, FWHM of 2.5, 4 and 6 pixels), else defaults; tiles of 512 x 512 pixels.

    blank      noise alone: detections per Mpixel, all and without those marked as spurious
    rings      bright stars far apart (magnitude 13 to 18, noise that of 25.2 a pixel): detections that are no star within 6 FWHM, per star
    plateau    a flat square of 200 sigmas without noise, its edges smoothed: rms of the means of the 2 x 2 and of the 4 x 4 phases
               in its middle, in sigmas of the noise that restorers are told
    outskirts  faint galaxies far apart: light within 1 and 2 radii sqrt(r_e^2 + (FWHM / 2)^2) on the restored image over that of
               the scene without noise at its resolution, all galaxies together

Into OUTPUT: pixels.md, summary.json.
"""
import json
import sys
from pathlib import Path

import numpy as np
from astropy.io import fits
from scipy import ndimage

import ledger
import tiles

SKY, NOISE, SIDE, FWHM = 0.87, 0.031, 512, (2.5, 4.0, 6.0)


def simulate(program, name, seed, fwhm, **keywords):
    tile = program.simulate(name, IMAGE_SIZE=SIDE, SEED=seed, PSF_FWHM=fwhm, PSF_BETA=4.765, **({"STAR_COUNT": 0, "GALAXY_COUNT": 0} | keywords))
    tile.keywords |= {"PSF_TYPE": "MOFFAT", "PSF_FWHM": fwhm, "PSF_BETA": 4.765}
    return tile


def blank(program, seed, fwhm):
    runs = program.run(simulate(program, "blank", seed, fwhm))
    return {r: {"false": len(run.table) / 1e-6 / SIDE**2, "unmarked": np.sum(~run.marked) / 1e-6 / SIDE**2} for r, run in runs.items()}


def rings(program, seed, fwhm):
    tile = simulate(program, "rings", seed, fwhm, STAR_COUNT=40, STAR_MAG="13,18")
    found = {}
    for r, run in program.run(tile).items():
        distance = np.array([np.hypot(*(tile.known - p).T).min() for p in run.positions])
        ring = (distance > max(2, fwhm / 2)) & (distance < 6 * fwhm)
        found[r] = {"false": ring.sum() / len(tile.known), "unmarked": (ring & ~run.marked).sum() / len(tile.known)}
    return found


def plateau(program, seed, fwhm):
    tile, shift = simulate(program, "plateau", seed, fwhm), seed % 4
    square = np.zeros((SIDE, SIDE))
    square[SIDE // 4 + shift:3 * SIDE // 4 + shift, SIDE // 4 + shift:3 * SIDE // 4 + shift] = 200 * NOISE
    tile = tile.changed("plateau", SKY + ndimage.gaussian_filter(square, (fwhm + 8) / 2.3548), weight=np.full((SIDE, SIDE), NOISE))
    tile.keywords |= {"BACK_TYPE": "MANUAL", "BACK_VALUE": SKY, "WEIGHT_TYPE": "MAP_RMS", "RESCALE_WEIGHTS": "N"}
    found = {}
    for r, run in program.run(tile, images=("RESTORED",), PARAMETERS_NAME="few.param").items():
        box = run.images["RESTORED"][SIDE // 2 - 64:SIDE // 2 + 64, SIDE // 2 - 64:SIDE // 2 + 64]
        found[r] = {f"phases{n}": np.std([box[y::n, x::n].mean() for y in range(n) for x in range(n)]) / NOISE for n in (2, 4)}
    return found


def outskirts(program, seed, fwhm):
    keywords = {"GALAXY_COUNT": 300, "GALAXY_MAG": "19.5,22.5", "SHARP_NAME": "sharp.fits"}
    simulate(program, "truth", seed, fwhm, NOISE_TYPE="NONE", **keywords)
    scenes = {"NONE": fits.getdata(program.folder / "sim.fits").astype(float), "RL": fits.getdata(program.folder / "sharp.fits").astype(float)}
    scenes = {r: scene - np.median(scene) for r, scene in scenes.items()}
    tile = simulate(program, "outskirts", seed, fwhm, **keywords)
    tile.keywords |= {"BACK_TYPE": "MANUAL", "BACK_VALUE": SKY}
    truth = fits.getdata(program.folder / "truth.fits", 1)
    radius = np.hypot(truth["FLUX_RADIUS"], fwhm / 2)
    y, x = np.indices((SIDE, SIDE))
    inside = tile.known.min(axis=1) > 30, tile.known.max(axis=1) < SIDE - 30
    found = {}
    for r, run in program.run(tile, images=("RESTORED",), PARAMETERS_NAME="few.param").items():
        sums = np.zeros((2, 2))
        for (px, py), r50 in zip(tile.known[np.all(inside, axis=0)] - 1, radius[np.all(inside, axis=0)]):
            for k in (1, 2):
                at = np.hypot(x - px, y - py) <= k * r50
                sums[k - 1] += (run.images["RESTORED"][at] - SKY).sum(), scenes.get(r, scenes["RL"])[at].sum()
        found[r] = {f"r{k}": sums[k - 1, 0] / sums[k - 1, 1] for k in (1, 2)}
    return found


def main(output, seeds):
    ledger.claim("pixels", output, seeds)
    program, rows = tiles.Program(output), []
    text = ["| sky | FWHM | number | " + " | ".join(tiles.RESTORERS) + " |", "| --- " * (3 + len(tiles.RESTORERS)) + "|"]
    for sky in (blank, rings, plateau, outskirts):
        for fwhm in FWHM:
            found = [sky(program, seed, fwhm) for seed in seeds]
            for number in found[0]["NONE"]:
                join = max if sky is plateau else np.mean
                values = {r: float(join([one[r][number] for one in found])) for r in tiles.RESTORERS}
                rows.append({"sky": sky.__name__, "fwhm": fwhm, "number": number, **values})
                text.append(f"| {sky.__name__} | {fwhm:g} | {number} | " + " | ".join(f"{v:.3g}" for v in values.values()) + " |")
    print("\n".join(text))
    (Path(output) / "pixels.md").write_text(f"`{program.version()}`, seeds {seeds}\n\n" + "\n".join(text) + "\n")
    (Path(output) / "summary.json").write_text(json.dumps({"version": program.version(), "seeds": seeds, "rows": rows}, indent=1) + "\n")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1], [int(s) for s in sys.argv[2:]] or [701, 702, 703])
